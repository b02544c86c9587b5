import math

import numpy as np
import pytest

from billiards_env.games import NO_CALL, Call, Setup, placement
from billiards_env.games.game_state import IN_HAND, changed, set_of
from billiards_env.games.referee import first_state
from billiards_env.scene import Balls, Scene, Table, check_positions
from billiards_env.scene.layouts import PLACING_GAP, layout_plan
from tests.helpers.games import next_game, state

SCENE = Scene.named("pool", 15)
R = SCENE.balls.radius[0]
REACH = 2 * R + PLACING_GAP
FOOT = SCENE.table.length / 4
FIRST = first_state("straight", 16)
AWAY = np.array([[-1.2 + 0.1 * i, 0.55] for i in range(16)])


def place(point, on_table=(), in_hand="anywhere", positions=AWAY):
    """Returns the place of a cue ball in hand."""
    state = changed(FIRST, object_balls=set_of(on_table), in_hand=IN_HAND.index(in_hand))
    return placement.cue_ball_point(SCENE, positions, state, point)


def after_shot(positions, lying, potted, shot="", scene=SCENE, **fields):
    """Returns the positions and the state after a shot of straight pool that pots some balls; `lying` do not move."""
    balls, events = set_of({*lying, *potted} - {0}), ", ".join(filter(None, (shot, *map("pocket {}".format, potted))))
    before = first_state(
        "straight", scene.n_balls, **{"object_balls": balls, "break_shot": False, "in_hand": 0, **fields}
    )
    return next_game("straight", scene, before, positions, events)[:2]


def spot(positions, lying, potted, scene=SCENE):
    """Returns the positions with balls of pool spotted after a foul. A potted cue ball is no obstacle."""
    return after_shot(positions, lying, potted, scene=scene)[0]


def on_axis(*xs):
    """Returns positions with balls 1, 2, ... at these x on the long string, and their numbers."""
    positions = AWAY.copy()
    for ball, x in enumerate(xs, start=1):
        positions[ball] = x, 0.0
    return positions, range(1, len(xs) + 1)


SPOTTED = [
    ([], FOOT),
    ([FOOT], FOOT + 2 * R),  # behind a blocked foot spot and frozen to the ball on it (WPA 1.4)
    ([FOOT, FOOT + 3.9 * R], FOOT + 5.9 * R),  # the gap is too small
    ([FOOT, FOOT + 4 * R], FOOT + 2 * R),
    ([FOOT + k * REACH for k in range(11)], FOOT - 2 * R),  # no room behind the foot spot
]


@pytest.mark.parametrize(("balls", "x"), SPOTTED)
def test_a_ball_is_spotted_on_the_long_string(balls, x):
    positions, lying = on_axis(*balls)
    positions = spot(positions, lying, [0, 15])
    assert positions[15] == pytest.approx((x, 0.0), abs=1e-15)
    check_positions(SCENE, positions)


def test_balls_are_spotted_one_behind_the_other():
    positions = spot(AWAY, [4], [0, 1, 2, 3])
    assert positions[1:4, 0] == pytest.approx(FOOT + 2 * R * np.arange(3), abs=1e-15)


def test_a_spotted_ball_does_not_touch_the_cue_ball():
    positions, _ = on_axis(FOOT, FOOT + 2 * R)
    positions[[0, 2]] = positions[[2, 0]]
    point = spot(positions, [1], [15])[15]
    assert point == pytest.approx((FOOT + 2 * R + REACH, 0.0), abs=1e-12)


def test_a_ball_near_the_long_string_blocks_a_part_of_it():
    positions, balls = on_axis(FOOT)
    for y, x in ((R, FOOT + math.sqrt(3.0) * R), (2.001 * R, FOOT)):
        positions[1] = FOOT, y
        assert spot(positions, balls, [0, 9])[9] == pytest.approx((x, 0.0), abs=1e-12)


def test_with_a_blocked_long_string_the_ball_is_placed_off_the_axis():
    small = Scene(Balls.uniform(4, 0.1, 1.0), Table(0.62, 2.0))
    positions = spot(np.array([[-0.2, 0.0], [0.0, 0.0], [0.2, 0.0], [0.0, 0.5]]), [1, 2], [3], small)
    assert abs(positions[3, 1]) > 0.15
    check_positions(small, positions)


