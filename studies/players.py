"""Players that need no training, and what they reach: `python -m studies.players`.

* "random": any action.
* "geometric": aims at the ghost ball, where the cue ball has to be when it hits the object ball for that one to run
  into a pocket, and plays the shot that leaves most room for error. It knows the law of motion, but runs no engine.
* "search": tries K shots on the engine itself and plays the best; "search:20" tries 20.

A player is a function (env, rng) -> (2,) velocity of the cue ball, m/s; it sees what is public in the environment.
"""

from __future__ import annotations

import argparse
import functools
import json
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from agents.config import ENV_ID
from agents.evaluate import play
from agents.ppo import evaluation_seeds
from billiards_env.checks import choose
from billiards_env.engine.threads import spread
from billiards_env.envs import BilliardsEnv
from billiards_env.envs.action_frames import perturb
from billiards_env.envs.wrappers import ExecutionNoise
from billiards_env.files import write_json
from billiards_env.players.pots import Pots, direct_pots

Floats = NDArray[np.float64]
Player = Callable[[BilliardsEnv, np.random.Generator], Floats]

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

_FINALISTS, _REHEARSALS = 16, 16  # where shots go astray: so many of the best are tried so many times more


def random(env: BilliardsEnv, rng: np.random.Generator) -> Floats:
    """Any action, uniformly, as `action_space.sample()` gives."""
    return env.max_speed * rng.uniform(-1.0, 1.0, 2)


def geometric(env: BilliardsEnv, rng: np.random.Generator) -> Floats:
    """The best of `direct_pots`; if there is none, a full hit on the nearest ball as hard as can be."""
    positions, potted = env.positions, env.potted
    pots = direct_pots(env.scene, env.targets, positions, potted, env.max_speed)
    if len(pots.speed):
        return pots.speed[0] * pots.direction[0]
    ways = (positions - positions[0])[env.targets & ~potted]
    lengths = np.hypot(ways[:, 0], ways[:, 1])
    return env.max_speed * ways[np.argmin(lengths)] / lengths.min()


