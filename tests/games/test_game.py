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
from tests.helpers.games import setup as usual_setup

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


def random_stroke(game, rng):
    velocity = 12 * rng.random(2) - 6
    place = None if game.state.in_hand == "no" else tuple((3 * rng.random(2) - 1.5).tolist())
    return Stroke(tuple(velocity.tolist()), place)


def random_game(setup, seed, shots=400):
    rng = np.random.default_rng(seed)
    game = opening(setup, rng)
    start, strokes, log = game, [], []
    while len(strokes) < shots and not game.state.over:
        strokes.append(random_stroke(game, rng))
        log.append(play(setup, game, strokes[-1]))
        game = log[-1].game
    return History(setup, start, tuple(strokes)), log


# The rack.


def test_the_rack_of_a_game_is_that_of_its_layout():
    for game in ("nine_ball", "eight_ball"):
        setup = usual_setup(game)
        racked = opening(setup, np.random.default_rng(7), "rack").positions
        assert racked.tobytes() == draw(game, setup.scene, np.random.default_rng(7)).tobytes()
        tight = opening(setup, np.random.default_rng(7), "tight_rack").positions[setup.game_rules.deciding_ball]
        assert tight == pytest.approx([0.635 + 2 * math.sqrt(3) * setup.scene.balls.radius[0], 0.0])


def test_a_game_is_one_entry_of_games_and_one_of_racks(monkeypatch):
    """Nine ball with ten balls, in which any ball may be called, but only the lowest touched first."""
    game = GAMES["nine_ball"]._replace(name="ten_ball", n_object_balls=(10, 10), call_kernel=any_ball, deciding_ball=10)
    monkeypatch.setitem(GAMES, "ten_ball", game)
    monkeypatch.setitem(RULES, "ten_ball", Rules(*game))
    monkeypatch.setitem(layouts.RACKS, "ten_ball", layouts.Rack((1, 2, 3, 4, 10, 6, 7, 8, 9, 5), fixed=(1, 10)))
    monkeypatch.setattr(batch, "judge_shots", lambda name, states, facts, calls: calls)
    setup = Setup("ten_ball", Scene.named("pool", 10), call_shot=True)
    first, second = (opening(setup, np.random.default_rng(seed), "tight_rack").positions for seed in (0, 3))
    assert first[10] == pytest.approx([0.635 + 2 * math.sqrt(3) * setup.scene.balls.radius[0], 0.0])
    assert (first[[1, 10]].tolist(), first[1, 0]) == (second[[1, 10]].tolist(), 0.635)
    assert sorted(first[2:10].tolist()) == sorted(second[2:10].tolist()) != first[2:10].tolist()
    places = np.array([[0.97, 0.335], *([-0.8 + 0.16 * i, -0.5] for i in range(10))])
    places[4] = 1.07, 0.435
    game = custom_opening(setup, places)
    facts = play(setup, game, Stroke((0.7, 0.7))).facts
    assert (facts.potted, batch.best_call(setup.game_rules, game.state, facts)) == ((4,), Call(4, 3))
    (call,) = batch.judge_batch(setup, game, [[0.7, 0.7]])
    assert (call["ball"], call["made"]) == (4, True)


@pytest.mark.parametrize("rules", RULES)
def test_openings(rules):
    setup = usual_setup(rules)
    names = setup.game_rules.layouts
    for layout in names:
        game = opening(setup, np.random.default_rng(3), layout)
        again = opening(setup, np.random.default_rng(3), layout)
        assert game.positions.tobytes() == again.positions.tobytes()
        assert game.state == again.state
        assert game.state.break_shot == (layout != "random")
        assert game.state.in_hand == ("behind" if setup.game_rules.pockets and layout != "random" else "no")
    assert opening(setup, np.random.default_rng(3)).positions.tobytes() == (
        opening(setup, np.random.default_rng(3), names[0]).positions.tobytes()
    )


# Invalid arguments.


