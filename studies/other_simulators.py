"""Trains the learner of the timestep study in simulators of other projects: `python -m studies.other_simulators`.

The learner is `examples/ppo.py` with the layouts of `studies.timestep`. pymunk (rigid contacts) or MuJoCo (soft
contacts) plays the shots, in separate processes (`studies.simulators_worker`). The game is a direct pot: the object
ball has to drop without touching a cushion, and the cue ball must not touch a cushion before the hit. A ball slows down
at the rate `DECAY`: by `space.damping` in pymunk, and by the damping of the joints in MuJoCo.

The exact worlds have the same laws. As a function of the time s = (1 - exp(-DECAY t)) / DECAY a ball moves at a
constant speed. The exact worlds are therefore scenes with ideal motion, which end at the value of s for the longest
shot.

The predictions were made before the first training. The momentum passes later than at the touch, on average by a
*delay*, which the worker measures in head-on hits. A policy whose cue ball hits at the speed v and the cut angle a aims
at a hit that is thicker by v * delay * sin(a) * cos(a).

1. pymunk finds contacts at multiples of dt, when the balls overlap. The delay is dt / 2. The error of the aim has the
   size and the sign that it has with `push_apart` in the timestep study.
2. MuJoCo's contacts are soft, but do not begin before the touch. They last about 40 ms (`solref` is 0.02 s), while the
   line of centres turns. The error therefore keeps its sign. The delay is 8.5 ms for the default dt of 2 ms, as with
   rigid contacts and a timestep of 1/59 s. For dt = 10 ms the delay is 5.1 ms, so the error is smaller with the larger
   timestep.
3. A policy of an exact world succeeds in a simulator as often as in the exact world after each hit is turned by a
   delay, drawn from the delays of the head-on hits. (At first MuJoCo's mean delay was used for all its hits.)
4. pooltool has no timestep. A policy that trains exactly with pooltool's laws and table succeeds as often in pooltool.
   It may use cushions. The command skips this part without the environment of `benchmarks.comparison`.

The results are in `studies/results/other_simulators.json`. Each run is written there when it ends, and the command
skips runs that have results.
"""

from __future__ import annotations

import contextlib
import io
import json
import math
import subprocess
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import as_completed
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from tqdm import tqdm

from benchmarks import IMAGES, comparison, machine_line, save, table, use_own_font
from billiards_env import Scene, simulate_batch
from billiards_env.envs import BilliardsVectorEnv, make_model
from billiards_env.evaluation import evaluation_seeds
from billiards_env.files import write_json
from billiards_env.scene import Balls, Physics, Table
from billiards_env.scene.table import six_pockets
from examples import ppo
from studies import RESULTS, parser_of, report, resumed, workers
from studies.timestep import LAYOUT_SEED, LAYOUTS, aims, aims_by_group, shots_of
from studies.timestep_report import GROUPS

Floats = NDArray[np.float64]
Play = Callable[[Floats, Floats], NDArray[np.intp]]
"""Plays m shots. The arguments are positions (m, 2, 2), m, and velocities (m, 2), m/s. The result (m,) is the pocket of
each direct pot, or -1."""

WORKER = Path(__file__).with_name("simulators_worker.py")
PYTHON = WORKER.parents[1] / ".venv-simulators" / "bin" / "python"
SHOTS, SLOTS = 400_000, 128
DECAY, TIME = math.log(2.0), 6.0  # 1/s: half of the speed is lost in a second, `space.damping = 0.5`; s
RESTITUTION = {"rigid": (0.95, 0.85), "soft": (math.exp(-2.0), math.exp(-2.0))}
"""The restitution of balls and of cushions. Critically damped contacts, MuJoCo's default, have exp(-2)."""


class World(NamedTuple):
    """The simulator, the laws, dt, s, and the number of policies that train there.

    The simulator is "pymunk", "mujoco", "pooltool" or "exact". The laws are "pooltool" or a key of `RESTITUTION`.
    """

    simulator: str
    laws: str
    dt: float
    seeds: int


