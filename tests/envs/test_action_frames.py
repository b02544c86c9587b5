"""Kinds of actions and execution noise: their geometry, in single and vector environments."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from hypothesis import given
from hypothesis import strategies as st

from billiards_env import simulate_batch
from billiards_env.envs import make_env, make_vector_env
from billiards_env.envs.action_frames import ActionFrame, aim, cut, nearest_ball, sum_to_three
from billiards_env.envs.actions import ACTIONS, Before, add_noise
from billiards_env.envs.arguments import check_noise
from billiards_env.envs.episodes import noise_stream
from billiards_env.scene import Scene, layouts

POOL = Scene.named("pool")
REACH = 2 * POOL.balls.radius[0]
FAST = {"max_speed": 4.5, "n_object_balls": 2, "max_shots": 3}  # fast enough for all action frames
NOISE: dict[str, Any] = {"angle_std": 5.0, "speed_std": 0.5}
shares = st.floats(-1.0, 1.0)


def make(**kwargs):
    return gym.make("Billiards-v0", **{**FAST, **kwargs})


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
    rng = np.random.default_rng(0)
    positions = np.array([layouts.draw("random", POOL, rng) for _ in range(500)])
    offsets = np.random.default_rng(1).uniform(-1, 1, 500).astype(np.float32)
    largest = np.nextafter(np.float32(1), np.float32(0))
    offsets[:40] = np.tile([largest, -largest, 0, 0.999], 10)
    actions = np.column_stack((offsets, np.ones(500)))
    playable = np.array([[False, True]] * 500)
    velocities = ActionFrame("cut", POOL, 4.0).velocities(actions, Before(positions, playable, playable, 4.0))
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


def test_the_target_is_the_nearest_playable_ball():
    positions = np.array([[0.0, 0.0], [0.1, 0.0], [1.0, 0.0], [0.5, 0.5]])
    for playable, expected in (([1, 1, 1, 1], 1), ([0, 0, 1, 1], 3), ([0, 0, 1, 0], 2), ([1, 0, 0, 0], 0)):
        assert nearest_ball(positions, np.array(playable, bool)) == expected


# --- environments -----------------------------------------------------------------------------------------------------


def test_the_frame_uses_the_present_positions_and_clips():
    env = make(action="cut")
    for action, expected in (([0.0, 1.0], [0.6, 0.8]), ([0.0, -7.0], np.array([0.6, 0.8]) * 0.4 / 4.5)):
        env.reset(options={"positions": [[-0.5, 0.0], [0.5, 0.1], [-0.2, 0.4]]})
        *_, info = env.step(action)
        np.testing.assert_allclose(info["played_action"], expected, rtol=0, atol=1e-15)


@pytest.mark.parametrize("scene", ["pool", "real_pool"])
def test_plans_of_the_mask_pot_the_ball_in_the_pocket(scene):
    envs = make_vector_env(600, "Disabled", scene=scene, n_object_balls=3, max_shots=2, action="plan")
    _, infos = envs.reset(seed=0)
    mask, rng = infos["action_mask"], np.random.default_rng(0)
    assert 1 < mask.sum(axis=1).mean() < 60
    plans = (rng.random(mask.shape) * mask).argmax(axis=1)
    balls, pockets, _ = np.unravel_index(plans, (3, 6, 5))
    places = np.array([(pocket.x, pocket.y) for pocket in envs.single_env.scene.table.pockets])
    *_, infos = envs.step(plans)
    rows = np.arange(600)
    potted = infos["potted"][rows, balls + 1] & (envs.positions[rows, balls + 1] == places[pockets]).all(axis=1)
    assert potted.mean() > (0.99 if scene == "pool" else 0.95)
    left = infos["action_mask"].reshape(600, 3, 30).any(axis=2)
    open_ = ~infos["scratch"] & ~infos["potted"][:, 1:].all(axis=1)
    assert not infos["action_mask"][~open_].any()
    some = open_ & ~infos["action_mask"].all(axis=1)
    assert not (left & infos["potted"][:, 1:])[some].any()


def test_a_plan_without_a_pot_is_a_full_hit_on_the_nearest_ball():
    places = [[-0.6, 0.0], [1.0, 0.0], [0.2, 0.0]]  # ball 2 hides ball 1
    env = make_env(n_object_balls=2, action="plan")
    _, info = env.reset(options={"positions": places})
    assert not info["action_mask"][:30].any()
    *_, info = env.step(3)
    assert info["first_hit"] == 2
    assert info["played_action"].tolist() == [0.8, 0.0]
    for plan in (-1, 60, 0.5):
        env.reset()
        with pytest.raises(ValueError, match="expected a whole number from 0 to 59"):
            env.step(plan)
    jammed = make_env(action="plan").reset(options={"positions": [[1.2, 0.0], [-1.2405, 0.0]]})[1]
    assert jammed["action_mask"].any()


def test_the_executed_action_repeats_the_shot():
    arguments: dict[str, Any] = {"scene": "pool", "n_object_balls": 2, "max_shots": 9}
    for action in ACTIONS:
        env, twin = (
            make_env(**arguments, max_speed=4.5, **own)
            for own in ({"action": action, "noise": NOISE}, {"action": "strike" if action == "strike" else "velocity"})
        )
        for seed in range(5):
            env.reset(seed=seed)
            twin.reset(options={"positions": env.positions})
            observation, *_, info = env.step(env.action_space.sample())
            assert np.hypot(*info["played_action"][:2]) <= 1 + 1e-15
            assert np.allclose(twin.step(info["played_action"])[0], observation, atol=1e-6)


@pytest.mark.parametrize("vector", [False, True])
def test_what_an_environment_returns_can_be_modified(vector):
    places, shot = [[0.97, 0.335], [-0.5, 0.1], [-0.2, 0.4]], [0.2, 0.2]  # the cue ball drops in the corner pocket
    env: Any = make_vector_env(1, "Disabled", **FAST) if vector else make_env(**FAST)
    env.reset(options={"positions": [places] if vector else places})
    assert env.positions.reshape(3, 2).tolist() == places
    assert not env.potted.any()
    info = env.step([shot] if vector else shot)[4]
    for _ in range(2):
        assert env.positions.reshape(3, 2).tolist() == [[1.27, 0.635], *places[1:]]
        assert env.potted.reshape(3).tolist() == [True, False, False]
        env.positions[:], env.potted[:], info["potted"][:], info["cushions"][:] = 0.0, False, False, 9
    env.reset()
    env.step([shot] if vector else shot)
    assert (info["cushions"] == 9).all()


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


@pytest.mark.parametrize("native", [True, False])
def test_lists_of_seeds_and_masked_seeds_seed_the_noise(native):
    def build() -> Any:
        if native:
            return make_vector_env(3, "Disabled", noise=NOISE, **FAST)
        return SyncVectorEnv([lambda: make(noise=NOISE)] * 3, autoreset_mode=AutoresetMode.DISABLED)

    def played(envs, seed=None, **options):
        observations, _ = envs.reset(seed=seed, options=options or None)
        return np.concatenate((observations, envs.step(np.array([[0.1, 0.2]] * 3, np.float32))[0]), axis=1)

    envs, twin, second = build(), build(), np.array([False, True, False])
    first = played(envs, [7, 8, 9])
    assert played(envs, 7).tobytes() == first.tobytes()
    assert played(envs, [7, None, 9])[[0, 2]].tobytes() == first[[0, 2]].tobytes()
    for one in (envs, twin):
        played(one, 7)
        played(one)
    again = played(envs, [7, 8, 9], reset_mask=second)
    assert again[1].tobytes() == first[1].tobytes()
    assert again.tobytes() == played(twin, [None, 8, None], reset_mask=second).tobytes()  # the others are not seeded


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
def test_equal_shots_have_equal_noise(action, clipped, vector):
    def times(chosen):
        """Returns the durations of three equal shots."""
        options: dict[str, Any] = {"action": "strike", "noise": {}, "max_shots": 1}
        env: Any = make_vector_env(2, "Disabled", **options) if vector else make_env(**options)
        found = []
        for seed in (0, None, None):
            env.reset(seed=seed)
            found.append(env.step([chosen] * 2 if vector else chosen)[4]["shot_time"].tolist())
        return found

    found = times(action)
    assert found == times(clipped)
    assert found[0] != found[1]
