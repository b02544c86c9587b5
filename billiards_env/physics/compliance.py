"""Friction at a compliant contact, by Stronge (2000), Impact Mechanics, chapter 5.

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


@kernel
def end_stick(start, stretch, velocity, e, omega):
    """Returns the time at which the stick ends, by Newton's method within a bracket; see `begin_stick`."""
    h = _BETA / (omega * omega)
    lo, hi = max(start, _HALF_PI), (1.0 + e) * _HALF_PI
    t = 0.5 * (lo + hi)
    last = hi - lo
    for _ in range(_MAX_ITERATIONS):
        sin, cos = sine_cosine(omega * (t - start))
        sin_n, cos_n = sine_cosine(release_phase(t, e))
        excess = velocity * sin / omega - stretch * cos - h * sin_n
        if excess > 0.0:
            hi = t
        else:
            lo = t
        slope = velocity * cos + stretch * omega * sin - h * cos_n / e
        newton = t - excess / slope
        if slope == 0.0 or not (lo < newton < hi) or abs(newton - t) > 0.5 * last:
            newton = 0.5 * (lo + hi)
        last = abs(newton - t)
        t = newton
        if last <= _CLOSE:
            break
    return t


@kernel
def friction_impulse(slip, grip, e, omega):
    """Returns the impulse of friction against the slip, per mass, m/s.

    Args:
        slip: Speed of the slip before the impact, m/s, >= 0.
        grip: Normal speed times the coefficient of friction, m/s, >= 0.
        e: Restitution with e (1 + e) omega^2 >= 2, so that friction adds no energy.
        omega: Frequency ratio.
    """
    if slip >= grip * ((1.0 + e) * _BETA - _BETA / (omega * omega * e)):
        return (1.0 + e) * grip
    x = slip / grip
    start, stretch, velocity = begin_stick(x, e, omega)
    t = end_stick(start, stretch, velocity, e, omega)
    sin, cos = sine_cosine(omega * (t - start))
    left = _BETA * e * (1.0 + sine_cosine(release_phase(t, e))[1])  # friction after the stick
    return (x + (omega * stretch * sin + velocity * cos - left)) * grip / _BETA
