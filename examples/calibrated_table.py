"""From tracks to a policy: fits a table, trains policies for it and for the default table, and compares them.

    python examples/calibrated_table.py

The tracks come from simulated shots on a table whose constants the fit does not receive; `read_tracks` reads the tracks
of a real table. The task is three-cushion billiards, one shot from a random layout. For each seed, one policy trains on
tables with constants drawn from the intervals of the fit, and one on the default table. All are tested on tables drawn
from these intervals, with the noise of the strikes in the tracks.
"""

import dataclasses
from collections.abc import Sequence
from typing import Any

import gymnasium as gym
import numpy as np
import torch
from stable_baselines3 import PPO

from billiards_env import Scene, simulate
from billiards_env.bench.evaluation import evaluation_seeds, play_together
from billiards_env.calibration import Calibration, calibrate, observed
from billiards_env.intervals import over_seeds
from billiards_env.sb3 import PPO_SETTINGS, AimPolicy, SameStepVecEnv
from billiards_env.scene import Physics, layouts

DEFAULT = dataclasses.replace(Scene.named("carom"), physics=Physics(ball_ball="frictional"))
CONSTANTS = Physics(
    ball_ball="frictional",
    mu_slide=0.19,
    mu_roll=0.0046,
    spin_decay=1.0,
    e_ball=0.914,
    mu_ball_factor=3.8,
    e_cushion=0.847,
    mu_cushion=0.252,
)
TABLE = dataclasses.replace(DEFAULT, physics=CONSTANTS)
"""A table whose cloth is faster, and whose balls have more friction, than those of `DEFAULT`."""
TURN, SPEED = 0.002, 0.02
"""Standard deviations of the noise of the strikes: rad, and m/s."""
SEEDS = (0, 1, 2)
# More passes over larger batches than by default: few shots score at first.
SETTINGS: dict[str, Any] = {**PPO_SETTINGS, "batch_size": 2048, "n_epochs": 8}
POLICY: dict[str, Any] = {"points": 8, "speeds": [0.3, 0.5, 0.75, 1.0], "exploration": 150_000}


def fitted_table(shots: int) -> tuple[Calibration, np.ndarray]:
    """Returns the fit of simulated shots, and the intended velocities of the cue ball (shots, 2), m/s."""
    rng, tracks, intended = np.random.default_rng(0), [], []
    for k in range(shots):
        places = layouts.draw("random", TABLE, rng)
        aim = places[1] - places[0]
        aim *= rng.uniform(2.0, 4.0) / np.hypot(*aim)
        turn, more = rng.normal(0.0, TURN), 1.0 + rng.normal(0.0, SPEED) / np.hypot(*aim)
        velocity = more * (aim + turn * np.array([-aim[1], aim[0]]))
        shot = simulate(TABLE, places, velocity, record=True)
        tracks.append(observed(f"{k}", shot, np.arange(150) / 50.0, noise=0.0005, seed=k))
        intended.append(aim)
    return calibrate(DEFAULT, tracks, hold_back=False), np.array(intended)


def environments(num_envs: int, **world: Any) -> Any:
    """Returns environments of one shot; `world` gives their other arguments."""
    arguments = {"task": "three_cushion", "layout": "random", "max_shots": 1, **world}
    return gym.make_vec("billiards_env:Billiards-v0", num_envs=num_envs, **arguments)


def train(steps: int, seed: int, **world: Any) -> PPO:
    """Returns a policy that was trained for a number of shots."""
    torch.set_num_threads(1)  # small networks are faster on one thread
    envs = SameStepVecEnv(environments(4096, **world))
    return PPO(AimPolicy, envs, **SETTINGS, policy_kwargs=POLICY, seed=seed).learn(steps)


def success(model: PPO, episodes: int, **world: Any) -> float:
    """Returns the share of shots that score."""
    seeds = evaluation_seeds(0, episodes).tolist()
    played = play_together(
        environments(episodes, **world), lambda seen: model.predict(seen, deterministic=True)[0], seeds
    )
    return float(played["success_rate"])


def run(steps: int, shots: int = 12, episodes: int = 4000, seeds: Sequence[int] = SEEDS) -> dict[str, dict[str, Any]]:
    """Trains both policies for each seed, and returns the mean share of scoring shots and its interval, by policy."""
    result, intended = fitted_table(shots)
    print(result)
    noise: Any = result.noise(intended)
    fitted = {"scene": result.scene, "randomize": result.randomize(), "noise": noise}
    worlds = {"fitted": fitted, "default": {"scene": DEFAULT, "noise": noise}}
    shares: dict[str, list[float]] = {name: [] for name in worlds}
    for seed in seeds:
        for name, world in worlds.items():
            shares[name].append(success(train(steps, seed, **world), episodes, **fitted))
            print(f"seed {seed}, trained on the {name} table: {shares[name][-1]:.1%}", flush=True)
    return {name: over_seeds(values) for name, values in shares.items()}


if __name__ == "__main__":
    for name, share in run(600_000).items():
        low, high = share["interval"]
        interval = f"95% interval {low:.1%} to {high:.1%}"
        print(f"trained on the {name} table: {share['mean']:.1%} of the shots score ({interval})")
