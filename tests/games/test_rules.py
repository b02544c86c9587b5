"""The rules, case by case, on constructed events."""

import numpy as np
import pytest

from billiards_env import Scene, simulate
from billiards_env.games.facts import Facts, facts_of
from billiards_env.games.rules import RULES
from billiards_env.games.state import NO_CALL, RuleState, Verdict, next_state
from billiards_env.rules import FOULS, IN_HAND
from tests.helpers.games import events, facts, state

straight, eight_ball, nine_ball = (RULES[name].judge for name in ("straight", "eight_ball", "nine_ball"))
carom, three_cushion = RULES["carom"].judge, RULES["three_cushion"].judge
lowest_ball, group_or_eight = RULES["nine_ball"].legal, RULES["eight_ball"].legal

# facts_of


def test_no_events_give_empty_facts():
    assert facts() == Facts()


def test_the_first_ball_does_not_depend_on_the_order_within_an_event():
    assert facts(("cushion", 0), ("hit", 3, 0), ("hit", 3, 5), ("hit", 0, 5)).first == (3,)


def test_balls_touched_at_the_same_instant_are_all_first():
    log = events(("hit", 0, 4), ("hit", 0, 2), ("hit", 0, 7), times=[1.0, 1.0, 1.5])
    assert facts_of(log).first == (4, 2)


def test_contacts_between_other_balls_are_not_first_contacts():
    assert facts(("hit", 2, 3), ("cushion", 3)) == Facts(driven=frozenset({3}))


def test_touched_balls_have_the_number_of_cushions_before():
    log = (("cushion", 0), ("hit", 0, 2), ("cushion", 2), ("cushion", 0), ("hit", 2, 0), ("cushion", 0), ("hit", 1, 0))
    assert facts(*log).touched == ((2, 1), (1, 3))


def test_a_cushion_counts_only_after_the_first_contact():
    assert not facts(("cushion", 0), ("hit", 0, 1)).cushion_after
    assert facts(("hit", 0, 1), ("cushion", 0)).cushion_after
    assert facts(("hit", 0, 1), ("cushion", 1)).cushion_after
    assert facts(("hit", 0, 1), ("hit", 1, 2), ("cushion", 2)).cushion_after
    assert facts(("hit", 0, 1), ("pocket", 1)).cushion_after
    assert not facts(("cushion", 0), ("cushion", 0)).cushion_after


def test_potted_balls_are_in_order_and_count_as_driven():
    found = facts(("hit", 0, 1), ("pocket", 7), ("cushion", 4), ("cushion", 4), ("pocket", 0), ("pocket", 2))
    assert found.potted == (7, 0, 2)
    assert found.driven == {7, 4, 2}


def test_the_cue_ball_may_have_another_number():
    found = facts(("cushion", 2), ("hit", 0, 2), ("cushion", 0), ("hit", 1, 2), cue=2)
    assert found == Facts((0,), ((0, 1), (1, 1)), (), True, frozenset({0}), cue_driven=True)


def test_other_events_have_no_effect():
    assert facts(("sliding_rolling", 0), ("rolling_rest", 0), ("spinning_rest", 0)) == Facts()


def test_facts_of_a_real_shot():
    scene = Scene.named("pool")
    shot = simulate(scene, [[-0.635, 0.0], [0.635, 0.3]], [2.0, 0.45], record=True)
    assert shot.events is not None
    found = facts_of(shot.events)
    assert found.first == (shot.first_hit,) == (1,)
    assert found.potted == (1,)
    assert found.cushion_after


# Legal balls


def test_nine_ball_requires_the_lowest_ball():
    assert lowest_ball(state("nine_ball"), 0) == {1}
    assert lowest_ball(state("nine_ball", on_table=(9, 4, 7)), 1) == {4}


