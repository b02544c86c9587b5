import math
from collections import Counter

import numpy as np
import pytest

from billiards_env.engine import PIC, Engine
from billiards_env.games import GAMES, Call, Setup, Stroke, custom_opening, opening, play, to_dict
from billiards_env.games.game_state import in_play, is_in
from billiards_env.scene import Scene, check_positions
from billiards_env.scene.layouts import PLACING_GAP, draw
from tests.helpers.games import in_a_row, judge, random_game, setup, state, words

PIT = Engine("pit", 1 / 240)
REACHED = {"carom": {"target": 2, "innings": 9}, "snooker": {"target": 40}}  # scores that random players reach
NINE, STRAIGHT = setup("nine_ball"), setup("straight", target=50, call_shot=True)
PLACES = in_a_row(10)


# Openings.


RACKS = [
    # the game, the layout of its rack, and the rows of some balls, counted from the foot spot
    (setup("eight_ball"), "eight_ball", {8: 2}),
    (NINE, "nine_ball", {1: 0, 9: 2}),
    (setup("nine_ball", edition="2025"), "nine_ball_2025", {1: -2, 9: 0}),  # WPA 2025 5.2
]


@pytest.mark.parametrize(("settings", "layout", "rows"), RACKS)
def test_the_rack_of_a_game_is_that_of_its_layout(settings, layout, rows):
    racked = opening(settings, np.random.default_rng(7), "rack").positions
    assert racked.tobytes() == draw(layout, settings.scene, np.random.default_rng(7)).tobytes()
    tight = opening(settings, np.random.default_rng(7), "tight_rack").positions
    foot, step = settings.scene.table.foot_x, math.sqrt(3) * settings.scene.balls.radius[0]
    for ball, row in rows.items():
        assert tight[ball] == pytest.approx([foot + row * step, 0.0])


@pytest.mark.parametrize(("rules", "layout"), [(name, layout) for name in GAMES for layout in GAMES[name].layouts])
def test_openings(rules, layout):
    settings = setup(rules)
    game, again = (opening(settings, np.random.default_rng(3), layout) for _ in range(2))
    assert (game.positions.tobytes(), words(game.state)) == (again.positions.tobytes(), words(again.state))
    assert game.state.break_shot == (layout != "random")
    assert words(game.state).in_hand == ("behind" if settings.game_rules.pockets and layout != "random" else "no")
    usual = opening(settings, np.random.default_rng(3)).positions
    assert (usual.tobytes() == game.positions.tobytes()) == (layout == settings.game_rules.layouts[0])


def test_in_2025_ten_ball_has_no_safety():  # WPA 2025 6.5
    for edition, kinds in (("2016", ("shot", "safety")), ("2025", ("shot",))):
        game = setup("ten_ball", call_shot=True, edition=edition)
        assert game.kinds(opening(game, np.random.default_rng(0)).state) == kinds
        assert setup("eight_ball", call_shot=True, edition=edition).has_safety


def test_blackball_begins_on_its_usual_table_with_the_black_ball_in_the_middle():
    assert abs(opening(Setup("blackball", Scene.named("uk_pool")), np.random.default_rng(0)).positions[8, 1]) < 1e-3


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
    assert [setup("one_pocket", balls).target for balls in (3, 9, 15)] == [2, 5, 8]
    assert [setup("bank_pool", balls).target for balls in (9, 15)] == [5, 8]
    assert opening(setup("carom", target=7), np.random.default_rng(0)).state.target == 7


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


IN_FOOT_CORNERS = [(0, 1, 0, 1), (1, 1, 1, 0), (0, -1, 1, 0), (1, -1, 0, 1)]


@pytest.mark.parametrize(("player", "side", "points", "penalty"), IN_FOOT_CORNERS)
def test_one_pocket_a_shot_scores_in_the_pocket_of_its_player(player, side, points, penalty):
    """The ball is potted in pocket 3, or in the mirrored layout in pocket 2."""
    settings, places = setup("one_pocket", 3), in_a_row(4, {0: (0.97, 0.335), 1: (1.07, 0.435)})
    game = custom_opening(settings, places * (1, side), {"player": player})
    played = play(settings, game, Stroke((0.7, 0.7 * side)))
    verdict = played.verdict
    assert played.pots == ((1, 3 if side > 0 else 2),)
    assert (verdict.points, verdict.penalty, verdict.continues) == (points, penalty, points > 0)


def test_carom_the_equalising_inning_begins_at_the_starting_position():  # UMB, art. 29
    settings = setup("carom", target=2, innings=5)
    game = custom_opening(settings, [[-0.5, 0.0], [0.5, 0.05], [0.9, 0.02]], {"scores": [1, 0]})
    after = play(settings, game, Stroke((3.0, 0.24))).game
    state = words(after.state)
    assert (state.scores, state.player, state.over, settings.legal(after.state)) == ((2, 0), 1, False, (1,))
    given = {name: to_dict(after.state)[name] for name in settings.game_rules.given}
    assert custom_opening(settings, after.positions, given).state == after.state


