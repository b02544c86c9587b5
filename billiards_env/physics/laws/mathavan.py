"""The impact on a cushion by Mathavan, Jackson and Parkin (2010), with friction at the cushion and at the cloth.

S. Mathavan, M. R. Jackson and R. M. Parkin (2010), A theoretical analysis of billiard ball dynamics under cushion
impacts, Proc. IMechE Part C 224. The cushion pushes the ball down on the slate, which pushes back. The velocities are
functions of the normal impulse P. They follow an ordinary differential equation, because the slips at both contacts
turn while friction acts. Compression ends when the normal velocity is zero, and restitution ends when the cushion has
returned e^2 of the work of compression.

A contact without slip sticks if friction suffices. Otherwise it begins to slip, against the friction that would be
necessary. The cloth exerts no force while the ball does not press on it, which happens if the nose is below the centre
of the ball. If both contacts stick when neither slips, the cushion and the slate hold the ball, and the impact ends.

With much friction on the cloth (`mu_cloth` about 1 or more), the forces that hold a nose without slip may be infinite
or push the ball away from the slate: Painleve's paradox (A. R. Champneys and P. L. Varkonyi 2016, The Painleve paradox
in contact mechanics, arXiv:1601.03545). Then the equation has no solution, or several. The nose then slips, as it does
if the force is finite but larger than friction. So the result is the limit of that for less friction.

The solution is a sequence of Taylor series of order `ORDER`, whose coefficients follow from recurrences (Moore 1966,
Interval Analysis, chapter 11). Let rho and sigma be the sizes of the slips at the cushion and at the cloth. The
series are in P if the contact at the cushion does not slip. If it slips, they are in tau with dP = rho dtau. If the
contact at the cloth slips too and its slip falls or turns fast, dP = rho sigma / (rho_0 + sigma_0) dtau, with the sizes
rho_0 and sigma_0 at the start of the step. The slips in dP set the pace: if one stops, it decays exponentially in tau.
Slips that begin are t u(t), or t^2 u(t) at the end of a stick, where t is P or tau. A step ends where the last term of
a series is 1e-16 of the slips. It also ends where a contact begins to slip, the ball leaves the cloth or a phase ends.
Each of these times is a root of a polynomial.

Near the limit of sticking, a slip creeps: in tau, it needs hundreds of steps to stop, or to grow again. Its direction e
then depends only on the other slip, because the part of e that depends on the past has decayed: the motion is on a slow
manifold. There, e and the size r of the slip are regular series in P, even where r is zero. If F - K e is the rate of
the slip, then r' e = F - K e - r e'. Order k of e depends on r times order k + 1 of e. Since r is small, repeated
sweeps over the orders converge.

The axes are x along the cushion, y into it and z up. Impulses are per mass; spins are times the radius. Below, (x, y)
is the slip at the cushion and (u, v) that at the cloth, all velocities are over the normal velocity before the impact,
and `d`, `g` and `h` are the changes of slips by unit impulses: a unit impulse along x at one contact changes the slip
at the other by d, one along y by g, and one along y at the cushion that there by h.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from billiards_env.jit import inlined, kernel, room_for

ORDER = 20
room = room_for(19, ORDER + 3)

_TERM = 1e-16  # the size of the last terms over the slips
_USUAL = 16.0  # the largest ratio of the term before the last to it; otherwise the last is small by chance
_STOPPED = 2e-14  # slip over the normal velocity below which a slip has stopped
_NO_PRESS = 1e-9  # at a smaller press over `mu_cloth`, the last event decides whether the ball is on the cloth
_SMALL = 0.01  # a restitution below which the end of the compression ends a step, for the digits of the work left
_MOST_STEPS = 400  # a limit for safety; an impact has about 10
_PATIENCE = 300  # the number of steps after which `_STOPPED` doubles in each step, so that two small slips stop
_TURNS = 0.1  # the largest angle by which the slip at the cloth turns in dP = rho if the other slip sets the pace
_GROWS = 10.0  # the largest growth of this slip over itself in dP = rho; otherwise both slips set the pace
_USUAL_STEPS = 100  # the number of steps after which a small slip is tested for creeping
_CREEP = 0.02  # the largest slip that creeps, over the other slip
_SWEEPS = 24  # the number of sweeps for a slip that creeps
_SLIPS, _BEGINS, _CREEPS, _STICKS, _STOPS, _RELEASED = range(6)  # the states of a contact
# What ends a step: nothing, a contact that is released, a slip that stops, a change of the press, the end of a phase.
_NOTHING, _NOSE, _CLOTH, _NOSE_STOPS, _CLOTH_STOPS, _LIFT, _COMPRESSED, _RESTORED = range(8)


class CushionNose(NamedTuple):
    """The nose of a cushion, by its angle above the ball's centre, and the coefficients of friction.

    Attributes:
        sin: Sine of the angle.
        cos: Its cosine.
        mu: Friction at the cushion.
        mu_cloth: Friction at the cloth.
    """

    sin: Any
    cos: Any
    mu: Any
    mu_cloth: Any


@kernel
def polynomial(row, t):
    """Returns the value of a polynomial of order `ORDER` at t, and its slope."""
    value, slope = row[ORDER], 0.0
    for k in range(ORDER - 1, -1, -1):
        slope = slope * t + value
        value = value * t + row[k]
    return value, slope


@kernel
def bracketed_root(row, low, high):
    """Returns where a polynomial falls below zero in [low, high], by Newton's method within it; `high` if nowhere."""
    t, (value, slope) = high, polynomial(row, high)
    if value > 0.0:
        return high
    for _ in range(60):
        last, t = t, t - value / slope
        if not low <= t <= high:
            t = 0.5 * (low + high)
        if abs(t - last) <= 4e-16 * t:
            break
        value, slope = polynomial(row, t)
        if value > 0.0:
            low = t
        else:
            high = t
    return t


