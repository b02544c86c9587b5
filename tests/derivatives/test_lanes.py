"""The derivatives of cushions agree with differences of the laws, in all their cases."""

import dataclasses

import numpy as np
import pytest

from billiards_env.derivatives.lanes import Wall, cushion_is_smooth, cushion_solution, lane_kernels
from billiards_env.engine.compile import scene_arrays, scene_kernels
from billiards_env.physics.laws.cushion import CushionMotion, cushion_restitution
from billiards_env.physics.state import BallState, LawNumbers, law_numbers_of
from billiards_env.scene import Scene
from tests.helpers.cushion_impacts import law_jacobians

RADIUS = 0.0286
CONSTANTS = (
    "e_cushion",
    "e_cushion_loss",
    "e_cushion_onset",
    "e_cushion_floor",
    "mu_cushion",
    "cushion_frequency_ratio",
    "cushion_height",
    "mu_cloth",
)


def scene_with(cushion, **physics):
    """Returns carom with a cushion and with these constants."""
    scene = Scene.named("carom")
    return dataclasses.replace(scene, physics=dataclasses.replace(scene.physics, cushion=cushion, **physics))


def with_tangents(scene):
    """Returns the arrays of a scene with the tangents of its laws."""
    return scene_arrays(scene)._replace(laws=lane_kernels(scene_kernels(scene), constants=True).scene.laws)


def rebound(motion, radius, scene):
    """Returns the motion (5,) after an impact."""
    arrays = scene_arrays(scene)
    return np.array(arrays.laws.cushion(CushionMotion(*motion), radius, 0.0, arrays.numbers, None)[0])


def differences(motion, scene, step):
    """Returns the central differences of `rebound` by the motion, the radius and the first constants, (5, 13)."""

    def moved(c, by):
        if c < 5:
            return rebound(motion + by * np.eye(5)[c], RADIUS, scene)
        if c == 5:
            return rebound(motion, RADIUS * (1.0 + by), scene)
        name = CONSTANTS[c - 6]
        if name == "cushion_height":
            table = dataclasses.replace(scene.table, cushion_height=scene.table.cushion_height + 0.1 * by)
            return rebound(motion, RADIUS, dataclasses.replace(scene, table=table))
        physics = dataclasses.replace(scene.physics, **{name: getattr(scene.physics, name) + by})
        return rebound(motion, RADIUS, dataclasses.replace(scene, physics=physics))

    columns = [(moved(c, step) - moved(c, -step)) / (2.0 * step) for c in range(13)]
    columns[5], columns[12] = columns[5] / RADIUS, columns[12] / 0.1
    return np.stack(columns, axis=1)


def derivative(motion, scene):
    """Returns the same by the tangent of the law, and the derivative by the last constant."""
    arrays, columns, (vn, vt, un, ut, rwz) = with_tangents(scene), [], motion
    before, ball = CushionMotion(*motion), BallState(0.0, 0.0, vn, vt, un, ut, rwz / RADIUS)
    solution = cushion_solution(ball, Wall(1.0, 0.0, 0.0), RADIUS, arrays)
    numbers, zeros = law_numbers_of(arrays.numbers), LawNumbers(*np.zeros(len(LawNumbers._fields)))
    for unit in np.eye(6 + len(CONSTANTS)):
        change = zeros._replace(**dict(zip(CONSTANTS, unit[6:], strict=True)))
        at = before, RADIUS, 0.0, numbers, solution
        columns.append(arrays.laws.d_cushion(*at, CushionMotion(*unit[:5]), unit[5], change)[1][0])
    return np.array(columns).T


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
        actual, expected = derivative(motion, scene)[:, :13], differences(motion, scene, 1e-6)
        np.testing.assert_allclose(actual, expected, rtol=0, atol=1e-7 * np.abs(expected).max(), err_msg=f"impact {k}")
        e, stops = cushion_restitution(motion[0], scene_arrays(scene).numbers), rebound(motion, RADIUS, scene)[0] == 0.0
        by_mu, by_ratio = (actual[:, 6 + CONSTANTS.index(name)] for name in ("mu_cushion", "cushion_frequency_ratio"))
        cases |= {("stops", bool(stops)), ("sticks", bool(by_ratio.any() or not by_mu.any()))}
        cases |= {("restitution", e == constants["e_cushion"]), ("floor", e == constants["e_cushion_floor"])}
    assert len(cases) == 8


