"""The stress run: ten million random shots, each checked at every event, and very long runs.

`python -m benchmarks.stress` takes 10 to 25 minutes on two cores. It prints its tables, writes them to
`benchmarks/results/stress.json`, and draws the growth of errors in `docs/images/predictability.png`. It ends with an
error if any shot breaks a rule. With `--address` a Ray cluster plays, and the results of finished parts are kept in
`runs/stress` until the end, so the same command continues.
"""

from __future__ import annotations

import argparse
import io
import os
import shutil
import sys
import time
import zlib
from concurrent.futures import Executor, Future, ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from benchmarks import RESULTS, check_counts, machine, machine_line, print_blocks, table
from billiards_env.files import write_json, write_whole
from cluster import ROOT, RayExecutor
from reference.stress import families, measure

IMAGE = Path(__file__).resolve().parent.parent / "docs" / "images" / "predictability.png"

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


def long_runs(pool: Executor, scale: float) -> dict[str, Any]:
    """Measures drift, time reversal, the blocks of pi and chaos."""
    drifts = [pool.submit(measure.drift, n, round(1e6 * scale)) for n in (100, 16, 2)]
    reversals = [pool.submit(measure.reversal, seed) for seed in range(round(1000 * scale) or 10)]
    digits = range(6 if scale == 1 else 4)
    blocks = {(wall, k): pool.submit(measure.blocks, k, wall) for wall in ("cushion", "ball") for k in digits}
    exponents = [pool.submit(measure.lyapunov, seed) for seed in range(round(50 * scale) or 3)]
    runs = [r.result() for r in tqdm(reversals, unit="reversal")]
    ratios = [r["error"] / r["predicted"] for r in runs if r["predicted"] < 1e-4]
    chaos = [e.result() for e in exponents]
    return {
        "drift": [d.result() for d in reversed(drifts)],
        "reversal": {
            "runs": len(runs),
            "within_1e-4_m": len(ratios),
            "median_collisions": float(np.median([r["collisions"] for r in runs])),
            "median_error_m": float(np.median([r["error"] for r in runs])),
            "median_ratio": float(np.median(ratios)),
            "p99_ratio": float(np.quantile(ratios, 0.99)),
        },
        "blocks": {wall: [blocks[wall, k].result() for k in digits] for wall in ("cushion", "ball")},
        "lyapunov": {
            key: {"mean": float(np.mean([c[key] for c in chaos])), "sd": float(np.std([c[key] for c in chaos]))}
            for key in chaos[0]
        },
    }


def growth(pool: Executor, shots: int) -> dict[str, list[dict[str, Any]]]:
    """Measures the growth of the error from collision to collision in a gas and in breaks, against 50 digits."""
    futures: dict[str, list[Future[dict[str, Any]]]] = {}
    gas = measure.gas(16)
    for seed in range(shots):
        state = measure.gas_state(gas, np.random.default_rng(seed))
        futures.setdefault("gas of 16", []).append(pool.submit(measure.predictability, gas, *state, 120))
        for layout in ("rack", "tight_rack"):
            shot = measure.break_shot(layout, seed)
            name = {"rack": "break, loose rack", "tight_rack": "break, tight rack"}[layout]
            futures.setdefault(name, []).append(pool.submit(measure.predictability, *shot, 1000))
    return {name: [f.result() for f in several] for name, several in futures.items()}


