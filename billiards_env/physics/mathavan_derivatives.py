"""The derivative of the impact of `physics.mathavan` along one direction of change, and where it does not exist.

The change of the motion follows the linearised equation,
in the same steps. Where a slip stops, the rates jump: the change then gets the saltation term of
`physics.derivatives`. The change also shifts the impulse at which each phase ends.
"""

from __future__ import annotations

import math

from billiards_env.jit import inlined, kernel
from billiards_env.physics.mathavan import (
    _A2,
    _A3,
    _A4,
    _A5,
    _A6,
    _A7,
    _ERROR,
    TOLERANCE,
    _begin_slip,
    _clear_slips,
    _combine,
    _longest_step,
    _rates,
    _slips,
    _sticks,
)

_TOLERANCE = 1e-2 * TOLERANCE  # the change is less accurate than the motion where a slip turns
_MOST_STEPS = 10_000  # an impact has about 100; impacts with far more have a slip that stops and begins again
_TINY_E = 1e-5  # for a smaller restitution, the phase of restitution is shorter than its steps


@inlined
def _unit(x, y, dx, dy):
    """Returns the direction of the vector (x, y) and its change (x, y)."""
    size = math.sqrt(x * x + y * y)
    ex, ey = x / size, y / size
    turn = (ex * dy - ey * dx) / size
    return ex, ey, -turn * ey, turn * ex


@inlined
def _slip_changes(y, change, nose, more):
    """Returns the changes of `mathavan._slips` for changes of the motion and of the nose."""
    xi, yi, xc, yc = _slips(change, nose)
    return xi + y[3] * more.sin - y[4] * more.cos, yi - y[1] * more.sin, xc, yc


@inlined
def _begin_slip_change(ex, ey, d_ex, d_ey, nose, more):
    """Returns `mathavan._begin_slip` and its change, from the derivative of the equations that it solves."""
    (sin, cos, mu, mu_cloth), (d_sin, d_cos, d_mu, d_cloth) = nose, more
    x, y, lam = _begin_slip(ex, ey, nose)
    d, g, h = 1.0 - 2.5 * sin, 2.5 - sin, 2.5 + sin * sin
    fx, fy = mu_cloth * ex, mu_cloth * ey
    d_fx, d_fy = d_cloth * ex + mu_cloth * d_ex, d_cloth * ey + mu_cloth * d_ey
    d_rx = 2.5 * d_sin * fx * sin - d * (d_fx * sin + fx * d_sin)
    d_ry = d_sin * cos + sin * d_cos + d_sin * fy * sin - g * (d_fy * sin + fy * d_sin)
    mixed, across = d * fx * cos, h + g * fy * cos
    d_mixed = -2.5 * d_sin * fx * cos + d * (d_fx * cos + fx * d_cos)
    d_across = 2.0 * sin * d_sin - d_sin * fy * cos + g * (d_fy * cos + fy * d_cos)
    a, b = mu * across + lam, 3.5 * mu + lam
    p = d_ry - y * (d_mu * across + mu * d_across)
    q = d_rx - y * (d_mu * mixed + mu * d_mixed) - 3.5 * x * d_mu
    d_lam = (x * (q - mu * mixed * p / a) / b + y * p / a) / (x * (x - mu * mixed * y / a) / b + y * y / a)
    d_y = (p - y * d_lam) / a
    d_x = (q - x * d_lam - mu * mixed * d_y) / b
    return -mu * x, -mu * y, -d_mu * x - mu * d_x, -d_mu * y - mu * d_y


