"""Contact times of balls and cushions: none is missed, and none is found where there is none."""

import inspect
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from billiards_env.engine.compile import scene_arrays
from billiards_env.physics.geometry import outline_walls
from billiards_env.physics.geometry.outline_walls import OUTLINE, any_wall_time, outline_arrays, piece_normal
from billiards_env.physics.geometry.rectangle import RECTANGLE
from billiards_env.physics.geometry.walls import HALF_LINE, TURNS, Walls
from billiards_env.physics.motion import Path
from billiards_env.physics.state import VX, VY, WIDTH, State, X, Y
from billiards_env.scene import Balls, Physics, Scene, Table
from billiards_env.scene.outline import clearance, pieces
from tests.helpers.outlines import ANY_TABLE, TABLES, THROAT, free_places, joint_of, table, with_corners

INF = math.inf
R = 0.03
SCENE: Any = scene_arrays(Scene.named("pool", 0))._replace(laws=None, walls=None, space=None)


def arrays(a_table):
    return outline_arrays(a_table.outline, a_table.length / 2, a_table.width / 2, ())


def scene_with(outline):
    return SCENE._replace(outline=outline)


def wall_time(path, a_table, end=INF, radius=R):
    """Returns the time of the next contact and the number of the cushion."""
    return OUTLINE.time(Path(*map(float, path)), radius, end, scene_with(arrays(a_table)))


def position(path, t):
    x, y, vx, vy, ax, ay = path
    return np.stack([x + t * (vx + 0.5 * t * ax), y + t * (vy + 0.5 * t * ay)], axis=-1)


def gap(path, t, a_table, radius=R):
    """Returns the distance of a ball from the outline at some times, m."""
    return clearance(a_table.outline, position(path, t)) - radius


def check(path, a_table, end, radius=R):
    """Checks that the ball is inside until the time of contact, and touches and approaches then."""
    t, wall = wall_time(path, a_table, end, radius)
    if math.isinf(end):  # without acceleration every path reaches a cushion
        assert t < INF
    until = min(t, end)
    assert gap(path, np.linspace(0.0, until, 2000), a_table, radius).min() > -1e-12
    if t == INF:
        return
    assert 0.0 <= t <= end
    assert abs(gap(path, t, a_table, radius)) < 1e-12
    outline = arrays(a_table)
    x, y = position(path, t)
    nx, ny = piece_normal(x, y, wall, outline)
    vx, vy = path[2] + t * path[4], path[3] + t * path[5]
    assert nx * vx + ny * vy > -1e-12
    assert math.hypot(nx, ny) == pytest.approx(1.0, abs=1e-15)
    assert gap((*position(path, t), nx, ny, 0, 0), 1e-6, a_table, radius) == pytest.approx(-1e-6, rel=1e-3)


# Any path on any table


@settings(max_examples=150)
@given(ANY_TABLE, st.integers(0, 2**32), st.sampled_from([0.0, 0.1, 2.0, 40.0]), st.sampled_from([0.01, 0.03]))
def test_a_ball_stays_inside_until_it_touches_the_cushion_that_is_found(a_table, seed, force, radius):
    rng = np.random.default_rng(seed)
    place = free_places(a_table, radius, rng, 1)[0]
    direction, push = rng.normal(size=2), rng.normal(size=2)
    velocity = direction / np.hypot(*direction) * 10.0 ** rng.uniform(-3, 1)
    acceleration = force * push / np.hypot(*push)
    check((*place, *velocity, *acceleration), a_table, 10.0 ** rng.uniform(-2, 1) if force else INF, radius)


@settings(max_examples=80)
@given(ANY_TABLE, st.integers(0, 2**32), st.sampled_from([0.0, 2.0]))
def test_a_ball_that_touches_a_cushion_leaves_it(a_table, seed, force):
    """After the reflection the contact at time 0 is not found again, and the ball does not pass the cushion."""
    rng = np.random.default_rng(seed)
    outline = arrays(a_table)
    x, y = free_places(a_table, R, rng, 1)[0]
    angle = rng.uniform(0, 2 * math.pi)
    vx, vy, ax, ay = math.cos(angle), math.sin(angle), *(force * rng.normal(size=2))
    for _ in range(10):
        path, end = (x, y, vx, vy, ax, ay), 0.5 if force else INF
        t, wall = wall_time(path, a_table, end)
        assert gap(path, np.linspace(0.0, min(t, end), 500), a_table).min() > -1e-12
        if t == INF:
            break
        x, y = position(path, t)
        vx, vy = vx + t * ax, vy + t * ay
        nx, ny = piece_normal(x, y, wall, outline)
        normal = nx * vx + ny * vy
        vx, vy = vx - 2 * normal * nx, vy - 2 * normal * ny


