"""Impacts of spheres of different size on a table."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from billiards_env.engine.modes import scene_arrays
from billiards_env.physics.contact import contact_distance
from billiards_env.physics.friction import tilt_of
from billiards_env.physics.state import UY, VY, WZ
from billiards_env.scene import Balls, Physics, Scene
from tests.helpers import rubbing_clusters as clusters
from tests.helpers.impacts import energy, impact

RADII = st.floats(0.02, 0.08)


def spheres(radius, mass=(0.1, 0.15), shape="sphere", **physics):
    laws = Physics(ball_ball="frictional", cushion="restitution", **physics)
    return Scene(Balls(radius, mass, shape=shape), physics=laws)


def normal_between(scene, angle):
    """Returns the unit normal of two touching balls on a table, from the centres in three dimensions."""
    low, high = scene.balls.radius
    apart = math.sqrt((low + high) ** 2 - (high - low) ** 2)
    line = np.array([apart * math.cos(math.radians(angle)), apart * math.sin(math.radians(angle)), high - low])
    return line / np.linalg.norm(line)


def three_dimensional(velocities, spins, angle, scene):
    """Computes the impact with vectors in three dimensions, and drops the vertical velocity.

    Returns the velocities (2, 2) and the spins (2, 3) after it, and the normal impulse and the friction, kg m/s.
    """
    physics, radius, mass = scene.physics, scene.balls.radius, np.array(scene.balls.mass)
    n = normal_between(scene, angle)
    h = np.array([*n[:2], 0.0]) / math.hypot(*n[:2])
    v, w = np.pad(np.array(velocities, float), ((0, 0), (0, 1))), np.array(spins, float)
    horizontal = (1 + physics.e_ball) * ((v[0] - v[1]) @ h) / (1 / mass).sum()
    v[0] -= horizontal / mass[0] * h  # the slate takes the vertical part
    v[1] += horizontal / mass[1] * h
    surface = v[0] + np.cross(w[0], radius[0] * n) - v[1] - np.cross(w[1], -radius[1] * n)
    slip = surface - (surface @ n) * n
    speed, normal = np.linalg.norm(slip), horizontal / (n @ h)
    mu = 0.009951 + 0.108 * math.exp(-1.088 * speed) if physics.mu_ball is None else physics.mu_ball
    size = min(mu * physics.mu_ball_factor * normal, speed / (3.5 * (1 / mass).sum()))
    force = -size * slip / speed if speed > 0 else np.zeros(3)
    v += np.stack([force, -force]) / mass[:, None]
    for k in range(2):
        w[k] += np.cross(radius[k] * n, force) / (0.4 * mass[k] * radius[k] ** 2)
    return v[:, :2], w, normal, size


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


@given(
    RADII,
    RADII,
    st.integers(0, 2**32),
    st.floats(-180, 180),
    st.floats(0, 1),
    st.sampled_from([None, 0.05, 0.5]),
    st.sampled_from([1.0, 2.5]),
)
def test_an_impact_is_that_of_spheres_in_three_dimensions(first, second, seed, angle, e, mu, factor):
    scene = spheres((first, second), e_ball=e, mu_ball=mu, mu_ball_factor=factor)
    v, w = motions(seed, angle)
    velocities, spins = impact(v, w, angle, scene)
    expected_velocities, expected_spins, _, _ = three_dimensional(v, w, angle, scene)
    assert velocities == pytest.approx(expected_velocities, abs=1e-13)
    assert spins == pytest.approx(expected_spins, abs=1e-11)
    assert energy(velocities, spins, scene) <= energy(v, w, scene) * (1 + 1e-14)
    mass = np.array(scene.balls.mass)
    assert mass @ velocities == pytest.approx(mass @ v, abs=1e-15)


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


@given(st.integers(0, 2**32), st.booleans())
def test_two_separate_impacts_at_one_instant_are_those_of_two_single_impacts(seed, fixed):
    places = np.array([[0.0, 0.0], [0.8, 0.6], [9.0, 0.0], [9.0, 1.0]])
    _, _, rows, _, arrays = clusters.drawn(seed, 4, 0.9, None, fixed, spheres=True)
    both, _ = clusters.collided(places, rows, [(0, 1), (2, 3)], arrays)
    single = clusters.collided(places, rows, [(0, 1)], arrays)[0]
    single = clusters.collided(places, single, [(2, 3)], arrays)[0]
    assert both == pytest.approx(single, abs=1e-12)


@given(st.integers(0, 2**32), st.floats(0, 1))
def test_a_single_impact_has_no_preferred_order_or_side(seed, e):
    _, places, rows, _, arrays = clusters.drawn(seed, 3, e, None, False, spheres=True)
    found, _ = clusters.collided(places, rows, [(0, 1)], arrays)
    names = "radius", "inv_mass", "spheres"
    swapped = arrays._replace(**{name: getattr(arrays, name)[::-1].copy() for name in names})  # contiguous
    assert np.array_equal(clusters.collided(places[::-1], rows[::-1].copy(), [(1, 2)], swapped)[0][::-1], found)
    mirror = np.ones(rows.shape[1])
    mirror[[VY, UY, WZ]] = -1
    assert np.array_equal(clusters.collided(places * [1, -1], rows * mirror, [(0, 1)], arrays)[0], found * mirror)
