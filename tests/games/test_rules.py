"""The rules, case by case, on constructed events."""

from typing import Any

import numpy as np
import pytest

from billiards_env import Scene, simulate
from billiards_env.games.judging import RULES, Facts, RuleState, Verdict, facts_of, next_state
from billiards_env.rules import FOULS, IN_HAND
from tests.helpers.games import events, facts, state

SOLIDS, STRIPES = set(range(1, 8)), set(range(9, 16))
ANYWHERE: dict[str, Any] = {"in_hand": "anywhere"}
BEHIND: dict[str, Any] = {"in_hand": "behind"}


def judged(rules, fields, log):
    return RULES[rules].judge(state(rules, **fields), facts(log))


# facts_of


@pytest.mark.parametrize(
    ("log", "found"),
    [
        ("", Facts()),
        ("sliding_rolling 0, rolling_rest 0, spinning_rest 0", Facts()),
        ("hit 2 3, cushion 3", Facts(driven=frozenset({3}))),  # a contact between other balls
        ("hit 0 1, pocket 7 2, pocket 0 4", Facts((1,), ((1, 0),), (7, 0), True, frozenset({7}), (2, 4), True)),
    ],
)
def test_facts(log, found):
    assert facts(log) == found


def test_the_first_ball_does_not_depend_on_the_order_within_an_event():
    assert facts("cushion 0, hit 3 0, hit 3 5, hit 0 5").first == (3,)


def test_balls_touched_at_the_same_instant_are_all_first():
    assert facts("hit 0 4, hit 0 2, hit 0 7", times=[1.0, 1.0, 1.5]).first == (4, 2)


def test_touched_balls_have_the_number_of_cushions_before():
    log = "cushion 0, hit 0 2, cushion 2, cushion 0, hit 2 0, cushion 0, hit 1 0"
    assert facts(log).touched == ((2, 1), (1, 3))


@pytest.mark.parametrize(
    ("log", "after"),
    [
        ("cushion 0, hit 0 1", False),
        ("hit 0 1, cushion 0", True),
        ("hit 0 1, cushion 1", True),
        ("hit 0 1, hit 1 2, cushion 2", True),
        ("hit 0 1, pocket 1", True),
        ("cushion 0, cushion 0", False),
    ],
)
def test_a_cushion_counts_only_after_the_first_contact(log, after):
    assert facts(log).cushion_after == after


def test_potted_balls_are_in_order_and_count_as_driven():
    found = facts("hit 0 1, pocket 7, cushion 4, cushion 4, pocket 0, pocket 2")
    assert (found.potted, found.driven) == ((7, 0, 2), {7, 4, 2})


def test_the_cue_ball_may_have_another_number():
    found = facts("cushion 2, hit 0 2, cushion 0, hit 1 2", cue=2)
    assert found == Facts((0,), ((0, 1), (1, 1)), (), True, frozenset({0}), cue_driven=True)


def test_facts_of_a_real_shot():
    shot = simulate(Scene.named("pool"), [[-0.635, 0.0], [0.635, 0.3]], [2.0, 0.45], record=True)
    assert shot.events is not None
    found = facts_of(shot.events)
    assert found.first == (shot.first_hit,) == (1,)
    assert (found.potted, found.cushion_after) == ((1,), True)


# Legal balls


@pytest.mark.parametrize(
    ("rules", "fields", "player", "legal"),
    [
        ("nine_ball", {}, 0, {1}),
        ("nine_ball", {"on_table": (9, 4, 7)}, 1, {4}),
        ("eight_ball", {}, 0, SOLIDS | STRIPES),
        ("eight_ball", {"break_shot": True}, 0, SOLIDS | {8} | STRIPES),
        ("eight_ball", {"solids": 0}, 0, SOLIDS),
        ("eight_ball", {"solids": 0}, 1, STRIPES),
        ("eight_ball", {"solids": 1, "on_table": (3, 8, 12)}, 0, {12}),
        ("eight_ball", {"solids": 1, "on_table": (3, 8)}, 0, {8}),  # the eight ball after the group
        ("eight_ball", {"on_table": (8,)}, 0, {8}),
    ],
)
def test_legal_balls(rules, fields, player, legal):
    assert RULES[rules].legal(state(rules, **fields), player) == legal


