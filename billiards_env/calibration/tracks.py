"""Tracks, the places of the balls of a shot in the frames of a film, and their files.

Times are in seconds, places in metres in the frame of the scene (the origin is the centre of the table, x runs along
its length). Balls are numbered as in the scene. The cue ball of a shot is the one that moves first, see
`first_balls`. A ball without rows in a shot is not on the table. A ball at rest needs only one row.
"""

from __future__ import annotations

import csv
import io
import math
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from billiards_env.scene import Scene
from billiards_env.shots.records import data_of
from billiards_env.shots.result import ShotResult
from billiards_env.support.checks import RANGES, Range, array_of, finite, integer, number, numbers, one_of, real, short
from billiards_env.support.files import read_text, write_atomically

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Ints = NDArray[np.intp]

COLUMNS = ("shot", "time", "ball", "x", "y")

MAX_BYTES = 64 * 2**20
"""The largest file that is read: more than a million rows."""

UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "in": 0.0254, "inch": 0.0254, "px": 1.0}
"""Metres in each unit of length; pixels need a frame."""

_SECONDS = {"s": 1.0, "ms": 1e-3}
_HEADINGS = {"shot": "shot|id|trial", "ball": "ball|name|colou?r", "time": "time|t|seconds", "x": "x", "y": "y"}
_OF_BALL = re.compile(r"(.*\S)[ _.]([xy]\s*(?:[\[(].*)?)", re.IGNORECASE)  # a column of one ball, such as "cue_x (mm)"
_EXAMPLE = "'shot,time,ball,x,y' and 'a,0.02,red,0.315,-0.2', or 'time,red_x,red_y' and '0.02,0.315,-0.2'"
_FPS = Range(1.0, 1e5)
_APART = 1e-6  # s, least time between two rows of a ball; no camera takes frames that fast
_MOVES = 0.008  # m, after which a ball has moved
_AWAY, _ROWS = 0.004, 3  # m, and rows: a ball moves if it is farther away in three rows; one may be an outlier
_GAP, _STEP = 5.0, 5.0  # frames without a row of a ball, after which it may have rested, and between added rows
_PLACE = 0.004  # m, two places of a ball at rest
_SLOW = 0.6  # the speed over a gap, over that after it, of a ball that rested first

Row = tuple[float, str, float, float]


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
    balls: Ints
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
    if not isinstance(shot, ShotResult):
        raise TypeError(f"shot = {short(shot)}: expected a ShotResult, the result of simulate")
    at = numbers("times", times)
    positions = shot.at(at)
    assert shot.trajectory is not None
    frame, ball = np.nonzero(at[:, None] < shot.trajectory.potted_at)
    error = real("noise", noise) * np.random.default_rng(integer("seed", seed, "seed")).standard_normal((len(frame), 2))
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
    write_atomically(Path(path), text.getvalue().encode())


