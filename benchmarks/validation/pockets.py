"""Which paths of a single ball end in a pocket, at which angle and offset.

The angle of a path is measured from the axis of the pocket, which is perpendicular to a side or diagonal in a corner.
The offset is the distance of the path from the middle of the mouth. Offsets and openings are in inches and angles in
degrees, as in the papers.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks import table
from billiards_env.scene import Balls, Physics, Scene
from billiards_env.scene.table import INCH, POOL_LENGTH, POOL_RADIUS, POOL_WIDTH, Jaws, Table, pool_table
from billiards_env.shots.simulation import simulate_batch

Floats = NDArray[np.float64]

SPEEDS = {"slow": 0.447, "fast": 3.129}
"""m/s at the mouth: 1 and 7 miles per hour, as in TP A.14."""

PHYSICS = Physics(ball_ball="frictional", cushion="stronge")
WAY = 0.4  # m from the start of a path to the middle of the mouth

MISSED, TOUCHED, CLEAN = 0.0, 1.0, 2.0
"""Outcomes: not in the pocket, potted after a touch of a cushion, potted without one."""

# Alciatore, TP 3.5 to 3.8: the geometry of the two pockets
_SIDE = Jaws(5.0625 * INCH, 14.0, 0.0, 3 * INCH, (0.1875 + 3) * INCH)
_CORNER_MOUTH, _CORNER_SHELF, _CORNER_HOLE = 4.5875 * INCH, 1.125 * INCH, 2.75 * INCH
_CORNER = Jaws(_CORNER_MOUTH, 7.0, 0.0, _CORNER_HOLE, _CORNER_SHELF + _CORNER_HOLE - _CORNER_MOUTH / 2)

OPENINGS = (
    ("side", 0, "3.35", 3.35),
    ("side", 35, "2.0", 2.0),
    ("corner", 0, "1.5", 1.5),
    ("corner", 30, "1.3", 1.3),
    ("corner", 45, "3 to 3.5", 3.25),
)
"""Effective openings at low speed: Alciatore, TP 3.5 and TP 3.6. Pocket, angle, opening."""

STEEPEST = (("slow", 68.3), ("fast", 50.7))
"""Largest angle at which a ball can enter a side pocket: Alciatore, TP 3.5 and TP 3.7."""


class Target(NamedTuple):
    """A pocket as a target: the middle of its mouth, m, and the direction of its axis out of the table, degrees."""

    x: float
    y: float
    axis: float


def papers_table() -> Table:
    """Returns a 9-foot table with the pockets of TP 3.5 to 3.8."""
    return pool_table(POOL_LENGTH, POOL_WIDTH, 0.635 * 2 * POOL_RADIUS, 2 * INCH, _CORNER, _SIDE)


def target(board: Table, pocket: str) -> Target:
    """Returns the "side" or the "corner" pocket at x >= 0, y > 0."""
    if pocket == "side":
        return Target(0.0, board.width / 2, 90.0)
    mouth = max(c.x for c in board.outline if abs(c.y - board.width / 2) < 1e-9)  # corner of the jaws on the long side
    back = (board.length / 2 - mouth) / 2
    return Target(board.length / 2 - back, board.width / 2 - back, 45.0)


def outcomes(board: Table, pocket: str, speed: float, angle: Floats, offset: Floats) -> Floats:
    """Returns the outcome of each path (m,): `CLEAN`, `TOUCHED`, `MISSED` or, if it would begin in a cushion, nan.

    The ball rolls into the "side" or the "corner" pocket with a speed at the mouth, m/s. The angles (m,), degrees, are
    positive if it moves away from the left of the axis, as seen towards the pocket. The offsets (m,), inches, are
    positive to the left of the middle of the mouth.
    """
    aim = target(board, pocket)
    heading = np.radians(aim.axis + angle)
    ahead = np.stack([np.cos(heading), np.sin(heading)], -1)
    left = np.stack([-ahead[:, 1], ahead[:, 0]], -1)
    start = np.array([aim.x, aim.y]) + offset[:, None] * INCH * left - WAY * ahead
    free = board.clearance(start) >= POOL_RADIUS
    scene = Scene(Balls.uniform(1), board, PHYSICS)
    at_start = np.sqrt(speed**2 + 2 * PHYSICS.mu_roll * PHYSICS.g * WAY)
    velocities = at_start * ahead[free]
    spins = np.stack([-velocities[:, 1], velocities[:, 0], np.zeros(len(velocities))], -1) / POOL_RADIUS
    # A ball that misses needs more than this to come back from another cushion.
    patience = 1.2 * (WAY + 0.25) / speed + 0.5
    batch = simulate_batch(scene, start[free][:, None], velocities, spins=spins, max_time=patience)
    near = np.hypot(*(batch.positions[:, 0] - [aim.x, aim.y]).T) < 0.25
    results = np.full(len(start), np.nan)
    clean = batch.cushions[:, 0] == 0
    results[free] = np.where(batch.potted[:, 0] & near, np.where(clean, CLEAN, TOUCHED), MISSED)
    return results


def opening_widths(board: Table, pocket: str, speed: float, angle: float) -> tuple[float, float]:
    """Returns the widths of the offsets that end in the pocket and of those without a touch, inches."""
    offsets = np.linspace(-4, 4, 801)
    results = outcomes(board, pocket, speed, np.full(len(offsets), angle), offsets)
    step = offsets[1] - offsets[0]
    return float((results >= TOUCHED).sum() * step), float((results == CLEAN).sum() * step)


def steepest(board: Table, speed: float) -> float:
    """Returns the largest angle at which some path ends in the side pocket, degrees."""
    angles, offsets = np.meshgrid(np.arange(48.0, 75.0, 0.1), np.linspace(-1.5, 1.5, 401))
    results = outcomes(board, "side", speed, angles.ravel(), offsets.ravel()).reshape(angles.shape)
    return float(angles[0][(results >= TOUCHED).any(axis=0)].max())


def measure() -> dict[str, Any]:
    """Runs the paths."""
    boards = {"papers": papers_table(), "pool_9ft": Table.named("pool_9ft")}
    return {
        "openings": {
            name: {
                speed: [opening_widths(board, pocket, v, angle) for pocket, angle, *_ in OPENINGS]
                for speed, v in SPEEDS.items()
            }
            for name, board in boards.items()
        },
        "steepest": {name: [steepest(board, SPEEDS[speed]) for speed, _ in STEEPEST] for name, board in boards.items()},
    }


def blocks(result: dict[str, Any]) -> dict[str, str]:
    """Returns the results as Markdown, by name."""
    papers, wpa = result["openings"]["papers"], result["openings"]["pool_9ft"]
    rows = []
    for k, (pocket, angle, text, value) in enumerate(OPENINGS):
        (slow, clean), (fast, _) = papers["slow"][k], papers["fast"][k]
        rows.append(
            [
                f"{pocket}, {angle}°",
                text,
                f"{slow:.2f}",
                f"{slow - value:+.2f}",
                f"{clean:.2f}",
                f"{fast:.2f}",
                f"{wpa['slow'][k][0]:.2f}",
                f"{wpa['fast'][k][0]:.2f}",
            ]
        )
    head = ["opening, in", "published, slow", "model, slow", "difference", "without a touch", "model, fast"]
    steep = [
        [speed, f"{value}", f"{model:.1f}", f"{model - value:+.1f}", f"{other:.1f}"]
        for (speed, value), model, other in zip(
            STEEPEST, result["steepest"]["papers"], result["steepest"]["pool_9ft"], strict=True
        )
    ]
    return {
        "openings": table([*head, "`pool_9ft`, slow", "`pool_9ft`, fast"], rows),
        "steepest": table(["side pocket, largest angle, °", "published", "model", "difference", "`pool_9ft`"], steep),
    }
