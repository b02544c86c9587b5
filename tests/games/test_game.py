import math
from collections import Counter

import numpy as np
import pytest

from billiards_env import Scene
from billiards_env.games import RULES, Call, History, Setup, Stroke, Verdict, batch, custom_opening, opening, play
from billiards_env.games.judging import Rules
from billiards_env.rules import GAMES
from billiards_env.rules.pool import any_ball
from billiards_env.scene import check_positions, layouts
from billiards_env.scene.layouts import MARGIN, draw
from tests.helpers.games import in_a_row, setup

PIT = {"mode": "pit", "dt": 1 / 240}
TARGETS = {"carom": 2, "snooker": 40}  # scores that random players reach
TRIANGLE = Scene.from_dict(
    {
        "balls": {"radius": [0.03, 0.03], "mass": [0.2, 0.2]},
        "table": {
            "length": 2.0,
            "width": 1.0,
            "outline": [{"x": -1, "y": -0.5}, {"x": 1, "y": -0.5}, {"x": 0, "y": 0.5}],
            "pockets": [{"x": 0, "y": 0.5, "radius": 0.1}],
        },
    }
)


NINE, EIGHT, STRAIGHT = setup("nine_ball"), setup("eight_ball"), setup("straight", target=50, call_shot=True)
PLACES = in_a_row(10)


def random_game(settings, seed, shots=400):
    rng = np.random.default_rng(seed)
    game = opening(settings, rng)
    start, strokes, log = game, [], []
    while len(strokes) < shots and not game.state.over:
        velocity = 12 * rng.random(2) - 6
        place = None if game.state.in_hand == "no" else tuple((3 * rng.random(2) - 1.5).tolist())
        strokes.append(Stroke(tuple(velocity.tolist()), place))
        log.append(play(settings, game, strokes[-1]))
        game = log[-1].game
    return History(settings, start, tuple(strokes)), log


# Openings.


@pytest.mark.parametrize("settings", [NINE, EIGHT])
def test_the_rack_of_a_game_is_that_of_its_layout(settings):
    racked = opening(settings, np.random.default_rng(7), "rack").positions
    assert racked.tobytes() == draw(settings.rules, settings.scene, np.random.default_rng(7)).tobytes()
    tight = opening(settings, np.random.default_rng(7), "tight_rack").positions[settings.game_rules.deciding_ball]
    assert tight == pytest.approx([0.635 + 2 * math.sqrt(3) * settings.scene.balls.radius[0], 0.0])


def test_a_game_is_one_entry_of_games_and_one_of_racks(monkeypatch):
    """Nine ball with ten balls, in which any ball may be called, but only the lowest touched first."""
    game = GAMES["nine_ball"]._replace(name="ten_ball", n_object_balls=(10, 10), call_kernel=any_ball, deciding_ball=10)
    monkeypatch.setitem(GAMES, "ten_ball", game)
    monkeypatch.setitem(RULES, "ten_ball", Rules(*game))
    monkeypatch.setitem(layouts.RACKS, "ten_ball", layouts.Rack((1, 2, 3, 4, 10, 6, 7, 8, 9, 5), fixed=(1, 10)))
    monkeypatch.setattr(batch, "judge_shots", lambda name, states, facts, calls: calls)
    ten = Setup("ten_ball", Scene.named("pool", 10), call_shot=True)
    first, second = (opening(ten, np.random.default_rng(seed), "tight_rack").positions for seed in (0, 3))
    assert first[10] == pytest.approx([0.635 + 2 * math.sqrt(3) * ten.scene.balls.radius[0], 0.0])
    assert (first[[1, 10]].tolist(), first[1, 0]) == (second[[1, 10]].tolist(), 0.635)
    assert sorted(first[2:10].tolist()) == sorted(second[2:10].tolist()) != first[2:10].tolist()
    game = custom_opening(ten, in_a_row(11, {0: (0.97, 0.335), 4: (1.07, 0.435)}))
    facts = play(ten, game, Stroke((0.7, 0.7))).facts
    assert (facts.potted, batch.best_call(ten.game_rules, game.state, facts)) == ((4,), Call(4, 3))
    (call,) = batch.judge_batch(ten, game, [[0.7, 0.7]])
    assert (call["ball"], call["made"]) == (4, True)