def test_a_full_table_is_an_error():
    full = Scene(Balls((0.03, 0.095, 0.095, 0.095, 0.03), (1.0,) * 5), Table(0.6, 0.2))
    positions = np.array([[0.0, 0.0], [-0.2, 0.0], [0.0, 0.0], [0.2, 0.0], [0.0, 0.0]])
    state = changed(FIRST, object_balls=set_of((1, 2, 3)), in_hand=IN_HAND.index("anywhere"))
    area = r"no room for a ball in x -0\.269 to 0\.269 m, y -0\.069\d* to 0\.069\d* m: expected a free point"
    with pytest.raises(ValueError, match=area):
        placement.cue_ball_point(full, positions, state, (0.0, 0.0))
    with pytest.raises(ValueError, match=area):
        spot(positions, [1, 2, 3], [0, 4], full)


def test_a_free_point_is_returned_unchanged():
    point = (0.1 + 0.2, -1 / 3)
    assert place(point, range(1, 16)) == point


def test_a_point_outside_the_area_is_clipped():
    x_low, x_high, y_low, y_high = placement.placement_area(SCENE, 0, behind=False)
    assert place((9.0, 0.3)) == (x_high, 0.3)
    assert place((0.3, -9.0)) == (0.3, y_low)
    assert place((0.3, 0.1), in_hand="behind") == (-SCENE.table.length / 4, 0.1)
    assert (x_low, y_low, x_high) == (-x_high, -y_high, SCENE.table.length / 2 - R - PLACING_GAP)
    with_jaws = Scene.named("uk_pool")
    assert placement.placement_area(with_jaws, 0, behind=True)[1] == with_jaws.table.head_x < 0.0


RACK = layout_plan("tight_rack", SCENE).spots[1:]
HEAD = (SCENE.table.head_x, 0.0)
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
    positions, state = after_shot(positions, on_table, {*range(1, 16)} - on_table, "hit 0 1", target=100)
    assert IN_HAND[state.in_hand] == in_hand
    assert positions[15] == pytest.approx(last_after)
    assert cue_after is None or positions[0] == pytest.approx(cue_after)
    full = "potted" in case or "both" in case
    assert positions[1:15].tolist() == (RACK[:14] if full else RACK[1:]).tolist()


def test_all_balls_of_straight_pool_are_racked_after_three_fouls():  # 4.11
    positions, state = after_shot(AWAY, range(1, 16), [], target=50, fouls=(2, 0, 0, 0))
    assert positions[1:].tolist() == RACK.tolist()
    assert (state.break_shot, IN_HAND[state.in_hand]) == (True, "behind")


def boundary(area, circles, steps=360):
    """Returns points on the edges of an area and on circles, (k, 2)."""
    angles, shares = 2 * np.pi * np.arange(steps) / steps, np.linspace(0.0, 1.0, steps)
    rim = [(x + r * np.cos(angles), y + r * np.sin(angles)) for x, y, r in circles]
    u, v = (low + (high - low) * shares for low, high in (area[:2], area[2:]))
    edges = [(u, np.full(steps, y)) for y in area[2:]] + [(np.full(steps, x), v) for x in area[:2]]
    return np.hstack(rim + edges).T


@pytest.mark.parametrize("name", ["pool", "snooker"])
@pytest.mark.parametrize("in_hand", ["behind", "anywhere"])
@pytest.mark.parametrize("seed", range(100))
def test_the_cue_ball_is_placed_at_the_nearest_free_point_of_its_area(name, in_hand, seed):
    scene, rng = Scene.named(name, 15), np.random.default_rng(seed)
    n, table, radius = scene.n_balls, scene.table, np.array(scene.balls.radius)
    state = changed(FIRST, object_balls=int(rng.integers(2**n)) & -2, in_hand=IN_HAND.index(in_hand))
    area = np.array(placement.cue_ball_area(scene, state))
    low, high = area[::2], area[1::2]
    positions, wish = rng.uniform(low, high, (n, 2)), rng.uniform(low - 0.1, high + 0.1)
    positions[::2] = np.clip(wish + rng.normal(0.0, 2.0 * radius[0], positions[::2].shape), low, high)  # a crowd
    point = placement.cue_ball_point(scene, positions, state, tuple(wish.tolist()))
    lying = [i for i in range(1, n) if state.object_balls >> i & 1]
    circles = [(*positions[i], radius[i] + radius[0] + PLACING_GAP) for i in lying]
    circles += [(p.x, p.y, p.radius + PLACING_GAP) for p in table.pockets]
    d = [(table.head_x, 0.0, table.d_radius)] if in_hand == "behind" and table.d_radius else []

    def is_allowed(points, slack):
        """Returns which points are free and in the area, up to a tolerance, m."""
        distances = [np.hypot(points[:, 0] - x, points[:, 1] - y) - r for x, y, r in circles + d]
        allowed = ((points >= low - slack) & (points <= high + slack)).all(axis=1)
        for distance in distances[: len(circles)]:
            allowed &= distance >= -slack
        return allowed & (distances[-1] <= slack) if d else allowed

    assert is_allowed(np.array([point]), 1e-9).all()
    centre = np.clip(wish, low, high)
    for x, y, r in d:
        reach = np.hypot(centre[0] - x, centre[1] - y)
        centre = (x, y) + (centre - (x, y)) * min(1.0, r / max(reach, 1e-9))
    inside = area + np.array([1, -1, 1, -1]) * 1e-6  # free points are beside the circles, and within the area and the D
    others = boundary(inside, [(x, y, r + 1e-6) for x, y, r in circles] + [(x, y, r - 1e-6) for x, y, r in d])
    others = np.vstack((others[is_allowed(others, -1e-9)], centre[None][is_allowed(centre[None], -1e-9)]))
    assert np.hypot(*(others - centre).T).min(initial=np.inf) >= np.hypot(*(point - centre)) - 1e-9


