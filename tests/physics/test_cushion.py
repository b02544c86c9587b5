import math

import mpmath
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from benchmarks.reference.oracle import mathavan as reference
from billiards_env.engine.compile import scene_arrays
from billiards_env.physics.ball_cushion import reflect_both
from billiards_env.physics.laws.cushion import CushionMotion, cushion_restitution
from billiards_env.physics.laws.cushion_stronge import friction_impulse
from billiards_env.physics.laws.mathavan import CushionNose, follow_impact
from billiards_env.physics.state import UX, UY, VX, VY, WIDTH, WZ, State
from billiards_env.scene import Balls, Physics, Scene, Table
from billiards_env.scene import scene as scenes
from billiards_env.shots.simulation import simulate
from tests.helpers.outlines import with_corners

POOL_R = 0.028575


def impact(before, radius, rebound, scene):
    """Returns the motion after an impact on the cushions of a scene, and whether `rebound` raised it."""
    return scene.laws.cushion(before, radius, rebound, scene.numbers, None)


def pool_cushion(law, height=1.28, radius=POOL_R, **physics):
    physics = Physics(cushion=law, **physics)
    return scene_arrays(Scene(Balls((radius,), (0.17,)), Table(cushion_height=height * radius), physics))


def bounce(vn, vt, spin, numbers, rebound=0.0):
    """Computes the impact of Han (2005), equations 14 to 23, by the mechanics of a rigid sphere.

    An impulse P at the contact point changes v by P / m and the spin, rad/s, by r x P / I. The axes are x into the
    cushion, y along it and z up. If the ball would leave more slowly than `rebound`, m/s, bisection finds the normal
    impulse for that speed.

    Returns:
        The normal and tangential velocity, m/s, and the spin (3,).
    """
    e, mu, height = numbers.e_cushion, numbers.mu_cushion, numbers.cushion_height
    theta = math.asin(height / POOL_R - 1)
    into = np.array([math.cos(theta), 0.0, math.sin(theta)])  # from the centre to the contact point
    up = np.array([-math.sin(theta), 0.0, math.cos(theta)])  # tangents of the contact
    side = np.array([0.0, 1.0, 0.0])
    before = np.array([vn, vt, 0.0])
    surface = before + np.cross(spin, POOL_R * into)
    s_up, s_side = surface @ up, surface @ side
    slip = math.hypot(s_up, s_side)

    def impulse_of(squeeze):
        friction = min(slip * 2 / 7, mu * squeeze)
        return -squeeze * into - (friction * (s_up * up + s_side * side) / slip if slip else 0.0)

    squeeze = (1 + e) * (before @ into)
    if vn + impulse_of(squeeze)[0] > -rebound:
        low, high = 0.0, (vn + rebound + slip) / into[0] ** 2
        for _ in range(200):
            middle = (low + high) / 2
            low, high = (low, middle) if vn + impulse_of(middle)[0] <= -rebound else (middle, high)
        squeeze = high
    impulse = impulse_of(squeeze)
    spin = spin + np.cross(POOL_R * into, impulse) / (0.4 * POOL_R**2)
    return vn + impulse[0], vt + impulse[1], spin


@given(
    st.floats(0.01, 5),
    st.floats(-5, 5),
    st.tuples(*[st.floats(-200, 200)] * 3),
    st.floats(0.7, 1.6),
    st.floats(0, 1),
    st.floats(0, 0.5),
    st.sampled_from([0.0, 0.01, 1.0, 10.0]),
)
@example(1.0, 0.0, (0.0, 0.0, 0.0), 1.0, 1.0, 0.2, 0.0)  # no slip
@example(2.0, 1.0, (1.0, 2.0, 3.0), 1.0, 0.75, 0.0, 0.0)  # no friction
@example(1.0, 0.5, (3.0, 4.0, 5.0), 1.27, 0.8, 2.0, 0.0)  # friction stops the slip
@example(1.0, 0.0, (0.0, -200.0, 0.0), 1.9, 0.0, 2.0, 0.0)  # the restitution alone does not stop the ball
def test_han2005_is_the_impact_of_a_rigid_sphere(vn, vt, spin, height, e, mu, rebound):
    scene = pool_cushion("han2005", height, e_cushion=e, mu_cushion=mu)
    wn, wt, wz = spin
    before = CushionMotion(vn, vt, vn - POOL_R * wt, vt + POOL_R * wn, POOL_R * wz)
    after, _ = impact(before, POOL_R, rebound, scene)
    expected_vn, expected_vt, (wn, wt, wz) = bounce(vn, vt, np.array(spin), scene.numbers, rebound)
    expected = expected_vn, expected_vt, expected_vn - POOL_R * wt, expected_vt + POOL_R * wn, POOL_R * wz
    assert after == pytest.approx(expected, abs=1e-11)
    assert after.vn <= -rebound


