"""The rules of pool and carom, case by case, on constructed shots. Numbers are rules of the WPA."""

from typing import Any

import numpy as np
import pytest

from billiards_env import Scene, simulate
from billiards_env.games import Call, Setup, Stroke, custom_opening, opening, play
from billiards_env.games.facts import facts_of
from billiards_env.games.game_state import changed
from tests.helpers.games import FACTS, facts_in_words, in_a_row, judge, record_of, ruling, setup, state, words

SOLIDS, STRIPES = set(range(1, 8)), set(range(9, 16))
ANYWHERE: dict[str, Any] = {"in_hand": "anywhere"}
BEHIND: dict[str, Any] = {"in_hand": "behind"}


def judged(rules, fields, log, *call):
    return judge(rules, state(rules, **fields), log, *call)[1]


# Facts


LOGS = [
    ("", {"first": (), "touched": 0, "potted": (), "driven": (), "cushion_after": False, "cue_driven": False}),
    ("hit 2 3, cushion 3", {"first": (), "driven": (3,)}),  # a contact between other balls
    ("hit 0 1, pocket 7 2, pocket 0 4", {"potted": (7,), "scratch": True, "driven": (7,), "cue_driven": True}),
    ("pocket 0, pocket 7, pocket 2", {"first_potted": (7,)}),
    ("cushion 0, hit 3 0, hit 3 5, hit 0 5", {"first": (3,)}),
    ("cushion 0, hit 0 2, cushion 0, hit 2 0, cushion 0, hit 1 0", {"touched": 2, "cushions_before_last": 3}),
    ("cushion 0, hit 0 1", {"cushion_after": False}),
    ("hit 0 1, cushion 0", {"cushion_after": True}),
]


@pytest.mark.parametrize(("log", "expected"), LOGS)
def test_facts(log, expected):
    facts = facts_in_words(log)
    assert {name: getattr(facts, name) for name in expected} == expected


def test_balls_touched_at_the_same_instant_are_all_first():
    shot = record_of("hit 0 4, hit 0 2, hit 0 7", times=[1.0, 1.0, 1.5])
    assert facts_in_words(shot).first == (2, 4)


def test_the_cue_ball_may_have_another_number():
    facts = facts_in_words(record_of("cushion 2, hit 0 2, cushion 0, hit 1 2, cushion 2", cue=2))
    assert (facts.first, facts.touched, facts.cushions_before_last) == ((0,), 2, 1)
    assert (facts.cushion_after, facts.driven, facts.cue_driven) == (True, (0,), True)


def test_facts_of_a_real_shot():
    shot = simulate(Scene.named("pool"), [[-0.635, 0.0], [0.635, 0.3]], [2.0, 0.45])
    facts = words(facts_of(FACTS, shot)[0])
    assert facts.first == (shot.first_hit,) == (1,)
    assert (facts.potted, facts.cushion_after) == ((1,), True)


# Legal balls


LEGAL = [
    ("nine_ball", {"on_table": (9, 4, 7)}, 1, {4}),
    ("eight_ball", {"break_shot": True}, 0, SOLIDS | {8} | STRIPES),
    ("eight_ball", {"solids": 0}, 0, SOLIDS),
    ("eight_ball", {"solids": 0}, 1, STRIPES),
    ("eight_ball", {"solids": 1, "on_table": (3, 8)}, 0, {8}),  # the eight ball after the group
]


@pytest.mark.parametrize(("rules", "fields", "player", "legal"), LEGAL)
def test_legal_balls(rules, fields, player, legal):
    assert set(setup(rules).legal(state(rules, **fields), player)) == legal
    if rules == "eight_ball":
        assert set(setup(rules).callable(state(rules, **fields), player)) == legal


# On an open table: all solids are potted, the 8 and two stripes are left.
OPEN_WITHOUT_SOLIDS: dict[str, Any] = {"on_table": (8, 9, 12)}
IN_2025 = {"edition": 1}


