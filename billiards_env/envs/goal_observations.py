"""Goals in the form of Gymnasium-Robotics, for hindsight experience replay (Andrychowicz et al. 2017).

With `observe="goal"` an observation of a task with a goal is a dict: "observation", "achieved_goal" and "desired_goal".
The goals are three numbers: x and y, m, and a condition. The achieved goal has the place of the cue ball and the
condition 1 if the last shot met the other condition of the task (it touched or potted a ball), -1 if it potted the cue
ball, and 0 otherwise. The desired goal has the condition 1. A replay buffer may replace it by an achieved goal: then a
shot with the condition 0 also reaches a goal, without touching a ball.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from billiards_env.envs.episode_arrays import EpisodeArrays, TaskNumbers
from billiards_env.jit import entry_point
from billiards_env.physics.state import CUE_BALL, X, Y
from billiards_env.support.checks import numbers

ACHIEVED, DESIRED = "achieved_goal", "desired_goal"
CONDITION = 2
"""Column of a goal, after X and Y."""


@entry_point
def write_achieved(begin, end, goals, half_extents, condition, numbers, arrays):
    """Writes the achieved goals (m, 3) of the episodes from `begin` to `end - 1` by the kernel `Task.condition`."""
    numbers, arrays = TaskNumbers(*numbers), EpisodeArrays(*arrays)
    for k in range(begin, end):
        for c in range(2):
            goals[k, c] = min(max(arrays.positions[k, CUE_BALL, c], -half_extents[c]), half_extents[c])
        goals[k, CONDITION] = 0.0
        if not arrays.fresh[k]:
            if arrays.potted[k, CUE_BALL]:
                goals[k, CONDITION] = -1.0
            elif condition(k, numbers, arrays):
                goals[k, CONDITION] = 1.0


@entry_point
def write_desired(begin, end, goals, places):
    """Writes the desired goals (m, 3) of the episodes from `begin` to `end - 1`."""
    for k in range(begin, end):
        goals[k, X], goals[k, Y], goals[k, CONDITION] = places[k, 0, X], places[k, 0, Y], 1.0


def compute_reward(
    radius: float, scratch_penalty: float, achieved_goal: ArrayLike, desired_goal: ArrayLike, info: Any = None
) -> Any:
    """Returns the rewards of shots, those of `step` for its own goal, bit for bit.

    Args:
        radius: The largest distance of the cue ball from the goal, m.
        scratch_penalty: As in the environment.
        achieved_goal: (..., 3), see the module.
        desired_goal: (..., 3).
        info: Not used.

    Returns:
        (...) float64.
    """
    achieved = numbers("achieved_goal", achieved_goal)
    desired = numbers("desired_goal", desired_goal)
    (dx, dy), got = np.moveaxis(achieved[..., :2] - desired[..., :2], -1, 0), achieved[..., CONDITION]
    reached = (dx * dx + dy * dy <= radius * radius) & (got >= np.maximum(desired[..., CONDITION], 0.0))
    return reached - scratch_penalty * (got < 0.0)
