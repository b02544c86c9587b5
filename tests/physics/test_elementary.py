import math

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from billiards_env.physics.elementary import arccosine, exponential, sine_cosine


@pytest.fixture(autouse=True, scope="module")
def precision():
    with mpmath.workdps(30):
        yield


def ulps(found, exact):
    return abs(float((found - exact) / math.ulp(float(exact))))


@given(st.floats(-690, 0))
def test_the_exponential_is_within_an_ulp(x):
    assert ulps(exponential(x), mpmath.exp(x)) < 1.0


@given(st.floats(-10, 10))
def test_sine_and_cosine_are_within_an_ulp(x):
    for found, exact in zip(sine_cosine(x), (mpmath.sin(x), mpmath.cos(x)), strict=True):
        assert ulps(found, exact) < 1.0 or abs(found - exact) < 1e-16


@given(st.floats(-1, 1))
def test_the_arccosine_is_within_an_ulp(x):
    assert ulps(arccosine(x), mpmath.acos(x)) < 1.0


def test_random_arguments_are_within_an_ulp():
    for x in np.random.default_rng(0).uniform(-1, 1, 5000).tolist():
        assert ulps(exponential(-16.0 * abs(x)), mpmath.exp(-16 * abs(mpmath.mpf(x)))) < 1.0
        assert ulps(arccosine(x), mpmath.acos(x)) < 1.0
        for found, exact in zip(sine_cosine(8.0 * x), mpmath.cos_sin(8 * mpmath.mpf(x))[::-1], strict=True):
            assert ulps(found, exact) < 1.0 or abs(found - exact) < 1e-16


@pytest.mark.parametrize(
    ("found", "exact"),
    [
        (exponential(0.0), 1.0),
        (exponential(-1e300), 0.0),
        (sine_cosine(0.0), (0.0, 1.0)),
        (arccosine(1.0), 0.0),
        (arccosine(-1.0), math.pi),
        (arccosine(0.0), math.pi / 2),
    ],
)
def test_special_values_are_exact(found, exact):
    assert found == exact