def test_in_2025_the_eight_ball_may_be_hit_first_on_an_open_table():  # WPA 2025 4.4
    fields = OPEN_WITHOUT_SOLIDS
    assert setup("eight_ball").legal(state("eight_ball", **fields)) == (9, 12)
    assert setup("eight_ball").legal(state("eight_ball", **fields, **IN_2025)) == (8, 9, 12)
    assert setup("eight_ball").legal(state("eight_ball", on_table=(3, 8, 9), **IN_2025)) == (3, 9)
    assert setup("eight_ball").legal(state("eight_ball", on_table=(8, 9), solids=1, **IN_2025)) == (9,)


def test_in_2025_the_nine_is_racked_on_the_foot_spot():  # WPA 2025 5.2
    rng, scene = np.random.default_rng(0), Scene.named("pool", 9)
    for edition, on_spot in ((None, 1), ("2016", 1), ("2025", 9)):
        positions = opening(Setup("nine_ball", scene, edition=edition), rng, "tight_rack").positions
        assert positions[on_spot].tolist() == [scene.table.foot_x, 0.0]
        assert positions[9, 0] - positions[1, 0] == pytest.approx(2 * 3**0.5 * scene.balls.radius[0])


def test_in_2025_ten_ball_has_no_safety():  # WPA 2025 6.5
    for edition, kinds in (("2016", ("shot", "safety")), ("2025", ("shot",))):
        game = setup("ten_ball", call_shot=True, edition=edition)
        assert game.kinds(state("ten_ball", **CALLED)) == kinds
        assert setup("eight_ball", call_shot=True, edition=edition).has_safety


def test_any_ball_may_be_called_in_straight_pool():
    assert setup("straight").callable(state("straight", on_table=(3, 8))) == (3, 8)


# Fouls of nine ball and eight ball.

GROUP_POTTED = {"solids": 0, "on_table": (8, 9)}


FOULS = [
    ("nine_ball", {}, "hit 0 1, cushion 1", ""),
    ("nine_ball", {}, "hit 0 1, pocket 1", ""),
    ("nine_ball", {}, "hit 0 2, hit 0 1, cushion 1", "wrong_ball"),
    ("nine_ball", {}, "hit 0 1", "no_cushion"),
    ("nine_ball", {}, "hit 0 1, cushion 1, pocket 0", "scratch"),
    ("eight_ball", {}, "hit 0 5, cushion 5", ""),
    ("eight_ball", {}, "hit 0 8, cushion 8", "wrong_ball"),
    ("eight_ball", {"solids": 0}, "hit 0 7, cushion 7", ""),
    ("eight_ball", {"solids": 1}, "hit 0 7, cushion 7", "wrong_ball"),
]


@pytest.mark.parametrize(("rules", "fields", "log", "foul"), FOULS)
def test_fouls(rules, fields, log, foul):
    in_hand, continues = "anywhere" if foul else "no", "pocket" in log and not foul
    expected = ruling(foul, continues=continues, in_hand=in_hand, solids=fields.get("solids", -1))
    assert judged(rules, fields, log) == expected


def test_a_split_hit_counts_as_the_legal_ball_first():
    log = record_of("hit 0 2, hit 0 1, cushion 1", times=[1.0, 1.0, 2.0])
    assert judged("nine_ball", {}, log).foul == ""
    assert judged("nine_ball", {"on_table": (3, 9)}, log).foul == "wrong_ball"


# Verdicts: the game, the state, the events, the verdict and the call.