@pytest.mark.parametrize(("rules", "layout"), [(name, layout) for name in RULES for layout in RULES[name].layouts])
def test_openings(rules, layout):
    settings = setup(rules)
    game, again = (opening(settings, np.random.default_rng(3), layout) for _ in range(2))
    assert (game.positions.tobytes(), game.state) == (again.positions.tobytes(), again.state)
    assert game.state.break_shot == (layout != "random")
    assert game.state.in_hand == ("behind" if settings.game_rules.pockets and layout != "random" else "no")
    usual = opening(settings, np.random.default_rng(3)).positions
    assert (usual.tobytes() == game.positions.tobytes()) == (layout == settings.game_rules.layouts[0])


def test_custom_openings():
    game = custom_opening(NINE, PLACES)
    assert (game.state.break_shot, game.state.in_hand, game.state.player) == (False, "no", 0)
    both = PLACES.copy()
    both[2] = both[1]  # ball 2 is not in play, so the overlap is allowed
    assert custom_opening(NINE, both, {"on_table": [0, 1, 9]}).state.on_table == {0, 1, 9}
    with pytest.raises(ValueError, match="balls 1 and 2"):
        custom_opening(NINE, both)
    with pytest.raises(ValueError, match=r"positions has shape \(9, 2\)"):
        custom_opening(NINE, PLACES[:9])


def test_targets():
    assert STRAIGHT.target == 50
    assert setup("straight").target == 0
    assert setup("carom").target == 10
    assert setup("carom", target=0).target == 0
    assert NINE.target is None
    assert opening(setup("carom", target=7), np.random.default_rng(0)).state.target == 7


# Invalid arguments.

HEAVY = Scene.from_dict({"base": "pool", "balls": {"radius": [0.03, 0.03], "mass": [0.2, "inf"]}})


@pytest.mark.parametrize(
    ("rules", "kwargs", "message"),
    [
        ("ten_ball", {}, "rules = 'ten_ball'"),
        (3, {}, "rules = 3"),
        ("nine_ball", {"scene": Scene.named("pool", 8)}, "8 object balls: expected 9"),
        ("straight", {"scene": Scene.named("ideal", 16)}, "expected 1 to 15"),
        ("carom", {"scene": Scene.named("pool", 2)}, "without pockets"),
        ("nine_ball", {"scene": Scene.named("ideal", 9)}, "with pockets"),
        ("snooker", {"scene": Scene.named("pool", 15)}, "expected a table with a D"),
        ("straight", {"scene": TRIANGLE}, "expected a playing surface that is a rectangle"),
        ("straight", {"scene": HEAVY}, "infinite mass"),
        ("eight_ball", {"n_players": 3}, "n_players = 3: expected 2 for rules 'eight_ball'"),
        ("nine_ball", {"n_players": 5}, "from 2 to 4"),
        ("nine_ball", {"n_players": True}, "n_players = True"),
        ("nine_ball", {"target": 3}, "target = 3"),
        ("straight", {"target": -1}, "target = -1"),
        ("straight", {"target": 1.5}, "target = 1.5"),
        ("straight", {"mode": "pit"}, "dt = None"),
        ("straight", {"dt": 0.1}, "dt = 0.1"),
        ("nine_ball", {"call_shot": True}, "call_shot = True with rules 'nine_ball'"),
        ("carom", {"call_shot": True}, "call_shot = True with rules 'carom'"),
        ("snooker", {"call_shot": True}, "call_shot = True with rules 'snooker'"),
        ("nine_ball", {"miss": True}, "miss = True with rules 'nine_ball'"),
    ],
)
def test_impossible_setups_are_rejected(rules, kwargs, message):
    usual = setup(rules).scene if rules in RULES else NINE.scene
    with pytest.raises(ValueError, match=message):
        Setup(rules, **{"scene": usual, **kwargs})


