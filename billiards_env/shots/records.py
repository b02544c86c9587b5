"""Shots as JSON files that are validated when loaded and replay bit for bit.

```python
>>> from billiards_env import simulate
>>> from billiards_env.shots import records
>>> from billiards_env.shots.simulation import replay
>>> shot = simulate("pool", [[-0.635, 0.0], [0.635, 0.3]], [2.0, 0.45], record=True)
>>> record = records.from_json(records.to_json(shot.to_record()))
>>> replay(record).potted.tolist()
[False, True]

```

A file holds the input of a shot and its result. `simulation.replay` compares its result with the recorded one and so
checks that this machine and this version of the engine produce the same bits. Numbers are written with enough digits to
restore the same double. A file contains only data, no code. Invalid content raises a `ValueError` that names the
invalid value.
`games.records` writes games in the same format.
"""

from __future__ import annotations

import dataclasses
import json
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from billiards_env.engine.compile import Engine
from billiards_env.engine.shot_input import check_shot
from billiards_env.engine.shots import STATUS
from billiards_env.scene import Scene
from billiards_env.support.checks import Range, check_version, flag, integer, one_of, real, short
from billiards_env.support.files import read_text, replacing
from billiards_env.version import __version__

VERSION = 2
"""The version of the format that is written, and the only one that is read."""

MAX_BYTES = 4 * 2**20
"""The largest file that is read. The parsed data can take thirty times as much memory."""

MAX_BALLS = 1000
"""The largest number of balls in a scene that is read."""

SHOT = "billiards_env/shot"

Rows = tuple[tuple[float, ...], ...]
T = TypeVar("T")


@dataclasses.dataclass(frozen=True, slots=True)
class ShotEnd:
    """The result of a shot, for comparison.

    Attributes:
        status: "rest", "max_time" or, if the engine ended the shot, "event_limit" or "step_limit" (see
            `engine.MAX_EVENTS` and `pit.MAX_STEPS`).
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
        positions: x and y of each ball, m; x, y and the height above the cloth with flight.
        velocities: x and y for each ball, m/s; x, y and z with flight.
        spins: x, y and z for each ball, rad/s; None for zero spin.
        in_play: One bool per ball.
        engine: The engine.
        max_time: Time limit, s; None for the scene's.
        max_events: Number of events after which the engine ends the shot with the status "event_limit". "pit" also ends
            it after `pit.MAX_STEPS` timesteps, with the status "step_limit".
        end: The result.
    """

    scene: Scene
    positions: Rows
    velocities: Rows
    spins: Rows | None
    in_play: tuple[bool, ...]
    engine: Engine
    max_time: float | None
    max_events: int
    end: ShotEnd


def save(path: str | os.PathLike[str], record: ShotRecord) -> None:
    """Writes a record to a file, completely or not at all; an existing file is replaced.

    Raises:
        OSError: If the file cannot be written.
    """
    write(path, to_json(record))


def load(path: str | os.PathLike[str]) -> ShotRecord:
    """Reads a record from a file and validates it without simulating it.

    Raises:
        OSError: If the file cannot be read.
        ValueError: If the file is too large, has another format or a newer version, or its content is invalid.
    """
    return read(path, from_json)


def to_json(record: ShotRecord) -> str:
    """Returns a record as JSON text with one line per field."""
    if not isinstance(record, ShotRecord):
        raise TypeError(f"record = {short(record)}: expected the result of ShotResult.to_record")
    return json_text(SHOT, {**plain(record), "end": dataclasses.asdict(record.end)})


def from_json(text: str) -> ShotRecord:
    """Builds a record from JSON text; see `load`.

    Raises:
        ValueError: As `load` does.
    """
    return parse(text, {SHOT: read_shot})


def write(path: str | os.PathLike[str], text: str) -> None:
    """Writes a text to a file, completely or not at all."""
    content = text.encode()
    with replacing(Path(path)) as temporary:
        temporary.write_bytes(content)


