"""Indirect pots by geometry: combinations, caroms and kicks that the engine confirms."""

import numpy as np
import pytest

from billiards_env import Scene, simulate
from billiards_env.engine.strikes import strike_with
from billiards_env.games import custom_opening
from billiards_env.games.game_state import is_in, on_table
from billiards_env.pots.finder import DX, DY, SPEED
from billiards_env.pots.indirect import find_indirect
from billiards_env.shots.tables import Tables
from tests.helpers.games import setup


def nine_ball(**balls):
    """Returns a table of nine ball with the cue ball and some balls in given places, and the others not on it."""
    places = np.array([[0.0, 0.0], *([-1.15 + 0.08 * k, -0.55] for k in range(9))])
    for name, place in balls.items():
        places[int(name[1:])] = place
    game, lying = setup("nine_ball"), [0, 9, *(int(name[1:]) for name in balls if name != "b0")]
    start = custom_opening(game, places, {"on_table": sorted(set(lying))})
    in_play, legal = is_in(on_table(start.state), 10), np.isin(range(10), game.legal(start.state))
    return Tables(game.scene, start.positions[None], in_play[None], legal[None], 6.0)


COMBINATIONS = [
    ({"b0": (0.2, 0.0), "b1": (0.6, 0.1), "b9": (1.0, 0.4)}, (9, 3)),  # ball 1 hits ball 9
    ({"b0": (0.2, -0.1), "b1": (0.7, 0.05), "b9": (1.1, -0.45)}, (9, 2)),  # off ball 1 to ball 9
    ({"b0": (0.0, 0.44), "b1": (0.5, 0.448), "b9": (1.0, 0.4)}, (1, 3)),  # ball 1 off ball 9
]


@pytest.mark.parametrize(("balls", "target"), COMBINATIONS)
def test_combinations_and_caroms_are_found(balls, target):
    table = nine_ball(**balls)
    ways = find_indirect(table, np.arange(1, 10))
    assert target in [tuple(row) for row in ways.target.tolist()]
    _check_all(table, ways)


def test_kicks_reach_a_ball_behind_another_one():
    table = nine_ball(b0=(-0.7, 0.0), b1=(0.2, 0.0), b9=(-0.25, 0.0))
    ways = find_indirect(table, np.arange(1, 10))
    assert (ways.target[:, 0] < 0).sum() >= 2  # off both long cushions
    _check_all(table, ways)


def test_a_cue_drives_a_ball_that_it_touches():
    """Two of these ways fail without the cue, where the first impact is an ordinary one."""
    touching = np.array([0.524, 0.114]) + 0.05715 * np.array([np.cos(3.0443), np.sin(3.0443)])
    table = nine_ball(b0=touching, b1=(0.524, 0.114), b9=(-0.319, 0.281))
    ways = find_indirect(table, np.arange(1, 10))
    assert (1, 4) in [tuple(row) for row in ways.target.tolist()]
    _check_all(table, ways)


def test_a_scene_with_flights_is_refused():
    table = nine_ball(b0=(-0.7, 0.0), b1=(0.2, 0.0))._replace(scene=Scene.named("jump_pool", 9))
    with pytest.raises(ValueError, match=r"physics\.flight = True with find_indirect: expected False or find_pots"):
        find_indirect(table, np.arange(1, 10))


def _check_all(table, ways):
    """Asserts that every shot pots its ball, or touches the legal ball."""
    pockets = np.array([(pocket.x, pocket.y) for pocket in table.scene.table.pockets])
    assert (ways.shots[..., SPEED] > 0).any(axis=1).all()
    for (ball, pocket), shots in zip(ways.target.tolist(), ways.shots, strict=True):
        velocities = shots[:, SPEED, None] * shots[:, [DX, DY]]
        for velocity in velocities[shots[:, SPEED] > 0]:
            shot = simulate(table.scene, table.positions[0], strike_with(velocity), in_play=table.in_play[0])
            if ball < 0:
                assert shot.cushions_before_hit[1] >= 0
            else:
                np.testing.assert_array_equal(shot.positions[ball], pockets[pocket])
