"""Runs functions on a Ray cluster.

Only this module and `agents.rllib` import Ray. This module imports Ray in the functions that need it.

Every node needs the same clone of the repository at the same path, and the same virtual environment; see
`docs/cluster.md`.
"""

from __future__ import annotations

import importlib.util
import os
import reprlib
from collections.abc import Callable
from concurrent.futures import Executor, Future
from pathlib import Path
from typing import Any, TypeVar

from billiards_env.support.checks import missing

ROOT = Path(__file__).resolve().parent.parent

RETRIES = 3
"""The number of times that a failed task is repeated."""

STORE = 512 * 2**20  # bytes of shared memory for the objects of a machine without a cluster

T = TypeVar("T")


def connect(address: str | None, cpus: int | None = None) -> None:
    """Connects this process to a Ray cluster, or starts Ray on this machine. Does nothing if Ray is running.

    Args:
        address: The address of the cluster, such as "auto" or "10.0.0.1:6379"; None to start Ray on this machine.
        cpus: The number of cores that Ray uses on this machine; None for all. A cluster has its own number.

    Raises:
        ImportError: If Ray is not installed.
        ConnectionError: If there is no cluster at the address.
    """
    if importlib.util.find_spec("ray") is None:
        raise ImportError(missing("ray", "rllib"))
    import ray  # pyright: ignore[reportMissingImports]

    if ray.is_initialized():
        return
    # The workers of other nodes find the packages of the clone.
    paths = os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH"))))
    shared: dict[str, Any] = {
        "runtime_env": {"env_vars": {"PYTHONPATH": paths}},
        "log_to_driver": False,
        "logging_level": "ERROR",
    }
    if address is not None:
        ray.init(address=address, **shared)
    else:
        ray.init(address="local", num_cpus=cpus, include_dashboard=False, object_store_memory=STORE, **shared)


class RayExecutor(Executor):
    """An executor whose calls are Ray tasks of one core each. The first call connects to the cluster.

    Args:
        address: See `connect`.
    """

    def __init__(self, address: str | None) -> None:
        self.address = address

    def submit(self, fn: Callable[..., T], /, *args: Any, **kwargs: Any) -> Future[T]:
        """Returns the future result of a call.

        A call is repeated up to `RETRIES` times if it raises an exception or if its process or node ends. The error
        after that is one of Ray, which names the call.
        """
        connect(self.address)
        import ray  # pyright: ignore[reportMissingImports]

        name = f"{fn.__module__}.{fn.__qualname__}({', '.join(map(reprlib.repr, args))})"
        task = ray.remote(num_cpus=1, max_retries=RETRIES, retry_exceptions=True, name=name)(fn)
        return task.remote(*args, **kwargs).future()
