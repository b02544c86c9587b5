"""One-pocket, case by case. Numbers are those of the rules of OnePocket.org (2005)."""

import dataclasses
from typing import Any

import numpy as np
import pytest

from billiards_env import Scene
from billiards_env.games import Stroke, custom_opening, play
from tests.helpers.games import facts_in_words, in_a_row, judge, ruling, setup, state, words

BEHIND: dict[str, Any] = {"in_hand": "behind"}
LEGAL = "hit 0 3, cushion 3"
POTTED = set(range(4, 16))  # the balls on the table; 1, 2 and 3 are potted


def test_facts_of_the_foot_corners():
    facts = facts_in_words("hit 0 1, pocket 1 2, pocket 4 3, pocket 5 2, pocket 6 1, pocket 0 3")
    assert (facts.foot_right, facts.foot_left, facts.potted) == ((1, 5), (4,), (1, 4, 5, 6))


VERDICTS = [
    ({}, LEGAL, ruling()),
    # Only a ball in the own pocket scores and continues (3.1): pocket 2 of player 0, and pocket 3 of player 1.
    ({}, "hit 0 3, pocket 3 2", ruling(points=1, continues=True)),
    ({"player": 1}, "hit 0 3, pocket 3 3", ruling(points=1, continues=True)),
    ({}, "hit 0 3, hit 3 5, pocket 5 2, pocket 9 2", ruling(points=2, continues=True)),
    ({}, "hit 0 3, pocket 3 3", ruling(penalty=1)),
    ({"player": 1}, "hit 0 3, pocket 3 2", ruling(penalty=1)),
    ({}, "hit 0 3, pocket 3 2, pocket 4 3", ruling(points=1, penalty=1, continues=True)),
    # Balls in the other four pockets are spotted (1).
    ({}, "hit 0 3, pocket 3 0", ruling(spotted=(3,))),
    ({}, "hit 0 3, pocket 3 2, pocket 4 1, pocket 5 5", ruling(points=1, continues=True, spotted=(4, 5))),
    # The break needs what every shot needs (2.2), and may touch a cushion first.
    ({"break_shot": True}, "cushion 0, hit 0 1, cushion 1", ruling()),
    ({"break_shot": True}, "hit 0 1", ruling("no_cushion", -1)),
    ({"break_shot": True}, "hit 0 1, pocket 0", ruling("scratch", -1, **BEHIND)),
    # A foul costs a point; a player who has one spots a ball (6.2). The cue ball stays, except after a scratch (6.3).
    ({}, "", ruling("no_hit", -1)),
    ({"on_table": {0, *POTTED}, "scores": (2, 1)}, "", ruling("no_hit", -1, spotted=(1,))),
    ({"on_table": {0, *POTTED}, "scores": (0, 3)}, "", ruling("no_hit", -1)),
    ({"scores": (1, 0)}, "", ruling("no_hit", -1)),  # of a state with all balls on the table
    ({}, "hit 0 3, pocket 3 2, pocket 0", ruling("scratch", -1, **BEHIND, spotted=(3,))),
    ({}, "hit 0 3, pocket 3 3, pocket 0", ruling("scratch", -1, **BEHIND, spotted=(3,))),
    # Without a hit a ball moves only if it touches another that the cue drives. The ball counts for its owner.
    ({}, "pocket 3 3, pocket 4 2", ruling("no_hit", -1, penalty=1, spotted=(4,))),
    # Owed balls are spotted as they score (6.4), for either player.
    ({"scores": (-1, 0)}, "hit 0 3, pocket 3 2", ruling(points=1, continues=True, spotted=(3,))),
    ({"scores": (-1, 0)}, "hit 0 3, pocket 5 2, pocket 3 2", ruling(points=2, continues=True, spotted=(3,))),
    ({"scores": (-2, 0)}, "hit 0 3, pocket 5 2, pocket 3 2", ruling(points=2, continues=True, spotted=(3, 5))),
    ({"scores": (0, -1)}, "hit 0 3, pocket 3 3", ruling(penalty=1, spotted=(3,))),
    ({"scores": (-1, 0)}, "", ruling("no_hit", -1)),
    ({"scores": (7, 7), "target": 0}, "hit 0 3, pocket 3 2", ruling(points=1, continues=True)),
    ({"fouls": (2, 0), "target": 0}, "", ruling("no_hit", -1)),
]


