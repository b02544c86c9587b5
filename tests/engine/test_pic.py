import dataclasses
import itertools
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from billiards_env import Scene, layouts, simulation
from billiards_env.engine.contact_rule import CONTACT_TIME
from billiards_env.physics import state as columns
from billiards_env.scene import Balls, Physics, Pocket, Table
from tests.helpers.shots import FREE, ROLLING, SLIDING, R, at_time, draw_shot, kinds, kinetic_energy, world

simulate: Any = simulation.simulate  # what it records is there wherever it is asked for

G, SLIDE, ROLL = 9.81, 0.2, 0.01


def rows(shot, ball):
    """The pieces of a ball's trajectory."""
    return shot.trajectory.rows[shot.trajectory.ball == ball]


def velocity(shot, ball, piece=-1):
    """With which a ball begins a piece of its trajectory."""
    return rows(shot, ball)[piece][[columns.VX, columns.VY]]


# Two balls


@pytest.mark.parametrize("physics", [FREE, ROLLING, SLIDING])
def test_like_elastic_balls_exchange_their_velocities_head_on(physics):
    shot = simulate(world(2, physics), [[-1.0, 0.0], [0.0, 0.0]], [3.0, 0.0], record=True)
    hit = shot.events[shot.events["kind"] == "ball_ball"][0]
    before = hit["speed"]
    v = rows(shot, 1)[1]
    assert (hit["ball"], hit["other"]) == (0, 1)
    assert velocity(shot, 1, 1) == pytest.approx([before, 0.0])
    stopped = next(row for row in rows(shot, 0) if row[columns.T0] == hit["time"])
    assert stopped[[columns.VX, columns.VY]] == pytest.approx([0.0, 0.0], abs=1e-15)
    assert v[columns.T0] == hit["time"]


@pytest.mark.parametrize(
    ("masses", "e", "after"),
    [
        ((3.0, 1.0), 1.0, (1.0, 3.0)),
        ((1.0, 3.0), 1.0, (-1.0, 1.0)),
        ((1.0, math.inf), 1.0, (-2.0, 0.0)),
        ((1.0, math.inf), 0.5, (-1.0, 0.0)),
        ((1.0, 1.0), 0.5, (0.5, 1.5)),
        ((1.0, 1.0), 0.0, (1.0, 1.0)),
    ],
)
def test_masses_and_restitution_head_on(masses, e, after):
    shot = simulate(world(2, FREE, mass=masses, e_ball=e), [[-1.0, 0.0], [0.0, 0.0]], [2.0, 0.0], max_time=1.0)
    assert shot.velocities == pytest.approx(np.array([[after[0], 0.0], [after[1], 0.0]]))
    assert shot.n_events == 1
    hit = (1 - 2 * R) / 2
    places = [[-2 * R + after[0] * (1 - hit), 0.0], [after[1] * (1 - hit), 0.0]]
    assert shot.positions == pytest.approx(np.array(places), abs=1e-14)


def test_a_fixed_obstacle_is_not_moved_by_many_balls():
    shot = simulate(
        world(3, SLIDING, mass=(0.2, math.inf, 0.2)),
        [[-1.0, 0.0], [0.0, 0.01], [0.5, 0.0]],
        [[3.0, 0.0], [0, 0], [-3, 0]],
    )
    assert shot.positions[1].tolist() == [0.0, 0.01]
    assert shot.velocities[1].tolist() == [0.0, 0.0]
    assert shot.status == "rest"


@pytest.mark.parametrize("physics", [FREE, ROLLING, SLIDING])
@pytest.mark.parametrize("offset", [0.1, 0.5, 0.9])
def test_like_elastic_balls_part_at_a_right_angle(physics, offset):
    shot = simulate(world(2, physics), [[-1.0, 2 * R * offset], [0.0, 0.0]], [3.0, 0.0], record=True)
    hit = shot.events[shot.events["kind"] == "ball_ball"][0]["time"]
    a, b = (next(r for r in rows(shot, i) if r[columns.T0] == hit)[[columns.VX, columns.VY]] for i in (0, 1))
    assert a @ b == pytest.approx(0.0, abs=1e-14)
    assert b[1] / b[0] == pytest.approx(-offset / math.sqrt(1 - offset**2))


