"""Wrappers of `Billiards-v0`: action frames and execution noise, for single and vector environments.

`ActionFrame(gym.make("Billiards-v0"), "cut")` and `VectorActionFrame(gym.make_vec("Billiards-v0", 64), "cut")` play the
same shots for the same actions, bit for bit. `ExecutionNoise` and `VectorExecutionNoise` add the same noise for the
same seeds. Noise is added to velocities, so an action frame must be the outer wrapper:
`ActionFrame(ExecutionNoise(env), "cut")`.
"""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.utils import RecordConstructorArgs
from gymnasium.vector import AutoresetMode, VectorActionWrapper, VectorEnv, VectorWrapper
from numpy.typing import ArrayLike, NDArray

from billiards_env.checks import finite, integer, real
from billiards_env.envs.action_frames import ActionTransform
from billiards_env.envs.actions import ACTIONS, ELEVATION, SIDE, SPEED, TOP, TURN, perturb
from billiards_env.envs.billiards import BilliardsEnv
from billiards_env.envs.vector import BilliardsVectorEnv
from billiards_env.frozen import NOISE

Floats = NDArray[np.float64]

_AHEAD = 16  # number of shots for which the noise of an environment is drawn at once


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
            frame, self._game.scene, self._game.targets, self._game.max_speed, ball, least_speed
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
        self._frame = ActionTransform(frame, game.scene, game.targets, game.max_speed, ball, least_speed)

    def actions(self, actions: ArrayLike) -> Floats:
        """Returns the actions of the wrapped environment for actions in this frame.

        Raises:
            ValueError: If the actions do not have the shape of the action space, or a number is not finite.
        """
        positions, potted = _each(self.env, "positions"), _each(self.env, "potted")
        array = finite("actions", actions, self._shape)
        velocities = self._frame.velocities(array[:, :2], positions, potted) / self._max_speed
        return np.concatenate((velocities, array[:, 2:]), axis=1)


class ExecutionNoise(gym.Wrapper[Any, Any, Any, Any], RecordConstructorArgs):
    """Adds Gaussian noise to each shot, as an inaccurate player does.

    The noise is added to the direction and the speed and, with `action="strike"`, also to the offsets of the tip and
    the elevation. The defaults come from the pool tournaments at the Computer Olympiad (Smith 2007, PickPocket: A
    computer billiards shark). The speed stays between 0 and `max_speed`. A shot of speed 0 stays at speed 0. An action
    is clipped before the noise is added, so an action outside of the action space has the noise of its clipped shot.

    `reset(seed=...)` also seeds the noise. The noise has a separate random stream, so it does not change the layouts.
    Anyone who has the seed can compute the noise beforehand, unless `noise_seed` is secret.

    Args:
        env: A `BilliardsEnv`, wrapped or not.
        angle_std: Standard deviation of the direction, degrees.
        speed_std: Standard deviation of the speed, m/s.
        offset_std: Standard deviation of both offsets of the tip, m.
        elevation_std: Standard deviation of the elevation, degrees.
        noise_seed: Another seed; if it is not None, the noise is a function of both seeds.

    Raises:
        ValueError: If a standard deviation is negative or not finite, or a seed is not a whole number.
    """

    def __init__(
        self,
        env: gym.Env[Any, Any],
        angle_std: float = 0.125,
        speed_std: float = 0.075,
        offset_std: float = 0.0005,
        elevation_std: float = 0.1,
        noise_seed: int | None = None,
    ) -> None:
        RecordConstructorArgs.__init__(
            self,
            angle_std=angle_std,
            speed_std=speed_std,
            offset_std=offset_std,
            elevation_std=elevation_std,
            noise_seed=noise_seed,
        )
        super().__init__(env)
        self._scales = _scales(_game(env), angle_std, speed_std, offset_std, elevation_std)
        self._noise_seed = None if noise_seed is None else integer("noise_seed", noise_seed, "seed")
        self._stream = _stream(None)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begins an episode. A seed seeds the environment and the noise."""
        result = self.env.reset(seed=seed, options=options)
        if seed is not None:
            self._stream = _stream(seed, self._noise_seed)
        return result

    def step(self, action: ArrayLike) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Plays the shot `action` with noise."""
        return self.env.step(perturb(action, self._stream.standard_normal(len(self._scales)) * self._scales))


