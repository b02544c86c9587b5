"""Wrong settings, states, strokes, arguments and actions are refused with the name, the value and what was expected."""

import math
from typing import Any

import numpy as np
import pytest

from billiards_env import Scene, billiards_v0
from billiards_env.envs import make_env
from billiards_env.games import GAMES, Call, Setup, Stroke, custom_opening, opening, play
from tests.helpers.errors import refusals
from tests.helpers.games import in_a_row, setup

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
HEAVY = Scene.from_dict({"base": "pool", "balls": {"radius": [0.03, 0.03], "mass": [0.2, "inf"]}})
RNG, PLACES = np.random.default_rng, in_a_row(10)


SETTINGS = [
    ("croquet", {}, "rules = 'croquet'"),
    ("nine_ball", {"scene": Scene.named("pool", 8)}, "8 object balls: expected 9"),
    ("straight", {"scene": Scene.named("ideal", 16)}, "expected 1 to 15"),
    ("carom", {"scene": Scene.named("pool", 2)}, "without pockets"),
    ("nine_ball", {"scene": Scene.named("ideal", 9)}, "with pockets"),
    ("snooker", {"scene": Scene.named("pool", 15)}, "expected a table with a D"),
    ("straight", {"scene": TRIANGLE}, "expected a playing surface that is a rectangle"),
    ("straight", {"scene": HEAVY}, "infinite mass"),
    ("eight_ball", {"n_players": 3}, "n_players = 3: expected 2 for rules 'eight_ball'"),
    ("nine_ball", {"n_players": 5}, "from 2 to 4"),
    ("nine_ball", {"target": 3}, "target = 3"),
    ("straight", {"target": -1}, "target = -1"),
    ("straight", {"engine": "pit"}, "engine = 'pit': expected an Engine", TypeError),
    ("nine_ball", {"call_shot": True}, "call_shot = True with rules 'nine_ball'"),
    ("nine_ball", {"miss": True}, "miss = True with rules 'nine_ball'"),
]


@refusals("rules, settings", SETTINGS)
def test_wrong_settings(rules, settings, message, kind):
    usual = setup(rules if rules in GAMES else "nine_ball").scene
    with pytest.raises(kind, match=message):
        Setup(rules, **{"scene": usual, **settings})


STATES = [
    ("nine_ball", {"turn": 1}, "key of state = 'turn'"),
    ("nine_ball", {"player": 2}, "state.player = 2"),
    ("nine_ball", {"solids": 0}, "state.solids = 0"),
    ("nine_ball", {"scores": [0]}, "state.scores"),
    ("nine_ball", {"scores": [0, 0.5]}, r"state.scores\[1\] = 0.5"),
    ("carom", {"scores": [0, 10]}, "below the target, 10"),
    ("nine_ball", {"on_table": [0, 3]}, r"expected the balls \[0, 9\]"),
    ("nine_ball", {"on_table": [9, 3]}, r"expected the balls \[0, 9\]"),
    ("nine_ball", {"on_table": [0, 9, 9]}, "each ball once"),
    ("nine_ball", {"on_table": [0, 9, 10]}, r"state.on_table\[2\] = 10"),
    ("nine_ball", {"cue_balls": [1]}, "state.cue_balls"),
    ("nine_ball", {"break_shot": 1}, "state.break_shot = 1"),
    ("nine_ball", {"in_hand": "maybe"}, "state.in_hand = 'maybe'"),
    ("nine_ball", [], "state = "),
    ("nine_ball", {"fouls": [1]}, r"state.fouls = \[1\]: expected 2 fouls"),
    ("nine_ball", {"colour": True}, "state.colour = True with rules 'nine_ball'"),
    ("snooker", {"on_table": [0, 1, 21]}, "expected all colours"),
    ("snooker", {"on_table": [0, 20, 21], "colour": True}, "expected all colours"),
    ("snooker", {"on_table": [0, 16, 17, 18, 19, 20]}, r"expected the balls \[0, 21\]"),
    ("snooker", {"choices": ["push_out"]}, r"state.choices\[0\] = 'push_out'"),
]


@refusals("rules, state", STATES)
def test_wrong_states(rules, state, message, kind):
    settings = setup(rules)
    positions = opening(settings, RNG(0), "random").positions
    with pytest.raises(kind, match=message):
        custom_opening(settings, positions, state)


IN_HAND, HAND_BACK = {"in_hand": "behind"}, {"choices": ["hand_back"]}


