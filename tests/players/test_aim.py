"""`aim` reaches its goals exactly, and its answers are shots that reach them."""

import numpy as np
import pytest

from billiards_env import Scene, derivatives, simulate
from billiards_env.engine.strikes import strike_with
from billiards_env.games import opening
from billiards_env.players.aim import Bank, Cushions, FirstTouch, Leave, Pot, Touch, aim
from billiards_env.scene import layouts
from tests.helpers.games import setup

POOL, CAROM = Scene.named("pool", 1), Scene.named("carom", 2)
PLACES = [[-0.6, 0.0], [0.6, 0.3]]
POCKET = POOL.table.pockets[3].x, POOL.table.pockets[3].y


def test_pot_and_position_are_exact():
    aimed = aim(POOL, PLACES, [Pot(1, 3), Leave((0.5, -0.3), radius=1e-9)])
    assert aimed.solved
    assert aimed.residual < 1e-9
    shot = simulate(POOL, PLACES, aimed.velocity)
    assert np.hypot(*(shot.positions[0] - (0.5, -0.3))) == aimed.residual
    assert shot.potted.tolist() == [False, True]
    pocket = POOL.table.pockets[3]
    assert shot.positions[1].tolist() == [pocket.x, pocket.y]
    np.testing.assert_array_equal(aimed.shot.positions, shot.positions)


def test_the_alternatives_reach_the_goals_and_have_smaller_margins():
    aimed = aim(POOL, PLACES, Pot(1, 3))
    assert len(aimed.alternatives) > 3
    best = derivatives.margins(aimed.shot).pockets[1, 3]
    for velocity in aimed.alternatives:
        shot = simulate(POOL, PLACES, velocity, record=True)
        assert shot.potted.tolist() == [False, True]
        assert 0 < derivatives.margins(shot).pockets[1, 3] <= best


@pytest.mark.parametrize("seed", range(4))
def test_a_three_cushion_carom(seed):
    places = layouts.draw("random", CAROM, np.random.default_rng(seed))
    aimed = aim(CAROM, places, [FirstTouch(1), Cushions(3, before=2), Touch(2)], max_speed=6.0)
    assert aimed.solved
    assert aimed.shot.first_hit == 1
    assert aimed.shot.cushions_before_hit[2] >= 3


def test_margins_lead_from_a_miss_to_a_touch(monkeypatch):
    """Without a shot that touches both balls among the first ones, Gauss-Newton steps on the margins find one."""
    monkeypatch.setattr("billiards_env.players.aim._starts", lambda *_: iter([np.array([[3.0, 0.65]])]))
    places = [[-0.6, 0.0], [0.2, 0.15], [0.9, 0.1]]
    goals = [FirstTouch(1), Touch(2)]
    miss = simulate(CAROM, places, [3.0, 0.65])
    assert not (miss.cushions_before_hit[1:] >= 0).all()
    assert aim(CAROM, places, goals).solved


def test_a_cue_drives_a_ball_that_it_touches_in_the_shot_that_is_solved():
    """The same goals need another velocity without a cue, where the first impact is an ordinary one."""
    places = np.array([[0.6, 0.15], [0.6, 0.15]])
    to = np.array(POCKET) - places[0]
    places[1] += 2 * POOL.balls.radius[0] * to / np.hypot(*to)
    goals, aimed = [Pot(1, 3), Leave((0.9, -0.1), radius=0.005)], {}
    for strike in (True, False):
        aimed[strike] = aim(POOL, places, goals, strike=strike)
        assert aimed[strike].solved
        for velocity in (aimed[strike].velocity, *aimed[strike].alternatives):
            shot = simulate(POOL, places, strike_with(velocity) if strike else velocity)
            assert shot.potted.tolist() == [False, True]
            assert np.hypot(*(shot.positions[0] - goals[1].position)) <= 0.005
        again = simulate(POOL, places, aimed[strike].stroke)
        assert np.array_equal(again.positions, aimed[strike].shot.positions)
        assert aimed[strike].residual == np.hypot(*(aimed[strike].shot.positions[0] - goals[1].position))
    other = simulate(POOL, places, strike_with(aimed[False].velocity))
    assert np.hypot(*(other.positions[0] - goals[1].position)) > 0.1


def test_a_bank_is_aimed_off_a_cushion():
    for goal, cushions in ((Pot(1), 0), (Bank(1), 1), (Bank(1, 4), 1)):
        aimed = aim(POOL, [[-0.6, 0.0], [0.6, 0.3]], goal)
        assert aimed.solved
        assert aimed.shot.potted.tolist() == [False, True]
        assert aimed.shot.cushions[1] == cushions


