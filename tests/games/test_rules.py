"""The rules of all games, shot by shot, on constructed events. Numbers in comments are rules that a family cites."""

from typing import Any

import pytest

from billiards_env import Scene, simulate
from billiards_env.games import GAMES, Call
from billiards_env.games.facts import facts_of
from tests.helpers.games import facts_in_words, judge, ruling, setup, state, words

SOLIDS, STRIPES = set(range(1, 8)), set(range(9, 16))
COLOURS = YELLOW, GREEN, BROWN, BLUE, PINK, BLACK = range(16, 22)

FACTS = [
    ("", {"first": (), "touched": 0, "potted": (), "driven": (), "cushion_after": False, "cue_driven": False}),
    ("hit 2 3, cushion 3", {"first": (), "driven": (3,)}),  # a contact between other balls
    ("hit 0 1, pocket 7 2, pocket 0 4", {"potted": (7,), "scratch": True, "driven": (7,), "cue_driven": True}),
    ("pocket 0, pocket 7, pocket 2", {"first_potted": (7,)}),
    ("hit 0 4 & hit 0 2, hit 0 7", {"first": (2, 4)}),  # at the same instant
    ("cushion 0, hit 3 0, hit 3 5, hit 0 5", {"first": (3,)}),
    ("cushion 0, hit 0 2, cushion 0, hit 2 0, cushion 0, hit 1 0", {"touched": 2, "cushions_before_last": 3}),
    ("cushion 0, hit 0 1", {"cushion_after": False}),
    ("hit 0 1, cushion 0", {"cushion_after": True}),
    ("hit 0 1, off 0, off 3", {"cue_off": True, "driven_off": (3,), "driven": (3,), "potted": (), "scratch": False}),
    ("hit 0 3, cushion 3, cushion 4, pocket 3, pocket 5, pocket 4", {"banked": (3,)}),
    ("cushion 0, cushion 0, hit 0 3, cushion 3, hit 0 4, pocket 3", {"banked": (), "cushions_before_last": 2}),
    ("cushion 0", {"banked": ()}),
    ("hit 0 1, pocket 1 2, pocket 4 3, pocket 5 2, pocket 6 1, pocket 0 3", {"foot_right": (1, 5), "foot_left": (4,)}),
]


@pytest.mark.parametrize(("log", "expected"), FACTS)
def test_facts(log, expected):
    assert {name: facts_in_words(log)[name] for name in expected} == expected


def test_the_cue_ball_may_have_another_number():
    facts = facts_in_words("cushion 2, hit 0 2, cushion 0, hit 1 2, cushion 2", cue=2)
    expected = {"first": (0,), "touched": 2, "cushions_before_last": 1}
    expected |= {"cushion_after": True, "cue_driven": True, "driven": (0,)}
    assert {name: facts[name] for name in expected} == expected


def test_facts_of_a_real_shot():
    shot = simulate(Scene.named("pool"), [[-0.635, 0.0], [0.635, 0.3]], [2.0, 0.45])
    facts = words(facts_of(GAMES["nine_ball"].facts, shot)[0])
    assert facts.first == (shot.first_hit,) == (1,)
    assert (facts.potted, facts.cushion_after) == ((1,), True)


# The balls that a player may touch first: the game, the state, the player and the balls.

OPEN_WITHOUT_SOLIDS: dict[str, Any] = {"on_table": (8, 9, 12)}  # all solids are potted
IN_2025 = {"edition": 1}
ON_BLACK, FREE = {"solids": 0, "on_table": (0, 8, 9, 10)}, {"free_ball": True}
LEGAL = [
    ("straight", {"on_table": (3, 8)}, 0, {3, 8}),
    ("nine_ball", {"on_table": (9, 4, 7)}, 1, {4}),
    ("eight_ball", {"break_shot": True}, 0, SOLIDS | {8} | STRIPES),
    ("eight_ball", {"solids": 0}, 0, SOLIDS),
    ("eight_ball", {"solids": 0}, 1, STRIPES),
    ("eight_ball", {"solids": 1, "on_table": (3, 8)}, 0, {8}),  # the eight ball after the group
    ("eight_ball", OPEN_WITHOUT_SOLIDS, 0, {9, 12}),
    ("eight_ball", OPEN_WITHOUT_SOLIDS | IN_2025, 0, {8, 9, 12}),  # WPA 2025 4.4
    ("eight_ball", {"on_table": (3, 8, 9), **IN_2025}, 0, {3, 9}),
    ("eight_ball", {"on_table": (8, 9), "solids": 1, **IN_2025}, 0, {9}),
    ("blackball", {}, 0, SOLIDS | STRIPES),
    ("blackball", {"break_shot": True}, 0, SOLIDS | {8} | STRIPES),
    ("blackball", ON_BLACK, 0, {8}),
    ("blackball", FREE | {"solids": 0}, 0, SOLIDS | {8} | STRIPES),  # 6b
    ("blackball", FREE | {"solids": 0}, 1, STRIPES),
    ("snooker", {}, 0, set(range(1, 16))),  # WPBSA 3.3
    ("snooker", {"colour": True}, 0, {*COLOURS}),
    ("snooker", {"colour": True}, 1, set(range(1, 16))),  # a red after a turn
    ("snooker", {"on_table": (BLUE, PINK, BLACK)}, 0, {BLUE}),
    ("snooker", {"on_table": COLOURS, "colour": True}, 0, {*COLOURS}),  # after the last red
    ("snooker", FREE, 0, set(range(1, 22))),
]


@pytest.mark.parametrize(("rules", "fields", "player", "legal"), LEGAL)
def test_legal_balls(rules, fields, player, legal):
    settings, before = setup(rules), state(rules, **fields)
    assert set(settings.legal(before, player)) == legal
    if settings.game_rules.callable:
        assert set(settings.callable(before, player)) == legal


# Verdicts: the state, the events or the facts of the shot, the expected ruling, and the call.

