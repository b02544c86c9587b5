"""Scenes, random shots and checks for the tests of the engines."""

import copy
import dataclasses
import itertools
import math
from typing import Any, NamedTuple

import numpy as np

from billiards_env import Scene
from billiards_env.engine import PIC
from billiards_env.physics import state as columns
from billiards_env.scene import Balls, Physics, Table, layouts
from billiards_env.shots import simulation
from tests.helpers.outlines import apart_places, with_corners

simulate: Any = simulation.simulate  # untyped, because `events` may be None by its type

R = 0.03125  # m; a power of two, so multiples of it are exact
FREE = {"motion": "ideal", "cushion": "restitution", "e_ball": 1.0, "e_cushion": 1.0, "max_time": 10.0}
ROLLING = {"motion": "rolling", "cushion": "restitution", "e_ball": 1.0}
SLIDING = {"motion": "sliding", "e_ball": 1.0}
MOTIONS = {"ideal": FREE, "rolling": ROLLING, "sliding": SLIDING}
OUTLINE_LAWS = {**MOTIONS, "plastic": {**ROLLING, "e_cushion": 0.0}}
SQUARE = Table(64.0, 64.0)
BALL_ARRAYS = (
    *("positions", "velocities", "spins", "potted", "cushions", "cushions_before_hit"),
    *("pockets", "pot_order", "touched_first"),
)
SCALARS = ("time", "n_events", "first_hit", "first_hit_time", "n_contact_rule", "cue")

DTS = (1 / 15, 1 / 30, 1 / 60, 1 / 240)
LAWS = ("ideal", "pool", "uk_pool")
"""Scenes with most of the laws. "ideal" and "pool" share a compiled engine."""

WORLDS = {
    "pool": {},
    "carom": {},
    "ideal": {},
    "pooltool_carom": {},
    "rolling": {"motion": "rolling", "cushion": "restitution"},
    "sliding": {"motion": "sliding", "cushion": "restitution"},
    "dead": {"motion": "rolling", "cushion": "restitution", "e_ball": 0.0, "e_cushion": 0.5},
    "soft": {"motion": "sliding", "cushion": "restitution", "e_ball": 0.5, "e_cushion": 0.0},
}


def world(n, physics, table=SQUARE, mass=None, **changes):
    """Returns a scene of n balls; the default table is too large for cushion contacts."""
    return Scene(Balls((R,) * n, mass or (0.2,) * n), table, Physics(**{**physics, **changes}))


def real(name, n, **physics):
    """Returns a named scene with friction between the balls, compliant cushions and other constants.

    Its table is an outline, so it needs only the compiled engines of "real_pool".
    """
    scene, physics = Scene.named(name, n), {"ball_ball": "frictional", "cushion": "stronge", **physics}
    return dataclasses.replace(scene, table=with_corners(scene.table), physics=Physics(**physics))


def kinds(shot):
    """Returns (kind, ball, other) of each event of a recorded shot."""
    return [(e["kind"], e["ball"], e["other"]) for e in shot.events]


def draw_shot(seed):
    """Returns a random shot: (scene, positions, velocities, spins)."""
    rng = np.random.default_rng(seed)
    name = sorted(WORLDS)[rng.integers(len(WORLDS))]
    arrangement, n = [("random", rng.integers(1, 8)), ("tight_rack", 15), ("tight_rack", 6), ("rack", 10)][
        rng.integers(4)
    ]
    names = {"carom": "carom", "ideal": "ideal", "pooltool_carom": "benchmarks:pooltool_carom"}
    scene = Scene.named(names.get(name, "pool"), int(n))
    scene = dataclasses.replace(scene, physics=dataclasses.replace(scene.physics, **WORLDS[name]))
    positions = layouts.draw(arrangement, scene, rng)
    velocities, spins = np.zeros((scene.n_balls, 2)), None
    aim = positions[1] - positions[0]
    velocities[0] = aim / np.linalg.norm(aim) + rng.normal(size=2) * 0.03
    velocities[0] *= rng.uniform(0.5, 8)
    if rng.random() < 0.25:
        velocities = rng.normal(size=velocities.shape)
    if scene.physics.motion == "sliding" and rng.random() < 0.5:
        spins = np.zeros((scene.n_balls, 3))
        spins[0] = rng.normal(size=3) * 50
    return scene, positions, velocities, spins


def aimed_shot(scene, seed):
    """Returns random positions, and velocities and spins with the cue ball aimed at ball 1."""
    rng = np.random.default_rng(seed)
    places = layouts.draw("random", scene, rng)
    velocities, spins = np.zeros((scene.n_balls, 2)), np.zeros((scene.n_balls, 3))
    toward = places[1] - places[0] + rng.normal(size=2) * 0.02
    velocities[0] = toward / np.linalg.norm(toward) * rng.uniform(0.5, 5)
    spins[0] = rng.normal(size=3) * 30
    return places, velocities, spins if scene.physics.motion == "sliding" else None


def outline_shot(table, rng, n=1, physics=SLIDING):
    """Returns a random shot (scene, positions, velocities, spins) of n pool balls on a table with an outline."""
    law = Physics(**{**physics, "e_ball": 1.0 if physics is FREE else 0.95})
    scene, velocities, angle = Scene(Balls.uniform(n), table, law), np.zeros((n, 2)), rng.uniform(0, 2 * np.pi)
    places = apart_places(table, scene.balls.radius[0], rng, n)
    velocities[0] = rng.uniform(0.3, 6.0) * np.array([np.cos(angle), np.sin(angle)])
    return scene, places, velocities, rng.normal(size=(n, 3)) * 40 if physics is SLIDING else None


