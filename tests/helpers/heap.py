"""Memory with known content."""

import numpy as np


def fill_heap(byte: int, *sizes: int) -> None:
    """Fills free memory with a byte. The next arrays of these sizes, in bytes, that NumPy does not set have it."""
    _ = [np.full(size, byte, np.uint8) for size in sizes for _ in range(20)]
