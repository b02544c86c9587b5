import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from billiards_env import Scene
from billiards_env.engine.contact_rule import CONTACT_TIME
from billiards_env.physics import state as columns
from billiards_env.scene import Balls, Physics, layouts
from billiards_env.scene.table import Pocket, Table
from tests.helpers.shots import (
    FREE,
    ROLLING,
    SLIDING,
    Motion,
    R,
    check_mirror_images,
    check_renumbering,
    draw_shot,
    instants,
    kinds,
    kinetic_energy,
    motion_at,
    simulate,
    world,
)

G, SLIDE, ROLL = 9.81, 0.2, 0.01


def rows(shot, ball):
    """Returns the rows of the pieces of a ball's trajectory."""
    return shot.trajectory.rows[shot.trajectory.ball == ball]


def velocity(shot, ball, piece=-1):
    """Returns the velocity, m/s, of a ball at the start of a piece of its trajectory."""
    return rows(shot, ball)[piece][[columns.VX, columns.VY]]


# Two balls


@pytest.mark.parametrize(
    ("masses", "e", "after"),
    [
        ((1.0, 1.0), 1.0, (0.0, 2.0)),
        ((3.0, 1.0), 1.0, (1.0, 3.0)),
        ((1.0, 3.0), 1.0, (-1.0, 1.0)),
        ((1.0, math.inf), 1.0, (-2.0, 0.0)),
        ((1.0, math.inf), 0.5, (-1.0, 0.0)),
        ((1.0, 1.0), 0.5, (0.5, 1.5)),
        ((1.0, 1.0), 0.0, (1.0, 1.0)),
    ],
)
def test_head_on_collisions_follow_masses_and_restitution(masses, e, after):
    shot = simulate(world(2, FREE, mass=masses, e_ball=e), [[-1.0, 0.0], [0.0, 0.0]], [2.0, 0.0], max_time=1.0)
    assert shot.velocities == pytest.approx(np.array([[after[0], 0.0], [after[1], 0.0]]))
    assert shot.n_events == 1
    hit = (1 - 2 * R) / 2
    places = [[-2 * R + after[0] * (1 - hit), 0.0], [after[1] * (1 - hit), 0.0]]
    assert shot.positions == pytest.approx(np.array(places), abs=1e-14)


def test_impacts_do_not_move_a_fixed_ball():
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
def test_elastic_balls_of_equal_mass_separate_at_a_right_angle(physics, offset):
    shot = simulate(world(2, physics), [[-1.0, 2 * R * offset], [0.0, 0.0]], [3.0, 0.0], record=True)
    hit = shot.events[shot.events["kind"] == "ball_ball"][0]["time"]
    a, b = (next(r for r in rows(shot, i) if r[columns.T0] == hit)[[columns.VX, columns.VY]] for i in (0, 1))
    assert a @ b == pytest.approx(0.0, abs=1e-14)
    assert b[1] / b[0] == pytest.approx(-offset / math.sqrt(1 - offset**2))


@pytest.mark.parametrize("physics", [FREE, ROLLING, SLIDING])
@pytest.mark.parametrize(("offset", "hits"), [(1 - 1e-13, True), (1 + 1e-13, False)])
def test_a_graze_is_decided_to_13_digits(physics, offset, hits):
    shot = simulate(world(2, physics), [[-1.0, 2 * R * offset], [0.0, 0.0]], [2.5, 0.0], record=True, max_time=1.0)
    assert ("ball_ball" in shot.events["kind"]) == hits
    assert shot.first_hit == (1 if hits else -1)


@pytest.mark.parametrize(("factor", "meets"), [(1 + 1e-12, True), (1 - 1e-12, False)])
def test_whether_a_rolling_ball_reaches_another_is_decided_to_12_digits(factor, meets):
    v = math.sqrt(2 * ROLL * G * (1.0 - 2 * R)) * factor
    shot = simulate(world(2, ROLLING), [[-1.0, 0.0], [0.0, 0.0]], [v, 0.0], record=True)
    assert ("ball_ball" in shot.events["kind"]) == meets
    assert shot.status == "rest"


