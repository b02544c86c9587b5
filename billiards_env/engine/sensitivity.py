"""How a shot's end depends on its beginning: the derivative of the flow, carried through flights and events.

Each ball has a tangent, the derivative of its state (x, y, vx, vy, ux, uy, wz) at a fixed time by the initial positions
and velocities of all balls. A flight changes it by the derivative of the law of motion, an event by the saltation
matrix (Aizerman and Gantmakher 1958; Leine and Nijmeijer 2004, section 7.5): the tangent is carried to the perturbed
instant of the event, through the derivative of the jump there, and back to the fixed time.

Nothing of this runs unless it is asked for; it reads what a recorded shot has logged.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_env.engine.log import BALL_BALL, BALL_CUSHION, BALL_POCKET, ROLLING_REST, SLIDING_ROLLING
from billiards_env.physics import state as layout
from billiards_env.physics.state import (
    CUSHION,
    CUSHION_HEIGHT,
    E_BALL,
    E_CUSHION,
    HAN2005,
    MOTION,
    MU_CUSHION,
    POTTED,
    ROLL,
    ROLLING,
    SLIDE,
    SLIDING,
    SLIDING_AND_ROLLING,
    SPIN_DECAY,
)

Floats = NDArray[np.float64]

UNIT_ROUNDOFF = 2.0**-53

# The tangent's rows.
_R, _V, _U, _WZ = slice(0, 2), slice(2, 4), slice(4, 6), 6
_SIZE = 7
# The columns of a state row in that order.
_COLUMNS = [layout.X, layout.Y, layout.VX, layout.VY, layout.UX, layout.UY, layout.WZ]


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Sensitivity:
    """The derivative of a shot's positions by where it began.

    Attributes:
        jacobian: (n, 2, n, 4) float64: of ball i's position by ball j's initial (x, y, vx, vy), the spins held.
        time: The time it is taken at, s.
        smooth: Whether the positions depend smoothly on the beginning up to that time. They do not where several
            balls meet at one instant or where the contact-time rule acts: the jacobian then counts each impact for
            itself and leaves the rule out.
        condition: By how much, in metres, the positions can be off for each unit of relative error of the inputs: the
            largest 2-norm, over the balls, of the jacobian with its columns times the size of the input that they
            belong to. Times `UNIT_ROUNDOFF` it is the error that no double-precision engine can avoid.
    """

    jacobian: Floats
    time: float
    smooth: bool
    condition: float


class _Ball(NamedTuple):
    """A ball's row of the trajectory log with the tangent there."""

    row: Floats
    phase: int
    tangent: Floats


def sensitivity_along(
    segments: Floats, events: Floats, arrays: tuple[Floats, Floats, Floats, Floats], times: Floats
) -> Iterator[Sensitivity]:
    """The sensitivity of a recorded shot at each of some times.

    Args:
        segments: (k, SEGMENT_WIDTH) the trajectory log, see `engine.log`.
        events: (l, EVENT_WIDTH) the event log.
        arrays: The scene, from `shot.scene_arrays`.
        times: Ascending, s.

    Yields:
        One sensitivity a time; an event at just that time counts as past.
    """
    params, radius, inv_mass, pockets = arrays
    n = len(radius)
    balls: list[_Ball] = []
    scale = np.empty((n, 4))
    for i in range(n):
        row = segments[i, 2:]
        tangent = np.zeros((_SIZE, n, 4))
        if int(segments[i, 1]) != POTTED:
            for k in range(4):
                tangent[k, i, k] = 1.0
            if params[MOTION] == SLIDING_AND_ROLLING:
                tangent[4, i, 2] = tangent[5, i, 3] = 1.0  # slip = velocity + what the spin makes of it
        scale[i] = np.abs(row[_COLUMNS[:4]])
        balls.append(_Ball(row, int(segments[i, 1]), tangent.reshape(_SIZE, -1)))
    smooth = True
    used, previous = n, math.nan
    event = 0
    for time in times:
        while event < len(events) and events[event, 0] <= time:
            hi, lo, kind, a, b = events[event, :5]
            a, b, kind = int(a), int(b), int(kind)
            acts = bool(events[event, 8])
            smooth = smooth and not acts and not (kind == BALL_BALL and hi == previous)
            previous = hi if kind == BALL_BALL else previous
            row = segments[used, 2:]
            if kind == BALL_BALL:
                before = [_fly(balls[k], hi, lo, params) for k in (a, b)]
                after = [
                    _Ball(segments[used + m, 2:], int(segments[used + m, 1]), ball.tangent)
                    for m, ball in enumerate(before)
                ]
                balls[a], balls[b] = _impact(before, after, inv_mass[[a, b]], params)
                used += 2
            else:
                before = _fly(balls[a], hi, lo, params)
                balls[a] = _alone(
                    before, _Ball(row, int(segments[used, 1]), before.tangent), kind, b, radius[a], params, pockets
                )
                used += 1
            event += 1
        jacobian = np.stack([_fly(ball, float(time), 0.0, params).tangent[_R] for ball in balls]).reshape(n, 2, n, 4)
        scaled = (jacobian * scale).reshape(n, 2, -1)
        yield Sensitivity(jacobian, float(time), smooth, float(np.linalg.norm(scaled, 2, axis=(1, 2)).max()))


