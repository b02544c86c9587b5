"""The cushions of a table: the times at which a ball touches them, and their normals.

A table without an outline is a rectangle with cushions 0 to 3: -x, +x, -y, +y. For the cushions of an outline, see
`outline_walls`. The type of the outline decides at compile time which code is compiled.

If a ball touches several cushions at one instant, at most two of them act: of those on the left of its direction of
motion the one whose normal is nearest to this direction, and the same on the right (see `walls_met`).
"""

from __future__ import annotations

import math

from billiards_env.jit import inlined, kernel
from billiards_env.physics.geometry.contact import MARGIN, line_time
from billiards_env.physics.geometry.outline_walls import (
    BEGIN_TX,
    BEGIN_TY,
    BOX_X,
    BOX_Y,
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
    Side,
    back_to_piece,
    centrifugal,
    distance_outside,
    next_piece,
    outline_normal,
    outline_time,
    piece_overlap,
    touches_another,
    walls_around,
)
from billiards_env.physics.motion import path_of
from billiards_env.physics.state import AX, AY, VX, VY, X, Y
from billiards_env.scene import CONTACT_GAP


@inlined
def stays_within(x, v, a, end, room):
    """Returns whether x + v t + a t^2 / 2 stays within +-room for t in [0, end], by its Bezier control points.

    It may return False for a path that stays within.
    """
    room *= 1.0 - MARGIN
    half = x + 0.5 * end * v
    last = x + end * (v + 0.5 * end * a)
    return abs(x) < room and abs(half) < room and abs(last) < room


@inlined
def half_sizes(numbers, outline):
    """Returns half the sides of the rectangle that no cushion reaches into, m."""
    if outline is None:
        return numbers.half_length, numbers.half_width
    return outline.box[BOX_X], outline.box[BOX_Y]


@inlined
def wall_time(path, radius, end, numbers, outline):
    """Returns the time at which a ball next touches a cushion, s, and the number of the cushion.

    Args:
        path: The `Path` of the ball's centre.
        radius: m.
        end: End of the interval, s.
        numbers: The `Numbers`.
        outline: The `Outline`; None for a rectangle.

    Returns:
        (time, number); the time is infinite if the ball touches no cushion until `end`.
    """
    half_length, half_width = half_sizes(numbers, outline)
    first, side = exit_time(path, half_length - radius, half_width - radius, end)
    if outline is None:
        return first, side
    return outline_time(path, radius, end, first, side, outline)


@inlined
def exit_time(path, room_x, room_y, end):
    """Returns the time at which a path leaves a rectangle of half sides, s, and the side, 0 to 3 for -x, +x, -y, +y."""
    x, y, vx, vy, ax, ay = path
    first, number = math.inf, -1
    if not stays_within(x, vx, ax, end, room_x):
        first, number = _side_time(x, vx, ax, end, room_x)
    if not stays_within(y, vy, ay, end, room_y):
        t, side = _side_time(y, vy, ay, end, room_y)
        if t < first:
            first, number = t, 2 + side
    return first, number


@inlined
def _side_time(x, v, a, end, room):
    """Returns the time at which x + v t + a t^2 / 2 leaves +-room, s, and the side, 0 or 1."""
    ahead = v > 0.0 or (v == 0.0 and a > 0.0)
    sign = 1.0 if ahead else -1.0
    first, side = line_time(room - sign * x, sign * v, sign * a, end), 1 if ahead else 0
    if end * abs(a) >= 1.9 * abs(v):  # otherwise the coordinate is on this side of its start until the end
        t = line_time(room + sign * x, -sign * v, -sign * a, end)
        if t < first:
            first, side = t, 1 - side
    return first, side


@inlined
def rectangle_side(wall, radius, numbers):
    """Returns the `Side` of a cushion of a rectangle for a ball with a radius, m."""
    nx, ny = normal_at(0.0, 0.0, wall, None)
    return Side(nx, ny, (numbers.half_length if wall < 2 else numbers.half_width) - radius, None)


@inlined
def is_at_joint(outline, wall, x, y, gap):
    """Returns whether a ball at (x, y) touches a cushion where its curvature changes, up to a gap, m."""
    if outline is None:
        return False
    near = 2.0 * JOINT + gap
    if wall < len(outline.lines):
        line = outline.lines[wall]
        return abs(abs(line[TX] * (x - line[LINE_X]) + line[TY] * (y - line[LINE_Y])) - line[HALF_LINE]) <= near
    tip = outline.tips[wall - len(outline.lines)]
    dx, dy = x - tip[TIP_X], y - tip[TIP_Y]
    return abs(dx * tip[BEGIN_TX] + dy * tip[BEGIN_TY]) <= near or abs(dx * tip[END_TX] + dy * tip[END_TY]) <= near


