"""Pictures of recorded shots, drawn to scale: `python -m benchmarks.figures`."""

from __future__ import annotations

import argparse
import io
import math
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from PIL import Image  # a dependency of matplotlib

from billiards_env import layouts
from billiards_env.drawing.plot import legend_handles
from billiards_env.drawing.style import INK
from billiards_env.files import write_whole
from billiards_env.scene import Scene
from billiards_env.shot import ShotResult
from billiards_env.simulation import simulate

IMAGES = Path(__file__).resolve().parent.parent / "docs" / "images"

SHOT = {"seed": 140, "degrees": 197.0, "speed": 2.8}
"""A random shot with a combination, a bank and two potted balls."""


def picture(shot: ShotResult, title: str) -> Figure:
    """Returns a figure of a recorded shot."""
    figure = Figure(figsize=(9, 5.35), dpi=120, facecolor="white")
    shot.plot(figure.add_axes((0.01, 0.06, 0.98, 0.88)))
    figure.text(0.5, 0.965, title, fontsize=11.5, color=INK, ha="center", va="center")
    place = {"loc": "upper center", "bbox_to_anchor": (0.5, 0.062), "handletextpad": 0.3, "columnspacing": 1.6}
    figure.legend(handles=legend_handles(), ncols=6, frameon=False, fontsize=8.5, **place)
    return figure


def shot_of(scene: Scene, seed: int, degrees: float, speed: float) -> ShotResult:
    """Returns a recorded shot from a random layout."""
    positions = layouts.draw("random", scene, np.random.default_rng(seed))
    angle = math.radians(degrees)
    return simulate(scene, positions, [speed * math.cos(angle), speed * math.sin(angle)], record=True)


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
        prog="python -m benchmarks.figures", description="Draw the pictures of the README."
    )
    parser.add_argument("--folder", type=Path, default=IMAGES, help="output folder (default: docs/images)")
    args = parser.parse_args(arguments)
    matplotlib.rcParams["font.family"] = "DejaVu Sans"  # part of matplotlib, the same on every machine
    scene = Scene.named("pool", 4)
    shot = shot_of(scene, **SHOT)
    title = f"One action, one shot: {shot.n_events} events in {shot.time:.1f} s. Ball 2 pots ball 3 and is then potted"
    save(picture(shot, title), args.folder / "shot.png")
    print(f"Written to {args.folder / 'shot.png'}.")


if __name__ == "__main__":
    main()
