"""A picture of a shot, drawn to scale with matplotlib.

It shows the initial positions as faint balls, the paths, the final positions, a ring for each ball in a contact, and a
mark with the time of each event. Each kind of event has a different mark.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from billiards_env.checks import missing

try:
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D
    from matplotlib.patches import Circle, FancyBboxPatch, Polygon, Rectangle
except ModuleNotFoundError as error:
    raise missing("matplotlib", "plot") from error

from billiards_env.drawing.recording import Floats, Recording, check_pair
from billiards_env.drawing.style import (
    CHALK,
    CLOTH,
    INK,
    POCKET,
    POTTED,
    RAIL,
    Look,
    draw_table,
    looks,
    rail_width,
    tray,
    tray_height,
)
from billiards_env.scene import Scene

MARKS = {
    "ball_ball": ("*", 11, "ball hits ball"),
    "cushion": ("s", 4.5, "ball hits cushion"),
    "sliding_rolling": ("o", 3.5, "slides until here, then rolls"),
    "pocket": ("D", 5, "potted"),
}
"""The marker of an event kind, its size in points, and its meaning."""

SAMPLES = 400
"""Number of points of a path, in addition to its corners."""

WEAK = 0.02
"""m/s. Slower contacts have no mark, because balls that come to rest against each other touch about a hundred times."""


def draw_shot(recording: Recording, ax: Axes | None = None, compare: Recording | None = None) -> Axes:
    """Draws a shot.

    Args:
        recording: The shot.
        ax: The axes to draw in; None for a new figure.
        compare: Another run of the shot, drawn with dashed paths and rings.

    Returns:
        The axes, in metres.

    Raises:
        ValueError: If `compare` has other balls or another table.
    """
    if compare is not None:
        check_pair(recording, compare)
    if ax is None:
        from matplotlib import pyplot

        ratio = recording.scene.table.width / recording.scene.table.length
        figure, ax = pyplot.subplots(figsize=(9, 0.6 + 9 * min(max(ratio, 0.2), 2)), layout="constrained")
        figure.legend(handles=legend_handles(), loc="outside lower center", ncols=6, frameon=False, fontsize=8)
    scene, look = recording.scene, looks(recording.scene)
    _draw_table(ax, recording, look)
    if compare is not None:
        for i in _in_play(compare):
            _draw_path(ax, compare, i, look[i], (0, (3, 2)))
            if compare.gone[i] == np.inf:
                _draw_ring(ax, scene, i, look[i], compare.path(i, [compare.time])[0], 1.6)
    for i in _in_play(recording):
        if recording.moves(i):
            _draw_path(ax, recording, i, look[i], "-")
            draw_ball(ax, scene.balls.radius[i], look[i], recording.path(i, [0.0])[0], ghost=True)
        if recording.gone[i] == np.inf:
            draw_ball(ax, scene.balls.radius[i], look[i], recording.path(i, [recording.time])[0], ghost=False)
    _draw_events(ax, recording, look)
    return ax


def _draw_table(ax: Axes, recording: Recording, look: tuple[Look, ...]) -> None:
    """Draws the empty table and the potted balls under it, in metres."""
    table = recording.scene.table
    rail = rail_width(table)
    for corners, colour in draw_table(table):
        ax.add_patch(Polygon(corners, facecolor=colour, edgecolor="none", zorder=1))
    x, y, strip = table.length / 2 + 1.1 * rail, table.width / 2 + 1.1 * rail, tray_height(table)
    if table.pockets:
        radius, half, places = tray(recording.scene.n_balls, 2 * x, strip)
        corner, size = (-half, -y - strip / 2 - 1.35 * radius), (2 * half, 2.7 * radius)
        groove = f"round,pad=0,rounding_size={1.35 * radius}"
        ax.add_patch(FancyBboxPatch(corner, *size, boxstyle=groove, facecolor=RAIL, edgecolor="none", zorder=1))
        ax.text(-half - radius, -y - strip / 2, POTTED, color=INK, fontsize=8.5, ha="right", va="center_baseline")
        for ball, place in zip(np.flatnonzero(np.isfinite(recording.gone)).tolist(), places, strict=False):
            draw_ball(ax, radius, look[ball], (place, -y - strip / 2), ghost=False)
    ax.set_xlim(-x, x)
    ax.set_ylim(-y - strip, y)
    ax.set_aspect("equal")
    ax.axis("off")


def legend_handles() -> list[Line2D]:
    """Returns the legend entries of the balls and marks."""
    marks = [("o", 9, "#63762f", "#e69f00", "start"), ("o", 9, "#e69f00", CHALK, "end")]
    for kind, (marker, size, label) in MARKS.items():
        fill = CHALK if kind in ("sliding_rolling", "ball_ball") else "#888888"
        marks.append((marker, size, fill, INK, label))
    return [
        Line2D([], [], marker=m, linestyle="none", markersize=s, color=f, markeredgecolor=e, label=text)
        for m, s, f, e, text in marks
    ]


def _in_play(recording: Recording) -> Sequence[int]:
    return np.flatnonzero(recording.gone > 0).tolist()


def _draw_path(ax: Axes, shot: Recording, ball: int, look: Look, style: Any) -> None:
    if not shot.moves(ball):
        return
    times = np.union1d(np.linspace(0, shot.time, SAMPLES), shot.corners(ball))
    path = shot.path(ball, times[times < shot.gone[ball]])
    ax.plot(*path.T, linestyle=style, color=look.path, linewidth=1.6, solid_joinstyle="miter", zorder=4)


def _draw_ring(ax: Axes, scene: Scene, ball: int, look: Look, position: Floats, width: float) -> None:
    centre = (float(position[0]), float(position[1]))
    circle = Circle(centre, scene.balls.radius[ball], fill=False, edgecolor=look.path, linewidth=width, zorder=5)
    ax.add_patch(circle)


def draw_ball(ax: Axes, radius: float, look: Look, position: ArrayLike, ghost: bool) -> None:
    """Draws a ball at a position (2,), m; faint if it is a `ghost`."""
    x, y = np.asarray(position).tolist()
    centre = x, y
    if ghost:
        ax.add_patch(Circle(centre, radius, facecolor=CLOTH, edgecolor="none", zorder=5))
        ax.add_patch(Circle(centre, radius, facecolor=look.fill, alpha=0.35, edgecolor="none", zorder=5.1))
        dashes = {"edgecolor": look.path, "linewidth": 1, "linestyle": (0, (2, 1.5))}
        ax.add_patch(Circle(centre, radius, facecolor="none", zorder=6, **dashes))
    else:
        disc = Circle(centre, radius, facecolor=CHALK if look.striped else look.fill, edgecolor="none", zorder=8)
        ax.add_patch(disc)
        if look.striped:
            low, size = (centre[0] - radius, centre[1] - 0.56 * radius), (2 * radius, 1.12 * radius)
            band = Rectangle(low, *size, facecolor=look.fill, edgecolor="none", zorder=8.1)
            ax.add_patch(band)
            band.set_clip_path(disc)
        ax.add_patch(Circle(centre, radius, facecolor="none", edgecolor=CHALK, linewidth=0.8, zorder=8.2))
    size = 8 if len(look.number) < 2 else 6.5
    colour = CHALK if ghost else look.ink
    ax.text(
        *centre, look.number, fontsize=size, color=colour, ha="center", va="center_baseline", zorder=9, clip_on=True
    )


def _draw_events(ax: Axes, recording: Recording, look: tuple[Look, ...]) -> None:
    """Draws the marks, and their times where they do not overlap."""
    scene, labelled = recording.scene, []
    label_height = 0.03 * scene.table.length
    for event in recording.events:
        kind, ball, other, time = event["kind"], int(event["ball"]), int(event["other"]), float(event["time"])
        if kind not in MARKS or (kind in ("ball_ball", "cushion") and event["speed"] < WEAK):
            continue
        point = np.array([event["x"], event["y"]])
        edge, fill = INK, look[ball].path
        if kind == "ball_ball":
            first, second = (recording.path(k, [time])[0] for k in (ball, other))
            share = scene.balls.radius[ball] / (scene.balls.radius[ball] + scene.balls.radius[other])
            point = first + share * (second - first)
            fill = CHALK
            for k, centre in ((ball, first), (other, second)):  # only balls that have moved
                if (centre != recording.path(k, [0.0])[0]).any():
                    _draw_ring(ax, scene, k, look[k], centre, 0.8)
        elif kind == "pocket":
            pocket = scene.table.pockets[other]
            point, edge = np.array([pocket.x, pocket.y]), CHALK
        elif kind == "sliding_rolling":
            fill = CHALK
        marker, size, _ = MARKS[kind]
        ax.plot(*point, marker, markersize=size, color=fill, markeredgecolor=edge, markeredgewidth=0.7, zorder=7)
        overlaps = any(abs(x - point[0]) < 2 * label_height and abs(y - point[1]) < label_height for x, y in labelled)
        if kind != "sliding_rolling" and not overlaps:
            labelled.append(point.tolist())
            _label(ax, kind, scene, point, f"{time:.2f} s")


def _label(ax: Axes, kind: str, scene: Scene, point: Floats, text: str) -> None:
    """Writes an event's time on the rail, in the pocket, or next to two balls, towards the centre of the table."""
    style: dict[str, Any] = {"textcoords": "offset points", "fontsize": 6.5, "zorder": 10}
    if kind == "ball_ball":
        x, y = np.where(point > 0, -1, 1).tolist()
        ground, style["color"], style["xytext"] = CLOTH, CHALK, (8 * x, 8 * y)
        style |= {"ha": "left" if x > 0 else "right", "va": "bottom" if y > 0 else "top"}
    elif kind == "cushion":
        across = np.array([scene.table.length, scene.table.width]) / 2 - abs(point)
        x, y = (np.sign(point) * (across == across.min())).astype(int).tolist()
        ground, style["color"], style["xytext"] = RAIL, CHALK, (20 * x, 20 * y)
        style |= {"ha": "center", "va": "center", "rotation": 90 * abs(x)}
    else:
        ground, style["color"], style["xytext"] = POCKET, CHALK, (0, -4)
        style |= {"ha": "center", "va": "top"}
    style["bbox"] = {"facecolor": ground, "edgecolor": "none", "pad": 0.6}
    ax.annotate(text, point.tolist(), **style)
