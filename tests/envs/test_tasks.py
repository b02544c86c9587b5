import itertools

import numpy as np
import pytest

from billiards_env.envs.tasks import TASKS, carom, pot

NONE = np.zeros(3, bool)
BOTH = np.array([False, True, True])


def balls(*numbers):
    return np.isin(np.arange(3), numbers)


@pytest.mark.parametrize(
    ("before", "after", "points", "over", "success"),
    [
        ((), (), 0, False, False),
        ((), (1,), 1, False, False),
        ((1,), (1,), 0, False, False),
        ((1,), (1, 2), 1, True, True),
        ((), (1, 2), 2, True, True),
        ((), (0,), 0, True, False),
        ((1,), (0, 1), 0, True, False),
        ((), (0, 1, 2), 2, True, False),
    ],
)
def test_pot(before, after, points, over, success):
    outcome = pot(BOTH, balls(*before), balls(*after), np.full(3, -1))
    assert (outcome.points, outcome.over, outcome.success) == (points, over, success)


def test_pot_asks_for_the_targets_only():
    outcome = pot(balls(2), NONE, balls(2), np.full(3, -1))
    assert (outcome.points, outcome.over, outcome.success) == (1, True, True)
    assert pot(balls(2), NONE, balls(1), np.full(3, -1)).points == 0


@pytest.mark.parametrize(
    ("cushions_before_hit", "potted", "points", "over"),
    [
        ([-1, -1, -1], (), 0, False),
        ([-1, 0, -1], (), 0, False),
        ([-1, 0, 0], (), 1, False),
        ([-1, 3, 1], (), 1, False),
        ([-1, 0, 0], (1,), 1, True),
        ([-1, 0, 0], (0,), 0, True),
        ([-1, -1, 0], (2,), 0, True),
    ],
)
def test_carom(cushions_before_hit, potted, points, over):
    outcome = carom(BOTH, NONE, balls(*potted), np.array(cushions_before_hit))
    assert (outcome.points, outcome.over, outcome.success) == (points, over, points == 1)


@pytest.mark.parametrize("task", TASKS)
def test_a_batch_of_shots_is_worth_what_they_are_worth_singly(task):
    cases = list(itertools.product(itertools.product([False, True], repeat=3), repeat=2))
    before = np.array([a for a, b in cases])
    after = before | np.array([b for a, b in cases])
    hits = np.random.default_rng(0).integers(-1, 2, size=(5, len(cases), 3))
    batch = TASKS[task](BOTH, np.broadcast_to(before, hits.shape), np.broadcast_to(after, hits.shape), hits)
    assert [np.shape(field) for field in batch] == [(5, len(cases))] * 3
    singly = [[TASKS[task](BOTH, before[i], after[i], h[i]) for i in range(len(cases))] for h in hits]
    np.testing.assert_array_equal(np.stack(batch, axis=-1), singly)
