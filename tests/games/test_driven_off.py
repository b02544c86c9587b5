"""Balls driven off the table: the rules on facts alone, and games in scenes with flight."""

import numpy as np
import pytest

from billiards_env import Scene, billiards_v0
from billiards_env.envs import make_env, make_vector_env
from billiards_env.games import FOULS, GAMES, NO_CALL, Call, Setup, Stroke, opening, play, referee
from billiards_env.games.game_state import is_in, on_table, set_of
from billiards_env.games.turn import next_games
from billiards_env.scene import check_positions
from tests.helpers.games import flying, one_shot, setup, state, words

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


@pytest.mark.parametrize("rules", ["nine_ball", "ten_ball"])
def test_a_push_out_may_not_drive_a_ball_off_the_table(rules):  # WPA 2.4, 9.4: only 6.2 and 6.3 are suspended
    before, call = state(rules, choices=("push_out",), fouls=(2, 0)), Call(kind="push_out")
    after, verdict = judged(rules, before, call, first=1 << 5, driven_off=1 << 5)
    assert (verdict.foul, after.in_hand, after.choices, after.winner) == ("driven_off", "anywhere", (), 1)


STRUCK_0, STRUCK_2 = {}, {"player": 1, "cue_balls": (2, 0)}
SCENE = setup("carom").scene
HEAD, FOOT, CENTRE = (SCENE.table.head_x, 0.0), (SCENE.table.foot_x, 0.0), (0.0, 0.0)
START = (SCENE.table.head_x, -0.1825)
SET_UP = [
    # the game, its state, the balls that are driven off, then: the place of each ball; None for one that stays
    ("carom", STRUCK_0, {"driven_off": 2}, [HEAD, FOOT, START]),
    ("carom", STRUCK_2, {"cue_off": True}, [START, FOOT, HEAD]),
    ("three_cushion", STRUCK_0, {"driven_off": 2}, [None, FOOT, None]),
    ("three_cushion", STRUCK_0, {"driven_off": 4}, [None, None, HEAD]),  # the next player strikes this ball
    ("three_cushion", STRUCK_0, {"cue_off": True}, [CENTRE, None, None]),
    ("three_cushion", STRUCK_2, {"driven_off": 3}, [HEAD, FOOT, None]),
]


@pytest.mark.parametrize("case", SET_UP)
def test_a_ball_of_carom_driven_off_the_table_is_set_up_again(case):  # UMB, art. 28, paper F
    rules, fields, facts, places = case
    positions = np.array([[-0.3, 0.2], [0.4, 0.3], [0.5, -0.4]])
    (after,), (now,), (verdict,) = next_games(
        GAMES[rules], SCENE, positions[None], *one_shot(rules, state(rules, **fields), **facts)
    )
    expected = [positions[ball] if place is None else place for ball, place in enumerate(places)]
    np.testing.assert_allclose(after, expected)
    assert (words(verdict).foul, now.player, words(now).on_table) == ("driven_off", 1 - len(fields) // 2, (0, 1, 2))


def test_a_spot_of_three_cushion_may_be_blocked_twice():  # paper F
    positions = np.array([FOOT, [9.0, 0.0], CENTRE])  # the next cue ball, 2, is on the spot of ball 0
    before = state("three_cushion")
    (after,), _, _ = next_games(
        GAMES["three_cushion"], SCENE, positions[None], *one_shot("three_cushion", before, driven_off=2)
    )
    np.testing.assert_allclose(after, [FOOT, HEAD, CENTRE])


@pytest.mark.parametrize(("rules", "edition"), [(name, one) for name in GAMES for one in GAMES[name].editions])
def test_every_state_of_a_game_with_flight_can_be_set(rules, edition):
    arguments = {**flying(rules), "edition": edition}
    env, envs, game = make_env(**arguments), make_vector_env(2, **arguments), billiards_v0.raw_env(**arguments)
    for one in (env, envs, game):
        one.reset(seed=1)
    rng, fouls, settings = np.random.default_rng(0), [], game.setup
    for _ in range(40):
        before = env.game
        target = before.positions[rng.choice(settings.legal(before.state))]
        away = target - before.positions[before.state.cue_balls[0]]
        action = rng.uniform(-1.0, 1.0, env.action_space.shape).astype(np.float32)
        action[:2] = away / np.hypot(*away) * rng.uniform(0.2, 1.0)
        game.step(action)
        envs.step(np.tile(action, (2, 1)))
        *_, over, _, info = env.step(action)
        fouls.append(FOULS[info["foul"]])
        assert game.env.get_state().tobytes() == env.get_state().tobytes()
        if over:
            break
        for one in (env, envs, game.env):
            one.set_state(one.get_state())
        state = env.game.state
        check_positions(env.scene, env.game.positions, in_play=is_in(on_table(state), env.scene.n_balls))
    assert settings.game_rules.pockets or "driven_off" in fouls


def judged(rules, before, call=NO_CALL, **facts):
    """Returns the state after a shot and the verdict, in words."""
    (after,), (verdict,) = referee.judge_shots(rules, *one_shot(rules, before, call, **facts))
    return words(after), words(verdict)
