"""The benchmark of the vector environments measures the documented quantities. No test compares times."""

import json

import numpy as np
import pytest

from benchmarks import vector
from billiards_env.scene import Scene, check_positions


@pytest.fixture(scope="module")
def measured():
    return vector.measure(repeats=1, scale=0.01)


def test_all_results_are_written_and_printed(measured, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(vector, "measure", lambda repeats: measured)
    vector.main(["--repeats", "1", "--output", str(tmp_path / "vector.json")])
    assert [path.name for path in tmp_path.iterdir()] == ["vector.json"]
    written = json.loads((tmp_path / "vector.json").read_text())
    out = capsys.readouterr().out
    for row in written["steps"] + written["layouts"]:
        assert f"| {row['kind']} " in out
        assert row["per_second"]["median"] > 0
    assert len({row["kind"] for row in written["steps"]}) == 3 + len(vector.ENV_COUNTS)


def test_memory_grows_with_the_number_of_environments():
    few, more = vector.memory(64), vector.memory(640)
    assert few["bytes_at_most"] > few["bytes_at_rest"] > 100
    assert more["bytes_at_rest"] < 2000
    assert more["bytes_at_rest"] * 640 > 5 * few["bytes_at_rest"] * 64


def test_every_step_of_every_environment_plays_a_shot_and_draws_a_layout():
    envs = vector.native(16)
    last = envs.reset(seed=0)[0]
    for action in vector.actions_for(16):
        observations, _, terminated, _, infos = envs.step(action)
        assert terminated.all()
        assert infos["final_info"]["_n_events"].all()
        assert not (observations == last).any()
        last = observations


def test_drawn_layouts_are_valid_and_different(monkeypatch):
    drawn = []
    draw = vector.layouts.draw_tables
    monkeypatch.setattr(vector.layouts, "draw_tables", lambda *args: drawn.append((draw(*args), args[-1])[1]))
    vector.drawing("random", 15, 50)()
    check_positions(Scene.named("pool", 15), drawn[0])
    assert len(np.unique(drawn[0][:, 0], axis=0)) == 50


def test_counts_below_one_are_rejected(capsys):
    with pytest.raises(SystemExit):
        vector.main(["--repeats", "0"])
    assert "--repeats = 0: expected a whole number >= 1" in capsys.readouterr().err
