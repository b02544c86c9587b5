"""The benchmark of the vector environments measures the documented quantities. No test compares times."""

import json

import pytest

from benchmarks import vector


@pytest.fixture(scope="module")
def measured():
    return vector.measure(repeats=1, scale=0.01)


def test_all_results_are_written_and_printed(measured, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(vector, "measure", lambda repeats: measured)
    vector.main(["--repeats", "1", "--output", str(tmp_path / "vector.json")])
    assert [path.name for path in tmp_path.iterdir()] == ["vector.json"]
    written = json.loads((tmp_path / "vector.json").read_text())
    out = capsys.readouterr().out
    for row in written["steps"]:
        assert f"| {row['kind']} " in out
        assert row["per_second"]["median"] > 0
    assert 0 < written["outside_engine"]["median"] < 1
    assert len({row["kind"] for row in written["steps"]}) == 3 + len(vector.ENV_COUNTS) + len(vector.DOORS)


def test_every_step_of_every_environment_plays_a_shot_and_draws_a_layout():
    envs = vector.native(16)
    last = envs.reset(seed=0)[0]
    for action in vector.actions_for(16):
        observations, _, terminated, _, infos = envs.step(action)
        assert terminated.all()
        assert infos["final_info"]["_n_events"].all()
        assert not (observations == last).any()
        last = observations
