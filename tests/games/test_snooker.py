"""Snooker, case by case. Numbers are rules of section 3 of the WPBSA's Official Rules."""

import math

import numpy as np
import pytest

from billiards_env import Scene, games
from billiards_env.games import Call, Setup, Stroke, custom_opening, opening, play
from billiards_env.games.game_state import changed, set_of
from billiards_env.games.placement import SPOT_GAP
from billiards_env.games.snooker import points_left
from billiards_env.games.turn import next_games
from billiards_env.players.batch import play_batch
from billiards_env.scene.layouts import layout_plan
from tests.helpers.games import judge, one_shot, record_of, ruling, state, words

YELLOW, GREEN, BROWN, BLUE, PINK, BLACK = range(16, 22)
COLOURS = tuple(range(16, 22))
SCENE = Scene.named("snooker")
SETUP = Setup("snooker", SCENE)
SPOTS = layout_plan("snooker", SCENE).spots
R = SCENE.balls.radius[0]


def frame(**fields):
    return state("snooker", **fields)


def snooker(before, log, *call):
    """Returns the ruling on a shot."""
    return judge("snooker", before, log, *call)[1]


def after(before, log, *call):
    """Returns the state after a shot."""
    return judge("snooker", before, log, *call)[0]


def balls_on(state, player=None):
    return set(SETUP.legal(state, player))


def pot(ball):
    """Returns the events of a shot that hits and pots a ball."""
    return f"hit 0 {ball}, pocket {ball}"


# Balls on.


BALLS_ON = [
    ({}, 0, set(range(1, 16))),
    ({"colour": True}, 0, set(COLOURS)),
    ({"colour": True}, 1, set(range(1, 16))),  # a red after a turn
    ({"on_table": COLOURS}, 0, {YELLOW}),
    ({"on_table": (BLUE, PINK, BLACK)}, 0, {BLUE}),
    ({"on_table": COLOURS, "colour": True}, 0, set(COLOURS)),  # after the last red
    ({"free_ball": True}, 0, set(range(1, 22))),
]


@pytest.mark.parametrize(("fields", "player", "on"), BALLS_ON)
def test_the_balls_on(fields, player, on):  # 3.3
    assert balls_on(frame(**fields), player) == on


# Shots without a foul.

FREE, LAST_THREE = {"free_ball": True}, {"free_ball": True, "on_table": (BLUE, PINK, BLACK)}


def scored(points, *spotted, colour=False):
    return ruling(points=points, continues=True, spotted=spotted, colour=colour)


WITHOUT_FOUL = [
    ({}, pot(4), scored(1, colour=True)),  # 3.3 d
    ({}, f"{pot(4)}, pocket 9", scored(2, colour=True)),
    ({}, "hit 0 3", ruling()),  # a miss needs no cushion
    ({"colour": True}, f"hit 0 {BLUE}", ruling()),
    ({"on_table": (BLACK,)}, f"hit 0 {BLACK}", ruling()),
    # A colour scores its value and is spotted (3.3 e).
    *(({"colour": True}, pot(ball), scored(ball - 14, ball)) for ball in COLOURS),
    ({"colour": True}, pot(BLUE), scored(BLUE - 14, BLUE), Call(BLUE)),
    # A free ball counts as a red and is spotted (3.12 a, c, e), or scores the value of the ball on (3.12 a, d, e).
    (FREE, "hit 0 1", ruling()),
    (FREE, pot(1), scored(1, colour=True)),
    (FREE, pot(GREEN), scored(1, GREEN, colour=True)),
    (FREE, pot(GREEN), scored(1, GREEN, colour=True), Call(GREEN)),
    (FREE, f"{pot(GREEN)}, pocket 4", scored(2, GREEN, colour=True)),
    (LAST_THREE, pot(BLACK), scored(5, BLACK)),
    (LAST_THREE, f"hit 0 {BLACK}, pocket {BLUE}", scored(5)),
    (LAST_THREE, f"hit 0 {BLACK}, pocket {BLUE}, pocket {BLACK}", scored(5, BLACK)),
]


