"""Pictures of a recorded shot, of the named tables and of maps of strikes: `python -m benchmarks.figures`."""

from __future__ import annotations

import argparse
import dataclasses
import io
import math
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from PIL import Image  # a dependency of matplotlib

from billiards_env import layouts
from billiards_env.drawing.plot import draw_ball, legend_handles
from billiards_env.drawing.style import INK, draw_table, looks, rail_width
from billiards_env.files import write_whole
from billiards_env.scene import Scene
from billiards_env.shot import ShotResult
from billiards_env.simulation import simulate
from billiards_env.strike_map import strike_map
from billiards_env.table import TABLES, Table

IMAGES = Path(__file__).resolve().parent.parent / "docs" / "images"

SHOT = {"seed": 140, "degrees": 197.0, "speed": 2.8}
"""A random shot with a combination, a bank and two potted balls."""


def picture(shot: ShotResult, title: str) -> Figure:
    """Returns a figure of a recorded shot."""
    figure = Figure(figsize=(9, 5.35), dpi=120, facecolor="white")
    shot.plot(figure.add_axes((0.01, 0.06, 0.98, 0.88)))
    figure.text(0.5, 0.965, title, fontsize=11.5, color=INK, ha="center", va="center")
    place = {"loc": "upper center", "bbox_to_anchor": (0.5, 0.062), "handletextpad": 0.3, "columnspacing": 1.6}
    figure.legend(handles=legend_handles(), ncols=7, frameon=False, fontsize=8, **place)
    return figure


def shot_of(scene: Scene, seed: int, degrees: float, speed: float) -> ShotResult:
    """Returns a recorded shot from a random layout."""
    positions = layouts.draw("random", scene, np.random.default_rng(seed))
    angle = math.radians(degrees)
    return simulate(scene, positions, [speed * math.cos(angle), speed * math.sin(angle)], record=True)


GAMES = {
    "snooker_12ft": ("snooker", 21, "snooker"),
    "carom_10ft": ("real_carom", 2, "carom_opening"),
    "uk_7ft": ("uk_pool", 15, "tight_rack"),
}
"""The scene whose balls lie on a table, their number and their layout; pool on the others."""


def tables() -> Figure:
    """Returns a figure of all named tables at the same scale, the largest first."""
    figure = Figure(figsize=(9, 7.3), dpi=120, facecolor="white")
    ax = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    names = sorted(TABLES, key=lambda name: -Table.named(name).length)
    middle, top = (0.0, 3.95), 0.0
    for left, right in (names[:2], names[2:4], names[4:]):
        height = Table.named(left).width / 2 + rail_width(Table.named(left))
        for name, x in zip((left, right), middle, strict=True):
            _draw_named_table(ax, name, np.array([x, top - height]))
            ax.text(x, top + 0.06, name, fontsize=10, color=INK, ha="center", va="bottom")
        top -= 2 * height + 0.36
    ax.set_xlim(-2.1, 5.7)
    ax.set_ylim(top + 0.2, 0.32)
    ax.set_aspect("equal")
    ax.axis("off")
    return figure


def _draw_named_table(ax: Axes, name: str, centre: np.ndarray) -> None:
    """Draws a named table with the balls of its game, with its centre at a point (2,), m."""
    game, count, layout = GAMES.get(name, ("real_pool", 15, "tight_rack"))
    scene = dataclasses.replace(Scene.named(game, count), table=Table.named(name))
    for corners, colour in draw_table(scene.table):
        ax.add_patch(Polygon(corners + centre, facecolor=colour, edgecolor="none"))
    positions = layouts.draw(layout, scene, np.random.default_rng(0))
    for radius, look, position in zip(scene.balls.radius, looks(scene), positions, strict=True):
        draw_ball(ax, radius, look._replace(number=""), position + centre, ghost=False)


def maps() -> Figure:
    """Returns a figure of the two maps of strikes of docs/simulate.md."""
    scene, places, heading = Scene.named("real_pool"), [[0.0, 0.0], [0.6, 0.33]], math.atan2(0.33, 0.6)
    figure = Figure(figsize=(10, 4.6), dpi=110, facecolor="white", layout="constrained")
    left, right = figure.subplots(1, 2)
    tip = np.linspace(-0.6, 0.6, 317)
    strike_map(scene, places, {"side": tip, "top": tip}, heading=heading + 0.015, speed=1.6).plot(left)
    headings, speeds = heading + np.linspace(-0.06, 0.12, 400), np.linspace(0.5, 6.0, 250)
    strike_map(scene, places, {"heading": headings, "speed": speeds}, side=0.3).plot(right)
    return figure


def save(figure: Figure, path: Path) -> None:
    """Writes a figure as PNG, completely or not at all.

    The file has no date, so equal figures give equal files. A palette of 256 colours reduces the size to a third.
    """
    buffer, small = io.BytesIO(), io.BytesIO()
    figure.savefig(buffer, format="png", metadata={"Software": None})
    Image.open(buffer).convert("RGB").quantize(256, dither=Image.Dither.NONE).save(small, format="png", optimize=True)
    write_whole(path, small.getvalue())


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m benchmarks.figures --help`."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.figures",
        description="Draw the pictures of a shot, of the tables and of maps of strikes.",
    )
    parser.add_argument("--folder", type=Path, default=IMAGES, help="output folder (default: docs/images)")
    args = parser.parse_args(arguments)
    matplotlib.rcParams["font.family"] = "DejaVu Sans"  # part of matplotlib, the same on every machine
    scene = Scene.named("pool", 4)
    shot = shot_of(scene, **SHOT)
    title = f"One action, one shot: {shot.n_events} events in {shot.time:.1f} s. Ball 2 pots ball 3 and is then potted"
    for name, figure in (("shot.png", picture(shot, title)), ("tables.png", tables()), ("strike_map.png", maps())):
        save(figure, args.folder / name)
        print(f"Written to {args.folder / name}.")


if __name__ == "__main__":
    main()
