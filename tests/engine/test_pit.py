"""PIT compared with PIC, closed forms and conservation laws."""

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from billiards_env import Engine, Scene, derivatives, simulate_batch
from billiards_env.engine.overlaps import FIXES
from billiards_env.scene import Balls, Physics, Pocket, Table, check_positions, layouts
from tests.helpers.shots import (
    DTS,
    FREE,
    LAWS,
    MOTIONS,
    ROLLING,
    SLIDING,
    R,
    check_same,
    draw_shot,
    draw_starts,
    kinds,
    simulate,
    world,
)

fixes = pytest.mark.parametrize("fix", FIXES)
laws = pytest.mark.parametrize("physics", MOTIONS.values(), ids=MOTIONS)
seeds = st.integers(0, 10**6)


def pit(*args, dt=1 / 60, fix=None, **kwargs):
    return simulate(*args, engine=Engine("pit", dt, fix), **kwargs)


# Shots without contacts


@laws
@settings(max_examples=30)
@given(seed=seeds)
def test_without_contacts_pit_and_pic_are_equal_bit_for_bit(physics, seed):
    rng = np.random.default_rng(seed)
    scene = world(2, physics)
    places = [[0.0, 0.0], [0.0, 1.0]]
    velocities = rng.uniform(-3, 3, size=(2, 2)) * [1.0, 0.0] * 10.0 ** rng.uniform(-3, 0)  # along parallel lines
    spins = None if physics is not SLIDING else rng.uniform(-1, 1, size=(2, 3)) * [0.0, 50.0, 500.0]
    shot: Any = {"spins": spins, "max_time": [None, 0.0, 0.3, 1.0][seed % 4], "record": True}
    exact = simulate(scene, places, velocities, **shot)
    assert not np.isin(exact.events["kind"], ["ball_ball", "cushion"]).any()
    check_same(pit(scene, places, velocities, dt=float(rng.choice(DTS)), fix=rng.choice(FIXES), **shot), exact)


def test_a_ball_that_spins_in_place_needs_no_timesteps():
    scene = world(2, SLIDING, spin_decay=2.0)
    spins = [[0.0, 0.0, 40.0], [0.0, 0.0, -200.0]]
    places = [[0.0, 0.0], [1.0, 0.0]]
    shot = pit(scene, places, [0.0, 0.0], spins=spins, dt=1e-9, record=True)
    assert kinds(shot) == [("spinning_rest", 0, -1), ("spinning_rest", 1, -1)]
    assert shot.events["time"].tolist() == [20.0, 100.0]
    assert (shot.status, shot.time) == ("rest", 100.0)
    cut = pit(scene, places, [0.0, 0.0], spins=spins, dt=1e-9, max_time=50.0)
    assert (cut.status, cut.time, cut.spins[1, 2]) == ("max_time", 50.0, -100.0)
    # The ball moves for 10 ms, which takes 1e5 timesteps, and then spins for 400 s.
    scene = world(1, SLIDING, spin_decay=1.0)
    shot = pit(scene, [[0.0, 0.0]], [1e-3, 0.0], spins=[0.0, 1e-3 / R, 400.0], dt=1e-7)
    assert (shot.status, shot.time) == ("rest", 400.0)


# One contact


def one_hit(physics, count=300):
    """Returns shots with one ball-ball collision: scene, positions (m, 2, 2), velocities of the cue ball (m, 2)."""
    rng = np.random.default_rng(0)
    places = np.zeros((count, 2, 2))
    places[:, 0, 0] = -rng.uniform(0.5, 0.8, count)
    places[:, 0, 1] = rng.uniform(-0.8, 0.8, count) * 2 * R
    return world(2, physics), places, np.tile([2.0, 0.0], (count, 1))


def one_bounce(physics, count=300):
    """Returns shots with one bounce off the cushion at +x: scene, positions (m, 1, 2), velocities (m, 2)."""
    rng = np.random.default_rng(0)
    angles = rng.uniform(-1.0, 1.0, count)
    places = np.stack([rng.uniform(-0.3, 0.3, count), np.zeros(count)], axis=1)[:, None]
    cushion = {} if physics is FREE else {"e_cushion": 0.8}
    return world(1, physics, Table(2.0, 64.0), **cushion), places, 2 * np.c_[np.cos(angles), np.sin(angles)]


