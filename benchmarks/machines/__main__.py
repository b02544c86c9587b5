"""Compares the bits of this machine with those of other processors and compilers: `python -m benchmarks.machines`.

Other processors are emulated by qemu. The parts are:

* aarch64: the same Python program. Numba compiles on this machine for aarch64, which takes a twentieth of the time.
* kernels: the compiled functions alone, for 32-bit arm, powerpc64le, riscv64 and the big-endian s390x. The control is
  aarch64 where LLVM may fuse a product and a sum. It must have other bits.
* settings: numba without the vector extensions of this CPU, without optimisation and with the strongest one.
* numba: the oldest and the newest version of numba that `pyproject.toml` allows, in virtual environments.
* web: WebAssembly in a browser, see `docs.web.check`.

What is done is kept in `build/machines`, until the code changes; the same command continues. Needs Linux on x86-64, and
the packages qemu-user-static, debootstrap and gcc-TARGET-linux-gnu of Debian; an error names the missing one.
"""

from __future__ import annotations

import functools
import hashlib
import importlib.metadata
import json
import os
import re
import shutil
import subprocess
import sys
import threading
import venv
from collections.abc import Callable, Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

from benchmarks import ROOT, machine, run_command, workers
from benchmarks.machines import blocks
from benchmarks.machines.replay import TARGETS, emulator, tool
from benchmarks.machines.work import FILES, WORK
from billiards_env.bench.published import HASHES
from billiards_env.commands import Job
from billiards_env.doctor import IDS
from billiards_env.support.checks import one_of
from billiards_env.support.files import write_json

PARTS = "aarch64", "kernels", "settings", "numba", "web"
HOME = ROOT / "build" / "machines"
DEBIAN = {"3.11": "bookworm", "3.13": "trixie"}
"""The release of Debian with the version of Python of this process: the bytecode must be the same."""

GENERIC = {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""}
SETTINGS = {"generic CPU": GENERIC, "NUMBA_OPT=0": {"NUMBA_OPT": "0"}, "NUMBA_OPT=3": {"NUMBA_OPT": "3"}}
FEW = *IDS, "flights", "timestep push_apart"
"""The work of the parts settings and numba."""


class Step(NamedTuple):
    """A step: its part, the steps that must be done before, and the function that returns its result as JSON."""

    part: str
    needs: tuple[str, ...]
    run: Callable[[Path], Any]


def run(log: Path, *command: str | Path, **environment: str) -> None:
    """Runs a program in the repository; its output goes to a file.

    Raises:
        RuntimeError: If it fails. The message contains the end of its output.
    """
    env = {k: v for k, v in os.environ.items() if not k.startswith(("NUMBA_CPU", "NUMBA_OPT", "PYTHON"))}
    with log.open("w", encoding="utf-8") as file:
        done = subprocess.run(command, cwd=ROOT, env=env | environment, stdout=file, stderr=subprocess.STDOUT)
    if done.returncode:
        raise RuntimeError(f"{log}:\n{log.read_text(encoding='utf-8')[-2000:]}")


def work(folder: Path, name: str, python: Iterable[str | Path], names: Iterable[str], **environment: str) -> Any:
    """Returns the results of `benchmarks.machines.work` of a Python."""
    results = folder / f"{name} results"
    run(folder / f"{name}.log", *python, "-m", "benchmarks.machines.work", results, *names, **environment)
    return json.loads(results.read_text(encoding="utf-8"))


def record(mode: str, folder: Path, names: Iterable[str], **environment: str) -> Any:
    """Returns the result of `benchmarks.machines.record`."""
    (folder / f"{mode} results").unlink(missing_ok=True)
    run(folder / f"{mode}.log", sys.executable, "-m", "benchmarks.machines.record", mode, folder, *names, **environment)
    results = json.loads((folder / f"{mode} results").read_text(encoding="utf-8"))
    last = (folder / f"{mode}.log").read_text(encoding="utf-8").splitlines()[-1]
    return {"results": results, "left_out": json.loads(last) if mode == "record" else []}


def cross(folder: Path, names: Iterable[str]) -> Any:
    """Compiles for aarch64, and writes the LLVM code of all functions."""
    for made in (folder / "ir", folder / "aarch64"):
        shutil.rmtree(made, ignore_errors=True)
        made.mkdir()
    return record("cross", folder, names, NUMBA_CACHE_DIR=str(folder / "aarch64"), **GENERIC)


