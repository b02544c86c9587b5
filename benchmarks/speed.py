"""How fast shots run: `python -m benchmarks.speed`.

The cases are measured in turn, over and over, in one process, so that whatever else the machine does falls on all of
them alike; medians are reported, with the quartiles beside them in the JSON. Every case is drawn from a fixed seed.
Shots per second are those of `simulate_batch(..., threads=1)`: its checks are part of the time, the drawing of the
layouts is not. What two threads make of it is compared with two processes that run the same shots side by side, each on
one thread: more than those get out of two cores the machine does not give at that moment.
"""

from __future__ import annotations

import argparse
import contextlib
import math
import multiprocessing
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

import billiards_env  # noqa: F401  (registers the environment)
from benchmarks import RESULTS, machine, machine_line, print_blocks, table
from billiards_env import layouts
from billiards_env.envs.billiards import cue_velocity
from billiards_env.files import write_json
from billiards_env.scene import Scene
from billiards_env.simulation import simulate_batch

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
        random_shots("pool, 1 object ball", Scene.named("pool", 1), count(64_000)),
        random_shots("pool, 5 object balls", Scene.named("pool", 5), count(30_000)),
        random_shots("carom, 2 object balls", Scene.named("carom", 2), count(50_000)),
        breaks("15-ball break, loose rack", "rack", count(1000)),
        breaks("15-ball break, tight rack", "tight_rack", count(800)),
        gas("ideal gas, 16 disks, 10 s", 16, count(800)),
    ]


def random_shots(name: str, scene: Scene, count: int) -> Case:
    """Random layouts, and shots as random actions of the environment give them."""
    rng = np.random.default_rng(0)
    positions = np.array([layouts.draw("random", scene, rng) for _ in range(count)])
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
    positions = np.array([layouts.draw("random", scene, rng) for _ in range(count)])
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


def run(case: Case, threads: int) -> None:
    """Runs a case's shots."""
    simulate_batch(case.scene, case.positions, case.velocities, threads=threads)


_own_cases: list[Case] = []


def _draw_own_cases(scale: float) -> None:
    _own_cases[:] = cases(scale)


def _run_own_case(k: int) -> None:
    run(_own_cases[k], 1)


@contextlib.contextmanager
def side_by_side(scale: float, count: int = 2) -> Iterator[Callable[[int], None]]:
    """Gives a function of k that runs case k in each of `count` processes at the same time."""
    context = multiprocessing.get_context("spawn")
    with contextlib.ExitStack() as stack:
        others = [stack.enter_context(ProcessPoolExecutor(1, context, _draw_own_cases, (scale,))) for _ in range(count)]

        def run_all(k: int) -> None:
            for future in [other.submit(_run_own_case, k) for other in others]:
                future.result()

        yield run_all


def measure(repeats: int, scale: float = 1.0) -> dict[str, Any]:
    """Runs everything `repeats` times.

    Args:
        repeats: Number of passes over the cases.
        scale: Factor on the number of shots in a pass.

    Returns:
        `batch`: a list, an entry a case; `microseconds_per_call`: for the first case's shots one at a time.
    """
    on = machine()
    every = cases(scale)
    outcomes = [simulate_batch(c.scene, c.positions, c.velocities, threads=1) for c in every]  # compiles, warms up
    for case, outcome in zip(every, outcomes, strict=True):
        if (outcome.status == STATUS.index("event_limit")).any():
            raise RuntimeError(f"{case.name}: a shot was given up, its time says nothing")

    # For each case and pass, s: one thread, two threads, two processes.
    batch: list[list[tuple[float, float, float]]] = [[] for _ in every]
    calls: list[dict[str, float]] = []
    with side_by_side(scale) as run_both:
        for k in range(len(every)):
            run_both(k)
        for _ in range(repeats):
            for k, case in enumerate(every):
                batch[k].append(
                    (
                        seconds(lambda case=case: run(case, 1)),
                        seconds(lambda case=case: run(case, 2)),
                        seconds(lambda k=k: run_both(k)),
                    )
                )
            calls.append(time_calls(every[0]))

    rows = []
    for case, passes, outcome in zip(every, batch, outcomes, strict=True):
        m, events = len(case.positions), int(outcome.n_events.sum())
        fastest = [min(times) for times in zip(*passes, strict=True)]
        rows.append(
            {
                "case": case.name,
                "shots": m,
                "shots_per_second": summary([m / one for one, _, _ in passes]),
                "events_per_shot": events / m,
                "most_events": int(outcome.n_events.max()),
                "contact_rule_share": float((outcome.n_contact_rule > 0).mean()),
                "microseconds_per_event": summary([1e6 * one / events for one, _, _ in passes]),
                "seconds_simulated_per_shot": float(outcome.time.mean()),
                "two_threads_over_one": {
                    **summary([one / two for one, two, _ in passes]),
                    "fastest": fastest[0] / fastest[1],
                },
                "two_processes_over_one": {
                    **summary([2 * one / both for one, _, both in passes]),
                    "fastest": 2 * fastest[0] / fastest[2],
                },
            }
        )
    return {
        "machine": on,
        "repeats": repeats,
        "max_speed": MAX_SPEED,
        "break_speed": BREAK_SPEED,
        "batch": rows,
        "microseconds_per_call": {
            name: {**summary([1e6 * t[name] for t in calls]), "fastest": min(1e6 * t[name] for t in calls)}
            for name in calls[0]
        },
    }


