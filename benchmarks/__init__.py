"""Measurements of the engine: each module prints tables and writes its results to `benchmarks/results` as JSON.

The function `blocks` of a module converts the results to Markdown blocks by name. The module prints these blocks, and
`studies.readme` writes them into the README and the pages in `docs`.
"""

from __future__ import annotations

import argparse
import importlib.metadata
import io
import os
import platform
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from billiards_env.checks import Range, whole
from billiards_env.files import write_whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure

RESULTS = Path(__file__).resolve().parent / "results"
IMAGES = RESULTS.parents[1] / "docs" / "images"


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


def print_blocks(blocks: Mapping[str, str]) -> None:
    """Prints blocks of Markdown."""
    print("\n\n".join(blocks.values()))


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


def save(figure: Figure, path: Path) -> None:
    """Writes a figure of matplotlib as PNG, completely or not at all.

    The file has no date, so equal figures give equal files. A palette of 256 colours reduces the size to a third.
    """
    from PIL import Image  # a dependency of matplotlib

    buffer, small = io.BytesIO(), io.BytesIO()
    figure.savefig(buffer, format="png", metadata={"Software": None})
    Image.open(buffer).convert("RGB").quantize(256, dither=Image.Dither.NONE).save(small, format="png", optimize=True)
    write_whole(path, small.getvalue())


def check_counts(parser: argparse.ArgumentParser, args: argparse.Namespace, **least: int) -> None:
    """Exits with an error if an argument is not a whole number of at least the given size."""
    for name, low in least.items():
        try:
            whole(f"--{name}", getattr(args, name), Range(low, None))
        except ValueError as error:
            parser.error(str(error))


def _cpu_model() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:  # not Linux
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or "unknown"
