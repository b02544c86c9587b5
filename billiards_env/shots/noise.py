"""Random differences: the execution noise of strokes, and the scatter of cushions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from billiards_env.support.checks import one_of, real, short

EXECUTION_NOISE = {"angle_std": 0.125, "speed_std": 0.075, "offset_std": 0.0005, "elevation_std": 0.1}
"""The standard deviations of the frozen tasks with noise: the argument `noise` of `BilliardsEnv` has their source."""

SCATTER = {"normal_std": 0.015, "along_std": 0.018, "spin_std": 0.035}
"""The standard deviations of the scatter of cushions, see `physics.scatter`. With it, the errors of simulated shots
are 55 to 85% of those of real shots of three-cushion billiards, see docs/validation.md."""


def check_scatter(scatter: Mapping[str, Any] | None) -> NDArray[np.float64] | None:
    """Returns the standard deviations of `SCATTER`, (3,), or None without scatter, after a check.

    Raises:
        ValueError: If a name is unknown, or a standard deviation is out of range.
        TypeError: If `scatter` is not a mapping to numbers.
    """
    if scatter is None:
        return None
    return np.array([*deviations("scatter", scatter, SCATTER, "scatter_std").values()])


def deviations(what: str, given: Any, usual: Mapping[str, float], within: str = "") -> dict[str, float]:
    """Returns standard deviations by name, after a check: those that are given, and the usual ones for other names.

    `within` is a name in `RANGES`. By default each standard deviation has the range of its own name.
    """
    if not isinstance(given, Mapping):
        raise TypeError(f"{what} = {short(given)}: expected a mapping from {', '.join(usual)} to numbers")
    for key in given:
        one_of(f"key of {what}", key, tuple(usual))
    return {name: real(name, value, within or name) for name, value in {**usual, **given}.items()}
