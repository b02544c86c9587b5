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

import numpy as np
from numpy.typing import NDArray

from billiards_env.engine.threads import parallel_for
from billiards_env.envs import BilliardsEnv
from billiards_env.envs.actions import ACTIONS
from billiards_env.envs.tasks import TASKS
from billiards_env.players.aim import FirstTouch, Goal, Leave, Pot, Touch, carom_goals
from billiards_env.players.strategies import Situation

Floats = NDArray[np.float64]


def situation(env: BilliardsEnv) -> Situation:
    """Returns the situation in an environment. The rating of an action is its reward."""
    targets = env.legal_balls if env.legal_balls.size else env.targets
    return Situation(
        env.episode_scene,
        env.positions,
        env.potted,
        targets,
        env.max_speed,
        lambda actions: rewards(env, actions),
        action_size=ACTIONS[env.action],
        goals=_goals(env, np.flatnonzero(targets & ~env.potted).tolist()),
    )


def _goals(env: BilliardsEnv, balls: list[int]) -> tuple[tuple[Goal, ...], ...]:
    """Returns the ways to score in the task of an environment, with the legal balls."""
    task = env.task
    if task in ("carom", "three_cushion"):
        return carom_goals(balls, cushions=3 if task == "three_cushion" else 0)
    leave = tuple(Leave((x, y), TASKS[task].goal_radius) for x, y in env.goals.tolist())
    if task == "place":
        return tuple((Touch(ball), *leave) for ball in balls) or (leave,)
    if TASKS[task].pockets:
        return tuple((FirstTouch(ball), Pot(ball), *leave) for ball in balls)
    return ()


def rewards(env: BilliardsEnv, actions: Floats) -> Floats:
    """Returns the reward (m,) of each action (m, 2) or (m, 5), if it were the next step of the environment.

    The environment does not change.
    """
    m = len(actions)
    episodes, found = env.episodes(m), np.empty(m)
    episodes.shots.positions[:] = env.positions
    episodes.shots.in_play[:] = ~env.potted
    arrays = episodes.arrays
    arrays.goals[:], arrays.legal_balls[:], arrays.over[:] = env.goals, env.legal_balls, False
    observations = np.empty((m, len(env.observation_space.low)), np.float32)  # pyright: ignore

    def work(begin: int, end: int) -> None:
        episodes.shoot(begin, end, actions, found, observations)

    parallel_for(work, m)
    return found
