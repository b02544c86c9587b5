"""The state of a game, the facts of a shot, the call and the verdict: one structured type each.

`STATE`, `CALL` and `VERDICT` are the types of arrays of m games or shots; a single game is a row. `RulesState`,
`Called` and `Verdict` describe their fields, and `row({"ball": 1}, CALL)` makes a row. `Game.state_type` is the type of
the states of a game: the fields of `RulesState` and those of the game's own, `Game.state`. `Game.facts_type` has the
facts that the game uses. Compiled code reads and changes rows. Sets of balls are bit masks: bit i is ball i. `to_dict`
converts a row to a dict of names and tuples.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Annotated, Any, NamedTuple, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from billiards_env.jit import inlined
from billiards_env.physics.state import CUE_BALL
from billiards_env.support.checks import short

MOST_PLAYERS = 4
MOST_BALLS = 63
"""The number of balls that a set, a bit mask, can hold."""
FOOT_RIGHT, FOOT_LEFT = 2, 3
"""The pockets in the foot corners, in the order of `scene.six_pockets`: with y < 0 and with y > 0."""

MAX_SCORE = 1_000_000
"""The largest absolute value of a score."""

IN_HAND = ("no", "behind", "anywhere")
"""Whether the cue ball is in hand (WPA 1.5): not in hand, behind the head string (in snooker in the D), or anywhere on
the table."""
NOT_IN_HAND, BEHIND, ANYWHERE = range(len(IN_HAND))

FOULS = ("", "scratch", "no_hit", "wrong_ball", "wrong_pot", "no_cushion", "illegal_break", "breaking_foul", "push")
FOULS += ("free_ball", "driven_off", "jump_shot")
"""The fouls; "" means no foul. "scratch" is a potted cue ball, "wrong_pot" a potted ball that is not on,
"breaking_foul" a bad opening break of straight pool, "push" a shot into a ball that touches the cue ball, "free_ball" a
snooker behind the free ball, "driven_off" an object ball driven off the table, "jump_shot" a cue ball that jumps over
an object ball."""
NO_FOUL, SCRATCH, NO_HIT, WRONG_BALL, WRONG_POT, NO_CUSHION, ILLEGAL_BREAK, BREAKING_FOUL = range(8)
PUSH, FREE_BALL, DRIVEN_OFF, JUMP_SHOT = range(8, len(FOULS))

CALLS = ("shot", "safety", "push_out", "hand_back", "replace", "rerack", "break_again", "stalemate")
"""The kinds of calls.

* "shot": an ordinary shot.
* "safety": the turn passes after the shot, even if it pots a ball (WPA 3.6, 4.5).
* "push_out": the cue ball need not touch a ball or a cushion (WPA 2.4).
* "hand_back": no shot; the previous player plays the next one (WPA 2.4, WPBSA 3.11).
* "replace": no shot; the balls return to their positions before the foul, and the previous player plays again (WPBSA
  3.14).
* "rerack": no shot; the balls are racked or set up again, and the player plays the first shot (WPA 3.3, UMB 27).
* "break_again": no shot; the balls are racked again, and the previous player breaks (WPA 3.3, 4.3).
* "stalemate": no shot; the balls are racked again, and the player who broke breaks again (WPA 1.12, WPBSA 3.16).

