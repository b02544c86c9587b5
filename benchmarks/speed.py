"""How fast shots run: `python -m benchmarks.speed`.

The cases are measured in turn, over and over, in one process, so that whatever else the machine does falls on all of
them alike; medians are reported, with the quartiles beside them in the JSON. Every case is drawn from a fixed seed.
Shots per second are those of `simulate_batch(..., threads=1)`: its checks are part of the time, the drawing of the
layouts is not.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

import billiards_env  # noqa: F401  (registers the environment)
from agents.files import write_json
from benchmarks import RESULTS, machine, machine_line, print_blocks, table
from billiards_env import layouts
from billiards_env.engine import STATUS, simulate, simulate_batch
from billiards_env.envs.billiards import cue_velocity
from billiards_env.scene import Scene

MAX_SPEED = 4.0  # m/s, of a random shot: the environment's default
BREAK_SPEED = 8.0  # m/s, of the cue ball in a break
BREAK_SPREAD = math.radians(1)  # largest angle by which a break misses the middle of the first ball
GAS_SPEED = 1.0  # m/s, root mean square along each axis
N_SINGLES = 1000  # shots run one at a time

Floats = NDArray[np.float64]


class Case(NamedTuple):
    """Shots to run, m of them with n balls.

    Attributes:
        name: What the table calls them.
        scene: The scene.
        positions: (m, n, 2) m.
        velocities: (m, n, 2) or (m, 2) m/s.
    """

    name: str
    scene: Scene
    positions: Floats
    velocities: Floats


def cases(scale: float = 1.0) -> list[Case]:
    """The cases, with so many shots each that one pass takes about a tenth of a second, times `scale`."""

    def count(shots: int) -> int:
        return max(1, round(shots * scale))

    return [
        random_shots("pool, 1 object ball", Scene.named("pool", 1), count(16_000)),
        random_shots("pool, 5 object balls", Scene.named("pool", 5), count(4000)),
        random_shots("carom, 2 object balls", Scene.named("carom", 2), count(10_000)),
        breaks("15-ball break, loose rack", "rack", count(120)),
        breaks("15-ball break, tight rack", "tight_rack", count(60)),
        gas("ideal gas, 16 disks, 10 s", 16, count(100)),
    ]


def random_shots(name: str, scene: Scene, count: int) -> Case:
    """Random layouts, and shots as random actions of the environment give them."""
    rng = np.random.default_rng(0)
    positions = np.array([layouts.random(scene, rng) for _ in range(count)])
    velocities = np.array([cue_velocity(action, MAX_SPEED) for action in rng.uniform(-1, 1, (count, 2))])
    return Case(name, scene, positions, velocities)


def breaks(name: str, layout: str, count: int) -> Case:
    """Break shots at the first of 15 balls, from anywhere behind the head string."""
    rng = np.random.default_rng(0)
    scene = Scene.named("pool", 15)
    positions = np.array([layouts.draw(layout, scene, rng) for _ in range(count)])
    aim = positions[:, 1] - positions[:, 0]
    angle = np.arctan2(aim[:, 1], aim[:, 0]) + rng.uniform(-BREAK_SPREAD, BREAK_SPREAD, count)
    return Case(name, scene, positions, BREAK_SPEED * np.column_stack((np.cos(angle), np.sin(angle))))


def gas(name: str, n_balls: int, count: int) -> Case:
    """Frictionless, elastic disks that all move, for the 10 s that the scene lets them."""
    rng = np.random.default_rng(0)
    scene = Scene.named("ideal", n_balls - 1)
    positions = np.array([layouts.random(scene, rng) for _ in range(count)])
    return Case(name, scene, positions, rng.normal(0, GAS_SPEED, (count, n_balls, 2)))


def seconds(run: Callable[[], object]) -> float:
    """How long `run()` takes, s."""
    begin = perf_counter()
    run()
    return perf_counter() - begin


def summary(values: list[float]) -> dict[str, float]:
    """Median and quartiles."""
    low, middle, high = np.quantile(values, (0.25, 0.5, 0.75)).tolist()
    return {"median": middle, "lower_quartile": low, "upper_quartile": high}


def measure(repeats: int, scale: float = 1.0) -> dict[str, Any]:
    """Runs everything `repeats` times.

    Args:
        repeats: Number of passes over the cases.
        scale: Factor on the number of shots in a pass.

    Returns:
        `batch`: a list, an entry a case; `microseconds_per_call`: for the first case's shots one at a time;
        `two_threads_over_one`: ratios of shots per second.
    """
    on = machine()
    every = cases(scale)
    first = every[0]
    # More shots than a pass of one thread needs: starting threads must not be what is measured.
    many = first._replace(positions=np.tile(first.positions, (4, 1, 1)), velocities=np.tile(first.velocities, (4, 1)))
    few = first._replace(positions=first.positions[:N_SINGLES], velocities=first.velocities[:N_SINGLES])
    actions = (few.velocities / MAX_SPEED).astype(np.float32)
    n = len(actions)
    env = gym.make("Billiards-v0", max_speed=MAX_SPEED)
    env.reset(seed=0)
    env.step(actions[0])

    outcomes = [simulate_batch(c.scene, c.positions, c.velocities, threads=1) for c in every]  # compiles, warms up
    for case, outcome in zip(every, outcomes, strict=True):
        if (outcome.status == STATUS.index("event_limit")).any():
            raise RuntimeError(f"{case.name}: a shot was given up, its time says nothing")

    batch: list[list[float]] = [[] for _ in every]
    calls: dict[str, list[float]] = {"simulate_batch": [], "simulate": [], "env_step": [], "env_reset": []}
    threads: list[tuple[float, float]] = []
    for _ in range(repeats):
        for times, c in zip(batch, every, strict=True):
            times.append(seconds(lambda c=c: simulate_batch(c.scene, c.positions, c.velocities, threads=1)))
        calls["simulate_batch"].append(
            seconds(lambda: simulate_batch(few.scene, few.positions, few.velocities, threads=1)) / n
        )
        calls["simulate"].append(
            seconds(lambda: [simulate(few.scene, p, v) for p, v in zip(few.positions, few.velocities, strict=True)]) / n
        )
        stepping = 0.0
        for positions, action in zip(few.positions, actions, strict=True):
            env.reset(options={"positions": positions})
            begin = perf_counter()
            env.step(action)
            stepping += perf_counter() - begin
        calls["env_step"].append(stepping / n)
        calls["env_reset"].append(seconds(lambda: [env.reset() for _ in range(n)]) / n)
        one, two = (
            seconds(lambda t=t: simulate_batch(many.scene, many.positions, many.velocities, threads=t)) for t in (1, 2)
        )
        threads.append((one, two))

    rows = []
    for case, times, outcome in zip(every, batch, outcomes, strict=True):
        m, events = len(case.positions), int(outcome.n_events.sum())
        rows.append(
            {
                "case": case.name,
                "shots": m,
                "shots_per_second": summary([m / t for t in times]),
                "events_per_shot": events / m,
                "most_events": int(outcome.n_events.max()),
                "contact_rule_share": float((outcome.n_contact_rule > 0).mean()),
                "microseconds_per_event": summary([1e6 * t / events for t in times]),
                "seconds_simulated_per_shot": float(outcome.time.mean()),
            }
        )
    return {
        "machine": on,
        "repeats": repeats,
        "max_speed": MAX_SPEED,
        "break_speed": BREAK_SPEED,
        "batch": rows,
        "microseconds_per_call": {name: summary([1e6 * t for t in times]) for name, times in calls.items()},
        "two_threads_over_one": {
            **summary([one / two for one, two in threads]),
            "fastest": min(one for one, _ in threads) / min(two for _, two in threads),
        },
    }


def blocks(result: dict[str, Any]) -> dict[str, str]:
    """What was measured as Markdown, by name."""
    shots = [
        (
            row["case"],
            f"{row['shots_per_second']['median']:,.0f}",
            f"{row['events_per_shot']:.1f}",
            f"{row['most_events']}",
            f"{row['contact_rule_share']:.1%}",
            f"{row['microseconds_per_event']['median']:.2f}",
            f"{row['seconds_simulated_per_shot']:.1f}",
        )
        for row in result["batch"]
    ]
    per_call = {name: value["median"] for name, value in result["microseconds_per_call"].items()}
    inside = per_call["simulate_batch"]
    names = {"simulate_batch": "simulate_batch, per shot", "simulate": "simulate", "env_step": "env.step"}
    calls = [
        (name, f"{per_call[key]:.1f}", f"{per_call[key] - inside:.1f}", f"{per_call[key] / inside:.1f}")
        for key, name in names.items()
    ]
    calls.append(("env.reset", f"{per_call['env_reset']:.1f}", "", ""))
    ratio = result["two_threads_over_one"]
    return {
        "machine": machine_line(result["machine"]),
        "how": f"One core; medians of {result['repeats']} interleaved passes.",
        "shots": table(
            ("shots", "shots/s", "events/shot", "most", "contact rule", "us/event", "s simulated/shot"), shots
        ),
        "calls_of": f"The first case, one shot at a time ({N_SINGLES:,} shots):",
        "calls": table(("call", "us/call", "us above the batch's", "times the batch's"), calls),
        "threads": f"Two threads over one: {ratio['median']:.2f} times the shots per second, {ratio['fastest']:.2f} if "
        "the fastest pass of each is compared (a busy machine spoils the median).",
    }


def main(arguments: list[str] | None = None) -> None:
    """The command line; see `python -m benchmarks.speed --help`."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.speed", description="Measure how fast shots run.")
    parser.add_argument("--repeats", type=int, default=11, help="passes over the cases (default: 11)")
    parser.add_argument("--output", type=Path, default=RESULTS / "speed.json", help="where the JSON goes")
    args = parser.parse_args(arguments)
    if args.repeats < 1:
        parser.error(f"--repeats = {args.repeats}: expected a whole number >= 1")
    result = measure(args.repeats)
    write_json(args.output, result)

    print_blocks(blocks(result))
    print(f"\nWritten to {args.output}.")


if __name__ == "__main__":
    main()
