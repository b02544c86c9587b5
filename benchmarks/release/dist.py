"""Builds the source archive and the wheel, and tries the wheel: `python -m benchmarks.release.dist`.

The wheel has the machine code of `billiards_env.compiling.ENVIRONMENTS`, for any CPU of this architecture and for this
version of Python (see `setup.py`). Its platforms are those of the installed numba, because the code needs the same
version of numba. The package uses the code only with the same versions (`billiards_env.jit.folders`). `make dist` first
builds the page of `billiards web`, which the archive and the wheel contain.
"""

from __future__ import annotations

import email
import importlib.metadata
import os
import shutil
import subprocess
import sys
import tempfile
import venv
from pathlib import Path
from time import time
from typing import Any

from benchmarks import ROOT, machine, run_command, table
from billiards_env.__main__ import PLAY_PAGE
from billiards_env.compiling import ENVIRONMENTS

# It prints the wall-clock time at the end, because the parent process reads the time before it starts the process.
FIRST_STEP = """
import time
import gymnasium
import billiards_env
env = gymnasium.make("Billiards-v0", n_object_balls={balls})
env.reset(seed=0)
env.step(env.action_space.sample())
print(time.time())
"""


def output_of(*command: str | Path, cwd: Path | None = None, **environment: str) -> str:
    """Runs a command without the variables of Python, numba and this package, and returns its output.

    Raises:
        RuntimeError: If it fails. The message contains its output.
    """
    env = {k: v for k, v in os.environ.items() if not k.startswith(("NUMBA_", "PYTHON", "BILLIARDS_"))} | environment
    done = subprocess.run([str(part) for part in command], cwd=cwd, env=env, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"{' '.join(str(part) for part in command)}:\n{done.stdout[-2000:]}{done.stderr[-4000:]}")
    return done.stdout


def platforms() -> list[str]:
    """Returns the platforms of the installed numba, such as "manylinux_2_27_x86_64"."""
    wheel = importlib.metadata.distribution("numba").read_text("WHEEL") or ""
    return [tag.rpartition("-")[2] for tag in email.message_from_string(wheel).get_all("Tag") or []]


def build(output: Path, folder: Path) -> tuple[Path, Path]:
    """Builds the source archive, and the wheel from this archive. Returns their paths.

    Args:
        output: The folder for both.
        folder: An empty folder for work.
    """
    built = folder / "built"
    command = sys.executable, "-m", "build", "--no-isolation", "--outdir", built, ROOT
    output_of(*command, cwd=folder, BILLIARDS_ENV_BUILD="environments")
    (archive,), (plain,) = built.glob("*.tar.gz"), built.glob("*.whl")
    output_of(sys.executable, "-m", "wheel", "tags", "--remove", "--platform-tag", ".".join(platforms()), plain)
    (wheel,) = built.glob("*.whl")
    output.mkdir(parents=True, exist_ok=True)
    archive, wheel = (Path(shutil.copy(path, output)) for path in (archive, wheel))
    return archive, wheel


def install(wheel: Path, folder: Path) -> Path:
    """Installs a wheel in a new virtual environment. Returns its Python."""
    venv.create(folder, with_pip=True)
    python = folder / "bin" / "python"
    output_of(python, "-m", "pip", "install", "--quiet", "-c", ROOT / "constraints.txt", wheel.resolve(), cwd=folder)
    return python


def start(python: Path, folder: Path, balls: int, environment: dict[str, str]) -> tuple[float, float]:
    """Returns the time from the start of a process to the end of its first `env.step`, and its processor time, s.

    Args:
        python: The Python of the virtual environment.
        folder: The folder to run in.
        balls: The number of object balls.
        environment: Variables.
    """
    before, begin = sum(os.times()[2:4]), time()
    end = float(output_of(python, "-c", FIRST_STEP.format(balls=balls), cwd=folder, **environment))
    return end - begin, sum(os.times()[2:4]) - before