def read(
    path: str | os.PathLike[str], build: Callable[[str], T], what: str = "a shot or a game", most: int | None = None
) -> T:
    """Returns what `build` makes of the text of a file; errors name the file and `what` it should hold.

    The file has at most `most` bytes; None for `MAX_BYTES`.
    """
    text = read_text(path, MAX_BYTES if most is None else most, what)
    try:
        return build(text)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{os.fspath(path)}: {error}") from error


def read_data(path: str | os.PathLike[str], what: str, most: int | None = None) -> dict[str, Any]:
    """Returns the data of a JSON file that holds a mapping; the arguments and errors are as in `read`."""
    return read(path, lambda text: _mapping("the file", data_of(text, what)), what, most)


def read_scene(name: str, n_object_balls: int | None = None) -> Scene:
    """Returns the scene of an argument such as `--scene`: of a name, or of a file whose name ends in ".json".

    Args:
        name: A name of `Scene.named`, or a file with the data of `Scene.from_dict`, or with this data as "scene": a
            report of `calibrate`, or a shot or a game.
        n_object_balls: Number of object balls of a named scene; None for the usual number.

    Raises:
        OSError: If the file cannot be read.
        ValueError: If there is no such scene, or a file and a number of balls are given.
    """
    if not isinstance(name, str) or not name.endswith(".json"):
        return Scene.named(name, n_object_balls)
    if n_object_balls is not None:
        raise ValueError(
            f"scene = {name!r} with a number of object balls: expected no number, the file lists the balls"
        )
    return read(name, lambda text: _scene(data_of(text, "a scene")), "a scene")


def _scene(data: Any) -> Scene:
    return Scene.from_dict(data["scene"] if isinstance(data, dict) and "scene" in data else data)


def json_text(kind: str, data: Mapping[str, Any]) -> str:
    """Returns the JSON text of a file of a kind, with one line per field."""
    content = {"format": kind, "version": VERSION, "written_by": f"billiards_env {__version__}", **data}
    lines = (f"  {json.dumps(key)}: {json.dumps(value, allow_nan=False)}" for key, value in content.items())
    return "{\n" + ",\n".join(lines) + "\n}\n"


def plain(record: Any) -> dict[str, Any]:
    """Returns the fields of a shot or of the setup of a game. `head` can read the scene and the engine from them."""
    data = {field.name: getattr(record, field.name) for field in dataclasses.fields(record)}
    return {"scene": data.pop("scene").to_dict(), **dataclasses.asdict(data.pop("engine")), **data}


def data_of(text: str, what: str, **options: Any) -> Any:
    """Returns the data of a JSON text, see `json.loads`; errors name `what` it should hold."""
    try:
        return json.loads(text, **options)
    except json.JSONDecodeError as error:
        raise ValueError(f"line {error.lineno}: expected the JSON of {what} ({error.msg})") from error
    except ValueError as error:  # such as a number of thousands of digits
        raise ValueError(f"expected the JSON of {what} ({error})") from error
    except RecursionError:
        raise ValueError(f"nested too deeply: expected the JSON of {what}") from None


def parse(text: str, kinds: Mapping[str, Callable[[dict[str, Any]], T]], what: str = "a shot or a game") -> T:
    """Returns what the function of the file's kind builds from its data; errors name `what` it should hold."""
    if len(text) > MAX_BYTES:
        raise ValueError(f"a text of {len(text)} characters: expected at most {MAX_BYTES}")
    data = data_of(text, what, object_pairs_hook=_unique, parse_constant=_no_constant)
    kind: Any = _mapping("the file", data).get("format")
    if kind not in tuple(kinds):
        raise ValueError(f"format = {short(kind)}: expected {' or '.join(map(repr, kinds))}")
    check_version("version", data.get("version"), VERSION)
    try:
        return kinds[kind](data)
    except (TypeError, OverflowError, RecursionError) as error:  # a wrong type, or a number too large for a float
        raise ValueError(str(error)) from error


HEAD = ("format", "version", "written_by", "scene", "mode", "dt", "fix", "positions", "end")
"""The keys that files of shots and of games share."""

_SHOT_FIELDS = (*HEAD, "velocities", "spins", "in_play", "max_time", "max_events")
_SHOT_END = tuple(field.name for field in dataclasses.fields(ShotEnd))


