"""Errors."""

import re
from collections.abc import Iterable
from typing import Any

import pytest


def rejected(message, kind: type[Exception] = ValueError):
    """Returns `pytest.raises` for an error whose message contains this text."""
    return pytest.raises(kind, match=re.escape(message))


def refusals(names: str, rows: Iterable[tuple[Any, ...]]):
    """Returns a decorator that runs a test for each row of a table of wrong input. The ids are the messages.

    Args:
        names: The names of the first columns, separated by commas. "message" and "kind" follow them.
        rows: The wrong input, a regular expression of the message and, unless it is a ValueError, the kind of error.
    """
    columns, count = [*names.split(", "), "message", "kind"], names.count(",") + 3
    table = [(*row, ValueError)[:count] for row in rows]
    return pytest.mark.parametrize(columns, table, ids=[str(row[-2]) for row in table])
