"""Long runs: conservation laws, time reversal, the collisions that count digits of pi."""

from __future__ import annotations

import math

import numpy as np
import pytest

from reference.stress import measure

PI_DIGITS = [math.floor(math.pi * 10**k) for k in range(6)]


def check_drift(disks: int, collisions: int) -> None:
    found = measure.drift(disks, collisions)
    assert found["collisions"] >= collisions
    # Rounding adds up like a random walk; the limits also cover errors of one sign.
    assert found["energy_drift"] < 2e-16 * found["events"]
    assert found["momentum_drift"] < 1e-16 * found["collisions"]
    assert found["momentum_of_one_collision"] < 1e-15
    assert found["deepest_overlap_m"] < 1e-14


@pytest.mark.parametrize("disks", [2, 16, 100])
def test_elastic_collisions_conserve_energy_and_momentum(disks):
    check_drift(disks, 2000)


@pytest.mark.slow
@pytest.mark.parametrize("disks", [2, 16, 100])
def test_a_million_elastic_collisions_conserve_energy_and_momentum(disks):
    check_drift(disks, 1_000_000)


def check_reversal(seeds: range) -> None:
    runs = [measure.reversal(seed) for seed in seeds]
    ratios = [run["error"] / run["predicted"] for run in runs if run["predicted"] < 1e-4]
    assert len(ratios) > 0.9 * len(runs)
    assert min(run["collisions"] for run in runs) > 10
    assert np.median(ratios) < 10
    assert max(ratios) < 100


def test_a_reversed_gas_returns_to_its_start_up_to_amplified_roundoff():
    check_reversal(range(10))


@pytest.mark.slow
def test_a_thousand_reversed_gases_return_to_their_starts():
    check_reversal(range(1000))


@pytest.mark.parametrize("wall", ["cushion", "ball"])
@pytest.mark.parametrize("k", [0, 1, 2, 3])
def test_colliding_blocks_count_the_digits_of_pi(k, wall):
    assert measure.blocks(k, wall) == PI_DIGITS[k]


@pytest.mark.slow
@pytest.mark.parametrize("wall", ["cushion", "ball"])
@pytest.mark.parametrize("k", [4, 5])
def test_colliding_blocks_count_more_digits_of_pi(k, wall):
    assert measure.blocks(k, wall) == PI_DIGITS[k]
