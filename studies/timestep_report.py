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
from billiards_env.support.intervals import bootstrap, interquartile_mean

EXACT = "exact"
BLUE, ORANGE, GREY = "#0072b2", "#d55e00", "#777777"
SHOTS_OF_FINE_TUNING = (0, 50_000, 100_000, 200_000, 500_000)

GROUPS = {
    "cut angle": ("degrees", (0, 15, 30, 45, 60, 90)),
    "distance": ("m", (0.0, 0.5, 1.0, 2.9)),
    "speed": ("m/s", (0.0, 0.8, 1.1, 4.0)),
}
"""The groups of shots in which the aim is measured: the unit and the edges. The speed is that at the hit."""

GAMES = {"long": "one ball", "three_balls": "three balls, five shots", "carom": "carom"}
"""The names of the games in the table of the longer training and of other games, by part."""

Result = Mapping[str, Any]
Floats = NDArray[np.float64]


def of_part(result: Result, part: str) -> dict[str, list[dict[str, Any]]]:
    """Returns the runs of a part by world, from the results of `studies.timestep`."""
    by_world: dict[str, list[dict[str, Any]]] = {}
    for run in result["runs"].values():
        if run["part"] == part:
            by_world.setdefault(run["world"], []).append(run)
    order = list(next(iter(result["runs"].values()))["success"])  # the worlds, with the smallest timestep first
    return {world: by_world[world] for world in sorted(by_world, key=lambda w: order.index(w) if w in order else -1)}


def rates(result: Result, runs: Sequence[Mapping[str, Any]], tested: str) -> Floats:
    """Returns the success of runs in a world, or in their own one for "own"; (runs,)."""
    counts = [run["own"] if tested == "own" else run["success"][tested] for run in runs]
    return np.array(counts) / result["layouts"]


def false_shares(runs: Sequence[Mapping[str, Any]]) -> Floats:
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


def mean_errors(runs: Sequence[Mapping[str, Any]], group: str) -> Floats:
    """Returns the mean error of the aim and its mean prediction, mm, over all shots of runs: (groups, 2)."""
    aims = np.array([run["aim"][group] for run in runs])
    return (aims[..., :1] * aims[..., 1:]).sum(0) / np.maximum(aims[..., :1].sum(0), 1)


def success_after(run: Mapping[str, Any], shots: int) -> float:
    """Returns the success of the first evaluation after a number of shots of the training."""
    return next(point["success"] for point in run["curve"] if point["shots"] >= shots)


def blocks(result: Result) -> dict[str, str]:
    """Returns the tables as Markdown, by name."""
    main = of_part(result, "main")
    exact = rates(result, main[EXACT], EXACT)
    seconds = sum(run["curve"][-1]["seconds"] for run in result["runs"].values())
    numbers = [len(runs) for runs in main.values()]
    return {
        "size": f"{len(result['runs'])} runs, {numbers[0]} seeds in each world of the main part, "
        f"{result['layouts']:,} layouts, {seconds / 3600:.1f} hours of training on one core",
        "main": _main(result, main, exact),
        "aim": _aim(main),
        "new seeds": _new_seeds(main),
        "control": _controls(result, {**of_part(result, "random"), **of_part(result, "move_back")}, exact),
        "fine_tuning": _fine_tuning(result, main, of_part(result, "fine_tuning")),
        "ablation": _ablation(result, of_part(result, "ablation"), main[EXACT]),
        "games": _games(result, {name: of_part(result, name) for name in GAMES}),
        "seeds": _seeds(result, (main[EXACT], of_part(result, "long")[EXACT])),
    }


_COMPARED = ("success in its own world", "success in the exact world", "difference from exact training")


def _compared(result: Result, runs: Sequence[Mapping[str, Any]], exact: Floats | None) -> tuple[str, str, str]:
    """Returns the cells of `_COMPARED`, from the success of the runs that trained in the exact world."""
    own, played = rates(result, runs, "own"), rates(result, runs, EXACT)
    return share(own), share(played), "" if exact is None else points(played, exact)


def _main(result: Result, main: Mapping[str, list[dict[str, Any]]], exact: Floats) -> str:
    rows = []
    for world, runs in main.items():
        compared = _compared(result, runs, None if world == EXACT else exact)
        rows.append((_name(world), *compared, "" if world == EXACT else share(false_shares(runs))))
    return table(("trained in", *_COMPARED, "false successes"), rows)


def _aim(main: Mapping[str, list[dict[str, Any]]]) -> str:
    group = "cut angle"
    unit, edges = GROUPS[group]
    base = mean_errors(main[EXACT], group)[:, 0]
    head = [f"{low:g} to {high:g} {unit}" for low, high in pairwise(edges)]
    rows = []
    for world, runs in main.items():
        if world != EXACT:
            measured, predicted = mean_errors(runs, group).T
            cells = (f"{m - b:+.1f} ({p:+.1f})" for m, b, p in zip(measured, base, predicted, strict=True))
            rows.append((_name(world), *cells))
    return table(("trained in", *head), rows)


