"""The rules of pool and carom, case by case, on constructed events. Numbers are rules of the WPA."""

from typing import Any

import pytest

from billiards_env import Scene, simulate
from billiards_env.games import RULES, Call, Facts, Verdict
from billiards_env.games.judging import facts_of, next_state
from tests.helpers.games import check_together, facts, state

SOLIDS, STRIPES = set(range(1, 8)), set(range(9, 16))
ANYWHERE: dict[str, Any] = {"in_hand": "anywhere"}
BEHIND: dict[str, Any] = {"in_hand": "behind"}


def judged(rules, fields, log, *call):
    return RULES[rules].judge(state(rules, **fields), facts(log), *call)


# facts_of


@pytest.mark.parametrize(
    ("log", "found"),
    [
        ("", {"first": (), "touched": (), "potted": (), "driven": set(), "cushion_after": False, "cue_driven": False}),
        ("sliding_rolling 0, rolling_rest 0, spinning_rest 0", {"first": (), "driven": set()}),
        ("hit 2 3, cushion 3", {"first": (), "driven": {3}}),  # a contact between other balls
        ("hit 0 1, pocket 7 2, pocket 0 4", {"potted": (7, 0), "pockets": (2, 4), "driven": {7}, "cue_driven": True}),
        ("hit 0 1, pocket 7, cushion 4, cushion 4, pocket 2", {"potted": (7, 2), "driven": {7, 4, 2}}),
        ("cushion 0, hit 3 0, hit 3 5, hit 0 5", {"first": (3,)}),
        ("cushion 0, hit 0 2, cushion 2, cushion 0, hit 2 0, cushion 0, hit 1 0", {"touched": ((2, 1), (1, 3))}),
        ("cushion 0, cushion 0", {"cushion_after": False, "cue_driven": True}),
        ("cushion 0, hit 0 1", {"cushion_after": False}),
        ("hit 0 1, cushion 0", {"cushion_after": True}),
        ("hit 0 1, cushion 1", {"cushion_after": True}),
        ("hit 0 1, hit 1 2, cushion 2", {"cushion_after": True}),
        ("hit 0 1, pocket 1", {"cushion_after": True}),
    ],
)
def test_facts(log, found):
    assert {name: getattr(facts(log), name) for name in found} == found


def test_balls_touched_at_the_same_instant_are_all_first():
    assert facts("hit 0 4, hit 0 2, hit 0 7", times=[1.0, 1.0, 1.5]).first == (4, 2)


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
    if rules == "eight_ball":
        assert RULES[rules].callable(state(rules, **fields), player) == legal


def test_any_ball_may_be_called_in_straight_pool():
    assert RULES["straight"].callable(state("straight", on_table=(3, 8)), 0) == {3, 8}


# Fouls of nine ball and eight ball.

GROUP_POTTED = {"solids": 0, "on_table": (8, 9)}


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
        ("eight_ball", {}, "hit 0 3, pocket 3, pocket 0", "scratch"),  # a foul decides no groups
        ("eight_ball", {"solids": 0}, "hit 0 7, cushion 7", ""),
        ("eight_ball", {"solids": 0}, "hit 0 9, cushion 9", "wrong_ball"),
        ("eight_ball", {"solids": 1}, "hit 0 7, cushion 7", "wrong_ball"),
        ("eight_ball", {"solids": 1}, "hit 0 9, cushion 9", ""),
        ("eight_ball", {"solids": 0}, "hit 0 8, cushion 8", "wrong_ball"),
        ("eight_ball", GROUP_POTTED, "hit 0 8, cushion 8", ""),
        ("eight_ball", GROUP_POTTED, "hit 0 8, pocket 0", "scratch"),  # does not lose
        ("eight_ball", {"solids": 0}, "hit 0 7", "no_cushion"),
        ("eight_ball", {"solids": 0}, "cushion 0", "no_hit"),
        ("eight_ball", {"solids": 0}, "hit 0 7, pocket 7, pocket 0", "scratch"),
    ],
)
def test_fouls(rules, fields, log, foul):
    in_hand, continues = "anywhere" if foul else "no", "pocket" in log and not foul
    verdict = Verdict(foul, continues=continues, in_hand=in_hand, solids=fields.get("solids", -1))
    assert judged(rules, fields, log) == verdict


