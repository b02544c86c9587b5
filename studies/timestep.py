"""Studies the effect of the timestep on policies that learn to aim: `python -m studies.timestep`.

`examples/ppo.py` trains policies in several worlds with several seeds each. One world is exact; in the others the same
balls move in steps of dt. Then every policy plays the same new layouts in every world, without exploration noise. A
shot is a false success if it succeeds in the world of the training and fails in the exact one.

The results of all runs are in `studies/results/timestep.json`, and the weights of the main part in the folder
`policies/timestep` beside this file. Each run is written there when it ends. The command skips runs that have results,
so it continues after an interruption. At the end it prints the tables and draws the pictures of the study.
"""

from __future__ import annotations

import contextlib
import functools
import io
import json
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray

from agents.train import versions
from benchmarks import machine, run_command
from billiards_env.bench.evaluation import evaluation_seeds, play_together
from billiards_env.engine import Engine
from billiards_env.envs import BilliardsVectorEnv, make_vector_env
from billiards_env.sb3.aim_network import AimNetwork
from billiards_env.scene import Scene
from billiards_env.shots.simulation import simulate_batch
from billiards_env.support.files import write_json
from examples import ppo
from studies import JOBS, RESULTS, completed, executor, load_arrays, read_results, save_arrays
from studies.timestep_report import GROUPS, blocks, draw

Floats = NDArray[np.float64]
Weights = dict[str, NDArray[np.float16]]

TIMESTEPS = (960, 480, 240, 120, 60, 30, 15)  # 1/s
WORLDS: dict[str, dict[str, Any]] = {"exact": {}, **{f"1/{n}": {"mode": "pit", "dt": 1 / n} for n in TIMESTEPS}}
"""The arguments of `gym.make` of each world, by name. The fix of a world with a timestep is `push_apart`."""

MOVE_BACK = {f"1/{n}": {**WORLDS[f"1/{n}"], "fix": "move_back"} for n in (240, 60, 15)}
RANDOM = [WORLDS[f"1/{n}"] for n in TIMESTEPS]
SEEDS = tuple(range(11, 21))
FEW_SEEDS = SEEDS[:5]
SHOTS, SHOTS_OF_GAMES = 1_000_000, 500_000
LONG = "--shots 5e6 --hidden 192 --epochs 3 --until 0.12 --entropy 0.03 0.006"
FINE_TUNING = (
    "--shots 5e5 --rate 5e-4 --entropy 0.003 0.003 --std-speed 0.03 0.03 --std-aim 0.005 0.0015 --evaluate-every 5e4"
)
ABLATION = {
    "4 points": "--points 4",
    "constant spread of the aim": "--std-aim 0.0015 0.0015",
    "little entropy": "--entropy 0.003 0.003",
}
"""Options of `examples/ppo.py` that remove one of its ideas, by the name of the remaining policy."""

GAMES: dict[str, tuple[dict[str, Any], str]] = {
    "three_balls": (
        {"n_object_balls": 3, "max_shots": 5},
        f"--shots {SHOTS_OF_GAMES} --rate 4e-3 --envs 2048 --minibatch 512",
    ),
    "carom": (
        {"task": "carom", "layout": "random", "max_speed": 6.0},
        f"--shots {SHOTS_OF_GAMES} --rate 4e-3 --envs 2048 --minibatch 512 --aim layout --points 8 --hidden 192",
    ),
}
"""Other games, by the name of the part: arguments of `gym.make`, and options of `examples/ppo.py`."""

WORLDS_OF_GAMES = ("exact", "1/240", "1/60", "1/15")

LAYOUTS, LAYOUT_SEED = 10_000, 20_261

OUTPUT = RESULTS / "timestep.json"