def search(
    env: BilliardsEnv, rng: np.random.Generator, shots: int = 1000, noise: tuple[float, float] = (0.0, 0.0)
) -> Floats:
    """Simulates `shots` shots and plays the one with the highest reward; of equals the one thought of first.

    The first half are the `direct_pots`, best first, then the same in other directions, about as far off as their
    tolerance, and at any speed. The others, all of them if there are no direct pots, go anywhere at any speed.

    Args:
        env: The environment.
        rng: Where the draws come from.
        shots: How many shots to try.
        noise: Standard deviations of the direction, degrees, and of the speed, m/s, with which a shot will go astray.
            If there is any, the best shots are tried some more times with such errors, and that with the highest mean
            reward is played.

    Returns:
        (2,) velocity, m/s.
    """
    pots = direct_pots(env.scene, env.targets, env.positions, env.potted, env.max_speed)
    actions = np.concatenate((_near(pots, env.max_speed, (shots + 1) // 2, rng), _anywhere(shots, rng)))[:shots]
    rewards = rehearse(env, actions)
    if any(noise):
        actions = actions[np.argsort(-rewards, kind="stable")[:_FINALISTS]]
        errors = rng.standard_normal((2, _REHEARSALS, len(actions)))
        turns, speeds = errors[0] * (noise[0] / 180.0), errors[1] * (noise[1] / env.max_speed)
        astray = perturb(np.broadcast_to(actions, (*turns.shape, 2)), turns, speeds)
        rewards = rehearse(env, astray.reshape(-1, 2)).reshape(turns.shape).mean(axis=0)
    return env.max_speed * actions[np.argmax(rewards)]


def rehearse(env: BilliardsEnv, actions: Floats) -> Floats:
    """What actions would earn now, each instead of the others.

    Args:
        env: The environment; nothing happens to it.
        actions: (m, 2) as `env.step` takes them.

    Returns:
        (m,) rewards.
    """
    m, n = len(actions), env.scene.n_balls
    episodes, rewards = env.episodes(m), np.empty(m)
    episodes.shots.positions[:] = env.positions
    episodes.shots.in_play[:] = ~env.potted
    episodes.goals[:] = env.goals
    skip, potted = np.zeros(m, np.bool_), np.empty((m, n), np.bool_)
    observations = np.empty((m, 2 * (n + len(env.goals))), np.float32)

    def work(begin: int, end: int) -> None:
        episodes.shoot(begin, end, skip, actions, rewards, potted, observations)

    spread(work, m)
    return rewards


def _near(pots: Pots, max_speed: float, count: int, rng: np.random.Generator) -> Floats:
    """(count, 2) actions: pots, then shots near them; none if there are no pots."""
    if not len(pots.speed):
        return np.empty((0, 2))
    which = np.arange(count) % len(pots.speed)
    again = np.arange(count) >= len(pots.speed)
    turns = np.where(again, rng.standard_normal(count) * pots.tolerance[which] / np.pi, 0.0)
    speeds = np.where(again, rng.uniform(0.1, 1.0, count), pots.speed[which] / max_speed)
    return perturb(speeds[:, None] * pots.direction[which], turns, np.zeros(count))


def _anywhere(count: int, rng: np.random.Generator) -> Floats:
    """(count, 2) actions in any direction, of 0.1 to 1 of the largest speed."""
    angles, speeds = rng.uniform(-np.pi, np.pi, count), rng.uniform(0.1, 1.0, count)
    return speeds[:, None] * np.column_stack((np.cos(angles), np.sin(angles)))


PLAYERS: dict[str, Player] = {"random": random, "geometric": geometric, "search": search}


def make_player(name: str, noise: tuple[float, float] = (0.0, 0.0)) -> Player:
    """A player by name.

    Args:
        name: One of `PLAYERS`; "search:K" tries K shots.
        noise: The execution noise that "search" reckons with, see there.

    Returns:
        The player.

    Raises:
        ValueError: If there is no such player, or K is no whole number >= 1.
    """
    kind, colon, count = name.partition(":")
    choose("player", kind, tuple(PLAYERS))
    if kind != "search" and not colon:
        return PLAYERS[kind]
    if kind != "search" or (colon and not (count.isdecimal() and int(count) >= 1)):
        raise ValueError(f"player = {name!r}: expected 'search:K' with a whole number K >= 1, or a name without ':'")
    return functools.partial(search, noise=noise, **({"shots": int(count)} if colon else {}))


def measure(
    name: str, arguments: Mapping[str, Any], noise: tuple[float, float], episodes: int, seed: int
) -> dict[str, Any]:
    """Plays episodes on the layouts that `agents.evaluate` uses.

    Args:
        name: The player.
        arguments: Those of `gym.make("Billiards-v0", ...)`.
        noise: Standard deviations of the execution noise: direction, degrees, and speed, m/s.
        episodes: How many.
        seed: Of the layouts, the noise and the player.

    Returns:
        What `agents.evaluate.play` returns, and `ms_per_decision`, the median time that the player took for a shot.

    Raises:
        ValueError: If a name or an argument is unknown or impossible.
        TypeError: If an argument is of the wrong type.
    """
    for name_of, value, least in (("episodes", episodes, 1), ("seed", seed, 0)):
        if value < least:
            raise ValueError(f"{name_of} = {value}: expected a whole number >= {least}")
    env = gym.make(ENV_ID, **arguments)
    if any(noise):
        env = ExecutionNoise(env, *noise)
    game: Any = env.unwrapped
    player, rng, times = make_player(name, noise), np.random.default_rng(seed), []

    def act(observation: NDArray[np.float32]) -> Floats:
        begin = time.perf_counter()
        velocity = player(game, rng)
        times.append(time.perf_counter() - begin)
        return velocity / game.max_speed

    result = play(env, act, evaluation_seeds(seed, episodes).tolist())
    env.close()
    return {**result, "ms_per_decision": 1e3 * float(np.median(times))}


HEAD = ("case", "player", "success", "95 % interval", "mean reward", "ms/decision")


def row(result: Mapping[str, Any]) -> tuple[str, ...]:
    """The cells of a result's row in a table with that head.

    Args:
        result: What `measure` returns, with `case` and `player`.

    Returns:
        A text for each column.
    """
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
    """The command line; see `python -m studies.players --help`."""
    parser = argparse.ArgumentParser(
        prog="python -m studies.players", description="Measure players that need no training on fresh layouts."
    )
    parser.add_argument("--episodes", type=int, default=1000, help="episodes of each player (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="seed of the layouts (default: %(default)s)")
    parser.add_argument("--players", nargs="+", help="e.g. geometric search:100 (default: those of each case)")
    parser.add_argument("--env", help="arguments of the environment as JSON, instead of the usual cases")
    parser.add_argument("--noise", nargs=2, type=float, metavar=("DEGREES", "M/S"), help="execution noise, with --env")
    parser.add_argument("--output", type=Path, default=Path("benchmarks/results/players.json"), help="JSON file")
    args = parser.parse_args(arguments)
    try:
        cases = CASES
        noise = (args.noise[0], args.noise[1]) if args.noise else (0.0, 0.0)
        if args.env is not None or args.noise is not None:
            cases = {"own": (json.loads(args.env or "{}"), noise, tuple(PLAYERS))}
        results = []
        print(f"| {' | '.join(HEAD)} |")
        print("| :-- | :-- | --: | --: | --: | --: |")
        for case, (env, noise, players) in cases.items():
            for name in args.players or players:
                measured = measure(name, env, noise, args.episodes, args.seed)
                results.append({"case": case, "env": env, "noise": list(noise), "player": name, **measured})
                print(f"| {' | '.join(row(results[-1]))} |", flush=True)
        write_json(args.output, {"seed": args.seed, "results": results})
    except (OSError, TypeError, ValueError) as error:
        sys.exit(f"error: {error}")
    print(f"written to {args.output}")


if __name__ == "__main__":
    main()