@kernel
def _rates_change(y, change, nose, more, tiny):
    """Returns `mathavan._rates` and its change. A slip of `tiny` is zero."""
    (sin, cos, mu, mu_cloth), (d_sin, d_cos, d_mu, d_cloth) = nose, more
    xi, yi, xc, yc = _slips(y, nose)
    d_xi, d_yi, d_xc, d_yc = _slip_changes(y, change, nose, more)
    d, g, h = 1.0 - 2.5 * sin, 2.5 - sin, 2.5 + sin * sin
    d_d, d_g, d_h = -2.5 * d_sin, -d_sin, 2.0 * sin * d_sin
    ex = ey = d_ex = d_ey = 0.0
    slides = math.sqrt(xc * xc + yc * yc) > tiny
    if slides:
        ex, ey, d_ex, d_ey = _unit(xc, yc, d_xc, d_yc)
    if math.sqrt(xi * xi + yi * yi) > tiny:
        ux, uy, d_ux, d_uy = _unit(xi, yi, d_xi, d_yi)
        ax, ay, d_ax, d_ay = -mu * ux, -mu * uy, -d_mu * ux - mu * d_ux, -d_mu * uy - mu * d_uy
    else:
        under = h - g * g / 3.5
        ax, ay, d_ax = 0.0, -(sin * cos + g * cos / 3.5) / under, 0.0
        d_ay = d_sin * cos + sin * d_cos + (d_g * cos + g * d_cos) / 3.5
        d_ay = -(d_ay + ay * (d_h - 2.0 * g * d_g / 3.5)) / under
        if not slides:
            by = (cos - g * ay) / 3.5
            if abs(by) > mu_cloth * (sin - ay * cos):
                ey = -1.0 if by > 0.0 else 1.0
        if slides or ey != 0.0:
            fy, d_fy = mu_cloth * ey, d_cloth * ey + mu_cloth * d_ey
            under = h + g * fy * cos
            ay = -(sin * cos - g * fy * sin) / under
            d_ay = d_sin * cos + sin * d_cos - (d_g * fy + g * d_fy) * sin - g * fy * d_sin
            d_ay = -(d_ay + ay * (d_h + (d_g * fy + g * d_fy) * cos + g * fy * d_cos)) / under
            press = sin - ay * cos
            d_press = d_sin - d_ay * cos - ay * d_cos
            if press < 0.0:  # the ball does not press on the cloth
                ay, d_ay = -sin * cos / h, (sin * cos * d_h / h - d_sin * cos - sin * d_cos) / h
                press = d_press = 0.0
            ax = mu_cloth * press * ex * d / 3.5
            d_ax = ((d_cloth * press + mu_cloth * d_press) * ex * d + mu_cloth * press * (d_ex * d + ex * d_d)) / 3.5
        if ax * ax + ay * ay > mu * mu:
            if ex != 0.0 or ey != 0.0:
                ax, ay, d_ax, d_ay = _begin_slip_change(ex, ey, d_ex, d_ey, nose, more)
                if ay * cos > sin:
                    ax, ay, d_ax, d_ay = _begin_slip_change(0.0, 0.0, 0.0, 0.0, nose, more)
            else:
                ux, uy, d_ux, d_uy = _unit(ax, ay, d_ax, d_ay)
                ax, ay, d_ax, d_ay = mu * ux, mu * uy, d_mu * ux + mu * d_ux, d_mu * uy + mu * d_uy
    press, d_press = 0.0, 0.0
    if sin - ay * cos > 0.0:
        press = mu_cloth * (sin - ay * cos)
        d_press = d_cloth * (sin - ay * cos) + mu_cloth * (d_sin - d_ay * cos - ay * d_cos)
    if slides:
        bx, by, d_bx, d_by = -press * ex, -press * ey, -d_press * ex - press * d_ex, -d_press * ey - press * d_ey
    else:
        bx, d_bx = -ax * d / 3.5, -(d_ax * d + ax * d_d) / 3.5
        by, d_by = (cos - g * ay) / 3.5, (d_cos - d_g * ay - g * d_ay) / 3.5
        if bx * bx + by * by > press * press:
            ux, uy, d_ux, d_uy = _unit(bx, by, d_bx, d_by)
            bx, by = press * ux, press * uy
            d_bx, d_by = d_press * ux + press * d_ux, d_press * uy + press * d_uy
    rate = (ax + bx, by - cos - sin * ay, 2.5 * (ay + by), 2.5 * (ax * sin - bx), -2.5 * ax * cos, y[1] * cos)
    rate_change = (
        d_ax + d_bx,
        d_by - d_cos - d_sin * ay - sin * d_ay,
        2.5 * (d_ay + d_by),
        2.5 * (d_ax * sin + ax * d_sin - d_bx),
        -2.5 * (d_ax * cos + ax * d_cos),
        change[1] * cos + y[1] * d_cos,
    )
    return rate, rate_change


