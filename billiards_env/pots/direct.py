"""The geometry of a direct pot, and the open mouth of a pocket."""

from __future__ import annotations

import math
from typing import NamedTuple

from billiards_env.jit import inlined, kernel
from billiards_env.physics.elementary import norm
from billiards_env.physics.geometry.pockets import centre_of
from billiards_env.physics.geometry.walls import TIP_RADIUS, TIP_X, TIP_Y
from billiards_env.physics.state import X, Y
from billiards_env.pots.hits import Hit, approach_gap, ball_gap, can_hit, enters_pocket, hit_along, hit_at, room_of
from billiards_env.pots.paths import pocket_gap
from billiards_env.pots.rims import circle_tangent, cross, distance_along, half_chord, half_width_of, rim_ends

THINNEST = 0.05
"""The cosine of the thinnest cut."""

_LEEWAY = 0.02  # radians by which a ball on a cushion may miss the open mouth, because the cushion guides it
_CLEAR = 1e-6  # m; gap between the cue ball at the hit and a cushion


class PotGeometry(NamedTuple):
    """How the cue ball sends an object ball into a pocket.

    Attributes:
        ball: The object ball.
        pocket: The pocket.
        wall: The cushion of a bank, 0 to 3 for -x, +x, -y, +y; -1 for a direct pot.
        hit: The hit.
        run: The distance from the object ball to the pocket, m.
        mouth: Half the angle of the open mouth as seen from the object ball, minus the error of its direction, radians.
        gap: The smallest gap to a third ball, m, at most `FAR`; negative if the pot is not possible.
    """

    ball: int
    pocket: int
    wall: int
    hit: Hit
    run: float
    mouth: float
    gap: float


NO_POT = PotGeometry(-1, -1, -1, Hit(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), 0.0, 0.0, -1.0)
"""A pot that is not possible."""


@inlined
def direct_pot(table, i, p):
    """Returns the `PotGeometry` at which ball i goes straight into pocket p.

    The object ball goes to the middle of the pocket's open mouth. If the cue ball would overlap a cushion at this hit,
    the cue ball is moved off the cushion, along the object ball's surface.
    """
    if _is_behind(table, i, p):
        return NO_POT
    scene, x, y = table.scene, table.positions[i, X], table.positions[i, Y]
    mouth = open_mouth(scene, i, p, x, y)
    if mouth.half <= 0.0:
        return NO_POT
    reach = scene.space.contact_distance(table.cue, i, scene)
    room_x, room_y = room_of(scene, table.cue)
    ghost = hit_along(table, i, mouth.dx, mouth.dy)
    ghost_x, ghost_y = _off_cushion(ghost.x, ghost.y, x, y, room_x - _CLEAR, reach)
    ghost_y, ghost_x = _off_cushion(ghost_y, ghost_x, y, x, room_y - _CLEAR, reach)
    hit = hit_at(table, i, ghost_x, ghost_y)
    if not can_hit(table, hit, THINNEST):
        return NO_POT
    along = mouth.dx * hit.line_x + mouth.dy * hit.line_y
    off = abs(math.atan2(cross(mouth.dx, mouth.dy, hit.line_x, hit.line_y), along))
    run = distance_along(scene.pockets[p], x, y, hit.line_x, hit.line_y)
    end_x, end_y = x + run * hit.line_x, y + run * hit.line_y
    if off > mouth.half + _LEEWAY or enters_pocket(table, hit) or pocket_gap(scene.pockets, p, x, y, end_x, end_y) < 0:
        return NO_POT
    gap = min(approach_gap(table, i, hit), ball_gap(table, i, i, x, y, end_x, end_y))
    return PotGeometry(i, p, -1, hit, run, max(mouth.half - off, mouth.half / 10), gap)


@inlined
def _is_behind(table, i, p):
    """Returns whether the cut angle is more than 90 degrees for every point of the mouth of pocket p."""
    positions, pocket = table.positions, table.scene.pockets[p]
    way_x, way_y = positions[i, X] - positions[table.cue, X], positions[i, Y] - positions[table.cue, Y]
    to_x, to_y = centre_of(pocket)
    to_x, to_y = to_x - positions[i, X], to_y - positions[i, Y]
    widest = half_width_of(pocket) + _LEEWAY * norm(to_x, to_y)
    return way_x * to_x + way_y * to_y < -norm(way_x, way_y) * widest


class Mouth(NamedTuple):
    """The open mouth of a pocket as seen from a point.

    Attributes:
        dx, dy: The direction of its middle.
        half: Half its angle, radians; 0 if no point of the rim can be reached.
    """

    dx: float
    dy: float
    half: float


@kernel
def open_mouth(scene, i, p, x, y):
    """Returns the open mouth of pocket p as seen from the point (x, y), which is outside of the pocket.

    It lies between the tips of the jaws. Without jaws it is the part of the rim that the centre of ball i can reach;
    its ends are tangents of the rim, or the points where the rim meets the limits of the ball's centre.
    """
    right, left = scene.outline.mouths[p]
    if min(right, left) < 0:
        return _middle(*rim_ends(scene.pockets[p], x, y, *room_of(scene, i), _CLEAR))
    right_tip, left_tip, radius = scene.outline.tips[right], scene.outline.tips[left], scene.radius[i]
    right_x, right_y = circle_tangent(right_tip[TIP_X] - x, right_tip[TIP_Y] - y, right_tip[TIP_RADIUS] + radius, 1.0)
    left_x, left_y = circle_tangent(left_tip[TIP_X] - x, left_tip[TIP_Y] - y, left_tip[TIP_RADIUS] + radius, -1.0)
    return _middle(right_x, right_y, left_x, left_y)


@inlined
def _middle(right_x, right_y, left_x, left_y):
    """Returns the `Mouth` between two vectors."""
    turn = cross(right_x, right_y, left_x, left_y)
    if turn <= 0.0:
        return Mouth(0.0, 0.0, 0.0)
    right, left = norm(right_x, right_y), norm(left_x, left_y)
    dx, dy = right_x / right + left_x / left, right_y / right + left_y / left
    length = norm(dx, dy)
    return Mouth(dx / length, dy / length, 0.5 * math.atan2(turn, right_x * left_x + right_y * left_y))


@inlined
def _off_cushion(a, b, ball_a, ball_b, room, reach):
    """Returns the point (a, b), moved so that abs(a) <= `room` and its distance from (ball_a, ball_b) is `reach`."""
    if abs(a) <= room:
        return a, b
    limit = math.copysign(room, a)
    half = half_chord(reach, limit - ball_a)
    return (limit, ball_b + math.copysign(half, b - ball_b)) if half >= 0.0 else (a, b)
