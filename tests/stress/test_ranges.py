"""Shots with numbers at the ends of their ranges end with balls on the table and finite numbers."""

import functools
import math
from typing import Any

import numpy as np
import pytest

from billiards_env import Engine, simulate
from billiards_env.engine.overlaps import FIXES
from billiards_env.engine.runner import LOOK_AFTER
from billiards_env.physics.laws.tables import CUSHIONS
from billiards_env.scene import Balls, Physics, Scene, Table
from billiards_env.support.checks import RANGES
from tests.helpers.looks import looks
from tests.helpers.outlines import with_corners

MAX_EVENTS = 2000
Shot = tuple[Scene, np.ndarray, np.ndarray, np.ndarray | None]


def pick(rng: np.random.Generator, key: str, least: float = 0.0, most: float = math.inf) -> float:
    """Returns a number of a range, often one of its ends."""
    low, high, *_ = RANGES[key]
    assert high is not None
    low, high = max(low, least, 1e-12), min(high, most)
    return float(rng.choice([low, high, math.exp(rng.uniform(math.log(low), math.log(high)))]))


def corner(seed: int) -> Shot | None:
    """Returns a shot of 1 to 4 balls; None if there is no room for them."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 5))
    sides = np.array([pick(rng, "length", 4e-4), pick(rng, "length", 4e-4)])
    radius = np.array([pick(rng, "length", most=max(1e-4, 0.15 * sides.min())) for _ in range(n)])
    mass = np.array([pick(rng, "mass") for _ in range(n)])
    mass[1:][rng.random(n - 1) < 0.1] = math.inf
    motion = str(rng.choice(["ideal", "rolling", "sliding", "sliding"]))
    physics = Physics(
        motion=motion,
        cushion="han2005" if motion == "sliding" and rng.random() < 0.5 else "restitution",
        g=pick(rng, "g"),
        mu_slide=pick(rng, "friction"),
        mu_roll=pick(rng, "friction"),
        spin_decay=pick(rng, "spin_decay"),
        e_ball=float(rng.choice([0.0, 1.0, rng.random()])),
        e_cushion=float(rng.choice([0.0, 1.0, rng.random()])),
        mu_cushion=pick(rng, "mu_cushion"),
        max_time=pick(rng, "max_time") if motion == "ideal" or rng.random() < 0.3 else None,
    )
    height = max(1e-6, float(radius.min() * rng.uniform(0.01, 1.99)))
    table = Table(float(sides[0]), float(sides[1]), height)
    scene = Scene(Balls(tuple(radius.tolist()), tuple(mass.tolist())), table, physics)
    places = np.zeros((n, 2))
    for i in range(n):
        for _ in range(200):
            places[i] = rng.uniform(-1, 1, 2) * (sides / 2 - radius[i])
            if i and rng.random() < 0.3:  # in contact
                angle = rng.uniform(0, 2 * math.pi)
                places[i] = places[i - 1] + (radius[i] + radius[i - 1]) * np.array([math.cos(angle), math.sin(angle)])
            apart = np.hypot(*(places[i] - places[:i]).T) >= radius[i] + radius[:i] - 5e-13
            if apart.all() and (np.abs(places[i]) <= sides / 2 - radius[i]).all():
                break
        else:
            return None

    def motions(key: str, width: int) -> np.ndarray:
        most = RANGES[key].most
        assert most is not None
        sizes = rng.choice([most, 1.0, 1e-9, 1e-300], (n, 1))
        values = rng.choice([-1.0, 1.0, 0.0, 0.3], (n, width)) * sizes
        values[np.isinf(mass)] = 0.0
        return values

    return scene, places, motions("speed", 2), motions("spin", 3) if motion == "sliding" else None


def check(shot: Any, scene: Scene, engine: str) -> None:
    """Checks that the results are finite and, with PIC, that all balls are on the table."""
    for name in ("positions", "velocities", "spins", "time"):
        assert np.isfinite(getattr(shot, name)).all(), name
    room = np.array([scene.table.length, scene.table.width]) / 2 - np.array(scene.balls.radius)[:, None]
    if engine == "pic":
        assert (np.abs(shot.positions) <= room + 1e-9).all()


@pytest.mark.parametrize("seed", range(60))
def test_shots_within_the_ranges_end_on_the_table(seed):
    for part in range(5):
        drawn = corner(1000 * seed + part)
        if drawn is None:
            continue
        scene, places, velocities, spins = drawn
        check(simulate(scene, places, velocities, spins=spins, max_events=MAX_EVENTS), scene, "pic")
        rng = np.random.default_rng(seed)
        dt = pick(rng, "dt", least=1e-3)
        fix = str(rng.choice(FIXES))
        limit = min(1e5 * dt, scene.physics.max_time or math.inf)
        engine = Engine("pit", dt, fix)
        pit = simulate(scene, places, velocities, engine=engine, spins=spins, max_events=MAX_EVENTS, max_time=limit)
        check(pit, scene, "pit")


@pytest.mark.parametrize("cushion", ["stronge", "mathavan2010"])
def test_shots_with_extreme_friction_and_spin_end_and_look_for_signals(cushion, monkeypatch):
    """An impact once took a second, and 20,000 of them passed before Ctrl-C had an effect."""
    for seed in range(60):
        rng = np.random.default_rng(seed)
        radius = float(rng.uniform(0.002, 0.05))
        physics = Physics(
            cushion=cushion,
            ball_ball="frictional",
            mu_slide=pick(rng, "friction", least=0.05),
            mu_roll=pick(rng, "friction", least=0.005),
            mu_ball=pick(rng, "mu_ball"),
            mu_cushion=pick(rng, "mu_cushion"),
            e_cushion=float(rng.uniform(0.5, 1.0)),
        )
        table = with_corners(Table(2.0, 1.0, float(radius * rng.choice([0.01, 0.5, 1.5, 1.99]))))
        scene = Scene(Balls.uniform(3, radius), table, physics)
        places = np.array([[-0.5, 0.1], [0.0, 0.0], [2 * radius, 0.0]])
        velocities = rng.choice([-1.0, 0.3, 1.0], (3, 2)) * rng.choice([1e3, 1.0, 1e-9], (3, 1))
        spins = rng.choice([-1.0, 0.0, 1.0], (3, 3)) * rng.choice([1e6, 1e3, 1.0], (3, 1))
        shot = functools.partial(simulate, scene, places, velocities, spins=spins, max_events=20 * MAX_EVENTS)
        count, result = looks(monkeypatch, shot)
        check(result, scene, "pic")
        assert count >= result.cushions.sum() * CUSHIONS[cushion].work // (2 * LOOK_AFTER)