def try_wheel(wheel: Path, folder: Path, repeats: int) -> dict[str, tuple[float, float]]:
    """Installs the wheel alone, and measures the first step with its machine code and with code of this machine.

    Returns:
        The times of `start` with both: for the first start, which may compile the bytecode of all packages or the
        kernels, for the median of the later ones, and for a first start with three object balls after them. The last
        times are those of the compilation that `pip install .` runs.

    Raises:
        RuntimeError: If the wheel's code and newly compiled code give different results, or the first is not used, or
            the wheel has no page for `billiards web`.
    """
    python, times = install(wheel, folder / "venv"), {}
    shipped = {"NUMBA_CACHE_DIR": str(folder / "none")}
    compiled = {"NUMBA_CACHE_DIR": str(folder / "fresh"), "BILLIARDS_ENV_COMPILE": "1"}
    for environment, prefix in ((shipped, "machine code of the wheel"), (compiled, "no machine code")):
        times[f"{prefix}, first start"] = start(python, folder, 1, environment)
        later = [start(python, folder, 1, environment) for _ in range(repeats)]
        times[f"{prefix}, later starts"] = sorted(later)[repeats // 2]
        times[f"{prefix}, first start with three balls"] = start(python, folder, 3, environment)
    before, begin = sum(os.times()[2:4]), time()
    install_code = compiled | {"NUMBA_CACHE_DIR": str(folder / "common")}
    output_of(python, "-m", "billiards_env", "cache", "common", cwd=folder, **install_code)
    times["the compilation in pip install ."] = time() - begin, sum(os.times()[2:4]) - before
    output_of(python, "-m", "billiards_env", "web", "--out", folder / "play.html", cwd=folder, **shipped)
    shots = python, ROOT / "benchmarks" / "release" / "shots.py"
    results = output_of(*shots, cwd=folder, **shipped)
    if list((folder / "none").rglob("*.nb[ci]")):
        raise RuntimeError(f"{wheel.name}: expected the machine code of all common environments")
    if output_of(*shots, cwd=folder, **compiled) != results:
        raise RuntimeError(f"{wheel.name}: expected the same results as newly compiled code")
    return times


def blocks(result: dict[str, Any]) -> dict[str, str]:
    """Returns the results as Markdown, by name."""
    files = " and ".join(f"{what} ({size / 1e6:.1f} MB)" for what, size in result["bytes"].items())
    rows = [(what, *(f"{s:.1f}" for s in both)) for what, both in result["seconds"].items()]
    same = "The wheel's machine code and newly compiled code give the same bits"
    return {
        "files": f"It makes {files}. {same} in {result['environments']} environments.",
        "times": table(("start", "s", "processor s"), rows),
    }


def measure(folder: Path, repeats: int) -> dict[str, Any]:
    """Builds both in a folder, and tries the wheel with some starts.

    Raises:
        FileNotFoundError: If the page of `billiards web` is missing, which belongs to the wheel.
    """
    if not PLAY_PAGE.is_file():
        raise FileNotFoundError(f"page = {str(PLAY_PAGE)!r}: expected a file, which 'make page' writes")
    with tempfile.TemporaryDirectory() as name:
        files = build(folder, Path(name))
        print(*files, sep="\n", flush=True)
        sizes = [file.stat().st_size for file in files]
        return {
            "machine": machine(),
            "bytes": dict(zip(("the source archive", "a wheel"), sizes, strict=True)),
            "environments": len(ENVIRONMENTS),
            "seconds": try_wheel(files[1], Path(name), repeats),
        }


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m benchmarks.release.dist --help`."""
    options = {"folder": (ROOT / "dist", "folder of both"), "repeats": (5, "starts to measure")}
    run_command("benchmarks.release.dist", "Build and try the distributions.", arguments, measure, blocks, options)


if __name__ == "__main__":
    main()
