"""Measurements of the engine: each module prints tables and writes its results to `benchmarks/results` as JSON.

The function `blocks` of a module converts the results to Markdown blocks by name. `run_command` prints these blocks,
and `studies.readme` writes them into the README and the pages in `docs`.
"""

from __future__ import annotations

import argparse
import contextlib
import functools
import importlib.metadata
import io
import itertools
import json
import os
import platform
import signal
import subprocess
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from multiprocessing.context import BaseContext
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from tqdm import tqdm

from benchmarks.scenes import SCENES
from billiards_env.commands import Job, Parser, all_jobs, ending
from billiards_env.doctor import cpu_model
from billiards_env.scene import register_scene
from billiards_env.support.checks import Range, integer
from billiards_env.support.files import check_path, write_atomically, write_json

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from PIL.Image import Image

T = TypeVar("T")

for _name, _scene in SCENES.items():
    register_scene(_name, _scene)

ROOT = Path(__file__).resolve().parent.parent
IMAGES = ROOT / "docs" / "images"

GREY = "#808080"
"""The colour of text in pictures without a background: readable on a light and on a dark page."""


def machine() -> dict[str, str | int | float | None]:
    """Returns the processor, the number of cores, the load, and the versions of Python and of packages."""
    load = round(os.getloadavg()[0], 1) if hasattr(os, "getloadavg") else None  # Windows has none
    return {
        "cpu": cpu_model(),
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


def rows_table(columns: Mapping[str, str], rows: Iterable[Mapping[str, Any]], left: int = 1) -> str:
    """Returns a table of mappings. A column is its head and the format of its cells, such as "{seconds:.1f}"."""
    return table(list(columns), [[cell.format_map(row) for cell in columns.values()] for row in rows], left)


def new_figure(width: float, height: float, **options: Any) -> Figure:
    """Returns a figure with the font that is part of matplotlib, so that pictures do not depend on installed fonts."""
    import matplotlib
    from matplotlib.figure import Figure

    matplotlib.rcParams["font.family"] = "DejaVu Sans"
    return Figure((width, height), **{"dpi": 110, "layout": "constrained", **options})


def save(figure: Figure, path: Path) -> None:
    """Writes a figure of matplotlib as PNG, completely or not at all.

    The file has no date, so equal figures give equal files. A palette of 256 colours reduces the size to a third. The
    background of a figure with the colour "none" is transparent.
    """
    from matplotlib.colors import to_rgba
    from PIL.Image import open as open_image  # a dependency of matplotlib

    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", metadata={"Software": None})
    clear = to_rgba(figure.get_facecolor())[3] < 1
    save_image(open_image(buffer).convert("RGBA" if clear else "RGB"), path, octree=clear)


def save_image(image: Image, path: Path, octree: bool) -> None:
    """Writes an image as PNG with a palette. An octree is the only method that keeps the opacity."""
    from PIL.Image import Dither, Quantize

    small = io.BytesIO()
    method = Quantize.FASTOCTREE if octree else None
    image.quantize(256, method=method, dither=Dither.NONE).save(small, format="png", optimize=True)
    write_atomically(path, small.getvalue())


def metres(error: float | None) -> str:
    """Returns the text of an error, m; empty for None."""
    return "" if error is None else f"{error:.1e} m"


def ratio(value: float) -> str:
    """Returns the text of a ratio with two or more digits."""
    return f"{value:.2f}" if value < 1 else f"{value:.1f}" if value < 10 else f"{value:,.0f}"


def parser_of(command: str, description: str, **options: tuple[Any, str]) -> argparse.ArgumentParser:
    """Returns the parser of a command.

    An option is a pair: its default value, which also sets its type, and its help text. A whole number is at least 1.
    An option with the default False is a switch.
    """
    parser = Parser(prog=f"python -m {command}", description=description)
    for option, (default, text) in options.items():
        if default is False:
            parser.add_argument(f"--{option}", action="store_true", help=text)
        else:
            kind = functools.partial(_count, option) if isinstance(default, int) else type(default)
            shown = "" if default == "" else " (default: %(default)s)"
            parser.add_argument(f"--{option}", type=kind, default=default, help=text + shown)
    return parser


def _count(option: str, text: str) -> int:
    try:
        return integer(f"--{option}", int(text), Range(1, None))
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from error


def workers() -> tuple[int, str]:
    """Returns the option of a command that works in several processes."""
    from billiards_env.engine.threads import num_threads

    return num_threads(), "processes"


def results_file(command: str, root: Path = ROOT) -> Path:
    """Returns the file of the results of a command, such as "benchmarks.speed", in a repository."""
    *package, name = command.split(".")
    return root.joinpath(*package, "results", f"{name}.json")


def run_command(
    command: str,
    description: str,
    arguments: Sequence[str] | None,
    measure: Callable[..., Any],
    blocks: Callable[[Any], Mapping[str, str]],
    options: Mapping[str, tuple[Any, str]],
    draw: Callable[[Any, Path], None] | None = None,
    *,
    jobs: bool = False,
) -> Any:
    """Runs a command that measures: it writes a JSON file, prints blocks, draws pictures, and returns the results.

    If jobs fail, it writes and prints the results of the others, and then ends with the errors. If all fail, or the
    results are {}, it writes nothing.

    Args:
        command: The module of the command, such as "benchmarks.speed".
        description: One sentence for the help.
        arguments: The arguments of the command line; None for those of the process.
        measure: Returns the results. Its arguments are the values of `options`.
        blocks: Returns the results as Markdown, by name.
        options: The options, as in `parser_of`. Every command also has `output` and, with pictures, `images`.
        draw: Draws the pictures of the results in a folder; None if there are none.
        jobs: Whether `measure` consists of jobs. It then also has the argument `job`, see `all_jobs`.
    """
    files: dict[str, tuple[Any, str]] = {"output": (results_file(command), "JSON file")}
    if draw is not None:
        files["images"] = (IMAGES, "folder of the pictures")
    with ending("the same command continues" if command.startswith("studies.") else ""):
        args = parser_of(command, description, **{**files, **options}).parse_args(arguments)
        check_output(args.output)
        if draw is not None:
            check_output(args.images / "picture.png")
        with all_jobs() as job:
            values = {option: getattr(args, option) for option in options}
            result = measure(**values, **({"job": job} if jobs else {}))
            if result != {} and not job.have_all_failed:
                report(result, blocks, args.output)
        if draw is not None:
            draw(result, args.images)
    return result


def check_output(path: Path) -> None:
    """Creates the folder of a file and checks that the file can be written. Call it before a long measurement.

    Raises:
        OSError: If the file cannot be written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    check_path(path)


def report(result: Any, blocks: Callable[[Any], Mapping[str, str]], path: Path) -> None:
    """Writes results as JSON and prints their blocks and the path of the file."""
    write_json(path, result)
    print(*all_blocks(result, blocks).values(), f"in {path}", sep="\n\n")


def all_blocks(result: Any, blocks: Callable[[Any], Mapping[str, str]]) -> dict[str, str]:
    """Returns the blocks of results, and the block "machine" if the results name one."""
    machines = {"machine": machine_line(result["machine"])} if "machine" in result else {}
    return machines | dict(blocks(result))


@contextlib.contextmanager
def processes(count: int, context: BaseContext | None = None) -> Iterator[Executor]:
    """Yields processes that ignore Ctrl-C. After an error or Ctrl-C in this process they start no other task."""
    ignored = signal.SIGINT, signal.SIG_IGN
    pool = ProcessPoolExecutor(count, context, initializer=signal.signal, initargs=ignored)
    try:
        yield pool
    finally:
        pool.shutdown(cancel_futures=True)


@contextlib.contextmanager
def worker(name: str, command: Sequence[str | Path], **options: Any) -> Iterator[Callable[..., Any]]:
    """Starts a process that reads lines of JSON and answers each of them with one.

    Args:
        name: The name of the process, for the error.
        command: The program and its arguments.
        options: Further arguments of `subprocess.Popen`.

    Yields:
        A function that sends a value, if any is given, and returns the next answer. It raises a RuntimeError if the
        process has ended.
    """
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, **options) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        requests, answers = process.stdin, process.stdout

        def ask(*values: Any) -> Any:
            for value in values:
                print(json.dumps(value), file=requests, flush=True)
            line = answers.readline()
            if not line:
                raise RuntimeError(f"{name} ended; its message is above")
            return json.loads(line)

        yield ask


def run_kinds(
    work: Callable[[str, int], dict[str, Any]], kinds: Iterable[str], shots: int, workers: int, job: Job
) -> dict[str, list[dict[str, Any]]]:
    """Returns `work(kind, seed)` of the first shots of each kind, computed by some processes.

    Each shot is a job. A kind whose shots all fail has no entry.
    """
    by_kind: dict[str, list[dict[str, Any]]] = {}
    with processes(workers) as pool:
        futures = {task: pool.submit(work, *task) for task in itertools.product(kinds, range(shots))}
        for (kind, seed), future in tqdm(futures.items(), unit="shot"):
            with job(f"{kind}, shot {seed}"):
                result = future.result()
                by_kind.setdefault(kind, []).append(result)
    return by_kind


def in_turns(calls: Mapping[str, Callable[[], T]], passes: int, job: Job) -> dict[str, list[T]]:
    """Returns the results of calls by name, one of each pass. The calls take turns.

    Each call is a job. A call that fails is not repeated and has no entry.
    """
    results: dict[str, list[T]] = {name: [] for name in calls}
    for k in range(passes):
        for name, call in calls.items():
            if len(results[name]) == k:  # it has not failed
                with job(name):
                    results[name].append(call())
    return {name: values for name, values in results.items() if len(values) == passes}