def draw_growth(curves: dict[str, list[dict[str, Any]]]) -> None:
    """Draws the errors against the number of collisions."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.5, 4.2), layout="constrained")
    axes = figure.add_subplot()
    for (name, several), colour in zip(curves.items(), ("#0072b2", "#d55e00", "#009e73"), strict=True):
        longest = max(len(c[key]) for c in several for key in ("errors", "predicted"))
        for key, style in (("errors", "-"), ("predicted", ":")):
            grid = np.full((len(several), longest), np.nan)
            for row, c in zip(grid, several, strict=True):
                row[: len(c[key])] = c[key]
            counts = (~np.isnan(grid)).sum(axis=0)
            enough = counts >= max(1, len(several) // 3)
            median = [float(np.nanmedian(grid[:, k])) if enough[k] else np.nan for k in range(longest)]
            if not any(enough):  # no amplification if balls meet at the same instant
                continue
            label = f"{name}: {'error' if key == 'errors' else 'amplified roundoff'}"
            axes.semilogy(np.arange(1, longest + 1), np.maximum(median, 1e-18), style, color=colour, label=label)
    axes.axhline(0.03, color="#555555", linewidth=0.8)
    axes.text(1, 0.036, "radius of a ball", color="#555555", fontsize=8)
    axes.set_xlabel("ball-ball collisions on the table")
    axes.set_ylabel("error of a position, m (median)")
    axes.set_ylim(1e-17, 1)
    axes.legend(fontsize=8, frameon=False)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=130, metadata={"Software": None})
    write_whole(IMAGE, buffer.getvalue())


def horizon(curves: list[dict[str, Any]]) -> dict[str, Any]:
    """Returns the number of correctly predicted collisions and the last error."""
    radius = 0.03
    lost = [next((k for k, e in enumerate(c["errors"]) if e > 1e-3 * radius), None) for c in curves]
    known = [k for k in lost if k is not None]
    return {
        "shots": len(curves),
        "median_same_collisions": float(np.median([c["agree"] for c in curves])),
        "whole": sum(c["agree"] == c["all"] for c in curves),
        "median_collisions_to_1e-3_radius": float(np.median(known)) if known else None,
        "reached_1e-3_radius": len(known),
        "median_last_error_m": float(np.median([c["errors"][-1] for c in curves if c["errors"]])),
    }


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
    runs = data["long_runs"]
    drift = [
        (
            f"{d['disks']} disks",
            f"{d['collisions']:,}",
            f"{d['energy_drift']:.1e}",
            f"{d['momentum_drift']:.1e}",
            f"{d['deepest_overlap_m']:.1e}",
        )
        for d in runs["drift"]
    ]
    return {
        "machine": machine_line(data["machine"]),
        "summary": f"{bad:,} of {shots:,} shots broke a rule. The deepest overlap of two balls was "
        f"{worst['overlap']:.1e} m, the largest relative rise of the energy {worst['rise']:.1e}.",
        "shots": table(head, [(name, *cells) for name, cells in rows]),
        "drift": table(("elastic gas", "collisions", "energy drift", "momentum drift", "deepest overlap, m"), drift),
        "long_runs": "\n".join(_long_runs(data)),
    }


def _row(s: dict[str, Any], bad: int) -> tuple[str, ...]:
    worst = (f"{s[key]:.1e}" for key in ("overlap", "outside", "rise", "momentum"))
    return f"{s['shots']:,}", f"{bad}", *worst, f"{s['contact_rule']:,}", f"{s['most_events']:,}"


def _long_runs(data: dict[str, Any]) -> list[str]:
    """Returns the results without a table, one line each."""
    runs = data["long_runs"]
    r, chaos = runs["reversal"], runs["lyapunov"]
    lines = [
        f"* Reversed motion, {r['runs']} gases of 16 disks, {r['median_collisions']:.0f} collisions each way: "
        f"median error {r['median_error_m']:.1e} m, {r['median_ratio']:.2f} times the amplified roundoff "
        f"(99th percentile {r['p99_ratio']:.1f}).",
        f"* Blocks of mass 1 and 100^k at a wall: {', '.join(map(str, runs['blocks']['cushion']))} collisions; "
        f"with a ball of infinite mass as the wall {', '.join(map(str, runs['blocks']['ball']))}.",
        f"* Lyapunov exponent of the gas: {chaos['two_trajectories']['mean']:.2f} / s from two trajectories, "
        f"{chaos['sensitivity']['mean']:.2f} / s from the sensitivity, at "
        f"{chaos['collisions_per_second']['mean']:.0f} collisions per second.",
    ]
    for name, h in data["predictability"].items():
        reached = h["median_collisions_to_1e-3_radius"]
        far = (
            ""
            if reached is None
            else f"; error of 1e-3 radii after {reached:.0f} (in {h['reached_1e-3_radius']} shots)"
        )
        lines.append(
            f"* Collisions as in the reference, {name}: {h['median_same_collisions']:.0f} "
            f"(median of {h['shots']}); error at the last one {h['median_last_error_m']:.1e} m{far}."
        )
    return lines


def _version() -> str:
    """Returns a name that changes with the code that the shots run."""
    files = sorted(path for package in ("billiards_env", "reference") for path in (ROOT / package).rglob("*.py"))
    return f"{zlib.crc32(b''.join(path.read_bytes() for path in files)):08x}"


def main(arguments: list[str] | None = None) -> None:
    """Runs all measurements, prints and writes the results."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.stress", description="Run and check millions of shots.")
    parser.add_argument(
        "--scale", type=float, default=1.0, help="share of the shots (1); nothing is written if it is less than 1"
    )
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1, help="processes (one per core)")
    parser.add_argument("--address", help='address of a Ray cluster that plays, e.g. "auto" (default: this machine)')
    args = parser.parse_args(arguments)
    check_counts(parser, args, workers=1)
    if not 0 < args.scale <= 1:
        parser.error(f"--scale = {args.scale}: expected a number in (0, 1]")
    for family in ("pool, 1 object ball", "pool, 5 object balls"):
        families.run(family, 0, 1)  # compiles the kernels once, for all processes
    started = time.perf_counter()
    kept = ROOT / "runs" / "stress" / _version()
    with ProcessPoolExecutor(args.workers) if args.address is None else RayExecutor(args.address, kept) as pool:
        shots = random_shots(pool, args.scale)
        runs = long_runs(pool, args.scale)
        curves = growth(pool, 30 if args.scale == 1 else 3)
    shutil.rmtree(kept, ignore_errors=True)
    data = {
        "command": "python -m benchmarks.stress",
        "machine": machine(),
        "minutes": round((time.perf_counter() - started) / 60, 1),
        "shots": shots,
        "long_runs": runs,
        "predictability": {name: horizon(c) for name, c in curves.items()},
    }
    print_blocks(blocks(data))
    if args.scale == 1:
        write_json(RESULTS / "stress.json", data)
        draw_growth(curves)
    bad = sum(len(s["bad"]) for s in shots.values())
    if bad:
        sys.exit(f"{bad} shots broke a rule; their (seed, index, status) are in the results")


if __name__ == "__main__":
    main()
