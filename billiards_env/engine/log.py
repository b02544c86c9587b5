"""The log of one shot or of many: the events and the pieces of the balls' trajectories."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_env.jit import inlined, kernel
from billiards_env.physics.state import FLIGHT_WIDTH, ROLLING, SLIDING, VX, VY, WIDTH, X, Y

KINDS = ("ball_ball", "cushion", "pocket", "sliding_rolling", "rolling_rest", "spinning_rest", "rolling_slower")
KINDS += ("landing", "off_table")
"""Names of the kinds of events."""
BALL_BALL, BALL_CUSHION, BALL_POCKET, SLIDING_ROLLING, ROLLING_REST, SPINNING_REST, ROLLING_SLOWER = range(7)
LANDING, OFF_TABLE = 7, 8
MOTION_ENDS = (SLIDING_ROLLING, ROLLING_REST, LANDING)
"""The kinds of events at the end of a phase in which the centre of the ball moves."""

# Columns of `Log.events`.
TIME, TIME_LO, KIND, BALL, OTHER, EVENT_X, EVENT_Y, SPEED, RULE = 0, 1, 2, 3, 4, 5, 6, 7, 8
EVENT_WIDTH = 9

EVENT_DTYPE = np.dtype(
    [
        ("time", "f8"),
        ("kind", f"U{max(map(len, KINDS))}"),
        ("ball", "i4"),
        ("other", "i4"),
        ("x", "f8"),
        ("y", "f8"),
        ("speed", "f8"),
        ("rule", "?"),
    ]
)
_COLUMNS = {"time": TIME, "ball": BALL, "other": OTHER, "x": EVENT_X, "y": EVENT_Y, "speed": SPEED, "rule": RULE}

# Columns of `Log.segments`. From SEGMENT_ROW on they are those of `State.rows`.
SEGMENT_BALL, SEGMENT_PHASE, SEGMENT_ROW = 0, 1, 2

# Entries of `Log.used`; the first two are also the columns of `Log.begins`.
N_EVENTS_LOGGED, N_SEGMENTS_LOGGED, N_SHOTS_LOGGED = 0, 1, 2

Floats = NDArray[np.float64]


class Log(NamedTuple):
    """The events and trajectories of the last shot, or of many. Arrays without rows record nothing.

    Attributes:
        events: (rows, EVENT_WIDTH) float64 out.
        segments: (rows, SEGMENT_ROW + w) float64 out, the pieces of the trajectories; w is the width of `State.rows`.
        used: (3,) int64 out: number of events, of segments and of shots. If one of the first two exceeds the number of
            rows, the log is incomplete.
        begins: (shots, 2) int64 out: the first event and the first segment of each shot. Without rows, each shot
            replaces the one before.
    """

    events: Floats
    segments: Floats
    used: NDArray[np.int64]
    begins: NDArray[np.int64]


def empty_log(n_events: int = 0, n_segments: int = 0, n_shots: int = 0, flight: bool = False) -> Log:
    """Returns a log with room for a number of events, of segments and of shots."""
    width = SEGMENT_ROW + (FLIGHT_WIDTH if flight else WIDTH)
    events, segments = np.empty((n_events, EVENT_WIDTH)), np.empty((n_segments, width))
    return Log(events, segments, np.zeros(3, np.int64), np.zeros((n_shots, 2), np.int64))


def with_room(log: Log, n_events: int, n_segments: int) -> Log:
    """Returns a log with the same content, and room for a number of further events and segments."""
    events = _with_rows(log.events, log.used[N_EVENTS_LOGGED], n_events)
    segments = _with_rows(log.segments, log.used[N_SEGMENTS_LOGGED], n_segments)
    return Log(events, segments, log.used, log.begins)


def _with_rows(array: Floats, used: int, more: int) -> Floats:
    """Returns an array with the same `used` rows, and room for more."""
    if len(array) >= used + more:
        return array
    larger = np.empty((used + more, array.shape[1]))
    larger[:used] = array[:used]
    return larger


class ShotLog(NamedTuple):
    """The events and trajectories of m recorded shots, one after the other.

    `ShotResult.events`, `ShotResult.trajectory` and `billiards_env.derivatives` read it.

    Attributes:
        events: (e, EVENT_WIDTH) float64; the columns are `TIME` to `RULE` of this module.
        segments: (s, SEGMENT_ROW + w) float64, the pieces of the trajectories in the order in which they begin; w is
            the width of `State.rows`. The first n pieces of a shot of n balls begin with the shot.
        bounds: (m + 1, 2) int64: the first event and the first segment of each shot, then the numbers of both.
    """

    events: Floats
    segments: Floats
    bounds: NDArray[np.int64]

    @classmethod
    def of(cls, log: Log) -> ShotLog:
        """Returns views of the rows of a `Log` with `begins` that are in use."""
        n_events, n_segments, n_shots = log.used
        bounds = np.concatenate((log.begins[:n_shots], log.used[None, :2]))
        return cls(log.events[:n_events], log.segments[:n_segments], bounds)

    def shots(self, begin: int, end: int) -> ShotLog:
        """Returns views of the rows of shots `begin` to `end` - 1."""
        first, last = self.bounds[begin], self.bounds[end]
        rows = self.events[first[0] : last[0]], self.segments[first[1] : last[1]]
        return ShotLog(*rows, self.bounds[begin : end + 1] - first)


def joined(logs: Sequence[ShotLog]) -> ShotLog:
    """Returns the log of the shots of some logs, at least one."""
    if len(logs) == 1:
        return logs[0]
    ends = np.cumsum([log.bounds[-1] for log in logs], axis=0)
    bounds = [log.bounds[:-1] + end - log.bounds[-1] for log, end in zip(logs, ends, strict=True)]
    events, segments = (np.concatenate(rows) for rows in ([x.events for x in logs], [x.segments for x in logs]))
    return ShotLog(events, segments, np.concatenate((*bounds, ends[-1:])))


NO_LOG = tuple(empty_log())
"""The log of shots that are not recorded. No kernel writes to it, so all threads share it."""


def named_events(rows: Floats) -> NDArray[Any]:
    """Returns rows of `Log.events` as an array of `EVENT_DTYPE`."""
    events = np.empty(len(rows), EVENT_DTYPE)
    events["kind"] = np.array(KINDS)[rows[:, KIND].astype(np.intp)]
    for name, column in _COLUMNS.items():
        events[name] = rows[:, column]
    return events


@inlined
def phase_end(phase):
    """Returns the kind of event that ends a phase on the cloth."""
    return SLIDING_ROLLING if phase == SLIDING else (ROLLING_REST if phase == ROLLING else SPINNING_REST)


@inlined
def phase_ended(kind, row):
    """Returns the kind of the event at the end of a phase. After a rolling phase a ball may roll on, more slowly."""
    return ROLLING_SLOWER if kind == ROLLING_REST and (row[VX] != 0.0 or row[VY] != 0.0) else kind


@inlined
def clear_log(log):  # out: log
    """Begins the next shot. Does not write to a log without rows, because threads may share it."""
    if len(log.events) == 0:
        return
    if len(log.begins) == 0:
        log.used[N_EVENTS_LOGGED] = log.used[N_SEGMENTS_LOGGED] = 0
        return
    k = log.used[N_SHOTS_LOGGED]
    log.used[N_SHOTS_LOGGED] += 1
    log.begins[k, N_EVENTS_LOGGED] = log.used[N_EVENTS_LOGGED]
    log.begins[k, N_SEGMENTS_LOGGED] = log.used[N_SEGMENTS_LOGGED]


@kernel
def log_event(log, time, kind, ball, other, state, speed, rule):  # out: log
    """Appends an event.

    Args:
        log: The `Log`.
        time: The `Time`.
        kind: An index into `KINDS`.
        ball: The ball; the event is at its position.
        other: The second ball, the cushion, the pocket or -1.
        state: The `State`.
        speed: Speed of approach of the two, m/s.
        rule: Whether the contact-time rule acted.
    """
    if len(log.events) == 0:
        return
    k = log.used[N_EVENTS_LOGGED]
    log.used[N_EVENTS_LOGGED] += 1
    if k < len(log.events):
        e = log.events[k]
        e[TIME], e[TIME_LO], e[KIND], e[BALL], e[OTHER] = time.hi, time.lo, kind, ball, other
        e[EVENT_X], e[EVENT_Y], e[SPEED], e[RULE] = state.rows[ball, X], state.rows[ball, Y], speed, rule


@kernel
def log_segment(log, state, ball):  # out: log
    """Appends the piece of a ball's trajectory that starts with its row of the `State`."""
    if len(log.segments) == 0:
        return
    k = log.used[N_SEGMENTS_LOGGED]
    log.used[N_SEGMENTS_LOGGED] += 1
    if k < len(log.segments):
        segment = log.segments[k]
        segment[SEGMENT_BALL], segment[SEGMENT_PHASE] = ball, state.phase[ball]
        for c in range(state.rows.shape[1]):
            segment[SEGMENT_ROW + c] = state.rows[ball, c]
