"""The motion of a ball above the cloth, and its impacts on fixed bodies: the slate and the noses of cushions.

A ball flies if it is above the cloth or has a vertical velocity. Gravity acts on it, its spin is constant, and the drag
of the air is left out (Alciatore, TP B.10: less than 1 % of the speed).

At an impact on a fixed body, the normal impulse reverses the normal velocity and multiplies it by the restitution e.
With the normal impulse per mass p = (1 + e) v_n, friction acts against the slip of the contact point with the impulse
per mass mu p or, if that is less, 2/7 of the slip, which stops the slip. A bounce on the slate does not change the spin
about the vertical axis, because the contact point is below the centre (Alciatore, TP A.30 and TP B.10).

If the next hop would be lower than `least_hop`, the impact is plastic, and the ball stays on the cloth. The hops that
are left out have the speeds |v_z| e^k. They last T = 2 e |v_z| / (g (1 - e)) in all, and the sum of their normal
impulses is (1 + e) / (1 - e) |v_z| = |v_z| + g T. The plastic impact and the time T on the cloth have the same sum, so
the friction is the same. While the ball slides, its position is the same as with hops at each of their landings, and
differs by at most mu `least_hop` between them. The rolling resistance and the decay of the spin act in the time T but
not during hops; T is 0.02 s with the default numbers.
"""

from __future__ import annotations

import math

from billiards_env.jit import inlined
from billiards_env.physics.elementary import norm
from billiards_env.physics.state import UX, UY, VX, VY, VZ, WZ, BallState

STICK = 2.0 / 7.0
"""The ratio of the impulse per mass that stops a slip to the slip."""


@inlined
def time_of_fall(z, vz, g):
    """Returns the time until a ball at the height z, m, with the vertical velocity vz, m/s, lands, s."""
    root = math.sqrt(vz * vz + 2.0 * g * max(z, 0.0))
    return (vz + root) / g if vz > 0.0 else 2.0 * max(z, 0.0) / (root - vz)


@inlined
def height_after(z, vz, t, g):
    """Returns the height, m, and the vertical velocity, m/s, t seconds later."""
    return max(z + t * (vz - 0.5 * t * g), 0.0), vz - t * g


@inlined
def rub_impulse(slip, mu, p):
    """Returns the impulse of friction per mass, m/s, at a normal impulse per mass p, m/s, and a slip, m/s."""
    return min(mu * p, STICK * slip)


@inlined
def bounce_on_slate(ball, vz, numbers):
    """Returns the `BallState` and the vertical velocity, m/s, of a ball that lands with the vertical velocity vz <= 0.

    If the next hop would be lower than `least_hop`, the vertical velocity is zero.
    """
    up = -numbers.e_slate * vz
    stays = up * up < 2.0 * numbers.g * numbers.least_hop
    up = 0.0 if stays else up
    slip = norm(ball.ux, ball.uy)
    if slip == 0.0:
        return ball, up
    p = rub_impulse(slip, numbers.mu_slate, up - vz)
    dx, dy, sticks = p * (ball.ux / slip), p * (ball.uy / slip), p == STICK * slip
    ux, uy = (0.0, 0.0) if sticks else (ball.ux - 3.5 * dx, ball.uy - 3.5 * dy)
    return BallState(x=ball.x, y=ball.y, vx=ball.vx - dx, vy=ball.vy - dy, ux=ux, uy=uy, wz=ball.wz), up


@inlined
def bounce_in_air(row, n, p, mu, radius):  # out: row
    """Changes a row of `State.rows` by an impact on a fixed body.

    Args:
        row: The row of the ball.
        n: (x, y, z), the unit normal into the body.
        p: The normal impulse per mass, m/s.
        mu: The friction.
        radius: m.
    """
    nx, ny, nz = n
    vx, vy, vz = row[VX], row[VY], row[VZ]
    rwx, rwy, rwz = row[UY] - vy, vx - row[UX], radius * row[WZ]  # the spin times the radius, m/s
    speed = nx * vx + ny * vy + nz * vz
    sx = vx - speed * nx + (rwy * nz - rwz * ny)  # the slip
    sy = vy - speed * ny + (rwz * nx - rwx * nz)
    sz = vz - speed * nz + (rwx * ny - rwy * nx)
    slip = math.sqrt(sx * sx + sy * sy + sz * sz)
    share = rub_impulse(slip, mu, p) / slip if slip > 0.0 else 0.0
    jx, jy, jz = share * sx, share * sy, share * sz
    row[VX], row[VY], row[VZ] = vx - p * nx - jx, vy - p * ny - jy, vz - p * nz - jz
    rwx -= 2.5 * (ny * jz - nz * jy)
    rwy -= 2.5 * (nz * jx - nx * jz)
    row[UX], row[UY] = row[VX] - rwy, row[VY] + rwx
    row[WZ] = (rwz - 2.5 * (nx * jy - ny * jx)) / radius
