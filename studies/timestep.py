"""Studies the effect of the timestep on policies that learn to aim: `python -m studies.timestep`.

`agents.train` trains the settings of `configs/timestep.yaml` in several worlds with several seeds, in
`runs/timestep/WORLD/seedN`. One world is exact; in the others the same balls move in steps of dt. Then each policy
plays the same new layouts in its own world and in the exact one, without exploration. A shot is a false success if it
succeeds in the world of the training and fails in the exact one.

The results are in `studies/results/timestep.json`, and the policies of the first seed in the folder `policies/timestep`
beside this file. Each result is written there when its run ends. The command skips runs that have results, so it
continues after an interruption. At the end it prints the tables and draws the pictures of the study.
"""

from __future__ import annotations

import dataclasses
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.policies import BasePolicy

from agents.config import LEARNING, Config, load
from agents.ppo import deterministic, make_vector
from benchmarks import run_command
from billiards_env.bench.evaluation import evaluation_seeds
from billiards_env.engine import Engine
from billiards_env.sb3 import load_policy
from billiards_env.scene import Scene
from billiards_env.settings import read_settings
from billiards_env.shots.simulation import simulate_batch
from billiards_env.support.files import write_atomically, write_json
from studies import JOBS, RESULTS, RUNS, completed, executor, resumed
from studies.learning import trained
from studies.timestep_report import CUTS, EXACT, blocks, draw

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

SETTINGS = LEARNING.with_name("timestep.yaml")

TIMESTEPS = (960, 480, 240, 120, 60, 30, 15)  # 1/s
WORLDS: dict[str, dict[str, Any]] = {EXACT: {}, **{f"1/{n}": {"mode": "pit", "dt": 1 / n} for n in TIMESTEPS}}
"""The arguments of `gym.make` of each world, by name. The fix of a world with a timestep is `push_apart`."""

MOVE_BACK = {f"1/{n} move_back": {**WORLDS[f"1/{n}"], "fix": "move_back"} for n in (240, 60, 15)}

SEEDS = tuple(range(11, 21))
FEW_SEEDS = SEEDS[:5]
"""The seeds of the worlds with `move_back`."""

LAYOUTS, LAYOUT_SEED = 10_000, 20_261

OUTPUT = RESULTS / "timestep.json"


def config_of(world: str, seed: int = 0) -> Config:
    """Returns the settings of the training in a world."""
    config = load(SETTINGS, seed=seed)
    return dataclasses.replace(config, env={**config.env, **{**WORLDS, **MOVE_BACK}[world]})


class Shots(NamedTuple):
    """m shots of a policy, each on a new layout.

    Attributes:
        positions: (m, 2, 2) m.
        velocities: (m, 2) m/s, of the cue ball.
        own, exact: (m,) which of them succeed in the policy's own world and in the exact one.
    """

    positions: Floats
    velocities: Floats
    own: Bools
    exact: Bools


def play_layouts(policy: BasePolicy, world: str, layouts: int, seed: int) -> Shots:
    """Plays new layouts in the world of a policy and in the exact one, without exploration."""
    potted = []
    for played in (world, EXACT):
        envs: Any = make_vector(config_of(played), layouts, 1).unwrapped
        observations, _ = envs.reset(seed=evaluation_seeds(seed, layouts).tolist())
        positions, actions = envs.positions, deterministic(policy)(observations)
        potted.append(envs.step(actions)[-1]["final_info"]["is_success"])
    return Shots(positions, envs.single_env.max_speed * actions.astype(np.float64), *potted)


def direct_pots(velocities: Floats, positions: Floats, scene: Scene, engine: Engine) -> tuple[Bools, NDArray[np.intp]]:
    """Returns which shots are direct pots without a scratch, (m,), and the pockets nearest to the ball's end, (m,).

    In a direct pot neither the cue ball before the hit nor the object ball touches a cushion.

    Args:
        velocities: (m, 2) m/s, of the cue ball.
        positions: (m, 2, 2) m.
        scene: The scene.
        engine: The engine.
    """
    shots = simulate_batch(scene, positions, velocities, threads=1, engine=engine)
    places = scene.table.pocket_places
    pockets = np.linalg.norm(shots.positions[:, 1, None] - places, axis=2).argmin(1)
    direct = (shots.cushions_before_hit[:, 1] == 0) & (shots.cushions[:, 1] == 0)
    return direct & shots.potted[:, 1] & ~shots.potted[:, 0], pockets


class Aims(NamedTuple):
    """m shots as direct pots, each into one pocket.

    The *ghost ball* of a pocket is the position of the cue ball at a hit that sends the object ball to the pocket.

    Attributes:
        error: (m,) m, the distance between the line of the shot and the ghost ball; positive if the hit is too thin.
        predicted: (m,) m, the error that compensates for a timestep on average, see `aims`.
        cut: (m,) degrees, the cut angle of the ghost ball.
        distance: (m,) m, between the cue ball and the object ball.
        speed: (m,) m/s, of the cue ball when the balls touch.
    """

    error: Floats
    predicted: Floats
    cut: Floats
    distance: Floats
    speed: Floats