@pytest.mark.parametrize(
    ("kwargs", "message"),
    [
        ({"rules": "ten_ball"}, "rules = 'ten_ball'"),
        ({"rules": 3}, "rules = 3"),
        ({"rules": "nine_ball", "scene": Scene.named("pool", 8)}, "8 object balls: expected 9"),
        ({"rules": "straight", "scene": Scene.named("ideal", 16)}, "expected 1 to 15"),
        ({"rules": "carom", "scene": Scene.named("pool", 2)}, "without pockets"),
        ({"rules": "nine_ball", "scene": Scene.named("ideal", 9)}, "with pockets"),
        ({"rules": "straight", "scene": TRIANGLE}, "expected a playing surface that is a rectangle"),
        ({"rules": "eight_ball", "n_players": 3}, "n_players = 3: expected a whole number from 2 to 2"),
        ({"rules": "nine_ball", "n_players": 5}, "from 2 to 4"),
        ({"rules": "nine_ball", "n_players": True}, "n_players = True"),
        ({"rules": "nine_ball", "target": 3}, "target = 3"),
        ({"rules": "straight", "target": -1}, "target = -1"),
        ({"rules": "straight", "target": 1.5}, "target = 1.5"),
        ({"rules": "straight", "mode": "pit"}, "dt = None"),
        ({"rules": "straight", "dt": 0.1}, "dt = 0.1"),
        (
            {
                "rules": "straight",
                "scene": Scene.from_dict({"base": "pool", "balls": {"radius": [0.03, 0.03], "mass": [0.2, "inf"]}}),
            },
            "infinite mass",
        ),
    ],
)
def test_impossible_setups_are_rejected(kwargs, message):
    usual = {"eight_ball": 15, "nine_ball": 9}
    with pytest.raises(ValueError, match=message):
        Setup(**{"scene": Scene.named("pool", usual.get(kwargs["rules"], 1)), **kwargs})


def test_targets():
    assert usual_setup("straight").target == 0
    assert usual_setup("carom").target == 10
    assert usual_setup("carom", target=0).target == 0
    assert usual_setup("nine_ball").target is None
    assert opening(usual_setup("carom", target=7), np.random.default_rng(0)).state.target == 7


def test_unsuitable_layouts_are_rejected():
    with pytest.raises(ValueError, match=r"layout = 'carom_opening'.*expected one of 'rack'"):
        opening(usual_setup("nine_ball"), np.random.default_rng(0), "carom_opening")
    with pytest.raises(ValueError, match="layout = 'rack'"):
        opening(usual_setup("carom"), np.random.default_rng(0), "rack")


PLACES = np.array([[-0.6, 0.0], *([-0.8 + 0.16 * i, 0.3] for i in range(9))])


@pytest.mark.parametrize(
    ("state", "message"),
    [
        ({"turn": 1}, "key of state = 'turn'"),
        ({"over": True}, "key of state = 'over'"),
        ({"player": 2}, "state.player = 2"),
        ({"player": "0"}, "state.player = '0'"),
        ({"solids": 0}, "state.solids = 0"),
        ({"scores": [0]}, "state.scores"),
        ({"scores": 3}, "state.scores = 3"),
        ({"scores": [0, 0.5]}, r"state.scores\[1\] = 0.5"),
        ({"on_table": [0, 3]}, r"expected the balls \[0, 9\]"),
        ({"on_table": [9, 3]}, r"expected the balls \[0, 9\]"),
        ({"on_table": [0, 9, 9]}, "each ball once"),
        ({"on_table": [0, 9, 10]}, r"state.on_table\[2\] = 10"),
        ({"cue_balls": [1]}, "state.cue_balls"),
        ({"break_shot": 1}, "state.break_shot = 1"),
        ({"in_hand": "maybe"}, "state.in_hand = 'maybe'"),
        ({"in_hand": None}, "state.in_hand = None"),
        ([], "state = "),
    ],
)
def test_impossible_states_are_rejected(state, message):
    with pytest.raises(ValueError, match=message):
        custom_opening(usual_setup("nine_ball"), PLACES, state)


