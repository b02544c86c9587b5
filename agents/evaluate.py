"""Measures trained policies and random actions on new layouts: `python -m agents.evaluate runs/pot`.

The command also measures players without training (`--players search:200`) and draws the learning curves (`--curve
FILE.png`). With `--film FILE.mp4` it writes a film of the first policy instead, and with `--show` it opens a
window (`agents.film`).
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from agents.config import Count, Seed, validate
from agents.film import EPISODES, film, show
from agents.output import print_commands, print_table
from agents.ppo import deterministic, load_policy, make_vector
from agents.train import learning_curve
from billiards_env.checks import missing
from billiards_env.evaluation import evaluation_seeds, measure, play_together
from billiards_env.files import check_path, write_json
from billiards_env.games import RULES
from billiards_env.sb3.policy_player import playable

LAYOUTS = 1000
"""The largest number of episodes of a player without training."""


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


def evaluate_players(run_dir: Path, players: Sequence[str], result: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Returns the results of players without training (`play`) on the first layouts of a result of `evaluate`.

    Raises:
        ValueError: If there is no such player.
    """
    config, _ = load_policy(run_dir)
    noise = (0.0, 0.0) if config.noise is None else (config.noise.angle_std, config.noise.speed_std)
    episodes = min(result["policy"]["episodes"], LAYOUTS)
    return {name: measure(name, config.env, noise, episodes, result["seed"]) for name in players}


def draw_curves(runs: Sequence[Path], path: Path) -> None:
    """Draws the success on new layouts against the number of shots, with a line for each run.

    Raises:
        ImportError: If the extra `plot` is not installed.
        ValueError: If `path` does not end in ".png".
    """
    target = check_path(path, ".png")
    try:
        from matplotlib.figure import Figure
    except ModuleNotFoundError as error:
        raise missing("matplotlib", "plot") from error
    figure = Figure(figsize=(7, 4), dpi=110, layout="constrained")
    axes = figure.add_subplot()
    for run in runs:
        curve = learning_curve(run)
        axes.plot([point.steps / 1e6 for point in curve], [100 * point.success for point in curve], label=str(run))
    axes.set(xlabel="million shots", ylabel="success on new layouts (%)", ylim=(0, 102))
    axes.grid(alpha=0.3)
    axes.legend(frameon=False)
    figure.savefig(target)


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m agents.evaluate --help`."""
    parser = argparse.ArgumentParser(
        prog="python -m agents.evaluate",
        description="Measure trained policies and random actions on new layouts, or film or show the first policy.",
    )
    parser.add_argument("runs", type=Path, nargs="+", help="folders of finished runs of one task, e.g. runs/pot")
    parser.add_argument(
        "--players", nargs="*", default=(), help=f"players without training, measured on {LAYOUTS} layouts at most"
    )
    parser.add_argument("--curve", type=Path, metavar="FILE.png", help="draw the learning curves of the runs")
    parser.add_argument(
        "--episodes", help=f"number of episodes (default: that of the config; {EPISODES} with --film or --show)"
    )
    parser.add_argument("--seed", help="seed of the layouts (default: that of the config)")
    instead = parser.add_mutually_exclusive_group()
    instead.add_argument("--film", type=Path, metavar="FILE.mp4", help="write a film of the policy instead")
    instead.add_argument("--show", action="store_true", help="show the policy in a window instead")
    args = parser.parse_args(arguments)
    run_dir: Path = args.runs[0]
    try:
        episodes = validate(Count | None, args.episodes, "episodes")
        seed = validate(Seed | None, args.seed, "seed")
        if args.film is not None:
            _print_episodes(film(run_dir, args.film, episodes or EPISODES, seed))
            print(f"written to {args.film}")
        elif args.show:
            _print_episodes(show(run_dir, episodes or EPISODES, seed))
        else:
            if args.curve is not None:
                draw_curves(args.runs, args.curve)
            results = {run: evaluate(run, episodes, seed) for run in args.runs}
            _print(results, evaluate_players(run_dir, args.players, results[run_dir]))
            if args.curve is not None:
                print(f"learning curves in {args.curve}")
    except (ImportError, OSError, RuntimeError, TypeError, ValueError) as error:  # RuntimeError: no display
        sys.exit(f"error: {error}")
    except KeyboardInterrupt:
        sys.exit(130)


def _print_episodes(infos: Sequence[Mapping[str, Any]]) -> None:
    """Prints the outcome of each episode."""
    for k, info in enumerate(infos, 1):
        print(f"episode {k}: {'success' if info['is_success'] else 'no success'}, score {info['score']}")


def _print(results: Mapping[Path, Mapping[str, Any]], players: Mapping[str, Mapping[str, Any]]) -> None:
    """Prints the results of `evaluate` by run and those of `evaluate_players`, and commands for the next step."""
    run_dir, result = next(iter(results.items()))
    found = {"policy" if len(results) == 1 else run.resolve().name: results[run]["policy"] for run in results}
    rows = []
    for name, r in {**found, "random": result["random"], **players}.items():
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
    title += "".join(f"; {name}: {r['episodes']:,}" for name, r in players.items())
    print_table(title, ("player", "success", "95% interval", "score", "95% interval", "reward"), rows)
    print("written to", ", ".join(str(run / "evaluation.json") for run in results), end="\n\n")
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
