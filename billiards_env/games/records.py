"""Shots and games as JSON files that are validated when loaded and replay bit for bit.

```python
>>> from billiards_env import Scene
>>> from billiards_env.games import records
>>> record = records.record_shot(Scene.named("pool"), [[-0.635, 0.0], [0.635, 0.3]], [2.0, 0.45])
>>> records.from_json(records.to_json(record)) == record
True
>>> records.replay(record).potted.tolist()
[False, True]

```

A file holds the input of a shot or a game and its result. `replay` compares its result with the recorded one and so
checks that this machine and this version of the engine produce the same bits. Numbers are written with enough digits to
restore the same double. A file contains only data, no code. Invalid content raises a `ValueError` that names the
invalid value.
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

from billiards_env.checks import Range, flag, one_of, real, shaped, short, whole
from billiards_env.engine.inputs import check_shot
from billiards_env.engine.modes import MAX_EVENTS, checked_engine
from billiards_env.engine.shots import STATUS
from billiards_env.files import replacing
from billiards_env.games.game import STATE_FIELDS, GameState, History, Setup, Stroke, custom_opening, play
from billiards_env.games.state import CALLS, Call, RuleState
from billiards_env.scene import Scene, check_scene
from billiards_env.shots.result import ShotResult
from billiards_env.shots.simulation import simulate

VERSION = 2
"""The version of the format that is written, and the newest version that is read. Games of version 1 are not read; they
have no calls, and straight pool had other fouls."""

MAX_BYTES = 4 * 2**20
"""The largest file that is read. The parsed data can take thirty times as much memory. A stroke takes about 150
bytes."""

MAX_BALLS = 1000
"""The largest number of balls in a scene that is read."""

SHOT, GAME = "billiards_env/shot", "billiards_env/game"

Rows = tuple[tuple[float, ...], ...]


@dataclasses.dataclass(frozen=True, slots=True)
class ShotEnd:
    """The result of a shot, for comparison.

    Attributes:
        status: As in `ShotResult`.
        time: Duration, s.
        n_events: Number of events.
        positions: x and y of each ball, m.
        potted: One bool per ball.
    """

    status: str
    time: float
    n_events: int
    positions: Rows
    potted: tuple[bool, ...]


@dataclasses.dataclass(frozen=True, slots=True)
class ShotRecord:
    """The arguments of `simulate` for a shot, and its result.

    Attributes:
        scene: The scene.
        positions: x and y of each ball, m.
        velocities: x and y for each ball, m/s.
        spins: x, y and z for each ball, rad/s; None for zero spin.
        in_play: One bool per ball.
        mode: The engine.
        dt: The timestep of "pit", s; None for "pic".
        fix: As in `simulate`.
        max_time: Time limit, s; None for that of the scene.
        max_events: As in `simulate`.
        end: The result.
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
    """The state of a game after its last recorded stroke, for comparison.

    Attributes:
        positions: x and y of each ball, m.
        on_table: The balls on the table.
        scores: The score of each player.
        player: The player to shoot.
        over: Whether the game is over.
        winner: The player who has won, or -1.
    """

    positions: Rows
    on_table: tuple[int, ...]
    scores: tuple[int, ...]
    player: int
    over: bool
    winner: int