CASES = [one_hit, one_bounce]


def error(case, dt, fix, horizon=1.0, average=np.mean):
    """Returns the mean distance, m, of the final positions from those of PIC."""
    exact = simulate_batch(*case, max_time=horizon)
    shot = simulate_batch(*case, engine=Engine("pit", dt, fix), max_time=horizon)
    return float(average(np.linalg.norm(shot.positions - exact.positions, axis=-1)))


@laws
@fixes
@pytest.mark.parametrize("shots", CASES)
def test_the_error_of_one_contact_has_its_order_in_dt(shots, physics, fix):
    """It is of first order; with the time of impact of second order, and zero without friction."""
    case, at_impact = shots(physics), fix == "time_of_impact"
    if at_impact and physics is FREE:
        assert error(case, 1 / 60, fix) < 1e-14
        return
    # With the time of impact the median, because the error is of first order in the few shots in which a phase ends in
    # the step of the contact.
    steps, average = ([1e-2, 2e-3, 4e-4], np.median) if at_impact else ([2e-3, 4e-4, 8e-5], np.mean)
    errors = np.array([error(case, dt, fix, average=average) for dt in steps])
    slopes = np.diff(np.log(errors)) / np.diff(np.log(steps))
    assert slopes == pytest.approx(2.0, abs=0.3) if at_impact else slopes == pytest.approx(1.0, abs=0.1)
    assert errors[-1] < (1e-7 if at_impact else 1e-3)


def derivative_error(case, dt, fix):
    """Returns the median relative error of the derivative of the positions after 1 s by the cue ball's velocity.

    It is a central difference over 2e-9 m/s: the derivative through the timesteps.
    """
    scene, places, velocities = case
    exact = derivatives.jacobian(simulate_batch(*case, max_time=1.0, record=True))[:, :, :, 0]
    differences = np.empty_like(exact)
    for axis, change in enumerate(1e-9 * np.eye(2)):
        low, high = (
            simulate_batch(scene, places, velocities + way, engine=Engine("pit", dt, fix), max_time=1.0).positions
            for way in (-change, change)
        )
        differences[..., axis] = (high - low) / 2e-9
    size = np.linalg.norm(exact.reshape(len(exact), -1), axis=1)
    return float(np.median(np.linalg.norm((differences - exact).reshape(len(exact), -1), axis=1) / size))


@laws
@fixes
@pytest.mark.parametrize("shots", CASES)
def test_derivatives_through_timesteps_converge_only_with_time_of_impact(shots, physics, fix):
    steps = (1e-2, 1e-4) if fix == "time_of_impact" else (1e-3, 1e-4)
    coarse, fine = (derivative_error(shots(physics, 100), dt, fix) for dt in steps)
    if fix == "time_of_impact":
        assert fine < max(0.02 * coarse, 1e-6)  # the differences are rounded
        assert coarse < 0.02
    else:
        assert fine > 0.8 * coarse > 0.02


@laws
def test_move_back_has_a_smaller_error_after_one_hit_than_late_lines_of_centres(physics):
    case = one_hit(physics)
    moved_back, *others = (error(case, 1e-3, fix) for fix in ("move_back", "push_apart", "none"))
    assert 5 * moved_back < min(others)


@pytest.mark.parametrize("shots", CASES)
def test_move_back_has_exact_velocities_and_late_positions(shots):
    scene, places, starts = shots(FREE)
    for k in range(0, 300, 10):
        exact = simulate(scene, places[k], starts[k], max_time=1.0, record=True)
        shot = pit(scene, places[k], starts[k], dt=0.02, fix="move_back", max_time=1.0, record=True)
        assert kinds(shot) == kinds(exact)
        late = shot.events["time"][0] - exact.events["time"][0]
        assert 0.0 <= late < 0.02 * (1 + 1e-12)
        assert shot.velocities == pytest.approx(exact.velocities, abs=1e-12)
        assert shot.positions == pytest.approx(exact.positions - late * exact.velocities, abs=1e-12)


