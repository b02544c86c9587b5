"""A queue without optimisations for the event loop of `engine.pic`: it solves and compares all predictions.

Tests compare the engine with it bit for bit. The kernels of the queue have the arguments and results of those in
`engine.all_pairs`.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from billiards_env.engine import all_pairs
from billiards_env.engine.log import BALL_CUSHION, BALL_POCKET, MOTION_ENDS, phase_end
from billiards_env.engine.pic_events import add_contact
from billiards_env.engine.predictions import (
    PAIR_RANK,
    NextEvent,
    Singles,
    empty_singles,
    rank_of,
    single_time,
)
from billiards_env.jit import allocating, kernel
from billiards_env.physics.elementary import norm
from billiards_env.physics.geometry.contact import IMPULSE_ROUNDING, circle_time, line_time
from billiards_env.physics.geometry.outline_walls import OUTLINE, any_wall_time
from billiards_env.physics.geometry.pockets import path_to
from billiards_env.physics.motion import Path, motion_after, path_of
from billiards_env.physics.state import (
    AIRBORNE,
    AX,
    AY,
    LASTS,
    POTTED,
    REST,
    ROLLING,
    SceneKernels,
    Time,
    before,
    later,
    moves,
    own_time,
    same,
    since,
)

SOON, most_contacts, empty_scratch = all_pairs.SOON, all_pairs.most_contacts, all_pairs.empty_scratch


class Queue(NamedTuple):
    """The predictions for n balls.

    Attributes:
        singles: The `Singles`.
        hi: (n, n) float64, time of the next meeting of balls i < j, s.
        lo: (n, n) float64, its second part.
    """

    singles: Singles
    hi: Any
    lo: Any


@allocating
def empty_queue(scene):
    """Returns the `Queue` for the balls of a scene."""
    n = len(scene.radius)
    return Queue(empty_singles(n), np.full((n, n), math.inf), np.zeros((n, n)))


@kernel
def clear(state, scene, queue):
    """Prepares the queue for a new shot."""
    queue.hi[:] = math.inf


@kernel
def _rectangle_time(path, radius, end, scene):
    """Implements `Walls.time` for a rectangle by a test of all sides."""
    first, wall = math.inf, -1
    for k in range(4):
        sign = 1.0 if k % 2 else -1.0
        if k < 2:
            t = line_time(scene.numbers.half_length - radius - sign * path.x, sign * path.vx, sign * path.ax, end)
        else:
            t = line_time(scene.numbers.half_width - radius - sign * path.y, sign * path.vy, sign * path.ay, end)
        if t < first:
            first, wall = t, k
    return first, wall


@kernel
def _outline_time(path, radius, end, scene):
    """Implements `Walls.time` for an outline by a test of all cushions."""
    return any_wall_time(path, radius, end, scene.outline)


@kernel
def _predict_single(i, state, scene, singles):
    """Predicts the next event of ball i alone."""
    singles.hi[i], singles.lo[i] = math.inf, 0.0
    phase = state.phase[i]
    if phase in (REST, POTTED):
        return
    s = state.rows[i]
    end = s[LASTS]
    kind, other = phase_end(phase), -1
    if phase == AIRBORNE:
        end, kind, other = scene.space.event_alone(i, state, scene)
    elif phase >= ROLLING:
        path = path_of(state, i)
        t, wall = scene.walls.time(path, scene.radius[i], end, scene)
        if t < math.inf:
            end, kind, other = t, BALL_CUSHION, wall
        for k in range(len(scene.pockets)):
            t = circle_time(*path_to(path, scene.pockets[k]), end, 0.0)
            if t < end or (t == end and kind != BALL_POCKET and t < math.inf):
                end, kind, other = t, BALL_POCKET, k
    if end < math.inf:
        time = later(own_time(state, i), end)
        singles.hi[i], singles.lo[i] = time.hi, time.lo
        singles.kind[i], singles.other[i] = kind, other


@kernel
def _predict_pair(i, j, now, state, scene, singles):
    """Predicts the next meeting of balls i < j, of which one moves."""
    for k in (i, j):
        if singles.hi[k] <= now.hi and singles.kind[k] in MOTION_ENDS:
            return Time(math.inf, 0.0)
    end = min(singles.hi[i], singles.hi[j]) - now.hi
    xi, yi, vxi, vyi = motion_after(state, i, since(now, own_time(state, i)))
    xj, yj, vxj, vyj = motion_after(state, j, since(now, own_time(state, j)))
    rows = state.rows
    ax, ay = rows[j, AX] - rows[i, AX], rows[j, AY] - rows[i, AY]
    noise = IMPULSE_ROUNDING * (norm(vxi, vyi) + norm(vxj, vyj))
    path = Path(xj - xi, yj - yi, vxj - vxi, vyj - vyi, ax, ay)
    t = scene.space.meeting_time(i, j, now, path, end, noise, state, scene)
    return later(now, t) if t < math.inf else Time(math.inf, 0.0)


@kernel
def predict(changed, count, now, state, scene, queue):
    """Predicts what happens next to the first `count` balls of `changed`."""
    n = len(scene.radius)
    for c in range(count):
        _predict_single(changed[c], state, scene, queue.singles)
    for c in range(count):
        for j in range(n):
            a, b = min(changed[c], j), max(changed[c], j)
            if a == b:
                continue
            time = Time(math.inf, 0.0)
            in_play = state.phase[a] != POTTED and state.phase[b] != POTTED
            if in_play and (moves(state, a) or moves(state, b)):
                time = _predict_pair(a, b, now, state, scene, queue.singles)
            queue.hi[a, b], queue.lo[a, b] = time.hi, time.lo
    return 1


@kernel
def earliest(state, scene, queue, limit):
    """Returns the next `NextEvent`."""
    n = len(scene.radius)
    time, rank = Time(math.inf, 0.0), PAIR_RANK
    for i in range(n):
        for j in range(i + 1, n):
            if before(Time(queue.hi[i, j], queue.lo[i, j]), time):
                time = Time(queue.hi[i, j], queue.lo[i, j])
    for i in range(n):
        single, r = single_time(queue.singles, i), rank_of(queue.singles.kind[i])
        if single.hi < math.inf and (before(single, time) or (same(single, time) and r < rank)):
            time, rank = single, r
    return NextEvent(time, rank, 0, n - 1)


@kernel
def due(event, queue, balls):
    """Finds the balls that an event of single balls concerns. Returns their number."""
    count = 0
    for i in range(len(queue.hi)):
        if same(single_time(queue.singles, i), event.time) and rank_of(queue.singles.kind[i]) == event.rank:
            balls[count] = i
            count += 1
    return count


@kernel
def gather(now, state, scene, queue, contacts):
    """Finds the contacts of the impacts at a `Time`. Returns their number."""
    count, n = 0, len(queue.hi)
    for i in range(n):
        for j in range(i + 1, n):
            meeting = Time(queue.hi[i, j], queue.lo[i, j])
            if meeting.hi - now.hi <= SOON and add_contact(i, j, meeting, now, state, scene, contacts, count):
                count += 1
    return count


def with_plain_walls(kernels: SceneKernels) -> SceneKernels:
    """Returns the kernels of a scene with the plain times of cushions."""
    time = _outline_time if kernels.walls is OUTLINE else _rectangle_time
    return kernels._replace(walls=kernels.walls._replace(time=time))
