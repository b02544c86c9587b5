"""The table of the games, and functions that judge arrays of shots."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_env.checks import one_of
from billiards_env.jit import specialised
from billiards_env.physics.state import CUE_BALL
from billiards_env.rules.arrays import MOST_PLAYERS, VERDICT
from billiards_env.rules.carom import CUSHIONS, carom, red_to_open, three_cushion
from billiards_env.rules.pool import any_ball, eight_ball, group_or_eight, lowest_ball, nine_ball, straight
from billiards_env.rules.snooker import balls_on, snooker

Kernel = Callable[..., Any]


class Game(NamedTuple):
    """A game: its rules as kernels, and its settings.

    Attributes:
        name: The name of the game.
        kernel: `(state, legal, facts, call)`, numbers as in `rules.arrays`; returns the
            `VerdictNumbers` of a shot.
        legal_kernel: `(state, player)`, returns the balls that the player may touch first.
        scene: The name of the usual scene.
        layouts: The opening layouts; the first is the default. "random" has no break.
        n_object_balls: The smallest and the largest number of object balls; the largest is the default.
        n_players: The smallest and the largest number of players.
        cue_balls: The balls used as cue ball.
        target: The default score that wins, or 0 if no score does; None for a game that is not won by points.
        call_kernel: `(state, player)`, returns the balls that the player may call; None for a game without called shots
            and safeties.
        choices: The choices that a player may have besides a shot, of `CALLS`.
        counts_fouls: Whether consecutive fouls are penalised.
        deciding_ball: The ball that stays on the table until the end of the game, -1 for the last; None for none.
        has_spots: Whether each colour returns to its own spot, as in snooker. Otherwise balls return to the foot spot.
        pockets: Whether the table has pockets.
        groups: Whether each player has a group of seven balls and then the eight ball.
        pots_any: Whether a legal shot may pot any ball, and not only those that may be touched first.
        cushions: The cushion contacts that the cue ball needs before the last ball of a carom.
        sure_pot: For players: the expected points of a turn with a sure pot, in a game that is won by points.
    """

    name: str
    kernel: Kernel
    legal_kernel: Kernel
    scene: str
    layouts: tuple[str, ...]
    n_object_balls: tuple[int, int]
    n_players: tuple[int, int] = (2, MOST_PLAYERS)
    cue_balls: tuple[int, ...] = (CUE_BALL,)
    target: int | None = None
    call_kernel: Kernel | None = None
    choices: tuple[str, ...] = ()
    counts_fouls: bool = False
    deciding_ball: int | None = None
    has_spots: bool = False
    pockets: bool = True
    groups: bool = False
    pots_any: bool = False
    cushions: int = 0
    sure_pot: float = 1.0


_POOL = functools.partial(Game, scene="pool", layouts=("rack", "tight_rack", "random"))
_CAROM = functools.partial(
    Game,
    legal_kernel=red_to_open,
    scene="carom",
    layouts=("carom_opening", "random"),
    n_object_balls=(2, 2),
    cue_balls=(0, 2),
    target=10,
    pockets=False,
)

GAMES = {
    game.name: game
    for game in (
        _POOL(
            "straight",
            straight,
            any_ball,
            n_object_balls=(1, 15),
            target=0,
            call_kernel=any_ball,
            counts_fouls=True,
            sure_pot=4.0,
        ),
        _POOL(
            "eight_ball",
            eight_ball,
            group_or_eight,
            n_object_balls=(15, 15),
            n_players=(2, 2),
            call_kernel=group_or_eight,
            deciding_ball=8,
            groups=True,
        ),
        _POOL(
            "nine_ball",
            nine_ball,
            lowest_ball,
            n_object_balls=(9, 9),
            choices=("push_out", "hand_back"),
            counts_fouls=True,
            deciding_ball=9,
            pots_any=True,
        ),
        Game(
            "snooker",
            snooker,
            balls_on,
            scene="snooker",
            layouts=("snooker", "random"),
            n_object_balls=(6, 21),
            n_players=(2, 2),
            target=0,
            choices=("hand_back", "replace"),
            deciding_ball=-1,
            has_spots=True,
            sure_pot=8.0,
        ),
        _CAROM("carom", carom),
        _CAROM("three_cushion", three_cushion, cushions=CUSHIONS),
    )
}


def judge_shots(game: str, states: NDArray[Any], facts: NDArray[Any], calls: NDArray[Any]) -> NDArray[Any]:
    """Judges m shots of one game: candidates from one position, or shots from different states.

    Args:
        game: One of `GAMES`.
        states: (m,) `STATE`, the state of the rules before each shot.
        facts: (m,) `FACTS`, the facts of each shot.
        calls: (m,) `CALL`, the call of each shot.

    Returns:
        (m,) `VERDICT`.

    Raises:
        ValueError: If the game is unknown or the arrays have different lengths.

    Example:
        >>> from billiards_env.rules import CALL, FACTS, FOULS, STATE
        >>> states, facts, calls = (np.zeros(3, kind) for kind in (STATE, FACTS, CALL))
        >>> states["object_balls"], facts["first"] = 1 << 4 | 1 << 9, [0, 1 << 4, 1 << 9]
        >>> [FOULS[foul] for foul in judge_shots("nine_ball", states, facts, calls)["foul"]]
        ['no_hit', 'no_cushion', 'wrong_ball']
    """
    one_of("game", game, tuple(GAMES))
    lengths = len(states), len(facts), len(calls)
    if len(set(lengths)) > 1:
        raise ValueError(f"states, facts and calls of lengths {lengths}: expected one length")
    verdicts = np.empty(len(states), VERDICT)
    _judging(GAMES[game].kernel, GAMES[game].legal_kernel)(states, facts, calls, verdicts)
    return verdicts


def legal_balls(game: str, states: NDArray[Any], players: NDArray[np.int64]) -> NDArray[np.int64]:
    """Returns the balls that players may touch first.

    Args:
        game: One of `GAMES`.
        states: (m,) `STATE`.
        players: (m,) the players.

    Returns:
        (m,) sets of balls.

    Raises:
        ValueError: If the game is unknown.
    """
    one_of("game", game, tuple(GAMES))
    return _balls(GAMES[game].legal_kernel, states, players)


def callable_balls(game: str, states: NDArray[Any], players: NDArray[np.int64]) -> NDArray[np.int64]:
    """Returns the balls that players may call; the arguments are as in `legal_balls`.

    Raises:
        ValueError: If the game is unknown or has no called shots.
    """
    one_of("game", game, tuple(name for name in GAMES if GAMES[name].call_kernel))
    return _balls(GAMES[game].call_kernel, states, players)


judge, legal = straight, any_ball  # `specialised` puts the kernels of each game in their place


def _write_verdicts(states, facts, calls, verdicts):
    for k in range(len(states)):
        state = states[k]
        verdict = judge(state, legal(state, state.player), facts[k], calls[k])
        row, following = verdicts[k], verdict.next_shot
        row.foul, row.points, row.penalty, row.continues = (
            verdict.foul,
            verdict.points,
            verdict.penalty,
            verdict.continues,
        )
        row.spotted, row.over, row.winner = verdict.spotted, verdict.over, verdict.winner
        row.in_hand, row.choices, row.rack = following.in_hand, following.choices, following.rack
        row.solids, row.colour = following.solids, following.colour


def _write_legal_balls(states, players, balls):
    for k in range(len(states)):
        balls[k] = legal(states[k], players[k])


def _balls(kernel: Kernel | None, states: NDArray[Any], players: NDArray[np.int64]) -> NDArray[np.int64]:
    balls = np.empty(len(states), np.int64)
    _finding(kernel)(states, players, balls)
    return balls


@functools.cache
def _judging(kernel: Kernel, legal_kernel: Kernel) -> Kernel:
    return specialised(_write_verdicts, judge=kernel, legal=legal_kernel)


@functools.cache
def _finding(kernel: Kernel) -> Kernel:
    return specialised(_write_legal_balls, legal=kernel)