ANYWHERE: dict[str, Any] = {"in_hand": "anywhere"}
BEHIND: dict[str, Any] = {"in_hand": "behind"}
BREAK = {"break_shot": True, "in_hand": "behind"}
THREE = "hit 0 1, cushion 2, cushion 3, cushion 4, cushion 4, cushion 0"  # three object balls are driven to a cushion
PUSH, PUSH_OUT = {"choices": ("push_out",)}, Call(kind="push_out")
HAND_BACK: dict[str, Any] = {"choices": ("hand_back",)}
MISS = ruling("no_hit", **ANYWHERE)


def won(winner=0, foul="", points=0, **fields):
    return ruling(foul, points, over=True, winner=winner, **fields)


NINE_BALL = [
    ({"fouls": (2, 1)}, "hit 0 1, cushion 1", ruling(fouls=(0, 1), player=1)),  # 6.14
    ({}, "hit 0 1, hit 1 6, pocket 6", ruling(continues=True, player=0)),  # any legal pot continues
    ({}, "hit 0 2, hit 0 1, cushion 1", ruling("wrong_ball", **ANYWHERE)),
    ({}, "hit 0 1", ruling("no_cushion", **ANYWHERE)),
    ({}, "hit 0 1, cushion 1, pocket 0", ruling("scratch", **ANYWHERE)),
    ({}, "hit 0 1, cushion 1, off 0", ruling("scratch", **ANYWHERE)),  # 6.1
    ({}, "hit 0 2 & hit 0 1, cushion 1", ruling()),  # a split hit counts as the legal ball first
    ({"on_table": (3, 9)}, "hit 0 2 & hit 0 1, cushion 1", ruling("wrong_ball", **ANYWHERE)),
    (BREAK, THREE, ruling("illegal_break", **ANYWHERE)),
    (BREAK, "hit 0 1, pocket 2", ruling(continues=True, choices=("push_out",))),
    (BREAK, f"{THREE}, cushion 9", ruling(choices=("push_out",), break_shot=False)),
    (BREAK, f"{THREE}, pocket 9", won(continues=True)),
    (BREAK, "hit 0 1, pocket 0", ruling("scratch", **ANYWHERE)),
    # Only the nine ball is spotted after a foul (2.6).
    ({}, "hit 0 2, pocket 9, pocket 2", ruling("wrong_ball", **ANYWHERE, spotted=(9,), on_table=(0, 1, *range(3, 10)))),
    ({}, "hit 0 1, off 4", ruling("driven_off", **ANYWHERE, on_table=(0, 1, 2, 3, *range(5, 10)))),  # 6.5
    ({}, "hit 0 1, off 9", ruling("driven_off", **ANYWHERE, spotted=(9,))),
    # A push out needs no hit and passes the turn (2.4).
    (PUSH, "", ruling(**HAND_BACK), PUSH_OUT),
    (PUSH, "hit 0 5", ruling(**HAND_BACK), PUSH_OUT),
    (PUSH, "hit 0 5, pocket 0", ruling("scratch", **ANYWHERE), PUSH_OUT),
    (PUSH, "hit 0 9, pocket 9", ruling(spotted=(9,), **HAND_BACK), PUSH_OUT),  # 2.6
    (PUSH | {"fouls": (2, 0)}, "hit 0 5, off 5", won(1, "driven_off", **ANYWHERE), PUSH_OUT),  # suspends only 6.2, 6.3
    ({"player": 1}, "hit 0 1, hit 1 9, pocket 9", won(1, continues=True)),
    ({"fouls": (1, 2), "player": 1}, "cushion 0", won(0, "no_hit", **ANYWHERE, fouls=(1, 3))),
    ({"fouls": (1, 0)}, "cushion 0", MISS | {"fouls": (2, 0)}),
    ({"players": 3, "fouls": (2, 0, 0)}, "", MISS | {"player": 1}),  # 2.8: only with two players
    ({"players": 3, "player": 2}, "", MISS | {"player": 0}),
    ({"idle": 5}, "hit 0 1, cushion 1", ruling(idle=6)),  # 1.12
    ({"idle": 5}, "hit 0 1, pocket 1", ruling(continues=True, idle=0)),
    ({"idle": 5}, "", MISS | {"idle": 0}),
]

CALLED = {"call_shot": True}
SPOTTED_TEN: dict[str, Any] = {"spotted": (10,)}
LAST_TEN = {"call_shot": True, "on_table": (10,)}
POT_1 = "hit 0 1, pocket 1 5"
TEN_BALL = [
    (BREAK | CALLED, f"{THREE}, pocket 5", ruling(continues=True, choices=("push_out",))),  # 9.5: nothing is called
    (BREAK | CALLED, f"{THREE}, pocket 10", ruling(continues=True, choices=("push_out",), **SPOTTED_TEN)),  # 9.9
    (BREAK | CALLED, THREE, ruling("illegal_break", **ANYWHERE)),  # 9.3
    (CALLED | PUSH, "hit 0 10, pocket 10", ruling(**HAND_BACK, **SPOTTED_TEN), PUSH_OUT),  # 9.4
    (CALLED | PUSH | {"fouls": (2, 0)}, "hit 0 5, off 5", won(1, "driven_off", **ANYWHERE), PUSH_OUT),  # 9.4
    (CALLED, POT_1, ruling(continues=True), Call(1, 5)),
    (CALLED, "hit 0 1, pocket 10 0", ruling(continues=True, **SPOTTED_TEN), Call(10, 0)),  # 9.8: before the last ball
    (CALLED, POT_1, ruling(**HAND_BACK), Call(1, 5, "safety")),  # 9.6
    ({}, "hit 0 1, off 10", ruling("driven_off", **ANYWHERE, **SPOTTED_TEN)),  # 9.9
    (LAST_TEN, "hit 0 10, pocket 10 5", won(continues=True), Call(10, 5)),
    (LAST_TEN, "hit 0 10, pocket 10 5", ruling(**HAND_BACK, **SPOTTED_TEN), Call(10, 4)),  # 9.9
    ({"fouls": (2, 0)}, "", won(1, "no_hit", **ANYWHERE)),  # 9.11
]

