"""Summarizes the timestep study: statistics over the seeds, tables and pictures.

The statistics follow Agarwal et al. (2021), Deep Reinforcement Learning at the Edge of the Statistical Precipice:
interquartile means with 95% bootstrap intervals over the seeds. The layouts are the same for all policies.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from benchmarks import new_figure, save, table
from billiards_env.intervals import bootstrap, interquartile_mean

EXACT = "exact"
BLUE, ORANGE, GREY = "#0072b2", "#d55e00", "#777777"

CUTS = (0, 15, 30, 45, 60, 90)
"""The edges of the groups of cut angles in which the aim is measured, degrees."""

Result = Mapping[str, Any]
Runs = Sequence[Mapping[str, Any]]
Floats = NDArray[np.float64]


def of_worlds(result: Result) -> tuple[dict[str, Runs], dict[str, Runs]]:
    """Returns the runs of each world with results of `studies.timestep`, those with `move_back` in a second dict."""
    runs: dict[str, Runs] = {world: list(by_seed.values()) for world, by_seed in result["runs"].items() if by_seed}
    main = {world: known for world, known in runs.items() if "move_back" not in world}
    return main, {world: known for world, known in runs.items() if world not in main}


def rates(result: Result, runs: Runs, where: str) -> Floats:
    """Returns the success of runs, (runs,), in their own world for "own" or in the exact one for "exact"."""
    return np.array([run[where] for run in runs]) / result["settings"]["layouts"]


def false_shares(runs: Runs) -> Floats:
    """Returns the share of the successes in the own world that fail in the exact one, (runs,)."""
    return np.array([run["false_successes"] / max(run["own"], 1) for run in runs])


def gap(a: Floats, b: Floats) -> Any:
    """Returns the difference of the interquartile means of a and b."""
    return interquartile_mean(a) - interquartile_mean(b)


def share(values: Floats) -> str:
    """Returns the interquartile mean of shares and its interval as text."""
    low, high = bootstrap(interquartile_mean, values)
    return f"{interquartile_mean(values):.1%} ({100 * low:.1f} to {100 * high:.1f})"


def points(a: Floats, b: Floats) -> str:
    """Returns the difference of the interquartile means of shares and its interval as text, in points."""
    low, high = (100 * end for end in bootstrap(gap, a, b))
    return f"{100 * gap(a, b):+.1f} ({low:+.1f} to {high:+.1f})"


def mean_errors(runs: Runs) -> Floats:
    """Returns the number of shots, their mean error of the aim and its mean prediction, mm, over runs: (cuts, 3)."""
    counts, means = np.split(np.array([run["aim"] for run in runs], float), [1], axis=2)
    return np.hstack((counts.sum(0), (counts * means).sum(0) / np.maximum(counts.sum(0), 1)))


def aim_errors(main: Mapping[str, Runs]) -> dict[str, Floats]:
    """Returns `mean_errors` of each world with a timestep. The errors of the exact world are subtracted."""
    base = mean_errors(main[EXACT]) * (0, 1, 0)
    return {world: mean_errors(runs) - base for world, runs in main.items() if world != EXACT}


def square_difference(errors: Floats) -> float:
    """Returns the root mean square over all shots of measured less predicted errors, mm, of `mean_errors`."""
    return float(np.sqrt(np.average((errors[:, 1] - errors[:, 2]) ** 2, weights=errors[:, 0])))


def blocks(result: Result) -> dict[str, str]:
    """Returns the tables as Markdown, by name."""
    main, moved = of_worlds(result)
    known = [run for runs in (*main.values(), *moved.values()) for run in runs]
    return {
        "size": f"{len(known)} runs of {known[0]['shots']:,} shots, {len(main[EXACT])} seeds in each world with "
        f"`push_apart`, {result['settings']['layouts']:,} new layouts, {sum(run['seconds'] for run in known) / 60:.0f} "
        "minutes of training on one core",
        "main": _main(result, main),
        "aim": _aim(main),
        "move_back": _moved(result, moved, main[EXACT]),
    }


_COMPARED = ("success in its own world", "success in the exact world", "difference from exact training")


def _compared(result: Result, runs: Runs, exact: Runs) -> tuple[str, str, str]:
    """Returns the cells of `_COMPARED`; `exact` are the runs that trained in the exact world."""
    own, played = (rates(result, runs, where) for where in ("own", EXACT))
    return share(own), share(played), "" if runs is exact else points(played, rates(result, exact, EXACT))


def _main(result: Result, main: Mapping[str, Runs]) -> str:
    rows = []
    for world, runs in main.items():
        false = "" if world == EXACT else share(false_shares(runs))
        rows.append((name_of(world), *_compared(result, runs, main[EXACT]), false))
    return table(("trained in", *_COMPARED, "false successes"), rows)


def _moved(result: Result, moved: Mapping[str, Runs], exact: Runs) -> str:
    rows = [(name_of(world), *_compared(result, runs, exact)) for world, runs in moved.items()]
    return table(("trained in", *_COMPARED), rows)


def _aim(main: Mapping[str, Runs]) -> str:
    rows = []
    for world, errors in aim_errors(main).items():
        cells = (f"{measured:+.1f} ({predicted:+.1f})" for _, measured, predicted in errors)
        rows.append((name_of(world), *cells, f"{square_difference(errors):.2f} mm"))
    return table(("trained in", *cuts(), "difference"), rows)


def cuts() -> list[str]:
    """Returns the names of the groups of cut angles."""
    return [f"{low} to {high} degrees" for low, high in pairwise(CUTS)]


def draw(result: Result, folder: Path) -> None:
    """Draws the pictures of the study: `timestep_success.png` and `timestep_aim.png`."""
    main, _ = of_worlds(result)
    save(_draw_success(result, main), folder / "timestep_success.png")
    save(_draw_aim(main), folder / "timestep_aim.png")


def _draw_success(result: Result, main: Mapping[str, Runs]) -> Figure:
    figure = new_figure(7.2, 3.9, dpi=120)
    axes, at = figure.add_subplot(), np.arange(len(main))
    for shift, tested, colour, label in (
        (0.06, "own", ORANGE, "played with the timestep of its training"),
        (-0.06, EXACT, BLUE, "played in exact physics"),
    ):
        values = [100 * rates(result, runs, tested) for runs in main.values()]
        means = np.array([interquartile_mean(v) for v in values])
        ends = np.abs(np.array([bootstrap(interquartile_mean, v) for v in values]).T - means)
        for k, seeds in enumerate(values):
            axes.plot([k + shift] * len(seeds), seeds, ".", color=colour, alpha=0.35, markersize=4)
        axes.errorbar(at + shift, means, ends, fmt="o-", color=colour, capsize=3, label=label)
    axes.set_xticks(at, [EXACT, *(f"{world} s" for world in main if world != EXACT)])
    axes.set(xlabel="timestep of the training", ylabel="balls potted (%)", ylim=(0.0, 100.0))
    axes.set_title("A policy learns the errors of its timestep", loc="left", fontsize=11)
    return finished(figure)


def _draw_aim(main: Mapping[str, Runs]) -> Figure:
    figure = new_figure(7.2, 3.9, dpi=120)
    axes = figure.add_subplot()
    limits = np.array(CUTS)[:-1]  # few shots have a cut of more than 60 degrees
    at, errors = 0.5 * (limits[:-1] + limits[1:]), aim_errors(main)
    for world, colour in (("1/240", "#56b4e9"), ("1/120", BLUE), ("1/60", ORANGE), ("1/30", "#cc79a7")):
        if world in errors:
            _, measured, predicted = errors[world][: len(at)].T
            axes.plot(at, measured, "o-", color=colour, label=f"{world} s")
            axes.plot(at, predicted, "--", color=colour)
    axes.plot([], [], "--", color=GREY, label="predicted from the\nlate contact")
    axes.axhline(0.0, color=GREY, linewidth=0.8)
    axes.set(xlabel="cut angle (degrees)", ylabel="mean error of the aim (mm)", xticks=limits)
    axes.set_title("The error of the aim is the one that makes up for the late contact", loc="left", fontsize=11)
    return finished(figure)


def finished(figure: Figure) -> Figure:
    """Adds the grid and the legend."""
    (axes,) = figure.axes
    axes.grid(alpha=0.3)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(fontsize=9, frameon=False)
    return figure


def name_of(world: str) -> str:
    """Returns the name of a world in a table."""
    step, _, fix = world.partition(" ")
    return world if world == EXACT else f"{step} s" + (f", `{fix}`" if fix else "")
