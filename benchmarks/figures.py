"""Pictures of recorded shots, drawn to scale: `python -m benchmarks.figures`.

The balls' colours are those of Okabe and Ito (2008), which colour-blind readers tell apart; every ball bears its number
and every kind of event has a mark of its own as well.
"""

from __future__ import annotations

import argparse
import io
import math
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, FancyBboxPatch, Rectangle
from PIL import Image  # comes with matplotlib

from agents.files import write_whole
from billiards_env import layouts
from billiards_env.engine import ShotResult, simulate
from billiards_env.scene import Scene

IMAGES = Path(__file__).resolve().parent.parent / "docs" / "images"

CLOTH, CUSHION, RAIL, POCKET = "#dfe9e2", "#a9c4b1", "#7a5c43", "#1c1c1c"
INK, CHALK = "#222222", "#ffffff"
BALLS = ("#ffffff", "#e69f00", "#0072b2", "#cc79a7", "#009e73", "#d55e00", "#56b4e9", "#f0e442")
PATHS = ("#555555", *BALLS[1:])
NUMBERS = ("#222222", "#222222", "#ffffff", "#222222", "#ffffff", "#ffffff", "#222222", "#222222")
MARKS = {
    "ball_ball": ("*", 11, "ball hits ball"),
    "cushion": ("s", 4.5, "ball hits cushion"),
    "roll": ("o", 3.5, "slides until here, then rolls"),
    "pocket": ("D", 5, "potted"),
}
RAIL_WIDTH, CUSHION_WIDTH = 0.1, 0.035  # m, drawn
SAMPLES = 1500  # points of a path

SHOT = {"seed": 140, "degrees": 197.0, "speed": 2.8}
"""Of many random shots the one that shows most: a combination, a bank, two balls potted."""


def draw_table(axes: Axes, scene: Scene) -> None:
    """Draws the cloth, the cushions and the pockets of a scene, in metres."""
    half_x, half_y = scene.table.length / 2, scene.table.width / 2
    for edge, colour, z in ((RAIL_WIDTH, RAIL, 0), (CUSHION_WIDTH, CUSHION, 1)):
        corner, size = (-half_x - edge, -half_y - edge), (2 * (half_x + edge), 2 * (half_y + edge))
        style = f"round,pad=0,rounding_size={0.06 if colour == RAIL else 0.0}"
        axes.add_patch(FancyBboxPatch(corner, *size, boxstyle=style, facecolor=colour, edgecolor="none", zorder=z))
    axes.add_patch(Rectangle((-half_x, -half_y), 2 * half_x, 2 * half_y, facecolor=CLOTH, edgecolor="none", zorder=2))
    for pocket in scene.table.pockets:
        axes.add_patch(Circle((pocket.x, pocket.y), pocket.radius, facecolor=POCKET, edgecolor="none", zorder=3))
    for k in range(1, 8):  # the diamonds on the rails
        if k != 4:
            x = -half_x + k * half_x / 4
            axes.plot([x, x], [-half_y - 0.068, half_y + 0.068], "D", color=CHALK, markersize=2.5, zorder=3)
    for k in (1, 2, 3):
        y = -half_y + k * half_y / 2
        axes.plot([-half_x - 0.068, half_x + 0.068], [y, y], "D", color=CHALK, markersize=2.5, zorder=3)
    axes.set_xlim(-half_x - RAIL_WIDTH - 0.01, half_x + RAIL_WIDTH + 0.01)
    axes.set_ylim(-half_y - RAIL_WIDTH - 0.01, half_y + RAIL_WIDTH + 0.01)
    axes.set_aspect("equal")
    axes.axis("off")


def draw_ball(axes: Axes, scene: Scene, ball: int, place: np.ndarray, ghost: bool) -> None:
    """Draws a ball to scale at place (2,), m: filled with its number, or as a dashed ghost."""
    centre, radius = (float(place[0]), float(place[1])), scene.balls.radius[ball]
    if ghost:
        axes.add_patch(Circle(centre, radius, facecolor=CLOTH, edgecolor="none", zorder=5))
        axes.add_patch(
            Circle(centre, radius, facecolor=BALLS[ball], alpha=0.35 if ball else 0.6, edgecolor="none", zorder=5.1)
        )
        axes.add_patch(
            Circle(
                centre, radius, facecolor="none", edgecolor=PATHS[ball], linewidth=1, linestyle=(0, (2, 1.5)), zorder=6
            )
        )
    else:
        axes.add_patch(Circle(centre, radius, facecolor=BALLS[ball], edgecolor=INK, linewidth=0.8, zorder=8))
    if ball:
        colour = INK if ghost else NUMBERS[ball]
        axes.text(*centre, str(ball), fontsize=8, color=colour, ha="center", va="center_baseline", zorder=9)


