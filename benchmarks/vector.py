"""The speed of single and vector environments: `python -m benchmarks.vector`.

Every environment plays one-shot episodes at one object ball, so each step is a shot and a new layout. The kinds take
turns in one process, so that other load on the machine affects all of them equally. Medians are reported; the JSON also
has the quartiles.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from time import perf_counter
from typing import Any
from unittest.mock import patch

import gymnasium as gym
import numpy as np
from gymnasium.utils.performance import benchmark_step, benchmark_vector_step

from benchmarks import in_turns, machine, run_command, table
from benchmarks.speed import quartiles, seconds
from billiards_env.commands import Job
from billiards_env.engine import typed_run
from billiards_env.envs import step
from billiards_env.jit import Typed

ENV_COUNTS = (1, 16, 256, 1024, 16_384)
DOORS: dict[str, dict[str, Any]] = {
    "images of 84 x 84 pixels": {"observe": [("pixels", 84, 84)]},
    "goals": {"task": "place", "observe": "goal"},
    "plans": {"action": "plan"},
}
"""Kinds of observations and actions, with the arguments of their environments."""

GAMES = {name: {"task": name.replace(" ", "_"), "n_players": 2, "threads": 1} for name in ("nine ball", "eight ball")}
"""Games of two players from the break, with the arguments of their environments."""


SINGLE = "single environment"
"""The kind with which the others are compared."""

RESETS = "native, 1,024, one thread, resets with a seed"
"""The kind whose rate is that of resets; the others have that of steps."""


def actions_for(count: int, size: int = 2) -> np.ndarray:
    """Returns (8, count, size) random actions, to be played in turn."""
    return np.random.default_rng(0).uniform(-1, 1, (8, count, size)).astype(np.float32)


def single(steps: int) -> Callable[[], object]:
    """Returns a function that steps and resets one environment `steps` times."""
    env, actions = gym.make("Billiards-v0"), actions_for(steps)[0]
    env.reset(seed=0)

    def play() -> None:
        for action in actions:
            env.step(action)
            env.reset()

    return play


def many(envs: Any, steps: int) -> Callable[[], object]:
    """Returns a function that steps a vector environment `steps` times."""
    if choices := getattr(envs.single_action_space, "n", 0):
        actions = np.random.default_rng(0).integers(0, choices, (8, envs.num_envs))
    else:
        actions = actions_for(*envs.action_space.shape)

    def play() -> None:
        for k in range(steps):
            envs.step(actions[k % len(actions)])

    return play


def resetting(envs: Any, resets: int) -> Callable[[], object]:
    """Returns a function that resets a vector environment `resets` times, each time with another seed."""

    def play() -> None:
        for seed in range(resets):
            envs.reset(seed=seed)

    return play


def native(count: int, **arguments: Any) -> Any:
    """Returns the native vector environment, after a first reset."""
    envs = gym.make_vec("Billiards-v0", num_envs=count, **arguments)
    envs.reset(seed=0)
    return envs


def outside_engine(count: int, steps: int, **arguments: Any) -> Callable[[], float]:
    """Returns a function that steps environments on one thread and returns the share of the time outside the engine."""
    inside = 0.0

    def timed(*choice: Any) -> Typed:
        engine = typed_run(*choice)

        def run(*arguments: Any) -> None:
            nonlocal inside
            begun = perf_counter()
            engine.call(*arguments)
            inside += perf_counter() - begun

        return Typed(run)

    with patch.object(step, "typed_run", timed):
        play = many(native(count, **{"threads": 1, **arguments}), steps)

    def share() -> float:
        nonlocal inside
        inside = 0.0
        total = seconds(play)
        return 1.0 - inside / total

    return share


def environments(scale: float) -> dict[str, tuple[int, Callable[[], Callable[[], object]]]]:
    """Returns the number of steps per pass, and a function that makes the pass, of each kind of environment by name."""

    def steps(count: int) -> int:
        return max(1, round(20_000 * scale / count))

    def of_native(count: int, passes: int, **arguments: Any) -> tuple[int, Callable[[], Callable[[], object]]]:
        return count * passes, lambda: many(native(count, **arguments), passes)

    short, usual = steps(4), steps(1024)  # for slow environments, and for 1,024
    return {
        SINGLE: (short, lambda: single(short)),
        "SyncVectorEnv of 64": (64 * steps(256), lambda: many(sync_of(64), steps(256))),
        **{f"native, {n:,}": of_native(n, steps(n)) for n in ENV_COUNTS},
        "native, 1,024, one thread": of_native(1024, usual, threads=1),
        **{f"native, 1,024, {name}": of_native(1024, usual, **arguments) for name, arguments in DOORS.items()},
        **{
            f"native, 1,024, one thread, {name} of two players": of_native(1024, steps(16_384), **arguments)
            for name, arguments in GAMES.items()
        },
        RESETS: (1024 * usual, lambda: resetting(native(1024, threads=1), usual)),
    }


def sync_of(count: int) -> Any:
    """Returns Gymnasium's vector environment, after a first reset."""
    options = {"autoreset_mode": "SameStep"}
    envs = gym.make_vec("Billiards-v0", num_envs=count, vectorization_mode="sync", vector_kwargs=options)
    envs.reset(seed=0)
    return envs


