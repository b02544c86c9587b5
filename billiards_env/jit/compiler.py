"""Numba's compiler without the steps that this package does not need.

The first shot without a cache compiles more than a hundred functions. Each docstring gives the slowdown of a cold
start without that part: of the first step of the default environment, and of a break of nine ball on `real_pool`.
"""

from __future__ import annotations

import functools
import sys
import threading
from typing import Any

from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.errors import TypingError
from numba.core.registry import CPUDispatcher
from numba.core.targetconfig import ConfigStack

LONG = 1.0  # s; a compilation that takes longer prints a message


@functools.cache
def _announce() -> None:
    clear = "\r\x1b[K" if sys.stderr.isatty() else ""  # the line may hold a progress bar
    print(f"{clear}billiards_env: compiling, up to a minute ...", file=sys.stderr, flush=True)


class _KernelLibrary(JITCodeLibrary):
    """The LLVM code of a kernel, compiled to machine code only as part of its callers. Slowdown without: 1.6x, 1.6x."""

    def _finalize_final_module(self) -> None:
        self._finalized = True


class _InlinedLibrary(_KernelLibrary):
    """The LLVM code of an inlined kernel, optimised only as part of its callers. Slowdown without: 1.1x, 1.2x."""

    def _optimize_final_module(self) -> None:
        pass


class ShortCompiler(Compiler):
    """Numba's compiler with the libraries of this module, and a message for the user."""

    def compile_extra(self, func: Any) -> Any:
        """Compiles a function. If Python calls it and this takes long, prints a line."""
        flags: Any = self.state.flags
        if flags.no_cpython_wrapper:  # a kernel
            flags.no_compile = True
            library = _InlinedLibrary if flags.forceinline else _KernelLibrary
            self.state.library = library(self.state.targetctx.codegen(), func.__qualname__)
            self.state.library.enable_object_caching()
            return super().compile_extra(func)
        timer = threading.Timer(LONG, _announce)
        timer.daemon = True
        timer.start()
        try:
            return super().compile_extra(func)
        finally:
            timer.cancel()


class Kernel(CPUDispatcher):
    """A function that other compiled functions call. Without it and the libraries: 2.0 and 2.0.

    Its machine code and its wrapper for Python are compiled only at the first call from Python.
    """

    def __init__(self, py_func: Any, locals: Any, targetoptions: Any) -> None:
        super().__init__(py_func, locals, {**targetoptions, "no_cpython_wrapper": True}, ShortCompiler)

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """Compiles the function for a call.

        Raises:
            TypingError: If the function may create arrays and its caller cannot. Nothing would free the arrays.
        """
        caller = ConfigStack.top_or_none()
        if self.targetoptions.get("_nrt", True) and caller is not None and not caller.nrt:
            raise TypingError(f"call of {self.py_func.__qualname__}: expected a caller that may create arrays")
        return super().get_call_template(args, kws)

    def add_overload(self, cres: Any) -> None:
        """Stores a compiled function. Numba finds it by its entry point, for which its library stands."""
        self.targetctx.insert_user_function(cres.library, cres.fndesc, [cres.library])
        self.overloads[cres.signature.args] = cres._replace(entry_point=cres.library)

    @functools.cached_property
    def _for_python(self) -> CPUDispatcher:
        return CPUDispatcher(self.py_func, None, {**self.targetoptions, "no_cpython_wrapper": False}, ShortCompiler)

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        """Calls the function from Python."""
        return self._for_python(*args, **kwargs)