def test_eight_ball_requires_the_group_and_then_the_eight_ball():
    assert group_or_eight(state("eight_ball"), 0) == {*range(1, 8), *range(9, 16)}
    assert group_or_eight(state("eight_ball", solids=0), 0) == set(range(1, 8))
    assert group_or_eight(state("eight_ball", solids=0), 1) == set(range(9, 16))
    assert group_or_eight(state("eight_ball", solids=1, on_table=(3, 8, 12)), 0) == {12}
    assert group_or_eight(state("eight_ball", solids=1, on_table=(3, 8)), 0) == {8}
    assert group_or_eight(state("eight_ball", on_table=(8,)), 0) == {8}
    assert group_or_eight(state("eight_ball", break_shot=True), 0) == set(range(1, 16))


# Fouls of nine ball and eight ball.


@pytest.mark.parametrize(
    ("rules", "fields", "log", "foul"),
    [
        ("nine_ball", {}, [("hit", 0, 1), ("cushion", 1)], ""),
        ("nine_ball", {}, [("hit", 0, 1), ("cushion", 0)], ""),
        ("nine_ball", {}, [("hit", 0, 1), ("hit", 1, 5), ("cushion", 5)], ""),
        ("nine_ball", {}, [("hit", 0, 1), ("pocket", 1)], ""),
        ("nine_ball", {}, [], "no_hit"),
        ("nine_ball", {}, [("cushion", 0)], "no_hit"),
        ("nine_ball", {}, [("hit", 0, 2), ("hit", 0, 1), ("cushion", 1)], "wrong_ball"),
        ("nine_ball", {"on_table": (2, 9)}, [("hit", 0, 2), ("cushion", 2)], ""),
        ("nine_ball", {"on_table": (2, 9)}, [("hit", 0, 9), ("cushion", 2)], "wrong_ball"),
        ("nine_ball", {}, [("hit", 0, 1)], "no_cushion"),
        ("nine_ball", {}, [("cushion", 0), ("hit", 0, 1)], "no_cushion"),
        ("nine_ball", {}, [("hit", 0, 1), ("cushion", 1), ("pocket", 0)], "scratch"),
        ("nine_ball", {}, [("pocket", 0)], "scratch"),
        ("nine_ball", {}, [("hit", 0, 2), ("pocket", 0)], "scratch"),
        ("eight_ball", {}, [("hit", 0, 5), ("cushion", 5)], ""),
        ("eight_ball", {}, [("hit", 0, 15), ("cushion", 5)], ""),
        ("eight_ball", {}, [("hit", 0, 8), ("cushion", 8)], "wrong_ball"),
        ("eight_ball", {"solids": 0}, [("hit", 0, 7), ("cushion", 7)], ""),
        ("eight_ball", {"solids": 0}, [("hit", 0, 9), ("cushion", 9)], "wrong_ball"),
        ("eight_ball", {"solids": 1}, [("hit", 0, 7), ("cushion", 7)], "wrong_ball"),
        ("eight_ball", {"solids": 1}, [("hit", 0, 9), ("cushion", 9)], ""),
        ("eight_ball", {"solids": 0}, [("hit", 0, 8), ("cushion", 8)], "wrong_ball"),
        ("eight_ball", {"solids": 0, "on_table": (8, 9)}, [("hit", 0, 8), ("cushion", 8)], ""),
        ("eight_ball", {"solids": 0}, [("hit", 0, 7)], "no_cushion"),
        ("eight_ball", {"solids": 0}, [("cushion", 0)], "no_hit"),
        ("eight_ball", {"solids": 0}, [("hit", 0, 7), ("pocket", 7), ("pocket", 0)], "scratch"),
    ],
)
def test_fouls(rules, fields, log, foul):
    verdict = RULES[rules].judge(state(rules, **fields), facts(*log), NO_CALL)
    assert verdict.foul == foul
    assert verdict.in_hand == ("anywhere" if foul else "no")
    assert not (foul and verdict.continues)
    assert not verdict.over


def test_a_split_hit_counts_as_the_legal_ball_first():
    log = events(("hit", 0, 2), ("hit", 0, 1), ("cushion", 1), times=[1.0, 1.0, 2.0])
    assert nine_ball(state("nine_ball"), facts_of(log)).foul == ""
    assert nine_ball(state("nine_ball", on_table=(3, 9)), facts_of(log)).foul == "wrong_ball"