def test_a_late_line_of_centres_turns_the_impulse():
    scene = world(2, FREE)
    shot = pit(scene, [[-1.0, 1.6 * R], [0.0, 0.0]], [2.0, 0.0], dt=0.5 - 0.3 * R, max_time=0.6, record=True)
    overlap = np.array([0.6 * R, -1.6 * R])
    n = overlap / np.linalg.norm(overlap)
    assert kinds(shot) == [("ball_ball", 0, 1)]
    assert shot.events["speed"] == pytest.approx([2.0 * n[0]], rel=1e-14)
    assert shot.velocities == pytest.approx(np.array([[2.0, 0.0] - 2.0 * n[0] * n, 2.0 * n[0] * n]), abs=1e-14)


@laws
def test_push_apart_leaves_the_two_balls_in_contact(physics):
    scene, places, starts = one_hit(physics)
    scene = dataclasses.replace(scene, balls=Balls((R, 2 * R), (0.2, 0.3)))
    for k in range(0, 300, 10):
        places[k, 0, 0] -= 0.5
        shot = pit(scene, places[k], starts[k], dt=0.02, record=True)
        hits = shot.events["time"][shot.events["kind"] == "ball_ball"]
        assert len(hits) == 1
        before, left = shot.at(float(np.nextafter(hits[0], 0))), shot.at(float(hits[0]))
        assert math.dist(*before) < 3 * R * (1 - 1e-9)
        assert math.dist(*left) == pytest.approx(3 * R, abs=1e-14)
        # The balls move along the line of centres; their centre of mass does not move.
        assert np.array([0.2, 0.3]) @ (left - before) == pytest.approx([0.0, 0.0], abs=1e-14)
        moved, line = left[1] - before[1], before[1] - before[0]
        assert moved[0] * line[1] == pytest.approx(moved[1] * line[0], abs=1e-14)


@fixes
def test_a_fix_does_not_move_a_fixed_ball(fix):
    scene = world(2, FREE, mass=(0.2, math.inf))
    shot = pit(scene, [[-1.0, 0.0], [0.0, 0.0]], [2.0, 0.0], dt=0.485, fix=fix, max_time=0.5, record=True)
    impact = -2 * R - (2 * R - 0.03)  # the ball goes back as far as it would be too deep
    after = {"push_apart": -2 * R, "move_back": -2 * R, "none": -0.03, "time_of_impact": impact}[fix]
    assert shot.positions[0] == pytest.approx([after - 2.0 * 0.015, 0.0], abs=1e-14)
    assert shot.positions[1].tolist() == [0.0, 0.0]
    assert shot.velocities.tolist() == [[-2.0, 0.0], [0.0, 0.0]]


@fixes
def test_a_ball_beyond_a_cushion_bounces_from_the_position_of_the_fix(fix):
    scene = world(1, FREE, Table(2.0, 4.0), e_cushion=0.5)
    shot = pit(scene, [[0.0, 0.0]], [2.0, 1.0], dt=0.5, fix=fix, max_time=0.75, record=True)
    x, y = {
        "push_apart": (1 - R, 0.5),
        "move_back": (1 - R, 0.5 - R / 2),
        "none": (1.0, 0.5),
        "time_of_impact": (1 - R - R / 2, 0.5),
    }[fix]
    assert shot.events[["time", "kind", "ball", "other", "x", "y", "speed"]].tolist() == [
        (0.5, "cushion", 0, 1, x, y, 2.0)
    ]
    assert shot.at(0.5).tolist() == [[x, y]]
    assert shot.velocities.tolist() == [[-1.0, 1.0]]
    assert shot.positions == pytest.approx(np.array([[x - 0.25, y + 0.25]]))


