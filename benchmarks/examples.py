"""Steps per second of the programs in `examples`: `python -m benchmarks.examples`.

Each program runs a few steps, which load its packages and the engine, and then a larger number, which is measured.
Everything runs on one thread of PyTorch. A program whose package is not installed is left out.
"""

from __future__ import annotations

import contextlib
import importlib
import io
import logging
import time
import warnings
from typing import Any

from benchmarks import Count, machine, machine_line, parser_of, report, table

STEPS = {
    "sb3_ppo": ("PPO of Stable-Baselines3 on 64 tables, with training", 8192, {"logs": None}),
    "optuna_sweep": ("Optuna: two trials of this PPO, with their evaluation", 8192, {}),
    "torchrl_collector": ("TorchRL: collector of random shots on 64 tables", 16384, {}),
    "pixels": ("one table, observation of 84 x 84 pixels", 256, {}),
    "self_play": ("PettingZoo: straight pool against a frozen copy, with training", 4096, {}),
    "dataset_cloning": ("Minari: shots of the geometric player, written and cloned", 5000, {}),
}
"""By the name of a program: what runs, the number of steps, and arguments of its function `run`."""


def measure(scale: int) -> dict[str, Any]:
    """Returns the steps per second of each program, or None without its package. `scale` divides the steps."""
    importlib.import_module("torch").set_num_threads(1)
    on, rows, made = machine(), [], {}
    logging.disable(logging.INFO)
    for name, (what, steps, options) in STEPS.items():
        per_second = None
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
    return {"machine": on, "rows": rows, "clone_and_teacher": made.get("dataset_cloning")}


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
    report(measure(args.scale), blocks, args.output)


if __name__ == "__main__":
    main()
