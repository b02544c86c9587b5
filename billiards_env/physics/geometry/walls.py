"""The cushions of a table: their kernels, their data, and what is common to all tables.

`Walls` describes the kernels. `rectangle` contains those of a rectangle and `outline_walls` those of any outline, with
the same names. A scene has the kernels of one of them, so numba compiles only these.

If a ball touches several cushions at one instant, at most two of them act: of those on the left of its direction of
motion the one whose normal is nearest to this direction, and the same on the right (see `Walls.met`).

A ball touches a straight cushion if its centre is at the distance R from it and the point nearest to the centre lies
between the ends of the cushion. It touches a tip of radius r, the arc at the end of a cushion, if the centres are R + r
apart and the arc is the nearest part of the tip's circle.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from billiards_env.jit import inlined
from billiards_env.physics.geometry.contact import MARGIN, line_time
from billiards_env.physics.motion import relative_to
from billiards_env.physics.state import AX, AY, VX, VY

JOINT = 1e-10
"""m. A piece of an outline is longer by this at each end, so no path passes between two pieces. It is far more than the
rounding of the ends. A straight cushion that ends at a sharp corner then extends beyond the path of a ball's centre by
JOINT^2 / (2 R) < 1e-16 m."""

TURNS = 6
"""The number of calls of `Walls.next_overlap` for one ball."""

# Columns of `Outline.lines`.
LINE_X, LINE_Y = 0, 1  # the middle, m; a mirrored cushion has the mirrored middle
TX, TY = 2, 3  # unit tangent
NX, NY = 4, 5  # unit normal, from the table into the cushion
HALF_LINE = 6  # half the length, m; negative if it is so short that the arcs at its ends meet

# Columns of `Outline.tips`.
TIP_X, TIP_Y, TIP_RADIUS = 0, 1, 2  # m
BEGIN_TX, BEGIN_TY, END_TX, END_TY = 3, 4, 5, 6  # unit tangents at the beginning and at the end

# Columns of `Outline.rails`.
RAIL_SIDE, RAIL_FROM, RAIL_TO, RAIL_LINE = 0, 1, 2, 3


class Walls(NamedTuple):
    """The kernels of the cushions of a table.

    They change none of their arguments. The cushions have the numbers of the rows of `Outline.lines`, and then of
    `Outline.tips`. Normals are unit vectors from the table into the cushion. (x, y) is the centre of a ball, m,
    `radius` its radius, m, and `scene` the `SceneArrays`.

    Attributes:
        time: (path, radius, end, scene). Returns the time at which a ball with a `Path` next touches a cushion, s, and
            the number of the cushion. The time is infinite if the ball touches none until `end`, s.
        normal: (x, y, wall, scene). Returns the normal (nx, ny) of a cushion at a ball.
        met: (state, i, wall, scene). Returns the numbers of the cushions that act on ball i of a `State`, which touches
            `wall` and perhaps others at this instant; the second is -1 if one acts. A ball touches a cushion that is
            nearer than `CONTACT_GAP`, as two balls touch. The normals of two cushions that act are the nearest on both
            sides of the direction of motion. If this direction is not between two normals, the nearest acts alone,
            because its impulse takes the ball away from the others too. If the ball approaches no cushion, the
            direction is that of its acceleration, which presses it against them. The first of two is the one whose
            normal is nearer to the x axis; if both are as near, the one that the ball approaches faster, or else the
            one with the lower number.
        overlap: (x, y, radius, wall, scene). Returns (beyond, nx, ny): the distance by which a ball is beyond a
            cushion, m, and the normal. The distance is not positive if the ball does not overlap the cushion.
        next_overlap: (x, y, vx, vy, radius, turn, scene). Returns the number of a cushion that a ball with the
            velocity (vx, vy), m/s, overlaps, or -1. `turn` is the number of the call, from 0 to `TURNS` - 1.
        deepest_overlap: (x, y, radius, scene). Returns the number of the cushion that a ball is farthest beyond, or -1
            if it is beyond none by more than `CONTACT_GAP`.
        back_to: (x, y, radius, wall, scene). Returns the position at which a ball that overlaps a cushion touches the
            nearest point of the cushion.
    """

    time: Any
    normal: Any
    met: Any
    overlap: Any
    next_overlap: Any
    deepest_overlap: Any
    back_to: Any


class Outline(NamedTuple):
    """The cushions of a table as lines and arcs.

    Attributes:
        lines: (k, 7) float64, the straight cushions, see the columns above. Those of a rectangle are -x, +x, -y, +y.
            Their length is infinite, because balls inside the rectangle do not reach their ends.
        tips: (m, 7) float64, the arcs, see the columns above.
        box: (2,) float64, m: no cushion reaches into the rectangle abs(x) < box[0], abs(y) < box[1].
        rails: (j, 4) float64, the straight cushions on the sides of this rectangle: the side, 0 to 3 for -x, +x, -y,
            +y, the smallest and the largest coordinate along it, m, and the row of `lines`.
        mouths: (p, 2) int64, for each pocket the tips to the right and to the left of its mouth, as seen from the
            centre of the table; -1 for none.
        ends: (2 k, 2) float64, m, the ends of the straight cushions in their order: a polygon that has chords instead
            of arcs.
    """

    lines: Any
    tips: Any
    box: Any
    rails: Any
    mouths: Any
    ends: Any


class Circle(NamedTuple):
    """A circle that the centre of a ball may enter.

    Attributes:
        path: The `Path` of the ball relative to its centre.
        reach: Its radius, m.
    """

    path: Any
    reach: Any


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
def faces(tip, x, y):
    """Returns whether the arc of a tip is the part of its circle that is nearest to a point."""
    dx, dy = x - tip[TIP_X], y - tip[TIP_Y]
    return dx * tip[BEGIN_TX] + dy * tip[BEGIN_TY] >= -JOINT and dx * tip[END_TX] + dy * tip[END_TY] <= JOINT


@inlined
def tip_circle(path, tip, radius):
    """Returns the `Circle` of a row of `Outline.tips` for a ball with a `Path` and a radius, m."""
    return Circle(relative_to(path, tip[TIP_X], tip[TIP_Y]), tip[TIP_RADIUS] + radius)


@inlined
def is_beside(line, x, y):
    """Returns whether the point of a straight cushion that is nearest to a ball lies between its ends."""
    return abs(line[TX] * (x - line[LINE_X]) + line[TY] * (y - line[LINE_Y])) <= line[HALF_LINE] + JOINT


@inlined
def centres_at(wall, radius, outline):
    """Returns the circle on which the centres of balls that touch a cushion lie: x, y and its radius, m.

    The radius is infinite for a straight cushion; x and y are 0 then.
    """
    k = wall - len(outline.lines)
    if k < 0:
        return 0.0, 0.0, math.inf
    return outline.tips[k, TIP_X], outline.tips[k, TIP_Y], outline.tips[k, TIP_RADIUS] + radius


@inlined
def wall_pressing(state, i, nx, ny, wall, scene):
    """Returns the acceleration of ball i towards a cushion with the normal (nx, ny), m/s^2.

    A ball that moves along an arc leaves it at the centrifugal acceleration.
    """
    s = state.rows[i]
    around = nx * s[VY] - ny * s[VX]
    return nx * s[AX] + ny * s[AY] - around * around / centres_at(wall, scene.radius[i], scene.outline)[2]


@inlined
def overlap_time(path, radius, wall, beyond, speed, outline):
    """Returns how long ago a ball that overlaps a cushion first touched it, s.

    Args:
        path: The straight `Path` of the ball.
        radius: m.
        wall: The number of the cushion.
        beyond: Distance beyond the cushion, m.
        speed: Speed into the cushion, > 0, m/s.
        outline: The `Outline`.
    """
    x, y, reach = centres_at(wall, radius, outline)
    if reach == math.inf:
        return beyond / speed
    dx, dy = x - path.x, y - path.y
    dw, vv = (dx * path.vx + dy * path.vy, path.vx * path.vx + path.vy * path.vy)  # |d + v t| t seconds ago
    return (math.sqrt(max(0.0, dw * dw + vv * (reach * reach - (dx * dx + dy * dy)))) - dw) / vv