@pytest.mark.parametrize("name", ["pool_7ft", "snooker_12ft", "rectangle", "split"])
def test_the_rectangle_without_cushions_is_only_a_short_cut(name):
    a_table = TABLES[name]
    quick = arrays(a_table)
    assert quick.box[X] == a_table.length / 2
    rng = np.random.default_rng(0)
    for place in free_places(a_table, R, rng, 300):
        path = Path(*map(float, place), *rng.normal(size=2), *(rng.normal(size=2) * rng.choice([0.0, 2.0])))
        end = INF if path.ax == 0.0 else 2.0
        assert OUTLINE.time(path, R, end, scene_with(quick)) == any_wall_time(path, R, end, quick)


def test_a_corner_half_a_micrometre_inside_the_rectangle_has_no_short_cut():
    a_table = table([(0, 0), (1, 5e-7), (2, 0), (2, 1), (0, 1)])
    assert arrays(a_table).box.tolist() == [0.0, 0.0]
    t, _ = wall_time((0.0, 0.0, 0.0, -1.0, 0.0, 0.0), a_table)
    assert t == pytest.approx(0.5 - 5e-7 - R, abs=1e-15)


# Joints


@pytest.mark.parametrize("offset", [0.0, 1e-17, -1e-17, 1e-13, -1e-13, 1e-9, -1e-9])
@pytest.mark.parametrize("slope", [0.0, 0.3, 30.0])
def test_a_ball_that_meets_the_joint_of_two_parallel_cushions_bounces(offset, slope):
    turned = table([(c * 0.6 - s * 0.8, c * 0.8 + s * 0.6) for c, s in ((0, 0), (0.7, 0), (2, 0), (2, 1), (0, 1))])
    corners = turned.outline
    joint = np.array([corners[1].x, corners[1].y]) + offset * np.array([0.6, 0.8])
    inward = np.array([-0.8, 0.6])
    velocity = -inward + slope * np.array([0.6, 0.8])
    start = joint + R * inward - 0.01 * velocity
    t, wall = wall_time((*start, *velocity, 0, 0), turned)
    assert t == pytest.approx(0.01, abs=1e-14)
    assert wall in (0, 1)
    # With an acceleration it comes back to the same place.
    t, wall = wall_time((*(joint + R * inward), *inward, *(-inward)), turned, 3.0)
    assert t == pytest.approx(2.0, abs=1e-14)
    assert wall in (0, 1)


@pytest.mark.parametrize("name", ["pool_7ft", "snooker_12ft", "L", "throat"])
@pytest.mark.parametrize("offset", [0.0, 1e-17, -1e-17, 1e-12, -1e-12, 1e-10, -1e-10, 2e-10, 1e-8, -1e-8])
def test_a_ball_that_meets_the_joint_of_a_cushion_and_an_arc_bounces(name, offset):
    a_table = TABLES[name]
    for tip in range(len(pieces(a_table.outline)[1])):
        (x, y), piece = joint_of(a_table, tip)
        inward = np.array([x - piece.x, y - piece.y]) / piece.radius
        along = np.array([inward[1], -inward[0]])
        start = np.array([x, y]) + (R + 1e-4) * inward + offset * along
        t, _ = wall_time((*start, *(-inward), 0, 0), a_table)
        assert t == pytest.approx(1e-4, abs=1e-12)


def test_two_arcs_that_meet_leave_no_gap():
    """The cushion between them is shorter than the rounding of its ends."""
    radius = 0.1 * (1 - 1e-14) / math.tan(math.pi / 8)
    corners = [(0, 0), (3, 0), (3, 1), (1.9, 0.9, 0), (1.7, 0.7, radius), (1.5, 0.7, radius), (1.3, 0.9), (0, 1)]
    a_table = table(corners)
    lines = arrays(a_table).lines
    assert (lines[:, HALF_LINE] < 1e-9).sum() == 1
    middle = 0.1  # of the table is at x = 1.5 m; the arcs meet at x = 1.6 m
    for offset in (0.0, 1e-17, 1e-16, -1e-16, 1e-12, -1e-12, 1e-8):
        t, wall = wall_time((middle + offset, 0.0, 0.0, 1.0, 0.0, 0.0), a_table)
        assert t == pytest.approx(0.2 - R, abs=1e-12)
        assert wall >= len(lines)


# Grazing


