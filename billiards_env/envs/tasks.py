"""What a shot is worth: one function a task, all with the same signature.

Each takes what one shot did, arrays with the balls as their last axis, or what many shots did, with any leading axes
more; the result has the leading axes. A task knows neither the limit on shots nor what a scratch costs.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray


class Outcome(NamedTuple):
    """What a shot brought; each field is of the leading shape (...), a scalar for a single shot.

    Attributes:
        points: int, the points it scored.
        over: bool, whether the episode is decided.
        success: bool, whether the task was achieved.
    """

    points: NDArray[np.integer[Any]] | np.integer[Any]
    over: NDArray[np.bool_] | np.bool_
    success: NDArray[np.bool_] | np.bool_


def pot(
    targets: NDArray[np.bool_],
    potted_before: NDArray[np.bool_],
    potted: NDArray[np.bool_],
    cushions_before_hit: NDArray[np.integer[Any]],
) -> Outcome:
    """Pot the object balls: a point each.

    Decided when all of them are potted or the cue ball is (a scratch); achieved when they are and it is not.

    Args:
        targets: (n,) the balls to pot.
        potted_before: (..., n) balls off the table before the shot.
        potted: (..., n) balls off the table after it.
        cushions_before_hit: (..., n) not used.

    Returns:
        Points, over and success, (...) each.

    Example:
        >>> targets, before = np.array([False, True, True]), np.array([False, True, False])
        >>> outcome = pot(targets, before, np.array([False, True, True]), np.array([-1, -1, 0]))
        >>> int(outcome.points), bool(outcome.over), bool(outcome.success)
        (1, True, True)
    """
    points = (potted & ~potted_before & targets).sum(-1)
    cleared = (potted | ~targets).all(-1)
    scratch = potted[..., 0]
    return Outcome(points, cleared | scratch, cleared & ~scratch)


def carom(
    targets: NDArray[np.bool_],
    potted_before: NDArray[np.bool_],
    potted: NDArray[np.bool_],
    cushions_before_hit: NDArray[np.integer[Any]],
) -> Outcome:
    """Touch every object ball with the cue ball in one shot: a point.

    A shot scores nothing if it pots the cue ball. On a table with pockets any potted ball decides the episode, as it
    can no longer be touched; otherwise play goes on, whether the shot scored or not.

    Args:
        targets: (n,) the balls to touch.
        potted_before: (..., n) not used.
        potted: (..., n) balls off the table after the shot.
        cushions_before_hit: (..., n) cushion contacts the cue ball had made when it first touched each ball, -1 if it
            did not.

    Returns:
        Points, over and success, (...) each.

    Example:
        >>> targets, potted = np.array([False, True, True]), np.zeros(3, bool)
        >>> int(carom(targets, potted, potted, np.array([-1, 0, 3])).points)
        1
        >>> int(carom(targets, potted, potted, np.array([-1, 0, -1])).points)
        0
    """
    success = ((cushions_before_hit >= 0) | ~targets).all(-1) & ~potted[..., 0]
    return Outcome(success.astype(np.int64), potted.any(-1), success)


Task = Callable[
    [NDArray[np.bool_], NDArray[np.bool_], NDArray[np.bool_], NDArray[np.integer[Any]]],
    Outcome,
]

TASKS: dict[str, Task] = {"pot": pot, "carom": carom}