def measure(repeats: int, job: Job, scale: float = 1.0) -> dict[str, Any]:
    """Runs all measurements `repeats` times; `scale` is a factor on the number of steps in a pass.

    Returns:
        `steps`: a list with one entry per kind, with rates per second. `outside_engine`: the share of a step of 1,024
        environments on one thread, for one object ball ("pot") and for `GAMES`. Each entry is a job.
    """
    on, steps, calls = machine(), max(1, round(20 * scale)), dict[str, Callable[[], float]]()
    outside = {f"outside the engine, {name}": name for name in ("pot", *GAMES)}
    kinds = environments(scale)
    for key, name in outside.items():
        with job(key):
            share = outside_engine(1024, max(1, steps // 4) if name in GAMES else steps, **GAMES.get(name, {}))
            share()  # compiles the kernels
            calls[key] = share
    for kind, (count, make) in kinds.items():
        with job(kind):
            play = make()
            play()
            calls[kind] = functools.partial(rate_of, count, play)
    theirs = of_gymnasium(scale)
    calls |= theirs
    measured = {name: quartiles(values) for name, values in in_turns(calls, repeats, job).items()}
    rows = [{"kind": kind, "per_second": measured[kind]} for kind in (*kinds, *theirs) if kind in measured]
    shares = {name: measured[key] for key, name in outside.items() if key in measured}
    return {"machine": on, "repeats": repeats, "steps": rows, "outside_engine": shares}


def of_gymnasium(scale: float) -> dict[str, Callable[[], float]]:
    """Returns the benchmarks of Gymnasium by name. They sample each action, and measure for at most a second."""
    single, envs = gym.make("Billiards-v0"), native(1024)
    duration: Any = min(1.0, scale)  # s
    return {
        "`benchmark_step` of Gymnasium": lambda: benchmark_step(single, duration, seed=0),
        "`benchmark_vector_step` of Gymnasium, native, 1,024": lambda: benchmark_vector_step(envs, duration, seed=0),
    }


def rate_of(count: int, play: Callable[[], object]) -> float:
    """Returns the steps per second of a pass with `count` steps."""
    return count / seconds(play)


def blocks(result: dict[str, Any]) -> dict[str, str]:
    """Returns the results as Markdown, by name."""
    rates = {row["kind"]: row["per_second"]["median"] for row in result["steps"]}
    outside = {name: f"{share['median']:.0%}" for name, share in result["outside_engine"].items()}
    games = " and ".join(f"{outside.get(name, '-')} ({name})" for name in GAMES)
    one = rates.get(SINGLE)
    return {
        "how": f"Medians of {result['repeats']} interleaved passes. A step of 1,024 environments on one thread spends "
        f"{outside.get('pot', '-')} of its time outside the engine. In games of two players from the break it is "
        f"{games}.",
        "steps": table(
            ("environments", "steps/s", "relative"),
            [(kind, f"{rate:,.0f}", f"{rate / one:.1f}" if one else "") for kind, rate in rates.items()],
        ),
    }


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m benchmarks.vector --help`."""
    repeats = (11, "number of passes")
    about = "Measure the speed of environments."
    run_command("benchmarks.vector", about, arguments, measure, blocks, {"repeats": repeats}, jobs=True)


if __name__ == "__main__":
    main()