@dataclasses.dataclass(frozen=True, slots=True)
class GameRecord:
    """The input of a game, and its result.

    Attributes:
        setup: The settings of the game.
        positions: x and y of each ball before the first stroke, m.
        state: The state of the rules before the first stroke.
        strokes: The strokes, in order.
        end: The result.
    """

    setup: Setup
    positions: Rows
    state: RuleState
    strokes: tuple[Stroke, ...]
    end: GameEnd

    @property
    def history(self) -> History:
        """The game as an argument of `games.replay`."""
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
    """Simulates a shot and records its input and its result.

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
    check_scene(scene)
    checked_engine(mode, dt, fix)
    whole("max_events", max_events, "max_events")
    checked = check_shot(
        scene, shaped("positions", positions, (scene.n_balls, 2)), velocities, spins, in_play, max_time
    )
    record = ShotRecord(
        scene=scene,
        positions=_rows(checked.positions),
        velocities=_rows(checked.velocities),
        spins=None if spins is None else _rows(checked.spins),
        in_play=tuple(checked.in_play.tolist()),
        mode=mode,
        dt=None if dt is None else float(dt),
        fix=fix,
        max_time=None if max_time is None else float(max_time),
        max_events=int(max_events),
        end=ShotEnd("rest", 0.0, 0, (), ()),
    )
    return dataclasses.replace(record, end=_end_of_shot(_run(record)))


def record_game(history: History) -> GameRecord:
    """Records a game.

    Args:
        history: The game, for example from `games.billiards_v0.raw_env.history`.

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
        check: Whether to compare the result with the recorded one, bit for bit.
        record_events: Whether to record the events and trajectories of a shot. For the shots of a game, use
            `games.replay(record.history)`.

    Returns:
        The shot, or the state of the game after its last stroke.

    Raises:
        ValueError: If the result differs from the recorded one.
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
    """Writes a record to a file, completely or not at all; an existing file is replaced.

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
    """Reads a record from a file and validates it without simulating it.

    Args:
        path: The file.

    Returns:
        The record.

    Raises:
        OSError: If the file cannot be read.
        ValueError: If the file is too large, has another format or a newer version, or its content is invalid.
    """
    try:
        with open(path, "rb") as file:
            content = file.read(MAX_BYTES + 1)
    except (FileNotFoundError, IsADirectoryError) as error:
        is_not = "does not exist" if isinstance(error, FileNotFoundError) else "is a folder"
        raise type(error)(f"path = {os.fspath(path)!r}: expected the file of a shot or a game, it {is_not}") from None
    try:
        if len(content) > MAX_BYTES:
            raise ValueError(f"a file of more than {MAX_BYTES} bytes: expected at most {MAX_BYTES}")
        return from_json(content.decode("utf-8"))
    except ValueError as error:
        raise ValueError(f"{os.fspath(path)}: {error}") from error


def to_json(record: Record) -> str:
    """Returns a record as JSON text with one line per field.

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
    elif not isinstance(record, GameRecord):
        raise TypeError(f"record = {short(record)}: expected the result of record_shot or record_game")
    else:
        setup = record.setup
        data["format"] = GAME
        for field in dataclasses.fields(setup):
            data[field.name] = getattr(setup, field.name)
        data["scene"] = setup.scene.to_dict()
        data["positions"] = record.positions
        state = record.state._asdict()
        data["state"] = {name: state[name] for name in STATE_FIELDS} | {"on_table": sorted(state["on_table"])}
        data["strokes"] = [stroke._asdict() | {"call": stroke.call._asdict()} for stroke in record.strokes]
    data["end"] = dataclasses.asdict(record.end)
    lines = (f"  {json.dumps(key)}: {json.dumps(value, allow_nan=False)}" for key, value in data.items())
    return "{\n" + ",\n".join(lines) + "\n}\n"


