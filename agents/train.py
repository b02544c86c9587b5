"""Trains a policy on `Billiards-v0`: `python -m agents.train pot`, a row of `configs/learning.yaml`, or a YAML file.

The folder of a run holds `config.yaml` (all settings, with the seed), `versions.json`, `training.csv` (the learning
curve, see `Point`) and `checkpoints/`. After the training it also holds `policy.pt`, the weights of the policy. Reading
`policy.pt` runs no code from the file. A training with PPO also has `tensorboard/`, and at the end `model.zip`, which
Stable-Baselines3 loads.

The same command resumes an interrupted run from its newest checkpoint. At each checkpoint the seed and the number of
steps determine the seeds of all random generators. A resumed run therefore ends with the same weights as an
uninterrupted one.

With `--start-from` the training begins with the weights of another run, whose networks must have the same shape.
"""

from __future__ import annotations

import argparse
import csv
import importlib.metadata
import io
import platform
import shutil
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import NamedTuple

import torch
from filelock import FileLock
from stable_baselines3.common.policies import BasePolicy

import billiards_env
from agents.config import Config, load
from agents.learner import Training
from agents.learners import LEARNERS
from agents.ppo import deterministic, make_evaluation, make_policy
from billiards_env.bench.evaluation import evaluation_seeds, play_together
from billiards_env.commands import Parser, ending
from billiards_env.sb3.weights import is_slim, read_weights, set_weights
from billiards_env.support.checks import Range, entry_of, integer, number, real, result_of
from billiards_env.support.files import read_text, refusing, write_atomically, write_json

# The files and folders of a run, without config.yaml. A folder with a config.yaml is the folder of a run.
_FILES = ("versions.json", "training.csv", "model.zip", "policy.pt", "evaluation.json")
_FOLDERS = ("checkpoints", "tensorboard")
_LOCK = ".lock"
_CURVE = 2**24  # bytes of training.csv; a point has about 50
_PACKAGES = ("numpy", "gymnasium", "numba", "stable_baselines3", "torch")


def open_run(config: Config, run_dir: Path, fresh: bool = False) -> None:
    """Prepares a folder for the training of a configuration.

    Args:
        config: The configuration.
        run_dir: The folder of the run; created if missing.
        fresh: Whether to delete the run that is in the folder, if any.

    Raises:
        ValueError: If the folder holds a run of another configuration or other files, an argument of the environment is
            invalid, or the weights of `start_from` do not fit.
        TypeError: If an argument of the environment has the wrong type.
        OSError: If the folder cannot be written, or another process trains in it.
    """
    saved = run_dir / "config.yaml"
    policy = make_policy(config)  # raises an error before a file is written
    if config.start_from is not None and (fresh or not saved.exists()):
        start_from(policy, config.start_from)
    if not saved.exists() and run_dir.exists() and any(path.name != _LOCK for path in run_dir.iterdir()):
        raise ValueError(f"run_dir = {str(run_dir)!r}: expected a new folder or a run; it holds other files")
    run_dir.mkdir(parents=True, exist_ok=True)
    with locked(run_dir):
        if saved.exists() and not fresh:
            old, new = load(saved).to_dict(), config.to_dict()
            pairs = {name: (old.get(name), new.get(name)) for name in old | new}
            if changed := [f"{name} is {was!r}, not {now!r}" for name, (was, now) in pairs.items() if was != now]:
                raise ValueError(
                    f"run_dir = {str(run_dir)!r}: expected a run of the same settings, but {'; '.join(changed)}. "
                    "--run-dir chooses another folder, --fresh starts again"
                )
            return
        for name in _FILES:
            (run_dir / name).unlink(missing_ok=True)
        for name in _FOLDERS:
            shutil.rmtree(run_dir / name, ignore_errors=True)
        write_json(run_dir / "versions.json", versions())
        write_atomically(saved, config.to_yaml().encode())


def locked(run_dir: Path) -> FileLock:
    """Returns a lock of a folder against other processes. Entering it raises an OSError if another one holds it."""
    return FileLock(run_dir / _LOCK, timeout=0)


