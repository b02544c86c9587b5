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
            "obs", "actions", "action_logp", "advantages" and "value_targets". The advantages are the generalized ones
            of Schulman et al. (2016).
        """
        space: Any = self.envs.single_action_space
        rewards, ends, values, successes = [], [], [], []
        columns: dict[str, list[Array]] = {"obs": [], "actions": [], "action_logp": []}
        for _ in range(n_steps):
            inputs = torch.from_numpy(self.observations)
            actions, value, log_prob = self.policy(inputs)
            for name, tensor in zip(columns, (inputs, actions, log_prob), strict=True):
                columns[name].append(tensor.numpy())
            values.append(value.numpy()[:, 0])
            shots = np.clip(actions.numpy(), space.low, space.high)
            self.observations, reward, terminated, truncated, infos = self.envs.step(shots)
            rewards.append(reward.astype(np.float32))
            ends.append(terminated | truncated)
            if ends[-1].any():
                successes.append(infos["final_info"]["is_success"][ends[-1]])
        values.append(self.policy.predict_values(torch.from_numpy(self.observations)).numpy()[:, 0])
        gamma, trace = self.config.ppo.get("gamma", 0.99), self.config.ppo.get("gae_lambda", 0.95)
        gained, later = [], np.zeros(self.envs.num_envs, np.float32)
        for reward, end, value, following in reversed(list(zip(rewards, ends, values, values[1:], strict=False))):
            later = reward - value + gamma * ~end * (following + trace * later)
            gained.append(later)
        arrays = {name: np.concatenate(parts) for name, parts in columns.items()}
        arrays["advantages"] = np.concatenate(gained[::-1])
        arrays["value_targets"] = arrays["advantages"] + np.concatenate(values[:-1])
        return arrays, np.concatenate([np.zeros(0, np.bool_), *successes])


def compile_engine(config: Config) -> None:
    """Compiles everything that `Rollouts` needs.

    The first process of a machine compiles. The others wait for it and load the machine code.
    """
    with FileLock(_LOCK):
        rollouts = Rollouts(config, make_policy(config), 1, 0)
        rollouts.seed(0)
        rollouts.play(1)