@pytest.mark.parametrize(("offset", "meets"), [(-1e-15, True), (1e-15, False), (-1e-12, True), (1e-12, False)])
def test_a_ball_grazes_a_tip_or_passes_it(offset, meets):
    tip = pieces(TABLES["L"].outline)[1][0]
    reach = R + tip.radius
    direction = np.array([1.0, -1.0]) / math.sqrt(2)  # at right angles to the bisector of the corner
    outwards = np.array([-1.0, -1.0]) / math.sqrt(2)
    nearest = np.array([tip.x, tip.y]) + (reach + offset) * outwards
    for force in (0.0, 0.5):  # the second path bends away from the tip
        bend = force * outwards
        path = (*(nearest - 0.3 * direction + 0.045 * bend), *(direction - 0.3 * bend), *bend)
        t, wall = wall_time(path, TABLES["L"], 0.5)
        if force and abs(offset) < 1e-13:
            continue  # the rounding of the path is larger
        assert (wall == len(arrays(TABLES["L"]).lines)) == meets
        if meets:
            closing = math.sqrt(-2 * offset / reach)
            assert t == pytest.approx(0.3, abs=1.1 * closing * reach + 1e-7)


@settings(max_examples=100)
@given(st.floats(0, 2 * math.pi), st.floats(0.01, 10))
def test_a_ball_that_moves_along_a_sloping_cushion_does_not_touch_it(angle, speed):
    """Rounding of the normal velocity and acceleration, of either sign, is no approach."""
    c, s = math.cos(angle), math.sin(angle)
    a_table = table([(c * x - s * y, s * x + c * y) for x, y in ((0, 0), (2, 0), (2, 1), (0, 1))])
    line = arrays(a_table).lines[0]
    tx, ty, nx, ny = line[2:6]
    x, y = line[0] - R * nx - 0.5 * tx, line[1] - R * ny - 0.5 * ty
    for roll in (0.0, 0.0981):
        path = (x, y, speed * tx, speed * ty, -roll * tx, -roll * ty)
        _, wall = wall_time(path, a_table, INF if roll == 0.0 else min(speed / roll, 1.4 / speed))
        assert wall != 0
        assert wall == (1 if roll == 0.0 else -1)


# Contacts at time 0


@pytest.mark.parametrize("name", ["octagon", "L", "pool_7ft", "throat"])
def test_a_ball_that_touches_a_cushion_now_and_approaches_it_meets_it_now(name):
    a_table = TABLES[name]
    rng = np.random.default_rng(1)
    outline = arrays(a_table)
    for place in free_places(a_table, R, rng, 100):
        angle = rng.uniform(0, 2 * math.pi)
        t, wall = wall_time((*place, math.cos(angle), math.sin(angle), 0, 0), a_table)
        x, y = position((*place, math.cos(angle), math.sin(angle), 0, 0), t)
        nx, ny = piece_normal(x, y, wall, outline)
        for off in (0.0, 1e-16, -1e-16):
            path = (x + off * nx, y + off * ny, nx - 0.1 * ny, ny + 0.1 * nx, 0.3 * nx, 0.3 * ny)
            assert wall_time(path, a_table, 1.0)[0] < 1e-15
            leaving = (*path[:2], -path[2], -path[3], 0.0, 0.0)
            assert wall_time(leaving, a_table)[0] > 1e-6
            pressed = (*path[:2], -0.1 * ny, 0.1 * nx, nx, ny)  # moves along the cushion, accelerates towards it
            assert wall_time(pressed, a_table, 1.0)[0] < 0.1


def test_a_ball_between_two_cushions_meets_the_one_that_it_approaches():
    slot = table([(0, 0), (1, 0), (1, 2 * R), (0, 2 * R)])
    assert wall_time((0, 0, 0.0, 1.0, 0, 0), slot) == (0.0, 2)
    assert wall_time((0, 0, 0.0, -1.0, 0, 0), slot) == (0.0, 0)
    assert wall_time((0, 0, 1.0, 0.0, 0, 0), slot)[1] == 1


def walls_met(place, velocity, wall, a_table):
    rows = np.zeros((1, WIDTH))
    rows[0, [X, Y, VX, VY]] = np.concatenate([place, velocity])
    scene: Any = scene_arrays(Scene(Balls((R,), (0.2,)), a_table, Physics()))
    return scene.walls.met(
        State(rows, np.zeros(1, np.int8)), 0, wall, scene._replace(laws=None, walls=None, space=None)
    )


