import math
from fractions import Fraction
from typing import Any

import mpmath
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from billiards_env.physics.geometry import roots
from billiards_env.physics.geometry.roots import bracketed_root
from tests.helpers.polynomials import expand

first_descent: Any = roots.first_descent
quartic: Any = roots.quartic


def value(coefficients, t):
    """Returns the exact value of the polynomial at t."""
    return sum(Fraction(c) * Fraction(t) ** k for k, c in enumerate(coefficients))


sixteenths = st.integers(-48, 48).map(lambda k: Fraction(k, 16))
pairs = st.tuples(sixteenths, st.integers(1, 32).map(lambda k: Fraction(k, 16)))


@given(st.lists(sixteenths, max_size=4), st.lists(pairs, max_size=2), st.sampled_from([-2, -1, 1, 3]))
def test_the_first_root_from_plus_to_minus_is_found(roots, complex_pairs, leading):
    assume(1 <= len(roots) + 2 * len(complex_pairs) <= 4)
    assume(0 not in roots)
    coefficients = [*map(float, expand(leading, roots, complex_pairs)), 0.0, 0.0, 0.0, 0.0][:5]
    if coefficients[0] < 0:
        coefficients = [-c for c in coefficients]
    end = 2.5
    root = first_descent(*coefficients, end)
    inside = sorted({r for r in roots if 0 < r <= end})
    odd = [r for r in inside if roots.count(r) % 2]
    even = [r for r in inside if roots.count(r) % 2 == 0 and (not odd or r < odd[0])]
    # The accuracy of a triple root is the cube root of the rounding. A double root may be found or not.
    tolerance = {1: 1e-12, 2: 1e-6, 3: 1e-4, 4: 1e-3}
    expected = [*odd[:1], *even]
    if root == math.inf:
        assert not odd
    else:
        assert any(abs(root - r) <= tolerance[roots.count(r)] for r in expected)


@given(st.lists(st.floats(-10, 10), min_size=4, max_size=4), st.floats(1e-3, 10), st.integers(0, 4), st.floats(0.01, 5))
def test_roots_agree_with_numpy(high, constant, degree, end):
    coefficients = [constant, *(c if k < degree else 0.0 for k, c in enumerate(high))]
    assume(all(c == 0 or abs(c) > 1e-3 for c in coefficients))
    ascending = np.polynomial.Polynomial(coefficients)
    slope = ascending.deriv()
    roots = np.asarray(ascending.trim().roots() if degree else [], dtype=complex)
    real = sorted(r.real for r in roots if abs(r.imag) < 1e-4 and 0 < r.real <= end + 1e-3)
    assume(all(abs(slope(r)) > 1e-2 for r in real))  # rounding can neither add nor remove such roots
    assume(not real or abs(real[0] - end) > 1e-6)
    root = first_descent(*coefficients, end)
    if not real or real[0] > end:
        assert root == math.inf
    else:
        assert root == pytest.approx(real[0], abs=1e-10)


@given(
    st.lists(st.floats(-4, 4).filter(lambda c: c == 0 or abs(c) > 1e-6), min_size=4, max_size=4),
    st.integers(-90, 90),
    st.integers(-60, 60),
)
def test_powers_of_two_as_units_of_time_and_length_change_no_digit(high, size, speed):
    coefficients = [1.0, *high]
    root = first_descent(*coefficients, 3.0)
    scaled = [math.ldexp(c, size + speed * k) for k, c in enumerate(coefficients)]
    assert first_descent(*scaled, math.ldexp(3.0, -speed)) == math.ldexp(root, -speed)