@kernel
def _fall(row, low, high):
    """Returns the result of `bracketed_root`, after one more step of Newton's method, which has its derivative."""
    t = bracketed_root(row, low, high)
    if t >= high:
        return high
    value, slope = polynomial(row, t)
    return min(high, max(low, t - value / slope)) if slope < 0.0 else t


@inlined
def _root_of(x):
    """Returns almost the 20th root."""
    for _ in range(5):
        x = math.sqrt(x)
    root = math.sqrt(math.sqrt(math.sqrt(math.sqrt(math.sqrt(x)))))
    return x * math.sqrt(x) * root * math.sqrt(root)


@inlined
def _first(row, low, t, end, event):
    """Returns the result of `_fall` and the event, or if the polynomial does not fall, t and `end`."""
    root = _fall(row, low, t)
    return (root, event) if root < t else (t, end)


@kernel
def step_length(c, by_nose, by_cloth):
    """Returns the length of a step: its last term is about `_TERM`. In P, a slip that falls keeps a quarter.

    It is zero if the series overflows.
    """
    x, y, u, v, work = c[0], c[1], c[2], c[3], c[5]
    rho, sigma = math.sqrt(x[0] * x[0] + y[0] * y[0]), math.sqrt(u[0] * u[0] + v[0] * v[0])
    largest = rho + sigma if rho + sigma > 0.0 else 1.0
    length, last, before = 1e3 * largest, abs(work[ORDER]) / largest, abs(work[ORDER - 1]) / largest
    if by_nose == _SLIPS and by_cloth == _SLIPS:
        length *= 1.0 / rho + 1.0 / sigma
    else:
        if by_nose == _SLIPS:
            length *= 1.0 / rho
        for state, row, other, size in ((by_nose, x, y, c[7]), (by_cloth, u, v, c[8])):
            k = 0 if state == _SLIPS else (1 if size[1] > 0.0 else 2)  # the first term
            in_tau = state == _SLIPS and by_nose == _SLIPS
            if state != _CREEPS and not in_tau and size[k + 1] < 0.0 < size[k]:
                fall = math.sqrt(row[k + 1] * row[k + 1] + other[k + 1] * other[k + 1])
                length = min(length, 0.75 * size[k] / fall)
    for row in (x, y, u, v):
        last, before = last + abs(row[ORDER]), before + abs(row[ORDER - 1])
    if not last + before < math.inf:
        return 0.0
    last = max(last, 1e-20 * before)  # the last terms of functions without even powers are 0
    if last > 0.0:
        longest = _root_of(_TERM * largest / last)
        length = min(length, longest * _root_of(min(1.0, _USUAL * last * longest / before)))
    return length


