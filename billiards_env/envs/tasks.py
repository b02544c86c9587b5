"""What a shot is worth: one kernel a task, all with the same signature.

    k: which of m shots.
    targets: (n,) bool, the balls that the task is about.
    potted_before: (m, n) bool, the balls off the table before the shot.
    potted: (m, n) bool, the balls off the table after it.
    cushions_before_hit: (m, n) int32, cushion contacts the cue ball had made when it first touched each ball, -1 if it
        did not.

Each returns the shot's points, whether the episode is decided and whether the task was achieved. A task knows neither
the limit on shots nor what a scratch costs. (It is given all m shots and not views of one, as a view costs more than
the task does.)
"""

from __future__ import annotations

from billiards_env.physics.jit import kernel

TASKS = ("pot", "carom")
POT, CAROM = 0, 1


@kernel
def pot(k, targets, potted_before, potted, cushions_before_hit):
    """Pot the object balls: a point each.

    Decided when all of them are potted or the cue ball is (a scratch); achieved when they are and it is not.

    Example:
        >>> import numpy as np
        >>> targets, before = np.array([False, True, True]), np.array([[False, True, False]])
        >>> pot(0, targets, before, np.array([[False, True, True]]), np.array([[-1, -1, 0]]))
        (1, True, True)
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
def carom(k, targets, potted_before, potted, cushions_before_hit):
    """Touch every object ball with the cue ball in one shot: a point.

    A shot scores nothing if it pots the cue ball. On a table with pockets any potted ball decides the episode, as it
    can no longer be touched; otherwise play goes on, whether the shot scored or not.

    Example:
        >>> import numpy as np
        >>> targets, potted = np.array([False, True, True]), np.zeros((1, 3), np.bool_)
        >>> carom(0, targets, potted, potted, np.array([[-1, 0, 3]]))
        (1, False, True)
        >>> carom(0, targets, potted, potted, np.array([[-1, 0, -1]]))
        (0, False, False)
    """
    success, over = not potted[k, 0], False
    for i in range(len(targets)):
        if targets[i] and cushions_before_hit[k, i] < 0:
            success = False
        if potted[k, i]:
            over = True
    return (1 if success else 0), over, success


@kernel
def judge(task, k, targets, potted_before, potted, cushions_before_hit):
    """What shot k is worth in the task of that number."""
    if task == POT:
        return pot(k, targets, potted_before, potted, cushions_before_hit)
    return carom(k, targets, potted_before, potted, cushions_before_hit)
