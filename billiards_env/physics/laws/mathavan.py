"""The impact on a cushion by Mathavan, Jackson and Parkin (2010), with friction at the cushion and at the cloth.

S. Mathavan, M. R. Jackson and R. M. Parkin (2010), A theoretical analysis of billiard ball dynamics under cushion
impacts, Proc. IMechE Part C 224. The cushion pushes the ball down on the slate, which pushes back. The velocities are
functions of the normal impulse P. They follow an ordinary differential equation, because the slips at both contacts
turn while friction acts. Compression ends when the normal velocity is zero, and restitution ends when the cushion has
returned e^2 of the work of compression.

A contact without slip sticks if friction suffices. Otherwise it begins to slip, against the friction that would be
necessary. The equation is integrated by the method of Dormand and Prince (1980), of order 5(4), with a local error of
`TOLERANCE` times the normal velocity. While a slip falls, no step changes it by more than half of its size. A slip of
less than 100 times the local error is zero. The result is within 1e-6 of the normal velocity.

The cloth exerts no force while the ball does not press on it, which happens if the nose is below the centre of the
ball. If both contacts stick and the normal impulse does not change the normal velocity, the cushion and the slate hold
the ball, and the impact ends.

The axes are x along the cushion, y into it and z up. Impulses are per mass; spins are times the radius.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from billiards_env.jit import inlined, kernel

TOLERANCE = 1e-9  # the local error of the integration over the normal velocity

_MOST_STEPS = 20_000  # a limit for safety; an impact has about 50, one in a thousand has 1,500
_PATIENCE = 5_000
"""After this number of steps the tolerance grows tenfold in each 1,000 steps, so an impact with extreme numbers ends.

