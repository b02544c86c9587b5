"""Run time and error of PIC and of PIT at many timesteps.

PIC and PIT run the same random shots; PIT uses timesteps of 1/15 to 1/15360 s and each of its fixes. Errors are
measured against the 50-digit oracle. Run times are measured on one core; all methods take turns.

    python -m benchmarks.accuracy               # within ten minutes on two cores
    python -m benchmarks.accuracy --shots 8 --passes 1
"""

from __future__ import annotations

import argparse
import itertools
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from benchmarks import IMAGES, RESULTS, check_counts, error_limit, machine, machine_line, print_blocks, save, table
from benchmarks.methods import PIC, Method, timer
from billiards_env.files import write_json
from billiards_env.physics.state import FIXES
from billiards_env.scene import Scene
from billiards_env.shots.simulation import simulate
from reference.oracle import OracleError, run

Floats = NDArray[np.float64]

STEPS = [15 * 2**k for k in range(11)]
"""Timesteps of PIT, as steps per second."""
TIMES = (0.5, 1.0, 2.0, 5.0)
"""Times at which positions are compared, s, in addition to the end of the shot."""
TIMED = 24  # shots whose run time is measured
LEVELS = {"10 cm": 0.1, "1 cm": 1e-2, "1 mm": 1e-3, "0.1 mm": 1e-4}
PIC_STYLE: dict[str, Any] = {"marker": "*", "color": "black", "markersize": 13, "linestyle": "none"}
PIT_STYLES: dict[str, dict[str, Any]] = {
    "push_apart": {"marker": "o", "color": "#0072b2", "markersize": 6, "linewidth": 1.2},
    "move_back": {"marker": "s", "color": "#d55e00", "markersize": 4, "linewidth": 1.2},
    "none": {"marker": "^", "color": "#009e73", "markersize": 4, "linewidth": 1.2, "linestyle": "--"},
}
"""Plot styles of the fixes."""
FLOOR = 1e-17  # m, zero errors are drawn at this value


class Problem(NamedTuple):
    """Random shots in a scene.

    Attributes:
        scene: The scene.
        draw: Draws positions, m, and velocities, m/s.
        column: Index in `TIMES` of the time of the main error, or -1 for the end.
    """

    scene: Scene
    draw: Callable[[Scene, np.random.Generator], tuple[Floats, Floats]]
    column: int


_shot, _break, _gas = (
    error_limit.KINDS[kind][1] for kind in ("1 object ball", "15-ball break, loose", "gas of 16 disks")
)
PROBLEMS = {
    "1 object ball": Problem(Scene.named("pool", 1), _shot, -1),
    "3 object balls": Problem(Scene.named("pool", 3), _shot, -1),
    "5 object balls": Problem(Scene.named("pool", 5), _shot, -1),
    "carom": Problem(Scene.named("carom", 2), _shot, -1),
    "15-ball break": Problem(Scene.named("pool", 15), _break, 0),
    "2 elastic disks": Problem(Scene.named("ideal", 1), _shot, 2),
    "gas of 16 disks": Problem(Scene.named("ideal", 15), _gas, 1),
}


PIT = [Method("PIT", steps, fix) for fix in FIXES for steps in STEPS]


def shot_of(name: str, seed: int) -> tuple[Floats, Floats]:
    """Returns the positions (n, 2), m, and velocities (n, 2), m/s, of a shot of a problem."""
    scene, draw, _ = PROBLEMS[name]
    positions, velocities = draw(scene, np.random.default_rng([seed, list(PROBLEMS).index(name), 7]))
    moving = np.zeros_like(positions)
    moving[0 if velocities.ndim == 1 else slice(None)] = velocities
    return positions, moving


def shots_of(name: str, count: int) -> tuple[Floats, Floats]:
    """Returns the first `count` shots of a problem, (m, n, 2) each."""
    positions, velocities = zip(*(shot_of(name, seed) for seed in range(count)), strict=True)
    return np.array(positions), np.array(velocities)


