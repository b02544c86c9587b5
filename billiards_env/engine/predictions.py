"""Predictions: the next event of a ball alone, and the next meeting of two balls.

A prediction is valid until an event changes the motion of one of its balls. Cheap tests exclude cushions, pockets and
balls that a path cannot reach. They do not change the results, because their margin is far wider than their rounding.
"""

from __future__ import annotations

import math
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np

from billiards_env.engine.log import (
    BALL_CUSHION,
    BALL_POCKET,
    MOTION_ENDS,
    OFF_TABLE,
)
from billiards_env.jit import allocating, inlined
from billiards_env.physics.elementary import norm
from billiards_env.physics.geometry.contact import (
    IMPULSE_ROUNDING,
    MARGIN,
    TINY,
)
from billiards_env.physics.motion import Path, motion_after
from billiards_env.physics.state import (
    AX,
    AY,
    POTTED,
    REST,
    Time,
    before,
    later,
    moves,
    own_time,
    same,
    since,
)

CROSSING_RANK, POCKET_RANK, PAIR_RANK, CUSHION_RANK, PHASE_RANK = -1, 0, 1, 2, 3
"""The order of events at one instant. CROSSING_RANK is that of a ball that enters another cell of `cell_grid`."""


class QueueKernels(NamedTuple):
    """A queue of predictions: the kernels of `all_pairs`, `one_pair` or `cell_grid`, which describe their arguments.

    Attributes:
        most_contacts: The largest number of contacts at one instant.
        empty_scratch: The `Scratch` of their resolution; None for one contact.
        empty_queue: The arrays of the queue.
        clear: Removes all predictions.
        predict: Predicts the next events of balls.
        earliest: The next event.
        due: The balls that an event of single balls concerns.
        gather: The contacts of the impacts at an instant. It advances their balls.
    """

    most_contacts: Any
    empty_scratch: Any
    empty_queue: Any
    clear: Any
    predict: Any
    earliest: Any
    due: Any
    gather: Any


def queue_of(module: ModuleType) -> QueueKernels:
    """Returns the kernels of a module."""
    return QueueKernels(*(getattr(module, name) for name in QueueKernels._fields))


class Singles(NamedTuple):
    """The next event of each of n balls alone: a cushion, a pocket or the end of its phase.

    Attributes:
        hi: (n,) float64, time, s; infinite if the ball has no event.
        lo: (n,) float64, its second part.
        kind: (n,) int64, the kind of event; undefined if the time is infinite.
        other: (n,) int64, the cushion, the pocket or -1; undefined if the time is infinite.
    """

    hi: Any
    lo: Any
    kind: Any
    other: Any


class NextEvent(NamedTuple):
    """The next event.

    Attributes:
        time: Infinite if there is none.
        rank: Its place among the events of that time, one of the ranks above.
        first: No ball of the event has a lower number. Used by `all_pairs.due` only.
        last: No ball of the event has a higher number.
    """

    time: Time
    rank: int
    first: int
    last: int


@allocating
def empty_singles(n):
    """Returns the `Singles` of n balls, with undefined content."""
    times, events = np.empty((2, n)), np.empty((2, n), np.int64)
    return Singles(times[0], times[1], events[0], events[1])


@inlined
def rank_of(kind):
    """Returns the rank of an event of a ball alone."""
    if kind in (BALL_POCKET, OFF_TABLE):
        return POCKET_RANK
    return CUSHION_RANK if kind == BALL_CUSHION else PHASE_RANK


@inlined
def single_time(singles, i):
    """Returns the `Time` of the next event of ball i alone."""
    return Time(singles.hi[i], singles.lo[i])


@inlined
def next_event(meeting, singles):
    """Returns the `NextEvent`: a meeting at a `Time`, or the events of balls alone if they come first."""
    time, rank, first, last = meeting, PAIR_RANK, 0, -1
    for i in range(len(singles.hi)):
        single = single_time(singles, i)
        if single.hi > time.hi or single.hi == math.inf:
            continue
        r = rank_of(singles.kind[i])
        if before(single, time) or (same(single, time) and r < rank):
            time, rank, first, last = single, r, i, i
        elif same(single, time) and r == rank:
            last = i
    return NextEvent(time, rank, first, last)


