"""The games by name, and functions that judge arrays of shots."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_env.checks import choose
from billiards_env.jit.specialised import specialised
from billiards_env.rules.carom import carom, red_to_open, three_cushion
from billiards_env.rules.pool import eight_ball, group_or_eight, nine_ball, straight
from billiards_env.rules.snooker import balls_on, snooker
from billiards_env.rules.state import VERDICT, any_ball, lowest_ball

Kernel = Callable[..., Any]


class Game(NamedTuple):
    """The rules of a game, as kernels.

    Attributes:
        judge: `(state, legal, facts, call)`, numbers as in `rules.state` and `rules.facts`; returns `VerdictNumbers`.
        legal: `(state, player)`, returns the balls that the player may touch first.
    """

    judge: Kernel
    legal: Kernel


GAMES = {
    "straight": Game(straight, any_ball),
    "eight_ball": Game(eight_ball, group_or_eight),
    "nine_ball": Game(nine_ball, lowest_ball),
    "snooker": Game(snooker, balls_on),
    "carom": Game(carom, red_to_open),
    "three_cushion": Game(three_cushion, red_to_open),
}


def judge_shots(
    game: str, states: NDArray[Any], facts: NDArray[Any], calls: NDArray[Any], verdicts: NDArray[Any] | None = None
) -> NDArray[Any]:
    """Judges m shots: candidates from one position, or shots of different games.

    Args:
        game: One of `GAMES`.
        states: (m,) `STATE`, the state of the rules before each shot.
        facts: (m,) `FACTS`, the facts of each shot.
        calls: (m,) `CALL`, the call of each shot.
        verdicts: (m,) `VERDICT` out; None for a new array.

    Returns:
        (m,) `VERDICT`.

    Raises:
        ValueError: If the game is unknown or the arrays have different lengths.
    """
    choose("game", game, tuple(GAMES))
    if verdicts is None:
        verdicts = np.empty(len(states), VERDICT)
    if not len(states) == len(facts) == len(calls) == len(verdicts):
        lengths = len(states), len(facts), len(calls), len(verdicts)
        raise ValueError(f"states, facts, calls and verdicts of lengths {lengths}: expected one length")
    _judging(game)(states, facts, calls, verdicts)
    return verdicts


def legal_balls(game: str, states: NDArray[Any], players: NDArray[np.int64]) -> NDArray[np.int64]:
    """Returns the balls that players may touch first.

    Args:
        game: One of `GAMES`.
        states: (m,) `STATE`.
        players: (m,) the players.

    Returns:
        (m,) sets of balls.
    """
    balls = np.empty(len(states), np.int64)
    _finding(game)(states, players, balls)
    return balls


judge, legal = GAMES["straight"]  # `specialised` puts the kernels of each game in their place


def _write_verdicts(states, facts, calls, verdicts):
    for k in range(len(states)):
        state = states[k]
        found = judge(state, legal(state, state.player), facts[k], calls[k])
        row = verdicts[k]
        row.foul, row.points, row.continues, row.in_hand = found.foul, found.points, found.continues, found.in_hand
        row.spotted, row.solids, row.over, row.winner = found.spotted, found.solids, found.over, found.winner
        row.penalty, row.rack, row.choices, row.colour = found.penalty, found.rack, found.choices, found.colour


def _write_legal_balls(states, players, balls):
    for k in range(len(states)):
        balls[k] = legal(states[k], players[k])


@functools.cache
def _judging(game: str) -> Kernel:
    return specialised(_write_verdicts, **GAMES[game]._asdict())


@functools.cache
def _finding(game: str) -> Kernel:
    return specialised(_write_legal_balls, legal=GAMES[game].legal)
