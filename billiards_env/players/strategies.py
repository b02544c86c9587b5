"""Strategies: the choice of a shot by a player without training.

* "random" plays a random shot.
* "geometric" plays the best direct pot or, if there is none, the best pot off one cushion
  (`billiards_env.players.pots`). If there is no pot at all, it plays a full hit on the nearest target at the largest
  speed. It does not use the engine.
* "search" simulates shots and plays the best one; "search:20" simulates 20 shots.
* "aim" computes shots that reach the goals of a task or a game (`billiards_env.players.aim`), and plays the best one.
  If there is none, it searches.

A strategy is a function `(situation, rng) -> action`. An action is the velocity of the cue ball divided by the largest
speed, (2,), or a strike, (5,), see `billiards_env.envs.actions`. "search" also tries pots with random english and
follow or draw, if actions are strikes.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_env.checks import one_of
from billiards_env.envs.actions import aimed_strikes, perturb
from billiards_env.players.aim import Goal, aim
from billiards_env.players.pots import PotShots, Tables, pot_shots
from billiards_env.scene import Scene

Floats = NDArray[np.float64]

SHOTS = 200
"""The number of shots that "search" simulates."""

FINALISTS, REPEATS = 16, 16
"""With execution noise, "search" simulates each of its best `FINALISTS` shots `REPEATS` times with noise."""


AIM_SHOTS = 3_000
"""The largest number of random shots for each way to score with which "aim" begins."""

AIM_WAYS = 2
"""With more ways to score than this, "aim" begins with the shots by geometry alone."""


class Situation(NamedTuple):
    """A table before a shot.

    Attributes:
        scene: The scene.
        positions: (n, 2) m.
        off_table: (n,) bool, the balls that are not on the table.
        targets: (n,) bool, the balls that the cue ball may hit.
        max_speed: Speed of the fastest shot, m/s.
        rate: A function that simulates (m, action_size) actions and returns (m,) ratings; larger is better.
        cue: The number of the cue ball.
        tried_first: (k, 2) velocities that "search" tries before all others.
        action_size: The number of values of an action, 2 or 5.
        goals: Several ways to score: the goals of each.
        strike: Whether a cue strikes the cue ball and drives balls that touch it.
    """

    scene: Scene
    positions: Floats
    off_table: NDArray[np.bool_]
    targets: NDArray[np.bool_]
    max_speed: float
    rate: Callable[[Floats], Floats]
    cue: int = 0
    tried_first: Floats = np.empty((0, 2))
    action_size: int = 2
    goals: tuple[tuple[Goal, ...], ...] = ()
    strike: bool = False

    def pots(self) -> PotShots:
        """Returns the direct pots, or the pots off one cushion if there is no direct pot, best first."""
        return pot_shots(Tables(self.scene, self.targets, self.positions, self.off_table, self.max_speed, self.cue))


Strategy = Callable[[Situation, np.random.Generator], Floats]


def random(situation: Situation, rng: np.random.Generator) -> Floats:
    """Returns an action of uniform random numbers between -1 and 1."""
    return rng.uniform(-1.0, 1.0, situation.action_size)


def geometric(situation: Situation, rng: np.random.Generator) -> Floats:
    """Returns the best pot, or a full hit on the nearest target if there is no pot, with a level cue and no english."""
    pots = situation.pots()
    velocity = pots.speed[0] / situation.max_speed * pots.direction[0] if len(pots.speed) else full_hit(situation)
    return padded(velocity, situation.action_size)


def full_hit(situation: Situation) -> Floats:
    """Returns the direction (2,) from the cue ball to the nearest target on the table."""
    to_targets = (situation.positions - situation.positions[situation.cue])[situation.targets & ~situation.off_table]
    lengths = np.hypot(to_targets[:, 0], to_targets[:, 1])
    return to_targets[np.argmin(lengths)] / lengths.min()


def search(
    situation: Situation, rng: np.random.Generator, shots: int = SHOTS, noise: tuple[float, float] = (0.0, 0.0)
) -> Floats:
    """Simulates shots and returns the action of the first one with the highest rating.

    The first half of the shots are the pots, best first, and then variations of them with directions turned by
    about the tolerance, random speeds and, if actions are strikes, random offsets of the tip. The other shots have
    random directions and speeds. If there is no pot, all shots are random.

    Args:
        situation: The table.
        rng: The generator to draw from.
        shots: The number of shots to simulate.
        noise: Standard deviations of the execution noise: of the direction, degrees, and of the speed, m/s. If either
            is positive, the best shots are simulated again with such noise, and the highest mean rating decides.

    Returns:
        (2,) or (5,) action.
    """
    near = _near(situation, (shots + 1) // 2, rng)
    parts = (padded(part, situation.action_size) for part in (situation.tried_first, near, anywhere(shots, rng)))
    actions = np.concatenate(tuple(parts))[:shots]
    ratings = situation.rate(actions)
    if any(noise):
        actions = actions[np.argsort(-ratings, kind="stable")[:FINALISTS]]
        drawn = np.moveaxis(rng.standard_normal((2, REPEATS, len(actions))), 0, -1)
        drawn = padded(drawn * (noise[0] / 180.0, noise[1] / situation.max_speed), situation.action_size)
        perturbed = perturb(np.broadcast_to(actions, drawn.shape), drawn)
        ratings = situation.rate(perturbed.reshape(-1, situation.action_size)).reshape(drawn.shape[:2]).mean(axis=0)
    return actions[np.argmax(ratings)]


def reach_goals(situation: Situation, rng: np.random.Generator, noise: tuple[float, float] = (0.0, 0.0)) -> Floats:
    """Returns an action that reaches the goals of one way to score, or the action of `search`, if none scores.

    Of the shots with the highest rating the first one has the largest margins.
    """
    candidates = [np.empty((0, situation.action_size))]
    shots = AIM_SHOTS if len(situation.goals) <= AIM_WAYS else 0
    for goals in situation.goals if situation.cue == 0 else ():
        aimed = aim(
            situation.scene,
            situation.positions,
            goals,
            max_speed=situation.max_speed,
            in_play=~situation.off_table,
            strike=situation.strike,
            shots=shots,
        )
        if aimed.solved:
            velocities = np.concatenate((aimed.velocity[None], aimed.alternatives))
            candidates.append(padded(velocities / situation.max_speed, situation.action_size))
    actions = np.concatenate(candidates)
    ratings = situation.rate(actions)
    return actions[np.argmax(ratings)] if ratings.max(initial=0.0) > 0.0 else search(situation, rng, noise=noise)


def padded(actions: Floats, numbers: int) -> Floats:
    """Returns actions (..., k), padded with zeros to `numbers` numbers."""
    return np.concatenate((actions, np.zeros((*actions.shape[:-1], numbers - actions.shape[-1]))), axis=-1)


def random_offsets(count: int, rng: np.random.Generator) -> Floats:
    """Returns (count, 2) offsets of the tip, side and top, uniform in a disc that leaves a margin to the miscue."""
    angles, lengths = rng.uniform(-np.pi, np.pi, count), 0.9 * np.sqrt(rng.uniform(0.0, 1.0, count))
    return lengths[:, None] * np.column_stack((np.cos(angles), np.sin(angles)))


def _near(situation: Situation, count: int, rng: np.random.Generator) -> Floats:
    """Returns (count, numbers) actions: the pots, then variations of them. Without pots there are none."""
    pots = situation.pots()
    if not len(pots.speed):
        return np.empty((0, 2))
    which = np.arange(count) % len(pots.speed)
    varied = np.arange(count) >= len(pots.speed)
    turns = np.where(varied, rng.standard_normal(count) * pots.tolerance[which] / np.pi, 0.0)
    speeds = np.where(varied, rng.uniform(0.1, 1.0, count), pots.speed[which] / situation.max_speed)
    actions = perturb(speeds[:, None] * pots.direction[which], np.column_stack((turns, np.zeros(count))))
    if situation.action_size == 2:
        return actions
    return aimed_strikes(situation.scene, actions, np.where(varied[:, None], random_offsets(count, rng), 0.0))


def anywhere(count: int, rng: np.random.Generator) -> Floats:
    """Returns (count, 2) random actions in all directions, with 0.1 to 1 of the largest speed."""
    angles, speeds = rng.uniform(-np.pi, np.pi, count), rng.uniform(0.1, 1.0, count)
    return speeds[:, None] * np.column_stack((np.cos(angles), np.sin(angles)))


STRATEGIES: dict[str, Strategy] = {"random": random, "geometric": geometric, "search": search, "aim": reach_goals}


def find_strategy(text: str, noise: tuple[float, float] = (0.0, 0.0)) -> Strategy:
    """Returns the strategy of a name.

    Args:
        text: One of `STRATEGIES`; "search:K" simulates K shots.
        noise: The execution noise in the simulations of "search" and "aim"; see `search`.

    Raises:
        ValueError: If there is no such strategy, or K is not a whole number >= 1.
    """
    name, colon, count = text.partition(":")
    one_of("player", name, tuple(STRATEGIES))
    if name == "aim" and not colon:
        return functools.partial(reach_goals, noise=noise)
    if name != "search" and not colon:
        return STRATEGIES[name]
    if name != "search" or (colon and not (count.isdecimal() and int(count) >= 1)):
        raise ValueError(f"player = {text!r}: expected 'search:K' with a whole number K >= 1, or a name without ':'")
    return functools.partial(search, noise=noise, shots=int(count) if colon else SHOTS)
