"""The fit of numbers that all shots share, together with the starts of the shots.

The normal equations of the shared numbers have the starts eliminated (Schur complement), as in the adjustment of
bundles of rays (Triggs et al. 2000, section 6). The loss is that of `starts.Residuals`.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from billiards_env.calibration.rows import Floats, Rows
from billiards_env.calibration.starts import Residuals, allowed, column_sizes, errors, evaluate, settle
from billiards_env.checks import RANGES
from billiards_env.intervals import t_quantile
from billiards_env.scene import PARAMETERS, Scene

_STEPS, _FOLLOW = 25, 4  # most steps of a fit, and steps of the starts in each
_CONVERGED, _JUMP = 1e-6, 5.0  # relative change of the loss, and the most that one shot counts
_RANK = 1e-12  # smallest eigenvalue of the scaled normal equations of a start that counts
_UNDETERMINED = 1e-9  # the same of the shared numbers
_USUAL = 0.5, 0.05  # the standard deviation of a number over its start, and at least: that of other tables

MANY = 8
"""Number of shots from which on intervals come from the spread over the shots."""


class Normal(NamedTuple):
    """The normal equations of the shared numbers.

    Attributes:
        matrix: (m, s, s), of each shot, with its start eliminated.
        slope: (m, s), the derivative of half of the loss.
        follow: (m, width, s), the derivative of the starts by the numbers.
    """

    matrix: Floats
    slope: Floats
    follow: Floats


def normal_equations(scene: Scene, names: Sequence[str], starts: Floats, rows: Rows) -> Normal:
    """Returns the normal equations of shots."""
    m, s = len(starts), len(names)
    found = Normal(np.empty((m, s, s)), np.empty((m, s)), np.empty((*starts.shape, s)))
    for some, part in rows.groups():
        one = _eliminated(evaluate(scene, starts[some], part, names), starts.shape[1])
        for array, values in zip(found, one, strict=True):
            array[some] = values
    return found


def _eliminated(here: Residuals, width: int) -> Normal:
    pulled = np.swapaxes(here.weighted, 1, 2)
    normal, slope = pulled @ here.jacobian, (pulled @ here.values[..., None])[..., 0]
    own, both, shared = normal[:, :width, :width], normal[:, :width, width:], normal[:, width:, width:]
    size = column_sizes(own)
    values, vectors = np.linalg.eigh(own / (size[:, :, None] * size[:, None, :]))
    inverse = np.where(values > _RANK, 1.0 / np.maximum(values, _RANK), 0.0)
    solved = (vectors * inverse[:, None, :]) @ np.swapaxes(vectors, 1, 2) / (size[:, :, None] * size[:, None, :])
    follow = -solved @ both
    turned = np.swapaxes(follow, 1, 2)
    return Normal(shared + turned @ both, slope[:, width:] + (turned @ slope[:, :width, None])[..., 0], follow)


def numbers_of(scene: Scene, names: Sequence[str]) -> Floats:
    """Returns numbers of the physics of a scene, (s,)."""
    return np.array([getattr(scene.physics, name) for name in names], np.float64)


def with_numbers(scene: Scene, names: Sequence[str], values: Floats) -> Scene:
    """Returns a scene with other numbers of its physics."""
    changes = dict(zip(names, values.tolist(), strict=True))
    return dataclasses.replace(scene, physics=dataclasses.replace(scene.physics, **changes))


def bounds_of(names: Sequence[str]) -> Floats:
    """Returns the least and the largest values of numbers, (2, s)."""
    return np.array([RANGES[PARAMETERS[name].within][:2] for name in names], np.float64).T


def fit_shared(
    scene: Scene, names: Sequence[str], starts: Floats, rows: Rows, start: Floats | None = None
) -> tuple[Scene, Floats]:
    """Fits shared numbers and the starts (m, width) of all shots, and returns the scene and the starts.

    `start` (s,) counts as one measurement of the numbers. A number that the rows do not determine stays near it.
    """
    low_high, damping, begun = bounds_of(names), 1e-3, numbers_of(scene, names) if start is None else start
    usual = np.maximum(_USUAL[0] * np.abs(begun), _USUAL[1])
    starts, cost = settle(scene, starts, rows)
    normal, numbers = normal_equations(scene, names, starts, rows), numbers_of(scene, names)
    for _ in range(_STEPS):
        matrix = normal.matrix.sum(axis=0) + np.diag(1.0 / usual**2)
        slope = normal.slope.sum(axis=0) + (numbers - begun) / usual**2
        size = column_sizes(matrix)
        scaled = matrix / np.outer(size, size) + damping * np.eye(len(names))
        tried = np.clip(numbers - np.linalg.solve(scaled, slope / size) / size, *low_high)
        moved, fine = allowed(scene, starts + normal.follow @ (tried - numbers), rows)
        moved[~fine] = starts[~fine]
        try:
            changed = with_numbers(scene, names, tried)
        except ValueError:  # numbers that `Physics` does not allow together
            damping *= 10.0
            continue
        moved, then = settle(changed, moved, rows, _FOLLOW)
        # A shot in which a contact appears or disappears jumps to another minimum; it does not decide alone.
        away = (np.square((numbers - begun) / usual) - np.square((tried - begun) / usual)).sum()
        gain = np.clip(cost - then, -_JUMP, _JUMP).sum() + away
        if gain > 0.0:
            scene, numbers, starts, cost = changed, tried, moved, then
            normal, damping = normal_equations(scene, names, starts, rows), max(damping / 10.0, 1e-9)
        else:
            damping *= 10.0
        if 0.0 < gain < _CONVERGED * cost.sum() or damping > 1e3:
            break
    return scene, settle(scene, starts, rows)[0]


def covariance(scene: Scene, names: Sequence[str], starts: Floats, rows: Rows) -> Floats:
    """Returns the covariance (s, s) of the shared numbers; inf for a number that the rows do not determine.

    From `MANY` shots on it is that of the jackknife: the numbers without one shot, in the linear approximation (Bell
    and McCaffrey 2002). It includes errors of the laws, which the rows of a shot share. The spread over fewer shots is
    too uncertain, so the errors of their rows count as independent. The weights change with the residuals; the factor
    `bend` accounts for this (Huber 1964).
    """
    normal, m = normal_equations(scene, names, starts, rows), len(starts)
    square = np.square(errors(scene, starts, rows) / rows.scale[..., None])[rows.used]
    weight = 1.0 / (1.0 + square)
    bend = ((1.0 - square) * weight * weight).mean() / weight.mean()
    matrix = normal.matrix.sum(axis=0)
    size = column_sizes(matrix)
    values, vectors = np.linalg.eigh(matrix / np.outer(size, size))
    if values[0] < _UNDETERMINED:
        return np.diag(np.where(np.abs(vectors[:, 0]) > 0.5, np.inf, 0.0))
    if m < MANY:
        spread = (weight * weight * square).mean() / weight.mean() / bend**2
        return spread * np.linalg.inv(matrix / np.outer(size, size)) / np.outer(size, size)
    rest = (matrix - normal.matrix) / np.outer(size, size)
    change = np.linalg.solve(rest, (normal.slope / size)[..., None])[..., 0] / size / bend
    return (m - 1) / m * np.einsum("ki,kj->ij", change, change)


def half_widths(spread: Floats, shots: int) -> Floats:
    """Returns half of the 95% intervals (s,) of numbers with a covariance (s, s) (Student for many shots)."""
    return t_quantile(shots - 1 if shots >= MANY else 10**6) * np.sqrt(np.diag(spread))
