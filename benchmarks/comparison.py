"""Run time and error of billiards-env, pooltool and pymunk for the same shots.

No law of motion is common to all three, so there are several comparisons. pooltool and billiards-env run shots with
friction and spin on two tables, with the same balls, tables and laws. On a carom table the balls have no friction with
each other and the cushions follow Han (2005). On pooltool's own table, with the jaws of pockets, the balls throw
each other and the cushions are compliant. The two simulators have different contacts with the rounded tips of cushions,
so a shot with such a contact has no error. pymunk and billiards-env run elastic disks without friction for 10 s. A shot
has one object ball, or is a break of 15 balls. The simulators take turns on one core. The errors are measured against
the 50-digit oracle.

pooltool needs other versions of numba and llvmlite and has a Python environment of its own, in which
`benchmarks/pooltool_worker.py` runs. `make bench` creates it:

    python3 -m venv .venv-pooltool
    .venv-pooltool/bin/pip install --no-deps -r benchmarks/pooltool.txt

A simulator that is not installed is left out.

    python -m benchmarks.comparison
    python -m benchmarks.comparison --shots 10 --passes 1
"""

from __future__ import annotations

import contextlib
import functools
import importlib.metadata
import importlib.util
import math
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from benchmarks import ROOT, error_limit, machine, machine_line, metres, ratio, run_command, table, worker
from billiards_env.scene import Scene
from billiards_env.shots.simulation import simulate
from reference.oracle import OracleError, run

Floats = NDArray[np.float64]
POOLTOOL_PYTHON = ROOT / ".venv-pooltool" / "bin" / "python"
WORKER = Path(__file__).with_name("pooltool_worker.py")

MAX_EVENTS = 2000
"""Events after which pooltool stops a shot. In some breaks the same pair of balls collides again and again."""

LAWS = {"friction and spin": "pooltool_carom", "throw and jaws": "pooltool_pool", "elastic disks": "ideal"}
"""The scene of each comparison."""

PYMUNK_STEPS = (60, 1920)
"""Timesteps of pymunk, as steps per second."""

PYMUNK_SLOP = 1e-4
"""m, the overlap that pymunk tolerates; the default of 0.1 is meant for pixels and is larger than a ball."""

_WALL = 1.0  # m, thickness of pymunk's walls, so that no disk passes through one

POOLTOOL_GAPS = (1e-6, 1e-9)
"""m. pooltool moves balls to this distance at each contact. The first value is pooltool's own."""


class Outcome(NamedTuple):
    """The outcome of a shot: positions (n, 2), m, the run time, and whether the simulator ran the whole shot.

    The positions are None if it stopped before the time of comparison.
    """

    positions: Floats | None
    seconds: float
    finished: bool = True


Runner: TypeAlias = Callable[[Scene, Floats, Floats, float | None], Outcome]
"""Runs a shot. The arguments are the scene, the positions, the velocity of the cue ball, and the time of the returned
positions, s, or None for the end of the shot."""


class Kind(NamedTuple):
    """A kind of shots; the positions are compared at `time`, s, or at the end of the shot for None."""

    n_object_balls: int
    draw: error_limit.Draw
    time: float | None


KINDS = {
    "1 object ball": Kind(1, error_limit.KINDS["1 object ball"][1], None),
    "15-ball break": Kind(15, error_limit.KINDS["15-ball break, loose"][1], 0.5),
}


def billiards_env(record: bool) -> Runner:
    """Returns the runner of the event-driven engine, which records the shot or returns only its end."""

    def run_shot(scene: Scene, positions: Floats, velocity: Floats, time: float | None) -> Outcome:
        begin = perf_counter()
        shot = simulate(scene, positions, velocity, max_time=time, record=record)
        return Outcome(shot.positions, perf_counter() - begin, shot.status != "event_limit")

    return run_shot


def pymunk(steps: int) -> Runner:
    """Returns the runner of pymunk with a number of timesteps per second: elasticity 1, friction 0, no damping."""

    def run_shot(scene: Scene, positions: Floats, velocity: Floats, time: float | None) -> Outcome:
        space, bodies = pymunk_space(scene, positions, velocity)
        end = scene.physics.max_time if time is None else time
        assert end is not None
        begin = perf_counter()
        for _ in range(round(end * steps)):
            space.step(1 / steps)
        seconds = perf_counter() - begin
        return Outcome(np.array([tuple(body.position) for body in bodies]), seconds)

    return run_shot


