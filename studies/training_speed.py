"""Measures the speed of training: `python -m studies.training_speed`.

The environments play one-shot episodes at one object ball. The results are written to
`studies/results/training_speed.json`; with another number of passes only to `--output`.
"""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Mapping
from pathlib import Path
from time import perf_counter
from typing import Any

import torch
from stable_baselines3.common.callbacks import BaseCallback

from agents.config import Config, load
from agents.ppo import make_model, make_vec_env
from agents.vec_env import SameStepVecEnv
from benchmarks import machine, machine_line
from benchmarks.speed import seconds, summary
from benchmarks.vector import many, native
from billiards_env.files import write_json
from studies import RESULTS

RECIPE = Path(__file__).resolve().parent.parent / "configs" / "ppo" / "pot.yaml"
OUTPUT = RESULTS / "training_speed.json"
N_ENVS = 1024


class _Stopwatch(BaseCallback):
    """Sums the time of the environments' steps in a training."""

    def __init__(self) -> None:
        super().__init__()
        self.seconds = 0.0

    def _on_training_start(self) -> None:
        envs: Any = self.model.env
        step_wait = envs.step_wait

        def timed() -> Any:
            begin = perf_counter()
            result = step_wait()
            self.seconds += perf_counter() - begin
            return result

        envs.step_wait = timed

    def _on_step(self) -> bool:
        return True


def training_config(n_envs: int, n_steps: int, updates: int) -> Config:
    """Returns the configuration of the recipe `RECIPE` with these settings and minibatches of at most 4,096 steps."""
    config = load(RECIPE)
    rollout = n_envs * n_steps
    settings = dataclasses.replace(config.ppo, n_steps=n_steps, batch_size=min(4096, rollout))
    return dataclasses.replace(config, n_envs=n_envs, timesteps=rollout * updates, ppo=settings)


def train(config: Config) -> dict[str, float]:
    """Trains once.

    Returns:
        `steps_per_second`, and `environment_share`: the share of the time that the environments' steps take, simulation
        and adapter together.
    """
    torch.set_num_threads(1)  # as agents.train does
    envs = make_vec_env(config)
    model, stopwatch = make_model(config, envs), _Stopwatch()
    envs.seed(0)
    begin = perf_counter()
    model.learn(config.timesteps, stopwatch)
    whole = perf_counter() - begin
    return {"steps_per_second": model.num_timesteps / whole, "environment_share": stopwatch.seconds / whole}


def measure(repeats: int, config: Config, steps: int = 20) -> dict[str, Any]:
    """Measures the adapter to Stable-Baselines3 and the training `repeats` times each, after one pass to warm up.

    Args:
        repeats: The number of passes.
        config: The configuration of the training.
        steps: The number of steps of the adapter in a pass.

    Returns:
        `adapter`, steps/s of all environments together, and `training`; both with medians and quartiles.
    """
    found = {"machine": machine(), "repeats": repeats}
    step = many(SameStepVecEnv(native(config.n_envs)), steps)
    adapter = [config.n_envs * steps / seconds(step) for _ in range(repeats + 1)][1:]
    trained = [train(config) for _ in range(repeats + 1)][1:]
    return {
        **found,
        "adapter": summary(adapter),
        "training": {name: summary([run[name] for run in trained]) for name in trained[0]},
    }


def blocks(result: Mapping[str, Any]) -> dict[str, str]:
    """Returns the results as Markdown, by name."""
    adapter = result["adapter"]["median"]
    speed, share = (result["training"][name]["median"] for name in ("steps_per_second", "environment_share"))
    return {
        "machine": machine_line(result["machine"]),
        "summary": f"The adapter to Stable-Baselines3 makes {adapter:,.0f} steps/s with {N_ENVS:,} environments. PPO "
        f"with minibatches of 4,096 makes {speed:,.0f} steps/s; the environments take {share:.1%} of that time.",
    }


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m studies.training_speed --help`."""
    parser = argparse.ArgumentParser(prog="python -m studies.training_speed", description="Measure speeds of training.")
    parser.add_argument("--repeats", type=int, default=6, help="passes (default: %(default)s)")
    parser.add_argument(
        "--output", type=Path, help=f"JSON file (default: {OUTPUT}; with another --repeats nothing is written)"
    )
    args = parser.parse_args(arguments)
    if args.repeats < 1:
        parser.error(f"--repeats = {args.repeats}: expected a whole number >= 1")
    result = measure(args.repeats, training_config(N_ENVS, 16, 3))
    usual = args.repeats == parser.get_default("repeats")
    output: Path | None = OUTPUT if usual and args.output is None else args.output
    if output is not None:
        write_json(output, result)
    print(f"{blocks(result)['summary']}\n")
    print("not written, because there is no --output" if output is None else f"written to {output}")


if __name__ == "__main__":
    main()
