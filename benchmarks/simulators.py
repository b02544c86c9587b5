"""The environment of other simulators, pooltool, pymunk and MuJoCo, and the processes that run shots there.

pooltool needs other versions of numba and llvmlite than billiards-env. `make bench` and `make study` create the
environment, in which `benchmarks/simulators_worker.py` runs:

    python3 -m venv .venv-simulators
    .venv-simulators/bin/pip install --no-deps -r benchmarks/simulators.txt
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from benchmarks import ROOT, worker

PYTHON = ROOT / ".venv-simulators" / "bin" / "python"
WORKER = Path(__file__).with_name("simulators_worker.py")


def installed() -> bool:
    """Returns whether the environment exists."""
    return PYTHON.exists()


@contextlib.contextmanager
def opened(name: str, *arguments: Any) -> Iterator[tuple[Any, Callable[..., Any]]]:
    """Starts a simulator, an entry of `SIMULATORS` in the worker.

    Yields:
        Its first answer, and a function that sends shots and returns the answer.
    """
    with worker(WORKER.name, [PYTHON, WORKER]) as ask:
        yield ask([name, *arguments]), ask
