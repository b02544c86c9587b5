"""Measures training with RLlib on a cluster of two nodes on this machine: `python -m studies.cluster_speed`.

It trains the recipe `configs/ppo/pot.yaml` with five seeds, compares the policies with those of Stable-Baselines3 in
`studies/results/recipes.json`, and writes `studies/results/cluster_speed.json`. It needs the extra `rllib`.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import sys
from collections.abc import Mapping
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

import numpy as np
import torch

from agents.config import Config, Policy, load
from agents.evaluate import evaluate
from agents.intervals import as_percent, over_seeds
from agents.ppo import make_policy
from agents.rllib.rollouts import Rollouts
from agents.rllib.settings import Settings
from agents.train import learning_curve, open_run
from benchmarks import check_counts, machine, machine_line, table
from benchmarks.speed import summary
from billiards_env.checks import missing
from billiards_env.files import write_json
from studies import RESULTS, RUNS

RECIPE = Path(__file__).resolve().parent.parent / "configs" / "ppo" / "pot.yaml"
OUTPUT = RESULTS / "cluster_speed.json"

SEEDS = range(5)
NODES = 64
"""The number of nodes of the plan, with `CORES` cores each."""
CORES = 16
NETWORK = 1.25e9
"""Bytes per second of the network in the plan: 10 Gbit/s."""

POLICIES = {"small": Policy(hidden=(64, 64)), "pots": load(RECIPE).policy}
"""The policies of the runners: two layers of 64 units without prior knowledge, and the policy of the recipe."""

_OWN = 256  # environments of RLlib's own runner


def one_runner(config: Config, repeats: int) -> dict[str, Any]:
    """Measures one runner on one core.

    Returns:
        Medians and quartiles of `steps_per_second` and of the time of a step in its parts, us: `environment`,
        `features` (the search for pots), `networks`, and `rest`. `bytes` is the size of a step for the learner.
    """
    policy = make_policy(config)
    rollouts = Rollouts(config, policy, config.n_envs, 0)
    rollouts.seed(0)
    spent: dict[str, float] = {}

    def timed(name: str, function: Any) -> Any:
        def call(*args: Any) -> Any:
            begin = perf_counter()
            result = function(*args)
            spent[name] += perf_counter() - begin
            return result

        return call

    rollouts.envs.step = timed("environment", rollouts.envs.step)
    rollouts._inputs = timed("features", rollouts._inputs)
    policy.forward = timed("networks", policy.forward)
    found, size = [], 0
    for _ in range(repeats + 1):
        spent |= dict.fromkeys(("environment", "features", "networks"), 0.0)
        begin = perf_counter()
        arrays, _ = rollouts.play(config.ppo.n_steps)
        whole = perf_counter() - begin
        steps = len(arrays["actions"])
        size = sum(array.nbytes for array in arrays.values()) // steps
        parts = {name: 1e6 * seconds / steps for name, seconds in spent.items()}
        rest = 1e6 * whole / steps - sum(parts.values())
        found.append({"steps_per_second": steps / whole, **parts, "rest": rest})
    return {name: summary([run[name] for run in found[1:]]) for name in found[0]} | {"bytes": size}


def own_runner(repeats: int) -> dict[str, Any]:
    """Measures RLlib's own runner with its own small network, in this process. Returns steps/s."""
    from agents.rllib.algorithm import own_runner as make_runner

    runner, rates = make_runner(_OWN), []
    for _ in range(repeats + 1):
        begin = perf_counter()
        episodes = runner.sample(num_timesteps=8 * _OWN)
        rates.append(sum(map(len, episodes)) / (perf_counter() - begin))
    runner.stop()
    return summary(rates[1:])


def two_runners(config: Config, repeats: int) -> dict[str, Any]:
    """Measures one runner and two runners on two nodes, alternately, and the learner. The process is in a cluster.

    Returns:
        Medians and quartiles of `one` and `two`, steps/s with the transfer of the arrays to this process;
        `efficiency`, half their ratio in each repeat; `processor`, the same ratio with the time of the processor of all
        processes instead of the clock; and `learner`, the steps/s of the updates. `weights_bytes` is the size of the
        weights.
    """
    from agents.rllib.algorithm import algorithm_config

    algorithm = algorithm_config(config, Settings(recipe="", runners=2)).build_algo()
    group, weights = algorithm.env_runner_group, algorithm.weights()
    steps = config.n_envs * config.ppo.n_steps // 2  # of one runner

    def processor_time() -> float:
        return process_time() + sum(group.foreach_env_runner(lambda _: process_time(), local_env_runner=False))

    def play(runners: list[int]) -> tuple[float, float]:
        """Returns the steps per second, by the clock and by the time of the processor."""
        used, begin = processor_time(), perf_counter()
        parts = group.foreach_env_runner(
            "sample",
            kwargs={"weights": weights, "steps": 0, "seed": False},
            local_env_runner=False,
            remote_worker_ids=runners,
        )
        whole = perf_counter() - begin
        assert len(parts) == len(runners)
        return len(runners) * steps / whole, len(runners) * steps / (processor_time() - used)

    found = []
    for repeat in range(repeats + 1):
        one, two = play([1 + repeat % 2]), play([1, 2])
        arrays = algorithm._sample(0, False)
        begin = perf_counter()
        algorithm.update(arrays, 0)
        learner = len(arrays["actions"]) / (perf_counter() - begin)
        ratios = {"efficiency": two[0] / one[0] / 2, "processor": two[1] / one[1]}
        found.append({"one": one[0], "two": two[0], **ratios, "learner": learner})
    algorithm.stop()
    size = sum(np.asarray(array).nbytes for array in weights.values())
    return {name: summary([run[name] for run in found[1:]]) for name in found[0]} | {"weights_bytes": size}


