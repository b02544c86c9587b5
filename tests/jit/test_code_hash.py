"""The hash of the code that a compiled function reaches, which is in the names of its files on disk."""

import re
import sys
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import typeof

from billiards_env.engine import PIC, Engine
from billiards_env.engine.compile import run_shots_of
from billiards_env.jit import inlined
from billiards_env.jit.code_hash import _own, code_hash, fields_of
from billiards_env.scene import Scene

KERNELS = '''
import math
from typing import NamedTuple
from billiards_env.jit import entry_point, inlined
import kernels_of_a_test.constants
from kernels_of_a_test import constants
from kernels_of_a_test.constants import PLACES, REACH

class Way(NamedTuple):
    x: float
    y: float

@inlined
def gap(x):
    """Returns the gap."""
    return x - REACH

@inlined
def unused(x):
    return 2.0 * x

def by_law(one, other):
    @inlined
    def call(x):
        return one(x) + other(x)
    return call

shifted = by_law(gap, gap)

@entry_point
def run(x):
    """Runs."""
    way = Way(shifted(x), constants.SIZE)
    return math.sqrt(way.x) + PLACES[1] + kernels_of_a_test.constants.DEEP
'''
CONSTANTS = "REACH = 2.0\nSIZE = 3\nPLACES = (1, 2)\nDEEP = 5\nOTHER = 4\n"


def made(monkeypatch, *edits: tuple[str, str]) -> str:
    """Returns the hash of `run` after edits of the two modules, with a line before everything."""
    package, modules = ModuleType("kernels_of_a_test"), {}
    monkeypatch.setitem(sys.modules, package.__name__, package)
    for name, text in (("constants", CONSTANTS), ("kernels", KERNELS)):
        for old, new in edits:
            text = text.replace(old, new)
        module: Any = ModuleType(f"{package.__name__}.{name}")
        monkeypatch.setitem(sys.modules, module.__name__, module)
        setattr(package, name, module)
        exec(compile("\n" * len(edits) + text, f"{name}.py", "exec"), vars(module))
        modules[name] = module
    run = modules["kernels"].run
    return code_hash(getattr(run, "py_func", run))


CHANGES = [
    ("x - REACH", "x + REACH"),
    ("x - REACH", "REACH - x"),
    ("REACH = 2.0", "REACH = 2.5"),
    ("REACH = 2.0", "REACH = 2"),
    ("SIZE = 3", "SIZE = 4"),
    ("DEEP = 5", "DEEP = 6"),
    ("(1, 2)", "(1, 3)"),
    ("by_law(gap, gap)", "by_law(gap, unused)"),
    ("one(x) + other(x)", "one(x) - other(x)"),
    ("math.sqrt", "math.sin"),
    ("x: float\n    y: float", "y: float\n    x: float"),
    ("def gap(x)", "def gap(x, y=1.0)"),
]


@pytest.mark.parametrize("edit", CHANGES)
def test_an_edit_of_code_that_is_reached_changes_the_hash(monkeypatch, edit):
    assert made(monkeypatch, edit) != made(monkeypatch)


PROGRAM = """
from enum import IntEnum
from billiards_env.jit import entry_point, inlined

class Law(IntEnum):
    ONE = {enum}

def scaled(by):
    @inlined
    def call(x):
        return by * x
    return call

def chain(kernels, shift={default}):
    @inlined
    def last(x):
        return x + shift
    call = last
    for kernel in kernels:
        call = after(kernel, call)
    return call

def after(kernel, rest):
    @inlined
    def call(x):
        return rest(kernel(x) + 1.0)
    return call

def loop(module):
    @inlined
    def call(x):
        return module.near(x) - 2.0 * module.far(x)
    return call

near, far = scaled({near}), scaled({far})
table = chain([scaled(by) for by in {table}])
ways = loop(MODULE)

@entry_point
def run(x):
    return near(x) - 3.0 * far(x) + 5.0 * table(x) + 7.0 * ways(x) + Law.ONE * PAIR[1]
"""

