"""Verifies the files in `leaderboard` and makes the table and the picture of the page: `python -m studies.leaderboard`.

An entry is a file of `billiards bench` with the public layouts and the layouts of a second seed, `SEEDS`. The results
are in `studies/results/leaderboard.json`. `--check` verifies files and writes nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from benchmarks import save, table, use_own_font
from billiards_env import bench
from billiards_env.commands import ending
from billiards_env.files import write_json
from billiards_env.frozen import BENCH_TASKS
from billiards_env.intervals import interquartile_mean
from studies import RESULTS, parser_of

OUTPUT = RESULTS / "leaderboard.json"
ROOT = Path(__file__).resolve().parent.parent
FOLDER = ROOT / "leaderboard"
FIGURE = ROOT / "docs" / "images" / "leaderboard.png"

SEEDS = (bench.SEED, 1)
"""The seeds of an entry: the seed of the public layouts and one more, because a player may be fitted to those."""

RUN = (
    "aim",
    "distilled",
    "geometric",
    "gradient",
    "planner_300",
    "ppo_points",
    "ppo_pot",
    "random",
    "ratings",
    "search_200",
)
"""The files whose players the maintainers have run. Of the other files only the actions were replayed."""


def entries(folder: Path, read: Callable[[Path], bench.Bench] = bench.verify) -> dict[str, Any]:
    """Returns the scores of all files of a folder: by name of the file, `player`, `scores` by task and `checked`.

    Args:
        folder: The folder.
        read: `bench.verify`, or `bench.load` for files that are already verified.

    Raises:
        ValueError: If a file is refused, has other tasks than the leaderboard, or lacks a seed.
    """
    found = {}
    for path in sorted(folder.glob("*.json")):
        one = read(path)
        scores = {}
        for task in dict.fromkeys(result.task for result in one.results):
            results = [result for result in one.results if result.task == task]
            if task not in BENCH_TASKS or sorted(result.seed for result in results) != list(SEEDS):
                raise ValueError(
                    f"{path}: {task} with seeds {[result.seed for result in results]}: expected some of "
                    f"{', '.join(BENCH_TASKS)}, each with the seeds {' and '.join(map(str, SEEDS))}"
                )
            scores[task] = bench.score(results)
        checked = "player run by the maintainers" if path.stem in RUN else "replayed only"
        found[path.stem] = {"player": one.player, "checked": checked, "scores": scores}
    return found


def aggregate(scores: Mapping[str, Any]) -> float | None:
    """Returns the interquartile mean of the normalised scores; None unless all tasks have one."""
    normalised = [scores.get(task, {}).get("normalised") for task in BENCH_TASKS]
    return None if None in normalised else interquartile_mean(np.array(normalised))


def _ordered(found: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Returns the entries by their aggregate; without one by the mean score, in which a missing task counts 0."""

    def key(entry: Mapping[str, Any]) -> float:
        total = aggregate(entry["scores"])
        known = sum(score["normalised"] or 0.0 for score in entry["scores"].values())
        return known / len(BENCH_TASKS) if total is None else total

    return sorted(found.values(), key=key, reverse=True)


def blocks(found: Mapping[str, Any]) -> dict[str, str]:
    """Returns the tables for the page, by name."""
    rows, more = [], []
    for entry in _ordered(found):
        scores, total = entry["scores"], aggregate(entry["scores"])
        cells = (f"{scores[task]['success']:.1%}" if task in scores else "-" for task in BENCH_TASKS)
        rows.append((entry["player"], "-" if total is None else f"{total:.3f}", *cells, entry["checked"]))
        for task, score in scores.items():
            low, high = score["success_interval"]
            least, most = score["return_interval"]
            scaled = score["normalised"]
            more.append(
                (
                    entry["player"],
                    task,
                    f"{score['success']:.1%} ({100 * low:.1f} to {100 * high:.1f})",
                    f"{score['mean_return']:.3f} ({least:.3f} to {most:.3f})",
                    "-" if scaled is None else f"{scaled:.3f}",
                )
            )
    return {
        "table": table(("player", "aggregate", *BENCH_TASKS, "checked"), rows),
        "details": table(("player", "task", "success", "mean return", "normalised"), more, left=2),
    }


def picture(found: Mapping[str, Any]) -> Figure:
    """Returns the success of each player in each task, with intervals."""
    use_own_font()
    figure = Figure(figsize=(8, 3.2), layout="constrained")
    ax = figure.add_subplot()
    ordered = _ordered(found)
    for k, entry in enumerate(ordered):
        tasks = [task for task in BENCH_TASKS if task in entry["scores"]]
        scores = [entry["scores"][task] for task in tasks]
        x = np.array([BENCH_TASKS.index(task) for task in tasks]) + (k - (len(ordered) - 1) / 2) * 0.6 / len(ordered)
        rates = np.array([score["success"] for score in scores])
        ends = np.array([score["success_interval"] for score in scores])
        ax.errorbar(
            x, rates, np.abs(ends.T - rates), fmt="o", ms=5, capsize=2, color=f"C{k % 10}", label=entry["player"]
        )
    ax.set_xticks(range(len(BENCH_TASKS)), BENCH_TASKS)
    ax.set_ylim(-0.03, 1.03)
    ax.set_ylabel("success")
    ax.grid(axis="y", alpha=0.3)
    figure.legend(loc="outside right upper", frameon=False)
    return figure


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs the command line; see `python -m studies.leaderboard --help`."""
    parser = parser_of(
        "leaderboard",
        "Verify the files of the leaderboard and make its page.",
        folder=(FOLDER, "the files"),
        output=(OUTPUT, "JSON file"),
        figure=(FIGURE, "the picture, .png"),
        check=(False, "verify the files and write nothing"),
    )
    args = parser.parse_args(arguments)
    with ending("the same command continues"):
        found = entries(args.folder)
        if not args.check:
            write_json(args.output, found)
            save(picture(found), args.figure)
        print("\n\n".join(blocks(found).values()))


if __name__ == "__main__":
    main()
