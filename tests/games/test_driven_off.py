"""Balls driven off the table: the rules on facts alone, and a game in a scene with flight."""

import numpy as np
import pytest

from billiards_env import Scene
from billiards_env.games import Setup, Stroke, opening, play, referee
from billiards_env.games.game_state import set_of
from tests.helpers.games import one_shot, state, words

BLUE, BLACK = 19, 21
BREAK = {"break_shot": True}
GROUP = {"solids": 0}

CASES = [
    # the game, its state, the ball that is driven off, then: penalty or points, what is spotted, in hand, winner
    ("nine_ball", {}, 4, 0, (), "anywhere", -1),  # WPA 2.6, 6.5
    ("nine_ball", {}, 9, 0, (9,), "anywhere", -1),
    ("ten_ball", {}, 10, 0, (10,), "anywhere", -1),  # WPA 9.9
    ("eight_ball", GROUP, 3, 0, (), "anywhere", -1),  # WPA 3.7: it stays off
    ("eight_ball", GROUP, 8, 0, (), "anywhere", 1),  # WPA 3.8 d
    ("eight_ball", BREAK, 3, 0, (), "behind", -1),  # WPA 3.3 g
    ("eight_ball", BREAK, 8, 0, (8,), "behind", -1),
    ("straight", {}, 3, -1, (3,), "no", -1),  # WPA 4.6, 4.9
    ("one_pocket", {}, 3, -1, (3,), "no", -1),
    ("bank_pool", {}, 3, -1, (3,), "no", -1),
    ("blackball", GROUP, 3, 0, (3,), "no", -1),
    ("blackball", GROUP, 8, 0, (), "no", 1),
    ("snooker", {}, 5, 4, (), "no", -1),  # WPBSA 3.10 b: reds stay off
    ("snooker", {}, BLUE, 5, (BLUE,), "no", -1),
    ("snooker", {"colour": True}, BLACK, 7, (BLACK,), "no", -1),
    ("carom", {}, 1, 0, (1,), "no", -1),  # UMB, art. 28
]


@pytest.mark.parametrize("case", CASES)
def test_a_ball_driven_off_the_table_is_a_foul(case):
    rules, fields, ball, points, spotted, in_hand, winner = case
    before = state(rules, **fields)
    first = before.object_balls & -before.object_balls if not fields.get("colour") else 1 << BLUE
    after, verdict = judged(rules, before, first=first, driven_off=1 << ball, cushion_after=True, driven=30)
    assert (verdict.foul, verdict.points + verdict.penalty, verdict.spotted) == ("driven_off", points, spotted)
    assert (after.in_hand, after.winner, verdict.continues) == (in_hand, winner, False)
    assert (ball in after.on_table) == (ball in spotted)


@pytest.mark.parametrize("rules", ["nine_ball", "eight_ball", "straight", "blackball", "snooker"])
def test_a_cue_ball_driven_off_the_table_is_a_scratch(rules):  # WPA 6.1, WPBSA 3.10 a
    first = set_of([1])
    after, verdict = judged(rules, state(rules), first=first, cue_off=True, cushion_after=True, cue_driven=True)
    assert (verdict.foul, after.in_hand != "no") == ("scratch", True)


def test_a_cue_ball_that_flies_off_the_table_gives_ball_in_hand():
    setup = Setup("nine_ball", Scene.named("jump_pool", 9))
    game = opening(setup, np.random.default_rng(0))
    played = play(setup, game, Stroke((3.0, 3.0, 3.0), (-0.7, 0.0)))
    assert played.shot.potted[0]
    assert played.shot.pockets[0] < 0
    assert (words(played.verdict).foul, words(played.game.state).in_hand) == ("scratch", "anywhere")


def judged(rules, before, **facts):
    """Returns the state after a shot and the verdict, in words."""
    (after,), (verdict,) = referee.judge_shots(rules, *one_shot(rules, before, **facts))
    return words(after), words(verdict)
