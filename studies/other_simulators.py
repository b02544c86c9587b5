"""Trains policies in simulators of other projects: `python -m studies.other_simulators`.

PPO of Stable-Baselines3 trains `AimPolicy`, and the policies play the layouts of `studies.timestep`. pymunk (rigid
contacts) or MuJoCo (soft contacts) plays the shots, in separate processes (`benchmarks.simulators`). The game is a
direct pot: the object ball has to drop without touching a cushion, and the cue ball must not touch a cushion before the
hit. A ball slows down at the rate `DECAY`: by `space.damping` in pymunk, and by the damping of the joints in MuJoCo.

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
   It may use cushions.

The results are in `studies/results/other_simulators.json`. Each run is written there when it ends, and the command
skips runs that have results.

The published runs are older than this program: the PPO of `examples/ppo.py` trained them, with the same network. The
runs in pymunk are also older than a correction of the worker. Before it, an overlap at the end of a shot moved the
balls of the next shot on this table. Of 20,000 random shots with 1/120 s, 10 differ: 670 were pots then, 668 are now.
"""

from __future__ import annotations

import contextlib
import dataclasses
import math
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from stable_baselines3 import PPO

from agents.ppo import deterministic
from agents.train import one_fast_thread
from benchmarks import new_figure, run_command, save, simulators, table
from benchmarks.simulators_worker import DECAY, TIME
from billiards_env import Scene, simulate_batch
from billiards_env.bench.evaluation import evaluation_seeds
from billiards_env.envs import BilliardsVectorEnv, make_model
from billiards_env.sb3 import PPO_SETTINGS, AimPolicy, SameStepVecEnv
from billiards_env.scene import Physics
from billiards_env.support.files import write_json
from studies import RESULTS, completed, executor, resumed
from studies.timestep import LAYOUT_SEED, LAYOUTS, aims, aims_by_cut
from studies.timestep_report import cuts, finished, mean_errors, square_difference

Floats = NDArray[np.float64]
Play = Callable[[Floats, Floats], NDArray[np.intp]]
"""Plays m shots. The arguments are positions (m, 2, 2), m, and velocities (m, 2), m/s. The result (m,) is the pocket of
each direct pot, or -1."""


class SimulatorWorld(NamedTuple):
    """The simulator, the name of the exact world with the same laws, dt, s, and the number of policies trained there.

    The simulator is "pymunk", "mujoco", "pooltool" or "exact".
    """

    simulator: str
    exact: str
    dt: float
    seeds: int


WORLDS = {
    "MuJoCo 2 ms": SimulatorWorld("mujoco", "exact, soft", 0.002, 1),
    **{f"pymunk 1/{n} s": SimulatorWorld("pymunk", "exact, rigid", 1 / n, 3) for n in (480, 240, 120, 60)},
    "MuJoCo 10 ms": SimulatorWorld("mujoco", "exact, soft", 0.01, 2),
    "exact, rigid": SimulatorWorld("exact", "exact, rigid", 0.0, 3),
    "exact, soft": SimulatorWorld("exact", "exact, soft", 0.0, 3),
    "exact, pooltool": SimulatorWorld("exact", "exact, pooltool", 0.0, 1),
    "pooltool 0.6": SimulatorWorld("pooltool", "exact, pooltool", 0.0, 0),
}
"""The worlds by name. Worlds with slow shots come first."""


def rigid_scene(e_ball: float, e_cushion: float) -> Scene:
    """Returns the scene with the laws of pymunk and MuJoCo, on the table of "pool"."""
    end = (1.0 - math.exp(-DECAY * TIME)) / DECAY
    physics = Physics(motion="ideal", cushion="restitution", e_ball=e_ball, e_cushion=e_cushion, max_time=end)
    return dataclasses.replace(Scene.named("pool", 1), physics=physics)


SCENES = {
    "exact, rigid": rigid_scene(0.95, 0.85),
    "exact, soft": rigid_scene(math.exp(-2.0), math.exp(-2.0)),
    "exact, pooltool": Scene.named("pooltool_pool", 1),
}
"""The scenes of the exact worlds. A critically damped contact, the default of MuJoCo, has a restitution of exp(-2)."""


def play_exactly(scene: Scene, positions: Floats, velocities: Floats) -> NDArray[np.intp]:
    """Plays shots in an exact world, see `Play`. On the table with jaws the object ball may touch cushions."""
    shots = simulate_batch(scene, positions, velocities, threads=1)
    direct = (shots.cushions[:, 1] == 0) & (shots.cushions_before_hit[:, 1] == 0)
    potted = shots.potted[:, 1] & (direct | bool(scene.table.outline))
    return np.where(potted, gaps_of(scene, shots.positions[:, 1]).argmin(1), -1)


