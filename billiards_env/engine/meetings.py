"""The next meetings of each ball with all others: a table with a row for each ball.

The meeting of two balls is in the row of the ball whose motion has changed last. When the motion of a ball changes, its
row is written again, and the ball is removed from the other rows. At first the table contains lower bounds of the
times, because most meetings never happen: an earlier event changes the motion of one of the two balls.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from billiards_env.jit import allocating, inlined
from billiards_env.physics.state import Time


class Meetings(NamedTuple):
    """The next meetings of n balls.

    Attributes:
        hi: (n, c) float64, s: element (i, j) is the time of the meeting of balls i and j in row i; infinite if there is
            none. c is at least n; the other columns are undefined.
        lo: (n, c) float64, its second part; -inf if the time is a lower bound.
        next: (n,) float64, the earliest time of row i.
    """

    hi: Any
    lo: Any
    next: Any


@allocating
def empty_meetings(n, columns):
    """Returns the `Meetings` of n balls, with undefined content."""
    return Meetings(np.empty((n, columns)), np.empty((n, columns)), np.empty(n))


@inlined
def least(times, count):
    """Returns the smallest of the first elements of an array, without branches."""
    best = math.inf
    for k in range(count):
        best = times[k] if times[k] < best else best
    return best


@inlined
def is_bound(time):
    """Returns whether a `Time` of the table is only a lower bound."""
    return time.lo == -math.inf


@inlined
def time_of(i, j, meetings):
    """Returns the `Time` of balls i and j in row i."""
    return Time(meetings.hi[i, j], meetings.lo[i, j])


@inlined
def set_time(i, j, time, meetings):  # out: meetings
    """Replaces the time of balls i and j in row i."""
    meetings.hi[i, j], meetings.lo[i, j] = time.hi, time.lo
    meetings.next[i] = least(meetings.hi[i], len(meetings.next))


@inlined
def leave_rows(j, meetings):  # out: meetings
    """Removes ball j from the rows of the other balls."""
    for i in range(len(meetings.next)):
        time = meetings.hi[i, j]
        meetings.hi[i, j] = math.inf
        if time == meetings.next[i] and time < math.inf:
            meetings.next[i] = least(meetings.hi[i], len(meetings.next))


@inlined
def places_of(time, times, count):
    """Returns the first and the last place of a time in the first `count` elements of `times`, without branches."""
    first, last = count, -1
    for k in range(count):
        same = times[k] == time
        first, last = min(first, k if same else count), max(last, k if same else -1)
    return first, last


@inlined
def pair_at(hi, meetings):
    """Returns the row, the column and the `Time` of the earliest meeting, whose time is `hi` up to its second part."""
    row, column, lo, n = 0, 0, math.inf, len(meetings.next)
    top, bottom = places_of(hi, meetings.next, n)
    for i in range(top, bottom + 1):
        first, last = places_of(hi, meetings.hi[i], n)
        for j in range(first, last + 1):
            if meetings.hi[i, j] == hi and meetings.lo[i, j] < lo:
                row, column, lo = i, j, meetings.lo[i, j]
    return row, column, Time(hi, lo)
