"""Families of random shots for the stress test: each has a scene, a layout and a distribution of strokes."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.reference.stress import draw
from benchmarks.reference.stress.checks import MOMENTUM, OUTSIDE, OVERLAP, RISE, check_shots
from benchmarks.reference.stress.scenes import ideal
from billiards_env.scene import Balls, Physics, Scene, layouts
from billiards_env.scene.table import Table, six_pockets

Floats = NDArray[np.float64]
RandomShots = tuple[Scene, Floats, Floats, Floats | None]


def _scattered(scene: Scene) -> Callable[[np.random.Generator, int], RandomShots | None]:
    def shots(rng: np.random.Generator, m: int) -> RandomShots | None:
        places = draw.layouts(scene, rng, m)
        return None if places is None else (scene, places, *draw.cue_shots(scene, rng, m))

    return shots


def _break(layout: str, balls: int) -> Callable[[np.random.Generator, int], RandomShots]:
    scene = Scene.named("pool", balls)

    def shots(rng: np.random.Generator, m: int) -> RandomShots:
        places = np.array([layouts.draw(layout, scene, rng) for _ in range(m)])
        aim = places[:, 1] - places[:, 0]
        aim[:, 1] += rng.uniform(-0.02, 0.02, m)
        velocities = aim * (rng.uniform(4, 12, m) / np.hypot(*aim.T))[:, None]
        return scene, places, velocities, rng.uniform(-1, 1, (m, 3)) * 100

    return shots


def _gas(n: int) -> Callable[[np.random.Generator, int], RandomShots | None]:
    scene = ideal(*(0.17,) * n, radius=(0.03,) * n, length=1.0, width=1.0, max_time=1.0)

    def shots(rng: np.random.Generator, m: int) -> RandomShots | None:
        places = draw.layouts(scene, rng, m)
        return None if places is None else (scene, places, rng.normal(size=(m, n, 2)), None)

    return shots


def _flying(scene: Scene) -> Scene:
    """Returns a scene with a small table, in which balls fly and hit each other with friction."""
    table = Table(1.0, 0.5, scene.table.cushion_height, six_pockets(1.0, 0.5))
    physics = dataclasses.replace(scene.physics, flight=True, ball_ball="frictional", cushion="stronge")
    return dataclasses.replace(scene, table=table, physics=physics)


def _jumps(scene: Scene) -> Callable[[np.random.Generator, int], RandomShots | None]:
    """Returns shots of cues that are raised by up to 70 degrees."""
    plain = _scattered(scene)

    def shots(rng: np.random.Generator, m: int) -> RandomShots | None:
        if (drawn := plain(rng, m)) is None:
            return None
        _, places, velocities, spins = drawn
        elevation = np.radians(rng.uniform(0.0, 70.0, m))[:, None]
        down = -np.sin(elevation) * np.hypot(*velocities.T)[:, None]
        return scene, places, np.hstack((np.cos(elevation) * velocities, down)), spins

    return shots


def rain(scene: Scene) -> Callable[[np.random.Generator, int], RandomShots | None]:
    """Returns shots in which half of the balls are in the air at the start, and all move and spin."""
    disks = dataclasses.replace(scene.balls, shape="disk")  # so the balls do not overlap at any heights
    plan = dataclasses.replace(scene, balls=disks, physics=dataclasses.replace(scene.physics, flight=False))

    def shots(rng: np.random.Generator, m: int) -> RandomShots | None:
        if (places := draw.layouts(plan, rng, m)) is None:
            return None
        heights = rng.uniform(-0.2, 0.2, (m, scene.n_balls)).clip(0.0)[..., None]
        heights[heights > 0.0] += 0.03  # above the noses
        velocities = rng.normal(size=(m, scene.n_balls, 3))
        return scene, np.concatenate((places, heights), axis=2), velocities, 40 * rng.normal(size=velocities.shape)

    return shots


SIZES = Balls((0.024, 0.03, 0.022, 0.04, 0.025, 0.035), (0.09, 0.17, 0.3, 0.35, 0.02, 0.1), shape="sphere")
"""Six spheres of different sizes and masses."""


def _rain_on_outline(rng: np.random.Generator, m: int) -> RandomShots | None:
    """Returns shots of `rain` on a table with jaws that end in or in front of the pockets, or without pockets."""
    table = Table.named(str(rng.choice(["pool_7ft", "uk_7ft"])))
    if rng.random() < 0.2:
        table = dataclasses.replace(table, pockets=())
    scene = Scene.named("real_pool", 5)
    physics = dataclasses.replace(scene.physics, flight=True)
    return rain(dataclasses.replace(scene, table=table, physics=physics))(rng, m)


def _closed_box(n_balls: int) -> Scene:
    """Returns the scene of `_flying` without pockets."""
    return _closed(_flying(Scene.named("pool", n_balls - 1)))


def _blows(rng: np.random.Generator, m: int, n: int) -> tuple[Floats, Floats]:
    """Returns velocities and spins of n balls, many of them zero. Balls move up more often than down."""
    velocities = rng.normal(0.4, 1.0, (m, n, 3)) * rng.choice([0.0, 0.0, 1e-3, 1.0, 3.0], (m, n, 1))
    velocities[..., :2] *= rng.choice([0.0, 1.0], (m, n, 1))
    return velocities, rng.normal(0, 40, (m, n, 3)) * rng.choice([0.0, 1.0], (m, n, 1))


def _stacks(tilts: tuple[float, float] | None) -> Callable[[np.random.Generator, int], RandomShots]:
    """Returns shots at four balls that touch, of which three or four are above one another.

    `tilts` are the least and the largest angle, rad, between a line of centres and the vertical; None for no angle.
    """
    scene = _closed_box(4)
    reach = 2.0 * scene.balls.radius[0]

    def shots(rng: np.random.Generator, m: int) -> RandomShots:
        places = np.empty((m, 4, 3))
        for k, balls in enumerate(rng.permuted(np.tile(np.arange(4), (m, 1)), axis=1)):
            place = rng.uniform(-0.1, 0.1, 3) * rng.choice([0.0, 1.0], 3)
            place[2] = rng.choice([0.0, 0.0, 0.05, 1e-9])
            for ball in balls:
                places[k, ball] = place
                turn, tilt = rng.uniform(0, 2 * np.pi), 0.0 if tilts is None else np.exp(rng.uniform(*np.log(tilts)))
                step = reach * np.array([np.cos(turn) * np.sin(tilt), np.sin(turn) * np.sin(tilt), np.cos(tilt)])
                place = place + step + [0.0, 0.0, rng.choice([0.0, 0.0, 0.01])]
            if rng.random() < 0.5:  # the top ball is on the cloth instead
                turn = rng.uniform(0, 2 * np.pi)
                places[k, balls[3]] = [*(places[k, balls[0], :2] + reach * np.array([np.cos(turn), np.sin(turn)])), 0.0]
        return scene, places, *_blows(rng, m, 4)

    return shots


def _wedges(rng: np.random.Generator, m: int) -> RandomShots:
    """Returns shots at four balls, of which one touches the nose of a cushion and a ball on the cloth.

    The third ball is above the first one. The fourth touches the ball on the cloth, which may touch the cushion.
    """
    scene = _closed_box(4)
    radius, height = scene.balls.radius[0], scene.table.cushion_height - scene.balls.radius[0]
    frozen = 0.5 * scene.table.width - radius
    nose, places = frozen + np.sqrt(radius**2 - height**2), np.empty((m, 4, 3))
    for k, (high, top, low, other) in enumerate(rng.permuted(np.tile(np.arange(4), (m, 1)), axis=1)):
        angle, x, side = rng.uniform(0.0, 1.5), rng.choice([0.0, 0.1]), rng.choice([-1, 1])
        y, z = nose - radius * np.cos(angle), height + radius * np.sin(angle)
        across = np.sqrt(4 * radius**2 - z**2)
        least = np.arccos(min((frozen - y) / across, 1.0))  # the ball on the cloth touches the cushion or is below it
        turn = rng.choice([least, rng.uniform(least, np.pi), np.pi])
        lower = np.array([x + across * np.sin(turn), min(y + across * np.cos(turn), frozen)])
        places[k, high] = x, y, z + rng.choice([0.0, 0.0, 0.01])
        places[k, top] = places[k, high] + [0.0, 0.0, 2 * radius]
        places[k, low] = *lower, 0.0
        places[k, other] = lower[0] + 2 * radius, lower[1], 0.0
        places[k, :, 1] *= side
    return scene, places, *_blows(rng, m, 4)


def _wild(rng: np.random.Generator, m: int) -> RandomShots | None:
    scene = draw.wild_scene(rng)
    shots = draw.wild_shots(scene, rng, m)
    return None if shots is None else (scene, *shots)


def _wild_outline(rng: np.random.Generator, m: int) -> RandomShots | None:
    """Returns wild shots on a table with a random outline, or with the jaws of real pockets, some without holes."""
    scene = draw.wild_scene(rng)
    radius = tuple(min(r, 0.035) for r in scene.balls.radius)
    if rng.random() < 0.5:
        table = draw.star(int(rng.integers(2**32)))
    else:
        table = Table.named(str(rng.choice(["pool_7ft", "pool_9ft", "snooker_12ft", "uk_7ft"])))
        if rng.random() < 0.5:
            table = dataclasses.replace(table, pockets=())
    table = dataclasses.replace(table, cushion_height=float(rng.uniform(0.05, 1.95) * min(radius)))
    try:
        scene = dataclasses.replace(scene, balls=Balls(radius, scene.balls.mass), table=table)
    except ValueError:  # no room for a ball
        return None
    shots = draw.wild_shots(scene, rng, m)
    return None if shots is None else (scene, *shots)


def _rolling(scene: Scene) -> Scene:
    return dataclasses.replace(scene, physics=Physics(motion="rolling", cushion="restitution"))


def _with_balls(scene: Scene, n: int) -> Scene:
    """Returns a scene with its first n balls."""
    return dataclasses.replace(
        scene, balls=dataclasses.replace(scene.balls, radius=scene.balls.radius[:n], mass=scene.balls.mass[:n])
    )


def _closed(scene: Scene) -> Scene:
    """Returns a scene without pockets; balls rattle in the jaws."""
    return dataclasses.replace(scene, table=dataclasses.replace(scene.table, pockets=()))


FAMILIES: dict[str, Callable[[np.random.Generator, int], RandomShots | None]] = {
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
    "real pool, cue ball alone": _scattered(Scene.named("real_pool", 0)),
    "real pool, 1 object ball": _scattered(Scene.named("real_pool", 1)),
    "real pool, 5 object balls": _scattered(Scene.named("real_pool", 5)),
    "7-foot pool, 1 object ball": _scattered(Scene.named("pooltool_pool", 1)),
    "snooker, 5 object balls": _scattered(_with_balls(Scene.named("snooker"), 6)),
    "UK pool, 5 object balls": _scattered(_with_balls(Scene.named("uk_pool"), 6)),
    "jaws without holes, 2 object balls": _scattered(_closed(Scene.named("pooltool_pool", 2))),
    "wild outlines": _wild_outline,
    "jump shots, 3 object balls": _jumps(_flying(Scene.named("pool", 3))),
    "rain of 6 balls": rain(_flying(Scene.named("pool", 5))),
    "rain of 6 balls with jaws": _rain_on_outline,
    "stacks, exact": _stacks(None),
    "stacks, leaning": _stacks((1e-17, 0.2)),
    "wedges at a nose": _wedges,
    "rain of 6 balls of several sizes": rain(_flying(dataclasses.replace(Scene.named("pool", 5), balls=SIZES))),
}


def check_family(name: str, seed: int, shots: int) -> dict[str, Any]:
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
    free = result.shots.n_contact_rule == 0
    bad = np.flatnonzero(result.bad(scene.physics.motion == "ideal"))
    return {
        "shots": shots,
        "overlap": float(result.findings[:, OVERLAP].max()),
        "outside": float(result.findings[:, OUTSIDE].max()),
        "rise": float(result.findings[free, RISE].max(initial=0.0)),
        "momentum": float(result.findings[free, MOMENTUM].max(initial=0.0)),
        "contact_rule": int((~free).sum()),
        "most_events": int(result.shots.n_events.max()),
        "events": int(result.shots.n_events.sum()),
        "bad": [(seed, int(k), int(result.shots.status[k])) for k in bad],
    }
