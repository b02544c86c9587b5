import numpy as np
import pytest

from billiards_env.intervals import bootstrap, interquartile_mean, mean_interval, over_seeds, wilson_interval


# The interval's ends solve (rate - p)^2 = z^2 p (1 - p) / n for p.
@pytest.mark.parametrize(("successes", "episodes"), [(0, 10), (1, 7), (15, 100), (500, 1000), (10, 10)])
def test_the_interval_solves_wilsons_equation(successes, episodes):
    low, high = wilson_interval(successes, episodes)
    rate = successes / episodes
    assert 0 <= low <= rate + 1e-15
    assert rate - 1e-15 <= high <= 1
    for p in (low, high):
        assert (rate - p) ** 2 == pytest.approx(1.959963984540054**2 * p * (1 - p) / episodes, abs=1e-12)


def test_the_interval_of_a_mean_contains_it_in_95_percent_of_samples():
    rng, held = np.random.default_rng(0), 0
    for _ in range(2000):
        low, high = mean_interval(rng.poisson(1.4, 100).tolist()) or (0.0, 0.0)
        held += low <= 1.4 <= high
    assert 0.93 < held / 2000 < 0.97


def test_student_intervals_contain_the_mean_in_95_percent_of_samples():
    rng, mean = np.random.default_rng(0), 0
    for _ in range(4000):
        low, high = over_seeds(rng.normal(0.5, 0.1, 3).tolist())["interval"]
        mean += low <= 0.5 <= high
    assert 0.94 < mean / 4000 < 0.96
    assert over_seeds([0.5]) == {"mean": 0.5, "interval": None}


# By hand: a quarter of 5 values is 1.25, so the second and the fourth have the weight 0.75.
def test_the_interquartile_mean_is_that_of_the_middle_half():
    assert interquartile_mean([9.0, 0.0, 2.0, 1.0]) == 1.5
    assert interquartile_mean([-50.0, 1.0, 2.0, 4.0, 99.0]) == pytest.approx((0.75 * 1.0 + 2.0 + 0.75 * 4.0) / 2.5)
    assert interquartile_mean([3.0]) == 3.0
    assert interquartile_mean(np.array([[1.0, 3.0], [2.0, 4.0]])).tolist() == [2.0, 3.0]


def test_the_bootstrap_interval_of_a_difference_contains_it():
    rng, held = np.random.default_rng(0), 0
    for _ in range(400):
        a, b = rng.normal(0.5, 0.1, 40), rng.normal(0.4, 0.1, 30)
        low, high = bootstrap(lambda x, y: x.mean(-1) - y.mean(-1), a, b, resamples=400)
        held += low <= 0.1 <= high
    assert 0.91 < held / 400 < 0.98
