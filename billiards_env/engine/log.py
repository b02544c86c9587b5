"""What goes into an engine and what comes out: balls, counters and, of a recorded shot, events and trajectories."""

from __future__ import annotations

import itertools
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_env.physics.jit import inlined, kernel
from billiards_env.physics.state import (
    MOTION,
    POTTED,
    REST,
    SLIDING_AND_ROLLING,
    UX,
    UY,
    VX,
    VY,
    WIDTH,
    WZ,
    X,
    Y,
)

# How a shot ended.
STATUS = ("rest", "max_time", "event_limit", "step_limit")
AT_REST, AT_MAX_TIME, AT_EVENT_LIMIT, AT_STEP_LIMIT = 0, 1, 2, 3

INTERRUPTED = -1.0
"""s. What an engine returns for the time of a shot that `physics.interrupt` ended; it has no outcome then."""

LOOK_AFTER = 20_000
"""The event-driven engines call `interrupted` after this number of events: some ten milliseconds."""

# Kinds of events.
KINDS = ("ball_ball", "cushion", "pocket", "sliding_rolling", "rolling_rest", "spinning_rest")
BALL_BALL, BALL_CUSHION, BALL_POCKET, SLIDING_ROLLING, ROLLING_REST, SPINNING_REST = 0, 1, 2, 3, 4, 5

# Entries of `counts`, a shot's counters.
N_EVENTS, ENDED, FIRST_HIT, N_CONTACT_RULE = 0, 1, 2, 3
N_COUNTS = 4
# Columns of `hits`, a ball's counters.
CUSHIONS, CUSHIONS_BEFORE_HIT = 0, 1

# Columns of the event log; those of the trajectory log are ball, phase and a row of `state`.
EVENT_WIDTH = 9  # time (hi, lo), kind, ball, other, x, y, speed, rule
SEGMENT_WIDTH = WIDTH + 2


Floats = NDArray[np.float64]


class SceneArrays(NamedTuple):
    """A scene of n balls as the kernels take it.

    Attributes:
        params: (N_PARAMS,) float64, see `physics.state`.
        radius: (n,) float64, m.
        inv_mass: (n,) float64, 1/kg; 0 for a ball that nothing moves.
        pockets: (k, 3) float64: x, y, radius, m.
    """

    params: Floats
    radius: Floats
    inv_mass: Floats
    pockets: Floats


class Shots(NamedTuple):
    """m shots of n balls as an engine works on them, in place: before a shot, what it starts from; then, its outcome.

    Attributes:
        positions: (m, n, 2) float64, m.
        velocities: (m, n, 2) float64, m/s.
        spins: (m, n, 3) float64, rad/s.
        in_play: (m, n) bool: balls that are not in a pocket.
        times: (m,) float64 out: duration, s.
        hits: (m, n, 2) int32 out: columns `CUSHIONS` and `CUSHIONS_BEFORE_HIT`.
        counts: (m, N_COUNTS) int64 out: columns `N_EVENTS`, `ENDED`, `FIRST_HIT` and `N_CONTACT_RULE`.
    """

    positions: Floats
    velocities: Floats
    spins: Floats
    in_play: NDArray[np.bool_]
    times: Floats
    hits: NDArray[np.int32]
    counts: NDArray[np.int64]