def test_a_split_hit_counts_as_the_legal_ball_first():
    log, judge = facts("hit 0 2, hit 0 1, cushion 1", times=[1.0, 1.0, 2.0]), RULES["nine_ball"].judge
    assert judge(state("nine_ball"), log).foul == ""
    assert judge(state("nine_ball", on_table=(3, 9)), log).foul == "wrong_ball"


# Verdicts: the game, the state, the events, the verdict and the call.

BREAK = {"break_shot": True, "in_hand": "behind"}
THREE = "hit 0 1, cushion 2, cushion 3, cushion 4, cushion 4, cushion 0"  # three object balls are driven to a cushion
PUSH, PUSH_OUT = {"choices": ("push_out",)}, Call(kind="push_out")
HAND_BACK: dict[str, Any] = {"choices": ("hand_back",)}
NINE_BALL = [
    ({}, "hit 0 1, hit 1 6, pocket 6", Verdict(continues=True)),  # any legal pot continues
    ({}, THREE, Verdict()),
    (BREAK, THREE, Verdict("illegal_break", **ANYWHERE)),
    (BREAK, f"{THREE}, cushion 9", Verdict(choices=("push_out",))),
    (BREAK, f"{THREE}, pocket 5", Verdict(continues=True, choices=("push_out",))),
    (BREAK, f"{THREE}, pocket 9", Verdict(continues=True, over=True, winner=0)),
    (BREAK, "hit 0 3, pocket 3", Verdict("wrong_ball", **ANYWHERE)),  # the break must touch the one first
    (BREAK, "hit 0 1, pocket 0", Verdict("scratch", **ANYWHERE)),
    # Only the nine ball is spotted after a foul (2.6).
    ({}, "hit 0 9, pocket 9", Verdict("wrong_ball", **ANYWHERE, spotted=(9,))),
    ({}, "hit 0 1, pocket 9, pocket 0", Verdict("scratch", **ANYWHERE, spotted=(9,))),
    ({}, "hit 0 2, pocket 9, pocket 2", Verdict("wrong_ball", **ANYWHERE, spotted=(9,))),
    # A push out needs no hit and passes the turn (2.4).
    (PUSH, "hit 0 1, cushion 1", Verdict()),
    (PUSH, "", Verdict(**HAND_BACK), PUSH_OUT),
    (PUSH, "hit 0 5", Verdict(**HAND_BACK), PUSH_OUT),
    (PUSH, "hit 0 1, pocket 1", Verdict(**HAND_BACK), PUSH_OUT),
    (PUSH, "hit 0 5, pocket 0", Verdict("scratch", **ANYWHERE), PUSH_OUT),
    (PUSH, "hit 0 9, pocket 9", Verdict(spotted=(9,), **HAND_BACK), PUSH_OUT),  # 2.6
    ({"players": 3, "fouls": (2, 0, 0)}, "", Verdict("no_hit", **ANYWHERE)),  # 2.8: with two players alone
]

CALLED = {"call_shot": True}
CALLED_SOLIDS = {"call_shot": True, "solids": 0}
POT_3, BOTH_GROUPS, SAFETY = "hit 0 3, pocket 3 5", "hit 0 3, pocket 3 5, pocket 9 0", Call(3, 5, "safety")
EIGHT_BALL = [
    (BREAK, "hit 0 1, pocket 3", Verdict(continues=True)),  # the table stays open
    (BREAK | CALLED, "hit 0 1, pocket 3", Verdict(continues=True)),  # 3.3 b: nothing is called
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
    # A ball of the group continues. Player 0 has the stripes.
    ({"solids": 1}, "hit 0 9, pocket 3", Verdict(solids=1)),
    ({"solids": 1}, "hit 0 9, pocket 9", Verdict(continues=True, solids=1)),
    ({"solids": 1}, "hit 0 9, pocket 3, pocket 10", Verdict(continues=True, solids=1)),
    # Only the called ball in the called pocket continues (1.6, 3.5, 3.6).
    (CALLED_SOLIDS, POT_3, Verdict(continues=True, solids=0), Call(3, 5)),
    (CALLED_SOLIDS, POT_3, Verdict(solids=0), Call(3, 4)),
    (CALLED_SOLIDS, POT_3, Verdict(solids=0), Call(4, 5)),
    (CALLED_SOLIDS, POT_3, Verdict(solids=0)),
    (CALLED_SOLIDS, POT_3, Verdict(solids=0), SAFETY),
    (CALLED_SOLIDS, "hit 0 3, pocket 9 0, pocket 3 5", Verdict(continues=True, solids=0), Call(3, 5)),
    (CALLED_SOLIDS, "hit 0 3, pocket 9 0", Verdict(solids=0), Call(9, 0)),  # 3.5: of the other group
    # The called ball decides the group (3.4).
    (CALLED, BOTH_GROUPS, Verdict(continues=True, solids=1), Call(9, 0)),
    (CALLED, BOTH_GROUPS, Verdict(continues=True, solids=0), Call(3, 5)),
    (CALLED, BOTH_GROUPS, Verdict(), Call(3, 0)),  # the table stays open
    (CALLED, BOTH_GROUPS, Verdict(), SAFETY),
]

