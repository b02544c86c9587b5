"""The derivative of recorded shots: one pass over the log, forwards or backwards.

`trace` computes the states before and after each event from the log. Then `push_lanes` multiplies changes of the start
by the derivative of each flight and event in turn (a Jacobian times vectors), and `pull_lanes` multiplies adjoints of
the end by the transposes in reverse order (vectors times the Jacobian). Both use `apply_event`. Its lanes are the
changes themselves forwards, and unit vectors backwards. Memory is linear in the number of events.

The inputs of a shot are a row of numbers: (x, y, vx, vy, wx, wy, wz, radius, inverse mass) of each ball, then the
numbers of the scene in the order of `physics.state.LAW_NUMBERS`. The outputs are (x, y, vx, vy, wx, wy, wz) of
each ball at a time, and (time, x, y) of each event.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

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
from billiards_env.jit import allocating, allocating_entry_point, inlined, kernel
from billiards_env.jit.interrupt import end_call, interrupted
from billiards_env.physics.cushion import bounce
from billiards_env.physics.derivatives import (
    BALL_WIDTH,
    CUSHION_NUMBERS,
    D_INV_MASS,
    D_NUMBERS,
    D_RADIUS,
    D_TIME,
    DUX,
    DVX,
    DVY,
    DWZ,
    END_NUMBERS,
    FLIGHT_NUMBERS,
    LANE_WIDTH,
    PAIR_NUMBERS,
    Flight,
    Jump,
    ball_at,
    cushion_solution,
    end_lane,
    flight_lane,
    pair_lane,
    phase_end_lane,
    pocket_lane,
    put_ball,
    rates_of,
    settle_lane,
    start_lane,
    wall_at,
    wall_lane,
)
from billiards_env.physics.laws.balls import meet
from billiards_env.physics.laws.cloth import coast, drive, phase_of
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
    Time,
    ball_of,
    law_numbers_of,
    scene_of,
    since,
)

BALL_INPUTS = 9
"""Number of inputs of a ball."""
NUMBER_INPUTS = END_NUMBERS - D_NUMBERS
"""Number of inputs that are numbers of the scene."""

MOST_LANES = 2 * BALL_WIDTH + 4 + NUMBER_INPUTS
"""Largest number of unit vectors at an event."""

_LOOK_AFTER = 100_000  # events times lanes between two calls of `interrupted`
_WORK = 10  # lanes without an impact that take as long as one unit of `Numbers.cushion_work`, which each lane repeats


class RecordedShots(NamedTuple):
    """Recorded shots. An entry point takes them as a plain tuple of these fields.

    Attributes:
        first: The number of the first shot in the log.
        scene: The `SceneArrays`, as a plain tuple.
        is_sphere: Whether the balls are spheres.
        events: `Log.events`.
        segments: `Log.segments`.
        bounds: (shots + 1, 2) int64: `Log.begins`, and the numbers of used rows.
    """

    first: Any
    scene: Any
    is_sphere: Any
    events: Any
    segments: Any
    bounds: Any


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
        before: (pieces, BALL_WIDTH) float64: the state of the ball just before the piece.
        after: (pieces, BALL_WIDTH) float64: the state at its beginning.
        first: (events,) int64: the first piece that begins with each event.
        current: (n,) int64, the last piece of each ball.
        joint: (n,) bool, whether it began with one of several impacts of one solution.
        lanes: (lanes, LANE_WIDTH) float64.
        column: (MOST_LANES,) int64, the column of each unit vector.
        pulled: (MOST_LANES,) float64, the products of the adjoint with the lanes.
    """

    previous: Any
    before: Any
    after: Any
    first: Any
    current: Any
    joint: Any
    lanes: Any
    column: Any
    pulled: Any


