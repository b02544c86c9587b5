"""A Ray cluster of two nodes on this machine."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from agents.cluster import two_nodes


@pytest.fixture(scope="session")
def cluster() -> Iterator[Any]:
    """Returns a cluster of two nodes with one core each. This process is connected to it."""
    with two_nodes() as nodes:
        yield nodes
