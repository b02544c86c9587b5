"""A Ray cluster of two nodes on this machine."""

import logging
from collections.abc import Iterator
from typing import Any

import pytest

from agents.cluster import STORE, connect


@pytest.fixture(scope="session")
def cluster() -> Iterator[Any]:
    """Returns a cluster of two nodes with one core each. This process is connected to it."""
    import ray  # pyright: ignore[reportMissingImports]
    from ray.cluster_utils import Cluster  # pyright: ignore[reportMissingImports]

    logging.getLogger("ray").setLevel(logging.ERROR)
    node = {"num_cpus": 1, "object_store_memory": STORE}
    nodes = Cluster(initialize_head=True, head_node_args={**node, "include_dashboard": False})
    try:
        nodes.add_node(**node)
        nodes.wait_for_nodes()
        connect(nodes.address)
        yield nodes
    finally:
        ray.shutdown()
        nodes.shutdown()
