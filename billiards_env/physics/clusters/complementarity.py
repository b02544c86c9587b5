"""The linear complementarity problem of simultaneous impacts, solved in double-double arithmetic.

The active set is found by block principal pivoting (Judice and Pires 1994), and each linear system by an LDL^T
factorisation in double-double arithmetic. Rounding errors are then about 1e-32 of the largest term, so the matrix may
have a condition number of 1e16, as it does for balls whose masses differ by this factor. The order of the unknowns
changes only these errors, which `clusters.impulses.to_double` removes.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from billiards_env.jit import allocating, inlined, kernel
from billiards_env.physics.double_double import HI, LO, add, divide, multiply, two_product, two_sum

MOST = 48
"""Largest number of unknowns. The time of a solution grows with the cube of their number."""

# Both are relative to the diagonal. A matrix with a pivot below _SINGULAR is singular, such as that of a rack, where
# contacts are redundant. _SHIFT is then added to the diagonal, which makes the solution unique (Tikhonov 1963).
_SINGULAR = 2.0**-75
_SHIFT = 2.0**-80
_ZERO = 2.0**-88  # relative; a smaller value is rounding
_PROXIMAL = 2.0**-24  # relative weight of the distance from the last solution in `solve_smallest`
_EXCHANGES = 100  # largest number of changes of the active set; random problems need a few


class ComplementarityProblem(NamedTuple):
    """The problem x >= 0, a x >= b, x . (a x - b) = 0 with up to m unknowns, and its scratch arrays.

    The last axis of length 2 holds the two parts (hi, lo) of a double-double number.

    Attributes:
        a: (m, m, 2) float64, symmetric and positive semidefinite.
        b: (m, 2) float64.
        x: (m, 2) float64 out.
        factor: (m, m, 2) float64 scratch, the unit triangular factor of the active rows and columns.
        pivot: (m, 2) float64 scratch, the diagonal factor.
        row: (m, 2) float64 scratch.
        active: (m,) bool scratch: unknowns that may be positive.
        index: (m,) int64 scratch: the active unknowns, in order.
    """

    a: Any
    b: Any
    x: Any
    factor: Any
    pivot: Any
    row: Any
    active: Any
    index: Any


@allocating
def empty_problem(m):
    """Returns a `ComplementarityProblem` of up to m unknowns, with undefined content."""
    return ComplementarityProblem(
        a=np.empty((m, m, 2)),
        b=np.empty((m, 2)),
        x=np.empty((m, 2)),
        factor=np.empty((m, m, 2)),
        pivot=np.empty((m, 2)),
        row=np.empty((m, 2)),
        active=np.empty(m, np.bool_),
        index=np.empty(m, np.int64),
    )


@inlined
def _subtract_product(s, e, a, b):
    """Returns (s, e) - a b, not normalised, for (2,) arrays a and b (Ogita, Rump and Oishi 2005, Dot2)."""
    p, p_lo = two_product(a[0], b[0])
    s, error = two_sum(s, -p)
    return s, e + (error - (p_lo + (a[0] * b[1] + a[1] * b[0])))


@kernel
def _factorise(m, problem, shift):  # out: problem
    """Factorises a + shift diag(a) for the m unknowns in `index`. Returns whether the matrix is regular."""
    a, factor, pivot, row, index = problem.a, problem.factor, problem.pivot, problem.row, problem.index
    for i in range(m):
        for j in range(i + 1):
            s, e = a[index[i], index[j], HI], a[index[i], index[j], LO]
            if j == i:
                s, e = add(s, e, shift * s, 0.0)
            for k in range(j):
                if row[k, HI] != 0.0:  # most contacts share no ball
                    s, e = _subtract_product(s, e, row[k], factor[j, k])
            s, e = two_sum(s, e)
            if j < i:
                row[j, HI], row[j, LO] = s, e
                factor[i, j, HI], factor[i, j, LO] = 0.0, 0.0
                if s != 0.0:
                    factor[i, j, HI], factor[i, j, LO] = divide(s, e, pivot[j, HI], pivot[j, LO])
            else:
                pivot[i, HI], pivot[i, LO] = s, e
        if not pivot[i, HI] > (_SINGULAR if shift == 0.0 else 0.0) * a[index[i], index[i], HI]:
            return False
    return True


@kernel
def _substitute(m, problem):  # out: problem
    """Solves for the m unknowns in `index` with the result of `_factorise`, and writes them to x."""
    b, x, factor, pivot, row, index = problem.b, problem.x, problem.factor, problem.pivot, problem.row, problem.index
    for i in range(m):
        s, e = b[index[i], HI], b[index[i], LO]
        for k in range(i):
            s, e = _subtract_product(s, e, factor[i, k], row[k])
        row[i, HI], row[i, LO] = two_sum(s, e)
    for i in range(m - 1, -1, -1):
        s, e = divide(row[i, HI], row[i, LO], pivot[i, HI], pivot[i, LO])
        for k in range(i + 1, m):
            s, e = _subtract_product(s, e, factor[k, i], row[k])
        row[i, HI], row[i, LO] = two_sum(s, e)
        x[index[i], HI], x[index[i], LO] = row[i, HI], row[i, LO]


@inlined
def _violates(i, n, problem, largest):
    """Returns whether unknown i, if active, is negative, or else violates row i of a x >= b, by more than rounding."""
    a, b, x = problem.a, problem.b, problem.x
    if problem.active[i]:
        return x[i, HI] * a[i, i, HI] < -_ZERO * largest
    s, e = -b[i, HI], -b[i, LO]
    size = abs(s)
    for k in range(n):
        if x[k, HI] != 0.0:
            p, p_lo = multiply(a[i, k, HI], a[i, k, LO], x[k, HI], x[k, LO])
            s, e = add(s, e, p, p_lo)
            size += abs(p)
    return s < -_ZERO * size


@kernel
def solve_complementarity(n, problem):  # out: problem
    """Computes an x >= 0 with a x >= b and x . (a x - b) = 0.

    If a is singular, x is one of several solutions, and a x is the same for all of them.

    Args:
        n: Number of unknowns, at most `MOST`.
        problem: A `ComplementarityProblem`.

    Returns:
        Whether a solution was found.
    """
    b, x, active, index = problem.b, problem.x, problem.active, problem.index
    largest = 0.0
    for i in range(n):
        active[i] = b[i, HI] > 0.0
        largest = max(largest, b[i, HI])
    fewest, patience = n + 1, 3
    for _ in range(_EXCHANGES):
        m = 0
        for i in range(n):
            x[i, HI] = x[i, LO] = 0.0
            if active[i]:
                index[m] = i
                m += 1
        if not (_factorise(m, problem, 0.0) or _factorise(m, problem, _SHIFT)):
            return False
        _substitute(m, problem)
        wrong, last = 0, -1
        for i in range(n):
            if _violates(i, n, problem, largest):
                wrong, last = wrong + 1, i
                index[wrong - 1] = i
        if wrong == 0:
            for i in range(n):
                if x[i, HI] < 0.0:
                    x[i, HI] = x[i, LO] = 0.0
            return True
        # After three exchanges that do not reduce their number, only the last is exchanged, which ends (Murty 1974).
        if wrong < fewest:
            fewest, patience = wrong, 3
        else:
            patience -= 1
        if patience > 0:
            for k in range(wrong):
                active[index[k]] = not active[index[k]]
        else:
            active[last] = not active[last]
    return False


@kernel
def solve_smallest(n, problem, target):  # out: problem, target
    """Replaces the solution x of `solve_complementarity` by the smallest one, weighted by the diagonal.

    If a is regular, x is the only solution and does not change. Otherwise x is the limit of the proximal point
    iteration from zero (Rockafellar 1976), each step of which has one solution. So x does not depend on the order of
    the unknowns, as it may after `solve_complementarity`.

    Args:
        n: Number of unknowns, at most `MOST`.
        problem: The `ComplementarityProblem`; a and b are changed.
        target: (m, 4) float64 scratch.
    """
    a, b, x = problem.a, problem.b, problem.x
    for i in range(n):
        problem.index[i] = i
    if _factorise(n, problem, 0.0):
        return
    for i in range(n):
        target[i, 0], target[i, 1] = b[i, HI], b[i, LO]
        target[i, 2], target[i, 3] = _PROXIMAL * a[i, i, HI], _PROXIMAL * a[i, i, LO]
        a[i, i, HI], a[i, i, LO] = add(a[i, i, HI], a[i, i, LO], target[i, 2], target[i, 3])
        x[i, HI] = x[i, LO] = 0.0
    for _ in range(5):
        for i in range(n):
            p, p_lo = multiply(x[i, HI], x[i, LO], target[i, 2], target[i, 3])
            b[i, HI], b[i, LO] = add(target[i, 0], target[i, 1], p, p_lo)
        solve_complementarity(n, problem)
