"""Trains every recipe of a list with several seeds and reports the results: `python -m studies.recipes [LIST]`.

A recipe is a configuration of `agents.train`. `configs/recipes.yaml` lists those of the documentation. The results are

* `studies/results/LIST.json`: the configuration of each recipe, the learning curve and evaluation of each run, and the
  success of players without training,
* `docs/images/LIST.png`: the learning curves of the recipes in `figure`,
* for `recipes.yaml`, `studies/results/policies/RECIPE`: the policy of the first seed, with its configuration.

The results of any other list are in `runs/LIST`.

A recipe with results in the JSON file is not trained again. The runs are kept in `runs/LIST/RECIPE/seedN`, so the same
command continues after an interruption.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from pydantic import AfterValidator
from pydantic.dataclasses import dataclass

from agents.config import CHECKS, Checked, Config, Count, Seed, distinct, load, read
from agents.evaluate import evaluate
from agents.runs import train_all
from agents.train import Point, learning_curve
from benchmarks import IMAGES, save, table, use_own_font
from billiards_env.evaluation import measure as play_alone
from billiards_env.files import write_json, write_whole
from billiards_env.intervals import as_percent, over_seeds
from studies import RESULTS, RUNS, errors_in_one_line, parser_of_runs

CONFIG = Path(__file__).resolve().parent.parent / "configs" / "recipes.yaml"

PLAYERS = ("geometric", "search:20", "search:1000")
"""The players without training in the results. Random actions are measured with each policy."""

EPISODES = 1000
"""The largest number of episodes of a player without training."""


@dataclass(frozen=True, kw_only=True, config=CHECKS)
class Recipes(Checked):
    """A list of recipes.

    Attributes:
        seeds: The seeds. Each recipe is trained once with each seed.
        recipes: Paths of the recipes, which are configurations of `agents.train`, relative to the list.
        timesteps: The number of steps of each recipe; None for that of the recipe.
        figure: The names of the recipes whose learning curves are drawn.
    """

    seeds: Annotated[tuple[Seed, ...], AfterValidator(distinct)]
    recipes: Annotated[tuple[str, ...], AfterValidator(distinct)]
    timesteps: Count | None = None
    figure: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        names = [Path(recipe).stem for recipe in self.recipes]
        if len(set(names)) < len(names):
            raise ValueError(f"recipes = {list(self.recipes)!r}: expected files of different names")
        for name in self.figure:
            if name not in names:
                raise ValueError(f"figure = {list(self.figure)!r}: expected names of recipes, not {name!r}")

    def load(self, folder: Path) -> dict[str, Config]:
        """Returns the configurations by name; see `agents.config.load`. The paths are relative to `folder`."""
        changes = {} if self.timesteps is None else {"timesteps": self.timesteps}
        return {Path(recipe).stem: dataclasses.replace(load(folder / recipe), **changes) for recipe in self.recipes}


class Places(NamedTuple):
    """The folders of the runs and the policies, the JSON file of the results, and the PNG file of the curves."""

    runs: Path
    summary: Path
    policies: Path
    figure: Path


def find_places(config: Path, folder: Path | None = None) -> Places:
    """Returns the places of a list: a folder or, for a list in `configs`, those of the published results."""
    name, runs = config.stem, folder or RUNS / config.stem
    published = folder is None and config.resolve().parent == CONFIG.parent
    plays = published and name == "recipes"
    return Places(
        runs,
        (RESULTS if published else runs) / f"{name}.json",
        (RESULTS if plays else runs) / "policies",
        (IMAGES if published else runs) / f"{name}.png",
    )


def measure(
    asked: Recipes, folder: Path, places: Places, jobs: int, address: str | None = None
) -> list[dict[str, Any]]:
    """Trains and evaluates all recipes without results, and writes the results and the policies.

    The paths of the list are relative to `folder`. `jobs` runs are trained at a time, on this machine or on the Ray
    cluster at `address`. The results are those of `summarize`.

    Raises:
        OSError: If a file cannot be read or written.
        RuntimeError: If a run fails.
        ValueError: If a configuration is impossible, or a folder holds a run of another configuration.
    """
    recipes = asked.load(folder)
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
        train_all({run: config for configs in runs.values() for run, config in configs.items()}, jobs, address)
    for name, configs in runs.items():
        results[name] = summarize(name, recipes[name], list(configs))
        results[name]["players"] = _players(recipes[name], asked.seeds[0], list(results.values()))
        write_json(places.summary, {"results": [results[recipe] for recipe in recipes if recipe in results]})
        for file in ("config.yaml", "policy.pt"):
            write_whole(places.policies / name / file, (next(iter(configs)) / file).read_bytes())
    found = [results[name] for name in recipes]
    write_json(places.summary, {"results": found})
    return found


def _players(recipe: Config, seed: int, results: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Returns the results of `PLAYERS` in the game of a recipe. `results` of the same game are used again."""
    plain = recipe.to_dict()
    for other in results:
        if "players" in other and all(other["config"][key] == plain[key] for key in ("env", "noise")):
            return other["players"]
    noise = (0.0, 0.0) if recipe.noise is None else (recipe.noise.angle_std, recipe.noise.speed_std)
    episodes = min(recipe.evaluation_episodes, EPISODES)
    return {name: play_alone(name, recipe.env, noise, episodes, seed) for name in PLAYERS}


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
    results = result["results"]
    head = ("recipe", "million shots", "minutes", "success by seed", "mean over seeds", "score", "random", *PLAYERS)
    first = results[0]
    policies = _rates(first)
    untrained = [_curve(run)[0].success for run in first["runs"]]
    minutes = sum(_curve(run)[-1].seconds for r in results for run in r["runs"]) / 60
    return {
        "table": table(head, [row(r) for r in results]),
        "time": f"All these trainings together take {minutes:.0f} minutes on one core.",
        "summary": f"`make train` trains for at most {_seconds(first):.0f} s on one core. The policy learns from the "
        f"positions of the balls alone. It then pots the ball on {as_percent(over_seeds(policies))} of new layouts "
        f"(mean of {len(policies)} seeds, 95% interval), before the training on {np.mean(untrained):.1%}. Random shots "
        f"pot {np.mean([run['random']['success_rate'] for run in first['runs']]):.1%}, and a search of 1,000 shots for "
        f"each layout {first['players']['search:1000']['success_rate']:.1%}.",
    }


