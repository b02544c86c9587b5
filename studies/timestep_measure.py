"""What policies of a study of timesteps do on the same layouts, in numbers.

Every policy plays every layout once, without exploration noise, so a policy is its shots: one velocity of the cue ball
a layout. `measure` plays the shots of each policy in each world and tells

* the share that succeeds in each world, with Wilson's 95 % interval over the layouts;
* how the shots differ: their speed; the cut, the sine of the cut angle at the nearest ball to pot if nothing is in the
  way (see `cuts`); and the turn, the angle between the shot's direction and those of the policies trained in the
  exact world (the others, for one of these) on the same layout;
* what the shots rest on that succeed in the world their policy was trained in: how many of them fail in the exact
  world, and by which failure of the timestep they succeed, see `studies.causes`.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from agents.config import Config
from agents.evaluate import deterministic
from agents.intervals import wilson_interval
from agents.ppo import evaluation_seeds, load_policy
from agents.train import learning_curve, versions
from billiards_env.envs import BilliardsEnv, BilliardsVectorEnv
from billiards_env.envs.action_frames import ActionTransform, cue_velocity
from billiards_env.simulation import simulate
from studies.causes import CAUSES, cause

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

LAYOUT_SEED = 0

QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
CUTS = np.linspace(-1.0, 1.0, 41)
ANGLES = np.linspace(0.0, 90.0, 46)
TURNS = np.concatenate(([0.0], np.geomspace(0.1, 180.0, 40)))
SPEED_BINS = 40


def measure(
    recipe: Config, worlds: Mapping[str, Mapping[str, Any]], policies: Sequence[tuple[str, int, Path]], layouts: int
) -> dict[str, Any]:
    """Plays the policies in all worlds.

    Args:
        recipe: What they were trained with, but for the world and the seed.
        worlds: By name, what `gym.make` takes for it; "exact" among them.
        policies: World, seed and folder of each finished run.
        layouts: On how many layouts.

    Returns:
        Plain data: `versions`, `bins` of the histograms, `worlds_measured` and `policies`.

    Raises:
        OSError: If a run's file cannot be read.
        ValueError: If it does not hold what it should.
    """
    seeds = evaluation_seeds(LAYOUT_SEED, layouts).tolist()
    envs = {
        world: BilliardsVectorEnv(layouts, "Disabled", 1, **{**recipe.env, **arguments})
        for world, arguments in worlds.items()
    }
    observations, _ = envs["exact"].reset(seed=seeds)
    positions, env = envs["exact"].positions, envs["exact"].single_env
    shots = [_shots(folder, observations, positions, env) for _, _, folder in tqdm(policies, "policies")]
    successes = {world: [] for world in worlds}
    seconds = dict.fromkeys(worlds, 0.0)
    for world in tqdm(worlds, "worlds"):
        for actions in shots:
            envs[world].reset(options={"positions": positions})
            begin = time.perf_counter()
            *_, infos = envs[world].step(actions)
            seconds[world] += time.perf_counter() - begin
            successes[world].append(infos["success"])
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
        "policies": [
            {
                "world": world,
                "seed": seed,
                "training_seconds": learning_curve(folder)[-1].seconds,
                "success": {w: _share(successes[w][k]) for w in worlds},
                **_differences(k, shots, positions, env, [p[0] for p in policies]),
                "rests_on": _rests_on(
                    worlds[world], env, positions, shots[k], successes[world][k], successes["exact"][k]
                ),
            }
            for k, (world, seed, folder) in enumerate(tqdm(policies, "shots replayed"))
        ],
    }


def speed_bins(max_speed: float) -> Floats:
    """The edges of the bins of speeds, m/s."""
    return np.linspace(0.0, max_speed, SPEED_BINS + 1)


def cuts(actions: Floats, positions: Floats, targets: Bools, radius: Floats) -> Floats:
    """(m,) the cuts of shots.

    A cut is the distance of the nearest ball to pot from the line along which the cue ball sets out, over the distance
    of the two centres at contact: the action of the frame "cut". Beyond +-1 the line passes the ball; it is infinite
    where the cue ball sets out away from it.

    Args:
        actions: (m, 2) the directions in which the cue balls set out, of any length.
        positions: (m, n, 2) where the balls are, m.
        targets: (n,) bool, the balls to pot.
        radius: (n,) m.
    """
    ways = positions[:, targets] - positions[:, :1]
    distances = np.hypot(ways[..., 0], ways[..., 1])
    nearest = distances.argmin(axis=1)
    way = np.take_along_axis(ways, nearest[:, None, None], axis=1)[:, 0]
    across = way[:, 1] * actions[:, 0] - way[:, 0] * actions[:, 1]
    ahead = (way * actions).sum(axis=1)
    length = np.hypot(actions[:, 0], actions[:, 1])
    reach = radius[0] + radius[targets][nearest]
    return np.where(ahead > 0, across / np.where(length > 0, length, 1.0), np.inf) / reach


def _shots(run_dir: Path, observations: NDArray[np.float32], positions: Floats, env: BilliardsEnv) -> Floats:
    """(m, 2) what the run's policy does, as the environment takes it."""
    config, policy = load_policy(run_dir)
    actions = np.asarray(deterministic(policy)(observations), np.float64)
    if config.frame is not None:
        f = config.frame
        frame = ActionTransform(f.name, env.scene, env.targets, env.max_speed, f.ball, f.least_speed)
        return frame.velocities(actions, positions, np.zeros(positions.shape[:2], np.bool_)) / env.max_speed
    return actions


