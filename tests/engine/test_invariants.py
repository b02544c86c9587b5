"""What all shots of both engines keep: mirror images, numbers of the balls, energy, momentum, limits."""

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from benchmarks.reference.stress import checks, families
from benchmarks.reference.stress.draw import star
from billiards_env import Scene
from billiards_env.engine import MAX_EVENTS, PIC, Engine, pic
from billiards_env.engine.log import N_EVENTS_LOGGED, N_SEGMENTS_LOGGED, SEGMENT_ROW, TIME, Log
from billiards_env.engine.overlaps import FIXES
from billiards_env.engine.shot_input import check_shot
from billiards_env.engine.shots import AT_EVENT_LIMIT, AT_REST, Shots
from billiards_env.physics.state import T0
from billiards_env.scene import Balls, Physics, Table, layouts
from billiards_env.shots.simulation import run_shot
from tests.helpers.engine_runs import CELL_GRID, PLAIN, run
from tests.helpers.impacts import cluster
from tests.helpers.outlines import MARBLES, TABLES, mirrored
from tests.helpers.shots import (
    BALL_ARRAYS,
    DTS,
    MOTIONS,
    OUTLINE_LAWS,
    aimed_shot,
    check_same,
    draw_shot,
    instants,
    kinetic_energy,
    motion_at,
    outline_shot,
    simulate,
    world,
)

UK = Scene.named("uk_pool", 4)
SEEDS = st.integers(0, 10**6)


def dense(seed):
    """Returns a shot of 3 to 12 balls of any size on a small table; each touches others, and some touch cushions."""
    rng = np.random.default_rng(seed)
    n, motion = int(rng.integers(3, 13)), str(rng.choice(["ideal", "rolling", "sliding"]))
    radius, places, _ = cluster(rng, n)
    low, high = (places - radius[:, None]).min(axis=0), (places + radius[:, None]).max(axis=0)
    table = Table(*(high - low + rng.choice([0.0, 0.05], 2)).tolist(), cushion_height=1.3 * radius.min())
    physics = Physics(
        motion=motion,
        cushion="han2005" if motion == "sliding" else "restitution",
        e_ball=rng.random(),
        e_cushion=rng.random(),
        max_time=5.0 if motion == "ideal" else None,
    )
    scene = Scene(Balls(tuple(radius.tolist()), tuple((10.0 ** rng.uniform(-1.5, 1.5, n)).tolist())), table, physics)
    velocities = rng.normal(size=(n, 2)) * (rng.random((n, 1)) < 0.4)
    return scene, places - 0.5 * (low + high), velocities, rng.normal(0, 60, (n, 3)) if motion == "sliding" else None


def on_an_outline(seed):
    """Returns a shot of two balls on a table with an outline."""
    rng = np.random.default_rng(seed)
    table = star(int(rng.integers(10**4))) if rng.random() < 0.5 else TABLES[str(rng.choice(sorted(TABLES)))]
    return outline_shot(table, rng, 2, OUTLINE_LAWS[str(rng.choice(sorted(OUTLINE_LAWS)))])


WORLDS: dict[str, Any] = {
    "racks and scattered balls": draw_shot,
    "outlines": on_an_outline,
    "spheres": lambda seed: (UK, *aimed_shot(UK, seed)),
    "spheres of different size": lambda seed: (MARBLES, *aimed_shot(MARBLES, seed)),
    "touching balls": dense,
}
engines_and_worlds = pytest.mark.parametrize(
    ("engine", "world"), [("pic", world) for world in WORLDS] + [("pit", world) for world in [*WORLDS][:-1]]
)


def options_of(engine, scene, seed) -> dict[str, Any]:
    """Returns arguments of `simulate`, with a random timestep and treatment of overlaps. Ideal balls move for 3 s."""
    rng = np.random.default_rng([seed, 1])
    options: dict[str, Any] = {"max_time": 3.0 if scene.physics.motion == "ideal" else None, "max_events": 50_000}
    if engine == "pit":
        options["engine"] = Engine("pit", DTS[rng.integers(len(DTS))], FIXES[rng.integers(len(FIXES))])
    return options


