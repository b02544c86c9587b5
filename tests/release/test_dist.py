"""The distributions: the machine code in the wheel, and their trial. The test of the whole build is slow."""

import importlib.util
import json
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from benchmarks.release import dist, shots
from billiards_env import compiling
from billiards_env.__main__ import PLAY_PAGE
from billiards_env.jit import decorators as jit
from billiards_env.jit import folders


def test_the_platforms_are_those_of_numba():
    assert dist.platforms()
    assert "any" not in dist.platforms()


def test_the_results_of_every_environment_are_hashed(monkeypatch, capsys):
    monkeypatch.setattr(compiling, "ENVIRONMENTS", ({}, {"max_speed": 1.0}, {}))
    shots.main()
    first, second, again = json.loads(capsys.readouterr().out)
    assert first == again != second


@pytest.fixture
def setup_file():
    """The module `setup.py`."""
    spec = importlib.util.spec_from_file_location("setup_file", dist.ROOT / "setup.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("code", [0, 1])
def test_a_wheel_is_compiled_for_any_cpu_where_the_package_looks_for_its_code(tmp_path, monkeypatch, setup_file, code):
    """A program that writes files as numba does replaces the compilation."""
    monkeypatch.setattr(folders, "_PACKAGE", tmp_path / "billiards_env")
    (tmp_path / "billiards_env" / "machine_code" / "old").mkdir(parents=True)
    commands = []

    def run(command, cwd, env, check):
        commands.append(command)
        assert (env["NUMBA_CPU_NAME"], env["NUMBA_CPU_FEATURES"]) == jit.GENERIC
        assert env["PYTHONPATH"].split(os.pathsep)[0] == str(cwd)
        with monkeypatch.context() as patch:
            patch.setenv("NUMBA_CACHE_DIR", env["NUMBA_CACHE_DIR"])
            assert folders.cache_folder() == folders.code_folder()
        return subprocess.CompletedProcess(command, code)

    monkeypatch.setattr(subprocess, "run", run)
    setup_file.add_machine_code(tmp_path)
    assert [command[2:] for command in commands] == [("billiards_env", "cache", "common")]
    kept = [path.name for path in (tmp_path / "billiards_env").glob("machine_code/*")]
    assert kept == ([] if code else [folders.code_folder().name])


def test_what_a_wheel_is_compiled_for_are_parts(monkeypatch, setup_file):
    assert set(setup_file.PARTS) <= set(compiling.PARTS)
    assert setup_file.WithMachineCode().has_ext_modules()
    monkeypatch.setattr(setup_file, "PARTS", [])
    assert not setup_file.WithMachineCode().has_ext_modules()


def test_a_command_that_fails_is_reported_with_its_errors():
    with pytest.raises(RuntimeError, match=r"(?s)-c 1/0:.*ZeroDivisionError"):
        dist.output_of(sys.executable, "-c", "1/0")


@pytest.mark.parametrize("used", [True, False])
def test_a_wheel_is_rejected_if_its_code_is_not_used_or_gives_other_results(tmp_path, monkeypatch, used):
    commands = []

    def run(*command, cwd, **environment):
        commands.append(command)
        if not used:
            (Path(environment["NUMBA_CACHE_DIR"])).mkdir(exist_ok=True)
            (Path(environment["NUMBA_CACHE_DIR"]) / "f.nbc").touch()
        return "1" if "BILLIARDS_ENV_COMPILE" in environment else "0"

    monkeypatch.setattr(dist, "output_of", run)
    monkeypatch.setattr(dist, "install", lambda wheel, folder: Path(sys.executable))
    with pytest.raises(RuntimeError, match="the same results" if used else "machine code of all"):
        dist.try_wheel(Path("x.whl"), tmp_path, 1)
    assert (sys.executable, "-m", "billiards_env", "web") in [tuple(map(str, command[:4])) for command in commands]


def test_a_missing_page_is_an_error_before_anything_is_built(monkeypatch, tmp_path):
    monkeypatch.setattr(dist, "PLAY_PAGE", tmp_path / "play.html")
    with pytest.raises(FileNotFoundError, match=r"page = .*play.html': expected a file, which 'make page' writes"):
        dist.measure(tmp_path, 1)
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
@pytest.mark.skipif(not PLAY_PAGE.is_file(), reason="the wheel needs the page of `make page`")
def test_the_wheel_starts_without_compiling_in_an_empty_environment(tmp_path):
    command = [
        sys.executable,
        "-m",
        "benchmarks.release.dist",
        "--folder",
        str(tmp_path),
        "--output",
        str(tmp_path / "r.json"),
    ]
    done = subprocess.run([*command, "--repeats", "1"], cwd=dist.ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    (wheel,) = tmp_path.glob("*.whl")
    names = zipfile.ZipFile(wheel).namelist()
    assert sum(name.startswith("billiards_env/machine_code/") for name in names) > 20
    assert not any(name.startswith(("release/", "tests/")) for name in names)
    result = json.loads((tmp_path / "r.json").read_text())
    assert all(block in done.stdout for block in dist.blocks(result).values())
