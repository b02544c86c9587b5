"""The state of the game window as plain data. Actions, such as `go`, and `tick` take a `Model` and return the next one.

The phases of a model are:

* "placing": a person moves the cue ball in hand; `go` places it.
* "aiming": a person sets the direction and the speed; `go` shoots.
* "thinking": it is a program's turn; the window calls the program and then `shoot`. Its clock is the time since then.
* "rolling": the shot is shown; `go` skips to its end.
* "replaying": the last shot is shown again, optionally with the same shot by the other engine as a ghost, until `go`.
* "over": the game is over.

An action that does not apply in the present phase returns the same model.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from billiards_env import strike
from billiards_env.checks import MAX_SPEED, Range, real
from billiards_env.drawing.orientation import VISIBLE, turning
from billiards_env.drawing.pace import faster, slower
from billiards_env.drawing.style import ARROW, ARROW_START
from billiards_env.engine import PIC, Engine
from billiards_env.games import GameState, History, PlayedShot, Setup, Stroke, play
from billiards_env.games.placement import Point, cue_ball_point
from billiards_env.play.controls import STEEPEST, on_face
from billiards_env.play.preview import Preview, make_preview
from billiards_env.shots.result import ShotResult
from billiards_env.shots.simulation import run_shot

HUMAN = "human"
"""The name of a player who is a person."""

PACES = Range(1e-3, 1e3)
"""The range of the playback speed over real time."""

LEAST_SPEED, USUAL_SPEED, BREAK_SHARE = 0.05, 2.0, 0.9
"""The slowest speed and the initial speed of an aim, m/s; the initial speed of a break over `max_speed`."""


TIP_SHARE = 0.999
"""The largest offset of the cue's tip over that at which it slips."""


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Model:
    """The state of a game in the window.

    Attributes:
        setup: The settings of the game.
        players: The name of each player; `HUMAN` for a person.
        max_speed: Speed of the fastest shot, m/s.
        ghost_dt: The timestep of PIT for the ghost, s. If the game itself uses PIT, the ghost uses PIC.
        games: The state before each stroke, and the present one.
        strokes: The strokes up to now.
        undone: The strokes that were undone, each with the state after it, the next one first.
        phase: One of the phases in the module's docstring.
        angle: Direction of the aim, radians from the x axis.
        speed: Speed of the aim, m/s: that of the ball after a level stroke at its centre.
        tip: Offset of the cue's tip from the centre of the ball to the left and up, in ball radii.
        elevation: Elevation of the cue, degrees.
        place: Position of the cue ball in hand, m; None if it is not in hand.
        preview: The preview of the aimed shot; None in other phases.
        last_shot: The last shot; None before the first.
        comparison: The last shot by the other engine; None until the first replay.
        clock: Time within the shot that is shown, or time that a program has been thinking, s.
        pace: Playback speed over real time.
        ghost: Whether a replay shows `comparison`.
        help: Whether the help is shown.
        faces: (n, 4) the present orientations of the balls; None for upright balls.
        first_faces: (n, 4) those at the start of the last shot.
    """

    setup: Setup
    players: tuple[str, ...]
    max_speed: float
    ghost_dt: float
    games: tuple[GameState, ...]
    strokes: tuple[Stroke, ...] = ()
    undone: tuple[tuple[Stroke, GameState], ...] = ()
    phase: str = "thinking"
    angle: float = 0.0
    speed: float = USUAL_SPEED
    tip: Point = (0.0, 0.0)
    elevation: float = 0.0
    place: Point | None = None
    preview: Preview | None = None
    last_shot: PlayedShot | None = None
    comparison: ShotResult | None = None
    clock: float = 0.0
    pace: float = 1.0
    ghost: bool = True
    help: bool = False
    faces: NDArray[np.float64] | None = None
    first_faces: NDArray[np.float64] | None = None

    @property
    def game(self) -> GameState:
        """The present state of the game."""
        return self.games[-1]

    @property
    def cue(self) -> int:
        """The number of the ball to be struck next."""
        return self.game.state.cue_balls[0]

    @property
    def cue_position(self) -> Point:
        """The position of that ball, m."""
        x, y = self.game.positions[self.cue].tolist() if self.place is None else self.place
        return x, y

    @property
    def stroke(self) -> Stroke:
        """The aimed stroke."""
        if not self.has_spin:
            velocity = self.speed * math.cos(self.angle), self.speed * math.sin(self.angle)
            return Stroke(velocity=velocity, place=self.place)
        scene, (side, top) = self.setup.scene, self.tip
        level = strike(scene, 1.0, 0.0).velocity[0]
        made = strike(scene, self.speed / level, self.angle, side, top, math.radians(self.elevation))
        return Stroke(velocity=tuple(made.velocity.tolist()), spin=tuple(made.spin.tolist()), place=self.place)

    @property
    def has_spin(self) -> bool:
        """Whether the balls of the scene have spin."""
        return self.setup.scene.physics.motion == "sliding"

    @property
    def history(self) -> History:
        """The game up to now."""
        return History(self.setup, self.games[0], self.strokes)

    @property
    def shown_shots(self) -> tuple[ShotResult, ShotResult | None]:
        """The shot that is shown, and its ghost if it has one."""
        assert self.last_shot is not None
        return self.last_shot.shot, self.comparison if self.phase == "replaying" and self.ghost else None

    @property
    def duration(self) -> float:
        """Duration of the shown shots, s."""
        return max(shot.time for shot in self.shown_shots if shot is not None)