def test_the_derivative_of_a_mathavan_cushion_is_that_of_its_equation():
    rng, m = np.random.default_rng(1), 6
    values = rng.normal(size=(9, m)) * np.array([0.0, 1.0, 1.0, 1.0, 2.0, 0.0, 0.0, 0.0, 0.0])[:, None]
    values[0] = rng.uniform(0.2, 4.0, m)
    values[2:4, ::2] = 0.0  # half of the balls roll
    values[5], values[6] = RADIUS, rng.uniform(0.3, 0.98, m)
    values[7], values[8] = rng.permutation(np.repeat((0.05, 0.14, 0.5), m // 3)), rng.uniform(0.1, 0.3, m)
    expected = law_jacobians(values, Scene.named("carom").table.cushion_height)
    columns = [*range(7), 6 + CONSTANTS.index("mu_cushion"), 6 + CONSTANTS.index("mu_cloth")]
    for k, column in enumerate(values.T):
        scene = scene_with("mathavan2010", e_cushion=column[6], mu_cushion=column[7], mu_slide=column[8])
        changed = slice(None) if column[2] else [0, 1, 4, 5, 6, 7, 8]  # a rolling ball has no change of slip
        jacobian = derivative(column[:5], scene)[:, columns][:, changed]
        off = np.abs(jacobian - expected[:, changed, k]).max()
        assert off < 1e-9 * np.abs(jacobian).max(), f"impact {k}"


def test_numbers_at_the_end_of_their_range_have_the_derivative_of_one_side():
    motion = np.array([1.5, 0.4, 1.5, 0.0, 0.3])
    smooth = scene_with("han2005", mu_cushion=0.0)
    head_on = np.array([1.5, 0.0, 1.5 + 1.5 * (smooth.table.cushion_height / RADIUS - 1.0), 0.0, 0.0])  # without slip
    assert derivative(head_on, smooth)[1, 1] == 1.0
    for name in ("han2005", "mathavan2010"):
        scene = scene_with(name)
        jacobian = derivative(motion, scene)
        column = 6 + CONSTANTS.index("e_cushion_loss")
        less = dataclasses.replace(scene, physics=dataclasses.replace(scene.physics, e_cushion_loss=1e-4))
        expected = (rebound(motion, RADIUS, less) - rebound(motion, RADIUS, scene)) / 1e-4
        np.testing.assert_allclose(jacobian[:, column], expected, atol=2e-3 * np.abs(expected).max(), err_msg=name)


FALLS = {"e_cushion": 0.875, "e_cushion_loss": 0.125, "e_cushion_onset": 1.0, "e_cushion_floor": 0.75}
GAINS = {"e_cushion": 0.75, "e_cushion_topspin": 0.5}
KINKS = {  # the numbers; the normal speed and the slips at the kink; a number whose change of 1e-9 leaves the kink
    "onset": (FALLS, (1.0, 0.3, 0.2), "e_cushion_onset"),
    "floor": (FALLS, (2.0, 0.3, 0.2), "e_cushion_floor"),
    "most": (GAINS, (1.0, 0.5, 0.2), "e_cushion"),
    "no topspin": (GAINS, (1.0, 1.0, 0.2), None),
    "most topspin": (GAINS, (1.0, 0.0, 0.2), None),
}


@pytest.mark.parametrize("kink", KINKS)
def test_a_kink_of_the_restitution_has_no_derivative(kink):
    numbers, (vn, un, ut), name = KINKS[kink]
    for cushion in ("restitution", "han2005", "stronge", "mathavan2010") if numbers is FALLS else ("han2005_variable",):

        def smooth(vn, un, ut, cushion=cushion, **changes):
            arrays = with_tangents(scene_with(cushion, **numbers | changes))
            ball = BallState(0.0, 0.0, vn, 0.4, un, ut, 5.0)
            return cushion_is_smooth(ball, Wall(1.0, 0.0, 0.0), RADIUS, arrays)

        assert not smooth(vn, un, ut), cushion
        assert not smooth(vn * (1.0 + 1e-15), un, ut), cushion
        assert smooth(vn, un + 1e-6, ut, **({name: numbers[name] - 1e-9} if name else {})), cushion
        assert smooth(vn, un, ut, e_cushion_loss=0.0, e_cushion_topspin=0.0), cushion


def test_a_ball_that_rolls_has_the_most_topspin_and_a_derivative():
    scene = scene_with("han2005_variable", **FALLS | {"e_cushion_topspin": 0.05, "e_cushion_onset": 0.5})
    motion = np.array([1.0, 0.4, 0.0, 0.0, 0.1])
    ball = BallState(0.0, 0.0, 1.0, 0.4, 0.0, 0.0, 0.1 / RADIUS)
    assert cushion_is_smooth(ball, Wall(1.0, 0.0, 0.0), RADIUS, with_tangents(scene))
    changed = [0, 1, 4]  # a rolling ball has no change of slip
    expected = differences(motion, scene, 1e-6)[:, changed]
    np.testing.assert_allclose(derivative(motion, scene)[:, changed], expected, atol=1e-7 * np.abs(expected).max())
