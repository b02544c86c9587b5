"""What goes into an engine and what comes out: balls, counters and, of a recorded shot, events and trajectories."""

from __future__ import annotations

from billiards_env.physics.jit import kernel
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
STATUS = ("rest", "max_time", "event_limit")
AT_REST, AT_MAX_TIME, AT_EVENT_LIMIT = 0, 1, 2

# Kinds of events.
KINDS = ("ball_ball", "cushion", "pocket", "roll", "stop", "spin_stop")
BALL_BALL, CUSHION_HIT, POCKETED, ROLLS, STOPS, SPIN_STOPS = 0, 1, 2, 3, 4, 5

# Entries of `counts`, a shot's counters.
N_EVENTS, ENDED, FIRST_HIT, N_CONTACT_RULE = 0, 1, 2, 3
N_COUNTS = 4
# Columns of `hits`, a ball's counters.
CUSHIONS, CUSHIONS_BEFORE_HIT = 0, 1

# Columns of the event log; those of the trajectory log are ball, phase and a row of `state`.
EVENT_WIDTH = 9  # time (hi, lo), kind, ball, other, x, y, speed, rule
SEGMENT_WIDTH = WIDTH + 2


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


@kernel
def load(positions, velocities, spins, in_play, radius, params, state, phase):
    """Fills `state` and `phase` for time 0 from (n, 2) positions and velocities, (n, 3) spins and (n,) in_play."""
    slips = params[MOTION] == SLIDING_AND_ROLLING
    for i in range(len(phase)):
        s = state[i]
        s[:] = 0.0
        s[X], s[Y] = positions[i, 0], positions[i, 1]
        if not in_play[i]:
            phase[i] = POTTED
            continue
        phase[i] = REST
        s[VX], s[VY] = velocities[i, 0], velocities[i, 1]
        if slips:
            s[UX] = s[VX] - radius[i] * spins[i, 1]
            s[UY] = s[VY] + radius[i] * spins[i, 0]
            s[WZ] = spins[i, 2]


@kernel
def store(positions, velocities, spins, in_play, radius, params, state, phase):
    """The reverse of `load`, at the shot's end."""
    slips = params[MOTION] == SLIDING_AND_ROLLING
    for i in range(len(phase)):
        s = state[i]
        positions[i, 0], positions[i, 1] = s[X], s[Y]
        velocities[i, 0], velocities[i, 1] = s[VX], s[VY]
        in_play[i] = phase[i] != POTTED
        if slips:
            spins[i, 0], spins[i, 1] = (s[UY] - s[VY]) / radius[i], (s[VX] - s[UX]) / radius[i]
            spins[i, 2] = s[WZ]
