"""Actions: velocities and strikes, in single and vector environments, with noise, frames and the fixed timestep."""

import gymnasium as gym
import mpmath
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from hypothesis import given
from hypothesis import strategies as st

from billiards_env import Scene, simulate, strike
from billiards_env.envs import BilliardsEnv, BilliardsVectorEnv
from billiards_env.envs.actions import cos_sin, cue_strike, perturb
from billiards_env.envs.wrappers import ActionFrame, ExecutionNoise, VectorActionFrame, VectorExecutionNoise
from billiards_env.physics.strike import cue_numbers, speed_gain

POOL = Scene.named("pool")
STRIKE = {"scene": "pool", "n_object_balls": 2, "action": "strike", "max_shots": 3, "scratch_penalty": 0.3}
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
    expected = simulate(scene, PLACES, cue_strike(action, scene, 4.0), **options)
    assert env.get_wrapper_attr("positions").tolist() == expected.positions.tolist()
    assert not info["miscue"]
    *_, info = env.step([0.4, 0.03, 0.9, -0.6, 0.05])
    assert info["miscue"]


def test_strikes_with_zeros_are_the_shots_of_the_default_action():
    envs = [gym.make("Billiards-v0", **{**STRIKE, "action": action}) for action in ("velocity", "strike")]
    for env in envs:
        env.reset(seed=5)
    for shot in range(3):
        velocity = np.array([0.5, 0.1 * shot], np.float32)
        results = [envs[0].step(velocity), envs[1].step([*velocity, 0, 0, 0])]
        assert results[0][0].tolist() == results[1][0].tolist()
        assert results[0][1] == results[1][1]
        assert "miscue" not in results[0][4]


def test_the_vector_environment_plays_the_same_strikes():
    rng = np.random.default_rng(0)
    vector = BilliardsVectorEnv(16, **STRIKE)
    single = gym.vector.SyncVectorEnv([lambda: BilliardsEnv(**STRIKE)] * 16, autoreset_mode="SameStep")
    np.testing.assert_array_equal(vector.reset(seed=3)[0], single.reset(seed=3)[0])
    slipped = []
    for _ in range(4):
        actions = rng.uniform(-1, 1, (16, 5)).astype(np.float32)
        found, expected = vector.step(actions), single.step(actions)
        for a, b in zip(found[:4], expected[:4], strict=True):
            np.testing.assert_array_equal(a, b)
        slipped += [*found[4].get("miscue", [])]
        for key in ("miscue", "potted", "shot_time"):
            np.testing.assert_array_equal(found[4].get(key), expected[4].get(key))
    assert any(slipped)


def test_the_checker_accepts_strikes():
    check_env(gym.make("Billiards-v0", **STRIKE).unwrapped, skip_render_check=True)


def test_noise_is_added_to_all_parameters_of_the_strike():
    env = ExecutionNoise(BilliardsEnv(**STRIKE), 5.0, 0.5, 0.002, 3.0)
    shots = []
    env.unwrapped.step = lambda action: (shots.append(action), 0.0, False, False, {})
    env.reset(seed=1)
    for _ in range(2000):
        env.step([0.0, 0.5, 0.1, -0.1, 0.2])
    found = np.array(shots)
    radius = POOL.balls.radius[0]
    assert found[:, 2:].mean(axis=0) == pytest.approx([0.1, -0.1, 0.2], abs=0.01)
    assert found[:, 2:].std(axis=0) == pytest.approx([0.002 / (0.5 * radius)] * 2 + [3.0 / 90.0], rel=0.06)
    assert np.degrees(np.arctan2(-found[:, 0], found[:, 1])).std() == pytest.approx(5.0, rel=0.06)


def test_noise_of_strikes_is_the_same_in_the_vector_environment():
    single = ExecutionNoise(BilliardsEnv(**STRIKE))
    vector = VectorExecutionNoise(BilliardsVectorEnv(2, **STRIKE))
    single.reset(seed=4)
    vector.reset(seed=4)
    action = [0.4, 0.1, 0.2, 0.3, 0.1]
    observation, *_ = single.step(action)
    last, *_ = vector.step([action] * 2)
    assert observation.tolist() == last[0].tolist()


def test_a_frame_changes_the_first_two_numbers_of_a_strike():
    options = {"positions": PLACES}
    single = ActionFrame(BilliardsEnv(**STRIKE), "cut")
    vector = VectorActionFrame(BilliardsVectorEnv(2, **STRIKE), "cut")
    single.reset(seed=0, options=options)
    vector.reset(seed=0, options={"positions": [PLACES] * 2})
    action = np.array([0.1, -0.5, 0.2, 0.3, 0.1])
    found = single.action(action)
    assert found[2:].tolist() == action[2:].tolist()
    assert vector.actions([action] * 2)[1].tolist() == found.tolist()
    *_, info = single.step([0.0, -0.5, 0.0, 0.4, 0.0])
    assert info["first_hit"] == 1


def test_wrong_actions_are_refused():
    with pytest.raises(ValueError, match="action = 'spin': expected one of 'velocity', 'strike'"):
        BilliardsEnv(action="spin")
    with pytest.raises(ValueError, match=r"action = 'strike' with physics.motion = 'ideal': expected motion 'sliding'"):
        BilliardsEnv("ideal", "carom", action="strike")
    env = BilliardsEnv(**STRIKE)
    env.reset(seed=0)
    with pytest.raises(ValueError, match=r"action has shape \(2,\): expected \(5,\)"):
        env.step([0.1, 0.2])
    with pytest.raises(ValueError, match="action"):
        env.step([0.1, 0.2, 0.0, np.nan, 0.0])
