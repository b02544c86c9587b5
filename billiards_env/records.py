"""Shots and whole games as JSON files, which are checked when they are loaded and replay bit for bit.

```python
>>> from billiards_env import Scene, records
>>> record = records.record_shot(Scene.named("pool"), [[-0.635, 0.0], [0.635, 0.3]], [2.0, 0.45])
>>> records.from_json(records.to_json(record)) == record
True
>>> records.replay(record).potted.tolist()
[False, True]

```

A file holds what goes into a shot or a game, and how it ended, by which `replay` tells whether this machine and this
version of the engine give the same bits. Numbers are written with as many digits as give the same double again. A file
is data and nothing else: it names no code, and whatever is not as expected is refused with a `ValueError` that says
where.
"""

from __future__ import annotations

import dataclasses
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike

from billiards_env.checks import Range, real, short, whole
from billiards_env.engine import MAX_EVENTS, STATUS, ShotResult, check_mode, simulate
from billiards_env.engine.shot import check_shot
from billiards_env.files import replacing
from billiards_env.games.game import GameState, History, Setup, Stroke, custom_opening, play
from billiards_env.games.rules import RuleState
from billiards_env.scene import Scene

VERSION = 1
"""The version of the format that is written, and the newest that is read."""

MAX_BYTES = 4 * 2**20
"""A larger file is not read: parsed, it could take thirty times its size. A stroke takes some hundred bytes."""

MAX_BALLS = 1000
"""Nor is a scene of more balls."""

SHOT, GAME = "billiards_env/shot", "billiards_env/game"

Rows = tuple[tuple[float, ...], ...]


@dataclasses.dataclass(frozen=True, slots=True)
class ShotEnd:
    """How a shot ended, for comparison.

    Attributes:
        status: As in `ShotResult`.
        time: s.
        n_events: Number of events.
        positions: x and y of each ball, m.
        potted: One bool a ball.
    """

    status: str
    time: float
    n_events: int
    positions: Rows
    potted: tuple[bool, ...]


@dataclasses.dataclass(frozen=True, slots=True)
class ShotRecord:
    """What goes into a shot, and how it ended. The fields are the arguments of `simulate`.

    Attributes:
        scene: The scene.
        positions: x and y of each ball, m.
        velocities: x and y for each ball, m/s.
        spins: x, y and z for each ball, rad/s; None for none.
        in_play: One bool a ball.
        mode: The engine.
        dt: The timestep of "pit", s, else None.
        fix: As in `simulate`.
        max_time: s, None for the scene's.
        max_events: As in `simulate`.
        end: How it ended.
    """

    scene: Scene
    positions: Rows
    velocities: Rows
    spins: Rows | None
    in_play: tuple[bool, ...]
    mode: str
    dt: float | None
    fix: str | None
    max_time: float | None
    max_events: int
    end: ShotEnd


@dataclasses.dataclass(frozen=True, slots=True)
class GameEnd:
    """How a game, or the recorded part of it, ended, for comparison.

    Attributes:
        positions: x and y of each ball, m.
        on_table: The balls on the table.
        scores: Each player's.
        player: Whose turn it is.
        over: Whether the game is decided.
        winner: The player who has won, -1 for none.
    """

    positions: Rows
    on_table: tuple[int, ...]
    scores: tuple[int, ...]
    player: int
    over: bool
    winner: int


@dataclasses.dataclass(frozen=True, slots=True)
class GameRecord:
    """What goes into a game, and how it ended.

    Attributes:
        setup: What stays the same from shot to shot.
        positions: The table before the first stroke: x and y of each ball, m.
        state: And what the rules know of it.
        strokes: The strokes, in order.
        end: How it ended.
    """

    setup: Setup
    positions: Rows
    state: RuleState
    strokes: tuple[Stroke, ...]
    end: GameEnd

    @property
    def history(self) -> History:
        """The game as `games.replay` takes it."""
        return History(self.setup, GameState(np.array(self.positions), self.state), self.strokes)