def lattice(n, pitch):
    """Returns the places (n, 2) of a lattice around the origin; the pitch, m, may differ along x and y."""
    side = math.ceil(math.sqrt(n))
    return pitch * (np.stack(np.divmod(np.arange(n), side), axis=1) - (side - 1) / 2)


class Motion(NamedTuple):
    """The motion of n balls at an instant.

    Attributes:
        positions: (n, 2) m.
        velocities: (n, 2) m/s.
        slips: (n, 2) velocities of the points that touch the cloth, m/s.
        spins: (n,) spins about the vertical axis, rad/s.
    """

    positions: np.ndarray
    velocities: np.ndarray
    slips: np.ndarray
    spins: np.ndarray


def motion_at(rows, phase, t):
    """Returns the `Motion` at time t, s, of balls with these rows (n, WIDTH) and phases (n,).

    The spins are those at the times of the rows.
    """
    dt = np.where(
        (phase >= columns.SPINNING) & (phase < columns.POTTED), t - rows[:, columns.T0] - rows[:, columns.T0_LO], 0
    )
    dt = np.clip(dt, 0, rows[:, columns.LASTS])[:, None]
    x, v = rows[:, [columns.X, columns.Y]], rows[:, [columns.VX, columns.VY]]
    a, u = rows[:, [columns.AX, columns.AY]], rows[:, [columns.UX, columns.UY]]
    slip = np.where((phase == columns.SLIDING)[:, None], u + 3.5 * a * dt, u)
    return Motion(x + dt * (v + 0.5 * dt * a), v + dt * a, slip, rows[:, columns.WZ].copy())


def instants(shot):
    """Yields the time of each instant with events, and the `Motion` of all balls before and after it."""
    n = len(shot.positions)
    ball, phases, rows = shot.trajectory
    state, phase = rows[:n].copy(), phases[:n].copy()
    times = rows[n:, columns.T0]
    edges = np.r_[0, np.flatnonzero(np.diff(times)) + 1, len(times)] if len(times) else [0]
    for a, b in itertools.pairwise(edges):
        before = motion_at(state, phase, times[a])
        for k in range(n + a, n + b):
            state[ball[k]], phase[ball[k]] = rows[k], phases[k]
        yield times[a], before, motion_at(state, phase, times[a])


def kinetic_energy(motion, scene):
    """Returns the kinetic energy, J, with the energy of the spin about z, which a cushion can change into velocity."""
    mass = np.where(np.isinf(scene.balls.mass), 0.0, scene.balls.mass)
    total = 0.5 * (motion.velocities**2).sum(axis=1)
    if scene.physics.motion == "sliding":
        rolling = ((motion.velocities - motion.slips) ** 2).sum(axis=1)
        total += 0.2 * (rolling + (np.array(scene.balls.radius) * motion.spins) ** 2)
    return float(mass @ total)


def draw_starts(scene, count, arrangement="random"):
    """Returns random positions (count, n, 2), and velocities (count, 2) and spins (count, 3) of the cue ball."""
    rng = np.random.default_rng(0)
    positions = np.array([layouts.draw(arrangement, scene, rng) for _ in range(count)])
    velocities = rng.normal(size=(count, 2)) * 2
    if arrangement != "random":
        velocities = 4 * (positions[:, 1] - positions[:, 0])
    return positions, velocities, rng.normal(size=(count, 3)) * 20


def with_physics(scene, physics, k):
    """Returns the scene of shot k, whose numbers of `Physics` are entry k of the arrays in `physics`."""
    numbers = {name: values[k] for name, values in physics.items()}
    return dataclasses.replace(scene, physics=dataclasses.replace(scene.physics, **numbers))


def check_same(shot, other):
    """Checks that two shots, and their records, are equal bit for bit."""
    for name in (*BALL_ARRAYS, *SCALARS, "status", "events"):
        assert np.array_equal(getattr(shot, name), getattr(other, name)), name
    for array, twin in zip(shot.trajectory or (), other.trajectory or (), strict=True):
        assert np.array_equal(array, twin)


def run_both(scene, positions, velocities, spins=None, record=False, threads=None, **options) -> tuple[Any, list[Any]]:
    """Returns a batch and its shots run one by one, after a check that all results are equal bit for bit.

    Options that are arrays have one entry for each shot, and so has each number of `physics`.
    """
    start: tuple[Any, ...] = positions, velocities, spins, options.get("in_play")
    before = copy.deepcopy(start)
    engine, physics = options.pop("engine", PIC), options.pop("physics", {})
    arguments = {"spins": spins, "threads": threads, "record": record and engine == PIC, "engine": engine, **options}
    batch = simulation.simulate_batch(scene, positions, velocities, physics=physics, **arguments)
    numbers, singles = {name: values for name, values in physics.items() if name != "dt"}, []
    for k in range(len(positions)):
        mine = {name: value[k] if isinstance(value, np.ndarray) else value for name, value in options.items()}
        mine["spins"] = None if spins is None else spins[k]
        mine["engine"] = dataclasses.replace(engine, dt=physics["dt"][k]) if "dt" in physics else engine
        of = with_physics(scene, numbers, k)
        singles.append(simulate(of, positions[k], velocities[k], record=record, **mine))
    for name in BALL_ARRAYS:
        assert np.array_equal(getattr(batch, name), [getattr(shot, name) for shot in singles])
    for name in (*SCALARS, "status"):
        assert getattr(batch, name).tolist() == [getattr(shot, name) for shot in singles]
    assert all(np.array_equal(array, unchanged) for array, unchanged in zip(start, before, strict=True))
    return batch, singles