class Run(NamedTuple):
    """A training run.

    Attributes:
        part: The part of the study, a key of `PARTS`.
        world: The name of the world, or of the variant.
        seed: The seed of the training.
        envs: The arguments of `gym.make` of the worlds of the training. The first one is the policy's own world.
        options: Further options of `examples/ppo.py`.
        start: The name of the run whose policy is trained further; None for a new policy.
    """

    part: str
    world: str
    seed: int
    envs: list[dict[str, Any]]
    options: str = f"--shots {SHOTS}"
    start: str | None = None

    @property
    def name(self) -> str:
        """The name of the run and of the file of its weights."""
        return "_".join((self.part, self.world, str(self.seed))).replace("/", "-").replace(" ", "-")


PARTS: dict[str, list[Run]] = {
    "main": [Run("main", world, seed, [env]) for seed in SEEDS for world, env in WORLDS.items()],
    "random": [Run("random", "random", seed, RANDOM) for seed in FEW_SEEDS],
    "move_back": [Run("move_back", world, seed, [env]) for seed in FEW_SEEDS for world, env in MOVE_BACK.items()],
    "fine_tuning": [
        Run("fine_tuning", world, seed, [{}], FINE_TUNING, Run("main", world, seed, []).name)
        for seed in FEW_SEEDS
        for world in MOVE_BACK
    ],
    "ablation": [
        Run("ablation", name, seed, [{}], options) for seed in SEEDS[:3] for name, options in ABLATION.items()
    ],
    "long": [
        Run("long", world, seed, [WORLDS[world]], LONG)
        for seed in SEEDS
        for world in WORLDS_OF_GAMES
        if world == "exact" or seed in FEW_SEEDS
    ],
    **{
        part: [
            Run(part, world, seed, [{**game, **WORLDS[world]}], options)
            for seed in FEW_SEEDS
            for world in WORLDS_OF_GAMES
        ]
        for part, (game, options) in GAMES.items()
    },
}
"""The runs of each part. A run starts from a policy of an earlier part, or from none."""

SAVED = ("main",)
"""The parts whose weights are kept."""


def successes(actions: Floats, positions: Floats, envs: Mapping[str, Any]) -> dict[str, NDArray[np.bool_]]:
    """Returns which shots succeed in each world, (m,), for actions (m, 2) and positions (m, 2, 2) in m."""
    by_world = {}
    for world, env in envs.items():
        env.reset(options={"positions": positions})
        by_world[world] = env.step(actions)[-1]["is_success"]
    return by_world


def direct_pots(
    actions: Floats, positions: Floats, scene: Scene, max_speed: float, world: Mapping[str, Any]
) -> tuple[NDArray[np.bool_], NDArray[np.intp]]:
    """Returns which shots are direct pots without a scratch, (m,), and the pockets nearest to the ball's end, (m,).

    In a direct pot neither the cue ball before the hit nor the object ball touches a cushion.

    Args:
        actions: (m, 2) shots of the cue ball.
        positions: (m, 2, 2) m, the tables.
        scene: The scene.
        max_speed: The speed of an action of length 1, m/s.
        world: The engine, an entry of `WORLDS`.
    """
    shots = simulate_batch(scene, positions, max_speed * actions, threads=1, engine=Engine(**world))
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


def aims(
    actions: Floats, positions: Floats, pockets: NDArray[np.intp], scene: Scene, max_speed: float, dt: float
) -> Aims:
    """Returns the `Aims` of shots (m, 2) of the cue ball at pockets (m,), on tables with positions (m, 2, 2).

    An engine with a timestep finds the contact late: the cue ball has gone on by s, which is between 0 and v dt. At the
    cut angle a this turns the line of centres by s sin(a) / (2 R) towards a thinner hit. A line that is shifted by
    s sin(a) cos(a) to a thicker hit compensates for it. The mean of s is v dt / 2.
    """
    cue_ball, ball = positions[:, 0], positions[:, 1]
    speed = max_speed * np.linalg.norm(actions, axis=1)
    line = max_speed * actions / np.maximum(speed, 1e-9)[:, None]
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