def test_an_unreachable_goal_gives_the_nearest_shot():
    scene = Scene.named("pool", 1)
    aimed = aim(scene, PLACES, [Pot(1, 3), Leave((0.635, 0.3))], max_speed=0.2, shots=500)
    assert not aimed.solved
    assert len(aimed.alternatives) == 0


def test_a_ball_that_is_not_in_play_is_not_touched():
    scene = Scene.named("pool", 2)
    places = [*PLACES, [0.0, 0.15]]  # on the way to ball 1
    aimed = aim(scene, places, [FirstTouch(1), Pot(1, 3)], in_play=[True, True, False])
    assert aimed.solved
    assert np.hypot(*np.array(aimed.shot.at(0.0)[2])) > 0


@pytest.mark.parametrize("goal", [Pot(1), Touch(1), FirstTouch(1), Leave((0.0, 0.0), ball=1), Cushions(1, before=1)])
def test_a_ball_of_a_goal_has_to_be_in_play(goal):
    with pytest.raises(ValueError, match=r" = 1: expected a ball in play"):
        aim(POOL, PLACES, goal, in_play=[True, False])
    for in_play in ([False, True], [True], [1, 1]):
        with pytest.raises(ValueError, match=r"in_play = .*: expected \(2,\) bool, with the cue ball in play"):
            aim(POOL, PLACES, goal, in_play=in_play)


def test_a_scene_with_flights_is_refused(monkeypatch):
    monkeypatch.delattr("billiards_env.players.aim.simulate_batch")  # no shot runs
    with pytest.raises(ValueError, match=r"physics\.flight = True with aim: expected False or the player 'search' \("):
        aim(Scene.named("jump_pool"), PLACES, Pot(1))


def test_a_ball_of_a_rack_is_aimed_at():
    """The derivatives of some of these shots overflow."""
    game = setup("eight_ball")
    places = opening(game, np.random.default_rng(101)).positions
    aimed = aim(game.scene, places, [FirstTouch(8), Pot(8)], max_speed=6.0, shots=100)
    assert not aimed.solved
    assert np.isfinite(aimed.velocity).all()


@pytest.mark.parametrize("radius", [0.01, 1e-9])
def test_the_search_goes_on_until_the_ball_is_within_the_radius(radius, monkeypatch):
    def rounds(*_):
        monkeypatch.setattr("billiards_env.players.aim._STEPS", 0)  # this round ends a few millimetres from the point
        yield np.array([[3.404, 0.815]])
        monkeypatch.setattr("billiards_env.players.aim._STEPS", 8)
        yield np.array([[3.4, 0.81]])

    monkeypatch.setattr("billiards_env.players.aim._starts", rounds)
    aimed = aim(POOL, PLACES, [Pot(1, 3), Leave((0.5, -0.3), radius)])
    assert aimed.solved
    assert radius / 10 < aimed.residual < radius or aimed.residual < radius < 1e-8


@pytest.mark.parametrize(("radius", "usually"), [(0.01, True), (0.1, False)])
def test_the_residual_is_usually_exact_with_the_default_radius(radius, usually):
    residuals = []
    for seed in range(25):
        rng = np.random.default_rng(seed)
        places, (x, y) = layouts.draw("random", POOL, rng), layouts.draw("random", POOL, rng)[0]
        aimed = aim(POOL, places, [Pot(1), Leave((float(x), float(y)), radius)], shots=3000)
        if aimed.solved:
            residuals.append(aimed.residual)
    assert len(residuals) >= 8
    assert max(residuals) <= radius
    assert (np.mean(np.array(residuals) < 1e-9) > 0.5) == usually


def test_equal_arguments_give_equal_bits():
    goals = [Pot(1, 0), Leave((0.2, 0.1))]
    first, second = (aim(POOL, PLACES, goals, seed=4, shots=2_000) for _ in range(2))
    np.testing.assert_array_equal(first.velocity, second.velocity)
    np.testing.assert_array_equal(first.alternatives, second.alternatives)


WRONG_GOALS = [
    ([], r"goals = \[\]: expected goals"),
    (Pot(2), r"Pot.ball = 2: expected 1"),
    (Pot(1, 6), r"Pot.pocket = 6: expected a whole number from 0 to 5"),
    ([Cushions(3, before=5)], r"Cushions.before = 5: expected"),
    (Leave((np.nan, 0.0)), r"Leave.position = \[nan, 0.0\]: expected"),
    (Leave((0.0, 0.0), radius=-0.1), r"Leave.radius = -0.1: expected a number from 0 to 10000 m"),
    ([Cushions(-1)], r"Cushions.least = -1: expected a whole number >= 0"),
    (Touch(0), r"Touch.ball = 0: expected 1"),
]


@pytest.mark.parametrize(("goals", "text"), WRONG_GOALS)
def test_wrong_goals_are_errors(goals, text):
    with pytest.raises(ValueError, match=text):
        aim(POOL, PLACES, goals)
