"""The window: turns mouse and keys into a model's inputs, and lets programs play when it is their turn."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from billiards_env import records
from billiards_env.drawing.canvas import pygame  # which says how to install it
from billiards_env.drawing.style import ARROW, ARROW_START
from billiards_env.drawing.window import Window as Frames
from billiards_env.play.model import (
    AimAt,
    Do,
    Input,
    Model,
    MoveBy,
    MoveTo,
    Strengthen,
    Turn,
    shoot,
    tick,
    update,
)
from billiards_env.play.screen import FPS, Screen
from billiards_env.players.game_player import Player

COMMANDS = {
    pygame.K_SPACE: "go",
    pygame.K_RETURN: "go",
    pygame.K_KP_ENTER: "go",
    pygame.K_p: "place",
    pygame.K_u: "undo",
    pygame.K_r: "replay",
    pygame.K_g: "ghost",
    pygame.K_h: "help",
    pygame.K_MINUS: "slower",
    pygame.K_KP_MINUS: "slower",
    pygame.K_PLUS: "faster",
    pygame.K_EQUALS: "faster",
    pygame.K_KP_PLUS: "faster",
}

ARROWS = {pygame.K_LEFT: (-1, 0), pygame.K_RIGHT: (1, 0), pygame.K_UP: (0, 1), pygame.K_DOWN: (0, -1)}

DEGREES, METRES_PER_SECOND, METRES = 1.0, 0.1, 0.01
"""What an arrow key does to the aim, the speed and the cue ball in hand; with shift a tenth."""

GRIP = 14
"""Pixels beside the cue ball, and about the arrow's tip, by which the arrow can be taken hold of."""


class GameWindow:
    """A game in a window.

    Attributes:
        model: The game.
        open: Whether the window is to stay open.
        note: What there is to say of the last key.
    """

    def __init__(
        self, model: Model, players: Sequence[Player | None], rng: np.random.Generator, save: Path, width: int
    ) -> None:
        """Opens a window of `width` pixels; `players` has None for a person, `save` is where "S" saves to."""
        self.model, self.open = model, True
        self._players, self._rng, self._save = players, rng, save
        self._screen = Screen(model.setup.scene, width)
        self._frames = Frames(self._screen.size, f"Billiards: {model.setup.rules.replace('_', ' ')}")
        pygame.key.set_repeat(300, 30)
        self._dragging, self.note = False, ""

    def run(self) -> None:
        """Plays until the window is closed."""
        try:
            while self.open:
                self.frame()
        finally:
            self.close()

    def close(self) -> None:
        """Closes the window."""
        self._frames.close()

    def pixels_of(self, place: ArrayLike) -> NDArray[np.float64]:
        """Where a place (2,), m, is shown: (2,) pixels from the upper left corner."""
        return self._screen.canvas.pixels_of(place)

    def frame(self) -> pygame.Surface:
        """Takes what has been done with mouse and keys, and shows a frame, 1 / FPS s after the last.

        Returns:
            The frame, valid until the next.
        """
        for event in pygame.event.get():
            self._take(event)
        self.model = tick(self.model, 1 / FPS)
        frame = self._screen.draw(self.model, self.note)
        self._frames.show(frame, FPS)
        if self.model.phase == "thinking":  # after the frame that says so
            player = self._players[self.model.game.state.player]
            assert player is not None
            stroke = player(self.model.setup, self.model.game, self.model.max_speed, self._rng)
            self.model = shoot(self.model, stroke)
        return frame

    def save(self) -> None:
        """Saves the game."""
        try:
            records.save(self._save, records.record_game(self.model.history))
            self.note = f"saved to {self._save}"
        except OSError as error:
            self.note = f"not saved: {error}"

    def _take(self, event: pygame.event.Event) -> None:
        if event.type == pygame.QUIT:
            self.open = False
        elif event.type == pygame.KEYDOWN:
            self.note = ""
            if event.key in (pygame.K_q, pygame.K_ESCAPE):
                self.open = False
            elif event.key == pygame.K_s:
                self.save()
            elif event.key in ARROWS:
                self._do(self._moved(*ARROWS[event.key], 0.1 if event.mod & pygame.KMOD_SHIFT else 1.0))
            elif event.key in COMMANDS:
                self._do(Do(COMMANDS[event.key]))
        elif event.type == pygame.MOUSEBUTTONDOWN and event.button == 1:
            self.note = ""
            self._dragging = self._on_arrow(event.pos) and not self.model.help
            if not self._dragging:
                self._do(Do("go"))
        elif event.type == pygame.MOUSEBUTTONUP and event.button == 1:
            self._dragging = False
        elif event.type == pygame.MOUSEMOTION:
            place = self._screen.canvas.place_of(event.pos)
            self._do(AimAt(place) if self._dragging else MoveTo(place))
        elif event.type == pygame.MOUSEWHEEL:
            self._do(Strengthen(METRES_PER_SECOND * event.y))

    def _do(self, given: Input) -> None:
        self.model = update(self.model, given)

    def _moved(self, x: int, y: int, share: float) -> Input:
        """What an arrow key that points along (x, y) does."""
        if self.model.phase == "placing":
            return MoveBy((METRES * share * x, METRES * share * y))
        return Turn(-DEGREES * share * x) if x else Strengthen(METRES_PER_SECOND * share * y)

    def _on_arrow(self, pixel: tuple[int, int]) -> bool:
        """Whether a pixel is on the cue ball that is aimed, or on the tip of the arrow."""
        model, canvas = self.model, self._screen.canvas
        if model.phase != "aiming":
            return False
        radius = model.setup.scene.balls.radius[model.cue]
        velocity = np.array(model.stroke.velocity)
        tip = np.array(model.cue_at) + velocity * (ARROW + ARROW_START * radius / model.speed)
        ball, tip = (float(np.hypot(*(self.pixels_of(p) - pixel))) for p in (model.cue_at, tip))
        return ball < canvas.scale * radius + GRIP or tip < GRIP
