import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from billiards_env.physics.geometry import contact
from billiards_env.physics.geometry.contact import line_time, misses_circle, sweep
from billiards_env.physics.motion import Path

INF = math.inf
small = st.floats(-3, 3).map(lambda x: round(x, 6))


def circle_time(dx, dy, wx, wy, bx, by, reach, end, noise=0.0):
    return contact.circle_time(Path(dx, dy, wx, wy, bx, by), reach, end, noise)


def distance_after(t, dx, dy, wx, wy, bx, by):
    return math.hypot(dx + t * (wx + 0.5 * t * bx), dy + t * (wy + 0.5 * t * by))


# Circles


def test_circles_meet_at_the_exact_time_in_the_interval():
    assert circle_time(2.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.5, 9.0) == 1.5
    assert circle_time(2.0, 0.3, -1.0, 0.0, 0.0, 0.0, 0.5, 9.0) == pytest.approx(2 - 0.4, rel=1e-15)
    assert circle_time(2.0, 0.3, 1.0, 0.0, 0.0, 0.0, 0.5, 9.0) == INF
    assert circle_time(2.0, 0.3, 0.0, 0.0, 0.0, 0.0, 0.5, 9.0) == INF
    assert circle_time(2.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.5, 1.5) == 1.5
    assert circle_time(2.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.5, 1.4999) == INF
    assert circle_time(2.0, 0.0, -1.0, 0.0, 0.5, 0.0, 0.5, 1.0) == INF


@pytest.mark.parametrize("far", [1.0, 1e3, 1e6])
@pytest.mark.parametrize(("offset", "meets"), [(1 - 1e-15, True), (1.0, False), (1 + 1e-15, False)])
def test_a_graze_is_decided_to_the_last_digit_from_any_distance(far, offset, meets):
    t = circle_time(far, 0.5 * offset, -1.0, 0.0, 0.0, 0.0, 0.5, 2 * far)
    assert (t < INF) == meets


def test_touching_circles_meet_at_time_0_only_if_they_approach():
    for acceleration in (0.0, 0.25, -0.25):
        assert circle_time(0.5, 0.0, -1.0, 0.0, acceleration, 0.0, 0.5, 0.1) == 0.0
        assert circle_time(0.5, 0.0, 1.0, 0.0, acceleration, 0.0, 0.5, 0.1) == INF
        assert circle_time(0.5, 0.0, 0.0, 1.0, 0.0, acceleration, 0.5, 0.1) == INF
    # Circles at rest with a relative acceleration.
    assert circle_time(0.5, 0.0, 0.0, 0.0, -1.0, 0.0, 0.5, 9.0) == 0.0
    assert circle_time(0.5, 0.0, 0.0, 0.0, 1.0, 0.0, 0.5, 9.0) == INF
    assert circle_time(0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.5, 9.0) == INF
    # With tangential velocity the acceleration must exceed the centripetal one, v^2 / d = 2.
    assert circle_time(0.5, 0.0, 0.0, 1.0, -1.9, 0.0, 0.5, 0.1) == INF
    assert circle_time(0.5, 0.0, 0.0, 1.0, -2.1, 0.0, 0.5, 0.1) == 0.0


def test_the_known_root_at_zero_is_divided_out():
    # The circles move apart and meet again at 2 v / a.
    assert circle_time(0.5, 0.0, 1.0, 0.0, -4.0, 0.0, 0.5, 9.0) == pytest.approx(0.5, rel=1e-15)
    assert circle_time(0.5, 0.0, 1e-9, 0.0, -4.0, 0.0, 0.5, 9.0) == pytest.approx(0.5e-9, rel=1e-12, abs=0)
    assert circle_time(0.5, 0.0, 1.0, 0.0, -4.0, 0.0, 0.5, 0.49) == INF
    overlap = 0.5 - 1e-16  # by rounding: a contact
    assert circle_time(overlap, 0.0, -1.0, 0.0, 0.0, 0.0, 0.5, 9.0) == 0.0
    assert circle_time(overlap, 0.0, 1.0, 0.0, 0.0, 0.0, 0.5, 9.0) == INF
    assert circle_time(overlap, 0.0, 1.0, 0.0, -4.0, 0.0, 0.5, 9.0) == pytest.approx(0.5, rel=1e-12)


@pytest.mark.parametrize("acceleration", [0.0, 0.5])
def test_touching_circles_that_approach_by_no_more_than_rounding_do_not_meet(acceleration):
    for speed in (1e-17, -1e-17):
        assert circle_time(0.5, 0.0, speed, 0.0, acceleration, 0.0, 0.5, 9.0, 2e-17) == INF
    assert circle_time(0.5, 0.0, -3e-17, 0.0, acceleration, 0.0, 0.5, 9.0, 2e-17) == 0.0
    assert circle_time(0.5, 0.0, 0.0, 0.0, -0.5, 0.0, 0.5, 9.0, 2e-17) == 0.0  # pressed together
    assert circle_time(0.5 + 1e-15, 0.0, -1e-17, 0.0, 0.0, 0.0, 0.5, 1e9, 2e-17) < INF  # they do not touch yet


