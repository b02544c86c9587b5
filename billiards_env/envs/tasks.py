"""The tasks: one kernel for each task computes the points of a shot.

Each kernel has the arguments

    k: index of the shot, from 0 to m - 1.
    targets: (n,) bool, the balls of the task.
    outcome: `Outcome` of the m shots. Views of the arrays of one shot would take longer than the kernel itself.

and returns the points of the shot, whether the episode is decided, and whether the task is achieved. The kernels of the
run-outs, "nine_ball" and "eight_ball", also write the balls that are on in the next shot to `outcome.on`. The limit on
shots and the penalty for a scratch are not part of a task.

A new task needs a kernel, a name in `TASKS`, a line in `judge`, an opening layout in `OPENING_LAYOUTS`, and a check in
`task_targets` of the scenes in which it can be played.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_env.checks import choose
from billiards_env.jit import inlined, kernel
from billiards_env.physics.state import CUE_BALL, X, Y
from billiards_env.scene import Scene

TASKS = (
    "pot",
    "carom",
    "three_cushion",
    "sum_to_three",
    "place",
    "position",
    "clear",
    "nine_ball",
    "eight_ball",
)
POT, CAROM, THREE_CUSHION, SUM_TO_THREE, PLACE, POSITION, CLEAR, NINE_BALL, EIGHT_BALL = range(len(TASKS))

RUN_OUTS = {"nine_ball": 9, "eight_ball": 15}
"""The run-outs, in which the cue ball may touch only some balls first, and their numbers of object balls."""

OPENING_LAYOUTS = {
    "pot": "rack",
    "carom": "carom_opening",
    "three_cushion": "carom_opening",
    "sum_to_three": "line",
    "place": "random",
    "position": "random",
    "clear": "rack",
    "nine_ball": "nine_ball",
    "eight_ball": "eight_ball",
}
"""The layout of each task with `layout=None`."""

BREAKS = ("rack", "tight_rack", "nine_ball", "eight_ball")
"""The layouts that begin with a break."""

GOAL_RADIUS = {"place": 0.15, "position": 0.3}
"""m. Largest distance from the goal at which the cue ball may come to rest, for each task with a goal."""
_PLACE_RADIUS, _POSITION_RADIUS = GOAL_RADIUS.values()


class Outcome(NamedTuple):
    """The outcome of m shots.

    Attributes:
        positions: (m, n, 2) float64, m, positions of the balls after the shot.
        goals: (m, g, 2) float64, m: one goal (g = 1) in the tasks of `GOAL_RADIUS`, none in the others.
        potted_before: (m, n) bool, the balls off the table before the shot.
        potted: (m, n) bool, the balls off the table after it.
        cushions: (m, n) int32, number of cushion contacts of each ball.
        cushions_before_hit: (m, n) int32, number of cushion contacts that the cue ball had when it first touched each
            ball, -1 if it did not touch it.
        first_hit: (m,) int64, the first ball that the cue ball touched, -1 if none.
        on: (m, n) bool in the run-outs, None in the others: the balls that the cue ball may touch first in the next
            shot.
    """

    positions: Any
    goals: Any
    potted_before: Any
    potted: Any
    cushions: Any
    cushions_before_hit: Any
    first_hit: Any
    on: Any


def task_targets(task: str, scene: Scene) -> NDArray[np.bool_]:
    """Returns the balls that count in a task: the object balls. Tasks with pockets count only those of finite mass.

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
    if task in RUN_OUTS and targets.sum() != RUN_OUTS[task]:
        raise ValueError(f"task = {task!r} with {targets.sum()} object balls: expected {RUN_OUTS[task]}")
    if task in ("pot", "position", "clear", *RUN_OUTS):
        if not scene.table.pockets:
            raise ValueError(
                f"task = {task!r} with a scene without pockets: expected a table with pockets, or task 'carom'"
            )
        targets &= np.isfinite(scene.balls.mass)
        if not targets.any():
            raise ValueError(f"task = {task!r} with object balls of infinite mass only: expected one of finite mass")
    return targets


@inlined
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
    if task == PLACE:
        return judge_place(k, targets, outcome)
    if task == POSITION:
        return judge_position(k, targets, outcome)
    if task == CLEAR:
        return judge_clear(k, targets, outcome)
    return judge_run_out(outcome.on, task, k, targets, outcome)


@kernel
def judge_run_out(on, task, k, targets, outcome):
    """Returns the result of shot k of a run-out; `on` is `Outcome.on`. Numba compiles it only for run-outs."""
    if on is None:
        return 0, False, False
    if task == NINE_BALL:
        return judge_nine_ball(k, targets, outcome)
    return judge_eight_ball(k, targets, outcome)


