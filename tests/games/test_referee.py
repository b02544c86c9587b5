"""Arrays of states and of facts, and rows in words."""

import numpy as np
import pytest

from billiards_env.games import CALL, FACTS, FOULS, STATE, to_dict
from billiards_env.games.facts import Counts, facts_of_shots
from billiards_env.games.referee import play
from billiards_env.games.state import State, changed, members, row, set_of
from tests.helpers.games import state


def test_a_row_in_words():
    made = state("carom", on_table=(0, 2), players=3, scores=(3, 5, 8), cue_balls=(2, 0), in_hand="anywhere")
    found = to_dict(changed(made, choices=0b1000))
    assert (found["player"], found["scores"], found["fouls"], found["cue_balls"]) == (0, (3, 5, 8), (0, 0, 0), (2, 0))
    assert (found["object_balls"], found["on_table"], found["in_hand"]) == ((0,), (0, 2), "anywhere")
    assert (found["choices"], found["break_shot"], made.choices) == (("hand_back",), False, 0)
    assert to_dict(row(State()))["cue_balls"] == (0,)
    assert members(set_of([3, 1, 3])) == (1, 3)


def test_the_facts_of_counted_shots():
    """Shot 0 pots balls 7 and 0 after a hit; shot 1 touches nothing; in shot 2 ball 5 was off the table before."""
    before, after = np.zeros((3, 3), bool), np.zeros((3, 3), bool)
    after[0, [0, 2]] = before[2, 1] = after[2, 1] = True
    cushions, before_hit = np.zeros((3, 3), np.int32), np.full((3, 3), -1, np.int32)
    cushions[0], before_hit[0] = (4, 1, 0), (-1, 1, 3)
    cushions[1, 0] = 2
    cushions[2, 0], before_hit[2, 2] = 1, 1
    counts = Counts(before, after, cushions, before_hit, np.array([1, -1, 2]), 1 << np.array([0, 5, 7]))
    facts = facts_of_shots(counts)
    assert facts["first"].tolist() == [1 << 5, 0, 1 << 7]
    assert facts["touched"].tolist() == [2, 0, 1]
    assert facts["cushions_before_last"].tolist() == [3, 0, 1]
    assert facts["potted"].tolist() == [1 << 7, 0, 0]
    assert facts["driven"].tolist() == [1 << 5 | 1 << 7, 0, 0]
    assert facts["scratch"].tolist() == [True, False, False]
    assert facts["cushion_after"].tolist() == [True, False, False]
    assert facts["cue_driven"].tolist() == [True, True, True]
    assert not facts["first_potted"].any()


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
