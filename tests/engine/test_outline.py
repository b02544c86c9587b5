"""Shots on tables with outlines: both engines, all queues, and cases that are difficult near jaws."""

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from billiards_env import simulation
from billiards_env.engine import pic
from billiards_env.outline import clearance, pieces
from billiards_env.physics.state import FIXES
from billiards_env.scene import Balls, Physics, Scene
from billiards_env.table import Pocket, Table
from reference import plain
from tests.helpers.engine_runs import run
from tests.helpers.outlines import TABLES, beyond, free_places, mirrored, star, table, with_corners
from tests.helpers.shots import FREE, ROLLING, SLIDING, kinds

simulate: Any = simulation.simulate  # untyped, because `events` may be None by its type

R = 0.028575
LAWS = {"ideal": FREE, "rolling": ROLLING, "sliding": SLIDING, "plastic": {**ROLLING, "e_cushion": 0.0}}
tables = st.sampled_from(sorted(TABLES)).map(TABLES.__getitem__) | st.integers(0, 10**4).map(star)
seeds = st.integers(0, 2**32)


def scene_of(a_table, n=1, physics=SLIDING, radius=R, **changes):
    return Scene(Balls.uniform(n, radius), a_table, Physics(**{**physics, **changes}))


def draw(a_table, rng, n=1, physics=SLIDING):
    """Returns a random shot (scene, positions, velocities, spins) of n balls that do not overlap."""
    scene = scene_of(a_table, n, physics, e_ball=1.0 if physics is FREE else 0.95)
    while True:
        places = free_places(a_table, R, rng, n)
        apart = np.linalg.norm(places[:, None] - places, axis=-1) + np.eye(n)
        if apart.min() > 2 * R:
            break
    angle = rng.uniform(0, 2 * math.pi)
    velocities = np.zeros((n, 2))
    velocities[0] = rng.uniform(0.3, 6.0) * np.array([math.cos(angle), math.sin(angle)])
    spins = rng.normal(size=(n, 3)) * 40 if physics is SLIDING else None
    return scene, places, velocities, spins


def play(scene, places, velocities, spins=None, record=True, **options):
    horizon = 2.0 if scene.physics.motion == "ideal" else None
    return simulate(scene, places, velocities, spins=spins, max_time=horizon, record=record, **options)


# The rectangle


@pytest.mark.parametrize("physics", LAWS.values(), ids=LAWS)
@pytest.mark.parametrize("pit", [False, True])
def test_a_rectangle_as_an_outline_is_the_plain_rectangle(physics, pit):
    pockets = (Pocket(0.5, 0.25, 0.06), Pocket(0.0, -0.25, 0.06))
    rectangle = Table(1.0, 0.5, 0.036, pockets)
    outline = with_corners(rectangle)
    numbers = [3, 1, 0, 2]  # the cushions of the rectangle along -x, +x, -y, +y
    options = {"mode": "pit", "dt": 1 / 120} if pit else {}
    for seed in range(30):
        scene, places, velocities, spins = draw(outline, np.random.default_rng(seed), 2, physics)
        shot = play(scene, places, velocities, spins, **options)
        same = play(dataclasses.replace(scene, table=rectangle), places, velocities, spins, **options)
        expected = [(k, b, numbers[o] if k == "cushion" else o) for k, b, o in kinds(same)]
        # After several impacts a difference of rounding may be large.
        until = next((k for k, hits in enumerate(np.cumsum(same.events["kind"] == "ball_ball")) if hits > 2), None)
        assert kinds(shot)[:until] == expected[:until]
        assert shot.events["time"][:until] == pytest.approx(same.events["time"][:until], abs=1e-9)
        if until is None:
            assert shot.positions == pytest.approx(same.positions, abs=1e-9)