def test_the_time_of_impact_leaves_the_rest_of_the_step_for_the_new_velocity():
    # The ball touches the cushion 1/64 s before the timestep, with 2 m/s, and leaves it with 1 m/s. While it slides,
    # the velocity at the impact is that of the path, not that at the timestep.
    table, slide = Table(2.0, 4.0), Physics(**SLIDING).mu_slide * Physics(**SLIDING).g
    rest = 1 / 64
    for physics, a in ((FREE, 0.0), ({**SLIDING, "cushion": "restitution"}, slide)):
        scene = world(1, physics, table, e_cushion=0.5)
        start, time = [[1 - R - 0.25 * 2.0 - 0.5 * 0.25**2 * a, 0.0]], 0.25 + rest
        shot = pit(scene, start, [2.0 + 0.25 * a, 0.0], dt=time, fix="time_of_impact", max_time=time, record=True)
        assert kinds(shot) == [("cushion", 0, 1)]
        assert shot.events["speed"] == pytest.approx([2.0], abs=2 * a * rest**2)
        change = shot.positions[0, 0] - (1 - R - rest)
        assert abs(change) <= a * rest**2 + 1e-15
    # A ball that stops in the rest of the step stays where it stops.
    scene = world(1, ROLLING, table, e_cushion=1e-4)
    shot = pit(scene, [[0.5, 0.0]], [2.0, 0.0], dt=0.25, fix="time_of_impact", record=True)
    [bounce] = shot.events[shot.events["kind"] == "cushion"]
    assert (shot.status, shot.time) == ("rest", pytest.approx(bounce["time"], abs=1e-15))
    assert 0.0 < 1 - R - shot.positions[0, 0] < 1e-6


# Timesteps


CONTACTS = {
    "a collision within a timestep is missed": ([[-1.0, 0.0], [0.0, 0.0]], 2.0, 0.4, []),
    # The centre of ball 0 is 0.01 m beyond that of ball 1 then.
    "overlapping balls that separate do not collide": ([[-1.0, 0.0], [0.0, 0.0]], 2.0, 0.505, []),
    "balls in contact collide at the first timestep": ([[0.0, 0.0], [2 * R, 0.0]], 0.02, 0.25, [0.25]),
    "balls at rest need no timesteps": ([[0.0, 0.0], [2 * R, 0.0]], 0.0, 1e-9, []),
}


@fixes
@pytest.mark.parametrize(("places", "speed", "dt", "times"), CONTACTS.values(), ids=CONTACTS)
def test_contacts_are_found_at_timesteps(places, speed, dt, times, fix):
    shot = pit(world(2, FREE), places, [speed, 0.0], dt=dt, fix=fix, max_time=1.0, record=True)
    assert kinds(shot) == [("ball_ball", 0, 1)] * len(times)
    assert shot.events["time"].tolist() == times
    if not times:
        assert shot.positions - places == pytest.approx(np.array([[speed, 0.0], [0.0, 0.0]]))
        assert shot.time == (1.0 if speed else 0.0)


@fixes
@settings(max_examples=40)
@given(seed=seeds, dt=st.sampled_from((*DTS, 100.0)))
def test_contacts_and_captures_happen_only_at_multiples_of_dt(fix, seed, dt):
    """Shots with very large timesteps end too."""
    scene, places, velocities, spins = draw_shot(seed)
    horizon = 3.0 if scene.physics.motion == "ideal" else None
    shot = pit(scene, places, velocities, spins=spins, dt=dt, fix=fix, max_time=horizon, record=True)
    times = shot.events["time"][np.isin(shot.events["kind"], ["ball_ball", "cushion", "pocket"])]
    assert np.array_equal(times, np.round(times / dt) * dt)
    assert shot.status == ("max_time" if scene.physics.motion == "ideal" else "rest")
    assert np.isfinite(shot.positions).all()
    assert shot.time <= 400.0


