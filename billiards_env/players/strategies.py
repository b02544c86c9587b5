"""Strategies: how a player without training chooses a shot.

* "random" shoots in any direction at any speed.
* "geometric" plays the best direct pot (`billiards_env.players.pots`). Without one it plays a full hit on the nearest
  target, as fast as it may. It simulates nothing.
* "search" simulates shots and plays the best; "search:20" simulates 20.

A strategy is a function `(situation, rng) -> velocity`, where the velocity of the cue ball is a (2,) array in m/s.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_env.checks import choose
from billiards_env.envs.action_frames import perturb
from billiards_env.players.pots import Pots, direct_pots
from billiards_env.scene import Scene

Floats = NDArray[np.float64]

SHOTS = 200
"""The number of shots that "search" simulates."""

FINALISTS, REPEATS = 16, 16
"""With execution noise, "search" repeats each of its best `FINALISTS` shots `REPEATS` times."""


class Situation(NamedTuple):
    """A table before a shot.

    An action is a velocity of the cue ball over `max_speed`.

    Attributes:
        scene: The scene.
        positions: (n, 2) m.
        potted: (n,) bool, the balls off the table.
        targets: (n,) bool, the balls that the cue ball may hit.
        max_speed: Speed of the fastest shot, m/s.
        rate: A function that simulates (m, 2) actions and returns (m,) ratings; more is better.
        cue: The number of the cue ball.
        first: (k, 2) actions that "search" tries before all others.
    """

    scene: Scene
    positions: Floats
    potted: NDArray[np.bool_]
    targets: NDArray[np.bool_]
    max_speed: float
    rate: Callable[[Floats], Floats]
    cue: int = 0
    first: Floats = np.empty((0, 2))

    def pots(self) -> Pots:
        """Returns the direct pots, best first."""
        return direct_pots(self.scene, self.targets, self.positions, self.potted, self.max_speed, self.cue)


Strategy = Callable[[Situation, np.random.Generator], Floats]


def random(situation: Situation, rng: np.random.Generator) -> Floats:
    """Returns a velocity whose components are uniform between -`max_speed` and `max_speed`."""
    return situation.max_speed * rng.uniform(-1.0, 1.0, 2)


def geometric(situation: Situation, rng: np.random.Generator) -> Floats:
    """Returns the velocity of the best direct pot, or of a full hit on the nearest target."""
    pots = situation.pots()
    return pots.speed[0] * pots.direction[0] if len(pots.speed) else situation.max_speed * full_hit(situation)


def full_hit(situation: Situation) -> Floats:
    """Returns the direction (2,) from the cue ball to the nearest target on the table."""
    to_targets = (situation.positions - situation.positions[situation.cue])[situation.targets & ~situation.potted]
    lengths = np.hypot(to_targets[:, 0], to_targets[:, 1])
    return to_targets[np.argmin(lengths)] / lengths.min()


def search(
    situation: Situation, rng: np.random.Generator, shots: int = SHOTS, noise: tuple[float, float] = (0.0, 0.0)
) -> Floats:
    """Simulates shots and returns the velocity of the one with the highest rating, the first of equal ones.

    The first half of the shots are the direct pots, best first, and then variations of them: directions that are off by
    about their tolerance, at any speed. The other shots have any direction and any speed. Without direct pots, all do.

    Args:
        situation: The table.
        rng: The generator to draw from.
        shots: The number of shots to simulate.
        noise: Standard deviations of the execution noise: of the direction, degrees, and of the speed, m/s. If either
            is positive, the best shots are repeated with such errors, and the highest mean rating decides.

    Returns:
        (2,) velocity, m/s.
    """
    max_speed = situation.max_speed
    near, anywhere = _near(situation.pots(), max_speed, (shots + 1) // 2, rng), _anywhere(shots, rng)
    actions = np.concatenate((situation.first, near, anywhere))[:shots]
    ratings = situation.rate(actions)
    if any(noise):
        actions = actions[np.argsort(-ratings, kind="stable")[:FINALISTS]]
        errors = rng.standard_normal((2, REPEATS, len(actions)))
        turns, speeds = errors[0] * (noise[0] / 180.0), errors[1] * (noise[1] / max_speed)
        perturbed = perturb(np.broadcast_to(actions, (*turns.shape, 2)), turns, speeds)
        ratings = situation.rate(perturbed.reshape(-1, 2)).reshape(turns.shape).mean(axis=0)
    return max_speed * actions[np.argmax(ratings)]


def _near(pots: Pots, max_speed: float, count: int, rng: np.random.Generator) -> Floats:
    """Returns (count, 2) actions: direct pots, then variations of them; (0, 2) without direct pots."""
    if not len(pots.speed):
        return np.empty((0, 2))
    which = np.arange(count) % len(pots.speed)
    varied = np.arange(count) >= len(pots.speed)
    turns = np.where(varied, rng.standard_normal(count) * pots.tolerance[which] / np.pi, 0.0)
    speeds = np.where(varied, rng.uniform(0.1, 1.0, count), pots.speed[which] / max_speed)
    return perturb(speeds[:, None] * pots.direction[which], turns, np.zeros(count))


def _anywhere(count: int, rng: np.random.Generator) -> Floats:
    """Returns (count, 2) actions in any direction, with 0.1 to 1 of the largest speed."""
    angles, speeds = rng.uniform(-np.pi, np.pi, count), rng.uniform(0.1, 1.0, count)
    return speeds[:, None] * np.column_stack((np.cos(angles), np.sin(angles)))


STRATEGIES: dict[str, Strategy] = {"random": random, "geometric": geometric, "search": search}


def find_strategy(text: str, noise: tuple[float, float] = (0.0, 0.0)) -> Strategy:
    """Returns the strategy of a name.

    Args:
        text: One of `STRATEGIES`; "search:K" simulates K shots.
        noise: The execution noise that "search" allows for.

    Raises:
        ValueError: If there is no such strategy, or K is not a whole number >= 1.
    """
    name, colon, count = text.partition(":")
    choose("player", name, tuple(STRATEGIES))
    if name != "search" and not colon:
        return STRATEGIES[name]
    if name != "search" or (colon and not (count.isdecimal() and int(count) >= 1)):
        raise ValueError(f"player = {text!r}: expected 'search:K' with a whole number K >= 1, or a name without ':'")
    return functools.partial(search, noise=noise, shots=int(count) if colon else SHOTS)