BREAK = {"break_shot": True, "in_hand": "behind"}
THREE = "hit 0 1, cushion 2, cushion 3, cushion 4, cushion 4, cushion 0"  # three object balls are driven to a cushion
PUSH, PUSH_OUT = {"choices": ("push_out",)}, Call(kind="push_out")
HAND_BACK: dict[str, Any] = {"choices": ("hand_back",)}
NINE_BALL = [
    ({}, "hit 0 1, hit 1 6, pocket 6", ruling(continues=True)),  # any legal pot continues
    (BREAK, THREE, ruling("illegal_break", **ANYWHERE)),
    (BREAK, f"{THREE}, cushion 9", ruling(choices=("push_out",))),
    (BREAK, f"{THREE}, pocket 9", ruling(continues=True, over=True, winner=0)),
    (BREAK, "hit 0 1, pocket 0", ruling("scratch", **ANYWHERE)),
    # Only the nine ball is spotted after a foul (2.6).
    ({}, "hit 0 9, pocket 9", ruling("wrong_ball", **ANYWHERE, spotted=(9,))),
    # A push out needs no hit and passes the turn (2.4).
    (PUSH, "", ruling(**HAND_BACK), PUSH_OUT),
    (PUSH, "hit 0 5", ruling(**HAND_BACK), PUSH_OUT),
    (PUSH, "hit 0 5, pocket 0", ruling("scratch", **ANYWHERE), PUSH_OUT),
    (PUSH, "hit 0 9, pocket 9", ruling(spotted=(9,), **HAND_BACK), PUSH_OUT),  # 2.6
    ({"players": 3, "fouls": (2, 0, 0)}, "", ruling("no_hit", **ANYWHERE)),  # 2.8: with two players alone
]

RACK_AGAIN: dict[str, Any] = {"choices": ("rerack", "break_again")}
CALLED = {"call_shot": True}
CALLED_SOLIDS = {"call_shot": True, "solids": 0}
POT_3, BOTH_GROUPS, SAFETY = "hit 0 3, pocket 3 5", "hit 0 3, pocket 3 5, pocket 9 0", Call(3, 5, "safety")
EIGHT_BALL = [
    (BREAK, "hit 0 1, pocket 3", ruling(continues=True)),  # the table stays open
    (BREAK, "hit 0 1, cushion 1, cushion 2, cushion 3, cushion 3", ruling(**RACK_AGAIN)),  # 3.3 d: three balls
    (BREAK, "hit 0 1, cushion 1, cushion 2, cushion 3, cushion 4", ruling()),
    (BREAK, "", ruling("no_hit", **BEHIND, **RACK_AGAIN)),
    (BREAK, "hit 0 1, pocket 0", ruling("scratch", **BEHIND, **RACK_AGAIN)),
    (BREAK, "hit 0 1, pocket 2, pocket 0", ruling("scratch", **BEHIND)),
    (BREAK, "hit 0 1, pocket 8", ruling(continues=True, spotted=(8,), choices=("rerack",))),  # 3.3 e
    (BREAK, "hit 0 1, pocket 8, pocket 0", ruling("scratch", **BEHIND, spotted=(8,), choices=("rerack",))),  # 3.3 f
    # The first ball of a legal pot decides the groups.
    ({"player": 0}, "hit 0 12, hit 12 7, pocket 7", ruling(continues=True, solids=0)),
    ({"player": 1}, "hit 0 12, hit 12 7, pocket 7", ruling(continues=True, solids=1)),
    ({"player": 1}, "hit 0 12, hit 12 9, pocket 9", ruling(continues=True, solids=0)),
    ({}, "hit 0 12, pocket 12, pocket 3", ruling(continues=True, solids=1)),
    # A ball of the group continues. Player 0 has the stripes.
    ({"solids": 1}, "hit 0 9, pocket 3", ruling(solids=1)),
    ({"solids": 1}, "hit 0 9, pocket 9", ruling(continues=True, solids=1)),
    # Only the called ball in the called pocket continues (1.6, 3.5, 3.6).
    (CALLED_SOLIDS, POT_3, ruling(continues=True, solids=0), Call(3, 5)),
    (CALLED_SOLIDS, POT_3, ruling(solids=0), Call(3, 4)),
    (CALLED_SOLIDS, POT_3, ruling(solids=0), Call(4, 5)),
    (CALLED_SOLIDS, "hit 0 3, pocket 9 0", ruling(solids=0), Call(9, 0)),  # 3.5: of the other group
    # The called ball decides the group (3.4).
    (CALLED, BOTH_GROUPS, ruling(continues=True, solids=1), Call(9, 0)),
    (CALLED, BOTH_GROUPS, ruling(), SAFETY),
]