`RulesState.choices` has the kinds from "push_out" on that a player may choose.
"""
SHOT, SAFETY, PUSH_OUT, HAND_BACK, REPLACE, RERACK, BREAK_AGAIN, STALEMATE = range(len(CALLS))

NO_SHOT = CALLS[HAND_BACK:]
"""The kinds of calls without a shot: from `HAND_BACK` on."""

RERACKS = ("", "all", "rest")
"""The new racks after a shot: none; all object balls, and the next shot is a break; all object balls except the last
one on the table (WPA 4.4)."""
NO_RERACK, RERACK_ALL, RERACK_REST = range(len(RERACKS))


class Field(NamedTuple):
    """The meaning of the numbers of a field of a row.

    Attributes:
        least: The smallest number.
        most: The largest number; None for the number of players less 1.
        names: What an index, or a member of a set, stands for.
        is_set: Whether the number is a set: of balls or, with `names`, of names.
        given: Whether a custom opening may set the field. The settings and the balls determine the others.
    """

    least: int = 0
    most: int | None = MAX_SCORE
    names: tuple[str, ...] = ()
    is_set: bool = False
    given: bool = True


Count = Annotated[int, Field()]
Player = Annotated[int, Field(most=None)]
PlayerOrNone = Annotated[int, Field(least=-1, most=None)]
Balls = Annotated[int, Field(is_set=True)]
FoundBalls = Annotated[int, Field(is_set=True, given=False)]
FoundNumber = Annotated[int, Field(given=False)]
FoundFlag = Annotated[bool, Field(given=False)]
"""The types of the fields of a state, with `bool`. Those of names that begin with "Found" follow from the settings or
from the balls."""


class NoState(NamedTuple):
    """The own state of a game without own state."""


class RulesState(NamedTuple):
    """The state of the rules between two shots that each game has: everything except the positions of the balls.

    Attributes:
        player: The player to shoot, 0 to n_players - 1.
        n_players: Number of players.
        scores: The score of each player; zeros beyond `n_players`.
        fouls: Number of consecutive fouls of each player.
        balls: All object balls of the game.
        object_balls: The balls on the table, except the one that is struck next.
        cue_balls: The ball that is struck next, and the one that is struck after the turn changes.
        break_shot: Whether the next shot is the opening break.
        in_hand: Index in `IN_HAND`.
        choices: The choices of the player besides a shot: bit i is `CALLS[i]`.
        target: The score that wins, or 0 if no score does.
        call_shot: Whether shots are called: a potted ball counts only if the ball and its pocket were called (WPA 1.6).
        edition: Index in `Game.editions` of the edition of the rules.
        breaker: The player who played the last opening break.
        idle: The number of shots in a row without a pot, a point or a foul.
        over: Whether the game is over.
        winner: The player who has won, or -1.
    """

    player: Player = 0
    n_players: FoundNumber = 2
    scores: Annotated[tuple[int, int, int, int], Field(least=-MAX_SCORE)] = (0, 0, 0, 0)
    fouls: Annotated[tuple[int, int, int, int], Field()] = (0, 0, 0, 0)
    balls: FoundBalls = 0
    object_balls: Balls = 0
    cue_balls: tuple[int, int] = (CUE_BALL, CUE_BALL)
    break_shot: bool = False
    in_hand: Annotated[int, Field(names=IN_HAND)] = NOT_IN_HAND
    choices: Annotated[int, Field(names=CALLS, is_set=True)] = 0
    target: FoundNumber = 0
    call_shot: FoundFlag = False
    edition: FoundNumber = 0
    breaker: Player = 0
    idle: Count = 0
    over: FoundFlag = False
    winner: Annotated[int, Field(least=-1, most=None, given=False)] = -1


class Called(NamedTuple):
    """The call of a shot.

    Attributes:
        ball: The called ball, in snooker the nominated one; -1 for none.
        pocket: The called pocket; -1 for none.
        kind: Index in `CALLS`.
        made: Whether the shot pots the called ball in the called pocket (WPA 1.6), see `facts.record_shot`.
    """

    ball: int = -1
    pocket: int = -1
    kind: Annotated[int, Field(names=CALLS)] = SHOT
    made: bool = False


class Verdict(NamedTuple):
    """The judgement of a shot. The next `RulesState` has the consequences for the next shot.

    Attributes:
        foul: Index in `FOULS`.
        points: Points for the shooter.
        penalty: Points for the next player.
        continues: Whether the shooter also plays the next shot.
        spotted: The balls that return to the table.
        rack: Index in `RERACKS`.
    """

    foul: Annotated[int, Field(names=FOULS)] = NO_FOUL
    points: int = 0
    penalty: int = 0
    continues: bool = False
    spotted: Balls = 0
    rack: Annotated[int, Field(names=RERACKS)] = NO_RERACK


FIELDS: dict[str, Field] = {}
"""The meaning of each field of all rows, by name. A name has one meaning."""


def hints_of(*rows: type) -> dict[str, Any]:
    """Returns the types of the fields of NamedTuples, by name.

    Raises:
        ValueError: If two of them have a field of the same name.
    """
    hints: dict[str, Any] = {}
    for one in rows:
        own = get_type_hints(one, include_extras=True)
        if again := hints.keys() & own.keys():
            raise ValueError(f"{one.__name__}.{min(again)}: expected another name than those of `RulesState`")
        hints |= own
    return hints


def check_type(what: str, hint: Any) -> None:
    """Raises a TypeError if no field of a row can have an annotated type."""
    kind = get_args(hint)[0] if get_origin(hint) is Annotated else hint
    if kind not in (int, bool) and not (get_origin(kind) is tuple and {*get_args(kind)} == {int}):
        raise TypeError(f"{what} = {hint}: expected int, bool or a tuple of ints as its annotated type")


def row_type(hints: Mapping[str, Any]) -> np.dtype[Any]:
    """Returns the type of the rows of a structured array with some fields, and adds them to `FIELDS`.

    The bools come last, and the zero bytes of `spare` fill a row to a multiple of 8 bytes. Each byte of a row then
    belongs to a field. NumPy does not copy gaps between fields, so equal rows with gaps could have different bytes.

    Args:
        hints: The type of each field: an int, a bool or a tuple of ints, alone or annotated with a `Field`.

    Raises:
        ValueError: If a name has another meaning in other rows.
    """
    types: list[Any] = []
    for name, hint in hints.items():
        kind, *notes = get_args(hint) if get_origin(hint) is Annotated else (hint,)
        field = notes[0] if notes else Field()
        if FIELDS.setdefault(name, field) != field:
            raise ValueError(f"field {name!r} is a {field}: expected the meaning that it has elsewhere, {FIELDS[name]}")
        types.append((name, np.bool_ if kind is bool else (np.int64, (len(get_args(kind)),) if get_args(kind) else ())))
    types.sort(key=lambda item: item[1] is np.bool_)
    spare = ("spare", f"S{-np.dtype(types).itemsize % 8}")
    return np.dtype((np.record, np.dtype([*types, spare], align=True)))


STATE, CALL, VERDICT = (row_type(hints_of(kind)) for kind in (RulesState, Called, Verdict))


def row(fields: Mapping[str, Any], kind: np.dtype[Any]) -> Any:
    """Returns a row of a structured array with some fields; the others are 0."""
    made = np.zeros(1, kind)
    for name, value in fields.items():
        made[name] = value
    return made[0]


def changed(state: Any, **fields: Any) -> Any:
    """Returns a copy of a row with other values of some fields."""
    state = state.copy()
    for name, value in fields.items():
        state[name] = value
    return state


def to_dict(row: Any) -> dict[str, Any]:
    """Returns a row as a dict. Sets are tuples of balls in order, and indices are names.

    A state has the scores and fouls of its players, each cue ball once, and also `on_table`: the balls on the table
    including the cue balls; a cue ball in hand counts.
    """
    values: dict[str, Any] = {}
    for name in row.dtype.names[:-1]:  # without `spare`
        value: Any = row[name].tolist()
        names, is_set = FIELDS[name].names, FIELDS[name].is_set
        if is_set:
            value = members(value)
        elif isinstance(value, list):
            value = tuple(value[: row["n_players"]] if len(value) == MOST_PLAYERS else dict.fromkeys(value))
        if names:
            value = tuple(names[i] for i in value) if is_set else names[value]
        values[name] = value
    if "object_balls" in values:
        values["on_table"] = members(on_table(row))
    return values


def set_of(numbers: Iterable[int]) -> int:
    """Returns a set of balls, or of other small numbers, as a bit mask."""
    return sum(1 << number for number in set(numbers))


def members(mask: Any) -> tuple[int, ...]:
    """Returns the members of a set of balls, in order."""
    mask = int(mask)
    return tuple(ball for ball in range(mask.bit_length()) if mask >> ball & 1)


def is_in(mask: Any, n: int) -> NDArray[np.bool_]:
    """Returns which of the balls 0 to n - 1 are in a set, (n,)."""
    return mask >> np.arange(n) & 1 > 0


def check_indices(states: Any, n_balls: int = MOST_BALLS) -> None:
    """Raises a ValueError unless the players, balls and sets of m states exist: compiled code uses them as indices."""
    players, cues = states["n_players"], states["cue_balls"]
    if not ((cues >= 0) & (cues < n_balls)).all():
        raise ValueError(f"cue_balls = {short(cues)}: expected numbers of balls")
    for name in states.dtype.names[:-1]:
        field, numbers = FIELDS[name], states[name]
        if field.is_set:
            bits = len(field.names) or n_balls
            if np.count_nonzero(numbers >> bits):  # -1 for a negative number
                raise ValueError(f"{name} = {short(numbers)}: expected a set of numbers below {bits}")
        elif field.most is None:
            if not ((numbers >= field.least) & (numbers < players) & (players <= MOST_PLAYERS)).all():
                expected = f"expected {field.least} to the number less 1"
                raise ValueError(f"{name} = {short(numbers)} of {short(players)} players: {expected}")
        elif field.names or not field.given:
            most = len(field.names) - 1 if field.names else field.most
            if most < MAX_SCORE and not ((numbers >= field.least) & (numbers <= most)).all():
                raise ValueError(f"{name} = {short(numbers)}: expected {field.least} to {most}")


def on_table(states: Any) -> Any:
    """Returns the balls on the table of a state, or of m states (m,): a cue ball in hand counts."""
    return states["object_balls"] | 1 << states["cue_balls"][..., 0]


def in_play(state: Any) -> Any:
    """Returns the balls that lie on the table: those of `on_table` except a cue ball in hand."""
    return state["object_balls"] if state["in_hand"] else on_table(state)


@inlined
def verdict(foul=NO_FOUL, points=0, penalty=0, continues=False, spotted=0, rack=NO_RERACK):
    """Returns a verdict. By default nobody scores and the turn passes."""
    return Verdict(foul, points, penalty, continues, spotted, rack)


@inlined
def write_verdict(verdict, row):  # out: row
    """Writes a `Verdict` to a row of `VERDICT`."""
    row.foul, row.points, row.penalty = verdict.foul, verdict.points, verdict.penalty
    row.continues, row.spotted, row.rack = verdict.continues, verdict.spotted, verdict.rack


@inlined
def end(state, winner):
    """Ends a game; `winner` is -1 if nobody wins."""
    state.over, state.winner = True, winner


@inlined
def lowest(balls):
    """Returns the lowest ball number in a set that is not empty."""
    return size((balls & -balls) - 1)


@inlined
def size(balls):
    """Returns the number of balls in a set."""
    number = 0
    while balls != 0:
        balls &= balls - 1
        number += 1
    return number
