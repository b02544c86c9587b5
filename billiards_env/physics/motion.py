"""The law of motion: what a ball does between two events.

Every phase is quadratic in time, r(t) = r0 + v0 t + a t^2 / 2:

* sliding: the point that touches the cloth moves at u = v + R z x omega; friction a = -mu_s g u/|u| keeps its
  direction, and du/dt = 7/2 a, so the slide lasts 2 |u| / (7 mu_s g) (Marlow 1995, The Physics of Pocket Billiards);
* rolling: u = 0 and a = -mu_r g v/|v|, for |v| / (mu_r g);
* free: a = 0, for ever;
* spinning and at rest: v = 0.

The spin about the vertical axis decays linearly to zero in every phase, by itself.
"""

from __future__ import annotations

import math

from billiards_env.physics.jit import inlined, kernel
from billiards_env.physics.state import (
    AX,
    AY,
    FREE,
    IDEAL,
    LASTS,
    MOTION,
    POTTED,
    REST,
    ROLL,
    ROLLING,
    SLIDE,
    SLIDING,
    SLIDING_AND_ROLLING,
    SPIN_DECAY,
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
    since,
)


@kernel
def norm(x: float, y: float) -> float:
    """Length of (x, y), also where the squares would underflow."""
    big = max(abs(x), abs(y))
    if big > 1e-140:
        return math.sqrt(x * x + y * y)
    if big == 0.0:
        return 0.0
    return big * math.sqrt((x / big) * (x / big) + (y / big) * (y / big))


@inlined
def start(state, phase, i, params):
    """Settles which phase ball i is in from its velocity, slip and spin, and what follows from it: AX, AY and LASTS.

    Args:
        state: (n, WIDTH) float64.
        phase: (n,) int8.
        i: The ball; a potted one stays as it is.
        params: (N_PARAMS,) float64.
    """
    if phase[i] == POTTED:
        return
    s = state[i]
    v = norm(s[VX], s[VY])
    s[AX] = s[AY] = 0.0
    s[LASTS] = math.inf
    if params[MOTION] == IDEAL:
        phase[i] = FREE if v > 0.0 else REST
        return
    if params[MOTION] == SLIDING_AND_ROLLING:
        u = norm(s[UX], s[UY])
        if u > 0.0:
            phase[i] = SLIDING
            s[AX] = -params[SLIDE] * (s[UX] / u)
            s[AY] = -params[SLIDE] * (s[UY] / u)
            s[LASTS] = u / (3.5 * params[SLIDE])
            return
    if v > 0.0:
        phase[i] = ROLLING
        s[AX] = -params[ROLL] * (s[VX] / v)
        s[AY] = -params[ROLL] * (s[VY] / v)
        s[LASTS] = v / params[ROLL]
    elif s[WZ] != 0.0:
        phase[i] = SPINNING
        s[LASTS] = abs(s[WZ]) / params[SPIN_DECAY]
    else:
        phase[i] = REST


@kernel
def place(state, phase, i, t):
    """Position and velocity (x, y, vx, vy) of ball i, t seconds after its T0."""
    s = state[i]
    if phase[i] >= ROLLING and phase[i] != POTTED:
        return (
            s[X] + t * (s[VX] + 0.5 * t * s[AX]),
            s[Y] + t * (s[VY] + 0.5 * t * s[AY]),
            s[VX] + t * s[AX],
            s[VY] + t * s[AY],
        )
    return s[X], s[Y], 0.0, 0.0


@kernel
def spin_after(wz, t, params):
    """The spin about the vertical axis after t seconds, rad/s."""
    left = abs(wz) - params[SPIN_DECAY] * t
    return math.copysign(left, wz) if left > 0.0 else 0.0


@kernel
def move(state, phase, i, hi, lo, params):
    """Brings ball i's row to the time (hi, lo), within its phase."""
    s = state[i]
    t = since(hi, lo, s[T0], s[T0_LO])
    if t > 0.0:
        x, y, vx, vy = place(state, phase, i, t)
        if phase[i] == SLIDING:
            s[UX] += 3.5 * t * s[AX]
            s[UY] += 3.5 * t * s[AY]
        s[X], s[Y], s[VX], s[VY] = x, y, vx, vy
        if s[WZ] != 0.0:
            s[WZ] = spin_after(s[WZ], t, params)
        s[LASTS] -= t
    s[T0], s[T0_LO] = hi, lo


@inlined
def end_phase(state, phase, i, hi, lo, params):
    """Ends ball i's phase at (hi, lo), when it has run its course: slip, velocity or spin is exactly zero then.

    What phase follows is for `start` to settle.
    """
    move(state, phase, i, hi, lo, params)
    s = state[i]
    if phase[i] == SLIDING:
        s[UX] = s[UY] = 0.0
    elif phase[i] == ROLLING:
        s[VX] = s[VY] = 0.0
    elif phase[i] == SPINNING:
        s[WZ] = 0.0


@kernel
def finish(state, phase, i, hi, lo, params):
    """Ends ball i's phase at (hi, lo) as `end_phase` does, and settles the next."""
    end_phase(state, phase, i, hi, lo, params)
    start(state, phase, i, params)


@kernel
def capture(state, phase, i, x, y):
    """Takes ball i out of play, to the centre (x, y) of a pocket."""
    s = state[i]
    for c in (VX, VY, AX, AY, UX, UY, WZ):
        s[c] = 0.0
    s[X], s[Y] = x, y
    phase[i] = POTTED
