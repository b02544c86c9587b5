import contextlib
import io
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest
import torch

from agents.config import Config
from agents.train import open_run, train
from studies import recipes, timestep
from tests.helpers.training import tiny, trained  # noqa: F401  (fixtures)


@pytest.fixture(autouse=True, scope="session")
def one_thread() -> None:
    """Networks have one thread, as in `agents.train`."""
    torch.set_num_threads(1)


@pytest.fixture(autouse=True, scope="package")
def in_this_process() -> Iterator[None]:
    """Runs are trained in this process, which is faster for tiny runs than `agents.runs.train_all`."""

    def train_here(runs: Mapping[Path, Config], jobs: int, address: str | None = None) -> None:
        for folder, config in runs.items():
            open_run(config, folder)
            with contextlib.redirect_stdout(io.StringIO()):
                train(config, folder)

    with pytest.MonkeyPatch.context() as patch:
        for module in (recipes, timestep):
            patch.setattr(module, "train_all", train_here)
        yield
