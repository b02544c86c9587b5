"""The rules of snooker, a frame for two players.

"WPBSA" is section 3 of the Official Rules of the Games of Snooker and English Billiards of the World Professional
Billiards and Snooker Association. The balls 1 to `reds` are red; yellow, green, brown, blue, pink and black follow. The
rules are simplified:

* A player who nominates no ball nominates the colour, or with a free ball the ball, that the cue ball touches first
  (3.3, 3.12).
* A snooker behind a free ball is not a foul (3.12 b). A push stroke and a touching ball are ignored (3.8, 3.10).
* After a tie, the next player plays first at the re-spotted black; no lots are drawn (3.4).
* With the miss rule, every shot that does not touch a ball on first is a miss, unless a player needs penalty points
  (3.14, see `games.snooker_fouls`). Three misses do not lose the frame.

The kernels have the arguments of `rules.games.Game`; sets of balls are bit masks.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from billiards_env.jit import entry_point, inlined
from billiards_env.rules.arrays import (
    BEHIND,
    HAND_BACK,
    NO_FOUL,
    NO_HIT,
    NOT_IN_HAND,
    SCRATCH,
    WRONG_BALL,
    WRONG_POT,
    game_over,
    next_shot,
    size,
    verdict,
)

LEAST_PENALTY, MOST_PENALTY = 4, 7
"""Points for a foul (WPBSA 3.10)."""


@inlined
def ball_value(state, ball):
    """Returns the value of a ball: 1 for red, 2 to 7 for yellow, green, brown, blue, pink and black (WPBSA 3.1)."""
    return max(ball - state.reds + 1, 1)


@inlined
def least_value(state, balls):
    """Returns the smallest value of some balls. It is 7 for none: a foul before a nomination (WPBSA 3.10 d)."""
    ball = 1
    while balls >> ball != 0:
        if balls >> ball & 1:
            return ball_value(state, ball)
        ball += 1
    return MOST_PENALTY


@inlined
def greatest_value(state, balls):
    """Returns the largest value of some balls, 0 for none."""
    value, ball = 0, 1
    while balls >> ball != 0:
        value = ball_value(state, ball)
        ball += 1
    return value


@inlined
def reds(state):
    """Returns the red balls on the table."""
    return state.object_balls & ((2 << state.reds) - 2)


@inlined
def ball_on(state, colour):
    """Returns the balls on without a free ball: a colour after a red, else the reds, else the lowest colour (3.3)."""
    if colour:
        return state.object_balls & ~reds(state)
    return reds(state) if reds(state) != 0 else state.object_balls & -state.object_balls


@inlined
def balls_on(state, player):
    """Returns the balls that a player may touch first. With a free ball these are all balls (WPBSA 3.12).

    For the other player these are the balls that are on if the turn passes.
    """
    if player != state.player:
        return ball_on(state, False)
    return state.object_balls if state.free_ball else ball_on(state, state.colour)


@inlined
def nominated(state, facts, call):
    """Returns the balls that are on in a shot, and the free ball. A ball that is touched first counts as nominated."""
    on = ball_on(state, state.colour)
    chosen = facts.first if size(facts.first) == 1 else 0
    if call.ball >= 0:
        chosen = 1 << call.ball
    if state.colour:
        return on & chosen, 0
    return on, chosen & ~on if state.free_ball else 0


@inlined
def touches_ball_on(facts, on, free):
    """Returns whether the cue ball first touches a ball on or the free ball.

    It may touch two balls at the same instant if they are two reds, or the free ball and a ball on (WPBSA 3.6).
    """
    needed = free if free != 0 else on
    return facts.first & needed != 0 and facts.first & ~(on | free) == 0


@inlined
def foul_of(facts, on, free):
    """Returns the foul of a shot (WPBSA 3.10), the first in the order of `FOULS` if there are several."""
    if facts.scratch:
        return SCRATCH
    if facts.first == 0:
        return NO_HIT
    if not touches_ball_on(facts, on, free):
        return WRONG_BALL
    return WRONG_POT if facts.potted & ~(on | free) != 0 else NO_FOUL


@inlined
def snooker(state, legal, facts, call):
    """Judges a shot of snooker (WPBSA 3).

    Reds and colours alternate: each red potted scores 1, then the player nominates a colour, which scores its value and
    is spotted (3.3). After the last red and the colour that follows it, the colours are potted in the order of their
    values. A foul ends the turn, and the other player scores the largest of 4, the value of the ball on, and the values
    of wrong balls that were touched first or potted (3.10). Colours potted on a foul are spotted, reds are not. The
    next player may make the offender shoot again. The first pot or foul on the last black ends the frame; after a tie
    the black is spotted, and the cue ball is in hand (3.4).
    """
    on, free = nominated(state, facts, call)
    value, foul = least_value(state, on), foul_of(facts, on, free)
    colours = state.object_balls & ~reds(state)
    points, penalty = 0, 0
    if foul != NO_FOUL:
        wrong = (facts.first | facts.potted) & ~(on | free)
        penalty = max(LEAST_PENALTY, max(value, greatest_value(state, wrong)))
        spotted = facts.potted & colours
    else:
        # A free ball has the value of the ball on. It scores with the reds, but not in addition to a colour (3.12 e).
        pots = size(facts.potted)
        points = value * (pots if value == 1 else min(pots, 1))
        spotted = facts.potted & (colours if state.colour else free)
    in_hand = BEHIND if foul == SCRATCH else NOT_IN_HAND
    colour = points > 0 and value == 1 and not state.colour

    mine = state.scores[state.player] + points
    others = state.scores[1 - state.player] + penalty
    black = 1 << (state.reds + 6)
    if 0 < state.target <= max(mine, others) or (state.object_balls == black and points + penalty > 0):
        if mine == others:
            return verdict(foul, points, penalty, False, black, next_shot(BEHIND, colour=colour))
        last = verdict(foul, points, penalty, points > 0, spotted, next_shot(in_hand, colour=colour))
        return game_over(last, state.player if mine > others else 1 - state.player)
    choices = 1 << HAND_BACK if foul != NO_FOUL else 0
    return verdict(foul, points, penalty, points > 0, spotted, next_shot(in_hand, choices, colour=colour))


@entry_point
def write_points_left(states, points):
    """Writes the points left in m states; `points` is (m,) int64 out."""
    for k in range(len(states)):
        state = states[k]
        points[k] = MOST_PENALTY if state.colour else 0
        for ball in range(1, state.reds + 7):
            if state.object_balls >> ball & 1:
                points[k] += ball_value(state, ball) + (MOST_PENALTY if ball <= state.reds else 0)


def points_left(states: NDArray[Any]) -> NDArray[np.int64]:
    """Returns the most points that a player can score: a black after each red, then the colours.

    Args:
        states: (m,) `STATE`.

    Returns:
        (m,) points.
    """
    points = np.empty(len(states), np.int64)
    write_points_left(states, points)
    return points
