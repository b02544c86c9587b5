"""Run time against the number of balls: `python -m benchmarks.growth`.

An elastic gas of 2 to 10,000 disks at one density: the table grows with the number of disks. All engines run the same
shots in turn, in one process and on one core; those whose cost grows with the square of the number leave off where it
gets too long. Each disk has about as many collisions whatever their number, so an engine whose cost for each event does
not grow gives a flat line. PIC is run as `simulate` runs it, which goes over from `engine.pic`, where each ball is
tested against all others, to the grid of `engine.crowd` at `engine.shot.MANY_BALLS` balls; beside it both run by themselves,
which shows where that pays.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from benchmarks import RESULTS, machine, machine_line, others, print_blocks, table
from benchmarks.ablation import RunShots, run
from benchmarks.convergence import PIT_STYLES
from benchmarks.figures import IMAGES, save
from benchmarks.methods import LEAST_SECONDS, PIC, Floats, Method, run_all, timer
from benchmarks.speed import Case
from billiards_env.engine import crowd, pic
from billiards_env.engine.modes import MANY_BALLS
from billiards_env.files import write_json
from billiards_env.scene import Balls, Physics, Scene, Table

DISKS = sorted([*(2**k for k in range(1, 13)), 96, 10_000])
SHARE = 0.1
"""Of the table's area that is covered by disks."""
RADIUS, MASS = 0.028575, 0.170097  # m, kg: pool balls
SECONDS = 2.0  # simulated
SPEED = 1.0  # m/s, root mean square along each axis
STEPS = (60, 960)  # of PIT, per second
GROWS_FROM = MANY_BALLS  # disks
ALL_PAIRS, GRID = "PIC, all pairs", "PIC, grid"
MOST = {"PIT, 1/60 s": 1024, "PIT, 1/960 s": 1024, "python-billiards": 256, ALL_PAIRS: 256, GRID: 256}
"""The largest number of disks that each is run with; PIC runs with any."""


def gas(n: int) -> Scene:
    """Elastic, frictionless disks on a table twice as long as wide."""
    width = math.sqrt(n * math.pi * RADIUS**2 / SHARE / 2)
    physics = Physics(motion="ideal", cushion="restitution", e_ball=1.0, e_cushion=1.0, max_time=SECONDS)
    return Scene(Balls((RADIUS,) * n, (MASS,) * n), Table(2 * width, width), physics)


def shots(scene: Scene, count: int) -> tuple[Floats, Floats]:
    """Random starts, (count, n, 2) m, and velocities, m/s: each disk anywhere in a square of its own of a lattice."""
    n, rng = scene.n_balls, np.random.default_rng(scene.n_balls)
    rows = math.ceil(math.sqrt(n / 2))
    columns = math.ceil(n / rows)
    square = np.array([scene.table.length / columns, scene.table.width / rows])
    sites = np.stack(np.divmod(np.arange(columns * rows), rows), axis=1) + 0.5
    taken = np.array([sites[rng.permutation(len(sites))[:n]] for _ in range(count)])
    corner = np.array([scene.table.length, scene.table.width]) / 2
    room = square / 2 - 1.001 * RADIUS
    return taken * square - corner + room * rng.uniform(-1, 1, taken.shape), rng.normal(0.0, SPEED, taken.shape)


def methods() -> list[Method]:
    """What is measured through the engines' interface."""
    found = [PIC, *(Method("PIT", steps, "push_apart") for steps in STEPS)]
    return found + [Method(name) for name in others.available() if not others.has_timestep(name)]


def label(method: Method) -> str:
    """What the tables call a method."""
    return method.name + (f", 1/{method.steps} s" if method.steps else "")


def kernel_timer(engine: RunShots, scene: Scene, positions: Floats, velocities: Floats) -> Callable[[], float]:
    """What runs shots by a `run_shots`, unchecked, and gives the processor time of one of them, s."""

    def call(copies: int = 1) -> float:
        many = np.tile(positions, (copies, 1, 1)), np.tile(velocities, (copies, 1, 1))
        return run(engine, Case("", scene, *many))[0] / len(many[0])

    call()  # compiles
    copies = max(1, round(LEAST_SECONDS / (call() * len(positions))))
    return lambda: call(copies)


