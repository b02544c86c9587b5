"""Fits shared numbers and starts in stages: to rows until the second, the third, ... contact of the cue ball."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from billiards_env.calibration.judge import best_starts, ends_at, off_of
from billiards_env.calibration.prepare import Shot
from billiards_env.calibration.problems import leaves_at
from billiards_env.calibration.rows import Floats, Rows
from billiards_env.calibration.shared import bounds_of, covariance, fit_shared, half_widths, numbers_of, with_numbers
from billiards_env.calibration.starts import CAUCHY
from billiards_env.scene import Scene

FIRST = 0.005
"""m, the scale of the errors of rows after a contact before they are fitted for the first time."""

_FAR, _LEAST = 8.0, 0.02  # a row is far from its path: over the typical error, and m
_EXACT = 1e-7  # m, the least scale
_WIDE = 0.5  # half of an interval over the number, above which the rows do not determine it
_EDGE = 1e-6  # of the range of a number, where it is at its bound
_SHARED = 8.0  # rows that those between two contacts count as, if the laws have errors
_ROUNDS = 2  # fits in each stage, each with the rows that are near the paths of the one before


class Fitted(NamedTuple):
    """A fit of m shots.

    Attributes:
        scene: The scene with the fitted numbers.
        names: The fitted numbers.
        kept: Why the other free numbers keep their start, by name.
        starts: (m, width).
        rows: The rows; those that are used are near their paths.
        covariance: (s, s) of the numbers; zeros before the last stage.
    """

    scene: Scene
    names: tuple[str, ...]
    kept: dict[str, str]
    starts: Floats
    rows: Rows
    covariance: Floats


def typical_errors(rows: Rows, off: Floats, noise: float) -> Floats:
    """Returns the typical errors of the coordinates of rows after as many contacts of the cue ball, (m, r) m.

    Args:
        rows: The rows.
        off: (m, r) m, the distances of the rows from the paths.
        noise: The least error, m.
    """
    found = np.full(rows.scale.shape, max(noise, _EXACT))
    for after in np.unique(rows.after[rows.used & rows.judged]):
        mine = rows.after == after
        some = off[mine & rows.used & rows.judged]
        found[mine] = max(noise, _EXACT, float(np.median(some)) / 1.1774)  # of Gaussian noise in two coordinates
    return found


def _scales(rows: Rows, typical: Floats, noise: float) -> Floats:
    """Returns the scales of the loss of rows with typical errors, (m, r) m.

    The part above the noise is an error of the laws, which the rows of a shot between two contacts share. Together
    these rows count as `_SHARED` rows.
    """
    counts = np.ones(rows.scale.shape)
    for after in np.unique(rows.after[rows.used]):
        mine = rows.after == after
        several = np.count_nonzero(mine & rows.used & rows.judged, axis=1)[:, None] / _SHARED
        counts = np.where(mine, np.maximum(1.0, several), counts)
    return CAUCHY * np.sqrt(np.square(typical) + (np.square(typical) - min(noise, typical.min()) ** 2) * (counts - 1.0))


def first_guess(scene: Scene, shots: Sequence[Shot], rows: Rows) -> Floats:
    """Returns starts that fit the rows until the first contact."""
    rows = rows._replace(scale=np.maximum(rows.scale * CAUCHY, FIRST))
    return best_starts(scene, rows.until(ends_at(shots, 1)))


def fit_stage(
    fitted: Fitted, start: Scene, shots: Sequence[Shot], contact: int, noise: float, again: bool = True
) -> Fitted:
    """Fits the rows until a contact of the cue ball, from the numbers and the starts of an earlier fit.

    Args:
        fitted: The earlier fit; the room of its rows is that of all rows.
        start: The scene with the numbers before the fit.
        shots: The shots.
        contact: The number of the contact.
        noise: The least error of a coordinate, m.
        again: Whether other spins of the starts are tried.
    """
    scene, starts, whole, ends = fitted.scene, fitted.starts, fitted.rows, ends_at(shots, contact)
    begun = numbers_of(start, fitted.names)
    for _ in range(_ROUNDS):
        if again:
            starts = search_again(scene, starts, whole, ends)
            whole = judged_rows(scene, starts, whole, ends, noise)
        if fitted.names:
            scene, starts = fit_shared(scene, fitted.names, starts, whole.until(ends), begun)
            whole = judged_rows(scene, starts, whole, ends, noise)
    return fitted._replace(scene=scene, starts=starts, rows=whole)


def search_again(scene: Scene, starts: Floats, whole: Rows, ends: Floats) -> Floats:
    """Returns starts that fit all rows until some times better, if the search finds any."""
    part = whole._replace(used=whole.seen, scale=np.maximum(whole.scale, FIRST)).until(ends)
    return best_starts(scene, part, starts)


def judged_rows(scene: Scene, starts: Floats, whole: Rows, ends: Floats, noise: float) -> Rows:
    """Returns all rows, with those that are used and their scales, from the errors of a fit until some times."""
    before = whole.seen & (whole.time < ends[:, None])
    off = off_of(scene, starts, whole)
    typical = typical_errors(whole._replace(used=whole.used & before), off, noise)
    far = distances(whole, off, typical, ends) > 0.0
    later = whole.after > np.max(whole.after, where=before, initial=0, axis=1)[:, None]
    whole = whole._replace(used=whole.seen & ~far & (whole.time < leaves_at(whole, far)[0][:, None]))
    scale = _scales(whole._replace(used=whole.used & before), typical, noise)
    return whole._replace(scale=np.where(later, np.maximum(FIRST, scale), scale))


def distances(rows: Rows, off: Floats, typical: Floats, ends: Floats) -> Floats:
    """Returns the distance above which a row is far, for rows before some times that are far from their paths, or 0."""
    most = np.maximum(_LEAST, _FAR * typical)
    return np.where(rows.seen & (rows.time < ends[:, None]) & (off > most), most, 0.0)


def determined(fitted: Fitted, start: Scene, shots: Sequence[Shot], contact: int) -> Fitted:
    """Returns a fit with its covariance, without numbers that end at a bound or that the rows do not determine."""
    ends = ends_at(shots, contact)
    while True:
        names, part = fitted.names, fitted.rows.until(ends)
        used = part.used.any(axis=1)
        spread = covariance(fitted.scene, names, fitted.starts[used], part.of(np.flatnonzero(used)))
        numbers, low_high = numbers_of(fitted.scene, names), bounds_of(names)
        half = half_widths(spread, int(used.sum()))
        at_bound = np.any(np.abs(numbers - low_high) <= _EDGE * np.maximum(np.abs(numbers), 1e-3), axis=0)
        wide = ~(half <= _WIDE * np.maximum(np.abs(numbers), np.abs(numbers_of(start, names))))
        bad = at_bound | wide
        if not bad.any():
            return fitted._replace(covariance=spread)
        worst = int(
            np.argmax(np.where(at_bound, np.inf, np.where(wide, half / np.maximum(np.abs(numbers), 1e-9), -1.0)))
        )
        why = "it ends at the bound of its range" if at_bound[worst] else "the rows do not determine it"
        kept = fitted.kept | {names[worst]: why}
        left = tuple(name for name in names if name not in kept)
        if not left:
            raise ValueError(f"free = {list(kept)}: the rows do not determine any of them, expected more shots")
        scene = with_numbers(fitted.scene, names[worst : worst + 1], numbers_of(start, names[worst : worst + 1]))
        scene, starts = fit_shared(scene, left, fitted.starts, part, numbers_of(start, left))
        fitted = fitted._replace(scene=scene, starts=starts, names=left, kept=kept)