@pytest.mark.parametrize(("nearer", "meets"), [(1e-12, True), (-1e-12, False)])
def test_whether_a_sliding_ball_reaches_a_rolling_ball_is_decided_to_12_digits(nearer, meets):
    # The decelerations are 1.962 and 0.0981 m/s^2. The distance is smallest when the speeds are equal.
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
def test_balls_with_equal_velocities_do_not_collide(physics, gap, direction):
    places = [[0.0, 0.0], [2 * R + gap, 0.0]]
    shot = simulate(world(2, physics), places, [direction, direction], record=True)
    assert "ball_ball" not in shot.events["kind"]
    moved = shot.positions - np.array(places)
    assert moved[0] == pytest.approx(moved[1], abs=1e-15)


def test_balls_in_contact_collide_at_time_0_if_they_approach():
    places = [[0.0, 0.0], [2 * R, 0.0]]
    together = simulate(world(2, FREE), places, [1.0, 0.0], max_time=1.0, record=True)
    assert together.events[["time", "kind", "ball", "other"]].tolist() == [(0.0, "ball_ball", 0, 1)]
    assert together.velocities == pytest.approx(np.array([[0.0, 0.0], [1.0, 0.0]]))
    for direction in ((-1.0, 0.0), (0.0, 1.0), (-1.0, 1e-9)):
        assert simulate(world(2, FREE), places, direction, max_time=1.0).n_events == 0


def test_a_ball_that_moves_away_and_returns_collides_again():
    # Top spin reverses its motion. The root at 0 does not count, the one at 2 v / a does.
    scene = world(2, SLIDING, mass=(0.2, math.inf))
    shot = simulate(scene, [[-2 * R, 0.0], [0.0, 0.0]], [-0.5, 0.0], spins=[0.0, 100.0, 0.0], record=True)
    assert kinds(shot)[0] == ("ball_ball", 0, 1)
    assert shot.events["time"][0] == pytest.approx(2 * 0.5 / (SLIDE * G), rel=1e-14)


def test_a_plastic_full_hit_is_not_repeated():
    # The rounding of the velocities after it is no approach. The rounding of the gap may cause a second contact.
    scene = world(2, FREE, mass=(0.2, 0.3), e_ball=0.0)
    for angle in np.random.default_rng(0).uniform(0.0, 2 * math.pi, 20):
        along = np.array([math.cos(angle), math.sin(angle)])
        shot = simulate(scene, [-0.3 * along, [0.0, 0.0]], 2 * along, max_time=1.0)
        assert shot.n_events <= 2


# One ball


def test_sliding_rolling_and_stopping_follow_the_closed_form():
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


def test_a_ball_with_natural_roll_does_not_slide():
    shot = simulate(world(1, SLIDING), [[0.0, 0.0]], [1.0, 0.0], spins=[0.0, 1.0 / R, 0.0], record=True)
    assert kinds(shot) == [("rolling_rest", 0, -1)]
    assert shot.positions[0, 0] == pytest.approx(1 / (2 * ROLL * G), rel=1e-14)


@pytest.mark.parametrize(("spin", "roll"), [(-4.0, -3 / 7), (-2.5, 0.0), (3.0, 11 / 7)])
def test_spin_changes_the_velocity_at_the_end_of_sliding(spin, roll):
    # The slip u = v - R wy is zero at the velocity v - 2 u / 7.
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
    # The cue ball gives its velocity to the other ball and keeps its spin.
    shot = simulate(world(2, SLIDING), [[-2 * R, 0.0], [0.0, 0.0]], [1.0, 0.0], spins=[0.0, spin / R, 0.0], record=True)
    distance = 0.0
    if spin:
        v = 2 / 7
        distance = 0.5 * v * v / (SLIDE * G) + v * v / (2 * ROLL * G)
    assert shot.positions[0, 0] + 2 * R == pytest.approx(direction * distance, abs=1e-14)


def test_a_stopped_ball_spins_until_its_spin_is_zero():
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


def test_a_restitution_cushion_reverses_and_reduces_the_normal_velocity():
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


