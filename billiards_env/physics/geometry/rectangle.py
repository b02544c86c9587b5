"""The cushions of a rectangle: its sides 0 to 3, which are -x, +x, -y, +y. See `walls.Walls`."""

from __future__ import annotations

import math

import numpy as np

from billiards_env.jit import inlined, kernel
from billiards_env.physics.geometry.walls import Outline, Walls, exit_time
from billiards_env.physics.motion import path_of
from billiards_env.physics.state import X, Y
from billiards_env.scene import CONTACT_GAP


def rectangle_arrays(half_length: float, half_width: float, n_pockets: int) -> Outline:
    """Returns the `Outline` of a rectangle, with half its sides, m."""
    x, y = half_length, half_width
    rows = [(side * x, 0.0, 0.0, 1.0, side, 0.0, math.inf) for side in (-1.0, 1.0)]
    rows += [(0.0, side * y, 1.0, 0.0, 0.0, side, math.inf) for side in (-1.0, 1.0)]
    return Outline(
        np.array(rows),
        np.empty((0, 7)),
        np.array([x, y]),
        np.empty((0, 4)),
        np.full((n_pockets, 2), -1, np.int64),
        np.array([(-x, y), (-x, -y), (-x, -y), (x, -y), (x, -y), (x, y), (x, y), (-x, y)]),
    )


@inlined
def time(path, radius, end, scene):
    """Implements `Walls.time`."""
    return exit_time(path, scene.numbers.half_length - radius, scene.numbers.half_width - radius, end)


@inlined
def normal(x, y, wall, scene):
    """Implements `Walls.normal`."""
    sign = 1.0 if wall % 2 else -1.0
    return (sign, 0.0) if wall < 2 else (0.0, sign)


@inlined
def met(state, i, wall, scene):
    """Implements `Walls.met`."""
    past_x = abs(state.rows[i, X]) - (scene.numbers.half_length - scene.radius[i])
    past_y = abs(state.rows[i, Y]) - (scene.numbers.half_width - scene.radius[i])
    if min(past_x, past_y) < -CONTACT_GAP:
        return wall, -1
    return _met_in_corner(path_of(state, i), wall)


@kernel
def _met_in_corner(path, wall):
    """Implements `met` for a ball that touches two sides."""
    x, y, vx, vy, ax, ay = path
    dx, dy = (vx if vx != 0.0 else ax), (vy if vy != 0.0 else ay)
    if dx == 0.0 or dy == 0.0 or x * dx < 0.0 or y * dy < 0.0:
        return wall, -1
    across, along = (1 if dx > 0.0 else 0), (3 if dy > 0.0 else 2)
    if (vx == 0.0) == (vy == 0.0):
        return across, along
    return (across if vy == 0.0 else along), -1


@inlined
def overlap(x, y, radius, wall, scene):
    """Implements `Walls.overlap`."""
    sign = 1.0 if wall % 2 else -1.0
    if wall < 2:
        return sign * x - (scene.numbers.half_length - radius), sign, 0.0
    return sign * y - (scene.numbers.half_width - radius), 0.0, sign


@inlined
def next_overlap(x, y, vx, vy, radius, turn, scene):
    """Implements `Walls.next_overlap`: each call tests one side, and the last two calls the sides across x again."""
    wall = turn % 4
    return wall if overlap(x, y, radius, wall, scene)[0] > 0.0 else -1


@inlined
def deepest_overlap(x, y, radius, scene):
    """Implements `Walls.deepest_overlap`."""
    deepest, cushion = CONTACT_GAP, -1
    for wall in range(4):
        beyond, _, _ = overlap(x, y, radius, wall, scene)
        if beyond > deepest:
            deepest, cushion = beyond, wall
    return cushion


@inlined
def back_to(x, y, radius, wall, scene):
    """Implements `Walls.back_to`."""
    sign = 1.0 if wall % 2 else -1.0
    if wall < 2:
        return sign * (scene.numbers.half_length - radius), y
    return x, sign * (scene.numbers.half_width - radius)


RECTANGLE = Walls(time, normal, met, overlap, next_overlap, deepest_overlap, back_to)
