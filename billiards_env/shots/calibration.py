"""Calibration: fits numbers of `Physics` to tracks of shots.

The first row of a track is the start of its shot. Where the balls are then, and the cue ball's velocity and spin, are
fitted with the numbers that all shots share: see `shots.track_fit`. Rows far from the fitted paths are reported, and
not fitted: see `shots.track_problems`. The fit of least squares to the other rows has the covariance s^2 (J^T J)^-1,
with the variance s^2 of the residuals and the Jacobian J of the shared numbers after the starts are eliminated.
"""

from __future__ import annotations

import contextlib
import dataclasses
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from billiards_env.checks import RANGES, Range, finite, missing, one_of, real
from billiards_env.files import check_path, replacing, write_json
from billiards_env.intervals import t_quantile
from billiards_env.scene import PARAMETERS, Scene, check_scene
from billiards_env.shots import track_fit as fit
from billiards_env.shots.gradients import physics_inputs
from billiards_env.shots.result import ShotResult
from billiards_env.shots.simulation import simulate
from billiards_env.shots.track_problems import Problem, find_problems, leaves_at
from billiards_env.shots.tracks import Track, check_tracks

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Floats = fit.Floats

FREE = ("mu_slide", "mu_roll", "e_ball", "e_cushion")
"""The numbers that `calibrate` fits by default."""

CUTS = (30.0, 15.0, 8.0, 5.0, 5.0, 5.0, 5.0)
"""The distance from the path above which a row is not fitted, over the noise, in each round. At first the numbers are
wrong, and the rows are far from all paths."""

SUFFIXES = (".json", ".png", ".svg", ".pdf")
"""Suffixes of the files that `Calibration.save` writes."""

