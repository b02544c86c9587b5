"""Policies that learn in an action frame and play in the plain environment."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, cast

import gymnasium as gym
import numpy as np
from stable_baselines3.common.policies import ActorCriticPolicy

from agents.config import ENV_ID
from agents.policy import GeometryPolicy
from billiards_env.envs import BilliardsEnv
from billiards_env.envs.action_frames import ActionTransform


class FramePolicy(ActorCriticPolicy):
    """A policy whose training actions are in an action frame, and whose `predict` returns actions of `Billiards-v0`.

    `predict` finds the balls in the observation. So a saved model plays in `gym.make("Billiards-v0", **env)` without a
    wrapper.

    Args:
        args: Positional arguments of `ActorCriticPolicy`.
        env: Arguments of `gym.make("Billiards-v0", ...)`.
        frame: The fields of `agents.config.Frame`.
        kwargs: Keyword arguments of `ActorCriticPolicy`.
    """

    def __init__(self, *args: Any, env: Mapping[str, Any], frame: Mapping[str, Any], **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        game = cast(BilliardsEnv, gym.make(ENV_ID, **env).unwrapped)
        self._half = np.array([game.scene.table.length, game.scene.table.width]) / 2
        self._n_balls, self._max_speed = game.scene.n_balls, game.max_speed
        others = {key: value for key, value in frame.items() if key != "name"}
        self._frame = ActionTransform(frame["name"], game.scene, game.targets, game.max_speed, **others)

    def predict(self, observation: Any, *args: Any, **kwargs: Any) -> tuple[np.ndarray, tuple[np.ndarray, ...] | None]:
        """Returns the actions of the plain environment for observations, see `ActorCriticPolicy.predict`."""
        actions, state = super().predict(observation, *args, **kwargs)
        observed = np.asarray(observation, np.float64)[..., : 2 * self._n_balls]
        balls = observed.reshape(*observed.shape[:-1], self._n_balls, 2)
        potted = np.abs(balls).max(axis=-1) >= 1.0  # the centre of a ball in play is never on a cushion line
        velocities = self._frame.velocities(actions, balls * self._half, potted)
        return (velocities / self._max_speed).astype(np.float32), state


class GeometryFramePolicy(FramePolicy, GeometryPolicy):
    """A `GeometryPolicy` whose `predict` returns actions of `Billiards-v0`."""
