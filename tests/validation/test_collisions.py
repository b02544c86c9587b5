"""Impacts of two balls agree with published tables and measurements."""

import numpy as np
import pytest

from benchmarks.validation import collisions as c
from billiards_env.scene import Physics

# Throw in degrees by TP A.14 for elastic balls and cuts of 5, 10, ... 85 degrees
TABLE = {
    "stun, slow": "0.72 1.44 2.19 2.98 3.81 4.72 5.24 5.08 4.95 4.82 4.71 4.62 4.54 4.48 4.43 4.39 4.37",
    "stun, medium": "0.72 1.44 2.19 2.98 3.81 3.55 3.25 2.99 2.77 2.59 2.44 2.32 2.22 2.14 2.08 2.04 2.02",
    "stun, fast": "0.72 1.44 2.19 2.50 2.04 1.70 1.45 1.26 1.13 1.03 0.95 0.89 0.85 0.82 0.80 0.79 0.78",
    "roll, slow": "0.38 0.76 1.13 1.50 1.85 2.19 2.51 2.81 3.09 3.35 3.58 3.78 3.96 4.10 4.22 4.30 4.35",
    "roll, medium": "0.18 0.35 0.52 0.69 0.85 1.00 1.15 1.29 1.42 1.54 1.64 1.74 1.82 1.89 1.94 1.98 2.00",
    "roll, fast": "0.07 0.13 0.20 0.27 0.33 0.39 0.44 0.50 0.55 0.59 0.64 0.67 0.70 0.73 0.75 0.76 0.77",
}


def numbers(text):
    return [float(value) for value in text.split()]


@pytest.mark.parametrize("name", TABLE)
def test_the_throw_has_the_digits_of_the_table(name):
    assert [round(value, 2) for value in c.throw_table()[name]] == numbers(TABLE[name])


@pytest.mark.parametrize(("speed", "most", "at"), [("slow", 5.30, 33.0), ("medium", 3.87, 25.4), ("fast", 2.69, 18.3)])
def test_the_largest_throw_of_stun(speed, most, at):
    cuts = np.arange(10.0, 45.0, 0.05)
    throw = c.throw(c.ELASTIC, c.SPEEDS[speed], cuts)
    assert throw.max() == pytest.approx(most, abs=0.01)
    assert cuts[throw.argmax()] == pytest.approx(at, abs=0.1)


@pytest.mark.parametrize(
    ("speed", "throws"),
    [
        ("slow", "0.82 2.05 4.09 4.86 4.37 3.93"),
        ("medium", "0.82 2.05 3.55 2.64 2.01 1.57"),
        ("fast", "0.82 2.05 1.70 1.05 0.78 0.66"),
    ],
)
def test_side_throws_a_straight_shot(speed, throws):
    found = -c.throw(c.ELASTIC, c.SPEEDS[speed], 0.0, [0.1, 0.25, 0.5, 0.75, 1.0, 1.25])
    assert [round(value, 2) for value in found.tolist()] == numbers(throws)


@pytest.mark.parametrize(
    ("speed", "throws"),
    [
        ("slow", "3.55 4.37 4.86 4.72 2.36 0 -2.36 -4.72"),
        ("medium", "1.26 2.01 2.64 3.55 2.36 0 -2.36 -3.55"),
        ("fast", "0.61 0.78 1.05 1.70 2.36 0 -2.36 -1.70"),
    ],
)
def test_outside_and_inside_english_of_a_half_ball_hit(speed, throws):
    found = c.throw(c.ELASTIC, c.SPEEDS[speed], 30.0, [-1, -0.5, -0.25, 0, 0.25, 0.5, 0.75, 1])
    assert found.tolist() == pytest.approx(numbers(throws), abs=0.0051)


def test_draw_throws_like_follow():
    cuts = [10.0, 30.0, 60.0]
    follow, draw = (c.throw(c.FRICTIONAL, 1.0, cuts, roll=roll) for roll in (1.0, -1.0))
    assert draw.tolist() == pytest.approx(follow.tolist(), abs=1e-6)


def test_the_throw_is_that_of_the_formula():
    assert c.formula_difference() < 1e-6


@pytest.mark.parametrize(("cut", "percent"), c.GEARING)
def test_gearing_needs_the_published_sidespin(cut, percent):
    for speed in c.SPEEDS.values():
        assert c.gearing(cut, speed) == pytest.approx(percent, abs=0.01)


def test_measured_throw_is_within_a_degree():
    assert all(
        abs(c.throw(c.FRICTIONAL, c.SPEEDS[s], [cut], roll=r)[0] - value) < 0.6 for cut, value, s, r in c.THROW_POINTS
    )


def test_frozen_balls_leave_within_four_degrees_of_the_measured_directions():
    off = c.frozen(c.SPEEDS["slow"]) - [value for _, value in c.FROZEN[1:-1]]
    assert abs(off).max() < 4.0
    assert (abs(off) < 3.0).sum() == 6


def test_snooker_shots_agree_with_the_model_of_the_paper():
    """The model of the paper also has the friction of the cloth during the impact, of about 0.5 %."""
    found, paper = np.array(c.snooker_shots()), np.array([shot.paper for shot in c.SNOOKER])
    assert abs(found[:, :2] / paper[:, :2] - 1).max() < 0.01
    assert abs(found[:, 2:] - paper[:, 2:]).max() < 0.5


def test_snooker_shots_agree_with_the_measurements_but_for_the_first():
    """The first shot deviates from the model of the paper by 12 % and 4 degrees too."""
    found, measured = (np.array(values)[1:] for values in (c.snooker_shots(), [shot.measured for shot in c.SNOOKER]))
    assert abs(found[:, :2] / measured[:, :2] - 1).max() < 0.065
    assert abs(found[:, 2] - measured[:, 2]).max() < 1.2


def test_balls_of_domenech_need_more_friction():
    usual, more = (c.domenech(mu, 0.95)[1]["throw"] for mu in (None, c.DOMENECH_FRICTION))
    assert more < 0.9 < 2.0 < usual


def test_rolling_elastic_balls_obey_wallace_and_schroeder():
    cuts = np.arange(1.0, 85.0)
    found = c.half_ball_rule(Physics(e_ball=1.0), 1.0, cuts)
    assert found == pytest.approx(c.wallace_schroeder(cuts), abs=1e-9)
    assert found.max() == pytest.approx(33.75, abs=0.01)
    assert c.half_ball_rule(Physics(e_ball=1.0), 1.0, [10, 20, 30, 40, 60]).tolist() == pytest.approx(
        [21.68, 31.87, 33.67, 31.20, 20.63], abs=0.005
    )


def test_stun_leaves_two_and_a_half_degrees_short_of_the_tangent():
    assert c.scatter_of_stun(30.0) == pytest.approx(87.52, abs=0.005)