# Fouls of nine ball and eight ball.


@pytest.mark.parametrize(
    ("rules", "fields", "log", "foul"),
    [
        ("nine_ball", {}, "hit 0 1, cushion 1", ""),
        ("nine_ball", {}, "hit 0 1, cushion 0", ""),
        ("nine_ball", {}, "hit 0 1, hit 1 5, cushion 5", ""),
        ("nine_ball", {}, "hit 0 1, pocket 1", ""),
        ("nine_ball", {}, "", "no_hit"),
        ("nine_ball", {}, "cushion 0", "no_hit"),
        ("nine_ball", {}, "hit 0 2, hit 0 1, cushion 1", "wrong_ball"),
        ("nine_ball", {"on_table": (2, 9)}, "hit 0 2, cushion 2", ""),
        ("nine_ball", {"on_table": (2, 9)}, "hit 0 9, cushion 2", "wrong_ball"),
        ("nine_ball", {}, "hit 0 1", "no_cushion"),
        ("nine_ball", {}, "cushion 0, hit 0 1", "no_cushion"),
        ("nine_ball", {}, "hit 0 1, cushion 1, pocket 0", "scratch"),
        ("nine_ball", {}, "pocket 0", "scratch"),
        ("nine_ball", {}, "hit 0 2, pocket 0", "scratch"),
        ("eight_ball", {}, "hit 0 5, cushion 5", ""),
        ("eight_ball", {}, "hit 0 15, cushion 5", ""),
        ("eight_ball", {}, "hit 0 8, cushion 8", "wrong_ball"),
        ("eight_ball", {"solids": 0}, "hit 0 7, cushion 7", ""),
        ("eight_ball", {"solids": 0}, "hit 0 9, cushion 9", "wrong_ball"),
        ("eight_ball", {"solids": 1}, "hit 0 7, cushion 7", "wrong_ball"),
        ("eight_ball", {"solids": 1}, "hit 0 9, cushion 9", ""),
        ("eight_ball", {"solids": 0}, "hit 0 8, cushion 8", "wrong_ball"),
        ("eight_ball", {"solids": 0, "on_table": (8, 9)}, "hit 0 8, cushion 8", ""),
        ("eight_ball", {"solids": 0, "on_table": (8, 9)}, "hit 0 8, pocket 0", "scratch"),  # does not lose
        ("eight_ball", {"solids": 0}, "hit 0 7", "no_cushion"),
        ("eight_ball", {"solids": 0}, "cushion 0", "no_hit"),
        ("eight_ball", {"solids": 0}, "hit 0 7, pocket 7, pocket 0", "scratch"),
    ],
)
def test_fouls(rules, fields, log, foul):
    verdict = judged(rules, fields, log)
    in_hand, continues = "anywhere" if foul else "no", "pocket" in log and not foul
    assert verdict == Verdict(foul, continues=continues, in_hand=in_hand, solids=fields.get("solids", -1))


def test_a_split_hit_counts_as_the_legal_ball_first():
    log, judge = facts("hit 0 2, hit 0 1, cushion 1", times=[1.0, 1.0, 2.0]), RULES["nine_ball"].judge
    assert judge(state("nine_ball"), log).foul == ""
    assert judge(state("nine_ball", on_table=(3, 9)), log).foul == "wrong_ball"


# Verdicts.

BREAK = {"break_shot": True, "in_hand": "behind"}
THREE = "hit 0 1, cushion 2, cushion 3, cushion 4, cushion 4, cushion 0"  # three object balls are driven to a cushion


