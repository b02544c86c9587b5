"""Action frames and execution noise: their geometry, and their wrappers of single and vector environments."""

import json
import warnings
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from hypothesis import given
from hypothesis import strategies as st

from billiards_env import simulate_batch
from billiards_env.envs.action_frames import (
    BALLS,
    FRAMES,
    ActionTransform,
    aim,
    choose_ball,
    cut,
    sum_to_three,
)
from billiards_env.envs.wrappers import ActionFrame, ExecutionNoise, VectorActionFrame, VectorExecutionNoise
from billiards_env.scene import Scene, layouts

POOL = Scene.named("pool")
REACH = 2 * POOL.balls.radius[0]
FAST = {"max_speed": 4.5, "n_object_balls": 2, "max_shots": 3}  # fast enough for all action frames
NOISE: dict[str, Any] = {"angle_std": 5.0, "speed_std": 0.5}
shares = st.floats(-1.0, 1.0)
frames = pytest.mark.parametrize("frame", FRAMES)


def make(**kwargs):
    return gym.make("Billiards-v0", **{**FAST, **kwargs})


def native(mode, num_envs=5):
    return gym.make_vec("Billiards-v0", num_envs, autoreset_mode=mode, **FAST)


def sync(mode, num_envs=5):
    return SyncVectorEnv([make for _ in range(num_envs)], autoreset_mode=mode)


def random_layouts(count):
    rng = np.random.default_rng(0)
    return np.array([layouts.draw("random", POOL, rng) for _ in range(count)])


# --- geometry ---------------------------------------------------------------------------------------------------------


@given(shares, shares, st.floats(-np.pi, np.pi), st.floats(1.0, 40.0))
def test_a_cut_passes_the_ball_at_the_given_distance(a0, a1, bearing, apart):
    dx, dy = apart * REACH * np.cos(bearing), apart * REACH * np.sin(bearing)
    x, y = cut(a0, a1, dx, dy, REACH, 0.4, 4.0)
    speed = np.hypot(x, y)
    assert speed == pytest.approx(0.4 + 1.8 * (a1 + 1), rel=1e-14)
    assert (x * dy - y * dx) / speed == pytest.approx(a0 * REACH, abs=1e-14)  # positive: the ball is on the left
    assert x * dx + y * dy >= -1e-15


def test_every_cut_hits_and_is_the_sine_of_the_cut_angle():
    positions = random_layouts(500)
    offsets = np.random.default_rng(1).uniform(-1, 1, 500).astype(np.float32)
    largest = np.nextafter(np.float32(1), np.float32(0))
    offsets[:40] = np.tile([largest, -largest, 0, 0.999], 10)
    frame = ActionTransform("cut", POOL, np.array([False, True]), 4.0)
    actions = np.column_stack((offsets, np.ones(500)))
    velocities = frame.velocities(actions, positions, np.zeros((500, 2), bool))
    pocketless = Scene(POOL.balls)
    assert (simulate_batch(pocketless, positions, velocities).first_hit == 1).all()

    frictionless = Scene.named("ideal")  # the object ball leaves along the line of centres
    shots = simulate_batch(frictionless, positions, velocities, max_time=0.7)
    for v, after, offset, cushions in zip(velocities, shots.velocities, offsets, shots.cushions, strict=True):
        if after[1].any() and not cushions.any():
            sine = (v[0] * after[1, 1] - v[1] * after[1, 0]) / np.hypot(*v) / np.hypot(*after[1])
            assert sine == pytest.approx(offset, abs=1e-9)


@given(shares, shares, st.floats(-2.0, 2.0), st.floats(-1.0, 1.0))
def test_mirrored_balls_and_cuts_mirror_bit_for_bit(a0, a1, dx, dy):
    def by_offset(a, x, y):
        return cut(a, a1, x, y, REACH, 0.4, 4.0)

    def by_angle(a, x, y):
        return sum_to_three(a1, a, x, y, REACH)

    for frame in (by_offset, by_angle):
        x, y = frame(a0, dx, dy)
        if (dx, dy) != (0.0, 0.0):
            assert frame(-a0, dx, -dy) == (x, -y)
            assert frame(-a0, -dx, dy) == (-x, y)