def aims_by_group(aimed: Aims) -> dict[str, list[list[float]]]:
    """Returns the number of shots, their mean error and the mean of its prediction, mm, for each of `GROUPS`."""
    rows: dict[str, list[list[float]]] = {}
    for (name, (_, edges)), values in zip(GROUPS.items(), (aimed.cut, aimed.distance, aimed.speed), strict=True):
        rows[name] = []
        for low, high in pairwise(edges):
            group = (values >= low) & (values < high)
            means = [1e3 * float(part[group].mean()) if group.any() else 0.0 for part in aimed[:2]]
            rows[name].append([int(group.sum()), *means])
    return rows


def train(run: Run, start: Weights | None, layouts: int) -> tuple[dict[str, Any], Weights]:
    """Trains a policy and plays it on new layouts in all worlds.

    Args:
        run: The run.
        start: The weights of the policy that is trained further; None for a new policy.
        layouts: The number of new layouts.

    Returns:
        The result as plain data, and the weights. The result has the fields of the run; `curve`, the evaluations during
        the training (see `ppo.train`); the output of `play_in_worlds`, or of `play_in_game` in a part of `GAMES`;
        and in the main part `aim`, the output of `aim_of_policy`.
    """
    options = f"{run.options} --seed {run.seed} --episodes {min(layouts, 2000)}".split()
    args = ppo.arguments([*options, "--env", json.dumps(run.envs)])
    with contextlib.redirect_stdout(io.StringIO()):
        policy, curve = ppo.train(args, None if start is None else policy_of(start, args))
    weights = {name: value.numpy().astype(np.float16) for name, value in policy.state_dict().items()}
    policy = policy_of(weights, args)
    result = {**run._asdict(), "curve": curve}
    if run.part in GAMES:
        result |= play_in_game(policy, run, layouts)
    else:
        result |= play_in_worlds(policy, run.envs[0], layouts)
    if run.part == "main":
        result["aim"] = aim_of_policy(policy, run.envs[0], layouts)
    return result, weights


def play_in_worlds(policy: AimNetwork, own_world: dict[str, Any], layouts: int) -> dict[str, Any]:
    """Plays a policy on new layouts in all worlds.

    Args:
        policy: The policy.
        own_world: The arguments of `gym.make` of its own world.
        layouts: The number of layouts.

    Returns:
        `success`, the number of successes in each world; `own`, the number in the policy's own world; and
        `false_successes` and `false_failures`, the numbers of shots that succeed only in its own world and only in the
        exact world.
    """
    envs = make_worlds(layouts, {**WORLDS, "own": own_world})
    observations, _ = envs["exact"].reset(seed=evaluation_seeds(LAYOUT_SEED, layouts).tolist())
    potted = successes(actions_of(policy, envs["exact"], observations), envs["exact"].positions, envs)
    own, exact = potted.pop("own"), potted["exact"]
    return {
        "success": {world: int(shots.sum()) for world, shots in potted.items()},
        "own": int(own.sum()),
        "false_successes": int((own & ~exact).sum()),
        "false_failures": int((exact & ~own).sum()),
    }


def play_in_game(policy: AimNetwork, run: Run, layouts: int) -> dict[str, Any]:
    """Plays new episodes of a part of `GAMES` in the worlds of the games.

    Returns:
        `success`, the number of successes in each world, and `own`, the number in the world of the run.
    """
    seeds, game = evaluation_seeds(LAYOUT_SEED, layouts).tolist(), GAMES[run.part][0]
    success = {}
    for world in WORLDS_OF_GAMES:
        envs = make_vector_env(layouts, threads=1, **game, **WORLDS[world])
        success[world] = play_together(envs, functools.partial(actions_of, policy, envs), seeds)["successes"]
    return {"success": success, "own": success[run.world]}