def _curve(run: Mapping[str, Any]) -> list[Point]:
    return [Point(*values) for values in run["curve"]]


def _seconds(result: Mapping[str, Any]) -> float:
    """Returns the mean time of a run, without the evaluations."""
    return float(np.mean([_curve(run)[-1].seconds for run in result["runs"]]))


def _rates(result: Mapping[str, Any]) -> list[float]:
    """Returns the success of the policy of each seed."""
    return [run["policy"]["success_rate"] for run in result["runs"]]


def row(result: Mapping[str, Any]) -> tuple[str, ...]:
    """Returns the cells of a recipe in the table."""
    runs, rates = result["runs"], _rates(result)
    return (
        result["recipe"],
        f"{result['config']['timesteps'] / 1e6:g}",
        f"{_seconds(result) / 60:.1f}",
        ", ".join(f"{rate:.1%}" for rate in rates),
        as_percent(over_seeds(rates)),
        f"{np.mean([run['policy']['mean_score'] for run in runs]):.2f}",
        f"{np.mean([run['random']['success_rate'] for run in runs]):.1%}",
        *(f"{result['players'][name]['success_rate']:.1%}" for name in PLAYERS),
    )


def draw(results: Sequence[Mapping[str, Any]], path: Path) -> None:
    """Draws the learning curve of each seed, their mean and its 95% interval."""
    use_own_font()
    figure = Figure(figsize=(9, 4.6), dpi=110, layout="constrained")
    axes = figure.add_subplot()
    for result in results:
        curves = np.array([[100 * point.success for point in _curve(run)] for run in result["runs"]])
        steps = np.array([point.steps for point in _curve(result["runs"][0])]) / 1e6
        means = [over_seeds(column.tolist()) for column in curves.T]
        label = f"{result['recipe']}: {as_percent(over_seeds((curves[:, -1] / 100).tolist()))}"
        (line,) = axes.plot(steps, [m["mean"] for m in means], linewidth=2, label=label)
        if len(curves) > 1:
            low, high = np.array([m["interval"] for m in means]).T.clip(0, 100)
            axes.fill_between(steps, low, high, color=line.get_color(), alpha=0.15, linewidth=0)
        for curve in curves:
            axes.plot(steps, curve, color=line.get_color(), linewidth=0.6, alpha=0.7)
    axes.set(xlabel="million shots", ylabel="success on new layouts (%)", ylim=(0, 102))
    axes.grid(alpha=0.3)
    title = "mean of the seeds, its 95% interval\nthin: each seed"
    figure.legend(title=title, loc="outside right upper", fontsize=9, title_fontsize=9, frameon=False)
    save(figure, path)


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs the command line; see `python -m studies.recipes --help`."""
    parser = parser_of_runs("recipes", "Train every recipe of a list with several seeds and report the results.")
    parser.add_argument("config", type=Path, nargs="?", default=CONFIG, help="YAML list (default: %(default)s)")
    args = parser.parse_args(arguments)
    places = find_places(args.config, args.folder)
    with errors_in_one_line():
        asked = read(Recipes, args.config)
        results = measure(asked, args.config.parent, places, args.jobs, args.address)
        if asked.figure:
            draw([r for r in results if r["recipe"] in asked.figure], places.figure)
    print(blocks({"results": results})["table"])
    print("\nwritten to", *(path for path in (places.summary, places.policies, places.figure) if path.exists()))


if __name__ == "__main__":
    main()
