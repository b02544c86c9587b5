"""Distribution of the work on many shots over threads."""

from __future__ import annotations

import contextlib
import math
import os
import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from concurrent.futures import TimeoutError as NotDone
from time import perf_counter

from billiards_env.jit.interrupt import helping

_PIECE = 4e-4
"""s. Least duration of a piece of work. Taking a piece costs some hundredths of it, waking a thread up to a quarter."""

_WAIT = 0.2  # s; on Windows a wait reacts to Ctrl-C only when it ends


def parallel_for(work: Callable[[int, int], None], m: int, threads: int | None = None) -> None:
    """Calls `work(begin, end)` on consecutive pieces of range(m), on several threads if this saves time.

    Shots differ in duration, so pieces become smaller towards the end to let all threads end together (guided
    self-scheduling, Polychronopoulos and Kuck 1987). If the calling thread is interrupted, the other threads stop
    before the exception is raised.

    Args:
        work: Called from any thread. It should release the interpreter's lock while it computes, and call
            `physics.interrupt.interrupted` regularly if it can run long.
        m: Number of shots.
        threads: Number of threads, including the calling one; None for one per core.
    """
    workers = min(threads or os.cpu_count() or 1, m)
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
