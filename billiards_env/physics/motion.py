"""The law of motion: how a ball moves between two events.

In every phase the position is quadratic in time, r(t) = r0 + v0 t + a t^2 / 2:

* sliding: the point that touches the cloth moves at u = v + R z x omega. Friction a = -mu_s g u/|u| keeps its
  direction, and du/dt = 7/2 a, so the phase lasts 2 |u| / (7 mu_s g) (Marlow 1995, The Physics of Pocket Billiards).
* rolling: u = 0 and a = -mu_r g v/|v|, so the phase lasts |v| / (mu_r g).
* free: a = 0, and the phase has no end.
* spinning and at rest: v = 0.

The spin about the vertical axis decays linearly to zero in every phase, independently of the rest.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from billiards_env.jit import inlined, kernel
from billiards_env.physics.state import (
    AX,
    AY,
    FREE,
    IDEAL,
    LASTS,
    POTTED,
    REST,
    ROLLING,
    SLIDING,
    SLIDING_AND_ROLLING,
    SPINNING,
    T0,
    T0_LO,
    UX,
    UY,
    VX,
    VY,
    WZ,
    X,
    Y,
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
def place_after(path, t):
    """Returns the position (x, y) of a `Path` after t seconds, m."""
    return path.x + t * (path.vx + 0.5 * t * path.ax), path.y + t * (path.vy + 0.5 * t * path.ay)


@kernel
def norm(x: float, y: float) -> float:
    """Returns the length of (x, y). It is correct even if the squares underflow."""
    big = max(abs(x), abs(y))
    if big > 1e-140:
        return math.sqrt(x * x + y * y)
    if big == 0.0:
        return 0.0
    return big * math.sqrt((x / big) * (x / big) + (y / big) * (y / big))


@inlined
def begin_phase(state, i, numbers):
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
    v = norm(s[VX], s[VY])
    s[AX] = s[AY] = 0.0
    s[LASTS] = math.inf
    if numbers.motion == IDEAL:
        phase[i] = FREE if v > 0.0 else REST
        return
    if numbers.motion == SLIDING_AND_ROLLING:
        u = norm(s[UX], s[UY])
        if u > 0.0:
            phase[i] = SLIDING
            s[AX] = -numbers.slide * (s[UX] / u)
            s[AY] = -numbers.slide * (s[UY] / u)
            s[LASTS] = u / (3.5 * numbers.slide)
            return
    if v > 0.0:
        phase[i] = ROLLING
        s[AX] = -numbers.roll * (s[VX] / v)
        s[AY] = -numbers.roll * (s[VY] / v)
        s[LASTS] = v / numbers.roll
    elif s[WZ] != 0.0:
        phase[i] = SPINNING
        s[LASTS] = abs(s[WZ]) / numbers.spin_decay
    else:
        phase[i] = REST


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


@kernel
def spin_after(wz, t, numbers):
    """Returns the spin about the vertical axis after t seconds, rad/s."""
    left = abs(wz) - numbers.spin_decay * t
    return math.copysign(left, wz) if left > 0.0 else 0.0


@inlined
def advance(state, i, time, numbers):
    """Advances ball i's row to a `Time` within its phase."""
    s = state.rows[i]
    t = since(time, own_time(state, i))
    if t > 0.0:
        x, y, vx, vy = motion_after(state, i, t)
        if state.phase[i] == SLIDING:
            s[UX] += 3.5 * t * s[AX]
            s[UY] += 3.5 * t * s[AY]
        s[X], s[Y], s[VX], s[VY] = x, y, vx, vy
        if s[WZ] != 0.0:
            s[WZ] = spin_after(s[WZ], t, numbers)
        s[LASTS] -= t
    s[T0], s[T0_LO] = time.hi, time.lo


@inlined
def end_phase(state, i, time, numbers):
    """Ends ball i's phase at a `Time`: its slip, velocity or spin becomes exactly zero.

    `begin_phase` then sets the next phase.
    """
    advance(state, i, time, numbers)
    s = state.rows[i]
    if state.phase[i] == SLIDING:
        s[UX] = s[UY] = 0.0
    elif state.phase[i] == ROLLING:
        s[VX] = s[VY] = 0.0
    elif state.phase[i] == SPINNING:
        s[WZ] = 0.0


@kernel
def capture(state, i, x, y):
    """Takes ball i out of play and moves it to the centre (x, y) of a pocket, m."""
    s = state.rows[i]
    for c in (VX, VY, AX, AY, UX, UY, WZ):
        s[c] = 0.0
    s[X], s[Y] = x, y
    state.phase[i] = POTTED
