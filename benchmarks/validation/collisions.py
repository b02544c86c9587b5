"""Impacts of two balls: throw, frozen balls, and the paths of the balls after a cut.

The cue ball moves along +x. The line of centres is at the cut angle from it, counter-clockwise. Speeds are in m/s and
angles in degrees. Spins are given as R omega / v: `side` is positive counter-clockwise as seen from above, which is
outside english for these cuts, and `roll` is 1 for a rolling ball.
"""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from benchmarks import table
from billiards_env.engine.strikes import strike
from billiards_env.scene import Balls, Physics, Scene
from billiards_env.scene.table import POOL_RADIUS, Table
from billiards_env.shots.simulation import simulate_batch

Floats = NDArray[np.float64]

INSTANT = 1e-9  # s; the least duration of a shot, far too short for the cloth to act

SPEEDS = {"slow": 0.447, "medium": 1.341, "fast": 3.129}
"""m/s: 1, 3 and 7 miles per hour, the speeds of TP A.14."""

# No ball reaches a cushion. With this table and these cushions the scenes need only the engines of "real_pool".
TABLE = Table.named("pool_9ft")
FRICTIONAL = Physics(ball_ball="frictional", cushion="stronge")
ELASTIC = dataclasses.replace(FRICTIONAL, e_ball=1.0)

# Measurements

THROW_POINTS = (
    (10.0, 1.5, "slow", 0.0),
    (10.0, 1.5, "medium", 0.0),
    (30.0, 4.1, "medium", 0.0),
    (30.0, 0.9, "medium", 1.0),
)
"""Measured throw, Alciatore, "Throw", parts I to XII: cut angle, throw, speed and roll of the cue ball."""

FROZEN = ((0, 0), (8, 13), (20, 34), (34, 50), (46, 61), (57, 70), (67, 78), (77, 87), (90, 90))
"""A cue ball frozen to an object ball: direction of the stroke and measured direction of the cue ball, both from the
line of centres, with an uncertainty of 3 degrees: Alciatore, TP A.15."""

FROZEN_PAIR = {"slow": 7.0, "fast": 3.0}
"""Measured throw of an object ball frozen to another one that is hit at 45 degrees: Alciatore, articles "Throw"."""


class SnookerShot(NamedTuple):
    """A shot of Mathavan, Jackson and Parkin (2014): a rolling cue ball cuts a resting ball.

    The paper takes the measured direction of the object ball as the cut angle. `measured` has the speeds of cue ball
    and object ball after both roll, and the angles of their paths from the incident direction. `paper` has the same
    values, computed by the model of the paper.
    """

    speed: float
    cut: float
    measured: tuple[float, float, float, float]
    paper: tuple[float, float, float, float]


SNOOKER = (
    SnookerShot(1.539, 33.83, (0.816, 0.836, 35.96, 33.83), (0.914, 0.831, 31.93, 32.20)),
    SnookerShot(1.032, 26.36, (0.520, 0.629, 33.20, 26.36), (0.520, 0.599, 32.45, 25.07)),
    SnookerShot(1.364, 40.52, (0.925, 0.700, 30.50, 40.51), (0.917, 0.676, 29.91, 38.62)),
    SnookerShot(1.731, 46.50, (1.275, 0.787, 27.97, 46.50), (1.280, 0.780, 27.32, 44.38)),
    SnookerShot(0.942, 18.05, (0.365, 0.581, 29.86, 18.05), (0.383, 0.579, 29.47, 17.15)),
)
_SNOOKER = Scene.named("snooker")
SNOOKER_RADIUS = _SNOOKER.balls.radius[0]
SNOOKER_PHYSICS = dataclasses.replace(
    FRICTIONAL, **{name: getattr(_SNOOKER.physics, name) for name in ("mu_ball", "e_ball", "mu_slide")}
)
"""The balls of the scene "snooker", with the constants of Mathavan, Jackson and Parkin."""

