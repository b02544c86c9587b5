"""The impact of a ball on a cushion."""

from __future__ import annotations

import math

from billiards_env.physics.jit import inlined, kernel
from billiards_env.physics.state import (
    CUSHION,
    CUSHION_HEIGHT,
    E_CUSHION,
    HAN2005,
    MOTION,
    MU_CUSHION,
    SLIDING_AND_ROLLING,
    UX,
    UY,
    VX,
    VY,
    WZ,
)


@inlined
def _squeeze(needed, sx, sy, sin, cos, mu):
    """Returns the friction and the normal impulse (pxe, pye, pze) with a given horizontal sum, per mass, m/s.

    Args:
        needed: Impulse away from the cushion, per mass, m/s.
        sx: Slip at the point of contact along x, m/s.
        sy: Slip along y, m/s.
        sin: Sine of the angle of the point of contact above the ball's centre.
        cos: Cosine of that angle.
        mu: Coefficient of friction.
    """
    slip = math.sqrt(sx * sx + sy * sy)
    resistance = cos + (mu * sin * (sx / slip) if slip > 0.0 else 0.0)
    pze = needed / resistance if resistance > 0.0 else math.inf
    if slip * (2.0 / 7.0) <= mu * pze:  # friction sticks
        return sx * (2.0 / 7.0), sy * (2.0 / 7.0), max(0.0, (needed - sx * (2.0 / 7.0) * sin) / cos)
    return mu * pze * (sx / slip), mu * pze * (sy / slip), pze


@kernel
def han2005(vn, vt, un, ut, rwz, radius, rebound, params):
    """Returns a ball's motion after an impact on a cushion with friction and spin.

    The law is that of Han (2005), Dynamics in Carom and Three Cushion Billiards. The cushion's nose touches the ball at
    height h, an angle theta above its centre with sin(theta) = h/R - 1. At the point of contact friction either stops
    the slip or acts against it throughout (his equations 14 to 23). The vertical velocity is set to zero, as in his
    carom model. If the ball would leave more slowly than `rebound`, the normal impulse and its friction are raised
    until the ball leaves at `rebound`.

    Args:
        vn: Velocity into the cushion, >= 0, m/s.
        vt: Velocity along the tangent t = z x n, m/s.
        un: Slip on the cloth along n, m/s.
        ut: Slip on the cloth along t, m/s.
        rwz: Spin about the vertical axis times the radius, m/s.
        radius: m.
        rebound: Least speed away from the cushion after the impact, m/s, >= 0.
        params: (N_PARAMS,) float64.

    Returns:
        (vn, vt, un, ut, rwz, raised) after the impact, with vn <= -rebound; `raised`: whether `rebound` raised the
        impulse.
    """
    mu = params[MU_CUSHION]
    sin = params[CUSHION_HEIGHT] / radius - 1.0
    cos = math.sqrt(1.0 - sin * sin)
    # Spin in terms of slip: R omega_t = vn - un, R omega_n = ut - vt.
    rwt, rwn = vn - un, ut - vt
    sx = vn * sin + rwt
    sy = -vt - rwz * cos + rwn * sin
    slip = math.sqrt(sx * sx + sy * sy)
    pze = (1.0 + params[E_CUSHION]) * vn * cos  # impulses per mass
    if slip * (2.0 / 7.0) <= mu * pze:
        pxe, pye = sx * (2.0 / 7.0), sy * (2.0 / 7.0)
    else:
        pxe, pye = mu * pze * (sx / slip), mu * pze * (sy / slip)
    px = -pxe * sin - pze * cos
    raised = vn + px > -rebound
    if raised:
        px = -(vn + rebound)
        pxe, pye, pze = _squeeze(vn + rebound, sx, sy, sin, cos, mu)
    pz = pxe * cos - pze * sin
    vn_after = -rebound if raised else vn + px
    vt += pye
    rwn -= 2.5 * pye * sin
    rwt += 2.5 * (px * sin - pz * cos)
    rwz += 2.5 * pye * cos
    return vn_after, vt, vn_after - rwt, vt + rwn, rwz, raised


@kernel
def reflect(state, i, nx, ny, rebound, scene):
    """Changes ball i's velocity, slip and spin at a cushion.

    Args:
        state: The `State`.
        i: The ball.
        nx: The unit normal into the cushion along x.
        ny: The same along y.
        rebound: Least speed away from the cushion after the impact, m/s, >= 0.
        scene: The `SceneArrays`.

    Returns:
        Whether `rebound` has raised the speed away from the cushion.
    """
    s, params = state.rows[i], scene.params
    vn, vt = nx * s[VX] + ny * s[VY], nx * s[VY] - ny * s[VX]
    if params[CUSHION] == HAN2005:
        radius = scene.radius[i]
        un, ut = nx * s[UX] + ny * s[UY], nx * s[UY] - ny * s[UX]
        vn, vt, un, ut, rwz, raised = han2005(max(0.0, vn), vt, un, ut, radius * s[WZ], radius, rebound, params)
        s[VX], s[VY] = nx * vn - ny * vt, ny * vn + nx * vt
        s[UX], s[UY] = nx * un - ny * ut, ny * un + nx * ut
        s[WZ] = rwz / radius
        return raised and rebound > 0.0
    raised = params[E_CUSHION] * max(0.0, vn) < rebound
    after = -rebound if raised else -params[E_CUSHION] * vn
    if params[MOTION] == SLIDING_AND_ROLLING:
        s[UX] += (after - vn) * nx
        s[UY] += (after - vn) * ny
    s[VX], s[VY] = nx * after - ny * vt, ny * after + nx * vt
    return raised
