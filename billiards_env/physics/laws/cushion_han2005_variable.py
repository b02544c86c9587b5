"""The impact on a cushion by Han (2005), with friction and restitution that depend on the motion.

In fits of recorded three-cushion shots (the tracks of the simulator tailuge/billiards), friction grows with the angle
to the normal, restitution grows with the topspin, and the impulse reverses part of the slip along the cushion. The law
is a simple form of these effects:

    mu = mu_cushion + mu_cushion_angle sin^2(phi)
    e = e(v_n) + e_cushion_topspin min(1, max(0, R omega_t / v_n))

Here phi is the angle between the velocity and the normal, omega_t is the spin along the cushion (v_n / R for a ball
that rolls), and e(v_n) is the restitution of the other cushions. If mu does not limit the friction, the impact stops
the slip up or down the nose and reverses the share e_cushion_tangent of the slip along the cushion, as with a nose that
yields sideways (Stronge 2000). If mu limits the friction, it has the direction of this impulse.
"""

from __future__ import annotations

from billiards_env.jit import inlined
from billiards_env.physics.laws.cushion import ROUNDING, Cushion, cushion_restitution, nose_of, slip_at
from billiards_env.physics.laws.cushion_han2005 import impact


@inlined
def han2005_variable(before, radius, rebound, numbers, solution):
    """Returns a ball's motion after an impact on a cushion, as `cushion_han2005.han2005` does."""
    vn, vt = before.vn, before.vt
    square = vn * vn + vt * vt
    along = vt * vt / square if square > 0.0 else 0.0
    topspin = (vn - before.un) / vn if vn > 0.0 else 0.0  # 1 for a ball that rolls
    nose = nose_of(radius, numbers)
    sx, sy = slip_at(before, nose)
    mu = numbers.mu_cushion + numbers.mu_cushion_angle * along
    e, gain = cushion_restitution(vn, numbers), numbers.e_cushion_topspin * min(1.0, max(0.0, topspin))
    if e < 1.0 or gain > 0.0:  # without a gain, a restitution of 1 depends only on `e_cushion`: leave out `min`
        e = min(1.0, e + gain)
    return impact(before, nose, (sx, sy * (1.0 + numbers.e_cushion_tangent)), rebound, mu, e)


@inlined
def gain_is_smooth(before, radius, numbers):
    """Returns whether the gain by the topspin has a derivative. It has one for a rolling ball, which always rolls."""
    vn, un, most = before.vn, before.un, numbers.e_cushion_topspin
    gain = most * min(1.0, max(0.0, (vn - un) / vn)) if vn > 0.0 else 0.0
    clamped = abs(cushion_restitution(vn, numbers) + gain - 1.0) <= ROUNDING
    slides, tiny = un != 0.0 or before.ut != 0.0, ROUNDING * vn
    return most == 0.0 or not (clamped or abs(vn - un) <= tiny or (slides and abs(un) <= tiny))


CUSHION = Cushion(han2005_variable)