def test_a_state_with_the_target_reached_is_rejected():
    with pytest.raises(ValueError, match="below the target, 10"):
        custom_opening(usual_setup("carom"), [[0, 0], [1, 0], [-1, 0]], {"scores": [0, 10]})


def test_custom_openings():
    setup = usual_setup("nine_ball")
    game = custom_opening(setup, PLACES)
    assert (game.state.break_shot, game.state.in_hand, game.state.player) == (False, "no", 0)
    both = PLACES.copy()
    both[2] = both[1]  # ball 2 is not in play, so the overlap is allowed
    assert custom_opening(setup, both, {"on_table": [0, 1, 9]}).state.on_table == {0, 1, 9}
    with pytest.raises(ValueError, match="balls 1 and 2"):
        custom_opening(setup, both)
    with pytest.raises(ValueError, match=r"positions has shape \(9, 2\)"):
        custom_opening(setup, PLACES[:9])


@pytest.mark.parametrize(
    ("stroke", "message"),
    [
        (Stroke((1.0, 0.0), (0.0, 0.0)), "stroke.place"),
        (Stroke((math.nan, 0.0)), "stroke.velocity"),
        (Stroke((1.0, math.inf)), "stroke.velocity"),
    ],
)
def test_impossible_strokes_are_rejected(stroke, message):
    with pytest.raises(ValueError, match=message):
        play(usual_setup("nine_ball"), custom_opening(usual_setup("nine_ball"), PLACES), stroke)


def test_a_cue_ball_in_hand_must_be_placed():
    setup = usual_setup("nine_ball")
    game = opening(setup, np.random.default_rng(0))
    with pytest.raises(ValueError, match="in hand"):
        play(setup, game, Stroke((1.0, 0.0)))
    with pytest.raises(ValueError, match=r"stroke\.place"):
        play(setup, game, Stroke((1.0, 0.0), (math.nan, 0.0)))


def test_no_shot_is_allowed_after_the_end():
    setup = usual_setup("nine_ball")
    history, log = random_game(setup, 1)
    assert log[-1].game.state.over
    with pytest.raises(ValueError, match="the game is over"):
        play(setup, log[-1].game, history.strokes[0])


# Shots on the table.


def test_a_break_from_behind_the_head_string():
    setup = usual_setup("nine_ball")
    game = opening(setup, np.random.default_rng(0))
    played = play(setup, game, Stroke((8.0, 0.0), (1.0, 0.0)))
    assert played.shot.trajectory is not None
    assert played.shot.at(0.0)[0].tolist() == [-0.635, 0.0]
    assert played.facts.first == (1,)
    assert played.verdict.foul in ("", "scratch")


def test_the_eight_ball_potted_on_the_break_is_spotted():
    setup = usual_setup("eight_ball")
    positions = np.array([[0.9, 0.265], *([-0.9 + 0.11 * i, -0.3] for i in range(15))])
    positions[8] = 1.1, 0.465
    game = custom_opening(setup, positions, {"break_shot": True})
    played = play(setup, game, Stroke((1.5, 1.5)))
    assert played.facts.potted[0] == 8
    assert played.verdict.spotted == (8,)
    assert played.game.positions[8].tolist() == [0.635, 0.0]
    assert 8 in played.game.state.on_table


def test_a_cue_ball_in_hand_does_not_block_a_spotted_ball():
    setup = usual_setup("nine_ball")
    positions = np.array([[0.625, -0.01], *([-0.8 + 0.16 * i, -0.3] for i in range(9))])
    positions[9] = 0.685, 0.05
    played = play(setup, custom_opening(setup, positions), Stroke((1.5, 1.5)))
    assert (played.verdict.foul, played.facts.potted) == ("wrong_ball", (9,))
    assert math.dist(played.shot.positions[0], (0.635, 0.0)) < 2 * setup.scene.balls.radius[0]
    assert played.game.positions[9].tolist() == [0.635, 0.0]


