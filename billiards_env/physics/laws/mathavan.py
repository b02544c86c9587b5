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
Interval Analysis, chapter 11). They are series in P, but if both contacts slip, in tau with dP = rho sigma dtau, over
rho + sigma at the start of the step, where rho and sigma are the sizes of the slips at the cushion and at the cloth. In
tau, a slip that stops decays exponentially. Slips that begin are series P u(P), or P^2 u(P) at the end of a stick. A
step ends where a series has a term of 5e-17, and where a contact begins to slip, the ball leaves the cloth or a phase
ends: at a root of a polynomial. The error is at most 1e-12 of the normal velocity and the rounding of the result, but
larger if a slip creeps for `_PATIENCE` steps, with friction near the limit of sticking.

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

_TERM = 5e-17  # the size of the last terms over the largest velocity
_USUAL = 16.0  # the largest ratio of the term before the last to it; otherwise the last is small by chance
_STOPPED = 2e-14  # slip over the normal velocity below which a slip has stopped
_NO_PRESS = 1e-9  # at a smaller press over `mu_cloth`, the last event decides whether the ball is on the cloth
_SMALL = 0.01  # a restitution below which the end of the compression ends a step, for the digits of the work left
_MOST_STEPS = 400  # a limit for safety; an impact has about 12
_PATIENCE = 300  # the number of steps after which `_STOPPED` doubles in each step, so that a slip that creeps stops
_SLIPS, _BEGINS, _RELEASED, _STICKS, _STOPS = range(5)  # the states of a contact; it begins as P or, released, as P^2
_NOTHING, _NOSE, _CLOTH, _LIFT, _PHASE = range(5)  # what ends a step: a contact is released, the press, a phase


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
def step_length(c):
    """Returns the length of a step: its last term is about `_TERM`, and a slip that falls keeps a quarter.

    It is zero if the series overflows.
    """
    x, y, u, v, work = c[0], c[1], c[2], c[3], c[5]
    rho, sigma = math.sqrt(x[0] * x[0] + y[0] * y[0]), math.sqrt(u[0] * u[0] + v[0] * v[0])
    largest = 1.0 + rho + sigma + abs(c[6, 0])
    length, last, before = 1e3 * largest, abs(work[ORDER]) / largest, abs(work[ORDER - 1]) / largest
    if rho > 0.0 and sigma > 0.0:
        length *= 1.0 / rho + 1.0 / sigma
    else:
        for row, other, size in ((x, y, c[7]), (u, v, c[8])):  # the size is over P^m if the slip begins
            if size[1] < 0.0 < size[0]:
                slips = row[0] != 0.0 or other[0] != 0.0
                fall = math.sqrt(row[1] * row[1] + other[1] * other[1]) if slips else -size[1]
                length = min(length, 0.75 * size[0] / fall)
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
    return step_length(c)


@kernel
def _begin(k, released, slip, sums, force, reaction):  # out: slip
    """Writes order k of a slip P^m (u, v) that begins, and returns that of its direction (ex, ey).

    The slip has the rate F - K e, with the force F and the direction e.

    Args:
        k: The order, > 0.
        released: Whether m = 2, and not 1.
        slip: The series (u, v, r, ex, ey) with r = |(u, v)|.
        sums: Those of u u + v v - r r, r ex and r ey over the known orders.
        force: (Fx, Fy), order k.
        reaction: The matrix K: (kxx, kxy, kyy).
    """
    (u, v, r, ex, ey), (square, tx, ty), (fx, fy), (kxx, kxy, kyy), i = slip, sums, force, reaction, k - 1
    ex0, ey0, n, of_r, of_n = ex[0], ey[0], 1.0 * (k + 1), 1.0 / r[0] if r[0] > 0.0 else 0.0, 1.0 / (k + 1)
    px, py = kxy * ex0 - kxx * ey0, kyy * ex0  # K (-ey0, ex0)
    along, both = px * ey0 - py * ex0, px * px + py * py
    if released and k == 1:  # 2 u_0 = F_1 - K e_1
        r[0] = (px * fy - py * fx) / (2.0 * along)
        u[0], v[0] = r[0] * ex0, r[0] * ey0
        turn = (px * (fx - 2.0 * u[0]) + py * (fy - 2.0 * v[0])) / both
        u[1], v[1], r[1] = -ey0 * r[0] * turn, ex0 * r[0] * turn, 0.0
        return -ey0 * turn, ex0 * turn
    kappa = 0.5 * square * of_r
    ox, oy = -(kappa * ex0 + tx) * of_r, -(kappa * ey0 + ty) * of_r
    fx, fy = fx - kxx * ox - kxy * oy, fy - kyy * oy
    if not released:
        turn = of_r * (ex0 * fy - ey0 * fx) / (n + (ex0 * py - ey0 * px) * of_r)
        u[k], v[k] = (fx - px * turn) * of_n, (fy - py * turn) * of_n
        r[k] = ex0 * u[k] + ey0 * v[k] + kappa
    else:
        fx, fy = fx - n * u[i], fy - n * v[i]
        more = (px * fy - py * fx) / (n * along)
        turn = (px * (fx - n * ex0 * more) + py * (fy - n * ey0 * more)) / both
        w = r[0] * turn + more * (ex0 * v[1] - ey0 * u[1]) * of_r
        u[i], v[i], r[i] = u[i] + ex0 * more, v[i] + ey0 * more, r[i] + more
        u[k], v[k], r[k] = -ey0 * w, ex0 * w, kappa
    return ox - ey0 * turn, oy + ex0 * turn


