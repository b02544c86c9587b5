"""The rim of a pocket in the search for pots: its ends as seen from a point, and its distance from lines.

The argument `pocket` is a row of `SceneArrays.pockets`, as in `physics.geometry.pockets`. The rim is the bounding
circle of the pocket, because all pockets are circles.
"""

from __future__ import annotations

import math

from billiards_env.jit import inlined, kernel
from billiards_env.physics.elementary import norm
from billiards_env.physics.geometry.contact import distance_to_segment
from billiards_env.physics.geometry.pockets import bounding_circle


@inlined
def cross(ax, ay, bx, by):
    """Returns the cross product of two vectors."""
    return ax * by - ay * bx


@inlined
def half_chord(radius, distance):
    """Returns half the length of the chord of a circle at a distance from its centre, or -1 if there is none."""
    square = radius * radius - distance * distance
    return math.sqrt(square) if square >= 0.0 else -1.0


@inlined
def half_width_of(pocket):
    """Returns half the width of the mouth, m."""
    return bounding_circle(pocket)[2]


@inlined
def segment_gap(pocket, ax, ay, bx, by):
    """Returns the gap between a segment, from (ax, ay) to (bx, by), and the rim, m; negative if the segment enters."""
    x, y, radius = bounding_circle(pocket)
    return distance_to_segment(ax, ay, bx, by, x, y) - radius


@inlined
def distance_along(pocket, x, y, dx, dy):
    """Returns the distance from (x, y) along a line to the rim, or to the line's point nearest to the pocket, m."""
    pocket_x, pocket_y, radius = bounding_circle(pocket)
    to_x, to_y = pocket_x - x, pocket_y - y
    return to_x * dx + to_y * dy - max(half_chord(radius, cross(dx, dy, to_x, to_y)), 0.0)


@inlined
def circle_tangent(to_x, to_y, radius, side):
    """Returns the direction, (x, y), of a tangent to a circle with the centre (to_x, to_y).

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
    pocket_x, pocket_y, r = bounding_circle(pocket)
    to_x, to_y = pocket_x - x, pocket_y - y
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
    """Returns the ends of a rim, moved outwards to a point if a ball can reach it."""
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
