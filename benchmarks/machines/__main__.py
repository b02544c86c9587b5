"""Compares the bits of this machine with those of other processors and compilers: `python -m benchmarks.machines`.

Other processors are emulated by qemu. The parts are:

* aarch64: the same Python program. Numba compiles on this machine for aarch64, which takes a twentieth of the time.
* kernels: the compiled functions alone, for 32-bit arm, powerpc64le, riscv64 and the big-endian s390x. The control is
  aarch64 where LLVM may fuse a product and a sum. It must have other bits.
* settings: numba without the vector extensions of this CPU, and without optimisation (`NUMBA_OPT` is otherwise 3).
* numba: the oldest and the newest version of numba that `pyproject.toml` allows, in virtual environments. The
  newest is left out if this process has it.
* web: WebAssembly in a browser, see `docs.web.check`.

What is done is kept in `build/machines`, until the code changes; the same command continues. Needs Linux on x86-64, and
the packages qemu-user-static, debootstrap and gcc-TARGET-linux-gnu of Debian; an error names the missing one.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import venv
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from functools import partial
from importlib.metadata import version
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
PYTHON = ".".join(map(str, sys.version_info[:2]))
DEBIAN = {"3.11": "bookworm", "3.13": "trixie"}
"""The release of Debian with the version of Python of this process: the bytecode must be the same."""

GENERIC = {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""}
SETTINGS = {"generic CPU": GENERIC, "NUMBA_OPT=0": {"NUMBA_OPT": "0"}}
FEW = *IDS, "Jump-v0", "timestep push_apart"
"""The work of the parts settings and numba."""

Row = dict[str, Any]
"""The result of a step: the `machine`, what is `compared`, how many results have `other` bits; {} without results."""


class Step(NamedTuple):
    """A step: its part, the steps that must be done before, and the function that does it in a folder."""

    part: str
    needs: tuple[str, ...]
    run: Callable[[Path], Row]


def run(log: Path, *command: str | Path, **environment: str) -> str:
    """Runs a program in the repository. Returns its output, which is also in a file.

    Raises:
        RuntimeError: If it fails. The message contains the end of its output.
    """
    env = {k: v for k, v in os.environ.items() if not k.startswith(("NUMBA_CPU", "NUMBA_OPT", "PYTHON"))}
    with log.open("w", encoding="utf-8") as file:
        done = subprocess.run(command, cwd=ROOT, env=env | environment, stdout=file, stderr=subprocess.STDOUT)
    text = log.read_text(encoding="utf-8")
    if done.returncode:
        raise RuntimeError(f"{log}:\n{text[-2000:]}")
    return text


def work(folder: Path, machine: str, names: list[str], *python: str | Path, cache: str = "", **environment: str) -> Row:
    """Does some work with another Python or other variables."""
    path, code = folder / f"{machine} results", folder / f"code {cache or machine}"
    code.mkdir(exist_ok=True)
    environment |= {"NUMBA_CACHE_DIR": str(code), "BILLIARDS_ENV_COMPILE": "1"}
    command = *(python or [sys.executable]), "-m", "benchmarks.machines.work", path, *names
    run(folder / f"{machine}.log", *command, **environment)
    return {"machine": machine, "results": json.loads(path.read_text(encoding="utf-8"))}


def compared(row: Row, expected: dict[str, Any]) -> Row:
    """Returns a row with the number of its results that have other bits than expected, and their names."""
    results = row["results"]
    ids, count = sum(name in HASHES for name in results), sum(count for _, count in results.values())
    other = [name for name, (bits, _) in results.items() if bits != expected.get(name, [bits])[0]]
    text = f"{count:,} results (frozen ids: {ids}, other work: {len(results) - ids})"
    return row | {"compared": text, "other": len(other), "names": other}


def record(folder: Path, names: list[str]) -> Row:
    """Does the work in a process of its own, and records all calls."""
    (folder / "record results").unlink(missing_ok=True)
    text = run(folder / "record.log", sys.executable, "-m", "benchmarks.machines.record", "record", folder, *names)
    results = json.loads((folder / "record results").read_text(encoding="utf-8"))
    machine = f"x86-64, {'newest ' if has_newest() else ''}numba, {version('numba')}, NUMBA_OPT=3"
    return {"machine": machine, "results": results, "left_out": json.loads(text.splitlines()[-1])}


def cross(folder: Path, names: list[str]) -> Row:
    """Compiles for aarch64, and writes the LLVM code of all functions."""
    (folder / "cross results").unlink(missing_ok=True)
    for made in (folder / "ir", folder / "code aarch64"):
        shutil.rmtree(made, ignore_errors=True)
        made.mkdir()
    environment = {"NUMBA_CACHE_DIR": str(folder / "code aarch64"), **GENERIC}
    program = sys.executable, "-m", "benchmarks.machines.record", "cross", folder
    run(folder / "cross.log", *program, *names, **environment)
    return {}


def system(folder: Path) -> Row:
    """Installs Python of Debian and the packages for aarch64."""
    emulator("aarch64")
    if PYTHON not in DEBIAN:
        raise RuntimeError(f"Python {PYTHON}: expected one of {', '.join(DEBIAN)}, which Debian has for aarch64")
    root, site, log = (HOME / f"{name}-{PYTHON}" for name in ("root", "site", "system.log"))
    if not (root / "installed").exists():
        shutil.rmtree(root, ignore_errors=True)
        packages = "--include=python3,libpython3-stdlib,libstdc++6,libgcc-s1"
        options = "--foreign", "--arch", "arm64", "--variant=minbase", packages
        run(log, tool("debootstrap", "debootstrap"), *options, DEBIAN[PYTHON], root)
        for package in (root / "var" / "cache" / "apt" / "archives").glob("*.deb"):
            run(log, tool("dpkg-deb", "dpkg"), "-x", package, root)
        (root / "installed").touch()
    platforms = (f"--platform={tag}_aarch64" for tag in ("manylinux2014", "manylinux_2_27", "manylinux_2_28"))
    versions = (f"{name}=={version(name)}" for name in ("numba", "llvmlite", "numpy", "gymnasium"))
    target = *platforms, f"--python-version={PYTHON}", "--only-binary=:all:", "--upgrade", "--target", site
    run(log, sys.executable, "-m", "pip", "install", *target, *versions, "tqdm")
    return {}


def on_aarch64(folder: Path, names: list[str]) -> Row:
    """Does the work on an emulated aarch64, with the code that `cross` compiled, and Python of Debian."""
    root, site = (HOME / f"{name}-{PYTHON}" for name in ("root", "site"))
    emulated = emulator("aarch64"), "-L", root, root / "usr" / "bin" / "python3"
    return work(folder, "aarch64", names, *emulated, PYTHONPATH=f"{ROOT}:{site}", **GENERIC)


def kernels(folder: Path, name: str) -> Row:
    """Runs the recorded calls of all functions on an emulated processor."""
    text = run(folder / f"kernels {name}.log", sys.executable, "-m", "benchmarks.machines.replay", name, folder)
    result = json.loads(text.splitlines()[-1])
    machine = f"{name}, functions alone" if name in TARGETS else "control: aarch64 with fused operations"
    calls = f"{result['calls']:,} calls of {result['functions']} functions, {result['bytes'] / 1e6:,.1f} MB"
    return {"machine": machine, "compared": calls, "other": result["other_calls"]}


def numba_range() -> tuple[str, str]:
    """Returns the oldest version of numba that `pyproject.toml` allows, and the first one after the newest."""
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    return re.findall(r'"numba>=([\d.]+),<([\d.]+)"', text)[0]


def has_newest() -> bool:
    """Returns whether this process has the newest minor version of numba that `pyproject.toml` allows."""
    major, minor, *_ = map(int, version("numba").split("."))
    return f"{major}.{minor + 1}" == numba_range()[1]


def with_numba(folder: Path, name: str, names: list[str]) -> Row:
    """Does some work with the oldest or the newest version of numba that `pyproject.toml` allows."""
    oldest, newest = numba_range()
    python, log = HOME / f"numba {name}" / "bin" / "python", folder / f"{name} pip.log"
    venv.create(HOME / f"numba {name}", with_pip=True)
    wanted = f"numba=={oldest}" if name == "oldest" else f"numba<{newest}"
    run(log, python, "-m", "pip", "install", wanted, "gymnasium>=1.1,<2", "tqdm")
    number = run(log, python, "-c", "import numba; print(numba.__version__)").strip()
    return work(folder, f"x86-64, {name} numba, {number}", names, python)


def in_browser(folder: Path) -> Row:
    """Builds the engines for browsers, and compares shots in a browser."""
    if shutil.which("google-chrome") is None:
        tool("chromium", "chromium")
    result = folder / "web results"
    run(folder / "page.log", sys.executable, "-m", "docs.web.build")
    run(folder / "web.log", sys.executable, "-m", "docs.web.check", "--shots", "100", "--output", result)
    rows = json.loads(result.read_text(encoding="utf-8"))["rows"]
    count, same = (sum(row[key] for row in rows) for key in ("shots", "browser"))
    return {"machine": "WebAssembly in Chromium", "compared": f"{count:,} shots", "other": count - same}


def steps_of(names: list[str]) -> dict[str, Step]:
    """Returns the steps for some work, by name. A step follows those that it needs."""
    few, steps = [name for name in names if name in FEW] or names, dict[str, Step]()
    steps["record"] = Step("", (), partial(record, names=names))
    steps["cross"] = Step("", ("record",), partial(cross, names=names))
    steps["system"] = Step("aarch64", (), system)
    steps["aarch64"] = Step("aarch64", ("cross", "system"), partial(on_aarch64, names=names))
    steps |= {
        f"functions on {name}": Step("kernels", ("cross",), partial(kernels, name=name))
        for name in (*TARGETS, "aarch64")
    }
    for name, variables in SETTINGS.items():
        setting = partial(work, machine=f"x86-64, {name}", names=few, **variables)
        steps[name] = Step("settings", (), setting)
    for name in ("oldest",) if has_newest() else ("oldest", "newest"):
        steps[name] = Step("numba", (), partial(with_numba, name=name, names=few))
    return steps | {"web": Step("web", (), in_browser)}


def folder_of(names: list[str]) -> Path:
    """Returns the folder of what is done for this code and work, and deletes those of other code."""
    sources = [*(ROOT / "billiards_env").rglob("*.py"), *Path(__file__).parent.glob("*.*")]
    content = repr((sys.version, version("numba"), names, [path.read_bytes() for path in sorted(sources)]))
    folder = HOME / f"code-{hashlib.sha256(content.encode()).hexdigest()[:16]}"
    for old in {*HOME.glob("code-*")} - {folder}:
        shutil.rmtree(old)
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def measure(parts: str, only: str, workers: int, job: Job) -> dict[str, Any]:
    """Does the steps of the parts, `workers` at a time.

    Returns:
        `rows`: the rows of the steps; `left_out`: the functions that no work calls.
    """
    names, chosen, all_names = only.split(",") if only else [], parts.split(","), (*HASHES, *FILES, *WORK)
    for option, values, known in (("--only", names, all_names), ("--parts", chosen, PARTS)):
        for value in values:
            one_of(option, value, known)
    names = names or [*all_names]
    steps, folder, on = steps_of(names), folder_of(names), machine()
    needed = {"record"} | {name for name, step in steps.items() if step.part in chosen}
    for name in reversed(steps):
        needed |= {*steps[name].needs} if name in needed else set()
    done, rows = do_all({name: step for name, step in steps.items() if name in needed}, folder, workers), []
    published = {name: [bits] for name, bits in HASHES.items()}
    for name in (name for name in steps if name in needed):
        with job(name):
            row = done[name].result()
            if "results" in row:
                row = compared(row, published if name == "record" else done["record"].result()["results"])
                if row["names"]:
                    print(f"{row['machine']}: other bits in {', '.join(row['names'])}", flush=True)
            rows += [{k: row[k] for k in ("machine", "compared", "other")}] if row else []
    return {"machine": on, "rows": rows, "left_out": done["record"].result()["left_out"]} if rows else {}


def do_all(steps: dict[str, Step], folder: Path, workers: int) -> dict[str, Future[Row]]:
    """Does steps, `workers` at a time. They begin in their order, each after those that it needs."""
    done: dict[str, Future[Row]] = {}
    with ThreadPoolExecutor(workers) as pool:
        while len(done) < len(steps):
            running = [future for future in done.values() if not future.done()]
            ended = {name for name, future in done.items() if future.done()}
            ready = [name for name, step in steps.items() if name not in done and ended.issuperset(step.needs)]
            if ready and len(running) < workers:
                done[ready[0]] = pool.submit(do, ready[0], steps[ready[0]], folder, done)
            else:
                wait(running, return_when=FIRST_COMPLETED)
    return done


def do(name: str, step: Step, folder: Path, done: dict[str, Future[Row]]) -> Row:
    """Returns the row of a step from its file, or does the step. Fails if a step that it needs failed."""
    for need in step.needs:
        done[need].result()
    path = folder / f"{name}.json"
    if not path.exists():
        begin = perf_counter()
        print(f"{name} ...", flush=True)
        write_json(path, step.run(folder))
        print(f"{name}: {perf_counter() - begin:.0f} s", flush=True)
    return json.loads(path.read_text(encoding="utf-8"))


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m benchmarks.machines --help`."""
    options = {
        "parts": (",".join(PARTS), "the parts, separated by commas"),
        "only": ("", "only this work: frozen ids, files of the leaderboard and names of `WORK`, separated by commas"),
        "workers": workers(),
    }
    about = "Compare the bits of this machine with those of other processors and compilers."
    result = run_command("benchmarks.machines", about, arguments, measure, blocks, options, jobs=True)
    wrong = [row["machine"] for row in result["rows"] if (row["other"] > 0) != ("control" in row["machine"])]
    if wrong:
        sys.exit(f"{', '.join(wrong)}: other bits, or a control that finds none")


if __name__ == "__main__":
    main()