def follow(task: tuple[str, int]) -> dict[str, Any]:
    """Runs one shot by the oracle and by every method.

    The shot is followed to its end, or until balls at rest press against each other, because the laws of impact do not
    determine the motion after that, or until PIC's contact-time rule acts.

    Returns:
        `errors`: for each method the root mean square error over the balls, m, at `TIMES` and at the end; NaN at times
        to which the shot is not followed. `complete`: whether the shot is followed to its end. `outcome_as_oracle`:
        whether PIC has the outcome of the oracle.
    """
    name, seed = task
    scene = PROBLEMS[name].scene
    positions, velocities = shot_of(name, seed)
    pic = simulate(scene, positions, velocities, record=True)
    assert pic.events is not None
    ruled = pic.events["time"][pic.events["rule"]]
    known_until = float(ruled[0]) if len(ruled) else np.inf
    try:
        exact = run(scene, positions.tolist(), velocities.tolist())
    except OracleError as stopped:
        exact = stopped.shot
        known_until = min(known_until, float(exact.time))
    complete = known_until == np.inf
    places = [np.array(exact.positions_at(min(t, exact.time)), dtype=float) for t in (*TIMES, np.inf)]

    def errors(found: Sequence[Floats]) -> list[float]:
        apart = [np.sqrt(((a - b) ** 2).sum(axis=1).mean()) for a, b in zip(found, places, strict=True)]
        return [
            float(e) if complete or t < known_until else np.nan for e, t in zip(apart, (*TIMES, np.inf), strict=True)
        ]

    hits = [e.other for e in exact.events if e.kind == "ball_ball" and e.ball == 0 and float(e.time) < known_until]
    found = (simulate(scene, positions, velocities, record=True, **method.engine) for method in (PIC, *PIT))
    return {
        "complete": complete,
        "outcome_as_oracle": pic.potted.tolist() == list(exact.potted)
        and pic.first_hit == (hits[0] if hits else -1)
        and set(np.flatnonzero(pic.cushions_before_hit >= 0)) == set(hits),
        "errors": [errors([*(shot.at(t) for t in TIMES), shot.positions]) for shot in found],
    }


def follow_all(shots: int, workers: int) -> dict[str, list[dict[str, Any]]]:
    """Runs `follow` for the first `shots` shots of every problem."""
    tasks = [(name, seed) for name in PROBLEMS for seed in range(shots)]
    found: dict[str, list[dict[str, Any]]] = {name: [] for name in PROBLEMS}
    with ProcessPoolExecutor(workers) as pool:
        for task, result in zip(tasks, tqdm(pool.map(follow, tasks), "errors", len(tasks), unit="shot"), strict=True):
            found[task[0]].append(result)
    return found


def seconds_per_shot(shots: int, passes: int) -> dict[str, dict[Method, list[float]]]:
    """Returns the mean time of a shot by problem and method, one entry per pass; methods take turns on one core."""
    calls: dict[str, dict[Method, Callable[[], float]]] = {}
    for name, problem in PROBLEMS.items():
        positions, velocities = shots_of(name, min(shots, TIMED))
        calls[name] = {method: timer(problem.scene, positions, velocities, method) for method in (PIC, *PIT)}
    found: dict[str, dict[Method, list[float]]] = {
        name: {method: [] for method in some} for name, some in calls.items()
    }
    with tqdm(desc="times", total=passes * sum(map(len, calls.values())), unit="run") as bar:
        for _ in range(passes):
            for name, some in calls.items():
                for method, call in some.items():
                    found[name][method].append(call())
                    bar.update()
    return found


def rows_of(
    followed: Sequence[dict[str, Any]],
    seconds: dict[Method, list[float]],
) -> list[dict[str, Any]]:
    """Returns the results of a problem, one row per method."""
    rows = []
    errors = np.array([result["errors"] for result in followed])  # (shots, methods, times)
    for k, method in enumerate((PIC, *PIT)):
        ratios = np.array(seconds[method]) / np.array(seconds[PIC])
        row: dict[str, Any] = {
            "method": method.name,
            "fix": method.fix,
            "steps_per_second": method.steps,
            "us_per_shot": 1e6 * float(np.median(seconds[method])),
            "time_over_pic": float(np.median(ratios)),
        }
        for column, t in enumerate([*TIMES, "end"]):
            known = errors[:, k, column][~np.isnan(errors[:, k, column])]
            row[f"median_error_{t}_m"] = float(np.median(known)) if len(known) else None
            row[f"p90_error_{t}_m"] = float(np.quantile(known, 0.9)) if len(known) else None
        rows.append({key: float(f"{x:.4g}") if isinstance(x, float) else x for key, x in row.items()})
    return rows


