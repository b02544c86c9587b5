"""The hit of the cue ball on an object ball: the cue ball's path to it, and the motion of both balls after it.

Arguments of the functions: `table` is a `TableArrays`, `i` the object ball, `hit` a `Hit` on it, `speed` the initial
speed of the cue ball, m/s, and `state` a `State`, whose content changes.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_env.engine.predictions import meeting_bound
from billiards_env.jit import inlined, kernel
from billiards_env.physics.ball_ball import push_pair
from billiards_env.physics.elementary import norm
from billiards_env.physics.geometry.contact import IMPULSE_ROUNDING, circle_time, distance_to_segment
from billiards_env.physics.laws.balls import normal_impulse
from billiards_env.physics.laws.cloth import arrival, spin_after, travel_time
from billiards_env.physics.motion import Path, motion_after
from billiards_env.physics.state import AX, AY, REST, SLIDING_AND_ROLLING, T0, UX, UY, VX, VY, WZ, SceneArrays, X, Y
from billiards_env.pots.paths import FAR, LEGS, begin_leg, end_leg, pocket_gap

_THROW_STEPS = 4  # each reduces the error of the direction by a factor of about 10


class TableArrays(NamedTuple):
    """A table of `shots.tables.Tables`, as an argument of kernels.

    Attributes:
        scene: The scene.
        cue: The number of the cue ball.
        positions: (n, 2) m.
        in_play: (n,) bool, the balls on the table.
        targets: (n,) bool, those of them to pot.
        max_speed: Speed of the fastest shot, m/s.
        slip_ratio: Initial slip of the cue ball divided by its initial speed, see `physics.laws.cloth.launch`.
        spin_ratio: Its initial spin about the vertical axis, times its radius, divided by its initial speed.
    """

    scene: SceneArrays
    cue: int
    positions: NDArray[np.float64]
    in_play: NDArray[np.bool_]
    targets: NDArray[np.bool_]
    max_speed: float
    slip_ratio: float
    spin_ratio: float


class Hit(NamedTuple):
    """A hit of the cue ball on an object ball.

    Attributes:
        x, y: The cue ball's centre at the hit (the ghost ball), m.
        dx, dy: The direction of the cue ball.
        line_x, line_y: The direction of the object ball.
        approach: The distance of the cue ball from the hit, m.
    """

    x: float
    y: float
    dx: float
    dy: float
    line_x: float
    line_y: float
    approach: float


@kernel
def hit_at(table, i, x, y):
    """Returns the `Hit` on ball i with the cue ball's centre at (x, y)."""
    scene, positions = table.scene, table.positions
    reach = scene.space.contact_distance(table.cue, i, scene)
    line_x, line_y = (positions[i, X] - x) / reach, (positions[i, Y] - y) / reach
    to_x, to_y = x - positions[table.cue, X], y - positions[table.cue, Y]
    approach = norm(to_x, to_y)
    dx, dy = (to_x / approach, to_y / approach) if approach > 1e-9 else (line_x, line_y)
    return Hit(x, y, dx, dy, line_x, line_y, approach)


@inlined
def hit_along(table, i, line_x, line_y):
    """Returns the `Hit` whose line of centres has the direction (line_x, line_y)."""
    reach = table.scene.space.contact_distance(table.cue, i, table.scene)
    return hit_at(table, i, table.positions[i, X] - reach * line_x, table.positions[i, Y] - reach * line_y)


@inlined
def cut_cosine(hit):
    """Returns the cosine of the angle between the directions of the two balls."""
    return hit.dx * hit.line_x + hit.dy * hit.line_y


@inlined
def can_hit(table, hit, thinnest):
    """Returns whether the cut is not too thin and the cue ball at the hit is within the cushions."""
    room_x, room_y = room_of(table.scene, table.cue)
    return cut_cosine(hit) >= thinnest and abs(hit.x) <= room_x and abs(hit.y) <= room_y


@inlined
def enters_pocket(table, hit):
    """Returns whether the cue ball enters a pocket before the hit."""
    start_x, start_y = table.positions[table.cue, X], table.positions[table.cue, Y]
    return pocket_gap(table.scene.pockets, -1, start_x, start_y, hit.x, hit.y) < 0.0


@inlined
def play_hit(table, i, hit, speed, state):
    """Sets the motion of both balls after a hit, and returns whether the cue ball reaches ball i at this speed.

    The law is that of balls on the cloth. In scenes with flight a part of the impulse lifts one of two balls of
    different radii a and b, so the object ball is slower, by the factor 4 a b / (a + b)^2.
    """
    scene, numbers, cue = table.scene, table.scene.numbers, table.cue
    left, slip = arrival(numbers, hit.approach, speed, table.slip_ratio)
    closing = left * cut_cosine(hit)
    e = scene.laws.restitution(numbers, closing)
    impulse = normal_impulse(closing, scene.inv_mass[cue], scene.inv_mass[i], e)
    state.rows[cue] = 0.0
    state.rows[i] = 0.0
    row = state.rows[cue]
    row[X], row[Y], row[VX], row[VY] = hit.x, hit.y, left * hit.dx, left * hit.dy
    if numbers.motion == SLIDING_AND_ROLLING:
        row[UX], row[UY] = slip * hit.dx, slip * hit.dy
        if table.spin_ratio != 0.0:
            time = travel_time(numbers, hit.approach, speed, table.slip_ratio)
            row[WZ] = spin_after(table.spin_ratio * speed / scene.radius[cue], time, numbers)
    state.rows[i, X], state.rows[i, Y] = table.positions[i, X], table.positions[i, Y]
    push_pair(cue, i, (hit.line_x, hit.line_y), impulse, state, scene)
    return closing > 0.0