# Pool balls and cushions of different laws. The axes are x along the cushion, y into it and z up.


def rebound_of(scene, velocity, spin, rebound=0.0):
    """Returns (vx, vy) and the spin, rad/s, after an impact; `velocity` is (vx, vy)."""
    (vx, vy), (wx, wy, wz), radius = velocity, spin, float(scene.radius[0])
    before = CushionMotion(vy, -vx, vy + radius * wx, -vx + radius * wy, radius * wz)
    (vn, vt, un, ut, rwz), _ = impact(before, radius, rebound, scene)
    return np.array([-vt, vn]), np.array([un - vn, ut - vt, rwz]) / radius


def rolling(angle, side=0.0, radius=POOL_R):
    """Returns velocity and spin of a ball that rolls at 1 m/s at an angle to the cushion with R omega_z = `side`."""
    x, y = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    return (x, y), (-y / radius, x / radius, side / radius)


ROLLING = [
    (90, 0, (0, -0.80442), (-0.112, 0, 0)),
    (90, 1, (0.21312, -0.78452), (-0.2896, 0.14918, 0.48851)),
    (60, 0, (0.34619, -0.68511), (-0.20003, 0.39234, 0.36913)),
    (60, 1, (0.58532, -0.69327), None),
    (60, -1, (0.24714, -0.65956), None),
    (45, 0, (0.52951, -0.54821), (-0.26311, 0.58279, 0.42624)),
    (30, 0, (0.71222, -0.37734), None),
    (15, 0, (0.87713, -0.18912), None),
]


@pytest.mark.parametrize("law", ["han2005", "stronge"])
@pytest.mark.parametrize(("angle", "side", "velocity", "spin"), ROLLING)
def test_a_rolling_ball_slips_at_the_cushion(law, angle, side, velocity, spin):
    rebound = rebound_of(pool_cushion(law), *rolling(angle, side))
    assert rebound[0] == pytest.approx(velocity, abs=6e-6)
    if spin is not None:
        assert POOL_R * rebound[1] == pytest.approx(spin, abs=6e-6)


@pytest.mark.parametrize(("side", "after"), [(1, 38.21), (-1, 47.72)])
def test_the_rebound_angle_at_45_degrees_with_side_spin(side, after):
    (vx, vy), _ = rebound_of(pool_cushion("stronge"), *rolling(45, side))
    assert math.degrees(math.atan2(-vy, vx)) == pytest.approx(after, abs=0.006)


# Velocity (2) and spin (3) before, after an impact on a rigid cushion, and after one on a compliant cushion
NOT_ROLLING = [
    (0.2, 1, 0, 0, 0, 0.14286, -0.72736, 6.9991, -1.3998, 4.7994, 0.12513, -0.73431, 9.1699, -1.8340, 6.2879),
    (0.5, 1, 0, 0, 0, 0.35714, -0.72736, 6.9991, -3.4996, 11.9985, 0.28725, -0.73832, 10.4235, -5.2118, 17.8689),
    (1, 1, 0, 0, 0, 0.71429, -0.72736, 6.9991, -6.9991, 23.997, 0.65796, -0.73178, 8.3791, -8.3791, 28.7282),
    (1, 1, 0, 0, 30, 0.94942, -0.72736, 6.9991, -1.2391, 34.2484, 0.93502, -0.73373, 8.9908, -1.5917, 35.4574),
    (0.6, 0.8, -8.399, 6.299, 0, 0.41417, -0.60109, 3.1996, 1.747, 15.6076, 0.36867, -0.61018, 6.0394, 0.6324, 19.429),
]


@pytest.mark.parametrize("row", NOT_ROLLING)
def test_a_compliant_cushion_adds_spin_to_a_ball_that_does_not_roll(row):
    before, *after = np.split(np.array(row, float), 3)
    for law, expected in zip(("han2005", "stronge"), after, strict=True):
        velocity, spin = rebound_of(pool_cushion(law), before[:2], before[2:])
        assert velocity == pytest.approx(expected[:2], abs=6e-6)
        assert spin == pytest.approx(expected[2:], abs=3e-4)