Record = ShotRecord | GameRecord


def record_shot(
    scene: Scene,
    positions: ArrayLike,
    velocities: ArrayLike,
    *,
    mode: str = "pic",
    dt: float | None = None,
    fix: str | None = None,
    spins: ArrayLike | None = None,
    in_play: ArrayLike | None = None,
    max_time: float | None = None,
    max_events: int = MAX_EVENTS,
) -> ShotRecord:
    """Plays a shot and keeps what went into it.

    Args:
        scene: As in `simulate`.
        positions: As in `simulate`.
        velocities: As in `simulate`.
        mode: As in `simulate`.
        dt: As in `simulate`.
        fix: As in `simulate`.
        spins: As in `simulate`.
        in_play: As in `simulate`.
        max_time: As in `simulate`.
        max_events: As in `simulate`.

    Returns:
        The record, for `save`.

    Raises:
        ValueError: As `simulate` does.
    """
    check_mode(mode, dt, fix)
    whole("max_events", max_events, "max_events")
    if np.ndim(positions) != 2:
        raise ValueError(f"positions has shape {np.shape(positions)}: expected ({scene.n_balls}, 2), a row a ball")
    given = check_shot(scene, positions, velocities, spins, in_play, max_time)
    record = ShotRecord(
        scene=scene,
        positions=_rows(given.positions),
        velocities=_rows(given.velocities),
        spins=None if spins is None else _rows(given.spins),
        in_play=tuple(given.in_play.tolist()),
        mode=mode,
        dt=None if dt is None else float(dt),
        fix=fix,
        max_time=None if max_time is None else float(max_time),
        max_events=int(max_events),
        end=ShotEnd("rest", 0.0, 0, (), ()),
    )
    return dataclasses.replace(record, end=_end_of_shot(_run(record)))


def record_game(history: History) -> GameRecord:
    """Keeps a game.

    Args:
        history: The game so far, as `games.billiards_v0.raw_env.history` gives it.

    Returns:
        The record, for `save`.
    """
    return GameRecord(
        setup=history.setup,
        positions=_rows(history.opening.positions),
        state=history.opening.state,
        strokes=tuple(_plain(stroke) for stroke in history.strokes),
        end=_end_of_game(_play_again(history)),
    )


@overload
def replay(record: ShotRecord, *, check: bool = True, record_events: bool = False) -> ShotResult: ...


@overload
def replay(record: GameRecord, *, check: bool = True, record_events: bool = False) -> GameState: ...


def replay(record: Record, *, check: bool = True, record_events: bool = False) -> ShotResult | GameState:
    """Plays a recorded shot or game again.

    Args:
        record: The record.
        check: Whether to compare the end with the recorded one, bit for bit.
        record_events: Whether a shot keeps its events and trajectories; `games.replay(record.history)` gives those of a
            game's shots.

    Returns:
        The shot, or the table after the game's last stroke.

    Raises:
        ValueError: If the end is not the recorded one.
    """
    if isinstance(record, ShotRecord):
        shot = _run(record, record_events)
        if check:
            _compare(record.end, _end_of_shot(shot))
        return shot
    game = _play_again(record.history)
    if check:
        _compare(record.end, _end_of_game(game))
    return game


def save(path: str | os.PathLike[str], record: Record) -> None:
    """Writes a record to a file, whole or not at all; a file already there is replaced.

    Args:
        path: The file.
        record: The record.

    Raises:
        OSError: If the file cannot be written.
    """
    content = to_json(record).encode()
    with replacing(Path(path)) as temporary:
        temporary.write_bytes(content)


