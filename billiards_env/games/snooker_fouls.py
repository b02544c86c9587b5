"""What the next player may have after a foul in snooker: a free ball, or the balls replaced after a miss.

`billiards_env.rules.snooker` holds the other rules.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from billiards_env.games.judging import NO_CALL, RULES, Call, Facts, RuleState, state_array
from billiards_env.games.placement import is_free, obstacles, placement_area
from billiards_env.physics.state import CUE_BALL
from billiards_env.rules import snooker
from billiards_env.scene import CONTACT_GAP, Scene

_STEPS = 9  # places in the D along each axis at which a cue ball in hand is tested for a snooker


def frame_points_left(state: RuleState) -> int:
    """Returns the most points that a player can still score: a black after each red, then the colours."""
    return int(snooker.points_left(state_array([state]))[0])


def is_miss(before: RuleState, after: RuleState, facts: Facts, call: Call = NO_CALL) -> bool:
    """Returns whether a shot is a miss (WPBSA 3.14).

    A shot is a miss if it touches no ball on first, and no player needs penalty points before or after it. It is a miss
    even if it also pots the cue ball.
    """
    needed = any(abs(state.scores[0] - state.scores[1]) > frame_points_left(state) for state in (before, after))
    foul = RULES["snooker"].judge(before, facts._replace(potted=(), pockets=()), call).foul
    return not needed and foul in ("no_hit", "wrong_ball")


def is_snookered(scene: Scene, positions: NDArray[np.float64], state: RuleState) -> bool:
    """Returns whether the cue ball is snookered on all balls on, which after a foul gives a free ball (WPBSA 3.12).

    A ball on is snookered if another ball, which is not on, obstructs a straight path of the cue ball to one of its two
    edges (section 2, 17): on the path the two balls would overlap by more than `CONTACT_GAP`. A ball that touches the
    cue ball therefore obstructs no path that leads away from this ball or past it. A ball on that the cue ball touches
    is not snookered. A cue ball in hand is snookered if it is snookered at all free places of a grid in the D.

    Args:
        scene: The scene.
        positions: (n, 2) m.
        state: The state of the rules.
    """
    on = RULES["snooker"].legal(state._replace(free_ball=False), state.player)
    others = [(*positions[i].tolist(), scene.balls.radius[i]) for i in sorted(state.object_balls - on)]
    targets = [(*positions[i].tolist(), scene.balls.radius[i]) for i in sorted(on)]
    x, y = positions[CUE_BALL].tolist()
    places = [(x, y)] if state.in_hand == "no" else _places(scene, positions, state)
    cue = scene.balls.radius[CUE_BALL]
    return not any(_sees(place, cue, target, others) for place in places for target in targets)


def _places(scene: Scene, positions: NDArray[np.float64], state: RuleState) -> list[tuple[float, float]]:
    """Returns the free places of a grid in the D."""
    x_low, x_high, y_low, y_high = placement_area(scene, CUE_BALL, behind=True)
    circles = obstacles(scene, positions, CUE_BALL, state.object_balls)
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