def begin(history: History, players: tuple[str, ...], max_speed: float, ghost_dt: float, pace: float = 1.0) -> Model:
    """Returns the model of a new or continued game; `Model` describes the arguments.

    Raises:
        ValueError: If the number of players is wrong, a stroke cannot be played, or a number is outside its range.
    """
    setup = history.setup
    max_speed = real("max_speed", max_speed, Range(LEAST_SPEED, MAX_SPEED, "m/s"))
    ghost_dt = real("dt", ghost_dt, "dt")
    pace = real("pace", pace, PACES)
    if len(players) != setup.n_players:
        raise ValueError(f"players = {', '.join(players)}: expected {setup.n_players} players")
    games, last_shot = [history.opening], None
    for stroke in history.strokes:
        last_shot = play(setup, games[-1], stroke)
        games.append(last_shot.game)
    return _next_turn(
        Model(setup, players, max_speed, ghost_dt, tuple(games), history.strokes, last_shot=last_shot, pace=pace)
    )


def tick(model: Model, seconds: float) -> Model:
    """Returns the model `seconds` later; the same object if nothing changes. The help stops a shown shot."""
    if model.phase == "thinking":
        return dataclasses.replace(model, clock=model.clock + seconds)
    if model.phase not in ("rolling", "replaying") or model.help:
        return model
    if model.clock + model.pace * seconds < model.duration:
        return dataclasses.replace(model, clock=model.clock + model.pace * seconds)
    if model.phase == "rolling":
        recording = model.shown_shots[0].recording()
        faces = turning(recording, model.first_faces, VISIBLE).at(recording.time)
        return _next_turn(dataclasses.replace(model, faces=faces))
    return model if model.clock == model.duration else dataclasses.replace(model, clock=model.duration)


def shoot(model: Model, stroke: Stroke) -> Model:
    """Plays a stroke in phase "aiming" or "thinking", and returns the model in phase "rolling".

    Raises:
        ValueError: As `games.play` does.
    """
    played = play(model.setup, model.game, stroke)
    return dataclasses.replace(
        model,
        games=(*model.games, played.game),
        strokes=(*model.strokes, stroke),
        undone=(),
        last_shot=played,
        comparison=None,
        phase="rolling",
        preview=None,
        clock=0.0,
        first_faces=model.faces,
    )