COMPLIANT = {
    (0.85, 1.8): (0, -0.1601, -0.1195, 0.2670, 0.7501, 1.1570, 1.4684, 1.6805, 1.7707, 1.7057, 1.4486, 0.975, 0.475),
    (0.77, 1.76): (0, -0.0052, 0.1481, 0.5461, 1.0210, 1.4062, 1.6859, 1.8578, 1.8729, 1.6592, 1.1950, 0.695, 0.195),
    (0.70, 1.7): (0, 0.1515, 0.4108, 0.8173, 1.2837, 1.6456, 1.8901, 2.0170, 1.9053, 1.4500, 0.9500, 0.450, -0.050),
}


@pytest.mark.parametrize(("e", "ratio"), COMPLIANT)
def test_the_tangential_velocity_after_a_compliant_impact(e, ratio):
    """The unit is the normal velocity times the friction; a reversed velocity is positive."""
    for x, expected in zip(np.arange(0, 6.5, 0.5), COMPLIANT[e, ratio], strict=True):
        assert 3.5 * friction_impulse(x, 1.0, e, ratio, None) - x == pytest.approx(expected, abs=6e-5)


@pytest.mark.parametrize(("slip", "after"), [(0.0, 0.0), (3.0, -1.81), (0.5, 0.3291142832763)])
def test_compliant_impacts_of_another_simulator(slip, after):
    """The values are those of tests of the simulator tailuge/billiards."""
    assert 3.5 * friction_impulse(slip, 0.2, 0.7, 1.7, None) - slip == pytest.approx(after, abs=1e-12)


REBOUNDS = [
    ((0.5, 1), (0, 0, 10), (-0.06819102304, -1.7), (0, 0, 5.205421606)),
    ((0.2, 1), (0, 0, 2), (-0.0516068981, -1.7), (0, 0, 3.939457867)),
    ((0, 1), (-5, 0, 0), (0, -1.7), (4.909064176, 0, 0)),
]


@pytest.mark.parametrize(("velocity", "spin", "change", "change_of_spin"), REBOUNDS)
def test_compliant_rebounds_of_another_simulator(velocity, spin, change, change_of_spin):
    """The nose of its cushion is at the height of the ball's centre. Its z axis points down, the one here up."""
    scene = pool_cushion("stronge", 1.0, 0.03275, e_cushion=0.7, cushion_frequency_ratio=1.7)
    after = rebound_of(scene, velocity, spin)
    assert after[0] - velocity == pytest.approx(change, abs=1e-9)
    assert after[1] - spin == pytest.approx(change_of_spin, abs=1e-7)


TOPSPIN = {"e_cushion_topspin": 0.04}
VARIABLE = [
    ((1.0, 0.0, 0.0, 0.0, 0.3), TOPSPIN, 1.28, 0.84),  # rolls along the normal
    ((1.0, 1.0, 1.0, 1.0, 0.0), TOPSPIN, 1.28, 0.8),  # slides at 45 degrees
    ((1.0, -1.0, 0.5, -1.0, 0.2), TOPSPIN, 1.28, 0.82),  # half of the topspin of rolling
    ((1.0, 0.0, -3.0, 0.5, 0.1), TOPSPIN, 1.28, 0.84),  # more topspin than rolling
    ((1.0, 0.0, 2.0, 0.5, 0.1), TOPSPIN, 1.28, 0.8),  # backspin
    ((1.0, 0.0, 0.0, 0.0, 0.0), {"e_cushion_slip": 0.08}, 1.0, 0.84),  # the slip is the speed
    ((1.0, 0.5, 1.0, 0.5, -0.5), {"e_cushion_slip": 0.08}, 1.0, 0.8),  # no slip
]


@pytest.mark.parametrize(("motion", "numbers", "height", "e"), VARIABLE)
def test_a_variable_cushion_has_the_restitution_of_the_motion(motion, numbers, height, e):
    scene = pool_cushion("han2005_variable", height, e_cushion=0.8, mu_cushion=0.2, **numbers)
    plain = pool_cushion("han2005", height, e_cushion=e, mu_cushion=0.2)
    actual, expected = (impact(CushionMotion(*motion), POOL_R, 0.0, cushion)[0] for cushion in (scene, plain))
    assert actual == pytest.approx(expected, abs=1e-15)


ENERGETIC = st.tuples(st.floats(0, 1), st.floats(1.0, 2.0))


@given(ENERGETIC, st.floats(0, 20, allow_subnormal=False))
def test_compliance_never_increases_the_tangential_velocity(constants, x):
    share, ratio = constants
    least = (math.sqrt(1 + 8 / ratio**2) - 1) / 2
    e = least + share * (1 - least)
    assert abs(3.5 * friction_impulse(x, 1.0, e, ratio, None) - x) <= x * (1 + 1e-12)