def _rate(ball: _Ball, params: Floats) -> Floats:
    """Time derivative of (x, y, vx, vy, ux, uy, wz), (7,)."""
    rate = np.zeros(_SIZE)
    if ROLLING <= ball.phase < POTTED:
        acceleration = ball.row[[layout.AX, layout.AY]]
        rate[_R] = ball.row[[layout.VX, layout.VY]]
        rate[_V] = acceleration
        if ball.phase == SLIDING:
            rate[_U] = 3.5 * acceleration
    rate[_WZ] = -math.copysign(params[SPIN_DECAY], ball.row[layout.WZ]) if ball.row[layout.WZ] else 0.0
    return rate


def _fly(ball: _Ball, hi: float, lo: float, params: Floats) -> _Ball:
    """The ball, and its tangent, at the time (hi, lo), in the phase that it is in."""
    dt = (hi - ball.row[layout.T0]) + (lo - ball.row[layout.T0_LO])
    row, tangent = ball.row.copy(), ball.tangent.copy()
    row[layout.T0], row[layout.T0_LO] = hi, lo
    if ROLLING <= ball.phase < POTTED:
        acceleration = row[[layout.AX, layout.AY]]
        velocity = row[[layout.VX, layout.VY]]
        row[[layout.X, layout.Y]] += dt * (velocity + 0.5 * dt * acceleration)
        row[[layout.VX, layout.VY]] += dt * acceleration
        d_acceleration = 0.0
        if ball.phase == SLIDING:
            d_acceleration = -params[SLIDE] * _d_unit(row[[layout.UX, layout.UY]]) @ tangent[_U]
            row[[layout.UX, layout.UY]] += 3.5 * dt * acceleration
            tangent[_U] += 3.5 * dt * d_acceleration
        elif ball.phase == ROLLING:
            d_acceleration = -params[ROLL] * _d_unit(velocity) @ tangent[_V]
        tangent[_R] += dt * (tangent[_V] + 0.5 * dt * d_acceleration)
        tangent[_V] += dt * d_acceleration
    spin = row[layout.WZ]
    if spin:
        left = abs(spin) - params[SPIN_DECAY] * dt
        row[layout.WZ] = math.copysign(max(left, 0.0), spin)
        if left <= 0.0:
            tangent[_WZ] = 0.0
    return _Ball(row, ball.phase, tangent)


def _d_unit(vector: Floats) -> Floats:
    """Derivative of v/|v|, (2, 2)."""
    size = math.hypot(*vector)
    unit = vector / size
    return (np.eye(2) - np.outer(unit, unit)) / size


def _impact(before: list[_Ball], after: list[_Ball], inv_mass: Floats, params: Floats) -> tuple[_Ball, _Ball]:
    """Two balls' tangents after their impact along the line of centres."""
    first, second = before
    d = second.row[[layout.X, layout.Y]] - first.row[[layout.X, layout.Y]]
    w = second.row[[layout.VX, layout.VY]] - first.row[[layout.VX, layout.VY]]
    distance = math.hypot(*d)
    n = d / distance
    closing = float(n @ w)
    # The instant shifts so that the gap stays zero.
    shift = -(n @ (second.tangent[_R] - first.tangent[_R])) / closing if closing else np.zeros(first.tangent.shape[1])
    first_at, second_at = (ball.tangent + np.outer(_rate(ball, params), shift) for ball in before)
    d_d, d_w = second_at[_R] - first_at[_R], second_at[_V] - first_at[_V]
    d_n = (d_d - np.outer(n, n @ d_d)) / distance
    gain = (1.0 + params[E_BALL]) / inv_mass.sum()
    d_impulse = gain * (np.outer(n, w @ d_n + n @ d_w) + closing * d_n)
    tangents = []
    for tangent, ball, sign, inverse in (
        (first_at, after[0], 1.0, inv_mass[0]),
        (second_at, after[1], -1.0, inv_mass[1]),
    ):
        tangent[_V] += sign * inverse * d_impulse
        if params[MOTION] == SLIDING_AND_ROLLING:
            tangent[_U] += sign * inverse * d_impulse
        tangents.append(_Ball(ball.row, ball.phase, tangent - np.outer(_rate(ball, params), shift)))
    return tangents[0], tangents[1]


