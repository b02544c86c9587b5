"""The state of the game window as plain data.

Actions, such as `go`, and `tick` take a `WindowModel` and return the next one.

The phases of a model are:

* "placing": a person moves the cue ball in hand; `go` places it.
* "aiming": a person sets the direction and the speed, and may choose another call; `go` shoots.
* "thinking": it is a program's turn; the window calls the program and then `shoot`. The clock is the time since the
  turn began.
* "rolling": the shot is shown; `go` skips to its end.
* "replaying": the last shot is shown again until `go`, optionally with the same shot by the other engine as a ghost.
* "over": the game is over.

An action that does not apply in the present phase returns the same model.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_env import strike
from billiards_env.drawing.orientation import VISIBLE
from billiards_env.drawing.recording import recording_of
from billiards_env.drawing.style import ARROW, ARROW_START
from billiards_env.engine import PIC, Engine
from billiards_env.engine.strikes import level_strike
from billiards_env.games import NO_CALL, Call, GameState, History, PlayedShot, Setup, Stroke, play
from billiards_env.games.game_state import NO_SHOT, is_in, members, on_table
from billiards_env.games.placement import Point, cue_ball_point
from billiards_env.play.preview import Preview, make_preview
from billiards_env.players.aim import FirstTouch, Pot, aim
from billiards_env.players.planner import Plan
from billiards_env.shots.result import ShotResult
from billiards_env.shots.simulation import run_shot
from billiards_env.support.checks import MAX_SPEED, Range, real

HUMAN = "human"
"""The name of a player who is a person."""

PACES = Range(1e-3, 1e3)
"""The range of the playback speed over real time."""

LEAST_SPEED, USUAL_SPEED, BREAK_SHARE = 0.05, 2.0, 0.9
"""The slowest speed and the initial speed of an aim, m/s; the initial speed of a break over `max_speed`."""

TIP_SHARE, TIP_STEP = 0.999, 0.05
"""The largest offset of the cue's tip over that at which it slips; a step of the tip in ball radii."""

STEEPEST = 90.0
"""degrees. The largest elevation of the cue."""

REACH = 1.5
"""A pocket or a ball is under the mouse within this distance of its centre, over its radius."""

SHOTS = 3_000
"""The largest number of random shots to aim for a pot. Around a rack of 15 balls they take some seconds."""

CONSIDERED = 4
"""The largest number of shots of a program that are shown while it thinks."""


class StrokeInput(NamedTuple):
    """What a person sets before a shot.

    Attributes:
        angle: Direction, radians from the x axis.
        speed: The speed of the ball after a level stroke at its centre, m/s.
        tip: Offset of the cue's tip from the centre of the ball to the left and up, in ball radii.
        elevation: Elevation of the cue, degrees.
        place: Position of the cue ball in hand, m; None if it is not in hand.
        call: The call. Its ball and pocket are -1 if the person has not chosen them.
    """

    angle: float = 0.0
    speed: float = USUAL_SPEED
    tip: Point = (0.0, 0.0)
    elevation: float = 0.0
    place: Point | None = None
    call: Call = NO_CALL

    @property
    def along(self) -> NDArray[np.float64]:
        """The direction as a unit vector (2,)."""
        return np.array([math.cos(self.angle), math.sin(self.angle)])


class Considered(NamedTuple):
    """A shot that a program considers.

    Attributes:
        plan: The shot and its value.
        preview: Its predicted start.
    """

    plan: Plan
    preview: Preview


class Turn(NamedTuple):
    """A played stroke with its aim: the person's aim, or the aim with a level cue."""

    stroke: Stroke
    played: PlayedShot
    aim: StrokeInput


