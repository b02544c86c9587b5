"""Decorators that compile functions with numba, with strict IEEE arithmetic and a cache on disk.

Compiled functions call functions with `kernel`, `inlined` or `allocating`. Python calls functions with `entry_point` or
`allocating_entry_point`. This module and `physics.compiler` use parts of numba that its documentation does not
cover, such as `_nrt`, `forceinline` and the dispatcher, so `pyproject.toml` has an upper bound on its version.
"""

from __future__ import annotations

import contextlib
import gc
import hashlib
import os
import re
import sys
import tempfile
import threading
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeVar

from numba.core import config as _numba_config
from numba.core.caching import FunctionCache as _FunctionCache
from numba.core.registry import CPUDispatcher

from billiards_env.jit.compiler import Kernel, ShortCompiler

F = TypeVar("F", bound=Callable[..., Any])

_PACKAGE = Path(__file__).resolve().parent.parent
_IMPORT = re.compile(rb"^from (billiards_env[\w.]*) import", re.MULTILINE)


def kernel_sources() -> list[Path]:
    """Returns the files of the package that import `billiards_env.jit`, and all files that they import."""
    imports: dict[Path, set[Path]] = {}
    for path in sorted(_PACKAGE.rglob("*.py")):
        names = (name.decode().split(".")[1:] for name in _IMPORT.findall(path.read_bytes()))
        imports[path] = {_file(_PACKAGE.joinpath(*name)) for name in names if name}
    found = [path for path in imports if _file(_PACKAGE / "jit") in imports[path]]
    for path in found:
        found += sorted(other for other in imports[path] if other in imports and other not in found)
    return sorted(found)


def _file(module: Path) -> Path:
    """Returns the file of a module or a package."""
    return module / "__init__.py" if module.is_dir() else module.with_suffix(".py")


