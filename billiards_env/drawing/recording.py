"""What is drawn: one recorded shot as plain arrays."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from billiards_env.scene import Scene
from billiards_env.trajectory import Trajectory

Floats = NDArray[np.float64]


class Recording(NamedTuple):
    """A recorded shot.

    Attributes:
        scene: The scene.
        time: Duration of the shot, s.
        label: The engine, such as "PIC".
        trajectory: The paths of the balls.
        events: Structured array, as in `ShotResult.events`.
    """

    scene: Scene
    time: float
    label: str
    trajectory: Trajectory
    events: NDArray[Any]

    @property
    def gone(self) -> Floats:
        """(n,) Time at which each ball was potted, s: 0 if it was not in play, infinite if it stayed on the table."""
        return self.trajectory.gone

    def path(self, ball: int, times: ArrayLike) -> Floats:
        """Returns the positions of a ball at some times (s), (m, 2) m."""
        return self.trajectory.path(ball, times)

    def corners(self, ball: int) -> Floats:
        """Returns the times at which a ball's path may turn, s, ascending."""
        return np.unique(self.trajectory.start[self.trajectory.ball == ball])

    def moves(self, ball: int) -> bool:
        """Returns whether a ball that is in play ever moves."""
        paths = self.trajectory
        mine = paths.ball == ball
        return bool(self.gone[ball] > 0 and ((paths.velocity[mine] != 0) & (paths.lasts[mine, None] > 0)).any())


def check_pair(recording: Recording, other: Recording) -> None:
    """Raises a ValueError unless two recordings are of the same balls on the same table."""
    one, two = recording.scene, other.scene
    if one.balls != two.balls or one.table != two.table:
        raise ValueError("compare: expected a shot of the same balls on the same table")


def frame_times(duration: float, fps: float) -> Floats:
    """The instants of a film's frames, s: a multiple of 1 / fps each but the last, which is the end.

    Example:
        >>> frame_times(0.1, 30).round(4).tolist(), len(frame_times(0.0, 30)), len(frame_times(2.0, 30))
        ([0.0, 0.0333, 0.0667, 0.1], 1, 61)
    """
    # A duration that is a whole number of frames but for rounding gets no frame more.
    last = int(np.ceil(duration * fps - 1e-6))
    return np.append(np.arange(last) / fps, duration)
