"""Measures a trained policy and random actions on new layouts: `python -m agents.evaluate runs/pot`.

With `--film FILE.mp4` it writes a film of the policy instead, and with `--show` it opens a window (`agents.film`).
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.policies import BasePolicy

from agents.config import Count, Seed, validate
from agents.film import EPISODES, film, show
from agents.output import print_commands, print_table
from agents.ppo import load_policy, make_vector
from billiards_env.evaluation import evaluation_seeds, play_together
from billiards_env.files import write_json
from billiards_env.games import RULES
from billiards_env.sb3.policy_player import playable


def deterministic(policy: BasePolicy) -> Callable[[NDArray[np.float32]], NDArray[np.floating[Any]]]:
    """Returns the argument `act` of `play` for a policy without exploration noise."""
    return lambda observations: policy.predict(observations, deterministic=True)[0]


def evaluate(run_dir: Path, episodes: int | None = None, seed: int | None = None) -> dict[str, Any]:
    """Evaluates the policy of a run, without exploration noise, and random actions on the same layouts.

    Args:
        run_dir: The folder of a finished run.
        episodes: The number of episodes; None for that of the configuration.
        seed: The seed of the layouts; None for that of the configuration. Training uses none of these layouts.

    Returns:
        `seed`, and the results of `play` under `policy` and `random`. They are also in `run_dir/evaluation.json`.

    Raises:
        FileNotFoundError: If the folder holds no finished run.
        ValueError: If `episodes` or `seed` is impossible, or the policy does not fit the configuration.
    """
    config, policy = load_policy(run_dir)
    episodes = config.evaluation_episodes if episodes is None else episodes
    seed = config.seed if seed is None else seed
    validate(Count, episodes, "episodes")
    validate(Seed, seed, "seed")
    seeds = evaluation_seeds(seed, episodes).tolist()
    envs = make_vector(config, episodes)
    envs.action_space.seed(seed)
    result = {
        "seed": seed,
        "policy": play_together(envs, deterministic(policy), seeds),
        "random": play_together(envs, lambda observations: envs.action_space.sample(), seeds),
    }
    envs.close()
    write_json(run_dir / "evaluation.json", result)
    return result


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m agents.evaluate --help`."""
    parser = argparse.ArgumentParser(
        prog="python -m agents.evaluate",
        description="Measure a trained policy and random actions on new layouts, or film or show the policy.",
    )
    parser.add_argument("run_dir", type=Path, help="folder of a finished run, e.g. runs/pot")
    parser.add_argument(
        "--episodes", help=f"number of episodes (default: that of the config; {EPISODES} with --film or --show)"
    )
    parser.add_argument("--seed", help="seed of the layouts (default: that of the config)")
    instead = parser.add_mutually_exclusive_group()
    instead.add_argument("--film", type=Path, metavar="FILE.mp4", help="write a film of the policy instead")
    instead.add_argument("--show", action="store_true", help="show the policy in a window instead")
    args = parser.parse_args(arguments)
    run_dir: Path = args.run_dir
    try:
        episodes = validate(Count | None, args.episodes, "episodes")
        seed = validate(Seed | None, args.seed, "seed")
        if args.film is not None:
            _print_episodes(film(run_dir, args.film, episodes or EPISODES, seed))
            print(f"written to {args.film}")
        elif args.show:
            _print_episodes(show(run_dir, episodes or EPISODES, seed))
        else:
            _print(run_dir, evaluate(run_dir, episodes, seed))
    except (ImportError, OSError, RuntimeError, TypeError, ValueError) as error:  # RuntimeError: no display
        sys.exit(f"error: {error}")
    except KeyboardInterrupt:
        sys.exit(130)


def _print_episodes(infos: Sequence[Mapping[str, Any]]) -> None:
    """Prints the outcome of each episode."""
    for k, info in enumerate(infos, 1):
        print(f"episode {k}: {'success' if info['is_success'] else 'no success'}, score {info['score']}")


def _print(run_dir: Path, result: Mapping[str, Any]) -> None:
    """Prints the result of `evaluate` and commands for the next step."""
    rows = []
    for name in ("policy", "random"):
        r = result[name]
        rates, scores = r["confidence_interval_95"], r["score_interval_95"]
        rows.append(
            (
                name,
                f"{r['success_rate']:.1%}",
                "{:.1%} to {:.1%}".format(*rates),
                f"{r['mean_score']:.3f}",
                "-" if scores is None else "{:.3f} to {:.3f}".format(*scores),
                f"{r['mean_reward']:.3f}",
            )
        )
    title = f"{result['policy']['episodes']:,} episodes on new layouts, without exploration (seed {result['seed']})"
    print_table(title, ("player", "success", "95% interval", "score", "95% interval", "reward"), rows)
    print(f"written to {run_dir / 'evaluation.json'}\n")
    this = ("-m", "agents.evaluate", str(run_dir))
    commands = {"film": (*this, "--film", f"{run_dir.resolve().name}.mp4"), "watch": (*this, "--show")}
    if (rules := playable(run_dir)) is not None:
        game = ("--rules", rules, "--scene", RULES[rules].scene, "--players", f"human,policy:{run_dir}")
        commands["play against it"] = ("-m", "billiards_env.play", *game)
    if (run_dir / "tensorboard").is_dir():
        commands["learning curves"] = ("-m", "tensorboard.main", "--logdir", str(run_dir))
    print_commands("Next:", commands)


if __name__ == "__main__":
    main()
