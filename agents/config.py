"""The settings of a training, and how they are read from YAML and checked.

pydantic checks the keys and the values. The mapping `env` holds the arguments of `gym.make("Billiards-v0", ...)`, whose
signature its keys must match.
"""

from __future__ import annotations

import dataclasses
import inspect
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

import yaml
from pydantic import (
    AfterValidator,
    BeforeValidator,
    ConfigDict,
    Field,
    TypeAdapter,
    ValidationError,
    model_validator,
)
from pydantic.dataclasses import dataclass

from billiards_env.checks import RANGES, number, one_of, short
from billiards_env.envs import BilliardsEnv
from billiards_env.envs.tasks import TASKS
from billiards_env.settings import plain_yaml

ENV_ID = "Billiards-v0"

CHECKS = ConfigDict(extra="forbid", allow_inf_nan=False)
"""The checks of all settings."""


T = TypeVar("T")


def _number(value: Any) -> Any:
    """Returns `checks.number(value)`. Raises a ValueError if `value` is true or false."""
    if isinstance(value, bool):
        raise ValueError("expected a number, not true or false")
    return number(value)


Whole = Annotated[int, BeforeValidator(_number)]
Real = Annotated[float, BeforeValidator(_number)]
Count = Annotated[Whole, Field(ge=1)]
NotNegative = Annotated[Real, Field(ge=0)]
Positive = Annotated[Real, Field(gt=0)]
Share = Annotated[Real, Field(ge=0, le=1)]
Seed = Annotated[Whole, Field(ge=0, lt=2**32)]  # the limit is that of Stable-Baselines3
Together = Annotated[Whole, Field(ge=1, le=RANGES["num_envs"].most)]


