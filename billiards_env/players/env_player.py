"""The strategies in `Billiards-v0`.

Example:
    >>> import numpy as np
    >>> from billiards_env.envs import BilliardsEnv
    >>> from billiards_env.players.strategies import geometric
    >>> env = BilliardsEnv()
    >>> _ = env.reset(seed=1)
    >>> env.step(geometric(situation(env), np.random.default_rng(0)))[1]
    1.0
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_env.engine.threads import spread
from billiards_env.envs import BilliardsEnv
from billiards_env.envs.actions import ACTIONS, aimed_strikes
from billiards_env.players.pots import DX, DY, SHOT_WIDTH, SPEED, SPEEDS, find_pots
from billiards_env.players.strategies import Situation, anywhere, random_offsets, with_numbers

Floats = NDArray[np.float64]

_VARIED = 0.35  # largest change of the logarithm of a speed


def situation(env: BilliardsEnv) -> Situation:
    """Returns the situation in an environment. The rating of an action is its reward."""
    targets = env.on if env.on.size else env.targets
    return Situation(
        env.scene,
        env.positions,
        env.potted,
        targets,
        env.max_speed,
        lambda actions: rewards(env, actions),
        numbers=ACTIONS[env.action],
    )


class Tables(NamedTuple):
    """The state of m episodes.

    Attributes:
        positions: (m, n, 2) m.
        potted: (m, n) bool, the balls off the table.
        goals: (m, g, 2) m; see `BilliardsEnv.goals`.
        on: (m, n) or (m, 0) bool; see `BilliardsEnv.on`.
    """

    positions: Floats
    potted: NDArray[np.bool_]
    goals: Floats
    on: NDArray[np.bool_]

    def repeat(self, times: int) -> Tables:
        """Returns each table `times` times, one after the other."""
        return Tables._make(array.repeat(times, axis=0) for array in self)


def rewards(env: BilliardsEnv, actions: Floats, tables: Tables | None = None) -> Floats:
    """Returns the reward of each of several actions if it is the next step of an environment.

    Args:
        env: The environment; it does not change.
        actions: (m, 2) or (m, 5), as for `env.step`.
        tables: The table before each action; None for the table of the environment.

    Returns:
        (m,) rewards.
    """
    m, n = len(actions), env.scene.n_balls
    positions, potted, goals, on = (env.positions, env.potted, env.goals, env.on) if tables is None else tables
    episodes, found = env.episodes(m), np.empty(m)
    episodes.shots.positions[:] = positions
    episodes.shots.in_play[:] = ~potted
    episodes.goals[:], episodes.on[:] = goals, on
    no_skip, off = np.zeros(m, np.bool_), np.empty((m, n), np.bool_)
    observations = np.empty((m, len(env.observation_space.low)), np.float32)  # pyright: ignore

    def work(begin: int, end: int) -> None:
        episodes.shoot(begin, end, no_skip, actions, found, off, observations)

    spread(work, m)
    return found


def try_pots(
    env: BilliardsEnv, tables: Tables, shots: int, rng: np.random.Generator, vary: bool = False
) -> tuple[Floats, Floats]:
    """Simulates pots on each of m tables, in a few calls for all tables.

    The easiest pots come first, each at all of its speeds. If there are too few, they are repeated. On a table without
    a pot, the shots have random directions and speeds.

    Args:
        env: The environment; it does not change.
        tables: The tables.
        shots: s, the number of shots on each table.
        rng: The generator to draw from.
        vary: Whether repeated pots have random speeds and, if actions are strikes, random offsets of the tip.

    Returns:
        (m, s, 2) or (m, s, 5) actions and their (m, s) rewards.
    """
    m = len(tables.positions)
    pots = find_pots(
        env.scene, env.targets, tables.positions, tables.potted, env.max_speed, most=-(-shots // len(SPEEDS))
    )
    found = pots.shots.reshape(m, -1, SHOT_WIDTH)
    possible = found[..., SPEED] > 0
    order, count = np.argsort(~possible, axis=1, kind="stable"), possible.sum(axis=1)
    which = np.take_along_axis(order, np.arange(shots) % np.maximum(count, 1)[:, None], axis=1)
    pot = np.take_along_axis(found, which[..., None], axis=1)
    actions = pot[..., SPEED, None] / env.max_speed * pot[..., DX : DY + 1]
    none = count == 0
    actions[none] = anywhere(none.sum() * shots, rng).reshape(-1, shots, 2)
    actions, numbers = actions.reshape(-1, 2), ACTIONS[env.action]
    if vary:
        again = (np.arange(shots) >= np.maximum(count, 1)[:, None]).reshape(-1, 1)
        actions = np.where(again, actions * np.exp(rng.uniform(-_VARIED, _VARIED, again.shape)), actions)
        if numbers > 2:
            offsets = np.where(again, random_offsets(len(actions), rng), 0.0)
            actions = aimed_strikes(env.scene, actions, offsets)
    actions = with_numbers(actions, numbers)
    return actions.reshape(m, shots, numbers), rewards(env, actions, tables.repeat(shots)).reshape(m, shots)