# Nine ball.


def test_nine_ball_any_legal_pot_continues():
    verdict = nine_ball(state("nine_ball"), facts(("hit", 0, 1), ("hit", 1, 6), ("pocket", 6)))
    assert verdict == Verdict(continues=True)


def test_nine_ball_a_miss_passes_the_turn():
    assert nine_ball(state("nine_ball"), facts(("hit", 0, 1), ("cushion", 1))) == Verdict()


def test_nine_ball_is_won_early_by_a_combination():
    verdict = nine_ball(state("nine_ball", player=1), facts(("hit", 0, 1), ("hit", 1, 9), ("pocket", 9)))
    assert verdict == Verdict(continues=True, over=True, winner=1)


def test_nine_ball_is_won_by_the_last_ball():
    verdict = nine_ball(state("nine_ball", on_table=(9,)), facts(("hit", 0, 9), ("pocket", 9)))
    assert (verdict.over, verdict.winner) == (True, 0)


@pytest.mark.parametrize(
    "log",
    [
        [("hit", 0, 9), ("pocket", 9)],
        [("hit", 0, 1), ("pocket", 9), ("pocket", 0)],
        [("hit", 0, 2), ("pocket", 9), ("pocket", 2)],
    ],
)
def test_nine_ball_only_the_nine_is_spotted_after_a_foul(log):
    before = state("nine_ball")
    verdict = nine_ball(before, facts(*log))
    assert verdict.foul
    assert verdict.spotted == (9,)
    assert not verdict.over
    now = next_state(before, facts(*log), verdict)
    assert 9 in now.on_table
    assert (2 in now.on_table) == (("pocket", 2) not in log)


def test_nine_ball_break_needs_a_pot_or_four_balls_at_cushions():
    before = state("nine_ball", break_shot=True, in_hand="behind")
    three = [("hit", 0, 1), ("cushion", 2), ("cushion", 3), ("cushion", 4), ("cushion", 4), ("cushion", 0)]
    assert nine_ball(before, facts(*three)) == Verdict("illegal_break", in_hand="anywhere")
    assert nine_ball(before, facts(*three, ("cushion", 9))) == Verdict(choices=("push_out",))
    assert nine_ball(before, facts(*three, ("pocket", 5))) == Verdict(continues=True, choices=("push_out",))
    assert nine_ball(before, facts(*three, ("pocket", 9))) == Verdict(continues=True, over=True, winner=0)
    assert nine_ball(before._replace(break_shot=False), facts(*three)) == Verdict()


def test_nine_ball_break_must_touch_the_one_first():
    before = state("nine_ball", break_shot=True)
    assert nine_ball(before, facts(("hit", 0, 3), ("pocket", 3))).foul == "wrong_ball"


# Eight ball.


def test_eight_ball_the_table_is_open_after_the_break():
    before = state("eight_ball", break_shot=True, in_hand="behind")
    verdict = eight_ball(before, facts(("hit", 0, 1), ("pocket", 3)))
    assert verdict == Verdict(continues=True)
    assert next_state(before, facts(("hit", 0, 1), ("pocket", 3)), verdict).solids == -1


def test_eight_ball_break_without_a_pot_passes_the_turn():
    before = state("eight_ball", break_shot=True)
    assert eight_ball(before, facts(("hit", 0, 1))) == Verdict()
    assert eight_ball(before, facts(("hit", 0, 1), *(("cushion", b) for b in range(1, 5)))) == Verdict()


def test_eight_ball_break_may_touch_the_eight_first():
    assert eight_ball(state("eight_ball", break_shot=True), facts(("hit", 0, 8), ("pocket", 2))).continues


def test_eight_ball_break_foul_gives_the_cue_ball_behind_the_head_string():
    before = state("eight_ball", break_shot=True)
    assert eight_ball(before, facts(("hit", 0, 1), ("pocket", 2), ("pocket", 0))) == Verdict(
        "scratch", in_hand="behind"
    )
    assert eight_ball(before, facts(("cushion", 0))) == Verdict("no_hit", in_hand="behind")