@pytest.mark.parametrize("physics", [FREE, ROLLING, SLIDING])
@pytest.mark.parametrize(("beside", "hits"), [(1 - 1e-13, True), (1 + 1e-13, False)])
def test_a_graze_just_hits_or_just_misses(physics, beside, hits):
    shot = simulate(world(2, physics), [[-1.0, 2 * R * beside], [0.0, 0.0]], [2.5, 0.0], record=True, max_time=1.0)
    assert ("ball_ball" in shot.events["kind"]) == hits
    assert shot.first_hit == (1 if hits else -1)


@pytest.mark.parametrize(("factor", "meets"), [(1 + 1e-12, True), (1 - 1e-12, False)])
def test_a_rolling_ball_just_meets_or_just_fails_to(factor, meets):
    v = math.sqrt(2 * ROLL * G * (1.0 - 2 * R)) * factor
    shot = simulate(world(2, ROLLING), [[-1.0, 0.0], [0.0, 0.0]], [v, 0.0], record=True)
    assert ("ball_ball" in shot.events["kind"]) == meets
    assert shot.status == "rest"


@pytest.mark.parametrize(("nearer", "meets"), [(1e-12, True), (-1e-12, False)])
def test_of_two_decelerating_balls_the_one_behind_just_meets_the_one_ahead_or_not(nearer, meets):
    # The sliding ball loses 1.962 m/s^2, the rolling one 0.0981: they are nearest when their speeds are equal.
    v, w, a, b = 2.0, 1.5, SLIDE * G, ROLL * G
    gap = (v - w) ** 2 / (2 * (a - b)) - nearer
    shot = simulate(
        world(2, SLIDING),
        [[0.0, 0.0], [2 * R + gap, 0.0]],
        [[v, 0.0], [w, 0.0]],
        spins=[[0.0, 0.0, 0.0], [0.0, w / R, 0.0]],
        max_time=0.5,
        record=True,
    )
    assert ("ball_ball" in shot.events["kind"]) == meets
    if meets:
        assert shot.events["time"][0] == pytest.approx((v - w) / (a - b), abs=1e-5)


@pytest.mark.parametrize("physics", [FREE, ROLLING, SLIDING])
@pytest.mark.parametrize("gap", [0.0, 1e-9, 0.5])
@pytest.mark.parametrize("direction", [(1.0, 0.0), (0.0, 1.0), (0.6, 0.8)])
def test_balls_that_move_alike_never_meet(physics, gap, direction):
    # side by side, and one behind the other
    places = [[0.0, 0.0], [2 * R + gap, 0.0]]
    shot = simulate(world(2, physics), places, [direction, direction], record=True)
    assert "ball_ball" not in shot.events["kind"]
    moved = shot.positions - np.array(places)
    assert moved[0] == pytest.approx(moved[1], abs=1e-15)


def test_touching_balls_collide_at_once_if_they_approach():
    places = [[0.0, 0.0], [2 * R, 0.0]]
    together = simulate(world(2, FREE), places, [1.0, 0.0], max_time=1.0, record=True)
    assert [tuple(e)[:4] for e in together.events] == [(0.0, "ball_ball", 0, 1)]
    assert together.velocities == pytest.approx(np.array([[0.0, 0.0], [1.0, 0.0]]))
    for direction in ((-1.0, 0.0), (0.0, 1.0), (-1.0, 1e-9)):
        assert simulate(world(2, FREE), places, direction, max_time=1.0).n_events == 0


def test_a_ball_that_leaves_another_and_comes_back_meets_it_again():
    # Top spin brings it back to the obstacle: no root at 0, one at 2 v / a.
    scene = world(2, SLIDING, mass=(0.2, math.inf))
    shot = simulate(scene, [[-2 * R, 0.0], [0.0, 0.0]], [-0.5, 0.0], spins=[0.0, 100.0, 0.0], record=True)
    assert kinds(shot)[0] == ("ball_ball", 0, 1)
    assert shot.events["time"][0] == pytest.approx(2 * 0.5 / (SLIDE * G), rel=1e-14)


# One ball


def test_a_struck_ball_slides_rolls_and_stops_where_the_closed_form_says():
    v, mu = 3.0, SLIDE * G
    shot = simulate(world(1, SLIDING), [[0.0, 0.0]], [0.6 * v, -0.8 * v], record=True)
    slide, roll = 2 * v / (7 * mu), 5 * v / 7
    distance = 12 * v * v / (49 * mu)
    assert kinds(shot) == [("sliding_rolling", 0, -1), ("rolling_rest", 0, -1)]
    assert shot.events["time"] == pytest.approx([slide, slide + roll / (ROLL * G)], rel=1e-14)
    assert shot.at(slide)[0] == pytest.approx(np.array([0.6, -0.8]) * distance, rel=1e-13)
    assert velocity(shot, 0, 1) == pytest.approx(np.array([0.6, -0.8]) * roll, rel=1e-14)
    total = distance + roll**2 / (2 * ROLL * G)
    assert shot.positions[0] == pytest.approx(np.array([0.6, -0.8]) * total, rel=1e-13)
    assert (shot.status, shot.velocities.any(), shot.spins.any()) == ("rest", False, False)
    assert shot.time == shot.events["time"][-1]