@inlined
def normal_at(x, y, wall, outline):
    """Returns the unit normal of a cushion at a ball at (x, y), m, which points into the cushion."""
    if outline is None:
        sign = 1.0 if wall % 2 else -1.0
        return (sign, 0.0) if wall < 2 else (0.0, sign)
    return outline_normal(x, y, wall, outline)


@inlined
def wall_normal(state, i, wall, outline):
    """Returns the unit normal of a cushion at ball i, which points into the cushion."""
    return normal_at(state.rows[i, X], state.rows[i, Y], wall, outline)


@inlined
def curvature_at(wall, radius, outline):
    """Returns the curvature of the line of the centres of balls that touch a cushion, 1/m; 0 for a straight one."""
    if outline is None:
        return 0.0
    tip = wall - len(outline.lines)
    return 0.0 if tip < 0 else 1.0 / (radius + outline.tips[tip, TIP_RADIUS])


@inlined
def walls_met(state, i, wall, radius, numbers, outline):
    """Returns the cushions that act on ball i, which touches `wall` and perhaps others at this instant.

    A ball touches a cushion that is nearer than `CONTACT_GAP`, as two balls touch. The normals of two cushions that act
    are the nearest on both sides of the direction of motion. If this direction is not between two normals, the nearest
    acts alone, because its impulse takes the ball away from the others too. If the ball approaches no cushion, the
    direction is that of its acceleration, which presses it against them.

    Args:
        state: The `State`.
        i: The ball.
        wall: The number of a cushion that it touches.
        radius: m.
        numbers: The `Numbers`.
        outline: The `Outline`; None for a rectangle.

    Returns:
        The numbers of two cushions; the second is -1 if one acts. The first is the one whose normal is nearer to
        the x axis; if both are as near, the one that the ball approaches faster, or else the one with the lower number.
    """
    half_length, half_width = half_sizes(numbers, outline)
    past_x = abs(state.rows[i, X]) - (half_length - radius)
    past_y = abs(state.rows[i, Y]) - (half_width - radius)
    at_one_side = min(past_x, past_y) < -CONTACT_GAP and max(past_x, past_y) <= CONTACT_GAP
    if at_one_side or (outline is None and min(past_x, past_y) < -CONTACT_GAP):
        return wall, -1
    return _walls_met(path_of(state, i), wall, radius, outline)


@kernel
def _walls_met(path, wall, radius, outline):
    """Returns the cushions that act on a ball in a corner of a rectangle, or at any place of an outline."""
    x, y, vx, vy, ax, ay = path
    if outline is None:
        return _sides_met(path, wall)
    if not touches_another(x, y, wall, radius, outline):
        return wall, -1
    one, two = walls_around(path, vx, vy, wall, radius, outline)
    if one < 0:
        one, two = walls_around(path, ax, ay, wall, radius, outline)
    if two < 0:
        return (wall if one < 0 else one), -1
    (nx, ny), (mx, my) = outline_normal(x, y, one, outline), outline_normal(x, y, two, outline)
    if (abs(nx), nx * vx + ny * vy, two) > (abs(mx), mx * vx + my * vy, one):
        return one, two
    return two, one


@inlined
def _sides_met(path, wall):
    """Returns the cushions that act on a ball in a corner of a rectangle."""
    x, y, vx, vy, ax, ay = path
    dx, dy = (vx if vx != 0.0 else ax), (vy if vy != 0.0 else ay)
    if dx == 0.0 or dy == 0.0 or x * dx < 0.0 or y * dy < 0.0:
        return wall, -1
    across, along = (1 if dx > 0.0 else 0), (3 if dy > 0.0 else 2)
    if (vx == 0.0) == (vy == 0.0):
        return across, along
    return (across if vy == 0.0 else along), -1


@inlined
def wall_pressing(state, i, nx, ny, wall, scene_radius, outline):
    """Returns the acceleration of ball i towards a cushion with the normal (nx, ny), m/s^2."""
    s = state.rows[i]
    towards = nx * s[AX] + ny * s[AY]
    if outline is None:
        return towards
    return towards - centrifugal(s[VX], s[VY], nx, ny, wall, scene_radius, outline)


