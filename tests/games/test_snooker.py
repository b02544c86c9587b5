"""Snooker on the table: spots, snookers and misses. Numbers are rules of section 3 of the WPBSA's Official Rules."""

import math

import numpy as np
import pytest

from billiards_env import Scene
from billiards_env.games import FOULS, Call, Setup, Stroke, custom_opening, opening, play
from billiards_env.games.game_state import changed, set_of
from billiards_env.games.placement import SPOT_GAP
from billiards_env.games.snooker import points_left
from billiards_env.players.batch import play_batch
from billiards_env.scene.layouts import layout_plan
from tests.helpers.games import in_a_row, next_game, state, words

CUE, RED, RED_2 = range(3)
COLOURS = YELLOW, GREEN, BROWN, BLUE, PINK, BLACK = range(16, 22)
SCENE = Scene.named("snooker")
SETUP, MISS = Setup("snooker", SCENE), Setup("snooker", SCENE, miss=True)
SPOTS = layout_plan("snooker", SCENE).spots
R = SCENE.balls.radius[0]


def test_points_left():
    left = points_left.py_func  # pyright: ignore[reportFunctionMemberAccess]
    assert left(set_of(range(1, 22)), 15, False) == 147 == SETUP.game_rules.most_points(21)
    assert left(set_of((1, *COLOURS)), 15, False) == 35
    assert left(set_of(COLOURS), 15, True) == 34
    assert left(set_of((PINK, BLACK)), 15, False) == 13
    assert left(set_of(range(1, 7)), 0, False) == 27 == SETUP.game_rules.most_points(6)


# Spotting colours after a foul: the balls, the places of reds, and those of the balls.

ABOVE_BLACK = [SPOTS[BLACK] + [(k + 1) * 2.2 * R, 0.0] for k in range(5)]
ABOVE_YELLOW = SPOTS[YELLOW] + [2 * R + SPOT_GAP, 0.0]
SPOTTED = [
    (COLOURS, [], SPOTS[16:]),  # 3.7 a
    ((YELLOW,), [SPOTS[YELLOW]], [SPOTS[BLACK]]),  # 3.7 e: the highest free spot
    ((YELLOW,), SPOTS[[YELLOW, BLACK, PINK]], [SPOTS[BLUE]]),
    ((YELLOW, BLUE), SPOTS[[YELLOW, BLUE]], SPOTS[[PINK, BLACK]]),  # 3.7 f: the colour of the highest value is first
    ((PINK,), [SPOTS[1]], [SPOTS[PINK]]),  # 3.7 i: the first red at the start does not touch the pink
    ((YELLOW,), SPOTS[16:], [ABOVE_YELLOW]),  # 3.7 g: towards the top cushion if no spot is free
    ((BLACK,), [*SPOTS[16:], *ABOVE_BLACK], [SPOTS[BLACK] - [2 * R + SPOT_GAP, 0.0]]),  # 3.7 h: or else below
]


@pytest.mark.parametrize(("balls", "reds", "places"), SPOTTED)
def test_a_colour_is_spotted(balls, reds, places):
    lying = dict(enumerate(reds, start=1))
    before, pots = state("snooker", on_table=[*lying, *balls]), ", ".join(f"pocket {ball}" for ball in (0, *balls))
    placed, *_ = next_game("snooker", SCENE, before, in_a_row(22, lying), pots)
    np.testing.assert_allclose(placed[list(balls)], places, rtol=0.0, atol=1e-15)


# Snookered after a foul.


def is_snookered(positions, balls, shot=""):
    """Returns whether the cue ball is snookered after a foul in a frame with these balls."""
    return next_game("snooker", SCENE, state("snooker", on_table=balls), positions, shot)[2]["free_ball"]


