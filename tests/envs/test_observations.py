"""The features of observations, against plain formulas in NumPy."""

from typing import Any

import numpy as np
import pytest

from billiards_env.drawing.raster import rgb
from billiards_env.drawing.style import rail_width
from billiards_env.envs import make_env, make_vector_env
from billiards_env.envs.observations import decode
from billiards_env.envs.tasks import TASKS

WAYS = ("cue_to_balls", "balls_to_pockets", "free_to_balls", "free_to_pockets")


@pytest.fixture(scope="module")
def shots():
    """Tables after a fast shot, with potted balls and a smaller cue ball, and the features of their observations."""
    envs = make_vector_env(400, "Disabled", scene="uk_pool", n_object_balls=5, max_speed=8.0, observe=WAYS[::-1])
    envs.reset(seed=0)
    turns = np.random.default_rng(0).uniform(0, 2 * np.pi, 400)
    observations, *_ = envs.step(np.stack((np.cos(turns), np.sin(turns)), 1))
    assert envs.potted[:, 0].sum() > 5
    assert envs.potted[:, 1:].sum() > 50
    assert all(observation in envs.single_observation_space for observation in observations)
    return envs, envs.decode(observations)


def pockets_of(envs):
    return np.array([(pocket.x, pocket.y) for pocket in envs.single_env.scene.table.pockets])


def ways_of(vectors, there, envs):
    """Returns distances, over the largest one on the table, and directions (..., 3); zeros where `there` is False."""
    half = np.array(envs.single_env.scene.half_extents)
    reach = np.linalg.norm(half + np.maximum(half, np.abs(pockets_of(envs)).max(axis=0)))
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    ways = np.concatenate((length / reach, vectors / np.maximum(length, 1e-9)), -1)
    return np.where(there[..., None], ways, 0.0)


def test_distances_and_directions(shots):
    envs, seen = shots
    positions, lying = envs.positions, ~envs.potted
    to_balls = positions[:, 1:] - positions[:, :1]
    expected = ways_of(to_balls, lying[:, :1] & lying[:, 1:], envs)
    np.testing.assert_allclose(seen["cue_to_balls"], expected, atol=1e-6)
    to_pockets = pockets_of(envs)[None, None] - positions[:, 1:, None]
    expected = ways_of(to_pockets, np.broadcast_to(lying[:, 1:, None], to_pockets.shape[:3]), envs)
    np.testing.assert_allclose(seen["balls_to_pockets"], expected, atol=1e-6)


def is_clear_path(start, end, ball, target, envs):
    """Returns whether a ball meets no ball but the target on lines (m, 2) from start to end."""
    positions, lying, radius = envs.positions, ~envs.potted, np.array(envs.single_env.scene.balls.radius)
    to_end, to_balls = (end - start)[:, None], positions - start[:, None]
    share = ((to_balls * to_end).sum(2) / (to_end**2).sum(2).clip(1e-30)).clip(0, 1)
    near = np.linalg.norm(to_balls - share[..., None] * to_end, axis=2) < 2 * np.sqrt(radius[ball] * radius)
    near[:, [ball, target]] = False
    return lying[:, ball] & ~(near & lying).any(axis=1)


def test_straight_lines_without_an_obstacle(shots):
    envs, seen = shots
    positions, radius = envs.positions, envs.single_env.scene.balls.radius
    for i in range(1, 6):
        way = positions[:, i] - positions[:, 0]
        touch = 2 * np.sqrt(radius[0] * radius[i]) / np.linalg.norm(way, axis=1, keepdims=True).clip(1e-9)
        expected = is_clear_path(positions[:, 0], positions[:, i] - touch * way, 0, i, envs) & ~envs.potted[:, i]
        assert np.array_equal(seen["free_to_balls"][:, i - 1], expected)
        assert 50 < expected.sum() < 350
        for p, pocket in enumerate(pockets_of(envs)):
            expected = is_clear_path(positions[:, i], np.broadcast_to(pocket, (400, 2)), i, i, envs)
            assert np.array_equal(seen["free_to_pockets"][:, i - 1, p], expected)