def test_eight_ball_potted_on_the_break_is_spotted():
    before = state("eight_ball", break_shot=True)
    assert eight_ball(before, facts(("hit", 0, 1), ("pocket", 8))) == Verdict(continues=True, spotted=(8,))
    scratch = facts(("hit", 0, 1), ("pocket", 8), ("pocket", 0))
    assert eight_ball(before, scratch) == Verdict("scratch", in_hand="behind", spotted=(8,))
    assert 8 in next_state(before, scratch, eight_ball(before, scratch)).on_table


@pytest.mark.parametrize("player", [0, 1])
@pytest.mark.parametrize(("ball", "solid"), [(7, True), (9, False)])
def test_eight_ball_the_first_legal_pot_chooses_the_groups(player, ball, solid):
    before = state("eight_ball", player=player)
    verdict = eight_ball(before, facts(("hit", 0, 12), ("hit", 12, ball), ("pocket", ball)))
    assert verdict == Verdict(continues=True, solids=player if solid else 1 - player)


def test_eight_ball_the_first_potted_ball_chooses_the_group():
    verdict = eight_ball(state("eight_ball"), facts(("hit", 0, 12), ("pocket", 12), ("pocket", 3)))
    assert verdict == Verdict(continues=True, solids=1)


def test_eight_ball_a_foul_chooses_no_group():
    before = state("eight_ball")
    log = facts(("hit", 0, 3), ("pocket", 3), ("pocket", 0))
    verdict = eight_ball(before, log)
    assert verdict == Verdict("scratch", in_hand="anywhere")
    assert 3 not in next_state(before, log, verdict).on_table


def test_eight_ball_continues_only_after_a_ball_of_the_group():
    before = state("eight_ball", solids=1)  # player 0 has the stripes
    assert not eight_ball(before, facts(("hit", 0, 9), ("pocket", 3))).continues
    assert eight_ball(before, facts(("hit", 0, 9), ("pocket", 9))).continues
    assert eight_ball(before, facts(("hit", 0, 9), ("pocket", 3), ("pocket", 10))).continues
    assert eight_ball(before, facts(("hit", 0, 9), ("pocket", 3))).solids == 1


def test_eight_ball_is_won_by_the_eight_after_the_group():
    before = state("eight_ball", solids=1, on_table=(2, 8))
    verdict = eight_ball(before, facts(("hit", 0, 8), ("pocket", 8)))
    assert (verdict.foul, verdict.over, verdict.winner) == ("", True, 0)


def test_eight_ball_is_won_even_if_another_ball_is_potted():
    before = state("eight_ball", solids=1, on_table=(2, 8))
    assert eight_ball(before, facts(("hit", 0, 8), ("pocket", 2), ("pocket", 8))).winner == 0


@pytest.mark.parametrize(
    ("fields", "log", "foul"),
    [
        # before the group is potted
        ({"solids": 0}, [("hit", 0, 1), ("hit", 1, 8), ("pocket", 8)], ""),
        # with the table open
        ({}, [("hit", 0, 1), ("hit", 1, 8), ("pocket", 8)], ""),
        # in the same shot as the last ball of the group, in either order
        ({"solids": 0, "on_table": (1, 8, 9)}, [("hit", 0, 1), ("pocket", 1), ("pocket", 8)], ""),
        ({"solids": 0, "on_table": (1, 8, 9)}, [("hit", 0, 1), ("pocket", 8), ("pocket", 1)], ""),
        # with a scratch
        ({"solids": 0, "on_table": (8, 9)}, [("hit", 0, 8), ("pocket", 8), ("pocket", 0)], "scratch"),
        # with the wrong ball first
        ({"solids": 0, "on_table": (8, 9)}, [("hit", 0, 9), ("hit", 9, 8), ("pocket", 8)], "wrong_ball"),
    ],
)
def test_eight_ball_is_lost_by_the_eight(fields, log, foul):
    verdict = eight_ball(state("eight_ball", **fields), facts(*log))
    assert (verdict.foul, verdict.over, verdict.winner) == (foul, True, 1)