@pytest.mark.parametrize("case", WITHOUT_FOUL)
def test_shots_without_a_foul(case):
    fields, log, verdict, *call = case
    assert snooker(frame(**fields), log, *call) == verdict


def test_the_colour_after_the_last_red_is_spotted_and_the_yellow_follows():  # 3.3 e, f
    now = after(frame(on_table=(7, *COLOURS)), pot(7))
    assert balls_on(now, 0) == set(COLOURS)
    assert snooker(now, pot(BLACK)) == scored(7, BLACK)
    assert balls_on(after(now, pot(BLACK)), 0) == {YELLOW}


def test_the_colours_are_potted_in_order_and_stay_down():  # 3.3 f
    now = frame(on_table=COLOURS)
    for value, ball in enumerate(COLOURS[:-1], start=2):
        now, verdict = judge("snooker", now, pot(ball))
        assert verdict == scored(value)
    assert words(now).object_balls == (BLACK,)


# Fouls.


FOULS = [
    ({}, "", Call(), "no_hit", 4),  # 3.10 a
    ({}, "hit 0 1, pocket 0", Call(), "scratch", 4),
    ({}, f"hit 0 {YELLOW}", Call(), "wrong_ball", 4),
    ({}, f"hit 0 {BLUE}", Call(), "wrong_ball", 5),  # 3.10 b
    ({}, f"hit 0 {BLACK}, pocket 0", Call(), "scratch", 7),
    ({}, f"hit 0 1, pocket {PINK}", Call(), "wrong_pot", 6),
    ({}, f"{pot(1)}, pocket {GREEN}", Call(), "wrong_pot", 4),
    ({}, f"hit 0 {BLUE}, pocket {BLACK}", Call(), "wrong_ball", 7),
    ({"colour": True}, f"hit 0 {BLUE}, pocket 0", Call(), "scratch", 5),
    ({"colour": True}, f"hit 0 {YELLOW}, pocket 0", Call(), "scratch", 4),
    ({"colour": True}, f"hit 0 {BLUE}, pocket 3", Call(), "wrong_pot", 5),
    ({"colour": True}, f"hit 0 {BLUE}", Call(PINK), "wrong_ball", 6),
    ({"colour": True}, f"hit 0 {BLACK}", Call(PINK), "wrong_ball", 7),
    ({"colour": True}, f"hit 0 {PINK}, pocket {BLUE}", Call(PINK), "wrong_pot", 6),
    ({"colour": True}, "", Call(YELLOW), "no_hit", 4),
    ({"colour": True}, "", Call(), "no_hit", 7),  # 3.10 d: a foul before a colour is nominated
    ({"colour": True}, "hit 0 3", Call(), "wrong_ball", 7),  # 3.10 d: two reds in succession
    ({"on_table": (PINK, BLACK)}, "", Call(), "no_hit", 6),
    ({"on_table": (PINK, BLACK)}, f"hit 0 {PINK}, pocket {BLACK}", Call(), "wrong_pot", 7),
    ({"on_table": (BROWN, BLUE, PINK, BLACK)}, f"hit 0 {BLUE}", Call(), "wrong_ball", 5),
    ({"free_ball": True}, "hit 0 1", Call(BLUE), "wrong_ball", 4),  # 3.12 b: the nominated ball first
    ({"free_ball": True}, "", Call(), "no_hit", 4),
]


@pytest.mark.parametrize(("fields", "log", "call", "foul", "penalty"), FOULS)
def test_fouls_and_their_values(fields, log, call, foul, penalty):
    in_hand = "behind" if foul == "scratch" else "no"
    verdict = snooker(frame(**fields), log, call)
    spotted = verdict.spotted
    assert verdict == ruling(foul, penalty=penalty, in_hand=in_hand, choices=("hand_back",), spotted=spotted)


def test_after_a_foul():  # 3.3 h, 3.7, 3.10: reds stay down, colours are spotted, the other player has the penalty
    log = f"hit 0 {BLUE}, pocket 2, pocket {BLUE}, pocket {BLACK}"
    now, verdict = judge("snooker", frame(scores=(10, 20)), log)
    assert verdict.spotted == (BLUE, BLACK)
    assert (now.player, words(now).scores, words(now).on_table) == (1, (10, 27), (0, 1, *range(3, 22)))


