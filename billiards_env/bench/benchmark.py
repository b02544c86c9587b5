"""The benchmark of the frozen tasks: `billiards bench PLAYER --tasks Pot1-v0,Carom-v0 --out FILE`.

A player plays one episode for each of `EPISODES` layouts of a task. The seed of the benchmark fixes the layouts, and
also the execution noise if there is no separate seed for it. A file holds all actions and their outcomes. `verify`
plays the actions again and accepts the file only if all outcomes have the same bits. The file holds data and no code.

This proves that the actions have these outcomes. It does not prove who chose them: anyone who has the seeds can compute
the noise and choose actions that profit from it. `fresh` plays the actions with new noise.

Actions are stored and played as float32, the type of the action space.
"""

from __future__ import annotations

import base64
import hashlib
import os
import re
from collections.abc import Callable, Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple, cast

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from billiards_env.bench.evaluation import evaluation_seeds, steps
from billiards_env.bench.frozen import FROZEN, NAMESPACE
from billiards_env.commands import error_text
from billiards_env.envs.actions import action_named
from billiards_env.intervals import interquartile_mean, mean_interval, wilson_interval
from billiards_env.players.env_player import acting
from billiards_env.players.named import find_player
from billiards_env.shots import records
from billiards_env.support.checks import Range, finite, integer, one_of, real, short

EPISODES = 1000
"""The number of layouts of each task."""

SEED = 0
"""The seed of the public layouts. The hash of the layouts of each task is in `results/frozen_tasks.json`."""

DRAWS = 10
"""The number of draws of the noise with which `fresh` plays each action."""

BENCH = "billiards_env/bench"

_FIELDS = ("format", "version", "written_by", "player", "results")
_SEEDS = Range(0, 2**63 - 1)
# Patterns of texts, and what to expect. A name has no character with a meaning in HTML or in a table of Markdown.
_NAME = r"[\w.:/+ -]{1,80}", "1 to 80 letters, digits and characters of '.:/+ -_'"
_HASH = r"[0-9a-f]{64}", "64 hexadecimal digits"


class Result(NamedTuple):
    """The episodes of a player in a task.

    Attributes:
        task: A key of `FROZEN`.
        seed: The seed of the layouts.
        layouts: A hash of the first observations.
        shots: (m,) uint8, the number of shots of each episode.
        actions: (k, 2) or (k, 5) float32, the actions of all shots, episode after episode.
        success: (m,) bool.
        returns: (m,) the sum of the rewards.
        digest: A hash of all observations, rewards and durations of shots.
        noise_seed: The argument `noise_seed` of the environment; None without noise, or if `seed` fixes the noise.
    """

    task: str
    seed: int
    layouts: str
    shots: NDArray[np.uint8]
    actions: NDArray[np.float32]
    success: NDArray[np.bool_]
    returns: NDArray[np.float64]
    digest: str
    noise_seed: int | None = None


class Bench(NamedTuple):
    """The content of a file: the name of the player, and a result for each task and seed."""

    player: str
    results: tuple[Result, ...]


