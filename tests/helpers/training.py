"""Fixtures of a tiny training run, for the tests of `agents` and `studies`."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import torch

from agents.config import Config
from agents.train import open_run, train


class Pickled:
    """Writes a file when it is unpickled."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return (open, (str(self.path), "w"))


def trained_run(config: Config, folder: Path) -> Path:
    """Trains a configuration and returns the folder of the run."""
    open_run(config, folder)
    train(config, folder)
    return folder


def settings(**changes: Any) -> dict[str, Any]:
    """Returns the settings of a tiny run of four updates with a checkpoint after the second."""
    return {
        "timesteps": 512,
        "n_envs": 4,
        "seed": 5,
        "checkpoint_every": 200,
        "evaluation_episodes": 20,
        "policy": {"head": "gaussian", "hidden": [16]},
        "ppo": {"n_steps": 32, "n_epochs": 2, "batch_size": 64, "learning_rate": [3e-4, 1e-4]},
        **changes,
    }


@pytest.fixture(autouse=True, scope="session")
def one_thread() -> None:
    """Networks run on one thread, as in `agents.train`."""
    torch.set_num_threads(1)


@pytest.fixture(scope="session")
def tiny() -> Callable[..., dict[str, Any]]:
    return settings


@pytest.fixture(scope="session")
def trained(tiny, tmp_path_factory) -> Path:
    """Returns the folder of a finished tiny run. Tests must not change it."""
    return trained_run(Config.from_dict(tiny()), tmp_path_factory.mktemp("runs") / "tiny")
