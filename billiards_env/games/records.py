"""Games as JSON files that are validated when loaded and replay bit for bit, see `shots.records`.

`save`, `load`, `replay`, `to_json` and `from_json` accept games and shots.
"""

from __future__ import annotations

import dataclasses
import os
from typing import Any, overload

import numpy as np

from billiards_env.games.game_state import to_dict
from billiards_env.games.playing import Call, GameState, History, Setup, Stroke, check_stroke, custom_opening, play
from billiards_env.shots import records as shots
from billiards_env.shots.records import Rows, ShotRecord, check_equal, fields, head, items, rows_of, tuples
from billiards_env.shots.result import ShotResult
from billiards_env.shots.simulation import replay as replay_shot
from billiards_env.support.checks import Range, flag, integer, short

GAME = "billiards_env/game"


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
        state: The state of the rules before the first stroke, a row of `Game.state_type`.
        strokes: The strokes, in order.
        end: The result.
    """

    setup: Setup
    positions: Rows
    state: Any
    strokes: tuple[Stroke, ...]
    end: GameEnd

    @property
    def history(self) -> History:
        """The game as an argument of `games.replay`."""
        return History(self.setup, GameState(np.array(self.positions), self.state), self.strokes)


Record = ShotRecord | GameRecord


def record_game(history: History) -> GameRecord:
    """Records a game.

    Args:
        history: The game, for example from `billiards_v0.GameEnv.history`.

    Returns:
        The record, for `save`.
    """
    return GameRecord(
        setup=history.setup,
        positions=tuples(history.opening.positions),
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
        return replay_shot(record, check=check, record_events=record_events)
    game = _play_again(record.history)
    if check:
        check_equal(record.end, _end_of_game(game))
    return game


def save(path: str | os.PathLike[str], record: Record) -> None:
    """Writes a record to a file, completely or not at all; an existing file is replaced.

    Raises:
        OSError: If the file cannot be written.
    """
    shots.write(path, to_json(record))


def load(path: str | os.PathLike[str]) -> Record:
    """Reads a record from a file and validates it without simulating it.

    Raises:
        OSError: If the file cannot be read.
        ValueError: If the file is too large, has another format or a newer version, or its content is invalid.
    """
    return shots.read(path, from_json)


def to_json(record: Record) -> str:
    """Returns a record as JSON text with one line per field."""
    if isinstance(record, ShotRecord):
        return shots.to_json(record)
    if not isinstance(record, GameRecord):
        raise TypeError(f"record = {short(record)}: expected the result of ShotResult.to_record or record_game")
    data, state = shots.plain(record.setup), to_dict(record.state)
    data["positions"] = record.positions
    data["state"] = {name: state[name] for name in record.setup.game_rules.given}
    data["strokes"] = [stroke._asdict() | {"call": stroke.call._asdict()} for stroke in record.strokes]
    data["end"] = dataclasses.asdict(record.end)
    return shots.json_text(GAME, data)


def from_json(text: str) -> Record:
    """Builds a record from JSON text; see `load`.

    Raises:
        ValueError: As `load` does.
    """
    return shots.parse(text, {shots.SHOT: shots.read_shot, GAME: _game})


_SETTINGS = ("rules", "n_players", "target", "call_shot", "miss", "edition", "innings")
_GAME_FIELDS = (*shots.HEAD, *_SETTINGS, "state", "strokes")
_GAME_END = tuple(field.name for field in dataclasses.fields(GameEnd))


def _game(data: dict[str, Any]) -> GameRecord:
    fields("the file", data, _GAME_FIELDS)
    scene, engine = head(data)
    n = scene.n_balls
    setup = Setup(scene=scene, engine=engine, **{name: data[name] for name in _SETTINGS})
    positions = rows_of("positions", data["positions"], n, 2)
    state = custom_opening(setup, positions, fields("state", data["state"], setup.game_rules.given)).state
    strokes = []
    for i, item in enumerate(items("strokes", data["strokes"])):
        stroke = Stroke(**fields(name := f"strokes[{i}]", item, Stroke._fields))
        stroke = stroke._replace(call=Call(**fields(f"{name}.call", stroke.call, Call._fields)))
        check_stroke(scene, stroke, name=name)
        strokes.append(_plain(stroke))
    end = fields("end", data["end"], _GAME_END)
    result = GameEnd(
        positions=rows_of("end.positions", end["positions"], n, 2),
        on_table=_integers("end.on_table", end["on_table"], Range(0, n - 1)),
        scores=_integers("end.scores", end["scores"], Range(-(2**62), 2**62)),
        player=integer("end.player", end["player"], Range(0, setup.n_players - 1)),
        over=flag("end.over", end["over"]),
        winner=integer("end.winner", end["winner"], Range(-1, setup.n_players - 1)),
    )
    return GameRecord(setup, positions, state, tuple(strokes), result)


def _integers(name: str, values: Any, within: Range) -> tuple[int, ...]:
    return tuple(integer(f"{name}[{i}]", value, within) for i, value in enumerate(items(name, values)))


def _play_again(history: History) -> GameState:
    game = history.opening
    for i, stroke in enumerate(history.strokes):
        try:
            game = play(history.setup, game, stroke).game
        except ValueError as error:
            raise ValueError(f"strokes[{i}]: {error}") from error
    return game


def _end_of_game(game: GameState) -> GameEnd:
    state = to_dict(game.state)
    names = ("on_table", "scores", "player", "over", "winner")
    return GameEnd(tuples(game.positions), *(state[name] for name in names))


def _plain(stroke: Stroke) -> Stroke:
    """Returns the stroke with its numbers as Python floats."""
    velocity, place, (wx, wy, wz), call = stroke
    place = None if place is None else (float(place[0]), float(place[1]))
    return Stroke(tuple(map(float, velocity)), place, (float(wx), float(wy), float(wz)), call)
