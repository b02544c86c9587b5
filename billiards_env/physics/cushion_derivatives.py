"""The derivatives of the laws of `physics.cushion`."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from billiards_env.jit import inlined, kernel
from billiards_env.physics.compliance import begin_stick, end_stick, release_phase
from billiards_env.physics.cushion import LAWS, by_law, cushion_restitution, han2005, mathavan2010, stronge
from billiards_env.physics.elementary import arccosine, sine_cosine
from billiards_env.physics.lanes import (
    D_CUSHION_FREQUENCY_RATIO,
    D_E_CUSHION,
    D_E_CUSHION_FLOOR,
    D_E_CUSHION_LOSS,
    D_E_CUSHION_ONSET,
    D_MU_CLOTH,
    D_MU_CUSHION,
)
from billiards_env.physics.mathavan import CushionNose
from billiards_env.physics.mathavan_derivatives import impact_change

TABLE = (5, 9)
"""Shape of the table of a "mathavan2010" impact: the results and the arguments of `mathavan.integrate_impact`."""


class CushionChange(NamedTuple):
    """A change of what an impact on a cushion depends on.

    Attributes:
        vn: As in `cushion.CushionMotion`, like the next four.
        vt: See there.
        un: See there.
        ut: See there.
        rwz: See there.
        radius: m.
        lane: The lane with the numbers of the scene.
    """

    vn: Any
    vt: Any
    un: Any
    ut: Any
    rwz: Any
    radius: Any
    lane: Any


class Friction(NamedTuple):
    """The friction at the nose of a cushion, per mass, as a function of its arguments, and its derivatives.

    Attributes:
        size: m/s.
        by_slip: Derivative with respect to the size of the slip.
        by_normal: The same for the normal impulse.
        by_grip: The same for the normal velocity times the coefficient of friction.
        by_mu: The same for the coefficient of friction, m/s.
        by_e: The same for the restitution, m/s.
        by_ratio: The same for the frequency ratio, m/s.
    """

    size: Any
    by_slip: Any
    by_normal: Any
    by_grip: Any
    by_mu: Any
    by_e: Any
    by_ratio: Any


class CushionLaw(NamedTuple):
    """The coefficients of the derivative of an impact on a cushion.

    Attributes:
        rubs: Whether the cushion has friction.
        vn: Normal velocity, m/s.
        e: Restitution.
        e_kind: 0 for the restitution of low speeds, 1 if it falls with the speed, 2 at its least value.
        e_cushion_loss: As in `state.Numbers`.
        over: Speed above the onset of this fall, m/s.
        mu: Coefficient of friction.
        sin: Of the angle of the nose above the centre.
        cos: Its cosine.
        sin_rate: Derivative of `sin` with respect to the radius, 1/m.
        rwz: Spin about the vertical axis times the radius, m/s.
        rwn: Spin about the normal times the radius, m/s.
        x: Direction of the slip along the tangent that points up.
        y: The same along t.
        slip: Size of the slip, m/s.
        normal: Normal impulse, per mass, m/s.
        friction: The `Friction`.
        stops: Whether the ball does not leave the cushion by itself.
        squeezes: Whether the normal impulse is then raised.
    """

    rubs: Any
    vn: Any
    e: Any
    e_kind: Any
    e_cushion_loss: Any
    over: Any
    mu: Any
    sin: Any
    cos: Any
    sin_rate: Any
    rwz: Any
    rwn: Any
    x: Any
    y: Any
    slip: Any
    normal: Any
    friction: Any
    stops: Any
    squeezes: Any


@inlined
def cushion_law(motion, radius, table, scene):
    """Returns the `CushionLaw` of an impact.

    Args:
        motion: The `CushionMotion` before it.
        radius: m.
        table: Array of the shape `TABLE`, which this function fills for "mathavan2010" cushions.
        scene: The `SceneArrays`.
    """
    numbers, vn = scene.numbers, motion.vn
    e, over = cushion_restitution(vn, numbers), vn - numbers.e_cushion_onset
    e_kind = 0
    if over > 0.0 and e > numbers.e_cushion_floor:
        e_kind = 1
    elif over > 0.0 and numbers.e_cushion_loss > 0.0:
        e_kind = 2
    sin = numbers.cushion_height / radius - 1.0 if numbers.cushion_rubs else 0.0
    cos = math.sqrt(1.0 - sin * sin)
    rwn = motion.ut - motion.vt
    sx, sy = vn * sin + (vn - motion.un), -motion.vt - motion.rwz * cos + rwn * sin
    slip = math.sqrt(sx * sx + sy * sy)
    x, y = (sx / slip, sy / slip) if slip > 0.0 else (0.0, 0.0)
    normal = (1.0 + e) * vn * cos
    friction = _friction(scene.cushion, (motion, slip, sin, cos, e, table, numbers))
    stops = vn - friction.size * x * sin - normal * cos > 0.0
    squeezes = False
    if stops:
        normal, friction, squeezes = _squeeze(scene.cushion, (normal, friction, vn, slip, x, sin, cos, numbers))
    return CushionLaw(
        numbers.cushion_rubs != 0,
        vn,
        e,
        e_kind,
        numbers.e_cushion_loss,
        over,
        numbers.mu_cushion,
        sin,
        cos,
        -numbers.cushion_height / (radius * radius),
        motion.rwz,
        rwn,
        x,
        y,
        slip,
        normal,
        friction,
        stops,
        squeezes,
    )


@inlined
def _rigid_friction(motion, slip, sin, cos, e, table, numbers):
    mu, normal = numbers.mu_cushion, (1.0 + e) * motion.vn * cos
    if slip * (2.0 / 7.0) <= mu * normal and mu > 0.0:
        return Friction(slip * (2.0 / 7.0), 2.0 / 7.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    return Friction(mu * normal, 0.0, mu, 0.0, normal, 0.0, 0.0)


@kernel
def _compliant_friction(motion, slip, sin, cos, e, table, numbers):
    """Returns the `Friction` of `compliance.friction_impulse`."""
    omega, per_mu = numbers.cushion_frequency_ratio, motion.vn * cos
    grip = numbers.mu_cushion * per_mu
    h = 3.5 / (omega * omega)
    if slip >= grip * ((1.0 + e) * 3.5 - h / e):
        return Friction((1.0 + e) * grip, 0.0, 0.0, 1.0 + e, (1.0 + e) * per_mu, grip, 0.0)
    x = slip / grip
    after, by_x, by_e, by_omega = _compliant_velocity(x, e, omega)
    by_grip = (after - x * by_x) / 3.5
    return Friction(
        (x + after) * grip / 3.5,
        (1.0 + by_x) / 3.5,
        0.0,
        by_grip,
        by_grip * per_mu,
        grip * by_e / 3.5,
        grip * by_omega / 3.5,
    )


@kernel
def _compliant_velocity(x, e, omega):
    """Returns the tangential velocity after a compliant impact with a stick, and its derivatives by x, e and omega.

    See `physics.compliance`. The velocity does not depend on the end of the stick in first order, so that time counts
    as constant.
    """
    beta, h = 3.5, 3.5 / (omega * omega)
    start, stretch, velocity = begin_stick(x, e, omega)
    t = end_stick(start, stretch, velocity, e, omega)
    sin, cos = sine_cosine(omega * (t - start))
    sin_n, cos_n = sine_cosine(release_phase(t, e))
    # One more Newton step: the derivatives need more digits of the time than the velocity.
    t -= (velocity * sin / omega - stretch * cos - h * sin_n) / (velocity * cos + stretch * omega * sin - h * cos_n / e)
    sin, cos = sine_cosine(omega * (t - start))
    sin_n, cos_n = sine_cosine(release_phase(t, e))
    by_x, by_e, by_omega = 0.0, 0.0, 0.0
    for k in range(3):
        dx, de, d_omega = 1.0 if k == 0 else 0.0, 1.0 if k == 1 else 0.0, 1.0 if k == 2 else 0.0
        dh = -2.0 * h / omega * d_omega
        d_stretch, d_velocity, d_start = 0.0, -dx, 0.0
        if h <= x <= beta:
            c = (x - beta) / (h - beta)
            dc, s = (dx - c * dh) / (h - beta), math.sqrt(1.0 - c * c)
            if s > 0.0:
                d_stretch, d_velocity, d_start = dh * s - h * c / s * dc, -beta * dc - dx, -dc / s
        elif x > beta:
            span = h / e - beta * e
            c = (x - beta) / span
            dc, s = (dx - c * ((dh - h / e * de) / e - beta * de)) / span, math.sqrt(1.0 - c * c)
            d_stretch, d_velocity = dh * s - h * c / s * dc, -beta * (c * de + e * dc) - dx
            d_start = (arccosine(c) - 0.5 * math.pi) * de - e * dc / s
        d_angle = d_omega * (t - start) - omega * d_start
        slope = stretch * sin * d_omega + omega * sin * d_stretch + cos * d_velocity
        slope += (omega * stretch * cos - velocity * sin) * d_angle
        slope -= beta * (1.0 + cos_n + sin_n * (t - 0.5 * math.pi) / e) * de
        if k == 0:
            by_x = slope
        elif k == 1:
            by_e = slope
        else:
            by_omega = slope
    return omega * stretch * sin + velocity * cos - beta * e * (1.0 + cos_n), by_x, by_e, by_omega


@inlined
def cushion_lane(change, law, table, scene):
    """Returns the change (vn, vt, un, ut, rwz) of the motion after an impact for a `CushionChange` before it."""
    return _lane(scene.cushion, (change, _restitution_change(change, law), law, table))


@inlined
def _restitution_change(change, law):
    if law.e_kind == 2:
        return change.lane[D_E_CUSHION_FLOOR]
    if law.e_kind == 1:
        return (
            change.lane[D_E_CUSHION]
            - law.over * change.lane[D_E_CUSHION_LOSS]
            - law.e_cushion_loss * (change.vn - change.lane[D_E_CUSHION_ONSET])
        )
    return change.lane[D_E_CUSHION]


@inlined
def _friction_lane(change, d_e, law, table):
    """Implements `cushion_lane` with the `Friction` of the law."""
    dvn, dvt, dun, dut, drwz = change.vn, change.vt, change.un, change.ut, change.rwz
    if not law.rubs:
        back = -law.e * dvn - law.vn * d_e
        return back, dvt, dun + (back - dvn), dut, drwz
    sin, cos, x, y, friction = law.sin, law.cos, law.x, law.y, law.friction
    d_sin = law.sin_rate * change.radius
    d_cos = -sin / cos * d_sin
    dsx = dvn * sin + law.vn * d_sin + (dvn - dun)
    dsy = -dvt - drwz * cos - law.rwz * d_cos + (dut - dvt) * sin + law.rwn * d_sin
    d_slip = x * dsx + y * dsy
    per_slip = friction.size / law.slip if law.slip > 0.0 else friction.by_slip
    d_normal = (d_e * law.vn + (1.0 + law.e) * dvn) * cos + (1.0 + law.e) * law.vn * d_cos
    if law.squeezes:  # the normal impulse stops the ball
        if friction.by_slip > 0.0:
            part = (2.0 / 7.0) * (dsx * sin + x * law.slip * d_sin)
            d_normal = (dvn - part - law.normal * d_cos) / cos
        else:
            turn = y * (y * dsx - x * dsy) / law.slip
            resistance = cos + law.mu * sin * x
            more = d_cos + (change.lane[D_MU_CUSHION] * sin + law.mu * d_sin) * x + law.mu * sin * turn
            d_normal = (dvn - law.normal * more) / resistance
    d_size = friction.by_slip * d_slip + friction.by_normal * d_normal + friction.by_mu * change.lane[D_MU_CUSHION]
    d_size += friction.by_grip * law.mu * (dvn * cos + law.vn * d_cos)
    d_size += friction.by_e * d_e + friction.by_ratio * change.lane[D_CUSHION_FREQUENCY_RATIO]
    pxe, pye = friction.size * x, friction.size * y
    d_pxe, d_pye = x * d_size + per_slip * (dsx - x * d_slip), y * d_size + per_slip * (dsy - y * d_slip)
    px, d_px = -law.vn, -dvn
    if not law.squeezes:
        px = -pxe * sin - law.normal * cos
        d_px = -d_pxe * sin - pxe * d_sin - d_normal * cos - law.normal * d_cos
    pz = pxe * cos - law.normal * sin
    d_pz = d_pxe * cos + pxe * d_cos - d_normal * sin - law.normal * d_sin
    vn_after, vt_after = 0.0 if law.stops else dvn + d_px, dvt + d_pye
    rwn = (dut - dvt) - 2.5 * (d_pye * sin + pye * d_sin)
    rwt = (dvn - dun) + 2.5 * (d_px * sin + px * d_sin - d_pz * cos - pz * d_cos)
    return vn_after, vt_after, vn_after - rwt, vt_after + rwn, drwz + 2.5 * (d_pye * cos + pye * d_cos)


@inlined
def _mathavan_arguments(motion, sin, cos, numbers):
    """Returns the first arguments of `mathavan.integrate_impact`, as a tuple, and the `CushionNose`."""
    vn, vt, un, ut, rwz = motion
    return (-vt, vn, un - vn, ut - vt, rwz), CushionNose(sin, cos, numbers.mu_cushion, numbers.mu_cloth)


@kernel
def _tabulated_friction(motion, slip, sin, cos, e, table, numbers):
    """Writes the derivative of `mathavan.integrate_impact` to `table` and returns a `Friction` of zeros.

    Its rows are the results of that function; its columns are the motion, `sin`, the two coefficients of friction and
    the restitution.
    """
    before, nose = _mathavan_arguments(motion, sin, cos, numbers)
    for c in range(9):
        by = (
            -1.0 if c == 1 else 0.0,
            1.0 if c == 0 else 0.0,
            -1.0 if c == 0 else (1.0 if c == 2 else 0.0),
            -1.0 if c == 1 else (1.0 if c == 3 else 0.0),
            1.0 if c == 4 else 0.0,
        )
        d_sin, d_cos = (1.0, -sin / cos) if c == 5 else (0.0, 0.0)
        by_nose = CushionNose(d_sin, d_cos, 1.0 if c == 6 else 0.0, 1.0 if c == 7 else 0.0)
        column, _ = impact_change(before, by, nose, by_nose, e, 1.0 if c == 8 else 0.0)
        for r in range(5):
            table[r, c] = column[r]
    return Friction(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@inlined
def _table_lane(change, d_e, law, table):
    """Implements `cushion_lane` with the table of `_tabulated_friction`."""
    before = (
        change.vn,
        change.vt,
        change.un,
        change.ut,
        change.rwz,
        law.sin_rate * change.radius,
        change.lane[D_MU_CUSHION],
        change.lane[D_MU_CLOTH],
        d_e,
    )
    vx = vy = rwx = rwy = rwz = 0.0
    for c in range(9):
        vx += table[0, c] * before[c]
        vy += table[1, c] * before[c]
        rwx += table[2, c] * before[c]
        rwy += table[3, c] * before[c]
        rwz += table[4, c] * before[c]
    return vy, -vx, vy + rwx, rwy - vx, rwz


@inlined
def _always_smooth(motion, radius, numbers):
    return True


@kernel
def _is_smooth_mathavan(motion, radius, numbers):
    sin = numbers.cushion_height / radius - 1.0
    before, nose = _mathavan_arguments(motion, sin, math.sqrt(1.0 - sin * sin), numbers)
    nothing = (0.0, 0.0, 0.0, 0.0, 0.0)
    still = CushionNose(0.0, 0.0, 0.0, 0.0)
    return impact_change(before, nothing, nose, still, cushion_restitution(motion.vn, numbers), 0.0)[1]


@inlined
def cushion_is_smooth(motion, radius, scene):
    """Returns whether the law of the cushions has a derivative at a `CushionMotion`."""
    return _is_smooth(scene.cushion, (motion, radius, scene.numbers))


@inlined
def _rigid_squeeze(normal, friction, vn, slip, x, sin, cos, numbers):
    """Returns the normal impulse per mass that stops the ball, the `Friction`, and True; see `cushion.han2005`."""
    resistance = cos + numbers.mu_cushion * sin * x
    most = vn / resistance if resistance > 0.0 else math.inf
    if slip * (2.0 / 7.0) <= numbers.mu_cushion * most and numbers.mu_cushion > 0.0:
        normal = max(0.0, (vn - slip * (2.0 / 7.0) * x * sin) / cos)
        return normal, Friction(slip * (2.0 / 7.0), 2.0 / 7.0, 0.0, 0.0, 0.0, 0.0, 0.0), True
    return most, Friction(numbers.mu_cushion * most, 0.0, numbers.mu_cushion, 0.0, most, 0.0, 0.0), True


@inlined
def _no_squeeze(normal, friction, vn, slip, x, sin, cos, numbers):
    return normal, friction, False


class CushionDerivative(NamedTuple):
    """The kernels of the derivative of a law.

    Attributes:
        friction: Returns the `Friction`.
        squeeze: For a ball that would otherwise not leave the cushion, returns the normal impulse, the `Friction`, and
            whether the law raises them.
        lane: Implements `cushion_lane`; it also takes the change of the restitution.
        is_smooth: Implements `cushion_is_smooth`.
    """

    friction: Callable[..., Any]
    squeeze: Callable[..., Any] = _no_squeeze
    lane: Callable[..., Any] = _friction_lane
    is_smooth: Callable[..., Any] = _always_smooth


DERIVATIVES = {
    han2005: CushionDerivative(_rigid_friction, _rigid_squeeze),
    stronge: CushionDerivative(_compliant_friction),
    mathavan2010: CushionDerivative(_tabulated_friction, lane=_table_lane, is_smooth=_is_smooth_mathavan),
}
"""The derivatives, by law."""

_friction, _squeeze, _lane, _is_smooth = (
    by_law(*kernels) for kernels in zip(*(DERIVATIVES[law] for law in LAWS), strict=True)
)