def play_in_pooltool(run: simulators.Runner, scene: Scene, positions: Floats, velocities: Floats) -> NDArray[np.intp]:
    """Plays shots in pooltool, see `Play`. A potted ball stays in its pocket; a shot that pooltool stops has no pot."""
    shots = (run(scene, *shot, None).positions for shot in zip(positions, velocities, strict=True))
    gaps = gaps_of(scene, np.array([(0.0, 0.0) if shot is None else shot[1] for shot in shots]))
    return np.where(gaps.min(1) < 0.0, gaps.argmin(1), -1)


def gaps_of(scene: Scene, places: Floats) -> Floats:
    """Returns the distances (m, pockets) of places (m, 2) from the circles of the pockets, m; negative inside."""
    return np.stack([pocket.distance(places) for pocket in scene.table.pockets], axis=1)


@contextlib.contextmanager
def opened(name: str) -> Iterator[tuple[Play, Floats]]:
    """Yields the function that plays shots in a world, and delays of its contacts, s."""
    world = WORLDS[name]
    scene = SCENES[world.exact]
    if world.simulator == "exact":
        yield lambda *shots: play_exactly(scene, *shots), np.zeros(1)
    elif world.simulator == "pooltool":
        with simulators.runner("pooltool", 1e-6) as (_, run):
            yield lambda *shots: play_in_pooltool(run, scene, *shots), np.zeros(1)
    else:
        with simulators.opened("pots", world.simulator, world.dt, scene.to_dict()) as (delays, ask):
            yield lambda *shots: np.array(ask([numbers.tolist() for numbers in shots])), np.array(delays)


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


def delayed(positions: Floats, velocities: Floats, delay: Floats) -> Floats:
    """Returns velocities (m, 2) whose exact hits have the line of centres of hits that are late by `delay` (m,), s."""
    touching = 2.0 * SCENES["exact, rigid"].balls.radius[0]
    (cue_ball, ball), shot = (positions @ (1, 1j)).T, velocities @ (1, 1j)  # x + iy
    gap = (ball - cue_ball) * abs(shot) / shot  # the real part is along the shot
    centres = np.sqrt(np.maximum(touching**2 - gap.imag**2, 0.0)) + 1j * gap.imag
    late = centres - delay * np.maximum(abs(shot) - DECAY * (gap - centres).real, 0.0)
    turned = gap - touching * late / abs(late)
    turned *= shot / abs(turned)
    hits = (abs(gap.imag) < touching) & (gap.real > 0.0)
    return np.where(hits[:, None], np.column_stack((turned.real, turned.imag)), velocities)


def delayed_aims(scene: Scene, positions: Floats, velocities: Floats, pockets: Any, delay: float) -> list[list[float]]:
    """Returns `aims_by_cut` of pots, with the error that compensates for a delay, s, as the prediction."""
    aimed = aims(velocities, positions, pockets, scene, 0.0)
    cut, touching = np.radians(aimed.cut), 2.0 * scene.balls.radius[0]
    path = np.sqrt(aimed.distance**2 - (touching * np.sin(cut)) ** 2) - touching * np.cos(cut)
    speed = np.maximum(np.linalg.norm(velocities, axis=1) - DECAY * path, 0.0)
    predicted = -speed * delay * np.sin(cut) * np.cos(cut)
    return aims_by_cut(aimed._replace(predicted=predicted))