WORLDS = {
    "MuJoCo 2 ms": World("mujoco", "soft", 0.002, 1),
    **{f"pymunk 1/{n} s": World("pymunk", "rigid", 1 / n, 3) for n in (480, 240, 120, 60)},
    "MuJoCo 10 ms": World("mujoco", "soft", 0.01, 2),
    **{f"exact, {laws}": World("exact", laws, 0.0, 3) for laws in RESTITUTION},
    "exact, pooltool": World("exact", "pooltool", 0.0, 1),
    "pooltool 0.6": World("pooltool", "pooltool", 0.0, 0),
}
"""The worlds by name. Worlds with slow shots come first."""


def scene_of(laws: str) -> Scene:
    """Returns the exact scene with some laws."""
    if laws == "pooltool":
        return Scene.named("pooltool_pool", 1)
    e_ball, e_cushion = RESTITUTION[laws]
    end = (1.0 - math.exp(-DECAY * TIME)) / DECAY
    physics = Physics(motion="ideal", cushion="restitution", e_ball=e_ball, e_cushion=e_cushion, max_time=end)
    return Scene(Balls.uniform(2), Table(pockets=six_pockets()), physics)


@contextlib.contextmanager
def opened(world: World, processes: int, python: str) -> Iterator[tuple[Play, Floats]]:
    """Yields a function that plays shots of a world in worker processes, and the delays of the world's contacts, s."""
    scene, free = scene_of(world.laws), world.laws == "pooltool"  # free: the object ball may touch cushions
    pockets = scene.table.pockets

    def nearest(positions: Floats, good: NDArray[np.bool_]) -> NDArray[np.intp]:
        places = np.array([(pocket.x, pocket.y) for pocket in pockets])
        return np.where(good, np.linalg.norm(positions[:, None] - places, axis=2).argmin(1), -1)

    def play_exactly(positions: Floats, velocities: Floats) -> NDArray[np.intp]:
        shots = simulate_batch(scene, positions, velocities, threads=1)
        direct = (shots.cushions[:, 1] == 0) & (shots.cushions_before_hit[:, 1] == 0)
        return nearest(shots.positions[:, 1], shots.potted[:, 1] & (direct | free))

    if world.simulator == "exact":
        yield play_exactly, np.zeros(1)
        return
    if world.simulator == "pooltool":
        with comparison.pooltool(comparison.POOLTOOL_PYTHON) as (_, (run_shot, *_)):

            def play_by_pooltool(positions: Floats, velocities: Floats) -> NDArray[np.intp]:
                shots = (run_shot(scene, *shot, None).positions for shot in zip(positions, velocities, strict=True))
                ends = np.array([positions[0, 0] if shot is None else shot[1] for shot in shots])
                gaps = [np.hypot(*(ends - (p.x, p.y)).T) - p.radius for p in pockets]
                return nearest(ends, np.min(gaps, axis=0) < 0.0)  # a potted ball stays in its pocket

            yield play_by_pooltool, np.zeros(1)
        return
    e_ball, e_cushion = RESTITUTION[world.laws]
    settings = {
        "simulator": world.simulator,
        "dt": world.dt,
        "half_extents": scene.half_extents,
        "radius": scene.balls.radius[0],
        "corner": pockets[0].radius,
        "side": pockets[4].radius,
        "decay": DECAY,
        "e_ball": e_ball,
        "e_cushion": e_cushion,
        "time": TIME,
        "slots": SLOTS,
    }
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    started: list[Any] = [subprocess.Popen([python, str(WORKER)], **pipes) for _ in range(processes)]

    def answers(*requests: Any) -> list[Any]:
        for worker, request in zip(started, requests, strict=True):
            worker.stdin.write(json.dumps(request) + "\n")
            worker.stdin.flush()
        return [json.loads(worker.stdout.readline()) for worker in started]

    def play(positions: Floats, velocities: Floats) -> NDArray[np.intp]:
        parts = (np.array_split(shots, processes) for shots in (positions, velocities))
        return np.concatenate(
            answers(*({"positions": p.tolist(), "velocities": v.tolist()} for p, v in zip(*parts, strict=True)))
        )

    try:
        yield play, np.array(answers(*[settings] * processes)[0])
    finally:
        for worker in started:
            worker.communicate()