@given(shares, shares, st.floats(-np.pi, np.pi), st.floats(1.05, 40.0))
def test_sum_to_three_solves_the_equation_of_the_cut_angle(a0, a1, bearing, apart):
    distance, c = apart * REACH, np.deg2rad(70) * a1
    x, y = sum_to_three(a0, a1, distance * np.cos(bearing), distance * np.sin(bearing), REACH)
    assert np.hypot(x, y) == pytest.approx(1.395 * (0.3 + 1.35 * (a0 + 1)), rel=1e-14)
    turned = np.angle((x + 1j * y) * np.exp(-1j * bearing))  # counter-clockwise
    d = abs(turned)
    assert abs(d - np.arctan(REACH * np.sin(abs(c) - d) / (distance - REACH * np.cos(abs(c) - d)))) < 1e-12
    assert turned * c <= 1e-14


def test_aim_returns_a_unit_vector_for_touching_and_coinciding_balls():
    assert aim(0.0, 0.0, REACH, 1.0) == (1.0, 0.0)
    for offset in (-1.0, 0.5, 1.0):
        for distance in (REACH, REACH * (1 - 1e-11), 1e-300):
            assert np.hypot(*aim(distance, 0.0, REACH, offset)) == pytest.approx(1.0, rel=1e-15)


def test_choice_of_the_target_ball():
    nearest, first = -1, -2
    assert BALLS == ("nearest", "first")
    positions = np.array([[0.0, 0.0], [0.1, 0.0], [1.0, 0.0], [0.5, 0.5]])
    targets = np.array([False, False, True, True])
    none, third = np.zeros(4, bool), np.array([False, False, False, True])
    assert [choose_ball(ball, targets, positions, none) for ball in (nearest, first, 1, 2, 3)] == [3, 2, 1, 2, 3]
    assert [choose_ball(ball, targets, positions, third) for ball in (nearest, first, 1, 2, 3)] == [2, 2, 1, 2, 2]
    assert choose_ball(nearest, targets, positions, np.array([False, False, True, True])) == 0


@frames
def test_leading_axes_and_clipping_of_actions(frame):
    positions, potted = random_layouts(6), np.zeros((6, 2), bool)
    actions = np.random.default_rng(0).uniform(-1.3, 1.3, (6, 2)).astype(np.float32)
    aims = ActionTransform(frame, POOL, np.array([False, True]), 4.5)
    flat = aims.velocities(actions, positions, potted)
    stacked = aims.velocities(actions.reshape(2, 3, 2), positions.reshape(2, 3, 2, 2), potted.reshape(2, 3, 2))
    assert stacked.reshape(6, 2).tobytes() == flat.tobytes()
    for k in range(6):
        assert aims.velocities(actions[k], positions[k], potted[k]).tobytes() == flat[k].tobytes()
    assert aims.velocities(np.clip(actions, -1, 1), positions, potted).tobytes() == flat.tobytes()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("cute",), r"frame = 'cute': expected one of .* \(did you mean 'cut'\?\)"),
        (("cut", "near"), r"ball = 'near': expected one of"),
        (("cut", 0), "ball = 0: expected 1, 'nearest' or 'first'"),
        (("cut", 2), "ball = 2"),
        (("cut", True), "ball = True"),
        (("cut", "nearest", 4.1), "least_speed = 4.1: expected a number from 0 to 4 m/s, max_speed"),
        (("cut", "nearest", -1.0), "least_speed = -1.0"),
        (("sum_to_three",), "max_speed = 4.0 with frame 'sum_to_three': expected at least 4.185"),
    ],
)
def test_bad_frames_raise(arguments, message):
    with pytest.raises(ValueError, match=message):
        ActionFrame(gym.make("Billiards-v0"), *arguments)
    with pytest.raises(ValueError, match=message):
        VectorActionFrame(gym.make_vec("Billiards-v0", 2), *arguments)


# --- wrappers ---------------------------------------------------------------------------------------------------------


def wrapped():
    yield from (ActionFrame(make(), frame, ball) for frame, ball in zip(FRAMES, ("first", 2), strict=True))
    yield ExecutionNoise(make())
    yield ActionFrame(ExecutionNoise(make()), "cut")


def test_environment_checkers_pass():
    sb3 = pytest.importorskip("stable_baselines3.common.env_checker")
    for env in wrapped():
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            warnings.filterwarnings("ignore", ".*is different from the unwrapped version")
            check_env(env)
            sb3.check_env(env, warn=True)
        assert env.action_space == gym.spaces.Box(-1, 1, (2,), np.float32)


