"""The margins of recorded shots, and their derivatives: one pass forwards over the log.

A margin is a signed distance to a change of outcome. A ball that does not touch a body has minus the least gap between
the two. For a contact that happened, the flights before it are continued, as if the two did not interact, until the
body is nearest to the ball: the margin is the depth to which the ball is inside the body then. Both are the same
function of the start of the shot, which passes through zero as a hit becomes a miss. Of several approaches the largest
margin counts.

At a nearest point the time derivative of the distance is zero, so the derivative of a margin is that of the positions
at this time (the envelope theorem). If an event ends an approach, the derivative of its time adds to it.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from billiards_env.engine.gradients import (
    RecordedShots,
    Tape,
    apply_event,
    begin_lanes,
    empty_tape,
    flight_until,
    load,
    store,
    trace,
)
from billiards_env.engine.log import (
    BALL,
    BALL_BALL,
    BALL_CUSHION,
    BALL_POCKET,
    KIND,
    OTHER,
    SEGMENT_PHASE,
    SEGMENT_ROW,
    TIME,
    TIME_LO,
)
from billiards_env.jit import allocating_entry_point, inlined, kernel
from billiards_env.jit.interrupt import end_call, interrupted
from billiards_env.physics.derivatives import (
    BALL_WIDTH,
    D_RADIUS,
    D_TIME,
    DVX,
    DVY,
    DX,
    DY,
    d_distance_of,
    flight_lane,
    wall_at,
)
from billiards_env.physics.elementary import norm
from billiards_env.physics.geometry.contact import contact_distance, misses_circle, sweep
from billiards_env.physics.geometry.roots import bracketed_root, quartic
from billiards_env.physics.geometry.walls import (
    HALF_LINE,
    JOINT,
    LINE_X,
    LINE_Y,
    NX,
    NY,
    TIP_RADIUS,
    TIP_X,
    TIP_Y,
    TX,
    TY,
    faces,
    wall_time,
)
from billiards_env.physics.motion import Path, place_after, relative_to
from billiards_env.physics.state import (
    AX,
    AY,
    POCKET_RADIUS,
    POCKET_X,
    POCKET_Y,
    POTTED,
    T0,
    T0_LO,
    VX,
    VY,
    SceneArrays,
    Time,
    X,
    Y,
    before,
    later,
    law_numbers_of,
    scene_of,
    since,
)

_TOUCHING = 1e-9  # m; a gap that is less than minus this is not on the ball's side of a cushion

_LOOK_AFTER = 10_000  # events between two calls of `interrupted`


class MarginsOut(NamedTuple):
    """The margins of a shot of n balls to q bodies: the balls, then the pockets, then the cushions.

    Attributes:
        margin: (n, q) m; minus infinity without an approach, infinity if the path does not turn back.
        time: (n, q) s, when the two are nearest.
        rate: (n, q) m/s: the derivative of the margin by time, at an event that ends the approach.
        slope: (k, n, q) the changes of the margins by the changes of the inputs.
    """

    margin: Any
    time: Any
    rate: Any
    slope: Any


class Pair(NamedTuple):
    """A ball and a body that it may touch: another ball, a pocket or a cushion.

    Attributes:
        ball: The ball.
        other: The other ball; -1 if the body is a pocket or a cushion.
        column: The column of the body in `MarginsOut`.
    """

    ball: Any
    other: Any
    column: Any


class Shot(NamedTuple):
    """A shot during the pass.

    Attributes:
        segments: The pieces of its paths.
        selected: (n, q) bool, the margins to compute.
        inputs: (k, 9 n + NUMBER_INPUTS) the changes of its inputs.
        tangent: (n, k, 7) the changes of the states at the beginning of the current pieces.
        scene: The `SceneArrays`.
        is_sphere: Whether the balls are spheres.
        tape: The `Tape`.
        out: The `MarginsOut`.
    """

    segments: Any
    selected: Any
    inputs: Any
    tangent: Any
    scene: SceneArrays
    is_sphere: bool
    tape: Tape
    out: MarginsOut


@inlined
def _turning(path):
    """Returns the coefficients of half the derivative of the squared distance of a `Path` from the origin."""
    x, y, vx, vy, ax, ay = path
    return x * vx + y * vy, vx * vx + vy * vy + x * ax + y * ay, 1.5 * (vx * ax + vy * ay), 0.5 * (ax * ax + ay * ay)


@kernel
def nearest_time(path, end):
    """Returns the time in [0, end] at which a `Path` is nearest to the origin, s."""
    c1, c2, c3, c4 = _turning(path)
    if c4 == 0.0:
        return min(max(-c1 / c2, 0.0), end) if c2 > 0.0 else 0.0
    # The roots of the derivative of this cubic, in order: the cubic is monotone between them.
    disc, i1, i2 = c3 * c3 - 3.0 * c4 * c2, end, end
    if disc > 0.0:
        root = math.sqrt(disc)
        i1, i2 = (-c3 - root) / (3.0 * c4), (-c3 + root) / (3.0 * c4)
    best, least = 0.0, path.x * path.x + path.y * path.y
    at, slope = 0.0, c1
    for k in range(3):
        to = min(i1 if k == 0 else (i2 if k == 1 else end), end)
        if not to > at:
            continue
        slope_to, t = quartic(c1, c2, c3, c4, 0.0, to), to
        if slope < 0.0 and slope_to > 0.0:
            t = bracketed_root(c1, c2, c3, c4, 0.0, at, to)
        x, y = place_after(path, t)
        if x * x + y * y < least:
            best, least = t, x * x + y * y
        at, slope = to, slope_to
    return best


@kernel
def turn_time(path):
    """Returns the first time at which a `Path` that approaches the origin stops approaching it, s."""
    c1, c2, c3, c4 = _turning(path)
    if c1 >= 0.0:
        return 0.0
    end = -c1 / (path.vx * path.vx + path.vy * path.vy)
    while quartic(c1, c2, c3, c4, 0.0, end) < 0.0:
        end *= 2.0
    return bracketed_root(c1, c2, c3, c4, 0.0, 0.0, end)


@inlined
def path_from(row, begin):
    """Returns the `Path` of a ball with a row of `State.rows` from a `Time`."""
    t = since(begin, Time(row[T0], row[T0_LO]))
    vx, vy, ax, ay = row[VX], row[VY], row[AX], row[AY]
    return Path(row[X] + t * (vx + 0.5 * t * ax), row[Y] + t * (vy + 0.5 * t * ay), vx + t * ax, vy + t * ay, ax, ay)


@inlined
def between(first, second, begin):
    """Returns the `Path` of one ball relative to another from a `Time`, for their rows of `Log.segments`."""
    a, b = path_from(first[SEGMENT_ROW:], begin), path_from(second[SEGMENT_ROW:], begin)
    return Path(a.x - b.x, a.y - b.y, a.vx - b.vx, a.vy - b.vy, a.ax - b.ax, a.ay - b.ay)


@kernel
def _set(pair, margin, normal, rate, now, shot):
    """Stores the margin of a pair.

    Args:
        pair: The `Pair`.
        margin: m.
        normal: Unit vector (x, y) from the ball towards the body.
        rate: As in `MarginsOut`.
        now: The `Time` at which the two are nearest. The lanes then have the positions at this time.
        shot: The `Shot`.
    """
    (i, j, q), (nx, ny), out, tape, scene = pair, normal, shot.out, shot.tape, shot.scene
    count, lanes, n = len(out.slope), tape.lanes, len(scene.radius)
    out.margin[i, q], out.time[i, q], out.rate[i, q] = margin, now.hi, rate
    if count == 0:
        return
    numbers = law_numbers_of(scene.numbers)
    flight = flight_until(shot.segments, tape.current[i], now, numbers)
    load(i, 0, count, shot.inputs, shot.tangent, lanes)
    for c in range(count):
        lane = lanes[c]
        flight_lane(lane, 0, flight)
        out.slope[c, i, q] = nx * lane[DX] + ny * lane[DY]
    if j >= 0:
        flight = flight_until(shot.segments, tape.current[j], now, numbers)
        load(j, 1, count, shot.inputs, shot.tangent, lanes)
        radii = (scene.radius[i], scene.radius[j])
        for c in range(count):
            lane = lanes[c]
            flight_lane(lane, BALL_WIDTH, flight)
            out.slope[c, i, q] += d_distance_of(shot.is_sphere, *radii, lane[D_RADIUS], lane[D_RADIUS + 1])[1]
            out.slope[c, i, q] -= nx * lane[BALL_WIDTH + DX] + ny * lane[BALL_WIDTH + DY]
    elif q >= n + len(scene.pockets):
        for c in range(count):
            out.slope[c, i, q] += lanes[c, D_RADIUS]


@kernel
def _approach(pair, path, t, ends, begin, reach, shot):
    """Stores the margin of a ball to a circle t seconds after `begin`, if it is the largest.

    Args:
        pair: The `Pair`.
        path: The `Path` of the ball relative to the centre from `begin`.
        t: s.
        ends: Whether an event ends the approach then.
        begin: A `Time`.
        reach: Distance of the centres at contact, m.
        shot: The `Shot`.
    """
    x, y = place_after(path, t)
    distance = norm(x, y)
    if reach - distance > shot.out.margin[pair.ball, pair.column] and distance > 0.0:
        nx, ny = -x / distance, -y / distance
        rate = nx * (path.vx + t * path.ax) + ny * (path.vy + t * path.ay) if ends else 0.0
        _set(pair, reach - distance, (nx, ny), rate, later(begin, t), shot)


@inlined
def _pass_circle(pair, path, end, swept, begin, reach, shot):
    """Stores the margin of a ball to a circle on a piece of its path, if it is the largest."""
    i, q = pair.ball, pair.column
    if shot.selected[i, q] and not misses_circle(path, swept, reach - shot.out.margin[i, q]):
        t = nearest_time(path, end)
        if t > 0.0:
            _approach(pair, path, t, t == end, begin, reach, shot)


@inlined
def touches_line(line, x, y):
    """Returns whether the point of a straight cushion that is nearest to a ball lies between its ends."""
    return abs(line[TX] * (x - line[LINE_X]) + line[TY] * (y - line[LINE_Y])) <= line[HALF_LINE] + JOINT


@inlined
def _pass_line(pair, path, end, begin, normal, room, line, shot):
    """Stores the margin of a ball to a straight cushion on a piece of its path, if it is the largest.

    Args:
        pair: The `Pair`.
        path: The `Path` of the ball.
        end: Its end, s.
        begin: The `Time` of its beginning.
        normal: Unit normal (x, y) into the cushion.
        room: Largest coordinate of the ball along the normal, m.
        line: The row of `Outline.lines`; None for a side of a rectangle.
        shot: The `Shot`.
    """
    (i, _, q), (nx, ny) = pair, normal
    if not shot.selected[i, q]:
        return
    v, a = nx * path.vx + ny * path.vy, nx * path.ax + ny * path.ay
    t = end
    if v > 0.0 and v + end * a < 0.0:
        t = -v / a
    elif v + 0.5 * end * a <= 0.0 < end:
        return  # it was nearer before
    x, y = place_after(path, t)
    margin = nx * x + ny * y - room
    if shot.out.margin[i, q] < margin <= _TOUCHING and (line is None or touches_line(line, x, y)):
        _set(pair, margin, normal, v + t * a if t == end else 0.0, later(begin, t), shot)


@inlined
def _pass_cushions(outline, i, first, path, end, swept, begin, shot):
    """Stores the margins of ball i to the cushions on a piece of its path; `first` is the column of cushion 0."""
    radius, numbers = shot.scene.radius[i], shot.scene.numbers
    if outline is None:
        for wall in range(4):
            sign, pair = 1.0 if wall % 2 else -1.0, Pair(i, -1, first + wall)
            if wall < 2:
                _pass_line(pair, path, end, begin, (sign, 0.0), numbers.half_length - radius, None, shot)
            else:
                _pass_line(pair, path, end, begin, (0.0, sign), numbers.half_width - radius, None, shot)
    else:
        _pass_outline(outline, i, first, path, end, swept, begin, shot)


@kernel
def _pass_outline(outline, i, first, path, end, swept, begin, shot):
    """Implements `_pass_cushions` for an outline."""
    radius, lines, tips = shot.scene.radius[i], outline.lines, outline.tips
    for k in range(len(lines)):
        line = lines[k]
        room = line[NX] * line[LINE_X] + line[NY] * line[LINE_Y] - radius
        _pass_line(Pair(i, -1, first + k), path, end, begin, (line[NX], line[NY]), room, line, shot)
    for k in range(len(tips)):
        tip, q = tips[k], first + len(lines) + k
        from_tip, reach = relative_to(path, tip[TIP_X], tip[TIP_Y]), tip[TIP_RADIUS] + radius
        if not shot.selected[i, q] or misses_circle(from_tip, swept, reach - shot.out.margin[i, q]):
            continue
        t = nearest_time(from_tip, end)
        x, y = place_after(path, t)
        if (t > 0.0 or end == 0.0) and faces(tip, x, y):
            _approach(Pair(i, -1, q), from_tip, t, t == end, begin, reach, shot)


@kernel
def _pass_by(i, now, shot):
    """Stores the margins of ball i to bodies that it is nearest to on its current piece until a `Time`."""
    segments, scene, tape = shot.segments, shot.scene, shot.tape
    piece, n = tape.current[i], len(scene.radius)
    if segments[piece, SEGMENT_PHASE] == POTTED:
        return
    row = segments[piece, SEGMENT_ROW:]
    begin = Time(row[T0], row[T0_LO])
    path, end = path_from(row, begin), since(now, begin)
    if end <= 0.0:
        return
    moves = path.vx != 0.0 or path.vy != 0.0
    if moves:
        swept = sweep(path, end)
        for p in range(len(scene.pockets)):
            pocket = scene.pockets[p]
            from_pocket = relative_to(path, pocket[POCKET_X], pocket[POCKET_Y])
            _pass_circle(Pair(i, -1, n + p), from_pocket, end, swept, begin, pocket[POCKET_RADIUS], shot)
        _pass_cushions(scene.outline, i, n + len(scene.pockets), path, end, swept, begin, shot)
    for k in range(n):
        other = segments[tape.current[k]]
        if k == i or other[SEGMENT_PHASE] == POTTED:
            continue
        low, high = min(i, k), max(i, k)
        second = other[SEGMENT_ROW:]
        if not shot.selected[low, high] or not (moves or second[VX] != 0.0 or second[VY] != 0.0):
            continue
        start = Time(second[T0], second[T0_LO])
        if before(start, begin):
            start = begin
        end = since(now, start)
        if end > 0.0:
            path = between(segments[tape.current[low]], segments[tape.current[high]], start)
            reach = contact_distance(scene.spheres, scene.radius, low, high)
            _pass_circle(Pair(low, high, high), path, end, sweep(path, end), start, reach, shot)


@kernel
def _begin(shot):
    """Stores the margins at the start of the shot."""
    segments, scene, start = shot.segments, shot.scene, Time(0.0, 0.0)
    n, selected = len(scene.radius), shot.selected
    for i in range(n):
        if segments[i, SEGMENT_PHASE] == POTTED:
            continue
        path = path_from(segments[i, SEGMENT_ROW:], start)
        for j in range(i + 1, n):
            if selected[i, j] and segments[j, SEGMENT_PHASE] != POTTED:
                reach = contact_distance(scene.spheres, scene.radius, i, j)
                _approach(Pair(i, j, j), between(segments[i], segments[j], start), 0.0, False, start, reach, shot)
        for p in range(len(scene.pockets)):
            pocket = scene.pockets[p]
            if selected[i, n + p]:
                from_pocket = relative_to(path, pocket[POCKET_X], pocket[POCKET_Y])
                _approach(Pair(i, -1, n + p), from_pocket, 0.0, False, start, pocket[POCKET_RADIUS], shot)
        _pass_cushions(scene.outline, i, n + len(scene.pockets), path, 0.0, sweep(path, 0.0), start, shot)


@inlined
def _enter_pocket(i, p, path, now, shot):
    """Stores the margin of ball i that enters pocket p, on its continued `Path` from a `Time`.

    The path ends at the cushion behind the pocket, if the ball is not nearest to the centre before.
    """
    scene, q = shot.scene, len(shot.scene.radius) + p
    pocket, tape, out = scene.pockets[p], shot.tape, shot.out
    from_pocket = relative_to(path, pocket[POCKET_X], pocket[POCKET_Y])
    t, cut = turn_time(from_pocket), False
    limit, wall = wall_time(path, scene.radius[i], t, scene.numbers, scene.outline)
    if limit < t:
        t, cut = limit, True
    _approach(Pair(i, -1, q), from_pocket, t, cut, now, pocket[POCKET_RADIUS], shot)
    if cut:
        x, y = place_after(path, t)
        nx, ny, _ = wall_at(x, y, wall, scene.radius[i], scene.outline)
        speed = nx * (path.vx + t * path.ax) + ny * (path.vy + t * path.ay)
        for c in range(len(out.slope)):
            lane = tape.lanes[c]
            out.slope[c, i, q] -= out.rate[i, q] * (nx * lane[DX] + ny * lane[DY] + lane[D_RADIUS]) / speed
    out.rate[i, q] = 0.0


@inlined
def _hit_cushion(outline, i, wall, piece, path, now, shot):
    """Stores the margin of ball i that touches a cushion before a piece, on its continued `Path` from a `Time`."""
    q = len(shot.scene.radius) + len(shot.scene.pockets) + wall
    if outline is not None and wall >= len(outline.lines):
        _hit_tip(outline.tips[wall - len(outline.lines)], i, q, path, now, shot)
        return
    state = shot.tape.before[piece]
    nx, ny, _ = wall_at(state[DX], state[DY], wall, shot.scene.radius[i], outline)
    v, a = nx * path.vx + ny * path.vy, nx * path.ax + ny * path.ay
    if a >= 0.0:
        out = shot.out
        out.margin[i, q], out.time[i, q], out.rate[i, q] = math.inf, now.hi, 0.0
        for c in range(len(out.slope)):
            out.slope[c, i, q] = 0.0
    elif v > 0.0 and -0.5 * v * v / a > shot.out.margin[i, q]:
        _set(Pair(i, -1, q), -0.5 * v * v / a, (nx, ny), 0.0, later(now, -v / a), shot)


@inlined
def _hit_tip(tip, i, q, path, now, shot):
    """Implements `_hit_cushion` for a tip."""
    from_tip = relative_to(path, tip[TIP_X], tip[TIP_Y])
    reach = tip[TIP_RADIUS] + shot.scene.radius[i]
    _approach(Pair(i, -1, q), from_tip, turn_time(from_tip), False, now, reach, shot)


@kernel
def _meet(e, events, shot):
    """Stores the margin of the contact at event e."""
    segments, scene, tape = shot.segments, shot.scene, shot.tape
    kind, i, other = int(events[e, KIND]), int(events[e, BALL]), int(events[e, OTHER])
    now, piece = Time(events[e, TIME], events[e, TIME_LO]), tape.first[e]
    row, a = segments[tape.current[i], SEGMENT_ROW:], tape.before[piece]
    path = Path(a[DX], a[DY], a[DVX], a[DVY], row[AX], row[AY])
    if kind == BALL_BALL and shot.selected[min(i, other), max(i, other)]:
        second, b = segments[tape.current[other], SEGMENT_ROW:], tape.before[piece + 1]
        sign = 1.0 if i < other else -1.0
        between = Path(
            sign * (a[DX] - b[DX]),
            sign * (a[DY] - b[DY]),
            sign * (a[DVX] - b[DVX]),
            sign * (a[DVY] - b[DVY]),
            sign * (row[AX] - second[AX]),
            sign * (row[AY] - second[AY]),
        )
        low, high = min(i, other), max(i, other)
        reach = contact_distance(scene.spheres, scene.radius, i, other)
        _approach(Pair(low, high, high), between, turn_time(between), False, now, reach, shot)
    elif kind == BALL_POCKET and shot.selected[i, len(scene.radius) + other]:
        _enter_pocket(i, other, path, now, shot)
    elif kind == BALL_CUSHION and shot.selected[i, len(scene.radius) + len(scene.pockets) + other]:
        _hit_cushion(scene.outline, i, other, piece, path, now, shot)


@inlined
def _move_ends(i, shot):
    """Adds the change of an event's time to the changes of the margins of ball i that it ends."""
    out = shot.out
    n = len(out.margin)
    for q in range(out.margin.shape[1]):
        low, high = (min(i, q), max(i, q)) if q < n else (i, q)
        rate = out.rate[low, high]
        if rate != 0.0:
            for c in range(len(out.slope)):
                out.slope[c, low, high] += rate * shot.tape.lanes[c, D_TIME]
            out.rate[low, high] = 0.0


