"""How well a calibration recovers the truth: `python -m benchmarks.calibration`.

Each repeat has other shots, other noise and other start values. The command counts how often the 95% interval of a
constant contains its true value: for fits with the law of the cushions that made the tracks, and with another one.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from benchmarks import machine, run_command, run_kinds, table, workers
from billiards_env.calibration.calibrate import calibrate
from billiards_env.calibration.tracks import Track, observed
from billiards_env.commands import Job
from billiards_env.intervals import success_rate
from billiards_env.scene import Scene, layouts
from billiards_env.shots.simulation import simulate

SCENE, NOISE, SHOTS, FRAMES = "real_carom", 0.002, 16, 1 / 30 * np.arange(75)
NUMBERS = ("mu_slide", "mu_roll", "e_ball", "e_cushion", "mu_cushion", "mu_ball_factor")
"""The constants that are fitted; the last is the multiplier of the friction between balls, which throws them."""
LAWS = ("stronge", "han2005")
"""The laws of the cushions in the fits; the first is that of the tracks."""
CLOTH = ("mu_slide", "mu_roll")
"""The constants that do not belong to the law of the cushions."""
APART = 0.1
"""s. Least time between two contacts, and before the first."""
OFF = 0.1
"""Largest relative error of a start value."""


def shots(seed: int) -> list[Any]:
    """Returns the shots: random layouts, the cue ball hits ball 1 with a random cut and spin."""
    scene, rng, recorded = Scene.named(SCENE, 1), np.random.default_rng(seed), []
    radius = scene.balls.radius[0]
    while len(recorded) < SHOTS:
        positions = layouts.draw("random", scene, rng)
        ahead = positions[1] - positions[0]
        aim = ahead + rng.uniform(-1.0, 1.0) * radius * np.array([-ahead[1], ahead[0]]) / np.hypot(*ahead)
        velocity = rng.uniform(1.5, 3.5) * aim / np.hypot(*aim)
        roll, side = rng.uniform(-0.5, 1.0), rng.uniform(-0.5, 0.5)
        spin = np.array([-roll * velocity[1], roll * velocity[0], side * np.hypot(*velocity)]) / radius
        shot: Any = simulate(scene, positions, velocity, spins=spin, record=True)
        contacts = shot.events["time"][np.isin(shot.events["kind"], ("ball_ball", "cushion"))]
        if shot.first_hit == 1 and np.diff(contacts, prepend=0.0).min() > APART:
            recorded.append(shot)
    return recorded


def tracks(seed: int) -> list[Track]:
    """Returns the tracks of the shots of a repeat."""
    return [observed(f"{k}", shot, FRAMES, NOISE, SHOTS * seed + k) for k, shot in enumerate(shots(seed))]


def fit_repeat(law: str, seed: int) -> dict[str, Any]:
    """Returns the fitted values and the intervals by name, and the number of problems, of one repeat."""
    scene, rng = Scene.named(SCENE, 1), np.random.default_rng(seed)
    begin = {name: getattr(scene.physics, name) * (1.0 + OFF * rng.uniform(-1.0, 1.0)) for name in NUMBERS}
    begin = {name: min(value, 0.99) if name.startswith("e_") else value for name, value in begin.items()}
    physics = dataclasses.replace(scene.physics, **begin, cushion=law)
    result = calibrate(dataclasses.replace(scene, physics=physics), tracks(seed), NUMBERS, hold_back=False)
    return {"values": result.values, "intervals": result.intervals, "problems": len(result.problems)}


def measure(repeats: int, workers: int, job: Job) -> dict[str, Any]:
    """Runs all repeats and returns their summary. A constant that a repeat does not determine has no interval there."""
    rows, problems, total = [], 0, 0
    for law, fits in run_kinds(fit_repeat, LAWS, repeats, workers, job).items():
        total += len(fits)
        problems += sum(repeat["problems"] > 0 for repeat in fits)
        for name in NUMBERS if law == LAWS[0] else CLOTH:
            truth = getattr(Scene.named(SCENE).physics, name)
            values = np.array([repeat["values"][name] for repeat in fits if name in repeat["values"]])
            ends = np.array([repeat["intervals"][name] for repeat in fits if name in repeat["values"]]).reshape(-1, 2)
            rows.append(
                {
                    "law": law,
                    "number": name,
                    "truth": truth,
                    "repeats": len(values),
                    "mean": float(values.mean()) if len(values) else None,
                    "std": float(values.std(ddof=1)) if len(values) > 1 else None,
                    "half": float(np.median(ends[:, 1] - ends[:, 0])) / 2.0 if len(values) else None,
                    "covered": int(np.count_nonzero((ends[:, 0] <= truth) & (truth <= ends[:, 1]))),
                }
            )
    return {"machine": machine(), "repeats": repeats, "fits": total, "problems": problems, "numbers": rows}


def blocks(result: dict[str, Any]) -> dict[str, str]:
    """Returns the results as Markdown, by name."""
    rows = []
    for row in result["numbers"]:
        digits = zip((row["truth"], row["mean"], row["std"], row["half"]), (5, 5, 2, 2), strict=True)
        numbers = ("-" if value is None else f"{value:.{most}g}" for value, most in digits)
        covered = success_rate(row["covered"], row["repeats"]) if row["repeats"] else "-"
        rows.append((f"`{row['law']}`", f"`{row['number']}`", *numbers, covered))
    shown = ("truth", "mean", "standard deviation", "half of the interval", "truth in the 95% interval")
    return {
        "how": f"{result['repeats']} repeats with {SHOTS} shots of {len(FRAMES)} frames and noise of {1000 * NOISE:g} "
        f"mm; the tracks have `{LAWS[0]}` cushions. In {result['problems']} of the "
        f"{result['fits']} fits at least one row was reported as not fitting.",
        "coverage": table(("law", "constant", *shown), rows),
    }


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m benchmarks.calibration --help`."""
    about = "Count how often the intervals of a calibration contain the truth."
    options = {"repeats": (100, "number of repeats"), "workers": workers()}
    run_command("benchmarks.calibration", about, arguments, measure, blocks, options, jobs=True)


if __name__ == "__main__":
    main()