DOMENECH_SPEED, DOMENECH_FRICTION = 0.80, 0.125
DOMENECH_THROW = (
    *((7.7, 0.99), (14.9, 2.02), (20.6, 2.72), (25.2, 3.09), (29.4, 3.51), (34.1, 4.10), (38.5, 4.78), (45.1, 5.11)),
    *((51.5, 5.47), (51.5, 3.40), (59.7, 5.13), (62.4, 6.16), (62.4, 4.43), (66.0, 5.58), (70.5, 6.50)),
)
"""Measured by Domenech (2023) with a rolling cue ball at 0.80 m/s, within about 1 degree: cut angle and throw."""
DOMENECH_SCATTER = ((8.0, 73.8), (15.4, 71.4), (20.9, 63.8), (26.2, 62.9), (30.0, 60.3), (35.6, 56.4), (43.6, 45.5))
"""The same: cut angle and change of the cue ball's direction in the impact."""

# Impacts


class After(NamedTuple):
    """The balls after m impacts: velocities (m, 2, 2), m/s, and spins times the radius (m, 2, 3), m/s."""

    velocities: Floats
    spins: Floats


def impact(
    physics: Physics,
    speed: ArrayLike,
    cut: ArrayLike,
    side: ArrayLike = 0.0,
    roll: ArrayLike = 0.0,
    radius: float = POOL_RADIUS,
) -> After:
    """Returns the balls right after impacts of a cue ball on a resting ball; the arguments broadcast."""
    speed, cut, side, roll = (np.ravel(a) for a in np.broadcast_arrays(speed, np.radians(cut), side, roll))
    scene = Scene(Balls.uniform(2, radius), TABLE, physics)
    positions, spins = np.zeros((len(speed), 2, 2)), np.zeros((len(speed), 3))
    positions[:, 1] = 2 * radius * np.stack([np.cos(cut), np.sin(cut)], axis=-1)
    spins[:, 1], spins[:, 2] = roll * speed / radius, side * speed / radius
    velocities = np.stack([speed, np.zeros_like(speed)], axis=-1)
    batch = simulate_batch(scene, positions, velocities, spins=spins, max_time=INSTANT)
    return After(batch.velocities, radius * batch.spins)


def direction(velocities: Floats) -> Floats:
    """Returns the angles of velocities (..., 2) from the x axis, degrees."""
    return np.degrees(np.arctan2(velocities[..., 1], velocities[..., 0]))


def throw(physics: Physics, speed: ArrayLike, cut: ArrayLike, side: ArrayLike = 0.0, roll: ArrayLike = 0.0) -> Floats:
    """Returns the angles (m,) by which the object ball leaves the line of centres, towards the cue ball's path."""
    after = impact(physics, speed, cut, side, roll)
    return np.ravel(cut) - direction(after.velocities[:, 1])


def rolling(after: After) -> Floats:
    """Returns the velocities (m, 2, 2) at which the balls roll, if nothing else happens."""
    slide = np.stack([after.spins[..., 1], -after.spins[..., 0]], axis=-1)
    return (5 * after.velocities + 2 * slide) / 7


def throw_formula(speed: float, cut: ArrayLike, side: ArrayLike = 0.0, roll: ArrayLike = 0.0) -> Floats:
    """Returns the throw of TP A.14 for elastic balls, degrees."""
    sine, cosine = np.sin(np.radians(cut)), np.cos(np.radians(cut))
    across = speed * (sine - np.asarray(side, float))
    slip = np.hypot(across, speed * np.asarray(roll, float) * cosine)
    mu = 9.951e-3 + 0.108 * np.exp(-1.088 * slip)
    with np.errstate(invalid="ignore", divide="ignore"):
        tangent = np.minimum(mu * speed * cosine / slip, 1 / 7) * across / (speed * cosine)
    return np.degrees(np.arctan(np.where(slip > 0, tangent, 0.0)))


class FrozenPair(NamedTuple):
    """A cue ball that is frozen to an object ball and struck.

    Attributes:
        directions: Directions of the cue ball from the line of centres, one for each of `FROZEN`.
        ratio: Speed of the cue ball over the speed of the object ball, if the stroke is along the line of centres.
    """

    directions: list[float]
    ratio: float


