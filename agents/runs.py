"""Trains many runs, several at a time, each in its own process, on this machine or on a Ray cluster."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Mapping
from concurrent.futures import as_completed
from pathlib import Path
from tempfile import TemporaryDirectory

import yaml
from tqdm import tqdm

from agents.cluster import RayExecutor
from agents.config import Config
from agents.train import learning_curve, open_run, train
from billiards_env.files import write_whole


def train_all(runs: Mapping[Path, Config], jobs: int, address: str | None = None) -> None:
    """Trains the runs that are not finished, from their newest checkpoints.

    Args:
        runs: The configuration of each run, by its folder.
        jobs: The number of runs at a time, at least 1.
        address: The address of a Ray cluster, see `cluster.connect`. Its nodes train as many runs at a time as they
            have cores, each from the beginning. None to train on this machine.

    Raises:
        ImportError: If Ray is not installed and there is an address.
        ValueError: If `jobs` is less than 1, or a folder holds a run of another configuration.
        RuntimeError: If a run fails. On this machine the other running trainings are stopped, and the next call resumes
            them. A cluster finishes the other runs.
        OSError: If a folder cannot be written.
    """
    if jobs < 1:
        raise ValueError(f"jobs = {jobs}: expected a whole number >= 1")
    for folder, config in runs.items():
        open_run(config, folder)
    waiting = [folder for folder in runs if not (folder / "policy.pt").exists()]
    if address is not None:
        _train_on_cluster({folder: runs[folder] for folder in waiting}, address)
        return
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


def _train_on_cluster(runs: Mapping[Path, Config], address: str) -> None:
    """Trains runs as Ray tasks and writes the files of each run as soon as it is finished."""
    failures = []
    with RayExecutor(address) as pool:
        folders = {pool.submit(trained_files, str(folder), config.to_yaml()): folder for folder, config in runs.items()}
        for done in tqdm(as_completed(folders), total=len(folders), unit="run", desc=address):
            if (failure := done.exception()) is not None:
                failures.append(str(failure))
                continue
            for name, data in sorted(done.result().items(), key=lambda file: file[0] == "policy.pt"):
                write_whole(folders[done] / name, data)
    if failures:
        raise RuntimeError("\n".join(failures))


def trained_files(name: str, config: str) -> dict[str, bytes]:
    """Trains a configuration in a temporary folder.

    Args:
        name: The name of the run, for messages.
        config: The configuration, as YAML.

    Returns:
        The content of the files of the run, by their paths, without the checkpoints.
    """
    with TemporaryDirectory() as parent:
        folder = Path(parent) / "run"
        settings = Config.from_dict(yaml.safe_load(config))
        open_run(settings, folder)
        train(settings, folder)
        files = [path for path in folder.rglob("*") if path.is_file() and path.parent.name != "checkpoints"]
        return {str(path.relative_to(folder)): path.read_bytes() for path in files if path.name != ".lock"}


def _start(folder: Path) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", "agents.train", str(folder / "config.yaml"), "--run-dir", str(folder)]
    with (folder / "train.log").open("ab") as log:
        return subprocess.Popen(command, stdout=log, stderr=subprocess.STDOUT)


def _done(folder: Path) -> int:
    curve = learning_curve(folder)
    return curve[-1].steps if curve else 0