def play(shot, options, **more):
    scene, positions, velocities, spins = shot
    return simulate(scene, positions, velocities, spins=spins, **options, **more)


def strike_ball(ball, shot, engine=PIC, max_time=None, max_events=MAX_EVENTS):
    """Runs a shot in which a given ball is the cue ball."""
    scene, positions, velocities, spins = shot
    start = check_shot(scene, positions, velocities, spins, None, max_time)._replace(cue=ball)
    return run_shot(scene, start, engine, max_events=max_events)


@engines_and_worlds
@settings(max_examples=30)
@given(seed=SEEDS)
def test_mirrored_shots_have_mirrored_results_bit_for_bit(engine, world, seed):
    scene, positions, velocities, spins = drawn = WORLDS[world](seed)
    options = options_of(engine, scene, seed)
    shot = play(drawn, options)
    for x, y in ((-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)):
        mirror, turned = np.array([x, y]), None if spins is None else spins * [y, x, x * y]  # spin is an axial vector
        table = mirrored(scene.table, mirror) if world == "outlines" else scene.table
        other = dataclasses.replace(scene, table=table), positions * mirror, velocities * mirror, turned
        image = play(other, options)
        assert np.array_equal(image.positions, shot.positions * mirror)
        assert np.array_equal(image.velocities, shot.velocities * mirror)
        assert (image.time, image.n_events) == (shot.time, shot.n_events)


def renumbered(shot, order):
    """Returns a shot whose ball k is ball order[k] of the given one."""
    scene, positions, velocities, spins = shot
    radius, mass = (tuple(values[k] for k in order) for values in (scene.balls.radius, scene.balls.mass))
    balls = dataclasses.replace(scene.balls, radius=radius, mass=mass)
    spins = None if spins is None else spins[order]
    return dataclasses.replace(scene, balls=balls), positions[order], velocities[order], spins


@engines_and_worlds
@settings(max_examples=30)
@given(seed=SEEDS)
@example(seed=428)  # PIC, a rack: a velocity halfway between two doubles was rounded by the order of the contacts
@example(seed=16)  # PIT, a rack: an impact that the fix had removed changed the velocities of the first pair
def test_the_numbers_of_the_balls_change_no_bit(engine, world, seed):
    """Simultaneous impacts on cushions were once resolved in the order of the balls."""
    shot, rng = WORLDS[world](seed), np.random.default_rng(seed)
    order = np.r_[0, 1 + rng.permutation(shot[0].n_balls - 1)] if seed % 2 else rng.permutation(shot[0].n_balls)
    options = options_of(engine, shot[0], seed)
    played, other = play(shot, options), strike_ball(order.tolist().index(0), renumbered(shot, order), **options)
    for name in set(BALL_ARRAYS) - {"pot_order"}:  # balls that drop at the same instant have the order of their numbers
        assert np.array_equal(getattr(other, name), getattr(played, name)[order])
    for name in ("time", "n_events", "n_contact_rule", "first_hit_time"):
        assert getattr(other, name) == getattr(played, name)


@pytest.mark.parametrize("world", [world for world in WORLDS if world != "outlines"])  # `test_outline.py` has those
@settings(max_examples=40)
@given(seed=SEEDS)
def test_every_event_keeps_the_rules(world, seed):
    """No energy is created, impacts of balls keep momentum, and no balls overlap or are outside the table."""
    scene, positions, velocities, spins = WORLDS[world](seed)
    ideal = scene.physics.motion == "ideal"
    turning = None if spins is None else spins[None]
    limits: dict[str, Any] = {"max_time": 3.0 if ideal else None, "max_events": 50_000}
    checked = checks.check_shots(scene, positions[None], velocities[None], turning, **limits)
    assume(checked.shots.status[0] != AT_EVENT_LIMIT)  # clusters of inelastic balls, which tests/stress runs to rest
    assert not checked.bad(ideal).any(), checked.findings


# The time of impact raises the energy of shot 39 by a few millionths. Random examples hit such shots now and then.
RISES = pytest.param(39, marks=pytest.mark.xfail(reason="fix = 'time_of_impact' may raise the energy a little"))


