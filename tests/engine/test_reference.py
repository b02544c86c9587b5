"""The engine agrees with shots of pooltool and with the high-precision simulator in `benchmarks.reference.oracle`."""

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.reference.oracle import reference_shot
from benchmarks.reference.stress import families
from billiards_env import Scene, derivatives
from billiards_env.derivatives.shot_derivatives import UNIT_ROUNDOFF
from billiards_env.scene import Balls, Physics, Table
from tests.helpers.derivatives import FALLING
from tests.helpers.outlines import MARBLES, TABLES, apart_places
from tests.helpers.shots import aimed_shot, kinds, real, simulate

SHOTS = json.loads((Path(__file__).parents[1] / "data" / "pooltool_carom_shots.json").read_text())["shots"]
NAMES = {
    "ball-ball": "ball_ball",
    "ball-cushion": "cushion",
    "slide-roll": "sliding_rolling",
    "roll-stop": "rolling_rest",
}
MAX_TIME_ERROR, MAX_POSITION_ERROR = 1e-5, 1e-4  # s, m; pooltool moves balls apart at a contact
NUDGE = 1e-9  # m; the distance by which pooltool moves balls apart


def in_order(events):
    """Returns (kind, *balls) of events (time, kind, *balls) in order; those within 1e-8 s are sorted by name."""
    ordered, last = [], -1.0
    for time, *what in sorted(events):
        if time - last > 1e-8:
            ordered.append([])
        ordered[-1].append(tuple(what))
        last = time
    return [what for instant in ordered for what in sorted(instant)]


@pytest.mark.parametrize("number", range(len(SHOTS)))
def test_a_shot_agrees_with_pooltool(number):
    shot = SHOTS[number]
    scene = Scene.named("benchmarks:pooltool_carom", len(shot["positions"]) - 1)
    result = simulate(scene, shot["positions"], shot["velocity"], record=True)
    events = result.events[result.events["kind"] != "spinning_rest"]  # pooltool has no end of a spin in place
    expected = shot["events"]
    late = max((abs(t - e["time"]) for (t, _, _), e in zip(expected, events, strict=False)), default=0.0)
    off = np.linalg.norm(result.positions - shot["final"], axis=1).max()
    message = f"events off by up to {late:.1e} s, balls by up to {off:.1e} m"
    # pooltool numbers the cushions differently, so only the balls of cushion contacts are compared.
    assert in_order((t, NAMES[kind], *balls[: 1 + (kind == "ball-ball")]) for t, kind, balls in expected) == in_order(
        (float(e["time"]), str(e["kind"]), int(e["ball"]), *([int(e["other"])] if e["kind"] == "ball_ball" else []))
        for e in events
    ), message
    assert late <= MAX_TIME_ERROR, message
    assert off <= MAX_POSITION_ERROR, message
    assert (result.n_contact_rule, result.status) == (0, "rest")


# The high-precision simulator


def agrees(scene, places, start, spins, horizon=None):
    """Compares a shot with the high-precision simulator. Returns the shot, or None if rounding grows too much.

    If a nudge grows by more than 1000, so does the rounding of the input.
    """
    shot = simulate(scene, places, start, spins=spins, max_time=horizon, record=True)
    nudge = np.eye(*np.shape(places)) * (np.arange(np.shape(places)[1]) < 2) * NUDGE
    moved = simulate(scene, places + nudge, start, spins=spins, max_time=horizon)
    if np.abs(moved.positions - shot.positions).max() > 1e3 * NUDGE or shot.n_contact_rule:
        return None
    exact = reference_shot(scene, places, start, spins, max_time=horizon, digits=40)
    assert kinds(shot) == [(e.kind, e.ball, e.other) for e in exact.events]
    assert shot.events["time"] == pytest.approx([float(e.time) for e in exact.events], abs=1e-11)
    positions, velocities = np.array(exact.positions, float), np.array(exact.velocities, float)
    assert shot.positions == pytest.approx(positions[:, :2], abs=1e-11)
    assert shot.velocities == pytest.approx(velocities[:, :2], abs=1e-11)
    if scene.physics.flight:
        assert shot.heights == pytest.approx(np.stack((positions[:, 2], velocities[:, 2]), -1), abs=1e-11)
    assert shot.spins == pytest.approx(np.array(exact.spins, float), abs=1e-9) or scene.physics.motion != "sliding"
    assert shot.potted.tolist() == exact.potted
    for t in np.linspace(0, shot.time, 5, endpoint=False):
        exact_places = np.array(exact.positions_at(t), float)
        assert shot.at(t) == pytest.approx(exact_places[:, :2], abs=1e-11)
        if scene.physics.flight:
            assert shot.heights_at(t) == pytest.approx(exact_places[:, 2], abs=1e-11)
    return shot


