"""A policy for Stable-Baselines3 that learns to aim from the positions of the balls."""

from __future__ import annotations

import functools
import json
from collections.abc import Callable, Mapping, Sequence
from os import PathLike
from typing import Any, cast

import gymnasium as gym
import numpy as np
import torch
from gymnasium import spaces
from numpy.typing import NDArray
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.type_aliases import PyTorchObs
from stable_baselines3.common.utils import LinearSchedule
from torch import Tensor

import billiards_env  # noqa: F401  (registers the environment)
from billiards_env.envs import BilliardsEnv
from billiards_env.envs.actions import action_named
from billiards_env.envs.arguments import plain
from billiards_env.envs.tasks import task_of
from billiards_env.envs.trials import Outcomes
from billiards_env.sb3.aim_network import ACTIVATIONS, OBSERVED, AimNetwork, Mixture
from billiards_env.support.checks import Range, finite, flag, integer, numbers, one_of, sequence, short

PPO_SETTINGS: dict[str, Any] = {
    "n_steps": 1,
    "batch_size": 512,
    "n_epochs": 3,
    "learning_rate": LinearSchedule(2e-3, 2e-5, 1.0),
    "gamma": 1.0,
    "gae_lambda": 1.0,
    "ent_coef": 0.03,
    "max_grad_norm": 5.0,
    "device": "cpu",
}
"""Arguments of `stable_baselines3.PPO` for 4096 environments."""

_WORLD = ("scene", "task", "action", "max_speed", "observe")
_UNITS, _MOST_SPEEDS = Range(2, 4096), 100
_NO_SCHEDULE = -1  # `AimPolicy.shots` of a policy whose standard deviations no schedule changes
_WORTH = 0.1  # the smallest value that divides an advantage

TURN = 0.1
"""The worth of another turn in a game, where a win is worth 1. Without it, policies that seldom pot play only safe."""


def find_game(env: Mapping[str, Any]) -> BilliardsEnv:
    """Returns an environment that describes the game: its scene, task and spaces. It must not be played.

    Args:
        env: Arguments of `gym.make("Billiards-v0", ...)`. Equal arguments return the same environment.

    Raises:
        ValueError: If an argument is invalid.
        TypeError: If an argument has the wrong type.
    """
    return _find_game(json.dumps(plain(env)))


@functools.lru_cache(maxsize=8)
def _find_game(env: str) -> BilliardsEnv:
    return cast(BilliardsEnv, gym.make("Billiards-v0", **json.loads(env)).unwrapped)


def arguments_of(env: BilliardsEnv) -> dict[str, Any]:
    """Returns arguments of `gym.make("Billiards-v0", ...)` that make an environment like `env`, without its noise."""
    used = {"scene": env.scene.to_dict(), "observe": env.observe, "goal_radius": env.goal_radius or None}
    return {**env.model.arguments, **used, **dict.fromkeys(("n_object_balls", "noise", "noise_seed", "scatter"))}


class GameSpace(spaces.Box):
    """A space of observations with the arguments of the environment that they come from.

    Stable-Baselines3 gives a policy only the spaces of its environment.

    Attributes:
        env: Arguments of `gym.make("Billiards-v0", ...)`, as in `AimPolicy`.
    """

    def __init__(self, space: spaces.Box, env: Mapping[str, Any]) -> None:
        super().__init__(space.low, space.high, space.shape, cast(Any, space.dtype))
        self.env = env


def by_value(log_prob: Tensor, values: Tensor) -> Tensor:
    """Returns `log_prob` (m,) with a gradient that is divided by `values` (m,), and then by the mean of these factors.

    Factors are at least 1 and at most 10 before they are divided by their mean. Tajwar et al. (2026, Maximum likelihood
    reinforcement learning, arXiv:2602.02710) divide by the mean return of several samples instead.
    """
    factor = 1.0 / values.detach().clamp(_WORTH, 1.0)
    factor = factor / factor.mean()
    return factor * log_prob + ((1.0 - factor) * log_prob).detach()


def keeps_turn(outcomes: Outcomes) -> NDArray[np.bool_]:
    """Returns whether the player of each tried shot (m,) of a game has the next shot."""
    return outcomes.infos["next_player"] == outcomes.infos["player"]


