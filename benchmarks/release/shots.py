"""Plays the common environments and prints a hash of all results: `python benchmarks/release/shots.py`.

It imports the installed `billiards_env`, not the package in the repository. It compiles the kernels that have no
machine code.
"""

from __future__ import annotations

import hashlib
import json
from typing import Any

import gymnasium as gym
import numpy as np

import billiards_env

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
"""The arguments of the environments whose machine code is in the wheel."""


def result_bytes(arguments: dict[str, Any]) -> bytes:
    """Returns the results of `step`, of two steps of 8 environments, and of `simulate`, as bytes."""
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
        made.append(billiards_env.simulate(scene, start, moving, record=True).positions)
        made.append(billiards_env.simulate_batch(scene, start[None], moving[None]).positions)
    return b"".join(np.asarray(value).tobytes() for value in made)


def main() -> None:
    """Prints a hash of the results in each environment."""
    print(json.dumps([hashlib.sha256(result_bytes(arguments)).hexdigest()[:16] for arguments in ENVIRONMENTS]))


if __name__ == "__main__":
    main()
