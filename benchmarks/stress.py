"""The stress run: ten million random shots, each checked at every event, and very long runs of elastic gases.

`python -m benchmarks.stress` takes minutes on two cores; its results have the time. It ends with an error if
any shot breaks a rule.
"""

from __future__ import annotations

import sys
import time
from concurrent.futures import Executor, Future, as_completed
from typing import Any

from tqdm import tqdm

from benchmarks import machine, processes, rows_table, run_command, workers
from benchmarks.reference.stress import families
from benchmarks.reference.stress.measure import drift
from billiards_env.commands import Job
from billiards_env.support.checks import Range, real

# Thousands of shots of each kind, and the number of shots in one task.
SHOTS = {
    "pool, cue ball alone": (1500, 10_000),
    "carom, cue ball alone": (1500, 10_000),
    "pool, 1 object ball": (3000, 10_000),
    "pool, 5 object balls": (700, 5_000),
    "carom, 2 object balls": (1500, 10_000),
    "pooltool carom, 2 object balls": (1000, 10_000),
    "rolling pool, 3 object balls": (600, 5_000),
    "9-ball break, loose rack": (50, 500),
    "9-ball break, tight rack": (30, 500),
    "15-ball break, loose rack": (30, 250),
    "15-ball break, tight rack": (30, 250),
    "ideal gas of 16 disks": (60, 1_000),
    "wild": (100, 50),
    "real pool, cue ball alone": (500, 10_000),
    "real pool, 1 object ball": (500, 10_000),
    "real pool, 5 object balls": (200, 5_000),
    "7-foot pool, 1 object ball": (500, 10_000),
    "snooker, 5 object balls": (200, 5_000),
    "UK pool, 5 object balls": (200, 5_000),
    "jaws without holes, 2 object balls": (300, 5_000),
    "wild outlines": (50, 50),
    "jump shots, 3 object balls": (800, 5_000),
    "rain of 6 balls": (200, 1_000),
    "rain of 6 balls with jaws": (200, 1_000),
    "stacks, exact": (100, 1_000),
    "stacks, leaning": (100, 1_000),
    "wedges at a nose": (100, 1_000),
    "rain of 6 balls of several sizes": (200, 1_000),
}
WORST = ("overlap", "outside", "rise", "momentum", "most_events")
ADDED = ("shots", "contact_rule", "events")


def run_random_shots(pool: Executor, scale: float, job: Job) -> dict[str, dict[str, Any]]:
    """Runs all kinds of shots and returns the worst values of each kind."""
    tasks = []
    for name, (thousands, chunk) in SHOTS.items():
        count = max(1, round(1000 * thousands * scale / chunk))
        tasks += [(seed / count, name, seed, chunk) for seed in range(count)]
    futures: dict[Future[dict[str, Any]], tuple[str, int]] = {
        pool.submit(families.check_family, name, 1000 + seed, chunk): (name, 1000 + seed)
        for _, name, seed, chunk in sorted(tasks)
    }
    total: dict[str, dict[str, Any]] = {
        name: {key: 0 for key in ADDED} | {key: 0.0 for key in WORST} | {"bad": []} for name in SHOTS
    }
    with tqdm(total=sum(chunk for *_, chunk in tasks), unit="shot", unit_scale=True, smoothing=0.02) as bar:
        for future in as_completed(futures):
            name, seed = futures[future]
            with job(f"{name}, seed {seed}"):
                counts, sums = future.result(), total[name]
                for key in ADDED:
                    sums[key] += counts.get(key, 0)
                for key in WORST:
                    sums[key] = max(sums[key], counts.get(key, 0))
                sums["bad"] += counts["bad"]
                bar.update(counts["shots"])
    return total


def measure(workers: int, scale: float, job: Job) -> dict[str, Any]:
    """Runs a share of the shots, and gases with a share of a million collisions."""
    real("scale", scale, Range(1e-9, 1.0))
    for family in ("pool, 1 object ball", "pool, 5 object balls"):
        families.check_family(family, 0, 1)  # compiles the kernels once, for all processes
    on, started, drifts = machine(), time.perf_counter(), []
    with processes(workers) as pool:
        shots = run_random_shots(pool, scale, job)
        gases = {n: pool.submit(drift, n, round(1e6 * scale)) for n in (2, 16, 100)}
        for n, gas in gases.items():
            with job(f"elastic gas of {n} disks"):
                drifts.append(gas.result())
    minutes = round((time.perf_counter() - started) / 60, 1)
    return {"machine": on, "minutes": minutes, "shots": shots, "drift": drifts}


def blocks(data: dict[str, Any]) -> dict[str, str]:
    """Returns the results as Markdown, by name."""
    kinds = [{"name": name, **counts, "broke": len(counts["bad"])} for name, counts in data["shots"].items()]
    total = {key: sum(kind[key] for kind in kinds) for key in (*ADDED, "broke")}
    total |= {key: max(kind[key] for kind in kinds) for key in WORST}
    columns = {
        "random shots": "{name}",
        "shots": "{shots:,}",
        "broke a rule": "{broke}",
        "deepest overlap, m": "{overlap:.1e}",
        "farthest outside, m": "{outside:.1e}",
        "energy up, relative": "{rise:.1e}",
        "momentum off, relative": "{momentum:.1e}",
        "contact-time rule acted": "{contact_rule:,}",
        "most events": "{most_events:,}",
    }
    gases = {
        "elastic gas": "{disks} disks",
        "collisions": "{collisions:,}",
        "energy drift": "{energy_drift:.1e}",
        "momentum drift": "{momentum_drift:.1e}",
        "deepest overlap, m": "{deepest_overlap_m:.1e}",
    }
    return {
        "summary": "{broke:,} of {shots:,} shots broke a rule. The deepest overlap of two balls was {overlap:.1e} m, "
        "the largest relative rise of the energy {rise:.1e}.".format_map(total),
        "shots": rows_table(columns, [*kinds, {"name": "all", **total}]),
        "drift": rows_table(gases, data["drift"]),
    }


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m benchmarks.stress --help`."""
    options = {"workers": workers(), "scale": (1.0, "share of the shots; for a trial with fewer give --output too")}
    about = "Run and check millions of shots."
    data = run_command("benchmarks.stress", about, arguments, measure, blocks, options, jobs=True)
    if bad := sum(len(counts["bad"]) for counts in data["shots"].values()):
        sys.exit(f"{bad} shots broke a rule; their (seed, index, status) are in the results")


if __name__ == "__main__":
    main()
