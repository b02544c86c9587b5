"""Arrays of states and of facts, and rows in words."""

import numpy as np
import pytest

from billiards_env.games import CALL, FACTS, FOULS, STATE
from billiards_env.games.referee import play
from tests.helpers.games import state


def test_a_shot_without_a_known_order_of_pots_chooses_the_group_that_was_touched_first():
    states, calls = np.array([state("eight_ball")] * 2, STATE), np.zeros(2, CALL)
    facts = np.zeros(2, FACTS)
    facts["potted"], facts["cushion_after"], facts["first"] = 1 << 2 | 1 << 11, True, [1 << 3, 1 << 12]
    assert play("eight_ball", states, facts, calls)[0]["solids"].tolist() == [0, 1]
    facts["first_potted"] = [1 << 11, 1 << 2]
    assert play("eight_ball", states, facts, calls)[0]["solids"].tolist() == [1, 0]


def test_wrong_arrays_are_refused():
    states, facts, calls = np.zeros(2, STATE), np.zeros(2, FACTS), np.zeros(3, CALL)
    with pytest.raises(ValueError, match=r"lengths \(2, 2, 3\): expected one length"):
        play("carom", states, facts, calls)
    with pytest.raises(ValueError, match="game = 'croquet': expected one of"):
        play("croquet", states, facts, calls[:2])
    states["n_players"] = 2
    assert [FOULS[k] for k in play("nine_ball", states, facts, calls[:2])[1]["foul"]] == ["no_hit"] * 2
    assert not states["player"].any()  # the states before the shots do not change
    states["player"] = [1, 2]
    with pytest.raises(ValueError, match=r"player = .*2.* of .* players: expected 0 to the number less 1"):
        play("nine_ball", states, facts, calls[:2])
