"""A stand-in for a pool of processes, and processes of Python with this package."""

import os
import subprocess
import sys
from concurrent.futures import Executor, Future
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]


class InThisProcess(Executor):
    """Calls functions at once."""

    def submit(self, fn, /, *args, **kwargs):
        future = Future[Any]()
        future.set_result(fn(*args, **kwargs))
        return future


def start(*arguments: str, **environment: str) -> subprocess.Popen[str]:
    """Starts Python with this package."""
    env = os.environ | {"PYTHONPATH": str(ROOT)} | environment
    pipe = subprocess.PIPE
    return subprocess.Popen([sys.executable, *arguments], env=env, stdout=pipe, stderr=pipe, text=True)


def run(*arguments: str, **environment: str) -> tuple[str, str]:
    """Runs Python with this package. Returns what it prints to stdout and stderr."""
    process = start(*arguments, **environment)
    out, errors = process.communicate()
    assert process.returncode == 0, errors
    return out, errors
