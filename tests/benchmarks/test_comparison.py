"""The comparison with other simulators; no time is asserted."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks import comparison, metres

ECHO = """
import json, sys
print(json.dumps("1.2"), flush=True)
for line in sys.stdin:
    shot = json.loads(line)
    reply = {"seconds": shot["gap"], "finished": True, "positions": shot["positions"]}
    print(json.dumps(reply if shot["time"] is None else {**reply, "positions": None}), flush=True)
"""


@pytest.fixture
def worker(tmp_path):
    path = tmp_path / "worker.py"
    path.write_text(ECHO)
    return path


def test_an_error_that_is_not_known_has_an_empty_cell():
    assert (metres(None), metres(0.25)) == ("", "2.5e-01 m")


@pytest.mark.parametrize("laws", comparison.LAWS)
@pytest.mark.parametrize("kind", comparison.KINDS)
def test_shots_are_repeatable(laws, kind):
    for shot, again in zip(*(comparison.draw_shots(laws, kind, 2) for _ in range(2)), strict=True):
        assert all(np.array_equal(a, b) for a, b in zip(shot, again, strict=True))


def test_a_worker_runs_shots_in_the_frame_of_the_scene(worker):
    laws, kind = "friction and spin", "15-ball break"
    scene, (shot,) = comparison.scene_of_kind(laws, kind), comparison.draw_shots(laws, kind, 1)
    with comparison.pooltool(Path(sys.executable), worker) as (version, runners):
        assert version == "1.2"
        for gap, runner in zip(comparison.POOLTOOL_GAPS, runners, strict=True):
            outcome = runner(scene, *shot, None)
            assert outcome.positions == pytest.approx(shot[0], abs=1e-15)
            assert (outcome.seconds, outcome.finished) == (gap, True)
        assert runners[0](scene, *shot, 0.5) == (None, comparison.POOLTOOL_GAPS[0], False)


@pytest.mark.skipif(not comparison.POOLTOOL_PYTHON.exists(), reason="pooltool_worker needs .venv-pooltool")
def test_the_pooltool_worker_runs_a_shot():
    laws, kind = "friction and spin", "1 object ball"
    with comparison.pooltool(comparison.POOLTOOL_PYTHON) as (_, runners):
        ours, theirs = comparison.compare(laws, kind, [comparison.billiards_env(True), runners[0]], 1, 1)
    assert ours["median_error_m"] < theirs["median_error_m"] < 1e-3


def test_a_failing_worker_is_not_a_measurement(tmp_path):
    path = tmp_path / "worker.py"
    path.write_text("raise SystemExit(1)")
    with pytest.raises(RuntimeError, match=r"worker\.py ended"), comparison.pooltool(Path(sys.executable), path):
        pass


def test_the_engine_is_exact_and_simulators_that_are_missing_are_left_out(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(comparison, "POOLTOOL_PYTHON", tmp_path / "python")
    monkeypatch.setattr(comparison.importlib.util, "find_spec", lambda name: None)
    runner, recorded = comparison.billiards_env, []
    monkeypatch.setattr(comparison, "billiards_env", lambda record: recorded.append(record) or runner(record))
    comparison.main(["--shots", "2", "--passes", "1", "--output", str(tmp_path / "comparison.json")])
    assert dict(zip(comparison.LAWS, recorded, strict=True)) == {
        "friction and spin": True,
        "throw and jaws": True,
        "elastic disks": False,  # as in the README
    }
    assert "pooltool is left out" in capsys.readouterr().out
    written = json.loads((tmp_path / "comparison.json").read_text())
    assert [(row["laws"], row["simulator"]) for row in written["rows"]] == [
        (laws, "billiards-env") for laws in comparison.LAWS
    ]
    assert all(row[kind]["median_error_m"] < 1e-9 for row in written["rows"] for kind in comparison.KINDS)


def test_pymunk_is_compared(tmp_path):
    pytest.importorskip("pymunk")
    laws, kind = "elastic disks", "1 object ball"
    ours, theirs = comparison.compare(laws, kind, [comparison.billiards_env(False), comparison.pymunk(60)], 1, 1)
    assert ours["ratio"] == 1.0
    assert theirs["us"] > 0
    assert theirs["median_error_m"] > ours["median_error_m"]
