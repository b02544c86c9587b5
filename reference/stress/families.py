"""Families of random shots for the stress test: each has a scene, a layout and a distribution of strokes."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from billiards_env import layouts
from billiards_env.scene import Balls, Physics, Scene
from billiards_env.table import Table
from reference.stress import draw
from reference.stress.checks import MOMENTUM, OUTSIDE, OVERLAP, RISE, check_shots

Floats = NDArray[np.float64]
Shots = tuple[Scene, Floats, Floats, Floats | None]


def _scattered(scene: Scene) -> Callable[[np.random.Generator, int], Shots | None]:
    def shots(rng: np.random.Generator, m: int) -> Shots | None:
        places = draw.layouts(scene, rng, m)
        return None if places is None else (scene, places, *draw.cue_shots(scene, rng, m))

    return shots


def _break(layout: str, balls: int) -> Callable[[np.random.Generator, int], Shots]:
    scene = Scene.named("pool", balls)

    def shots(rng: np.random.Generator, m: int) -> Shots:
        places = np.array([layouts.draw(layout, scene, rng) for _ in range(m)])
        aim = places[:, 1] - places[:, 0]
        aim[:, 1] += rng.uniform(-0.02, 0.02, m)
        velocities = aim * (rng.uniform(4, 12, m) / np.hypot(*aim.T))[:, None]
        return scene, places, velocities, rng.uniform(-1, 1, (m, 3)) * 100

    return shots


def _gas(n: int) -> Callable[[np.random.Generator, int], Shots | None]:
    physics = Physics(motion="ideal", cushion="restitution", e_ball=1.0, e_cushion=1.0, max_time=1.0)
    scene = Scene(Balls((0.03,) * n, (0.17,) * n), Table(1.0, 1.0), physics)

    def shots(rng: np.random.Generator, m: int) -> Shots | None:
        places = draw.layouts(scene, rng, m)
        return None if places is None else (scene, places, rng.normal(size=(m, n, 2)), None)

    return shots


def _wild(rng: np.random.Generator, m: int) -> Shots | None:
    scene = draw.wild_scene(rng)
    shots = draw.wild_shots(scene, rng, m)
    return None if shots is None else (scene, *shots)


def _rolling(scene: Scene) -> Scene:
    return dataclasses.replace(scene, physics=Physics(motion="rolling", cushion="restitution"))


FAMILIES: dict[str, Callable[[np.random.Generator, int], Shots | None]] = {
    "pool, cue ball alone": _scattered(Scene.named("pool", 0)),
    "carom, cue ball alone": _scattered(Scene.named("carom", 0)),
    "pool, 1 object ball": _scattered(Scene.named("pool", 1)),
    "pool, 5 object balls": _scattered(Scene.named("pool", 5)),
    "carom, 2 object balls": _scattered(Scene.named("carom", 2)),
    "pooltool carom, 2 object balls": _scattered(Scene.named("pooltool_carom", 2)),
    "rolling pool, 3 object balls": _scattered(_rolling(Scene.named("pool", 3))),
    "9-ball break, loose rack": _break("rack", 9),
    "9-ball break, tight rack": _break("tight_rack", 9),
    "15-ball break, loose rack": _break("rack", 15),
    "15-ball break, tight rack": _break("tight_rack", 15),
    "ideal gas of 16 disks": _gas(16),
    "wild": _wild,
}


def run(name: str, seed: int, shots: int) -> dict[str, Any]:
    """Runs shots of a family and checks every event of each.

    Returns:
        `shots`, their number; `overlap` and `outside`, the deepest overlap and the largest distance beyond a cushion,
        m; `rise` and `momentum`, the largest relative rise of the energy and change of the momentum in shots without
        acts of the contact-time rule; `contact_rule`, the number of shots with such acts; `most_events` and `events`,
        the largest and the total number of events; and `bad`, (seed, index, status) of each bad shot.
    """
    rng = np.random.default_rng([seed, list(FAMILIES).index(name)])
    drawn = FAMILIES[name](rng, shots)
    if drawn is None:
        return {"shots": 0, "bad": []}
    scene, places, velocities, spins = drawn
    result = check_shots(scene, places, velocities, spins)
    free = result.n_contact_rule == 0
    bad = np.flatnonzero(result.bad(scene.physics.motion == "ideal"))
    return {
        "shots": shots,
        "overlap": float(result.found[:, OVERLAP].max()),
        "outside": float(result.found[:, OUTSIDE].max()),
        "rise": float(result.found[free, RISE].max(initial=0.0)),
        "momentum": float(result.found[free, MOMENTUM].max(initial=0.0)),
        "contact_rule": int((~free).sum()),
        "most_events": int(result.n_events.max()),
        "events": int(result.n_events.sum()),
        "bad": [(seed, int(k), int(result.status[k])) for k in bad],
    }