@inlined
def predict_single(i, state, scene, singles):  # out: singles
    """Predicts the next event of ball i alone, from its own time on."""
    singles.hi[i], singles.lo[i] = math.inf, 0.0
    if state.phase[i] in (REST, POTTED):
        return
    end, kind, other = scene.space.event_alone(i, state, scene)
    if end < math.inf:
        time = later(own_time(state, i), end)
        singles.hi[i], singles.lo[i] = time.hi, time.lo
        singles.kind[i], singles.other[i] = kind, other


@inlined
def can_meet(i, j, state):
    """Returns whether balls i and j are in play and at least one of them moves."""
    return state.phase[i] != POTTED and state.phase[j] != POTTED and (moves(state, i) or moves(state, j))


@inlined
def meeting_bound(path, reach, end):
    """Returns a lower bound of the time at which two balls meet, s; infinite if they do not meet by `end`.

    It has no branches, so that it can be vectorised.

    Args:
        path: The `Path` of one centre relative to the other.
        reach: Distance of the centres at contact, m, or a larger one, such as the sum of the radii of spheres.
        end: End of the interval, s, finite.
    """
    dx, dy, wx, wy, bx, by = path
    dd = dx * dx + dy * dy
    # Upper bound on their mean speed of approach along the line of centres, times their distance
    dw, half_db = dx * wx + dy * wy, 0.5 * (dx * bx + dy * by)
    closing = max(0.0, -dw) + end * max(0.0, -half_db)
    gap = (1.0 - MARGIN) * dd - reach * math.sqrt(dd)
    # Lower bound on the distance at which they pass each other, times the relative speed
    side = abs(dx * wy - dy * wx) - 0.5 * end * end * abs(wx * by - wy * bx)
    wide = (side > 0.0) & (side * side > (1.0 + MARGIN) * reach * reach * (wx * wx + wy * wy) + TINY)
    outside = dd >= (1.0 + 1e-5) * reach * reach
    bound = math.inf if (gap > end * closing) | wide else gap / closing
    return bound if outside else 0.0


@inlined
def predict_pair(i, j, state, scene, singles):
    """Returns the `Time` at which balls i and j next meet, infinite if they do not.

    The prediction starts at the later of their own times, so its bits do not depend on when it is made, nor on the time
    at which the shot is cut.

    Args:
        i: A ball.
        j: The other ball.
        state: The `State`.
        scene: The `SceneArrays`.
        singles: The `Singles`.
    """
    if not can_meet(i, j, state):
        return Time(math.inf, 0.0)
    now = own_time(state, i)
    if before(now, own_time(state, j)):
        now = own_time(state, j)
    # This prediction is valid only until the phase of either ball ends, so not at all if a phase ends now.
    for k in (i, j):
        if singles.hi[k] <= now.hi and singles.kind[k] in MOTION_ENDS:
            return Time(math.inf, 0.0)
    end = min(singles.hi[i], singles.hi[j]) - now.hi
    xi, yi, vxi, vyi = motion_after(state, i, since(now, own_time(state, i)))
    xj, yj, vxj, vyj = motion_after(state, j, since(now, own_time(state, j)))
    rows = state.rows
    path = Path(xj - xi, yj - yi, vxj - vxi, vyj - vyi, rows[j, AX] - rows[i, AX], rows[j, AY] - rows[i, AY])
    if meeting_bound(path, scene.radius[i] + scene.radius[j], end) == math.inf:
        return Time(math.inf, 0.0)
    noise = IMPULSE_ROUNDING * (norm(vxi, vyi) + norm(vxj, vyj))
    t = scene.space.meeting_time(i, j, now, path, end, noise, state, scene)
    return later(now, t) if t < math.inf else Time(math.inf, 0.0)
