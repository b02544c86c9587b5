"""The result of a calibration: its report, its files, and arguments of `gym.make` for the calibrated table."""

from __future__ import annotations

import dataclasses
import functools
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from billiards_env.calibration.cleaning import clean
from billiards_env.calibration.fit import bounds_of, half_widths
from billiards_env.calibration.frame import Frame
from billiards_env.calibration.judge import CONTACTS, Judged, Problem, judge
from billiards_env.calibration.preparation import INSTANT, PLACES, SCALE, SPIN, VELOCITY, PreparedTrack, prepare
from billiards_env.calibration.scatter import Scattered, estimate
from billiards_env.calibration.starts import errors, simulate_starts, simulated
from billiards_env.calibration.tracks import Bools, Floats, Track, check_tracks
from billiards_env.drawing.recording import Recording, recording_of
from billiards_env.scene import PARAMETERS, Scene
from billiards_env.shots.result import ShotResult
from billiards_env.support.checks import RANGES, finite, one_of
from billiards_env.support.files import check_path, replacing, write_json

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SUFFIXES = (".json", ".png", ".svg", ".pdf")
"""Suffixes of the files that `Calibration.save` writes."""

_DRAWN = 6  # shots in the picture: the worse half are the worst, the others are typical


@dataclasses.dataclass(frozen=True, eq=False)
class Calibration:
    """Fitted constants.

    Attributes:
        scene: The scene with the fitted constants.
        start: The constants before the fit, by name.
        values: The fitted constants, by name.
        kept: Why the other free constants are not fitted, by name: they are at a bound, or keep their start.
        covariance: (s, s) float64, of the constants in the order of `values`, see `fit.covariance`.
        row_noise: Standard deviation of a coordinate of a row, m.
        frame: The frame of the given tracks.
        shots: The m fitted shots.
        problems: The rows that are reported.
        predicted: The errors of the held-back shots, from the fit without them, or None.
        warnings: Sentences.
    """

    scene: Scene
    start: dict[str, float]
    values: dict[str, float]
    kept: dict[str, str]
    covariance: Floats
    row_noise: float
    frame: Frame
    shots: list[PreparedTrack]
    problems: list[Problem]
    predicted: Judged | None
    warnings: list[str]

    @functools.cached_property
    def scatter(self) -> Scattered | None:
        """The scatter of the cushions, see `calibration.scatter`; None if the shots have too few contacts."""
        return estimate(self.scene, self.shots, max(SCALE, self.row_noise))

    @functools.cached_property
    def judged(self) -> Judged:
        """The errors of the fitted shots, see `judge.judge`."""
        return judge(self.scene, self.shots)

    @property
    def intervals(self) -> dict[str, tuple[float, float]]:
        """The 95% intervals, by name."""
        half = half_widths(self.covariance, len(self.shots)).tolist()
        return {name: (value - h, value + h) for (name, value), h in zip(self.values.items(), half, strict=True)}

    @property
    def fitted(self) -> list[Bools]:
        """The rows of each track that are fitted, (k,) bool, in the order of time."""
        return [shot.used[~shot.added] for shot in self.shots]

    @property
    def starts(self) -> Floats:
        """(m, 2 n + 6), the starts, see `calibration.preparation`."""
        return np.concatenate([shot.starts for shot in self.shots])

    @property
    def strikes(self) -> Floats:
        """(m,) s, the times of the starts, as in the tracks."""
        return np.array([shot.begin for shot in self.shots]) + self.starts[:, INSTANT]

    @property
    def cue_balls(self) -> list[int]:
        """The cue ball of each shot, to which its velocity and its spin belong."""
        return [shot.cue_ball for shot in self.shots]

    @property
    def positions(self) -> Floats:
        """(m, n, 2) m, the balls at the starts."""
        return self.starts[:, PLACES].reshape(len(self.shots), -1, 2)

    @property
    def velocities(self) -> Floats:
        """(m, 2) m/s, of the cue balls at the starts."""
        return self.starts[:, VELOCITY]

    @property
    def spins(self) -> Floats:
        """(m, 3) rad/s, of the cue balls at the starts."""
        return self.starts[:, SPIN]

    @property
    def rms(self) -> Floats:
        """(m,) m, the root mean square of the fitted residuals of each shot; NaN for a shot without fitted rows."""
        squares = [np.square(errors(self.scene, shot)[shot.used & ~shot.added]) for shot in self.shots]
        return np.array([np.sqrt(square.mean()) if square.size else np.nan for square in squares])

    def shot(self, k: int) -> ShotResult:
        """Returns the fitted shot of track k, recorded to its last row. It starts at `strikes[k]`.

        `first_hit` and other facts about a cue ball are those of ball 0, also if `cue_balls[k]` is another one.
        """
        return simulated(self.scene, self.shots[k])

    def judge(self, tracks: Sequence[Track]) -> Judged:
        """Returns the errors of other shots, in the frame of the given tracks, with the fitted constants.

        Raises:
            ValueError: If there are no tracks or one is invalid.
        """
        framed = [self.frame.apply(track) for track in clean(check_tracks(self.scene, tracks))[0]]
        return judge(self.scene, [prepare(self.scene, track, self.row_noise) for track in framed])

    def noise(self, intended: ArrayLike) -> dict[str, float]:
        """Returns the argument `noise` of `Billiards-v0`: the spread of the fitted velocities around intended ones.

        Args:
            intended: (m, 2) m/s, the intended velocities at the starts.

        Returns:
            The standard deviations of the direction, degrees, and of the speed, m/s.

        Raises:
            ValueError: If the array has another shape or a number is not finite.
        """
        aim = finite("intended", intended, self.velocities.shape)
        x, y = self.velocities.T
        turn = np.degrees(np.arctan2(aim[:, 0] * y - aim[:, 1] * x, aim[:, 0] * x + aim[:, 1] * y))
        off = {"angle_std": turn, "speed_std": np.hypot(x, y) - np.hypot(*aim.T)}
        return {name: float(error.std(ddof=1)) if len(error) > 1 else np.nan for name, error in off.items()}

    def randomize(self) -> dict[str, tuple[float, float]]:
        """Returns the argument `randomize` of `Billiards-v0`: the intervals within the ranges of the constants.

        The intervals come from the spread over the shots, so they contain the tables that are consistent with the
        shots.
        """
        return {name: tuple(np.clip(ends, *bounds_of([name])[:, 0]).tolist()) for name, ends in self.intervals.items()}

    def __str__(self) -> str:
        """Returns the report."""
        rows: list[tuple[str, ...]] = [("constant", "start", "fitted", "95% interval", "unit")]
        for name, start in self.start.items():
            cells = "-", self.kept.get(name, "-")
            if name in self.values:
                cells = f"{self.values[name]:.5g}", "{:.5g} to {:.5g}".format(*self.intervals[name])
            rows.append((name, f"{start:.5g}", *cells, RANGES[PARAMETERS[name].within].unit))
        if self.scatter is not None:
            for name, value in self.scatter.values.items():
                interval = "{:.3f} to {:.3f}".format(*self.scatter.intervals[name])
                rows.append((name, "-", f"at most {value:.3f}", interval, ""))
        lines = [*_aligned(rows), ""]
        for text, judged in (("shots", self.judged), ("shots that were not fitted", self.predicted)):
            if judged is not None:
                rows = [(f"{judged.shots} {text}: rows until contact", "within 5 mm", "within 10 mm", "median, mm")]
                for k in CONTACTS:
                    shares = f"{judged.within(k, 0.005):.1%}", f"{judged.within(k, 0.01):.1%}"
                    rows.append((str(k), *shares, f"{1e3 * judged.median(k):.2f}"))
                lines += [*_aligned(rows), ""]
        used = np.concatenate(self.fitted)
        lines += [f"{used.sum()} of {used.size} rows fitted, noise of {1e3 * self.row_noise:.3g} mm"]
        lines += [f"warning: {text}" for text in self.warnings]
        lines += ["", "rms of the residuals of each shot, mm"]
        shots = [f"{shot.track.name}: {1e3 * rms:.2f}" for shot, rms in zip(self.shots, self.rms, strict=True)]
        lines += [", ".join(shots[k : k + 8]) for k in range(0, len(shots), 8)]
        lines += ["", f"{len(self.problems) or 'no'} problem{'s' if len(self.problems) != 1 else ''}"]
        lines += [f"shot {p.shot}: {p.kind}: {p.text}" for p in self.problems]
        return "\n".join(lines)

    def to_dict(self) -> dict[str, Any]:
        """Returns the result as plain data for JSON; the residuals only as their rms, m (None without fitted rows)."""
        rms = [None if np.isnan(rms) else rms for rms in self.rms.tolist()]
        return {
            "start": self.start,
            "values": self.values,
            "kept": self.kept,
            "intervals_95": {name: list(ends) for name, ends in self.intervals.items()},
            "covariance": self.covariance.tolist(),
            "scatter": None if self.scatter is None else self.scatter._asdict(),
            "noise": self.row_noise,
            "judged": self.judged.to_dict(),
            "predicted": None if self.predicted is None else self.predicted.to_dict(),
            "warnings": self.warnings,
            "rms": dict(zip((shot.track.name for shot in self.shots), rms, strict=True)),
            "cue_balls": self.cue_balls,
            "velocities": self.velocities.tolist(),
            "spins": self.spins.tolist(),
            "problems": [problem._asdict() for problem in self.problems],
            "scene": self.scene.to_dict(),
        }

    def plot(self) -> Figure:
        """Draws tracks and paths of shots, and the errors until each contact (extra `plot`).

        The shots with the largest root mean square errors come first, then the shots around the median. The titles show
        the errors. A shot is drawn until its last row that is fitted.

        Raises:
            ModuleNotFoundError: If matplotlib is not installed.
        """
        from billiards_env.drawing.tracks import draw_fit

        rms = np.nan_to_num(self.rms)
        order = np.argsort(-rms, kind="stable")
        half = _DRAWN // 2
        middle = max(len(order) // 2, half)
        shots = {
            f"shot {self.shots[k].track.name}, {1000 * rms[k]:.1f} mm": drawn(self.scene, self.shots[k])
            for k in (*order[:half], *order[middle : middle + half])
        }
        return draw_fit(shots, self.judged.errors)

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
        else:
            with replacing(target) as temporary:
                self.plot().savefig(temporary)


def drawn(scene: Scene, shot: PreparedTrack, ahead: float = 0.0) -> tuple[Track, Bools, Recording]:
    """Returns the rows of a shot until `ahead` s after the last fitted one, for `draw_fit`.

    Returns:
        The rows, with times since the strike; whether each is fitted; and the path.
    """
    seen = ~shot.added & (shot.time <= ahead + shot.time.max(initial=0.0, where=shot.used))
    track = shot.track._replace(times=shot.time - shot.starts[0, INSTANT]).rows(seen)
    return track, shot.used[seen], recording_of(simulate_starts(scene, shot.starts, shot._replace(used=seen))[0])


def _aligned(rows: Sequence[tuple[str, ...]]) -> list[str]:
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  ".join(c.ljust(w) for c, w in zip(row, widths, strict=True)).rstrip() for row in rows]


def check_out(path: str | os.PathLike[str]) -> Path:
    """Returns the path of a file that `Calibration.save` can write; see there for the errors."""
    one_of("suffix", Path(path).suffix, SUFFIXES)
    return check_path(path)