def test_eight_ball_a_foul_on_the_eight_without_a_pot_does_not_lose():
    verdict = eight_ball(state("eight_ball", solids=0, on_table=(8, 9)), facts(("hit", 0, 8), ("pocket", 0)))
    assert verdict == Verdict("scratch", in_hand="anywhere", solids=0)


# Straight pool.


def test_straight_each_ball_scores_and_continues():
    before = state("straight", scores=(3, 5))
    log = facts(("hit", 0, 4), ("pocket", 4), ("pocket", 11))
    verdict = straight(before, log)
    assert verdict == Verdict(points=2, continues=True)
    now = next_state(before, log, verdict)
    assert (now.player, now.scores, now.object_balls) == (0, (5, 5), set(range(1, 16)) - {4, 11})


def test_straight_a_miss_passes_the_turn():
    before = state("straight", players=3, player=2)
    assert straight(before, facts(("hit", 0, 4), ("cushion", 4))) == Verdict()
    assert next_state(before, Facts(), Verdict()).player == 0


@pytest.mark.parametrize(("log", "foul"), [((), "no_hit"), ((("hit", 0, 8),), "no_cushion")])
def test_straight_a_foul_costs_a_point_and_the_cue_ball_stays(log, foul):  # WPA 4.9
    assert straight(state("straight"), facts(*log)) == Verdict(foul, points=-1)


def test_straight_a_scratch_costs_a_point_and_balls_are_spotted():
    before = state("straight", scores=(0, 2), player=1)
    log = facts(("hit", 0, 9), ("pocket", 9), ("pocket", 0), ("pocket", 2))
    verdict = straight(before, log)
    assert verdict == Verdict("scratch", points=-1, in_hand="behind", spotted=(2, 9))
    now = next_state(before, log, verdict)
    assert (now.player, now.scores, now.in_hand, now.on_table) == (0, (0, 1), "behind", frozenset(range(16)))


def test_straight_scores_may_be_negative():
    before = state("straight")
    assert next_state(before, facts(("pocket", 0)), straight(before, facts(("pocket", 0)))).scores == (-1, 0)


@pytest.mark.parametrize(("scores", "winner"), [((6, 5), 0), ((3, 6), 1), ((4, 5), -1)])
def test_straight_ends_with_the_last_ball(scores, winner):
    verdict = straight(state("straight", scores=scores, on_table=(7,)), facts(("hit", 0, 7), ("pocket", 7)))
    assert (verdict.over, verdict.winner) == (True, winner)


def test_straight_does_not_end_with_a_scratch_on_the_last_ball():
    verdict = straight(state("straight", on_table=(7,)), facts(("hit", 0, 7), ("pocket", 7), ("pocket", 0)))
    assert not verdict.over
    assert verdict.spotted == (7,)


def test_straight_ends_at_the_target():
    before = state("straight", scores=(1, 2), target=3)
    assert not straight(before, facts(("hit", 0, 7), ("pocket", 7))).over
    verdict = straight(before, facts(("hit", 0, 7), ("pocket", 7), ("pocket", 8)))
    assert (verdict.over, verdict.winner) == (True, 0)


# Carom.


def test_carom_touching_both_balls_scores_and_continues():
    verdict = carom(state("carom"), facts(("hit", 0, 2), ("hit", 0, 1)))
    assert verdict == Verdict(points=1, continues=True)


@pytest.mark.parametrize("log", [[], [("hit", 0, 1)], [("hit", 0, 1), ("hit", 1, 2)], [("hit", 0, 1), ("hit", 0, 1)]])
def test_carom_a_miss_passes_the_turn_and_swaps_the_cue_balls(log):
    before = state("carom")
    assert carom(before, facts(*log)) == Verdict()
    now = next_state(before, facts(*log), Verdict())
    assert (now.player, now.cue_balls, now.object_balls) == (1, (2, 0), {0, 1})


