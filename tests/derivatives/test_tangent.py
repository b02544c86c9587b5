"""The tangents of kernels are the derivatives of their values, and what has no tangent is refused with its line."""

import math
from typing import Any, NamedTuple, cast

import numpy as np
import pytest

from billiards_env.derivatives.tangent import Tangent, rule, tangent_of
from billiards_env.jit import expanded, inlined, kernel, room_for


class Pair(NamedTuple):
    first: Any
    second: Any


@inlined
def halves(x, y):
    return Pair(0.5 * x, y / 2.0)


@inlined
def root(x):
    y = x
    for _ in range(60):
        y = 0.5 * (y + x / y)
    return y


@rule(root)
@inlined
def d_root(x, d_x):
    return root(x), 0.5 * d_x / root(x)


@kernel
def everything(x, y, pair, k):
    total = first = 0.0
    for m in range(4):
        if m == k:
            continue
        total += pair[0] * x / (1.0 + m)
        if m == 2:
            break
    (a, _), b = halves(x, y), abs(x - y)
    if x > y and k != 1:
        first, total = max(a, y * y), total - min(x, b) * root(x * x + y * y)
    elif x < 0.0:
        return -x, Pair(y, 1.0)
    else:
        first -= math.sqrt(a * a + b) if b > 0.0 else 0.0
    return total, Pair(first=first, second=Pair(x, k).first + (x if x > 1.0 else y))


def value(at, k):
    x, y, one, two = at
    total, (first, second) = cast(Any, everything).py_func(x, y, Pair(one, two), k)
    return np.array([total, first, second])


@pytest.mark.parametrize("k", [0, 1])
def test_a_tangent_is_the_difference_of_values(k):
    tangent, rng = tangent_of(everything, constant=("k",)), np.random.default_rng(0)
    for _ in range(20):
        at, change = rng.normal(size=4), rng.normal(size=4)
        ((total, pair), (d_total, d_pair)) = tangent(
            at[0], at[1], Pair(*at[2:]), k, change[0], change[1], Pair(*change[2:])
        )
        assert np.array_equal([total, *pair], value(at, k))
        expected = (value(at + 1e-6 * change, k) - value(at - 1e-6 * change, k)) / 2e-6
        np.testing.assert_allclose([d_total, *d_pair], expected, atol=1e-7)


@kernel
def twice(x):
    y = z = x * x
    return y + z


def test_a_chain_of_assignments_computes_its_value_once():
    assert tangent_of(twice)(3.0, 1.0) == (18.0, 12.0)
    assert tangent_of(twice).source.count("d_x * x") == 1


@kernel
def scaled(x, k):
    scale, y = twice(k), twice(x)
    return scale * y + root(k)


def test_a_tangent_leaves_out_the_changes_of_constants():
    assert tangent_of(scaled, constant=("k",))(2.0, 1.0, 1.0)[1] == 16.0
    source = tangent_of(scaled, constant=("k",)).source
    assert "= twice(k)" in source
    assert "= root(k)" in source
    assert "d_k" not in source
    assert tangent_of(scaled)(2.0, 1.0, 0.0, 1.0)[1] == pytest.approx(32.5)


room = room_for(2, 3)


@rule(room)
@expanded
def d_room():
    return room(), room()


@kernel
def fill(rows, x):  # out: rows
    rows[0], rows[1] = 0.0, x
    for k in range(1, 3):
        rows[1, k] = rows[1, k - 1] * x
    return 1.0


@kernel
def cube_by_an_array(x):
    rows = room()
    one = fill(rows, x)
    return one * rows[1, 2] + rows[0, 1]


def test_a_kernel_may_write_arrays():
    x, d_x = 0.5, 2.0
    assert tangent_of(cube_by_an_array)(x, d_x) == (x**3, 3.0 * x * x * d_x)


@kernel
def step_of(x):
    return 0.5 * x


rule(step_of)(None)


@kernel
def two_steps(x):
    return step_of(x) * x


def test_a_rule_may_ignore_a_change():
    assert tangent_of(two_steps)(3.0, 2.0) == (4.5, 3.0)


def power(x):
    y = 2.0 * x
    return y**2


def call_within_a_condition(x, y):
    return halves(x, y).first if x > 0.0 else y


def changed_range(x):
    y = 0.0
    for part in x:
        y += part
    return y


def written_field(x, y):
    y.first = x
    return x


def keyword_of_a_kernel(x):
    return halves(x, y=1.0)


def changed_counter(x):
    total = x
    for x in (1.0, 2.0):
        total += x
    return total


def changed_constant(x, k):
    k = k + x
    return k


OTHER_SOURCE = [
    (power, 2, r"y \*\* 2"),
    (call_within_a_condition, 1, r"halves\(x, y\)"),
    (changed_range, 2, "for part in x"),
    (written_field, 1, r"y\.first"),
    (keyword_of_a_kernel, 1, r"halves\(x, y=1.0\)"),
    (changed_counter, 2, "for x in"),
    (changed_constant, 1, "k"),
]


@pytest.mark.parametrize(("function", "line", "source"), OTHER_SOURCE)
def test_other_source_is_refused_with_its_line(function, line, source):
    at = function.__code__.co_firstlineno + line
    with pytest.raises(SyntaxError, match=rf"test_tangent.py:{at}: {source}"):
        _ = Tangent(function, frozenset("k")).source
