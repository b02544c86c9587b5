"""How well a calibration recovers the truth: `python -m benchmarks.calibration`.

The same shots are seen again and again, each time with other noise, and fitted from other start values. The command
counts how often the 95% interval of a number contains its true value.
"""

from __future__ import annotations

import dataclasses
import functools
from typing import Any

import numpy as np

from benchmarks import machine, run_command, run_kinds, table, workers
from billiards_env.calibration.calibrate import calibrate
from billiards_env.calibration.tracks import Track, observed
from billiards_env.intervals import success_rate
from billiards_env.scene import Scene, layouts
from billiards_env.shots.simulation import simulate

SCENE, NOISE, SHOTS, FRAMES = "real_carom", 0.002, 6, 1 / 30 * np.arange(75)
NUMBERS = ("mu_slide", "mu_roll", "e_ball", "e_cushion", "mu_ball_factor")
"""The numbers that are fitted; the last is the multiplier of the friction between balls, which throws them."""
APART = 0.1
"""s. Least time between two contacts, and before the first."""
OFF = 0.1
"""Largest relative error of a start value."""


@functools.cache
def shots() -> list[Any]:
    """Returns the shots: random layouts, the cue ball hits ball 1 with a random cut and spin."""
    scene, rng, found = Scene.named(SCENE, 1), np.random.default_rng(0), []
    radius = scene.balls.radius[0]
    while len(found) < SHOTS:
        positions = layouts.draw("random", scene, rng)
        ahead = positions[1] - positions[0]
        aim = ahead + rng.uniform(-1.0, 1.0) * radius * np.array([-ahead[1], ahead[0]]) / np.hypot(*ahead)
        velocity = rng.uniform(1.5, 3.5) * aim / np.hypot(*aim)
        roll, side = rng.uniform(-0.5, 1.0), rng.uniform(-0.5, 0.5)
        spin = np.array([-roll * velocity[1], roll * velocity[0], side * np.hypot(*velocity)]) / radius
        shot: Any = simulate(scene, positions, velocity, spins=spin, record=True)
        contacts = shot.events["time"][np.isin(shot.events["kind"], ("ball_ball", "cushion"))]
        if shot.first_hit == 1 and np.diff(contacts, prepend=0.0).min() > APART:
            found.append(shot)
    return found


def tracks(seed: int) -> list[Track]:
    """Returns the tracks of the shots with some noise."""
    return [observed(f"{k}", shot, FRAMES, NOISE, SHOTS * seed + k) for k, shot in enumerate(shots())]


def one(kind: str, seed: int) -> dict[str, Any]:
    """Returns the fitted values, the halves of their intervals and the number of problems of one repeat."""
    scene, rng = Scene.named(kind, 1), np.random.default_rng(seed)
    begin = {name: getattr(scene.physics, name) * (1.0 + OFF * rng.uniform(-1.0, 1.0)) for name in NUMBERS}
    begin = {name: min(value, 0.99) if name.startswith("e_") else value for name, value in begin.items()}
    found = calibrate(
        dataclasses.replace(scene, physics=dataclasses.replace(scene.physics, **begin)), tracks(seed), NUMBERS
    )
    halves = [(high - low) / 2.0 for low, high in found.intervals.values()]
    return {"values": list(found.values.values()), "halves": halves, "problems": len(found.problems)}


def measure(repeats: int, workers: int) -> dict[str, Any]:
    """Runs all repeats and returns their summary."""
    found = run_kinds(one, (SCENE,), repeats, workers)[SCENE]
    values, halves = (np.array([repeat[name] for repeat in found]) for name in ("values", "halves"))
    rows = []
    for name, value, half in zip(NUMBERS, values.T, halves.T, strict=True):
        truth = getattr(Scene.named(SCENE).physics, name)
        rows.append(
            {
                "number": name,
                "truth": truth,
                "mean": float(value.mean()),
                "std": float(value.std(ddof=1)) if repeats > 1 else 0.0,
                "half": float(np.median(half)),
                "covered": int(np.count_nonzero(np.abs(value - truth) <= half)),
            }
        )
    problems = sum(repeat["problems"] > 0 for repeat in found)
    return {"machine": machine(), "repeats": repeats, "problems": problems, "numbers": rows}


def blocks(result: dict[str, Any]) -> dict[str, str]:
    """Returns the results as Markdown, by name."""
    repeats, rows = result["repeats"], []
    for row in result["numbers"]:
        share = success_rate(row["covered"], repeats)
        numbers = f"{row['truth']:.5g}", f"{row['mean']:.5g}", f"{row['std']:.2g}", f"{row['half']:.2g}"
        rows.append((f"`{row['number']}`", *numbers, share))
    return {
        "how": f"{repeats} repeats with {SHOTS} shots of {len(FRAMES)} frames and noise of {1000 * NOISE:g} mm. "
        f"In {result['problems']} repeats a row was reported.",
        "coverage": table(
            ("number", "truth", "mean", "standard deviation", "half of the interval", "truth in the 95% interval"), rows
        ),
    }


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m benchmarks.calibration --help`."""
    about = "Count how often the intervals of a calibration contain the truth."
    options = {"repeats": (500, "number of repeats"), "workers": workers()}
    run_command("benchmarks.calibration", about, arguments, measure, blocks, options)


if __name__ == "__main__":
    main()
