"""The window: converts mouse and keyboard events to actions of the model and calls the programs that play."""

from __future__ import annotations

import ctypes
import math
import signal
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from billiards_env.drawing.canvas import pygame  # raises with a hint if pygame is missing
from billiards_env.drawing.style import ARROW, ARROW_START
from billiards_env.drawing.text import text_image
from billiards_env.drawing.window import FASTER_KEYS, SLOWER_KEYS, Screen
from billiards_env.games import GameState, History, Stroke, opening, records
from billiards_env.play import labels
from billiards_env.play import model as actions
from billiards_env.play.controls import STEEPEST
from billiards_env.play.hint import pot_at, stroke_for
from billiards_env.play.model import WindowModel, begin, shoot, tick
from billiards_env.play.pages import UNSAVED
from billiards_env.play.panel import INK, PAPER
from billiards_env.play.view import FPS, View
from billiards_env.players.levels import EXPECTED, LevelPlayer, with_noise
from billiards_env.players.planner import Plan, plan
from billiards_env.players.situation import Player, game_situation
from billiards_env.support.files import free_path

T = TypeVar("T")

COMMANDS: dict[int, tuple[Any, ...]] = {
    pygame.K_c: (actions.level,),
    pygame.K_SPACE: (actions.go,),
    pygame.K_RETURN: (actions.go,),
    pygame.K_KP_ENTER: (actions.go,),
    pygame.K_p: (actions.place,),
    pygame.K_u: (actions.undo,),
    pygame.K_r: (actions.replay,),
    pygame.K_g: (actions.toggle_ghost,),
    pygame.K_f: (actions.toggle_zoom,),
    pygame.K_h: (actions.toggle_page, "keys"),
    pygame.K_F1: (actions.toggle_page, "rules"),
    pygame.K_x: (actions.next_kind,),
    pygame.K_b: (actions.next_called, "ball"),
    pygame.K_k: (actions.next_called, "pocket"),
    pygame.K_z: (actions.undo,),
    **dict.fromkeys(SLOWER_KEYS, (actions.slow_down,)),
    **dict.fromkeys(FASTER_KEYS, (actions.speed_up,)),
}
"""The action of each key, with its arguments."""

ARROWS = {pygame.K_LEFT: (-1, 0), pygame.K_RIGHT: (1, 0), pygame.K_UP: (0, 1), pygame.K_DOWN: (0, -1)}

DEGREES, METRES_PER_SECOND, METRES, RADII = 1.0, 0.1, 0.01, 0.05
"""Changes of the aim, the speed, the cue ball in hand and, with control, the tip of the cue by an arrow key; a tenth of
them with shift."""

FINE = {pygame.K_COMMA: 0.01, pygame.K_PERIOD: -0.01}
"""Changes of the aim, degrees; a tenth of them with shift."""

ELEVATIONS = {pygame.K_PAGEUP: 5.0, pygame.K_PAGEDOWN: -5.0}
"""Changes of the elevation of the cue, degrees."""

DOUBLE_CLICK = 0.35
"""s. The longest time between the two clicks of a double click."""

HINT_TIME, INTENT = 0.5, 0.6
"""s. Time of the planner to find a shot for a person, and time for which it shows its own shot before the stroke."""

_OTHER_FOLDERS = (Path.home(), Path(tempfile.gettempdir()))
"""The folders for a game whose file cannot be written."""

GRIP = 14
"""pixels. A drag starts within this distance of the cue ball's edge or of the arrow's tip."""


class _Work(Future[T]):
    """The result of a function that runs in a thread. The window can close before the function ends."""

    def __init__(self, work: Callable[[], T]) -> None:
        super().__init__()
        self._thread = threading.Thread(target=self._run, args=(work,), daemon=True)
        self._thread.start()

    def _run(self, work: Callable[[], T]) -> None:
        try:
            self.set_result(work())
        except BaseException as error:  # raised again where the result is used
            self.set_exception(error)

    def stop(self) -> None:
        """Raises SystemExit in the thread. A call of compiled code that is running ends first."""
        number = ctypes.c_ulong(self._thread.ident or 0)
        ctypes.pythonapi.PyThreadState_SetAsyncExc(number, ctypes.py_object(SystemExit))