def pymunk_space(scene: Scene, positions: Floats, velocity: Floats) -> tuple[Any, list[Any]]:
    """Returns the space of pymunk in which the cue ball has a velocity, and the bodies of the balls."""
    import pymunk as library  # pyright: ignore[reportMissingImports]

    space = library.Space()
    space.collision_slop = PYMUNK_SLOP
    half_x, half_y = scene.table.length / 2 + _WALL, scene.table.width / 2 + _WALL
    corners = [(-half_x, -half_y), (half_x, -half_y), (half_x, half_y), (-half_x, half_y)]
    for k in range(4):
        wall = library.Segment(space.static_body, corners[k], corners[(k + 1) % 4], _WALL)
        wall.elasticity, wall.friction = 1.0, 0.0
        space.add(wall)
    bodies = []
    for place, radius, mass in zip(positions, scene.balls.radius, scene.balls.mass, strict=True):
        body = library.Body(mass, library.moment_for_circle(mass, 0.0, radius))
        body.position = tuple(place)
        shape = library.Circle(body, radius)
        shape.elasticity, shape.friction = 1.0, 0.0
        space.add(body, shape)
        bodies.append(body)
    bodies[0].velocity = tuple(velocity)
    return space, bodies


@contextlib.contextmanager
def pooltool(python: Path, program: Path = WORKER) -> Iterator[tuple[str, list[Runner]]]:
    """Yields the version of pooltool in another Python environment, and its runner for each of `POOLTOOL_GAPS`."""
    with worker(program.name, [python, program]) as ask:

        def run_shot(gap: float, scene: Scene, positions: Floats, velocity: Floats, time: float | None) -> Outcome:
            physics, half_x, half_y = scene.physics, scene.table.length / 2, scene.table.width / 2
            shot = {
                "jaws": bool(scene.table.outline),
                "table": {
                    "l": scene.table.length,
                    "w": scene.table.width,
                    "cushion_height": nose_height(scene) if scene.table.outline else scene.table.cushion_height,
                },
                "ball": {
                    "m": scene.balls.mass[0],
                    "R": scene.balls.radius[0],
                    "u_s": physics.mu_slide,
                    "u_r": physics.mu_roll,
                    "u_sp_proportionality": 2 * physics.spin_decay / (5 * physics.g),
                    "e_b": physics.e_ball,
                    "e_c": physics.e_cushion,
                    "f_c": physics.mu_cushion,
                    "g": physics.g,
                },
                "positions": [[half_y - y, half_x + x] for x, y in positions.tolist()],
                "velocity": [-velocity[1], velocity[0]],
                "time": time,
                "gap": gap,
                "max_events": MAX_EVENTS,
            }
            answer = ask(shot)
            if answer["positions"] is None:
                return Outcome(None, answer["seconds"], finished=False)
            theirs = np.array(answer["positions"])
            ours = np.column_stack((theirs[:, 1] - half_x, half_y - theirs[:, 0]))
            return Outcome(ours, answer["seconds"], answer["finished"])

        yield ask(), [functools.partial(run_shot, gap) for gap in POOLTOOL_GAPS]


def nose_height(scene: Scene) -> float:
    """Returns the height of pooltool's nose, m, at which its contacts with straight cushions have the same normal.

    In pooltool the nose is at the horizontal distance R from the centre of a ball, at the height h, so the tangent of
    the angle of the normal is h/R - 1. In billiards-env h/R - 1 is its sine.
    """
    radius = scene.balls.radius[0]
    sine = scene.table.cushion_height / radius - 1.0
    return radius * (1.0 + sine / math.sqrt(1.0 - sine * sine))


def draw_shots(laws: str, kind: str, count: int) -> list[tuple[Floats, Floats]]:
    """Returns the first `count` shots of a kind."""
    scene = scene_of_kind(laws, kind)
    seeds = ([k, list(LAWS).index(laws), list(KINDS).index(kind), 11] for k in range(count))
    return [KINDS[kind].draw(scene, np.random.default_rng(seed)) for seed in seeds]


def scene_of_kind(laws: str, kind: str) -> Scene:
    """Returns the scene of a kind of shots."""
    return Scene.named(LAWS[laws], KINDS[kind].n_object_balls)


def exact_positions(scene: Scene, positions: Floats, velocity: Floats, time: float | None) -> Floats | None:
    """Returns the oracle's positions.

    None if the contact-time rule acts, the laws do not determine the positions, or a ball touches the tip of a cushion.
    """
    shot = simulate(scene, positions, velocity, record=True)
    assert shot.events is not None
    events = shot.events[shot.events["time"] <= (np.inf if time is None else time)]
    at_tip = (events["kind"] == "cushion") & (events["other"] >= len(scene.table.outline or range(4)))
    if events["rule"].any() or at_tip.any():
        return None
    try:
        exact = run(scene, positions.tolist(), velocity.tolist(), max_time=time)
    except OracleError:
        return None
    return np.array(exact.positions, dtype=float)