def _new_seeds(main: Mapping[str, list[dict[str, Any]]]) -> str:
    """Returns the root mean square of measured less predicted errors of the aim, for each half of the seeds."""
    seeds = sorted(run["seed"] for run in main[EXACT])
    halves = []
    for half in (seeds[: len(seeds) // 2], seeds[len(seeds) // 2 :]):
        chosen = {world: [run for run in runs if run["seed"] in half] for world, runs in main.items()}
        base = mean_errors(chosen[EXACT], "cut angle")[:, 0]
        cells = []
        for world in (world for world in main if world != EXACT):
            measured, predicted = mean_errors(chosen[world], "cut angle").T
            weights = np.sum([[row[0] for row in run["aim"]["cut angle"]] for run in chosen[world]], axis=0)
            square = (weights * (measured - base - predicted) ** 2).sum() / max(weights.sum(), 1)
            cells.append(f"{np.sqrt(square):.2f} mm ({_name(world)})")
        halves.append(f"seeds {half[0]} to {half[-1]}: {', '.join(cells)}")
    return "; ".join(halves) + "."


def _controls(result: Result, controls: Mapping[str, list[dict[str, Any]]], exact: Floats) -> str:
    rows = []
    for world, runs in controls.items():
        name = "all timesteps, one drawn for each update" if world == "random" else f"{_name(world)}, `move_back`"
        own, *others = _compared(result, runs, exact)
        rows.append((name, "" if world == "random" else own, *others))
    return table(("trained in", *_COMPARED), rows)


def _fine_tuning(
    result: Result, main: Mapping[str, list[dict[str, Any]]], tuned: Mapping[str, list[dict[str, Any]]]
) -> str:
    rows = []
    for world, runs in tuned.items():
        seeds = [run["seed"] for run in runs]
        before = rates(result, [run for run in main[world] if run["seed"] in seeds], EXACT)
        after = ([success_after(run, shots) for run in runs] for shots in SHOTS_OF_FINE_TUNING[1:])
        rows.append((_name(world), *(f"{np.mean(values):.1%}" for values in (before, *after))))
    evaluated = [point["shots"] for point in main[EXACT][0]["curve"]]
    scratch = (
        f"{np.mean([success_after(run, shots) for run in main[EXACT]]):.1%}" if shots >= evaluated[0] else ""
        for shots in SHOTS_OF_FINE_TUNING
    )
    rows.append(("a new policy", *scratch))
    return table(("trained before in", *(f"{shots:,} shots" for shots in SHOTS_OF_FINE_TUNING)), rows)


def _ablation(result: Result, without: Mapping[str, list[dict[str, Any]]], runs: Sequence[Mapping[str, Any]]) -> str:
    rows = [("as it is", "", share(rates(result, runs, EXACT)), "")]
    for name, changed in without.items():
        values = rates(result, changed, EXACT)
        rows.append((name, f"`{changed[0]['options']}`", share(values), points(values, rates(result, runs, EXACT))))
    return table(("policy", "options", "success", "difference"), rows, left=2)


def _games(result: Result, games: Mapping[str, Mapping[str, list[dict[str, Any]]]]) -> str:
    rows = []
    for name, worlds in games.items():
        for world, runs in worlds.items():
            exact = None if world == EXACT else rates(result, worlds[EXACT], EXACT)
            shots = f"{runs[0]['curve'][-1]['shots']:,}"
            rows.append((GAMES[name], _name(world), shots, *_compared(result, runs, exact)))
    return table(("game", "trained in", "shots", *_COMPARED), rows, left=2)


def _seeds(result: Result, parts: Sequence[Sequence[Mapping[str, Any]]]) -> str:
    rows = []
    for runs in parts:
        values = rates(result, runs, EXACT)
        shots, seconds = runs[0]["curve"][-1]["shots"], min(run["curve"][-1]["seconds"] for run in runs)
        rows.append((f"{shots:,}", str(len(values)), share(values), f"{np.ptp(values):.1%}", f"{shots / seconds:,.0f}"))
    return table(("shots", "seeds", "success", "spread over seeds", "peak shots/s, one core"), rows, left=0)


def draw(result: Result, folder: Path) -> None:
    """Draws the pictures of the study: `timestep_success.png` and `timestep_aim.png`."""
    main = of_part(result, "main")
    save(_draw_success(result, main), folder / "timestep_success.png")
    save(_draw_aim(main), folder / "timestep_aim.png")


def _draw_success(result: Result, main: Mapping[str, list[dict[str, Any]]]) -> Figure:
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


def _draw_aim(main: Mapping[str, list[dict[str, Any]]]) -> Figure:
    figure = new_figure(7.2, 3.9, dpi=120)
    axes = figure.add_subplot()
    limits = np.array(GROUPS["cut angle"][1])[:-1]  # few shots have a cut of more than 60 degrees
    at = 0.5 * (limits[:-1] + limits[1:])
    base = mean_errors(main[EXACT], "cut angle")[: len(at), 0]
    for world, colour in (("1/240", "#56b4e9"), ("1/120", BLUE), ("1/60", ORANGE), ("1/30", "#cc79a7")):
        if world in main:
            measured, predicted = mean_errors(main[world], "cut angle")[: len(at)].T
            axes.plot(at, measured - base, "o-", color=colour, label=f"{world} s")
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


def _name(world: str) -> str:
    return world if world == EXACT else f"{world} s"
