"""The impact of a ball on a cushion."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from billiards_env.jit import inlined, kernel
from billiards_env.physics.compliance import friction_impulse
from billiards_env.physics.mathavan import CushionNose, integrate_impact
from billiards_env.physics.state import SLIDING_AND_ROLLING, UX, UY, VX, VY, WZ


class CushionMotion(NamedTuple):
    """The motion of a ball at a cushion with the normal n into the cushion and the tangent t = z x n.

    Attributes:
        vn: Velocity along n, m/s.
        vt: Velocity along t, m/s.
        un: Slip on the cloth along n, m/s.
        ut: Slip on the cloth along t, m/s.
        rwz: Spin about the vertical axis times the radius, m/s.
    """

    vn: Any
    vt: Any
    un: Any
    ut: Any
    rwz: Any


class Nose(NamedTuple):
    """The contact of a ball with the nose of a cushion.

    The nose touches the ball at the height h. The contact is at the angle theta above the ball's centre. The slip is
    the velocity of the cushion relative to the ball, and friction on the ball acts along it.

    Attributes:
        sin: sin(theta) = h / R - 1.
        cos: cos(theta).
        sx: Slip along the tangent that points up, m/s.
        sy: Slip along t, m/s.
        rwn: Spin about n times the radius, m/s.
        rwt: Spin about t times the radius, m/s.
    """

    sin: Any
    cos: Any
    sx: Any
    sy: Any
    rwn: Any
    rwt: Any


@inlined
def cushion_restitution(speed, numbers):
    """Returns the restitution at a normal speed, m/s."""
    e = numbers.e_cushion
    if numbers.e_cushion_loss > 0.0 and speed > numbers.e_cushion_onset:
        e = max(numbers.e_cushion_floor, e - numbers.e_cushion_loss * (speed - numbers.e_cushion_onset))
    return e


@inlined
def _nose(before, radius, numbers):
    """Returns the `Nose` of a cushion for a ball with the `CushionMotion` `before`."""
    vn, vt, un, ut, rwz = before
    sin = numbers.cushion_height / radius - 1.0
    cos = math.sqrt(1.0 - sin * sin)
    # Spin in terms of slip: R omega_t = vn - un, R omega_n = ut - vt.
    rwt, rwn = vn - un, ut - vt
    return Nose(sin, cos, vn * sin + rwt, -vt - rwz * cos + rwn * sin, rwn, rwt)


@inlined
def _squeeze(needed, nose, mu):
    """Returns the friction and the normal impulse (pxe, pye, pze), per mass, with the horizontal sum `needed`, m/s."""
    sin, cos, sx, sy = nose.sin, nose.cos, nose.sx, nose.sy
    slip = math.sqrt(sx * sx + sy * sy)
    resistance = cos + (mu * sin * (sx / slip) if slip > 0.0 else 0.0)
    pze = needed / resistance if resistance > 0.0 else math.inf
    if slip * (2.0 / 7.0) <= mu * pze:  # friction sticks
        return sx * (2.0 / 7.0), sy * (2.0 / 7.0), max(0.0, (needed - sx * (2.0 / 7.0) * sin) / cos)
    return mu * pze * (sx / slip), mu * pze * (sy / slip), pze


@inlined
def _leave(before, nose, vn, px, pxe, pye, pze):
    """Returns the `CushionMotion` with the normal velocity vn after impulses, all in m/s.

    The impulses per mass are px (horizontal, into the cushion), the friction pxe (up) and pye (along t), pze (normal).
    """
    sin, cos = nose.sin, nose.cos
    pz = pxe * cos - pze * sin
    vt = before.vt + pye
    rwn = nose.rwn - 2.5 * pye * sin
    rwt = nose.rwt + 2.5 * (px * sin - pz * cos)
    return CushionMotion(vn, vt, vn - rwt, vt + rwn, before.rwz + 2.5 * pye * cos)


@inlined
def han2005(before, radius, rebound, numbers):
    """Returns a ball's motion after an impact on a cushion with friction and spin.

    The law is that of Han (2005), Dynamics in Carom and Three Cushion Billiards. At the point of contact friction
    either stops the slip or acts against it throughout (his equations 14 to 23). The vertical velocity is set to zero,
    as in his carom model. If the ball would leave more slowly than `rebound`, the normal impulse and its friction are
    raised until the ball leaves at `rebound`.

    Args:
        before: The `CushionMotion` before the impact, vn >= 0.
        radius: m.
        rebound: Least speed away from the cushion after the impact, m/s, >= 0.
        numbers: The `Numbers`.

    Returns:
        after: The `CushionMotion` after the impact, with vn <= -rebound.
        raised: Whether `rebound` raised the impulse.
    """
    mu, vn = numbers.mu_cushion, before.vn
    nose = _nose(before, radius, numbers)
    sin, cos, sx, sy = nose.sin, nose.cos, nose.sx, nose.sy
    slip = math.sqrt(sx * sx + sy * sy)
    pze = (1.0 + cushion_restitution(vn, numbers)) * vn * cos  # impulses per mass
    if slip * (2.0 / 7.0) <= mu * pze:
        pxe, pye = sx * (2.0 / 7.0), sy * (2.0 / 7.0)
    else:
        pxe, pye = mu * pze * (sx / slip), mu * pze * (sy / slip)
    px = -pxe * sin - pze * cos
    raised = vn + px > -rebound
    if raised:
        px = -(vn + rebound)
        pxe, pye, pze = _squeeze(vn + rebound, nose, mu)
    return _leave(before, nose, -rebound if raised else vn + px, px, pxe, pye, pze), raised


@kernel
def stronge(before, radius, rebound, numbers):
    """Returns a ball's motion after an impact on a compliant cushion, as `han2005` does.

    The normal impulse is that of `han2005`; the friction is that of `compliance.friction_impulse`. If the ball would
    leave more slowly than `rebound`, a horizontal impulse through its centre, without friction, makes up for it.
    """
    vn = before.vn
    nose = _nose(before, radius, numbers)
    sin, cos, sx, sy = nose.sin, nose.cos, nose.sx, nose.sy
    slip = math.sqrt(sx * sx + sy * sy)
    e = cushion_restitution(vn, numbers)
    pze = (1.0 + e) * vn * cos
    pxe = pye = 0.0
    if slip > 0.0:
        friction = friction_impulse(slip, numbers.mu_cushion * vn * cos, e, numbers.cushion_frequency_ratio)
        pxe, pye = friction * (sx / slip), friction * (sy / slip)
    px = -pxe * sin - pze * cos
    raised = vn + px > -rebound
    return _leave(before, nose, -rebound if raised else vn + px, px, pxe, pye, pze), raised


@kernel
def mathavan2010(before, radius, rebound, numbers):
    """Returns a ball's motion after an impact by `mathavan.integrate_impact`, as `stronge` does."""
    vn, vt, _, _, rwz = before
    nose = _nose(before, radius, numbers)
    contact = CushionNose(nose.sin, nose.cos, numbers.mu_cushion, numbers.mu_cloth)
    e = cushion_restitution(vn, numbers)
    vx, vy, rwx, rwy, rwz = integrate_impact(-vt, vn, -nose.rwt, nose.rwn, rwz, contact, e)
    raised = vy > -rebound
    vn = -rebound if raised else vy
    return CushionMotion(vn, -vx, vn + rwx, rwy - vx, rwz), raised


