"""The state of a game, the facts of a shot, the call and the verdict: one structured type each.

`STATE`, `FACTS`, `CALL` and `VERDICT` are the types of arrays of m games or shots; a single game is a row. The classes
`RulesState`, `Facts`, `Called` and `Verdict` describe their fields, and `row(RulesState(player=1))` makes a row.
Compiled code reads and changes rows. Sets of balls are bit masks: bit i is ball i. `to_dict` converts a row to a dict
of names and tuples.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple, get_type_hints

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

OfPlayers = tuple[int, int, int, int]
Pair = tuple[int, int]

IN_HAND = ("no", "behind", "anywhere")
"""Whether the cue ball is in hand (WPA 1.5): not in hand, behind the head string (in snooker in the D), or anywhere on
the table."""
NOT_IN_HAND, BEHIND, ANYWHERE = range(len(IN_HAND))

FOULS = ("", "scratch", "no_hit", "wrong_ball", "wrong_pot", "no_cushion", "illegal_break", "breaking_foul", "push")
FOULS += ("free_ball", "driven_off")
"""The fouls; "" means no foul. "scratch" is a potted cue ball, "wrong_pot" a potted ball that is not on,
"breaking_foul" a bad opening break of straight pool, "push" a shot into a ball that touches the cue ball, "free_ball" a
snooker behind the free ball, "driven_off" an object ball driven off the table."""
NO_FOUL, SCRATCH, NO_HIT, WRONG_BALL, WRONG_POT, NO_CUSHION, ILLEGAL_BREAK, BREAKING_FOUL = range(8)
PUSH, FREE_BALL, DRIVEN_OFF = range(8, len(FOULS))

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


class RulesState(NamedTuple):
    """The state of the rules between two shots: everything except the positions of the balls.

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
        solids: In eight ball, the player who has the balls 1 to 7; -1 while the table is open.
        target: The score that wins, or 0 if no score does.
        call_shot: Whether shots are called: a potted ball counts only if the ball and its pocket were called (WPA 1.6).
        miss: Whether snooker is played with the miss rule.
        edition: Index in `Game.editions` of the edition of the rules.
        innings: In carom, the number of innings of each player; 0 for no limit.
        reds: In snooker, the number of red balls of a full table: the balls 1 to `reds`.
        colour: In snooker, whether a colour of the player's choice is on.
        free_ball: Whether the player has a free ball (snooker) or a free shot (blackball).
        touching: In snooker and carom, the object balls that touch the cue ball.
        in_sight: In snooker with the miss rule, whether the cue ball can hit a ball on full.
        misses: In snooker, the number of misses in a row that the player made from this position.
        inning: In carom with a limit of innings, the number of innings that all players have played.
        breaker: The player who played the last opening break.
        idle: The number of shots in a row without a pot, a point or a foul.
        over: Whether the game is over.
        winner: The player who has won, or -1.
    """

    player: int = 0
    n_players: int = 2
    scores: OfPlayers = (0, 0, 0, 0)
    fouls: OfPlayers = (0, 0, 0, 0)
    balls: int = 0
    object_balls: int = 0
    cue_balls: Pair = (CUE_BALL, CUE_BALL)
    break_shot: bool = False
    in_hand: int = NOT_IN_HAND
    choices: int = 0
    solids: int = -1
    target: int = 0
    call_shot: bool = False
    miss: bool = False
    edition: int = 0
    innings: int = 0
    reds: int = 0
    colour: bool = False
    free_ball: bool = False
    touching: int = 0
    in_sight: bool = False
    misses: int = 0
    inning: int = 0
    breaker: int = 0
    idle: int = 0
    over: bool = False
    winner: int = -1


class Called(NamedTuple):
    """The call of a shot.

    Attributes:
        ball: The called ball, in snooker the nominated one; -1 for none.
        kind: Index in `CALLS`.
        made: Whether the shot pots the called ball in the called pocket (WPA 1.6).
    """

    ball: int = -1
    kind: int = SHOT
    made: bool = False


class Facts(NamedTuple):
    """The facts of a shot that the rules use. A set of balls never holds the ball that is struck.

    Attributes:
        first: The balls that the cue ball touched first; several if it touched them at the same instant.
        cushions_before_first: Number of cushion contacts of the cue ball before it touched these balls.
        touched: Number of balls that the cue ball touched.
        cushions_before_last: Number of cushion contacts of the cue ball before it touched the last of these balls.
        potted: The potted object balls.
        first_potted: The object ball that was potted first, as a set; 0 if there is none.
        banked: The potted object balls that the cue ball touched first, before it hit a cushion itself, and that hit a
            cushion; a jaw of a pocket counts.
        foot_right: The object balls potted in pocket 2, the foot corner with y < 0 of `scene.six_pockets`.
        foot_left: The object balls potted in pocket 3, the foot corner with y > 0.
        scratch: Whether the cue ball was potted.
        cushion_after: Whether any ball hit a cushion or was potted after the cue ball's first contact with a ball.
        driven: The object balls that hit a cushion or were potted (WPA 8.4).
        cue_driven: Whether the cue ball hit a cushion or was potted (WPA 8.4).
        driven_off: The object balls that were driven off the table, in scenes with flight.
        cue_off: Whether the cue ball was driven off the table.
        hidden: In snooker, whether the free ball hides all balls on at the end of the shot; see `Game.see`.
    """

    first: int = 0
    cushions_before_first: int = 0
    touched: int = 0
    cushions_before_last: int = 0
    potted: int = 0
    first_potted: int = 0
    banked: int = 0
    foot_right: int = 0
    foot_left: int = 0
    scratch: bool = False
    cushion_after: bool = False
    driven: int = 0
    cue_driven: bool = False
    driven_off: int = 0
    cue_off: bool = False
    hidden: bool = False


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

    foul: int = NO_FOUL
    points: int = 0
    penalty: int = 0
    continues: bool = False
    spotted: int = 0
    rack: int = NO_RERACK


def _row_type(fields: type) -> np.dtype[Any]:
    """Returns the type of the rows of a structured array with the fields of a NamedTuple.

    The bools come last, and the zero bytes of `spare` fill a row to a multiple of 8 bytes. Each byte of a row then
    belongs to a field. NumPy does not copy gaps between fields, so equal rows with gaps could have different bytes.
    """
    kinds = {int: np.int64, bool: np.bool_, OfPlayers: (np.int64, MOST_PLAYERS), Pair: (np.int64, 2)}
    types = sorted(get_type_hints(fields).items(), key=lambda item: item[1] is bool)
    packed = np.dtype([(name, kinds[kind]) for name, kind in types])
    spare = ("spare", f"S{-packed.itemsize % 8}")
    return np.dtype((np.record, np.dtype([*packed.descr, spare], align=True)))


STATE, CALL, FACTS, VERDICT = (_row_type(fields) for fields in (RulesState, Called, Facts, Verdict))
_TYPES = {RulesState: STATE, Called: CALL, Facts: FACTS, Verdict: VERDICT}

_NAMES = {"foul": FOULS, "in_hand": IN_HAND, "rack": RERACKS, "kind": CALLS, "choices": CALLS}
_SETS = {"balls", "object_balls", "choices", "first", "potted", "first_potted", "banked", "foot_right", "foot_left"}
_SETS |= {"driven", "driven_off", "spotted", "touching"}


def row(fields: RulesState | Called | Facts | Verdict) -> Any:
    """Returns a row of a structured array."""
    made = np.zeros(1, _TYPES[type(fields)])
    for name, value in fields._asdict().items():
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
        value, names = row[name].tolist(), _NAMES.get(name)
        if name in _SETS:
            value = members(value)
        elif isinstance(value, list):
            value = tuple(value[: row["n_players"]] if len(value) == MOST_PLAYERS else dict.fromkeys(value))
        if names is not None:
            value = tuple(names[i] for i in value) if name in _SETS else names[value]
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
    for name in ("player", "breaker"):
        player = states[name]
        if not ((player >= 0) & (player < players) & (players <= MOST_PLAYERS)).all():
            raise ValueError(f"{name} = {short(player)} of {short(players)} players: expected 0 to the number less 1")
    if not ((cues >= 0) & (cues < n_balls)).all():
        raise ValueError(f"cue_balls = {short(cues)}: expected numbers of balls")
    for name, bits in (*((name, n_balls) for name in ("balls", "object_balls", "touching")), ("choices", len(CALLS))):
        if np.count_nonzero(states[name] >> bits):  # -1 for a negative number
            raise ValueError(f"{name} = {short(states[name])}: expected a set of numbers below {bits}")
    for name, most in (("reds", n_balls - 1), ("in_hand", len(IN_HAND) - 1)):
        if not ((states[name] >= 0) & (states[name] <= most)).all():
            raise ValueError(f"{name} = {short(states[name])}: expected 0 to {most}")


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
def with_hidden(facts, hidden):
    """Returns `Facts` with another value of `hidden`."""
    return Facts(
        facts.first,  # numba accepts at most 30 values and names
        facts.cushions_before_first,
        facts.touched,
        facts.cushions_before_last,
        facts.potted,
        first_potted=facts.first_potted,
        banked=facts.banked,
        foot_right=facts.foot_right,
        foot_left=facts.foot_left,
        scratch=facts.scratch,
        cushion_after=facts.cushion_after,
        driven=facts.driven,
        cue_driven=facts.cue_driven,
        driven_off=facts.driven_off,
        cue_off=facts.cue_off,
        hidden=hidden,
    )


@inlined
def end(state, winner):
    """Ends a game; `winner` is -1 if nobody wins."""
    state.over, state.winner = True, winner


@inlined
def size(balls):
    """Returns the number of balls in a set."""
    number = 0
    while balls != 0:
        balls &= balls - 1
        number += 1
    return number