RACK_AGAIN: dict[str, Any] = {"choices": ("rerack", "break_again")}
CALLED_SOLIDS = {"call_shot": True, "solids": 0}
POT_3, BOTH_GROUPS, SAFETY = "hit 0 3, pocket 3 5", "hit 0 3, pocket 3 5, pocket 9 0", Call(3, 5, "safety")
GROUP_POTTED = {"solids": 0, "on_table": (8, 9)}
LAST_SOLID, LAST_STRIPE = {"solids": 0, "on_table": (1, 8, 9)}, {"solids": 1, "on_table": (2, 8)}
EIGHT_BALL = [
    ({}, "hit 0 5, cushion 5", ruling()),
    ({}, "hit 0 8, cushion 8", ruling("wrong_ball", **ANYWHERE)),
    ({}, "hit 0 3, pocket 3, pocket 0", ruling("scratch", **ANYWHERE, on_table=(0, 1, 2, *range(4, 16)))),
    ({}, "hit 0 1, cushion 1, off 0", ruling("scratch", **ANYWHERE)),  # 6.1
    ({"solids": 1}, "hit 0 7, cushion 7", ruling("wrong_ball", **ANYWHERE, solids=1)),
    ({"solids": 0}, "hit 0 1, off 3", ruling("driven_off", **ANYWHERE, solids=0)),  # 3.7: it stays off
    (BREAK, "hit 0 1, pocket 3", ruling(continues=True)),  # the table stays open
    (BREAK, "hit 0 1, cushion 1, cushion 2, cushion 3, cushion 3", ruling(**RACK_AGAIN)),  # 3.3 d: three balls
    (BREAK, "hit 0 1, cushion 1, cushion 2, cushion 3, cushion 4", ruling()),
    (BREAK, "", ruling("no_hit", **BEHIND, **RACK_AGAIN)),
    (BREAK, "hit 0 1, pocket 0", ruling("scratch", **BEHIND, **RACK_AGAIN)),
    (BREAK, "hit 0 1, pocket 2, pocket 0", ruling("scratch", **BEHIND)),
    (BREAK, "hit 0 1, pocket 2, off 3", ruling("driven_off", **BEHIND)),  # 3.3 g
    (BREAK, "hit 0 1, pocket 2, off 8", ruling("driven_off", **BEHIND, spotted=(8,))),
    (BREAK, "hit 0 1, pocket 8", ruling(continues=True, spotted=(8,), choices=("rerack",))),  # 3.3 e
    (BREAK, "hit 0 1, pocket 8, pocket 0", ruling("scratch", **BEHIND, spotted=(8,), choices=("rerack",))),  # 3.3 f
    # The first ball of a legal pot decides the groups.
    ({}, "hit 0 12, hit 12 7, pocket 7", ruling(continues=True, solids=0)),
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
    # The end (3.8).
    (LAST_STRIPE, "hit 0 8, pocket 8", won(solids=1)),
    ({"solids": 0}, "hit 0 1, hit 1 8, pocket 8", won(1, solids=0)),  # before the group is potted
    (LAST_SOLID, "hit 0 1, pocket 1, pocket 8", won(1, solids=0)),  # in the shot of the last ball of the group
    (LAST_SOLID, "hit 0 1, pocket 8, pocket 1", won(1, solids=0)),  # before the last ball of the group
    (GROUP_POTTED, "hit 0 8, pocket 8, pocket 0", won(1, "scratch", **ANYWHERE, solids=0)),
    (GROUP_POTTED, "hit 0 9, hit 9 8, pocket 8", won(1, "wrong_ball", **ANYWHERE, solids=0)),
    (GROUP_POTTED, "hit 0 8, off 8", won(1, "driven_off", **ANYWHERE, solids=0)),
    (GROUP_POTTED | CALLED, "hit 0 8, pocket 8 2", won(solids=0), Call(8, 2)),
    (GROUP_POTTED | CALLED, "hit 0 8, pocket 8 2", won(1, solids=0), Call(8, 3)),  # 3.8 c
    (OPEN_WITHOUT_SOLIDS, "hit 0 8, pocket 8", won(1, "wrong_ball", **ANYWHERE)),
    (OPEN_WITHOUT_SOLIDS | IN_2025, "hit 0 8, pocket 8", won()),  # WPA 2025 4.4
]

TWO = "hit 0 3, pocket 4 1, pocket 3 5"
AGAIN: dict[str, Any] = {"choices": ("break_again",)}
CALLED_BREAK = {"call_shot": True, "break_shot": True}
LAST, LAST_TWO = {"on_table": (7,)}, {"call_shot": True, "target": 50, "on_table": (3, 8)}
POT_7, POT_7_AND_8 = "hit 0 7, pocket 7", "hit 0 7, pocket 7, pocket 8"
THREE_FOULS = {"target": 50, "scores": (3, 9), "fouls": (2, 0)}
STRAIGHT = [
    ({"scores": (3, 5)}, "hit 0 4, pocket 4, pocket 11", ruling(points=2, continues=True, player=0, scores=(5, 5))),
    ({}, "", ruling("no_hit", -1)),  # 4.9: the cue ball stays
    ({}, "hit 0 8", ruling("no_cushion", -1)),
    ({}, "hit 0 1, off 3", ruling("driven_off", -1, spotted=(3,))),  # 4.6, 4.9
    ({}, "hit 0 1, cushion 1, off 0", ruling("scratch", -1, **BEHIND)),  # 6.1
    ({"player": 1}, "hit 0 9, pocket 9, pocket 0, pocket 2", ruling("scratch", -1, **BEHIND, spotted=(2, 9))),
    # The called ball scores, and the others that are potted with it (4.5, 4.6, 4.7).
    (CALLED, TWO, ruling(points=2, continues=True), Call(3, 5)),
    (CALLED, TWO, ruling(spotted=(3, 4)), Call(3, 4)),
    # The opening break (4.3, 4.10)
    (CALLED_BREAK, "hit 0 1, cushion 0, cushion 2, cushion 3", ruling()),
    (CALLED_BREAK, "hit 0 1, cushion 2, cushion 3", ruling("breaking_foul", -2, **AGAIN, fouls=(0, 0))),  # 4.11
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
    ({"target": 50, "fouls": (1, 0)}, "", ruling("no_hit", -1, fouls=(2, 0))),
    ({"fouls": (2, 0)}, "", ruling("no_hit", -1)),  # only in a game with a target
    (
        *(THREE_FOULS, ""),
        ruling("no_hit", -16, continues=True, **BEHIND, rack="all", scores=(-13, 9), fouls=(0, 0), break_shot=True),
    ),
    # The highest score wins a single rack, and the target score a game.
    (LAST | {"scores": (6, 5)}, POT_7, won(points=1, continues=True)),
    (LAST | {"scores": (3, 6)}, POT_7, won(1, points=1, continues=True)),
    (LAST | {"scores": (4, 5)}, POT_7, won(-1, points=1, continues=True)),
    (LAST | {"scores": (-4, -2)}, POT_7, won(1, points=1, continues=True)),  # fouls cost points
    (LAST, "hit 0 7, pocket 7, pocket 0", ruling("scratch", -1, **BEHIND, spotted=(7,))),
    ({"scores": (1, 2), "target": 3}, POT_7, ruling(points=1, continues=True)),
    ({"scores": (1, 2), "target": 3}, POT_7_AND_8, won(points=2, continues=True)),
    (LAST_TWO | {"scores": (49, 0)}, POT_3, won(points=1, continues=True), Call(3, 5)),
]