def load(path: str | os.PathLike[str]) -> Record:
    """Reads a record from a file and checks it; nothing is run.

    Args:
        path: The file.

    Returns:
        The record.

    Raises:
        OSError: If the file cannot be read.
        ValueError: If it is too large, is no such file, is of a newer version, or holds an impossible shot or game.
    """
    with open(path, "rb") as file:
        content = file.read(MAX_BYTES + 1)
    try:
        if len(content) > MAX_BYTES:
            raise ValueError(f"a file of more than {MAX_BYTES} bytes: expected at most {MAX_BYTES}")
        return from_json(content.decode("utf-8"))
    except ValueError as error:
        raise ValueError(f"{os.fspath(path)}: {error}") from error


def to_json(record: Record) -> str:
    """A record as JSON text, a line for each of its fields.

    Args:
        record: The record.

    Returns:
        The text.
    """
    from billiards_env import __version__

    data: dict[str, Any] = {"format": SHOT, "version": VERSION, "written_by": f"billiards_env {__version__}"}
    if isinstance(record, ShotRecord):
        for field in dataclasses.fields(record):
            data[field.name] = getattr(record, field.name)
        data["scene"] = record.scene.to_dict()
    else:
        setup = record.setup
        data["format"] = GAME
        for field in dataclasses.fields(setup):
            data[field.name] = getattr(setup, field.name)
        data["scene"] = setup.scene.to_dict()
        data["positions"] = record.positions
        state = record.state._asdict()
        data["state"] = {name: state[name] for name in _STATE} | {"on_table": sorted(state["on_table"])}
        data["strokes"] = [stroke._asdict() for stroke in record.strokes]
    data["end"] = dataclasses.asdict(record.end)
    lines = (f"  {json.dumps(key)}: {json.dumps(value, allow_nan=False)}" for key, value in data.items())
    return "{\n" + ",\n".join(lines) + "\n}\n"


def from_json(text: str) -> Record:
    """The record that a JSON text holds; see `load`.

    Args:
        text: The text.

    Returns:
        The record.

    Raises:
        ValueError: As `load` does.
    """
    if len(text) > MAX_BYTES:
        raise ValueError(f"a text of {len(text)} characters: expected at most {MAX_BYTES}")
    try:
        data = json.loads(text, object_pairs_hook=_unique, parse_constant=_no_constant)
    except RecursionError:
        raise ValueError("nested too deeply: expected the JSON of a shot or a game") from None
    kind = _mapping("the file", data).get("format")
    if kind not in (SHOT, GAME):
        raise ValueError(f"format = {short(kind)}: expected {SHOT!r} or {GAME!r}")
    version = data.get("version")
    if isinstance(version, bool) or not isinstance(version, int) or version < 1:
        raise ValueError(f"version = {short(version)}: expected a whole number >= 1")
    if version > VERSION:
        raise ValueError(
            f"version = {version}: expected at most {VERSION}; the file is of a newer version of billiards_env "
            f"({short(data.get('written_by'))})"
        )
    try:
        return _shot(data) if kind == SHOT else _game(data)
    except (TypeError, OverflowError, RecursionError) as error:  # of the wrong type, or a number too large for a float
        raise ValueError(str(error)) from error


# What a file is made of.
_HEAD = ("format", "version", "written_by", "scene", "mode", "dt", "fix", "positions", "end")
_SHOT_FIELDS = (*_HEAD, "velocities", "spins", "in_play", "max_time", "max_events")
_GAME_FIELDS = (*_HEAD, "rules", "n_players", "target", "state", "strokes")
_STATE = ("player", "scores", "on_table", "break_shot", "in_hand", "cue_balls", "solids")
_SHOT_END = tuple(field.name for field in dataclasses.fields(ShotEnd))
_GAME_END = tuple(field.name for field in dataclasses.fields(GameEnd))


