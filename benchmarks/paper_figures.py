"""The eight figures of Warkari and Jamsandekar, from simulated shots: `python -m benchmarks.paper_figures`.

The paper is N. Warkari and M. Jamsandekar, "Evaluation of Collision Handling Techniques in 2D collisions" (Georgia
Institute of Technology).

Each failure of `billiards_env.failures` has a row, with PIT on the left and PIC on the right, to scale. The paper
numbers its figures 1 to 8, with PIC first from the third pair. Colours and marks are those of `benchmarks.figures`.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib
import numpy as np
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, FancyArrowPatch, Rectangle
from numpy.typing import NDArray

from benchmarks.figures import IMAGES, save
from billiards_env.drawing.plot import MARKS
from billiards_env.drawing.style import CHALK, INK
from billiards_env.failures import FAILURES, Failure
from billiards_env.shot import ShotResult
from billiards_env.simulation import simulate

Floats = NDArray[np.float64]

COLOURS, FIXED, OVERLAP, QUIET = ("#0072b2", "#e69f00"), "#8c8c8c", "#d55e00", "#555555"
CLOTH, CUSHION = "#dfe9e2", "#a9c4b1"  # lighter than in pictures of shots, for dark lines
ARROW = 0.02  # s; the length of an arrow is the distance in this time
# In inches: the width of the picture, the size of a panel, the gaps at the sides and between the columns, the heights
# of the column heads, of a panel's title and of the legend.
WIDTH, PANEL, SIDE, GAP, HEAD, TITLE, LEGEND = 9.0, (4.34, 2.4), 0.09, 0.14, 0.34, 0.52, 0.55


class View(NamedTuple):
    """The view of a failure: figure numbers in the paper (PIT, PIC), centre and height of the view (m), timesteps."""

    numbers: tuple[int, int]
    x: float
    y: float
    height: float
    frames: tuple[int, int]


VIEWS = {
    "missed_collision": View((1, 2), 0.02, 0.018, 0.62, (1, 4)),
    "penetration": View((3, 4), -0.045, 0.018, 0.36, (2, 7)),
    "multiple_collisions": View((6, 5), 0.80, 0.005, 0.272, (3, 8)),
    "wrong_bounce": View((8, 7), -0.045, -0.09, 0.36, (2, 7)),
}


def run(case: Failure) -> tuple[ShotResult, ShotResult]:
    """Returns the recorded shots of PIT and of PIC."""
    start = case.scene, case.positions, case.velocities
    return simulate(*start, mode="pit", dt=case.dt, record=True), simulate(*start, record=True)


def nearest(case: Failure) -> float:
    """Returns the time at which the balls would be closest without a collision, s."""
    apart, closing = np.diff(case.positions, axis=0)[0], np.diff(case.velocities, axis=0)[0]
    return float(-apart @ closing / (closing @ closing))


def captions(name: str, pit: ShotResult, pic: ShotResult) -> tuple[str, str]:
    """Returns the captions of PIT and PIC with the times and angles of the shots."""
    assert pit.events is not None
    assert pic.events is not None
    dt, found, true = FAILURES[name].dt, pit.events["time"], pic.events["time"]
    if name == "missed_collision":
        k = math.floor(nearest(FAILURES[name]) / dt)
        return (
            f"The balls overlap only between frames {k} and {k + 1}: both go straight on",
            f"They touch at {true[0]:.3f} s, and each leaves in the other's direction",
        )
    frame = f"Frame {round(found[0] / dt)}, at {found[0]:.3f} s"
    if name == "multiple_collisions":
        return (
            f"{frame}, finds one of two hits: ball 1 comes back",
            f"Hits at {true[0]:.3f} s, {true[1]:.3f} s (cushion) and {true[2]:.3f} s: ball 0 comes back",
        )
    a, b = pit.velocities[0], pic.velocities[0]
    wrong = math.degrees(abs(math.atan2(a[0] * b[1] - a[1] * b[0], a @ b)))
    late = f"{frame}, is {1000 * (found[0] - true[0]):.1f} ms late:"
    touch = f"They touch at {true[0]:.4f} s"
    if name == "penetration":
        return f"{late} both balls leave {wrong:.1f}° wrong", f"{touch} and leave at a right angle"
    return f"{late} ball 0 leaves {wrong:.1f}° wrong", f"{touch}, and ball 0 bounces back"


def before(shot: ShotResult, t: float) -> Floats:
    """Returns the positions (2, 2) at time t, m, before a fix moves the balls."""
    return shot.at(float(np.nextafter(t, 0.0)))


def colour(case: Failure, ball: int) -> str:
    return FIXED if math.isinf(case.scene.balls.mass[ball]) else COLOURS[ball]


def circle(axes: Axes, case: Failure, ball: int, place: Floats, **style: Any) -> Circle:
    """Adds the outline or the disk of a ball."""
    patch = Circle((float(place[0]), float(place[1])), case.scene.balls.radius[ball], **style)
    axes.add_patch(patch)
    return patch


def draw_ball(axes: Axes, case: Failure, ball: int, place: Floats, alpha: float, label: str) -> None:
    """Draws a ball at a timestep; earlier ones are fainter."""
    shade = colour(case, ball)
    circle(axes, case, ball, place, facecolor=CLOTH, edgecolor="none", zorder=3)
    circle(axes, case, ball, place, facecolor=shade, alpha=alpha, edgecolor="none", zorder=3)
    circle(axes, case, ball, place, fill=False, edgecolor=shade, linewidth=1.1, zorder=5)
    halo = patheffects.withStroke(linewidth=2.2, foreground=CHALK)
    style: dict[str, Any] = {"ha": "center", "va": "center_baseline", "zorder": 9, "path_effects": [halo]}
    axes.text(float(place[0]), float(place[1]), label, fontsize=8, color=INK, **style)


def draw_velocity(axes: Axes, case: Failure, ball: int, place: Floats, velocity: Floats, after: bool) -> None:
    """Draws a velocity as an arrow from the edge of a ball, or to the edge if it is the velocity before the impacts."""
    speed = math.hypot(*velocity)
    if speed == 0.0:
        return
    edge = place + (1 if after else -1) * case.scene.balls.radius[ball] * velocity / speed
    tail, tip = (edge, edge + ARROW * velocity) if after else (edge - ARROW * velocity, edge)
    style: dict[str, Any] = {"arrowstyle": "-|>", "mutation_scale": 9, "shrinkA": 0, "shrinkB": 0, "linewidth": 1.4}
    axes.add_patch(FancyArrowPatch(tuple(tail), tuple(tip), color=INK, zorder=7, **style))


def draw_contact(axes: Axes, case: Failure, both: Floats, outlines: bool) -> None:
    """Draws two touching or overlapping balls: dashed outlines, overlap, line of centres, point of contact."""
    r, s = case.scene.balls.radius
    apart = both[1] - both[0]
    distance = math.hypot(*apart)
    for ball in range(2 if outlines else 0):
        dashes: dict[str, Any] = {"linestyle": (0, (2, 1.3)), "linewidth": 1.1, "zorder": 6}
        circle(axes, case, ball, both[ball], fill=False, edgecolor=colour(case, ball), **dashes)
    if distance < r + s - 1e-9:
        overlap = circle(axes, case, 0, both[0], facecolor=OVERLAP, alpha=0.85, edgecolor="none", zorder=6)
        overlap.set_clip_path(circle(axes, case, 1, both[1], fill=False, edgecolor="none"))
    if distance > 1e-9:
        along = apart / distance
        ends = np.array([both[0] - 1.5 * r * along, both[1] + 1.5 * s * along])
        axes.plot(*ends.T, color=INK, linewidth=0.9, linestyle=(0, (5, 1.5, 1, 1.5)), zorder=6)
        if distance > r + s - 1e-9:
            draw_mark(axes, "ball_ball", both[0] + r * along)


def draw_mark(axes: Axes, kind: str, place: Floats) -> None:
    marker, size, _ = MARKS[kind]
    edge = CHALK if kind == "ball_ball" else INK
    axes.plot(*place, marker, markersize=size, color=INK, markeredgecolor=edge, markeredgewidth=0.7, zorder=8)


def draw_panel(axes: Axes, case: Failure, shot: ShotResult, view: View, exact: bool) -> None:
    """Draws one figure of the paper."""
    assert shot.events is not None
    half_x, half_y = view.height * PANEL[0] / PANEL[1] / 2, view.height / 2
    left, bottom = view.x - half_x, view.y - half_y
    wall = case.scene.table.length / 2
    axes.add_patch(Rectangle((left, bottom), 2 * half_x, 2 * half_y, facecolor=CLOTH, zorder=0))
    axes.add_patch(Rectangle((wall, bottom), 1.0, 2 * half_y, facecolor=CUSHION, zorder=1))
    first, last = view.frames
    begin, end = first * case.dt, last * case.dt
    # Paths, interrupted where a fix moves a ball.
    times = shot.events["time"].tolist()
    for start, stop in zip([begin, *times], [*times, end], strict=True):
        pieces = np.array([shot.at(start), before(shot, stop)])
        for ball in range(2):
            axes.plot(*pieces[:, ball].T, color=colour(case, ball), linewidth=1.4, zorder=4)
    for k in range(first, last + 1):
        now, then = before(shot, k * case.dt), before(shot, (k + 1) * case.dt)
        for ball in range(2):
            moved = (now[ball] != case.positions[ball]).any()
            at_rest = (now[ball] == then[ball]).all()
            if moved or k == last or not at_rest:  # a ball that never moves is drawn once
                alpha = 0.12 + 0.7 * (k - first) / (last - first)
                draw_ball(axes, case, ball, now[ball], alpha, str(k) if moved else "")
    for ball in range(2):
        draw_velocity(axes, case, ball, before(shot, begin)[ball], np.array(case.velocities[ball]), after=False)
        draw_velocity(axes, case, ball, before(shot, end)[ball], shot.velocities[ball], after=True)
    for k, event in enumerate(shot.events):
        if event["kind"] == "ball_ball":  # PIT's contacts are at timesteps, where the outlines are already drawn
            draw_contact(axes, case, before(shot, times[k]), outlines=exact and k == 0)
        elif exact:
            draw_mark(axes, "cushion", np.array([wall, event["y"]]))
    if not times:
        draw_contact(axes, case, shot.at(nearest(case)), outlines=True)
    axes.set_xlim(left, left + 2 * half_x)
    axes.set_ylim(bottom, bottom + 2 * half_y)
    axes.set_aspect("equal")
    axes.axis("off")


def legend(figure: Figure, dt: float) -> None:
    """Draws the legend in two rows at the bottom."""
    none: dict[str, Any] = {"linestyle": "none"}
    ball: dict[str, Any] = {**none, "marker": "o", "markersize": 9}
    star, square = MARKS["ball_ball"], MARKS["cushion"]
    arrow: dict[str, Any] = {**none, "marker": r"$\rightarrow$", "markersize": 13}
    lines: dict[str, Any] = {"color": INK, "linewidth": 0.9, "linestyle": (0, (5, 1.5, 1, 1.5))}
    digit: dict[str, Any] = {**none, "marker": "$3$", "markersize": 6}
    handles = [
        Line2D([], [], color=COLOURS[0], label="ball 0", **ball),
        Line2D([], [], color=COLOURS[1], label="ball 1", **ball),
        Line2D([], [], color=FIXED, label="ball 1, infinite mass", **ball),
        Line2D([], [], color=INK, label=f"frame number, {1000 * dt:.0f} ms apart", **digit),
        Line2D([], [], color=INK, label=f"velocity: path in {1000 * ARROW:.0f} ms", **arrow),
        Line2D([], [], color=INK, marker=star[0], markersize=star[1], label=star[2], **none),
        Line2D([], [], color=INK, marker=square[0], markersize=square[1], label=square[2], **none),
        Line2D([], [], color=OVERLAP, marker="s", markersize=9, label="overlap", **none),
        Line2D([], [], label="line of centres", **lines),
        Line2D([], [], color=COLOURS[0], linestyle=(0, (2, 1.3)), linewidth=1.1, label="between two frames"),
    ]
    style: dict[str, Any] = {"frameon": False, "fontsize": 8.5, "handletextpad": 0.4, "columnspacing": 1.6}
    height = figure.get_figheight()
    for row, top in ((handles[:5], LEGEND - 0.02), (handles[5:], LEGEND / 2)):
        figure.legend(handles=row, loc="upper center", bbox_to_anchor=(0.5, top / height), ncols=len(row), **style)


def picture() -> Figure:
    """Returns a figure with all eight figures of the paper."""
    height = HEAD + len(VIEWS) * (TITLE + PANEL[1]) + LEGEND
    figure = Figure(figsize=(WIDTH, height), dpi=120, facecolor="white")
    lefts = SIDE, SIDE + PANEL[0] + GAP
    [dt] = {case.dt for case in FAILURES.values()}
    heads = f"PIT: tests for overlaps {round(1 / dt)} times per second", "PIC: computes the instant of each hit"
    for left, head in zip(lefts, heads, strict=True):
        centre = (left + PANEL[0] / 2) / WIDTH
        figure.text(centre, 1 - 0.2 / height, head, fontsize=11.5, color=INK, ha="center", va="center")
    top = height - HEAD
    for name, view in VIEWS.items():
        case = FAILURES[name]
        shots = run(case)
        top -= TITLE
        for column, (left, shot, caption) in enumerate(zip(lefts, shots, captions(name, *shots), strict=True)):
            axes = figure.add_axes((left / WIDTH, (top - PANEL[1]) / height, PANEL[0] / WIDTH, PANEL[1] / height))
            draw_panel(axes, case, shot, view, exact=column == 1)
            number, title = f"Fig. {view.numbers[column]}", f"{case.title}, {('PIT', 'PIC')[column]}"
            style: dict[str, Any] = {"fontsize": 10, "color": INK, "va": "baseline"}
            figure.text(left / WIDTH, (top + 0.24) / height, number, weight="bold", **style)
            figure.text((left + 0.52) / WIDTH, (top + 0.24) / height, title, **style)
            figure.text(left / WIDTH, (top + 0.07) / height, caption, fontsize=8.5, color=QUIET, va="baseline")
        top -= PANEL[1]
    legend(figure, dt)
    return figure


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m benchmarks.paper_figures --help`."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.paper_figures",
        description="Draw the figures of Warkari and Jamsandekar, "
        "'Evaluation of Collision Handling Techniques in 2D collisions'.",
    )
    parser.add_argument("--folder", type=Path, default=IMAGES, help="output folder (default: docs/images)")
    args = parser.parse_args(arguments)
    matplotlib.rcParams["font.family"] = "DejaVu Sans"  # part of matplotlib, the same on every machine
    save(picture(), args.folder / "failures.png")
    print(f"Written to {args.folder / 'failures.png'}.")


if __name__ == "__main__":
    main()