LEGAL_HIT = "hit 0 3, cushion 3"
THREE_POTTED: dict[str, Any] = {"on_table": (0, *range(4, 16))}  # the balls 1, 2 and 3
ONE_POCKET = [
    ({}, LEGAL_HIT, ruling()),
    # Only a ball in the player's own pocket scores and continues (3.1): pocket 2 of player 0, and pocket 3 of player 1.
    ({}, "hit 0 3, pocket 3 2", ruling(points=1, continues=True)),
    ({"player": 1}, "hit 0 3, pocket 3 3", ruling(points=1, continues=True)),
    ({}, "hit 0 3, pocket 3 3", ruling(penalty=1)),
    ({"player": 1}, "hit 0 3, pocket 3 2", ruling(penalty=1)),
    ({}, "hit 0 3, pocket 3 2, pocket 4 3", ruling(points=1, penalty=1, continues=True)),
    # Balls in the other four pockets are spotted (1).
    ({}, "hit 0 3, pocket 3 2, pocket 4 1, pocket 5 5", ruling(points=1, continues=True, spotted=(4, 5))),
    # The break has the requirements of any shot (2.2). The cue ball may touch a cushion first.
    ({"break_shot": True}, "cushion 0, hit 0 1, cushion 1", ruling()),
    ({"break_shot": True}, "hit 0 1", ruling("no_cushion", -1)),
    # A foul costs a point; a player who has one spots a ball (6.2). The cue ball stays, except after a scratch (6.3).
    ({}, "", ruling("no_hit", -1)),
    ({}, "hit 0 1, off 3", ruling("driven_off", -1, spotted=(3,))),
    (THREE_POTTED | {"scores": (2, 1)}, "", ruling("no_hit", -1, spotted=(1,))),
    (THREE_POTTED | {"scores": (0, 3)}, "", ruling("no_hit", -1)),
    ({"scores": (1, 0)}, "", ruling("no_hit", -1)),  # all balls are on the table, so none is spotted
    ({}, "hit 0 3, pocket 3 2, pocket 0", ruling("scratch", -1, **BEHIND, spotted=(3,))),
    ({}, "hit 0 3, pocket 3 3, pocket 0", ruling("scratch", -1, **BEHIND, spotted=(3,))),
    # Without a hit, a ball moves only if it touches a ball that the cue drives. It counts for the owner of the pocket.
    ({}, "pocket 3 3, pocket 4 2", ruling("no_hit", -1, penalty=1, spotted=(4,))),
    # Owed balls are spotted when they score (6.4), for either player.
    ({"scores": (-1, 0)}, "hit 0 3, pocket 3 2", ruling(points=1, continues=True, spotted=(3,))),
    ({"scores": (-1, 0)}, "hit 0 3, pocket 5 2, pocket 3 2", ruling(points=2, continues=True, spotted=(3,))),
    ({"scores": (-2, 0)}, "hit 0 3, pocket 5 2, pocket 3 2", ruling(points=2, continues=True, spotted=(3, 5))),
    ({"scores": (0, -1)}, "hit 0 3, pocket 3 3", ruling(penalty=1, spotted=(3,))),
    ({"scores": (7, 7), "target": 0}, "hit 0 3, pocket 3 2", ruling(points=1, continues=True)),
    ({"fouls": (2, 0), "target": 0}, "", ruling("no_hit", -1)),
    # The end (3.2, 7).
    ({"scores": (7, 3)}, "hit 0 4, pocket 4 2", won(points=1, continues=True)),
    ({"scores": (3, 7)}, "hit 0 4, pocket 4 3", won(1, penalty=1)),
    ({"scores": (7, 7)}, "hit 0 4, pocket 4 3, pocket 5 2", won(points=1, penalty=1, continues=True)),
    ({"scores": (7, 7), "player": 1}, "hit 0 4, pocket 4 3, pocket 5 2", won(1, points=1, penalty=1, continues=True)),
    ({"scores": (7, 7)}, "pocket 5 2, pocket 4 3", won(1, "no_hit", -1, penalty=1, spotted=(5,))),
    ({"fouls": (2, 0), "scores": (7, 0)}, "", won(1, "no_hit", -1)),
    ({"fouls": (0, 2), "player": 1}, "hit 0 4", won(0, "no_cushion", -1)),
    ({"on_table": (0, 4), "scores": (3, 2), "target": 0}, "hit 0 4, pocket 4 3", won(-1, penalty=1)),
    ({"on_table": (0, 4), "scores": (3, 3), "target": 9}, "hit 0 4, pocket 4 3", won(1, penalty=1)),
]