def test_whether_decelerating_circles_meet_is_decided_to_12_digits():
    gap = 1.0
    for factor, meets in ((1 + 1e-12, True), (1 - 1e-12, False)):
        v = math.sqrt(2 * 0.1 * gap) * factor
        t = circle_time(gap + 0.5, 0.0, -v, 0.0, 0.1, 0.0, 0.5, 20.0)
        assert (t < INF) == meets
    assert circle_time(gap + 0.5, 0.0, -1.0, 0.0, 0.1, 0.0, 0.5, 20.0) == pytest.approx(10 - math.sqrt(80), rel=1e-14)


@given(small, small, small, small, small, small, st.floats(0.05, 0.5), st.floats(0.01, 4))
def test_circles_are_apart_before_the_contact_time_and_touch_at_it(dx, dy, wx, wy, bx, by, reach, end):
    assume(math.hypot(dx, dy) > reach + 1e-3)
    motion = dx, dy, wx, wy, bx, by
    t = circle_time(*motion, reach, end)
    until = np.linspace(0, min(t, end), 400)
    distances = np.hypot(dx + until * (wx + 0.5 * until * bx), dy + until * (wy + 0.5 * until * by))
    assert distances.min() >= reach - 1e-12
    if t < INF:
        assert t <= end * (1 + 1e-12) + 1e-12
        assert distance_after(t, *motion) == pytest.approx(reach, abs=1e-14)


@given(small, small, small, small, small, small)
def test_mirrored_and_swapped_circles_meet_at_the_same_time(dx, dy, wx, wy, bx, by):
    assume(math.hypot(dx, dy) > 0.3)
    t = circle_time(dx, dy, wx, wy, bx, by, 0.25, 2.0)
    assert circle_time(-dx, dy, -wx, wy, -bx, by, 0.25, 2.0) == t
    assert circle_time(dx, -dy, wx, -wy, bx, -by, 0.25, 2.0) == t
    assert circle_time(-dx, -dy, -wx, -wy, -bx, -by, 0.25, 2.0) == t


@pytest.mark.parametrize(("x", "v", "a"), [(-1.0, 1.0, 0.0), (-1.0, 0.0, 1.0), (-1.0, -0.5, 2.0)])
def test_a_path_that_reaches_a_circle_is_not_excluded(x, v, a):
    for path in (Path(x, 0.0, v, 0.0, a, 0.0), Path(0.0, x, 0.0, v, 0.0, a)):
        assert not misses_circle(path, sweep(path, 2.0), 0.25)
        assert misses_circle(path, sweep(path, 0.1), 0.25)


# Lines


LINES = [
    (1.0, 2.0, 0.0, 0.5),
    (1.0, -2.0, 0.0, INF),
    (1.0, 0.0, 2.0, 1.0),
    (1.0, 2.0, -2.0, 1.0),  # stops at the line
    (1.0, 1.99, -2.0, INF),  # stops before the line
    (0.75, 2.0, -2.0, 0.5),  # the first of two crossings
    (1.5, -1.0, 1.0, 3.0),  # away and back
    (1.0, -2.0, -1.0, INF),
    (0.0, 1.0, 0.0, 0.0),
    (0.0, 0.0, 1.0, 0.0),  # pressed against it
    (0.0, 0.0, 0.0, INF),  # parallel to it
    (0.0, 0.0, -1.0, INF),
    (0.0, -1.0, 0.0, INF),
    (0.0, -1.0, 4.0, 0.5),  # away and back: the root at 0 is divided out
    (-1e-16, 0.0, 0.0, INF),
    (-1e-16, 1.0, -9.0, 0.0),
]


@pytest.mark.parametrize(("gap", "v", "a", "t"), LINES)
def test_the_contact_time_with_a_line_is_exact(gap, v, a, t):
    assert line_time(gap, v, a, 10.0) == t


def test_a_line_is_met_in_the_interval_and_a_small_acceleration_loses_no_digits():
    assert line_time(1.0, 1.0, 0.0, 1.0) == 1.0
    assert line_time(1.0, 1.0, 0.0, 0.999) == INF
    assert line_time(0.0, -1.0, 4.0, 0.4) == INF
    assert line_time(1.0, 1.0, 1e-20, 9.0) == 1.0
    assert line_time(1.0, 1.0, -1e-20, 9.0) == 1.0
    assert line_time(1e-18, 1.0, -4.0, 9.0) == pytest.approx(1e-18, rel=1e-15, abs=0)
