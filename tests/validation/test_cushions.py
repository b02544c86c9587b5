"""Cushions agree with independent computations and with measurements."""

import dataclasses

import numpy as np
import pytest

from benchmarks.validation import cushions as c
from billiards_env.scene import Physics, Scene


def test_the_snooker_scene_fits_the_measured_speeds():
    physics = Scene.named("snooker").physics
    rms, most = c.figure_7a(physics)
    assert rms < 0.036
    assert most < 0.11
    assert c.figure_7a(c.PAPER)[0] > 3 * rms


@pytest.mark.parametrize(("field", "step"), [("e_cushion_loss", 0.02), ("e_cushion_onset", 0.3)])
def test_the_fit_of_the_snooker_scene_is_a_minimum(field, step):
    physics = Scene.named("snooker").physics
    best = c.figure_7a(physics)[0]
    for sign in (-1, 1):
        assert c.figure_7a(dataclasses.replace(physics, **{field: getattr(physics, field) + sign * step}))[0] > best


def test_the_snooker_scene_has_the_constants_of_the_papers():
    scene = Scene.named("snooker")
    paper = dataclasses.replace(
        c.PAPER,
        ball_ball="frictional",
        mu_ball=0.05,
        e_ball=0.89,
        mu_roll=0.0127,
        spin_decay=22.0,
        e_cushion=0.995,
        e_cushion_loss=0.1,
        e_cushion_onset=2.0,
        e_cushion_floor=0.6,
    )
    assert scene.physics == paper
    assert scene.table.cushion_height == pytest.approx(1.4 * scene.balls.radius[0])


def test_statements_of_mathavan_2010():
    speeds, angles = c.rebounds(c.PAPER, 60.0, np.array(c.SPEEDS))
    assert np.ptp(angles) < 1e-4
    assert speeds / c.SPEEDS == pytest.approx([speeds[0] / c.SPEEDS[0]] * len(c.SPEEDS))
    kept = c.rebounds(c.PAPER, np.arange(10.0, 91.0))[0]
    assert 38 <= 10 + kept.argmin() <= 45
    assert c.rebounds(c.PAPER, [90.0])[0][0] == pytest.approx(0.910, abs=0.002)


def test_slope_of_the_fit_is_near_that_of_the_paper():
    """The line of the paper has the slope 0.818."""
    assert c.fit_line(Scene.named("snooker").physics) == pytest.approx(0.818, abs=0.05)


def test_banks_without_friction_are_long():
    start, aim = np.array(c.BANKS).T
    assert c.bank(Physics(cushion="restitution"), start, aim, 2.0) == pytest.approx(aim - (start - aim) / 0.85)


def test_banks_of_han_agree_with_twice_plus_tenths():
    start, aim = np.array(c.BANKS).T
    assert abs(c.bank(Physics(cushion="han2005"), start, aim, c.BANK_SPEED)).max() < 0.05


def test_compliant_cushions_bank_short():
    start, aim = np.array(c.BANKS).T
    off = c.bank(c.BANK_LAWS["stronge"], start, aim, c.BANK_SPEED)
    assert (off > 0.2).all()
    assert (off < 0.65).all()
