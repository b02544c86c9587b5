"""The visit of each body that a ball may touch on its path between two events.

`margins` and `nonsmooth` go through the log of a shot. Both look at each meeting on each piece of a path.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from billiards_env.derivatives.state_laws import law_numbers_of
from billiards_env.derivatives.sweeps import ball_before, begin_time, event_time, stretch_until
from billiards_env.engine.log import (
    BALL,
    BALL_BALL,
    BALL_CUSHION,
    BALL_POCKET,
    KIND,
    OTHER,
    SEGMENT_PHASE,
    SEGMENT_ROW,
)
from billiards_env.jit import inlined, kernel
from billiards_env.physics.geometry.contact import sweep
from billiards_env.physics.geometry.pockets import path_to
from billiards_env.physics.geometry.roots import bracketed_root, quartic
from billiards_env.physics.geometry.walls import (
    LINE_X,
    LINE_Y,
    NX,
    NY,
    TIP_X,
    TIP_Y,
    Circle,
    centres_at,
    faces,
    tip_circle,
)
from billiards_env.physics.motion import Path, difference, path_after, place_after, relative_to
from billiards_env.physics.state import (
    AX,
    AY,
    POTTED,
    VX,
    VY,
    X,
    Y,
    before,
    since,
)

AT_START, AT_END = -2, -1
"""Values of `Span.event` at the start and at the end of a shot, where there is no event."""


class Meeting(NamedTuple):
    """A possible contact: a ball and what it may touch.

    Attributes:
        kind: The kind of event of their contact.
        ball: The ball; of two balls the one with the lower number.
        other: The other ball, the pocket or the cushion.
    """

    kind: Any
    ball: Any
    other: Any


class Span(NamedTuple):
    """A part of the path of a ball.

    Attributes:
        begin: The `Time` of its beginning.
        end: Its duration, s.
        event: The event at its end; AT_END at the end of the shot, AT_START for the start of the shot.
    """

    begin: Any
    end: Any
    event: Any


class Side(NamedTuple):
    """A straight cushion.

    Attributes:
        nx: The x component of the unit normal into the cushion.
        ny: The y component.
        room: Largest coordinate of the ball along the normal, m.
    """

    nx: Any
    ny: Any
    room: Any


@inlined
def is_on_arc(tip, x, y):
    """Returns whether the point of a tip's circle nearest to (x, y) is on its arc; (x, y) is relative to the centre."""
    return faces(tip, tip[TIP_X] + x, tip[TIP_Y] + y)


@inlined
def line_side(line, radius):
    """Returns the `Side` of a row of `Outline.lines` for a ball with a radius, m."""
    return Side(line[NX], line[NY], line[NX] * line[LINE_X] + line[NY] * line[LINE_Y] - radius)


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
def path_from(segment, begin):
    """Returns the `Path` of a ball with a row of `Log.segments` from a `Time`."""
    row = segment[SEGMENT_ROW:]
    path = Path(row[X], row[Y], row[VX], row[VY], row[AX], row[AY])
    return path_after(path, since(begin, begin_time(segment)))


@inlined
def state_before(e, s, over):
    """Returns the `BallState` before event e of its first (s = 0) or second (s = 1) ball."""
    segments, tape, piece = over.shot.segments, over.tape, over.tape.first[e] + s
    numbers, now = law_numbers_of(over.shot.scene.numbers), event_time(over.shot.events, e)
    return ball_before(piece, stretch_until(segments, tape.previous[piece], now, numbers), segments, tape)


@inlined
def path_before(e, s, over):
    """Returns the `Path` of the ball of `state_before` after event e, as if the event did not happen."""
    segments, tape = over.shot.segments, over.tape
    row, ball = segments[tape.previous[tape.first[e] + s], SEGMENT_ROW:], state_before(e, s, over)
    return Path(ball.x, ball.y, ball.vx, ball.vy, row[AX], row[AY])


