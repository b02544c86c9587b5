"""What the laws of two balls share: their contact, restitution along the line of centres, and friction against slip.

Friction acts against the slip of the two surfaces. The slip has a part "across", along t = z x h with the horizontal
unit vector h from ball 1 to ball 2, and a part "up", along b = n x t. For disks and balls of equal radius the normal n
is h, and b is z. Normal and tangential impulses are independent, so the slip keeps its direction, and Coulomb's law has
a closed form (Alciatore 2019, TP A.14): the impulse is mu times the normal impulse or, if that is less, the impulse
that stops the slip. The vertical velocity is set to zero afterwards.

Spheres of radii R1 and R2 on a table have the normal n = c h + s z with c = 2 sqrt(R1 R2) / (R1 + R2) and
s = (R2 - R1) / (R1 + R2). The table holds both balls, so the impact changes their velocities along h as for disks. The
impulse p along h is that of a normal impulse p / c, which limits the friction. With W = R1 w1 + R2 w2, the slip is
t.(v1 - v2) + c W.z - s W.h across and -W.t - s h.(v1 - v2) up. The velocity along h changes in the impact; the friction
belongs to the slip after the normal impulse, so it never raises the energy.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from billiards_env.jit import inlined
from billiards_env.physics.state import SLIDING_AND_ROLLING, BallState


class BallLaw(NamedTuple):
    """A law of two balls. It gives the restitution and the friction of the impact that this module describes.

    Attributes:
        restitution: Kernel of (numbers, closing): the restitution of two balls that approach at `closing`, m/s. It is
            from 0 to 1 and may only fall with the speed.
        friction: Kernel of (numbers, speed): the coefficient of friction of two balls whose surfaces slide at `speed`,
            m/s. None for balls without friction.
    """

    restitution: Callable[..., Any]
    friction: Callable[..., Any] | None = None


class Pair(NamedTuple):
    """Two balls that touch.

    Attributes:
        nx: Horizontal unit vector h from the first to the second ball along x.
        ny: The same along y.
        radius_i: m, of the first ball.
        radius_j: m, of the second ball.
        inv_mass_i: 1/kg, of the first ball.
        inv_mass_j: 1/kg, of the second ball.
    """

    nx: Any
    ny: Any
    radius_i: Any
    radius_j: Any
    inv_mass_i: Any
    inv_mass_j: Any


@inlined
def distance_of(are_spheres, radius_i, radius_j):
    """Returns the horizontal distance of the centres of two balls that touch, m."""
    if are_spheres:
        return 2.0 * math.sqrt(radius_i * radius_j)
    return radius_i + radius_j


@inlined
def tilt_between(are_spheres, radius_i, radius_j):
    """Returns the cosine and the sine of the inclination of the normal from one ball to another."""
    if are_spheres:
        total = radius_i + radius_j
        return 2.0 * math.sqrt(radius_i * radius_j) / total, (radius_j - radius_i) / total
    return 1.0, 0.0


@inlined
def constant_restitution(numbers, closing):
    """Returns `e_ball` at each speed."""
    return numbers.e_ball


@inlined
def normal_impulse(closing, inv_mass_i, inv_mass_j, e):
    """Returns the impulse along the line of centres of two smooth balls that approach at speed `closing`, kg m/s.

    The relative normal velocity is reversed and multiplied by e; e = 1 and equal masses exchange the normal velocities.
    """
    return (1.0 + e) * closing / (inv_mass_i + inv_mass_j)


@inlined
def along_normal(tilt, p):
    """Returns the impulse along the normal of a contact whose horizontal part is p."""
    if tilt is None:
        return p
    cosine, _ = tilt
    return p / cosine


@inlined
def up_after(tilt, up, change):
    """Returns the upward slip after the speed of separation has risen by `change`, m/s."""
    if tilt is None:
        return up
    _, sine = tilt
    return up + sine * change


@inlined
def contact_slip(tilt, a, b, pair):
    """Returns the slip of the first ball's surface on the second one's across and up, m/s.

    Args:
        tilt: The result of `tilt_between`; None for disks.
        a: The `BallState` of the first ball.
        b: That of the second ball.
        pair: The `Pair`.
    """
    nx, ny = pair.nx, pair.ny
    side = nx * (a.vy - b.vy) - ny * (a.vx - b.vx)
    turn = pair.radius_i * a.wz + pair.radius_j * b.wz
    up_i = nx * (a.ux - a.vx) + ny * (a.uy - a.vy)
    up_j = nx * (b.ux - b.vx) + ny * (b.uy - b.vy)
    if tilt is None:
        return side + turn, up_i + up_j
    cosine, sine = tilt
    along = nx * (a.vx - b.vx) + ny * (a.vy - b.vy)
    lean_i = nx * (a.uy - a.vy) - ny * (a.ux - a.vx)
    lean_j = nx * (b.uy - b.vy) - ny * (b.ux - b.vx)
    return side + (cosine * turn - sine * (lean_i + lean_j)), (up_i + up_j) - sine * along


@inlined
def friction_impulse(across, up, slip, limit, stop):
    """Returns the impulse of friction on the first ball across and up, kg m/s, against the slip across and up, m/s.

    Args:
        across: Slip across, m/s.
        up: Slip up, m/s.
        slip: Its size, m/s.
        limit: Largest impulse, kg m/s.
        stop: Impulse per slip that stops the slip, kg.
    """
    if limit < stop * slip:
        return -(limit / slip) * across, -(limit / slip) * up
    if limit == 0.0:
        return 0.0, 0.0
    return -stop * across, -stop * up


@inlined
def rubbed(ball, sign, push, tilt, pair):
    """Returns a `BallState` after the friction of an impact.

    Args:
        ball: The `BallState`.
        sign: 1.0 for the first ball of the contact, -1.0 for the second.
        push: The impulse on the first ball across and up, kg m/s.
        tilt: See `contact_slip`.
        pair: The `Pair`.
    """
    nx, ny, (across, up) = pair.nx, pair.ny, push
    radius, inverse = (pair.radius_i, pair.inv_mass_i) if sign > 0.0 else (pair.radius_j, pair.inv_mass_j)
    if tilt is None:
        dv, du = sign * across * inverse, 2.5 * up * inverse  # the impulse turns both balls in the same direction
        return BallState(
            x=ball.x,
            y=ball.y,
            vx=ball.vx - dv * ny,
            vy=ball.vy + dv * nx,
            ux=ball.ux + (du * nx - dv * ny),
            uy=ball.uy + (du * ny + dv * nx),
            wz=ball.wz + 2.5 * across * inverse / radius,
        )
    cosine, sine = tilt
    dv_across, dv_along = sign * across * inverse, -(sign * up * inverse) * sine
    du_across, du_along = -2.5 * across * inverse * sine, 2.5 * up * inverse
    dvx, dvy = dv_along * nx - dv_across * ny, dv_along * ny + dv_across * nx
    return BallState(
        x=ball.x,
        y=ball.y,
        vx=ball.vx + dvx,
        vy=ball.vy + dvy,
        ux=ball.ux + (dvx + (du_along * nx - du_across * ny)),
        uy=ball.uy + (dvy + (du_along * ny + du_across * nx)),
        wz=ball.wz + 2.5 * across * inverse * cosine / radius,
    )


@inlined
def rub(ball, sign, push, tilt, pair):
    """Returns `rubbed`. Without an impulse the zeros of the motion keep their signs."""
    if push[0] == 0.0 and push[1] == 0.0:
        return ball
    return rubbed(ball, sign, push, tilt, pair)


@inlined
def push_ball(ball, dvx, dvy, motion):
    """Returns a `BallState` after a change of the velocity by (dvx, dvy), m/s, that does not change the spin."""
    vx, vy, ux, uy = ball.vx + dvx, ball.vy + dvy, ball.ux, ball.uy
    if motion == SLIDING_AND_ROLLING:
        ux, uy = ux + dvx, uy + dvy
    return BallState(x=ball.x, y=ball.y, vx=vx, vy=vy, ux=ux, uy=uy, wz=ball.wz)
