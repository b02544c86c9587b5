"""What happens next: predictions, each true until an event touches one of the balls concerned.

Of each ball alone the next event is known, `own[i]` = (hi, lo) s, of kind and other `own_kind[i]`. Of each pair i < j
the time of the next meeting stands in `pair[i, j]`, `pair_lo[i, j]`, and the nearest of each row of pairs in `near`.
With many balls their paths stand in `paths`, too, and which of them the one in hand cannot meet in `apart`.

What a path cannot reach is not solved for. That leaves every result as it is, bit for bit: whatever is solved has the
very input that it has if all is solved, and the margins are wider than the rounding by far.
"""

from __future__ import annotations

import math

import numpy as np

from billiards_env.engine.contact_rule import NOISE
from billiards_env.engine.log import BALL_CUSHION, BALL_POCKET, ROLLING_REST, SLIDING_ROLLING, SPINNING_REST
from billiards_env.physics.contact import circle_time, line_time
from billiards_env.physics.jit import allocating, inlined, kernel
from billiards_env.physics.motion import norm, place
from billiards_env.physics.state import (
    AX,
    AY,
    HALF_LENGTH,
    HALF_WIDTH,
    LASTS,
    POTTED,
    REST,
    ROLLING,
    SLIDING,
    T0,
    T0_LO,
    VX,
    VY,
    X,
    Y,
    later,
    since,
)

# The savings, for benchmarks.ablation to compile the engine without one of them.
SKIP = True  # what a path is too short or too far off to reach is not solved for
ROWS = True  # the nearest of each row is kept
SIDE_BY_SIDE = True  # where there are many balls, one instruction looks at several of them

MANY = 8  # balls from which on that pays
LANES = 8  # balls that one instruction looks at, at most

MARGIN = 1e-6  # relative, of what is skipped
TINY = 1e-290  # below it squares lose digits


@inlined
def stays_within(x, v, a, end, room):
    """Whether x + v t + a t^2 / 2 certainly keeps within +-room for t in [0, end], by its Bezier control points."""
    room *= 1.0 - MARGIN
    half = x + 0.5 * end * v
    last = x + end * (v + 0.5 * end * a)
    return abs(x) < room and abs(half) < room and abs(last) < room


@inlined
def predict_ball(i, state, phase, params, radius, pockets, own, own_kind):
    """The next event of ball i alone, counted from its own time: own[i] = (hi, lo), own_kind[i] = (kind, other)."""
    own[i, 0], own[i, 1] = math.inf, 0.0
    p = phase[i]
    if p in (REST, POTTED):
        return
    s = state[i]
    end = s[LASTS]
    kind, other = SPINNING_REST, -1
    if p == SLIDING:
        kind = SLIDING_ROLLING
    elif p == ROLLING:
        kind = ROLLING_REST
    if p >= ROLLING:
        x, y, vx, vy, ax, ay = s[X], s[Y], s[VX], s[VY], s[AX], s[AY]
        room = params[HALF_LENGTH] - radius[i]
        if not (SKIP and stays_within(x, vx, ax, end, room)):
            for k in range(2):
                sign = 1.0 if k else -1.0
                t = line_time(room - sign * x, sign * vx, sign * ax, end)
                if t < end or (t == end and kind != BALL_CUSHION and t < math.inf):
                    end, kind, other = t, BALL_CUSHION, k
        room = params[HALF_WIDTH] - radius[i]
        if not (SKIP and stays_within(y, vy, ay, end, room)):
            for k in range(2):
                sign = 1.0 if k else -1.0
                t = line_time(room - sign * y, sign * vy, sign * ay, end)
                if t < end or (t == end and kind != BALL_CUSHION and t < math.inf):
                    end, kind, other = t, BALL_CUSHION, 2 + k
        bend = 0.5 * end * end * abs(vx * ay - vy * ax)  # how far off its tangent the path ends, times the speed
        vv = (1.0 + MARGIN) * (vx * vx + vy * vy)
        way_x, way_y = end * (abs(vx) + 0.5 * end * abs(ax)), end * (abs(vy) + 0.5 * end * abs(ay))
        for k in range(len(pockets)):
            dx, dy, reach = pockets[k, 0] - x, pockets[k, 1] - y, pockets[k, 2]
            if SKIP:
                side = abs(dx * vy - dy * vx) - bend
                if side > 0.0 and side * side > reach * reach * vv + TINY:
                    continue
                wide = (1.0 + MARGIN) * reach
                if abs(dx) > wide + way_x or abs(dy) > wide + way_y:
                    continue
            t = circle_time(dx, dy, -vx, -vy, -ax, -ay, reach, end, 0.0)
            if t < end or (t == end and kind != BALL_POCKET and t < math.inf):
                end, kind, other = t, BALL_POCKET, k
    if end < math.inf:
        own[i, 0], own[i, 1] = later(s[T0], s[T0_LO], end)
        own_kind[i, 0], own_kind[i, 1] = kind, other


