"""PIC has the same bits with both queues."""

from __future__ import annotations

import numpy as np
import pytest

from billiards_env import Scene
from billiards_env.engine import modes, pic
from billiards_env.scene import Balls, Physics, Table
from reference.stress import draw, families
from tests.helpers.engine_runs import run


def crowded(n, seed, radii=(0.03,), motion="ideal", share=0.3, frozen=False):
    """One shot of n balls, all moving, on a lattice that fills a `share` of the table."""
    rng = np.random.default_rng(seed)
    radius = rng.choice(radii, n)
    pitch = 2 * max(radii) if frozen else max(radii) * np.sqrt(np.pi / share)
    side = int(np.ceil(np.sqrt(n)))
    places = pitch * (np.stack(np.divmod(np.arange(n), side), axis=1) - (side - 1) / 2)
    elastic = {"e_ball": 1.0, "e_cushion": 1.0, "max_time": 1.0} if motion == "ideal" else {}
    scene = Scene(
        Balls(tuple(radius.tolist()), (0.2,) * n),
        Table(pitch * side, pitch * side),
        Physics(motion=motion, cushion="restitution", **elastic),
    )
    return scene, places[None], rng.normal(size=(1, n, 2)), None


def check(shots, **how):
    for many, few in zip(run(pic.run_shots_of_many, shots, **how), run(pic.run_shots, shots, **how), strict=True):
        assert np.array_equal(many, few)


@pytest.mark.parametrize("name", [name for name in families.FAMILIES if name != "wild"])
def test_few_balls_are_the_same_bit_for_bit(name):
    check(families.FAMILIES[name](np.random.default_rng(11), 20 if "15-ball" in name else 200))
    check(families.FAMILIES[name](np.random.default_rng(12), 1), record=True)


@pytest.mark.parametrize("seed", range(30))
def test_wild_shots_are_the_same_bit_for_bit(seed):
    shots = families.FAMILIES["wild"](np.random.default_rng([13, seed]), 8)
    if shots is not None:
        check(shots, record=True)


@pytest.mark.parametrize("motion", ["ideal", "rolling", "sliding"])
@pytest.mark.parametrize("radii", [(0.03,), (0.01, 0.03), (0.002, 0.05)])
def test_many_balls_are_the_same_bit_for_bit(motion, radii):
    for seed, n in enumerate((2, 65, 150)):
        check(crowded(n, seed, radii, motion), record=True)


def test_a_frozen_block_is_the_same_bit_for_bit():
    for seed in range(3):
        check(crowded(36, seed, frozen=True, motion="sliding"), record=True)


@pytest.mark.parametrize("how", [{"max_time": 0.0}, {"max_time": 0.3}, {"max_events": 0}, {"max_events": 9}])
def test_shots_that_are_cut_off_are_the_same_bit_for_bit(how):
    check(crowded(80, 5), **how)


def test_balls_that_lie_still_and_touch_are_the_same_bit_for_bit():
    for seed in range(20):
        rng = np.random.default_rng([14, seed])
        scene = draw.wild_scene(rng)
        places = draw.layouts(scene, rng, 5, frozen=0.9)
        if places is not None:
            check((scene, places, np.zeros_like(places), None))


def test_the_number_of_balls_selects_the_queue():
    assert modes.engine_of("pic", modes.MANY_BALLS - 1) is pic.run_shots
    assert modes.engine_of("pic", modes.MANY_BALLS) is pic.run_shots_of_many
