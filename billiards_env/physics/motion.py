"""The motion of balls on the cloth: rows of numbers that follow the laws of `physics.laws.cloth`."""

from __future__ import annotations

from typing import Any, NamedTuple

from billiards_env.jit import inlined, kernel
from billiards_env.physics.elementary import norm
from billiards_env.physics.laws.cloth import NEAR, SLIP_RATE, drive, phase_of, roll_speed_near, spin_after
from billiards_env.physics.state import (
    AX,
    AY,
    LASTS,
    POTTED,
    ROLLING,
    SLIDING,
    SPINNING,
    T0,
    T0_LO,
    UX,
    UY,
    VX,
    VY,
    WIDTH,
    WZ,
    X,
    Y,
    ball_of,
    moves,
    own_time,
    since,
)


class Path(NamedTuple):
    """The motion r + v t + a t^2 / 2 of a point, or of one point relative to another, t seconds after a given time.

    Attributes:
        x: Position along x, m.
        y: The same along y.
        vx: Velocity along x, m/s.
        vy: The same along y.
        ax: Acceleration along x, m/s^2.
        ay: The same along y.
    """

    x: Any
    y: Any
    vx: Any
    vy: Any
    ax: Any
    ay: Any


@inlined
def path_of(state, i):
    """Returns the `Path` of ball i's centre from its own time."""
    s = state.rows[i]
    return Path(s[X], s[Y], s[VX], s[VY], s[AX], s[AY])


@inlined
def relative_to(path, x, y):
    """Returns a `Path` relative to the point (x, y), m."""
    return Path(path.x - x, path.y - y, path.vx, path.vy, path.ax, path.ay)


@inlined
def path_after(path, t):
    """Returns the `Path` from t seconds later on."""
    x, y, vx, vy, ax, ay = path
    return Path(x + t * (vx + 0.5 * t * ax), y + t * (vy + 0.5 * t * ay), vx + t * ax, vy + t * ay, ax, ay)


@inlined
def difference(a, b):
    """Returns the `Path` of one point relative to another."""
    return Path(a.x - b.x, a.y - b.y, a.vx - b.vx, a.vy - b.vy, a.ax - b.ax, a.ay - b.ay)


@inlined
def place_after(path, t):
    """Returns the position (x, y) of a `Path` after t seconds, m."""
    return path.x + t * (path.vx + 0.5 * t * path.ax), path.y + t * (path.vy + 0.5 * t * path.ay)


@inlined
def begin_phase(state, i, numbers):  # out: state
    """Sets ball i's phase, AX, AY and LASTS from its velocity, slip and spin.

    Args:
        state: The `State`.
        i: The ball. A potted ball does not change.
        numbers: The `Numbers`.
    """
    phase = state.phase
    if phase[i] == POTTED:
        return
    s = state.rows[i]
    ball = ball_of(s)
    phase[i] = phase_of(ball, numbers)
    s[AX], s[AY], s[LASTS] = drive(ball, phase[i], numbers)


@kernel
def motion_after(state, i, t):
    """Returns the position and velocity (x, y, vx, vy) of ball i, t seconds after its own time."""
    s = state.rows[i]
    if moves(state, i):
        return (
            s[X] + t * (s[VX] + 0.5 * t * s[AX]),
            s[Y] + t * (s[VY] + 0.5 * t * s[AY]),
            s[VX] + t * s[AX],
            s[VY] + t * s[AY],
        )
    return s[X], s[Y], 0.0, 0.0


@inlined
def slip_after(state, i, t):
    """Returns the slip (ux, uy) of ball i, t seconds after its own time."""
    s = state.rows[i]
    if state.phase[i] == SLIDING:
        return s[UX] + SLIP_RATE * t * s[AX], s[UY] + SLIP_RATE * t * s[AY]
    return s[UX], s[UY]


@inlined
def move(state, i, t, numbers):  # out: state
    """Moves ball i's row by t seconds, forwards or back, within its phase. Its own time does not change."""
    s = state.rows[i]
    x, y, vx, vy = motion_after(state, i, t)
    s[UX], s[UY] = slip_after(state, i, t)
    s[X], s[Y], s[VX], s[VY] = x, y, vx, vy
    if s[WZ] != 0.0:
        s[WZ] = spin_after(s[WZ], t, numbers)
    s[LASTS] -= t


@inlined
def advance(state, i, time, numbers):  # out: state
    """Advances ball i's row to a `Time` within its phase."""
    s = state.rows[i]
    t = since(time, own_time(state, i))
    if t > 0.0:
        move(state, i, t, numbers)
    s[T0], s[T0_LO] = time.hi, time.lo


@inlined
def end_phase(state, i, time, numbers):  # out: state
    """Ends ball i's phase at a `Time`: its slip, velocity or spin becomes exactly zero.

    If only the rolling resistance changes, the ball continues with one of `cloth.ROLL_SPEEDS`, exact up to rounding.
    `begin_phase` then sets the next phase.
    """
    advance(state, i, time, numbers)
    s = state.rows[i]
    if state.phase[i] == SLIDING:
        s[UX] = s[UY] = 0.0
    elif state.phase[i] == ROLLING:
        speed = norm(s[VX], s[VY])
        left = roll_speed_near(speed, NEAR * speed, numbers)
        share = left / speed if left > 0.0 else 0.0
        s[VX], s[VY] = (share * s[VX], share * s[VY]) if share > 0.0 else (0.0, 0.0)
    elif state.phase[i] == SPINNING:
        s[WZ] = 0.0


@kernel
def capture(state, i, x, y):  # out: state
    """Takes ball i out of play and moves it to the centre (x, y) of a pocket, m."""
    s = state.rows[i]
    for c in (VX, VY, AX, AY, UX, UY, WZ):
        s[c] = 0.0
    for c in range(WIDTH, len(s)):
        s[c] = 0.0
    s[X], s[Y] = x, y
    state.phase[i] = POTTED
