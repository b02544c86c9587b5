"""The engine's error compared with the error that no double-precision engine can avoid.

The engine and the 50-digit oracle run random shots of several kinds. Each shot is followed to its end, or until the
unavoidable error (the unit roundoff times the condition number of the shot) reaches a thousandth of a ball's radius, or
until the contact-time rule acts, which the oracle does not have. Up to this time the events must be the same. The error
of the positions is divided by the unavoidable error.

    python -m benchmarks.error_limit            # 1,000 shots of each kind
    python -m benchmarks.error_limit --shots 50
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

import mpmath
import numpy as np
from numpy.typing import NDArray

from benchmarks import machine, new_figure, rows_table, run_command, run_kinds, save, workers
from benchmarks.reference.oracle import OracleError, reference_shot
from billiards_env import derivatives
from billiards_env.commands import Job
from billiards_env.derivatives.shot_derivatives import UNIT_ROUNDOFF
from billiards_env.scene import Scene, layouts
from billiards_env.shots.simulation import simulate

Floats = NDArray[np.float64]
Draw: TypeAlias = Callable[[Scene, np.random.Generator], tuple[Floats, Floats]]
"""Draws the positions (n, 2), m, and the velocities (n, 2) or (2,), m/s, of a shot."""

OF_A_RADIUS = 1e-3
GAS_COLLISIONS = 100


def _shot(scene: Scene, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Draws a random layout and a shot: half of the shots hit an object ball, the others have a random direction."""
    places = layouts.draw("random", scene, rng)
    angle = rng.uniform(0.0, 2.0 * np.pi)
    if rng.random() < 0.5:
        ball = rng.integers(1, scene.n_balls)
        to = places[ball] - places[0]
        reach = scene.balls.contact_distances(0)[ball]
        angle = np.arctan2(to[1], to[0]) + rng.uniform(-1.0, 1.0) * np.arcsin(reach / np.hypot(*to))
    return places, rng.uniform(0.3, 5.0) * np.array([np.cos(angle), np.sin(angle)])


def _break(scene: Scene, rng: np.random.Generator, loose: bool) -> tuple[Floats, Floats]:
    """Draws a break of a rack with gaps of 0.1 to 0.5 mm, or of 1 to 10 micrometres."""
    places = layouts.draw("rack" if loose else "tight_rack", scene, rng)
    if not loose:
        spread = 1.0 + rng.uniform(1e-6, 1e-5) / (2.0 * scene.balls.radius[1])
        places[2:] = places[1] + spread * (places[2:] - places[1])
    to = places[1] - places[0]
    angle = np.arctan2(to[1], to[0]) + rng.uniform(-0.5, 0.5) * np.arcsin(2.0 * scene.balls.radius[0] / np.hypot(*to))
    return places, rng.uniform(3.0, 9.0) * np.array([np.cos(angle), np.sin(angle)])


def _gas(scene: Scene, rng: np.random.Generator) -> tuple[Floats, Floats]:
    return layouts.draw("random", scene, rng), rng.normal(0.0, 1.0, (scene.n_balls, 2))


_LOOSE, _TIGHT = functools.partial(_break, loose=True), functools.partial(_break, loose=False)
KINDS: dict[str, tuple[Scene, Draw]] = {
    "1 object ball": (Scene.named("pool", 1), _shot),
    "2 object balls": (Scene.named("pool", 2), _shot),
    "5 object balls": (Scene.named("pool", 5), _shot),
    "carom": (Scene.named("carom", 2), _shot),
    "9-ball break, loose": (Scene.named("pool", 9), _LOOSE),
    "9-ball break, tight": (Scene.named("pool", 9), _TIGHT),
    "15-ball break, loose": (Scene.named("pool", 15), _LOOSE),
    "15-ball break, tight": (Scene.named("pool", 15), _TIGHT),
    "gas of 16 disks": (Scene.named("ideal", 15), _gas),
    "real pool, 1 object ball": (Scene.named("real_pool", 1), _shot),
    "real pool, 5 object balls": (Scene.named("real_pool", 5), _shot),
    "real pool, 9-ball break, loose": (Scene.named("real_pool", 9), _LOOSE),
    "UK pool, 2 object balls": (Scene.named("uk_pool", 2), _shot),
}


