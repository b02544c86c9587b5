"""The settings of a training with RLlib and of a sweep, read from YAML."""

from __future__ import annotations

import dataclasses
import math
import random
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from agents.config import Config, at_least, load
from billiards_env.checks import number


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """A training with RLlib.

    Attributes:
        recipe: The path of a configuration of `agents.train`, relative to the settings.
        runners: The number of processes that play. They share the `n_envs` environments of the recipe. 0 if the process
            of the command plays.
        learners: The number of processes that compute the updates. They share each minibatch. 0 if the process of the
            command computes them.
    """

    recipe: str
    runners: int = 1
    learners: int = 0

    def __post_init__(self) -> None:
        for name in ("runners", "learners"):
            at_least(name, getattr(self, name), 0)

    def check(self, config: Config) -> None:
        """Raises a ValueError if a recipe cannot be trained with these settings."""
        if config.n_envs % max(self.runners, 1):
            raise ValueError(f"runners = {self.runners}: expected a divisor of n_envs = {config.n_envs}")
        if config.ppo.batch_size % max(self.learners, 1):
            raise ValueError(
                f"learners = {self.learners}: expected a divisor of ppo.batch_size = {config.ppo.batch_size}"
            )
        if config.ppo.target_kl is not None:
            raise ValueError(f"ppo.target_kl = {config.ppo.target_kl}: expected None, RLlib has no such limit")


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Sweep:
    """Trainings of a recipe with other settings, which are drawn at random.

    A key of `ranges` and `choices` is the path of a setting, such as "ppo.learning_rate".

    Attributes:
        recipe: The path of a configuration of `agents.train`, relative to the sweep.
        trials: The number of trainings.
        ranges: The lowest and the highest value of a setting. The logarithm of the drawn value is uniform.
        choices: The possible values of a setting.
        first_stop: The number of steps after which a trial may end early.
        reduction: The best trials continue at a stop: one of this number. The next stop is after this factor of steps.
        seed: The seed of the drawn settings.
    """

    recipe: str
    trials: int
    first_stop: int
    ranges: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    choices: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    reduction: int = 3
    seed: int = 0

    def __post_init__(self) -> None:
        for name, least in (("trials", 1), ("first_stop", 1), ("reduction", 2), ("seed", 0)):
            at_least(name, getattr(self, name), least)
        for key, values in self.ranges.items():
            numbers = (
                [v for v in map(number, values) if isinstance(v, (int, float))] if isinstance(values, list) else []
            )
            if len(numbers) != 2 or not 0 < numbers[0] < numbers[1]:
                raise ValueError(f"ranges.{key} = {values!r}: expected two increasing numbers > 0")
        for key, values in self.choices.items():
            if not isinstance(values, list) or not values:
                raise ValueError(f"choices.{key} = {values!r}: expected a list of values")
            if key in self.ranges:
                raise ValueError(f"choices.{key} = {values!r}: expected a setting without a range")
        if not (self.ranges or self.choices):
            raise ValueError("ranges = {}: expected at least one range or one list of choices")

    def draw(self) -> list[dict[str, Any]]:
        """Returns the settings of each trial, by their paths."""
        generator = random.Random(self.seed)
        ranges = {key: [math.log(number(value)) for value in ends] for key, ends in self.ranges.items()}
        return [
            {
                **{key: math.exp(generator.uniform(*ends)) for key, ends in ranges.items()},
                **{key: generator.choice(values) for key, values in self.choices.items()},
            }
            for _ in range(self.trials)
        ]


def load_recipe(settings: Settings | Sweep, path: Path) -> Config:
    """Returns the recipe of settings that were read from a file.

    Raises:
        OSError: If the recipe cannot be read.
        TypeError: If a value of the recipe has the wrong type.
        ValueError: If the recipe is impossible.
    """
    return load(path.parent / settings.recipe)


def changed(config: Config, values: Mapping[str, Any]) -> Config:
    """Returns a configuration with other values of some settings.

    Args:
        config: The configuration.
        values: The values, by the paths of the settings.

    Raises:
        TypeError: If a value has the wrong type.
        ValueError: If there is no such setting, or a value is impossible.

    Example:
        >>> changed(Config(timesteps=1000), {"ppo.learning_rate": 0.001}).ppo.learning_rate
        0.001
    """
    plain = config.to_dict()
    for path, value in values.items():
        *parents, key = path.split(".")
        inner: Any = plain
        for parent in parents:
            inner = inner.get(parent) if isinstance(inner, dict) else None
        if not isinstance(inner, dict):
            raise ValueError(f"setting = {path!r}: expected a path such as 'ppo.learning_rate'")
        inner[key] = value
    return Config.from_dict(plain)
