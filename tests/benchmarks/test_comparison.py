"""The comparison with other simulators; no time is asserted."""

import json
import sys

import numpy as np
import pytest

from benchmarks import comparison, metres, results_file, simulators

ECHO = """
import json, sys
print(json.dumps(json.loads(sys.stdin.readline())[0]), flush=True)
for line in sys.stdin:
    shot = json.loads(line)
    reply = {"seconds": shot["velocity"][0], "finished": True, "positions": shot["positions"]}
    print(json.dumps(reply if shot["time"] is None else {**reply, "finished": False, "positions": None}), flush=True)
"""


@pytest.fixture
def worker(tmp_path, monkeypatch):
    """A worker that returns the positions of a shot. It answers the name of the simulator as its version."""
    path = tmp_path / "worker.py"
    path.write_text(ECHO)
    monkeypatch.setattr(simulators, "WORKER", path)
    monkeypatch.setattr(simulators, "PYTHON", sys.executable)
    return path


def test_an_error_that_is_not_known_has_an_empty_cell():
    assert (metres(None), metres(0.25)) == ("", "2.5e-01 m")


@pytest.mark.parametrize("laws", comparison.LAWS)
@pytest.mark.parametrize("kind", comparison.KINDS)
def test_shots_are_repeatable(laws, kind):
    for shot, again in zip(*(comparison.draw_shots(laws, kind, 2) for _ in range(2)), strict=True):
        assert all(np.array_equal(a, b) for a, b in zip(shot, again, strict=True))


def test_a_worker_runs_shots(worker):
    laws, kind = "friction and spin", "15-ball break"
    scene, (shot,) = comparison.scene_of_kind(laws, kind), comparison.draw_shots(laws, kind, 1)
    with simulators.runner("pooltool", 1e-6) as (version, runner):
        assert version == "pooltool"
        outcome = runner(scene, *shot, None)
        assert (outcome.positions == shot[0]).all()
        assert (outcome.seconds, outcome.finished) == (shot[1][0], True)
        assert runner(scene, *shot, 0.5) == (None, shot[1][0], False)


@pytest.mark.skipif(not simulators.installed(), reason="simulators_worker needs .venv-simulators")
def test_the_worker_runs_a_shot_with_pooltool():
    laws, kind = "friction and spin", "1 object ball"
    with simulators.runner("pooltool", 1e-6) as (_, runner):
        ours, theirs = comparison.compare(laws, kind, [comparison.billiards_env(True), runner], 1, 1)
    assert ours["median_error_m"] < theirs["median_error_m"] < 1e-3


def test_a_failing_worker_is_not_a_measurement(worker):
    worker.write_text("raise SystemExit(1)")
    with pytest.raises(RuntimeError, match=r"worker\.py ended"), simulators.runner("pooltool", 1e-6):
        pass


def test_the_engine_is_exact_and_simulators_that_are_missing_are_left_out(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(simulators, "PYTHON", tmp_path / "python")
    runner, recorded = comparison.billiards_env, []
    monkeypatch.setattr(comparison, "billiards_env", lambda record: recorded.append(record) or runner(record))
    comparison.main(["--shots", "2", "--passes", "1", "--output", str(tmp_path / "comparison.json")])
    assert dict(zip(comparison.LAWS, recorded, strict=True)) == {
        "friction and spin": True,
        "throw and jaws": True,
        "elastic disks": False,  # as in the README
    }
    assert "pooltool and pymunk are left out" in capsys.readouterr().out
    written = json.loads((tmp_path / "comparison.json").read_text())
    assert [(row["laws"], row["simulator"]) for row in written["rows"]] == [
        (laws, "billiards-env") for laws in comparison.LAWS
    ]
    assert all(row[kind]["median_error_m"] < 1e-9 for row in written["rows"] for kind in comparison.KINDS)


def test_the_front_page_shows_what_was_measured():
    result = json.loads(results_file("benchmarks.comparison").read_text(encoding="utf-8"))
    lines = comparison.blocks(result)["why"].splitlines()[:5]
    heads, _, rates, errors, lacks = ([cell.strip() for cell in line[2:-2].split(" | ")] for line in lines)
    assert [head.split()[0] for head in heads[1:]] == list(comparison.LACKS)
    assert lacks[1:] == list(comparison.LACKS.values())
    cells = {(row["laws"], row["simulator"], row["method"]): row["1 object ball"] for row in result["rows"]}
    pooltool = cells["friction and spin", "pooltool", "event-driven"]
    assert float(rates[2]) == pytest.approx(1e6 / pooltool["us"], rel=0.05)
    assert errors[2] == metres(pooltool["median_error_m"])
    slow = cells["elastic disks", "pymunk", "timestep 1/1920 s"]
    assert float(rates[3].split(" or ")[1]) == pytest.approx(1e6 / slow["us"], rel=0.05)
    del result["versions"]["pymunk"]
    assert "why" not in comparison.blocks(result)


@pytest.mark.tools
def test_pymunk_is_compared(monkeypatch):
    monkeypatch.setattr(simulators, "PYTHON", sys.executable)
    laws, kind = "elastic disks", "1 object ball"
    with simulators.runner("pymunk", 60) as (_, runner):
        ours, theirs = comparison.compare(laws, kind, [comparison.billiards_env(False), runner], 1, 1)
    assert ours["ratio"] == 1.0
    assert theirs["us"] > 0
    assert theirs["median_error_m"] > ours["median_error_m"]
