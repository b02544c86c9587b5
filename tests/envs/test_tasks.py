from typing import Any

import numpy as np
import pytest

from billiards_env.envs import make_env, tasks
from billiards_env.envs.episode_arrays import EpisodeArrays, TaskNumbers
from billiards_env.games import GAMES
from tests.helpers.environments import RUN_OUTS
from tests.helpers.games import state

GOAL = (0.3, -0.2)
PLACE, POSITION = tasks.TASKS["place"].goal_radius, tasks.TASKS["position"].goal_radius
SAMPLE: dict[str, Any] = {
    "targets": (1, 2),
    "before": (),
    "after": (),
    "off": (),
    "first_hit": -1,
    "cushions": (0, 0, 0),
    "before_hit": (-1, -1, -1),
    "cue": (9.0, 9.0),
}


def judged(kernel, targets, goal_radius=0.0, **arrays: Any):
    """Returns the result of the last shot in the arrays."""
    numbers = TaskNumbers(targets, 1 << np.arange(len(targets)), None, 0, goal_radius, 1, 0.0)
    unused = EpisodeArrays(*[None] * len(EpisodeArrays._fields))
    return kernel(len(arrays["potted"]) - 1, numbers, unused._replace(**arrays))


def one(task, **changes: Any):
    """Returns the result of the last of three shots. The other two shots have different values.

    The cue ball touches the balls that are potted before the others. `off` are driven off the table.
    """
    shot = {**SAMPLE, **changes}
    goals, pockets, after = np.full((3, 1, 2), 9.0), np.full((3, 3), 7), np.zeros((3, 3), np.bool_)
    cushions, before_hit, positions = np.full((3, 3), 7), np.full((3, 3), 7), np.full((3, 3, 2), 5.0)
    goals[2, 0], after[2], positions[2, 0] = GOAL, balls(shot["after"]), shot["cue"]
    pockets[2] = np.where(after[2] & ~balls(shot["before"]), 4, -1)
    pot_order = np.where(balls(shot["off"]), 4, pockets)
    cushions[2], before_hit[2] = shot["cushions"], shot["before_hit"]
    return judged(
        task,
        balls(shot["targets"]),
        {tasks.judge_place: PLACE, tasks.judge_position: POSITION}.get(task, 0.0),
        positions=positions,
        goals=goals,
        potted=after,
        cue=np.zeros(3, np.int64),
        cushions=cushions,
        cushions_before_hit=before_hit,
        first_hit=np.array([1, 1, shot["first_hit"]]),
        pockets=pockets,
        pot_order=pot_order,
        touched_first=pockets > 0,
    )


def balls(numbers):
    return np.isin(np.arange(3), numbers)


def test_every_task_has_its_own_kernel():
    assert all(getattr(task.judge, "__name__", None) == f"judge_{name}" for name, task in tasks.TASKS.items())


def test_the_jump_task_is_played_with_a_cue_by_default():
    env = make_env(task="jump")
    assert (env.action, env.scene.physics.flight) == ("strike", True)


