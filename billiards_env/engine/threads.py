"""Work on many shots, spread over threads."""

from __future__ import annotations

import contextlib
import math
import os
import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from concurrent.futures import TimeoutError as NotDone
from time import perf_counter

from billiards_env.physics.interrupt import helping

_PIECE = 4e-4
"""So many seconds a piece of work takes, or more: getting hold of one takes some hundredths of that, waking a thread up
to a quarter."""

_WAIT = 0.2  # s; on Windows a wait reacts to Ctrl-C only when it ends


def spread(work: Callable[[int, int], None], m: int, threads: int | None = None) -> None:
    """Calls `work(begin, end)` for pieces that make up 0 to m, on several threads where that is worth it.

    Pieces become smaller towards the end, for shots differ in length and the last piece is waited for (guided
    self-scheduling, Polychronopoulos and Kuck 1987). If this thread is interrupted, the others stop, too, before the
    exception is raised.

    Args:
        work: Called from any thread; it should leave the interpreter's lock to the others while it computes, and call
            `physics.interrupt.interrupted` if it may take long.
        m: Number of shots.
        threads: Number of threads, this one among them; None for one a core.
    """
    workers = min(threads or os.cpu_count() or 1, m)
    if workers <= 1:
        work(0, m)
        return
    at = min(max(m // 16, 1), 8)  # the first few tell how long a shot takes
    begun = perf_counter()
    work(0, at)
    least = math.ceil(at * _PIECE / max(perf_counter() - begun, 1e-9))  # a coarse clock may stand still
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
        # A helper that has not woken up by now would find nothing left to do.
        errors = [_outcome(helper) for helper in helpers if not helper.cancel()]
    except BaseException:
        stop.set()
        with lock:
            at = m  # the rest is not worth doing
        for helper in helpers:
            if not helper.cancel():
                _outcome(helper)
        raise
    for error in errors:
        if error is not None:
            raise error


def _outcome(helper: Future[None]) -> BaseException | None:
    """Waits until a helper has ended, and returns its error."""
    while True:
        with contextlib.suppress(NotDone):
            return helper.exception(_WAIT)


_pool: ThreadPoolExecutor | None = None


def _helpers() -> ThreadPoolExecutor:
    """The threads beside the caller's, started when first needed and kept."""
    global _pool
    if _pool is None:
        _pool = ThreadPoolExecutor(max(os.cpu_count() or 1, 64), "billiards")
    return _pool


def _forget_helpers() -> None:
    global _pool
    _pool = None


if hasattr(os, "register_at_fork"):  # a forked process has none of its parent's threads
    os.register_at_fork(after_in_child=_forget_helpers)
