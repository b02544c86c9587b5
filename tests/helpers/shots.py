"""Scenes, random shots and checks that several tests of the engine use."""

from __future__ import annotations

import dataclasses

import numpy as np

from billiards_env import Scene, layouts
from billiards_env.engine.shots import STATUS
from billiards_env.physics import state as layout
from billiards_env.scene import Balls, Physics, Table

R = 0.03125  # exact in binary, as is the spin of a rolling ball
FREE = {"motion": "ideal", "cushion": "restitution", "e_ball": 1.0, "e_cushion": 1.0, "max_time": 10.0}
ROLLING = {"motion": "rolling", "cushion": "restitution", "e_ball": 1.0}
SLIDING = {"motion": "sliding", "e_ball": 1.0}
SQUARE = Table(64.0, 64.0)
ARRAYS = ("positions", "velocities", "spins", "potted", "cushions", "cushions_before_hit")
SCALARS = ("time", "n_events", "first_hit", "n_contact_rule")

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
    """A scene of n balls on a table that is too large to matter."""
    return Scene(Balls((R,) * n, mass or (0.2,) * n), table, Physics(**{**physics, **changes}))


def kinds(shot):
    return [(e["kind"], e["ball"], e["other"]) for e in shot.events]


def draw_shot(seed):
    """A random shot: (scene, positions, velocities, spins)."""
    rng = np.random.default_rng(seed)
    name = sorted(WORLDS)[rng.integers(len(WORLDS))]
    arrangement, n = [("random", rng.integers(1, 8)), ("tight_rack", 15), ("tight_rack", 6), ("rack", 10)][
        rng.integers(4)
    ]
    scene = Scene.named(name if name in ("carom", "ideal", "pooltool_carom") else "pool", int(n))
    scene = dataclasses.replace(scene, physics=dataclasses.replace(scene.physics, **WORLDS[name]))
    places = layouts.draw(arrangement, scene, rng)
    velocities, spins = np.zeros((scene.n_balls, 2)), None
    velocities[0] = (places[1] - places[0]) / np.linalg.norm(places[1] - places[0]) + rng.normal(size=2) * 0.03
    velocities[0] *= rng.uniform(0.5, 8)
    if rng.random() < 0.25:
        velocities = rng.normal(size=velocities.shape)
    if scene.physics.motion == "sliding" and rng.random() < 0.5:
        spins = np.zeros((scene.n_balls, 3))
        spins[0] = rng.normal(size=3) * 50
    return scene, places, velocities, spins


def at_time(state, phase, t):
    """(n, 7): position, velocity, slip and z spin of all balls at time t."""
    dt = np.where(
        (phase >= layout.SPINNING) & (phase < layout.POTTED), t - state[:, layout.T0] - state[:, layout.T0_LO], 0
    )
    dt = np.clip(dt, 0, state[:, layout.LASTS])[:, None]
    a = state[:, [layout.AX, layout.AY]]
    v, u = state[:, [layout.VX, layout.VY]], state[:, [layout.UX, layout.UY]]
    slip = np.where((phase == layout.SLIDING)[:, None], u + 3.5 * a * dt, u)
    return np.hstack([state[:, :2] + dt * (v + 0.5 * dt * a), v + dt * a, slip, state[:, [layout.WZ]]])


def kinetic_energy(balls, scene):
    """Kinetic energy, J, with that of the spin about z, which a cushion can turn into motion."""
    mass = np.where(np.isinf(scene.balls.mass), 0.0, scene.balls.mass)
    v, u = balls[:, 2:4], balls[:, 4:6]
    total = 0.5 * (v**2).sum(axis=1)
    if scene.physics.motion == "sliding":
        total += 0.2 * (((v - u) ** 2).sum(axis=1) + (np.array(scene.balls.radius) * balls[:, 6]) ** 2)
    return float(mass @ total)


def draw_starts(scene, count, arrangement="random"):
    rng = np.random.default_rng(0)
    places = np.array([layouts.draw(arrangement, scene, rng) for _ in range(count)])
    starts = rng.normal(size=(count, 2)) * 2
    if arrangement != "random":
        starts = 4 * (places[:, 1] - places[:, 0])
    return places, starts, rng.normal(size=(count, 3)) * 20


def check_batch(batch, singles):
    for name in ARRAYS:
        assert np.array_equal(getattr(batch, name), [getattr(shot, name) for shot in singles])
    for name in SCALARS:
        assert getattr(batch, name).tolist() == [getattr(shot, name) for shot in singles]
    assert [STATUS[k] for k in batch.status] == [shot.status for shot in singles]
