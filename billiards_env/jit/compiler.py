"""Numba's compiler without the steps that this package does not need.

The first shot without a cache compiles more than a hundred functions. Numba's own Python code takes most of this time.
"""

from __future__ import annotations

import functools
import operator
from typing import Any

from llvmlite.binding import Linkage
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, DefaultPassBuilder, Flags
from numba.core.compiler_lock import global_compiler_lock
from numba.core.compiler_machinery import PassManager
from numba.core.cpu import CPUContext
from numba.core.datamodel.manager import DataModelManager
from numba.core.datamodel.models import TupleModel
from numba.core.errors import TypingError
from numba.core.registry import CPUDispatcher
from numba.core.sigutils import normalize_signature
from numba.core.targetconfig import ConfigStack
from numba.core.typed_passes import NopythonRewrites
from numba.core.types import Array, NamedTuple, unliteral
from numba.core.untyped_passes import InlineClosureLikes, InlineInlinables

# Without these passes a compiled function must not contain comprehensions or other functions, and no function is
# inlined in the source of another.
_SKIPPED = (InlineClosureLikes, InlineInlinables, NopythonRewrites)

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
            types = tuple(args)
            if types and isinstance(types[0], Array):
                types = tuple(unliteral(t) for t in types)  # numba ignores the values of constants here
            # Numba compiles some operators with the options of their caller.
            key = func, types, ConfigStack.top_or_none()
            if key in self._signatures:
                return self._signatures[key]
        signature = self._context.resolve_function_type(func, args, kws)
        if key is not None and signature is not None:
            self._signatures[key] = signature
        return signature


_typing_context = functools.cache(_TypingContext)


class _Whole(TupleModel):
    """A NamedTuple with fields of different types, passed to functions as one LLVM structure.

    Numba passes every word of every array as a separate argument. The code that takes the NamedTuple apart and builds
    it again would be a fifth of the code of the kernels. Numba's own compiled functions, such as `hash`, cannot have
    such an argument.
    """

    def get_argument_type(self) -> Any:
        """Returns the LLVM type of an argument."""
        return self.get_value_type()

    def as_argument(self, builder: Any, value: Any) -> Any:
        """Returns the argument that passes `value`."""
        return value

    def from_argument(self, builder: Any, value: Any) -> Any:
        """Returns the value that an argument passes."""
        return value

    def as_return(self, builder: Any, value: Any) -> Any:
        """Returns the LLVM structure that a function stores as its result. A bool has another type there."""
        return value if self.get_value_type() == self.get_data_type() else super().as_return(builder, value)

    def from_return(self, builder: Any, value: Any) -> Any:
        """Returns the value of a result."""
        return value if self.get_value_type() == self.get_data_type() else super().from_return(builder, value)


class _TargetContext(CPUContext):
    """Numba's context of code generation, with `_Whole` NamedTuples and without repeated work.

    It shares all other data with numba's context.
    """

    def __init__(self, context: CPUContext) -> None:
        vars(self).update(vars(context))
        self.cached_internal_func: dict[Any, Any] = {}
        self.data_model_manager = DataModelManager({NamedTuple: _Whole}).chain(context.data_model_manager)
        self._sizes: dict[Any, int] = {}

    def get_function(self, fn: Any, sig: Any, _firstcall: bool = False) -> Any:
        """Returns the code generator of a function.

        If numba finds none, it refreshes its registries and searches again. Type inference has refreshed them already.
        """
        return super().get_function(fn, sig, _firstcall=False)

    def get_abi_sizeof(self, ty: Any) -> int:
        """Returns the size of an LLVM type, bytes. Numba would make a module to find it, for every use of an array."""
        if ty not in self._sizes:
            self._sizes[ty] = super().get_abi_sizeof(ty)
        return self._sizes[ty]


_target_context = functools.cache(_TargetContext)


class _Library(JITCodeLibrary):
    """The LLVM code of a function, optimised once. Numba optimises three times, to remove more reference counts."""

    def _optimize_functions(self, ll_module: Any) -> None:
        ll_module.data_layout = self._codegen._data_layout

    def _optimize_final_module(self) -> None:
        manager, builder = self._codegen._module_pass_manager()
        manager.run(self._final_module, builder)


class _KernelLibrary(_Library):
    """The LLVM code of a kernel. Callers link it into their own code, so numba does not translate it to machine code.

    The entry point that contains the code verifies it and optimises it again.

    Attributes:
        inlined: Whether the callers inline the code. Then only they optimise it.
    """

    inlined = False

    def finalize(self) -> None:
        """Links the functions that the kernel calls, and optimises them together."""
        functions = self._final_module.functions
        own = [f.name for f in functions if not f.is_declaration and f.linkage == Linkage.external]
        for library in dict.fromkeys(self._linking_libraries):
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        if not self.inlined:
            self._optimize_final_module()
        for name in own:
            self._final_module.get_function(name).linkage = "linkonce_odr"  # several callers may have a copy
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


class ShortCompiler(Compiler):
    """Numba's compiler without the passes of `_SKIPPED`, and with a `_Library`."""

    def __init__(
        self, typingctx: Any, targetctx: Any, library: Any, args: Any, return_type: Any, flags: Any, locals: Any
    ):
        typingctx, targetctx, flags = _typing_context(typingctx), _target_context(targetctx), _Flags(flags)
        super().__init__(typingctx, targetctx, library, args, return_type, flags, locals)

    def make_library(self, name: str) -> _Library:
        """Returns the empty library of the function."""
        return _Library(self.state.targetctx.codegen(), name)

    def compile_extra(self, func: Any) -> Any:
        """Compiles a function."""
        self.state.library = self.make_library(func.__qualname__)
        self.state.library.enable_object_caching()
        return super().compile_extra(func)

    def define_pipelines(self) -> list[PassManager]:
        """Returns the passes of a compilation."""
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes.passes = [step for step in passes.passes if step[0] not in _SKIPPED]
        passes.finalize()
        return [passes]


class _KernelCompiler(ShortCompiler):
    """A `ShortCompiler` for a function that has no machine code of its own."""

    def make_library(self, name: str) -> _Library:
        """Returns the empty library of the function."""
        library = _KernelLibrary(self.state.targetctx.codegen(), name)
        library.inlined = self.state.flags.forceinline
        return library


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
            TypingError: If numba's own compiler compiles the caller, which then passes NamedTuples in another way. If
                the function may create arrays and its caller cannot; nothing would free the arrays.
        """
        caller = ConfigStack.top_or_none()
        if caller is not None and not isinstance(caller, _Flags):
            raise TypingError(
                f"call of {self.py_func.__qualname__}: expected a caller with a decorator of billiards_env.jit"
            )
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
