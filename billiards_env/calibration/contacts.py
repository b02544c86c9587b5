"""The contacts in a track, found without a model: where the path of a ball has a corner at a cushion or at a ball."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_env.calibration.tracks import Track
from billiards_env.scene import Scene

Floats = NDArray[np.float64]

CUSHION = -1
"""The partner of a ball in a contact with a cushion."""

_ROWS = 3  # rows before and after a contact
_TURN = 0.1  # m/s, the least change of the normal velocity at a cushion
_KICK = 0.35  # m/s, the least change of the relative velocity of two balls that move; friction gives 0.2 in 0.1 s
_STARTS = 0.04  # m/s, the least speed of a ball that begins to move
_NEAR = 0.015  # m, a contact is at most this far from the bodies, besides the way in half a frame
_JUMP = 0.15  # s, the longest time between two frames in which the names of balls are exchanged
_ONE = 0.05  # s, two corners of a ball at one body within this time are one contact


class Contact(NamedTuple):
    """A contact of a ball.

    Attributes:
        time: s, as in the track.
        ball: The ball.
        other: The other ball, which has a larger number, or `CUSHION`.
        place: (2,) m, the place of the ball.
        speed: Its normal velocity before the contact, m/s; 0 for a contact of balls.
        axis: 0 for a cushion at an end of the table, 1 for one at a side; -1 for a ball.
    """

    time: float
    ball: int
    other: int
    place: Floats
    speed: float
    axis: int


def find_contacts(scene: Scene, track: Track) -> list[Contact]:
    """Returns the contacts of a track whose resting balls have rows, in the order of time.

    The table counts as a rectangle. The search misses a few contacts, such as very thin hits, and finds a few that do
    not exist.
    """
    half = np.array([scene.table.length, scene.table.width]) / 2.0
    paths = {
        int(i): (track.times[mine], track.positions[mine])
        for i in np.unique(track.balls)
        for mine in [track.balls == i]
    }
    found = [one for i, path in paths.items() for one in _rebounds(i, *path, half - scene.balls.radius[i])]
    for i in paths:
        for j in paths:
            if i < j:
                found += _hits(i, j, paths[i], paths[j], float(scene.balls.contact_distances(i)[j]))
    return sorted(found, key=lambda one: one.time)


def _slopes(times: Floats, values: Floats, k: int) -> tuple[Floats, Floats, Floats, Floats] | None:
    """Returns the means and slopes of the rows before and after row k; None without enough rows."""
    before, after = slice(max(0, k - _ROWS), k), slice(k + 1, k + 1 + _ROWS)
    if len(times[before]) < 2 or len(times[after]) < 2:
        return None
    lines = [np.polyfit(times[some] - times[k], values[some], 1) for some in (before, after)]
    return lines[0][1], lines[0][0], lines[1][1], lines[1][0]


def _rebounds(ball: int, times: Floats, places: Floats, reach: Floats) -> list[Contact]:
    """Returns the contacts with the cushions; the centre reaches to abs(x), abs(y) = `reach`, m."""
    found: list[Contact] = []
    for axis in (0, 1):
        for sign in (1.0, -1.0):
            d = sign * places[:, axis]
            peaks = 1 + np.flatnonzero((d[1:-1] >= d[:-2]) & (d[1:-1] >= d[2:]) & (d[1:-1] > 0.93 * reach[axis]))
            for k in peaks.tolist():
                lines = _slopes(times, np.column_stack((d, places[:, 1 - axis])), k)
                if lines is None:
                    continue
                (at, along), (v, w), (at_after, _), (v_after, _) = lines
                way = 0.5 * (times[k + 1] - times[k - 1]) * (v - v_after)
                if v < 0.25 * _TURN or v_after > 0.0 or v - v_after < _TURN or d[k] < reach[axis] - _NEAR - way:
                    continue
                since = float(
                    np.clip((at_after - at) / (v - v_after), times[k - 1] - times[k], times[k + 1] - times[k])
                )
                time = float(times[k]) + since
                if found and found[-1].axis == axis and abs(time - found[-1].time) < _ONE:
                    continue
                place = np.empty(2)
                place[axis], place[1 - axis] = sign * (at + v * since), along + w * since
                found.append(Contact(time, ball, CUSHION, place, float(v), axis))
    return found


def _hits(i: int, j: int, one: tuple[Floats, Floats], two: tuple[Floats, Floats], reach: float) -> list[Contact]:
    """Returns the contacts of two balls, whose centres are then `reach` apart, m."""
    times = np.unique(np.concatenate((one[0], two[0])))
    paths = [np.column_stack([np.interp(times, t, p[:, axis]) for axis in (0, 1)]) for t, p in (one, two)]
    apart = paths[1] - paths[0]
    distance = np.hypot(*apart.T)
    found: list[Contact] = []
    near = 1 + np.flatnonzero((distance[1:-1] <= distance[:-2]) & (distance[1:-1] <= distance[2:]))
    for k in near.tolist():
        lines = [_slopes(times, path, k) for path in (apart, *paths)]
        relative, first, second = lines
        if relative is None or first is None or second is None:
            continue
        at, w, _, w_after = relative
        way = 0.5 * (times[k + 1] - times[k - 1]) * float(np.hypot(*w))
        starts = any(np.hypot(*line[1]) < 0.5 * _STARTS < 0.5 * np.hypot(*line[3]) for line in (first, second))
        least = _STARTS if starts else _KICK
        rests = np.hypot(*w) < 0.5 * _STARTS  # the distance does not change, so the balls cannot hit
        if rests or distance[k] > reach + _NEAR + way or np.hypot(*(w_after - w)) < least:
            continue
        a, b, c = float(w @ w), float(at @ w), float(at @ at) - reach * reach
        root = b * b - a * c
        since = float(-b / a if root < 0.0 else (-b - np.sqrt(root)) / a) if a > 0.0 else 0.0
        time = float(times[k] + np.clip(since, times[k - 1] - times[k], times[k + 1] - times[k]))
        if not found or time - found[-1].time > _ONE:
            found.append(Contact(time, i, j, paths[0][k], 0.0, -1))
    return found


def find_exchange(scene: Scene, track: Track) -> tuple[int, int, float, float] | None:
    """Returns two balls whose names are exchanged, and the times from and until which they are (inf), or None.

    Between two frames each jumps to where the other was.
    """
    balls = [int(ball) for ball in np.unique(track.balls)]
    for i in balls:
        for j in (ball for ball in balls if ball > i):
            one, two = (track.rows(track.balls == ball) for ball in (i, j))
            times, first, second = np.intersect1d(one.times, two.times, return_indices=True)
            a, b = one.positions[first], two.positions[second]
            stay = np.square(np.diff(a, axis=0)).sum(axis=1) + np.square(np.diff(b, axis=0)).sum(axis=1)
            jump = np.square(b[1:] - a[:-1]).sum(axis=1) + np.square(a[1:] - b[:-1]).sum(axis=1)
            found = (jump < 0.5 * stay) & (stay > 2.0 * min(scene.balls.radius) ** 2) & (np.diff(times) < _JUMP)
            at = np.flatnonzero(found)
            if at.size:
                return i, j, float(times[at[0] + 1]), float(times[at[1]]) if at.size > 1 else np.inf
    return None