TWO = "hit 0 3, pocket 4 1, pocket 3 5"
CALLED_BREAK = {"call_shot": True, "break_shot": True}
LAST_TWO = {"call_shot": True, "target": 50, "on_table": (3, 8)}
STRAIGHT = [
    ({"scores": (3, 5)}, "hit 0 4, pocket 4, pocket 11", Verdict(points=2, continues=True)),
    ({"players": 3, "player": 2}, "hit 0 4, cushion 4", Verdict()),
    ({}, "", Verdict("no_hit", -1)),  # 4.9: the cue ball stays
    ({}, "hit 0 8", Verdict("no_cushion", -1)),
    ({"player": 1}, "hit 0 9, pocket 9, pocket 0, pocket 2", Verdict("scratch", -1, **BEHIND, spotted=(2, 9))),
    # A scratch on the last ball does not end the game.
    ({"on_table": (7,)}, "hit 0 7, pocket 7, pocket 0", Verdict("scratch", -1, **BEHIND, spotted=(7,))),
    ({"scores": (1, 2), "target": 3}, "hit 0 7, pocket 7", Verdict(points=1, continues=True)),
    # The called ball scores, and the others that are potted with it (4.5, 4.6, 4.7).
    (CALLED, TWO, Verdict(points=2, continues=True), Call(3, 5)),
    (CALLED, TWO, Verdict(spotted=(3, 4)), Call(3, 4)),
    (CALLED, TWO, Verdict(spotted=(3, 4))),
    (CALLED, TWO, Verdict(spotted=(3, 4)), SAFETY),
    (CALLED, "", Verdict("no_hit", -1), Call(3, 5)),
    (CALLED, f"{POT_3}, pocket 0", Verdict("scratch", -1, **BEHIND, spotted=(3,)), Call(3, 5)),
    # The opening break (4.3, 4.10)
    (CALLED_BREAK, "hit 0 1, cushion 0, cushion 2, cushion 3", Verdict()),
    (CALLED_BREAK, "hit 0 1, cushion 2, cushion 3", Verdict("breaking_foul", -2)),
    (CALLED_BREAK, "hit 0 1, cushion 0, cushion 2", Verdict("breaking_foul", -2)),
    (CALLED_BREAK, "hit 0 1, pocket 2 0", Verdict(points=1, continues=True), Call(2, 0)),
    (CALLED_BREAK, "hit 0 1, pocket 2 0", Verdict("breaking_foul", -2, spotted=(2,)), Call(2, 1)),
    (CALLED_BREAK, "hit 0 1, pocket 0", Verdict("breaking_foul", -2, **BEHIND)),
    (CALLED_BREAK | {"on_table": (1,)}, "hit 0 1, cushion 0, cushion 1", Verdict()),  # with a single object ball
    # A potted cue ball counts as driven to a cushion (8.4).
    (CALLED_BREAK, "hit 0 1, cushion 2, cushion 3, pocket 0", Verdict("scratch", -1, **BEHIND)),
    (CALLED_BREAK, "hit 0 1, cushion 0, cushion 2, cushion 3, pocket 0", Verdict("scratch", -1, **BEHIND)),
    # The balls are racked again with one ball left (4.4), and after the third consecutive foul (4.11).
    (LAST_TWO, POT_3, Verdict(points=1, continues=True, rack="rest"), Call(3, 5)),
    (LAST_TWO | {"on_table": (3, 8, 9)}, POT_3, Verdict(points=1, continues=True), Call(3, 5)),
    (LAST_TWO, "hit 0 3, cushion 3", Verdict(), Call(3, 5)),
    (LAST_TWO | {"target": 0}, POT_3, Verdict(points=1, continues=True), Call(3, 5)),
    ({"target": 50, "fouls": (2, 0)}, "", Verdict("no_hit", -16, continues=True, **BEHIND, rack="all")),
]

