"""A recorded shot as plain arrays, the input of all drawing functions."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from billiards_env.drawing.orientation import ERROR, Turning, turning
from billiards_env.engine.trajectory import Trajectory
from billiards_env.physics.state import AIRBORNE, T0, VZ
from billiards_env.scene import Scene
from billiards_env.shots.result import ShotResult
from billiards_env.support.checks import numbers, short

Floats = NDArray[np.float64]

LEAST_HOP = 2e-3
"""m. Pictures do not show lower hops."""


class Recording(NamedTuple):
    """A recorded shot.

    Attributes:
        scene: The scene.
        time: Duration of the shot, s.
        label: The engine, such as "PIC".
        trajectory: The paths of the balls.
        events: Structured array, as in `ShotResult.events`.
        cue: The cue ball.
    """

    scene: Scene
    time: float
    label: str
    trajectory: Trajectory
    events: NDArray[Any]
    cue: int = 0

    @property
    def gone(self) -> Floats:
        """(n,) s, the time at which each ball went out of play; 0 if it was not in play, inf if it stayed."""
        return self.trajectory.potted_at

    def potted(self, time: float) -> NDArray[np.intp]:
        """Returns the balls that are in a pocket at a time, s."""
        off = self.events["ball"][self.events["kind"] == "off_table"]
        return np.setdiff1d(np.flatnonzero(self.gone <= time), off)

    def path(self, ball: int, times: ArrayLike) -> Floats:
        """Returns the positions of a ball at some times (s), (m, 2) m."""
        return self.trajectory.path(ball, times)

    def hops(self) -> list[tuple[int, float, float]]:
        """Returns the ball, the time, s, and the height, m, of the highest point of each flight."""
        paths, hops = self.trajectory, []
        for ball in range(self.scene.n_balls):
            pieces = np.flatnonzero(paths.ball == ball)
            ends = np.append(paths.start[pieces[1:]], self.time)
            for piece, end in zip(pieces, ends, strict=True):
                if paths.phase[piece] == AIRBORNE and end > paths.start[piece]:
                    start, speed = paths.rows[piece, [T0, VZ]].tolist()
                    top = min(start + max(speed, 0.0) / self.scene.physics.g, float(end))
                    hops.append((ball, top, float(self.heights(ball, [top])[0])))
        return hops

    def heights(self, ball: int, times: ArrayLike) -> Floats:
        """Returns the heights (m,), m, of a ball above the cloth at times (m,), s; just before an event there."""
        return self.trajectory.heights(ball, np.nextafter(numbers("times", times), 0.0), self.scene.physics.g)

    def flies(self, ball: int, times: ArrayLike) -> NDArray[np.bool_]:
        """Returns whether a ball is higher than `LEAST_HOP` at times (m,), s; just before an event there."""
        if not self.scene.physics.flight:
            return np.zeros(np.shape(times), np.bool_)
        return self.heights(ball, times) > LEAST_HOP

    def speeds(self, ball: int, times: ArrayLike) -> Floats:
        """Returns the speeds of a ball at some times (s), (m,) m/s; at a contact the speed after it."""
        return np.hypot(*self.trajectory.velocities(ball, numbers("times", times)).T)

    def spins(self, ball: int, times: ArrayLike) -> Floats:
        """Returns the angular velocities of a ball at some times (s), (m, 3) rad/s; at a contact those after it."""
        radius, decay = self.scene.balls.radius[ball], self.scene.physics.spin_decay
        return self.trajectory.spins(ball, numbers("times", times), radius, decay)

    def turning(self, faces: ArrayLike | None = None, error: float = ERROR) -> Turning:
        """Returns the rotation of the balls; the arguments are as in `drawing.orientation.turning`."""
        return turning(self.scene, self.trajectory, self.time, faces, error)

    def corners(self, ball: int) -> Floats:
        """Returns the times at which a ball's path may have a corner, s, ascending."""
        return np.unique(self.trajectory.start[self.trajectory.ball == ball])

    def track(self, ball: int, times: ArrayLike) -> tuple[Floats, Floats]:
        """Returns a ball's path for drawing, up to its end.

        Args:
            ball: The ball.
            times: (k,) s.

        Returns:
            (m,) s, the times before the end of the ball's path, with those of its corners, and this end; and (m, 2) m,
            the positions. The path of a potted ball ends where it is captured, not at the centre of the pocket.
        """
        end = min(self.time, float(self.gone[ball]))
        times = np.union1d(np.asarray(times, np.float64), self.corners(ball))
        times = np.append(times[times < end], end)
        return times, self.trajectory.path(ball, times, before=True)

    def moves(self, ball: int) -> bool:
        """Returns whether a ball is in play and moves during the shot."""
        paths = self.trajectory
        pieces = paths.ball == ball
        return bool(self.gone[ball] > 0 and ((paths.velocity[pieces] != 0) & (paths.duration[pieces, None] > 0)).any())


def recording_of(shot: ShotResult, method: str = "recording") -> Recording:
    """Returns a shot as the `Recording` that all drawing functions use; `method` is the caller for the message.

    Raises:
        ValueError: If the shot was not recorded.
    """
    scene, paths, events = shot._recorded(method)
    return Recording(scene, shot.time, shot.engine, paths, events, shot.cue)


def recordings_of(shot: ShotResult, compare: ShotResult | None, method: str) -> tuple[Recording, Recording | None]:
    """Returns a shot and another run of it, if there is one, as recordings; the arguments are as in `recording_of`.

    Raises:
        TypeError: If `compare` is no shot.
        ValueError: If a shot was not recorded.
    """
    if not (compare is None or isinstance(compare, ShotResult)):
        raise TypeError(f"compare = {short(compare)}: expected a ShotResult or None")
    return recording_of(shot, method), None if compare is None else recording_of(compare, method)


def check_pair(recording: Recording, other: Recording) -> None:
    """Raises a ValueError unless two recordings have the same balls and the same table."""
    one, two = recording.scene, other.scene
    if one.balls != two.balls or one.table != two.table:
        raise ValueError("compare: expected a shot with the same balls on the same table")


def frame_times(duration: float, fps: float) -> Floats:
    """Returns the times of a film's frames, s: the multiples of 1 / fps, and the end of the shot.

    Example:
        >>> frame_times(0.1, 30).round(4).tolist(), len(frame_times(0.0, 30)), len(frame_times(2.0, 30))
        ([0.0, 0.0333, 0.0667, 0.1], 1, 61)
    """
    # The tolerance avoids an extra frame if the duration is a whole number of frames up to rounding.
    last = int(np.ceil(duration * fps - 1e-6))
    return np.append(np.arange(last) / fps, duration)
