"""Action frames and execution noise: their geometry, and their wrappers of single and vector environments."""

import warnings
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
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
from billiards_env.envs.actions import add_noise
from billiards_env.envs.arguments import check_noise
from billiards_env.envs.episodes import noise_stream
from billiards_env.envs.wrappers import ActionFrame, VectorActionFrame
from billiards_env.scene import Scene, layouts

POOL = Scene.named("pool")
REACH = 2 * POOL.balls.radius[0]
FAST = {"max_speed": 4.5, "n_object_balls": 2, "max_shots": 3}  # fast enough for all action frames
NOISE: dict[str, Any] = {"angle_std": 5.0, "speed_std": 0.5}
shares = st.floats(-1.0, 1.0)
frames = pytest.mark.parametrize("frame", FRAMES)


def make(**kwargs):
    return gym.make("Billiards-v0", **{**FAST, **kwargs})


def native(mode, num_envs=5, **kwargs):
    return gym.make_vec("Billiards-v0", num_envs, autoreset_mode=mode, **FAST, **kwargs)


def sync(mode, num_envs=5, **kwargs):
    return SyncVectorEnv([lambda: make(**kwargs)] * num_envs, autoreset_mode=mode)


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


# --- wrappers ---------------------------------------------------------------------------------------------------------


def wrapped():
    yield from (ActionFrame(make(), frame, ball) for frame, ball in zip(FRAMES, ("first", 2), strict=True))
    yield ActionFrame(make(noise=NOISE), "cut")


def test_environment_checkers_pass():
    sb3 = pytest.importorskip("stable_baselines3.common.env_checker")
    for env in wrapped():
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            warnings.filterwarnings("ignore", ".*is different from the unwrapped version")
            check_env(env, skip_render_check=True)
            sb3.check_env(env, warn=True)
        assert env.action_space == gym.spaces.Box(-1, 1, (2,), np.float32)


@pytest.mark.parametrize(
    ("frame", "action", "mode", "build"),
    [
        ("cut", "strike", AutoresetMode.NEXT_STEP, native),
        ("cut", "velocity", AutoresetMode.SAME_STEP, sync),
        ("sum_to_three", "velocity", AutoresetMode.DISABLED, native),
    ],
)
def test_vector_wrappers_play_the_same_as_single_ones(frame, action, mode, build):
    envs: Any = VectorActionFrame(build(mode, action=action, noise=NOISE), frame)
    wrapped = [lambda: ActionFrame(make(action=action, noise=NOISE), frame)] * envs.num_envs
    singles = SyncVectorEnv(wrapped, autoreset_mode=mode)
    observations, _ = envs.reset(seed=11)
    assert len({tuple(row) for row in observations.tolist()}) == envs.num_envs
    assert np.array_equal(observations, singles.reset(seed=11)[0])
    ends = 0
    for chosen in np.random.default_rng(0).uniform(-1, 1, (50, *envs.action_space.shape)).astype(np.float32):
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
    strikes = ActionFrame(make(action="strike"), "cut")  # only the first two of five numbers change
    strikes.reset(options={"positions": [[-0.5, 0.0], [0.5, 0.1], [-0.2, 0.4]]})
    assert strikes.action([0.0, 1.0, 0.2, 0.3, 0.1]).tolist() == [*env.action([0.0, 1.0]).tolist(), 0.2, 0.3, 0.1]
    assert strikes.step([0.0, -0.5, 0.0, 0.4, 0.0])[4]["first_hit"] == 2


@pytest.mark.parametrize("vector", [False, True])
def test_positions_and_potted_are_copies(vector):
    places, shot = [[0.97, 0.335], [-0.5, 0.1], [-0.2, 0.4]], [0.2, 0.2]  # the cue ball drops in the corner pocket
    env: Any = native(AutoresetMode.DISABLED, 1).unwrapped if vector else make().unwrapped
    env.reset(options={"positions": [places] if vector else places})
    assert env.positions.reshape(3, 2).tolist() == places
    assert not env.potted.any()
    env.step([shot] if vector else shot)
    for _ in range(2):
        assert env.positions.reshape(3, 2).tolist() == [[1.27, 0.635], *places[1:]]
        assert env.potted.reshape(3).tolist() == [True, False, False]
        env.positions[:], env.potted[:] = 0.0, False


# --- noise ------------------------------------------------------------------------------------------------------------


