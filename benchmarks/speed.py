"""The speed of shots: `python -m benchmarks.speed`.

The cases take turns in one process, so that other load on the machine affects all of them equally. Medians are
reported; the JSON also has the quartiles. Every case uses a fixed seed. Shots per second are those of
`simulate_batch(..., threads=1)`, including its checks but not the drawing of the layouts.
"""

from __future__ import annotations

import copy
import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from time import perf_counter, process_time
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from benchmarks import in_turns, machine, rows_table, run_command, table
from billiards_env.commands import Job
from billiards_env.engine.compile import MANY_BALLS
from billiards_env.envs.actions import cue_strike
from billiards_env.scene import Balls, Physics, Scene, layouts
from billiards_env.scene.table import POOL_RADIUS, Table
from billiards_env.shots.simulation import BatchResult, simulate, simulate_batch

MAX_SPEED = 4.0  # m/s, largest speed of a random shot: the environment's default
BREAK_SPEED = 8.0  # m/s, speed of the cue ball in a break
BREAK_SPREAD = math.radians(1)  # largest angle between a break and the centre of the first ball
GAS_SPEED = 1.0  # m/s, root mean square along each axis
N_SINGLES = 1000  # shots run one at a time

DISKS = (2, 16, 128, 1024, 10_000, 100_000)
"""Number of disks of each gas; its table grows with it."""
SHARE = 0.1
"""Share of the table that the disks cover."""
GROWTH_SECONDS = 2.0  # simulated

LEAST_TIME = 0.2e-6
"""s. About the time in which a core computes the 1,500 results that a shot with one object ball needs."""

FIRST = "pool, 1 object ball"
"""The case whose shots also run one at a time."""

Floats = NDArray[np.float64]


class Case(NamedTuple):
    """A set of m shots with n balls: positions (m, n, 2), m, and velocities (m, n, 2) or (m, 2), m/s."""

    name: str
    scene: Scene
    positions: Floats
    velocities: Floats


def cases(scale: float = 1.0) -> list[Case]:
    """Returns the cases; with `scale` = 1 a pass over the shots of a case takes about a tenth of a second."""

    def count(shots: int) -> int:
        return max(1, round(shots * scale))

    return [
        random_shots(FIRST, Scene.named("pool", 1), count(64_000)),
        random_shots("pool, 5 object balls", Scene.named("pool", 5), count(30_000)),
        random_shots("carom, 2 object balls", Scene.named("carom", 2), count(50_000)),
        breaks("15-ball break, loose rack", "pool", "rack", count(1000)),
        breaks("15-ball break, tight rack", "pool", "tight_rack", count(800)),
        random_shots("real pool, 1 object ball", Scene.named("real_pool", 1), count(32_000)),
        breaks("real pool, 15-ball break, loose rack", "real_pool", "rack", count(500)),
        gas_case("ideal gas, 16 disks, 10 s", 16, count(800)),
    ]


def drawn(layout: str, scene: Scene, rng: np.random.Generator, count: int) -> Floats:
    """Returns the positions (count, n, 2), m, of a layout."""
    return np.array([layouts.draw(layout, scene, rng) for _ in range(count)])


def random_shots(name: str, scene: Scene, count: int) -> Case:
    """Returns random layouts with the velocities of random actions of the environment."""
    rng = np.random.default_rng(0)
    positions = drawn("random", scene, rng, count)
    velocities = np.array([cue_strike(action, scene, MAX_SPEED).velocity for action in rng.uniform(-1, 1, (count, 2))])
    return Case(name, scene, positions, velocities)


def breaks(name: str, scene_name: str, layout: str, count: int) -> Case:
    """Returns break shots at the first of 15 balls, from anywhere behind the head string."""
    rng = np.random.default_rng(0)
    scene = Scene.named(scene_name, 15)
    positions = drawn(layout, scene, rng, count)
    aim = positions[:, 1] - positions[:, 0]
    angle = np.arctan2(aim[:, 1], aim[:, 0]) + rng.uniform(-BREAK_SPREAD, BREAK_SPREAD, count)
    return Case(name, scene, positions, BREAK_SPEED * np.column_stack((np.cos(angle), np.sin(angle))))


def gas_case(name: str, n_balls: int, count: int) -> Case:
    """Returns shots in which all frictionless, elastic disks move, for the 10 s of the scene's time limit."""
    rng = np.random.default_rng(0)
    scene = Scene.named("ideal", n_balls - 1)
    return Case(name, scene, drawn("random", scene, rng, count), rng.normal(0, GAS_SPEED, (count, n_balls, 2)))


