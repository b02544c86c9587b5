"""The aim of a bank: a pot off one cushion."""

from __future__ import annotations

import math
from typing import NamedTuple

from billiards_env.jit import inlined, kernel
from billiards_env.physics.elementary import norm, sine_cosine
from billiards_env.physics.geometry.pockets import centre_of
from billiards_env.physics.geometry.walls import NX, NY
from billiards_env.physics.motion import motion_after
from billiards_env.physics.state import REST, T0, X, Y
from billiards_env.pots.direct import NO_POT, THINNEST, PotGeometry, open_mouth
from billiards_env.pots.hits import (
    approach_gap,
    ball_gap,
    can_hit,
    enters_pocket,
    hit_along,
    meet_again,
    play_hit,
    room_of,
)
from billiards_env.pots.paths import LEGS, begin_leg, end_leg, pocket_gap
from billiards_env.pots.rims import cross, distance_along

_STEPS = 6  # of the secant method
_MISS = 2e-3  # m: the largest accepted distance of the path from the target
_APART = 0.2  # m: the least distance of the pocket from its mirror image, to leave out pockets in this cushion
_SHORT = 0.1  # m: a ball that meets its second cushion this close to the pocket still counts


class Bank(NamedTuple):
    """The path of a ball off a cushion into a pocket.

    Attributes:
        x, y: The ball's centre at the cushion, m.
        end_x, end_y: The target: the middle of the pocket's open mouth as seen from the cushion, m.
        second: The distance from the cushion to the target, m; 0 if the ball does not arrive.
        half: Half the angle of the mouth as seen from the cushion, radians.
        miss: The distance of the path from the target, m, positive if the target is on the left.
        time: The time from the hit to the target, s.
    """

    x: float
    y: float
    end_x: float
    end_y: float
    second: float
    half: float
    miss: float
    time: float


NO_BANK = Bank(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@kernel
def bank_pot(table, i, p, wall, speed, state):
    """Returns the `PotGeometry` at which ball i goes off a cushion, 0 to 3 for -x, +x, -y, +y, into pocket p.

    The first guess of the object ball's direction is the direction off a mirror. The secant method corrects it until
    the ball meets the middle of the pocket's mouth. The arguments are as in `hits`.
    """
    scene, x, y = table.scene, table.positions[i, X], table.positions[i, Y]
    image_x, image_y, apart = _mirrored(scene, i, p, wall)
    if apart < _APART:
        return NO_POT
    angle, last_angle, last_miss = math.atan2(image_y - y, image_x - x), 0.0, 0.0
    for step in range(_STEPS):
        sine, cosine = sine_cosine(angle)
        hit = hit_along(table, i, cosine, sine)
        if not can_hit(table, hit, 2 * THINNEST) or not play_hit(table, i, hit, speed, state):
            return NO_POT
        bounce = _follow_bank(scene, state, i, p, wall)
        if bounce.second <= 0.0:
            return NO_POT
        run = norm(bounce.x - x, bounce.y - y) + bounce.second
        if abs(bounce.miss) < _MISS:
            if enters_pocket(table, hit) or meet_again(table, i, hit, speed, bounce.time, state):
                return NO_POT
            gap = min(
                approach_gap(table, i, hit),
                ball_gap(table, i, i, x, y, bounce.x, bounce.y),
                ball_gap(table, i, i, bounce.x, bounce.y, bounce.end_x, bounce.end_y),
            )
            return PotGeometry(i, p, wall, hit, run, bounce.half * bounce.second / run, gap)
        # In a mirror the path after the cushion turns by the opposite angle.
        slope = run if step == 0 else (bounce.miss - last_miss) / (angle - last_angle)
        if slope <= 0.0:
            return NO_POT
        last_angle, last_miss = angle, bounce.miss
        angle -= bounce.miss / slope
    return NO_POT


@inlined
def _mirrored(scene, i, p, wall):
    """Returns the mirror image of a pocket, m, and its distance from the pocket.

    It is the image of the point nearest to the pocket's centre that the centre of ball i can reach. The mirror is the
    line at which the cushion stops the centre of ball i.
    """
    room_x, room_y = room_of(scene, i)
    x, y = centre_of(scene.pockets[p])
    x, y = min(max(x, -room_x), room_x), min(max(y, -room_y), room_y)
    sign = 2.0 * (wall & 1) - 1.0
    if wall < 2:
        return 2.0 * sign * room_x - x, y, 2.0 * abs(sign * room_x - x)
    return x, 2.0 * sign * room_y - y, 2.0 * abs(sign * room_y - y)


@inlined
def _follow_bank(scene, state, i, p, wall):
    """Computes the path of ball i off a cushion to pocket p, and returns the `Bank`."""
    row, bounce = state.rows[i], NO_BANK
    state.phase[i] = REST
    for _ in range(LEGS):
        leg = begin_leg(scene, state, i)
        x, y = row[X], row[Y]
        for k in range(1, leg.chords + 1):
            to_x, to_y, _, _ = motion_after(state, i, leg.lasts * k / leg.chords)
            sx, sy = to_x - x, to_y - y
            length = norm(sx, sy)
            if length > 0.0:
                if bounce.second > 0.0:
                    left_x, left_y = bounce.end_x - x, bounce.end_y - y
                    along = (left_x * sx + left_y * sy) / length
                    if along <= (length + _SHORT if k == leg.chords and leg.wall >= 0 else length):
                        miss = cross(sx, sy, left_x, left_y) / length
                        time = row[T0] + leg.lasts * (k - 1 + max(along, 0.0) / length) / leg.chords
                        return Bank(*bounce[:-2], miss, time)
                if pocket_gap(scene.pockets, p if bounce.second > 0.0 else -1, x, y, to_x, to_y) < 0.0:
                    return NO_BANK
            x, y = to_x, to_y
        if leg.chords == 0 or (
            leg.wall >= 0 and (bounce.second > 0.0 or not _is_side(leg.wall, wall, scene.outline.lines))
        ):
            return NO_BANK
        end_leg(scene, state, i, leg)
        if leg.wall >= 0:
            bounce = _bounce(scene, i, p, row[X], row[Y])
            if bounce.second <= 0.0:
                return NO_BANK
    return NO_BANK


@inlined
def _is_side(cushion, side, lines):
    """Returns whether a cushion is straight and has the normal of cushion `side` of a rectangle."""
    across, along = (NX, NY) if side < 2 else (NY, NX)
    return cushion < len(lines) and lines[cushion, across] == 2.0 * (side & 1) - 1.0 and lines[cushion, along] == 0.0


@inlined
def _bounce(scene, i, p, x, y):
    """Returns the `Bank` at (x, y), without its miss and time."""
    mouth = open_mouth(scene, i, p, x, y)
    if mouth.half <= 0.0:
        return NO_BANK
    second = distance_along(scene.pockets[p], x, y, mouth.dx, mouth.dy)
    return Bank(x, y, x + second * mouth.dx, y + second * mouth.dy, second, mouth.half, 0.0, 0.0)