def play_tasks(
    player: str,
    tasks: Iterable[str],
    seeds: Iterable[int] = (SEED,),
    name: str | None = None,
    progress: Callable[[str, int], object] = lambda task, episode: None,
    noise_seed: int | None = None,
    part: Path | None = None,
    finished: Callable[[Result], object] = lambda result: None,
) -> Bench:
    """Plays `EPISODES` episodes of each task for each seed.

    Args:
        player: See `players.named`.
        tasks: Keys of `FROZEN`, with or without the prefix "Billiards/".
        seeds: The seeds of the layouts, of the noise and of the player.
        name: The name of the player in the file; None for `player`.
        progress: A function that is called with the task and the number of finished episodes.
        noise_seed: The seed of the noise in the tasks with noise; None for the seed of the layouts.
        part: A file that holds each finished result until all are finished. If it exists, its results are verified and
            not played again. None for none.
        finished: A function that is called with each finished result.

    Raises:
        ValueError: If a task or a player is unknown, a name has characters other than letters, digits and ".:/+ -_",
            an action has the wrong shape or is not finite, `part` holds other results, or the player raises an error.
        OSError, TypeError: As `find_player` does, or if `part` cannot be written.
    """
    names, seeds = [task.strip().removeprefix(NAMESPACE) for task in tasks], list(seeds)
    for task in names:
        one_of("task", task, tuple(FROZEN))
    for seed in seeds:
        integer("seed", seed, _SEEDS)
    if noise_seed is not None:
        integer("noise_seed", noise_seed, _SEEDS)
    title = _text("player", player if name is None else name, *_NAME)
    keys = [(task, seed, noise_seed if FROZEN[task].noise else None) for task in names for seed in seeds]
    source = f"{hashlib.sha256(player.encode()).hexdigest()[:16]} {title}"[:80]  # one name can have several players
    results = {} if part is None or not part.exists() else _kept(part, source, keys)
    for key in dict.fromkeys(keys):
        if key not in results:
            try:
                results[key] = _play(player, *key, progress)
            except Exception as error:  # the code of the player may raise any
                if len(set(names)) == 1 or isinstance(error, (ImportError, OSError)):
                    raise
                raise _failure(key[0], error) from error
            if part is not None:
                save(part, Bench(source, tuple(results.values())))
        finished(results[key])
    return Bench(title, tuple(results[key] for key in dict.fromkeys(keys)))


_Key = tuple[str, int, int | None]


def _kept(part: Path, player: str, keys: Sequence[_Key]) -> dict[_Key, Result]:
    """Returns the results in a file by task, seed and seed of the noise; raises a ValueError for other results."""
    bench = verify(part)
    results = {(result.task, result.seed, result.noise_seed): result for result in bench.results}
    if bench.player != player or not results.keys() <= set(keys):
        raise ValueError(f"{part} holds results of another command: expected none, move it or delete it")
    return results


def _failure(task: str, error: Exception) -> Exception:
    """Returns the error of a player with the name of its task."""
    kind = TypeError if isinstance(error, TypeError) else ValueError
    return kind(f"{task}: {error_text(error)}; --tasks chooses other tasks")


def _play(player: str, task: str, seed: int, noise_seed: int | None, progress: Callable[[str, int], object]) -> Result:
    env = gym.make(NAMESPACE + task, **_noise(noise_seed))
    act, actions, shots = acting(find_player(player, env), env, FROZEN[task].execution_noise, seed), [], []
    shape = cast(Any, env.action_space.shape)

    def checked(observation: NDArray[np.float32]) -> NDArray[np.float32]:
        return finite("action", act(observation), shape).astype(np.float32)

    for episode, start in enumerate(evaluation_seeds(seed, EPISODES).tolist()):
        played = [step.action for step in steps(env, checked, start)]
        actions += played
        shots.append(len(played))
        progress(task, episode + 1)
    env.close()
    return play_actions(task, seed, np.array(shots, np.uint8), np.array(actions), noise_seed)


def _noise(noise_seed: int | None) -> dict[str, Any]:
    """Returns the arguments of `gym.make` for a seed of the noise."""
    return {} if noise_seed is None else {"noise_seed": noise_seed}


