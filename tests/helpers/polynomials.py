"""Polynomials with given roots."""

import itertools
from fractions import Fraction


def expand(leading, roots, pairs=()):
    """Returns the exact coefficients, constant first, of leading (t - r) ... ((t - a)^2 + b) ... for pairs (a, b)."""
    coefficients = [Fraction(leading)]
    for factor in [*([-Fraction(r), 1] for r in roots), *([a * a + b, -2 * a, 1] for a, b in pairs)]:
        product = [Fraction(0)] * (len(coefficients) + len(factor) - 1)
        for (i, x), (j, y) in itertools.product(enumerate(coefficients), enumerate(factor)):
            product[i + j] += x * y
        coefficients = product
    return coefficients