def read_shot(data: dict[str, Any]) -> ShotRecord:
    """Returns the record of a shot from the data of its file."""
    fields("the file", data, _SHOT_FIELDS)
    scene, engine = head(data)
    n, axes = scene.n_balls, 3 if scene.physics.flight else 2
    positions = rows_of("positions", data["positions"], n, axes)
    velocities = rows_of("velocities", data["velocities"], n, axes)
    spins = None if data["spins"] is None else rows_of("spins", data["spins"], n, 3)
    in_play = bools("in_play", data["in_play"], n)
    max_time = None if data["max_time"] is None else real("max_time", data["max_time"])
    max_events = integer("max_events", data["max_events"], "max_events")
    check_shot(scene, positions, velocities, spins, in_play, max_time)
    end = fields("end", data["end"], _SHOT_END)
    one_of("end.status", end["status"], tuple(STATUS))
    return ShotRecord(
        scene=scene,
        positions=positions,
        velocities=velocities,
        spins=spins,
        in_play=in_play,
        engine=engine,
        max_time=max_time,
        max_events=max_events,
        end=ShotEnd(
            status=end["status"],
            time=real("end.time", end["time"]),
            n_events=integer("end.n_events", end["n_events"], Range(0, 2**62)),
            positions=rows_of("end.positions", end["positions"], n, 2),
            potted=bools("end.potted", end["potted"], n),
        ),
    )


def end_of(shot: Any) -> ShotEnd:
    """Returns the end of a `ShotResult`."""
    return ShotEnd(shot.status, shot.time, shot.n_events, tuples(shot.positions), tuple(shot.potted.tolist()))


def check_equal(recorded: Any, now: Any) -> None:
    """Raises a ValueError that names the first difference; compares text, which distinguishes 0.0 and -0.0."""
    for field in dataclasses.fields(recorded):
        old, new = getattr(recorded, field.name), getattr(now, field.name)
        if repr(old) != repr(new):
            raise ValueError(
                f"the replay differs from the record: {field.name} = {short(new, 17)}, expected {short(old, 17)}; "
                "this can happen if another version of the engine wrote the record"
            )


def tuples(array: Any) -> Rows:
    """Returns an array as tuples."""
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


def fields(name: str, value: Any, keys: tuple[str, ...]) -> dict[str, Any]:
    """Returns `value`; raises unless it is a mapping with exactly the given keys."""
    data = _mapping(name, value)
    for key in data:
        if key not in keys:
            raise ValueError(f"key {short(key)} of {name} is unknown: expected {', '.join(map(repr, keys))}")
    for key in keys:
        if key not in data:
            raise ValueError(f"key {key!r} of {name} is missing: expected a value")
    return data


def items(name: str, value: Any, count: int | None = None) -> list[Any]:
    """Returns `value`; raises unless it is a list, of a length if `count` is not None."""
    if not isinstance(value, list) or count not in (None, len(value)):
        expected = "a list" if count is None else f"a list of {count}"
        raise ValueError(f"{name} = {short(value)}: expected {expected}")
    return value


def rows_of(name: str, value: Any, count: int, width: int) -> Rows:
    """Returns `count` rows of `width` numbers."""
    return tuple(
        tuple(real(f"{name}[{i}][{j}]", v) for j, v in enumerate(items(f"{name}[{i}]", row, width)))
        for i, row in enumerate(items(name, value, count))
    )


def bools(name: str, value: Any, count: int) -> tuple[bool, ...]:
    """Returns `count` bools."""
    return tuple(flag(f"{name}[{i}]", item) for i, item in enumerate(items(name, value, count)))


def head(data: Mapping[str, Any]) -> tuple[Scene, Engine]:
    """Returns the scene and the engine of a shot or a game."""
    if not isinstance(data["written_by"], str):
        raise ValueError(f"written_by = {short(data['written_by'])}: expected a text")
    scene = Scene.from_dict(data["scene"])
    integer("number of balls", scene.n_balls, Range(1, MAX_BALLS))
    dt = None if data["dt"] is None else real("dt", data["dt"])
    return scene, Engine(data["mode"], dt, data["fix"])