On real tables, the largest number of steps in 180,000 random impacts was 3,585.
"""

# Dormand and Prince (1980), RK5(4)7M.
_A2 = (1 / 5,)
_A3 = (3 / 40, 9 / 40)
_A4 = (44 / 45, -56 / 15, 32 / 9)
_A5 = (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729)
_A6 = (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656)
_A7 = (35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84)
_ERROR = (71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40)


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


@inlined
def _at_most(x, y, limit):
    """Returns the vector (x, y), shortened to the length `limit` if it is longer."""
    size = math.sqrt(x * x + y * y)
    if size > limit:
        return limit * (x / size), limit * (y / size)
    return x, y


@inlined
def slips_of(y, nose):
    """Returns the slips (x, y) at the cushion and (x, y) at the cloth."""
    return y[0] + y[3] * nose.sin - y[4] * nose.cos, y[2] - y[1] * nose.sin, y[0] - y[3], y[1] + y[2]


@inlined
def slip_at(lam, ex, ey, nose):
    """Returns the slip (x, y) at the cushion that has a rate of lam (x, y), and its derivative with respect to lam.

    (ex, ey) is the direction of the slip on the cloth. The friction at the cushion is mu along -(x, y).
    """
    sin, cos, mu, mu_cloth = nose
    d, g, h = 1.0 - 2.5 * sin, 2.5 - sin, 2.5 + sin * sin
    # Without friction the slip changes at the rate r.
    rx, ry = -d * mu_cloth * ex * sin, sin * cos - g * mu_cloth * ey * sin
    mixed, across = d * mu_cloth * ex * cos, h + g * mu_cloth * ey * cos
    y = ry / (mu * across + lam)
    x = (rx - mu * mixed * y) / (3.5 * mu + lam)
    by_y = -y / (mu * across + lam)
    return x, y, -(x + mu * mixed * by_y) / (3.5 * mu + lam), by_y


@inlined
def begin_slip(ex, ey, nose):
    """Returns the direction (x, y) of the slip at the cushion when it begins, and its rate; see `slip_at`."""
    sin, cos, mu, mu_cloth = nose
    d, g = 1.0 - 2.5 * sin, 2.5 - sin
    rx, ry = -d * mu_cloth * ex * sin, sin * cos - g * mu_cloth * ey * sin
    lo, hi = 0.0, abs(rx) + abs(ry) + mu * abs(d * mu_cloth * ex * cos)
    x = y = lam = 0.0
    for _ in range(40):
        lam = 0.5 * (lo + hi)
        x, y, _, _ = slip_at(lam, ex, ey, nose)
        if x * x + y * y > 1.0:
            lo = lam
        else:
            hi = lam
    return x, y, lam


@inlined
def friction(slips, nose, tiny):
    """Returns the friction at the cushion (ax, ay) and at the cloth (bx, by) per normal impulse.

    `slips` is that of `slips_of`. A slip of tiny[0] at the cushion, or of tiny[1] at the cloth, is zero.
    """
    sin, cos, mu, mu_cloth = nose
    xi, yi, xc, yc = slips
    at_nose, at_cloth = math.sqrt(xi * xi + yi * yi), math.sqrt(xc * xc + yc * yc)
    # A unit impulse along y at one contact changes the slip at the other one by g, that along x by d.
    d, g, h = 1.0 - 2.5 * sin, 2.5 - sin, 2.5 + sin * sin
    ex, ey = 0.0, 0.0  # direction of the slip on the cloth
    slides = at_cloth > tiny[1]
    if slides:
        ex, ey = xc / at_cloth, yc / at_cloth
    if at_nose > tiny[0]:
        ax, ay = -mu * (xi / at_nose), -mu * (yi / at_nose)  # friction at the cushion per normal impulse
    else:
        ax, ay = 0.0, -(sin * cos + g * cos / 3.5) / (h - g * g / 3.5)  # it stops both slips
        if not slides:
            by = (cos - g * ay) / 3.5
            if abs(by) > mu_cloth * (sin - ay * cos):
                ey = -1.0 if by > 0.0 else 1.0
        if slides or ey != 0.0:
            ay = -(sin * cos - g * mu_cloth * ey * sin) / (h + g * mu_cloth * ey * cos)
            if ay * cos > sin:  # the ball does not press on the cloth
                ay = -sin * cos / h
            ax = mu_cloth * max(0.0, sin - ay * cos) * ex * d / 3.5
        if ax * ax + ay * ay > mu * mu:
            if ex != 0.0 or ey != 0.0:
                x, z, _ = begin_slip(ex, ey, nose)
                if -mu * z * cos > sin:
                    x, z, _ = begin_slip(0.0, 0.0, nose)
                ax, ay = -mu * x, -mu * z
            else:
                ax, ay = _at_most(ax, ay, mu)
    press = mu_cloth * max(0.0, sin - ay * cos)  # limit of the friction on the cloth
    if slides:
        bx, by = -press * ex, -press * ey
    else:
        bx, by = _at_most(-ax * d / 3.5, (cos - g * ay) / 3.5, press)
    return ax, ay, bx, by


@kernel
def _rates(y, nose, tiny):
    """Returns the derivatives of y = (vx, vy, R wx, R wy, R wz, work) with respect to P; see `friction`."""
    sin, cos = nose.sin, nose.cos
    ax, ay, bx, by = friction(slips_of(y, nose), nose, tiny)
    return (ax + bx, by - cos - sin * ay, 2.5 * (ay + by), 2.5 * (ax * sin - bx), -2.5 * ax * cos, y[1] * cos)


@inlined
def combine(y, h, k, weights):
    """Returns y + h times the weighted sum of the derivatives k."""
    a, b, c, d, e, f = y
    for m in range(len(weights)):
        w = h * weights[m]
        a += w * k[m][0]
        b += w * k[m][1]
        c += w * k[m][2]
        d += w * k[m][3]
        e += w * k[m][4]
        f += w * k[m][5]
    return a, b, c, d, e, f


def stepper(rates: Callable[..., Any]) -> Callable[..., Any]:
    """Returns the kernel of a step of an equation; `rates` is like `_rates`."""

    @kernel
    def step(y, h, k1, nose, tiny):
        """Returns (y after a step h, its derivative, the error of y); k1 is the derivative at y."""
        k2 = rates(combine(y, h, (k1,), _A2), nose, tiny)
        k3 = rates(combine(y, h, (k1, k2), _A3), nose, tiny)
        k4 = rates(combine(y, h, (k1, k2, k3), _A4), nose, tiny)
        k5 = rates(combine(y, h, (k1, k2, k3, k4), _A5), nose, tiny)
        k6 = rates(combine(y, h, (k1, k2, k3, k4, k5), _A6), nose, tiny)
        after = combine(y, h, (k1, k2, k3, k4, k5, k6), _A7)
        k7 = rates(after, nose, tiny)
        return after, k7, combine((0.0, 0.0, 0.0, 0.0, 0.0, 0.0), h, (k1, k2, k3, k4, k5, k6, k7), _ERROR)

    return step


_step = stepper(_rates)


@inlined
def largest(y):
    """Returns the size of the largest velocity of y."""
    return max(max(abs(y[0]), abs(y[1])), max(max(abs(y[2]), abs(y[3])), abs(y[4])))


@inlined
def _longest_step(y, rate, nose, tiny):
    """Returns the longest step in which no falling slip changes by more than half of its size."""
    xi, yi, xc, yc = slips_of(y, nose)
    dxi, dyi, dxc, dyc = slips_of(rate, nose)
    longest = math.inf
    for x, z, dx, dz in ((xi, yi, dxi, dyi), (xc, yc, dxc, dyc)):
        size = math.sqrt(x * x + z * z)
        if size > tiny and x * dx + z * dz < 0.0:
            longest = min(longest, 0.5 * size / math.sqrt(dx * dx + dz * dz))
    return longest


@inlined
def _clear_slips(y, nose, tiny):
    """Returns y with spins that make slips of less than `tiny` zero."""
    vx, vy, rwx, rwy, rwz, work = y
    xi, yi, xc, yc = slips_of(y, nose)
    if xc * xc + yc * yc < tiny * tiny:
        rwx, rwy = -vy, vx
    elif xi * xi + yi * yi < tiny * tiny:
        rwx = vy * nose.sin
    if xi * xi + yi * yi < tiny * tiny:
        rwz = (vx + rwy * nose.sin) / nose.cos
    return vx, vy, rwx, rwy, rwz, work


@inlined
def _sticks(y, nose, tiny):
    """Returns whether neither contact slips."""
    xi, yi, xc, yc = slips_of(y, nose)
    return max(abs(xi), abs(yi), abs(xc), abs(yc)) < tiny


@kernel
def integrate_impact(before, nose, e):
    """Returns (vx, vy, rwx, rwy, rwz) after an impact, m/s.

    Args:
        before: The same before it: the velocity along the cushion and into it, vy >= 0, and the spins about x, y and z
            times the radius.
        nose: The `CushionNose`.
        e: Restitution.
    """
    vx, vy, rwx, rwy, rwz = before
    y = (vx, vy, rwx, rwy, rwz, 0.0)
    if vy <= 0.0:
        return before
    most = TOLERANCE * vy + 1e-15 * (abs(vx) + abs(rwx) + abs(rwy) + abs(rwz))  # local error
    tiny = 100.0 * most
    compresses, work, last_work = True, 0.0, 0.0
    h = 0.1 * vy
    rate = _rates(y, nose, (tiny, tiny))
    for step in range(1, _MOST_STEPS):
        if step >= _PATIENCE and step % 1_000 == 0:
            most, tiny = 10.0 * most, 10.0 * tiny
        h = min(h, _longest_step(y, rate, nose, tiny))
        after, rate_after, off = _step(y, h, rate, nose, (tiny, tiny))
        error = largest(off)
        if error > most and h > most:
            h *= max(0.1, 0.9 * math.sqrt(math.sqrt(most / error)))
            continue
        # Remaining distance to the end of the phase before and after the step.
        left = y[1] if compresses else y[5] - last_work
        left_after = after[1] if compresses else after[5] - last_work
        close = 1e-11 * (max(vy, left) if compresses else work)
        if left_after < -close and h > 0.0:
            h *= max(0.1, left / (left - left_after))
            continue
        y, rate = _clear_slips(after, nose, tiny), rate_after
        if left_after <= close:
            if not compresses or e == 0.0:
                break
            compresses, work = False, y[5]
            last_work = (1.0 - e * e) * work
        if rate[1] > -1e-12 and _sticks(y, nose, tiny):
            break
        h *= min(4.0, 0.9 * math.sqrt(math.sqrt(most / max(error, 1e-3 * most))))
    return y[0], y[1], y[2], y[3], y[4]