@kernel
def solve_pair(i, j, hi, lo, state, phase, radius, own, own_kind, limit):
    """When balls i < j next meet, looking from (hi, lo), the time of the last event of either: (hi, lo)."""
    # Whatever ends either ball's motion has the pair predicted anew; a change of phase that is due now does so at once.
    for k in (i, j):
        if own[k, 0] <= hi and own_kind[k, 0] in (SLIDING_ROLLING, ROLLING_REST):
            return math.inf, 0.0
    end = min(min(own[i, 0], own[j, 0]), limit) - hi
    ti = since(hi, lo, state[i, T0], state[i, T0_LO])
    tj = since(hi, lo, state[j, T0], state[j, T0_LO])
    xi, yi, vxi, vyi = place(state, phase, i, ti)
    xj, yj, vxj, vyj = place(state, phase, j, tj)
    t = circle_time(
        xj - xi,
        yj - yi,
        vxj - vxi,
        vyj - vyi,
        state[j, AX] - state[i, AX],
        state[j, AY] - state[i, AY],
        radius[i] + radius[j],
        end,
        NOISE * (norm(vxi, vyi) + norm(vxj, vyj)),
    )
    if t == math.inf:
        return math.inf, 0.0
    return later(hi, lo, t)


@inlined
def cannot_meet(dx, dy, wx, wy, bx, by, reach, end):
    """Whether two balls certainly do not meet by `end`, looked at without a root or a branch; see `circle_time`."""
    dd = dx * dx + dy * dy
    # How much nearer they can come along the line of centres until then, times their distance
    dw, half_db = dx * wx + dy * wy, 0.5 * (dx * bx + dy * by)
    closing = max(0.0, -dw) + end * max(0.0, -half_db)
    least = (1.0 - MARGIN) * dd - end * closing
    far = (least > 0.0) & (least * least > reach * reach * dd)
    # How far off the line of relative motion they pass, times the relative speed
    side = abs(dx * wy - dy * wx) - 0.5 * end * end * abs(wx * by - wy * bx)
    wide = (side > 0.0) & (side * side > (1.0 + MARGIN) * reach * reach * (wx * wx + wy * wy) + TINY)
    return (far | wide) & (dd >= (1.0 + 1e-5) * reach * reach) & (end < math.inf)