@dataclass(frozen=True, slots=True, eq=False)
class WindowModel:
    """The state of a game in the window.

    Attributes:
        setup: The settings of the game.
        players: The name of each player; `HUMAN` for a person.
        max_speed: Speed of the fastest shot, m/s.
        ghost_dt: The timestep of PIT for the ghost, s. If the game itself uses PIT, the ghost uses PIC.
        opening: The state before the first stroke.
        choices: Whether people are offered choices other than a shot, such as to pass, `RulesState.choices`.
        turns: The strokes up to now.
        phase: One of the phases in the module's docstring.
        aim: The aim.
        preview: The preview of the aimed shot; None in other phases.
        considered: The shots that the program considers in its turn, the best first.
        comparison: The last shot by the other engine; None until the first replay.
        clock: Time within the shot that is shown, or time that a program has been thinking, s.
        pace: Playback speed divided by real time.
        ghost: Whether a replay shows `comparison`.
        page: The page that covers the table: "keys", "rules", "unsaved", the question before the window closes, or "".
        zoom: Whether the ball that the aimed shot touches first is shown enlarged.
        faces: (n, 4) the present orientations of the balls; None for upright balls.
        first_faces: (n, 4) those at the start of the last shot.
    """

    setup: Setup
    players: tuple[str, ...]
    max_speed: float
    ghost_dt: float
    opening: GameState
    choices: bool = False
    turns: tuple[Turn, ...] = ()
    phase: str = "thinking"
    aim: StrokeInput = field(default_factory=StrokeInput)
    preview: Preview | None = None
    considered: tuple[Considered, ...] = ()
    comparison: ShotResult | None = None
    clock: float = 0.0
    pace: float = 1.0
    ghost: bool = True
    page: str = ""
    zoom: bool = False
    faces: NDArray[np.float64] | None = None
    first_faces: NDArray[np.float64] | None = None

    @property
    def games(self) -> tuple[GameState, ...]:
        """The state before each stroke, and the present one."""
        return self.opening, *(turn.played.game for turn in self.turns)

    @property
    def game(self) -> GameState:
        """The present state of the game."""
        return self.turns[-1].played.game if self.turns else self.opening

    @property
    def strokes(self) -> tuple[Stroke, ...]:
        """The strokes up to now."""
        return tuple(turn.stroke for turn in self.turns)

    @property
    def last_shot(self) -> PlayedShot | None:
        """The last shot; None before the first."""
        return self.turns[-1].played if self.turns else None

    @property
    def cue(self) -> int:
        """The number of the ball to be struck next."""
        return int(self.game.state.cue_balls[0])

    @property
    def cue_position(self) -> Point:
        """The position of that ball, m."""
        x, y = self.game.positions[self.cue].tolist() if self.aim.place is None else self.aim.place
        return x, y

    @property
    def aimed(self) -> Preview | None:
        """The preview; None also for a call without a shot."""
        return None if self.aim.call.kind in NO_SHOT else self.preview

    @property
    def kinds(self) -> tuple[str, ...]:
        """The kinds of calls that the player has, "shot" first."""
        kinds = self.setup.kinds(self.game.state)
        return kinds if self.choices else tuple(kind for kind in kinds if kind in ("shot", "safety"))

    @property
    def following_kind(self) -> str:
        """The kind of call after the present one."""
        return self.kinds[(self.kinds.index(self.aim.call.kind) + 1) % len(self.kinds)]

    @property
    def call(self) -> Call:
        """The call of the aimed stroke. In called shots it is the aimed ball and pocket if none was chosen."""
        call, aimed, state = self.aim.call, self.preview, self.game.state
        if not state.call_shot or state.break_shot or call.kind != "shot" or aimed is None:
            return call
        return Call(call.ball if call.ball >= 0 else aimed.ball, call.pocket if call.pocket >= 0 else aimed.pocket)

    @property
    def stroke(self) -> Stroke:
        """The aimed stroke."""
        if self.aim.call.kind in NO_SHOT:
            return Stroke((0.0, 0.0), call=self.aim.call)
        angle, speed, (side, top), elevation, place, _ = self.aim
        if not self.has_spin:
            return Stroke((speed * math.cos(angle), speed * math.sin(angle)), place, call=self.call)
        scene = self.setup.scene
        level = strike(scene, 1.0, 0.0).velocity[0]
        made = strike(scene, speed / level, angle, side, top, math.radians(elevation))
        return Stroke(tuple(made.velocity.tolist()), place, tuple(made.spin.tolist()), self.call)

    @property
    def has_spin(self) -> bool:
        """Whether the balls of the scene have spin."""
        return self.setup.scene.physics.motion == "sliding"

    @property
    def history(self) -> History:
        """The game up to now."""
        return History(self.setup, self.opening, self.strokes)

    @property
    def shown_shots(self) -> tuple[ShotResult, ShotResult | None]:
        """The shot that is shown, and its ghost if it has one."""
        assert self.last_shot is not None
        return self.last_shot.shot, self.comparison if self.phase == "replaying" and self.ghost else None

    @property
    def duration(self) -> float:
        """Duration of the shown shots, s."""
        return max(shot.time for shot in self.shown_shots if shot is not None)