@allocating
def empty_tape(begin, end, shots, lanes):
    """Returns the `Tape` for shots `begin` to `end` - 1 of the `RecordedShots`."""
    events, pieces, n, bounds = 1, 1, len(shots.scene[1]), shots.bounds
    for k in range(begin - shots.first, end - shots.first):
        events = max(events, bounds[k + 1, 0] - bounds[k, 0])
        pieces = max(pieces, bounds[k + 1, 1] - bounds[k, 1])
    return Tape(
        previous=np.empty(pieces, np.int64),
        before=np.empty((pieces, BALL_WIDTH)),
        after=np.empty((pieces, BALL_WIDTH)),
        first=np.empty(events, np.int64),
        current=np.empty(n, np.int64),
        joint=np.empty(n, np.bool_),
        lanes=np.empty((lanes, LANE_WIDTH)),
        column=np.empty(MOST_LANES, np.int64),
        pulled=np.empty(MOST_LANES),
    )


@inlined
def flight_until(segments, piece, until, numbers):
    """Returns the `Flight` on a piece until a `Time`; `numbers` are the `LawNumbers`."""
    segment = segments[piece]
    row = segment[SEGMENT_ROW:]
    return Flight(ball_of(row), int(segment[SEGMENT_PHASE]), since(until, Time(row[T0], row[T0_LO])), numbers)


@inlined
def _flown(segments, piece, flight):
    """Returns the `BallState` after a `Flight` on a piece."""
    row = segments[piece, SEGMENT_ROW:]
    return coast(flight.ball, (row[AX], row[AY]), flight.phase, flight.dt, flight.numbers)


@inlined
def _rates(segments, piece, ball, numbers, tape):
    """Returns the time derivative of a `BallState` on a piece."""
    row, begun, phase = segments[piece, SEGMENT_ROW:], tape.after[piece], int(segments[piece, SEGMENT_PHASE])
    ax, ay = row[AX], row[AY]
    if begun[DVX] != row[VX] or begun[DVY] != row[VY]:  # between impacts at one instant
        phase = phase_of(ball, numbers)
        ax, ay, _ = drive(ball, phase, numbers)
    return rates_of(ball, phase, (ax, ay), numbers)


@inlined
def _jump(i, piece, segments, scene, numbers, tape):
    """Returns the `Jump` of ball i at the beginning of a piece."""
    ball = ball_at(tape.before[piece], 0)
    before = _rates(segments, tape.previous[piece], ball, numbers, tape)
    after = _rates(segments, piece, ball_at(tape.after[piece], 0), numbers, tape)
    return Jump(ball, before, after, scene.radius[i], scene.inv_mass[i])


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


@kernel
def trace(events, segments, scene, is_sphere, tape):
    """Fills the tape of a shot.

    Several impacts with one solution count as successive, in the order of the log.
    """
    n, numbers = len(scene.radius), law_numbers_of(scene.numbers)
    for i in range(n):
        tape.current[i], tape.joint[i], tape.previous[i] = i, False, -1
        put_ball(tape.after[i], 0, ball_of(segments[i, SEGMENT_ROW:]))
    piece = n
    for e in range(len(events)):
        now = Time(events[e, TIME], events[e, TIME_LO])
        balls = 2 if events[e, KIND] == BALL_BALL else 1
        tape.first[e] = piece
        for s in range(balls):
            i = int(events[e, BALL + s])
            p, here = tape.current[i], piece + s
            tape.previous[here] = p
            flight = flight_until(segments, p, now, numbers)
            if tape.joint[i] and flight.dt == 0.0:
                put_ball(tape.before[here], 0, ball_at(tape.after[p], 0))
            else:
                put_ball(tape.before[here], 0, _flown(segments, p, flight))
            put_ball(tape.after[here], 0, ball_of(segments[here, SEGMENT_ROW:]))
            tape.current[i] = here
            tape.joint[i] = False
        i, other, ball = int(events[e, BALL]), int(events[e, OTHER]), ball_at(tape.before[piece], 0)
        if _is_joint(events, e):
            second = ball_at(tape.before[piece + 1], 0)
            tape.joint[i] = tape.joint[other] = True
            if _approach(ball, second):
                bodies = (scene.radius[i], scene.radius[other], scene.inv_mass[i], scene.inv_mass[other])
                ball, second = meet(scene.ball_friction, is_sphere, ball, second, bodies, numbers)
            put_ball(tape.after[piece], 0, ball)
            put_ball(tape.after[piece + 1], 0, second)
        elif events[e, KIND] == BALL_CUSHION and _is_corner(e, piece, events, segments):
            wall = wall_at(ball.x, ball.y, other, scene.radius[i], scene.outline)
            tape.joint[i] = True
            ball = bounce(ball, (wall.nx, wall.ny), scene.radius[i], scene.cushion, numbers, None)
            put_ball(tape.after[piece], 0, ball)
        piece += balls


