"""Measures what players lose by the scatter of the cushions: `python -m studies.scatter`.

The players take no account of it. The results are in `studies/results/scatter.json`. The command skips what has
results there.
"""

from __future__ import annotations

import functools
from pathlib import Path
from typing import Any

from benchmarks import run_command, table
from billiards_env.bench.evaluation import measure as measure_player
from billiards_env.bench.frozen import FROZEN
from billiards_env.shots.noise import SCATTER
from studies import RESULTS, fill, resumed

TASKS = {"Carom-v0": "carom", "ThreeCushion-v0": "three_cushion"}
"""The tasks, and the folders of the trained policies in `studies/results/policies`."""

PLAYERS = {"random": "random", "search": "search:200", "aim": "aim", "policy": "policy:{}", "policy:16": "policy:{}:16"}
"""The players; {} is the folder of the policy."""

EPISODES = 300


def measure(output: Path) -> dict[str, Any]:
    """Returns the success of each player in each task, without and with the scatter."""
    results = resumed(output, {"scatter": SCATTER, "episodes": EPISODES}, players={})
    jobs = {
        ("players", task, name, scatter): functools.partial(_success, player, task, scatter == "scatter")
        for task in TASKS
        for name, player in PLAYERS.items()
        for scatter in ("exact", "scatter")
    }
    return fill(output, results, jobs)


def _success(player: str, task: str, scatter: bool) -> dict[str, Any]:
    player = player.format(RESULTS / "policies" / TASKS[task])
    arguments = {**FROZEN[task].arguments, "scatter": SCATTER if scatter else None}
    result = measure_player(player, arguments, (0.0, 0.0), EPISODES, 0)
    return {name: result[name] for name in ("success_rate", "confidence_interval_95")}


def blocks(results: dict[str, Any]) -> dict[str, str]:
    """Returns the table of the players."""
    rows = []
    for task, players in results["players"].items():
        for name, cases in players.items():
            cells = []
            for case in cases.values():
                low, high = case["confidence_interval_95"]
                cells.append(f"{case['success_rate']:.1%} ({100.0 * low:.1f} to {100.0 * high:.1f})")
            rows.append((f"`Billiards/{task}`", f"`{name}`", *cells))
    return {"players": table(("task", "player", "exact cushions", "with scatter"), rows)}


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m studies.scatter --help`."""
    about = "Measure what players lose by the scatter of the cushions."
    output = {"output": (RESULTS / "scatter.json", "JSON file")}
    run_command("studies.scatter", about, arguments, measure, blocks, output)


if __name__ == "__main__":
    main()