def source_hash() -> str:
    """Returns a hash of the source of all kernels and of the constants that they import.

    Numba's cache checks only the file of the function that it stores, not those of the functions that it calls. A cache
    folder with this name holds no outdated code.
    """
    digest = hashlib.sha256()
    for path in kernel_sources():
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _writable(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


def cache_folder() -> Path | None:
    """Returns the folder of the compiled code, or None if no folder is writable.

    It is the first writable one of these: the environment variable `NUMBA_CACHE_DIR`, the package's `__pycache__`, the
    user's cache folder. Warns if there is none, or if the variable is set and its folder is not writable.
    """
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    user = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "billiards_env"
    folders = [*([Path(chosen)] if chosen else []), _PACKAGE / "__pycache__", user]
    name = f"kernels-{source_hash()}"
    found = next((folder / name for folder in folders if _writable(folder / name)), None)
    if found is None:
        warnings.warn(
            "billiards_env finds no writable folder for compiled code (set NUMBA_CACHE_DIR to one): "
            "every process compiles again",
            RuntimeWarning,
            stacklevel=2,
        )
    elif chosen and found.parent != Path(chosen):
        warnings.warn(
            f"NUMBA_CACHE_DIR = {chosen!r}: expected a folder that can be written; billiards_env writes its compiled "
            f"code to {found}",
            RuntimeWarning,
            stacklevel=2,
        )
    return found


_FOLDER = cache_folder()
_config: Any = _numba_config  # numba defines its attributes at run time

# Without fastmath the compiler does not fuse or reorder operations, so results are the same on every machine. With
# `error_model="numpy"` a division by zero is infinite and does not raise an exception.
# Numba would inherit `forceinline` from the caller that is compiled first.
_OPTIONS = {"nopython": True, "error_model": "numpy", "nogil": True, "no_cfunc_wrapper": True, "forceinline": False}


def _make_kernel(function: F, **options: Any) -> F:
    if _config.DISABLE_JIT:
        return function
    made: Any = Kernel(function, targetoptions={**_OPTIONS, **options})
    return made


def kernel(function: F) -> F:
    """Compiles a function that other compiled functions call.

    It cannot create arrays, because it does not use numba's run time (`_nrt`), which counts references to arrays. The
    counting would take most of the time of an event.
    """
    return _make_kernel(function, _nrt=False)


def inlined(function: F) -> F:
    """Compiles a `kernel` that is inlined in the machine code of its callers.

    This is for small functions, and for large functions with one caller, because each call has its own copy. A call
    that is not inlined passes every array as seven words or more, which can take longer than a small function.

    LLVM optimises a `kernel` alone, and again in each function that calls it directly or indirectly. It optimises an
    inlined function only as a part of its callers.
    """
    return _make_kernel(function, _nrt=False, forceinline=True)


def allocating(function: F) -> F:
    """Compiles a function that other compiled functions call and that may create arrays."""
    return _make_kernel(function)


LONG = 1.0
"""s. A compilation that takes longer prints a message."""
_announced = False


def _announce() -> None:
    """Prints one line to stderr, at most once in a process."""
    global _announced
    if not _announced:
        _announced = True
        again = "kept for later runs" if _FOLDER else "again in every process"
        clear = "\r\x1b[K" if sys.stderr.isatty() else ""  # the line may hold a progress bar
        print(f"{clear}billiards_env: compiling, up to a minute, {again} ...", file=sys.stderr, flush=True)


@contextlib.contextmanager
def _announced_if_long() -> Iterator[None]:
    """Prints a message if the block takes longer than `LONG`."""
    timer = threading.Timer(LONG, _announce)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


@contextlib.contextmanager
def _rare_collections() -> Iterator[None]:
    """Raises the thresholds of the garbage collector. A compilation creates many objects that stay."""
    before = gc.get_threshold()
    if before[0] > 0:  # 0 switches the collector off
        gc.set_threshold(100_000, 50, 100)
    try:
        yield
    finally:
        gc.set_threshold(*before)


class _EntryCompiler(ShortCompiler):
    """The compiler of functions that Python calls. It runs only for functions that are not in the cache."""

    def compile_extra(self, func: Any) -> Any:
        """Compiles a function and all functions that it calls. The caller holds numba's lock."""
        with _announced_if_long(), _rare_collections():
            return super().compile_extra(func)


class _Cache(_FunctionCache):
    """The files with the machine code of a function.

    A damaged file is discarded, and code that cannot be written is not kept, both with a line on stderr.
    """

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Returns the machine code for a signature, or None if there is none."""
        try:
            return super().load_overload(sig, target_context)
        except Exception as error:  # unpickling half a file may raise any exception
            self._print("discards a damaged cache file", error)
            with contextlib.suppress(OSError):
                self.flush()
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Writes the machine code for a signature."""
        try:
            super().save_overload(sig, data)
        except OSError as error:  # such as a full disk
            self._print("cannot keep compiled code", error)

    def _print(self, what: str, error: Exception) -> None:
        function = f"{self._py_func.__module__}.{self._py_func.__qualname__}"
        print(f"billiards_env: {what}: {function} in {self.cache_path} ({error!r})", file=sys.stderr)


class EntryPoint(CPUDispatcher):
    """A function that Python calls. It has a `_Cache` if there is a folder for it."""

    def __init__(self, py_func: Any, locals: Any = None, targetoptions: Any = None) -> None:
        super().__init__(py_func, locals, targetoptions or {}, _EntryCompiler)
        if _FOLDER is not None:
            # Numba reads the folder when it creates the cache. Other packages keep their own folder.
            before = _config.CACHE_DIR
            _config.CACHE_DIR = str(_FOLDER)
            try:
                self._cache = _Cache(py_func)
            finally:
                _config.CACHE_DIR = before


def _make_entry_point(function: F, **options: Any) -> F:
    if _config.DISABLE_JIT:
        return function
    made: Any = EntryPoint(function, targetoptions={**_OPTIONS, **options})
    return made


def entry_point(function: F) -> F:
    """Compiles a function that Python calls, and keeps its machine code on disk.

    The function cannot create or return arrays, because it does not use numba's run time (`_nrt`). It writes its
    results to arrays that it is given.
    """
    return _make_entry_point(function, _nrt=False)


def allocating_entry_point(function: F) -> F:
    """Compiles a function that Python calls and that may create arrays, and keeps its machine code on disk."""
    return _make_entry_point(function)