def frozen(speed: float) -> FrozenPair:
    """Returns the shots of a cue that moves at `speed`, in the directions of `FROZEN`."""
    scene, angles = Scene(Balls.uniform(2), TABLE, FRICTIONAL), np.radians([angle for angle, _ in FROZEN])
    positions = np.broadcast_to([[0.0, 0.0], [2 * POOL_RADIUS, 0.0]], (len(FROZEN), 2, 2))
    velocities = simulate_batch(scene, positions, strike(scene, speed, -angles), max_time=INSTANT).velocities
    full = np.hypot(*velocities[0].T)
    return FrozenPair((-direction(velocities[:, 0])).tolist(), float(full[0] / full[1]))


def frozen_pair(speed: float) -> float:
    """Returns the throw of the second ball of a frozen pair, if a full hit drives the first one at 45 degrees to it."""
    scene = Scene(Balls.uniform(3), TABLE, FRICTIONAL)
    d = 2 * POOL_RADIUS
    positions = [[-d, 0.0], [0.0, 0.0], [d * np.sqrt(0.5), d * np.sqrt(0.5)]]
    batch = simulate_batch(scene, [positions], [[speed, 0.0]], max_time=INSTANT)
    return float(45.0 - direction(batch.velocities[0, 2]))


def half_ball_rule(physics: Physics, speed: float, cut: ArrayLike) -> Floats:
    """Returns the angles between a rolling cue ball's paths before the impact and after it rolls again."""
    return -direction(rolling(impact(physics, speed, cut, roll=1.0))[:, 0])


def wallace_schroeder(cut: ArrayLike) -> Floats:
    """Returns the same for elastic balls without friction, by the formula of Wallace and Schroeder (1988)."""
    sine, cosine = np.sin(np.radians(cut)), np.cos(np.radians(cut))
    return np.degrees(np.arctan2(sine * cosine, sine**2 + 0.4))


def snooker_shots() -> list[list[float]]:
    """Returns speeds of cue ball and object ball, and angles of their paths, for each of `SNOOKER`."""
    speed, cut, *_ = zip(*SNOOKER, strict=True)
    velocities = rolling(impact(SNOOKER_PHYSICS, speed, cut, roll=1.0, radius=SNOOKER_RADIUS))
    speeds, angles = np.hypot(*np.moveaxis(velocities, -1, 0)), direction(velocities)
    return np.column_stack([speeds, abs(angles)]).tolist()


def scatter(physics: Physics, speed: float, cut: ArrayLike) -> Floats:
    """Returns the changes of direction of a rolling cue ball in the impact."""
    return -direction(impact(physics, speed, cut, roll=1.0).velocities[:, 0])


def domenech(friction: float | None, e_ball: float) -> tuple[Physics, dict[str, float]]:
    """Returns physics with a friction and a restitution, and the root mean squares of the differences, degrees."""
    physics = dataclasses.replace(FRICTIONAL, mu_ball=friction, e_ball=e_ball)
    cut, measured = np.array(DOMENECH_THROW).T
    throws = throw(physics, DOMENECH_SPEED, cut, roll=1.0) - measured
    cut, measured = np.array(DOMENECH_SCATTER).T
    scatters = scatter(physics, DOMENECH_SPEED, cut) - measured
    rms = [float(np.sqrt(np.mean(d**2))) for d in (throws, scatters)]
    return physics, dict(zip(("throw", "scatter"), rms, strict=True))


# Results

DOMENECH_MODELS = ((None, 0.95), (DOMENECH_FRICTION, 0.95), (DOMENECH_FRICTION, 0.97))


def formula_difference() -> float:
    """Returns the largest difference of the throw from `throw_formula`, degrees, over a grid of cuts and spins."""
    cut, side, roll = (
        a.ravel() for a in np.meshgrid(np.linspace(0, 89, 90), np.linspace(-1.2, 1.3, 26), [-1, 0, 0.5, 1])
    )
    return max(
        float(abs(throw(ELASTIC, speed, cut, side, roll) - throw_formula(speed, cut, side, roll)).max())
        for speed in SPEEDS.values()
    )


