"""The motion of a ball on the cloth between two events.

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

from billiards_env.jit import inlined
from billiards_env.physics.elementary import norm
from billiards_env.physics.state import (
    FREE,
    IDEAL,
    REST,
    ROLLING,
    SLIDING,
    SLIDING_AND_ROLLING,
    SPINNING,
    BallState,
)

SLIP_RATE = 3.5
"""While a ball slides, its slip changes at this multiple of its acceleration."""


@inlined
def phase_of(ball, numbers):
    """Returns the phase that a `BallState` begins."""
    moves = ball.vx != 0.0 or ball.vy != 0.0
    if numbers.motion == IDEAL:
        return FREE if moves else REST
    if numbers.motion == SLIDING_AND_ROLLING and (ball.ux != 0.0 or ball.uy != 0.0):
        return SLIDING
    if moves:
        return ROLLING
    return SPINNING if ball.wz != 0.0 else REST


@inlined
def drive(ball, phase, numbers):
    """Returns the acceleration (ax, ay), m/s^2, and the duration, s, of a phase that begins with a `BallState`."""
    if phase == SLIDING:
        u = norm(ball.ux, ball.uy)
        return -numbers.slide * (ball.ux / u), -numbers.slide * (ball.uy / u), u / (SLIP_RATE * numbers.slide)
    if phase == ROLLING:
        v = norm(ball.vx, ball.vy)
        return -numbers.roll * (ball.vx / v), -numbers.roll * (ball.vy / v), v / numbers.roll
    if phase == SPINNING:
        return 0.0, 0.0, abs(ball.wz) / numbers.spin_decay
    return 0.0, 0.0, math.inf


@inlined
def spin_after(wz, t, numbers):
    """Returns the spin about the vertical axis after t seconds, rad/s."""
    left = abs(wz) - numbers.spin_decay * t
    if left >= 0.0:
        return left if wz >= 0.0 else 0.0 - left
    return 0.0


@inlined
def coast(ball, acceleration, phase, t, numbers):
    """Returns the `BallState` t seconds after another one, within a phase with an acceleration (x, y), m/s^2."""
    ax, ay = acceleration
    turns = SLIP_RATE if phase == SLIDING else 0.0
    if phase == SPINNING:  # until its end, up to rounding
        wz = ball.wz - (numbers.spin_decay if ball.wz >= 0.0 else -numbers.spin_decay) * t
    else:
        wz = spin_after(ball.wz, t, numbers)
    return BallState(
        ball.x + t * (ball.vx + 0.5 * t * ax),
        ball.y + t * (ball.vy + 0.5 * t * ay),
        ball.vx + t * ax,
        ball.vy + t * ay,
        ball.ux + turns * t * ax,
        ball.uy + turns * t * ay,
        wz,
    )


@inlined
def fly(ball, phase, t, numbers):
    """Returns the `BallState` t seconds after another one, within a phase that begins there."""
    ax, ay, _ = drive(ball, phase, numbers)
    return coast(ball, (ax, ay), phase, t, numbers)


@inlined
def slip_of(vx, vy, wx, wy, radius):
    """Returns the slip u = v + R z x omega of a ball, m/s."""
    return vx - radius * wy, vy + radius * wx


@inlined
def spin_of(vx, vy, ux, uy, radius):
    """Returns the horizontal spin (wx, wy) of a ball with a slip, rad/s; see `slip_of`."""
    return (uy - vy) / radius, (vx - ux) / radius