@pytest.mark.parametrize("x", [1, -1])
@pytest.mark.parametrize("y", [1, -1])
def test_a_ball_in_a_corner_meets_both_cushions_if_it_approaches_both(x, y):
    for a_table, (across, along) in (
        (Table(1.0, 0.8), (int(x > 0), 2 + int(y > 0))),
        (with_corners(Table(1.0, 0.8)), (1 if x > 0 else 3, 2 if y > 0 else 0)),
    ):
        place = np.array([x * (0.5 - R), y * (0.4 - R)])
        for wall in (across, along):
            assert walls_met(place, (x, 0.3 * y), wall, a_table) == (across, along)
            assert walls_met(place - 5e-13, (x, 0.3 * y), wall, a_table) == (across, along)
        near = place - [0.0, 2e-12 * y]
        assert walls_met(near, (x, y), across, a_table) == (across, -1)
        assert walls_met(place, (x, 0.0), across, a_table) == (across, -1)
        assert walls_met(place, (x, -0.3 * y), across, a_table) == (across, -1)


def test_the_nearest_normals_on_both_sides_of_the_velocity_act():
    """The ball fills a regular hexagon and touches all sides; that of side k is at 30 + 60 k degrees."""
    angles = [math.radians(60 * k) for k in range(6)]
    hexagon = table([(2 * R / math.sqrt(3) * math.cos(a), 2 * R / math.sqrt(3) * math.sin(a)) for a in angles])
    for degrees, expected in ((30, {0}), (89, {0, 1}), (91, {1, 2}), (90, {1}), (10, {0, 5}), (-29, {0, 5})):
        velocity = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
        assert set(walls_met((0.0, 0.0), velocity, 0, hexagon)) - {-1} == expected


def test_two_pieces_that_touch_a_ball_at_one_point_are_one_cushion():
    a_table = TABLES["L"]
    joint, tip = joint_of(a_table)
    inward = np.array([tip.x0 - tip.x, tip.y0 - tip.y]) / tip.radius
    place = joint + R * inward
    outline = arrays(a_table)
    x, y = place.tolist()
    line = min(range(len(outline.lines)), key=lambda k: outline_walls._line_distance(x, y, outline.lines[k]))
    for wall in (line, len(outline.lines)):
        assert outline_walls._touches(x, y, wall, R, outline)
        assert walls_met(place, -inward, wall, a_table) == (wall, -1)


def test_a_ball_behind_the_continuation_of_a_cushion_comes_back_to_it():
    """The ball is behind the line of the lower arm's upper cushion, crosses it, and returns to it by acceleration."""
    a_table = TABLES["sharp L"]  # its inner corner is at (-0.2, -0.2), and the lower arm is on the right
    path = (-0.5, 0.2, 0.9, -1.5, 0.0, 2.6)
    check(path, a_table, 2.0)
    assert wall_time(path, a_table, 2.0)[1] < 4


def test_a_rectangle_and_an_outline_have_kernels_with_the_same_names_and_arguments():
    for name, *kernels in zip(Walls._fields, RECTANGLE, OUTLINE, strict=True):
        (arguments,) = {tuple(inspect.signature(kernel.py_func).parameters) for kernel in kernels}
        assert [kernel.py_func.__name__ for kernel in kernels] == [name] * 2
        assert f"        {name}: ({', '.join(arguments)}). Returns" in str(Walls.__doc__)


# Balls that overlap an outline


@settings(max_examples=100)
@given(ANY_TABLE, st.integers(0, 2**32))
@example(THROAT, 0)
def test_a_ball_anywhere_overlaps_a_cushion_unless_it_is_on_the_table(a_table, seed):
    rng = np.random.default_rng(seed)
    outline = arrays(a_table)
    scene, size = scene_with(outline), max(a_table.length, a_table.width)
    count = len(outline.lines) + len(outline.tips)
    for place in rng.uniform(-size, size, (20, 2)):
        room = float(clearance(a_table.outline, place))
        x, y = map(float, place)
        assert (OUTLINE.next_overlap(x, y, 0.0, 0.0, R, 0, scene) >= 0) == (room < R)
        for turn in range(TURNS):
            wall = OUTLINE.next_overlap(x, y, 0.0, 0.0, R, turn, scene)
            if wall < 0:
                break
            assert wall < count
            x, y = OUTLINE.back_to(x, y, R, wall, scene)
        # Outside a corner that is too acute for the ball its centre may remain outside by its radius.
        assert clearance(a_table.outline, (x, y)) > -R * (1 + 1e-9)


def test_a_ball_at_the_centre_of_an_arc_is_sent_to_the_middle_of_the_arc():
    tip = pieces(TABLES["L"].outline)[1][0]
    outline = arrays(TABLES["L"])
    beyond, nx, ny = OUTLINE.overlap(tip.x, tip.y, R, len(outline.lines), scene_with(outline))
    assert beyond == pytest.approx(R + tip.radius)
    assert (nx, ny) == pytest.approx((math.sqrt(0.5), math.sqrt(0.5)))
