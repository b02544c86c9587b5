"""Every command runs with tiny sizes, and the Makefile and the pages use commands and options that exist."""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import functools
import importlib
import importlib.util
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from studies import readme

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("agents", "benchmarks", "billiards_env", "cluster", "reference", "studies")
COMMANDS = {
    ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__main__")
    for package in PACKAGES
    for path in (ROOT / package).rglob("*.py")
    if '\nif __name__ == "__main__":\n' in path.read_text(encoding="utf-8")
}

TESTED = {
    "agents.evaluate": "agents/test_evaluate.py",
    "agents.rllib": "cluster/test_cluster.py",
    "agents.rllib.sweep": "cluster/test_cluster.py",
    "agents.train": "agents/test_train.py",
    "benchmarks.accuracy": "benchmarks/test_benchmarks.py",
    "benchmarks.comparison": "benchmarks/test_comparison.py",
    "benchmarks.error_limit": "benchmarks/test_benchmarks.py",
    "studies.figures": "benchmarks/test_benchmarks.py",
    "benchmarks.game_figures": "benchmarks/test_game_figures.py",
    "benchmarks.growth": "benchmarks/test_benchmarks.py",
    "benchmarks.paper_figures": "benchmarks/test_paper_figures.py",
    "benchmarks.pooltool_worker": "benchmarks/test_comparison.py",
    "benchmarks.pressed": "reference/test_pressed.py",
    "studies.readme": "test_readme.py",
    "benchmarks.speed": "benchmarks/test_benchmarks.py",
    "benchmarks.vector": "benchmarks/test_vector.py",
    "billiards_env": "test_main.py",
    "billiards_env.play": "play/test_main.py",
    "studies.choices": "studies/test_choices.py",
    "studies.players": "studies/test_players.py",
    "studies.recipes": "studies/test_recipes.py",
    "studies.timestep": "studies/test_timestep.py",
    "studies.training_speed": "studies/test_training_speed.py",
}
"""The commands that another test runs, by name, and the file of this test."""


def without_compiling(patch: pytest.MonkeyPatch, module: Any) -> None:
    """Lets the processes that a command starts, and not this one, run the kernels in Python."""
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1", "PYTHONWARNINGS": "ignore"}
    patch.setattr(module, "os", SimpleNamespace(environ=environment, pathsep=os.pathsep))


def one_saving(patch: pytest.MonkeyPatch, module: Any) -> None:
    without_compiling(patch, module)
    patch.setattr(module, "SAVINGS", [s for s in module.SAVINGS if s.name == "out of reach, not solved"])


def short_films(patch: pytest.MonkeyPatch, module: Any) -> None:
    patch.setattr(module, "STEPS", 2)
    patch.setattr(module, "simulate", functools.partial(module.simulate, max_time=0.1))


def few_collisions(patch: pytest.MonkeyPatch, module: Any) -> None:
    follow = module.measure.predictability
    patch.setattr(module, "SHOTS", dict.fromkeys(module.SHOTS, (0, 2)))
    patch.setattr(module.measure, "predictability", lambda *shot: follow(*shot[:3], 2))
    patch.setattr(module, "ProcessPoolExecutor", ThreadPoolExecutor)


def committed_results(patch: pytest.MonkeyPatch, module: Any) -> None:
    committed = json.loads(module.OUTPUT.read_text())
    patch.setattr(module, "measure", lambda *_: committed)


def without_nodes(patch: pytest.MonkeyPatch, module: Any) -> None:
    committed, config = json.loads(module.OUTPUT.read_text()), module.load(module.RECIPE)
    small = dataclasses.replace(config, n_envs=16, ppo=dataclasses.replace(config.ppo, n_steps=2, batch_size=16))
    patch.setattr(module, "load", lambda path: small)
    patch.setattr("cluster.two_nodes", contextlib.nullcontext)
    patch.setattr(module, "own_runner", lambda repeats: committed["own_runner"])
    patch.setattr(module, "two_runners", lambda changed, repeats: committed["nodes"]["pots"])
    patch.setattr(module, "learning", lambda changed, folder: committed["learning"])


