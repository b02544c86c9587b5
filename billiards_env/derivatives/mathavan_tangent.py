"""The derivative of the impact of `physics.laws.mathavan` along one direction of change, and where it does not exist.

The change of the motion follows the linearised equation, in steps of its own that limit its error too. Where a slip
stops, the rates jump: the change then gets the saltation term of `derivatives.lanes`. The change also shifts the
impulse at which each phase ends.

The motion is z = (xi, yi, xc, yc, vx, work): the slips at the cushion and at the cloth, and the velocity along the
cushion. In these coordinates a slip that goes to zero keeps all its digits, so its direction does. A slip that begins
grows with the square of the impulse, and its direction follows `mathavan.begin_slip` so closely that the equation is
stiff. Until it is `_BEGUN`, it has this direction; the error is of the order of `_BEGUN` to the power of 3/2.
"""

from __future__ import annotations

import math

from billiards_env.derivatives.tangent import rule, tangent_of
from billiards_env.jit import inlined, kernel
from billiards_env.physics.laws.cushion import cushion_restitution
from billiards_env.physics.laws.cushion_mathavan2010 import contact_of, motion_of
from billiards_env.physics.laws.mathavan import (
    CushionNose,
    begin_slip,
    combine,
    friction,
    integrate_impact,
    largest,
    slip_at,
    slips_of,
    stepper,
)

_TOLERANCE = 2e-12  # the local error of the motion over the normal velocity, and of its change over the largest change
_STOPPED = 1e-12  # slip over the normal velocity below which a slip has stopped
_BEGUN = 4e-8  # slip over the normal velocity above which a slip has begun
# An impact has about 100, or 1,000 if a slip stops. Impacts with far more have a slip that stops and begins again.
_MOST_STEPS = 10_000
_TINY_E = 1e-5  # for a smaller restitution, the phase of restitution is shorter than its steps


@inlined
def _newton_step(lam, ex, ey, nose):
    """Returns `mathavan.begin_slip` after a step of Newton's method from lam, which solves x^2 + y^2 = 1."""
    x, y, by_x, by_y = slip_at(lam, ex, ey, nose)
    root = lam - 0.5 * (x * x + y * y - 1.0) / (x * by_x + y * by_y)
    x, y, by_x, by_y = slip_at(root, ex, ey, nose)
    return x, y, root


_d_newton_step = tangent_of(_newton_step, constant=("lam",))


@rule(begin_slip)
@inlined
def _d_begin_slip(ex, ey, nose, d_ex, d_ey, d_nose):
    return _d_newton_step(begin_slip(ex, ey, nose)[2], ex, ey, nose, d_ex, d_ey, d_nose)


@inlined
def _start(before, nose):
    """Returns z for (vx, vy, rwx, rwy, rwz)."""
    xi, yi, xc, yc = slips_of(before, nose)
    return xi, yi, xc, yc, before[0], 0.0


@inlined
def _normal(z, nose):
    """Returns the velocity into the cushion."""
    return (z[3] - z[1]) / (1.0 + nose.sin)


@inlined
def _end(z, nose):
    """Returns (vx, vy, rwx, rwy, rwz) for z."""
    xi, vx, vy, rwy = z[0], z[4], _normal(z, nose), z[4] - z[2]
    return vx, vy, z[3] - vy, rwy, (vx + rwy * nose.sin - xi) / nose.cos


@kernel
def _rates(z, nose, tiny):
    """Returns the derivatives of z with respect to the normal impulse; `tiny` as in `mathavan.friction`."""
    sin, cos = nose.sin, nose.cos
    ax, ay, bx, by = friction((z[0], z[1], z[2], z[3]), nose, tiny)
    d, g, h = 1.0 - 2.5 * sin, 2.5 - sin, 2.5 + sin * sin
    xi, yi, xc, yc = 3.5 * ax + d * bx, h * ay + g * by + sin * cos, d * ax + 3.5 * bx, g * ay + 3.5 * by - cos
    return xi, yi, xc, yc, ax + bx, _normal(z, nose) * cos


_d_start, _d_normal, _d_end = tangent_of(_start), tangent_of(_normal), tangent_of(_end)
_d_rates = tangent_of(_rates, constant=("tiny",))
_d_step = tangent_of(stepper(_rates), constant=("h", "tiny"))


