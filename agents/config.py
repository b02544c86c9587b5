"""The settings of a training, and how they are read from YAML and checked.

Every key must be a field of the dataclasses below, and every value must have the type of its field. The mapping `env`
holds the arguments of `gym.make("Billiards-v0", ...)`, whose signature its keys must match.
"""

from __future__ import annotations

import dataclasses
import inspect
import math
import types
import typing
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

import gymnasium as gym
import yaml
from gymnasium.envs.registration import load_env_creator

import billiards_env  # noqa: F401  (registers the environment)
from billiards_env.checks import choose, flag, number, short, whole

ENV_ID = "Billiards-v0"
HEADS = ("gaussian", "turned", "mixture", "bins", "hits", "pots")
ACTIVATIONS = ("tanh", "relu", "elu", "silu")


T = TypeVar("T")


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Noise:
    """The execution noise in training and evaluation: `billiards_env.envs.wrappers.ExecutionNoise`.

    Attributes:
        angle_std: Standard deviation of the direction, degrees.
        speed_std: Standard deviation of the speed, m/s.
        offset_std: Standard deviation of both offsets of the tip, m, with `action: strike`.
        elevation_std: Standard deviation of the elevation, degrees, with `action: strike`.
    """

    angle_std: float = 0.125
    speed_std: float = 0.075
    offset_std: float = 0.0005
    elevation_std: float = 0.1

    def __post_init__(self) -> None:
        for name in ("angle_std", "speed_std", "offset_std", "elevation_std"):
            at_least(f"noise.{name}", getattr(self, name), 0)


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Std:
    """A schedule of the two standard deviations of the policy.

    They fall geometrically from `first` to `last` in the first part of the training and then stay constant. With the
    head "gaussian" they are those of the velocity along x and y, over the largest speed. For the other heads see
    `agents.policy.MixturePolicy.set_std`.

    Attributes:
        first: The values before the training.
        last: The values after the first part.
        until: The length of the first part as a share of all steps.
    """

    first: tuple[float, ...]
    last: tuple[float, ...]
    until: float = 0.5

    def __post_init__(self) -> None:
        for name in ("first", "last"):
            values = getattr(self, name)
            if len(values) != 2 or min(values) <= 0:
                raise ValueError(f"policy.std.{name} = {short(list(values))}: expected two numbers > 0")
        if not 0 < self.until <= 1:
            raise ValueError(f"policy.std.until = {short(self.until)}: expected a number > 0, at most 1")

    def at(self, share: float) -> list[float]:
        """Returns the standard deviations after a share of all steps.

        Example:
            >>> Std(first=(0.4, 1.0), last=(0.1, 1.0), until=0.5).at(0.25)
            [0.2, 1.0]
        """
        part = min(share / self.until, 1.0)
        return [first * (last / first) ** part for first, last in zip(self.first, self.last, strict=True)]


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Policy:
    """The policy and value networks.

    Attributes:
        head: The part of the policy that computes its distribution: "gaussian", which is the policy of
            Stable-Baselines3, or one of `agents.policy.HEADS`.
        components: The number of components, see `agents.policy.MixturePolicy`; "gaussian" and "turned" ignore it.
        speeds: The smallest and the largest mean speed of a component, over the largest speed of the environment;
            "gaussian" and "pots" ignore it.
        banks: Whether "pots" finds banks also on tables with a direct pot; the other heads ignore it.
        hidden: The number of units of each hidden layer.
        activation: "tanh", "relu", "elu" or "silu".
        std: The schedule of the standard deviations; None if they are learned.
    """

    head: str = "gaussian"
    components: int = 1
    speeds: tuple[float, ...] = (0.1, 1.0)
    banks: bool = False
    hidden: tuple[int, ...] = (64, 64)
    activation: str = "tanh"
    std: Std | None = None

    def __post_init__(self) -> None:
        choose("policy.head", self.head, HEADS)
        at_least("policy.components", self.components, 1)
        if len(self.speeds) != 2 or not 0 < self.speeds[0] < self.speeds[1] <= 1:
            raise ValueError(
                f"policy.speeds = {short(list(self.speeds))}: expected two increasing numbers > 0, at most 1"
            )
        if not self.hidden:
            raise ValueError("policy.hidden = []: expected at least one hidden layer")
        choose("policy.activation", self.activation, ACTIVATIONS)
        for i, units in enumerate(self.hidden):
            at_least(f"policy.hidden[{i}]", units, 1)


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class PPO:
    """Settings of proximal policy optimisation (Schulman et al. 2017), named as in Stable-Baselines3.

    Attributes:
        n_steps: Steps of each environment between two updates.
        batch_size: Steps in a minibatch; must divide `n_envs * n_steps`.
        n_epochs: Passes over the steps in each update.
        learning_rate: Adam's step size at the start.
        final_learning_rate: Adam's step size at the end, reached linearly; None keeps `learning_rate`.
        gamma: Discount factor.
        gae_lambda: Trades bias for variance in the advantage (Schulman et al. 2016); 1 has no bias.
        clip_range: The largest distance from 1 of the ratio of new to old probability; the ratio is clipped to it.
        ent_coef: Weight of the entropy bonus.
        vf_coef: Weight of the value function's loss.
        max_grad_norm: The largest norm of a gradient; longer gradients are clipped.
        target_kl: An update stops if the divergence from the old policy exceeds 1.5 times this; None for no limit.
    """

    n_steps: int = 2048
    batch_size: int = 64
    n_epochs: int = 10
    learning_rate: float = 3e-4
    final_learning_rate: float | None = None
    gamma: float = 0.99
    gae_lambda: float = 0.95
    clip_range: float = 0.2
    ent_coef: float = 0.0
    vf_coef: float = 0.5
    max_grad_norm: float = 0.5
    target_kl: float | None = None

    def __post_init__(self) -> None:
        for name in ("n_steps", "n_epochs"):
            at_least(f"ppo.{name}", getattr(self, name), 1)
        at_least("ppo.batch_size", self.batch_size, 2)  # advantages are normalised within a minibatch
        for name in ("learning_rate", "final_learning_rate", "clip_range", "max_grad_norm", "target_kl"):
            value = getattr(self, name)
            if value is not None and value <= 0:
                raise ValueError(f"ppo.{name} = {short(value)}: expected a number > 0")
        for name in ("gamma", "gae_lambda"):
            value = getattr(self, name)
            if not 0 <= value <= 1:
                raise ValueError(f"ppo.{name} = {short(value)}: expected a number from 0 to 1")
        for name in ("ent_coef", "vf_coef"):
            at_least(f"ppo.{name}", getattr(self, name), 0)


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Imitation:
    """Supervised learning before PPO: the policy learns to prefer the best of the shots that a search tries.

    Attributes:
        layouts: The number of layouts.
        shots: The number of shots that the search tries on each layout.
        vary: Whether the search repeats pots with random speeds and, with `action: strike`, random offsets of the tip.
        batch_size: Layouts in a minibatch.
        n_epochs: Passes over the layouts.
        learning_rate: Adam's step size at the start; it falls linearly to a hundredth.
    """

    layouts: int
    shots: int = 20
    vary: bool = False
    batch_size: int = 1024
    n_epochs: int = 4
    learning_rate: float = 2e-3

    def __post_init__(self) -> None:
        for name in ("layouts", "shots", "batch_size", "n_epochs"):
            at_least(f"imitation.{name}", getattr(self, name), 1)
        flag("imitation.vary", self.vary)
        if self.learning_rate <= 0:
            raise ValueError(f"imitation.learning_rate = {short(self.learning_rate)}: expected a number > 0")


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Config:
    """A training run.

    Attributes:
        timesteps: The number of environment steps (shots), rounded up to whole updates; 0 for no PPO.
        env: Arguments of `gym.make("Billiards-v0", ...)`. Missing arguments have their defaults.
        start_from: The folder of a finished run. The training starts with its weights. None for new weights.
        imitation: Supervised learning before PPO; None for no supervised learning.
        noise: The execution noise; None for no noise.
        n_envs: The number of environments that are stepped together.
        seed: The seed of all random numbers; equal seeds give equal runs.
        checkpoint_every: Steps between two checkpoints, and between two points of the learning curve.
        evaluation_episodes: The number of episodes on new layouts that measure the policy at each point of the learning
            curve and in `agents.evaluate`.
        policy: The networks.
        ppo: The learning algorithm.
    """

    timesteps: int
    env: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    start_from: str | None = None
    imitation: Imitation | None = None
    noise: Noise | None = None
    n_envs: int = 64
    seed: int = 0
    checkpoint_every: int = 50_000
    evaluation_episodes: int = 1000
    policy: Policy = dataclasses.field(default_factory=Policy)
    ppo: PPO = dataclasses.field(default_factory=PPO)

    def __post_init__(self) -> None:
        for name, least in (("timesteps", 0), ("checkpoint_every", 1)):
            at_least(name, getattr(self, name), least)
        for name in ("n_envs", "evaluation_episodes"):
            whole(name, getattr(self, name), "num_envs")
        at_least("seed", self.seed, 0)
        if self.seed >= 2**32:  # a limit of Stable-Baselines3
            raise ValueError(f"seed = {short(self.seed)}: expected a number < 2**32")
        object.__setattr__(self, "env", resolved_env(self.env))
        rollout = self.n_envs * self.ppo.n_steps
        if rollout % self.ppo.batch_size:
            raise ValueError(
                f"ppo.batch_size = {self.ppo.batch_size}: expected a divisor of n_envs * ppo.n_steps = {rollout}"
            )

    def to_dict(self) -> dict[str, Any]:
        """Returns the configuration as plain data: dicts, lists, strings and numbers."""
        return _plain(dataclasses.asdict(self))

    def to_yaml(self) -> str:
        """Returns the configuration as YAML, with all defaults; `from_dict` reads it."""
        return yaml.safe_dump(self.to_dict(), sort_keys=False)

    def is_saved_as(self, data: Any) -> bool:
        """Returns whether `from_dict` reads this configuration from plain data."""
        try:
            return Config.from_dict(data) == self
        except (TypeError, ValueError):
            return False

    @classmethod
    def from_dict(cls, data: Any) -> Config:
        """Returns a configuration from plain data, for example from the content of a YAML file.

        Args:
            data: A mapping of the fields of `Config`. `imitation`, `noise`, `policy` and `ppo` are mappings themselves.

        Raises:
            ValueError: If a key is unknown or missing, or a value is impossible.
            TypeError: If a value has the wrong type.

        Example:
            >>> Config.from_dict({"timesteps": 1000, "ppo": {"n_step": 8}})
            Traceback (most recent call last):
            ValueError: key of ppo = 'n_step': expected one of ... (did you mean 'n_steps'?)
        """
        return read_dataclass(cls, "", data)


