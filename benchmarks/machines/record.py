"""Records calls of compiled functions, and compiles the functions for aarch64, on this machine.

`python -m benchmarks.machines.record record FOLDER NAME ...` does the work of these names (`work`) and writes the
arguments and results of all calls of compiled functions to `FOLDER/calls`. With `cross` in place of `record` numba
compiles the functions for aarch64, into NUMBA_CACHE_DIR. Their calls are not executed: the results come from the file.
The LLVM code of each function is written to `FOLDER/ir` before it is optimised, for other targets (`replay`).
"""

from __future__ import annotations

import copy
import functools
import gc
import json
import pickle
import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple
from unittest.mock import patch

import llvmlite.binding as llvm
import numpy as np
from numba.core.codegen import CPUCodeLibrary, JITCPUCodegen
from numba.core.registry import cpu_target

from billiards_env.jit.compiler import Kernel, _Library
from billiards_env.jit.decorators import EntryPoint

PACKAGE = "billiards_env."
TRIPLE = "aarch64-unknown-linux-gnu"
_COUNTING = re.compile(
    r"^define linkonce_odr (\w+ @(?:NRT_(?:inc|dec)ref|nrt_atomic)\w*\(.*?\)).*?^}", re.MULTILINE | re.DOTALL
)
"""Functions that count references. LLVM has already made them for the target."""


class Call(NamedTuple):
    """A call of a compiled function. Equal arrays of all calls are one object; kernels, which have no data, are ().

    Attributes:
        name: The function.
        number: The number of its machine code, in the order of the first calls; -1 for a kernel.
        arguments: The arguments, tuples of arrays, numbers and None.
        addresses: The addresses of the arrays in the arguments.
        after: The arrays after the call.
        result: The result.
        error: The exception.
    """

    name: str
    number: int
    arguments: Any
    addresses: list[int]
    after: list[Any]
    result: Any
    error: BaseException | None


class Calls:
    """Recorded calls, and their arrays by content."""

    def __init__(self) -> None:
        self.arrays: dict[Any, Any] = {}
        self.calls: list[Call] = []

    def copied(self, value: Any) -> Any:
        """Returns a copy of an argument or a result."""
        if isinstance(value, np.ndarray):
            array = np.ascontiguousarray(value)
            return self.arrays.setdefault((array.tobytes(), str(array.dtype), array.shape), array.copy())
        if isinstance(value, (tuple, list)):
            return tuple(map(self.copied, value))
        return () if isinstance(value, Kernel) else value

    def record(self, name: str, number: int, code: Callable[..., Any], *arguments: Any) -> Any:
        """Calls `code` and stores the call."""
        before, result, error = self.copied(arguments), None, None
        arrays = [*arrays_of(arguments)]
        try:
            result = code(*arguments)
        except BaseException as raised:
            error = raised
        after, addresses = [*map(self.copied, arrays)], [array.ctypes.data for array in arrays]
        self.calls.append(Call(name, number, before, addresses, after, self.copied(result), error))
        if error is not None:
            raise error
        return result

    def answer(self, name: str, number: int, code: Callable[..., Any], *arguments: Any) -> Any:
        """Changes the arguments and returns the result as the last stored call did, and forgets this call."""
        call = self.calls.pop()
        assert (call.name, call.number) == (name, number)
        for array, after in zip(arrays_of(arguments), call.after, strict=True):
            if array.flags.writeable:
                array[...] = after
        if call.error is not None:
            raise call.error
        return copy.deepcopy(call.result)


def load(folder: Path) -> list[Call]:
    """Returns the calls in a folder."""
    return [Call(*call) for call in pickle.loads((folder / "calls").read_bytes())]


def arrays_of(value: Any) -> Iterator[Any]:
    """Yields the arrays in an argument."""
    if isinstance(value, np.ndarray):
        yield value
    elif isinstance(value, (tuple, list)):
        for item in value:
            yield from arrays_of(item)


def name_of(function: Any) -> str:
    """Returns the module and the name of a compiled function."""
    return f"{function.py_func.__module__}.{function.py_func.__qualname__}"


