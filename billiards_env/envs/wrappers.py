"""Wrappers of `Billiards-v0`: action frames for single and vector environments.

`ActionFrame(gym.make("Billiards-v0"), "cut")` and `VectorActionFrame(gym.make_vec("Billiards-v0", 64), "cut")` play the
same shots for the same actions, bit for bit.
"""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.utils import RecordConstructorArgs
from gymnasium.vector import VectorActionWrapper, VectorEnv
from numpy.typing import ArrayLike, NDArray

from billiards_env.checks import finite
from billiards_env.envs.action_frames import ActionTransform
from billiards_env.envs.actions import ACTIONS
from billiards_env.envs.billiards import BilliardsEnv
from billiards_env.envs.vector import BilliardsVectorEnv

Floats = NDArray[np.float64]


class ActionFrame(gym.ActionWrapper[Any, Any, Any], RecordConstructorArgs):
    """Changes the meaning of the actions from velocities to directions, cut angles and speeds.

    The action space does not change. Actions outside it are clipped. With `action="strike"` the frame changes the first
    two numbers.

    Args:
        env: A `BilliardsEnv`, wrapped or not.
        frame: "cut" or "sum_to_three", see `billiards_env.envs.action_frames`.
        ball: The target ball of "cut" and "sum_to_three". It is chosen from the balls of the task that are in play:
            "nearest" is the ball nearest to the cue ball, and "first" is the ball with the lowest number. A number is
            that ball, or "first" once it is potted.
        least_speed: Speed of the slowest shot of "cut", m/s.

    Raises:
        ValueError: If a name is unknown, the ball does not exist, or a speed does not fit the environment's
            `max_speed`.

    Example:
        >>> env = ActionFrame(gym.make("billiards_env:Billiards-v0", layout="line"), "cut")
        >>> observation, info = env.reset()
        >>> *_, info = env.step([0.0, -0.5])  # full hit
        >>> int(info["first_hit"])
        1
    """

    def __init__(
        self, env: gym.Env[Any, Any], frame: str, ball: str | int = "nearest", least_speed: float = 0.4
    ) -> None:
        RecordConstructorArgs.__init__(self, frame=frame, ball=ball, least_speed=least_speed)
        super().__init__(env)
        self._game: Any = _game(env)
        self._frame = ActionTransform(
            frame, self._game.scene, self._game.model.targets, self._game.max_speed, ball, least_speed
        )

    def action(self, action: ArrayLike) -> Floats:
        """Returns the action of the wrapped environment for an action in this frame.

        Raises:
            ValueError: If the action does not have the shape of the action space, or a number is not finite.
        """
        game = self._game
        array = finite("action", action, (ACTIONS[game.action],))
        velocity = self._frame.velocities(array[:2], game.positions, game.potted) / game.max_speed
        return np.concatenate((velocity, array[2:]))


class VectorActionFrame(VectorActionWrapper):
    """`ActionFrame` for a vector environment, with the same arguments and errors.

    `env` is a `BilliardsVectorEnv`, or a `SyncVectorEnv` of `BilliardsEnv` with the same arguments; wrapped or not.
    """

    def __init__(self, env: VectorEnv, frame: str, ball: str | int = "nearest", least_speed: float = 0.4) -> None:
        super().__init__(env)
        game = _game(env)
        self._max_speed = game.max_speed
        self._shape = self.num_envs, ACTIONS[game.action]
        self._frame = ActionTransform(frame, game.scene, game.model.targets, game.max_speed, ball, least_speed)

    def actions(self, actions: ArrayLike) -> Floats:
        """Returns the actions of the wrapped environment for actions in this frame.

        Raises:
            ValueError: If the actions do not have the shape of the action space, or a number is not finite.
        """
        positions, potted = _each(self.env, "positions"), _each(self.env, "potted")
        array = finite("actions", actions, self._shape)
        velocities = self._frame.velocities(array[:, :2], positions, potted) / self._max_speed
        return np.concatenate((velocities, array[:, 2:]), axis=1)


def _game(env: gym.Env[Any, Any] | VectorEnv) -> BilliardsEnv:
    """Returns a single environment with the arguments of all environments, without wrappers."""
    base: Any = env.unwrapped
    if hasattr(base, "get_attr"):  # a vector environment
        base = base.get_attr("unwrapped")[0]
    if not isinstance(base, BilliardsEnv):
        raise TypeError(f"env = {env}: expected the environment Billiards-v0")
    return base


def _each(envs: VectorEnv, name: str) -> NDArray[Any]:
    """Returns an attribute of all environments, stacked along a first axis."""
    base: Any = envs.unwrapped
    return getattr(base, name) if isinstance(base, BilliardsVectorEnv) else np.stack(base.get_attr(name))
