"""Velocities, strikes and other kinds of actions, and execution noise, in single and vector environments."""

import copy
import pickle
from typing import Any

import gymnasium as gym
import mpmath
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from billiards_env import simulate_batch, strike
from billiards_env.envs import make_env, make_vector_env
from billiards_env.envs.action_frames import ActionFrame, cut, nearest_ball, passing_direction, sum_to_three
from billiards_env.envs.actions import ACTIONS, add_noise, cue_strike, perturb
from billiards_env.envs.arguments import check_noise
from billiards_env.envs.reset import noise_stream
from billiards_env.physics.elementary import cos_sin
from billiards_env.physics.strike import cue_numbers, speed_gain
from billiards_env.scene import Scene, layouts
from billiards_env.shots.tables import Tables
from tests.helpers.shots import kinds, simulate

POOL = Scene.named("pool")
REACH = 2 * POOL.balls.radius[0]
FAST = {"max_speed": 4.5, "n_object_balls": 2, "max_shots": 3}  # fast enough for all action frames
NOISE: dict[str, Any] = {"angle_std": 5.0, "speed_std": 0.5}
shares = st.floats(-1.0, 1.0)


def make(**kwargs):
    return gym.make("Billiards-v0", **{**FAST, **kwargs})


# --- velocities and strikes -------------------------------------------------------------------------------------------


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


def test_an_action_of_five_numbers_is_a_strike():
    action = [0.3, -0.4, 0.5, -0.25, 0.5]
    speed = 0.5 * 4.0 / speed_gain(cue_numbers(POOL), 0.0)
    expected = strike(POOL, speed, np.arctan2(-0.4, 0.3), 0.25, -0.125, np.pi / 4)
    struck = cue_strike(action, POOL, 4.0)
    np.testing.assert_allclose(struck.velocity, expected.velocity, rtol=1e-14)
    np.testing.assert_allclose(struck.spin, expected.spin, rtol=1e-14)
    assert not struck.miscue
    assert cue_strike([0.3, 0.4, 0.8, 0.8, 0.0], POOL, 4.0).miscue
    assert cue_strike([0.3, 0.4, 9.0, 0.0, -5.0], POOL, 4.0).spin.tolist() == (
        cue_strike([0.3, 0.4, 1.0, 0.0, 0.0], POOL, 4.0).spin.tolist()
    )


@given(st.tuples(st.floats(-1, 1), st.floats(-1, 1)), st.floats(-1, 0))
def test_a_level_central_strike_is_the_velocity_bit_for_bit(velocity, elevation):
    struck = cue_strike([*velocity, 0.0, 0.0, elevation], POOL, 4.0)
    assert struck.velocity.tolist() == cue_strike(velocity, POOL, 4.0).velocity.tolist()
    assert not struck.spin.any()


# --- geometry ---------------------------------------------------------------------------------------------------------


@given(shares, shares, st.floats(-np.pi, np.pi), st.floats(1.0, 40.0))
def test_a_cut_passes_the_ball_at_the_given_distance(a0, a1, bearing, apart):
    dx, dy = apart * REACH * np.cos(bearing), apart * REACH * np.sin(bearing)
    x, y = cut(a0, a1, dx, dy, REACH, 4.0)
    speed = np.hypot(x, y)
    assert 4.0 * speed == pytest.approx(0.4 + 1.8 * (a1 + 1), rel=1e-14)
    assert (x * dy - y * dx) / speed == pytest.approx(a0 * REACH, abs=1e-14)  # positive: the ball is on the left
    assert x * dx + y * dy >= -1e-15
    assert passing_direction(0.0, 0.0, REACH, a0) == (1.0, 0.0)
    for distance in (REACH, REACH * (1 - 1e-11), 1e-300):
        assert np.hypot(*passing_direction(distance, 0.0, REACH, a0)) == pytest.approx(1.0, rel=1e-15)


def test_every_cut_hits_and_is_the_sine_of_the_cut_angle():
    rng = np.random.default_rng(0)
    positions = np.array([layouts.draw("random", POOL, rng) for _ in range(500)])
    offsets = np.random.default_rng(1).uniform(-1, 1, 500).astype(np.float32)
    largest = np.nextafter(np.float32(1), np.float32(0))
    offsets[:40] = np.tile([largest, -largest, 0, 0.999], 10)
    actions = np.column_stack((offsets, np.ones(500)))
    playable = np.array([[False, True]] * 500)
    velocities = 4.0 * ActionFrame("cut", POOL, 4.0).strokes(actions, Tables(POOL, positions, playable, playable, 4.0))
    pocketless = Scene(POOL.balls)
    assert (simulate_batch(pocketless, positions, velocities).first_hit == 1).all()

    frictionless = Scene.named("ideal")  # the object ball leaves along the line of centres
    shots = simulate_batch(frictionless, positions, velocities, max_time=0.7)
    for v, after, offset, cushions in zip(velocities, shots.velocities, offsets, shots.cushions, strict=True):
        if after[1].any() and not cushions.any():
            sine = (v[0] * after[1, 1] - v[1] * after[1, 0]) / np.hypot(*v) / np.hypot(*after[1])
            assert sine == pytest.approx(offset, abs=1e-9)