def intercept(call: Callable[..., Any], compiled: Callable[[Any, Any, int], Any]) -> None:
    """Replaces each call of compiled functions from Python by one of `call(name, number, code, *arguments)`."""
    codes: dict[Any, Any] = {}

    def code(self: Any, signature: Any) -> Any:
        kinds = tuple(getattr(signature, "args", signature))
        if (self, kinds) not in codes:
            name, number = name_of(self), len(codes)
            codes[self, kinds] = functools.partial(call, name, number, compiled(self, kinds, number))
        return codes[self, kinds]

    def from_python(self: Any, *arguments: Any) -> Any:
        return code(self, map(self.typeof_pyval, arguments))(*arguments)

    def kernel(self: Any, *arguments: Any) -> Any:
        return call(name_of(self), -1, functools.partial(called, self), *arguments)

    called: Any = Kernel.__call__
    entry_point: Any = EntryPoint
    entry_point.compile, entry_point.__call__ = code, from_python
    Kernel.__call__ = kernel


def target_aarch64() -> None:
    """Makes numba compile for aarch64 from now on. Nothing may be compiled yet."""
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    from_triple = functools.partial(llvm.Target.from_triple, TRIPLE)
    triple = patch.object(llvm, "get_process_triple", lambda: TRIPLE)
    with triple, patch.object(llvm.Target, "from_default_triple", from_triple):
        context: Any = cpu_target.target_context
        context._internal_codegen = JITCPUCodegen("numba.exec")


def write_code(folder: Path, compile: Any, entry: Any, kinds: Any, number: int) -> None:
    """Compiles an entry point with numba, and writes its LLVM code and how to call it.

    Numba optimises functions before it links them. Here they are optimised after they are linked, because this
    optimisation uses properties of the target.
    """
    optimise_functions: Any = CPUCodeLibrary._optimize_functions
    optimise: Any = CPUCodeLibrary._optimize_final_module

    def optimise_all(self: Any) -> None:
        if isinstance(self, _Library):  # not numba's own functions, which are linked with it
            (folder / f"{number}.ll").write_text(
                _COUNTING.sub(r"declare \1", str(self._final_module)), encoding="utf-8"
            )
            optimise_functions(self, self._final_module)
            optimise(self)

    early = patch.object(CPUCodeLibrary, "_optimize_functions", lambda *_: None)
    with early, patch.object(CPUCodeLibrary, "_optimize_final_module", optimise_all):
        compile(entry, kinds)
    compiled = entry.overloads[kinds]
    result = entry.targetctx.data_model_manager[compiled.signature.return_type].get_return_type()
    about = {"function": compiled.fndesc.llvm_func_name, "result": str(result), "leaves": list(leaves_of(result))}
    (folder / f"{number}.json").write_text(json.dumps(about), encoding="utf-8")


def leaves_of(kind: Any, path: tuple[int, ...] = ()) -> Iterator[tuple[tuple[int, ...], str]]:
    """Yields the places and types of the numbers in an LLVM type."""
    elements = getattr(kind, "elements", None) or [kind.element] * kind.count if hasattr(kind, "count") else None
    if elements is None:
        yield path, str(kind)
    for k, element in enumerate(elements or ()):
        yield from leaves_of(element, (*path, k))


def main(mode: str, folder: Path, names: list[str]) -> None:
    """Does the work of `names`; see the module."""
    from benchmarks.machines import work

    path, calls, own = folder / "calls", Calls(), EntryPoint.compile
    if mode == "record":
        intercept(calls.record, lambda entry, kinds, number: own(entry, kinds))
    else:
        target_aarch64()
        calls.calls = load(folder)[::-1]
        intercept(calls.answer, lambda *one: write_code(folder / "ir", own, *one))
    work.main(folder / f"{mode} results", names)
    if mode == "record":
        path.write_bytes(pickle.dumps([*map(tuple, calls.calls)], protocol=4))
        entries = {name_of(entry) for entry in gc.get_objects() if isinstance(entry, EntryPoint)}
        left = sorted(entries - {call.name for call in calls.calls})
        print(json.dumps([name[len(PACKAGE) :] for name in left if name.startswith(PACKAGE)]))


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]), sys.argv[3:])
