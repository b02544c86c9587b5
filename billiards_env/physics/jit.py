"""How the kernels are compiled: numba, strict IEEE arithmetic, an on-disk cache that notices every edit."""

from __future__ import annotations

import contextlib
import functools
import hashlib
import os
import re
import sys
import tempfile
import threading
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numba
from numba.core import config as _numba_config
from numba.core import event as _event
from numba.core.caching import FunctionCache as _FunctionCache
from numba.core.registry import CPUDispatcher as _CPUDispatcher

F = TypeVar("F", bound=Callable[..., Any])

_PACKAGE = Path(__file__).resolve().parent.parent
_IMPORT = re.compile(rb"^from (billiards_env[\w.]*) import", re.MULTILINE)


def kernel_sources() -> list[Path]:
    """Returns the files of the package that contain kernels, which import this module, and those that they import."""
    imports: dict[Path, set[Path]] = {}
    for path in sorted(_PACKAGE.rglob("*.py")):
        names = (name.decode().split(".")[1:] for name in _IMPORT.findall(path.read_bytes()))
        imports[path] = {_PACKAGE.joinpath(*name).with_suffix(".py") for name in names if name}
    found = [path for path in imports if Path(__file__).resolve() in imports[path]]
    for path in found:
        found += sorted(other for other in imports[path] if other in imports and other not in found)
    return sorted(found)


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
    """Where compiled kernels are kept, or None if no such place can be written.

    In turn: the environment's `NUMBA_CACHE_DIR`, the package's `__pycache__`, the user's cache folder. Warns if it is
    not the first.
    """
    given = os.environ.get("NUMBA_CACHE_DIR")
    user = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "billiards_env"
    places = [*([Path(given)] if given else []), _PACKAGE / "__pycache__", user]
    name = f"kernels-{source_hash()}"
    found = next((place / name for place in places if _writable(place / name)), None)
    if found is None:
        warnings.warn(
            "billiards_env finds no folder it can write compiled kernels to (set NUMBA_CACHE_DIR to one): "
            "they are compiled anew in every process",
            RuntimeWarning,
            stacklevel=2,
        )
    elif given and found.parent != Path(given):
        warnings.warn(
            f"NUMBA_CACHE_DIR = {given!r}: expected a folder that can be written; billiards_env keeps its compiled "
            f"kernels in {found}",
            RuntimeWarning,
            stacklevel=2,
        )
    return found


_FOLDER = cache_folder()
_config: Any = _numba_config  # its settings are made at run time
_jit: Any = numba.jit  # its type hints leave out some options
# The savings, for benchmarks.ablation to compile the engine without one of them.
BORROW = True  # references to arrays are not counted
INLINE = True  # what each event needs is compiled into one function

_OPTIONS = {"nopython": True, "error_model": "numpy", "nogil": True, "no_cfunc_wrapper": True}


class _Kernel(_CPUDispatcher):
    """A function that other compiled functions call; what converts Python's arguments is compiled if Python calls it.

    Numba's own dispatcher compiles that along with every function: a quarter of the time until the first shot.
    """

    @functools.cached_property
    def _for_python(self) -> Callable[..., Any]:
        return _jit(**{**self.targetoptions, "no_cpython_wrapper": False})(self.py_func)

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        return self._for_python(*args, **kwargs)


def _make_kernel(function: F, **options: Any) -> F:
    if _config.DISABLE_JIT:
        return function
    made: Any = _Kernel(function, targetoptions={**_OPTIONS, "no_cpython_wrapper": True, **options})
    return made


def kernel(function: F) -> F:
    """Compiles `function` when it is first called; for kernels that other kernels call.

    Strict IEEE arithmetic (no fastmath, so nothing is fused or reordered) makes results the same on every machine;
    `error_model="numpy"` lets a division by zero give an infinity instead of an exception. Without numba's run time
    (`_nrt`) arrays are borrowed from the caller and none can be made: counting references to them took most of the time
    of an event.
    """
    return _make_kernel(function, _nrt=not BORROW)


