"""Arrays of shots are judged as single shots are."""

import numpy as np
import pytest

from billiards_env.games import RULES, Call, RuleState
from billiards_env.games.judging import (
    ball_set,
    balls_of,
    call_array,
    fact_array,
    facts_of,
    state_array,
    verdict_of,
)
from billiards_env.rules import CALL, FACTS, FOULS, GAMES, STATE, Counts, facts_of_shots, judge_shots, legal_balls
from tests.helpers.games import events


def random_state(name, rng):
    rules = RULES[name]
    n, players = 1 + rules.n_object_balls[1], int(rng.integers(rules.n_players[0], rules.n_players[1] + 1))
    lying = {0, (rules.deciding_ball or 1) % n, *np.flatnonzero(rng.random(n) < rng.random()).tolist()}
    return RuleState(
        player=int(rng.integers(players)),
        scores=tuple(rng.integers(0, 20, players).tolist()),
        on_table=frozenset(lying if rules.pockets else range(n)),
        break_shot=bool(rng.random() < 0.3),
        cue_balls=rules.cue_balls if rng.random() < 0.5 else rules.cue_balls[::-1],
        solids=int(rng.integers(-1, 2)) if name == "eight_ball" else -1,
        target=int(rng.choice([0, 10, 60])),
        call_shot=bool(rng.random() < 0.5) and rules.call_kernel is not None,
        reds=15 if name == "snooker" else 0,
        fouls=tuple(rng.integers(0, 3, players).tolist()),
        colour=name == "snooker" and bool(rng.random() < 0.4),
        free_ball=name == "snooker" and bool(rng.random() < 0.3),
    )


def random_facts(name, state, rng):
    cue, table, rows = state.cue_balls[0], set(state.on_table), []
    for _ in range(int(rng.integers(8))):
        kind = str(rng.choice(["hit", "cushion", "pocket"] if RULES[name].pockets else ["hit", "cushion"]))
        ball = int(rng.choice(sorted(table)))
        if kind == "hit" and {cue} < table:
            ball = int(rng.choice(sorted(table - {cue})))
            rows.append((kind, cue, ball))
        elif kind != "hit" and (kind == "cushion" or len(table) > 1):
            rows.append((kind, ball, int(rng.integers(6))))
            table -= {ball} if kind == "pocket" else set()
    return facts_of(events(*rows, times=np.cumsum(rng.integers(0, 2, len(rows)))), cue)


def random_call(state, facts, rng):
    kind = str(rng.choice(["shot", "shot", "safety", "push_out"]))
    if facts.potted and rng.random() < 0.7:
        return Call(facts.potted[-1], facts.pockets[-1], kind)
    return Call(int(rng.choice([-1, *sorted(state.object_balls)])), int(rng.integers(-1, 6)), kind)


@pytest.mark.parametrize("name", GAMES)
def test_games_in_different_states_are_judged_as_one_by_one(name):
    rng, rules = np.random.default_rng(3), RULES[name]
    states = [random_state(name, rng) for _ in range(1000)]
    facts = [random_facts(name, state, rng) for state in states]
    calls = [random_call(state, found, rng) for state, found in zip(states, facts, strict=True)]
    verdicts = judge_shots(name, state_array(states), fact_array(facts), call_array(calls, facts))
    singles = [rules.judge(*shot) for shot in zip(states, facts, calls, strict=True)]
    assert [verdict_of(row, highest_first=name == "snooker") for row in verdicts] == singles
    assert len(set(singles)) > (1 if rules.pockets else 2)
    for found, verdict in zip(facts, singles, strict=True):
        assert verdict.in_hand == "no" or verdict.foul or verdict.spotted
        assert verdict.winner < 0 or verdict.over
        assert not (verdict.foul and verdict.points > 0)
        assert set(verdict.spotted) <= {*found.potted, 21}  # in snooker the black after a tie
    players = np.array([len(state.scores) - 1 for state in states])
    legal = legal_balls(name, state_array(states), players)
    assert [frozenset(balls_of(int(balls))) for balls in legal] == [
        rules.legal(state, int(player)) for state, player in zip(states, players, strict=True)
    ]


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