def _numbers(value: Any) -> Any:
    """Returns plain data with texts such as "1e6" or "1/60" as numbers."""
    if isinstance(value, Mapping):
        return {key: _numbers(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_numbers(item) for item in value]
    return value if isinstance(value, bool) else number(value)


def distinct(values: tuple[T, ...]) -> tuple[T, ...]:
    """Returns at least one value, without duplicates.

    Raises:
        ValueError: If there is none or a duplicate.
    """
    if not values or len(set(values)) < len(values):
        raise ValueError("expected at least one, and no duplicates")
    return values


def resolved_env(given: Mapping[str, Any]) -> dict[str, Any]:
    """Returns all arguments of the environment. Missing ones have their defaults, or those of the task.

    Raises:
        ValueError: If an argument is unknown.
    """
    parameters = dict(inspect.signature(BilliardsEnv).parameters)
    del parameters["render_mode"]  # training does not render
    for key in given:
        one_of("key of env", key, tuple(parameters))
    given = _numbers(given)
    found = {name: given.get(name, parameter.default) for name, parameter in parameters.items()}
    if found["task"] in TASKS:
        task = TASKS[found["task"]]
        of_task = {"scene": task.scene, "layout": task.layout, "max_shots": task.max_shots}
        found |= {name: default for name, default in of_task.items() if found[name] is None}
    return found


@dataclass(frozen=True, kw_only=True, config=CHECKS)
class Checked:
    """Settings that can be read from YAML."""

    @model_validator(mode="before")
    @classmethod
    def _keys_are_known(cls, data: Any) -> Any:
        if isinstance(data, dict):
            for key in data:
                one_of("key", key, tuple(field.name for field in dataclasses.fields(cls)))
        return data


@dataclass(frozen=True, kw_only=True, config=CHECKS)
class Noise(Checked):
    """The execution noise in training and evaluation: `billiards_env.envs.wrappers.ExecutionNoise`.

    Attributes:
        angle_std: Standard deviation of the direction, degrees.
        speed_std: Standard deviation of the speed, m/s.
        offset_std: Standard deviation of both offsets of the tip, m, with `action: strike`.
        elevation_std: Standard deviation of the elevation, degrees, with `action: strike`.
    """

    angle_std: Annotated[NotNegative, Field(le=RANGES["angle_std"].most)] = 0.125
    speed_std: Annotated[NotNegative, Field(le=RANGES["speed_std"].most)] = 0.075
    offset_std: Annotated[NotNegative, Field(le=RANGES["offset_std"].most)] = 0.0005
    elevation_std: Annotated[NotNegative, Field(le=RANGES["angle_std"].most)] = 0.1


@dataclass(frozen=True, kw_only=True, config=CHECKS)
class Policy(Checked):
    """The policy and value networks.

    Attributes:
        head: "aim" for `billiards_env.sb3.AimPolicy`, or "gaussian" for the usual policy of Stable-Baselines3.
        arguments: The arguments of "aim", see `billiards_env.sb3.weights.AIM_ARGUMENTS`.
        hidden: The number of units of each hidden layer of "gaussian".
        activation: Its activation function: "tanh", "relu", "elu" or "silu".
    """

    head: Literal["aim", "gaussian"] = "gaussian"
    arguments: dict[str, Any] = Field(default_factory=dict)
    hidden: Annotated[tuple[Count, ...], Field(min_length=1)] = (64, 64)
    activation: Literal["tanh", "relu", "elu", "silu"] = "tanh"


@dataclass(frozen=True, kw_only=True, config=CHECKS)
class Hyperparameters(Checked):
    """Settings of proximal policy optimisation (Schulman et al. 2017), named as in Stable-Baselines3.

    All of them but `final_learning_rate` are arguments of `stable_baselines3.PPO`.

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

    n_steps: Count = 2048
    batch_size: Annotated[Whole, Field(ge=2)] = 64  # advantages are normalised within a minibatch
    n_epochs: Count = 10
    learning_rate: Positive = 3e-4
    final_learning_rate: Positive | None = None
    gamma: Share = 0.99
    gae_lambda: Share = 0.95
    clip_range: Positive = 0.2
    ent_coef: NotNegative = 0.0
    vf_coef: NotNegative = 0.5
    max_grad_norm: Positive = 0.5
    target_kl: Positive | None = None


@dataclass(frozen=True, kw_only=True, config=CHECKS)
class Config(Checked):
    """A training run.

    Attributes:
        timesteps: The number of environment steps (shots), rounded up to whole updates; 0 for no training.
        env: Arguments of `gym.make("Billiards-v0", ...)`. Missing arguments have their defaults.
        start_from: The folder of a finished run. The training starts with its weights. None for new weights.
        noise: The execution noise; None for no noise.
        n_envs: The number of environments that are stepped together.
        seed: The seed of all random numbers; equal seeds give equal runs.
        checkpoint_every: Steps between two checkpoints, and between two points of the learning curve.
        evaluation_episodes: The number of episodes on new layouts that measure the policy at each point of the learning
            curve and in `agents.evaluate`.
        policy: The networks.
        ppo: The learning algorithm.
    """

    timesteps: Annotated[Whole, Field(ge=0)]
    env: Annotated[dict[str, Any], AfterValidator(resolved_env)] = Field(default_factory=dict, validate_default=True)
    start_from: str | None = None
    noise: Noise | None = None
    n_envs: Together = 64
    seed: Seed = 0
    checkpoint_every: Count = 50_000
    evaluation_episodes: Together = 1000
    policy: Policy = Field(default_factory=Policy)
    ppo: Hyperparameters = Field(default_factory=Hyperparameters)

    def __post_init__(self) -> None:
        rollout, batch = self.n_envs * self.ppo.n_steps, self.ppo.batch_size
        if rollout % batch:
            raise ValueError(f"ppo.batch_size = {batch}: expected a divisor of n_envs * ppo.n_steps = {rollout}")

    def to_dict(self) -> dict[str, Any]:
        """Returns the configuration as plain data: dicts, lists, strings and numbers."""
        return TypeAdapter(Config).dump_python(self, mode="json")

    def to_yaml(self) -> str:
        """Returns the configuration as YAML, with all defaults; `from_dict` reads it."""
        return yaml.safe_dump(self.to_dict(), sort_keys=False)

    def is_saved_as(self, data: Any) -> bool:
        """Returns whether `from_dict` reads this configuration from plain data."""
        try:
            return Config.from_dict(data) == self
        except ValueError:
            return False

    @classmethod
    def from_dict(cls, data: Any) -> Config:
        """Returns a configuration from plain data, for example from the content of a YAML file.

        Args:
            data: A mapping of the fields of `Config`. `noise`, `policy` and `ppo` are mappings themselves.

        Raises:
            ValueError: If a key is unknown or missing, or a value is impossible.

        Example:
            >>> Config.from_dict({"timesteps": 1000, "ppo": {"n_step": 8}})
            Traceback (most recent call last):
            ValueError: ppo: key = 'n_step': expected one of ... (did you mean 'n_steps'?)
        """
        return validate(cls, data)


def load(path: Path) -> Config:
    """Returns the configuration in a YAML file. `read` describes the errors."""
    return read(Config, path)


def read(kind: type[T], path: Path) -> T:
    """Returns settings from a YAML file.

    Args:
        kind: The class of the settings.
        path: The file.

    Raises:
        ValueError: If the file is not YAML, a key is unknown or missing, or a value is impossible.
        OSError: If the file cannot be read.
    """
    name = f"config = {str(path)!r}"
    try:
        data = plain_yaml(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise type(error)(f"{name}: expected a YAML file ({error.strerror})") from error
    except yaml.MarkedYAMLError as error:
        line = "" if error.problem_mark is None else f", line {error.problem_mark.line + 1}"
        raise ValueError(f"{name}{line}: expected valid YAML ({error.problem})") from error
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ValueError(f"{name}: expected valid YAML ({error})") from error
    if data is None:
        raise ValueError(f"{name}: expected settings, the file is empty")
    return validate(kind, data)


def validate(kind: Any, data: Any, name: str = "") -> Any:
    """Returns a value of a type from plain data.

    Args:
        kind: The type, such as `Config` or `Count`.
        data: The data.
        name: The name of the value in messages; "" for all settings of a file.

    Raises:
        ValueError: If the data are not of this type. The message has a line for each error.

    Example:
        >>> validate(Count, "1e3", "episodes")
        1000
    """
    try:
        return TypeAdapter(kind).validate_python(data)
    except ValidationError as error:
        raise ValueError("\n".join(_message(name, found) for found in error.errors())) from None


def changed(settings: T, values: Mapping[str, Any]) -> T:
    """Returns settings with other values.

    Args:
        settings: The settings.
        values: The values, by the paths of the settings.

    Raises:
        ValueError: If there is no such setting, or a value is impossible.

    Example:
        >>> changed(Config(timesteps=1000), {"ppo.learning_rate": "1e-3"}).ppo.learning_rate
        0.001
    """
    plain = TypeAdapter(type(settings)).dump_python(settings, mode="json")
    for path, value in values.items():
        *parents, key = path.split(".")
        inner: Any = plain
        for parent in parents:
            inner = inner.get(parent) if isinstance(inner, dict) else None
        if not isinstance(inner, dict):
            raise ValueError(f"setting = {path!r}: expected a path such as 'ppo.learning_rate'")
        inner[key] = value
    return validate(type(settings), plain)


def _message(name: str, error: Any) -> str:
    """Returns the message of an error of pydantic: `name = value: expected ...`."""
    path = (name + "".join(f"[{k}]" if isinstance(k, int) else f".{k}" for k in error["loc"])).lstrip(".")
    if error["type"] == "missing":
        return f"{path} is missing: expected a value, because it has no default"
    text = str(error["ctx"]["error"]) if error["type"] == "value_error" else error["msg"]
    if " = " in text:  # the message has the name already
        return f"{path}: {text}" if path and not text.startswith("key of") else text
    text = re.sub(r"^\w+ should (be|have) ", "expected ", text)
    for word, sign in (("greater", ">"), ("less", "<")):
        text = text.replace(f"{word} than or equal to", f"a number {sign}=").replace(f"{word} than", f"a number {sign}")
    return f"{path or 'the configuration'} = {short(error['input'])}: {text}"