def system(folder: Path) -> list[str]:
    """Installs Python of Debian for aarch64 and the packages that `benchmarks.machines.work` needs."""
    emulator("aarch64")
    python = ".".join(map(str, sys.version_info[:2]))
    if python not in DEBIAN:
        raise RuntimeError(f"Python {python}: expected one of {', '.join(DEBIAN)}, which Debian has for aarch64")
    root, site, log = (folder.parent / f"{name}-{python}" for name in ("root", "site", "system.log"))
    if not (root / "installed").exists():
        shutil.rmtree(root, ignore_errors=True)
        packages = "--include=python3,libpython3-stdlib,libstdc++6,libgcc-s1"
        options = "--foreign", "--arch", "arm64", "--variant=minbase", packages
        run(log, tool("debootstrap", "debootstrap"), *options, DEBIAN[python], root)
        for package in (root / "var" / "cache" / "apt" / "archives").glob("*.deb"):
            run(log, tool("dpkg-deb", "dpkg"), "-x", package, root)
        (root / "installed").touch()
    platforms = (f"--platform={tag}_aarch64" for tag in ("manylinux2014", "manylinux_2_27", "manylinux_2_28"))
    versions = (f"{name}=={importlib.metadata.version(name)}" for name in ("numba", "llvmlite", "numpy", "gymnasium"))
    target = *platforms, f"--python-version={python}", "--only-binary=:all:", "--upgrade", "--target", site
    run(log, sys.executable, "-m", "pip", "install", *target, *versions, "tqdm")
    return [str(root), str(site)]


def on_aarch64(folder: Path, names: Iterable[str]) -> Any:
    """Does the work on an emulated aarch64, with the code that `cross` compiled."""
    root, site = json.loads((folder / "system.json").read_text(encoding="utf-8"))
    python = emulator("aarch64"), "-L", root, f"{root}/usr/bin/python3"
    environment = {"PYTHONPATH": f"{ROOT}:{site}", "NUMBA_CACHE_DIR": str(folder / "aarch64"), **GENERIC}
    return work(folder, "aarch64", python, names, PYTHONDONTWRITEBYTECODE="1", **environment)


def kernels(folder: Path, name: str) -> Any:
    """Runs the recorded calls of all functions on an emulated processor."""
    log = folder / f"kernels {name}.log"
    run(log, sys.executable, "-m", "benchmarks.machines.replay", name, folder)
    return json.loads(log.read_text(encoding="utf-8").splitlines()[-1])


def with_setting(folder: Path, name: str, names: Iterable[str]) -> Any:
    """Does some work with a setting of numba."""
    cache = {"NUMBA_CACHE_DIR": str(folder / f"cache {name}"), "BILLIARDS_ENV_COMPILE": "1"}
    Path(cache["NUMBA_CACHE_DIR"]).mkdir(exist_ok=True)
    return work(folder, name, [sys.executable], names, **cache, **SETTINGS[name])


def with_numba(folder: Path, name: str, names: Iterable[str]) -> Any:
    """Does some work with the oldest or the newest version of numba that `pyproject.toml` allows."""
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    oldest, newest = re.findall(r'"numba>=([\d.]+),(<[\d.]+)"', text)[0]
    python = folder.parent / f"numba {name}" / "bin" / "python"
    venv.create(folder.parent / f"numba {name}", with_pip=True)
    wanted = f"numba=={oldest}" if name == "oldest" else f"numba{newest}"
    run(folder / f"numba {name} pip.log", python, "-m", "pip", "install", wanted, "gymnasium>=1.1,<2", "tqdm")
    cache = folder / f"cache numba {name}"
    cache.mkdir(exist_ok=True)
    version = subprocess.run([python, "-c", "import numba; print(numba.__version__)"], capture_output=True, text=True)
    results = work(folder, f"numba {name}", [python], names, NUMBA_CACHE_DIR=str(cache), BILLIARDS_ENV_COMPILE="1")
    return {"version": version.stdout.strip(), "results": results}


def in_browser(folder: Path) -> Any:
    """Compares shots in a browser."""
    if shutil.which("google-chrome") is None:
        tool("chromium", "chromium")
    result = folder / "web results"
    run(folder / "web.log", sys.executable, "-m", "docs.web.check", "--shots", "100", "--output", result)
    return json.loads(result.read_text(encoding="utf-8"))["rows"]


def steps_of(names: list[str]) -> dict[str, Step]:
    """Returns the steps for some work, by name. A step follows those that it needs."""
    few = [name for name in names if name in FEW] or names
    steps = {
        "record": Step("", (), lambda folder: record("record", folder, names)),
        "system": Step("", (), system),
        "cross": Step("", ("record",), lambda folder: cross(folder, names)),
        "aarch64": Step("aarch64", ("cross", "system"), lambda folder: on_aarch64(folder, names)),
    }
    for name in (*TARGETS, "control"):
        steps[name] = Step("kernels", ("cross",), functools.partial(kernels, name=name))
    for name in SETTINGS:
        steps[name] = Step("settings", ("record",), functools.partial(with_setting, name=name, names=few))
    for name in ("oldest", "newest"):
        run_numba = functools.partial(with_numba, name=name, names=few)
        steps[f"{name} numba"] = Step("numba", ("record",), run_numba)
    return steps | {"web": Step("web", (), in_browser)}


