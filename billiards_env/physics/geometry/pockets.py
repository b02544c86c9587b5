"""The geometry of a pocket: the circle whose rim a ball's centre crosses when the ball drops.

The argument `pocket` is a row of `SceneArrays.pockets`. The shape of a pocket is in this module, in
`scene.table.Pocket`, in `noses` (for flights) and in the 50-digit reference.
"""

from __future__ import annotations

import math

from billiards_env.jit import inlined, kernel
from billiards_env.physics.elementary import norm
from billiards_env.physics.geometry.contact import cross, distance_to_segment, half_chord, misses_circle, sweep
from billiards_env.physics.motion import relative_to

_X, _Y, _RADIUS = 0, 1, 2  # columns of `SceneArrays.pockets`, m


@inlined
def centre_of(pocket):
    """Returns the place (x, y) at which a potted ball stays, m."""
    return pocket[_X], pocket[_Y]


@inlined
def half_width_of(pocket):
    """Returns half the width of the mouth, m."""
    return pocket[_RADIUS]


@inlined
def bounding_circle(pocket):
    """Returns x, y and the radius of a circle that contains the pocket, m."""
    return pocket[_X], pocket[_Y], pocket[_RADIUS]


@inlined
def path_to(path, pocket):
    """Returns a ball's `Path` in the frame of a pocket, and the distance from the origin at which the ball drops, m."""
    return relative_to(path, pocket[_X], pocket[_Y]), pocket[_RADIUS]


@inlined
def pockets_near(path, end, pockets):
    """Returns the first and the last pocket that a ball's `Path` may reach until `end`, s; (n, -1) if it reaches none.

    Other pockets are out of its reach. All n pockets are tested without branches, because these are hard to predict.
    """
    swept, first, last = sweep(path, end), len(pockets), -1
    for k in range(len(pockets)):
        from_pocket, reach = path_to(path, pockets[k])
        near = not misses_circle(from_pocket, swept, reach)
        first, last = min(first, k if near else first), k if near else last
    return first, last


@inlined
def pocket_at(pockets, x, y, larger):
    """Returns the first pocket that contains a point, or -1. The area of a pocket is multiplied by `larger`."""
    for p in range(len(pockets)):
        dx, dy, reach = x - pockets[p, _X], y - pockets[p, _Y], pockets[p, _RADIUS]
        if dx * dx + dy * dy < larger * (reach * reach):
            return p
    return -1


@inlined
def pocket_exit(path, pocket):
    """Returns the time after which a straight `Path` leaves a pocket, s, or infinity."""
    (x, y, vx, vy, _, _), reach = path_to(path, pocket)
    vv, dw = vx * vx + vy * vy, x * vx + y * vy
    square = dw * dw + vv * (reach * reach - (x * x + y * y))
    t = (math.sqrt(square) - dw) / vv if square > 0.0 else -1.0
    return t if t > 0.0 else math.inf


@inlined
def distance_from(pocket, x, y):
    """Returns the distance of a point from the rim, m; negative inside."""
    return norm(x - pocket[_X], y - pocket[_Y]) - pocket[_RADIUS]


@inlined
def outwards_at(pocket, x, y):
    """Returns the normal (x, y) of the rim, away from the pocket, at a point of the rim. Its length is arbitrary."""
    return x - pocket[_X], y - pocket[_Y]


@inlined
def segment_gap(pocket, ax, ay, bx, by):
    """Returns the distance of the segment from (ax, ay) to (bx, by) from the rim, m; negative if it enters."""
    return distance_to_segment(ax, ay, bx, by, pocket[_X], pocket[_Y]) - pocket[_RADIUS]


@inlined
def distance_along(pocket, x, y, dx, dy):
    """Returns the distance from (x, y) along a line to the rim, or to the line's point nearest to the pocket, m."""
    to_x, to_y = pocket[_X] - x, pocket[_Y] - y
    return to_x * dx + to_y * dy - max(half_chord(pocket[_RADIUS], cross(dx, dy, to_x, to_y)), 0.0)


@inlined
def circle_tangent(to_x, to_y, radius, side):
    """Returns the direction, (x, y), of a tangent of a circle with its centre at (to_x, to_y).

    The tangent begins at the origin. The circle is on its right (side = 1) or left (side = -1).
    """
    along = max(half_chord(norm(to_x, to_y), radius), 0.0)
    return along * to_x - side * radius * to_y, along * to_y + side * radius * to_x


@kernel
def rim_ends(pocket, x, y, room_x, room_y, slack):
    """Returns the right and the left end of the rim as seen from (x, y), as vectors (right_x, right_y, left_x, left_y).

    The ends are tangents of the rim, or the points where it meets the limits of a ball's centre, abs(x) <= `room_x` and
    abs(y) <= `room_y`. All four are zero if no point of the rim is within these limits, up to `slack`.
    """
    r = pocket[_RADIUS]
    to_x, to_y = pocket[_X] - x, pocket[_Y] - y
    ends, square = (0.0, 0.0, 0.0, 0.0), to_x * to_x + to_y * to_y
    if square <= r * r:
        return ends
    most_x, most_y, length = room_x + slack, room_y + slack, math.sqrt(square - r * r) / square
    for side in (-1.0, 1.0):
        along_x, along_y = circle_tangent(to_x, to_y, r, side)
        ends = _wider(ends, length * along_x, length * along_y, x, y, most_x, most_y)
        for limit_x in (-room_x, room_x):
            half = half_chord(r, limit_x - x - to_x)
            if half >= 0.0:
                ends = _wider(ends, limit_x - x, to_y + side * half, x, y, most_x, most_y)
        for limit_y in (-room_y, room_y):
            half = half_chord(r, limit_y - y - to_y)
            if half >= 0.0:
                ends = _wider(ends, to_x + side * half, limit_y - y, x, y, most_x, most_y)
    return ends


@inlined
def _wider(ends, to_x, to_y, x, y, most_x, most_y):
    """Returns the ends of a rim after they are extended by a point that a ball can reach."""
    if abs(x + to_x) > most_x or abs(y + to_y) > most_y:
        return ends
    right_x, right_y, left_x, left_y = ends
    if right_x == 0.0 and right_y == 0.0:
        return to_x, to_y, to_x, to_y
    if cross(right_x, right_y, to_x, to_y) < 0.0:
        right_x, right_y = to_x, to_y
    if cross(left_x, left_y, to_x, to_y) > 0.0:
        left_x, left_y = to_x, to_y
    return right_x, right_y, left_x, left_y