def begin(
    history: History,
    players: tuple[str, ...],
    max_speed: float,
    ghost_dt: float,
    pace: float = 1.0,
    choices: bool = False,
) -> WindowModel:
    """Returns the model of a new or continued game; `WindowModel` describes the arguments.

    Raises:
        ValueError: If the number of players is wrong, a stroke cannot be played, or a number is outside its range.
    """
    setup = history.setup
    max_speed = real("max_speed", max_speed, Range(LEAST_SPEED, MAX_SPEED, "m/s"))
    ghost_dt = real("dt", ghost_dt, "dt")
    pace = real("pace", pace, PACES)
    if len(players) != setup.n_players:
        raise ValueError(f"players = {', '.join(players)}: expected {setup.n_players} players")
    model = WindowModel(setup, players, max_speed, ghost_dt, history.opening, choices, pace=pace)
    for stroke in history.strokes:
        model = shoot(model, stroke)
    return _next_turn(model)


def tick(model: WindowModel, seconds: float) -> WindowModel:
    """Returns the model `seconds` later; the same object if nothing changes. An open page pauses a shown shot."""
    if model.phase == "thinking":
        return replace(model, clock=model.clock + seconds)
    if model.phase not in ("rolling", "replaying") or model.page:
        return model
    if model.clock + model.pace * seconds < model.duration:
        return replace(model, clock=model.clock + model.pace * seconds)
    if model.phase == "rolling":
        recording = recording_of(model.shown_shots[0])
        faces = recording.turning(model.first_faces, VISIBLE).at(recording.time)
        return _next_turn(replace(model, faces=faces))
    return model if model.clock == model.duration else replace(model, clock=model.duration)


def shoot(model: WindowModel, stroke: Stroke, aim: StrokeInput | None = None) -> WindowModel:
    """Plays a stroke and returns the model in phase "rolling". The stroke of a person comes with its aim.

    Until the shot is over, the model has the aim of the stroke, so the controls show the stroke.

    Raises:
        ValueError: As `games.play` does.
    """
    aim = _level_aim(model, stroke) if aim is None else aim
    turns = (*model.turns, Turn(stroke, play(model.setup, model.game, stroke), aim))
    model = replace(model, aim=aim, turns=turns, comparison=None, preview=None, considered=(), clock=0.0)
    return replace(model, phase="rolling", first_faces=model.faces)


def _next_turn(model: WindowModel) -> WindowModel:
    """Returns the model at the start of the next turn; the first aim is full on the nearest legal ball."""
    state, rules = model.game.state, model.setup.game_rules
    breaks = state.break_shot and rules.pockets and not rules.has_spots
    speed = BREAK_SHARE * model.max_speed if breaks else min(USUAL_SPEED, model.max_speed)
    model = replace(model, aim=StrokeInput(speed=speed), preview=None, considered=(), clock=0.0)
    if state.over:
        return replace(model, phase="over")
    if model.players[state.player] != HUMAN:
        return replace(model, phase="thinking")
    if state.in_hand:
        return move_to(replace(model, phase="placing"), (model.setup.scene.table.head_x, 0.0))
    return _aim_at_nearest(model)


def _aim_at_nearest(model: WindowModel) -> WindowModel:
    offsets = model.game.positions[list(model.setup.legal(model.game.state))] - model.cue_position
    x, y = offsets[np.argmin(np.hypot(offsets[:, 0], offsets[:, 1]))].tolist()
    return _aimed(replace(model, phase="aiming"), angle=math.atan2(y, x))


def _aimed(model: WindowModel, **changes: Any) -> WindowModel:
    """Returns the model in phase "aiming" with changes of the aim, within their limits, and its preview."""
    aim = model.aim._replace(**changes)
    aim = aim._replace(
        angle=math.remainder(aim.angle, math.tau),
        speed=min(max(aim.speed, LEAST_SPEED), model.max_speed),
        tip=aim.tip if model.has_spin else (0.0, 0.0),
        elevation=min(max(aim.elevation, 0.0), STEEPEST * model.has_spin),
    )
    if model.phase != "aiming" or (aim == model.aim and model.preview is not None):
        return model
    model = replace(model, aim=aim._replace(call=NO_CALL), preview=None)
    return replace(model, aim=aim, preview=make_preview(model.setup, model.game, model.stroke))


def move_to(model: WindowModel, point: Point) -> WindowModel:
    """Moves the cue ball in hand to the free point nearest to a point, m."""
    if model.phase != "placing":
        return model
    positions, state, _ = model.game
    point = cue_ball_point(model.setup.scene, positions, state, point)
    return replace(model, aim=model.aim._replace(place=point))