def test_a_ball_next_to_the_line_is_an_obstacle_if_the_balls_overlap_there():
    env = make_env(n_object_balls=2, observe=("free_to_balls", "free_to_pockets"))
    radius = env.scene.balls.radius[0]
    for offset, is_free in ((1.999, 0), (2.0, 1), (2.001, 1)):
        balls = [[-0.5, 0.0], [0.0, offset * radius], [0.5, 0.0]]
        seen = env.decode(env.reset(options={"positions": balls})[0])
        assert seen["free_to_balls"].tolist() == [1, is_free]
    seen = env.decode(env.reset(options={"positions": [[0.0, 0.5], [0.0, -0.5], [0.0, 0.0]]})[0])
    side = int(np.flatnonzero([pocket.x == 0.0 and pocket.y > 0.0 for pocket in env.scene.table.pockets])[0])
    assert seen["free_to_pockets"][:, side].tolist() == [0, 0]  # the cue ball is an obstacle, too


def test_mirrored_tables_have_mirrored_features_bit_for_bit():
    env = make_env(n_object_balls=3, observe=("cue_to_balls", "free_to_balls"))
    for seed in range(20):
        env.reset(seed=seed)
        positions = env.positions
        one, other = (
            env.decode(env.reset(options={"positions": positions * signs})[0].copy()) for signs in ([1, 1], [-1, 1])
        )
        assert (one["cue_to_balls"] * np.array([1, -1, 1], np.float32) == other["cue_to_balls"]).all()
        assert (one["free_to_balls"] == other["free_to_balls"]).all()


def test_the_argument_chooses_and_orders_the_features():
    env = make_env(task="place", max_shots=2, observe=("shots_left", "goal", "potted", "positions"))
    start = {"positions": [[0.635, -0.3175], [-0.127, 0.508]], "goal": [0.0, 0.127]}
    seen = np.array([0.0, 0.2, 0.0, 0.0, 0.5, -0.5, -0.1, 0.8], np.float32).tolist()  # relative to half the table
    assert env.reset(options=start)[0].tolist() == [1.0, *seen]
    assert env.step(np.zeros(2))[0].tolist() == [0.5, *seen]
    shapes = {"shots_left": (), "goal": (1, 2), "potted": (2,), "positions": (2, 2)}
    assert list(env.features.items()) == list(shapes.items())
    low: Any = vars(env.observation_space)["low"]
    assert low.tolist() == [0, -1, -1, 0, 0, -1, -1, -1, -1]


@pytest.mark.parametrize("size", [(84, 84), (40, 90)])
def test_images_contain_the_positions_to_half_a_pixel(size):
    envs = make_vector_env(200, task="place", observe=[("planes", *size), "positions"])
    seen = envs.decode(envs.reset(seed=0)[0])
    rail = rail_width(envs.single_env.scene.table)
    rows, columns = np.indices(size)
    for plane, places in ((0, envs.positions[:, 0]), (1, envs.positions[:, 1]), (3, envs.goals[:, 0])):
        weights = seen["planes"][..., plane] / seen["planes"][..., plane].sum((1, 2), keepdims=True)
        centroids = np.stack(((weights * columns).sum((1, 2)), (weights * rows).sum((1, 2))), 1) + 0.5
        scale = np.array(size[::-1]) / np.array([2.54 + 2 * rail, 1.27 + 2 * rail])
        expected = (places * [1, -1] + [1.27 + rail, 0.635 + rail]) * scale
        assert abs(centroids - expected).max() < (0.1 if plane < 3 else 0.5)
    assert not seen["planes"][..., 2].any()


def test_a_ball_that_moves_by_a_third_of_a_pixel_changes_the_image():
    step = 2.54 / 84 / 3
    moved = [[[0.3 + k * step, 0.1 + k * step * along], [-0.5, 0.0]] for k in range(9) for along in (0.0, 0.5)]
    images, _ = make_vector_env(18, observe=[("planes", 84, 84)]).reset(options={"positions": moved})
    assert len(np.unique(images, axis=0)) == 17


def test_planes_show_the_legal_balls_and_pixels_the_colours():
    rack = make_env(task="nine_ball", observe=[("planes", 60, 120), ("pixels", 60, 120)])
    seen = rack.reset(seed=0)[0]
    areas = seen["planes"].sum((0, 1))
    assert areas[1:] / areas[0] == pytest.approx([1, 8], rel=0.06)
    yellow = (abs(seen["pixels"] - np.array(rgb("#f0e442"))) < 9).all(2)  # the colour of ball 1
    assert yellow[seen["planes"][..., 1] > 250].all()
    assert yellow.any()


