"""Impacts of one ball on a cushion, and banks, with each law of the cushions.

The cushion lies along x and the ball moves towards +y. Angles are measured from the cushion, in degrees. Speeds are in
m/s. The side spin R omega / v is positive counter-clockwise as seen from above.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from benchmarks import table
from benchmarks.validation.collisions import INSTANT, direction
from billiards_env.scene import Balls, Physics, Scene
from billiards_env.scene.outline import Corner
from billiards_env.scene.table import POOL_LENGTH, POOL_RADIUS, POOL_WIDTH, Table
from billiards_env.shots.simulation import simulate, simulate_batch

Floats = NDArray[np.float64]

# Measurements and reference outputs

PAPER_RADIUS = 0.02625
"""m: Mathavan, Jackson and Parkin (2010). The table "snooker_12ft" has the height of their cushion."""

PAPER = Physics(ball_ball="frictional", cushion="mathavan2010", mu_slide=0.212, mu_cushion=0.14, e_cushion=0.98)
"""The constants of Mathavan, Jackson and Parkin (2010)."""

FIGURE_7A = (
    *((0.263, 0.234), (0.355, 0.324), (0.418, 0.383), (0.651, 0.583), (0.704, 0.665), (0.845, 0.791), (1.154, 1.069)),
    *((1.299, 1.237), (1.526, 1.456), (1.755, 1.645), (1.991, 1.824), (2.276, 2.031), (2.530, 2.280), (2.701, 2.265)),
    *((2.893, 2.383), (2.985, 2.462), (3.106, 2.620), (3.185, 2.568), (3.405, 2.732)),
)
"""Speeds before and after the cushion of balls that roll at a right angle into it: Mathavan, Jackson and Parkin (2010),
figure 7a, read from the plot."""


BANKS = ((2.2, 1.0), (3.3, 1.5), (4.4, 2.0))
"""The system "twice plus tenths" for banks at stun speed, TP B.27: the diamond from which a ball comes and the diamond
at which it meets the opposite cushion, both counted from the pocket to which it returns."""
DIAMOND = POOL_LENGTH / 8

MODELS = {
    "mathavan2010, e = 0.98": PAPER,
    "mathavan2010, e(v)": Scene.named("snooker").physics,
    "stronge, e = 0.85": Scene.named("real_pool").physics,
}
"""The physics of rolling snooker balls in figure 7a, by name."""

BANK_LAWS = {
    **{law: Physics(cushion=law) for law in ("restitution", "han2005")},
    "stronge": Scene.named("real_pool").physics,
    "mathavan2010, snooker": Scene.named("snooker").physics,
}
"""The physics of the banks: the default constants of each law."""

# Impacts

# Two more balls are out of play, so these scenes need only the engines of "carom", "real_carom", "real_pool" and
# "snooker".
IN_PLAY = (True, False, False)


def rebounds(physics: Physics, angle: ArrayLike, speed: ArrayLike = 1.0) -> tuple[Floats, Floats]:
    """Returns speeds and angles (m,) after impacts of rolling snooker balls on the cushion of the paper."""
    angle, speed = (np.ravel(a) for a in np.broadcast_arrays(np.radians(angle), speed))
    vx, vy = speed * np.where(angle == np.pi / 2, 0.0, np.cos(angle)), speed * np.sin(angle)
    spins = np.stack([-vy, vx, np.zeros_like(vx)], -1) / PAPER_RADIUS
    board = Table.named("snooker_12ft")
    scene = Scene(Balls.uniform(len(IN_PLAY), PAPER_RADIUS), board, physics)
    positions = np.zeros((len(speed), len(IN_PLAY), 2))
    positions[:, 0] = board.length / 4, board.width / 2 - PAPER_RADIUS
    batch = simulate_batch(scene, positions, np.stack([vx, vy], -1), spins=spins, in_play=IN_PLAY, max_time=INSTANT)
    velocities = batch.velocities[:, 0]
    return np.hypot(*velocities.T), -direction(velocities)


def long_table(physics: Physics) -> Table:
    """Returns a table on which no banked ball reaches an end. With the law of "snooker" it has an outline as well."""
    rectangle = Table(4 * POOL_LENGTH, POOL_WIDTH)
    if physics.cushion != "mathavan2010":
        return rectangle
    x, y = rectangle.length / 2, rectangle.width / 2
    corners = Corner(-x, -y), Corner(x, -y), Corner(x, y), Corner(-x, y)
    return dataclasses.replace(rectangle, outline=corners)


def bank(physics: Physics, start: ArrayLike, aim: ArrayLike, speed: float) -> Floats:
    """Returns the diamonds at which banked balls return to the first cushion.

    The paths are the paths of the centres of balls without spin at the far cushion. A ball whose centre comes from the
    diamond `start` (m,) on the line of contacts meets the far cushion at the diamond `aim` (m,), at `speed`, m/s.
    """
    start, aim = np.ravel(start), np.ravel(aim)
    scene = Scene(Balls.uniform(len(IN_PLAY)), long_table(physics), physics)
    reach = POOL_WIDTH / 2 - POOL_RADIUS
    way = np.stack([(aim - start) * DIAMOND, np.full(len(aim), 2 * reach)], -1)
    positions = np.zeros((len(aim), len(IN_PLAY), 2))
    positions[:, 0, 0], positions[:, 0, 1] = aim * DIAMOND, reach
    velocities = speed * way / np.hypot(*way.T)[:, None]
    places = []
    for position, velocity in zip(positions, velocities, strict=True):
        shot = simulate(scene, position, velocity, in_play=IN_PLAY, record=True)
        assert shot.events is not None
        contacts = shot.events[shot.events["kind"] == "cushion"]
        places.append(contacts["x"][1] / DIAMOND if len(contacts) > 1 else np.nan)
    return np.array(places)


# Results

BANK_SPEED = 3.0  # m/s
SPEEDS = (0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5)


def fit_line(physics: Physics) -> float:
    """Returns the slope of the line that fits the speeds after perpendicular impacts at 0.28 to 3.5 m/s."""
    speeds = np.linspace(0.28, 3.5, 50)
    after, _ = rebounds(physics, 90.0, speeds)
    return float(np.polyfit(speeds, after, 1)[0])


def figure_7a(physics: Physics) -> tuple[float, float]:
    """Returns the root mean square and the largest difference from `FIGURE_7A`, m/s."""
    before, measured = np.array(FIGURE_7A).T
    off = rebounds(physics, 90.0, before)[0] - measured
    return float(np.sqrt(np.mean(off**2))), float(abs(off).max())


def measure() -> dict[str, Any]:
    """Runs all impacts and banks."""
    start, aim = np.array(BANKS).T
    return {
        "figure_7a": {name: figure_7a(physics) for name, physics in MODELS.items()},
        "slope": {name: fit_line(physics) for name, physics in MODELS.items()},
        "banks": {name: bank(physics, start, aim, BANK_SPEED).tolist() for name, physics in BANK_LAWS.items()},
    }


def blocks(result: dict[str, Any]) -> dict[str, str]:
    """Returns the results as Markdown, by name."""
    fits = [
        [name, f"{rms:.3f}", f"{most:.3f}", f"{result['slope'][name]:.3f}"]
        for name, (rms, most) in result["figure_7a"].items()
    ]
    banks = [
        [name, *(f"{off:+.2f}" for off in misses)]
        for name, misses in (("measured (the system)", [0.0] * len(BANKS)), *result["banks"].items())
    ]
    return {
        "figure 7a": table(["law", "rms difference, m/s", "largest, m/s", "slope of a line, 0.28 to 3.5 m/s"], fits),
        "banks": table(["law", *(f"{start} to {aim}" for start, aim in BANKS)], banks),
    }
