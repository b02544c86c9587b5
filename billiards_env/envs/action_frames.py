"""Action frames: other ways than the velocity's components to say with two numbers from -1 to 1 what the cue does.

* "polar" (a0, a1): the direction in the table's frame, pi a0 from the x axis, and the speed.
* "cut" (a0, a1): where the cue ball meets an object ball, and the speed. a0 is the distance of that ball's centre from
  the line along which the cue ball sets out, in units of the distance of the two centres at contact; it is the sine of
  the cut angle. 0 is a full hit, +-1 grazes the ball, so that with nothing in between every |a0| < 1 hits.
* "sum_to_three" (a0, a1): speed V0 of the cue, 0.3 to 3 m/s, and cut angle, -70 to 70 degrees: the actions of the task
  of that name in LightZero (Niu et al. 2023; zoo/pooltool). The cue ball sets out at 1.395 V0.

A cut is positive where the cue ball is aimed clockwise of the line of centres, which sends the object ball to the left.

The kernels use `+ - * /` and `sqrt` only, as the engine does, so an action is the same shot on every machine, and
mirrored balls and cuts give mirrored velocities bit for bit.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from billiards_env.checks import Range, choose, real, whole
from billiards_env.physics.jit import entry_point, kernel
from billiards_env.physics.motion import norm
from billiards_env.scene import Scene

FRAMES = ("polar", "cut", "sum_to_three")
BALLS = ("nearest", "first")

SUM_TO_THREE_SPEEDS = (0.3, 3.0)
"""m/s. Least and largest speed of the cue in the frame "sum_to_three"."""

SUM_TO_THREE_CUT = 70.0
"""Degrees. Largest cut angle in the frame "sum_to_three"."""

SUM_TO_THREE_GAIN = 1.395
"""Speed of the cue ball over the speed of the cue in the frame "sum_to_three"."""

_POLAR, _CUT, _SUM_TO_THREE = range(len(FRAMES))
_NEAREST, _FIRST = -1, -2


class ActionTransform:
    """An action frame for the shots of one game.

    Args:
        name: One of `FRAMES`.
        scene: The scene.
        targets: (n,) bool: the balls that "nearest" and "first" choose from.
        max_speed: The fastest shot, m/s.
        ball: Which ball a shot is aimed at: the "nearest" to the cue ball of the targets still in play, the "first" of
            them in their order, or a ball by its number, and once that one is potted the first. "polar" has no use for
            it. If there is none, the shot goes along the x axis.
        least_speed: The slowest shot, m/s; "sum_to_three" has its own.

    Raises:
        ValueError: If a name is unknown, there is no such ball, or the speeds do not fit.
    """

    def __init__(
        self,
        name: str,
        scene: Scene,
        targets: NDArray[np.bool_],
        max_speed: float,
        ball: str | int = "nearest",
        least_speed: float = 0.4,
    ) -> None:
        choose("frame", name, FRAMES)
        if isinstance(ball, str):
            choose("ball", ball, BALLS)
        else:
            whole("ball", ball, Range(1, scene.n_balls - 1, ", 'nearest' or 'first'"))
        least_speed = real("least_speed", least_speed, Range(0.0, max_speed, "m/s, max_speed"))
        fastest = SUM_TO_THREE_GAIN * SUM_TO_THREE_SPEEDS[1]
        if name == "sum_to_three" and max_speed < fastest:
            raise ValueError(f"max_speed = {max_speed!r} with frame 'sum_to_three': expected at least {fastest} m/s")
        self._frame = FRAMES.index(name)
        self._ball = (_NEAREST, _FIRST)[BALLS.index(ball)] if isinstance(ball, str) else int(ball)
        self._targets = targets
        self._reach = scene.balls.radius[0] + np.array(scene.balls.radius)
        self._speeds = float(least_speed), float(max_speed)

    def velocities(
        self, actions: ArrayLike, positions: NDArray[np.float64], potted: NDArray[np.bool_]
    ) -> NDArray[np.float64]:
        """The velocities that actions stand for.

        Args:
            actions: (..., 2); what lies outside [-1, 1] is clipped.
            positions: (..., n, 2) where the balls are, m.
            potted: (..., n) bool, the balls off the table.

        Returns:
            (..., 2) velocities of the cue ball, m/s.

        Raises:
            ValueError: If an action is not two finite numbers.
        """
        given = np.asarray(actions, dtype=np.float64)
        if given.shape != (*potted.shape[:-1], 2):
            raise ValueError(f"action has shape {given.shape}: expected {(*potted.shape[:-1], 2)}")
        if not np.isfinite(given).all():
            raise ValueError(f"action = {given.tolist()}: expected finite numbers")
        out = np.empty(given.shape)
        n = potted.shape[-1]
        _velocities(
            self._frame,
            self._ball,
            self._targets,
            self._reach,
            *self._speeds,
            given.reshape(-1, 2),
            positions.reshape(-1, n, 2),
            potted.reshape(-1, n),
            out.reshape(-1, 2),
        )
        return out


def perturb(actions: ArrayLike, turns: ArrayLike, speeds: ArrayLike) -> NDArray[np.float64]:
    """Shots that go astray.

    Args:
        actions: (..., 2) what was aimed for: shares of the largest speed along x and y, of length 1 at most; longer
            ones are shortened.
        turns: (...,) by how much the direction is off, in half turns.
        speeds: (...,) by how much the speed is off, as a share of the largest. It stays between 0 and the largest; a
            shot of speed 0 is none and stays so.

    Returns:
        (..., 2) what comes of it, shares of the largest speed.

    Raises:
        ValueError: If the shapes do not agree.

    Example:
        >>> perturb([0.0, 0.5], 0.5, 0.25).tolist()
        [-0.75, 0.0]
    """
    given = np.asarray(actions, dtype=np.float64)
    errors = np.stack((np.asarray(turns, dtype=np.float64), np.asarray(speeds, dtype=np.float64)), axis=-1)
    if given.shape != errors.shape:
        raise ValueError(f"action has shape {given.shape}: expected {errors.shape}")
    out = np.empty(given.shape)
    _perturbed(given.reshape(-1, 2), errors.reshape(-1, 2), out.reshape(-1, 2))
    return out


@kernel
def cos_sin(turns):
    """Cosine and sine of `turns` half turns; odd and even to the last bit, and within 2e-16 of the true ones."""
    quarters = np.rint(2.0 * turns)
    x = math.pi * (turns - 0.5 * quarters)
    xx = x * x
    c = s = 0.0
    for k in range(9, 0, -1):  # the Taylor series for |x| <= pi / 4
        c = (1.0 + c) * (-xx / ((2 * k - 1) * (2 * k)))
        s = (1.0 + s) * (-xx / ((2 * k) * (2 * k + 1)))
    c, s = 1.0 + c, x + x * s
    quarter = int(quarters) & 3
    if quarter == 0:
        return c, s
    if quarter == 1:
        return -s, c
    if quarter == 2:
        return -c, -s
    return s, -c


@kernel
def aim(dx, dy, reach, offset):
    """The direction in which a ball's centre passes that of another at a distance of `offset` times `reach`.

    Args:
        dx: From the one ball to the other, m.
        dy: See dx.
        reach: Sum of their radii, m.
        offset: -1 to 1, positive for a path clockwise of the line of centres. It is the sine of the cut angle: the
            path is turned by d with D sin(d) = reach sin(c), the law of sines in the triangle of the two centres, D
            apart, and the place of the first one at contact.

    Returns:
        A unit vector; along the x axis if the two are in one place.
    """
    distance = norm(dx, dy)
    if distance == 0.0:
        return 1.0, 0.0
    x, y = dx / distance, dy / distance
    s = min(max(offset * (reach / distance), -1.0), 1.0)
    c = math.sqrt((1.0 - s) * (1.0 + s))
    return x * c + y * s, y * c - x * s


@kernel
def polar(a0, a1, least_speed, max_speed):
    """The velocity of an action in the frame "polar", m/s."""
    x, y = cos_sin(a0)
    speed = between(least_speed, max_speed, a1)
    return speed * x, speed * y


@kernel
def cut(a0, a1, dx, dy, reach, least_speed, max_speed):
    """The velocity of an action in the frame "cut", m/s; `dx`, `dy` and `reach` as in `aim`."""
    x, y = aim(dx, dy, reach, a0)
    speed = between(least_speed, max_speed, a1)
    return speed * x, speed * y


@kernel
def sum_to_three(a0, a1, dx, dy, reach):
    """The velocity of an action in the frame "sum_to_three", m/s; `dx`, `dy` and `reach` as in `aim`."""
    _, offset = cos_sin(a1 * (SUM_TO_THREE_CUT / 180.0))
    x, y = aim(dx, dy, reach, offset)
    speed = SUM_TO_THREE_GAIN * between(SUM_TO_THREE_SPEEDS[0], SUM_TO_THREE_SPEEDS[1], a0)
    return speed * x, speed * y


@kernel
def between(low, high, a):
    """From `low` at a = -1 to `high` at a = 1."""
    return low + (high - low) * (0.5 * (a + 1.0))


@kernel
def choose_ball(ball, targets, positions, potted):
    """The ball to aim at, see `ActionTransform`; the cue ball itself if there is none."""
    if ball > 0 and not potted[ball]:
        return ball
    best, shortest = 0, math.inf
    for i in range(1, len(targets)):
        if targets[i] and not potted[i]:
            if ball != _NEAREST:
                return i
            dx, dy = positions[i, 0] - positions[0, 0], positions[i, 1] - positions[0, 1]
            if dx * dx + dy * dy < shortest:
                best, shortest = i, dx * dx + dy * dy
    return best


@entry_point
def _velocities(frame, ball, targets, reach, least_speed, max_speed, actions, positions, potted, out):
    for k in range(len(actions)):
        a0, a1 = min(max(actions[k, 0], -1.0), 1.0), min(max(actions[k, 1], -1.0), 1.0)
        if frame == _POLAR:
            out[k, 0], out[k, 1] = polar(a0, a1, least_speed, max_speed)
            continue
        i = choose_ball(ball, targets, positions[k], potted[k])
        dx, dy = positions[k, i, 0] - positions[k, 0, 0], positions[k, i, 1] - positions[k, 0, 1]
        if frame == _CUT:
            out[k, 0], out[k, 1] = cut(a0, a1, dx, dy, reach[i], least_speed, max_speed)
        else:
            out[k, 0], out[k, 1] = sum_to_three(a0, a1, dx, dy, reach[i])


@entry_point
def _perturbed(actions, errors, out):
    for k in range(len(actions)):
        x, y = actions[k, 0], actions[k, 1]
        largest = max(abs(x), abs(y), 1.0)  # into the box first, so that the squares cannot overflow
        x, y = x / largest, y / largest
        share = math.sqrt(x * x + y * y)
        if share == 0.0:
            out[k, 0] = out[k, 1] = 0.0
            continue
        scale = min(max(min(share, 1.0) + errors[k, 1], 0.0), 1.0) / share
        c, s = cos_sin(errors[k, 0])
        out[k, 0], out[k, 1] = scale * (c * x - s * y), scale * (s * x + c * y)
