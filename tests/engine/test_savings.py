"""The savings of the engine change no bit of a result: `reference.plain` has none of them."""

from __future__ import annotations

import numpy as np
import pytest

from billiards_env.engine import pic
from reference import plain
from reference.stress import draw, families
from tests.helpers.engine_runs import run


def check(shots, **how):
    for fast, slow in zip(run(pic.run_shots, shots, **how), run(plain.run_shots, shots, **how), strict=True):
        assert np.array_equal(fast, slow)


@pytest.mark.parametrize("name", [name for name in families.FAMILIES if name != "wild"])
def test_ordinary_shots_are_the_same_bit_for_bit(name):
    many = 40 if "15-ball" in name else 300
    check(families.FAMILIES[name](np.random.default_rng(7), many))


@pytest.mark.parametrize("name", [name for name in families.FAMILIES if name != "wild"])
def test_logs_are_the_same_bit_for_bit(name):
    rng = np.random.default_rng(8)
    for _ in range(5):
        check(families.FAMILIES[name](rng, 1), record=True)


@pytest.mark.parametrize("seed", range(60))
def test_wild_shots_are_the_same_bit_for_bit(seed):
    shots = families.FAMILIES["wild"](np.random.default_rng(seed), 8)
    if shots is not None:
        check(shots, record=True)


@pytest.mark.parametrize("how", [{"max_time": 0.0}, {"max_time": 0.3}, {"max_events": 0}, {"max_events": 9}])
def test_shots_that_are_cut_off_are_the_same_bit_for_bit(how):
    for name in ("pool, 5 object balls", "15-ball break, tight rack", "ideal gas of 16 disks"):
        check(families.FAMILIES[name](np.random.default_rng(9), 3), record=True, **how)


@pytest.mark.slow
@pytest.mark.parametrize("name", list(families.FAMILIES))
def test_many_shots_are_the_same_bit_for_bit(name):
    for seed in range(200 if name == "wild" else 20):
        shots = families.FAMILIES[name](np.random.default_rng([1, seed]), 20 if name == "wild" else 100)
        if shots is not None:
            check(shots)


def test_balls_that_lie_still_and_touch_are_the_same_bit_for_bit():
    for seed in range(20):
        rng = np.random.default_rng([2, seed])
        scene = draw.wild_scene(rng)
        places = draw.layouts(scene, rng, 5, frozen=0.9)
        if places is not None:
            check((scene, places, np.zeros_like(places), None))