@pytest.mark.parametrize("seed", [*range(39), RISES, *range(40, 60)])
def test_with_timesteps_energy_does_not_rise_and_impacts_of_balls_keep_momentum(seed):
    """With the time of impact an event is compared with the step before, as friction acts on other velocities since."""
    drawn = scene, *_ = draw_shot(seed)
    options = options_of("pit", scene, seed)
    at_impact = options["engine"].fix == "time_of_impact" and scene.physics.motion != "ideal"
    shot = play(drawn, options, record=True)
    kinds: dict[float, set[str]] = {}
    for event in shot.events:
        kinds.setdefault(event["time"], set()).add(event["kind"])
    mass, (_, phases, rows) = np.array(scene.balls.mass), shot.trajectory
    start = last = kinetic_energy(motion_at(rows[: len(mass)], phases[: len(mass)], 0.0), scene)
    total = math.sqrt(2 * start * mass.sum())  # no momentum is larger
    energies = [(-math.inf, start)]
    for t, before, after in instants(shot):
        assert kinetic_energy(before, scene) <= last + 1e-13 * start
        last = kinetic_energy(after, scene)
        earlier = [energy for time, energy in energies if time <= t - 0.999 * options["engine"].dt]
        assert last <= (earlier[-1] if at_impact else kinetic_energy(before, scene)) + 1e-13 * start
        energies.append((t, last))
        if kinds.get(t) == {"ball_ball"} and not at_impact:
            assert np.abs(mass @ (after.velocities - before.velocities)).max() <= 1e-13 * total
    if scene.physics.motion == "ideal":
        assert 0.5 * mass @ (shot.velocities**2).sum(axis=1) == pytest.approx(start, rel=1e-12)


@pytest.mark.parametrize("engine", ["pic", "pit"])
@settings(max_examples=60)
@given(seed=SEEDS)
@example(seed=15360)  # balls at rest are moved apart at the end of the last timestep
def test_a_record_is_complete_and_in_order(engine, seed):
    drawn = scene, places, *_ = draw_shot(seed)
    options = options_of(engine, scene, seed)
    shot, bare = play(drawn, options, record=True), play(drawn, options)
    assume(shot.status != "event_limit")
    assert shot.status == ("max_time" if scene.physics.motion == "ideal" else "rest")
    assert (np.diff(shot.events["time"]) >= 0).all()
    assert len(shot.events) == shot.n_events
    assert bare.events is bare.trajectory is None
    check_same(bare, dataclasses.replace(shot, events=None, trajectory=None))
    assert np.array_equal(shot.at(0.0), places)
    assert shot.at(shot.time) == pytest.approx(shot.positions, abs=1e-13)
    assert np.isfinite(shot.positions).all()
    kind, ball, other = (shot.events[name] for name in ("kind", "ball", "other"))
    assert shot.cushions.tolist() == [int(((kind == "cushion") & (ball == i)).sum()) for i in range(len(places))]
    assert np.flatnonzero(shot.potted).tolist() == sorted(ball[kind == "pocket"])
    hits = np.flatnonzero((kind == "ball_ball") & (ball == 0))
    assert shot.first_hit == (other[hits[0]] if len(hits) else -1)
    bounces, before = np.cumsum((kind == "cushion") & (ball == 0)), np.full(len(places), -1)
    before[other[hits[::-1]]] = bounces[hits[::-1]]  # the first hit of each ball
    assert shot.cushions_before_hit.tolist() == before.tolist()
    first = shot.events["time"][hits] == shot.first_hit_time
    assert shot.first_hit_time == (shot.events["time"][hits[0]] if len(hits) else math.inf)
    assert np.flatnonzero(shot.touched_first).tolist() == sorted(set(other[hits[first]].tolist()))
    assert shot.pots == tuple(shot.events[kind == "pocket"][["ball", "other"]].tolist())
    assert (shot.pot_order >= 0).tolist() == (shot.pockets >= 0).tolist() == shot.potted.tolist()
    assert (shot.n_contact_rule > 0) == shot.events["rule"].any() <= (engine == "pic")


