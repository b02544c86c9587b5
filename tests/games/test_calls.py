"""Calls, push outs, consecutive fouls and racks of the pool games, case by case. Numbers are rules of the WPA."""

import numpy as np
import pytest

from billiards_env.games import RULES, Call, Stroke, Verdict, custom_opening, opening, play
from billiards_env.games.judging import next_state
from billiards_env.games.placement import rack_again
from billiards_env.scene.layouts import plan
from tests.helpers.games import facts, setup, state

straight, eight_ball, nine_ball = (RULES[name].judge for name in ("straight", "eight_ball", "nine_ball"))

POT_3 = "hit 0 3, pocket 3 5"
TWO_GROUPS = "hit 0 3, pocket 3 5, pocket 9 0"
SAFETY, PUSH_OUT = Call(3, 5, "safety"), Call(kind="push_out")
FOUL = facts("cushion 0")
CALLED, SOLIDS = {"call_shot": True}, {"call_shot": True, "solids": 0}
PUSH = {"choices": ("push_out",)}


@pytest.mark.parametrize(
    ("rules", "fields", "log", "call", "verdict"),
    [
        # Eight ball: only the called ball in the called pocket continues (1.6, 3.5, 3.6).
        ("eight_ball", SOLIDS, POT_3, Call(3, 5), Verdict(continues=True, solids=0)),
        ("eight_ball", SOLIDS, POT_3, Call(3, 4), Verdict(solids=0)),
        ("eight_ball", SOLIDS, POT_3, Call(4, 5), Verdict(solids=0)),
        ("eight_ball", SOLIDS, POT_3, Call(), Verdict(solids=0)),
        ("eight_ball", SOLIDS, POT_3, SAFETY, Verdict(solids=0)),
        ("eight_ball", SOLIDS, "hit 0 3, pocket 9 0, pocket 3 5", Call(3, 5), Verdict(continues=True, solids=0)),
        ("eight_ball", SOLIDS, "hit 0 3, pocket 9 0", Call(9, 0), Verdict(solids=0)),  # 3.5: of the other group
        # The called ball decides the group (3.4).
        ("eight_ball", CALLED, TWO_GROUPS, Call(9, 0), Verdict(continues=True, solids=1)),
        ("eight_ball", CALLED, TWO_GROUPS, Call(3, 5), Verdict(continues=True, solids=0)),
        ("eight_ball", CALLED, TWO_GROUPS, Call(3, 0), Verdict()),  # the table stays open
        ("eight_ball", CALLED, TWO_GROUPS, SAFETY, Verdict()),
        ("eight_ball", {**CALLED, "break_shot": True}, POT_3, Call(), Verdict(continues=True)),  # 3.3 b
        ("eight_ball", {"solids": 0}, POT_3, Call(), Verdict(continues=True, solids=0)),  # without called shots
        # Nine ball: a push out may follow a legal break. It needs no hit and passes the turn (2.4).
        ("nine_ball", {"break_shot": True}, "hit 0 1, pocket 0 0", Call(), Verdict("scratch", in_hand="anywhere")),
        ("nine_ball", PUSH, "hit 0 1, cushion 1", Call(), Verdict()),
        ("nine_ball", PUSH, "", PUSH_OUT, Verdict(choices=("hand_back",))),
        ("nine_ball", PUSH, "hit 0 5", PUSH_OUT, Verdict(choices=("hand_back",))),
        ("nine_ball", PUSH, "hit 0 1, pocket 1 0", PUSH_OUT, Verdict(choices=("hand_back",))),
        ("nine_ball", PUSH, "hit 0 5, pocket 0 1", PUSH_OUT, Verdict("scratch", in_hand="anywhere")),
        ("nine_ball", PUSH, "hit 0 9, pocket 9 1", PUSH_OUT, Verdict(spotted=(9,), choices=("hand_back",))),  # 2.6
        # Straight pool scores only with the called ball (4.5, 4.6, 4.7). A foul costs a point (4.9).
        ("straight", CALLED, "hit 0 3, pocket 4 1, pocket 3 5", Call(3, 5), Verdict(points=2, continues=True)),
        ("straight", CALLED, "hit 0 3, pocket 4 1, pocket 3 5", Call(3, 4), Verdict(spotted=(3, 4))),
        ("straight", CALLED, "hit 0 3, pocket 4 1, pocket 3 5", Call(), Verdict(spotted=(3, 4))),
        ("straight", CALLED, "hit 0 3, pocket 4 1, pocket 3 5", SAFETY, Verdict(spotted=(3, 4))),
        ("straight", CALLED, "", Call(3, 5), Verdict("no_hit", -1)),
        ("straight", CALLED, "hit 0 3", Call(3, 5), Verdict("no_cushion", -1)),
        (
            "straight",
            CALLED,
            "hit 0 3, pocket 3 5, pocket 0 1",
            Call(3, 5),
            Verdict("scratch", -1, in_hand="behind", spotted=(3,)),
        ),
    ],
)
def test_called_shots(rules, fields, log, call, verdict):
    assert RULES[rules].judge(state(rules, **fields), facts(log), call) == verdict


