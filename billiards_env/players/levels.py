"""Levels of the player "planner", such as "planner:club".

The strokes of a level have random noise. The planner expects this noise, but at most `EXPECTED`. The budget
of a level is a number of simulated shots, so games with the same seed are the same.

Example:
    >>> level_of("club").noise, level_of("100ms")
    ((1.0, 0.2), Level(budget='100ms', noise=(0.0, 0.0)))
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from billiards_env.games import Stroke
from billiards_env.players.planner import EXPECTED_NOISE, Options, noisy_strokes, parse_budget, plan
from billiards_env.players.situation import Noise, Player, Situation
from billiards_env.support.checks import real


class Level(NamedTuple):
    """The strength of a planner.

    Attributes:
        budget: The budget of the planner, such as "100ms" or a number of simulated shots.
        noise: Standard deviations of direction, degrees, and speed, m/s, of its strokes.
    """

    budget: str
    noise: Noise


LEVELS = {
    "beginner": Level("200", (3.0, 0.4)),
    "club": Level("500", (1.0, 0.2)),
    "league": Level("1000", (0.4, 0.1)),
    "pro": Level("4000", (0.1, 0.05)),
}
"""The levels by name, weakest first."""

EXPECTED = (0.2, 0.1)
"""The largest noise of its own that a level plans for, degrees and m/s. With more it would play safe for
hundreds of strokes instead of trying to pot a ball."""


class LevelPlayer(NamedTuple):
    """A player whose strokes have noise.

    Attributes:
        intend: The player without noise.
        noise: Standard deviations of direction, degrees, and speed, m/s, of its strokes.
    """

    intend: Player
    noise: Noise

    def __call__(self, situation: Situation, rng: np.random.Generator) -> Stroke:
        """Returns the stroke that is played."""
        return with_noise(self.intend(situation, rng), self.noise, situation.table.max_speed, rng)


def planning(argument: str) -> LevelPlayer:
    """Returns the planner as a player. It plays games and the tasks with the rules of a game.

    It expects the noise of the situation in addition to its own. Without any noise it expects `planner.EXPECTED_NOISE`.

    Args:
        argument: The name of a level, or the budget of a decision: its time, such as "100ms" or "1s", or a number of
            simulated shots, such as "5000". With a number of shots, the same seed repeats the game. An empty text is
            "100ms".

    Raises:
        ValueError: If the argument is neither a level nor a budget.
    """
    level = level_of(argument)
    seconds, shots = parse_budget(level.budget)

    def stroke(situation: Situation, rng: np.random.Generator) -> Stroke:
        setup, game = situation.find_game()
        options = Options(situation.run_out, situation.strike, leaves=False, watch=situation.watch)
        noise = expected(situation.noise, level)
        return plan(setup, game, situation.table.max_speed, rng, seconds, shots, noise, options).stroke

    return LevelPlayer(stroke, level.noise)


def level_of(argument: str) -> Level:
    """Returns the level for an argument of the planner. If the argument is a budget, the level has no noise.

    Raises:
        ValueError: If the argument is neither a level nor a budget.
    """
    if argument in LEVELS:
        return LEVELS[argument]
    try:
        parse_budget(argument)
    except ValueError as error:
        raise ValueError(f"{error}, or a level: {', '.join(map(repr, LEVELS))}") from None
    return Level(argument, (0.0, 0.0))


def expected(noise: Noise, level: Level) -> Noise:
    """Returns the standard deviations that a level plans for, from the noise of the environment and its own noise."""
    of_env = real("noise[0]", noise[0], "angle_std"), real("noise[1]", noise[1], "speed_std")
    degrees, speed = map(math.hypot, of_env, map(min, level.noise, EXPECTED))
    return (degrees, speed) if degrees or speed else EXPECTED_NOISE


def with_noise(stroke: Stroke, noise: Noise, max_speed: float, rng: np.random.Generator) -> Stroke:
    """Returns a stroke with random noise.

    `noise` has the standard deviations of the direction, degrees, and of the speed, m/s.

    A stroke with speed 0, which hands the shot back, does not change.
    """
    if not any(noise) or not any(stroke.velocity):
        return stroke
    drawn = rng.standard_normal((1, 2)) * (math.radians(noise[0]), noise[1])
    (velocity,), (spin,) = noisy_strokes(np.array([stroke.velocity[:2]]), np.array([stroke.spin]), drawn, max_speed)
    return stroke._replace(velocity=(*velocity.tolist(), *stroke.velocity[2:]), spin=tuple(spin.tolist()))
