"""The fit of constants that all shots share, together with the starts of the shots.

The starts are eliminated from the normal equations (Schur complement), as in bundle adjustment (Triggs et al. 2000,
section 6). The loss is that of `starts.Normal`.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from billiards_env.calibration.preparation import PreparedTrack
from billiards_env.calibration.starts import Normal, allowed, damped, errors, evaluate, settle
from billiards_env.calibration.tracks import Floats
from billiards_env.intervals import t_quantile
from billiards_env.scene import PARAMETERS, Scene
from billiards_env.support.checks import RANGES

MANY = 8
"""Number of shots from which on intervals come from the spread over the shots."""

_STEPS, _FOLLOW = 25, 4  # most steps of a fit, and steps of the starts in each
_CONVERGED, _JUMP = 1e-6, 5.0  # relative change of the loss, and the most that one shot adds
_RIDGE = 1e-10  # damping of the elimination of a start, for numbers that its rows do not determine
_USUAL = 0.5, 0.05  # standard deviation of the prior of a constant: a share of its start, and at least this
_WIDE = 0.5  # largest half-interval over the constant; above it, the constant is not determined
_EDGE = 1e-6  # relative distance to a bound, within which a constant is at it
_SHIFT = 2.0  # standard deviations; a larger shift of a constant between two stages counts as an error of the laws


class Fit(NamedTuple):
    """A fit of shots.

    Attributes:
        scene: The scene with the fitted constants.
        names: The fitted constants.
        start: The scene with the constants before the fit.
        shots: The m shots with their starts; the rows that are used are near their paths.
        kept: Why the other free constants are not fitted, by name: they are at a bound, or keep their start.
        covariance: (s, s) of the constants.
        stages: The constants of each stage and their variances, by name.
        share: The share of the rows until the second contact that are near their paths.
    """

    scene: Scene
    names: tuple[str, ...]
    start: Scene
    shots: list[PreparedTrack]
    kept: dict[str, str]
    covariance: Floats
    stages: tuple[dict[str, tuple[float, float]], ...] = ()
    share: float = 1.0


def reduced(normal: Normal, width: int) -> tuple[Floats, Floats, Floats]:
    """Eliminates the only start (width,) from the normal equations.

    Returns:
        The slope (s,) and the matrix (s, s) of the shared constants, see `Normal`, and the derivative (width, s) of the
        start by the constants.
    """
    slope, matrix = normal.slope[0], normal.matrix[0]
    both = matrix[:width, width:]
    follow = -damped(matrix[None, :width, :width], both.T, _RIDGE).T
    return slope[width:] + follow.T @ slope[:width], matrix[width:, width:] + follow.T @ both, follow


def values_of(scene: Scene, names: Sequence[str]) -> dict[str, float]:
    """Returns constants of the physics of a scene by name."""
    return {name: getattr(scene.physics, name) for name in names}


def numbers_of(scene: Scene, names: Sequence[str]) -> Floats:
    """Returns constants of the physics of a scene, (s,)."""
    return np.array(list(values_of(scene, names).values()), np.float64)


def with_physics(scene: Scene, **changes: Any) -> Scene:
    """Returns a scene with other laws or constants of its physics."""
    return dataclasses.replace(scene, physics=dataclasses.replace(scene.physics, **changes))


def bounds_of(names: Sequence[str]) -> Floats:
    """Returns the least and the largest values of constants, (2, s)."""
    return np.array([RANGES[PARAMETERS[name].within][:2] for name in names], np.float64).T


def usual_of(fit: Fit) -> Floats:
    """Returns the prior standard deviations of the constants, (s,)."""
    return np.maximum(_USUAL[0] * np.abs(numbers_of(fit.start, fit.names)), _USUAL[1])


def fit_shared(fit: Fit, contact: int) -> tuple[Fit, float]:
    """Fits the shared constants and the starts of all shots to the rows that are used until a contact of the cue ball.

    The constants before the fit count as one measurement. A constant that the rows do not determine stays near them.

    Returns:
        The fit, and the loss of the rows.
    """
    scene, names = fit.scene, fit.names
    numbers, initial = numbers_of(scene, names), numbers_of(fit.start, names)
    usual, bounds = usual_of(fit), bounds_of(names)
    damping = 1e-3
    shots = [shot.until(contact) for shot in fit.shots]
    fits = [settle(scene, shot.starts, shot, names) for shot in shots]
    for _ in range(_STEPS):
        slopes, matrices, follows = zip(*(reduced(normal, start.size) for start, normal in fits), strict=True)
        matrix = sum(matrices) + np.diag(1.0 / usual**2)
        slope = sum(slopes) + (numbers - initial) / usual**2
        tried = np.clip(numbers - damped(matrix, slope, damping), *bounds)
        try:
            changed = with_physics(scene, **dict(zip(names, tried.tolist(), strict=True)))
        except ValueError:  # constants that `Physics` does not allow together
            damping *= 10.0
            continue
        others = []
        for (start, _), follow, shot in zip(fits, follows, shots, strict=True):
            moved, valid = allowed(scene, start + follow @ (tried - numbers), shot)
            others.append(settle(changed, np.where(valid[:, None], moved, start), shot, names, _FOLLOW))
        # If a contact appears or disappears, a shot jumps to another minimum; `_JUMP` limits its effect.
        losses, other_losses = (np.concatenate([normal.loss for _, normal in each]) for each in (fits, others))
        away = (np.square((numbers - initial) / usual) - np.square((tried - initial) / usual)).sum()
        gain = np.clip(losses - other_losses, -_JUMP, _JUMP).sum() + away
        if gain > 0.0:
            scene = changed
            numbers = tried
            fits = others
            damping = max(damping / 10.0, 1e-9)
        else:
            damping *= 10.0
        if 0.0 < gain < _CONVERGED * losses.sum() or damping > 1e3:
            break
    fits = [settle(scene, start, shot) for (start, _), shot in zip(fits, shots, strict=True)]
    fitted = [shot._replace(starts=start) for shot, (start, _) in zip(fit.shots, fits, strict=True)]
    return fit._replace(scene=scene, shots=fitted), float(sum(normal.loss[0] for _, normal in fits))


def covariance(fit: Fit, contact: int) -> Floats:
    """Returns the covariance (s, s) of the shared constants from the rows that are used until a contact.

    It is that of the prior if the rows do not determine them.

    From `MANY` shots on it is that of the jackknife: the constants without one shot, in the linear approximation (Bell
    and McCaffrey 2002). It includes errors of the laws, which the rows of a shot share. The spread over fewer shots is
    too uncertain, so the errors of their rows count as independent. The weights change with the residuals; the factor
    `bend` accounts for this (Huber 1964).
    """
    shots = [shot for shot in (shot.until(contact) for shot in fit.shots) if shot.used.any()]
    parts = [reduced(evaluate(fit.scene, shot.starts, shot, fit.names), shot.starts.size) for shot in shots]
    square = np.concatenate([np.square(errors(fit.scene, shot) / shot.scale)[shot.used] for shot in shots])
    weight = 1.0 / (1.0 + square)
    prior = np.diag(1.0 / usual_of(fit) ** 2)
    m = len(shots)
    bend = ((1.0 - square) * weight * weight).mean() / weight.mean()
    slopes, matrices, _ = (np.array(arrays) for arrays in zip(*parts, strict=True))
    inverse = np.linalg.inv(matrices.sum(axis=0) + prior)
    if m < MANY:
        return inverse * (weight * weight * square).mean() / weight.mean() / bend**2 + inverse @ prior @ inverse
    change = damped(matrices.sum(axis=0) + prior - matrices, slopes, 0.0) / bend
    return (m - 1) / m * change.T @ change + inverse @ prior @ inverse


def unexplained_shifts(fit: Fit, spread: Floats) -> Floats:
    """Returns the squares (s,) of the largest shifts of the constants between stages that chance does not explain.

    With the right laws, the variance of a shift is the difference of the variances of the two stages (Hausman 1978).
    """
    largest = np.zeros(len(fit.names))
    for stage in fit.stages[:-1]:
        values, variances = np.array([stage[name] for name in fit.names]).T
        shift = np.square(values - numbers_of(fit.scene, fit.names))
        by_chance = shift <= _SHIFT**2 * np.maximum(variances - np.diag(spread), 0.0)
        largest = np.maximum(largest, np.where(by_chance, 0.0, shift))
    return largest


def half_widths(spread: Floats, shots: int) -> Floats:
    """Returns half of the 95% intervals (s,) of constants with a covariance (s, s) (Student for many shots)."""
    return t_quantile(shots - 1 if shots >= MANY else 10**6) * np.sqrt(np.diag(spread))


def determined(fit: Fit, contact: int) -> Fit:
    """Returns a fit with its covariance, without constants that end at a bound or that the rows do not determine.

    A constant stays at its bound. One that the rows do not determine gets its start. The rest is then fitted again. The
    covariance includes the `unexplained_shifts`, with which an interval may be wider than `_WIDE` allows.
    """
    while True:
        names = fit.names
        numbers, initial = numbers_of(fit.scene, names), numbers_of(fit.start, names)
        spread = covariance(fit, contact)
        width = half_widths(spread, len(fit.shots)) / np.maximum(np.maximum(np.abs(numbers), np.abs(initial)), 1e-9)
        edge = np.any(np.abs(numbers - bounds_of(names)) <= _EDGE * np.maximum(np.abs(numbers), 1e-3), axis=0)
        width[edge] = np.inf
        worst = int(np.argmax(width))
        if width[worst] <= _WIDE:
            return fit._replace(covariance=spread + np.diag(unexplained_shifts(fit, spread)))
        why = f"it ends at the bound {numbers[worst]:g} of its range" if edge[worst] else "the rows do not determine it"
        kept, left = fit.kept | {names[worst]: why}, names[:worst] + names[worst + 1 :]
        if not left:
            raise ValueError(f"free = {list(kept)}: the rows do not determine any of them, expected more shots")
        scene = fit.scene if edge[worst] else with_physics(fit.scene, **values_of(fit.start, [names[worst]]))
        fit, _ = fit_shared(fit._replace(scene=scene, names=left, kept=kept), contact)
