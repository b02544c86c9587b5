"""Real roots of polynomials on an interval, in mpmath arithmetic.

A polynomial is a sequence of coefficients, the constant first. All its real roots are isolated by its derivative's:
between two neighbouring roots of the derivative it is monotone, so it has one root there if its sign changes and none
otherwise. Applied to the derivative in turn this ends at a straight line. Nothing is divided by a leading coefficient,
so vanishing ones need no special case, and a multiple root is a root of the derivative at which the value vanishes.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import comb
from typing import Any, TypeAlias

import mpmath

Real: TypeAlias = Any  # an mpmath.mpf; mpmath has no type stubs

ZERO_DIGITS = 15
"""A value counts as zero once all but so many of the working digits have cancelled."""

_DEPTH = 8  # halvings of the interval in `first_possible_entry`
_BERNSTEIN = [[comb(j, k) / comb(4, k) for k in range(j + 1)] for j in range(5)]


def real_roots(coefficients: Sequence[Real], low: Real, high: Real) -> list[Real]:
    """All distinct real roots in [low, high], ascending; a polynomial that is zero throughout has none."""
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
    """The first t in [0, high] at which the polynomial, positive before, turns negative; None if it never does.

    A root where it touches zero and stays positive is none. At `high` the sign after it is taken from the slope.
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
    """A lower bound, in floats, for the first t in [0, 1] at which a quartic is no greater than `margin`.

    The values of a polynomial lie between its smallest and its largest Bernstein coefficient (Cargo and Shisha 1966),
    so a piece of the interval whose coefficients all exceed the margin holds no such t.

    Args:
        coefficients: Five floats, the constant first.
        margin: Above the error of the coefficients and of the arithmetic here.

    Returns:
        The bound, or None if the quartic exceeds the margin on all of [0, 1].
    """
    bernstein = [sum(w * c for w, c in zip(row, coefficients, strict=False)) for row in _BERNSTEIN]
    return _search(bernstein, margin, 0.0, 1.0, _DEPTH)


def _search(b: list[float], margin: float, low: float, width: float, depth: int) -> float | None:
    if min(b) > margin:
        return None
    if depth == 0 or b[0] <= margin:
        return low
    # de Casteljau: the coefficients of both halves
    c01, c12, c23, c34 = (b[0] + b[1]) / 2, (b[1] + b[2]) / 2, (b[2] + b[3]) / 2, (b[3] + b[4]) / 2
    c012, c123, c234 = (c01 + c12) / 2, (c12 + c23) / 2, (c23 + c34) / 2
    c0123, c1234 = (c012 + c123) / 2, (c123 + c234) / 2
    middle = (c0123 + c1234) / 2
    found = _search([b[0], c01, c012, c0123, middle], margin, low, width / 2, depth - 1)
    if found is None:
        found = _search([middle, c1234, c234, c34, b[4]], margin, low + width / 2, width / 2, depth - 1)
    return found


def _derivative(coefficients: Sequence[Real]) -> list[Real]:
    return [k * c for k, c in enumerate(coefficients)][1:]


def _monotone_pieces(coefficients: Sequence[Real], low: Real, high: Real) -> list[Real]:
    """The ends of the interval and, between them, the roots of the derivative."""
    inner = real_roots(_derivative(coefficients), low, high) if len(coefficients) > 2 else []
    return [low, *(t for t in inner if low < t < high), high] if low < high else [low]


def _sign(coefficients: Sequence[Real], t: Real) -> int:
    """The sign of the value at t; 0 if it is lost in the rounding of its terms."""
    value, size, distance = mpmath.mpf(0), mpmath.mpf(0), abs(t)
    for c in reversed(coefficients):
        value = value * t + c
        size = size * distance + abs(c)
    if abs(value) <= size * mpmath.mpf(10) ** (ZERO_DIGITS - mpmath.mp.dps):
        return 0
    return 1 if value > 0 else -1


def _bracketed_root(coefficients: Sequence[Real], low: Real, high: Real) -> Real:
    """The root between two points of opposite sign, by Newton steps that fall back on halving the bracket."""
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
        # A Newton step that leaves the bracket, or does not halve the last one, is not converging.
        if not low <= after <= high or 2 * abs(step) > last:
            after = (low + high) / 2
        last = abs(after - t)
        if last <= precision * abs(after):
            return after
        t = after


def _float_root(coefficients: Sequence[Real], low: Real, high: Real, rising: bool) -> Real:
    """A starting point inside the bracket: the root in floats, by halving."""
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