def time_calls(case: Case) -> dict[str, float]:
    """Seconds a shot takes in a batch and in one call each of `simulate`, `env.step` and, none, of `env.reset`."""
    few = case._replace(positions=case.positions[:N_SINGLES], velocities=case.velocities[:N_SINGLES])
    n, actions = len(few.positions), (few.velocities / MAX_SPEED).astype(np.float32)
    env = gym.make("Billiards-v0", max_speed=MAX_SPEED)
    env.reset(seed=0)
    env.step(actions[0])
    stepping = 0.0
    for positions, action in zip(few.positions, actions, strict=True):
        env.reset(options={"positions": positions})
        begin = perf_counter()
        env.step(action)
        stepping += perf_counter() - begin
    return {
        "simulate_batch": seconds(lambda: run(few, 1)) / n,
        "simulate": seconds(
            lambda: [simulate(few.scene, p, v) for p, v in zip(few.positions, few.velocities, strict=True)]
        )
        / n,
        "env_step": stepping / n,
        "env_reset": seconds(lambda: [env.reset() for _ in range(n)]) / n,
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
    per_call = result["microseconds_per_call"]
    names = {
        "simulate_batch": "simulate_batch, per shot",
        "simulate": "simulate",
        "env_step": "env.step",
        "env_reset": "env.reset",
    }
    calls = []
    for key, name in names.items():
        row = [name]
        for of in ("median", "fastest"):
            above = "" if key == "env_reset" else f"{per_call[key][of] - per_call['simulate_batch'][of]:.1f}"
            row += [f"{per_call[key][of]:.1f}", above]
        calls.append(row)
    ratios = [(row["two_threads_over_one"], row["two_processes_over_one"]) for row in result["batch"]]
    two = [
        (row["case"], *(f"{ratio[key]:.2f}" for ratio in pair for key in ("median", "fastest")))
        for row, pair in zip(result["batch"], ratios, strict=True)
    ]
    return {
        "machine": machine_line(result["machine"]),
        "how": f"One core; medians of {result['repeats']} interleaved passes.",
        "shots": table(
            ("shots", "shots/s", "events/shot", "most", "contact rule", "us/event", "s simulated/shot"), shots
        ),
        "calls_of": f"The first case with one shot a call, {N_SINGLES:,} calls in a pass: microseconds a call, and the "
        "difference to the batch. Medians of the passes, and the fastest pass.",
        "calls": table(("call", "us/call", "above", "fastest", "above"), calls),
        "two_cores": f"Two threads run {min(a['median'] for a, _ in ratios):.2f} to "
        f"{max(a['median'] for a, _ in ratios):.2f} times as many shots a second as one.",
        "threads_of": "Shots per second on two cores divided by those on one core, for two threads and for two "
        "processes. Medians of the ratios, and the ratios of the fastest passes.",
        "threads": table(("shots", "2 threads", "fastest", "2 processes", "fastest"), two),
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
