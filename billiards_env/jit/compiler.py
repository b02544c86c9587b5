"""Numba's compiler without the steps that this package does not need.

The first shot without a cache compiles more than a hundred functions. The docstrings give the slowdown of a cold start
if a part is left out. The start is a nine-ball break on `real_pool`, or, for "the planner", its first decisions on this
table.
"""

from __future__ import annotations

import functools
import gc
import sys
import threading
from typing import Any

from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, DefaultPassBuilder
from numba.core.datamodel.models import OpaqueModel
from numba.core.errors import TypingError
from numba.core.imputils import lower_constant
from numba.core.registry import CPUDispatcher
from numba.core.targetconfig import ConfigStack
from numba.core.typed_passes import NopythonRewrites
from numba.core.types import Dispatcher, unliteral
from numba.core.types.functions import BaseFunction
from numba.core.untyped_passes import InlineClosureLikes, LiteralPropagationSubPipelinePass, LiteralUnroll, WithLifting
from numba.extending import register_model

LONG = 2.0  # s; each compilation that takes longer prints a message

_UNUSED: Any = (WithLifting, InlineClosureLikes, LiteralUnroll, LiteralPropagationSubPipelinePass, NopythonRewrites)
"""Passes for code that no function of this package has, such as closures. They take 5% of the time."""

_signatures: dict[Any, Any] = {}
_resolve: Any = BaseFunction.get_call_type


def _resolve_once(self: Any, context: Any, args: Any, kws: Any) -> Any:
    """Returns the signature of a call of one of numba's functions, such as the sum of two floats.

    Numba tries ten implementations for each call in the source. Without this memory a cold start is 1.15 times as
    long.
    """
    flags = ConfigStack.top_or_none()
    key = self, context, tuple(args), tuple(kws.items()), flags is not None and flags.nrt
    if key not in _signatures:
        _signatures[key] = _resolve(self, context, args, kws)
    return _signatures[key]


def _announce() -> None:
    clear = "\r\x1b[K" if sys.stderr.isatty() else ""  # the line may hold a progress bar
    print(f"{clear}billiards_env: compiling, up to a minute ...", file=sys.stderr, flush=True)


class _Library(JITCodeLibrary):
    """The LLVM code of a function, and a list of all functions that it needs, each after its callers.

    LLVM links a function only if the code that is already linked calls it.
    """

    def add_linking_library(self, library: Any) -> None:
        if library in self._linking_libraries:
            self._linking_libraries.remove(library)
        super().add_linking_library(library)


class _KernelLibrary(_Library):
    """The LLVM code of one kernel, without the kernels that it calls. Entry points link, optimise and compile it.

    Numba's own library links, optimises and compiles each kernel separately: slowdown 1.6x. If each kernel is linked
    and optimised with the kernels that it calls, but not compiled, the slowdown of the planner is 1.2x.
    """

    def finalize(self) -> None:
        self._finalized = True

    def link(self) -> None:
        """Adds the code of the functions that the kernel calls, which is necessary only without an entry point."""
        for library in self._linking_libraries:
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)


class ShortCompiler(Compiler):
    """Numba's compiler with the libraries of this module, and a message for the user."""

    def define_pipelines(self) -> list[Any]:
        """Returns numba's passes without those that are not necessary."""
        passes: Any = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes.passes = [entry for entry in passes.passes if entry[0] not in _UNUSED]
        passes.finalize()
        return [passes]

    def compile_extra(self, func: Any) -> Any:
        """Compiles a function. If Python calls it and this takes long, prints a line."""
        flags: Any = self.state.flags
        library = _KernelLibrary if flags.no_cpython_wrapper else _Library
        self.state.library = library(self.state.targetctx.codegen(), func.__qualname__)
        self.state.library.enable_object_caching()
        if flags.no_cpython_wrapper:  # a kernel
            flags.no_compile = True
            return super().compile_extra(func)
        timer = threading.Timer(LONG, _announce)
        timer.daemon = True
        collects = gc.isenabled()
        gc.disable()  # numba keeps its objects; slowdown of the planner without this line: 1.1x
        timer.start()
        resolve: Any = BaseFunction.get_call_type
        BaseFunction.get_call_type = _resolve_once  # only here, where numba's lock is held
        try:
            return super().compile_extra(func)
        finally:
            BaseFunction.get_call_type = resolve
            timer.cancel()
            if collects:
                gc.enable()


class _GlobalKernel(Dispatcher):
    """The type of a kernel as a global name of its callers, without data.

    Numba's own type has the address of an object in this process, which the code in a file must not contain. Calls do
    not read it, but LLVM removes it only if it optimises, with `NUMBA_OPT` above 0.
    """


register_model(_GlobalKernel)(OpaqueModel)


@lower_constant(_GlobalKernel)
def _empty(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    return context.get_dummy_value()


class Kernel(CPUDispatcher):
    """A function that other compiled functions call. Slowdown without this class and `_KernelLibrary`: 2.0x.

    Its machine code and its wrapper for Python are compiled only at the first call from Python.
    """

    def __init__(self, py_func: Any, locals: Any, targetoptions: Any) -> None:
        super().__init__(py_func, locals, {**targetoptions, "no_cpython_wrapper": True}, ShortCompiler)

    @property
    def _numba_type_(self) -> _GlobalKernel:
        return _GlobalKernel(self)

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """Compiles the function for a call, once for all constants of a type. Without this, compiling takes 4% longer.

        Raises:
            TypingError: If the function returns arrays that it creates and its caller cannot free them.
        """
        plain = {name: unliteral(kind) for name, kind in kws.items()}
        call, caller = super().get_call_template(tuple(map(unliteral, args)), plain), ConfigStack.top_or_none()
        if self.targetoptions["_nrt"] and caller is not None and not caller.nrt:
            result = self.overloads[tuple(call[2])].signature.return_type
            if self.targetctx.data_model_manager[result].contains_nrt_meminfo():
                raise TypingError(f"call of {self.py_func.__qualname__}: expected a caller that may create arrays")
        return call

    def add_overload(self, cres: Any) -> None:
        """Stores a compiled function. Numba finds it by its entry point, for which its library stands."""
        needed = [cres.library, *cres.library._linking_libraries]  # callers link the kernels that it calls
        self.targetctx.insert_user_function(cres.library, cres.fndesc, needed)
        self.overloads[cres.signature.args] = cres._replace(entry_point=cres.library)

    @functools.cached_property
    def _for_python(self) -> CPUDispatcher:
        return CPUDispatcher(self.py_func, None, {**self.targetoptions, "no_cpython_wrapper": False}, ShortCompiler)

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        """Calls the function from Python."""
        return self._for_python(*args, **kwargs)