@inlined
def against_throw(friction, table, i, hit, speed, state):
    """Returns the `Hit` after which ball i moves in the direction in which it moves without friction after `hit`.

    `friction` is that of `Laws`.
    """
    if friction is None:
        return hit
    return _turned_against_throw(table, i, hit, speed, state)


@kernel
def _turned_against_throw(table, i, hit, speed, state):
    """Turns the line of centres of a hit by the throw, several times, until the throw is compensated."""
    want_x, want_y, row = hit.line_x, hit.line_y, state.rows[i]
    for _ in range(_THROW_STEPS):
        play_hit(table, i, hit, speed, state)
        size = norm(row[VX], row[VY])
        if size == 0.0:
            return hit
        cosine, sine = (row[VX] * want_x + row[VY] * want_y) / size, (row[VX] * want_y - row[VY] * want_x) / size
        line_x, line_y = cosine * hit.line_x - sine * hit.line_y, sine * hit.line_x + cosine * hit.line_y
        hit = hit_along(table, i, line_x, line_y)
    return hit


@inlined
def gain(table, i, hit):
    """Returns the speed of ball i after a fast hit divided by the speed of the cue ball before it."""
    scene, cosine = table.scene, cut_cosine(hit)
    share = scene.inv_mass[i] / (scene.inv_mass[table.cue] + scene.inv_mass[i])
    e = scene.laws.restitution(scene.numbers, table.max_speed * cosine)
    return share * (1.0 + e) * cosine


@inlined
def approach_gap(table, i, hit):
    """Returns the smallest gap between the cue ball and a third ball before the hit on ball i, m, at most `FAR`."""
    start_x, start_y = table.positions[table.cue, X], table.positions[table.cue, Y]
    return ball_gap(table, i, table.cue, start_x, start_y, hit.x, hit.y)


@kernel
def ball_gap(table, i, moving, ax, ay, bx, by):
    """Returns the smallest gap between a ball that moves from (ax, ay) to (bx, by) and a third ball, m, at most `FAR`.

    Ball i, the cue ball and the balls out of play are not third balls.
    """
    gap = FAR
    for j in range(len(table.positions)):
        if j != table.cue and j != i and table.in_play[j]:
            distance = distance_to_segment(ax, ay, bx, by, table.positions[j, X], table.positions[j, Y])
            gap = min(gap, distance - table.scene.space.contact_distance(moving, j, table.scene))
    return gap


@inlined
def room_of(scene, i):
    """Returns the largest coordinates that the centre of ball i can have, m."""
    return scene.numbers.half_length - scene.radius[i], scene.numbers.half_width - scene.radius[i]


@kernel
def meet_before(table, i, hit, speed, run, state):
    """Returns whether the cue ball and ball i meet again after their hit, before ball i has covered the distance `run`.

    If the cue ball is slower than ball i after the hit, no path is computed: the balls then hardly ever meet again.
    """
    numbers, inv_mass, along = table.scene.numbers, table.scene.inv_mass, cut_cosine(hit)
    gained = gain(table, i, hit)
    lost = gained * (inv_mass[table.cue] / inv_mass[i])
    if (along - lost) * (along - lost) + (1.0 - along * along) < gained * gained:
        return False
    left, _ = arrival(numbers, hit.approach, speed, table.slip_ratio)
    return meet_again(table, i, hit, speed, travel_time(numbers, run, gained * left, 1.0), state)


@kernel
def meet_again(table, i, hit, speed, end, state):
    """Returns whether the cue ball and ball i meet again within `end` seconds after their hit."""
    scene, cue, rows = table.scene, table.cue, state.rows
    play_hit(table, i, hit, speed, state)
    state.phase[cue] = state.phase[i] = REST
    leg, cue_leg, now = begin_leg(scene, state, i), begin_leg(scene, state, cue), 0.0
    reach = scene.space.contact_distance(i, cue, scene)
    for _ in range(2 * LEGS):
        leg_end, cue_end = rows[i, T0] + leg.lasts, rows[cue, T0] + cue_leg.lasts
        until = min(leg_end, cue_end, end)
        x, y, vx, vy = motion_after(state, i, now - rows[i, T0])
        cue_x, cue_y, cue_vx, cue_vy = motion_after(state, cue, now - rows[cue, T0])
        ax, ay = rows[i, AX] - rows[cue, AX], rows[i, AY] - rows[cue, AY]
        path = Path(x - cue_x, y - cue_y, vx - cue_vx, vy - cue_vy, ax, ay)
        if meeting_bound(path, reach, until - now) != math.inf:
            noise = IMPULSE_ROUNDING * (norm(vx, vy) + norm(cue_vx, cue_vy))
            if circle_time(path, reach, until - now, noise) < math.inf:
                return True
        if until == end:
            return False
        now = until
        if leg_end == until:
            end_leg(scene, state, i, leg)
            leg = begin_leg(scene, state, i)
        if cue_end == until:
            end_leg(scene, state, cue, cue_leg)
            cue_leg = begin_leg(scene, state, cue)
    return False
