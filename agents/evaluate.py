"""Measures a trained policy and a random one on new layouts: `python -m agents.evaluate runs/pot`."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import VectorEnv
from numpy.typing import NDArray
from stable_baselines3.common.policies import ActorCriticPolicy

from agents.intervals import mean_interval, wilson_interval
from agents.ppo import evaluation_seeds, in_frame, load_policy, make_vector
from billiards_env.files import write_json


def play(
    env: gym.Env[Any, Any], act: Callable[[NDArray[np.float32]], NDArray[np.floating[Any]]], seeds: Iterable[int]
) -> dict[str, Any]:
    """Plays one episode for each seed.

    Args:
        env: The environment; the last `info` of an episode has `success` and `score`.
        act: A function that returns the action for an observation.
        seeds: The seeds of the episodes.

    Returns:
        `episodes`, `successes`, `success_rate` and its `confidence_interval_95`, `mean_score` and its
        `score_interval_95` (see `mean_interval`), and `mean_reward`, the mean over the episodes of the sum of the
        rewards.
    """
    successes, scores, rewards = [], [], []
    for seed in seeds:
        observation, info = env.reset(seed=int(seed))
        total, done = 0.0, False
        while not done:
            observation, reward, terminated, truncated, info = env.step(act(observation))
            total += float(reward)
            done = terminated or truncated
        successes.append(bool(info["success"]))
        scores.append(float(info["score"]))
        rewards.append(total)
    return summary(successes, scores, rewards)


def play_together(
    envs: VectorEnv[Any, Any, Any],
    act: Callable[[NDArray[np.float32]], NDArray[np.floating[Any]]],
    seeds: Sequence[int],
) -> dict[str, Any]:
    """Plays one episode for each seed, all at the same time. The episodes are those of `play`.

    Args:
        envs: One environment for each seed, with same-step autoreset.
        act: A function that returns the actions for the observations.
        seeds: The seeds of the episodes.

    Returns:
        The same as `play`.
    """
    observations, _ = envs.reset(seed=[int(seed) for seed in seeds])  # pyright: ignore[reportArgumentType]
    over = np.zeros(len(seeds), np.bool_)
    successes, scores, rewards = over.copy(), np.zeros(len(seeds)), np.zeros(len(seeds))
    while not over.all():
        observations, gained, terminated, truncated, infos = envs.step(act(observations))
        rewards[~over] += gained[~over]
        ended = (terminated | truncated) & ~over
        if ended.any():
            successes[ended] = infos["final_info"]["success"][ended]
            scores[ended] = infos["final_info"]["score"][ended]
        over |= ended
    return summary(successes.tolist(), scores.tolist(), rewards.tolist())


def summary(successes: Sequence[bool], scores: Sequence[float], rewards: Sequence[float]) -> dict[str, Any]:
    """Returns the result of `play`, from the outcome of each episode."""
    return {
        "episodes": len(successes),
        "successes": sum(successes),
        "success_rate": sum(successes) / len(successes),
        "confidence_interval_95": list(wilson_interval(sum(successes), len(successes))),
        "mean_score": sum(scores) / len(scores),
        "score_interval_95": None if (interval := mean_interval(scores)) is None else list(interval),
        "mean_reward": sum(rewards) / len(rewards),
    }


def deterministic(policy: ActorCriticPolicy) -> Callable[[NDArray[np.float32]], NDArray[np.floating[Any]]]:
    """Returns a function for `play` and `play_together`: a policy without exploration noise."""
    return lambda observations: policy.predict(observations, deterministic=True)[0]


def evaluate(run_dir: Path, episodes: int | None = None, seed: int | None = None) -> dict[str, Any]:
    """Evaluates the policy of a run, without exploration noise, and a random policy on the same layouts.

    Args:
        run_dir: The folder of a finished run.
        episodes: The number of episodes; None for that of the configuration.
        seed: The seed of the layouts, which the training does not use; None for that of the configuration.

    Returns:
        `seed`, and the results of `play` under `policy` and `random`; also written to `run_dir/evaluation.json`.

    Raises:
        FileNotFoundError: If the folder holds no finished run.
        ValueError: If `episodes` or `seed` is impossible, or the model does not fit the configuration.
    """
    config, policy = load_policy(run_dir)
    episodes = config.evaluation_episodes if episodes is None else episodes
    seed = config.seed if seed is None else seed
    if episodes < 1:
        raise ValueError(f"episodes = {episodes}: expected a whole number >= 1")
    if seed < 0:
        raise ValueError(f"seed = {seed}: expected a whole number >= 0")
    seeds = evaluation_seeds(seed, episodes).tolist()
    envs = make_vector(config, episodes)
    framed = in_frame(config, envs)
    framed.action_space.seed(seed)
    result = {
        "seed": seed,
        "policy": play_together(envs, deterministic(policy), seeds),
        "random": play_together(framed, lambda observations: framed.action_space.sample(), seeds),
    }
    envs.close()
    write_json(run_dir / "evaluation.json", result)
    return result


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m agents.evaluate --help`."""
    parser = argparse.ArgumentParser(
        prog="python -m agents.evaluate", description="Measure a trained policy and a random one on new layouts."
    )
    parser.add_argument("run_dir", type=Path, help="folder of a finished run, e.g. runs/pot")
    parser.add_argument("--episodes", type=int, help="number of episodes (default: that of the config)")
    parser.add_argument("--seed", type=int, help="seed of the layouts (default: that of the config)")
    args = parser.parse_args(arguments)
    try:
        result = evaluate(args.run_dir, args.episodes, args.seed)
    except (OSError, TypeError, ValueError) as error:
        sys.exit(f"error: {error}")
    print(f"{result['policy']['episodes']} episodes on new layouts, seed {result['seed']}:")
    for name in ("policy", "random"):
        r = result[name]
        low, high = r["confidence_interval_95"]
        score = f"  score {r['mean_score']:.3f}"
        if r["score_interval_95"] is not None:
            score += " ({:.3f} to {:.3f})".format(*r["score_interval_95"])
        print(
            f"  {name:6}  success {r['success_rate']:6.1%}  (95 % confidence {low:.1%} to {high:.1%})"
            f"{score}  mean reward {r['mean_reward']:.3f}"
        )
    print(f"written to {args.run_dir / 'evaluation.json'}")


if __name__ == "__main__":
    main()
