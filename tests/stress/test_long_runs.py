"""Long runs: conservation laws, time reversal, the collisions that count digits of pi, an unfolded path."""

import math

import numpy as np
import pytest

from benchmarks.reference.stress import measure
from benchmarks.reference.stress.scenes import R, checked_shot, ideal, kinds

PI_DIGITS = [math.floor(math.pi * 10**k) for k in range(6)]


slow = pytest.mark.slow


@pytest.mark.parametrize("disks", [2, 16, 100])
@pytest.mark.parametrize("collisions", [2000, pytest.param(1_000_000, marks=slow)])
def test_elastic_collisions_conserve_energy_and_momentum(disks, collisions):
    drift = measure.drift(disks, collisions)
    assert drift["collisions"] >= collisions
    # Rounding adds up like a random walk; the limits also cover errors of one sign.
    assert drift["energy_drift"] < 2e-16 * drift["events"]
    assert drift["momentum_drift"] < 1e-16 * drift["collisions"]
    assert drift["momentum_of_one_collision"] < 1e-15
    assert drift["deepest_overlap_m"] < 1e-14


@pytest.mark.parametrize("count", [10, pytest.param(1000, marks=slow)])
def test_reversed_gases_return_to_their_starts_up_to_amplified_roundoff(count):
    runs = [measure.reversal(seed) for seed in range(count)]
    ratios = [run["error"] / run["predicted"] for run in runs if run["predicted"] < 1e-4]
    assert len(ratios) > 0.9 * len(runs)
    assert min(run["collisions"] for run in runs) > 10
    assert np.median(ratios) < 10
    assert max(ratios) < 100


@pytest.mark.parametrize("wall", ["cushion", "ball"])
@pytest.mark.parametrize("k", [0, 1, 2, 3, pytest.param(4, marks=slow), pytest.param(5, marks=slow)])
def test_colliding_blocks_count_the_digits_of_pi(k, wall):
    assert measure.blocks(k, wall) == PI_DIGITS[k]


def test_ten_thousand_bounces_follow_the_unfolded_straight_line():
    """If the rectangle is mirrored at every bounce, the path is one straight line (unfolding of billiards)."""
    scene = ideal(1.0, max_time=1e9)
    rng = np.random.default_rng(3)
    start, velocity = rng.uniform(-0.5, 0.5, 2), rng.uniform(0.5, 2.0, 2)
    room = np.array([2.0, 1.0]) - R
    # The number of bounces is the number of images of cushions that the line crosses.
    time = 10_000 / (velocity / (2 * room)).sum()
    shot = checked_shot(scene, [start], velocity, max_time=time)
    line = start + velocity * time
    folded = np.abs((line + room) % (4 * room) - 2 * room) - room
    crossed = np.floor((line + room) / (2 * room)).sum()
    assert 9_990 < crossed < 10_010
    assert len(kinds(shot, "cushion")) == crossed
    assert shot.positions[0] == pytest.approx(-folded, abs=1e-11)
    assert np.abs(shot.velocities[0]) == pytest.approx(velocity, abs=0)
