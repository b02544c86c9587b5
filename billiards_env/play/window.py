"""The window: converts mouse and keyboard events to actions of the model and calls the programs that play."""

from __future__ import annotations

import ctypes
import signal
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from pathlib import Path
from traceback import walk_stack
from typing import Any, TypeVar

import numpy as np

from billiards_env.derivatives.shot_derivatives import has_derivatives
from billiards_env.drawing.canvas import pygame  # raises with a hint if pygame is missing
from billiards_env.drawing.style import ARROW, ARROW_START
from billiards_env.drawing.text import write
from billiards_env.drawing.window import PACE_KEYS, Screen
from billiards_env.games import GameState, History, Stroke, opening, records
from billiards_env.play import labels
from billiards_env.play import model as act
from billiards_env.play.model import STEEPEST, WindowModel, begin, pot_at, shoot, stroke_for, tick
from billiards_env.play.view import FPS, INK, PAPER, View
from billiards_env.players.env_player import game_observation
from billiards_env.players.levels import EXPECTED, LevelPlayer, with_noise
from billiards_env.players.planner import Plan, plan
from billiards_env.players.situation import Player, game_situation, stroke_of
from billiards_env.support.checks import short_name
from billiards_env.support.files import free_path

T = TypeVar("T")

DOUBLE_CLICK = 0.35
"""s. The longest time between the two clicks of a double click."""

HINT_TIME, INTENT = 0.5, 0.6
"""s. Time of the planner to find a shot for a person, and time for which it shows its own shot before the stroke."""

GRIP = 14
"""pixels. A drag starts within this distance of the cue ball's edge or of the arrow's tip."""

_OTHER_FOLDERS = (Path.home(), Path(tempfile.gettempdir()))
"""The folders for a game whose file cannot be written."""


def _arrows(action: Callable[..., WindowModel], held: str = "") -> dict[str, tuple[Any, ...]]:
    """Returns the commands of the four arrow keys with a modifier: an action with the direction on the screen."""
    ways = {"left": (-1.0, 0.0), "right": (1.0, 0.0), "up": (0.0, 1.0), "down": (0.0, -1.0)}
    return {held + key: (action, *way) for key, way in ways.items()}


KEYS: tuple[tuple[str, str, dict[str, tuple[Any, ...]]], ...] = (
    ("drag from the cue ball", "aim; the arrow's length is the speed", {}),
    ("drag on the table", "aim at a point with the same speed", {}),
    ("left, right", "turn the aim by 1 degree; with shift 0.1", {}),
    (
        "comma, period",
        "turn the aim by 0.01 degrees; with shift 0.001",
        {",": (act.turn_aim, 0.01), ".": (act.turn_aim, -0.01)},
    ),
    ("F", "enlarge the object ball; the wheel then turns the aim by 0.01 degrees", {"f": (act.toggle, "zoom")}),
    ("A", "aim to pot the ball under the mouse, or the aimed ball into the pocket under it", {"a": ("find_pot",)}),
    ("Shift A", "aim for the best shot that the planner finds", {"shift a": ("find_plan",)}),
    ("up, down, wheel", "speed by 0.1 m/s; with shift 0.01", _arrows(act.press_arrow)),
    ("the white ball below", "drag the tip of the cue: english, follow and draw", {}),
    ("ctrl + arrows", "move the tip of the cue; with shift by less", _arrows(act.move_tip, "ctrl ")),
    ("double click on it, C", "level cue at the centre of the ball", {"c": (act.level,)}),
    (
        "page up, page down",
        "raise and lower the cue by 5 degrees; with shift 0.5",
        {"page up": (act.raise_cue, 5.0), "page down": (act.raise_cue, -5.0)},
    ),
    ("space, the button", "shoot; place the cue ball; continue", {"space": (act.go,)}),
    ("mouse, arrows", "move a cue ball in hand by 1 cm; with shift 1 mm", {}),
    ("P", "move the cue ball in hand again", {"p": (act.place,)}),
    ("B, K", "call the next ball, the next pocket", {"b": (act.next_called, "ball"), "k": (act.next_called, "pocket")}),
    ("X", "the next choice: safety, push out, hand back, replace", {"x": (act.next_kind,)}),
    ("U or Z", "undo a person's shot; the aim of the shot is kept", {"u": (act.undo,)}),
    ("R, G", "replay the last shot; show or hide the other engine", {"r": (act.repeat,), "g": (act.toggle, "ghost")}),
    ("-, +", "show shots slower, faster", {key: (act.change_pace, change) for key, change in PACE_KEYS.items()}),
    (
        "S, N, Q",
        "save the game; a new game when one is over; quit",
        {"s": ("answer_save",), "n": ("begin_again",), "q": ("quit",)},
    ),
    ("H, F1", "these keys; the rules of the game", {"h": (act.toggle_page, "keys"), "f1": (act.toggle_page, "rules")}),
)
"""The page of the keys and mouse actions: their names and effects, and the actions of the keys.

A key has its name in pygame, alone or after a modifier, or is the character that it types. Its action is a function of
the model or the name of a method of the window, with its arguments. Shift divides numbers by ten.
"""

