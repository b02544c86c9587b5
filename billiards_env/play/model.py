"""A game that is being played, as plain data: an input, or time going by, makes a new `Model` of an old one.

Phases and what leads from one to the next:

* "placing": a person moves the cue ball in hand; `Do("go")` puts it down.
* "aiming": a person turns and strengthens the aim; `Do("go")` shoots.
* "thinking": a program's turn; whoever runs it calls `shoot`.
* "rolling": the shot is shown; `Do("go")` skips to its end.
* "replaying": the last shot is shown again, if wanted with the other engine's version as a ghost, until `Do("go")`.
* "over": the game is decided.
"""

from __future__ import annotations

import dataclasses
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_env.checks import MAX_SPEED, Range, real
from billiards_env.drawing.recording import Recording
from billiards_env.drawing.style import ARROW, ARROW_START
from billiards_env.games import GameState, History, PlayedShot, Setup, Stroke, play
from billiards_env.games.placement import Point, cue_ball_point
from billiards_env.shot import ShotResult
from billiards_env.simulation import run_shot

HUMAN = "human"
"""The name of a player who is a person."""

LEAST_SPEED, USUAL_SPEED, BREAK_SHARE = 0.05, 2.0, 0.9
"""m/s: the slowest shot, and the one first offered; of a break, as a share of the fastest."""

PACES = (0.05, 0.1, 0.25, 0.5, 1.0, 2.0, 4.0)
"""How fast shots can be shown, over real time."""


class Turn(NamedTuple):
    """Turns the aim by so many degrees, counterclockwise."""

    degrees: float


class Strengthen(NamedTuple):
    """Makes the shot faster by so many m/s."""

    speed: float


class AimAt(NamedTuple):
    """Draws the arrow's tip to a place, m."""

    place: Point


class MoveTo(NamedTuple):
    """Moves the cue ball in hand to a place, m."""

    place: Point


class MoveBy(NamedTuple):
    """Moves the cue ball in hand by so much, m."""

    way: Point


class Do(NamedTuple):
    """One of "go", "place", "undo", "replay", "ghost", "help", "slower" and "faster"."""

    what: str


Input = Turn | Strengthen | AimAt | MoveTo | MoveBy | Do


class Preview(NamedTuple):
    """What the engine foresees of a shot.

    Attributes:
        path: (m, 2) m, the cue ball's way to the first ball it touches, or to its end.
        ball: That ball, -1 if there is none.
        struck: (2,) m/s, its velocity after the contact.
        cue: (2,) m/s, the cue ball's.
    """

    path: NDArray[np.float64]
    ball: int
    struck: NDArray[np.float64]
    cue: NDArray[np.float64]


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Model:
    """A game that is being played.

    Attributes:
        setup: What stays the same from shot to shot.
        players: Each player's name; `HUMAN` for a person.
        max_speed: Speed of the fastest shot, m/s.
        ghost_dt: The timestep of the ghost's PIT, s; where the game itself is played by PIT, the ghost is PIC's.
        games: The state before each stroke, and the present one.
        strokes: The strokes so far.
        phase: See the module's docstring.
        angle: Where the shot is aimed, radians from the x axis.
        speed: Its speed, m/s.
        place: Where the cue ball in hand is put, m; None if it is not in hand.
        preview: Of the shot as it is aimed; None while nobody aims.
        last: The last shot; None before the first.
        rival: The last shot as the other engine runs it; None until it has been asked for.
        clock: Seconds into the shot that is shown.
        pace: How fast shots are shown, over real time.
        ghost: Whether a replay shows the rival.
        help: Whether the help is shown.
    """

    setup: Setup
    players: tuple[str, ...]
    max_speed: float
    ghost_dt: float
    games: tuple[GameState, ...]
    strokes: tuple[Stroke, ...] = ()
    phase: str = "thinking"
    angle: float = 0.0
    speed: float = USUAL_SPEED
    place: Point | None = None
    preview: Preview | None = None
    last: PlayedShot | None = None
    rival: ShotResult | None = None
    clock: float = 0.0
    pace: float = 1.0
    ghost: bool = True
    help: bool = False

    @property
    def game(self) -> GameState:
        """The table as it is now."""
        return self.games[-1]

    @property
    def cue(self) -> int:
        """The ball to be struck."""
        return self.game.state.cue_balls[0]

    @property
    def cue_at(self) -> Point:
        """Where it lies, or is held, m."""
        x, y = self.game.positions[self.cue].tolist() if self.place is None else self.place
        return x, y

    @property
    def stroke(self) -> Stroke:
        """The stroke as it is aimed."""
        velocity = self.speed * math.cos(self.angle), self.speed * math.sin(self.angle)
        return Stroke(velocity, self.place)

    @property
    def history(self) -> History:
        """The game so far."""
        return History(self.setup, self.games[0], self.strokes)

    @property
    def shown(self) -> tuple[ShotResult, ShotResult | None]:
        """The shot that is rolling or replayed, and its ghost."""
        assert self.last is not None
        return self.last.shot, self.rival if self.phase == "replaying" and self.ghost else None

    @property
    def duration(self) -> float:
        """Of what is shown, s."""
        return max(shot.time for shot in self.shown if shot is not None)