@inlined
def _approach(a, b):
    """Returns whether two balls with these `BallState`s approach."""
    return (b.x - a.x) * (b.vx - a.vx) + (b.y - a.y) * (b.vy - a.vy) < 0.0


@inlined
def apply_event(e, count, events, segments, scene, is_sphere, tape):
    """Changes the first `count` lanes by event e and the flights of its balls before it."""
    numbers, lanes, piece = law_numbers_of(scene.numbers), tape.lanes, tape.first[e]
    kind, now = int(events[e, KIND]), Time(events[e, TIME], events[e, TIME_LO])
    i, other = int(events[e, BALL]), int(events[e, OTHER])
    phase = int(segments[piece, SEGMENT_PHASE])
    flight = flight_until(segments, tape.previous[piece], now, numbers)
    one = _jump(i, piece, segments, scene, numbers, tape)
    ball = one.ball
    if kind == BALL_BALL:
        second = flight_until(segments, tape.previous[piece + 1], now, numbers)
        two = _jump(other, piece + 1, segments, scene, numbers, tape)
        other_phase = int(segments[piece + 1, SEGMENT_PHASE])
        meets = _approach(ball, two.ball)
        for c in range(count):
            lane = lanes[c]
            flight_lane(lane, 0, flight)
            flight_lane(lane, BALL_WIDTH, second)
            if meets:
                pair_lane(lane, one, two, is_sphere, scene.ball_friction, numbers)
            else:
                lane[D_TIME] = lane[D_TIME + 1] = lane[D_TIME + 2] = 0.0
            settle_lane(lane, 0, phase, numbers)
            settle_lane(lane, BALL_WIDTH, other_phase, numbers)
    elif kind == BALL_CUSHION:
        wall = wall_at(ball.x, ball.y, other, one.radius, scene.outline)
        meets = wall.nx * ball.vx + wall.ny * ball.vy >= 0.0
        solution = cushion_solution(ball, wall, one.radius, scene)
        for c in range(count):
            lane = lanes[c]
            flight_lane(lane, 0, flight)
            if meets:
                wall_lane(lane, wall, one, scene.cushion, numbers, solution)
            else:  # the second of two cushions, if friction at the first one takes the ball away from it
                lane[D_TIME] = lane[D_TIME + 1] = lane[D_TIME + 2] = 0.0
            settle_lane(lane, 0, phase, numbers)
    else:
        for c in range(count):
            lane = lanes[c]
            if kind == BALL_POCKET:
                flight_lane(lane, 0, flight)
                pocket_lane(lane, ball, scene.pockets[other])
            else:
                phase_end_lane(lane, flight, one.before, one.after)
            settle_lane(lane, 0, phase, numbers)


@inlined
def _apply_end(i, count, until, segments, scene, tape):
    """Changes the first `count` lanes, with ball i, by its last flight until a time (s)."""
    numbers = law_numbers_of(scene.numbers)
    flight = flight_until(segments, tape.current[i], Time(until, 0.0), numbers)
    ball = _flown(segments, tape.current[i], flight)
    for c in range(count):
        flight_lane(tape.lanes[c], 0, flight)
        end_lane(tape.lanes[c], ball, scene.radius[i], numbers)


