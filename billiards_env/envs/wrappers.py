"""Wrappers of `Billiards-v0`: action frames and execution noise, for one environment and for many at once.

`ActionFrame(gym.make("Billiards-v0"), "cut")` and `VectorActionFrame(gym.make_vec("Billiards-v0", 64), "cut")` give the
same shots for the same actions bit for bit, as do `ExecutionNoise` and `VectorExecutionNoise` for the same seeds. Noise
acts on velocities, so a frame goes around it: `ActionFrame(ExecutionNoise(env), "cut")`.
"""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.utils import RecordConstructorArgs
from gymnasium.vector import AutoresetMode, VectorActionWrapper, VectorEnv, VectorWrapper
from numpy.typing import ArrayLike, NDArray

from billiards_env.checks import real
from billiards_env.envs.action_frames import ActionTransform, perturb

Floats = NDArray[np.float64]

_AHEAD = 16  # shots of an environment for which noise is drawn at once


class ActionFrame(gym.ActionWrapper[Any, Any, Any], RecordConstructorArgs):
    """Takes actions in another frame than the velocity's components.

    The action space stays `Box(-1, 1, (2,), float32)`, and every action in it is a shot; what lies outside is clipped.

    Args:
        env: A `BilliardsEnv`, wrapped or not.
        frame: "polar", "cut" or "sum_to_three", see `billiards_env.envs.action_frames`.
        ball: The ball that "cut" and "sum_to_three" aim at: the "nearest" to the cue ball of the task's balls still in
            play, the "first" of them in their order, or a ball by its number, and once that is potted the first.
        least_speed: The slowest shot of "polar" and "cut", m/s.

    Raises:
        ValueError: If a name is unknown, there is no such ball, or the speeds do not fit the environment's `max_speed`.

    Example:
        >>> env = ActionFrame(gym.make("billiards_env:Billiards-v0", layout="line"), "cut")
        >>> observation, info = env.reset()
        >>> *_, info = env.step([0.0, -0.5])  # a full hit
        >>> info["first_hit"]
        1
    """

    def __init__(
        self, env: gym.Env[Any, Any], frame: str, ball: str | int = "nearest", least_speed: float = 0.4
    ) -> None:
        RecordConstructorArgs.__init__(self, frame=frame, ball=ball, least_speed=least_speed)
        super().__init__(env)
        self._game: Any = env.unwrapped
        self._frame = ActionTransform(
            frame, self._game.scene, self._game.targets, self._game.max_speed, ball, least_speed
        )

    def action(self, action: ArrayLike) -> Floats:
        """(2,) the environment's own action for one in this frame.

        Raises:
            ValueError: If the action is not two finite numbers.
        """
        game = self._game
        return self._frame.velocities(action, game.positions, game.potted) / game.max_speed


class VectorActionFrame(VectorActionWrapper):
    """`ActionFrame` for a vector environment.

    Args:
        env: A vector environment of like `BilliardsEnv`: the native one or a `SyncVectorEnv`.
        frame: As in `ActionFrame`.
        ball: As in `ActionFrame`.
        least_speed: As in `ActionFrame`.

    Raises:
        ValueError: As `ActionFrame` does.
    """

    def __init__(self, env: VectorEnv, frame: str, ball: str | int = "nearest", least_speed: float = 0.4) -> None:
        super().__init__(env)
        game = _game(env)
        self._max_speed = game.max_speed
        self._frame = ActionTransform(frame, game.scene, game.targets, game.max_speed, ball, least_speed)

    def actions(self, actions: ArrayLike) -> Floats:
        """(num_envs, 2) the environments' own actions for those in this frame.

        Raises:
            ValueError: If an action is not two finite numbers.
        """
        positions, potted = _each(self.env, "positions"), _each(self.env, "potted")
        return self._frame.velocities(actions, positions, potted) / self._max_speed


