"""Measurements of the engine: each module prints a table and writes it to `benchmarks/results` as JSON."""

from __future__ import annotations

import importlib.metadata
import os
import platform
from collections.abc import Mapping, Sequence
from pathlib import Path

RESULTS = Path(__file__).resolve().parent / "results"


def machine() -> dict[str, str | int | float | None]:
    """What the numbers depend on: processor, cores, how busy they are, and the versions of Python and of packages."""
    load = round(os.getloadavg()[0], 1) if hasattr(os, "getloadavg") else None  # Windows has none
    return {
        "cpu": _cpu_model(),
        "cores": os.cpu_count() or 1,
        "load_average": load,
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        **{name: importlib.metadata.version(name) for name in ("numba", "numpy", "gymnasium")},
    }


def print_machine(m: Mapping[str, object] | None = None) -> None:
    """Prints in one line what `machine()` told before a measurement, or tells now."""
    m = machine() if m is None else m
    versions = ", ".join(f"{name} {m[name]}" for name in ("python", "numba", "numpy", "gymnasium"))
    print(f"{m['cpu']}, {m['cores']} cores, load {m['load_average']}, {m['system']}; {versions}\n")


def print_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Prints a Markdown table, the first column to the left and the others to the right."""
    widths = [max(len(row[k]) for row in (head, *rows)) for k in range(len(head))]
    rule = ["-" * w if k == 0 else "-" * (w - 1) + ":" for k, w in enumerate(widths)]
    for row in (head, rule, *rows):
        cells = [
            cell.ljust(w) if k == 0 else cell.rjust(w) for k, (cell, w) in enumerate(zip(row, widths, strict=True))
        ]
        print(f"| {' | '.join(cells)} |")


def _cpu_model() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:  # not Linux
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or "unknown"
