"""Measures trained policies and random actions on new layouts: `python -m agents.evaluate runs/pot`.

The command also measures players without training (`--players search:200`) and draws the learning curves (`--curve
FILE.png`). With `--film FILE.mp4` it writes a film of the first policy instead.
"""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import torch
from stable_baselines3.common.policies import BasePolicy

from agents.config import Config, load
from agents.ppo import deterministic, make_env, make_evaluation
from agents.train import learning_curve
from billiards_env.bench.evaluation import evaluation_seeds, measure, play_together, row_printer
from billiards_env.commands import Parser, all_jobs, ending
from billiards_env.games import GAMES
from billiards_env.players.named import find_player
from billiards_env.sb3 import load_policy
from billiards_env.sb3.policy_player import playable
from billiards_env.sb3.weights import check_finished, slim
from billiards_env.support.checks import Range, integer
from billiards_env.support.files import check_path, replacing, write_atomically, write_json

LAYOUTS = 1000
"""The largest number of episodes of a player without training."""

FILMED, PAUSE = 5, 0.7
"""The number of episodes of a film, and the time that the balls stay at rest after an episode, s."""


def load_run(run_dir: Path, env: Mapping[str, Any] | None = None) -> tuple[Config, BasePolicy]:
    """Returns the configuration and the trained policy of a run.

    Args:
        run_dir: The folder of the run.
        env: Arguments of `gym.make("Billiards-v0", ...)` that replace those of the run.

    Returns:
        The configuration, and the policy. `policy.predict` returns actions for `make_env(config)`.

    Raises:
        FileNotFoundError: If the folder holds no finished run.
        OSError: If a file cannot be read.
        ValueError: If the configuration is invalid, or `policy.pt` does not hold the weights of its policy.
        TypeError: If a value of the configuration has the wrong type.
    """
    check_finished(run_dir)
    config = load(run_dir / "config.yaml")
    arguments, policy = load_policy(run_dir, env)
    return dataclasses.replace(config, env=arguments), policy


def evaluate(run_dir: Path, episodes: int | None = None, seed: int | None = None) -> dict[str, Any]:
    """Evaluates the policy of a run, without exploration noise, and random actions on the same layouts.

    Args:
        run_dir: The folder of a finished run.
        episodes: The number of episodes; None for the number in the configuration.
        seed: The seed of the layouts; None for the seed in the configuration. Training uses none of these layouts.

    Returns:
        `seed`, and the results of `play_together` under `policy` and `random`. They are also in
        `run_dir/evaluation.json`.

    Raises:
        FileNotFoundError: If the folder holds no finished run.
        ValueError: If `episodes` or `seed` is invalid, or the policy does not fit the configuration.
    """
    config, policy = load_run(run_dir)
    episodes = integer("episodes", config.evaluation_episodes if episodes is None else episodes, "num_envs")
    seed = integer("seed", config.seed if seed is None else seed, Range(0, 2**32 - 1))
    seeds = evaluation_seeds(seed, episodes).tolist()
    envs = make_evaluation(config, episodes)
    envs.action_space.seed(seed)
    result = {
        "seed": seed,
        "policy": play_together(envs, deterministic(policy), seeds),
        "random": play_together(envs, lambda observations: envs.action_space.sample(), seeds),
    }
    envs.close()
    write_json(run_dir / "evaluation.json", result)
    return result


def evaluate_player(run_dir: Path, player: str, episodes: int | None = None, seed: int | None = None) -> dict[str, Any]:
    """Returns the result of a player without training on the first layouts of `evaluate`; see `play_episodes`.

    Raises:
        ValueError: If there is no such player.
    """
    config, _ = load_run(run_dir)
    noise = (0.0, 0.0) if config.noise is None else (config.noise["angle_std"], config.noise["speed_std"])
    episodes = min(episodes or config.evaluation_episodes, LAYOUTS)
    seed = config.seed if seed is None else seed
    return measure(player, {"noise": config.noise, **config.env}, noise, episodes, seed)


