"""Verifies the files in `docs/leaderboard` and makes the page from them: `python -m studies.leaderboard`.

An entry is a file of `billiards bench` with the public layouts and the layouts of a second seed, `SEEDS`. All tasks
have noise. The score in a task of one shot is that of the actions with new noise, see `benchmark.fresh`. The seed of
this noise is drawn when the file is new or has changed. The score in a longer task is that of the file. The results and
the seeds are in `studies/results/leaderboard.json`.

The player `studies.leaderboard:trained` is the best row of `configs/learning.yaml` in each task, the policy of the
first seed; `studies.leaderboard:trained:64` is the best of 64 actions that it proposes. `make results` writes their
entries.
"""

from __future__ import annotations

import hashlib
import secrets
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import ROOT, new_figure, run_command, save, table
from billiards_env.bench import benchmark as bench
from billiards_env.bench.frozen import BENCH_TASKS, NAMESPACE
from billiards_env.games import Setup
from billiards_env.intervals import interquartile_mean
from billiards_env.players.named import PlayerEntry, Where, find_player
from billiards_env.players.situation import Player
from studies import RESULTS, learning, read_results

OUTPUT = RESULTS / "leaderboard.json"

FOLDER = ROOT / "docs" / "leaderboard"

SEEDS = (bench.SEED, 1)
"""The seeds of an entry: the seed of the public layouts and one more, because a player may be fitted to those."""

RUN = ("aim", "aim_policy", "aim_policy_64", "geometric", "planner_300", "ppo_points", "random", "search_200")
"""The files whose players the maintainers have run. Of the other files only the actions were replayed."""


def _trained(argument: str, where: Where) -> Player:
    """Returns the best row of `configs/learning.yaml` in the task of an environment; see `policy_player.policy`."""
    assert not isinstance(where, Setup)
    assert where.spec is not None
    row = learning.best_row(read_results(learning.OUTPUT), where.spec.id.removeprefix(NAMESPACE))
    return find_player(f"policy:{learning.OUTPUT.parent / 'policies' / str(row)}:{argument}", where)


trained = PlayerEntry(_trained, argument="1")
"""The player `studies.leaderboard:trained`."""


def entries(
    folder: Path, known: Mapping[str, Any], read: Callable[[Path], bench.Bench] = bench.verify
) -> dict[str, Any]:
    """Returns the scores of the files of a folder: a dict for each, by the name of the file.

    Its keys are `player`, `run` (see `RUN`), `file` (a hash), `noise_seed` (of `benchmark.fresh`) and `scores` by task.

    Args:
        folder: The folder.
        known: The former result. A file that has not changed keeps its seed of the noise.
        read: `bench.verify`, or `bench.load` for files that are already verified.

    Raises:
        ValueError: If a file is refused, has other tasks than the leaderboard, or lacks a seed.
    """
    checked_entries = {}
    for path in sorted(folder.glob("*.json")):
        one, digest, scores = read(path), hashlib.sha256(path.read_bytes()).hexdigest(), {}
        old = known.get(path.stem, {})
        noise_seed = old["noise_seed"] if old.get("file") == digest else secrets.randbits(32)
        drawn = bench.fresh(one, noise_seed).results
        for task in dict.fromkeys(result.task for result in one.results):
            seeds = [result.seed for result in one.results if result.task == task]
            if task not in BENCH_TASKS or sorted(seeds) != list(SEEDS):
                raise ValueError(
                    f"{path}: {task} with seeds {seeds}: expected some of {', '.join(BENCH_TASKS)}, each with the "
                    f"seeds {' and '.join(map(str, SEEDS))}"
                )
            played = drawn if bench.is_one_noisy_shot(task) else one.results
            scores[task] = bench.score([result for result in played if result.task == task])
        run = path.stem in RUN
        checked_entries[path.stem] = {"player": one.player, "run": run, "file": digest, "noise_seed": noise_seed}
        checked_entries[path.stem]["scores"] = scores
    return checked_entries


def aggregate(scores: Mapping[str, Any]) -> float | None:
    """Returns the interquartile mean of the normalised scores; None unless the player plays all tasks."""
    return _mean(scores) if set(BENCH_TASKS) <= set(scores) else None


def _mean(scores: Mapping[str, Any]) -> float:
    """Returns the interquartile mean of the normalised scores in the tasks that a player plays."""
    return float(interquartile_mean([score["normalised"] for score in scores.values()]))


def _ordered(entries: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Returns the entries by their success in the tasks that they play, the best first."""
    return sorted(entries.values(), key=lambda entry: _mean(entry["scores"]), reverse=True)


def blocks(entries: Mapping[str, Any]) -> dict[str, str]:
    """Returns the table for the page, by name."""
    rows = []
    for entry in _ordered(entries):
        scores, total = entry["scores"], aggregate(entry["scores"])
        name = f"`{entry['player']}`" + ("" if entry["run"] else " (replayed only)")
        cells = (f"{scores[task]['success']:.1%}" if task in scores else "-" for task in BENCH_TASKS)
        rows.append((name, "-" if total is None else f"{round(total, 3) + 0.0:.3f}", *cells))
    heads = (task.removesuffix("Noise-v0") for task in BENCH_TASKS)
    return {"table": table(("player", "aggregate", *heads), rows)}


def draw(entries: Mapping[str, Any], folder: Path) -> None:
    """Draws the success of each player in each task, with intervals."""
    figure = new_figure(8, 3.2, dpi=100)
    ax = figure.add_subplot()
    ordered = _ordered(entries)
    for k, entry in enumerate(ordered):
        tasks = [task for task in BENCH_TASKS if task in entry["scores"]]
        scores = [entry["scores"][task] for task in tasks]
        x = np.array([BENCH_TASKS.index(task) for task in tasks]) + (k - (len(ordered) - 1) / 2) * 0.6 / len(ordered)
        rates = np.array([score["success"] for score in scores])
        ends = np.array([score["success_interval"] for score in scores])
        ax.errorbar(
            x, rates, np.abs(ends.T - rates), fmt="o", ms=5, capsize=2, color=f"C{k % 10}", label=entry["player"]
        )
    ax.set_xticks(range(len(BENCH_TASKS)), [task.removesuffix("Noise-v0") for task in BENCH_TASKS])
    ax.set_ylim(-0.03, 1.03)
    ax.set_ylabel("success")
    ax.grid(axis="y", alpha=0.3)
    figure.legend(loc="outside right upper", frameon=False)
    save(figure, folder / "leaderboard.png")


def measure(folder: Path, output: Path) -> dict[str, Any]:
    """Returns the `entries` of a folder. Files that have not changed keep the seeds of the noise in the JSON file."""
    return entries(folder, read_results(output))


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs the command line; see `python -m studies.leaderboard --help`."""
    about = "Verify the files of the leaderboard and make its page."
    options = {"folder": (FOLDER, "the files"), "output": (OUTPUT, "JSON file")}
    run_command("studies.leaderboard", about, arguments, measure, blocks, options, draw)


if __name__ == "__main__":
    main()