RANDOM = {
    "pool": Scene.named("pool", 1),
    "pool of six": Scene.named("pool", 5),
    "carom": Scene.named("carom", 2),
    "ideal": Scene.named("ideal", 3),
    "rolling": dataclasses.replace(Scene.named("pool", 4), physics=Physics(motion="rolling", cushion="restitution")),
    "frictional pool": real("pool", 2),
    "frictional pool of six": real("pool", 5),
    "carom with cling": real("carom", 2, mu_ball_factor=2.5, mu_ball_decay=0.8),
    "carom with falling restitution": real("carom", 2, **FALLING),
    "UK pool": Scene.named("uk_pool", 4),
    "marbles": MARBLES,
}


@pytest.mark.parametrize("name", RANDOM)
def test_random_shots_agree_with_the_high_precision_simulator(name):
    scene, compared = RANDOM[name], 0
    for seed in range(20):
        compared += agrees(scene, *aimed_shot(scene, seed), 3.0 if name == "ideal" else None) is not None
    assert compared >= 8


@pytest.mark.parametrize("name", [name for name in RANDOM if RANDOM[name].physics.ball_ball == "frictional"])
def test_random_frictional_shots_have_the_error_of_their_condition(name):
    scene, ratios = RANDOM[name], []
    for seed in range(15):
        places, start, spins = aimed_shot(scene, seed)
        shot = simulate(scene, places, start, spins=spins, record=True)
        condition = derivatives.sensitivity(shot).condition
        if condition < 1e6:
            exact = reference_shot(scene, places, start, spins, digits=40)
            assert kinds(shot) == [(e.kind, e.ball, e.other) for e in exact.events]
            error = np.abs(shot.positions - np.array(exact.positions, float)).max()
            ratios.append(error / (UNIT_ROUNDOFF * condition))
    assert len(ratios) >= 8
    assert np.median(ratios) <= 1.0
    assert max(ratios) <= 20.0


@pytest.mark.parametrize("name", [*TABLES, "pool_8ft"])
@pytest.mark.parametrize("n", [1, 2])
def test_random_shots_on_outlines_agree_with_the_high_precision_simulator(name, n):
    """Half of the shots start in the mouth of a pocket, or near one."""
    table = TABLES.get(name) or Table.named(name)
    radius = 0.02 if name in ("snooker_12ft", "throat") else 0.028575
    table = dataclasses.replace(table, cushion_height=1.27 * radius)
    scene = Scene(Balls.uniform(n, radius), table, Physics(e_ball=0.95))
    compared = 0
    for seed in range(12):
        rng = np.random.default_rng(seed)
        places = apart_places(table, radius, rng, n)
        while seed % 2 and (np.abs(places[0]) < np.array([table.length, table.width]) / 2 - 0.05).all():
            places = apart_places(table, radius, rng, n)
        angle = rng.uniform(0, 2 * np.pi)
        start = rng.uniform(0.3, 4) * np.array([np.cos(angle), np.sin(angle)])
        compared += agrees(scene, places, start, rng.normal(size=3) * 30) is not None
    assert compared >= 3


# Flights: the velocities are (x, y, z) in m/s

