"""A hash of all code that a compiled function uses: its own code, its kernels and their constants.

Numba's cache checks only the file of the function that it stores. With this hash in the names of the files, an edit
compiles exactly the functions whose machine code may change.
"""

from __future__ import annotations

import functools
import hashlib
import re
import sys
from collections.abc import Iterator
from enum import Enum, EnumMeta
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np
from numba.core import types
from numba.core.extending import _Intrinsic
from numba.core.registry import CPUDispatcher

_ADDRESS = re.compile(r" at 0x[0-9a-f]+")
_FIXED = {*sys.stdlib_module_names, "llvmlite", "numba", "numpy"}  # packages whose content belongs to a version


def code_hash(function: FunctionType) -> str:
    """Returns the hash of a function that may call kernels. The modules of all these functions must be imported.

    The hash depends on the content of each function, and on which function calls which one.
    """
    numbers, reached, digest = {function: 0}, [function], hashlib.sha256()
    for one in reached:  # grows
        text, callees = _own(one)
        for callee in callees:
            if callee not in numbers:
                numbers[callee] = len(numbers)
                reached.append(callee)
        digest.update(text + repr([numbers[callee] for callee in callees]).encode())
    return digest.hexdigest()[:16]


@functools.cache
def _own(function: FunctionType) -> tuple[bytes, tuple[FunctionType, ...]]:
    """Returns the hash of a function alone, and the functions that it calls, in the order of their places in it."""
    callees: list[FunctionType] = []
    names = sorted(set(_names(function.__code__)))
    own = function.__qualname__, function.__code__, function.__defaults__, function.__kwdefaults__
    cells = [cell.cell_contents for cell in function.__closure__ or ()]
    reached = [*cells, *(function.__globals__[name] for name in names if name in function.__globals__)]
    modules: list[ModuleType] = []
    for value in reached:  # grows
        if isinstance(value, ModuleType) and value not in modules and not _is_fixed(value.__name__):
            modules.append(value)
            reached += [getattr(value, name) for name in names if hasattr(value, name)]
    text = "\n".join(token for value in (*own, *reached) for token in _tokens(value, callees))
    return hashlib.sha256(text.encode()).digest(), tuple(callees)


def _is_fixed(module: str) -> bool:
    return module.partition(".")[0] in _FIXED


def _names(code: CodeType) -> Iterator[str]:
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _names(constant)


def _tokens(value: Any, callees: list[FunctionType]) -> Iterator[str]:
    """Yields texts that are the same in each process, and differ if the machine code may differ."""
    if isinstance(value, CPUDispatcher):
        yield repr(sorted(value.targetoptions.items()))
        value = value.py_func
    if isinstance(value, _Intrinsic):
        value = value._defn
    if isinstance(value, FunctionType) and _is_fixed(value.__module__):
        yield f"calls {value.__module__}.{value.__qualname__}"
    elif isinstance(value, FunctionType):
        callees.append(value)
        yield "calls"
    elif isinstance(value, CodeType):
        variables = value.co_varnames, value.co_cellvars, value.co_freevars
        yield f"{value.co_code!r} {value.co_names} {variables} {value.co_argcount} {value.co_flags}"
        for k, constant in enumerate(value.co_consts):
            if k or not isinstance(constant, (str, type(None))):  # the first constant of a function is its docstring
                yield from _tokens(constant, callees)
    elif isinstance(value, (tuple, list)):
        yield f"{type(value).__name__} {len(value)} {getattr(value, '_fields', '')}"
        for item in value:
            yield from _tokens(item, callees)
    elif isinstance(value, dict):
        yield from _tokens([*value.items()], callees)
    elif isinstance(value, frozenset):  # its order differs from process to process
        yield f"set {sorted(map(repr, value))}"
    elif isinstance(value, np.ndarray):
        yield f"array {value.dtype!r} {value.shape} {value.tobytes()!r}"
    elif isinstance(value, Enum):
        yield f"{type(value).__name__}.{value.name}"
        yield from _tokens(value.value, callees)
    elif isinstance(value, EnumMeta):
        yield value.__name__
        for member in value.__members__.values():
            yield from _tokens(member, callees)
    elif hasattr(type(value), "code_parts"):  # an object that makes a kernel from these parts
        yield from _tokens(value.code_parts, callees)
    elif isinstance(value, (type, ModuleType, BuiltinFunctionType)):
        yield f"{value.__name__} {getattr(value, '_fields', '')} {getattr(value, '_field_defaults', '')}"
    else:
        yield f"{type(value).__name__} {_ADDRESS.sub('', repr(value))}"


def fields_of(kind: Any) -> Iterator[tuple[str, ...]]:
    """Yields the field names of the named tuples in a numba type. Numba compares only the classes."""
    if isinstance(kind, types.BaseNamedTuple):
        yield getattr(kind, "fields")  # noqa: B009  (numba declares no fields)
    items: Any = kind if isinstance(kind, (tuple, types.BaseTuple)) else ()
    for item in items:
        yield from fields_of(item)