def turn_aim(model: WindowModel, degrees: float) -> WindowModel:
    """Turns the aim counterclockwise."""
    return _aimed(model, angle=model.aim.angle + math.radians(degrees))


def change_speed(model: WindowModel, change: float) -> WindowModel:
    """Increases the speed of the shot by `change`, m/s."""
    return _aimed(model, speed=model.aim.speed + change)


def look_at(model: WindowModel, point: Point, arrow: bool = False) -> WindowModel:
    """Aims at a point, m, with the same speed, or with the speed at which the tip of the `arrow` is there."""
    dx, dy = np.subtract(point, model.cue_position).tolist()
    speed = (math.hypot(dx, dy) - ARROW_START * model.setup.scene.balls.radius[model.cue]) / ARROW
    return _aimed(model, angle=math.atan2(dy, dx), speed=speed if arrow else model.aim.speed)


def aim_like(model: WindowModel, made: Stroke) -> WindowModel:
    """Places the cue ball in hand and aims for a stroke with a level cue; the clock starts again.

    While a program chooses its shot, this shows the shot that it will play.
    """
    if model.phase not in ("placing", "aiming", "thinking"):
        return model
    preview = make_preview(model.setup, model.game, made)
    phase = "thinking" if model.phase == "thinking" else "aiming"
    return replace(model, phase=phase, aim=_level_aim(model, made), preview=preview, clock=0.0)


def consider(model: WindowModel, plans: Sequence[Plan]) -> WindowModel:
    """Shows the best shots that the program considers in this turn, and after them earlier shots of other pots."""
    if model.phase != "thinking":
        return model
    shots = [Considered(plan, make_preview(model.setup, model.game, plan.stroke)) for plan in plans]
    pots = [(plan.ball, plan.pocket) for plan in plans]
    shots += [shot for shot in model.considered if (shot.plan.ball, shot.plan.pocket) not in pots]
    return replace(model, considered=tuple(shots[:CONSIDERED]))


def _level_aim(model: WindowModel, made: Stroke) -> StrokeInput:
    """Returns the aim of a stroke with a level cue."""
    (x, y), place, _, call = made.velocity[:2], *made[1:]
    speed, heading, tip = math.hypot(x, y), math.atan2(y, x), [0.0, 0.0]
    if any(made.spin):
        cue, heading, *tip = level_strike(model.setup.scene, (x, y), made.spin)
        speed = cue * float(strike(model.setup.scene, 1.0, 0.0).velocity[0])
    return StrokeInput(math.remainder(heading, math.tau), speed, (tip[0], tip[1]), place=place, call=call)


def set_tip(model: WindowModel, side: float, top: float) -> WindowModel:
    """Sets the offset of the cue's tip, to the left and up, in ball radii, limited to where the tip does not slip."""
    share = min(1.0, TIP_SHARE * model.setup.scene.cue.miscue_offset / max(math.hypot(side, top), 1e-9))
    return _aimed(model, tip=(share * side, share * top))


def move_tip(model: WindowModel, x: float, y: float) -> WindowModel:
    """Moves the cue's tip by some steps to the right and up."""
    return set_tip(model, model.aim.tip[0] - TIP_STEP * x, model.aim.tip[1] + TIP_STEP * y)


def raise_cue(model: WindowModel, degrees: float) -> WindowModel:
    """Increases the elevation of the cue by some degrees."""
    return _aimed(model, elevation=model.aim.elevation + degrees)


def level(model: WindowModel) -> WindowModel:
    """Levels the cue and moves its tip to the centre of the ball."""
    return _aimed(model, tip=(0.0, 0.0), elevation=0.0)


def next_kind(model: WindowModel) -> WindowModel:
    """Selects the next kind of call that the player has."""
    if model.phase != "aiming":
        return model
    return replace(model, aim=model.aim._replace(call=Call(kind=model.following_kind)))


def next_called(model: WindowModel, name: str) -> WindowModel:
    """Calls the next "ball" that may be called or nominated, or the next "pocket", if the game has such a call."""
    state, call, setup = model.game.state, model.aim.call, model.setup
    possible = range(len(setup.scene.table.pockets)) if state.call_shot else ()
    if name == "ball":
        nominated = setup.legal(state) if getattr(state, "colour", False) or getattr(state, "free_ball", False) else ()
        possible = sorted(setup.callable(state) if state.call_shot else nominated)
    if model.phase != "aiming" or call.kind != "shot" or not possible:
        return model
    following = next((one for one in possible if one > getattr(model.call, name)), possible[0])
    return replace(model, aim=model.aim._replace(call=call._replace(**{name: following})))


