"""The impact on a compliant cushion, by Stronge (2000), Impact Mechanics, chapter 5.

The contact has a linear spring along the normal and one along the tangent. Frequencies and masses enter only through
the ratio Omega of the tangential to the normal frequency, from 1 to 2. The normal spring has a half period pi, so
compression ends at the time pi / 2, and restitution, which is shortened by the restitution e, at (1 + e) pi / 2. The
contact point sticks or slips. Units are those in which the normal velocity of the impact times the coefficient of
friction is 1. With the slip x before the impact, there are three cases:

* gross slip, if x >= (1 + e) 7/2 - h / e, with h = (7/2) / Omega^2: friction acts against the slip throughout,
* stick and then slip, if x < h,
* slip, stick and slip otherwise.

The end of the stick is the root of the excess of the tangential spring's force over the limit of friction. The excess
is the negative derivative of the final velocity with respect to that time, up to a factor. So an error of the time of
1e-9 changes the velocity by less than its rounding.
"""

from __future__ import annotations

import math

from billiards_env.jit import inlined, kernel
from billiards_env.physics.elementary import arccosine, sine_cosine
from billiards_env.physics.laws.cushion import Cushion, cushion_restitution, leave, nose_of, slip_at

_HALF_PI = 0.5 * math.pi
_BETA = 3.5  # ratio of the tangential to the normal inverse mass of a sphere
_CLOSE = 1e-9  # error of the time at which the stick ends
_MAX_ITERATIONS = 64  # a limit for safety


@inlined
def release_phase(t, e):
    """Returns the phase of the normal spring at a time t of the restitution, from pi / 2 to pi."""
    return _HALF_PI + (t - _HALF_PI) / e


@kernel
def begin_stick(x, e, omega):
    """Returns the start of the stick.

    Args:
        x: Slip before the impact, below the limit of gross slip.
        e: Restitution, > 0.
        omega: Frequency ratio.

    Returns:
        (time, stretch, velocity): the time, and the stretch of the tangential spring and the tangential velocity then.
    """
    h = _BETA / (omega * omega)
    if x < h:
        return 0.0, 0.0, -x
    if x <= _BETA:  # in the compression
        c = (x - _BETA) / (h - _BETA) if h < _BETA else 0.0
        return arccosine(c), h * math.sqrt(1.0 - c * c), _BETA * (1.0 - c) - x
    c = max(-1.0, (x - _BETA) / (h / e - _BETA * e))
    t = _HALF_PI + e * (arccosine(c) - _HALF_PI)
    return t, h * math.sqrt(1.0 - c * c), _BETA * (1.0 - e * c) - x


@inlined
def stick_force(t, start, stretch, velocity, e, omega):
    """Returns the excess of the tangential spring's force at a time t of the stick, and its slope."""
    h = _BETA / (omega * omega)
    sin, cos = sine_cosine(omega * (t - start))
    sin_n, cos_n = sine_cosine(release_phase(t, e))
    return velocity * sin / omega - stretch * cos - h * sin_n, velocity * cos + stretch * omega * sin - h * cos_n / e


@kernel
def end_stick(start, stretch, velocity, e, omega):
    """Returns the time at which the stick ends, by Newton's method within a bracket; see `begin_stick`."""
    lo, hi = max(start, _HALF_PI), (1.0 + e) * _HALF_PI
    t = 0.5 * (lo + hi)
    last = hi - lo
    for _ in range(_MAX_ITERATIONS):
        excess, slope = stick_force(t, start, stretch, velocity, e, omega)
        if excess > 0.0:
            hi = t
        else:
            lo = t
        newton = t - excess / slope
        if slope == 0.0 or not (lo < newton < hi) or abs(newton - t) > 0.5 * last:
            newton = 0.5 * (lo + hi)
        last = abs(newton - t)
        t = newton
        if last <= _CLOSE:
            break
    return t


@inlined
def known_end(end, start, stretch, velocity, e, omega):
    """Returns `end`, or the result of `end_stick` if it is None."""
    if end is None:
        return end_stick(start, stretch, velocity, e, omega)
    return end


@inlined
def _gross_slip(grip, e, omega):
    """Returns the slip from which on friction does not stop it; the arguments are those of `friction_impulse`."""
    return grip * ((1.0 + e) * _BETA - _BETA / (omega * omega * e))


@inlined
def friction_impulse(slip, grip, e, omega, end):
    """Returns the impulse of friction against the slip, per mass, m/s.

    Args:
        slip: Speed of the slip before the impact, m/s, >= 0.
        grip: Normal speed times the coefficient of friction, m/s, >= 0.
        e: Restitution with e (1 + e) omega^2 >= 2, so that friction adds no energy.
        omega: Frequency ratio.
        end: The time at which the stick ends; None to compute it.
    """
    gross = _gross_slip(grip, e, omega)
    if slip >= gross:
        return (1.0 + e) * grip
    x = slip / grip
    start, stretch, velocity = begin_stick(x, e, omega)
    t = known_end(end, start, stretch, velocity, e, omega)
    sin, cos = sine_cosine(omega * (t - start))
    left = _BETA * e * (1.0 + sine_cosine(release_phase(t, e))[1])  # friction after the stick
    return (x + (omega * stretch * sin + velocity * cos - left)) * grip / _BETA


@inlined
def stronge(before, radius, rebound, numbers, solution):
    """Returns a ball's motion after an impact on a compliant cushion, as `cushion_han2005.han2005` does.

    The normal impulse is that of `han2005`; the friction is that of `friction_impulse`. If the ball would leave more
    slowly than `rebound`, a horizontal impulse through its centre, without friction, makes up for it.
    """
    vn, nose, e = before.vn, nose_of(radius, numbers), cushion_restitution(before.vn, numbers)
    sx, sy = slip_at(before, nose)
    slip = math.sqrt(sx * sx + sy * sy)
    pze = (1.0 + e) * vn * nose.cos
    pxe = pye = 0.0
    if slip > 0.0:
        grip = numbers.mu_cushion * vn * nose.cos
        friction = friction_impulse(slip, grip, e, numbers.cushion_frequency_ratio, solution)
        pxe, pye = friction * (sx / slip), friction * (sy / slip)
    px = -pxe * nose.sin - pze * nose.cos
    raised = vn + px > -rebound
    return leave(before, nose, -rebound if raised else vn + px, px, pxe, pye, pze), raised


@kernel
def end_of_stick(before, radius, numbers):
    """Returns the time at which the stick ends, 0 without a stick.

    It is constant for the derivatives, because the motion after the impact does not depend on it in first order. The
    derivatives need more digits of it than the motion, so it has one more step of Newton's method.
    """
    nose, e = nose_of(radius, numbers), cushion_restitution(before.vn, numbers)
    sx, sy = slip_at(before, nose)
    slip = math.sqrt(sx * sx + sy * sy)
    grip, omega = numbers.mu_cushion * before.vn * nose.cos, numbers.cushion_frequency_ratio
    if slip >= _gross_slip(grip, e, omega):
        return 0.0
    start, stretch, velocity = begin_stick(slip / grip, e, omega)
    t = end_stick(start, stretch, velocity, e, omega)
    excess, slope = stick_force(t, start, stretch, velocity, e, omega)
    return t - excess / slope


CUSHION = Cushion(stronge, solution=end_of_stick)