@kernel
def _slip_both(c, nose):  # out: c
    """Writes the series in tau of (x, y, u, v, vx, work, vy, rho, sigma) from c[:6, 0], and returns `step_length`."""
    sin, cos, mu, mu_cloth = nose
    x, y, u, v, vx, work, vy, rho, sigma = c[0], c[1], c[2], c[3], c[4], c[5], c[6], c[7], c[8]
    pace, press = c[9], c[10]  # rho sigma, and sigma times the friction on the cloth
    d, g, h = 1.0 - 2.5 * sin, 2.5 - sin, 2.5 + sin * sin
    by_rho, by_y, lift, by_slip = mu_cloth * sin, mu_cloth * mu * cos, sin * cos, 1.0 / (1.0 + sin)
    x0, y0, u0, v0 = x[0], y[0], u[0], v[0]
    r0, s0 = math.sqrt(x0 * x0 + y0 * y0), math.sqrt(u0 * u0 + v0 * v0)
    of_rho, of_sigma, of_both, p0 = 1.0 / r0, 1.0 / s0, 1.0 / (r0 + s0), by_rho * r0 + by_y * y0
    rho[0], sigma[0], press[0], pace[0], vy[0] = r0, s0, p0, r0 * s0, (v0 - y0) * by_slip
    for k in range(ORDER):
        if k == 0:
            ax, ay, bx, by, z, power = x0 * s0, y0 * s0, u0 * p0, v0 * p0, r0 * s0, pace[0] * vy[0]
        else:
            a = b = ax = ay = bx = by = z = power = 0.0
            for j in range(1, k):
                i = k - j
                xj, yj, rj, pj, si, ui, vi = x[j], y[j], rho[j], press[j], sigma[i], u[i], v[i]
                a, b = a + (xj * x[i] + yj * y[i] - rj * rho[i]), b + (ui * u[j] + vi * v[j] - si * sigma[j])
                ax, ay, bx, by = ax + xj * si, ay + yj * si, bx + pj * ui, by + pj * vi
                z, power = z + rj * si, power + pace[j] * vy[i]
            xk, yk, uk, vk = x[k], y[k], u[k], v[k]
            rk, sk = (0.5 * a + x0 * xk + y0 * yk) * of_rho, (0.5 * b + u0 * uk + v0 * vk) * of_sigma
            pk, z = by_rho * rk + by_y * yk, z + (r0 * sk + rk * s0)
            rho[k], sigma[k], press[k], pace[k], vy[k] = rk, sk, pk, z, (vk - yk) * by_slip
            ax, ay = ax + (x0 * sk + xk * s0), ay + (y0 * sk + yk * s0)
            bx, by = bx + (p0 * uk + pk * u0), by + (p0 * vk + pk * v0)
            power += pace[0] * vy[k] + z * vy[0]
        ax, ay, f = mu * ax, mu * ay, of_both / (k + 1)
        x[k + 1], y[k + 1] = f * (-3.5 * ax - d * bx), f * (lift * z - h * ay - g * by)
        u[k + 1], v[k + 1] = f * (-d * ax - 3.5 * bx), f * (-g * ay - 3.5 * by - cos * z)
        vx[k + 1], work[k + 1] = f * (-ax - bx), f * cos * power
    vy[ORDER], rho[ORDER] = (v[ORDER] - y[ORDER]) * by_slip, 0.0
    return step_length(c, _SLIPS, _SLIPS)


@inlined
def _begin(k, slip, sums, force, reaction):  # out: slip
    """Returns order k of the direction e, and writes order k + 1 of the size r, of a slip r e with the rate F - K e.

    The slip is zero at first, or it creeps. If it creeps, r is not zero, and e_{k+1} is that of the last sweep.

    Args:
        k: The order, zero only if the slip creeps.
        slip: The series (r, ex, ey), with order 1 of r and order 0 of e.
        sums: Those of e_j e_{k-j}, and of r_{j+1} e_{k-j}, for 0 < j < k.
        force: (Fx, Fy), order k.
        reaction: The matrix K: (kxx, kxy, kyy).
    """
    (r, ex, ey), (square, tx, ty), (fx, fy), (kxx, kxy, kyy), n = slip, sums, force, reaction, 1.0 * (k + 1)
    ex0, ey0, share = ex[0], ey[0], 1.0 if k == 0 else -0.5 * square
    px, py, ox, oy = kxy * ex0 - kxx * ey0, kyy * ex0, share * ex0, share * ey0  # (px, py) is K (-ey0, ex0)
    fx -= kxx * ox + kxy * oy + n * (tx + r[0] * ex[k + 1])
    fy -= kyy * oy + n * (ty + r[0] * ey[k + 1])
    turn = (ex0 * fy - ey0 * fx) / (ex0 * py - ey0 * px + n * r[1])
    r[k + 1] = (ex0 * fx + ey0 * fy - turn * (ex0 * px + ey0 * py)) / n - (0.0 if k == 0 else share * r[1])
    size = math.sqrt(1.0 + turn * turn) if k == 0 else 1.0
    return (ox - ey0 * turn) / size, (oy + ex0 * turn) / size


