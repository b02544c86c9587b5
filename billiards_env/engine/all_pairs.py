"""The event queue for few balls: the next event of each ball alone, and the meetings of all pairs, in a table.

For most pairs a lower bound of the time of their meeting is enough. When a bound is the earliest of all predictions,
the queue replaces it by the time.

`engine.cell_grid` has the same public functions, for many balls. `predictions.QueueKernels` lists them, and
`engine.pic` calls them.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from billiards_env.engine.meetings import (
    Meetings,
    empty_meetings,
    is_bound,
    least,
    leave_rows,
    pair_at,
    set_time,
    time_of,
)
from billiards_env.engine.pic_events import add_contact
from billiards_env.engine.predictions import (
    Singles,
    can_meet,
    empty_singles,
    meeting_bound,
    next_event,
    predict_pair,
    predict_single,
    rank_of,
    single_time,
)
from billiards_env.jit import allocating, inlined
from billiards_env.physics.clusters import impulses
from billiards_env.physics.motion import Path, difference, path_after, path_of
from billiards_env.physics.state import AX, AY, T0, VX, VY, Time, X, Y, same

SOON = 1e-6
"""s. Pairs that are predicted to meet at most this long after an impact are tested for contact at it."""

MANY = 5
"""From this number of balls on, one instruction compares a ball with several others."""

_LANES = 8  # largest number of doubles that one processor instruction handles
_LONG = 1e300  # s, instead of an infinite time

# Rows of `Queue.paths`. A path starts at the ball's own time and ends at the time of the ball's next event alone. The
# first rows are X to AY, as in `State.rows`, with the position and the velocity at its start.
PATH_START, PATH_END, PATH_RADIUS, PATH_ROWS = 6, 7, 8, 9


class Queue(NamedTuple):
    """The predictions for n balls.

    Attributes:
        singles: The `Singles`.
        meetings: The `Meetings`.
        paths: (PATH_ROWS, c) float64, copies of the balls' paths, in SI units. c is at least n and a multiple of
            `_LANES`, so that vectorised loops have no remainder.
    """

    singles: Singles
    meetings: Meetings
    paths: Any


@allocating
def empty_queue(scene):
    """Returns the `Queue` for the balls of a scene, with undefined predictions."""
    n = len(scene.radius)
    columns = -(-n // _LANES) * _LANES
    return Queue(empty_singles(n), empty_meetings(n, columns), np.zeros((PATH_ROWS, columns)))


@allocating
def most_contacts(scene):
    """Returns the largest number of contacts at one instant."""
    n = len(scene.radius)
    return max(1, n * (n - 1) // 2)


@allocating
def empty_scratch(scene, most):
    """Returns the `Scratch` for `most` contacts of the balls of a scene."""
    return impulses.empty_scratch(len(scene.radius), most, scene.laws.friction, scene.space.axes())


@inlined
def clear(state, scene, queue):
    """Does nothing. The first call of `predict` in a shot is for all balls, so it writes all predictions."""


@inlined
def _copy_path(i, state, scene, singles, paths):  # out: paths
    """Copies ball i's path."""
    s = state.rows[i]
    for c in range(PATH_START):
        paths[c, i] = s[c]
    paths[PATH_START, i], paths[PATH_END, i], paths[PATH_RADIUS, i] = s[T0], min(singles.hi[i], _LONG), scene.radius[i]


@inlined
def _path(paths, i):
    """Returns the `Path` of ball i in `Queue.paths`."""
    return Path(paths[X, i], paths[Y, i], paths[VX, i], paths[VY, i], paths[AX, i], paths[AY, i])


@inlined
def _bound_few(i, now, state, scene, queue):  # out: queue
    """Does what `_bound_many` does, ball by ball, without the copies of the paths."""
    hi, lo, times = queue.meetings.hi, queue.meetings.lo, queue.singles.hi
    for j in range(len(times)):
        hi[i, j], lo[i, j] = math.inf, -math.inf
        if j != i and can_meet(i, j, state):
            path = difference(path_after(path_of(state, j), now - state.rows[j, T0]), path_of(state, i))
            reach, end = scene.radius[i] + scene.radius[j], min(times[i], times[j], _LONG)
            hi[i, j] = now + meeting_bound(path, reach, end - now)


