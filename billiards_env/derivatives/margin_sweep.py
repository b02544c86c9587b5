"""The margins of recorded shots, and their derivatives: one pass forwards over the log.

A margin is a signed distance to a change of outcome. A ball that does not touch a body has minus the least gap between
the two. For a contact that happened, the stretches before it are continued, as if the two did not interact, until the
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

from billiards_env.derivatives.lanes import (
    BALL_WIDTH,
    D_RADIUS,
    D_TIME,
    DX,
    DY,
    distance_change,
    stretch_lane,
    wall_at,
)
from billiards_env.derivatives.passing import (
    AT_END,
    AT_START,
    Meeting,
    nearest_to,
    passing,
    path_before,
    touched_circle,
    turn_time,
)
from billiards_env.derivatives.state_laws import law_numbers_of
from billiards_env.derivatives.sweeps import (
    LANE_WORK,
    RecordedShot,
    RecordedShots,
    Tape,
    balls_of,
    begin_lanes,
    begin_pieces,
    empty_tape,
    event_time,
    load_changes,
    look_after,
    push_event,
    shot_of,
    stretch_until,
    trace,
)
from billiards_env.engine.log import BALL, BALL_BALL, BALL_CUSHION, BALL_POCKET, KIND, OTHER, TIME
from billiards_env.engine.runner import INTERRUPTED
from billiards_env.jit import allocating, entry_point, inlined, kernel
from billiards_env.jit.interrupt import end_call
from billiards_env.physics.elementary import norm
from billiards_env.physics.geometry.contact import misses_circle
from billiards_env.physics.geometry.walls import is_beside
from billiards_env.physics.motion import place_after
from billiards_env.physics.state import Time, later

_TOUCHING = 1e-9  # m; a gap that is less than minus this is not on the ball's side of a cushion
_LEAST = 2.0**-1022  # m; the margin of a contact with a smaller depth, or with a depth that rounding makes negative


class MarginsOut(NamedTuple):
    """The margins of a shot of n balls to q bodies: the balls, then the pockets, then the cushions.

    Attributes:
        margin: (n, q) m; minus infinity without an approach, infinity if the path does not turn back.
        time: (n, q) s, when the two are nearest.
        rate: m/s, the derivative of the margin by time if an event ends the approach; otherwise 0.
        slope: (k, n, q) the changes of the margins by the changes of the inputs.
    """

    margin: Any
    time: Any
    rate: Any
    slope: Any


class MarginPass(NamedTuple):
    """The pass over one shot.

    Attributes:
        shot: The `RecordedShot`.
        tape: The `Tape`.
        selected: (n, q) bool, the margins to compute.
        inputs: (k, 9 n) or (k, 9 n + NUMBER_INPUTS) the changes of its inputs.
        tangent: (n, k, 7) the changes of the states at the beginning of the current pieces.
        out: The `MarginsOut`.
    """

    shot: RecordedShot
    tape: Tape
    selected: Any
    inputs: Any
    tangent: Any
    out: MarginsOut


@inlined
def _column(meeting, scene):
    """Returns the column of a `Meeting` in `MarginsOut`."""
    first = 0 if meeting.kind == BALL_BALL else len(scene.radius)
    return first + meeting.other + (len(scene.pockets) if meeting.kind == BALL_CUSHION else 0)


@kernel
def _set(meeting, margin, normal, rate, now, over):  # out: over
    """Stores the margin of a `Meeting`.

    Args:
        meeting: The `Meeting`.
        margin: m.
        normal: Unit vector (x, y) from the ball towards the other body.
        rate: m/s, the derivative of the margin by time if an event ends the approach; otherwise 0.
        now: The `Time` at which the two are nearest. The lanes then have the positions at this time.
        over: The `MarginPass`.
    """
    (kind, i, j), (nx, ny), out, tape, shot = meeting, normal, over.out, over.tape, over.shot
    count, lanes, q, tangents = len(out.slope), tape.lanes, _column(meeting, shot.scene), shot.tangents
    out.margin[i, q], out.time[i, q], out.rate[i, q] = margin, now.hi, rate
    numbers, radius = law_numbers_of(shot.scene.numbers), shot.scene.radius
    stretch = stretch_until(shot.segments, tape.current[i], now, numbers)
    load_changes(i, 0, over.inputs, over.tangent, lanes)
    for c in range(count):
        lane = lanes[c]
        stretch_lane(lane, 0, stretch, tangents)
        out.slope[c, i, q] = nx * lane[DX] + ny * lane[DY]
        if kind == BALL_CUSHION:
            out.slope[c, i, q] += lane[D_RADIUS]
    if kind == BALL_BALL:
        stretch = stretch_until(shot.segments, tape.current[j], now, numbers)
        load_changes(j, 1, over.inputs, over.tangent, lanes)
        for c in range(count):
            lane = lanes[c]
            stretch_lane(lane, BALL_WIDTH, stretch, tangents)
            out.slope[c, i, q] += distance_change(lane, shot.is_sphere, (radius[i], radius[j]), tangents)
            out.slope[c, i, q] -= nx * lane[BALL_WIDTH + DX] + ny * lane[BALL_WIDTH + DY]


@inlined
def _signed(margin, touches):
    """Returns a margin with the sign of the outcome. At a bare hit or miss rounding may give it the other sign."""
    return max(margin, _LEAST) if touches else min(margin, 0.0)


@kernel
def _approach(meeting, circle, t, ends, touches, begin, over):  # out: over
    """Stores the margin of a `Meeting` to a `Circle` t seconds after `begin`, if it is the largest.

    Args:
        meeting: The `Meeting`.
        circle: The `Circle`; its path begins at `begin`.
        t: s.
        ends: Whether an event ends the approach then.
        touches: Whether the two touch.
        begin: A `Time`.
        over: The `MarginPass`.
    """
    path, (x, y) = circle.path, place_after(circle.path, t)
    distance = norm(x, y)
    margin = _signed(circle.reach - distance, touches)
    if margin > over.out.margin[meeting.ball, _column(meeting, over.shot.scene)] and distance > 0.0:
        nx, ny = -x / distance, -y / distance
        rate = nx * (path.vx + t * path.ax) + ny * (path.vy + t * path.ay) if ends else 0.0
        _set(meeting, margin, (nx, ny), rate, later(begin, t), over)


@inlined
def pass_circle(meeting, circle, swept, span, over):  # out: over
    """Stores the margin of a `Meeting` to a `Circle` on a `Span` with a `Sweep`, if it is the largest."""
    i, q = meeting.ball, _column(meeting, over.shot.scene)
    if over.selected[i, q] and not misses_circle(circle.path, swept, circle.reach - over.out.margin[i, q]):
        t, faces = nearest_to(meeting, circle, span, over.shot.scene.outline)
        if faces and (t > 0.0 or span.end == 0.0):
            _approach(meeting, circle, t, t == span.end, False, span.begin, over)


@inlined
def pass_side(meeting, side, path, span, over):  # out: over
    """Stores the margin of a `Meeting` to a `Side` on a `Span` with a `Path`, if it is the largest."""
    nx, ny, end, q = side.nx, side.ny, span.end, _column(meeting, over.shot.scene)
    if not over.selected[meeting.ball, q]:
        return
    v, a = nx * path.vx + ny * path.vy, nx * path.ax + ny * path.ay
    t = end
    if v > 0.0 and v + end * a < 0.0:
        t = -v / a
    elif v + 0.5 * end * a <= 0.0 < end:
        return  # it was nearer before
    x, y = place_after(path, t)
    margin = nx * x + ny * y - side.room
    if over.out.margin[meeting.ball, q] < margin <= _TOUCHING and is_beside(
        over.shot.scene.outline.lines[meeting.other], x, y
    ):
        _set(meeting, _signed(margin, False), (nx, ny), v + t * a if t == end else 0.0, later(span.begin, t), over)


pass_bodies = passing(pass_circle, pass_side, False)


@inlined
def _enter_pocket(meeting, circle, path, now, over):  # out: over
    """Stores the margin of a ball that enters a pocket, on its continued `Path` from a `Time`.

    The path ends at the cushion behind the pocket if the ball reaches it before the point nearest to the centre.
    """
    i, scene, out, q = meeting.ball, over.shot.scene, over.out, _column(meeting, over.shot.scene)
    t, cut = turn_time(circle.path), False
    limit, wall = scene.walls.time(path, scene.radius[i], t, scene)
    if limit < t:
        t, cut = limit, True
    _approach(meeting, circle, t, cut, True, now, over)
    if cut:
        x, y = place_after(path, t)
        nx, ny, _ = wall_at(x, y, wall, scene.radius[i], scene)
        speed = nx * (path.vx + t * path.ax) + ny * (path.vy + t * path.ay)
        for c in range(len(out.slope)):
            lane = over.tape.lanes[c]
            out.slope[c, i, q] -= out.rate[i, q] * (nx * lane[DX] + ny * lane[DY] + lane[D_RADIUS]) / speed
    out.rate[i, q] = 0.0


@inlined
def _hit_side(meeting, normal, path, now, over):  # out: over
    """Stores the margin of a ball that touches a straight cushion, on its continued `Path` from a `Time`."""
    (nx, ny), i, q, out = normal, meeting.ball, _column(meeting, over.shot.scene), over.out
    v, a = nx * path.vx + ny * path.vy, nx * path.ax + ny * path.ay
    if a >= 0.0:
        out.margin[i, q], out.time[i, q], out.rate[i, q] = math.inf, now.hi, 0.0
        for c in range(len(out.slope)):
            out.slope[c, i, q] = 0.0
    else:
        v = max(v, 0.0)
        depth = _signed(-0.5 * v * v / a, True)
        if depth > out.margin[i, q]:
            _set(meeting, depth, normal, 0.0, later(now, -v / a), over)


@kernel
def _meet(e, over):  # out: over
    """Stores the margin of the contact at event e."""
    events, scene = over.shot.events, over.shot.scene
    kind, i, other, now = int(events[e, KIND]), int(events[e, BALL]), int(events[e, OTHER]), event_time(events, e)
    if kind > BALL_POCKET:
        return
    meeting = Meeting(kind, min(i, other), max(i, other)) if kind == BALL_BALL else Meeting(kind, i, other)
    if not over.selected[meeting.ball, _column(meeting, scene)]:
        return
    path, circle = path_before(e, 0, over), touched_circle(e, over)
    if kind == BALL_POCKET:
        _enter_pocket(meeting, circle, path, now, over)
    elif circle.reach == math.inf:
        nx, ny, _ = wall_at(path.x, path.y, other, scene.radius[i], scene)
        _hit_side(meeting, (nx, ny), path, now, over)
    else:
        _approach(meeting, circle, turn_time(circle.path), False, True, now, over)


@inlined
def _move_ends(i, over):  # out: over
    """Adds the change of an event's time to the changes of the margins of ball i that it ends."""
    out = over.out
    n = len(out.margin)
    for q in range(out.margin.shape[1]):
        low, high = (min(i, q), max(i, q)) if q < n else (i, q)
        rate = out.rate[low, high]
        if rate != 0.0:
            for c in range(len(out.slope)):
                out.slope[c, low, high] += rate * over.tape.lanes[c, D_TIME]
            out.rate[low, high] = 0.0