def go(model: WindowModel) -> WindowModel:
    """Places the cue ball, shoots, skips to the end of the shot, ends the replay, or closes a page."""
    if model.page:
        return toggle_page(model, model.page)
    if model.phase == "aiming":
        return shoot(model, model.stroke, model.aim)
    if model.phase == "placing":
        return _aim_at_nearest(model)
    if model.phase == "rolling":
        return tick(model, math.inf)
    return _next_turn(model) if model.phase == "replaying" else model


def place(model: WindowModel) -> WindowModel:
    """Takes the cue ball in hand again."""
    held = model.phase == "aiming" and model.aim.place is not None
    return replace(model, phase="placing", preview=None) if held else model


def undo(model: WindowModel) -> WindowModel:
    """Returns the model before the last shot of a person, with the aim of this shot; unchanged if there is none."""
    for k in range(len(model.turns) - 1, -1, -1):
        if model.players[model.games[k].state.player] == HUMAN:
            aim = model.turns[k].aim
            model = _next_turn(replace(model, turns=model.turns[:k], comparison=None))
            return model if aim.call.kind in NO_SHOT else _aimed(replace(model, phase="aiming"), **aim._asdict())
    return model


def repeat(model: WindowModel) -> WindowModel:
    """Shows the last shot again, with the same shot by the other engine."""
    if model.last_shot is None:
        return model
    engine = Engine("pit", model.ghost_dt) if model.setup.engine == PIC else PIC
    other = model.comparison or run_shot(model.setup.scene, model.last_shot.shot_input, engine, record=True)
    return replace(model, comparison=other, phase="replaying", aim=model.turns[-1].aim, preview=None, clock=0.0)


def toggle(model: WindowModel, name: str) -> WindowModel:
    """Switches "ghost", the shot by the other engine in replays, or "zoom", the enlarged view of the object ball."""
    return replace(model, **{name: not getattr(model, name)})


def toggle_page(model: WindowModel, page: str) -> WindowModel:
    """Shows or hides a page."""
    return replace(model, page="" if model.page == page else page)


def change_pace(model: WindowModel, change: Callable[[float], float]) -> WindowModel:
    """Changes the pace of the playback with `slower` or `faster` of `drawing.pace`."""
    return replace(model, pace=change(model.pace))


def press_arrow(model: WindowModel, x: float, y: float) -> WindowModel:
    """Handles an arrow key: moves the cue ball by x and y cm, or turns the aim by -x degrees, or adds y / 10 m/s."""
    if model.phase == "placing":
        return move_to(model, tuple(np.add(model.cue_position, (0.01 * x, 0.01 * y)).tolist()))
    return turn_aim(model, -x) if x else change_speed(model, 0.1 * y)


def pot_at(model: WindowModel, point: Point) -> Pot | None:
    """Returns the pot at a point, m: a ball there into any pocket, or the ball that is aimed at into a pocket there."""
    places, radius, pockets = model.game.positions, model.setup.scene.balls.radius, model.setup.scene.table.pockets
    circles = [pocket.circle for pocket in pockets]
    holes = [k for k, (*centre, size) in enumerate(circles) if math.dist(centre, point) <= REACH * size]
    balls = [b for b in members(model.game.state.object_balls) if math.dist(places[b], point) <= REACH * radius[b]]
    if holes:
        return None if model.preview is None or model.preview.ball < 0 else Pot(model.preview.ball, holes[0])
    return Pot(balls[0]) if balls and pockets else None


def stroke_for(model: WindowModel, pot: Pot) -> Stroke | None:
    """Returns the stroke for a pot with a level cue and no english; None if there is none."""
    scene, positions = model.setup.scene, model.game.positions.copy()
    positions[model.cue] = model.cue_position
    in_play = is_in(on_table(model.game.state), scene.n_balls)
    options: Any = {"max_speed": model.max_speed, "in_play": in_play, "strike": model.has_spin, "shots": SHOTS}
    aimed = aim(scene, positions, (FirstTouch(pot.ball), pot), **options)
    x, y = aimed.velocity.tolist()
    return Stroke((x, y), model.aim.place, call=model.aim.call) if aimed.solved else None
