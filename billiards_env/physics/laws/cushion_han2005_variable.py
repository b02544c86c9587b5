"""The impact on a cushion by Han (2005), with a restitution that depends on the motion.

Fits of recorded three-cushion shots (the tracks of the simulator tailuge/billiards) show two effects. The restitution
grows with the topspin or with the slip, and the impulse reverses part of the slip along the cushion. The law is a
simple form of these effects. The restitution is

    e = e(v_n) + e_cushion_topspin min(1, max(0, R omega_t / v_n)) + e_cushion_slip s^2 / (s^2 + v_n^2)

Here omega_t is the spin along the cushion (v_n / R for a ball that rolls), s is the size of the slip at the nose, and
e(v_n) is the restitution of the other cushions. If mu_cushion does not limit the friction, the impact stops the slip up
or down the nose and reverses the share e_cushion_tangent of the slip along the cushion, as with a nose that yields
sideways (Stronge 2000). If mu_cushion limits the friction, it has the direction of this impulse.
"""

from __future__ import annotations

from billiards_env.jit import inlined
from billiards_env.physics.laws.cushion import ROUNDING, Cushion, cushion_restitution, nose_of, slip_at
from billiards_env.physics.laws.cushion_han2005 import impact


@inlined
def _gain(before, slips, numbers):
    """Returns the gain of the restitution."""
    vn, (sx, sy) = before.vn, slips
    topspin = (vn - before.un) / vn if vn > 0.0 else 0.0  # 1 for a ball that rolls
    slip, square = sx * sx + sy * sy, vn * vn
    glancing = slip / (slip + square) if slip > 0.0 else 0.0
    return numbers.e_cushion_topspin * min(1.0, max(0.0, topspin)) + numbers.e_cushion_slip * glancing


@inlined
def han2005_variable(before, radius, rebound, numbers, solution):
    """Returns a ball's motion after an impact on a cushion, as `cushion_han2005.han2005` does."""
    vn = before.vn
    nose = nose_of(radius, numbers)
    slips = slip_at(before, nose)
    sx, sy = slips
    e, gain = cushion_restitution(vn, numbers), _gain(before, slips, numbers)
    if e < 1.0 or gain > 0.0:  # without a gain, a restitution of 1 depends only on `e_cushion`: leave out `min`
        e = min(1.0, e + gain)
    reversed_slips = (sx, sy * (1.0 + numbers.e_cushion_tangent))
    return impact(before, nose, reversed_slips, rebound, numbers.mu_cushion, e)


@inlined
def gain_is_smooth(before, radius, numbers):
    """Returns whether the gain has a derivative. A ball that rolls is at no kink, as it rolls after a change too."""
    vn, un = before.vn, before.un
    gain = _gain(before, slip_at(before, nose_of(radius, numbers)), numbers)
    clamped = abs(cushion_restitution(vn, numbers) + gain - 1.0) <= ROUNDING
    slides, tiny = un != 0.0 or before.ut != 0.0, ROUNDING * vn
    kink = abs(vn - un) <= tiny or (slides and abs(un) <= tiny)
    return not ((gain > 0.0 and clamped) or (numbers.e_cushion_topspin > 0.0 and kink))


CUSHION = Cushion(han2005_variable)