def test_a_ball_is_captured_at_a_timestep_or_missed():
    table = Table(4.0, 4.0, pockets=(Pocket(0.5, 0.0, 0.1),))
    scene = world(1, FREE, table)
    shot = pit(scene, [[0.0, 0.0]], [1.0, 0.0], dt=0.25, record=True)
    assert kinds(shot) == [("pocket", 0, 0)]
    assert (shot.time, shot.status, shot.potted.tolist()) == (0.5, "rest", [True])
    assert shot.positions.tolist() == [[0.5, 0.0]]
    assert shot.events["speed"].tolist() == [1.0]
    assert simulate(scene, [[0.0, 0.0]], [1.0, 0.0]).time == pytest.approx(0.4)
    assert not pit(scene, [[0.0, 0.0]], [1.0, 0.0], dt=0.35, max_time=1.0).potted.any()
    resting = pit(world(1, ROLLING, table), [[0.0, 0.0]], [math.sqrt(2 * 0.0981 * 0.45), 0.0], dt=100.0, record=True)
    assert [kind for kind, _, _ in kinds(resting)] == ["rolling_rest", "pocket"]


def test_a_potted_ball_does_not_collide():
    table = Table(2.0, 2.0, pockets=(Pocket(0.0, 0.0, 0.1),))
    for run in (pit, simulate):
        shot = run(world(2, ROLLING, table), [[-0.9, 0.0], [-0.5, 0.0]], [[1.0, 0.0], [1.0, 0.0]], record=True)
        assert kinds(shot) == [("pocket", 1, 0), ("pocket", 0, 0)]
    out = pit(world(2, ROLLING), [[0.0, 0.0], [0.5, 0.0]], [1.0, 0.0], in_play=[True, False])
    assert (out.first_hit, out.potted.tolist()) == (-1, [False, True])


def test_a_hit_between_the_last_timestep_and_the_limit_is_missed():
    for limit, hits in ((0.99, -1), (1.0, 1)):
        assert pit(world(2, FREE), [[0.0, 0.0], [1.03, 0.01]], [1.0, 0.0], dt=0.5, max_time=limit).first_hit == hits


# Properties of all shots, for random dt and fix


@fixes
@settings(max_examples=30)
@given(seed=seeds)
def test_a_gas_with_fixed_balls_conserves_energy_and_does_not_move_them(fix, seed):
    rng = np.random.default_rng(seed)
    physics = Physics(motion="ideal", cushion="restitution", e_ball=1.0, e_cushion=1.0, max_time=3.0)
    mass = (1.0, 0.1, 3.0, math.inf, math.inf, 1.0)
    scene = Scene(Balls((0.05, 0.03, 0.08, 0.05, 0.1, 0.05), mass), Table(1.0, 0.8), physics)
    places = layouts.draw("random", scene, rng)
    velocities = rng.normal(size=(6, 2)) * 2 * np.isfinite(mass)[:, None]
    shot = pit(scene, places, velocities, fix=fix, dt=1 / 30)
    fixed = np.isinf(mass)
    assert np.array_equal(shot.positions[fixed], places[fixed])
    assert not shot.velocities[fixed].any()
    energies = [np.array(mass)[~fixed] @ (v[~fixed] ** 2).sum(axis=1) for v in (velocities, shot.velocities)]
    assert energies[1] == pytest.approx(energies[0], rel=1e-12)


@pytest.mark.parametrize("name", LAWS)
def test_pit_converges_to_pic(name):
    scene = Scene.named(name, 2)
    rng = np.random.default_rng(0)
    places = np.array([layouts.draw("random", scene, rng) for _ in range(100)])
    starts = rng.normal(size=(100, 2))
    exact = simulate_batch(scene, places, starts, max_time=2.0)
    for fix in FIXES:
        medians = []
        for dt in (1e-2, 1e-3, 1e-4):
            shot = simulate_batch(scene, places, starts, engine=Engine("pit", dt, fix), max_time=2.0)
            medians.append(np.median(np.linalg.norm(shot.positions - exact.positions, axis=-1).max(axis=1)))
        assert medians[0] > 3 * medians[1] > 9 * medians[2] or medians[0] < 1e-14
        assert medians[2] < 1e-3


# Several contacts in one timestep


