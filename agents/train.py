"""Trains a policy on `Billiards-v0`: `python -m agents.train configs/ppo/pot.yaml`.

The folder of a run holds `config.yaml` (all settings, with the seed), `versions.json`, `training.csv` (the learning
curve, see `Point`), `tensorboard/` and `checkpoints/`. After the training it also holds `model.zip`, which
Stable-Baselines3 loads, and `policy.pt`, the weights of the policy. Reading `policy.pt` runs no code from the file.

The same command resumes an interrupted run from its newest checkpoint that is not damaged. At each checkpoint the seed
and the number of steps determine the seeds of all random generators. A resumed run therefore ends with the same weights
as an uninterrupted one.

With `--start-from` the training begins with the weights of another run, whose networks must have the same shape.

A higher `--timesteps` continues a run, even a finished one. Its schedules are then those of the new length.
"""

from __future__ import annotations

import argparse
import contextlib
import csv
import dataclasses
import importlib.metadata
import io
import platform
import shutil
import sys
import time
from collections import deque
from collections.abc import Callable, Collection, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np
import torch
from filelock import FileLock, Timeout
from stable_baselines3 import PPO
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import KVWriter, Logger, TensorBoardOutputFormat
from stable_baselines3.common.policies import ActorCriticPolicy, BasePolicy
from stable_baselines3.common.save_util import load_from_zip_file
from stable_baselines3.common.type_aliases import TensorDict
from stable_baselines3.common.utils import set_random_seed
from tqdm import tqdm

import billiards_env
from agents.config import Config, changed, load
from agents.output import print_commands, print_table
from agents.ppo import deterministic, make_model, make_policy, make_vec_env, make_vector, training_seed
from billiards_env.evaluation import evaluation_seeds, play_together
from billiards_env.files import write_json, write_whole
from billiards_env.sb3.weights import load_weights, save_policy, whole_archive

# The files and folders of a run, without config.yaml. A folder with a config.yaml is the folder of a run.
_FILES = ("versions.json", "training.csv", "model.zip", "policy.pt", "evaluation.json")
_FOLDERS = ("checkpoints", "tensorboard")
_LOCK = ".lock"
_BAR = "{percentage:3.0f}%|{bar}| {n_fmt}/{total_fmt} shots [{remaining} left{postfix}]"
_PACKAGES = ("numpy", "gymnasium", "numba", "stable_baselines3", "torch")


def open_run(config: Config, run_dir: Path, fresh: bool = False, longer: bool = False) -> None:
    """Prepares a folder for the training of a configuration.

    Args:
        config: The configuration.
        run_dir: The folder of the run; created if missing.
        fresh: Whether to delete the run that is in the folder, if any.
        longer: Whether a run in the folder may continue with more timesteps, see `_lengthen`.

    Raises:
        ValueError: If the folder holds a run of another configuration or other files, if another process trains in it,
            if an argument of the environment is impossible, or if the weights of `start_from` do not fit.
        TypeError: If an argument of the environment has the wrong type.
        OSError: If the folder cannot be written.
    """
    saved = run_dir / "config.yaml"
    policy = make_policy(config)  # raises an error before a file is written
    if config.start_from is not None and (fresh or not saved.exists()):
        start_from(policy, config.start_from)
    if run_dir.is_file():
        raise ValueError(f"run_dir = {str(run_dir)!r}: expected a new folder or that of a run; it is a file")
    if run_dir.exists() and not saved.exists() and any(path.name != _LOCK for path in run_dir.iterdir()):
        raise ValueError(
            f"run_dir = {str(run_dir)!r}: expected a new folder or that of a run; it is not empty and holds no run"
        )
    with locked(run_dir):
        if saved.exists() and fresh:
            for name in _FILES:
                (run_dir / name).unlink(missing_ok=True)
            for name in _FOLDERS:
                shutil.rmtree(run_dir / name, ignore_errors=True)
        elif saved.exists():
            found = load(saved)
            longer = longer and found.timesteps < config.timesteps
            expected = dataclasses.replace(found, timesteps=config.timesteps) if longer else found
            if differences := _differences(expected.to_dict(), config.to_dict()):
                raise ValueError(
                    f"{run_dir} holds a run of another configuration; choose another folder with --run-dir or start "
                    "again with --fresh:\n" + "\n".join(f"  {line}" for line in differences)
                )
            if longer and (run_dir / "policy.pt").exists():
                _lengthen(run_dir)
        write_whole(saved, config.to_yaml().encode())
        if not (run_dir / "policy.pt").exists():  # a finished run keeps the versions that made it
            write_json(run_dir / "versions.json", versions())