def test_a_ball_with_natural_roll_never_slides():
    shot = simulate(world(1, SLIDING), [[0.0, 0.0]], [1.0, 0.0], spins=[0.0, 1.0 / R, 0.0], record=True)
    assert kinds(shot) == [("rolling_rest", 0, -1)]
    assert shot.positions[0, 0] == pytest.approx(1 / (2 * ROLL * G), rel=1e-14)


@pytest.mark.parametrize(("spin", "roll"), [(-4.0, -3 / 7), (-2.5, 0.0), (3.0, 11 / 7)])
def test_draw_stop_and_follow(spin, roll):
    # the slip u = v - R wy is used up at v - 2 u / 7
    shot = simulate(world(1, SLIDING), [[0.0, 0.0]], [1.0, 0.0], spins=[0.0, spin / R, 0.0], record=True)
    u, mu = 1.0 - spin, SLIDE * G
    t = 2 * abs(u) / (7 * mu)
    after_slide = t - math.copysign(0.5 * mu * t * t, u)
    assert shot.events["time"][0] == pytest.approx(t, rel=1e-14)
    assert shot.at(t)[0, 0] == pytest.approx(after_slide, rel=1e-12)
    end = after_slide + math.copysign(roll**2 / (2 * ROLL * G), roll)
    assert shot.positions[0, 0] == pytest.approx(end, rel=1e-12)


@pytest.mark.parametrize(("spin", "direction"), [(0.0, 0), (1.0, 1), (-1.0, -1)])
def test_after_a_full_hit_the_cue_ball_stops_follows_or_draws(spin, direction):
    # it arrives with what is left of its spin, as it leaves its velocity to the other ball
    shot = simulate(world(2, SLIDING), [[-2 * R, 0.0], [0.0, 0.0]], [1.0, 0.0], spins=[0.0, spin / R, 0.0], record=True)
    distance = 0.0
    if spin:
        v = 2 / 7
        distance = 0.5 * v * v / (SLIDE * G) + v * v / (2 * ROLL * G)
    assert shot.positions[0, 0] + 2 * R == pytest.approx(direction * distance, abs=1e-14)


def test_a_stopped_ball_spins_on_until_its_spin_has_decayed():
    shot = simulate(world(1, SLIDING, spin_decay=2.0), [[0.0, 0.0]], [0.1, 0.0], spins=[0.0, 0.0, -40.0], record=True)
    assert kinds(shot) == [("sliding_rolling", 0, -1), ("rolling_rest", 0, -1), ("spinning_rest", 0, -1)]
    assert shot.time == pytest.approx(20.0)
    assert shot.positions[0, 1] == 0.0
    short = simulate(world(1, SLIDING, spin_decay=2.0), [[0.0, 0.0]], [0.1, 0.0], spins=[0.0, 0.0, 0.5], record=True)
    assert kinds(short) == [("sliding_rolling", 0, -1), ("rolling_rest", 0, -1)]
    half = simulate(world(1, SLIDING, spin_decay=2.0), [[0.0, 0.0]], [0.1, 0.0], spins=[0.0, 0.0, -40.0], max_time=5.0)
    assert half.spins[0, 2] == pytest.approx(-30.0)
    assert half.status == "max_time"


# Cushions


def test_a_bank_off_restitution_cushions():
    scene = world(1, FREE, Table(2.0, 4.0), e_cushion=0.5)
    shot = simulate(scene, [[0.0, 0.0]], [2.0, 1.0], max_time=1.0, record=True)
    hit = (1 - R) / 2
    assert kinds(shot) == [("cushion", 0, 1)]
    assert shot.events["time"][0] == hit
    assert shot.events["speed"][0] == 2.0
    assert shot.velocities[0].tolist() == [-1.0, 1.0]
    assert shot.positions[0] == pytest.approx([1 - R - (1 - hit), 1.0], rel=1e-15)
    assert shot.cushions.tolist() == [1]


