"""The derivative of a shot's positions with respect to its start, propagated through flights and events.

Each ball has a tangent: the derivative of its state (x, y, vx, vy, ux, uy, wz) at a fixed time with respect to the
initial positions, velocities and spins of all balls. A flight changes it by the derivative of the law of motion, an
event by the saltation matrix (Aizerman and Gantmakher 1958; Leine and Nijmeijer 2004, section 7.5): the tangent is
propagated to the time of the perturbed event, through the derivative of the jump there, and back to the fixed time.

The derivative is computed on demand, from the log of a recorded shot.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_env.engine.log import (
    BALL,
    BALL_BALL,
    BALL_CUSHION,
    BALL_POCKET,
    KIND,
    OTHER,
    ROLLING_REST,
    RULE,
    SLIDING_ROLLING,
    TIME,
    TIME_LO,
)
from billiards_env.engine.trajectory import Trajectory, position_after
from billiards_env.physics.cushion import cushion_restitution
from billiards_env.physics.friction import tilt_of
from billiards_env.physics.impact_derivatives import cushion_derivative, d_unit, friction_push, restitution_slope
from billiards_env.physics.state import (
    AX,
    AY,
    POTTED,
    ROLLING,
    SLIDING,
    SLIDING_AND_ROLLING,
    T0,
    T0_LO,
    UX,
    UY,
    VX,
    VY,
    WZ,
    Numbers,
    SceneArrays,
    Time,
    X,
    Y,
)
from billiards_env.physics.walls import NX, NY, TIP_RADIUS, TIP_X, TIP_Y, Outline

Floats = NDArray[np.float64]

UNIT_ROUNDOFF = 2.0**-53

# The tangent's rows.
_R, _V, _U, _WZ = slice(0, 2), slice(2, 4), slice(4, 6), 6
_SIZE = 7
_INPUTS = 7  # x, y, vx, vy, wx, wy, wz
# The columns of a state row in the order of the tangent's rows.
_COLUMNS = [X, Y, VX, VY, UX, UY, WZ]


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Sensitivity:
    """The derivative of a shot's positions with respect to its start.

    Attributes:
        jacobian: (n, 2, n, 7) float64: of ball i's position with respect to ball j's initial (x, y, vx, vy, wx, wy,
            wz), in m, m/s and rad/s.
        time: The time of the positions, s.
        smooth: Whether the positions depend smoothly on the start up to that time. They do not if several balls meet
            at one instant or the contact-time rule acts. The jacobian then treats impacts at one instant as
            successive, and neglects the rule.
        condition: Largest error of a position, m, per unit of relative error of the inputs: the largest 2-norm, over
            the balls, of the jacobian with each column times the size of its input. Times `UNIT_ROUNDOFF` it is the
            error that no double-precision engine can avoid.
    """

    jacobian: Floats
    time: float
    smooth: bool
    condition: float


class _Ball(NamedTuple):
    """A ball's row of the trajectory, its phase and its tangent, (7, 7 n)."""

    row: Floats
    phase: int
    tangent: Floats