@pytest.mark.parametrize("fields", [{"colour": True}, {"on_table": (BLUE, PINK, BLACK)}])
def test_the_colour_that_is_on_is_spotted_after_a_foul(fields):  # 3.7
    verdict = snooker(frame(**fields), f"{pot(BLUE)}, pocket 0")
    assert (verdict.foul, verdict.penalty, verdict.spotted) == ("scratch", 5, (BLUE,))


def test_balls_touched_at_the_same_instant():  # 3.6
    def both(a, b):
        return record_of(f"hit 0 {a}, hit 0 {b}", times=[1.0, 1.0])

    assert snooker(frame(), both(1, 2)).foul == ""
    assert snooker(frame(), both(1, PINK)) == ruling("wrong_ball", penalty=6, choices=("hand_back",))
    assert snooker(frame(colour=True), both(PINK, BLUE)) == ruling("wrong_ball", penalty=7, choices=("hand_back",))
    assert snooker(frame(free_ball=True), both(1, PINK), Call(PINK)).foul == ""


def test_a_free_ball_lasts_for_one_shot():
    assert not after(frame(free_ball=True), "hit 0 1").free_ball


# A ball that touches the cue ball (3.8): the player plays away from it without moving it.

RED_TOUCHES, BLUE_TOUCHES = {"touching": (3,)}, {"touching": (BLUE,)}
PINK_TOUCHES = {"colour": True, "touching": (PINK,)}
TOUCHING = [
    (RED_TOUCHES, "", Call(), "", 0),  # 3.8 c (i)
    (RED_TOUCHES, f"hit 0 {BLUE}", Call(), "", 0),
    (RED_TOUCHES, "cushion 0, hit 0 3", Call(), "", 0),
    (RED_TOUCHES, "hit 0 3", Call(), "push", 4),  # 3.8 b
    (RED_TOUCHES, f"hit 0 {BLUE}, pocket {BLUE}", Call(), "wrong_pot", 5),
    (RED_TOUCHES, "pocket 0", Call(), "scratch", 4),
    (BLUE_TOUCHES, "", Call(), "no_hit", 4),  # 3.8 d
    (BLUE_TOUCHES, "hit 0 1", Call(), "", 0),
    (BLUE_TOUCHES, f"hit 0 {BLUE}", Call(), "push", 5),  # 3.10 b
    (PINK_TOUCHES, "", Call(), "", 0),
    (PINK_TOUCHES, "", Call(PINK), "", 0),  # 3.8 c (ii)
    (PINK_TOUCHES, f"hit 0 {BLUE}", Call(BLUE), "", 0),  # 3.8 c (iii)
    (PINK_TOUCHES, "", Call(BLUE), "no_hit", 5),
    (PINK_TOUCHES, f"hit 0 {PINK}", Call(), "push", 6),
    ({"free_ball": True, "touching": (GREEN,)}, "", Call(), "", 0),
]


@pytest.mark.parametrize(("fields", "log", "call", "foul", "penalty"), TOUCHING)
def test_a_touching_ball(fields, log, call, foul, penalty):
    verdict = snooker(frame(**fields), log, call)
    assert (verdict.foul, verdict.penalty) == (foul, penalty)
    assert foul != "" or not is_miss(frame(**fields), log, call)


def test_a_red_is_potted_after_playing_away_from_a_touching_red():  # 3.8 c
    assert snooker(frame(**RED_TOUCHES), pot(4)) == scored(1, colour=True)


# The end of the frame: at the first pot or foul on the last black (3.4 a), or at the target score.

LAST, TO_40 = {"on_table": (BLACK,)}, {"target": 40}


ENDS = [
    (LAST, (50, 40), pot(BLACK), 0),
    (LAST, (40, 46), pot(BLACK), 0),
    (LAST, (30, 46), pot(BLACK), 1),
    (LAST, (50, 40), "", 0),
    (LAST, (43, 40), "", 1),
    (LAST, (50, 40), f"{pot(BLACK)}, pocket 0", 0),
    (TO_40, (39, 0), pot(4), 0),
    (TO_40, (0, 36), "", 1),
    (TO_40, (39, 36), "", 1),
    (TO_40, (38, 35), "", -1),
]