@allocating
def side_by_side(n):
    """The arrays in which `screen` finds n balls: their paths, a row a quantity, and who is apart from the one in hand.

    There are more columns than balls, so that the last few are not looked at one by one.
    """
    columns = -(-n // LANES) * LANES
    return np.zeros((9, columns)), np.zeros(columns, np.bool_)


@inlined
def note(i, state, radius, own, queue):
    """Notes ball i's path for `screen`, where that is used."""
    if len(radius) < MANY:
        return
    _, _, _, _, paths, _ = queue
    s = state[i]
    paths[0, i], paths[1, i], paths[2, i], paths[3, i] = s[X], s[Y], s[VX], s[VY]
    paths[4, i], paths[5, i], paths[6, i], paths[7, i], paths[8, i] = s[AX], s[AY], s[T0], radius[i], own[i, 0]


@inlined
def screen(i, hi, until, paths, apart):
    """Finds the balls that ball i, whose own time is hi, certainly does not meet by `until` or the end of their paths.

    One instruction looks at several balls.

    Args:
        i: The ball.
        hi: Its own time, s.
        until: When its path, or the shot, ends, s.
        paths: (9, c) float64, of `side_by_side`: x, y, vx, vy, ax, ay, own time, radius and end of each ball's path.
        apart: (c,) bool out.
    """
    x, y, vx, vy, ax, ay = paths[0, i], paths[1, i], paths[2, i], paths[3, i], paths[4, i], paths[5, i]
    radius = paths[7, i]
    for j in range(len(apart)):
        t = hi - paths[6, j]
        apart[j] = cannot_meet(
            paths[0, j] + t * (paths[2, j] + 0.5 * t * paths[4, j]) - x,
            paths[1, j] + t * (paths[3, j] + 0.5 * t * paths[5, j]) - y,
            paths[2, j] + t * paths[4, j] - vx,
            paths[3, j] + t * paths[5, j] - vy,
            paths[4, j] - ax,
            paths[5, j] - ay,
            radius + paths[7, j],
            min(until, paths[8, j]) - hi,
        )


@inlined
def predict_pairs(i, hi, lo, state, phase, radius, own, own_kind, limit, queue, touched):
    """Predicts anew for ball i, whose own time is (hi, lo), with every other ball."""
    n = len(phase)
    pair, pair_lo, near, near_with, paths, apart = queue
    s = state[i]
    x, y, vx, vy, ax, ay = s[X], s[Y], s[VX], s[VY], s[AX], s[AY]
    moves = phase[i] >= ROLLING and phase[i] != POTTED
    until = min(own[i, 0], limit)
    screened = SKIP and SIDE_BY_SIDE and n >= MANY
    if screened:
        screen(i, hi, until, paths, apart)
    near[i, 0], near[i, 1], near_with[i] = math.inf, 0.0, n
    for j in range(n):
        if j == i or (j < i and touched[j]):
            continue
        p = phase[j]
        t, t_lo = math.inf, 0.0
        a, b = min(i, j), max(i, j)
        if p != POTTED and phase[i] != POTTED and (moves or p >= ROLLING):
            skipped = screened and apart[j]
            if SKIP and not screened:
                r = state[j]
                since_j = hi - r[T0]
                skipped = cannot_meet(
                    r[X] + since_j * (r[VX] + 0.5 * since_j * r[AX]) - x,
                    r[Y] + since_j * (r[VY] + 0.5 * since_j * r[AY]) - y,
                    r[VX] + since_j * r[AX] - vx,
                    r[VY] + since_j * r[AY] - vy,
                    r[AX] - ax,
                    r[AY] - ay,
                    radius[i] + radius[j],
                    min(until, own[j, 0]) - hi,
                )
            if not skipped:
                t, t_lo = solve_pair(a, b, hi, lo, state, phase, radius, own, own_kind, limit)
        pair[a, b], pair_lo[a, b] = t, t_lo
        if t < near[a, 0] or (t == near[a, 0] and t_lo < near[a, 1]):
            near[a, 0], near[a, 1], near_with[a] = t, t_lo, b
        elif near_with[a] == b and j < i:
            find_near(a, n, pair, pair_lo, near, near_with)


@kernel
def find_near(i, n, pair, pair_lo, near, near_with):
    """The nearest of the pairs of ball i with balls j > i: near[i] = (hi, lo), near_with[i] = j."""
    t, t_lo, k = math.inf, 0.0, n
    for j in range(i + 1, n):
        if pair[i, j] < t or (pair[i, j] == t and pair_lo[i, j] < t_lo):
            t, t_lo, k = pair[i, j], pair_lo[i, j], j
    near[i, 0], near[i, 1], near_with[i] = t, t_lo, k


POCKET_RANK, PAIR_RANK, CUSHION_RANK, PHASE_RANK = 0, 1, 2, 3
"""The order of events at one instant."""


@inlined
def rank_of(kind):
    """Returns the rank of an event of a ball alone."""
    return POCKET_RANK if kind == BALL_POCKET else (CUSHION_RANK if kind == BALL_CUSHION else PHASE_RANK)


@inlined
def earliest(n, own, own_kind, queue):
    """Returns the earliest prediction: (hi, lo, rank, first, last).

    Unless it is of a pair, the balls that it concerns are among `first` to `last`.
    """
    pair, pair_lo, near, near_with, _, _ = queue
    hi, lo, rank, first, last = math.inf, 0.0, PAIR_RANK, 0, -1
    for i in range(n):
        if not ROWS:
            find_near(i, n, pair, pair_lo, near, near_with)
        if near[i, 0] < hi or (near[i, 0] == hi and near[i, 1] < lo):
            hi, lo = near[i, 0], near[i, 1]
    for i in range(n):
        t, t_lo = own[i, 0], own[i, 1]
        if t > hi or t == math.inf:
            continue
        r = rank_of(own_kind[i, 0])
        if t < hi or t_lo < lo or (t_lo == lo and r < rank):
            hi, lo, rank, first, last = t, t_lo, r, i, i
        elif t_lo == lo and r == rank:
            last = i
    return hi, lo, rank, first, last
