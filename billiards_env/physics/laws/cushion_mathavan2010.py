"""The impact on a cushion by Mathavan, Jackson and Parkin (2010), with friction at the cushion and at the cloth."""

from __future__ import annotations

from billiards_env.jit import inlined, kernel
from billiards_env.physics.laws.cushion import Cushion, CushionMotion, cushion_restitution, nose_of
from billiards_env.physics.laws.mathavan import CushionNose, integrate_impact


@inlined
def arguments_of(before, radius, numbers):
    """Returns the motion (vx, vy, rwx, rwy, rwz), the `CushionNose` and the restitution of `integrate_impact`."""
    nose = nose_of(before, radius, numbers)
    contact = CushionNose(nose.sin, nose.cos, numbers.mu_cushion, numbers.mu_cloth)
    e = cushion_restitution(before.vn, numbers)
    return (-before.vt, before.vn, -nose.rwt, nose.rwn, before.rwz), contact, e


@kernel
def mathavan2010(before, radius, rebound, numbers, solution):
    """Returns a ball's motion after an impact by `integrate_impact`, as `cushion_stronge.stronge` does."""
    motion, nose, e = arguments_of(before, radius, numbers)
    vx, vy, rwx, rwy, rwz = integrate_impact(motion, nose, e)
    raised = vy > -rebound
    vn = -rebound if raised else vy
    return CushionMotion(vn, -vx, vn + rwx, rwy - vx, rwz), raised


CUSHION = Cushion(mathavan2010, work=500)
