"""Measures PPO and SAC of Stable-Baselines3 with their default settings: `python -m studies.plain`.

All hyper-parameters are the defaults of Stable-Baselines3. `Billiards-v0` has its default arguments. The results
are in `studies/results/plain.json`. The command skips runs that have results there, so it continues after an
interruption.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import gymnasium as gym
import torch
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.callbacks import BaseCallback
from tqdm import tqdm

from benchmarks import machine_line, table
from billiards_env.evaluation import evaluation_seeds, play_together
from billiards_env.files import write_json
from billiards_env.intervals import as_percent, over_seeds
from studies import RESULTS, parser_of, report, resumed

OUTPUT = RESULTS / "plain.json"

ALGORITHMS: dict[str, type[PPO] | type[SAC]] = {"PPO": PPO, "SAC": SAC}
SHOTS = {"PPO": (100_000, 1_000_000), "SAC": (20_000,)}
"""The numbers of shots after which each algorithm is evaluated, ascending."""
SEEDS = (20, 21, 22)
EPISODES = 2000


class _Progress(BaseCallback):
    """Shows the number of shots."""

    def __init__(self, bar: Any) -> None:
        super().__init__()
        self.bar = bar

    def _on_step(self) -> bool:
        self.bar.update(self.training_env.num_envs)
        return True


def train(algorithm: str, seed: int, shots: Sequence[int], episodes: int) -> list[float]:
    """Trains with the defaults of Stable-Baselines3 and returns the success on new layouts after each number of shots.

    Args:
        algorithm: A key of `ALGORITHMS`.
        seed: The seed of the training and of the layouts of the evaluation.
        shots: Numbers of shots, ascending.
        episodes: Number of layouts of an evaluation.
    """
    model = ALGORITHMS[algorithm]("MlpPolicy", gym.make("billiards_env:Billiards-v0"), seed=seed, device="cpu")
    envs = gym.make_vec("billiards_env:Billiards-v0", num_envs=episodes)
    seeds = evaluation_seeds(seed, episodes).tolist()
    rates, done = [], 0
    for goal in shots:
        with tqdm(total=goal - done, unit="shot", desc=f"{algorithm}, seed {seed}", leave=False) as bar:
            model.learn(goal - done, callback=_Progress(bar), reset_num_timesteps=False)
        done = goal
        played = play_together(envs, lambda observations: model.predict(observations, deterministic=True)[0], seeds)
        rates.append(played["success_rate"])
    return rates


def measure(output: Path) -> dict[str, Any]:
    """Trains what has no results, and writes the results of each run as soon as it ends.

    Args:
        output: The JSON file of the results.

    Returns:
        The content of the file: `machine`, `settings`, and `results[algorithm][seed]`, the success after each number
        of `SHOTS`.

    Raises:
        OSError: If the file cannot be read or written.
        ValueError: If the file is not JSON.
    """
    found = resumed(output, {"shots": SHOTS, "episodes": EPISODES}, results={})
    for algorithm, shots in SHOTS.items():
        runs = found["results"].setdefault(algorithm, {})
        for seed in SEEDS:
            if str(seed) not in runs:
                runs[str(seed)] = train(algorithm, seed, shots, EPISODES)
                write_json(output, found)
    return found


def blocks(found: Mapping[str, Any]) -> dict[str, str]:
    """Returns the tables for the pages, by name."""
    rows = []
    for algorithm, runs in found["results"].items():
        for k, shots in enumerate(found["settings"]["shots"][algorithm]):
            rates = [run[k] for run in runs.values()]
            by_seed = ", ".join(f"{rate:.1%}" for rate in rates)
            rows.append((f'`{algorithm}("MlpPolicy")`', f"{shots:,}", by_seed, as_percent(over_seeds(rates))))
    return {
        "machine": machine_line(found["machine"]),
        "table": table(("model", "shots", "success by seed", "mean over seeds"), rows, left=1),
    }


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs the command line; see `python -m studies.plain --help`."""
    parser = parser_of("plain", "Measure Stable-Baselines3 with its defaults.", output=(OUTPUT, "JSON file"))
    args = parser.parse_args(arguments)
    torch.set_num_threads(1)
    report(lambda: measure(args.output), blocks, args.output)


if __name__ == "__main__":
    main()
