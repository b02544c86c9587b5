"""Double-double arithmetic: a number as the unevaluated sum (hi, lo) of two doubles, about 32 decimal digits.

The error-free sums and products follow Knuth (1969, section 4.2.2) and Dekker (1971). The other operations follow
Hida, Li and Bailey (2001), Algorithms for Quad-Double Precision Floating Point Arithmetic. Only `+ - * /` are
used, so IEEE 754 defines the bits of the results.
"""

from __future__ import annotations

from billiards_env.jit import inlined, kernel

HI, LO = 0, 1  # columns of an array of double-double numbers

_SPLITTER = 134217729.0  # 2^27 + 1


@kernel
def two_sum(a: float, b: float) -> tuple[float, float]:
    """Returns (s, e): the rounded sum of a and b and its error, so that s + e = a + b exactly."""
    s = a + b
    bb = s - a
    return s, (a - (s - bb)) + (b - bb)


@inlined
def fast_two_sum(a, b):
    """Returns the result of `two_sum` if abs(a) >= abs(b), with fewer operations."""
    s = a + b
    return s, b - (s - a)


@inlined
def two_product(a, b):
    """Returns (p, e): the rounded product of a and b and its error, so that p + e = a b exactly."""
    p = a * b
    t = _SPLITTER * a
    ah = t - (t - a)
    al = a - ah
    t = _SPLITTER * b
    bh = t - (t - b)
    bl = b - bh
    return p, ((ah * bh - p) + ah * bl + al * bh) + al * bl


@inlined
def add(a, a_lo, b, b_lo):
    """Returns the sum of the double-double numbers (a, a_lo) and (b, b_lo)."""
    s, e = two_sum(a, b)
    t, f = two_sum(a_lo, b_lo)
    s, e = fast_two_sum(s, e + t)
    return fast_two_sum(s, e + f)


@inlined
def multiply(a, a_lo, b, b_lo):
    """Returns the product of the double-double numbers (a, a_lo) and (b, b_lo)."""
    p, e = two_product(a, b)
    return fast_two_sum(p, e + (a * b_lo + a_lo * b))


@inlined
def divide(a, a_lo, b, b_lo):
    """Returns the quotient of the double-double numbers (a, a_lo) and (b, b_lo)."""
    q = a / b
    p, e = multiply(b, b_lo, q, 0.0)
    r, r_lo = add(a, a_lo, -p, -e)
    q2 = r / b
    p, e = multiply(b, b_lo, q2, 0.0)
    r, r_lo = add(r, r_lo, -p, -e)
    s, e = fast_two_sum(q, q2)
    return add(s, e, r / b, 0.0)