@kernel
def _slip_one(c, at_nose, at_cloth, nose):  # out: c
    """Writes the series in P of (x, y, u, v, vx, work, vy, rho) from c[:6, 0], and returns `step_length`.

    `at_nose` and `at_cloth` are the state of the contact, the direction (x, y) of its slip, and its rate if it begins,
    otherwise 0.
    """
    (sin, cos, mu, mu_cloth), (by_nose, ex0, ey0, rate), (by_cloth, fx0, fy0, rate_c) = nose, at_nose, at_cloth
    c[:4, 1:] = 0.0
    c[7:13] = 0.0
    x, y, u, v, vx, work, vy, rho, sigma = c[0], c[1], c[2], c[3], c[4], c[5], c[6], c[7], c[8]
    ex, ey, fx, fy, ax, ay, bx, by, press = c[9], c[10], c[11], c[12], c[13], c[14], c[15], c[16], c[17]
    d, g, h = 1.0 - 2.5 * sin, 2.5 - sin, 2.5 + sin * sin
    m, n = (by_nose if by_nose < _STICKS else 0), (by_cloth if by_cloth < _STICKS else 0)
    su, sv, cu, cv = x[m:], y[m:], u[n:], v[n:]  # slips over P^m and P^n
    ex[0], ey[0], fx[0], fy[0] = ex0, ey0, fx0, fy0
    rho[0], sigma[0] = math.sqrt(x[0] * x[0] + y[0] * y[0]) + rate, math.sqrt(u[0] * u[0] + v[0] * v[0]) + rate_c
    su[0], sv[0], cu[0], cv[0] = rho[0] * ex0, rho[0] * ey0, sigma[0] * fx0, sigma[0] * fy0
    of_rho, of_sigma, by_slip, stuck = 1.0 / rho[0], 1.0 / sigma[0], 1.0 / (1.0 + sin), 2.0 / 7.0
    for k in range(ORDER):
        one = 1.0 if k == 0 else 0.0
        q = qc = sx = sy = tx = ty = gx = gy = 0.0
        for j in range(1, k):
            i = k - j
            q += su[j] * su[i] + sv[j] * sv[i] - rho[j] * rho[i]
            qc += cu[j] * cu[i] + cv[j] * cv[i] - sigma[j] * sigma[i]
            sx, sy = sx + rho[j] * ex[i], sy + rho[j] * ey[i]
            tx, ty = tx + sigma[j] * fx[i], ty + sigma[j] * fy[i]
            gx, gy = gx + press[j] * fx[i], gy + press[j] * fy[i]
        vy[k] = (v[k] - y[k]) * by_slip
        if k > 0 and by_nose == _SLIPS:
            rho[k] = ex0 * x[k] + ey0 * y[k] + 0.5 * q * of_rho
            ex[k], ey[k] = of_rho * (x[k] - sx - rho[k] * ex0), of_rho * (y[k] - sy - rho[k] * ey0)
        if k > 0 and by_cloth == _SLIPS:
            sigma[k] = fx0 * u[k] + fy0 * v[k] + 0.5 * qc * of_sigma
            fx[k], fy[k] = of_sigma * (u[k] - tx - sigma[k] * fx0), of_sigma * (v[k] - ty - sigma[k] * fy0)
        if by_nose != _SLIPS:  # the cloth slips, with a press that depends on the friction at the nose
            jxy, jyy = d * mu_cloth * cos * fx0, h + g * mu_cloth * cos * fy0
            qx, qy = one * mu_cloth * sin * fx0, one * mu_cloth * sin * fy0
            if k > 0:
                qx, qy = press[0] * fx[k] + gx, press[0] * fy[k] + gy
            if by_nose == _STICKS:
                ay[k] = (g * qy - one * sin * cos) / jyy
                ax[k] = stuck * (d * qx - jxy * ay[k])
            elif k > 0:
                slip, reaction = (su, sv, rho, ex, ey), (3.5 * mu, mu * jxy, mu * jyy)
                ex[k], ey[k] = _begin(k, by_nose == _RELEASED, slip, (q, sx, sy), (-d * qx, -g * qy), reaction)
        if by_nose != _STICKS:
            ax[k], ay[k] = -mu * ex[k], -mu * ey[k]
        press[k] = mu_cloth * (one * sin - cos * ay[k])
        hx, hy = d * ax[k], g * ay[k] - one * cos
        if by_cloth == _STICKS:
            bx[k], by[k] = -stuck * hx, -stuck * hy
        else:
            if k > 0:
                gx, gy = gx + press[k] * fx0, gy + press[k] * fy0
            if by_cloth != _SLIPS and k > 0:
                slip, reaction = (cu, cv, sigma, fx, fy), (3.5 * press[0], 0.0, 3.5 * press[0])
                force = hx - 3.5 * gx, hy - 3.5 * gy
                fx[k], fy[k] = _begin(k, by_cloth == _RELEASED, slip, (qc, tx, ty), force, reaction)
            bx[k], by[k] = -press[0] * fx[k] - gx, -press[0] * fy[k] - gy
        f = 1.0 / (k + 1)
        if by_nose == _SLIPS:
            x[k + 1], y[k + 1] = f * (3.5 * ax[k] + d * bx[k]), f * (h * ay[k] + g * by[k] + one * sin * cos)
        if by_cloth == _SLIPS:
            u[k + 1], v[k + 1] = f * (hx + 3.5 * bx[k]), f * (hy + 3.5 * by[k])
        vx[k + 1], work[k + 1] = f * (ax[k] + bx[k]), f * cos * vy[k]
    vy[ORDER], rho[ORDER] = (v[ORDER] - y[ORDER]) / (1.0 + sin), 0.0
    return step_length(c)


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
def _after(c, t):
    """Returns (x, y, u, v, vx, work) after a step t."""
    x, y, u, v, vx, work = c[0, ORDER], c[1, ORDER], c[2, ORDER], c[3, ORDER], c[4, ORDER], c[5, ORDER]
    for k in range(ORDER - 1, -1, -1):
        x, y, u, v = x * t + c[0, k], y * t + c[1, k], u * t + c[2, k], v * t + c[3, k]
        vx, work = vx * t + c[4, k], work * t + c[5, k]
    return x, y, u, v, vx, work


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
    g = 2.5 - sin
    x, y, u, v = (vx + rwy * sin - rwz * cos) / unit, (rwx - unit * sin) / unit, (vx - rwy) / unit, (unit + rwx) / unit
    vx, work, whole = vx / unit, 0.0, 0.0
    tiny = max(_STOPPED, 1e-15 * max(max(abs(x), abs(y)), max(abs(u), abs(v))))
    by_nose = by_cloth = _SLIPS
    compresses, lifted, smooth, steps = True, False, True, 0
    for step in range(_MOST_STEPS):
        steps = step + 1
        if step >= _PATIENCE:
            tiny, smooth = 2.0 * tiny, False
        rho, sigma = math.sqrt(x * x + y * y), math.sqrt(u * u + v * v)
        ex = ey = fx = fy = rate = rate_c = 0.0
        if by_nose == _SLIPS and rho <= tiny:
            by_nose, smooth = _STOPS, smooth and step > 0
            x = y = 0.0
        if by_cloth == _SLIPS and sigma <= tiny:
            by_cloth, smooth = _STOPS, smooth and (step > 0 or sigma == 0.0)
            u = v = 0.0
        if by_nose != _SLIPS and by_cloth != _SLIPS:
            smooth = False
            if compresses:
                compresses, whole, work = False, work, e * e * work
            (by_nose, ex, ey, rate), (by_cloth, fx, fy, rate_c), lifted = _leave_rest(nose)
            if by_nose == _STOPS or work <= 0.0:
                break
        else:
            if by_nose == _SLIPS:
                ex, ey = x / rho, y / rho
                if step == 0 or abs(sin + mu * cos * ey) > _NO_PRESS:
                    lifted = sin + mu * cos * ey < 0.0
            if by_cloth == _SLIPS:
                fx, fy = u / sigma, v / sigma
            if by_nose != _SLIPS:
                lifted = sin < 0.0
                ax, ay = _held(fx, fy, CushionNose(sin, cos, mu, 0.0 if lifted else mu_cloth))
                size = math.sqrt(ax * ax + ay * ay)
                if by_nose == _RELEASED and size <= 1.001 * mu:
                    ex, ey = -ax / size, -ay / size
                elif size <= mu:
                    by_nose = _STICKS
                else:
                    by_nose, smooth = _BEGINS, False
                    ex, ey, rate = _begin_slip(fx, fy, CushionNose(sin, cos, mu, 0.0 if lifted else mu_cloth))
                    if not lifted and -mu * ey * cos > sin:
                        lifted = True
                        ex, ey, rate = _begin_slip(fx, fy, CushionNose(sin, cos, mu, 0.0))
            if by_cloth != _SLIPS:
                px, py = -(1.0 - 2.5 * sin) * mu * ex, -g * mu * ey - cos
                pull, press = math.sqrt(px * px + py * py), 0.0
                if not lifted:
                    press = 3.5 * mu_cloth * (sin + mu * cos * ey)
                fx, fy = px / pull, py / pull
                if by_cloth != _RELEASED and pull > press:
                    by_cloth, rate_c, smooth = _BEGINS, pull - press, smooth and step == 0
                elif by_cloth != _RELEASED:
                    by_cloth = _STICKS
        c[0, 0], c[1, 0], c[2, 0], c[3, 0], c[4, 0], c[5, 0] = x, y, u, v, vx, work
        now = CushionNose(sin, cos, mu, 0.0 if lifted else mu_cloth)
        if by_nose == _SLIPS and by_cloth == _SLIPS:
            t = _slip_both(c, now)
        else:
            t = _slip_one(c, (by_nose, ex, ey, rate), (by_cloth, fx, fy, rate_c), now)
        if t == 0.0:  # a slip is so small that its series overflows
            tiny *= 100.0
            continue
        end = _NOTHING
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
        low, restarts = 0.0, False
        if compresses:
            low = _fall(c[6], 0.0, t)
            if low < t:
                compresses, restarts, (whole, _) = False, e < _SMALL, polynomial(c[5], low)
                c[5, 0] = c[5, 0] - (1.0 - e * e) * whole
        elif e == 0.0:
            t, end = e * math.sqrt(whole / max(1e-100, -c[5, 2])), _PHASE  # zero, with the derivative of one side
        if restarts:
            t, end = low, _PHASE
        elif not compresses and end != _PHASE:
            t, end = _first(c[5], low, t, end, _PHASE)
        x, y, u, v, vx, work = _after(c, t)
        by_nose, by_cloth = (by_nose if by_nose == _STICKS else _SLIPS), (by_cloth if by_cloth == _STICKS else _SLIPS)
        by_nose, by_cloth = (_RELEASED if end == _NOSE else by_nose), (_RELEASED if end == _CLOTH else by_cloth)
        lifted = lifted != (end == _LIFT)
        if end == _PHASE:
            if not restarts:
                break
            work = e * e * whole
    vy, rwy = min(0.0, (v - y) / (1.0 + sin)), vx - u
    rwx, rwz = v - vy, (vx + rwy * sin - x) / cos
    return (unit * vx, unit * vy, unit * rwx, unit * rwy, unit * rwz), smooth, steps
