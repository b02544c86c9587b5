"""Measures the policies of a study of timesteps on the same layouts.

Every policy plays every layout once, without exploration noise, so it is described by its shots: one velocity of the
cue ball for each layout. `measure` plays the shots of each policy in each world and counts

* the successes in each world;
* how the shots differ: their speed; their cut, which is the sine of the cut angle at the nearest ball to pot if there
  is no obstacle (see `cuts`); and their turn, which is the angle between the shot's direction and those of the policies
  trained in the exact world, except itself, on the same layout;
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

QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
CUTS = np.linspace(-1.0, 1.0, 41, dtype=np.float64)
ANGLES = np.linspace(0.0, 90.0, 46, dtype=np.float64)
TURNS = np.concatenate(([0.0], np.geomspace(0.1, 180.0, 40)))
SPEED_BINS = 40


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
        Plain data: `versions`; `bins`, the edges of the histograms; `worlds_measured`, the arguments and speed of each
        world; and `policies`. A policy has `world`, `seed`, `curve` (a list of `agents.train.Point`), `success` (the
        number of successes in each world), the distributions `speed`, `cut`, `cut_angle` and `turn` (quantiles and
        counts), `aimed_at_ball` (a share), and `false_successes` (their number by cause).

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
            successes[world].append(infos["success"])
    policies = []
    for k, run in enumerate(tqdm(runs, "false successes")):
        own, exact = successes[run.world][k], successes["exact"][k]
        others = [shots[j] for j, other in enumerate(runs) if other.world == "exact" and j != k]
        policies.append(
            {
                "world": run.world,
                "seed": run.seed,
                "curve": [list(point) for point in learning_curve(run.folder)],
                "success": {world: int(successes[world][k].sum()) for world in worlds},
                **_distributions(shots[k], others, positions, env),
                "false_successes": _causes(worlds[run.world], env, positions, shots[k], own & ~exact),
            }
        )
    return {
        "versions": versions(),
        "bins": {
            "speed": speed_bins(env.max_speed).tolist(),
            "cut": CUTS.tolist(),
            "cut_angle": ANGLES.tolist(),
            "turn": TURNS.tolist(),
        },
        "worlds_measured": {
            world: {**worlds[world], "shots_per_second": layouts * len(shots) / seconds[world]} for world in worlds
        },
        "policies": policies,
    }


def speed_bins(max_speed: float) -> Floats:
    """Returns the edges of the bins of speeds, m/s."""
    return np.linspace(0.0, max_speed, SPEED_BINS + 1, dtype=np.float64)


def cuts(actions: Floats, positions: Floats, targets: Bools, reach: Floats) -> Floats:
    """Returns the cuts of shots, (m,).

    A cut is the distance of the nearest ball to pot from the line of the cue ball's initial direction, over the
    distance of the two centres at contact. It is the action of the frame "cut". Beyond +-1 the line misses the ball. It
    is infinite if the cue ball moves away from the ball.

    Args:
        actions: (m, 2) initial directions of the cue balls, of any length.
        positions: (m, n, 2) m.
        targets: (n,) bool, the balls to pot.
        reach: (n,) m, distances of the centres of the cue ball and each ball at contact.
    """
    to_targets = positions[:, targets] - positions[:, :1]
    distances = np.hypot(to_targets[..., 0], to_targets[..., 1])
    nearest = distances.argmin(axis=1)
    to_nearest = np.take_along_axis(to_targets, nearest[:, None, None], axis=1)[:, 0]
    across = to_nearest[:, 1] * actions[:, 0] - to_nearest[:, 0] * actions[:, 1]
    ahead = (to_nearest * actions).sum(axis=1)
    length = np.hypot(actions[:, 0], actions[:, 1])
    sine = across / np.where(length > 0, length, 1.0) / reach[targets][nearest]
    return np.where(ahead > 0, sine, np.inf)


def _shots(run_dir: Path, observations: NDArray[np.float32]) -> Floats:
    """Returns the actions of a run's policy, (m, 2)."""
    _, policy = load_policy(run_dir)
    return np.asarray(deterministic(policy)(observations), np.float64)


def _distributions(actions: Floats, others: Sequence[Floats], positions: Floats, env: BilliardsEnv) -> dict[str, Any]:
    """Returns the distributions of the speeds, cuts and cut angles of shots, and of their turns against other shots."""
    speed = env.max_speed * np.minimum(np.hypot(actions[:, 0], actions[:, 1]), 1.0)
    cut = cuts(actions, positions, env.targets, env.scene.balls.contact_distances(0))
    aimed = np.abs(cut) <= 1.0
    turn = np.concatenate([_turn(actions, other) for other in others] or [np.empty(0)])
    return {
        "speed": _distribution(speed, speed_bins(env.max_speed)),
        "cut": _distribution(cut[aimed], CUTS),
        "cut_angle": _distribution(np.degrees(np.arcsin(np.abs(cut[aimed]))), ANGLES),
        "aimed_at_ball": float(aimed.mean()),
        "turn": _distribution(turn, TURNS),
    }


def _turn(a: Floats, b: Floats) -> Floats:
    """Returns the angles between directions (m, 2), (m,) degrees."""
    return np.degrees(np.abs(np.arctan2(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0], (a * b).sum(axis=1))))


def _distribution(values: Floats, edges: Floats) -> dict[str, Any]:
    """Returns the quantiles of values, None if there are no values, and the number of values in each bin."""
    return {
        "quantiles": np.quantile(values, QUANTILES).tolist() if len(values) else None,
        "counts": np.histogram(values, edges)[0].tolist(),
    }


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
