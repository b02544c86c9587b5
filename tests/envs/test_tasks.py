from typing import Any

import numpy as np
import pytest

from billiards_env.envs import BilliardsEnv
from billiards_env.envs.arrays import EpisodeArrays, TaskNumbers
from billiards_env.envs.tasks import (
    TASKS,
    judge_carom,
    judge_clear,
    judge_place,
    judge_position,
    judge_pot,
    judge_sum_to_three,
    judge_three_cushion,
)
from tests.helpers.environments import RUN_OUTS

NONE = np.zeros(3, bool)
BOTH = np.array([False, True, True])
GOAL = (0.3, -0.2)
PLACE, POSITION = TASKS["place"].goal_radius, TASKS["position"].goal_radius
SAMPLE: dict[str, Any] = {
    "before": NONE,
    "after": NONE,
    "cushions": (0, 0, 0),
    "before_hit": (-1, -1, -1),
    "cue": (9.0, 9.0),
    "first_hit": -1,
}


def judged(kernel, targets, goal_radius=0.0, **arrays: Any):
    """Returns the result of the last shot in the arrays."""
    numbers = TaskNumbers(targets, 1 << np.arange(len(targets)), 0, goal_radius, 1, 0.0, 1.0, 1.0, False)
    unused = EpisodeArrays(*[None] * len(EpisodeArrays._fields))
    return kernel(len(arrays["potted"]) - 1, numbers, unused._replace(**arrays))


def one(task, targets=BOTH, **changes: Any):
    """Returns the result of the last of three shots. The other two shots have different values."""
    shot = {**SAMPLE, **changes}
    goals, before, after = np.full((3, 1, 2), 9.0), np.ones((3, 3), np.bool_), np.zeros((3, 3), np.bool_)
    cushions, before_hit, positions = np.full((3, 3), 7), np.full((3, 3), 7), np.full((3, 3, 2), 5.0)
    goals[2, 0], before[2], after[2], positions[2, 0] = GOAL, shot["before"], shot["after"], shot["cue"]
    cushions[2], before_hit[2] = shot["cushions"], shot["before_hit"]
    return judged(
        task,
        targets,
        {judge_place: PLACE, judge_position: POSITION}.get(task, 0.0),
        positions=positions,
        goals=goals,
        potted_before=before,
        potted=after,
        cushions=cushions,
        cushions_before_hit=before_hit,
        first_hit=np.array([1, 1, shot["first_hit"]]),
    )


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
def test_carom_and_three_cushion(before_hit, potted, points, over):
    later = np.where(np.array(before_hit) >= 0, 3, -1)
    for kernel, hits in ((judge_carom, before_hit), (judge_three_cushion, later)):
        assert one(kernel, before_hit=hits, after=balls(*potted)) == (points, over, points == 1)


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


ON_THE_EDGE = (GOAL[0] + PLACE - 1e-12, GOAL[1])
BEYOND = (GOAL[0], GOAL[1] - PLACE - 1e-12)


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


@pytest.mark.parametrize(
    ("cue", "before", "after", "points", "over"),
    [
        (GOAL, (), (1,), 1, True),
        ((GOAL[0] + POSITION - 1e-12, GOAL[1]), (), (1,), 1, True),
        ((GOAL[0], GOAL[1] - POSITION - 1e-12), (), (1,), 0, False),
        (BEYOND, (), (), 0, False),
        (GOAL, (), (), 0, False),
        (GOAL, (1,), (1,), 0, False),
        (GOAL, (), (0, 1), 0, True),
        ((9.0, 9.0), (1,), (1, 2), 0, True),
    ],
)
def test_position(cue, before, after, points, over):
    shot = {"cue": cue, "before": balls(*before), "after": balls(*after)}
    assert one(judge_position, **shot) == (points, over, points == 1)


@pytest.mark.parametrize(
    ("before", "after", "points", "over"),
    [
        ((), (1,), 0, False),
        ((1,), (1, 2), 1, True),
        ((), (1, 2), 1, True),
        ((1,), (0, 1, 2), 0, True),
        ((), (0,), 0, True),
    ],
)
def test_clear(before, after, points, over):
    assert one(judge_clear, before=balls(*before), after=balls(*after)) == (points, over, points == 1)


# --- run-outs ---------------------------------------------------------------------------------------------------------


def run_out(task, before=(), potted=(), first=1, on=(), cushion=5):
    """Returns the result of a shot of a run-out, and the legal balls after it.

    `cushion` is the ball that touches a cushion after the hit, or -1.
    """
    n = RUN_OUTS[task] + 1
    was, off, legal = (np.zeros((1, n), np.bool_) for _ in range(3))
    was[0, list(before)] = off[0, list(before)] = off[0, list(potted)] = legal[0, list(on)] = True
    cushions = np.zeros((1, n), np.int32)
    if cushion >= 0:
        cushions[0, cushion] = 1
    before_hit = np.full((1, n), -1)
    if first >= 0:
        before_hit[0, first] = 0
    result = judged(
        TASKS[task].judge,
        np.zeros(n, np.bool_),
        potted_before=was,
        potted=off,
        cushions=cushions,
        cushions_before_hit=before_hit,
        first_hit=np.array([first]),
        legal_balls=legal,
    )
    return result, set(np.flatnonzero(legal[0]).tolist())