def begin(history: History, players: tuple[str, ...], max_speed: float, ghost_dt: float, pace: float = 1.0) -> Model:
    """A game to be gone on with.

    Args:
        history: The game so far.
        players: Each player's name; `HUMAN` for a person.
        max_speed: Speed of the fastest shot, m/s.
        ghost_dt: The timestep of the ghost's PIT, s.
        pace: How fast shots are shown, over real time.

    Returns:
        The model.

    Raises:
        ValueError: If there are not as many players as in the game, a stroke cannot be played, or a number is outside
            its range.
    """
    setup = history.setup
    max_speed = real("max_speed", max_speed, Range(LEAST_SPEED, MAX_SPEED, "m/s"))
    ghost_dt = real("dt", ghost_dt, "dt")
    pace = real("pace", pace, Range(1e-3, 1e3))
    if len(players) != setup.n_players:
        raise ValueError(f"{len(players)} players: expected {setup.n_players}, as the game has")
    games, last = [history.opening], None
    for stroke in history.strokes:
        last = play(setup, games[-1], stroke)
        games.append(last.game)
    return _to_play(Model(setup, players, max_speed, ghost_dt, tuple(games), history.strokes, last=last, pace=pace))


def update(model: Model, user_input: Input) -> Model:
    """The model after an input; one that makes no sense in its phase does nothing.

    Args:
        model: The model.
        user_input: The input.

    Returns:
        The model after it.
    """
    if isinstance(user_input, Do):
        return _COMMANDS[user_input.what](model)
    if model.phase == "placing" and isinstance(user_input, MoveTo | MoveBy):
        x, y = user_input.place if isinstance(user_input, MoveTo) else np.add(model.cue_at, user_input.way).tolist()
        return dataclasses.replace(model, place=_free_place(model, (x, y)))
    if model.phase != "aiming":
        return model
    if isinstance(user_input, Turn):
        return _aimed(model, model.angle + math.radians(user_input.degrees), model.speed)
    if isinstance(user_input, Strengthen):
        return _aimed(model, model.angle, model.speed + user_input.speed)
    if isinstance(user_input, AimAt):
        dx, dy = np.subtract(user_input.place, model.cue_at).tolist()
        radius = model.setup.scene.balls.radius[model.cue]
        return _aimed(model, math.atan2(dy, dx), (math.hypot(dx, dy) - ARROW_START * radius) / ARROW)
    return model


def tick(model: Model, seconds: float) -> Model:
    """The model after so many seconds."""
    if model.phase not in ("rolling", "replaying"):
        return model
    model = dataclasses.replace(model, clock=min(model.clock + model.pace * seconds, model.duration))
    return _to_play(model) if model.phase == "rolling" and model.clock == model.duration else model


def shoot(model: Model, stroke: Stroke) -> Model:
    """The model with a stroke played, which begins to roll.

    Args:
        model: The model, in phase "aiming" or "thinking".
        stroke: The stroke.

    Returns:
        The model.

    Raises:
        ValueError: As `games.play` does.
    """
    played = play(model.setup, model.game, stroke)
    return dataclasses.replace(
        model,
        games=(*model.games, played.game),
        strokes=(*model.strokes, stroke),
        last=played,
        rival=None,
        phase="rolling",
        preview=None,
        clock=0.0,
    )


def foresee(setup: Setup, game: GameState, stroke: Stroke) -> Preview:
    """Runs a shot and tells where the cue ball first touches another.

    Args:
        setup: The game.
        game: The state of the game.
        stroke: The shot.

    Returns:
        The preview.
    """
    cue = game.state.cue_balls[0]
    shot = play(setup, game, stroke).shot
    recording = shot.recording()
    events = recording.events
    hits = events[(events["kind"] == "ball_ball") & ((events["ball"] == cue) | (events["other"] == cue))]
    ball, end = -1, min(recording.time, float(recording.gone[cue]))
    if len(hits):
        ball, end = int(hits["ball"][0] + hits["other"][0]) - cue, float(hits["time"][0])
    corners = recording.corners(cue)
    times = np.union1d(np.linspace(0.0, end, 60), corners[corners < end])
    # Just before it is potted: a ball in a pocket is at its middle.
    path = recording.path(cue, times if ball >= 0 or end == recording.time else times[:-1])
    return Preview(path, ball, *(_velocity(recording, i, end) if ball >= 0 else np.zeros(2) for i in (ball, cue)))