SPOTTED_TEN: dict[str, Any] = {"spotted": (10,)}
LAST_TEN = {"call_shot": True, "on_table": (10,)}
POT_1 = "hit 0 1, pocket 1 5"
TEN_BALL = [
    (BREAK | CALLED, f"{THREE}, pocket 5", ruling(continues=True, choices=("push_out",))),  # 9.5: nothing is called
    (BREAK | CALLED, f"{THREE}, pocket 10", ruling(continues=True, choices=("push_out",), **SPOTTED_TEN)),  # 9.9
    (BREAK | CALLED, THREE, ruling("illegal_break", **ANYWHERE)),  # 9.3
    (CALLED | PUSH, "hit 0 10, pocket 10", ruling(**HAND_BACK, **SPOTTED_TEN), PUSH_OUT),  # 9.4
    (CALLED, POT_1, ruling(continues=True), Call(1, 5)),
    (CALLED, "hit 0 1, pocket 10 0", ruling(continues=True, **SPOTTED_TEN), Call(10, 0)),  # 9.8: before the last ball
    (CALLED, POT_1, ruling(**HAND_BACK), Call(1, 5, "safety")),  # 9.6
    (LAST_TEN, "hit 0 10, pocket 10 5", ruling(continues=True, over=True, winner=0), Call(10, 5)),
    (LAST_TEN, "hit 0 10, pocket 10 5", ruling(**HAND_BACK, **SPOTTED_TEN), Call(10, 4)),  # 9.9
    ({"fouls": (2, 0)}, "", ruling("no_hit", **ANYWHERE, over=True, winner=1)),  # 9.11
]

TWO = "hit 0 3, pocket 4 1, pocket 3 5"
AGAIN: dict[str, Any] = {"choices": ("break_again",)}
CALLED_BREAK = {"call_shot": True, "break_shot": True}
LAST_TWO = {"call_shot": True, "target": 50, "on_table": (3, 8)}
STRAIGHT = [
    ({"scores": (3, 5)}, "hit 0 4, pocket 4, pocket 11", ruling(points=2, continues=True)),
    ({}, "", ruling("no_hit", -1)),  # 4.9: the cue ball stays
    ({}, "hit 0 8", ruling("no_cushion", -1)),
    ({"player": 1}, "hit 0 9, pocket 9, pocket 0, pocket 2", ruling("scratch", -1, **BEHIND, spotted=(2, 9))),
    # A scratch on the last ball does not end the game.
    ({"scores": (1, 2), "target": 3}, "hit 0 7, pocket 7", ruling(points=1, continues=True)),
    # The called ball scores, and the others that are potted with it (4.5, 4.6, 4.7).
    (CALLED, TWO, ruling(points=2, continues=True), Call(3, 5)),
    (CALLED, TWO, ruling(spotted=(3, 4)), Call(3, 4)),
    # The opening break (4.3, 4.10)
    (CALLED_BREAK, "hit 0 1, cushion 0, cushion 2, cushion 3", ruling()),
    (CALLED_BREAK, "hit 0 1, cushion 2, cushion 3", ruling("breaking_foul", -2, **AGAIN)),
    (CALLED_BREAK, "hit 0 1, cushion 0, cushion 2", ruling("breaking_foul", -2, **AGAIN)),
    (CALLED_BREAK, "cushion 0, hit 0 1, cushion 2, cushion 3", ruling("breaking_foul", -2, **AGAIN)),
    (CALLED_BREAK, "hit 0 1, pocket 2 0", ruling(points=1, continues=True), Call(2, 0)),
    (CALLED_BREAK, "hit 0 1, pocket 0", ruling("breaking_foul", -2, **BEHIND, **AGAIN)),
    (CALLED_BREAK | {"on_table": (1,)}, "hit 0 1, cushion 0, cushion 1", ruling()),  # with a single object ball
    # A potted cue ball counts as driven to a cushion (8.4).
    (CALLED_BREAK, "hit 0 1, cushion 2, cushion 3, pocket 0", ruling("scratch", -1, **BEHIND)),
    # The balls are racked again with one ball left (4.4), and after the third consecutive foul (4.11).
    (LAST_TWO, POT_3, ruling(points=1, continues=True, rack="rest"), Call(3, 5)),
    (LAST_TWO | {"on_table": (3, 8, 9)}, POT_3, ruling(points=1, continues=True), Call(3, 5)),
    ({"target": 50, "fouls": (2, 0)}, "", ruling("no_hit", -16, continues=True, **BEHIND, rack="all")),
]

