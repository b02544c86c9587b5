"""Measurements of the engine: each module prints tables and writes its results to `benchmarks/results` as JSON.

The function `blocks` of a module converts the results to Markdown blocks by name. The module prints these blocks, and
`studies.readme` writes them into the README and the pages in `docs`.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib.metadata
import io
import itertools
import os
import platform
import signal
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from multiprocessing.context import BaseContext
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from tqdm import tqdm

from billiards_env.checks import Range, integer
from billiards_env.files import write_json, write_whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure

RESULTS = Path(__file__).resolve().parent / "results"
IMAGES = RESULTS.parents[1] / "docs" / "images"

GREY = "#808080"
"""The colour of text in pictures without a background: readable on a light and on a dark page."""


def machine() -> dict[str, str | int | float | None]:
    """Returns the processor, the number of cores, the load, and the versions of Python and of packages."""
    load = round(os.getloadavg()[0], 1) if hasattr(os, "getloadavg") else None  # Windows has none
    return {
        "cpu": _cpu_model(),
        "cores": os.cpu_count() or 1,
        "load_average": load,
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        **{name: importlib.metadata.version(name) for name in ("numba", "numpy", "gymnasium")},
    }


def machine_line(m: Mapping[str, object]) -> str:
    """Returns the values of `machine()` in one line."""
    versions = ", ".join(f"{name} {m[name]}" for name in ("python", "numba", "numpy", "gymnasium"))
    return f"Machine: {m['cpu']}, {m['cores']} cores, load {m['load_average']}, {m['system']}; {versions}"


def table(head: Sequence[str], rows: Sequence[Sequence[str]], left: int = 1) -> str:
    """Returns a Markdown table; the first `left` columns are left-aligned and the others right-aligned."""
    widths = [max(len(row[k]) for row in (head, *rows)) for k in range(len(head))]
    rule = ["-" * w if k < left else "-" * (w - 1) + ":" for k, w in enumerate(widths)]
    lines = []
    for row in (head, rule, *rows):
        cells = [
            cell.ljust(w) if k < left else cell.rjust(w) for k, (cell, w) in enumerate(zip(row, widths, strict=True))
        ]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def use_own_font() -> None:
    """Selects the font that is part of matplotlib, so that pictures are the same on every machine."""
    import matplotlib

    matplotlib.rcParams["font.family"] = "DejaVu Sans"


def save(figure: Figure, path: Path) -> None:
    """Writes a figure of matplotlib as PNG, completely or not at all.

    The file has no date, so equal figures give equal files. A palette of 256 colours reduces the size to a third. The
    background of a figure with the colour "none" is transparent.
    """
    from matplotlib.colors import to_rgba
    from PIL import Image  # a dependency of matplotlib

    buffer, small = io.BytesIO(), io.BytesIO()
    figure.savefig(buffer, format="png", metadata={"Software": None})
    clear = to_rgba(figure.get_facecolor())[3] < 1
    image = Image.open(buffer).convert("RGBA" if clear else "RGB")
    method = Image.Quantize.FASTOCTREE if clear else None  # the only method that keeps opacity
    image.quantize(256, method=method, dither=Image.Dither.NONE).save(small, format="png", optimize=True)
    write_whole(path, small.getvalue())


def metres(error: float | None) -> str:
    """Returns the text of an error, m; empty for None."""
    return "" if error is None else f"{error:.1e} m"


def ratio(value: float) -> str:
    """Returns the text of a ratio with two or more digits."""
    return f"{value:.2f}" if value < 1 else f"{value:.1f}" if value < 10 else f"{value:,.0f}"


class Count(NamedTuple):
    """An option that is a whole number: its default, its help, and its least value."""

    default: int
    text: str
    least: int = 1


def parser_of(name: str, description: str, output: bool = True, **counts: Count) -> argparse.ArgumentParser:
    """Returns the parser of a benchmark, with its counts and, if it has an `output`, with its JSON file."""
    parser = argparse.ArgumentParser(prog=f"python -m benchmarks.{name}", description=description)
    for option, (default, text, least) in counts.items():

        def count(given: str, option: str = option, least: int = least) -> int:
            try:
                return integer(f"--{option}", int(given), Range(least, None))
            except ValueError as error:
                raise argparse.ArgumentTypeError(str(error)) from error

        parser.add_argument(f"--{option}", type=count, default=default, help=f"{text} (default: {default})")
    if output:
        parser.add_argument("--output", type=Path, default=RESULTS / f"{name}.json", help="JSON file")
    return parser


def workers() -> Count:
    """Returns the default number of processes of a command."""
    from billiards_env.engine.threads import num_threads

    return Count(num_threads(), "processes")


@contextlib.contextmanager
def processes(count: int, context: BaseContext | None = None) -> Iterator[Executor]:
    """Yields processes that ignore Ctrl-C. After an error or Ctrl-C in this process they start no other task."""
    ignored = signal.SIGINT, signal.SIG_IGN
    pool = ProcessPoolExecutor(count, context, initializer=signal.signal, initargs=ignored)
    try:
        yield pool
    finally:
        pool.shutdown(cancel_futures=True)


def run_kinds(
    work: Callable[[str, int], dict[str, Any]], kinds: Iterable[str], shots: int, workers: int
) -> dict[str, list[dict[str, Any]]]:
    """Returns `work(kind, seed)` of the first shots of each kind, computed by some processes."""
    tasks = list(itertools.product(kinds, range(shots)))
    found: dict[str, list[dict[str, Any]]] = {kind: [] for kind in kinds}
    with processes(workers) as pool:
        results = tqdm(pool.map(work, *zip(*tasks, strict=True), chunksize=2), total=len(tasks), unit="shot")
        for (kind, _), result in zip(tasks, results, strict=True):
            found[kind].append(result)
    return found


def report(result: Any, blocks: Callable[[Any], Mapping[str, str]], path: Path) -> None:
    """Writes a result as JSON and prints its blocks."""
    write_json(path, result)
    print("\n\n".join(blocks(result).values()))
    print(f"\nWritten to {path}.")


def _cpu_model() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:  # not Linux
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or "unknown"
