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
    if not isinstance(scatter, Mapping):
        raise TypeError(f"scatter = {short(scatter)}: expected a mapping from {', '.join(SCATTER)} to numbers")
    for key in scatter:
        one_of("key of scatter", key, tuple(SCATTER))
    return np.array([real(name, value, "scatter_std") for name, value in {**SCATTER, **scatter}.items()])