POINT = ruling(points=1, continues=True)
CAROM = [
    ({}, "hit 0 2, hit 0 1", POINT),
    ({}, "hit 0 1", ruling()),
    ({"break_shot": True}, "hit 0 1, hit 0 2", POINT),  # the red ball first
    ({"break_shot": True}, "hit 0 2, hit 0 1", ruling()),
    ({"break_shot": True}, "cushion 0, hit 0 1, hit 0 2", ruling()),  # 23: direct
    ({"scores": (8, 9), "target": 10}, "hit 0 2, hit 0 1", POINT),
    # A ball that touches the cue ball must not be played at directly (27).
    ({"touching": (1,)}, "hit 0 1, hit 0 2", ruling("push")),
    ({"touching": (1,)}, "cushion 0, hit 0 1, hit 0 2", POINT),
    ({"touching": (1,)}, "hit 0 2, hit 0 1", POINT),
]
THREE_CUSHION = [
    ({}, "hit 0 1, cushion 0, cushion 0, cushion 0, hit 0 2", POINT),
    ({}, "hit 0 1, cushion 0, cushion 0, hit 0 2, cushion 0", ruling()),
    ({}, "hit 0 1, cushion 1, cushion 1, cushion 1, hit 0 2", ruling()),
]
CASES = {
    "nine_ball": NINE_BALL,
    "ten_ball": TEN_BALL,
    "eight_ball": EIGHT_BALL,
    "straight": STRAIGHT,
    "carom": CAROM,
    "three_cushion": THREE_CUSHION,
}


@pytest.mark.parametrize(("rules", "case"), [(rules, case) for rules in CASES for case in CASES[rules]])
def test_verdicts(rules, case):
    fields, log, verdict, *call = case
    assert judged(rules, fields, log, *call) == verdict


LAST_SOLID, LAST_STRIPE = {"solids": 0, "on_table": (1, 8, 9)}, {"solids": 1, "on_table": (2, 8)}
CALLED_EIGHT = {**CALLED_SOLIDS, "on_table": (8, 9)}