def aim_of_policy(policy: AimNetwork, own_world: dict[str, Any], layouts: int) -> dict[str, list[list[float]]]:
    """Returns `aims_by_group` of the direct pots of a policy in its own world, on the layouts of `play_in_worlds`."""
    envs = make_worlds(layouts, {"exact": {}})["exact"]
    observations, _ = envs.reset(seed=evaluation_seeds(LAYOUT_SEED, layouts).tolist())
    scene, max_speed = envs.single_env.scene, envs.single_env.max_speed
    actions = actions_of(policy, envs, observations)
    direct, pockets = direct_pots(actions, envs.positions, scene, max_speed, own_world)
    shots = actions[direct], envs.positions[direct], pockets[direct]
    return aims_by_group(aims(*shots, scene, max_speed, own_world.get("dt", 0.0)))


def actions_of(policy: AimNetwork, envs: BilliardsVectorEnv, observations: NDArray[np.float32]) -> Floats:
    """Returns the actions (m, 2) of a policy without exploration noise."""
    with torch.no_grad():
        return policy(ppo.positions_of(envs, observations))[0].mode().clamp(-1, 1).numpy().astype(np.float64)


def make_worlds(layouts: int, worlds: Mapping[str, dict[str, Any]]) -> dict[str, Any]:
    """Returns vector environments of a number of layouts in some worlds, by name. They do not reset by themselves."""
    return {name: make_vector_env(layouts, "Disabled", 1, **arguments) for name, arguments in worlds.items()}


def policy_of(weights: Weights, args: Any) -> AimNetwork:
    """Returns the policy with some weights, for the options of the training."""
    policy = AimNetwork(weights["half_extents"].tolist(), args.points, args.speeds, args.hidden, args.aim)
    read = {name: torch.from_numpy(value.astype(np.float32)) for name, value in weights.items()}
    # Older files of policies for one object ball do not have the weights of the other balls.
    policy.load_state_dict({**policy.state_dict(), **read})
    return policy


def policy_folder(output: Path) -> Path:
    """Returns the folder of the weights that belong to a JSON file of results."""
    return output.parent / "policies" / "timestep"


def measure(output: Path, jobs: int, address: str) -> dict[str, Any]:
    """Trains what has no results, and writes the result of each run as soon as it ends.

    `jobs` runs are trained at a time, on this machine or on the Ray cluster at `address`.

    Returns:
        The content of the file: `machine`, `versions`, `layouts`, and `runs`, the results of `train` by name.

    Raises:
        OSError: If a file cannot be read or written.
        RuntimeError: If a run fails on the cluster.
    """
    content = read_results(output)
    if content.get("layouts") != LAYOUTS:
        content = {"machine": machine(), "versions": versions(), "layouts": LAYOUTS, "runs": {}}
    folder = policy_folder(output)
    folder.mkdir(parents=True, exist_ok=True)
    with executor(jobs, address) as pool:
        for part, runs in PARTS.items():
            calls = {
                run.name: (
                    train,
                    run,
                    None if run.start is None else load_arrays(folder / f"{run.start}.npz"),
                    LAYOUTS,
                )
                for run in runs
                if not is_result(content, run)
            }
            for name, (result, weights) in completed(pool, calls, len(runs) - len(calls)):
                if part in SAVED:
                    save_arrays(folder / f"{name}.npz", weights)
                content["runs"][name] = result
                write_json(output, content)
    return content


def is_result(content: Mapping[str, Any], run: Run) -> bool:
    """Returns whether the results have a run with these settings."""
    result = content["runs"].get(run.name)
    return result is not None and all(result[key] == value for key, value in run._asdict().items())


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m studies.timestep --help`."""
    about = "Train policies in the exact world and in worlds with a timestep, and compare them."
    run_command("studies.timestep", about, arguments, measure, blocks, {"output": (OUTPUT, "JSON file"), **JOBS}, draw)


if __name__ == "__main__":
    main()