def test_a_spec_recreates_the_wrapped_environment():
    env = ActionFrame(ExecutionNoise(make(), 0.25, 0.1), "cut", ball=2, least_speed=1.0)
    assert env.spec is not None
    again = gym.make(EnvSpec.from_json(env.spec.to_json()))
    assert str(again) == str(env)
    assert json.loads(env.spec.to_json())["additional_wrappers"][-1]["kwargs"] == {
        "frame": "cut",
        "ball": 2,
        "least_speed": 1.0,
    }
    for game in (env, again):
        game.reset(seed=3)
    action = np.array([0.3, 0.2], np.float32)
    assert env.step(action)[0].tobytes() == again.step(action)[0].tobytes()


@pytest.mark.parametrize(
    ("frame", "mode", "build"),
    [
        ("cut", AutoresetMode.NEXT_STEP, native),
        ("cut", AutoresetMode.SAME_STEP, sync),
        ("sum_to_three", AutoresetMode.DISABLED, native),
    ],
)
def test_vector_wrappers_play_the_same_as_single_ones(frame, mode, build):
    envs = VectorActionFrame(VectorExecutionNoise(build(mode), **NOISE), frame)
    wrapped = [lambda: ActionFrame(ExecutionNoise(make(), **NOISE), frame)] * envs.num_envs
    singles = SyncVectorEnv(wrapped, autoreset_mode=mode)
    observations, _ = envs.reset(seed=11)
    assert len({tuple(row) for row in observations.tolist()}) == envs.num_envs
    assert np.array_equal(observations, singles.reset(seed=11)[0])
    ends = 0
    for chosen in np.random.default_rng(0).uniform(-1, 1, (50, envs.num_envs, 2)).astype(np.float32):
        found, expected = envs.step(chosen), singles.step(chosen)
        assert all(map(np.array_equal, found[:3], expected[:3]))
        ends += found[2].sum()
        if mode is AutoresetMode.DISABLED and found[2].any():
            same = [env.reset(options={"reset_mask": found[2].copy()})[0] for env in (envs, singles)]
            assert np.array_equal(*same)
    assert ends > 20


def test_the_frame_uses_the_present_positions():
    env = ActionFrame(make(), "cut")
    env.reset(options={"positions": [[-0.5, 0.0], [0.5, 0.1], [-0.2, 0.4]]})
    np.testing.assert_allclose(env.action([0.0, 1.0]), [0.6, 0.8], rtol=0, atol=1e-15)
    np.testing.assert_allclose(env.action([0.0, -1.0]), np.array([0.6, 0.8]) * 0.4 / 4.5, rtol=0, atol=1e-15)
    for action in ([0.0], [[0.0, 0.0]], [np.nan, 0.0], [0.0, np.inf]):
        with pytest.raises(ValueError, match="expected"):
            env.step(action)


def test_positions_and_potted_are_copies():
    places = [[0.97, 0.335], [-0.5, 0.1], [-0.2, 0.4]]  # the cue ball is aimed at the corner pocket
    env, envs = make(), native(AutoresetMode.DISABLED, 2)
    env.reset(options={"positions": places})
    game: Any = env.unwrapped
    assert game.positions.tolist() == places
    assert game.potted.tolist() == [False] * 3
    env.step([0.2, 0.2])
    assert game.positions.tolist() == [[1.27, 0.635], *places[1:]]
    assert game.potted.tolist() == [True, False, False]
    game.positions[:], game.potted[:] = 0.0, False
    assert (game.positions[0, 0], game.potted[0]) == (1.27, True)
    envs.reset(options={"positions": np.array([places, places])})
    envs.step([[0.2, 0.2], [0.0, 0.0]])
    games: Any = envs.unwrapped
    assert games.positions.tolist() == [game.positions.tolist(), places]
    assert games.potted.tolist() == [[True, False, False], [False] * 3]
    games.positions[:], games.potted[:] = 0.0, False
    assert (games.positions[0, 0, 0], games.potted[0, 0]) == (1.27, True)


# --- noise ------------------------------------------------------------------------------------------------------------


def noisy_shots(env, count, seed: int | None = 0, action=(0.0, 0.5)):
    """Returns the actions after noise of `count` shots, by default at half the largest speed along y."""
    shots = []
    env.unwrapped.step = lambda noisy: (shots.append(noisy), 0.0, False, False, {})
    env.reset(seed=seed)
    for _ in range(count):
        env.step(np.array(action, np.float32))
    return np.array(shots)


