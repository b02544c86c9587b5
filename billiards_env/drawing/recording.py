"""What is drawn: one recorded shot as plain arrays."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from billiards_env.scene import Scene

Floats = NDArray[np.float64]


class Recording(NamedTuple):
    """A shot's trajectories and events.

    Piece k is the path of ball `ball[k]` from `start[k]` on: its place is position + velocity t + acceleration t^2 / 2,
    t the time since, `lasts[k]` at most. The last piece that has begun is the one that counts; those of a ball stand in
    the order in which they begin.

    Attributes:
        scene: The scene.
        time: Duration of the shot, s.
        label: How the shot was run, such as "PIC".
        ball: (k,) int.
        start: (k,) s.
        lasts: (k,) s; 0 for a ball that does not move.
        position: (k, 2) m.
        velocity: (k, 2) m/s.
        acceleration: (k, 2) m/s^2.
        gone: (n,) s, when each ball was potted; 0 if it was not in play, inf if it stayed on the table.
        events: Structured array, as in `ShotResult.events`.
    """

    scene: Scene
    time: float
    label: str
    ball: NDArray[np.intp]
    start: Floats
    lasts: Floats
    position: Floats
    velocity: Floats
    acceleration: Floats
    gone: Floats
    events: NDArray[Any]

    def path(self, ball: int, times: ArrayLike) -> Floats:
        """Where a ball is at some times.

        Args:
            ball: Its number.
            times: (m,) s, from 0 to `time`.

        Returns:
            (m, 2) m.
        """
        mine = np.flatnonzero(self.ball == ball)
        at = np.asarray(times, dtype=np.float64)
        k = mine[np.searchsorted(self.start[mine], at, side="right") - 1]
        t = np.clip(at - self.start[k], 0.0, self.lasts[k])[:, None]
        return self.position[k] + t * (self.velocity[k] + 0.5 * t * self.acceleration[k])

    def corners(self, ball: int) -> Floats:
        """The instants at which a ball's path may turn, s, ascending."""
        return np.unique(self.start[self.ball == ball])

    def moves(self, ball: int) -> bool:
        """Whether a ball that is in play ever moves."""
        mine = self.ball == ball
        return bool(self.gone[ball] > 0 and ((self.velocity[mine] != 0) & (self.lasts[mine, None] > 0)).any())


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