POINT = Verdict(points=1, continues=True)
CAROM = [
    ({}, "hit 0 2, hit 0 1", POINT),
    ({}, "", Verdict()),
    ({}, "hit 0 1", Verdict()),
    ({}, "hit 0 1, hit 1 2", Verdict()),
    ({}, "hit 0 1, hit 0 1", Verdict()),
    ({"break_shot": True}, "hit 0 1, hit 0 2", POINT),  # the red ball first
    ({"break_shot": True}, "hit 0 2, hit 0 1", Verdict()),
    ({"scores": (8, 9), "target": 10}, "hit 0 2, hit 0 1", POINT),
    ({"scores": (9, 9), "target": 0}, "hit 0 2, hit 0 1", POINT),
]
THREE_CUSHION = [
    ({}, "hit 0 1, cushion 0, cushion 0, cushion 0, hit 0 2", POINT),
    ({}, "cushion 0, cushion 0, hit 0 1, cushion 0, hit 0 2", POINT),
    ({}, "cushion 0, cushion 0, cushion 0, hit 0 1, hit 0 2", POINT),
    ({}, "hit 0 1, cushion 0, cushion 0, hit 0 2, cushion 0", Verdict()),
    ({}, "hit 0 1, cushion 1, cushion 1, cushion 1, hit 0 2", Verdict()),
    ({}, "cushion 0, cushion 0, cushion 0, hit 0 1", Verdict()),
]
CASES = {
    "nine_ball": NINE_BALL,
    "eight_ball": EIGHT_BALL,
    "straight": STRAIGHT,
    "carom": CAROM,
    "three_cushion": THREE_CUSHION,
}


@pytest.mark.parametrize(("rules", "case"), [(rules, case) for rules in CASES for case in CASES[rules]])
def test_verdicts(rules, case):
    fields, log, verdict, *call = case
    assert judged(rules, fields, log, *call) == verdict


@pytest.mark.parametrize("rules", CASES)
def test_many_shots_are_judged_as_one_is(rules):
    check_together(rules, CASES[rules])


LAST_SOLID, LAST_STRIPE = {"solids": 0, "on_table": (1, 8, 9)}, {"solids": 1, "on_table": (2, 8)}
CALLED_EIGHT = {**CALLED_SOLIDS, "on_table": (8, 9)}


@pytest.mark.parametrize(
    "case",
    [
        ("nine_ball", {"player": 1}, "hit 0 1, hit 1 9, pocket 9", "", 1),
        ("nine_ball", {"on_table": (9,)}, "hit 0 9, pocket 9", "", 0),
        ("nine_ball", {"fouls": (2, 0)}, "", "no_hit", 1),  # 2.8, 6.14
        ("eight_ball", LAST_STRIPE, "hit 0 8, pocket 8", "", 0),
        ("eight_ball", LAST_STRIPE, "hit 0 8, pocket 2, pocket 8", "", 0),
        ("eight_ball", {"solids": 0}, "hit 0 1, hit 1 8, pocket 8", "", 1),  # before the group is potted
        ("eight_ball", {}, "hit 0 1, hit 1 8, pocket 8", "", 1),  # with the table open
        ("eight_ball", LAST_SOLID, "hit 0 1, pocket 1, pocket 8", "", 1),  # in the shot of the last ball of the group
        ("eight_ball", LAST_SOLID, "hit 0 1, pocket 8, pocket 1", "", 1),
        ("eight_ball", GROUP_POTTED, "hit 0 8, pocket 8, pocket 0", "scratch", 1),
        ("eight_ball", GROUP_POTTED, "hit 0 9, hit 9 8, pocket 8", "wrong_ball", 1),
        ("eight_ball", CALLED_EIGHT, "hit 0 8, pocket 8 2", "", 0, Call(8, 2)),
        ("eight_ball", CALLED_EIGHT, "hit 0 8, pocket 8 2", "", 1, Call(8, 3)),  # 3.8 c
        ("eight_ball", CALLED_EIGHT, "hit 0 8, pocket 8 2", "", 1),
        ("eight_ball", CALLED_EIGHT, "hit 0 8, pocket 8 2", "", 1, Call(8, 2, "safety")),
        ("eight_ball", CALLED_SOLIDS, "hit 0 3, pocket 8 2", "", 1, Call(8, 2)),  # 3.8 b
        ("straight", {"scores": (6, 5), "on_table": (7,)}, "hit 0 7, pocket 7", "", 0),
        ("straight", {"scores": (3, 6), "on_table": (7,)}, "hit 0 7, pocket 7", "", 1),
        ("straight", {"scores": (4, 5), "on_table": (7,)}, "hit 0 7, pocket 7", "", -1),
        ("straight", {"scores": (-4, -2), "on_table": (7,)}, "hit 0 7, pocket 7", "", 1),  # fouls cost points
        ("straight", {"scores": (1, 2), "target": 3}, "hit 0 7, pocket 7, pocket 8", "", 0),
        ("straight", LAST_TWO | {"scores": (49, 0)}, POT_3, "", 0, Call(3, 5)),
        ("carom", {"scores": (9, 9), "target": 10}, "hit 0 2, hit 0 1", "", 0),
    ],
)
def test_the_end_of_a_game(case):
    rules, fields, log, foul, winner, *call = case
    verdict = judged(rules, fields, log, *call)
    assert (verdict.foul, verdict.over, verdict.winner, verdict.rack) == (foul, True, winner, "")


