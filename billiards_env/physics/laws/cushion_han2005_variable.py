"""The impact on a cushion by Han (2005), with a friction that depends on the angle and a restitution on the topspin.

Fits of single rebounds of 182 recorded three-cushion shots (the tracks of the simulator tailuge/billiards) gave a
friction that grows with the angle to the normal, and a restitution that grows with the topspin. The law is a simple
form of both:

    mu = mu_cushion + mu_cushion_angle sin^2(phi)    e = e(v_n) + e_cushion_topspin min(1, max(0, R omega_t / v_n))

with the angle phi of the velocity to the normal, the spin omega_t along the cushion, which is v_n / R for a ball that
rolls, and the restitution e(v_n) of the other cushions.
"""

from __future__ import annotations

from billiards_env.jit import inlined
from billiards_env.physics.laws.cushion import Cushion, cushion_restitution, nose_of
from billiards_env.physics.laws.cushion_han2005 import impact


@inlined
def han2005_variable(before, radius, rebound, numbers, solution):
    """Returns a ball's motion after an impact on a cushion, as `cushion_han2005.han2005` does."""
    vn, vt = before.vn, before.vt
    square = vn * vn + vt * vt
    along = vt * vt / square if square > 0.0 else 0.0
    topspin = (vn - before.un) / vn if vn > 0.0 else 0.0  # 1 for a ball that rolls
    mu = numbers.mu_cushion + numbers.mu_cushion_angle * along
    gain = numbers.e_cushion_topspin * min(1.0, max(0.0, topspin))
    e = min(1.0, cushion_restitution(vn, numbers) + gain)
    return impact(before, nose_of(before, radius, numbers), rebound, mu, e)


CUSHION = Cushion(han2005_variable)
