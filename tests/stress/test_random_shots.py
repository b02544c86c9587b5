"""Random shots in all scenes end and pass all checks at every event."""

import dataclasses
from typing import Any, cast

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.reference.stress import checks, draw, families
from billiards_env import simulate_batch
from billiards_env.engine import Engine
from tests.helpers.engine_runs import ORDINARY

FLIGHTS = [name for name in families.FAMILIES if name.startswith(("jump", "rain", "stacks", "wedges"))]


@pytest.mark.parametrize("name", [*ORDINARY, *FLIGHTS])
def test_ordinary_shots_pass_all_checks(name):
    result = families.check_family(name, seed=1, shots=20)
    assert result["bad"] == []
    assert result["overlap"] <= checks.DEPTH
    assert result["outside"] <= checks.DEPTH
    assert result["rise"] <= checks.ENERGY_RISE


@pytest.mark.parametrize("name", FLIGHTS)
def test_flights_of_balls_of_different_masses_pass_all_checks(name):
    rng, family = np.random.default_rng(1), cast(Any, families.FAMILIES[name])
    scene, places, velocities, spins = family(rng, 20)
    for spread in (0.3, 1.5):
        mass = tuple((0.17 * 10.0 ** rng.uniform(-spread, spread, scene.n_balls)).tolist())
        heavy = dataclasses.replace(scene, balls=dataclasses.replace(scene.balls, mass=mass))
        result = checks.check_shots(heavy, places, velocities, spins)
        assert not result.bad(False).any(), result.findings


@settings(max_examples=60)
@given(st.integers(0, 2**32 - 1), st.floats(0.0, 1.0))
def test_flights_of_balls_of_any_sizes_pass_all_checks(seed, spread):
    """The energy never rises, the impacts exchange momentum, and no balls overlap."""
    rng, family = np.random.default_rng(seed), cast(Any, families.FAMILIES["rain of 6 balls of several sizes"])
    scene, *_ = family(rng, 1)
    radius = 0.022 * 2.0 ** (spread * rng.random(6))
    mass = 0.17 * 10.0 ** rng.uniform(-spread, spread, 6)
    balls = dataclasses.replace(scene.balls, radius=tuple(radius.tolist()), mass=tuple(mass.tolist()))
    shots: Any = families.rain(dataclasses.replace(scene, balls=balls))(rng, 4)
    result = checks.check_shots(*shots)
    assert not result.bad(False).any(), result.findings


def test_flights_of_pit_come_to_rest():
    """Rounding once let a small ball at a cushion lift a larger ball next to it in each timestep, without end."""
    family: Any = families.FAMILIES["rain of 6 balls of several sizes"]
    scene, places, velocities, spins = family(np.random.default_rng(3), 300)
    batch = simulate_batch(scene, places, velocities, spins=spins, engine=Engine("pit", 1 / 60))
    assert set(batch.status) == {"rest"}


@pytest.mark.parametrize("seed", range(40))
def test_wild_shots_pass_all_checks(seed):
    assert families.check_family("wild", seed, shots=5)["bad"] == []


@pytest.mark.slow
@pytest.mark.parametrize("name", list(families.FAMILIES))
def test_many_shots_pass_all_checks(name):
    for seed in range(10):
        assert families.check_family(name, seed, shots=200)["bad"] == []


@st.composite
def extreme_shots(draw_from):
    """Draws a wild shot whose cue ball has an extreme speed and any direction; None if the scene has no room."""
    seed = draw_from(st.integers(0, 2**32 - 1))
    rng = np.random.default_rng(seed)
    scene = draw.wild_scene(rng)
    shots = draw.wild_shots(scene, rng, 1)
    if shots is None:
        return None
    places, velocities, spins = shots
    speed = draw_from(st.sampled_from([1e-300, 1e-12, 1e-6, 0.1, 1.0, 10.0]))
    angle = draw_from(st.floats(0, 2 * np.pi))
    velocities[0, 0] = speed * np.cos(angle), speed * np.sin(angle)
    return scene, places, velocities, spins


def check_extreme(shots) -> None:
    if shots is None:
        return
    scene, places, velocities, spins = shots
    result = checks.check_shots(scene, places, velocities, spins)
    assert not result.bad(scene.physics.motion == "ideal").any(), result.findings


@settings(max_examples=100)
@given(extreme_shots())
def test_extreme_shots_pass_all_checks(shots):
    check_extreme(shots)


@pytest.mark.slow
@settings(max_examples=5000)
@given(extreme_shots())
def test_many_extreme_shots_pass_all_checks(shots):
    check_extreme(shots)
