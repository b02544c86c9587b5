"""The impact of a ball on a cushion."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from billiards_env.jit import inlined, kernel
from billiards_env.physics.compliance import friction_impulse
from billiards_env.physics.contact import NOISE
from billiards_env.physics.mathavan import CushionNose, integrate_impact
from billiards_env.physics.motion import norm
from billiards_env.physics.state import SLIDING_AND_ROLLING, UX, UY, VX, VY, WZ

_TURNS = 4
"""Largest number of impacts on each of two cushions in `reflect_both`. The engine resolves an approach that remains."""


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
    if speed > numbers.e_cushion_onset:
        e -= numbers.e_cushion_loss * (speed - numbers.e_cushion_onset)
        if numbers.e_cushion_loss > 0.0:
            e = max(numbers.e_cushion_floor, e)
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
    if slip * (2.0 / 7.0) <= mu * pze and mu > 0.0:  # friction sticks
        return sx * (2.0 / 7.0), sy * (2.0 / 7.0), max(0.0, (needed - sx * (2.0 / 7.0) * sin) / cos)
    if slip > 0.0:
        return mu * pze * (sx / slip), mu * pze * (sy / slip), pze
    return 0.0, 0.0, pze


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
    pxe = pye = 0.0
    if slip * (2.0 / 7.0) <= mu * pze and mu > 0.0:
        pxe, pye = sx * (2.0 / 7.0), sy * (2.0 / 7.0)
    elif slip > 0.0:
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


@inlined
def mathavan_arguments(before, radius, numbers):
    """Returns the motion (vx, vy, rwx, rwy, rwz), the `CushionNose` and the restitution of `integrate_impact`."""
    nose = _nose(before, radius, numbers)
    contact = CushionNose(nose.sin, nose.cos, numbers.mu_cushion, numbers.mu_cloth)
    e = cushion_restitution(before.vn, numbers)
    return (-before.vt, before.vn, -nose.rwt, nose.rwn, before.rwz), contact, e


@kernel
def mathavan2010(before, radius, rebound, numbers):
    """Returns a ball's motion after an impact by `mathavan.integrate_impact`, as `stronge` does."""
    (vx, vy, rwx, rwy, rwz), nose, e = mathavan_arguments(before, radius, numbers)
    vx, vy, rwx, rwy, rwz = integrate_impact(vx, vy, rwx, rwy, rwz, nose, e)
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
    called. In a condition `x is None` it leaves out the other branch if x is None, but no branch if x is not None, so
    each law has two arguments of which one is None.
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


@kernel
def hit(motion, n, share, rebound, radius, scene):
    """Returns the motion of a ball after the impact of a part of its velocity on a cushion.

    Args:
        motion: Velocity (vx, vy), slip (ux, uy) and spin about the vertical axis times the radius, m/s.
        n: (nx, ny), the unit normal into the cushion.
        share: The part of the normal speed that acts on this cushion, m/s, >= 0. Another cushion stops the rest.
        rebound: See `han2005`.
        radius: m.
        scene: The `SceneArrays`.

    Returns:
        The motion, and whether `rebound` has raised the speed away from the cushion.
    """
    (vx, vy, ux, uy, rwz), (nx, ny) = motion, n
    vn, vt = nx * vx + ny * vy, nx * vy - ny * vx
    un, ut = nx * ux + ny * uy, nx * uy - ny * ux
    rest = vn - share
    if scene.numbers.cushion_rubs:
        before = CushionMotion(share, vt, un - rest, ut, rwz)
        (after, vt, un, ut, rwz), raised = cushion_impact(before, radius, rebound, scene)
        after, un = after + rest, un + rest
    else:
        speed = cushion_restitution(share, scene.numbers) * share
        after, raised = rest - max(speed, rebound), speed < rebound
        un += after - vn
    motion = (nx * after - ny * vt, ny * after + nx * vt, nx * un - ny * ut, ny * un + nx * ut, rwz)
    return motion, raised and rebound > 0.0