@kernel
def _sweep(c, by_nose, by_cloth, nose):  # out: c
    """Writes the series of `_slip_one` from their first terms, and returns `step_length`.

    The forces, such as (ax, ay), are multiplied by the pace of the series: dP/dtau = rho if the nose slips, else 1.
    """
    sin, cos, mu, mu_cloth = nose
    x, y, u, v, vx, work, vy, rho, sigma = c[0], c[1], c[2], c[3], c[4], c[5], c[6], c[7], c[8]
    ex, ey, fx, fy, ax, ay, bx, by, press = c[9], c[10], c[11], c[12], c[13], c[14], c[15], c[16], c[17]
    d, g, h = 1.0 - 2.5 * sin, 2.5 - sin, 2.5 + sin * sin
    slips, n, of_rho, of_sigma = by_nose == _SLIPS, (0 if by_cloth == _SLIPS else 1), 1.0 / rho[0], 1.0 / sigma[0]
    by_slip, stuck = 1.0 / (1.0 + sin), 2.0 / 7.0
    for k in range(ORDER):
        q = qc = sx = sy = tx = ty = gx = gy = power = 0.0
        for j in range(1, k):
            i = k - j
            if slips:
                q, power = q + (x[j] * x[i] + y[j] * y[i] - rho[j] * rho[i]), power + rho[j] * vy[i]
            else:
                q, sx, sy = q + (ex[j] * ex[i] + ey[j] * ey[i]), sx + rho[j + 1] * ex[i], sy + rho[j + 1] * ey[i]
            qc, gx, gy = qc + (fx[j] * fx[i] + fy[j] * fy[i]), gx + press[j] * fx[i], gy + press[j] * fy[i]
            tx, ty = tx + sigma[j + n] * fx[i], ty + sigma[j + n] * fy[i]
        vy[k] = (v[k] - y[k]) * by_slip
        if slips:
            if k > 0:
                rho[k] = (0.5 * q + x[0] * x[k] + y[0] * y[k]) * of_rho
                power += rho[k] * vy[0]
            pace, power = rho[k], power + rho[0] * vy[k]
        else:
            pace, power = (1.0 if k == 0 else 0.0), vy[k]
        if k > 0 and by_cloth == _SLIPS:
            sigma[k] = fx[0] * (u[k] - tx) + fy[0] * (v[k] - ty) + 0.5 * qc * sigma[0]
            fx[k], fy[k] = of_sigma * (u[k] - tx - sigma[k] * fx[0]), of_sigma * (v[k] - ty - sigma[k] * fy[0])
        if not slips:  # the cloth slips, with a press that depends on the friction at the nose
            jxy, jyy = d * mu_cloth * cos * fx[0], h + g * mu_cloth * cos * fy[0]
            qx, qy = pace * mu_cloth * sin * fx[0], pace * mu_cloth * sin * fy[0]
            if k > 0:
                qx, qy = press[0] * fx[k] + gx, press[0] * fy[k] + gy
            if by_nose == _STICKS:
                ay[k] = (g * qy - pace * sin * cos) / jyy
                ax[k] = stuck * (d * qx - jxy * ay[k])
            elif k > 0 or by_nose == _CREEPS:
                force = -d * qx, pace * sin * cos - g * qy
                ex[k], ey[k] = _begin(k, (rho, ex, ey), (q, sx, sy), force, (3.5 * mu, mu * jxy, mu * jyy))
        if slips:
            ax[k], ay[k] = -mu * x[k], -mu * y[k]
        elif by_nose != _STICKS:
            ax[k], ay[k] = -mu * ex[k], -mu * ey[k]
        press[k] = mu_cloth * (pace * sin - cos * ay[k])
        hx, hy = d * ax[k], g * ay[k] - pace * cos
        if by_cloth == _STICKS:
            bx[k], by[k] = -stuck * hx, -stuck * hy
        else:
            if k > 0:
                gx, gy = gx + press[k] * fx[0], gy + press[k] * fy[0]
            if by_cloth == _CREEPS or (by_cloth == _BEGINS and k > 0):
                force, reaction = (hx - 3.5 * gx, hy - 3.5 * gy), (3.5 * press[0], 0.0, 3.5 * press[0])
                fx[k], fy[k] = _begin(k, (sigma, fx, fy), (qc, tx, ty), force, reaction)
            bx[k], by[k] = -press[0] * fx[k] - gx, -press[0] * fy[k] - gy
        f = 1.0 / (k + 1)
        if by_nose == _CREEPS and k == 0:
            x[0], y[0] = rho[0] * ex[0], rho[0] * ey[0]
        if by_cloth == _CREEPS and k == 0:
            u[0], v[0] = sigma[0] * fx[0], sigma[0] * fy[0]
        if by_nose != _STICKS:
            x[k + 1], y[k + 1] = f * (3.5 * ax[k] + d * bx[k]), f * (h * ay[k] + g * by[k] + pace * sin * cos)
        if by_cloth != _STICKS:
            u[k + 1], v[k + 1] = f * (hx + 3.5 * bx[k]), f * (hy + 3.5 * by[k])
        vx[k + 1], work[k + 1] = f * (ax[k] + bx[k]), f * cos * power
    vy[ORDER] = (v[ORDER] - y[ORDER]) * by_slip
    return step_length(c, by_nose, by_cloth)


