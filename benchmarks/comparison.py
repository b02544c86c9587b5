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
import json
from collections.abc import Sequence
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from tqdm import tqdm

from benchmarks import error_limit, machine, machine_line, metres, ratio, results_file, run_command, simulators, table
from benchmarks.reference.oracle import OracleError, reference_shot
from benchmarks.simulators import Floats, Outcome, Runner
from benchmarks.speed import rounded
from billiards_env.commands import Job
from billiards_env.scene import Scene
from billiards_env.shots.simulation import simulate

LAWS = {"friction and spin": "pooltool_carom", "throw and jaws": "pooltool_pool", "elastic disks": "ideal"}
"""The scene of each comparison."""


class Other(NamedTuple):
    """Another simulator: its entry in `SIMULATORS` of the worker with its arguments, its method and its comparisons."""

    name: str
    argument: float
    method: str
    laws: tuple[str, ...]


OTHERS = (
    Other("pooltool", 1e-6, "event-driven", ("friction and spin", "throw and jaws")),
    Other("pooltool", 1e-9, "event-driven, gap 1 nm", ("friction and spin", "throw and jaws")),
    Other("pymunk", 60, "timestep 1/60 s", ("elastic disks",)),
    Other("pymunk", 1920, "timestep 1/1920 s", ("elastic disks",)),
)
"""The other simulators, with the gap of pooltool, m (the first one is its default), and the timesteps per second of
pymunk."""


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
        exact = reference_shot(scene, positions.tolist(), velocity.tolist(), max_time=time)
    except OracleError:
        return None
    return np.array(exact.positions, dtype=float)


def measure(shots: int, passes: int, job: Job) -> dict[str, Any]:
    """Returns the results of all measurements: `shots` of each kind, and their run times in `passes`."""
    result: dict[str, Any] = {"machine": machine(), "shots": shots, "passes": passes, "versions": {}, "rows": []}
    # By the laws: name, method and runner of each simulator. billiards-env is the first one. It records the shots that
    # are compared with pooltool, because pooltool always records them.
    compared: dict[str, list[tuple[str, str, Runner]]] = {
        laws: [("billiards-env", "event-driven", billiards_env(record=laws != "elastic disks"))] for laws in LAWS
    }
    if not simulators.installed():
        print("pooltool and pymunk are left out: there is no .venv-simulators; `make bench` creates it")
    with contextlib.ExitStack() as stack:
        for other in OTHERS if simulators.installed() else ():
            with job(f"{other.name}, {other.method}"):
                version, runner = stack.enter_context(simulators.runner(other.name, other.argument))
                result["versions"][other.name] = version
                for laws in other.laws:
                    compared[laws].append((other.name, other.method, runner))
        for laws, group in tqdm(compared.items(), unit="comparison"):
            with job(laws):
                runners = [runner for *_, runner in group]
                columns = {kind: compare(laws, kind, runners, shots, passes) for kind in KINDS}
                for k, (name, method, _) in enumerate(group):
                    row = {"laws": laws, "simulator": name, "method": method}
                    result["rows"].append({**row, **{kind: column[k] for kind, column in columns.items()}})
    return result if result["rows"] else {}


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


LACKS = {
    "billiards-env": "3D graphics",
    "pooltool": "batches, derivatives, environments",
    "pymunk": "spin and cloth; it misses contacts",
}
"""What a user of billiards may miss in each simulator."""


def _why(result: dict[str, Any]) -> dict[str, str]:
    """Returns the table of the front page and the text below it; nothing without results of the other simulators.

    `benchmarks.speed` measures the shots of a batch.
    """
    kind = "1 object ball"
    measured = {(row["laws"], row["simulator"], row["method"]): row[kind] for row in result["rows"]}
    columns = {
        "billiards-env": ("friction and spin", "billiards-env", ["event-driven"]),
        "pooltool": ("friction and spin", "pooltool", ["event-driven"]),
        "pymunk": ("elastic disks", "pymunk", ["timestep 1/60 s", "timestep 1/1920 s"]),
    }
    try:
        cells = {
            name: [measured[laws, simulator, method] for method in methods]
            for name, (laws, simulator, methods) in columns.items()
        }
        ours = measured["elastic disks", "billiards-env", "event-driven"]
        heads = ["billiards-env", *(f"{name} {result['versions'][name]}" for name in ("pooltool", "pymunk"))]
    except KeyError:  # a comparison was left out, or it failed
        return {}
    heads[-1] += ", 1/60 s or 1/1920 s"
    rates = [" or ".join(rounded(1e6 / one["us"]) for one in column) for column in cells.values()]
    speed = results_file("benchmarks.speed")
    if speed.exists():
        batch = json.loads(speed.read_text(encoding="utf-8"))["batch"][0]
        rates[0] += f"; {rounded(batch['shots_per_second']['median'])} in a batch"
    rows = [
        ("shots per second", *rates),
        ("error", *(" or ".join(_error(one) for one in column) for column in cells.values())),
        ("lacks", *(LACKS[name] for name in cells)),
    ]
    text = (
        "One core, one object ball; one call for each shot, or for all shots of a batch. The error is the distance of "
        "the final positions from those of a 50-digit reference (median of the shots). billiards-env and pooltool play "
        "shots with friction and spin, both without a timestep. pymunk, a general engine with a timestep, plays other "
        f"shots: elastic disks, for 10 s. billiards-env plays {rounded(1e6 / ours['us'])} of these a second, with an "
        f"error of {_error(ours)}."
    )
    return {"why": f"{table(('', *heads), rows)}\n\n{text}"}


def _error(cell: dict[str, Any]) -> str:
    """Returns the median error."""
    error = cell["median_error_m"]
    return f"{error:.2f} m" if error > 0.01 else metres(error)


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
        **_why(result),
        "how": f"{result['shots']} shots of each kind; medians of {result['passes']} interleaved passes.",
        "machine": machine_line(result["machine"]) + versions,
    }


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m benchmarks.comparison --help`."""
    options = {"shots": (100, "shots of each kind"), "passes": (5, "repetitions of the run time measurement")}
    about = "Compare billiards-env with pooltool and pymunk."
    run_command("benchmarks.comparison", about, arguments, measure, blocks, options, jobs=True)


if __name__ == "__main__":
    main()
