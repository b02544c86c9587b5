"""Pictures of tracks with matplotlib: their rows over the fitted paths, and the distribution of their errors."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from billiards_env.support.checks import missing

try:
    from matplotlib.figure import Figure
except ModuleNotFoundError as error:
    raise missing("matplotlib", "plot") from error

from billiards_env.drawing.plot import draw_empty
from billiards_env.drawing.recording import Floats, Recording
from billiards_env.drawing.style import CHALK, INK, looks

LEFT_OUT = "#ff9f1c"
"""The colour of rows that are not fitted."""


def draw_fit(shots: Mapping[str, tuple[Any, NDArray[np.bool_], Recording]], errors: Mapping[int, Floats]) -> Figure:
    """Draws the fit of tracks, see `calibration.tracks.Track`.

    Args:
        shots: The track, the rows that are fitted and the fitted shot of each shot that is drawn, by its title.
        errors: The errors of the rows until each contact of the cue ball, m.

    Returns:
        The figure: tables with rows over paths, and under them the distribution of the errors until each contact.
    """
    across = min(3, len(shots))
    down = math.ceil(len(shots) / across)
    figure = Figure(figsize=(9.0, 9.0 / across * 0.6 * down + 3.4), dpi=150, layout="constrained")
    halves: Any = figure.subfigures(2, 1, height_ratios=(9.0 / across * 0.6 * down, 3.4))
    above, below = halves
    panels = above.subplots(down, across, squeeze=False).ravel()
    for ax, (title, (track, used, recording)) in zip(panels, shots.items(), strict=False):
        _draw_shot(ax, track, used, recording)
        ax.set_title(title, fontsize=9, pad=3)
    for ax in panels[len(shots) :]:
        ax.axis("off")
    ax = below.subplots()
    ax.set_xlabel("error of a row, mm")
    ax.set_ylabel("share of the rows")
    ax.set_xscale("log")
    ax.xaxis.set_major_formatter("{x:g}")
    for (contact, off), colour in zip(errors.items(), ("#0072b2", "#009e73", "#e69f00", "#d55e00"), strict=True):
        if len(off):
            sizes = np.sort(np.maximum(1e3 * off, 0.01))
            label = f"until contact {contact}"
            ax.plot(sizes, np.arange(1, len(sizes) + 1) / len(sizes), color=colour, linewidth=1.5, label=label)
    ax.set_ylim(0.0, 1.0)
    ax.grid(alpha=0.3)
    ax.legend(loc="lower right", fontsize=8)
    return figure


def _draw_shot(ax: Any, track: Any, used: NDArray[np.bool_], recording: Recording) -> None:
    """Draws the paths of a fitted shot and the rows of its track."""
    times = np.linspace(0.0, recording.time, 400)
    draw_empty(ax, recording.scene.table)
    for ball, look in enumerate(looks(recording.scene)):
        mine = track.balls == ball
        if not mine.any():
            continue
        _, path = recording.track(ball, times)
        ax.plot(*path.T, color=CHALK, linewidth=0.8, zorder=3)
        dots = {"marker": "o", "linestyle": "none", "color": look.path, "markeredgecolor": INK, "markeredgewidth": 0.2}
        ax.plot(*track.positions[mine & used].T, markersize=2.6, zorder=4, **dots)
        ax.plot(*track.positions[mine & ~used].T, "x", color=LEFT_OUT, markersize=3.5, markeredgewidth=0.9, zorder=5)
