"""The probability of a run-out: the same in a mirror, less with more balls, and positive without a pot."""

import numpy as np

from billiards_env.games import custom_opening
from billiards_env.games.game_state import ANYWHERE
from billiards_env.games.referee import legal_balls
from billiards_env.players import run_outs
from billiards_env.players.batch import unplayed
from billiards_env.players.planner import plan
from billiards_env.players.values import Values
from tests.helpers.games import setup

NOISE = (np.radians(0.125), 0.075)
EASY = [[0.6, 0.1], [1.07, 0.435]]  # a ball hangs in a pocket


def chance(places, on_table, noise=NOISE, rules="nine_ball", english=True, **state):
    """Returns the inputs and the probability of a run-out from a position; balls without a place lie in a corner."""
    game = setup(rules)
    positions = np.array([[-1.1 + 0.06 * (k % 4), -0.5 + 0.06 * (k // 4)] for k in range(game.scene.n_balls)])
    for ball, place in places.items():
        positions[ball] = place
    table = custom_opening(game, positions, {"on_table": [0, *on_table], **state})
    here = unplayed(table)
    values = Values(game, table, 8.0, noise, run_out=True, english=english)
    inputs = values.inputs(here, legal_balls(rules, here.states, np.zeros(1, int)), np.ones(1, bool))
    return inputs[0], run_outs.chances(run_outs.trained(), inputs)[0]


def test_a_mirrored_table_has_the_same_inputs():
    balls = {0: [0.31, -0.12], 7: [0.5, 0.25], 8: [0.2, -0.4], 9: [0.8, -0.1]}
    first, _ = chance(balls, [7, 8, 9])
    for signs in ([-1, 1], [1, -1]):
        mirrored, _ = chance({ball: np.multiply(place, signs) for ball, place in balls.items()}, [7, 8, 9])
        np.testing.assert_allclose(mirrored, first, atol=1e-6)


def test_an_easy_pot_few_balls_and_small_errors_make_a_run_out_likely():
    last = {0: EASY[0], 9: EASY[1]}
    _, sure = chance(last, [9])
    assert sure > 0.95
    three = {0: EASY[0], 7: EASY[1], 8: [-0.6, 0.3], 9: [0.2, -0.4]}
    assert chance(three, [7, 8, 9])[1] < sure
    assert chance(three, [7, 8, 9])[1] < chance(three, [7, 8, 9], (np.radians(0.03), 0.0))[1]
    assert chance(three, [7, 8, 9], (np.radians(0.5), 0.075))[1] < 0.8 * chance(three, [7, 8, 9])[1]


def test_a_position_without_a_pot_is_worse_but_not_lost():
    behind = {0: [0.0, 0.0], 9: [1.2, 0.0], 8: [0.062, 0.0]}  # ball 8 hides ball 7
    _, snookered = chance({**behind, 7: [0.4, 0.0]}, [7, 8, 9])
    _, free = chance({**behind, 7: [-0.4, 0.1]}, [7, 8, 9])
    assert 0.02 < snookered < 0.8 * free


def test_in_eight_ball_only_the_group_and_the_eight_ball_are_left():
    balls = {0: [0.31, -0.12], 1: [0.5, 0.25], 2: [0.2, -0.4]}
    others = [1, 2, 8, *range(9, 16)]
    inputs, _ = chance(balls, others, rules="eight_ball", solids=0)
    opened, _ = chance(balls, others, rules="eight_ball")
    left, legal = 8, 10
    assert (inputs[left], inputs[legal]) == (3.0, 2.0)
    assert (opened[left], opened[legal]) == (8.0, 9.0)


def test_the_weights_are_small_and_are_loaded_where_they_are_used():
    assert run_outs.WEIGHTS.stat().st_size < 20_000
    run_outs.trained.cache_clear()
    straight, nine = setup("straight", 2), setup("nine_ball")
    places = [*EASY, [-0.5, 0.0], *([-1.1, 0.06 * k - 0.25] for k in range(7))]
    for game, shots, loads in ((straight, 2000, 0), (nine, 1000, 0), (nine, 2000, 1)):
        table = custom_opening(game, places[: game.scene.n_balls])
        plan(game, table, 6.0, np.random.default_rng(0), np.inf, shots)
        assert run_outs.trained.cache_info().misses == loads


def test_a_ball_in_hand_is_an_easy_pot():
    game = setup("nine_ball")
    table = custom_opening(game, [[0.0, 0.0], *([-1.1, 0.06 * k - 0.25] for k in range(9))], {"on_table": [0, 8, 9]})
    here = unplayed(table)
    lost = here._replace(states=here.states.copy())
    lost.states["in_hand"], lost.states["player"] = ANYWHERE, 1
    values = Values(game, table, 8.0, NOISE, weights=run_outs.trained())
    assert values.of(lost)[0] < -0.5
    assert values.of(lost)[0] < -values.of(here)[0]