@kernel
def judge_pot(k, targets, outcome):
    """Pots the object balls: 1 point for each.

    The episode is decided if all object balls are potted or the cue ball is potted (a scratch). The task is
    achieved if all object balls are potted and the cue ball is not.
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

    A shot that pots the cue ball scores 0 points. The episode is decided if any ball is potted, because a potted ball
    cannot be touched again. Otherwise the episode continues, with or without a point.
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
    """Touches an object ball and brings the cue ball to rest near the goal: 1 point.

    Any object ball counts, and it may be potted. If no object ball is on the table, the cue ball does not have to touch
    one. The episode is decided if the shot scores the point or the cue ball is potted.
    """
    touched, left = False, False
    for i in range(len(targets)):
        if targets[i] and not outcome.potted_before[k, i]:
            left = True
            touched = touched or outcome.cushions_before_hit[k, i] >= 0
    success = is_near_goal(k, _PLACE_RADIUS, outcome) and (touched or not left)
    return (1 if success else 0), success or outcome.potted[k, CUE_BALL], success


@kernel
def judge_position(k, targets, outcome):
    """Pots an object ball and brings the cue ball to rest near the goal, in one shot: 1 point.

    The episode is decided if the shot scores the point, the cue ball is potted, or no object ball is left.
    """
    points, cleared, _ = judge_pot(k, targets, outcome)
    success = points > 0 and is_near_goal(k, _POSITION_RADIUS, outcome)
    return (1 if success else 0), success or cleared, success


@kernel
def is_near_goal(k, radius, outcome):
    """Returns whether the cue ball of shot k is on the table, at most `radius` from the goal."""
    dx = outcome.positions[k, CUE_BALL, X] - outcome.goals[k, 0, X]
    dy = outcome.positions[k, CUE_BALL, Y] - outcome.goals[k, 0, Y]
    return dx * dx + dy * dy <= radius * radius and not outcome.potted[k, CUE_BALL]


@kernel
def judge_clear(k, targets, outcome):
    """Pots the last object ball, but not the cue ball: 1 point.

    The episode is decided if all object balls are potted or the cue ball is potted.
    """
    _, decided, success = judge_pot(k, targets, outcome)
    return (1 if success else 0), decided, success


@kernel
def is_legal(k, outcome):
    """Returns whether shot k of a run-out has no foul (WPA 2016, rules 6.1 to 6.3).

    The cue ball must first touch a ball that is on, a ball must then touch a cushion or be potted, and the cue ball
    must not be potted.
    """
    first = outcome.first_hit[k]
    if first < 0 or not outcome.on[k, first] or outcome.potted[k, CUE_BALL]:
        return False
    driven = outcome.cushions[k, CUE_BALL] > outcome.cushions_before_hit[k, first]
    for i in range(1, outcome.on.shape[1]):
        if outcome.cushions[k, i] > 0 or (outcome.potted[k, i] and not outcome.potted_before[k, i]):
            driven = True
    return driven


@kernel
def judge_nine_ball(k, targets, outcome):
    """Pots balls in shots that first touch the lowest ball on the table: 1 point for each.

    A shot that pots the nine ball also scores the balls that are left, so a run-out scores 9 points. The episode is
    decided by a foul, by a shot that pots no ball, or when the nine ball is potted. The task is achieved if the nine
    ball is potted without a foul.
    """
    points, left, lowest = 0, 0, 0
    for i in range(1, 10):
        if not outcome.potted[k, i]:
            left += 1
            lowest = i if lowest == 0 else lowest
        elif not outcome.potted_before[k, i]:
            points += 1
    legal, success = is_legal(k, outcome), outcome.potted[k, 9]
    for i in range(1, 10):
        outcome.on[k, i] = i == lowest
    if not legal:
        return 0, True, False
    return (points + left if success else points), success or points == 0, success


@kernel
def judge_eight_ball(k, targets, outcome):
    """Pots the balls of one group, 1 to 7 or 9 to 15, and then the eight ball: 1 point for each.

    All balls are on in the break. Then both groups are on until a shot pots a ball of a group. That shot chooses the
    group: that of the ball that the cue ball touched first, or the other one if no ball of the first was potted. The
    episode is decided by a foul, by a shot that pots no ball of the group, or when the eight ball is potted. The task
    is achieved if the eight ball is potted without a foul when it is on, and not in the break.
    """
    on, first = outcome.on, outcome.first_hit[k]
    is_break = on[k, 8] and on[k, 1]  # later the eight ball is on only if no other ball is
    legal, won = is_legal(k, outcome), outcome.potted[k, 8] and on[k, 8] and not is_break
    solids, stripes, solids_on, stripes_on = 0, 0, False, False
    for i in range(1, 16):
        if i != 8:
            solids_on, stripes_on = solids_on or (i < 8 and on[k, i]), stripes_on or (i > 8 and on[k, i])
            if outcome.potted[k, i] and not outcome.potted_before[k, i]:
                solids, stripes = solids + (1 if i < 8 else 0), stripes + (1 if i > 8 else 0)
    points = (solids if solids_on else 0) + (stripes if stripes_on else 0)
    if solids_on and stripes_on and not is_break and points > 0:  # the group is chosen
        solids_on = solids > 0 and (first < 8 or stripes == 0)
        stripes_on = not solids_on
        points = solids if solids_on else stripes
    left = False
    for i in range(1, 16):
        on[k, i] = i != 8 and not outcome.potted[k, i] and (solids_on if i < 8 else stripes_on)
        left = left or on[k, i]
    on[k, 8] = not left
    if not legal:
        return 0, True, False
    return points + (1 if won else 0), points == 0 or outcome.potted[k, 8], won


@kernel
def begin_on(on, task, k, is_break):
    """Writes the balls that are on in the first shot of episode k of a run-out."""
    if on is None:
        return
    for i in range(1, on.shape[1]):
        on[k, i] = i == 1 if task == NINE_BALL else is_break or i != 8
