"""The arrays that a runner of RLlib records."""

from typing import Any

import numpy as np
import torch

from agents.config import Config
from agents.ppo import make_vector, training_seed
from agents.rllib.rollouts import Rollouts, as_tensors

SETTINGS = Config.from_dict(
    {"timesteps": 1000, "n_envs": 8, "seed": 3, "ppo": {"n_steps": 5, "batch_size": 8}, "env": {"scratch_penalty": 0.0}}
)


def test_runners_share_the_layouts_and_explore_differently():
    parts: list[Any]
    together, _ = make_vector(SETTINGS, 8).reset(seed=training_seed(SETTINGS, 640))
    parts, actions = [Rollouts(SETTINGS, 4, first) for first in (0, 4)], []
    for part in parts:
        part.seed(640)
    observations = [part.model._last_obs for part in parts]
    np.testing.assert_array_equal(together, np.concatenate(observations))
    for part in parts:
        part.seed(640)
        part.model._last_obs = np.full_like(together[:4], 0.3)
        actions.append(part.collect(part.model.policy.state_dict())[0]["actions"][::5])
    assert not np.isin(*actions).any()
    parts[0].seed(1280)
    assert not np.isin(parts[0].model._last_obs, together).any()


def test_every_step_is_a_shot_with_the_numbers_of_the_given_weights():
    played, other = Rollouts(SETTINGS, 8, 0), Rollouts(SETTINGS, 8, 0)
    played.seed(0)
    weights = {f"policy.{name}": tensor.numpy() for name, tensor in other.model.policy.state_dict().items()}
    arrays, successes = played.collect(as_tensors(weights))
    assert len(successes) == 40  # one shot is one episode, and no step is a reset
    assert {len(array) for array in arrays.values()} == {40}
    with torch.no_grad():
        values, log_prob, _ = other.model.policy.evaluate_actions(
            *map(torch.from_numpy, (arrays["obs"], arrays["actions"]))
        )
    np.testing.assert_allclose(arrays["action_logp"], log_prob, atol=1e-5)
    np.testing.assert_allclose(arrays["value_targets"] - arrays["advantages"], values[:, 0], atol=1e-5)
    assert arrays["value_targets"].sum() == sum(successes)
    assert played.collect(as_tensors(weights))[1] is not successes
