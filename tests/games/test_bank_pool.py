"""Bank pool, case by case. Numbers are those of the rules of OnePocket.org (2006)."""

from types import SimpleNamespace
from typing import Any

import pytest

from billiards_env.games import GAMES, Call
from billiards_env.games.facts import facts_of_shots
from billiards_env.players.batch import best_call
from tests.helpers.games import facts_in_words, judge, record_of, ruling, setup, state

BEHIND: dict[str, Any] = {"in_hand": "behind"}
CALLED = {"call_shot": True}
BANK = "hit 0 3, cushion 3, pocket 3 5"
POINT = ruling(points=1, continues=True)

LOGS = [
    ("hit 0 3, cushion 3, cushion 4, pocket 3, pocket 5, pocket 4", {"banked": (3,)}),
    ("cushion 0, cushion 0, hit 0 3, cushion 3, hit 0 4, pocket 3", {"banked": (), "cushions_before_last": 2}),
    ("cushion 0", {"banked": ()}),
]


@pytest.mark.parametrize(("log", "expected"), LOGS)
def test_facts(log, expected):
    facts = facts_in_words(log)
    assert {name: getattr(facts, name) for name in expected} == expected


VERDICTS = [
    ({}, "hit 0 3, cushion 3", ruling()),
    # A ball that hits a cushion before the pot scores (1, 3.2). Others are spotted.
    ({}, BANK, POINT),
    ({}, "hit 0 3, cushion 3, cushion 3, pocket 3", POINT),
    ({}, "hit 0 3, pocket 3", ruling(spotted=(3,))),
    ({}, f"{BANK}, pocket 4", ruling(points=1, continues=True, spotted=(4,))),
    ({}, "cushion 0, hit 0 3, cushion 3, pocket 3", ruling(spotted=(3,))),  # a kick
    ({}, "hit 0 4, hit 4 3, cushion 3, pocket 3", ruling(spotted=(3,))),  # a combination
    ({}, "hit 0 4, hit 0 3, cushion 3, pocket 3", ruling(spotted=(3,))),  # a carom
    # On the break potted balls do not score, and the shooter continues (2.1). It has no requirement (2.2).
    ({"break_shot": True}, BANK, ruling(continues=True, spotted=(3,))),
    ({"break_shot": True}, "hit 0 1, cushion 1", ruling()),
    # The called ball scores in the called pocket (3.1).
    (CALLED, BANK, POINT, Call(3, 5)),
    (CALLED, BANK, ruling(spotted=(3,)), Call(3, 4)),
    (CALLED, BANK, ruling(spotted=(3,)), Call(4, 5)),
    (CALLED, BANK, ruling(spotted=(3,))),
    (CALLED, BANK, ruling(spotted=(3,)), Call(3, 5, "safety")),
    (CALLED, "hit 0 3, pocket 3 5", ruling(spotted=(3,)), Call(3, 5)),
    # A foul costs a point and a ball; a player without a point owes it (11).
    ({}, "", ruling("no_hit", -1)),
    ({}, "hit 0 3", ruling("no_cushion", -1)),
    ({"on_table": {0, *range(3, 16)}, "scores": (2, 0)}, "", ruling("no_hit", -1, spotted=(1,))),
    ({"on_table": {0, *range(3, 16)}, "scores": (0, 2)}, "", ruling("no_hit", -1)),
    ({}, f"{BANK}, pocket 0", ruling("scratch", -1, **BEHIND, spotted=(3,))),
    ({"break_shot": True}, "hit 0 1, pocket 1, pocket 0", ruling("scratch", -1, **BEHIND, spotted=(1,))),
    ({"scores": (-1, 0)}, BANK, ruling(points=1, continues=True, spotted=(3,))),
    ({"scores": (0, -1)}, BANK, POINT),
    ({"fouls": (2, 0), "target": 0}, "", ruling("no_hit", -1)),
]


@pytest.mark.parametrize("case", VERDICTS)
def test_verdicts(case):
    fields, log, verdict, *call = case
    assert judge("bank_pool", state("bank_pool", **{"target": 8, **fields}), log, *call)[1] == verdict


def test_one_of_two_banks_scores():
    before, log = state("bank_pool", target=8), "hit 0 5, hit 0 3, cushion 5, cushion 3, pocket 5 1, pocket 3 4"
    record = record_of(log, times=[1.0, 1.0, 2.0, 2.0, 3.0, 3.0])
    assert judge("bank_pool", before, record)[1] == ruling(points=1, continues=True, spotted=(5,))
    called = state("bank_pool", target=8, call_shot=True)
    assert judge("bank_pool", called, record, Call(5, 1))[1] == ruling(points=1, continues=True, spotted=(3,))


ENDS = [
    ({"scores": (7, 3)}, BANK, 0),
    ({"scores": (7, 3), "player": 1, "fouls": (0, 2)}, "", 0),
    ({"on_table": (0, 3), "scores": (3, 2), "target": 0}, BANK, 0),
    ({"on_table": (0, 3), "scores": (3, 4), "target": 0}, BANK, -1),
]


@pytest.mark.parametrize(("fields", "log", "winner"), ENDS)
def test_the_end_of_a_game(fields, log, winner):
    verdict = judge("bank_pool", state("bank_pool", **{"target": 8, **fields}), log)[1]
    assert (verdict.over, verdict.winner) == (True, winner)


def test_the_usual_games_end_at_five_of_nine_and_eight_of_fifteen():
    assert [setup("bank_pool", balls).target for balls in (9, 15)] == [5, 8]


def test_the_call_that_a_player_does_not_choose_is_that_of_the_bank():
    record = record_of("hit 0 5, pocket 1 0, cushion 5, pocket 5 2")
    played: Any = SimpleNamespace(facts=facts_of_shots(GAMES["bank_pool"].facts, record)[0], pots=((1, 0), (5, 2)))
    assert best_call(setup("bank_pool"), state("bank_pool", call_shot=True), played) == Call(5, 2)
    assert best_call(setup("straight"), state("straight", call_shot=True), played) == Call(1, 0)
