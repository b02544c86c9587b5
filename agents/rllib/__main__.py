"""The command `python -m agents.rllib`; see `agents.rllib`.

The folder of a run is as in `agents.train`, but RLlib writes the checkpoints. The same command resumes an
interrupted run from its newest checkpoint. It ends with the same weights as an uninterrupted one, because the seed and
the number of steps determine all random numbers after a checkpoint. Only the failure of a runner changes the weights.
"""

from __future__ import annotations

import argparse
import os
import shutil
import time
from collections import deque
from contextlib import closing
from pathlib import Path

import numpy as np

from agents.cluster import connect
from agents.config import Config
from agents.ppo import make_policy
from agents.rllib.rollouts import as_tensors
from agents.train import LearningCurve, locked, newest_checkpoint, one_fast_thread, open_run, train_command
from billiards_env.sb3.weights import save_policy
from billiards_env.support.commands import Parser


def train(config: Config, run_dir: Path, runners: int = 1) -> None:
    """Trains a configuration, from the newest checkpoint if there is one. Ray must be running.

    Args:
        config: The configuration.
        run_dir: The folder of the run, prepared by `agents.train.open_run`.
        runners: As in `algorithm_config`. It may differ from that before an interruption.

    Raises:
        OSError: If another process trains in the folder.
        ValueError: As in `algorithm_config`.
    """
    from agents.rllib.algorithm import ArrayPPO, algorithm_config  # imports Ray

    if (run_dir / "policy.pt").exists():
        print(f"{run_dir} is trained already ({config.timesteps:,} shots); --fresh starts again")
        return
    policy, successes = make_policy(config), deque[bool](maxlen=1000)
    with locked(run_dir), one_fast_thread():
        algorithm: ArrayPPO = algorithm_config(config, runners).build_algo()
        try:
            if (checkpoint := newest_checkpoint(run_dir)) is not None:
                algorithm.restore_from_path(str(checkpoint.resolve()))
            print(f"{run_dir}: {algorithm.steps:,} of {config.timesteps:,} shots")
            with closing(LearningCurve(config, run_dir, algorithm.steps, time.perf_counter)) as curve:
                while True:
                    steps = algorithm.steps
                    if algorithm.seed_next or steps >= config.timesteps:
                        policy.load_state_dict(as_tensors(algorithm.learner_group.get_weights()["default_policy"]))
                        curve.measure(policy, steps, float(np.mean(successes or [0.0])))
                    if steps >= config.timesteps:
                        break
                    algorithm.train()
                    successes.extend(algorithm.successes)
                    if algorithm.steps // config.checkpoint_every > steps // config.checkpoint_every:
                        _save(algorithm, run_dir / "checkpoints" / f"{algorithm.steps:09d}")
                        algorithm.seed_next = True
        finally:
            algorithm.stop()
    save_policy(policy, run_dir / "policy.pt")


def _save(algorithm: object, folder: Path) -> None:
    """Writes a checkpoint. An interruption leaves no incomplete one."""
    incomplete = folder.with_name(f"incomplete.{folder.name}")
    shutil.rmtree(incomplete, ignore_errors=True)
    algorithm.save_to_path(str(incomplete.resolve()))  # pyright: ignore[reportAttributeAccessIssue]
    os.replace(incomplete, folder)


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m agents.rllib --help`."""
    parser = Parser(prog="python -m agents.rllib", description="Train PPO with RLlib and Ray.")
    parser.add_argument("--address", help='address of a Ray cluster, e.g. "auto" (default: this machine only)')
    parser.add_argument("--runners", type=int, default=2, help="number of processes that play (default: %(default)s)")

    def work(args: argparse.Namespace, config: Config, run_dir: Path) -> None:
        from agents.rllib.algorithm import algorithm_config  # imports Ray

        connect(args.address, cpus=1 + args.runners)
        algorithm_config(config, args.runners)  # raises an error before a file is written
        open_run(config, run_dir, args.fresh)
        train(config, run_dir, args.runners)

    train_command(parser, arguments, Path("runs") / "rllib", work)


if __name__ == "__main__":
    main()