ENDS = [
    ("nine_ball", {"player": 1}, "hit 0 1, hit 1 9, pocket 9", "", 1),
    ("eight_ball", LAST_STRIPE, "hit 0 8, pocket 8", "", 0),
    ("eight_ball", {"solids": 0}, "hit 0 1, hit 1 8, pocket 8", "", 1),  # before the group is potted
    ("eight_ball", LAST_SOLID, "hit 0 1, pocket 1, pocket 8", "", 1),  # in the shot of the last ball of the group
    ("eight_ball", LAST_SOLID, "hit 0 1, pocket 8, pocket 1", "", 1),
    ("eight_ball", GROUP_POTTED, "hit 0 8, pocket 8, pocket 0", "scratch", 1),
    ("eight_ball", GROUP_POTTED, "hit 0 9, hit 9 8, pocket 8", "wrong_ball", 1),
    ("eight_ball", CALLED_EIGHT, "hit 0 8, pocket 8 2", "", 0, Call(8, 2)),
    ("eight_ball", CALLED_EIGHT, "hit 0 8, pocket 8 2", "", 1, Call(8, 3)),  # 3.8 c
    ("eight_ball", OPEN_WITHOUT_SOLIDS, "hit 0 8, pocket 8", "wrong_ball", 1),
    ("eight_ball", {**OPEN_WITHOUT_SOLIDS, **IN_2025}, "hit 0 8, pocket 8", "", 0),  # WPA 2025 4.4
    ("straight", {"scores": (6, 5), "on_table": (7,)}, "hit 0 7, pocket 7", "", 0),
    ("straight", {"scores": (3, 6), "on_table": (7,)}, "hit 0 7, pocket 7", "", 1),
    ("straight", {"scores": (4, 5), "on_table": (7,)}, "hit 0 7, pocket 7", "", -1),
    ("straight", {"scores": (-4, -2), "on_table": (7,)}, "hit 0 7, pocket 7", "", 1),  # fouls cost points
    ("straight", {"scores": (1, 2), "target": 3}, "hit 0 7, pocket 7, pocket 8", "", 0),
    ("straight", LAST_TWO | {"scores": (49, 0)}, POT_3, "", 0, Call(3, 5)),
    ("carom", {"scores": (9, 9), "target": 10}, "hit 0 2, hit 0 1", "", 0),
]


@pytest.mark.parametrize("case", ENDS)
def test_the_end_of_a_game(case):
    rules, fields, log, foul, winner, *call = case
    verdict = judged(rules, fields, log, *call)
    assert (verdict.foul, verdict.over, verdict.winner, verdict.rack) == (foul, True, winner, "")


# The next state.

ALL = tuple(range(16))
THREE_FOULS = {"target": 50, "scores": (3, 9), "fouls": (2, 0)}


NEXT_STATES = [
    ("nine_ball", {"break_shot": True}, "hit 0 1, pocket 2", {"break_shot": False, "player": 0, **PUSH}),
    ("nine_ball", {}, "hit 0 2, pocket 9, pocket 2", {"on_table": (0, 1, *range(3, 10))}),
    ("nine_ball", {"fouls": (2, 1)}, "hit 0 1, cushion 1", {"fouls": (0, 1)}),  # 6.14
    ("eight_ball", BREAK, "hit 0 1, pocket 8, pocket 0", {"on_table": ALL, **BEHIND}),
    ("eight_ball", {}, "hit 0 3, pocket 3, pocket 0", {"on_table": (0, 1, 2, *range(4, 16)), **ANYWHERE}),
    ("straight", {"scores": (3, 5)}, "hit 0 4, pocket 4, pocket 11", {"player": 0, "scores": (5, 5)}),
    ("straight", {"players": 3, "player": 2}, "hit 0 4, cushion 4", {"player": 0}),
    ("straight", {"fouls": (0, 0), "break_shot": True}, "hit 0 1", {"fouls": (0, 0)}),  # 4.11: a breaking foul
    ("straight", THREE_FOULS, "", {"player": 0, "scores": (-13, 9), "fouls": (0, 0), "break_shot": True}),
    ("carom", {}, "hit 0 1", {"player": 1, "cue_balls": (2, 0), "object_balls": (0, 1)}),
]


@pytest.mark.parametrize(("rules", "fields", "log", "after"), NEXT_STATES)
def test_the_state_follows_from_the_verdict(rules, fields, log, after):
    now = words(judge(rules, state(rules, **fields), log)[0])
    assert {name: getattr(now, name) for name in after} == after


# New racks by a call, and a stalemate.

NEW_RACKS = [
    ("eight_ball", "rerack", {}, 1),
    ("eight_ball", "break_again", {}, 0),
    ("straight", "break_again", {"scores": [-2, 0], "fouls": [0, 2]}, 0),
    ("nine_ball", "stalemate", {"breaker": 1, "fouls": [2, 1]}, 1),  # 1.12
    ("snooker", "stalemate", {"scores": [20, 30], "breaker": 0}, 0),  # WPBSA 3.16: all points are lost
]