@pytest.mark.parametrize("x", [1, -1])
@pytest.mark.parametrize("y", [1, -1])
def test_the_corner_of_two_cushions_hit_exactly_is_that_of_the_rectangle(x, y):
    rectangle = Table(2.0, 1.0)
    numbers = [3, 1, 0, 2]
    radius = 2.0**-5
    for physics in (FREE, ROLLING, SLIDING):
        for gap in (0.5, 0.0):
            start = [[x * (1.0 - radius - gap), y * (0.5 - radius - gap)]]
            shot = play(scene_of(with_corners(rectangle), 1, physics, radius), start, [1.0 * x, 1.0 * y])
            same = play(scene_of(rectangle, 1, physics, radius), start, [1.0 * x, 1.0 * y])
            assert [(k, b, numbers[o] if k == "cushion" else o) for k, b, o in kinds(same)] == kinds(shot)
            hits = shot.events["time"][shot.events["kind"] == "cushion"]
            assert hits[0] == hits[1]
            assert shot.positions == pytest.approx(same.positions, abs=1e-12)


# Tips


@pytest.mark.parametrize("radius", [0.0, 0.004, 0.05])
def test_a_tip_is_like_a_fixed_ball(radius):
    a_table = table([(0, 0), (2, 0), (2, 0.8), (0.8, 0.8, radius), (0.8, 2), (0, 2)])
    tip = pieces(a_table.outline)[1][0]
    rng = np.random.default_rng(0)
    fixed = max(radius, 1e-3)
    hits = 0
    for _ in range(200):
        angle = rng.uniform(math.pi, 1.5 * math.pi)
        start = np.array([tip.x, tip.y]) + 0.3 * np.array([math.cos(angle), math.sin(angle)])
        aim = np.array([tip.x, tip.y]) - start + rng.uniform(-0.04, 0.04, 2)
        physics = Physics(motion="rolling", cushion="restitution", e_ball=0.8, e_cushion=0.8)
        shot = simulate(Scene(Balls.uniform(1, R), a_table, physics), [start], aim, record=True)
        if [k for k in kinds(shot)][0] != ("cushion", 0, 6):
            continue
        hits += 1
        # A fixed ball of the same reach
        balls = Balls((R - fixed + radius, fixed), (0.17, math.inf))
        same = simulate(Scene(balls, Table(8.0, 8.0), physics), [start, [tip.x, tip.y]], aim, record=True)
        assert kinds(same)[0] == ("ball_ball", 0, 1)
        assert shot.events["time"][0] == pytest.approx(same.events["time"][0], abs=1e-14)
        assert shot.events["speed"][0] == pytest.approx(same.events["speed"][0], abs=1e-13)
        t = shot.events["time"][0] + 0.01
        assert shot.at(t)[0] == pytest.approx(same.at(t)[0], abs=1e-14)
    assert hits > 50


# All shots


@settings(max_examples=150)
@given(tables, seeds, st.sampled_from(sorted(LAWS)), st.integers(1, 3))
def test_no_ball_overlaps_the_outline(a_table, seed, law, n):
    scene, places, velocities, spins = draw(a_table, np.random.default_rng(seed), n, LAWS[law])
    shot = play(scene, places, velocities, spins)
    assert shot.status == ("max_time" if law == "ideal" and not shot.potted.all() else "rest")
    assert beyond(scene, shot, 300) < 1e-12


@settings(max_examples=60)
@given(tables, seeds, st.sampled_from(sorted(LAWS)), st.sampled_from([None, *FIXES]))
def test_mirrored_shots_on_mirrored_tables_have_mirrored_results_bit_for_bit(a_table, seed, law, fix):
    scene, places, velocities, spins = draw(a_table, np.random.default_rng(seed), 2, LAWS[law])
    options = {} if fix is None else {"mode": "pit", "dt": 1 / 60, "fix": fix}
    shot = play(scene, places, velocities, spins, record=False, max_events=300, **options)
    for mirror in (np.array([-1.0, 1.0]), np.array([1.0, -1.0]), np.array([-1.0, -1.0])):
        x, y = mirror
        image = play(
            dataclasses.replace(scene, table=mirrored(a_table, mirror)),
            places * mirror,
            velocities * mirror,
            None if spins is None else spins * [y, x, x * y],
            record=False,
            max_events=300,
            **options,
        )
        assert np.array_equal(image.positions, shot.positions * mirror)
        assert np.array_equal(image.velocities, shot.velocities * mirror)
        assert (image.time, image.n_events) == (shot.time, shot.n_events)