def _alone(before: _Ball, after: _Ball, kind: int, other: int, radius: float, params: Floats, pockets: Floats) -> _Ball:
    """A ball's tangent after a cushion, a pocket or a change of phase."""
    row, tangent = before.row, before.tangent
    v, u = row[[layout.VX, layout.VY]], row[[layout.UX, layout.UY]]
    if kind == BALL_POCKET:  # it stays at the pocket's centre, wherever it fell in
        return _Ball(after.row, after.phase, np.zeros_like(tangent))
    if kind == BALL_CUSHION:
        axis = 0 if other < 2 else 1
        shift = -tangent[axis] / v[axis] if v[axis] else np.zeros(tangent.shape[1])
    elif kind == SLIDING_ROLLING:
        # |u| falls at 7/2 mu_s g; at its end only its direction at the start of the slide is left to go by.
        direction = -row[[layout.AX, layout.AY]] / params[SLIDE]
        shift = direction @ tangent[_U] / (3.5 * params[SLIDE])
    elif kind == ROLLING_REST:
        direction = -row[[layout.AX, layout.AY]] / params[ROLL]
        shift = direction @ tangent[_V] / params[ROLL]
    else:
        shift = np.zeros(tangent.shape[1])
    at = tangent + np.outer(_rate(before, params), shift)
    if kind == BALL_CUSHION:
        at = _cushion_jump(v, u, float(row[layout.WZ]), other, radius, params) @ at
    elif kind == SLIDING_ROLLING:
        at[_U] = 0.0
    elif kind == ROLLING_REST:
        at[_V] = 0.0
    else:
        at[_WZ] = 0.0
    return _Ball(after.row, after.phase, at - np.outer(_rate(after, params), shift))


def _cushion_jump(v: Floats, u: Floats, wz: float, side: int, radius: float, params: Floats) -> Floats:
    """Derivative of the state after a cushion by the state before, (7, 7); see `physics.impulse.han2005`."""
    jump = np.eye(_SIZE)
    n, t = (2, 3) if side < 2 else (3, 2)
    e = params[E_CUSHION]
    if params[CUSHION] != HAN2005:
        jump[n, n] = -e
        if params[MOTION] == SLIDING_AND_ROLLING:
            jump[n + 2, n] -= 1.0 + e
        return jump
    sign = 1.0 if side % 2 else -1.0
    turn = sign if side < 2 else -sign
    # To the cushion's frame: (vn, vt, un, ut, R wz), in which the jump is written.
    to = np.zeros((5, _SIZE))
    to[0, n] = to[2, n + 2] = sign
    to[1, t] = to[3, t + 2] = turn
    to[4, _WZ] = radius
    inputs = to @ np.concatenate((np.zeros(2), v, u, (wz,)))
    vn, vt, un, ut, rwz = np.eye(5)
    sin = params[CUSHION_HEIGHT] / radius - 1.0
    cos = math.sqrt(1.0 - sin * sin)
    d_slip = np.stack((vn * sin + vn - un, -vt - rwz * cos + (ut - vt) * sin))
    slip = d_slip @ inputs
    size = math.hypot(*slip)
    d_pze = (1.0 + e) * cos * vn
    pze = float(d_pze @ inputs)
    if size * (2.0 / 7.0) <= params[MU_CUSHION] * pze:
        d_friction = d_slip * (2.0 / 7.0)
    else:
        d_friction = params[MU_CUSHION] * (np.outer(slip / size, d_pze) + pze * _d_unit(slip) @ d_slip)
    px = -d_friction[0] * sin - d_pze * cos
    pz = d_friction[0] * cos - d_pze * sin
    vn_after = vn + px
    if float(vn_after @ inputs) > 0.0:
        vn_after = np.zeros(5)
    vt_after = vt + d_friction[1]
    rwn = ut - vt - 2.5 * d_friction[1] * sin
    rwt = vn - un + 2.5 * (px * sin - pz * cos)
    spin = rwz + 2.5 * d_friction[1] * cos
    after = np.stack((vn_after, vt_after, vn_after - rwt, vt_after + rwn, spin))
    back = np.linalg.pinv(to)
    return np.eye(_SIZE) - back @ to + back @ after @ to
