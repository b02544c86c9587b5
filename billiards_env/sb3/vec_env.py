"""An adapter from vector environments of Gymnasium to the interface of Stable-Baselines3."""

from __future__ import annotations

import time
import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode, VectorEnv, VectorWrapper
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices, VecEnvStepReturn

from billiards_env.envs import BilliardsEnv
from billiards_env.sb3.aim_policy import GameSpace, arguments_of
from billiards_env.support.checks import short


class SameStepVecEnv(VecEnv):
    """A Gymnasium vector environment with same-step autoreset as a `VecEnv` of Stable-Baselines3.

    Stable-Baselines3 has one `info` dict for each environment and step. To save time, the dict of a step is empty
    unless its episode is finished. It then has `terminal_observation`, `TimeLimit.truncated`, `episode` and, if the
    environment has it, `is_success`. `episode` has the entries of `Monitor`: "r", the return of the episode, "l", its
    length, and "t", the seconds since the adapter was created. (`VecMonitor` is slower than the shots, so it is not
    used.) All infos of the last step are in `infos`, in Gymnasium's format.

    The environments are one object: an attribute is set in all of them, and a method is called for all of them. The
    attributes and methods are those of the outermost wrapper that adds one of this name, such as `Opponents.policy`,
    and otherwise those of the environment without wrappers. A wrapper has one value for all environments.

    The `observation_space` of `Billiards-v0` is a `GameSpace`, from which `AimPolicy` gets the table, the balls and the
    task. A wrapper that changes the observations also changes the space, which then is no `GameSpace`.

    A game of several players without `Opponents` warns, because the rewards of a learner then belong to all players.

    Attributes:
        envs: The vector environment.
        infos: The `infos` of the last step.
    """

    def __init__(self, envs: VectorEnv[Any, Any, Any]) -> None:
        mode = envs.metadata.get("autoreset_mode")
        if mode is not AutoresetMode.SAME_STEP:
            raise ValueError(f"envs reset in the mode {mode}: expected {AutoresetMode.SAME_STEP}")
        self.envs = envs
        self.infos: dict[str, Any] = {}
        self._actions: np.ndarray | None = None
        self._returns, self._lengths = np.zeros(envs.num_envs), np.zeros(envs.num_envs, np.int64)
        self._begun = time.perf_counter()
        super().__init__(envs.num_envs, envs.single_observation_space, envs.single_action_space)
        self.metadata = {**envs.metadata, **self.metadata}
        game = getattr(envs.unwrapped, "single_env", None)
        space = self.observation_space
        if isinstance(game, BilliardsEnv) and game.observation_space is space and isinstance(space, Box):
            self.observation_space = GameSpace(space, arguments_of(game))
        if isinstance(game, BilliardsEnv) and game.n_players > 1 and self._wrapper("seats") is None:
            warnings.warn(
                f"envs with n_players = {game.n_players}: expected Opponents(envs, policy), where one player learns; "
                "these rewards are those of the player who shoots",
                stacklevel=2,
            )

    def reset(self) -> np.ndarray:
        """Resets all environments with the seeds and options that were set since the last reset.

        Raises:
            ValueError: If the environments have different options, or the vector environment rejects an option.
        """
        options = _stacked("options", self._options) if any(self._options) else None
        # Without a seed the environments continue their random streams.
        observations, infos = self.envs.reset(seed=self._seeds, options=options)  # pyright: ignore[reportArgumentType]
        arrays = {key: values for key, values in infos.items() if isinstance(values, np.ndarray) and f"_{key}" in infos}
        self.reset_infos = [
            {key: values[i] for key, values in arrays.items() if infos[f"_{key}"][i]} for i in range(self.num_envs)
        ]
        self._returns[:], self._lengths[:] = 0.0, 0
        self._reset_seeds()
        self._reset_options()
        return observations

    def step_async(self, actions: np.ndarray) -> None:
        """Stores the actions for `step_wait`."""
        self._actions = actions

    def step_wait(self) -> VecEnvStepReturn:
        """Plays a step and returns observations, rewards, dones and infos; see the class."""
        observations, rewards, terminated, truncated, self.infos = self.envs.step(self._actions)
        dones = terminated | truncated
        self._returns += rewards
        self._lengths += 1
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        done = np.flatnonzero(dones)
        if len(done):
            final, now = self.infos["final_info"], round(time.perf_counter() - self._begun, 6)
            columns = (
                self.infos["final_obs"][done],
                (truncated & ~terminated)[done],
                self._returns[done],
                self._lengths[done],
            )
            self._returns[done], self._lengths[done] = 0.0, 0
            rows = [
                {
                    "terminal_observation": last,
                    "TimeLimit.truncated": cut,
                    "episode": {"r": total, "l": length, "t": now},
                }
                for last, cut, total, length in zip(*(column.tolist() for column in columns), strict=True)
            ]
            if "is_success" in final:
                for row, value in zip(rows, final["is_success"][done].tolist(), strict=True):
                    row["is_success"] = value
            for i, row in zip(done.tolist(), rows, strict=True):
                infos[i] = row
        return observations, rewards.astype(np.float32), dones, infos  # pyright: ignore[reportReturnType]

    def close(self) -> None:
        """Closes the environments."""
        self.envs.close()

    def get_images(self) -> list[np.ndarray | None]:
        """Returns the frame of each environment, (height, width, 3) uint8, in the render mode "rgb_array".

        Raises:
            ResetNeeded: If the environments have not been reset.
        """
        if self.render_mode != "rgb_array":
            warnings.warn(f"render_mode = {self.render_mode!r}: expected 'rgb_array' for images", stacklevel=2)
            return [None] * self.num_envs
        images: Any = self.envs.render()
        if images[0] is None:
            raise ResetNeeded("The episodes have not begun: call reset() before render()")
        return list(images)

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """Returns an attribute of the environments of the indices."""
        wrapper = self._wrapper(attr_name)
        values = self._all.get_attr(attr_name) if wrapper is None else [getattr(wrapper, attr_name)] * self.num_envs
        return [values[i] for i in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Sets an attribute of all environments.

        Raises:
            ValueError: If `indices` does not contain all environments.
        """
        self._expect_all(f"set_attr({attr_name!r})", indices)
        if (wrapper := self._wrapper(attr_name)) is not None:
            setattr(wrapper, attr_name, value)
        else:
            self._all.set_attr(attr_name, [value] * self.num_envs)

    def env_method(self, method_name: str, *args: Any, indices: VecEnvIndices = None, **kwargs: Any) -> list[Any]:
        """Calls a method of all environments and returns the results of those of the indices.

        Raises:
            ValueError: If the method changes a `BilliardsEnv`.
        """
        if (wrapper := self._wrapper(method_name)) is not None:
            results = [getattr(wrapper, method_name)(*args, **kwargs)] * self.num_envs
        else:
            results = self._all.call(method_name, *args, **kwargs)
        return [results[i] for i in self._get_indices(indices)]

    def env_is_wrapped(self, wrapper_class: type[gym.Wrapper], indices: VecEnvIndices = None) -> list[bool]:
        """Returns for each index whether the adapter does the work of a wrapper: True for `Monitor`."""
        return [issubclass(Monitor, wrapper_class) for _ in self._get_indices(indices)]

    def _wrapper(self, name: str) -> Any:
        """Returns the outermost wrapper that adds an attribute of a name; None if none does."""
        env = self.envs
        while isinstance(env, VectorWrapper):
            if hasattr(env, name) and not hasattr(VectorWrapper, name):
                return env
            env = env.env
        return None

    @property
    def _all(self) -> Any:
        """The vector environment without wrappers, with the methods `get_attr`, `set_attr` and `call`."""
        return self.envs.unwrapped

    def _expect_all(self, call: str, indices: VecEnvIndices) -> None:
        given = sorted(set(self._get_indices(indices)))
        if given != list(range(self.num_envs)):
            raise ValueError(f"{call} for environments {given}: expected all {self.num_envs}, which are one object")


def _stacked(name: str, options: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Returns the options of all environments with each value stacked; the values of "physics" are mappings, too."""
    if len({frozenset(option) for option in options}) > 1:
        raise ValueError(f"{name} = {short(options)}: expected the same keys for every environment")
    stacked = {}
    for key, first in options[0].items():
        values = [option[key] for option in options]
        stacked[key] = _stacked(f"{name}[{key!r}]", values) if isinstance(first, Mapping) else np.stack(values)
    return stacked
