"""Every command runs with tiny sizes, and the Makefile and the pages use commands and options that exist."""

import argparse
import functools
import importlib
import json
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

import benchmarks
from studies import readme
from tests.helpers.imports import imported

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("agents", "benchmarks", "billiards_env", "docs", "studies")
COMMANDS = {
    ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__main__")
    for package in PACKAGES
    for path in (ROOT / package).rglob("*.py")
    if '\nif __name__ == "__main__":\n' in path.read_text(encoding="utf-8")
}


def few_shots(patch: pytest.MonkeyPatch, module: Any) -> None:
    assert module.SHOTS.keys() == module.families.FAMILIES.keys()
    patch.setattr(module, "SHOTS", dict.fromkeys(("pool, 1 object ball", "pool, 5 object balls"), (0, 2)))
    patch.setattr(module, "processes", ThreadPoolExecutor)


def two_kinds(patch: pytest.MonkeyPatch, module: Any) -> None:
    patch.setattr(module, "KINDS", {name: module.KINDS[name] for name in ("carom", "gas of 16 disks")})


def two_games(patch: pytest.MonkeyPatch, module: Any) -> None:
    patch.setattr(module, "CASES", {name: module.CASES[name] for name in ("nine_ball", "carom")})


def one_kind(patch: pytest.MonkeyPatch, module: Any) -> None:
    patch.setattr(module, "KINDS", ("grazing",))


def few_steps(patch: pytest.MonkeyPatch, module: Any) -> None:
    patch.setattr(module, "measure", functools.partial(module.measure, scale=0.001))
    patch.setattr(module, "DISKS", (2, 16), raising=False)


def few_engines(patch: pytest.MonkeyPatch, module: Any) -> None:
    patch.setattr(module, "PIT", [engine for engine in module.PIT if round(1 / engine.dt) in (15, 60)])
    patch.setattr(module, "run_kinds", lambda work, kinds, *_: {name: [work(name, 3)] for name in kinds})


TINY: dict[str, tuple[str, Callable[[pytest.MonkeyPatch, Any], None]]] = {
    "benchmarks.accuracy": ("--shots 4 --outcomes 10 --passes 1 --workers 1", few_engines),
    "benchmarks.cushion_error": ("--impacts 1 --workers 1", one_kind),
    "benchmarks.error_limit": ("--shots 1 --workers 1", two_kinds),
    "benchmarks.referees": ("--games 1", two_games),
    "benchmarks.speed": ("--repeats 1", few_steps),
    "benchmarks.stress": ("--scale 1e-9 --workers 1", few_shots),
    "benchmarks.validation": ("", lambda *_: None),
    "benchmarks.vector": ("--repeats 1", few_steps),
}
"""Commands that measure: their arguments, and a function that makes their work smaller."""

PICTURES = {
    "benchmarks.accuracy": "pareto.png",
    "benchmarks.error_limit": "error_limit.png",
    "benchmarks.validation": "validation.png",
}


def module_of(command: str) -> Any:
    """Returns the module whose `main` is a command."""
    return importlib.import_module(f"{command}.__main__" if (ROOT / command.replace(".", "/")).is_dir() else command)


def test_every_command_has_a_test():
    """A test imports the module and calls `main`, or starts it with "-m"; a worker by the name of its file."""
    assert TINY.keys() < COMMANDS
    missing = COMMANDS - TINY.keys()
    for path in (ROOT / "tests").rglob("test_*.py"):
        text = path.read_text(encoding="utf-8")
        if "main(" in text:
            missing -= {name.removesuffix(".main").removesuffix(".__main__") for name in imported(path)}
        missing -= {command for command in missing if f'"-m", "{command}"' in text}
        missing -= {command for command in missing if command.endswith("_worker") and command.split(".")[1] in text}
    assert missing == set()


