"""Impacts of one ball on a cushion, and banks, with each law of the cushions.

The cushion lies along x and the ball moves towards +y. Angles are measured from the cushion, in degrees. Speeds are in
m/s. The side spin R omega / v is positive counter-clockwise as seen from above.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from benchmarks import table
from benchmarks.validation.collisions import INSTANT, direction
from billiards_env.scene import Balls, Physics, Scene
from billiards_env.scene.table import POOL_LENGTH, POOL_RADIUS, POOL_WIDTH, Table
from billiards_env.shots.simulation import simulate, simulate_batch

Floats = NDArray[np.float64]

# Measurements and reference outputs

PAPER_RADIUS, PAPER_HEIGHT = 0.02625, 1.4
"""m, and the height of the cushion over the radius: Mathavan, Jackson and Parkin (2010)."""

PAPER = Physics(cushion="mathavan2010", mu_slide=0.212, mu_cushion=0.14, e_cushion=0.98)
"""The constants of Mathavan, Jackson and Parkin (2010)."""

FIGURE_7A = (
    *((0.263, 0.234), (0.355, 0.324), (0.418, 0.383), (0.651, 0.583), (0.704, 0.665), (0.845, 0.791), (1.154, 1.069)),
    *((1.299, 1.237), (1.526, 1.456), (1.755, 1.645), (1.991, 1.824), (2.276, 2.031), (2.530, 2.280), (2.701, 2.265)),
    *((2.893, 2.383), (2.985, 2.462), (3.106, 2.620), (3.185, 2.568), (3.405, 2.732)),
)
"""Speeds before and after the cushion of balls that roll at a right angle into it: Mathavan, Jackson and Parkin (2010),
figure 7a, read from the plot."""

PAPER_REBOUNDS = (
    # angle, side, roll; velocity after the impact along and away from the cushion, R omega after it
    (90, 0, 1, (0.0, -0.91112), (-0.2352, 0.0, 0.0)),
    (90, 1, 1, (0.23303, -0.93935), (-0.2324, 0.2330, 0.4661)),
    (60, 0, 1, (0.31324, -0.80870), (-0.2026, 0.3132, 0.4279)),
    (60, 1, 1, (0.56186, -0.79025), (-0.2071, 0.5619, 0.8583)),
    (60, -1, 1, (0.24751, -0.83102), (-0.2552, 0.2475, -0.4215)),
    (40, 0, 1, (0.58283, -0.61540), (-0.1798, 0.5828, 0.4198)),
    (40, 1, 1, (0.72149, -0.58657), (-0.1536, 0.7215, 1.1021)),
    (40, -1, 1, (0.56532, -0.62136), (-0.2315, 0.5653, -0.5401)),
    (20, 0, 1, (0.83100, -0.33154), (-0.1312, 0.8310, 0.2491)),
    (20, 1, 1, (0.85124, -0.32442), (-0.0824, 0.8512, 1.2027)),
    (20, -1, 1, (0.82827, -0.33304), (-0.1462, 0.8283, -0.7447)),
    (90, 0, 0, (0.0, -0.83736), (-0.0781, 0.0, 0.0)),
    (90, 0, 2, (0.0, -0.98001), (-0.9309, 0.0, 0.0)),
    (90, 0, -1, (0.0, -0.86586), (0.1527, 0.0, 0.0)),
)
"""Rebounds at 1 m/s by the equations of Mathavan, Jackson and Parkin (2010), integrated independently of this package:
angle, side and roll of the ball, its velocity and R omega after the impact."""

POOL_HEIGHT = 1.28
ROLLING_REBOUNDS = (
    (90, 0, (0.0, -0.80442)),
    (90, 1, (0.21312, -0.78452)),
    (60, 0, (0.34619, -0.68511)),
    (60, 1, (0.58532, -0.69327)),
    (60, -1, (0.24714, -0.65956)),
    (45, 0, (0.52951, -0.54821)),
    (30, 0, (0.71222, -0.37734)),
    (15, 0, (0.87713, -0.18912)),
)
"""Velocities of rolling pool balls after an impact at 1 m/s by the laws of Han and of Stronge, which agree here.
They are computed independently of this package: angle, side and velocity."""

STUN_REBOUNDS = (
    ((0.2, 1.0), (0, 0, 0), (0.14286, -0.72736), (0.12513, -0.73431)),
    ((0.5, 1.0), (0, 0, 0), (0.35714, -0.72736), (0.28725, -0.73832)),
    ((1.0, 1.0), (0, 0, 0), (0.71429, -0.72736), (0.65796, -0.73178)),
    ((1.0, 1.0), (0, 0, 30), (0.94942, -0.72736), (0.93502, -0.73373)),
    ((0.6, 0.8), (-8.399, 6.299, 0), (0.41417, -0.60109), (0.36867, -0.61018)),
)
"""Impacts of pool balls that do not roll, computed independently of this package: velocity, spin (rad/s), and the
velocities after it by the laws of Han and of Stronge."""

BANKS = ((2.2, 1.0), (3.3, 1.5), (4.4, 2.0))
"""The system "twice plus tenths" for banks at stun speed, TP B.27: the diamond from which a ball comes and the diamond
at which it meets the opposite cushion, both counted from the pocket to which it returns."""
DIAMOND = POOL_LENGTH / 8

# Impacts


def rebound(
    physics: Physics,
    velocities: ArrayLike,
    spins: ArrayLike,
    radius: float = POOL_RADIUS,
    height: float = POOL_HEIGHT,
) -> tuple[Floats, Floats]:
    """Returns velocities (m, 2), m/s, and spins (m, 3), rad/s, right after impacts on the cushion.

    Args:
        physics: The physics.
        velocities: (m, 2), m/s.
        spins: (m, 3), rad/s.
        radius: Radius of the ball, m.
        height: Height of the cushion's nose over the radius.
    """
    velocities = np.asarray(velocities, float)
    scene = Scene(Balls.uniform(1, radius), Table(4.0, 4.0, height * radius), physics)
    positions = np.zeros((len(velocities), 1, 2))
    positions[:, 0, 1] = 2.0 - radius
    batch = simulate_batch(scene, positions, velocities, spins=np.asarray(spins, float), max_time=INSTANT)
    return batch.velocities[:, 0], batch.spins[:, 0]


def incoming(
    angle: ArrayLike, side: ArrayLike, roll: ArrayLike, speed: ArrayLike = 1.0, radius: float = POOL_RADIUS
) -> tuple[Floats, Floats]:
    """Returns velocities (m, 2) and spins (m, 3) of balls that move at an angle to the cushion."""
    angle, side, roll, speed = (np.ravel(a) for a in np.broadcast_arrays(np.radians(angle), side, roll, speed))
    vx, vy = speed * np.where(angle == np.pi / 2, 0.0, np.cos(angle)), speed * np.sin(angle)
    return np.stack([vx, vy], -1), np.stack([-roll * vy, roll * vx, side * speed], -1) / radius


def bounce(physics: Physics, angle: ArrayLike, speed: ArrayLike = 1.0, side: ArrayLike = 0.0) -> tuple[Floats, Floats]:
    """Returns speeds and angles after impacts of rolling snooker balls on the cushion of the paper."""
    balls = incoming(angle, side, 1.0, speed, PAPER_RADIUS)
    velocities, _ = rebound(physics, *balls, PAPER_RADIUS, PAPER_HEIGHT)
    return np.hypot(*velocities.T), -direction(velocities)


def bank(physics: Physics, start: ArrayLike, aim: ArrayLike, speed: float) -> Floats:
    """Returns the diamonds at which banked balls return to the first cushion.

    The paths are those of the centres of balls without spin at the far cushion. A ball whose centre comes from the
    diamond `start` on the line of contacts meets the far cushion at the diamond `aim`.

    Args:
        physics: The physics.
        start: (m,) diamonds.
        aim: (m,) diamonds.
        speed: Speed at the far cushion, m/s.
    """
    start, aim = np.ravel(start), np.ravel(aim)
    scene = Scene(Balls.uniform(1), Table(4 * POOL_LENGTH, POOL_WIDTH), physics)
    reach = POOL_WIDTH / 2 - POOL_RADIUS
    way = np.stack([(aim - start) * DIAMOND, np.full(len(aim), 2 * reach)], -1)
    positions = np.stack([aim * DIAMOND, np.full(len(aim), reach)], -1)[:, None]
    velocities = speed * way / np.hypot(*way.T)[:, None]
    found = []
    for position, velocity in zip(positions, velocities, strict=True):
        shot = simulate(scene, position, velocity, record=True)
        assert shot.events is not None
        contacts = shot.events[shot.events["kind"] == "cushion"]
        found.append(contacts["x"][1] / DIAMOND if len(contacts) > 1 else np.nan)
    return np.array(found)


# Results

ANGLES = tuple(range(10, 91, 5))
BANK_SPEED = 3.0  # m/s
SPEEDS = (0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5)


def fit_line(physics: Physics) -> float:
    """Returns the slope of the line that fits the speeds after perpendicular impacts at 0.28 to 3.5 m/s."""
    speeds = np.linspace(0.28, 3.5, 50)
    after, _ = bounce(physics, 90.0, speeds)
    return float(np.polyfit(speeds, after, 1)[0])


def models() -> dict[str, Physics]:
    """Returns the physics of rolling snooker balls in figure 7a, by name."""
    return {
        "mathavan2010, e = 0.98": PAPER,
        "mathavan2010, e(v)": Scene.named("snooker").physics,
        "stronge, e = 0.85": Physics(cushion="stronge"),
    }


def figure_7a(physics: Physics) -> tuple[float, float]:
    """Returns the root mean square and the largest difference from `FIGURE_7A`, m/s."""
    before, measured = np.array(FIGURE_7A).T
    off = bounce(physics, 90.0, before)[0] - measured
    return float(np.sqrt(np.mean(off**2))), float(abs(off).max())


def reference_differences() -> dict[str, tuple[int, float]]:
    """Returns the numbers of reference impacts of each law and the largest differences of the velocities, m/s."""
    angle, side, roll = np.array([row[:3] for row in PAPER_REBOUNDS], float).T
    balls = incoming(angle, side, roll, radius=PAPER_RADIUS)
    velocities, _ = rebound(PAPER, *balls, PAPER_RADIUS, PAPER_HEIGHT)
    found = {"mathavan2010": (len(angle), float(abs(velocities - [row[3] for row in PAPER_REBOUNDS]).max()))}
    angle, side = np.array([row[:2] for row in ROLLING_REBOUNDS], float).T
    for k, law in enumerate(("han2005", "stronge")):
        rolling, _ = rebound(Physics(cushion=law), *incoming(angle, side, 1.0))
        stun, _ = rebound(Physics(cushion=law), [row[0] for row in STUN_REBOUNDS], [row[1] for row in STUN_REBOUNDS])
        off = (
            abs(rolling - [row[2] for row in ROLLING_REBOUNDS]).max(),
            abs(stun - [row[2 + k] for row in STUN_REBOUNDS]).max(),
        )
        found[law] = (len(angle) + len(STUN_REBOUNDS), float(max(off)))
    return found


def bank_laws() -> dict[str, Physics]:
    """Returns the physics of the banks: the default constants of each law."""
    laws = {law: Physics(cushion=law) for law in ("restitution", "han2005", "stronge")}
    return {**laws, "mathavan2010, snooker": Scene.named("snooker").physics}


def measure() -> dict[str, Any]:
    """Runs all impacts and banks."""
    _, angles = bounce(PAPER, 60.0, np.array(SPEEDS))
    losses = bounce(PAPER, np.arange(10.0, 91.0))[0]
    top = rebound(PAPER, *incoming([90.0], 0.0, 2.0, 1.0, PAPER_RADIUS), PAPER_RADIUS, PAPER_HEIGHT)[0][0]
    side = rebound(PAPER, *incoming([88.0], [1.0], 1.0, 1.0, PAPER_RADIUS), PAPER_RADIUS, PAPER_HEIGHT)[0][0]
    start, aim = np.array(BANKS).T
    return {
        "references": reference_differences(),
        "figure_7a": {name: figure_7a(physics) for name, physics in models().items()},
        "slope": {name: fit_line(physics) for name, physics in models().items()},
        "low_speed": float(bounce(PAPER, [90.0], 0.3)[0][0]) / 0.3,
        "angle_spread": float(np.ptp(angles)),
        "slowest_angle": int(np.arange(10, 91)[losses.argmin()]),
        "top_spin": float(-top[1]),
        "side_spin": float(side[0]),
        "banks": {name: bank(physics, start, aim, BANK_SPEED).tolist() for name, physics in bank_laws().items()},
    }


def blocks(result: dict[str, Any]) -> dict[str, str]:
    """Returns the results as Markdown, by name."""
    references = [[f"`{law}`", f"{n}", f"{off:.1e} m/s"] for law, (n, off) in result["references"].items()]
    fits = [
        [name, f"{rms:.3f}", f"{most:.3f}", f"{result['slope'][name]:.3f}"]
        for name, (rms, most) in result["figure_7a"].items()
    ]
    statements = [
        ["a rolling ball at 90° keeps 0.91 of a low speed", f"{result['low_speed']:.3f}"],
        [
            "the rebound angle of a rolling ball does not depend on the speed",
            f"changes by {result['angle_spread']:.0e}° from 0.5 to 3.5 m/s",
        ],
        ["the relative loss of speed is largest near 40°", f"at {result['slowest_angle']}°"],
        [
            "a ball with twice the spin of rolling returns from 90° with about its speed",
            f"{result['top_spin']:.3f} of it",
        ],
        [
            "with side spin near 90°, the ball goes to the side of the spin",
            f"{result['side_spin']:+.2f} m/s along the cushion at 1 m/s",
        ],
    ]
    banks = [
        [name, *(f"{off:+.2f}" for off in found)]
        for name, found in (("measured (the system)", [0.0] * len(BANKS)), *result["banks"].items())
    ]
    return {
        "references": table(["law", "impacts", "largest difference"], references),
        "figure 7a": table(["law", "rms difference, m/s", "largest, m/s", "slope of a line, 0.28 to 3.5 m/s"], fits),
        "statements": table(["Mathavan, Jackson and Parkin (2010)", "`mathavan2010`, e = 0.98"], statements, left=2),
        "banks": table(["law", *(f"{start} to {aim}" for start, aim in BANKS)], banks),
    }
