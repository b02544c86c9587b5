"""The comparison with other simulators measures and shows what it says; no time is asserted."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks import comparison

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


def made_up(**changes):
    measured = {
        "us": 50.0,
        "ratio": 1.0,
        "unfinished": 0,
        "compared": 9,
        "median_error_m": 1.5e-15,
        "p90_error_m": 2e-14,
        "us_in_a_batch": 1.234,
    }
    return {kind: {**measured, **changes} for kind in comparison.KINDS}


def test_the_table_of_made_up_results():
    rows = [
        {"laws": "friction and spin", "simulator": "billiards-env", "method": "event-driven", **made_up()},
        {
            "laws": "friction and spin",
            "simulator": "pooltool",
            "method": "event-driven",
            **made_up(us=12345.6, ratio=246.9, unfinished=2, median_error_m=None, p90_error_m=None),
        },
        {"laws": "elastic disks", "simulator": "billiards-env", "method": "event-driven", **made_up()},
        {
            "laws": "elastic disks",
            "simulator": "pymunk",
            "method": "timestep 1/60 s",
            **made_up(us=1234.5, ratio=4.56, median_error_m=0.25),
        },
    ]
    machine = dict.fromkeys(("cpu", "cores", "load_average", "system", "python", "numba", "numpy", "gymnasium"), "x")
    result = {"machine": machine, "shots": 9, "passes": 3, "versions": {"pooltool": "1.2"}, "rows": rows}
    blocks = comparison.blocks(result)
    _, _, ours, pooltool, _, pymunk = (
        [cell.strip() for cell in line.split("|")[1:-1]] for line in blocks["comparison"].splitlines()
    )
    assert ours == ["friction and spin", "**billiards-env**", "event-driven", "50 us", "50 us", "1.5e-15 m"]
    assert pooltool[3:] == ["12 ms (247x)", "12 ms (247x)", ""]
    assert pymunk[2:] == ["timestep 1/60 s", "1.2 ms (4.6x)", "1.2 ms (4.6x)", "2.5e-01 m"]
    assert len(blocks["shots"].splitlines()) == 2 + 2 * len(rows)
    assert blocks["how"] == "9 shots of each kind; medians of 3 interleaved passes."
    assert blocks["batch"].count("1.23 us and 1.23 us") == 2
    assert blocks["machine"].endswith("pooltool 1.2")


@pytest.mark.parametrize("laws", comparison.LAWS)
@pytest.mark.parametrize("kind", comparison.KINDS)
def test_shots_are_repeatable(laws, kind):
    for shot, again in zip(*(comparison.shots_of(laws, kind, 2) for _ in range(2)), strict=True):
        assert all(np.array_equal(a, b) for a, b in zip(shot, again, strict=True))


def test_a_worker_runs_shots_in_the_frame_of_the_scene(worker):
    laws, kind = "friction and spin", "15-ball break"
    scene, (shot,) = comparison.scene_of(laws, kind), comparison.shots_of(laws, kind, 1)
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
        "elastic disks": False,  # as the README says
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


def test_the_python_of_pooltool_must_exist(tmp_path, capsys):
    with pytest.raises(SystemExit):
        comparison.main(["--pooltool-python", str(tmp_path / "python")])
    assert "expected a Python interpreter" in capsys.readouterr().err
