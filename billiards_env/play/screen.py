"""Draws a model; pygame, but neither window nor events."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np

from billiards_env.drawing.canvas import BALL, RING, Canvas, Surface, pygame  # which says how to install pygame
from billiards_env.drawing.recording import Floats, frame_times
from billiards_env.drawing.style import CHALK, GREY, INK, PAPER
from billiards_env.play import words
from billiards_env.play.model import Model
from billiards_env.scene import Scene
from billiards_env.shot import ShotResult

FPS = 60

SLOWEST_SHOWN, FASTEST_SHOWN = 0.3, 2.0
"""m/s. Arrows of the preview: none for less, and none longer than that of the latter, other balls being in the way."""


class Screen:
    """Draws the models of one scene.

    Attributes:
        canvas: Where the table is drawn, at the top.
        size: (width, height) of a frame, pixels.
    """

    def __init__(self, scene: Scene, width: int) -> None:
        """Prepares to draw a scene in frames of `width` pixels."""
        self.canvas = Canvas(scene, width)
        width, height = self.canvas.size
        self._strip = width // 28
        self.size = (width, height + self._strip)
        self._small = pygame.font.Font(None, round(0.62 * self._strip))
        self._large = pygame.font.Font(None, round(0.8 * self._strip))
        self._frame = Surface(self.size, 0, 32)
        self._film: Iterator[tuple[int, Surface]] = iter(())
        self._filmed: tuple[ShotResult, ShotResult | None, float] | None = None
        self._at: tuple[int, Surface] = 0, self.canvas.table

    def draw(self, model: Model, note: str = "") -> Surface:
        """Draws a model.

        Args:
            model: The model.
            note: A line to show instead of what the keys do.

        Returns:
            The frame, valid until the next.
        """
        self._frame.fill(PAPER)
        moving = model.phase in ("rolling", "replaying")
        self._frame.blit(self._shot(model) if moving else self._still(model), (0, 0))
        line = self._small.render(note or words.hint(model), True, INK if note else GREY)
        at = self.size[0] // 40, self.canvas.size[1] + (self._strip - line.get_height()) // 3
        self._frame.blit(line, at)
        if model.help:
            self._draw_help()
        return self._frame

    def _still(self, model: Model) -> Surface:
        canvas, frame = self.canvas, self.canvas.table.copy()
        table, cue = model.game, model.cue
        if model.phase == "placing" and table.state.in_hand == "behind":
            x, y = model.setup.scene.table.length / 4, model.setup.scene.table.width / 2
            self._draw_line(frame, np.array([[-x, -y], [-x, y]]), CHALK)
        if model.preview is not None:
            self._draw_line(frame, model.preview.path, canvas.looks[cue].path)
        place = canvas.pixels_of(model.cue_at)
        for ball in sorted(table.state.on_table - {cue}):
            canvas.stamp(frame, ball, canvas.pixels_of(table.positions[ball]), BALL)
        if cue in table.state.on_table and not (table.state.in_hand != "no" and model.place is None):
            canvas.stamp(frame, cue, place, BALL)
        if model.preview is not None:
            if model.preview.ball >= 0:
                there, struck = model.preview.path[-1], model.preview.ball
                canvas.stamp(frame, cue, canvas.pixels_of(there), RING)
                for ball, at, velocity in (
                    (cue, there, model.preview.cue),
                    (struck, table.positions[struck], model.preview.struck),
                ):
                    speed = float(np.hypot(*velocity))
                    if speed > SLOWEST_SHOWN:
                        canvas.draw_arrow(frame, ball, at, velocity * min(1.0, FASTEST_SHOWN / speed))
            canvas.draw_arrow(frame, cue, np.array(model.cue_at), np.array(model.stroke.velocity))
        potted = sorted(set(range(len(table.positions))) - table.state.on_table)
        canvas.draw_bar(frame, words.doing(model), words.result(model), potted)
        return frame

    def _draw_line(self, frame: Surface, points: Floats, colour: str) -> None:
        """A line through points (m, 2), m, in short pieces: each is drawn on a surface that just holds it."""
        for a, b in itertools.pairwise(self.canvas.pixels_of(points)):
            pieces = np.linspace(a, b, 2 + int(np.hypot(*(b - a)) / 30))
            for piece in itertools.pairwise(pieces):
                self.canvas.draw_path(frame, np.array(piece), colour)

    def _shot(self, model: Model) -> Surface:
        """The frame of the film at the model's clock."""
        shot, rival = model.shown
        fps = FPS / model.pace
        wanted = int(model.clock * fps + 1e-6)
        if model.clock == model.duration:
            wanted = len(frame_times(model.duration, fps)) - 1
        filmed = shot, rival, model.pace
        if (
            self._filmed is None
            or any(a is not b for a, b in zip(filmed, self._filmed, strict=True))
            or (wanted < self._at[0])
        ):
            compare = None if rival is None else rival.recording()
            left, right = words.doing(model), words.result(model)
            self._film = enumerate(self.canvas.film(shot.recording(), fps, left, right, compare))
            self._filmed, self._at = filmed, next(self._film)
        while self._at[0] < wanted:
            self._at = next(self._film)
        return self._at[1]

    def _draw_help(self) -> None:
        row = round(0.95 * self._strip)
        box = Surface((round(0.76 * self.size[0]), row * (len(words.KEYS) + 1)))
        box.fill(PAPER)
        for k, line in enumerate(words.KEYS):
            for text, x in zip(line, (0.03, 0.36), strict=True):
                image = self._large.render(text, True, INK)
                box.blit(image, (round(x * box.get_width()), round((k + 0.5) * row + (row - image.get_height()) / 2)))
        box.set_alpha(235)
        x, y = ((a - b) // 2 for a, b in zip(self.canvas.size, box.get_size(), strict=True))
        self._frame.blit(box, (x, max(0, y)))
