"""The rules of one-pocket, a game for two players.

The numbers are those of the "Official One Pocket Rules" of OnePocket.org, adopted on 19 January 2005
(onepocket.org/one_pocket_pool_rules.htm). The source is secondary: a copy of this text in
github.com/chalkysticks/api, `1_pocket_wpa.php`. A later edition dates from 9 October 2021.
`Game.left_out` lists the simplifications. The kernels have the arguments of `entry.Game`.
"""

from __future__ import annotations

import functools

from billiards_env.games.entry import Game
from billiards_env.games.facts import USUAL, foot_left, foot_right
from billiards_env.games.game_state import BEHIND, NO_FOUL, SCRATCH, end, size, verdict
from billiards_env.games.pool import any_ball, standard_foul
from billiards_env.jit import inlined


def majority(balls: int) -> int:
    """Returns the smallest number of balls that is more than half of them."""
    return balls // 2 + 1


@inlined
def penalty_ball(state):
    """Returns the ball that a player spots after a foul, as a set: a potted ball; 0 if the player has no point."""
    potted = state.balls & ~state.object_balls
    return potted & -potted if state.scores[state.player] > 0 else 0


@inlined
def owed_balls(balls, score):
    """Returns the balls of `balls` that a player spots to pay earlier fouls: one for each point below 0."""
    paid = 0
    while balls != 0 and score < 0:
        paid |= balls & -balls
        balls &= balls - 1
        score += 1
    return paid


@inlined
def end_of_rack(state, facts, spotted, score, other):
    """Ends a game if no ball is left. The player with the higher score wins; a tie has no winner."""
    if (state.object_balls & ~(facts.potted | facts.driven_off)) | spotted == 0:
        end(state, -1 if score == other else state.player if score > other else 1 - state.player)


@inlined
def one_pocket(state, facts, call):
    """Judges a shot of one-pocket, a game to the target score.

    A ball in the shooter's pocket scores a point, and the shooter continues (3.1). A ball in the other player's pocket
    scores a point for that player. Balls in other pockets are spotted (1). Any ball may be touched first, also on the
    break (2.2, 4).

    A foul costs a point, for which a ball is spotted, and balls in the shooter's pocket are spotted. Balls in the other
    pocket count, except after a scratch; then the next player has the cue ball in hand behind the head string (6.2,
    6.3). A player without a point owes a ball: the score falls below 0, and as many of the next balls that score are
    spotted (6.4).

    The target score wins. If both players reach it in one shot, the shooter wins (3.2). The third consecutive foul
    loses (7). If no ball is left, the higher score wins; a tie has no winner. Without a target (0), the game ends in
    this way only.
    """
    player, other = state.player, 1 - state.player
    mine, theirs = facts.foot_right, facts.foot_left
    if player == 1:
        mine, theirs = theirs, mine
    foul, points, spotted = standard_foul(facts, state.object_balls), size(mine), 0
    if foul == SCRATCH:
        state.in_hand, theirs = BEHIND, 0
    if foul != NO_FOUL:
        mine, points, spotted = 0, -1, penalty_ball(state)
    spotted |= (facts.potted & ~(mine | theirs)) | facts.driven_off
    spotted |= owed_balls(mine, state.scores[player]) | owed_balls(theirs, state.scores[other])
    score, others = state.scores[player] + points, state.scores[other] + size(theirs)
    if 0 < state.target <= score:
        end(state, player)
    elif state.target > 0 and (others >= state.target or (foul != NO_FOUL and state.fouls[player] >= 2)):
        end(state, other)
    else:
        end_of_rack(state, facts, spotted, score, others)
    return verdict(foul, points, size(theirs), mine != 0, spotted)


FOULS_OF_PAGE = (
    ("foul", "cue ball potted, no ball hit, no cushion hit afterwards"),
    ("after a foul", "1 point is lost and a ball spotted; a potted cue ball is in hand behind the line"),
    ("three fouls", "three fouls in a row lose"),
)
SHORT_GAME = functools.partial(
    Game,
    legal=any_ball,
    scene="pool",
    layouts=("rack", "tight_rack", "random"),
    editions=("2005",),
    n_object_balls=(1, 15),
    n_players=(2, 2),
    target=majority,
    counts_fouls=True,
)
"""A game of pool for two players. By default a majority of the balls wins."""

GAMES = {
    "one_pocket": SHORT_GAME(
        one_pocket,
        won_by="`target` points: balls in the own foot corner, by default a majority",
        foot_corners=True,
        sources=("OnePocket.org, adopted on 19 January 2005; secondary source",),
        left_out=(
            ("2.1", "player 0 owns pocket 2, the foot corner with y < 0, and player 1 pocket 3"),
            ("7", "the third foul in a row loses without a warning"),
            ("8", "no exceptions for frozen balls"),
            ("9.2", "balls are spotted after each shot, and not at the end of the inning"),
            ("9.5", "no ball is spotted if all are behind the head string: a ball behind it may be touched first"),
        ),
        facts=(*USUAL, foot_right, foot_left),
        page=(
            ("to win", "score the target with a point for each ball in your own pocket"),
            ("pockets", "player 1 owns the lower right pocket, player 2 the upper right pocket"),
            ("other pockets", "balls in the other player's pocket count for that player; others are spotted"),
            ("turn", "a player continues after a legal pot in the own pocket"),
            *FOULS_OF_PAGE,
        ),
    ),
}
