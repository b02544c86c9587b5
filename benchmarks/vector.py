"""How fast environments are stepped, one and many at once: `python -m benchmarks.vector`.

Every kind of environment plays one-shot episodes at one object ball, each step of each environment a shot and a new
layout. All kinds are measured in turn, over and over, in one process, so that whatever else the machine does falls on
all of them alike; medians are reported, with the quartiles beside them in the JSON.
"""

from __future__ import annotations

import argparse
import dataclasses
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from time import perf_counter
from typing import Any

import gymnasium as gym
import numpy as np
import torch
from stable_baselines3.common.callbacks import BaseCallback

import billiards_env  # noqa: F401  (registers the environment)
from agents.config import Config, load
from agents.ppo import make_model, make_vec_env
from agents.vec_env import SameStepVecEnv
from benchmarks import RESULTS, machine, machine_line, print_blocks, table
from benchmarks.speed import seconds, summary
from billiards_env import layouts
from billiards_env.files import write_json
from billiards_env.scene import Scene

SAME_STEP = "SameStep"
ENV_COUNTS = (1, 16, 256, 1024, 16_384)
MEMORY_COUNTS = (1024, 65_536)
TRAINING = Path(__file__).resolve().parent.parent / "configs" / "ppo" / "pot.yaml"
TRAININGS = 7  # the first of which warms up
LAYOUTS = (("random", 1), ("random", 15), ("rack", 15))  # name and number of object balls


def actions_for(count: int) -> np.ndarray:
    """(8, count, 2) random actions, to be played in turn."""
    return np.random.default_rng(0).uniform(-1, 1, (8, count, 2)).astype(np.float32)


def single(steps: int) -> Callable[[], object]:
    """A function that steps one environment so often, and resets it as often."""
    env, actions = gym.make("Billiards-v0"), actions_for(steps)[0]
    env.reset(seed=0)

    def play() -> None:
        for action in actions:
            env.step(action)
            env.reset()

    return play


def many(envs: Any, steps: int) -> Callable[[], object]:
    """A function that steps a vector environment so often."""
    actions = actions_for(envs.num_envs)

    def play() -> None:
        for k in range(steps):
            envs.step(actions[k % len(actions)])

    return play


def native(count: int, **arguments: Any) -> Any:
    """The native vector environment, with same-step resets and reset once."""
    envs = gym.make_vec("Billiards-v0", num_envs=count, autoreset_mode=SAME_STEP, **arguments)
    envs.reset(seed=0)
    return envs


def kinds(scale: float) -> list[tuple[str, int, Callable[[], object]]]:
    """Name, environment steps of a pass and the pass, of each kind of environment."""

    def steps(count: int) -> int:
        return max(1, round(20_000 * scale / count))

    few = steps(4)  # of those that are slow
    sync = gym.make_vec(
        "Billiards-v0", num_envs=64, vectorization_mode="sync", vector_kwargs={"autoreset_mode": SAME_STEP}
    )
    sync.reset(seed=0)
    adapter = SameStepVecEnv(native(1024))
    return [
        ("single environment", few, single(few)),
        ("SyncVectorEnv of 64", 64 * steps(256), many(sync, steps(256))),
        *((f"native, {n:,}", n * steps(n), many(native(n), steps(n))) for n in ENV_COUNTS),
        ("native, 1,024, one thread", 1024 * steps(1024), many(native(1024, threads=1), steps(1024))),
        ("SB3 adapter, 1,024", 1024 * steps(1024), many(adapter, steps(1024))),
    ]


def drawing(name: str, n_object_balls: int, tables: int) -> Callable[[], object]:
    """A function that draws so many layouts, on one thread."""
    plan = layouts.plan(name, Scene.named("pool", n_object_balls))
    wanted = np.ones(tables, np.bool_)
    rows = np.random.default_rng(0).integers(2**63, size=(tables, 4), dtype=np.uint64) * 2 + 1  # odd increments
    positions = np.empty((tables, n_object_balls + 1, 2))
    return lambda: layouts.draw_tables(plan, 0, tables, wanted, rows, positions)


class _Stepping(BaseCallback):
    """Adds up how long the environments' steps take in training."""

    def __init__(self) -> None:
        super().__init__()
        self.seconds = 0.0

    def _on_training_start(self) -> None:
        envs: Any = self.model.env
        step_wait = envs.step_wait

        def timed() -> Any:
            begin = perf_counter()
            told = step_wait()
            self.seconds += perf_counter() - begin
            return told

        envs.step_wait = timed

    def _on_step(self) -> bool:
        return True


def training_config(n_envs: int, n_steps: int, updates: int) -> Config:
    """The example agent's settings with so many environments and a minibatch of 4,096 steps."""
    config = load(TRAINING)
    rollout = n_envs * n_steps
    settings = dataclasses.replace(config.ppo, n_steps=n_steps, batch_size=min(4096, rollout))
    return dataclasses.replace(config, n_envs=n_envs, timesteps=rollout * updates, ppo=settings)