@pytest.mark.parametrize(("rules", "layout"), [("nine_ball", "carom_opening"), ("carom", "rack")])
def test_unsuitable_layouts_are_rejected(rules, layout):
    with pytest.raises(ValueError, match=rf"layout = '{layout}' with rules '{rules}': expected one of '"):
        opening(setup(rules), np.random.default_rng(0), layout)


@pytest.mark.parametrize(
    ("rules", "state", "message"),
    [
        ("nine_ball", {"turn": 1}, "key of state = 'turn'"),
        ("nine_ball", {"over": True}, "key of state = 'over'"),
        ("nine_ball", {"player": 2}, "state.player = 2"),
        ("nine_ball", {"player": "0"}, "state.player = '0'"),
        ("nine_ball", {"solids": 0}, "state.solids = 0"),
        ("nine_ball", {"scores": [0]}, "state.scores"),
        ("nine_ball", {"scores": 3}, "state.scores = 3"),
        ("nine_ball", {"scores": [0, 0.5]}, r"state.scores\[1\] = 0.5"),
        ("carom", {"scores": [0, 10]}, "below the target, 10"),
        ("nine_ball", {"on_table": [0, 3]}, r"expected the balls \[0, 9\]"),
        ("nine_ball", {"on_table": [9, 3]}, r"expected the balls \[0, 9\]"),
        ("nine_ball", {"on_table": [0, 9, 9]}, "each ball once"),
        ("nine_ball", {"on_table": [0, 9, 10]}, r"state.on_table\[2\] = 10"),
        ("nine_ball", {"cue_balls": [1]}, "state.cue_balls"),
        ("nine_ball", {"break_shot": 1}, "state.break_shot = 1"),
        ("nine_ball", {"in_hand": "maybe"}, "state.in_hand = 'maybe'"),
        ("nine_ball", {"in_hand": None}, "state.in_hand = None"),
        ("nine_ball", [], "state = "),
        ("nine_ball", {"fouls": [1]}, r"state.fouls = \[1\]: expected 2 fouls"),
        ("nine_ball", {"colour": True}, "state.colour = True with rules 'nine_ball'"),
        ("snooker", {"on_table": [0, 1, 21]}, "expected all colours"),
        ("snooker", {"on_table": [0, 16, 21]}, "expected all colours"),
        ("snooker", {"on_table": [0, 20, 21], "colour": True}, "expected all colours"),
        ("snooker", {"on_table": [0, 16, 17, 18, 19, 20]}, r"expected the balls \[0, 21\]"),
        ("snooker", {"choices": ["push_out"]}, r"state.choices\[0\] = 'push_out'"),
        ("snooker", {"choices": ["replace"]}, r"state.choices\[0\] = 'replace'"),
    ],
)
def test_impossible_states_are_rejected(rules, state, message):
    settings = setup(rules)
    with pytest.raises(ValueError, match=message):
        custom_opening(settings, opening(settings, np.random.default_rng(0), "random").positions, state)


IN_HAND = {"in_hand": "behind"}


@pytest.mark.parametrize(
    ("state", "stroke", "message"),
    [
        ({}, Stroke((1.0, 0.0), (0.0, 0.0)), "stroke.place"),
        ({}, Stroke((math.nan, 0.0)), "stroke.velocity"),
        ({}, Stroke((1.0, math.inf)), "stroke.velocity"),
        (IN_HAND, Stroke((1.0, 0.0)), "in hand"),
        (IN_HAND, Stroke((1.0, 0.0), (math.nan, 0.0)), r"stroke\.place"),
        ({}, Stroke((1.0, 0.0), call=Call(kind="push_out")), "stroke.call.kind = 'push_out'"),
        ({}, Stroke((0.0, 0.0), call=Call(kind="hand_back")), "stroke.call.kind = 'hand_back'"),
        ({}, Stroke((1.0, 0.0), call=Call(kind="safety")), "stroke.call.kind = 'safety'"),
        ({}, Stroke((1.0, 0.0), call=Call(kind="jump")), "stroke.call.kind = 'jump'"),
        ({}, Stroke((1.0, 0.0), call=Call(10)), "stroke.call.ball = 10"),
        ({}, Stroke((1.0, 0.0), call=Call(1, 6)), "stroke.call.pocket = 6"),
        (
            {"choices": ["hand_back"]},
            Stroke((1.0, 0.0), call=Call(kind="hand_back")),
            "expected no motion and no place",
        ),
    ],
)
def test_impossible_strokes_are_rejected(state, stroke, message):
    with pytest.raises(ValueError, match=message):
        play(NINE, custom_opening(NINE, PLACES, state), stroke)