@pytest.mark.parametrize(
    ("log", "call", "verdict"),
    [
        ("hit 0 1, cushion 0, cushion 2, cushion 3", Call(), Verdict()),
        ("hit 0 1, cushion 2, cushion 3", Call(), Verdict("breaking_foul", -2)),
        ("hit 0 1, cushion 0, cushion 2", Call(), Verdict("breaking_foul", -2)),
        ("hit 0 1, pocket 2 0", Call(2, 0), Verdict(points=1, continues=True)),
        ("hit 0 1, pocket 2 0", Call(2, 1), Verdict("breaking_foul", -2, spotted=(2,))),
        ("hit 0 1, pocket 0 0", Call(), Verdict("breaking_foul", -2, in_hand="behind")),
        # A potted cue ball counts as driven to a cushion (8.4).
        ("hit 0 1, cushion 2, cushion 3, pocket 0 0", Call(), Verdict("scratch", -1, in_hand="behind")),
        ("hit 0 1, cushion 0, cushion 2, cushion 3, pocket 0 0", Call(), Verdict("scratch", -1, in_hand="behind")),
    ],
)
def test_straight_pool_opening_break(log, call, verdict):  # 4.3, 4.10
    assert straight(state("straight", **CALLED, break_shot=True), facts(log), call) == verdict


def test_balls_potted_without_a_call_stay_down():  # 3.6
    before, log = state("eight_ball", **SOLIDS), facts(POT_3)
    assert 3 not in next_state(before, log, eight_ball(before, log, Call(4, 0))).on_table


@pytest.mark.parametrize(
    ("on_table", "call", "winner"),
    [
        ((8, 9), Call(8, 2), 0),
        ((8, 9), Call(8, 3), 1),  # 3.8 c
        ((8, 9), Call(), 1),
        ((8, 9), Call(8, 2, "safety"), 1),
        ((3, 8, 9), Call(8, 2), 1),  # 3.8 b
    ],
)
def test_the_eight_ball_wins_only_in_the_called_pocket(on_table, call, winner):  # 3.8
    log = facts(f"hit 0 {min(on_table)}, pocket 8 2")
    verdict = eight_ball(state("eight_ball", **SOLIDS, on_table=on_table), log, call)
    assert (verdict.over, verdict.winner) == (True, winner)


def test_a_push_out_may_follow_a_legal_break():  # 2.4
    before, legal = state("nine_ball", break_shot=True), facts("hit 0 1, pocket 4 0")
    assert next_state(before, legal, nine_ball(before, legal)).choices == ("push_out",)


