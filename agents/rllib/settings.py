"""The settings of a training with RLlib and of a sweep, read from YAML."""

from __future__ import annotations

import math
import random
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, Field
from pydantic.dataclasses import dataclass

from agents.config import CHECKS, Checked, Config, Count, Positive, Whole, increasing, load


@dataclass(frozen=True, kw_only=True, config=CHECKS)
class Settings(Checked):
    """A training with RLlib.

    Attributes:
        recipe: The path of a configuration of `agents.train`, relative to the settings.
        runners: The number of processes that play. They share the `n_envs` environments of the recipe. 0 if the process
            of the command plays.
        learners: The number of processes that compute the updates. They share each minibatch. 0 if the process of the
            command computes them.
    """

    recipe: str
    runners: Annotated[Whole, Field(ge=0)] = 1
    learners: Annotated[Whole, Field(ge=0)] = 0

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


@dataclass(frozen=True, kw_only=True, config=CHECKS)
class Sweep(Checked):
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
    trials: Count
    first_stop: Count
    ranges: dict[str, Annotated[tuple[Positive, Positive], AfterValidator(increasing)]] = Field(default_factory=dict)
    choices: dict[str, Annotated[list[Any], Field(min_length=1)]] = Field(default_factory=dict)
    reduction: Annotated[Whole, Field(ge=2)] = 3
    seed: Annotated[Whole, Field(ge=0)] = 0

    def __post_init__(self) -> None:
        for key, values in self.choices.items():
            if key in self.ranges:
                raise ValueError(f"choices.{key} = {values!r}: expected a setting without a range")
        if not (self.ranges or self.choices):
            raise ValueError("ranges = {}: expected at least one range or one list of choices")

    def draw(self) -> list[dict[str, Any]]:
        """Returns the settings of each trial, by their paths."""
        generator = random.Random(self.seed)
        return [
            {
                **{key: math.exp(generator.uniform(*map(math.log, ends))) for key, ends in self.ranges.items()},
                **{key: generator.choice(values) for key, values in self.choices.items()},
            }
            for _ in range(self.trials)
        ]


def load_recipe(settings: Settings | Sweep, path: Path) -> Config:
    """Returns the recipe of settings that were read from a file.

    Raises:
        OSError: If the recipe cannot be read.
        ValueError: If the recipe is impossible.
    """
    return load(path.parent / settings.recipe)
