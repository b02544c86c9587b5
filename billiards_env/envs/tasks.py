"""What a shot is worth: one kernel a task, all with the same signature.

    k: which of m shots.
    targets: (n,) bool, the balls that the task is about.
    goals: (m, g, 2) float64, m, the places that the task is about: one (g = 1) in "place", none in the others.
    potted_before: (m, n) bool, the balls off the table before the shot.
    potted: (m, n) bool, the balls off the table after it.
    cushions: (m, n) int32, cushion contacts of each ball.
    cushions_before_hit: (m, n) int32, cushion contacts the cue ball had made when it first touched each ball, -1 if it
        did not.
    positions: (m, n, 2) float64, m, where the balls are after the shot.

Each returns the shot's points, whether the episode is decided and whether the task was achieved. A task knows neither
the limit on shots nor what a scratch costs. (It is given all m shots and not views of one, as a view costs more than
the task does.)

A new task needs its kernel here, its name in `TASKS` and its line in `judge`; and in `envs/billiards.py` the layout
it opens with (`_OPENING`) and, in `task_targets`, which balls it is about and what it asks of a scene.
"""

from __future__ import annotations

from billiards_env.physics.jit import kernel

TASKS = ("pot", "carom", "three_cushion", "sum_to_three", "place")
POT, CAROM, THREE_CUSHION, SUM_TO_THREE, PLACE = range(len(TASKS))

PLACE_RADIUS = 0.15
"""m. How close to its goal the cue ball has to come to rest in the task "place"."""


@kernel
def judge(task, k, *shot):
    """What shot k is worth in the task of that number; `shot` is what all tasks take after k."""
    if task == POT:
        return pot(k, *shot)
    if task == CAROM:
        return carom(k, *shot)
    if task == THREE_CUSHION:
        return three_cushion(k, *shot)
    if task == SUM_TO_THREE:
        return sum_to_three(k, *shot)
    return place(k, *shot)


@kernel
def pot(k, targets, goals, potted_before, potted, cushions, cushions_before_hit, positions):
    """Pot the object balls: a point each.

    Decided when all of them are potted or the cue ball is (a scratch); achieved when they are and it is not.
    """
    points, cleared = 0, True
    for i in range(len(targets)):
        if targets[i]:
            if not potted[k, i]:
                cleared = False
            elif not potted_before[k, i]:
                points += 1
    scratch = potted[k, 0]
    return points, cleared or scratch, cleared and not scratch


@kernel
def carom(k, targets, goals, potted_before, potted, cushions, cushions_before_hit, positions):
    """Touch every object ball with the cue ball in one shot: a point.

    A shot scores nothing if it pots the cue ball. On a table with pockets any potted ball decides the episode, as it
    can no longer be touched; otherwise play goes on, whether the shot scored or not.
    """
    success, over = not potted[k, 0], False
    for i in range(len(targets)):
        if targets[i] and cushions_before_hit[k, i] < 0:
            success = False
        if potted[k, i]:
            over = True
    return (1 if success else 0), over, success


@kernel
def three_cushion(k, targets, goals, potted_before, potted, cushions, cushions_before_hit, positions):
    """Touch every object ball with the cue ball, the last of them after three cushion contacts or more: a point.

    For the rest as `carom`. The cue ball's cushion contacts count, not the cushions: one may be touched twice.
    """
    _, over, success = carom(k, targets, goals, potted_before, potted, cushions, cushions_before_hit, positions)
    most = 0
    for i in range(len(targets)):
        if targets[i]:
            most = max(most, cushions_before_hit[k, i])
    success = success and most >= 3
    return (1 if success else 0), over, success


@kernel
def sum_to_three(k, targets, goals, potted_before, potted, cushions, cushions_before_hit, positions):
    """Touch the object ball, and let both balls together make exactly three cushion contacts: a point.

    The game of pooltool and LightZero's zoo/pooltool (Niu et al. 2023). The contacts may come before the hit or after
    it. Never decided: play goes on, whether the shot scored or not.
    """
    total = cushions[k, 0] + cushions[k, 1]
    success = cushions_before_hit[k, 1] >= 0 and total == 3
    return (1 if success else 0), False, success


@kernel
def place(k, targets, goals, potted_before, potted, cushions, cushions_before_hit, positions):
    """Touch an object ball and bring the cue ball to rest within `PLACE_RADIUS` of the goal: a point.

    Which ball is touched, and what becomes of it, does not matter; where no object ball is left on the table, none has
    to be touched. Decided when the point is made or the cue ball is potted.
    """
    touched, left = False, False
    for i in range(len(targets)):
        if targets[i] and not potted_before[k, i]:
            left = True
            touched = touched or cushions_before_hit[k, i] >= 0
    dx, dy = positions[k, 0, 0] - goals[k, 0, 0], positions[k, 0, 1] - goals[k, 0, 1]
    near = dx * dx + dy * dy <= PLACE_RADIUS * PLACE_RADIUS
    success = near and (touched or not left) and not potted[k, 0]
    return (1 if success else 0), success or potted[k, 0], success
