"""How fast frames are drawn, and what a render mode costs that nobody looks at: `python -m benchmarks.rendering`.

Medians over the repeats, the cases in turn. Frames are counted with their copy into an array.
"""

from __future__ import annotations

import argparse
import statistics
from pathlib import Path
from time import perf_counter
from typing import Any

import gymnasium as gym
import numpy as np

from benchmarks import RESULTS, machine, machine_line, print_blocks, table
from billiards_env import layouts
from billiards_env.drawing.canvas import Canvas, pixels
from billiards_env.files import write_json
from billiards_env.scene import Scene
from billiards_env.shot import ShotResult
from billiards_env.simulation import simulate

STEPS = 200
STEP = "env.step, render_mode={!r}, never rendered: us"


def shots() -> dict[str, ShotResult]:
    """A shot at one object ball, and a break."""
    rng = np.random.default_rng(0)
    one, rack = Scene.named("pool"), Scene.named("pool", 15)
    places = layouts.draw("rack", rack, rng)
    toward = (places[1] - places[0]) / np.hypot(*(places[1] - places[0]))
    return {
        "pool, 1 object ball": simulate(one, [[-0.635, 0.0], [0.635, 0.3]], [2.0, 0.45], record=True),
        "15-ball break": simulate(rack, places, 8 * toward, record=True),
    }


def frames_per_second(shot: ShotResult, width: int) -> float:
    """Of the film of a shot in frames of `width` pixels, the canvas included."""
    recording = shot.recording()
    begin = perf_counter()
    frames = sum(1 for frame in Canvas(recording.scene, width).film(recording, 30) if len(pixels(frame)))
    return frames / (perf_counter() - begin)


def step_seconds(env: gym.Env[Any, Any]) -> float:
    """Of one step, resets not counted."""
    actions = np.random.default_rng(0).uniform(-1, 1, (STEPS, 2)).astype(np.float32)
    total = 0.0
    for k, action in enumerate(actions):
        env.reset(seed=k)
        begin = perf_counter()
        env.step(action)
        total += perf_counter() - begin
    return total / STEPS


def measure(repeats: int) -> dict[str, list[float]]:
    """The figures of each case, one a repeat."""
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
    """What was measured as Markdown, by name."""
    values = result["values"]
    ratios = np.divide(values[STEP.format("rgb_array")], values[STEP.format(None)])
    return {
        "machine": machine_line(result["machine"]),
        "figures": table(("what", "median"), [(name, f"{value:,.0f}") for name, value in result["medians"].items()]),
        "cost": "If nothing is rendered, a step with a render mode takes "
        f"{statistics.median(ratios.tolist()):.1f} times as long as a step without one.",
    }


def main(arguments: list[str] | None = None) -> None:
    """The command line; see `python -m benchmarks.rendering --help`."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.rendering", description="Measure the drawing.")
    parser.add_argument("--repeats", type=int, default=15, help="of each measurement (default: 15)")
    parser.add_argument("--output", type=Path, default=RESULTS / "rendering.json", help="where the JSON goes")
    args = parser.parse_args(arguments)
    if args.repeats < 1:
        parser.error(f"--repeats = {args.repeats}: expected a whole number >= 1")
    on = machine()
    found = measure(args.repeats)
    medians = {name: statistics.median(values) for name, values in found.items()}
    result = {"machine": on, "medians": medians, "values": found}
    write_json(args.output, result)

    print_blocks(blocks(result))
    print(f"\nWritten to {args.output}.")


if __name__ == "__main__":
    main()
