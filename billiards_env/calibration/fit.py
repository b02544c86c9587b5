"""The fit of numbers that all shots share, together with the starts of the shots.

The starts are eliminated from the normal equations (Schur complement), as in bundle adjustment (Triggs et al. 2000,
section 6). The loss is that of `starts.Normal`.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from billiards_env.calibration.shot import CAUCHY, Shot
from billiards_env.calibration.starts import Normal, allowed, damped, errors, evaluate, search, settle
from billiards_env.calibration.tracks import Bools, Floats
from billiards_env.checks import RANGES
from billiards_env.files import write_json
from billiards_env.intervals import t_quantile
from billiards_env.scene import PARAMETERS, Scene
from billiards_env.shots import records

FIRST = 0.005
"""m, the least scale of rows that no fit has used yet."""

MANY = 8
"""Number of shots from which on intervals come from the spread over the shots."""

ENOUGH = 0.5
"""The least share of the rows until the second contact that are near their paths."""

_STEPS, _FOLLOW = 25, 4  # most steps of a fit, and steps of the starts in each
_CONVERGED, _JUMP = 1e-6, 5.0  # relative change of the loss, and the most that one shot adds
_RIDGE = 1e-10  # damping of the elimination of a start, for numbers that its rows do not determine
_USUAL = 0.5, 0.05  # standard deviation of the prior of a number: a share of its start, and at least this
_FAR, _LEAST = 8.0, 0.02  # least error of a far row: in typical errors, and in m
_RUN, _OF = 3, 4  # a track has left its path where 3 of 4 consecutive rows of a ball are far from it
_WIDE = 0.5  # largest half-interval over the number; above it, the number is not determined
_EDGE = 1e-6  # relative distance to a bound, within which a number is at it
_SHARED = 8.0  # the rows between two contacts count as at most this many
_MOST_STATE = 64 * 2**20  # bytes
_SHIFT = 2.0  # standard deviations; a larger shift of a number between two stages counts as an error of the laws
_ROUNDS = 2  # fits in each stage, each with the rows near the paths of the previous fit


class Fit(NamedTuple):
    """A fit of shots.

    Attributes:
        scene: The scene with the fitted numbers.
        names: The fitted numbers.
        start: The scene with the numbers before the fit.
        shots: The m shots with their starts; the rows that are used are near their paths.
        kept: Why the other free numbers keep their start, by name.
        covariance: (s, s) of the numbers.
        stages: The numbers of each stage and their variances, by name.
        share: The share of the rows until the second contact that are near their paths.
    """

    scene: Scene
    names: tuple[str, ...]
    start: Scene
    shots: list[Shot]
    kept: dict[str, str]
    covariance: Floats
    stages: tuple[dict[str, tuple[float, float]], ...] = ()
    share: float = 1.0


def reduced(normal: Normal, width: int) -> tuple[Floats, Floats, Floats]:
    """Eliminates the only start (width,) from the normal equations.

    Returns:
        The slope (s,) and the matrix (s, s) of the shared numbers, see `Normal`, and the derivative (width, s) of the
        start by the numbers.
    """
    slope, matrix = normal.slope[0], normal.matrix[0]
    both = matrix[:width, width:]
    follow = -damped(matrix[None, :width, :width], both.T, _RIDGE).T
    return slope[width:] + follow.T @ slope[:width], matrix[width:, width:] + follow.T @ both, follow


def values_of(scene: Scene, names: Sequence[str]) -> dict[str, float]:
    """Returns numbers of the physics of a scene by name."""
    return {name: getattr(scene.physics, name) for name in names}


def numbers_of(scene: Scene, names: Sequence[str]) -> Floats:
    """Returns numbers of the physics of a scene, (s,)."""
    return np.array(list(values_of(scene, names).values()), np.float64)


def with_physics(scene: Scene, **changes: Any) -> Scene:
    """Returns a scene with other laws or numbers of its physics."""
    return dataclasses.replace(scene, physics=dataclasses.replace(scene.physics, **changes))


def bounds_of(names: Sequence[str]) -> Floats:
    """Returns the least and the largest values of numbers, (2, s)."""
    return np.array([RANGES[PARAMETERS[name].within][:2] for name in names], np.float64).T


def usual_of(fit: Fit) -> Floats:
    """Returns the prior standard deviations of the numbers, (s,)."""
    return np.maximum(_USUAL[0] * np.abs(numbers_of(fit.start, fit.names)), _USUAL[1])


def fit_shared(fit: Fit, contact: int) -> tuple[Fit, float]:
    """Fits the shared numbers and the starts of all shots to the rows that are used until a contact of the cue ball.

    The numbers before the fit count as one measurement. A number that the rows do not determine stays near them.

    Returns:
        The fit, and the loss of the rows.
    """
    scene, names, usual, damping = fit.scene, fit.names, usual_of(fit), 1e-3
    numbers, initial, bounds = numbers_of(scene, names), numbers_of(fit.start, names), bounds_of(names)
    shots = [shot.until(contact) for shot in fit.shots]
    fits = [settle(scene, shot.starts, shot, names) for shot in shots]
    for _ in range(_STEPS):
        slopes, matrices, follows = zip(*(reduced(normal, start.size) for start, normal in fits), strict=True)
        matrix = sum(matrices) + np.diag(1.0 / usual**2)
        slope = sum(slopes) + (numbers - initial) / usual**2
        tried = np.clip(numbers - damped(matrix, slope, damping), *bounds)
        try:
            changed = with_physics(scene, **dict(zip(names, tried.tolist(), strict=True)))
        except ValueError:  # numbers that `Physics` does not allow together
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
            scene, numbers, fits, damping = changed, tried, others, max(damping / 10.0, 1e-9)
        else:
            damping *= 10.0
        if 0.0 < gain < _CONVERGED * losses.sum() or damping > 1e3:
            break
    fits = [settle(scene, start, shot) for (start, _), shot in zip(fits, shots, strict=True)]
    fitted = [shot._replace(starts=start) for shot, (start, _) in zip(fit.shots, fits, strict=True)]
    return fit._replace(scene=scene, shots=fitted), float(sum(normal.loss[0] for _, normal in fits))


def fit_stage(fit: Fit, contact: int, noise: float) -> Fit:
    """Fits the starts to the rows until a contact of the cue ball; from the second contact on, the numbers too.

    Args:
        fit: The earlier fit.
        contact: The number of the contact.
        noise: The least error of a coordinate, m.
    """
    for _ in range(_ROUNDS):
        shots = []
        for shot in fit.shots:
            best = search(fit.scene, shot.wide(contact, FIRST))
            shots.append(best._replace(used=shot.used, scale=shot.scale))
        fit = fit._replace(shots=near_rows(fit.scene, shots, contact, noise))
        if contact > 1:
            fit, _ = fit_shared(fit, contact)
            fit = fit._replace(shots=near_rows(fit.scene, fit.shots, contact, noise))
    return fit


def near_rows(scene: Scene, shots: list[Shot], contact: int, noise: float) -> list[Shot]:
    """Returns shots with new used rows and new scales, from the errors of a fit until a contact.

    The scale of a row comes from the typical error of rows after the same number of contacts. The part above the
    noise is an error of the laws, which the rows of a shot between two contacts share. Together these rows count as at
    most `_SHARED` rows.
    """
    distances = [np.hypot(*errors(scene, shot).T) for shot in shots]
    counted = [shot.until(contact).used & shot.moving for shot in shots]
    off = np.concatenate([distance[rows] for distance, rows in zip(distances, counted, strict=True)])
    after = np.concatenate([shot.after[rows] for shot, rows in zip(shots, counted, strict=True)])
    typical = np.full(max(shot.after.max() for shot in shots) + 1, noise)
    for k in np.unique(after):  # the median distance of Gaussian errors in two coordinates is 1.1774
        typical[k] = max(noise, float(np.median(off[after == k])) / 1.1774)
    near = []
    for shot, distance in zip(shots, distances, strict=True):
        before, error = shot.time < shot.end(contact), typical[shot.after]
        far = before & (distance > np.maximum(_LEAST, _FAR * error))
        leaves = leaves_at(shot, far)
        used = ~far & (shot.time < leaves[0])
        rows = np.bincount(shot.after[used & before & shot.moving], minlength=len(typical))[shot.after]
        of_laws = (np.square(error) - noise**2) * np.maximum(rows / _SHARED, 1.0)
        scale = CAUCHY * np.sqrt(of_laws + noise**2)
        scale = np.where(before, scale, np.maximum(FIRST, scale))
        near.append(shot._replace(scale=scale, used=used, leaves=leaves))
    return near


def leaves_at(shot: Shot, far: Bools) -> tuple[float, int]:
    """Returns the time at which a track first leaves its path, s, and the ball; inf and -1 if none does.

    There, at least `_RUN` of `_OF` consecutive rows of a ball are far.
    """
    leaves = [(np.inf, -1)]
    for ball in np.unique(shot.track.balls[far]):
        rows = np.flatnonzero(shot.track.balls == ball)
        ahead = np.convolve(far[rows], np.ones(_OF))[_OF - 1 :]
        leaves += [(float(time), int(ball)) for time in shot.time[rows[far[rows] & (ahead >= _RUN)]][:1]]
    return min(leaves)


def covariance(fit: Fit, contact: int) -> Floats:
    """Returns the covariance (s, s) of the shared numbers from the rows that are used until a contact.

    It is that of the prior if the rows do not determine them.

    From `MANY` shots on it is that of the jackknife: the numbers without one shot, in the linear approximation (Bell
    and McCaffrey 2002). It includes errors of the laws, which the rows of a shot share. The spread over fewer shots is
    too uncertain, so the errors of their rows count as independent. The weights change with the residuals; the factor
    `bend` accounts for this (Huber 1964).
    """
    shots = [shot for shot in (shot.until(contact) for shot in fit.shots) if shot.used.any()]
    parts = [reduced(evaluate(fit.scene, shot.starts, shot, fit.names), shot.starts.size) for shot in shots]
    square = np.concatenate([np.square(errors(fit.scene, shot) / shot.scale[:, None])[shot.used] for shot in shots])
    weight, m, prior = 1.0 / (1.0 + square), len(shots), np.diag(1.0 / usual_of(fit) ** 2)
    bend = ((1.0 - square) * weight * weight).mean() / weight.mean()
    slopes, matrices = np.array([part[0] for part in parts]), np.array([part[1] for part in parts])
    inverse = np.linalg.inv(matrices.sum(axis=0) + prior)
    if m < MANY:
        return inverse * (weight * weight * square).mean() / weight.mean() / bend**2 + inverse @ prior @ inverse
    change = damped(matrices.sum(axis=0) + prior - matrices, slopes, 0.0) / bend
    return (m - 1) / m * change.T @ change + inverse @ prior @ inverse


def unexplained_shifts(fit: Fit, spread: Floats) -> Floats:
    """Returns the squares of the largest shifts of the numbers (s,) since earlier stages that are too large for chance.

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
    """Returns half of the 95% intervals (s,) of numbers with a covariance (s, s) (Student for many shots)."""
    return t_quantile(shots - 1 if shots >= MANY else 10**6) * np.sqrt(np.diag(spread))


