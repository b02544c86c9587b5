"""Compiles code before it is needed: `billiards cache real_pool planner`. The code stays in the cache."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np

from billiards_env.engine import PIC, Engine
from billiards_env.games import Setup, opening
from billiards_env.players.planner import plan
from billiards_env.scene import SCENES, Scene, layouts
from billiards_env.shots.simulation import simulate


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
    simulate("pool", [[-0.635, 0.0], [0.635, 0.3]], [2.0, 0.45], record=True).jacobian("positions", "velocities")


def _planner() -> None:
    rng, setup = np.random.default_rng(0), Setup("nine_ball", Scene.named("real_pool", 9))
    plan(setup, opening(setup, rng, "random"), 8.0, rng, 0.1)


PARTS: dict[str, Callable[[], None]] = {
    **{name: lambda name=name: _scene(name) for name in SCENES},
    "planner": _planner,
    "derivatives": _derivatives,
}
"""Functions that compile something, by name."""
