"""What a timestep does to throw, banks and the jaws of pockets: `python -m benchmarks.real_timestep`.

PIC and PIT run the same random shots on the 9-foot table of the scene "real_pool".

* throw: the cue ball hits an object ball at a cut angle of 20 to 60 degrees. Half of the cue balls roll, half slide
  without spin. The result is the direction of the object ball.
* bank: a rolling ball meets a long cushion at 20 to 70 degrees. The result is its position half a second after the
  start. (Its direction is the same: the cushion's law does not depend on the place of the impact.)
* jaws: a rolling ball goes to a corner pocket and touches a facing or a tip. The result is whether the pocket
  captures it.
"""

from __future__ import annotations

import argparse
import dataclasses
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks import RESULTS, check_counts, print_blocks, table
from billiards_env.files import write_json
from billiards_env.physics.state import FIXES
from billiards_env.scene import Scene
from billiards_env.simulation import BatchResult, simulate_batch

Floats = NDArray[np.float64]

OUTPUT = RESULTS / "real_timestep.json"
STEPS = (60, 240, 960, 3840)
"""Timesteps, as steps per second."""

END = 0.5  # s; the time after the start at which a throw and a bank are measured
_POCKET = 3  # the corner pocket at +x, +y


@dataclasses.dataclass(frozen=True, slots=True)
class Shots:
    """The start of m shots.

    Attributes:
        scene: The scene.
        positions: (m, n, 2) m.
        velocities: (m, 2) m/s, of the cue ball.
        spins: (m, 3) rad/s, of the cue ball.
        max_time: The end of the shots, s; None for rest.
    """

    scene: Scene
    positions: Floats
    velocities: Floats
    spins: Floats
    max_time: float | None = None

    def run(self, **mode: Any) -> BatchResult:
        """Runs the shots with an engine."""
        return simulate_batch(
            self.scene, self.positions, self.velocities, spins=self.spins, max_time=self.max_time, **mode
        )

    def of(self, chosen: NDArray[np.bool_]) -> Shots:
        """Returns some of the shots."""
        return dataclasses.replace(
            self,
            positions=self.positions[chosen],
            velocities=self.velocities[chosen],
            spins=self.spins[chosen],
        )


def _unit(angle: Floats) -> Floats:
    return np.stack((np.cos(angle), np.sin(angle)), axis=-1)


def _rolling(velocities: Floats, radius: float) -> Floats:
    """Returns the spins (m, 3) of balls that roll at given velocities."""
    return np.stack((-velocities[:, 1], velocities[:, 0], np.zeros(len(velocities))), axis=-1) / radius


def throws(count: int, rng: np.random.Generator) -> Shots:
    """Draws hits of the cue ball on an object ball in the middle of the table."""
    scene = Scene.named("real_pool", 1)
    radius = scene.balls.radius[0]
    angle, speed = rng.uniform(0, 2 * np.pi, count), rng.uniform(0.5, 3.0, count)
    cut = np.radians(rng.uniform(20, 60, count)) * rng.choice((-1, 1), count)
    way = speed * rng.uniform(0.02, 0.06, count)
    ghost = -2 * radius * _unit(angle + cut)
    positions = np.stack((ghost - way[:, None] * _unit(angle), np.zeros((count, 2))), axis=1)
    velocities = speed[:, None] * _unit(angle)
    spins = _rolling(velocities, radius) * rng.integers(0, 2, count)[:, None]
    return Shots(scene, positions, velocities, spins, END)


def banks(count: int, rng: np.random.Generator) -> Shots:
    """Draws rolling balls that meet the long cushion at +y away from the pockets."""
    scene = Scene.named("real_pool", 0)
    radius, half = scene.balls.radius[0], scene.table.width / 2
    angle, speed = np.radians(rng.uniform(20, 70, count)), rng.uniform(0.5, 3.0, count)
    velocities = speed[:, None] * _unit(angle)
    way = rng.uniform(0.02, 0.06, count)[:, None] * velocities
    at = np.stack((rng.uniform(-0.8, -0.4, count), np.full(count, half - radius)), axis=-1)
    return Shots(scene, (at - way)[:, None], velocities, _rolling(velocities, radius), END)