@pytest.mark.parametrize("fix", ["push_apart", "none"])
def test_a_hit_on_two_balls_in_contact_is_symmetric(fix):
    x = 2 * R * math.cos(math.pi / 6)
    scene = world(3, FREE)
    shot = pit(scene, [[-1 - x, 0.0], [0.0, R], [0.0, -R]], [2.0, 0.0], dt=0.505, fix=fix, max_time=0.7, record=True)
    assert kinds(shot) == [("ball_ball", 0, 1), ("ball_ball", 0, 2)]
    assert np.array_equal(shot.positions[1] * [1, -1], shot.positions[2])
    assert shot.positions[0, 1] == 0.0
    assert 0.2 * (shot.velocities**2).sum() == pytest.approx(0.2 * 4.0, rel=1e-14)


@fixes
@pytest.mark.parametrize("second", [(0.0, 0.0), (-1.0, 0.0), (0.0, 1.0)])
def test_two_balls_at_one_position_collide_along_their_relative_velocity(second, fix):
    # Both balls are at the origin at 0.5 s.
    velocities = np.array([[2.0, 0.0], second])
    places = -0.5 * velocities
    shot = pit(world(2, FREE), places, velocities, dt=0.5, fix=fix, max_time=0.75, record=True)
    assert kinds(shot) == [("ball_ball", 0, 1)]
    assert shot.velocities == pytest.approx(velocities[::-1], abs=1e-15)
    assert np.isfinite(shot.positions).all()


@fixes
@pytest.mark.parametrize(
    ("places", "through"), [([[0.0, 0.0625], [0.0, -0.0625]], True), ([[0.03125, 0.0], [0.109375, 0.0]], False)]
)
def test_an_overlap_with_two_fixed_balls_with_parallel_lines_of_centres(places, through, fix):
    # Midway between the two, the ball approaches neither. In front of two in a row it bounces; the share of each is not
    # unique. A ball that goes back along its path bounces off the ball that it touched first.
    scene = Scene(
        Balls((0.09375, 0.03125, 0.03125), (0.2, math.inf, math.inf)),
        Table(8.0, 8.0),
        Physics(motion="ideal", cushion="restitution", e_ball=1.0, max_time=1.0),
    )
    shot = pit(scene, [[-1.0, 0.0], *places], [2.0, 0.0], dt=0.5, fix=fix, max_time=0.5)
    assert np.isfinite(shot.positions).all()
    expected = 2.0 if through and fix in ("push_apart", "none") else -2.0
    assert shot.velocities[0] == pytest.approx([expected, 0.0], abs=1e-12)


@fixes
@pytest.mark.parametrize("arrangement", ["rack", "tight_rack"])
def test_breaks_come_to_rest(arrangement, fix):
    scene = Scene.named("pool", 15)
    places, starts, _ = draw_starts(scene, 20, arrangement)
    batch = simulate_batch(scene, places, 2 * starts, engine=Engine("pit", 1 / 60, fix))
    assert batch.status.tolist() == ["rest"] * 20
    assert not batch.velocities.any()
    assert (batch.first_hit > 0).all()
    assert batch.n_events.max() < 100_000


@fixes
@pytest.mark.parametrize("dt", [1 / 60, 0.3, 1.0])
def test_balls_end_within_the_cushions_and_outside_the_pockets(fix, dt):
    for name in LAWS:
        scene = Scene.named(name, 6)
        places, starts, _ = draw_starts(scene, 50)
        batch = simulate_batch(scene, places, starts, engine=Engine("pit", dt, fix))
        late = 4 * np.abs(starts).max() * dt  # a moving ball may be one timestep beyond a cushion
        moving = np.linalg.norm(batch.velocities, axis=-1) > 0
        beyond = scene.balls.radius - scene.table.clearance(batch.positions)
        assert beyond[~batch.potted].max() <= late
        if fix != "none":
            assert beyond[~moving & ~batch.potted].max() <= 1e-12
            for pocket in scene.table.pockets:
                distance = np.hypot(*(batch.positions - (pocket.x, pocket.y)).T).T
                assert distance[~moving & ~batch.potted].min() >= pocket.radius


