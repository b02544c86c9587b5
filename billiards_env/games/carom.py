"""The rules of carom games.

"UMB" is the World Rules of Carom Billiard of the Union Mondiale de Billard, edition of 1 January 1989. Only its table
of contents was available (3cushionbilliards.com). The content of the articles 27 to 29 and of paper F follows secondary
sources, such as the house rules of New Mexico Tech (infohost.nmt.edu/~billiard). When the turn changes, the two cue
balls are swapped, so with two players each player has one cue ball.

By default the first player who reaches the target score wins. With a limit of innings (`Setup.innings`) all players
have the same number of innings (UMB, art. 29), so there is an equalising inning.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

from billiards_env.games.entry import Game, no_spots
from billiards_env.games.facts import USUAL, cushions_before_first, cushions_before_last, touched
from billiards_env.games.game_state import (
    DRIVEN_OFF,
    NO_FOUL,
    NO_RERACK,
    NOT_IN_HAND,
    PUSH,
    RERACK,
    RERACK_ALL,
    Count,
    FoundBalls,
    FoundNumber,
    end,
    verdict,
)
from billiards_env.games.placement import overlaps, touching_balls
from billiards_env.games.pool import leader
from billiards_env.jit import inlined
from billiards_env.physics.state import X, Y

FACTS = *USUAL, cushions_before_first, touched, cushions_before_last
RED = 1 << 1
CUSHIONS_TO_TOUCH = 3
"""The cushion contacts before the second ball in three-cushion carom."""


class Carom(NamedTuple):
    """The own state of carom.

    Attributes:
        innings: The number of innings of each player; 0 for no limit.
        touching: The object balls that touch the cue ball.
        inning: With a limit of innings, the number of innings that all players have played.
    """

    innings: FoundNumber = 0
    touching: FoundBalls = 0
    inning: Count = 0


@inlined
def red_to_open(state, player):
    """Returns the balls that a player may touch first in carom: on the opening shot the red ball (1), then any."""
    return RED if state.break_shot else state.object_balls


@inlined
def is_carom(touched, cushions_before_last, n_object_balls, cushions):
    """Returns whether the cue ball touches every object ball, the last one after some cushion contacts (UMB, art. 24).

    Several contacts with the same cushion count.
    """
    return touched == n_object_balls and cushions_before_last >= cushions


@inlined
def carom(state, facts, call):
    """Judges a shot of carom (UMB, art. 24 and 61).

    The shooter scores a point and continues if the cue ball touches both other balls. The opening shot must first touch
    the red ball, number 1, before a cushion (23). The game is over when a player reaches the target score.

    If the cue ball touches a ball at the start of a shot, the player plays away from it, or has the balls set up again
    (27). It is a foul to hit such a ball first, before a cushion, or to drive a ball off the table; the balls are then
    set up again (28). A foul scores nothing.

    With a limit of innings, a player who reaches the target score ends the turn, and the next player plays from the
    starting position. The game is over at the end of the last inning, or of the inning in which a player reaches the
    target score. The highest score then wins; a tie has no winner (29).
    """
    return _carom(state, facts, 0)


@inlined
def three_cushion(state, facts, call):
    """Judges a shot of three-cushion carom: three cushion contacts come before the second ball (UMB, art. 83)."""
    return _carom(state, facts, CUSHIONS_TO_TOUCH)


@inlined
def _carom(state, facts, cushions):
    foul = PUSH if facts.first & state.touching != 0 and facts.cushions_before_first == 0 else NO_FOUL
    state.touching, off = 0, facts.driven_off | (1 << state.cue_balls[0] if facts.cue_off else 0)
    if off != 0:
        foul = DRIVEN_OFF
    legal = foul == NO_FOUL and facts.first & red_to_open(state, state.player) != 0
    legal = legal and not (state.break_shot and facts.cushions_before_first > 0)
    points = 1 if legal and is_carom(facts.touched, facts.cushions_before_last, 2, cushions) else 0
    reached = 0 < state.target <= state.scores[state.player] + points
    if state.innings == 0:
        if reached:
            end(state, state.player)
        return verdict(foul, points, continues=points > 0, spotted=off)
    continues, last = points > 0 and not reached, state.player == state.n_players - 1
    if not continues and last:
        state.inning += 1
        if state.inning == state.innings or 0 < state.target <= best_score(state, points):
            end(state, leader(state, points))
    return verdict(foul, points, 0, continues, off, RERACK_ALL if reached and not last else NO_RERACK)


@inlined
def best_score(state, points):
    """Returns the highest score after `points` for the shooter."""
    best = state.scores[state.player] + points
    for player in range(state.n_players):
        best = max(best, state.scores[player])
    return best


@inlined
def look(table, positions, state):
    """Finds the balls that touch the cue ball. The player may then have the balls set up again (UMB, art. 27)."""
    state.touching = touching_balls(table, positions, state)
    if state.touching != 0:
        state.choices |= 1 << RERACK


@inlined
def on_starting_spots(table, positions, others, cue):
    """Places the balls as for the opening shot of a cue ball (UMB, art. 23), as `Game.rack`."""
    for ball, spot in ((cue, 0), (1, 1), (2 - cue, 2)):
        positions[ball, X], positions[ball, Y] = table.spots[spot, X], table.spots[spot, Y]
    return NOT_IN_HAND


@inlined
def starting_position(table, positions, state, kind):
    """Sets up the balls as for the opening shot (UMB, art. 27), as `Game.without_shot`."""
    on_starting_spots(table, positions, 0, state.cue_balls[0])


@inlined
def set_up_all(table, positions, state, verdict):
    """Sets up the balls as for the opening shot after one is driven off the table (UMB, art. 28), as `Game.settle`."""
    if verdict.spotted != 0:
        on_starting_spots(table, positions, 0, state.cue_balls[0])


@inlined
def touching_on_spots(table, positions, state, kind):
    """Sets up the cue ball and the balls that touch it on their spots (UMB, art. 27), as `Game.without_shot`."""
    on_spots(table, positions, state, state.touching | 1 << state.cue_balls[0])


@inlined
def driven_on_spots(table, positions, state, verdict):
    """Sets up the balls that are driven off the table on their spots (UMB, art. 28), as `Game.settle`."""
    on_spots(table, positions, state, verdict.spotted)


@inlined
def on_spots(table, positions, state, moved):
    """Places some balls on the spots of three-cushion carom (UMB, paper F).

    The spots are the foot spot for the red ball, the head spot for the cue ball and the centre spot for the other ball.
    If a ball that stays blocks the spot of another ball, that ball goes to the spot of the blocking ball.
    """
    cue, other = state.cue_balls
    for ball in (1, other, cue):
        if moved >> ball & 1:
            owner = ball
            for stays in (1, other, cue, 1, other):  # the spot of the first blocking ball may be blocked as well
                x, y = spot_of(table, owner, cue)
                if moved >> stays & 1 == 0 and overlaps(table, positions, stays, x, y):
                    owner = stays
            positions[ball, X], positions[ball, Y] = spot_of(table, owner, cue)


@inlined
def spot_of(table, ball, cue):
    """Returns the spot of a ball in three-cushion carom, m: foot spot, head spot or centre spot."""
    if ball == 1:
        return table.foot_x, 0.0
    return table.head_x if ball == cue else 0.0, 0.0


_POINT = ("point", "the cue ball of the player, white or yellow, touches both other balls; the player continues")
_CAROM = functools.partial(
    Game,
    legal=red_to_open,
    scene="carom",
    layouts=("carom_opening", "random"),
    n_object_balls=(2, 2),
    won_by="`target` points",
    cue_balls=(0, 2),
    editions=("1989",),
    sources=("Union Mondiale de Billard (UMB), 1 January 1989; contacts, fouls and innings: secondary sources",),
    left_out=(("29", "without `innings`, the first player who reaches the target score wins"),),
    target=lambda balls: 10,
    pockets=False,
    choices=("rerack",),
    spot=no_spots,
    rack=on_starting_spots,
    settle=set_up_all,
    look=look,
    state=lambda balls: Carom(),
    facts=FACTS,
    without_shot=starting_position,
)
_TOUCHING = ("touching balls", "the player plays away from a ball that touches the cue ball")
GAMES = {
    "carom": _CAROM(carom, page=(("to win", "score the target"), _POINT, _TOUCHING)),
    "three_cushion": _CAROM(
        three_cushion,
        cushions=CUSHIONS_TO_TOUCH,
        settle=driven_on_spots,
        without_shot=touching_on_spots,
        page=(
            ("to win", "score the target"),
            _POINT,
            _TOUCHING,
            ("cushions", "the cue ball hits three or more before it touches the second ball"),
        ),
    ),
}
