"""What a shot is worth: one kernel a task, all with the same signature.

    targets: (n,) bool, the balls that the task is about.
    potted_before: (n,) bool, the balls off the table before the shot.
    potted: (n,) bool, the balls off the table after it.
    cushions_before_hit: (n,) int32, cushion contacts the cue ball had made when it first touched each ball, -1 if it
        did not.

Each returns the shot's points, whether the episode is decided and whether the task was achieved. A task knows neither
the limit on shots nor what a scratch costs.
"""

from __future__ import annotations

from billiards_env.physics.jit import kernel

TASKS = ("pot", "carom")
POT, CAROM = 0, 1


@kernel
def pot(targets, potted_before, potted, cushions_before_hit):
    """Pot the object balls: a point each.

    Decided when all of them are potted or the cue ball is (a scratch); achieved when they are and it is not.

    Example:
        >>> import numpy as np
        >>> targets, before = np.array([False, True, True]), np.array([False, True, False])
        >>> pot(targets, before, np.array([False, True, True]), np.array([-1, -1, 0]))
        (1, True, True)
    """
    points, cleared = 0, True
    for i in range(len(targets)):
        if targets[i]:
            if not potted[i]:
                cleared = False
            elif not potted_before[i]:
                points += 1
    scratch = potted[0]
    return points, cleared or scratch, cleared and not scratch


@kernel
def carom(targets, potted_before, potted, cushions_before_hit):
    """Touch every object ball with the cue ball in one shot: a point.

    A shot scores nothing if it pots the cue ball. On a table with pockets any potted ball decides the episode, as it
    can no longer be touched; otherwise play goes on, whether the shot scored or not.

    Example:
        >>> import numpy as np
        >>> targets, potted = np.array([False, True, True]), np.zeros(3, np.bool_)
        >>> carom(targets, potted, potted, np.array([-1, 0, 3]))
        (1, False, True)
        >>> carom(targets, potted, potted, np.array([-1, 0, -1]))
        (0, False, False)
    """
    success, over = not potted[0], False
    for i in range(len(targets)):
        if targets[i] and cushions_before_hit[i] < 0:
            success = False
        if potted[i]:
            over = True
    return (1 if success else 0), over, success


@kernel
def judge(task, targets, potted_before, potted, cushions_before_hit):
    """What a shot is worth in the task of that number."""
    if task == POT:
        return pot(targets, potted_before, potted, cushions_before_hit)
    return carom(targets, potted_before, potted, cushions_before_hit)
