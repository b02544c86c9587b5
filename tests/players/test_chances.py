"""The probability of a pot to first order is that of many shots with errors."""

import numpy as np

from billiards_env import Scene, simulate_batch
from billiards_env.players.chances import pot_chances
from studies.pot_chances import random_pots, sampled

NOISE = (0.125, 0.075)


def test_it_is_the_share_of_sampled_pots():
    scene, rng = Scene.named("pool", 1), np.random.default_rng(3)
    positions, velocities = random_pots(scene, 60, rng)
    found = pot_chances(scene, positions, velocities, 1, NOISE)
    true = [sampled(scene, place, velocity, 1000, rng) for place, velocity in zip(positions, velocities, strict=True)]
    assert np.abs(found - true).mean() < 0.03
    assert found.std() > 0.2


def test_errors_can_keep_the_cue_ball_out_of_a_pocket():
    scene, rng = Scene.named("pool", 1), np.random.default_rng(6)
    positions, velocities = random_pots(scene, 400, rng)
    potted = simulate_batch(scene, positions, velocities).potted
    both = potted.all(axis=1)
    found = pot_chances(scene, positions[both], velocities[both], 1, NOISE)
    pairs = zip(positions[both], velocities[both], strict=True)
    true = np.array([sampled(scene, place, velocity, 1000, rng) for place, velocity in pairs])
    assert len(true) >= 10
    assert true.max() > 0.3
    assert np.abs(found - true).mean() < 0.03


def test_a_ball_that_nothing_touches_is_not_potted():
    scene = Scene.named("pool", 1)
    assert pot_chances(scene, [[[0.0, 0.0], [0.5, 0.3]]], [[-1.0, 0.0]], 1, NOISE).tolist() == [0.0]


def test_without_errors_it_is_the_outcome():
    scene, rng = Scene.named("pool", 1), np.random.default_rng(4)
    positions, velocities = random_pots(scene, 40, rng)
    found = pot_chances(scene, positions, velocities, 1, (0.0, 0.0))
    potted = simulate_batch(scene, positions, velocities).potted
    np.testing.assert_array_equal(found.round(6), potted[:, 1] & ~potted[:, 0])
