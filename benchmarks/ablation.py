"""The worth of each saving of the engine: `python -m benchmarks.ablation`.

Each variant is a copy of the package in which a few lines are replaced, so the engine itself needs no switches. Every
variant is a process; all of them run the same shots in turn. The table has the median, over the passes, of the time
without a saving over the time with all savings. Times are processor times, which other load on the machine affects
less.
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import hashlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from time import thread_time
from typing import Any

import numpy as np

from benchmarks import RESULTS, check_counts, machine, machine_line, print_blocks, table
from benchmarks.speed import cases, run, summary
from billiards_env.files import write_json
from billiards_env.simulation import simulate_batch

ROOT = Path(__file__).resolve().parent.parent


@dataclasses.dataclass(frozen=True, slots=True)
class Saving:
    """A saving of the engine.

    Attributes:
        name: Its name in the table.
        edits: Replacements (file in the package, old text, new text) that remove it.
    """

    name: str
    edits: tuple[tuple[str, str, str], ...]


JIT, ALL_PAIRS, PREDICTIONS = "physics/jit.py", "engine/all_pairs.py", "engine/predictions.py"
CONTACT, WALLS = "physics/contact.py", "physics/walls.py"
SAVINGS = (
    Saving("borrowed arrays", ((JIT, "_nrt=False", "_nrt=True"),)),
    Saving("inlining", ((JIT, "forceinline=True", "forceinline=False"),)),
    Saving(
        "out of reach, not solved",
        (
            (PREDICTIONS, "    dd = dx * dx + dy * dy\n", "    return False\n"),  # in `cannot_meet`
            (CONTACT, "    side = abs(path.x * path.vy", "    return False\n    side = abs(path.x * path.vy"),
            (WALLS, "return abs(x) < room and", "return False and abs(x) < room and"),
            (WALLS, "if abs(path.x) <= room_x", "if False and abs(path.x) <= room_x"),
            (WALLS, "if gap > (1.0 + MARGIN)", "if False and gap > (1.0 + MARGIN)"),
        ),
    ),
    Saving("several balls at once", ((ALL_PAIRS, "MANY = 8\n", "MANY = 1_000_000\n"),)),
    Saving(
        "nearest of each row",
        (
            (
                ALL_PAIRS,
                "        nearest = Time(queue.nearest_hi[i]",
                "        _find_nearest(i, queue)\n        nearest = Time(queue.nearest_hi[i]",
            ),
        ),
    ),
)


def edited(saving: Saving, package: Path) -> dict[Path, str]:
    """Returns the files of a package without a saving: their paths and their new texts.

    Raises:
        RuntimeError: If a file does not contain the text of an edit.
    """
    texts: dict[Path, str] = {}
    for name, old, new in saving.edits:
        path = package / name
        text = texts.get(path) or path.read_text(encoding="utf-8")
        if old not in text:
            raise RuntimeError(f"{name}, without {saving.name}: expected the text {old!r}")
        texts[path] = text.replace(old, new)
    return texts


class Variant:
    """A process that runs shots with a copy of the package.

    Args:
        folder: The folder of the copy.
        scale: Factor on the number of shots of a pass.
    """

    def __init__(self, folder: Path, scale: float) -> None:
        paths = os.pathsep.join((str(folder), str(ROOT)))
        env = {**os.environ, "PYTHONPATH": paths, "NUMBA_CACHE_DIR": str(folder / "cache")}
        command = [sys.executable, "-m", "benchmarks.ablation", "--worker", str(scale)]
        self._process = subprocess.Popen(
            command, cwd=folder, env=env, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    def digests(self) -> list[str]:
        """Waits until all shots have run once. Returns a digest of the results of each case."""
        return self._read()

    def seconds(self, case: int) -> float:
        """Returns the processor time of a pass over the shots of a case."""
        assert self._process.stdin is not None
        print(case, file=self._process.stdin, flush=True)
        return self._read()

    def _read(self) -> Any:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            raise RuntimeError(f"a worker ended with status {self._process.wait()}")
        return json.loads(line)

    def stop(self) -> None:
        """Ends the process."""
        self._process.kill()
        self._process.communicate()


def work(scale: float) -> None:
    """Runs shots on request: the loop of the process of a `Variant`."""
    every = cases(scale)
    digests = []
    for case in every:
        result = simulate_batch(case.scene, case.positions, case.velocities, threads=1)
        arrays = (result.positions, result.velocities, result.spins, result.time, result.n_events)
        digests.append(hashlib.sha256(b"".join(np.ascontiguousarray(array).tobytes() for array in arrays)).hexdigest())
    print(json.dumps(digests), flush=True)
    for line in sys.stdin:
        begin = thread_time()
        run(every[int(line)], 1)
        print(json.dumps(thread_time() - begin), flush=True)


@contextlib.contextmanager
def variants(scale: float) -> Iterator[list[Variant]]:
    """Starts the engine with all savings, and without each of them.

    Raises:
        RuntimeError: If the package does not contain the text of an edit.
    """
    with tempfile.TemporaryDirectory() as temporary, contextlib.ExitStack() as stack:
        folders = []
        for k, saving in enumerate([Saving("none", ()), *SAVINGS]):
            package = Path(temporary, str(k), "billiards_env")
            shutil.copytree(ROOT / "billiards_env", package, ignore=shutil.ignore_patterns("__pycache__"))
            for path, text in edited(saving, package).items():
                path.write_text(text, encoding="utf-8")
            folders.append(package.parent)
        started = []
        for folder in folders:  # no process starts before all edits are made
            started.append(Variant(folder, scale))
            stack.callback(started[-1].stop)
        yield started


def measure(repeats: int, scale: float = 0.02) -> dict[str, Any]:
    """Compiles the variants and runs all cases `repeats` times with each.

    Args:
        repeats: Number of passes over the cases.
        scale: Factor on the number of shots in a pass of `benchmarks.speed`.

    Returns:
        `cases`: their names; `microseconds_per_shot` with all savings, a summary for each case; `savings`: for each one
        its name and `ratios`, a summary for each case of the time without it over the time with all.

    Raises:
        RuntimeError: If a variant has other results.
    """
    on = machine()
    every = cases(scale)
    with variants(scale) as engines:
        results = [engine.digests() for engine in engines]
        for saving, result in zip(SAVINGS, results[1:], strict=True):
            if result != results[0]:
                raise RuntimeError(f"without {saving.name}: other results than with it")
        seconds = np.array(
            [[[engine.seconds(k) for k in range(len(every))] for engine in engines] for _ in range(repeats)]
        )
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
    """Returns the results as Markdown, by name."""
    rows = [("all savings, us/shot", *(f"{row['median']:.2f}" for row in result["microseconds_per_shot"]))]
    rows += [(row["name"], *(f"{ratio['median']:.2f}" for ratio in row["ratios"])) for row in result["savings"]]
    return {
        "machine": machine_line(result["machine"]),
        "how": "The time of a shot without a saving, divided by the time with all savings; medians of "
        f"{result['repeats']} interleaved passes.",
        "savings": table(("without", *result["cases"]), rows),
    }


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m benchmarks.ablation --help`."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.ablation", description="Measure the worth of each saving of the engine."
    )
    parser.add_argument("--repeats", type=int, default=31, help="passes over the cases (default: 31)")
    parser.add_argument("--scale", type=float, default=0.02, help="factor on the shots of a pass (default: 0.02)")
    parser.add_argument("--output", type=Path, default=RESULTS / "ablation.json", help="JSON file")
    parser.add_argument("--worker", type=float, help=argparse.SUPPRESS)
    args = parser.parse_args(arguments)
    if args.worker is not None:
        work(args.worker)
        return
    check_counts(parser, args, repeats=1)
    if not 0 < args.scale <= 100:
        parser.error(f"--scale = {args.scale}: expected a number in (0, 100]")
    result = measure(args.repeats, args.scale)
    write_json(args.output, result)

    print_blocks(blocks(result))
    print(f"\nWritten to {args.output}.")


if __name__ == "__main__":
    main()