def determined(fit: Fit, contact: int) -> Fit:
    """Returns a fit with its covariance, without numbers that end at a bound or that the rows do not determine.

    The covariance includes the `unexplained_shifts`, with which an interval may be wider than `_WIDE` allows.
    """
    while True:
        names, numbers, initial = fit.names, numbers_of(fit.scene, fit.names), numbers_of(fit.start, fit.names)
        spread = covariance(fit, contact)
        width = half_widths(spread, len(fit.shots)) / np.maximum(np.maximum(np.abs(numbers), np.abs(initial)), 1e-9)
        edge = np.any(np.abs(numbers - bounds_of(names)) <= _EDGE * np.maximum(np.abs(numbers), 1e-3), axis=0)
        width[edge] = np.inf
        worst = int(np.argmax(width))
        if width[worst] <= _WIDE:
            return fit._replace(covariance=spread + np.diag(unexplained_shifts(fit, spread)))
        why = "it ends at the bound of its range" if edge[worst] else "the rows do not determine it"
        kept, left = fit.kept | {names[worst]: why}, names[:worst] + names[worst + 1 :]
        if not left:
            raise ValueError(f"free = {list(kept)}: the rows do not determine any of them, expected more shots")
        scene = with_physics(fit.scene, **values_of(fit.start, names[worst : worst + 1]))
        fit, _ = fit_shared(fit._replace(scene=scene, names=left, kept=kept), contact)


