"""The picture of docs/validation.md."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from benchmarks import new_figure, save
from benchmarks.validation import collisions, cushions

# Okabe and Ito (2008): distinct with every kind of colour vision
COLOURS = ("#0072b2", "#009e73", "#d55e00")
MEASURED: dict[str, Any] = {"linestyle": "none", "marker": "o", "color": "black", "markerfacecolor": "white"}


def draw(_: Any, folder: Path) -> None:
    """Draws the throw, the path of a rolling cue ball, and the speed after a cushion, with the measured values."""
    figure = new_figure(10, 3.8, dpi=120)
    throw, paths, speeds = figure.subplots(1, 3)
    cuts = np.linspace(0.5, 85.0, 170)
    for (name, speed), colour in zip(collisions.SPEEDS.items(), COLOURS, strict=True):
        angles = collisions.throw(collisions.FRICTIONAL, speed, cuts)
        throw.plot(cuts, angles, color=colour, label=f"{name}, {speed:.2f} m/s")
    stun = [(cut, value) for cut, value, _, roll in collisions.THROW_POINTS if roll == 0.0]
    throw.plot(*np.array(stun).T, **MEASURED, label="measured")
    _dress(throw, "Throw of a ball without spin", "cut angle (°)", "throw (°)", 8, "upper right")

    paths.plot(cuts, collisions.wallace_schroeder(cuts), color=COLOURS[2], label="elastic, no friction")
    model = collisions.half_ball_rule(collisions.SNOOKER_PHYSICS, 1.3, cuts)
    paths.plot(cuts, model, color=COLOURS[0], label="model, snooker balls")
    paths.plot(*np.array([(shot.cut, shot.measured[2]) for shot in collisions.SNOOKER]).T, **MEASURED)
    _dress(paths, "30-degree rule", "cut angle (°)", "deflection of the cue ball (°)", 40, "lower center")

    before = np.linspace(0.05, 3.6, 100)
    for (name, physics), colour in zip(cushions.MODELS.items(), COLOURS, strict=True):
        speeds.plot(before, cushions.rebounds(physics, 90.0, before)[0], color=colour, label=name)
    speeds.plot(*np.array(cushions.FIGURE_7A).T, **{**MEASURED, "markersize": 4})
    _dress(speeds, "Rolling into a cushion at 90°", "speed before (m/s)", "speed after (m/s)", 4, "upper left")
    save(figure, folder / "validation.png")


def _dress(axes: Axes, title: str, xlabel: str, ylabel: str, top: float, legend: Any) -> None:
    """Sets the texts of a panel, the largest y, a light grid and the place of the legend."""
    axes.set_title(title, fontsize=10, loc="left")
    axes.set(xlabel=xlabel, ylabel=ylabel, xlim=(0, None), ylim=(0, top))
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8, frameon=False, loc=legend)