@pytest.mark.parametrize(("e", "ratio"), COMPLIANT)
def test_the_compliant_friction_is_continuous(e, ratio):
    top = 3.5 * (1 + e) - 3.5 / ratio**2 / e
    for x in (3.5 / ratio**2, 3.5, top):
        below, above = (friction_impulse(x * (1 + d), 1.0, e, ratio, None) for d in (-1e-9, 1e-9))
        assert below == pytest.approx(above, abs=3e-9)
    assert friction_impulse(top, 1.0, e, ratio, None) == 1 + e


def test_a_stiff_cushion_without_slip_is_restitution():
    velocity, spin = rebound_of(pool_cushion("stronge", 1.0, mu_cushion=0.0), (0.3, 1.0), (1.0, 2.0, 3.0))
    assert velocity == pytest.approx((0.3, -0.85))
    assert spin == pytest.approx((1.0, 2.0, 3.0))


LAWS = ["han2005", "stronge", "mathavan2010", "han2005_variable"]
# A square of a smaller number may underflow.
SPEEDS = st.floats(-5, 5).map(lambda v: v if abs(v) > 1e-100 else 0.0)
STATES = st.tuples(st.floats(0.01, 5), SPEEDS, *[SPEEDS] * 3)


def energy(motion, spins=True):
    """Returns twice the energy per mass of a ball with a motion (vx, vy, ux, uy, R wz), m^2/s^2."""
    vx, vy, ux, uy, rwz = motion
    return vx**2 + vy**2 + (0.4 * ((vx - ux) ** 2 + (vy - uy) ** 2 + rwz**2) if spins else 0.0)


@given(state=STATES, share=st.floats(0, 1), mu=st.floats(0, 0.5), e=st.floats(0.5, 1))
def test_a_variable_cushion_reverses_some_of_the_slip_and_adds_no_energy(state, share, mu, e):
    numbers = {"height": 1.0, "e_cushion": e, "e_cushion_tangent": share}
    before = CushionMotion(*state)
    after, _ = impact(before, POOL_R, 0.0, pool_cushion("han2005_variable", mu_cushion=mu, **numbers))
    assert energy(after) <= energy(before) * (1 + 1e-12)
    assert after.vn <= 0.0
    after, _ = impact(before, POOL_R, 0.0, pool_cushion("han2005_variable", mu_cushion=100.0, **numbers))
    if abs(before.vt + before.rwz) + abs(before.vn - before.un) < 50 * before.vn:  # friction is large enough
        assert after.vt + after.rwz == pytest.approx(-share * (before.vt + before.rwz), abs=1e-12)


ERROR = {"han2005": 1e-13, "stronge": 1e-13, "mathavan2010": 1e-13, "han2005_variable": 1e-13}


@pytest.mark.parametrize("law", LAWS)
@given(
    state=STATES,
    height=st.floats(0.8, 1.5),
    mu=st.floats(0, 0.5),
    e=st.floats(0.5, 1),
    power=st.integers(-20, 20),
    rebound=st.floats(0, 10),
)
def test_a_cushion_adds_no_energy_mirrors_and_is_free_of_scale(law, state, height, mu, e, power, rebound):
    """The mirror image and the scaled impact agree bit for bit. Products of very small numbers would underflow."""
    scene, usual, scale = pool_cushion(law, height, mu_cushion=mu, e_cushion=e), pool_cushion(law), 2.0**power
    after, _ = impact(CushionMotion(*state), POOL_R, 0.0, scene)
    assert after.vn <= 0.0
    assert energy(after) <= energy(state) * (1 + 10 * ERROR[law])
    vn, vt, un, ut, rwz = state
    mirrored, _ = impact(CushionMotion(vn, -vt, un, -ut, -rwz), POOL_R, 0.0, scene)
    assert (after.vn, -after.vt, after.un, -after.ut, -after.rwz) == mirrored
    after, _ = impact(CushionMotion(*state), POOL_R, 0.0, usual)
    scaled, _ = impact(CushionMotion(*(scale * x for x in state)), POOL_R, 0.0, usual)
    assert scaled == tuple(scale * x for x in after)
    faster, raised = impact(CushionMotion(*state), POOL_R, rebound, usual)
    assert faster.vn <= -rebound
    assert not raised or faster.vn == -rebound


