"""Trains many runs, several at a time, each in its own process."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Mapping
from pathlib import Path

from tqdm import tqdm

from agents.config import Config
from agents.train import learning_curve, open_run


def train_all(runs: Mapping[Path, Config], jobs: int) -> None:
    """Trains the runs that are not finished, from their newest checkpoints.

    Args:
        runs: The configuration of each run, by its folder.
        jobs: The number of runs at a time, at least 1.

    Raises:
        ValueError: If `jobs` is less than 1, or a folder holds a run of another configuration.
        RuntimeError: If a run fails. The other running trainings are stopped, and the next call resumes them.
        OSError: If a folder cannot be written.
    """
    if jobs < 1:
        raise ValueError(f"jobs = {jobs}: expected a whole number >= 1")
    for folder, config in runs.items():
        open_run(config, folder)
    waiting = [folder for folder in runs if not (folder / "policy.pt").exists()]
    steps = sum(config.timesteps for config in runs.values())
    running: dict[Path, subprocess.Popen[bytes]] = {}
    with tqdm(total=steps, unit="shot", unit_scale=True, desc=f"{len(runs)} runs") as bar:
        try:
            while waiting or running:
                while waiting and len(running) < jobs:
                    folder = waiting.pop(0)
                    running[folder] = _start(folder)
                time.sleep(0.5)
                for folder in [folder for folder, process in running.items() if process.poll() is not None]:
                    if running.pop(folder).returncode:
                        log = (folder / "train.log").read_text(encoding="utf-8", errors="replace")
                        raise RuntimeError(f"the training in {folder} failed:\n{log[-2000:]}")
                bar.set_postfix_str(", ".join(f"{folder.parent.name}/{folder.name}" for folder in running))
                bar.update(sum(min(_done(folder), config.timesteps) for folder, config in runs.items()) - bar.n)
        finally:
            for process in running.values():
                process.terminate()
                process.wait()


def _start(folder: Path) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", "agents.train", str(folder / "config.yaml"), "--run-dir", str(folder)]
    with (folder / "train.log").open("ab") as log:
        return subprocess.Popen(command, stdout=log, stderr=subprocess.STDOUT)


def _done(folder: Path) -> int:
    curve = learning_curve(folder)
    return curve[-1].steps if curve else 0