@allocating_entry_point
def push_margins(begin, end, shots, times, inputs, selected, results):
    """Computes the margins of shots `begin` to `end` - 1 and their changes by changes of the inputs.

    Args:
        begin: First shot.
        end: One past the last.
        shots: The `gradients.RecordedShots`, as a plain tuple.
        times: (m,) float64, s: only the shot until then counts.
        inputs: (m, k, 9 n + NUMBER_INPUTS) float64, the changes of the inputs.
        selected: (n, q) bool, the margins to compute; of two balls, those of the lower number to the higher.
        results: Three float64 output arrays, see `MarginsOut`: the margins (m, n, q), minus infinity where not
            selected; the times (m, n, q); the slopes (m, k, n, q).
    """
    shots, (margins, nearest, slopes) = RecordedShots(*shots), results
    _, n, bodies = margins.shape
    is_sphere, count = shots.is_sphere, inputs.shape[1]
    tape = empty_tape(begin, end, shots, max(count, 1))
    tangent, rates, pending = np.empty((n, count, BALL_WIDTH)), np.empty((n, bodies)), 0
    for k in range(begin, end):
        arrays = scene_of(shots.scene, k)
        at, after = shots.bounds[k - shots.first], shots.bounds[k - shots.first + 1]
        log, paths = shots.events[at[0] : after[0]], shots.segments[at[1] : after[1]]
        trace(log, paths, arrays, is_sphere, tape)
        out = MarginsOut(margins[k], nearest[k], rates, slopes[k])
        shot = Shot(
            segments=paths,
            selected=selected,
            inputs=inputs[k],
            tangent=tangent,
            scene=arrays,
            is_sphere=is_sphere,
            tape=tape,
            out=out,
        )
        out.margin[:] = -math.inf
        out.time[:] = 0.0
        out.slope[:] = 0.0
        begin_lanes(n, inputs[k], times[k], paths, arrays, tangent, tape)
        _begin(shot)
        out.rate[:] = 0.0
        for e in range(len(log)):
            if log[e, TIME] > times[k]:
                break
            balls = 2 if log[e, KIND] == BALL_BALL else 1
            for s in range(balls):
                _pass_by(int(log[e, BALL + s]), Time(log[e, TIME], log[e, TIME_LO]), shot)
            _meet(e, log, shot)
            if count:
                for s in range(balls):
                    load(int(log[e, BALL + s]), s, count, inputs[k], tangent, tape.lanes)
                apply_event(e, count, log, paths, arrays, is_sphere, tape)
            for s in range(balls):
                i = int(log[e, BALL + s])
                store(i, s, count, tape.lanes, tangent)
                _move_ends(i, shot)
                tape.current[i] = tape.first[e] + s
            pending += (1 + count) * (1 + arrays.numbers.cushion_work)
            if pending > _LOOK_AFTER:
                end_call(interrupted())
                pending = 0
        for i in range(n):
            _pass_by(i, Time(times[k], 0.0), shot)
        for i in range(n):
            for j in range(i):
                out.margin[i, j], out.time[i, j] = out.margin[j, i], out.time[j, i]
                for c in range(count):
                    out.slope[c, i, j] = out.slope[c, j, i]