def play_actions(
    task: str, seed: int, shots: NDArray[np.uint8], actions: NDArray[np.float32], noise_seed: int | None = None
) -> Result:
    """Plays actions again, all episodes together.

    Args:
        task: A key of `FROZEN`.
        seed: The seed of the layouts.
        shots: (m,) number of shots of each episode, at least 1.
        actions: (sum of shots, 2) or (sum of shots, 5), finite.
        noise_seed: The seed of the noise of a task with noise; None for the seed of the layouts.

    Raises:
        ValueError: If an episode has too few or too many actions.
    """
    m = len(shots)
    envs: Any = gym.make_vec(NAMESPACE + task, m, **_noise(noise_seed))
    first = np.concatenate(([0], np.cumsum(shots[:-1], dtype=np.int64)))
    success, returns, digest = np.zeros(m, np.bool_), np.zeros(m), hashlib.sha256()
    observations, _ = envs.reset(seed=evaluation_seeds(seed, m).tolist())
    layouts = hashlib.sha256(observations.tobytes()).hexdigest()
    for k in range(int(shots.max())):
        playing = shots > k
        sent = np.zeros((m, actions.shape[1]), np.float32)  # in a finished environment the shots have no speed
        sent[playing] = actions[first[playing] + k]
        observations, rewards, over, _, infos = envs.step(sent)
        returns[playing] += rewards[playing]
        wrong = np.flatnonzero(playing & (over != (shots == k + 1)))
        if len(wrong):
            state = "is over" if over[wrong[0]] else "is not over"
            raise ValueError(f"episode {wrong[0]} of {task} {state} after {k + 1} of its {shots[wrong[0]]} shots")
        times, ended = infos["shot_time"], playing & over
        if ended.any():
            final = infos["final_info"]
            success[ended] = final["is_success"][ended]
            times = np.where(over, final["shot_time"], times)
            observations = observations.copy()
            observations[ended] = np.stack(infos["final_obs"][ended])
        digest.update(observations[playing].tobytes() + rewards[playing].tobytes() + times[playing].tobytes())
    envs.close()
    return Result(task, seed, layouts, shots, actions, success, returns, digest.hexdigest(), noise_seed)


def is_one_noisy_shot(task: str) -> bool:
    """Returns whether a task has noise and one shot, so that `fresh` plays its actions."""
    return FROZEN[task].noise and FROZEN[task].arguments["max_shots"] == 1


def fresh(bench: Bench, noise_seed: int) -> Bench:
    """Plays the actions again in the tasks with noise and one shot, each with `DRAWS` new draws of the noise.

    If the seed is drawn after the actions were chosen, for example by `secrets.randbits(63)`, the actions cannot profit
    from the noise. Later shots of an episode depend on the noise before them, so longer tasks need the player itself:
    see the `noise_seed` of `play_tasks`.

    Args:
        bench: The content of a file.
        noise_seed: The seed from which the seeds of the draws come.

    Returns:
        The results of these tasks, one for each draw; none if the file has no such task.
    """
    seeds = (np.random.SeedSequence(noise_seed).generate_state(DRAWS, np.uint64) >> np.uint64(1)).tolist()
    rows = [one for one in bench.results if is_one_noisy_shot(one.task)]
    return bench._replace(
        results=tuple(play_actions(one.task, one.seed, one.shots, one.actions, seed) for one in rows for seed in seeds)
    )


def layouts_hash(task: str) -> str:
    """Returns the SHA-256 hash of the first observations of the public layouts of a task."""
    envs: Any = gym.make_vec(NAMESPACE + task, EPISODES)
    return hashlib.sha256(envs.reset(seed=evaluation_seeds(SEED, EPISODES).tolist())[0].tobytes()).hexdigest()


def save(path: str | os.PathLike[str], bench: Bench) -> None:
    """Writes a file, completely or not at all.

    Raises:
        OSError: If the file cannot be written.
        ValueError: If the file would be larger than `verify` reads.
    """
    text = to_json(bench)
    if len(text) > records.MAX_BYTES:
        raise ValueError(f"a file of {len(text)} bytes: expected at most {records.MAX_BYTES}; play fewer tasks")
    records.write(path, text)


def to_json(bench: Bench) -> str:
    """Returns the JSON text of a file."""
    results = []
    for result in bench.results:
        data = result._asdict()
        data["shots"] = base64.b64encode(result.shots.tobytes()).decode()
        data["actions"] = base64.b64encode(result.actions.astype("<f4").tobytes()).decode()
        data["success"] = "".join("01"[won] for won in result.success.astype(int))
        data["returns"] = result.returns.tolist()
        results.append(data)
    return records.json_text(BENCH, {"player": bench.player, "results": results})