def _share(successes: Bools) -> dict[str, Any]:
    rate = wilson_interval(int(successes.sum()), len(successes))
    return {"rate": float(successes.mean()), "interval": list(rate)}


def _differences(
    k: int, shots: Sequence[Floats], positions: Floats, env: BilliardsEnv, worlds: Sequence[str]
) -> dict[str, Any]:
    """How the shots of policy k differ from others."""
    actions = shots[k]
    speed = env.max_speed * np.minimum(np.hypot(actions[:, 0], actions[:, 1]), 1.0)
    cut = cuts(actions, positions, env.targets, np.array(env.scene.balls.radius))
    aimed = np.abs(cut) <= 1.0
    others = [shots[j] for j, world in enumerate(worlds) if world == "exact" and j != k]
    turn = np.concatenate([_turn(actions, other) for other in others] or [np.empty(0)])
    return {
        "speed": _distribution(speed, speed_bins(env.max_speed)),
        "cut": _distribution(cut[aimed], CUTS),
        "cut_angle": _distribution(np.degrees(np.arcsin(np.abs(cut[aimed]))), ANGLES),
        "aimed_at_ball": float(aimed.mean()),
        "turn": _distribution(turn, TURNS),
    }


def _turn(a: Floats, b: Floats) -> Floats:
    """(m,) the angle between directions, degrees."""
    return np.degrees(np.abs(np.arctan2(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0], (a * b).sum(axis=1))))


def _distribution(values: Floats, edges: Floats) -> dict[str, Any]:
    """Quantiles, None where there are no values, and the share of them in each bin."""
    counts = np.histogram(values, edges)[0]
    return {
        "quantiles": np.quantile(values, QUANTILES).tolist() if len(values) else None,
        "histogram": (counts / max(len(values), 1)).tolist(),
    }


def _rests_on(
    world: Mapping[str, Any], env: BilliardsEnv, positions: Floats, actions: Floats, own: Bools, exact: Bools
) -> dict[str, Any]:
    """Of the shots that succeed in their own world, how many fail in the exact one, and by which cause."""
    counts: Counter[str] = Counter()
    fails = np.flatnonzero(own & ~exact)
    for i in fails.tolist():
        start = env.scene, positions[i], cue_velocity(actions[i], env.max_speed)
        true, stepped = simulate(*start, record=True), simulate(*start, **world, record=True)
        differs = np.flatnonzero(true.potted != stepped.potted)
        counts[cause(true, stepped, world["dt"], int(differs[-1]))] += 1  # a ball to pot, or else the cue ball
    return {
        "successes": int(own.sum()),
        "fail_in_exact": len(fails),
        "causes": {name: counts[name] for name in CAUSES},
    }