@pytest.mark.parametrize(("side", "start"), [(0, (-1.0, 0.5)), (1, (1.0, 0.5)), (2, (0.5, -1.0)), (3, (0.5, 1.0))])
def test_cushions_are_numbered_from_minus_x_to_plus_y(side, start):
    shot = simulate(world(1, FREE, Table(2.0, 2.0)), [[0.0, 0.0]], start, max_time=1.0, record=True)
    assert kinds(shot) == [("cushion", 0, side)]


def test_a_rolling_ball_bounces_straight_off_a_han_cushion_as_the_formula_says():
    # v_n' = v (1 - (1 + e) cos^2 - mu (1 + e) cos sin), where friction slides on the nose
    scene = world(1, SLIDING, Table(2.0, 4.0, cushion_height=1.25 * R), e_cushion=0.75, mu_cushion=0.1)
    shot = simulate(scene, [[0.5, 0.0]], [1.0, 0.0], spins=[0.0, 1.0 / R, 0.0], record=True)
    v = math.sqrt(1 - 2 * ROLL * G * (0.5 - R))
    sin, cos = 0.25, math.sqrt(1 - 0.25**2)
    after = v * (1 - 1.75 * cos * cos - 0.1 * 1.75 * cos * sin)
    assert kinds(shot)[0] == ("cushion", 0, 1)
    assert shot.events["speed"][0] == pytest.approx(v, rel=1e-14)
    assert velocity(shot, 0, 1) == pytest.approx([after, 0.0], rel=1e-13)
    # the spin about y: R dwy = 5/2 (PX sin - PZ cos) = -5/2 mu (1 + e) v cos
    row = rows(shot, 0)[1]
    assert row[columns.VX] - row[columns.UX] == pytest.approx(v - 2.5 * 0.1 * 1.75 * v * cos, rel=1e-13)


@pytest.mark.parametrize("physics", [FREE, ROLLING, SLIDING])
@pytest.mark.parametrize(("half", "axis"), [((1.0, 2.0), 0), ((2.0, 1.0), 1)])
@pytest.mark.parametrize("sign", [1, -1])
def test_a_ball_frozen_to_a_cushion_rolls_along_it(physics, half, axis, sign):
    place, start = np.zeros(2), np.zeros(2)
    place[axis], start[1 - axis] = sign * (1.0 - R), 1.0
    shot = simulate(world(1, physics, Table(2 * half[0], 2 * half[1])), [place], start, max_time=1.5, record=True)
    assert shot.positions[0, axis] == place[axis]
    assert shot.cushions.tolist() == [0]
    assert shot.positions[0, 1 - axis] > 0.5


def test_a_ball_frozen_to_a_cushion_and_struck_into_it_leaves_it():
    shot = simulate(world(1, FREE, Table(2.0, 2.0)), [[1.0 - R, 0.0]], [1.0, 0.5], max_time=0.5, record=True)
    assert kinds(shot) == [("cushion", 0, 1)]
    assert shot.events["time"][0] == 0.0
    assert shot.velocities[0].tolist() == [-1.0, 0.5]


@pytest.mark.parametrize("physics", [FREE, ROLLING, SLIDING])
def test_a_ball_frozen_in_a_corner_and_struck_into_it_comes_out_along_the_diagonal(physics):
    shot = simulate(world(1, physics, Table(2.0, 2.0)), [[1 - R, 1 - R]], [2.0, 2.0], max_time=0.3, record=True)
    assert kinds(shot)[:2] == [("cushion", 0, 1), ("cushion", 0, 3)]
    assert shot.events["time"][:2].tolist() == [0.0, 0.0]
    assert (shot.positions[0] < 1 - R - 0.05).all()


@pytest.mark.parametrize("physics", [ROLLING, SLIDING])
@pytest.mark.parametrize("e", [0.0, 0.95, 1.0])
def test_a_ball_frozen_in_a_corner_is_struck_by_another(physics, e):
    scene = world(2, physics, Table(2.0, 2.0), e_ball=e)
    places = [[0.5, 0.5], [1 - R, 1 - R]]
    shot = simulate(scene, places, [2.0, 2.0], record=True, max_events=2000)
    assert shot.status == "rest"
    assert shot.first_hit == 1
    check_every_instant(scene, shot)


