"""Many shots are judged as one shot is."""

import numpy as np
import pytest

from billiards_env.games import RULES, Call, Stroke, opening, play
from billiards_env.games.batch import best_call, judge_batch, play_batch
from billiards_env.games.judging import state_array, verdict_of
from tests.helpers.games import setup

CASES = {f"{rules} {layout}": (rules, layout, {}) for rules in RULES for layout in (RULES[rules].layouts[0], "random")}
CASES |= {
    "called eight ball": ("eight_ball", "random", {"call_shot": True}),
    "called straight pool": ("straight", "random", {"call_shot": True}),
    "the second cue ball of carom": ("carom", "random", {"cue_balls": (2, 0), "player": 1}),
    "two object balls": ("eight_ball", "random", {"on_table": frozenset({0, 3, 8}), "solids": 0}),
}


def shots(m, seed=0):
    rng = np.random.default_rng(seed)
    angles, speeds = rng.uniform(-np.pi, np.pi, m), rng.uniform(0.5, 5.0, m)
    spins = rng.uniform(-50.0, 50.0, (m, 3))
    return speeds[:, None] * np.column_stack((np.cos(angles), np.sin(angles))), spins


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


@pytest.mark.parametrize("case", CASES)
def test_a_batch_has_the_verdicts_of_single_shots(case):
    rules, layout, state = CASES[case]
    settings = setup(rules, call_shot=state.get("call_shot", False))
    game = opening(settings, np.random.default_rng(1), layout)
    game = game._replace(state=game.state._replace(**{"in_hand": "no", **state}))  # a break with the cue ball in place
    velocities, spins = shots(400 if state else 60)
    verdicts = judge_batch(settings, game, velocities, spins)
    found = [verdict_of(row, highest_first=rules == "snooker") for row in verdicts]
    assert found == one_by_one(settings, game, velocities, spins)
    assert not state or any(verdict.continues for verdict in found)


@pytest.mark.parametrize("rules", ["nine_ball", "eight_ball", "snooker", "carom"])
def test_a_batch_has_the_next_states_and_positions_of_single_shots(rules):
    settings = setup(rules)
    game = opening(settings, np.random.default_rng(1), "random")
    velocities, spins = shots(150)
    places = np.repeat(game.positions[None, 0], 150, axis=0)
    places[:, 1] += np.linspace(-1e-3, 1e-3, 150)
    played = play_batch(settings, game, velocities, spins, places)
    pots = 0
    for k, place in enumerate(places):
        positions = game.positions.copy()
        positions[0] = place
        stroke = Stroke(tuple(velocities[k].tolist()), spin=tuple(spins[k].tolist()))
        after = play(settings, game._replace(positions=positions), stroke).game
        expected = state_array([after.state])[0]
        for name in set(expected.dtype.names) - {"fouls", "free_ball"}:
            np.testing.assert_array_equal(played.states[k][name], expected[name], name)
        still = sorted(after.state.on_table - ({0} if after.state.in_hand != "no" else set()))
        np.testing.assert_array_equal(played.positions[k][still], after.positions[still])
        pots += len(after.state.on_table) < settings.scene.n_balls
    assert pots > 0 or rules == "carom"


def test_a_call_counts_if_its_ball_drops_in_its_pocket():
    settings = setup("straight", 2, call_shot=True)
    game = opening(settings, np.random.default_rng(1), "random")
    velocities, _ = shots(3000)
    exact = play_batch(settings, game, velocities)
    called = np.flatnonzero(exact.verdicts["points"] > 0)[:4]
    assert len(called) == 4
    for k in called.tolist():
        found = play(settings, game, Stroke(tuple(velocities[k].tolist()))).facts
        calls = [[found.potted[0], found.pockets[0]], [found.potted[0], (found.pockets[0] + 1) % 6], [-1, -1]]
        three = play_batch(settings, game, np.repeat(velocities[k, None], 3, 0), calls=np.array(calls))
        assert three.verdicts["continues"].tolist() == [True, False, False]
        call = Call(calls[0][0], calls[0][1])
        assert play(settings, game, Stroke(tuple(velocities[k].tolist()), call=call)).verdict.continues