def test_a_foul_of_blackball_gives_one_free_shot_and_then_the_visit():
    """The second player fouls, the first one misses in the free shot and in the visit."""
    settings = setup("blackball")
    game = custom_opening(settings, in_a_row(16, {0: (0.0, 0.3), 9: (0.5, 0.3)}), {"player": 1, "solids": 0})
    turns = []
    for velocity in ((-0.1, 0.0), (2.0, 0.0), (-0.1, 0.0)):
        game = play(settings, game, Stroke(velocity)).game
        turns.append((int(game.state.player), bool(game.state.free_ball)))
    assert turns == [(0, True), (0, False), (1, True)]


# New racks by a call: the game, the call, the state before it, and the ball on the foot spot, the player and the scores
# after it.

NEW_RACKS = [
    ("eight_ball", "rerack", {}, 11, 1, (0, 0)),
    ("eight_ball", "break_again", {}, 11, 0, (0, 0)),
    ("straight", "break_again", {"scores": [-2, 0], "fouls": [0, 2]}, 1, 0, (-2, 0)),
    ("nine_ball", "stalemate", {"breaker": 1, "fouls": [2, 1]}, 1, 1, (0, 0)),  # WPA 1.12
    ("snooker", "stalemate", {"scores": [20, 30], "breaker": 0}, 20, 0, (0, 0)),  # WPBSA 3.16: all points are lost
]


@pytest.mark.parametrize(("rules", "kind", "fields", "on_foot", "player", "scores"), NEW_RACKS)
def test_a_call_for_a_new_rack(rules, kind, fields, on_foot, player, scores):
    settings = setup(rules)
    n, start = settings.scene.n_balls, opening(settings, np.random.default_rng(0), "random")
    fields = {"player": 1, "choices": [kind], "on_table": [0, *range(3, n)], **fields}
    game = custom_opening(settings, start.positions, fields)
    after = play(settings, game, Stroke((0.0, 0.0), call=Call(kind=kind))).game
    now = words(after.state)
    assert (now.player, now.break_shot, now.in_hand, now.choices) == (player, True, "behind", ())
    assert (now.object_balls, now.idle, now.scores) == (tuple(range(1, n)), 0, scores)
    assert now.fouls == ((0, 0) if kind == "stalemate" else tuple(fields.get("fouls", (0, 0))))
    assert after.positions[on_foot].tolist() == [settings.scene.table.foot_x, 0.0]


def test_a_stalemate_may_be_called_after_six_turns_without_progress():  # WPA 1.12
    for idle, offered in ((10, False), (11, True)):
        game = custom_opening(NINE, in_a_row(10, {0: (0.5, 0.4), 1: (0.9, 0.4)}), {"idle": idle})
        state = play(NINE, game, Stroke((2.0, 0.02))).game.state
        assert (state.idle, "stalemate" in words(state).choices) == (idle + 1, offered)


def test_the_player_of_the_opening_break_is_the_breaker():  # who breaks again after a stalemate, WPA 1.12
    start = opening(NINE, np.random.default_rng(0)).positions
    broken = play(NINE, custom_opening(NINE, start, {"player": 1, "break_shot": True}), Stroke((6.0, 0.1))).game
    assert (words(broken.state).breaker, words(broken.state).break_shot) == (1, False)
    game = custom_opening(NINE, in_a_row(10, {0: (0.5, 0.4), 1: (0.9, 0.4)}), {"player": 0, "breaker": 1})
    assert play(NINE, game, Stroke((2.0, 0.02))).game.state.breaker == 1


# Whole games.


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("rules", ["one_pocket", "bank_pool"])
def test_the_balls_off_the_table_are_the_points_above_zero(rules, seed):
    rng, now = np.random.default_rng(seed), state(rules, target=8)
    for _ in range(200):
        if now.over:
            break
        lying = rng.permutation(words(now).object_balls).tolist()
        cushion = [f"cushion {lying[0]}"] * (rng.random() < 0.7)
        pots = [f"pocket {ball} {rng.integers(6)}" for ball in lying[: rng.integers(3)]]
        scratch = ["pocket 0"] * (rng.random() < 0.2)
        now, found = judge(rules, now, ", ".join((f"hit 0 {lying[0]}", *cushion, *pots, *scratch)))
        assert len(found["object_balls"]) == 15 - sum(max(score, 0) for score in found["scores"])
    assert now.over
    assert max(*now.scores, *(now.fouls + 5)) >= 8


@pytest.mark.parametrize(("rules", "engine"), [*((rules, PIC) for rules in GAMES), ("nine_ball", PIT), ("carom", PIT)])
def test_random_games_end_and_keep_all_balls(rules, engine):
    ended = 0
    for seed in range(3):
        settings = setup(rules, engine=engine, **REACHED.get(rules, {}))
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