def test_a_ball_resting_on_a_cushion_takes_a_hit_along_its_normal():
    # the blow goes through it into the cushion and comes back
    scene = world(2, FREE, Table(2.0, 2.0), mass=(1.0, 1.0))
    shot = simulate(scene, [[0.5, 0.0], [1 - R, 0.0]], [1.0, 0.0], max_time=1.0, record=True)
    assert kinds(shot) == [("ball_ball", 0, 1), ("cushion", 1, 1), ("ball_ball", 0, 1)]
    assert shot.velocities == pytest.approx(np.array([[-1.0, 0.0], [0.0, 0.0]]))


# Pockets


@pytest.mark.parametrize("physics", [FREE, ROLLING])
def test_a_ball_is_captured_when_its_centre_enters_the_circle(physics):
    table = Table(2.0, 2.0, pockets=(Pocket(1.0, 1.0, 0.1), Pocket(0.25, 0.5, 0.125)))
    shot = simulate(world(1, physics, table), [[-0.5, 0.5]], [2.0, 0.0], record=True)
    distance, a = 0.625, 0.0 if physics is FREE else ROLL * G
    speed = math.sqrt(4 - 2 * a * distance)
    assert kinds(shot) == [("pocket", 0, 1)]
    assert shot.time == shot.events["time"][0] == pytest.approx(2 * distance / (2 + speed), rel=1e-15)
    assert shot.events["speed"][0] == pytest.approx(speed, rel=1e-14)
    assert shot.positions.tolist() == [[0.25, 0.5]]
    assert (shot.potted.tolist(), shot.velocities.any(), shot.status) == ([True], False, "rest")


def test_a_captured_ball_is_out_of_the_way():
    table = Table(2.0, 2.0, pockets=(Pocket(0.0, 0.0, 0.1),))
    places = [[-0.9, 0.0], [-0.5, 0.0]]
    shot = simulate(world(2, ROLLING, table), places, [[1.0, 0.0], [1.0, 0.0]], record=True)
    assert kinds(shot) == [("pocket", 1, 0), ("pocket", 0, 0)]
    assert shot.positions.tolist() == [[0.0, 0.0]] * 2
    assert shot.potted.all()


def test_a_ball_frozen_to_a_pocket_s_edge_falls_if_it_moves_in():
    table = Table(2.0, 2.0, pockets=(Pocket(0.0, 0.0, 0.125),))
    assert kinds(simulate(world(1, ROLLING, table), [[-0.125, 0.0]], [1.0, 0.0], record=True)) == [("pocket", 0, 0)]
    assert kinds(simulate(world(1, ROLLING, table), [[-0.125, 0.0]], [0.0, 0.3], record=True)) == [
        ("rolling_rest", 0, -1)
    ]
    assert kinds(simulate(world(1, ROLLING, table), [[-0.125, 0.0]], [-0.3, 0.0], record=True)) == [
        ("rolling_rest", 0, -1)
    ]


def test_a_pocket_comes_before_a_cushion_and_an_impact_of_the_same_instant():
    table = Table(2.0, 2.0, pockets=(Pocket(1 - R + 0.125, 0.0, 0.125),))
    shot = simulate(world(1, FREE, table), [[0.0, 0.0]], [1.0, 0.0], record=True)
    assert kinds(shot) == [("pocket", 0, 0)]
    both = simulate(world(2, FREE, table), [[0.0, 0.0], [1 - R, 2 * R]], [1.0, 0.0], record=True)
    assert kinds(both) == [("pocket", 0, 0)]


# Nothing to do, and limits


@pytest.mark.parametrize("name", ["pool", "carom", "ideal"])
def test_a_shot_without_velocity_is_over_at_once(name):
    scene = Scene.named(name, 3)
    places = layouts.draw("random", scene, np.random.default_rng(0))
    for arguments in ({}, {"max_time": 0.0}, {"max_events": 0}):
        shot = simulate(scene, places, [0.0, 0.0], record=True, **arguments)
        assert (shot.status, shot.n_events, shot.time, len(shot.events)) == ("rest", 0, 0.0, 0)
        assert np.array_equal(shot.positions, places)


def test_a_frozen_rack_at_rest_stays_at_rest():
    scene = Scene.named("pool", 15)
    places = layouts.draw("tight_rack", scene, np.random.default_rng(0))
    shot = simulate(scene, places, [0.0, 0.0])
    assert (shot.status, shot.n_events) == ("rest", 0)
    assert np.array_equal(shot.positions, places)


