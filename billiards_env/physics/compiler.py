"""Numba's compiler without the work that the functions of this package do not need.

The first shot without a cache compiles 130 functions. Most of the time is spent in Python, in numba. The classes of
this module replace parts of numba that its documentation does not cover, so `pyproject.toml` has an upper bound on its
version.
"""

from __future__ import annotations

import functools
import operator
from typing import Any

from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, DefaultPassBuilder, Flags
from numba.core.compiler_machinery import PassManager
from numba.core.errors import TypingError
from numba.core.registry import CPUDispatcher
from numba.core.sigutils import normalize_signature
from numba.core.targetconfig import ConfigStack
from numba.core.typed_passes import NopythonRewrites
from numba.core.types import unliteral
from numba.core.untyped_passes import InlineClosureLikes

# These passes are for functions defined in a function, comprehensions, and expressions of whole arrays.
_SKIPPED = (InlineClosureLikes, NopythonRewrites)

# `contains` is left out, because numba compiles its code with the options of the caller.
_OPERATORS = {bool, *(f for f in vars(operator).values() if callable(f))} - {operator.contains}


class _Flags(Flags):
    """Numba's options of a compilation, with a faster comparison.

    Numba compares them several times for every operator, and looks up each of the options by its name.
    """

    __slots__ = ()

    def __eq__(self, other: object) -> bool:
        return self._values == other._values if isinstance(other, _Flags) else super().__eq__(other)

    def __hash__(self) -> int:
        return hash(frozenset(self._values))


class _TypingContext:
    """Numba's typing context, which finds the signature of an operator once for the same types of operands.

    Numba would try about twenty implementations each time the operator occurs.
    """

    def __init__(self, context: Any) -> None:
        self._context = context
        self._signatures: dict[Any, Any] = {}

    def __getattr__(self, name: str) -> Any:
        return getattr(self._context, name)

    def resolve_function_type(self, func: Any, args: Any, kws: Any) -> Any:
        """Returns the signature of a call."""
        if kws or func not in _OPERATORS:
            return self._context.resolve_function_type(func, args, kws)
        key = func, tuple(args)
        if key not in self._signatures:
            self._signatures[key] = self._context.resolve_function_type(func, args, kws)
        return self._signatures[key]


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
    """The LLVM code of a kernel. Callers link it into their own code, so it is not translated to machine code.

    Numba would translate every kernel, which takes a tenth of the time until the first shot. It would also optimise a
    kernel in three steps; the last one is enough, because the callers optimise it again with their own code.
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
        """Returns 0, the address of a function without machine code: a kernel can be called but not used as a value."""
        self._ensure_finalized()
        return 0

    @property
    def codegen(self) -> Any:
        """The object whose `set_env` numba calls after it compiles a function."""
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

    Its machine code and its wrapper for Python are compiled only at the first call from Python. Numba would compile a
    wrapper with every function, which takes a quarter of the time until the first shot.
    """

    _compiler: Any

    def __init__(self, function: Any, options: dict[str, Any]) -> None:
        options = {**options, "no_cpython_wrapper": True}
        super().__init__(function, targetoptions=options, pipeline_class=_KernelCompiler)

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """Compiles the function for a call. Numba would compile it once more for arguments that are constants.

        Raises:
            TypingError: If the function may create arrays, and its caller cannot. The arrays would never be freed.
        """
        if self.targetoptions.get("_nrt", True) and not ConfigStack().top().nrt:
            raise TypingError(f"call of {self.py_func.__qualname__}: expected a caller that may create arrays")
        return super().get_call_template([unliteral(a) for a in args], {k: unliteral(a) for k, a in kws.items()})

    def compile(self, sig: Any) -> Any:
        """Compiles the function for types of arguments. Numba would also measure the time of each step."""
        args, return_type = normalize_signature(sig)
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
