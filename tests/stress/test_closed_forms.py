"""Shots with closed-form results."""

from __future__ import annotations

import numpy as np
import pytest

from reference.stress.scenes import R, ideal, kinds, rough, run

G, SLIDE, ROLL = 9.81, 0.2, 0.01


@pytest.mark.parametrize("e", [0.5, 0.9, 1.0])
def test_a_collision_of_two_rolling_balls_with_restitution(e):
    scene = rough(1.0, 1.0, motion="rolling", mu_roll=ROLL, e_ball=e, length=8.0)
    gap, v = 0.25, 0.5
    shot = run(scene, [[-gap - 2 * R, 0.0], [0.0, 0.0]], [v, 0.0])
    square = v * v - 2 * ROLL * G * gap  # speed at the impact, squared
    ways = [square * ((1 + sign * e) / 2) ** 2 / (2 * ROLL * G) for sign in (-1, 1)]
    assert shot.positions[:, 0] == pytest.approx([-2 * R + ways[0], ways[1]], rel=1e-13, abs=1e-16)


def test_a_sliding_ball_hits_another_and_both_slide_and_roll():
    """Ball 0 slides up to ball 1. After the impact only its spin remains, which accelerates it again."""
    scene = rough(1.0, 1.0, e_ball=1.0, length=64.0, mu_roll=ROLL, mu_slide=SLIDE)
    gap, v = 0.25, 3.0
    shot = run(scene, [[-gap - 2 * R, 0.0], [0.0, 0.0]], [v, 0.0])
    a = SLIDE * G
    hit = np.sqrt(v * v - 2 * a * gap)  # speed at the impact, after (v - hit) / a seconds of sliding
    surface = 2.5 * (v - hit)  # R omega, from the sliding

    def way(speed: float) -> float:  # of a rolling ball that starts at `speed`
        return speed * speed / (2 * ROLL * G)

    rolled_0, rolled_1 = 2 / 7 * surface, 5 / 7 * hit
    slid_0 = rolled_0**2 / (2 * a)
    slid_1 = (hit**2 - rolled_1**2) / (2 * a)
    ends = [-2 * R + slid_0 + way(rolled_0), slid_1 + way(rolled_1)]
    assert shot.positions[:, 0] == pytest.approx(ends, rel=1e-12)


def test_ten_thousand_bounces_follow_the_unfolded_straight_line():
    """If the rectangle is mirrored at every bounce, the path is one straight line (unfolding of billiards)."""
    scene = ideal(1.0, max_time=1e9)
    rng = np.random.default_rng(3)
    start, velocity = rng.uniform(-0.5, 0.5, 2), rng.uniform(0.5, 2.0, 2)
    room = np.array([2.0, 1.0]) - R
    # The number of bounces is the number of images of cushions that the line crosses.
    time = 10_000 / (velocity / (2 * room)).sum()
    shot = run(scene, [start], velocity, max_time=time)
    line = start + velocity * time
    folded = np.abs((line + room) % (4 * room) - 2 * room) - room
    crossed = np.floor((line + room) / (2 * room)).sum()
    assert 9_990 < crossed < 10_010
    assert len(kinds(shot, "cushion")) == crossed
    assert shot.positions[0] == pytest.approx(-folded, abs=1e-11)
    assert np.abs(shot.velocities[0]) == pytest.approx(velocity, abs=0)