def noisy_shots(count, seed=0, action=(0.0, 0.5)):
    """Returns the actions after noise of `count` shots, by default at half the largest speed along y."""
    kind = "strike" if len(action) > 2 else "velocity"
    stream, shots = noise_stream(seed, None)[None], np.array([[action]] * count, np.float64)
    for shot in shots:
        add_noise(0, 1, np.zeros(1, bool), shot, check_noise({}, POOL, kind, 4.0), stream)
    return shots[:, 0]


@pytest.mark.parametrize("action", ["velocity", "strike"])
def test_noise_has_the_given_standard_deviations(action):
    aimed = [0.0, 0.5, 0.1, -0.1, 0.2][: 5 if action == "strike" else 2]
    shots = noisy_shots(4000, action=aimed)
    angles, speeds = np.rad2deg(np.arctan2(-shots[:, 0], shots[:, 1])), 4 * np.hypot(*shots[:, :2].T)
    offset = 0.0005 / (0.5 * POOL.balls.radius[0])
    tip = zip(shots[:, 2:].T, aimed[2:], (offset, offset, 0.1 / 90), strict=False)
    for values, mean, std in ((angles, 0.0, 0.125), (speeds, 2.0, 0.075), *tip):
        assert values.mean() == pytest.approx(mean, abs=4 * std / np.sqrt(4000))
        assert values.std() == pytest.approx(std, rel=4 / np.sqrt(2 * 4000))
    correlations = np.corrcoef([angles, speeds, *shots[:, 2:].T]) - np.eye(len(aimed))
    assert np.abs(correlations).max() < 4.5 / np.sqrt(4000)
    assert noisy_shots(10, seed=1, action=aimed).tobytes() != shots[:10].tobytes()


def test_noise_does_not_change_the_layouts():
    plain, noisy = make(max_shots=1), make(max_shots=1, noise={})
    for seed in (4, None, None):
        assert plain.reset(seed=seed)[0].tobytes() == noisy.reset(seed=seed)[0].tobytes()
        assert plain.step([0.5, 0.1])[4]["shot_time"] != noisy.step([0.5, 0.1])[4]["shot_time"]


def test_the_noise_follows_the_seeds_and_the_noise_seed():
    def shot(seed, **arguments):
        env: Any = make(noise=NOISE, **arguments).unwrapped
        env.reset(seed=seed, options={"positions": [[-0.5, 0.0], [0.5, 0.1], [-0.2, 0.4]]})
        return env.step([0.3, 0.0])[0].tobytes()

    env = make(noise={})
    env.unwrapped.np_random = np.random.default_rng(0)  # its seed is not known
    env.reset()
    assert shot(1) == shot(1)
    assert len({shot(1), shot(2), shot(1, noise_seed=1), shot(1, noise_seed=2), shot(None), shot(None)}) == 6


@pytest.mark.parametrize("build", [native, sync])
def test_lists_of_seeds_and_masked_seeds_seed_the_noise(build):
    envs, twin = (build(AutoresetMode.DISABLED, 3, noise=NOISE) for _ in range(2))
    action = np.array([[0.1, 0.2]] * 3, np.float32)

    def play(envs, seed=None, mask=None):
        options = None if mask is None else {"reset_mask": np.array(mask)}
        observations, _ = envs.reset(seed=seed, options=options)
        return np.concatenate((observations, envs.step(action)[0]), axis=1)

    first = play(envs, [7, 8, 9])
    assert play(envs, 7).tobytes() == first.tobytes()
    assert play(envs, [7, None, 9])[[0, 2]].tobytes() == first[[0, 2]].tobytes()
    second = [False, True, False]
    for one in (envs, twin):
        play(one, 7)
        play(one)
    again = play(envs, [7, 8, 9], second)
    assert again[1].tobytes() == first[1].tobytes()
    assert again.tobytes() == play(twin, [None, 8, None], second).tobytes()  # the others are not seeded


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
        """Returns the observations after three equal shots."""
        options: dict[str, Any] = {"action": "strike", "noise": {}, "max_shots": 1}
        env: Any = gym.make_vec("Billiards-v0", 2, **options) if vector else make(**options)
        if frame:
            env = (VectorActionFrame if vector else ActionFrame)(env, frame)
        found = []
        for seed in (0, None, None):
            env.reset(seed=seed)
            found.append(env.step([chosen] * 2 if vector else chosen)[4])
        return [info["final_info"]["shot_time"].tolist() if vector else info["shot_time"] for info in found]

    found = shots(action)
    assert found == shots(clipped)
    assert found[0] != found[1]
