"""The cost of the derivatives of shots: `python -m benchmarks.gradients`.

For each case a batch is simulated, simulated with a record, and differentiated, on one core. The parts take turns in
one process; medians of the ratios to the plain batch are reported.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks import machine, run_command, table
from benchmarks.speed import Case, breaks, quartiles, random_shots, seconds
from billiards_env.scene import Scene
from billiards_env.shots.simulation import simulate_batch

PARTS = ("record", "jvp", "vjp", "record and jvp", "record and vjp")


def cases(scale: float = 1.0) -> list[Case]:
    """Returns the cases; with `scale` = 1 a pass over the shots of a case takes about a tenth of a second."""

    def count(shots: int) -> int:
        return max(1, round(shots * scale))

    return [
        random_shots("pool, 1 object ball", Scene.named("pool", 1), count(20_000)),
        random_shots("real pool, 1 object ball", Scene.named("real_pool", 1), count(10_000)),
        breaks("15-ball break, loose rack", "pool", "rack", count(500)),
        breaks("real pool, 15-ball break, loose rack", "real_pool", "rack", count(500)),
    ]


def measure(repeats: int, scale: float = 1.0) -> dict[str, Any]:
    """Runs all measurements `repeats` times.

    Args:
        repeats: Number of passes over the cases.
        scale: Factor on the number of shots in a pass.

    Returns:
        `cases`: a list with one entry per case.
    """
    on, all_cases, rows = machine(), cases(scale), []
    passes = np.array([[time_parts(case) for case in all_cases] for _ in range(repeats + 1)])[1:]  # the first compiles
    for k, case in enumerate(all_cases):
        plain, *parts = passes[:, k].T
        record, jvp, vjp = (part / plain for part in parts)
        ratios = zip(PARTS, (record, jvp, vjp, record + jvp, record + vjp), strict=True)
        us = 1e6 * float(np.median(plain)) / len(case.positions)
        rows.append({"case": case.name, "us_per_shot": us, "ratios": {name: quartiles(row) for name, row in ratios}})
    return {"machine": on, "repeats": repeats, "cases": rows}


def time_parts(case: Case) -> list[float]:
    """Returns the seconds of a plain batch, a recorded one, a jvp by and a vjp for all velocities."""
    scene, positions, velocities = case.scene, case.positions, case.velocities
    batch = simulate_batch(scene, positions, velocities, record=True, threads=1)
    ones = np.ones(positions.shape)
    return [
        seconds(lambda: simulate_batch(scene, positions, velocities, threads=1)),
        seconds(lambda: simulate_batch(scene, positions, velocities, record=True, threads=1)),
        seconds(lambda: batch.jvp({"velocities": ones}, "positions", threads=1)),
        seconds(lambda: batch.vjp({"positions": ones}, "velocities", threads=1)),
    ]


def blocks(result: dict[str, Any]) -> dict[str, str]:
    """Returns the results as Markdown, by name."""
    rows = [
        (row["case"], f"{row['us_per_shot']:.1f}", *(f"{row['ratios'][name]['median']:.2f}" for name in PARTS))
        for row in result["cases"]
    ]
    return {
        "how": f"One core; medians of {result['repeats']} interleaved passes. The other columns are times "
        "divided by the time of the plain batch.",
        "cost": table(("shots", "us/shot", *PARTS), rows),
    }


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m benchmarks.gradients --help`."""
    repeats = (11, "number of passes")
    run_command(
        "benchmarks.gradients", "Measure the cost of derivatives.", arguments, measure, blocks, {"repeats": repeats}
    )


if __name__ == "__main__":
    main()