@pytest.mark.parametrize("law", ["restitution", *LAWS])
def test_the_restitution_of_cushions_may_fall_with_the_speed(law):
    scene = pool_cushion(law, e_cushion=0.93, e_cushion_loss=0.093, e_cushion_onset=2.0, e_cushion_floor=0.6)
    for speed, e in ((0.0, 0.93), (2.0, 0.93), (2.5, 0.8835), (3.0, 0.837), (10.0, 0.6)):
        assert cushion_restitution(speed, scene.numbers) == pytest.approx(e)
    plain = pool_cushion(law, e_cushion=0.837)
    if law != "restitution":
        before = CushionMotion(3.0, 1.0, 0.5, 0.25, 0.125)
        expected, _ = impact(before, POOL_R, 0.0, plain)
        assert impact(before, POOL_R, 0.0, scene)[0] == pytest.approx(expected, abs=1e-12)


# Mathavan, Jackson and Parkin (2010): angle to the cushion, side spin and roll before; velocities and spins after, m/s.
SNOOKER = [
    (90, 0, 1, (0, -0.91112), (-0.2352, 0, 0)),
    (90, 1, 1, (0.23303, -0.93935), (-0.2324, 0.2330, 0.4661)),
    (60, 0, 1, (0.31324, -0.80870), (-0.2026, 0.3132, 0.4279)),
    (60, 1, 1, (0.56186, -0.79025), (-0.2071, 0.5619, 0.8583)),
    (60, -1, 1, (0.24751, -0.83102), (-0.2552, 0.2475, -0.4215)),
    (40, 0, 1, (0.58283, -0.61540), (-0.1798, 0.5828, 0.4198)),
    (40, 1, 1, (0.72149, -0.58657), (-0.1536, 0.7215, 1.1021)),
    (40, -1, 1, (0.56532, -0.62136), (-0.2315, 0.5653, -0.5401)),
    (20, 0, 1, (0.83100, -0.33154), (-0.1312, 0.8310, 0.2491)),
    (20, 1, 1, (0.85124, -0.32442), (-0.0824, 0.8512, 1.2027)),
    (20, -1, 1, (0.82827, -0.33304), (-0.1462, 0.8283, -0.7447)),
    (90, 0, 0, (0, -0.83736), (-0.0781, 0, 0)),
    (90, 0, 2, (0, -0.98001), (-0.9309, 0, 0)),
    (90, 0, -1, (0, -0.86586), (0.1527, 0, 0)),
]
SNOOKER_R = 0.02625


@pytest.mark.parametrize(("angle", "side", "roll", "velocity", "spin"), SNOOKER)
def test_snooker_cushions_by_mathavan_2010(angle, side, roll, velocity, spin):
    """The expected values have an error of up to 5e-4, as the impact has 5000 steps of first order."""
    cushion = pool_cushion("mathavan2010", 1.4, SNOOKER_R, mu_slide=0.212, mu_cushion=0.14, e_cushion=0.98)
    before, (wx, wy, wz) = rolling(angle, side, SNOOKER_R)
    rebound = rebound_of(cushion, before, (roll * wx, roll * wy, wz))
    assert rebound[0] == pytest.approx(velocity, abs=5.5e-4)
    assert SNOOKER_R * rebound[1] == pytest.approx(spin, abs=5.5e-4)


def euler_impact(angle, steps, sin, mu, mu_cloth, e=0.98):
    """Returns (vx, vy) of a rolling ball after an impact that is computed by many steps of first order."""
    cos = math.sqrt(1 - sin * sin)
    vx, vy = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    wx, wy, wz, dp = -vy, vx, 0.0, vy / steps
    work, end = 0.0, -math.inf
    while vy > 0 or work > end:
        xi, yi, xc, yc = vx + wy * sin - wz * cos, -vy * sin + wx, vx - wy, vy + wx
        nose, cloth = math.hypot(xi, yi), math.hypot(xc, yc)
        c, s = (xi / nose, yi / nose) if nose else (0, 0)
        cc, sc = (xc / cloth, yc / cloth) if cloth else (0, 0)
        press = mu_cloth * max(0.0, sin + mu * s * cos)
        middle = vy
        vx -= dp * (mu * c + cc * press)
        vy -= dp * (cos - mu * sin * s + sc * press)
        wx -= 2.5 * dp * (mu * s + sc * press)
        wy -= 2.5 * dp * (mu * c * sin - cc * press)
        wz += 2.5 * dp * mu * c * cos
        work += dp * cos * 0.5 * (middle + vy)
        if vy <= 0 and end == -math.inf:
            end = (1 - e * e) * work
    return np.array([vx, vy])