def _velocity(recording: Recording, ball: int, time: float) -> NDArray[np.float64]:
    """A ball's velocity just after an instant, (2,) m/s."""
    paths = recording.trajectory
    mine = np.flatnonzero(paths.ball == ball)
    return paths.velocity[mine[np.searchsorted(paths.start[mine], time, side="right") - 1]]


def _to_play(model: Model) -> Model:
    """The model with the player to shoot at the table, and a first aim: full at the nearest ball that may be hit."""
    state = model.game.state
    model = dataclasses.replace(model, place=None, preview=None, clock=0.0)
    if state.over:
        return dataclasses.replace(model, phase="over")
    if model.players[state.player] != HUMAN:
        return dataclasses.replace(model, phase="thinking")
    if state.in_hand != "no":
        head_spot = -model.setup.scene.table.length / 4, 0.0
        model = dataclasses.replace(model, phase="placing", place=_free_place(model, head_spot))
        return dataclasses.replace(model, speed=_first_speed(model))
    model = dataclasses.replace(model, phase="aiming", speed=_first_speed(model))
    return _aimed(model, _first_angle(model), model.speed)


def _first_speed(model: Model) -> float:
    if model.game.state.break_shot and model.setup.game_rules.pockets:
        return BREAK_SHARE * model.max_speed
    return min(USUAL_SPEED, model.max_speed)


def _first_angle(model: Model) -> float:
    state = model.game.state
    balls = sorted(model.setup.game_rules.legal(state, state.player) or state.object_balls)
    ways = model.game.positions[balls] - model.cue_at
    x, y = ways[np.argmin(np.hypot(ways[:, 0], ways[:, 1]))].tolist()
    return math.atan2(y, x)


def _free_place(model: Model, wish: Point) -> Point:
    positions, state = model.game
    return cue_ball_point(model.setup.scene, positions, state.object_balls, model.cue, wish, state.in_hand == "behind")


def _aimed(model: Model, angle: float, speed: float) -> Model:
    speed = min(max(speed, LEAST_SPEED), model.max_speed)
    model = dataclasses.replace(model, phase="aiming", angle=math.remainder(angle, math.tau), speed=speed)
    return dataclasses.replace(model, preview=foresee(model.setup, model.game, model.stroke))


def _go(model: Model) -> Model:
    if model.help:
        return _help(model)
    if model.phase == "placing":
        return _aimed(model, _first_angle(model), model.speed)
    if model.phase == "aiming":
        return shoot(model, model.stroke)
    if model.phase == "rolling":
        return tick(model, math.inf)
    return _to_play(model) if model.phase == "replaying" else model


def _place(model: Model) -> Model:
    if model.phase != "aiming" or model.place is None:
        return model
    return dataclasses.replace(model, phase="placing", preview=None)


def _undo(model: Model) -> Model:
    """Back to the last shot of a person; nothing if there is none."""
    for k in range(len(model.strokes) - 1, -1, -1):
        if model.players[model.games[k].state.player] == HUMAN:
            last = play(model.setup, model.games[k - 1], model.strokes[k - 1]) if k else None
            kept = {"games": model.games[: k + 1], "strokes": model.strokes[:k], "last": last, "rival": None}
            return _to_play(dataclasses.replace(model, **kept))
    return model


def _replay(model: Model) -> Model:
    if model.last is None:
        return model
    rival = model.rival
    if rival is None:
        mode, dt = ("pit", model.ghost_dt) if model.setup.mode == "pic" else ("pic", None)
        rival = run_shot(model.setup.scene, model.last.shot_input, mode, dt, record=True)
    return dataclasses.replace(model, rival=rival, phase="replaying", preview=None, clock=0.0)


def _ghost(model: Model) -> Model:
    return dataclasses.replace(model, ghost=not model.ghost)


def _help(model: Model) -> Model:
    return dataclasses.replace(model, help=not model.help)


def _slower(model: Model) -> Model:
    return dataclasses.replace(model, pace=max((p for p in PACES if p < model.pace), default=model.pace))


def _faster(model: Model) -> Model:
    return dataclasses.replace(model, pace=min((p for p in PACES if p > model.pace), default=model.pace))


_COMMANDS = {
    "go": _go,
    "place": _place,
    "undo": _undo,
    "replay": _replay,
    "ghost": _ghost,
    "help": _help,
    "slower": _slower,
    "faster": _faster,
}
