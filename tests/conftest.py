import hashlib
import os
from typing import Any

from filelock import FileLock
from hypothesis import settings

from billiards_env.jit import decorators

os.environ.setdefault("OMP_NUM_THREADS", "1")  # threads of PyTorch that wait for a core cost processor time
os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
os.environ.setdefault("MPLBACKEND", "Agg")

# The examples are the same in every run. No test fails because a machine is slow or a kernel is compiled.
collect_ignore = ["data"]  # the tests import the modules there

settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.load_profile("repeatable")

_entry_point: Any = decorators.EntryPoint
_compile = _entry_point.compile


def _compile_once(self: Any, sig: Any) -> Any:
    """Compiles a function, or loads the code of another worker that compiles it at the same time."""
    name = hashlib.sha256(repr((self.py_func.__module__, self.__qualname__, sig)).encode()).hexdigest()[:16]
    if decorators._FOLDER is None:
        return _compile(self, sig)
    with FileLock(decorators._FOLDER / f"{name}.lock"):
        return _compile(self, sig)


if "PYTEST_XDIST_WORKER" in os.environ:
    _entry_point.compile = _compile_once
