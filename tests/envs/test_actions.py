"""Actions: velocities and strikes, with errors and the fixed timestep."""

import gymnasium as gym
import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from billiards_env import Scene, simulate, strike
from billiards_env.engine import Engine
from billiards_env.envs.actions import cos_sin, cue_strike, perturb
from billiards_env.physics.strike import cue_numbers, speed_gain
from tests.helpers.environments import STRIKE

POOL = Scene.named("pool")
PLACES = [[-0.5, 0.1], [0.2, 0.15], [0.6, -0.3]]


def test_an_action_is_a_fraction_of_max_speed_and_has_length_1_at_most():
    assert cue_strike(np.array([0.5, -0.25], np.float32), POOL, 4.0).velocity.tolist() == [2.0, -1.0]
    assert cue_strike([0, 1], POOL, 3.0).velocity.tolist() == [0.0, 3.0]
    for action in ([1, 1], [3.0, -4.0], [1e300, 1e300], [1e-320, 5.0]):
        velocity = cue_strike(action, POOL, 2.0).velocity
        assert np.linalg.norm(velocity) == pytest.approx(2.0, rel=1e-15)
        np.testing.assert_allclose(velocity / velocity[1], np.divide(action, action[1]), rtol=1e-15)


@given(st.floats(-5.0, 5.0))
def test_cosine_and_sine_have_errors_of_the_last_bits_only(turns):
    c, s = cos_sin(turns)
    assert abs(c - float(mpmath.cospi(turns))) <= 2.3e-16
    assert abs(s - float(mpmath.sinpi(turns))) <= 2.3e-16
    assert cos_sin(-turns) == (c, -s)


def test_perturb():
    aimed = np.array([[0.3, -0.4], [0.0, 0.0], [30.0, 40.0], [0.1, 0.0], [1.0, 0.0], [1e300, 0.0]])
    same = perturb(aimed, np.zeros((6, 2)))
    np.testing.assert_array_equal(same[[0, 1, 3, 4]], aimed[[0, 1, 3, 4]])
    np.testing.assert_allclose(same[[2, 5]], [[0.6, 0.8], [1.0, 0.0]], rtol=1e-15)
    speeds = np.hypot(*perturb(aimed, np.full((6, 2), (0.3, 0.25))).T)
    np.testing.assert_allclose(speeds, [0.75, 0.0, 1.0, 0.35, 1.0, 1.0], rtol=1e-15)
    slower = np.hypot(*perturb(aimed, np.full((6, 2), (-0.3, -0.25))).T)
    np.testing.assert_allclose(slower, [0.25, 0.0, 0.75, 0.0, 0.75, 0.75], rtol=1e-15)
    np.testing.assert_allclose(perturb([0.5, 0.0], [0.5, 0.0]), [0.0, 0.5], atol=1e-16)
    with pytest.raises(ValueError, match=r"action has shape \(3,\): expected \(2,\)"):
        perturb([1.0, 0.0, 0.0], [0.0, 0.0])


def test_perturb_clips_first_and_adds_errors_to_the_cue():
    errors = [0.0, 0.1, -0.1, 0.2, 0.3]
    expected = perturb([0.5, 0.0, 1.0, -1.0, 0.0], errors)
    np.testing.assert_allclose(expected, [0.6, 0.0, 0.9, -0.8, 0.3], rtol=1e-14)
    assert perturb([0.5, 0.0, 7.0, -1.5, -1.0], errors).tolist() == expected.tolist()


def test_perturb_leaves_actions_that_are_not_finite():
    found = perturb([[np.nan, 0.5], [0.5, np.inf], [0.5, 0.0]], np.full((3, 2), 0.25))
    assert np.isfinite(found).all(axis=1).tolist() == [False, False, True]


def test_an_action_of_five_numbers_is_a_strike():
    action = [0.3, -0.4, 0.5, -0.25, 0.5]
    speed = 0.5 * 4.0 / speed_gain(cue_numbers(POOL), 0.0)
    expected = strike(POOL, speed, np.arctan2(-0.4, 0.3), 0.25, -0.125, np.pi / 4)
    found = cue_strike(action, POOL, 4.0)
    np.testing.assert_allclose(found.velocity, expected.velocity, rtol=1e-14)
    np.testing.assert_allclose(found.spin, expected.spin, rtol=1e-14)
    assert not found.miscue
    assert cue_strike([0.3, 0.4, 0.8, 0.8, 0.0], POOL, 4.0).miscue
    assert cue_strike([0.3, 0.4, 9.0, 0.0, -5.0], POOL, 4.0).spin.tolist() == (
        cue_strike([0.3, 0.4, 1.0, 0.0, 0.0], POOL, 4.0).spin.tolist()
    )


@given(st.tuples(st.floats(-1, 1), st.floats(-1, 1)), st.floats(-1, 0))
def test_a_level_central_strike_is_the_velocity_bit_for_bit(velocity, elevation):
    found = cue_strike([*velocity, 0.0, 0.0, elevation], POOL, 4.0)
    assert found.velocity.tolist() == cue_strike(velocity, POOL, 4.0).velocity.tolist()
    assert not found.spin.any()


@pytest.mark.parametrize("options", [{}, {"mode": "pit", "dt": 1 / 240}])
def test_the_environment_plays_the_strike(options):
    env = gym.make("Billiards-v0", **{**STRIKE, **options})
    assert env.action_space == gym.spaces.Box(-1, 1, (5,), np.float32)
    env.reset(seed=0, options={"positions": PLACES})
    action = [0.4, 0.03, 0.5, -0.6, 0.05]
    *_, info = env.step(action)
    scene = Scene.named("pool", 2)
    expected = simulate(scene, PLACES, cue_strike(action, scene, 4.0), engine=Engine(**options))
    assert env.get_wrapper_attr("positions").tolist() == expected.positions.tolist()
    assert not info["miscue"]
    *_, info = env.step([0.4, 0.03, 0.9, -0.6, 0.05])
    assert info["miscue"]