AHEAD = {CUE: (0.0, 0.0), RED: (1.0, 0.0)}
SNOOKERS = [
    ({}, "", False),
    ({BLUE: (0.5, 0.0)}, "", True),
    ({BLUE: (0.5, 0.06)}, "", True),  # the left edge is covered
    ({BLUE: (0.5, 0.08)}, "", False),
    ({BLUE: (1.2, 0.0)}, "", False),  # behind the red
    ({BLUE: (-0.2, 0.0)}, "", False),
    ({RED_2: (0.0, 0.5), BLUE: (0.5, 0.0)}, "", False),  # the other red is clear
    ({RED_2: (0.5, 0.0), BLUE: (0.0, 0.5)}, "", False),  # a red does not hide a red
    ({RED: (2 * R, 0.0), BLUE: (0.0, 2.1 * R)}, "", False),  # touching
    ({CUE: (-0.5, 0.0), BLUE: (-0.2, 0.0)}, "", True),
    ({CUE: (-0.5, 0.0), BLUE: (-0.2, 0.0)}, "pocket 0", False),  # 3.12: in hand
]


@pytest.mark.parametrize(("places", "shot", "snookered"), SNOOKERS)
def test_a_snooker_hides_an_edge_of_every_ball_on(places, shot, snookered):  # section 2, 17
    assert is_snookered(in_a_row(22, AHEAD | places), AHEAD | places, shot) == snookered


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
        places = {CUE: cue, RED: around(cue, angle, distance), BLUE: around(cue, angle + blue, 2 * R)}
        positions = in_a_row(22, places)
        layouts = [positions, positions * (-1, 1), positions * (1, -1), -positions]
        layouts += [np.nextafter(positions, rng.choice((-9.0, 9.0), positions.shape)) for _ in range(4)]
        assert {is_snookered(layout, places) for layout in layouts} == {snookered}, angle


BEHIND_FREE_BALL = [
    (AHEAD | {BLUE: (0.5, 0.0)}, BLUE, True),
    (AHEAD | {BLUE: (0.5, 0.0), PINK: (0.0, 0.5)}, PINK, False),  # another ball
    (AHEAD | {BLUE: (0.5, 0.2)}, BLUE, False),
    (AHEAD | {BLUE: (0.5, 0.0), RED_2: (0.0, 0.5)}, BLUE, False),
    (AHEAD | {BLUE: (0.5, 0.0), GREEN: (0.3, 0.0)}, BLUE, False),  # the green is nearer and snookers as well
    (AHEAD | {BLUE: (0.5, 0.0), GREEN: (0.7, 0.0)}, BLUE, True),
    ({CUE: (0.0, 0.0), PINK: (1.0, 0.0), BLACK: (0.5, 0.0)}, BLACK, False),  # only the pink and the black are left
]


@pytest.mark.parametrize(("places", "ball", "foul"), BEHIND_FREE_BALL)
def test_a_snooker_behind_the_free_ball_is_a_foul(places, ball, foul):  # 3.12 b
    before = state("snooker", free_ball=True, on_table=places)
    found = next_game("snooker", SCENE, before, in_a_row(22, places), f"hit 0 {ball}", Call(ball))[2]
    expected = ("free_ball", 4, True, ("hand_back",)) if foul else ("", 0, False, ())
    assert (found["foul"], found["penalty"], found["free_ball"], found["choices"]) == expected


# Shots on the table.


def lying(places, settings=SETUP, **fields):
    """Returns a state of the game with some balls at given places and the other colours on their spots."""
    places = {ball: SPOTS[ball] for ball in COLOURS} | places
    return custom_opening(settings, in_a_row(22, places), {"on_table": sorted(places), **fields})


def test_a_break_off_from_the_d():
    played = play(SETUP, opening(SETUP, np.random.default_rng(0)), Stroke((4.0, 0.05), (-1.2, 0.1)))
    assert (words(played.verdict).foul, words(played.facts).first[0] in range(1, 16)) == ("", True)


IN_SIGHT = {CUE: (0.4, 0.5), RED: (1.5, 0.2)}
HIDDEN = {CUE: (0.4, 0.5), RED: (1.5, 0.5), BLUE: (0.9, 0.5)}


