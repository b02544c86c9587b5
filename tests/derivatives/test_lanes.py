"""The derivatives of cushions agree with differences of the laws, in all their cases."""

import dataclasses

import mpmath
import numpy as np
import pytest

from benchmarks.reference.oracle import mathavan as reference
from billiards_env.derivatives.lanes import Wall, cushion_is_smooth, cushion_solution, lane_kernels
from billiards_env.derivatives.state_laws import LawNumbers, law_numbers_of
from billiards_env.derivatives.tangent import tangent_of
from billiards_env.engine.compile import scene_arrays, scene_kernels
from billiards_env.physics.laws.cushion import CushionMotion, cushion_restitution
from billiards_env.physics.laws.mathavan import CushionNose, follow_impact
from billiards_env.physics.state import BallState
from billiards_env.scene import Scene

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


SMALL_SLIPS = [  # the same; the law once had an error of up to 0.6 of the normal velocity
    (  # the slip at the nose almost stops, and begins again
        (-0.5459130408019652, 1.308226205794522, 0.0, 0.0, -0.1063503967833219),
        (0.4, 0.14, 0.212, 0.995),
    ),
    (  # the same, with other numbers
        (1.325559916144505, 0.7119888797552144, -0.5705124280350817, 1.3169898873855694, 1.0707397642135346),
        (0.5555976491075629, 0.16290158641632824, 0.3892910342980319, 0.7842610252877092),
    ),
    (  # the slip at the cloth creeps
        (0.0059244981177869, 0.6032999340362504, -0.6371535624817924, -0.1876688503436501, -1.655022636462926),
        (0.45030810430478097, 0.34964069725761016, 0.6396100876654974, 0.39306281891689193),
    ),
    (  # both slips almost stop at one instant
        (0.47925201622346436, 1.0412385609025452, 0.5596534433776467, 0.4792738464730434, 0.540482757389454),
        (0.4, 0.14, 0.212, 0.995),
    ),
]
MATHAVAN = [  # velocities and spins before; sine, friction at the cushion and at the cloth, restitution; what happens
    ((0.5, 1.0, -1.0, 0.5, 0.3), (0.4, 0.14, 0.212, 0.98)),  # it rolls, and the slip on the cloth begins
    ((0.071, 2.003, -0.423, 0.458, 0.287), (0.4, 0.14, 0.212, 0.98)),  # the nose sticks, and slips again
    ((-0.561, 2.247, 0.376, 0.337, -0.561), (0.562, 0.457, 0.489, 0.854)),  # the same, with more friction
    ((0.2, 1.0, 0.3, 0.1, 0.4), (-0.3, 0.8, 0.2, 0.9)),  # the ball leaves the cloth
    *(pytest.param(*case, marks=pytest.mark.slow) for case in SMALL_SLIPS),
]


@pytest.mark.parametrize(("before", "numbers"), MATHAVAN)
def test_a_mathavan_cushion_and_its_derivative_are_those_of_the_50_digit_reference(before, numbers):
    """The law once had an error of up to 1e-7, and jumped by it if the motion before changed by 1e-9."""
    rng, (sin, *others), step = np.random.default_rng(0), numbers, 1e-12
    change, d_sin, d_others = rng.normal(size=5), 0.1 * rng.normal(), 0.1 * rng.normal(size=3)
    change[2:4] = (-change[1], change[0]) if before[1] == -before[2] else change[2:4]  # a rolling ball keeps rolling
    cos = float(np.sqrt(1.0 - sin * sin))
    d_nose = CushionNose(d_sin, -sin / cos * d_sin, *d_others[:2].tolist())
    nose, d_before = CushionNose(sin, cos, *others[:2]), tuple(change.tolist())
    result, change = tangent_of(follow_impact)(before, nose, others[2], d_before, d_nose, float(d_others[2]))
    assert result == follow_impact(before, nose, others[2])
    (after, smooth, _), (d_after, _, _) = result, change
    assert smooth
    with mpmath.workdps(50):

        def exact(by):
            moved = [mpmath.mpf(x) + by * mpmath.mpf(dx) for x, dx in zip(before, d_before, strict=True)]
            if before[1] == -before[2]:
                moved[2:4] = -moved[1], moved[0]
            values = [mpmath.mpf(x) + by * mpmath.mpf(dx) for x, dx in zip(nose, d_nose, strict=True)]
            return reference.impact(moved, reference.Nose(*values), others[2] + by * mpmath.mpf(float(d_others[2])))

        ends = [exact(sign * mpmath.mpf(step)) for sign in (-1, 1)]
        error = [float(a - (x + y) / 2) for a, x, y in zip(after, *ends, strict=True)]
        slope = [float((y - x) / (2 * mpmath.mpf(step))) for x, y in zip(*ends, strict=True)]
    np.testing.assert_allclose(error, 0.0, atol=2e-14 * before[1])
    np.testing.assert_allclose(d_after, slope, rtol=0, atol=1e-10 * np.abs(slope).max())


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