@inlined
def _without_work(z):
    return z[0], z[1], z[2], z[3], z[4], 0.0


@inlined
def _sizes(z):
    """Returns the sizes of the slips at the cushion and at the cloth."""
    return math.sqrt(z[0] * z[0] + z[1] * z[1]), math.sqrt(z[2] * z[2] + z[3] * z[3])


@inlined
def _moved(change, dp, rate):
    """Returns a change after a change dp of the impulse, at a rate."""
    return combine(change, dp, (rate,), (1.0,))


@inlined
def _limits(slips):
    """Returns the sizes of slips that are zero for `mathavan.friction`: any, if a contact does not slip."""
    return 0.0 if slips[0] else math.inf, 0.0 if slips[1] else math.inf


@inlined
def _longest_step(z, rate, slips, nose):
    """Returns the longest step in which no falling slip changes by more than half of its size, and that is stable.

    Longer steps than the stable one alone make the change of a slip's direction grow.
    """
    (at_nose, at_cloth), longest = _sizes(z), math.inf
    if slips[0]:
        longest = 2.0 * at_nose / (3.5 * nose.mu) if nose.mu > 0.0 else math.inf
        if z[0] * rate[0] + z[1] * rate[1] < 0.0:
            longest = min(longest, 0.5 * at_nose / math.sqrt(rate[0] * rate[0] + rate[1] * rate[1]))
    if slips[1]:
        if nose.mu_cloth > 0.0:
            longest = min(longest, 2.0 * at_cloth / (3.5 * nose.mu_cloth * (1.0 + nose.mu)))
        if z[2] * rate[2] + z[3] * rate[3] < 0.0:
            longest = min(longest, 0.5 * at_cloth / math.sqrt(rate[2] * rate[2] + rate[3] * rate[3]))
    return longest


