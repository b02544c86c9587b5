"""The benchmarks measure the documented quantities. No test compares times."""

from __future__ import annotations

import json
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import benchmarks
from benchmarks import (
    RESULTS,
    accuracy,
    accuracy_report,
    aim,
    calibration,
    certain,
    error_limit,
    gradients,
    speed,
    stress,
    vector,
)
from benchmarks.methods import PIC, Method
from billiards_env.scene import Scene, check_positions


@pytest.fixture
def matplotlib():
    return pytest.importorskip("matplotlib")


def test_cases_of_speed_are_repeatable_and_as_documented():
    for case, again in zip(speed.cases(0.001), speed.cases(0.001), strict=True):
        assert np.array_equal(case.positions, again.positions)
        assert np.array_equal(case.velocities, again.velocities)
        speed.run(case)
    speeds = np.hypot(*speed.random_shots("", Scene.named("pool"), 200).velocities.T)
    assert 0.5 * speed.MAX_SPEED > speeds.min() < speeds.max() <= speed.MAX_SPEED * (1 + 1e-15)
    for rack in ("rack", "tight_rack"):
        assert (speed.run(speed.breaks("", "pool", rack, 20)).first_hit == 1).all()


def rows_of(module, tmp_path, monkeypatch):
    """Returns what a benchmark measures, after it has written and printed it."""
    measured, path = module.measure(repeats=1, scale=0.001), tmp_path / "written.json"
    monkeypatch.setattr(module, "measure", lambda repeats: measured)
    module.main(["--repeats", "1", "--output", str(path)])
    assert [file.name for file in tmp_path.iterdir()] == ["written.json"]
    return json.loads(path.read_text())


