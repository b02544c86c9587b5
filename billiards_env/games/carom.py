"""The rules of carom games.

"UMB" is the World Rules of Carom Billiard of the Union Mondiale de Billard (1989). A game has no equalising inning.
When the turn changes, the two cue balls are swapped, so with two players each player has one cue ball.
"""

from __future__ import annotations

from billiards_env.games.facts import Facts
from billiards_env.games.state import NO_CALL, Call, RuleState, Verdict


def red_to_open(state: RuleState, player: int) -> frozenset[int]:
    """Returns the balls that a player may touch first in carom: on the opening shot the red ball (1), then any."""
    return frozenset({1}) if state.break_shot else state.object_balls


def carom(state: RuleState, facts: Facts, call: Call = NO_CALL, cushions: int = 0) -> Verdict:
    """Judges a shot of carom (UMB, art. 24 and 61).

    The shooter scores a point and continues if the cue ball touches both other balls. The opening shot must first touch
    the red ball, number 1. The game is over when a player reaches the target score.

    Args:
        state: The state before the shot.
        facts: The facts of the shot.
        call: Not used.
        cushions: The number of cushion contacts that the cue ball needs before it touches the second ball.

    Returns:
        The verdict.
    """
    scored = len(facts.touched) == 2 and facts.touched[1][1] >= cushions
    scored = scored and bool(red_to_open(state, state.player) & set(facts.first))
    won = scored and 0 < state.target <= state.scores[state.player] + 1
    return Verdict(points=int(scored), continues=scored, over=won, winner=state.player if won else -1)


def three_cushion(state: RuleState, facts: Facts, call: Call = NO_CALL) -> Verdict:
    """Judges a shot of three-cushion carom: `carom` with three cushion contacts before the second ball (UMB, art. 83).

    Args:
        state: The state before the shot.
        facts: The facts of the shot.
        call: Not used.

    Returns:
        The verdict.
    """
    return carom(state, facts, cushions=3)