def _next_turn(model: Model) -> Model:
    """Returns the model at the start of the next turn; the first aim is full on the nearest legal ball."""
    state = model.game.state
    model = dataclasses.replace(model, place=None, preview=None, clock=0.0, tip=(0.0, 0.0), elevation=0.0)
    if state.over:
        return dataclasses.replace(model, phase="over")
    if model.players[state.player] != HUMAN:
        return dataclasses.replace(model, phase="thinking")
    if state.in_hand != "no":
        head_spot = model.setup.scene.table.head_x, 0.0
        return move_to(dataclasses.replace(model, phase="placing", speed=_first_speed(model)), head_spot)
    return _with_aim(model, _first_angle(model), _first_speed(model))


def _first_speed(model: Model) -> float:
    if model.game.state.break_shot and model.setup.game_rules.pockets:
        return BREAK_SHARE * model.max_speed
    return min(USUAL_SPEED, model.max_speed)


def _first_angle(model: Model) -> float:
    state = model.game.state
    balls = sorted(model.setup.game_rules.legal(state, state.player) or state.object_balls)
    offsets = model.game.positions[balls] - model.cue_position
    x, y = offsets[np.argmin(np.hypot(offsets[:, 0], offsets[:, 1]))].tolist()
    return math.atan2(y, x)


def _with_aim(model: Model, angle: float, speed: float) -> Model:
    speed = min(max(speed, LEAST_SPEED), model.max_speed)
    model = dataclasses.replace(model, phase="aiming", angle=math.remainder(angle, math.tau), speed=speed)
    return dataclasses.replace(model, preview=make_preview(model.setup, model.game, model.stroke))


def _only(phase: str) -> Callable[[Callable[..., Model]], Callable[..., Model]]:
    """Returns a decorator of an action that has no effect in other phases."""

    def decorate(action: Callable[..., Model]) -> Callable[..., Model]:
        @functools.wraps(action)
        def act(model: Model, *args: Any) -> Model:
            return action(model, *args) if model.phase == phase else model

        return act

    return decorate


@_only("placing")
def move_to(model: Model, point: Point) -> Model:
    """Moves the cue ball in hand to the free point nearest to a point, m."""
    positions, state, _ = model.game
    point = cue_ball_point(model.setup.scene, positions, state, point)
    return dataclasses.replace(model, place=point)


def move_by(model: Model, offset: Point) -> Model:
    """Moves the cue ball in hand by an offset, m."""
    return move_to(model, tuple(np.add(model.cue_position, offset).tolist()))


@_only("aiming")
def turn_aim(model: Model, degrees: float) -> Model:
    """Turns the aim counterclockwise."""
    return _with_aim(model, model.angle + math.radians(degrees), model.speed)


@_only("aiming")
def change_speed(model: Model, change: float) -> Model:
    """Increases the speed of the shot by `change`, m/s."""
    return _with_aim(model, model.angle, model.speed + change)


@_only("aiming")
def set_speed(model: Model, share: float) -> Model:
    """Sets the speed of the shot to a share of the fastest."""
    return _with_aim(model, model.angle, share * model.max_speed)


@_only("aiming")
def look_at(model: Model, point: Point) -> Model:
    """Aims at a point, m, with the same speed."""
    dx, dy = np.subtract(point, model.cue_position).tolist()
    return _with_aim(model, math.atan2(dy, dx), model.speed)


@_only("aiming")
def aim_at(model: Model, point: Point) -> Model:
    """Moves the tip of the aiming arrow to a point, m."""
    dx, dy = np.subtract(point, model.cue_position).tolist()
    radius = model.setup.scene.balls.radius[model.cue]
    return _with_aim(model, math.atan2(dy, dx), (math.hypot(dx, dy) - ARROW_START * radius) / ARROW)


@_only("aiming")
def set_tip(model: Model, side: float, top: float) -> Model:
    """Sets the offset of the cue's tip, to the left and up, in ball radii. It stays where the tip does not slip."""
    if not model.has_spin:
        return model
    tip = on_face(side, top, TIP_SHARE * model.setup.scene.cue.miscue_offset)
    return _with_aim(dataclasses.replace(model, tip=tip), model.angle, model.speed)


