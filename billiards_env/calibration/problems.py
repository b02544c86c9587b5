"""What does not fit in tracks: rows far from the model, swapped balls, and contacts of only one of track and model."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_env.calibration.rows import Bools, Floats, Rows
from billiards_env.shots.result import ShotResult
from billiards_env.shots.simulation import BatchResult

KINDS = ("outliers", "swapped balls", "missed contact", "extra contact", "other path")
"""Rows far from the path; rows of a ball on the path of another; from a time on the track leaves the path of the model,
because only the model has a contact ("missed contact"), only the track ("extra contact"), or for another reason."""

CONTACTS = ("ball_ball", "cushion", "pocket")

_RUN, _OF = 3, 4  # a track has left its path where 3 of 4 consecutive rows of a ball are far from it
_BEFORE, _AFTER = 0.3, 0.05  # s, where the contact is looked for, around the first row far from the path
_CORNER = 4  # rows before and after a corner of a track
_CLEAR = 4.0  # the change of a velocity that is a corner, over its standard deviation


class Problem(NamedTuple):
    """Rows of a track that are reported, and not fitted.

    Attributes:
        shot: Name of the shot.
        kind: One of `KINDS`.
        ball: The ball.
        begin: Time of the first row, s, as in the track.
        end: Time of the last row, s.
        text: A sentence.
    """

    shot: str
    kind: str
    ball: int
    begin: float
    end: float
    text: str


def leaves_at(rows: Rows, far: Bools) -> tuple[Floats, NDArray[np.intp]]:
    """Returns the time from which on the track of a ball leaves its path, (m,) s, inf if none does, and the ball (m,).

    It is the first run of far rows: `_RUN` of `_OF` consecutive rows of a ball. Later rows do not matter.

    Args:
        rows: The rows.
        far: (m, r) bool, whether a row is far from the path.
    """
    times, balls = np.full(len(far), np.inf), np.full(len(far), -1)
    for k in np.flatnonzero(far.any(axis=1)):
        for ball in np.unique(rows.ball[k, far[k]]):
            mine = np.flatnonzero(rows.seen[k] & (rows.ball[k] == ball))
            ahead = np.convolve(far[k, mine], np.ones(_OF))[_OF - 1 :]
            first = np.flatnonzero(far[k, mine] & (ahead >= _RUN))
            if first.size and rows.time[k, mine[first[0]]] < times[k]:
                times[k], balls[k] = rows.time[k, mine[first[0]]], ball
    return times, balls


def find_problems(names: Sequence[str], rows: Rows, begins: Floats, batch: BatchResult, far: Floats) -> list[Problem]:
    """Returns the problems of m tracks.

    Args:
        names: The names of the shots.
        rows: The rows.
        begins: (m, 2) s, the begins of the rows as in the tracks, and the instants of the strikes after it.
        batch: The fitted shots.
        far: (m, r) m, the distances from the path above which a row is not fitted, or 0 for a row that is near.
    """
    found: list[Problem] = []
    leaves, balls = leaves_at(rows, far > 0.0)
    for k in map(int, np.flatnonzero((far > 0.0).any(axis=1))):
        shot, name, zero, ball = batch[k], names[k], float(begins[k, 0]), int(balls[k])
        some = np.flatnonzero(far[k] > 0.0)
        times = rows.time[k, some]
        other = _on_other_path(shot, np.maximum(times - begins[k, 1], 0.0), rows, k, some, far[k, some])
        early = times < leaves[k]
        for i, j in sorted(
            {(int(rows.ball[k, row]), int(b)) for row, b in zip(some[early], other[early], strict=True)}
        ):
            at = zero + times[early & (rows.ball[k, some] == i) & (other == j)]
            count = f"{len(at)} row{'s' if len(at) > 1 else ''} of ball {i}"
            when = f"{at[0]:.3f} s" if len(at) == 1 else f"{at[0]:.3f} to {at[-1]:.3f} s"
            kind, where = ("outliers", "far from its path") if j < 0 else ("swapped balls", f"on the path of ball {j}")
            found.append(Problem(name, kind, i, at[0], at[-1], f"{count} {where}, {when}"))
        if np.isfinite(leaves[k]):
            kind, at, why = _contact(shot, rows, k, ball, leaves[k], float(begins[k, 1]))
            last, leave = zero + float(rows.time[k, rows.seen[k]].max()), zero + float(leaves[k])
            text = f"the track of ball {ball} leaves the model at {leave:.3f} s"
            found.append(Problem(name, kind, ball, leave, last, f"{text}: {why} at {zero + at:.3f} s" if why else text))
    return found


def _on_other_path(
    shot: ShotResult, times: Floats, rows: Rows, k: int, some: NDArray[np.intp], most: Floats
) -> NDArray[np.intp]:
    """Returns the other ball on whose path rows of shot k lie, -1 for none."""
    off = shot.at(times) - rows.places[k, some, None]
    distance = np.where(shot.potted & (rows.in_play[k] == 0), np.inf, np.hypot(off[..., 0], off[..., 1]))
    distance[np.arange(len(some)), rows.ball[k, some]] = np.inf
    return np.where(distance.min(axis=1) < most, distance.argmin(axis=1), -1)


def _contact(shot: ShotResult, rows: Rows, k: int, ball: int, leaves: float, instant: float) -> tuple[str, float, str]:
    """Returns the kind of the problem of a track that leaves the model, a time, s, and what is there."""
    assert shot.events is not None
    mine = rows.seen[k] & (rows.ball[k] == ball)
    assert shot.scene is not None
    slows = shot.scene.physics.mu_slide * shot.scene.physics.g
    corner = _corner(rows.time[k, mine], rows.places[k, mine], leaves, slows)
    events = [
        event
        for event in shot.events
        if event["kind"] in CONTACTS
        and (event["ball"] == ball or (event["kind"] == "ball_ball" and event["other"] == ball))
        and leaves - _BEFORE <= event["time"] + instant <= leaves + _AFTER
    ]
    if not events:
        return ("other path", 0.0, "") if corner is None else ("extra contact", corner, "only the track has a contact")
    event = min(events, key=lambda e: abs(e["time"] + instant - (leaves if corner is None else corner)))
    kind, time = str(event["kind"]), float(event["time"]) + instant
    partner = int(event["ball"] if event["other"] == ball else event["other"])
    what = {"ball_ball": f"ball {partner}", "cushion": "a cushion", "pocket": "a pocket"}[kind]
    if corner is None:
        return "missed contact", time, f"only the model has a contact with {what}"
    return "other path", time, f"after a contact with {what}"


def _corner(times: Floats, positions: Floats, leaves: float, slows: float) -> float | None:
    """Returns the time of the sharpest corner of a track near a time, s, or None.

    A velocity that changes by the friction of the cloth, `slows` m/s^2, makes no corner.
    """
    best, found = _CLEAR, None
    for row in range(2, len(times) - 1):
        if not leaves - _BEFORE <= times[row] <= leaves + _AFTER:
            continue
        sides = slice(max(0, row - _CORNER), row), slice(row, row + _CORNER)
        if min(len(times[side]) for side in sides) < 3 or any(np.ptp(times[side]) == 0.0 for side in sides):
            continue
        fits = [np.polyfit(times[side], positions[side], 1, full=True)[:2] for side in sides]
        count = [len(times[side]) for side in sides]
        left = max(sum(float(np.sum(residual)) for _, residual in fits) / (2.0 * sum(count) - 8.0), 1e-18)
        spread = sum(left / (n * float(np.var(times[side]))) for n, side in zip(count, sides, strict=True))
        usual = slows * float(times[sides[1]].mean() - times[sides[0]].mean())
        change = (float(np.hypot(*(fits[1][0][0] - fits[0][0][0]))) - usual) / np.sqrt(2.0 * spread)
        if change > best:
            best, found = change, float(times[row])
    return found