def test_stable_baselines3_accepts_images():
    sb3 = pytest.importorskip("stable_baselines3")
    from billiards_env.sb3 import SameStepVecEnv

    for observe, policy in ((["pixels"], "CnnPolicy"), (["planes", "shots_left"], "MultiInputPolicy")):
        chosen = [(name, 36, 36) if name != "shots_left" else name for name in observe]
        envs = SameStepVecEnv(make_vector_env(2, max_shots=2, observe=chosen))
        model = sb3.PPO(policy, envs, n_steps=4, batch_size=8, n_epochs=1, device="cpu")
        assert model.learn(8).num_timesteps == 8


@pytest.mark.parametrize(("task", "radius"), [("place", None), ("position", None), ("position", 1.0)])
def test_the_reward_of_goals_is_that_of_the_shots(task, radius):
    envs = make_vector_env(4000, "Disabled", task=task, observe="goal", scratch_penalty=0.3, goal_radius=radius)
    first, _ = envs.reset(seed=0)
    assert first["achieved_goal"].tolist() == [[x, y, 0.0] for x, y in envs.positions[:, 0].tolist()]
    assert first["desired_goal"].tolist() == [[x, y, 1.0] for ((x, y),) in envs.goals.tolist()]
    cue, ball = envs.decode(first)["positions"].swapaxes(0, 1)
    seen, rewards, *_, infos = envs.step((ball - cue) * [1.0, 0.5])
    achieved, desired = seen["achieved_goal"], seen["desired_goal"]
    reward = envs.single_env.compute_reward
    assert np.array_equal(reward(achieved, desired, [{}] * 4000), rewards)
    assert [reward(*goals, {}) for goals in zip(achieved[:99], desired, strict=False)] == rewards[:99].tolist()
    met = infos["potted"][:, 1] if task == "position" else infos["first_hit"] == 1
    assert np.array_equal(achieved[:, 2], np.where(infos["scratch"], -1, met))
    assert {-0.3, 1.0} <= set(rewards.tolist())
    distance = np.hypot(*(achieved - desired)[:, :2].T)
    assert np.array_equal(rewards == 1.0, met & ~infos["scratch"] & (distance <= (radius or TASKS[task].goal_radius)))
    scratch = np.where(infos["scratch"], -0.3, 1.0)  # every other shot reaches its own goal
    assert np.array_equal(reward(achieved, achieved), scratch)


def test_hindsight_replay_of_stable_baselines3_accepts_goals():
    sb3 = pytest.importorskip("stable_baselines3")
    from billiards_env.sb3 import SameStepVecEnv

    envs = SameStepVecEnv(make_vector_env(4, task="place", observe="goal", max_shots=2))
    options = {"replay_buffer_class": sb3.HerReplayBuffer, "learning_starts": 20, "batch_size": 8, "device": "cpu"}
    model = sb3.SAC("MultiInputPolicy", envs, **options)
    assert model.learn(40).num_timesteps == 40
    assert not hasattr(make_env(task="place"), "compute_reward")


def test_decode_returns_views_of_arrays_and_tensors():
    envs = make_vector_env(3, observe=("positions", "shots_left"))
    observations, _ = envs.reset(seed=0)
    seen = envs.decode(observations)
    assert {name: values.shape for name, values in seen.items()} == {"positions": (3, 2, 2), "shots_left": (3,)}
    assert all(np.shares_memory(values, observations) for values in seen.values())
    many = envs.decode(np.zeros((4, 3, 5)))
    assert many["positions"].shape == (4, 3, 2, 2)
    with pytest.raises(ValueError, match="observation has 4 numbers: expected 5, of positions, shots_left"):
        envs.decode(observations[:, :4])
    torch = pytest.importorskip("torch")
    tensor = torch.zeros(3, 5)
    decode(tensor, envs.single_env.features)["positions"][1, 1] = 1.0
    assert tensor.sum(0).tolist() == [0.0, 0.0, 1.0, 1.0, 0.0]
