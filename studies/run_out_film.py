"""Draws a film of a run-out of the planner, `docs/images/run_out.gif`: `python -m studies.run_out_film`.

The planner breaks a rack of nine ball and plays until it has won. The film shows its plan before each shot: the aim,
the paths of the cue ball and of the object ball, and the probability that the shot keeps the turn. Each stroke has
random errors. The command plays racks with the seeds 0, 1, ... until one of them is a run-out.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
import os
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from PIL import Image

os.environ.setdefault("SDL_VIDEODRIVER", "dummy")

from benchmarks import IMAGES
from billiards_env.drawing.canvas import pixels
from billiards_env.files import check_path, replacing
from billiards_env.games import History, Setup, opening
from billiards_env.play.model import Model, aim_like, begin, shoot, tick
from billiards_env.play.view import View
from billiards_env.players.levels import with_noise
from billiards_env.players.planner import Options, plan
from billiards_env.scene import Scene
from studies import errors_in_one_line, parser_of

FILE = IMAGES / "run_out.gif"
NOISE = (0.057, 0.02)
"""The errors of the strokes: degrees and m/s."""

SHOTS, MAX_SPEED = 3000, 8.0
"""Simulated shots of a decision, and the speed of the fastest shot, m/s."""

WIDTH, PACE, FRAME, SHOWN = 480, 3.0, 0.12, 1.5
"""The width of the film, pixels; the playback speed; and how long the film shows a frame and a plan, s."""


def run_out(seed: int, shots: int) -> list[tuple[Model, str]] | None:
    """Returns a model and a text for each plan, and for the end of the rack; None if the rack is not a run-out."""
    rng = np.random.default_rng(seed)
    setup = Setup("nine_ball", Scene.named("real_pool", 9))
    model, found = begin(History(setup, opening(setup, rng), ()), ("planner", "planner"), MAX_SPEED, 1 / 60, PACE), []
    while not model.game.state.over and model.game.state.player == 0:
        best = plan(setup, model.game, MAX_SPEED, rng, math.inf, shots, NOISE, Options(run_out=True))
        found.append((aim_like(model, best.stroke), f"keeps the turn with probability {best.probability:.2f}"))
        model = tick(shoot(model, with_noise(best.stroke, NOISE, MAX_SPEED, rng)), math.inf)
    return [*found, (model, "")] if model.game.state.winner == 0 else None


def frames(models: Sequence[tuple[Model, str]]) -> Iterator[tuple[Image.Image, float]]:
    """Yields the images of a film and their durations, s: each plan, and the shot that follows."""
    view = View(models[0][0].setup.scene, WIDTH)
    for (model, text), (following, _) in itertools.pairwise(models):
        yield Image.fromarray(pixels(view.draw(model, text))), SHOWN
        shown = dataclasses.replace(following, aim=model.aim, phase="rolling", preview=None, clock=0.0)
        while shown.phase == "rolling":
            yield Image.fromarray(pixels(view.draw(shown, text))), FRAME
            shown = tick(shown, FRAME)
    yield Image.fromarray(pixels(view.draw(models[-1][0]))), 2 * SHOWN


def write(path: Path, models: Sequence[tuple[Model, str]]) -> None:
    """Writes a film, .gif, completely or not at all."""
    target, images = check_path(path, ".gif"), list(frames(models))
    # All balls are in the first image. They have few pixels, and an octree keeps their colours.
    palette = images[0][0].quantize(96, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
    first, *others = (image.quantize(palette=palette, dither=Image.Dither.NONE) for image, _ in images)
    times = [round(1000 * seconds) for _, seconds in images]
    with replacing(target) as temporary:
        first.save(temporary, save_all=True, append_images=others, duration=times, loop=0, optimize=False)


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs the command line; see `python -m studies.run_out_film --help`."""
    options = {"output": (FILE, "the film, .gif"), "shots": (SHOTS, "simulated shots of a decision")}
    args = parser_of("run_out_film", "Draw a run-out of the planner.", **options).parse_args(arguments)
    with errors_in_one_line():
        seed, models = next((seed, found) for seed in itertools.count() if (found := run_out(seed, args.shots)))
        write(args.output, models)
    print(f"seed {seed}, {len(models) - 1} shots, {args.output.stat().st_size:,} bytes in {args.output}")


if __name__ == "__main__":
    main()
