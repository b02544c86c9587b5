"""Predictions: the next event of a ball alone, and the next meeting of two balls.

A prediction is valid until an event changes the motion of one of its balls. Cheap tests exclude cushions, pockets and
balls that a path cannot reach. They do not change the results, because their margin is far wider than their rounding.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from billiards_env.engine.log import (
    BALL_CUSHION,
    BALL_POCKET,
    LANDING,
    OFF_TABLE,
    ROLLING_REST,
    SLIDING_ROLLING,
    phase_end,
)
from billiards_env.jit import allocating, inlined, kernel
from billiards_env.physics.elementary import norm
from billiards_env.physics.geometry.contact import (
    IMPULSE_ROUNDING,
    MARGIN,
    TINY,
    circle_time,
    contact_distance,
    sphere_time,
)
from billiards_env.physics.geometry.noses import edge_time, falls_back, is_beyond_noses, nose_time, pocket_below
from billiards_env.physics.geometry.pockets import path_to, pocket_exit, pockets_near
from billiards_env.physics.motion import Path, height_of, motion_after, path_of, place_after
from billiards_env.physics.state import (
    AIRBORNE,
    AX,
    AY,
    LASTS,
    POTTED,
    REST,
    ROLLING,
    VZ,
    Time,
    Z,
    before,
    is_airborne,
    later,
    moves,
    own_time,
    same,
    since,
)

CROSSING_RANK, POCKET_RANK, PAIR_RANK, CUSHION_RANK, PHASE_RANK = -1, 0, 1, 2, 3
"""The order of events at one instant. CROSSING_RANK is that of a ball that enters another cell of `cell_grid`."""


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
    phase = state.phase[i]
    if phase in (REST, POTTED):
        return
    end = state.rows[i, LASTS]
    kind, other = phase_end(phase), -1
    if is_airborne(scene.flight, phase):
        end, kind, other = event_in_air(scene.flight, i, state, scene)
    elif phase >= ROLLING:
        path = path_of(state, i)
        t, wall = scene.walls.time(path, scene.radius[i], end, scene)
        if t < math.inf:
            end, kind, other = t, BALL_CUSHION, wall
        first, last = pockets_near(path, end, scene.pockets)
        for k in range(first, last + 1):
            from_pocket, reach = path_to(path, scene.pockets[k])
            t = circle_time(from_pocket, reach, end, 0.0)
            if t < end or (t == end and kind != BALL_POCKET and t < math.inf):
                end, kind, other = t, BALL_POCKET, k
    if end < math.inf:
        time = later(own_time(state, i), end)
        singles.hi[i], singles.lo[i] = time.hi, time.lo
        singles.kind[i], singles.other[i] = kind, other


@inlined
def end_in_air(i, state, scene):
    """Returns how the flight of ball i ends if the ball hits nothing in the air.

    A ball is potted if it lands in a pocket, or in the mouth of one, farther out than a ball on the cloth can be. If
    its centre passes over the line of the noses inside a pocket, it hits the back of the pocket and is potted, if the
    centre leaves the pocket lower than 2/5 of a radius above its height on the cloth (the rule of the simulator
    pooltool). Every other ball whose centre passes over a nose is driven off the table.

    Returns:
        The time, s after the ball's own, the kind of event, and the pocket, or the cushion whose nose the centre passes
        over, or -1.
    """
    flight, path, end, radius = scene.flight, path_of(state, i), state.rows[i, LASTS], scene.radius[i]
    (last, other), kind = edge_time(path, end, flight), OFF_TABLE
    if last >= end:
        last, other = end, pocket_below(*place_after(path, end), radius, scene)
        kind = LANDING if other < 0 else BALL_POCKET
    first_pocket, last_pocket = pockets_near(path, last, scene.pockets)
    for k in range(first_pocket, last_pocket + 1):
        t = pocket_exit(path, scene.pockets[k])
        if t < last and is_beyond_noses(*place_after(path, t), scene):
            last, kind, other = t, OFF_TABLE, -1
            if falls_back(height_of(flight, state, i, t, scene.numbers)[0], radius):
                kind, other = BALL_POCKET, k
    return last, kind, other


@kernel
def event_in_air(flight, i, state, scene):
    """Returns the next event of ball i alone, which is in the air; the result is that of `end_in_air`."""
    if flight is None:
        return math.inf, LANDING, -1
    last, kind, other = end_in_air(i, state, scene)
    if kind == OFF_TABLE:
        other = -1
    path, rise = path_of(state, i), (state.rows[i, Z], state.rows[i, VZ])
    noise = IMPULSE_ROUNDING * norm(norm(path.vx, path.vy), rise[1])
    t, wall = nose_time(path, rise, scene.radius[i], last, noise, flight, scene.numbers.g)
    if t <= last:
        last, kind, other = t, BALL_CUSHION, wall
    return last, kind, other


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
        if singles.hi[k] <= now.hi and singles.kind[k] in (SLIDING_ROLLING, ROLLING_REST, LANDING):
            return Time(math.inf, 0.0)
    end = min(singles.hi[i], singles.hi[j]) - now.hi
    xi, yi, vxi, vyi = motion_after(state, i, since(now, own_time(state, i)))
    xj, yj, vxj, vyj = motion_after(state, j, since(now, own_time(state, j)))
    rows = state.rows
    path = Path(xj - xi, yj - yi, vxj - vxi, vyj - vyi, rows[j, AX] - rows[i, AX], rows[j, AY] - rows[i, AY])
    reach = contact_distance(scene.spheres, scene.radius, i, j)
    if meeting_bound(path, reach, end) == math.inf:
        return Time(math.inf, 0.0)
    noise = IMPULSE_ROUNDING * (norm(vxi, vyi) + norm(vxj, vyj))
    rise = rise_between(state.flight, i, j, now, state, scene.numbers)
    t = meeting_time(rise, path, reach, end, noise)
    return later(now, t) if t < math.inf else Time(math.inf, 0.0)


@inlined
def rise_between(flight, i, j, now, state, numbers):
    """Returns how ball j rises relative to ball i from a `Time` on, or None without flight.

    Returns:
        The relative height z + v t + a t^2 / 2 as (z, v, a), and the sum of the vertical speeds, m/s.
    """
    if flight is None:
        return None
    zi, vzi = height_of(flight, state, i, since(now, own_time(state, i)), numbers)
    zj, vzj = height_of(flight, state, j, since(now, own_time(state, j)), numbers)
    falls_i = numbers.g if state.phase[i] == AIRBORNE else 0.0
    falls_j = numbers.g if state.phase[j] == AIRBORNE else 0.0
    return (zj - zi, vzj - vzi, falls_i - falls_j), abs(vzi) + abs(vzj)


@inlined
def meeting_time(rise, path, reach, end, noise):
    """Returns the time at which two balls meet; `rise` is the result of `rise_between`, the rest as `circle_time`."""
    if rise is None:
        return circle_time(path, reach, end, noise)
    relative, speeds = rise
    if relative == (0.0, 0.0, 0.0):
        return circle_time(path, reach, end, noise)
    return sphere_time(path, relative, reach, end, noise + IMPULSE_ROUNDING * speeds)
