"""Measures players in `Billiards-v0`: `billiards evaluate PLAYER --task pot`.

`billiards_env.players.named` has the names of players.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple, SupportsFloat

import gymnasium as gym
import numpy as np
from gymnasium.vector import VectorEnv
from numpy.typing import NDArray

from billiards_env.intervals import mean_interval, wilson_interval
from billiards_env.players.env_player import Act, acting
from billiards_env.players.named import find_player

FIRST_EVALUATION_SEED = 2**31
"""Environment seeds are below this number in training, and not below it in evaluation."""


def evaluation_seeds(seed: int, episodes: int) -> NDArray[np.int64]:
    """Returns one environment seed for each episode, (episodes,); training uses none of them.

    Example:
        >>> bool((evaluation_seeds(0, 1000) >= 2**31).all())
        True
    """
    return FIRST_EVALUATION_SEED + np.random.SeedSequence(seed).generate_state(episodes).astype(np.int64) // 2


class Step(NamedTuple):
    """The observation before a step, the action, and what `Env.step` returns; `following` is its observation."""

    observation: NDArray[np.float32]
    action: Any
    following: NDArray[np.float32]
    reward: SupportsFloat
    terminated: bool
    truncated: bool
    info: dict[str, Any]


def steps(env: gym.Env[Any, Any], act: Act, seed: int) -> Iterator[Step]:
    """Yields the steps of one episode, in which `act` chooses the actions."""
    observation, done = env.reset(seed=seed)[0], False
    while not done:
        action = act(observation)
        step = Step(observation, action, *env.step(action))
        yield step
        observation, done = step.following, step.terminated or step.truncated


def play_episodes(env: gym.Env[Any, Any], act: Act, seeds: Iterable[int]) -> dict[str, Any]:
    """Plays one episode for each seed.

    Args:
        env: The environment; the last `info` of an episode has `is_success` and `score`.
        act: A function that returns the action for an observation.
        seeds: The seeds of the episodes.

    Returns:
        `episodes`, `successes`, `success_rate` and its `confidence_interval_95`, `mean_score` and its
        `score_interval_95` (see `mean_interval`), and `mean_reward`, the mean return (sum of rewards) of an episode.
    """
    successes, scores, rewards = [], [], []
    for seed in seeds:
        played = list(steps(env, act, int(seed)))
        successes.append(bool(played[-1].info["is_success"]))
        scores.append(float(played[-1].info["score"]))
        rewards.append(sum(float(step.reward) for step in played))
    return summary(successes, scores, rewards)


def play_together(envs: VectorEnv[Any, Any, Any], act: Act, seeds: Sequence[int]) -> dict[str, Any]:
    """Plays one episode for each seed, all at the same time. The episodes and the result are as in `play_episodes`.

    `envs` has one environment for each seed and resets in the same step. `act` returns the actions of all of them.
    """
    observations, _ = envs.reset(seed=[int(seed) for seed in seeds])  # pyright: ignore[reportArgumentType]
    over = np.zeros(len(seeds), np.bool_)
    successes, scores, rewards = over.copy(), np.zeros(len(seeds)), np.zeros(len(seeds))
    while not over.all():
        observations, gained, terminated, truncated, infos = envs.step(act(observations))
        rewards[~over] += gained[~over]
        ended = (terminated | truncated) & ~over
        if ended.any():
            successes[ended] = infos["final_info"]["is_success"][ended]
            scores[ended] = infos["final_info"]["score"][ended]
        over |= ended
    return summary(successes.tolist(), scores.tolist(), rewards.tolist())


def summary(successes: Sequence[bool], scores: Sequence[float], rewards: Sequence[float]) -> dict[str, Any]:
    """Returns the dictionary that `play_episodes` returns, from the outcome of each episode."""
    return {
        "episodes": len(successes),
        "successes": sum(successes),
        "success_rate": sum(successes) / len(successes),
        "confidence_interval_95": list(wilson_interval(sum(successes), len(successes))),
        "mean_score": sum(scores) / len(scores),
        "score_interval_95": None if (interval := mean_interval(scores)) is None else list(interval),
        "mean_reward": sum(rewards) / len(rewards),
    }


def measure(
    player: str,
    arguments: Mapping[str, Any],
    noise: tuple[float, float],
    episodes: int,
    seed: int,
    progress: Callable[[], object] = lambda: None,
) -> dict[str, Any]:
    """Plays episodes with a player.

    Args:
        player: See `players.named`.
        arguments: Arguments of `gym.make("Billiards-v0", ...)`. By default the environment has the noise `noise`.
        noise: Standard deviations of the execution noise that players expect: of the direction, degrees, and of the
            speed, m/s.
        episodes: The number of episodes.
        seed: The seed of the layouts, the noise and the player. Training uses none of these layouts.
        progress: A function that is called before each shot.

    Returns:
        The results of `play_episodes`, `mean_shots` (the mean number of shots of an episode) and `ms_per_decision` (the
        median time to choose a shot, ms).

    Raises:
        OSError: As in `find_player`.
        ValueError: If a name or an argument is unknown or invalid.
        TypeError: If an argument has the wrong type.
    """
    deviations = {"angle_std": noise[0], "speed_std": noise[1]} if any(noise) else None
    env = gym.make("billiards_env:Billiards-v0", **{"noise": deviations, **arguments})
    choose, times = acting(find_player(player, env), env, noise, seed), []

    def act(observation: NDArray[np.float32]) -> NDArray[np.floating[Any]]:
        progress()
        begin = time.perf_counter()
        action = choose(observation)
        times.append(time.perf_counter() - begin)
        return action

    result = play_episodes(env, act, evaluation_seeds(seed, episodes).tolist())
    env.close()
    return {**result, "mean_shots": len(times) / episodes, "ms_per_decision": 1e3 * float(np.median(times))}


def row_printer(names: Sequence[str], details: bool = False) -> Callable[[str, dict[str, Any]], None]:
    """Prints the head of a table, and returns a function that prints a player's row: its result of `play_episodes`.

    With `details` a row also has the mean return and what `measure` adds.
    """
    width = max(map(len, (*names, "player")))
    more = "  reward  shots  ms per shot" if details else ""
    print(f"{'player':{width}} {'layouts':>8} {'success':>8} {'95% interval':>17} {'score':>7}{more}", flush=True)

    def show(name: str, r: dict[str, Any]) -> None:
        low, high = r["confidence_interval_95"]
        rates = f"{r['success_rate']:8.1%} {f'{low:.1%} to {high:.1%}':>17}"
        more = f"{r['mean_reward']:8.2f} {r['mean_shots']:6.1f} {r['ms_per_decision']:12.2f}" if details else ""
        print(f"{name:{width}} {r['episodes']:>8,} {rates} {r['mean_score']:7.3f}{more}", flush=True)

    return show
