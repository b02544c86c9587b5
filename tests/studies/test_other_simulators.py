"""Policies in other simulators: the measurements, the worker, and the tables."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks import simulators
from billiards_env import simulate_batch
from studies import other_simulators as study
from tests.helpers.processes import InThisProcess

pytest.importorskip("matplotlib")

PLACES = np.array([[-0.5, 0.0], [0.0, 0.0]])


def test_a_shot_that_is_turned_by_a_delay_has_the_line_of_centres_of_the_late_hit():
    scene, delay = study.SCENES["exact, rigid"], np.array([0.0, 4e-3, 4e-3, 4e-3])
    velocities = 1.2 * np.array([[1.0, 0.08], [1.0, 0.08], [1.0, -0.08], [-1.0, 0.08]]) / np.hypot(1.0, 0.08)
    places = np.stack([PLACES] * 4)
    turned = study.delayed(places, velocities, delay)
    assert turned[[0, 3]] == pytest.approx(velocities[[0, 3]], abs=1e-12)  # the last shot misses
    assert turned[1] == pytest.approx(turned[2] * [1, -1], abs=1e-12)
    offset, radius = 0.5 * 0.08 / np.hypot(1.0, 0.08), scene.balls.radius[0]
    path = np.sqrt(0.5**2 - offset**2) - np.sqrt(4.0 * radius**2 - offset**2)
    beyond = (path + (1.2 - study.DECAY * path) * delay[1]) / np.hypot(1.0, 0.08)  # the balls overlap there
    x, y = PLACES[1] - PLACES[0] - beyond * np.array([1.0, 0.08])
    moved = simulate_batch(scene, places, turned, max_time=0.8).velocities[:, 1]
    assert moved[1, 1] / moved[1, 0] == pytest.approx(y / x, rel=1e-9)
    assert moved[1, 1] / moved[1, 0] < moved[0, 1] / moved[0, 0]  # a thinner hit
    assert np.hypot(x, y) < 2 * radius


FAKE = """
import json, sys
sys.stdin.readline()
print(json.dumps([0.001, 0.003]), flush=True)
for line in sys.stdin:
    print(json.dumps([int(x > 0) * 3 - 1 for x, _ in json.loads(line)[1]]), flush=True)
"""


def test_the_study_trains_resumes_and_shows_its_results(tmp_path, monkeypatch, capsys):
    worlds = {name: study.WORLDS[name]._replace(seeds=1) for name in ("pymunk 1/240 s", "exact, rigid", "exact, soft")}
    worker = tmp_path / "worker.py"
    worker.write_text(FAKE)
    monkeypatch.setattr(simulators, "WORKER", worker)
    monkeypatch.setattr(study, "WORLDS", worlds)
    monkeypatch.setattr(study, "executor", lambda *_: InThisProcess())
    monkeypatch.setattr(simulators, "PYTHON", Path(sys.executable))
    argv = ["--shots", "4096", "--layouts", "300", "--output", str(tmp_path / "o.json"), "--images", str(tmp_path)]
    study.main(argv)
    results = json.loads((tmp_path / "o.json").read_text())["runs"]
    assert results.keys() == {f"{name}, seed 11" for name in worlds}
    for run in results.values():
        assert 0 < sum(count for count, *_ in run["aim"]) <= run["success"][run["world"]] <= 300
    assert results["exact, rigid, seed 11"]["predicted"].keys() == {"pymunk 1/240 s"}
    assert results["pymunk 1/240 s, seed 11"]["delay"] == 0.002
    monkeypatch.setattr(study, "train", None)
    study.main(argv)
    assert "| pymunk 1/240 s | 2.0 ms |" in capsys.readouterr().out
    assert (tmp_path / "other_simulators.png").read_bytes().startswith(b"\x89PNG")


def test_the_published_errors_have_the_predicted_sign_and_in_pymunk_the_predicted_size():
    result = json.loads((study.RESULTS / "other_simulators.json").read_text())
    for name, rows in study.aim_errors(result).items():
        thick = rows[:3]  # up to 45 degrees
        assert (thick[:, 1] < 0).all(), name
        if name.startswith("pymunk"):
            assert thick[:, 1] == pytest.approx(thick[:, 2], abs=0.5), name


@pytest.mark.skipif(not simulators.installed(), reason="the worker needs .venv-simulators")
@pytest.mark.parametrize(("world", "delay"), [("pymunk 1/60 s", 1 / 120), ("MuJoCo 10 ms", 0.0051)])
def test_the_process_of_the_worker_plays_shots(world, delay):
    with study.opened(world) as (play, delays):
        assert delays.mean() == pytest.approx(delay, abs=1e-5)
        starts = np.stack([[[0.0, -0.2], [0.0, 0.4]]] * 5)
        pockets = play(starts, np.array([[0.0, s] for s in (0.0, 3.0, -1.0, 2.0, 0.1)]))
    assert pockets.tolist() == [-1, 5, -1, 5, -1]