@kernel
def _slip_one(c, at_nose, at_cloth, nose):  # out: c
    """Writes the series of (x, y, u, v, vx, work, vy, rho, sigma) from c[:6, 0], and returns `step_length`.

    The series are in tau with dP = rho dtau if the nose slips, else in P. `at_nose` and `at_cloth` describe the
    contacts: the state, the direction (x, y) of the slip, and the rate in P of a slip that begins, otherwise 0.
    """
    (by_nose, ex, ey, rate), (by_cloth, fx, fy, rate_c), length = at_nose, at_cloth, 0.0
    for row in range(13):
        for k in range(0 if row > 6 else 1, ORDER + 3):
            c[row, k] = 0.0
    c[7, 0], c[7, 1] = math.sqrt(c[0, 0] * c[0, 0] + c[1, 0] * c[1, 0]), rate
    c[8, 0], c[8, 1] = math.sqrt(c[2, 0] * c[2, 0] + c[3, 0] * c[3, 0]), rate_c
    if by_nose == _SLIPS:
        c[8, 1] *= c[7, 0]
    c[9, 0], c[10, 0], c[11, 0], c[12, 0] = ex, ey, fx, fy
    for _ in range(_SWEEPS if by_nose == _CREEPS or by_cloth == _CREEPS else 1):
        length = _sweep(c, by_nose, by_cloth, nose)
    return length


@inlined
def _held(fx, fy, nose):
    """Returns the friction (ax, ay) that holds a nose without slip; (fx, fy) is the direction of the slip at the cloth.

    It is infinite if no force holds the nose.
    """
    sin, cos, _, mu_cloth = nose
    d, g, h = 1.0 - 2.5 * sin, 2.5 - sin, 2.5 + sin * sin
    push, inertia = sin * cos - g * mu_cloth * fy * sin, h + g * mu_cloth * fy * cos
    ay = -push / inertia
    if inertia <= 0.0:  # Painleve's paradox
        ay = -math.inf if push > 0.0 else 0.0
    return mu_cloth * (sin - ay * cos) * fx * d / 3.5, ay


@inlined
def _slip_at(rate, force, reaction):
    """Returns the vector (x, y) with F - K (x, y) = rate (x, y), and its derivative by the rate; see `_begin`."""
    (fx, fy), (kxx, kxy, kyy) = force, reaction
    y = fy / (kyy + rate)
    x = (fx - kxy * y) / (kxx + rate)
    by_y = -y / (kyy + rate)
    return x, y, -(x + kxy * by_y) / (kxx + rate), by_y


@kernel
def bracketed_rate(force, reaction):
    """Returns the rate >= 0 for which `_slip_at` has the size 1, by bisection."""
    low, high = 0.0, abs(force[0]) + abs(force[1]) + abs(reaction[1])
    for _ in range(60):
        rate = 0.5 * (low + high)
        x, y, _, _ = _slip_at(rate, force, reaction)
        if x * x + y * y > 1.0:
            low = rate
        else:
            high = rate
    return high


@kernel
def _begin_slip(fx, fy, nose):
    """Returns the direction (x, y) of a slip at the nose that begins, and its rate; (fx, fy) as for `_held`."""
    sin, cos, mu, mu_cloth = nose
    d, g, h = 1.0 - 2.5 * sin, 2.5 - sin, 2.5 + sin * sin
    force = -d * mu_cloth * fx * sin, sin * cos - g * mu_cloth * fy * sin
    inertia = mu * (h + g * mu_cloth * cos * fy)
    least = max(0.0, -inertia)  # it is above zero in Painleve's paradox
    reaction = 3.5 * mu + least, mu * d * mu_cloth * cos * fx, inertia + least
    rate = bracketed_rate(force, reaction)
    x, y, by_x, by_y = _slip_at(rate, force, reaction)
    rate -= 0.5 * (x * x + y * y - 1.0) / (x * by_x + y * by_y)  # Newton's method, which has the derivative
    x, y, _, _ = _slip_at(rate, force, reaction)
    return x, y, least + rate