@pytest.mark.parametrize(
    ("fields", "log", "verdict"),
    [
        ({}, "hit 0 1, hit 1 6, pocket 6", Verdict(continues=True)),  # any legal pot continues
        ({"player": 1}, "hit 0 1, hit 1 9, pocket 9", Verdict(continues=True, over=True, winner=1)),
        ({"on_table": (9,)}, "hit 0 9, pocket 9", Verdict(continues=True, over=True, winner=0)),
        (BREAK, THREE, Verdict("illegal_break", **ANYWHERE)),
        (BREAK, f"{THREE}, cushion 9", Verdict(choices=("push_out",))),
        (BREAK, f"{THREE}, pocket 5", Verdict(continues=True, choices=("push_out",))),
        (BREAK, f"{THREE}, pocket 9", Verdict(continues=True, over=True, winner=0)),
        ({}, THREE, Verdict()),
        (BREAK, "hit 0 3, pocket 3", Verdict("wrong_ball", **ANYWHERE)),  # the break must touch the one first
    ],
)
def test_nine_ball(fields, log, verdict):
    assert judged("nine_ball", fields, log) == verdict


@pytest.mark.parametrize("log", ["hit 0 9, pocket 9", "hit 0 1, pocket 9, pocket 0", "hit 0 2, pocket 9, pocket 2"])
def test_nine_ball_only_the_nine_is_spotted_after_a_foul(log):
    before, verdict = state("nine_ball"), judged("nine_ball", {}, log)
    assert verdict.foul
    assert (verdict.spotted, verdict.over) == ((9,), False)
    now = next_state(before, facts(log), verdict)
    assert 9 in now.on_table
    assert (2 in now.on_table) == ("pocket 2" not in log)


@pytest.mark.parametrize(
    ("fields", "log", "verdict"),
    [
        (BREAK, "hit 0 1, pocket 3", Verdict(continues=True)),  # the table stays open
        (BREAK, "hit 0 8, pocket 2", Verdict(continues=True)),  # the eight may be touched first
        (BREAK, "hit 0 1", Verdict()),  # without a pot
        (BREAK, "hit 0 1, cushion 1, cushion 2, cushion 3, cushion 4", Verdict()),
        (BREAK, "hit 0 1, pocket 2, pocket 0", Verdict("scratch", **BEHIND)),
        (BREAK, "cushion 0", Verdict("no_hit", **BEHIND)),
        (BREAK, "hit 0 1, pocket 8", Verdict(continues=True, spotted=(8,))),
        (BREAK, "hit 0 1, pocket 8, pocket 0", Verdict("scratch", **BEHIND, spotted=(8,))),
        # The first ball of a legal pot decides the groups.
        ({"player": 0}, "hit 0 12, hit 12 7, pocket 7", Verdict(continues=True, solids=0)),
        ({"player": 1}, "hit 0 12, hit 12 7, pocket 7", Verdict(continues=True, solids=1)),
        ({"player": 0}, "hit 0 12, hit 12 9, pocket 9", Verdict(continues=True, solids=1)),
        ({"player": 1}, "hit 0 12, hit 12 9, pocket 9", Verdict(continues=True, solids=0)),
        ({}, "hit 0 12, pocket 12, pocket 3", Verdict(continues=True, solids=1)),
        ({}, "hit 0 3, pocket 3, pocket 0", Verdict("scratch", **ANYWHERE)),  # a foul does not
        # A ball of the group continues. Player 0 has the stripes.
        ({"solids": 1}, "hit 0 9, pocket 3", Verdict(solids=1)),
        ({"solids": 1}, "hit 0 9, pocket 9", Verdict(continues=True, solids=1)),
        ({"solids": 1}, "hit 0 9, pocket 3, pocket 10", Verdict(continues=True, solids=1)),
    ],
)
def test_eight_ball(fields, log, verdict):
    assert judged("eight_ball", fields, log) == verdict


