"""The settings of a training with RLlib, read from YAML."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import Field
from pydantic.dataclasses import dataclass

from agents.config import CHECKS, Checked, Config, Whole, load


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


def load_recipe(settings: Settings, path: Path) -> Config:
    """Returns the recipe of settings that were read from a file. The errors are those of `read`."""
    return load(path.parent / settings.recipe)