# The balls that were potted before a shot and those after it, points, whether the episode is over, and success
POT = [
    ((), (), 0, False, False),
    ((), (1,), 1, False, False),
    ((1,), (1, 2), 1, True, True),
    ((), (0,), 0, True, False),
    ((), (0, 1, 2), 2, True, False),
]
CLEAR = [((), (1,), 0, False), ((1,), (1, 2), 1, True), ((), (1, 2), 1, True), ((1,), (0, 1, 2), 0, True)]
# The cushions of the cue ball before it touches each ball, the balls that are potted, and those driven off the table
JUMP = [
    ((-1, 0, -1), (1,), (), 1, True),
    ((-1, 1, 3), (1,), (), 0, True),  # off a cushion
    ((-1, 0, 0), (1, 2), (), 0, True),  # both at once
    ((-1, -1, 0), (1,), (), 0, True),
    ((-1, 0, 0), (1,), (2,), 0, True),
    ((-1, 0, -1), (0, 1), (), 0, True),
    ((-1, 0, -1), (), (), 0, False),
]
# The cushions of the cue ball before it touches each ball, and the balls that are potted
CAROM = [
    ((-1, -1, -1), (), 0, False),
    ((-1, 0, -1), (), 0, False),
    ((-1, 0, 0), (), 1, False),
    ((-1, 0, 0), (1,), 1, True),
    ((-1, 0, 0), (0,), 0, True),
]
THREE_CUSHION = [((-1, 0, 2), 0), ((-1, 0, 3), 1), ((-1, 3, 0), 1), ((-1, 3, -1), 0)]
# The cushions of both balls, and those of the cue ball before the touch
SUM_TO_THREE = [((0, 3), 0, 1), ((3, 0), 3, 1), ((2, 1), 1, 1), ((1, 1), 0, 0), ((0, 0), 0, 0), ((3, 0), -1, 0)]
ON_THE_EDGE, BEYOND = (GOAL[0] + PLACE - 1e-12, GOAL[1]), (GOAL[0], GOAL[1] - PLACE - 1e-12)
PLACES = [
    (GOAL, (-1, 0, -1), (), (), 1, True),
    (ON_THE_EDGE, (-1, -1, 4), (), (), 1, True),
    (BEYOND, (-1, 0, -1), (), (), 0, False),
    (GOAL, (-1, -1, -1), (), (), 0, False),
    (GOAL, (-1, 0, -1), (), (1,), 1, True),
    (GOAL, (-1, -1, -1), (1,), (1,), 0, False),
    (GOAL, (-1, -1, -1), (1, 2), (1, 2), 1, True),
    (GOAL, (-1, 0, -1), (), (0,), 0, True),
]
POSITIONS = [
    (GOAL, (), (1,), 1, True),
    ((GOAL[0] + POSITION - 1e-12, GOAL[1]), (), (1,), 1, True),
    ((GOAL[0], GOAL[1] - POSITION - 1e-12), (), (1,), 0, False),
    (GOAL, (), (), 0, False),
    (GOAL, (1,), (1,), 0, False),
    (GOAL, (), (0, 1), 0, True),
    ((9.0, 9.0), (1,), (1, 2), 0, True),
]


def cases():
    """Yields kernels, the changes of a shot, and the results."""
    for before, after, *result in POT:
        yield tasks.judge_pot, {"before": before, "after": after}, result
    yield tasks.judge_pot, {"targets": (2,), "after": (2,)}, (1, True, True)
    yield tasks.judge_pot, {"targets": (2,), "after": (1,)}, (0, False, False)
    for before, after, points, over in CLEAR:
        yield tasks.judge_clear, {"before": before, "after": after}, (points, over, points == 1)
    for before_hit, after, off, points, over in JUMP:
        shot = {"targets": (1,), "first_hit": 1, "before_hit": before_hit, "after": after, "off": off}
        yield tasks.judge_jump, shot, (points, over, points == 1)
    for before_hit, after, points, over in CAROM:
        three = [3 if cushions >= 0 else -1 for cushions in before_hit]
        yield tasks.judge_carom, {"before_hit": before_hit, "after": after}, (points, over, points == 1)
        yield tasks.judge_three_cushion, {"before_hit": three, "after": after}, (points, over, points == 1)
    for before_hit, points in THREE_CUSHION:
        shot = {"before_hit": before_hit, "cushions": (9, 9, 9)}
        yield tasks.judge_three_cushion, shot, (points, False, points == 1)
    for cushions, before, points in SUM_TO_THREE:
        shot = {"cushions": (*cushions, 7), "before_hit": (-1, before, 7)}
        yield tasks.judge_sum_to_three, shot, (points, False, points == 1)
    for cue, before_hit, before, after, points, over in PLACES:
        shot = {"cue": cue, "before_hit": before_hit, "before": before, "after": after}
        yield tasks.judge_place, shot, (points, over, points == 1)
    yield tasks.judge_place, {"targets": (), "cue": GOAL}, (1, True, True)  # no touch is needed without object balls
    for cue, before, after, points, over in POSITIONS:
        yield tasks.judge_position, {"cue": cue, "before": before, "after": after}, (points, over, points == 1)


@pytest.mark.parametrize(("judge", "shot", "result"), list(cases()), ids=lambda one: getattr(one, "__name__", str(one)))
def test_the_points_of_a_shot(judge, shot, result):
    assert one(judge, **shot) == tuple(result)


# --- run-outs ---------------------------------------------------------------------------------------------------------