def training(n_envs: int = 1024, n_steps: int = 16, updates: int = 3) -> dict[str, float]:
    """Trains the example agent for a few updates.

    Returns:
        `steps_per_second` and `environment_share`: the share of the time that went into the environments' steps,
        simulation and adapter together.
    """
    torch.set_num_threads(1)  # as agents.train does
    config = training_config(n_envs, n_steps, updates)
    envs = make_vec_env(config)
    model, stepping = make_model(config, envs), _Stepping()
    envs.seed(0)
    begin = perf_counter()
    model.learn(config.timesteps, stepping)
    whole = perf_counter() - begin
    return {"steps_per_second": model.num_timesteps / whole, "environment_share": stepping.seconds / whole}


def memory(count: int) -> dict[str, float]:
    """Bytes an environment takes: while it rests, and at most while it is reset and stepped."""
    actions = actions_for(count)
    tracemalloc.start()
    try:
        envs = native(count)
        at_rest = tracemalloc.get_traced_memory()[0]
        for action in actions:
            envs.step(action)
        most = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    return {"environments": count, "bytes_at_rest": at_rest / count, "bytes_at_most": most / count}


def measure(repeats: int, scale: float = 1.0) -> dict[str, Any]:
    """Measures everything `repeats` times, training `TRAININGS` times and memory once.

    Args:
        repeats: Number of passes over the kinds of environments.
        scale: Factor on the number of steps in a pass.

    Returns:
        `steps` and `layouts`: lists, an entry a kind, with rates per second; `training`, summaries; `memory`.
    """
    on = machine()
    tables = max(1, round(20_000 * scale))
    every = kinds(scale)
    every += [(f"{name}, {n} object balls", tables, drawing(name, n, tables)) for name, n in LAYOUTS]
    for _, _, play in every:  # compiles, warms up
        play()
    rates: list[list[float]] = [[] for _ in every]
    for _ in range(repeats):
        for found, (_, steps, play) in zip(rates, every, strict=True):
            found.append(steps / seconds(play))
    rows = [{"kind": name, "per_second": summary(found)} for (name, _, _), found in zip(every, rates, strict=True)]
    small = scale < 1
    trained = [training(64, 2, 2) if small else training() for _ in range(2 if small else TRAININGS)][1:]
    return {
        "machine": on,
        "repeats": repeats,
        "steps": rows[: -len(LAYOUTS)],
        "layouts": rows[-len(LAYOUTS) :],
        "training": {name: summary([run[name] for run in trained]) for name in trained[0]},
        "memory": [memory(count) for count in ((64,) if small else MEMORY_COUNTS)],
    }


def blocks(result: dict[str, Any]) -> dict[str, str]:
    """What was measured as Markdown, by name."""
    rates = {row["kind"]: row["per_second"]["median"] for row in result["steps"]}
    one = next(iter(rates.values()))
    memory_rows = [
        (f"{row['environments']:,}", f"{row['bytes_at_rest']:,.0f}", f"{row['bytes_at_most']:,.0f}")
        for row in result["memory"]
    ]
    drawn = [(row["kind"], f"{row['per_second']['median']:,.0f}") for row in result["layouts"]]
    trained = {name: value["median"] for name, value in result["training"].items()}
    return {
        "machine": machine_line(result["machine"]),
        "how": f"Medians of {result['repeats']} interleaved passes.",
        "steps": table(
            ("environments", "steps/s", "relative"),
            [(kind, f"{rate:,.0f}", f"{rate / one:.1f}") for kind, rate in rates.items()],
        ),
        "layouts": table(("layouts, one thread", "drawn/s"), drawn),
        "memory": table(("environments", "bytes each", "most while stepped"), memory_rows),
        "training": f"PPO on 1,024 environments, minibatches of 4,096: {trained['steps_per_second']:,.0f} steps/s; "
        f"the environments take {trained['environment_share']:.1%} of the time.",
    }


def main(arguments: list[str] | None = None) -> None:
    """The command line; see `python -m benchmarks.vector --help`."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.vector", description="Measure how fast envs step.")
    parser.add_argument("--repeats", type=int, default=11, help="passes over the environments (default: 11)")
    parser.add_argument("--output", type=Path, default=RESULTS / "vector.json", help="where the JSON goes")
    args = parser.parse_args(arguments)
    if args.repeats < 1:
        parser.error(f"--repeats = {args.repeats}: expected a whole number >= 1")
    result = measure(args.repeats)
    write_json(args.output, result)

    print_blocks(blocks(result))
    print(f"\nWritten to {args.output}.")


if __name__ == "__main__":
    main()