@pytest.mark.parametrize("command", TINY)
def test_a_command_writes_and_prints_its_results(command, tmp_path, monkeypatch, capsys):
    arguments, shrink = TINY[command]
    module = module_of(command)
    shrink(monkeypatch, module)
    monkeypatch.setattr(benchmarks, "processes", ThreadPoolExecutor)
    committed = {path: path.stat().st_mtime_ns for path in map(readme.results, readme.SOURCES)}
    pictures = ["--images", str(tmp_path)] if command in PICTURES else []
    assert not module.main([*arguments.split(), "--output", str(tmp_path / "results.json"), *pictures])
    result = json.loads((tmp_path / "results.json").read_text(encoding="utf-8"))
    printed, blocks = capsys.readouterr().out, importlib.import_module(command).blocks
    assert all(block in printed for block in benchmarks.all_blocks(result, blocks).values())
    assert {path.name for path in tmp_path.iterdir()} == {"results.json", *filter(None, [PICTURES.get(command)])}
    assert {path: path.stat().st_mtime_ns for path in committed} == committed


@pytest.mark.parametrize("command", sorted(name for name in COMMANDS if name.startswith("benchmarks.")))
def test_ctrl_c_ends_a_benchmark_with_one_line(command, monkeypatch, capsys):
    def interrupt(*_: Any) -> None:
        raise KeyboardInterrupt

    if command.endswith(("_worker", ".shots")) or command.startswith("benchmarks.machines."):
        pytest.skip("its parent ends it")
    monkeypatch.setattr(argparse.ArgumentParser, "parse_args", interrupt)
    with pytest.raises(SystemExit, match="130"):
        module_of(command).main([])
    assert capsys.readouterr().err == "\ninterrupted\n"


class Accepted(Exception):
    """A command has accepted its arguments. It ends here."""


def check_options(line: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Checks that a command, such as "benchmarks.speed --repeats 1", exists and accepts its arguments."""
    command, *arguments = shlex.split(line, comments=True)
    assert command in COMMANDS, line
    parse = argparse.ArgumentParser.parse_known_args

    def only_parse(self: argparse.ArgumentParser, *argv: Any) -> None:
        _, unknown = parse(self, *argv)
        if unknown:
            self.error(f"unrecognized arguments: {unknown}")
        raise Accepted

    with monkeypatch.context() as patch:
        patch.setattr(argparse.ArgumentParser, "parse_known_args", only_parse)
        with pytest.raises(Accepted):
            module_of(command).main(arguments)


@pytest.mark.skipif(shutil.which("make") is None, reason="no make on the PATH")
@pytest.mark.parametrize("address", ["", "auto"])
def test_the_targets_of_make_run_commands_that_exist(address, monkeypatch):
    text = (ROOT / "Makefile").read_text(encoding="utf-8")
    (targets,) = re.findall(r"^\.PHONY: (.*)$", text, re.MULTILINE)

    def make(*arguments: str) -> str:
        arguments = (*arguments, f"ADDRESS={address}", f"PYTHON={sys.executable}")
        return subprocess.run(["make", *arguments], cwd=ROOT, capture_output=True, text=True, check=True).stdout

    assert re.findall(r"^(\w+) ", make("help"), re.MULTILINE) == re.findall(r"^(\w+):.*## ", text, re.MULTILINE)
    assert sorted(targets.split()) == sorted(re.findall(r"^(\w+):.*## ", text, re.MULTILINE))
    planned = make("-n", *targets.split())
    lines = re.findall(r"^\.venv\S*/bin/python -m (.*)$", planned, re.MULTILINE)
    assert len(lines) > 20
    for line in lines:
        check_options(line, monkeypatch)
    assert [path for path in re.findall(r" ((?:configs|tests)/\S+)", planned) if not (ROOT / path).exists()] == []


def test_the_pages_show_commands_that_exist(monkeypatch):
    pages = [path.read_text(encoding="utf-8") for path in (*readme.PAGES, ROOT / "CONTRIBUTING.md")]
    lines = [line for text in pages for line in re.findall(r"(?:^|`)python -m ([\w.]+ [^`\n]+)", text, re.MULTILINE)]
    assert len(lines) > 10
    for line in lines:
        check_options(line, monkeypatch)