@inlined
def touched_circle(e, over):
    """Returns the `Circle` of the contact at event e, with the `path_before`. It is infinite for a straight cushion."""
    events, scene, path = over.shot.events, over.shot.scene, path_before(e, 0, over)
    kind, i, other = events[e, KIND], int(events[e, BALL]), int(events[e, OTHER])
    if kind == BALL_BALL:
        second = path_before(e, 1, over)
        between = difference(path, second) if i < other else difference(second, path)
        return Circle(between, scene.space.contact_distance(i, other, scene))
    if kind == BALL_POCKET:
        return Circle(*path_to(path, scene.pockets[other]))
    x, y, reach = centres_at(other, scene.radius[i], scene.outline)
    return Circle(relative_to(path, x, y), reach)


@inlined
def nearest_to(meeting, circle, span, outline):
    """Returns when, in a `Span`, a ball is nearest to the `Circle` of a `Meeting`, s, and whether the meeting counts.

    A meeting with a tip counts if the arc of the tip is nearest to the ball then.
    """
    t = nearest_time(circle.path, span.end)
    if meeting.kind != BALL_CUSHION:
        return t, True
    return t, is_on_arc(outline.tips[meeting.other - len(outline.lines)], *place_after(circle.path, t))


def passing(pass_circle: Callable[..., None], pass_side: Callable[..., None], at_once: bool) -> Callable[..., None]:
    """Returns the kernel that visits all bodies along the current piece of a ball's path.

    Args:
        pass_circle: (meeting, circle, swept, span, over), for a `Meeting`, its `Circle`, a `Sweep` and a `Span`.
        pass_side: (meeting, side, path, span, over), for a `Side` and the `Path` of the ball.
        at_once: Whether to visit the bodies on pieces without duration.
    """

    @kernel
    def pass_cushions(i, path, swept, span, over):  # out: over
        """Visits the cushions."""
        radius, lines, tips = over.shot.scene.radius[i], over.shot.scene.outline.lines, over.shot.scene.outline.tips
        for k in range(len(lines)):
            pass_side(Meeting(BALL_CUSHION, i, k), line_side(lines[k], radius), path, span, over)
        for k in range(len(tips)):
            pass_circle(Meeting(BALL_CUSHION, i, k + len(lines)), tip_circle(path, tips[k], radius), swept, span, over)

    @kernel
    def pass_bodies(i, until, event, over):  # out: over
        """Visits all bodies on the current piece of ball i until a `Time`; `event` is the event then, as in `Span`.

        `over` has the fields `shot`, a `sweeps.RecordedShot`, and `tape`. At the start of the shot the
        balls with higher numbers are visited, even if none moves.
        """
        segments, scene, tape = over.shot.segments, over.shot.scene, over.tape
        segment, starts = segments[tape.current[i]], event == AT_START
        begin = begin_time(segment)
        path, end = path_from(segment, begin), since(until, begin)
        if segment[SEGMENT_PHASE] == POTTED or end < 0.0 or (end == 0.0 and not (at_once or starts)):
            return
        moves = starts or path.vx != 0.0 or path.vy != 0.0
        if moves:
            swept, span = sweep(path, end), Span(begin, end, event)
            for p in range(len(scene.pockets)):
                circle = Circle(*path_to(path, scene.pockets[p]))
                pass_circle(Meeting(BALL_POCKET, i, p), circle, swept, span, over)
            pass_cushions(i, path, swept, span, over)
        for k in range(i + 1 if starts else 0, len(scene.radius)):
            other = segments[tape.current[k]]
            second = other[SEGMENT_ROW:]
            if k == i or other[SEGMENT_PHASE] == POTTED or not (moves or second[VX] != 0.0 or second[VY] != 0.0):
                continue
            low, high, start = min(i, k), max(i, k), begin_time(other)
            if before(start, begin):
                start = begin
            end = since(until, start)
            if end > 0.0 or (end == 0.0 and (at_once or starts)):
                one, two = path_from(segments[tape.current[low]], start), path_from(segments[tape.current[high]], start)
                between, reach = difference(one, two), scene.space.contact_distance(low, high, scene)
                circle, span = Circle(between, reach), Span(start, end, event)
                pass_circle(Meeting(BALL_BALL, low, high), circle, sweep(between, end), span, over)

    return pass_bodies