class Cushion(NamedTuple):
    """A cushion of scenes.

    Attributes:
        law: The law of its impacts, see `han2005`.
        rubs: Whether it has friction. Without friction `reflect` needs only the restitution.
        work: `Numbers.cushion_work`; with extreme numbers an impact may take twenty times as long.
    """

    law: Callable[..., Any]
    rubs: bool = True
    work: int = 1


CUSHIONS = {
    "restitution": Cushion(han2005, rubs=False),
    "han2005": Cushion(han2005),
    "stronge": Cushion(stronge),
    "mathavan2010": Cushion(mathavan2010, work=500),
}
"""The cushions of scenes."""

LAWS = tuple(dict.fromkeys(cushion.law for cushion in CUSHIONS.values()))
"""The laws, in the order of `SceneArrays.cushion`."""


def by_law(kernel: Callable[..., Any], *others: Callable[..., Any]) -> Callable[..., Any]:
    """Returns a kernel that calls one of the given kernels, that of the scene's law.

    The given kernels are in the order of `LAWS`, one for each law. The arguments of the returned kernel are
    `SceneArrays.cushion` and a tuple with the arguments of the given kernel. Numba compiles only the kernel that is
    called: it leaves out what follows a condition that an argument is None, but not what follows the opposite.
    """
    others_by_law: Any = by_law(*others) if others else None

    @inlined
    def call(is_law, is_other, laws, arguments):
        if is_law is None:
            if is_other is None:
                raise ValueError  # never
            return others_by_law(laws[1:], arguments)
        return kernel(*arguments)

    @inlined
    def call_last(laws, arguments):
        return kernel(*arguments)

    @inlined
    def call_first(laws, arguments):
        is_law, is_other = laws[0]
        return call(is_law, is_other, laws, arguments)

    return call_first if others else call_last


_impact = by_law(*LAWS)


@inlined
def cushion_impact(before, radius, rebound, scene):
    """Returns a ball's motion after an impact on the scene's cushions with friction. See `han2005`."""
    return _impact(scene.cushion, (before, radius, rebound, scene.numbers))


@inlined
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
    s, numbers = state.rows[i], scene.numbers
    vn, vt = nx * s[VX] + ny * s[VY], nx * s[VY] - ny * s[VX]
    speed = max(0.0, vn)
    if numbers.cushion_rubs:
        radius = scene.radius[i]
        un, ut = nx * s[UX] + ny * s[UY], nx * s[UY] - ny * s[UX]
        before = CushionMotion(speed, vt, un, ut, radius * s[WZ])
        (vn, vt, un, ut, rwz), raised = cushion_impact(before, radius, rebound, scene)
        s[VX], s[VY] = nx * vn - ny * vt, ny * vn + nx * vt
        s[UX], s[UY] = nx * un - ny * ut, ny * un + nx * ut
        s[WZ] = rwz / radius
        return raised and rebound > 0.0
    e = cushion_restitution(speed, numbers)
    raised = e * speed < rebound
    after = -rebound if raised else -e * vn
    if numbers.motion == SLIDING_AND_ROLLING:
        s[UX] += (after - vn) * nx
        s[UY] += (after - vn) * ny
    s[VX], s[VY] = nx * after - ny * vt, ny * after + nx * vt
    return raised
