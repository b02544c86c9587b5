"""PIC has the same results, bit for bit, with both of its queues and with the queue of `benchmarks.reference.plain`."""

from typing import Any

import numpy as np
import pytest

from benchmarks.reference.stress import families
from billiards_env import Scene
from billiards_env.engine import pic
from billiards_env.engine.compile import MANY_BALLS, PIC, run_shots_of, scene_kernels
from billiards_env.engine.predictions import meeting_bound
from billiards_env.physics.geometry.contact import circle_time
from billiards_env.physics.motion import Path
from billiards_env.scene import Balls, Physics, Table
from tests.helpers.engine_runs import CELL_GRID, ORDINARY, PLAIN, check
from tests.helpers.shots import lattice

UK = "UK pool, 5 object balls"  # the plain engine is not compiled for it


def moving_lattice(n, seed, radii=(0.03,), motion="ideal", share=0.3, frozen=False):
    """Returns one shot of n moving balls on a lattice; the balls cover a `share` of the table, or are in contact."""
    rng = np.random.default_rng(seed)
    radius = rng.choice(radii, n)
    pitch = 2 * max(radii) if frozen else max(radii) * np.sqrt(np.pi / share)
    positions = lattice(n, pitch)
    length = pitch + np.ptp(positions[:, 1])
    elastic: dict[str, Any] = {"e_ball": 1.0, "e_cushion": 1.0, "max_time": 1.0} if motion == "ideal" else {}
    scene = Scene(
        Balls(tuple(radius.tolist()), (0.2,) * n),
        Table(length, length),
        Physics(motion=motion, cushion="restitution", **elastic),
    )
    return scene, positions[None], rng.normal(size=(1, n, 2)), None


@pytest.mark.parametrize("name", ORDINARY)
def test_ordinary_shots_and_their_logs_are_equal(name):
    rng = np.random.default_rng(7)
    engines = [CELL_GRID] if name == UK else [CELL_GRID, PLAIN]
    check(families.FAMILIES[name](rng, 20 if "15-ball" in name else 100), engines)
    for _ in range(5):
        check(families.FAMILIES[name](rng, 1), engines, record=True)


@pytest.mark.parametrize("seed", range(30))
def test_wild_shots_are_equal(seed):
    shots = families.FAMILIES["wild"](np.random.default_rng(seed), 8)
    if shots is not None:
        check(shots, record=True)


@pytest.mark.slow
@pytest.mark.parametrize("name", list(families.FAMILIES))
def test_many_shots_are_equal(name):
    for seed in range(200 if name == "wild" else 20):
        shots = families.FAMILIES[name](np.random.default_rng([1, seed]), 20 if name == "wild" else 100)
        if shots is not None:
            check(shots)


@pytest.mark.parametrize("motion", ["ideal", "rolling", "sliding"])
@pytest.mark.parametrize("radii", [(0.03,), (0.01, 0.03), (0.002, 0.05)])
def test_shots_of_many_balls_are_equal(motion, radii):
    for seed, n in enumerate((2, 65, 150)):
        check(moving_lattice(n, seed, radii, motion), queues=[CELL_GRID], record=True)


def test_shots_of_a_frozen_block_are_equal():
    for seed in range(3):
        check(moving_lattice(36, seed, frozen=True, motion="sliding"), queues=[CELL_GRID], record=True)


def test_shots_of_many_balls_in_the_air_are_equal():
    n, rng = MANY_BALLS, np.random.default_rng(3)
    places = lattice(n, 0.08)
    table = Table(0.08 + np.ptp(places[:, 1]), 0.08 + np.ptp(places[:, 1]))
    scene = Scene(Balls.uniform(n, 0.028575), table, Physics(flight=True, ball_ball="frictional"))
    places = np.column_stack((places, rng.uniform(-0.1, 0.1, n).clip(0.0)))
    velocities = rng.normal(size=(1, n, 3))
    check((scene, places[None], velocities, 40 * velocities), queues=[CELL_GRID], record=True, max_time=0.2)


@pytest.mark.parametrize("limit", [{"max_time": 0.0}, {"max_time": 0.3}, {"max_events": 0}, {"max_events": 9}])
def test_shots_that_reach_a_limit_are_equal(limit):
    check(moving_lattice(80, 5), queues=[CELL_GRID], **limit)
    for name in ("pool, 5 object balls", "15-ball break, tight rack", "ideal gas of 16 disks"):
        check(families.FAMILIES[name](np.random.default_rng(9), 3), record=True, **limit)


@pytest.mark.parametrize(
    ("n", "queue"), [(1, pic.ONE_PAIR), (2, pic.ONE_PAIR), (3, pic.ALL_PAIRS), (159, pic.ALL_PAIRS), (160, CELL_GRID)]
)
def test_the_number_of_balls_selects_the_queue(n, queue):
    scene = Scene(Balls.uniform(n))
    assert run_shots_of(scene, PIC) == (pic.run_shots, pic.PicKernels(scene_kernels(scene), queue))


def test_the_bound_of_a_meeting_is_not_later_and_often_close_to_it():
    rng, reach, shares, far = np.random.default_rng(0), 0.25, [], 0
    for place, velocity, acceleration in rng.normal(size=(300, 3, 2)):
        path, end = Path(*place, *velocity, *(0.2 * acceleration)), 2.0
        if np.hypot(*place) > reach:
            bound, t = meeting_bound(path, reach, end), circle_time(path, reach, end, 0.0)
            assert 0.0 <= bound <= t
            far += bound == np.inf
            shares += [bound / t] if t < np.inf else []
    assert far > 150
    assert len(shares) > 10
    assert np.median(shares) > 0.8
    assert meeting_bound(Path(reach, 0.0, 0.0, 1.0, 0.0, 0.0), reach, 2.0) == 0.0  # balls that touch
    assert meeting_bound(Path(1.0, 0.0, -1.0, 0.0, 0.0, 0.0), reach, np.inf) != np.inf
