"""How far rounding may move the balls and the events of recorded shots: one pass forwards over the log.

The error of a position, or of the time of an event, is in proportion to its condition: the 2-norm of its derivatives by
the start, each times the size of its input. A bound never falls, because an early error changes which bodies later come
near each other.
"""

from __future__ import annotations

import math

import numpy as np

from billiards_env.derivatives.lanes import BALL_WIDTH, D_TIME, DX, DY, stretch_lane
from billiards_env.derivatives.state_laws import law_numbers_of
from billiards_env.derivatives.sweeps import (
    LANE_WORK,
    RecordedShots,
    balls_of,
    begin_lanes,
    begin_pieces,
    empty_tape,
    event_time,
    load_changes,
    look_after,
    push_event,
    shot_of,
    stretch_until,
    trace,
)
from billiards_env.engine.log import BALL
from billiards_env.engine.runner import INTERRUPTED
from billiards_env.jit import allocating, entry_point, inlined
from billiards_env.jit.interrupt import end_call
from billiards_env.physics.state import Time


@inlined
def _position_condition(i, until, inputs, shot, tangent, tape):  # out: tape
    """Returns the squared condition of the position of ball i at a `Time`, on its current piece, m^2."""
    stretch = stretch_until(shot.segments, tape.current[i], until, law_numbers_of(shot.scene.numbers))
    load_changes(i, 0, inputs, tangent, tape.lanes)
    total = 0.0
    for c in range(len(inputs)):
        lane = tape.lanes[c]
        stretch_lane(lane, 0, stretch, shot.tangents)
        total += lane[DX] * lane[DX] + lane[DY] * lane[DY]
    return total


@inlined
def _time_condition(count, tape):
    """Returns the squared condition of the time of the event that the lanes have passed, s^2."""
    total = 0.0
    for c in range(count):
        total += tape.lanes[c, D_TIME] * tape.lanes[c, D_TIME]
    return total


@inlined
def _larger(most, value):
    """Returns the larger of two numbers, or the one that is not a number."""
    return value if value > most or value != value else most


@entry_point
def bound_errors(kernels, begin, end, shots, times, inputs, limits, bounds):  # out: bounds
    """Computes bounds of the errors of shots `begin` to `end` - 1, up to each event and up to the end.

    Args:
        kernels: The `LaneKernels`.
        begin: First shot.
        end: One past the last.
        shots: The `sweeps.RecordedShots`, as a plain tuple.
        times: (m,) float64, s, the ends of the shots.
        inputs: (m, k, 9 n) float64, the changes of the inputs by their sizes.
        limits: The ratio of a bound to the condition; the error, m or s, after which all bounds are infinite.
        bounds: (l + m, 2) float64 out: bounds of a gap, m, and of a difference of times, s, for the l events in the
            order of the log. A row for the end of each shot follows its events.
    """
    end_call(_bound_errors(kernels, begin, end, shots, times, inputs, limits, bounds))


@allocating
def _bound_errors(kernels, begin, end, shots, times, inputs, limits, bounds):  # out: bounds
    """Computes the bounds, see `bound_errors`. Returns whether it was interrupted."""
    shots, (ratio, largest) = RecordedShots(*shots), limits
    n, count, pending = len(shots.scene[1]), inputs.shape[1], 0
    most = (largest / ratio) * (largest / ratio)
    tape, tangent = empty_tape(begin, end, shots, count), np.empty((n, count, BALL_WIDTH))
    for k in range(begin, end):
        shot, changes = shot_of(kernels, shots, k), inputs[k]
        events, row = shot.events, shots.bounds[k, 0] + k
        trace(shot, tape)
        begin_lanes(changes, times[k], shot, tangent, tape)
        position, time = 0.0, 0.0
        for e in range(len(events) + 1):
            if position < most and time < most:  # false for NaN
                now = event_time(events, e) if e < len(events) else Time(times[k], 0.0)
                for i in range(n):
                    position = _larger(position, _position_condition(i, now, changes, shot, tangent, tape))
                if e < len(events):
                    push_event(e, changes, shot, tangent, tape)
                    time = _larger(time, _time_condition(count, tape))
                    begin_pieces(e, events, tape)
                    for s in range(balls_of(events, e)):
                        condition = _position_condition(int(events[e, BALL + s]), now, changes, shot, tangent, tape)
                        position = _larger(position, condition)
                pending = look_after(pending + count * (n + LANE_WORK * shot.scene.numbers.cushion_work))
                if pending == INTERRUPTED:
                    return True
            known = position < most and time < most
            bounds[row + e, 0] = ratio * math.sqrt(position) if known else math.inf
            bounds[row + e, 1] = ratio * math.sqrt(time) if known else math.inf
    return False
