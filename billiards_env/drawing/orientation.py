"""The orientation of the balls during a recorded shot, as quaternions.

The angular velocity of a ball is linear in time between two events: w(t) = w0 + b t. Its orientation q satisfies
dq/dt = w q / 2. `turning` splits the motion into steps of the sixth-order Magnus method (Blanes, Casas, Oteo and Ros
2009, The Magnus expansion and some of its applications, section 5). A step is exact if w keeps its direction: for a
ball that rolls straight, and for a spin about the vertical axis. Otherwise the number of steps follows from an estimate
of the error.

A quaternion is (cos(angle / 2), sin(angle / 2) axis). A ball that is not turned shows its number upwards.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from billiards_env.engine.trajectory import Trajectory
from billiards_env.physics.laws.cloth import SLIP_RATE
from billiards_env.physics.state import AIRBORNE, AX, AY, LASTS, POTTED, SLIDING, UX, UY, VX, VY, WZ
from billiards_env.scene import Scene

Floats = NDArray[np.float64]

ERROR = 1e-9
"""rad. The largest error of an orientation on each piece of a trajectory."""

VISIBLE = 1e-3
"""rad. An error that is invisible in a picture: a tenth of a pixel on a ball of 200 pixels."""

_LONGEST = 2.0  # rad. The Magnus series converges for turns of less than pi.
_STEP_ERROR = 1e-4  # the largest coefficient of the seventh-order terms of a step, with a margin


class Turning(NamedTuple):
    """The rotation of n balls as k steps, sorted by ball and time.

    Attributes:
        first: (n + 1,) int, the first step of each ball, then k.
        start: (k,) time at which each step begins, s.
        lasts: (k,) its duration, s; the ball does not turn between its end and the next step.
        spin: (k, 3) angular velocity at its beginning, rad/s.
        change: (k, 3) angular acceleration, rad/s^2.
        face: (k, 4) orientation at its beginning.
    """

    first: NDArray[np.intp]
    start: Floats
    lasts: Floats
    spin: Floats
    change: Floats
    face: Floats

    def at(self, t: float) -> Floats:
        """Returns the orientations of all balls at time t (s), (n, 4)."""
        bounds = zip(self.first[:-1].tolist(), self.first[1:].tolist(), strict=True)
        steps = [a + max(0, int(np.searchsorted(self.start[a:b], t, "right")) - 1) for a, b in bounds]
        return self._faces(np.array(steps), np.full(len(steps), t))

    def faces(self, ball: int, times: ArrayLike) -> Floats:
        """Returns the orientations of a ball at some times (s), (m, 4)."""
        at = np.asarray(times, np.float64)
        return self._faces(self._steps(ball, at), at)

    def _steps(self, ball: int, times: Floats) -> NDArray[np.intp]:
        begin, end = self.first[ball : ball + 2]
        return begin + np.maximum(np.searchsorted(self.start[begin:end], times, "right") - 1, 0)

    def _faces(self, steps: NDArray[np.intp], times: Floats) -> Floats:
        since = np.clip(times - self.start[steps], 0.0, self.lasts[steps])
        return product(rotations(self.spin[steps], self.change[steps], since), self.face[steps])


def turning(
    scene: Scene, paths: Trajectory, time: float, faces: ArrayLike | None = None, error: float = ERROR
) -> Turning:
    """Returns the rotation of the balls in a shot.

    Args:
        scene: The scene.
        paths: The paths of its n balls.
        time: The duration of the shot, s.
        faces: (n, 4) orientations at the start; None for balls that are not turned.
        error: The largest error allowed on each piece of a path, rad.
    """
    n = scene.n_balls
    order = np.argsort(paths.ball, kind="stable")
    ball, phase, rows, start = paths.ball[order], paths.phase[order], paths.rows[order], paths.start[order]
    ends = np.append(start[1:], 0.0)
    ends[np.append(ball[1:] != ball[:-1], True)] = time
    radius = np.array(scene.balls.radius)[ball]
    moves, slides, flies = paths.moving[order], phase == SLIDING, phase == AIRBORNE
    lasts = np.where((phase > 0) & (phase != POTTED), np.clip(ends - start, 0.0, rows[:, LASTS]), 0.0)
    velocity, slip = np.where(moves, rows[:, [VX, VY]].T, 0.0), np.where(slides | flies, rows[:, [UX, UY]].T, 0.0)
    roll, decay = (velocity - slip) / radius, np.where(flies, 0.0, scene.physics.spin_decay)
    acceleration = np.where(moves, rows[:, [AX, AY]].T, 0.0) * np.where(slides, 1.0 - SLIP_RATE, 1.0) / radius
    spin = np.column_stack((-roll[1], roll[0], rows[:, WZ]))
    change = np.column_stack((-acceleration[1], acceleration[0], -decay * np.sign(rows[:, WZ])))

    # A piece has a second part if the spin about the vertical axis ends within it.
    upright = np.where(flies, lasts, np.minimum(abs(rows[:, WZ]) / scene.physics.spin_decay, lasts))
    later = spin + upright[:, None] * change
    later[:, 2] = np.where(upright < lasts, 0.0, later[:, 2])
    parts = np.stack((start, upright, *spin.T, *change.T)), np.stack((start + upright, lasts - upright, *later.T))
    second = np.vstack((parts[1], change[:, 0], change[:, 1], np.zeros(len(ball))))
    both = np.stack((parts[0], second), -1).reshape(8, -1)
    keep = (both[1] > 0.0) | (np.arange(both.shape[1]) % 2 == 0)
    both, ball = both[:, keep], np.repeat(ball, 2)[keep]

    counts = _counts(both[1], both[2:5].T, both[5:8].T, error)
    begins = np.cumsum(counts) - counts
    index = np.repeat(np.arange(len(counts)), counts)
    start, lasts, spin, change = both[0, index], (both[1] / counts)[index], both[2:5, index].T, both[5:8, index].T
    since = (np.arange(len(index)) - begins[index]) * lasts
    start, spin = start + since, spin + since[:, None] * change
    first = np.searchsorted(ball[index], np.arange(n + 1))
    turns = rotations(spin, change, lasts)
    quaternions = np.tile([1.0, 0.0, 0.0, 0.0], (n, 1)) if faces is None else np.asarray(faces, np.float64)
    chain = []
    for k in range(n):
        w, x, y, z = quaternions[k].tolist()
        for a, b, c, d in turns[first[k] : first[k + 1]].tolist():
            chain.append((w, x, y, z))
            w, x, y, z = (
                a * w - b * x - c * y - d * z,
                a * x + b * w + c * z - d * y,
                a * y - b * z + c * w + d * x,
                a * z + b * y - c * x + d * w,
            )
    return Turning(first, start, lasts, spin, change, np.array(chain))


def _counts(lasts: Floats, spin: Floats, change: Floats, error: float) -> NDArray[np.intp]:
    """Returns the number of steps of each part of a motion."""
    fastest = np.maximum(_length(spin), _length(spin + lasts[:, None] * change))
    turns, bend = _length(np.cross(spin, change)), _length(change)
    # The axis of a straight motion keeps its direction up to rounding.
    turns = np.where(turns > 1e-12 * _length(spin) * bend, turns, 0.0)
    steps = lasts * (_STEP_ERROR * lasts * turns * (fastest**2 + bend) ** 2 / error) ** (1 / 6)
    steps = np.where(turns > 0.0, np.maximum(steps, fastest * lasts / _LONGEST), 1.0)
    return np.maximum(np.ceil(steps), 1.0).astype(np.intp)


def rotations(spin: Floats, change: Floats, lasts: Floats) -> Floats:
    """Returns the rotations (m, 4) of balls during `lasts` (m,) s.

    `spin` are the (m, 3) angular velocities at the beginning, rad/s, and `change` the accelerations, rad/s^2.
    """
    t = lasts[:, None]
    first, second = t * (spin + 0.5 * t * change), t * t * change
    both = np.cross(first, second)
    vector = first + np.cross(both - 20.0 * first, second - np.cross(first, both) / 60.0) / 240.0
    angle = _length(vector)
    half_sine = 0.5 * np.sinc(angle / (2.0 * np.pi))
    return np.column_stack((np.cos(0.5 * angle), half_sine[:, None] * vector))


def product(a: Floats, b: Floats) -> Floats:
    """Returns the products a b of quaternions (m, 4): the rotation b, then a."""
    real = a[:, 0] * b[:, 0] - (a[:, 1:] * b[:, 1:]).sum(1)
    return np.column_stack((real, a[:, :1] * b[:, 1:] + b[:, :1] * a[:, 1:] + np.cross(a[:, 1:], b[:, 1:])))


def matrices(faces: Floats) -> Floats:
    """Returns the rotation matrices (m, 3, 3) of quaternions (m, 4)."""
    w, x, y, z = np.asarray(faces).T
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    return np.moveaxis(np.array(rows), -1, 0)


def _length(vectors: Floats) -> Floats:
    return np.sqrt((vectors * vectors).sum(-1))
