"""The state of the rules, the calls and the verdicts, as numbers.

A kernel takes the numbers of one shot: a row of a structured array, or a NamedTuple. `STATE`, `CALL` and `VERDICT` are
the types of the structured arrays; their fields are those of the NamedTuples. A set of balls is a bit mask: bit i is
ball i. A set of balls never holds the ball that is struck.
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

RACKS = ("", "all", "rest")
"""The racks after a shot: none; all object balls, and the next shot is a break; all object balls except the last one on
the table (WPA 4.4)."""
NO_RACK, RACK_ALL, RACK_REST = range(len(RACKS))


class StateNumbers(NamedTuple):
    """The state of the rules before a shot.

    The other fields have the meanings of those of `games.state.RuleState`.

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
    called: bool
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


class VerdictNumbers(NamedTuple):
    """The judgement of a shot.

    The other fields have the meanings of those of `games.state.Verdict`.

    Attributes:
        foul: Index in `FOULS`.
        in_hand: Index in `IN_HAND`.
        rack: Index in `RACKS`.
        choices: Bit i is `CALLS[i]`.
    """

    foul: int
    points: int
    continues: bool
    in_hand: int
    spotted: int
    solids: int
    over: bool
    winner: int
    penalty: int
    rack: int
    choices: int
    colour: bool


def row_type(numbers: type) -> np.dtype[Any]:
    """Returns the type of the rows of a structured array with the fields of a NamedTuple."""
    kinds = {int: np.int64, bool: np.bool_, Scores: (np.int64, MOST_PLAYERS)}
    fields = [(name, kinds[kind]) for name, kind in get_type_hints(numbers).items()]
    return np.dtype((np.record, np.dtype(fields, align=True)))


STATE, CALL, VERDICT = row_type(StateNumbers), row_type(CallNumbers), row_type(VerdictNumbers)


@inlined
def verdict(
    foul=NO_FOUL,
    points=0,
    continues=False,
    in_hand=NOT_IN_HAND,
    spotted=0,
    solids=-1,
    over=False,
    winner=-1,
    penalty=0,
    rack=NO_RACK,
    choices=0,
    colour=False,
):
    """Returns a verdict. By default nobody scores and the turn passes."""
    return VerdictNumbers(
        foul, points, continues, in_hand, spotted, solids, over, winner, penalty, rack, choices, colour
    )


@inlined
def count(balls):
    """Returns the number of balls in a set."""
    number = 0
    while balls != 0:
        balls &= balls - 1
        number += 1
    return number


@inlined
def any_ball(state, player):
    """Returns the balls that a player may touch first in a game without a rule for it: every object ball."""
    return state.object_balls


@inlined
def lowest_ball(state, player):
    """Returns the lowest ball on the table, as a set."""
    return state.object_balls & -state.object_balls