def _lengthen(run_dir: Path) -> None:
    """Turns a finished run into an interrupted one, so that it can continue: the model becomes its newest checkpoint.

    Raises:
        ValueError: If the folder does not hold the model and the learning curve.
    """
    model, curve = run_dir / "model.zip", learning_curve(run_dir)
    if not curve or not model.exists():
        raise ValueError(f"run_dir = {str(run_dir)!r}: expected model.zip and training.csv, to continue the training")
    write_whole(run_dir / "checkpoints" / f"{curve[-1].steps:09d}.zip", model.read_bytes())
    for name in ("policy.pt", "model.zip", "evaluation.json"):
        (run_dir / name).unlink(missing_ok=True)


@contextlib.contextmanager
def locked(run_dir: Path) -> Iterator[None]:
    """Locks the folder of a run against other processes. The lock ends with the process.

    Raises:
        ValueError: If another process holds the lock.
    """
    run_dir.mkdir(parents=True, exist_ok=True)
    lock = FileLock(run_dir / _LOCK, timeout=0)
    try:
        lock.acquire()
    except Timeout as error:
        raise ValueError(
            f"run_dir = {str(run_dir)!r}: expected a folder in which no other training runs; wait for its end or "
            "choose another folder with --run-dir"
        ) from error
    try:
        yield
    finally:
        lock.release()


def train(config: Config, run_dir: Path) -> None:
    """Trains a configuration, from the newest checkpoint if there is one. Does nothing if the run is finished.

    Args:
        config: The configuration.
        run_dir: The folder of the run, prepared by `open_run`.

    Raises:
        ValueError: If another process trains in the folder, or a checkpoint does not fit the configuration.
    """
    if (run_dir / "policy.pt").exists():
        print(
            f"{run_dir} is trained already ({config.timesteps:,} steps); a higher --timesteps continues the training, "
            "--fresh starts again"
        )
        return
    # With several threads, sums round differently on another machine, and such small networks gain little speed.
    torch.set_num_threads(1)
    with locked(run_dir):
        model = _train(config, run_dir)
        _save(model, run_dir / "model.zip")
        save_policy(model.policy, run_dir / "policy.pt")


def _begin(model: PPO, config: Config, run_dir: Path) -> None:
    """Sets the weights to those of the newest checkpoint, or to those of `start_from`, if there are any."""
    if checkpoints(run_dir):
        _resume(model, config, run_dir)
    elif config.start_from is not None:
        start_from(model.policy, config.start_from)