_NOISE = Range(1e-9, 1.0, "m")
_LOST = 1.15  # the residuals of a shot over those of all shots above which its start is guessed again
_AGAIN = (2,)  # the rounds in which all starts are guessed again
_EVALUATIONS = 10  # most evaluations of a round
_CHANGES = (-0.1, 0.1)  # relative, of each number, from which all are fitted again
_OTHERS = 3  # other minima of single shots from which all numbers are fitted again
_UNDETERMINED = 1e-12  # smallest eigenvalue of the scaled normal equations of the shared numbers


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Calibration:
    """Fitted numbers.

    Attributes:
        scene: The scene with the fitted numbers.
        start: The numbers before the fit, by name.
        values: The fitted numbers, by name.
        covariance: (s, s) float64, of the numbers in the order of `values`.
        intervals: The 95% intervals, by name (Student).
        noise: Standard deviation of the residuals of a coordinate, m.
        freedom: Degrees of freedom: residuals less fitted numbers.
        tracks: The m tracks, with their rows in the order of time.
        residuals: m arrays (k, 2) float64: the model less the rows, m.
        fitted: m arrays (k,) bool: whether a row is fitted.
        positions: (m, n, 2) float64, m: the balls at the first rows.
        velocities: (m, 2) float64, m/s, of the cue ball at the first rows.
        spins: (m, 3) float64, rad/s, of the cue ball at the first rows.
        problems: What is reported, and not fitted.
    """

    scene: Scene
    start: dict[str, float]
    values: dict[str, float]
    covariance: Floats
    intervals: dict[str, tuple[float, float]]
    noise: float
    freedom: int
    tracks: list[Track]
    residuals: list[Floats]
    fitted: list[fit.Bools]
    positions: Floats
    velocities: Floats
    spins: Floats
    problems: list[Problem]

    @property
    def rms(self) -> Floats:
        """(m,) m, the root mean square of the fitted residuals of each shot; NaN for a shot without fitted rows."""
        squares = [np.square(off[used]) for off, used in zip(self.residuals, self.fitted, strict=True)]
        return np.array([np.sqrt(square.mean()) if square.size else np.nan for square in squares])

    def shot(self, k: int) -> ShotResult:
        """Returns the fitted shot of track k, recorded to its last row."""
        track = self.tracks[k]
        return simulate(
            self.scene,
            self.positions[k],
            self.velocities[k],
            spins=self.spins[k] if self.scene.physics.motion == "sliding" else None,
            in_play=np.isin(np.arange(self.scene.n_balls), track.balls),
            max_time=float(np.ptp(track.times)),
            record=True,
        )

    def strike_errors(self, intended: ArrayLike) -> dict[str, tuple[float, float]]:
        """Returns the errors of the strikes: the fitted velocities of the cue ball against the intended ones.

        Args:
            intended: (m, 2) m/s, the intended velocities at the first rows.

        Returns:
            The mean and the standard deviation of the errors of "direction", degrees, and of "speed", m/s.

        Raises:
            ValueError: If the array has another shape or a number is not finite.
        """
        aim = finite("intended", intended, self.velocities.shape)
        x, y = self.velocities.T
        turn = np.degrees(np.arctan2(aim[:, 0] * y - aim[:, 1] * x, aim[:, 0] * x + aim[:, 1] * y))
        off = {"direction": turn, "speed": np.hypot(x, y) - np.hypot(*aim.T)}
        return {name: (float(e.mean()), float(e.std(ddof=1)) if len(e) > 1 else np.nan) for name, e in off.items()}

    def __str__(self) -> str:
        """Returns the report."""
        rows = [("number", "start", "fitted", "95% interval", "unit")]
        for name, value in self.values.items():
            low, high = self.intervals[name]
            unit = RANGES[PARAMETERS[name].within].unit
            rows.append((name, f"{self.start[name]:.5g}", f"{value:.5g}", f"{low:.5g} to {high:.5g}", unit))
        widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
        lines = ["  ".join(c.ljust(w) for c, w in zip(row, widths, strict=True)).rstrip() for row in rows]
        count = sum(int(used.sum()) for used in self.fitted), sum(map(len, self.fitted))
        lines += ["", f"{count[0]} of {count[1]} rows fitted, residuals of {1e3 * self.noise:.3g} mm"]
        lines += ["", "rms of the residuals of each shot, mm"]
        each = [f"{track.name}: {1e3 * rms:.2f}" for track, rms in zip(self.tracks, self.rms, strict=True)]
        lines += [", ".join(each[k : k + 8]) for k in range(0, len(each), 8)]
        lines += ["", f"{len(self.problems) or 'no'} problem{'s' if len(self.problems) != 1 else ''}"]
        lines += [f"shot {p.shot}: {p.kind}: {p.text}" for p in self.problems]
        return "\n".join(lines)

    def to_dict(self) -> dict[str, Any]:
        """Returns the result as plain data for JSON; the residuals only as their rms, m (None without fitted rows)."""
        return {
            "start": self.start,
            "values": self.values,
            "intervals_95": {name: list(ends) for name, ends in self.intervals.items()},
            "covariance": self.covariance.tolist(),
            "noise": self.noise,
            "freedom": self.freedom,
            "rms": {t.name: None if np.isnan(r) else float(r) for t, r in zip(self.tracks, self.rms, strict=True)},
            "velocities": self.velocities.tolist(),
            "spins": self.spins.tolist(),
            "problems": [problem._asdict() for problem in self.problems],
            "scene": self.scene.to_dict(),
        }

    def plot(self) -> Figure:
        """Draws tracks over the fitted paths, and the residuals against time (extra `plot`).

        Raises:
            ModuleNotFoundError: If matplotlib is not installed.
        """
        from billiards_env.drawing.tracks import draw_fit

        worst = sorted(range(len(self.tracks)), key=lambda k: (self.fitted[k].all(), -np.nan_to_num(self.rms[k])))
        shots = {self.tracks[k].name: (self.tracks[k], self.fitted[k], self.shot(k).recording()) for k in worst[:6]}
        return draw_fit(shots, self.tracks, self.residuals, self.fitted)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the report as JSON, or the picture, completely or not at all.

        Args:
            path: The file. Its name must end in one of `SUFFIXES`.

        Raises:
            ValueError: If the name ends otherwise.
            OSError: If the file cannot be written.
            ModuleNotFoundError: If matplotlib is not installed.
        """
        target = check_out(path)
        if target.suffix == ".json":
            write_json(target, self.to_dict())
            return
        with replacing(target) as temporary:
            self.plot().savefig(temporary, dpi=150)


def check_out(path: str | os.PathLike[str]) -> Path:
    """Returns the path of a file that `Calibration.save` can write; see there for the errors."""
    one_of("suffix", Path(path).suffix, SUFFIXES)
    return check_path(path, Path(path).suffix)


def calibrate(
    scene: Scene,
    shots: Sequence[Track],
    free: Sequence[str] = FREE,
    *,
    noise: float = 0.002,
    velocities: ArrayLike | None = None,
    spins: ArrayLike | None = None,
    progress: Callable[[str], None] | None = None,
) -> Calibration:
    """Fits numbers of the physics of a scene to tracks of shots (extra `calibrate`).

    The positions of the balls at the first row of each shot, and the cue ball's velocity and spin there, are fitted
    too. The numbers are fitted with `scipy.optimize.least_squares`, exact derivatives and the loss "soft_l1". Rows that
    are far from the paths are left out, in rounds with smaller and smaller distances, see `CUTS`. The last fit, of the
    other rows, is one of least squares. It is repeated from other numbers and other starts, and the best one counts.

    Args:
        scene: The scene; its numbers are the start of the fit.
        shots: The tracks. The cue ball moves from the first row on.
        free: The names of the numbers: those of `Physics` but `max_time`.
        noise: Standard deviation of a coordinate of a row, m; only its order of magnitude matters.
        velocities: (m, 2) m/s, the cue ball's velocities at the first rows, if they are known.
        spins: (m, 3) rad/s, its spins, if they are known.
        progress: A function that gets a line of text after each round.

    Returns:
        The numbers with their covariance, the residuals and the problems of the tracks.

    Raises:
        ValueError: If a number is unknown, a track is invalid, or the rows do not determine a number.
        ModuleNotFoundError: If scipy is not installed.
    """
    solve = _least_squares()
    check_scene(scene)
    real("noise", noise, _NOISE)
    names = _check_names(scene, free)
    tracks, n = check_tracks(scene, shots, 4 if velocities is None else 1), scene.n_balls
    rows = fit.rows_of(tracks, n)
    if velocities is not None:
        rows.known[:, 2 * n : 2 * n + 2] = finite("velocities", velocities, (len(tracks), 2))
    if spins is not None:
        rows.known[:, 2 * n + 2 :] = finite("spins", spins, (len(tracks), 3))
    begun = dict(zip(names, _numbers(scene, names).tolist(), strict=True))
    fits = _Fits(names, np.array([RANGES[PARAMETERS[name].within][:2] for name in names], np.float64).T, noise, solve)
    scene, starts, rows, far = _choose_rows(fits, scene, rows, progress)
    return _result(begun, _last_fits(fits, scene, starts, rows), tracks, rows, far)


def _least_squares() -> Callable[..., Any]:
    """Returns `scipy.optimize.least_squares`."""
    try:
        from scipy.optimize import least_squares
    except ModuleNotFoundError as error:
        raise missing("scipy", "calibrate") from error
    return least_squares


class _Fits(NamedTuple):
    """What the fits of a calibration have in common.

    Attributes:
        names: The s names of the numbers.
        bounds: (2, s) the least and the largest numbers.
        noise: m.
        solve: `scipy.optimize.least_squares`.
    """

    names: tuple[str, ...]
    bounds: Floats
    noise: float
    solve: Callable[..., Any]

    def run(self, scene: Scene, starts: Floats, rows: fit.Rows, loss: str, most: int) -> tuple[Scene, fit.Projection]:
        """Fits the numbers from those of a scene, with at most `most` evaluations."""
        problem = fit.Projection(scene, self.names, starts, rows, loss, self.noise)
        edge = 1e-9 * np.ptp(self.bounds, axis=0)
        inside = np.clip(_numbers(scene, self.names), self.bounds[0] + edge, self.bounds[1] - edge)
        options: dict[str, Any] = {"loss": loss, "f_scale": self.noise, "x_scale": "jac", "bounds": self.bounds}
        exact: Any = problem.jacobian
        found = self.solve(problem.residuals, inside, exact, ftol=1e-7, max_nfev=most, **options)
        problem.jacobian(found.x)
        return fit.with_numbers(scene, self.names, found.x), problem


def _choose_rows(
    fits: _Fits, scene: Scene, rows: fit.Rows, progress: Callable[[str], None] | None
) -> tuple[Scene, Floats, fit.Rows, Floats]:
    """Fits the numbers in rounds, with the rows that are near the paths.

    Returns:
        The scene with the numbers, the starts, the rows with those that are used, and the distances above which the
        others were left out, (m, r) m.
    """
    noise = scale = fits.noise
    starts, far = fit.guess(scene, rows, noise), ~rows.seen
    for number, cut in enumerate(CUTS):
        if number > 0:
            again = _lost(scene, starts, rows, cut * scale, scale) | (number in _AGAIN)
            if again.any():
                starts[again] = _better(scene, starts[again], rows.of(np.flatnonzero(again)), noise)
        far = _judged(scene, starts, rows, cut * scale)[1]
        before = rows.used
        rows = rows._replace(used=rows.seen & ~far & (rows.time < leaves_at(rows, far)[0][:, None]))
        if number > 0 and CUTS[number - 1] == cut and np.array_equal(before, rows.used):
            break
        if not rows.used.any():
            raise ValueError(f"shots: no row is within {cut * scale:.2g} m of a path: expected tracks in this scene")
        starts = fit.settle_sides(scene, starts, rows, "soft_l1", noise)
        scene, problem = fits.run(scene, starts, rows, "soft_l1", _EVALUATIONS)
        starts = problem.starts
        size, _ = _judged(scene, starts, rows, np.inf)
        scale = max(noise, float(np.median(size[rows.used])) / 1.1774)  # of Gaussian noise in two coordinates
        if progress is not None:
            text = ", ".join(f"{name} {getattr(scene.physics, name):.5g}" for name in fits.names)
            progress(f"round {number + 1}: {rows.used.sum()} of {rows.seen.sum()} rows, {text}")
    return scene, starts, rows, np.where(far, CUTS[-1] * scale, 0.0)


def _last_fits(fits: _Fits, scene: Scene, starts: Floats, rows: fit.Rows) -> list[tuple[Scene, fit.Projection]]:
    """Returns fits of least squares to the chosen rows, each from other numbers or from another start of a shot."""
    starts = fit.settle_sides(scene, starts, rows, "linear", fits.noise)
    found = [fits.run(scene, starts, rows, "linear", 10 * _EVALUATIONS)]
    (scene, problem), others = found[0], []
    numbers = _numbers(scene, fits.names)
    for factors in 1.0 + np.concatenate([change * np.eye(len(numbers)) for change in _CHANGES]):
        with contextlib.suppress(ValueError):  # numbers that `Physics` does not allow together
            changed = fit.with_numbers(scene, fits.names, np.clip(factors * numbers, *fits.bounds))
            others.append((changed, problem.starts))
    for _, k, start in fit.other_minima(scene, problem.starts, rows, fits.noise)[:_OTHERS]:
        others.append((scene, problem.starts.copy()))
        others[-1][1][k] = start
    found += [fits.run(changed, begin, rows, "linear", _EVALUATIONS) for changed, begin in others]
    scene, problem = min(found, key=lambda one: _cost(*one, fits.names))
    if problem is not found[0][1]:
        found.append(fits.run(scene, problem.starts, rows, "linear", 10 * _EVALUATIONS))
    return found


def _numbers(scene: Scene, names: Sequence[str]) -> Floats:
    return np.array([getattr(scene.physics, name) for name in names])


def _cost(scene: Scene, problem: fit.Projection, names: Sequence[str]) -> float:
    return float(np.square(problem.residuals(_numbers(scene, names))).sum())


def _check_names(scene: Scene, free: Sequence[str]) -> tuple[str, ...]:
    names = (free,) if isinstance(free, str) else tuple(free)
    if not names or len(set(names)) < len(names):
        raise ValueError(f"free = {list(names)}: expected names of numbers, each once")
    for name in names:
        one_of("free", name, tuple(physics_inputs(scene.physics)))
    return names


def _result(
    begun: dict[str, float],
    fits: list[tuple[Scene, fit.Projection]],
    tracks: list[Track],
    rows: fit.Rows,
    far: Floats,
) -> Calibration:
    """Returns the best of the last fits; `far` are the distances above which rows were left out, (m, r) m."""
    names = tuple(begun)
    costs = np.array([_cost(*one, names) for one in fits])
    surprise = np.array([fit.spin_surprise(scene, problem.starts).sum() for scene, problem in fits])
    order = (costs + costs.min() / (2 * rows.used.sum()) * surprise).argsort(kind="stable")
    scene, problem = fits[order[0]]
    starts, n, numbers = problem.starts, scene.n_balls, _numbers(scene, names)
    covariance, variance, freedom = _covariance(problem, numbers, rows, names)
    half = t_quantile(freedom) * np.sqrt(np.diag(covariance))
    several: dict[str, Problem] = {}
    for k in order[1:]:
        other = fits[k][0], fits[k][1].starts
        one = _several(tracks, (scene, starts), other, dict(zip(names, half.tolist(), strict=True)))
        if one is not None and costs[k] - costs[order[0]] < fit.CLEAR * variance:
            several.setdefault(one.shot, one)
    batch = fit.run(scene, starts, rows)
    off = fit.modelled(batch._record("calibrate"), rows) - rows.positions
    zero = np.array([track.times[0] for track in tracks])
    counts = [len(track.times) for track in tracks]
    return Calibration(
        scene=scene,
        start=begun,
        values=dict(zip(begun, numbers.tolist(), strict=True)),
        covariance=covariance,
        intervals={
            name: (float(value - h), float(value + h)) for name, value, h in zip(begun, numbers, half, strict=True)
        },
        noise=float(np.sqrt(variance)),
        freedom=freedom,
        tracks=tracks,
        residuals=[row[:count] for row, count in zip(off, counts, strict=True)],
        fitted=[row[:count] for row, count in zip(rows.used, counts, strict=True)],
        positions=starts[:, : 2 * n].reshape(-1, n, 2),
        velocities=starts[:, 2 * n : 2 * n + 2],
        spins=starts[:, 2 * n + 2 :],
        problems=find_problems([track.name for track in tracks], zero, rows, batch, far) + list(several.values()),
    )


def _several(
    tracks: Sequence[Track], found: tuple[Scene, Floats], other: tuple[Scene, Floats], half: dict[str, float]
) -> Problem | None:
    """Returns the problem of another fit, (scene, starts), that is as good; None if it has almost the same numbers."""
    numbers = [_numbers(scene, tuple(half)) for scene, _ in (found, other)]
    differ = [
        f"{name} {another:.4g} instead of {best:.4g}"
        for name, best, another, least in zip(half, *numbers, half.values(), strict=True)
        if abs(another - best) > 2.0 * least + 1e-6 * abs(best)  # in the same minimum it would be worse
    ]
    if not differ:
        return None
    sides = found[1][:, -1], other[1][:, -1]
    k = int(np.abs(sides[1] - sides[0]).argmax())
    if sides[0][k] != sides[1][k]:
        differ.insert(0, f"a side spin of {sides[1][k]:.3g} instead of {sides[0][k]:.3g} rad/s")
    text = f"a fit with {', '.join(differ)} is as good"
    begin = float(tracks[k].times[0])
    return Problem(tracks[k].name, "several minima", 0, begin, begin, text)


def _lost(scene: Scene, starts: Floats, rows: fit.Rows, most: float, scale: float) -> fit.Bools:
    """Returns whether the rows of each shot are far from its path, (m,), or leave it at a distance above `most`."""
    size, far = _judged(scene, starts, rows, most)
    off = np.sqrt(np.square(size).sum(axis=1) / (2.0 * rows.seen.sum(axis=1))) > _LOST * scale
    return off | np.isfinite(leaves_at(rows, far)[0])


def _judged(scene: Scene, starts: Floats, rows: fit.Rows, most: float) -> tuple[Floats, fit.Bools]:
    """Returns the distances of the rows from the paths, (m, r) m, and whether they are above a distance."""
    off = fit.modelled(fit.run(scene, starts, rows)._record("calibrate"), rows) - rows.positions
    size = np.hypot(off[..., 0], off[..., 1])
    return size, rows.seen & (size > most)


def _better(scene: Scene, starts: Floats, rows: fit.Rows, noise: float) -> Floats:
    """Returns the better of starts and of new guesses for each shot; all rows count, those far from the path little."""
    rows = rows._replace(used=rows.seen)
    tried = [
        fit.settle(scene, each, rows, "cauchy", fit.FAR * noise)[0]
        for each in (starts, fit.guess(scene, rows, noise, starts))
    ]
    old, new = (fit.prefix_loss(scene, each, rows, noise) for each in tried)
    return np.where((new < old)[:, None], *tried[::-1])


def _covariance(
    problem: fit.Projection, numbers: Floats, rows: fit.Rows, names: Sequence[str]
) -> tuple[Floats, float, int]:
    """Returns the covariance of the shared numbers, the variance of a residual and the degrees of freedom."""
    jacobian, values = problem.jacobian(numbers), problem.residuals(numbers)
    size = np.linalg.norm(jacobian, axis=0)
    freedom = 2 * int(rows.used.sum()) - problem.freedom - len(names)
    normal = jacobian.T @ jacobian / np.outer(np.where(size > 0.0, size, 1.0), np.where(size > 0.0, size, 1.0))
    eigenvalues, vectors = np.linalg.eigh(normal)
    if eigenvalues[0] < _UNDETERMINED or freedom < 1:
        name = names[int(np.abs(vectors[:, 0]).argmax())]
        raise ValueError(
            f"free = {list(names)}: the rows do not determine {name!r}, expected numbers that change the paths"
        )
    variance = float(values @ values) / freedom
    return variance * np.linalg.inv(normal) / np.outer(size, size), variance, freedom
