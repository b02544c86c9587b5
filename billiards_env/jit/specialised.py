"""Functions that are compiled once for each kernel that they call."""

from __future__ import annotations

from collections.abc import Callable
from types import FunctionType
from typing import Any

from billiards_env.jit.decorators import entry_point


def specialised(function: Callable[..., Any], **kernels: Callable[..., Any]) -> Callable[..., Any]:
    """Compiles a function that Python calls, with kernels in place of some of its global names.

    The machine code holds these kernels alone, so a scene compiles only the kernels that it needs. Its name on disk has
    the names of the kernels, because numba's cache does not check global names.

    Args:
        function: A function of a module, without a decorator.
        **kernels: The kernels, by the names that the function calls.

    Returns:
        The function, as of `entry_point`.
    """
    made: Any = FunctionType(function.__code__, {**function.__globals__, **kernels}, function.__name__)
    names = (f"{kernel.__module__.rpartition('.')[2]}_{kernel.__name__}" for kernel in kernels.values())
    made.__qualname__ = "_".join((function.__name__, *names))
    made.__module__, made.__doc__ = function.__module__, function.__doc__
    return entry_point(made)
