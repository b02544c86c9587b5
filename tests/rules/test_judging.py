"""Arrays of states and of facts. Tests of `games` judge them."""

import numpy as np
import pytest

from billiards_env.games import RuleState
from billiards_env.games.judging import ball_set, balls_of, state_array
from billiards_env.rules import CALL, FACTS, FOULS, STATE, Counts, facts_of_shots, judge_shots


def test_the_fields_of_arrays_are_those_of_one_shot():
    state = RuleState(1, (3, 5, 8), frozenset({0, 2, 4}), fouls=(0, 2, 1))
    row = state_array([state])[0]
    assert (row.player, row.n_players, row.scores.tolist()) == (1, 3, [3, 5, 8, 0])
    assert (row.object_balls, row.fouls, row.break_shot) == (0b10100, 2, True)
    assert balls_of(ball_set([3, 1, 3])) == (1, 3)


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
    states, calls = state_array([RuleState(0, (0, 0), frozenset(range(16)), False)] * 2), np.zeros(2, CALL)
    facts = np.zeros(2, FACTS)
    facts["potted"], facts["cushion_after"], facts["first"] = 1 << 2 | 1 << 11, True, [1 << 3, 1 << 12]
    assert judge_shots("eight_ball", states, facts, calls)["solids"].tolist() == [0, 1]
    facts["first_potted"] = [1 << 11, 1 << 2]
    assert judge_shots("eight_ball", states, facts, calls)["solids"].tolist() == [1, 0]


def test_wrong_arrays_are_refused():
    states, facts, calls = np.zeros(2, STATE), np.zeros(2, FACTS), np.zeros(3, CALL)
    with pytest.raises(ValueError, match=r"lengths \(2, 2, 3\): expected one length"):
        judge_shots("carom", states, facts, calls)
    with pytest.raises(ValueError, match="game = 'croquet': expected one of"):
        judge_shots("croquet", states, facts, calls[:2])
    assert [FOULS[k] for k in judge_shots("nine_ball", states, facts, calls[:2])["foul"]] == ["no_hit"] * 2
