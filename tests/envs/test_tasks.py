import numpy as np
import pytest

from billiards_env.envs.tasks import CAROM, POT, TASKS, carom, judge, pot

NONE = np.zeros(3, bool)
BOTH = np.array([False, True, True])


def one(task, targets, before, after, cushions_before_hit):
    """What the last of three shots is worth, the others being other ones."""
    told = np.ones((3, 3), np.bool_), ~np.ones((3, 3), np.bool_), np.full((3, 3), 7)
    for batch, row in zip(told, (before, after, cushions_before_hit), strict=True):
        batch[2] = row
    return task(2, targets, *told)


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
    outcome = one(pot, BOTH, balls(*before), balls(*after), np.full(3, -1))
    assert outcome == (points, over, success)


def test_pot_asks_for_the_targets_only():
    outcome = one(pot, balls(2), NONE, balls(2), np.full(3, -1))
    assert outcome == (1, True, True)
    assert one(pot, balls(2), NONE, balls(1), np.full(3, -1)) == (0, False, False)


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
    outcome = one(carom, BOTH, NONE, balls(*potted), np.array(cushions_before_hit))
    assert outcome == (points, over, points == 1)


def test_each_task_is_judged_by_its_kernel():
    assert (TASKS[POT], TASKS[CAROM]) == ("pot", "carom")
    shot = 0, BOTH, NONE[None], balls(1)[None], np.zeros((1, 3), np.int32)
    assert judge(POT, *shot) == pot(*shot) == (1, False, False)
    assert judge(CAROM, *shot) == carom(*shot) == (1, True, True)