def move_tip(model: Model, side: float, top: float) -> Model:
    """Moves the cue's tip by an offset to the left and up, in ball radii."""
    return set_tip(model, *np.add(model.tip, (side, top)).tolist())


@_only("aiming")
def set_elevation(model: Model, degrees: float) -> Model:
    """Sets the elevation of the cue."""
    if not model.has_spin:
        return model
    elevation = min(max(degrees, 0.0), STEEPEST)
    return _with_aim(dataclasses.replace(model, elevation=elevation), model.angle, model.speed)


@_only("aiming")
def level(model: Model) -> Model:
    """Levels the cue and moves its tip to the centre of the ball."""
    return _with_aim(dataclasses.replace(model, tip=(0.0, 0.0), elevation=0.0), model.angle, model.speed)


def go(model: Model) -> Model:
    """Places the cue ball, shoots, skips to the end of the shot, ends the replay, or closes the help."""
    if model.help:
        return toggle_help(model)
    if model.phase == "placing":
        return _with_aim(model, _first_angle(model), model.speed)
    if model.phase == "aiming":
        return shoot(model, model.stroke)
    if model.phase == "rolling":
        return tick(model, math.inf)
    return _next_turn(model) if model.phase == "replaying" else model


@_only("aiming")
def place(model: Model) -> Model:
    """Takes the cue ball in hand again."""
    return model if model.place is None else dataclasses.replace(model, phase="placing", preview=None)


def undo(model: Model) -> Model:
    """Returns the model before the last shot of a person; unchanged if there is no such shot."""
    for k in range(len(model.strokes) - 1, -1, -1):
        if model.players[model.games[k].state.player] == HUMAN:
            undone = (*zip(model.strokes[k:], model.games[k + 1 :], strict=True), *model.undone)
            return _restored(model, model.games[: k + 1], model.strokes[:k], undone)
    return model


def redo(model: Model) -> Model:
    """Returns the model at the next turn of a person, after undone strokes; unchanged if there are none."""
    while model.undone:
        (stroke, game), *undone = model.undone
        model = _restored(model, (*model.games, game), (*model.strokes, stroke), tuple(undone))
        if model.phase != "thinking":
            break
    return model


def _restored(
    model: Model,
    games: tuple[GameState, ...],
    strokes: tuple[Stroke, ...],
    undone: tuple[tuple[Stroke, GameState], ...],
) -> Model:
    """Returns the model at the start of a turn of the past."""
    last_shot = play(model.setup, games[-2], strokes[-1]) if strokes else None
    return _next_turn(
        dataclasses.replace(model, games=games, strokes=strokes, undone=undone, last_shot=last_shot, comparison=None)
    )


def replay(model: Model) -> Model:
    """Shows the last shot again, with the same shot by the other engine."""
    if model.last_shot is None:
        return model
    comparison = model.comparison
    if comparison is None:
        engine = Engine("pit", model.ghost_dt) if model.setup.mode == "pic" else PIC
        comparison = run_shot(model.setup.scene, model.last_shot.shot_input, engine, record=True)
    return dataclasses.replace(model, comparison=comparison, phase="replaying", preview=None, clock=0.0)


def toggle_ghost(model: Model) -> Model:
    """Shows or hides the shot by the other engine in replays."""
    return dataclasses.replace(model, ghost=not model.ghost)


def toggle_help(model: Model) -> Model:
    """Shows or hides the help."""
    return dataclasses.replace(model, help=not model.help)


def slow_down(model: Model) -> Model:
    """Shows shots slower."""
    return dataclasses.replace(model, pace=slower(model.pace))


def speed_up(model: Model) -> Model:
    """Shows shots faster."""
    return dataclasses.replace(model, pace=faster(model.pace))
