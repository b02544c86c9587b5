"""Shots as arrays: an engine reads their starts and overwrites them with their ends."""

from __future__ import annotations

import functools
import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_env.engine.log import log_event
from billiards_env.engine.measures import measures_type
from billiards_env.jit import inlined
from billiards_env.physics.geometry.pockets import centre_of
from billiards_env.physics.motion import capture
from billiards_env.physics.state import (
    CUE_BALL,
    POTTED,
    REST,
    SLIDING_AND_ROLLING,
    SPIN_X,
    SPIN_Y,
    SPIN_Z,
    UX,
    UY,
    VX,
    VY,
    WZ,
    X,
    Y,
)

STATUS = ("rest", "max_time", "event_limit", "step_limit")
"""Names of the reasons for which a shot ends."""
AT_REST, AT_MAX_TIME, AT_EVENT_LIMIT, AT_STEP_LIMIT = 0, 1, 2, 3

HEIGHT, RISING = 0, 1  # columns of `Shots.heights`

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Int32s = NDArray[np.int32]
Int64s = NDArray[np.int64]


class Shots(NamedTuple):
    """m shots of n balls. The first six arrays hold the start of each shot; the engine replaces it by the end.

    Attributes:
        positions: (m, n, 2) float64, m.
        velocities: (m, n, 2) float64, m/s.
        spins: (m, n, 3) float64, rad/s.
        in_play: (m, n) bool: whether a ball is not in a pocket.
        cue: (m,) int64: the cue ball, which the cue strikes. The engine counts its contacts and does not change it.
        heights: (m, n, 2) float64, the height above the cloth, m, and the vertical velocity, m/s; None without flight.
        time: (m,) float64 out: duration, s.
        cushions: (m, n) int32 out: number of cushion contacts of each ball.
        cushions_before_hit: (m, n) int32 out: number of cushion contacts that the cue ball had when it first touched
            the ball, -1 if it did not touch it.
        n_events: (m,) int64 out: number of events.
        status: (m,) int64 out: index into `STATUS`.
        first_hit: (m,) int64 out: the ball that the cue ball touched first, -1 if none.
        n_contact_rule: (m,) int64 out: number of acts of the contact-time rule.
        pockets: (m, n) int32 out: the pocket in which the shot potted the ball, -1 for none.
        pot_order: (m, n) int32 out: the number of balls that went out of play in the shot before the ball did, -1 if
            it stayed. Balls that go at the same instant have the order of their numbers. A ball that goes without a
            pocket is driven off the table, which needs a flight.
        touched_first: (m, n) bool out: whether the cue ball touched the ball at the instant of its first contact.
        first_hit_time: (m,) float64 out: this instant, s; infinite without a contact.
        measures: (m,) out: the measures that are recorded, see `engine.measures`; None for none.
    """

    positions: Floats
    velocities: Floats
    spins: Floats
    in_play: Bools
    cue: Int64s
    heights: Floats | None
    time: Floats
    cushions: Int32s
    cushions_before_hit: Int32s
    n_events: Int64s
    status: Int64s
    first_hit: Int64s
    n_contact_rule: Int64s
    pockets: Int32s
    pot_order: Int32s
    touched_first: Bools
    first_hit_time: Floats
    measures: NDArray[np.void] | None


class Starts(NamedTuple):
    """The starts of m shots of n balls: the first six arrays of `Shots`."""

    positions: Floats
    velocities: Floats
    spins: Floats
    in_play: Bools
    cue: Int64s
    heights: Floats | None


def start_fields(shots: Any) -> tuple[Any, ...]:
    """Returns the fields of `Starts`, as a plain tuple, of a tuple that begins with them."""
    return shots[: len(Starts._fields)]


def arrays_in(memory: NDArray[np.uint8], kind: np.dtype[np.void]) -> list[NDArray[Any]]:
    """Returns the arrays (m, ...) of the fields of m rows of a type, one after the other in a block of memory.

    The operating system provides one large block several times faster than its parts one by one: NumPy requests huge
    pages only for large blocks, and the C library returns the smaller ones to the system after each batch.
    """
    m, names, fields = len(memory) // kind.itemsize, kind.names or (), kind.fields or {}
    if m == 1:  # then the fields of a structured row take half the time
        row = np.ndarray(1, kind, memory)
        return [row[name] for name in names]
    places = map(fields.__getitem__, names)
    return [np.ndarray((m, *field.shape), field.base, memory, m * at) for field, at, *_ in places]


@functools.lru_cache(maxsize=64)
def row_type(n: int, flight: bool = False, measures: np.dtype[np.void] | None = None) -> np.dtype[np.void]:
    """Returns the type of a row of `Shots` of n balls. The fields that are None in `Shots` do not exist.

    `measures` is the result of `measures_type`.
    """
    whole, flags = ("i4", (n,)), ("?", (n,))
    start = (("f8", (n, 2)), ("f8", (n, 2)), ("f8", (n, 3)), flags, "i8", ("f8", (n, 2)))
    kinds = (*start, "f8", whole, whole, "i8", "i8", "i8", "i8", whole, whole, flags, "f8", measures)
    missing = {"heights": not flight, "measures": measures is None}
    fields = [field for field in zip(Shots._fields, kinds, strict=True) if not missing.get(field[0])]
    return np.dtype(fields, align=True)