BANK = "hit 0 3, cushion 3, pocket 3 5"
POINT = ruling(points=1, continues=True)
TWO_BANKS = "hit 0 5 & hit 0 3, cushion 5 & cushion 3, pocket 5 1 & pocket 3 4"
BANK_POOL = [
    ({}, LEGAL_HIT, ruling()),
    # A ball that hits a cushion before the pot scores (1, 3.2). Others are spotted.
    ({}, BANK, POINT),
    ({}, "hit 0 3, cushion 3, cushion 3, pocket 3", POINT),  # off two cushions
    ({}, "hit 0 3, pocket 3", ruling(spotted=(3,))),
    ({}, f"{BANK}, pocket 4", ruling(points=1, continues=True, spotted=(4,))),
    ({}, "cushion 0, hit 0 3, cushion 3, pocket 3", ruling(spotted=(3,))),  # a kick
    ({}, "hit 0 4, hit 4 3, cushion 3, pocket 3", ruling(spotted=(3,))),  # a combination
    ({}, "hit 0 4, hit 0 3, cushion 3, pocket 3", ruling(spotted=(3,))),  # a carom
    ({}, TWO_BANKS, ruling(points=1, continues=True, spotted=(5,))),
    # On the break potted balls do not score, and the shooter continues (2.1). The break has no requirements (2.2).
    ({"break_shot": True}, BANK, ruling(continues=True, spotted=(3,))),
    ({"break_shot": True}, "hit 0 1, cushion 1", ruling()),
    # The called ball scores in the called pocket (3.1).
    (CALLED, BANK, POINT, Call(3, 5)),
    (CALLED, BANK, ruling(spotted=(3,)), Call(3, 4)),
    (CALLED, BANK, ruling(spotted=(3,)), Call(4, 5)),
    (CALLED, BANK, ruling(spotted=(3,))),
    (CALLED, BANK, ruling(spotted=(3,)), Call(3, 5, "safety")),
    (CALLED, "hit 0 3, pocket 3 5", ruling(spotted=(3,)), Call(3, 5)),
    (CALLED, TWO_BANKS, ruling(points=1, continues=True, spotted=(3,)), Call(5, 1)),
    # A foul costs a point and a ball; a player without a point owes it (11).
    ({}, "", ruling("no_hit", -1)),
    ({}, "hit 0 1, off 3", ruling("driven_off", -1, spotted=(3,))),
    (THREE_POTTED | {"scores": (2, 0)}, "", ruling("no_hit", -1, spotted=(1,))),
    (THREE_POTTED | {"scores": (0, 2)}, "", ruling("no_hit", -1)),
    ({}, f"{BANK}, pocket 0", ruling("scratch", -1, **BEHIND, spotted=(3,))),
    ({"break_shot": True}, "hit 0 1, pocket 1, pocket 0", ruling("scratch", -1, **BEHIND, spotted=(1,))),
    ({"scores": (-1, 0)}, BANK, ruling(points=1, continues=True, spotted=(3,))),
    ({"scores": (0, -1)}, BANK, POINT),
    ({"fouls": (2, 0), "target": 0}, "", ruling("no_hit", -1)),
    # The end.
    ({"scores": (7, 3)}, BANK, won(points=1, continues=True)),
    ({"scores": (7, 3), "player": 1, "fouls": (0, 2)}, "", won(0, "no_hit", -1)),
    ({"on_table": (0, 3), "scores": (3, 2), "target": 0}, BANK, won(points=1, continues=True)),
    ({"on_table": (0, 3), "scores": (3, 4), "target": 0}, BANK, won(-1, points=1, continues=True)),
]

REDS: dict[str, Any] = {"solids": 0}
FREE_REDS, FREE_BLACK = FREE | REDS, FREE | ON_BLACK
BLACKBALL = [
    # 4b (simplified), 4d (simplified), 4e
    (BREAK, "hit 0 1, cushion 1, cushion 2", ruling()),
    (BREAK, "hit 0 8, pocket 9", ruling(continues=True)),
    (BREAK, "hit 0 1, cushion 1", ruling("illegal_break")),
    (BREAK, "hit 0 1", ruling("no_cushion")),
    (BREAK, "", ruling("no_hit")),
    (BREAK, "hit 0 1, pocket 2, pocket 0", ruling("scratch", **BEHIND)),
    (BREAK, "hit 0 1, pocket 8", ruling(continues=True, spotted=(8,))),
    (BREAK, "hit 0 1, pocket 8, pocket 0", ruling(continues=True, spotted=(8,), **BEHIND)),
    # Pots of one group decide the groups; pots of both groups do not.
    ({}, "hit 0 12, hit 12 7, pocket 7", ruling(continues=True, solids=0)),
    ({"player": 1}, "hit 0 12, pocket 12, pocket 9", ruling(continues=True, solids=0)),
    ({}, "hit 0 12, pocket 12", ruling(continues=True, solids=1)),
    ({}, "hit 0 12, pocket 12, pocket 7", ruling(continues=True)),
    ({}, "hit 0 12, cushion 12", ruling()),
    ({}, "hit 0 8, cushion 8", ruling("wrong_ball")),
    # 5: the fouls; only a scratch puts the cue ball in hand (5a).
    (REDS, "hit 0 3, cushion 3", ruling(solids=0)),
    (REDS, "hit 0 3", ruling("no_cushion", solids=0)),  # 5d
    (REDS, "hit 0 9, cushion 9", ruling("wrong_ball", solids=0)),
    (REDS, "hit 0 8, cushion 8", ruling("wrong_ball", solids=0)),
    (ON_BLACK, "hit 0 9, cushion 9", ruling("wrong_ball", solids=0)),
    (REDS, "cushion 0", ruling("no_hit", solids=0)),
    (REDS, "hit 0 3, pocket 3, pocket 0", ruling("scratch", solids=0, **BEHIND)),
    (REDS, "hit 0 3, pocket 3, off 0", ruling("scratch", solids=0, **BEHIND)),
    (REDS, "hit 0 1, off 3", ruling("driven_off", solids=0, spotted=(3,))),
    # Pots of the other group alone are a foul; together with a pot of the player's own group they are not.
    (REDS, "hit 0 3, pocket 9", ruling("wrong_pot", solids=0)),
    (REDS, "hit 0 3, pocket 9, pocket 3", ruling(continues=True, solids=0)),
    (ON_BLACK, "hit 0 8, pocket 9", ruling("wrong_pot", solids=0)),
    # A free shot may touch and pot any ball (6b), and the visit follows (6a). It does not decide the groups (4f).
    (FREE, "hit 0 8, pocket 3", ruling(continues=True)),
    (FREE_REDS, "hit 0 9, pocket 9", ruling(continues=True, solids=0)),
    (FREE_REDS, "hit 0 9, cushion 9", ruling(continues=True, solids=0)),
    (FREE_REDS, "hit 0 9", ruling("no_cushion", solids=0)),
    (FREE_REDS, "hit 0 9, pocket 9, pocket 0", ruling("scratch", solids=0, **BEHIND)),
    (FREE_BLACK, "hit 0 9, cushion 9", ruling(continues=True, solids=0)),
    # The end (7b).
    (ON_BLACK, "hit 0 8, pocket 8", won(solids=0)),
    (ON_BLACK | {"player": 1}, "hit 0 9, pocket 8", won(0, solids=0)),  # before the last yellow ball
    (ON_BLACK, "hit 0 8, pocket 8, pocket 9", won(solids=0)),
    (ON_BLACK, "hit 0 8, pocket 8, pocket 0", won(1, "scratch", **BEHIND, solids=0)),
    (ON_BLACK, "hit 0 8, off 8", won(1, "driven_off", solids=0)),
    (ON_BLACK, "hit 0 9, pocket 8", won(1, "wrong_ball", solids=0)),
    (FREE_BLACK, "hit 0 9, hit 9 8, pocket 8", won(solids=0)),
    (REDS, "hit 0 3, pocket 8", won(1, solids=0)),
    (FREE_REDS, "hit 0 8, pocket 8", won(1, solids=0)),
    ({"solids": 0, "on_table": (0, 1, 8, 9)}, "hit 0 1, pocket 1, pocket 8", won(1, solids=0)),  # with the last red
]


