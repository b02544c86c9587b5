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
from pathlib import Path

import numpy as np

from agents.cluster import connect
from agents.config import Config
from agents.learner import Training
from agents.ppo import make_policy
from agents.rllib.rollouts import as_tensors
from agents.train import open_run, train_command
from agents.train import train as run
from billiards_env.commands import Parser


class RLlibTraining(Training):
    """A training with PPO of RLlib. Ray must be running; `runners` as in `algorithm_config`."""

    clock = staticmethod(time.perf_counter)

    def __init__(self, config: Config, runners: int) -> None:
        from agents.rllib.algorithm import ArrayPPO, algorithm_config  # imports Ray

        self.policy, self._successes = make_policy(config), deque[bool](maxlen=1000)
        self._algorithm: ArrayPPO = algorithm_config(config, runners).build_algo()
        self._read()

    def _read(self) -> None:
        """Reads the weights and the number of steps of RLlib."""
        self.policy.load_state_dict(as_tensors(self._algorithm.learner_group.get_weights()["default_policy"]))
        self.shots = self._algorithm.steps

    def restart(self) -> None:
        """Seeds all random generators before the next shots."""
        self._algorithm.seed_next = True

    def update(self) -> float:
        """Plays and learns from a batch."""
        self._algorithm.train()
        self._successes.extend(self._algorithm.successes)
        self._read()
        return float(np.mean(self._successes or [0.0]))

    def save(self, path: Path) -> None:
        """Writes a checkpoint, a folder. An interruption leaves no incomplete one."""
        incomplete = path.with_name(f"incomplete.{path.stem}")
        shutil.rmtree(incomplete, ignore_errors=True)
        self._algorithm.save_to_path(str(incomplete.resolve()))
        os.replace(incomplete, path.with_suffix(""))

    def load(self, path: Path) -> None:
        """Reads a checkpoint."""
        self._algorithm.restore_from_path(str(path.resolve()))
        self._read()

    def close(self) -> None:
        """Stops the processes that play."""
        self._algorithm.stop()


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
    run(config, run_dir, lambda config, run_dir: RLlibTraining(config, runners))


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