def read_state(path: str | os.PathLike[str] | None, settings: Any) -> dict[str, Any]:
    """Returns the content of a state file: the key of the settings, and finished stages by the number of shots.

    Raises:
        ValueError: If the file has other settings.
    """
    key, what = hashlib.sha256(json.dumps(settings).encode()).hexdigest(), "the state of a calibration"
    if path is None or not Path(path).exists():
        return {"key": key}
    saved = records.read(path, lambda text: records.data_of(text, what), what, _MOST_STATE)
    if not isinstance(saved, dict) or saved.get("key") != key:
        raise ValueError(f"state = {str(path)!r}: expected the state of the same tracks, scene, numbers and options")
    return saved


def fit_stages(
    fit: Fit,
    contacts: int,
    noise: float,
    saved: dict[str, Any],
    path: str | os.PathLike[str] | None = None,
    progress: Callable[[str], None] | None = None,
) -> Fit:
    """Fits the rows until the first contact of the cue ball, then until the second, and so on.

    It resumes from `saved`, adds each finished stage to it, and writes it to a file. It ends with the second contact if
    `Fit.share` is less than `ENOUGH`.
    """
    finished = saved.get(str(len(fit.shots)))
    if finished is None:
        fit = fit_stage(fit, 1, noise)
    else:
        stages = tuple(finished["stages"])
        scene = with_physics(fit.scene, **{name: value for name, (value, _) in stages[-1].items()})
        shots = [shot._replace(starts=np.array([row])) for shot, row in zip(fit.shots, finished["starts"], strict=True)]
        fit = fit._replace(scene=scene, shots=near_rows(scene, shots, len(stages) + 1, noise), stages=stages)
    for contact in range(len(fit.stages) + 2, contacts + 1):
        fit = fit_stage(fit, contact, noise)
        values, variances = values_of(fit.scene, fit.names), np.diag(covariance(fit, contact)).tolist()
        stage = dict(zip(fit.names, zip(values.values(), variances, strict=True), strict=True))
        near = np.concatenate([shot.used[shot.moving & (shot.time < shot.end(contact))] for shot in fit.shots])
        share = float(near.mean()) if near.size else 0.0
        fit = fit._replace(stages=(*fit.stages, stage), share=share if contact == 2 else fit.share)
        if path is not None and fit.share >= ENOUGH:
            starts = [shot.starts[0].tolist() for shot in fit.shots]
            saved[str(len(starts))] = {"starts": starts, "stages": fit.stages}
            write_json(Path(path), saved)
        if progress is not None:
            text = ", ".join(f"{name} {value:.5g}" for name, value in values.items())
            progress(f"until contact {contact}: {share:.1%} of the rows, {text}")
        if fit.share < ENOUGH:
            break
    return fit
