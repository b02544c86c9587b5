"""The pictures of the documentation that show no measurement: `python -m studies.figures`.

They show a shot, the named tables, massé shots, the failures of a timestep, the window, and a film of a run-out of the
planner.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
import os
import textwrap
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from PIL import Image

os.environ.setdefault("SDL_VIDEODRIVER", "dummy")

from benchmarks import GREY, IMAGES, new_figure, parser_of, save, save_image
from billiards_env.drawing.canvas import pixels
from billiards_env.drawing.film import film_writer, write_film
from billiards_env.drawing.plot import draw_ball, draw_empty, legend_handles
from billiards_env.drawing.style import INK, looks
from billiards_env.engine import Engine
from billiards_env.engine.strikes import strike
from billiards_env.games import History, Setup, opening
from billiards_env.play import panel
from billiards_env.play.model import HUMAN, WindowModel, aim_like, begin, go, set_tip, shoot, tick
from billiards_env.play.view import View
from billiards_env.players.levels import with_noise
from billiards_env.players.named import find_player
from billiards_env.players.planner import Options, plan
from billiards_env.players.situation import game_situation
from billiards_env.scene import Balls, Cue, Scene, layouts
from billiards_env.scene.table import TABLES, Table
from billiards_env.shots.result import ShotResult
from billiards_env.shots.simulation import simulate
from studies.failures import FAILURES, Failure

WINDOW: dict[str, Any] = {"seed": 3, "width": 1080, "english": (-0.25, 0.2)}
"""The seed of the game in the window, the width in pixels, and the offset of the tip."""

SHOT = {"seed": 140, "degrees": 197.0, "speed": 2.8}
"""A random shot with a combination, a bank and two potted balls."""


def picture(shot: ShotResult, title: str) -> Figure:
    """Returns a figure of a recorded shot."""
    figure = new_figure(9, 5.35, dpi=120, facecolor="none", layout=None)
    shot.plot(figure.add_axes((0.01, 0.06, 0.98, 0.88)))
    figure.text(0.5, 0.965, title, fontsize=11.5, ha="center", va="center")
    place = {"loc": "upper center", "bbox_to_anchor": (0.5, 0.062), "handletextpad": 0.3, "columnspacing": 1.6}
    figure.legend(handles=legend_handles(), ncols=7, frameon=False, fontsize=8, **place)
    return figure


def random_shot(scene: Scene, seed: int, degrees: float, speed: float) -> ShotResult:
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
    """Returns a figure of all named tables at the same scale, the largest first, with the balls of their games."""
    names = sorted(TABLES, key=lambda name: -Table.named(name).length)
    rows = math.ceil(len(names) / 2)
    figure = new_figure(9, 2.7 * rows, dpi=120, facecolor="none")
    for k, name in enumerate(names):
        ax = figure.add_subplot(rows, 2, k + 1, title=name)
        game, count, layout = GAMES.get(name, ("real_pool", 15, "tight_rack"))
        scene = dataclasses.replace(Scene.named(game, count), table=Table.named(name))
        draw_empty(ax, scene.table)
        ax.set(xlim=(-2.0, 2.0), ylim=(-1.1, 1.1))
        positions = layouts.draw(layout, scene, np.random.default_rng(0))
        for radius, look, position in zip(scene.balls.radius, looks(scene), positions, strict=True):
            draw_ball(ax, radius, look._replace(number=""), position, ghost=False)
    return figure


MASSE = {"speed": 3.0, "heading": 0.0, "side": 0.3, "top": -0.2}
"""The parameters of `strike` in the picture of massé shots, except for the elevation."""

ELEVATIONS = {20: "#0072b2", 40: "#009e73", 55: "#d55e00", 70: "#aa4499"}
"""Degrees. The elevations of the massé shots, with their colours."""


def masse() -> Figure:
    """Returns a figure of massé shots without squirt, with the final directions by the construction of Coriolis."""
    scene = Scene(Balls.uniform(1), Table(length=20.0, width=20.0), cue=Cue(end_mass=1e-8))
    reach = 1.6  # m; the paths end at this distance from their start
    figure = new_figure(9, 7)
    ax = figure.add_subplot(aspect="equal", xlim=(-0.1, 1.72), ylim=(-0.1, 1.45), xlabel="x, m", ylabel="y, m")
    for degrees, colour in ELEVATIONS.items():
        shot = simulate(scene, [[0.0, 0.0]], strike(scene, **MASSE, elevation=math.radians(degrees)), record=True)
        assert shot.events is not None
        end = shot.events[shot.events["kind"] == "sliding_rolling"]["time"][0]
        path = np.array([shot.at(t)[0] for t in np.linspace(0.0, shot.time, 2000)])
        ax.plot(*path[np.hypot(*path.T) < reach].T, color=colour, linewidth=2.2, label=f"{degrees}°")
        ax.plot(*shot.at(end)[0], "o", color="white", markeredgecolor=colour, markeredgewidth=1.6, zorder=4)
        x, y = 0.7 * reach * _coriolis(degrees)
        ax.plot((0.0, x), (0.0, y), "--", color=colour, linewidth=1.1)
    ax.add_patch(Circle((0.0, 0.0), scene.balls.radius[0], facecolor="white", edgecolor=INK, zorder=5))
    ax.plot([], [], "o", color="white", markeredgecolor=INK, label="end of the slide")
    ax.plot([], [], "--", color=INK, label="construction of Coriolis")
    ax.legend(loc="upper right", frameon=False, fontsize=10.5, title="elevation of the cue")
    ax.spines[["top", "right"]].set_visible(False)
    return figure


def _coriolis(degrees: float) -> np.ndarray:
    """Returns the unit vector (2,) from the resting point of a ball to the point where the cue's axis meets the cloth.

    The heading of the cue is 0.
    """
    s, c = math.sin(math.radians(degrees)), math.cos(math.radians(degrees))
    side, top = MASSE["side"], MASSE["top"]
    ahead = top * s + c * (1.0 + top * c) / s  # ball radii; the axis falls from 1 + top * c to the cloth
    return np.array((ahead, side)) / math.hypot(ahead, side)


VIEWS: dict[str, tuple[tuple[float, float], float, tuple[int, int]]] = {
    "missed_collision": ((0.02, 0.018), 0.31, (1, 4)),
    "penetration": ((-0.045, 0.018), 0.18, (2, 7)),
    "multiple_collisions": ((0.80, 0.005), 0.14, (3, 8)),
    "wrong_bounce": ((-0.045, -0.09), 0.18, (2, 7)),
}
"""For each failure of `studies.failures`: the centre and half the height of the view, m, and the first and the last
timestep."""


def failures() -> Figure:
    """Returns a figure of the failures of a timestep: PIT on the left, PIC on the right, to scale."""
    figure = new_figure(9, 11)
    for row, (name, (centre, half, ends)) in zip(figure.subplots(len(VIEWS), 2), VIEWS.items(), strict=True):
        case = FAILURES[name]
        start = case.scene, case.positions, case.velocities
        stepped = simulate(*start, engine=Engine("pit", case.dt), record=True)
        for ax, shot, engine in zip(row, (stepped, simulate(*start, record=True)), ("PIT", "PIC"), strict=True):
            _draw_failure(ax, case, shot, centre, half, ends)
            ax.set_title(f"{case.title}, {engine}", fontsize=12, color=INK, loc="left")
        row[0].set_xlabel(textwrap.fill(case.text, 54), fontsize=9.5, color=INK, loc="left")
    return figure


def _draw_failure(
    ax: Axes, case: Failure, shot: ShotResult, centre: tuple[float, float], half: float, ends: tuple[int, int]
) -> None:
    """Draws the balls at each timestep, later ones darker, their paths, and the positions at contacts, dashed."""
    assert shot.events is not None
    first, last = ends
    times = np.unique(shot.events["time"]).tolist()
    moments = np.sort([*np.linspace(first * case.dt, last * case.dt, 200), *times])
    for ball, (radius, mass, colour) in enumerate(
        zip(case.scene.balls.radius, case.scene.balls.mass, ("#0072b2", "#e69f00"), strict=True)
    ):
        shade = colour if math.isfinite(mass) else "#8c8c8c"
        for k in range(first, last + 1):
            alpha = 0.12 + 0.7 * (k - first) / (last - first)
            # The position before a fix moves the ball.
            place = shot.at(float(np.nextafter(k * case.dt, 0.0)))[ball]
            ax.add_patch(Circle(tuple(place), radius, facecolor=shade, alpha=alpha, edgecolor=INK, linewidth=0.6))
        for t in times:
            place = shot.at(float(np.nextafter(t, 0.0)))[ball]
            ax.add_patch(Circle(tuple(place), radius, fill=False, edgecolor=shade, linestyle="--", zorder=3))
        ax.plot(*np.array([shot.at(t)[ball] for t in moments]).T, color=shade, linewidth=1.3, zorder=2)
    ax.axvline(case.scene.table.length / 2, color="#5b8468", linewidth=3)
    ax.set_xlim(centre[0] - 1.8 * half, centre[0] + 1.8 * half)
    ax.set_ylim(centre[1] - half, centre[1] + half)
    ax.set_aspect("equal")
    ax.set_xticks([])
    ax.set_yticks([])
    ax.set_facecolor("#dfe9e2")


def window() -> WindowModel:
    """Returns a nine ball game after the break: the aim is that of the geometric player, with an offset of the tip."""
    rng = np.random.default_rng(WINDOW["seed"])
    setup = Setup("nine_ball", Scene.named("real_pool", 9))
    model = begin(History(setup, opening(setup, rng), ()), (HUMAN, HUMAN), 8.0, 1 / 60)
    model = go(go(go(model)))  # places the cue ball, shoots and skips to the end of the break
    stroke = find_player("geometric", setup)(game_situation(setup, model.game, 3.0), rng)
    return set_tip(aim_like(model, stroke), *WINDOW["english"])


FILM: dict[str, Any] = {"noise": (0.057, 0.02), "shots": 3000, "width": 480, "pace": 3.0, "frame": 0.12, "plan": 1.5}
"""The film of a run-out: the noise of the strokes (degrees, m/s), the simulated shots of a decision, the width
(pixels), the playback speed, and how long it shows a frame and a plan, s."""


def filmed_run_out(seed: int) -> list[tuple[WindowModel, str]] | None:
    """Plays a rack of nine ball with the planner.

    Returns:
        A model and a text for each plan, and for the end of the rack; None if the rack is not a run-out.
    """
    rng, noise, speed = np.random.default_rng(seed), FILM["noise"], 8.0
    setup = Setup("nine_ball", Scene.named("real_pool", 9))
    history = History(setup, opening(setup, rng), ())
    model, plans = begin(history, ("planner", "planner"), speed, 1 / 60, FILM["pace"]), []
    while not model.game.state.over and model.game.state.player == 0:
        best = plan(setup, model.game, speed, rng, math.inf, FILM["shots"], noise, Options(run_out=True))
        plans.append((aim_like(model, best.stroke), f"keeps the turn with probability {best.probability:.2f}"))
        model = tick(shoot(model, with_noise(best.stroke, noise, speed, rng)), math.inf)
    return [*plans, (model, "")] if model.game.state.winner == 0 else None


def film_images(models: Sequence[tuple[WindowModel, str]]) -> Iterator[tuple[np.ndarray, float]]:
    """Yields the images of a film and their durations, s: each plan, and the shot that follows."""
    view = View(models[0][0].setup.scene, FILM["width"])
    for (model, text), (following, _) in itertools.pairwise(models):
        yield pixels(view.draw(model, text)), FILM["plan"]
        shown = dataclasses.replace(following, aim=model.aim, phase="rolling", preview=None, clock=0.0)
        while shown.phase == "rolling":
            yield pixels(view.draw(shown, text)), FILM["frame"]
            shown = tick(shown, FILM["frame"])
    yield pixels(view.draw(models[-1][0])), 2 * FILM["plan"]


def write_run_out(path: Path, models: Sequence[tuple[WindowModel, str]]) -> None:
    """Writes a film, .gif, completely or not at all."""
    images = list(film_images(models))
    with film_writer(path, 1 / FILM["frame"], images[0][0], 96) as write:  # all balls are in the first image
        for image, seconds in images:
            write(image, seconds)


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m studies.figures --help`."""
    folder = (IMAGES, "output folder")
    args = parser_of("studies.figures", "Draw the pictures in docs/images.", folder=folder).parse_args(arguments)
    scene = Scene.named("pool", 4)
    shot = random_shot(scene, **SHOT)
    title = f"One action, one shot: {shot.n_events} events in {shot.time:.1f} s. Ball 2 pots ball 3 and is then potted"
    with rc_context({"text.color": GREY}):
        save(picture(shot, title), args.folder / "shot.png")
        save(tables(), args.folder / "tables.png")
    save(masse(), args.folder / "masse.png")
    save(failures(), args.folder / "failures.png")
    shown = window()
    frame = View(shown.setup.scene, WINDOW["width"]).draw(shown)
    save_image(Image.fromarray(pixels(frame)), args.folder / "play.png", octree=True)
    velocity = shot.motion_at(0.0)[0]
    rough = simulate(scene, shot.at(0.0), velocity, engine=Engine("pit", 1 / 60), record=True)
    colours = panel.PAPER, panel.INK
    write_film(shot, args.folder / "shot.gif", ".gif", 25, 640, rough, colours)
    write_run_out(args.folder / "run_out.gif", next(filter(None, map(filmed_run_out, itertools.count()))))
    print(f"Written to {args.folder}.")


if __name__ == "__main__":
    main()
