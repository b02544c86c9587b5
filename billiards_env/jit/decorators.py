"""Decorators that compile functions with numba, with strict IEEE arithmetic and a cache on disk.

Compiled functions call functions with `kernel`, `inlined` or `allocating`. Python calls functions with `entry_point` or
`allocating_entry_point`. This module and `jit.compiler` use undocumented parts of numba, such as `_nrt` and the
dispatcher, so `pyproject.toml` has an upper bound on its version.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import re
import sys
import tempfile
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
_IMPORT = re.compile(r"^from billiards_env\.([\w.]+) import", re.MULTILINE)


def kernel_sources() -> list[Path]:
    """Returns the files of the package that import `billiards_env.jit`, and all files that they import."""
    imports: dict[Path, set[Path]] = {}
    for path in _PACKAGE.rglob("*.py"):
        modules = [_PACKAGE.joinpath(*name.split(".")) for name in _IMPORT.findall(path.read_text(encoding="utf-8"))]
        imports[path] = {m / "__init__.py" if m.is_dir() else m.with_suffix(".py") for m in modules}
    found = [path for path in imports if _PACKAGE / "jit" / "__init__.py" in imports[path]]
    for path in found:
        found += [other for other in imports[path] if other in imports and other not in found]
    return sorted(found)


def source_hash() -> str:
    """Returns a hash of the source of all kernels and of the constants that they import.

    Numba's cache checks only the file of the function that it stores, not those of the functions that it calls.
    """
    return hashlib.sha256(b"".join(path.read_bytes() for path in kernel_sources())).hexdigest()[:16]


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
    if found is None or (chosen and found.parent != Path(chosen)):
        so = f"billiards_env writes its compiled code to {found}" if found else "every process compiles billiards_env"
        message = f"NUMBA_CACHE_DIR = {chosen!r}: expected a folder that can be written; {so}"
        warnings.warn(message, RuntimeWarning, stacklevel=2)
    return found


_FOLDER = cache_folder()
_config: Any = _numba_config  # numba defines its attributes at run time


class _Cache(_FunctionCache):
    """The files with the machine code of a function. They save all later processes the first compile, 18 s."""

    @contextlib.contextmanager
    def _guard_against_spurious_io_errors(self) -> Iterator[None]:
        """Discards files that are damaged or that cannot be written, with a line on stderr."""
        try:
            with super()._guard_against_spurious_io_errors():
                yield
        except Exception as error:  # unpickling half a file may raise any exception
            code = f"the compiled code of {self._py_func.__qualname__} in {self.cache_path}"
            print(f"billiards_env: discards {code} ({error!r})", file=sys.stderr)
            with contextlib.suppress(OSError):
                self.flush()


class EntryPoint(CPUDispatcher):
    """A function that Python calls. It has a `_Cache` if there is a folder for it."""

    def __init__(self, py_func: Any, locals: Any, targetoptions: Any) -> None:
        super().__init__(py_func, locals, targetoptions, ShortCompiler)
        if _FOLDER is not None:
            # Numba reads the folder when it creates the cache. Other packages keep their own folder.
            before = _config.CACHE_DIR
            _config.CACHE_DIR = str(_FOLDER)
            try:
                self._cache = _Cache(py_func)
            finally:
                _config.CACHE_DIR = before


def _compiled(dispatcher: type[CPUDispatcher], function: F, **options: Any) -> F:
    # Without fastmath the compiler does not fuse or reorder operations, so results are the same on every machine. With
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
    """Compiles a `kernel` that is inlined in its callers. Without inlining a shot takes 1.3 to 2.2 times as long.

    This is for small functions, and for large functions with one caller, because each call has its own copy.
    """
    return _compiled(Kernel, function, _nrt=False, forceinline=True)


def allocating(function: F) -> F:
    """Compiles a function that other compiled functions call and that may create arrays."""
    return _compiled(Kernel, function)


def entry_point(function: F) -> F:
    """Compiles a function that Python calls, and keeps its machine code on disk. It cannot create or return arrays."""
    return _compiled(EntryPoint, function, _nrt=False)


def allocating_entry_point(function: F) -> F:
    """Compiles a function that Python calls and that may create arrays, and keeps its machine code on disk."""
    return _compiled(EntryPoint, function)
