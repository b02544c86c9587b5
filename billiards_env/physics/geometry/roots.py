"""The first root of a polynomial on an interval at which it falls from positive values to zero.

The interval is divided into pieces on which the polynomial is monotone. The root is on the first piece on which it
falls from a positive value to zero or less. Newton's method finds it within the ends of the piece (Press et al. 2007,
Numerical Recipes, 9.4). No complex numbers are used.
"""

from __future__ import annotations

import math

from billiards_env.jit import kernel

_MAX_ITERATIONS = 128  # a limit for safety: twice the bisections that exhaust the digits of a double


@kernel
def quartic(c0: float, c1: float, c2: float, c3: float, c4: float, t: float) -> float:
    """Returns c0 + c1 t + c2 t^2 + c3 t^3 + c4 t^4."""
    return c0 + t * (c1 + t * (c2 + t * (c3 + t * c4)))


@kernel
def bracketed_root(c0: float, c1: float, c2: float, c3: float, c4: float, lo: float, hi: float) -> float:
    """Returns the root in [lo, hi] of a quartic that is monotone there and has different signs at the ends.

    A bisection replaces a Newton step that leaves the bracket or is longer than half of the last step.
    """
    rising = quartic(c0, c1, c2, c3, c4, lo) < quartic(c0, c1, c2, c3, c4, hi)
    d1, d2, d3, d4 = c1, 2.0 * c2, 3.0 * c3, 4.0 * c4
    t = 0.5 * (lo + hi)
    last = hi - lo
    for _ in range(_MAX_ITERATIONS):
        p = quartic(c0, c1, c2, c3, c4, t)
        if p == 0.0:
            return t
        if (p > 0.0) == rising:
            hi = t
        else:
            lo = t
        slope = quartic(d1, d2, d3, d4, 0.0, t)
        newton = t - p / slope
        if slope == 0.0 or not (lo < newton < hi) or abs(newton - t) > 0.5 * last:
            newton = 0.5 * (lo + hi)
            if newton <= lo or newton >= hi:
                return t
        last = abs(newton - t)
        if last <= 1e-16 * newton:
            return newton
        t = newton
    return t


@kernel
def first_descent(c0: float, c1: float, c2: float, c3: float, c4: float, end: float) -> float:
    """Returns the first t in (0, end] at which c0 + c1 t + ... + c4 t^4, which is positive just after 0, falls to zero.

    Args:
        c0: Constant coefficient.
        c1: Coefficient of t.
        c2: Coefficient of t^2.
        c3: Coefficient of t^3; may be zero, as may the others.
        c4: Coefficient of t^4.
        end: End of the interval, finite.

    Returns:
        The root, or infinity if there is none.
    """
    # The polynomial is at least its smallest Bernstein coefficient on [0, end] (Farouki 2012, section 3).
    q1, q2, q3, q4 = c1 * end, c2 * end * end, c3 * end * end * end, c4 * end * end * end * end
    last = c0 + q1 + q2 + q3 + q4
    if (
        last > 0.0
        and c0 > 0.0
        and c0 + 0.25 * q1 > 0.0
        and c0 + 0.5 * q1 + q2 / 6.0 > 0.0
        and c0 + 0.75 * q1 + 0.5 * q2 + 0.25 * q3 > 0.0
    ):
        return math.inf
    # Inflection points, in order: the derivative is monotone between them.
    a, b, c = 12.0 * c4, 6.0 * c3, 2.0 * c2
    i1 = i2 = end
    disc = b * b - 4.0 * a * c
    if a == 0.0:
        if b != 0.0:
            i1 = -c / b
    elif disc > 0.0:
        q = -0.5 * (b + math.copysign(math.sqrt(disc), b))
        r1 = q / a
        r2 = c / q if q != 0.0 else 0.0
        i1, i2 = min(r1, r2), max(r1, r2)
    d1, d2, d3, d4 = c1, 2.0 * c2, 3.0 * c3, 4.0 * c4
    left = 0.0  # start of the current monotone piece
    at = 0.0  # sign changes of the derivative are found up to here
    slope = d1
    for k in range(3):
        to = i1 if k == 0 else (i2 if k == 1 else end)
        to = min(to, end)
        if not to > at:
            continue
        slope_to = quartic(d1, d2, d3, d4, 0.0, to)
        if (slope < 0.0 and slope_to > 0.0) or (slope > 0.0 and slope_to < 0.0):
            turn = bracketed_root(d1, d2, d3, d4, 0.0, at, to)
            if slope < 0.0 and quartic(c0, c1, c2, c3, c4, turn) <= 0.0:
                return bracketed_root(c0, c1, c2, c3, c4, left, turn)
            left = turn
        at = to
        if slope_to != 0.0:  # if it is zero, the next comparison uses the sign before it
            slope = slope_to
    if last <= 0.0 and left < end and quartic(c0, c1, c2, c3, c4, left) > 0.0:
        return bracketed_root(c0, c1, c2, c3, c4, left, end)
    return math.inf