def folder_of(names: list[str]) -> Path:
    """Returns the folder of what is done for this code and work, and deletes those of other code."""
    sources = [*(ROOT / "billiards_env").rglob("*.py"), *Path(__file__).parent.iterdir()]
    content = (path.read_bytes() for path in sorted(sources) if path.is_file())
    versions = sys.version, importlib.metadata.version("numba"), names
    folder = HOME / f"code-{hashlib.sha256(b''.join((*content, repr(versions).encode()))).hexdigest()[:16]}"
    for old in HOME.glob("code-*"):
        if old != folder:
            shutil.rmtree(old)
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def measure(parts: str, only: str, workers: int, job: Job) -> dict[str, Any]:
    """Does the steps of the parts, `workers` at a time, and compares their results.

    Returns:
        `rows`: for each step the numbers of results and of other results; `left_out`: the functions without a call.
    """
    names = only.split(",") if only else [*HASHES, *FILES, *WORK]
    for name in names:
        one_of("--only", name, (*HASHES, *FILES, *WORK))
    steps, folder, on = steps_of(names), folder_of(names), machine()
    chosen = parts.split(",")
    for part in chosen:
        one_of("--parts", part, PARTS)
    needed = {"record"} | {name for name, step in steps.items() if step.part in chosen}
    for name in reversed(steps):
        needed |= {*steps[name].needs} if name in needed else set()
    slots, done = threading.Semaphore(workers), dict[str, Future[Any]]()
    with ThreadPoolExecutor(len(steps)) as pool:
        for name, step in steps.items():
            if name in needed:
                done[name] = pool.submit(do, name, step, folder, done, slots)
        rows = []
        for name, future in done.items():
            with job(name):
                rows += rows_of(name, steps[name].part, future.result(), done["record"].result()["results"])
    recorded = done["record"].result()
    return {"machine": on, "rows": rows, "left_out": recorded["left_out"]} if rows else {}


def do(name: str, step: Step, folder: Path, done: dict[str, Future[Any]], slots: threading.Semaphore) -> Any:
    """Returns the result of a step from its file, or does it after those that it needs."""
    for need in step.needs:
        done[need].result()
    path = folder / f"{name}.json"
    if not path.exists():
        with slots:
            begin = perf_counter()
            print(f"{name} ...", flush=True)
            write_json(path, step.run(folder))
            print(f"{name}: {perf_counter() - begin:.0f} s", flush=True)
    return json.loads(path.read_text(encoding="utf-8"))


def rows_of(name: str, part: str, result: Any, expected: dict[str, Any]) -> list[dict[str, Any]]:
    """Returns the row of the table for a step: the results, and those with other bits."""
    if name == "record":
        published = {one: [bits, 100] for one, bits in HASHES.items()}
        return [_work_row(f"x86-64, numba {importlib.metadata.version('numba')}", result["results"], published)]
    if part == "aarch64":
        return [_work_row("aarch64, emulated", result, expected)]
    if part == "settings":
        return [_work_row(f"x86-64, {name}", result, expected)]
    if part == "numba":
        return [_work_row(f"x86-64, numba {result['version']}", result["results"], expected)]
    if part == "web":
        count, same = (sum(row[key] for row in result) for key in ("shots", "browser"))
        return [{"machine": "WebAssembly in Chromium", "compared": f"{count:,} shots", "other": count - same}]
    if part == "kernels":
        compared = f"{result['calls']:,} calls of {result['functions']} functions, {result['bytes'] / 1e6:,.0f} MB"
        machine = (
            "control: aarch64 with fused operations" if name == "control" else f"{name}, emulated, functions alone"
        )
        return [{"machine": machine, "compared": compared, "other": result["other_calls"]}]
    return []


def _work_row(machine: str, results: dict[str, Any], expected: dict[str, Any]) -> dict[str, Any]:
    shared = {name: result for name, result in results.items() if name in expected}
    ids = sum(name in HASHES for name in shared)
    compared = f"{sum(count for _, count in shared.values()):,} results: {ids} frozen ids"
    compared += f", {len(shared) - ids} other kinds of work" if len(shared) > ids else ""
    other = [name for name, (bits, _) in shared.items() if bits != expected[name][0]]
    return {"machine": machine, "compared": compared, "other": len(other), "names": other}


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m benchmarks.machines --help`."""
    options = {
        "parts": (",".join(PARTS), "the parts, separated by commas"),
        "only": ("", "only this work: frozen ids, files of the leaderboard and names of `WORK`, separated by commas"),
        "workers": workers(),
    }
    about = "Compare the bits of this machine with those of other processors and compilers."
    result = run_command("benchmarks.machines", about, arguments, measure, blocks, options, jobs=True)
    for row in result["rows"]:
        if (row["other"] > 0) != ("control" in row["machine"]):
            sys.exit(f"{row['machine']}: {row['other']} results have other bits {row.get('names', '')}")


if __name__ == "__main__":
    main()
