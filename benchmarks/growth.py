"""Run time against the number of balls: `python -m benchmarks.growth`.

An elastic gas of 2 to 10,000 disks at constant density: the table grows with the number of disks. PIC runs as in
`simulate`, which tests all pairs below `MANY_BALLS` balls and uses a grid from there. Up to 256 disks both variants are
also measured separately, in turn, in one process and on one core.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from pathlib import Path
from time import thread_time
from typing import Any

import numpy as np
from tqdm import tqdm

from benchmarks import RESULTS, check_counts, machine, machine_line, print_blocks, table
from benchmarks.methods import LEAST_SECONDS, PIC, Floats, run_all, timer
from billiards_env.engine import pic
from billiards_env.engine.inputs import check_shot
from billiards_env.engine.log import empty_log
from billiards_env.engine.modes import MANY_BALLS, MAX_EVENTS, scene_arrays
from billiards_env.engine.shots import empty_shots
from billiards_env.files import write_json
from billiards_env.scene import Balls, Physics, Scene
from billiards_env.scene.table import Table

DISKS = sorted([*(2**k for k in range(1, 13)), 96, 10_000])
SHARE = 0.1
"""Share of the table's area covered by disks."""
RADIUS, MASS = 0.028575, 0.170097  # m, kg: pool balls
SECONDS = 2.0  # simulated
SPEED = 1.0  # m/s, root mean square along each axis
ALL_PAIRS, GRID = "PIC, all pairs", "PIC, grid"
MOST = 256
"""The largest number of disks at which both variants are measured."""


def gas(n: int) -> Scene:
    """Returns a scene of elastic, frictionless disks on a table twice as long as wide."""
    width = math.sqrt(n * math.pi * RADIUS**2 / SHARE / 2)
    physics = Physics(motion="ideal", cushion="restitution", e_ball=1.0, e_cushion=1.0, max_time=SECONDS)
    return Scene(Balls((RADIUS,) * n, (MASS,) * n), Table(2 * width, width), physics)


def shots(scene: Scene, count: int) -> tuple[Floats, Floats]:
    """Draws positions, (count, n, 2) m, and velocities, m/s; each disk lies at random in its cell of a lattice."""
    n, rng = scene.n_balls, np.random.default_rng(scene.n_balls)
    rows = math.ceil(math.sqrt(n / 2))
    columns = math.ceil(n / rows)
    cell = np.array([scene.table.length / columns, scene.table.width / rows])
    sites = np.stack(np.divmod(np.arange(columns * rows), rows), axis=1) + 0.5
    taken = np.array([sites[rng.permutation(len(sites))[:n]] for _ in range(count)])
    corner = np.array([scene.table.length, scene.table.width]) / 2
    reach = cell / 2 - 1.001 * RADIUS
    return taken * cell - corner + reach * rng.uniform(-1, 1, taken.shape), rng.normal(0.0, SPEED, taken.shape)


def kernel_timer(
    engine: Callable[..., None], scene: Scene, positions: Floats, velocities: Floats
) -> Callable[[], float]:
    """Returns a function that runs shots by a `run_shots` and returns the processor time per shot, s."""
    arrays, log = tuple(scene_arrays(scene)), tuple(empty_log())

    def call(copies: int = 1) -> float:
        many = np.tile(positions, (copies, 1, 1)), np.tile(velocities, (copies, 1, 1))
        m = len(many[0])
        shots = empty_shots(m, scene.n_balls)
        limit = check_shot(scene, *many, None, None, None, shots).limit
        begin = thread_time()
        engine(0, m, arrays, limit, MAX_EVENTS, tuple(shots), log)
        return (thread_time() - begin) / m

    call()  # compiles
    copies = max(1, round(LEAST_SECONDS / (call() * len(positions))))
    return lambda: call(copies)


def measure(disks: list[int], passes: int) -> dict[str, Any]:
    """Runs all measurements.

    Args:
        disks: Numbers of disks.
        passes: Repetitions; the variants take turns in each pass.

    Returns:
        `rows`, one for each number of disks: the events per shot, and by variant the microseconds per shot (medians
        over the passes).
    """
    on, rows = machine(), []
    for n in tqdm(disks, unit="gas"):
        scene = gas(n)
        given = scene, *shots(scene, max(1, 128 // n))
        calls = {"PIC": timer(*given, PIC)}
        if n <= MOST:
            calls |= {ALL_PAIRS: kernel_timer(pic.run_shots, *given), GRID: kernel_timer(pic.run_shots_of_many, *given)}
        seconds = [[call() for call in calls.values()] for _ in range(passes)]
        medians = (1e6 * np.median(seconds, axis=0)).tolist()
        row = {"disks": n, "events_per_shot": float(run_all(*given, PIC).n_events.mean())}
        rows.append({**row, "us_per_shot": dict(zip(calls, medians, strict=True))})
    return {
        "machine": on,
        "passes": passes,
        "seconds_simulated": SECONDS,
        "share": SHARE,
        "grid_from": MANY_BALLS,
        "rows": rows,
    }


def blocks(result: dict[str, Any]) -> dict[str, str]:
    """Returns the results as Markdown, by name."""
    rows = result["rows"]
    cells = []
    for row in rows:
        us = [row["us_per_shot"].get(name) for name in ("PIC", ALL_PAIRS, GRID)]
        per_event = ("" if t is None else f"{t / row['events_per_shot']:,.2f}" for t in us)
        cells.append((f"{row['disks']:,}", f"{row['events_per_shot']:,.0f}", *per_event))
    few, many = rows[0], rows[-1]
    first, last = (row["us_per_shot"]["PIC"] / row["events_per_shot"] for row in (few, many))
    return {
        "machine": machine_line(result["machine"]),
        "how": f"{result['seconds_simulated']:g} s of an elastic gas, disks on {result['share']:.0%} of the table; one "
        f"core; medians of {result['passes']} interleaved passes.",
        "events": table(("disks", "events", "PIC, us/event", "all pairs", "grid"), cells),
        "summary": f"PIC uses them from {result['grid_from']} balls on. An event takes {first:.2g} us with "
        f"{few['disks']:,} disks and {last:.2g} us with {many['disks']:,}.",
    }


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m benchmarks.growth --help`."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.growth", description="Run time against the number of balls."
    )
    parser.add_argument("--passes", type=int, default=5, help="number of passes (5)")
    parser.add_argument("--most", type=int, default=DISKS[-1], help=f"largest number of disks ({DISKS[-1]:,})")
    parser.add_argument("--output", type=Path, default=RESULTS / "growth.json", help="JSON file")
    args = parser.parse_args(arguments)
    check_counts(parser, args, passes=1, most=2)
    result = measure([n for n in DISKS if n <= args.most], args.passes)
    write_json(args.output, result)
    print_blocks(blocks(result))
    print(f"\nWritten to {args.output}.")


if __name__ == "__main__":
    main()
