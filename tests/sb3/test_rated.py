"""The policy that rates candidate shots."""

from typing import Any, cast

import gymnasium as gym
import numpy as np
import pytest
import torch
from torch import nn

from agents.config import RATED_HEADS as CONFIGURED
from billiards_env import simulate_batch
from billiards_env.players.pots import Tables, find_pots
from billiards_env.sb3.rated import RATED_HEADS, RatedPolicy, _inputs, _points
from billiards_env.sb3.weights import build_policy

CAROM: dict[str, Any] = {"scene": "carom", "task": "carom", "layout": "random"}
PLACE: dict[str, Any] = {"task": "place"}
MIRRORS = [(1, -1), (-1, 1), (-1, -1)]


def make(head: str, speeds: tuple[float, float] = (0.1, 0.6), **env: Any) -> RatedPolicy:
    """Returns an untrained policy."""
    torch.manual_seed(0)
    description = {"head": head, "components": 6, "speeds": speeds, "hidden": [16], "activation": "relu"}
    return cast(RatedPolicy, build_policy(env, description))


def layouts(count: int, **env: Any) -> np.ndarray:
    """Returns the observations of random layouts, (count, size)."""
    return gym.make_vec("Billiards-v0", num_envs=count, **env).reset(seed=0)[0]


def test_the_configuration_and_the_policy_have_the_same_heads():
    assert RATED_HEADS == CONFIGURED


@pytest.mark.parametrize(
    ("head", "env"),
    [
        ("rated_hits", CAROM),
        ("rated_hits", PLACE),
        ("rated_pots", {}),
        ("rated_pots", {"task": "position"}),
        ("rated_pots", {"n_object_balls": 3, "max_shots": 4, "observe_shots_left": True}),
    ],
    ids=str,
)
def test_mirrored_layouts_have_mirrored_shots(head, env):
    policy, observations = make(head, **env), layouts(100, **env)
    shots, _ = policy.predict(observations, deterministic=True)
    assert policy.action_space.contains(shots[0])
    assert len(np.unique(shots, axis=0)) == 100
    points = policy.game.scene.n_balls + len(policy.game.goals)
    for mirror in MIRRORS:
        mirrored = observations.copy()
        mirrored[:, : 2 * points] *= np.tile(np.array(mirror, np.float32), points)
        found, _ = policy.predict(mirrored, deterministic=True)
        same = np.abs(found - shots * mirror).max(axis=1) < 1e-4
        assert same.mean() > 0.97  # rounding decides between equal ratings


def test_every_candidate_hits_a_ball():
    policy, observations = make("rated_hits", **CAROM), torch.as_tensor(layouts(50, **CAROM))
    actions, _ = policy.draw(observations, 12, 4)
    scene = policy.game.scene
    positions = _points(policy.game, observations)[0].repeat_interleave(4, 0)
    directions = actions / actions.norm(dim=1, keepdim=True)
    # A slow candidate may stop before it reaches the ball.
    shots = simulate_batch(scene, positions.double().numpy(), 6.0 * directions.double().numpy())
    assert (shots.first_hit > 0).mean() > 0.98
    speeds = actions.norm(dim=1)
    assert 0.1 <= speeds.min() < 0.15
    assert 0.5 < speeds.max() <= 0.6001


def test_half_of_the_drawn_candidates_have_the_best_ratings():
    policy, observations = make("rated_hits", **PLACE), torch.as_tensor(layouts(20, **PLACE))
    _, inputs = policy.draw(observations, 40, 10)
    with torch.no_grad():
        goals = _points(policy.game, observations)[1][:, 0].repeat_interleave(10, 0)
        ratings = policy._ratings(inputs, goals).view(20, 10)
    best = ratings.topk(5).values.mean(1)
    assert (best > ratings.median(1).values).all()
    assert (ratings[:, 5:].mean(1) > ratings[:, :5].mean(1)).float().mean() > 0.9


