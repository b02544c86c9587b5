"""Measures the policies of a study of timesteps on the same layouts.

Every policy plays every layout once, without exploration noise, so it is described by its shots: one velocity of the
cue ball for each layout. `measure` plays the shots of each policy in each world and counts

* the successes in each world;
* false successes, which succeed in the world of the training and fail in the exact world, by their cause
  (`studies.causes`).
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from agents.config import Config
from agents.evaluate import deterministic
from agents.ppo import evaluation_seeds, load_policy
from agents.train import learning_curve, versions
from billiards_env.envs import BilliardsEnv, BilliardsVectorEnv
from billiards_env.envs.actions import cue_strike
from billiards_env.shots.simulation import simulate
from studies.causes import CAUSES, cause

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

LAYOUT_SEED = 0


class Run(NamedTuple):
    """A finished training run.

    Attributes:
        world: The name of the world of the training.
        seed: The seed.
        folder: The folder of the run.
    """

    world: str
    seed: int
    folder: Path


def measure(
    recipe: Config, worlds: Mapping[str, Mapping[str, Any]], runs: Sequence[Run], layouts: int
) -> dict[str, Any]:
    """Plays the policies in all worlds.

    Args:
        recipe: The configuration of the training, apart from the world and the seed.
        worlds: The arguments of `gym.make` of each world, by name; "exact" is among them.
        runs: The finished runs.
        layouts: The number of layouts.

    Returns:
        Plain data: `versions`; `worlds_measured`, the arguments and speed of each world; and `policies`. A policy has
        `world`, `seed`, `curve` (a list of `agents.train.Point`), `success` (the number of successes in each world),
        and `false_successes` (their number by cause).

    Raises:
        OSError: If a file of a run cannot be read.
        ValueError: If a file of a run has the wrong content.
    """
    seeds = evaluation_seeds(LAYOUT_SEED, layouts).tolist()
    envs = {
        world: BilliardsVectorEnv(layouts, "Disabled", 1, **{**recipe.env, **arguments})
        for world, arguments in worlds.items()
    }
    observations, _ = envs["exact"].reset(seed=seeds)
    positions, env = envs["exact"].positions, envs["exact"].single_env
    shots = [_shots(run.folder, observations) for run in tqdm(runs, "policies")]
    successes = {world: [] for world in worlds}
    seconds = dict.fromkeys(worlds, 0.0)
    for world in tqdm(worlds, "worlds"):
        for actions in shots:
            envs[world].reset(options={"positions": positions})
            begin = time.perf_counter()
            *_, infos = envs[world].step(actions)
            seconds[world] += time.perf_counter() - begin
            successes[world].append(infos["is_success"])
    policies = []
    for k, run in enumerate(tqdm(runs, "false successes")):
        own, exact = successes[run.world][k], successes["exact"][k]
        policies.append(
            {
                "world": run.world,
                "seed": run.seed,
                "curve": [list(point) for point in learning_curve(run.folder)],
                "success": {world: int(successes[world][k].sum()) for world in worlds},
                "false_successes": _causes(worlds[run.world], env, positions, shots[k], own & ~exact),
            }
        )
    return {
        "versions": versions(),
        "worlds_measured": {
            world: {**worlds[world], "shots_per_second": layouts * len(shots) / seconds[world]} for world in worlds
        },
        "policies": policies,
    }


def _shots(run_dir: Path, observations: NDArray[np.float32]) -> Floats:
    """Returns the actions of a run's policy, (m, 2)."""
    _, policy = load_policy(run_dir)
    return np.asarray(deterministic(policy)(observations), np.float64)


def _causes(
    world: Mapping[str, Any], env: BilliardsEnv, positions: Floats, actions: Floats, false: Bools
) -> dict[str, int]:
    """Returns the number of false successes by cause."""
    counts: Counter[str] = Counter()
    for i in np.flatnonzero(false).tolist():
        start = env.scene, positions[i], cue_strike(actions[i], env.scene, env.max_speed)
        exact, stepped = simulate(*start, record=True), simulate(*start, **world, record=True)
        differs = np.flatnonzero(exact.potted != stepped.potted)
        counts[cause(exact, stepped, world["dt"], int(differs[-1]))] += 1  # a ball to pot, or else the cue ball
    return {name: counts[name] for name in CAUSES}
