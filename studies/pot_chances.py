"""Compares the first-order probability of a pot with samples: `python -m studies.pot_chances`.

Each layout is random and has one object ball. Each shot is a random one of the pots that geometry finds, at one of its
speeds. It can miss. The errors are those of the Computer Olympiad. The true probability is the share of successes in
`SAMPLES` simulated shots with errors. The results are in `studies/results/pot_chances.json`.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from benchmarks import machine, machine_line, table
from billiards_env.files import write_json
from billiards_env.games import Setup, opening
from billiards_env.intervals import mean_interval
from billiards_env.players.chances import pot_chances
from billiards_env.players.planner import with_errors
from billiards_env.players.pots import DX, DY, SHOT_WIDTH, SPEED, Tables, find_pots
from billiards_env.scene import Scene
from billiards_env.shots.simulation import simulate_batch
from studies import RESULTS, parser_of, report
from studies.planner import OLYMPIAD

OUTPUT = RESULTS / "pot_chances.json"
SCENES, SEED, MAX_SPEED, LAYOUTS, SAMPLES = ("pool", "real_pool"), 40, 4.0, 1000, 10_000
FEW = 50
"""The number of samples in the method that is compared with the first order."""

Floats = NDArray[np.float64]


def random_pots(scene: Scene, layouts: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Returns positions (k, 2, 2) in m and velocities (k, 2) in m/s of k shots that try to pot ball 1."""
    setup, positions, velocities = Setup("straight", scene), [], []
    while len(positions) < layouts:
        placed = opening(setup, rng, "random").positions
        tables = Tables(scene, np.array([False, True]), placed[None], np.zeros((1, 2), bool), MAX_SPEED)
        shots = find_pots(tables, most=6).shots[0].reshape(-1, SHOT_WIDTH)
        shots = shots[shots[:, SPEED] > 0.0]
        if len(shots):
            shot = shots[rng.integers(len(shots))]
            positions.append(placed)
            velocities.append(shot[SPEED] * shot[[DX, DY]])
    return np.array(positions), np.array(velocities)


def sampled(scene: Scene, positions: Floats, velocity: Floats, samples: int, rng: np.random.Generator) -> float:
    """Returns the share of shots with errors that pot ball 1 and not the cue ball."""
    errors = rng.standard_normal((samples, 2)) * (np.radians(OLYMPIAD[0]), OLYMPIAD[1])
    velocities, _ = with_errors(velocity[None].repeat(samples, 0), np.zeros((samples, 3)), errors, MAX_SPEED + 1.0)
    places = np.broadcast_to(positions, (samples, *positions.shape))
    potted = simulate_batch(scene, places, velocities, threads=1).potted
    return float((potted[:, 1] & ~potted[:, 0]).mean())


def measure(layouts: int, samples: int, output: Path) -> dict[str, Any]:
    """Writes and returns `machine`, `settings`, and `results[scene]`.

    A result has the absolute errors of each layout, `first_order` and `sampled` (with `FEW` samples), and `times`: the
    mean processor time of a layout for each of the two methods, s.
    """
    results: dict[str, Any] = {}
    for name in SCENES:
        scene, rng = Scene.named(name, 1), np.random.default_rng(SEED)
        positions, velocities = random_pots(scene, layouts, rng)
        pot_chances(scene, positions[:1], velocities[:1], 1, OLYMPIAD)  # compiles
        begin = time.thread_time()
        found = pot_chances(scene, positions, velocities, 1, OLYMPIAD)
        taken, few = [time.thread_time() - begin], []
        begin = time.thread_time()
        for place, velocity in zip(positions, velocities, strict=True):
            few.append(sampled(scene, place, velocity, FEW, rng))
        taken.append(time.thread_time() - begin)
        every = tqdm(zip(positions, velocities, strict=True), total=layouts, desc=name, unit="layout")
        true = np.array([sampled(scene, place, velocity, samples, rng) for place, velocity in every])
        results[name] = {
            "first_order": np.abs(found - true).round(4).tolist(),
            "sampled": np.abs(few - true).round(4).tolist(),
            "times": [seconds / layouts for seconds in taken],
        }
    settings = {"seed": SEED, "layouts": layouts, "samples": samples}
    found = {"machine": machine(), "settings": settings, "results": results}
    write_json(output, found)
    return found


def blocks(found: Mapping[str, Any]) -> dict[str, str]:
    """Returns the tables for the pages, by name."""
    rows = []
    for scene, result in found["results"].items():
        for k, (key, name) in enumerate((("first_order", "first order"), ("sampled", f"{FEW} samples"))):
            errors = result[key]
            low, high = mean_interval(errors) or (np.nan, np.nan)
            mean = f"{np.mean(errors):.4f} ({low:.4f} to {high:.4f})"
            most = f"{np.quantile(errors, 0.95):.3f}"
            rows.append((scene, name, str(len(errors)), mean, most, f"{1e6 * result['times'][k]:.0f} us"))
    head = ("scene", "method", "layouts", "mean absolute error", "95% of errors below", "time")
    return {"machine": machine_line(found["machine"]), "errors": table(head, rows, left=2)}


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs the command line; see `python -m studies.pot_chances --help`."""
    parser = parser_of(
        "pot_chances",
        "Compare the probability of a pot to first order with samples.",
        layouts=(LAYOUTS, "layouts of each scene"),
        samples=(SAMPLES, "samples of a layout"),
        output=(OUTPUT, "JSON file"),
    )
    args = parser.parse_args(arguments)
    report(lambda: measure(args.layouts, args.samples, args.output), blocks, args.output)


if __name__ == "__main__":
    main()