def timers(scene: Scene, positions: Floats, velocities: Floats) -> dict[str, Callable[[], float]]:
    """What runs the shots and gives the seconds for one, by name."""
    n, given = scene.n_balls, (scene, positions, velocities)
    found = {label(m): timer(*given, m) for m in methods() if n <= MOST.get(label(m), n)}
    for name, engine in ((ALL_PAIRS, pic.run_shots), (GRID, crowd.run_shots)):
        if n <= MOST[name]:
            found[name] = kernel_timer(engine, *given)
    return found


def measure(disks: list[int], passes: int) -> dict[str, Any]:
    """Runs everything.

    Args:
        disks: Numbers of disks.
        passes: Repeats; the methods take turns in each.

    Returns:
        `rows`, one for each number of disks: events a shot, and by method the microseconds a shot and the ratio to
        PIC's (medians over the passes); `all_pairs_over_grid`, the ratio of the two ways to run PIC.
    """
    on, rows = machine(), []
    for n in tqdm(disks, unit="gas"):
        scene = gas(n)
        positions, velocities = shots(scene, max(1, 128 // n))
        events = run_all(scene, positions, velocities, PIC).n_events
        calls = timers(scene, positions, velocities)
        seconds = {name: [] for name in calls}
        for _ in range(passes):
            for name, call in calls.items():
                seconds[name].append(call())
        row: dict[str, Any] = {
            "disks": n,
            "events_per_shot": float(events.mean()),
            "us_per_shot": {name: 1e6 * float(np.median(s)) for name, s in seconds.items()},
            "over_pic": {name: float(np.median(np.divide(s, seconds["PIC"]))) for name, s in seconds.items()},
        }
        if ALL_PAIRS in seconds:
            row["all_pairs_over_grid"] = float(np.median(np.divide(seconds[ALL_PAIRS], seconds[GRID])))
        rows.append(row)
    return {
        "machine": on,
        "versions": others.versions(),
        "passes": passes,
        "seconds_simulated": SECONDS,
        "share": SHARE,
        "crowd": MANY_BALLS,
        "rows": rows,
    }


def slope(rows: list[dict[str, Any]], name: str) -> float | None:
    """The exponent with which a method's time for each event grows from `GROWS_FROM` disks on; None if unknown."""
    large = [row for row in rows if row["disks"] >= GROWS_FROM and name in row["us_per_shot"]]
    if len(large) < 2:
        return None
    disks, us = np.log([(row["disks"], row["us_per_shot"][name] / row["events_per_shot"]) for row in large]).T
    return float(np.polyfit(disks, us, 1)[0])


def crossover(rows: list[dict[str, Any]]) -> int | None:
    """The number of disks from which on the grid is never the slower way; None if there is none."""
    known = [row for row in rows if "all_pairs_over_grid" in row]
    slower = max((k for k, row in enumerate(known) if row["all_pairs_over_grid"] < 1), default=-1)
    return known[slower + 1]["disks"] if slower + 1 < len(known) else None


def blocks(result: dict[str, Any]) -> dict[str, str]:
    """What was measured as Markdown, by name."""
    rows = result["rows"]
    names = list(rows[0]["us_per_shot"])
    per_event, ratios = [], []
    for row in rows:
        us, over = row["us_per_shot"], row["over_pic"]
        per_event.append(
            (
                f"{row['disks']:,}",
                f"{row['events_per_shot']:,.0f}",
                *(f"{us[name] / row['events_per_shot']:,.2f}" if name in us else "" for name in names),
            )
        )
        both = row.get("all_pairs_over_grid")
        ratios.append(
            (
                f"{row['disks']:,}",
                *(f"{over[name]:,.2f}" if name in over else "" for name in names[1:]),
                "" if both is None else f"{both:.2f}",
            )
        )
    exponents = [slope(rows, name) for name in names]
    per_event.append(("grows as", "", *("" if e is None else f"n^{e:.2f}" for e in exponents)))
    few, many, cross = rows[0], rows[-1], crossover(rows)
    first, last = (row["us_per_shot"]["PIC"] / row["events_per_shot"] for row in (few, many))
    return {
        "machine": machine_line(result["machine"]),
        "how": f"{result['seconds_simulated']:g} s of an elastic gas, disks on {result['share']:.0%} of the table; one "
        f"core; medians of {result['passes']} interleaved passes. An event is an event of PIC. The last row is the "
        f"growth from {GROWS_FROM} disks on.",
        "events": table(("us/event", "events", *names), per_event),
        "ratios": table(("time / PIC", *names[1:], "all pairs over grid"), ratios),
        "crossover": f"Among these numbers of disks the grid is faster from {cross} on. PIC uses it from "
        f"{result['crowd']} on."
        if cross
        else f"The grid is not faster with these numbers of disks. PIC uses it from {result['crowd']} on.",
        "summary": f"PIC uses them from {result['crowd']} balls on. An event takes {first:.2g} us with "
        f"{few['disks']:,} disks and {last:.2g} us with {many['disks']:,}.",
    }


def draw(result: dict[str, Any], path: Path) -> None:
    """Run time of a shot and of an event against the number of disks."""
    from matplotlib.figure import Figure

    styles: dict[str, dict[str, Any]] = {
        "PIC": {"color": "black", "marker": "*", "markersize": 9, "zorder": 3},
        ALL_PAIRS: {"color": "#888888", "marker": "x", "linestyle": ":", "markersize": 5},
        "PIT, 1/60 s": PIT_STYLES["push_apart"],
        "PIT, 1/960 s": PIT_STYLES["push_apart"] | {"linestyle": "--", "markerfacecolor": "white"},
        "python-billiards": {"color": "#56b4e9", "marker": "P"},
    }
    figure = Figure(figsize=(9.5, 4.2), dpi=110, layout="constrained")
    left, right = figure.subplots(1, 2)
    rows = result["rows"]
    for name, style in styles.items():
        mine = [row for row in rows if name in row["us_per_shot"]]
        disks = [row["disks"] for row in mine]
        us = np.array([row["us_per_shot"][name] for row in mine])
        events = np.array([row["events_per_shot"] for row in mine])
        left.loglog(disks, us / 1e6, **style, label=name)
        right.loglog(disks, us / events, **style)
    left.set(xlabel="disks", ylabel="run time of a shot (s)")
    left.set_title(f"{result['seconds_simulated']:g} s of an elastic gas at one density", fontsize=10)
    right.set(xlabel="disks", ylabel="run time for each of PIC's events (us)")
    right.set_title("The same for each event", fontsize=10)
    ticks = [row["disks"] for row in rows if math.log2(row["disks"]) % 2 == 1 or row is rows[-1]]
    for axes in (left, right):
        axes.set_xticks(ticks, [f"{n:,}" for n in ticks], minor=False)
        axes.minorticks_off()
        axes.grid(alpha=0.3)
        axes.axvline(result["crowd"], color="#888888", linewidth=0.8, linestyle="--")
    foot = {"fontsize": 8, "color": "#555555", "transform": right.get_xaxis_transform(), "va": "bottom"}
    right.text(result["crowd"] * 1.1, 0.02, "PIC: a grid from here on", **foot)
    left.legend(fontsize=8)
    save(figure, path)


def main(arguments: list[str] | None = None) -> None:
    """The command line; see `python -m benchmarks.growth --help`."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.growth", description="Run time against the number of balls."
    )
    parser.add_argument("--passes", type=int, default=5, help="repeats (5)")
    parser.add_argument("--most", type=int, default=DISKS[-1], help=f"largest number of disks ({DISKS[-1]:,})")
    parser.add_argument("--output", type=Path, default=RESULTS / "growth.json", help="where the JSON goes")
    parser.add_argument("--picture", type=Path, default=IMAGES / "growth.png", help="where the picture goes")
    args = parser.parse_args(arguments)
    for name, least in (("passes", 1), ("most", 2)):
        if getattr(args, name) < least:
            parser.error(f"--{name} = {getattr(args, name)}: expected a whole number >= {least}")
    result = measure([n for n in DISKS if n <= args.most], args.passes)
    write_json(args.output, result)
    draw(result, args.picture)
    print_blocks(blocks(result))
    print(f"\nWritten to {args.output} and {args.picture}.")


if __name__ == "__main__":
    main()
