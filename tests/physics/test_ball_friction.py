"""The friction of two balls in an impact. `tests/validation/test_collisions.py` compares throws with the formula."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from billiards_env.engine.compile import scene_arrays
from billiards_env.engine.space import ON_CLOTH
from billiards_env.physics.laws.balls_frictional import friction_coefficient
from billiards_env.scene import Balls, Physics, Scene
from billiards_env.scene.scene import SHAPES
from tests.helpers.impacts import energy, impact, rows_of, three_dimensional

R = 0.028575
SLOW, MEDIUM, FAST = 0.447, 1.341, 3.129  # m/s
LAW = Physics(ball_ball="frictional")
MU = scene_arrays(Scene(Balls.uniform(1), physics=LAW)).numbers


def pool(count=2, **physics):
    return Scene(Balls.uniform(count, R, 0.17), physics=Physics(ball_ball="frictional", **physics))


def test_the_friction_of_balls_falls_with_the_sliding_speed():
    speeds = (0, 0.1, 0.25, 0.5, 0.75, 1, 1.5, 2, 3, 5)
    expected = (0.11795, 0.10682, 0.09223, 0.07264, 0.05771, 0.04634, 0.03107, 0.02221, 0.01408, 0.01042)
    assert [friction_coefficient(MU, speed) for speed in speeds] == pytest.approx(expected, abs=6e-6)
    slower = scene_arrays(pool(mu_ball_factor=2.0, mu_ball_decay=0.5)).numbers
    assert friction_coefficient(slower, 2.0) == pytest.approx(0.019902 + 0.216 * math.exp(-1.0), abs=1e-15)


# Angle; velocity and spin of both balls before; the same after
BY_HAND = {
    "stun": (30, "1 0 0 0 0  0 0 0 0 0", "0.238084 -0.369072 0 0 5.365922  0.761916 0.369072 0 0 5.365922"),
    "rolling": (
        30,
        f"1 0 0 {1 / R} 0  0 0 0 0 0",
        "0.258969 -0.405246 1.482175 32.428423 1.711468  0.741031 0.405246 1.482175 -2.567203 1.711468",
    ),
    "draw and side": (
        -45,
        f"2 0 0 {-1 / R} {0.8 / R}  0 0 0 0 0",
        "1.007758 0.957758 0.48172 -34.513906 25.86324  0.992242 -0.957758 0.48172 0.48172 -2.133261",
    ),
    "both move": (
        10,
        "1 0.2 5 10 -20  -0.5 0.3 3 -7 12",
        "-0.416302 0.035499 5.097072 9.449479 -12.656505  0.916302 0.464501 3.097072 -7.550521 19.343495",
    ),
    "stick": (5, "1 0 0 0 0  0 0 0 0 0", "0.031321 -0.07225 0 0 1.089311  0.968679 0.07225 0 0 1.089311"),
}


@pytest.mark.parametrize("name", BY_HAND)
def test_impacts_computed_by_hand(name):
    angle, *motions = BY_HAND[name]
    before, after = (np.array(text.split(), float).reshape(2, 5) for text in motions)
    motion = np.hstack(impact(before[:, :2], before[:, 2:], angle, pool()))
    assert motion == pytest.approx(after, abs=6e-7)


def throw(cut, speed, scene, roll=0.0, side=0.0):
    """Returns the angle from the line of centres to the object ball's path, towards the cue ball's path, degrees.

    Args:
        cut: Angle of the cut, degrees.
        speed: Of the cue ball, m/s.
        scene: The scene.
        roll: Spin of the cue ball about the axis across its path, times the radius, per speed.
        side: Its spin about the vertical axis, in the same unit.
    """
    after, _ = impact([(speed, 0), (0, 0)], [(0, roll * speed / R, side * speed / R), (0, 0, 0)], cut, scene)
    return cut - math.degrees(math.atan2(after[1, 1], after[1, 0]))


def test_restitution_changes_the_throw_only_where_the_slip_stops():
    lossy = pool()
    for cut, expected in zip(range(5, 35, 5), (0.73, 1.48, 2.25, 3.05, 3.91, 4.84), strict=True):
        assert throw(cut, SLOW, lossy) == pytest.approx(expected, abs=0.0051)
    for cut in range(40, 90, 5):
        assert throw(cut, SLOW, lossy) == pytest.approx(throw(cut, SLOW, pool(e_ball=1.0)), abs=0.005)


@pytest.mark.parametrize("cut", [5.0, 14.5, 30.0, 48.6, 80.0])
def test_gearing_spin_does_not_throw(cut):
    """Alciatore, TP A.26: the surfaces roll on each other if R omega = v sin(cut)."""
    scene = pool(e_ball=1.0)
    assert throw(cut, 1.0, scene, side=math.sin(math.radians(cut))) == pytest.approx(0.0, abs=1e-12)


def test_the_largest_transfer_of_spin_is_five_fourteenths():
    """Alciatore, TP A.27."""
    _, spins = impact([(1, 0), (0, 0)], [(0, 0, 10.0), (0, 0, 0)], 0, pool(mu_ball=10.0))
    assert spins[:, 2] == pytest.approx([10 * 9 / 14, -10 * 5 / 14])


def rolled(velocity, spin, radius):
    """Returns the velocity of a ball when it begins to roll."""
    return 5 / 7 * velocity + 2 / 7 * radius * np.array([spin[1], -spin[0]])


MATHAVAN = [
    (1.539, 58.63, 33.83, 0.9141, 0.8306, 31.95, 32.23),
    (1.032, 39.31, 26.36, 0.5199, 0.5990, 32.48, 25.09),
    (1.364, 51.96, 40.52, 0.9168, 0.6762, 29.94, 38.64),
    (1.731, 65.94, 46.50, 1.2774, 0.7796, 27.34, 44.39),
    (0.942, 35.89, 18.05, 0.3834, 0.5789, 29.51, 17.17),
]


@pytest.mark.parametrize(("speed", "spin", "cut", "cue", "object_ball", "cue_angle", "object_angle"), MATHAVAN)
def test_impacts_of_snooker_balls_by_mathavan_2014(speed, spin, cut, cue, object_ball, cue_angle, object_angle):
    """Mathavan, Jackson and Parkin (2014) also compute the friction on the cloth during the impact.

    The expected values are those of their equations. Without this friction, speeds differ by at most 0.6 % and angles
    by at most 0.45 degrees.
    """
    physics = Physics(ball_ball="frictional", mu_ball=0.05, e_ball=0.89)
    scene = Scene(Balls.uniform(2, 0.02625, 0.1406), physics=physics)
    velocities, spins = impact([(speed, 0), (0, 0)], [(0, spin, 0), (0, 0, 0)], cut, scene)
    a, b = (rolled(velocity, spin, 0.02625) for velocity, spin in zip(velocities, spins, strict=True))
    assert (np.hypot(*a), np.hypot(*b)) == pytest.approx((cue, object_ball), rel=6e-3)
    assert math.degrees(math.atan2(-a[1], a[0])) == pytest.approx(cue_angle, abs=0.45)
    assert math.degrees(math.atan2(b[1], b[0])) == pytest.approx(object_angle, abs=0.07)


@st.composite
def impacts(draw):
    velocity, spin = st.floats(-5, 5), st.floats(-200, 200)
    velocities = np.array([[draw(velocity) for _ in range(2)] for _ in range(2)])
    spins = np.array([[draw(spin) for _ in range(3)] for _ in range(2)])
    fixed = draw(st.booleans())
    mass = (draw(st.floats(0.01, 1)), math.inf if fixed else draw(st.floats(0.01, 1)))
    if fixed:
        velocities[1], spins[1] = 0, 0
    radius = draw(st.floats(0.01, 0.05)), draw(st.floats(0.01, 0.05))
    mu, e = draw(st.sampled_from([None, 0.0, 0.06, 2.0])), draw(st.floats(0, 1))
    factor, shape = draw(st.sampled_from([1.0, 2.5])), draw(st.sampled_from(SHAPES))
    physics = Physics(ball_ball="frictional", cushion="restitution", mu_ball=mu, mu_ball_factor=factor, e_ball=e)
    angle = draw(st.floats(0, 360))
    n = np.array([math.cos(math.radians(angle)), math.sin(math.radians(angle))])
    if (velocities[0] - velocities[1]) @ n < 0:
        velocities[0] = -velocities[0] + 2 * velocities[1]  # reverses the relative velocity
    return velocities, spins, angle, Scene(Balls(radius, mass, shape=shape), physics=physics)


@given(impacts())
@example((np.array([[1.0, 0.0], [0.0, 0.0]]), np.array([[3.0, 0.0, 0.0], [0.0, 0.0, 0.0]]), 0.0, pool()))  # no slip
def test_the_impact_is_that_of_spheres_in_three_dimensions(case):
    velocities, spins, _, scene = case
    actual, (expected_velocities, expected_spins) = impact(*case), three_dimensional(*case)
    assert actual[0] == pytest.approx(expected_velocities, abs=1e-11)
    assert actual[1] == pytest.approx(expected_spins, abs=1e-9)
    arrays = scene_arrays(scene)
    before, after = (energy(rows_of(*motion, arrays.radius), arrays) for motion in ((velocities, spins), actual))
    assert after <= before * (1 + 1e-12)
    mass = np.array(scene.balls.mass)
    if np.isfinite(mass).all():
        assert mass @ actual[0] == pytest.approx(mass @ velocities, abs=1e-12)
    else:
        assert not actual[0][1].any()
        assert not actual[1][1].any()


@given(st.floats(0.02, 0.08), st.floats(0.02, 0.08))
def test_the_distance_at_contact_is_that_of_touching_spheres(first, second):
    balls = Balls((first, second), (0.1, 0.1), shape="sphere")
    expected = math.sqrt((first + second) ** 2 - (first - second) ** 2)
    assert balls.contact_distances(0)[1] == pytest.approx(expected, rel=1e-15)
    arrays = scene_arrays(Scene(balls))
    for i, j in itertools.product(range(2), repeat=2):
        reach = arrays.space.contact_distance.py_func(i, j, arrays)
        assert reach == balls.contact_distances(i)[j] == balls.contact_distances(j)[i]


@pytest.mark.parametrize("shape", SHAPES)
def test_disks_and_equal_spheres_have_horizontal_normals(shape):
    assert scene_arrays(Scene(Balls((0.03, 0.03), (0.1, 0.2), shape=shape))).space == ON_CLOTH
    assert scene_arrays(Scene(Balls((0.03, 0.04), (0.1, 0.2)))).space == ON_CLOTH
