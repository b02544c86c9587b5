from typing import Any

import numpy as np
import pytest

from billiards_env.games import GAMES, Stroke
from billiards_env.play import labels
from billiards_env.play import model as actions
from billiards_env.players.planner import Plan

EIGHT = [[0.0, 0.0], *([-1.0 + 0.12 * i, 0.5 if i % 2 else -0.5] for i in range(15))]
SNOOKER = [[0.0, 0.0], *([-1.5 + 0.12 * i, 0.5] for i in range(21))]
CAROM = [[-0.5, 0.3], [0.5, 0.0], [-0.5, 0.0]]


PROMPTS = [
    ("eight_ball", {"break_shot": True}, "break"),
    ("eight_ball", {}, "open table: any ball but the 8"),
    ("eight_ball", {"solids": 0}, "solids"),
    ("eight_ball", {"solids": 1}, "stripes"),
    ("eight_ball", {"solids": 0, "on_table": [0, 8, 9, 10]}, "on: the 8"),
    ("nine_ball", {"on_table": [0, 4, 7, 9]}, "on: the 4"),
    ("straight", {}, "any ball"),
    ("blackball", {"free_ball": True}, "free shot, any ball"),
    ("one_pocket", {}, "any ball into the lower right pocket"),
    ("snooker", {"break_shot": True}, "on: red"),
    ("snooker", {"colour": True}, "on: a colour"),
    ("snooker", {"on_table": [0, *range(17, 22)]}, "on: green"),
    ("snooker", {"free_ball": True}, "free ball, any ball"),
    ("snooker", {"in_hand": "behind"}, "cue ball in the D"),
    ("nine_ball", {"in_hand": "behind"}, "cue ball behind the line"),
    ("nine_ball", {"in_hand": "anywhere"}, "cue ball anywhere"),
    ("carom", {}, "white cue ball, red and yellow"),
    ("three_cushion", {"cue_balls": [2, 0]}, "yellow cue ball, white and red, 3 cushions"),
    ("three_cushion", {"break_shot": True}, "white cue ball, red first, 3 cushions"),
]


@pytest.mark.parametrize(("rules", "state", "words"), PROMPTS)
def test_the_prompt_uses_the_words_of_the_game(rules, state, words, make_model):
    balls = {"snooker": SNOOKER, "nine_ball": EIGHT[:10], "carom": CAROM, "three_cushion": CAROM}.get(rules, EIGHT)
    assert labels.status(make_model(rules, balls, state)) == f"Player 1: {words}"


def test_the_prompt_has_the_calls_and_the_choices(make_model):
    snooker = actions.next_called(make_model("snooker", SNOOKER, {"colour": True}), "ball")
    assert labels.on(snooker) == "on: a colour: yellow"
    model = make_model("eight_ball", EIGHT, call_shot=True)
    assert (labels.button(model), labels.choice(model)) == ("Shoot", "X: safety")
    model = actions.next_kind(make_model("nine_ball", EIGHT[:10], {"choices": ["push_out"]}, choices=True))
    assert labels.status(model) == "Player 1: push out, any ball or none"
    assert (labels.button(model), labels.choice(model)) == ("Push out", "X: shot")


def test_the_best_considered_shot_is_named(make_model):
    plan = Plan(Stroke((2.0, 0.0)), 0.31, 0.62, 1, 2, np.zeros((3, 2)), 40)
    model = actions.consider(make_model(players=("program", "human")), [plan])
    best = "best: ball 1 into the lower right pocket, 62%, value +0.31 in 40 strokes with noise"
    assert (labels.key_hint(model), labels.value(plan)) == (best, "62%  +0.31")


def test_cushions_are_counted(make_model):
    start = actions.change_speed(make_model("three_cushion", CAROM), 4.0)
    counts = set()
    for degrees in range(0, 360, 5):
        model: Any = actions.go(actions.turn_aim(start, degrees))
        facts = model.last_shot.facts
        if facts.touched == 2:
            counts.add(int(facts.cushions_before_last))
            assert labels.cushions(model).split()[0] == str(facts.cushions_before_last)
    assert len(counts) > 1
    model = actions.go(actions.look_at(make_model("three_cushion", [[0.0, 0.3], *CAROM[1:]]), (0.0, 0.5)))
    assert labels.status(actions.tick(model, 0.3)) == "Player 1   1 cushion"


def test_the_result_of_a_shot(make_model):
    model = make_model(positions=[[0.97, 0.335], [1.07, 0.435], [-0.5, 0.0]], target=3)
    assert labels.result(model) == "0 : 0"
    potted = actions.go(actions.go(model))
    assert labels.result(potted) == "potted 1   1 : 0"
    missed = actions.go(actions.go(actions.turn_aim(potted, 90.0)))
    assert labels.result(missed) == "foul: no hit   0 : 0"
    given = make_model("one_pocket", [[0.97, 0.335], [1.07, 0.435], [-0.5, 0.0]])
    assert labels.result(actions.go(actions.go(given))) == "potted 1   0 : 1"
    snooker = actions.look_at(make_model("snooker", SNOOKER, {}, choices=True, miss=True), (0.3, -0.5))
    assert labels.result(actions.go(actions.go(snooker))) == "foul and a miss: no hit, 4 points   0 : 4"


def test_each_game_has_a_page_of_rules(make_model):
    assert all(len(labels.rules_page(make_model(rules).setup, choices=False)) > 2 for rules in GAMES)
    snooker = labels.rules_page(make_model("snooker", miss=True).setup, choices=True)
    assert {"choice", "miss"} <= {row[0] for row in snooker}
    assert "calls" in dict(labels.rules_page(make_model("straight", call_shot=True).setup, choices=False))


def test_each_player_has_a_label(make_model):
    players = "search:500", "my.own:geometric", "planner:club", "planner:1s"
    model = make_model(players=players)
    for k, label in enumerate(("search", "geometric", "club", "planner")):
        assert labels.player_name(model, k) == f"Player {k + 1} ({label})"


def test_a_replay_shows_the_engines(make_model):
    model = actions.repeat(actions.go(make_model()))
    assert labels.key_hint(model).startswith("balls: PIC   rings: PIT, dt = 1/60 s")
    assert labels.key_hint(actions.toggle(model, "ghost")).startswith("balls: PIC   continue")


def test_minus_zero_is_not_shown(make_model):
    assert labels.aim_text(make_model(positions=[*EIGHT[:1], [0.5, -1e-9]])) == "2.00 m/s   0.00°"