def compare(kind: str, seed: int) -> dict[str, float | bool | int]:
    """Runs a shot of one of `KINDS` by the engine and by the oracle.

    Returns:
        error (m), condition (m), ratio (error over condition times the unit roundoff), same_events, to_end (whether the
        shot was followed to its end) and events (the number of events compared).
    """
    scene, draw = KINDS[kind]
    rng = np.random.default_rng([seed, list(KINDS).index(kind)])
    places, velocities = draw(scene, rng)
    shot = simulate(scene, places, velocities, record=True)
    assert shot.events is not None
    if kind.startswith("gas"):
        hits = shot.events["time"][shot.events["kind"] == "ball_ball"]
        if len(hits) > GAS_COLLISIONS:
            shot = simulate(scene, places, velocities, record=True, max_time=float(hits[GAS_COLLISIONS]))
    assert shot.events is not None
    times = np.append(shot.events["time"], shot.time)
    until = shot.time
    allowed = OF_A_RADIUS * min(scene.balls.radius) / UNIT_ROUNDOFF
    for k, here in enumerate(derivatives.sensitivities(shot, times)):
        if here.condition > allowed or not here.smooth:
            # Halfway between this event and the one before, so that rounding does not move an event across the end.
            until = 0.5 * (times[k - 1] + times[k]) if k else 0.5 * times[0]
            break
    condition = derivatives.sensitivity(shot, until).condition
    limit = until if until < shot.time or scene.physics.max_time else None
    try:
        exact = reference_shot(scene, places.tolist(), velocities.tolist(), max_time=limit)
    except OracleError as stopped:
        exact = stopped.shot
    ours = sorted(
        (str(e["kind"]), int(e["ball"]), int(e["other"]), float(e["time"])) for e in shot.events if e["time"] <= until
    )
    theirs = sorted((e.kind, e.ball, -1 if e.other is None else e.other, float(e.time)) for e in exact.events)
    same = [e[:3] for e in ours] == [e[:3] for e in theirs]
    # A complete shot is compared at its end, because the oracle's last event may be later than `until` by rounding.
    places, exactly = (shot.at(until), exact.positions_at(until)) if limit else (shot.positions, exact.positions)
    pairs = zip(places.tolist(), exactly, strict=True)
    error = max(float(mpmath.hypot(a[0] - b[0], a[1] - b[1])) for a, b in pairs)
    return {
        "error": error,
        "condition": condition,
        "ratio": error / (condition * UNIT_ROUNDOFF) if error else 0.0,  # the condition is 0 if all balls are potted
        "same_events": same,
        "to_end": until == shot.time,
        "events": len(ours),
    }


def summary(results: Sequence[Mapping[str, float | bool | int]]) -> dict[str, float | int]:
    """Returns the numbers of the table for one kind of shots."""
    ratio = np.array([r["ratio"] for r in results])
    return {
        "shots": len(results),
        "same_events": sum(bool(r["same_events"]) for r in results),
        "to_end": sum(bool(r["to_end"]) for r in results),
        "events": int(np.sum([r["events"] for r in results])),
        "median_condition_m": float(np.median([r["condition"] for r in results])),
        "median_error_m": float(np.median([r["error"] for r in results])),
        "median_ratio": float(np.median(ratio)),
        "p99_ratio": float(np.quantile(ratio, 0.99)),
        "max_ratio": float(ratio.max()),
    }


def measure(shots: int, workers: int, job: Job) -> dict[str, Any]:
    """Compares `shots` of each of `KINDS`."""
    on, by_kind = machine(), run_kinds(compare, KINDS, shots, workers, job)
    return {"machine": on, "kinds": {kind: summary(results) for kind, results in by_kind.items()}}


def draw(result: dict[str, Any], folder: Path) -> None:
    """Draws the errors of each kind of shots over the unavoidable error: the median, 99 % and the largest."""
    kinds = result["kinds"]
    figure = new_figure(7.2, 0.9 + 0.3 * len(kinds))
    axes, rows = figure.add_subplot(), range(len(kinds))
    columns = (("median_ratio", "o", "median"), ("p99_ratio", "|", "99 % of the shots"), ("max_ratio", "x", "largest"))
    values = {key: [kind[key] for kind in kinds.values()] for key, *_ in columns}
    axes.hlines(rows, values["median_ratio"], values["max_ratio"], color="#0072b2", linewidth=1.0, alpha=0.5)
    for key, marker, label in columns:
        axes.plot(values[key], rows, marker, color="#0072b2", markersize=6, label=label)
    axes.axvline(1.0, color="black", linewidth=1.2, label="unavoidable error")
    axes.set(xscale="log", xlabel="error over the unavoidable error", ylim=(len(kinds) - 0.5, -0.5))
    axes.set_yticks(rows, kinds)
    axes.grid(axis="x", alpha=0.3)
    figure.legend(fontsize=8, loc="outside upper center", ncols=4, frameon=False)
    save(figure, folder / "error_limit.png")


def blocks(result: dict[str, Any]) -> dict[str, str]:
    """Returns the results as Markdown, by name."""
    columns = {
        "shots of a kind": "{kind}",
        "same events": "{same_events} of {shots}",
        "to their end": "{to_end}",
        "events": "{events:,}",
        "condition": "{median_condition_m:.2g} m",
        "error": "{median_error_m:.1e} m",
        "ratio": "{median_ratio:.2f}",
        "99%": "{p99_ratio:.1f}",
        "largest": "{max_ratio:.1f}",
    }
    return {"kinds": rows_table(columns, [{"kind": kind, **row} for kind, row in result["kinds"].items()])}


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m benchmarks.error_limit --help`."""
    about = "Compare the engine's error with the unavoidable error; condition, error and ratio are medians."
    options = {"shots": (1000, "shots of each kind"), "workers": workers()}
    run_command("benchmarks.error_limit", about, arguments, measure, blocks, options, draw, jobs=True)


if __name__ == "__main__":
    main()