def read_tracks(
    path: str | os.PathLike[str], unit: str = "m", fps: float | None = None, columns: Mapping[str, str] | None = None
) -> list[Track]:
    """Reads a file of tracks, compressed by gzip if its name ends in ".gz".

    A CSV file has one row for each ball and frame. Its columns have headings as in `_HEADINGS`, in any order and any
    case, such as "X [mm]" or "t (s)"; other columns are ignored. A file may instead have one row for each frame. Its
    columns are the time, the shot if there are several, and two columns for each ball, such as "cue_x" and "cue_y".
    Commas, semicolons or tabs separate columns. With the last two, numbers may have decimal commas. Lines that begin
    with "#" and places without x or y are ignored. A JSON file is a list of shots {"id": ..., "balls": {name: {"t":
    [...], "x": [...], "y": [...]}}}.

    Balls that are whole numbers, one of them 0, are numbered as in the scene. Otherwise the ball of a shot that moves
    first is ball 0, and the others follow in the order of their names.

    Args:
        path: The file.
        unit: The unit of x and y without a unit in their heading, one of `UNITS`.
        fps: Frames per second of a file that has frame numbers, in a column "frame", instead of times.
        columns: The headings of a CSV file with other headings, by the names in `COLUMNS`, such as {"ball": "object"}.

    Returns:
        The shots in the order in which they begin in the file.

    Raises:
        OSError: If the file is no regular file or cannot be read.
        ValueError: If the file is larger than `MAX_BYTES`, a column is missing, or a line is invalid; the message names
            the line.
    """
    one_of("unit", unit, tuple(UNITS))
    frame = 1.0 if fps is None else 1.0 / real("fps", fps, _FPS)
    for column in columns or ():
        one_of("columns", column, COLUMNS)
    name, text = os.fspath(path), read_text(path, MAX_BYTES, "tracks")
    shots: dict[str, list[Row]] = {}
    if text.lstrip()[:1] in ("[", "{"):
        if columns:
            raise ValueError(f"{name}: expected a CSV file with the argument columns")
        rows = _from_json(name, text, unit)
    else:
        named = {} if fps is None else {"time": "frame"}
        rows = _from_csv(name, text, unit, named | dict(columns or {}))
    for shot, (time, ball, x, y) in rows:
        shots.setdefault(shot, []).append((time * frame, ball, x, y))
    index, most = {row[1]: number(row[1]) for rows in shots.values() for row in rows}, int(RANGES["balls"].most or 0)
    if not all(isinstance(k, float) and k.is_integer() for k in index.values()) or min(index.values(), default=1) > 0:
        index = {}
    for ball, k in index.items():
        if not 0 <= k < most:
            raise ValueError(f"{name}: ball = {ball}: expected a whole number from 0 to {most - 1}")
    return [_track(shot, rows, index) for shot, rows in shots.items()]


def _from_json(path: str, text: str, unit: str) -> Iterator[tuple[str, Row]]:
    """Yields the name of a shot and a row."""
    try:
        for shot in data_of(text, "tracks"):
            for ball, lists in shot["balls"].items():
                for cells in zip(lists["t"], lists["x"], lists["y"], strict=True):
                    t, x, y = map(_finite, ("t", "x", "y"), cells)
                    yield str(shot["id"]), (t, str(ball), UNITS[unit] * x, UNITS[unit] * y)
    except (KeyError, TypeError, AttributeError) as error:
        raise ValueError(
            f"{path}: expected a list of shots with 'id' and 'balls' of 't', 'x', 'y': {error!r}"
        ) from error
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error


def _from_csv(path: str, text: str, unit: str, columns: Mapping[str, str]) -> Iterator[tuple[str, Row]]:
    """Yields the name of a shot and a row."""
    lines = [line if line.strip(" \t;,") and line[0] != "#" else "" for line in text.splitlines()]
    first = next(filter(None, lines), "")
    mark = next((mark for mark in ("\t", ";") if mark in first), ",")
    reader = csv.reader(lines, delimiter=mark)
    table = ([cell.strip() for cell in cells] for cells in reader if cells)
    try:
        rows = _by_ball(_renamed(table, columns))
        at, units = _columns(next(rows), unit)
        for cells in rows:
            shot, ball, *values = (cells[k] if k >= 0 else "" for k in at)
            if any(value.lower() in ("", "nan") for value in values[1:]):
                continue
            values = [value.replace(",", ".") if mark != "," else value for value in values]
            t, x, y = (_finite(*cell) * size for *cell, size in zip(("time", "x", "y"), values, units, strict=True))
            yield shot, (t, ball, x, y)
    except (ValueError, csv.Error) as error:
        raise ValueError(f"{path}, line {max(1, reader.line_num)}: {error}") from error


def _renamed(table: Iterator[list[str]], columns: Mapping[str, str]) -> Iterator[list[str]]:
    """Yields the rows of a table whose head has the names of `columns` in place of their headings."""
    head = next(table, [""])
    for name, heading in columns.items():
        at = [k for k, cell in enumerate(head) if heading.lower() in (cell.lower(), _split(cell)[0])]
        if len(at) != 1:
            raise ValueError(f"head = {short(','.join(head))}: expected one column {heading!r} for {name!r}")
        unit = _split(head[at[0]])[1]
        head = ["" if re.fullmatch(_HEADINGS[name], _split(cell)[0]) else cell for cell in head]
        head[at[0]] = f"{name} ({unit})" if unit else name
    yield head
    yield from table


