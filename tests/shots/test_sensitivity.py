"""The derivative of the final positions agrees with finite differences of the high-precision simulator."""

import dataclasses
from typing import Any

import numpy as np
import pytest

from billiards_env.scene import Balls, Physics, Scene, layouts
from billiards_env.scene.table import Table
from billiards_env.shots.gradients import UNIT_ROUNDOFF
from billiards_env.shots.simulation import simulate
from tests.helpers.derivatives import aimed, differences
from tests.helpers.outlines import MARBLES
from tests.helpers.shots import real

OBSTACLE = Scene(Balls((0.03, 0.03, 0.04), (0.17, 0.3, float("inf"))), Table(2.0, 1.0), Physics(e_ball=0.9))
ROLLING = Scene(Balls.uniform(3), Table(2.0, 1.0), Physics(motion="rolling", cushion="restitution"))
FALLING: dict[str, Any] = {"e_cushion": 0.93, "e_cushion_loss": 0.1, "e_cushion_onset": 0.2, "e_cushion_floor": 0.6}


@pytest.mark.parametrize(
    ("scene", "max_time"),
    [
        (Scene.named("pool", 1), None),
        (Scene.named("carom", 2), None),
        (Scene.named("pool", 4), None),
        (Scene.named("ideal", 2), 4.0),
        (OBSTACLE, None),
        (ROLLING, None),
        (real("pool", 4), None),
        (real("carom", 2, **FALLING), None),
        (real("carom", 2, mu_ball=0.05, mu_cushion=0.5), None),
        (dataclasses.replace(Scene.named("carom", 2), physics=Physics(**FALLING)), None),
        (dataclasses.replace(MARBLES, balls=Balls((0.022, 0.03, 0.026), (0.05, 0.3, 0.1), shape="sphere")), None),
    ],
    ids=[
        "pool",
        "carom",
        "pool-of-five",
        "ideal",
        "obstacle",
        "rolling",
        "real-pool",
        "stronge",
        "grip",
        "falling",
        "marbles",
    ],
)
@pytest.mark.parametrize("seed", [3, 4])
def test_the_sensitivity_is_the_derivative_of_the_final_positions(scene, max_time, seed):
    places, velocities = aimed(scene, seed)
    shot = simulate(scene, places, velocities, record=True, max_time=max_time)
    assert shot.n_events > 3
    found = shot.sensitivity()
    expected, base = differences(scene, places.tolist(), velocities.tolist(), max_time)
    jacobian = found.jacobian.copy()
    jacobian[:, :, ~velocities.any(axis=1), 2:] = 0.0
    jacobian[..., 4:] = 0.0
    assert found.smooth
    np.testing.assert_allclose(jacobian, expected, rtol=0, atol=1e-11 * np.abs(expected).max())
    error = np.abs(shot.positions - np.array([[float(x) for x in place] for place in base])).max()
    assert error < 10 * UNIT_ROUNDOFF * found.condition


def test_the_sensitivity_to_the_spin_of_the_cue_ball():
    scene = real("pool", 2)
    places, velocities = aimed(scene, 3)
    spins = np.zeros((3, 3))
    spins[0] = 2.0, -3.0, 40.0
    shot = simulate(scene, places, velocities, spins=spins, record=True)
    assert shot.first_hit == 1
    jacobian = shot.sensitivity().jacobian.copy()
    jacobian[:, :, 1:, 2:] = 0.0
    expected, _ = differences(scene, places.tolist(), velocities.tolist(), None, spins.tolist())
    assert np.abs(expected[:2, :, 0, 4:]).min() > 0.0
    np.testing.assert_allclose(jacobian, expected, rtol=0, atol=1e-11 * np.abs(expected).max())


def test_the_sensitivity_after_a_mathavan_cushion_is_that_of_small_steps():
    scene = Scene.named("snooker", 2)
    places, velocities = np.array([[0.3, 0.1], [1.2, 0.5], [-1.2, 0.5]]), np.array([[0.2, 2.0], [0.0, 0.0], [0.0, 0.0]])
    found = simulate(scene, places, velocities, record=True).sensitivity().jacobian[0, :, 0]
    step = 1e-3
    for k in range(4):
        moved = [np.concatenate((places[0], velocities[0])) for _ in range(2)]
        moved[0][k] += step
        moved[1][k] -= step
        ends = [simulate(scene, [m[:2], *places[1:]], m[2:]).positions[0] for m in moved]
        assert found[:, k] == pytest.approx((ends[0] - ends[1]) / (2 * step), abs=2e-3)


def test_each_collision_multiplies_the_condition():
    scene = Scene.named("ideal", 15)
    rng = np.random.default_rng(0)
    shot = simulate(scene, layouts.draw("random", scene, rng), rng.normal(0.0, 1.0, (16, 2)), record=True, max_time=4.0)
    early, late = shot.sensitivities([1.0, 4.0])
    assert early.condition > 10.0
    assert late.condition > 1e3 * early.condition


def test_the_sensitivity_before_the_first_event_is_that_of_free_motion():
    scene = Scene.named("ideal")
    shot = simulate(scene, [[-1.0, 0.0], [0.0, 0.5]], [0.5, 0.25], record=True, max_time=1.0)
    jacobian = shot.sensitivity(0.5).jacobian
    np.testing.assert_array_equal(jacobian[0, :, 0], [[1, 0, 0.5, 0, 0, 0, 0], [0, 1, 0, 0.5, 0, 0, 0]])
    np.testing.assert_array_equal(jacobian[0, :, 1], np.zeros((2, 7)))


def test_a_simultaneous_impact_of_three_balls_is_not_smooth():
    scene = Scene.named("ideal", 2)
    places = [[-0.5, 0.0], [0.0, 0.02857500001], [0.0, -0.02857500001]]
    assert not simulate(scene, places, [1.0, 0.0], record=True, max_time=1.0).sensitivity().smooth


def test_a_sensitivity_needs_a_record_and_ascending_finite_times():
    scene = Scene.named("ideal")
    shot = simulate(scene, [[-1.0, 0.0], [0.0, 0.5]], [0.5, 0.25])
    with pytest.raises(ValueError, match="record=True"):
        shot.sensitivity()
    recorded = simulate(scene, [[-1.0, 0.0], [0.0, 0.5]], [0.5, 0.25], record=True)
    with pytest.raises(ValueError, match="ascending"):
        next(recorded.sensitivities([1.0, 0.5]))
    with pytest.raises(ValueError, match="finite"):
        recorded.sensitivity(float("nan"))
