"""Trains a policy that rates candidate shots, see `billiards_env.sb3.rated`.

In each layout the policy draws random candidates. It plays some of them, and those with the best ratings among the
others. Each shot is an example, and gradient descent fits the ratings to the examples of an update. There is no
exploration noise and no advantage, because a rating belongs to one shot.
"""

from __future__ import annotations

import io
import math
from collections.abc import Mapping
from typing import Any, cast

import numpy as np
import torch
from stable_baselines3.common.save_util import save_to_zip_file
from stable_baselines3.common.utils import set_random_seed
from torch import nn

from agents.config import Config
from agents.ppo import make_policy, make_vector
from billiards_env.envs.tasks import TASKS
from billiards_env.sb3.rated import Inputs, RatedPolicy

_LONGEST = 1.0  # the largest norm of a gradient


class Rater:
    """Learns ratings.

    Attributes:
        policy: The policy.
        num_timesteps: The number of shots so far.

    Raises:
        ValueError: If the policy does not fit the environment.
    """

    def __init__(self, config: Config) -> None:
        torch.manual_seed(config.seed)
        self.config, self.policy, self.num_timesteps = config, cast(RatedPolicy, make_policy(config)), 0
        self._optimizer = torch.optim.Adam(self.policy.parameters(), eps=1e-6, fused=True)
        self._layouts = make_vector(config, config.n_envs // config.rating.kept)
        self._envs = make_vector(config, config.n_envs, autoreset_mode="Disabled")

    def close(self) -> None:
        """Closes the environments."""
        self._layouts.close()
        self._envs.close()

    def seed(self, seed: int) -> None:
        """Seeds all random numbers, so that a run from a checkpoint gives the same results."""
        set_random_seed(seed)
        self._layouts.reset(seed=seed)
        self._envs.reset(seed=seed)

    def update(self) -> list[bool]:
        """Plays a shot in each environment and fits the ratings to the outcomes.

        Returns:
            Whether each shot is a success.
        """
        rating, game = self.config.rating, self.policy.game
        observations, _ = self._layouts.reset()
        played: Any = self._layouts.unwrapped
        options = {"positions": played.positions.repeat(rating.kept, axis=0)}
        if len(game.goals):
            options["goal"] = played.goals[:, 0].repeat(rating.kept, axis=0)
        self._envs.reset(options=options)
        actions, inputs = self.policy.draw(torch.as_tensor(observations), rating.drawn, rating.kept)
        last, _, _, _, infos = self._envs.step(actions.numpy())
        reached = infos["is_success"]
        if len(game.goals):
            touched = infos["potted"][:, 1:].any(1) if TASKS[game.task].pots_any_ball else infos["first_hit"] > 0
            reached = touched & ~infos["potted"][:, 0]
        rest = last[:, :2] * np.array(game.scene.half_extents, np.float32)
        self._fit(inputs, torch.as_tensor(reached), torch.as_tensor(rest))
        self.num_timesteps += len(reached)
        return infos["is_success"].tolist()

    def _fit(self, inputs: Inputs, reached: torch.Tensor, rest: torch.Tensor) -> None:
        """Makes one pass over the played candidates; for the arguments see `RatedPolicy.loss`."""
        share, rating = min(self.num_timesteps / self.config.timesteps, 1.0), self.config.rating
        for group in self._optimizer.param_groups:
            group["lr"] = rating.learning_rate * 0.5 * (1.0 + math.cos(math.pi * share))
        for rows in torch.randperm(len(reached)).split(rating.batch_size):
            loss = self.policy.loss(Inputs(*(part[rows] for part in inputs)), reached[rows], rest[rows])
            self._optimizer.zero_grad()
            loss.backward()
            nn.utils.clip_grad_norm_(self.policy.parameters(), _LONGEST)
            self._optimizer.step()

    def save(self, file: io.BytesIO) -> None:
        """Writes the weights of the policy and of the optimizer, as Stable-Baselines3 does."""
        parts = {"policy": self.policy.state_dict(), "policy.optimizer": self._optimizer.state_dict()}
        save_to_zip_file(file, params=parts)

    def set_parameters(self, parameters: Mapping[str, Any], device: str) -> None:
        """Sets the weights to those of a file that `save` has written.

        Raises:
            KeyError, RuntimeError, ValueError: If the weights belong to another policy.
        """
        self.policy.load_state_dict(parameters["policy"])
        self._optimizer.load_state_dict(parameters["policy.optimizer"])