COMMANDS = {key: command for *_, commands in KEYS for key, command in commands.items()}
"""The action of each key."""

for _alias, _key in {"return": "space", "enter": "space", "z": "u", "escape": "q", "?": "f1"}.items():
    COMMANDS[_alias] = COMMANDS[_key]

_MODIFIERS = {"ctrl": pygame.KMOD_CTRL, "shift": pygame.KMOD_SHIFT}

UNSAVED = (
    ("The game is not saved.", ""),
    ("S", "save and quit"),
    ("Q", "quit without saving"),
    ("any other key", "continue"),
)
"""The page with the question before the window closes."""


_COMPILERS = "numba.", "llvmlite."
"""The modules that compile kernels."""


class _Work(Future[T]):
    """The result of a function that runs in a thread. The window can close before the function ends.

    `game` is the state of the game for which it runs, and `start` the time of its start, see `time.monotonic`.
    """

    def __init__(self, work: Callable[[], T], game: GameState | None = None) -> None:
        super().__init__()
        self.game, self.start = game, time.monotonic()
        self._thread = threading.Thread(target=self._run, args=(work,), daemon=True)
        self._thread.start()

    def _run(self, work: Callable[[], T]) -> None:
        try:
            self.set_result(work())
        except BaseException as error:  # raised again where the result is used
            self.set_exception(error)

    def stop(self) -> None:
        """Raises SystemExit in the thread. A call of compiled code that is running ends first.

        While the thread compiles, another one waits: LLVM calls Python, and an exception there breaks the code.
        """
        threading.Thread(target=self._stop, daemon=True).start()

    def _stop(self) -> None:
        number = self._thread.ident or 0
        while self._thread.is_alive():  # a later thread may have the same number
            stack = walk_stack(sys._current_frames().get(number))
            if not any(frame.f_globals.get("__name__", "").startswith(_COMPILERS) for frame, _ in stack):
                ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(number), ctypes.py_object(SystemExit))
                return
            time.sleep(0.1)


