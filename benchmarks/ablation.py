"""What each saving of the engine is worth: `python -m benchmarks.ablation`.

The engine is compiled anew with one saving off at a time, really without it: the savings are constants of the kernels'
modules. All variants then run the same shots in turn, over and over, in one process; the table gives the median of the
ratios of their times to the whole engine's in the same pass. Times are the thread's own processor time: a pass takes
milliseconds, and what else a busy machine runs in between must not count.
"""

from __future__ import annotations

import argparse
import importlib
import sys
from collections.abc import Callable
from pathlib import Path
from time import thread_time
from typing import Any, NamedTuple

import numpy as np

from benchmarks import RESULTS, machine, machine_line, print_blocks, table
from benchmarks.speed import Case, cases, summary
from billiards_env.engine.inputs import check_shot
from billiards_env.engine.log import empty_log
from billiards_env.engine.modes import MAX_EVENTS, scene_arrays
from billiards_env.files import write_json
from billiards_env.physics import jit

RunShots = Callable[..., None]
_REMADE = "billiards_env.engine", "billiards_env.physics"


class Saving(NamedTuple):
    """A saving, what the table calls it, and the constant that turns it off.

    Attributes:
        name: What the table calls it.
        module: Where it is.
        constant: Its name there.
        same_bits: Whether every result stays the same without it.
    """

    name: str
    module: str
    constant: str
    same_bits: bool = True


SAVINGS = (
    Saving("borrowed arrays", "billiards_env.physics.jit", "BORROW"),
    Saving("inlining", "billiards_env.physics.jit", "INLINE"),
    Saving("out of reach, not solved", "billiards_env.engine.queue", "SKIP"),
    Saving("several balls at once", "billiards_env.engine.queue", "SIDE_BY_SIDE"),
    Saving("nearest of each row", "billiards_env.engine.queue", "ROWS"),
)


def engine_without(saving: Saving | None) -> RunShots:
    """`run_shots` of PIC, to be compiled at its first call, without a saving; None for all of them."""
    own = {name: module for name, module in sys.modules.items() if name.startswith(_REMADE) and module is not jit}
    package: Any = sys.modules["billiards_env"]
    parts = package.engine, package.physics
    for name in own:
        del sys.modules[name]
    try:
        if saving is not None and saving.module == jit.__name__:
            setattr(jit, saving.constant, False)
        pic = importlib.import_module("billiards_env.engine.pic")
        if saving is not None and saving.module != jit.__name__:
            setattr(sys.modules[saving.module], saving.constant, False)
        return jit.allocating(pic.run_shots.py_func)
    finally:
        if saving is not None and saving.module == jit.__name__:
            setattr(jit, saving.constant, True)
        sys.modules.update(own)
        package.engine, package.physics = parts


def run(engine: RunShots, case: Case) -> tuple[float, tuple[Any, ...]]:
    """The processor time an engine takes for a case's shots, s, and what it gives back."""
    given = check_shot(case.scene, case.positions, case.velocities, None, None, None)
    m, n = given.positions.shape[:2]
    out = np.zeros(m), np.zeros((m, n, 2), np.int32), np.zeros((m, N_COUNTS), np.int64)
    arrays, shots, log = tuple(scene_arrays(case.scene)), (*given[:4], *out), tuple(empty_log())
    begin = thread_time()
    engine(0, m, arrays, given.limit, MAX_EVENTS, shots, log)
    return thread_time() - begin, (*given[:4], *out)


def measure(repeats: int, scale: float = 0.02) -> dict[str, Any]:
    """Compiles the variants and runs all cases `repeats` times with each.

    Args:
        repeats: Number of passes over the cases.
        scale: Factor on the number of shots in a pass of `benchmarks.speed`.

    Returns:
        `cases`: their names; `microseconds_per_shot`: the whole engine's, a summary a case; `savings`: of each its name
        and `ratios`, a summary of the time without it over the time with it for each case.

    Raises:
        RuntimeError: If a variant gives other bits, where it should not.
    """
    on = machine()
    every = cases(scale)
    engines = [engine_without(None), *(engine_without(saving) for saving in SAVINGS)]
    for case in every:
        results = [run(engine, case)[1] for engine in engines]
        for saving, result in zip(SAVINGS, results[1:], strict=True):
            if saving.same_bits and not all(map(np.array_equal, results[0], result)):
                raise RuntimeError(f"{case.name} without {saving.name}: other results than with it")
    seconds = np.array([[[run(e, case)[0] for case in every] for e in engines] for _ in range(repeats)])
    shots = np.array([len(case.positions) for case in every])
    ratios = seconds[:, 1:] / seconds[:, :1]
    return {
        "machine": on,
        "repeats": repeats,
        "cases": [case.name for case in every],
        "microseconds_per_shot": [summary((1e6 * s / m).tolist()) for s, m in zip(seconds[:, 0].T, shots, strict=True)],
        "savings": [
            {"name": saving.name, "ratios": [summary(column.tolist()) for column in ratios[:, k].T]}
            for k, saving in enumerate(SAVINGS)
        ],
    }


def blocks(result: dict[str, Any]) -> dict[str, str]:
    """What was measured as Markdown, by name."""
    rows = [("all on, us/shot", *(f"{row['median']:.2f}" for row in result["microseconds_per_shot"]))]
    rows += [(row["name"], *(f"{ratio['median']:.2f}" for ratio in row["ratios"])) for row in result["savings"]]
    return {
        "machine": machine_line(result["machine"]),
        "how": "Processor time without the optimization divided by the time with it; medians of "
        f"{result['repeats']} interleaved passes.",
        "savings": table(("without", *result["cases"]), rows),
    }


def main(arguments: list[str] | None = None) -> None:
    """The command line; see `python -m benchmarks.ablation --help`."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.ablation", description="Measure what each saving saves."
    )
    parser.add_argument("--repeats", type=int, default=31, help="passes over the cases (default: 31)")
    parser.add_argument("--scale", type=float, default=0.02, help="factor on the shots of a pass (default: 0.02)")
    parser.add_argument("--output", type=Path, default=RESULTS / "ablation.json", help="where the JSON goes")
    args = parser.parse_args(arguments)
    if args.repeats < 1:
        parser.error(f"--repeats = {args.repeats}: expected a whole number >= 1")
    if not 0 < args.scale <= 100:
        parser.error(f"--scale = {args.scale}: expected a number in (0, 100]")
    result = measure(args.repeats, args.scale)
    write_json(args.output, result)

    print_blocks(blocks(result))
    print(f"\nWritten to {args.output}.")


if __name__ == "__main__":
    main()