def test_a_zero_length_shot_leaves_everything_where_it_is():
    scene = Scene.named("pool", 1)
    shot = simulate(scene, [[-0.5, 0.0], [0.5, 0.0]], [1.0, 2.0], max_time=0.0)
    assert (shot.status, shot.time, shot.n_events) == ("max_time", 0.0, 0)
    assert shot.positions.tolist() == [[-0.5, 0.0], [0.5, 0.0]]
    assert shot.velocities.tolist() == [[1.0, 2.0], [0.0, 0.0]]


def test_a_shot_ends_at_its_time_limit_with_what_moves_still_moving():
    shot = simulate(world(1, ROLLING), [[0.0, 0.0]], [1.0, 0.0], max_time=2.0)
    assert (shot.status, shot.time) == ("max_time", 2.0)
    assert shot.velocities[0, 0] == pytest.approx(1 - 2 * ROLL * G)
    assert shot.positions[0, 0] == pytest.approx(2 - 0.5 * ROLL * G * 4)
    assert simulate(world(1, ROLLING, max_time=2.0), [[0.0, 0.0]], [1.0, 0.0]).time == 2.0
    assert simulate(world(1, ROLLING, max_time=2.0), [[0.0, 0.0]], [1.0, 0.0], max_time=1.0).time == 1.0
    early = simulate(world(1, ROLLING, max_time=99.0), [[0.0, 0.0]], [1.0, 0.0])
    assert early.status == "rest"
    assert early.time == pytest.approx(1 / (ROLL * G))


def test_a_shot_is_given_up_loudly_at_its_limit_of_events():
    scene = Scene.named("carom")
    rng = np.random.default_rng(3)
    places = layouts.draw("random", scene, rng)
    whole = simulate(scene, places, [4.0, 3.0], record=True)
    part = simulate(scene, places, [4.0, 3.0], record=True, max_events=4)
    assert (part.status, part.n_events) == ("event_limit", 4)
    assert np.array_equal(part.events, whole.events[:4])
    assert part.time == whole.events["time"][3]
    assert part.positions == pytest.approx(whole.at(part.time), abs=1e-14)
    assert simulate(scene, places, [4.0, 3.0], max_events=whole.n_events).status == "rest"


def test_a_ball_that_nothing_touches_is_never_logged():
    shot = simulate(world(3, SLIDING), [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], [2.0, 0.0], record=True)
    assert set(shot.events["ball"]) | set(shot.events["other"]) == {0, 1, -1}
    assert len(rows(shot, 2)) == 1
    assert shot.positions[2].tolist() == [0.0, 1.0]


def test_what_the_cue_ball_did_first_is_counted():
    # off the +x cushion into ball 2, past ball 1
    shot = simulate(
        world(3, FREE, Table(2.0, 2.0)), [[0.0, 0.0], [0.0, 0.5], [-0.5, 0.0]], [1.0, 0.0], max_time=3.0, record=True
    )
    assert kinds(shot)[:2] == [("cushion", 0, 1), ("ball_ball", 0, 2)]
    assert shot.first_hit == 2
    assert shot.cushions_before_hit.tolist() == [-1, -1, 1]
    assert shot.cushions.tolist()[:2] == [1, 0]


# Several at one instant


@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
def test_a_ball_into_the_gap_between_two_touching_balls(e):
    # the plastic impulse along each normal is m v cos(30) / 2.5; the shares of e follow
    x = 2 * R * math.cos(math.pi / 6)
    scene = world(3, FREE, e_ball=e)
    shot = simulate(scene, [[-1 - x, 0.0], [0.0, R], [0.0, -R]], [2.0, 0.0], max_time=0.75, record=True)
    assert kinds(shot)[:2] == [("ball_ball", 0, 1), ("ball_ball", 0, 2)]
    assert shot.velocities[0] == pytest.approx([2 * (1 - 0.6 * (1 + e)), 0.0], abs=1e-14)
    speed = (1 + e) * 2 * math.cos(math.pi / 6) / 2.5
    sides = speed * np.array([[math.cos(math.pi / 6), math.sin(math.pi / 6)], [math.cos(math.pi / 6), -0.5]])
    assert shot.velocities[1:] == pytest.approx(sides, rel=1e-12)
    assert np.array_equal(shot.positions[1] * [1, -1], shot.positions[2])


@pytest.mark.parametrize("striking", [1, 2, 3])
def test_newton_s_cradle(striking):
    n = 6
    places = np.zeros((n, 2))
    places[:, 0] = 2 * R * np.arange(n)
    places[:striking, 0] -= 0.5
    velocities = np.zeros((n, 2))
    velocities[:striking, 0] = 1.0
    shot = simulate(world(n, FREE, mass=(1.0,) * n), places, velocities, max_time=1.0)
    assert shot.velocities[:, 0] == pytest.approx([0.0] * (n - striking) + [1.0] * striking, abs=1e-15)
    assert not shot.velocities[:, 1].any()