def test_no_shot_is_allowed_after_the_end():
    history, log = random_game(NINE, 1)
    assert log[-1].game.state.over
    with pytest.raises(ValueError, match="the game is over"):
        play(NINE, log[-1].game, history.strokes[0])


# Shots on the table.

CORNER = {0: (0.9, 0.265), 8: (1.1, 0.465)}
"""The cue ball and the eight ball on a line into a corner pocket."""


def test_a_break_from_behind_the_head_string():
    played = play(NINE, opening(NINE, np.random.default_rng(0)), Stroke((8.0, 0.0), (1.0, 0.0)))
    assert played.shot.trajectory is not None
    assert played.shot.at(0.0)[0].tolist() == [-0.635, 0.0]
    assert played.facts.first == (1,)
    assert played.verdict.foul in ("", "scratch")


def test_the_eight_ball_potted_on_the_break_is_spotted():
    played = play(EIGHT, custom_opening(EIGHT, in_a_row(16, CORNER), {"break_shot": True}), Stroke((1.5, 1.5)))
    assert (played.facts.potted[0], played.verdict.spotted) == (8, (8,))
    assert played.game.positions[8].tolist() == [0.635, 0.0]
    assert 8 in played.game.state.on_table


def test_a_cue_ball_in_hand_does_not_block_a_spotted_ball():
    played = play(NINE, custom_opening(NINE, in_a_row(10, {0: (0.625, -0.01), 9: (0.685, 0.05)})), Stroke((1.5, 1.5)))
    assert (played.verdict.foul, played.facts.potted) == ("wrong_ball", (9,))
    assert math.dist(played.shot.positions[0], (0.635, 0.0)) < 2 * NINE.scene.balls.radius[0]
    assert played.game.positions[9].tolist() == [0.635, 0.0]


def test_balls_are_spotted_one_behind_the_other(monkeypatch):
    monkeypatch.setattr(Rules, "judge", lambda *_: Verdict(spotted=(1, 2, 3)))
    settings = setup("straight", 4)
    played = play(settings, custom_opening(settings, in_a_row(5), {"on_table": [0, 4]}), Stroke((0.0, 0.0)))
    step = 2 * settings.scene.balls.radius[0]
    assert played.game.positions[1:4, 0] == pytest.approx(0.635 + step * np.arange(3), abs=1e-15)
    assert played.game.state.on_table == frozenset(range(5))


def test_after_a_scratch_the_cue_ball_is_in_hand():
    settings = setup("straight", 2)
    played = play(settings, custom_opening(settings, in_a_row(3, {0: (0.97, 0.335)})), Stroke((1.0, 1.0)))
    state = played.game.state
    assert (played.verdict.foul, state.in_hand, state.scores) == ("scratch", "behind", (-1, 0))
    after = play(settings, played.game, Stroke((0.5, 0.0), (-0.7, 0.2)))
    assert after.shot.at(0.0)[0].tolist() == [-0.7, 0.2]


def test_a_blocked_point_is_replaced_by_the_nearest_free_point():
    game = custom_opening(NINE, PLACES, {"in_hand": "anywhere"})
    wish = tuple((PLACES[5] + [0.0, 0.01]).tolist())
    start = play(NINE, game, Stroke((0.0, -1.0), wish)).shot.at(0.0)
    assert start[0] == pytest.approx(PLACES[5] + [0.0, 2 * NINE.scene.balls.radius[0] + MARGIN])


