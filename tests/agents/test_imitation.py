"""Supervised learning from the shots of a search."""

import dataclasses
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import torch
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.utils import set_random_seed

from agents import imitation
from agents.config import HEADS, Config, Imitation
from agents.imitation import imitate, search
from agents.ppo import make_policy, make_vector


def configuration(head: str = "pots", layouts: int = 300, **changes: Any) -> Config:
    return Config.from_dict(
        {
            "timesteps": 0,
            "n_envs": 8,
            "policy": {"head": head, "components": 6, "hidden": [16]},
            "imitation": {"layouts": layouts, "batch_size": 50, "n_epochs": 15, "learning_rate": 3e-3},
            "ppo": {"n_steps": 8},
            **changes,
        }
    )


def new_policy(config: Config) -> ActorCriticPolicy:
    torch.manual_seed(0)
    return make_policy(config)


def successful_log_density(policy: ActorCriticPolicy, config: Config) -> float:
    """Returns the mean log-density of the successful shots of a search on other layouts, with a lower limit."""
    examples = search(dataclasses.replace(config, seed=77), Imitation(layouts=200))
    with torch.no_grad():
        distribution = policy.get_distribution(examples.observations)
        log_prob = torch.stack([distribution.log_prob(shot) for shot in examples.actions.unbind(1)], 1)
    return float(log_prob.clamp(min=-8.0)[examples.rewards > 0].mean())


def expected_reward(policy: ActorCriticPolicy, config: Config) -> float:
    """Returns the mean reward of sampled actions on 4,000 layouts of another seed."""
    envs = make_vector(config, 4000)
    observations, _ = envs.reset(seed=10**9)
    torch.manual_seed(0)
    return float(envs.step(policy.predict(observations)[0])[1].mean())


@pytest.mark.parametrize("noise", [None, {"angle_std": 5.0}])
def test_the_examples_have_the_rewards_of_their_shots_without_noise(noise):
    config = configuration(noise=noise, env={"n_object_balls": 2, "max_shots": 3, "scratch_penalty": 1.0})
    examples = search(config, Imitation(layouts=20, shots=7))
    assert examples.observations.shape == (20, 6)
    assert examples.actions.shape == (20, 7, 2)
    assert len(examples.observations.unique(dim=0)) == 20
    env: Any = gym.make("Billiards-v0", **config.env)
    size = np.array([env.unwrapped.scene.table.length, env.unwrapped.scene.table.width]) / 2
    agree = []
    for table, shots, rewards in zip(*(part.numpy() for part in examples), strict=True):
        positions = table.reshape(-1, 2).astype(float) * size  # rounded to single precision
        for shot, reward in zip(shots, rewards, strict=True):
            observation, _ = env.reset(options={"positions": positions})
            np.testing.assert_allclose(observation, table, atol=1e-6)
            agree.append(float(env.step(shot)[1]) == float(reward))
    assert np.mean(agree) > 0.97
    assert len(examples.rewards.unique()) > 1


def test_the_seed_determines_the_examples(monkeypatch):
    config, settings = configuration(), Imitation(layouts=20, shots=4)
    first, again = search(config, settings), search(config, settings)
    assert all(torch.equal(one, other) for one, other in zip(first, again, strict=True))
    other = search(dataclasses.replace(config, seed=1), settings)
    assert not torch.equal(first.observations, other.observations)
    monkeypatch.setattr(imitation, "_TABLES", 8)
    in_parts = search(config, settings)
    assert torch.equal(in_parts.observations[:8], first.observations[:8])
    assert in_parts.actions.shape == (20, 4, 2)
    assert len(in_parts.observations.unique(dim=0)) == 20


@pytest.mark.parametrize("head", HEADS)
def test_successful_shots_on_new_layouts_become_more_probable(head):
    config = configuration(head)
    policy = new_policy(config)
    before = successful_log_density(policy, config)
    imitate(policy, config)
    assert successful_log_density(policy, config) > before + 0.02


@pytest.mark.parametrize("head", ["pots", "mixture"])
def test_the_expected_reward_on_new_layouts_rises(head):
    config = configuration(head, 500, env={"scratch_penalty": 1.0})
    policy = new_policy(config)
    before = expected_reward(policy, config)
    imitate(policy, config)
    assert expected_reward(policy, config) > before + 0.005


@pytest.mark.parametrize("head", ["pots", "gaussian"])
def test_the_standard_deviations_and_the_value_function_do_not_change(head):
    config = configuration(head)
    policy = new_policy(config)
    before = {name: value.clone() for name, value in policy.named_parameters()}
    imitate(policy, config)
    changed = {name for name, value in policy.named_parameters() if not torch.equal(value, before[name])}
    assert changed
    assert not any("log_" in name or "value_net" in name for name in changed)


def test_the_seed_determines_the_weights():
    weights = []
    for seed, state in ((0, 1), (0, 2), (3, 1)):
        config = configuration(seed=seed, layouts=100)
        policy = new_policy(config)
        set_random_seed(state)  # no global generator has an effect
        imitate(policy, config)
        weights.append([value.clone() for value in policy.parameters()])
    assert all(torch.equal(one, other) for one, other in zip(weights[0], weights[1], strict=True))
    assert not all(torch.equal(one, other) for one, other in zip(weights[0], weights[2], strict=True))