@inlined
def is_side(wall, side, outline):
    """Returns whether a cushion is straight and has the normal of cushion `side` of a rectangle."""
    if outline is None:
        return wall == side
    (nx, ny), lines = normal_at(0.0, 0.0, side, None), outline.lines
    return wall < len(lines) and lines[wall, NX] == nx and lines[wall, NY] == ny


@inlined
def wall_count(outline):
    """Returns the number of cushions."""
    if outline is None:
        return 4
    return len(outline.lines) + len(outline.tips)


@inlined
def wall_turns(outline):
    """Returns the number of calls of `next_overlap` for one ball."""
    return 6 if outline is None else 3


@inlined
def next_overlap(x, y, vx, vy, radius, turn, numbers, outline):
    """Returns the number of a cushion that a ball overlaps, or -1.

    A ball overlaps an outline if its centre is nearer than its radius to a cushion, or outside the outline. If it is
    outside, it overlaps the nearest cushion only, at whatever depth.

    Args:
        x: Position of the ball along x, m.
        y: The same along y.
        vx: Its velocity along x, m/s.
        vy: The same along y.
        radius: m.
        turn: The number of the call, from 0 to `wall_turns`. Each call with a rectangle tests one cushion, those across
            x twice. Each call with an outline returns the next cushion that the ball does not leave.
        numbers: The `Numbers`.
        outline: The `Outline`; None for a rectangle.
    """
    if outline is None:
        return turn % 4 if wall_overlap(x, y, radius, turn % 4, numbers, outline)[0] > 0.0 else -1
    return next_piece(x, y, vx, vy, radius, outline)


@inlined
def wall_overlap(x, y, radius, wall, numbers, outline):
    """Returns the distance by which a ball at (x, y) is beyond a cushion, m, and the normal into the cushion.

    The distance is not positive if the ball does not overlap the cushion.
    """
    if outline is None:
        sign = 1.0 if wall % 2 else -1.0
        if wall < 2:
            return sign * x - (numbers.half_length - radius), sign, 0.0
        return sign * y - (numbers.half_width - radius), 0.0, sign
    return piece_overlap(x, y, radius, wall, distance_outside(x, y, outline), outline)


@kernel
def deepest_overlap(x, y, radius, numbers, outline):
    """Returns the number of the cushion that a ball is farthest beyond, or -1 if none by more than `CONTACT_GAP`.

    If the centre is within `CONTACT_GAP` of an outline, rounding decides on which side it is, so both sides count.
    """
    deepest, cushion = CONTACT_GAP, -1
    if outline is None:
        for wall in range(4):
            beyond, _, _ = wall_overlap(x, y, radius, wall, numbers, outline)
            if beyond > deepest:
                deepest, cushion = beyond, wall
    else:
        outside = distance_outside(x, y, outline)
        for wall in range(len(outline.lines) + len(outline.tips)):
            for side in (outside if outside > CONTACT_GAP else 0.0, max(outside, CONTACT_GAP)):
                beyond, _, _ = piece_overlap(x, y, radius, wall, side, outline)
                if beyond > deepest:
                    deepest, cushion = beyond, wall
    return cushion


@inlined
def overlap_time(path, radius, wall, beyond, speed, outline):
    """Returns how long ago a ball that overlaps a cushion first touched it, s.

    Args:
        path: The straight `Path` of the ball.
        radius: m.
        wall: The number of the cushion.
        beyond: Distance beyond the cushion, m.
        speed: Speed into the cushion, > 0, m/s.
        outline: The `Outline`; None for a rectangle.
    """
    if outline is None or wall < len(outline.lines):
        return beyond / speed
    tip = outline.tips[wall - len(outline.lines)]
    dx, dy, reach = tip[TIP_X] - path.x, tip[TIP_Y] - path.y, tip[TIP_RADIUS] + radius
    dw, vv = (dx * path.vx + dy * path.vy, path.vx * path.vx + path.vy * path.vy)  # |d + v t| t seconds ago
    return (math.sqrt(max(0.0, dw * dw + vv * (reach * reach - (dx * dx + dy * dy)))) - dw) / vv


@inlined
def back_to_wall(x, y, radius, wall, numbers, outline):
    """Returns the position at which a ball that overlaps a cushion, at (x, y), touches the cushion's nearest point."""
    if outline is None:
        sign = 1.0 if wall % 2 else -1.0
        if wall < 2:
            return sign * (numbers.half_length - radius), y
        return x, sign * (numbers.half_width - radius)
    return back_to_piece(x, y, radius, wall, outline)