def growing_gas(n: int, count: int) -> Case:
    """Returns shots of n elastic disks on a table that grows with n; each disk is in its own cell of a lattice."""
    rng = np.random.default_rng(n)
    width = math.sqrt(n * math.pi * POOL_RADIUS**2 / SHARE / 2)
    physics = Physics(motion="ideal", cushion="restitution", e_ball=1.0, e_cushion=1.0, max_time=GROWTH_SECONDS)
    scene = Scene(Balls.uniform(n), Table(2 * width, width), physics)
    rows = math.ceil(math.sqrt(n / 2))
    columns = math.ceil(n / rows)
    cell = np.array([2 * width / columns, width / rows])
    sites = np.stack(np.divmod(np.arange(columns * rows), rows), axis=1) + 0.5
    taken = np.array([sites[rng.permutation(len(sites))[:n]] for _ in range(count)])
    reach = cell / 2 - 1.001 * POOL_RADIUS
    positions = taken * cell - [width, width / 2] + reach * rng.uniform(-1, 1, taken.shape)
    return Case(f"{n:,}", scene, positions, rng.normal(0.0, GAS_SPEED, taken.shape))


def seconds(run: Callable[..., object], *arguments: Any) -> float:
    """Returns the run time of `run(*arguments)`, s."""
    begin = perf_counter()
    run(*arguments)
    return perf_counter() - begin


def quartiles(values: Sequence[float] | Floats) -> dict[str, float]:
    """Returns the median and the quartiles."""
    low, middle, high = np.quantile(values, (0.25, 0.5, 0.75)).tolist()
    return {"median": middle, "lower_quartile": low, "upper_quartile": high}


def batch_of(case: Case, threads: int = 1) -> BatchResult:
    """Runs the shots of a case."""
    return simulate_batch(case.scene, case.positions, case.velocities, threads=threads)


def measure(repeats: int, job: Job, scale: float = 1.0) -> dict[str, Any]:
    """Runs all measurements `repeats` times; `scale` is a factor on the number of shots in a pass.

    Returns:
        `batch`: a list with one entry per case; `microseconds_per_call`: times of the first case's shots one at a time;
        `growth`: a list with one entry for each of `DISKS`. Each entry is a job.
    """
    on, rows, growth = machine(), [], []
    all_cases, outcomes = {case.name: case for case in cases(scale)}, dict[str, BatchResult]()
    for name, case in all_cases.items():
        with job(name):
            outcome = batch_of(case)  # compiles the kernels
            if (outcome.status == "event_limit").any():
                raise RuntimeError("a shot reached the event limit, so its time is not valid")
            outcomes[name] = outcome
    passes = in_turns({name: functools.partial(time_batch, all_cases[name]) for name in outcomes}, repeats, job)
    calls = in_turns({"calls": lambda: time_calls(all_cases[FIRST])}, repeats, job).get("calls", [])
    for n in DISKS:
        with job(f"gas of {n:,} disks"):
            growth.append(time_gas(n, repeats))
    for name, times in passes.items():
        case, outcome, (one, two) = all_cases[name], outcomes[name], np.transpose(times)
        m, events = len(case.positions), int(outcome.n_events.sum())
        rows.append(
            {
                "case": case.name,
                "shots": m,
                "shots_per_second": quartiles(m / one),
                "events_per_shot": events / m,
                "most_events": int(outcome.n_events.max()),
                "contact_rule_share": float((outcome.n_contact_rule > 0).mean()),
                "microseconds_per_event": quartiles(1e6 * one / events),
                "seconds_simulated_per_shot": float(outcome.time.mean()),
                "two_threads_over_one": quartiles(one / two),
            }
        )
    return {
        "machine": on,
        "repeats": repeats,
        "max_speed": MAX_SPEED,
        "break_speed": BREAK_SPEED,
        "batch": rows,
        "microseconds_per_call": {
            name: quartiles([1e6 * t[name] for t in calls]) for name in (calls[0] if calls else ())
        },
        "growth": growth,
    }


def time_batch(case: Case) -> tuple[float, float]:
    """Returns the seconds of the shots of a case with one thread and with two."""
    return seconds(batch_of, case), seconds(batch_of, case, 2)