@inlined
def load(i, s, count, inputs, tangent, lanes):
    """Copies the changes of ball i and of its constants to the columns of ball s of the lanes."""
    for c in range(count):
        lane = lanes[c]
        lane[D_RADIUS + s], lane[D_INV_MASS + s] = inputs[c, BALL_INPUTS * i + 7], inputs[c, BALL_INPUTS * i + 8]
        for j in range(BALL_WIDTH):
            lane[s * BALL_WIDTH + j] = tangent[i, c, j]


@inlined
def store(i, s, count, lanes, tangent):
    """Copies the columns of ball s of the lanes to the changes of ball i."""
    for c in range(count):
        for j in range(BALL_WIDTH):
            tangent[i, c, j] = lanes[c, s * BALL_WIDTH + j]


@inlined
def _phase_until(piece, until, segments):
    """Returns the phase of a piece. A shot until 0 s ends at its start, so all parts of its state remain."""
    phase = int(segments[piece, SEGMENT_PHASE])
    return SLIDING if until == 0.0 and phase < SLIDING else phase


@inlined
def _start(i, count, until, segments, scene, lanes):
    """Changes the first `count` lanes, with the inputs of ball i, to its state at the start of a shot until a time."""
    phase, numbers = _phase_until(i, until, segments), law_numbers_of(scene.numbers)
    for c in range(count):
        start_lane(lanes[c], ball_of(segments[i, SEGMENT_ROW:]), phase, scene.radius[i], numbers)


@inlined
def begin_lanes(n, inputs, until, segments, scene, tangent, tape):
    """Begins a pass forwards: the lanes take the changes of the constants, and `tangent` those of the n balls.

    `until` is the time of the outputs, s.
    """
    lanes, count = tape.lanes, len(inputs)
    for c in range(count):
        for j in range(NUMBER_INPUTS):
            lanes[c, D_NUMBERS + j] = inputs[c, BALL_INPUTS * n + j]
    for i in range(n):
        tape.current[i] = i
        for c in range(count):
            for j in range(BALL_WIDTH):
                tangent[i, c, j] = inputs[c, BALL_INPUTS * i + j]
        load(i, 0, count, inputs, tangent, lanes)
        _start(i, count, until, segments, scene, lanes)
        store(i, 0, count, lanes, tangent)


@allocating_entry_point
def push_lanes(begin, end, shots, times, inputs, results):
    """Computes the changes of shots `begin` to `end` - 1 by changes of their inputs.

    Args:
        begin: First shot.
        end: One past the last.
        shots: The `RecordedShots`, as a plain tuple.
        times: (m, q) float64, ascending, s; not later than the end of the shot.
        inputs: (m, k, 9 n + NUMBER_INPUTS) float64, the changes of the inputs.
        results: Two output arrays: (m, q, k, n, 7) float64, the changes of the outputs at these times;
            (m, k, l, 3) float64, the changes of time and place of the first l events, zero for events after the last of
            these times.
    """
    shots, (outputs, at_events) = RecordedShots(*shots), results
    is_sphere = shots.is_sphere
    n, count, most = outputs.shape[3], inputs.shape[1], at_events.shape[2]
    tape = empty_tape(begin, end, shots, count)
    tangent, lanes, pending = np.empty((n, count, BALL_WIDTH)), tape.lanes, 0
    for k in range(begin, end):
        arrays = scene_of(shots.scene, k)
        at, after = shots.bounds[k - shots.first], shots.bounds[k - shots.first + 1]
        log, paths, changes = shots.events[at[0] : after[0]], shots.segments[at[1] : after[1]], inputs[k]
        trace(log, paths, arrays, is_sphere, tape)
        begin_lanes(n, changes, times[k, -1], paths, arrays, tangent, tape)
        at_events[k] = 0.0
        done = 0
        for q in range(times.shape[1]):
            while done < len(log) and log[done, TIME] <= times[k, q]:
                balls = 2 if log[done, KIND] == BALL_BALL else 1
                for s in range(balls):
                    load(int(log[done, BALL + s]), s, count, changes, tangent, lanes)
                apply_event(done, count, log, paths, arrays, is_sphere, tape)
                for s in range(balls):
                    i = int(log[done, BALL + s])
                    store(i, s, count, lanes, tangent)
                    tape.current[i] = tape.first[done] + s
                if done < most:
                    for c in range(count):
                        for j in range(3):
                            at_events[k, c, done, j] = lanes[c, D_TIME + j]
                done += 1
                pending += count * (1 + _WORK * arrays.numbers.cushion_work)
                if pending > _LOOK_AFTER:
                    end_call(interrupted())
                    pending = 0
            for i in range(n):
                load(i, 0, count, changes, tangent, lanes)
                _apply_end(i, count, times[k, q], paths, arrays, tape)
                for c in range(count):
                    for j in range(BALL_WIDTH):
                        outputs[k, q, c, i, j] = lanes[c, j]