def from_json(text: str) -> Record:
    """Builds a record from JSON text; see `load`.

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
    except json.JSONDecodeError as error:
        raise ValueError(f"line {error.lineno}: expected the JSON of a shot or a game ({error.msg})") from error
    except RecursionError:
        raise ValueError("nested too deeply: expected the JSON of a shot or a game") from None
    kind = _mapping("the file", data).get("format")
    if kind not in (SHOT, GAME):
        raise ValueError(f"format = {short(kind)}: expected {SHOT!r} or {GAME!r}")
    version = whole("version", data.get("version"), Range(1, None))
    if version > VERSION:
        raise ValueError(
            f"version = {version}: expected at most {VERSION}; the file was written by a newer version of "
            f"billiards_env ({short(data.get('written_by'))})"
        )
    if kind == GAME and version < VERSION:
        raise ValueError(f"version = {version}: expected {VERSION} for a game; the file has older rules and no calls")
    try:
        return _shot(data) if kind == SHOT else _game(data)
    except (TypeError, OverflowError, RecursionError) as error:  # a wrong type, or a number too large for a float
        raise ValueError(str(error)) from error


# The keys of a file.
_HEAD = ("format", "version", "written_by", "scene", "mode", "dt", "fix", "positions", "end")
_SHOT_FIELDS = (*_HEAD, "velocities", "spins", "in_play", "max_time", "max_events")
_GAME_FIELDS = (*_HEAD, "rules", "n_players", "target", "called", "miss", "state", "strokes")
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
    one_of("end.status", end["status"], tuple(STATUS))
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
    setup = Setup(data["rules"], scene, data["n_players"], data["target"], mode, dt, fix, data["called"], data["miss"])
    positions = _numbers("positions", data["positions"], n, 2)
    state = custom_opening(setup, positions, _fields("state", data["state"], STATE_FIELDS)).state
    strokes = []
    for i, item in enumerate(_list("strokes", data["strokes"])):
        stroke = _fields(f"strokes[{i}]", item, Stroke._fields)
        velocity = _pair(f"strokes[{i}].velocity", stroke["velocity"], "speed")
        place = None if stroke["place"] is None else _pair(f"strokes[{i}].place", stroke["place"], "coordinate")
        spin = _list(f"strokes[{i}].spin", stroke["spin"], 3)
        x, y, z = (real(f"strokes[{i}].spin[{k}]", value, "spin") for k, value in enumerate(spin))
        strokes.append(Stroke(velocity, place, (x, y, z), _call(f"strokes[{i}].call", stroke["call"])))
    end = _fields("end", data["end"], _GAME_END)
    ball, score = Range(0, n - 1), Range(-(2**62), 2**62)
    on_table = [whole(f"end.on_table[{i}]", v, ball) for i, v in enumerate(_list("end.on_table", end["on_table"]))]
    scores = [whole(f"end.scores[{i}]", v, score) for i, v in enumerate(_list("end.scores", end["scores"]))]
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
            over=flag("end.over", end["over"]),
            winner=whole("end.winner", end["winner"], Range(-1, setup.n_players - 1)),
        ),
    )


def _call(name: str, value: Any) -> Call:
    call, number = _fields(name, value, Call._fields), Range(-1, 2**31 - 1)
    one_of(f"{name}.kind", call["kind"], CALLS)
    return Call(
        whole(f"{name}.ball", call["ball"], number), whole(f"{name}.pocket", call["pocket"], number), call["kind"]
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
    """Raises a ValueError that names the first difference; compares text, which distinguishes 0.0 and -0.0."""
    for field in dataclasses.fields(recorded):
        old, new = getattr(recorded, field.name), getattr(now, field.name)
        if repr(old) != repr(new):
            raise ValueError(
                f"the replay differs from the record: {field.name} = {short(new)}, expected {short(old)}; "
                "this can happen if another version of the engine wrote the record"
            )


def _plain(stroke: Stroke) -> Stroke:
    """Returns the stroke with its numbers as Python floats."""
    (vx, vy), place, (wx, wy, wz), call = stroke
    place = None if place is None else (float(place[0]), float(place[1]))
    return Stroke((float(vx), float(vy)), place, (float(wx), float(wy), float(wz)), call)


def _rows(array: Any) -> Rows:
    return tuple(map(tuple, np.asarray(array).tolist()))


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    data: dict[str, Any] = {}
    for key, value in pairs:
        if key in data:
            raise ValueError(f"key {short(key)} appears twice: expected each key once")
        data[key] = value
    return data


def _no_constant(name: str) -> float:
    raise ValueError(f"{name}: expected a finite number")


def _mapping(name: str, value: Any) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise ValueError(f"{name} = {short(value)}: expected a mapping")
    return value


def _fields(name: str, value: Any, keys: tuple[str, ...]) -> dict[str, Any]:
    """Returns `value`; raises unless it is a mapping with exactly the given keys."""
    data = _mapping(name, value)
    for key in data:
        if key not in keys:
            raise ValueError(f"key {short(key)} of {name} is unknown: expected {', '.join(map(repr, keys))}")
    for key in keys:
        if key not in data:
            raise ValueError(f"key {key!r} of {name} is missing")
    return data


def _list(name: str, value: Any, count: int | None = None) -> list[Any]:
    if not isinstance(value, list) or count not in (None, len(value)):
        expected = "a list" if count is None else f"a list of {count}"
        raise ValueError(f"{name} = {short(value)}: expected {expected}")
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
    return tuple(flag(f"{name}[{i}]", item) for i, item in enumerate(_list(name, value, count)))


def _head(data: Mapping[str, Any]) -> tuple[Scene, str, float | None, str | None]:
    """Returns the fields that shots and games share: scene, mode, dt and fix."""
    if not isinstance(data["written_by"], str):
        raise ValueError(f"written_by = {short(data['written_by'])}: expected a text")
    scene = Scene.from_dict(data["scene"])
    whole("number of balls", scene.n_balls, Range(1, MAX_BALLS))
    mode, dt, fix = data["mode"], data["dt"], data["fix"]
    dt = None if dt is None else real("dt", dt)
    checked_engine(mode, dt, fix)
    return scene, mode, dt, fix
