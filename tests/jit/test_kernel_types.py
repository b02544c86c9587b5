from typing import Any, NamedTuple

import numpy as np
import pytest

from billiards_env.jit import decorators as jit
from billiards_env.jit.kernel_types import typeof_kernels
from tests.helpers.processes import run


@jit.kernel
def add_one(value):
    return value + 1


@jit.kernel
def add_two(value):
    return value + 2


class Changes(NamedTuple):
    first: Any
    second: Any = None


class Job(NamedTuple):
    values: Any
    changes: Changes


@jit.inlined
def change_both(second, job, k):
    if second is None:
        return job.changes.first(job.values[k])
    return second(job.changes.first(job.values[k]))


@jit.entry_point
def change_all(changes, values):
    job = Job(values, changes)
    for k in range(len(values)):
        values[k] = change_both(changes.second, job, k)


@pytest.mark.parametrize(
    ("changes", "total"), [((add_one,), 1), ((add_two,), 2), ((add_one, add_two), 3), ((add_one, add_one), 2)]
)
def test_an_entry_point_calls_the_kernels_that_it_gets(changes, total):
    values = np.zeros(2, np.int64)
    change_all(Changes(*changes), values)
    typed: Any = jit.Typed(change_all)
    for _ in range(2):
        typed.call(Changes(*changes), values)
    assert values.tolist() == [3 * total] * 2


def test_a_kernel_alone_is_an_argument():
    call: Any = jit.entry_point(lambda change, value: change(value))
    assert [call(add_one, 1), call(add_two, 1)] == [2, 3]


def test_the_type_of_a_kernel_has_its_name_and_the_hash_of_its_code():
    one, two = typeof_kernels(add_one), typeof_kernels(add_two)
    assert one is typeof_kernels(add_one)
    assert one != two
    assert one.name.startswith("add_one_")
    added: Any = add_one
    again: Any = jit.kernel(added.py_func)
    assert typeof_kernels(again) == one
    with pytest.raises(TypeError, match=r"value = 1: expected kernels"):
        typeof_kernels((add_one, 1))


CHANGES = """
from typing import Any, NamedTuple
from billiards_env.jit import entry_point, kernel

class Changes(NamedTuple):
    first: Any

@kernel
def change(value):
    return value + ADDED

@entry_point
def call(changes, value):
    return changes.first(value)
"""


def test_another_process_loads_the_code_and_an_edit_of_the_kernel_compiles_again(tmp_path):
    def results(added: int) -> str:
        (tmp_path / "changes.py").write_text(CHANGES.replace("ADDED", str(added)))
        code = "from changes import *; print(call(Changes(change), 1), sum(call.stats.cache_hits.values()))"
        folders = {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONDONTWRITEBYTECODE": "1"}
        return run("-c", f"import sys; sys.path.insert(0, {str(tmp_path)!r}); {code}", **folders)[0]

    assert [results(1), results(1), results(2), results(2)] == ["2 0\n", "2 1\n", "3 0\n", "3 1\n"]
