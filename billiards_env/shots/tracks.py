"""Tracks: where the balls of a shot were seen, as software that follows balls in a film writes them.

A file of tracks is a CSV file with the columns shot, time, ball, x and y, in any order; other columns are ignored. A
shot is any text. Times are in seconds, places in metres in the frame of the scene (the origin is the centre of the
table, x runs along its length). Balls are numbered as in the scene, the cue ball is ball 0. A ball without rows in a
shot is not on the table. A frame in which a ball was not found has no row, or empty cells for x and y.
"""

from __future__ import annotations

import csv
import io
import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from billiards_env.checks import RANGES, Range, finite, integer, number, numbers, real, short
from billiards_env.files import read_text, write_whole
from billiards_env.scene import Scene
from billiards_env.shots.result import ShotResult

Floats = NDArray[np.float64]

COLUMNS = ("shot", "time", "ball", "x", "y")

MAX_BYTES = 64 * 2**20
"""The largest file that is read: more than a million rows."""

_BALLS = Range(0, RANGES["balls"].most)
_APART = 1e-6  # s, least time between two rows of a ball; no camera takes frames that fast


class Track(NamedTuple):
    """Where the balls of one shot were seen.

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


def observed(name: str, shot: ShotResult, times: ArrayLike, noise: float = 0.0, seed: int = 0) -> Track:
    """Returns the track that a camera records of a simulated shot.

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
    seen = at[:, None] < shot.trajectory.potted_at
    frame, ball = np.nonzero(seen)
    error = real("noise", noise) * np.random.default_rng(seed).standard_normal((len(frame), 2))
    return Track(name, at[frame], ball, positions[frame, ball] + error)


def read_tracks(path: str | os.PathLike[str]) -> list[Track]:
    """Reads a file of tracks.

    Returns:
        The shots in the order in which they begin in the file.

    Raises:
        OSError: If the file is no regular file or cannot be read.
        ValueError: If the file is larger than `MAX_BYTES`, a column is missing, or a line is invalid; the message names
            the line.
    """
    rows: dict[str, list[tuple[float, int, float, float]]] = {}
    lines = csv.reader(io.StringIO(read_text(path, MAX_BYTES, "tracks"), newline=""))
    line = 1
    try:
        head = [cell.strip() for cell in next(lines, [])]
        for column in COLUMNS:
            if head.count(column) != 1:
                raise ValueError(f"head = {short(','.join(head))}: expected one column {column!r}")
        at = [head.index(column) for column in COLUMNS]
        for cells in lines:
            line = lines.line_num
            if not any(cell.strip() for cell in cells):
                continue
            if len(cells) != len(head):
                raise ValueError(f"{len(cells)} cells: expected {len(head)}")
            row = _row([cells[k].strip() for k in at])
            if row is not None:
                rows.setdefault(cells[at[0]].strip(), []).append(row)
    except (ValueError, csv.Error) as error:
        raise ValueError(f"{os.fspath(path)}, line {line}: {error}") from error
    return [
        Track(name, numbers("time", [r[0] for r in shot]), np.array([r[1] for r in shot]), np.array(shot)[:, 2:])
        for name, shot in rows.items()
    ]


def _row(cells: Sequence[str]) -> tuple[float, int, float, float] | None:
    """Returns time, ball, x and y of a row of a file; None if the ball was not found."""
    _, time, ball, *place = cells
    value = number(ball)  # pandas writes 0.0 for ball 0 if the column has empty cells
    index = integer("ball", int(value) if isinstance(value, float) and value.is_integer() else ball, _BALLS)
    if all(cell == "" or cell.lower() == "nan" for cell in place):
        return None
    values = []
    for name, cell in zip(("time", "x", "y"), (time, *place), strict=True):
        value = number(cell)
        if not isinstance(value, float) or not math.isfinite(value):
            raise ValueError(f"{name} = {short(cell)}: expected a finite number")
        values.append(value)
    return values[0], index, values[1], values[2]


def write_tracks(path: str | os.PathLike[str], tracks: Sequence[Track]) -> None:
    """Writes tracks to a CSV file, completely or not at all.

    Raises:
        OSError: If the file cannot be written.
    """
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(COLUMNS)
    for track in tracks:
        for time, ball, (x, y) in zip(
            track.times.tolist(), track.balls.tolist(), track.positions.tolist(), strict=True
        ):
            table.writerow((track.name, time, ball, x, y))
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
    names = [track.name for track in tracks]
    found = []
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
        found.append(Track(str(track.name), times[order], balls[order].astype(np.int64), positions[order]))
    return found