def film(run_dir: Path, path: Path, episodes: int = FILMED, seed: int | None = None) -> list[dict[str, Any]]:
    """Films the policy of a run, without exploration, on layouts that do not occur in training.

    Args:
        run_dir: The folder of a finished run.
        path: The film, an MP4 file.
        episodes: The number of episodes.
        seed: The seed of the layouts; None for the seed of the configuration.

    Returns:
        The last `info` of each episode.

    Raises:
        FileNotFoundError: If `run_dir` holds no finished run, or the folder of the film does not exist.
        ImportError: If the extra `render` is not installed.
        ValueError: If `path` does not end in ".mp4".
    """
    target = check_path(path, ".mp4")
    from billiards_env.drawing.film import film_writer

    config, policy = load_run(run_dir)
    env: Any = make_env(config, "rgb_array_list")
    infos, fps = [], env.metadata["render_fps"]
    with contextlib.closing(env), film_writer(target, fps) as write:
        for number in evaluation_seeds(config.seed if seed is None else seed, episodes).tolist():
            observation, info = env.reset(seed=number)
            over = False
            while not over:
                for frame in env.render():
                    write(frame)
                observation, _, over, _, info = env.step(policy.predict(observation, deterministic=True)[0])
            frames = env.render()
            for frame in frames:
                write(frame)
            write(frames[-1], PAUSE)
            infos.append(info)
    return infos


def draw_curves(runs: Sequence[Path], path: Path) -> None:
    """Draws the success on new layouts against the number of shots, with a line for each run.

    Raises:
        ImportError: If the extra `plot` is not installed.
        ValueError: If `path` does not end in ".png".
    """
    target = check_path(path, ".png")
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7, 4), dpi=110, layout="constrained")
    axes = figure.add_subplot()
    for run in runs:
        curve = learning_curve(run)
        axes.plot([point.steps / 1e6 for point in curve], [100 * point.success for point in curve], label=run.name)
    axes.set(xlabel="million shots", ylabel="success on new layouts (%)", ylim=(0, 102))
    axes.grid(alpha=0.3)
    axes.legend(frameon=False)
    with replacing(target) as temporary:
        figure.savefig(temporary)


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m agents.evaluate --help`."""
    parser = Parser(
        prog="python -m agents.evaluate",
        description="Measure trained policies and random actions on new layouts, or film the first policy.",
    )
    parser.add_argument("runs", type=Path, nargs="+", help="folders of finished runs of one task, e.g. runs/pot")
    parser.add_argument(
        "--players", nargs="*", default=(), help=f"players without training, measured on {LAYOUTS} layouts at most"
    )
    parser.add_argument("--curve", type=Path, metavar="FILE.png", help="draw the learning curves of the runs")
    parser.add_argument("--episodes", type=int, help=f"number (default: as in the config; {FILMED} with --film)")
    parser.add_argument("--seed", type=int, help="seed of the layouts (default: as in the config)")
    parser.add_argument(
        "--slim", type=Path, metavar="FOLDER", help="write a smaller copy of the first policy, for playing only"
    )
    parser.add_argument("--film", type=Path, metavar="FILE.mp4", help="write a film of the first policy instead")
    args = parser.parse_args(arguments)
    run_dir: Path = args.runs[0]
    with ending():
        if args.slim is not None:
            if args.slim.exists():
                raise ValueError(f"--slim = {str(args.slim)!r}: expected a new folder")
            for name, content in slim(run_dir).items():
                write_atomically(args.slim / name, content)
            print(f"wrote {args.slim}")
        elif args.film is not None:
            infos = film(run_dir, args.film, FILMED if args.episodes is None else args.episodes, args.seed)
            for k, info in enumerate(infos, 1):
                print(f"episode {k}: {'success' if info['is_success'] else 'no success'}, score {info['score']}")
        else:
            for run in args.runs:
                check_finished(run)
            if args.curve is not None:
                draw_curves(args.runs, args.curve)
            for name in args.players:  # a wrong name is an error before the first policy plays
                find_player(name, make_env(load_run(run_dir)[0]))
            torch.set_num_threads(1)  # small networks are faster on one thread
            show = row_printer([*map(str, args.runs), "random", *args.players])
            results = []
            with all_jobs() as job:
                for run in args.runs:
                    with job(str(run)):
                        results.append(evaluate(run, args.episodes, args.seed))
                        show(str(run), results[-1]["policy"])
                for result in results[:1]:
                    show("random", result["random"])
                for name in args.players:
                    with job(name):
                        show(name, evaluate_player(run_dir, name, args.episodes, args.seed))
                print_commands(run_dir)


def print_commands(run_dir: Path) -> None:
    """Prints commands for the next step."""
    print(f"\nfilm:  python -m agents.evaluate {run_dir} --film {run_dir.resolve().name}.mp4")
    if (rules := playable(run_dir)) is not None:
        game = f"--rules {rules} --scene {GAMES[rules].scene}"
        print(f"play:  python -m billiards_env.play {game} --players human,policy:{run_dir}")
    print(f"log:   tensorboard --logdir {run_dir}")


if __name__ == "__main__":
    main()
