"""Trains rows of `configs/learning.yaml` with fewer and with more shots: `python -m studies.budgets`.

In each training the learning rate and the phases are scaled to its number of shots. All trainings have the first seed
of the published results, and the published training is one of the points. A policy plays new layouts alone, and the
public layouts with `PROPOSALS` simulated proposals. The results are

* `studies/results/budgets.json`: for each row its settings, and the result of each training by its number of shots,
* `docs/images/budgets.png`: the success against the number of shots.

The command skips the trainings that have results with the same settings. A training that was interrupted continues.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from agents.config import LEARNING, load, rows
from benchmarks import new_figure, run_command, save, table
from billiards_env.settings import read_settings
from billiards_env.support.files import write_json
from studies import JOBS, RESULTS, RUNS, completed, executor, learning, read_results

OUTPUT = RESULTS / "budgets.json"

FACTORS: dict[str, tuple[float, ...]] = {
    "place": (0.125, 0.25, 0.5, 2, 12),
    "position": (0.25, 0.5, 8),
    "nine_ball": (0.25, 3),
}
"""For each row, the numbers of shots of its trainings, as multiples of the number in the row. The longest training
takes about an hour of processor time for `place` and `position`, and about 40 minutes for `nine_ball`."""

PROPOSALS = 16


def measure(output: Path, jobs: int, address: str) -> dict[str, Any]:
    """Trains what has no results, and writes each result as soon as it is known.

    The arguments are those of `learning.measure`.

    Returns:
        For each row its `settings`, and its `trainings` by their number of shots, see `run_budget`.
    """
    old, measured, folder = read_results(output), {}, RUNS if output == OUTPUT else output.resolve().parent / "runs"
    for name in FACTORS:
        known, settings = old.get(name, {}), rows()[name]
        measured[name] = known if known.get("settings") == settings else {"settings": settings, "trainings": {}}
    shots = [(name, round(factor * load(name).timesteps)) for name, factors in FACTORS.items() for factor in factors]
    calls = {
        (name, count): (run_budget, name, count, folder / "budgets" / name / str(count))
        for name, count in shots
        if str(count) not in measured[name]["trainings"]
    }
    with executor(jobs, address) as pool:
        for (name, count), result in completed(pool, calls, len(shots) - len(calls)):
            measured[name]["trainings"][str(count)] = result
            write_json(output, measured)
    return measured


def run_budget(name: str, shots: int, folder: Path) -> dict[str, float]:
    """Trains a row with a number of shots, unless the folder holds the finished run.

    Returns:
        `seconds`, the processor time of the training, and the success `alone` and `of_many` proposals.
    """
    task = rows()[name]["plays"][0]
    result, _ = learning.run_row(name, _seed(), folder, learning.EPISODES, timesteps=shots)
    proposed = learning.propose(folder, task, PROPOSALS)
    alone = result["tasks"][task]["success_rate"]
    return {"seconds": result["curve"][-1][1], "alone": alone, "of_many": proposed["success"]}


def points(measured: Mapping[str, Any]) -> dict[str, list[tuple[int, dict[str, float]]]]:
    """Returns the trainings of each row, with the published one, by ascending number of shots."""
    published, found = read_results(learning.OUTPUT), {}
    for name, one in measured.items():
        trainings = {int(shots): result for shots, result in one["trainings"].items()}
        known, task = published.get(name, {}), rows()[name]["plays"][0]
        if known.get("settings") == one["settings"]:
            run, proposals = known["runs"][str(_seed())], known["proposals"][task]
            trainings[run["curve"][-1][0]] = {
                "seconds": run["curve"][-1][1],
                "alone": run["tasks"][task]["success_rate"],
                "of_many": proposals[str(PROPOSALS)]["success"],
            }
        found[name] = sorted(trainings.items())
    return found


def _seed() -> int:
    return read_settings(LEARNING, "settings")["seeds"][0]


def blocks(measured: Mapping[str, Any]) -> dict[str, str]:
    """Returns the table for the page."""
    lines = [
        (f"`{name}`", f"{shots / 1e6:.1f}", f"{one['seconds']:.0f} s", f"{one['alone']:.1%}", f"{one['of_many']:.1%}")
        for name, trainings in points(measured).items()
        for shots, one in trainings
    ]
    return {"table": table(("row", "million shots", "processor time", "alone", f"of {PROPOSALS}"), lines)}


def draw(measured: Mapping[str, Any], folder: Path) -> None:
    """Draws the success of each row against the number of shots, beside the players without training."""
    figure, others = new_figure(9, 3.0), learning.players()
    lines: dict[str, Any] = {}
    panels = figure.subplots(1, len(measured), sharey=True, squeeze=False)[0]
    for axes, (name, trainings) in zip(panels, points(measured).items(), strict=True):
        task, shots = rows()[name]["plays"][0], [count / 1e6 for count, _ in trainings]
        for k, (key, label) in enumerate((("of_many", f"best of {PROPOSALS}"), ("alone", "alone"))):
            rates = [100 * one[key] for _, one in trainings]
            (lines[label],) = axes.semilogx(shots, rates, "o-", color=f"C{1 - k}", markersize=4, label=label)
        for player, style in learning.LINES.items():
            if player in others[task]:
                lines[player] = axes.axhline(100 * others[task][player], linewidth=1.2, **style)
        axes.set_title(task.removesuffix("-v0"), fontsize=10)
        axes.set(ylim=(0, 105), xlabel="million shots")
        axes.set_xticks(shots, [f"{count:.3g}" for count in shots])
        axes.minorticks_off()
        axes.grid(alpha=0.3)
    figure.supylabel("success (%)", fontsize=10)
    figure.legend(lines.values(), lines, loc="outside upper center", ncols=len(lines), fontsize=9, frameon=False)
    save(figure, folder / "budgets.png")


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs the command line; see `python -m studies.budgets --help`."""
    about = "Train rows of configs/learning.yaml with fewer and more shots."
    run_command("studies.budgets", about, arguments, measure, blocks, {"output": (OUTPUT, "JSON file"), **JOBS}, draw)


if __name__ == "__main__":
    main()