@inlined
def _ball_columns(at, phase, begin, count, motion, column):
    """Appends the columns of a ball that can change in a phase to the first `count` columns of the unit vectors.

    Args:
        at: The first column of the ball.
        phase: The phase.
        begin: The first of its columns to append; 2 leaves out the position.
        count: Number of columns so far.
        motion: `Numbers.motion`.
        column: `Tape.column`.

    Returns:
        The number of columns.
    """
    for j in range(begin, BALL_WIDTH):
        if j >= DUX and motion != SLIDING_AND_ROLLING:
            continue
        needed = REST
        if motion != IDEAL and j >= DVX:  # the first phase that has this column, see `settle_lane`
            needed = ROLLING if j < DUX else (SLIDING if j < DWZ else SPINNING)
        if phase >= needed:
            column[count] = at + j
            count += 1
    return count


@inlined
def _unit_lanes(balls, kind, count, constants, tape):
    """Sets the lanes to the unit vectors of `count` columns and, if `constants`, of the constants of an event.

    Returns their number.
    """
    column = tape.column
    if constants:
        for s in range(balls):
            column[count], column[count + 1] = D_RADIUS + s, D_INV_MASS + s
            count += 2
        begin, last = PAIR_NUMBERS if kind == BALL_BALL else CUSHION_NUMBERS
        for j in range(D_NUMBERS, END_NUMBERS):
            flies = FLIGHT_NUMBERS[0] <= j < FLIGHT_NUMBERS[1]
            if flies or (begin <= j < last and (kind in (BALL_BALL, BALL_CUSHION))):
                column[count] = j
                count += 1
    width = LANE_WIDTH if constants else balls * BALL_WIDTH  # the constants are zero otherwise
    for c in range(count):
        lane = tape.lanes[c]
        for j in range(width):
            lane[j] = 0.0
        lane[column[c]] = 1.0
    return count


@inlined
def _pull(count, i, other, begin, event, tape, adjoint, sums):
    """Multiplies adjoints by the lanes of one ball or of two.

    Args:
        count: Number of lanes.
        i: The first ball.
        other: The second ball; -1 for none.
        begin: The first column of the first ball that the lanes change.
        event: The `EventAdjoint` of the event.
        tape: The `Tape`.
        adjoint: (k, n, 7) float64, changed in place.
        sums: (k, 9 n + NUMBER_INPUTS) float64; the parts of the constants are added.
    """
    lanes, column, pulled, n = tape.lanes, tape.column, tape.pulled, adjoint.shape[1]
    for k in range(len(adjoint)):
        a, b = adjoint[k, i], adjoint[k, max(other, 0)]
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
            pulled[c] = total
        for j in range(begin, BALL_WIDTH):
            a[j] = 0.0
        if other >= 0:
            for j in range(BALL_WIDTH):
                b[j] = 0.0
        for c in range(count):
            at = column[c]
            if at < BALL_WIDTH:
                a[at] = pulled[c]
            elif at < D_RADIUS:
                b[at - BALL_WIDTH] = pulled[c]
            elif at < D_INV_MASS:
                sums[k, BALL_INPUTS * (i if at == D_RADIUS else other) + 7] += pulled[c]
            elif at < D_NUMBERS:
                sums[k, BALL_INPUTS * (i if at == D_INV_MASS else other) + 8] += pulled[c]
            else:
                sums[k, BALL_INPUTS * n + at - D_NUMBERS] += pulled[c]


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


