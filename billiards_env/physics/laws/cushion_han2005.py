"""The impact on a cushion by Han (2005), with friction and spin."""

from __future__ import annotations

import math

from billiards_env.jit import inlined
from billiards_env.physics.laws.cushion import Cushion, cushion_restitution, leave, nose_of, slip_at

STICK = 2.0 / 7.0
"""The ratio of the impulse per mass that stops a slip to the slip."""


@inlined
def _squeeze(needed, nose, slips, mu):
    """Returns the friction and the normal impulse (pxe, pye, pze), per mass, with the horizontal sum `needed`, m/s."""
    (sin, cos), (sx, sy) = nose, slips
    slip = math.sqrt(sx * sx + sy * sy)
    resistance = cos + (mu * sin * (sx / slip) if slip > 0.0 else 0.0)
    pze = needed / resistance if resistance > 0.0 else math.inf
    if slip * STICK <= mu * pze and mu > 0.0:  # friction sticks
        return sx * STICK, sy * STICK, max(0.0, (needed - sx * STICK * sin) / cos)
    if slip > 0.0:
        return mu * pze * (sx / slip), mu * pze * (sy / slip), pze
    return 0.0, 0.0, pze


@inlined
def impact(before, nose, slips, rebound, mu, e):
    """Returns the result of `han2005` for a `Nose`.

    Args:
        before: The `CushionMotion` before the impact, vn >= 0.
        nose: The `Nose`.
        slips: The changes of the slip if the friction is large enough: the result of `slip_at`, or larger.
        rebound: Least speed away from the cushion after the impact, m/s, >= 0.
        mu: The friction.
        e: The restitution.
    """
    vn, (sin, cos), (sx, sy) = before.vn, nose, slips
    slip = math.sqrt(sx * sx + sy * sy)
    pze = (1.0 + e) * vn * cos  # impulses per mass
    pxe = pye = 0.0
    if slip * STICK <= mu * pze and mu > 0.0:
        pxe, pye = sx * STICK, sy * STICK
    elif slip > 0.0:
        pxe, pye = mu * pze * (sx / slip), mu * pze * (sy / slip)
    px = -pxe * sin - pze * cos
    raised = vn + px > -rebound
    if raised:
        px = -(vn + rebound)
        pxe, pye, pze = _squeeze(vn + rebound, nose, slips, mu)
    return leave(before, nose, -rebound if raised else vn + px, px, pxe, pye, pze), raised


@inlined
def han2005(before, radius, rebound, numbers, solution):
    """Returns a ball's motion after an impact on a cushion with friction and spin.

    The law is that of Han (2005), Dynamics in Carom and Three Cushion Billiards. At the point of contact friction
    either stops the slip or acts against it throughout (his equations 14 to 23). The vertical velocity is set to zero,
    as in his carom model. If the ball would leave more slowly than `rebound`, the normal impulse and its friction are
    raised until the ball leaves at `rebound`.

    Args:
        before: The `CushionMotion` before the impact, vn >= 0.
        radius: m.
        rebound: Least speed away from the cushion after the impact, m/s, >= 0.
        numbers: The `Numbers`.
        solution: The result of `Cushion.solution` for this impact; None to solve the equation of the law. The
            derivatives solve it once for all directions. This law has none.

    Returns:
        after: The `CushionMotion` after the impact, with vn <= -rebound.
        raised: Whether `rebound` raised the impulse.
    """
    nose, e = nose_of(radius, numbers), cushion_restitution(before.vn, numbers)
    return impact(before, nose, slip_at(before, nose), rebound, numbers.mu_cushion, e)


CUSHION = Cushion(han2005)
