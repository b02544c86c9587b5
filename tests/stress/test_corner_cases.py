"""Grazes, corners, simultaneous events, and very small and large numbers."""

from __future__ import annotations

import math

import numpy as np
import pytest

from reference import oracle
from reference.stress.scenes import R, energy, ideal, kinds, momentum, rough, run


@pytest.mark.parametrize("short", [1e-3, 1e-6, 1e-9, 1e-12, 1e-15])
def test_a_graze_is_a_collision(short):
    # The impact parameter is 2 R (1 - short).
    offset = 2 * R * (1 - short)
    scene = ideal(1.0, 1.0, max_time=1.0)
    shot = run(scene, [[-0.5, offset], [0.0, 0.0]], [1.0, 0.0])
    assert kinds(shot) == [("ball_ball", 0, 1)]
    # The sine of the angle between the line of centres and the path is 1 - short. The speed of ball 1 is its cosine.
    cos = math.sqrt((2 * R - offset) * (2 * R + offset)) / (2 * R)
    assert np.hypot(*shot.velocities[1]) == pytest.approx(cos, rel=1e-6)
    assert energy(scene, shot.velocities) == pytest.approx(0.5, rel=1e-14)
    assert momentum(scene, shot.velocities) == pytest.approx([1.0, 0.0], abs=1e-15)


@pytest.mark.parametrize("short", [1e-3, 1e-6, 1e-9])
def test_a_graze_on_a_curved_path_agrees_with_the_reference(short):
    scene = rough(1.0, 1.0)
    places, velocities, spins = [[-0.25, 2 * R * (1 - short)], [0.0, 0.0]], [2.0, 0.0], [0.0, 80.0, 0.0]
    shot = run(scene, places, velocities, spins)
    exact = oracle.run(scene, places, velocities, spins)
    assert kinds(shot) == [(e.kind, e.ball, e.other) for e in exact.events]
    final = [[float(x) for x in place] for place in exact.positions]
    assert shot.positions == pytest.approx(np.array(final), abs=1e-9)


def test_simultaneous_contacts_with_a_cushion_and_a_ball_are_mirrored_exactly():
    # Ball 0 reaches the +y cushion and ball 1 at exactly the same time.
    y = 1.0 - R
    places, velocities = [[0.0, y - 0.25], [0.25 + 2 * R, y]], [[1.0, 1.0], [0.0, 0.0]]
    shot = run(ideal(1.0, 1.0, max_time=0.5), places, velocities)
    assert shot.events is not None
    assert kinds(shot)[:2] == [("ball_ball", 0, 1), ("cushion", 0, 3)]
    assert shot.events["time"][0] == shot.events["time"][1] == 0.25
    assert shot.velocities.tolist() == [[0.0, -1.0], [1.0, 0.0]]
    mirror = np.array([1, -1])
    mirrored = run(ideal(1.0, 1.0, max_time=0.5), places * mirror, velocities * mirror)
    assert np.array_equal(mirrored.positions, shot.positions * mirror)


@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("sides", [(-1, -1), (-1, 1), (1, -1), (1, 1)])
def test_a_bounce_off_a_corner_reverses_the_velocity(sides, e):
    corner = np.array(sides) * [2.0 - R, 1.0 - R]
    shot = run(ideal(1.0, e_cushion=e, max_time=1.0), [corner - np.array(sides) * 0.5], np.array(sides) * 1.0)
    assert len(kinds(shot, "cushion")) == 2
    assert shot.velocities[0] == pytest.approx(-e * np.array(sides), abs=0)


@pytest.mark.parametrize("speed", [1e-300, 1e-150, 1e-30, 1e-9, 1e-3, 1.0, 100.0])
@pytest.mark.parametrize("motion", ["rolling", "sliding"])
def test_the_stopping_distance_follows_the_closed_form_at_any_speed(motion, speed):
    scene = rough(1.0, motion=motion, length=1e4, mu_roll=0.2)
    shot = run(scene, [[0.0, 0.0]], [speed, 0.0])
    g, slide, roll = 9.81, 0.2, 0.2
    way = speed * (speed / (2 * roll * g))
    if motion == "sliding":  # rolls from 5/7 of the speed
        way = speed * (speed * (12 / (49 * slide * g) + (25 / 49) / (2 * roll * g)))
    assert shot.positions[0, 0] == pytest.approx(way, rel=1e-13)
    assert shot.status == "rest"


@pytest.mark.parametrize("speed", [1e-300, 1e-9, 1.0, 100.0])
def test_balls_in_contact_exchange_any_speed_exactly(speed):
    shot = run(ideal(1.0, 1.0, max_time=1e-3), [[0.0, 0.0], [2 * R, 0.0]], [speed, 0.0])
    assert shot.velocities.tolist() == [[0.0, 0.0], [speed, 0.0]]


@pytest.mark.parametrize("ratio", [1, 5, 50])
@pytest.mark.parametrize("e", [0.0, 1.0])
def test_balls_of_very_different_radii_collide_at_the_exact_time(ratio, e):
    small = 0.1 / ratio
    scene = ideal(1.0, 1.0, e_ball=e, radius=(0.1, small), max_time=0.5)
    shot = run(scene, [[0.0, 0.0], [0.5, 0.0]], [1.0, 0.0])
    assert shot.events is not None
    assert shot.events["time"][0] == pytest.approx(0.4 - small, rel=1e-14)
    assert shot.velocities[:, 0] == pytest.approx([(1 - e) / 2, (1 + e) / 2], abs=1e-15)