JUMP = dataclasses.replace(Scene.named("pool"), physics=Physics(flight=True, ball_ball="frictional", cushion="stronge"))
HALF = JUMP.table.length / 2
RAIN: Any = families.FAMILIES["rain of 6 balls"]
AIR = {  # two places, the velocity and the spin of the cue ball, and events
    "hops, then rolls": ((-0.9, 0.1, 0), (0.9, -0.4, 0), (2.0, 0.3, -1.5), (3, -40, 9), ["landing"]),
    "jumps over a ball": ((-0.6, 0, 0), (-0.3, 0.01, 0), (2.0, 0.1, -2.5), (5, 1, 2), ["landing", "cushion"]),
    "hits a ball in the air": ((-0.6, 0, 0), (-0.3, 0.2, 0.3), (2.0, 1.4, -2.5), (5, 1, 2), ["landing", "ball_ball"]),
    "hops after a full hit": ((-0.6, 0, 0), (0, 0.002, 0), (5.0, 0.02, 0), (1, 170, 2), ["ball_ball", "landing"]),
    "falls on a ball": ((-0.03, 0, 0.2), (0, 0.012, 0), (0.1, 0.02, 0), (9, 17, 2), ["ball_ball", "landing"]),
    "hits a nose": ((HALF - 0.3, 0.3, 0), (-0.3, 0, 0), (3.0, 0.4, -0.9), (9, -17, 12), ["landing", "cushion"]),
    "flies over a cushion": ((HALF - 0.3, 0.3, 0), (-0.3, 0, 0), (3.0, 0.4, -4.0), (9, -17, 12), ["off_table"]),
    "lands in a pocket": ((HALF - 0.2, 0.43, 0.1), (-0.3, 0, 0), (1.3, 1.31, 0.2), (9, -17, 12), ["pocket"]),
    "hits the back of a pocket": ((HALF - 0.2, 0.43, 0.02), (-0.3, 0, 0), (4.3, 4.31, 0), (9, -17, 12), ["pocket"]),
    "hits the end of a nose": ((0.01, 0.55, 0.01), (-0.3, 0, 0), (0.6, 0.6, 0.6), (9, -17, 12), ["cushion"]),
}


JAWS = dataclasses.replace(Scene.named("real_pool", 2), physics=JUMP.physics)  # the third ball rests
MOUTH = (HALF - 0.1, 0.535)  # in front of a corner pocket
AT_JAWS = {
    "meets a tip": ((1.15, 0.585, 0.02), (-0.3, 0, 0), (2.0, -0.7, 0.3), (1, 2, 3), ["cushion"]),
    "falls on a tip": ((1.2395, 0.529, 0.2), (-0.3, 0, 0), (0.1, -0.04, 0.4), (9, -17, 12), ["cushion"]),
    "flies over a tip": ((1.15, 0.585, 0.02), (-0.3, 0, 0), (2.0, -0.7, 2.3), (1, 2, 3), ["off_table"]),
    "hits a facing": ((*MOUTH, 0.02), (-0.3, 0, 0), (1.5, 0.5, 0.4), (9, -17, 12), ["cushion"]),
    "hits the end of a facing": ((*MOUTH, 0.01), (-0.3, 0, 0), (1.5, 0.83, 0.6), (9, -17, 12), ["cushion"]),
    "lands between the jaws": ((*MOUTH, 0.01), (-0.3, 0, 0), (0.3, 0.3, 0), (0, 0, 9), ["landing", "pocket"]),
    "hits the back of a pocket with jaws": ((*MOUTH, 0.025), (-0.3, 0, 0), (3.0, 3.0, 0), (9, -17, 12), ["pocket"]),
    "flies over a pocket with jaws": ((*MOUTH, 0.03), (-0.3, 0, 0), (3.0, 3.0, 1.3), (9, -17, 12), ["off_table"]),
}


@pytest.mark.parametrize(("scene", "name"), [*((JUMP, name) for name in AIR), *((JAWS, name) for name in AT_JAWS)])
def test_a_flight_agrees_with_the_high_precision_simulator(scene, name):
    *places, start, spin, expected = (AIR | AT_JAWS)[name]
    places += [(0.0, -0.4, 0.0)] * (scene.n_balls - 2)
    moving, turning = np.zeros((2, scene.n_balls, 3))
    moving[0], turning[0] = start, spin
    shot = agrees(scene, np.array(places), moving, turning)
    assert shot is not None
    assert set(expected) <= set(shot.events["kind"])
    assert name != "jumps over a ball" or not (shot.events["kind"] == "ball_ball").any()


def test_random_flights_agree_with_the_high_precision_simulator():
    scene, places, velocities, spins = RAIN(np.random.default_rng(0), 16)
    shots = [agrees(scene, *start) for start in zip(places, velocities, spins, strict=True)]
    assert sum(shot is not None for shot in shots) >= 8


def test_random_flights_of_balls_of_different_masses_agree_with_the_high_precision_simulator():
    scene, places, velocities, spins = RAIN(np.random.default_rng(2), 12)
    scene = with_masses(scene, 0.05, 0.5, 0.17, 0.17, 1.0, 0.1)
    shots = [agrees(scene, *start) for start in zip(places, velocities, spins, strict=True)]
    assert sum(shot is not None for shot in shots) >= 6


SIZES: Any = families.FAMILIES["rain of 6 balls of several sizes"]


