"""The rules of snooker, a frame for two players.

"WPBSA" is section 3 of the Official Rules of the Games of Snooker and English Billiards of the World Professional
Billiards and Snooker Association; its list of amendments ends in November 2014. The source is secondary: a copy of this
text in github.com/chalkysticks/api, `snooker_wpbsa.php`. The definition of a jump shot (section 2, 20) is from a German
translation, snookerregeln.de. The balls 1 to `reds` are red; yellow, green, brown, blue, pink and black follow.
`Game.left_out` lists the simplifications.

The kernels have the arguments of `entry.Game`; sets of balls are bit masks.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from billiards_env.games.entry import Game, keep_scores, no_target
from billiards_env.games.facts import USUAL, cushions_before_first, jumped
from billiards_env.games.game_state import (
    BEHIND,
    DRIVEN_OFF,
    FREE_BALL,
    HAND_BACK,
    JUMP_SHOT,
    MOST_BALLS,
    NO_FOUL,
    NO_HIT,
    NOT_IN_HAND,
    PUSH,
    REPLACE,
    SCRATCH,
    STALEMATE,
    WRONG_BALL,
    WRONG_POT,
    Count,
    Field,
    FoundBalls,
    FoundFlag,
    end,
    lowest,
    members,
    size,
    verdict,
)
from billiards_env.games.placement import (
    Obstacles,
    area_of,
    avoids,
    offer_new_rack,
    rack_and_break,
    spot_colours,
    touching_balls,
)
from billiards_env.jit import inlined, kernel
from billiards_env.physics.state import CUE_BALL, X, Y
from billiards_env.scene import CONTACT_GAP
from billiards_env.scene.layouts import PLACING_GAP

LEAST_PENALTY, MOST_PENALTY = 4, 7
"""Points for a foul (WPBSA 3.10)."""

MOST_MISSES = 3
"""The number of misses in a row that lose the frame (WPBSA 3.14 d)."""

_STEPS = 9  # places in the D along each axis at which a cue ball in hand is tested for a snooker


class Snooker(NamedTuple):
    """The own state of snooker.

    Attributes:
        reds: The number of red balls of a full table: the balls 1 to `reds`.
        miss: Whether the game is played with the miss rule.
        colour: Whether a colour of the player's choice is on.
        free_ball: Whether the player has a free ball.
        touching: The object balls that touch the cue ball.
        in_sight: With the miss rule, whether the cue ball can hit a ball on full.
        misses: The number of misses in a row that the player made from this position.
    """

    reds: Annotated[int, Field(most=MOST_BALLS, given=False)]
    miss: FoundFlag = False
    colour: bool = False
    free_ball: bool = False
    touching: FoundBalls = 0
    in_sight: FoundFlag = False
    misses: Count = 0


@inlined
def hidden(shots, k, bits) -> bool:
    """Whether the free ball hides all balls on at the end of the shot. `see` finds it from the positions."""
    return False


@inlined
def ball_value(state, ball):
    """Returns the value of a ball: 1 for red, 2 to 7 for yellow, green, brown, blue, pink and black (WPBSA 3.1)."""
    return max(ball - state.reds + 1, 1)


@inlined
def least_value(state, balls):
    """Returns the smallest value of some balls. It is 7 for none: a foul before a nomination (WPBSA 3.10 d)."""
    return ball_value(state, lowest(balls)) if balls != 0 else MOST_PENALTY


@inlined
def greatest_value(state, balls):
    """Returns the largest value of some balls, 0 for none."""
    value = 0
    while balls != 0:
        value = ball_value(state, lowest(balls))
        balls &= balls - 1
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
    """Returns the balls that are on in a shot, and the free ball.

    A ball that is touched first counts as nominated, else the lowest ball that touches the cue ball (3.8 c).
    """
    on = ball_on(state, state.colour)
    could_be_on = state.object_balls if state.free_ball else on
    chosen = facts.first if size(facts.first) == 1 else 0
    if call.ball >= 0:
        chosen = 1 << call.ball
    elif chosen & could_be_on == 0 and state.touching & could_be_on != 0:
        chosen = 1 << lowest(state.touching & could_be_on)
    if state.colour:
        return on & chosen, 0
    return on, chosen & ~on if state.free_ball else 0


@inlined
def touches_ball_on(state, facts, on, free):
    """Returns whether the cue ball first touches a ball on or the free ball.

    It may touch two balls at the same instant if they are two reds, or the free ball and a ball on (WPBSA 3.6). A
    player who plays away from such a ball that touches the cue ball counts as touching it first (3.8 c).
    """
    needed = free if free != 0 else on
    if state.touching & needed != 0:
        return True
    return facts.first & needed != 0 and facts.first & ~(on | free) == 0


@inlined
def foul_of(state, facts, on, free):
    """Returns the foul of a shot (WPBSA 3.10).

    If there are several, it is the first in the order of `FOULS`, except that a push stroke (3.8 b) is second, after a
    scratch.
    """
    if facts.scratch or facts.cue_off:
        return SCRATCH
    if facts.first & state.touching != 0 and facts.cushions_before_first == 0:
        return PUSH
    if not touches_ball_on(state, facts, on, free):
        return NO_HIT if facts.first == 0 else WRONG_BALL
    if facts.potted & ~(on | free) != 0:
        return WRONG_POT
    if facts.driven_off != 0:
        return DRIVEN_OFF
    if facts.hidden:
        return FREE_BALL
    return JUMP_SHOT if facts.jumped != 0 else NO_FOUL


@inlined
def points_left(balls, reds, colour):
    """Returns the most points that a player can still score with balls: a black after each red, then the colours."""
    points = MOST_PENALTY if colour else 0
    for ball in range(1, reds + 7):
        if balls >> ball & 1:
            points += ball - reds + 1 if ball > reds else 1 + MOST_PENALTY
    return points


@inlined
def snooker(state, facts, call):
    """Judges a shot of snooker (WPBSA 3).

    Reds and colours alternate: each red potted scores 1, then the player nominates a colour, which scores its value and
    is spotted (3.3). After the last red and the colour that follows it, the colours are potted in the order of their
    values. A foul ends the turn, and the other player scores the largest of 4, the value of the ball on, and the values
    of wrong balls that were touched first or potted (3.10). A ball that touches the cue ball must not be moved at the
    start. If it is on, a player who plays away from it counts as touching it first (3.8). Colours potted on a foul are
    spotted, reds are not. It is a foul to leave the cue ball snookered on all balls on behind the free ball, unless
    only pink and black are left (3.12 b). The next player may make the offender shoot again.

    In scenes with flight it is a foul to play a jump shot (3.10 a): the cue ball passes over any part of an object ball
    before it has struck one. There are three exceptions (section 2, 20). The cue ball may jump over a ball after it has
    struck another one (a), or after it has struck this ball lawfully and then a cushion or another ball (c). It may
    also jump onto a ball, if it does not land on the far side of this ball (b).

    With the miss rule, that player may also have the balls replaced, if the cue ball touched no ball on first and no
    player needs penalty points before or after the shot (3.14 a). From a position in which a ball on can be hit full,
    the second miss in a row counts in any case, and the third one loses the frame (3.14 d).

    The first pot or foul on the last black ends the frame. After a tie the black is spotted, the cue ball is in hand,
    and the next player may let the other player play first (3.4).
    """
    on, free = nominated(state, facts, call)
    value, foul = least_value(state, on), foul_of(state, facts, on, free)
    colours = state.object_balls & ~reds(state)
    points, penalty, touches, in_sight = 0, 0, touches_ball_on(state, facts, on, free), state.in_sight
    state.free_ball, state.touching, state.in_sight = False, 0, False
    if foul != NO_FOUL:
        deemed = touches and foul != PUSH
        wrong = (facts.potted if deemed else facts.first | facts.potted) & ~(on | free) | facts.driven_off
        penalty = max(LEAST_PENALTY, max(value, greatest_value(state, wrong)))
        spotted = (facts.potted | facts.driven_off) & colours
        state.choices = 1 << HAND_BACK
    else:
        # A free ball has the value of the ball on. It scores with the reds, but not in addition to a colour (3.12 e).
        pots = size(facts.potted)
        points = value * (pots if value == 1 else min(pots, 1))
        spotted = facts.potted & (colours if state.colour else free)
    if foul == SCRATCH:
        state.in_hand = BEHIND
    left = points_left(state.object_balls, state.reds, state.colour)
    state.colour = points > 0 and value == 1 and not state.colour

    mine = state.scores[state.player] + points
    others = state.scores[1 - state.player] + penalty
    black = 1 << (state.reds + 6)
    if 0 < state.target <= max(mine, others) or (state.object_balls == black and points + penalty > 0):
        if mine == others:
            state.choices, state.in_hand = 1 << HAND_BACK, BEHIND
            return verdict(foul, points, penalty, False, black)
        end(state, state.player if mine > others else 1 - state.player)
        state.choices = 0
    elif state.miss and not touches:
        lead = abs(state.scores[0] - state.scores[1])
        on_table = (state.object_balls & ~(facts.potted | facts.driven_off)) | spotted
        again = in_sight and state.misses > 0
        if again or (lead <= left and abs(mine - others) <= points_left(on_table, state.reds, False)):
            state.choices |= 1 << REPLACE
        if again and state.misses == MOST_MISSES - 1:
            end(state, 1 - state.player)
            state.choices = 0
    state.misses = 0
    return verdict(foul, points, penalty, points > 0, spotted)


@inlined
def look(table, positions, state):
    """Finds the balls that touch the cue ball (WPBSA 3.8), and whether a ball on can be hit full (3.14 d).

    It also gives the choice of a stalemate. See `Game.look`.
    """
    state.touching = touching_balls(table, positions, state)
    state.in_sight = state.miss and not is_snookered(table, positions, state, balls_on(state, state.player))
    offer_new_rack(table, positions, state)


@inlined
def see(table, positions, state, facts, call):
    """Finds the fact `hidden`, as `Game.see` (WPBSA 3.12 b)."""
    on, free = nominated(state, facts, call)
    alone = state.object_balls == 3 << (state.reds + 5)  # pink and black
    judged = free != 0 and facts.potted | facts.driven_off == 0 and not (facts.scratch or facts.cue_off or alone)
    facts.hidden = judged and is_hidden_behind(table, positions, state.object_balls, on, free)


@inlined
def is_hidden_behind(table, positions, object_balls, on, free):
    """Returns whether the free ball hides all balls on, and no ball nearer to the cue ball hides them.

    The nearest of several balls that obstruct is the one that snookers (section 2, 17).
    """
    if sees_a_ball(table, positions, positions[CUE_BALL], on | free, on):
        return False
    ball = lowest(free)
    distance = square_from_cue(positions, ball)
    for other in range(1, len(table.radius)):
        nearer = object_balls & ~on & ~free & (1 << other)
        if nearer != 0 and square_from_cue(positions, other) >= distance:
            nearer = 0
        if nearer != 0 and not sees_a_ball(table, positions, positions[CUE_BALL], on | nearer, on):
            return False
    return True


@inlined
def square_from_cue(positions, ball):
    """Returns the square of the distance of a ball from the cue ball, m^2."""
    dx, dy = positions[ball, X] - positions[CUE_BALL, X], positions[ball, Y] - positions[CUE_BALL, Y]
    return dx * dx + dy * dy


@inlined
def settle(table, positions, state, verdict):
    """Gives the next player a free ball after a foul that snookers, as `Game.settle` (WPBSA 3.12)."""
    if verdict.foul != NO_FOUL and not state.over:
        state.free_ball = is_snookered(table, positions, state, balls_on(state, state.player))


@inlined
def without_shot(table, positions, state, kind):
    """Begins a frame again after a stalemate, without points (WPBSA 3.16), as `Game.without_shot`."""
    rack_and_break(table, positions, state, kind)
    state.free_ball = False
    if kind == STALEMATE:
        state.scores[:] = 0
        state.colour, state.misses = False, 0


@inlined
def replace(state, before):
    """Counts the misses from a position in which a ball on can be hit full, as `Game.replace` (WPBSA 3.14 d)."""
    keep_scores(state, before)
    before.misses = before.misses + 1 if before.in_sight else 0


def check(state: Any) -> str:
    """Returns what is expected of the colours on the table, as `Game.check`: all or, without reds, the highest ones."""
    on_table, reds = members(state.object_balls), int(state.reds)
    colours = [ball for ball in on_table if ball > reds]
    count = 6 if state.colour or len(on_table) > len(colours) else len(colours)
    possible = colours == [*range(reds + 7 - count, reds + 7)]
    return "" if possible else "all colours, or without reds the highest ones"


@inlined
def is_snookered(table, positions, state, on):
    """Returns whether the cue ball is snookered on all balls on, which after a foul gives a free ball (WPBSA 3.12).

    A ball on is snookered if another ball, which is not on, obstructs a straight path of the cue ball to one of its two
    edges (section 2, 17): on the path the two balls would overlap by more than `CONTACT_GAP`. A ball that touches the
    cue ball therefore obstructs no path that leads away from this ball or past it. A ball on that the cue ball touches
    is not snookered. A cue ball in hand is snookered if it is snookered at all free places of a grid in the D.

    Args:
        table: `placement.PlacementNumbers`.
        positions: (n, 2) m.
        state: A row of `Game.state_type`.
        on: The balls on.
    """
    if state.in_hand == NOT_IN_HAND:
        return not sees_a_ball(table, positions, positions[CUE_BALL], state.object_balls, on)
    area = area_of(table, CUE_BALL, True)
    d = area.x_high - area.x_low
    obstacles = Obstacles(table, positions, CUE_BALL, state.object_balls, 0, PLACING_GAP)
    for i in range(_STEPS):
        x = area.x_low + d * (i / (_STEPS - 1))
        for j in range(_STEPS):
            y = area.y_low + (area.y_high - area.y_low) * (j / (_STEPS - 1))
            in_d = (x - area.x_high) * (x - area.x_high) + y * y <= d * d
            if in_d and avoids(obstacles, x, y) and sees_a_ball(table, positions, (x, y), state.object_balls, on):
                return False
    return True


@kernel
def sees_a_ball(table, positions, place, object_balls, on):
    """Returns whether the cue ball at a place can reach both edges of a ball on."""
    for target in range(1, len(table.radius)):
        if on >> target & 1 and sees(table, positions, place, target, object_balls & ~on):
            return True
    return False


@inlined
def sees(table, positions, place, target, others):
    """Returns whether the cue ball at a place can reach both edges of a target on straight paths past the others."""
    radius = table.radius[CUE_BALL]
    dx, dy = positions[target, X] - place[X], positions[target, Y] - place[Y]
    reach = table.radius[target] + radius
    square = dx * dx + dy * dy
    if square <= (reach + CONTACT_GAP) * (reach + CONTACT_GAP):
        return True
    along = math.sqrt(square - reach * reach)
    for side in (-reach, reach):  # the path to the point at which the two balls only touch
        ex, ey = (along * dx - side * dy) * along / square, (along * dy + side * dx) * along / square
        for other in range(1, len(table.radius)):
            if others >> other & 1 == 0:
                continue
            ox, oy = positions[other, X] - place[X], positions[other, Y] - place[Y]
            clear = table.radius[other] + radius - CONTACT_GAP
            share = min((ox * ex + oy * ey) / (along * along), 1.0)
            gap_x, gap_y = ox - share * ex, oy - share * ey
            if share > 0.0 and gap_x * gap_x + gap_y * gap_y < clear * clear:
                return False
    return True


GAMES = {
    "snooker": Game(
        snooker,
        balls_on,
        scene="snooker",
        layouts=("snooker", "random"),
        n_object_balls=(6, 21),
        won_by="having the most points when the black ball, the last one, is potted",
        n_players=(2, 2),
        target=no_target,
        editions=("2014",),
        sources=("World Professional Billiards and Snooker Association (WPBSA), November 2014; secondary source",),
        left_out=(
            ("2.19", "only a shot that first hits a ball touching the cue ball, before a cushion, is a push stroke"),
            ("2.20", "a ball that the cue ball hits at the end of a flight does not count as jumped over"),
            ("3.3, 3.12", "if a player nominates no ball, the ball that the cue ball touches first is nominated"),
            ("3.4 b", "after a tie no lots are drawn: the next player has the choice of the winner of the lot"),
            ("3.12", "a cue ball in hand is snookered if it is snookered at all free places of a grid in the D"),
            ("3.14", "each shot that hits no ball on first is a miss, unless a player needs penalty points"),
            ("3.16", "a player calls a stalemate, after six turns of each player without a pot, a point or a foul"),
        ),
        choices=("hand_back", "replace", "stalemate"),
        deciding_ball=-1,
        has_spots=True,
        most_points=lambda balls: 8 * balls - 21,
        spot=spot_colours,
        state=lambda balls: Snooker(reds=balls - 6),
        facts=(*USUAL, cushions_before_first, hidden, jumped),
        check=check,
        see=see,
        settle=settle,
        look=look,
        without_shot=without_shot,
        replace=replace,
        page=(
            ("to win", "have most points when the black is potted last"),
            ("order", "a red, then a colour, in turns; at the end the colours by value"),
            ("values", "red 1, yellow 2, green 3, brown 4, blue 5, pink 6, black 7"),
            ("turn", "a player continues after a legal pot"),
            ("foul", "cue ball potted, no ball or a wrong ball hit first, wrong ball potted"),
            ("after a foul", "the other player scores 4 to 7 points; a potted cue ball is in hand in the D"),
            ("free ball", "who is snookered after a foul may play any ball as the ball on"),
        ),
    ),
}