def load(path: Path) -> Config:
    """Returns the configuration in a YAML file.

    Raises:
        ValueError: If the file is not YAML, a key is unknown or missing, or a value is impossible.
        TypeError: If a value has the wrong type.
        OSError: If the file cannot be read.
    """
    return read(Config, path)


def read(kind: type[T], path: Path) -> T:
    """Returns a dataclass from a YAML file.

    Args:
        kind: The dataclass.
        path: The file.

    Raises:
        ValueError: If the file is not YAML, a key is unknown or missing, or a value is impossible.
        TypeError: If a value has the wrong type.
        OSError: If the file cannot be read.
    """
    name = f"config = {str(path)!r}"
    try:
        data = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise type(error)(f"{name}: expected a YAML file ({error.strerror})") from error
    except yaml.MarkedYAMLError as error:
        line = "" if error.problem_mark is None else f", line {error.problem_mark.line + 1}"
        raise ValueError(f"{name}{line}: expected valid YAML ({error.problem})") from error
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ValueError(f"{name}: expected valid YAML ({error})") from error
    if data is None:
        raise ValueError(f"{name}: expected settings, the file is empty")
    return read_dataclass(kind, "", data)


def as_whole(name: str, value: Any) -> int:
    """Returns `value` as a whole number; it may be a text such as "1000", "1_000" or "1e3".

    Raises:
        TypeError: If `value` is not a whole number.
    """
    return _read(int, name, value)