SMALL_STEPS = [
    (35, 0.4, 0.14, 0.212),
    (80, 0.4, 0.14, 0.212),
    *((angle, *nose) for angle in (50, 90) for nose in ((-0.3, 0.8, 0.2), (-0.85, 0.8, 0.5), (-0.2, 0.3, 1.0))),
]


@pytest.mark.parametrize(("angle", "sin", "mu", "mu_cloth"), SMALL_STEPS)
def test_the_impact_is_the_limit_of_many_small_steps(angle, sin, mu, mu_cloth):
    """A nose below the centre lifts the ball, which does not press on the cloth.

    The friction at the nose once counted on the cloth and did not stick.
    """
    scene = pool_cushion("mathavan2010", 1 + sin, SNOOKER_R, mu_slide=mu_cloth, mu_cushion=mu, e_cushion=0.98)
    rebound, spin = rebound_of(scene, *rolling(angle, 0.0, SNOOKER_R))
    assert euler_impact(angle, 20000, sin, mu, mu_cloth) == pytest.approx(rebound, abs=6e-5 if sin > 0 else 3e-4)
    if sin < 0:
        assert SNOOKER_R * spin[0] == pytest.approx(rebound[1] * sin, abs=1e-6)  # the nose sticks at the end


@pytest.mark.parametrize("mu_cloth", [0.5, 1.0])
def test_the_cushion_and_the_slate_hold_a_ball(mu_cloth):
    """The integration once went on without end, up to an infinite impulse."""
    scene = pool_cushion("mathavan2010", 1.82, SNOOKER_R, mu_slide=mu_cloth, mu_cushion=1.0, e_cushion=0.9)
    rebound, spin = rebound_of(scene, (0.0, 1.0), (0.0, 0.0, 0.0))
    assert rebound == pytest.approx(0, abs=1e-6)
    assert SNOOKER_R * spin == pytest.approx(0, abs=1e-6)


def test_every_impact_ends_and_does_not_add_energy():
    """Impacts of 1 m/s or less with spins of up to a million rad/s once took a second, or gave NaN."""
    rng, radius = np.random.default_rng(0), 0.028
    for k in range(1500):
        sin = rng.uniform(-0.99, 0.99) * (k % 7 > 0)
        mu, mu_cloth = (10 ** rng.uniform((-3, -4), 2)).tolist() if k % 2 else rng.uniform((0, 0.05), 1).tolist()
        nose = CushionNose(sin, math.sqrt(1 - sin * sin), mu * (k % 5 > 0), mu_cloth)
        spin = rng.choice([-1.0, 0.0, 0.3, 1.0], 3) * radius * 10 ** rng.uniform(-3, 6)
        before = np.array([rng.normal() * 10 ** rng.uniform(-6, 2), 10 ** rng.uniform(-6, 3), *spin])
        e = float(rng.choice([0.0, 1.0, rng.random()]))
        after, _, steps = follow_impact(tuple(before.tolist()), nose, e)
        after = np.array(after)
        assert steps < 400
        energy = [v[:2] @ v[:2] + 0.4 * v[2:] @ v[2:] for v in (before, after)]
        assert energy[1] <= energy[0] * (1 + 1e-12)
        assert after[1] <= 1e-12 * np.abs(before[1:]).max()


@pytest.mark.parametrize(("mu", "rwx"), [(0.6, -2.0), (0.2, -0.5)])
def test_the_result_in_painleves_paradox_is_the_limit_for_less_friction(mu, rwx):
    """With more friction on the cloth than `paradox`, no force holds the nose in a straight impact."""
    sin, cos = 0.1, math.sqrt(1 - 0.01)
    paradox = (2.5 + sin * sin) / ((2.5 - sin) * cos)
    noses = [CushionNose(sin, cos, mu, share * paradox) for share in np.linspace(0.8, 1.6, 2001)]
    after = np.array([follow_impact((0.0, 1.0, rwx, 0.0, 0.0), nose, 0.9)[0] for nose in noses])
    assert np.abs(np.diff(after, axis=0)).max() < 1e-3


