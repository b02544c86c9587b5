"""Reads files of tracks: CSV files in the forms of many programs, and JSON files with lists for each ball."""

from __future__ import annotations

import csv
import math
import os
import re
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from billiards_env.calibration.tracks import Track
from billiards_env.checks import RANGES, number, one_of, short
from billiards_env.files import read_text
from billiards_env.shots.records import data_of

MAX_BYTES = 64 * 2**20
"""The largest file that is read: more than a million rows."""

UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "in": 0.0254, "inch": 0.0254, "px": 1.0}
"""Metres in each unit of length; pixels need a frame."""

_SECONDS = {"s": 1.0, "ms": 1e-3}
_NAMES = {
    "shot": ("shot", "id", "trial"),
    "ball": ("ball", "name", "colour", "color"),
    "time": ("time", "t", "seconds"),
    "x": ("x",),
    "y": ("y",),
}
_MOVES = 0.008  # m, after which a ball has moved
_SAME = 1e-6  # s, rows of a ball at one time

Row = tuple[float, str, float, float]


def read_tracks(path: str | os.PathLike[str], unit: str = "m") -> list[Track]:
    """Reads a file of tracks, compressed by gzip if its name ends in ".gz".

    A CSV file has columns with headings as in `_NAMES`, in any order and any case, such as "X [mm]" or "t (s)"; other
    columns are ignored. Commas, semicolons or tabs separate them; with the last two, numbers may have decimal commas.
    Lines that begin with "#" and rows without x or y are ignored. A JSON file is a list of shots {"id": ..., "balls":
    {name: {"t": [...], "x": [...], "y": [...]}}}.

    Balls that are whole numbers, one of them 0, are numbered as in the scene. Otherwise the ball of a shot that moves
    first is the cue ball, and the others follow in the order of their names.

    Args:
        path: The file.
        unit: The unit of x and y without a unit in their heading, one of `UNITS`.

    Returns:
        The shots in the order in which they begin in the file.

    Raises:
        OSError: If the file is no regular file or cannot be read.
        ValueError: If the file is larger than `MAX_BYTES`, a column is missing, or a line is invalid; the message names
            the line.
    """
    one_of("unit", unit, tuple(UNITS))
    name, text = os.fspath(path), read_text(path, MAX_BYTES, "tracks")
    shots: dict[str, list[Row]] = {}
    for shot, row in (_from_json if text.lstrip()[:1] in ("[", "{") else _from_csv)(name, text, unit):
        shots.setdefault(shot, []).append(row)
    values = {row[1]: number(row[1]) for rows in shots.values() for row in rows}
    whole = all(isinstance(value, float) and value.is_integer() for value in values.values())
    numbered = whole and min(values.values(), default=1.0) <= 0.0
    index = {ball: int(value) for ball, value in values.items()} if numbered else None
    most = int(RANGES["balls"].most or 0)
    for ball, k in (index or {}).items():
        if not 0 <= k < most:
            raise ValueError(f"{name}: ball = {ball}: expected a whole number from 0 to {most}")
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


def _from_csv(path: str, text: str, unit: str) -> Iterator[tuple[str, Row]]:
    """Yields the name of a shot and a row."""
    lines = [one for one in enumerate(text.splitlines(), 1) if one[1].strip(" \t;,") and one[1][0] != "#"]
    line, first = lines[0] if lines else (1, "")
    mark = next((mark for mark in ("\t", ";") if mark in first), ",")
    try:
        table = ([cell.strip() for cell in cells] for cells in csv.reader((text for _, text in lines), delimiter=mark))
        head = next(table, [""])
        at, units = _columns(head, unit)
        for (line, _), cells in zip(lines[1:], table, strict=True):  # noqa: B007
            if len(cells) != len(head):
                raise ValueError(f"{len(cells)} cells: expected {len(head)}")
            shot, ball, *given = (cells[k] if k >= 0 else "" for k in at)
            if any(cell == "" or cell.lower() == "nan" for cell in given[1:]):
                continue
            given = [cell.replace(",", ".") if mark != "," else cell for cell in given]
            t, x, y = (_finite(*cell) * one for *cell, one in zip(("time", "x", "y"), given, units, strict=True))
            yield shot, (t, ball, x, y)
    except (ValueError, csv.Error) as error:
        raise ValueError(f"{path}, line {line}: {error}") from error


def _columns(head: Sequence[str], unit: str) -> tuple[list[int], tuple[float, float, float]]:
    """Returns the columns of shot (or -1), ball, time, x and y, and the units of time, x and y."""
    split = [re.match(r"\s*(.*?)\s*(?:[\[(]\s*(\w*)\s*[\])])?\s*$", cell.lower()) for cell in head]
    names, units = zip(*((m[1], m[2] or "") for m in split if m), strict=True)
    at: list[int] = []
    for column, others in _NAMES.items():
        places = [k for k, name in enumerate(names) if name in others]
        if len(places) != 1 and not (column == "shot" and not places):
            raise ValueError(f"head = {short(','.join(head))}: expected one column {column!r}")
        at.append(places[0] if places else -1)
    time, x, y = (units[k] for k in at[2:])
    one_of("unit of time", time or "s", tuple(_SECONDS))
    for one in (x, y):
        one_of("unit", one or unit, tuple(UNITS))
    return at, (_SECONDS[time or "s"], UNITS[x or unit], UNITS[y or unit])


def _finite(name: str, cell: Any) -> float:
    value = number(cell) if isinstance(cell, str) else cell
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise ValueError(f"{name} = {short(cell)}: expected a finite number")
    return float(value)


def _track(shot: str, rows: list[Row], index: dict[str, int] | None) -> Track:
    """Returns the track of a shot, in which the cue ball is ball 0. Balls without numbers have the index None."""
    names = sorted({row[1] for row in rows})
    times, places = np.array([row[0] for row in rows]), np.array([row[2:] for row in rows])
    track = Track(shot, times, np.array([names.index(row[1]) for row in rows]), places)
    order = np.lexsort((track.times, track.balls))
    ordered, keep = track.rows(order), np.ones(len(rows), np.bool_)
    again = (np.diff(ordered.balls) == 0) & (np.diff(ordered.times) < _SAME)
    keep[order[1:][again]] = False  # the ball was found twice in a frame
    keep[order[:-1][again & (np.hypot(*np.diff(ordered.positions, axis=0).T) > _MOVES)]] = False  # at two places
    if index is None:
        least = max(_MOVES, 1e-3 * float(np.abs(places).max()))
        begins = [np.append(t[np.hypot(*(p - p[0]).T) > least], np.inf)[0] for t, p in ordered.paths().values()]
        first = names[int(np.argmin(begins))]
        index = {name: k for k, name in enumerate(sorted(names, key=lambda name: name != first))}
    return track._replace(balls=np.array([index[name] for name in names])[track.balls]).rows(keep)