def pot(ball):
    """Returns the events of a shot that hits and pots a ball."""
    return f"hit 0 {ball}, pocket {ball}"


def scored(points, *spotted, **fields):
    return ruling(points=points, continues=True, spotted=spotted, **fields)


def fouled(foul, penalty, *spotted, **fields):
    """Returns the ruling on a foul of snooker."""
    in_hand = "behind" if foul == "scratch" else "no"
    return ruling(foul, penalty=penalty, spotted=spotted, **{"in_hand": in_hand, **HAND_BACK, **fields})


COLOUR, LAST_COLOURS, LAST_BLACK = {"colour": True}, {"on_table": (BLUE, PINK, BLACK)}, {"on_table": (BLACK,)}
LAST_RED, TO_40 = {"on_table": (1, *COLOURS)}, {"target": 40}
RED_TOUCHES, BLUE_TOUCHES = {"touching": (3,)}, {"touching": (BLUE,)}
PINK_TOUCHES = {"colour": True, "touching": (PINK,)}
WITH_MISS, REPLACE = {"miss": True}, {"choices": ("hand_back", "replace")}
TIED = fouled("", 0, BLACK, **BEHIND, on_table=(0, BLACK), player=1, scores=(47, 47))
SNOOKER = [
    ({}, pot(4), scored(1, colour=True)),  # 3.3 d
    ({}, f"{pot(4)}, pocket 9", scored(2, colour=True)),
    ({}, "hit 0 3", ruling()),  # a miss needs no cushion
    (COLOUR, f"hit 0 {BLUE}", ruling()),
    (LAST_BLACK, f"hit 0 {BLACK}", ruling()),
    # A colour scores its value and is spotted, also after the last red (3.3 e). Then the colours stay down (3.3 f).
    *((COLOUR, pot(ball), scored(ball - 14, ball)) for ball in COLOURS),
    (COLOUR, pot(BLUE), scored(BLUE - 14, BLUE), Call(BLUE)),
    (COLOUR | {"on_table": COLOURS}, pot(BLACK), scored(7, BLACK)),
    *(({"on_table": range(ball, 22)}, pot(ball), scored(ball - 14)) for ball in COLOURS[:-1]),
    # A free ball counts as a red and is spotted (3.12 a, c, e), or scores the value of the ball on (3.12 a, d, e).
    (FREE, "hit 0 1", ruling()),
    (FREE, pot(1), scored(1, colour=True)),
    (FREE, pot(GREEN), scored(1, GREEN, colour=True)),
    (FREE, pot(GREEN), scored(1, GREEN, colour=True), Call(GREEN)),
    (FREE, f"{pot(GREEN)}, pocket 4", scored(2, GREEN, colour=True)),
    (FREE | LAST_COLOURS, pot(BLACK), scored(5, BLACK)),
    (FREE | LAST_COLOURS, f"hit 0 {BLACK}, pocket {BLUE}", scored(5)),
    (FREE | LAST_COLOURS, f"hit 0 {BLACK}, pocket {BLUE}, pocket {BLACK}", scored(5, BLACK)),
    # Fouls and their values.
    ({}, "", fouled("no_hit", 4)),  # 3.10 a
    ({}, "hit 0 1, pocket 0", fouled("scratch", 4)),
    ({}, "hit 0 1, off 0", fouled("scratch", 4)),
    ({}, f"hit 0 {YELLOW}", fouled("wrong_ball", 4)),
    ({}, f"hit 0 {BLUE}", fouled("wrong_ball", 5)),  # 3.10 b
    ({}, f"hit 0 {BLACK}, pocket 0", fouled("scratch", 7)),
    ({}, f"hit 0 1, pocket {PINK}", fouled("wrong_pot", 6, PINK)),
    ({}, f"{pot(1)}, pocket {GREEN}", fouled("wrong_pot", 4, GREEN)),
    ({}, f"hit 0 {BLUE}, pocket {BLACK}", fouled("wrong_ball", 7, BLACK)),
    (COLOUR, f"hit 0 {BLUE}, pocket 0", fouled("scratch", 5)),
    (COLOUR, f"hit 0 {YELLOW}, pocket 0", fouled("scratch", 4)),
    (COLOUR, f"hit 0 {BLUE}, pocket 3", fouled("wrong_pot", 5)),
    (COLOUR, f"hit 0 {BLUE}", fouled("wrong_ball", 6), Call(PINK)),
    (COLOUR, f"hit 0 {BLACK}", fouled("wrong_ball", 7), Call(PINK)),
    (COLOUR, f"hit 0 {PINK}, pocket {BLUE}", fouled("wrong_pot", 6, BLUE), Call(PINK)),
    (COLOUR, "", fouled("no_hit", 4), Call(YELLOW)),
    (COLOUR, "", fouled("no_hit", 7)),  # 3.10 d: a foul before a colour is nominated
    (COLOUR, "hit 0 3", fouled("wrong_ball", 7)),  # 3.10 d: two reds in succession
    ({"on_table": (PINK, BLACK)}, "", fouled("no_hit", 6)),
    ({"on_table": (PINK, BLACK)}, f"hit 0 {PINK}, pocket {BLACK}", fouled("wrong_pot", 7, BLACK)),
    ({"on_table": (BROWN, BLUE, PINK, BLACK)}, f"hit 0 {BLUE}", fouled("wrong_ball", 5)),
    (FREE, "hit 0 1", fouled("wrong_ball", 4), Call(BLUE)),  # 3.12 b: the nominated ball first
    (FREE, "", fouled("no_hit", 4)),
    # Reds stay down, colours are spotted, also the one that is on (3.7), and the other player has the penalty (3.10).
    (
        *({"scores": (10, 20)}, f"hit 0 {BLUE}, pocket 2, pocket {BLUE}, pocket {BLACK}"),
        fouled("wrong_ball", 7, BLUE, BLACK, player=1, scores=(10, 27), on_table=(0, 1, *range(3, 22))),
    ),
    (COLOUR, f"{pot(BLUE)}, pocket 0", fouled("scratch", 5, BLUE)),
    (LAST_COLOURS, f"{pot(BLUE)}, pocket 0", fouled("scratch", 5, BLUE)),
    # Balls driven off the table, and jump shots (3.10).
    ({}, "hit 0 1, off 5", fouled("driven_off", 4)),
    ({}, f"hit 0 1, off {BLUE}", fouled("driven_off", 5, BLUE)),
    (COLOUR, f"hit 0 {BLUE}, off {BLACK}", fouled("driven_off", 7, BLACK)),
    ({}, {"first": (1,)}, ruling()),
    ({}, {"first": (1,), "jumped": (2,)}, fouled("jump_shot", 4)),
    (LAST_COLOURS, {"first": (BLUE,), "jumped": (BLACK,)}, fouled("jump_shot", 5)),
    ({}, {"first": (BLUE,), "jumped": (1,)}, fouled("wrong_ball", 5)),  # the larger penalty
    ({}, {"jumped": (1,)}, fouled("no_hit", 4)),
    # Two balls touched at the same instant (3.6).
    ({}, "hit 0 1 & hit 0 2", ruling()),
    ({}, f"hit 0 1 & hit 0 {PINK}", fouled("wrong_ball", 6)),
    (COLOUR, f"hit 0 {PINK} & hit 0 {BLUE}", fouled("wrong_ball", 7)),
    (FREE, f"hit 0 1 & hit 0 {PINK}", ruling(), Call(PINK)),
    # The player plays away from a ball that touches the cue ball without moving it (3.8).
    (RED_TOUCHES, "", ruling(touching=())),  # 3.8 c (i)
    (RED_TOUCHES, f"hit 0 {BLUE}", ruling()),
    (RED_TOUCHES, "cushion 0, hit 0 3", ruling()),
    (RED_TOUCHES, pot(4), scored(1, colour=True)),
    (RED_TOUCHES, "hit 0 3", fouled("push", 4)),  # 3.8 b
    (RED_TOUCHES, pot(BLUE), fouled("wrong_pot", 5, BLUE)),
    (RED_TOUCHES, "pocket 0", fouled("scratch", 4)),
    (BLUE_TOUCHES, "", fouled("no_hit", 4)),  # 3.8 d
    (BLUE_TOUCHES, "hit 0 1", ruling()),
    (BLUE_TOUCHES, f"hit 0 {BLUE}", fouled("push", 5)),  # 3.10 b
    (PINK_TOUCHES, "", ruling()),
    (PINK_TOUCHES, "", ruling(), Call(PINK)),  # 3.8 c (ii)
    (PINK_TOUCHES, f"hit 0 {BLUE}", ruling(), Call(BLUE)),  # 3.8 c (iii)
    (PINK_TOUCHES, "", fouled("no_hit", 5), Call(BLUE)),
    (PINK_TOUCHES, f"hit 0 {PINK}", fouled("push", 6)),
    (FREE | {"touching": (GREEN,)}, "", ruling()),
    # The frame ends at the first pot or foul on the last black (3.4 a), or at the target score.
    (LAST_BLACK | {"scores": (50, 40)}, pot(BLACK), won(points=7, continues=True)),
    (LAST_BLACK | {"scores": (40, 46)}, pot(BLACK), won(points=7, continues=True)),
    (LAST_BLACK | {"scores": (30, 46)}, pot(BLACK), won(1, points=7, continues=True)),
    (LAST_BLACK | {"scores": (50, 40)}, "", won(0, "no_hit", penalty=7)),
    (LAST_BLACK | {"scores": (43, 40)}, "", won(1, "no_hit", penalty=7)),
    (
        *(LAST_BLACK | {"scores": (50, 40)}, f"{pot(BLACK)}, pocket 0"),
        won(0, "scratch", penalty=7, spotted=(BLACK,), **BEHIND),
    ),
    (TO_40 | {"scores": (39, 0)}, pot(4), won(points=1, continues=True, colour=True)),
    (TO_40 | {"scores": (0, 36)}, "", won(1, "no_hit", penalty=4)),
    (TO_40 | {"scores": (39, 36)}, "", won(1, "no_hit", penalty=4)),
    (TO_40 | {"scores": (38, 35)}, "", fouled("no_hit", 4)),
    # After a tie the black is spotted (3.4 b).
    (LAST_BLACK | {"scores": (40, 47)}, pot(BLACK), TIED | {"points": 7}),
    (LAST_BLACK | {"scores": (47, 40)}, "", TIED | {"foul": "no_hit", "penalty": 7}),
    (LAST_BLACK | {"scores": (47, 47), "player": 1}, pot(BLACK), won(1, points=7, continues=True)),
    (LAST_BLACK | {"scores": (47, 47), "player": 1}, "", won(0, "no_hit", penalty=7)),
    # With the miss rule, a shot that hits no ball on first is a miss if nobody needs penalty points (3.14).
    (LAST_RED | WITH_MISS, "", fouled("no_hit", 4, **REPLACE)),
    (LAST_RED | WITH_MISS, "pocket 0", fouled("scratch", 4, **REPLACE)),  # a scratch does not hide the miss
    (LAST_RED | WITH_MISS, f"hit 0 {YELLOW}", fouled("wrong_ball", 4, **REPLACE)),
    (LAST_RED | WITH_MISS, f"hit 0 {YELLOW}, pocket {BLUE}", fouled("wrong_ball", 5, BLUE, **REPLACE)),
    (LAST_RED | WITH_MISS, "hit 0 1, pocket 0", fouled("scratch", 4)),
    (LAST_RED | WITH_MISS, f"hit 0 1, pocket {BLUE}", fouled("wrong_pot", 5, BLUE)),
    (RED_TOUCHES | WITH_MISS, "", ruling()),
    (LAST_RED | WITH_MISS | {"scores": (0, 31)}, "", fouled("no_hit", 4, **REPLACE)),  # 35 points are left
    (LAST_RED | WITH_MISS | {"scores": (0, 32)}, "", fouled("no_hit", 4)),
    (LAST_RED | WITH_MISS | {"scores": (35, 0)}, "", fouled("no_hit", 4, **REPLACE)),
    (LAST_RED | WITH_MISS | {"scores": (36, 0)}, "", fouled("no_hit", 4)),
    (LAST_RED | WITH_MISS | {"scores": (36, 0), "misses": 1, "in_sight": True}, "", fouled("no_hit", 4, **REPLACE)),
    (COLOUR | WITH_MISS, f"hit 0 {PINK}", fouled("wrong_ball", 6, **REPLACE), Call(BLUE)),
    (COLOUR | WITH_MISS, f"hit 0 {PINK}", ruling(), Call(PINK)),
    (FREE | WITH_MISS, f"hit 0 {PINK}", fouled("wrong_ball", 6, **REPLACE), Call(BLUE)),
    (FREE | WITH_MISS, f"hit 0 {PINK}", ruling()),
]