def test_a_mathavan_cushion_is_smooth():
    """The impact once jumped by up to 4e-7 of the speed where the number of steps of its solution changed."""
    rng, t = np.random.default_rng(0), np.linspace(-1.0, 1.0, 21)
    powers = np.stack((np.ones(21), t, t * t), axis=1)
    for k in range(300):
        nose = CushionNose(0.4, math.sqrt(1 - 0.16), 0.14, 0.212)
        vy = abs(rng.normal()) + 0.05
        before = np.array([vy * math.tan(rng.uniform(-1.4, 1.4)), vy, *((k % 3) * rng.normal(size=3))])
        changes = 1.0 + 1e-9 * rng.normal(size=5) * t[:, None]
        after = np.array([follow_impact(tuple((before * change).tolist()), nose, 0.95)[0] for change in changes])
        rest = after - powers @ np.linalg.lstsq(powers, after, rcond=None)[0]
        assert np.abs(rest).max() < 1e-13 * np.abs(before).max()


def test_an_impact_has_few_steps():
    """Impacts of rolling balls once had 11 steps on average, because both slips always set the pace of the series."""
    nose, steps = CushionNose(0.4, math.sqrt(1 - 0.16), 0.14, 0.212), []
    for angle in np.linspace(-1.4, 1.4, 57):
        vx, vy = math.sin(angle), math.cos(angle)
        steps.append(follow_impact((vx, vy, -vy, vx, 0.0), nose, 0.9)[2])
    assert np.mean(steps) < 8
    assert max(steps) < 30


OTHER_NOSE = CushionNose(0.4854310803462463, 0.8742749374389478, 0.06802813718702996, 0.0229983839968099)
SMALL_SLIPS = {
    # With a series paced by the slip at the cushion alone, the errors were 2.9e-13 and 8.7e-13 of the normal velocity.
    "it turns": (
        (0.0010521511264802465, 0.054378014477195084, 0.0, 0.0, 0.9729380070646784),
        CushionNose(0.4, math.sqrt(1 - 0.16), 0.14, 0.212),
        0.8566430193923378,
    ),
    "it grows": (
        (1.2442856698461908, 0.919404450902359, -0.9194044509022105, 1.244285669846241, -2.730503582774857e-07),
        OTHER_NOSE,
        0.8241053267983783,
    ),
}


@pytest.mark.parametrize("case", SMALL_SLIPS)
def test_a_small_slip_at_the_cloth_costs_no_digits(case):
    before, nose, e = SMALL_SLIPS[case]
    with mpmath.workdps(30):
        numbers = reference.Nose(*map(mpmath.mpf, nose))
        exact = reference.impact([mpmath.mpf(x) for x in before], numbers, mpmath.mpf(e))
    assert np.array(follow_impact(before, nose, e)[0]) == pytest.approx(
        [float(x) for x in exact], abs=5e-14 * before[1]
    )


def test_each_cushion_of_a_scene_has_its_own_law():
    ends = {}
    for name in scenes.CUSHION_NAMES:
        # With this friction and table other tests compile the same engines.
        friction = "frictionless" if name in ("restitution", "han2005") else "frictional"
        table = with_corners(Table()) if name in ("stronge", "mathavan2010") else Table()
        scene = Scene(
            Balls.uniform(3), table, Physics(cushion=name, ball_ball=friction, mu_cushion=2.0, e_cushion_topspin=0.1)
        )
        shot = simulate(scene, [[0.0, 0.0], [1.0, 0.0], [-1.0, 0.0]], [0.3, 1.5])
        assert shot.cushions[0] > 0
        ends[name] = shot.positions.tobytes()
    assert len(set(ends.values())) == len(scenes.CUSHION_NAMES)


NEW_NAMES = [
    ("MOTION_NAMES", {"motion": "new", "cushion": "restitution"}),
    ("CUSHION_NAMES", {"cushion": "new"}),
    ("BALL_BALL_NAMES", {"ball_ball": "new"}),
]


@pytest.mark.parametrize(("names", "physics"), NEW_NAMES)
def test_a_name_without_a_law_is_an_error(monkeypatch, names, physics):
    """A new cushion once ran as han2005, and a new contact of balls without friction."""
    known = getattr(scenes, names)
    monkeypatch.setattr(scenes, names, (*known, "new") if isinstance(known, tuple) else {**known, "new": False})
    scene = Scene(Balls.uniform(1), physics=Physics(**physics))
    with pytest.raises(ValueError, match=rf"physics.{next(iter(physics))} = 'new': expected one of '\w+', "):
        simulate(scene, [[0.0, 0.0]], [1.0, 0.0])


# Two cushions at one instant


