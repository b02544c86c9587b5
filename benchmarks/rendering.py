"""The speed of drawing, and the cost of a render mode without rendering: `python -m benchmarks.rendering`.

The results are medians over the passes; the cases take turns. The time of a frame includes its copy to an array.
"""

from __future__ import annotations

import argparse
import statistics
from pathlib import Path
from time import perf_counter
from typing import Any

import gymnasium as gym
import numpy as np

from benchmarks import RESULTS, check_counts, machine, machine_line, print_blocks, table
from billiards_env import layouts
from billiards_env.drawing.canvas import Canvas, pixels
from billiards_env.files import write_json
from billiards_env.scene import Scene
from billiards_env.shot import ShotResult
from billiards_env.simulation import simulate

STEPS = 200
STEP = "env.step, render_mode={!r}, never rendered: us"


def shots() -> dict[str, ShotResult]:
    """Returns a shot at one object ball and a break."""
    rng = np.random.default_rng(0)
    one, rack = Scene.named("pool"), Scene.named("pool", 15)
    positions = layouts.draw("rack", rack, rng)
    toward = (positions[1] - positions[0]) / np.hypot(*(positions[1] - positions[0]))
    return {
        "pool, 1 object ball": simulate(one, [[-0.635, 0.0], [0.635, 0.3]], [2.0, 0.45], record=True),
        "15-ball break": simulate(rack, positions, 8 * toward, record=True),
    }


def frames_per_second(shot: ShotResult, width: int) -> float:
    """Returns the frames per second of a film with frames of `width` pixels, including the canvas."""
    recording = shot.recording()
    begin = perf_counter()
    frames = sum(1 for frame in Canvas(recording.scene, width).film(recording, 30) if len(pixels(frame)))
    return frames / (perf_counter() - begin)


def step_seconds(env: gym.Env[Any, Any]) -> float:
    """Returns the seconds per step, without resets."""
    actions = np.random.default_rng(0).uniform(-1, 1, (STEPS, 2)).astype(np.float32)
    total = 0.0
    for k, action in enumerate(actions):
        env.reset(seed=k)
        begin = perf_counter()
        env.step(action)
        total += perf_counter() - begin
    return total / STEPS


def measure(repeats: int) -> dict[str, list[float]]:
    """Returns the results of each case, one per pass."""
    found: dict[str, list[float]] = {}
    recorded = shots()
    envs = {mode: gym.make("Billiards-v0", render_mode=mode) for mode in (None, "rgb_array")}
    for _ in range(repeats):
        for name, shot in recorded.items():
            for width in (800, 1600):
                found.setdefault(f"{name}, {width} px: frames/s", []).append(frames_per_second(shot, width))
        for mode, env in envs.items():
            found.setdefault(STEP.format(mode), []).append(1e6 * step_seconds(env))
    return found


def blocks(result: dict[str, Any]) -> dict[str, str]:
    """Returns the results as Markdown, by name."""
    values = result["values"]
    ratios = np.divide(values[STEP.format("rgb_array")], values[STEP.format(None)])
    return {
        "machine": machine_line(result["machine"]),
        "figures": table(("what", "median"), [(name, f"{value:,.0f}") for name, value in result["medians"].items()]),
        "cost": "If nothing is rendered, a step with a render mode takes "
        f"{statistics.median(ratios.tolist()):.1f} times as long as a step without one.",
    }


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m benchmarks.rendering --help`."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.rendering", description="Measure the drawing.")
    parser.add_argument("--repeats", type=int, default=15, help="number of passes (default: 15)")
    parser.add_argument("--output", type=Path, default=RESULTS / "rendering.json", help="JSON file")
    args = parser.parse_args(arguments)
    check_counts(parser, args, repeats=1)
    on = machine()
    found = measure(args.repeats)
    medians = {name: statistics.median(values) for name, values in found.items()}
    result = {"machine": on, "medians": medians, "values": found}
    write_json(args.output, result)

    print_blocks(blocks(result))
    print(f"\nWritten to {args.output}.")


if __name__ == "__main__":
    main()
