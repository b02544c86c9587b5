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


def test_the_page_describes_every_id():
    page = (tasks.FIGURE.parents[1] / "tasks.md").read_text(encoding="utf-8")
    assert "images/tasks.png" in page
    sections = dict(zip(tasks.families(), page.split("\n## ")[1:], strict=True))
    assert all(section.startswith(f"{name}\n") for name, section in sections.items())
    parts = ("- Observation: ", "- Action: ", "- Reward: ", "- Episode: ", "Arguments of", "solved from")
    for name in FROZEN:
        family = next(one for one in sections if name.removeprefix(one).startswith(("-", "Noise", "Strike")))
        section, rows = sections[family], [line for line in page.splitlines() if f"`Billiards/{name}`" in line]
        assert all(part in section for part in parts), name
        assert f"- `{name}`: v0: " in section
        assert len(rows) == 2  # success and mean return
        assert all(f" {FROZEN[name].threshold:g} |" in row for row in rows)