@pytest.mark.parametrize(
    ("fields", "log", "foul", "winner"),
    [
        ({"solids": 1, "on_table": (2, 8)}, "hit 0 8, pocket 8", "", 0),
        ({"solids": 1, "on_table": (2, 8)}, "hit 0 8, pocket 2, pocket 8", "", 0),
        ({"solids": 0}, "hit 0 1, hit 1 8, pocket 8", "", 1),  # before the group is potted
        ({}, "hit 0 1, hit 1 8, pocket 8", "", 1),  # with the table open
        # in the same shot as the last ball of the group, in either order
        ({"solids": 0, "on_table": (1, 8, 9)}, "hit 0 1, pocket 1, pocket 8", "", 1),
        ({"solids": 0, "on_table": (1, 8, 9)}, "hit 0 1, pocket 8, pocket 1", "", 1),
        ({"solids": 0, "on_table": (8, 9)}, "hit 0 8, pocket 8, pocket 0", "scratch", 1),
        ({"solids": 0, "on_table": (8, 9)}, "hit 0 9, hit 9 8, pocket 8", "wrong_ball", 1),
    ],
)
def test_the_eight_ball_ends_the_game(fields, log, foul, winner):
    verdict = judged("eight_ball", fields, log)
    assert (verdict.foul, verdict.over, verdict.winner) == (foul, True, winner)


@pytest.mark.parametrize(
    ("fields", "log", "verdict"),
    [
        ({"scores": (3, 5)}, "hit 0 4, pocket 4, pocket 11", Verdict(points=2, continues=True)),
        ({"players": 3, "player": 2}, "hit 0 4, cushion 4", Verdict()),
        ({}, "", Verdict("no_hit", points=-1)),  # WPA 4.9: the cue ball stays
        ({}, "hit 0 8", Verdict("no_cushion", points=-1)),
        (
            {"player": 1},
            "hit 0 9, pocket 9, pocket 0, pocket 2",
            Verdict("scratch", points=-1, **BEHIND, spotted=(2, 9)),
        ),
        (  # a scratch on the last ball does not end the game
            {"on_table": (7,)},
            "hit 0 7, pocket 7, pocket 0",
            Verdict("scratch", points=-1, **BEHIND, spotted=(7,)),
        ),
        ({"scores": (1, 2), "target": 3}, "hit 0 7, pocket 7", Verdict(points=1, continues=True)),
    ],
)
def test_straight_pool(fields, log, verdict):
    assert judged("straight", fields, log) == verdict


@pytest.mark.parametrize(
    ("rules", "fields", "log", "winner"),
    [
        ("straight", {"scores": (6, 5), "on_table": (7,)}, "hit 0 7, pocket 7", 0),
        ("straight", {"scores": (3, 6), "on_table": (7,)}, "hit 0 7, pocket 7", 1),
        ("straight", {"scores": (4, 5), "on_table": (7,)}, "hit 0 7, pocket 7", -1),
        ("straight", {"scores": (1, 2), "target": 3}, "hit 0 7, pocket 7, pocket 8", 0),
        ("carom", {"scores": (9, 9), "target": 10}, "hit 0 2, hit 0 1", 0),
    ],
)
def test_the_last_ball_or_the_target_ends_a_game_with_points(rules, fields, log, winner):
    verdict = judged(rules, fields, log)
    assert (verdict.over, verdict.winner) == (True, winner)


POINT = Verdict(points=1, continues=True)


