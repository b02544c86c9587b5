"""The event queue for few balls: the next meeting of every pair, in a table.

`engine.cell_grid` has the same public functions, for many balls: `empty_queue`, `most_contacts`, `clear`, `predict`,
`earliest`, `due` and `gather`. `engine.pic` calls them.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from billiards_env.engine.pic_events import add_contact
from billiards_env.engine.predictions import (
    PAIR_RANK,
    NextEvent,
    Singles,
    can_meet,
    cannot_meet,
    empty_singles,
    predict_pair,
    predict_single,
    rank_of,
    single_time,
)
from billiards_env.jit import allocating, inlined, kernel
from billiards_env.physics.motion import Path, difference, path_after, path_of
from billiards_env.physics.state import AX, AY, T0, VX, VY, Time, X, Y, before, same

MANY = 8
"""From this number of balls on, `screen` compares a ball with all others before pairs are predicted."""

LANES = 8  # largest number of doubles that one processor instruction handles

SOON = 1e-6
"""s. Pairs that are predicted to meet at most this long after an impact are tested for contact at it."""


# Rows of `Queue.paths`. A path starts at the ball's own time and ends at the time of the ball's next event alone. The
# first rows are X to AY, as in `State.rows`, with the position and the velocity at its start.
PATH_START, PATH_END, PATH_RADIUS, PATH_ROWS = 6, 7, 8, 9


class Queue(NamedTuple):
    """The predictions for n balls.

    Attributes:
        singles: The `Singles`.
        hi: (n, n) float64, s: element (i, j) with i < j is the time of their next meeting; the others are undefined.
        lo: (n, n) float64, its second part.
        nearest_hi: (n,) float64, the earliest time of row i of `hi`.
        nearest_lo: (n,) float64, its second part.
        nearest: (n,) int64, the ball j of that meeting; n if there is none.
        paths: (PATH_ROWS, c) float64, copies of the balls' paths for `screen`, in SI units; None for at most two balls.
            c is at least n and a multiple of `LANES`, so that vectorised loops have no remainder.
        apart: (c,) bool, scratch: the balls that `screen` has excluded.
        changed: (n,) bool, the balls that `predict` was called for; False between calls.
    """

    singles: Singles
    hi: Any
    lo: Any
    nearest_hi: Any
    nearest_lo: Any
    nearest: Any
    paths: Any
    apart: Any
    changed: Any


@allocating
def empty_queue(scene, paths):
    """Returns the `Queue` for the balls of a scene, with undefined predictions.

    `paths` is a result of `empty_paths`; None for at most two balls.
    """
    n = len(scene.radius)
    queue = Queue(
        singles=empty_singles(n),
        hi=np.empty((n, n)),
        lo=np.empty((n, n)),
        nearest_hi=np.empty(n),
        nearest_lo=np.empty(n),
        nearest=np.empty(n, np.int64),
        paths=paths,
        apart=np.empty(_lanes(n), np.bool_),
        changed=np.empty(n, np.bool_),
    )
    for i in range(n):  # `np.zeros` would be another function to compile
        queue.changed[i] = False
    return queue


@allocating
def empty_paths(n):
    """Returns `Queue.paths` for n balls."""
    return np.zeros((PATH_ROWS, _lanes(n)))


@inlined
def _lanes(n):
    """Returns the smallest multiple of `LANES` that is at least n."""
    return -(-n // LANES) * LANES


@allocating
def most_contacts(scene):
    """Returns the largest number of contacts at one instant."""
    n = len(scene.radius)
    return max(1, n * (n - 1) // 2)


@inlined
def clear(state, scene, queue):
    """Does nothing. The first call of `predict` in a shot is for all balls, so it writes all predictions."""


@inlined
def _copy_path(i, state, scene, singles, paths):  # out: paths
    """Copies ball i's path for `screen`."""
    if paths is None:
        return
    s = state.rows[i]
    for c in range(PATH_START):
        paths[c, i] = s[c]
    paths[PATH_START, i], paths[PATH_END, i], paths[PATH_RADIUS, i] = s[T0], singles.hi[i], scene.radius[i]


@inlined
def _path(paths, i):
    """Returns the `Path` of ball i in `Queue.paths`."""
    return Path(paths[X, i], paths[Y, i], paths[VX, i], paths[VY, i], paths[AX, i], paths[AY, i])


