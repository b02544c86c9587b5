"""The derivatives of cushions agree with differences of the laws, in all their courses."""

import dataclasses

import numpy as np
import pytest

from billiards_env.engine.modes import scene_arrays
from billiards_env.physics.cushion import CushionMotion, cushion_impact
from billiards_env.physics.cushion_derivatives import TABLE, CushionChange, cushion_lane, cushion_law
from billiards_env.physics.lanes import D_E_CUSHION, LANE_WIDTH
from billiards_env.scene import Scene

RADIUS = 0.0286
CONSTANTS = (
    "e_cushion",
    "e_cushion_loss",
    "e_cushion_onset",
    "e_cushion_floor",
    "mu_cushion",
    "cushion_frequency_ratio",
)


def scene_with(cushion, **physics):
    """Returns carom with a cushion and with these constants."""
    scene = Scene.named("carom")
    return dataclasses.replace(scene, physics=dataclasses.replace(scene.physics, cushion=cushion, **physics))


def impact(motion, radius, scene):
    """Returns the motion (5,) after an impact."""
    return np.array(cushion_impact(CushionMotion(*motion), radius, 0.0, scene_arrays(scene))[0])


def differences(motion, scene, step, count=12):
    """Returns the central differences of `impact` by the motion, the radius and the constants, (5, count)."""

    def moved(c, by):
        if c < 5:
            return impact(motion + by * np.eye(5)[c], RADIUS, scene)
        if c == 5:
            return impact(motion, RADIUS * (1.0 + by), scene)
        name = CONSTANTS[c - 6]
        physics = dataclasses.replace(scene.physics, **{name: getattr(scene.physics, name) + by})
        return impact(motion, RADIUS, dataclasses.replace(scene, physics=physics))

    columns = [(moved(c, step) - moved(c, -step)) / (2.0 * step) for c in range(count)]
    columns[5:6] = [column / RADIUS for column in columns[5:6]]
    return np.stack(columns, axis=1)


def derivative(motion, scene):
    """Returns the same by `cushion_lane`, and the `CushionLaw`."""
    arrays, table = scene_arrays(scene), np.empty(TABLE)
    law = cushion_law(CushionMotion(*motion), RADIUS, table, arrays)
    columns = []
    for unit in np.eye(12):
        lane = np.zeros(LANE_WIDTH)
        lane[D_E_CUSHION : D_E_CUSHION + len(CONSTANTS)] = unit[6:]
        columns.append(cushion_lane(CushionChange._make((*unit[:6], lane)), law, table, arrays))
    return np.array(columns).T, law


@pytest.mark.parametrize(
    ("cushion", "weakest"),
    [
        ("han2005", {"e_cushion": 0.06, "e_cushion_floor": 0.01}),
        ("stronge", {"e_cushion": 0.5, "e_cushion_floor": 0.48}),
    ],
)
def test_the_derivative_of_an_impact_is_that_of_small_changes(cushion, weakest):
    rng, courses = np.random.default_rng(0), set()
    falling = {"e_cushion": 0.93, "e_cushion_loss": 0.1, "e_cushion_onset": 0.5, "e_cushion_floor": 0.7}
    for k in range(80):
        constants = {**falling, **weakest} if k % 4 == 3 else falling
        scene = scene_with(cushion, mu_cushion=(0.15, 0.4, 1.0, 2.0)[k % 4], **constants)
        motion = rng.normal(size=5) * (1.0, 1.0, (1.0, 8.0)[k % 2], 1.0, 2.0)
        motion[0] = rng.uniform(0.2, 4.0)
        found, law = derivative(motion, scene)
        expected = differences(motion, scene, 1e-6)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-7 * np.abs(expected).max(), err_msg=f"impact {k}")
        courses |= {("restitution", law.e_kind), ("stops", bool(law.stops)), ("sticks", law.friction.by_slip > 0.0)}
    assert len(courses) == 7


def test_the_derivative_of_a_mathavan_cushion_is_near_that_of_small_changes():
    scene = scene_with("mathavan2010")
    motion = np.array([1.5, 0.4, 1.0, -0.6, 0.3])
    found, _ = derivative(motion, scene)
    expected = differences(motion, scene, 3e-3, 5)
    np.testing.assert_allclose(found[:, :5], expected, atol=3e-3)
