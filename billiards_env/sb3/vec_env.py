"""An adapter from Gymnasium's vector environments to those of Stable-Baselines3."""

from __future__ import annotations

import time
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices, VecEnvStepReturn


class SameStepVecEnv(VecEnv):
    """A Gymnasium vector environment with same-step autoreset as a `VecEnv` of Stable-Baselines3.

    Stable-Baselines3 has one `info` dict for each environment and step. To save time, a dict is empty unless its
    episode is finished. It then has `terminal_observation`, `TimeLimit.truncated`, `episode` and, if the environment
    has it, `is_success`. `episode` has the entries of `VecMonitor`: "r", the return of the episode, "l", its length,
    and "t", the seconds since the adapter was created. (`VecMonitor` is slower than the shots, so it is not used.) All
    infos of the last step are in `infos`, in Gymnasium's format.

    All environments are one object: they share their attributes, and a method is called once for all of them.

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

    def reset(self) -> np.ndarray:
        """Resets all environments with the seeds and options that were set since the last reset.

        Raises:
            ValueError: If only some environments have options, or an option is not `positions`.
        """
        options = None
        if any(self._options):
            keys = {tuple(option) for option in self._options}
            if keys != {("positions",)}:
                raise ValueError(f"options = {self._options[:2]} ...: expected positions for every environment")
            options = {"positions": np.stack([option["positions"] for option in self._options])}
        # Without a seed the environments continue their random streams.
        observations, _ = self.envs.reset(seed=self._seeds, options=options)  # pyright: ignore[reportArgumentType]
        self.reset_infos = [{} for _ in range(self.num_envs)]
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

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """Returns an attribute of the vector environment or, if it has none, of its `single_env`, for each index."""
        owner = self._owner(attr_name)
        return [getattr(owner, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Sets an attribute of all environments.

        Raises:
            ValueError: If `indices` does not contain all environments.
        """
        self._expect_all(f"set_attr({attr_name!r})", indices)
        setattr(self._owner(attr_name), attr_name, value)

    def env_method(self, method_name: str, *args: Any, indices: VecEnvIndices = None, **kwargs: Any) -> list[Any]:
        """Calls a method of the vector environment or, if it has none, of its `single_env`.

        The result is repeated for each environment.

        Raises:
            ValueError: If `indices` does not contain all environments.
        """
        self._expect_all(f"env_method({method_name!r})", indices)
        result = getattr(self._owner(method_name), method_name)(*args, **kwargs)
        return [result] * self.num_envs

    def env_is_wrapped(self, wrapper_class: type[gym.Wrapper], indices: VecEnvIndices = None) -> list[bool]:
        """Returns False for each index: there are no single environments with wrappers."""
        return [False for _ in self._get_indices(indices)]

    def _owner(self, name: str) -> Any:
        envs: Any = self.envs.unwrapped
        single = getattr(envs, "single_env", None)
        return single if single is not None and hasattr(single, name) and not hasattr(envs, name) else envs

    def _expect_all(self, call: str, indices: VecEnvIndices) -> None:
        given = sorted(set(self._get_indices(indices)))
        if given != list(range(self.num_envs)):
            raise ValueError(f"{call} for environments {given}: expected all {self.num_envs}, which are one object")