def test_random_flights_of_balls_of_several_sizes_agree_with_the_high_precision_simulator():
    scene, places, velocities, spins = SIZES(np.random.default_rng(1), 12)
    shots = [agrees(scene, *start) for start in zip(places, velocities, spins, strict=True)]
    assert sum(shot is not None for shot in shots) >= 6


@pytest.mark.parametrize("radii", [(0.024, 0.03), (0.035, 0.025)])
@pytest.mark.parametrize("name", AIR)
def test_a_flight_of_balls_of_two_sizes_agrees_with_the_high_precision_simulator(name, radii):
    scene = dataclasses.replace(JUMP, balls=Balls(radii, (0.1, 0.2), shape="sphere"))
    *places, start, spin, _ = AIR[name]
    assert agrees(scene, np.array(places), np.array([start, (0, 0, 0)]), [spin, (0, 0, 0)], 1.0) is not None


@pytest.mark.parametrize("name", ["falls on a ball", "hits a ball in the air"])
@pytest.mark.parametrize("mass", [0.05, 0.6])
def test_an_impact_in_the_air_of_balls_of_two_masses_agrees_with_the_high_precision_simulator(name, mass):
    *places, start, spin, expected = AIR[name]
    shot = agrees(with_masses(JUMP, mass, 0.17), np.array(places), np.array([start, (0, 0, 0)]), [spin, (0, 0, 0)])
    assert shot is not None
    assert set(expected) <= set(shot.events["kind"])


def with_masses(scene, *mass):
    """Returns a scene with other masses, kg."""
    return dataclasses.replace(scene, balls=dataclasses.replace(scene.balls, mass=mass))


@pytest.mark.parametrize("name", ["pool_9ft", "uk_7ft"])
def test_random_flights_at_jaws_agree_with_the_high_precision_simulator(name):
    """Three balls fly to a pocket. The tips of "uk_7ft" reach into the pockets."""
    rng, scene = np.random.default_rng(0), dataclasses.replace(JAWS, table=Table.named(name))
    pockets, kinds_found, compared = scene.table.pocket_places, set(), 0
    while compared < 16:
        goal = pockets[rng.integers(len(pockets))]
        places = goal * (1 - rng.uniform(0.2, 0.4, (3, 1))) + rng.normal(0, 0.05, (3, 2))
        velocities = (goal - places + rng.normal(0, 0.05, (3, 2))) * rng.uniform(1, 8, (3, 1))
        places = np.column_stack((places, rng.uniform(0.03, 0.1, 3)))
        velocities = np.column_stack((velocities, rng.normal(0, 0.7, 3)))
        apart = np.linalg.norm(places[:, None] - places, axis=-1) + np.eye(3)
        if apart.min() < 0.06 or (scene.table.clearance(places[:, :2]) < 0.03).any():
            continue
        shot = agrees(scene, places, velocities, rng.normal(size=(3, 3)) * 30)
        if shot is not None:
            compared += 1
            kinds_found |= set(shot.events["kind"])
    assert kinds_found >= {"cushion", "landing", "pocket", "off_table"}


@pytest.mark.parametrize("signs", [(-1, 1, 1), (1, -1, 1)])
@pytest.mark.parametrize("name", ["rain of 6 balls", "rain of 6 balls with jaws", "rain of 6 balls of several sizes"])
def test_flights_have_mirror_images_and_no_order_of_balls(signs, name):
    family: Any = families.FAMILIES[name]
    scene, places, velocities, spins = family(np.random.default_rng(1), 20)
    order, turns = np.array([0, 4, 2, 5, 1, 3]), np.prod(signs) * np.array(signs)
    radius, mass = (tuple(np.array(part)[order].tolist()) for part in (scene.balls.radius, scene.balls.mass))
    other = dataclasses.replace(scene, balls=dataclasses.replace(scene.balls, radius=radius, mass=mass))
    for start in zip(places, velocities, spins, strict=True):
        shot = simulate(scene, *start[:2], spins=start[2])
        at, moving, turning = (
            part[order] * factors for part, factors in zip(start, (signs, signs, turns), strict=True)
        )
        image = simulate(other, at, moving, spins=turning)
        assert (image.time, image.n_events, image.n_contact_rule) == (shot.time, shot.n_events, shot.n_contact_rule)
        assert image.positions.tolist() == (shot.positions[order] * signs[:2]).tolist()
        assert image.potted.tolist() == shot.potted[order].tolist()