def measure(shots: int, passes: int) -> dict[str, Any]:
    """Returns the results of all measurements: `shots` of each kind, and their run times in `passes`."""
    result: dict[str, Any] = {"machine": machine(), "shots": shots, "passes": passes, "versions": {}, "rows": []}
    # By the laws: name, method and runner of each simulator. billiards-env is the first one. It records the shots that
    # are compared with pooltool, because pooltool always records them.
    simulators: dict[str, list[tuple[str, str, Runner]]] = {
        laws: [("billiards-env", "event-driven", billiards_env(record=laws != "elastic disks"))] for laws in LAWS
    }
    with contextlib.ExitStack() as stack:
        if POOLTOOL_PYTHON.exists():
            version, runners = stack.enter_context(pooltool(POOLTOOL_PYTHON))
            result["versions"]["pooltool"] = version
            ways = ("event-driven", *(f"event-driven, gap {1e9 * gap:g} nm" for gap in POOLTOOL_GAPS[1:]))
            for laws in ("friction and spin", "throw and jaws"):
                simulators[laws] += [("pooltool", *way) for way in zip(ways, runners, strict=True)]
        else:
            print("pooltool is left out: there is no .venv-pooltool; `make bench` creates it")
        if importlib.util.find_spec("pymunk"):
            result["versions"]["pymunk"] = importlib.metadata.version("pymunk")
            simulators["elastic disks"] += [
                ("pymunk", f"timestep 1/{steps} s", pymunk(steps)) for steps in PYMUNK_STEPS
            ]
        for laws, group in tqdm(simulators.items(), unit="comparison"):
            runners = [runner for *_, runner in group]
            columns = {kind: compare(laws, kind, runners, shots, passes) for kind in KINDS}
            for k, (name, method, _) in enumerate(group):
                row = {"laws": laws, "simulator": name, "method": method}
                result["rows"].append({**row, **{kind: column[k] for kind, column in columns.items()}})
    return result


def compare(laws: str, kind: str, runners: Sequence[Runner], count: int, passes: int) -> list[dict[str, Any]]:
    """Returns run times and errors of each simulator for one kind of shots; the first one is billiards-env."""
    scene, time = scene_of_kind(laws, kind), KINDS[kind].time
    shots = draw_shots(laws, kind, count)
    exact = [exact_positions(scene, *shot, time) for shot in shots]
    errors: list[list[float]] = [[] for _ in runners]
    for k, runner in enumerate(runners):  # these calls also compile
        for shot, right in zip(shots, exact, strict=True):
            places = runner(scene, *shot, time).positions
            if right is not None and places is not None:
                errors[k].append(float(np.sqrt(((places - right) ** 2).sum(axis=1).mean())))
    seconds, unfinished = np.empty((len(runners), passes, count)), [0] * len(runners)
    for repeat in range(passes):
        for k, runner in enumerate(runners):
            outcomes = [runner(scene, *shot, None) for shot in shots]
            seconds[k, repeat] = [outcome.seconds for outcome in outcomes]
            unfinished[k] = sum(not outcome.finished for outcome in outcomes)
    per_shot = np.median(seconds, axis=1)
    return [
        {
            "us": 1e6 * float(np.median(times)),
            "ratio": float(np.median(times / per_shot[0])),
            "unfinished": not_done,
            "compared": len(off),
            "median_error_m": float(np.median(off)) if off else None,
        }
        for times, not_done, off in zip(per_shot, unfinished, errors, strict=True)
    ]


def _time(microseconds: float) -> str:
    ms = microseconds / 1e3
    return f"{microseconds:.0f} us" if ms < 1 else f"{ms:.1f} ms" if ms < 10 else f"{ms:,.0f} ms"


def blocks(result: dict[str, Any]) -> dict[str, str]:
    """Returns the results as Markdown, by name."""
    rows = []
    for row in result["rows"]:
        ours = row["simulator"] == "billiards-env"
        name = "**billiards-env**" if ours else row["simulator"]
        cells = []
        for kind in KINDS:
            factor = "" if ours else f" ({ratio(row[kind]['ratio'])}x)"
            cells += [_time(row[kind]["us"]) + factor, metres(row[kind]["median_error_m"])]
        rows.append((row["laws"], name, row["method"], *cells))
    head = ("laws", "simulator", "method", "1 object ball", "error", "break", "error after 0.5 s")
    versions = "".join(f"; {name} {version}" for name, version in result["versions"].items())
    return {
        "comparison": table(head, rows, left=3),
        "how": f"{result['shots']} shots of each kind; medians of {result['passes']} interleaved passes.",
        "machine": machine_line(result["machine"]) + versions,
    }


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m benchmarks.comparison --help`."""
    options = {"shots": (100, "shots of each kind"), "passes": (5, "repetitions of the run time measurement")}
    about = "Compare billiards-env with pooltool and pymunk."
    run_command("benchmarks.comparison", about, arguments, measure, blocks, options)


if __name__ == "__main__":
    main()
