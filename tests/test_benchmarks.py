"""The benchmarks measure what they say; no time is asserted."""

from __future__ import annotations

import json

import numpy as np
import pytest

from benchmarks import error_limit, figures, print_table, rendering, speed, start_up
from billiards_env.engine import simulate_batch
from billiards_env.scene import Scene


@pytest.fixture
def matplotlib():
    return pytest.importorskip("matplotlib")


def test_cases_are_repeatable_and_legal():
    for case, again in zip(speed.cases(0.001), speed.cases(0.001), strict=True):
        assert np.array_equal(case.positions, again.positions)
        assert np.array_equal(case.velocities, again.velocities)
        simulate_batch(case.scene, case.positions, case.velocities, threads=1)


def test_random_shots_are_no_faster_than_an_action_allows():
    case = speed.random_shots("", Scene.named("pool"), 200)
    speeds = np.hypot(*case.velocities.T)
    assert speeds.max() <= speed.MAX_SPEED * (1 + 1e-15)
    assert speeds.min() < 0.5 * speed.MAX_SPEED


@pytest.mark.parametrize("layout", ["rack", "tight_rack"])
def test_breaks_hit_the_rack(layout):
    case = speed.breaks("", layout, 20)
    assert (simulate_batch(case.scene, case.positions, case.velocities).first_hit == 1).all()


def test_speed_writes_its_results_whole(tmp_path, monkeypatch, capsys):
    measured = small_measurement()
    monkeypatch.setattr(speed, "measure", lambda repeats: measured)
    speed.main(["--repeats", "1", "--output", str(tmp_path / "speed.json")])
    written = json.loads((tmp_path / "speed.json").read_text())
    assert [path.name for path in tmp_path.iterdir()] == ["speed.json"]
    assert len(written["batch"]) == len(speed.cases(0.001))
    out = capsys.readouterr().out
    assert all(row["case"] in out for row in written["batch"])


def small_measurement():
    result = speed.measure(repeats=1, scale=0.001)
    for row in result["batch"]:
        events, rate = row["events_per_shot"], row["shots_per_second"]["median"]
        assert row["microseconds_per_event"]["median"] == pytest.approx(1e6 / (events * rate))
    return result


@pytest.mark.parametrize("kind", ["carom", "9-ball break, loose"])
def test_the_error_is_near_the_unavoidable_one(kind):
    found = error_limit.summary([error_limit.compare(kind, seed) for seed in range(3)])
    assert found["same_events"] == found["shots"] == 3
    assert 0 < found["median_ratio"] <= found["max_ratio"] < 100


def test_the_error_limit_notices_another_shot(monkeypatch):
    right = error_limit.run
    monkeypatch.setattr(
        error_limit,
        "run",
        lambda scene, places, velocity, **kw: right(scene, places, [v * (1 + 1e-6) for v in velocity], **kw),
    )
    assert error_limit.compare("carom", 0)["ratio"] > 1e6


def test_the_error_limit_is_drawn_and_written(matplotlib, tmp_path):
    args = [
        "--shots",
        "1",
        "--workers",
        "1",
        "--output",
        str(tmp_path / "e.json"),
        "--picture",
        str(tmp_path / "e.png"),
    ]
    error_limit.main(args)
    assert json.loads((tmp_path / "e.json").read_text())["kinds"].keys() == error_limit.KINDS.keys()
    assert (tmp_path / "e.png").read_bytes().startswith(b"\x89PNG")


def test_start_up_reads_the_clock_of_a_fresh_process(tmp_path):
    begin, printed = start_up.run("import time; print([time.time()])", tmp_path)
    assert begin < printed


def test_a_failing_process_is_not_a_measurement(tmp_path):
    with pytest.raises(start_up.subprocess.CalledProcessError):
        start_up.run("raise SystemExit(1)", tmp_path)


@pytest.mark.parametrize("module", [speed, error_limit, rendering, start_up])
def test_counts_below_one_are_refused(module, capsys):
    option = "--shots" if module is error_limit else "--repeats"
    with pytest.raises(SystemExit):
        module.main([option, "0"])
    assert f"{option} = 0: expected a whole number >= 1" in capsys.readouterr().err


def test_tables_are_markdown(capsys):
    print_table(("what", "s"), [("a", "1.00"), ("bcdef", "12.00")])
    assert capsys.readouterr().out == ("| what  |     s |\n| ----- | ----: |\n| a     |  1.00 |\n| bcdef | 12.00 |\n")


def test_the_picture_is_of_the_shot_its_title_tells(matplotlib, tmp_path):
    figures.main(["--folder", str(tmp_path)])
    picture = (tmp_path / "shot.png").read_bytes()
    assert picture.startswith(b"\x89PNG")
    assert len(picture) < 150_000
    shot = figures.shot_of(Scene.named("pool", 4), **figures.SHOT)
    assert shot.events is not None
    kinds = shot.events["kind"]
    hits, drops = (shot.events[kinds == kind] for kind in ("ball_ball", "pocket"))
    assert hits[["ball", "other"]].tolist() == [(0, 2), (2, 3)]
    assert drops["ball"].tolist() == [3, 2]