@kernel
def _leave_rest(nose):
    """Returns how two contacts without slip begin, as `_slip_one` has it, and whether the ball leaves the cloth.

    All is along y. The first case without contradiction counts. The states are `_STOPS` if both stick.
    """
    sin, cos, mu, mu_cloth = nose
    g, h = 2.5 - sin, 2.5 + sin * sin
    for by_nose, e in ((_STICKS, 0.0), (_BEGINS, 1.0), (_BEGINS, -1.0)):
        for by_cloth, f in ((_STICKS, 0.0), (_BEGINS, 1.0), (_BEGINS, -1.0)):
            _, ay = _held(0.0, f, CushionNose(sin, cos, mu, 0.0 if sin < 0.0 else mu_cloth))
            if by_nose == _BEGINS:
                ay = -mu * e
            elif by_cloth == _STICKS:
                ay = -(sin * cos + g * cos / 3.5) / (h - g * g / 3.5)
            press = mu_cloth * max(0.0, sin - ay * cos)
            by = -press * f
            if by_cloth == _STICKS:
                by = (cos - g * ay) / 3.5
            rate, rate_c = e * (h * ay + g * by + sin * cos), f * (g * ay + 3.5 * by - cos)
            possible = (abs(ay) <= mu if by_nose == _STICKS else rate >= 0.0) and ay > -math.inf
            if possible and (abs(by) <= press if by_cloth == _STICKS else rate_c >= 0.0):
                if e == 0.0 and f == 0.0:
                    by_nose = by_cloth = _STOPS
                return (by_nose, 0.0, e, rate), (by_cloth, 0.0, f, rate_c), sin - ay * cos < 0.0
    return (_STOPS, 0.0, 0.0, 0.0), (_STOPS, 0.0, 0.0, 0.0), False


@kernel
def _hold(row, x, y, limit):  # out: row
    """Returns `row` with the square of the series `limit` minus that of the vector (x, y)."""
    for k in range(ORDER):
        total = 0.0
        for j in range(k + 1):
            total += limit[j] * limit[k - j] - x[j] * x[k - j] - y[j] * y[k - j]
        row[k] = total
    row[ORDER] = 0.0
    return row


@kernel
def _advance(c, t):  # out: c
    """Writes (x, y, u, v, vx, work) after a step t to order 0 of their series, and returns `c`."""
    for row in range(6):
        value = c[row, ORDER]
        for k in range(ORDER - 1, -1, -1):
            value = value * t + c[row, k]
        c[row, 0] = value
    return c


@kernel
def _contacts(motion, states, first, lifted, nose):
    """Returns the new states of the contacts, of which at least one slips.

    Args:
        motion: (x, y, u, v).
        states: The states of the contacts at the end of the last step.
        first: Whether this is the first step of the impact.
        lifted: Whether the ball was above the cloth at the end of the last step.
        nose: The `CushionNose`.

    Returns:
        (at_nose, at_cloth, lifted, smooth): the contacts as `_slip_one` has them, whether the ball leaves the cloth,
        and whether no slip begins again.
    """
    (x, y, u, v), (by_nose, by_cloth), (sin, cos, mu, mu_cloth) = motion, states, nose
    ex = ey = fx = fy = rate = rate_c = 0.0
    g, smooth = 2.5 - sin, True
    if by_nose == _SLIPS:
        rho = math.sqrt(x * x + y * y)
        ex, ey = x / rho, y / rho
        if first or abs(sin + mu * cos * ey) > _NO_PRESS:
            lifted = sin + mu * cos * ey < 0.0
    if by_cloth == _SLIPS:
        sigma = math.sqrt(u * u + v * v)
        fx, fy = u / sigma, v / sigma
    if by_nose != _SLIPS:
        lifted = sin < 0.0
        held = CushionNose(sin, cos, mu, 0.0 if lifted else mu_cloth)
        ax, ay = _held(fx, fy, held)
        size = math.sqrt(ax * ax + ay * ay)
        if by_nose == _RELEASED and size <= 1.001 * mu:
            by_nose, ex, ey = _BEGINS, -ax / size, -ay / size
        elif size <= mu:
            by_nose = _STICKS
        else:
            by_nose, smooth = _BEGINS, False
            ex, ey, rate = _begin_slip(fx, fy, held)
            if not lifted and -mu * ey * cos > sin:
                lifted = True
                ex, ey, rate = _begin_slip(fx, fy, CushionNose(sin, cos, mu, 0.0))
    if by_cloth != _SLIPS:
        px, py = -(1.0 - 2.5 * sin) * mu * ex, -g * mu * ey - cos
        pull, press = math.sqrt(px * px + py * py), 0.0
        if not lifted:
            press = 3.5 * mu_cloth * (sin + mu * cos * ey)
        fx, fy = px / pull, py / pull
        if by_cloth == _RELEASED:
            by_cloth = _BEGINS
        elif pull > press:
            by_cloth, rate_c, smooth = _BEGINS, pull - press, smooth and first
        else:
            by_cloth = _STICKS
    return (by_nose, ex, ey, rate), (by_cloth, fx, fy, rate_c), lifted, smooth


