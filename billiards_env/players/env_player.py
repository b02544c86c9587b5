"""The strategies in `Billiards-v0`.

Example:
    >>> import numpy as np
    >>> from billiards_env.envs import BilliardsEnv
    >>> from billiards_env.players.strategies import geometric
    >>> env = BilliardsEnv()
    >>> _ = env.reset(seed=1)
    >>> velocity = geometric(situation(env), np.random.default_rng(0))
    >>> env.step(velocity / env.max_speed)[1]
    1.0
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from billiards_env.engine.threads import spread
from billiards_env.envs import BilliardsEnv
from billiards_env.players.strategies import Situation

Floats = NDArray[np.float64]


def situation(env: BilliardsEnv) -> Situation:
    """Returns the table of an environment; ratings are rewards."""
    return Situation(
        env.scene, env.positions, env.potted, env.targets, env.max_speed, lambda actions: rewards(env, actions)
    )


def rewards(env: BilliardsEnv, actions: Floats) -> Floats:
    """Returns the reward of each of several actions as the next step of an environment.

    Args:
        env: The environment; it does not change.
        actions: (m, 2) as `env.step` takes them.

    Returns:
        (m,) rewards.
    """
    m, n = len(actions), env.scene.n_balls
    episodes, found = env.episodes(m), np.empty(m)
    episodes.shots.positions[:] = env.positions
    episodes.shots.in_play[:] = ~env.potted
    episodes.goals[:] = env.goals
    no_skip, potted = np.zeros(m, np.bool_), np.empty((m, n), np.bool_)
    observations = np.empty((m, 2 * (n + len(env.goals))), np.float32)

    def work(begin: int, end: int) -> None:
        episodes.shoot(begin, end, no_skip, actions, found, potted, observations)

    spread(work, m)
    return found