@pytest.mark.parametrize(("fields", "scores", "log", "winner"), ENDS)
def test_the_end_of_the_frame(fields, scores, log, winner):
    verdict = snooker(frame(**fields, scores=scores), log)
    assert (verdict.over, verdict.winner) == (winner >= 0, winner)


@pytest.mark.parametrize(("scores", "log"), [((40, 47), pot(BLACK)), ((47, 40), "")])
def test_after_a_tie_the_black_is_spotted(scores, log):  # 3.4 b
    now, verdict = judge("snooker", frame(on_table=(BLACK,), scores=scores), log)
    assert (verdict.over, verdict.spotted, verdict.in_hand) == (False, (BLACK,), "behind")
    assert verdict.choices == ("hand_back",)
    assert (words(now).scores, words(now).object_balls, now.player) == ((47, 47), (BLACK,), 1)
    assert snooker(now, pot(BLACK)).winner == 1
    assert snooker(now, "").winner == 0


def test_points_left():
    left = points_left.py_func  # pyright: ignore[reportFunctionMemberAccess]
    assert left(set_of(range(1, 22)), 15, False) == 147 == SETUP.game_rules.most_points(21)
    assert left(set_of((1, *COLOURS)), 15, False) == 35
    assert left(set_of(COLOURS), 15, True) == 34
    assert left(set_of((PINK, BLACK)), 15, False) == 13
    assert left(set_of(range(1, 7)), 0, False) == 27 == SETUP.game_rules.most_points(6)


# Spotting colours.


def next_game(positions, before, **facts):
    """Returns the positions and the state after a shot with some facts."""
    arrays = one_shot("snooker", before, **facts)
    (positions,), (state,), _ = next_games(SETUP.game_rules, SCENE, positions[None], *arrays)
    return positions, state


def spot(balls, reds):
    """Returns the places of balls that are spotted after a foul with reds at given places, m."""
    positions = np.full((22, 2), -1.0)
    positions[1 : 1 + len(reds)] = reds
    before = frame(on_table=[*range(1, 1 + len(reds)), *balls])
    return next_game(positions, before, potted=set_of(balls), scratch=True)[0][list(balls)]


SPOTTED = [
    (COLOURS, (), COLOURS),  # 3.7 a
    ((YELLOW,), (YELLOW,), (BLACK,)),  # 3.7 e: the highest free spot
    ((YELLOW,), (YELLOW, BLACK, PINK), (BLUE,)),
    ((YELLOW, BLUE), (YELLOW, BLUE), (PINK, BLACK)),  # 3.7 f: the colour of the highest value is first
    ((PINK,), (1,), (PINK,)),  # 3.7 i: the first red at the start does not touch the pink
]


@pytest.mark.parametrize(("spotted", "blocked", "places"), SPOTTED)
def test_a_colour_is_placed_on_its_spot_or_the_highest_free_one(spotted, blocked, places):
    assert spot(spotted, SPOTS[list(blocked)]).tolist() == SPOTS[list(places)].tolist()


def test_without_a_free_spot_a_colour_goes_towards_the_top_cushion():  # 3.7 g
    ((x, y),) = spot((YELLOW,), SPOTS[16:])
    assert y == SPOTS[YELLOW][1]
    assert x == pytest.approx(SPOTS[YELLOW][0] + 2 * R + SPOT_GAP, abs=1e-12)


def test_without_room_above_its_spot_the_black_goes_below():  # 3.7 h
    above = [SPOTS[BLACK] + [(k + 1) * 2.2 * R, 0.0] for k in range(5)]
    (place,) = spot((BLACK,), [*SPOTS[16:], *above])
    assert place == pytest.approx((SPOTS[BLACK][0] - 2 * R - SPOT_GAP, 0.0), abs=1e-12)


# The cue ball in the D.


# Snookered after a foul.


