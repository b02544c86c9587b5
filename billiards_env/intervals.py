"""95% confidence intervals of a share, of a mean of many values, of a mean of a few values, and by bootstrap."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

_Z = 1.959963984540054  # two-sided 95% quantile of the standard normal distribution
# The quantile 0.975 of Student's t distribution for 1, 2, ... degrees of freedom.
_T = (12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228, 2.201, 2.179, 2.160, 2.145, 2.131)
_T += (2.120, 2.110, 2.101, 2.093, 2.086, 2.080, 2.074, 2.069, 2.064, 2.060, 2.056, 2.052, 2.048, 2.045, 2.042)


def wilson_interval(successes: int, episodes: int) -> tuple[float, float]:
    """Returns the 95% confidence interval of a success rate (Wilson 1927, JASA 22(158), 209-212).

    Args:
        successes: The number of successes, 0 to `episodes`.
        episodes: The number of independent episodes, at least 1.

    Returns:
        The lower and upper end of the interval.

    Example:
        >>> [round(end, 4) for end in wilson_interval(15, 100)]
        [0.0931, 0.2328]
    """
    rate, z2 = successes / episodes, _Z * _Z
    centre = (rate + z2 / (2 * episodes)) / (1 + z2 / episodes)
    half = _Z / (1 + z2 / episodes) * math.sqrt(rate * (1 - rate) / episodes + z2 / (4 * episodes**2))
    return max(centre - half, 0.0), min(centre + half, 1.0)


def mean_interval(values: Sequence[float]) -> tuple[float, float] | None:
    """Returns the 95% confidence interval of a mean, by the central limit theorem.

    It needs at least some dozens of values, and not nearly all of them may be equal.

    Args:
        values: Independent values of one distribution, at least one.

    Returns:
        The lower and upper end of the interval; None for a single value, which has no standard deviation.

    Example:
        >>> [round(end, 2) for end in mean_interval([0.0, 2.0] * 50)]
        [0.8, 1.2]
    """
    if len(values) < 2:
        return None
    half = _Z * float(np.std(values, ddof=1)) / math.sqrt(len(values))
    mean = float(np.mean(values))
    return mean - half, mean + half


def t_quantile(freedom: int) -> float:
    """Returns the quantile 0.975 of Student's t distribution.

    More than 30 degrees of freedom use Fisher's expansion in powers of 1 / `freedom`.

    Example:
        >>> t_quantile(2), round(t_quantile(60), 3)
        (4.303, 2.0)
    """
    if freedom <= len(_T):
        return _T[freedom - 1]
    z = _Z
    return z + (z**3 + z) / (4 * freedom) + (5 * z**5 + 16 * z**3 + 3 * z) / (96 * freedom**2)


def over_seeds(values: Sequence[float]) -> dict[str, Any]:
    """Returns the mean over seeds and its 95% interval (Student). The interval is None for a single seed.

    Example:
        >>> over_seeds([0.5, 0.6, 0.7])["interval"]
        [0.351..., 0.848...]
    """
    mean, interval = float(np.mean(values)), None
    if len(values) > 1:
        half = t_quantile(len(values) - 1) * float(np.std(values, ddof=1)) / math.sqrt(len(values))
        interval = [mean - half, mean + half]
    return {"mean": mean, "interval": interval}


def interquartile_mean(values: ArrayLike, axis: int = -1) -> Any:
    """Returns the mean of the middle half of values along an axis (Agarwal et al. 2021, section 4.3).

    If a quarter of the number of values is not whole, the outermost values of the middle half have smaller weights.

    Example:
        >>> float(interquartile_mean([0.0, 1.0, 2.0, 9.0]))
        1.5
    """
    ordered = np.moveaxis(np.sort(np.asarray(values, float), axis), axis, -1)
    n = ordered.shape[-1]
    ends = np.clip(np.arange(1, n + 1) - 0.25 * n, 0.0, 1.0)
    weights = np.minimum(ends, ends[::-1])
    return (ordered * weights).sum(-1) / weights.sum()


def bootstrap(statistic: Callable[..., Any], *groups: ArrayLike, resamples: int = 2000) -> tuple[float, float]:
    """Returns the 95% interval of a statistic: the percentiles of its values for groups drawn again, with replacement.

    Args:
        statistic: A function of one array (`resamples`, n) for each group that returns (`resamples`,) values.
        groups: The values of each group, such as one for each seed. Each group is drawn by itself (stratified).
        resamples: The number of draws. Their random numbers are always the same.

    Example:
        >>> [round(float(end), 2) for end in bootstrap(interquartile_mean, [0.4, 0.5, 0.6, 0.7, 0.8])]
        [0.46, 0.77]
    """
    rng = np.random.default_rng(0)
    drawn = [rng.choice(np.asarray(group, float), (resamples, np.size(group))) for group in groups]
    low, high = np.percentile(statistic(*drawn), (2.5, 97.5))
    return float(low), float(high)


def success_rate(successes: int, episodes: int) -> str:
    """Returns a success rate and its interval as text.

    Example:
        >>> success_rate(15, 100)
        '15.0% (9.3 to 23.3)'
    """
    return as_percent({"mean": successes / episodes, "interval": wilson_interval(successes, episodes)})


def as_percent(value: Mapping[str, Any]) -> str:
    """Returns a share and its interval, from `over_seeds`, as text. The interval is limited to 0 to 100%.

    Example:
        >>> as_percent({"mean": 0.93, "interval": [0.85, 1.01]})
        '93.0% (85.0 to 100.0)'
    """
    if value["interval"] is None:
        return f"{value['mean']:.1%}"
    low, high = (100 * min(max(end, 0.0), 1.0) for end in value["interval"])
    return f"{value['mean']:.1%} ({low:.1f} to {high:.1f})"
