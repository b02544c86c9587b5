import contextlib
import functools
import io
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import torch

from tests.helpers.training import one_thread, tiny, trained

__all__ = ["one_thread", "tiny", "trained"]


@pytest.fixture(autouse=True)
def denormal() -> Iterator[None]:
    """Ends the rounding of tiny numbers to zero, which `examples/ppo.py` turns on for its process."""
    yield
    torch.set_flush_denormal(False)


@pytest.fixture
def command(request: pytest.FixtureRequest, tmp_path: Path) -> Any:
    """Returns the function `run_command(folder, ...)` of a test module, for `tmp_path`."""
    return functools.partial(request.module.run_command, tmp_path)


@pytest.fixture(scope="module")
def finished(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """Returns the folder of a finished `run_command`, and its output."""
    folder, output = tmp_path_factory.mktemp("finished"), io.StringIO()
    with contextlib.redirect_stdout(output):
        request.module.run_command(folder)
    return folder, output.getvalue()


@pytest.fixture
def printed(finished: tuple[Path, str], tmp_path: Path) -> str:
    """Returns the output of a finished `run_command`, whose files are in `tmp_path`."""
    folder, output = finished
    shutil.copytree(folder, tmp_path, dirs_exist_ok=True)
    return output.replace(str(folder), str(tmp_path))