@inlined
def _stage(y, change, h, rates, weights, nose, more, tiny):
    """Returns the rates and their change within a step, after (rates, changes of them)."""
    k, c = rates
    return _rates_change(_combine(y, h, k, weights), _combine(change, h, c, weights), nose, more, tiny)


@kernel
def _step_change(y, change, h, nose, more, tiny):
    """Returns (y after a step h, its change, the error of the velocities)."""
    k1, c1 = _rates_change(y, change, nose, more, tiny)
    k2, c2 = _stage(y, change, h, ((k1,), (c1,)), _A2, nose, more, tiny)
    k3, c3 = _stage(y, change, h, ((k1, k2), (c1, c2)), _A3, nose, more, tiny)
    k4, c4 = _stage(y, change, h, ((k1, k2, k3), (c1, c2, c3)), _A4, nose, more, tiny)
    k5, c5 = _stage(y, change, h, ((k1, k2, k3, k4), (c1, c2, c3, c4)), _A5, nose, more, tiny)
    k6, c6 = _stage(y, change, h, ((k1, k2, k3, k4, k5), (c1, c2, c3, c4, c5)), _A6, nose, more, tiny)
    k = (k1, k2, k3, k4, k5, k6)
    after = _combine(y, h, k, _A7)
    zero = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    off = _combine(zero, h, (*k, _rates(after, nose, tiny)), _ERROR)
    error = max(max(abs(off[0]), abs(off[1])), max(max(abs(off[2]), abs(off[3])), abs(off[4])))
    return after, _combine(change, h, (c1, c2, c3, c4, c5, c6), _A7), error


@inlined
def _sizes(y, nose):
    """Returns the sizes of the slips at the cushion and at the cloth."""
    xi, yi, xc, yc = _slips(y, nose)
    return math.sqrt(xi * xi + yi * yi), math.sqrt(xc * xc + yc * yc)


@inlined
def _moved(change, dt, rate):
    """Returns a change after a change dt of the impulse, at a rate."""
    a, b, c, d, e, f = change
    return (
        a + dt * rate[0],
        b + dt * rate[1],
        c + dt * rate[2],
        d + dt * rate[3],
        e + dt * rate[4],
        f + dt * rate[5],
    )


@inlined
def _clear_slip_changes(y, change, nose, more, tiny):
    """Returns the change of `mathavan._clear_slips`."""
    vx, vy, rwx, rwy, rwz, work = change
    at_nose, at_cloth = _sizes(y, nose)
    if at_cloth < tiny:
        rwx, rwy = -vy, vx
    elif at_nose < tiny:
        rwx = vy * nose.sin + y[1] * more.sin
    if at_nose < tiny:
        rwz = (vx + rwy * nose.sin + y[3] * more.sin - y[4] * more.cos) / nose.cos
    return vx, vy, rwx, rwy, rwz, work


@kernel
def _stop_slip(y, after, change, after_change, nose, more, tiny):
    """Returns the motion and its change after a step in which a slip may have stopped, and whether it stays so.

    The slip of `tiny` that stops turns within the step, so the change is that before the step.

    Args:
        y: The motion before the step.
        after: The motion after it.
        change: The change before it.
        after_change: The change after it.
        nose: The `CushionNose`.
        more: Its change.
        tiny: The slip that is zero, m/s.
    """
    was, now = _sizes(y, nose), _sizes(after, nose)
    at_nose, at_cloth = now[0] < tiny <= was[0], now[1] < tiny <= was[1]
    cleared, stays = _clear_slips(after, nose, tiny), True
    if at_nose or at_cloth:
        last, rate = _rates(y, nose, tiny), _rates(cleared, nose, tiny)
        slips, falls, keeps = _slip_changes(y, change, nose, more), _slips(last, nose), _slips(rate, nose)
        k = 0 if at_nose else 2
        size = falls[k] * falls[k] + falls[k + 1] * falls[k + 1]
        dt = -(slips[k] * falls[k] + slips[k + 1] * falls[k + 1]) / size
        stays = not (at_nose and at_cloth) and keeps[k] * keeps[k] + keeps[k + 1] * keeps[k + 1] < 1e-12 * size
        after_change = _moved(_moved(change, dt, last), -dt, rate)
    return cleared, _clear_slip_changes(after, after_change, nose, more, tiny), stays


