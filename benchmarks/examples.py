"""Steps per second of the programs in `examples`: `python -m benchmarks.examples`.

Each program runs a few steps, which load its packages and the engine, and then a larger number, which is measured.
Everything runs on one thread of PyTorch. A program whose package is not installed keeps its former measurement: no
environment has all packages, because RLlib needs its own.
"""

from __future__ import annotations

import contextlib
import importlib
import io
import json
import logging
import time
import warnings
from collections.abc import Mapping
from typing import Any

from benchmarks import Count, machine, machine_line, parser_of, report, table

STEPS = {
    "sb3_ppo": ("PPO of Stable-Baselines3 on 1,024 tables, with training", 8192, {"logs": None}),
    "optuna_sweep": ("Optuna: two trials of this PPO, with their evaluation", 8192, {}),
    "torchrl_collector": ("TorchRL: collector of random shots on 64 tables", 16384, {}),
    "pixels": ("one table, observation of 84 x 84 pixels", 256, {}),
    "rllib_ppo": ("PPO of RLlib with its own runner on 256 tables, with training", 16384, {}),
    "self_play": ("PettingZoo: straight pool against a frozen copy, with training", 4096, {}),
    "dataset_cloning": ("Minari: shots of the geometric player, written and cloned", 5000, {}),
}
"""By the name of a program: what runs, the number of steps, and arguments of its function `run`."""


def measure(scale: int, before: Mapping[str, Any]) -> dict[str, Any]:
    """Returns the steps per second of each program.

    Args:
        scale: Divisor of the numbers of steps.
        before: A former result of this function. It has the numbers of programs without their package here, or None.
    """
    former = {row["example"]: row["per_second"] for row in before.get("rows", ())}
    importlib.import_module("torch").set_num_threads(1)
    on, rows, made = machine(), [], {}
    logging.disable(logging.INFO)
    for name, (what, steps, options) in STEPS.items():
        per_second = former.get(name)
        with contextlib.suppress(ModuleNotFoundError), contextlib.redirect_stdout(io.StringIO()):
            program = importlib.import_module(f"examples.{name}")
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                program.run(max(steps // 8 // scale, 1), **options)
                begin = time.perf_counter()
                made[name] = program.run(steps // scale, **options)
            per_second = steps // scale / (time.perf_counter() - begin)
        rows.append({"example": name, "what": what, "per_second": per_second})
    logging.disable(logging.NOTSET)
    return {
        "machine": on,
        "rows": rows,
        "clone_and_teacher": made.get("dataset_cloning", before.get("clone_and_teacher")),
    }


def blocks(result: dict[str, Any]) -> dict[str, str]:
    """Returns the results as Markdown, by name."""
    rows = [
        (f"`examples/{row['example']}.py`", row["what"], f"{row['per_second']:,.0f}" if row["per_second"] else "-")
        for row in result["rows"]
    ]
    clone, teacher = (f"{share:.1%}" if share else "-" for share in result["clone_and_teacher"] or (None, None))
    return {
        "cloning": f"The clone pots the ball on {clone} of 1,000 new layouts, its teacher on {teacher}.",
        "machine": machine_line(result["machine"]),
        "steps": table(("program", "what runs", "steps/s"), rows, left=2),
    }


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m benchmarks.examples --help`."""
    scale = Count(1, "divisor of the numbers of steps")
    args = parser_of("examples", "Measure the programs in examples.", scale=scale).parse_args(arguments)
    before = json.loads(args.output.read_text(encoding="utf-8")) if args.output.exists() else {}
    report(measure(args.scale, before), blocks, args.output)


if __name__ == "__main__":
    main()