def test_a_foul_that_leaves_a_snooker_gives_a_free_ball():  # 3.12
    played = play(SETUP, lying(HIDDEN), Stroke((0.0, 0.0)))
    now = words(played.game.state)
    assert (words(played.verdict).foul, now.free_ball, now.player, now.choices) == ("no_hit", True, 1, ("hand_back",))
    back = play(SETUP, played.game, Stroke((0.0, 0.0), call=Call(kind="hand_back"))).game
    assert back.positions.tobytes() == played.game.positions.tobytes()
    assert back.state == changed(played.game.state, player=0, free_ball=False, choices=0)  # 3.12 f
    assert (words(back.state).scores, words(back.state).fouls) == ((0, 4), (1, 0))
    assert not play(SETUP, lying(IN_SIGHT), Stroke((0.0, 0.0))).game.state.free_ball


@pytest.mark.parametrize(("velocity", "foul"), [((-0.5, 0.0), ""), ((0.0, 0.5), ""), ((0.5, 0.0), "push")])
def test_a_cue_ball_that_touches_a_red_is_played_away_from_it(velocity, foul):  # 3.8
    game = lying({CUE: (0.4, 0.5), RED: (0.4 + 2 * R, 0.5)})
    assert words(game.state).touching == (RED,)
    played = play(SETUP, game, Stroke(velocity))
    assert (words(played.verdict).foul, words(played.game.state).touching) == (foul, ())


MISSES = [(IN_SIGHT, "replace", 3), (HIDDEN, "replace", 0), (IN_SIGHT, "hand_back", 0), (IN_SIGHT, "", 0)]


@pytest.mark.parametrize(("places", "kind", "lost_after"), MISSES)
def test_three_misses_from_one_position_in_sight_of_a_ball_on_lose_the_frame(places, kind, lost_after):  # 3.14 d
    game = lying(places, MISS)
    for misses in range(1, 5):
        game = play(MISS, game, Stroke((-0.01, 0.0))).game
        assert (game.state.over, game.state.winner) == ((True, 1) if misses == lost_after else (False, -1))
        if game.state.over:
            break
        assert "replace" in words(game.state).choices
        game = play(MISS, game, Stroke((0.0, 0.0), call=Call(kind=kind))).game if kind else game


def test_a_miss_with_a_scratch_can_be_replaced_or_handed_back():  # 3.14
    corner = np.array([1.7845, 0.889])
    before = lying({CUE: corner - 0.3, RED: (-1.0, 0.5)}, MISS)
    missed = play(MISS, before, Stroke((1.0, 1.0)))
    now = words(missed.game.state)
    assert (missed.facts.first, missed.pots, words(missed.verdict).foul) == (0, ((0, 3),), "scratch")
    assert (now.in_hand, now.choices) == ("behind", ("hand_back", "replace"))
    again = play(MISS, missed.game, Stroke((0.0, 0.0), call=Call(kind="replace"))).game
    assert again.positions.tobytes() == before.positions.tobytes()
    scores, fouls = missed.game.state.scores, (1, 0, 0, 0)
    assert words(again.state) == words(changed(before.state, scores=scores, fouls=fouls, misses=1))
    back = play(MISS, missed.game, Stroke((0.0, 0.0), call=Call(kind="hand_back"))).game
    assert back.positions.tobytes() == missed.game.positions.tobytes()
    assert back.state == changed(missed.game.state, player=0, choices=0)  # the cue ball stays in hand


def test_a_batch_judges_a_snooker_behind_the_free_ball():  # 3.12 b
    game = lying(HIDDEN, free_ball=True)
    velocities = [(0.6, 0.0), (0.6, 0.2)]
    batch = play_batch(SETUP, game, velocities)
    assert batch.verdicts.tolist() == [play(SETUP, game, Stroke(v)).verdict.tolist() for v in velocities]
    assert [FOULS[foul] for foul in batch.verdicts["foul"]] == ["free_ball", "no_hit"]
