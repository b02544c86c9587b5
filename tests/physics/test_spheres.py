"""Impacts of spheres of different size on a table."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from billiards_env.engine.compile import scene_arrays
from billiards_env.physics.clusters.friction import tilt_of
from billiards_env.physics.geometry.contact import contact_distance
from billiards_env.scene import Balls, Physics, Scene
from tests.helpers.impacts import energy, impact, normal_between, three_dimensional

RADII = st.floats(0.02, 0.08)


def spheres(radius, mass=(0.1, 0.15), shape="sphere", **physics):
    laws = Physics(ball_ball="frictional", cushion="restitution", **physics)
    return Scene(Balls(radius, mass, shape=shape), physics=laws)


def motions(seed, angle):
    """Returns random velocities and spins of two balls that approach each other."""
    rng = np.random.default_rng(seed)
    v, w = rng.normal(size=(2, 2)), rng.normal(size=(2, 3)) * 30
    n = np.array([math.cos(math.radians(angle)), math.sin(math.radians(angle))])
    closing = (v[0] - v[1]) @ n
    return v - np.outer([min(2 * closing, 0.0), 0.0], n), w


def _python(kernel: Any) -> Any:
    """Returns the Python function of a kernel."""
    return kernel.py_func


@given(RADII, RADII)
def test_the_distance_at_contact_is_that_of_touching_spheres(first, second):
    balls = Balls((first, second), (0.1, 0.1), shape="sphere")
    expected = math.sqrt((first + second) ** 2 - (first - second) ** 2)
    assert balls.contact_distances(0)[1] == pytest.approx(expected, rel=1e-15)
    arrays = scene_arrays(Scene(balls))
    for i in range(2):
        for j in range(2):
            found = _python(contact_distance)(arrays.spheres, arrays.radius, i, j)
            assert found == balls.contact_distances(i)[j] == balls.contact_distances(j)[i]


def test_the_normal_is_inclined():
    arrays = scene_arrays(spheres((0.01, 0.04)))
    assert _python(tilt_of)(arrays.spheres, 0, 1) == pytest.approx((0.8, 0.6), rel=1e-15)
    assert _python(tilt_of)(arrays.spheres, 1, 0) == pytest.approx((0.8, -0.6), rel=1e-15)


@pytest.mark.parametrize("shape", ["disk", "sphere"])
def test_disks_and_equal_spheres_need_no_array(shape):
    assert scene_arrays(Scene(Balls((0.03, 0.03), (0.1, 0.2), shape=shape))).spheres is None
    assert scene_arrays(Scene(Balls((0.03, 0.04), (0.1, 0.2)))).spheres is None


@given(RADII, RADII, st.integers(0, 2**32), st.floats(-180, 180))
def test_smooth_elastic_spheres_exchange_velocities_as_disks_do(first, second, seed, angle):
    v, w = motions(seed, angle)
    scenes = (spheres((first, second), shape=shape, e_ball=1.0, mu_ball=0.0) for shape in ("sphere", "disk"))
    found, disks = (impact(v, w, angle, scene) for scene in scenes)
    assert np.array_equal(found[0], disks[0])
    assert np.array_equal(found[1], disks[1])
    assert energy(*found, spheres((first, second))) == pytest.approx(energy(v, w, spheres((first, second))))


def test_the_smaller_ball_grips_more():
    """The normal impulse is the horizontal one divided by the cosine of the inclination."""
    scene, v, w = spheres((0.01, 0.04), mu_ball=0.05), [(1, 0.5), (0, 0)], np.zeros((2, 3))
    _, _, normal, friction = three_dimensional(v, w, 0.0, scene)
    horizontal = 1.95 * 1.0 / (1 / 0.1 + 1 / 0.15)
    assert normal == pytest.approx(horizontal / 0.8)
    assert friction == pytest.approx(0.05 * normal)
    along_normal = impact(v, w, 0.0, scene)[1][0] @ normal_between(scene, 0.0)
    assert along_normal == pytest.approx(0.0, abs=1e-13)  # friction has no moment about the normal