def train(config: Config, run_dir: Path, make: Callable[[Config, Path], Training] | None = None) -> None:
    """Trains a configuration, from the newest checkpoint if there is one. Does nothing if the run is finished.

    Args:
        config: The configuration.
        run_dir: The folder of the run, prepared by `open_run`.
        make: Makes the training; None for that of the learner of the configuration.

    Raises:
        OSError: If another process trains in the folder.
        ValueError: If a checkpoint is damaged or does not fit the configuration.
    """
    if (run_dir / "policy.pt").exists():
        print(f"{run_dir} is trained already ({config.timesteps:,} shots); --fresh starts again")
        return
    what, make = f"learner {config.learner!r}", make or entry_of("learner", config.learner, LEARNERS).make
    with locked(run_dir), one_fast_thread(), closing(result_of(what, Training, make, config, run_dir)) as training:
        if (checkpoint := newest_checkpoint(run_dir)) is not None:
            with _damaged():
                training.load(checkpoint)
        elif config.start_from is not None:
            start_from(training.policy, config.start_from)
        print(f"{run_dir}: {training.shots:,} of {config.timesteps:,} shots")
        with closing(LearningCurve(config, run_dir, training.shots, training.clock)) as curve:
            curve.measure(training.policy, training.shots, 0.0)
            while training.shots < config.timesteps:
                training.restart()
                rate, interval = 0.0, config.checkpoint_every
                goal = min((training.shots // interval + 1) * interval, config.timesteps)
                while (before := training.shots) < goal:
                    rate = real("training_success", training.update(), Range(0.0, 1.0))
                    training.shots = integer("shots", training.shots, Range(before + 1, None))
                if training.shots < config.timesteps:
                    (run_dir / "checkpoints").mkdir(exist_ok=True)
                    training.save(run_dir / "checkpoints" / f"{training.shots:09d}.zip")
                curve.measure(training.policy, training.shots, rate)
        training.finish(run_dir)


@contextmanager
def one_fast_thread() -> Iterator[None]:
    """PyTorch uses one thread from here on, and within this context replaces numbers below 1e-38, which are slow, by 0.

    With several threads, sums round differently on another machine, and such small networks gain little speed.
    """
    torch.set_num_threads(1)
    torch.set_flush_denormal(True)
    try:
        yield
    finally:
        torch.set_flush_denormal(False)


@contextmanager
def _damaged() -> Iterator[None]:
    """Adds to the error of a damaged checkpoint what to do."""
    try:
        yield
    except ValueError as error:
        raise ValueError(f"{error}; delete it, or start again with --fresh") from None


def start_from(policy: BasePolicy, run_dir: str) -> None:
    """Sets the weights of a policy to the weights of a finished run.

    Raises:
        FileNotFoundError: If the folder holds no finished run.
        ValueError: If the weights belong to another policy, or are slim.
    """
    path = Path(run_dir) / "policy.pt"
    if not path.is_file():
        raise FileNotFoundError(f"start_from = {run_dir!r}: expected the folder of a finished run, with policy.pt")
    try:
        weights = read_weights(path)
        if is_slim(weights):
            raise ValueError(f"{path} is slim, for playing only")
        set_weights(policy, weights, path)
    except ValueError as error:
        why = " ".join(str(error).split())
        raise ValueError(f"start_from = {run_dir!r}: expected a training of the same networks ({why})") from error


class Point(NamedTuple):
    """A line of `training.csv`.

    Attributes:
        steps: The number of environment steps (shots).
        seconds: The processor time that they took, s, without the evaluations; with RLlib the time on the clock.
        training_success: Success in the last 1000 episodes of the training, with exploration; with the learner
            "likelihood" that of the policy's own shots in the last update.
        success: Success in `config.evaluation_episodes` episodes without exploration, on layouts that do not occur in
            training; in a game the share of games that it wins against `ppo.RIVAL`.
        score: The mean score of these episodes.
    """

    steps: int
    seconds: float
    training_success: float
    success: float
    score: float


def learning_curve(run_dir: Path) -> list[Point]:
    """Returns the learning curve of a run. It is empty before the first measurement.

    Raises:
        OSError: If the file cannot be read.
        ValueError: If it does not hold a learning curve.
    """
    path, what = run_dir / "training.csv", "a learning curve"
    if not path.exists():
        return []
    text = read_text(path, _CURVE, what)
    with refusing(path, what):
        _, *lines = csv.reader(text.splitlines())
        return [Point(int(steps), *map(float, values)) for steps, *values in lines]


class LearningCurve:
    """Measures the policy of a training, prints the success and writes `training.csv`.

    Args:
        config: The configuration of the run.
        run_dir: The folder of the run.
        steps: The number of steps of the training so far. Later points in the file are dropped.
        clock: Measures the time of the training, s.
    """

    def __init__(self, config: Config, run_dir: Path, steps: int, clock: Callable[[], float]) -> None:
        self.config, self.run_dir, self.clock = config, run_dir, clock
        self.points = [point for point in learning_curve(run_dir) if point.steps <= steps]
        self._envs = make_evaluation(config, config.evaluation_episodes)
        self._begin = self.clock()

    def measure(self, policy: BasePolicy, steps: int, training_success: float) -> None:
        """Adds a point after `steps` steps, unless the last one has the same number."""
        seconds = self.clock() - self._begin + (self.points[-1].seconds if self.points else 0.0)
        if not self.points or self.points[-1].steps < steps:
            seeds = evaluation_seeds(self.config.seed, self.config.evaluation_episodes).tolist()
            result = play_together(self._envs, deterministic(policy), seeds)
            rate = result["success_rate"]
            self.points.append(Point(steps, round(seconds, 2), training_success, rate, result["mean_score"]))
            print(f"{steps:>12,} shots {seconds:6.0f} s  {rate:6.1%} of new layouts", flush=True)
            text = io.StringIO()
            csv.writer(text, lineterminator="\n").writerows([Point._fields, *self.points])
            write_atomically(self.run_dir / "training.csv", text.getvalue().encode())
        self._begin = self.clock()

    def close(self) -> None:
        """Closes the environments of the measurements."""
        self._envs.close()


def newest_checkpoint(run_dir: Path) -> Path | None:
    """Returns the checkpoint of a run with the most steps; None if there is none."""
    return max((run_dir / "checkpoints").glob("[0-9]*"), key=lambda path: int(path.stem), default=None)


def versions() -> dict[str, str]:
    """Returns the versions of Python, of this package and of the packages that affect the results."""
    return {
        "python": platform.python_version(),
        "platform": platform.platform(),
        "billiards_env": billiards_env.__version__,
        **{name: importlib.metadata.version(name) for name in _PACKAGES},
    }


def train_command(
    parser: argparse.ArgumentParser,
    arguments: list[str] | None,
    folder: Path,
    work: Callable[[argparse.Namespace, Config, Path], None],
) -> None:
    """Runs a command that trains.

    Args:
        parser: The parser, with the options of this command alone.
        arguments: The arguments of the command line; None for those of the process.
        folder: The folder of the runs.
        work: Trains a configuration in the folder of a run.
    """
    parser.add_argument("config", help="row of configs/learning.yaml, such as pot, or a YAML file")
    parser.add_argument("--run-dir", type=Path, help=f"folder of the run (default: {folder}/NAME)")
    parser.add_argument("--seed", type=number, help="default: the seed in the config")
    parser.add_argument("--timesteps", type=number, help="number of shots (default: as in the config)")
    parser.add_argument("--fresh", action="store_true", help="delete the run in the folder and start again")
    args = parser.parse_args(arguments)
    run_dir = args.run_dir or folder / Path(args.config).stem
    changes = {name: getattr(args, name, None) for name in ("seed", "timesteps", "start_from")}
    with ending("the same command resumes from the newest checkpoint"):
        work(args, load(args.config, **{name: value for name, value in changes.items() if value is not None}), run_dir)
    print(f"Next: python -m agents.evaluate {run_dir}")


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m agents.train --help`."""
    parser = Parser(prog="python -m agents.train", description="Train a policy on Billiards-v0.")
    parser.add_argument("--start-from", metavar="RUN_DIR", help="folder of a finished run whose weights to start with")

    def work(args: argparse.Namespace, config: Config, run_dir: Path) -> None:
        open_run(config, run_dir, args.fresh)
        train(config, run_dir)

    train_command(parser, arguments, Path("runs"), work)


if __name__ == "__main__":
    main()
