"""The installation: the pinned versions, the metadata of the package, and the virtual environment that make builds."""

from __future__ import annotations

import importlib.metadata
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parent.parent
METADATA = importlib.metadata.metadata("billiards-env")
TRIED = ("3.10.13", "3.11.7", "3.12.1", "3.13.0", "3.14.10", "3.15.2")
EXTRAS = METADATA.get_all("Provides-Extra") or []

needs_make = pytest.mark.skipif(shutil.which("make") is None, reason="no make on the PATH")


def holds(requirement: Requirement, python: str) -> bool:
    """Returns whether a requirement applies to a version of Python with any of the extras."""
    environment = {"python_version": python.rpartition(".")[0], "python_full_version": python}
    marker = requirement.marker
    return marker is None or any(marker.evaluate({**environment, "extra": extra}) for extra in ("", *EXTRAS))


def pins(python: str, file: str = "constraints.txt") -> dict[str, str]:
    """Returns the pinned version of each package on a version of Python."""
    lines = (ROOT / file).read_text(encoding="utf-8").splitlines()
    pinned = [Requirement(line) for line in lines if not line.startswith("#")]
    applicable = [(canonicalize_name(pin.name), str(pin.specifier)) for pin in pinned if holds(pin, python)]
    assert len(applicable) == len(dict(applicable)), "a package has two versions"
    return {name: version.removeprefix("==") for name, version in applicable}


def test_the_metadata_lists_the_tried_versions_of_python():
    listed = re.findall(r"Python :: (3\.\d+)$", "\n".join(METADATA.get_all("Classifier") or []), re.MULTILINE)
    assert listed == [version.rpartition(".")[0] for version in TRIED]
    requires = SpecifierSet(METADATA["Requires-Python"])
    assert all(version in requires for version in TRIED)
    assert "3.9.18" not in requires


@pytest.mark.parametrize("python", TRIED)
def test_every_direct_dependency_has_one_pin_in_its_range(python):
    pinned, for_rllib = pins(python), pins(python, "constraints-rllib.txt")
    assert set(pinned) & set(for_rllib) == {"gymnasium"}
    requirements = [Requirement(text) for text in importlib.metadata.requires("billiards-env") or []]
    assert len(requirements) > 20
    for requirement in (one for one in requirements if holds(one, python)):
        name = canonicalize_name(requirement.name)
        assert {**for_rllib, **pinned}[name] in requirement.specifier, requirement
        assert {**pinned, **for_rllib}[name] in requirement.specifier, requirement


@pytest.fixture
def make(tmp_path):
    """Returns a function that runs make in a copy of the repository without a virtual environment."""
    for name in ("Makefile", "pyproject.toml", "constraints.txt"):
        shutil.copy(ROOT / name, tmp_path)

    def run(*arguments: str) -> subprocess.CompletedProcess[str]:
        path = {"PATH": f"{tmp_path}:/usr/bin:/bin"}
        return subprocess.run(
            ["make", *arguments], cwd=tmp_path, env=path, capture_output=True, text=True, timeout=60, check=False
        )

    return run


def add_python(path: Path, version: tuple[int, int]) -> None:
    """Writes a program that runs Python with another `sys.version_info`."""
    code = f"import sys; sys.version_info = {version}; exec(sys.argv[2])"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"#!/bin/sh\nexec {sys.executable} -c '{code}' \"$@\"\n", encoding="utf-8")
    path.chmod(0o755)


@needs_make
def test_a_python_that_is_too_old_is_rejected(make, tmp_path):
    add_python(tmp_path / "python3", (3, 9))
    made, message = (
        make("train"),
        "PYTHON = python3: expected Python 3.10 or later, such as: make PYTHON=python3.12 train",
    )
    assert made.returncode != 0
    assert made.stdout.startswith(message)
    assert not (tmp_path / ".venv").exists()


@needs_make
@pytest.mark.parametrize(
    ("complete", "arguments", "rebuilt_with"),
    [
        (True, [], []),
        (True, ["PYTHON=python3.11"], []),
        (True, ["PYTHON=python3.12"], ["python3.12"]),
        (False, [], ["python3"]),
    ],
    ids=["complete", "the same Python", "another Python", "incomplete"],
)
def test_an_incomplete_environment_or_another_python_rebuilds_it(make, tmp_path, complete, arguments, rebuilt_with):
    for name, version in (("python3", (3, 13)), ("python3.11", (3, 11)), ("python3.12", (3, 12))):
        add_python(tmp_path / name, version)
    add_python(tmp_path / ".venv" / "bin" / "python", (3, 11))
    if complete:
        (tmp_path / ".venv" / ".installed-3.11").touch()
    commands = make("-n", "format", *arguments).stdout
    assert re.findall(r"^(\S+) -m venv --clear \.venv$", commands, re.MULTILINE) == rebuilt_with
    assert ".venv/bin/ruff format ." in commands


@needs_make
def test_a_link_to_another_environment_is_replaced_and_its_target_kept(make, tmp_path):
    other = tmp_path / "other"
    other.mkdir()
    (other / "kept").touch()
    (tmp_path / ".venv").symlink_to(other)
    (tmp_path / "python3").write_text(f'#!/bin/sh\n[ $1 = -c ] && exec {sys.executable} "$@"\ntouch .venv\n')
    (tmp_path / "python3").chmod(0o755)
    make("format")
    assert not (tmp_path / ".venv").is_symlink()
    assert [path.name for path in other.iterdir()] == ["kept"]


@needs_make
def test_clean_removes_what_make_builds_and_keeps_trained_runs(make, tmp_path):
    built, kept = (".venv", "build", "site", "tests/__pycache__"), ("runs/pot", "tests")
    for name in (*built, *kept):
        (tmp_path / name).mkdir(parents=True, exist_ok=True)
    assert make("clean").returncode == 0
    assert not any((tmp_path / name).exists() for name in built)
    assert all((tmp_path / name).exists() for name in kept)


PIP = """#!/bin/sh
echo 'Obtaining file:///billiards-env'
echo '  Installing build dependencies: started'
echo 'Collecting torch==2.13.0 (from billiards-env==0.1.0)'
echo '  Downloading torch-2.13.0.whl (190.5 MB)'
echo 'Processing /wheels/numpy-2.4.6-cp311.whl (from billiards-env==0.1.0)'
echo 'Installing collected packages: numpy, torch'
"""


@needs_make
@pytest.mark.parametrize("exit_status", [0, 1])
def test_the_installation_shows_its_packages_and_a_failed_one_is_repeated(make, tmp_path, exit_status):
    (tmp_path / "pip").write_text(f"{PIP}exit {exit_status}\n", encoding="utf-8")
    (tmp_path / "pip").chmod(0o755)
    script = "case $2 in *print*) echo 3.12 ;; venv) mkdir -p .venv/bin; cp pip .venv/bin ;; esac"
    (tmp_path / "python3").write_text(f"#!/bin/sh\n{script}\n", encoding="utf-8")
    (tmp_path / "python3").chmod(0o755)
    made = make(".venv/.installed-3.12")
    assert made.stdout.splitlines() == [
        "Installing the packages of constraints.txt for Python 3.12 in .venv",
        "torch (190.5 MB) numpy ",
        "Installing these packages",
    ]
    assert (made.returncode, (tmp_path / ".venv" / ".installed-3.12").exists()) == (2 * exit_status, not exit_status)