def test_a_ball_frozen_to_a_cushion_bounces_at_time_0_if_it_moves_towards_it():
    shot = simulate(world(1, FREE, Table(2.0, 2.0)), [[1.0 - R, 0.0]], [1.0, 0.5], max_time=0.5, record=True)
    assert kinds(shot) == [("cushion", 0, 1)]
    assert shot.events["time"][0] == 0.0
    assert shot.velocities[0].tolist() == [-1.0, 0.5]


@pytest.mark.parametrize("physics", [FREE, ROLLING, SLIDING])
def test_a_ball_frozen_in_a_corner_bounces_off_both_cushions_at_time_0(physics):
    shot = simulate(world(1, physics, Table(2.0, 2.0)), [[1 - R, 1 - R]], [2.0, 2.0], max_time=0.3, record=True)
    assert kinds(shot)[:2] == [("cushion", 0, 1), ("cushion", 0, 3)]
    assert shot.events["time"][:2].tolist() == [0.0, 0.0]
    assert (shot.positions[0] < 1 - R - 0.05).all()


def test_a_hit_on_a_ball_at_a_cushion_returns_to_the_striking_ball():
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


def test_a_ball_at_the_edge_of_a_pocket_is_captured_if_it_moves_inwards():
    table = Table(2.0, 2.0, pockets=(Pocket(0.0, 0.0, 0.125),))
    assert kinds(simulate(world(1, ROLLING, table), [[-0.125, 0.0]], [1.0, 0.0], record=True)) == [("pocket", 0, 0)]
    assert kinds(simulate(world(1, ROLLING, table), [[-0.125, 0.0]], [0.0, 0.3], record=True)) == [
        ("rolling_rest", 0, -1)
    ]
    assert kinds(simulate(world(1, ROLLING, table), [[-0.125, 0.0]], [-0.3, 0.0], record=True)) == [
        ("rolling_rest", 0, -1)
    ]


def test_a_pocket_precedes_a_cushion_and_an_impact_at_the_same_instant():
    table = Table(2.0, 2.0, pockets=(Pocket(1 - R + 0.125, 0.0, 0.125),))
    shot = simulate(world(1, FREE, table), [[0.0, 0.0]], [1.0, 0.0], record=True)
    assert kinds(shot) == [("pocket", 0, 0)]
    both = simulate(world(2, FREE, table), [[0.0, 0.0], [1 - R, 2 * R]], [1.0, 0.0], record=True)
    assert kinds(both) == [("pocket", 0, 0)]


# Balls at rest, and limits


@pytest.mark.parametrize(
    ("name", "n", "layout"),
    [("pool", 3, "random"), ("carom", 3, "random"), ("ideal", 3, "random"), ("pool", 15, "tight_rack")],
)
def test_a_shot_without_velocity_has_no_events(name, n, layout):
    scene = Scene.named(name, n)
    places = layouts.draw(layout, scene, np.random.default_rng(0))
    for arguments in ({}, {"max_time": 0.0}, {"max_events": 0}):
        shot = simulate(scene, places, [0.0, 0.0], record=True, **arguments)
        assert (shot.status, shot.n_events, shot.time, len(shot.events)) == ("rest", 0, 0.0, 0)
        assert np.array_equal(shot.positions, places)


def test_a_shot_with_a_time_limit_of_0_changes_nothing():
    scene = Scene.named("pool", 1)
    shot = simulate(scene, [[-0.5, 0.0], [0.5, 0.0]], [1.0, 2.0], max_time=0.0)
    assert (shot.status, shot.time, shot.n_events) == ("max_time", 0.0, 0)
    assert shot.positions.tolist() == [[-0.5, 0.0], [0.5, 0.0]]
    assert shot.velocities.tolist() == [[1.0, 2.0], [0.0, 0.0]]


def test_balls_keep_their_velocities_at_the_time_limit():
    shot = simulate(world(1, ROLLING), [[0.0, 0.0]], [1.0, 0.0], max_time=2.0)
    assert (shot.status, shot.time) == ("max_time", 2.0)
    assert shot.velocities[0, 0] == pytest.approx(1 - 2 * ROLL * G)
    assert shot.positions[0, 0] == pytest.approx(2 - 0.5 * ROLL * G * 4)
    assert simulate(world(1, ROLLING, max_time=2.0), [[0.0, 0.0]], [1.0, 0.0]).time == 2.0
    assert simulate(world(1, ROLLING, max_time=2.0), [[0.0, 0.0]], [1.0, 0.0], max_time=1.0).time == 1.0
    early = simulate(world(1, ROLLING, max_time=99.0), [[0.0, 0.0]], [1.0, 0.0])
    assert early.status == "rest"
    assert early.time == pytest.approx(1 / (ROLL * G))


