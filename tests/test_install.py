"""The installation: the pinned versions, the metadata of the package, and the virtual environment that make builds."""

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

import billiards_env

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


def test_the_metadata_has_the_version_and_the_tried_versions_of_python():
    pyproject = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    assert f'\nversion = "{billiards_env.__version__}"\n' in pyproject
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

    def run(*arguments: str) -> str:
        return subprocess.run(["make", *arguments], cwd=tmp_path, capture_output=True, text=True, check=True).stdout

    return run


@needs_make
def test_make_installs_what_it_needs_with_the_pinned_versions(make):
    commands = make("-n", "test", f"PYTHON={sys.executable}").splitlines()
    patterns = (
        rf"{sys.executable} -m venv --clear \.venv",
        r".*pip install -c constraints\.txt -e '\.\[train,masks,render,plot,multi,dev,docs\]'.*",
        r"\.venv/bin/pytest .*",
    )
    places = [next(k for k, line in enumerate(commands) if re.fullmatch(text, line)) for text in patterns]
    assert places == sorted(places)


@needs_make
def test_clean_removes_what_make_builds_and_keeps_trained_runs(make, tmp_path):
    built, kept = (".venv", "build", "site", "tests/__pycache__"), ("runs/pot", "tests")
    for name in (*built, *kept):
        (tmp_path / name).mkdir(parents=True, exist_ok=True)
    make("clean")
    assert not any((tmp_path / name).exists() for name in built)
    assert all((tmp_path / name).exists() for name in kept)