def inlined(function: F) -> F:
    """A `kernel` that becomes part of every kernel that calls it: for what each event needs.

    A call passes every array as seven words, which can take longer than what is done with it.
    """
    return _make_kernel(function, _nrt=not BORROW, forceinline=INLINE)


def merged(function: F) -> F:
    """A `kernel` that becomes part of its caller before that is compiled, and is not compiled by itself.

    Numba compiles all that a kernel calls along with it, so each link in a chain of calls has the rest of the chain
    compiled once more; this is for the big ones that an engine calls in one place.
    """
    return _make_kernel(function, _nrt=not BORROW, inline="always" if INLINE else "never")


def allocating(function: F) -> F:
    """A kernel that makes arrays."""
    return _make_kernel(function)


LONG = 1.0
"""A compilation that takes so many seconds is announced."""


class _Announcer(_event.Listener):
    """Says on stderr, in one line, what is waited for when an entry point takes long to compile."""

    def __init__(self) -> None:
        self.timers: dict[Callable[..., Any], threading.Timer] = {}

    def on_start(self, event: Any) -> None:
        """Numba begins to compile a function, of whatever package."""
        function = event.data["dispatcher"].py_func
        if function in _ENTRY_POINTS:
            kept = f"kept in {_FOLDER}" if _FOLDER else "not kept"
            line = f"billiards_env: compiling {function.__module__}.{function.__qualname__} ({kept}) ...\n"
            timer = self.timers[function] = threading.Timer(LONG, sys.stderr.write, (line,))
            timer.daemon = True
            timer.start()

    def on_end(self, event: Any) -> None:
        """Numba has compiled a function."""
        timer = self.timers.pop(event.data["dispatcher"].py_func, None)
        if timer is not None:
            timer.cancel()


def _with_room(function: Callable[..., Any], *args: Any) -> Any:
    """Calls `function`, for which the interpreter finds room on its stack in one piece.

    CPython, from 3.11 on, keeps frames in pieces of 16 KB, and gives a piece back when the last frame in it returns.
    Numba's recursion crosses their edges again and again; where it does so in a loop, each call asks the system for
    memory and gives it back, which took a quarter of the time to compile. A frame that claims a long stack, as this one
    does, gets a piece of twice its length, and those it calls find room behind it.
    """
    return function(*args)


_with_room.__code__ = _with_room.__code__.replace(co_stacksize=2**17)  # words


class _Cache(_FunctionCache):
    """Numba's cache of a function's machine code on disk.

    A damaged file is discarded, and code that cannot be written is not kept; both with a line on stderr.
    """

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The machine code for a signature, or None if it has to be compiled."""
        try:
            return super().load_overload(sig, target_context)
        except Exception as error:  # unpickling half a file may raise any
            self._say("discards a damaged cache file", error)
            with contextlib.suppress(OSError):
                self.flush()
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keeps the machine code for a signature, if it can."""
        try:
            super().save_overload(sig, data)
        except OSError as error:  # such as a full disk
            self._say("cannot keep compiled code", error)

    def _say(self, what: str, error: Exception) -> None:
        function = f"{self._py_func.__module__}.{self._py_func.__qualname__}"
        print(f"billiards_env: {what}: {function} in {self.cache_path} ({error!r})", file=sys.stderr)


_ENTRY_POINTS: set[Callable[..., Any]] = set()
_event.register("numba:compile", _Announcer())


def _compiled_with_room(dispatcher: Any) -> Any:
    if not _config.DISABLE_JIT:
        dispatcher.compile = functools.partial(_with_room, dispatcher.compile)
    return dispatcher


def entry_point(function: F) -> F:
    """A kernel that Python calls, and that may make arrays: its machine code, callees included, is cached on disk."""
    _ENTRY_POINTS.add(function)
    dispatcher = _jit(**_OPTIONS)(function)
    if _FOLDER is not None and not _config.DISABLE_JIT:
        # numba reads the folder when the cache is made; other packages' kernels keep theirs.
        before = _config.CACHE_DIR
        _config.CACHE_DIR = str(_FOLDER)
        try:
            dispatcher._cache = _Cache(function)
        finally:
            _config.CACHE_DIR = before
    return _compiled_with_room(dispatcher)