@pytest.mark.parametrize(("rules", "kind", "fields", "player"), NEW_RACKS)
def test_a_call_for_a_new_rack(rules, kind, fields, player):
    settings = setup(rules)
    start = opening(settings, np.random.default_rng(0), "random")
    fields = {"player": 1, "choices": [kind], "on_table": [0, *range(3, settings.scene.n_balls)], **fields}
    game = custom_opening(settings, start.positions, fields)
    after = play(settings, game, Stroke((0.0, 0.0), call=Call(kind=kind))).game
    now = words(after.state)
    assert (now.player, now.break_shot, now.in_hand, now.choices) == (player, True, "behind", ())
    assert (now.object_balls, now.idle) == (tuple(range(1, settings.scene.n_balls)), 0)
    assert now.scores == ((0, 0) if rules == "snooker" else tuple(fields.get("scores", (0, 0))))
    assert now.fouls == ((0, 0) if kind == "stalemate" else tuple(fields.get("fouls", (0, 0))))
    foot = (settings.scene.table.foot_x, 0.0)
    on_foot = {"eight_ball": 11, "straight": 1, "nine_ball": 1, "snooker": 20}[rules]
    assert tuple(after.positions[on_foot].tolist()) == foot


def test_a_stalemate_may_be_called_after_six_turns_without_progress():  # 1.12
    settings = setup("nine_ball")
    game = custom_opening(settings, in_a_row(10, {0: (0.5, 0.4), 1: (0.9, 0.4)}), {"idle": 10})
    for offered in (False, True):
        game = play(settings, game._replace(positions=in_a_row(10, {0: (0.5, 0.4), 1: (0.9, 0.4)})), HIT).game
        assert ("stalemate" in words(game.state).choices) == offered
    assert (game.state.idle, judged_idle("pocket 1"), judged_idle("")) == (12, 0, 0)


HIT = Stroke((2.0, 0.02))


def judged_idle(log):
    """Returns the number of shots without progress after a pot or a foul."""
    return judge("nine_ball", state("nine_ball", idle=5), f"hit 0 1, {log}" if log else "")[0].idle


# Innings of carom: a limit gives all players the same number of them (UMB, art. 29).

EQUAL = {"innings": 3, "target": 10}
INNINGS = [
    # the fields before the shot, the events, then: over, winner, player, inning, break shot
    ({"scores": (9, 5)}, "hit 0 1, hit 0 2", (False, -1, 1, 0, True)),  # the other player has the equalising inning
    ({"scores": (10, 5), "player": 1}, "hit 0 1", (True, 0, 0, 1, False)),
    ({"scores": (10, 9), "player": 1}, "hit 0 1, hit 0 2", (True, -1, 0, 1, False)),  # a tie
    ({"scores": (10, 8), "player": 1}, "hit 0 1, hit 0 2", (False, -1, 1, 0, False)),
    ({"scores": (5, 9), "player": 1}, "hit 0 1, hit 0 2", (True, 1, 0, 1, False)),
    ({"scores": (5, 6), "player": 1}, "hit 0 1", (False, -1, 0, 1, False)),
    ({"scores": (5, 6), "player": 1, "inning": 2}, "hit 0 1", (True, 1, 0, 3, False)),  # the limit
    ({"scores": (5, 6), "inning": 2}, "hit 0 1", (False, -1, 1, 2, False)),
]


@pytest.mark.parametrize(("fields", "log", "expected"), INNINGS)
def test_all_players_of_carom_have_the_same_number_of_innings(fields, log, expected):
    after, _ = judge("carom", state("carom", **EQUAL, **fields), log)
    assert (after.over, after.winner, after.player, after.inning, after.break_shot) == expected


