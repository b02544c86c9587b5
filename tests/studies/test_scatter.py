"""The measurement of what players lose by the scatter of the cushions."""

import json

import pytest

pytest.importorskip("matplotlib")

from studies import scatter


def test_the_command_measures_each_player_without_and_with_scatter(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(scatter, "PLAYERS", {"random": "random"})
    monkeypatch.setattr(scatter, "TASKS", {"Carom-v0": "carom"})
    monkeypatch.setattr(scatter, "EPISODES", 2)
    path = tmp_path / "scatter.json"
    scatter.main(["--output", str(path)])
    cases = json.loads(path.read_text())["players"]["Carom-v0"]["random"]
    assert list(cases) == ["exact", "scatter"]
    assert all(0.0 <= case["success_rate"] <= 1.0 for case in cases.values())
    assert "| `Billiards/Carom-v0` | `random` |" in capsys.readouterr().out