# next_state

THREE_FOULS = {"target": 50, "scores": (3, 9), "fouls": (2, 0)}


@pytest.mark.parametrize(
    ("rules", "fields", "log", "after"),
    [
        ("nine_ball", {"break_shot": True}, "hit 0 1, pocket 2", {"break_shot": False, "player": 0, **PUSH}),
        ("nine_ball", {}, "hit 0 2, pocket 9, pocket 2", {"on_table": set(range(10)) - {2}}),
        ("nine_ball", {"fouls": (2, 1)}, "hit 0 1, cushion 1", {"fouls": (0, 1)}),  # 6.14
        ("eight_ball", BREAK, "hit 0 1, pocket 3", {"solids": -1, "in_hand": "no"}),
        ("eight_ball", BREAK, "hit 0 1, pocket 8, pocket 0", {"on_table": set(range(16)), **BEHIND}),
        ("eight_ball", {}, "hit 0 3, pocket 3, pocket 0", {"on_table": set(range(16)) - {3}, **ANYWHERE}),
        ("eight_ball", {}, "pocket 0, pocket 8", {"on_table": set(range(16)) - {8}, "over": True, "winner": 1}),
        ("eight_ball", CALLED_SOLIDS, POT_3, {"on_table": set(range(16)) - {3}}),  # 3.6: without a call
        ("straight", {"scores": (3, 5)}, "hit 0 4, pocket 4, pocket 11", {"player": 0, "scores": (5, 5)}),
        ("straight", {}, "hit 0 4, pocket 4, pocket 11", {"object_balls": set(range(1, 16)) - {4, 11}}),
        ("straight", {"players": 3, "player": 2}, "hit 0 4, cushion 4", {"player": 0}),
        ("straight", {"scores": (0, 2), "player": 1}, "pocket 9, pocket 0", {"scores": (0, 1), "player": 0, **BEHIND}),
        ("straight", {}, "hit 0 9, pocket 9, pocket 0, pocket 2", {"on_table": set(range(16))}),
        ("straight", {}, "pocket 0", {"scores": (-1, 0)}),
        ("straight", {"fouls": (0, 0), "break_shot": True}, "hit 0 1", {"fouls": (0, 0)}),  # 4.11: a breaking foul
        ("straight", THREE_FOULS, "", {"player": 0, "scores": (-13, 9), "fouls": (0, 0), "break_shot": True}),
        ("carom", {}, "hit 0 1", {"player": 1, "cue_balls": (2, 0), "object_balls": {0, 1}}),
    ],
)
def test_the_state_follows_from_the_verdict(rules, fields, log, after):
    now = next_state(state(rules, **fields), facts(log), judged(rules, fields, log))
    assert {name: getattr(now, name) for name in after} == after


def test_consecutive_fouls_are_counted():
    now, foul = state("nine_ball", fouls=(0, 0)), facts("cushion 0")
    fouls = []
    for _ in range(5):  # both players foul in turn
        now = next_state(now, foul, RULES["nine_ball"].judge(now, foul))
        fouls.append(now.fouls)
    assert fouls == [(1, 0), (1, 1), (2, 1), (2, 2), (3, 2)]
    assert (now.over, now.winner) == (True, 1)


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