@pytest.mark.parametrize("name", TABLES)
def test_all_queues_have_the_same_bits(name):
    rng = np.random.default_rng(3)
    for law in ("ideal", "sliding"):
        for n in (1, 4):
            scene, places, velocities, spins = draw(TABLES[name], rng, n, LAWS[law])
            shots = scene, places[None], velocities[None], None if spins is None else spins[None]
            limit = 2.0 if law == "ideal" else None
            expected = run(pic.run_shots, shots, record=True, max_time=limit)
            for engine in (pic.run_shots_of_many, plain.run_shots):
                for found, array in zip(run(engine, shots, record=True, max_time=limit), expected, strict=True):
                    assert np.array_equal(found, array)


# PIT


@pytest.mark.parametrize("fix", FIXES)
@pytest.mark.parametrize("name", ["octagon", "L", "pool_7ft", "throat"])
def test_pit_approaches_pic_as_the_timestep_falls(name, fix):
    rng = np.random.default_rng(0)
    errors = {1e-3: [], 1e-5: []}
    for _ in range(40):
        scene, places, velocities, spins = draw(TABLES[name], rng, 1, SLIDING)
        exact = simulate(scene, places, velocities, spins=spins, max_time=1.5)
        for dt, found in errors.items():
            shot = simulate(scene, places, velocities, spins=spins, max_time=1.5, mode="pit", dt=dt, fix=fix)
            found.append(np.hypot(*(shot.positions - exact.positions)[0]))
    coarse, fine = (np.median(found) for found in errors.values())
    assert fine < 0.05 * coarse + 1e-12
    assert fine < 1e-4


@pytest.mark.parametrize("fix", FIXES)
@settings(max_examples=60)
@given(tables, seeds, st.sampled_from([1 / 240, 1 / 60, 1 / 15, 1.0]), st.sampled_from([0.3, 3.0, 30.0]))
def test_pit_loses_no_ball_outside_the_outline(fix, a_table, seed, dt, speed):
    scene, places, velocities, spins = draw(a_table, np.random.default_rng(seed), 2, SLIDING)
    velocities *= speed / np.linalg.norm(velocities)
    spins *= 0.1 * speed
    shot = simulate(scene, places, velocities, spins=spins, mode="pit", dt=dt, fix=fix, max_time=max(20.0, 100 * dt))
    room = clearance(a_table.outline, shot.positions)[~shot.potted]
    if shot.status == "rest" and fix == "push_apart":
        assert (room > -1e-9).all()
    assert (room > -(R + 2 * speed * dt)).all()


@pytest.mark.parametrize("fix", ["push_apart", "move_back"])
def test_a_ball_that_has_passed_a_facing_returns_to_the_table(fix):
    """In one step it leaves the throat through the side wall, into the cushion."""
    scene = scene_of(TABLES["throat"], 1, FREE)
    shot = simulate(scene, [[0.5, 0.0]], [0.0, 3.0], mode="pit", dt=0.1, fix=fix, max_time=0.1)
    assert clearance(scene.table.outline, shot.positions)[0] >= -1e-12
    assert shot.velocities[0] == pytest.approx([0.0, -3.0])


def test_move_back_has_the_exact_velocity_after_a_tip():
    scene = scene_of(TABLES["L"], 1, FREE)
    tip = pieces(scene.table.outline)[1][0]
    start = [[tip.x - 0.3, tip.y - 0.35]]
    exact = simulate(scene, start, [1.2, 1.25], max_time=0.35, record=True)
    shot = simulate(scene, start, [1.2, 1.25], max_time=0.35, record=True, mode="pit", dt=0.01, fix="move_back")
    assert kinds(exact) == kinds(shot) == [("cushion", 0, 6)]
    assert shot.velocities == pytest.approx(exact.velocities, abs=1e-12)