def positions_of(**places):
    """Returns positions with the balls at given places, and the balls."""
    positions = np.zeros((22, 2))
    names = {"cue": 0, "red": 1, "red2": 2, "green": GREEN, "blue": BLUE, "pink": PINK, "black": BLACK}
    for name, place in places.items():
        positions[names[name]] = place
    return positions, frozenset(names[name] for name in places)


def is_hidden(positions, balls, **facts):
    """Returns whether the cue ball is snookered after a foul in a frame with these balls."""
    return bool(next_game(positions, frame(on_table=balls), **facts)[1].free_ball)


SNOOKERS = [
    ({"red": (1.0, 0.0)}, False),
    ({"red": (1.0, 0.0), "blue": (0.5, 0.0)}, True),
    ({"red": (1.0, 0.0), "blue": (0.5, 0.06)}, True),  # the left edge is covered
    ({"red": (1.0, 0.0), "blue": (0.5, 0.08)}, False),
    ({"red": (1.0, 0.0), "blue": (1.2, 0.0)}, False),  # behind the red
    ({"red": (1.0, 0.0), "blue": (-0.2, 0.0)}, False),
    ({"red": (1.0, 0.0), "red2": (0.0, 0.5), "blue": (0.5, 0.0)}, False),  # the other red is clear
    ({"red": (1.0, 0.0), "red2": (0.5, 0.0), "blue": (0.0, 0.5)}, False),  # a red does not hide a red
    ({"red": (2 * R, 0.0), "blue": (0.0, 2.1 * R)}, False),  # touching
]


@pytest.mark.parametrize(("places", "snookered"), SNOOKERS)
def test_a_snooker_hides_an_edge_of_every_ball_on(places, snookered):  # section 2, 17
    positions, balls = positions_of(cue=(0.0, 0.0), **places)
    assert is_hidden(positions, balls) == snookered


def around(place, angle, distance):
    """Returns the point at a distance and an angle from a place."""
    return place[0] + distance * math.cos(angle), place[1] + distance * math.sin(angle)


EDGE = math.asin(2 * R / 0.6)
"""The angle between the paths to the middle and to an edge of a red at a distance of 0.6 m."""


FROZEN = [
    (0.6, math.pi, False),  # behind the path
    (0.6, 0.0, True),  # in front of the red
    (0.6, 1.0, True),  # covers the left edge
    (0.6, EDGE + math.pi / 2, False),  # next to the path
    (0.6, EDGE + math.pi / 2 - 1e-4, True),
    (2 * R, math.pi / 2, False),  # the red touches the cue ball
]


@pytest.mark.parametrize(("distance", "blue", "snookered"), FROZEN)
def test_a_ball_frozen_to_the_cue_ball_obstructs_only_paths_towards_it(distance, blue, snookered):  # section 2, 17
    """The result is the same in mirrored layouts and with coordinates changed by one ulp."""
    cue, rng = (0.1, -0.2), np.random.default_rng(0)
    for angle in 2 * math.pi * np.arange(250) / 250:
        places = {"red": around(cue, angle, distance), "blue": around(cue, angle + blue, 2 * R)}
        positions, balls = positions_of(cue=cue, **places)
        layouts = [positions, positions * (-1, 1), positions * (1, -1), -positions]
        layouts += [np.nextafter(positions, rng.choice((-9.0, 9.0), positions.shape)) for _ in range(4)]
        assert {is_hidden(layout, balls) for layout in layouts} == {snookered}, angle


def test_a_cue_ball_in_hand_is_rarely_snookered():  # 3.12
    positions, balls = positions_of(cue=(-0.5, 0.0), red=(1.0, 0.0), blue=(-0.2, 0.0))
    assert is_hidden(positions, balls)
    assert not is_hidden(positions, balls, scratch=True)


def lying(places, setup=SETUP, **fields):
    """Returns a state of the game with these balls and the black on their places."""
    positions, balls = positions_of(**places)
    positions[16:] = np.where(positions[16:] == 0.0, SPOTS[16:], positions[16:])
    return custom_opening(setup, positions, {"on_table": sorted(balls | set(COLOURS)), **fields})


HIDDEN = {"cue": (0.4, 0.5), "red": (1.5, 0.5), "blue": (0.9, 0.5)}