def test_speed_writes_and_prints_all_results(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(speed, "DISKS", (2, 16))
    written = rows_of(speed, tmp_path, monkeypatch)
    for row in written["batch"]:
        events, rate = row["events_per_shot"], row["shots_per_second"]["median"]
        assert row["microseconds_per_event"]["median"] == pytest.approx(1e6 / (events * rate))
    assert len(written["batch"]) == len(speed.cases(0.001))
    assert [row["disks"] for row in written["growth"]] == [2, 16]
    out = capsys.readouterr().out
    assert all(row["case"] in out for row in written["batch"])


def test_gradients_writes_and_prints_all_ratios(tmp_path, monkeypatch, capsys):
    written = rows_of(gradients, tmp_path, monkeypatch)
    assert [row["case"] for row in written["cases"]] == [case.name for case in gradients.cases(0.001)]
    out = capsys.readouterr().out
    assert all(name in out for name in gradients.PARTS)


def test_aim_writes_and_prints_what_it_solves(tmp_path, capsys):
    path = tmp_path / "aim.json"
    aim.main(["--layouts", "3", "--shots", "100", "--episodes", "2", "--output", str(path)])
    assert len(json.loads(path.read_text())["rows"]) == 3
    assert "aim, of those of search" in capsys.readouterr().out


def test_calibration_counts_the_intervals_with_the_truth(tmp_path, monkeypatch):
    monkeypatch.setattr(benchmarks, "processes", ThreadPoolExecutor)
    monkeypatch.setattr(calibration, "SCENE", "real_pool")  # its derivatives are compiled for other tests
    monkeypatch.setattr(calibration, "SHOTS", 8)
    monkeypatch.setattr(calibration, "LAWS", ("stronge",))
    path = tmp_path / "calibration.json"
    calibration.main(["--repeats", "2", "--workers", "1", "--output", str(path)])
    written = json.loads(path.read_text())
    assert [row["number"] for row in written["numbers"]] == list(calibration.NUMBERS)
    for row in written["numbers"]:
        assert 0 <= row["covered"] <= row["repeats"] == 2
        assert abs(row["mean"] - row["truth"]) < 3 * row["half"]


@pytest.mark.parametrize("kind", ["carom", "9-ball break, loose", "gas of 16 disks"])
def test_the_error_is_near_the_rounding_of_the_input(kind):
    found = error_limit.summary([error_limit.compare(kind, seed) for seed in range(3)])
    assert found["same_events"] == found["shots"] == 3
    assert 0 < found["median_ratio"] <= found["max_ratio"] < 100


def test_another_velocity_exceeds_the_error_limit(monkeypatch):
    right = error_limit.run
    monkeypatch.setattr(
        error_limit,
        "run",
        lambda scene, places, velocity, **kw: right(scene, places, [v * (1 + 1e-6) for v in velocity], **kw),
    )
    assert error_limit.compare("carom", 0)["ratio"] > 1e6


def test_the_error_limit_is_drawn_and_written(matplotlib, tmp_path, monkeypatch):
    monkeypatch.setattr(error_limit, "KINDS", {name: error_limit.KINDS[name] for name in ("carom", "gas of 16 disks")})
    monkeypatch.setattr(benchmarks, "processes", ThreadPoolExecutor)
    written, picture = tmp_path / "e.json", tmp_path / "e.png"
    error_limit.main(["--shots", "1", "--workers", "1", "--output", str(written), "--picture", str(picture)])
    assert json.loads(written.read_text())["kinds"].keys() == error_limit.KINDS.keys()
    assert picture.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("name", ["1 object ball", "carom", "2 elastic disks"])
def test_pic_is_exact_and_pit_is_not(name):
    ways = (PIC, *accuracy.PIT)
    found = [accuracy.follow(name, seed) for seed in range(3)]
    errors = dict(zip(ways, np.array([shot["errors"] for shot in found]).max(axis=0), strict=True))
    assert all(shot["complete"] and shot["outcome_as_oracle"] for shot in found)
    assert errors[PIC].max() < 1e-9
    assert 1e-6 < errors[Method("PIT", 15360, "move_back")][1] < errors[Method("PIT", 15, "move_back")][1]


def test_a_shot_is_compared_up_to_the_end_of_the_reference(monkeypatch):
    monkeypatch.setattr(accuracy, "PIT", [])
    found = [accuracy.follow("15-ball break", seed) for seed in range(4)]
    errors = np.array([shot["errors"][0] for shot in found])
    complete = np.array([shot["complete"] for shot in found])
    assert 0 < complete.sum() < 4
    assert (np.isnan(errors[:, -1]) == ~complete).all()
    assert np.nanmax(errors[:, 0]) < 1e-9


def test_the_coarsest_timestep_has_only_good_results_from_there_on():
    rows = [{"steps_per_second": s} for s in (15, 30, 60, 120)]
    assert accuracy_report.coarsest_from(rows, [True, False, True, True]) == rows[2]
    assert accuracy_report.coarsest_from(rows, [True, True, True, False]) is None


def test_accuracy_is_printed_drawn_and_written(matplotlib, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(accuracy, "PIT", [m for m in accuracy.PIT if m.steps in (15, 60, 240)])
    monkeypatch.setattr(accuracy, "run_kinds", lambda work, kinds, *_: {name: [work(name, 3)] for name in kinds})
    names = list(accuracy.PROBLEMS)
    few = ["--shots", "4", "--outcomes", "40", "--passes", "1", "--workers", "1"]
    accuracy.main([*few, "--results", str(tmp_path), "--images", str(tmp_path)])
    written = json.loads((tmp_path / "accuracy.json").read_text())
    assert list(written["scenes"]) == names
    for scene in accuracy_report.unpacked(written)["scenes"].values():
        assert {row["method"] for row in scene["methods"]} >= {"PIC", "PIT"}
    assert (tmp_path / "pareto.png").read_bytes().startswith(b"\x89PNG")
    out = capsys.readouterr().out
    assert all(name in out for name in names)
    monkeypatch.setattr(accuracy, "measure", None)
    accuracy.main(["--again", "--results", str(tmp_path), "--images", str(tmp_path)])
    assert capsys.readouterr().out == out


@pytest.mark.parametrize("n", [2, 3, 96, 1000])
def test_gases_of_all_sizes_have_the_same_density_and_no_overlaps(n):
    case = speed.growing_gas(n, 2)
    table = case.scene.table
    assert n * np.pi * case.scene.balls.radius[0] ** 2 / (table.length * table.width) == pytest.approx(speed.SHARE)
    check_positions(case.scene, case.positions)
    assert not np.array_equal(*case.positions)


@pytest.mark.parametrize(
    ("module", "option"),
    [
        (accuracy, "--passes"),
        (calibration, "--repeats"),
        (error_limit, "--shots"),
        (speed, "--repeats"),
        (stress, "--workers"),
        (vector, "--repeats"),
    ],
)
def test_counts_below_one_are_rejected(module, option, capsys):
    with pytest.raises(SystemExit):
        module.main([option, "0"])
    assert f"{option} = 0: expected a whole number >= 1" in capsys.readouterr().err


@pytest.mark.parametrize("scale", ["0", "1.5"])
def test_the_stress_run_is_not_larger_than_the_whole(scale, capsys):
    with pytest.raises(SystemExit):
        stress.main(["--scale", scale])
    assert f"--scale = {float(scale)}: expected a number in (0, 1]" in capsys.readouterr().err


def test_the_stress_table_has_sums_and_maxima():
    data = json.loads((RESULTS / "stress.json").read_text())
    kinds = list(data["shots"].values())
    kinds[1]["bad"] = [[0, 0, "rest"]]
    found = stress.blocks(data)
    last = [cell.strip() for cell in found["shots"].splitlines()[-1].strip("| ").split(" | ")]
    assert last[:3] == ["all", f"{sum(k['shots'] for k in kinds):,}", "1"]
    assert last[3] == f"{max(k['overlap'] for k in kinds):.1e}"
    assert found["summary"].startswith(f"1 of {last[1]} shots broke a rule")


def test_certain_contacts_are_compared_with_the_reference(tmp_path, monkeypatch):
    monkeypatch.setattr(certain, "SHOTS", ("1 object ball",))
    monkeypatch.setattr(certain, "BREAKS", ("carom",))
    monkeypatch.setattr(benchmarks, "processes", ThreadPoolExecutor)
    written = tmp_path / "c.json"
    given = ["--shots", "3", "--breaks", "1", "--workers", "1", "--output", str(written)]
    certain.main(given)
    kinds = json.loads(written.read_text())["kinds"]
    assert {name: found["shots"] for name, found in kinds.items()} == {"1 object ball": 3, "carom": 1}
    assert all(found["certain"] == found["shots"] and not found["false"] for found in kinds.values())
    right = certain.run
    moved = lambda scene, places, velocity, **kw: right(scene, places, [-v for v in velocity], **kw)  # noqa: E731
    monkeypatch.setattr(certain, "run", moved)
    assert certain.check("1 object ball", 0)["false"]
