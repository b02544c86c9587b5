"""Shots of PIC without a closed form. Other tests of PIC are in `test_closed_forms.py` and `test_invariants.py`."""

import math

import numpy as np
import pytest

from billiards_env import Scene
from billiards_env.physics.state import T0, VX, VY
from billiards_env.scene import Balls, Physics, layouts
from billiards_env.scene.table import Table
from tests.helpers.shots import FREE, ROLLING, SLIDING, R, kinds, simulate, world


def test_impacts_do_not_move_a_fixed_ball():
    shot = simulate(
        world(3, SLIDING, mass=(0.2, math.inf, 0.2)),
        [[-1.0, 0.0], [0.0, 0.01], [0.5, 0.0]],
        [[3.0, 0.0], [0, 0], [-3, 0]],
    )
    assert shot.positions[1].tolist() == [0.0, 0.01]
    assert shot.velocities[1].tolist() == [0.0, 0.0]
    assert shot.status == "rest"


@pytest.mark.parametrize("physics", [FREE, ROLLING, SLIDING])
@pytest.mark.parametrize("offset", [0.1, 0.5, 0.9])
def test_elastic_balls_of_equal_mass_separate_at_a_right_angle(physics, offset):
    shot = simulate(world(2, physics), [[-1.0, 2 * R * offset], [0.0, 0.0]], [3.0, 0.0], record=True)
    hit = shot.events[shot.events["kind"] == "ball_ball"][0]["time"]
    ball, _, rows = shot.trajectory
    a, b = (rows[(ball == i) & (rows[:, T0] == hit)][0, [VX, VY]] for i in (0, 1))
    assert a @ b == pytest.approx(0.0, abs=1e-14)
    assert b[1] / b[0] == pytest.approx(-offset / math.sqrt(1 - offset**2))


@pytest.mark.parametrize("physics", [FREE, ROLLING, SLIDING])
@pytest.mark.parametrize(("offset", "hits"), [(1 - 1e-13, True), (1 + 1e-13, False)])
def test_a_graze_is_decided_to_13_digits(physics, offset, hits):
    shot = simulate(world(2, physics), [[-1.0, 2 * R * offset], [0.0, 0.0]], [2.5, 0.0], record=True, max_time=1.0)
    assert ("ball_ball" in shot.events["kind"]) == hits
    assert shot.first_hit == (1 if hits else -1)


def test_a_plastic_full_hit_is_not_repeated():
    # The rounding of the velocities after it is no approach. The rounding of the gap may cause a second contact.
    scene = world(2, FREE, mass=(0.2, 0.3), e_ball=0.0)
    for angle in np.random.default_rng(0).uniform(0.0, 2 * math.pi, 20):
        along = np.array([math.cos(angle), math.sin(angle)])
        shot = simulate(scene, [-0.3 * along, [0.0, 0.0]], 2 * along, max_time=1.0)
        assert shot.n_events <= 2


@pytest.mark.parametrize("physics", [FREE, ROLLING, SLIDING])
@pytest.mark.parametrize(("half", "axis"), [((1.0, 2.0), 0), ((2.0, 1.0), 1)])
@pytest.mark.parametrize("sign", [1, -1])
def test_a_ball_frozen_to_a_cushion_rolls_along_it(physics, half, axis, sign):
    place, start = np.zeros(2), np.zeros(2)
    place[axis], start[1 - axis] = sign * (1.0 - R), 1.0
    shot = simulate(world(1, physics, Table(2 * half[0], 2 * half[1])), [place], start, max_time=1.5, record=True)
    assert shot.positions[0, axis] == place[axis]
    assert shot.cushions.tolist() == [0]
    assert shot.positions[0, 1 - axis] > 0.5


@pytest.mark.parametrize(
    ("name", "n", "layout"),
    [("pool", 3, "random"), ("carom", 3, "random"), ("ideal", 3, "random"), ("pool", 15, "tight_rack")],
)
def test_a_shot_without_velocity_has_no_events(name, n, layout):
    scene = Scene.named(name, n)
    places = layouts.draw(layout, scene, np.random.default_rng(0))
    for arguments in ({}, {"max_time": 0.0}, {"max_events": 0}):
        shot = simulate(scene, places, [0.0, 0.0], record=True, **arguments)
        assert (shot.status, shot.n_events, shot.time, len(shot.events)) == ("rest", 0, 0.0, 0)
        assert np.array_equal(shot.positions, places)


def test_a_shot_with_a_time_limit_of_0_changes_nothing():
    scene = Scene.named("pool", 1)
    shot = simulate(scene, [[-0.5, 0.0], [0.5, 0.0]], [1.0, 2.0], max_time=0.0)
    assert (shot.status, shot.time, shot.n_events) == ("max_time", 0.0, 0)
    assert shot.positions.tolist() == [[-0.5, 0.0], [0.5, 0.0]]
    assert shot.velocities.tolist() == [[1.0, 2.0], [0.0, 0.0]]


def test_the_first_hit_and_the_cushion_contacts_before_it_are_counted():
    # The cue ball bounces off the +x cushion, passes ball 1 and hits ball 2.
    shot = simulate(
        world(3, FREE, Table(2.0, 2.0)), [[0.0, 0.0], [0.0, 0.5], [-0.5, 0.0]], [1.0, 0.0], max_time=3.0, record=True
    )
    assert kinds(shot)[:2] == [("cushion", 0, 1), ("ball_ball", 0, 2)]
    assert shot.first_hit == 2
    assert shot.cushions_before_hit.tolist() == [-1, -1, 1]
    assert shot.cushions.tolist()[:2] == [1, 0]


def test_cushion_contacts_before_a_hit_are_those_before_the_first_hit_on_the_ball():
    # The cue ball bounces between a fixed ball and the -x cushion.
    scene = world(2, FREE, Table(2.0, 2.0), mass=(0.2, math.inf))
    shot = simulate(scene, [[-0.5, 0.0], [0.5, 0.0]], [1.0, 0.0], max_time=4.0)
    assert (shot.cushions.tolist(), shot.cushions_before_hit.tolist()) == ([1, 0], [-1, 0])
    assert shot.n_events == 3


def test_inelastic_balls_in_contact_come_to_rest():
    # Impacts weaker than the rounding of the velocities must not repeat without end.
    scene = Scene(Balls.uniform(3), physics=Physics(motion="rolling", cushion="restitution", e_ball=0.0))
    places = [
        [0.7546465550499861, 0.18634748698850304],
        [0.2722874709803904, -0.29334855696128165],
        [-0.9428818522660272, -0.5643652584341258],
    ]
    velocities = [
        [1.0536954305407527, 1.174844680144182],
        [-2.4301633276908885, 1.8900956367117439],
        [-1.747814538299288, -2.473654305026787],
    ]
    shot = simulate(scene, places, velocities, max_events=2000)
    assert shot.status == "rest"