def sensitivity_along(
    trajectory: Trajectory, events: Floats, arrays: SceneArrays, times: Floats
) -> Iterator[Sensitivity]:
    """Computes the sensitivity of a recorded shot at several times.

    Args:
        trajectory: The paths of the balls.
        events: (l, EVENT_WIDTH) the event log, see `engine.log`.
        arrays: The scene.
        times: Ascending, s.

    Yields:
        One sensitivity for each time. An event exactly at that time counts as past.
    """
    numbers, n = arrays.numbers, len(arrays.radius)
    balls: list[_Ball] = []
    scale = np.zeros((n, _INPUTS))
    for i in range(n):
        row, phase = trajectory.rows[i], int(trajectory.phase[i])
        tangent, radius = np.zeros((_SIZE, n, _INPUTS)), arrays.radius[i]
        scale[i, :4] = np.abs(row[_COLUMNS[:4]])
        if phase != POTTED:
            for k in range(4):
                tangent[k, i, k] = 1.0
        if phase != POTTED and numbers.motion == SLIDING_AND_ROLLING:
            # The slip is (vx - R wy, vy + R wx).
            tangent[_U, i, 2:4] = np.eye(2)
            tangent[_U, i, 4:6] = (0.0, -radius), (radius, 0.0)
            tangent[_WZ, i, 6] = 1.0
            slip, velocity = row[[UX, UY]], row[[VX, VY]]
            scale[i, 4:] = np.abs((*((slip - velocity)[::-1] / radius), row[WZ]))
        balls.append(_Ball(row, phase, tangent.reshape(_SIZE, -1)))
    smooth = True
    piece, previous = n, math.nan  # the next piece of the trajectory; the time of the last impact
    event = 0
    for time in times:
        while event < len(events) and events[event, TIME] <= time:
            row = events[event]
            now, kind = Time(row[TIME], row[TIME_LO]), int(row[KIND])
            concerned = [int(row[BALL]), int(row[OTHER])] if kind == BALL_BALL else [int(row[BALL])]
            smooth = smooth and not row[RULE] and not (kind == BALL_BALL and now.hi == previous)
            before = [_fly(balls[i], now, numbers) for i in concerned]
            after = [
                _Ball(trajectory.rows[piece + m], int(trajectory.phase[piece + m]), ball.tangent)
                for m, ball in enumerate(before)
            ]
            if kind == BALL_BALL:
                previous = now.hi
                changed = _impact(before, after, concerned, arrays)
            else:
                radius = float(arrays.radius[concerned[0]])
                changed = [_single(before[0], after[0], kind, int(row[OTHER]), radius, arrays)]
            for i, ball in zip(concerned, changed, strict=True):
                balls[i] = ball
            piece += len(concerned)
            event += 1
        end = Time(float(time), 0.0)
        jacobian = np.stack([_fly(ball, end, numbers).tangent[_R] for ball in balls]).reshape(n, 2, n, _INPUTS)
        scaled = (jacobian * scale).reshape(n, 2, -1)
        yield Sensitivity(jacobian, float(time), smooth, float(np.linalg.norm(scaled, 2, axis=(1, 2)).max()))


def _rate(ball: _Ball, numbers: Numbers) -> Floats:
    """Returns the time derivative of (x, y, vx, vy, ux, uy, wz), (7,)."""
    rate = np.zeros(_SIZE)
    if ROLLING <= ball.phase < POTTED:
        acceleration = ball.row[[AX, AY]]
        rate[_R] = ball.row[[VX, VY]]
        rate[_V] = acceleration
        if ball.phase == SLIDING:
            rate[_U] = 3.5 * acceleration
    rate[_WZ] = -math.copysign(numbers.spin_decay, ball.row[WZ]) if ball.row[WZ] else 0.0
    return rate


def _fly(ball: _Ball, now: Time, numbers: Numbers) -> _Ball:
    """Returns the ball and its tangent at a time within its phase."""
    dt = (now.hi - ball.row[T0]) + (now.lo - ball.row[T0_LO])
    row, tangent = ball.row.copy(), ball.tangent.copy()
    row[T0], row[T0_LO] = now.hi, now.lo
    if ROLLING <= ball.phase < POTTED:
        acceleration = row[[AX, AY]]
        velocity = row[[VX, VY]]
        row[[X, Y]] = position_after(ball.row, dt)
        row[[VX, VY]] += dt * acceleration
        d_acceleration = 0.0
        if ball.phase == SLIDING:
            d_acceleration = -numbers.slide * d_unit(row[[UX, UY]]) @ tangent[_U]
            row[[UX, UY]] += 3.5 * dt * acceleration
            tangent[_U] += 3.5 * dt * d_acceleration
        elif ball.phase == ROLLING:
            d_acceleration = -numbers.roll * d_unit(velocity) @ tangent[_V]
        tangent[_R] += dt * (tangent[_V] + 0.5 * dt * d_acceleration)
        tangent[_V] += dt * d_acceleration
    spin = row[WZ]
    if spin:
        left = abs(spin) - numbers.spin_decay * dt
        row[WZ] = math.copysign(max(left, 0.0), spin)
        if left <= 0.0:
            tangent[_WZ] = 0.0
    return _Ball(row, ball.phase, tangent)