def test_the_lines_end_where_a_cue_ball_without_cushions_comes_to_rest():
    policy = make("rated_hits", speeds=(0.05, 0.15), **PLACE)
    observations = torch.as_tensor(layouts(2000, **PLACE))
    positions, candidates = policy._random(observations)
    inputs, reach = _inputs(policy.game, positions, candidates)
    velocities = (candidates.direction * candidates.speed).double().numpy()
    batch = simulate_batch(policy.game.scene, positions.double().numpy(), velocities)
    plain = reach.numpy() & (batch.first_hit == 1) & (batch.cushions.sum(axis=1) == 0) & ~batch.potted.any(axis=1)
    np.testing.assert_array_equal(reach[batch.first_hit == 1], True)
    assert plain.sum() > 100
    errors = np.abs((inputs.end * inputs.signs).numpy() - batch.positions[:, 0]).max(axis=1)[plain]
    assert np.quantile(errors, 0.95) < 1e-3
    # After cushions they are a rule of thumb.
    one = (batch.first_hit == 1) & (batch.cushions[:, 0] == 1) & ~batch.potted.any(axis=1)
    errors = np.abs((inputs.end * inputs.signs).numpy() - batch.positions[:, 0]).max(axis=1)[one]
    assert np.median(errors) < 0.1


def test_the_loss_is_least_for_the_truth():
    policy, observations = make("rated_hits", **PLACE), torch.as_tensor(layouts(64, **PLACE))
    _, inputs = policy.draw(observations, 2, 2)
    rest = inputs.end * inputs.signs
    with torch.no_grad():
        last = cast(nn.Linear, policy.rating[-1])
        for weights in last.parameters():
            weights.zero_()
        near, far = (policy.loss(inputs, torch.ones(128), rest + shift) for shift in (0.0, 0.5))
        assert near < far
        last.bias[0] = 3.0
        assert policy.loss(inputs, torch.ones(128), rest) < near < policy.loss(inputs, torch.zeros(128), rest) + near


def test_an_untrained_policy_rates_places_near_the_goal():
    policy = make("rated_hits", **PLACE)
    with torch.no_grad():
        last = cast(nn.Linear, policy.rating[-1])
        for weights in last.parameters():
            weights.zero_()  # the places are the ends of the lines
        last.bias[3] = -2.0
    envs = gym.make_vec("Billiards-v0", num_envs=300, autoreset_mode="SameStep", **PLACE)
    actions, _ = policy.predict(envs.reset(seed=0)[0], deterministic=True)
    assert envs.step(actions)[-1]["final_info"]["is_success"].mean() > 0.15


def test_pots_are_candidates_and_layouts_without_a_pot_have_a_full_hit():
    env: dict[str, Any] = {"n_object_balls": 2, "max_shots": 2}
    policy, observations = make("rated_pots", **env), layouts(3000, **env)
    game = policy.game
    positions = _points(game, torch.as_tensor(observations))[0].double().numpy()
    tables = Tables(game.scene, game.targets, positions, np.zeros((3000, 3), np.bool_), game.max_speed)
    alone = find_pots(tables, most=6).count == 0
    assert alone.sum() >= 5
    ways = (positions[:, 1:] - positions[:, :1])[alone]
    nearest = ways[np.arange(len(ways)), np.hypot(*ways.T).T.argmin(1)]
    shots, _ = policy.predict(observations[alone], deterministic=True)
    np.testing.assert_allclose(shots / np.hypot(*shots.T)[:, None], nearest / np.hypot(*nearest.T)[:, None], atol=1e-2)


@pytest.mark.parametrize(
    ("head", "env", "message"),
    [
        ("rated_hits", {"action": "strike"}, "policy.head = 'rated_hits' with action = 'strike': expected 'velocity'"),
        ("rated_pots", CAROM, "policy.head = 'rated_pots' in the task 'carom': expected one of the tasks pot"),
        ("rated_hits", {"n_object_balls": 3}, "policy.head = 'rated_hits' with 3 object balls: expected one or two"),
    ],
)
def test_an_environment_that_does_not_fit_is_refused(head, env, message):
    with pytest.raises(ValueError, match=message):
        make(head, **env)
