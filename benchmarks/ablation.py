"""What the parts of a scene cost, and what a scene without them pays: `python -m benchmarks.ablation`.

Each row is a process with an empty cache of numba. It imports what it needs and plays its shots once, which
compiles the engine. Then it plays them again in each of its turns. The rows take turns, so other load on the
machine affects all of them equally. A row is compared with the row of the same shots without the part.
"""

from __future__ import annotations

import functools
import os
import statistics
import sys
import tempfile
from collections.abc import Callable
from contextlib import AbstractContextManager, ExitStack
from pathlib import Path
from typing import Any, NamedTuple

from benchmarks import ROOT, in_turns, machine, ratio, run_command, table, worker
from billiards_env.commands import Job

SHOTS = 1000  # in a pass


class Row(NamedTuple):
    """A part of a scene.

    Attributes:
        name: What the scene uses.
        without: The name of the row without it; "" for none.
        code: Python that defines `play`, which plays `SHOTS` shots.
    """

    name: str
    without: str
    code: str


def _batch(name: str, without: str, after: str = "", record: bool = False, **changes: Any) -> Row:
    """Returns the row of a batch of shots in the scene "pool" with changes; `after` is code to run after the batch."""
    code = f"""
import numpy as np
from billiards_env import Scene, simulate_batch
rng = np.random.default_rng(0)
scene = Scene.from_dict({{"base": "pool", "balls": {{"radius": [0.028575] * 2, "mass": [0.17] * 2}}, **{changes!r}}})
positions = np.stack((rng.uniform((-1.1, -0.5), (-0.1, 0.5), ({SHOTS}, 2)),
                      rng.uniform((0.1, -0.5), (1.1, 0.5), ({SHOTS}, 2))), axis=1)
velocities = rng.normal(0.0, 1.5, ({SHOTS}, 2))
def play():
    batch = simulate_batch(scene, positions, velocities, threads=1, record={record})
    {after}
"""
    return Row(name, without, code)


def _steps(name: str, without: str, **arguments: Any) -> Row:
    """Returns the row of a step of the vector environment."""
    code = f"""
import numpy as np
from billiards_env.commands import ending
import billiards_env
envs = gymnasium.make_vec("Billiards-v0", num_envs={SHOTS}, threads=1, **{arguments!r})
envs.reset(seed=0)
actions = np.random.default_rng(0).uniform(-1, 1, envs.action_space.shape).astype(np.float32)
def play():
    envs.step(actions)
"""
    return Row(name, without, code)


_RULES = {"n_object_balls": 9, "layout": "nine_ball", "max_shots": 1}

_GRADIENT = "from billiards_env.derivatives import vjp; vjp(batch, {'positions': np.ones((len(batch), 2, 2))})"

ROWS = (
    _batch("a shot that uses nothing", "", physics={"motion": "rolling", "cushion": "restitution"}),
    _batch("sliding and spin", "a shot that uses nothing", physics={"cushion": "restitution"}),
    _batch("cushions with friction", "sliding and spin"),
    _batch("throw", "cushions with friction", physics={"ball_ball": "frictional"}),
    _batch("jaws", "cushions with friction", table="pool_9ft"),
    _batch("flights", "cushions with friction", physics={"flight": True}),
    _batch("recording", "cushions with friction", record=True),
    _batch("derivatives", "recording", _GRADIENT, record=True),
    _steps("a step that uses nothing", ""),
    _steps("strikes", "a step that uses nothing", action="strike"),
    _steps("noise", "a step that uses nothing", noise={}),
    _steps("scatter of cushions", "a step that uses nothing", scatter={}),
    _steps("randomised physics", "a step that uses nothing", randomize={"mu_roll": (0.008, 0.015)}),
    _steps("a rack of nine balls", "", task="clear", **_RULES),
    _steps("rules of nine ball", "a rack of nine balls", task="nine_ball", **_RULES),
)
"""The rows, each after the row that it is compared with."""