STROKES = [
    ({}, Stroke((1.0, 0.0), (0.0, 0.0)), "stroke.place"),
    ({}, Stroke((math.nan, 0.0)), "stroke.velocity"),
    ({}, Stroke((1.0, math.inf)), "stroke.velocity"),
    (IN_HAND, Stroke((1.0, 0.0)), "in hand"),
    (IN_HAND, Stroke((1.0, 0.0), (math.nan, 0.0)), r"stroke\.place"),
    ({}, Stroke((1.0, 0.0), call=Call(kind="push_out")), "stroke.call.kind = 'push_out'"),
    ({}, Stroke((0.0, 0.0), call=Call(kind="hand_back")), "stroke.call.kind = 'hand_back'"),
    ({}, Stroke((1.0, 0.0), call=Call(10)), "stroke.call.ball = 10"),
    ({}, Stroke((1.0, 0.0), call=Call(1, 6)), "stroke.call.pocket = 6"),
    (HAND_BACK, Stroke((1.0, 0.0), call=Call(kind="hand_back")), "expected no motion and no place"),
]


@refusals("state, stroke", STROKES)
def test_wrong_strokes(state, stroke, message, kind):
    settings = setup("nine_ball")
    game = custom_opening(settings, PLACES, state)
    with pytest.raises(kind, match=message):
        play(settings, game, stroke)


def begun(options: Any = None, **kwargs: Any) -> Any:
    env = billiards_v0.raw_env(**{"task": "nine_ball", **kwargs})
    env.reset(0, options)
    return env


CALLS = [
    (lambda: opening(setup("nine_ball"), RNG(0), "carom_opening"), "layout = 'carom_opening' with rules"),
    (lambda: opening(setup("carom"), RNG(0), "rack"), "layout = 'rack' with rules 'carom': expected one of '"),
    (lambda: custom_opening(setup("nine_ball"), PLACES[:9]), r"positions has shape \(9, 2\)"),
    (lambda: custom_opening(setup("nine_ball"), PLACES[[0, 1, 1, *range(3, 10)]]), "balls 1 and 2"),
    (lambda: setup("nine_ball").callable(opening(setup("nine_ball"), RNG(0)).state), "game = 'nine_ball'"),
    (lambda: begun(task="croquet"), "task = 'croquet'"),
    (lambda: begun(task="pot"), "task = 'pot' with n_players = 2: expected one of 'straight'"),
    (lambda: begun(task="eight_ball", n_object_balls=9), "9 object balls and 6 pockets: expected 15 object balls"),
    (lambda: begun(task="eight_ball", n_players=3), "n_players = 3"),
    (lambda: begun(n_players=1), "n_players = 1: expected 2 to 4"),
    (lambda: make_env(task="snooker"), "task = 'snooker' with n_players = 1: expected n_players = 2"),
    (lambda: make_env(target=3), "target = 3 with n_players = 1: expected None"),
    (lambda: begun(layout="line"), "layout = 'line'"),
    (lambda: begun(max_shots=0), "max_shots = 0"),
    (lambda: begun(task="carom", can_call=True), "can_call = True with task = 'carom'"),
    (lambda: begun(can_call=1), "can_call = 1"),
    (lambda: begun(task="eight_ball", can_call=True, action="plan"), "can_call = True with action = 'plan'"),
    (lambda: begun(task="snooker", miss=True), "miss = True with can_call = False"),
    (lambda: begun(max_speed=0), "max_speed = 0"),
    (lambda: begun(render_mode="ansi"), "render_mode = 'ansi'"),
    (lambda: begun({"position": []}), "did you mean 'positions'"),
    (lambda: begun({"state": {"player": 1}}), r"options\['state'\] without options\['positions'\]: expected both"),
    (lambda: begun([1]), r"options = \[1\]: expected a dict", TypeError),
    (lambda: begun().step(None), r"action has shape .*: expected \(4,\)|action = .*: expected finite numbers"),
    (lambda: begun().step(np.zeros(3)), r"action has shape \(3,\): expected \(4,\)"),
    (lambda: begun().step(np.full(4, np.nan)), "action = .*: expected finite numbers"),
    (lambda: billiards_v0.raw_env("nine_ball").history(), "no game has begun"),
    (lambda: billiards_v0.env(task="carom").agents, "before reset", AttributeError),
]


@refusals("call", CALLS)
def test_wrong_calls(call, message, kind):
    with pytest.raises(kind, match=message):
        call()