LEADING = [0.0, 1e-300, -1e-300, 1e-40, -1e-40, 1e-17]
ROOTS: list[tuple[tuple[float, ...], float, float, float]] = [
    # Coefficients; the end of the interval; the root; its largest relative error
    *(((1.0, -2.0, 0.0, 0.0, leading), 3.0, 0.5, 1e-15) for leading in LEADING),
    *(((1.0, -2.0, 0.0, leading, 0.0), 3.0, 0.5, 1e-15) for leading in LEADING),
    *(((1.0, -2.0, leading, 0.0, 0.0), 3.0, 0.5, 1e-15) for leading in LEADING),
    *(((1.0, 0.0, leading, leading, leading), 3.0, math.inf, 0.0) for leading in LEADING),
    # A root at the end of the interval counts, a later root does not.
    *(((1.0, *np.eye(4)[k] * -1.0), 1.0, 1.0, 1e-5) for k in range(4)),
    *(((1.0, *np.eye(4)[k] * -1.0), 0.999, math.inf, 0.0) for k in range(4)),
    ((1.0, -3.0, 3.0, -1.0, 0.0), 1.0, 1.0, 1e-5),  # (1 - t)^3
    ((1.0, -3.0, 3.0, -1.0, 0.0), 0.999, math.inf, 0.0),
    ((1.0, -1.0, 0.0, 0.0, 0.0), 1.0, 1.0, 2e-16),
    ((1.0, -1.0, 0.0, 0.0, 0.0), math.nextafter(1.0, 0.0), math.inf, 0.0),
    # (t - 1)^2 -+ 1e-8 and (t^2 - 1)^2 -+ 1e-8: two close roots, and a minimum just above zero
    ((1.0 - 1e-8, -2.0, 1.0, 0.0, 0.0), 3.0, 1 - 1e-4, 1e-9),
    ((1.0 + 1e-8, -2.0, 1.0, 0.0, 0.0), 3.0, math.inf, 0.0),
    ((1.0 - 1e-8, 0.0, -2.0, 0.0, 1.0), 3.0, math.sqrt(1 - 1e-4), 1e-9),
    ((1.0 + 1e-8, 0.0, -2.0, 0.0, 1.0), 3.0, math.inf, 0.0),
    ((2.0, -3.0, 3.0, -1.0, 0.0), 3.0, 2.0, 1e-15),  # 1 - (t - 1)^3 has zero slope at 1
    ((3.0, -10.0, 12.0, -6.0, 1.0), 2.0, 1.0, 1e-4),  # (1 - t)^3 (3 - t) has a triple root
    # (t - 1)^4 -+ 1/16: the only root of the derivative is triple
    ((0.9375, -4.0, 6.0, -4.0, 1.0), 3.0, 0.5, 1e-14),
    ((1.0625, -4.0, 6.0, -4.0, 1.0), 3.0, math.inf, 0.0),
    ((1.0, 0.0, 0.0, 0.0, 0.0), 9.0, math.inf, 0.0),  # a slope of zero at the start
    ((1.0, 0.0, 1.0, -1.0, 0.0), 9.0, 1.4655712318767680, 1e-14),
]


@pytest.mark.parametrize(("coefficients", "end", "root", "error"), ROOTS)
def test_the_root_of_a_polynomial_is_found(coefficients, end, root, error):
    assert first_descent(*coefficients, end) == pytest.approx(root, rel=error, abs=0)


def test_a_root_at_the_second_of_two_minima_is_found():
    # A quartic with a maximum at 1.5 and two minima; only the second minimum is below zero.
    coefficients = ((np.polynomial.Polynomial([-1.5, 1]) ** 2 - 0.5) ** 2).coef.tolist()
    coefficients[0] += 0.05 + 0.1 * 1.5
    coefficients[1] -= 0.1
    root = first_descent(*coefficients, 4.0)
    assert 1.5 < root < 2.3
    assert abs(value(coefficients, root)) < Fraction(1, 10**14)
    assert quartic(*coefficients, 0.8) > 0


@given(st.floats(1e-6, 1e6), st.floats(1e-6, 1e6))
def test_roots_of_all_sizes_are_accurate(root, other):
    # (1 - t/root)(1 + t/other)
    c1 = 1 / other - 1 / root
    c2 = -1 / (root * other)
    with mpmath.workdps(50):
        exact = float((-c1 - mpmath.sqrt(mpmath.mpf(c1) ** 2 - 4 * mpmath.mpf(c2))) / (2 * mpmath.mpf(c2)))
    computed = first_descent(1.0, c1, c2, 0.0, 0.0, 2 * root)
    condition = 1 + root / other
    assert computed == pytest.approx(exact, rel=1e-14 * condition)


def test_a_bracketed_root_is_found_for_both_signs_of_the_slope():
    assert bracketed_root(-2.0, 0.0, 1.0, 0.0, 0.0, 0.0, 2.0) == pytest.approx(math.sqrt(2), rel=2e-16)
    assert bracketed_root(2.0, 0.0, -1.0, 0.0, 0.0, 0.0, 2.0) == pytest.approx(math.sqrt(2), rel=2e-16)
    # The slope at 0 is zero, so a Newton step would leave the bracket.
    assert bracketed_root(1e-9, 0.0, 0.0, -1.0, 0.0, 0.0, 2.0) == pytest.approx(1e-3, rel=1e-12)
