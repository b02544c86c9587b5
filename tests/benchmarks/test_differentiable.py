"""The published tasks are solved with the exact derivatives."""

from __future__ import annotations

import importlib.metadata
import io
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks import differentiable, differentiable_worker


def test_a_break_of_difftaichi_is_moved_to_the_goal():
    task, rng = differentiable.Break(), np.random.default_rng(0)
    assert task.rack().shape == (10, 2)
    found = task.solve(np.array(task.home), np.array(task.goal), rng)
    assert found["iterations"] <= 10
    assert found["distance"] < 1e-6


@pytest.mark.parametrize("control", [-5.0, -2.0, 0.1, 3.0])
def test_a_push_of_diffmjx_is_found_in_five_iterations(control):
    found = differentiable.Push().solve(control)
    assert found["iterations"] <= 5
    assert found["distance"] < 1e-6


def test_the_gradients_are_exact():
    assert differentiable.nimble() == pytest.approx([1.0, 0.0, 1.0, 0.0], abs=1e-15)
    pushed = differentiable.Push().gradient(0.5)
    assert pushed["gradient"] == pytest.approx(pushed["difference"], rel=1e-6)
    assert pushed["gradient"] != 0.0


def test_differentiable_worker_reports_a_package_that_is_not_installed():
    reply = differentiable.theirs(Path(sys.executable), "taichi", {"starts": [], "goals": []})
    assert "taichi" in reply["error"]


def test_the_worker_answers_with_the_version_and_the_result(monkeypatch, capsys):
    monkeypatch.setattr(differentiable_worker, "taichi", lambda tasks: tasks["goals"])
    monkeypatch.setattr(importlib.metadata, "version", lambda package: f"{package} 9.9")
    monkeypatch.setattr(sys, "argv", ["", "taichi"])
    monkeypatch.setattr(sys, "stdin", io.StringIO('{"goals": [1.0]}'))
    differentiable_worker.main()
    assert json.loads(capsys.readouterr().out) == {"version": "taichi 9.9", "result": [1.0]}


def test_replies_of_the_worker_are_in_the_table(monkeypatch):
    replies = {
        "taichi": [[0.2, 0.001], [0.3, 0.002], [0.3, 0.4]],
        "nimblephysics": [0.5, 0.25, -0.0, 1.0],
        "mujoco-mjx": {"sphere": 1.5},
    }

    def run(command, **_):
        output = json.dumps({"version": "9.9", "result": replies[command[-1]]})
        return subprocess.CompletedProcess(command, 0, f"a message\n{output}\n", "")

    monkeypatch.setattr(subprocess, "run", run)
    monkeypatch.setattr(differentiable, "FRESH", 16)
    text = differentiable.blocks(differentiable.measure(2, 1, Path("python")))["tasks"]
    for part in ("1 mm from the goal (9.9)", "1 of 2 within 1 cm", "0.5, 0.25, 0, 1 (9.9)", "sphere: 1.5 (9.9)"):
        assert part in text
