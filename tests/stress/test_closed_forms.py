"""Shots with closed-form results."""

from __future__ import annotations

import numpy as np
import pytest

from reference.stress.scenes import R, ideal, kinds, run


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