def _by_ball(table: Iterator[list[str]]) -> Iterator[list[str]]:
    """Yields the head and the rows of a table with one row for each ball and frame.

    If all columns except the time and the shot belong to balls, each row of a frame becomes one row for each ball.
    """
    head = next(table, [""])
    balls = {k: match for k, cell in enumerate(head) if (match := _OF_BALL.fullmatch(cell))}
    others = [k for k in range(len(head)) if k not in balls]
    if not all(re.fullmatch(f"{_HEADINGS['time']}|{_HEADINGS['shot']}", _split(head[k])[0]) for k in others):
        balls = {}
    at, names = {match.groups(): k for k, match in balls.items()}, dict.fromkeys(match[1] for match in balls.values())
    axes = sorted({axis for _, axis in at})
    if balls and not len(balls) == len(at) == 2 * len(names) == len(axes) * len(names):
        raise ValueError(f"head = {short(','.join(head))}: expected two columns for each ball, such as cue_x and cue_y")
    yield [*(head[k] for k in others), "ball", *axes] if balls else head
    for cells in table:
        if len(cells) != len(head):
            raise ValueError(f"{len(cells)} cells: expected {len(head)}")
        for name in names:
            yield [*(cells[k] for k in others), name, *(cells[at[name, axis]] for axis in axes)]
        if not names:
            yield cells


def _split(heading: str) -> tuple[str, str]:
    """Returns the name of a column and its unit, "" without one, in lower case."""
    match = re.fullmatch(r"\s*(.*?)\s*(?:[\[(]\s*(\w*)\s*[\])])?\s*", heading.lower(), re.DOTALL)
    assert match  # every text does
    return match[1], match[2] or ""


def _columns(head: Sequence[str], unit: str) -> tuple[list[int], tuple[float, float, float]]:
    """Returns the columns of shot (or -1), ball, time, x and y, and the units of time, x and y."""
    names, units = zip(*map(_split, head), strict=True)
    at: list[int] = []
    for column, pattern in _HEADINGS.items():
        places = [k for k, name in enumerate(names) if re.fullmatch(pattern, name)]
        if len(places) != 1 and not (column == "shot" and not places):
            more = " (or the argument fps)" if column == "time" else ""
            raise ValueError(f"head = {short(','.join(head))}: expected one column {column!r}{more}, as in {_EXAMPLE}")
        at.append(places[0] if places else -1)
    time, x, y = (units[k] or usual for k, usual in zip(at[2:], ("s", unit, unit), strict=True))
    one_of("unit of time", time, tuple(_SECONDS))
    for length in (x, y):
        one_of("unit", length, tuple(UNITS))
    return at, (_SECONDS[time], UNITS[x], UNITS[y])


def _finite(name: str, cell: Any) -> float:
    value = number(cell)
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise ValueError(f"{name} = {short(cell)}: expected a finite number")
    return float(value)


def _track(shot: str, rows: list[Row], index: dict[str, float]) -> Track:
    """Returns the track of a shot. Without numbers of the balls, `index` is empty, and the first to move is ball 0."""
    times, balls, *places = zip(*rows, strict=True)
    names = sorted(set(balls))
    track = Track(shot, np.array(times), np.array([names.index(ball) for ball in balls]), np.column_stack(places))
    order = np.lexsort((track.times, track.balls))
    ordered, keep = track.rows(order), np.ones(len(rows), np.bool_)
    again = (np.diff(ordered.balls) == 0) & (np.diff(ordered.times) < _APART)
    keep[order[1:][again]] = False  # the ball was found twice in a frame
    keep[order[:-1][again & (np.hypot(*np.diff(ordered.positions, axis=0).T) > _MOVES)]] = False  # at two places
    if not index:
        least = max(_MOVES, 1e-3 * float(np.abs(track.positions).max()))
        begins = _begins(ordered, least)
        first = names[min(begins, key=lambda ball: begins[ball])]
        index = {name: k for k, name in enumerate(sorted(names, key=lambda name: name != first))}
    return track._replace(balls=np.array([index[name] for name in names], np.int64)[track.balls]).rows(keep)


