"""Decorators that compile functions with numba, with strict IEEE arithmetic and a cache on disk.

Compiled functions call functions with `kernel`, `inlined` or `allocating`. Python calls functions with `entry_point`.
This module and `jit.compiler` use undocumented parts of numba, such as `_nrt` and the dispatcher, so `pyproject.toml`
has an upper bound on its version.
"""

from __future__ import annotations

import contextlib
import functools
import os
import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeVar

from numba.core import config as _numba_config
from numba.core.caching import (
    CompileResultCacheImpl,
    FunctionCache,
    IndexDataCacheFile,
    NullCache,
    UserProvidedCacheLocator,
)
from numba.core.errors import NumbaError
from numba.core.registry import CPUDispatcher

from billiards_env.jit.code_hash import code_hash, fields_of
from billiards_env.jit.compiler import Kernel, ShortCompiler
from billiards_env.jit.folders import cache_folder, shipped_folder
from billiards_env.jit.kernel_types import typeof_kernels

F = TypeVar("F", bound=Callable[..., Any])

_FOLDER, _SHIPPED = cache_folder(), shipped_folder()
_config: Any = _numba_config  # numba defines its attributes at run time
GENERIC = "generic", ""  # NUMBA_CPU_NAME and the CPU features of the code in the package


class _Locator(UserProvidedCacheLocator):
    """The folder and the names of the files of a `_Cache`. The folder may be missing.

    The names contain the hash of all code that the function reaches, so an edit elsewhere compiles nothing.
    """

    def __init__(self, py_func: Any, py_file: str) -> None:
        self._hash, self._py_file = code_hash(py_func), py_file  # numba's warnings name the file
        self._cache_path = os.path.join(_FOLDER or "", py_func.__module__.rpartition(".")[0])

    def get_source_stamp(self) -> bytes:
        return self._hash.encode()

    def get_disambiguator(self) -> str:
        return self._hash

    @classmethod
    def from_function(cls, py_func: Any, py_file: str) -> _Locator:
        return cls(py_func, py_file)


class _Cache(FunctionCache):
    """The files with the machine code of a function. Later processes load them and do not compile.

    `make dist` measures both. The code of the user's cache comes first, because it is for this CPU, and then
    that of the package.
    """

    _impl_class = type("_Files", (CompileResultCacheImpl,), {"_locator_classes": (_Locator,)})

    def __init__(self, entry: Any) -> None:
        super().__init__(entry.py_func)
        self._options = repr(sorted(entry.targetoptions.items()))

    def _load_overload(self, sig: Any, target_context: Any) -> Any:
        cached = super()._load_overload(sig, target_context) if _FOLDER else None
        if cached is not None or not _SHIPPED or _config.CPU_NAME or not self._enabled:
            return cached
        signature, (triple, *_), code = self._index_key(sig, target_context.codegen())
        folder = str(_SHIPPED / Path(self.cache_path).name)
        files = IndexDataCacheFile(folder, self._impl.filename_base, self._impl.locator.get_source_stamp())
        try:
            shipped = files.load((signature, (triple, *GENERIC), code))
            return None if shipped is None else self._impl.rebuild(target_context, shipped)
        except Exception as error:
            self._print_discarded(folder, error)

    def _save_overload(self, sig: Any, data: Any) -> None:
        if _FOLDER:
            super()._save_overload(sig, data)

    def _index_key(self, sig: Any, codegen: Any) -> Any:
        return *super()._index_key(sig, codegen)[:2], (self._options, *fields_of(sig))

    def _print_discarded(self, folder: str, error: Exception) -> None:
        code = f"the compiled code of {self._py_func.__qualname__} in {folder}"
        print(f"billiards_env: discards {code} ({error!r})", file=sys.stderr)

    @contextlib.contextmanager
    def _guard_against_spurious_io_errors(self) -> Iterator[None]:
        """Discards files that are damaged or that cannot be written, with a line on stderr."""
        try:
            with super()._guard_against_spurious_io_errors():
                yield
        except Exception as error:  # unpickling half a file may raise any exception
            self._print_discarded(self.cache_path, error)
            with contextlib.suppress(OSError):
                self.flush()