def test_a_frozen_rack_breaks_without_losing_momentum_or_energy():
    scene = dataclasses.replace(Scene.named("ideal", 15), balls=Balls((R,) * 16, (0.2,) * 16))
    for seed in range(5):
        rng = np.random.default_rng(seed)
        places = layouts.draw("tight_rack", scene, rng)
        start = 4 * (places[1] - places[0]) + rng.normal(size=2) * 0.02
        whole = simulate(scene, places, start, record=True)
        cushion = whole.events["time"][whole.events["kind"] == "cushion"][0]
        shot = simulate(scene, places, start, max_time=float(np.nextafter(cushion, 0)), record=True)
        assert shot.n_events > 20
        assert shot.velocities.sum(axis=0) == pytest.approx(start, rel=1e-13)
        assert (shot.velocities**2).sum() == pytest.approx(start @ start, rel=1e-12)
        assert (whole.velocities**2).sum() == pytest.approx(start @ start, rel=1e-11)
        assert (np.linalg.norm(shot.velocities[1:], axis=1) > 0).all()
        check_every_instant(scene, shot)


def test_a_symmetric_break_stays_symmetric():
    scene = Scene.named("pool", 15)
    places = layouts.draw("tight_rack", scene, np.random.default_rng(0))
    places[0] = -0.6, 0.0
    shot = simulate(scene, places, [5.0, 0.0])
    mirrored = {(x, -y) for x, y in shot.positions.tolist()}
    assert {(x, y) for x, y in shot.positions.tolist()} == mirrored
    assert shot.positions[0, 1] == 0.0


# What holds for every shot


def play(scene, places, velocities, spins, record=False):
    """The shot, ideal ones for 3 s."""
    horizon = 3.0 if scene.physics.motion == "ideal" else None
    return simulate(scene, places, velocities, spins=spins, max_time=horizon, record=record, max_events=50_000)


@settings(max_examples=60)
@given(st.integers(0, 10**6))
def test_mirrored_shots_mirror_bit_for_bit(seed):
    scene, places, velocities, spins = draw_shot(seed)
    shot = play(scene, places, velocities, spins)
    for mirror in (np.array([-1.0, 1.0]), np.array([1.0, -1.0]), np.array([-1.0, -1.0])):
        x, y = mirror
        turned = None if spins is None else spins * [y, x, x * y]  # a spin is an axial vector
        image = play(scene, places * mirror, velocities * mirror, turned)
        assert np.array_equal(image.positions, shot.positions * mirror)
        assert np.array_equal(image.velocities, shot.velocities * mirror)
        assert (image.time, image.n_events) == (shot.time, shot.n_events)


@settings(max_examples=60)
@given(st.integers(0, 10**6))
def test_how_object_balls_are_numbered_changes_no_bit(seed):
    scene, places, velocities, spins = draw_shot(seed)
    order = np.r_[0, 1 + np.random.default_rng(seed).permutation(scene.n_balls - 1)]
    shot = play(scene, places, velocities, spins)
    other = play(scene, places[order], velocities[order], None if spins is None else spins[order])
    assert np.array_equal(other.positions, shot.positions[order])
    assert np.array_equal(other.velocities, shot.velocities[order])
    assert np.array_equal(other.spins, shot.spins[order])
    assert np.array_equal(other.cushions, shot.cushions[order])
    assert (other.time, other.n_events) == (shot.time, shot.n_events)


def test_numbering_matters_not_where_friction_presses_a_frozen_rack_together():
    scene = Scene.named("pool", 6)
    for seed in range(5):
        rng = np.random.default_rng(seed)
        places, spins = layouts.draw("tight_rack", scene, rng), rng.normal(size=(7, 3)) * 50
        start = 3 * (places[1] - places[0])
        order = np.r_[0, 1 + rng.permutation(6)]
        shot = play(scene, places, start, spins)
        other = play(scene, places[order], start, spins[order])
        assert np.array_equal(other.positions, shot.positions[order])


