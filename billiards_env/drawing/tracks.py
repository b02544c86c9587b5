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
from billiards_env.drawing.style import CHALK, CLOTH, GREY, INK, looks

LEFT_OUT = "#ff9f1c"
"""The colour of rows that are not fitted."""


_BLUE, _GREEN, _ORANGE, _RED = "#0072b2", "#009e73", "#e69f00", "#d55e00"
_CONTACTS = _BLUE, _GREEN, _ORANGE, _RED
_CASES = (INK, "o"), (GREY, "s"), (_BLUE, "^"), (_RED, "v")


def draw_fit(
    shots: Mapping[str, tuple[Any, NDArray[np.bool_], Recording]],
    errors: Mapping[int, Floats],
    growth: Mapping[str, Mapping[int, float]] | None = None,
) -> Figure:
    """Draws the fit of tracks, see `calibration.tracks.Track`.

    Args:
        shots: The track, the rows that are fitted and the fitted shot of each shot that is drawn, by its title. After
            the last fitted row the path is a prediction.
        errors: The errors of the rows until each contact of the cue ball, m.
        growth: Up to four curves by name: the median error until each contact, m.

    Returns:
        The figure: tables with rows over paths, and under them the distribution of the errors until each contact, and
        the growth of the errors with the contacts.
    """
    across = min(3, len(shots))
    down = math.ceil(len(shots) / across)
    figure = Figure(figsize=(9.0, 9.0 / across * 0.6 * down + 3.4), dpi=150, layout="constrained")
    halves: Any = figure.subfigures(2, 1, height_ratios=(9.0 / across * 0.6 * down, 3.4))
    above, below = halves
    panels = above.subplots(down, across, squeeze=False).ravel()
    marks: dict[str, Any] = {}
    for ax, (title, (track, used, recording)) in zip(panels, shots.items(), strict=False):
        _draw_shot(ax, track, used, recording)
        ax.set_title(title, fontsize=9, pad=3)
        handles, labels = ax.get_legend_handles_labels()
        marks |= zip(labels, handles, strict=True)
    for ax in panels[len(shots) :]:
        ax.axis("off")
    above.legend(
        *(marks.values(), marks),
        loc="outside lower center",
        ncols=len(marks),
        fontsize=8,
        facecolor=CLOTH,
        labelcolor=CHALK,
    )
    left, *right = np.atleast_1d(below.subplots(1, 1 if growth is None else 2))
    for (contact, off), colour in zip(errors.items(), _CONTACTS, strict=True):
        if len(off):
            sizes = np.sort(np.maximum(1e3 * off, 0.05))
            label = f"until contact {contact}"
            left.plot(sizes, np.arange(1, len(sizes) + 1) / len(sizes), color=colour, linewidth=1.5, label=label)
    left.set(xlabel="error of a row, mm", ylabel="share of the rows", xscale="log", xlim=(0.05, 500.0), ylim=(0.0, 1.0))
    left.xaxis.set_major_formatter("{x:g}")
    for ax in right:
        for (name, medians), (colour, marker) in zip((growth or {}).items(), _CASES, strict=False):
            sizes = 1e3 * np.array(list(medians.values()))
            ax.plot(list(medians), sizes, color=colour, marker=marker, markersize=4, linewidth=1.5, label=name)
        ax.set(xlabel="rows until contact", ylabel="median error, mm", xticks=list(errors))
        ax.set_ylim(bottom=0.0)
    for ax, place in zip((left, *right), ("lower right", "upper left"), strict=False):
        ax.grid(alpha=0.3)
        ax.legend(loc=place, fontsize=8)
    return figure


def _draw_shot(ax: Any, track: Any, used: NDArray[np.bool_], recording: Recording) -> None:
    """Draws the paths of a fitted shot and the rows of its track."""
    last, end = track.times.max(), track.times.max(initial=0.0, where=used)
    later = track.times > end
    line = {"color": CHALK, "linewidth": 0.8, "zorder": 4.5}
    cross = {"color": LEFT_OUT, "marker": "x", "markersize": 3.5, "markeredgewidth": 0.9, "linestyle": "none"}
    draw_empty(ax, recording.scene.table)
    for ball, look in enumerate(looks(recording.scene)):
        mine = track.balls == ball
        if not mine.any():
            continue
        times, path = recording.track(ball, np.append(np.linspace(0.0, last, 400), end))
        dot = {"color": look.path, "marker": "o", "markersize": 2.6, "linestyle": "none", "zorder": 4}
        for label, places, options in (
            ("fitted rows", track.positions[mine & used], {**dot, "markeredgecolor": INK, "markeredgewidth": 0.2}),
            ("computed path", path[times <= end], line),
            ("later rows", track.positions[mine & later], {**dot, "markerfacecolor": "none", "markeredgewidth": 0.5}),
            ("predicted path", path[(times > end) & (times <= last)], {**line, "linestyle": (0, (2, 2))}),
            ("rows left out", track.positions[mine & ~used & ~later], {**cross, "zorder": 5}),
        ):
            if len(places):
                ax.plot(*places.T, label=label, **options)
