"""Measures the speed of training: `python -m studies.training_speed`.

It trains `configs/ppo/pot.yaml` for a few updates and writes `studies/results/training_speed.json`. With another number
of passes it writes only `--output`.
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
from agents.ppo import make_model, make_policy, make_vec_env
from agents.vec_env import SameStepVecEnv
from benchmarks import machine, machine_line
from benchmarks.speed import seconds, summary
from benchmarks.vector import many, native
from billiards_env.files import write_json
from studies import RESULTS

RECIPE = Path(__file__).resolve().parent.parent / "configs" / "ppo" / "pot.yaml"
OUTPUT = RESULTS / "training_speed.json"


class _Stopwatch(BaseCallback):
    """Sums the times of the environments' steps, of the computation of pots and of the updates in a training."""

    def __init__(self) -> None:
        super().__init__()
        self.seconds: dict[str, float] = dict.fromkeys(("environment", "search", "update"), 0.0)

    def _on_training_start(self) -> None:
        model: Any = self.model
        self._time("environment", model.env, "step_wait")
        self._time("search", model.policy.features_extractor, "compute")
        self._time("update", model, "train")

    def _time(self, part: str, owner: Any, name: str) -> None:
        function = getattr(owner, name)

        def timed(*args: Any) -> Any:
            begin = perf_counter()
            result = function(*args)
            self.seconds[part] += perf_counter() - begin
            return result

        setattr(owner, name, timed)

    def _on_step(self) -> bool:
        return True


def training_config(updates: int) -> Config:
    """Returns the configuration of the recipe `RECIPE` with this number of updates."""
    config = load(RECIPE)
    return dataclasses.replace(config, timesteps=config.n_envs * config.ppo.n_steps * updates)


def train(config: Config) -> dict[str, float]:
    """Trains once.

    Returns:
        `steps_per_second`, and shares of the time: `environment`, the environments' steps (simulation and adapter
        together), `search`, the computation of pots and their features, and `update`, the updates of PPO.
    """
    torch.set_num_threads(1)  # as agents.train does
    envs = make_vec_env(config)
    model, stopwatch = make_model(config, envs), _Stopwatch()
    envs.seed(0)
    begin = perf_counter()
    model.learn(config.timesteps, stopwatch)
    whole = perf_counter() - begin
    shares = {part: seconds / whole for part, seconds in stopwatch.seconds.items()}
    return {"steps_per_second": model.num_timesteps / whole, **shares}


def decision_time(config: Config) -> float:
    """Returns the time for the choice of one action in a batch, us."""
    envs = make_vec_env(config)
    policy = make_policy(config)
    # The policy stores the features of the last observations. Two alternating batches avoid this.
    batches: list[Any] = [envs.reset(), envs.reset()]
    envs.close()

    def decide() -> None:
        for observations in batches:
            policy.predict(observations, deterministic=True)

    decide()
    return 1e6 * seconds(decide) / (2 * config.n_envs)


def measure(repeats: int, config: Config, steps: int = 20) -> dict[str, Any]:
    """Measures the adapter to Stable-Baselines3, the policy and the training, `repeats` passes each.

    The adapter and the training have one more pass before these, which is not counted.

    Args:
        repeats: The number of passes.
        config: The configuration of the training.
        steps: The number of steps of the adapter in a pass.

    Returns:
        Medians and quartiles of `adapter` (steps/s of all environments together), `decision` (see `decision_time`) and
        `training` (see `train`), and a description of the machine.
    """
    found = {"machine": machine(), "repeats": repeats, "n_envs": config.n_envs}
    step = many(SameStepVecEnv(native(config.n_envs)), steps)
    adapter = [config.n_envs * steps / seconds(step) for _ in range(repeats + 1)][1:]
    decisions = [decision_time(config) for _ in range(repeats)]
    trained = [train(config) for _ in range(repeats + 1)][1:]
    return {
        **found,
        "adapter": summary(adapter),
        "decision": summary(decisions),
        "training": {name: summary([run[name] for run in trained]) for name in trained[0]},
    }


def blocks(result: Mapping[str, Any]) -> dict[str, str]:
    """Returns the results as Markdown, by name."""
    adapter = result["adapter"]["median"]
    trained = {name: found["median"] for name, found in result["training"].items()}
    rest = 1.0 - trained["environment"] - trained["search"] - trained["update"]
    return {
        "machine": machine_line(result["machine"]),
        "summary": f"The adapter to Stable-Baselines3 makes {adapter:,.0f} steps/s with {result['n_envs']:,} "
        f"environments. PPO with the recipe `pot` makes {trained['steps_per_second']:,.0f} steps/s on one core. Of "
        f"this time the environments take {trained['environment']:.0%}, the search for pots {trained['search']:.0%}, "
        f"the updates {trained['update']:.0%}, and the choice of actions and the rest {rest:.0%}. A decision of "
        f"its policy takes {result['decision']['median']:.1f} us in a batch.",
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
    result = measure(args.repeats, training_config(3))
    usual = args.repeats == parser.get_default("repeats")
    output: Path | None = OUTPUT if usual and args.output is None else args.output
    if output is not None:
        write_json(output, result)
    print(f"{blocks(result)['summary']}\n")
    print("not written, because there is no --output" if output is None else f"written to {output}")


if __name__ == "__main__":
    main()
