"""Errors."""

import re

import pytest


def rejected(message, kind: type[Exception] = ValueError):
    """Returns `pytest.raises` for an error whose message contains this text."""
    return pytest.raises(kind, match=re.escape(message))
