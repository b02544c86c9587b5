"""The derivative of recorded shots: one pass over the log, forwards or backwards.

`trace` computes the states before and after each event from the log. Then `push_lanes` multiplies changes of the start
by the derivative of each stretch and event in turn (a Jacobian times vectors), and `pull_lanes` multiplies adjoints of
the end by the transposes in reverse order (vectors times the Jacobian). Both use `apply_event`. Its lanes are the
changes themselves forwards, and unit vectors backwards. Memory is linear in the number of events.

The inputs of a shot are a row of numbers: (x, y, vx, vy, wx, wy, wz, radius, inverse mass) of each ball, then, if
constants change, the numbers of the scene in the order of `physics.state.LAW_NUMBERS`. The outputs are (x, y, vx, vy,
wx, wy, wz) of each ball at a time, and (time, x, y) of each event.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from billiards_env.derivatives.lanes import (
    BALL_WIDTH,
    CUSHION_NUMBERS,
    D_INV_MASS,
    D_NUMBERS,
    D_RADIUS,
    D_TIME,
    DUX,
    DVX,
    DWZ,
    DX,
    DY,
    LANE_WIDTH,
    PAIR_NUMBERS,
    STRETCH_NUMBERS,
    Jump,
    Stretch,
    ball_at,
    cushion_solution,
    end_lane,
    pair_lane,
    phase_end_lane,
    pocket_lane,
    put_ball,
    rates_of,
    settle_lane,
    spin_factor,
    start_lane,
    stretch_lane,
    wall_at,
    wall_lane,
)
from billiards_env.derivatives.state_laws import bounce, coast, law_numbers_of, meet
from billiards_env.engine.log import (
    BALL,
    BALL_BALL,
    BALL_CUSHION,
    BALL_POCKET,
    KIND,
    OTHER,
    SEGMENT_PHASE,
    SEGMENT_ROW,
    TIME,
    TIME_LO,
)
from billiards_env.engine.runner import INTERRUPTED
from billiards_env.jit import allocating, entry_point, expanded, inlined, kernel
from billiards_env.jit.interrupt import end_call, interrupted
from billiards_env.physics.geometry.walls import NX, NY
from billiards_env.physics.laws.cloth import drive, phase_of
from billiards_env.physics.state import (
    AX,
    AY,
    IDEAL,
    REST,
    ROLLING,
    SLIDING,
    SLIDING_AND_ROLLING,
    SPINNING,
    T0,
    T0_LO,
    VX,
    VY,
    SceneArrays,
    Time,
    ball_of,
    scene_of,
    since,
)

BALL_INPUTS = 9
"""Number of inputs of a ball."""
NUMBER_INPUTS = LANE_WIDTH - D_NUMBERS
"""Number of inputs that are numbers of the scene."""

MOST_LANES = 2 * BALL_WIDTH + 4 + NUMBER_INPUTS
"""Largest number of unit vectors at an event."""

_WHOLE, _MOTION = (0, BALL_WIDTH, -1), (DVX, BALL_WIDTH, -1)  # columns of a ball, see `_ball_columns`
_LOOK_AFTER = 100_000  # events times lanes between two calls of `interrupted`
LANE_WORK = 10
"""One unit of `Numbers.cushion_work` takes as long as this number of lanes without an impact. Each lane repeats it."""


class RecordedShots(NamedTuple):
    """Recorded shots. An entry point takes them as a plain tuple of these fields.

    Attributes:
        bounds: `ShotLog.bounds`.
        events: `ShotLog.events`.
        segments: `ShotLog.segments`.
        scene: The `SceneArrays` without kernels, as a plain tuple.
        is_sphere: Whether the balls are spheres.
    """

    bounds: Any
    events: Any
    segments: Any
    scene: Any
    is_sphere: Any


class RecordedShot(NamedTuple):
    """One of `RecordedShots`: its rows of the log, its `SceneArrays` with `TangentLaws`, and the `Tangents`."""

    events: Any
    segments: Any
    scene: SceneArrays
    tangents: Any
    is_sphere: Any


@inlined
def event_time(events, e):
    """Returns the `Time` of event e."""
    return Time(events[e, TIME], events[e, TIME_LO])


@inlined
def balls_of(events, e):
    """Returns the number of balls of event e."""
    return 2 if events[e, KIND] == BALL_BALL else 1


@inlined
def begin_time(segment):
    """Returns the `Time` at which a piece of a trajectory begins."""
    return Time(segment[SEGMENT_ROW + T0], segment[SEGMENT_ROW + T0_LO])


@expanded
def shot_of(kernels, shots, k):
    """Returns the `RecordedShot` with the number k; `kernels` are the `LaneKernels`."""
    at, after = shots.bounds[k], shots.bounds[k + 1]
    events, segments = shots.events[at[0] : after[0]], shots.segments[at[1] : after[1]]
    scene = scene_of(kernels.scene, shots.scene, k)
    return RecordedShot(events, segments, scene, kernels.tangents, shots.is_sphere)


@inlined
def look_after(pending):
    """Looks for Ctrl-C after some work, in units of events times lanes. Returns the work since then, or INTERRUPTED."""
    if pending > _LOOK_AFTER:
        return INTERRUPTED if interrupted() else 0
    return pending


class EventAdjoint(NamedTuple):
    """The adjoints of the results of an event.

    Attributes:
        values: (k, 3) float64.
        used: Whether any of them is not zero.
    """

    values: Any
    used: Any


class Tape(NamedTuple):
    """What a pass needs of each piece of a shot, and scratch.

    Attributes:
        previous: (pieces,) int64: the piece before, of the same ball; -1 for the first.
        within: (pieces,) bool: whether it begins between impacts with one solution, which count as successive.
        after: (pieces, BALL_WIDTH) float64: the state at its beginning, if it begins within them.
        first: (events,) int64: the first piece that begins with each event.
        current: (n,) int64, the last piece of each ball.
        lanes: (lanes, LANE_WIDTH) float64.
        column: (MOST_LANES,) int64, the column of each unit vector.
        pulled: (LANE_WIDTH,) float64, the products of the adjoint with the lanes, by their columns.
    """

    previous: Any
    within: Any
    after: Any
    first: Any
    current: Any
    lanes: Any
    column: Any
    pulled: Any


@allocating
def empty_tape(begin, end, shots, lanes):
    """Returns the `Tape` for shots `begin` to `end` - 1 of the `RecordedShots`."""
    events, pieces, n, bounds = 1, 1, len(shots.scene[1]), shots.bounds
    for k in range(begin, end):
        events = max(events, bounds[k + 1, 0] - bounds[k, 0])
        pieces = max(pieces, bounds[k + 1, 1] - bounds[k, 1])
    return Tape(
        previous=np.empty(pieces, np.int64),
        within=np.empty(pieces, np.bool_),
        after=np.empty((pieces, BALL_WIDTH)),
        first=np.empty(events, np.int64),
        current=np.empty(n, np.int64),
        lanes=np.zeros((lanes, LANE_WIDTH)),
        column=np.empty(MOST_LANES, np.int64),
        pulled=np.empty(LANE_WIDTH),
    )


@inlined
def stretch_until(segments, piece, until, numbers):
    """Returns the `Stretch` on a piece until a `Time`; `numbers` are the `LawNumbers`."""
    segment = segments[piece]
    return Stretch(
        ball_of(segment[SEGMENT_ROW:]), int(segment[SEGMENT_PHASE]), since(until, begin_time(segment)), numbers
    )


@inlined
def _coasted(segments, piece, stretch):
    """Returns the `BallState` after a `Stretch` on a piece."""
    row = segments[piece, SEGMENT_ROW:]
    return coast(stretch.ball, (row[AX], row[AY]), stretch.phase, stretch.dt, stretch.numbers)


@inlined
def ball_before(piece, stretch, segments, tape):
    """Returns the `BallState` just before a piece, after the `Stretch` before it."""
    previous = tape.previous[piece]
    if tape.within[previous] and stretch.dt == 0.0:
        return ball_at(tape.after[previous], 0)
    return _coasted(segments, previous, stretch)


@inlined
def _rates(segments, piece, ball, numbers, tape):
    """Returns the time derivative of a `BallState` on a piece."""
    row, phase = segments[piece, SEGMENT_ROW:], int(segments[piece, SEGMENT_PHASE])
    ax, ay = row[AX], row[AY]
    if tape.within[piece]:
        phase = phase_of(ball, numbers)
        ax, ay, _ = drive(ball, phase, numbers)
    return rates_of(ball, phase, (ax, ay), numbers)


@inlined
def _jump(i, piece, stretch, shot, tape):
    """Returns the `Jump` of ball i at the beginning of a piece, after a `Stretch`."""
    segments, scene, ball = shot.segments, shot.scene, ball_before(piece, stretch, shot.segments, tape)
    after = ball_at(tape.after[piece], 0) if tape.within[piece] else ball_of(segments[piece, SEGMENT_ROW:])
    rates = _rates(segments, tape.previous[piece], ball, stretch.numbers, tape)
    return Jump(ball, rates, _rates(segments, piece, after, stretch.numbers, tape), scene.radius[i], scene.inv_mass[i])


@inlined
def _is_joint(events, e):
    """Returns whether event e is one of several impacts of balls at one instant."""
    if events[e, KIND] != BALL_BALL:
        return False
    for k in (e - 1, e + 1):
        if 0 <= k < len(events) and events[k, KIND] == BALL_BALL and events[k, TIME] == events[e, TIME]:
            return True
    return False


@inlined
def _is_corner(e, piece, events, segments):
    """Returns whether event e, with a piece, is the first impact of a ball with two cushions that act together."""
    if e + 1 == len(events) or events[e + 1, KIND] != BALL_CUSHION or events[e + 1, BALL] != events[e, BALL]:
        return False
    one, two = segments[piece, SEGMENT_ROW:], segments[piece + 1, SEGMENT_ROW:]
    return one[T0] == two[T0] and one[VX] == two[VX] and one[VY] == two[VY]  # two successive ones change the velocity


@inlined
def _begin_within(piece, ball, segments, tape):  # out: tape
    """Begins a piece with a `BallState` after one of several impacts with one solution."""
    row = segments[piece, SEGMENT_ROW:]
    tape.within[piece] = ball.vx != row[VX] or ball.vy != row[VY]
    put_ball(tape.after[piece], 0, ball)


@kernel
def trace(shot, tape):  # out: tape
    """Fills the tape of a `RecordedShot`.

    Several impacts with one solution count as successive, in the order of the log.
    """
    events, segments, scene = shot.events, shot.segments, shot.scene
    n, numbers = len(scene.radius), law_numbers_of(scene.numbers)
    for i in range(n):
        tape.current[i], tape.within[i], tape.previous[i] = i, False, -1
    piece = n
    for e in range(len(events)):
        balls = balls_of(events, e)
        tape.first[e] = piece
        for s in range(balls):
            i = int(events[e, BALL + s])
            tape.previous[piece + s], tape.current[i], tape.within[piece + s] = tape.current[i], piece + s, False
        joint = _is_joint(events, e)
        if joint or (events[e, KIND] == BALL_CUSHION and _is_corner(e, piece, events, segments)):
            i, other, now = int(events[e, BALL]), int(events[e, OTHER]), event_time(events, e)
            ball = ball_before(piece, stretch_until(segments, tape.previous[piece], now, numbers), segments, tape)
            if joint:
                stretch = stretch_until(segments, tape.previous[piece + 1], now, numbers)
                second = ball_before(piece + 1, stretch, segments, tape)
                if _approach(ball, second):
                    bodies = (scene.radius[i], scene.radius[other], scene.inv_mass[i], scene.inv_mass[other])
                    ball, second = meet(scene.laws, shot.is_sphere, ball, second, bodies, numbers)
                _begin_within(piece + 1, second, segments, tape)
            else:
                wall = wall_at(ball.x, ball.y, other, scene.radius[i], scene)
                ball = bounce(ball, (wall.nx, wall.ny), scene.radius[i], scene.laws, numbers, None)
            _begin_within(piece, ball, segments, tape)
        piece += balls


@inlined
def begin_pieces(e, events, tape):  # out: tape
    """Makes the pieces that begin with event e the current ones of its balls."""
    for s in range(balls_of(events, e)):
        tape.current[int(events[e, BALL + s])] = tape.first[e] + s


@inlined
def _approach(a, b):
    """Returns whether two balls with these `BallState`s approach."""
    return (b.x - a.x) * (b.vx - a.vx) + (b.y - a.y) * (b.vy - a.vy) < 0.0


@inlined
def apply_event(e, count, shot, tape):  # out: tape
    """Changes the first `count` lanes by event e of a `RecordedShot` and the stretches of its balls before it."""
    events, segments, scene, tangents, is_sphere = shot
    numbers, lanes, piece = law_numbers_of(scene.numbers), tape.lanes, tape.first[e]
    kind, now, i, other = int(events[e, KIND]), event_time(events, e), int(events[e, BALL]), int(events[e, OTHER])
    phase = int(segments[piece, SEGMENT_PHASE])
    stretch = stretch_until(segments, tape.previous[piece], now, numbers)
    one = _jump(i, piece, stretch, shot, tape)
    ball = one.ball
    if kind == BALL_BALL:
        second = stretch_until(segments, tape.previous[piece + 1], now, numbers)
        two = _jump(other, piece + 1, second, shot, tape)
        other_phase = int(segments[piece + 1, SEGMENT_PHASE])
        meets = _approach(ball, two.ball)
        for c in range(count):
            lane = lanes[c]
            stretch_lane(lane, 0, stretch, tangents)
            stretch_lane(lane, BALL_WIDTH, second, tangents)
            if meets:
                pair_lane(lane, one, two, is_sphere, scene.laws, numbers, tangents)
            else:
                lane[D_TIME] = lane[D_TIME + 1] = lane[D_TIME + 2] = 0.0
            settle_lane(lane, 0, phase, numbers)
            settle_lane(lane, BALL_WIDTH, other_phase, numbers)
    elif kind == BALL_CUSHION:
        wall = wall_at(ball.x, ball.y, other, one.radius, scene)
        meets = wall.nx * ball.vx + wall.ny * ball.vy >= 0.0
        solution = cushion_solution(ball, wall, one.radius, scene)
        for c in range(count):
            lane = lanes[c]
            stretch_lane(lane, 0, stretch, tangents)
            if meets:
                wall_lane(lane, wall, one, scene.laws, numbers, solution, tangents)
            else:  # the second of two cushions, if friction at the first one takes the ball away from it
                lane[D_TIME] = lane[D_TIME + 1] = lane[D_TIME + 2] = 0.0
            settle_lane(lane, 0, phase, numbers)
    else:
        for c in range(count):
            lane = lanes[c]
            if kind == BALL_POCKET:
                stretch_lane(lane, 0, stretch, tangents)
                pocket_lane(lane, ball, scene.pockets[other])
            else:
                phase_end_lane(lane, stretch, one.before, one.after, tangents)
            settle_lane(lane, 0, phase, numbers)


@inlined
def _apply_end(i, count, until, shot, tape):  # out: tape
    """Changes the first `count` lanes, with ball i, by its last stretch until a time (s)."""
    numbers = law_numbers_of(shot.scene.numbers)
    stretch = stretch_until(shot.segments, tape.current[i], Time(until, 0.0), numbers)
    ball = _coasted(shot.segments, tape.current[i], stretch)
    for c in range(count):
        stretch_lane(tape.lanes[c], 0, stretch, shot.tangents)
        end_lane(tape.lanes[c], ball, shot.scene.radius[i], numbers, shot.tangents)


@inlined
def load_changes(i, s, inputs, tangent, lanes):  # out: lanes
    """Copies the changes of ball i and of its constants to the columns of ball s of the lanes."""
    for c in range(len(inputs)):
        lane = lanes[c]
        lane[D_RADIUS + s], lane[D_INV_MASS + s] = inputs[c, BALL_INPUTS * i + 7], inputs[c, BALL_INPUTS * i + 8]
        for j in range(BALL_WIDTH):
            lane[s * BALL_WIDTH + j] = tangent[i, c, j]


@inlined
def _store(i, s, lanes, tangent):  # out: tangent
    """Copies the columns of ball s of the lanes to the changes of ball i."""
    for c in range(tangent.shape[1]):
        for j in range(BALL_WIDTH):
            tangent[i, c, j] = lanes[c, s * BALL_WIDTH + j]


@inlined
def _phase_until(piece, until, segments):
    """Returns the phase of a piece. A shot until 0 s ends at its start, so all parts of its state remain."""
    phase = int(segments[piece, SEGMENT_PHASE])
    return SLIDING if until == 0.0 and phase < SLIDING else phase


@inlined
def _start(i, count, until, shot, lanes):  # out: lanes
    """Changes the first `count` lanes, with the inputs of ball i, to its state at the start of a shot until a time."""
    segments, scene = shot.segments, shot.scene
    phase, numbers = _phase_until(i, until, segments), law_numbers_of(scene.numbers)
    for c in range(count):
        start_lane(lanes[c], ball_of(segments[i, SEGMENT_ROW:]), phase, scene.radius[i], numbers, shot.tangents)


@inlined
def begin_lanes(inputs, until, shot, tangent, tape):  # out: tangent, tape
    """Begins a pass forwards: the lanes take the changes of the constants, and `tangent` those of the n balls.

    `until` is the time of the outputs, s.
    """
    lanes, (count, width), n = tape.lanes, inputs.shape, len(tangent)
    for c in range(count):
        for j in range(width - BALL_INPUTS * n):
            lanes[c, D_NUMBERS + j] = inputs[c, BALL_INPUTS * n + j]
    for i in range(n):
        tape.current[i] = i
        for c in range(count):
            for j in range(BALL_WIDTH):
                tangent[i, c, j] = inputs[c, BALL_INPUTS * i + j]
        load_changes(i, 0, inputs, tangent, lanes)
        _start(i, count, until, shot, lanes)
        _store(i, 0, lanes, tangent)


@inlined
def push_event(e, inputs, shot, tangent, tape):  # out: tangent, tape
    """Changes `tangent` by event e."""
    events = shot.events
    for s in range(balls_of(events, e)):
        load_changes(int(events[e, BALL + s]), s, inputs, tangent, tape.lanes)
    apply_event(e, len(inputs), shot, tape)
    for s in range(balls_of(events, e)):
        _store(int(events[e, BALL + s]), s, tape.lanes, tangent)


@entry_point
def push_lanes(kernels, begin, end, shots, times, inputs, results):  # out: results
    """Computes the changes of shots `begin` to `end` - 1 by changes of their inputs.

    Args:
        kernels: The `LaneKernels`.
        begin: First shot.
        end: One past the last.
        shots: The `RecordedShots`, as a plain tuple.
        times: (m, q) float64, ascending, s; not later than the end of the shot.
        inputs: (m, k, 9 n) or (m, k, 9 n + NUMBER_INPUTS) float64, the changes of the inputs.
        results: Two output arrays: (m, q, k, n, 7) float64, the changes of the outputs at these times;
            (m, k, l, 3) float64, the changes of time and place of the first l events, zero for events after the last of
            these times.
    """
    end_call(_push_lanes(kernels, begin, end, shots, times, inputs, results))


@allocating
def _push_lanes(kernels, begin, end, shots, times, inputs, results):  # out: results
    """Computes the changes, see `push_lanes`. Returns whether it was interrupted."""
    shots, (outputs, at_events) = RecordedShots(*shots), results
    n, count, most = outputs.shape[3], inputs.shape[1], at_events.shape[2]
    tape, tangent, pending = empty_tape(begin, end, shots, count), np.empty((n, count, BALL_WIDTH)), 0
    for k in range(begin, end):
        shot, changes, lanes = shot_of(kernels, shots, k), inputs[k], tape.lanes
        trace(shot, tape)
        begin_lanes(changes, times[k, -1], shot, tangent, tape)
        at_events[k] = 0.0
        done = 0
        for q in range(times.shape[1]):
            while done < len(shot.events) and shot.events[done, TIME] <= times[k, q]:
                push_event(done, changes, shot, tangent, tape)
                begin_pieces(done, shot.events, tape)
                if done < most:
                    for c in range(count):
                        for j in range(3):
                            at_events[k, c, done, j] = lanes[c, D_TIME + j]
                done += 1
                pending = look_after(pending + count * (1 + LANE_WORK * shot.scene.numbers.cushion_work))
                if pending == INTERRUPTED:
                    return True
            for i in range(n):
                load_changes(i, 0, changes, tangent, lanes)
                _apply_end(i, count, times[k, q], shot, tape)
                for c in range(count):
                    for j in range(BALL_WIDTH):
                        outputs[k, q, c, i, j] = lanes[c, j]
    return False


@inlined
def _ball_columns(at, phase, columns, count, motion, column):  # out: column
    """Appends the columns of a ball that can change in a phase to the first `count` columns of the unit vectors.

    Args:
        at: The first column of the ball.
        phase: The phase.
        columns: (first, end, skip): the columns first to end - 1 without `skip`; -1 skips none.
        count: Number of columns so far.
        motion: `Numbers.motion`.
        column: `Tape.column`.

    Returns:
        The number of columns.
    """
    begin, end, without = columns
    for j in range(begin, end):
        if j == without or (j >= DUX and motion != SLIDING_AND_ROLLING):
            continue
        needed = REST
        if motion != IDEAL and j >= DVX:  # the first phase that has this column, see `settle_lane`
            needed = ROLLING if j < DUX else (SLIDING if j < DWZ else SPINNING)
        if phase >= needed:
            column[count] = at + j
            count += 1
    return count


@inlined
def _unit_lanes(balls, kind, count, constants, tape):  # out: tape
    """Sets the lanes to the unit vectors of `count` columns and, if `constants` change, of those of an event.

    Returns their number.
    """
    column = tape.column
    if constants:
        for s in range(balls):
            column[count], column[count + 1] = D_RADIUS + s, D_INV_MASS + s
            count += 2
        begin, last = PAIR_NUMBERS if kind == BALL_BALL else CUSHION_NUMBERS
        for j in range(D_NUMBERS, LANE_WIDTH):
            of_motion = STRETCH_NUMBERS[0] <= j < STRETCH_NUMBERS[1]
            if of_motion or (begin <= j < last and (kind in (BALL_BALL, BALL_CUSHION))):
                column[count] = j
                count += 1
    for c in range(count):
        lane, one = tape.lanes[c], column[c]
        for j in range(BALL_WIDTH):  # a fixed number takes less time
            lane[j] = 1.0 if j == one else 0.0
        if balls > 1:
            for j in range(BALL_WIDTH, 2 * BALL_WIDTH):
                lane[j] = 1.0 if j == one else 0.0
        if constants:  # they are zero otherwise
            for j in range(D_RADIUS, LANE_WIDTH):
                lane[j] = 1.0 if j == one else 0.0
    return count


@inlined
def _pull(count, i, other, columns, event, tape, adjoint, sums):  # out: tape, adjoint, sums
    """Multiplies adjoints by the lanes of one ball or of two.

    Args:
        count: Number of lanes.
        i: The first ball.
        other: The second ball; -1 for none.
        columns: Those of the first ball that the lanes change, see `_ball_columns`.
        event: The `EventAdjoint` of the event.
        tape: The `Tape`.
        adjoint: (k, n, 7) float64, changed in place.
        sums: (k, 9 n) or (k, 9 n + NUMBER_INPUTS) float64; the parts of the constants are added.
    """
    lanes, pulled, n, (begin, end, without) = tape.lanes, tape.pulled, adjoint.shape[1], columns
    for k in range(len(adjoint)):
        a, b = adjoint[k, i], adjoint[k, max(other, 0)]
        for j in range(2 * BALL_WIDTH):
            pulled[j] = 0.0
        for c in range(count):
            lane, total = lanes[c], 0.0
            if event.used:
                for j in range(3):
                    total += event.values[k, j] * lane[D_TIME + j]
            for j in range(BALL_WIDTH):
                total += a[j] * lane[j]
            if other >= 0:
                for j in range(BALL_WIDTH):
                    total += b[j] * lane[BALL_WIDTH + j]
            pulled[tape.column[c]] = total
        for j in range(begin, end):
            if j != without:
                a[j] = pulled[j]
        if other >= 0:
            for j in range(BALL_WIDTH):
                b[j] = pulled[BALL_WIDTH + j]
        if sums.shape[1] > BALL_INPUTS * n:
            for c in range(count):
                at = tape.column[c]
                if D_RADIUS <= at < D_INV_MASS:
                    sums[k, BALL_INPUTS * (i if at == D_RADIUS else other) + 7] += pulled[at]
                elif D_INV_MASS <= at < D_NUMBERS:
                    sums[k, BALL_INPUTS * (i if at == D_INV_MASS else other) + 8] += pulled[at]
                elif at >= D_NUMBERS:
                    sums[k, BALL_INPUTS * n + at - D_NUMBERS] += pulled[at]


@inlined
def _coordinate_along(wall, lines):
    """Returns the column of the coordinate along a straight cushion that is parallel to an axis; -1 for others.

    A ball that starts farther along such a cushion hits it at the same time and with the same motion.
    """
    if wall >= len(lines):
        return -1
    return DY if lines[wall, NY] == 0.0 else (DX if lines[wall, NX] == 0.0 else -1)


@inlined
def _phase_before(piece, segments, tape):
    """Returns the phase of the ball before a piece begins."""
    return int(segments[tape.previous[piece], SEGMENT_PHASE])


@inlined
def _is_zero(i, adjoint):
    """Returns whether the adjoints of ball i are zero."""
    for k in range(len(adjoint)):
        for j in range(BALL_WIDTH):
            if adjoint[k, i, j] != 0.0:
                return False
    return True


@entry_point
def pull_lanes(kernels, begin, end, shots, times, outputs, at_events, inputs):  # out: outputs, inputs
    """Computes the products of adjoints of the outputs of shots `begin` to `end` - 1 with their Jacobians.

    Args:
        kernels: The `LaneKernels`.
        begin: First shot.
        end: One past the last.
        shots: The `RecordedShots`, as a plain tuple.
        times: (m,) float64, s, the times of the outputs.
        outputs: (m, k, n, 7) float64, the adjoints of the outputs. This function changes them.
        at_events: (m, k, l, 3) float64, the adjoints of time and place of the first l events.
        inputs: (m, k, 9 n) float64 out, the products, which are zero for radii and masses; if constants change,
            (m, k, 9 n + NUMBER_INPUTS).
    """
    end_call(_pull_lanes(kernels, begin, end, shots, times, outputs, at_events, inputs))


@allocating
def _pull_lanes(kernels, begin, end, shots, times, outputs, at_events, inputs):  # out: outputs, inputs
    """Computes the products, see `pull_lanes`. Returns whether it was interrupted."""
    shots = RecordedShots(*shots)
    n, count, most = outputs.shape[2], outputs.shape[1], at_events.shape[2]
    constants = inputs.shape[2] > BALL_INPUTS * n
    tape = empty_tape(begin, end, shots, MOST_LANES)
    at_event, pending = np.zeros((count, 3)), 0
    for k in range(begin, end):
        shot, adjoint, sums = shot_of(kernels, shots, k), outputs[k], inputs[k]
        log, paths, motion = shot.events, shot.segments, shot.scene.numbers.motion
        trace(shot, tape)
        sums[:] = 0.0
        for i in range(n):
            tape.current[i] = i
        done = 0
        while done < len(log) and log[done, TIME] <= times[k]:
            begin_pieces(done, log, tape)
            done += 1
        for i in range(n):
            if not _is_zero(i, adjoint):
                phase = _phase_until(tape.current[i], times[k], paths)
                lanes = _ball_columns(0, phase, _MOTION, 0, motion, tape.column)
                lanes = _unit_lanes(1, -1, lanes, constants, tape)
                _apply_end(i, lanes, times[k], shot, tape)
                _pull(lanes, i, -1, _MOTION, EventAdjoint(at_event, False), tape, adjoint, sums)
        for e in range(done - 1, -1, -1):
            kind, i = int(log[e, KIND]), int(log[e, BALL])
            j = int(log[e, OTHER]) if kind == BALL_BALL else -1
            marked = False
            if e < most:
                for c in range(count):
                    for d in range(3):
                        at_event[c, d] = at_events[k, c, e, d]
                        marked = marked or at_event[c, d] != 0.0
            if not marked and _is_zero(i, adjoint) and (j < 0 or _is_zero(j, adjoint)):
                continue
            piece = tape.first[e]
            phase = _phase_before(piece, paths, tape)
            spins_on = kind > BALL_POCKET and phase != SPINNING  # the spin about the vertical axis acts only on itself
            without = -1
            if kind == BALL_CUSHION and not marked:
                without = _coordinate_along(int(log[e, OTHER]), shot.scene.outline.lines)
            columns = (0 if kind <= BALL_POCKET or marked else DVX, DWZ if spins_on else BALL_WIDTH, without)
            lanes = _ball_columns(0, phase, columns, 0, motion, tape.column)
            if j >= 0:
                phase = _phase_before(piece + 1, paths, tape)
                lanes = _ball_columns(BALL_WIDTH, phase, _WHOLE, lanes, motion, tape.column)
            lanes = _unit_lanes(1 if j < 0 else 2, kind, lanes, constants, tape)
            apply_event(e, lanes, shot, tape)
            _pull(lanes, i, j, columns, EventAdjoint(at_event, marked), tape, adjoint, sums)
            if spins_on:
                numbers = law_numbers_of(shot.scene.numbers)
                factor = spin_factor(stretch_until(paths, tape.previous[piece], event_time(log, e), numbers))
                for c in range(count):
                    adjoint[c, i, DWZ] *= factor
            pending = look_after(pending + lanes * (1 + LANE_WORK * shot.scene.numbers.cushion_work))
            if pending == INTERRUPTED:
                return True
        for i in range(n):
            if not _is_zero(i, adjoint):
                phase = _phase_until(i, times[k], paths)
                phase = SLIDING if phase == ROLLING else phase
                lanes = _ball_columns(0, phase, _WHOLE, 0, motion, tape.column)
                lanes = _unit_lanes(1, -1, lanes, constants, tape)
                _start(i, lanes, times[k], shot, tape.lanes)
                _pull(lanes, i, -1, _WHOLE, EventAdjoint(at_event, False), tape, adjoint, sums)
            for c in range(count):
                for d in range(BALL_WIDTH):
                    sums[c, BALL_INPUTS * i + d] = adjoint[c, i, d]
    return False