def wait_for(work: Callable[[], T], text: str, width: int) -> T:
    """Returns the result of `work`, which runs in a thread, and shows a text in a window of `width` pixels meanwhile.

    Raises:
        SystemExit: If the user closes the window.
    """
    screen = Screen((width, 2 * width // 3), "Billiards")
    frame = pygame.Surface(screen.size)
    frame.fill(PAPER)
    write(frame, text, width // 30, INK, width, center=frame.get_rect().center)
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


class GameWindow:
    """A game in a window.

    Attributes:
        model: The state of the game.
        open: False after the user has quit.
        ask: Whether the window asks before it closes a game that is not saved; True by default.
        interrupted: Whether Ctrl-C, SIGTERM or an error has closed the window.
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
        self.model, self.message = model, ""
        self.open, self.ask, self.interrupted = True, True, False
        self._players, self._rng, self._save, self._saved = players, rng, save, model.strokes
        self._view = View(model.setup.scene, width, palette)
        self._screen = Screen(self._view.size, f"Billiards: {short_name(model.setup.rules).replace('_', ' ')}")
        pygame.key.set_repeat(300, 30)
        # The part that the mouse drags: a control, "arrow", "table" or nothing
        self._dragged: str | None = None
        self._clicked, self._seconds = -1.0, 0.0
        self._mouse = (0, 0)  # pixels
        # The stroke of the program whose turn it is, or the stroke and the message of a hint
        self._work: _Work[Any] | None = None
        # The plans that the program considers, the newest last, and those that the model already shows
        self._plans: list[Sequence[Plan]] = []
        self._seen: object = None
        self._shown: object = None
        self._frame = self._view.draw(model)

    def run(self) -> None:
        """Plays until the window is closed. Ctrl-C, SIGTERM and an error close it without a question."""
        before = {number: signal.signal(number, self._interrupt) for number in (signal.SIGINT, signal.SIGTERM)}
        try:
            while self.open:
                self.frame()
        except BaseException:
            self._interrupt()
            raise
        finally:
            self.close()
            for number, handler in before.items():
                signal.signal(number, handler)

    def _interrupt(self, *_: Any) -> None:
        self.open, self.interrupted = False, True

    def close(self) -> None:
        """Closes the window."""
        self._start(None)
        self._screen.close()

    @property
    def saved(self) -> bool:
        """Whether all strokes are saved."""
        return self.model.strokes == self._saved

    @property
    def asking(self) -> bool:
        """Whether the window asks if the game is to be saved."""
        return self.model.page == "unsaved"

    def frame(self) -> pygame.Surface:
        """Handles the events and waits until 1 / FPS s after the last call. Draws only if something has changed.

        Returns:
            The frame, valid until the next call.
        """
        for event in pygame.event.get():
            if event.type in EVENTS:
                EVENTS[event.type](self, event)
        if self._work is not None and self._work.game is not self.model.game:
            self._start(None)
        if self.model.phase == "thinking":
            self._think()
        else:
            self._take_hint()
            self.model = tick(self.model, self._seconds)
        if self._screen.size != self._view.size:
            self._view.resize(self.model.setup.scene, self._screen.size)
        shown = self.model, self.message, self._screen.size
        if shown != self._shown:
            self._frame = self._view.draw(self.model, self.message, self._page())
            self._screen.show(self._frame)
            self._shown = shown
        self._seconds = self._screen.wait(FPS)
        return self._frame

    def _page(self) -> Sequence[tuple[str, str]]:
        if self.model.page == "rules":
            return labels.rules_page(self.model.setup, self.model.choices)
        return {"keys": [row[:2] for row in KEYS], "unsaved": UNSAVED}.get(self.model.page, ())

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

    def _start(self, work: Callable[[], Any] | None) -> None:
        """Stops the search for a shot, and starts another one in a thread, if any."""
        if self._work is not None:
            self._work.stop()
        self._work = None if work is None else _Work(work, self.model.game)

    def _think(self) -> None:
        """Plays the stroke of the program whose turn it is, when its thread has found it.

        A level first shows its shot without the noise of the stroke.
        """
        work, player = self._work, self._players[self.model.game.state.player]
        assert player is not None
        level = player if isinstance(player, LevelPlayer) else None
        if work and self._plans and self._plans[-1] is not self._seen:
            self._seen = self._plans[-1]
            self._do(act.consider, self._seen)
        model = self.model
        if work is None:
            self._plans = plans = []  # of this thread
            (rng,), intend = self._rng.spawn(1), level.intend if level else player
            played = model.setup, model.game, model.max_speed
            situation = game_situation(*played)._replace(watch=plans.append, observe=lambda: game_observation(*played))
            self._start(lambda: stroke_of(intend, situation, rng))
        elif not work.done():
            if time.monotonic() - work.start > model.clock + 1:
                self.model = tick(model, 1.0)  # once per second, because the window shows whole seconds
        elif level and model.preview is None and work.result().call.kind not in act.NO_SHOT:
            self._do(act.aim_like, work.result())
            work.start = time.monotonic()
        elif model.preview is None or time.monotonic() - work.start >= INTENT:
            stroke: Stroke = work.result()
            if level:
                stroke = with_noise(stroke, level.noise, model.max_speed, self._rng.spawn(1)[0])
            self.model = shoot(model, stroke)

    def find_pot(self) -> None:
        """Starts a thread that finds the aim for the ball and the pocket under the mouse."""
        model = self.model
        if not has_derivatives(model.setup.scene):  # `aim` needs them
            self.message = "no aim help for flights"
            return
        pot = pot_at(model, self._view.point_of(self._mouse)) if model.phase == "aiming" else None
        self.message = "" if pot else "point at a ball or a pocket"
        if pot:
            self._start(lambda: (stroke_for(model, pot), ""))

    def find_plan(self) -> None:
        """Starts a thread that finds the best shot for a person."""

        def find() -> tuple[Stroke, str]:
            best = plan(model.setup, model.game, model.max_speed, rng, HINT_TIME, noise=EXPECTED)
            return best.stroke, labels.advice(model, best)

        model, (rng,) = self.model, self._rng.spawn(1)
        if model.phase in ("placing", "aiming"):
            self.message = "thinking"
            self._start(find)

    def _take_hint(self) -> None:
        """Aims as the thread has found. During a replay the thread may be that of a program, whose turn it is."""
        if self.model.phase in ("placing", "aiming") and self._work is not None and self._work.done():
            stroke, text = self._work.result()
            self.message, self._work = text if stroke else "no pot found", None
            self.model = act.aim_like(self.model, stroke) if stroke else self.model

    def quit(self, _: object = None) -> None:
        """Closes the window, but asks first if the game is not saved. A second call closes it."""
        self.open = self.ask and not self.asking and not self.saved
        if self.open:
            self._do(act.toggle_page, "unsaved")

    def answer_save(self) -> None:
        """Saves the game, and then quits if that is the answer to the question."""
        asked = self.asking
        self.save()
        if asked:
            self.open = not self.saved
            self._do(act.toggle_page, "unsaved")

    def begin_again(self) -> None:
        """Starts a game with the same settings after the end of one; the old one is no longer saved."""
        model = self.model
        if model.phase == "over":
            history = History(model.setup, opening(model.setup, self._rng), ())
            self.model = begin(history, model.players, model.max_speed, model.ghost_dt, model.pace, model.choices)

    def _do(self, action: Callable[..., WindowModel], *args: Any) -> None:
        self.model = action(self.model, *args)

    def _expose(self, _: object) -> None:
        self._shown = None

    def _key(self, event: pygame.event.Event) -> None:
        """Handles a key. While a question is shown, a key that is no answer removes it."""
        self.message = ""
        key = pygame.key.name(event.key)
        held = [f"{name} {key}" for name, mask in _MODIFIERS.items() if event.mod & mask]
        action, *arguments = next((COMMANDS[one] for one in (*held, key, event.unicode) if one in COMMANDS), ("",))
        leaves = key == "escape" or (self.asking and action not in ("answer_save", "quit"))
        if self.model.page and leaves:
            self._do(act.toggle_page, self.model.page)
        elif isinstance(action, str):
            getattr(self, action, lambda: None)()
        else:
            share = _share(event.mod)
            self._do(action, *(share * one if isinstance(one, float) else one for one in arguments))

    def _press(self, event: pygame.event.Event) -> None:
        """Handles the left button: it presses a control, aims, places the cue ball or continues."""
        if event.button != 1:
            return
        self.message, control, phase = "", self._view.panel.at(event.pos), self.model.phase
        if control == "shoot" and phase == "over" and not self.model.page:
            self.begin_again()
        elif self.model.page or control == "shoot" or (phase != "aiming" and control is None):
            self._do(act.go)
        elif phase == "aiming":
            double = control == "ball" and time.monotonic() - self._clicked < DOUBLE_CLICK
            self._clicked = time.monotonic() if control == "ball" else -1.0
            self._dragged = None if double else control or self._part_at(event.pos)
            if double:
                self._do(act.level)
            elif self._dragged != "arrow":
                self._drag(event.pos)

    def _release(self, event: pygame.event.Event) -> None:
        self._dragged = None if event.button == 1 else self._dragged

    def _point(self, event: pygame.event.Event) -> None:
        """Handles the motion of the mouse: it drags a part and moves a cue ball in hand."""
        self._mouse = event.pos
        if self.asking:
            return
        self._drag(event.pos)
        self._do(act.move_to, self._view.point_of(event.pos))

    def _wheel(self, event: pygame.event.Event) -> None:
        if self.asking:
            return
        action, step = (act.turn_aim, 0.01) if self.model.zoom else (act.change_speed, 0.1)
        self._do(action, step * _share(pygame.key.get_mods()) * event.y)

    def _drag(self, pixel: tuple[int, int]) -> None:
        """Moves the part that the mouse drags."""
        aim, part = self.model.aim, self._dragged
        if part in ("arrow", "table"):
            self._do(act.look_at, self._view.point_of(pixel), part == "arrow")
        elif part is not None:
            across, up = self._view.panel.share(part, pixel)
            if part == "ball":
                self._do(act.set_tip, 1 - 2 * across, 2 * up - 1)
            elif part == "elevation":
                self._do(act.raise_cue, STEEPEST * up - aim.elevation)
            else:
                self._do(act.change_speed, self.model.max_speed * across - aim.speed)

    def _part_at(self, pixel: tuple[int, int]) -> str | None:
        """Returns the part of the table at a pixel in the phase "aiming": the "arrow", the "table" or None."""
        model, view, (x, y) = self.model, self._view, self._view.point_of(pixel)
        radius, cue = model.setup.scene.balls.radius[model.cue], np.array(model.cue_position)
        tip = cue + (ARROW * model.aim.speed + ARROW_START * radius) * model.aim.along
        ball, tip = (float(np.hypot(*(view.pixels_of(place) - pixel))) for place in (cue, tip))
        if ball < view.canvas.scale * radius + GRIP or tip < GRIP:
            return "arrow"
        table = model.setup.scene.table
        return "table" if abs(x) <= table.length / 2 and abs(y) <= table.width / 2 else None


EVENTS: dict[int, Callable[[GameWindow, Any], None]] = {
    pygame.QUIT: GameWindow.quit,
    **dict.fromkeys((pygame.VIDEOEXPOSE, pygame.WINDOWRESTORED), GameWindow._expose),
    pygame.KEYDOWN: GameWindow._key,
    pygame.MOUSEBUTTONDOWN: GameWindow._press,
    pygame.MOUSEBUTTONUP: GameWindow._release,
    pygame.MOUSEMOTION: GameWindow._point,
    pygame.MOUSEWHEEL: GameWindow._wheel,
}
"""The handler of each kind of event."""


def _share(modifiers: int) -> float:
    """Returns the share of a step that a key takes with its modifiers."""
    return 0.1 if modifiers & pygame.KMOD_SHIFT else 1.0
