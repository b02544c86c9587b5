"""Many games at once have the results of single games."""

from typing import Any

import numpy as np
import pytest

from billiards_env.games import CALL, CALLS, GAMES, opening
from billiards_env.games.playing import opening_state
from billiards_env.games.turn import next_games
from tests.helpers.games import setup

COUNT = 40


def games(rules):
    """Returns the settings of a game, and positions, states, facts and calls of random shots and choices."""
    rng, settings = np.random.default_rng(0), setup(rules)
    n = settings.scene.n_balls
    positions = np.array([opening(settings, rng, "random").positions for _ in range(COUNT)])
    states: Any = np.array([opening_state(settings)] * COUNT)
    facts: Any = np.zeros(COUNT, GAMES[rules].facts_type)
    calls: Any = np.zeros(COUNT, CALL)
    states["break_shot"] = rng.random(COUNT) < 0.1
    facts["potted"] = rng.integers(1, 2**n, COUNT) & rng.integers(1, 2**n, COUNT) & states["object_balls"]
    facts["first"], facts["scratch"] = 1 << rng.integers(1, n, COUNT), rng.random(COUNT) < 0.3
    calls["ball"], calls["pocket"] = -1, -1
    calls["kind"] = rng.choice([CALLS.index(kind) for kind in ("shot", "shot", *GAMES[rules].choices)], COUNT)
    return settings, (positions, states, facts, calls)


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
