"""Trains a recipe with other settings, drawn at random, with Ray Tune: `python -m agents.rllib.sweep SWEEP`.

A trial is a training in one process with one core. After some numbers of steps only the best trials continue
(Li et al. 2020, asynchronous successive halving). The folder `runs/sweep/NAME` holds the folder of each trial on the
node that ran it, and `results.csv`, the settings and the results of all trials.
"""

# pyright: reportMissingImports=false

from __future__ import annotations

import argparse
import csv
import io
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ray import tune
from ray.tune.schedulers import ASHAScheduler

from agents.cluster import connect
from agents.config import Config, changed, read
from agents.output import print_table
from agents.rllib.settings import Settings, Sweep, load_recipe
from agents.rllib.train import train
from agents.train import Point, open_run
from billiards_env.files import write_whole


def run(sweep: Sweep, recipe: Config, folder: Path) -> list[dict[str, Any]]:
    """Runs all trials. Ray must be running.

    Args:
        sweep: The sweep.
        recipe: Its recipe.
        folder: The folder of the trials.

    Returns:
        For each trial, the best first: "trial", its number, its settings by their paths, "steps", "seconds" and
        "success", the success on new layouts at the end.

    Raises:
        RuntimeError: If a trial fails.
    """
    trials = sweep.draw()
    configs = [changed(recipe, values) for values in trials]  # raises an error before a trial begins
    paths = [folder.resolve() / f"trial{k}" for k in range(len(trials))]

    def trial(given: Mapping[str, int]) -> None:
        k = given["trial"]
        open_run(configs[k], paths[k], fresh=True)

        def report(point: Point) -> None:
            if point.steps:
                tune.report({"steps": point.steps, "success": point.success, "seconds": point.seconds})

        train(configs[k], Settings(recipe="", runners=0), paths[k], report)

    tuner = tune.Tuner(
        tune.with_resources(trial, {"cpu": 1}),
        param_space={"trial": tune.grid_search(list(range(len(trials))))},
        tune_config=tune.TuneConfig(
            metric="success",
            mode="max",
            scheduler=ASHAScheduler(
                time_attr="steps",
                max_t=recipe.timesteps * 2,  # each trial ends alone
                grace_period=sweep.first_stop,
                reduction_factor=sweep.reduction,
            ),
        ),
        run_config=tune.RunConfig(name="tune", storage_path=str(folder.resolve()), verbose=1),
    )
    found = tuner.fit()
    if found.errors:
        raise RuntimeError(f"{len(found.errors)} of {len(trials)} trials failed: {found.errors[0]}")
    results = [
        {
            "trial": result.config["trial"],
            **trials[result.config["trial"]],
            **{name: result.metrics[name] for name in ("steps", "seconds", "success")},
        }
        for result in found
    ]
    return sorted(results, key=lambda result: (-result["steps"], -result["success"]))


def table(results: Sequence[Mapping[str, Any]]) -> tuple[list[str], list[list[str]]]:
    """Returns the head and the rows of the result table."""
    formats = {"seconds": "{:.0f}", "success": "{:.1%}", "steps": "{:,}"}
    head = [name.rpartition(".")[2] for name in results[0]]
    return head, [
        [formats[name].format(value) if name in formats else _short(value) for name, value in result.items()]
        for result in results
    ]


def _short(value: Any) -> str:
    """Returns a setting as short text."""
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {' '.join(map(str, inner))}" for key, inner in value.items())
    return f"{value:.2g}" if isinstance(value, float) and value < 0.1 else str(value)


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs the command line; see `python -m agents.rllib.sweep --help`."""
    parser = argparse.ArgumentParser(
        prog="python -m agents.rllib.sweep", description="Train a recipe with other settings, drawn at random."
    )
    parser.add_argument("sweep", type=Path, help="YAML file of the sweep, e.g. configs/rllib/sweep.yaml")
    parser.add_argument("--address", help='address of a Ray cluster, e.g. "auto" (default: this machine only)')
    parser.add_argument("--folder", type=Path, help="folder of the trials (default: runs/sweep/NAME OF THE SWEEP)")
    args = parser.parse_args(arguments)
    folder = args.folder or Path("runs") / "sweep" / args.sweep.stem
    try:
        sweep = read(Sweep, args.sweep)
        recipe = load_recipe(sweep, args.sweep)
        connect(args.address)
        results = run(sweep, recipe, folder)
    except (ImportError, OSError, RuntimeError, TypeError, ValueError) as error:
        sys.exit(f"error: {error}")
    text = io.StringIO()
    writer = csv.DictWriter(text, list(results[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(results)
    write_whole(folder / "results.csv", text.getvalue().encode())
    print_table(f"{len(results)} trials of {sweep.recipe}", *table(results))
    print(f"written to {folder / 'results.csv'}")


if __name__ == "__main__":
    main()
