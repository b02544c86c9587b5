"""The sensitivity of a shot is its derivative by the balls, which `test_gradients.py` compares with 50 digits."""

import numpy as np
import pytest

from billiards_env.scene import Scene, layouts
from billiards_env.shots.gradients import UNIT_ROUNDOFF
from billiards_env.shots.simulation import simulate
from reference.oracle import run
from tests.helpers.derivatives import SCENES, recorded, start_of


@pytest.mark.parametrize("name", [name for name in SCENES if name != "ideal"])
def test_the_sensitivity_is_the_derivative_of_the_final_positions(name):
    scene = SCENES[name]
    start = start_of(scene, 3)
    shot = recorded(scene, start)
    found = shot.sensitivity()
    assert shot.n_events > 3
    assert found.smooth
    jacobian = np.concatenate([shot.jacobian("positions", by) for by in ("positions", "velocities", "spins")], axis=-1)
    np.testing.assert_allclose(found.jacobian, jacobian, rtol=0, atol=1e-12 * np.abs(jacobian).max())
    exact = run(scene, *start).positions
    assert np.abs(shot.positions - np.array(exact, float)).max() < 10 * UNIT_ROUNDOFF * found.condition


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
