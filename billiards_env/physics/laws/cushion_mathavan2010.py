"""The impact on a cushion by Mathavan, Jackson and Parkin (2010), with friction at the cushion and at the cloth."""

from __future__ import annotations

from billiards_env.jit import inlined, kernel
from billiards_env.physics.laws.cushion import Cushion, CushionMotion, cushion_restitution, nose_of, spins_of
from billiards_env.physics.laws.mathavan import CushionNose, follow_impact


@inlined
def contact_of(radius, numbers):
    """Returns the `CushionNose` of a ball with a radius, m."""
    nose = nose_of(radius, numbers)
    return CushionNose(nose.sin, nose.cos, numbers.mu_cushion, numbers.mu_cloth)


@inlined
def motion_of(before):
    """Returns a `CushionMotion` as the motion (vx, vy, rwx, rwy, rwz) of `follow_impact`."""
    rwn, rwt = spins_of(before)
    return -before.vt, before.vn, -rwt, rwn, before.rwz


@kernel
def mathavan2010(before, radius, rebound, numbers, solution):
    """Returns a ball's motion after an impact by `follow_impact`, as `cushion_stronge.stronge` does."""
    e = cushion_restitution(before.vn, numbers)
    (vx, vy, rwx, rwy, rwz), _, _ = follow_impact(motion_of(before), contact_of(radius, numbers), e)
    raised = vy > -rebound
    vn = -rebound if raised else vy
    return CushionMotion(vn, -vx, vn + rwx, rwy - vx, rwz), raised


@kernel
def impact_is_smooth(before, radius, numbers):
    """Returns whether an impact has a derivative; see `follow_impact`."""
    e = cushion_restitution(before.vn, numbers)
    _, smooth, _ = follow_impact(motion_of(before), contact_of(radius, numbers), e)
    return smooth


CUSHION = Cushion(mathavan2010, work=500)
