import math

import mpmath
import numpy as np
import pytest

from billiards_env.physics.elementary import arccosine, exponential, norm, sine_cosine

FUNCTIONS = {
    "exponential": (exponential, mpmath.exp, -690.0, 0.0),
    "sine": (lambda x: sine_cosine(x)[0], mpmath.sin, -10.0, 10.0),
    "cosine": (lambda x: sine_cosine(x)[1], mpmath.cos, -10.0, 10.0),
    "arccosine": (arccosine, mpmath.acos, -1.0, 1.0),
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_function_is_within_an_ulp(name):
    function, exact_function, low, high = FUNCTIONS[name]
    rng = np.random.default_rng(0)
    arguments = np.r_[rng.uniform(low, high, 5000), rng.uniform(low, high, 500) * 10.0 ** -rng.uniform(0, 300, 500)]
    with mpmath.workdps(30):
        for x in (low, high, 0.0, *arguments.tolist()):
            computed, exact = function(x), exact_function(x)
            near_zero = name in ("sine", "cosine") and abs(computed - exact) < 1e-16
            assert near_zero or abs(computed - exact) < math.ulp(float(exact))


SPECIAL_VALUES = [
    (exponential(0.0), 1.0),
    (exponential(-1e300), 0.0),
    (sine_cosine(0.0), (0.0, 1.0)),
    (arccosine(1.0), 0.0),
    (arccosine(-1.0), math.pi),
    (arccosine(0.0), math.pi / 2),
]


@pytest.mark.parametrize(("computed", "exact"), SPECIAL_VALUES)
def test_special_values_are_exact(computed, exact):
    assert computed == exact


@pytest.mark.parametrize(
    ("x", "y", "size"), [(3.0, -4.0, 5.0), (0.0, 0.0, 0.0), (0.0, -2.0, 2.0), (3e-200, 4e-200, 5e-200)]
)
def test_norm_is_correct_if_squares_underflow(x, y, size):
    assert norm(x, y) == pytest.approx(size, rel=1e-15, abs=0)
