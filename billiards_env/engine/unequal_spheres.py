"""Spheres of different sizes on the cloth: the kernels that differ from `on_cloth`, as normals are not horizontal.

All scenes with flight use them, also those with balls of one size.
"""

from __future__ import annotations

from billiards_env.jit import inlined
from billiards_env.physics.laws.balls import distance_of, tilt_between


@inlined
def contact_distance(i, j, scene):
    """Implements `Space.contact_distance`."""
    return distance_of(True, scene.radius[i], scene.radius[j])


@inlined
def tilt(i, j, scene):
    """Implements `Space.tilt`."""
    return tilt_between(True, scene.radius[i], scene.radius[j])