def learning(config: Config, folder: Path) -> list[dict[str, Any]]:
    """Trains the recipe with two runners and each seed, if it is not trained yet. The process is in a cluster.

    Returns:
        For each seed `seed`, `seconds` (of the training) and `success` (on new layouts).
    """
    from agents.rllib.train import train

    found = []
    for seed in SEEDS:
        run = folder / f"seed{seed}"
        seeded = dataclasses.replace(config, seed=seed)
        open_run(seeded, run)
        train(seeded, Settings(recipe="", runners=2), run)
        success = evaluate(run)["policy"]["success_rate"]
        found.append({"seed": seed, "seconds": learning_curve(run)[-1].seconds, "success": success})
    return found


def measure(repeats: int, folder: Path) -> dict[str, Any]:
    """Returns all measurements.

    Args:
        repeats: The number of repeats of each.
        folder: The folder of the runs.
    """
    from cluster import two_nodes

    torch.set_num_threads(1)
    config = load(RECIPE)
    configs = {name: dataclasses.replace(config, policy=policy) for name, policy in POLICIES.items()}
    found: dict[str, Any] = {"machine": machine(), "repeats": repeats}
    found["runner"] = {name: one_runner(changed, repeats) for name, changed in configs.items()}
    with two_nodes():
        found["own_runner"] = own_runner(repeats)
        found["nodes"] = {name: two_runners(changed, repeats) for name, changed in configs.items()}
        found["learning"] = learning(config, folder)
    recipes = json.loads((RESULTS / "recipes.json").read_text(encoding="utf-8"))["results"]
    found["stable_baselines3"] = [run["policy"]["success_rate"] for run in recipes[0]["runs"]]
    return found


def blocks(result: Mapping[str, Any]) -> dict[str, str]:
    """Returns the results as Markdown, by name."""
    parts = ("environment", "features", "networks", "rest")
    runner = [
        (
            name,
            f"{r['steps_per_second']['median']:,.0f}",
            *(f"{r[part]['median']:.1f}" for part in parts),
            f"{r['bytes']}",
        )
        for name, r in result["runner"].items()
    ]
    nodes = [
        (
            name,
            f"{r['one']['median']:,.0f}",
            f"{r['two']['median']:,.0f}",
            f"{r['efficiency']['median']:.0%}",
            f"{r['processor']['median']:.0%}",
            f"{r['learner']['median']:,.0f}",
        )
        for name, r in result["nodes"].items()
    ]
    runs = result["learning"]
    success = over_seeds([run["success"] for run in runs])
    return {
        "machine": machine_line(result["machine"]),
        "runner": table(("policy", "steps/s", *(f"{part}, us" for part in parts), "bytes per step"), runner),
        "own_runner": f"RLlib's own runner makes {result['own_runner']['median']:,.0f} steps/s on one core.",
        "nodes": table(
            ("policy", "one runner, steps/s", "two runners", "efficiency", "of the processor", "learner, steps/s"),
            nodes,
        ),
        "learning": f"With two runners the recipe `pot` reaches {as_percent(success)} (mean of {len(runs)} seeds, 95 % "
        f"interval) in {np.mean([run['seconds'] for run in runs]):.0f} s. With Stable-Baselines3 it reaches "
        f"{as_percent(over_seeds(result['stable_baselines3']))}.",
        "plan": table(("limit", "pots", "small"), plan(result)),
    }


def plan(result: Mapping[str, Any]) -> list[tuple[str, ...]]:
    """Returns the rows of the plan for `NODES` nodes of `CORES` cores: the steps/s that each part could process."""
    rows = []
    for label, rate in (
        (f"{NODES * CORES:,} runners", lambda r, n: NODES * CORES * r["steps_per_second"]["median"]),
        ("network of the learner, 10 Gbit/s", lambda r, n: NETWORK / r["bytes"]),
        ("one learner on one core", lambda r, n: n["learner"]["median"]),
    ):
        rows.append((label, *(f"{rate(result['runner'][p], result['nodes'][p]):,.0f}" for p in ("pots", "small"))))
    return rows


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m studies.cluster_speed --help`."""
    parser = argparse.ArgumentParser(
        prog="python -m studies.cluster_speed", description="Measure training with RLlib on two nodes on this machine."
    )
    parser.add_argument("--repeats", type=int, default=15, help="repeats of each measurement (default: %(default)s)")
    parser.add_argument("--runs", type=Path, default=RUNS / "rllib" / "pot-seeds", help="folder of the runs")
    parser.add_argument("--output", type=Path, default=OUTPUT, help="JSON file (default: %(default)s)")
    args = parser.parse_args(arguments)
    check_counts(parser, args, repeats=1)
    try:
        result = measure(args.repeats, args.runs)
    except ModuleNotFoundError as error:
        sys.exit(f"error: {missing(error.name or 'ray', 'rllib')}")
    write_json(args.output, result)
    for text in blocks(result).values():
        print(f"{text}\n")
    print(f"written to {args.output}")


if __name__ == "__main__":
    main()
