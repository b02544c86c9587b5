"""The contacts in a track, found without a model: where the path of a ball has a corner at a cushion or at a ball."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

from billiards_env.calibration.tracks import Floats, Track
from billiards_env.scene import Scene

CUSHION, POCKET = -1, -2
"""The partners of a ball in a contact with a cushion and with a pocket."""

_ROWS = 3  # rows before and after a contact
_TURN = 0.1  # m/s, the least change of the normal velocity at a cushion
_KICK = 0.35  # m/s, the least change of the relative velocity of two balls that move; friction gives 0.2 in 0.1 s
_STARTS = 0.04  # m/s, the least speed of a ball that begins to move
_MOVED, _AWAY = 0.008, 0.04  # m from its first row: there a ball has begun to move, and it gets at least this far
_CLOSE = 0.2  # m, two bodies that are farther apart in all frames have no contact
_NEAR = 0.015  # m, a contact is at most this far from the bodies, besides the way in half a frame
_JUMP = 0.15  # s, the longest time between two frames in which the names of balls are exchanged
_ONE = 0.05  # s, contacts of the same bodies within this time count as one


Paths = dict[int, tuple[Floats, Floats]]


class Contact(NamedTuple):
    """A contact of a ball, in a track or in the model.

    Attributes:
        time: s, as in the track.
        ball: The ball.
        other: The other ball, `CUSHION` or `POCKET`. In a track, `ball` is the cue ball if it is one of two balls,
            and the one with the smaller number otherwise.
        place: (2,) m, the place of the ball.
        speed: The normal speed before the contact, m/s; 0 for balls in a track.
        body: The number of the cushion, of the pocket or of the other ball, as in the events of a shot.
    """

    time: float
    ball: int
    other: int
    place: Floats
    speed: float
    body: int


def find_contacts(scene: Scene, track: Track, cue_ball: int) -> list[Contact]:
    """Returns the contacts of a track whose resting balls have rows, in the order of time.

    The table counts as a rectangle. The search misses a few contacts, such as very thin hits, and finds a few that do
    not exist.

    Args:
        scene: The scene.
        track: The track.
        cue_ball: The cue ball, which begins to move without a hit.
    """
    half = np.array([scene.table.length, scene.table.width]) / 2.0
    paths = dict(sorted(track.paths().items(), key=lambda path: path[0] != cue_ball))  # the cue ball first
    contacts = [contact for i, path in paths.items() for contact in _rebounds(i, *path, half - scene.balls.radius[i])]
    for i, j in itertools.combinations(paths, 2):
        contacts += _hits(i, j, paths[i], paths[j], float(scene.balls.contact_distances(i)[j]))
    return distinct([*contacts, *_missed_hits(scene, paths, cue_ball, contacts)])


def distinct(contacts: Iterable[Contact]) -> list[Contact]:
    """Returns contacts in the order of time. Of several contacts of two bodies within `_ONE`, the first one counts."""
    times, kept = {}, []
    for contact in contacts:
        bodies = contact.ball, contact.other, contact.body
        if abs(contact.time - times.get(bodies, np.inf)) > _ONE:
            kept.append(contact)
        times[bodies] = contact.time
    return sorted(kept, key=lambda contact: contact.time)


def _corners(times: Floats, gap: Floats, values: Floats) -> Iterator[tuple[int, Floats, Floats]]:
    """Yields the rows at which a gap is small and least, and two lines through `values` (r, c): before and after.

    A line is the slopes, and the values at the row, (2, c).
    """
    least = (gap[1:-1] <= gap[:-2]) & (gap[1:-1] <= gap[2:]) & (gap[1:-1] < _CLOSE)
    for k in (1 + np.flatnonzero(least)).tolist():
        sides = slice(max(0, k - _ROWS), k), slice(k + 1, k + 1 + _ROWS)
        if all(len(times[side]) > 1 for side in sides):
            before, after = (np.polyfit(times[side] - times[k], values[side], 1) for side in sides)
            yield k, before, after


def _rebounds(ball: int, times: Floats, places: Floats, reach: Floats) -> Iterator[Contact]:
    """Yields the contacts with the cushions; the centre reaches to abs(x), abs(y) = `reach`, m."""
    for axis, sign in itertools.product((0, 1), (1.0, -1.0)):
        d = sign * places[:, axis]
        values = np.column_stack((d, places[:, 1 - axis]))
        for k, ((v, w), (at, along)), ((v_after, _), (at_after, _)) in _corners(times, reach[axis] - d, values):
            way = 0.5 * (times[k + 1] - times[k - 1]) * (v - v_after)
            if v < 0.25 * _TURN or v_after > 0.0 or v - v_after < _TURN or d[k] < reach[axis] - _NEAR - way:
                continue
            time = float(np.clip(times[k] + (at_after - at) / (v - v_after), times[k - 1], times[k + 1]))
            since = time - times[k]
            place = np.array([sign * (at + v * since), along + w * since])
            yield Contact(time, ball, CUSHION, place[::-1] if axis else place, float(v), 2 * axis + int(sign > 0.0))


def _hits(i: int, j: int, one: tuple[Floats, Floats], two: tuple[Floats, Floats], reach: float) -> Iterator[Contact]:
    """Yields the contacts of two balls, whose centres are then `reach` apart, m."""
    times = np.unique(np.concatenate((one[0], two[0])))
    a, b = (np.column_stack([np.interp(times, t, x) for x in p.T]) for t, p in (one, two))
    distance = np.hypot(*(b - a).T)
    for k, before, after in _corners(times, distance - reach, np.stack((b - a, a, b), axis=1).reshape(len(times), 6)):
        (w, *speeds), (at, _, _) = before.reshape(2, 3, 2)
        (w_after, *later), _ = after.reshape(2, 3, 2)
        starts = any(np.hypot(*u) < 0.5 * _STARTS < 0.5 * np.hypot(*v) for u, v in zip(speeds, later, strict=True))
        speed, kick = np.hypot(*w), np.hypot(*(w_after - w))
        way = 0.5 * (times[k + 1] - times[k - 1]) * speed
        # Two balls whose distance does not change cannot hit.
        if speed < 0.5 * _STARTS or distance[k] > reach + _NEAR + way or kick < (_STARTS if starts else _KICK):
            continue
        root = (at @ w) ** 2 - (w @ w) * (at @ at - reach * reach)  # abs(at + w t) = reach, or least
        since = -(at @ w + np.sqrt(max(root, 0.0))) / (w @ w)
        time = float(np.clip(times[k] + since, times[k - 1], times[k + 1]))
        yield Contact(time, i, j, a[k], 0.0, j)


def _missed_hits(scene: Scene, paths: Paths, cue_ball: int, contacts: Iterable[Contact]) -> Iterator[Contact]:
    """Yields a hit for each ball, except the cue ball, that begins to move but has no hit in `contacts`.

    The hit is with the ball whose distance is closest to contact. A hit is not found if rows are missing at its time,
    or if the ball meets a cushion at once.
    """
    hits = [contact for contact in contacts if contact.other >= 0]
    for ball, (t, p) in paths.items():
        distance = np.hypot(*(p - p[0]).T)
        far = np.convolve(distance > _MOVED, np.ones(_ROWS))[_ROWS - 1 :] == _ROWS  # this row and the next ones
        row = int(far.argmax())
        moves = row > 0 and np.sort(distance)[-_ROWS] > _AWAY
        hit_before = any(ball in (hit.ball, hit.body) and hit.time < t[row] + _ONE for hit in hits)
        if ball == cue_ball or not moves or hit_before:
            continue
        nearest: list[tuple[float, float, int, Floats]] = []
        for other, (times, places) in paths.items():
            reach = float(scene.balls.contact_distances(ball)[other])
            for k in np.flatnonzero((times > t[row - 1]) & (times <= t[row])) if other != ball else ():
                nearest.append((abs(float(np.hypot(*(places[k] - p[0]))) - reach), float(times[k]), other, places[k]))
        if nearest:
            off, time, other, place = min(nearest, key=lambda near: near[0])
            if off < _CLOSE:
                one, two = sorted((ball, other), key=lambda body: (body != cue_ball, body))
                yield Contact(time, one, two, place if one == other else p[0], 0.0, two)


def find_exchange(scene: Scene, track: Track) -> tuple[int, int, float, float]:
    """Returns two balls whose names are exchanged, and the first and the last time of the exchange, s.

    Between two frames each ball jumps to where the other was. The last time is inf if they stay exchanged. Without an
    exchange the result is (-1, -1, inf, inf).
    """
    for (i, one), (j, two) in itertools.combinations(track.paths().items(), 2):
        times, first, second = np.intersect1d(one[0], two[0], return_indices=True)
        a, b = one[1][first], two[1][second]
        stay = np.square(np.diff(a, axis=0)).sum(axis=1) + np.square(np.diff(b, axis=0)).sum(axis=1)
        jump = np.square(b[1:] - a[:-1]).sum(axis=1) + np.square(a[1:] - b[:-1]).sum(axis=1)
        swaps = (jump < 0.5 * stay) & (stay > 2.0 * min(scene.balls.radius) ** 2) & (np.diff(times) < _JUMP)
        at = np.flatnonzero(swaps)
        if at.size:
            return i, j, float(times[at[0] + 1]), float(times[at[1]]) if at.size > 1 else np.inf
    return -1, -1, np.inf, np.inf