@inlined
def _stable_step(y, nose, tiny):
    """Returns the longest stable step: longer ones alone make the change of a slip's direction grow."""
    at_nose, at_cloth = _sizes(y, nose)
    longest = 2.0 * at_nose / (3.5 * nose.mu) if at_nose > tiny and nose.mu > 0.0 else math.inf
    if at_cloth > tiny:
        longest = min(longest, 2.0 * at_cloth / (3.5 * nose.mu_cloth * (1.0 + nose.mu)))
    return longest


@kernel
def impact_change(before, change, nose, more, e, d_e):
    """Returns the change of `mathavan.integrate_impact` for a change of its arguments.

    Args:
        before: (vx, vy, rwx, rwy, rwz) before the impact.
        change: Its change.
        nose: The `CushionNose`.
        more: Its change, a `CushionNose`.
        e: Restitution.
        d_e: Its change.

    Returns:
        (vx, vy, rwx, rwy, rwz), and whether the derivative exists: the cushion slips at first, and a slip that stops
        does not begin again at once.
    """
    y, change, vy = (*before, 0.0), (*change, 0.0), before[1]
    most = _TOLERANCE * vy + 1e-15 * (abs(before[0]) + abs(before[2]) + abs(before[3]) + abs(before[4]))
    tiny = 100.0 * most
    compresses, work, d_work, h = True, 0.0, 0.0, 0.1 * vy
    at_nose, at_cloth = _sizes(y, nose)
    exists = at_nose >= tiny and (at_cloth == 0.0 or at_cloth >= tiny)
    if vy <= 0.0:
        return change[:5], exists
    for _ in range(_MOST_STEPS):
        rate = _rates(y, nose, tiny)
        h = min(h, min(0.125 * _longest_step(y, rate, nose, tiny), _stable_step(y, nose, tiny)))
        after, after_change, error = _step_change(y, change, h, nose, more, tiny)
        if error > most and h > most:
            h *= max(0.1, 0.9 * math.sqrt(math.sqrt(most / error)))
            continue
        left, left_after = (y[1], after[1]) if compresses else (y[5] + e * e * work, after[5] + e * e * work)
        close = 1e-13 * vy if compresses else 1e-11 * e * e * work
        if left_after < -close and h > 0.0:
            h *= max(0.1, left / (left - left_after))
            continue
        y, change, stays = _stop_slip(y, after, change, after_change, nose, more, tiny)
        exists = exists and stays
        if left_after > close and _sticks(y, nose, tiny) and _rates(y, nose, tiny)[1] > -1e-12:
            return (change[0], 0.0, change[2], change[3], change[4]), False  # the cushion and the slate hold the ball
        if left_after <= close:
            rate = _rates(y, nose, tiny)
            if not compresses:
                change = _moved(change, (-2.0 * e * d_e * work - e * e * d_work - change[5]) / rate[5], rate)
                return change[:5], exists
            compresses, work, d_work = False, y[5], change[5]
            change = _moved(change, -change[1] / rate[1], rate)
            if e < _TINY_E:
                change = _moved(change, d_e * math.sqrt(-2.0 * work / (nose.cos * rate[1])), rate)
                return change[:5], exists
            y, change = (y[0], 0.0, y[2], y[3], y[4], 0.0), (change[0], 0.0, change[2], change[3], change[4], 0.0)
        h *= min(4.0, 0.9 * math.sqrt(math.sqrt(most / max(error, 1e-3 * most))))
    return change[:5], False