@kernel
def _paced_by_both(rho, sigma, at_nose, at_cloth, nose):
    """Returns whether both slips set the pace: if the slip at the cloth falls, or grows or turns fast."""
    (_, ex, ey, _), (_, fx, fy, _), (sin, cos, mu, mu_cloth) = at_nose, at_cloth, nose
    press = 3.5 * mu_cloth * (sin + mu * cos * ey)
    du, dv = -(1.0 - 2.5 * sin) * mu * ex - press * fx, -(2.5 - sin) * mu * ey - press * fy - cos
    growth, turn = fx * du + fy * dv, abs(fx * dv - fy * du)
    return growth < 0.0 or growth * rho > _GROWS * sigma or turn * rho > _TURNS * sigma


@kernel
def _series(c, at_nose, at_cloth, creeps, nose):  # out: c
    """Writes the series of a step from c[:6, 0]; returns the length of the step and the states of the contacts.

    With `creeps`, a small slip may creep. If its direction is that of the slow manifold, the series begins on the
    manifold.
    """
    (by_nose, ex, ey, _), (by_cloth, fx, fy, _), (x, y, u, v) = at_nose, at_cloth, (c[0, 0], c[1, 0], c[2, 0], c[3, 0])
    both, rho, sigma = by_nose == _SLIPS and by_cloth == _SLIPS, math.sqrt(x * x + y * y), math.sqrt(u * u + v * v)
    if both and creeps and rho < _CREEP * sigma:
        by_nose = _CREEPS
    elif both and creeps and sigma < _CREEP * rho:
        by_cloth = _CREEPS
    if by_nose == _CREEPS or by_cloth == _CREEPS:
        t = _slip_one(c, (by_nose, ex, ey, 0.0), (by_cloth, fx, fy, 0.0), nose)
        off = max(max(abs(c[0, 0] - x), abs(c[1, 0] - y)), max(abs(c[2, 0] - u), abs(c[3, 0] - v)))
        if t > 0.0 and off < _TERM * max(rho, sigma):
            return t, by_nose, by_cloth
        c[0, 0], c[1, 0], c[2, 0], c[3, 0] = x, y, u, v
    paced_by_both = _paced_by_both(rho, sigma, at_nose, at_cloth, nose)
    if both and paced_by_both:
        return _slip_both(c, nose), _SLIPS, _SLIPS
    return _slip_one(c, at_nose, at_cloth, nose), at_nose[0], at_cloth[0]


@kernel
def _stop(c, row, t, end, event):  # out: c
    """Returns as `_first` when the size `row` of a slip that creeps falls to zero, before its minimum."""
    for k in range(ORDER):
        c[18, k] = -(k + 1) * row[k + 1]
    c[18, ORDER] = 0.0
    low = bracketed_root(c[18], 0.0, t)
    root = _fall(row, 0.0, low)
    return (root, event) if root < low else (t, end)


@kernel
def _change(c, t, states, lifted, nose):  # out: c
    """Returns the time of the first change of a contact in a step t, and the change; t and `_NOTHING` if none."""
    (by_nose, by_cloth), (sin, cos, mu, _), end = states, nose, _NOTHING
    if by_nose == _CREEPS:
        t, end = _stop(c, c[7], t, end, _NOSE_STOPS)
    if by_cloth == _CREEPS:
        t, end = _stop(c, c[8], t, end, _CLOTH_STOPS)
    if by_nose == _STICKS:
        c[7, 0] = mu
        t, end = _first(_hold(c[18], c[13], c[14], c[7]), 0.0, t, end, _NOSE)
    if by_cloth == _STICKS:
        t, end = _first(_hold(c[18], c[15], c[16], c[17]), 0.0, t, end, _CLOTH)
    if by_nose == _SLIPS and sin < mu * cos:
        sign = -1.0 if lifted else 1.0
        for k in range(ORDER + 1):
            c[18, k] = sign * (sin * c[7, k] + mu * cos * c[1, k])
        if c[18, 0] > 0.0:
            t, end = _first(c[18], 0.0, t, end, _LIFT)
    return t, end


@kernel
def _phase(c, t, end, compresses, whole, e):  # out: c
    """Returns the end of a step, which is earlier if a phase ends in the step.

    Args:
        c: The series. The work of restitution is negative at first, and zero at the end of restitution.
        t: The length of the step.
        end: What ends the step.
        compresses: Whether the step begins in compression.
        whole: The work of compression.
        e: Restitution.

    Returns:
        (t, end, compresses, whole)
    """
    low = 0.0
    if compresses:
        low = _fall(c[6], 0.0, t)
        if low < t:
            compresses, (whole, _) = False, polynomial(c[5], low)
            c[5, 0] = c[5, 0] - (1.0 - e * e) * whole
            if e < _SMALL:
                return low, _COMPRESSED, compresses, whole
    elif e == 0.0:
        return e * math.sqrt(whole / max(1e-100, -c[5, 2])), _RESTORED, compresses, whole  # zero, with a derivative
    if not compresses:
        t, end = _first(c[5], low, t, end, _RESTORED)
    return t, end, compresses, whole