class PlayedEnvs(BilliardsVectorEnv):
    """The layouts of `Billiards-v0` with one ball, on which another simulator plays the shots."""

    def __init__(self, num_envs: int, scene: Scene, play: Play) -> None:
        super().__init__(num_envs, make_model(scene=scene.to_dict()), threads=1)
        self.play = play

    def step(self, actions: Any) -> Any:
        """Plays the shots and begins new episodes."""
        potted = self.play(self.positions, velocities_of(actions, self)) >= 0
        observations, _, *ended, infos = super().step(np.zeros_like(actions))  # this shot does nothing
        infos["final_info"]["is_success"] = potted
        return observations, potted.astype(np.float64), *ended, infos


def velocities_of(actions: Any, envs: BilliardsVectorEnv) -> Floats:
    """Returns the velocities of the cue ball, m/s; the largest length of an action is 1."""
    lengths = np.linalg.norm(actions, axis=1, keepdims=True)
    return envs.single_env.max_speed * np.asarray(actions, float) / np.maximum(lengths, 1.0)


def path_to_hit(positions: Floats, offset: Floats) -> Floats:
    """Returns the lengths (m,) of the cue ball's paths to the touch, m.

    `offset` is the distance of the cue ball's line from the object ball, m.
    """
    distance, touching = np.linalg.norm(positions[:, 1] - positions[:, 0], axis=1), 2.0 * Balls.uniform(2).radius[0]
    return np.sqrt(np.maximum(distance**2 - offset**2, 0.0)) - np.sqrt(np.maximum(touching**2 - offset**2, 0.0))


def delayed(positions: Floats, velocities: Floats, delay: Floats) -> Floats:
    """Returns velocities (m, 2) whose exact hits have the same lines of centres as late hits with `velocities`.

    `delay` (m,) is the time, s, between the touch and the late hit.
    """
    cue_ball, ball, touching = positions[:, 0], positions[:, 1], 2.0 * Balls.uniform(2).radius[0]
    speed = np.linalg.norm(velocities, axis=1)
    line = velocities / np.maximum(speed, 1e-9)[:, None]
    offset = line[:, 0] * (ball - cue_ball)[:, 1] - line[:, 1] * (ball - cue_ball)[:, 0]
    path = path_to_hit(positions, offset)
    late = cue_ball + (path + delay * np.maximum(speed - DECAY * path, 0.0))[:, None] * line
    centres = ball - late
    to_touch = ball - touching * centres / np.linalg.norm(centres, axis=1, keepdims=True) - cue_ball
    turned = speed[:, None] * to_touch / np.linalg.norm(to_touch, axis=1, keepdims=True)
    hits = (abs(offset) < touching) & ((line * (ball - cue_ball)).sum(1) > 0.0)
    return np.where(hits[:, None], turned, velocities)