def _begins(track: Track, least: float) -> dict[int, float]:
    """Returns the time at which each ball begins to move, s; inf if it stays within `least` of its first place.

    The time comes from the speed between the first two rows after it, and lies between the rows around it.
    """
    begins = {}
    for ball, (t, p) in track.paths().items():
        way = np.hypot(*(p - p[0]).T)
        moves = np.convolve(way <= least, np.ones(_ROWS))[_ROWS - 1 :] == 0
        k = int(moves.argmax())
        begins[ball] = float(t[k]) if moves[k] else np.inf
        if moves[k] and k + 1 < len(t):
            speed = np.hypot(*(p[k + 1] - p[k])) / max(t[k + 1] - t[k], _APART)
            begins[ball] = float(np.clip(t[k] - way[k] / max(speed, 1e-12), t[k - 1], t[k]))
    return begins


def first_balls(track: Track, noise: float) -> list[int]:
    """Returns the balls that begin to move within one frame from the first one. The first of them is the cue ball.

    Args:
        track: The track with rows of balls at rest, in the order of time.
        noise: Standard deviation of a coordinate, m.

    Raises:
        ValueError: If no ball moves, or there are several without ball 0.
    """
    begins = _begins(track, max(_AWAY, 4.0 * noise))
    latest = min(begins.values()) + _frame_of(track)
    first = [ball for ball, begin in begins.items() if begin < latest]
    if not first:
        raise ValueError(f"shots[{track.name!r}]: no ball moves: expected one that was struck")
    if len(first) > 1 and 0 not in first:
        raise ValueError(
            f"shots[{track.name!r}]: balls {first} begin to move in one frame: expected one, or ball 0 too"
        )
    return first


def _frame_of(track: Track) -> float:
    """Returns the time between two frames, s; 1 if there is only one frame."""
    steps = np.diff(np.unique(track.times))
    return float(np.median(steps[steps > _APART])) if (steps > _APART).any() else 1.0


def check_tracks(scene: Scene, tracks: Sequence[Track]) -> list[Track]:
    """Returns tracks with their rows in the order of time.

    Raises:
        ValueError: If there are no tracks, two have the same name, an array has a wrong shape or a number that is not
            finite, a ball is not in the scene or has two rows at one time, or a track has no rows.
    """
    if not tracks:
        raise ValueError("shots = []: expected one track or more")
    names, checked = [track.name for track in tracks], []
    for track in tracks:
        name = f"shots[{track.name!r}]"
        if names.count(track.name) > 1:
            raise ValueError(f"{name} appears twice: expected each name once")
        balls = array_of(f"{name}.balls", track.balls)
        k = balls.size
        times = finite(f"{name}.times", track.times, (k,))
        positions = finite(f"{name}.positions", track.positions, (k, 2))
        if (np.abs(times) > RANGES["limit"].most).any():
            raise ValueError(f"{name}.times = {short(times.tolist())}: expected at most {RANGES['limit'].most:g} s")
        if balls.dtype.kind not in "iu" or not ((balls >= 0) & (balls < scene.n_balls)).all():
            raise ValueError(f"{name}.balls = {short(np.unique(balls).tolist())}: expected 0 to {scene.n_balls - 1}")
        if not k:
            raise ValueError(f"{name}: no rows: expected one or more")
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


def with_rest(track: Track) -> tuple[Track, Bools]:
    """Adds rows of balls at rest: many programs write a row only after a ball has moved.

    Returns:
        The track with its rows in the order of time, and whether a row was added.
    """
    end, frame, parts = float(track.times.max()), _frame_of(track), [track]
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