def test_balls_are_spotted_one_behind_the_other(monkeypatch):
    monkeypatch.setattr(Rules, "judge", lambda *_: Verdict(spotted=(1, 2, 3)))
    setup = usual_setup("straight", scene=Scene.named("pool", 4))
    game = custom_opening(setup, [[-0.6, 0.1 * i] for i in range(5)], {"on_table": [0, 4]})
    played = play(setup, game, Stroke((0.0, 0.0)))
    step = 2 * setup.scene.balls.radius[0] + MARGIN
    assert played.game.positions[1:4, 0] == pytest.approx(0.635 + step * np.arange(3))
    assert played.game.state.on_table == frozenset(range(5))


def test_after_a_scratch_the_cue_ball_is_in_hand():
    setup = usual_setup("straight", scene=Scene.named("pool", 2))
    game = custom_opening(setup, [[0.97, 0.335], [0.0, 0.0], [0.3, 0.0]])
    played = play(setup, game, Stroke((1.0, 1.0)))
    assert played.verdict.foul == "scratch"
    assert played.game.state.in_hand == "behind"
    assert played.game.state.scores == (-1, 0)
    after = play(setup, played.game, Stroke((0.5, 0.0), (-0.7, 0.2)))
    assert after.shot.at(0.0)[0].tolist() == [-0.7, 0.2]


def test_a_blocked_point_is_replaced_by_the_nearest_free_point():
    setup = usual_setup("nine_ball")
    game = custom_opening(setup, PLACES, {"in_hand": "anywhere"})
    wish = tuple((PLACES[5] + [0.0, 0.01]).tolist())
    start = play(setup, game, Stroke((0.0, -1.0), wish)).shot.at(0.0)
    assert start[0] == pytest.approx(PLACES[5] + [0.0, 2 * setup.scene.balls.radius[0] + MARGIN])


def test_carom_players_alternate_cue_balls():
    setup = usual_setup("carom")
    game = opening(setup, np.random.default_rng(0))
    for player, cue in [(0, 0), (1, 2), (0, 0)]:
        assert game.state.player == player
        played = play(setup, game, Stroke((0.0, 0.4)))
        moved = np.flatnonzero((played.game.positions != game.positions).any(axis=1))
        assert moved[0] == cue
        game = played.game


# Whole games.


@pytest.mark.parametrize(("rules", "engine"), [*((rules, {}) for rules in RULES), ("nine_ball", PIT), ("carom", PIT)])
def test_random_games_end_and_keep_all_balls(rules, engine):
    ended = 0
    for seed in range(3):
        setup = usual_setup(rules, **engine, **({"target": TARGETS[rules]} if rules in TARGETS else {}))
        history, log = random_game(setup, seed)
        down = Counter()
        game = history.opening
        for played in log:
            state, verdict = played.game.state, played.verdict
            down.update(played.facts.potted)
            down.subtract(verdict.spotted)
            down[0] = 0
            assert state.on_table == {ball for ball in range(setup.scene.n_balls) if down[ball] == 0}
            assert sum(state.scores) == sum(game.state.scores) + verdict.points + verdict.penalty
            assert (state.player == game.state.player) == verdict.continues
            assert state.over == verdict.over
            if not engine:
                lying = state.on_table if state.in_hand == "no" else state.object_balls
                in_play = np.isin(np.arange(setup.scene.n_balls), sorted(lying))
                check_positions(setup.scene, played.game.positions, in_play=in_play)
            game = played.game
        if rules == "straight":
            penalties = sum(min(played.verdict.points, 0) for played in log)
            assert sum(game.state.scores) - penalties == 16 - len(game.state.on_table)
        ended += game.state.over
    assert ended or rules == "three_cushion"


def test_play_does_not_change_earlier_states():
    setup = usual_setup("nine_ball")
    game = opening(setup, np.random.default_rng(0))
    before = game.positions.copy()
    play(setup, game, Stroke((5.0, 0.1), (-0.8, 0.0)))
    assert game.positions.tobytes() == before.tobytes()