def wait_for(work: Callable[[], T], text: str, width: int) -> T:
    """Returns the result of `work`, which runs in a thread, and shows a text in a window of `width` pixels meanwhile.

    Raises:
        SystemExit: If the user closes the window.
    """
    screen = Screen((width, 2 * width // 3), "Billiards")
    frame = pygame.Surface(screen.size)
    frame.fill(PAPER)
    image = text_image(text, width // 30, INK, width)
    frame.blit(image, image.get_rect(center=frame.get_rect().center))
    running = _Work(work)
    try:
        while not running.done():
            if pygame.event.get(pygame.QUIT):
                raise SystemExit
            screen.show(frame)
            screen.wait(FPS)
        return running.result()
    except BaseException:
        screen.close()
        raise


class _Thought(NamedTuple):
    """The stroke that a program computes in a state of the game. `start` is a time of `time.monotonic`."""

    game: GameState
    stroke: _Work[Stroke]
    start: float


class _Hint(NamedTuple):
    """A shot that a thread computes for a state of the game: the stroke for a pot, or the plan of the best shot."""

    game: GameState
    shot: _Work[Stroke | None] | _Work[Plan]


class GameWindow:
    """A game in a window.

    Attributes:
        model: The state of the game.
        open: False after the user has quit.
        ask: Whether the window asks before it closes a game that is not saved; True by default.
        interrupted: Whether Ctrl-C or SIGTERM has closed the window.
        asking: Whether the question is shown.
        message: The result of the last command, such as saving.
    """

    def __init__(
        self,
        model: WindowModel,
        players: Sequence[Player | None],
        rng: np.random.Generator,
        save: Path,
        width: int,
        palette: str = "realistic",
    ) -> None:
        """Opens a window of `width` pixels with balls in the colours of `palette`, one of `style.PALETTES`.

        None in `players` is a person. The key S saves to the path `save`.
        """
        self.interrupted = False
        self.model, self.open, self.message = model, True, ""
        self.ask, self.asking = True, False
        self._players, self._rng, self._save, self._saved = players, rng, save, model.strokes
        self._view = View(model.setup.scene, width, palette)
        self._screen = Screen(self._view.size, f"Billiards: {model.setup.rules.replace('_', ' ')}")
        pygame.key.set_repeat(300, 30)
        # The part that the mouse drags: a control, "arrow", "table" or nothing
        self._dragged: str | None = None
        self._clicked, self._seconds = -1.0, 0.0
        self._mouse = (0, 0)  # pixels
        self._thought: _Thought | None = None
        self._hint: _Hint | None = None
        self._shown: object = None
        self._frame = self._view.draw(model)

    def run(self) -> None:
        """Plays until the window is closed. Ctrl-C and SIGTERM close it without a question."""
        before = {number: signal.signal(number, self._interrupt) for number in (signal.SIGINT, signal.SIGTERM)}
        try:
            while self.open:
                self.frame()
        finally:
            self.close()
            for number, handler in before.items():
                signal.signal(number, handler)

    def _interrupt(self, *_: Any) -> None:
        self.open, self.interrupted = False, True

    def close(self) -> None:
        """Closes the window."""
        self._stop()
        self._screen.close()

    def _stop(self) -> None:
        """Stops the searches for shots."""
        if self._thought is not None:
            self._thought.stroke.stop()
        if self._hint is not None:
            self._hint.shot.stop()
        self._thought = self._hint = None

    @property
    def saved(self) -> bool:
        """Whether all strokes are saved."""
        return self.model.strokes == self._saved

    def pixels_of(self, point: ArrayLike) -> NDArray[np.float64]:
        """Returns the pixels (2,) of a point (2,), m, from the upper left corner."""
        return self._view.pixels_of(point)

    def frame(self) -> pygame.Surface:
        """Handles the events and waits until 1 / FPS s after the last call. Draws only if something has changed.

        Returns:
            The frame, valid until the next call.
        """
        for event in pygame.event.get():
            self._take(event)
        if self._hint is not None and self._hint.shot.done():
            self._take_hint(self._hint)
        if self.model.phase == "thinking":
            self._think()
        elif not self.asking:
            self.model = tick(self.model, self._seconds)
        if self._screen.size != self._view.size:
            self._view.resize(self.model.setup.scene, self._screen.size)
        shown = self.model, self.message, self.asking, self._screen.size
        if shown != self._shown:
            self._frame = self._view.draw(self.model, self.message, UNSAVED if self.asking else ())
            self._screen.show(self._frame)
            self._shown = shown
        self._seconds = self._screen.wait(FPS)
        return self._frame

    def save(self) -> None:
        """Saves the game; to another folder, under a new name, if its file cannot be written."""
        failed = ""
        for folder in (None, *_OTHER_FOLDERS):
            path = self._save if folder is None else free_path(folder / self._save.name)
            try:
                records.save(path, records.record_game(self.model.history))
                self.message, self._saved = f"{failed}saved to {path}", self.model.strokes
                return
            except OSError as error:
                failed = failed or f"not saved: {error}; "
        self.message = failed.removesuffix("; ")

    def _think(self) -> None:
        """Plays the stroke of the program whose turn it is, when its thread has found it."""
        if self._thought is None or self._thought.game is not self.model.game:
            self._stop()
            self._thought = self._start_thought()
        elif self._thought.stroke.done():
            stroke, now = self._thought.stroke.result(), time.monotonic()
            if self.model.preview is None and self._shows_plan and stroke.call.kind not in actions.NO_SHOT:
                self._do(actions.aim_like, stroke)
                self._thought = self._thought._replace(start=now)
            elif self.model.preview is None or now - self._thought.start >= INTENT:
                self.model = shoot(self.model, self._executed(stroke))
        elif time.monotonic() - self._thought.start > self.model.clock + 1:
            self.model = tick(self.model, 1.0)  # once per second, because the window shows whole seconds

    @property
    def _shows_plan(self) -> bool:
        """Whether the program whose turn it is shows its shot before it plays it."""
        return isinstance(self._players[self.model.game.state.player], LevelPlayer)

    def _start_thought(self) -> _Thought:
        """Starts a thread that finds a stroke. If the turn is undone, the result of the thread is not used."""
        model, (rng,) = self.model, self._rng.spawn(1)
        player: Any = self._players[model.game.state.player]
        player = player.intend if isinstance(player, LevelPlayer) else player
        stroke = _Work(lambda: player(game_situation(model.setup, model.game, model.max_speed), rng))
        return _Thought(model.game, stroke, time.monotonic())

    def _executed(self, stroke: Stroke) -> Stroke:
        """Returns the stroke that is played. That of a level has noise, which the window does not show in advance."""
        player = self._players[self.model.game.state.player]
        if not isinstance(player, LevelPlayer):
            return stroke
        return with_noise(stroke, player.noise, self.model.max_speed, self._rng.spawn(1)[0])

    def _start_hint(self) -> None:
        """Starts a thread that finds the aim for the ball and the pocket under the mouse."""
        model = self.model
        pot = pot_at(model, self._view.point_of(self._mouse)) if model.phase == "aiming" else None
        if pot is None:
            self.message = "point at a ball or a pocket"
        else:
            self.message, self._hint = "", _Hint(model.game, _Work(lambda: stroke_for(model, pot)))

    def _start_plan(self) -> None:
        """Starts a thread that finds the best shot for a person."""
        model, (rng,) = self.model, self._rng.spawn(1)
        if model.phase in ("placing", "aiming"):
            running = _Work(lambda: plan(model.setup, model.game, model.max_speed, rng, HINT_TIME, noise=EXPECTED))
            self.message, self._hint = "thinking", _Hint(model.game, running)

    def _take_hint(self, hint: _Hint) -> None:
        """Aims as the thread has found, unless the game went on."""
        self._hint, shot = None, hint.shot.result()
        if shot is None:
            self.message = "no pot found"
        elif hint.game is not self.model.game:
            self.message = ""
        elif isinstance(shot, Plan):
            self._do(actions.aim_like, shot.stroke)
            self.message = labels.advice(self.model, shot)
        else:
            self._do(actions.aim_like, shot)

    def _quit(self) -> None:
        """Closes the window, but asks first if the game is not saved. A second call closes it."""
        self.open = self.asking = self.ask and not self.asking and not self.saved

    def _answer(self, key: int) -> None:
        """Handles a key after the question whether to save."""
        if key == pygame.K_s:
            self.save()
            self.open = not self.saved
        elif key == pygame.K_q:
            self.open = False
        self.asking = False

    def _take(self, event: pygame.event.Event) -> None:
        if event.type == pygame.QUIT:
            self._quit()
        elif event.type in (pygame.VIDEOEXPOSE, pygame.WINDOWRESTORED):
            self._shown = None
        elif self.asking:
            if event.type == pygame.KEYDOWN:
                self._answer(event.key)
            elif event.type == pygame.MOUSEBUTTONDOWN:
                self.asking = False
        elif event.type == pygame.KEYDOWN:
            self.message = ""
            if event.key == pygame.K_ESCAPE and self.model.page:
                self._do(actions.toggle_page, self.model.page)
            elif event.key in (pygame.K_q, pygame.K_ESCAPE):
                self._quit()
            elif event.key == pygame.K_s:
                self.save()
            elif event.key == pygame.K_a:
                (self._start_plan if event.mod & pygame.KMOD_SHIFT else self._start_hint)()
            elif event.key == pygame.K_n and self.model.phase == "over":
                self._new_game()
            elif event.key in ELEVATIONS:
                self._do(actions.set_elevation, self.model.aim.elevation + ELEVATIONS[event.key])
            elif event.key in FINE:
                self._do(actions.turn_aim, FINE[event.key] * _share(event.mod))
            elif event.key in ARROWS:
                self._move(*ARROWS[event.key], event.mod)
            elif event.key in COMMANDS:
                self._do(*COMMANDS[event.key])
            elif event.unicode == "?":
                self._do(actions.toggle_page, "rules")
        elif event.type == pygame.MOUSEBUTTONDOWN and event.button == 1:
            self.message = ""
            self._press(event.pos)
        elif event.type == pygame.MOUSEBUTTONUP and event.button == 1:
            self._dragged = None
        elif event.type == pygame.MOUSEMOTION:
            self._mouse = event.pos
            self._drag(event.pos)
            self._do(actions.move_to, self._view.point_of(event.pos))
        elif event.type == pygame.MOUSEWHEEL:
            share = _share(pygame.key.get_mods())
            if self.model.zoom:
                self._do(actions.turn_aim, FINE[pygame.K_COMMA] * share * event.y)
            else:
                self._do(actions.change_speed, METRES_PER_SECOND * share * event.y)

    def _press(self, pixel: tuple[int, int]) -> None:
        """Handles the left button: it presses a control, aims, places the cue ball or continues."""
        control = self._view.controls.at(pixel)
        if control == "shoot" and self.model.phase == "over":
            self._new_game()
        elif self.model.page or control == "shoot" or (self.model.phase != "aiming" and control is None):
            self._do(actions.go)
        elif self.model.phase == "aiming":
            double = control == "ball" and time.monotonic() - self._clicked < DOUBLE_CLICK
            self._clicked = time.monotonic() if control == "ball" else -1.0
            self._dragged = control or (
                "arrow" if self._on_arrow(pixel) else "table" if self._on_table(pixel) else None
            )
            if double:
                self._dragged = None
                self._do(actions.level)
            elif self._dragged != "arrow":
                self._drag(pixel)

    def _drag(self, pixel: tuple[int, int]) -> None:
        """Moves the part that the mouse drags."""
        places, point = self._view.controls, self._view.point_of(pixel)
        if self._dragged is None:
            return
        if self._dragged == "ball":
            self._do(actions.set_tip, *places.tip(pixel))
        elif self._dragged == "elevation":
            self._do(actions.set_elevation, STEEPEST * places.elevation.share(pixel)[1])
        elif self._dragged == "speed":
            self._do(actions.set_speed, places.speed.share(pixel)[0])
        else:
            self._do(actions.aim_at if self._dragged == "arrow" else actions.look_at, point)

    def _new_game(self) -> None:
        """Starts a game with the same settings; the old one is no longer saved."""
        self._stop()
        model = self.model
        history = History(model.setup, opening(model.setup, self._rng), ())
        self.model = begin(history, model.players, model.max_speed, model.ghost_dt, model.pace, model.choices)

    def _do(self, action: Callable[..., WindowModel], *args: Any) -> None:
        self.model = action(self.model, *args)

    def _move(self, x: int, y: int, modifiers: int) -> None:
        """Handles an arrow key that points along (x, y)."""
        share = _share(modifiers)
        if modifiers & pygame.KMOD_CTRL:
            self._do(actions.move_tip, -RADII * share * x, RADII * share * y)
        elif self.model.phase == "placing":
            self._do(actions.move_by, (METRES * share * x, METRES * share * y))
        elif x:
            self._do(actions.turn_aim, -DEGREES * share * x)
        else:
            self._do(actions.change_speed, METRES_PER_SECOND * share * y)

    def _on_arrow(self, pixel: tuple[int, int]) -> bool:
        """Returns whether a pixel is on the aimed cue ball or on the tip of the arrow."""
        model = self.model
        if model.phase != "aiming":
            return False
        radius = model.setup.scene.balls.radius[model.cue]
        along = np.array([math.cos(model.aim.angle), math.sin(model.aim.angle)])
        tip = np.array(model.cue_position) + (ARROW * model.aim.speed + ARROW_START * radius) * along
        ball, tip = (float(np.hypot(*(self.pixels_of(p) - pixel))) for p in (model.cue_position, tip))
        return ball < self._view.canvas.scale * radius + GRIP or tip < GRIP

    def _on_table(self, pixel: tuple[int, int]) -> bool:
        """Returns whether a pixel is on the playing surface."""
        table, (x, y) = self.model.setup.scene.table, self._view.point_of(pixel)
        return abs(x) <= table.length / 2 and abs(y) <= table.width / 2


def _share(modifiers: int) -> float:
    """Returns the share of a step that a key takes with its modifiers."""
    return 0.1 if modifiers & pygame.KMOD_SHIFT else 1.0