_SERVE = """
import gc, json, sys, time
import gymnasium, numba
begin = time.perf_counter()
{code}
ready = time.perf_counter()
play()
played = time.perf_counter()
kinds = numba.core.dispatcher.Dispatcher
compiled = [f.py_func for f in gc.get_objects() if isinstance(f, kinds) and f.signatures]
functions = sorted({{f"{{f.__module__}}.{{f.__name__}}" for f in compiled if f.__module__.startswith("billiards_env")}})
modules = sorted(name for name in sys.modules if name.startswith("billiards_env"))
seconds = {{"start": ready - begin, "compile": played - ready}}
print(json.dumps({{"seconds": seconds, "modules": modules, "functions": functions}}), flush=True)
for _ in sys.stdin:
    begin = time.perf_counter()
    play()
    print(time.perf_counter() - begin, flush=True)
"""


def started(row: Row, cache: str | Path) -> AbstractContextManager[Callable[..., Any]]:
    """Starts the process of a row, with the folder of its cache; see `worker`.

    The first answer holds what the row imports and compiles. The others are durations of passes, s.
    """
    environment = os.environ | {"NUMBA_CACHE_DIR": str(cache), "BILLIARDS_ENV_COMPILE": "1"}
    return worker(row.name, [sys.executable, "-c", _SERVE.format(code=row.code)], cwd=ROOT, env=environment)


def measure(repeats: int, job: Job, rows: tuple[Row, ...] = ROWS) -> dict[str, Any]:
    """Starts the process of each row, one after the other, and plays `repeats` passes in turn.

    Returns:
        `rows`: a list with one entry for each row: its `name`, the name of the row `without` it, the `seconds` of its
        start and of its first pass, which compiles, the `modules` and `functions` of the package that it imports and
        compiles, and `passes`, the durations of the later passes, s. Each row is a job.
    """
    on = machine()
    with ExitStack() as stack:
        folder = stack.enter_context(tempfile.TemporaryDirectory())
        calls, starts = dict[str, Callable[[], float]](), dict[str, dict[str, Any]]()
        for k, row in enumerate(rows):
            with job(row.name):
                ask = stack.enter_context(started(row, Path(folder) / str(k)))
                starts[row.name] = {"name": row.name, "without": row.without, **ask()}
                calls[row.name] = functools.partial(ask, "play")
        entries = [{**starts[name], "passes": passes} for name, passes in in_turns(calls, repeats, job).items()]
    return {"machine": on, "shots": SHOTS, "repeats": repeats, "rows": entries}


def blocks(result: dict[str, Any]) -> dict[str, str]:
    """Returns the results as Markdown, by name."""
    rows, by_name = [], {row["name"]: row for row in result["rows"]}
    for row in result["rows"]:
        us, compiling = 1e6 * statistics.median(row["passes"]) / result["shots"], row["seconds"]["compile"]
        times, slower, counts = "", "", [f"{len(row[key])}" for key in ("functions", "modules")]
        if row["without"]:
            counts = ["", ""]
        if other := by_name.get(row["without"]):
            times = ratio(statistics.median(a / b for a, b in zip(row["passes"], other["passes"], strict=True)))
            slower = ratio(compiling / other["seconds"]["compile"])
            counts = [f"+{len(set(row[key]) - set(other[key]))}" for key in ("functions", "modules")]
        start = f"{1000 * row['seconds']['start']:.0f}"
        rows.append((row["name"], row["without"], f"{us:.2f}", times, f"{compiling:.1f}", slower, start, *counts))
    head = ("scene with", "beside", "us/shot", "times", "compile, s", "times", "start, ms", "functions", "modules")
    return {
        "how": f"A pass has {result['shots']:,} shots. Times of a shot are medians of {result['repeats']} interleaved "
        "passes on one core.",
        "parts": table(head, rows, left=2),
    }


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m benchmarks.ablation --help`."""
    about, repeats = "Measure what the parts of a scene cost.", (31, "number of passes")
    run_command("benchmarks.ablation", about, arguments, measure, blocks, {"repeats": repeats}, jobs=True)


if __name__ == "__main__":
    main()
