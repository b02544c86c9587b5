"""Functions that are compiled once for each kernel that they call."""

from typing import Any

import numpy as np

from billiards_env.jit import kernel
from billiards_env.jit.specialised import specialised


@kernel
def add_one(value):
    return value + 1


@kernel
def add_two(value):
    return value + 2


change = add_one


def change_all(values):
    for k in range(len(values)):
        values[k] = change(values[k])


def test_each_function_calls_its_own_kernel():
    values = np.zeros(2, np.int64)
    one, two = specialised(change_all, change=add_one), specialised(change_all, change=add_two)
    one(values)
    two(values)
    two(values)
    assert values.tolist() == [5, 5]
    assert one.__qualname__ == "change_all_test_specialised_add_one" != two.__qualname__  # their names on disk


def test_only_the_kernel_in_use_is_compiled():
    @kernel
    def unused(value):
        return value

    specialised(change_all, change=unused)  # not called
    specialised(change_all, change=add_one)(np.zeros(1))
    never: Any = unused
    assert not never.overloads
