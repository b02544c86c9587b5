"""The folders of the compiled code: the cache of the user, and the code that a wheel of `release.dist` contains."""

from __future__ import annotations

import hashlib
import os
import re
import sys
import tempfile
import warnings
from pathlib import Path

import llvmlite
import numba

_PACKAGE = Path(__file__).resolve().parent.parent
_IMPORT = re.compile(r"^from billiards_env\.([\w.]+) import", re.MULTILINE)


def kernel_sources() -> list[Path]:
    """Returns the files of the package that import `billiards_env.jit`, and all files that they import."""
    imports: dict[Path, set[Path]] = {}
    for path in _PACKAGE.rglob("*.py"):
        modules = [_PACKAGE.joinpath(*name.split(".")) for name in _IMPORT.findall(path.read_text(encoding="utf-8"))]
        imports[path] = {m / "__init__.py" if m.is_dir() else m.with_suffix(".py") for m in modules}
    sources = [path for path in imports if _PACKAGE / "jit" / "__init__.py" in imports[path]]
    for path in sources:
        sources += [other for other in imports[path] if other in imports and other not in sources]
    return sorted(sources)


def source_hash() -> str:
    """Returns a hash of the source of all kernels and of the constants that they import.

    Numba's cache checks only the file of the function that it stores, not the files of the functions that it calls.
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
    cache = next((folder / name for folder in folders if _writable(folder / name)), None)
    if cache is None or (chosen and cache.parent != Path(chosen)):
        so = f"billiards_env writes its compiled code to {cache}" if cache else "every process compiles billiards_env"
        message = f"NUMBA_CACHE_DIR = {chosen!r}: expected a folder that can be written; {so}"
        warnings.warn(message, RuntimeWarning, stacklevel=2)
    return cache


def code_folder() -> Path:
    """Returns the folder of the code that is part of the package, for the versions of this process. It may not exist.

    Its name is a hash of the source of the kernels and of the versions of Python, numba and llvmlite.
    """
    versions = sys.implementation.cache_tag, numba.__version__, llvmlite.__version__, source_hash()
    return _PACKAGE / "machine_code" / hashlib.sha256(repr(versions).encode()).hexdigest()[:16]


def shipped_folder() -> Path | None:
    """Returns the folder of the code that is part of the package, or None if there is no code for these versions.

    `release.dist` compiles this code for any CPU of the architecture. With the environment variable
    `BILLIARDS_ENV_COMPILE=1` the result is None. Numba then compiles for the CPU of this machine and keeps the code in
    the cache, which later processes search first.

    Raises:
        ValueError: If the variable has another value.
    """
    chosen = os.environ.get("BILLIARDS_ENV_COMPILE", "0")
    if chosen not in {"0", "1"}:
        raise ValueError(f"BILLIARDS_ENV_COMPILE = {chosen!r}: expected '0' or '1'")
    folder = code_folder()
    return folder if chosen == "0" and folder.is_dir() else None
