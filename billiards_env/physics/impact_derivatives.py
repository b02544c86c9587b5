"""Derivatives of the impacts of `physics.ball_ball` and `physics.cushion`, for `sensitivity`."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from billiards_env.physics.compliance import begin_stick, end_stick, release_phase
from billiards_env.physics.cushion import CushionMotion, cushion_impact, cushion_restitution
from billiards_env.physics.friction import friction_coefficient
from billiards_env.physics.state import Numbers, SceneArrays

Floats = NDArray[np.float64]


def d_unit(vector: Floats) -> Floats:
    """Returns the derivative of v/|v|, (2, 2)."""
    size = math.hypot(*vector)
    unit = vector / size
    return (np.eye(2) - np.outer(unit, unit)) / size


def friction_push(
    numbers: Numbers, slip: Floats, d_slip: Floats, normal: float, d_normal: Floats, mobility: float
) -> tuple[Floats, Floats]:
    """Returns the impulse of friction between two balls and its derivative.

    Args:
        numbers: The `Numbers`.
        slip: (2,) m/s.
        d_slip: (2, m) its derivative.
        normal: Normal impulse, kg m/s.
        d_normal: (m,) its derivative.
        mobility: Change of slip per impulse, 1/kg.

    Returns:
        (2,) and (2, m).
    """
    speed = math.hypot(*slip)
    mu = friction_coefficient(numbers, speed)
    if mu * normal >= speed / mobility:
        return -slip / mobility, -d_slip / mobility
    unit = slip / speed
    d_mu = -numbers.mu_rate * numbers.mu_drop * math.exp(-numbers.mu_rate * speed)
    d_limit = d_mu * normal * (unit @ d_slip) + mu * d_normal
    return -mu * normal * unit, -np.outer(unit, d_limit) - mu * normal * d_unit(slip) @ d_slip


def restitution_slope(speed: float, numbers: Numbers) -> float:
    """Returns the derivative of `cushion_restitution` with respect to the speed, s/m."""
    falls = speed > numbers.e_onset and cushion_restitution(speed, numbers) > numbers.e_floor
    return -float(numbers.e_loss) if falls else 0.0


def cushion_derivative(state: Floats, radius: float, arrays: SceneArrays) -> Floats:
    """Returns the derivative of `cushion_impact` with respect to the `CushionMotion`, (5, 5)."""
    numbers = arrays.numbers
    if arrays.rigid is None and arrays.stronge is None:
        return _by_differences(state, radius, arrays)
    vn, vt, un, ut, rwz = np.eye(5)
    speed = float(state[0])
    e = cushion_restitution(speed, numbers)
    d_e = restitution_slope(speed, numbers) * vn
    sin = numbers.cushion_height / radius - 1.0
    cos = math.sqrt(1.0 - sin * sin)
    d_slip = np.stack((vn * sin + vn - un, -vt - rwz * cos + (ut - vt) * sin))
    slip = d_slip @ state
    size = math.hypot(*slip)
    pze, d_pze = (1.0 + e) * cos * speed, cos * ((1.0 + e) * vn + speed * d_e)
    mu = numbers.mu_cushion
    if arrays.rigid is not None:
        sticks, friction, by_slip, by_rest = size * (2.0 / 7.0) <= mu * pze, mu * pze, 0.0, mu * d_pze
        if sticks:
            friction, by_slip, by_rest = size * (2.0 / 7.0), 2.0 / 7.0, 0.0 * d_pze
    else:
        grip, d_grip = mu * cos * speed, mu * cos * vn
        x = size / grip if grip > 0.0 else math.inf
        after, d_x, d_e_after = _compliant(x, e, numbers.frequency_ratio)
        friction, by_slip = (x + after) * grip / 3.5 if grip > 0.0 else 0.0, (1.0 + d_x) / 3.5
        by_rest = ((after - x * d_x) * d_grip if grip > 0.0 else 0.0) / 3.5 + grip * d_e_after / 3.5 * d_e
    if size > 0.0:
        unit = slip / size
        d_friction = np.outer(unit, by_slip * (unit @ d_slip) + by_rest) + friction * d_unit(slip) @ d_slip
    else:
        d_friction = by_slip * d_slip
    px = -d_friction[0] * sin - d_pze * cos
    pz = d_friction[0] * cos - d_pze * sin
    vn_after = vn + px
    if speed - (friction * slip[0] / size if size > 0.0 else 0.0) * sin - pze * cos > 0.0:
        vn_after = np.zeros(5)
    vt_after = vt + d_friction[1]
    rwn = ut - vt - 2.5 * d_friction[1] * sin
    rwt = vn - un + 2.5 * (px * sin - pz * cos)
    spin = rwz + 2.5 * d_friction[1] * cos
    return np.stack((vn_after, vt_after, vn_after - rwt, vt_after + rwn, spin))


def _compliant(x: float, e: float, omega: float) -> tuple[float, float, float]:
    """Returns the tangential velocity after a compliant impact, and its derivatives with respect to x and e.

    The velocity does not depend on the end of the stick in first order, so that time counts as constant.
    """
    beta, h = 3.5, 3.5 / (omega * omega)
    if x >= (1.0 + e) * beta - h / e:
        return beta * (1.0 + e) - x, -1.0, beta
    start, stretch, velocity = begin_stick(x, e, omega)
    t = end_stick(start, stretch, velocity, e, omega)
    for refined in (False, True):  # one Newton step; the derivatives need more digits of the time than the velocity
        angle, psi = omega * (t - start), release_phase(t, e)
        sin, cos = math.sin(angle), math.cos(angle)
        if not refined:
            excess = velocity * sin / omega - stretch * cos - h * math.sin(psi)
            t -= excess / (velocity * cos + stretch * omega * sin - h * math.cos(psi) / e)
    held = omega * stretch * sin + velocity * cos
    # Derivatives of stretch, velocity and start, with respect to (x, e).
    d_x, d_e = np.eye(2)
    d_stretch, d_velocity, d_start = np.zeros(2), -d_x, np.zeros(2)
    if h <= x <= beta:
        c = (x - beta) / (h - beta)
        d_c, s = d_x / (h - beta), math.sqrt(1.0 - c * c)
        if s > 0.0:
            d_stretch, d_velocity, d_start = -h * c / s * d_c, -beta * d_c - d_x, -d_c / s
    elif x > beta:
        span = h / e - beta * e
        c = (x - beta) / span
        d_c, s = (d_x + c * (h / (e * e) + beta) * d_e) / span, math.sqrt(1.0 - c * c)
        d_stretch, d_velocity = -h * c / s * d_c, -beta * (c * d_e + e * d_c) - d_x
        d_start = (math.acos(c) - 0.5 * math.pi) * d_e - e * d_c / s
    slope = omega * sin * d_stretch + cos * d_velocity - omega * (omega * stretch * cos - velocity * sin) * d_start
    slope -= beta * (1.0 + math.cos(psi) + math.sin(psi) * (t - 0.5 * math.pi) / e) * d_e
    return held - beta * e * (1.0 + math.cos(psi)), float(slope[0]), float(slope[1])


def _by_differences(state: Floats, radius: float, arrays: SceneArrays) -> Floats:
    """Returns the derivative by differences of fourth order; its relative error is about 1e-4."""
    step = 1e-2 * float(state[0])
    if step == 0.0:
        return np.eye(5)

    def after(k: int, steps: int) -> Floats:
        moved = state.copy()
        moved[k] += steps * step
        return np.array(cushion_impact(CushionMotion(*moved), radius, 0.0, arrays)[0])

    columns = [(8.0 * (after(k, 1) - after(k, -1)) - (after(k, 2) - after(k, -2))) / (12.0 * step) for k in range(5)]
    return np.stack(columns, axis=1)