def verify(path: str | os.PathLike[str]) -> Bench:
    """Reads a file and plays its actions again.

    The file has at most `records.MAX_BYTES` bytes and each task and seed once, and an episode has at most the shots of
    its task. This limits the time and the memory.

    Raises:
        OSError: If the file cannot be read.
        ValueError: If the file is not valid, or an outcome differs in any bit.
    """

    def checked(text: str) -> Bench:
        bench = from_json(text)
        for result in bench.results:
            _compare(result, play_actions(result.task, result.seed, result.shots, result.actions, result.noise_seed))
        return bench

    return records.read(path, checked, _WHAT)


def load(path: str | os.PathLike[str]) -> Bench:
    """Reads a file and checks its form, but not its outcomes. Raises the errors of `verify`."""
    return records.read(path, from_json, _WHAT)


def from_json(text: str) -> Bench:
    """Returns the content of a file, see `load`."""
    return records.parse(text, {BENCH: _bench_of}, _WHAT)


_WHAT = "a benchmark"


def _bench_of(data: dict[str, Any]) -> Bench:
    records.fields("the file", data, _FIELDS)
    if not isinstance(data["written_by"], str):
        raise ValueError(f"written_by = {short(data['written_by'])}: expected a text")
    items = records.items("results", data["results"])
    integer("number of results", len(items), Range(1, None))
    results = tuple(_result_of(f"results[{i}]", item) for i, item in enumerate(items))
    pairs = [(result.task, result.seed) for result in results]
    if len(set(pairs)) < len(pairs):
        raise ValueError(f"results = {short(pairs)}: expected each task and seed once")
    return Bench(_text("player", data["player"], *_NAME), results)


def _result_of(name: str, item: Any) -> Result:
    data = records.fields(name, item, Result._fields)
    one_of(f"{name}.task", data["task"], tuple(FROZEN))
    if data["noise_seed"] is not None:
        integer(f"{name}.noise_seed", data["noise_seed"], _SEEDS)
        if not FROZEN[data["task"]].noise:
            raise ValueError(f"{name}.noise_seed = {data['noise_seed']}: expected none, {data['task']} has no noise")
    arguments = FROZEN[data["task"]].arguments
    shots = np.frombuffer(_bytes(f"{name}.shots", data["shots"], EPISODES), np.uint8)
    for limit in (shots.min(), shots.max()):
        integer(f"a number in {name}.shots", limit, Range(1, arguments["max_shots"]))
    size, count = action_named(arguments["action"]).size, int(shots.sum(dtype=np.int64))
    packed = _bytes(f"{name}.actions", data["actions"], 4 * size * count)
    actions = np.frombuffer(packed, "<f4").astype(np.float32).reshape(count, size)
    if not np.isfinite(actions).all():
        raise ValueError(f"{name}.actions: expected finite numbers")
    won = _text(f"{name}.success", data["success"], f"[01]{{{EPISODES}}}", f"{EPISODES} digits 0 or 1")
    returns = records.items(f"{name}.returns", data["returns"], EPISODES)
    return Result(
        task=data["task"],
        seed=integer(f"{name}.seed", data["seed"], _SEEDS),
        layouts=_text(f"{name}.layouts", data["layouts"], *_HASH),
        shots=shots,
        actions=actions,
        success=np.array([digit == "1" for digit in won]),
        returns=np.array([real(f"{name}.returns[{i}]", value) for i, value in enumerate(returns)]),
        digest=_text(f"{name}.digest", data["digest"], *_HASH),
        noise_seed=data["noise_seed"],
    )


def _compare(recorded: Result, now: Result) -> None:
    """Raises a ValueError that names the first difference."""
    where = f"{recorded.task}, seed {recorded.seed}"
    if recorded.layouts != now.layouts:
        raise ValueError(f"{where}: layouts = {recorded.layouts}: expected {now.layouts}, those of the seed")
    for name in ("success", "returns"):
        old, new = getattr(recorded, name), getattr(now, name)
        bits = f"u{old.itemsize}"  # 0.0 and -0.0 differ
        different = np.flatnonzero(old.view(bits) != new.view(bits))
        if len(different):
            k = different[0]
            raise ValueError(f"{where}: {name}[{k}] = {old[k]}: expected {new[k]}, the outcome of the actions")
    if recorded.digest != now.digest:
        raise ValueError(
            f"{where}: digest = {recorded.digest}: expected {now.digest}; the actions were changed, or another "
            "version of the engine wrote the file"
        )


