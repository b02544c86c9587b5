"""Measures whether english pays: `python -m studies.english`.

The recipes in `configs/english` are tasks on a real table, with throw and the jaws of the pockets. Each is trained with
several seeds. First a policy of velocities is trained. Then two policies start from its weights and train for as long
again: one of velocities and one of strikes, with side, top and elevation. Both play the same new layouts, in the exact
world and in one with a timestep. Players without learning play part of these layouts, with and without spin.

The results are in `studies/results/english.json`. If they are there, nothing is trained: the command prints the tables.
The runs are kept in `runs/english`, so the same command continues after an interruption.
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

from agents.config import Config, load
from agents.evaluate import deterministic, evaluation_seeds, play_together
from agents.intervals import as_percent, over_seeds
from agents.ppo import load_policy, make_vector
from agents.runs import train_all
from agents.train import learning_curve
from benchmarks import machine, machine_line, table
from billiards_env.files import write_json
from studies import RESULTS, RUNS
from studies.players import measure as play_alone

CONFIGS = Path(__file__).resolve().parent.parent / "configs" / "english"
RECIPES = ("position", "clear")
SEEDS = (10, 11, 12)
OUTPUT = RESULTS / "english.json"

FIRST, VELOCITY, STRIKE = "first", "velocity", "strike"
"""The runs of a seed: the first policy of velocities, and the two that start from it."""

STEPPED = {"mode": "pit", "dt": 1 / 60}
"""The arguments of the world with a timestep."""

PLAYERS = ("random", "geometric", "search:200")
EPISODES = 300
"""Episodes of each player without training."""


def configs(name: str, seed: int, folder: Path) -> dict[str, Config]:
    """Returns the configurations of the runs of a recipe with a seed, by run; the folder holds the runs."""
    recipe = dataclasses.replace(load(CONFIGS / f"{name}.yaml"), seed=seed)
    again = dataclasses.replace(recipe, start_from=str(folder / FIRST))
    return {
        FIRST: recipe,
        VELOCITY: again,
        STRIKE: dataclasses.replace(again, env={**recipe.env, "action": "strike"}),
    }


def success(run_dir: Path, changes: Mapping[str, Any]) -> float:
    """Returns the success of a policy on new layouts, with changes of the arguments of the environment."""
    config, policy = load_policy(run_dir)
    envs = make_vector(dataclasses.replace(config, env={**config.env, **changes}), config.evaluation_episodes)
    seeds = evaluation_seeds(config.seed, config.evaluation_episodes).tolist()
    result = play_together(envs, deterministic(policy), seeds)
    envs.close()
    return float(result["success_rate"])


def find_result(path: Path) -> dict[str, Any] | None:
    """Returns the result in a file; None if there is none, or it is of other seeds or recipes."""
    if not path.exists():
        return None
    found = json.loads(path.read_text(encoding="utf-8"))
    same = found["seeds"] == list(SEEDS) and list(found["recipes"]) == list(RECIPES)
    recipes = {name: load(CONFIGS / f"{name}.yaml") for name in RECIPES}
    if not same or not all(recipes[name].is_saved_as(result["config"]) for name, result in found["recipes"].items()):
        return None
    return found


def measure(runs: Path, jobs: int) -> dict[str, Any]:
    """Trains all policies that are not trained yet, and measures them.

    Args:
        runs: The folder of the runs.
        jobs: The number of runs at a time.

    Returns:
        The content of `english.json`.
    """
    folders = {name: [runs / name / f"seed{seed}" for seed in SEEDS] for name in RECIPES}
    for stage in ((FIRST,), (VELOCITY, STRIKE)):
        train_all(
            {
                folder / run: configs(name, seed, folder)[run]
                for name in RECIPES
                for seed, folder in zip(SEEDS, folders[name], strict=True)
                for run in stage
            },
            jobs,
        )
    found: dict[str, Any] = {"machine": machine(), "seeds": list(SEEDS), "recipes": {}}
    for name in RECIPES:
        recipe = load(CONFIGS / f"{name}.yaml")
        found["recipes"][name] = {
            "config": recipe.to_dict(),
            "start": {run: [learning_curve(f / run)[0].success for f in folders[name]] for run in (VELOCITY, STRIKE)},
            "exact": {run: [success(f / run, {}) for f in folders[name]] for run in (FIRST, VELOCITY, STRIKE)},
            "stepped": {run: [success(f / run, STEPPED) for f in folders[name]] for run in (VELOCITY, STRIKE)},
            "players": players(recipe.env),
        }
    return found


def players(env: Mapping[str, Any]) -> dict[str, Any]:
    """Returns the results of the players without training, by action and player."""
    return {
        action: {
            player: play_alone(player, {**env, "action": action}, (0.0, 0.0), EPISODES, SEEDS[0]) for player in PLAYERS
        }
        for action in (VELOCITY, STRIKE)
    }


def blocks(found: Mapping[str, Any]) -> dict[str, str]:
    """Returns the tables for the pages, by name."""
    rows, gains = [], []
    for name, recipe in found["recipes"].items():
        exact, stepped = recipe["exact"], recipe["stepped"]
        for player in PLAYERS:
            results = [recipe["players"][action][player]["success_rate"] for action in (VELOCITY, STRIKE)]
            rows.append((name, player, *(f"{rate:.1%}" for rate in results), "", ""))
        starts = [as_percent(over_seeds(recipe["start"][run])) for run in (VELOCITY, STRIKE)]
        rows.append((name, "policy at the start", *starts, "", ""))
        policies = [as_percent(over_seeds(world[run])) for world in (exact, stepped) for run in (VELOCITY, STRIKE)]
        rows.append((name, "policy", *policies))
        changes = [(exact[STRIKE], exact[VELOCITY])] + [(stepped[run], exact[run]) for run in (VELOCITY, STRIKE)]
        gains.append((name, *(_points(np.subtract(*pair).tolist()) for pair in changes)))
    return {
        "machine": machine_line(found["machine"]),
        "results": table(("task", "player", "velocity", "strike", "velocity, 1/60 s", "strike, 1/60 s"), rows, left=2),
        "gain": table(("task", "gain by strikes", "effect of 1/60 s on velocity", "on strike"), gains, left=1),
    }


def _points(differences: Sequence[float]) -> str:
    """Returns the mean of differences of success by seed, and its interval, in percentage points."""
    value = over_seeds(differences)
    low, high = (100 * end for end in value["interval"])
    return f"{100 * value['mean']:.1f} points ({low:.1f} to {high:.1f})"


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs the command line; see `python -m studies.english --help`."""
    parser = argparse.ArgumentParser(prog="python -m studies.english", description="Measure whether english pays.")
    parser.add_argument("--jobs", type=int, default=2, help="runs at a time (default: %(default)s)")
    parser.add_argument("--runs", type=Path, default=RUNS / "english", help="folder of the runs (default: %(default)s)")
    parser.add_argument("--output", type=Path, default=OUTPUT, help="JSON file (default: %(default)s)")
    args = parser.parse_args(arguments)
    try:
        found = find_result(args.output)
        if found is None:
            found = measure(args.runs, args.jobs)
            write_json(args.output, found)
    except (OSError, RuntimeError, TypeError, ValueError) as error:
        sys.exit(f"error: {error}")
    except KeyboardInterrupt:
        print("\ninterrupted; the same command continues", file=sys.stderr)
        sys.exit(130)
    print("\n\n".join(blocks(found).values()))
    print(f"\nin {args.output}")


if __name__ == "__main__":
    main()
