"""The friction of two balls in an impact, which throws the balls and transfers spin.

Friction acts against the slip of the two surfaces. The slip has a horizontal part along t = z x n and, from the spins
about horizontal axes, a vertical part. Normal and tangential impulses of spheres are independent, so the slip keeps its
direction, and Coulomb's law has a closed form (Alciatore 2019, TP A.14): the impulse is mu times the normal impulse or,
if that is less, the impulse that stops the slip. The vertical velocity is set to zero afterwards.
"""

from __future__ import annotations

from billiards_env.physics.elementary import exponential
from billiards_env.physics.jit import inlined, kernel
from billiards_env.physics.motion import norm
from billiards_env.physics.state import MU_DROP, MU_LIMIT, MU_RATE, UX, UY, VX, VY, WZ


@inlined
def friction_coefficient(ball_friction, speed):
    """Returns the coefficient of friction of two balls whose surfaces slide at `speed`, m/s."""
    mu = ball_friction[MU_LIMIT]
    if ball_friction[MU_DROP] > 0.0:
        mu += ball_friction[MU_DROP] * exponential(-ball_friction[MU_RATE] * speed)
    return mu


@inlined
def contact_slip(i, j, nx, ny, state, radius):
    """Returns the slip of ball i's surface on ball j's, (along z x n, along z), m/s; the normal n is from i to j."""
    a, b = state.rows[i], state.rows[j]
    across = nx * (a[VY] - b[VY]) - ny * (a[VX] - b[VX]) + (radius[i] * a[WZ] + radius[j] * b[WZ])
    up_i = nx * (a[UX] - a[VX]) + ny * (a[UY] - a[VY])
    up_j = nx * (b[UX] - b[VX]) + ny * (b[UY] - b[VY])
    return across, up_i + up_j


@kernel
def rub_ball(i, sign, nx, ny, across, up, state, scene):
    """Changes velocity, slip and spin of a ball by the friction of an impact.

    Args:
        i: The ball.
        sign: 1.0 if i is the first ball of the contact, -1.0 if it is the second.
        nx: Unit normal from the first to the second ball along x.
        ny: The same along y.
        across: Impulse on the first ball along z x n, kg m/s.
        up: Impulse on the first ball along z, kg m/s.
        state: The `State`.
        scene: The `SceneArrays`.
    """
    s, inverse = state.rows[i], scene.inv_mass[i]
    dv, du = sign * across * inverse, 2.5 * up * inverse  # the impulse turns both balls in the same direction
    s[VX] -= dv * ny
    s[VY] += dv * nx
    s[UX] += du * nx - dv * ny
    s[UY] += du * ny + dv * nx
    s[WZ] += 2.5 * across * inverse / scene.radius[i]


@inlined
def rub_pair(ball_friction, i, j, nx, ny, p, state, scene):
    """Changes velocities, slip and spin of two balls by the friction of an impact.

    Args:
        ball_friction: `SceneArrays.ball_friction`.
        i: The first ball.
        j: The second ball.
        nx: Unit normal from i to j along x.
        ny: The same along y.
        p: Normal impulse, kg m/s.
        state: The `State`.
        scene: The `SceneArrays`.
    """
    if ball_friction is None:
        return
    across, up = contact_slip(i, j, nx, ny, state, scene.radius)
    slip = norm(across, up)
    if slip > 0.0:
        stop = 1.0 / (3.5 * (scene.inv_mass[i] + scene.inv_mass[j]))  # impulse per slip that stops it
        limit = friction_coefficient(ball_friction, slip) * p
        ratio = -(limit / slip if limit < stop * slip else stop)
        rub_ball(i, 1.0, nx, ny, ratio * across, ratio * up, state, scene)
        rub_ball(j, -1.0, nx, ny, ratio * across, ratio * up, state, scene)