EQUAL = {"innings": 3, "target": 10}
BOTH = "hit 0 1, hit 0 2"
CAROM = [
    ({}, "hit 0 2, hit 0 1", POINT | {"cue_balls": (0, 2)}),
    ({}, "hit 0 1", ruling(player=1, cue_balls=(2, 0), object_balls=(0, 1))),
    ({"player": 1, "cue_balls": (2, 0)}, "hit 0 2, hit 1 2", POINT | {"cue_balls": (2, 0), "scores": (0, 1)}),
    ({"break_shot": True}, BOTH, POINT),  # the red ball first
    ({"break_shot": True}, "hit 0 2, hit 0 1", ruling()),
    ({"break_shot": True}, f"cushion 0, {BOTH}", ruling()),  # 23: direct
    ({}, "hit 0 2, hit 0 1, off 1", ruling("driven_off", spotted=(1,))),  # 28
    ({"scores": (8, 9), "target": 10}, BOTH, POINT),
    ({"scores": (9, 9), "target": 10}, BOTH, won(points=1, continues=True)),
    # A ball that touches the cue ball must not be played at directly (27).
    ({"touching": (1,)}, BOTH, ruling("push")),
    ({"touching": (1,)}, f"cushion 0, {BOTH}", POINT),
    ({"touching": (1,)}, "hit 0 2, hit 0 1", POINT),
    # A limit of innings gives all players the same number of them (29).
    (EQUAL | {"scores": (9, 5)}, BOTH, ruling(points=1, rack="all", player=1, inning=0, break_shot=True)),
    (EQUAL | {"scores": (10, 5), "player": 1}, "hit 0 1", won(inning=1)),
    (EQUAL | {"scores": (10, 9), "player": 1}, BOTH, won(-1, points=1, inning=1)),  # a tie
    (EQUAL | {"scores": (10, 8), "player": 1}, BOTH, POINT | {"player": 1, "inning": 0}),
    (EQUAL | {"scores": (5, 9), "player": 1}, BOTH, won(1, points=1, inning=1)),
    (EQUAL | {"scores": (5, 6), "player": 1}, "hit 0 1", ruling(player=0, inning=1)),
    (EQUAL | {"scores": (5, 6), "player": 1, "inning": 2}, "hit 0 1", won(1, inning=3)),  # the limit
    (EQUAL | {"scores": (5, 6), "inning": 2}, "hit 0 1", ruling(player=1, inning=2)),
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
    "one_pocket": [({"target": 8} | fields, *case) for fields, *case in ONE_POCKET],
    "bank_pool": [({"target": 8} | fields, *case) for fields, *case in BANK_POOL],
    "blackball": BLACKBALL,
    "snooker": SNOOKER,
    "carom": CAROM,
    "three_cushion": THREE_CUSHION,
}


@pytest.mark.parametrize(("rules", "case"), [(rules, case) for rules in CASES for case in CASES[rules]])
def test_a_shot(rules, case):
    fields, shot, expected, *call = case
    _, found = judge(rules, state(rules, **fields), shot, *call)
    assert {name: found[name] for name in expected} == expected
