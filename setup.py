"""Adds machine code to the wheel that `pip install .` builds, so that the first start compiles nothing.

The code is for any CPU of the architecture and for the versions of numba and llvmlite that build it. With other
versions the package compiles at the first start, as in an editable installation.

The environment variable `BILLIARDS_ENV_BUILD` has the parts of `billiards_env.compiling` to compile, by default
"common"; with an empty value the wheel has no machine code.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

from setuptools import Distribution, setup
from setuptools.command.build_py import build_py

PARTS = os.environ.get("BILLIARDS_ENV_BUILD", "common").split()


class BuildWithMachineCode(build_py):
    """Copies the modules, and compiles what a wheel should contain."""

    def run(self) -> None:
        """Runs the command."""
        super().run()
        if PARTS and not self.editable_mode:
            add_machine_code(Path(self.build_lib).resolve())


class WithMachineCode(Distribution):
    """A distribution whose wheel is for one version of Python and one architecture."""

    def has_ext_modules(self) -> bool:
        """Returns whether the wheel has machine code."""
        return bool(PARTS)


def add_machine_code(library: Path) -> None:
    """Compiles `PARTS` with the package in a folder, and writes the machine code where the package looks for it."""
    folder = library / "billiards_env" / "machine_code"
    shutil.rmtree(folder, ignore_errors=True)  # of an earlier build
    environment = os.environ | {
        "NUMBA_CACHE_DIR": str(folder),
        "NUMBA_CPU_NAME": "generic",
        "NUMBA_CPU_FEATURES": "",
        "PYTHONDONTWRITEBYTECODE": "1",
        "PYTHONPATH": os.pathsep.join((str(library), os.environ.get("PYTHONPATH", ""))),
    }
    command = sys.executable, "-m", "billiards_env", "cache", *PARTS
    if subprocess.run(command, cwd=library, env=environment, check=False).returncode:
        print("the wheel has no machine code: the package compiles at the first start", file=sys.stderr)
        shutil.rmtree(folder, ignore_errors=True)


if __name__ == "__main__":
    setup(cmdclass={"build_py": BuildWithMachineCode}, distclass=WithMachineCode)
