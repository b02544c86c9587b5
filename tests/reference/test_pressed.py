"""The reference for pressed balls against closed forms, and the engine against the reference."""

from __future__ import annotations

import dataclasses
import functools
import json
import math

import numpy as np
import pytest

from benchmarks import pressed
from benchmarks.pressed import CUSHION_CASES, E_BALL, E_CUSHION, PAIR_CASES, Case, at_cushion, deviation, frozen_pair
from billiards_env.scene import Balls, Physics, Scene
from reference.pressed import PressedShot, _pushed, _World, press_cushion, press_pair

CASES = (*CUSHION_CASES, *PAIR_CASES)
R = Balls.uniform(1).radius[0]
G = Physics().g
SLIDE, ROLL = Physics().mu_slide * G, Physics().mu_roll * G
TOLERANCE = 1e-3  # m

each_case = pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)


@functools.cache
def reference(case: Case) -> PressedShot:
    return case.reference()


def run(case: Case, **options) -> PressedShot:
    press = press_cushion if case.scene.n_balls == 1 else press_pair
    return press(case.scene, case.positions, case.velocities, case.spins, **options)


def with_physics(case: Case, **constants) -> Case:
    scene = dataclasses.replace(case.scene, physics=dataclasses.replace(case.scene.physics, **constants))
    return dataclasses.replace(case, scene=scene)


# The reference


@each_case
def test_half_the_step_changes_little(case):
    coarse = reference(case)
    fine = run(case, refinement=2, max_time=coarse.time if coarse.status == "max_time" else math.inf)
    assert fine.status == coarse.status
    assert fine.separation_time == pytest.approx(coarse.separation_time, abs=1e-8)
    assert fine.positions == pytest.approx(coarse.positions, abs=1e-8)


@each_case
def test_energy_does_not_rise(case):
    mass, radius = np.array(case.scene.balls.mass), np.array(case.scene.balls.radius)
    mass[np.isinf(mass)] = 0.0  # a fixed ball
    history = reference(case).history
    squares = [(now.velocities**2).sum(1) + 0.4 * radius**2 * (now.spins**2).sum(1) for now in history]
    energy = 0.5 * np.array(squares) @ mass
    assert np.diff(energy).max() <= 1e-10 * energy[0]  # a slip that ends is set to zero


@each_case
def test_the_contact_stays_closed_while_there_is_a_force(case):
    shot = reference(case)
    scene = case.scene
    for now in shot.history:
        if now.time >= shot.separation_time:
            continue
        assert now.force > 0.0
        if scene.n_balls == 2:
            assert np.hypot(*(now.positions[1] - now.positions[0])) == pytest.approx(2 * R, abs=1e-8)
        else:
            here, start = now.positions[0], np.array(case.positions[0])
            side = int(np.argmax(np.abs(start)))
            assert here[side] == pytest.approx(start[side], abs=1e-15)
    assert all(now.force == 0.0 for now in shot.history if now.time > shot.separation_time)


@each_case
def test_the_times_of_the_history_increase(case):
    shot = reference(case)
    times = [now.time for now in shot.history]
    assert times[0] == 0.0
    assert times[-1] == shot.time
    assert (np.diff(times) >= 0.0).all()
    assert shot.positions == pytest.approx(shot.history[-1].positions)
    if shot.status == "rest":
        assert not shot.velocities.any()
        assert shot.spins == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("cushion", ["han2005", "restitution"])
def test_top_spin_decays_linearly_at_a_smooth_cushion(cushion):
    case = with_physics(at_cushion((-100.0, 0.0, 0.0), cushion), mu_cushion=0.0)
    shot = run(case)
    rate = 5 * SLIDE / (2 * R)
    assert shot.separation_time == pytest.approx(100.0 / rate, abs=1e-8)
    assert shot.positions == pytest.approx(np.array(case.positions), abs=1e-15)
    for now in shot.history:
        assert not now.velocities.any()
        assert now.spins[0] == pytest.approx([-100.0 + rate * now.time, 0.0, 0.0], abs=1e-6)


def test_a_rough_cushion_also_reduces_top_spin():
    # With the slip of the nose vertical, N = mu g / (cos + mu_c sin), and the spin falls by 5/2 (mu g + mu_c N) / R.
    shot = run(at_cushion((-100.0, 0.0, 0.0)))
    physics = Physics()
    sin = 0.27
    force = SLIDE / (math.sqrt(1 - sin**2) + physics.mu_cushion * sin)
    assert shot.history[0].force == pytest.approx(force * Balls.uniform(1).mass[0], rel=1e-12)
    rate = 2.5 * (SLIDE + physics.mu_cushion * force) / R
    assert shot.separation_time == pytest.approx(100.0 / rate, abs=1e-8)
    assert not shot.velocities.any()