def test_carom_the_second_player_uses_the_other_cue_ball():
    before = state("carom", player=1, cue_balls=(2, 0))
    log = facts(("hit", 0, 2), ("hit", 1, 2), cue=2)
    verdict = carom(before, log)
    assert verdict == Verdict(points=1, continues=True)
    assert next_state(before, log, verdict).cue_balls == (2, 0)
    assert next_state(before, log, verdict).scores == (0, 1)


def test_carom_opening_must_touch_the_red_ball_first():
    before = state("carom", break_shot=True)
    assert carom(before, facts(("hit", 0, 1), ("hit", 0, 2))).points == 1
    assert carom(before, facts(("hit", 0, 2), ("hit", 0, 1))).points == 0


def test_carom_ends_at_the_target():
    log = facts(("hit", 0, 2), ("hit", 0, 1))
    assert not carom(state("carom", scores=(8, 9), target=10), log).over
    verdict = carom(state("carom", scores=(9, 9), target=10), log)
    assert (verdict.over, verdict.winner) == (True, 0)
    assert not carom(state("carom", scores=(9, 9), target=0), log).over


def test_three_cushion_counts_cushions_before_the_second_ball():
    cushion = ("cushion", 0)
    before = state("three_cushion")
    for log, points in [
        ([("hit", 0, 1), cushion, cushion, cushion, ("hit", 0, 2)], 1),
        ([cushion, cushion, ("hit", 0, 1), cushion, ("hit", 0, 2)], 1),
        ([cushion, cushion, cushion, ("hit", 0, 1), ("hit", 0, 2)], 1),
        ([("hit", 0, 1), cushion, cushion, ("hit", 0, 2), cushion], 0),
        ([("hit", 0, 1), ("cushion", 1), ("cushion", 1), ("cushion", 1), ("hit", 0, 2)], 0),
        ([cushion, cushion, cushion, ("hit", 0, 1)], 0),
    ]:
        assert three_cushion(before, facts(*log)) == Verdict(points=points, continues=points == 1)


# next_state


@pytest.mark.parametrize("players", [2, 3, 4])
def test_turns_rotate(players):
    now = state("nine_ball", players=players)
    order = []
    for _ in range(2 * players):
        order.append(now.player)
        now = next_state(now, Facts(), Verdict())
    assert order == [*range(players)] * 2


def test_the_second_shot_is_not_a_break():
    assert not next_state(state("nine_ball", break_shot=True), Facts(), Verdict()).break_shot


def test_next_state_follows_the_verdict():
    now = next_state(
        state("eight_ball"),
        facts(("pocket", 0), ("pocket", 8)),
        Verdict("scratch", in_hand="anywhere", over=True, winner=1),
    )
    assert (now.in_hand, now.over, now.winner, now.on_table) == ("anywhere", True, 1, frozenset(range(16)) - {8})


def test_verdicts_of_random_facts_are_valid():
    rng = np.random.default_rng(0)
    for name, rules in RULES.items():
        n = 1 + rules.n_object_balls[1]
        for _ in range(300):
            lying = frozenset({0, *rules.cue_balls, n - 1, 8 if n > 9 else n - 1, *rng.integers(0, n, 8).tolist()})
            if not rules.pockets:
                lying = frozenset(range(n))
            before = RuleState(int(rng.integers(2)), (0, 0), lying, bool(rng.integers(2)), cue_balls=rules.cue_balls)
            rows = []
            for _ in range(int(rng.integers(8))):
                kind = ["hit", "cushion", "pocket"][rng.integers(3 if rules.pockets else 2)]
                ball, other = rng.permutation(sorted(lying))[:2].tolist()
                rows.append((kind, ball, other))
            verdict = rules.judge(before, facts(*rows), NO_CALL)
            assert verdict.foul in FOULS, name
            assert verdict.in_hand in IN_HAND
            assert (verdict.in_hand == "no") or verdict.foul
            assert verdict.winner < 0 or verdict.over
            assert not (verdict.foul and verdict.points > 0)
            assert set(verdict.spotted) <= {row[1] for row in rows if row[0] == "pocket"}
