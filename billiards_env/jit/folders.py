"""The folders of the compiled code: the cache of the user, and the code that a wheel contains."""

from __future__ import annotations

import hashlib
import os
import sys
import tempfile
import warnings
from pathlib import Path

import llvmlite
import numba

_PACKAGE = Path(__file__).resolve().parent.parent


def versions_hash() -> str:
    """Returns a hash of the versions of Python, numba and llvmlite, and of the source of `billiards_env.jit`."""
    sources = b"".join(path.read_bytes() for path in sorted((_PACKAGE / "jit").glob("*.py")))
    versions = sys.implementation.cache_tag, numba.__version__, llvmlite.__version__, sources
    return hashlib.sha256(repr(versions).encode()).hexdigest()[:16]


def _writable(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


def cache_folder() -> Path | None:
    """Returns the folder of the compiled code, or None if no folder is writable.

    It is in the first writable one of these: the environment variable `NUMBA_CACHE_DIR`, the package's `__pycache__`,
    the user's cache folder. Warns if there is none, or if the variable is set and its folder is not writable.
    """
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    user = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "billiards_env"
    folders = [*([Path(chosen)] if chosen else []), _PACKAGE / "__pycache__", user]
    name = code_folder().name
    cache = next((folder / name for folder in folders if _writable(folder / name)), None)
    if cache is None or (chosen and cache.parent != Path(chosen)):
        so = f"billiards_env writes its compiled code to {cache}" if cache else "every process compiles billiards_env"
        message = f"NUMBA_CACHE_DIR = {chosen!r}: expected a folder that can be written; {so}"
        warnings.warn(message, RuntimeWarning, stacklevel=2)
    return cache


def code_folder() -> Path:
    """Returns the folder of the code in the package for the versions of this process. It may not exist."""
    return _PACKAGE / "machine_code" / f"kernels-{versions_hash()}"


def shipped_folder() -> Path | None:
    """Returns the folder of the code that is part of the package, or None if there is no code for these versions.

    `setup.py` compiles this code for any CPU of the architecture. With the environment variable
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
