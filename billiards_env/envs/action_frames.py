"""Action frames: actions of two numbers (a0, a1) from -1 to 1 that are converted to the action "velocity".

Both aim at the nearest ball that may be touched first. If there is none, the line of centres is the x axis. The action
frames are:

* "cut": a0 is the distance from the centre of the target ball to the line along which the cue ball starts, divided by
  the distance of the two centres at contact. This is the sine of the cut angle: 0 is a full hit, +-1 only grazes the
  ball, and every abs(a0) < 1 hits it if no other ball is in the way. a1 is the speed.
* "sum_to_three": a0 is the speed V0 of the cue, 0.3 to 3 m/s. a1 is the cut angle, -70 to 70 degrees. The cue ball
  starts at 1.395 V0. These are the actions of the task of the same name in LightZero (Niu et al. 2023, zoo/pooltool).

A cut is positive if the cue ball is aimed clockwise of the line of centres. The object ball then moves to the left.

The kernels use only `+ - * /` and `sqrt`, as the engine does. IEEE 754 therefore defines the bits of the shot,
and mirrored balls and cuts have mirrored velocities bit for bit.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from billiards_env.jit import entry_point, kernel
from billiards_env.physics.elementary import cos_sin, norm
from billiards_env.physics.state import X, Y
from billiards_env.scene import Scene
from billiards_env.shots.tables import Tables
from billiards_env.support.checks import numbers, one_of, short

FRAMES = ("cut", "sum_to_three")

LEAST_SPEED = 0.4
"""m/s. Speed of the slowest shot of "cut"."""

SUM_TO_THREE_SPEEDS = (0.3, 3.0)
"""m/s. Smallest and largest speed of the cue in the frame "sum_to_three"."""

SUM_TO_THREE_CUT = 70.0
"""Degrees. Largest cut angle in the frame "sum_to_three"."""

SUM_TO_THREE_GAIN = 1.395
"""Speed of the cue ball divided by the speed of the cue in the frame "sum_to_three"."""

# Columns of actions in a frame.
A0, A1 = 0, 1


class ActionFrame:
    """Converts the actions of an action frame to the action "velocity".

    Args:
        name: One of `FRAMES`.
        scene: The scene.
        max_speed: Speed of the fastest shot, m/s.

    Raises:
        ValueError: If the frame is unknown, or `max_speed` is too small for it.
    """

    choices = 0

    def __init__(self, name: str, scene: Scene, max_speed: float) -> None:
        one_of("frame", name, FRAMES)
        fastest = SUM_TO_THREE_GAIN * SUM_TO_THREE_SPEEDS[1] if name == "sum_to_three" else LEAST_SPEED
        if max_speed < fastest:
            raise ValueError(f"max_speed = {short(max_speed)} with action {name!r}: expected at least {fastest} m/s")
        self._is_cut, self._reach = name == "cut", scene.balls.contact_distances(0)

    def strokes(self, actions: ArrayLike, tables: Tables) -> NDArray[np.float64]:
        """Returns the velocities (k, 2) of the cue balls, divided by the largest speed, for actions (k, 2).

        The actions are clipped to [-1, 1].
        """
        array = numbers("action", actions)
        out = np.empty(array.shape)
        fields = tables.positions, tables.targets, self._reach, float(tables.max_speed)
        _strokes(self._is_cut, array, fields, out)
        return out


@kernel
def passing_direction(dx, dy, reach, offset):
    """Returns the direction in which one ball passes another at a distance of `offset * reach` between the centres.

    Args:
        dx: x of the vector from the first ball to the second, m.
        dy: y of this vector, m.
        reach: Distance of the centres at contact, m.
        offset: -1 to 1, positive for a path clockwise of the line of centres. It is the sine of the cut angle c. The
            law of sines in the triangle of the two centres and the position of the first ball at contact gives the
            angle d between the path and the line of centres: D sin(d) = reach sin(c), where D is the distance.

    Returns:
        A unit vector, (1, 0) if the two centres coincide.
    """
    distance = norm(dx, dy)
    if distance == 0.0:
        return 1.0, 0.0
    x, y = dx / distance, dy / distance
    s = min(max(offset * reach / distance, -1.0), 1.0)
    c = math.sqrt((1.0 - s) * (1.0 + s))
    return x * c + y * s, y * c - x * s


@kernel
def cut(a0, a1, dx, dy, reach, max_speed):
    """Returns the stroke of an action in the frame "cut"; `dx`, `dy` and `reach` are as in `passing_direction`."""
    x, y = passing_direction(dx, dy, reach, a0)
    speed = between(LEAST_SPEED / max_speed, 1.0, a1)
    return speed * x, speed * y


@kernel
def sum_to_three(a0, a1, dx, dy, reach, max_speed):
    """Returns the stroke of an action in the frame "sum_to_three"; the arguments are as in `passing_direction`."""
    _, offset = cos_sin(a1 * (SUM_TO_THREE_CUT / 180.0))
    x, y = passing_direction(dx, dy, reach, offset)
    speed = SUM_TO_THREE_GAIN * between(SUM_TO_THREE_SPEEDS[0], SUM_TO_THREE_SPEEDS[1], a0) / max_speed
    return speed * x, speed * y


@kernel
def between(low, high, a):
    """Returns the linear interpolation from `low` at a = -1 to `high` at a = 1."""
    return low + (high - low) * (0.5 * (a + 1.0))


@kernel
def nearest_ball(positions, targets):
    """Returns the target nearest to the cue ball; 0 if there is none."""
    best, shortest = 0, math.inf
    for i in range(1, len(targets)):
        if targets[i]:
            dx, dy = positions[i, X] - positions[0, X], positions[i, Y] - positions[0, Y]
            if dx * dx + dy * dy < shortest:
                best, shortest = i, dx * dx + dy * dy
    return best


@entry_point
def _strokes(is_cut, actions, tables, out):
    positions, targets, reach, max_speed = tables
    for k in range(len(actions)):
        a0, a1 = min(max(actions[k, A0], -1.0), 1.0), min(max(actions[k, A1], -1.0), 1.0)
        i = nearest_ball(positions[k], targets[k])
        dx, dy = positions[k, i, X] - positions[k, 0, X], positions[k, i, Y] - positions[k, 0, Y]
        if is_cut:
            out[k, X], out[k, Y] = cut(a0, a1, dx, dy, reach[i], max_speed)
        else:
            out[k, X], out[k, Y] = sum_to_three(a0, a1, dx, dy, reach[i], max_speed)