def _impact(before: list[_Ball], after: list[_Ball], concerned: list[int], arrays: SceneArrays) -> list[_Ball]:
    """Returns two balls with their tangents after an impact."""
    first, second = before
    numbers, inv_mass, radius = arrays.numbers, arrays.inv_mass[concerned], arrays.radius[concerned]
    d = second.row[[X, Y]] - first.row[[X, Y]]
    w = second.row[[VX, VY]] - first.row[[VX, VY]]
    distance = math.hypot(*d)
    n = d / distance
    closing = float(n @ w)
    # The time of the perturbed impact changes such that the gap is zero there.
    shift = -(n @ (second.tangent[_R] - first.tangent[_R])) / closing if closing else np.zeros(first.tangent.shape[1])
    first_at, second_at = (ball.tangent + np.outer(_rate(ball, numbers), shift) for ball in before)
    d_d, d_w = second_at[_R] - first_at[_R], second_at[_V] - first_at[_V]
    d_n = (d_d - np.outer(n, n @ d_d)) / distance
    gain = (1.0 + numbers.e_ball) / inv_mass.sum()
    d_normal = -gain * (w @ d_n + n @ d_w)
    d_impulse = -np.outer(n, d_normal) + gain * closing * d_n  # on the first ball
    d_roll, d_turn = np.zeros_like(d_n), np.zeros_like(d_normal)
    if arrays.ball_friction is not None:
        t, d_t = np.array([-n[1], n[0]]), np.stack((-d_n[1], d_n[0]))
        cosine, sine = tilt_of(arrays.spheres, *concerned) or (1.0, 0.0)
        roll = sum(ball.row[[UX, UY]] - ball.row[[VX, VY]] for ball in before)
        d_rolls = first_at[_U] - first_at[_V] + second_at[_U] - second_at[_V]
        turn = sum(r * ball.row[WZ] for r, ball in zip(radius, before, strict=True))
        d_turning = radius[0] * first_at[_WZ] + radius[1] * second_at[_WZ]
        # The slip belongs to the speed of separation after the normal impulse.
        slip = np.array([cosine * turn - sine * (t @ roll) - t @ w, n @ roll - sine * numbers.e_ball * closing])
        d_slip = np.stack(
            (
                cosine * d_turning - sine * (roll @ d_t + t @ d_rolls) - w @ d_t - t @ d_w,
                roll @ d_n + n @ d_rolls - sine * numbers.e_ball * (w @ d_n + n @ d_w),
            )
        )
        mobility = 3.5 * float(inv_mass.sum())
        push, d_push = friction_push(numbers, slip, d_slip, -gain * closing / cosine, d_normal / cosine, mobility)
        d_across, d_up = np.outer(t, d_push[0]) + push[0] * d_t, np.outer(n, d_push[1]) + push[1] * d_n
        d_impulse = d_impulse + d_across - sine * d_up
        d_roll, d_turn = d_up - sine * d_across, cosine * d_push[0]
    tangents = []
    for k, (tangent, ball, sign) in enumerate(((first_at, after[0], 1.0), (second_at, after[1], -1.0))):
        tangent[_V] += sign * inv_mass[k] * d_impulse
        if numbers.motion == SLIDING_AND_ROLLING:
            tangent[_U] += inv_mass[k] * (sign * d_impulse + 2.5 * d_roll)
            tangent[_WZ] += 2.5 * inv_mass[k] / radius[k] * d_turn
        tangents.append(_Ball(ball.row, ball.phase, tangent - np.outer(_rate(ball, numbers), shift)))
    return tangents