class VectorExecutionNoise(VectorWrapper):
    """`ExecutionNoise` for a vector environment, with the same arguments and errors.

    `env` is that of `VectorActionFrame`. Each environment has a separate random stream.
    """

    def __init__(
        self,
        env: VectorEnv,
        angle_std: float = 0.125,
        speed_std: float = 0.075,
        offset_std: float = 0.0005,
        elevation_std: float = 0.1,
        noise_seed: int | None = None,
    ) -> None:
        super().__init__(env)
        self._scales = _scales(_game(env), angle_std, speed_std, offset_std, elevation_std)
        self._noise_seed = None if noise_seed is None else integer("noise_seed", noise_seed, "seed")
        self._streams = [_stream(None) for _ in range(self.num_envs)]
        self.autoreset_mode = self.metadata.get("autoreset_mode")  # TorchRL reads this attribute
        self._over = np.zeros(self.num_envs, np.bool_)
        # Noise for several shots is drawn at once: a draw from each of many streams takes longer than the shots.
        self._drawn = np.empty((self.num_envs, _AHEAD, len(self._scales)))
        self._used = np.full(self.num_envs, _AHEAD)

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begins episodes. Seeds seed the environments and the noise."""
        if isinstance(seed, np.integer):
            seed = int(seed)
        chosen = np.ones(self.num_envs, np.bool_)
        if options is not None and "reset_mask" in options:
            chosen = np.array(options["reset_mask"])  # a copy: SyncVectorEnv removes it from the options
        result = self.env.reset(seed=seed, options=options)  # pyright: ignore[reportArgumentType]
        seeds = [seed + i for i in range(self.num_envs)] if isinstance(seed, int) else seed
        for i, one in enumerate(seeds or ()):
            if one is not None and chosen[i]:
                self._streams[i] = _stream(one, self._noise_seed)
                self._used[i] = _AHEAD
        self._over[chosen] = False
        return result

    def step(self, actions: ArrayLike) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Plays the shots `actions` with noise."""
        noise = np.zeros((self.num_envs, len(self._scales)))
        playing = np.flatnonzero(~self._over)  # this step resets the others and plays no shot there
        for i in playing[self._used[playing] == _AHEAD].tolist():
            self._drawn[i] = self._streams[i].standard_normal(self._drawn.shape[1:])
            self._used[i] = 0
        noise[playing] = self._drawn[playing, self._used[playing]]
        self._used[playing] += 1
        result = self.env.step(perturb(actions, noise * self._scales))
        if self.autoreset_mode == AutoresetMode.NEXT_STEP:
            self._over = result[2] | result[3]
        return result


def noisy_env(noise_seed: int | None = None, **arguments: Any) -> ExecutionNoise:
    """Returns the environment of a frozen task with noise. The other arguments are as in `BilliardsEnv`."""
    return ExecutionNoise(BilliardsEnv(**arguments), **NOISE, noise_seed=noise_seed)


def noisy_vector_env(noise_seed: int | None = None, **arguments: Any) -> VectorExecutionNoise:
    """Returns the vector environment of a frozen task with noise. See `noisy_env`."""
    return VectorExecutionNoise(BilliardsVectorEnv(**arguments), **NOISE, noise_seed=noise_seed)


noisy_env.metadata = BilliardsEnv.metadata  # pyright: ignore[reportFunctionMemberAccess]  # `gym.make` reads it


def _scales(game: BilliardsEnv, angle_std: float, speed_std: float, offset_std: float, elevation_std: float) -> Floats:
    """Returns the standard deviations of the noise of `perturb`, after a check."""
    scales = np.empty(5)
    scales[TURN] = real("angle_std", angle_std, "angle_std") / 180.0
    scales[SPEED] = real("speed_std", speed_std, "speed_std") / game.max_speed
    edge = game.scene.cue.miscue_offset * game.scene.balls.radius[0]
    scales[SIDE] = scales[TOP] = real("offset_std", offset_std, "offset_std") / edge
    scales[ELEVATION] = real("elevation_std", elevation_std, "angle_std") / 90.0
    return scales[: ACTIONS[game.action]]


def _stream(seed: int | None, noise_seed: int | None = None) -> np.random.Generator:
    """Returns a random stream that is independent of the layouts of an environment with the same seed."""
    key = (0,) if noise_seed is None else (0, noise_seed)
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=key))


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
