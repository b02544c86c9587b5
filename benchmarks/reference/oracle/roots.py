"""Real roots of polynomials on an interval, in mpmath arithmetic.

A polynomial is a sequence of coefficients, the constant first. Its real roots are isolated by the roots of its
derivative: between two neighbouring roots of the derivative it is monotone, so it has one root there if its sign
changes and no root otherwise. The recursion over derivatives ends at a straight line. There is no division by a leading
coefficient, so a zero one is no special case. A multiple root is a root of the derivative at which the value vanishes.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import comb
from typing import Any, TypeAlias

import mpmath

Real: TypeAlias = Any  # an mpmath.mpf; mpmath has no type stubs

ZERO_DIGITS = 15
"""A value counts as zero if cancellation leaves at most this number of the working digits."""

_DEPTH = 8  # halvings of the interval in `first_possible_entry`
_BERNSTEIN = [[comb(j, k) / comb(4, k) for k in range(j + 1)] for j in range(5)]


def real_roots(coefficients: Sequence[Real], low: Real, high: Real) -> list[Real]:
    """Returns all distinct real roots in [low, high], ascending; none for the zero polynomial."""
    points = _monotone_pieces(coefficients, low, high)
    signs = [_sign(coefficients, t) for t in points]
    roots = []
    for k, t in enumerate(points):
        if k and signs[k - 1] * signs[k] < 0:
            roots.append(_bracketed_root(coefficients, points[k - 1], t))
        if signs[k] == 0:
            roots.append(t)
    return roots if any(coefficients) else []


def first_entry(coefficients: Sequence[Real], high: Real) -> Real | None:
    """Returns the first t in [0, high] at which the polynomial changes from positive to negative, or None.

    A root at which it touches zero and stays positive does not count. At `high` the slope decides on the sign after it.
    """
    points = _monotone_pieces(coefficients, mpmath.mpf(0), high)
    outside, root = False, None
    for k, t in enumerate(points):
        sign = _sign(coefficients, t)
        if sign > 0:
            outside, root = True, None
        elif sign == 0:
            root = t if root is None else root
        elif outside:
            return root if root is not None else _bracketed_root(coefficients, points[k - 1], t)
    if outside and root is not None and _sign(_derivative(coefficients), high) < 0:
        return root
    return None


def first_possible_entry(coefficients: Sequence[float], margin: float) -> float | None:
    """Returns a lower bound, in floats, for the first t in [0, 1] at which a quartic is at most `margin`.

    The values of a polynomial lie between its smallest and its largest Bernstein coefficient (Cargo and Shisha 1966),
    so there is no such t in a piece of the interval whose coefficients all exceed the margin.

    Args:
        coefficients: Five floats, the constant first.
        margin: More than the error of the coefficients and of this function.

    Returns:
        The bound; None if the quartic exceeds the margin on all of [0, 1].
    """
    bernstein = [sum(w * c for w, c in zip(row, coefficients, strict=False)) for row in _BERNSTEIN]
    return _search(bernstein, margin, 0.0, 1.0, _DEPTH)


def _search(b: list[float], margin: float, low: float, width: float, depth: int) -> float | None:
    if min(b) > margin:
        return None
    if depth == 0 or b[0] <= margin:
        return low
    # de Casteljau's algorithm: the coefficients of both halves
    c01, c12, c23, c34 = (b[0] + b[1]) / 2, (b[1] + b[2]) / 2, (b[2] + b[3]) / 2, (b[3] + b[4]) / 2
    c012, c123, c234 = (c01 + c12) / 2, (c12 + c23) / 2, (c23 + c34) / 2
    c0123, c1234 = (c012 + c123) / 2, (c123 + c234) / 2
    middle = (c0123 + c1234) / 2
    root = _search([b[0], c01, c012, c0123, middle], margin, low, width / 2, depth - 1)
    if root is None:
        root = _search([middle, c1234, c234, c34, b[4]], margin, low + width / 2, width / 2, depth - 1)
    return root


def _derivative(coefficients: Sequence[Real]) -> list[Real]:
    return [k * c for k, c in enumerate(coefficients)][1:]


def _monotone_pieces(coefficients: Sequence[Real], low: Real, high: Real) -> list[Real]:
    """Returns the ends of the interval and the roots of the derivative between them, ascending."""
    inner = real_roots(_derivative(coefficients), low, high) if len(coefficients) > 2 else []
    return [low, *(t for t in inner if low < t < high), high] if low < high else [low]


def _sign(coefficients: Sequence[Real], t: Real) -> int:
    """Returns the sign of the value at t; 0 if the value is smaller than the rounding of its terms."""
    value, size, distance = mpmath.mpf(0), mpmath.mpf(0), abs(t)
    for c in reversed(coefficients):
        value = value * t + c
        size = size * distance + abs(c)
    if abs(value) <= size * mpmath.mpf(10) ** (ZERO_DIGITS - mpmath.mp.dps):
        return 0
    return 1 if value > 0 else -1


def _bracketed_root(coefficients: Sequence[Real], low: Real, high: Real) -> Real:
    """Returns the root between two points of opposite sign, by Newton steps and bisection."""
    rising = _sign(coefficients, high) > 0
    precision = mpmath.ldexp(1, 8 - mpmath.mp.prec)
    t = _float_root(coefficients, low, high, rising)
    last = high - low
    while True:
        value = slope = mpmath.mpf(0)
        for c in reversed(coefficients):
            slope = slope * t + value
            value = value * t + c
        if value == 0:
            return t
        if (value > 0) == rising:
            high = t
        else:
            low = t
        step = value / slope if slope else last
        after = t - step
        # Bisection replaces a Newton step that leaves the bracket or is longer than half the last step.
        if not low <= after <= high or 2 * abs(step) > last:
            after = (low + high) / 2
        last = abs(after - t)
        if last <= precision * abs(after):
            return after
        t = after


def _float_root(coefficients: Sequence[Real], low: Real, high: Real, rising: bool) -> Real:
    """Returns a starting point inside the bracket: the root in floats, by bisection."""
    unit = max(abs(low), abs(high))
    scaled, power = [], mpmath.mpf(1)
    for c in coefficients:
        scaled.append(c * power)
        power *= unit
    largest = max(abs(c) for c in scaled)
    floats = [float(c / largest) for c in reversed(scaled)]
    a, b = float(low / unit), float(high / unit)
    for _ in range(50):
        middle = (a + b) / 2
        value = 0.0
        for c in floats:
            value = value * middle + c
        if (value > 0) == rising:
            b = middle
        else:
            a = middle
    t = (a + b) / 2 * unit
    return t if low < t < high else (low + high) / 2