@pytest.mark.parametrize(("fields", "log", "verdict"), VERDICTS)
def test_verdicts(fields, log, verdict):
    assert judge("one_pocket", state("one_pocket", **{"target": 8, **fields}), log)[1] == verdict


ENDS = [
    ({"scores": (7, 3)}, "hit 0 4, pocket 4 2", 0),
    ({"scores": (7, 3)}, "hit 0 4, pocket 4 2, pocket 9 2", 0),
    ({"scores": (3, 7)}, "hit 0 4, pocket 4 3", 1),
    ({"scores": (7, 7)}, "hit 0 4, pocket 4 3, pocket 5 2", 0),  # 3.2
    ({"scores": (7, 7), "player": 1}, "hit 0 4, pocket 4 3, pocket 5 2", 1),
    ({"scores": (7, 7)}, "pocket 5 2, pocket 4 3", 1),  # with a foul
    ({"fouls": (2, 0), "scores": (7, 0)}, "", 1),  # 7
    ({"fouls": (0, 2), "player": 1}, "hit 0 4", 0),
    ({"on_table": (0, 4), "scores": (3, 2), "target": 0}, "hit 0 4, pocket 4 3", -1),
    ({"on_table": (0, 4), "scores": (3, 3), "target": 9}, "hit 0 4, pocket 4 3", 1),
]


@pytest.mark.parametrize(("fields", "log", "winner"), ENDS)
def test_the_end_of_a_game(fields, log, winner):
    verdict = judge("one_pocket", state("one_pocket", **{"target": 8, **fields}), log)[1]
    assert (verdict.over, verdict.winner) == (True, winner)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("rules", ["one_pocket", "bank_pool"])
def test_the_balls_off_the_table_are_the_points_above_zero(rules, seed):
    rng, now = np.random.default_rng(seed), state(rules, target=8)
    for _ in range(200):
        if now.over:
            break
        lying = rng.permutation(words(now).object_balls).tolist()
        cushion = [f"cushion {lying[0]}"] * (rng.random() < 0.7)
        pots = [f"pocket {ball} {rng.integers(6)}" for ball in lying[: rng.integers(3)]]
        scratch = ["pocket 0"] * (rng.random() < 0.2)
        now, _ = judge(rules, now, ", ".join((f"hit 0 {lying[0]}", *cushion, *pots, *scratch)))
        scores = words(now).scores
        assert len(words(now).object_balls) == 15 - sum(max(score, 0) for score in scores)
    assert now.over
    assert max(words(now).scores) >= 8 or max(words(now).fouls) == 3


def test_the_default_target_is_more_than_half_of_the_balls():
    assert [setup("one_pocket", balls).target for balls in (3, 9, 15)] == [2, 5, 8]


def test_a_shot_scores_in_the_pocket_of_its_player():
    settings = setup("one_pocket", 3)
    places = in_a_row(4, {0: (0.97, 0.335), 1: (1.07, 0.435)})
    points = []
    for player, side in ((0, 1), (1, 1), (0, -1), (1, -1)):
        game = custom_opening(settings, places * (1, side), {"player": player})
        verdict = play(settings, game, Stroke((0.7, 0.7 * side))).verdict
        points.append((int(verdict.points), int(verdict.penalty), bool(verdict.continues)))
    assert points == [(0, 1, False), (1, 0, True), (1, 0, True), (0, 1, False)]


def test_other_pockets_in_the_foot_corners_are_refused():
    scene = Scene.named("pool", 3)
    for pockets in (scene.table.pockets[::-1], scene.table.pockets[:3]):
        table = dataclasses.replace(scene.table, pockets=pockets)
        with pytest.raises(ValueError, match="rules = 'one_pocket' with a table of other pockets 2 and 3: expected"):
            setup("one_pocket", scene=dataclasses.replace(scene, table=table))
