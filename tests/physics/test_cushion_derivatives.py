"""The derivatives of cushions agree with differences of the laws, in all their cases."""

import dataclasses

import numpy as np
import pytest

from billiards_env.engine.compile import scene_arrays
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
    rng, cases = np.random.default_rng(0), set()
    falling = {"e_cushion": 0.93, "e_cushion_loss": 0.1, "e_cushion_onset": 0.5, "e_cushion_floor": 0.7}
    for k in range(80):
        constants = {**falling, **weakest} if k % 4 == 3 else falling
        scene = scene_with(cushion, mu_cushion=(0.15, 0.4, 1.0, 2.0)[k % 4], **constants)
        motion = rng.normal(size=5) * (1.0, 1.0, (1.0, 8.0)[k % 2], 1.0, 2.0)
        motion[0] = rng.uniform(0.2, 4.0)
        found, law = derivative(motion, scene)
        expected = differences(motion, scene, 1e-6)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-7 * np.abs(expected).max(), err_msg=f"impact {k}")
        cases |= {("restitution", law.e_kind), ("stops", bool(law.stops)), ("sticks", law.friction.by_slip > 0.0)}
    assert len(cases) == 7


@pytest.mark.parametrize("mu", [0.05, 0.14, 0.6])
def test_the_derivative_of_a_mathavan_cushion_is_that_of_small_changes(mu):
    falling = {"e_cushion": 0.93, "e_cushion_loss": 0.1, "e_cushion_onset": 0.1, "e_cushion_floor": 0.3}
    scene, rng = scene_with("mathavan2010", mu_cushion=mu, **falling), np.random.default_rng(0)
    for k in range(8):
        motion = rng.normal(size=5) * (1.0, 1.0, (0.0, 1.0)[k % 2], (0.0, 1.0)[k % 2], 2.0)  # half of them roll
        motion[0] = rng.uniform(0.2, 4.0)
        found, _ = derivative(motion, scene)
        wide, narrow = differences(motion, scene, 4e-3, 11), differences(motion, scene, 2e-3, 11)
        free = [0, 1, 4, 5, 6, 10] if k % 2 == 0 else [*range(7), 10]  # a rolling ball has no change of slip
        off = np.abs(found[:, :11] - (4.0 * narrow - wide) / 3.0)[:, free]
        assert off.max() < 2e-5 * np.abs(found).max(), f"impact {k}"


def test_numbers_at_the_end_of_their_range_have_the_derivative_of_one_side():
    motion = np.array([1.5, 0.4, 1.5, 0.0, 0.3])
    smooth = scene_with("han2005", mu_cushion=0.0)
    head_on = np.array([1.5, 0.0, 1.5 + 1.5 * (smooth.table.cushion_height / RADIUS - 1.0), 0.0, 0.0])  # without slip
    found, law = derivative(head_on, smooth)
    assert law.friction.size == law.friction.by_slip == 0.0
    assert found[1, 1] == 1.0
    for name in ("han2005", "mathavan2010"):
        scene = scene_with(name)
        found, _ = derivative(motion, scene)
        column = 6 + CONSTANTS.index("e_cushion_loss")
        less = dataclasses.replace(scene, physics=dataclasses.replace(scene.physics, e_cushion_loss=1e-4))
        expected = (impact(motion, RADIUS, less) - impact(motion, RADIUS, scene)) / 1e-4
        np.testing.assert_allclose(found[:, column], expected, atol=2e-3 * np.abs(expected).max(), err_msg=name)
