"""Where a recorded shot has no derivative: one pass over its log.

`REASONS` lists what is found. A body that a ball passes within rounding counts as touched: a small change of the start
turns the miss into a hit.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from billiards_env.derivatives.lanes import cushion_is_smooth, wall_at
from billiards_env.derivatives.passing import (
    AT_END,
    nearest_to,
    passing,
    path_before,
    state_before,
    touched_circle,
    turn_time,
)
from billiards_env.derivatives.sweeps import (
    LANE_WORK,
    RecordedShot,
    RecordedShots,
    Tape,
    balls_of,
    begin_pieces,
    begin_time,
    empty_tape,
    event_time,
    look_after,
    shot_of,
    trace,
)
from billiards_env.engine.log import (
    BALL,
    BALL_BALL,
    BALL_CUSHION,
    BALL_POCKET,
    KIND,
    OTHER,
    RULE,
    SEGMENT_PHASE,
    SEGMENT_ROW,
    SLIDING_ROLLING,
    TIME,
)
from billiards_env.engine.runner import INTERRUPTED
from billiards_env.jit import allocating, entry_point, inlined, kernel
from billiards_env.jit.interrupt import end_call
from billiards_env.physics.elementary import norm
from billiards_env.physics.geometry.contact import misses_circle
from billiards_env.physics.geometry.walls import (
    BEGIN_TX,
    BEGIN_TY,
    END_TX,
    END_TY,
    HALF_LINE,
    JOINT,
    LINE_X,
    LINE_Y,
    TIP_X,
    TIP_Y,
    TX,
    TY,
    is_beside,
)
from billiards_env.physics.laws.cloth import NEAR, roll_speed_near
from billiards_env.physics.motion import place_after
from billiards_env.physics.state import (
    LASTS,
    POTTED,
    REST,
    ROLLING,
    SLIDING,
    SLIDING_AND_ROLLING,
    UX,
    UY,
    VX,
    VY,
    Time,
    later,
    since,
)
from billiards_env.scene import CONTACT_GAP

REASONS = {
    "grazing": "two bodies barely touch, or pass within 1e-12 m of each other, so a small change turns the hit into "
    "a miss or the miss into a hit",
    "simultaneous": "a ball touches two bodies at one instant, or touches a body as a phase of its motion ends, to "
    "within 1e-12 m or s. The derivative treats the events as if they happened one after the other, in recorded "
    "order, followed by the recorded motion",
    "rule": "the [contact-time rule](engines.md#resting-contact) acted. The derivative ignores it",
    "lip": "a ball grazes the circle of a pocket, inside or outside",
    "rolling": "a ball rolls without slip, up to rounding, at the start or after an impact, or it begins to roll at a "
    "speed at which `mu_roll_speed` changes the resistance",
    "cushion": "at a cushion, the law of the restitution has a kink: at the speed `e_cushion_onset`, at the "
    'restitution `e_cushion_floor` or 1, and with `"han2005_variable"` at no topspin or at the topspin of a rolling '
    'ball. At a `"mathavan2010"` cushion, the slip is zero at first, or it stops and begins again at once, or no '
    "slip is left, or both stay small for hundreds of steps",
    "joint": "a ball touches a cushion where its curvature changes, within 2e-10 m",
    "cut": "the shot, or `t`, ends at the instant of an event",
    "overflow": "after many impacts the derivative exceeds 1e100. It soon overflows to infinity or NaN",
}
"""Why a shot has no derivative, by name."""
GRAZING, SIMULTANEOUS, BY_RULE, AT_LIP, ROLLS, AT_CUSHION, AT_JOINT, IS_CUT, OVERFLOWS = range(len(REASONS))

GRAZE = 1e-6
"""Speed of approach over the relative speed below which a contact counts as grazing."""

_ROLLS = 2.0**-40  # slip over speed of a ball that rolls up to rounding
ROUNDING = CONTACT_GAP, 1e-12
"""A gap, m, and a difference of times, divided by 1 s + time, that count as zero because rounding may cause them."""


_BETWEEN = -2  # in place of an event


class Pass(NamedTuple):
    """The pass over one shot.

    Attributes:
        shot: The `RecordedShot`.
        tape: The `Tape`.
        last: (n,) int64, the last event of each ball; -1 at the start.
        until: The `Time` at which the shot is cut.
        time: (1,) float64, the time of the first reason, s.
        reason: (2,) int64: the event or _BETWEEN, and the index of the reason; -1 and -1 for none.
        within: (2,) float64: a gap, m, and a difference of times, divided by 1 s + time, that count as zero.
    """

    shot: RecordedShot
    tape: Tape
    last: Any
    until: Time
    time: Any
    reason: Any
    within: Any


@inlined
def is_at_joint(wall, x, y, gap, outline):
    """Returns whether a ball at (x, y) touches a cushion where its curvature changes; `gap` is a tolerance, m."""
    near = 2.0 * JOINT + gap
    if wall < len(outline.lines):
        line = outline.lines[wall]
        return abs(abs(line[TX] * (x - line[LINE_X]) + line[TY] * (y - line[LINE_Y])) - line[HALF_LINE]) <= near
    tip = outline.tips[wall - len(outline.lines)]
    dx, dy = x - tip[TIP_X], y - tip[TIP_Y]
    return abs(dx * tip[BEGIN_TX] + dy * tip[BEGIN_TY]) <= near or abs(dx * tip[END_TX] + dy * tip[END_TY]) <= near


@inlined
def _find(time, e, reason, over):  # out: over
    """Stores a reason at event e, or between events, and at a time, s, if it is the first one."""
    if time < over.time[0]:
        over.time[0], over.reason[0], over.reason[1] = time, e, reason


@inlined
def _touch(gap, along, speed, t, meeting, span, over):  # out: over
    """Stores a reason if a `Meeting` is touched on a `Span`.

    Args:
        gap: The least gap, m.
        along: The part of the relative velocity along it, m/s.
        speed: The relative speed, m/s.
        t: The time of the least gap, s.
        meeting: The `Meeting`.
        span: The `Span`.
        over: The `Pass`.
    """
    if abs(gap) > over.within[0]:
        return
    (kind, i, other), events = meeting, over.shot.events
    meets, met_by = False, SIMULTANEOUS if span.event >= 0 else IS_CUT  # at the beginning and at the end of the span
    for k in (over.last[i], span.event):
        if k >= 0 and events[k, KIND] == kind:
            first, second = int(events[k, BALL]), int(events[k, OTHER])
            if (first == i and second == other) or (kind == BALL_BALL and first == other and second == i):
                if k == span.event:
                    met_by = -1
                elif kind != BALL_BALL or over.last[other] == k:
                    meets = True
    if meets and t == 0.0:
        return
    time = later(span.begin, t).hi
    # Between the ends of the span `along` is 0 up to rounding, as is the speed if the ball stops there.
    if 0.0 < t < span.end or abs(along) <= GRAZE * speed:
        _find(time, _BETWEEN, AT_LIP if kind == BALL_POCKET else GRAZING, over)
    elif t == span.end and met_by >= 0:
        _find(time, _BETWEEN, met_by, over)


@inlined
def pass_circle(meeting, circle, swept, span, over):  # out: over
    """Looks for a touch of a `Circle` on a `Span` with a `Sweep`."""
    path, reach = circle.path, circle.reach
    if misses_circle(path, swept, reach + over.within[0]):
        return
    t, faces = nearest_to(meeting, circle, span, over.shot.scene.outline)
    x, y = place_after(path, t)
    vx, vy, distance = path.vx + t * path.ax, path.vy + t * path.ay, norm(x, y)
    if faces and distance > 0.0:
        _touch(distance - reach, (x * vx + y * vy) / distance, norm(vx, vy), t, meeting, span, over)


@inlined
def pass_side(meeting, side, path, span, over):  # out: over
    """Looks for a touch of a `Side` on a `Span` with a `Path`."""
    nx, ny, end = side.nx, side.ny, span.end
    v, a = nx * path.vx + ny * path.vy, nx * path.ax + ny * path.ay
    t = min(max(-v / a, 0.0), end) if a < 0.0 else (end if v + 0.5 * end * a > 0.0 else 0.0)
    x, y = place_after(path, t)
    vx, vy = path.vx + t * path.ax, path.vy + t * path.ay
    if is_beside(over.shot.scene.outline.lines[meeting.other], x, y):
        _touch(nx * x + ny * y - side.room, v + t * a, norm(vx, vy), t, meeting, span, over)


pass_bodies = passing(pass_circle, pass_side, True)


@inlined
def _rolls(segment, time, over):
    """Returns whether a piece begins with rolling without slip, up to rounding. If balls only roll, see `_at_step`."""
    row, phase = segment[SEGMENT_ROW:], segment[SEGMENT_PHASE]
    if over.shot.scene.numbers.motion != SLIDING_AND_ROLLING:
        return _at_step(segment, time, over)
    return phase == ROLLING or (phase == SLIDING and norm(row[UX], row[UY]) <= _ROLLS * norm(row[VX], row[VY]))


@inlined
def _at_step(segment, time, over):
    """Returns whether a ball begins to roll at a speed at which the resistance changes, up to rounding."""
    numbers, speed = over.shot.scene.numbers, norm(segment[SEGMENT_ROW + VX], segment[SEGMENT_ROW + VY])
    if segment[SEGMENT_PHASE] != ROLLING or numbers.roll_gain <= 0.0:
        return False
    margin = NEAR * speed + numbers.slide * over.within[1] * (1.0 + time)
    return roll_speed_near(speed, margin, numbers) > 0.0


@inlined
def _is_smooth_cushion(i, wall, ball, scene):
    """Returns whether the impact of ball i with a `BallState` on a cushion has a derivative."""
    touched = wall_at(ball.x, ball.y, wall, scene.radius[i], scene)
    return cushion_is_smooth(ball, touched, scene.radius[i], scene)


@inlined
def _grazes_circle(path, reach, speed, gap):
    """Returns whether a `Path` that touches a circle about the origin hardly approaches it, or enters by <= `gap`."""
    if -(path.x * path.vx + path.y * path.vy) <= GRAZE * norm(path.x, path.y) * speed:
        return True
    x, y = place_after(path, turn_time(path))
    return reach - norm(x, y) <= gap


@inlined
def _grazes(e, speed, over):
    """Returns whether the ball at event e approaches too slowly, or would enter too little, for a derivative."""
    circle, gap = touched_circle(e, over), over.within[0]
    if circle.reach < math.inf:
        return _grazes_circle(circle.path, circle.reach, speed, gap)
    path, i, other = path_before(e, 0, over), int(over.shot.events[e, BALL]), int(over.shot.events[e, OTHER])
    nx, ny, _ = wall_at(path.x, path.y, other, over.shot.scene.radius[i], over.shot.scene)
    v, a = nx * path.vx + ny * path.vy, nx * path.ax + ny * path.ay
    return v <= GRAZE * speed or (a < 0.0 and -0.5 * v * v / a <= gap)


@inlined
def _is_at_once(dt, time, over):
    """Returns whether times with a difference dt, s, are equal up to `Pass.within`."""
    return abs(dt) <= over.within[1] * (1.0 + time)


@inlined
def _left(segment, now):
    """Returns the time from a `Time` to the end of the phase of a piece, s."""
    return segment[SEGMENT_ROW + LASTS] - since(now, begin_time(segment))


@kernel
def _judge(e, over):  # out: over
    """Stores the reason why event e has no derivative."""
    events, segments, scene, tape = over.shot.events, over.shot.segments, over.shot.scene, over.tape
    kind, i, other = int(events[e, KIND]), int(events[e, BALL]), int(events[e, OTHER])
    now, piece = event_time(events, e), tape.first[e]
    time = now.hi
    if kind > BALL_POCKET:
        if kind == SLIDING_ROLLING and _at_step(segments[piece], time, over):
            _find(time, e, ROLLS, over)
        return
    if events[e, RULE]:
        _find(time, e, BY_RULE, over)
    speed, ball = 0.0, state_before(e, 0, over)
    for s in range(balls_of(events, e)):
        touching = state_before(e, s, over)
        speed += norm(touching.vx, touching.vy)
        last, before_it = over.last[int(events[e, BALL + s])], segments[tape.previous[piece + s]]
        if last >= 0 and events[last, TIME] == time and events[last, KIND] <= BALL_POCKET:
            _find(time, e, SIMULTANEOUS, over)
        if before_it[SEGMENT_PHASE] in (ROLLING, SLIDING) and _is_at_once(_left(before_it, now), time, over):
            _find(time, e, SIMULTANEOUS, over)
        if _rolls(segments[piece + s], time, over):
            _find(time, e, ROLLS, over)
    if _grazes(e, speed, over):
        _find(time, e, AT_LIP if kind == BALL_POCKET else GRAZING, over)
    elif kind == BALL_CUSHION and not _is_smooth_cushion(i, other, ball, scene):
        _find(time, e, AT_CUSHION, over)
    elif kind == BALL_CUSHION and is_at_joint(other, ball.x, ball.y, over.within[0], scene.outline):
        _find(time, e, AT_JOINT, over)


@inlined
def _cut(done, over):  # out: over
    """Looks for events at the instant at which a shot is cut, after its first `done` events."""
    rests = True
    for i in range(len(over.last)):
        segment = over.shot.segments[over.tape.current[i]]
        if segment[SEGMENT_PHASE] not in (REST, POTTED):
            rests = False
            if _is_at_once(_left(segment, over.until), over.until.hi, over):
                _find(over.until.hi, _BETWEEN, IS_CUT, over)
    for e in (done - 1, done):
        if rests or not 0 <= e < len(over.shot.events):
            continue
        if _is_at_once(over.shot.events[e, TIME] - over.until.hi, over.until.hi, over):
            _find(over.until.hi, _BETWEEN, IS_CUT, over)


@entry_point
def find_nonsmooth(kernels, begin, end, shots, times, within, results):  # out: results
    """Finds the first reason why shots `begin` to `end` - 1 have no derivative.

    Args:
        kernels: The `LaneKernels`.
        begin: First shot.
        end: One past the last.
        shots: The `RecordedShots`, as a plain tuple.
        times: (m,) float64, s: only the shot until then counts.
        within: (l, 2) float64, as in `Pass`, for each event in the order of the log and then for the end of the shot.
            The last row applies to all later events.
        results: (m, 2) int64 out: the last event until then and the index of the reason in `REASONS`; -1 and -1 if
            there is none. The start of the shot is event -1.
    """
    end_call(_find_nonsmooth(kernels, begin, end, shots, times, within, results))


@allocating
def _find_nonsmooth(kernels, begin, end, shots, times, within, results):  # out: results
    """Finds the reasons, see `find_nonsmooth`. Returns whether it was interrupted."""
    shots = RecordedShots(*shots)
    tape, n, first, pending = empty_tape(begin, end, shots, 0), len(shots.scene[1]), np.empty(1), 0
    last = np.empty(n, np.int64)
    for k in range(begin, end):
        shot, at, until = shot_of(kernels, shots, k), shots.bounds[k, 0], Time(times[k], 0.0)
        log = shot.events
        trace(shot, tape)
        over = Pass(
            shot=shot,
            tape=tape,
            last=last,
            until=until,
            time=first,
            reason=results[k],
            within=within[min(at, len(within) - 1)].copy(),
        )
        first[0], results[k, 0], results[k, 1] = math.inf, -1, -1
        last[:] = -1
        for i in range(n):
            tape.current[i] = i
            if _rolls(shot.segments[i], 0.0, over):
                _find(-1.0, -1, ROLLS, over)
        done = 0
        while done < len(log) and log[done, TIME] <= times[k]:
            over.within[:] = within[min(at + done, len(within) - 1)]
            _judge(done, over)
            for s in range(balls_of(log, done)):
                pass_bodies(int(log[done, BALL + s]), event_time(log, done), done, over)
            for s in range(balls_of(log, done)):
                last[int(log[done, BALL + s])] = done
            begin_pieces(done, log, tape)
            done += 1
            pending = look_after(pending + LANE_WORK * (n + shot.scene.numbers.cushion_work))
            if pending == INTERRUPTED:
                return True
        over.within[:] = within[min(at + done, len(within) - 1)]
        for i in range(n):
            pass_bodies(i, until, AT_END, over)
        _cut(done, over)
        if results[k, 0] == _BETWEEN:
            results[k, 0] = -1
            while results[k, 0] + 1 < done and log[results[k, 0] + 1, TIME] <= first[0]:
                results[k, 0] += 1
    return False