SIZES = st.integers(1, 4).map(float)
PARTS = {
    "near": SIZES,
    "far": SIZES,
    "enum": st.integers(1, 4),
    "default": SIZES,
    "table": st.lists(SIZES, max_size=3),
    "module": st.tuples(SIZES, SIZES),
    "pair": st.tuples(SIZES, SIZES),
}


def program(parts: dict[str, Any]) -> tuple[str, float]:
    """Returns the hash of a program, and its result in Python."""
    results = []
    for decorated in (True, False):
        text = PROGRAM if decorated else re.sub(r"@(inlined|entry_point)\n", "\n", PROGRAM)
        module: Any = ModuleType("program_of_a_test")
        pair = ModuleType("pair_of_a_test")
        exec("def scaled(by):\n    def call(x):\n        return by * x\n    return call", vars(pair))
        near, far = (pair.scaled(by) for by in parts["module"])
        vars(pair).update(near=inlined(near) if decorated else near, far=inlined(far) if decorated else far)
        vars(module).update(MODULE=pair, PAIR=parts["pair"])
        exec(text.format(**parts), vars(module))
        results.append(module.run)
    return code_hash(getattr(results[0], "py_func", results[0])), results[1](1.5)


@settings(max_examples=150, deadline=None)
@given(one=st.fixed_dictionaries(PARTS), part=st.sampled_from([*PARTS]), data=st.data())
def test_an_edit_that_changes_the_result_changes_the_hash(one, part, data):
    """Closures of one factory, chains, tables, modules, enums and tuples: an edit may also exchange two of them."""
    other = {**one, part: data.draw(PARTS[part])}
    if data.draw(st.booleans()):
        other = {**one, "near": one["far"], "far": one["near"], "table": one["table"][::-1]}
    (first, result), (second, changed) = program(one), program(other)
    assert first == program(one)[0]
    assert first != second or result == changed


OTHERS = [
    ("2.0 * x", "3.0 * x"),
    ("OTHER = 4", "OTHER = 5"),
    ('"""Returns the gap."""', '"""Returns the distance."""'),
    ('"""Runs."""', "# runs"),
    ("import math\n", "import math\nimport os\n\n"),
]


@pytest.mark.parametrize("edit", OTHERS)
def test_other_edits_do_not_change_the_hash(monkeypatch, edit):
    assert made(monkeypatch, edit) == made(monkeypatch)


@pytest.mark.parametrize("engine", [PIC, Engine("pit", dt=0.01)])
def test_engines_do_not_depend_on_rules_and_environments(engine):
    """So an edit of a rule, a task or a feature compiles no engine."""
    waiting, reached = [], set()
    parts: list[Any] = [*run_shots_of(Scene.named("pool", 2), engine)]
    for part in parts:  # grows
        if isinstance(part, tuple):
            parts += part
        elif part is not None:
            waiting.append(getattr(part, "py_func", part))
    while waiting:
        function = waiting.pop()
        if function not in reached:
            reached.add(function)
            waiting += _own(function)[1]
    rooms = {function.__module__.split(".")[1] for function in reached}
    assert rooms <= {"engine", "jit", "physics"}
    assert len(reached) > 100


class Place(NamedTuple):
    x: float
    y: float


def test_types_contain_the_names_of_fields():
    kind = typeof((1.0, Place(0.0, 0.0), (np.zeros(1), Place(1.0, 2.0))))
    assert list(fields_of(kind)) == [("x", "y")] * 2


@pytest.mark.parametrize(
    "edit", [("x * x * k", "x * k"), ('constant=("k",)', "constant=()"), ("norm(x, k)", "norm(k, x)")]
)
def test_the_tangent_of_an_edited_kernel_is_compiled_again(edit):
    text = """
from billiards_env.derivatives.tangent import tangent_of
from billiards_env.jit import entry_point, inlined
from billiards_env.physics.elementary import norm

@inlined
def law(x, k):
    return x * x * k + norm(x, k)

change = tangent_of(law, constant=("k",))

@entry_point
def run(x, dx, k):
    return change(x, dx, k)
"""

    def hash_of(text):
        module = ModuleType("law_of_a_test")
        exec(text, vars(module))
        return code_hash(module.run.py_func)

    assert hash_of(text) == hash_of(text)
    assert hash_of(text) != hash_of(text.replace(*edit))
