"""Distribution of the work on many shots over threads, and the number of threads of the process."""

from __future__ import annotations

import contextlib
import functools
import math
import os
import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from concurrent.futures import TimeoutError as NotDone
from pathlib import Path
from time import perf_counter
from typing import Any

from numba.core import config

from billiards_env.jit.interrupt import helping
from billiards_env.support.checks import integer

_PIECE = 4e-4
"""s. Least duration of a piece of work. Taking a piece costs some hundredths of it, waking a thread up to a quarter."""

_WAIT = 0.2  # s; on Windows a wait reacts to Ctrl-C only when it ends

_ROOT = Path("/")
_config: Any = config  # numba defines its attributes at run time
_chosen: int | None = None


def set_num_threads(n: int | None) -> None:
    """Sets the number of threads of each call in this process that does not have an argument `threads`.

    By default it is the number of processors that the process may use. This is the number in its affinity mask, limited
    by the quota of its control groups (Linux), rounded up, and by `NUMBA_NUM_THREADS`. Other variables have no effect.
    This includes `OMP_NUM_THREADS`, because it is often set to 1 for PyTorch alone.

    Args:
        n: The number of threads, from 1 to 1024; None for the default.

    Raises:
        ValueError: If n is not such a number.
    """
    global _chosen
    _chosen = None if n is None else integer("n", n, "threads")


def num_threads() -> int:
    """Returns the number of threads of a call without `threads`, as `set_num_threads` describes it."""
    if _chosen is not None:
        return _chosen
    count: Callable[[], int | None] = getattr(os, "process_cpu_count", os.cpu_count)  # from Python 3.13 on
    if count is os.cpu_count and hasattr(os, "sched_getaffinity"):  # neither macOS nor Windows has it
        processors = len(os.sched_getaffinity(0))
    else:
        processors = count() or 1
    return min(processors, math.ceil(_quota()), _config.NUMBA_NUM_THREADS)


@functools.cache
def _quota() -> float:
    """Returns the processors that the control groups of the process allow, at most a million."""
    try:
        groups = (_ROOT / "proc/self/cgroup").read_text(encoding="utf-8").splitlines()
    except OSError:  # not Linux
        groups = []
    quotas = [1e6]
    for _, controllers, path in (group.split(":", 2) for group in groups):
        if controllers and "cpu" not in controllers.split(","):
            continue
        mount = _ROOT / "sys/fs/cgroup" / ("cpu" if controllers else "")  # version 1 has a folder for each controller
        group = mount / path.lstrip("/")
        quotas += [_quota_of(folder) for folder in (group, *group.parents) if folder.is_relative_to(mount)]
    return min(quotas)


def _quota_of(folder: Path) -> float:
    """Returns the processors that one control group allows, infinite if it has no limit or does not exist.

    In a container only some of the folders above the process exist.
    """
    names = ("cpu.max",) if (folder / "cpu.max").exists() else ("cpu.cfs_quota_us", "cpu.cfs_period_us")
    try:
        quota, period = map(int, "".join((folder / name).read_text(encoding="utf-8") for name in names).split())
        return quota / period if quota > 0 else math.inf  # -1 in version 1
    except (OSError, ValueError):  # "max" in version 2
        return math.inf


def parallel_for(work: Callable[[int, int], None], m: int, threads: int | None = None) -> None:
    """Calls `work(begin, end)` on consecutive pieces of range(m), on several threads if this saves time.

    Shots differ in duration, so pieces become smaller towards the end to let all threads end together (guided
    self-scheduling, Polychronopoulos and Kuck 1987). If the calling thread is interrupted, the other threads stop
    before the exception is raised.

    Args:
        work: Called from any thread. It should release the interpreter's lock while it computes, and call
            `jit.interrupt.interrupted` regularly if it can run long.
        m: Number of shots.
        threads: Number of threads, including the calling one; None for `num_threads()`.
    """
    workers = min(threads or num_threads(), m) if m > 1 else m
    if workers <= 1:
        work(0, m)
        return
    at = min(max(m // 16, 1), 8)  # the first few shots are timed
    begun = perf_counter()
    work(0, at)
    least = math.ceil(at * _PIECE / max(perf_counter() - begun, 1e-9))  # a coarse clock may measure zero
    workers = min(workers, (m - at) // least)
    if workers <= 1:
        if at < m:
            work(at, m)
        return
    lock, stop = threading.Lock(), threading.Event()

    def take() -> None:
        nonlocal at
        while True:
            with lock:
                begin = at
                end = at = min(m, begin + max(least, (m - begin) // (2 * workers)))
            if begin == end:
                return
            work(begin, end)

    def help_out() -> None:
        with helping(stop):
            take()

    helpers: list[Future[None]] = []
    try:
        for _ in range(workers - 1):
            helpers.append(_helpers().submit(help_out))
        take()
        # No work is left for helpers that have not started yet: they are cancelled.
        errors = [_outcome(helper) for helper in helpers if not helper.cancel()]
    except BaseException:
        stop.set()
        with lock:
            at = m  # no thread takes another piece
        for helper in helpers:
            if not helper.cancel():
                _outcome(helper)
        raise
    for error in errors:
        if error is not None:
            raise error


def _outcome(helper: Future[None]) -> BaseException | None:
    """Waits until a helper has ended. Returns its exception or None."""
    while True:
        with contextlib.suppress(NotDone):
            return helper.exception(_WAIT)


_pool: ThreadPoolExecutor | None = None


def _helpers() -> ThreadPoolExecutor:
    """Returns the pool of helper threads, which the first call creates."""
    global _pool
    if _pool is None:
        _pool = ThreadPoolExecutor(max(os.cpu_count() or 1, 64), "billiards")
    return _pool


def _forget_helpers() -> None:
    global _pool
    _pool = None


if hasattr(os, "register_at_fork"):  # a forked process has none of its parent's threads
    os.register_at_fork(after_in_child=_forget_helpers)