def _single(before: _Ball, after: _Ball, kind: int, other: int, radius: float, arrays: SceneArrays) -> _Ball:
    """Returns a ball with its tangent after a cushion, a pocket or a change of phase."""
    row, tangent, numbers = before.row, before.tangent, arrays.numbers
    v, normal, curvature = row[[VX, VY]], np.zeros(2), 0.0
    if kind == BALL_POCKET:  # the ball ends at the pocket's centre, wherever it enters
        return _Ball(after.row, after.phase, np.zeros_like(tangent))
    if kind == BALL_CUSHION:
        normal, curvature = _wall(row[[X, Y]], other, radius, arrays.outline)
        speed = float(normal @ v)
        shift = -(normal @ tangent[_R]) / speed if speed else np.zeros(tangent.shape[1])
    elif kind == SLIDING_ROLLING:
        # |u| falls at 7/2 mu_s g to zero. The direction of u is constant, so it is that at the start of the slide.
        direction = -row[[AX, AY]] / numbers.slide
        shift = direction @ tangent[_U] / (3.5 * numbers.slide)
    elif kind == ROLLING_REST:
        direction = -row[[AX, AY]] / numbers.roll
        shift = direction @ tangent[_V] / numbers.roll
    else:
        shift = np.zeros(tangent.shape[1])
    at = tangent + np.outer(_rate(before, numbers), shift)
    if kind == BALL_CUSHION:
        jump = _cushion_jump(row, normal, radius, arrays)
        # At a tip the normal turns with the point of contact.
        along = np.array((-normal[1], normal[0]))
        turn = -curvature * (along @ at[_R])
        at = jump @ at + np.outer(_turned(after.row) - jump @ _turned(row), turn)
    elif kind == SLIDING_ROLLING:
        at[_U] = 0.0
    elif kind == ROLLING_REST:
        at[_V] = 0.0
    else:
        at[_WZ] = 0.0
    return _Ball(after.row, after.phase, at - np.outer(_rate(after, numbers), shift))


def _wall(position: Floats, wall: int, radius: float, outline: Outline | None) -> tuple[Floats, float]:
    """Returns the unit normal into a cushion, (2,), and the curvature of the line of the touching centres, 1/m."""
    if outline is None:
        normal = np.zeros(2)
        normal[0 if wall < 2 else 1] = 1.0 if wall % 2 else -1.0
        return normal, 0.0
    if wall < len(outline.lines):
        return outline.lines[wall, [NX, NY]], 0.0
    tip = outline.tips[wall - len(outline.lines)]
    offset = tip[[TIP_X, TIP_Y]] - position
    return offset / math.hypot(*offset), 1.0 / (radius + tip[TIP_RADIUS])


def _turned(row: Floats) -> Floats:
    """Returns the derivative of a state, (7,), with respect to a rotation of its velocity and slip."""
    return np.array((0.0, 0.0, -row[VY], row[VX], -row[UY], row[UX], 0.0))


def _cushion_jump(row: Floats, normal: Floats, radius: float, arrays: SceneArrays) -> Floats:
    """Returns the derivative of the state after a cushion with respect to the state before it, (7, 7)."""
    numbers = arrays.numbers
    if not numbers.cushion_rubs:
        jump, speed = np.eye(_SIZE), float(normal @ row[[VX, VY]])
        gain = 1.0 + cushion_restitution(speed, numbers) + speed * restitution_slope(speed, numbers)
        back = gain * np.outer(normal, normal)
        jump[_V, _V] -= back
        if numbers.motion == SLIDING_AND_ROLLING:
            jump[_U, _V] -= back
        return jump
    # Transformation to the variables of a `cushion.CushionMotion`.
    to = np.zeros((5, _SIZE))
    to[0, _V] = to[2, _U] = normal
    to[1, _V] = to[3, _U] = -normal[1], normal[0]
    to[4, _WZ] = radius
    after = cushion_derivative(to @ np.concatenate((np.zeros(2), row[[VX, VY, UX, UY, WZ]])), radius, arrays)
    back = np.linalg.pinv(to)
    return np.eye(_SIZE) - back @ to + back @ after @ to