def measure(shots: int, passes: int, workers: int) -> dict[str, Any]:
    """Runs all measurements.

    Args:
        shots: Shots of each problem that are compared with the oracle.
        passes: Repetitions of the run time measurement.
        workers: Processes and threads, except for run times.

    Returns:
        The content of `accuracy.json`.
    """
    on = machine()
    seconds = seconds_per_shot(shots, passes)
    followed = follow_all(shots, workers)
    scenes = {}
    for name, problem in PROBLEMS.items():
        results = followed[name]
        ends = [result["outcome_as_oracle"] for result in results if result["complete"]]
        scenes[name] = {
            "n_balls": problem.scene.n_balls,
            "error_at": [*TIMES, "end"][problem.column],
            "compared": sum(not np.isnan(result["errors"][0][problem.column]) for result in results),
            "followed_to_the_end": len(ends),
            "pic_outcome_as_oracle": sum(ends),
            "methods": rows_of(results, seconds[name]),
        }
    return {
        "machine": on,
        "shots": shots,
        "passes": passes,
        "scenes": scenes,
    }


def packed(result: dict[str, Any]) -> dict[str, Any]:
    """Returns the result with the rows of each scene as a table: `columns` and `rows`, None where there is no value."""
    scenes = {}
    for name, scene in result["scenes"].items():
        columns = list(dict.fromkeys(itertools.chain.from_iterable(scene["methods"])))
        rows = [[row.get(column) for column in columns] for row in scene["methods"]]
        scenes[name] = {**scene, "methods": {"columns": columns, "rows": rows}}
    return {**result, "scenes": scenes}


def unpacked(result: dict[str, Any]) -> dict[str, Any]:
    """Returns what `accuracy.json` holds, with the rows of each scene as mappings."""
    scenes = {}
    for name, scene in result["scenes"].items():
        columns, rows = scene["methods"]["columns"], scene["methods"]["rows"]
        scenes[name] = {**scene, "methods": [dict(zip(columns, row, strict=True)) for row in rows]}
    return {**result, "scenes": scenes}


def _pit(scene: dict[str, Any], fix: str) -> list[dict[str, Any]]:
    """Returns the rows of PIT with a fix, from the coarsest timestep to the finest."""
    return sorted((row for row in scene["methods"] if row["fix"] == fix), key=lambda row: row["steps_per_second"])


def _pic(scene: dict[str, Any]) -> dict[str, Any]:
    return next(row for row in scene["methods"] if row["method"] == "PIC")


def _error(scene: dict[str, Any], row: dict[str, Any]) -> float:
    return row[f"median_error_{scene['error_at']}_m"]


def _when(scene: dict[str, Any]) -> str:
    return "at the end" if scene["error_at"] == "end" else f"after {scene['error_at']:g} s"


def _metres(error: float | None) -> str:
    return "" if error is None else f"{error:.1e} m"


def _ratio(value: float) -> str:
    return f"{value:.2f}" if value < 1 else f"{value:.1f}" if value < 10 else f"{value:,.0f}"


def coarsest_from(rows: list[dict[str, Any]], good: list[bool]) -> dict[str, Any] | None:
    """Returns the coarsest row that is good together with all finer rows; None if there is none."""
    last_bad = max((k for k, fine in enumerate(good) if not fine), default=-1)
    return rows[last_bad + 1] if last_bad + 1 < len(rows) else None


def levels(scenes: dict[str, Any]) -> str:
    """Returns the table of the run time, over that of PIC, of the fastest PIT with a median error below each level."""
    lines = []
    for name, scene in scenes.items():
        line, pic = [f"{name}, {_when(scene)}"], _pic(scene)
        for level in LEVELS.values():
            reach = []
            for fix in PIT_STYLES:
                rows = _pit(scene, fix)
                row = coarsest_from(rows, [_error(scene, r) <= level for r in rows])
                reach += [] if row is None else [row]
            best = min(reach, key=lambda row: row["time_over_pic"], default=None)
            line.append("-" if best is None else f"{_ratio(best['time_over_pic'])} (1/{best['steps_per_second']} s)")
        least = min(_error(scene, row) for row in scene["methods"] if row["method"] == "PIT")
        lines.append([*line, _metres(least), _metres(_error(scene, pic))])
    return table(["median error of PIT below", *LEVELS, "PIT's least error", "PIC's error"], lines)


