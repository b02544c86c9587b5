"""The rules of carom games.

"UMB" is the World Rules of Carom Billiard of the Union Mondiale de Billard (1989). A game has no equalising inning.
When the turn changes, the two cue balls are swapped, so with two players each player has one cue ball.
"""

from __future__ import annotations

import functools

from billiards_env.games.entry import Game, no_spots
from billiards_env.games.game_state import end, verdict
from billiards_env.jit import inlined

RED = 1 << 1
CUSHIONS_TO_TOUCH = 3
"""The cushion contacts before the second ball in three-cushion carom."""


@inlined
def red_to_open(state, player):
    """Returns the balls that a player may touch first in carom: on the opening shot the red ball (1), then any."""
    return RED if state.break_shot else state.object_balls


@inlined
def is_carom(facts, n_object_balls, cushions):
    """Returns whether the cue ball touches every object ball, the last one after some cushion contacts (UMB, art. 24).

    Several contacts with the same cushion count.
    """
    return facts.touched == n_object_balls and facts.cushions_before_last >= cushions


@inlined
def carom(state, facts, call):
    """Judges a shot of carom (UMB, art. 24 and 61).

    The shooter scores a point and continues if the cue ball touches both other balls. The opening shot must first touch
    the red ball, number 1. The game is over when a player reaches the target score.
    """
    return _carom(state, facts, 0)


@inlined
def three_cushion(state, facts, call):
    """Judges a shot of three-cushion carom: three cushion contacts come before the second ball (UMB, art. 83)."""
    return _carom(state, facts, CUSHIONS_TO_TOUCH)


@inlined
def _carom(state, facts, cushions):
    if not is_carom(facts, 2, cushions) or facts.first & red_to_open(state, state.player) == 0:
        return verdict()
    if 0 < state.target <= state.scores[state.player] + 1:
        end(state, state.player)
    return verdict(points=1, continues=True)


_POINT = ("point", "the cue ball of the player, white or yellow, touches both other balls; the player continues")
_CAROM = functools.partial(
    Game,
    legal=red_to_open,
    scene="carom",
    layouts=("carom_opening", "random"),
    n_object_balls=(2, 2),
    won_by="`target` points",
    cue_balls=(0, 2),
    target=lambda balls: 10,
    pockets=False,
    spot=no_spots,
)
GAMES = {
    "carom": _CAROM(carom, page=(("to win", "score the target"), _POINT)),
    "three_cushion": _CAROM(
        three_cushion,
        cushions=CUSHIONS_TO_TOUCH,
        page=(
            ("to win", "score the target"),
            _POINT,
            ("cushions", "the cue ball hits three or more before it touches the second ball"),
        ),
    ),
}