def test_a_foul_that_leaves_a_snooker_gives_a_free_ball():  # 3.12
    played = play(SETUP, lying(HIDDEN), Stroke((0.0, 0.0)))
    now = words(played.game.state)
    assert (words(played.verdict).foul, now.free_ball, now.player, now.choices) == ("no_hit", True, 1, ("hand_back",))
    back = play(SETUP, played.game, Stroke((0.0, 0.0), call=Call(kind="hand_back"))).game.state
    assert (back.player, back.free_ball) == (0, False)  # 3.12 f
    assert not play(SETUP, lying(HIDDEN | {"blue": (0.9, -0.5)}), Stroke((0.0, 0.0))).game.state.free_ball


@pytest.mark.parametrize(("velocity", "foul"), [((-0.5, 0.0), ""), ((0.0, 0.5), ""), ((0.5, 0.0), "push")])
def test_a_cue_ball_that_touches_a_red_is_played_away_from_it(velocity, foul):  # 3.8
    game = lying({"cue": (0.4, 0.5), "red": (0.4 + 2 * R, 0.5)})
    assert words(game.state).touching == (1,)
    played = play(SETUP, game, Stroke(velocity))
    assert (words(played.verdict).foul, words(played.game.state).touching) == (foul, ())


# The foul for a snooker behind the free ball (3.12 b).

ONE_RED = {"cue": (0.0, 0.0), "red": (1.0, 0.0), "blue": (0.5, 0.0)}
BEHIND_FREE_BALL = [
    (ONE_RED, BLUE, True),
    (ONE_RED | {"pink": (0.0, 0.5)}, PINK, False),  # another ball
    (ONE_RED | {"blue": (0.5, 0.2)}, BLUE, False),
    (ONE_RED | {"red2": (0.0, 0.5)}, BLUE, False),
    (ONE_RED | {"green": (0.3, 0.0)}, BLUE, False),  # the green is nearer and snookers as well
    (ONE_RED | {"green": (0.7, 0.0)}, BLUE, True),
]


@pytest.mark.parametrize(("places", "ball", "foul"), BEHIND_FREE_BALL)
def test_a_snooker_behind_the_free_ball_is_a_foul(places, ball, foul):  # 3.12 b
    positions, balls = positions_of(**places)
    before = frame(free_ball=True, on_table=balls)
    arrays = one_shot("snooker", before, Call(ball), first=1 << ball, cushion_after=True)
    _, (state,), (verdict,) = next_games(SETUP.game_rules, SCENE, positions[None], *arrays)
    assert arrays[1]["hidden"].tolist() == [foul]
    assert (words(verdict).foul, verdict.penalty) == (("free_ball", 4) if foul else ("", 0))
    assert (bool(state.free_ball), words(state).choices) == ((True, ("hand_back",)) if foul else (False, ()))


def test_pink_and_black_alone_may_be_snookered_behind_the_free_ball():  # 3.12 b
    positions = SPOTS.copy()
    positions[[0, BLACK, PINK]] = [[0.0, 0.0], [0.5, 0.0], [1.0, 0.0]]
    game = custom_opening(SETUP, positions, {"on_table": [0, PINK, BLACK], "free_ball": True})
    assert words(play(SETUP, game, Stroke((0.05, 0.0), call=Call(BLACK))).verdict).foul != "free_ball"


# The miss rule.


MISS = Setup("snooker", SCENE, miss=True)


MISSES = [
    ({}, "", True),
    ({}, "pocket 0", True),  # a scratch does not hide the miss
    ({}, f"hit 0 {YELLOW}", True),
    ({}, f"hit 0 {YELLOW}, pocket 0", True),
    ({}, f"hit 0 {YELLOW}, pocket {BLUE}", True),
    ({}, "hit 0 1, pocket 0", False),
    ({}, f"hit 0 1, pocket {BLUE}", False),
    ({"scores": (0, 31)}, "", True),  # 35 points are left, and the foul costs four
    ({"scores": (0, 32)}, "", False),
    ({"scores": (35, 0)}, "", True),
    ({"scores": (36, 0)}, "", False),
]


