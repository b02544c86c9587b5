"""The noses of the cushions as a ball in the air meets them: horizontal lines at the height of the noses.

A nose is so far from the middle of the table that a ball on the cloth touches it where it touches the cushion: at the
distance R - R cos(theta) from the line of the cushion, with the angle theta of `cushion.Nose`. Only a rectangle has
them.
"""

from __future__ import annotations

import math

from billiards_env.jit import inlined
from billiards_env.physics.geometry.contact import circle_time
from billiards_env.physics.geometry.walls import normal_at
from billiards_env.physics.laws.cushion import nose_of
from billiards_env.physics.motion import Path
from billiards_env.physics.state import X, Y, Z


@inlined
def room_between_noses(radius, numbers):
    """Returns the largest abs(x) and abs(y) of a point between the noses, m."""
    inset = radius * (1.0 - nose_of(radius, numbers).cos)
    return numbers.half_length - inset, numbers.half_width - inset


@inlined
def _distance_to_nose(x, y, wall, radius, numbers):
    """Returns the horizontal distance of a point between the noses from the nose of a cushion, m, and its normal."""
    (room_x, room_y), (nx, ny) = room_between_noses(radius, numbers), normal_at(0.0, 0.0, wall, None)
    return (room_x if wall < 2 else room_y) - (nx * x + ny * y), nx, ny


@inlined
def nose_time(path, rise, radius, end, noise, wall, numbers):
    """Returns the time at which a ball in the air next touches the nose of a cushion, s, or infinity.

    Args:
        path: The straight `Path` of the ball.
        rise: Its height above the cloth, m, and its vertical velocity, m/s.
        radius: m.
        end: End of the interval, s.
        noise: See `circle_time`.
        wall: The number of the cushion.
        numbers: The `Numbers`.
    """
    gap, nx, ny = _distance_to_nose(path.x, path.y, wall, radius, numbers)
    speed = nx * path.vx + ny * path.vy
    if gap > radius and gap - speed * end > radius:
        return math.inf
    across = Path(gap, rise[0] - radius * nose_of(radius, numbers).sin, -speed, rise[1], 0.0, -numbers.g)
    return circle_time(across, radius, end, noise)


@inlined
def nose_normal(row, wall, radius, numbers):
    """Returns the unit normal (x, y, z) from the centre of a ball to the nose of a cushion that it touches."""
    gap, nx, ny = _distance_to_nose(row[X], row[Y], wall, radius, numbers)
    below = row[Z] - radius * nose_of(radius, numbers).sin
    distance = math.sqrt(gap * gap + below * below)
    return nx * gap / distance, ny * gap / distance, -below / distance