def test_a_shot_stops_at_its_limit_of_events():
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


def test_a_ball_without_contacts_has_no_events():
    shot = simulate(world(3, SLIDING), [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], [2.0, 0.0], record=True)
    assert set(shot.events["ball"]) | set(shot.events["other"]) == {0, 1, -1}
    assert len(rows(shot, 2)) == 1
    assert shot.positions[2].tolist() == [0.0, 1.0]


def test_the_first_hit_and_the_cushion_contacts_before_it_are_counted():
    # The cue ball bounces off the +x cushion, passes ball 1 and hits ball 2.
    shot = simulate(
        world(3, FREE, Table(2.0, 2.0)), [[0.0, 0.0], [0.0, 0.5], [-0.5, 0.0]], [1.0, 0.0], max_time=3.0, record=True
    )
    assert kinds(shot)[:2] == [("cushion", 0, 1), ("ball_ball", 0, 2)]
    assert shot.first_hit == 2
    assert shot.cushions_before_hit.tolist() == [-1, -1, 1]
    assert shot.cushions.tolist()[:2] == [1, 0]


def test_cushion_contacts_before_a_hit_are_those_before_the_first_hit_on_the_ball():
    # The cue ball bounces between a fixed ball and the -x cushion.
    scene = world(2, FREE, Table(2.0, 2.0), mass=(0.2, math.inf))
    shot = simulate(scene, [[-0.5, 0.0], [0.5, 0.0]], [1.0, 0.0], max_time=4.0)
    assert (shot.cushions.tolist(), shot.cushions_before_hit.tolist()) == ([1, 0], [-1, 0])
    assert shot.n_events == 3


# Simultaneous impacts


@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
def test_a_hit_on_two_balls_in_contact_follows_the_closed_form(e):
    # The plastic impulse along each normal is m v cos(30) / 2.5; restitution multiplies it by 1 + e.
    x = 2 * R * math.cos(math.pi / 6)
    scene = world(3, FREE, e_ball=e)
    shot = simulate(scene, [[-1 - x, 0.0], [0.0, R], [0.0, -R]], [2.0, 0.0], max_time=0.75, record=True)
    assert kinds(shot)[:2] == [("ball_ball", 0, 1), ("ball_ball", 0, 2)]
    assert shot.velocities[0] == pytest.approx([2 * (1 - 0.6 * (1 + e)), 0.0], abs=1e-14)
    speed = (1 + e) * 2 * math.cos(math.pi / 6) / 2.5
    sides = speed * np.array([[math.cos(math.pi / 6), math.sin(math.pi / 6)], [math.cos(math.pi / 6), -0.5]])
    assert shot.velocities[1:] == pytest.approx(sides, rel=1e-12)
    assert np.array_equal(shot.positions[1] * [1, -1], shot.positions[2])


@pytest.mark.parametrize("angle", [0.3, 1.0, 4.0])
def test_two_hits_whose_times_differ_by_rounding_are_resolved_as_one_problem(angle):
    turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    places = np.array([[-1 - 2 * R * math.cos(math.pi / 6), 0.0], [0.0, R], [0.0, -R]]) @ turn.T
    shot = simulate(world(3, FREE), places, turn @ [2.0, 0.0], max_time=0.75)
    speed = 1.6 * math.cos(math.pi / 6) * np.array([math.cos(math.pi / 6), 0.5])
    assert shot.velocities @ turn == pytest.approx(np.array([[-0.4, 0.0], speed, speed * [1, -1]]), abs=1e-13)
    assert shot.n_events == 2