def shots_table(result: dict[str, Any]) -> str:
    """Returns the table of the numbers of shots."""
    rows = [
        [
            name,
            f"{result['shots']}",
            f"{scene['compared']} {_when(scene)}",
            f"{scene['followed_to_the_end']}",
            # The motion of many elastic disks is chaotic.
            "" if PROBLEMS[name].scene.physics.motion == "ideal" else f"{scene['pic_outcome_as_oracle']}",
        ]
        for name, scene in result["scenes"].items()
    ]
    return table(["scene", "shots with reference", "compared", "to the end", "same outcome"], rows)


def blocks(result: dict[str, Any]) -> dict[str, str]:
    """Returns the results as Markdown, by name."""
    scenes = unpacked(result)["scenes"]
    return {
        "machine": machine_line(result["machine"]),
        "shots": shots_table(result),
        "levels": levels(scenes),
    }


def draw_pareto(result: dict[str, Any], path: Path) -> None:
    """Draws run time against error, one panel per scene."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.5, 6), dpi=95, layout="constrained")
    *panels, key = figure.subplots(2, 4, sharey=True).flat
    for (name, scene), axes in zip(result["scenes"].items(), panels, strict=True):
        curves = [(_pit(scene, fix), style) for fix, style in PIT_STYLES.items()]
        for rows, style in (*curves, ([_pic(scene)], PIC_STYLE)):
            axes.loglog([r["us_per_shot"] for r in rows], [max(FLOOR, _error(scene, r)) for r in rows], **style)
        pit = _pit(scene, "push_apart")
        for row, side in ((pit[0], "left"), (pit[len(pit) // 2], "center"), (pit[-1], "right")):
            at, label = (row["us_per_shot"], 4), f"1/{row['steps_per_second']} s"
            axes.annotate(label, at, fontsize=7.5, ha=side, va="bottom", color="#444444")
            axes.plot([at[0]] * 2, [_error(scene, row), at[1]], ":", color="#888888", linewidth=0.8)
        axes.set_title(f"{name}, {_when(scene)}", fontsize=10)
        axes.set_ylim(FLOOR / 3, 60)
        axes.grid(alpha=0.3)
    for axes in (panels[0], panels[4]):
        axes.set_ylabel("median error of the positions (m)")
    for axes in panels[3:]:
        axes.set_xlabel("run time (us per shot)")
    key.axis("off")
    for label, style in (("PIC", PIC_STYLE), *((f"PIT, {fix}", style) for fix, style in PIT_STYLES.items())):
        key.plot([], [], **style, label=label)
    key.legend(loc="center", frameon=False, title="left: faster, down: more exact")
    save(figure, path)


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m benchmarks.accuracy --help`."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.accuracy", description="Run time against error, for every engine and timestep."
    )
    parser.add_argument("--shots", type=int, default=64, help="shots of each scene against the oracle (64)")
    parser.add_argument("--passes", type=int, default=3, help="repetitions of the run time measurement (3)")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1, help="processes (one per core)")
    parser.add_argument("--results", type=Path, default=RESULTS, help="folder of accuracy.json")
    parser.add_argument("--images", type=Path, default=IMAGES, help="folder of pareto.png")
    args = parser.parse_args(arguments)
    # The fourth break is the first one that can be followed to its end.
    check_counts(parser, args, shots=4, passes=1, workers=1)
    result = packed(measure(args.shots, args.passes, args.workers))
    write_json(args.results / "accuracy.json", result)
    draw_pareto(unpacked(result), args.images / "pareto.png")
    print_blocks(blocks(result))
    print(f"Written to {args.results / 'accuracy.json'}; drawn in {args.images}.")


if __name__ == "__main__":
    main()
