"""The path of a ball that meets no other ball: its cushions, and the pockets near it."""

from __future__ import annotations

import math
from typing import NamedTuple

from billiards_env.jit import inlined, kernel
from billiards_env.physics.ball_cushion import reflect, reflect_both
from billiards_env.physics.geometry.pockets import bounding_circle
from billiards_env.physics.motion import advance, begin_phase, end_phase, motion_after, path_of
from billiards_env.physics.state import AX, AY, LASTS, REST, SLIDING, VX, VY, X, Y, later, moves, own_time
from billiards_env.pots.rims import segment_gap

FAR = 0.2
"""m. Gaps are at most this: larger ones are not measured."""

LEGS = 20
"""The largest number of legs of a path."""

_CHORDS = 4  # straight lines that approximate a leg of a sliding ball


class Leg(NamedTuple):
    """A part of a path, up to the end of the ball's phase (sliding or rolling) or to a cushion.

    Attributes:
        lasts: The duration, s; infinite if the ball does not move.
        wall: The number of the cushion at its end; -1 for none.
        chords: The number of straight lines that approximate it; 0 if the ball does not move.
    """

    lasts: float
    wall: int
    chords: int


@inlined
def begin_leg(scene, state, i):
    """Begins a phase of ball i, and returns its next `Leg`."""
    row, numbers = state.rows[i], scene.numbers
    begin_phase(state, i, numbers)
    if not moves(state, i):
        return Leg(math.inf, -1, 0)
    lasts, wall = row[LASTS], -1
    t, number = scene.walls.time(path_of(state, i), scene.radius[i], lasts, scene)
    if t < lasts:
        lasts, wall = t, number
    return Leg(lasts, wall, _CHORDS if state.phase[i] == SLIDING else 1)


@inlined
def _extremes(x, v, a, end):
    """Returns bounds of x + v t + a t^2 / 2 for t in [0, end]: the extremes of its Bezier control points."""
    half, last = x + 0.5 * end * v, x + end * (v + 0.5 * end * a)
    return min(x, half, last), max(x, half, last)


@kernel
def end_leg(scene, state, i, leg):
    """Advances ball i to the end of a leg, where its phase ends, or a cushion or two at one instant reflect it."""
    now = later(own_time(state, i), leg.lasts)
    if leg.wall < 0:
        end_phase(state, i, now, scene.numbers)
    else:
        advance(state, i, now, scene.numbers)
        one, two = scene.walls.met(state, i, leg.wall, scene)
        x, y = state.rows[i, X], state.rows[i, Y]
        nx, ny = scene.walls.normal(x, y, one, scene)
        if two < 0:
            reflect(state, i, nx, ny, 0.0, scene)
        else:
            reflect_both(state, i, (nx, ny), scene.walls.normal(x, y, two, scene), (0.0, 0.0), scene)


@kernel
def follow_path(scene, state, i, gaps):
    """Computes the path of ball i, and writes its least distances from a pocket's rim before its first cushions.

    Args:
        scene: The `SceneArrays`.
        state: The `State`, with the velocity, slip and spin of ball i.
        i: The ball.
        gaps: (c,) m, written; entry k is the least distance between cushions k - 1 and k, at most `FAR`. It is negative
            if the ball drops, and `FAR` after the ball has dropped or come to rest.
    """
    gaps[:] = FAR
    state.phase[i] = REST
    cushion = 0
    for _ in range(LEGS):
        leg = begin_leg(scene, state, i)
        if leg.chords == 0:
            return
        gaps[cushion] = _leg_gap(scene.pockets, state, i, leg, gaps[cushion])
        if gaps[cushion] < 0.0:
            return
        if leg.wall >= 0:
            cushion += 1
            if cushion == len(gaps):
                return
        end_leg(scene, state, i, leg)


@inlined
def _leg_gap(pockets, state, i, leg, gap):
    """Returns the least distance of a leg of ball i from a pocket's rim, m, at most `gap`."""
    row = state.rows[i]
    low_x, high_x = _extremes(row[X], row[VX], row[AX], leg.lasts)
    low_y, high_y = _extremes(row[Y], row[VY], row[AY], leg.lasts)
    for p in range(len(pockets)):
        x, y, radius = bounding_circle(pockets[p])
        near = gap + radius
        if low_x - near < x < high_x + near and low_y - near < y < high_y + near:
            ax, ay = row[X], row[Y]
            for k in range(1, leg.chords + 1):
                bx, by, _, _ = motion_after(state, i, leg.lasts * k / leg.chords)
                gap = min(gap, segment_gap(pockets[p], ax, ay, bx, by))
                ax, ay = bx, by
    return gap


@kernel
def pocket_gap(pockets, goal, ax, ay, bx, by):
    """Returns the least distance of the segment from (ax, ay) to (bx, by) from a pocket's rim, m, at most `FAR`.

    It is negative if the segment enters a pocket. The pocket `goal` is left out; -1 leaves out no pocket.
    """
    gap = FAR
    for p in range(len(pockets)):
        if p != goal:
            gap = min(gap, segment_gap(pockets[p], ax, ay, bx, by))
    return gap
