"""Many shots are judged as one shot is."""

import numpy as np
import pytest

from billiards_env.games import RULES, Stroke, Verdict, custom_opening, opening, play
from billiards_env.games.batch import best_call, judge_batch
from billiards_env.games.judging import verdict_of
from tests.helpers.games import setup

GAMES = [(rules, layout) for rules, game in RULES.items() for layout in (game.layouts[0], "random")]


def make_game(rules, layout, call_shot=False):
    settings = setup(rules, call_shot=call_shot)
    game = opening(settings, np.random.default_rng(1), layout)
    # A break shot with the cue ball on the table
    return settings, game._replace(state=game.state._replace(in_hand="no"))


def shots(m, seed=0):
    rng = np.random.default_rng(seed)
    angles, speeds = rng.uniform(-np.pi, np.pi, m), rng.uniform(0.5, 5.0, m)
    spins = rng.uniform(-50.0, 50.0, (m, 3))
    return speeds[:, None] * np.column_stack((np.cos(angles), np.sin(angles))), spins


def judged(settings, game, velocities, spins):
    verdicts = judge_batch(settings, game, velocities, spins)
    return [verdict_of(row, highest_first=settings.rules == "snooker") for row in verdicts]


def one_by_one(settings, game, velocities, spins):
    verdicts = []
    for velocity, spin in zip(velocities.tolist(), spins.tolist(), strict=True):
        stroke = Stroke(tuple(velocity), spin=tuple(spin))
        if settings.call_shot:
            found = play(settings, game, stroke).facts
            by_number = sorted(zip(found.potted, found.pockets, strict=True))
            numbered = found._replace(potted=[b for b, _ in by_number], pockets=[p for _, p in by_number])
            stroke = stroke._replace(call=best_call(settings.game_rules, game.state, numbered))
        verdicts.append(play(settings, game, stroke).verdict)
    return verdicts


@pytest.mark.parametrize(("rules", "layout"), GAMES)
def test_a_batch_has_the_verdicts_of_single_shots(rules, layout):
    settings, game = make_game(rules, layout)
    velocities, spins = shots(60)
    assert judged(settings, game, velocities, spins) == one_by_one(settings, game, velocities, spins)


@pytest.mark.parametrize("rules", ["eight_ball", "straight"])
def test_potted_balls_are_called(rules):
    settings, game = make_game(rules, "random", call_shot=True)
    velocities, spins = shots(400)
    found = judged(settings, game, velocities, spins)
    assert found == one_by_one(settings, game, velocities, spins)
    assert any(verdict.continues for verdict in found)


def test_the_second_cue_ball_of_carom_is_struck():
    settings, game = make_game("carom", "random")
    game = game._replace(state=game.state._replace(cue_balls=(2, 0), player=1))
    velocities, spins = shots(300)
    found = judged(settings, game, velocities, spins)
    assert found == one_by_one(settings, game, velocities, spins)
    assert Verdict(points=1, continues=True) in found


def test_balls_that_are_not_on_the_table_are_not_potted():
    settings, game = make_game("eight_ball", "random")
    game = custom_opening(settings, game.positions, {"on_table": [0, 3, 8], "solids": 0})
    velocities, spins = shots(200)
    assert judged(settings, game, velocities, spins) == one_by_one(settings, game, velocities, spins)
