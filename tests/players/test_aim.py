"""`aim` reaches its goals exactly, and its answers are shots that reach them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from billiards_env import Scene, simulate
from billiards_env.players.aim import Cushions, FirstTouch, Leave, Pot, Touch, aim
from billiards_env.scene import layouts

POOL, CAROM = Scene.named("pool", 1), Scene.named("carom", 2)
PLACES = [[-0.6, 0.0], [0.6, 0.3]]


def test_pot_and_position_are_exact():
    found = aim(POOL, PLACES, [Pot(1, 3), Leave((0.5, -0.3), radius=1e-9)])
    assert found.solved
    assert found.residual < 1e-9
    shot = simulate(POOL, PLACES, found.velocity)
    assert np.hypot(*(shot.positions[0] - (0.5, -0.3))) == found.residual
    assert shot.potted.tolist() == [False, True]
    pocket = POOL.table.pockets[3]
    assert shot.positions[1].tolist() == [pocket.x, pocket.y]
    np.testing.assert_array_equal(found.shot.positions, shot.positions)


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_where_a_pot_leaves_the_cue_ball_aim_leaves_it_too(seed):
    rng = np.random.default_rng(seed)
    places = layouts.draw("random", POOL, rng)
    begin = aim(POOL, places, Pot(1))
    if not begin.solved:
        return
    goal = Leave(tuple(begin.shot.positions[0].tolist()))
    found = aim(POOL, places, [Pot(1), goal])
    assert found.solved
    assert found.residual < 1e-9


def test_the_alternatives_reach_the_goals_and_have_smaller_margins():
    found = aim(POOL, PLACES, Pot(1, 3))
    assert len(found.alternatives) > 3
    best = found.shot.margins().pockets[1, 3]
    for velocity in found.alternatives:
        shot = simulate(POOL, PLACES, velocity, record=True)
        assert shot.potted.tolist() == [False, True]
        assert 0 < shot.margins().pockets[1, 3] <= best


@pytest.mark.parametrize("seed", range(4))
def test_a_three_cushion_carom(seed):
    places = layouts.draw("random", CAROM, np.random.default_rng(seed))
    found = aim(CAROM, places, [FirstTouch(1), Cushions(3, before=2), Touch(2)], max_speed=6.0)
    assert found.solved
    assert found.shot.first_hit == 1
    assert found.shot.cushions_before_hit[2] >= 3


def test_margins_lead_from_a_miss_to_a_touch(monkeypatch):
    """Without a shot that touches both balls among the first ones, Gauss-Newton steps on the margins find one."""
    monkeypatch.setattr("billiards_env.players.aim._starts", lambda *_: iter([np.array([[3.0, 0.65]])]))
    places = [[-0.6, 0.0], [0.2, 0.15], [0.9, 0.1]]
    goals = [FirstTouch(1), Touch(2)]
    miss = simulate(CAROM, places, [3.0, 0.65])
    assert not (miss.cushions_before_hit[1:] >= 0).all()
    assert aim(CAROM, places, goals).solved


def test_an_unreachable_goal_gives_the_nearest_shot():
    scene = Scene.named("pool", 1)
    found = aim(scene, PLACES, [Pot(1, 3), Leave((0.635, 0.3))], max_speed=0.2, shots=500)
    assert not found.solved
    assert len(found.alternatives) == 0


def test_a_ball_that_is_not_in_play_is_not_touched():
    scene = Scene.named("pool", 2)
    places = [*PLACES, [0.0, 0.15]]  # on the way to ball 1
    found = aim(scene, places, [FirstTouch(1), Pot(1, 3)], in_play=[True, True, False])
    assert found.solved
    assert np.hypot(*np.array(found.shot.at(0.0)[2])) > 0


def test_equal_arguments_give_equal_bits():
    goals = [Pot(1, 0), Leave((0.2, 0.1))]
    first, second = (aim(POOL, PLACES, goals, seed=4, shots=2_000) for _ in range(2))
    np.testing.assert_array_equal(first.velocity, second.velocity)
    np.testing.assert_array_equal(first.alternatives, second.alternatives)


@pytest.mark.parametrize(
    ("goals", "text"),
    [
        ([], r"goals = \[\]: expected goals"),
        ([3], r"goals = \[3\]: expected goals"),
        (Pot(2), r"Pot.ball = 2: expected 1"),
        (Pot(1, 6), r"Pot.pocket = 6: expected a whole number from 0 to 5"),
        ([Cushions(3, before=5)], r"Cushions.before = 5: expected"),
        (Leave((np.nan, 0.0)), r"Leave.position = \[nan, 0.0\]: expected"),
        (Touch(0), r"Touch.ball = 0: expected 1"),
    ],
)
def test_wrong_goals_are_errors(goals, text):
    with pytest.raises(ValueError, match=text):
        aim(POOL, PLACES, goals)
