"""The speed of single and vector environments: `python -m benchmarks.vector`.

Every environment plays one-shot episodes at one object ball, so each step is a shot and a new layout. The kinds take
turns in one process, so that other load on the machine affects all of them equally. Medians are reported; the JSON also
has the quartiles.
"""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter
from typing import Any
from unittest.mock import patch

import gymnasium as gym
import numpy as np

from benchmarks import machine, run_command, table
from benchmarks.speed import quartiles, seconds
from billiards_env.engine import run_shots_of
from billiards_env.envs import episodes
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

    def timed(*choice: Any) -> Callable[..., None]:
        engine = Typed(run_shots_of(*choice))

        def run(*arguments: Any) -> None:
            nonlocal inside
            begun = perf_counter()
            engine.call(*arguments)
            inside += perf_counter() - begun

        return run

    with patch.object(episodes, "run_shots_of", timed):
        play = many(native(count, **{"threads": 1, **arguments}), steps)

    def share() -> float:
        nonlocal inside
        inside = 0.0
        total = seconds(play)
        return 1.0 - inside / total

    return share


def environments(scale: float) -> list[tuple[str, int, Callable[[], object]]]:
    """Returns the name, the number of steps per pass and the pass of each kind of environment."""

    def steps(count: int) -> int:
        return max(1, round(20_000 * scale / count))

    short = steps(4)  # for slow environments
    sync = gym.make_vec(
        "Billiards-v0", num_envs=64, vectorization_mode="sync", vector_kwargs={"autoreset_mode": "SameStep"}
    )
    sync.reset(seed=0)
    return [
        ("single environment", short, single(short)),
        ("SyncVectorEnv of 64", 64 * steps(256), many(sync, steps(256))),
        *((f"native, {n:,}", n * steps(n), many(native(n), steps(n))) for n in ENV_COUNTS),
        ("native, 1,024, one thread", 1024 * steps(1024), many(native(1024, threads=1), steps(1024))),
        *(
            (f"native, 1,024, {name}", 1024 * steps(1024), many(native(1024, **arguments), steps(1024)))
            for name, arguments in DOORS.items()
        ),
        *(
            (
                f"native, 1,024, one thread, {name} of two players",
                1024 * steps(16_384),
                many(native(1024, **arguments), steps(16_384)),
            )
            for name, arguments in GAMES.items()
        ),
        (RESETS, 1024 * steps(1024), resetting(native(1024, threads=1), steps(1024))),
    ]


def measure(repeats: int, scale: float = 1.0) -> dict[str, Any]:
    """Runs all measurements `repeats` times; `scale` is a factor on the number of steps in a pass.

    Returns:
        `steps`: a list with one entry per kind, with rates per second. `outside_engine`: the share of a step of 1,024
        environments on one thread, for one object ball ("pot") and for `GAMES`.
    """
    on, steps = machine(), max(1, round(20 * scale))
    played, shares = environments(scale), {"pot": outside_engine(1024, steps)}
    shares |= {name: outside_engine(1024, max(1, steps // 4), **arguments) for name, arguments in GAMES.items()}
    for share in shares.values():  # compiles the kernels
        share()
    for _, _, play in played:
        play()
    passes = [
        ([share() for share in shares.values()], [count / seconds(play) for _, count, play in played])
        for _ in range(repeats)
    ]
    outside, rates = (np.transpose(part).tolist() for part in zip(*passes, strict=True))
    rows = [{"kind": name, "per_second": quartiles(values)} for (name, _, _), values in zip(played, rates, strict=True)]
    shares = {name: quartiles(values) for name, values in zip(shares, outside, strict=True)}
    return {"machine": on, "repeats": repeats, "steps": rows, "outside_engine": shares}


def blocks(result: dict[str, Any]) -> dict[str, str]:
    """Returns the results as Markdown, by name."""
    rates = {row["kind"]: row["per_second"]["median"] for row in result["steps"]}
    one = next(iter(rates.values()))
    outside = {name: share["median"] for name, share in result["outside_engine"].items()}
    games = " and ".join(f"{outside[name]:.0%} ({name})" for name in GAMES)
    return {
        "how": f"Medians of {result['repeats']} interleaved passes. A step of 1,024 environments on one thread spends "
        f"{outside['pot']:.0%} of its time outside the engine. In games of two players from the break it is {games}.",
        "steps": table(
            ("environments", "steps/s", "relative"),
            [(kind, f"{rate:,.0f}", f"{rate / one:.1f}") for kind, rate in rates.items()],
        ),
    }


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m benchmarks.vector --help`."""
    repeats = (11, "number of passes")
    run_command(
        "benchmarks.vector", "Measure the speed of environments.", arguments, measure, blocks, {"repeats": repeats}
    )


if __name__ == "__main__":
    main()
