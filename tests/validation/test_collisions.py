"""Impacts of two balls agree with published tables and measurements."""

from types import FunctionType
from typing import Any

import numpy as np
import pytest

from benchmarks.validation import collisions as c
from billiards_env.engine import frozen_strike
from billiards_env.jit import allocating, entry_point
from billiards_env.scene import Physics


def test_the_throw_is_that_of_the_formula():
    assert c.formula_difference() < 1e-6


def test_measured_throw_is_within_a_degree():
    assert all(
        abs(c.throw(c.FRICTIONAL, c.SPEEDS[s], [cut], roll=r)[0] - value) < 0.6 for cut, value, s, r in c.THROW_POINTS
    )


def test_frozen_balls_leave_within_four_degrees_of_the_measured_directions(monkeypatch):
    frozen = c.frozen(c.SPEEDS["slow"])
    off = np.subtract(frozen.directions, [value for _, value in c.FROZEN])
    assert abs(off).max() < 4.0
    assert (abs(off) < 3.0).sum() == 8
    assert off[0] == 0.0
    assert frozen.ratio == pytest.approx(0.987, abs=5e-4)
    names = {**vars(frozen_strike), "LEFT": 0.0}  # the constant that the ratio determines
    for name, decorate in (("_drive_balls", allocating), ("_drive", entry_point)):
        kernel: Any = getattr(frozen_strike, name)
        names[name] = decorate(FunctionType(getattr(kernel, "py_func", kernel).__code__, names))
    monkeypatch.setattr(frozen_strike, "_drive", names["_drive"])
    other = c.frozen(c.SPEEDS["slow"])
    assert other.ratio == pytest.approx(1.0)
    assert np.abs(np.subtract(other.directions, frozen.directions)).max() < 0.5


def test_snooker_shots_agree_with_the_measurements_but_for_the_first():
    """The first shot deviates from the model of the paper by 12 % and 4 degrees too."""
    ours, measured = (np.array(values)[1:] for values in (c.snooker_shots(), [shot.measured for shot in c.SNOOKER]))
    assert abs(ours[:, :2] / measured[:, :2] - 1).max() < 0.065
    assert abs(ours[:, 2] - measured[:, 2]).max() < 1.2


def test_balls_of_domenech_need_more_friction():
    usual, more = (c.domenech(mu, 0.95)[1]["throw"] for mu in (None, c.DOMENECH_FRICTION))
    assert more < 0.9 < 2.0 < usual


def test_rolling_elastic_balls_obey_wallace_and_schroeder():
    cuts = np.arange(1.0, 85.0)
    angles = c.half_ball_rule(Physics(e_ball=1.0), 1.0, cuts)
    assert angles == pytest.approx(c.wallace_schroeder(cuts), abs=1e-9)
    assert angles.max() == pytest.approx(33.75, abs=0.01)
    assert c.half_ball_rule(Physics(e_ball=1.0), 1.0, [10, 20, 30, 40, 60]).tolist() == pytest.approx(
        [21.68, 31.87, 33.67, 31.20, 20.63], abs=0.005
    )


def test_stun_leaves_two_and_a_half_degrees_short_of_the_tangent():
    assert c.scatter_of_stun(30.0) == pytest.approx(87.52, abs=0.005)
