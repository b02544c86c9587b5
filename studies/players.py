"""Measures the players of `billiards_env.players`, which do not learn, in `Billiards-v0`."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from agents.config import ENV_ID
from agents.evaluate import play
from agents.ppo import evaluation_seeds
from billiards_env.envs.wrappers import ExecutionNoise
from billiards_env.players.env_player import situation
from billiards_env.players.strategies import find_strategy


def measure(
    name: str, arguments: Mapping[str, Any], noise: tuple[float, float], episodes: int, seed: int
) -> dict[str, Any]:
    """Plays episodes of `gym.make("Billiards-v0", **arguments)` on the layouts of `agents.evaluate`.

    `name` is a player without training, see `find_strategy`. `noise` has the standard deviations of the execution
    noise: of the direction, degrees, and of the speed, m/s. `seed` is that of the layouts, the noise and the player.

    Returns:
        The results of `agents.evaluate.play`, `mean_shots`, the mean number of shots of an episode, and
        `ms_per_decision`, the median time for the choice of a shot.
    """
    env = gym.make(ENV_ID, **arguments)
    if any(noise):
        env = ExecutionNoise(env, *noise)
    base: Any = env.unwrapped
    strategy, rng, times = find_strategy(name, noise), np.random.default_rng(seed), []

    def act(observation: NDArray[np.float32]) -> NDArray[np.float64]:
        begin = time.perf_counter()
        action = strategy(situation(base), rng)
        times.append(time.perf_counter() - begin)
        return action

    result = play(env, act, evaluation_seeds(seed, episodes).tolist())
    env.close()
    return {**result, "mean_shots": len(times) / episodes, "ms_per_decision": 1e3 * float(np.median(times))}
