"""Trains all recipes with several seeds and reports what they reach: `python -m studies.recipes`.

`configs/results.yaml` names them.
A run is trained once: its folder, `benchmarks/results/agents/RECIPE/seedN`, holds its configuration, learning curve,
policy and evaluation, and what is finished there is not trained again. The whole takes half an hour on two cores; it
can be interrupted at any time, and the same command goes on. The summary is in `benchmarks/results/agents.json`, the
learning curves in `docs/images/learning_curves.png`.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from agents.config import load, read
from agents.evaluate import evaluate
from agents.intervals import as_percent, over_seeds
from agents.runs import train_all
from agents.train import learning_curve
from billiards_env.files import replacing, write_json

ROOT = Path(__file__).resolve().parent.parent
CONFIG = ROOT / "configs" / "results.yaml"
RUNS = ROOT / "benchmarks" / "results" / "agents"
SUMMARY = ROOT / "benchmarks" / "results" / "agents.json"
FIGURE = ROOT / "docs" / "images" / "learning_curves.png"


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Results:
    """What is trained.

    Attributes:
        seeds: The seed of each run of a recipe.
        recipes: Paths of the recipes, configurations of `agents.train`, from the folder of this file on.
        figure: The recipes whose learning curves are drawn, by name.
    """

    seeds: tuple[int, ...]
    recipes: tuple[str, ...]
    figure: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in ("seeds", "recipes"):
            values = getattr(self, name)
            if not values or len(set(values)) < len(values):
                raise ValueError(f"{name} = {list(values)!r}: expected at least one, and none of them twice")
        names = [Path(recipe).stem for recipe in self.recipes]
        if len(set(names)) < len(names):
            raise ValueError(f"recipes = {list(self.recipes)!r}: expected files of different names")
        for name in self.figure:
            if name not in names:
                raise ValueError(f"figure = {list(self.figure)!r}: {name!r} is not one of the recipes")


def summary(name: str, folders: Mapping[int, Path]) -> dict[str, Any]:
    """What the finished runs of a recipe reached.

    Args:
        name: The recipe's name.
        folders: The folder of each seed's run.

    Returns:
        Plain data: `recipe`, `timesteps`, `env` and, under `runs`, each run's seed, seconds of training, learning
        curve, and evaluation beside that of random actions.
    """
    config = load(next(iter(folders.values())) / "config.yaml")
    runs = []
    for seed, folder in folders.items():
        path = folder / "evaluation.json"
        evaluation = json.loads(path.read_text(encoding="utf-8")) if path.exists() else evaluate(folder)
        curve = learning_curve(folder)
        runs.append(
            {
                "seed": seed,
                "seconds": curve[-1].seconds,
                "curve": [list(point) for point in curve],
                "policy": evaluation["policy"],
                "random": evaluation["random"],
            }
        )
    return {"recipe": name, "timesteps": config.timesteps, "env": dict(config.env), "runs": runs}


HEAD = (
    "recipe",
    "million shots",
    "minutes",
    "success by seed",
    "mean over seeds",
    "score by seed",
    "random: success",
    "score",
)


def row(result: Mapping[str, Any]) -> tuple[str, ...]:
    """The cells of a recipe's row in a table with that head."""
    runs = result["runs"]
    rates, scores = ([run["policy"][name] for run in runs] for name in ("success_rate", "mean_score"))
    return (
        result["recipe"],
        f"{result['timesteps'] / 1e6:.1f}",
        f"{np.mean([run['seconds'] for run in runs]) / 60:.1f}",
        ", ".join(f"{rate:.1%}" for rate in rates),
        as_percent(over_seeds(rates)),
        ", ".join(f"{score:.2f}" for score in scores),
        f"{np.mean([run['random']['success_rate'] for run in runs]):.1%}",
        f"{np.mean([run['random']['mean_score'] for run in runs]):.2f}",
    )


def at_steps(result: Mapping[str, Any], steps: int) -> list[float]:
    """The success of each run at the first point of its learning curve at or after so many steps."""
    return [next(point[3] for point in run["curve"] if point[0] >= steps) for run in result["runs"]]


def draw(results: Sequence[Mapping[str, Any]], path: Path) -> None:
    """Draws learning curves: each seed's, their mean, and its 95 % interval.

    Args:
        results: What `summary` gives.
        path: The PNG to write.
    """
    from matplotlib.figure import Figure  # takes a second; only this needs it

    figure = Figure(figsize=(8, 4.6), layout="constrained")
    axes = figure.add_subplot()
    for result in results:
        curves = np.array([[point[3] for point in run["curve"]] for run in result["runs"]])
        steps = np.array([point[0] for point in result["runs"][0]["curve"]]) / 1e6
        means = [over_seeds(column.tolist()) for column in curves.T]
        label = f"{result['recipe']}: {as_percent(means[-1])}"
        (line,) = axes.plot(steps, [m["mean"] for m in means], linewidth=2, label=label)
        if len(curves) > 1:
            low, high = np.array([m["interval"] for m in means]).T.clip(0, 1)
            axes.fill_between(steps, low, high, color=line.get_color(), alpha=0.15, linewidth=0)
        for curve in curves:
            axes.plot(steps, curve, color=line.get_color(), linewidth=0.6, alpha=0.7)
    axes.set(xlabel="million shots", ylabel="success without exploration, unseen layouts", ylim=(0, 1))
    axes.grid(alpha=0.3)
    axes.legend(title="mean of the seeds, its 95 % interval; thin: each seed", fontsize=8, title_fontsize=8)
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as temporary:
        figure.savefig(temporary, dpi=110, metadata={"Software": None})


def main(arguments: Sequence[str] | None = None) -> None:
    """The command line; see `python -m studies.recipes --help`."""
    parser = argparse.ArgumentParser(
        prog="python -m studies.recipes", description="Train all recipes with several seeds and report what they reach."
    )
    parser.add_argument("config", type=Path, nargs="?", default=CONFIG, help="YAML file (default: %(default)s)")
    parser.add_argument("--jobs", type=int, default=2, help="runs at a time (default: %(default)s)")
    parser.add_argument("--runs", type=Path, default=RUNS, help="folder of the runs (default: %(default)s)")
    parser.add_argument("--summary", type=Path, default=SUMMARY, help="JSON file (default: %(default)s)")
    parser.add_argument("--figure", type=Path, default=FIGURE, help="PNG file (default: %(default)s)")
    args = parser.parse_args(arguments)
    try:
        asked = read(Results, args.config)
        recipes = {Path(recipe).stem: load(args.config.parent / recipe) for recipe in asked.recipes}
        folders = {name: {seed: args.runs / name / f"seed{seed}" for seed in asked.seeds} for name in recipes}
        train_all(
            {
                folders[name][seed]: dataclasses.replace(recipe, seed=seed)
                for name, recipe in recipes.items()
                for seed in asked.seeds
            },
            args.jobs,
        )
        results = [summary(name, folders[name]) for name in recipes]
        write_json(args.summary, {"results": results})
        drawn = asked.figure or tuple(recipes)
        draw([result for result in results if result["recipe"] in drawn], args.figure)
    except (OSError, RuntimeError, TypeError, ValueError) as error:
        sys.exit(f"error: {error}")
    except KeyboardInterrupt:
        print("\ninterrupted; the same command goes on", file=sys.stderr)
        sys.exit(130)
    for cells in (HEAD, ("--",) * len(HEAD), *(row(result) for result in results)):
        print(f"| {' | '.join(cells)} |")
    print(f"written to {args.summary} and {args.figure}")


if __name__ == "__main__":
    main()
