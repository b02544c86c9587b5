"""Trains every recipe with several seeds and reports the results: `python -m studies.recipes`.

`configs/recipes.yaml` lists the recipes and the seeds. The results are

* `studies/results/recipes.json`: the configuration of each recipe, and the learning curve and evaluation of each run,
* `studies/results/policies/RECIPE`: the policy of the first seed, with its configuration,
* `docs/images/learning_curves.png`.

Another list of recipes has its results in `runs/LIST`.

A recipe whose results are there is not trained again. The runs are kept in `runs/recipes/RECIPE/seedN`, so an
interrupted command continues when it is started again. All of them take half an hour on two cores.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from agents.config import Config, load, read
from agents.evaluate import evaluate
from agents.intervals import as_percent, over_seeds
from agents.runs import train_all
from agents.train import learning_curve
from benchmarks import table
from benchmarks.figures import IMAGES, save
from billiards_env.files import write_json, write_whole
from studies import RESULTS, RUNS

CONFIG = Path(__file__).resolve().parent.parent / "configs" / "recipes.yaml"


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Recipes:
    """The list of recipes.

    Attributes:
        seeds: The seeds; each recipe is trained once with each.
        recipes: Paths of the recipes, which are configurations of `agents.train`, relative to the list.
        figure: The names of the recipes whose learning curves are drawn; all if empty.
    """

    seeds: tuple[int, ...]
    recipes: tuple[str, ...]
    figure: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in ("seeds", "recipes"):
            values = getattr(self, name)
            if not values or len(set(values)) < len(values):
                raise ValueError(f"{name} = {list(values)!r}: expected at least one, and no duplicates")
        names = [Path(recipe).stem for recipe in self.recipes]
        if len(set(names)) < len(names):
            raise ValueError(f"recipes = {list(self.recipes)!r}: expected files of different names")
        for name in self.figure:
            if name not in names:
                raise ValueError(f"figure = {list(self.figure)!r}: expected names of recipes, not {name!r}")


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Places:
    """Where the command reads and writes.

    Attributes:
        runs: The folder of the runs.
        summary: The JSON file of the results.
        policies: The folder of the policies.
        figure: The PNG file of the learning curves.
    """

    runs: Path = RUNS / "recipes"
    summary: Path = RESULTS / "recipes.json"
    policies: Path = RESULTS / "policies"
    figure: Path = IMAGES / "learning_curves.png"


def default_places(config: Path) -> Places:
    """Returns the places of the project for its list of recipes, and a folder under `runs` for any other list."""
    if config.resolve() == CONFIG:
        return Places()
    folder = RUNS / config.stem
    return Places(
        runs=folder,
        summary=folder / "recipes.json",
        policies=folder / "policies",
        figure=folder / "learning_curves.png",
    )


def measure(asked: Recipes, folder: Path, places: Places, jobs: int) -> list[dict[str, Any]]:
    """Trains and evaluates all recipes without results, and writes the results and the policies.

    Args:
        asked: The list of recipes.
        folder: The folder of the list.
        places: Where to write.
        jobs: The number of runs at a time.

    Returns:
        The result of each recipe, see `summarize`.

    Raises:
        OSError: If a file cannot be read or written.
        RuntimeError: If a run fails.
        ValueError: If a configuration is impossible, or a folder holds a run of another one.
    """
    recipes = {Path(recipe).stem: load(folder / recipe) for recipe in asked.recipes}
    saved = json.loads(places.summary.read_text(encoding="utf-8"))["results"] if places.summary.exists() else []
    results = {
        result["recipe"]: result
        for result in saved
        if [run["seed"] for run in result["runs"]] == list(asked.seeds)
        and result["recipe"] in recipes
        and recipes[result["recipe"]].is_saved_as(result["config"])
    }
    runs = {
        name: {places.runs / name / f"seed{seed}": dataclasses.replace(recipe, seed=seed) for seed in asked.seeds}
        for name, recipe in recipes.items()
        if name not in results
    }
    if runs:
        train_all({run: config for configs in runs.values() for run, config in configs.items()}, jobs)
    for name, configs in runs.items():
        results[name] = summarize(name, recipes[name], list(configs))
        for file in ("config.yaml", "policy.pt"):
            write_whole(places.policies / name / file, (next(iter(configs)) / file).read_bytes())
    found = [results[name] for name in recipes]
    write_json(places.summary, {"results": found})
    return found


def summarize(name: str, recipe: Config, folders: Sequence[Path]) -> dict[str, Any]:
    """Returns the result of a recipe, from the folders of its finished runs.

    Returns:
        `recipe` (its name), `config`, `versions` and `runs`: the seed of each run, its learning curve (a list of
        `agents.train.Point`), and the evaluations of its policy and of random actions.
    """
    runs = []
    for folder in folders:
        path = folder / "evaluation.json"
        evaluation = json.loads(path.read_text(encoding="utf-8")) if path.exists() else evaluate(folder)
        runs.append(
            {
                "seed": load(folder / "config.yaml").seed,
                "curve": [list(point) for point in learning_curve(folder)],
                "policy": evaluation["policy"],
                "random": evaluation["random"],
            }
        )
    versions = json.loads((folders[0] / "versions.json").read_text(encoding="utf-8"))
    return {"recipe": name, "config": recipe.to_dict(), "versions": versions, "runs": runs}


def blocks(result: Mapping[str, Any]) -> dict[str, str]:
    """Returns the results as Markdown, by name."""
    head = (
        "recipe",
        "million shots",
        "minutes",
        "success by seed",
        "mean over seeds",
        "score by seed",
        "random: success",
        "score",
    )
    results = result["results"]
    pot = [r for r in results if r["recipe"].startswith("pot") and r["config"]["env"]["max_shots"] == 1]
    long = [r for r in pot if r["config"]["timesteps"] >= 1_000_000]
    million = (f"{r['recipe']} {as_percent(over_seeds(at_steps(r, 1_000_000)))}" for r in long)
    best = dict(zip(head, row(results[0]), strict=True))
    return {
        "table": table(head, [row(r) for r in results]),
        "million": f"Success after a million shots, mean over the seeds and its 95 % interval: {'; '.join(million)}.",
        "summary": f"`make train` trains for {best['minutes']} minutes on one core. The policy then pots the ball on "
        f"{best['mean over seeds']} of new layouts (mean of {len(results[0]['runs'])} seeds, 95 % interval). Random "
        f"aims at the object ball pot it on {best['random: success']}.",
    }


def row(result: Mapping[str, Any]) -> tuple[str, ...]:
    """Returns the cells of a recipe in the table."""
    runs = result["runs"]
    rates, scores = ([run["policy"][name] for run in runs] for name in ("success_rate", "mean_score"))
    return (
        result["recipe"],
        f"{result['config']['timesteps'] / 1e6:.1f}",
        f"{np.mean([run['curve'][-1][1] for run in runs]) / 60:.1f}",
        ", ".join(f"{rate:.1%}" for rate in rates),
        as_percent(over_seeds(rates)),
        ", ".join(f"{score:.2f}" for score in scores),
        f"{np.mean([run['random']['success_rate'] for run in runs]):.1%}",
        f"{np.mean([run['random']['mean_score'] for run in runs]):.2f}",
    )


def at_steps(result: Mapping[str, Any], steps: int) -> list[float]:
    """Returns the success of each run at the first point of its learning curve with at least this number of steps."""
    return [next(point[3] for point in run["curve"] if point[0] >= steps) for run in result["runs"]]


def draw(results: Sequence[Mapping[str, Any]], path: Path) -> None:
    """Draws the learning curve of each seed, their mean and its 95 % interval.

    Args:
        results: See `summarize`.
        path: The PNG file to write.
    """
    matplotlib.rcParams["font.family"] = "DejaVu Sans"  # comes with matplotlib: the same picture everywhere
    figure = Figure(figsize=(8, 4.6), dpi=110, layout="constrained")
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
    save(figure, path)


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs the command line; see `python -m studies.recipes --help`."""
    parser = argparse.ArgumentParser(
        prog="python -m studies.recipes", description="Train every recipe with several seeds and report the results."
    )
    parser.add_argument("config", type=Path, nargs="?", default=CONFIG, help="YAML file (default: %(default)s)")
    parser.add_argument("--jobs", type=int, default=2, help="runs at a time (default: %(default)s)")
    for field in dataclasses.fields(Places):
        parser.add_argument(f"--{field.name}", type=Path, help=f"default: {field.default}; with another list in {RUNS}")
    args = parser.parse_args(arguments)
    chosen = {name: path for name in Places.__dataclass_fields__ if (path := getattr(args, name)) is not None}
    places = dataclasses.replace(default_places(args.config), **chosen)
    try:
        asked = read(Recipes, args.config)
        results = measure(asked, args.config.parent, places, args.jobs)
        draw([r for r in results if not asked.figure or r["recipe"] in asked.figure], places.figure)
    except (OSError, RuntimeError, TypeError, ValueError) as error:
        sys.exit(f"error: {error}")
    except KeyboardInterrupt:
        print("\ninterrupted; the same command continues", file=sys.stderr)
        sys.exit(130)
    print(blocks({"results": results})["table"])
    print(f"\nwritten to {places.summary}, {places.policies} and {places.figure}")


if __name__ == "__main__":
    main()
