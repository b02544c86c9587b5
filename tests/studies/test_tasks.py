"""The measurement of players in the frozen tasks."""

import json

import pytest

pytest.importorskip("matplotlib")
pytest.importorskip("pygame")

from billiards_env import bench
from billiards_env.frozen import FROZEN
from studies import tasks
from studies.tasks import blocks, main


def test_the_command_measures_what_has_no_results(tmp_path, monkeypatch, capsys):
    few = {name: FROZEN[name] for name in ("Pot1-v0", "Pot1Noise-v0", "NineBall-v0")}
    monkeypatch.setattr(tasks, "FROZEN", few)
    monkeypatch.setattr(tasks, "PLAYERS", ("random", "geometric"))
    monkeypatch.setattr(bench, "EPISODES", 5)
    path = tmp_path / "scores.json"
    figure = tmp_path / "tasks.png"
    main(["--output", str(path), "--figure", str(figure)])
    content = figure.read_bytes()
    found = json.loads(path.read_text())
    assert list(found) == list(few)
    assert all(block in capsys.readouterr().out for block in [blocks(found)["table"]])
    found["Pot1-v0"]["players"]["random"]["return"] = 7.0  # stays: it is measured
    found["NineBall-v0"]["layouts"] = "other"  # measured again
    found["NineBall-v0"]["players"]["random"]["return"] = 7.0
    path.write_text(json.dumps(found))
    main(["--output", str(path), "--figure", str(figure)])
    assert figure.read_bytes() == content
    again = json.loads(path.read_text())
    assert again["Pot1-v0"]["players"]["random"]["return"] == 7.0
    assert again["NineBall-v0"]["players"]["random"]["return"] < 7.0
    page = blocks(again)
    assert " 7.000 |" in page["Pot1"]
    assert "`Billiards/Pot1Noise-v0`" in page["Pot1"]
    assert "29 numbers: x and y of 10 balls, the legal balls" in page["NineBall"]


def test_the_text_about_a_task_fits_it():
    found = tasks.blocks({})
    assert "A strike has 5." in found["Pot1"]
    assert "strike" not in found["Carom"].lower()
    assert "- Episode: one shot." in found["Carom"]
    assert "- Episode: at most 10 shots." in found["Clear5"]
    assert "- Episode: 5 shots." in found["SumToThree"]