def aims(velocities: Floats, positions: Floats, pockets: NDArray[np.intp], scene: Scene, dt: float) -> Aims:
    """Returns the `Aims` of shots with velocities (m, 2) at pockets (m,), on tables with positions (m, 2, 2).

    An engine with a timestep finds the contact late: the cue ball has gone on by s, which is between 0 and v dt. At the
    cut angle a this turns the line of centres by s sin(a) / (2 R) towards a thinner hit. A line that is shifted by
    s sin(a) cos(a) to a thicker hit compensates for it. The mean of s is v dt / 2.
    """
    cue_ball, ball = positions[:, 0], positions[:, 1]
    speed = np.linalg.norm(velocities, axis=1)
    line = velocities / np.maximum(speed, 1e-9)[:, None]
    touching = 2.0 * scene.balls.radius[0]
    to_pocket = scene.table.pocket_places[pockets] - ball
    to_pocket /= np.linalg.norm(to_pocket, axis=1, keepdims=True)
    to_ghost = ball - touching * to_pocket - cue_ball
    to_ghost /= np.linalg.norm(to_ghost, axis=1, keepdims=True)
    cosine, side = (to_ghost * to_pocket).sum(1), _cross(to_ghost, to_pocket)
    error = np.where(side < 0, -1.0, 1.0) * (_cross(line, ball - cue_ball) - touching * side)
    distance = np.linalg.norm(ball - cue_ball, axis=1)
    speed = _speed_after(speed, np.maximum(distance - touching * cosine, 0.0), scene)
    cut = np.degrees(np.arctan2(np.abs(side), cosine))
    return Aims(error, -0.5 * speed * dt * np.abs(side) * cosine, cut, distance, speed)


def _cross(a: Floats, b: Floats) -> Floats:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def _speed_after(speed: Floats, path: Floats, scene: Scene) -> Floats:
    """Returns the speed of a ball after a path, m/s. It starts without spin, slides, and rolls at 5/7 of its speed."""
    physics = scene.physics
    sliding = 12.0 * speed**2 / (49.0 * physics.mu_slide * physics.g)
    rolls = (5.0 / 7.0 * speed) ** 2 - 2.0 * physics.mu_roll * physics.g * (path - sliding)
    slides = speed**2 - 2.0 * physics.mu_slide * physics.g * path
    return np.sqrt(np.maximum(np.where(path < sliding, slides, rolls), 0.0))


def aims_by_cut(aimed: Aims) -> list[list[float]]:
    """Returns the number of shots, their mean error and the mean of its prediction, mm, for each of `CUTS`."""
    rows: list[list[float]] = []
    for low, high in pairwise(CUTS):
        group = (aimed.cut >= low) & (aimed.cut < high)
        means = [1e3 * float(part[group].mean()) if group.any() else 0.0 for part in (aimed.error, aimed.predicted)]
        rows.append([int(group.sum()), *means])
    return rows


def run_world(world: str, seed: int, folder: Path, layouts: int) -> tuple[dict[str, Any], dict[str, bytes]]:
    """Trains a policy in a world, unless the folder holds the finished run, and plays new layouts.

    Returns:
        The result as plain data: `shots` and `seconds` of the training; the numbers of successes, `own` in the policy's
        own world and `exact` in the exact one; `false_successes`, those of `own` that fail in the exact world; and
        `aim`, see `aims_by_cut`, of the direct pots in the own world. Then the files of the policy.
    """
    config = config_of(world, seed)
    curve, files = trained(config, folder)
    shots = play_layouts(load_policy(folder)[1], world, layouts, LAYOUT_SEED)
    scene, engine = Scene.named(config.env["scene"], 1), Engine(**{**WORLDS, **MOVE_BACK}[world])
    direct, pockets = direct_pots(shots.velocities, shots.positions, scene, engine)
    aimed = aims(shots.velocities[direct], shots.positions[direct], pockets[direct], scene, engine.dt or 0.0)
    result = {
        "shots": curve[-1].steps,
        "seconds": curve[-1].seconds,
        "own": int(shots.own.sum()),
        "exact": int(shots.exact.sum()),
        "false_successes": int((shots.own & ~shots.exact).sum()),
        "aim": aims_by_cut(aimed),
    }
    return result, files


def policy_folder(output: Path, world: str) -> Path:
    """Returns the folder of the policy of a world that belongs to a JSON file of results."""
    return output.parent / "policies" / "timestep" / world.replace("/", "-")


def measure(output: Path, jobs: int, address: str) -> dict[str, Any]:
    """Trains what has no results, and writes the result of each run as soon as it ends.

    `jobs` runs are trained at a time, on this machine or on the Ray cluster at `address`.

    Returns:
        The content of the file: `machine`, `settings`, and `runs`, the results of `run_world` by world and seed.

    Raises:
        OSError: If a file cannot be read or written.
        ValueError: If the settings are invalid, or a folder holds a run of other settings.
        RuntimeError: If a run fails on the cluster.
    """
    settings = {"training": read_settings(SETTINGS, "settings"), "layouts": LAYOUTS}
    content = resumed(output, settings, runs={world: {} for world in (*WORLDS, *MOVE_BACK)})
    folder = RUNS / "timestep" if output == OUTPUT else output.parent / "runs"
    order = [(seed, world) for seed in SEEDS for world in (*WORLDS, *(MOVE_BACK if seed in FEW_SEEDS else ()))]
    calls = {
        (seed, world): (run_world, world, seed, folder / world.replace("/", "-") / f"seed{seed}", LAYOUTS)
        for seed, world in order
        if str(seed) not in content["runs"][world]
    }
    with executor(jobs, address) as pool:
        for (seed, world), (result, files) in completed(pool, calls, len(order) - len(calls)):
            content["runs"][world][str(seed)] = result
            write_json(output, content)
            for name, data in files.items() if seed == SEEDS[0] and world in WORLDS else ():
                write_atomically(policy_folder(output, world) / name, data)
    return content


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m studies.timestep --help`."""
    about = "Train policies in the exact world and in worlds with a timestep, and compare them."
    run_command("studies.timestep", about, arguments, measure, blocks, {"output": (OUTPUT, "JSON file"), **JOBS}, draw)


if __name__ == "__main__":
    main()
