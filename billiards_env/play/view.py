"""Draws a model with pygame; opens no window and handles no events."""

from __future__ import annotations

import itertools
import operator
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from billiards_env.drawing.canvas import BALL, GHOST, PATH_STEPS, RING, Canvas, Surface, pygame
from billiards_env.drawing.recording import Floats, Recording
from billiards_env.drawing.style import CHALK, GREY, INK
from billiards_env.drawing.text import text_image
from billiards_env.play import labels
from billiards_env.play.model import Model
from billiards_env.scene import Scene
from billiards_env.shot import ShotResult

FPS = 60

STEP = 1 / 60
"""s. Paths grow in pieces of this time, also in slow motion. Every second piece of a ghost's path is left out."""

RESULT_SHOWN = 1.0
"""s. The result of a shot is shown for this time at its end."""

SLOWEST_SHOWN, FASTEST_SHOWN = 0.3, 2.0
"""m/s. Velocities below the first have no arrow in the preview; arrows are not longer than that of the second."""

LEAST_STRIP, MOST_STRIP = 24, 44
"""Pixels. Limits of the height of the line with the keys."""


class View:
    """Draws the models of one scene.

    Attributes:
        canvas: The canvas of the table, in the middle of the frame.
        size: (width, height) of a frame, pixels.
    """

    def __init__(self, scene: Scene, width: int) -> None:
        """Prepares the drawing of a scene in frames of `width` pixels that have the height of their content."""
        height = Canvas(scene, width).size[1]
        self.resize(scene, (width // 2 * 2, height + _strip(width)))

    def resize(self, scene: Scene, size: tuple[int, int]) -> None:
        """Prepares the drawing in frames of `size` (width, height), pixels, with the largest table that fits."""
        self.size, self._strip, width = size, _strip(size[0]), max(160, size[0])
        while (canvas := Canvas(scene, width)).size[1] > size[1] - self._strip and width > 160:
            width = max(160, min(width - 2, width * (size[1] - self._strip) // canvas.size[1]))
        self.canvas = canvas
        self._corner = (size[0] - canvas.size[0]) // 2, max(0, size[1] - self._strip - canvas.size[1]) // 2
        self._frame, self._table = Surface(size, 0, 32), Surface(canvas.size, 0, 32)
        self._shots: tuple[ShotResult, ShotResult | None] | None = None

    def pixels_of(self, point: ArrayLike) -> Floats:
        """Returns the pixels (2,) of a point (2,), m, from the upper left corner of a frame."""
        return self.canvas.pixels_of(point) + self._corner

    def point_of(self, pixel: tuple[int, int]) -> tuple[float, float]:
        """Returns the point, m, of a pixel of a frame."""
        return self.canvas.point_of((pixel[0] - self._corner[0], pixel[1] - self._corner[1]))

    def draw(self, model: Model, message: str = "", question: Sequence[tuple[str, str]] = ()) -> Surface:
        """Draws a model.

        Args:
            model: The model.
            message: A line that replaces the hint on the keys.
            question: Rows of two texts that cover the table; empty for none.

        Returns:
            The frame, valid until the next call.
        """
        self._frame.fill(self.canvas.table.get_at((0, 0)))  # the paper around the table
        self._draw_shot(model) if model.phase in ("rolling", "replaying") else self._draw_turn(model)
        self._frame.blit(self._table, self._corner)
        x, y = self._corner[0] + self.canvas.size[0] // 40, self._corner[1] + self.canvas.size[1]
        text, colour = message or ("" if question else labels.key_hint(model)), INK if message else GREY
        line = text_image(text, round(0.66 * self._strip), colour, self.canvas.size[0] * 38 // 40)
        self._frame.blit(line, (x, y + (self._strip - line.get_height()) // 3))
        rows = question or (labels.KEYS if model.help else ())
        if rows:
            self._draw_rows(rows)
        return self._frame

    def _draw_turn(self, model: Model) -> None:
        """Draws the balls at rest, with the aim if a person has the turn."""
        canvas, frame = self.canvas, self._table
        frame.blit(canvas.table, (0, 0))
        game, cue = model.game, model.cue
        if model.phase == "placing" and game.state.in_hand == "behind":
            x, y = model.setup.scene.table.head_x, model.setup.scene.table.width / 2
            self._draw_line(frame, np.array([[x, -y], [x, y]]), CHALK)
        if model.preview is not None:
            self._draw_line(frame, model.preview.path, canvas.looks[cue].path)
        for ball in sorted(game.state.on_table - {cue}):
            canvas.stamp(frame, ball, canvas.pixels_of(game.positions[ball]), BALL)
        if cue in game.state.on_table and not (game.state.in_hand != "no" and model.place is None):
            canvas.stamp(frame, cue, canvas.pixels_of(model.cue_position), BALL)
        if model.preview is not None:
            if model.preview.ball >= 0:
                contact, struck = model.preview.path[-1], model.preview.ball
                canvas.stamp(frame, cue, canvas.pixels_of(contact), RING)
                for ball, at, velocity in (
                    (cue, contact, model.preview.cue),
                    (struck, game.positions[struck], model.preview.struck),
                ):
                    speed = float(np.hypot(*velocity))
                    if speed > SLOWEST_SHOWN:
                        canvas.draw_arrow(frame, ball, at, velocity * min(1.0, FASTEST_SHOWN / speed))
            canvas.draw_arrow(frame, cue, np.array(model.cue_position), np.array(model.stroke.velocity))
        potted = sorted(set(range(len(game.positions))) - game.state.on_table)
        canvas.draw_bar(frame, labels.status(model), labels.result(model), potted)

    def _draw_line(self, frame: Surface, points: Floats, colour: str) -> None:
        """Draws a line through points (m, 2), m, in short pieces, which need only small surfaces."""
        for a, b in itertools.pairwise(self.canvas.pixels_of(points)):
            pieces = np.linspace(a, b, 2 + int(np.hypot(*(b - a)) / 30))
            for piece in itertools.pairwise(pieces):
                self.canvas.draw_path(frame, np.array(piece), colour)

    def _draw_shot(self, model: Model) -> None:
        """Draws the shown shots at the model's clock."""
        canvas, frame, time = self.canvas, self._table, model.clock
        same = self._shots is not None and all(map(operator.is_, self._shots, model.shown_shots))
        if not same or time < self._steps * STEP:
            self._start_paths(model)
        while (self._steps + 1) * STEP <= time:
            self._draw_paths(self._paths, self._steps, (self._steps + 1) * STEP)
            self._steps += 1
        frame.blit(self._paths, (0, 0))
        self._draw_paths(frame, self._steps, time)
        for shot, moving, style in self._balls:
            for ball in np.flatnonzero(shot.gone > time).tolist():
                place = shot.path(ball, [min(time, shot.time) if ball in moving else 0.0])[0]
                canvas.stamp(frame, ball, canvas.pixels_of(place), style)
        result = labels.result(model) if time >= model.duration - RESULT_SHOWN else ""
        potted = np.flatnonzero(self._balls[-1][0].gone <= time)
        canvas.draw_bar(frame, f"{labels.status(model)}   {time:.2f} s", result, potted)

    def _start_paths(self, model: Model) -> None:
        """Draws the table at the start of the shown shots."""
        canvas = self.canvas
        self._shots, self._steps, self._paths = model.shown_shots, 0, canvas.table.copy()
        shot, ghost = model.shown_shots
        # Each shot with its moving balls and their style; the ghost is drawn first.
        self._balls: list[tuple[Recording, list[int], int]] = []
        for shown, style in ((ghost, RING), (shot, BALL)):
            if shown is not None:
                recording = shown.recording()
                moving = [ball for ball in range(len(recording.gone)) if recording.moves(ball)]
                self._balls.append((recording, moving, style))
        recording, moving, _ = self._balls[-1]
        for ball in moving:
            canvas.stamp(self._paths, ball, canvas.pixels_of(recording.path(ball, [0.0])[0]), GHOST)
        cue = model.games[-2].state.cue_balls[0]
        velocity = np.array(model.strokes[-1].velocity)
        canvas.draw_arrow(self._paths, cue, recording.path(cue, [0.0])[0], velocity)

    def _draw_paths(self, surface: Surface, step: int, end: float) -> None:
        """Draws the paths of the shown shots from the start of a step to a later time, s."""
        start = step * STEP
        for shot, moving, style in self._balls:
            if style == RING and step % 2 == 0:
                continue
            for ball in moving:
                corners = shot.corners(ball)
                times = np.union1d(np.linspace(start, end, PATH_STEPS), corners[(corners > start) & (corners < end)])
                times = times[(times <= shot.time) & (times < shot.gone[ball])]
                if len(times):
                    points = self.canvas.pixels_of(shot.path(ball, times))
                    self.canvas.draw_path(surface, points, self.canvas.looks[ball].path)

    def _draw_rows(self, rows: Sequence[tuple[str, str]]) -> None:
        """Draws rows of two texts on a page that covers the table."""
        page = self._frame.subsurface(pygame.Rect(self._corner, self.canvas.size).clip(self._frame.get_rect()))
        page.fill(self.canvas.table.get_at((0, 0)))
        width, height = page.get_size()
        row = min(height // (len(rows) + 1), width // 24)
        top = (height - row * len(rows)) // 2
        for k, (key, effect) in enumerate(rows):
            for text, x, end, colour in ((key, 0.08, 0.36, INK), (effect, 0.38, 0.98, GREY)):
                end = end if effect else 0.98
                image = text_image(text, round(0.72 * row), colour, round((end - x) * width))
                page.blit(image, (round(x * width), top + k * row + (row - image.get_height()) // 2))


def _strip(width: int) -> int:
    """Returns the height of the line with the keys, pixels."""
    return min(max(width // 28, LEAST_STRIP), MOST_STRIP)