def test_a_cut_of_spheres_of_different_size_is_the_sine_of_the_cut_angle():
    scene = Scene.named("uk_pool", 2)
    apart = 2 * np.sqrt(scene.balls.radius[0] * scene.balls.radius[1])
    frame, playable = ActionFrame("cut", scene, 4.0), np.array([[False, True, False]])
    places = np.array([[-0.3, 0.1], [0.1, -0.05], [0.5, 0.3]])
    for offset in (-0.9, 0.3, 0.999):
        (stroke,) = frame.strokes([[offset, 0.0]], Tables(scene, places[None], playable, playable, 4.0))
        shot = simulate(scene, places, 4.0 * stroke, record=True)
        assert ("ball_ball", 0, 1) in kinds(shot)[:2]
        hit = shot.events[shot.events["kind"] == "ball_ball"][0]
        where = shot.at(float(hit["time"]))
        way, line = stroke / np.linalg.norm(stroke), where[1] - where[0]
        assert (line[1] * way[0] - line[0] * way[1]) / apart == pytest.approx(offset, abs=1e-9)


@example(0.0, 0.0, 0.0, 5e-324)  # reach / distance overflows to infinity
@given(shares, shares, st.floats(-2.0, 2.0), st.floats(-1.0, 1.0))
def test_mirrored_balls_and_cuts_mirror_bit_for_bit(a0, a1, dx, dy):
    def by_offset(a, x, y):
        return cut(a, a1, x, y, REACH, 4.0)

    def by_angle(a, x, y):
        return sum_to_three(a1, a, x, y, REACH, 5.0)

    for frame in (by_offset, by_angle):
        x, y = frame(a0, dx, dy)
        if (dx, dy) != (0.0, 0.0):
            assert frame(-a0, dx, -dy) == (x, -y)
            assert frame(-a0, -dx, dy) == (-x, y)


@given(shares, shares, st.floats(-np.pi, np.pi), st.floats(1.05, 40.0))
def test_sum_to_three_solves_the_equation_of_the_cut_angle(a0, a1, bearing, apart):
    distance, c = apart * REACH, np.deg2rad(70) * a1
    x, y = sum_to_three(a0, a1, distance * np.cos(bearing), distance * np.sin(bearing), REACH, 5.0)
    assert 5.0 * np.hypot(x, y) == pytest.approx(1.395 * (0.3 + 1.35 * (a0 + 1)), rel=1e-14)
    turned = np.angle((x + 1j * y) * np.exp(-1j * bearing))  # counter-clockwise
    d = abs(turned)
    assert abs(d - np.arctan(REACH * np.sin(abs(c) - d) / (distance - REACH * np.cos(abs(c) - d)))) < 1e-12
    assert turned * c <= 1e-14


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
    masked = open_ & ~infos["action_mask"].all(axis=1)
    assert not (left & infos["potted"][:, 1:])[masked].any()


def test_the_masks_are_those_of_the_present_state():
    arguments: dict[str, Any] = {"n_object_balls": 3, "max_shots": 2, "action": "plan"}
    env: Any = gym.make("Billiards-v0", **arguments)
    envs, others = make_vector_env(20, **arguments), make_vector_env(20, **arguments)
    assert not env.get_wrapper_attr("action_masks")().any()  # there is no episode
    _, info = env.reset(seed=0)
    _, infos = envs.reset(seed=0)
    for _ in range(3):
        masks = envs.action_masks()
        assert masks.dtype == np.bool_
        assert (masks == infos["action_mask"]).all()
        assert np.array_equal(envs.call("action_masks"), masks)
        others.set_state(envs.get_state([5, 6]), [1, 2])
        assert (others.action_masks() == [*[[False] * 90], *masks[5:7], *[[False] * 90] * 17]).all()
        for twin in (copy.deepcopy(envs), pickle.loads(pickle.dumps(envs))):
            assert (twin.action_masks() == masks).all()
        *_, infos = envs.step(masks.argmax(axis=1))
    mask, state = env.get_wrapper_attr("action_masks")(), env.unwrapped.get_state()
    assert (mask == info["action_mask"]).all()
    for _ in range(2):
        *_, over, _, info = env.step(mask.argmax())
        assert (env.unwrapped.action_masks() == info["action_mask"]).all()
        assert over is (not info["action_mask"].any())
    env.unwrapped.set_state(state)
    assert (env.unwrapped.action_masks() == mask).all()


@pytest.mark.parametrize("action", [name for name in ACTIONS if name != "plan"])
def test_an_action_that_is_no_choice_has_no_masks(action):
    arguments = {"action": action, "max_speed": 5.0}
    for env in (make_env(**arguments), make_vector_env(2, **arguments)):
        with pytest.raises(AttributeError, match=f"action_masks with action = '{action}': expected action 'plan'"):
            _ = env.action_masks
    with pytest.raises(AttributeError, match="action_masks"):
        make_vector_env(2, **arguments).call("action_masks")


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


# --- noise ------------------------------------------------------------------------------------------------------------


def test_perturb_turns_and_speeds_up_an_action():
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
    assert noisy_shots(2, action=[9, 0, 7, -2, -1]).tolist() == noisy_shots(2, action=[1, 0, 1, -1, 0]).tolist()
    perturbed = perturb([[np.nan, 0.5], [0.5, np.inf], [0.5, 0.0]], np.full((3, 2), 0.25))
    assert np.isfinite(perturbed).all(axis=1).tolist() == [False, False, True]


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