def test_carom_players_alternate_cue_balls():
    settings = setup("carom")
    game = opening(settings, np.random.default_rng(0))
    for player, cue in [(0, 0), (1, 2), (0, 0)]:
        assert game.state.player == player
        played = play(settings, game, Stroke((0.0, 0.4)))
        moved = np.flatnonzero((played.game.positions != game.positions).any(axis=1))
        assert moved[0] == cue
        game = played.game


def test_a_push_out_on_the_table_can_be_handed_back():  # 2.4
    game = custom_opening(NINE, PLACES, {"choices": ["push_out"]})
    pushed = play(NINE, game, Stroke((0.0, -0.5), call=Call(kind="push_out"))).game
    assert (pushed.state.player, pushed.state.choices) == (1, ("hand_back",))
    back = play(NINE, pushed, Stroke((0.0, 0.0), call=Call(kind="hand_back")))
    assert (back.game.state.player, back.game.state.choices, back.shot.time) == (0, (), 0.0)
    assert back.game.positions.tobytes() == pushed.positions.tobytes()
    assert play(NINE, pushed, Stroke((0.5, 0.0))).game.state.player == 0  # or the player plays the shot


def test_straight_pool_a_rack_on_the_table():
    places = in_a_row(16, {0: (0.97, 0.335), 3: (1.07, 0.435), 8: (0.2, -0.4)})
    game = custom_opening(STRAIGHT, places, {"on_table": [0, 3, 8], "scores": [14, 2]})
    played = play(STRAIGHT, game, Stroke((1.0, 0.99), call=Call(3, 3)))
    assert (played.facts.potted, played.facts.pockets, played.verdict.rack) == ((3,), (3,), "rest")
    state = played.game.state
    assert (state.player, state.scores, len(state.on_table), state.break_shot) == (0, (15, 2), 16, False)
    assert played.game.positions[8].tolist() == [0.2, -0.4]


def test_straight_pool_three_fouls_on_the_table():
    game = opening(STRAIGHT, np.random.default_rng(0), "random")
    for k in range(5):  # both players miss all balls; the first one commits the third foul
        played = play(STRAIGHT, game, Stroke((0.0, 0.0)))
        game = played.game
        assert (played.verdict.foul, game.state.player) == ("no_hit", (k + 1) % 2 if k < 4 else 0)
    assert (game.state.break_shot, game.state.in_hand, game.state.scores) == (True, "behind", (-18, -2))
    assert game.positions[1:].tolist() == layouts.layout_plan("tight_rack", STRAIGHT.scene).spots[1:].tolist()


# Whole games.


@pytest.mark.parametrize(("rules", "engine"), [*((rules, {}) for rules in RULES), ("nine_ball", PIT), ("carom", PIT)])
def test_random_games_end_and_keep_all_balls(rules, engine):
    ended = 0
    for seed in range(3):
        settings = setup(rules, **engine, **({"target": TARGETS[rules]} if rules in TARGETS else {}))
        history, log = random_game(settings, seed)
        down = Counter()
        game = history.opening
        for played in log:
            state, verdict = played.game.state, played.verdict
            down.update(played.facts.potted)
            down.subtract(verdict.spotted)
            down[0] = 0
            assert state.on_table == {ball for ball in range(settings.scene.n_balls) if down[ball] == 0}
            assert sum(state.scores) == sum(game.state.scores) + verdict.points + verdict.penalty
            assert (state.player == game.state.player) == verdict.continues
            assert state.over == verdict.over
            if not engine:
                lying = state.on_table if state.in_hand == "no" else state.object_balls
                in_play = np.isin(np.arange(settings.scene.n_balls), sorted(lying))
                check_positions(settings.scene, played.game.positions, in_play=in_play)
            game = played.game
        if rules == "straight":
            penalties = sum(min(played.verdict.points, 0) for played in log)
            assert sum(game.state.scores) - penalties == 16 - len(game.state.on_table)
        ended += game.state.over
    assert ended or rules == "three_cushion"


def test_play_does_not_change_earlier_states():
    game = opening(NINE, np.random.default_rng(0))
    before = game.positions.copy()
    play(NINE, game, Stroke((5.0, 0.1), (-0.8, 0.0)))
    assert game.positions.tobytes() == before.tobytes()
