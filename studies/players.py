"""Measures the players without training of `billiards_env.players` in `Billiards-v0`: `python -m studies.players`.

They play the layouts on which `agents.evaluate` measures trained policies. The results of the usual cases are written
to `studies/results/players.json`. Those of other cases are only printed, unless `--output` names a file.
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

from agents.config import ENV_ID, resolved_env
from agents.evaluate import play
from agents.ppo import evaluation_seeds
from benchmarks import table
from billiards_env.envs.wrappers import ExecutionNoise
from billiards_env.files import write_json
from billiards_env.players.env_player import situation
from billiards_env.players.strategies import STRATEGIES, find_strategy
from studies import RESULTS

OUTPUT = RESULTS / "players.json"

# Name: arguments of the environment, standard deviations of the execution noise (degrees, m/s), players.
CASES: dict[str, tuple[dict[str, Any], tuple[float, float], tuple[str, ...]]] = {
    "1 ball, 1 shot": ({}, (0.0, 0.0), ("random", "geometric", "search:20", "search:1000")),
    "1 ball, 1 shot, with noise": ({}, (0.125, 0.075), ("random", "geometric", "search:20", "search:1000")),
    "3 balls, 5 shots": (
        {"n_object_balls": 3, "max_shots": 5},
        (0.0, 0.0),
        ("random", "geometric", "search:20", "search:1000"),
    ),
    "carom, 1 shot": ({"scene": "carom", "task": "carom"}, (0.0, 0.0), ("random", "search:20", "search:1000")),
}


def measure(
    name: str, arguments: Mapping[str, Any], noise: tuple[float, float], episodes: int, seed: int
) -> dict[str, Any]:
    """Plays episodes on the layouts that `agents.evaluate` uses.

    Args:
        name: The player.
        arguments: Arguments of `gym.make("Billiards-v0", ...)`.
        noise: Standard deviations of the execution noise: of the direction, degrees, and of the speed, m/s.
        episodes: The number of episodes.
        seed: The seed of the layouts, the noise and the player.

    Returns:
        The results of `agents.evaluate.play`, and `ms_per_decision`, the median time that the player takes for a shot.

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
        velocity = strategy(situation(base), rng)
        times.append(time.perf_counter() - begin)
        return velocity / base.max_speed

    result = play(env, act, evaluation_seeds(seed, episodes).tolist())
    env.close()
    return {**result, "ms_per_decision": 1e3 * float(np.median(times))}


def blocks(result: Mapping[str, Any]) -> dict[str, str]:
    """Returns the table of the results as Markdown, by name."""
    head = ("case", "player", "success", "95 % interval", "mean reward", "ms/decision")
    return {"table": table(head, [row(found) for found in result["results"]], left=2)}


def row(result: Mapping[str, Any]) -> tuple[str, ...]:
    """Returns the cells of a result, which is the output of `measure` with `case` and `player`."""
    low, high = result["confidence_interval_95"]
    return (
        result["case"],
        result["player"],
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
    parser.add_argument("--players", nargs="+", help="e.g. geometric search:100 (default: those of each case)")
    parser.add_argument("--env", help="arguments of the environment as JSON, instead of the usual cases")
    parser.add_argument("--noise", nargs=2, type=float, metavar=("DEGREES", "M/S"), help="execution noise, with --env")
    parser.add_argument(
        "--output", type=Path, help=f"JSON file (default: {OUTPUT} without other options; with them nothing is written)"
    )
    args = parser.parse_args(arguments)
    usual = all(getattr(args, name) == parser.get_default(name) for name in vars(args))
    output: Path | None = OUTPUT if usual else args.output
    try:
        cases = CASES
        noise = (args.noise[0], args.noise[1]) if args.noise else (0.0, 0.0)
        if args.env is not None or args.noise is not None:
            given = json.loads(args.env or "{}")
            resolved = resolved_env(given)
            cases = {"own": ({key: resolved[key] for key in given}, noise, tuple(STRATEGIES))}
        results = []
        for case, (env, noise, players) in cases.items():
            for name in args.players or players:
                measured = measure(name, env, noise, args.episodes, args.seed)
                results.append({"case": case, "env": env, "noise": list(noise), "player": name, **measured})
                print(f"{case}, {name}: {measured['success_rate']:.1%}", flush=True)
        result = {"seed": args.seed, "results": results}
        if output is not None:
            write_json(output, result)
    except json.JSONDecodeError as error:
        sys.exit(f"error: env = {args.env!r}: expected JSON, such as '{{\"n_object_balls\": 3}}' ({error})")
    except (OSError, TypeError, ValueError) as error:
        sys.exit(f"error: {error}")
    except KeyboardInterrupt:
        sys.exit(130)
    print(f"\n{blocks(result)['table']}\n")
    print("not written, because there is no --output" if output is None else f"written to {output}")


if __name__ == "__main__":
    main()