def _shot(data: dict[str, Any]) -> ShotRecord:
    _fields("the file", data, _SHOT_FIELDS)
    scene, mode, dt, fix = _head(data)
    n = scene.n_balls
    positions = _numbers("positions", data["positions"], n, 2)
    velocities = _numbers("velocities", data["velocities"], n, 2)
    spins = None if data["spins"] is None else _numbers("spins", data["spins"], n, 3)
    in_play = _bools("in_play", data["in_play"], n)
    max_time = None if data["max_time"] is None else real("max_time", data["max_time"])
    max_events = whole("max_events", data["max_events"], "max_events")
    check_shot(scene, positions, velocities, spins, in_play, max_time)
    end = _fields("end", data["end"], _SHOT_END)
    if end["status"] not in STATUS:
        raise ValueError(f"end.status = {short(end['status'])}: expected one of {', '.join(map(repr, STATUS))}")
    return ShotRecord(
        scene=scene,
        positions=positions,
        velocities=velocities,
        spins=spins,
        in_play=in_play,
        mode=mode,
        dt=dt,
        fix=fix,
        max_time=max_time,
        max_events=max_events,
        end=ShotEnd(
            status=end["status"],
            time=real("end.time", end["time"]),
            n_events=whole("end.n_events", end["n_events"], Range(0, 2**62)),
            positions=_numbers("end.positions", end["positions"], n, 2),
            potted=_bools("end.potted", end["potted"], n),
        ),
    )


def _game(data: dict[str, Any]) -> GameRecord:
    _fields("the file", data, _GAME_FIELDS)
    scene, mode, dt, fix = _head(data)
    n = scene.n_balls
    setup = Setup(data["rules"], scene, data["n_players"], data["target"], mode, dt, fix)
    positions = _numbers("positions", data["positions"], n, 2)
    state = custom_opening(setup, positions, _fields("state", data["state"], _STATE)).state
    strokes = []
    for i, item in enumerate(_list("strokes", data["strokes"])):
        stroke = _fields(f"strokes[{i}]", item, Stroke._fields)
        velocity = _pair(f"strokes[{i}].velocity", stroke["velocity"], "speed")
        place = None if stroke["place"] is None else _pair(f"strokes[{i}].place", stroke["place"], "coordinate")
        strokes.append(Stroke(velocity, place))
    end = _fields("end", data["end"], _GAME_END)
    ball, score = Range(0, n - 1), Range(-(2**62), 2**62)
    on_table = [whole(f"end.on_table[{i}]", v, ball) for i, v in enumerate(_list("end.on_table", end["on_table"]))]
    scores = [whole(f"end.scores[{i}]", v, score) for i, v in enumerate(_list("end.scores", end["scores"]))]
    if not isinstance(end["over"], bool):
        raise ValueError(f"end.over = {short(end['over'])}: expected true or false")
    return GameRecord(
        setup=setup,
        positions=positions,
        state=state,
        strokes=tuple(strokes),
        end=GameEnd(
            positions=_numbers("end.positions", end["positions"], n, 2),
            on_table=tuple(on_table),
            scores=tuple(scores),
            player=whole("end.player", end["player"], Range(0, setup.n_players - 1)),
            over=end["over"],
            winner=whole("end.winner", end["winner"], Range(-1, setup.n_players - 1)),
        ),
    )


def _run(record: ShotRecord, record_events: bool = False) -> ShotResult:
    return simulate(
        record.scene,
        record.positions,
        record.velocities,
        mode=record.mode,
        dt=record.dt,
        fix=record.fix,
        spins=record.spins,
        in_play=record.in_play,
        record=record_events,
        max_time=record.max_time,
        max_events=record.max_events,
    )


def _play_again(history: History) -> GameState:
    game = history.opening
    for i, stroke in enumerate(history.strokes):
        try:
            game = play(history.setup, game, stroke).game
        except ValueError as error:
            raise ValueError(f"strokes[{i}]: {error}") from error
    return game


def _end_of_shot(shot: ShotResult) -> ShotEnd:
    return ShotEnd(shot.status, shot.time, shot.n_events, _rows(shot.positions), tuple(shot.potted.tolist()))