def at_least(name: str, value: float, least: float) -> None:
    """Raises a ValueError if the value of a field is less than `least`."""
    if value < least:
        raise ValueError(f"{name} = {short(value)}: expected a number >= {least}")


def resolved_env(given: Mapping[str, Any]) -> dict[str, Any]:
    """Returns the arguments of the environment, with the defaults of the missing ones.

    Raises:
        ValueError: If an argument is unknown.
        TypeError: If `given` is not a mapping.
    """
    if not isinstance(given, Mapping):
        raise TypeError(f"env = {short(given)}: expected a mapping")
    entry_point = gym.spec(ENV_ID).entry_point
    creator = load_env_creator(entry_point) if isinstance(entry_point, str) else entry_point
    if creator is None:
        raise ValueError(f"{ENV_ID} has no entry point: expected a registered environment")
    parameters = {
        name: parameter
        for name, parameter in inspect.signature(creator).parameters.items()
        if name != "render_mode"  # training does not render
    }
    for key in given:
        choose("key of env", key, tuple(parameters))
    return {name: number(given.get(name, parameter.default)) for name, parameter in parameters.items()}


def read_dataclass(kind: type[T], name: str, data: Any) -> T:
    """Returns a dataclass from plain data, for example from the content of a YAML file.

    Args:
        kind: The dataclass; its fields are numbers, strings, tuples of these, or dataclasses.
        name: The name of the data in messages; "" for a whole configuration.
        data: A mapping of the fields of the dataclass.

    Raises:
        ValueError: If a key is unknown or missing, or a value is impossible.
        TypeError: If a value has the wrong type.
    """
    if not isinstance(data, Mapping):
        raise TypeError(f"{name or 'the configuration'} = {short(data)}: expected a mapping")
    hints = typing.get_type_hints(kind)
    fields = dataclasses.fields(typing.cast(Any, kind))
    for key in data:
        choose(f"key of {name or 'the configuration'}", key, tuple(hints))
    prefix = f"{name}." if name else ""
    for field in fields:
        required = field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING
        if required and field.name not in data:
            raise ValueError(f"{prefix}{field.name} is missing: expected a value, because it has no default")
    return kind(**{key: _read(hints[key], f"{prefix}{key}", value) for key, value in data.items()})