def test_side_spin_at_a_rough_cushion_moves_the_ball_along_it():
    # At the start the slip of the nose is R (100, -80 cos), and friction acts along it.
    shot = run(at_cushion((-100.0, 0.0, 80.0)), max_time=1e-6)
    sin, mu = 0.27, Physics().mu_cushion
    cos = math.sqrt(1 - sin**2)
    length = math.hypot(100.0, 80.0 * cos)
    force = SLIDE / (cos + mu * sin * 100.0 / length)
    along = mu * force * 80.0 * cos / length
    assert shot.velocities[0] == pytest.approx([1e-6 * along, 0.0], rel=1e-4)
    spin_rate = (shot.spins[0] - (-100.0, 0.0, 80.0)) / 1e-6
    down = -2.5 / R * along * cos - Physics().spin_decay
    assert spin_rate == pytest.approx(
        [2.5 / R * (SLIDE + mu * force * 100.0 / length), 2.5 / R * along * sin, down], rel=1e-4
    )


def test_a_ball_that_the_cloth_pulls_off_the_cushion_leaves_at_once():
    shot = run(at_cushion((100.0, 0.0, 0.0)))
    assert shot.separation_time == 0.0
    assert shot.status == "impact"
    # It slides for 2 R w / (7 mu g), until it rolls.
    slide = 2 * R * 100.0 / (7 * SLIDE)
    near = run(at_cushion((100.0, 0.0, 0.0)), max_time=slide)
    room = near.history[0].positions[0, 1]
    assert near.positions[0] == pytest.approx([0.0, room - 0.5 * SLIDE * slide**2], abs=1e-12)
    assert near.velocities[0] == pytest.approx([0.0, -2 * R * 100.0 / 7])


@pytest.mark.parametrize("resistance", ["between impacts", "always"])
def test_top_spin_pushes_an_object_ball_straight(resistance):
    # The cue ball's slip grows from -R w at a + 5/2 mu g, where both balls accelerate by a.
    shot = run(frozen_pair("", (0.0, 100.0, 0.0)), resistance=resistance)
    share = 2 * ROLL / (7 * SLIDE) if resistance == "between impacts" else 0.0
    push = (SLIDE + ROLL) / (12 / 7 + share)  # SLIDE - push = 5/7 push - (ROLL - share push)
    a = SLIDE - push
    lasts = R * 100.0 / (a + 2.5 * SLIDE)
    assert shot.history[0].force == pytest.approx(0.17 * push, rel=1e-12)
    assert shot.separation_time == pytest.approx(lasts, abs=1e-8)
    way = 0.5 * a * lasts**2 + (a * lasts) ** 2 / (2 * ROLL)
    assert shot.positions == pytest.approx(np.array([[-1.0 + way, 0.0], [-1.0 + 2 * R + way, 0.0]]), abs=1e-7)


def test_the_push_on_an_object_ball_depends_on_the_masses():
    for mass in (0.085, 0.34):
        shot = run(frozen_pair("", (0.0, 100.0, 0.0), masses=(0.17, mass)), resistance="always", max_time=0.1)
        # SLIDE - F / m = 5/7 F / M - ROLL
        force = (SLIDE + ROLL) / (1 / 0.17 + 5 / (7 * mass))
        assert shot.history[0].force == pytest.approx(force, rel=1e-12)
        a = SLIDE - force / 0.17
        assert shot.velocities == pytest.approx(np.array([[0.1 * a, 0.0], [0.1 * a, 0.0]]), rel=1e-9)


def test_a_fixed_ball_holds_the_spinning_one():
    shot = run(frozen_pair("", (0.0, 100.0, 0.0), masses=(0.17, math.inf)))
    assert shot.separation_time == pytest.approx(2 * R * 100.0 / (5 * SLIDE), abs=1e-8)
    assert shot.positions[:, 0] == pytest.approx([-1.0, -1.0 + 2 * R], abs=1e-12)


def test_two_balls_that_slide_against_each_other_alike_stay():
    shot = run(frozen_pair("", (0.0, 100.0, 0.0), object_spin=(0.0, -100.0, 0.0)))
    assert shot.history[0].force == pytest.approx(0.17 * SLIDE, rel=1e-12)
    assert shot.separation_time == pytest.approx(2 * R * 100.0 / (5 * SLIDE), abs=1e-8)
    assert shot.positions[:, 0] == pytest.approx([-1.0, -1.0 + 2 * R], abs=1e-9)


def test_two_balls_that_slide_against_each_other_share_the_excess():
    shot = run(frozen_pair("", (0.0, 100.0, 0.0), object_spin=(0.0, -100.0, 0.0), masses=(0.17, 0.1)), max_time=0.1)
    speed = 0.1 * (0.17 - 0.1) * SLIDE / (0.17 + 0.1)
    assert shot.velocities[:, 0] == pytest.approx([speed, speed], rel=1e-9)


