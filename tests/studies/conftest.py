from collections.abc import Iterator

import pytest
import torch

from tests.helpers.training import one_thread, tiny, trained

__all__ = ["one_thread", "tiny", "trained"]


@pytest.fixture(autouse=True)
def denormal() -> Iterator[None]:
    """Ends the rounding of tiny numbers to zero, which `examples/ppo.py` turns on for its process."""
    yield
    torch.set_flush_denormal(False)