@inlined
def screen(i, now, until, paths, apart):  # out: apart
    """Finds balls that ball i does not meet while both paths are valid. One instruction compares several balls.

    Args:
        i: The ball, whose own time is `now`.
        now: s.
        until: End of ball i's path or of the shot, s.
        paths: `Queue.paths`.
        apart: (c,) bool out.
    """
    if paths is None:
        return
    own, radius = _path(paths, i), paths[PATH_RADIUS, i]
    for j in range(len(apart)):
        path = difference(path_after(_path(paths, j), now - paths[PATH_START, j]), own)
        apart[j] = cannot_meet(path, radius + paths[PATH_RADIUS, j], min(until, paths[PATH_END, j]) - now)


@inlined
def _apart_now(i, j, now, until, state, scene, singles):
    """Returns whether balls i and j do not meet, as `screen` does for one ball j."""
    path = difference(path_after(path_of(state, j), now - state.rows[j, T0]), path_of(state, i))
    return cannot_meet(path, scene.radius[i] + scene.radius[j], min(until, singles.hi[j]) - now)


@inlined
def _predict_pairs(i, now, state, scene, queue):  # out: queue
    """Predicts the meetings of ball i, whose own time is `now`, with all other balls."""
    n, singles = len(scene.radius), queue.singles
    until = singles.hi[i]
    if n >= MANY:
        screen(i, now.hi, until, queue.paths, queue.apart)
    queue.nearest_hi[i], queue.nearest_lo[i], queue.nearest[i] = math.inf, 0.0, n
    for j in range(n):
        if j == i or (j < i and queue.changed[j]):  # ball j predicts this pair
            continue
        time = Time(math.inf, 0.0)
        a, b = min(i, j), max(i, j)
        if can_meet(i, j, state):
            apart = queue.apart[j] if n >= MANY else _apart_now(i, j, now.hi, until, state, scene, singles)
            if not apart:
                time = predict_pair(a, b, now, state, scene, singles)
        queue.hi[a, b], queue.lo[a, b] = time.hi, time.lo
        if before(time, Time(queue.nearest_hi[a], queue.nearest_lo[a])):
            queue.nearest_hi[a], queue.nearest_lo[a], queue.nearest[a] = time.hi, time.lo, b
        elif queue.nearest[a] == b and j < i:
            _find_nearest(a, queue)


@kernel
def _find_nearest(i, queue):  # out: queue
    """Finds the earliest meeting of ball i with the balls j > i."""
    nearest, k = Time(math.inf, 0.0), len(queue.nearest)
    for j in range(i + 1, len(queue.nearest)):
        time = Time(queue.hi[i, j], queue.lo[i, j])
        if before(time, nearest):
            nearest, k = time, j
    queue.nearest_hi[i], queue.nearest_lo[i], queue.nearest[i] = nearest.hi, nearest.lo, k


@inlined
def predict(changed, count, now, state, scene, queue):  # out: queue
    """Predicts the next events of the first `count` balls of `changed`, whose own time is `now`.

    Returns:
        The amount of work, in the unit of `runner.LOOK_AFTER`; negative if it was interrupted.
    """
    many = len(scene.radius) >= MANY
    for c in range(count):
        i = changed[c]
        predict_single(i, state, scene, queue.singles)
        if many:
            _copy_path(i, state, scene, queue.singles, queue.paths)
        queue.changed[i] = True
    for c in range(count):
        _predict_pairs(changed[c], now, state, scene, queue)
    for c in range(count):
        queue.changed[changed[c]] = False
    return 1


@inlined
def earliest(state, scene, queue, limit):
    """Returns the next `NextEvent`."""
    singles = queue.singles
    time, rank, first, last = Time(math.inf, 0.0), PAIR_RANK, 0, -1
    for i in range(len(queue.nearest)):
        nearest = Time(queue.nearest_hi[i], queue.nearest_lo[i])
        if before(nearest, time):
            time = nearest
    for i in range(len(queue.nearest)):
        single = single_time(singles, i)
        if single.hi > time.hi or single.hi == math.inf:
            continue
        r = rank_of(singles.kind[i])
        if single.hi < time.hi or single.lo < time.lo or (single.lo == time.lo and r < rank):
            time, rank, first, last = single, r, i, i
        elif single.lo == time.lo and r == rank:
            last = i
    return NextEvent(time, rank, first, last)


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
def gather(now, state, scene, queue, contacts):  # out: state, contacts
    """Finds the contacts at a `Time` (pairs that meet, or that touch and approach) and advances their balls to it.

    Returns their number.
    """
    count, n = 0, len(queue.nearest)
    for i in range(n):
        if queue.nearest_hi[i] - now.hi > SOON:
            continue
        for j in range(i + 1, n):
            if queue.hi[i, j] - now.hi > SOON:
                continue
            if add_contact(i, j, Time(queue.hi[i, j], queue.lo[i, j]), now, state, scene, contacts, count):
                count += 1
    return count
