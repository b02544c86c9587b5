"""Draws the figure of a study of timesteps from its results."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from benchmarks import save
from studies.timestep_report import rates, summary

_OWN, _EXACT = "#d55e00", "#0072b2"  # in the world of the training, in the exact world


def draw(result: Mapping[str, Any], path: Path) -> None:
    """Draws the success in the world of the training and in the exact world, against the timestep.

    Args:
        result: The result of a study, see `studies.timestep`.
        path: The PNG file to write.

    Raises:
        OSError: If the file cannot be written.
    """
    matplotlib.rcParams["font.family"] = "DejaVu Sans"  # comes with matplotlib: the same picture everywhere
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
    save(figure, path)
