"""The estimate of the scatter of cushions from fitted shots."""

import numpy as np

from billiards_env import simulate
from billiards_env.calibration import observed
from billiards_env.calibration.preparation import prepare
from billiards_env.calibration.scatter import estimate
from billiards_env.calibration.starts import settle
from tests.helpers.tracks import SCENE

TRUTH = {"normal_std": 0.03, "along_std": 0.02, "spin_std": 0.05}
NOISE = 0.0005


def fitted(scatter, m=15):
    """Returns m shots of the cue ball alone, fitted from their true starts until the fourth cushion."""
    shots, in_play = [], np.arange(SCENE.n_balls) < 1
    for k in range(m):
        angle = 0.3 + 0.4 * k
        velocity = 3.0 * np.array([np.cos(angle), np.sin(angle)])
        spin = np.array([-velocity[1], velocity[0], 1.0]) / SCENE.balls.radius[0]
        places = np.array([[0.2, 0.1], [0.0, 0.3], [0.0, 0.0]])
        options = {} if scatter is None else {"scatter": scatter, "seed": k}
        shot = simulate(SCENE, places, velocity, spins=spin, in_play=in_play, record=True, **options)
        track = observed(str(k), shot, np.arange(0.0, 3.0, 0.02), noise=NOISE, seed=k)
        ready = prepare(SCENE, track.rows(track.balls == 0), NOISE)
        start = np.concatenate((places.ravel(), velocity, spin, [0.0]))
        ready = ready._replace(starts=start[None]).until(4)
        shots.append(ready._replace(starts=settle(SCENE, ready.starts, ready)[0]))
    return shots


def test_the_estimate_finds_the_scatter_of_simulated_shots():
    result = estimate(SCENE, fitted(TRUTH), NOISE)
    assert result is not None
    assert 40 <= result.contacts <= 60
    for name, value in TRUTH.items():
        low, high = result.intervals[name]
        assert 0.6 * value < result.values[name] < 2.0 * value
        assert low < result.values[name] < high < 4.0 * low


def test_shots_without_scatter_have_a_small_estimate():
    result = estimate(SCENE, fitted(None), NOISE)
    assert result is not None
    assert all(value < 0.004 for value in result.values.values())


def test_few_contacts_give_no_estimate():
    assert estimate(SCENE, fitted(TRUTH, 2), NOISE) is None