def empty_shots(m: int, n: int) -> Shots:
    """Arrays for m shots of n balls, in which anything may stand."""
    shapes = (
        ((m, n, 2), np.float64),
        ((m, n, 2), np.float64),
        ((m, n, 3), np.float64),
        ((m, n), np.bool_),
        ((m,), np.float64),
        ((m, n, 2), np.int32),
        ((m, N_COUNTS), np.int64),
    )
    sizes = [-(-math.prod(shape) * np.dtype(kind).itemsize // 8) * 8 for shape, kind in shapes]
    # One piece of memory: the system hands out a large one several times faster than its parts one by one, which are
    # too small for NumPy to ask for huge pages, and which the C library gives back to the system after each batch.
    memory = np.empty(sum(sizes), np.uint8)
    starts = itertools.accumulate(sizes[:-1], initial=0)
    return Shots(*(np.ndarray(shape, kind, memory, at) for (shape, kind), at in zip(shapes, starts, strict=True)))


class Log(NamedTuple):
    """What a shot is recorded in; nothing is where there are no rows.

    Attributes:
        events: (rows, EVENT_WIDTH) float64 out.
        segments: (rows, SEGMENT_WIDTH) float64 out, the pieces of the trajectories.
        used: (2,) int64 out: rows of events and segments in use, or that would be, were there more.
    """

    events: Floats
    segments: Floats
    used: NDArray[np.int64]


def empty_log(n_events: int = 0, n_segments: int = 0) -> Log:
    """A log with room for so much."""
    return Log(np.empty((n_events, EVENT_WIDTH)), np.empty((n_segments, SEGMENT_WIDTH)), np.zeros(2, np.int64))


NO_LOG = tuple(empty_log())
"""For shots that are not recorded. Nothing is written to it, so that all threads may have it."""


@kernel
def clear_log(events, used):
    """Empties a log. One that records nothing is not written to: the logs of two threads may share a line of cache."""
    if len(events) > 0:
        used[0] = used[1] = 0


@kernel
def log_event(events, used, hi, lo, kind, ball, other, state, speed, rule):
    """Appends an event at (hi, lo) at ball's place.

    `speed` is that at which the two approached, m/s, and `rule` says whether the contact-time rule acted.
    `events` has length 0 where nothing is recorded; `used` counts on beyond a log that is full.
    """
    if len(events) == 0:
        return
    k = used[0]
    used[0] += 1
    if k < len(events):
        e = events[k]
        e[0], e[1], e[2], e[3], e[4] = hi, lo, kind, ball, other
        e[5], e[6], e[7], e[8] = state[ball, X], state[ball, Y], speed, rule


@kernel
def log_segment(segments, used, state, phase, ball):
    """Appends the piece of ball's trajectory that starts with its row of `state`."""
    if len(segments) == 0:
        return
    k = used[1]
    used[1] += 1
    if k < len(segments):
        segments[k, 0], segments[k, 1] = ball, phase[ball]
        for c in range(WIDTH):
            segments[k, 2 + c] = state[ball, c]


@inlined
def load(shots, k, scene, state, phase):
    """Fills `state` and `phase` for time 0 of shot k."""
    slips = scene.params[MOTION] == SLIDING_AND_ROLLING
    for i in range(len(phase)):
        s = state[i]
        s[:] = 0.0
        s[X], s[Y] = shots.positions[k, i, 0], shots.positions[k, i, 1]
        if not shots.in_play[k, i]:
            phase[i] = POTTED
            continue
        phase[i] = REST
        s[VX], s[VY] = shots.velocities[k, i, 0], shots.velocities[k, i, 1]
        if slips:
            s[UX] = s[VX] - scene.radius[i] * shots.spins[k, i, 1]
            s[UY] = s[VY] + scene.radius[i] * shots.spins[k, i, 0]
            s[WZ] = shots.spins[k, i, 2]


@inlined
def store(shots, k, scene, state, phase):
    """The reverse of `load`, at the shot's end."""
    slips = scene.params[MOTION] == SLIDING_AND_ROLLING
    for i in range(len(phase)):
        s = state[i]
        shots.positions[k, i, 0], shots.positions[k, i, 1] = s[X], s[Y]
        shots.velocities[k, i, 0], shots.velocities[k, i, 1] = s[VX], s[VY]
        shots.in_play[k, i] = phase[i] != POTTED
        if slips:
            shots.spins[k, i, 0] = (s[UY] - s[VY]) / scene.radius[i]
            shots.spins[k, i, 1] = (s[VX] - s[UX]) / scene.radius[i]
            shots.spins[k, i, 2] = s[WZ]