def test_noise_has_the_given_standard_deviations_and_is_repeatable():
    shots = noisy_shots(ExecutionNoise(gym.make("Billiards-v0").unwrapped), 4000)
    angles, speeds = np.rad2deg(np.arctan2(-shots[:, 0], shots[:, 1])), 4 * np.hypot(*shots.T)
    for values, mean, std in ((angles, 0.0, 0.125), (speeds, 2.0, 0.075)):
        assert values.mean() == pytest.approx(mean, abs=4 * std / np.sqrt(4000))
        assert values.std() == pytest.approx(std, rel=4 / np.sqrt(2 * 4000))
    assert abs(np.corrcoef(angles, speeds)[0, 1]) < 4 / np.sqrt(4000)
    again = ExecutionNoise(gym.make("Billiards-v0").unwrapped)
    assert noisy_shots(again, 10).tobytes() == shots[:10].tobytes()
    assert noisy_shots(again, 10, seed=1).tobytes() != shots[:10].tobytes()


def test_noise_does_not_change_the_layouts():
    plain, noisy = make(max_shots=1), ExecutionNoise(make(max_shots=1))
    for seed in (4, None, None):
        assert plain.reset(seed=seed)[0].tobytes() == noisy.reset(seed=seed)[0].tobytes()
        plain.step(np.array([0.5, 0.1]))
        noisy.step(np.array([0.5, 0.1]))


def test_noise_of_zero_changes_nothing():
    plain, noisy = make(), ExecutionNoise(make(), 0.0, 0.0)
    action = np.array([0.35, -0.8], np.float32)
    for env in (plain, noisy):
        env.reset(seed=1)
    assert plain.step(action)[0].tobytes() == noisy.step(action)[0].tobytes()


def test_unseeded_noise_differs():
    actions = [noisy_shots(ExecutionNoise(make().unwrapped), 3, seed=None) for _ in range(2)]
    assert actions[0].tobytes() != actions[1].tobytes()


@pytest.mark.parametrize("build", [native, sync])
def test_lists_of_seeds_and_masked_seeds_seed_the_noise(build):
    envs = VectorExecutionNoise(build(AutoresetMode.DISABLED, 3), **NOISE)
    action = np.array([[0.1, 0.2]] * 3, np.float32)

    def play(**kwargs):
        observations, _ = envs.reset(**kwargs)
        return np.concatenate((observations, envs.step(action)[0]), axis=1)

    first = play(seed=[7, 8, 9])
    assert play(seed=7).tobytes() == first.tobytes()
    assert play(seed=[7, None, 9])[[0, 2]].tobytes() == first[[0, 2]].tobytes()
    play()
    again = play(seed=[7, 8, 9], options={"reset_mask": np.array([False, True, False])})
    assert again[1].tobytes() == first[1].tobytes()
    assert (again[[0, 2]] != first[[0, 2]]).any(axis=1).all()


@pytest.mark.parametrize("frame", [None, "cut"])
@pytest.mark.parametrize("vector", [False, True])
@pytest.mark.parametrize(
    ("action", "clipped"),
    [
        ([3.0, 0.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0, 0.0]),
        ([0.3, 0.4, 0.0, 0.0, -1.0], [0.3, 0.4, 0.0, 0.0, 0.0]),
        ([0.3, 0.4, 5.0, 0.0, 0.0], [0.3, 0.4, 1.0, 0.0, 0.0]),
        ([0.3, 0.4, 0.5, -9.0, 2.0], [0.3, 0.4, 0.5, -1.0, 1.0]),
    ],
)
def test_equal_shots_have_equal_noise(action, clipped, vector, frame):
    def shots(chosen):
        """Returns the actions after noise of three equal shots."""
        if vector:
            env: Any = VectorExecutionNoise(gym.make_vec("Billiards-v0", 2, action="strike"))
            env, chosen = VectorActionFrame(env, frame) if frame else env, [chosen] * 2
        else:
            env = ExecutionNoise(gym.make("Billiards-v0", action="strike").unwrapped)
            env = ActionFrame(env, frame) if frame else env
        return noisy_shots(env, 3, action=chosen)

    found = shots(action)
    assert found.tobytes() == shots(clipped).tobytes()
    assert (found[0] != found[1]).all()


@pytest.mark.parametrize("scales", [(-0.1, 0.0), (0.0, np.nan), (np.inf, 0.0)])
def test_impossible_noise_raises(scales):
    with pytest.raises(ValueError, match=r"_std = .*: expected a number from 0 to "):
        ExecutionNoise(make(), *scales)
    with pytest.raises(ValueError, match=r"_std = .*: expected a number from 0 to "):
        VectorExecutionNoise(gym.make_vec("Billiards-v0", 2), *scales)