@entry_point
def push_margins(kernels, begin, end, shots, times, inputs, selected, results):  # out: results
    """Computes the margins of shots `begin` to `end` - 1 and their changes by changes of the inputs.

    Args:
        kernels: The `LaneKernels`.
        begin: First shot.
        end: One past the last.
        shots: The `sweeps.RecordedShots`, as a plain tuple.
        times: (m,) float64, s: only the shot until then counts.
        inputs: (m, k, 9 n) or (m, k, 9 n + NUMBER_INPUTS) float64, the changes of the inputs.
        selected: (n, q) bool, the margins to compute; of two balls, those of the lower number to the higher.
        results: Three float64 output arrays, see `MarginsOut`: the margins (m, n, q), minus infinity where not
            selected; the times (m, n, q); the slopes (m, k, n, q).
    """
    end_call(_push_margins(kernels, begin, end, shots, times, inputs, selected, results))


@allocating
def _push_margins(kernels, begin, end, shots, times, inputs, selected, results):  # out: results
    """Computes the margins, see `push_margins`. Returns whether it was interrupted."""
    shots, (margins, nearest, slopes) = RecordedShots(*shots), results
    _, n, bodies = margins.shape
    count, pending = inputs.shape[1], 0
    tape, tangent, rates = empty_tape(begin, end, shots, count), np.empty((n, count, BALL_WIDTH)), np.empty((n, bodies))
    for k in range(begin, end):
        shot, out = shot_of(kernels, shots, k), MarginsOut(margins[k], nearest[k], rates, slopes[k])
        trace(shot, tape)
        over = MarginPass(shot, tape, selected, inputs[k], tangent, out)
        out.margin[:] = -math.inf
        out.time[:] = 0.0
        out.slope[:] = 0.0
        begin_lanes(inputs[k], times[k], shot, tangent, tape)
        for i in range(n):
            pass_bodies(i, Time(0.0, 0.0), AT_START, over)
        out.rate[:] = 0.0
        for e in range(len(shot.events)):
            if shot.events[e, TIME] > times[k]:
                break
            for s in range(balls_of(shot.events, e)):
                pass_bodies(int(shot.events[e, BALL + s]), event_time(shot.events, e), e, over)
            _meet(e, over)
            if count:
                push_event(e, inputs[k], shot, tangent, tape)
            for s in range(balls_of(shot.events, e)):
                _move_ends(int(shot.events[e, BALL + s]), over)
            begin_pieces(e, shot.events, tape)
            pending = look_after(pending + LANE_WORK * (1 + count) * (1 + shot.scene.numbers.cushion_work))
            if pending == INTERRUPTED:
                return True
        for i in range(n):
            pass_bodies(i, Time(times[k], 0.0), AT_END, over)
        for i in range(n):
            for j in range(i):
                out.margin[i, j], out.time[i, j] = out.margin[j, i], out.time[j, i]
                for c in range(count):
                    out.slope[c, i, j] = out.slope[c, j, i]
    return False
