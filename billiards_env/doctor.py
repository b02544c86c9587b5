"""What `billiards doctor` prints: versions, the machine, and whether shots have the published bits."""

from __future__ import annotations

import importlib.metadata
import os
import platform
import time
from collections.abc import Iterable, Iterator
from pathlib import Path

from billiards_env import __version__
from billiards_env.bench.published import HASHES, first_steps
from billiards_env.commands import all_jobs
from billiards_env.jit.decorators import kernel
from billiards_env.jit.folders import cache_folder, shipped_folder

PACKAGES = (
    "numpy",
    "numba",
    "llvmlite",
    "gymnasium",
    "pettingzoo",
    "pygame",
    "matplotlib",
    "stable-baselines3",
    "torch",
)

IDS = ("Pot1-v0", "Pot1Strike-v0", "Clear5-v0", "Carom-v0", "NineBall-v0")
"""The frozen ids that are compared by default. A wheel has their machine code."""

_WIDTH = 2 + max(map(len, (*PACKAGES, *HASHES)))


def cpu_model() -> str:
    """Returns the name of the processor."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:  # not Linux
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or "unknown"


def content(folder: Path) -> str:
    """Returns the number of the files in a folder and their size, as text."""
    files = [path for path in folder.rglob("*") if path.is_file()]
    return f"{len(files)} files, {sum(path.stat().st_size for path in files) / 1e6:.1f} MB"


def facts() -> Iterator[tuple[str, str]]:
    """Yields names and values: versions, the processor, variables of the environment, the compiled code."""
    yield "billiards-env", f"{__version__} in {Path(__file__).parent}"
    yield "python", f"{platform.python_version()} on {platform.platform()}"
    for name in PACKAGES:
        try:
            yield name, importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            yield name, "is not installed"
    yield "processor", f"{cpu_model()}, {platform.machine()}, {os.cpu_count()} cores"
    prefixes = "NUMBA_", "BILLIARDS_ENV_"
    variables = [f"{name}={value}" for name, value in sorted(os.environ.items()) if name.startswith(prefixes)]
    yield "variables", " ".join(variables) or "none"
    cache, shipped = cache_folder(), shipped_folder()
    yield "cache", f"{cache}: {content(cache)}, can be written" if cache else "no folder can be written"
    yield "package's code", f"{shipped}: {content(shipped)}" if shipped else "none for these versions"
    begin = time.perf_counter()
    kernel(lambda x: x + x)(1.0)
    yield "compiler", f"works, {time.perf_counter() - begin:.1f} s"


def examine(ids: Iterable[str] = IDS) -> list[str]:
    """Prints the facts, plays frozen ids, and returns those whose results do not have the published bits.

    Args:
        ids: The ids, keys of `published.HASHES`.

    Raises:
        RuntimeError: If an id cannot be played, after all others have been.
    """
    for name, value in facts():
        print(f"{name:{_WIDTH}}{value}", flush=True)
    other = []
    with all_jobs() as job:
        for name in ids:
            with job(name):
                begin = time.perf_counter()
                bits = first_steps(name)
                if bits != HASHES[name]:
                    other.append(name)
                text = "the same bits" if bits == HASHES[name] else f"other bits, {bits} and not {HASHES[name]}"
                print(f"{name:{_WIDTH}}{text}, {time.perf_counter() - begin:.1f} s", flush=True)
        differs = f"other bits than the published results: {', '.join(other)}"
        print(differs if other else "the same bits as the published results")
    return other
