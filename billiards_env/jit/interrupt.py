"""Ctrl-C during a long call of compiled code.

Python handles signals only between bytecode instructions, so it does not handle them while compiled code runs.
Therefore a loop that can run long calls `interrupted` regularly. This function lets Python handle its signals. In a
thread that helps with a call, it also checks whether the call has ended. If it returns True, a Python exception is set:
the loop then returns without a result, and the entry point raises the exception with `end_call`.

A check takes about a microsecond and waits for the interpreter's lock. Loops make one about every ten milliseconds.
"""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterator
from typing import Any

from llvmlite import ir
from numba.core import cgutils, config, types
from numba.extending import intrinsic

_own = threading.local()


class Stopped(Exception):
    """Stops a thread that helps with a call after the call has ended."""


@contextlib.contextmanager
def helping(stop: threading.Event) -> Iterator[None]:
    """Makes compiled code that this thread runs in the block raise `Stopped` after `stop` is set."""
    _own.stop = stop
    try:
        yield
    finally:
        _own.stop = None


def raise_if_stopped() -> None:
    """Raises `Stopped` if the call that this thread helps with has ended."""
    stop = getattr(_own, "stop", None)
    if stop is not None and stop.is_set():
        raise Stopped


_MODULE, _FUNCTION = raise_if_stopped.__module__, raise_if_stopped.__name__


def _look(context: Any, module: Any) -> Any:
    """Returns the LLVM function that `interrupted` calls, and defines it if the module does not contain it.

    It is not inlined: in a loop it would occupy registers, which made a timestep of PIT 40% slower.
    """
    pointer, number, nothing = cgutils.voidptr_t, ir.IntType(32), ir.VoidType()
    look = cgutils.get_or_insert_function(module, ir.FunctionType(cgutils.bool_t, []), "billiards_env_look")
    if not look.is_declaration:
        return look
    look.linkage = "internal"
    look.attributes.add("noinline")
    look.attributes.add("cold")
    builder = ir.IRBuilder(look.append_basic_block())

    def call(name: str, result: Any, *values: Any, variadic: bool = False) -> Any:
        kind = ir.FunctionType(result, [value.type for value in values], variadic)
        return builder.call(cgutils.get_or_insert_function(module, kind, name), values)

    is_interrupted = cgutils.alloca_once_value(builder, cgutils.true_bit)
    lock = call("PyGILState_Ensure", number)
    with builder.if_then(cgutils.is_null(builder, call("PyErr_CheckSignals", number))):
        home = call("PyImport_ImportModule", pointer, context.insert_const_string(module, _MODULE))
        with builder.if_then(cgutils.is_not_null(builder, home)):
            name = context.insert_const_string(module, _FUNCTION)
            result = call("PyObject_CallMethod", pointer, home, name, ir.Constant(pointer, None), variadic=True)
            builder.store(cgutils.is_null(builder, result), is_interrupted)
            call("Py_DecRef", nothing, result)
            call("Py_DecRef", nothing, home)
    call("PyGILState_Release", nothing, lock)
    builder.ret(builder.load(is_interrupted))
    return look


@intrinsic
def _interrupted(typing_context: Any) -> Any:  # pyright: ignore[reportUnusedParameter]
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.call(_look(context, builder.module), [])

    return types.boolean(), generate


@intrinsic
def _end_call(typing_context: Any, ending: Any) -> Any:  # pyright: ignore[reportUnusedParameter]
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        with builder.if_then(arguments[0], likely=False):
            context.call_conv.return_exc(builder)
        return context.get_dummy_value()

    return types.none(types.boolean), generate


def _never() -> bool:
    """Replaces `interrupted` if nothing is compiled: Python then handles signals without help."""
    return False


def _go_on(ending: bool) -> None:
    pass


_config: Any = config  # numba defines its attributes at run time
interrupted: Any = _never if _config.DISABLE_JIT else _interrupted
end_call: Any = _go_on if _config.DISABLE_JIT else _end_call