@fixes
def test_a_ball_that_stops_beyond_a_cushion_in_its_last_step_is_moved_to_it(fix):
    # It stops at (1.5, 0.75). Without the cushion it would be at rest there; a fix does not change a velocity of zero.
    way = np.array([1.5, 0.75])
    velocity = way / np.linalg.norm(way) * math.sqrt(2 * 0.0981 * np.linalg.norm(way))
    shot = pit(world(1, ROLLING, Table(2.0, 2.0)), [[0.0, 0.0]], velocity, dt=100.0, fix=fix, record=True)
    assert shot.positions[0] == pytest.approx(way if fix == "none" else [1 - R, 0.75])
    assert (shot.status, kinds(shot)) == ("rest", [("rolling_rest", 0, -1)])
    # A pocket captures a ball that a fix moves into it, also if the ball is at rest there.
    table = Table(2.0, 2.0, pockets=(Pocket(1.0, 0.75, 2 * R),))
    shot = pit(world(1, ROLLING, table), [[0.0, 0.0]], velocity, dt=100.0, fix=fix, record=True)
    assert shot.potted.tolist() == [fix != "none"]
    assert shot.time == (shot.events["time"][0] if fix == "none" else 100.0)


def test_balls_side_by_side_along_a_cushion_are_pushed_apart_within_it():
    # The balls overlap after their impact, because the cushion stops the second one.
    place = 1 - R
    scene = world(2, FREE, Table(2.0, 64.0), e_cushion=0.0)
    places, velocities = [[place - 2 * R - 0.05, 0.0], [place, 0.0]], [[2.0, 1.0], [0.0, 1.0]]
    shot = pit(scene, places, velocities, dt=1 / 32, max_time=2.0, record=True)
    assert kinds(shot) == [("ball_ball", 0, 1), ("cushion", 1, 1)]
    assert shot.positions[:, 0] == pytest.approx([place - 2 * R, place], abs=1e-12)


# Spheres of different size

UK = Scene.named("uk_pool", 4)
APART = 2 * math.sqrt(UK.balls.radius[0] * UK.balls.radius[1])
"""m. The distance of the cue ball and an object ball that touch."""


@pytest.mark.parametrize("fix", ["push_apart", "move_back"])
def test_pit_moves_balls_to_the_distance_of_spheres(fix):
    places = np.array([[-0.5, 0.01], [0.0, 0.0], [0.5, 0.3], [0.5, -0.3], [0.7, 0.0]])
    shot = simulate(UK, places, [1.0, 0.0], engine=Engine("pit", 0.02, fix), record=True, max_time=1.0)
    hit = shot.events[shot.events["kind"] == "ball_ball"][0]
    where = shot.at(float(hit["time"]))
    tolerance = 1e-14 if fix == "push_apart" else 1e-5  # the paths are curved, and balls are moved back on tangents
    assert math.dist(where[0], where[1]) == pytest.approx(APART, abs=tolerance)


def test_spheres_may_be_nearer_than_the_sum_of_their_radii_without_a_fix():
    places = np.array([[0.0, 0.0], [APART, 0.0], [0.5, 0.3], [0.5, -0.3], [0.7, 0.0]])
    assert np.array_equal(check_positions(UK, places), places)
    simulate(UK, places, [1.0, 0.0])
    places[1, 0] = APART - 1e-9
    for function in (lambda: check_positions(UK, places), lambda: simulate(UK, places, [1.0, 0.0])):
        with pytest.raises(ValueError, match=r"balls 0 and 1 are .* m apart: expected at least .* at which they touch"):
            function()
    places[1, 0] = 0.5 * (APART + UK.balls.radius[0] + UK.balls.radius[1])
    shot = simulate(UK, places, [0.0, 0.5], engine=Engine("pit", 1e-3), max_time=0.1, record=True)
    assert "ball_ball" not in shot.events["kind"]


# Limits and errors


@pytest.mark.parametrize("dt", [1, np.float32(0.5), np.int64(2), np.float64(0.25)])
def test_a_timestep_may_have_any_number_type(dt):
    shot = world(1, FREE), [[0.0, 0.0]], [1.0, 0.0]
    check_same(*(simulate(*shot, engine=Engine("pit", step)) for step in (dt, float(dt))))
