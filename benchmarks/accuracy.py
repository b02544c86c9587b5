"""Run time and error of PIC and of PIT at many timesteps.

PIC and PIT run the same random shots; PIT uses timesteps of 1/15 to 1/15360 s and each of its fixes. Errors are
measured against the 50-digit oracle. Outcomes (the balls potted, the ball hit first) of more shots are compared with
the results of PIC, which are compared with the oracle first. Run times are measured on one core; all methods take
turns.

    python -m benchmarks.accuracy               # within ten minutes on two cores
    python -m benchmarks.accuracy --shots 8 --outcomes 200 --passes 1
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from benchmarks import accuracy_report, error_limit, machine, run_command, run_kinds, workers
from benchmarks.accuracy_report import blocks, draw
from benchmarks.reference.oracle import OracleError, reference_shot
from billiards_env.commands import Job
from billiards_env.engine import PIC, Engine
from billiards_env.scene import Scene
from billiards_env.shots.simulation import simulate, simulate_batch
from billiards_env.support.checks import Range, integer

Floats = NDArray[np.float64]

STEPS = [15 * 2**k for k in range(11)]
"""Timesteps of PIT, as steps per second."""
TIMED = 24  # shots whose run time is measured
BREAKS = 8  # number of other shots per break in the comparison of outcomes, because breaks take long


LEAST_SECONDS = 0.02
"""s. A timed call of the engine runs as many copies of the shots as take about this time."""


class ShotKind(NamedTuple):
    """Random shots in a scene; the error is that of the positions after `time`, s, or at the end for None."""

    scene: Scene
    draw: error_limit.Draw
    time: float | None


_shot, _break, _gas = (
    error_limit.KINDS[kind][1] for kind in ("1 object ball", "15-ball break, loose", "gas of 16 disks")
)
PROBLEMS = {
    "1 object ball": ShotKind(Scene.named("pool", 1), _shot, None),
    "3 object balls": ShotKind(Scene.named("pool", 3), _shot, None),
    "5 object balls": ShotKind(Scene.named("pool", 5), _shot, None),
    "carom": ShotKind(Scene.named("carom", 2), _shot, None),
    "15-ball break": ShotKind(Scene.named("pool", 15), _break, 0.5),
    "2 elastic disks": ShotKind(Scene.named("ideal", 1), _shot, 2.0),
    "gas of 16 disks": ShotKind(Scene.named("ideal", 15), _gas, 1.0),
}


PIT = [Engine("pit", 1 / steps, fix) for fix in accuracy_report.PIT_STYLES for steps in STEPS]


def draw_shot(name: str, seed: int) -> tuple[Floats, Floats]:
    """Returns the positions and velocities of a shot of a problem, see `error_limit.Draw`."""
    scene, draw, _ = PROBLEMS[name]
    return draw(scene, np.random.default_rng([seed, list(PROBLEMS).index(name), 7]))


def draw_shots(name: str, count: int) -> tuple[Floats, Floats]:
    """Returns the positions and velocities of the first `count` shots of a problem."""
    positions, velocities = zip(*(draw_shot(name, seed) for seed in range(count)), strict=True)
    return np.array(positions), np.array(velocities)


def follow_shot(name: str, seed: int) -> dict[str, Any]:
    """Runs one shot by the oracle and by every method.

    The shot is followed to its end, or until balls at rest press against each other, because the laws of impact do not
    determine the motion after that, or until PIC's contact-time rule acts.

    Returns:
        `errors`: for each method the root mean square error over the balls, m, at the time of the problem; None if the
        shot is not followed to this time. `complete`: whether the shot is followed to its end. `outcome_as_oracle`:
        whether PIC has the outcome of the oracle.
    """
    scene, _, time = PROBLEMS[name]
    positions, velocities = draw_shot(name, seed)
    pic = simulate(scene, positions, velocities, record=True)
    assert pic.events is not None
    ruled = pic.events["time"][pic.events["rule"]]
    known_until = float(ruled[0]) if len(ruled) else np.inf
    try:
        exact = reference_shot(scene, positions.tolist(), velocities.tolist())
    except OracleError as stopped:
        exact = stopped.shot
        known_until = min(known_until, float(exact.time))
    complete, errors = known_until == np.inf, None
    if complete or (time is not None and time < known_until):
        places = np.array(exact.positions if time is None else exact.positions_at(time), dtype=float)
        shots = (simulate(scene, positions, velocities, record=True, engine=engine) for engine in (PIC, *PIT))
        ends = np.array([shot.positions if time is None else shot.at(time) for shot in shots])
        errors = np.sqrt(((ends - places) ** 2).sum(axis=2).mean(axis=1)).tolist()
    hits = [e.other for e in exact.events if e.kind == "ball_ball" and e.ball == 0 and float(e.time) < known_until]
    return {
        "complete": complete,
        "outcome_as_oracle": pic.potted.tolist() == list(exact.potted)
        and pic.first_hit == (hits[0] if hits else -1)
        and set(np.flatnonzero(pic.cushions_before_hit >= 0)) == set(hits),
        "errors": errors,
    }


def compare_outcomes(name: str, count: int, workers: int) -> dict[Engine, dict[str, float | int]]:
    """Compares the outcomes of PIT and PIC over the first shots of a problem.

    The outcome is the set of potted balls and the ball hit first. On a table without pockets it is the set of balls
    that the cue ball touches and the ball hit first. A shot scores if it pots an object ball, or without pockets if the
    cue ball touches all object balls.

    Returns:
        For each PIT: the share of shots with another outcome; the number of shots that score in PIC or PIT; and the
        share of these shots with other potted balls (or another carom).
    """
    scene = PROBLEMS[name].scene
    positions, velocities = draw_shots(name, count)

    def outcome(engine: Engine) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
        """Returns the scores (m, k), whether the shot scores (m,), and the whole outcome (m, l)."""
        batch = simulate_batch(scene, positions, velocities, threads=workers, engine=engine)
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
    agreement: dict[Engine, dict[str, float | int]] = {}
    for engine in tqdm(PIT, f"outcomes of {name}", unit="engine"):
        here = outcome(engine)
        scoring = exact[1] | here[1]
        wrong = (here[0] != exact[0]).any(axis=1)
        agreement[engine] = {
            "wrong_outcomes": float((here[2] != exact[2]).any(axis=1).mean()),
            "wrong_scores": float(wrong[scoring].mean()) if scoring.any() else 0.0,
            "scoring_shots": int(scoring.sum()),
        }
    return agreement


def timer(scene: Scene, positions: Floats, velocities: Floats, engine: Engine) -> Callable[[], float]:
    """Returns a function that runs shots, see `simulate_batch`, and returns the seconds per shot."""

    def call(copies: int = 1) -> float:
        many = np.concatenate([positions] * copies), np.concatenate([velocities] * copies)
        begin = perf_counter()
        simulate_batch(scene, *many, threads=1, engine=engine)
        return (perf_counter() - begin) / len(many[0])

    simulate_batch(scene, positions[:1], velocities[:1], threads=1, engine=engine)  # compiles
    copies = max(1, round(LEAST_SECONDS / (call() * len(positions))))
    return lambda: call(copies)


def seconds_per_shot(name: str, shots: int, passes: int) -> dict[Engine, list[float]]:
    """Returns the mean time of a shot by engine, one entry per pass; engines take turns on one core."""
    timed = draw_shots(name, min(shots, TIMED))
    calls = {engine: timer(PROBLEMS[name].scene, *timed, engine) for engine in (PIC, *PIT)}
    times = [[call() for call in calls.values()] for _ in tqdm(range(passes), f"times of {name}", unit="pass")]
    return dict(zip(calls, map(list, zip(*times, strict=True)), strict=True))


def rows_per_engine(
    errors: Sequence[Sequence[float]], seconds: dict[Engine, list[float]], wrong: dict[Engine, dict[str, float | int]]
) -> list[dict[str, Any]]:
    """Returns the results of a problem, one row per engine, from the errors of each shot with each engine."""
    rows = []
    for engine, error in zip((PIC, *PIT), np.median(errors, axis=0), strict=True):
        row = {
            "method": engine.mode.upper(),
            "fix": engine.fix,
            "steps_per_second": engine.dt and round(1 / engine.dt),
            "us_per_shot": 1e6 * float(np.median(seconds[engine])),
            "time_over_pic": float(np.median(np.divide(seconds[engine], seconds[PIC]))),
            "median_error_m": float(error),
            **wrong.get(engine, {}),
        }
        rows.append({key: float(f"{x:.4g}") if isinstance(x, float) else x for key, x in row.items()})
    return rows


def measure(shots: int, outcomes: int, passes: int, workers: int, job: Job) -> dict[str, Any]:
    """Returns the results of all measurements.

    `shots` of each problem are compared with the oracle, and `outcomes` of more shots with the outcomes of PIC. The run
    times are measured in `passes` on one core, and all others by `workers`.
    """
    integer("shots", shots, Range(4, None))  # the first break that is followed to its end is the fourth one
    on, scenes, seconds = machine(), {}, {}
    for name in PROBLEMS:
        with job(name):
            seconds[name] = seconds_per_shot(name, shots, passes)
    followed = run_kinds(follow_shot, seconds, shots, workers, job)
    for name, results in followed.items():
        ends = [result["outcome_as_oracle"] for result in results if result["complete"]]
        errors = [result["errors"] for result in results if result["errors"] is not None]
        playable = PROBLEMS[name].scene.physics.motion != "ideal"
        count = (outcomes // (BREAKS if "break" in name else 1) or 1) if playable else 0
        with job(name):
            if not errors:
                raise ValueError("no shot is followed up to the time of comparison")
            wrong = compare_outcomes(name, count, workers) if playable else {}
            scenes[name] = {
                "n_balls": PROBLEMS[name].scene.n_balls,
                "error_at": "end" if PROBLEMS[name].time is None else PROBLEMS[name].time,
                "outcome_shots": count,
                "compared": len(errors),
                "followed_to_the_end": len(ends),
                "pic_outcome_as_oracle": sum(ends),
                "methods": rows_per_engine(errors, seconds[name], wrong),
            }
    return {"machine": on, "shots": shots, "passes": passes, "scenes": scenes} if scenes else {}


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m benchmarks.accuracy --help`."""
    options = {
        "shots": (64, "shots of each scene against the oracle, at least 4"),
        "outcomes": (2000, "shots of each scene for outcomes"),
        "passes": (3, "repetitions of the run time measurement"),
        "workers": workers(),
    }
    about = "Run time against error, for every engine and timestep."
    run_command("benchmarks.accuracy", about, arguments, measure, blocks, options, draw, jobs=True)


if __name__ == "__main__":
    main()