@pytest.mark.parametrize(("n", "layout"), [(3, "random"), (15, "tight_rack")])
def test_a_shot_without_velocity_has_no_events(n, layout):
    scene = Scene.named("pool", n)
    places = layouts.draw(layout, scene, np.random.default_rng(0))
    for arguments in ({}, {"max_time": 0.0}, {"max_events": 0}):
        shot = simulate(scene, places, [0.0, 0.0], record=True, **arguments)
        assert (shot.status, shot.n_events, shot.time, len(shot.events)) == ("rest", 0, 0.0, 0)
        assert np.array_equal(shot.positions, places)


@pytest.mark.parametrize("physics", MOTIONS.values(), ids=MOTIONS)
def test_impacts_do_not_move_a_fixed_ball(physics):
    places, velocities = [[-1.0, 0.0], [0.0, 0.01], [0.5, 0.0]], [[3.0, 0.0], [0.0, 0.0], [-3.0, 0.0]]
    shot = simulate(world(3, physics, mass=(0.2, math.inf, 0.2)), places, velocities, record=True)
    hits = shot.events[shot.events["kind"] == "ball_ball"][["ball", "other"]].tolist()
    assert {(0, 1), (1, 2)} <= set(hits)
    assert shot.positions[1].tolist() == places[1]
    assert shot.velocities[1].tolist() == [0.0, 0.0]


FAMILIES = ("pool, 1 object ball", "UK pool, 5 object balls", "15-ball break, tight rack", "ideal gas of 16 disks")


def arrays_of(queue, shot, **options):
    """Returns the `Shots` of one shot, its events and its segments."""
    arrays = run(queue, shot, record=True, **options)
    shots, log = Shots(*arrays[: len(Shots._fields)]), Log(*arrays[len(Shots._fields) :])
    return shots, log.events[: log.used[N_EVENTS_LOGGED]], log.segments[: log.used[N_SEGMENTS_LOGGED]]


def check_cuts(queue, shot, rng, **options):
    """Cuts a shot at random times, at the times of events and at numbers of events."""
    uncut, events, segments = arrays_of(queue, shot, **options)
    if len(events) == 0:
        return
    times = events[rng.integers(len(events), size=3), TIME]
    limits = np.concatenate((rng.uniform(0, events[-1, TIME], 3), times, np.nextafter(times, 0)))
    for limit in limits:
        _, kept, pieces = arrays_of(queue, shot, max_time=limit, **options)
        assert np.array_equal(kept, events[events[:, TIME] <= limit])
        assert np.array_equal(pieces, segments[: len(pieces)])
        assert (segments[len(pieces) :, SEGMENT_ROW + T0] >= limit).all()
    if uncut.status[0] == AT_REST:
        assert arrays_of(queue, shot, max_events=len(events), **options)[0].status[0] == AT_REST
    for most in rng.integers(len(events), size=3):
        shots, kept, pieces = arrays_of(queue, shot, max_events=most, **options)
        assert most <= len(kept) == shots.n_events[0]
        assert shots.status[0] == AT_EVENT_LIMIT or len(kept) == len(events)
        assert shots.time[0] == (kept[-1, TIME] if len(kept) else 0.0)
        assert np.count_nonzero(kept[:, TIME] < shots.time[0]) < max(most, 1)  # it ends with the instant of the limit
        assert np.array_equal(kept, events[: len(kept)])
        assert np.array_equal(pieces, segments[: len(pieces)])


@pytest.mark.parametrize("family", FAMILIES)
@settings(max_examples=8)
@given(seed=SEEDS, dt=st.sampled_from((1 / 15, 1 / 60, 1 / 240)), fix=st.sampled_from(FIXES))
def test_a_shot_that_is_cut_is_a_prefix_of_the_whole_shot(family, seed, dt, fix):
    rng = np.random.default_rng(seed)
    shot = families.FAMILIES[family](rng, 1)
    assert shot is not None
    queues = [pic.ALL_PAIRS]
    if shot[0].balls.shape == "disk":  # for spheres they are not compiled
        queues += [CELL_GRID, PLAIN]
    if shot[0].n_balls <= 2:
        queues.append(pic.ONE_PAIR)
    for queue in queues:
        check_cuts(queue, shot, rng)
    if seed % 2:
        check_cuts(None, shot, rng, dt=dt, fix=fix)