def train(name: str, seed: int, shots: int, layouts: int) -> dict[str, Any]:
    """Trains a policy and plays it on new layouts.

    Returns:
        `world`, `seed`, `delay`, s; `success`, the number of direct pots in its own world, in the exact world and, if
        it is exact, in all worlds with its laws; `predicted`, those that prediction 3 gives; and `aim`, see
        `delayed_aims`.
    """
    exact = WORLDS[name].exact
    scene, random = SCENES[exact], np.random.default_rng(seed)
    with opened(name) as (play, delays), one_fast_thread():
        envs = SameStepVecEnv(PlayedEnvs(4096, scene, play))
        schedule = {"exploration": max(2 * shots // 5, 1)}
        model = PPO(AimPolicy, envs, **PPO_SETTINGS, policy_kwargs=schedule, seed=seed).learn(shots)
        envs = PlayedEnvs(layouts, scene, play)
        observations, _ = envs.reset(seed=evaluation_seeds(LAYOUT_SEED, layouts).tolist())
        positions = envs.positions
        velocities = velocities_of(deterministic(model.policy)(observations), envs)
        pockets = play(positions, velocities)
        potted = pockets >= 0
        success, predicted = {name: int(potted.sum())}, {}
        for other, world in WORLDS.items():
            if other != name and world.exact == exact and exact in (name, other):
                with opened(other) as (play_there, late):
                    success[other] = int((play_there(positions, velocities) >= 0).sum())
                if name == exact:
                    shifted = delayed(positions, velocities, random.choice(late, layouts))
                    predicted[other] = int((play(positions, shifted) >= 0).sum())
    return {
        "world": name,
        "seed": seed,
        "delay": float(delays.mean()),
        "success": success,
        "predicted": predicted,
        "aim": delayed_aims(scene, positions[potted], velocities[potted], pockets[potted], delays.mean()),
    }


def measure(output: Path, jobs: int, shots: int, layouts: int) -> dict[str, Any]:
    """Trains the runs without a result, `jobs` at a time, and writes each result as soon as the run ends."""
    settings = {"shots": shots, "layouts": layouts, "decay": DECAY, "time": TIME}
    content = resumed(output, settings, runs={})
    calls = {
        key: (train, name, seed, shots, layouts)
        for name, world in WORLDS.items()
        for seed in range(11, 11 + world.seeds)
        if (key := f"{name}, seed {seed}") not in content["runs"]
    }
    if calls and not simulators.installed():
        raise ValueError(f"{simulators.PYTHON} is missing: expected the environment that `make study` makes")
    with executor(jobs) as pool:
        for key, result in completed(pool, calls):
            content["runs"][key] = result
            write_json(output, content)
    return content


def by_world(result: Mapping[str, Any]) -> dict[str, list[dict[str, Any]]]:
    """Returns the runs of each world with results, in the order of `WORLDS`."""
    grouped = {name: [run for run in result["runs"].values() if run["world"] == name] for name in WORLDS}
    return {name: runs for name, runs in grouped.items() if runs}


def aim_errors(result: Mapping[str, Any]) -> dict[str, Floats]:
    """Returns the errors of the aim by world: arrays (cut angles, 3).

    The columns are the number of pots, the error of the aim minus the error of exact policies, mm, and its prediction,
    mm.
    """
    pooled = {name: mean_errors(runs) for name, runs in by_world(result).items()}
    base = {name: pooled.get(WORLDS[name].exact, np.zeros(3)) * (0, 1, 0) for name in pooled}
    return {name: errors - base[name] for name, errors in pooled.items() if name != WORLDS[name].exact}


def blocks(result: Mapping[str, Any]) -> dict[str, str]:
    """Returns the tables as Markdown, by name."""
    worlds = by_world(result)

    def mean(name: str, tested: str, key: str = "success") -> str:
        counts = [run[key][tested] for run in worlds.get(name, []) if tested in run[key]]
        return f"{np.mean(counts) / result['settings']['layouts']:.1%}" if counts else ""

    success, aim = [], []
    for name, (_, exact, *_) in WORLDS.items():
        if name != exact and exact in worlds:
            played = mean(name, name), mean(name, exact), mean(exact, exact), mean(exact, name)
            success.append((name, str(len(worlds.get(name, []))), *played, mean(exact, name, "predicted")))
    for name, errors in aim_errors(result).items():
        cells = (f"{measured:+.1f} ({predicted:+.1f})" for _, measured, predicted in errors)
        aim.append((name, f"{1e3 * worlds[name][0]['delay']:.1f} ms", *cells, f"{square_difference(errors):.2f} mm"))
    head = "simulator", "seeds", "own policy, there", "own policy, exact", "exact policy, exact"
    return {
        "aim": table(("trained in", "delay", *cuts(), "difference"), aim),
        "success": table((*head, "exact policy, there", "predicted"), success),
    }


def draw(result: Mapping[str, Any], folder: Path) -> None:
    """Draws the measured errors of the aim against the predicted ones."""
    figure = new_figure(7.2, 4.2, dpi=120)
    axes = figure.add_subplot()
    for name, errors in aim_errors(result).items():
        _, measured, predicted = errors[errors[:, 0] >= 100].T
        axes.plot(predicted, measured, "s" if name.startswith("MuJoCo") else "o", markersize=5, label=name)
    end = min(axes.get_xlim()[0], axes.get_ylim()[0])
    axes.plot([end, 0.0], [end, 0.0], color="#777777", linewidth=0.8, zorder=0)
    axes.set(xlabel="predicted error of the aim (mm)", ylabel="measured error of the aim (mm)")
    axes.set_title("The error of the aim makes up for the delay of the contacts", loc="left", fontsize=11)
    save(finished(figure), folder / "other_simulators.png")


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m studies.other_simulators --help`."""
    options = {
        "output": (RESULTS / "other_simulators.json", "JSON file"),
        "jobs": (2, "policies that train at a time"),
        "shots": (400_000, "shots of a training"),
        "layouts": (LAYOUTS, "new layouts that each policy plays"),
    }
    about = "Train policies in pymunk and in MuJoCo."
    run_command("studies.other_simulators", about, arguments, measure, blocks, options, draw)


if __name__ == "__main__":
    main()