def jaws(count: int, rng: np.random.Generator) -> Shots:
    """Draws rolling balls that touch a facing or a tip of a corner pocket in the exact engine."""
    scene = Scene.named("real_pool", 0)
    radius, pocket = scene.balls.radius[0], scene.table.pockets[_POCKET]
    goal = np.array((pocket.x, pocket.y))
    towards = math.atan2(math.copysign(1, goal[1]), math.copysign(1, goal[0]))
    angle, speed = towards + np.radians(rng.uniform(-35, 35, count)), rng.uniform(0.5, 3.0, count)
    half = np.array((scene.table.length, scene.table.width)) / 2
    mouth = np.sign(goal) * (half - 0.05)
    aside = rng.uniform(-0.05, 0.05, count)[:, None] * _unit(angle + np.pi / 2)
    velocities = speed[:, None] * _unit(angle)
    positions = mouth + aside - rng.uniform(0.1, 0.4, count)[:, None] * _unit(angle)
    shots = Shots(scene, positions[:, None], velocities, _rolling(velocities, radius))
    shots = shots.of(np.asarray((np.abs(positions) < half - radius).all(axis=1)))
    return shots.of(shots.run().cushions[:, 0] > 0)


def _degrees_apart(a: Floats, b: Floats) -> Floats:
    """Returns the angles between vectors (m, 2), degrees."""
    return np.degrees(np.abs(np.arctan2(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0], (a * b).sum(-1))))


def measure(count: int) -> dict[str, Any]:
    """Compares PIT with PIC in `count` shots of each kind.

    Returns:
        `shots`, the number of shots of each kind, and `rows`: for each fix and timestep the median and the 95th
        percentile of the error of the thrown ball's direction (degrees), the same of the position after a bank (mm),
        and the share of the shots at the jaws with another result.
    """
    rng = np.random.default_rng(0)
    kinds = {"throw": throws(count, rng), "bank": banks(count, rng), "jaws": jaws(count, rng)}
    exact = {kind: shots.run() for kind, shots in kinds.items()}
    rows = []
    for fix in FIXES:
        for steps in STEPS:
            found = {kind: shots.run(mode="pit", dt=1 / steps, fix=fix) for kind, shots in kinds.items()}
            errors = {
                "throw_degrees": _degrees_apart(found["throw"].velocities[:, 1], exact["throw"].velocities[:, 1]),
                "bank_mm": 1e3 * np.linalg.norm(found["bank"].positions - exact["bank"].positions, axis=-1)[:, 0],
            }
            wrong = float((found["jaws"].potted != exact["jaws"].potted).mean())
            row = {name: np.percentile(error, (50, 95)).tolist() for name, error in errors.items()}
            rows.append({"fix": fix, "steps_per_second": steps, **row, "jaws_wrong": wrong})
    potted = float(exact["jaws"].potted.mean())
    return {
        "shots": {kind: len(shots.positions) for kind, shots in kinds.items()},
        "jaws_potted": potted,
        "rows": rows,
    }


def blocks(result: Mapping[str, Any]) -> dict[str, str]:
    """Returns the results as Markdown, by name."""
    head = ["fix", "timestep", "throw: direction", "bank: position", "jaws: wrong result"]
    rows = [
        [
            row["fix"],
            f"1/{row['steps_per_second']} s",
            "{:.2f} ({:.2f})°".format(*row["throw_degrees"]),
            "{:.1f} ({:.1f}) mm".format(*row["bank_mm"]),
            f"{row['jaws_wrong']:.1%}",
        ]
        for row in result["rows"]
    ]
    shots = result["shots"]
    return {
        "table": table(head, rows),
        "shots": f"{shots['throw']:,} throws, {shots['bank']:,} banks and {shots['jaws']:,} shots that touch the jaws; "
        f"the exact engine pots {result['jaws_potted']:.0%} of the last.",
    }


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m benchmarks.real_timestep --help`."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.real_timestep", description="Measure the effect of a timestep on a real table."
    )
    parser.add_argument("--shots", type=int, default=10_000, help="shots of each kind (default: %(default)s)")
    parser.add_argument("--output", type=Path, default=OUTPUT, help="JSON file (default: %(default)s)")
    args = parser.parse_args(arguments)
    check_counts(parser, args, shots=100)
    result = measure(args.shots)
    write_json(args.output, result)
    print_blocks(blocks(result))


if __name__ == "__main__":
    main()
