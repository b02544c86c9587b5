"""Plays a policy in a vector of environments and records the steps as arrays."""

from __future__ import annotations

import tempfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import torch
from filelock import FileLock
from numpy.typing import NDArray
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.utils import set_random_seed

from agents.config import Config
from agents.ppo import make_policy, make_vector, training_seed

# In a folder of this machine, because the clone may be on a disk that several machines share.
_LOCK = Path(tempfile.gettempdir()) / f"billiards-env-{zlib.crc32(__file__.encode()):08x}.lock"

Array = NDArray[Any]


class Rollouts:
    """Some of the environments of a training, which a policy plays in one thread.

    The environments reset in the step that ends an episode, so every step is a shot. The environments of all runners
    together play the same layouts as one vector environment with `config.n_envs` environments.

    Args:
        config: The configuration of the training.
        policy: The policy. Its weights may change between two calls.
        n_envs: The number of environments.
        first: The index of the first one among all environments of the training.

    Attributes:
        seeded: Whether `seed` was called.
    """

    def __init__(self, config: Config, policy: ActorCriticPolicy, n_envs: int, first: int) -> None:
        self.config, self.policy, self.first, self.seeded = config, policy, first, False
        self.envs = make_vector(config, n_envs, threads=1)

    def seed(self, steps: int) -> None:
        """Seeds all generators of this process for the training after `steps` steps, and begins new episodes."""
        seed = training_seed(self.config, steps)
        set_random_seed(seed + self.first)
        self.observations, _ = self.envs.reset(seed=seed + self.first)
        self.seeded = True

    @torch.no_grad()
    def play(self, n_steps: int) -> tuple[dict[str, Array], NDArray[np.bool_]]:
        """Plays `n_steps` steps of each environment.

        Returns:
            The arrays of an update, one row for each step, and the success of each episode that ended. The arrays are
            "obs", "actions", "action_logp", "advantages" and "value_targets".
        """
        shape = n_steps, self.envs.num_envs
        low, high = self.envs.action_space.low, self.envs.action_space.high  # pyright: ignore[reportAttributeAccessIssue]
        rewards, ends = np.empty(shape, np.float32), np.empty(shape, np.bool_)
        values = np.zeros((n_steps + 1, shape[1]), np.float32)
        columns: dict[str, list[Array]] = {"obs": [], "actions": [], "action_logp": []}
        successes = []
        for t in range(n_steps):
            inputs = torch.from_numpy(self.observations)
            actions, value, log_prob = self.policy(inputs)
            for name, tensor in zip(columns, (inputs, actions, log_prob), strict=True):
                columns[name].append(tensor.numpy())
            values[t] = value.numpy()[:, 0]
            self.observations, rewards[t], terminated, truncated, infos = self.envs.step(
                np.clip(actions.numpy(), low, high)
            )
            ends[t] = terminated | truncated
            if ends[t].any():
                successes.append(infos["final_info"]["is_success"][ends[t]])
        if not ends[-1].all():
            values[-1] = self.policy.predict_values(torch.from_numpy(self.observations)).numpy()[:, 0]
        gained = advantages(rewards, values, ends, self.config.ppo.gamma, self.config.ppo.gae_lambda)
        arrays = {name: np.concatenate(parts) for name, parts in columns.items()}
        arrays |= {"advantages": gained.ravel(), "value_targets": (gained + values[:-1]).ravel()}
        return arrays, np.concatenate(successes) if successes else np.zeros(0, np.bool_)


def compile_engine(config: Config) -> None:
    """Compiles everything that `Rollouts` needs.

    The first process of a machine compiles. The others wait for it and load the machine code.
    """
    with FileLock(_LOCK):
        rollouts = Rollouts(config, make_policy(config), 1, 0)
        rollouts.seed(0)
        rollouts.play(1)


def advantages(rewards: Array, values: Array, ends: Array, gamma: float, gae_lambda: float) -> Array:
    """Returns the generalized advantage estimates (Schulman et al. 2016), (n_steps, n_envs).

    Args:
        rewards: (n_steps, n_envs).
        values: (n_steps + 1, n_envs), the values of the states before the steps and of the last state.
        ends: (n_steps, n_envs), whether an episode ended. The value of the state after it is 0.
        gamma: The discount factor.
        gae_lambda: See `agents.config.Hyperparameters`.

    Example:
        >>> ones = np.ones((2, 1), np.float32)
        >>> advantages(ones, np.zeros((3, 1)), ones > 2, gamma=0.5, gae_lambda=1.0).ravel().tolist()
        [1.5, 1.0]
    """
    found, later = np.empty_like(rewards), np.zeros(rewards.shape[1], rewards.dtype)
    for t in reversed(range(len(rewards))):
        goes_on = ~ends[t]
        error = rewards[t] + gamma * goes_on * values[t + 1] - values[t]
        found[t] = later = error + gamma * gae_lambda * goes_on * later
    return found
