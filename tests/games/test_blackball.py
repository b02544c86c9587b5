"""Blackball, case by case. Numbers are those of the WPA Blackball Rules (2005)."""

from typing import Any

import numpy as np
import pytest

from billiards_env.games import Setup, Stroke, custom_opening, opening, play, to_dict
from billiards_env.scene import Scene
from tests.helpers.games import in_a_row, judge, ruling, setup, state

BEHIND: dict[str, Any] = {"in_hand": "behind"}
BREAK, FREE, REDS = {"break_shot": True}, {"free_ball": True}, {"solids": 0}
ON_BLACK, ALL = {"solids": 0, "on_table": (0, 8, 9, 10)}, set(range(1, 16))
FREE_REDS, FREE_BLACK = {**FREE, **REDS}, {**FREE, **ON_BLACK}

LEGAL = [
    ({}, 0, ALL - {8}),
    (BREAK, 0, ALL),
    (REDS, 0, set(range(1, 8))),
    (REDS, 1, set(range(9, 16))),
    (ON_BLACK, 0, {8}),
    (FREE, 0, ALL),  # 6b
    (FREE_REDS, 0, ALL),
    (FREE_REDS, 1, set(range(9, 16))),
]


@pytest.mark.parametrize(("fields", "player", "legal"), LEGAL)
def test_legal_balls(fields, player, legal):
    assert set(setup("blackball").legal(state("blackball", **fields), player)) == legal


VERDICTS = [
    # 4b (simplified), 4d (simplified), 4e
    (BREAK, "hit 0 1, cushion 1, cushion 2", ruling()),
    (BREAK, "hit 0 8, pocket 9", ruling(continues=True)),
    (BREAK, "hit 0 1, pocket 3, pocket 4", ruling(continues=True)),
    (BREAK, "hit 0 1, cushion 1", ruling("illegal_break")),
    (BREAK, "hit 0 1", ruling("no_cushion")),
    (BREAK, "", ruling("no_hit")),
    (BREAK, "hit 0 1, pocket 2, pocket 0", ruling("scratch", **BEHIND)),
    (BREAK, "hit 0 1, pocket 8", ruling(continues=True, spotted=(8,))),
    (BREAK, "hit 0 1, pocket 8, pocket 0", ruling(continues=True, spotted=(8,), **BEHIND)),
    # Balls of one group decide the groups; of both, they do not.
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
    (REDS, "cushion 0", ruling("no_hit", solids=0)),
    (REDS, "hit 0 3, pocket 3, pocket 0", ruling("scratch", solids=0, **BEHIND)),
    (ON_BLACK, "hit 0 9, cushion 9", ruling("wrong_ball", solids=0)),
    # Balls of the other group alone are a foul; together with balls of the own group they are not.
    (REDS, "hit 0 3, pocket 9", ruling("wrong_pot", solids=0)),
    (REDS, "hit 0 3, pocket 9, pocket 3", ruling(continues=True, solids=0)),
    (ON_BLACK, "hit 0 8, pocket 9", ruling("wrong_pot", solids=0)),
    # A free shot may touch and pot any ball (6b), and the visit follows (6a). It does not decide the groups (4f).
    (FREE, "hit 0 8, pocket 3", ruling(continues=True)),
    (FREE, "hit 0 3, pocket 9", ruling(continues=True)),
    (FREE_REDS, "hit 0 9, pocket 9", ruling(continues=True, solids=0)),
    (FREE_REDS, "hit 0 9, cushion 9", ruling(continues=True, solids=0)),
    (FREE_REDS, "hit 0 9", ruling("no_cushion", solids=0)),
    (FREE_REDS, "hit 0 9, pocket 9, pocket 0", ruling("scratch", solids=0, **BEHIND)),
    (FREE_BLACK, "hit 0 9, cushion 9", ruling(continues=True, solids=0)),
]


@pytest.mark.parametrize(("fields", "log", "verdict"), VERDICTS)
def test_verdicts(fields, log, verdict):
    assert judge("blackball", state("blackball", **fields), log)[1] == verdict


ENDS = [
    (ON_BLACK, "hit 0 8, pocket 8", 0),
    ({**ON_BLACK, "player": 1}, "hit 0 9, pocket 8", 0),  # before the last yellow ball
    (ON_BLACK, "hit 0 8, pocket 8, pocket 9", 0),
    (ON_BLACK, "hit 0 8, pocket 8, pocket 0", 1),
    (ON_BLACK, "hit 0 9, pocket 8", 1),  # a wrong ball first
    (FREE_BLACK, "hit 0 9, hit 9 8, pocket 8", 0),
    (REDS, "hit 0 3, pocket 8", 1),  # 7b
    (FREE_REDS, "hit 0 8, pocket 8", 1),
    ({}, "hit 0 3, pocket 8", 1),
    ({"solids": 0, "on_table": (0, 1, 8, 9)}, "hit 0 1, pocket 1, pocket 8", 1),  # with the last ball of the group
]


@pytest.mark.parametrize(("fields", "log", "winner"), ENDS)
def test_the_end_of_a_frame(fields, log, winner):
    verdict = judge("blackball", state("blackball", **fields), log)[1]
    assert (verdict.over, verdict.winner) == (True, winner)


def test_a_foul_gives_one_free_shot_and_then_the_visit():
    """The second player fouls, the first one misses in the free shot and in the visit."""
    settings = setup("blackball")
    game = custom_opening(settings, in_a_row(16, {0: (0.0, 0.3), 9: (0.5, 0.3)}), {"player": 1, "solids": 0})
    turns = []
    for velocity in ((-0.1, 0.0), (2.0, 0.0), (-0.1, 0.0)):
        game = play(settings, game, Stroke(velocity)).game
        turns.append((int(game.state.player), bool(game.state.free_ball)))
    assert turns == [(0, True), (0, False), (1, True)]


def test_a_frame_begins_on_the_usual_table_with_the_black_ball_in_the_middle():
    settings = Setup("blackball", Scene.named("uk_pool"))
    game, rows = opening(settings, np.random.default_rng(0)), to_dict(opening(settings, np.random.default_rng(0)).state)
    assert (rows["break_shot"], rows["in_hand"]) == (True, "behind")
    assert abs(game.positions[8, 1]) < 1e-3