def measure() -> dict[str, Any]:
    """Runs all impacts."""
    angles = np.arange(15.0, 49.0)
    formula = wallace_schroeder(angles)
    return {
        "formula_difference": formula_difference(),
        "throw_points": [float(throw(FRICTIONAL, SPEEDS[s], [c], roll=r)[0]) for c, _, s, r in THROW_POINTS],
        "frozen": frozen(SPEEDS["slow"])._asdict(),
        "frozen_pair": {name: frozen_pair(SPEEDS[name]) for name in FROZEN_PAIR},
        "snooker": snooker_shots(),
        "domenech": [domenech(*model)[1] for model in DOMENECH_MODELS],
        "formula_of_paths": float(abs(half_ball_rule(Physics(e_ball=1.0), 1.0, angles) - formula).max()),
        "stun": scatter_of_stun(30.0),
    }


def scatter_of_stun(cut: float) -> float:
    """Returns the angle between the line of centres and the path of a cue ball without spin, frictionless balls."""
    return float(cut - direction(impact(Physics(), 1.0, [cut]).velocities[0, 0]))


def _compared(value: float, model: float) -> list[str]:
    """Returns the cells of a measured and a computed angle, and of their difference."""
    return [f"{value:.1f}", f"{model:.1f}", _signed(model - value)]


def _signed(value: float) -> str:
    return f"{round(value, 1) + 0.0:+.1f}"


def blocks(result: dict[str, Any]) -> dict[str, str]:
    """Returns the results as Markdown, by name."""
    points = [
        [f"{cut:g}° cut, {'roll' if roll else 'stun'}, {speed}", *_compared(value, model)]
        for (cut, value, speed, roll), model in zip(THROW_POINTS, result["throw_points"], strict=True)
    ]
    points += [
        [f"frozen pair, 45°, {name}", *_compared(value, model)]
        for (name, value), model in zip(FROZEN_PAIR.items(), result["frozen_pair"].values(), strict=True)
    ]
    frozen_rows = [
        [f"{stroke}°", f"{value}", f"{model:.1f}", _signed(model - value)]
        for (stroke, value), model in zip(FROZEN, result["frozen"]["directions"], strict=True)
    ]
    snooker = []
    for shot, model in zip(SNOOKER, result["snooker"], strict=True):
        *speeds, cue, ball = zip(shot.measured, model, shot.paper, strict=True)
        cells = [f"{m:.3f}, {f:.3f} ({f / m - 1:+.0%}), {p:.3f}" for m, f, p in speeds]
        cells += [f"{m:.1f}, {f:.1f} ({f - m:+.1f}), {p:.1f}" for m, f, p in (cue, ball)]
        snooker.append((f"{shot.speed:.3f}", f"{shot.cut:.1f}", *cells))
    models = [
        ["Marlow's, 0.03 to 0.11" if mu is None else f"{mu}", f"{e}", f"{rms['throw']:.2f}°", f"{rms['scatter']:.1f}°"]
        for (mu, e), rms in zip(DOMENECH_MODELS, result["domenech"], strict=True)
    ]
    return {
        "throw formula": f"The largest difference from the formula of TP A.14, over 28,080 impacts with cuts of 0 to 89"
        f" degrees and any side and roll, is {result['formula_difference']:.0e} degrees.",
        "throw points": table(["throw, °", "measured", "model", "difference"], points),
        "frozen": table(["stroke", "measured, °", "model, °", "difference, °"], frozen_rows),
        "frozen ratio": f"After a full hit the cue ball has {result['frozen']['ratio']:.3f} times the speed of the"
        " object ball.",
        "snooker": table(
            ("speed, m/s", "cut, °", "cue ball, m/s", "object ball, m/s", "cue ball, °", "object ball, °"),
            snooker,
            left=0,
        ),
        "domenech": table(["friction between balls", "e_ball", "throw, rms", "cue ball, rms"], models),
        "paths": f"Without friction between elastic balls, the engine and the formula of Wallace and Schroeder differ"
        f" by {result['formula_of_paths']:.0e} degrees at most. With stun and a restitution of 0.95, the cue ball of a"
        f" half-ball hit leaves at {result['stun']:.2f} degrees from the line of centres.",
    }
