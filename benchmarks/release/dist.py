"""Builds the source archive and the wheel, and tries the wheel: `python -m benchmarks.release.dist`.

The wheel has the machine code of the environments in `benchmarks.release.shots`, for any CPU of this architecture and
for this version of Python. It has the tags of the installed numba, because the code needs the same versions. The
package uses the code only with the same versions (`billiards_env.jit.folders`). `make dist` first builds the page of
`billiards web`, which both contain.
"""

from __future__ import annotations

import email
import importlib.metadata
import os
import re
import shutil
import subprocess
import sys
import tempfile
import venv
from pathlib import Path
from time import time
from typing import Any

from benchmarks import ROOT, machine, run_command, table
from benchmarks.release.shots import ENVIRONMENTS
from billiards_env.jit.decorators import GENERIC

FOLDER_OF_CODE = (
    "from billiards_env.jit import folders; print(folders.code_folder(), folders.cache_folder(), sep='\\n')"
)
# It prints the wall-clock time at the end, because the parent process reads the time before it starts the process.
FIRST_STEP = """
import time
import gymnasium
import billiards_env
env = gymnasium.make("Billiards-v0")
env.reset(seed=0)
env.step(env.action_space.sample())
print(time.time())
"""


def run(*command: str | Path, cwd: Path | None = None, **environment: str) -> str:
    """Runs a command without the variables of Python, numba and this package, and returns its output.

    Raises:
        RuntimeError: If it fails. The message contains its output.
    """
    env = {k: v for k, v in os.environ.items() if not k.startswith(("NUMBA_", "PYTHON", "BILLIARDS_"))} | environment
    done = subprocess.run([str(part) for part in command], cwd=cwd, env=env, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"{' '.join(str(part) for part in command)}:\n{done.stdout[-2000:]}{done.stderr[-4000:]}")
    return done.stdout


def tags() -> list[str]:
    """Returns the tags of the installed numba, such as "cp311-cp311-manylinux_2_27_x86_64"."""
    wheel = importlib.metadata.distribution("numba").read_text("WHEEL") or ""
    return email.message_from_string(wheel).get_all("Tag") or []


def add_machine_code(package: Path, folder: Path) -> None:
    """Compiles the environments of `benchmarks.release.shots` with an unpacked wheel, and adds the code to it.

    Args:
        package: The folder of the unpacked wheel.
        folder: An empty folder for the cache of numba.
    """
    cpu, features = GENERIC
    environment = {
        "PYTHONPATH": str(package),
        "PYTHONDONTWRITEBYTECODE": "1",
        "NUMBA_CACHE_DIR": str(folder),
        "NUMBA_CPU_NAME": cpu,
        "NUMBA_CPU_FEATURES": features,
    }
    run(sys.executable, ROOT / "benchmarks" / "release" / "shots.py", cwd=folder, **environment)
    code, cache = run(sys.executable, "-c", FOLDER_OF_CODE, cwd=folder, **environment).splitlines()
    for path in Path(cache).rglob("*.nb[ci]"):
        target = Path(code) / path.parent.name
        target.mkdir(parents=True, exist_ok=True)
        shutil.copy(path, target)


def build(output: Path, folder: Path) -> tuple[Path, Path]:
    """Builds the source archive, and the wheel from this archive. Returns their paths.

    Args:
        output: The folder for both.
        folder: An empty folder for work.
    """
    run(sys.executable, "-m", "build", "--no-isolation", "--outdir", folder / "built", ROOT, cwd=folder)
    (archive,), (plain,) = (folder / "built").glob("*.tar.gz"), (folder / "built").glob("*.whl")
    run(sys.executable, "-m", "wheel", "unpack", "--dest", folder, plain)
    (package,) = folder.glob("billiards_env-*")
    (folder / "cache").mkdir()
    add_machine_code(package, folder / "cache")
    (metadata,) = package.glob("*.dist-info/WHEEL")
    text = re.sub(r"(?m)^(Tag|Root-Is-Purelib): .*\n", "", metadata.read_text(encoding="utf-8")).rstrip()
    lines = [text, "Root-Is-Purelib: false", *(f"Tag: {tag}" for tag in tags())]
    metadata.write_text("\n".join(lines) + "\n", encoding="utf-8")
    (folder / "packed").mkdir()
    run(sys.executable, "-m", "wheel", "pack", "--dest-dir", folder / "packed", package)
    (wheel,) = (folder / "packed").glob("*.whl")
    output.mkdir(parents=True, exist_ok=True)
    archive, wheel = (Path(shutil.copy(path, output)) for path in (archive, wheel))
    return archive, wheel


def install(wheel: Path, folder: Path) -> Path:
    """Installs a wheel in a new virtual environment. Returns its Python."""
    venv.create(folder, with_pip=True)
    python = folder / "bin" / "python"
    run(python, "-m", "pip", "install", "--quiet", "-c", ROOT / "constraints.txt", wheel.resolve(), cwd=folder)
    return python


def start(python: Path, folder: Path, **environment: str) -> tuple[float, float]:
    """Returns the time from the start of a process to the end of its first `env.step`, and its processor time, s."""
    before, begin = sum(os.times()[2:4]), time()
    end = float(run(python, "-c", FIRST_STEP, cwd=folder, **environment))
    return end - begin, sum(os.times()[2:4]) - before


def try_wheel(wheel: Path, folder: Path, repeats: int) -> dict[str, tuple[float, float]]:
    """Installs the wheel alone, and measures the first step with its machine code and with code of this machine.

    Returns:
        The times of `start` with both: for the first start, which may compile the bytecode of all packages or the
        kernels, and for the median of the later ones.

    Raises:
        RuntimeError: If the wheel's code and newly compiled code give different results, or the first is not used, or
            the wheel has no page for `billiards web`.
    """
    python, times = install(wheel, folder / "venv"), {}
    shipped, compiled = {"NUMBA_CACHE_DIR": str(folder / "none")}, {"NUMBA_CACHE_DIR": str(folder / "fresh")}
    compiled["BILLIARDS_ENV_COMPILE"] = "1"
    for environment, prefix in ((shipped, "wheel with machine code, "), (compiled, "pip install ., ")):
        times[f"{prefix}first start"] = start(python, folder, **environment)
        later = [start(python, folder, **environment) for _ in range(repeats)]
        times[f"{prefix}later starts"] = sorted(later)[repeats // 2]
    run(python, "-m", "billiards_env", "web", "--out", folder / "play.html", cwd=folder, **shipped)
    shots = python, ROOT / "benchmarks" / "release" / "shots.py"
    results = run(*shots, cwd=folder, **shipped)
    if list((folder / "none").rglob("*.nb[ci]")):
        raise RuntimeError(f"{wheel.name}: expected the machine code of all common environments")
    if run(*shots, cwd=folder, **compiled) != results:
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
    """Builds both in a folder, and tries the wheel with some starts."""
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
