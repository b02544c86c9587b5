"""A picture of the game window and a film of a shot: `python -m benchmarks.game_figures`.

The window receives keyboard and mouse events on a dummy display.
"""

from __future__ import annotations

import argparse
import io
import os
from pathlib import Path

import numpy as np
from PIL import Image

os.environ.setdefault("SDL_VIDEODRIVER", "dummy")

from benchmarks.figures import IMAGES, SHOT, shot_of
from billiards_env.drawing.canvas import pixels, pygame
from billiards_env.drawing.style import ARROW, ARROW_START
from billiards_env.files import write_whole
from billiards_env.games import History, Setup, opening
from billiards_env.play.model import HUMAN, SetTip, begin, update
from billiards_env.play.window import GameWindow
from billiards_env.players.game_player import find_player
from billiards_env.scene import Scene
from billiards_env.simulation import simulate

SEED = 3
WIDTH = 1080
ENGLISH = -0.25, 0.2


def window() -> GameWindow:
    """Returns a window with a nine ball game after the break; the mouse aims the shot of the geometric player."""
    rng = np.random.default_rng(SEED)
    setup = Setup("nine_ball", Scene.named("real_pool", 9))
    model = begin(History(setup, opening(setup, rng), ()), (HUMAN, HUMAN), 8.0, 1 / 60)
    shown = GameWindow(model, (None, None), rng, Path("game.json"), WIDTH)
    for _ in range(3):  # places the cue ball, shoots and skips to the end of the break
        press(shown, pygame.K_SPACE)
    model = shown.model
    velocity = np.array(find_player("geometric", setup)(setup, model.game, 3.0, rng).velocity)
    cue, speed = np.array(model.cue_position), float(np.hypot(*velocity))
    drag(shown, cue, cue + velocity * (ARROW + ARROW_START * setup.scene.balls.radius[0] / speed))
    shown.model = update(shown.model, SetTip(*ENGLISH))
    return shown


def press(shown: GameWindow, key: int) -> None:
    """Presses a key and shows a frame."""
    pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=key, mod=0))
    shown.frame()


def drag(shown: GameWindow, start: np.ndarray, end: np.ndarray) -> None:
    """Drags the mouse from one point, m, to another."""
    (x0, y0), (x1, y1) = (np.round(shown.pixels_of(point)).astype(int).tolist() for point in (start, end))
    for kind, more in (
        (pygame.MOUSEBUTTONDOWN, {"pos": (x0, y0), "button": 1}),
        (pygame.MOUSEMOTION, {"pos": (x1, y1), "rel": (x1 - x0, y1 - y0), "buttons": (1, 0, 0)}),
        (pygame.MOUSEBUTTONUP, {"pos": (x1, y1), "button": 1}),
    ):
        pygame.event.post(pygame.event.Event(kind, more))
    shown.frame()


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m benchmarks.game_figures --help`."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.game_figures", description="Draw the window and a film for the README."
    )
    parser.add_argument("--folder", type=Path, default=IMAGES, help="output folder (default: docs/images)")
    args = parser.parse_args(arguments)
    shown = window()
    buffer = io.BytesIO()
    image = Image.fromarray(pixels(shown.frame()))
    image.quantize(256, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE).save(buffer, "png", optimize=True)
    shown.close()
    write_whole(args.folder / "play.png", buffer.getvalue())
    shot = shot_of(Scene.named("pool", 4), **SHOT)
    start = shot.at(0.0)
    velocity = shot.recording().trajectory.velocity[0]
    rough = simulate(Scene.named("pool", 4), start, velocity, mode="pit", dt=1 / 60, record=True)
    shot.to_gif(args.folder / "shot.gif", fps=25, width=640, compare=rough)
    for name in ("play.png", "shot.gif"):
        print(f"Written to {args.folder / name}: {(args.folder / name).stat().st_size / 1000:.0f} kB.")


if __name__ == "__main__":
    main()