@kernel
def follow_impact(before, nose, e):
    """Returns an impact.

    Args:
        before: The velocity along the cushion and into it, vy >= 0, and the spins about x, y and z times the radius.
        nose: The `CushionNose`.
        e: Restitution.

    Returns:
        after: (vx, vy, rwx, rwy, rwz) after it, m/s.
        smooth: Whether it has a derivative: the cushion slips at first, and no slip that stops begins again at once.
        steps: The number of steps.
    """
    vx, unit, rwx, rwy, rwz = before
    if unit <= 0.0:
        return before, True, 0
    (sin, cos, mu, mu_cloth), c = nose, room()
    x, y, u, v = (vx + rwy * sin - rwz * cos) / unit, (rwx - unit * sin) / unit, (vx - rwy) / unit, (unit + rwx) / unit
    tiny, whole = max(_STOPPED, 1e-15 * max(max(abs(x), abs(y)), max(abs(u), abs(v)))), 0.0
    c[0, 0], c[1, 0], c[2, 0], c[3, 0], c[4, 0], c[5, 0] = x, y, u, v, vx / unit, 0.0
    by_nose = by_cloth = _SLIPS
    compresses, lifted, smooth, steps = True, False, True, 0
    for step in range(_MOST_STEPS):
        steps, x, y, u, v = step + 1, c[0, 0], c[1, 0], c[2, 0], c[3, 0]
        if step >= _PATIENCE:
            tiny, smooth = 2.0 * tiny, False
        if by_nose == _SLIPS and math.sqrt(x * x + y * y) <= tiny:
            by_nose, smooth, c[0, 0], c[1, 0] = _STOPS, smooth and step > 0, 0.0, 0.0
        sigma = math.sqrt(u * u + v * v)
        if by_cloth == _SLIPS and sigma <= tiny:
            by_cloth, smooth, c[2, 0], c[3, 0] = _STOPS, smooth and (step > 0 or sigma == 0.0), 0.0, 0.0
        if by_nose != _SLIPS and by_cloth != _SLIPS:
            smooth = False
            if compresses:
                compresses, whole, c[5, 0] = False, c[5, 0], e * e * c[5, 0]
            (by_nose, ex, ey, rate), (by_cloth, fx, fy, rate_c), lifted = _leave_rest(nose)
            if by_nose == _STOPS or c[5, 0] <= 0.0:
                break
        else:
            states = by_nose, by_cloth
            (by_nose, ex, ey, rate), (by_cloth, fx, fy, rate_c), lifted, again = _contacts(
                (x, y, u, v), states, step == 0, lifted, nose
            )
            smooth = smooth and again
        now = CushionNose(sin, cos, mu, 0.0 if lifted else mu_cloth)
        at_nose, at_cloth = (by_nose, ex, ey, rate), (by_cloth, fx, fy, rate_c)
        t, by_nose, by_cloth = _series(c, at_nose, at_cloth, step >= _USUAL_STEPS, now)
        if t == 0.0:  # a slip is so small that its series overflows
            tiny *= 100.0
            continue
        t, end = _change(c, t, (by_nose, by_cloth), lifted, nose)
        t, end, compresses, whole = _phase(c, t, end, compresses, whole, e)
        c = _advance(c, t)
        by_nose, by_cloth = (_STICKS if by_nose == _STICKS else _SLIPS), (_STICKS if by_cloth == _STICKS else _SLIPS)
        if end == _NOSE_STOPS:
            by_nose, c[0, 0], c[1, 0] = _STOPS, 0.0, 0.0
        elif end == _CLOTH_STOPS:
            by_cloth, c[2, 0], c[3, 0] = _STOPS, 0.0, 0.0
        elif end == _NOSE:
            by_nose = _RELEASED
        elif end == _CLOTH:
            by_cloth = _RELEASED
        elif end == _LIFT:
            lifted = not lifted
        elif end == _COMPRESSED:
            c[5, 0] = e * e * whole
        elif end == _RESTORED:
            break
    x, vx = c[0, 0], c[4, 0]
    vy, rwy = min(0.0, (c[3, 0] - c[1, 0]) / (1.0 + sin)), vx - c[2, 0]
    rwx, rwz = c[3, 0] - vy, (vx + rwy * sin - x) / cos
    return (unit * vx, unit * vy, unit * rwx, unit * rwy, unit * rwz), smooth, steps