def test_the_third_consecutive_foul_loses():  # 2.8, 6.14
    now = state("nine_ball", fouls=(0, 0))
    fouls = []
    for _ in range(5):  # both players foul in turn
        now = next_state(now, FOUL, nine_ball(now, FOUL))
        fouls.append(now.fouls)
    assert fouls == [(1, 0), (1, 1), (2, 1), (2, 2), (3, 2)]
    assert (now.over, now.winner) == (True, 1)
    assert not nine_ball(state("nine_ball", players=3, fouls=(2, 0, 0)), FOUL).over


@pytest.mark.parametrize(
    ("rules", "fields", "log", "fouls"),
    [
        ("nine_ball", {"fouls": (2, 1)}, "hit 0 1, cushion 1", (0, 1)),  # 6.14
        ("straight", {"fouls": (0, 0), "target": 50, "break_shot": True}, "hit 0 1", (0, 0)),  # 4.11: a breaking foul
    ],
)
def test_consecutive_fouls_are_counted(rules, fields, log, fouls):
    before = state(rules, **fields)
    assert next_state(before, facts(log), RULES[rules].judge(before, facts(log))).fouls == fouls


def test_straight_pool_the_third_consecutive_foul():  # 4.11
    before = state("straight", **CALLED, target=50, scores=(3, 9), fouls=(2, 0))
    verdict = straight(before, FOUL)
    assert verdict == Verdict("no_hit", points=-16, continues=True, in_hand="behind", rack="all")
    after = next_state(before, FOUL, verdict)
    assert (after.player, after.scores, after.fouls, after.break_shot) == (0, (-13, 9), (0, 0), True)


def test_straight_pool_is_racked_again_with_one_ball_left():  # 4.4
    before, log = state("straight", **CALLED, target=50, on_table=(3, 8)), facts(POT_3)
    assert straight(before, log, Call(3, 5)) == Verdict(points=1, continues=True, rack="rest")
    assert straight(before._replace(on_table=frozenset({0, 3, 8, 9})), log, Call(3, 5)).rack == ""
    assert straight(before._replace(scores=(49, 0)), log, Call(3, 5)).winner == 0
    assert straight(before, facts("hit 0 3, cushion 3"), Call(3, 5)).rack == ""
    assert straight(before._replace(target=0), log, Call(3, 5)).rack == ""


# On the table.

PLACES = np.array([[-0.6, 0.0], *([-0.8 + 0.16 * i, 0.3] for i in range(9))])
NINE = setup("nine_ball")


def test_a_push_out_on_the_table_can_be_handed_back():  # 2.4
    game = custom_opening(NINE, PLACES, {"choices": ["push_out"]})
    pushed = play(NINE, game, Stroke((0.0, -0.5), call=Call(kind="push_out"))).game
    assert (pushed.state.player, pushed.state.choices) == (1, ("hand_back",))
    back = play(NINE, pushed, Stroke((0.0, 0.0), call=Call(kind="hand_back")))
    assert (back.game.state.player, back.game.state.choices, back.shot.time) == (0, (), 0.0)
    assert back.game.positions.tobytes() == pushed.positions.tobytes()
    assert play(NINE, pushed, Stroke((0.5, 0.0))).game.state.player == 0  # or the player plays the shot


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (Call(kind="push_out"), "stroke.call.kind = 'push_out'"),
        (Call(kind="hand_back"), "stroke.call.kind = 'hand_back'"),
        (Call(kind="safety"), "stroke.call.kind = 'safety'"),
        (Call(kind="jump"), "stroke.call.kind = 'jump'"),
        (Call(10), "stroke.call.ball = 10"),
        (Call(1, 6), "stroke.call.pocket = 6"),
    ],
)
def test_impossible_calls_are_rejected(call, message):
    with pytest.raises(ValueError, match=message):
        play(NINE, custom_opening(NINE, PLACES), Stroke((1.0, 0.0), call=call))


def test_a_shot_that_is_handed_back_must_not_move_the_cue_ball():
    game = custom_opening(NINE, PLACES, {"choices": ["hand_back"]})
    with pytest.raises(ValueError, match="expected no motion and no place"):
        play(NINE, game, Stroke((1.0, 0.0), call=Call(kind="hand_back")))


