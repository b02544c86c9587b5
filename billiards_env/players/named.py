"""Players by name that are functions of other modules."""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Iterable
from typing import Any

from billiards_env.checks import suggestion


def imported(text: str, module: str, function: str, known: Iterable[str]) -> Any:
    """Returns a function of a module, for a player with the name `text`.

    Raises:
        ValueError: If there is no such function. The message lists the names `known`.
    """
    try:
        return getattr(importlib.import_module(module), function)
    except SyntaxError as error:
        where = f"{error.filename}, line {error.lineno}: {error.msg}"
        raise ValueError(f"player = {text!r}: expected a module of Python ({where})") from error
    except (AttributeError, ImportError, ValueError) as error:
        name, names = text.partition(":")[0], tuple(known)
        ours = module.removesuffix(".py")
        if ours != module or (not function and isinstance(error, AttributeError)):
            why = f" (did you mean '{ours}:{function or 'FUNCTION'}'?)"
        else:
            why = ("" if name in names else suggestion(name, names)) or f" ({error})"
        expected = f"one of {', '.join(map(repr, names))}, or module:function"
        raise ValueError(f"player = {text!r}: expected {expected}{why}") from error


def check_call(text: str, function: Any, arguments: tuple[Any, ...], what: str) -> None:
    """Raises a TypeError unless a function takes some arguments; `what` describes a right one."""
    try:
        inspect.signature(function).bind(*arguments)
    except (TypeError, ValueError):  # a ValueError for a built-in function without a signature
        raise TypeError(f"player = {text!r}: expected a function {what}") from None