def _read(hint: Any, name: str, value: Any) -> Any:
    """Converts `value` to the type `hint`: a text such as "1e6" to a number, 1000.0 to an int, a list to a tuple."""
    if dataclasses.is_dataclass(hint):
        return read_dataclass(typing.cast(Any, hint), name, value)
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin is types.UnionType:
        kind = type(value) if type(value) in arguments else arguments[0]
        return None if kind is types.NoneType else _read(kind, name, value)
    if origin is tuple:
        if not isinstance(value, list):
            raise TypeError(f"{name} = {short(value)}: expected a list, not {type(value).__name__}")
        return tuple(_read(arguments[0], f"{name}[{i}]", v) for i, v in enumerate(value))
    if origin is Mapping:
        if not isinstance(value, Mapping):
            raise TypeError(f"{name} = {short(value)}: expected a mapping, not {type(value).__name__}")
        return dict(value)
    if hint in (int, float):
        value = number(value)
    if hint is int and isinstance(value, float) and value.is_integer():
        return int(value)
    if hint is float and type(value) in (int, float):
        if not math.isfinite(value):
            raise ValueError(f"{name} = {short(value)}: expected a finite number")
        return float(value)
    if type(value) is not hint:
        wanted = {bool: "true or false", int: "a whole number", float: "a number", str: "text"}[hint]
        raise TypeError(f"{name} = {short(value)}: expected {wanted}, not {type(value).__name__}")
    return value


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    return [_plain(item) for item in value] if isinstance(value, (list, tuple)) else value