def _train(config: Config, run_dir: Path) -> PPO:
    outputs: list[KVWriter] = [TensorBoardOutputFormat(str(run_dir / "tensorboard"))]
    with closing(make_vec_env(config)) as envs, closing(Logger(str(run_dir), outputs)) as logger:
        model = make_model(config, envs)
        model.set_logger(logger)
        rollout = config.n_envs * config.ppo.n_steps
        total = -(-config.timesteps // rollout) * rollout
        if total:
            print(
                f"{run_dir}: {total:,} steps (shots): timesteps = {config.timesteps:,}, rounded up to whole updates of "
                f"{rollout:,} steps (n_envs * ppo.n_steps)"
            )
        _begin(model, config, run_dir)
        # A first shot compiles the engine, so that its notices appear before the progress bar.
        envs.reset()
        envs.step(np.zeros((config.n_envs, *(envs.action_space.shape or ()))))
        with (
            progress_bar(total, model.num_timesteps) as bar,
            closing(LearningCurve(config, run_dir, model.num_timesteps)) as curve,
        ):
            callback = _Callback(curve, bar)
            remaining = max(config.timesteps - model.num_timesteps, 0)
            model.learn(remaining, callback, reset_num_timesteps=False)
            callback.measure()
    return model


def progress_bar(total: int, done: int) -> tqdm:
    """Returns the progress bar of a training of `total` steps, of which `done` are played; none without steps."""
    width = shutil.get_terminal_size().columns  # 80 if the terminal has no width; tqdm then shows no bar
    most = max(total, done)
    return tqdm(total=most, disable=not total, initial=done, unit_scale=True, bar_format=_BAR, ncols=width)


def _resume(model: PPO, config: Config, run_dir: Path) -> None:
    """Sets the weights and the number of steps to those of the newest checkpoint that is whole."""
    checkpoint = newest_checkpoint(run_dir)
    for path in checkpoints(run_dir):
        if path == checkpoint:
            break
        print(f"{path} is damaged and is skipped")
    if checkpoint is None:
        raise ValueError(
            f"{run_dir / 'checkpoints'}: expected a checkpoint that can be read, but all are damaged; --fresh starts "
            "again"
        )
    try:
        model.set_parameters(_weights(checkpoint), device="cpu")
    except (AttributeError, KeyError, RuntimeError, TypeError, ValueError) as error:
        raise ValueError(f"{checkpoint} does not fit the configuration; --fresh starts again: {error}") from error
    model.num_timesteps = int(checkpoint.stem)
    print(f"{run_dir}: resuming after {model.num_timesteps:,} of {config.timesteps:,} steps")


def start_from(policy: BasePolicy, run_dir: str) -> None:
    """Sets the weights of a policy to those of a finished run.

    Raises:
        FileNotFoundError: If the folder holds no finished run.
        ValueError: If the weights are those of another policy.
    """
    path = Path(run_dir) / "policy.pt"
    if not path.is_file():
        raise FileNotFoundError(f"start_from = {run_dir!r}: expected the folder of a finished run, with policy.pt")
    try:
        load_weights(policy, path)
    except ValueError as error:
        why = " ".join(str(error).split())
        raise ValueError(f"start_from = {run_dir!r}: expected a run with the same networks ({why})") from error


class Point(NamedTuple):
    """A line of `training.csv`.

    Attributes:
        steps: The number of environment steps.
        seconds: The processor time that they took, s, without the evaluations; with RLlib the time on the clock.
        training_success: Success in the last 1000 episodes of the training, with exploration.
        success: Success in `config.evaluation_episodes` episodes without exploration, on layouts that do not occur in
            training.
        score: The mean score of these episodes.
    """

    steps: int
    seconds: float
    training_success: float
    success: float
    score: float


def learning_curve(run_dir: Path) -> list[Point]:
    """Returns the learning curve of a run. It is empty before the first measurement."""
    path = run_dir / "training.csv"
    if not path.exists():
        return []
    with path.open(newline="", encoding="utf-8") as file:
        return [
            Point(int(row["steps"]), *(float(row[name]) for name in Point._fields[1:])) for row in csv.DictReader(file)
        ]


class LearningCurve:
    """Measures the policy of a training and writes `training.csv`.

    Args:
        config: The configuration of the run.
        run_dir: The folder of the run.
        steps: The number of steps of the training so far. Later points in the file are dropped.
        clock: Measures the time of the training, s.

    Attributes:
        points: The points of the curve.
    """

    def __init__(
        self, config: Config, run_dir: Path, steps: int, clock: Callable[[], float] = time.process_time
    ) -> None:
        self.config, self.run_dir, self.clock = config, run_dir, clock
        self.points = [point for point in learning_curve(run_dir) if point.steps <= steps]
        self._envs = make_vector(config, config.evaluation_episodes)
        self._begin = self.clock()

    def measure(self, policy: BasePolicy, steps: int, successes: Collection[bool]) -> None:
        """Adds a point after `steps` steps, unless the last one has the same number.

        `successes` are those of the last episodes of the training.
        """
        seconds = self.clock() - self._begin + (self.points[-1].seconds if self.points else 0.0)
        if not self.points or self.points[-1].steps < steps:
            seeds = evaluation_seeds(self.config.seed, self.config.evaluation_episodes).tolist()
            result = play_together(self._envs, deterministic(policy), seeds)
            trained = sum(successes) / max(len(successes), 1)
            self.points.append(Point(steps, round(seconds, 2), trained, result["success_rate"], result["mean_score"]))
            text = io.StringIO()
            csv.writer(text, lineterminator="\n").writerows([Point._fields, *self.points])
            write_whole(self.run_dir / "training.csv", text.getvalue().encode())
        self._begin = self.clock()

    def close(self) -> None:
        """Closes the environments of the measurements."""
        self._envs.close()

    def rates(self, successes: Collection[bool]) -> dict[str, str]:
        """Returns two rates of success for the progress bar: of the last episodes, and of the last point."""
        shown = {}
        if successes:
            shown["exploring"] = f"{sum(successes) / len(successes):.0%}"
        if self.points:
            shown["deterministic"] = f"{self.points[-1].success:.0%}"
        return shown


def checkpoints(run_dir: Path) -> list[Path]:
    """Returns the files of the checkpoints of a run, from the most to the fewest steps."""
    return sorted((run_dir / "checkpoints").glob("[0-9]*.zip"), key=lambda path: int(path.stem), reverse=True)


def newest_checkpoint(run_dir: Path) -> Path | None:
    """Returns the checkpoint of a run with the most steps that can be read; None if there is none."""
    for path in checkpoints(run_dir):
        try:
            _weights(path)
        except ValueError:
            continue
        return path
    return None


def _weights(path: Path) -> TensorDict:
    """Returns the weights in a checkpoint of the policy and of its optimizer. Nothing else is read.

    Raises:
        ValueError: If the file is damaged or holds other objects.
    """
    with whole_archive(path, "a checkpoint"):
        _, weights, _ = load_from_zip_file(path, load_data=False, device="cpu")
        if not weights:  # the end of an incomplete archive may be that of an archive inside it
            raise ValueError
    return weights


def versions() -> dict[str, str]:
    """Returns the versions of Python, of this package and of the packages that affect the results."""
    return {
        "python": platform.python_version(),
        "platform": platform.platform(),
        "billiards_env": billiards_env.__version__,
        **{name: importlib.metadata.version(name) for name in _PACKAGES},
    }


class _Callback(BaseCallback):
    """Seeds the training, saves checkpoints, shows the progress and logs the success."""

    def __init__(self, curve: LearningCurve, bar: tqdm) -> None:
        super().__init__()
        self.curve, self.config, self.run_dir, self.bar = curve, curve.config, curve.run_dir, bar
        self.successes: deque[bool] = deque(maxlen=1000)
        self.next_checkpoint = 0
        self._show()

    def measure(self) -> None:
        """Adds a point to the learning curve, without a change to the random generators of the training."""
        self.curve.measure(cast(ActorCriticPolicy, self.model.policy), self.num_timesteps, self.successes)
        self._show()

    def _on_rollout_start(self) -> None:
        if self.num_timesteps < self.next_checkpoint:
            return
        self.measure()
        if self.next_checkpoint:
            _save(self.model, self.run_dir / "checkpoints" / f"{self.num_timesteps:09d}.zip")
        every = self.config.checkpoint_every
        self.next_checkpoint = (self.num_timesteps // every + 1) * every
        self._reseed()

    def _reseed(self) -> None:
        """Seeds all generators. What follows depends only on the weights, the seed and the number of steps."""
        model = self.model
        assert isinstance(model, PPO)
        assert model.env is not None
        seed = training_seed(self.config, self.num_timesteps)
        set_random_seed(seed)
        model.env.seed(seed)
        # Unfinished episodes are dropped: the next rollout begins with a reset.
        model._last_obs = cast(Any, model.env.reset())
        model._last_episode_starts = np.ones(self.config.n_envs, dtype=bool)

    def _on_step(self) -> bool:
        for done, info in zip(self.locals["dones"], self.locals["infos"], strict=True):
            if done:
                self.successes.append(bool(info["is_success"]))
        return True

    def _on_rollout_end(self) -> None:
        if self.successes:
            self.logger.record("rollout/success_rate", sum(self.successes) / len(self.successes))
        self._show()
        self.bar.update(self.num_timesteps - self.bar.n)

    def _show(self) -> None:
        """Shows two rates of success in the progress bar: in training, and at the last point of the learning curve."""
        self.bar.set_postfix(self.curve.rates(self.successes), refresh=False)


def _save(model: BaseAlgorithm, path: Path) -> None:
    buffer = io.BytesIO()
    model.save(buffer)
    write_whole(path, buffer.getvalue())


def _differences(saved: dict, asked: dict, prefix: str = "") -> list[str]:
    """Returns one line for each setting that differs between two configurations, which are plain data."""
    lines = []
    for key in {**saved, **asked}:
        old, new = saved.get(key), asked.get(key)
        if isinstance(old, dict) and isinstance(new, dict):
            lines += _differences(old, new, f"{prefix}{key}.")
        elif old != new:
            lines.append(f"{prefix}{key}: {old!r} in the folder, {new!r} requested")
    return lines


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m agents.train --help`."""
    parser = argparse.ArgumentParser(prog="python -m agents.train", description="Train a policy on Billiards-v0.")
    parser.add_argument("config", type=Path, help="YAML file of settings, e.g. configs/ppo/pot.yaml")
    parser.add_argument("--run-dir", type=Path, help="folder of the run (default: runs/NAME OF THE CONFIG)")
    parser.add_argument("--seed", help="default: that of the config")
    parser.add_argument(
        "--timesteps", help="default: that of the config; a higher number continues the run in the folder"
    )
    parser.add_argument("--start-from", metavar="RUN_DIR", help="folder of a finished run whose weights to start with")
    parser.add_argument("--fresh", action="store_true", help="delete the run in the folder and start again")
    args = parser.parse_args(arguments)
    run_dir = args.run_dir or Path("runs") / args.config.stem
    try:
        given = {k: v for k in ("seed", "timesteps", "start_from") if (v := getattr(args, k)) is not None}
        config = changed(load(args.config), given)
        open_run(config, run_dir, args.fresh, longer=True)
    except (OSError, TypeError, ValueError) as error:
        sys.exit(f"error: {error}")
    try:
        train(config, run_dir)
    except (OSError, ValueError) as error:
        sys.exit(f"error: {error}")
    except KeyboardInterrupt:
        checkpoint = newest_checkpoint(run_dir)
        done = int(checkpoint.stem) if checkpoint else 0
        print(f"\ninterrupted; the same command resumes after {done:,} of {config.timesteps:,} steps", file=sys.stderr)
        sys.exit(130)
    print_result(run_dir, config)


def print_result(run_dir: Path, config: Config) -> None:
    """Prints the last point of the learning curve and a command for the next step."""
    if curve := learning_curve(run_dir):
        point = curve[-1]
        rows = (
            ("exploring", "last 1,000 of the training", f"{point.training_success:.1%}", "-"),
            (
                "deterministic",
                f"{config.evaluation_episodes:,} on new layouts",
                f"{point.success:.1%}",
                f"{point.score:.3f}",
            ),
        )
        time_taken = f"{point.seconds / 60:.1f} minutes" if point.seconds >= 120 else f"{point.seconds:.0f} s"
        title = f"{run_dir} after {point.steps:,} steps, which took {time_taken} of one core"
        print_table(title, ("actions", "episodes", "success", "score"), rows)
    print_commands("Next:", {"compare with random": ("-m", "agents.evaluate", str(run_dir))})


if __name__ == "__main__":
    main()