def time_gas(n: int, repeats: int) -> dict[str, float]:
    """Runs the shots of n disks `repeats` times, or less often if n is large.

    Returns:
        `disks`; the `passes`, the `events_per_shot`, and the medians of `us_per_shot` and `us_to_begin`, the time of
        the checks and of the first predictions.
    """
    gas = growing_gas(n, max(1, 4096 // n))
    at_once = gas._replace(scene=replace(gas.scene, physics=replace(gas.scene.physics, max_time=1e-9)))
    batch_of(at_once)  # compiles
    passes, m = min(repeats, 1 + 40_000 * repeats // n), len(gas.positions)
    to_end, begin = (
        1e6 * float(np.median([seconds(batch_of, case) for _ in range(passes)])) / m for case in (gas, at_once)
    )
    events = float(batch_of(gas).n_events.mean())
    return {"disks": n, "passes": passes, "events_per_shot": events, "us_per_shot": to_end, "us_to_begin": begin}


def time_calls(case: Case) -> dict[str, float]:
    """Returns processor times of calls, s.

    Returns:
        Those of a shot in a batch, in `simulate` and in `env.step`, of `env.reset`, of both, of both in an environment
        without Gymnasium's checker, and of a copy of an environment with one step.
    """
    subset = case._replace(positions=case.positions[:N_SINGLES], velocities=case.velocities[:N_SINGLES])
    actions = (subset.velocities / MAX_SPEED).astype(np.float32)
    envs = [gym.make("Billiards-v0", max_speed=MAX_SPEED, disable_env_checker=off) for off in (False, True)]
    for env in envs:
        env.reset(seed=0)
    envs[0].unwrapped.action_space.sample()  # a copy has its generator too

    def of_each(call: Callable[..., object], *arguments: Any) -> float:
        """Returns the time of a call, the mean of calls with the rows of arguments."""
        begin = process_time()
        for row in zip(*arguments, strict=True):
            call(*row)
        return (process_time() - begin) / len(subset.positions)

    both, unchecked = (of_each(lambda action, env=env: (env.reset(), env.step(action)), actions) for env in envs)
    reset = of_each(lambda _: envs[0].reset(), actions)
    return {
        "simulate_batch": of_each(batch_of, [subset]),
        "simulate": of_each(simulate, [subset.scene] * len(actions), subset.positions, subset.velocities),
        "env_step": both - reset,
        "env_reset": reset,
        "both": both,
        "without_checker": unchecked,
        "copy_and_step": of_each(lambda action: copy.deepcopy(envs[0].unwrapped).step(action), actions),
    }


def blocks(result: dict[str, Any]) -> dict[str, str]:
    """Returns the results as Markdown, by name."""
    shots = {
        "shots": "{case}",
        "shots/s": "{shots_per_second[median]:,.0f}",
        "events/shot": "{events_per_shot:.1f}",
        "most": "{most_events}",
        "contact rule": "{contact_rule_share:.1%}",
        "us/event": "{microseconds_per_event[median]:.2f}",
        "s simulated/shot": "{seconds_simulated_per_shot:.1f}",
    }
    growth = {
        "disks": "{disks:,}",
        "events": "{events_per_shot:,.0f}",
        "us/event": "{per_event:,.2f}",
        "us/disk to begin": "{per_disk:,.2f}",
        "s to begin": "{begin:.2g}",
    }
    gases = []
    for g in result["growth"]:
        per_event, per_disk = g["us_per_shot"] / g["events_per_shot"], g["us_to_begin"] / g["disks"]
        gases.append({**g, "per_event": per_event, "per_disk": per_disk, "begin": g["us_to_begin"] / 1e6})
    rows = {row["case"]: row for row in result["batch"]}
    per_call = {name: times["median"] for name, times in result["microseconds_per_call"].items()}
    names = {"simulate_batch": "simulate_batch, per shot", "simulate": "simulate", "env_step": "env.step"}
    calls = [
        (name, f"{per_call[key]:.1f}", f"{per_call[key] - per_call['simulate_batch']:.1f}")
        for key, name in names.items()
        if per_call
    ]
    others = {
        "env_reset": "env.reset",
        "both": "env.reset and env.step",
        "without_checker": "the same with disable_env_checker=True",
        "copy_and_step": "copy.deepcopy of the unwrapped environment, and a step of the copy",
    }
    calls += [(name, f"{per_call[key]:.1f}", "") for key, name in others.items() if per_call]
    return {
        "how": f"One core; medians of {result['repeats']} interleaved passes.",
        "shots": rows_table(shots, result["batch"]),
        "calls": table(("call", "us/call", "more"), calls),
        "growth_of": f"These shots are {GROWTH_SECONDS:g} s of an elastic gas whose disks cover {SHARE:.0%} of the "
        f"table. With {MANY_BALLS} balls or more the engine uses the cells, and a heap for its events. A shot begins "
        "with the checks of its input and the first predictions.",
        "growth": rows_table(growth, gases),
        **(_summary(rows, per_call) if FIRST in rows and per_call else {}),
    }


def _summary(rows: dict[str, Any], per_call: dict[str, float]) -> dict[str, str]:
    """Returns the blocks that need the first case and the times of calls."""
    first, gains = rows[FIRST], [row["two_threads_over_one"]["median"] for row in rows.values()]
    per_second = first["shots_per_second"]["median"]
    return {
        "limit": f"A shot of the first kind in the table takes {1 / (per_second * LEAST_TIME):.0f} times this limit, "
        "with the checks of its input.",
        "two_cores": f"Two threads run {min(gains):.2f} to {max(gains):.2f} times as many shots a second as one.",
        "summary": f"One core plays {rounded(per_second)} shots a second in a batch (one object ball): "
        f"{per_second * first['seconds_simulated_per_shot'] / 1e6:.2g} million seconds of table time per "
        f"second. A loop over `env.reset` and `env.step` plays {rounded(1e6 / per_call['both'])}.",
    }


def rounded(number: float) -> str:
    """Returns a number with two significant digits."""
    return f"{float(f'{number:.2g}'):,.0f}"


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m benchmarks.speed --help`."""
    repeats = (11, "number of passes")
    about = "Measure the speed of shots."
    run_command("benchmarks.speed", about, arguments, measure, blocks, {"repeats": repeats}, jobs=True)


if __name__ == "__main__":
    main()