def test_a_rack_again_needs_balls_of_one_size():
    unequal = Scene(Balls((0.028, 0.028, 0.03), (0.17,) * 3), SCENE.table)
    assert Setup("straight", unequal).target == 0  # without a target the game has a single rack
    with pytest.raises(ValueError, match=r"layout = 'tight_rack' with object balls of radii .*: expected one radius"):
        Setup("straight", unequal, target=10)


TABLE = Scene.named("carom").table
HEAD_SPOT, FOOT_SPOT, CENTRE = (TABLE.head_x, 0.0), (TABLE.foot_x, 0.0), (0.0, 0.0)
START = (TABLE.head_x, -0.1825 / 1.42 * TABLE.width)
AWAY_3 = [(-0.3, 0.2), (0.4, 0.3), (0.5, -0.4)]
STRUCK_2, RERACK = {"player": 1, "cue_balls": (2, 0)}, Call(kind="rerack")
SET_UP = [
    # the game, its state, the shot or the call, and the place of each ball after it; None if the ball stays
    ("carom", {}, "hit 0 1", [None, None, None]),
    ("carom", {}, "off 1", [HEAD_SPOT, FOOT_SPOT, START]),  # UMB, art. 28, paper F
    ("carom", STRUCK_2, "off 2", [START, FOOT_SPOT, HEAD_SPOT]),
    ("three_cushion", {}, "off 1", [None, FOOT_SPOT, None]),
    ("three_cushion", {}, "off 2", [None, None, HEAD_SPOT]),  # the next player strikes this ball
    ("three_cushion", {}, "off 0", [CENTRE, None, None]),
    ("three_cushion", STRUCK_2, "off 0, off 1", [HEAD_SPOT, FOOT_SPOT, None]),
    ("carom", STRUCK_2, RERACK, [HEAD_SPOT, FOOT_SPOT, START]),  # 27
    ("three_cushion", {"touching": (1,)}, RERACK, [HEAD_SPOT, FOOT_SPOT, None]),
    ("three_cushion", {**STRUCK_2, "touching": (0,)}, RERACK, [CENTRE, None, HEAD_SPOT]),
    # The equalising inning begins at the starting position (29).
    ("carom", {"innings": 5, "target": 1}, "hit 0 1, hit 0 2", [HEAD_SPOT, FOOT_SPOT, START]),
    # A ball whose spot is blocked goes to the spot of the blocking ball, also twice (paper F).
    ("three_cushion", {"touching": (1,)}, RERACK, [HEAD_SPOT, CENTRE, None], [*AWAY_3[:2], (FOOT_SPOT[0], 0.01)]),
    ("three_cushion", {}, "off 1", [None, HEAD_SPOT, None], [FOOT_SPOT, (9.0, 0.0), CENTRE]),
]


@pytest.mark.parametrize("case", SET_UP)
def test_balls_of_carom_are_set_up_again(case):
    rules, fields, shot, places, *start = case
    before, (old,), is_call = state(rules, **fields), start or [AWAY_3], isinstance(shot, Call)
    shot, call = ("", shot) if is_call else (shot, NO_CALL)
    after, now, found = next_game(rules, Scene.named("carom"), before, old, shot, call)
    np.testing.assert_allclose(after, [a if b is None else b for a, b in zip(old, places, strict=True)])
    assert found["on_table"] == (0, 1, 2)
    assert now == changed(before, choices=0, touching=0) if is_call else now.player != before.player
