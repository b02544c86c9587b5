"""Run time and error of PIC and of PIT at many timesteps.

PIC and PIT run the same random shots; PIT uses timesteps of 1/15 to 1/15360 s and each of its fixes. Errors are
measured against the 50-digit oracle. Outcomes (the balls potted, the ball hit first) of more shots are compared with
the results of PIC, which are compared with the oracle first. Run times are measured on one core; all methods take
turns.

    python -m benchmarks.accuracy               # within ten minutes on two cores
    python -m benchmarks.accuracy --shots 8 --outcomes 200 --passes 1
    python -m benchmarks.accuracy --again       # prints and draws the last results
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from benchmarks import (
    IMAGES,
    RESULTS,
    Count,
    accuracy_report,
    error_limit,
    machine,
    parser_of,
    report,
    run_kinds,
    workers,
)
from benchmarks.accuracy_report import blocks
from benchmarks.methods import PIC, Method, timer
from billiards_env.scene import Scene
from billiards_env.shots.simulation import simulate, simulate_batch
from reference.oracle import OracleError, run

Floats = NDArray[np.float64]

STEPS = [15 * 2**k for k in range(11)]
"""Timesteps of PIT, as steps per second."""
TIMES = (0.5, 1.0, 2.0, 5.0)
"""Times at which positions are compared, s, in addition to the end of the shot."""
TIMED = 24  # shots whose run time is measured
BREAKS = 8  # number of other shots per break in the comparison of outcomes, because breaks take long


class ShotKind(NamedTuple):
    """Random shots in a scene; `column` is the index in `TIMES` of the time of the main error, or -1 for the end."""

    scene: Scene
    draw: error_limit.Draw
    column: int


_shot, _break, _gas = (
    error_limit.KINDS[kind][1] for kind in ("1 object ball", "15-ball break, loose", "gas of 16 disks")
)
PROBLEMS = {
    "1 object ball": ShotKind(Scene.named("pool", 1), _shot, -1),
    "3 object balls": ShotKind(Scene.named("pool", 3), _shot, -1),
    "5 object balls": ShotKind(Scene.named("pool", 5), _shot, -1),
    "carom": ShotKind(Scene.named("carom", 2), _shot, -1),
    "15-ball break": ShotKind(Scene.named("pool", 15), _break, 0),
    "2 elastic disks": ShotKind(Scene.named("ideal", 1), _shot, 2),
    "gas of 16 disks": ShotKind(Scene.named("ideal", 15), _gas, 1),
}


PIT = [Method("PIT", steps, fix) for fix in accuracy_report.PIT_STYLES for steps in STEPS]


def shot_of(name: str, seed: int) -> tuple[Floats, Floats]:
    """Returns the positions and velocities of a shot of a problem, see `error_limit.Draw`."""
    scene, draw, _ = PROBLEMS[name]
    return draw(scene, np.random.default_rng([seed, list(PROBLEMS).index(name), 7]))


def shots_of(name: str, count: int) -> tuple[Floats, Floats]:
    """Returns the positions and velocities of the first `count` shots of a problem."""
    positions, velocities = zip(*(shot_of(name, seed) for seed in range(count)), strict=True)
    return np.array(positions), np.array(velocities)


def follow(name: str, seed: int) -> dict[str, Any]:
    """Runs one shot by the oracle and by every method.

    The shot is followed to its end, or until balls at rest press against each other, because the laws of impact do not
    determine the motion after that, or until PIC's contact-time rule acts.

    Returns:
        `errors`: for each method the root mean square error over the balls, m, at `TIMES` and at the end; NaN at times
        to which the shot is not followed. `complete`: whether the shot is followed to its end. `outcome_as_oracle`:
        whether PIC has the outcome of the oracle.
    """
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
    complete, moments = known_until == np.inf, np.array([*TIMES, np.inf])
    places = [np.array(exact.positions_at(min(t, exact.time)), dtype=float) for t in moments]

    def errors(found: Sequence[Floats]) -> list[float]:
        apart = np.sqrt(((np.array(found) - places) ** 2).sum(axis=2).mean(axis=1))
        return np.where(complete | (moments < known_until), apart, np.nan).tolist()

    hits = [e.other for e in exact.events if e.kind == "ball_ball" and e.ball == 0 and float(e.time) < known_until]
    found = (simulate(scene, positions, velocities, record=True, engine=method.engine) for method in (PIC, *PIT))
    return {
        "complete": complete,
        "outcome_as_oracle": pic.potted.tolist() == list(exact.potted)
        and pic.first_hit == (hits[0] if hits else -1)
        and set(np.flatnonzero(pic.cushions_before_hit >= 0)) == set(hits),
        "errors": [errors([*(shot.at(t) for t in TIMES), shot.positions]) for shot in found],
    }


def outcomes(name: str, count: int, workers: int, bar: tqdm[Any]) -> dict[Method, dict[str, float | int]]:
    """Compares the outcomes of PIT and PIC over the first shots of a problem.

    The outcome is the set of potted balls and the ball hit first. On a table without pockets it is the set of balls
    that the cue ball touches and the ball hit first. A shot scores if it pots an object ball, or without pockets if the
    cue ball touches all object balls.

    Returns:
        For each PIT: the share of shots with another outcome; the number of shots that score in PIC or PIT; and the
        share of these shots with other potted balls (or another carom).
    """
    scene = PROBLEMS[name].scene
    positions, velocities = shots_of(name, count)

    def outcome(method: Method) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
        """Returns the scores (m, k), whether the shot scores (m,), and the whole outcome (m, l)."""
        batch = simulate_batch(scene, positions, velocities, threads=workers, engine=method.engine)
        touched = batch.cushions_before_hit[:, 1:] >= 0
        if scene.table.pockets:
            return (
                batch.potted,
                np.logical_or.reduce(batch.potted[:, 1:], axis=1),
                np.column_stack((batch.potted, batch.first_hit)),
            )
        made = np.logical_and.reduce(touched, axis=1)
        return made[:, None], made, np.column_stack((touched, batch.first_hit))

    exact = outcome(PIC)
    found: dict[Method, dict[str, float | int]] = {}
    for method in PIT:
        here = outcome(method)
        scoring = exact[1] | here[1]
        wrong = (here[0] != exact[0]).any(axis=1)
        found[method] = {
            "wrong_outcomes": float((here[2] != exact[2]).any(axis=1).mean()),
            "wrong_scores": float(wrong[scoring].mean()) if scoring.any() else 0.0,
            "scoring_shots": int(scoring.sum()),
        }
        bar.update()
    return found


def seconds_per_shot(shots: int, passes: int) -> dict[tuple[str, Method], list[float]]:
    """Returns the mean time of a shot by problem and method, one entry per pass; methods take turns on one core."""
    calls = {}
    for name, problem in PROBLEMS.items():
        few = shots_of(name, min(shots, TIMED))
        calls |= {(name, method): timer(problem.scene, *few, method) for method in (PIC, *PIT)}
    times = [[call() for call in calls.values()] for _ in tqdm(range(passes), "times", unit="pass")]
    return dict(zip(calls, map(list, zip(*times, strict=True)), strict=True))


def rows_of(
    followed: Sequence[dict[str, Any]], seconds: dict[Method, list[float]], wrong: dict[Method, dict[str, float | int]]
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
        row |= wrong.get(method, {})
        rows.append({key: float(f"{x:.4g}") if isinstance(x, float) else x for key, x in row.items()})
    return rows


def measure(shots: int, outcome_shots: int, passes: int, workers: int) -> dict[str, Any]:
    """Returns the results of all measurements.

    `shots` of each problem are compared with the oracle, and the outcomes of `outcome_shots` with the outcomes of PIC.
    The run times are measured in `passes` on one core, and all others by `workers`.
    """
    on = machine()
    seconds = seconds_per_shot(shots, passes)
    followed = run_kinds(follow, PROBLEMS, shots, workers)
    playable = [name for name, problem in PROBLEMS.items() if problem.scene.physics.motion != "ideal"]
    with tqdm(desc="outcomes", total=len(playable) * len(PIT), unit="run") as bar:
        counts = {name: outcome_shots // (BREAKS if "break" in name else 1) or 1 for name in playable}
        wrong = {name: outcomes(name, counts[name], workers, bar) for name in playable}
    scenes = {}
    for name, problem in PROBLEMS.items():
        results, times = followed[name], {method: seconds[name, method] for method in (PIC, *PIT)}
        ends = [result["outcome_as_oracle"] for result in results if result["complete"]]
        scenes[name] = {
            "n_balls": problem.scene.n_balls,
            "error_at": [*TIMES, "end"][problem.column],
            "outcome_shots": counts.get(name, 0),
            "compared": sum(not np.isnan(result["errors"][0][problem.column]) for result in results),
            "followed_to_the_end": len(ends),
            "pic_outcome_as_oracle": sum(ends),
            "methods": rows_of(results, times, wrong.get(name, {})),
        }
    return {"machine": on, "shots": shots, "passes": passes, "scenes": scenes}


def packed(result: dict[str, Any]) -> dict[str, Any]:
    """Returns the result with the rows of each scene as a table: `columns` and `rows`, None where there is no value."""
    scenes = {}
    for name, scene in result["scenes"].items():
        columns = list(dict.fromkeys(itertools.chain.from_iterable(scene["methods"])))
        rows = [[row.get(column) for column in columns] for row in scene["methods"]]
        scenes[name] = {**scene, "methods": {"columns": columns, "rows": rows}}
    return {**result, "scenes": scenes}


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m benchmarks.accuracy --help`."""
    parser = parser_of(
        "accuracy",
        "Run time against error, for every engine and timestep.",
        output=False,
        shots=Count(64, "shots of each scene against the oracle", 4),  # the fourth break is followed to its end
        outcomes=Count(2000, "shots of each scene for outcomes"),
        passes=Count(3, "repetitions of the run time measurement"),
        workers=workers(),
    )
    parser.add_argument("--results", type=Path, default=RESULTS, help="folder of accuracy.json")
    parser.add_argument("--images", type=Path, default=IMAGES, help="folder of pareto.png")
    parser.add_argument("--again", action="store_true", help="print and draw accuracy.json without measuring")
    args = parser.parse_args(arguments)
    path = args.results / "accuracy.json"
    if args.again:
        result = json.loads(path.read_text())
    else:
        result = packed(measure(args.shots, args.outcomes, args.passes, args.workers))
    accuracy_report.draw_pareto(accuracy_report.unpacked(result), args.images / "pareto.png")
    report(result, blocks, path)


if __name__ == "__main__":
    main()
