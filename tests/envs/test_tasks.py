from typing import Any

import numpy as np
import pytest

from billiards_env.envs.tasks import (
    PLACE_RADIUS,
    TASKS,
    Outcome,
    judge,
    judge_carom,
    judge_place,
    judge_pot,
    judge_sum_to_three,
    judge_three_cushion,
)

NONE = np.zeros(3, bool)
BOTH = np.array([False, True, True])
GOAL = (0.3, -0.2)
SAMPLE: dict[str, Any] = {
    "before": NONE,
    "after": NONE,
    "cushions": (0, 0, 0),
    "before_hit": (-1, -1, -1),
    "cue": (9.0, 9.0),
}


def one(task, targets=BOTH, **changes: Any):
    """Returns the result of the last of three shots. The other two shots have different values."""
    shot = {**SAMPLE, **changes}
    goals, before, after = np.full((3, 1, 2), 9.0), np.ones((3, 3), np.bool_), np.zeros((3, 3), np.bool_)
    cushions, before_hit, positions = np.full((3, 3), 7), np.full((3, 3), 7), np.full((3, 3, 2), 5.0)
    goals[2, 0], before[2], after[2], positions[2, 0] = GOAL, shot["before"], shot["after"], shot["cue"]
    cushions[2], before_hit[2] = shot["cushions"], shot["before_hit"]
    return task(2, targets, Outcome(positions, goals, before, after, cushions, before_hit))


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
    assert one(judge_pot, before=balls(*before), after=balls(*after)) == (points, over, success)


def test_only_targets_count_in_pot():
    assert one(judge_pot, balls(2), after=balls(2)) == (1, True, True)
    assert one(judge_pot, balls(2), after=balls(1)) == (0, False, False)


TOUCHES = [
    ([-1, -1, -1], (), 0, False),
    ([-1, 0, -1], (), 0, False),
    ([-1, 0, 0], (), 1, False),
    ([-1, 3, 1], (), 1, False),
    ([-1, 0, 0], (1,), 1, True),
    ([-1, 0, 0], (0,), 0, True),
    ([-1, -1, 0], (2,), 0, True),
]


@pytest.mark.parametrize(("before_hit", "potted", "points", "over"), TOUCHES)
def test_carom(before_hit, potted, points, over):
    assert one(judge_carom, before_hit=before_hit, after=balls(*potted)) == (points, over, points == 1)


@pytest.mark.parametrize(
    ("before_hit", "points"),
    [
        ([-1, 0, 2], 0),
        ([-1, 0, 3], 1),
        ([-1, 3, 0], 1),
        ([-1, 2, 2], 0),
        ([-1, 5, 4], 1),
        ([-1, -1, 3], 0),
        ([-1, 3, -1], 0),
        ([9, 0, 0], 0),
    ],
)
def test_three_cushion_needs_three_contacts_before_the_last_ball(before_hit, points):
    assert one(judge_three_cushion, before_hit=before_hit, cushions=(9, 9, 9)) == (points, False, points == 1)


@pytest.mark.parametrize(("before_hit", "potted", "points", "over"), TOUCHES)
def test_three_cushion_ends_like_carom(before_hit, potted, points, over):
    later = np.where(np.array(before_hit) >= 0, 3, -1)
    assert one(judge_three_cushion, before_hit=later, after=balls(*potted)) == (points, over, points == 1)


@pytest.mark.parametrize(
    ("cushions", "before_hit", "points"),
    [
        ((0, 3), 0, 1),
        ((3, 0), 3, 1),
        ((2, 1), 1, 1),
        ((1, 1), 0, 0),
        ((2, 2), 0, 0),
        ((0, 0), 0, 0),
        ((3, 0), -1, 0),
    ],
)
def test_sum_to_three(cushions, before_hit, points):
    assert one(judge_sum_to_three, cushions=(*cushions, 7), before_hit=(-1, before_hit, 7)) == (
        points,
        False,
        points == 1,
    )


ON_THE_EDGE = (GOAL[0] + PLACE_RADIUS - 1e-12, GOAL[1])
BEYOND = (GOAL[0], GOAL[1] - PLACE_RADIUS - 1e-12)


@pytest.mark.parametrize(
    ("cue", "before_hit", "before", "after", "points", "over"),
    [
        (GOAL, (-1, 0, -1), (), (), 1, True),
        (ON_THE_EDGE, (-1, -1, 4), (), (), 1, True),
        (BEYOND, (-1, 0, -1), (), (), 0, False),
        (GOAL, (-1, -1, -1), (), (), 0, False),
        (GOAL, (-1, 0, -1), (), (1,), 1, True),
        (GOAL, (-1, -1, -1), (1,), (1,), 0, False),
        (GOAL, (-1, -1, -1), (1, 2), (1, 2), 1, True),
        (GOAL, (-1, 0, -1), (), (0,), 0, True),
    ],
)
def test_place(cue, before_hit, before, after, points, over):
    shot = {"cue": cue, "before_hit": before_hit, "before": balls(*before), "after": balls(*after)}
    assert one(judge_place, **shot) == (points, over, points == 1)


def test_place_needs_no_touch_without_object_balls():
    assert one(judge_place, NONE, cue=GOAL) == (1, True, True)


@pytest.mark.parametrize("task", TASKS)
def test_judge_calls_the_kernel_of_the_task(task):
    kernel = {
        "pot": judge_pot,
        "carom": judge_carom,
        "three_cushion": judge_three_cushion,
        "sum_to_three": judge_sum_to_three,
        "place": judge_place,
    }[task]
    shots: list[dict[str, Any]] = [
        {"after": balls(1)},
        {"before_hit": (-1, 0, 0)},
        {"before_hit": (-1, 3, 3)},
        {"before_hit": (-1, 0, -1), "cushions": (1, 2, 0)},
        {"before_hit": (-1, 0, -1), "cue": GOAL},
    ]
    all_points = set()
    for shot in shots:
        outcome = one(lambda *shot: judge(TASKS.index(task), *shot), **shot)
        assert outcome == one(kernel, **shot)
        all_points.add(outcome[0])
    assert all_points == {0, 1}
