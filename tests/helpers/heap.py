"""Memory with known content."""

import numpy as np


def fill_heap(byte: int, *sizes: int) -> None:
    """Fills freed memory with a byte: arrays of these sizes (bytes) that NumPy does not initialise then contain it."""
    _ = [np.full(size, byte, np.uint8) for size in sizes for _ in range(20)]
