import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from billiards_env.engine.modes import scene_arrays
from billiards_env.physics.cushion import han2005
from billiards_env.physics.state import CUSHION_HEIGHT, E_CUSHION, MU_CUSHION
from billiards_env.scene import Balls, Physics, Scene
from billiards_env.table import Table

R = 0.03


def bounce(vn, vt, spin, params, rebound=0.0):
    """Computes the impact of Han (2005), equations 14 to 23, by the mechanics of a rigid sphere.

    An impulse P at the contact point changes v by P / m and the spin, rad/s, by r x P / I. The axes are x into the
    cushion, y along it and z up. If the ball would leave more slowly than `rebound`, m/s, bisection finds the normal
    impulse for that speed.

    Returns:
        The normal and tangential velocity, m/s, the spin (3,), and whether the contact point sticks.
    """
    e, mu, height = params[E_CUSHION], params[MU_CUSHION], params[CUSHION_HEIGHT]
    theta = math.asin(height / R - 1)
    into = np.array([math.cos(theta), 0.0, math.sin(theta)])  # from the centre to the contact point
    up = np.array([-math.sin(theta), 0.0, math.cos(theta)])  # tangents of the contact
    side = np.array([0.0, 1.0, 0.0])
    before = np.array([vn, vt, 0.0])
    surface = before + np.cross(spin, R * into)
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
    spin = spin + np.cross(R * into, impulse) / (0.4 * R * R)
    return vn + impulse[0], vt + impulse[1], spin, slip * 2 / 7 <= mu * squeeze


def run_han(vn, vt, spin, params, rebound=0.0):
    un, ut = vn - R * spin[1], vt + R * spin[0]
    vn, vt, un, ut, rwz, _ = han2005(vn, vt, un, ut, R * spin[2], R, rebound, params)
    return vn, vt, np.array([(ut - vt) / R, (vn - un) / R, rwz / R])


def cushion(height=1.27 * R, **physics):
    return scene_arrays(Scene(Balls((R,), (0.2,)), Table(cushion_height=height), Physics(**physics))).params


@given(
    st.floats(0.01, 5),
    st.floats(-5, 5),
    st.tuples(*[st.floats(-200, 200)] * 3),
    st.floats(0.7, 1.6),
    st.floats(0, 1),
    st.floats(0, 0.5),
    st.sampled_from([0.0, 0.01, 1.0, 10.0]),
)
def test_han2005_is_the_impact_of_a_rigid_sphere(vn, vt, spin, height, e, mu, rebound):
    params = cushion(height * R, e_cushion=e, mu_cushion=mu)
    expected = bounce(vn, vt, np.array(spin), params, rebound)
    found = run_han(vn, vt, np.array(spin), params, rebound)
    assert found[:2] == pytest.approx(expected[:2], abs=1e-12)
    assert found[2] == pytest.approx(expected[2], abs=1e-9)
    assert found[0] <= -rebound


@pytest.mark.parametrize("sticks", [True, False])
def test_the_contact_point_sticks_or_slides(sticks):
    params = cushion(e_cushion=0.8, mu_cushion=2.0 if sticks else 0.01)
    assert bounce(1.0, 0.5, np.array([3.0, 4.0, 5.0]), params)[3] == sticks
    vn, vt, spin = run_han(1.0, 0.5, np.array([3.0, 4.0, 5.0]), params)
    theta = math.asin(0.27)
    up = np.array([-math.sin(theta), 0.0, math.cos(theta)])
    surface = np.array([vn, vt, 0.0]) + np.cross(spin, R * np.array([math.cos(theta), 0.0, math.sin(theta)]))
    # Only the horizontal slip is zero, because the table stops the vertical velocity.
    assert (abs(surface[1]) < 1e-14) == sticks
    assert up[0] < 0


def test_han2005_at_the_height_of_the_centre_without_friction_is_restitution():
    vn, vt, spin = run_han(2.0, 1.0, np.array([1.0, 2.0, 3.0]), cushion(R, e_cushion=0.75, mu_cushion=0.0))
    assert (vn, vt) == (-1.5, 1.0)
    assert spin == pytest.approx([1.0, 2.0, 3.0])


def test_han2005_without_slip_does_not_divide_by_zero():
    vn, vt, spin = run_han(1.0, 0.0, np.zeros(3), cushion(R, e_cushion=1.0))
    assert (vn, vt) == (-1.0, 0.0)
    assert not spin.any()


def test_running_english_increases_and_reverse_english_decreases_the_tangential_velocity():
    plain, running, reverse = (run_han(1.0, 1.0, np.array([0.0, 0.0, w]), cushion())[1] for w in (0.0, -100.0, 100.0))
    assert reverse < plain < running


def test_a_ball_does_not_continue_into_a_han2005_cushion():
    assert run_han(1.0, 0.0, np.array([0.0, -200.0, 0.0]), cushion(1.9 * R, e_cushion=0.0, mu_cushion=2.0))[0] == 0.0