def _bytes(name: str, value: Any, count: int) -> bytes:
    """Returns the bytes of a base64 text; raises unless there are `count`."""
    if not isinstance(value, str) or len(value) != 4 * ((count + 2) // 3):
        raise ValueError(f"{name} = {short(value)}: expected {count} bytes as base64")
    try:
        return base64.b64decode(value, validate=True)
    except ValueError:
        raise ValueError(f"{name} = {short(value)}: expected {count} bytes as base64") from None


def _text(name: str, value: Any, pattern: str, expected: str) -> str:
    if not isinstance(value, str) or not re.fullmatch(pattern, value):
        raise ValueError(f"{name} = {short(value)}: expected {expected}")
    return value


@cache
def reference() -> dict[str, dict[str, Any]]:
    """Returns `results/frozen_tasks.json`: for each id the hash of the public `layouts`, and the `players`.

    `players` maps names of players to `success` and `return`, the means over the public layouts. The command
    `python -m studies.frozen_tasks` measures them.
    """
    path = Path(__file__).parent / "results" / "frozen_tasks.json"
    return records.read_data(path, "scores") if path.exists() else {}


def score(results: Sequence[Result]) -> dict[str, Any]:
    """Returns the scores of results of one task: their episodes count together.

    Several results with one seed are draws of the noise. The value of a layout is then the mean over its draws, and the
    intervals are over the layouts.

    Returns:
        `success` and its `success_interval`, `mean_return` and its `return_interval` (95%), and `normalised`: the mean
        return on a scale on which the player "random" has 0 and the best player of `reference` has 1. It is None for a
        task without a reference.
    """
    seeds = dict.fromkeys(result.seed for result in results)
    draws = [[result for result in results if result.seed == seed] for seed in seeds]
    success = np.concatenate([np.mean([one.success for one in each], axis=0) for each in draws])
    returns = np.concatenate([np.mean([one.returns for one in each], axis=0) for each in draws])
    has_draws = len(draws) < len(results)
    known = {name: one["return"] for name, one in reference().get(results[0].task, {}).get("players", {}).items()}
    mean, best = float(returns.mean()), max(known.values(), default=0.0)
    low = known.get("random", best)
    return {
        "success": float(success.mean()),
        "success_interval": mean_interval(success.tolist())
        if has_draws
        else wilson_interval(int(success.sum()), len(success)),
        "mean_return": mean,
        "return_interval": mean_interval(returns.tolist()),
        "normalised": (mean - low) / (best - low) if best > low else None,
    }


def score_table(bench: Bench) -> str:
    """Returns a table with the scores of each task and seed, and the interquartile mean over the tasks.

    As on the leaderboard, the episodes of all seeds of a task count together.
    """
    by_task: dict[str, dict[int, list[Result]]] = {}
    for result in bench.results:
        by_task.setdefault(result.task, {}).setdefault(result.seed, []).append(result)
    width = max(map(len, by_task))
    lines = [f"{'task':{width}}  seed  success  95% interval  return  95% interval    normalised"]
    for task, of_seed in by_task.items():
        for seed, results in of_seed.items():
            scores = score(results)
            low, high = scores["success_interval"]
            least, most = scores["return_interval"]
            scaled = scores["normalised"]
            lines.append(
                f"{task:{width}}  {seed:4}  {scores['success']:7.1%}  "
                f"{f'{100 * low:.1f} to {100 * high:.1f}':>12}  {scores['mean_return']:6.3f}  "
                f"{f'{least:.3f} to {most:.3f}':>14}  {'-' if scaled is None else f'{scaled:.3f}':>10}"
            )
    pooled = [score([one for each in of_seed.values() for one in each])["normalised"] for of_seed in by_task.values()]
    if known := [one for one in pooled if one is not None]:
        mean = round(float(interquartile_mean(known)), 3) + 0.0  # not "-0.000"
        lines.append(f"interquartile mean of the normalised scores: {mean:.3f}")
    return "\n".join(lines)
