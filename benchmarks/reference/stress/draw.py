"""Random scenes and shots: balls in contact and apart, normal and extreme speeds."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.reference.stress.checks import beyond_outline
from billiards_env.engine.compile import scene_arrays
from billiards_env.jit import entry_point, streams
from billiards_env.jit.streams import next_double
from billiards_env.physics.geometry.pockets import distance_from
from billiards_env.physics.geometry.walls import TIP_RADIUS, TIP_X, TIP_Y
from billiards_env.physics.state import X, Y
from billiards_env.scene import Balls, Physics, Scene
from billiards_env.scene.outline import Corner
from billiards_env.scene.scene import BALL_BALL_NAMES
from billiards_env.scene.table import Pocket, Table

_TRIES = 1000
_FROZEN = 5e-13  # m; the largest overlap of frozen balls, which is due to rounding


@entry_point
def _scatter(stream, order, frozen, scene, outline, out):
    """Fills `out` (m, n, 2) with m layouts: one ball after another in `order`, in contact with probability `frozen`.

    With an outline, balls may be in the mouths of the pockets and in contact with tips.

    Returns the number of layouts; it is less than m if there is no room for a ball.
    """
    radius, pockets = scene.radius, scene.pockets
    for shot in range(len(out)):
        for placed in range(len(order)):
            i = order[placed]
            room_x, room_y = scene.numbers.half_length - radius[i], scene.numbers.half_width - radius[i]
            for attempt in range(_TRIES + 1):
                if attempt == _TRIES:
                    return shot
                x, y = room_x * (2.0 * next_double(stream) - 1.0), room_y * (2.0 * next_double(stream) - 1.0)
                if outline is not None:
                    place = outline.ends[int(next_double(stream) * len(outline.ends))]
                    if next_double(stream) < 0.5:  # near an end of a straight cushion
                        x = place[X] + 3.0 * radius[i] * (2.0 * next_double(stream) - 1.0)
                        y = place[Y] + 3.0 * radius[i] * (2.0 * next_double(stream) - 1.0)
                if next_double(stream) < frozen:
                    kind = next_double(stream)
                    if kind < 0.6 and placed > 0:
                        j = order[int(next_double(stream) * placed)]
                        angle = 2.0 * math.pi * next_double(stream)
                        ex, ey = math.cos(angle), math.sin(angle)
                        if kind < 0.2:
                            ex, ey = (1.0, 0.0) if kind < 0.1 else (0.0, -1.0)
                        reach = scene.space.contact_distance(i, j, scene)
                        x, y = out[shot, j, X] + reach * ex, out[shot, j, Y] + reach * ey
                    if kind > 0.5 and kind < 0.9:
                        x = math.copysign(room_x, x)
                    if kind > 0.75:
                        y = math.copysign(room_y, y)
                    if outline is not None and kind > 0.9 and len(outline.tips) > 0:
                        tip = outline.tips[int(next_double(stream) * len(outline.tips))]
                        angle, reach = 2.0 * math.pi * next_double(stream), radius[i] + tip[TIP_RADIUS]
                        x, y = tip[TIP_X] + reach * math.cos(angle), tip[TIP_Y] + reach * math.sin(angle)
                if outline is None:
                    good = abs(x) <= room_x + _FROZEN and abs(y) <= room_y + _FROZEN
                else:
                    good = beyond_outline(x, y, radius[i], outline) <= _FROZEN
                for before in range(placed):
                    j = order[before]
                    reach = scene.space.contact_distance(i, j, scene) - _FROZEN
                    dx, dy = x - out[shot, j, X], y - out[shot, j, Y]
                    good = good and math.sqrt(dx * dx + dy * dy) >= reach
                for k in range(len(pockets)):
                    good = good and distance_from(pockets[k], x, y) >= 1e-12
                if good:
                    out[shot, i, X], out[shot, i, Y] = x, y
                    break
    return len(out)


def layouts(scene: Scene, rng: np.random.Generator, m: int, frozen: float = 0.0) -> NDArray[np.float64] | None:
    """Returns m random layouts, (m, n, 2) m; None if there is no room for a ball.

    Each ball is in contact with probability `frozen`.
    """
    order = np.argsort(-np.array(scene.balls.radius), kind="stable")
    out = np.zeros((m, scene.n_balls, 2))
    arrays, stream = scene_arrays(scene), streams.read(rng)
    drawn = _scatter(stream, order, frozen, arrays, arrays.outline if scene.table.outline else None, out)
    streams.write(rng, stream)
    return out if drawn == m else None


def cue_shots(scene: Scene, rng: np.random.Generator, m: int) -> tuple[NDArray[np.float64], NDArray[np.float64] | None]:
    """Returns velocities (m, 2) of cue balls in all directions, and spins (m, 3) if the balls of the scene spin."""
    speed, angle = rng.uniform(0.05, 12.0, m), rng.uniform(0, 2 * np.pi, m)
    velocities = speed[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    spins = None
    if scene.physics.motion == "sliding":
        spins = rng.uniform(-1.5, 1.5, (m, 3)) * (speed / scene.balls.radius[0])[:, None]
    return velocities, spins


def wild_scene(rng: np.random.Generator) -> Scene:
    """Returns a random scene: 1 to 12 balls, radii up to 1:50, any masses, laws and restitutions, pockets or none."""
    n = int(rng.choice([1, 2, 3, 4, 6, 9, 12]))
    motion = str(rng.choice(["ideal", "rolling", "sliding"], p=[0.2, 0.2, 0.6]))
    han = motion == "sliding" and rng.random() < 0.6
    if rng.random() < 0.5:
        radius = np.full(n, 0.03)
    else:
        radius = 0.1 * 50.0 ** -rng.random(n)
        if rng.random() < 0.5:
            radius[rng.integers(n)] = 0.002
            radius[rng.integers(n)] = 0.1
    kind = rng.random()
    mass = np.full(n, 0.17) if kind < 0.4 else 10.0 ** rng.uniform(-3, 3, n) if kind < 0.8 else (radius / 0.03) ** 3
    mass = np.where((rng.random(n) < 0.15) & (np.arange(n) > 0), np.inf, mass)
    length, width = (float(rng.choice([0.3, 0.7, 1.27, 2.54])) for _ in range(2))
    height = float(rng.uniform(0.05, 1.95) * radius.min())
    pockets = ()
    if rng.random() < 0.4:
        corners = [(sx * length / 2, sy * width / 2) for sx in (-1, 1) for sy in (-1, 1)]
        chosen = rng.random(4) < 0.5
        pockets = tuple(
            Pocket(x, y, float(rng.uniform(0.01, 0.12))) for (x, y), p in zip(corners, chosen, strict=True) if p
        )

    def restitution() -> float:
        return float(rng.choice([0.0, 1.0, rng.random(), rng.uniform(0.8, 1.0)]))

    laws = [name for name, rubs in BALL_BALL_NAMES.items() if motion == "sliding" or not rubs]
    physics = Physics(
        motion=motion,
        cushion="han2005" if han else "restitution",
        ball_ball=str(rng.spawn(1)[0].choice(laws)),  # the other numbers do not depend on the number of laws
        mu_slide=float(10.0 ** rng.uniform(-1, 0)),
        mu_roll=float(10.0 ** rng.uniform(-2, -1)),
        spin_decay=float(10.0 ** rng.uniform(0, 2)),
        e_ball=restitution(),
        e_cushion=restitution(),
        mu_cushion=float(rng.choice([0.0, rng.random()])),
        max_time=3.0 if motion == "ideal" else None,
    )
    table = Table(length, width, height, pockets)
    return Scene(Balls(tuple(radius.tolist()), tuple(mass.tolist())), table, physics)


def wild_shots(
    scene: Scene, rng: np.random.Generator, m: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64] | None] | None:
    """Returns m shots with frozen balls and speeds of 1e-300 to 100 m/s; None if there is no room for a ball.

    Returns:
        Positions (m, n, 2), velocities (m, n, 2) and spins (m, n, 3), which are None if the balls do not spin.
    """
    places = layouts(scene, rng, m, float(rng.choice([0.0, 0.5, 0.9])))
    if places is None:
        return None
    n = scene.n_balls
    fastest = 2.0 if n <= 4 else 1.0  # faster clusters have a million events
    extremes = rng.choice([-300.0, -100.0, -9.0, -4.0, fastest], m, p=[0.2, 0.2, 0.25, 0.3, 0.05])
    exponent = np.where(rng.random(m) < 0.7, rng.uniform(-2, 1, m), extremes)
    speed = (10.0**exponent)[:, None] * np.where(rng.random((m, n)) < 0.7, 1.0, rng.random((m, n)))
    moving = (rng.random((m, n)) < 0.4) | (np.arange(n) == 0)
    speed *= moving & np.isfinite(scene.balls.mass)
    quarter = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])
    angle = rng.uniform(0, 2 * np.pi, (m, n))
    direction = np.where(
        rng.random((m, n, 1)) < 0.3,
        quarter[rng.integers(4, size=(m, n))],
        np.stack([np.cos(angle), np.sin(angle)], axis=-1),
    )
    velocities = speed[..., None] * direction
    spins = None
    if scene.physics.motion == "sliding":
        spins = rng.normal(size=(m, n, 3)) * (speed / np.array(scene.balls.radius))[..., None]
        factor = np.where(speed.max(axis=1) > 20, 0.1, rng.choice([0.0, 0.3, 1.0, 3.0], m))
        spins *= factor[:, None, None]
    return places, velocities, spins


def outline_table(corners: Sequence[Sequence[float]], **fields: Any) -> Table:
    """Returns a table whose outline has the corners (x, y) or (x, y, radius), m. The origin becomes its centre."""
    low, high = np.min([c[:2] for c in corners], axis=0), np.max([c[:2] for c in corners], axis=0)
    middle = 0.5 * (low + high)
    outline = tuple(Corner(x - middle[0], y - middle[1], *radius) for x, y, *radius in corners)
    return Table(float(high[0] - low[0]), float(high[1] - low[1]), outline=outline, **fields)


def star(seed: int, **fields: Any) -> Table:
    """Returns a table about 2 m across with a random outline of 4 to 11 corners, some of them rounded."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(4, 12))
    angles = 2 * math.pi * (np.arange(n) + rng.uniform(0.1, 0.9, n)) / n
    places = rng.uniform(0.5, 1.5, n)[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    share = float(rng.choice([0.0, 0.2, 0.49]))
    while True:
        corners = []
        for place, before, after in zip(places, np.roll(places, 1, 0), np.roll(places, -1, 0), strict=True):
            into, out = place - before, after - place
            turn = math.atan2(into[0] * out[1] - into[1] * out[0], into @ out)
            reach = share * min(np.hypot(*into), np.hypot(*out))
            corners.append((*place.tolist(), float(reach / math.tan(-turn / 2)) if turn < -0.01 else 0.0))
        try:
            return outline_table(corners, **fields)
        except ValueError:  # the circle of a tip reaches another cushion
            if share == 0.0:
                raise
            share = 0.5 * share if share > 1e-3 else 0.0
