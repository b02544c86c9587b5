"""The rules of snooker, a frame for two players.

"WPBSA" is section 3 of the Official Rules of the Games of Snooker and English Billiards of the World Professional
Billiards and Snooker Association. The balls 1 to `reds` are red; yellow, green, brown, blue, pink and black follow. The
rules are simplified:

* A player who nominates no ball nominates the colour, or with a free ball the ball, that the cue ball touches first
  (3.3, 3.12).
* A snooker behind a free ball is not a foul (3.12 b). A push stroke and a touching ball are ignored (3.8, 3.10).
* After a tie, the next player plays first at the re-spotted black; no lots are drawn (3.4).
* With the miss rule, every shot that does not touch a ball on first is a miss, unless a player needs penalty points
  (3.14). Three misses do not lose the frame.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from billiards_env.games.facts import CUE, Facts
from billiards_env.games.placement import is_free, obstacles, placement_area
from billiards_env.games.state import NO_CALL, Call, RuleState, Verdict
from billiards_env.scene import CONTACT_GAP, Scene

LEAST_PENALTY, MOST_PENALTY = 4, 7
"""Points for a foul (WPBSA 3.10)."""

_STEPS = 9  # places in the D along each axis at which a cue ball in hand is tested for a snooker


def ball_value(state: RuleState, ball: int) -> int:
    """Returns the value of a ball: 1 for red, 2 to 7 for yellow, green, brown, blue, pink and black (WPBSA 3.1)."""
    return max(ball - state.reds + 1, 1)


def colours(state: RuleState) -> frozenset[int]:
    """Returns the colours on the table."""
    return frozenset(ball for ball in state.object_balls if ball > state.reds)


def ball_on(state: RuleState) -> frozenset[int]:
    """Returns the balls on without a free ball: a colour after a red, else the reds, else the lowest colour (3.3)."""
    if state.colour:
        return colours(state)
    return state.object_balls - colours(state) or frozenset(sorted(state.object_balls)[:1])


def balls_on(state: RuleState, player: int) -> frozenset[int]:
    """Returns the balls that a player may touch first. With a free ball these are all balls (WPBSA 3.12).

    For the other player these are the balls that are on if the turn passes.
    """
    if player != state.player:
        return ball_on(state._replace(colour=False))
    return state.object_balls if state.free_ball else ball_on(state)


def snooker(state: RuleState, facts: Facts, call: Call = NO_CALL) -> Verdict:
    """Judges a shot of snooker (WPBSA 3).

    Reds and colours alternate: each red potted scores 1, then the player nominates a colour, which scores its value and
    is spotted (3.3). After the last red and the colour that follows it, the colours are potted in the order of their
    values. A foul ends the turn, and the other player scores the largest of 4, the value of the ball on, and the values
    of wrong balls that were touched first or potted (3.10). Colours potted on a foul are spotted, reds are not. The
    next player may hand the shot back. The first pot or foul on the last black ends the frame; after a tie the black is
    spotted, and the cue ball is in hand (3.4).

    Args:
        state: The state before the shot.
        facts: The facts of the shot.
        call: The call of the player; its ball is the nominated colour or free ball.

    Returns:
        The verdict.
    """
    on, free = _nominated(state, facts, call)
    potted = set(facts.potted) - {CUE}
    # The value of the ball on is 7 if a player commits a foul before nominating a colour.
    value = min((ball_value(state, ball) for ball in on), default=MOST_PENALTY)
    counted = on | free
    foul = _foul(facts, on, free, potted - counted)
    if foul:
        wrong = (set(facts.first) | potted) - counted
        points = max(LEAST_PENALTY, value, *(ball_value(state, ball) for ball in wrong))
        return _after(state, Verdict(foul, penalty=points, choices=("hand_back",)), facts, spotted=colours(state))
    # A free ball has the value of the ball on. It scores with the reds, but not in addition to a colour (3.12 e).
    points = value * len(potted) if on <= set(range(1, state.reds + 1)) else value * bool(potted)
    spotted = colours(state) if state.colour else free
    was_red = not state.colour and value == 1
    verdict = Verdict(points=points, continues=points > 0, colour=was_red and points > 0)
    return _after(state, verdict, facts, spotted)


def _nominated(state: RuleState, facts: Facts, call: Call) -> tuple[frozenset[int], frozenset[int]]:
    """Returns the balls that are on in a shot, and the free ball. A ball that is touched first counts as nominated."""
    on, first = ball_on(state), frozenset(facts.first)
    nominated = frozenset({call.ball}) if call.ball >= 0 else first if len(first) == 1 else frozenset()
    if state.colour:
        return on & nominated, frozenset()
    return on, nominated - on if state.free_ball else frozenset()


def _touches_ball_on(facts: Facts, on: frozenset[int], free: frozenset[int]) -> bool:
    """Returns whether the cue ball first touches a ball on or the free ball.

    It may touch two balls at the same instant if they are two reds, or the free ball and a ball on (WPBSA 3.6).
    """
    first = set(facts.first)
    return bool(first & (free or on)) and first <= on | free


def _foul(facts: Facts, on: frozenset[int], free: frozenset[int], wrong: set[int]) -> str:
    """Returns the foul of a shot, or "" (WPBSA 3.10). If there are several, it is the first in the order of `FOULS`."""
    if CUE in facts.potted:
        return "scratch"
    if not facts.first:
        return "no_hit"
    if not _touches_ball_on(facts, on, free):
        return "wrong_ball"
    return "wrong_pot" if wrong else ""


def _after(state: RuleState, verdict: Verdict, facts: Facts, spotted: Iterable[int]) -> Verdict:
    """Completes a verdict: the balls to be spotted, the cue ball in hand, and the end of the frame."""
    back = tuple(sorted(set(spotted) & set(facts.potted), reverse=True))
    verdict = verdict._replace(spotted=back, in_hand="behind" if verdict.foul == "scratch" else "no")
    scores = list(state.scores)
    scores[state.player] += verdict.points
    scores[1 - state.player] += verdict.penalty
    best = max(scores)
    black = state.reds + 6
    if 0 < state.target <= best or (state.object_balls == {black} and verdict.points + verdict.penalty > 0):
        if scores[0] != scores[1]:
            return verdict._replace(over=True, winner=scores.index(best), choices=())
        return verdict._replace(spotted=(black,), in_hand="behind", continues=False, choices=())
    return verdict


def points_left(state: RuleState) -> int:
    """Returns the most points that a player can score: a black after each red, then the colours."""
    balls = colours(state)
    reds = len(state.object_balls) - len(balls)
    return reds * (1 + MOST_PENALTY) + MOST_PENALTY * state.colour + sum(ball_value(state, ball) for ball in balls)


def is_miss(before: RuleState, after: RuleState, facts: Facts, call: Call = NO_CALL) -> bool:
    """Returns whether a shot is a miss (WPBSA 3.14). A miss remains one if the shot also pots the cue ball.

    Args:
        before: The state before the shot.
        after: The state after the shot.
        facts: The facts of the shot.
        call: The call of the player.

    Returns:
        Whether the shot touched no ball on first, and no player needed penalty points before or after it.
    """
    needed = any(abs(state.scores[0] - state.scores[1]) > points_left(state) for state in (before, after))
    return not needed and not _touches_ball_on(facts, *_nominated(before, facts, call))


def is_snookered(scene: Scene, positions: NDArray[np.float64], state: RuleState) -> bool:
    """Returns whether the cue ball is snookered on all balls on, which after a foul gives a free ball (WPBSA 3.12).

    A ball on is snookered if another ball, which is not on, obstructs a straight path of the cue ball to one of its two
    edges (section 2, 17): on the path the two balls would overlap by more than `CONTACT_GAP`. A ball that touches the
    cue ball therefore obstructs no path that leads away from it or past it. A ball on that the cue ball touches is not
    snookered. A cue ball in hand is snookered if it is so from all places of a grid in the D.

    Args:
        scene: The scene.
        positions: (n, 2) m.
        state: The state of the rules.
    """
    on = ball_on(state)
    others = [(*positions[i].tolist(), scene.balls.radius[i]) for i in sorted(state.object_balls - on)]
    targets = [(*positions[i].tolist(), scene.balls.radius[i]) for i in sorted(on)]
    x, y = positions[CUE].tolist()
    places = [(x, y)] if state.in_hand == "no" else _places(scene, positions, state)
    cue = scene.balls.radius[CUE]
    return not any(_sees(place, cue, target, others) for place in places for target in targets)


def _places(scene: Scene, positions: NDArray[np.float64], state: RuleState) -> list[tuple[float, float]]:
    """Returns the free places of a grid in the D."""
    x_low, x_high, y_low, y_high = placement_area(scene, CUE, behind=True)
    circles = obstacles(scene, positions, CUE, state.object_balls)
    steps = [k / (_STEPS - 1) for k in range(_STEPS)]
    grid = [(x_low + (x_high - x_low) * a, y_low + (y_high - y_low) * b) for a in steps for b in steps]
    limit = (x_high - x_low) * (x_high - x_low)
    return [p for p in grid if (p[0] - x_high) ** 2 + p[1] * p[1] <= limit and is_free(p, circles)]


def _sees(
    place: tuple[float, float], radius: float, target: tuple[float, ...], others: list[tuple[float, ...]]
) -> bool:
    """Returns whether a ball at a place can reach both edges of a target on a straight path."""
    x, y = place
    dx, dy, reach = target[0] - x, target[1] - y, target[2] + radius
    square = dx * dx + dy * dy
    if square <= (reach + CONTACT_GAP) ** 2:
        return True
    along = math.sqrt(square - reach * reach)
    for side in (-reach, reach):  # the path to the point at which the two balls only touch
        ex, ey = (along * dx - side * dy) * along / square, (along * dy + side * dx) * along / square
        for other_x, other_y, other_radius in others:
            ox, oy, clear = other_x - x, other_y - y, other_radius + radius - CONTACT_GAP
            share = min((ox * ex + oy * ey) / (along * along), 1.0)
            gap_x, gap_y = ox - share * ex, oy - share * ey
            if share > 0.0 and gap_x * gap_x + gap_y * gap_y < clear * clear:
                return False
    return True
