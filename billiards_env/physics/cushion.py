"""The impact of a ball on a cushion."""

from __future__ import annotations

import math

from billiards_env.physics.compliance import friction_impulse
from billiards_env.physics.jit import inlined, kernel
from billiards_env.physics.mathavan import integrate_impact
from billiards_env.physics.state import (
    CUSHION,
    CUSHION_HEIGHT,
    E_CUSHION,
    E_FLOOR,
    E_LOSS,
    E_ONSET,
    MOTION,
    MU_CUSHION,
    RESTITUTION,
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


@inlined
def cushion_restitution(speed, params):
    """Returns the restitution at a normal speed, m/s."""
    e = params[E_CUSHION]
    if params[E_LOSS] > 0.0 and speed > params[E_ONSET]:
        e = max(params[E_FLOOR], e - params[E_LOSS] * (speed - params[E_ONSET]))
    return e


@inlined
def _nose(vn, vt, un, ut, rwz, radius, params):
    """Returns the geometry of a contact with the nose of a cushion.

    The nose touches the ball at height h, an angle theta above its centre with sin(theta) = h/R - 1. The slip (sx, sy)
    is that of the cushion on the ball: friction on the ball has its direction.

    Returns:
        (sin, cos, sx, sy, rwn, rwt): of theta, the slip, and the spins about n and t times the radius, m/s.
    """
    sin = params[CUSHION_HEIGHT] / radius - 1.0
    cos = math.sqrt(1.0 - sin * sin)
    # Spin in terms of slip: R omega_t = vn - un, R omega_n = ut - vt.
    rwt, rwn = vn - un, ut - vt
    return sin, cos, vn * sin + rwt, -vt - rwz * cos + rwn * sin, rwn, rwt


@inlined
def _leave(vn, vt, rwn, rwt, rwz, px, pxe, pye, pze, sin, cos):
    """Returns (vn, vt, un, ut, rwz) with the normal velocity `vn` after the impulses of a contact at the nose.

    Args:
        vn: Velocity into the cushion after the impact, m/s.
        vt: Velocity along the cushion before it, m/s.
        rwn: Spin about n times the radius before it, m/s.
        rwt: The same about t.
        rwz: The same about z.
        px: Horizontal impulse into the cushion, per mass, m/s.
        pxe: Friction along the tangent that points up, per mass, m/s.
        pye: Friction along t, per mass, m/s.
        pze: Normal impulse, per mass, m/s.
        sin: Sine of the angle of the nose.
        cos: Its cosine.
    """
    pz = pxe * cos - pze * sin
    vt += pye
    rwn -= 2.5 * pye * sin
    rwt += 2.5 * (px * sin - pz * cos)
    rwz += 2.5 * pye * cos
    return vn, vt, vn - rwt, vt + rwn, rwz


@kernel
def han2005(vn, vt, un, ut, rwz, radius, rebound, params):
    """Returns a ball's motion after an impact on a cushion with friction and spin.

    The law is that of Han (2005), Dynamics in Carom and Three Cushion Billiards. At the point of contact friction
    either stops the slip or acts against it throughout (his equations 14 to 23). The vertical velocity is set to zero,
    as in his carom model. If the ball would leave more slowly than `rebound`, the normal impulse and its friction are
    raised until the ball leaves at `rebound`.

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
    sin, cos, sx, sy, rwn, rwt = _nose(vn, vt, un, ut, rwz, radius, params)
    slip = math.sqrt(sx * sx + sy * sy)
    pze = (1.0 + cushion_restitution(vn, params)) * vn * cos  # impulses per mass
    if slip * (2.0 / 7.0) <= mu * pze:
        pxe, pye = sx * (2.0 / 7.0), sy * (2.0 / 7.0)
    else:
        pxe, pye = mu * pze * (sx / slip), mu * pze * (sy / slip)
    px = -pxe * sin - pze * cos
    raised = vn + px > -rebound
    if raised:
        px = -(vn + rebound)
        pxe, pye, pze = _squeeze(vn + rebound, sx, sy, sin, cos, mu)
    vn_after = -rebound if raised else vn + px
    vn, vt, un, ut, rwz = _leave(vn_after, vt, rwn, rwt, rwz, px, pxe, pye, pze, sin, cos)
    return vn, vt, un, ut, rwz, raised


@kernel
def stronge(compliance, vn, vt, un, ut, rwz, radius, rebound, params):
    """Returns a ball's motion after an impact on a compliant cushion, as `han2005` does.

    The normal impulse is that of `han2005`; the friction is that of `compliance.friction_impulse`. If the ball would
    leave more slowly than `rebound`, a horizontal impulse through its centre, without friction, makes up for it.
    """
    sin, cos, sx, sy, rwn, rwt = _nose(vn, vt, un, ut, rwz, radius, params)
    slip = math.sqrt(sx * sx + sy * sy)
    e = cushion_restitution(vn, params)
    pze = (1.0 + e) * vn * cos
    pxe = pye = 0.0
    if slip > 0.0:
        friction = friction_impulse(slip, params[MU_CUSHION] * vn * cos, e, compliance[0])
        pxe, pye = friction * (sx / slip), friction * (sy / slip)
    px = -pxe * sin - pze * cos
    raised = vn + px > -rebound
    vn_after = -rebound if raised else vn + px
    vn, vt, un, ut, rwz = _leave(vn_after, vt, rwn, rwt, rwz, px, pxe, pye, pze, sin, cos)
    return vn, vt, un, ut, rwz, raised


@kernel
def mathavan2010(cloth, vn, vt, un, ut, rwz, radius, rebound, params):
    """Returns a ball's motion after an impact by `mathavan.integrate_impact`, as `stronge` does."""
    sin, cos, _, _, rwn, rwt = _nose(vn, vt, un, ut, rwz, radius, params)
    mu, e = params[MU_CUSHION], cushion_restitution(vn, params)
    vx, vy, rwx, rwy, rwz = integrate_impact(-vt, vn, -rwt, rwn, rwz, sin, cos, mu, cloth[0], e)
    raised = vy > -rebound
    vn = -rebound if raised else vy
    return vn, -vx, vn + rwx, rwy - vx, rwz, raised


@inlined
def _by_law(compliance, cloth, vn, vt, un, ut, rwz, radius, rebound, params):
    if compliance is not None:
        return stronge(compliance, vn, vt, un, ut, rwz, radius, rebound, params)
    if cloth is not None:
        return mathavan2010(cloth, vn, vt, un, ut, rwz, radius, rebound, params)
    return han2005(vn, vt, un, ut, rwz, radius, rebound, params)


@inlined
def cushion_impact(vn, vt, un, ut, rwz, radius, rebound, scene):
    """Returns a ball's motion after an impact on the scene's cushions with friction. See `han2005`."""
    return _by_law(scene.stronge, scene.mathavan, vn, vt, un, ut, rwz, radius, rebound, scene.params)


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
    speed = max(0.0, vn)
    if params[CUSHION] != RESTITUTION:
        radius = scene.radius[i]
        un, ut = nx * s[UX] + ny * s[UY], nx * s[UY] - ny * s[UX]
        vn, vt, un, ut, rwz, raised = cushion_impact(speed, vt, un, ut, radius * s[WZ], radius, rebound, scene)
        s[VX], s[VY] = nx * vn - ny * vt, ny * vn + nx * vt
        s[UX], s[UY] = nx * un - ny * ut, ny * un + nx * ut
        s[WZ] = rwz / radius
        return raised and rebound > 0.0
    e = cushion_restitution(speed, params)
    raised = e * speed < rebound
    after = -rebound if raised else -e * vn
    if params[MOTION] == SLIDING_AND_ROLLING:
        s[UX] += (after - vn) * nx
        s[UY] += (after - vn) * ny
    s[VX], s[VY] = nx * after - ny * vt, ny * after + nx * vt
    return raised
