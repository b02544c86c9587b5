"""The distributions: the machine code in the wheel, and their trial. The test of the whole build is slow."""

import json
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from benchmarks.release import dist, shots
from billiards_env.__main__ import PLAY_PAGE
from billiards_env.jit import folders


def test_the_tags_are_those_of_numba():
    first = dist.tags()[0]
    assert first.startswith(f"cp{sys.version_info[0]}{sys.version_info[1]}-")
    assert not first.endswith("any")


def test_the_shots_of_every_environment_have_the_same_results_twice(monkeypatch, capsys):
    assert shots.result_bytes({}) == shots.result_bytes({}) != shots.result_bytes({"max_speed": 1.0})
    monkeypatch.setattr(shots, "ENVIRONMENTS", ({}, {"mode": "pit", "dt": 1 / 60}))
    shots.main()
    first, second = json.loads(capsys.readouterr().out)
    assert first != second


def test_machine_code_is_stored_where_the_package_looks_for_it(tmp_path, monkeypatch):
    """A program that writes files as numba does replaces the compilation."""
    commands = []

    def run(*command, cwd, **environment):
        commands.append(environment)
        if "-c" in command:
            return f"{tmp_path / 'package' / 'code'}\n{cwd / 'kernels-0'}\n"
        (cwd / "kernels-0" / "billiards_env.engine").mkdir(parents=True)
        (cwd / "kernels-0" / "billiards_env.engine" / "pic.run-1.py311.nbi").write_text("index")
        return ""

    monkeypatch.setattr(dist, "run", run)
    dist.add_machine_code(tmp_path / "package", tmp_path)
    assert [p.relative_to(tmp_path / "package").as_posix() for p in (tmp_path / "package").rglob("*.nbi")] == [
        "code/billiards_env.engine/pic.run-1.py311.nbi"
    ]
    assert all((e["NUMBA_CPU_NAME"], e["NUMBA_CPU_FEATURES"]) == ("generic", "") for e in commands)


def test_the_folders_of_the_code_are_found_in_another_package(tmp_path):
    code, cache = dist.run(
        sys.executable, "-c", dist.FOLDER_OF_CODE, PYTHONPATH=str(dist.ROOT), NUMBA_CACHE_DIR=str(tmp_path)
    ).splitlines()
    assert Path(code) == folders.code_folder()
    assert Path(cache).parent == tmp_path


def test_a_command_that_fails_is_reported_with_its_errors():
    with pytest.raises(RuntimeError, match=r"(?s)-c 1/0:.*ZeroDivisionError"):
        dist.run(sys.executable, "-c", "1/0")


@pytest.mark.parametrize("used", [True, False])
def test_a_wheel_is_rejected_if_its_code_is_not_used_or_gives_other_results(tmp_path, monkeypatch, used):
    commands = []

    def run(*command, cwd, **environment):
        commands.append(command)
        if not used:
            (Path(environment["NUMBA_CACHE_DIR"])).mkdir(exist_ok=True)
            (Path(environment["NUMBA_CACHE_DIR"]) / "f.nbc").touch()
        return "1" if "BILLIARDS_ENV_COMPILE" in environment else "0"

    monkeypatch.setattr(dist, "run", run)
    monkeypatch.setattr(dist, "install", lambda wheel, folder: Path(sys.executable))
    with pytest.raises(RuntimeError, match="the same results" if used else "machine code of all"):
        dist.try_wheel(Path("x.whl"), tmp_path, 1)
    assert (sys.executable, "-m", "billiards_env", "web") in [tuple(map(str, command[:4])) for command in commands]


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
