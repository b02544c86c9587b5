"""The time from the start of a process to the first shot: `python -m benchmarks.start_up`.

Every measurement uses a new process. "compiling" starts with an empty cache of numba; "compiled before" starts with the
cache of an earlier process. Medians are reported; the JSON also has the single values.
"""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path
from time import time
from typing import Any

from benchmarks import Count, machine, machine_line, parser_of, report, table

ROOT = Path(__file__).resolve().parent.parent

# Wall-clock times, because the first time is read by the parent process before it starts the process.
IMPORTS = """
import json, time
times = [time.time()]
import gymnasium, numba
times.append(time.time())
import billiards_env
times.append(time.time())
from billiards_env import simulate
times.append(time.time())
print(json.dumps(times))
"""
FIRST_STEP = """
import json, time
times = [time.time()]
import gymnasium
import billiards_env
env = gymnasium.make("Billiards-v0")
env.reset(seed=0)
times.append(time.time())
env.step(env.action_space.sample())
times.append(time.time())
print(json.dumps(times))
"""


def run(code: str, cache: Path) -> list[float]:
    """Runs `code` in a new process with numba's cache in `cache`; returns its start and the printed times, s."""
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(cache)}
    begin = time()
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, env=environment, check=True, stdout=subprocess.PIPE, text=True
    )
    return [begin, *json.loads(done.stdout)]


def measure(repeats: int, compilations: int) -> dict[str, Any]:
    """Starts the processes, `compilations` of them with an empty cache; the kinds take turns.

    Returns:
        `seconds`, a list for each measured quantity, and `median_seconds`.
    """
    on, seconds = (
        machine(),
        {
            "import gymnasium, numba": [],
            "import billiards_env, on top": [],
            "load the engine, on top": [],
            "first env.step, compiling": [],
            "first env.step, compiled before": [],
            "process start to first env.step done, compiling": [],
            "process start to first env.step done, compiled before": [],
        },
    )

    def first_step(cache: Path, how: str) -> None:
        begin, _, made, stepped = run(FIRST_STEP, cache)
        seconds[f"first env.step, {how}"].append(stepped - made)
        seconds[f"process start to first env.step done, {how}"].append(stepped - begin)

    with tempfile.TemporaryDirectory() as folder:
        for k in range(compilations):
            first_step(Path(folder) / str(k), "compiling")
        full = Path(folder) / "0"
        for _ in range(repeats):
            _, start, others, package, engine = run(IMPORTS, full)
            seconds["import gymnasium, numba"].append(others - start)
            seconds["import billiards_env, on top"].append(package - others)
            seconds["load the engine, on top"].append(engine - package)
            first_step(full, "compiled before")
    medians = {name: statistics.median(values) for name, values in seconds.items()}
    return {"machine": on, "median_seconds": medians, "seconds": seconds}


def blocks(result: dict[str, Any]) -> dict[str, str]:
    """Returns the results as Markdown, by name."""
    count = {name: len(values) for name, values in result["seconds"].items()}
    rows = [(name, f"{value:.2f}", f"{count[name]}") for name, value in result["median_seconds"].items()]
    return {
        "machine": machine_line(result["machine"]),
        "how": "Times are medians; the last column is the number of starts.",
        "times": table(("what", "s", "starts"), rows),
    }


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m benchmarks.start_up --help`."""
    repeats, compilations = Count(9, "starts of each kind"), Count(3, "starts with an empty cache")
    parser = parser_of("start_up", "Measure the time to the first shot.", repeats=repeats, compilations=compilations)
    args = parser.parse_args(arguments)
    report(measure(args.repeats, args.compilations), blocks, args.output)


if __name__ == "__main__":
    main()
