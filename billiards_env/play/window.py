"""The window: converts mouse and keyboard events to inputs of the model and calls the programs that play."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from billiards_env import records
from billiards_env.drawing.canvas import pygame  # raises with a hint if pygame is missing
from billiards_env.drawing.style import ARROW, ARROW_START
from billiards_env.drawing.window import Window as Frames
from billiards_env.play.model import (
    AimAt,
    ChangeSpeed,
    Command,
    Input,
    Model,
    MoveBy,
    MoveTo,
    TurnAim,
    shoot,
    tick,
    update,
)
from billiards_env.play.view import FPS, View
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
"""Changes of the aim, the speed and the cue ball in hand by an arrow key; a tenth of them with shift."""

GRIP = 14
"""pixels. A drag starts within this distance of the cue ball's edge or of the arrow's tip."""


class GameWindow:
    """A game in a window.

    Attributes:
        model: The state of the game.
        open: False after the user has quit.
        message: The result of the last command, such as saving.
    """

    def __init__(
        self, model: Model, players: Sequence[Player | None], rng: np.random.Generator, save: Path, width: int
    ) -> None:
        """Opens a window of `width` pixels; a person is None in `players`, and "S" saves to the path `save`."""
        self.model, self.open = model, True
        self._players, self._rng, self._save = players, rng, save
        self._view = View(model.setup.scene, width)
        self._frames = Frames(self._view.size, f"Billiards: {model.setup.rules.replace('_', ' ')}")
        pygame.key.set_repeat(300, 30)
        self._dragging, self.message = False, ""

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

    def pixels_of(self, point: ArrayLike) -> NDArray[np.float64]:
        """Returns the pixels (2,) of a point (2,), m, from the upper left corner."""
        return self._view.canvas.pixels_of(point)

    def frame(self) -> pygame.Surface:
        """Handles the events and shows a frame, 1 / FPS s after the last one.

        Returns:
            The frame, valid until the next call.
        """
        for event in pygame.event.get():
            self._take(event)
        self.model = tick(self.model, 1 / FPS)
        frame = self._view.draw(self.model, self.message)
        self._frames.show(frame, FPS)
        if self.model.phase == "thinking":  # after the frame that shows this phase
            player = self._players[self.model.game.state.player]
            assert player is not None
            stroke = player(self.model.setup, self.model.game, self.model.max_speed, self._rng)
            self.model = shoot(self.model, stroke)
        return frame

    def save(self) -> None:
        """Saves the game."""
        try:
            records.save(self._save, records.record_game(self.model.history))
            self.message = f"saved to {self._save}"
        except OSError as error:
            self.message = f"not saved: {error}"

    def _take(self, event: pygame.event.Event) -> None:
        if event.type == pygame.QUIT:
            self.open = False
        elif event.type == pygame.KEYDOWN:
            self.message = ""
            if event.key in (pygame.K_q, pygame.K_ESCAPE):
                self.open = False
            elif event.key == pygame.K_s:
                self.save()
            elif event.key in ARROWS:
                self._do(self._moved(*ARROWS[event.key], 0.1 if event.mod & pygame.KMOD_SHIFT else 1.0))
            elif event.key in COMMANDS:
                self._do(Command(COMMANDS[event.key]))
        elif event.type == pygame.MOUSEBUTTONDOWN and event.button == 1:
            self.message = ""
            self._dragging = self._on_arrow(event.pos) and not self.model.help
            if not self._dragging:
                self._do(Command("go"))
        elif event.type == pygame.MOUSEBUTTONUP and event.button == 1:
            self._dragging = False
        elif event.type == pygame.MOUSEMOTION:
            point = self._view.canvas.point_of(event.pos)
            self._do(AimAt(point) if self._dragging else MoveTo(point))
        elif event.type == pygame.MOUSEWHEEL:
            self._do(ChangeSpeed(METRES_PER_SECOND * event.y))

    def _do(self, user_input: Input) -> None:
        self.model = update(self.model, user_input)

    def _moved(self, x: int, y: int, share: float) -> Input:
        """Returns the input of an arrow key that points along (x, y)."""
        if self.model.phase == "placing":
            return MoveBy((METRES * share * x, METRES * share * y))
        return TurnAim(-DEGREES * share * x) if x else ChangeSpeed(METRES_PER_SECOND * share * y)

    def _on_arrow(self, pixel: tuple[int, int]) -> bool:
        """Returns whether a pixel is on the aimed cue ball or on the tip of the arrow."""
        model, canvas = self.model, self._view.canvas
        if model.phase != "aiming":
            return False
        radius = model.setup.scene.balls.radius[model.cue]
        velocity = np.array(model.stroke.velocity)
        tip = np.array(model.cue_position) + velocity * (ARROW + ARROW_START * radius / model.speed)
        ball, tip = (float(np.hypot(*(self.pixels_of(p) - pixel))) for p in (model.cue_position, tip))
        return ball < canvas.scale * radius + GRIP or tip < GRIP
