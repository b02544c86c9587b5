"""Run time and events against the number of balls: `python -m benchmarks.growth`.

An elastic gas of 2 to 256 disks at one density: the table grows with the number of disks. All engines run the same
shots in turn, in one process and on one core.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from benchmarks import RESULTS, machine, others, print_machine, print_table
from benchmarks.convergence import PIT_STYLES
from benchmarks.figures import IMAGES, save
from benchmarks.methods import PIC, Floats, Method, run_all, timer
from billiards_env import layouts
from billiards_env.files import write_json
from billiards_env.scene import Balls, Physics, Scene, Table

DISKS = [2**k for k in range(1, 9)]
SHARE = 0.1
"""Of the table's area that is covered by disks."""
RADIUS, MASS = 0.028575, 0.170097  # m, kg: pool balls
SECONDS = 2.0  # simulated
SPEED = 1.0  # m/s, root mean square along each axis
STEPS = (60, 960)  # of PIT, per second


def gas(n: int) -> Scene:
    """Elastic, frictionless disks on a table twice as long as wide."""
    width = math.sqrt(n * math.pi * RADIUS**2 / SHARE / 2)
    physics = Physics(motion="ideal", cushion="restitution", e_ball=1.0, e_cushion=1.0, max_time=SECONDS)
    return Scene(Balls((RADIUS,) * n, (MASS,) * n), Table(2 * width, width), physics)


def shots(scene: Scene, count: int) -> tuple[Floats, Floats]:
    """Random starts that do not overlap, (count, n, 2) m, and velocities, m/s."""
    rng = np.random.default_rng(scene.n_balls)
    positions = np.array([layouts.random(scene, rng) for _ in range(count)])
    return positions, rng.normal(0.0, SPEED, positions.shape)


def methods() -> list[Method]:
    """What is measured."""
    found = [PIC, *(Method("PIT", steps, "push_apart") for steps in STEPS)]
    return found + [Method(name) for name in others.available() if not others.has_timestep(name)]


def label(method: Method) -> str:
    """What the table calls a method."""
    return method.name + (f", 1/{method.steps} s" if method.steps else "")


def measure(disks: list[int], passes: int) -> dict[str, Any]:
    """Events a shot, and microseconds a shot by each method (medians of `passes`), for each number of disks."""
    on, rows = machine(), []
    for n in tqdm(disks, unit="gas"):
        scene = gas(n)
        positions, velocities = shots(scene, max(2, 128 // n))
        events = run_all(scene, positions, velocities, PIC).n_events
        calls = {label(m): timer(scene, positions, velocities, m) for m in methods()}
        times = [{name: call() for name, call in calls.items()} for _ in range(passes)]
        us = {name: 1e6 * float(np.median([t[name] for t in times])) for name in calls}
        rows.append({"disks": n, "events_per_shot": float(events.mean()), "us_per_shot": us})
    return {"machine": on, "versions": others.versions(), "passes": passes, "seconds_simulated": SECONDS, "rows": rows}


def slope(rows: list[dict[str, Any]], name: str) -> float:
    """The exponent with which the run time of a method grows from 16 disks on."""
    large = [row for row in rows if row["disks"] >= 16]
    disks, us = np.log([(row["disks"], row["us_per_shot"][name]) for row in large]).T
    return float(np.polyfit(disks, us, 1)[0])


def draw(result: dict[str, Any], path: Path) -> None:
    """Run time a shot and a collision against the number of disks."""
    from matplotlib.figure import Figure

    styles: dict[str, dict[str, Any]] = {
        "PIC": {"color": "black", "marker": "*", "markersize": 10},
        "PIT, 1/60 s": PIT_STYLES["push_apart"],
        "PIT, 1/960 s": PIT_STYLES["push_apart"] | {"linestyle": "--", "markerfacecolor": "white"},
        "python-billiards": {"color": "#56b4e9", "marker": "P"},
    }
    figure = Figure(figsize=(9.5, 4), dpi=110, layout="constrained")
    left, right = figure.subplots(1, 2)
    rows = result["rows"]
    disks = [row["disks"] for row in rows]
    for name in rows[0]["us_per_shot"]:
        us = np.array([row["us_per_shot"][name] for row in rows])
        events = np.array([row["events_per_shot"] for row in rows])
        left.loglog(disks, us / 1e6, **styles[name], label=f"{name}: n^{slope(rows, name):.2f}")
        right.loglog(disks, us / events, **styles[name], label=name)
    left.set(xlabel="disks", ylabel="run time of a shot (s)")
    left.set_title(f"{result['seconds_simulated']:g} s of an elastic gas at one density", fontsize=10)
    right.set(xlabel="disks", ylabel="run time (us for each of PIC's collisions)")
    right.set_title("The same for each collision", fontsize=10)
    for axes in (left, right):
        axes.set_xticks(disks, [str(n) for n in disks], minor=False)
        axes.minorticks_off()
        axes.grid(alpha=0.3)
    left.legend(fontsize=8, title="growth from 16 disks on")
    save(figure, path)


def main(arguments: list[str] | None = None) -> None:
    """The command line; see `python -m benchmarks.growth --help`."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.growth", description="Run time against the number of balls."
    )
    parser.add_argument("--passes", type=int, default=5, help="repeats (5)")
    parser.add_argument("--most", type=int, default=DISKS[-1], help=f"largest number of disks ({DISKS[-1]})")
    parser.add_argument("--output", type=Path, default=RESULTS / "growth.json", help="where the JSON goes")
    parser.add_argument("--picture", type=Path, default=IMAGES / "growth.png", help="where the picture goes")
    args = parser.parse_args(arguments)
    for name, least in (("passes", 1), ("most", 32)):
        if getattr(args, name) < least:
            parser.error(f"--{name} = {getattr(args, name)}: expected a whole number >= {least}")
    result = measure([n for n in DISKS if n <= args.most], args.passes)
    write_json(args.output, result)
    draw(result, args.picture)

    rows = result["rows"]
    names = list(rows[0]["us_per_shot"])
    print_machine(result["machine"])
    print(f"{SECONDS:g} s of an elastic gas, disks on {SHARE:.0%} of the table; us/shot on one core.\n")
    lines = [
        [
            f"{row['disks']}",
            f"{row['events_per_shot']:,.0f}",
            *(f"{row['us_per_shot'][name]:,.0f}" for name in names),
            f"{row['us_per_shot']['PIC'] / row['events_per_shot']:.2f}",
        ]
        for row in rows
    ]
    lines.append(["grows as", "", *(f"n^{slope(rows, name):.2f}" for name in names), ""])
    print_table(["disks", "events", *names, "PIC, us/event"], lines)
    print(f"\nGrowth from 16 disks on. Written to {args.output} and {args.picture}.")


if __name__ == "__main__":
    main()