@pytest.mark.parametrize(("fields", "log", "miss"), MISSES)
def test_no_ball_on_first_is_a_miss_if_nobody_needs_penalty_points(fields, log, miss):  # 3.14
    assert is_miss(frame(on_table=(1, *COLOURS), **fields), log) == miss


def is_miss(before, log, *call):
    """Returns whether the balls may be replaced after a shot with the miss rule; never without this rule."""
    assert "replace" not in snooker(before, log, *call).choices
    return "replace" in snooker(changed(before, miss=True), log, *call).choices


def test_a_nominated_ball_that_is_not_touched_first_is_a_miss():  # 3.14
    for before in (frame(colour=True), frame(free_ball=True)):
        assert is_miss(before, f"hit 0 {PINK}", Call(BLUE))
        assert not is_miss(before, f"hit 0 {PINK}", Call(PINK))
        assert not is_miss(before, f"hit 0 {PINK}")


def test_three_misses_in_a_row_lose_the_frame():  # 3.14 d
    for places, lost in (({"cue": (0.4, 0.5), "red": (1.5, 0.2)}, True), (HIDDEN, False)):
        game = lying(places, MISS, scores=[0, 0])
        for _ in range(2):
            missed = play(MISS, game, Stroke((-0.01, 0.0))).game
            assert "replace" in words(missed.state).choices
            game = play(MISS, missed, Stroke((0.0, 0.0), call=Call(kind="replace"))).game
        assert (game.state.misses, game.state.in_sight) == ((2, True) if lost else (0, False))
        end = play(MISS, game, Stroke((-0.01, 0.0))).game.state
        assert (end.over, end.winner) == ((True, 1) if lost else (False, -1))


@pytest.mark.parametrize("kind", ["hand_back", "shot"])
def test_misses_count_only_from_the_same_position(kind):  # 3.14 d (iii)
    game = lying({"cue": (0.4, 0.5), "red": (1.5, 0.2)}, MISS)
    for _ in range(4):
        game = play(MISS, game, Stroke((-0.01, 0.0))).game
        if kind == "hand_back":
            game = play(MISS, game, Stroke((0.0, 0.0), call=Call(kind=kind))).game
    assert not game.state.over


def test_a_second_miss_counts_if_a_player_needs_penalty_points():  # 3.14 d (i)
    fields = {"on_table": (1, *COLOURS), "scores": (40, 0)}
    assert not is_miss(frame(**fields), "")
    assert is_miss(frame(**fields, misses=1, in_sight=True), "")


def test_a_miss_with_a_scratch_can_be_replaced():  # 3.14
    corner = np.array([1.7845, 0.889])
    before = lying({"cue": corner - 0.3, "red": (-1.0, 0.5)}, MISS)
    missed = play(MISS, before, Stroke((1.0, 1.0)))
    now = words(missed.game.state)
    assert (missed.facts.first, missed.pots, words(missed.verdict).foul) == (0, ((0, 3),), "scratch")
    assert (now.in_hand, now.choices) == ("behind", ("hand_back", "replace"))
    again = play(MISS, missed.game, Stroke((0.0, 0.0), call=Call(kind="replace"))).game
    assert again.positions.tobytes() == before.positions.tobytes()
    scores, fouls = missed.game.state.scores, (1, 0, 0, 0)
    assert words(again.state) == words(changed(before.state, scores=scores, fouls=fouls, misses=1))


# On the table.


def test_a_break_off_from_the_d():
    played = play(SETUP, opening(SETUP, np.random.default_rng(0)), Stroke((4.0, 0.05), (-1.2, 0.1)))
    assert (played.verdict.foul, words(played.facts).first[0] in range(1, 16)) == (0, True)


def test_a_batch_judges_a_snooker_behind_the_free_ball():  # 3.12 b
    game = lying(HIDDEN, free_ball=True)
    velocities = [(0.6, 0.0), (0.6, 0.2)]
    batch = play_batch(SETUP, game, velocities)
    assert batch.verdicts.tolist() == [play(SETUP, game, Stroke(v)).verdict.tolist() for v in velocities]
    assert [games.FOULS[foul] for foul in batch.verdicts["foul"]] == ["free_ball", "no_hit"]