def test_the_equalising_inning_begins_at_the_starting_position():  # 29
    settings = setup("carom", target=2, innings=5)
    game = custom_opening(settings, [[-0.5, 0.0], [0.5, 0.05], [0.9, 0.02]], {"scores": [1, 0]})
    after = play(settings, game, Stroke((3.0, 0.24))).game
    assert (after.state.scores[0], after.state.player, after.state.over) == (2, 1, False)
    np.testing.assert_allclose(after.positions[[2, 1, 0]], [START, (FOOT, 0.0), (HEAD, 0.0)])
    assert setup("carom").legal(after.state) == (1,)
    given = {name: words(after.state).__dict__[name] for name in settings.game_rules.given}
    assert custom_opening(settings, after.positions, given).state == after.state


def test_consecutive_fouls_are_counted():
    now, fouls = state("nine_ball"), []
    for _ in range(5):  # both players foul in turn
        now, _ = judge("nine_ball", now, "cushion 0")
        fouls.append(words(now).fouls)
    assert fouls == [(1, 0), (1, 1), (2, 1), (2, 2), (3, 2)]
    assert (now.over, now.winner) == (True, 1)


CAROM_SETUP = setup("carom")
FOOT, HEAD = CAROM_SETUP.scene.table.foot_x, CAROM_SETUP.scene.table.head_x
START = (HEAD, -0.1825 / 1.42 * CAROM_SETUP.scene.table.width)
SET_UP_AGAIN = [
    ("carom", {"player": 1, "cue_balls": (2, 0)}, (1, 2), {2: START, 1: (FOOT, 0.0), 0: (HEAD, 0.0)}),
    ("three_cushion", {}, (0, 1), {0: (HEAD, 0.0), 1: (FOOT, 0.0)}),
    ("three_cushion", {"player": 1, "cue_balls": (2, 0)}, (2, 0), {2: (HEAD, 0.0), 0: (0.0, 0.0)}),
]


@pytest.mark.parametrize(("rules", "fields", "touch", "places"), SET_UP_AGAIN)
def test_balls_of_carom_that_touch_are_set_up_again_if_the_player_wants(rules, fields, touch, places):  # 27, paper F
    game, (a, b) = setup(rules), touch
    positions = [[-0.3, -0.2], [0.2, 0.3], [0.5, -0.4]]
    positions[b] = [positions[a][0], positions[a][1] + 2 * game.scene.balls.radius[0]]
    before = custom_opening(game, positions, fields)
    assert words(before.state).choices == ("rerack",)
    after = play(game, before, Stroke((0.0, 0.0), call=Call(kind="rerack"))).game
    np.testing.assert_allclose(after.positions[list(places)], list(places.values()))
    assert words(after.state) == words(changed(before.state, choices=0, touching=0))
    others = [ball for ball in range(3) if ball not in places]
    assert after.positions[others].tolist() == before.positions[others].tolist()


def test_a_ball_is_set_up_on_the_spot_of_the_ball_that_blocks_its_own():  # paper F
    game, gap = setup("three_cushion"), 2 * CAROM_SETUP.scene.balls.radius[0]
    before = custom_opening(game, [[0.3, 0.2], [0.3, 0.2 + gap], [FOOT, 0.01]])
    after = play(game, before, Stroke((0.0, 0.0), call=Call(kind="rerack"))).game
    assert after.positions.tolist() == [[HEAD, 0.0], [0.0, 0.0], [FOOT, 0.01]]


def test_carom_the_second_player_uses_the_other_cue_ball():
    after, verdict = judge("carom", state("carom", player=1, cue_balls=(2, 0)), "hit 0 2, hit 1 2")
    assert verdict == POINT
    assert (words(after).cue_balls, words(after).scores) == ((2, 0), (0, 1))


@pytest.mark.parametrize("players", [2, 3, 4])
def test_turns_rotate(players):
    now = state("nine_ball", players=players)
    order = []
    for _ in range(2 * players):
        order.append(now.player)
        now, _ = judge("nine_ball", now, "hit 0 1, cushion 0")
    assert order == [*range(players)] * 2
