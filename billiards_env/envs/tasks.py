"""The tasks: the points of a shot, one kernel for each task.

Each kernel has the arguments

    k: the shot, one of m.
    targets: (n,) bool, the balls of the task.
    outcome: the `Outcome` of the m shots (not views of one shot, which would take longer than the kernel).

and returns the points of the shot, whether the episode is decided, and whether the task was achieved. The limit on
shots and the penalty of a scratch are not part of a task.

A new task needs a kernel here, its name in `TASKS` and its line in `judge`; and in `envs/billiards.py` its opening
layout (`_OPENING`) and, in `task_targets`, its balls and the scenes in which it can be played.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from billiards_env.physics.jit import kernel
from billiards_env.physics.state import X, Y

TASKS = ("pot", "carom", "three_cushion", "sum_to_three", "place")
POT, CAROM, THREE_CUSHION, SUM_TO_THREE, PLACE = range(len(TASKS))

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


@kernel
def judge(task, k, targets, outcome):
    """Returns the result of shot k in a task, an index into `TASKS`."""
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
    """Pot the object balls: a point each.

    Decided when all of them are potted or the cue ball is (a scratch). Achieved when all of them are and the cue ball
    is not.
    """
    points, cleared = 0, True
    for i in range(len(targets)):
        if targets[i]:
            if not outcome.potted[k, i]:
                cleared = False
            elif not outcome.potted_before[k, i]:
                points += 1
    scratch = outcome.potted[k, 0]
    return points, cleared or scratch, cleared and not scratch


@kernel
def judge_carom(k, targets, outcome):
    """Touch every object ball with the cue ball in one shot: a point.

    A shot that pots the cue ball scores nothing. On a table with pockets any potted ball decides the episode, because
    it cannot be touched any more. Otherwise the episode goes on, whether the shot scored or not.
    """
    success, over = not outcome.potted[k, 0], False
    for i in range(len(targets)):
        if targets[i] and outcome.cushions_before_hit[k, i] < 0:
            success = False
        if outcome.potted[k, i]:
            over = True
    return (1 if success else 0), over, success


@kernel
def judge_three_cushion(k, targets, outcome):
    """Touch every object ball with the cue ball, the last one after at least three cushion contacts: a point.

    All else is as in `judge_carom`. The number of contacts counts, not the number of cushions.
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
    """Touch the object ball such that both balls together have exactly three cushion contacts: a point.

    This is the game of pooltool and of LightZero's zoo/pooltool (Niu et al. 2023). The contacts may be before the hit
    or after it. The task is never decided: the episode goes on, whether the shot scored or not.
    """
    total = outcome.cushions[k, 0] + outcome.cushions[k, 1]
    success = outcome.cushions_before_hit[k, 1] >= 0 and total == 3
    return (1 if success else 0), False, success


@kernel
def judge_place(k, targets, outcome):
    """Touch an object ball and bring the cue ball to rest within `PLACE_RADIUS` of the goal: a point.

    Any object ball counts, wherever it goes. If no object ball is left on the table, none has to be touched. Decided
    when the point is made or the cue ball is potted.
    """
    touched, left = False, False
    for i in range(len(targets)):
        if targets[i] and not outcome.potted_before[k, i]:
            left = True
            touched = touched or outcome.cushions_before_hit[k, i] >= 0
    dx = outcome.positions[k, 0, X] - outcome.goals[k, 0, X]
    dy = outcome.positions[k, 0, Y] - outcome.goals[k, 0, Y]
    near = dx * dx + dy * dy <= PLACE_RADIUS * PLACE_RADIUS
    success = near and (touched or not left) and not outcome.potted[k, 0]
    return (1 if success else 0), success or outcome.potted[k, 0], success
