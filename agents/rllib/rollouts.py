"""Plays a part of the environments of a training and records the steps as arrays."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from agents.config import Config
from agents.ppo import make_ppo, make_vec_env, restart

COLUMNS = dict(
    obs="observations", actions="actions", action_logp="log_probs", advantages="advantages", value_targets="returns"
)
"""The arrays of an update by their names in RLlib, and their names in Stable-Baselines3."""


class Rollouts:
    """Some of the environments of a training, which PPO of Stable-Baselines3 plays in one thread.

    The environments reset in the step that ends an episode, so every step is a shot. The environments of all runners
    together play the same layouts as one vector environment with `config.n_envs` environments.

    Args:
        config: The configuration of the training.
        n_envs: The number of environments.
        first: The index of the first one among all environments of the training.

    Attributes:
        model: The model. Its policy may change between two calls.
        seeded: Whether `seed` was called.
    """

    def __init__(self, config: Config, n_envs: int, first: int) -> None:
        self.config, self.first, self.seeded = config, first, False
        settings = {**config.settings, "batch_size": n_envs * config.settings["n_steps"]}  # this model has no updates
        part = dataclasses.replace(config, n_envs=n_envs, settings=settings)
        self.model = make_ppo(part, make_vec_env(part, threads=1))
        _, self._callback = self.model._setup_learn(0, None)

    def seed(self, steps: int) -> None:
        """Seeds all generators of this process for the training after `steps` steps, and begins new episodes."""
        restart(self.model, self.config, steps, self.first)
        self.seeded = True

    def collect(self, weights: dict[str, Tensor]) -> tuple[dict[str, NDArray[Any]], list[bool]]:
        """Plays the steps of an update with the weights of a policy.

        Returns:
            The arrays of `COLUMNS`, one row for each step, and the success of each episode that ended.
        """
        model: Any = self.model
        model.policy.load_state_dict(weights)
        model.ep_success_buffer.clear()
        model.collect_rollouts(model.env, self._callback, model.rollout_buffer, model.n_steps)
        columns = {name: getattr(model.rollout_buffer, column) for name, column in COLUMNS.items()}
        return {name: np.concatenate(column) for name, column in columns.items()}, list(model.ep_success_buffer)


def as_tensors(weights: dict[str, NDArray[Any]]) -> dict[str, Tensor]:
    """Returns the weights of the policy from the weights of its RLModule."""
    return {name.removeprefix("policy."): torch.tensor(array) for name, array in weights.items()}