class AimPolicy(ActorCriticPolicy):
    """An actor and critic that aims at learned points next to the object balls, see `AimNetwork`.

    PPO of Stable-Baselines3 trains it without a callback. The policy counts the shots of its training. During the first
    shots its standard deviations and the weight of its entropy fall geometrically, from their first to their last
    values. Then they are constant. They change only between two rollouts. The count is saved with the weights.

    The gradient of the probability of an action is divided by the value of the layout. So the policy improves the mean
    logarithm of the success, in which difficult layouts count as much as easy ones. PPO normalizes its advantages, so
    the factors are divided by their mean.

    Args:
        observation_space, action_space, lr_schedule: As in `ActorCriticPolicy`.
        env: Arguments of `gym.make("Billiards-v0", ...)`. The weights fit any number of balls. None for those in a
            `GameSpace`, the observation space of `SameStepVecEnv`.
        observe: The features of the environment that the networks observe, with "positions": some of
            `aim_network.OBSERVED`. None for all of them that the environment has.
        points, speeds, hidden: As in `AimNetwork`.
        waves, goal_units, own_std, activation: As in `AimNetwork`.
        paths: Whether the logits also depend on how clear the paths of the balls are, see `diameter` of `AimNetwork`.
            All balls count with the radius of the cue ball.
        aim: As in `AimNetwork`; None for "ball" in the tasks that need pockets and "layout" in the others.
        exploration: The number of shots after which the next four arguments have their last values.
        std_speed: First and last standard deviation of the speed, over the largest.
        std_aim: First and last standard deviation of the point aimed at, m.
        std_tip: First and last standard deviation of side, top and elevation of a strike.
        entropy: First and last factor of the entropy, and so of PPO's `ent_coef`.

    Raises:
        ValueError: If an argument is wrong, the environment has no object ball, its actions are neither velocities nor
            strikes, `env` is not the environment of the
            training, the observation lacks a feature that the networks need, or a wrapper changes observations or
            actions. A wrapper such as `VecNormalize`, which keeps the observation space, is an error when the first
            observations come.

    Example:
        >>> from stable_baselines3 import PPO
        >>> from billiards_env.sb3 import AimPolicy, PPO_SETTINGS, SameStepVecEnv
        >>> envs = SameStepVecEnv(gym.make_vec("billiards_env:Billiards-v0", num_envs=1024))
        >>> model = PPO(AimPolicy, envs, **PPO_SETTINGS)
        >>> model.learn(2048).num_timesteps
        2048
    """

    shots: Tensor

    def __init__(
        self,
        observation_space: spaces.Space[Any],
        action_space: spaces.Space[Any],
        lr_schedule: Callable[[float], float],
        *,
        env: Mapping[str, Any] | None = None,
        observe: Sequence[str] | None = None,
        points: int = 16,
        speeds: Sequence[float] = (0.2, 0.4, 0.8),
        hidden: int = 192,
        aim: str | None = None,
        waves: int = 0,
        goal_units: int = 0,
        paths: bool = False,
        own_std: bool = False,
        activation: str = "relu",
        exploration: int = 500_000,
        std_speed: Sequence[float] = (0.1, 0.03),
        std_aim: Sequence[float] = (0.025, 0.0015),
        std_tip: Sequence[float] = (0.2, 0.05),
        entropy: Sequence[float] = (1.0, 0.1),
        **kwargs: Any,
    ) -> None:
        for name, number in (("points", points), ("hidden", hidden)):
            integer(name, number, _UNITS)
        integer("waves", waves, Range(0, 16))
        integer("goal_units", goal_units, Range(0, 4096))
        flag("paths", paths)
        flag("own_std", own_std)
        one_of("activation", activation, tuple(ACTIVATIONS))
        integer("exploration", exploration, Range(1, None))
        borders = numbers("speeds", speeds)
        if borders.ndim != 1 or not 2 <= len(borders) <= _MOST_SPEEDS or not (np.diff(borders) > 0.0).all():
            raise ValueError(f"speeds = {short(speeds)}: expected from 2 to {_MOST_SPEEDS} numbers in ascending order")
        self.schedules = {"std_speed": std_speed, "std_aim": std_aim, "std_tip": std_tip, "entropy": entropy}
        for name, ends in self.schedules.items():
            if min(finite(name, ends, (2,))) <= 0.0:
                raise ValueError(f"{name} = {short(ends)}: expected two positive numbers")
        carried = observation_space.env if isinstance(observation_space, GameSpace) else None
        env = carried if env is None else dict(env)
        if env is None:
            raise ValueError(
                "env = None: expected a SameStepVecEnv as the environment of the model, without a wrapper that changes "
                "the observations, or policy_kwargs={'env': arguments} with the arguments of gym.make"
            )
        self.game, self.env = find_game(env), env
        there = self.game if carried is None else find_game(carried)
        for name in _WORLD:
            if getattr(self.game, name) != (value := getattr(there, name)):
                raise ValueError(f"env: expected the arguments of the environment, whose {name} is {short(value)}")
        if action_named(self.game.action).converter is not None or any(self.game.model.n_numbers[1:]):
            raise ValueError(
                f"action = {self.game.action!r}, can_place = {self.game.can_place}, can_call = {self.game.can_call}: "
                "expected 'velocity' or 'strike', False and False, the policy has no other numbers"
            )
        if observation_space.shape != self.game.observation_space.shape:
            raise ValueError(
                f"env = {short(env)}: expected the arguments of the environment, whose observation has the shape "
                f"{observation_space.shape}, not {self.game.observation_space.shape}"
            )
        if action_space != self.game.action_space:
            raise ValueError(f"action_space = {action_space}: expected {self.game.action_space}, without a wrapper")
        if self.game.scene.n_balls < 2:
            raise ValueError(f"env = {short(env)}: expected an object ball, at which the policy aims")
        aim = aim or ("ball" if task_of(self.game.task, self.game.model.n_players).pockets else "layout")
        one_of("aim", aim, ("ball", "layout"))
        self.network: dict[str, Any] = {"points": points, "speeds": tuple(speeds), "hidden": hidden, "aim": aim}
        self.network |= {"waves": waves, "goal_units": goal_units, "paths": paths, "own_std": own_std}
        self.network["activation"] = activation
        seen = [name for name in OBSERVED if name in self.game.features]
        self.observe = seen if observe is None else list(sequence("observe", observe))
        for name in self.observe:
            one_of("observe of the policy", name, tuple(seen))
        if "positions" not in self.observe:
            raise ValueError(f"observe = {self.observe}: expected 'positions', at which the policy aims")
        self.exploration = exploration
        super().__init__(observation_space, action_space, lr_schedule, **kwargs)

    def _build(self, lr_schedule: Callable[[float], float]) -> None:
        features = {name: self.game.features[name] for name in self.observe}
        strikes = action_named(self.game.action).has_cue
        network = dict(self.network)
        diameter = 2.0 * self.game.scene.balls.radius[0] if network.pop("paths") else 0.0
        half_extents = self.game.scene.half_extents
        self.net = AimNetwork(half_extents, **network, features=features, strikes=strikes, diameter=diameter)
        self.register_buffer("shots", torch.zeros((), dtype=torch.int64))
        self.set_shots(0)
        self.optimizer = torch.optim.Adam(self.parameters(), lr=lr_schedule(1), eps=1e-5, fused=True)

    def set_shots(self, shots: int) -> None:
        """Sets the number of shots of the training, and the standard deviations and the entropy that belong to it."""
        self.shots.fill_(shots)
        self._follow_schedules()

    def end_schedules(self) -> None:
        """Keeps the standard deviations from now on, also in a saved policy: `agents.likelihood` learns them."""
        self.shots.fill_(_NO_SCHEDULE)

    def _follow_schedules(self) -> None:
        part = min(max(int(self.shots), 0) / self.exploration, 1.0)
        *std, self.entropy_factor = (first * (last / first) ** part for first, last in self.schedules.values())
        if self.shots != _NO_SCHEDULE:
            self.net.std.copy_(torch.tensor(std))

    def set_training_mode(self, mode: bool) -> None:
        """Sets the mode. PPO leaves the training mode after each update; this call then applies the schedules."""
        if self.training and not mode:
            self._follow_schedules()
        super().set_training_mode(mode)

    def seen(self, obs: PyTorchObs) -> dict[str, Tensor]:
        """Returns the features of observations that the networks observe, by name."""
        features = self.game.decode(obs)
        return {name: features[name] for name in self.observe}

    def mixtures_and_values(self, obs: PyTorchObs) -> tuple[Mixture, Tensor]:
        """Returns the mixtures and the values (m,) for observations."""
        return self.net(**self.seen(obs))

    def forward(self, obs: Tensor, deterministic: bool = False) -> tuple[Tensor, Tensor, Tensor]:
        """Returns actions (m, 2) or (m, 5), values (m, 1) and logarithms (m,) of densities, and counts the shots."""
        self._check_scale(obs)
        mixture, values = self.mixtures_and_values(obs)
        actions = mixture.mode() if deterministic else mixture.sample()
        self.shots += len(obs)
        return actions, values[:, None], mixture.log_prob(actions)

    def evaluate_actions(self, obs: PyTorchObs, actions: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Returns values (m, 1), logarithms (m,) of densities and entropies (m,); see the class for their gradients."""
        mixture, values = self.mixtures_and_values(obs)
        log_prob = by_value(mixture.log_prob(actions), values)
        return values[:, None], log_prob, self.entropy_factor * mixture.entropy()

    def predict_values(self, obs: PyTorchObs) -> Tensor:
        """Returns the values (m, 1)."""
        return self.net.values(**self.seen(obs))[:, None]

    def to_onnx(self, path: str | PathLike[str]) -> None:
        """Writes the networks as an ONNX file, which runs without PyTorch. Needs the extra `onnx`.

        The input `observation` is (m, size) float32, for any m. The outputs are `action`, the likeliest action (m, a),
        `value` (m,), and the attributes of `Mixture` by name. The standard deviations have a value for each Gaussian,
        and `turn` is (m,).

        Args:
            path: A name that ends in ".onnx".

        Raises:
            ModuleNotFoundError: If the extra is not installed.
            OSError: If the file cannot be written.
            ValueError: If the path has another suffix.
        """
        from billiards_env.sb3.onnx_file import to_onnx

        to_onnx(self, path)

    def returns(self, outcomes: Outcomes) -> NDArray[np.float64]:
        """Computes the returns (m,) of tried shots: the rewards plus, in unfinished episodes, the values afterwards.

        In a game another turn is worth `TURN`, and the value of a turn of the other player counts negative.
        """
        returns, on = outcomes.rewards.copy(), np.flatnonzero(~outcomes.terminated)
        if len(on):
            with torch.no_grad():
                values = self.predict_values(torch.as_tensor(outcomes.observations[on])).numpy()[:, 0]
            if self.game.model.n_players > 1:
                values = np.where(keeps_turn(outcomes)[on], TURN + values, -values)
            returns[on] += values
        return returns

    def best_places(self, places: NDArray[np.float64], **seen: Tensor) -> NDArray[np.int64]:
        """Returns which of k places of a cue ball in hand has the largest value in each of m layouts, (m,).

        Args:
            places: (m, k, 2) m.
            seen: The features that the networks observe, by name.
        """
        m, k = places.shape[:2]
        seen = {name: feature.repeat_interleave(k, 0) for name, feature in seen.items()}
        seen["positions"][:, 0] = torch.from_numpy(places / np.array(self.game.scene.half_extents)).flatten(0, 1)
        if "in_hand" in seen:
            seen["in_hand"].zero_()
        with torch.no_grad():
            return self.net.values(**seen).reshape(m, k).argmax(1).numpy()

    def get_distribution(self, obs: PyTorchObs) -> Mixture:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Returns the mixtures."""
        return self.mixtures_and_values(obs)[0]

    def _predict(self, observation: PyTorchObs, deterministic: bool = False) -> Tensor:
        self._check_scale(cast(Tensor, observation))
        mixture = self.get_distribution(observation)
        return mixture.mode() if deterministic else mixture.sample()

    def _check_scale(self, obs: Tensor) -> None:
        """Raises a ValueError if observations are outside their space, with a margin for overlaps in PIT."""
        if bool((obs.abs() > 1.1).any()):
            raise ValueError(
                f"observations up to {obs.abs().max().item():.3g}: expected those of the environment, from -1 to 1; a "
                "wrapper such as VecNormalize rescales them"
            )

    def _get_constructor_parameters(self) -> dict[str, Any]:
        own = {"env": self.env, "observe": self.observe, **self.network}
        own |= {"exploration": self.exploration, **self.schedules}
        return super()._get_constructor_parameters() | own
