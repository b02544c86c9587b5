"""Numba's compiler without the steps that this package does not need.

The first shot without a cache compiles more than a hundred functions. Numba's own Python code takes most of this time.
"""

from __future__ import annotations

import functools
import operator
from typing import Any

from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, DefaultPassBuilder, Flags
from numba.core.compiler_lock import global_compiler_lock
from numba.core.compiler_machinery import PassManager
from numba.core.errors import TypingError
from numba.core.registry import CPUDispatcher
from numba.core.sigutils import normalize_signature
from numba.core.targetconfig import ConfigStack
from numba.core.typed_passes import NopythonRewrites
from numba.core.types import unliteral
from numba.core.untyped_passes import InlineClosureLikes

# Without these passes a compiled function must not contain comprehensions or other functions.
_SKIPPED = (InlineClosureLikes, NopythonRewrites)

_OPERATORS = {bool, *(f for f in vars(operator).values() if callable(f))}


class _Flags(Flags):
    """Numba's options of a compilation, with a faster comparison.

    Two objects are equal if the same options are set to the same values. Numba compares options several times for every
    operator, and its comparison reads each option by its name.
    """

    __slots__ = ()

    def __eq__(self, other: object) -> bool:
        return self._values == other._values if isinstance(other, _Flags) else super().__eq__(other)

    def __hash__(self) -> int:
        return hash(frozenset(self._values))


class _TypingContext:
    """Numba's typing context, which stores the signatures of operators.

    Numba would try many implementations each time that an operator occurs.
    """

    def __init__(self, context: Any) -> None:
        self._context = context
        self._signatures: dict[Any, Any] = {}

    def __getattr__(self, name: str) -> Any:
        return getattr(self._context, name)

    def resolve_function_type(self, func: Any, args: Any, kws: Any) -> Any:
        """Returns the signature of a call, or None if there is none."""
        key = None
        if not kws and getattr(func, "typing_key", func) in _OPERATORS:
            # Numba compiles some operators with the options of their caller.
            key = func, tuple(args), ConfigStack.top_or_none()
            if key in self._signatures:
                return self._signatures[key]
        signature = self._context.resolve_function_type(func, args, kws)
        if key is not None and signature is not None:
            self._signatures[key] = signature
        return signature


_typing_context = functools.cache(_TypingContext)


class ShortCompiler(Compiler):
    """Numba's compiler without the passes of `_SKIPPED`."""

    def __init__(
        self, typingctx: Any, targetctx: Any, library: Any, args: Any, return_type: Any, flags: Any, locals: Any
    ):
        super().__init__(_typing_context(typingctx), targetctx, library, args, return_type, _Flags(flags), locals)

    def define_pipelines(self) -> list[PassManager]:
        """Returns the passes of a compilation."""
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes.passes = [step for step in passes.passes if step[0] not in _SKIPPED]
        passes.finalize()
        return [passes]


class _KernelLibrary(JITCodeLibrary):
    """The LLVM code of a kernel. Callers link it into their own code, so numba does not translate it to machine code.

    Numba translates every function, and optimises it three times. Here only the last optimisation runs, because the
    callers optimise the code again.
    """

    def _optimize_functions(self, ll_module: Any) -> None:
        ll_module.data_layout = self._codegen._data_layout

    def _optimize_final_module(self) -> None:
        manager, builder = self._codegen._module_pass_manager()
        manager.run(self._final_module, builder)

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """Returns 0. A kernel has no machine code, so compiled code can call it but cannot use it as a value."""
        self._ensure_finalized()
        return 0

    @property
    def codegen(self) -> Any:
        """This object. Numba calls `codegen.set_env` after a compilation."""
        return self

    def set_env(self, name: str, environment: Any) -> None:
        """Does nothing. A kernel has no environment, so it cannot print objects or format the text of an exception."""


class _KernelCompiler(ShortCompiler):
    """A `ShortCompiler` with a `_KernelLibrary`."""

    def compile_extra(self, func: Any) -> Any:
        """Compiles a function."""
        self.state.library = _KernelLibrary(self.state.targetctx.codegen(), func.__qualname__)
        return super().compile_extra(func)


class Kernel(CPUDispatcher):
    """A function that other compiled functions call.

    Its machine code and its wrapper for Python are compiled only at the first call from Python.
    """

    _compiler: Any

    def __init__(self, py_func: Any, locals: Any = None, targetoptions: Any = None) -> None:
        options = {**(targetoptions or {}), "no_cpython_wrapper": True}
        super().__init__(py_func, locals, options, _KernelCompiler)

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """Compiles the function for a call. Constants have the type of their value, so they need no other compilation.

        Raises:
            TypingError: If the function may create arrays, and its caller cannot. The arrays would never be freed.
        """
        caller = ConfigStack.top_or_none()
        if self.targetoptions.get("_nrt", True) and caller is not None and not caller.nrt:
            raise TypingError(f"call of {self.py_func.__qualname__}: expected a caller that may create arrays")
        return super().get_call_template([unliteral(a) for a in args], {k: unliteral(a) for k, a in kws.items()})

    def compile(self, sig: Any) -> Any:
        """Compiles the function for these types of arguments, without the timers and the cache of numba's method."""
        args, return_type = normalize_signature(sig)
        with global_compiler_lock:
            if args not in self.overloads:
                with self._compiling_counter:
                    self.add_overload(self._compiler.compile(args, return_type))
        return self.overloads[args].entry_point

    @functools.cached_property
    def _for_python(self) -> CPUDispatcher:
        options = {**self.targetoptions, "no_cpython_wrapper": False}
        return CPUDispatcher(self.py_func, targetoptions=options, pipeline_class=ShortCompiler)

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        """Calls the function from Python."""
        return self._for_python(*args, **kwargs)