@pytest.mark.parametrize("rules", ["nine_ball", "carom", "snooker"])
def test_only_eight_ball_and_straight_pool_are_called(rules):
    with pytest.raises(ValueError, match=f"call_shot = True with rules '{rules}'"):
        setup(rules, call_shot=True)


STRAIGHT = setup("straight", target=50, call_shot=True)
RACK = plan("tight_rack", STRAIGHT.scene).spots[1:]
HEAD = (STRAIGHT.scene.table.head_x, 0.0)
RACK_CASES = {  # (last ball, cue ball) before, and after; None for a potted ball
    "clear": (((0.2, 0.3), (0.1, 0.1)), ((0.2, 0.3), (0.1, 0.1)), "no"),
    "ball in the rack": (((0.75, 0.0), (0.1, 0.1)), (HEAD, (0.1, 0.1)), "no"),
    "ball in the rack, cue ball on the head spot": (((0.75, 0.0), (-0.63, 0.01)), ((0.0, 0.0), (-0.63, 0.01)), "no"),
    "cue ball in the rack": (((0.2, 0.3), (0.75, 0.0)), ((0.2, 0.3), None), "behind"),
    "cue ball in the rack, ball behind": (((-0.9, 0.3), (0.75, 0.0)), ((-0.9, 0.3), HEAD), "no"),
    "cue ball in the rack, ball on the head spot": (((-0.63, 0.01), (0.75, 0.0)), ((-0.63, 0.01), (0.0, 0.0)), "no"),
    "both in the rack": (((0.75, 0.0), (0.66, 0.0)), (tuple(RACK[14]), None), "behind"),
    "both potted": ((None, (0.1, 0.1)), (tuple(RACK[14]), (0.1, 0.1)), "no"),
}


@pytest.mark.parametrize("case", RACK_CASES)
def test_straight_pool_special_racking_situations(case):  # 4.8
    (last, cue), (last_after, cue_after), in_hand = RACK_CASES[case]
    positions = np.zeros((16, 2))
    positions[15], positions[0] = last or (0.0, 0.0), cue
    on_table = {0, 15} if last else {0}
    assert rack_again(STRAIGHT.scene, positions, on_table, 0) == in_hand
    assert positions[15] == pytest.approx(last_after)
    assert cue_after is None or positions[0] == pytest.approx(cue_after)
    full = "potted" in case or "both" in case
    assert positions[1:15].tolist() == (RACK[:14] if full else RACK[1:]).tolist()


def test_straight_pool_a_rack_on_the_table():
    positions = np.array([[0.97, 0.335], *([-1.1 + 0.12 * i, 0.5] for i in range(15))])
    positions[3] = 1.07, 0.435
    positions[8] = 0.2, -0.4
    game = custom_opening(STRAIGHT, positions, {"on_table": [0, 3, 8], "scores": [14, 2]})
    played = play(STRAIGHT, game, Stroke((1.0, 0.99), call=Call(3, 3)))
    assert (played.facts.potted, played.facts.pockets, played.verdict.rack) == ((3,), (3,), "rest")
    state = played.game.state
    assert (state.player, state.scores, len(state.on_table), state.break_shot) == (0, (15, 2), 16, False)
    assert played.game.positions[8].tolist() == [0.2, -0.4]


def test_straight_pool_three_fouls_on_the_table():
    game = opening(STRAIGHT, np.random.default_rng(0), "random")
    for k in range(5):  # both players miss all balls; the first one commits the third foul
        verdict, game = (lambda played: (played.verdict, played.game))(play(STRAIGHT, game, Stroke((0.0, 0.0))))
        assert (verdict.foul, game.state.player) == ("no_hit", (k + 1) % 2 if k < 4 else 0)
    assert (game.state.break_shot, game.state.in_hand, game.state.scores) == (True, "behind", (-18, -2))
    assert game.positions[1:].tolist() == RACK.tolist()