@pytest.mark.parametrize("striking", [1, 2, 3])
def test_newtons_cradle_passes_the_velocities_on(striking):
    n = 6
    places = np.zeros((n, 2))
    places[:, 0] = 2 * R * np.arange(n)
    places[:striking, 0] -= 0.5
    velocities = np.zeros((n, 2))
    velocities[:striking, 0] = 1.0
    shot = simulate(world(n, FREE, mass=(1.0,) * n), places, velocities, max_time=1.0)
    assert shot.velocities[:, 0] == pytest.approx([0.0] * (n - striking) + [1.0] * striking, abs=1e-15)
    assert not shot.velocities[:, 1].any()


# Properties of all shots


def play(scene, places, velocities, spins, record=False):
    """Runs a shot; a shot of ideal balls ends after 3 s."""
    horizon = 3.0 if scene.physics.motion == "ideal" else None
    return simulate(scene, places, velocities, spins=spins, max_time=horizon, record=record, max_events=50_000)


@settings(max_examples=60)
@given(st.integers(0, 10**6))
def test_mirrored_shots_have_mirrored_results_bit_for_bit(seed):
    check_mirror_images(play, *draw_shot(seed))


@settings(max_examples=60)
@given(st.integers(0, 10**6))
def test_the_order_of_object_balls_changes_no_bit(seed):
    check_renumbering(play, *draw_shot(seed), seed)


def test_the_order_of_the_balls_of_a_spinning_frozen_rack_changes_no_bit():
    scene = Scene.named("pool", 6)
    for seed in range(5):
        rng = np.random.default_rng(seed)
        positions, spins = layouts.draw("tight_rack", scene, rng), rng.normal(size=(7, 3)) * 50
        velocities = np.zeros((7, 2))
        velocities[0] = 3 * (positions[1] - positions[0])
        check_renumbering(play, scene, positions, velocities, spins, seed)


def check_every_instant(scene, shot):
    """Checks that no balls overlap or lie outside the table, at the events and between them."""
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
def test_energy_does_not_rise_momentum_is_conserved_and_balls_do_not_overlap(seed):
    scene, places, velocities, spins = draw_shot(seed)
    shot = play(scene, places, velocities, spins, record=True)
    assume(shot.status != "event_limit")  # clusters of inelastic balls, which tests/stress runs to rest
    assert shot.status == ("max_time" if scene.physics.motion == "ideal" else "rest")
    assert shot.n_events == len(shot.events)
    check_every_instant(scene, shot)
    mass = np.array(scene.balls.mass)
    impacts = {}
    for event in shot.events:
        impacts.setdefault(event["time"], set()).add(event["kind"])
    acts = set(shot.events["time"][shot.events["rule"]].tolist())
    # An act of the contact-time rule may add the energy that friction takes from a pair during the contact.
    p = scene.physics
    act = 0.5 * mass.max() * (3.0 * CONTACT_TIME * (p.mu_slide if p.motion == "sliding" else p.mu_roll) * p.g) ** 2
    start = kinetic_energy(
        motion_at(shot.trajectory.rows[: scene.n_balls], shot.trajectory.phase[: scene.n_balls], 0.0), scene
    )
    last, rises = start, 0.0
    for t, before, after in instants(shot):
        now = kinetic_energy(after, scene)
        assert kinetic_energy(before, scene) <= last + 1e-14 * start
        rises += max(0.0, now - kinetic_energy(before, scene) - 1e-14 * start)
        last = now
        # The rule may bring balls to rest, which changes the momentum.
        if impacts[t] == {"ball_ball"} and t not in acts:
            change = mass @ (after.velocities - before.velocities)
            assert np.abs(change).max() <= 1e-13 * (mass @ np.linalg.norm(before.velocities, axis=1))
    assert rises <= shot.n_contact_rule * act
    if p.motion == "ideal":
        end = Motion(shot.positions, shot.velocities, shot.velocities, shot.spins[:, 2])
        assert kinetic_energy(end, scene) == pytest.approx(start)
    counted = [int(((shot.events["kind"] == "cushion") & (shot.events["ball"] == i)).sum()) for i in range(len(places))]
    assert shot.cushions.tolist() == counted


def test_inelastic_balls_in_contact_come_to_rest():
    # Impacts weaker than the rounding of the velocities must not repeat without end.
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