def train(name: str, seed: int, shots: int, layouts: int, processes: int, python: str) -> dict[str, Any]:
    """Trains a policy and plays it on new layouts.

    Returns:
        `world`, `seed`, `curve` (see `ppo.train`) and `delay`, s. `success`: the number of direct pots in the policy's
        own world, in the exact world and, for a policy of an exact world, in all worlds with its laws. `predicted`: the
        numbers of pots by prediction 3. `aim`: the number of pots, the mean error of the aim and its prediction, mm,
        for each cut angle of `GROUPS`.
    """
    world = WORLDS[name]
    scene = scene_of(world.laws)
    args = ppo.arguments(f"--shots {shots} --seed {seed} --episodes {min(layouts, 2000)}".split())
    with opened(world, processes, python) as (play, delays):
        with contextlib.redirect_stdout(io.StringIO()):
            policy, curve = ppo.train(args, make_vec=lambda _, num_envs, threads: PlayedEnvs(num_envs, scene, play))
        envs = PlayedEnvs(layouts, scene, play)
        observations, _ = envs.reset(seed=evaluation_seeds(LAYOUT_SEED, layouts).tolist())
        positions, velocities = envs.positions, velocities_of(shots_of(policy, envs, observations), envs)
        pockets = play(positions, velocities)
    direct = pockets >= 0
    aimed = aims(velocities[direct], positions[direct], pockets[direct], scene, 1.0, 0.0)
    sine, cosine = np.sin(np.radians(aimed.cut)), np.cos(np.radians(aimed.cut))
    path = path_to_hit(positions[direct], 2.0 * scene.balls.radius[0] * sine)
    speed = np.maximum(np.linalg.norm(velocities[direct], axis=1) - DECAY * path, 0.0)
    aimed = aimed._replace(predicted=-speed * delays.mean() * sine * cosine, speed=speed)
    success, predicted = {name: int(direct.sum())}, {}
    random = np.random.default_rng(seed)
    for other, tested in WORLDS.items():
        if tested.laws == world.laws and other != name and "exact" in (world.simulator, tested.simulator):
            with opened(tested, processes, python) as (play, late):
                success[other] = int((play(positions, velocities) >= 0).sum())
            if world.simulator == "exact":
                with opened(world, 1, python) as (play, _):
                    shifted = delayed(positions, velocities, random.choice(late, layouts))
                    predicted[other] = int((play(positions, shifted) >= 0).sum())
    return {
        "world": name,
        "seed": seed,
        "curve": curve,
        "delay": float(delays.mean()),
        "success": success,
        "predicted": predicted,
        "aim": aims_by_group(aimed)["cut angle"],
    }


def measure(output: Path, shots: int, layouts: int, jobs: int, processes: int, python: str) -> dict[str, Any]:
    """Trains the policies without results, `jobs` at a time, and writes each result as soon as its run ends."""
    found = resumed(output, {"shots": shots, "layouts": layouts, "decay": DECAY, "time": TIME}, runs={})
    runs = {
        f"{name}, seed {seed}": (name, seed)
        for name, world in WORLDS.items()
        if world.laws != "pooltool" or comparison.POOLTOOL_PYTHON.exists()
        for seed in range(11, 11 + world.seeds)
    }
    missing = [key for key in runs if key not in found["runs"]]
    if missing:
        with opened(WORLDS["exact, rigid"], 1, python) as (play, _):  # compiles before all processes need the kernels
            envs = PlayedEnvs(1, scene_of("rigid"), play)
            envs.reset(seed=0)
            envs.step(np.ones((1, 2)))
        with workers(jobs, None) as pool:
            futures = {pool.submit(train, *runs[key], shots, layouts, processes, python): key for key in missing}
            for future in tqdm(as_completed(futures), total=len(futures), unit="run"):
                found["runs"][futures[future]] = future.result()
                write_json(output, found)
    return found


def by_world(result: Mapping[str, Any]) -> dict[str, list[dict[str, Any]]]:
    """Returns the runs of each world with results, in the order of `WORLDS`."""
    found = {name: [run for run in result["runs"].values() if run["world"] == name] for name in WORLDS}
    return {name: runs for name, runs in found.items() if runs}


def aim_errors(result: Mapping[str, Any]) -> dict[str, Floats]:
    """Returns the errors of the aim by world: arrays (cut angles, 3).

    The columns are the number of pots, the error of the aim minus the error of exact policies, mm, and its prediction,
    mm.
    """
    found = {}
    for name, runs in by_world(result).items():
        parts = np.array([run["aim"] for run in runs])
        counts = parts[..., 0].sum(0)
        found[name] = np.column_stack((counts, ((parts[..., :1] * parts[..., 1:]).sum(0).T / np.maximum(counts, 1)).T))
    exact = {laws: found[f"exact, {laws}"][:, 1] for laws in RESTITUTION if f"exact, {laws}" in found}
    for name, errors in found.items():
        errors[:, 1] -= exact.get(WORLDS[name].laws, 0.0)
    return {name: errors for name, errors in found.items() if WORLDS[name].simulator != "exact"}