def run_out(task, before=(), potted=(), first=1, cushion=5, **fields):
    """Returns the result of a shot of a run-out, and the legal balls after it.

    `potted` are the balls in the order in which they are potted. `first` is the ball that is touched first, and
    `cushion` the ball that touches a cushion after that; -1 for none.
    `fields` are fields of the state before the shot.
    """
    n = RUN_OUTS[task] + 1
    off, legal, touched_first = (np.zeros((1, n), np.bool_) for _ in range(3))
    off[0, [*before, *potted]] = True
    cushions, before_hit, pot_order = np.zeros((1, n), np.int32), np.full((1, n), -1), np.full((1, n), -1)
    pot_order[0, list(potted)] = range(len(potted))
    if cushion >= 0:
        cushions[0, cushion] = 1
    if first >= 0:
        before_hit[0, first], touched_first[0, first] = 0, True
    result = judged(
        tasks.TASKS[task].judge,
        np.zeros(n, np.bool_),
        potted=off,
        cue=np.zeros(1, np.int64),
        cushions=cushions,
        cushions_before_hit=before_hit,
        first_hit=np.array([first]),
        pockets=pot_order,
        pot_order=pot_order,
        touched_first=touched_first,
        states=np.array([state(task, on_table=set(range(n)) - {*before}, **fields)]),
        facts=np.zeros(1, GAMES[task].facts_type),
        legal_balls=legal,
    )
    return result, set(np.flatnonzero(legal[0]).tolist())


NINE_BALL = [
    ({"potted": [1]}, (1, False, False), {2}),
    ({"potted": [4]}, (1, False, False), {1}),
    ({}, (0, True, False), {1}),  # a miss
    ({"potted": [1], "cushion": -1}, (1, False, False), {2}),  # a potted ball needs no cushion
    ({"potted": [9]}, (9, True, True), {1}),  # a combination
    ({"potted": [9, 0]}, (0, True, False), {1}),
    ({"before": range(1, 9), "potted": [9], "first": 9}, (1, True, True), set()),
]


@pytest.mark.parametrize(("shot", "result", "on"), NINE_BALL)
def test_nine_ball(shot, result, on):
    assert run_out("nine_ball", **shot) == (result, on)


ALL, SOLIDS, STRIPES = set(range(1, 16)), set(range(1, 8)), set(range(9, 16))


EIGHT_BALL = [
    # The break
    ({"break_shot": True, "potted": [3, 11]}, (2, False, False), ALL - {3, 8, 11}),
    ({"break_shot": True}, (0, True, False), ALL - {8}),
    # An open table
    ({"potted": [11, 2, 3], "first": 2}, (1, False, False), STRIPES - {11}),  # the group of the ball potted first
    ({"potted": [2, 11, 3], "first": 11}, (2, False, False), SOLIDS - {2, 3}),
    # A group
    ({"solids": 0, "potted": [2, 11]}, (1, False, False), SOLIDS - {2}),
    ({"solids": 0, "potted": [11]}, (0, True, False), SOLIDS),
    ({"solids": 0, "potted": [2, 8]}, (1, True, False), SOLIDS - {2}),
    ({"solids": 0, "before": SOLIDS - {3}, "potted": [3], "first": 3}, (1, False, False), {8}),
    # The eight ball
    ({"solids": 0, "before": SOLIDS, "potted": [8], "first": 8}, (1, True, True), {8}),
]


@pytest.mark.parametrize(("shot", "result", "on"), EIGHT_BALL)
def test_eight_ball(shot, result, on):
    assert run_out("eight_ball", **shot) == (result, on)


LEGAL = [
    ("eight_ball", "eight_ball", ALL),
    ("eight_ball", "random", ALL - {8}),
    ("nine_ball", "random", {1}),
    ("pot", "random", set()),
]


@pytest.mark.parametrize(("task", "layout", "legal"), LEGAL)
def test_the_legal_balls_of_the_first_shot(task, layout, legal):
    env = make_env(task=task, layout=layout)
    env.reset(seed=0)
    assert set(np.flatnonzero(env.legal_balls).tolist()) == legal
    assert np.atleast_1d(env.get_state()["game"]["break_shot"]).tolist() == [legal == ALL] * (task != "pot")
