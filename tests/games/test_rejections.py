"""Wrong settings, states, strokes, arguments and actions are refused with the name, the value and what was expected."""

import dataclasses
import math

import numpy as np
import pytest

from billiards_env import Scene, billiards_v0
from billiards_env.envs import make_env
from billiards_env.games import Call, Setup, Stroke, custom_opening, opening, play
from tests.helpers.errors import refusals
from tests.helpers.games import in_a_row, setup, state

ROUND = {"base": "pool", "balls": {"radius": [0.03, 0.03], "mass": [0.2, 0.2]}}
CORNERS = [{"x": -1, "y": -0.5}, {"x": 1, "y": -0.5}, {"x": 0, "y": 0.5}]
TRIANGLE = Scene.from_dict(
    {**ROUND, "table": {"length": 2, "width": 1, "outline": CORNERS, "pockets": [{"x": 0, "y": 0.5, "radius": 0.1}]}}
)
POOL = Scene.named("pool", 3)
MIRRORED, ONLY_THREE = (
    dataclasses.replace(POOL, table=dataclasses.replace(POOL.table, pockets=pockets))
    for pockets in (POOL.table.pockets[::-1], POOL.table.pockets[:3])
)
HEAVY = Scene.from_dict({**ROUND, "balls": {"radius": [0.03, 0.03], "mass": [0.2, "inf"]}})
PLACES, NINE, SNOOKER = in_a_row(10), setup("nine_ball"), setup("snooker")
GIVEN = SNOOKER.game_rules.given


@pytest.mark.parametrize("name", [field.name for field in dataclasses.fields(Setup)])
def test_every_setting_refuses_a_value_of_a_wrong_type(name):
    for settings in (SNOOKER, setup("eight_ball"), setup("straight")):
        with pytest.raises((TypeError, ValueError), match=rf"^{name} = <object .*expected "):
            dataclasses.replace(settings, **{name: object()})


SETTINGS = [
    ("nine_ball", {"scene": Scene.named("pool", 8)}, "8 object balls: expected 9"),
    ("straight", {"scene": Scene.named("ideal", 16)}, "expected 1 to 15"),
    ("carom", {"scene": Scene.named("pool", 2)}, "without pockets"),
    ("nine_ball", {"scene": Scene.named("ideal", 9)}, "with pockets"),
    ("snooker", {"scene": Scene.named("pool", 15)}, "expected a table with a D"),
    ("straight", {"scene": TRIANGLE}, "expected a playing surface that is a rectangle"),
    ("straight", {"scene": HEAVY}, "infinite mass"),
    ("one_pocket", {"scene": MIRRORED}, "rules = 'one_pocket' with a table of other pockets 2 and 3: expected"),
    ("one_pocket", {"scene": ONLY_THREE}, "expected these pockets in the foot corners"),
    ("eight_ball", {"n_players": 3}, "n_players = 3: expected 2 for rules 'eight_ball'"),
    ("nine_ball", {"target": 3}, "target = 3"),
    ("straight", {"target": -1}, "target = -1"),
    ("nine_ball", {"call_shot": True}, "call_shot = True with rules 'nine_ball'"),
    ("nine_ball", {"miss": True}, "miss = True with rules 'nine_ball'"),
    ("nine_ball", {"innings": 3}, "innings = 3: expected 0 for rules 'nine_ball'"),
    ("nine_ball", {"edition": "2008"}, "edition = '2008': expected one of '2016', '2025'"),
]


@refusals("rules, settings", SETTINGS)
def test_wrong_settings(rules, settings, message, kind):
    with pytest.raises(kind, match=message):
        setup(rules, **settings)


