"""Compiles code before it is needed: `billiards cache real_pool planner`. The code stays in the cache.

`pip install .` compiles the part "common" and `make dist` the part "environments", see `setup.py`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np

from billiards_env.derivatives import jacobian
from billiards_env.engine import PIC, Engine
from billiards_env.games import Setup, opening
from billiards_env.players.planner import plan
from billiards_env.scene import SCENES, Scene, layouts
from billiards_env.shots.simulation import simulate, simulate_batch

COMMON = 2
"""The number of `ENVIRONMENTS` whose machine code `pip install .` compiles."""

ENVIRONMENTS: tuple[dict[str, Any], ...] = (
    {},
    {"n_object_balls": 3, "max_shots": 3},
    {"n_object_balls": 15, "layout": "rack", "max_shots": 3, "max_speed": 8.0},
    {"mode": "pit", "dt": 1 / 60},
    {"scene": "real_pool", "action": "strike"},
    {"task": "clear", "n_object_balls": 5, "max_shots": 5},
    {"task": "place"},
    {"task": "position"},
    {"task": "carom"},
    {"task": "three_cushion"},
    {"task": "sum_to_three"},
    {"task": "nine_ball"},
    {"task": "eight_ball"},
)
"""The arguments of the environments whose machine code the wheel of `make dist` has."""


def first_results(arguments: dict[str, Any]) -> list[Any]:
    """Returns the results of `step`, of two steps of 8 environments, and of `simulate`."""
    env: Any = gym.make("Billiards-v0", **arguments)
    envs = gym.make_vec("Billiards-v0", 8, **arguments)
    made = [env.reset(seed=0)[0], envs.reset(seed=0)[0]]
    start, moving = env.unwrapped.positions, np.zeros((env.unwrapped.scene.n_balls, 2))
    moving[0] = 2.0, 0.4
    for space in (env.action_space, envs.action_space):
        space.seed(0)
    made += env.step(env.action_space.sample())[:3]
    for _ in range(2):
        made += envs.step(envs.action_space.sample())[:3]
    if "mode" not in arguments:
        scene = env.unwrapped.scene
        made.append(simulate(scene, start, moving, record=True).positions)
        made.append(simulate_batch(scene, start[None], moving[None]).positions)
    return made


def _environments(count: int | None) -> None:
    for arguments in ENVIRONMENTS[:count]:
        first_results(arguments)


def _scene(name: str) -> None:
    """Compiles both engines for a scene, and the environments."""
    scene = Scene.named(name)
    positions = layouts.draw("random", scene, np.random.default_rng(0))
    for engine in (PIC, Engine("pit", 1 / 60)):
        simulate(scene, positions, [0.1, 0.0], engine=engine, record=True, max_time=0.1)
    task = "place" if scene.n_balls == 1 else "pot" if scene.table.pockets else "carom"
    arguments: dict[str, Any] = {"scene": name, "task": task, "layout": "random"}
    for env in (gym.make("Billiards-v0", **arguments), gym.make_vec("Billiards-v0", num_envs=2, **arguments)):
        env.reset(seed=0)
        env.step(env.action_space.sample())


def _derivatives() -> None:
    jacobian(simulate("pool", [[-0.635, 0.0], [0.635, 0.3]], [2.0, 0.45], record=True), "positions", "velocities")


def _planner() -> None:
    rng, setup = np.random.default_rng(0), Setup("nine_ball", Scene.named("real_pool", 9))
    plan(setup, opening(setup, rng, "random"), 8.0, rng, 0.1)


PARTS: dict[str, Callable[[], None]] = {
    **{name: lambda name=name: _scene(name) for name in SCENES},
    "planner": _planner,
    "derivatives": _derivatives,
    "common": lambda: _environments(COMMON),
    "environments": lambda: _environments(None),
}
"""Functions that compile something, by name."""
