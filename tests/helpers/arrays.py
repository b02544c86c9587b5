"""Counts the arrays that compiled code creates."""

import contextlib
from collections.abc import Iterator

from numba.core.runtime import _nrt_python  # pyright: ignore[reportAttributeAccessIssue]
from numba.core.runtime.nrt import rtsys


@contextlib.contextmanager
def counted_arrays() -> Iterator[list[int]]:
    """Yields a list, which after the block is the number of new arrays and the number of those that are not freed."""
    _nrt_python.memsys_enable_stats()
    before, counts = rtsys.get_allocation_stats(), []
    try:
        yield counts
    finally:
        after = rtsys.get_allocation_stats()
        _nrt_python.memsys_disable_stats()
        counts += [after.alloc - before.alloc, after.alloc - before.alloc - (after.free - before.free)]