@kernel
def _switch(z, change, rate, was, slips, nose):
    """Returns z and its change where a contact stops or begins to slip, and whether the derivative exists.

    Args:
        z: The motion.
        change: Its change.
        rate: Its rate before.
        was: Whether the cushion and the cloth slipped before.
        slips: Whether they slip now.
        nose: The `CushionNose`.
    """
    k, both = 0 if was[0] != slips[0] else 2, was[0] != slips[0] and was[1] != slips[1]
    square = rate[k] * rate[k] + rate[k + 1] * rate[k + 1]
    dp = -(change[k] * rate[k] + change[k + 1] * rate[k + 1]) / square
    change = _moved(change, dp, rate)
    if was[0] and not slips[0]:
        z, change = (0.0, 0.0, z[2], z[3], z[4], z[5]), (0.0, 0.0, change[2], change[3], change[4], change[5])
    if was[1] and not slips[1]:
        z, change = (z[0], z[1], 0.0, 0.0, z[4], z[5]), (change[0], change[1], 0.0, 0.0, change[4], change[5])
    rate = _rates(z, nose, _limits(slips))
    stays = slips[k // 2] or rate[k] * rate[k] + rate[k + 1] * rate[k + 1] < 1e-12 * square
    return z, _moved(change, -dp, rate), stays and not both


@kernel
def impact_change(before, d_before, nose, d_nose, e, d_e):
    """Returns the motion after an impact, as `mathavan.integrate_impact`, and its change for a change of the arguments.

    Args:
        before: (vx, vy, rwx, rwy, rwz) before the impact.
        d_before: Its change.
        nose: The `CushionNose`.
        d_nose: Its change, a `CushionNose`.
        e: Restitution.
        d_e: Its change.

    Returns:
        after: (vx, vy, rwx, rwy, rwz) after it.
        d_after: Its change.
        exists: Whether the derivative exists: the cushion slips at first, and a slip that stops does not begin again
            at once.
    """
    vy, (z, change) = before[1], _d_start(before, nose, d_before, d_nose)
    at_nose, at_cloth = _sizes(z)
    stopped, begun = _STOPPED * vy + 1e-14 * largest(before), _BEGUN * vy
    slips = (at_nose >= stopped, at_cloth >= stopped)
    exists = slips[0] and (at_cloth == 0.0 or slips[1])
    if vy <= 0.0:
        return before, d_before, exists
    size = vy * largest((d_nose.sin, d_nose.cos, d_nose.mu, d_nose.mu_cloth, d_e))
    compresses, work, d_work, h = True, 0.0, 0.0, 0.1 * vy
    rate, d_rate = _d_rates(z, nose, _limits(slips), change, d_nose)
    for _ in range(_MOST_STEPS):
        size = max(size, largest(change))
        h = min(h, _longest_step(z, rate, slips, nose))
        step, d_step = _d_step(z, h, rate, nose, _limits(slips), change, d_rate, d_nose)
        (after, rate_after, off), (d_after, d_rate_after, d_off) = step, d_step
        error = max(largest(off) / vy, largest(d_off) / size if size > 0.0 else 0.0) / _TOLERANCE
        if error > 1.0 and h > 0.1 * _TOLERANCE * vy:
            h *= max(0.1, 0.9 / math.sqrt(math.sqrt(error)))
            continue
        left, left_after = _normal(z, nose), _normal(after, nose)
        if not compresses:
            left, left_after = z[5] + e * e * work, after[5] + e * e * work
        close = 1e-13 * (vy if compresses else e * e * work)
        if left_after < -close and h > 0.0:
            h *= max(0.1, left / (left - left_after))
            continue
        at_nose, at_cloth = _sizes(after)
        begins = max(0.0 if slips[0] else at_nose, 0.0 if slips[1] else at_cloth) / begun
        if begins > 2.0:
            h *= max(0.1, 1.0 / math.sqrt(begins))
            continue
        z, change, rate, d_rate, was = after, d_after, rate_after, d_rate_after, slips
        slips = (at_nose >= (stopped if was[0] else begun), at_cloth >= (stopped if was[1] else begun))
        if was[0] != slips[0] or was[1] != slips[1]:
            z, change, stays = _switch(z, change, rate, was, slips, nose)
            rate, d_rate = _d_rates(z, nose, _limits(slips), change, d_nose)
            exists = exists and stays
        if left_after > close and max(at_nose, at_cloth) < stopped and rate[3] - rate[1] > -1e-12:
            after, d_after = _d_end(z, nose, change, d_nose)  # the cushion and the slate hold the ball
            return after, (d_after[0], 0.0, d_after[2], d_after[3], d_after[4]), False
        if left_after <= close:
            if not compresses:
                dp = (-2.0 * e * d_e * work - e * e * d_work - change[5]) / rate[5]
                return (*_d_end(z, nose, _moved(change, dp, rate), d_nose), exists)
            compresses, work, d_work = False, z[5], change[5]
            slows = _normal(rate, nose)
            change = _moved(change, -_d_normal(z, nose, change, d_nose)[1] / slows, rate)
            if e < _TINY_E:
                change = _moved(change, d_e * math.sqrt(-2.0 * work / (nose.cos * slows)), rate)
                return (*_d_end(z, nose, change, d_nose), exists)
            z, change = _without_work(z), _without_work(change)
            d_rate = _d_rates(z, nose, _limits(slips), change, d_nose)[1]
        h *= min(4.0, 0.9 / math.sqrt(math.sqrt(max(error, 1e-3))))
    return (*_d_end(z, nose, change, d_nose), False)


@rule(integrate_impact)
@inlined
def _d_integrate_impact(before, nose, e, d_before, d_nose, d_e):
    after, d_after, _ = impact_change(before, d_before, nose, d_nose, e, d_e)
    return after, d_after


@rule(integrate_impact, constant=("nose",))
@inlined
def _d_integrate_impact_alone(before, nose, e, d_before, d_e):
    return _d_integrate_impact(before, nose, e, d_before, CushionNose(0.0, 0.0, 0.0, 0.0), d_e)


@kernel
def is_smooth(before, radius, numbers):
    """Returns whether the law `mathavan2010` has a derivative."""
    motion, unmoved, nose = motion_of(before), (0.0, 0.0, 0.0, 0.0, 0.0), contact_of(radius, numbers)
    e, constant = cushion_restitution(before.vn, numbers), CushionNose(0.0, 0.0, 0.0, 0.0)
    return impact_change(motion, unmoved, nose, constant, e, 0.0)[2]