def blocks(result: Mapping[str, Any]) -> dict[str, str]:
    """Returns the tables as Markdown, by name."""
    layouts, edges = result["settings"]["layouts"], GROUPS["cut angle"][1]
    worlds = by_world(result)

    def mean(name: str, tested: str, key: str = "success") -> str:
        counts = [run[key][tested] for run in worlds.get(name, []) if tested in run[key]]
        return f"{np.mean(counts) / layouts:.1%}" if counts else ""

    success, aim = [], []
    for name, world in WORLDS.items():
        exact = f"exact, {world.laws}"
        if world.simulator != "exact" and exact in worlds:
            played = mean(name, name), mean(name, exact), mean(exact, exact), mean(exact, name)
            success.append((name, str(len(worlds.get(name, []))), *played, mean(exact, name, "predicted")))
    for name, errors in aim_errors(result).items():
        square = np.average((errors[:, 1] - errors[:, 2]) ** 2, weights=errors[:, 0])
        cells = (f"{measured:+.1f} ({predicted:+.1f})" for _, measured, predicted in errors)
        aim.append((name, f"{1e3 * worlds[name][0]['delay']:.1f} ms", *cells, f"{math.sqrt(square):.2f} mm"))
    head = "simulator", "seeds", "own policy, there", "own policy, exact", "exact policy, exact"
    degrees = (f"{low} to {high} degrees" for low, high in pairwise(edges))
    return {
        "aim": table(("trained in", "delay", *degrees, "difference"), aim),
        "success": table((*head, "exact policy, there", "predicted"), success),
        "machine": machine_line(result["machine"]),
    }


def draw(result: Mapping[str, Any], path: Path) -> None:
    """Draws the measured errors of the aim against the predicted ones."""
    use_own_font()
    figure = Figure(figsize=(7.2, 4.2), dpi=120, layout="constrained")
    axes = figure.add_subplot()
    for name, errors in aim_errors(result).items():
        _, measured, predicted = errors[errors[:, 0] >= 100].T
        axes.plot(predicted, measured, "s" if name.startswith("MuJoCo") else "o", markersize=5, label=name)
    end = min(axes.get_xlim()[0], axes.get_ylim()[0])
    axes.plot([end, 0.0], [end, 0.0], color="#777777", linewidth=0.8, zorder=0)
    axes.set(xlabel="predicted error of the aim (mm)", ylabel="measured error of the aim (mm)")
    axes.set_title("The error of the aim makes up for the delay of the contacts", loc="left", fontsize=11)
    axes.grid(alpha=0.3)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(fontsize=9, frameon=False)
    save(figure, path)


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m studies.other_simulators --help`."""
    options = {
        "jobs": (1, "policies that train at the same time"),
        "workers": (2, "processes that play the shots of a policy"),
        "shots": (SHOTS, "shots in the training of a policy"),
        "layouts": (LAYOUTS, "new layouts that each policy plays"),
        "python": (str(PYTHON), "Python with the packages of studies/simulators.txt"),
        "output": (str(RESULTS / "other_simulators.json"), "JSON file"),
        "picture": (str(IMAGES / "other_simulators.png"), "picture"),
    }
    args = parser_of("other_simulators", "Train policies in pymunk and in MuJoCo.", **options).parse_args(arguments)
    output, picture = Path(args.output), Path(args.picture)

    def work() -> dict[str, Any]:
        result = measure(output, args.shots, args.layouts, args.jobs, args.workers, args.python)
        draw(result, picture)
        return result

    report(work, blocks, output, picture)


if __name__ == "__main__":
    main()
