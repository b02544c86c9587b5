"""The parts of a learner: `Learner` is an entry of `agents.learners`, and `Training` is what it makes."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from stable_baselines3.common.policies import BasePolicy

from billiards_env.sb3.weights import save_policy
from billiards_env.support.checks import Range, integer, number, real, short

Check = Callable[[str, Any], Any]
"""A function `(name, value) -> value` that returns a value after a check. The name is for its error."""


class Setting(NamedTuple):
    """A setting of a learner.

    Attributes:
        check: Checks a value, such as `whole(1, 100)`.
        default: The value if a configuration has none; None to leave the setting out.
    """

    check: Check
    default: Any = None


class Learner(NamedTuple):
    """A way to train a policy.

    Attributes:
        settings: The settings by name. A configuration has their values in the section with the name of the learner.
        check: A function `(config)` that raises a ValueError for a `Config` that the learner cannot train. It runs
            after all other checks. It may set values that follow from others, such as `n_envs`.
        make: A function `(config, folder)` that returns the training of a configuration, from its start; `folder` is
            that of the run.
    """

    settings: Mapping[str, Setting]
    check: Callable[..., None]
    make: Callable[..., Training]


class Training:
    """A policy in training.

    What follows a call of `restart` depends only on the configuration and on what `save` writes. So a resumed training
    ends with the same weights as an uninterrupted one.

    Attributes:
        policy: The policy.
        shots: The number of shots (environment steps) so far.
        clock: Measures the time of the training, s.
    """

    policy: BasePolicy
    shots: int = 0
    clock: Callable[[], float] = staticmethod(time.process_time)

    def restart(self) -> None:
        """Seeds all random generators and begins new episodes, at the start and after each checkpoint."""

    def update(self) -> float:
        """Plays shots, adds their number to `shots`, learns, and returns the `training_success` of `train.Point`."""
        raise NotImplementedError

    def save(self, path: Path) -> None:
        """Writes a checkpoint, whose name without the suffix is the number of shots.

        Without checkpoints an interrupted training begins again.
        """

    def load(self, path: Path) -> None:
        """Reads a checkpoint. Raises a ValueError if it is damaged."""

    def finish(self, run_dir: Path) -> None:
        """Writes the result: `policy.pt`."""
        save_policy(self.policy, run_dir / "policy.pt")

    def close(self) -> None:
        """Releases what the training holds, also after an error."""


def whole(least: int, most: int | None = None) -> Check:
    """Returns the check of a whole number, also one such as 1e6, which YAML reads as a text or another number."""

    def check(name: str, value: Any) -> int:
        value = number(value)
        is_whole = isinstance(value, float) and value.is_integer()
        return integer(name, int(value) if is_whole else value, Range(least, most))

    return check


def up_to(most: float) -> Check:
    """Returns the check of a number from 0 to `most`."""
    return lambda name, value: real(name, value, Range(0.0, most))


def rates(name: str, value: Any) -> list[float]:
    """Checks the rates of the start and of the end."""
    if not isinstance(value, list) or len(value) != 2:
        raise ValueError(f"{name} = {short(value)}: expected a pair of rates")
    return [up_to(1.0)(name, rate) for rate in value]
