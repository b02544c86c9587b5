import math
from collections import Counter

import numpy as np
import pytest

from billiards_env.engine import PIC, Engine
from billiards_env.games import GAMES, Call, Stroke, custom_opening, opening, play, to_dict
from billiards_env.games.game_state import in_play, is_in
from billiards_env.scene import check_positions, layouts
from billiards_env.scene.layouts import PLACING_GAP, draw
from tests.helpers.games import in_a_row, random_game, setup, words

PIT = Engine("pit", 1 / 240)
TARGETS = {"carom": 2, "snooker": 40}  # scores that random players reach
NINE, EIGHT, STRAIGHT = setup("nine_ball"), setup("eight_ball"), setup("straight", target=50, call_shot=True)
PLACES = in_a_row(10)


# Openings.


@pytest.mark.parametrize("settings", [NINE, EIGHT])
def test_the_rack_of_a_game_is_that_of_its_layout(settings):
    racked = opening(settings, np.random.default_rng(7), "rack").positions
    assert racked.tobytes() == draw(settings.rules, settings.scene, np.random.default_rng(7)).tobytes()
    tight = opening(settings, np.random.default_rng(7), "tight_rack").positions[settings.game_rules.deciding_ball]
    assert tight == pytest.approx([0.635 + 2 * math.sqrt(3) * settings.scene.balls.radius[0], 0.0])


@pytest.mark.parametrize(("rules", "layout"), [(name, layout) for name in GAMES for layout in GAMES[name].layouts])
def test_openings(rules, layout):
    settings = setup(rules)
    game, again = (opening(settings, np.random.default_rng(3), layout) for _ in range(2))
    assert (game.positions.tobytes(), words(game.state)) == (again.positions.tobytes(), words(again.state))
    assert game.state.break_shot == (layout != "random")
    assert words(game.state).in_hand == ("behind" if settings.game_rules.pockets and layout != "random" else "no")
    usual = opening(settings, np.random.default_rng(3)).positions
    assert (usual.tobytes() == game.positions.tobytes()) == (layout == settings.game_rules.layouts[0])


def test_custom_openings():
    game = custom_opening(NINE, PLACES)
    assert (game.state.break_shot, game.state.in_hand, game.state.player) == (False, 0, 0)
    both = PLACES.copy()
    both[2] = both[1]  # ball 2 is not in play, so the overlap is allowed
    assert words(custom_opening(NINE, both, {"on_table": [0, 1, 9]}).state).on_table == (0, 1, 9)


def test_targets():
    assert STRAIGHT.target == 50
    assert setup("straight").target == 0
    assert setup("carom").target == 10
    assert setup("carom", target=0).target == 0
    assert NINE.target is None
    assert opening(setup("carom", target=7), np.random.default_rng(0)).state.target == 7


def test_no_shot_is_allowed_after_the_end():
    history, log = random_game(NINE, 1)
    assert log[-1].game.state.over
    with pytest.raises(ValueError, match="the game is over"):
        play(NINE, log[-1].game, history.strokes[0])


# Shots on the table.


def test_after_a_scratch_the_cue_ball_is_in_hand():
    settings = setup("straight", 2)
    played = play(settings, custom_opening(settings, in_a_row(3, {0: (0.97, 0.335)})), Stroke((1.0, 1.0)))
    state = words(played.game.state)
    assert (words(played.verdict).foul, state.in_hand, state.scores) == ("scratch", "behind", (-1, 0))
    after = play(settings, played.game, Stroke((0.5, 0.0), (-0.7, 0.2)))
    assert after.shot.at(0.0)[0].tolist() == [-0.7, 0.2]


def test_a_blocked_point_is_replaced_by_the_nearest_free_point():
    game = custom_opening(NINE, PLACES, {"in_hand": "anywhere"})
    wish = tuple((PLACES[5] + [0.0, 0.01]).tolist())
    start = play(NINE, game, Stroke((0.0, -1.0), wish)).shot.at(0.0)
    assert start[0] == pytest.approx(PLACES[5] + [0.0, 2 * NINE.scene.balls.radius[0] + PLACING_GAP])


def test_straight_pool_a_rack_on_the_table():
    places = in_a_row(16, {0: (0.97, 0.335), 3: (1.07, 0.435), 8: (0.2, -0.4)})
    game = custom_opening(STRAIGHT, places, {"on_table": [0, 3, 8], "scores": [14, 2]})
    played = play(STRAIGHT, game, Stroke((1.0, 0.99), call=Call(3, 3)))
    assert (played.pots, words(played.verdict).rack) == (((3, 3),), "rest")
    state = words(played.game.state)
    assert (state.player, state.scores, len(state.on_table), state.break_shot) == (0, (15, 2), 16, False)
    assert played.game.positions[8].tolist() == [0.2, -0.4]


def test_straight_pool_three_fouls_on_the_table():
    game = opening(STRAIGHT, np.random.default_rng(0), "random")
    for k in range(5):  # both players miss all balls; the first one commits the third foul
        played = play(STRAIGHT, game, Stroke((0.0, 0.0)))
        game = played.game
        assert (words(played.verdict).foul, game.state.player) == ("no_hit", (k + 1) % 2 if k < 4 else 0)
    state = words(game.state)
    assert (state.break_shot, state.in_hand, state.scores) == (True, "behind", (-18, -2))
    assert game.positions[1:].tolist() == layouts.layout_plan("tight_rack", STRAIGHT.scene).spots[1:].tolist()


# Whole games.


@pytest.mark.parametrize(("rules", "engine"), [*((rules, PIC) for rules in GAMES), ("nine_ball", PIT), ("carom", PIT)])
def test_random_games_end_and_keep_all_balls(rules, engine):
    ended = 0
    for seed in range(3):
        settings = setup(rules, engine=engine, **({"target": TARGETS[rules]} if rules in TARGETS else {}))
        history, log = random_game(settings, seed)
        down = Counter()
        game = history.opening
        for played in log:
            state, verdict = played.game.state, words(played.verdict)
            down.update(words(played.facts).potted)
            down.subtract(verdict.spotted)
            lying = tuple(ball for ball in range(settings.scene.n_balls) if down[ball] == 0)
            assert words(state).on_table == lying
            assert not game.state.over
            if not state.over:  # a game can begin from each of its states
                given = {name: to_dict(state)[name] for name in settings.game_rules.given}
                assert custom_opening(settings, played.game.positions, given).state == state
            assert sum(state.scores) == sum(game.state.scores) + verdict.points + verdict.penalty
            assert (state.player == game.state.player) == verdict.continues
            if engine == PIC:
                lying = is_in(in_play(state), settings.scene.n_balls)
                check_positions(settings.scene, played.game.positions, in_play=lying)
            game = played.game
        if rules == "straight":
            penalties = sum(min(played.verdict.points, 0) for played in log)
            assert sum(game.state.scores) - penalties == 16 - len(words(game.state).on_table)
        ended += game.state.over
    assert ended or rules == "three_cushion"


def test_play_does_not_change_earlier_states():
    game = opening(NINE, np.random.default_rng(0))
    before = game.positions.copy()
    play(NINE, game, Stroke((5.0, 0.1), (-0.8, 0.0)))
    assert game.positions.tobytes() == before.tobytes()
