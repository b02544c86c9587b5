"""Draws the figures of a study of timesteps from its results."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from benchmarks import save
from studies.causes import CAUSES
from studies.timestep_report import rates, summary, transfer

_OWN, _EXACT = "#d55e00", "#0072b2"  # in the world of the training, in the exact world
_CAUSES = ("#d55e00", "#e69f00", "#cc79a7", "#f0e442", "#56b4e9", "#0072b2", "#999999")  # in the order of CAUSES


def draw(result: Mapping[str, Any], folder: Path) -> list[Path]:
    """Draws the figures.

    Args:
        result: The result of a study, see `studies.timestep`.
        folder: The folder of the figures.

    Returns:
        The files written: `study_NAME_transfer.png`, `study_NAME_success.png` and `study_NAME_policies.png`.

    Raises:
        OSError: If a file cannot be written.
    """
    matplotlib.rcParams["font.family"] = "DejaVu Sans"  # comes with matplotlib: the same picture everywhere
    paths = []
    for name, figure in (("transfer", transfer_figure), ("success", success_figure), ("policies", policies_figure)):
        paths.append(folder / f"study_{result['study']}_{name}.png")
        save(figure(result), paths[-1])
    return paths


def transfer_figure(result: Mapping[str, Any]) -> Figure:
    """Returns a figure of the success of the policies of each world (rows) in each world (columns)."""
    matrix = transfer(result)
    worlds = list(matrix)
    percent = 100 * np.array([[matrix[a][b]["mean"] for b in worlds] for a in worlds])
    figure = Figure(figsize=(1.7 + 0.75 * len(worlds), 1.3 + 0.62 * len(worlds)), dpi=120, layout="constrained")
    axes = figure.add_subplot()
    image = axes.imshow(percent, cmap="viridis", vmin=0.0, vmax=max(float(percent.max()), 1e-9), aspect="auto")
    for (row, column), rate in np.ndenumerate(percent):
        dark = rate < 0.6 * percent.max()
        axes.text(column, row, f"{rate:.1f}", ha="center", va="center", color="white" if dark else "black", fontsize=9)
    axes.set_xticks(range(len(worlds)), worlds)
    axes.set_yticks(range(len(worlds)), worlds)
    axes.set(xlabel="played in a world of timestep (s)", ylabel="trained in")
    figure.colorbar(image, label="success (%)")
    return figure


def success_figure(result: Mapping[str, Any]) -> Figure:
    """Returns a figure of the success in the world of the training and in the exact world, against the timestep."""
    means = summary(result)
    # The exact world, whose timestep would be 0, is on the left.
    worlds = sorted(means, key=lambda world: result["worlds_measured"][world]["dt"] or 0.0)
    figure = Figure(figsize=(6.6, 3.8), dpi=120, layout="constrained")
    axes = figure.add_subplot()
    for shift, key, colour, label in (
        (-0.08, "exact", _EXACT, "in the exact world"),
        (0.08, "own", _OWN, "in the world of the training"),
    ):
        for k, world in enumerate(worlds):
            played = "exact" if key == "exact" else world
            found = rates(result, world, played)
            axes.plot([k + shift] * len(found), 100 * np.array(found), ".", color=colour, alpha=0.5, markersize=5)
        heights = 100 * np.array([means[world][key]["mean"] for world in worlds])
        intervals = [means[world][key]["interval"] or [means[world][key]["mean"]] * 2 for world in worlds]
        ends = np.abs(100 * np.clip(intervals, 0.0, 1.0).T - heights)
        axes.errorbar(np.arange(len(worlds)) + shift, heights, ends, fmt="o-", color=colour, capsize=3, label=label)
    axes.set_xticks(range(len(worlds)), worlds)
    axes.set(xlabel="timestep of the training (s)", ylabel="success (%)", ylim=(0.0, None))
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8)
    return figure


def policies_figure(result: Mapping[str, Any]) -> Figure:
    """Returns a figure of the speeds, turns, cuts and false successes of the policies of each world."""
    means = summary(result)
    colours = dict(zip(means, matplotlib.colormaps["viridis"](np.linspace(0.0, 0.92, len(means))), strict=True))
    colours["exact"] = "black"
    figure = Figure(figsize=(10.5, 7.2), dpi=110, layout="constrained")
    (speeds, turns), (cuts, causes) = figure.subplots(2, 2)
    for world, colour in colours.items():
        for axes, name in ((speeds, "speed"), (turns, "turn"), (cuts, "cut")):
            counts = [np.array(p[name]["counts"]) for p in result["policies"] if p["world"] == world]
            shares = np.mean([count / max(count.sum(), 1) for count in counts], axis=0)
            edges = np.array(result["bins"][name])
            if not shares.any():  # no other policy of the exact world, or no shot at the ball
                continue
            if name == "turn":
                axes.plot(edges[1:], 100 * np.cumsum(shares), color=colour, label=world)
            else:
                axes.stairs(100 * shares, edges, color=colour, label=world)
    _label(speeds, "Speed of the shots", "speed (m/s)", "share of the shots (%)")
    _label(turns, "Direction, against the policies of the exact world", "turn (degrees), at most", "share (%)")
    turns.set_xscale("log")
    _label(cuts, "Cut at the nearest ball to pot", "cut: 0 full, 1 and -1 grazed", "share of the shots at it (%)")
    cuts.set_xticks(np.linspace(-1.0, 1.0, 5))
    _causes(causes, {world: t for world, t in means.items() if world != "exact"})
    speeds.legend(fontsize=8, title="trained in", title_fontsize=8)
    return figure


def _causes(axes: Axes, means: Mapping[str, Mapping[str, Any]]) -> None:
    """Draws bars of the false successes of each world, by cause."""
    base = np.zeros(len(means))
    for name, colour in zip(CAUSES, _CAUSES, strict=True):
        shares = 100 * np.array([t["causes"][name]["mean"] for t in means.values()])
        axes.bar(range(len(means)), shares, bottom=base, color=colour, label=name.replace("_", " "))
        base += shares
    axes.set_xticks(range(len(means)), list(means))
    _label(axes, "Successes that fail in the exact world, by cause", "trained in", "share of the successes (%)")
    axes.legend(fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0))


def _label(axes: Axes, title: str, x: str, y: str) -> None:
    axes.set_title(title, fontsize=10)
    axes.set(xlabel=x, ylabel=y)
    axes.grid(alpha=0.3)