@inlined
def _bound_many(i, now, paths, meetings):  # out: meetings
    """Writes ball i's row: lower bounds of its meetings after `now`, s. One instruction handles several balls."""
    n, until, hi, lo = len(meetings.next), paths[PATH_END, i], meetings.hi, meetings.lo
    own, radius = _path(paths, i), paths[PATH_RADIUS, i]
    for j in range(paths.shape[1]):
        path = difference(path_after(_path(paths, j), now - paths[PATH_START, j]), own)
        bound = meeting_bound(path, radius + paths[PATH_RADIUS, j], min(until, paths[PATH_END, j]) - now)
        hi[i, j] = math.inf if (j == i) | (j >= n) else now + bound
        lo[i, j] = -math.inf


@inlined
def predict(changed, count, now, state, scene, queue):  # out: queue
    """Predicts the next events of the first `count` balls of `changed`, whose own time is `now`.

    Returns:
        The amount of work, in the unit of `runner.LOOK_AFTER`; negative if it was interrupted.
    """
    n, meetings = len(scene.radius), queue.meetings
    for c in range(count):
        predict_single(changed[c], state, scene, queue.singles)
        if n >= MANY:
            _copy_path(changed[c], state, scene, queue.singles, queue.paths)
    for c in range(count):
        i = changed[c]
        if n >= MANY:
            _bound_many(i, now.hi, queue.paths, meetings)
        else:
            _bound_few(i, now.hi, state, scene, queue)
        meetings.next[i] = least(meetings.hi[i], n)
        leave_rows(i, meetings)
    return 1


@inlined
def earliest(state, scene, queue, limit):  # out: queue
    """Returns the next `NextEvent`. Replaces lower bounds of meetings by their times on the way to it."""
    singles, meetings = queue.singles, queue.meetings
    single = least(singles.hi, len(singles.hi))
    while True:
        hi = least(meetings.next, len(singles.hi))
        if hi > single or hi == math.inf:
            return next_event(Time(single, math.inf), singles)
        i, j, time = pair_at(hi, meetings)
        if not is_bound(time):
            return next_event(time, singles)
        set_time(i, j, predict_pair(i, j, state, scene, singles), meetings)


@inlined
def due(event, queue, balls):  # out: balls
    """Lists in `balls`, in order, the balls with a single-ball event of the time and rank of `event`.

    Returns their number.
    """
    count = 0
    for i in range(event.first, event.last + 1):
        if same(single_time(queue.singles, i), event.time) and rank_of(queue.singles.kind[i]) == event.rank:
            balls[count] = i
            count += 1
    return count


@inlined
def gather(now, state, scene, queue, contacts):  # out: state, queue, contacts
    """Finds the contacts at a `Time` (pairs that meet, or that touch and approach) and advances their balls to it.

    Returns their number.
    """
    meetings, first, second = queue.meetings, contacts.first, contacts.second
    n, found, count = len(meetings.next), 0, 0
    for i in range(n):
        if meetings.next[i] - now.hi > SOON:
            continue
        for j in range(n):
            if meetings.hi[i, j] - now.hi > SOON:
                continue
            if is_bound(time_of(i, j, meetings)):
                set_time(i, j, predict_pair(i, j, state, scene, queue.singles), meetings)
            if meetings.hi[i, j] - now.hi <= SOON:
                first[found], second[found] = i, j
                found += 1
    for c in range(found):  # `add_contact` writes the contacts over the first pairs, which are tested already
        i, j = first[c], second[c]
        time, a, b = time_of(i, j, meetings), min(i, j), max(i, j)
        if add_contact(a, b, time, now, state, scene, contacts, count):
            count += 1
    return count
