"""Run time against the number of balls: `python -m benchmarks.growth`.

An elastic gas of 2 to 10,000 disks at constant density: the table grows with the number of disks. All engines run the
same shots in turn, in one process and on one core. Engines whose cost grows with the square of the number stop at a
smaller number. Each disk has about the same number of collisions for any number of disks, so a constant cost per event
is a flat line. PIC runs as in `simulate`, which tests all pairs below `MANY_BALLS` balls and uses a grid from there.
Both variants are also measured separately, which shows the number of disks from which the grid is faster.
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

from benchmarks import RESULTS, check_counts, machine, machine_line, others, print_blocks, table
from benchmarks.convergence import PIT_STYLES
from benchmarks.figures import IMAGES, save
from benchmarks.methods import LEAST_SECONDS, PIC, Floats, Method, run_all, timer
from billiards_env.engine import pic
from billiards_env.engine.inputs import check_shot
from billiards_env.engine.log import empty_log
from billiards_env.engine.modes import MANY_BALLS, MAX_EVENTS, scene_arrays
from billiards_env.engine.shots import empty_shots
from billiards_env.files import write_json
from billiards_env.scene import Balls, Physics, Scene
from billiards_env.table import Table

DISKS = sorted([*(2**k for k in range(1, 13)), 96, 10_000])
SHARE = 0.1
"""Share of the table's area covered by disks."""
RADIUS, MASS = 0.028575, 0.170097  # m, kg: pool balls
SECONDS = 2.0  # simulated
SPEED = 1.0  # m/s, root mean square along each axis
STEPS = (60, 960)  # of PIT, per second
GROWS_FROM = MANY_BALLS  # disks
ALL_PAIRS, GRID = "PIC, all pairs", "PIC, grid"
MOST = {"PIT, 1/60 s": 1024, "PIT, 1/960 s": 1024, "python-billiards": 256, ALL_PAIRS: 256, GRID: 256}
"""The largest number of disks of each method; PIC has no limit."""


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


def methods() -> list[Method]:
    """Returns the methods that are measured through the public interface."""
    found = [PIC, *(Method("PIT", steps, "push_apart") for steps in STEPS)]
    return found + [Method(name) for name in others.available() if not others.has_timestep(name)]


def label(method: Method) -> str:
    """Returns the name of a method in the tables."""
    return method.name + (f", 1/{method.steps} s" if method.steps else "")


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


def timers(scene: Scene, positions: Floats, velocities: Floats) -> dict[str, Callable[[], float]]:
    """Returns functions by name that run the shots and return the seconds per shot."""
    n, given = scene.n_balls, (scene, positions, velocities)
    found = {label(m): timer(*given, m) for m in methods() if n <= MOST.get(label(m), n)}
    for name, engine in ((ALL_PAIRS, pic.run_shots), (GRID, pic.run_shots_of_many)):
        if n <= MOST[name]:
            found[name] = kernel_timer(engine, *given)
    return found


def measure(disks: list[int], passes: int) -> dict[str, Any]:
    """Runs all measurements.

    Args:
        disks: Numbers of disks.
        passes: Repetitions; the methods take turns in each pass.

    Returns:
        `rows`, one for each number of disks: the events per shot, and by method the microseconds per shot and the ratio
        to PIC (medians over the passes). `all_pairs_over_grid` is the ratio of the two variants of PIC.
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
        "grid_from": MANY_BALLS,
        "rows": rows,
    }


def slope(rows: list[dict[str, Any]], name: str) -> float | None:
    """Returns the exponent of the growth of a method's time per event from `GROWS_FROM` disks; None if unknown."""
    large = [row for row in rows if row["disks"] >= GROWS_FROM and name in row["us_per_shot"]]
    if len(large) < 2:
        return None
    disks, us = np.log([(row["disks"], row["us_per_shot"][name] / row["events_per_shot"]) for row in large]).T
    return float(np.polyfit(disks, us, 1)[0])


def crossover(rows: list[dict[str, Any]]) -> int | None:
    """Returns the smallest number of disks from which the grid is never slower; None if it does not exist."""
    known = [row for row in rows if "all_pairs_over_grid" in row]
    slower = max((k for k, row in enumerate(known) if row["all_pairs_over_grid"] < 1), default=-1)
    return known[slower + 1]["disks"] if slower + 1 < len(known) else None


def blocks(result: dict[str, Any]) -> dict[str, str]:
    """Returns the results as Markdown, by name."""
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
        f"{result['grid_from']} on."
        if cross
        else f"The grid is not faster with these numbers of disks. PIC uses it from {result['grid_from']} on.",
        "summary": f"PIC uses them from {result['grid_from']} balls on. An event takes {first:.2g} us with "
        f"{few['disks']:,} disks and {last:.2g} us with {many['disks']:,}.",
    }


def draw(result: dict[str, Any], path: Path) -> None:
    """Draws the run time of a shot and of an event against the number of disks."""
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
        measured = [row for row in rows if name in row["us_per_shot"]]
        disks = [row["disks"] for row in measured]
        us = np.array([row["us_per_shot"][name] for row in measured])
        events = np.array([row["events_per_shot"] for row in measured])
        left.loglog(disks, us / 1e6, **style, label=name)
        right.loglog(disks, us / events, **style)
    left.set(xlabel="disks", ylabel="run time of a shot (s)")
    left.set_title(f"{result['seconds_simulated']:g} s of an elastic gas at one density", fontsize=10)
    right.set(xlabel="disks", ylabel="run time per event of PIC (us)")
    right.set_title("Run time per event", fontsize=10)
    ticks = [row["disks"] for row in rows if math.log2(row["disks"]) % 2 == 1 or row is rows[-1]]
    for axes in (left, right):
        axes.set_xticks(ticks, [f"{n:,}" for n in ticks], minor=False)
        axes.minorticks_off()
        axes.grid(alpha=0.3)
        axes.axvline(result["grid_from"], color="#888888", linewidth=0.8, linestyle="--")
    foot = {"fontsize": 8, "color": "#555555", "transform": right.get_xaxis_transform(), "va": "bottom"}
    right.text(result["grid_from"] * 1.1, 0.02, "PIC uses a grid from here", **foot)
    left.legend(fontsize=8)
    save(figure, path)


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m benchmarks.growth --help`."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.growth", description="Run time against the number of balls."
    )
    parser.add_argument("--passes", type=int, default=5, help="number of passes (5)")
    parser.add_argument("--most", type=int, default=DISKS[-1], help=f"largest number of disks ({DISKS[-1]:,})")
    parser.add_argument("--output", type=Path, default=RESULTS / "growth.json", help="JSON file")
    parser.add_argument("--picture", type=Path, default=IMAGES / "growth.png", help="picture file")
    args = parser.parse_args(arguments)
    check_counts(parser, args, passes=1, most=2)
    result = measure([n for n in DISKS if n <= args.most], args.passes)
    write_json(args.output, result)
    draw(result, args.picture)
    print_blocks(blocks(result))
    print(f"\nWritten to {args.output} and {args.picture}.")


if __name__ == "__main__":
    main()