class EntryPoint(CPUDispatcher):
    """A function that Python calls. From its first compilation on it has a `_Cache`, if there is a folder for it."""

    def __init__(self, py_func: Any, locals: Any, targetoptions: Any) -> None:
        super().__init__(py_func, locals, targetoptions, ShortCompiler)

    def compile(self, sig: Any) -> Any:
        """Returns the machine code for a signature, compiled or from a file."""
        if isinstance(self._cache, NullCache) and (_FOLDER or _SHIPPED):  # now all that the function uses is defined
            self._cache = _Cache(self)
        return super().compile(sig)

    def typeof_pyval(self, val: Any) -> Any:
        """Returns the type of an argument. Numba asks for it at each call with kernels; without the memory, 0.1 ms."""
        try:
            return typeof_kernels(val)
        except TypeError:
            return super().typeof_pyval(val)


class Typed:
    """An entry point whose arguments have the same types at each call.

    Numba finds the machine code by the types of the arguments, which takes 40 ns for each array in a tuple, and 4 us
    for kernels. The first call finds the code. The types of later arguments are not checked.

    Args:
        entry: The entry point.
        *first: Its first arguments, the same at each call.

    Attributes:
        call: Calls the entry point with the other arguments. From the second call on it is the machine code.
    """

    def __init__(self, entry: Any, *first: Any) -> None:
        self._entry, self._first = entry, first
        self.call = self._first_call if isinstance(entry, EntryPoint) else self._bound(entry)

    def _bound(self, function: Callable[..., Any]) -> Callable[..., Any]:
        return functools.partial(function, *self._first) if self._first else function

    def _first_call(self, *arguments: Any) -> Any:
        self.call = self._bound(self._entry.compile(tuple(map(self._entry.typeof_pyval, (*self._first, *arguments)))))
        return self.call(*arguments)


@contextlib.contextmanager
def kernels_of(what: str) -> Iterator[None]:
    """Raises a TypeError that begins with `what`, a text "name = value", if a kernel of the block does not compile."""
    try:
        yield
    except (NumbaError, TypeError) as error:  # a TypeError for another number of arguments
        unknown = re.search(r"Unknown attribute '(\w+)' of type (\w+)", str(error))
        reason = f"; {unknown[2]} has no field {unknown[1]!r}" if unknown else ""
        expected = "expected kernels with the arguments and results of the documentation"
        raise TypeError(f"{what}: {expected}{reason}") from error


def check_kernel(what: str, function: Any) -> None:
    """Raises a TypeError that begins with `what`, a text "name = value", if a function is not compiled."""
    if callable(function) and not (_config.DISABLE_JIT or isinstance(function, Kernel)):
        raise TypeError(f"{what}: expected a kernel, a function with the decorator billiards_env.jit.kernel")


def _compiled(dispatcher: type[CPUDispatcher], function: F, **options: Any) -> F:
    # Without fastmath the compiler does not fuse or reorder operations, so IEEE 754 defines the results. With
    # `error_model="numpy"` a division by zero is infinite and does not raise an exception.
    # Numba would inherit `forceinline` from the caller that is compiled first.
    fixed = {"nopython": True, "error_model": "numpy", "nogil": True, "no_cfunc_wrapper": True, "forceinline": False}
    compiled: Any = function if _config.DISABLE_JIT else dispatcher(function, None, {**fixed, **options})
    return compiled


def kernel(function: F) -> F:
    """Compiles a function that other compiled functions call. It cannot create arrays.

    It does not count references to arrays, because it does not use numba's run time (`_nrt`). With the counting, a shot
    takes 2.5 to 8.5 times as long.
    """
    return _compiled(Kernel, function, _nrt=False)


def inlined(function: F) -> F:
    """Compiles a `kernel` that is inlined in its callers. Without inlining a shot takes 1.3 to 2.6 times as long.

    This is for small functions, and for large functions with one caller, because each call has its own copy.
    """
    return _compiled(Kernel, function, _nrt=False, forceinline=True)


def expanded(function: F) -> F:
    """Compiles a function whose code numba copies into its callers. It may therefore return a record of an array."""
    return _compiled(Kernel, function, _nrt=False, inline="always")


def allocating(function: F) -> F:
    """Compiles a function that other compiled functions call and that may create arrays.

    It must not raise an exception, because nothing would free its arrays. Only another `allocating` function can call
    it if it returns arrays.
    """
    return _compiled(Kernel, function, _nrt=True)


def entry_point(function: F) -> F:
    """Compiles a function that Python calls, and keeps its machine code on disk. It cannot create or return arrays.

    If it needs arrays, it calls an `allocating` function. Without numba's run time, no references to Python's arrays
    are counted, and a call takes about half the time.
    """
    return _compiled(EntryPoint, function, _nrt=False)