def draw_shot(axes: Axes, scene: Scene, shot: ShotResult) -> None:
    """Draws a recorded shot: ghosts at the start, paths, marks at the events, balls where they end."""
    assert shot.events is not None
    draw_table(axes, scene)
    # The corners of the paths are at events, so their instants are among the samples.
    times = np.union1d(np.linspace(0, shot.time, SAMPLES), shot.events["time"])
    places = np.array([shot.at(t) for t in times])
    for i in range(scene.n_balls):
        path = places[:, i]
        gone = shot.events["time"][(shot.events["kind"] == "pocket") & (shot.events["ball"] == i)]
        if len(gone):
            path = path[times < gone[0]]
        if np.ptp(path, axis=0).max() > 0:
            axes.plot(*path.T, color=PATHS[i], linewidth=1.6, solid_capstyle="round", solid_joinstyle="miter", zorder=4)
            draw_ball(axes, scene, i, path[0], ghost=True)
        if not shot.potted[i]:
            draw_ball(axes, scene, i, path[-1], ghost=False)
    for event in shot.events:
        if event["kind"] not in MARKS:
            continue
        marker, size, _ = MARKS[event["kind"]]
        x, y = event["x"], event["y"]
        edge, fill = INK, PATHS[event["ball"]]
        if event["kind"] == "ball_ball":  # the place is the first ball's centre
            i, j = event["ball"], event["other"]
            both = shot.at(float(event["time"]))
            share = scene.balls.radius[i] / (scene.balls.radius[i] + scene.balls.radius[j])
            x, y = both[i] + share * (both[j] - both[i])
            edge, fill = CHALK, INK
            for k in (i, j):  # a moving ball, as the two touch
                if (both[k] != places[0, k]).any():
                    centre, radius = (float(both[k, 0]), float(both[k, 1])), scene.balls.radius[k]
                    axes.add_patch(Circle(centre, radius, fill=False, edgecolor=PATHS[k], linewidth=0.8, zorder=5))
        elif event["kind"] == "pocket":
            edge = CHALK
        elif event["kind"] == "roll":
            fill = CHALK
        axes.plot(x, y, marker, markersize=size, color=fill, markeredgecolor=edge, markeredgewidth=0.7, zorder=7)


def legend(figure: Figure, top: float) -> None:
    """The marks' meanings, in one row under the table."""
    handles = [
        Line2D(
            [],
            [],
            marker="o",
            linestyle="none",
            markersize=9,
            color="#e9c98a",
            markeredgecolor="#c78a00",
            label="start",
        ),
        Line2D([], [], marker="o", linestyle="none", markersize=9, color=BALLS[1], markeredgecolor=INK, label="end"),
    ]
    for kind, (marker, size, label) in MARKS.items():
        fill = CHALK if kind == "roll" else INK if kind == "ball_ball" else "#888888"
        handles.append(
            Line2D(
                [], [], marker=marker, linestyle="none", markersize=size, color=fill, markeredgecolor=INK, label=label
            )
        )
    figure.legend(
        handles=handles,
        loc="upper center",
        bbox_to_anchor=(0.5, top),
        ncols=len(handles),
        frameon=False,
        fontsize=8.5,
        handletextpad=0.3,
        columnspacing=1.6,
    )


def picture(scene: Scene, shot: ShotResult, title: str) -> Figure:
    """A figure of a recorded shot."""
    figure = Figure(figsize=(9, 5.35), dpi=120, facecolor="white")
    axes = figure.add_axes((0.01, 0.06, 0.98, 0.88))
    draw_shot(axes, scene, shot)
    figure.text(0.5, 0.965, title, fontsize=11.5, color=INK, ha="center", va="center")
    legend(figure, 0.062)
    return figure


def shot_of(scene: Scene, seed: int, degrees: float, speed: float) -> ShotResult:
    """A recorded shot from a random layout."""
    positions = layouts.random(scene, np.random.default_rng(seed))
    angle = math.radians(degrees)
    return simulate(scene, positions, [speed * math.cos(angle), speed * math.sin(angle)], record=True)


def save(figure: Figure, path: Path, colours: int | None = None) -> None:
    """Writes a figure as PNG, whole or not at all; no date in it, so the same figure is the same file.

    With a palette of at most 256 `colours` the file is a third as large.
    """
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", metadata={"Software": None}, pil_kwargs={"optimize": True})
    if colours is not None:
        picture = Image.open(buffer).convert("RGB").quantize(colours, dither=Image.Dither.NONE)
        buffer = io.BytesIO()
        picture.save(buffer, format="png", optimize=True)
    write_whole(path, buffer.getvalue())


def main(arguments: list[str] | None = None) -> None:
    """The command line; see `python -m benchmarks.figures --help`."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.figures", description="Draw the pictures of the README."
    )
    parser.add_argument("--folder", type=Path, default=IMAGES, help="where they go (default: docs/images)")
    args = parser.parse_args(arguments)
    matplotlib.rcParams["font.family"] = "DejaVu Sans"  # comes with matplotlib: the same picture everywhere
    scene = Scene.named("pool", 4)
    shot = shot_of(scene, **SHOT)
    title = f"One action, one shot: {shot.n_events} events in {shot.time:.1f} s. Ball 2 pots ball 3, then drops itself"
    save(picture(scene, shot, title), args.folder / "shot.png")
    print(f"Written to {args.folder / 'shot.png'}.")


if __name__ == "__main__":
    main()