class ExecutionNoise(gym.Wrapper[Any, Any, Any, Any], RecordConstructorArgs):
    """A player who does not quite do what they meant to: Gaussian noise on each shot's direction and speed.

    The defaults are the noise of the Computer Olympiad's pool tournaments (Smith 2007, PickPocket: A computer billiards
    shark) in the two parameters of a shot that this environment has. The speed stays between 0 and `max_speed`; a shot
    of speed 0 is none, and stays so.

    `reset(seed=...)` seeds the noise too. It has a stream of its own, so the layouts are those without noise.

    Args:
        env: A `BilliardsEnv`, wrapped or not.
        angle_std: Standard deviation of the direction, degrees.
        speed_std: Standard deviation of the speed, m/s.

    Raises:
        ValueError: If a standard deviation is negative or not finite.
    """

    def __init__(self, env: gym.Env[Any, Any], angle_std: float = 0.125, speed_std: float = 0.075) -> None:
        RecordConstructorArgs.__init__(self, angle_std=angle_std, speed_std=speed_std)
        super().__init__(env)
        game: Any = env.unwrapped
        self._scales = _scales(angle_std, speed_std, game.max_speed)
        self._stream = _stream(None)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Starts an episode; a seed seeds the noise as well as the environment."""
        result = self.env.reset(seed=seed, options=options)
        if seed is not None:
            self._stream = _stream(seed)
        return result

    def step(self, action: ArrayLike) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Plays the shot that comes of `action`."""
        return self.env.step(perturb(action, *(self._stream.standard_normal(2) * self._scales)))


class VectorExecutionNoise(VectorWrapper):
    """`ExecutionNoise` for a vector environment; each environment has a stream of its own.

    Args:
        env: A vector environment of like `BilliardsEnv`: the native one or a `SyncVectorEnv`.
        angle_std: As in `ExecutionNoise`.
        speed_std: As in `ExecutionNoise`.

    Raises:
        ValueError: As `ExecutionNoise` does.
    """

    def __init__(self, env: VectorEnv, angle_std: float = 0.125, speed_std: float = 0.075) -> None:
        super().__init__(env)
        self._scales = _scales(angle_std, speed_std, _game(env).max_speed)
        self._streams = [_stream(None) for _ in range(self.num_envs)]
        self._waits = self.metadata.get("autoreset_mode") == AutoresetMode.NEXT_STEP
        self._over = np.zeros(self.num_envs, np.bool_)
        # Drawn ahead of time, as a draw from each of many streams takes longer than the shots do.
        self._drawn = np.empty((self.num_envs, _AHEAD, 2))
        self._used = np.full(self.num_envs, _AHEAD)

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Starts episodes; seeds seed the noise as well as the environments."""
        if isinstance(seed, np.integer):
            seed = int(seed)
        chosen = np.ones(self.num_envs, np.bool_)
        if options is not None and "reset_mask" in options:
            chosen = np.array(options["reset_mask"])  # before SyncVectorEnv takes it out of the options
        result = self.env.reset(seed=seed, options=options)  # pyright: ignore[reportArgumentType]
        seeds = [seed + i for i in range(self.num_envs)] if isinstance(seed, int) else seed
        for i, own in enumerate(seeds or ()):
            if own is not None and chosen[i]:
                self._streams[i] = _stream(own)
                self._used[i] = _AHEAD
        self._over[chosen] = False
        return result

    def step(self, actions: ArrayLike) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Plays the shots that come of `actions`."""
        noise = np.zeros((self.num_envs, 2))
        playing = np.flatnonzero(~self._over)  # where this step only resets there is no shot
        for i in playing[self._used[playing] == _AHEAD].tolist():
            self._drawn[i] = self._streams[i].standard_normal((_AHEAD, 2))
            self._used[i] = 0
        noise[playing] = self._drawn[playing, self._used[playing]]
        self._used[playing] += 1
        result = self.env.step(perturb(actions, *(noise * self._scales).T))
        if self._waits:
            self._over = result[2] | result[3]
        return result


def _scales(angle_std: float, speed_std: float, max_speed: float) -> Floats:
    """The standard deviations, checked, in half turns and shares of `max_speed`."""
    angle, speed = real("angle_std", angle_std, "angle_std"), real("speed_std", speed_std, "speed_std")
    return np.array([angle / 180.0, speed / max_speed])


def _stream(seed: int | None) -> np.random.Generator:
    """A stream that has nothing to do with the one from which the environment of that seed draws its layouts."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(0,)))


def _game(envs: VectorEnv) -> Any:
    """One of the environments, all of which have the same arguments."""
    base: Any = envs.unwrapped
    return base.single_env if hasattr(base, "single_env") else base.get_attr("unwrapped")[0]


def _each(envs: VectorEnv, name: str) -> NDArray[Any]:
    """An attribute of all the environments, with a leading axis."""
    base: Any = envs.unwrapped
    return np.stack(base.get_attr(name)) if hasattr(base, "get_attr") else getattr(base, name)
