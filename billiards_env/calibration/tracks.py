"""Tracks: the places of the balls of a shot in the frames of a film.

Times are in seconds, places in metres in the frame of the scene (the origin is the centre of the table, x runs along
its length). Balls are numbered as in the scene, the cue ball is ball 0. A ball without rows in a shot is not on the
table. A ball at rest needs only one row.
"""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from billiards_env.checks import RANGES, finite, numbers, real, short
from billiards_env.files import write_whole
from billiards_env.scene import Scene
from billiards_env.shots.result import ShotResult

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

COLUMNS = ("shot", "time", "ball", "x", "y")

_APART = 1e-6  # s, least time between two rows of a ball; no camera takes frames that fast


class Track(NamedTuple):
    """The places of the balls of one shot in the frames of a film.

    Attributes:
        name: Name of the shot.
        times: (k,) float64, s, from any zero.
        balls: (k,) int, the ball of each row.
        positions: (k, 2) float64, m.
    """

    name: str
    times: Floats
    balls: NDArray[np.int64]
    positions: Floats

    def rows(self, rows: Any) -> Track:
        """Returns the track with some of its rows, in the order of `rows`: indices or bools."""
        return Track(self.name, self.times[rows], self.balls[rows], self.positions[rows])

    def paths(self) -> dict[int, tuple[Floats, Floats]]:
        """Returns the times (k,), s, and the places (k, 2), m, of each ball."""
        return {int(i): (self.times[self.balls == i], self.positions[self.balls == i]) for i in np.unique(self.balls)}


def observed(name: str, shot: ShotResult, times: ArrayLike, noise: float = 0.0, seed: int = 0) -> Track:
    """Returns the track of a simulated shot, as a camera would record it.

    Args:
        name: Name of the shot.
        shot: A recorded shot.
        times: (q,) s, the times of the frames. A ball is not seen after it is potted.
        noise: Standard deviation of a coordinate, m.
        seed: Seed of the noise.

    Raises:
        ValueError: If the shot was not recorded, or a time is negative or not finite.
    """
    at = numbers("times", times)
    positions = shot.at(at)
    assert shot.trajectory is not None
    frame, ball = np.nonzero(at[:, None] < shot.trajectory.potted_at)
    error = real("noise", noise) * np.random.default_rng(seed).standard_normal((len(frame), 2))
    return Track(name, at[frame], ball, positions[frame, ball] + error)


def write_tracks(path: str | os.PathLike[str], tracks: Sequence[Track]) -> None:
    """Writes tracks to a CSV file, completely or not at all.

    Raises:
        OSError: If the file cannot be written.
    """
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(COLUMNS)
    for track in tracks:
        columns = track.times.tolist(), track.balls.tolist(), *track.positions.T.tolist()
        table.writerows((track.name, *row) for row in zip(*columns, strict=True))
    write_whole(Path(path), text.getvalue().encode())


def check_tracks(scene: Scene, tracks: Sequence[Track], least: int) -> list[Track]:
    """Returns tracks with their rows in the order of time.

    Raises:
        ValueError: If there are no tracks, two have the same name, an array has a wrong shape or a number that is not
            finite, a ball is not in the scene or has two rows at one time, or the cue ball has fewer than `least`
            rows.
    """
    if not tracks:
        raise ValueError("shots = []: expected one track or more")
    names, checked = [track.name for track in tracks], []
    for track in tracks:
        name = f"shots[{track.name!r}]"
        if names.count(track.name) > 1:
            raise ValueError(f"{name} appears twice: expected each name once")
        balls = np.asarray(track.balls)
        k = balls.size
        times = finite(f"{name}.times", track.times, (k,))
        positions = finite(f"{name}.positions", track.positions, (k, 2))
        if k and not np.abs(times).max() <= RANGES["limit"].most:
            raise ValueError(f"{name}.times = {short(times.tolist())}: expected at most {RANGES['limit'].most:g} s")
        if balls.dtype.kind not in "iu" or not ((balls >= 0) & (balls < scene.n_balls)).all():
            raise ValueError(f"{name}.balls = {short(np.unique(balls).tolist())}: expected 0 to {scene.n_balls - 1}")
        if np.count_nonzero(balls == 0) < least:
            raise ValueError(f"{name}: {np.count_nonzero(balls == 0)} rows of the cue ball: expected {least} or more")
        order = np.lexsort((times, balls))  # by ball, then by time
        close = (np.diff(balls[order]) == 0) & (np.diff(times[order]) < _APART)
        if close.any():
            row = order[int(close.argmax()) + 1]
            raise ValueError(
                f"{name}: ball {balls[row]} has two rows at {times[row]:g} s: expected one, {_APART:g} s from the next"
            )
        order = np.argsort(times, kind="stable")
        checked.append(Track(str(track.name), times[order], balls[order].astype(np.int64), positions[order]))
    return checked


_GAP, _STEP = 5.0, 5.0  # frames without a row of a ball, after which it may have rested, and between added rows
_PLACE = 0.004  # m, two places of a ball at rest
_SLOW = 0.6  # the speed over a gap, over that after it, of a ball that rested first


def with_rest(track: Track) -> tuple[Track, Bools]:
    """Adds rows of balls at rest: many programs write a row only after a ball has moved.

    Returns:
        The track with its rows in the order of time, and whether a row was added.
    """
    steps, end, parts = np.diff(np.unique(track.times)), float(track.times.max()), [track]
    frame = float(np.median(steps[steps > _APART])) if (steps > _APART).any() else 1.0
    for ball, (t, p) in track.paths().items():
        gaps = np.diff(t, append=end)
        speeds = np.append(np.hypot(*np.diff(p, axis=0).T) / gaps[:-1], (0.0, 0.0))
        ways = speeds[:-1] * gaps
        moves = np.where(ways > _PLACE, ways / np.maximum(speeds[1:], 1e-12), 0.0)  # s, how long it moves in the gap
        until = np.append((t + gaps - moves - 0.5 * frame)[:-1], end)
        for k in np.flatnonzero((gaps > _GAP * frame) & (moves <= _SLOW * gaps)):
            times = np.arange(t[k] + _STEP * frame, until[k], _STEP * frame)
            parts.append(Track("", times, np.full(len(times), ball), np.tile(p[k], (len(times), 1))))
    filled = Track(track.name, *(np.concatenate(arrays) for arrays in zip(*(part[1:] for part in parts), strict=True)))
    order = np.argsort(filled.times, kind="stable")
    return filled.rows(order), order >= len(track.times)
