"""Counts how often compiled code looks for signals, the measure of its work between two chances for Ctrl-C."""

from collections.abc import Callable
from typing import Any

from billiards_env.jit import interrupt


def looks(monkeypatch: Any, run: Callable[[], Any], stops: bool = False) -> tuple[int, Any]:
    """Returns the number of times that compiled code looks for signals during a call, and the result of the call.

    If it `stops`, the first look raises `Stopped`.
    """
    count = 0

    def look() -> None:
        nonlocal count
        count += 1
        if stops:
            raise interrupt.Stopped

    with monkeypatch.context() as patch:
        patch.setattr(interrupt, "raise_if_stopped", look)
        result = run()
    return count, result