@kernel
def _hit_in_turn(motion, one, two, rebounds, radius, scene):
    """Returns the motion after impacts on the cushions with the normals `one` and `two` in turn; the rest as `hit`."""
    sine, raised = one[0] * two[1] - one[1] * two[0], False
    noise = NOISE * norm(motion[0], motion[1])
    for turn in range(_TURNS):
        share = (motion[0] * two[1] - motion[1] * two[0]) / sine
        if share > (-rebounds[0] if turn == 0 and rebounds[0] > 0.0 else noise):
            motion, acts = hit(motion, one, max(0.0, share), rebounds[0], radius, scene)
            raised = raised or acts
        share = (one[0] * motion[1] - one[1] * motion[0]) / sine
        if share > (-rebounds[1] if turn == 0 and rebounds[1] > 0.0 else noise):
            motion, acts = hit(motion, two, max(0.0, share), rebounds[1], radius, scene)
            raised = raised or acts
    return motion, raised


@inlined
def _product(a, b, rubs):
    """Returns the scalar product of two motions of a ball that gives 2 E / m for equal ones, m^2/s^2."""
    product = a[0] * b[0] + a[1] * b[1]
    if rubs:
        spins = (a[0] - a[2]) * (b[0] - b[2]) + (a[1] - a[3]) * (b[1] - b[3]) + a[4] * b[4]
        product += 0.4 * spins
    return product


@inlined
def _sum(weight, a, other, b):
    """Returns the sum of two weighted motions."""
    return (
        weight * a[0] + other * b[0],
        weight * a[1] + other * b[1],
        weight * a[2] + other * b[2],
        weight * a[3] + other * b[3],
        weight * a[4] + other * b[4],
    )


@kernel
def reflect_both(state, i, one, two, rebounds, scene):
    """Changes ball i's velocity, slip and spin at two cushions that it touches at one instant.

    With the normals n_1 and n_2 and the shares p_1 and p_2, the velocity is p_1 n_1 + p_2 n_2. The law of one cushion
    acts at each with the normal speed p, in turn, until no share is positive. The result is the mean of both orders.
    Without friction both orders give -e v, the generalised reflection of `physics.clusters`. If the normals are not
    perpendicular, friction may raise the energy. The mean then moves towards the plastic impact without friction, which
    stops the ball, until the energy does not rise.

    Args:
        state: The `State`.
        i: The ball.
        one: (nx, ny), the unit normal into a cushion.
        two: The same for the other cushion; v is between the two normals.
        rebounds: Least speeds away from the cushions after the impact, m/s, >= 0.
        scene: The `SceneArrays`.

    Returns:
        Whether the rebounds have raised a speed away from a cushion.
    """
    s, radius, rubs = state.rows[i], scene.radius[i], scene.numbers.cushion_rubs
    before = (s[VX], s[VY], s[UX], s[UY], radius * s[WZ])
    sine, cosine = one[0] * two[1] - one[1] * two[0], one[0] * two[0] + one[1] * two[1]
    first = max(0.0, rebounds[0] - cosine * rebounds[1]) / (sine * sine)
    second = max(0.0, rebounds[1] - cosine * rebounds[0]) / (sine * sine)
    a, raised = _hit_in_turn(before, one, two, (first, second), radius, scene)
    b, raised_too = _hit_in_turn(before, two, one, (second, first), radius, scene)
    after = _sum(0.5, a, 0.5, b)
    vx, vy = -(first * one[0] + second * two[0]), -(first * one[1] + second * two[1])
    plastic = (vx, vy, before[2] + (vx - before[0]), before[3] + (vy - before[1]), before[4])
    least = _product(plastic, plastic, rubs)
    spare = max(_product(before, before, rubs) - least, 0.0)
    if _product(after, after, rubs) - least > spare:
        way = _sum(1.0, after, -1.0, plastic)
        slope, square = _product(plastic, way, rubs), _product(way, way, rubs)
        after = _sum(1.0, plastic, (math.sqrt(slope * slope + square * spare) - slope) / square, way)
    s[VX], s[VY] = after[0], after[1]
    if rubs or scene.numbers.motion == SLIDING_AND_ROLLING:
        s[UX], s[UY] = after[2], after[3]
    if rubs:
        s[WZ] = after[4] / radius
    return raised or raised_too
