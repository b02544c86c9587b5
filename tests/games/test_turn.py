"""Many games at once have the results of single games."""

from typing import Any

import numpy as np
import pytest

from billiards_env.games import GAMES, Call, opening
from billiards_env.games.game_state import changed
from billiards_env.games.playing import opening_state
from billiards_env.games.referee import first_state
from billiards_env.games.turn import next_games
from tests.helpers.games import one_call, setup

COUNT = 40


def games(rules):
    """Returns the settings of a game, and positions, states, facts and calls of random shots."""
    rng, settings = np.random.default_rng(0), setup(rules)
    n = settings.scene.n_balls
    positions = np.array([opening(settings, rng, "random").positions for _ in range(COUNT)])
    states: Any = np.array([opening_state(settings)] * COUNT)
    facts: Any = np.zeros(COUNT, GAMES[rules].facts_type)
    states["break_shot"] = rng.random(COUNT) < 0.1
    facts["potted"] = rng.integers(1, 2**n, COUNT) & rng.integers(1, 2**n, COUNT) & states["object_balls"]
    facts["first"], facts["scratch"] = 1 << rng.integers(1, n, COUNT), rng.random(COUNT) < 0.3
    return settings, (positions, states, facts, one_call().repeat(COUNT))


@pytest.mark.parametrize("rules", [name for name in GAMES if GAMES[name].pockets])
def test_games_do_not_depend_on_each_other(rules):
    settings, shots = games(rules)
    before = [array.tobytes() for array in shots]
    many = next_games(settings.game_rules, settings.scene, *shots)
    assert [array.tobytes() for array in shots] == before
    assert many[2]["spotted"].any()
    for k in range(COUNT):
        one: Any = [array[k : k + 1] for array in shots]
        single = next_games(settings.game_rules, settings.scene, *one)
        assert [array[k].tobytes() for array in many] == [array.tobytes() for array in single]


def test_calls_without_a_shot():
    rng = np.random.default_rng(0)
    now, old = rng.random((2, 7, 2)), rng.random((2, 7, 2))
    before = first_state("snooker", 7, player=1, scores=(1, 2, 0, 0), object_balls=0, reds=0, colour=True, choices=8)
    state = changed(before, player=0, scores=(1, 6, 0, 0), fouls=(0, 1, 0, 0), free_ball=True, choices=24, in_hand=1)
    calls = np.concatenate([one_call(Call(kind=kind)) for kind in ("hand_back", "replace")])
    settings, states = setup("snooker", 6), np.array([state] * 2)
    facts = np.zeros(2, GAMES["snooker"].facts_type)
    positions, states, _ = next_games(
        GAMES["snooker"], settings.scene, now, states, facts, calls, (old, np.array([before] * 2))
    )
    assert positions.tolist() == [now[0].tolist(), old[1].tolist()]
    assert states[0] == changed(state, player=1, choices=0, free_ball=False)
    assert states[1] == changed(before, scores=state.scores, fouls=state.fouls, choices=0)