@allocating_entry_point
def pull_lanes(begin, end, shots, times, outputs, at_events, constants, inputs):
    """Computes the products of adjoints of the outputs of shots `begin` to `end` - 1 with their Jacobians.

    Args:
        begin: First shot.
        end: One past the last.
        shots: The `RecordedShots`, as a plain tuple.
        times: (m,) float64, s, the times of the outputs.
        outputs: (m, k, n, 7) float64, the adjoints of the outputs. This function changes them.
        at_events: (m, k, l, 3) float64, the adjoints of time and place of the first l events.
        constants: Whether to compute the products for radii, masses and numbers. Otherwise they are zero.
        inputs: (m, k, 9 n + NUMBER_INPUTS) float64 out, the products.
    """
    shots = RecordedShots(*shots)
    is_sphere = shots.is_sphere
    n, count, most = outputs.shape[2], outputs.shape[1], at_events.shape[2]
    tape = empty_tape(begin, end, shots, MOST_LANES)
    at_event, pending = np.zeros((count, 3)), 0
    tape.lanes[:] = 0.0
    for k in range(begin, end):
        arrays = scene_of(shots.scene, k)
        at, after = shots.bounds[k - shots.first], shots.bounds[k - shots.first + 1]
        log, paths = shots.events[at[0] : after[0]], shots.segments[at[1] : after[1]]
        motion, adjoint, sums = arrays.numbers.motion, outputs[k], inputs[k]
        trace(log, paths, arrays, is_sphere, tape)
        sums[:] = 0.0
        for i in range(n):
            tape.current[i] = i
        done = 0
        while done < len(log) and log[done, TIME] <= times[k]:
            for s in range(2 if log[done, KIND] == BALL_BALL else 1):
                tape.current[int(log[done, BALL + s])] = tape.first[done] + s
            done += 1
        for i in range(n):
            if not _is_zero(i, adjoint):
                phase = _phase_until(tape.current[i], times[k], paths)
                lanes = _ball_columns(0, phase, DVX, 0, motion, tape.column)
                lanes = _unit_lanes(1, -1, lanes, constants, tape)
                _apply_end(i, lanes, times[k], paths, arrays, tape)
                _pull(lanes, i, -1, DVX, EventAdjoint(at_event, False), tape, adjoint, sums)
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
            piece, begin_at = tape.first[e], 0 if kind <= BALL_POCKET or marked else DVX
            lanes = _ball_columns(0, _phase_before(piece, paths, tape), begin_at, 0, motion, tape.column)
            if j >= 0:
                phase = _phase_before(piece + 1, paths, tape)
                lanes = _ball_columns(BALL_WIDTH, phase, 0, lanes, motion, tape.column)
            lanes = _unit_lanes(1 if j < 0 else 2, kind, lanes, constants, tape)
            apply_event(e, lanes, log, paths, arrays, is_sphere, tape)
            _pull(lanes, i, j, begin_at, EventAdjoint(at_event, marked), tape, adjoint, sums)
            pending += lanes * (1 + _WORK * arrays.numbers.cushion_work)
            if pending > _LOOK_AFTER:
                end_call(interrupted())
                pending = 0
        for i in range(n):
            if not _is_zero(i, adjoint):
                phase = _phase_until(i, times[k], paths)
                lanes = _ball_columns(0, SLIDING if phase == ROLLING else phase, 0, 0, motion, tape.column)
                lanes = _unit_lanes(1, -1, lanes, constants, tape)
                _start(i, lanes, times[k], paths, arrays, tape.lanes)
                _pull(lanes, i, -1, 0, EventAdjoint(at_event, False), tape, adjoint, sums)
            for c in range(count):
                for d in range(BALL_WIDTH):
                    sums[c, BALL_INPUTS * i + d] = adjoint[c, i, d]
