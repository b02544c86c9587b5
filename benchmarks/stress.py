"""The stress run: ten million random shots, each checked at every event, and very long runs of elastic gases.

`python -m benchmarks.stress` takes 10 to 25 minutes on two cores. It prints its tables and writes them to
`benchmarks/results/stress.json`. It ends with an error if any shot breaks a rule.
"""

from __future__ import annotations

import sys
import time
from concurrent.futures import Executor, Future, as_completed
from typing import Any

from tqdm import tqdm

from benchmarks import RESULTS, machine, machine_line, parser_of, processes, report, table, workers
from billiards_env.commands import ending
from reference.stress import families, measure

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
}
WORST = ("overlap", "outside", "rise", "momentum", "most_events")
ADDED = ("shots", "contact_rule", "events")


def random_shots(pool: Executor, scale: float) -> dict[str, dict[str, Any]]:
    """Runs all kinds of shots and returns the worst values of each kind."""
    tasks = []
    for name, (thousands, chunk) in SHOTS.items():
        count = max(1, round(1000 * thousands * scale / chunk))
        tasks += [(seed / count, name, seed, chunk) for seed in range(count)]
    futures: dict[Future[dict[str, Any]], str] = {
        pool.submit(families.run, name, 1000 + seed, chunk): name for _, name, seed, chunk in sorted(tasks)
    }
    total: dict[str, dict[str, Any]] = {
        name: {key: 0 for key in ADDED} | {key: 0.0 for key in WORST} | {"bad": []} for name in SHOTS
    }
    with tqdm(total=sum(chunk for *_, chunk in tasks), unit="shot", unit_scale=True, smoothing=0.02) as bar:
        for future in as_completed(futures):
            found, sums = future.result(), total[futures[future]]
            for key in ADDED:
                sums[key] += found.get(key, 0)
            for key in WORST:
                sums[key] = max(sums[key], found.get(key, 0))
            sums["bad"] += found["bad"]
            bar.update(found["shots"])
    return total


def blocks(data: dict[str, Any]) -> dict[str, str]:
    """Returns the results as Markdown, by name."""
    every = data["shots"].values()
    shots, bad = sum(s["shots"] for s in every), sum(len(s["bad"]) for s in every)
    worst = {key: max(s[key] for s in every) for key in WORST}
    rules = sum(s["contact_rule"] for s in every)
    rows = [(name, _row(s, len(s["bad"]))) for name, s in data["shots"].items()]
    rows.append(("all", _row({**worst, "shots": shots, "contact_rule": rules}, bad)))
    head = [
        "random shots",
        "shots",
        "broke a rule",
        "deepest overlap, m",
        "farthest outside, m",
        "energy up, relative",
        "momentum off, relative",
        "contact-time rule acted",
        "most events",
    ]
    drift = [
        (
            f"{d['disks']} disks",
            f"{d['collisions']:,}",
            f"{d['energy_drift']:.1e}",
            f"{d['momentum_drift']:.1e}",
            f"{d['deepest_overlap_m']:.1e}",
        )
        for d in data["drift"]
    ]
    return {
        "machine": machine_line(data["machine"]),
        "summary": f"{bad:,} of {shots:,} shots broke a rule. The deepest overlap of two balls was "
        f"{worst['overlap']:.1e} m, the largest relative rise of the energy {worst['rise']:.1e}.",
        "shots": table(head, [(name, *cells) for name, cells in rows]),
        "drift": table(("elastic gas", "collisions", "energy drift", "momentum drift", "deepest overlap, m"), drift),
    }


def _row(s: dict[str, Any], bad: int) -> tuple[str, ...]:
    worst = (f"{s[key]:.1e}" for key in ("overlap", "outside", "rise", "momentum"))
    return f"{s['shots']:,}", f"{bad}", *worst, f"{s['contact_rule']:,}", f"{s['most_events']:,}"


@ending()
def main(arguments: list[str] | None = None) -> None:
    """Runs all measurements, prints and writes the results."""
    parser = parser_of("stress", "Run and check millions of shots.", output=False, workers=workers())
    parser.add_argument(
        "--scale", type=float, default=1.0, help="share of the shots (1); nothing is written if it is less than 1"
    )
    args = parser.parse_args(arguments)
    if not 0 < args.scale <= 1:
        parser.error(f"--scale = {args.scale}: expected a number in (0, 1]")
    for family in ("pool, 1 object ball", "pool, 5 object balls"):
        families.run(family, 0, 1)  # compiles the kernels once, for all processes
    started = time.perf_counter()
    with processes(args.workers) as pool:
        shots = random_shots(pool, args.scale)
        drifts = [pool.submit(measure.drift, n, round(1e6 * args.scale)) for n in (2, 16, 100)]
        drift = [future.result() for future in drifts]
    data = {
        "command": "python -m benchmarks.stress",
        "machine": machine(),
        "minutes": round((time.perf_counter() - started) / 60, 1),
        "shots": shots,
        "drift": drift,
    }
    if args.scale == 1:
        report(data, blocks, RESULTS / "stress.json")
    else:
        print("\n\n".join(blocks(data).values()))
    bad = sum(len(s["bad"]) for s in shots.values())
    if bad:
        sys.exit(f"{bad} shots broke a rule; their (seed, index, status) are in the results")


if __name__ == "__main__":
    main()
