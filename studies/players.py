"""Measures the players without training of `billiards_env.players` in `Billiards-v0`: `python -m studies.players`.

The layouts are those on which `agents.evaluate` measures trained policies.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from agents.config import ENV_ID, Config, changed
from agents.evaluate import play
from agents.ppo import evaluation_seeds
from benchmarks import table
from billiards_env.envs.wrappers import ExecutionNoise
from billiards_env.files import write_json
from billiards_env.players.env_player import situation
from billiards_env.players.strategies import STRATEGIES, find_strategy


def measure(
    name: str, arguments: Mapping[str, Any], noise: tuple[float, float], episodes: int, seed: int
) -> dict[str, Any]:
    """Plays episodes on the layouts of `agents.evaluate` with a player without training.

    Args:
        name: The player, see `billiards_env.players.strategies.find_strategy`.
        arguments: Arguments of `gym.make("Billiards-v0", ...)`.
        noise: Standard deviations of the execution noise: of the direction, degrees, and of the speed, m/s.
        episodes: The number of episodes.
        seed: The seed of the layouts, the noise and the player.

    Returns:
        The results of `agents.evaluate.play`, `mean_shots`, the mean number of shots of an episode, and
        `ms_per_decision`, the median time for the choice of a shot.

    Raises:
        ValueError: If a name or an argument is unknown or impossible.
        TypeError: If an argument has the wrong type.
    """
    for name_of, value, least in (("episodes", episodes, 1), ("seed", seed, 0)):
        if value < least:
            raise ValueError(f"{name_of} = {value}: expected a whole number >= {least}")
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


def row(name: str, result: Mapping[str, Any]) -> tuple[str, ...]:
    """Returns the cells of a player in the table; see `measure`."""
    low, high = result["confidence_interval_95"]
    return (
        name,
        f"{result['success_rate']:.1%}",
        f"{low:.1%} - {high:.1%}",
        f"{result['mean_reward']:.3f}",
        f"{result['ms_per_decision']:.2f}",
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs the command line; see `python -m studies.players --help`."""
    parser = argparse.ArgumentParser(
        prog="python -m studies.players", description="Measure players without training on new layouts."
    )
    parser.add_argument("--episodes", type=int, default=1000, help="episodes of each player (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="seed of the layouts (default: %(default)s)")
    parser.add_argument(
        "--players",
        nargs="+",
        default=STRATEGIES,
        help=f"of {', '.join(STRATEGIES)}; search:K simulates K shots (default: all)",
    )
    parser.add_argument("--env", default="{}", help="arguments of the environment as JSON (default: %(default)s)")
    parser.add_argument(
        "--noise", nargs=2, type=float, metavar=("DEGREES", "M/S"), default=(0.0, 0.0), help="execution noise"
    )
    parser.add_argument("--output", type=Path, help="JSON file to write")
    args = parser.parse_args(arguments)
    try:
        env = json.loads(args.env)
        changed(Config(timesteps=0), {"env": env})  # raises an error before the first episode
        noise = (args.noise[0], args.noise[1])
        results = {name: measure(name, env, noise, args.episodes, args.seed) for name in args.players}
        if args.output is not None:
            found = {"env": env, "noise": list(noise), "seed": args.seed, "results": results}
            write_json(args.output, found)
    except json.JSONDecodeError as error:
        sys.exit(f"error: env = {args.env!r}: expected JSON, such as '{{\"n_object_balls\": 3}}' ({error})")
    except (OSError, TypeError, ValueError) as error:
        sys.exit(f"error: {error}")
    except KeyboardInterrupt:
        sys.exit(130)
    head = ("player", "success", "95 % interval", "mean reward", "ms/decision")
    print(table(head, [row(name, result) for name, result in results.items()]))


if __name__ == "__main__":
    main()