def instants(shot):
    """The events' times and, for each, the state (n, WIDTH) and phase (n,) of all balls just before and after."""
    n = len(shot.positions)
    ball, phases, rows = shot.trajectory
    state, phase = rows[:n].copy(), phases[:n].copy()
    times = rows[n:, columns.T0]
    edges = np.r_[0, np.flatnonzero(np.diff(times)) + 1, len(times)] if len(times) else [0]
    for a, b in itertools.pairwise(edges):
        before = at_time(state, phase, times[a])
        for k in range(n + a, n + b):
            state[ball[k]], phase[ball[k]] = rows[k], phases[k]
        yield times[a], before, at_time(state, phase, times[a]), phase.copy()


def check_every_instant(scene, shot):
    """No overlap, nothing outside, at any event and in between."""
    radius = np.array(scene.balls.radius)
    room = np.array([scene.table.length, scene.table.width]) / 2 - radius[:, None]
    reach = radius[:, None] + radius + np.diag(np.full(len(radius), -np.inf))
    gone = np.full(len(radius), np.inf)
    for event in shot.events[shot.events["kind"] == "pocket"]:
        gone[event["ball"]] = event["time"]
    times = np.unique(np.r_[0.0, shot.events["time"], shot.time])
    if len(times) > 60:
        times = times[np.linspace(0, len(times) - 1, 60).astype(int)]
    for t in np.r_[times, 0.5 * (times[1:] + times[:-1])]:
        places = shot.at(t)
        on = gone > t
        assert (np.abs(places[on]) <= room[on] + 1e-12).all()
        apart = np.linalg.norm(places[:, None] - places, axis=-1) - reach
        assert apart[on][:, on].min(initial=np.inf) >= -1e-12


@settings(max_examples=60)
@given(st.integers(0, 10**6))
def test_energy_never_rises_momentum_is_exchanged_and_nothing_overlaps(seed):
    scene, places, velocities, spins = draw_shot(seed)
    shot = play(scene, places, velocities, spins, record=True)
    assume(shot.status != "event_limit")  # of dead balls in a heap, which tests.stress runs to rest
    assert shot.status == ("max_time" if scene.physics.motion == "ideal" else "rest")
    assert shot.n_events == len(shot.events)
    check_every_instant(scene, shot)
    mass = np.array(scene.balls.mass)
    impacts = {}
    for event in shot.events:
        impacts.setdefault(event["time"], set()).add(event["kind"])
    acts = set(shot.events["time"][shot.events["rule"]].tolist())
    # An act of the contact-time rule may lend a pair as much as friction takes from it within the contact.
    p = scene.physics
    act = 0.5 * mass.max() * (3.0 * CONTACT_TIME * (p.mu_slide if p.motion == "sliding" else p.mu_roll) * p.g) ** 2
    start = kinetic_energy(
        at_time(shot.trajectory.rows[: scene.n_balls], shot.trajectory.phase[: scene.n_balls], 0.0), scene
    )
    last, rises = start, 0.0
    for t, before, after, _ in instants(shot):
        now = kinetic_energy(after, scene)
        assert kinetic_energy(before, scene) <= last + 1e-14 * start
        rises += max(0.0, now - kinetic_energy(before, scene) - 1e-14 * start)
        last = now
        # The rule may bring balls to rest, and with them what they run into.
        if impacts[t] == {"ball_ball"} and t not in acts:
            change = mass @ (after[:, 2:4] - before[:, 2:4])
            assert np.abs(change).max() <= 1e-13 * (mass @ np.linalg.norm(before[:, 2:4], axis=1))
    assert rises <= shot.n_contact_rule * act
    if p.motion == "ideal":
        end = np.c_[shot.positions, shot.velocities, shot.velocities, shot.spins[:, 2:]]
        assert kinetic_energy(end, scene) == pytest.approx(start)
    counted = [int(((shot.events["kind"] == "cushion") & (shot.events["ball"] == i)).sum()) for i in range(len(places))]
    assert shot.cushions.tolist() == counted


def test_dead_balls_that_push_each_other_come_to_rest():
    # impacts weaker than the rounding of the velocities must not follow each other for ever
    scene = Scene(Balls.uniform(3), physics=Physics(motion="rolling", cushion="restitution", e_ball=0.0))
    places = [
        [0.7546465550499861, 0.18634748698850304],
        [0.2722874709803904, -0.29334855696128165],
        [-0.9428818522660272, -0.5643652584341258],
    ]
    velocities = [
        [1.0536954305407527, 1.174844680144182],
        [-2.4301633276908885, 1.8900956367117439],
        [-1.747814538299288, -2.473654305026787],
    ]
    shot = simulate(scene, places, velocities, max_events=2000)
    assert shot.status == "rest"
