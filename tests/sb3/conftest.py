import pytest
import torch

from tests.helpers.training import tiny, trained  # noqa: F401  (fixtures)


@pytest.fixture(autouse=True, scope="session")
def one_thread() -> None:
    """Networks run on one thread, as in `agents.train`."""
    torch.set_num_threads(1)
