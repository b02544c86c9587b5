"""Draws a model with pygame; opens no window and handles no events."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np

from billiards_env.drawing.canvas import BALL, RING, Canvas, Surface, pygame  # raises with a hint if pygame is missing
from billiards_env.drawing.recording import Floats, frame_times
from billiards_env.drawing.style import CHALK, GREY, INK, PAPER
from billiards_env.play import labels
from billiards_env.play.model import Model
from billiards_env.scene import Scene
from billiards_env.shot import ShotResult

FPS = 60

SLOWEST_SHOWN, FASTEST_SHOWN = 0.3, 2.0
"""m/s. Velocities below the first have no arrow in the preview; arrows are not longer than that of the second."""


class View:
    """Draws the models of one scene.

    Attributes:
        canvas: The canvas of the table, at the top of the frame.
        size: (width, height) of a frame, pixels.
    """

    def __init__(self, scene: Scene, width: int) -> None:
        """Prepares the drawing of a scene in frames of `width` pixels."""
        self.canvas = Canvas(scene, width)
        width, height = self.canvas.size
        self._strip = width // 28
        self.size = (width, height + self._strip)
        self._small = pygame.font.Font(None, round(0.62 * self._strip))
        self._large = pygame.font.Font(None, round(0.8 * self._strip))
        self._frame = Surface(self.size, 0, 32)
        self._film: Iterator[tuple[int, Surface]] = iter(())
        self._film_key: tuple[ShotResult, ShotResult | None, float] | None = None
        self._at: tuple[int, Surface] = 0, self.canvas.table

    def draw(self, model: Model, message: str = "") -> Surface:
        """Draws a model.

        Args:
            model: The model.
            message: A line that replaces the hint on the keys.

        Returns:
            The frame, valid until the next call.
        """
        self._frame.fill(PAPER)
        moving = model.phase in ("rolling", "replaying")
        self._frame.blit(self._shot(model) if moving else self._still(model), (0, 0))
        line = self._small.render(message or labels.key_hint(model), True, INK if message else GREY)
        at = self.size[0] // 40, self.canvas.size[1] + (self._strip - line.get_height()) // 3
        self._frame.blit(line, at)
        if model.help:
            self._draw_help()
        return self._frame

    def _still(self, model: Model) -> Surface:
        canvas, frame = self.canvas, self.canvas.table.copy()
        game, cue = model.game, model.cue
        if model.phase == "placing" and game.state.in_hand == "behind":
            x, y = model.setup.scene.table.length / 4, model.setup.scene.table.width / 2
            self._draw_line(frame, np.array([[-x, -y], [-x, y]]), CHALK)
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
        return frame

    def _draw_line(self, frame: Surface, points: Floats, colour: str) -> None:
        """Draws a line through points (m, 2), m, in short pieces, which need only small surfaces."""
        for a, b in itertools.pairwise(self.canvas.pixels_of(points)):
            pieces = np.linspace(a, b, 2 + int(np.hypot(*(b - a)) / 30))
            for piece in itertools.pairwise(pieces):
                self.canvas.draw_path(frame, np.array(piece), colour)

    def _shot(self, model: Model) -> Surface:
        """Returns the frame of the film at the model's clock."""
        shot, comparison = model.shown_shots
        fps = FPS / model.pace
        index = int(model.clock * fps + 1e-6)
        if model.clock == model.duration:
            index = len(frame_times(model.duration, fps)) - 1
        film_key = shot, comparison, model.pace
        if (
            self._film_key is None
            or any(a is not b for a, b in zip(film_key, self._film_key, strict=True))
            or (index < self._at[0])
        ):
            compare = None if comparison is None else comparison.recording()
            left, right = labels.status(model), labels.result(model)
            self._film = enumerate(self.canvas.film(shot.recording(), fps, left, right, compare))
            self._film_key, self._at = film_key, next(self._film)
        while self._at[0] < index:
            self._at = next(self._film)
        return self._at[1]

    def _draw_help(self) -> None:
        row = round(0.95 * self._strip)
        box = Surface((round(0.76 * self.size[0]), row * (len(labels.KEYS) + 1)))
        box.fill(PAPER)
        for k, line in enumerate(labels.KEYS):
            for text, x in zip(line, (0.03, 0.36), strict=True):
                image = self._large.render(text, True, INK)
                box.blit(image, (round(x * box.get_width()), round((k + 0.5) * row + (row - image.get_height()) / 2)))
        box.set_alpha(235)
        x, y = ((a - b) // 2 for a, b in zip(self.canvas.size, box.get_size(), strict=True))
        self._frame.blit(box, (x, max(0, y)))