TINY: dict[str, tuple[str, Callable[[pytest.MonkeyPatch, Any], None] | None]] = {
    "benchmarks.ablation": ("--repeats 1 --scale 1e-6 --output {0}/ablation.json", one_saving),
    "benchmarks.contact_rule": ("--shots 1 --output {0}/contact_rule.json", None),
    "benchmarks.real_timestep": ("--shots 100 --output {0}/real_timestep.json", None),
    "benchmarks.rendering": ("--repeats 1 --output {0}/rendering.json", short_films),
    "benchmarks.start_up": ("--repeats 1 --compilations 1 --output {0}/start_up.json", without_compiling),
    "benchmarks.stress": ("--scale 1e-9 --workers 1", few_collisions),
    "benchmarks.validation": ("--output {0}/validation.json --folder {0}", None),
    "studies.cluster_speed": ("--repeats 1 --runs {0} --output {0}/cluster_speed.json", without_nodes),
    "studies.english": ("--output {0}/english.json", committed_results),
}
"""The other commands: their arguments, in which {0} is a folder, and a function that makes their work smaller."""


def module_of(command: str) -> Any:
    """Returns the module whose `main` is a command."""
    return importlib.import_module(f"{command}.__main__" if (ROOT / command.replace(".", "/")).is_dir() else command)


def test_every_command_has_a_test():
    assert {*TESTED, *TINY} == COMMANDS
    assert not TESTED.keys() & TINY.keys()
    for command, path in TESTED.items():
        text = (ROOT / "tests" / path).read_text(encoding="utf-8")
        assert command.rpartition(".")[2] in text, command
        assert re.search(r'main\(|"-m"', text), command


@pytest.mark.parametrize("command", TINY)
def test_a_command_runs(command, tmp_path, monkeypatch, capsys):
    arguments, shrink = TINY[command]
    module = module_of(command)
    if shrink is not None:
        shrink(monkeypatch, module)
    written = arguments.format(tmp_path).split()
    committed = {path: path.stat().st_mtime_ns for path in ROOT.glob("*/results/*.json")}
    assert not module.main(written)
    name = command.rpartition(".")[2]
    if "--output" in written:
        result = json.loads((tmp_path / f"{name}.json").read_text(encoding="utf-8"))
        printed = capsys.readouterr().out
        assert all(block in printed for block in readme.SOURCES[name][1](result).values())
    assert {path: path.stat().st_mtime_ns for path in committed} == committed


class Accepted(Exception):
    """A command has accepted its arguments. It ends here."""


def check_options(line: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Checks that a command, such as "benchmarks.speed --repeats 1", exists and accepts its arguments."""
    command, *arguments = shlex.split(line, comments=True)
    assert command in COMMANDS, line
    if command == "agents.rllib.sweep" and importlib.util.find_spec("ray") is None:
        return  # it imports Ray
    parse = argparse.ArgumentParser.parse_args

    def only_parse(self: argparse.ArgumentParser, *given: Any) -> None:
        parse(self, *given)
        raise Accepted

    with monkeypatch.context() as patch:
        patch.setattr(argparse.ArgumentParser, "parse_args", only_parse)
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
    assert len(lines) > 30
    for line in lines:
        check_options(line, monkeypatch)
    assert [path for path in re.findall(r" ((?:configs|tests)/\S+)", planned) if not (ROOT / path).exists()] == []


def test_the_pages_show_commands_that_exist(monkeypatch):
    pages = [path.read_text(encoding="utf-8") for path in (*readme.PAGES, ROOT / "CONTRIBUTING.md")]
    lines = [line for text in pages for line in re.findall(r"(?:^|`)python -m ([\w.]+ [^`\n]+)", text, re.MULTILINE)]
    assert len(lines) > 10
    for line in lines:
        check_options(line, monkeypatch)
