"""Measures run-outs of nine ball and eight ball by players without training: `python -m studies.run_outs`.

A run-out is a rack that a player wins from the break without a foul and without a shot that scores nothing. In nine
ball a legal pot of the nine ball wins the rack at once. The players play without execution noise and with noise, whose
size they know. The results are in `studies/results/run_outs.json`. The
command skips players that have results there with the same settings, so it continues after an interruption.
"""

from __future__ import annotations

import argparse
import itertools
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from tqdm import tqdm

from benchmarks import machine, machine_line, table
from billiards_env.evaluation import measure as play_alone
from billiards_env.files import write_json
from studies import RESULTS, errors_in_one_line

OUTPUT = RESULTS / "run_outs.json"

RUN_OUTS = {
    name: {
        "scene": "real_pool",
        "task": name,
        "n_object_balls": balls,
        "layout": name,
        "max_shots": 30,
        "max_speed": 8.0,
    }
    for name, balls in (("nine_ball", 9), ("eight_ball", 15))
}
"""The arguments of the environment, by task."""

NOISES = {
    "none": (0.0, 0.0),
    "0.057 degrees": (0.057, 0.0),
    "0.125 degrees, 0.075 m/s": (0.125, 0.075),
}
"""Standard deviations of the direction, degrees, and of the speed, m/s. 0.057 degrees is 1 mrad. The last one is the
noise of the Computer Olympiad (Smith 2007, PickPocket: A computer billiards shark)."""

PLAYERS = ("random", "geometric", "search:200", "search:1000")
EPISODES, SEED = 1000, 10


def measure(output: Path) -> dict[str, Any]:
    """Measures the players without results, and writes the results of each as soon as it is measured.

    The JSON file `output` has `machine`, `settings`, and `results[task][noise][player]`, see
    `billiards_env.evaluation.measure`.

    Raises:
        OSError: If the file cannot be read or written.
        ValueError: If the file is not JSON.
    """
    settings = json.loads(json.dumps({"seed": SEED, "episodes": EPISODES, "run_outs": RUN_OUTS, "noises": NOISES}))
    found: dict[str, Any] = json.loads(output.read_text(encoding="utf-8")) if output.exists() else {}
    if found.get("settings") != settings:
        found = {"machine": machine(), "settings": settings, "results": {}}
    results = found["results"]
    cells = list(itertools.product(RUN_OUTS, NOISES, PLAYERS))
    with tqdm(cells, unit="player") as bar:
        for task, noise, player in bar:
            bar.set_description(f"{task}, noise {noise}, {player}")
            played = results.setdefault(task, {}).setdefault(noise, {})
            if player not in played:
                played[player] = play_alone(player, RUN_OUTS[task], NOISES[noise], EPISODES, SEED)
                write_json(output, found)
    return found


def blocks(found: Mapping[str, Any]) -> dict[str, str]:
    """Returns the tables for the pages, by name."""
    rows = []
    for task, noises in found["results"].items():
        for noise, players in noises.items():
            for player, result in players.items():
                low, high = (100 * end for end in result["confidence_interval_95"])
                success = f"{result['success_rate']:.1%} ({low:.1f} to {high:.1f})"
                means = f"{result['mean_score']:.2f}", f"{result['mean_shots']:.1f}"
                rows.append((task, noise, player, success, *means))
    return {
        "machine": machine_line(found["machine"]),
        "table": table(("task", "noise", "player", "run-outs", "points", "shots"), rows, left=3),
    }


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs the command line; see `python -m studies.run_outs --help`."""
    parser = argparse.ArgumentParser(
        prog="python -m studies.run_outs", description="Measure run-outs of players without training."
    )
    parser.add_argument("--output", type=Path, default=OUTPUT, help="JSON file (default: %(default)s)")
    args = parser.parse_args(arguments)
    with errors_in_one_line():
        found = measure(args.output)
    print("\n\n".join(blocks(found).values()))
    print(f"\nin {args.output}")


if __name__ == "__main__":
    main()
