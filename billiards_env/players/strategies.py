"""Players without training that choose a shot by geometry or by search.

* "random" plays a random shot.
* "geometric" plays the best direct pot or, if there is none, the best pot off one cushion
  (`billiards_env.pots.finder`). If there is no pot at all, it plays a full hit on the nearest target at the largest
  speed. It does not use the engine.
* "search" simulates shots and plays the best one; "search:20" simulates 20 shots.
* "aim" computes shots that reach the goals of a task or a game (`billiards_env.players.aim`), and plays the best one.
  If there is none, it searches.

An action is the velocity of the cue ball divided by the largest speed, (2,), or a strike, (5,), see
`billiards_env.envs.actions`. "search" also tries pots with random english and follow or draw, if actions are strikes.
In scenes with flight it also tries pots over other balls with a raised cue.

None of them plays a safety or a push out, or hands a shot back. With the cue ball in hand, "random" draws its place.
The others draw some places, and choose the one with the easiest pot.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from billiards_env.envs.actions import ELEVATION, PLAYED, aimed_strikes, perturb
from billiards_env.games import Stroke
from billiards_env.physics.state import CUE_BALL
from billiards_env.players.aim import aim
from billiards_env.players.situation import Situation, placed

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

SHOTS = 200
"""The number of shots that "search" simulates."""

FINALISTS, REPEATS = 16, 16
"""With execution noise, `best_of` simulates each of the best `FINALISTS` shots `REPEATS` times with noise."""


_LEVEL = -0.5  # an elevation of an action below 0 is a level cue
_RAISED = 0.1, 0.7  # the least and the largest elevation of a jump shot, over 90 degrees

AIM_SHOTS = 3_000
"""The largest number of random shots for each way to score with which "aim" begins."""

AIM_WAYS = 2
"""With more ways to score than this, "aim" begins with the shots by geometry alone."""


def random(situation: Situation, rng: np.random.Generator) -> Stroke:
    """Returns the stroke of an action of uniform random numbers between -1 and 1."""
    action = rng.uniform(-1.0, 1.0, situation.action_size)
    return placed(situation, rng, places=1).stroke(action)


def geometric(situation: Situation, rng: np.random.Generator) -> Stroke:
    """Returns the best pot, or a full hit on the nearest target if there is no pot, with a level cue and no english."""
    situation = placed(situation, rng)
    pots, fastest = situation.pots(), situation.table.max_speed
    velocity = pots.speed[0] / fastest * pots.direction[0] if len(pots.speed) else situation.full_hit()
    return situation.stroke(padded(velocity, situation.action_size))


def search(situation: Situation, rng: np.random.Generator, shots: int = SHOTS) -> Stroke:
    """Simulates shots and returns the first one with the highest rating.

    The first half of the shots are the pots, best first, and then variations of them with directions turned by
    about the tolerance, random speeds and, if actions are strikes, random offsets of the tip. The other shots have
    random directions and speeds. If there is no pot, all shots are random. In a game a full hit comes first. If actions
    are strikes in a scene with flight, a quarter of all shots are pots with a raised cue. `best_of` chooses.

    Args:
        situation: The situation.
        rng: The generator to draw from.
        shots: The number of shots to simulate.
    """
    situation = placed(situation, rng)
    first = situation.full_hit()[None] if situation.in_game else np.empty((0, 2))
    near = [_near(situation, (shots + 1) // 2, rng)]
    if situation.action_size > 2 and situation.table.scene.physics.flight:
        near = [_near(situation, (shots + 3) // 4, rng, jumps=True), near[0][: shots // 4]]
    parts = (padded(part, situation.action_size) for part in (first, *near, anywhere(shots, rng)))
    return best_of(situation, np.concatenate(tuple(parts))[:shots], rng)


def best_of(situation: Situation, actions: Floats, rng: np.random.Generator) -> Stroke:
    """Simulates proposed actions (k, ...), and returns the stroke of the first one with the highest rating.

    If there is noise, the `FINALISTS` best actions are simulated `REPEATS` times with it, and the highest mean rating
    decides. The noise is drawn from `rng`: it is not the noise of the shot that is played. If the actions are not plain
    velocities or strikes, its deviations are those of the environment.
    """
    ratings, noise = situation.rate(actions), situation.noise
    if not any(noise):
        return situation.stroke(actions[np.argmax(ratings)])
    actions = actions[np.argsort(-ratings, kind="stable")[:FINALISTS]]
    if situation.action in PLAYED and actions.shape[1:] == (situation.action_size,):
        drawn = np.moveaxis(rng.standard_normal((2, REPEATS, len(actions))), 0, -1)
        drawn = padded(drawn * (noise[0] / 180.0, noise[1] / situation.table.max_speed), situation.action_size)
        perturbed = perturb(np.broadcast_to(actions, drawn.shape), drawn)
        ratings = situation.rate(perturbed.reshape(-1, situation.action_size))
    else:
        ratings = situation.rate(np.tile(actions, (REPEATS, *(1,) * (actions.ndim - 1))), rng)
    return situation.stroke(actions[ratings.reshape(REPEATS, -1).mean(axis=0).argmax()])


def reach_goals(situation: Situation, rng: np.random.Generator) -> Stroke:
    """Returns a shot that reaches the goals of one way to score, or the shot of `search`, if none scores.

    Of the shots with the highest rating the first one has the largest margins.
    """
    situation = placed(situation, rng)
    table = situation.table
    candidates = [np.empty((0, situation.action_size))]
    shots = AIM_SHOTS if len(situation.goals) <= AIM_WAYS else 0
    for goals in situation.goals if table.cue == CUE_BALL else ():
        aimed = aim(
            table.scene,
            table.positions[0],
            goals,
            max_speed=table.max_speed,
            in_play=table.in_play[0],
            strike=situation.strike,
            shots=shots,
        )
        if aimed.solved:
            velocities = np.concatenate((aimed.velocity[None], aimed.alternatives))
            candidates.append(padded(velocities / table.max_speed, situation.action_size))
    actions = np.concatenate(candidates)
    ratings = situation.rate(actions)
    return situation.stroke(actions[np.argmax(ratings)]) if ratings.max(initial=0.0) > 0.0 else search(situation, rng)


def padded(actions: Floats, numbers: int) -> Floats:
    """Returns actions (..., k), padded with zeros to `numbers` numbers."""
    return np.concatenate((actions, np.zeros((*actions.shape[:-1], numbers - actions.shape[-1]))), axis=-1)


def random_offsets(count: int, rng: np.random.Generator) -> Floats:
    """Returns (count, 2) offsets of the tip, side and top, uniform in a disc that leaves a margin to the miscue."""
    angles, lengths = rng.uniform(-np.pi, np.pi, count), 0.9 * np.sqrt(rng.uniform(0.0, 1.0, count))
    return lengths[:, None] * np.column_stack((np.cos(angles), np.sin(angles)))


def _near(situation: Situation, count: int, rng: np.random.Generator, jumps: bool = False) -> Floats:
    """Returns (count, numbers) actions: the pots, then variations of them. Without pots there are none.

    With `jumps` the cue is raised, and there is no english.
    """
    pots = situation.pots(jumps)
    if not len(pots.speed):
        return np.empty((0, 2))
    which = np.arange(count) % len(pots.speed)
    varied = np.arange(count) >= len(pots.speed)
    turns = np.where(varied, rng.standard_normal(count) * pots.tolerance[which] / np.pi, 0.0)
    speeds = np.where(varied, rng.uniform(0.1, 1.0, count), pots.speed[which] / situation.table.max_speed)
    actions = perturb(speeds[:, None] * pots.direction[which], np.column_stack((turns, np.zeros(count))))
    if situation.action_size == 2:
        return actions
    spun = varied & (not jumps)
    strikes = aimed_strikes(situation.table.scene, actions, np.where(spun[:, None], random_offsets(count, rng), 0.0))
    if jumps:
        strikes[:, ELEVATION] = rng.uniform(*_RAISED, count)
    return strikes


def anywhere(count: int, rng: np.random.Generator) -> Floats:
    """Returns (count, 2) random actions in all directions, with 0.1 to 1 of the largest speed."""
    angles, speeds = rng.uniform(-np.pi, np.pi, count), rng.uniform(0.1, 1.0, count)
    return speeds[:, None] * np.column_stack((np.cos(angles), np.sin(angles)))


def hits(
    positions: Floats,
    radius: Sequence[float],
    count: int,
    speeds: tuple[float, float],
    size: int,
    rng: np.random.Generator,
    raised: bool = False,
    legal: Bools | None = None,
) -> Floats:
    """Returns (m, count, size) random actions that send the cue ball at random parts of random object balls.

    Args:
        positions: (m, n, 2) m, all balls on the table.
        radius: (n,) m.
        count: The number of actions for each table.
        speeds: The least and the largest speed, over the largest speed of the environment. Slower ones are more likely.
        size: 2 for velocities, 5 for strikes with random offsets of the tip and a level cue.
        rng: The generator to draw from.
        raised: Whether half of the strikes have a raised cue.
        legal: (m, n - 1) bool, the object balls to hit; None for all.
    """
    m, n = positions.shape[:2]
    balls = rng.integers(1, n, (m, count))
    if legal is not None:
        balls = 1 + (rng.random((m, count, n - 1)) * legal[:, None]).argmax(2)
    ways = np.take_along_axis(positions, balls[:, :, None], axis=1) - positions[:, :1]
    reach = (radius[0] + np.array(radius)[balls]) / np.hypot(ways[..., 0], ways[..., 1])
    angles = np.arctan2(ways[..., 1], ways[..., 0])
    angles += np.arcsin(np.minimum(reach, 1.0)) * rng.uniform(-1.0, 1.0, (m, count))
    speed = speeds[0] + (speeds[1] - speeds[0]) * rng.random((m, count)) ** 1.5
    velocities = speed[..., None] * np.stack((np.cos(angles), np.sin(angles)), axis=2)
    if size == 2:
        return velocities
    offsets, elevations = random_offsets(m * count, rng).reshape(m, count, 2), np.full((m, count, 1), _LEVEL)
    if raised:
        elevations[:, ::2] = rng.uniform(*_RAISED, elevations[:, ::2].shape)
    return np.concatenate((velocities, offsets, elevations), axis=2)
