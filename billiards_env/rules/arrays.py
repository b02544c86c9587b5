"""The states, facts, calls and verdicts of shots, as arrays and as numbers.

A kernel takes the numbers of one shot: a row of a structured array, or a NamedTuple. `STATE`, `FACTS`, `CALL` and
`VERDICT` are the types of the structured arrays; they have the fields of the NamedTuples. A set of balls is a bit
mask: bit i is ball i. A set of balls never holds the ball that is struck.
"""

from __future__ import annotations

from typing import Any, NamedTuple, get_type_hints

import numpy as np

from billiards_env.jit import inlined

MOST_PLAYERS = 4
Scores = tuple[int, int, int, int]

IN_HAND = ("no", "behind", "anywhere")
"""Whether the cue ball is in hand (WPA 1.5): not in hand, behind the head string (in snooker in the D), or anywhere on
the table."""
NOT_IN_HAND, BEHIND, ANYWHERE = range(len(IN_HAND))

FOULS = ("", "scratch", "no_hit", "wrong_ball", "wrong_pot", "no_cushion", "illegal_break", "breaking_foul")
"""The fouls; "" means no foul. "scratch" is a potted cue ball, "wrong_pot" a potted ball that is not on (snooker),
"breaking_foul" a bad opening break of straight pool."""
NO_FOUL, SCRATCH, NO_HIT, WRONG_BALL, WRONG_POT, NO_CUSHION, ILLEGAL_BREAK, BREAKING_FOUL = range(len(FOULS))

CALLS = ("shot", "safety", "push_out", "hand_back", "replace")
"""The kinds of calls.

* "shot": an ordinary shot.
* "safety": the turn passes after the shot, even if it pots a ball (WPA 3.6, 4.5).
* "push_out": the cue ball need not touch a ball or a cushion (WPA 2.4).
* "hand_back": no shot; the previous player plays the next one (WPA 2.4, WPBSA 3.11).
* "replace": no shot; the balls return to their positions before the foul, and the previous player plays again (WPBSA
  3.14).

`RuleState.choices` lists those of the last three that a player has.
"""
SHOT, SAFETY, PUSH_OUT, HAND_BACK, REPLACE = range(len(CALLS))

RERACKS = ("", "all", "rest")
"""The new racks after a shot: none; all object balls, and the next shot is a break; all object balls except the last
one on the table (WPA 4.4)."""
NO_RERACK, RERACK_ALL, RERACK_REST = range(len(RERACKS))


class StateNumbers(NamedTuple):
    """The state of the rules before a shot.

    The other fields mean the same as in `games.judging.RuleState`.

    Attributes:
        scores: The score of each player, 0 after the last of `n_players`.
        object_balls: The balls on the table.
        fouls: Number of consecutive fouls of the player to shoot.
    """

    player: int
    n_players: int
    scores: Scores
    object_balls: int
    break_shot: bool
    solids: int
    target: int
    call_shot: bool
    reds: int
    fouls: int
    colour: bool
    free_ball: bool


class CallNumbers(NamedTuple):
    """The call of a shot.

    Attributes:
        ball: The called ball, in snooker the nominated one; -1 for none.
        kind: Index in `CALLS`.
        made: Whether the shot pots the called ball in the called pocket (WPA 1.6).
    """

    ball: int
    kind: int
    made: bool


class FactNumbers(NamedTuple):
    """The facts of a shot, see `games.judging.Facts`. A set of balls is a bit mask.

    Attributes:
        first: The balls that the cue ball touched first; several if it touched them at the same instant.
        touched: Number of balls that the cue ball touched.
        cushions_before_last: Number of cushion contacts of the cue ball before it touched the last one of these.
        potted: The potted object balls.
        first_potted: The one that was potted first; 0 if there is none or the order is not known.
        scratch: Whether the cue ball was potted.
        cushion_after: Whether any ball hit a cushion or was potted after the cue ball's first contact with a ball.
        driven: The object balls that hit a cushion or were potted (WPA 8.4).
        cue_driven: Whether the cue ball hit a cushion or was potted (WPA 8.4).
    """

    first: int
    touched: int
    cushions_before_last: int
    potted: int
    first_potted: int
    scratch: bool
    cushion_after: bool
    driven: int
    cue_driven: bool


class NextShot(NamedTuple):
    """What a verdict changes for the next shot, beside the turn.

    Attributes:
        in_hand: Index in `IN_HAND`.
        choices: Bit i is `CALLS[i]`.
        rack: Index in `RERACKS`.
        solids: As in `StateNumbers`.
        colour: As in `StateNumbers`.
    """

    in_hand: int
    choices: int
    rack: int
    solids: int
    colour: bool


class VerdictNumbers(NamedTuple):
    """The judgement of a shot. `VERDICT` has the fields of `NextShot` in place of `next_shot`.

    The other fields mean the same as in `games.judging.Verdict`.

    Attributes:
        foul: Index in `FOULS`.
        next_shot: What changes for the next shot.
    """

    foul: int
    points: int
    penalty: int
    continues: bool
    spotted: int
    next_shot: NextShot
    over: bool
    winner: int


def row_type(*numbers: type) -> np.dtype[Any]:
    """Returns the type of the rows of a structured array with the fields of NamedTuples."""
    kinds = {int: np.int64, bool: np.bool_, Scores: (np.int64, MOST_PLAYERS)}
    hints = {name: kind for fields in numbers for name, kind in get_type_hints(fields).items()}
    fields = [(name, kinds[kind]) for name, kind in hints.items() if kind in kinds]
    return np.dtype((np.record, np.dtype(fields, align=True)))


STATE, FACTS, CALL = row_type(StateNumbers), row_type(FactNumbers), row_type(CallNumbers)
VERDICT = row_type(VerdictNumbers, NextShot)


@inlined
def next_shot(in_hand=NOT_IN_HAND, choices=0, rack=NO_RERACK, solids=-1, colour=False):
    """Returns what a verdict changes for the next shot."""
    return NextShot(in_hand, choices, rack, solids, colour)


AS_IT_LIES = NextShot(NOT_IN_HAND, 0, NO_RERACK, -1, False)


@inlined
def verdict(foul=NO_FOUL, points=0, penalty=0, continues=False, spotted=0, next_shot=AS_IT_LIES):
    """Returns a verdict with which the game goes on. By default nobody scores and the turn passes."""
    return VerdictNumbers(foul, points, penalty, continues, spotted, next_shot, False, -1)


@inlined
def game_over(last, winner):
    """Returns the verdict `last` as the end of the game; `winner` is -1 if nobody wins."""
    foul, points, penalty, continues, spotted, following, _, _ = last
    return VerdictNumbers(foul, points, penalty, continues, spotted, following, True, winner)


@inlined
def size(balls):
    """Returns the number of balls in a set."""
    number = 0
    while balls != 0:
        balls &= balls - 1
        number += 1
    return number
