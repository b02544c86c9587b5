"""The benchmarks measure the documented quantities. No test compares times."""

import json
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import benchmarks
from benchmarks import ROOT, accuracy, accuracy_report, calibration, error_limit, speed, stress, vector
from billiards_env.calibration import starts
from billiards_env.engine import PIC, Engine
from billiards_env.scene import Scene, check_positions


def test_cases_of_speed_are_repeatable_and_as_documented():
    for case, again in zip(speed.cases(0.001), speed.cases(0.001), strict=True):
        assert np.array_equal(case.positions, again.positions)
        assert np.array_equal(case.velocities, again.velocities)
        speed.batch_of(case)
    speeds = np.hypot(*speed.random_shots("", Scene.named("pool"), 200).velocities.T)
    assert 0.5 * speed.MAX_SPEED > speeds.min() < speeds.max() <= speed.MAX_SPEED * (1 + 1e-15)
    for rack in ("rack", "tight_rack"):
        assert (speed.batch_of(speed.breaks("", "pool", rack, 20)).first_hit == 1).all()


def test_calibration_counts_the_intervals_with_the_truth(tmp_path, monkeypatch):
    monkeypatch.setattr(benchmarks, "processes", ThreadPoolExecutor)
    monkeypatch.setattr(calibration, "SCENE", "real_pool")  # its derivatives are compiled for other tests
    monkeypatch.setattr(calibration, "SHOTS", 3)
    monkeypatch.setattr(starts, "SIDES", (-0.35, 0.35))
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
    summary = error_limit.summary([error_limit.compare(kind, seed) for seed in range(3)])
    assert summary["same_events"] == summary["shots"] == 3
    assert 0 < summary["median_ratio"] <= summary["max_ratio"] < 100


def test_another_velocity_exceeds_the_error_limit(monkeypatch):
    right = error_limit.reference_shot
    monkeypatch.setattr(
        error_limit,
        "reference_shot",
        lambda scene, places, velocity, **kw: right(scene, places, [v * (1 + 1e-6) for v in velocity], **kw),
    )
    assert error_limit.compare("carom", 0)["ratio"] > 1e6


@pytest.mark.parametrize("name", ["1 object ball", "carom", "2 elastic disks"])
def test_pic_is_exact_and_pit_is_not(name):
    engines = (PIC, *accuracy.PIT)
    shots = [accuracy.follow_shot(name, seed) for seed in range(3)]
    errors = dict(zip(engines, np.max([shot["errors"] for shot in shots], axis=0), strict=True))
    assert all(shot["complete"] and shot["outcome_as_oracle"] for shot in shots)
    assert errors[PIC] < 1e-9
    assert 1e-6 < errors[Engine("pit", 1 / 15360, "move_back")] < errors[Engine("pit", 1 / 15, "move_back")]


def test_a_shot_is_compared_up_to_the_end_of_the_reference(monkeypatch):
    monkeypatch.setattr(accuracy, "PIT", [])
    shots = [accuracy.follow_shot("15-ball break", seed) for seed in range(4)]
    assert 0 < sum(shot["complete"] for shot in shots) < 4
    assert all(shot["errors"] for shot in shots if shot["complete"])
    assert max(shot["errors"][0] for shot in shots if shot["errors"]) < 1e-9


def test_the_coarsest_timestep_has_only_good_results_from_there_on():
    rows = [{"steps_per_second": s} for s in (15, 30, 60, 120)]
    assert accuracy_report.coarsest_from(rows, [True, False, True, True]) == rows[2]
    assert accuracy_report.coarsest_from(rows, [True, True, True, False]) is None


@pytest.mark.parametrize("n", [2, 3, 96, 1000])
def test_gases_of_all_sizes_have_the_same_density_and_no_overlaps(n):
    case = speed.growing_gas(n, 2)
    table = case.scene.table
    assert n * np.pi * case.scene.balls.radius[0] ** 2 / (table.length * table.width) == pytest.approx(speed.SHARE)
    check_positions(case.scene, case.positions)
    assert not np.array_equal(*case.positions)


@pytest.mark.parametrize(("module", "option"), [(speed, "--repeats"), (stress, "--workers")])
def test_counts_below_one_are_rejected(module, option, capsys):
    with pytest.raises(SystemExit):
        module.main([option, "0"])
    assert f"{option} = 0: expected a whole number >= 1" in capsys.readouterr().err


def test_the_stress_run_is_not_larger_than_the_whole():
    with pytest.raises(SystemExit, match=r"scale = 1\.5: expected a number from"):
        stress.main(["--scale", "1.5"])


def test_the_stress_table_has_sums_and_maxima():
    data = json.loads((ROOT / "benchmarks" / "results" / "stress.json").read_text())
    kinds = list(data["shots"].values())
    kinds[1]["bad"] = [[0, 0, "rest"]]
    blocks = stress.blocks(data)
    last = [cell.strip() for cell in blocks["shots"].splitlines()[-1].strip("| ").split(" | ")]
    assert last[:3] == ["all", f"{sum(k['shots'] for k in kinds):,}", "1"]
    assert last[3] == f"{max(k['overlap'] for k in kinds):.1e}"
    assert blocks["summary"].startswith(f"1 of {last[1]} shots broke a rule")


def test_every_step_of_every_environment_plays_a_shot_and_draws_a_layout():
    envs = vector.native(16)
    last = envs.reset(seed=0)[0]
    for action in vector.actions_for(16):
        observations, _, terminated, _, infos = envs.step(action)
        assert terminated.all()
        assert infos["final_info"]["_n_events"].all()
        assert not (observations == last).any()
        last = observations