@pytest.mark.parametrize(
    ("shot", "result", "on"),
    [
        ({"potted": [1]}, (1, False, False), {2}),
        ({"potted": [1, 3]}, (2, False, False), {2}),
        ({"potted": [4]}, (1, False, False), {1}),
        ({}, (0, True, False), {1}),  # a miss
        ({"potted": [2], "first": 2}, (0, True, False), {1}),  # the wrong ball first
        ({"potted": [1, 0]}, (0, True, False), {2}),  # a scratch
        ({"first": -1, "cushion": -1}, (0, True, False), {1}),
        ({"cushion": -1}, (0, True, False), {1}),
        ({"potted": [1], "cushion": -1}, (1, False, False), {2}),  # a potted ball needs no cushion
        ({"potted": [9]}, (9, True, True), {1}),  # a combination
        ({"potted": [9], "first": 5}, (0, True, False), {1}),
        ({"potted": [9, 0]}, (0, True, False), {1}),
        ({"before": range(1, 9), "potted": [9], "first": 9, "on": [9]}, (1, True, True), set()),
    ],
)
def test_nine_ball(shot, result, on):
    assert run_out("nine_ball", **{"on": [1], **shot}) == (result, on)


ALL, SOLIDS, STRIPES = set(range(1, 16)), set(range(1, 8)), set(range(9, 16))


@pytest.mark.parametrize(
    ("shot", "result", "on"),
    [
        # The break
        ({"on": ALL, "potted": [3, 11]}, (2, False, False), ALL - {3, 8, 11}),
        ({"on": ALL}, (0, True, False), ALL - {8}),
        ({"on": ALL, "potted": [3, 0]}, (0, True, False), ALL - {3, 8}),
        ({"on": ALL, "potted": [8]}, (0, True, False), ALL - {8}),
        # An open table
        ({"potted": [2], "first": 2}, (1, False, False), SOLIDS - {2}),
        ({"potted": [11], "first": 2}, (1, False, False), STRIPES - {11}),
        ({"potted": [2, 3, 11], "first": 11}, (1, False, False), STRIPES - {11}),
        ({"potted": [2, 3, 11], "first": 1}, (2, False, False), SOLIDS - {2, 3}),
        ({"potted": [2], "first": 8}, (0, True, False), SOLIDS - {2}),
        ({}, (0, True, False), ALL - {8}),
        # A group
        ({"on": SOLIDS, "potted": [2]}, (1, False, False), SOLIDS - {2}),
        ({"on": SOLIDS, "potted": [2, 11]}, (1, False, False), SOLIDS - {2}),
        ({"on": SOLIDS, "potted": [11]}, (0, True, False), SOLIDS),
        ({"on": SOLIDS, "potted": [2], "first": 11}, (0, True, False), SOLIDS - {2}),
        ({"on": SOLIDS, "potted": [2, 8]}, (1, True, False), SOLIDS - {2}),
        ({"on": {3}, "before": SOLIDS - {3}, "potted": [3], "first": 3}, (1, False, False), {8}),
        # The eight ball
        ({"on": {8}, "before": SOLIDS, "potted": [8], "first": 8}, (1, True, True), {8}),
        ({"on": {8}, "before": SOLIDS, "potted": [8, 0], "first": 8}, (0, True, False), {8}),
        ({"on": {8}, "before": SOLIDS, "first": 8}, (0, True, False), {8}),
        ({"on": {8}, "before": SOLIDS, "potted": [8], "first": 9}, (0, True, False), {8}),
    ],
)
def test_eight_ball(shot, result, on):
    assert run_out("eight_ball", **{"on": ALL - {8}, **shot}) == (result, on)


@pytest.mark.parametrize(
    ("task", "layout", "legal"),
    [
        ("eight_ball", "eight_ball", ALL),
        ("eight_ball", "tight_rack", ALL),
        ("eight_ball", "random", ALL - {8}),
        ("nine_ball", "nine_ball", {1}),
        ("nine_ball", "random", {1}),
        ("pot", "random", set()),
    ],
)
def test_the_legal_balls_of_the_first_shot(task, layout, legal):
    env = BilliardsEnv(task=task, layout=layout)
    env.reset(seed=0)
    assert set(np.flatnonzero(env.legal_balls).tolist()) == legal


def test_the_table_of_tasks():
    assert all(task.judge.__name__ == f"judge_{name}" for name, task in TASKS.items())
    for name, task in TASKS.items():
        env = BilliardsEnv(task=name)
        assert (env.layout, env.max_shots) == (task.layout, task.max_shots)