@pytest.mark.parametrize(
    ("rules", "fields", "log", "verdict"),
    [
        ("carom", {}, "hit 0 2, hit 0 1", POINT),
        ("carom", {}, "", Verdict()),
        ("carom", {}, "hit 0 1", Verdict()),
        ("carom", {}, "hit 0 1, hit 1 2", Verdict()),
        ("carom", {}, "hit 0 1, hit 0 1", Verdict()),
        ("carom", {"break_shot": True}, "hit 0 1, hit 0 2", POINT),  # the red ball first
        ("carom", {"break_shot": True}, "hit 0 2, hit 0 1", Verdict()),
        ("carom", {"scores": (8, 9), "target": 10}, "hit 0 2, hit 0 1", POINT),
        ("carom", {"scores": (9, 9), "target": 0}, "hit 0 2, hit 0 1", POINT),
        ("three_cushion", {}, "hit 0 1, cushion 0, cushion 0, cushion 0, hit 0 2", POINT),
        ("three_cushion", {}, "cushion 0, cushion 0, hit 0 1, cushion 0, hit 0 2", POINT),
        ("three_cushion", {}, "cushion 0, cushion 0, cushion 0, hit 0 1, hit 0 2", POINT),
        ("three_cushion", {}, "hit 0 1, cushion 0, cushion 0, hit 0 2, cushion 0", Verdict()),
        ("three_cushion", {}, "hit 0 1, cushion 1, cushion 1, cushion 1, hit 0 2", Verdict()),
        ("three_cushion", {}, "cushion 0, cushion 0, cushion 0, hit 0 1", Verdict()),
    ],
)
def test_carom_games(rules, fields, log, verdict):
    assert judged(rules, fields, log) == verdict


# next_state


@pytest.mark.parametrize(
    ("rules", "fields", "log", "after"),
    [
        ("nine_ball", {"break_shot": True}, "hit 0 1, pocket 2", {"break_shot": False, "player": 0}),
        ("eight_ball", BREAK, "hit 0 1, pocket 3", {"solids": -1, "in_hand": "no"}),
        ("eight_ball", BREAK, "hit 0 1, pocket 8, pocket 0", {"on_table": set(range(16)), **BEHIND}),
        ("eight_ball", {}, "hit 0 3, pocket 3, pocket 0", {"on_table": set(range(16)) - {3}, **ANYWHERE}),
        ("eight_ball", {}, "pocket 0, pocket 8", {"on_table": set(range(16)) - {8}, "over": True, "winner": 1}),
        ("straight", {"scores": (3, 5)}, "hit 0 4, pocket 4, pocket 11", {"player": 0, "scores": (5, 5)}),
        ("straight", {}, "hit 0 4, pocket 4, pocket 11", {"object_balls": set(range(1, 16)) - {4, 11}}),
        ("straight", {"players": 3, "player": 2}, "hit 0 4, cushion 4", {"player": 0}),
        ("straight", {"scores": (0, 2), "player": 1}, "pocket 9, pocket 0", {"scores": (0, 1), "player": 0, **BEHIND}),
        ("straight", {}, "hit 0 9, pocket 9, pocket 0, pocket 2", {"on_table": set(range(16))}),
        ("straight", {}, "pocket 0", {"scores": (-1, 0)}),
        ("carom", {}, "hit 0 1", {"player": 1, "cue_balls": (2, 0), "object_balls": {0, 1}}),
    ],
)
def test_the_state_follows_from_the_verdict(rules, fields, log, after):
    now = next_state(state(rules, **fields), facts(log), judged(rules, fields, log))
    assert {name: getattr(now, name) for name in after} == after


def test_carom_the_second_player_uses_the_other_cue_ball():
    before, log = state("carom", player=1, cue_balls=(2, 0)), facts("hit 0 2, hit 1 2", cue=2)
    verdict = RULES["carom"].judge(before, log)
    assert verdict == POINT
    now = next_state(before, log, verdict)
    assert (now.cue_balls, now.scores) == ((2, 0), (0, 1))


@pytest.mark.parametrize("players", [2, 3, 4])
def test_turns_rotate(players):
    now = state("nine_ball", players=players)
    order = []
    for _ in range(2 * players):
        order.append(now.player)
        now = next_state(now, Facts(), Verdict())
    assert order == [*range(players)] * 2


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
            verdict = rules.judge(before, facts_of(events(*rows)))
            assert verdict.foul in FOULS, name
            assert verdict.in_hand in IN_HAND
            assert (verdict.in_hand == "no") or verdict.foul
            assert verdict.winner < 0 or verdict.over
            assert not (verdict.foul and verdict.points > 0)
            assert set(verdict.spotted) <= {row[1] for row in rows if row[0] == "pocket"}
