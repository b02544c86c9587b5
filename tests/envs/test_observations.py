"""The features of observations, against plain formulas in NumPy."""

from typing import Any

import numpy as np
import pytest

from billiards_env.envs import make_env, make_vector_env
from billiards_env.envs.observations import FEATURES, Feature, decode

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
    found = np.concatenate((length / reach, vectors / np.maximum(length, 1e-9)), -1)
    return np.where(there[..., None], found, 0.0)


def test_distances_and_directions(shots):
    envs, seen = shots
    positions, lying = envs.positions, ~envs.potted
    to_balls = positions[:, 1:] - positions[:, :1]
    expected = ways_of(to_balls, lying[:, :1] & lying[:, 1:], envs)
    np.testing.assert_allclose(seen["cue_to_balls"], expected, atol=1e-6)
    to_pockets = pockets_of(envs)[None, None] - positions[:, 1:, None]
    expected = ways_of(to_pockets, np.broadcast_to(lying[:, 1:, None], to_pockets.shape[:3]), envs)
    np.testing.assert_allclose(seen["balls_to_pockets"], expected, atol=1e-6)


def is_free(start, end, ball, target, envs):
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
        expected = is_free(positions[:, 0], positions[:, i] - touch * way, 0, i, envs) & ~envs.potted[:, i]
        assert np.array_equal(seen["free_to_balls"][:, i - 1], expected)
        assert 50 < expected.sum() < 350
        for p, pocket in enumerate(pockets_of(envs)):
            expected = is_free(positions[:, i], np.broadcast_to(pocket, (400, 2)), i, i, envs)
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
    names = ("shots_left", "goal", "potted", "positions")
    env, usual = (make_env(task="place", max_shots=2, observe=observe) for observe in (names, None))
    observation, seen = env.reset(seed=1)[0], usual.decode(usual.reset(seed=1)[0])
    assert tuple(env.features) == names
    assert env.features == {"shots_left": (), "goal": (1, 2), "potted": (2,), "positions": (2, 2)}
    assert observation.tolist() == [1.0, *seen["goal"][0], 0.0, 0.0, *seen["positions"].flat]
    low: Any = vars(env.observation_space)["low"]
    assert low.tolist() == [0, -1, -1, 0, 0, -1, -1, -1, -1]
    assert env.decode(env.step([0.1, 0.0])[0])["shots_left"] == 0.5


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


def test_a_new_feature_is_one_entry(monkeypatch):
    def write(begin, end, observations, first, score):
        observations[begin:end, first] = score[begin:end] / 100.0

    entry = Feature("the score", (), 0.0, write, lambda source: (source.arrays.score,))
    monkeypatch.setitem(FEATURES, "score", entry)
    env, envs = make_env(observe=("score",)), make_vector_env(2, "Disabled", observe=["positions", "score"])
    env.reset(options={"positions": [[0.97, 0.335], [1.07, 0.435]]})
    assert env.step([0.25, 0.25])[0].tolist() == [np.float32(0.01)]
    envs.reset(seed=0)
    assert envs.decode(envs.step(np.zeros((2, 2)))[0])["score"].tolist() == [0.0, 0.0]
