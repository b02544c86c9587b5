import math

import numpy as np
import pytest

from billiards_env.games import placement
from billiards_env.games.state import IN_HAND, RulesState, row, set_of
from billiards_env.scene import Balls, Scene, Table, check_positions
from billiards_env.scene.layouts import MARGIN, layout_plan

SCENE = Scene.named("pool", 15)
R = SCENE.balls.radius[0]
REACH = 2 * R + MARGIN
FOOT = SCENE.table.length / 4
AWAY = np.array([[-1.2 + 0.1 * i, 0.55] for i in range(16)])


def place(point, on_table=(), in_hand="anywhere", positions=AWAY):
    """Returns the place of a cue ball in hand."""
    state = row(RulesState(object_balls=set_of(on_table), in_hand=IN_HAND.index(in_hand)))
    return placement.cue_ball_point(SCENE, positions, state, point)


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
    positions[15] = placement.spotted_point(SCENE, positions, lying, 15, 0)
    assert positions[15] == pytest.approx((x, 0.0), abs=1e-15)
    check_positions(SCENE, positions)


def test_balls_are_spotted_one_behind_the_other():
    positions = AWAY.copy()
    placement.spot_at_foot(SCENE, positions, [0, 4], [1, 2, 3], 0)
    assert positions[1:4, 0] == pytest.approx(FOOT + 2 * R * np.arange(3), abs=1e-15)


def test_a_spotted_ball_does_not_touch_the_cue_ball():
    positions, lying = on_axis(FOOT, FOOT + 2 * R)
    point = placement.spotted_point(SCENE, positions, lying, 15, 2)
    assert point == pytest.approx((FOOT + 2 * R + REACH, 0.0), abs=1e-12)


def test_a_ball_near_the_long_string_blocks_a_part_of_it():
    positions, balls = on_axis(FOOT)
    for y, x in ((R, FOOT + math.sqrt(3.0) * R), (2.001 * R, FOOT)):
        positions[1] = FOOT, y
        assert placement.spotted_point(SCENE, positions, balls, 9, 0) == pytest.approx((x, 0.0), abs=1e-12)


def test_with_a_blocked_long_string_the_ball_is_placed_off_the_axis():
    small = Scene(Balls.uniform(4, 0.1, 1.0), Table(0.62, 2.0))
    positions = np.array([[-0.2, 0.0], [0.0, 0.0], [0.2, 0.0], [0.0, 0.5]])
    x, y = placement.spotted_point(small, positions, (0, 1, 2), 3, 0)
    assert abs(y) > 0.15
    positions[3] = x, y
    check_positions(small, positions)


def test_a_full_table_is_an_error():
    with pytest.raises(ValueError, match="no room"):
        placement.nearest_free_point((0.0, 0.0), (-1.0, 1.0, -1.0, 1.0), [(0.0, 0.0, 2.0)])


def test_a_free_point_is_returned_unchanged():
    point = (0.1 + 0.2, -1 / 3)
    assert place(point, range(1, 16)) == point


def test_a_point_outside_the_area_is_clipped():
    x_low, x_high, y_low, y_high = placement.placement_area(SCENE, 0)
    assert place((9.0, 0.3)) == (x_high, 0.3)
    assert place((0.3, -9.0)) == (0.3, y_low)
    assert place((0.3, 0.1), in_hand="behind") == (-SCENE.table.length / 4, 0.1)
    assert (x_low, y_low, x_high) == (-x_high, -y_high, SCENE.table.length / 2 - R - MARGIN)
    with_jaws = Scene.named("uk_pool")
    assert placement.placement_area(with_jaws, 0, behind=True)[1] == with_jaws.table.head_x < 0.0


def test_pockets_are_avoided():
    side = SCENE.table.pockets[5]
    x, y = place((side.x, side.y))
    assert math.hypot(x - side.x, y - side.y) == pytest.approx(side.radius + MARGIN, abs=1e-9)


def brute(point, area, circles, steps=401):
    """Returns the squared distance to the nearest free point of a fine grid."""
    x = np.linspace(area[0], area[1], steps)[:, None]
    y = np.linspace(area[2], area[3], steps)[None, :]
    free = np.ones((steps, steps), bool)
    for cx, cy, reach in circles:
        free &= (x - cx) ** 2 + (y - cy) ** 2 >= reach**2
    return np.min(np.where(free, (x - point[0]) ** 2 + (y - point[1]) ** 2, np.inf))


def test_the_result_is_free_and_nearest():
    rng = np.random.default_rng(0)
    area = (-1.0, 1.0, -0.5, 0.5)
    for _ in range(200):
        circles = [(*(2 * rng.random(2) - 1).tolist(), 0.1 + 0.3 * rng.random()) for _ in range(12)]
        point = tuple((2.4 * rng.random(2) - 1.2).tolist())
        inside = min(max(point[0], area[0]), area[1]), min(max(point[1], area[2]), area[3])
        best = brute(inside, area, circles)
        if not np.isfinite(best):
            continue
        x, y = placement.nearest_free_point(point, area, circles)
        assert area[0] <= x <= area[1]
        assert area[2] <= y <= area[3]
        assert all(math.hypot(x - cx, y - cy) >= reach - 1e-8 for cx, cy, reach in circles)
        assert math.hypot(x - inside[0], y - inside[1]) <= math.sqrt(best) + 1e-9


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
    assert IN_HAND[placement.rack_again(SCENE, positions, on_table, 0)] == in_hand
    assert positions[15] == pytest.approx(last_after)
    assert cue_after is None or positions[0] == pytest.approx(cue_after)
    full = "potted" in case or "both" in case
    assert positions[1:15].tolist() == (RACK[:14] if full else RACK[1:]).tolist()