def test_a_push_too_strong_for_the_static_friction_has_a_ball_slide():
    world = _World.of(Scene(Balls.uniform(1)))
    share = 2 / (7 * SLIDE)  # of the time without resistance to rolling, per push
    most = 3.5 * SLIDE
    for push in (0.999 * most, 1.001 * most):
        ax, ay, ux, uy = _pushed(world, [0.0] * 7, push, 0.0, share)
        assert ax == pytest.approx(2.5 * SLIDE, rel=2e-3)
        assert ux == pytest.approx(max(0.0, push - most))
        assert ay == uy == 0.0


def test_mirrored_and_turned_starts_have_mirrored_and_turned_ends():
    ahead = reference(at_cushion((-100.0, 0.0, -80.0))).positions[0] - (0.0, 0.635 - R)
    for side, turn in {"-y": (-1, 0), "+x": (0, -1), "-x": (0, 1)}.items():
        case = at_cushion((-100.0, 0.0, -80.0), "han2005", side)
        cos, sin = turn
        way = run(case).positions[0] - case.positions[0]
        assert way == pytest.approx([cos * ahead[0] - sin * ahead[1], sin * ahead[0] + cos * ahead[1]], abs=1e-12)
    mirrored = run(at_cushion((-100.0, 0.0, 80.0))).positions[0]
    assert mirrored == pytest.approx([-ahead[0], 0.635 - R], abs=1e-12)
    up = reference(frozen_pair("", (-5.0, 60.0, 0.0))).positions
    down = run(frozen_pair("", (5.0, 60.0, 0.0))).positions
    assert down == pytest.approx(up * (1.0, -1.0), abs=1e-12)


def test_momentum_of_a_pair_changes_by_the_cloth_alone():
    # The object ball is at rest and rolls at once; over a short time friction acts on the cue ball by mu g, and on the
    # object ball by 2/7 of the push and the resistance to rolling.
    shot = run(frozen_pair("", (0.0, 100.0, 0.0)), max_time=1e-3, resistance="always")
    push = shot.history[0].force / 0.17
    total = shot.velocities.sum(0)[0]
    assert total == pytest.approx(1e-3 * (SLIDE - 2 * push / 7 - ROLL), rel=1e-9)


def test_unfit_starts_are_refused():
    case = at_cushion((-100.0, 0.0, 0.0))
    pair = frozen_pair("", (0.0, 100.0, 0.0))
    with pytest.raises(ValueError, match=r"scene\.n_balls = 2: expected 1"):
        press_cushion(pair.scene, case.positions, case.velocities, case.spins)
    with pytest.raises(ValueError, match="expected a ball that touches one cushion, not 0"):
        press_cushion(case.scene, [(0.0, 0.0)], case.velocities, case.spins)
    with pytest.raises(ValueError, match="expected no component along the cushion's normal"):
        press_cushion(case.scene, case.positions, [(0.0, 1.0)], case.spins)
    with pytest.raises(ValueError, match="expected two balls"):
        press_pair(pair.scene, [(0.0, 0.0), (0.5, 0.0)], pair.velocities, pair.spins)
    with pytest.raises(ValueError, match="expected no relative velocity along the line of centres"):
        press_pair(pair.scene, pair.positions, [(0.1, 0.0), (0.0, 0.0)], pair.spins)
    with pytest.raises(ValueError, match="expected 'between impacts' or 'always'"):
        run(pair, resistance="never")
    with pytest.raises(ValueError, match=r"spins of shape \(2, 2\): expected \(2, 3\)"):
        press_pair(pair.scene, pair.positions, pair.velocities, [(0.0, 0.0), (0.0, 0.0)])
    with pytest.raises(ValueError, match="only spin keeps balls pressed"):
        run(dataclasses.replace(case, scene=Scene(Balls.uniform(1), physics=Physics("rolling", "restitution"))))


# The engine


@pytest.mark.parametrize("e", E_CUSHION)
@pytest.mark.parametrize("case", CUSHION_CASES, ids=lambda case: case.name)
def test_the_engine_moves_a_ball_pressed_against_a_cushion_as_the_reference_does(case, e):
    assert deviation(case, e, reference(case)) < TOLERANCE


@pytest.mark.parametrize("e", E_BALL)
@pytest.mark.parametrize("case", PAIR_CASES, ids=lambda case: case.name)
def test_the_engine_moves_a_pair_pressed_together_as_the_reference_does(case, e):
    assert deviation(case, e, reference(case)) < TOLERANCE


# The benchmark


def test_the_benchmark_writes_its_results_and_prints_them(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(pressed, "CUSHION_CASES", CUSHION_CASES[:1])
    monkeypatch.setattr(pressed, "PAIR_CASES", PAIR_CASES[2:3])
    pressed.main(["--output", str(tmp_path / "pressed.json")])
    written = json.loads((tmp_path / "pressed.json").read_text())
    assert [len(row["deviations"]) for row in written["cushions"]["cases"]] == [len(E_CUSHION)]
    assert [row["name"] for row in written["pairs"]["cases"]] == ["top spin 20"]
    out = capsys.readouterr().out
    assert "top spin 20" in out
    assert CUSHION_CASES[0].name in out
