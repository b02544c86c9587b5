"""Direct pots: named layouts, and their formulas against the engine."""

import numpy as np
import pytest

from billiards_env import Scene, simulate
from billiards_env.engine.compile import scene_arrays
from billiards_env.physics.laws.cloth import arrival, launch, travel_time
from billiards_env.players.env_player import env_situation
from billiards_env.pots.finder import WALL, find_pots
from billiards_env.scene import Balls, Physics, Table
from billiards_env.shots.tables import Tables
from tests.helpers.layouts import at

POOL = Scene.named("pool")


def pots_of(env):
    return env_situation(env).pots()


def test_the_tolerance_is_the_largest_error_of_the_direction():
    positions = [[0.3, 0.0], [0.97, 0.335]]
    shots = pots_of(at(positions))
    direction, speed, tolerance = shots.direction[0], shots.speed[0], shots.tolerance[0]

    def drops(error):
        c, s = np.cos(error), np.sin(error)
        turned = [c * direction[0] - s * direction[1], s * direction[0] + c * direction[1]]
        return bool(simulate(POOL, positions, 1.3 * speed * np.array(turned)).potted[1])

    assert drops(0.8 * tolerance)
    assert drops(-0.8 * tolerance)
    assert not drops(1.5 * tolerance)
    assert not drops(-1.5 * tolerance)


def test_a_ball_in_the_way_blocks_a_pot():
    straight = [[0.4, -0.235], [0.97, 0.335]]
    assert 3 in pots_of(at(straight)).pocket
    for blocker in ([0.7, 0.065], [0.66, 0.065], [1.1, 0.465], [1.15, 0.475]):  # of the cue ball, of ball 1
        shots = pots_of(at([*straight, blocker]))
        assert not ((shots.ball == 1) & (shots.pocket == 3)).any()
    for clear in ([0.62, 0.075], [1.1, 0.38]):
        shots = pots_of(at([*straight, clear]))
        assert ((shots.ball == 1) & (shots.pocket == 3)).any()


def test_a_pocket_in_the_cue_balls_way_blocks_a_pot():
    # The cue ball's path to ball 1 runs along the cushion, over the mouth of a side pocket.
    positions = [[-0.5, 0.6], [0.5, 0.58]]
    assert not len(pots_of(at(positions)).speed)
    closed = POOL.to_dict()
    closed["table"]["pockets"] = [p for p in closed["table"]["pockets"] if p["x"]]
    assert len(pots_of(at(positions, scene=closed, n_object_balls=None)).speed)


def test_speeds_range_from_the_least_that_pots_to_the_largest_allowed():
    positions = [[-1.1, -0.5], [0.4, 0.2]]
    shots = pots_of(at(positions))
    slowest, direction = shots.speed.min(), shots.direction[np.argmin(shots.speed)]
    assert shots.speed.max() == 4.0
    slower = pots_of(at(positions, max_speed=0.99 * slowest)).speed.min()
    assert simulate(POOL, positions, slower * direction).potted[1]
    assert not simulate(POOL, positions, 0.95 * slower * direction).potted[1]
    assert len(pots_of(at(positions, max_speed=0.99 * slower)).speed) == 0


@pytest.mark.parametrize(("motion", "slip"), [("rolling", 1.0), *(("sliding", s) for s in (1.0, 2.0, 0.3, 0.0, -0.25))])
@pytest.mark.parametrize("distance", [0.01, 0.2, 1.0, 2.0])
def test_the_speeds_of_a_ball_agree_with_the_engine(motion, slip, distance):
    scene = Scene(Balls((0.03,), (0.2,)), Table(1000.0, 1.0), Physics(motion=motion, cushion="restitution"))
    numbers = scene_arrays(scene).numbers

    def run(speed, time=None):
        spins = [[0.0, (1.0 - slip) * speed / 0.03, 0.0]] if motion == "sliding" else None
        return simulate(scene, [[0.0, 0.0]], [speed, 0.0], spins=spins, max_time=time)

    start = launch(numbers, distance, 0.0, slip)
    assert run(start).positions[0, 0] == pytest.approx(distance, rel=1e-12)
    for speed in (0.1, 1.0, 5.0):
        start = launch(numbers, distance, speed, slip)
        low, high = 0.0, 100.0
        for _ in range(100):  # bisection for the time of arrival
            middle = (low + high) / 2
            low, high = (middle, high) if run(start, middle).positions[0, 0] < distance else (low, middle)
        shot = run(start, low)
        assert shot.velocities[0, 0] == pytest.approx(speed, rel=1e-9)
        assert travel_time(numbers, distance, start, slip) == pytest.approx(low, rel=1e-9)
        left, rest = arrival(numbers, distance, start, slip)
        assert left == pytest.approx(speed, rel=1e-12)
        assert rest == pytest.approx(left - 0.03 * shot.spins[0, 1] if motion == "sliding" else 0.0, abs=1e-9)


def test_without_direct_pots_there_are_banks_only():
    places = np.array([[0.6, 0.1], [1.07, 0.435], [-0.5, 0.0]])
    table = Tables(Scene.named("pool", 2), places[None], np.ones((1, 3), bool), np.array([[False, True, True]]), 5.0)
    usual, banks = find_pots(table), find_pots(table, direct=False)
    assert (usual.rows[0, : usual.count[0], WALL] < 0).all()
    assert banks.count[0] > 0
    assert (banks.rows[0, : banks.count[0], WALL] >= 0).all()
