"""The linear complementarity problem of simultaneous impacts, solved so precisely that the order has no say.

The active set is found by block principal pivoting (Judice and Pires 1994). Each system is solved by Cholesky's method
and refined with residuals in twice the precision, as is the solution (Wilkinson 1963): what is left of the order of the
unknowns is some 1e-28, and rounds away. A matrix that is all but singular, as of a rack with more contacts than it
needs, is made regular by the proximal point method (Rockafellar 1976), which goes to one solution of the many.
"""

from __future__ import annotations

import math

from billiards_env.physics.jit import inlined, kernel
from billiards_env.physics.state import two_sum

MOST = 48  # unknowns; the time grows with their number cubed
WIDTH = 2 * MOST + 7  # of the scratch space

_SPLITTER = 134217729.0  # 2^27 + 1
_REGULAR = 1e-3  # pivots below it make a matrix all but singular
_SHIFT = 2.0**-26  # of the proximal point method
_STEPS = 8  # of refinement, and of the proximal point method
_FINE, _COARSE = 1e-28, 1e-20  # relative changes that end them
_ZERO = 1e-24  # relative; below it a value's sign is not looked at
_EXCHANGES = 100  # of active unknowns; never met


@inlined
def two_product(a, b):
    """The product a b exactly, as a rounded product and its error (Dekker 1971)."""
    p = a * b
    t = _SPLITTER * a
    ah = t - (t - a)
    al = a - ah
    t = _SPLITTER * b
    bh = t - (t - b)
    bl = b - bh
    return p, ((ah * bh - p) + ah * bl + al * bh) + al * bl


@kernel
def _factor(n, a, shift, active, lower):
    """Cholesky factor of the active rows and columns of a + shift; its least pivot, or 0 if it has none."""
    least = 1.0
    for i in range(n):
        if active[i] == 0.0:
            continue
        for j in range(i + 1):
            if active[j] == 0.0:
                continue
            total = a[i, j]
            for k in range(j):
                if active[k] > 0.0:
                    total -= lower[i, k] * lower[j, k]
            if j < i:
                lower[i, j] = total / lower[j, j]
            else:
                total += shift
                least = min(least, total)
                if total <= 0.0:
                    return 0.0
                lower[i, i] = math.sqrt(total)
    return least


@kernel
def _correct(n, lower, active, r):
    """Solves lower lower^T d = r, in place of r, for the active unknowns."""
    for i in range(n):
        if active[i] > 0.0:
            for k in range(i):
                if active[k] > 0.0:
                    r[i] -= lower[i, k] * r[k]
            r[i] /= lower[i, i]
    for i in range(n - 1, -1, -1):
        if active[i] > 0.0:
            for k in range(i + 1, n):
                if active[k] > 0.0:
                    r[i] -= lower[k, i] * r[k]
            r[i] /= lower[i, i]


@kernel
def _residual(i, n, a, b, shift, x, last):
    """What remains of b + shift last - (a + shift) x in row i; x and last are (n, 2), sums of two doubles."""
    s, e = b[i], 0.0
    for k in range(n):
        if x[k, 0] != 0.0:
            p, error = two_product(-a[i, k], x[k, 0])
            s, more = two_sum(s, p)
            e += more + (error - a[i, k] * x[k, 1])
    if shift > 0.0:
        # The difference is small: its rounding is nothing beside the shift.
        s, more = two_sum(s, shift * ((last[i, 0] - x[i, 0]) + (last[i, 1] - x[i, 1])))
        e += more
    return s + e


@kernel
def _solve(n, a, b, shift, active, lower, x, last, r, largest):
    """The active unknowns of (a + shift) x = b + shift last; the others are 0."""
    for i in range(n):
        if active[i] == 0.0:
            x[i, 0] = x[i, 1] = 0.0
    for _ in range(_STEPS):
        for i in range(n):
            r[i] = _residual(i, n, a, b, shift, x, last)
        _correct(n, lower, active, r)
        change = 0.0
        for i in range(n):
            if active[i] > 0.0:
                change = max(change, abs(r[i]))
                s, e = two_sum(x[i, 0], r[i])
                x[i, 0], x[i, 1] = two_sum(s, e + x[i, 1])
        if change <= _FINE * largest:
            break


@kernel
def solve_complementarity(n, x, space):
    """The x >= 0 with a x >= b and x . (a x - b) = 0.

    Args:
        n: Number of unknowns, at most `MOST`.
        x: (>= n,) float64 out.
        space: (>= n, WIDTH) float64. In its first n rows and columns a, symmetric and positive semidefinite, its
            diagonal 1; in its column 2 MOST b, which is positive. The rest is scratch.

    Returns:
        Whether it was found.
    """
    a, lower, b, r = space[:, :MOST], space[:, MOST : 2 * MOST], space[:, 2 * MOST], space[:, 2 * MOST + 1]
    pair, last = space[:, 2 * MOST + 2 : 2 * MOST + 4], space[:, 2 * MOST + 4 : 2 * MOST + 6]
    active = space[:, 2 * MOST + 6]
    largest = 0.0
    for i in range(n):
        pair[i, 0] = pair[i, 1] = last[i, 0] = last[i, 1] = 0.0
        active[i] = 1.0
        largest = max(largest, b[i])
    shift, fewest, patience, exchanges = 0.0, n + 1, 3, 0
    for _ in range(_STEPS):
        while True:
            least = _factor(n, a, shift, active, lower)
            if shift == 0.0 and least < _REGULAR:
                shift = _SHIFT
                least = _factor(n, a, shift, active, lower)
            if least <= 0.0:
                return False
            _solve(n, a, b, shift, active, lower, pair, last, r, largest)
            wrong, at = 0, -1
            for i in range(n):
                value = pair[i, 0] if active[i] > 0.0 else -_residual(i, n, a, b, shift, pair, last)
                r[i] = value
                if value < -_ZERO * largest:
                    wrong, at = wrong + 1, i
            if wrong == 0:
                break
            exchanges += 1
            if exchanges > _EXCHANGES:
                return False
            # All at once while that gets better; else the last one alone, which ends for certain (Murty 1974).
            if wrong < fewest:
                fewest, patience = wrong, 3
            else:
                patience -= 1
            for i in range(n):
                if r[i] < -_ZERO * largest and (patience > 0 or i == at):
                    active[i] = 1.0 - active[i]
        change = 0.0
        for i in range(n):
            change = max(change, abs((pair[i, 0] - last[i, 0]) + (pair[i, 1] - last[i, 1])))
            last[i, 0], last[i, 1] = pair[i, 0], pair[i, 1]
        if shift == 0.0 or change <= _COARSE * largest:
            break
        fewest, patience = n + 1, 3
    for i in range(n):
        x[i] = max(0.0, pair[i, 0])
    return True
