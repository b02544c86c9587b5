"""Where a recorded shot has no derivative: one pass over its log.

`REASONS` lists what is found. A body that a ball passes within rounding counts as touched: a small change of the start
turns the miss into a hit.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from billiards_env.engine.gradients import RecordedShots, Tape, empty_tape, trace
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
    TIME,
    TIME_LO,
)
from billiards_env.engine.margins import between, nearest_time, path_from, touches_line, turn_time
from billiards_env.jit import allocating_entry_point, inlined, kernel
from billiards_env.jit.interrupt import end_call, interrupted
from billiards_env.physics.derivatives import DVX, DVY, DX, DY, ball_at, cushion_is_smooth, wall_at
from billiards_env.physics.elementary import norm
from billiards_env.physics.geometry.contact import contact_distance, misses_circle, sweep
from billiards_env.physics.geometry.walls import (
    BEGIN_TX,
    BEGIN_TY,
    END_TX,
    END_TY,
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
)
from billiards_env.physics.motion import Path, place_after, relative_to
from billiards_env.physics.state import (
    AX,
    AY,
    LASTS,
    POCKET_RADIUS,
    POCKET_X,
    POCKET_Y,
    POTTED,
    REST,
    ROLLING,
    SLIDING,
    SLIDING_AND_ROLLING,
    T0,
    T0_LO,
    UX,
    UY,
    VX,
    VY,
    SceneArrays,
    Time,
    before,
    later,
    scene_of,
    since,
)
from billiards_env.scene import CONTACT_GAP

REASONS = {
    "grazing": "two bodies barely touch, or pass within 1e-12 m of each other, so a small change turns the hit into "
    "a miss or the miss into a hit",
    "simultaneous": "a ball touches two bodies at one instant, or touches a body as a phase of its motion ends, to "
    "within 1e-12 m or s. The derivative treats the events as if they happened one after the other, in recorded "
    "order, followed by the recorded flight",
    "rule": "the [contact-time rule](engines.md#resting-contact) acted. The derivative ignores it",
    "lip": "a ball grazes the circle of a pocket, inside or outside",
    "rolling": "a ball rolls without slip, up to rounding, at the start or after an impact",
    "slip": 'at a `"mathavan2010"` cushion, the slip is zero at first, or it stops and begins again at once, or it '
    "changes too often to compute the derivative",
    "joint": "a ball touches a cushion where its curvature changes, within 2e-10 m",
    "cut": "the shot, or `t`, ends at the instant of an event",
    "overflow": "after many impacts the derivative exceeds 1e100. It soon overflows to infinity or NaN",
}
"""Why a shot has no derivative, by name."""
GRAZING, SIMULTANEOUS, BY_RULE, AT_LIP, ROLLS, SLIPS, AT_JOINT, IS_CUT, OVERFLOWS = range(len(REASONS))

GRAZE = 1e-6
"""Speed of approach over the relative speed below which a contact counts as grazing."""

_ROLLS = 2.0**-40  # slip over speed of a ball that rolls up to rounding
_AT_ONCE = 1e-12  # s, and relative: times that are equal up to rounding

_BETWEEN = -2  # in place of an event

_LOOK_AFTER = 10_000  # pairs of an event and a ball between two calls of `interrupted`


class Pass(NamedTuple):
    """The pass over one shot.

    Attributes:
        events: Its events.
        segments: The pieces of its paths.
        scene: The `SceneArrays`.
        tape: The `Tape`.
        last: (n,) int64, the last event of each ball; -1 at the start.
        until: The `Time` at which the shot is cut.
        time: (1,) float64, the time of what was found first, s.
        found: (2,) int64: the event or _BETWEEN, and the index of the reason; -1 and -1 for none.
    """

    events: Any
    segments: Any
    scene: SceneArrays
    tape: Tape
    last: Any
    until: Time
    time: Any
    found: Any


@inlined
def _find(time, e, reason, over):
    """Stores a reason at event e, or between events, and at a time, s, if it is the first one."""
    if time < over.time[0]:
        over.time[0], over.found[0], over.found[1] = time, e, reason


class Approach(NamedTuple):
    """A ball and a body on a piece of the ball's path.

    Attributes:
        begin: The `Time` of its beginning.
        end: Its duration, s.
        meets: Whether it begins with the impact of the two.
        met_by: The reason to store if they touch at its end: SIMULTANEOUS, or IS_CUT at the end of the shot; -1 if it
            ends with their impact.
        reason: The reason to store if they touch but do not approach.
    """

    begin: Any
    end: Any
    meets: Any
    met_by: Any
    reason: Any


@inlined
def _touch(gap, along, speed, t, approach, over):
    """Stores a reason if two bodies touch.

    Args:
        gap: Their least gap on a piece of their paths, m.
        along: The part of their relative velocity along it, m/s.
        speed: Their relative speed, m/s.
        t: The time of the least gap, s.
        approach: The `Approach`.
        over: The `Pass`.
    """
    if abs(gap) > CONTACT_GAP or (approach.meets and t == 0.0):
        return
    time = later(approach.begin, t).hi
    if abs(along) <= GRAZE * speed:
        _find(time, _BETWEEN, approach.reason, over)
    elif t == approach.end and approach.met_by >= 0:
        _find(time, _BETWEEN, approach.met_by, over)


@inlined
def _pass_circle(path, swept, reach, approach, over):
    """Looks for a touch of a circle about the origin with a radius `reach`, m, on a `Path` with its `Sweep`."""
    if misses_circle(path, swept, reach + CONTACT_GAP):
        return
    t = nearest_time(path, approach.end)
    x, y = place_after(path, t)
    vx, vy, distance = path.vx + t * path.ax, path.vy + t * path.ay, norm(x, y)
    if distance > 0.0:
        _touch(distance - reach, (x * vx + y * vy) / distance, norm(vx, vy), t, approach, over)


@inlined
def _pass_line(path, normal, room, line, approach, over):
    """Looks for a touch of a straight cushion on a `Path`; see `margins._pass_line`."""
    (nx, ny), end = normal, approach.end
    v, a = nx * path.vx + ny * path.vy, nx * path.ax + ny * path.ay
    t = min(max(-v / a, 0.0), end) if a < 0.0 else (end if v + 0.5 * end * a > 0.0 else 0.0)
    x, y = place_after(path, t)
    vx, vy = path.vx + t * path.ax, path.vy + t * path.ay
    if line is None or touches_line(line, x, y):
        _touch(nx * x + ny * y - room, v + t * a, norm(vx, vy), t, approach, over)


@inlined
def _approach_of(kind, i, other, span, begin, e, over):
    """Returns the `Approach` of ball i to a body on `span` seconds from a `Time` to event e, or to the end (-1)."""
    meets, met_by = False, SIMULTANEOUS if e >= 0 else IS_CUT
    for k in (over.last[i], e):
        if k >= 0 and over.events[k, KIND] == kind:
            first, second = int(over.events[k, BALL]), int(over.events[k, OTHER])
            if (first == i and second == other) or (kind == BALL_BALL and first == other and second == i):
                if k == e:
                    met_by = -1
                elif kind != BALL_BALL or over.last[other] == k:
                    meets = True
    return Approach(begin, span, meets, met_by, AT_LIP if kind == BALL_POCKET else GRAZING)


@inlined
def _pass_cushions(outline, i, path, swept, whole, e, over):
    """Looks for touches of ball i and the cushions; `whole` is the `Approach` to any body on its `Path`."""
    radius, numbers = over.scene.radius[i], over.scene.numbers
    if outline is None:
        for k in range(4):
            sign, approach = 1.0 if k % 2 else -1.0, _approach_of(BALL_CUSHION, i, k, whole.end, whole.begin, e, over)
            if k < 2:
                _pass_line(path, (sign, 0.0), numbers.half_length - radius, None, approach, over)
            else:
                _pass_line(path, (0.0, sign), numbers.half_width - radius, None, approach, over)
    else:
        _pass_outline(outline, i, path, swept, whole, e, over)


@kernel
def _pass_outline(outline, i, path, swept, whole, e, over):
    """Implements `_pass_cushions` for an outline."""
    radius, lines, tips = over.scene.radius[i], outline.lines, outline.tips
    for k in range(len(lines)):
        line = lines[k]
        room = line[NX] * line[LINE_X] + line[NY] * line[LINE_Y] - radius
        approach = _approach_of(BALL_CUSHION, i, k, whole.end, whole.begin, e, over)
        _pass_line(path, (line[NX], line[NY]), room, line, approach, over)
    for k in range(len(tips)):
        tip = tips[k]
        from_tip, reach = relative_to(path, tip[TIP_X], tip[TIP_Y]), tip[TIP_RADIUS] + radius
        if not misses_circle(from_tip, swept, reach + CONTACT_GAP):
            x, y = place_after(from_tip, nearest_time(from_tip, whole.end))
            if faces(tip, x + tip[TIP_X], y + tip[TIP_Y]):
                approach = _approach_of(BALL_CUSHION, i, k + len(lines), whole.end, whole.begin, e, over)
                _pass_circle(from_tip, swept, reach, approach, over)


@kernel
def _pass_by(i, e, now, over):
    """Looks for touches of ball i on its current piece until a `Time`, that of event e or that of the end (-1)."""
    segments, scene, tape = over.segments, over.scene, over.tape
    piece, n = tape.current[i], len(scene.radius)
    row = segments[piece, SEGMENT_ROW:]
    begin = Time(row[T0], row[T0_LO])
    path, end = path_from(row, begin), since(now, begin)
    if segments[piece, SEGMENT_PHASE] == POTTED or end < 0.0:
        return
    moves = path.vx != 0.0 or path.vy != 0.0
    if moves:
        swept = sweep(path, end)
        for p in range(len(scene.pockets)):
            pocket = scene.pockets[p]
            from_pocket = relative_to(path, pocket[POCKET_X], pocket[POCKET_Y])
            approach = _approach_of(BALL_POCKET, i, p, end, begin, e, over)
            _pass_circle(from_pocket, swept, pocket[POCKET_RADIUS], approach, over)
        _pass_cushions(scene.outline, i, path, swept, Approach(begin, end, False, -1, GRAZING), e, over)
    for k in range(n):
        other = segments[tape.current[k]]
        second = other[SEGMENT_ROW:]
        if k == i or other[SEGMENT_PHASE] == POTTED or not (moves or second[VX] != 0.0 or second[VY] != 0.0):
            continue
        start = Time(second[T0], second[T0_LO])
        if before(start, begin):
            start = begin
        span = since(now, start)
        if span >= 0.0:
            path_to = between(segments[piece], other, start)
            reach = contact_distance(scene.spheres, scene.radius, i, k)
            approach = _approach_of(BALL_BALL, i, k, span, start, e, over)
            _pass_circle(path_to, sweep(path_to, span), reach, approach, over)


@inlined
def _rolls(segment, numbers):
    """Returns whether a ball rolls without slip, up to rounding, at the beginning of a piece."""
    if numbers.motion != SLIDING_AND_ROLLING:
        return False
    row, phase = segment[SEGMENT_ROW:], segment[SEGMENT_PHASE]
    return phase == ROLLING or (phase == SLIDING and norm(row[UX], row[UY]) <= _ROLLS * norm(row[VX], row[VY]))


@inlined
def _is_smooth_cushion(i, wall, state, scene):
    """Returns whether the impact of ball i with a state (7,) on a cushion has a derivative."""
    if not scene.numbers.cushion_rubs:
        return True
    touched = wall_at(state[DX], state[DY], wall, scene.radius[i], scene.outline)
    return cushion_is_smooth(ball_at(state, 0), touched, scene.radius[i], scene)


@inlined
def _grazes_circle(path, reach, speed):
    """Returns whether a `Path` that touches a circle about the origin hardly approaches it, or hardly enters it."""
    if -(path.x * path.vx + path.y * path.vy) <= GRAZE * norm(path.x, path.y) * speed:
        return True
    x, y = place_after(path, turn_time(path))
    return reach - norm(x, y) <= CONTACT_GAP


@inlined
def _path_before(s, piece, over):
    """Returns the `Path` of the first (s = 0) or second (s = 1) ball of an event at its first piece, without it."""
    state, row = over.tape.before[piece + s], over.segments[over.tape.previous[piece + s], SEGMENT_ROW:]
    return Path(state[DX], state[DY], state[DVX], state[DVY], row[AX], row[AY])


@inlined
def _grazes(kind, i, other, piece, speed, over):
    """Returns whether a contact of ball i hardly approaches, or hardly enters the other body if nothing stops it."""
    scene, path = over.scene, _path_before(0, piece, over)
    if kind == BALL_BALL:
        b = _path_before(1, piece, over)
        path = Path(path.x - b.x, path.y - b.y, path.vx - b.vx, path.vy - b.vy, path.ax - b.ax, path.ay - b.ay)
        return _grazes_circle(path, contact_distance(scene.spheres, scene.radius, i, other), speed)
    if kind == BALL_POCKET:
        pocket = scene.pockets[other]
        return _grazes_circle(relative_to(path, pocket[POCKET_X], pocket[POCKET_Y]), pocket[POCKET_RADIUS], speed)
    nx, ny, curvature = wall_at(path.x, path.y, other, scene.radius[i], scene.outline)
    if curvature > 0.0:
        reach = 1.0 / curvature
        return _grazes_circle(relative_to(path, path.x + reach * nx, path.y + reach * ny), reach, speed)
    v, a = nx * path.vx + ny * path.vy, nx * path.ax + ny * path.ay
    return v <= GRAZE * speed or (a < 0.0 and -0.5 * v * v / a <= CONTACT_GAP)


@inlined
def _is_at_joint(outline, wall, state):
    """Returns whether a ball with a state (7,) touches a cushion where its curvature changes."""
    if outline is None:
        return False
    if wall < len(outline.lines):
        line = outline.lines[wall]
        along = line[TX] * (state[DX] - line[LINE_X]) + line[TY] * (state[DY] - line[LINE_Y])
        return abs(abs(along) - line[HALF_LINE]) <= 2.0 * JOINT
    tip = outline.tips[wall - len(outline.lines)]
    dx, dy = state[DX] - tip[TIP_X], state[DY] - tip[TIP_Y]
    return abs(dx * tip[BEGIN_TX] + dy * tip[BEGIN_TY]) <= 2.0 * JOINT or (
        abs(dx * tip[END_TX] + dy * tip[END_TY]) <= 2.0 * JOINT
    )


@inlined
def _is_at_once(dt, time):
    """Returns whether times with a difference dt, s, are equal up to rounding."""
    return abs(dt) <= _AT_ONCE * (1.0 + time)


@inlined
def _left(segment, now):
    """Returns the time from a `Time` to the end of the phase of a piece, s."""
    return segment[SEGMENT_ROW + LASTS] - since(now, Time(segment[SEGMENT_ROW + T0], segment[SEGMENT_ROW + T0_LO]))


@kernel
def _judge(e, over):
    """Stores the reason why event e has no derivative."""
    events, scene, tape = over.events, over.scene, over.tape
    kind, i, other = int(events[e, KIND]), int(events[e, BALL]), int(events[e, OTHER])
    time, piece = events[e, TIME], tape.first[e]
    if kind > BALL_POCKET:
        return
    if events[e, RULE]:
        _find(time, e, BY_RULE, over)
    speed = 0.0
    for s in range(2 if kind == BALL_BALL else 1):
        speed += norm(tape.before[piece + s, DVX], tape.before[piece + s, DVY])
        last = over.last[int(events[e, BALL + s])]
        now, before_it = Time(time, events[e, TIME_LO]), over.segments[tape.previous[piece + s]]
        if last >= 0 and events[last, TIME] == time and events[last, KIND] <= BALL_POCKET:
            _find(time, e, SIMULTANEOUS, over)
        if before_it[SEGMENT_PHASE] in (ROLLING, SLIDING) and _is_at_once(_left(before_it, now), time):
            _find(time, e, SIMULTANEOUS, over)
        if _rolls(over.segments[piece + s], scene.numbers):
            _find(time, e, ROLLS, over)
    if _grazes(kind, i, other, piece, speed, over):
        _find(time, e, AT_LIP if kind == BALL_POCKET else GRAZING, over)
    elif kind == BALL_CUSHION and not _is_smooth_cushion(i, other, tape.before[piece], scene):
        _find(time, e, SLIPS, over)
    elif kind == BALL_CUSHION and _is_at_joint(scene.outline, other, tape.before[piece]):
        _find(time, e, AT_JOINT, over)


@inlined
def _cut(done, over):
    """Looks for events at the instant at which a shot is cut, after its first `done` events."""
    rests = True
    for i in range(len(over.last)):
        segment = over.segments[over.tape.current[i]]
        if segment[SEGMENT_PHASE] not in (REST, POTTED):
            rests = False
            if _is_at_once(_left(segment, over.until), over.until.hi):
                _find(over.until.hi, _BETWEEN, IS_CUT, over)
    for e in (done - 1, done):
        if not rests and 0 <= e < len(over.events) and _is_at_once(over.events[e, TIME] - over.until.hi, over.until.hi):
            _find(over.until.hi, _BETWEEN, IS_CUT, over)


@allocating_entry_point
def find_nonsmooth(begin, end, shots, times, results):
    """Finds the first reason why shots `begin` to `end` - 1 have no derivative.

    Args:
        begin: First shot.
        end: One past the last.
        shots: The `RecordedShots`, as a plain tuple.
        times: (m,) float64, s: only the shot until then counts.
        results: (m, 2) int64 out: the last event until then and the index of the reason in `REASONS`; -1 and -1 if
            there is none. The start of the shot is event -1.
    """
    shots = RecordedShots(*shots)
    tape, n, first, pending = empty_tape(begin, end, shots, 1), len(shots.scene[1]), np.empty(1), 0
    last = np.empty(n, np.int64)
    for k in range(begin, end):
        scene = scene_of(shots.scene, k)
        at, after = shots.bounds[k - shots.first], shots.bounds[k - shots.first + 1]
        log, paths, until = shots.events[at[0] : after[0]], shots.segments[at[1] : after[1]], Time(times[k], 0.0)
        trace(log, paths, scene, shots.is_sphere, tape)
        over = Pass(
            events=log, segments=paths, scene=scene, tape=tape, last=last, until=until, time=first, found=results[k]
        )
        first[0], results[k, 0], results[k, 1] = math.inf, -1, -1
        last[:] = -1
        for i in range(n):
            tape.current[i] = i
            if _rolls(paths[i], scene.numbers):
                _find(-1.0, -1, ROLLS, over)
        done = 0
        while done < len(log) and log[done, TIME] <= times[k]:
            balls = 2 if log[done, KIND] == BALL_BALL else 1
            _judge(done, over)
            for s in range(balls):
                _pass_by(int(log[done, BALL + s]), done, Time(log[done, TIME], log[done, TIME_LO]), over)
            for s in range(balls):
                i = int(log[done, BALL + s])
                tape.current[i], last[i] = tape.first[done] + s, done
            done += 1
            pending += n + scene.numbers.cushion_work
            if pending > _LOOK_AFTER:
                end_call(interrupted())
                pending = 0
        for i in range(n):
            _pass_by(i, -1, until, over)
        _cut(done, over)
        if results[k, 0] == _BETWEEN:
            results[k, 0] = -1
            while results[k, 0] + 1 < done and log[results[k, 0] + 1, TIME] <= first[0]:
                results[k, 0] += 1