def corner(scene, motion, one, two, rebounds=(0.0, 0.0)):
    """Returns (vx, vy, ux, uy, rwz) after two cushions whose normals (2,) are at angles in radians."""
    rows = np.zeros((1, WIDTH))
    rows[0, [VX, VY, UX, UY, WZ]] = motion
    rows[0, WZ] /= POOL_R
    one, two = ((math.cos(angle), math.sin(angle)) for angle in (one, two))
    reflect_both(State(rows, np.zeros(1, np.int8)), 0, one, two, rebounds, scene)
    rows[0, WZ] *= POOL_R
    return rows[0, [VX, VY, UX, UY, WZ]]


CORNERS = st.tuples(st.floats(0.1, 1.4), st.floats(-0.9, 0.9), st.floats(0.1, 5.0), *[st.floats(-5, 5)] * 3)


def draw_corner(values):
    """Returns the motion of a ball that approaches both of two cushions with normals at +-half, and half."""
    half, share, speed, ux, uy, rwz = values
    angle = share * min(half, math.pi / 2 - half)
    return np.array([speed * math.cos(angle), speed * math.sin(angle), ux, uy, rwz]), half


@pytest.mark.parametrize("law", ["restitution", *LAWS])
@settings(max_examples=50)
@given(CORNERS, st.floats(0.5, 1))
def test_a_corner_adds_no_energy_has_no_order_and_mirrors_bit_for_bit(law, values, e):
    motion, half = draw_corner(values)
    scene = pool_cushion(law, e_cushion=e)
    after = corner(scene, motion, half, -half)
    spins = law != "restitution"
    assert energy(after, spins) <= energy(motion, spins) * (1 + 1e-13)
    np.testing.assert_array_equal(after, corner(scene, motion, -half, half))
    mirror = np.array([1, -1, 1, -1, -1])
    np.testing.assert_array_equal(after * mirror, corner(scene, motion * mirror, half, -half))
    motion, _ = draw_corner((math.pi / 4, *values[1:]))  # a square corner
    after = corner(scene, motion, math.pi / 4, -math.pi / 4)
    assert after[0] + abs(after[1]) <= 1e-4 * motion[0]  # after `TURNS` impacts little is left


def one_after_the_other(scene, motion):
    """Returns the motion after the cushion along x and then, if the ball moves into it, that along y."""
    (vn, vt, un, ut, rwz), _ = impact(CushionMotion(*motion), POOL_R, 0.0, scene)
    if vt <= 0.0:
        return np.array([vn, vt, un, ut, rwz])
    (v, t, u, s, rwz), _ = impact(CushionMotion(vt, -vn, ut, -un, rwz), POOL_R, 0.0, scene)
    return np.array([-t, v, -s, u, rwz])


@pytest.mark.parametrize("law", LAWS)
def test_the_corner_of_two_perpendicular_cushions_is_the_mean_of_both_orders(law):
    """If it is hit along one cushion, it is the impact on the other."""
    scene, motion = pool_cushion(law), np.array([2.0, 1e-9, 1.0, 0.5, 0.25])
    np.testing.assert_allclose(corner(scene, motion, 0.0, math.pi / 2), one_after_the_other(scene, motion), atol=1e-7)
    motion = np.array([2.0, 1.0, 1.5, 0.5, 0.25])
    swap, sign = [1, 0, 3, 2, 4], [1, 1, 1, 1, -1]  # mirrors at the diagonal
    one, two = one_after_the_other(scene, motion), one_after_the_other(scene, motion[swap] * sign)[swap] * sign
    np.testing.assert_allclose(corner(scene, motion, 0.0, math.pi / 2), 0.5 * (one + two), atol=1e-12)


@pytest.mark.parametrize("half", [0.3, math.pi / 4, 1.2])
def test_a_ball_leaves_a_corner_at_the_least_speeds(half):
    scene, motion = pool_cushion("restitution", e_cushion=0.5), np.array([1e-3, 0.0, 0.0, 0.0, 0.0])
    vx, vy, *_ = corner(scene, motion, half, -half, (0.01, 0.01))
    assert vy == 0.0
    assert -vx * math.cos(half) == pytest.approx(0.01)


@pytest.mark.parametrize("name", ["real_pool", "real_carom", "uk_pool"])
def test_a_ball_that_rolls_into_a_compliant_cushion_slips_throughout(name):
    scene = Scene.named(name)
    p, sine = scene.physics, scene.table.cushion_height / max(scene.balls.radius) - 1.0
    least_slip = (1.0 + sine) / (p.mu_cushion * math.sqrt(1.0 - sine * sine))  # head on, over mu times the speed
    assert least_slip > 3.5 * (1.0 + p.e_cushion - 1.0 / (p.e_cushion * p.cushion_frequency_ratio**2))