STATES = [
    ("nine_ball", {"turn": 1}, "key of state = 'turn'"),
    ("nine_ball", {"player": 2}, "state.player = 2"),
    ("nine_ball", {"solids": 0}, "key of state = 'solids'"),
    ("eight_ball", {"solids": 2}, "state.solids = 2"),
    ("nine_ball", {"scores": [0]}, "state.scores"),
    ("carom", {"scores": [0, 10]}, "below the target, 10"),
    ("nine_ball", {"on_table": [9, 3]}, r"expected the balls \[0, 9\]"),
    ("nine_ball", {"on_table": [0, 9, 9]}, "each ball once"),
    ("nine_ball", {"on_table": [0, 9, 10]}, r"state.on_table\[2\] = 10"),
    ("nine_ball", {"cue_balls": [1]}, "state.cue_balls"),
    ("nine_ball", [], "state = "),
    ("snooker", {"on_table": [0, 1, 21]}, "expected all colours"),
    ("snooker", {"on_table": [0, 20, 21], "colour": True}, "expected all colours"),
    ("snooker", {"on_table": [0, 16, 17, 18, 19, 20]}, r"expected the balls \[0, 21\]"),
    ("snooker", {"choices": ["push_out"]}, r"state.choices\[0\] = 'push_out'"),
    *(("snooker", {name: object()}, rf"state.{name} = <object .*expected ", Exception) for name in GIVEN),
]


@refusals("rules, state", STATES)
def test_wrong_states(rules, state, message, kind):
    settings = setup(rules)
    positions = opening(settings, np.random.default_rng(0), "random").positions
    with pytest.raises(kind, match=message):
        custom_opening(settings, positions, state)


IN_HAND, HAND_BACK = {"in_hand": "behind"}, {"choices": ["hand_back"]}
STROKES = [
    ({}, Stroke((1.0, 0.0), (0.0, 0.0)), "stroke.place"),
    ({}, Stroke((math.nan, 0.0)), "stroke.velocity"),
    (IN_HAND, Stroke((1.0, 0.0)), "in hand"),
    (IN_HAND, Stroke((1.0, 0.0), (math.nan, 0.0)), r"stroke\.place"),
    ({}, Stroke((1.0, 0.0), call=Call(kind="push_out")), "stroke.call.kind = 'push_out'"),
    ({}, Stroke((1.0, 0.0), call=Call(10)), "stroke.call.ball = 10"),
    ({}, Stroke((1.0, 0.0), call=Call(1, 6)), "stroke.call.pocket = 6"),
    (HAND_BACK, Stroke((1.0, 0.0), call=Call(kind="hand_back")), "expected no motion and no place"),
]


@refusals("state, stroke", STROKES)
def test_wrong_strokes(state, stroke, message, kind):
    with pytest.raises(kind, match=message):
        play(NINE, custom_opening(NINE, PLACES, state), stroke)


OVER = custom_opening(NINE, PLACES)._replace(state=state("nine_ball", over=True))
STATE_ALONE, BALLS_1_AND_2 = {"state": {"player": 1}}, PLACES[[0, 1, 1, *range(3, 10)]]
CALLS = [
    (lambda: opening(setup("carom"), np.random.default_rng(0), "rack"), "layout = 'rack' with rules 'carom': expected"),
    (lambda: play(NINE, OVER, Stroke((1.0, 0.0))), "the game is over"),
    (lambda: custom_opening(NINE, PLACES[:9]), r"positions has shape \(9, 2\)"),
    (lambda: custom_opening(NINE, BALLS_1_AND_2), "balls 1 and 2"),
    (lambda: NINE.callable(custom_opening(NINE, PLACES).state), "game = 'nine_ball'"),
    (lambda: billiards_v0.raw_env("nine_ball", n_players=1), "n_players = 1: expected 2 to 4"),
    (lambda: make_env(task="nine_ball", n_players=2).reset(options=STATE_ALONE), "without .*: expected both"),
    (lambda: billiards_v0.raw_env("nine_ball").history(), "no game has begun"),
    (lambda: billiards_v0.env(task="carom").agents, "before reset", AttributeError),
]


@refusals("call", CALLS)
def test_wrong_calls(call, message, kind):
    with pytest.raises(kind, match=message):
        call()