def empty_shots(m: int, n: int, flight: bool = False, measures: tuple[str, ...] = ()) -> Shots:
    """Returns `Shots` for m shots of n balls. Ball 0 is the cue ball; the content of the other arrays is undefined."""
    kind = row_type(n, flight, measures_type(measures, n))
    arrays: list[Any] = arrays_in(np.empty(m * kind.itemsize, np.uint8), kind)
    if not flight:
        arrays.insert(Shots._fields.index("heights"), None)
    if not measures:
        arrays.append(None)
    shots = Shots(*arrays)
    shots.cue[:] = CUE_BALL
    return shots


@inlined
def load_balls(k, shots, scene, state):  # out: state
    """Copies the start of shot k of `Shots` or `Starts` to a `State`. `begin_phase` sets the phases."""
    slips = scene.numbers.motion == SLIDING_AND_ROLLING
    for i in range(len(state.phase)):
        s = state.rows[i]
        s[:] = 0.0
        s[X], s[Y] = shots.positions[k, i, X], shots.positions[k, i, Y]
        if not shots.in_play[k, i]:
            state.phase[i] = POTTED
            continue
        state.phase[i] = REST
        scene.space.load(k, i, shots, s)
        if slips:
            s[UX] = s[VX] - scene.radius[i] * shots.spins[k, i, SPIN_Y]
            s[UY] = s[VY] + scene.radius[i] * shots.spins[k, i, SPIN_X]
            s[WZ] = shots.spins[k, i, SPIN_Z]


@inlined
def load_shot(k, shots, scene, state):  # out: shots, state
    """Copies the start of shot k to a `State` and resets the counters of the shot."""
    load_balls(k, shots, scene, state)
    for i in range(len(state.phase)):
        shots.cushions[k, i], shots.cushions_before_hit[k, i] = 0, -1
        shots.pockets[k, i], shots.pot_order[k, i], shots.touched_first[k, i] = -1, -1, False
    shots.first_hit_time[k] = math.inf
    shots.n_events[k], shots.status[k], shots.first_hit[k], shots.n_contact_rule[k] = 0, AT_REST, -1, 0


@inlined
def store(k, shots, scene, state):  # out: shots
    """Copies a `State` to shot k of `Shots` or `Starts`."""
    slips = scene.numbers.motion == SLIDING_AND_ROLLING
    for i in range(len(state.phase)):
        s = state.rows[i]
        shots.positions[k, i, X], shots.positions[k, i, Y] = s[X], s[Y]
        scene.space.store(k, i, s, shots)
        shots.in_play[k, i] = state.phase[i] != POTTED
        if slips:
            shots.spins[k, i, SPIN_X] = (s[UY] - s[VY]) / scene.radius[i]
            shots.spins[k, i, SPIN_Y] = (s[VX] - s[UX]) / scene.radius[i]
            shots.spins[k, i, SPIN_Z] = s[WZ]


@inlined
def count_hit(k, i, j, now, shots):  # out: shots
    """Records an impact of balls i and j at a `Time`, if one of them is the cue ball."""
    cue = shots.cue[k]
    if i != cue and j != cue:
        return
    other = i + j - cue
    if shots.first_hit[k] < 0:
        shots.first_hit[k], shots.first_hit_time[k] = other, now.hi
    if shots.cushions_before_hit[k, other] < 0:
        shots.cushions_before_hit[k, other] = shots.cushions[k, cue]
        shots.touched_first[k, other] = now.hi == shots.first_hit_time[k]


@inlined
def record_event(event, now, k, state, shots, log):  # out: shots, log
    """Counts and logs an event of shot k at a `Time`, which is then the time of the shot.

    `event` is its kind, its ball, the other ball or wall or pocket or -1, and the speed, see `log.log_event`.
    """
    kind, i, other, speed = event
    shots.n_events[k] += 1
    shots.time[k] = now.hi
    log_event(log, now, kind, i, other, state, speed, False)


@inlined
def pot(k, i, pocket, state, scene, shots):  # out: state, shots
    """Moves ball i to the centre of a pocket, where it stays, and records this."""
    capture(state, i, *centre_of(scene.pockets[pocket]))
    shots.pockets[k, i], shots.pot_order[k, i] = pocket, _balls_off(k, shots)


@inlined
def drive_off(k, i, state, scene, shots):  # out: state, shots
    """Takes ball i, which is driven off the table, out of play, and records this.

    It is put on the cushion, beside the nearest edge of the playing surface, where no ball in play can be.
    """
    length, width = scene.numbers.half_length, scene.numbers.half_width
    x, y = min(max(state.rows[i, X], -length), length), min(max(state.rows[i, Y], -width), width)
    if length - abs(x) <= width - abs(y):
        x = math.copysign(length + scene.radius[i], x)
    else:
        y = math.copysign(width + scene.radius[i], y)
    capture(state, i, x, y)
    shots.pot_order[k, i] = _balls_off(k, shots)


@inlined
def _balls_off(k, shots):
    """Returns the number of balls that have gone out of play in shot k."""
    count = 0
    for j in range(shots.pot_order.shape[1]):
        if shots.pot_order[k, j] >= 0:
            count += 1
    return count


@inlined
def end_at(time, k, state, scene, shots, status):  # out: state, shots
    """Advances the balls that are not at rest to a `Time`. If there is such a ball, shot k ends then with a status."""
    for i in range(len(state.phase)):
        if state.phase[i] != POTTED and state.phase[i] != REST:
            shots.status[k], shots.time[k] = status, time.hi
            scene.space.advance(state, i, time, scene.numbers)
