"""Kernels as arguments of entry points and of other kernels.

An entry point with the argument `judge` compiles a call of `judge(...)` as a call of the kernel that it gets. So what a
scene, a task or a game chooses is passed as kernels, alone or in named tuples. The machine code contains only these
kernels. Each choice is compiled once and kept in the cache.
"""

from __future__ import annotations

import functools
from typing import Any

from numba import typeof
from numba.core import types
from numba.core.datamodel.models import StructModel
from numba.core.typing.typeof import Purpose, typeof_impl
from numba.extending import NativeValue, register_model, unbox

from billiards_env.jit.code_hash import code_hash
from billiards_env.jit.compiler import Kernel

_types: dict[str, KernelType] = {}


class KernelType(types.Callable):
    """The numba type of one kernel as an argument. It has no data.

    Its name contains the hash of the kernel's code, so the same kernel has the same type in each process.
    """

    def __init__(self, name: str, kernel: Kernel | None = None) -> None:
        self._kernel: Any = kernel
        super().__init__(name)

    def get_call_type(self, context: Any, args: Any, kws: Any) -> Any:
        """Returns the signature of a call, which is compiled."""
        template, signature, args, kws = self._kernel.get_call_template(args, kws)
        return template(context).apply(args, kws).replace(pysig=signature)

    def get_call_signatures(self) -> tuple[Any, bool]:
        """Returns the compiled signatures."""
        return self._kernel.nopython_signatures, True

    def get_impl_key(self, sig: Any) -> Any:
        """Returns the compiled kernel for a signature."""
        return self._kernel.get_overload(sig.args)

    def __reduce__(self) -> tuple[Any, ...]:
        return _type_named, (self.name,)


@register_model(KernelType)
class _NoData(StructModel):
    """A structure without members. Compiled functions pass no argument for a kernel."""

    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, [])


@unbox(KernelType)
def _unbox(kind: Any, value: Any, c: Any) -> NativeValue:
    return NativeValue(c.context.get_constant_undef(kind))


def _type_named(name: str) -> KernelType:
    """Returns the type of a file in the cache. This process may not have its kernel."""
    return _types.get(name) or KernelType(name)


@functools.cache
def _type_of(kernel: Kernel) -> KernelType:
    name = f"{kernel.py_func.__name__}_{code_hash(kernel.py_func)}"
    return _types.setdefault(name, KernelType(name, kernel))


@typeof_impl.register(Kernel)
def _kind(value: Kernel, context: Any) -> Any:
    return _type_of(value) if context.purpose is Purpose.argument else value._numba_type_


@functools.cache
def typeof_kernels(value: Any) -> Any:
    """Returns the numba type of a kernel or of a tuple of kernels, None and such tuples.

    Raises:
        TypeError: If the value is something else.
    """
    _check(value)
    return typeof(value)


def _check(value: Any) -> None:
    if isinstance(value, tuple):
        for item in value:
            _check(item)
    elif not isinstance(value, Kernel | None):
        raise TypeError(f"value = {value!r}: expected kernels")