def _end_of_game(game: GameState) -> GameEnd:
    state = game.state
    return GameEnd(
        _rows(game.positions), tuple(sorted(state.on_table)), state.scores, state.player, state.over, state.winner
    )


def _compare(recorded: ShotEnd | GameEnd, now: ShotEnd | GameEnd) -> None:
    """Raises a ValueError that names the first difference; as text, which tells 0.0 from -0.0."""
    for field in dataclasses.fields(recorded):
        was, is_now = getattr(recorded, field.name), getattr(now, field.name)
        if repr(was) != repr(is_now):
            raise ValueError(
                f"the replay ends otherwise than the record: {field.name} = {short(is_now)}, expected {short(was)}; "
                "a record of another version of the engine may do so"
            )


def _plain(stroke: Stroke) -> Stroke:
    """The stroke in plain floats."""
    (vx, vy), place = stroke
    return Stroke((float(vx), float(vy)), None if place is None else (float(place[0]), float(place[1])))


def _rows(array: Any) -> Rows:
    return tuple(map(tuple, np.asarray(array).tolist()))


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    data: dict[str, Any] = {}
    for key, value in pairs:
        if key in data:
            raise ValueError(f"key {short(key)} is there twice: expected each once")
        data[key] = value
    return data


def _no_constant(name: str) -> float:
    raise ValueError(f"{name}: expected a finite number")


def _mapping(name: str, value: Any) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise ValueError(f"{name} = {short(value)}: expected a mapping")
    return value


def _fields(name: str, value: Any, wanted: tuple[str, ...]) -> dict[str, Any]:
    """`value`, which has to be a mapping of just the `wanted` keys."""
    data = _mapping(name, value)
    for key in data:
        if key not in wanted:
            raise ValueError(f"key {short(key)} of {name} is unknown: expected {', '.join(map(repr, wanted))}")
    for key in wanted:
        if key not in data:
            raise ValueError(f"key {key!r} of {name} is missing")
    return data


def _list(name: str, value: Any, count: int | None = None) -> list[Any]:
    if not isinstance(value, list) or count not in (None, len(value)):
        wanted = "a list" if count is None else f"a list of {count}"
        raise ValueError(f"{name} = {short(value)}: expected {wanted}")
    return value


def _pair(name: str, value: Any, within: str) -> tuple[float, float]:
    x, y = _list(name, value, 2)
    return real(f"{name}[0]", x, within), real(f"{name}[1]", y, within)


def _numbers(name: str, value: Any, count: int, width: int) -> Rows:
    return tuple(
        tuple(real(f"{name}[{i}][{j}]", v) for j, v in enumerate(_list(f"{name}[{i}]", row, width)))
        for i, row in enumerate(_list(name, value, count))
    )


def _bools(name: str, value: Any, count: int) -> tuple[bool, ...]:
    for i, item in enumerate(_list(name, value, count)):
        if not isinstance(item, bool):
            raise ValueError(f"{name}[{i}] = {short(item)}: expected true or false")
    return tuple(value)


def _head(data: Mapping[str, Any]) -> tuple[Scene, str, float | None, str | None]:
    """What shots and games share: scene, mode, dt and fix."""
    if not isinstance(data["written_by"], str):
        raise ValueError(f"written_by = {short(data['written_by'])}: expected a text")
    scene = Scene.from_dict(data["scene"])
    if scene.n_balls > MAX_BALLS:
        raise ValueError(f"scene.balls: {scene.n_balls} of them, expected at most {MAX_BALLS}")
    mode, dt, fix = data["mode"], data["dt"], data["fix"]
    dt = None if dt is None else real("dt", dt)
    for name, value in (("mode", mode), ("fix", fix)):
        if not isinstance(value, str) and not (name == "fix" and value is None):
            raise ValueError(f"{name} = {short(value)}: expected a name")
    check_mode(mode, dt, fix)
    return scene, mode, dt, fix
