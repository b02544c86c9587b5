"""Run time and error of billiards-env, pooltool and pymunk for the same shots.

No law of motion is common to all three, so there are several comparisons. pooltool and billiards-env run shots with
friction and spin on two tables, with the same balls, tables and laws. On a carom table the balls have no friction with
each other and the cushions follow Han (2005). On pooltool's own table, with the jaws of pockets, the balls throw
each other and the cushions are compliant. The two simulators have different contacts with the rounded tips of cushions,
so a shot with such a contact has no error. pymunk and billiards-env run elastic disks without friction for 10 s. A shot
has one object ball, or is a break of 15 balls. The simulators take turns on one core. The errors are measured against
the 50-digit oracle.

pooltool and pymunk run in the environment of `benchmarks.simulators`, which `make bench` creates. Without it they are
left out.

    python -m benchmarks.comparison
    python -m benchmarks.comparison --shots 10 --passes 1
"""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Callable, Iterator, Sequence
from time import perf_counter
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from benchmarks import error_limit, machine, machine_line, metres, ratio, run_command, simulators, table
from benchmarks.reference.oracle import OracleError, run
from billiards_env.scene import Scene
from billiards_env.shots.simulation import simulate

Floats = NDArray[np.float64]

MAX_EVENTS = 2000
"""Events after which pooltool stops a shot. In some breaks the same pair of balls collides again and again."""

LAWS = {"friction and spin": "pooltool_carom", "throw and jaws": "pooltool_pool", "elastic disks": "ideal"}
"""The scene of each comparison."""

PYMUNK_STEPS = (60, 1920)
"""Timesteps of pymunk, as steps per second."""

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


@contextlib.contextmanager
def pymunk() -> Iterator[tuple[str, list[Runner]]]:
    """Yields the version of pymunk, and its runner for each of `PYMUNK_STEPS`."""

    def run_shot(ask: Any, scene: Scene, positions: Floats, velocity: Floats, time: float | None) -> Outcome:
        end = scene.physics.max_time if time is None else time
        shot = {"scene": scene.to_dict(), "positions": positions.tolist(), "velocity": velocity.tolist(), "time": end}
        return outcome(ask(shot))

    with contextlib.ExitStack() as stack:
        workers = [stack.enter_context(simulators.opened("pymunk", steps)) for steps in PYMUNK_STEPS]
        yield workers[0][0], [functools.partial(run_shot, ask) for _, ask in workers]


def outcome(answer: dict[str, Any]) -> Outcome:
    """Returns the outcome in an answer of the worker."""
    places = answer["positions"]
    return Outcome(None if places is None else np.array(places), answer["seconds"], answer["finished"])


@contextlib.contextmanager
def pooltool() -> Iterator[tuple[str, list[Runner]]]:
    """Yields the version of pooltool, and its runner for each of `POOLTOOL_GAPS`."""
    with simulators.opened("pooltool") as (version, ask):

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
            theirs = outcome(ask(shot))
            if theirs.positions is None:
                return theirs
            x, y = theirs.positions.T
            return theirs._replace(positions=np.column_stack((y - half_x, half_y - x)))

        yield version, [functools.partial(run_shot, gap) for gap in POOLTOOL_GAPS]


class Simulator(NamedTuple):
    """Another simulator.

    Attributes:
        laws: The comparisons that it takes part in, of `LAWS`.
        methods: The names of its methods.
        opened: Returns a context with its version and a runner for each method.
    """

    laws: tuple[str, ...]
    methods: tuple[str, ...]
    opened: Callable[[], contextlib.AbstractContextManager[tuple[str, list[Runner]]]]


SIMULATORS = {
    "pooltool": Simulator(
        ("friction and spin", "throw and jaws"),
        ("event-driven", *(f"event-driven, gap {1e9 * gap:g} nm" for gap in POOLTOOL_GAPS[1:])),
        pooltool,
    ),
    "pymunk": Simulator(("elastic disks",), tuple(f"timestep 1/{steps} s" for steps in PYMUNK_STEPS), pymunk),
}
"""The other simulators, by name. Each has a function in `benchmarks.simulators_worker`."""


def nose_height(scene: Scene) -> float:
    """Returns the height of pooltool's nose, m, at which its contacts with straight cushions have the same normal.

    In pooltool the nose is at the horizontal distance R from the centre of a ball, at the height h, so the tangent of
    the angle of the normal is h/R - 1. In billiards-env h/R - 1 is its sine.
    """
    radius = scene.balls.radius[0]
    sine = scene.table.cushion_height / radius - 1.0
    return radius * (1.0 + sine / (1.0 - sine * sine) ** 0.5)


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
    compared: dict[str, list[tuple[str, str, Runner]]] = {
        laws: [("billiards-env", "event-driven", billiards_env(record=laws != "elastic disks"))] for laws in LAWS
    }
    with contextlib.ExitStack() as stack:
        if simulators.installed():
            for name, simulator in SIMULATORS.items():
                result["versions"][name], runners = stack.enter_context(simulator.opened())
                for laws in simulator.laws:
                    compared[laws] += [(name, *way) for way in zip(simulator.methods, runners, strict=True)]
        else:
            left_out = " and ".join(SIMULATORS)
            print(f"{left_out} are left out: there is no .venv-simulators; `make bench` creates it")
        for laws, group in tqdm(compared.items(), unit="comparison"):
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
