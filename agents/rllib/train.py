"""Trains PPO with RLlib. The folder of a run is that of `agents.train`, but its checkpoints are those of RLlib.

The same command resumes an interrupted run from its newest checkpoint. It ends with the same weights as an
uninterrupted run, because the seed and the number of steps determine all random numbers after a checkpoint. Only the
failure of a runner changes the weights.
"""

from __future__ import annotations

import dataclasses
import os
import shutil
import time
from collections import deque
from collections.abc import Collection
from contextlib import closing
from pathlib import Path
from typing import Any

import ray  # pyright: ignore[reportMissingImports]
from stable_baselines3.common.logger import Logger, TensorBoardOutputFormat

from agents.config import Config
from agents.ppo import make_policy
from agents.rllib.algorithm import ArrayPPO, algorithm_config
from agents.rllib.settings import Settings
from agents.train import LearningCurve, locked, progress_bar, start_from, versions
from billiards_env.files import write_json
from billiards_env.sb3.weights import save_policy


def train(config: Config, settings: Settings, run_dir: Path) -> None:
    """Trains a recipe, from the newest checkpoint if there is one. Ray must be running.

    Args:
        config: The recipe.
        settings: The numbers of processes. They may differ from those before an interruption.
        run_dir: The folder of the run, prepared by `agents.train.open_run`.

    Raises:
        ValueError: If another process trains in the folder.
        RuntimeError: If no runner works.
    """
    if (run_dir / "policy.pt").exists():
        print(f"{run_dir} is trained already ({config.timesteps:,} steps); --fresh starts again")
        return
    with locked(run_dir):
        write_json(run_dir / "versions.json", {**versions(), "ray": ray.__version__, **dataclasses.asdict(settings)})
        algorithm: ArrayPPO = algorithm_config(config, settings).build_algo()
        try:
            _train(algorithm, config, run_dir)
        finally:
            algorithm.stop()


def _train(algorithm: ArrayPPO, config: Config, run_dir: Path) -> None:
    policy = make_policy(config)
    checkpoint = newest_checkpoint(run_dir)
    if checkpoint is not None:
        algorithm.restore_from_path(str(checkpoint.resolve()))
        print(f"{run_dir}: resuming after {algorithm.steps:,} of {config.timesteps:,} steps")
    elif config.start_from is not None:
        start_from(policy, config.start_from)
        algorithm.set_policy(policy)
    successes = deque[bool](maxlen=1000)
    logger = Logger(str(run_dir), [TensorBoardOutputFormat(str(run_dir / "tensorboard"))])
    every = config.checkpoint_every
    bar = progress_bar(config.timesteps, algorithm.steps)
    with bar, closing(LearningCurve(config, run_dir, algorithm.steps, time.perf_counter)) as curve:
        while True:
            steps = algorithm.steps
            done = steps >= config.timesteps
            if algorithm.seed_next or done:
                algorithm.read_policy(policy)
                curve.measure(policy, steps, successes)
            if done:
                break
            result = algorithm.train()
            successes.extend(algorithm.successes.tolist())
            for name, value in _scalars(result, successes).items():
                logger.record(name, value)
            logger.dump(algorithm.steps)
            if algorithm.steps // every > steps // every and algorithm.steps < config.timesteps:
                _save(algorithm, run_dir / "checkpoints" / f"{algorithm.steps:09d}")
                algorithm.seed_next = True
            bar.set_postfix(curve.rates(successes), refresh=False)
            bar.update(algorithm.steps - steps)
    logger.close()
    save_policy(policy, run_dir / "policy.pt")


def newest_checkpoint(run_dir: Path) -> Path | None:
    """Returns the checkpoint of a run with the most steps; None if the run has no checkpoint."""
    folders = [path for path in (run_dir / "checkpoints").glob("[0-9]*") if path.name.isdigit()]
    return max(folders, key=lambda path: int(path.name), default=None)


def _save(algorithm: ArrayPPO, folder: Path) -> None:
    """Writes a checkpoint. An interruption leaves no incomplete one."""
    incomplete = folder.with_name(f"{folder.name}.incomplete")
    shutil.rmtree(incomplete, ignore_errors=True)
    algorithm.save_to_path(str(incomplete.resolve()))
    os.replace(incomplete, folder)


def _scalars(result: dict[str, Any], successes: Collection[bool]) -> dict[str, float]:
    """Returns the numbers that TensorBoard shows."""
    learner = result["learners"]["default_policy"]
    names = ("policy_loss", "vf_loss", "entropy", "vf_explained_var")
    rate = sum(successes) / max(len(successes), 1)
    return {"rollout/success_rate": rate, **{f"train/{name}": float(learner[name]) for name in names}}
