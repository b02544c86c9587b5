"""The noses of the cushions, which balls in the air meet: horizontal lines at the height of the noses.

A nose is R - R cos(theta) nearer to the middle of the table than the line of the cushion, with the angle theta of
`cushion.Nose`. So a ball on the cloth that touches the cushion touches the nose too. Only a rectangle has noses. A nose
ends where it meets the circle of a pocket, and a ball may touch this end.
"""

from __future__ import annotations

import math

from billiards_env.jit import inlined, kernel
from billiards_env.physics.geometry.contact import circle_time, sphere_time
from billiards_env.physics.geometry.pockets import bounding_circle, pocket_at
from billiards_env.physics.geometry.walls import normal_at
from billiards_env.physics.laws.cushion import nose_of
from billiards_env.physics.motion import Path
from billiards_env.physics.state import X, Y, Z
from billiards_env.scene import CONTACT_GAP


@inlined
def room_between_noses(radius, numbers):
    """Returns the largest abs(x) and abs(y) of a point between the noses, m."""
    inset = radius * (1.0 - nose_of(radius, numbers).cos)
    return numbers.half_length - inset, numbers.half_width - inset


@inlined
def _distance_to_nose(x, y, wall, radius, numbers):
    """Returns the horizontal distance of a point from the line of a nose, m, its normal, and the place along it, m."""
    (room_x, room_y), (nx, ny) = room_between_noses(radius, numbers), normal_at(0.0, 0.0, wall, None)
    return (room_x if wall < 2 else room_y) - (nx * x + ny * y), nx, ny, y if wall < 2 else x


@inlined
def _mouth(pocket, wall, radius, numbers):
    """Returns the middle of the gap that a pocket makes in a nose, m, and half its length; -1.0 without a gap."""
    x, y, reach = bounding_circle(pocket)
    away, _, _, along = _distance_to_nose(x, y, wall, radius, numbers)
    square = reach * reach - away * away
    return along, math.sqrt(square) if square > 0.0 else -1.0


@inlined
def _mouth_at(pockets, along, wall, radius, numbers):
    """Returns the `_mouth` that contains a place along the line of a nose; half its length is -1.0 if none does."""
    for k in range(len(pockets)):
        middle, half = _mouth(pockets[k], wall, radius, numbers)
        if abs(along - middle) < half:
            return middle, half
    return 0.0, -1.0


@inlined
def mouth_beyond(pockets, x, y, radius, numbers):
    """Returns the pocket in whose mouth a point is, farther out than a ball on the cloth can be; -1 if none."""
    room_x, room_y = room_between_noses(radius, numbers)
    pocket = -1
    if abs(x) > numbers.half_length - radius + CONTACT_GAP:
        pocket = pocket_at(pockets, math.copysign(room_x, x), y, 1.0)
    if pocket < 0 and abs(y) > numbers.half_width - radius + CONTACT_GAP:
        pocket = pocket_at(pockets, x, math.copysign(room_y, y), 1.0)
    return pocket


@kernel
def nose_time(path, rise, radius, end, noise, wall, pockets, numbers):
    """Returns the time at which a ball in the air next touches the nose of a cushion, s, or infinity.

    Args:
        path: The straight `Path` of the ball.
        rise: Its height above the cloth, m, and its vertical velocity, m/s.
        radius: m.
        end: End of the interval, s.
        noise: See `circle_time`.
        wall: The number of the cushion.
        pockets: The rows of the pockets.
        numbers: The `Numbers`.
    """
    gap, nx, ny, along = _distance_to_nose(path.x, path.y, wall, radius, numbers)
    speed, slide = nx * path.vx + ny * path.vy, path.vy if wall < 2 else path.vx
    if min(gap, gap - speed * end) > radius:
        return math.inf
    (z, vz), height, g = rise, radius * nose_of(radius, numbers).sin, numbers.g
    room_x, room_y = room_between_noses(radius, numbers)
    room, first = room_y if wall < 2 else room_x, math.inf
    for k in range(len(pockets)):
        middle, half = _mouth(pockets[k], wall, radius, numbers)
        for side in (-1.0, 1.0):
            place = middle + side * half
            if half > 0.0 and abs(place) <= room:
                to_end = Path(along - place, gap, slide, -speed, 0.0, 0.0)
                first = min(first, sphere_time(to_end, (z - height, vz, -g), radius, end, noise))
    begin, t, touches = 0.0, 0.0, False
    while True:
        middle, half = _mouth_at(pockets, along + slide * t, wall, radius, numbers)
        if half > 0.0:
            if slide == 0.0:
                return first
            begin = max(t, (middle + math.copysign(half, slide) - along) / slide)  # the path leaves the mouth
        elif touches:
            return min(first, t) if abs(along + slide * t) <= room else first
        if begin >= min(first, end) or (touches and begin == t):
            return first
        across = Path(gap - speed * begin, z + begin * (vz - 0.5 * begin * g) - height, -speed, vz - begin * g, 0.0, -g)
        t, touches = begin + circle_time(across, radius, end - begin, noise), True
        if t == math.inf:
            return first


@inlined
def nose_normal(row, wall, radius, pockets, numbers):
    """Returns the unit normal (x, y, z) from the centre of a ball to the nose of a cushion that it touches."""
    gap, nx, ny, along = _distance_to_nose(row[X], row[Y], wall, radius, numbers)
    middle, half = _mouth_at(pockets, along, wall, radius, numbers)
    aside = middle + math.copysign(half, along - middle) - along if half > 0.0 else 0.0
    below = row[Z] - radius * nose_of(radius, numbers).sin
    distance = math.sqrt(gap * gap + aside * aside + below * below)
    tx, ty = (0.0, aside) if wall < 2 else (aside, 0.0)
    return (nx * gap + tx) / distance, (ny * gap + ty) / distance, -below / distance
