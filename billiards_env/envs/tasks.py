"""The tasks: one kernel for each task computes the points of a shot.

Each kernel has the arguments

    k: index of the shot, from 0 to m - 1.
    targets: (n,) bool, the balls of the task.
    outcome: `Outcome` of the m shots. Views of the arrays of one shot would take longer than the kernel itself.

and returns the points of the shot, whether the episode is decided, and whether the task is achieved. The limit on shots
and the penalty for a scratch are not part of a task.

A new task needs a kernel, a name in `TASKS`, a line in `judge`, an opening layout in `OPENING_LAYOUTS`, and a check in
`task_targets` of the scenes in which it can be played.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_env.checks import choose
from billiards_env.physics.jit import kernel
from billiards_env.physics.state import CUE_BALL, X, Y
from billiards_env.scene import Scene

TASKS = ("pot", "carom", "three_cushion", "sum_to_three", "place")
POT, CAROM, THREE_CUSHION, SUM_TO_THREE, PLACE = range(len(TASKS))

OPENING_LAYOUTS = {
    "pot": "rack",
    "carom": "carom_opening",
    "three_cushion": "carom_opening",
    "sum_to_three": "line",
    "place": "random",
}
"""The layout with which the game of each task begins."""

PLACE_RADIUS = 0.15
"""m. Largest distance from the goal at which the cue ball may come to rest in the task "place"."""


class Outcome(NamedTuple):
    """The outcome of m shots.

    Attributes:
        positions: (m, n, 2) float64, m, positions of the balls after the shot.
        goals: (m, g, 2) float64, m: one goal (g = 1) in the task "place", none in the others.
        potted_before: (m, n) bool, the balls off the table before the shot.
        potted: (m, n) bool, the balls off the table after it.
        cushions: (m, n) int32, number of cushion contacts of each ball.
        cushions_before_hit: (m, n) int32, number of cushion contacts that the cue ball had when it first touched each
            ball, -1 if it did not touch it.
    """

    positions: Any
    goals: Any
    potted_before: Any
    potted: Any
    cushions: Any
    cushions_before_hit: Any


def task_targets(task: str, scene: Scene) -> NDArray[np.bool_]:
    """Returns the balls that count in a task: the object balls, in "pot" only those of finite mass.

    Args:
        task: One of `TASKS`.
        scene: The scene.

    Returns:
        (n,) bool.

    Raises:
        ValueError: If the task is unknown or cannot be played in the scene.
    """
    choose("task", task, TASKS)
    targets = np.arange(scene.n_balls) > 0
    if task != "place" and not targets.any():
        raise ValueError(f"task = {task!r} with a scene of the cue ball alone: expected at least one object ball")
    if task == "sum_to_three" and (scene.n_balls != 2 or scene.table.pockets):
        raise ValueError(
            f"task = 'sum_to_three' with {scene.n_balls - 1} object balls and {len(scene.table.pockets)} pockets: "
            "expected one object ball and a table without pockets, such as scene 'sum_to_three'"
        )
    if task == "pot":
        if not scene.table.pockets:
            raise ValueError(
                "task = 'pot' with a scene without pockets: expected a table with pockets, or task 'carom'"
            )
        targets &= np.isfinite(scene.balls.mass)
        if not targets.any():
            raise ValueError("task = 'pot' with object balls of infinite mass only: expected one of finite mass")
    return targets


@kernel
def judge(task, k, targets, outcome):
    """Returns the result of shot k; `task` is an index into `TASKS`."""
    if task == POT:
        return judge_pot(k, targets, outcome)
    if task == CAROM:
        return judge_carom(k, targets, outcome)
    if task == THREE_CUSHION:
        return judge_three_cushion(k, targets, outcome)
    if task == SUM_TO_THREE:
        return judge_sum_to_three(k, targets, outcome)
    return judge_place(k, targets, outcome)


@kernel
def judge_pot(k, targets, outcome):
    """Pots the object balls: 1 point for each.

    Decided if all object balls are potted or the cue ball is potted (a scratch). Achieved if all object balls are
    potted and the cue ball is not.
    """
    points, cleared = 0, True
    for i in range(len(targets)):
        if targets[i]:
            if not outcome.potted[k, i]:
                cleared = False
            elif not outcome.potted_before[k, i]:
                points += 1
    scratch = outcome.potted[k, CUE_BALL]
    return points, cleared or scratch, cleared and not scratch


@kernel
def judge_carom(k, targets, outcome):
    """Touches every object ball with the cue ball in one shot: 1 point.

    A shot that pots the cue ball scores 0 points. Decided if any ball is potted, because a potted ball cannot be
    touched again. Otherwise the episode continues, with or without a point.
    """
    success, over = not outcome.potted[k, CUE_BALL], False
    for i in range(len(targets)):
        if targets[i] and outcome.cushions_before_hit[k, i] < 0:
            success = False
        if outcome.potted[k, i]:
            over = True
    return (1 if success else 0), over, success


@kernel
def judge_three_cushion(k, targets, outcome):
    """Touches every object ball with the cue ball, the last one after at least three cushion contacts: 1 point.

    The other rules are those of `judge_carom`. Several contacts with the same cushion count.
    """
    _, over, success = judge_carom(k, targets, outcome)
    most = 0
    for i in range(len(targets)):
        if targets[i]:
            most = max(most, outcome.cushions_before_hit[k, i])
    success = success and most >= 3
    return (1 if success else 0), over, success


@kernel
def judge_sum_to_three(k, targets, outcome):
    """Touches the object ball in a shot in which the two balls have exactly three cushion contacts: 1 point.

    This is the game of pooltool and of LightZero's zoo/pooltool (Niu et al. 2023). Contacts before and after the hit
    count. Never decided: the episode continues, with or without a point.
    """
    total = outcome.cushions[k, CUE_BALL] + outcome.cushions[k, 1]
    success = outcome.cushions_before_hit[k, 1] >= 0 and total == 3
    return (1 if success else 0), False, success


@kernel
def judge_place(k, targets, outcome):
    """Touches an object ball and brings the cue ball to rest within `PLACE_RADIUS` of the goal: 1 point.

    Any object ball counts, and it may be potted. If no object ball is on the table, the cue ball does not have to touch
    one. Decided if the shot scores the point or the cue ball is potted.
    """
    touched, left = False, False
    for i in range(len(targets)):
        if targets[i] and not outcome.potted_before[k, i]:
            left = True
            touched = touched or outcome.cushions_before_hit[k, i] >= 0
    dx = outcome.positions[k, 0, X] - outcome.goals[k, 0, X]
    dy = outcome.positions[k, 0, Y] - outcome.goals[k, 0, Y]
    near = dx * dx + dy * dy <= PLACE_RADIUS * PLACE_RADIUS
    success = near and (touched or not left) and not outcome.potted[k, CUE_BALL]
    return (1 if success else 0), success or outcome.potted[k, CUE_BALL], success
