"""The measurement of players in the frozen tasks."""

import json
import re

import pytest

pytest.importorskip("matplotlib")
pytest.importorskip("pygame")

from benchmarks import IMAGES
from billiards_env.bench import benchmark as bench
from billiards_env.bench.frozen import FROZEN
from studies import frozen_tasks
from studies.frozen_tasks import blocks, main


def test_the_command_measures_what_has_no_results(tmp_path, monkeypatch, capsys):
    selected = {name: FROZEN[name] for name in ("Pot1-v0", "Pot1Noise-v0", "NineBall-v0")}
    monkeypatch.setattr(frozen_tasks, "FROZEN", selected)
    monkeypatch.setattr(frozen_tasks, "PLAYERS", ("random", "geometric"))
    monkeypatch.setattr(bench, "EPISODES", 5)
    path = tmp_path / "scores.json"
    pictures = [tmp_path / "tasks.png", tmp_path / "tasks" / "Pot1.jpg", tmp_path / "tasks" / "NineBall.jpg"]
    main(["--output", str(path), "--images", str(tmp_path)])
    content = [picture.read_bytes() for picture in pictures]
    results = json.loads(path.read_text())
    assert list(results) == list(selected)
    assert blocks(results)["table"] in capsys.readouterr().out
    results["Pot1-v0"]["players"]["random"]["return"] = 7.0  # stays: it is measured
    results["NineBall-v0"]["layouts"] = "other"  # measured again
    results["NineBall-v0"]["players"]["random"]["return"] = 7.0
    path.write_text(json.dumps(results))
    main(["--output", str(path), "--images", str(tmp_path)])
    assert [picture.read_bytes() for picture in pictures] == content
    again = json.loads(path.read_text())
    assert again["Pot1-v0"]["players"]["random"]["return"] == 7.0
    assert again["NineBall-v0"]["players"]["random"]["return"] < 7.0


HEADINGS = {
    heading.lower().replace(" ", "-")
    for heading in re.findall(
        r"^#+ (.*)$", (IMAGES.parent / "environment.md").read_text(encoding="utf-8"), re.MULTILINE
    )
}


@pytest.mark.parametrize("name", FROZEN)
def test_each_id_has_a_page(name):
    page, task = frozen_tasks.page(name), FROZEN[name]
    picture = re.search(r"\]\(\.\./(images/tasks/\w+\.jpg)\)", page)
    assert picture
    assert (IMAGES.parent / picture[1]).exists()
    assert f'gym.make("Billiards/{name}")' in page
    assert all(re.search(rf"\n- \[?{part}\b.*: ", page) for part in ("Observation", "Action", "Reward", "Episode"))
    assert f"a mean return of {task.threshold:g}," in page
    assert all(f"\n| `{player}` " in page for player in ("random", "geometric", "search:200"))
    assert all(f"- {line}" in page for line in task.history)
    assert ("[strike](" in page) == (task.arguments["action"] == "strike")
    assert ("`angle_std=0.125`" in page) == ("Noise" in name)
    assert set(re.findall(r"/environment\.md#([\w-]+)", page)) <= HEADINGS


def test_the_text_about_a_task_fits_it():
    assert "29 numbers: `positions` (20), `legal_balls` (9)." in frozen_tasks.page("NineBall-v0")
    assert "- Episode: one shot." in frozen_tasks.page("Carom-v0")
    assert "- Episode: at most 10 shots." in frozen_tasks.page("Clear5-v0")
    assert "- Episode: 5 shots." in frozen_tasks.page("SumToThree-v0")


LEARNED = [
    ("Pot3Noise-v0", "three_balls:64"),  # trained without noise
    ("EightBall-v0", None),
    ("SumToThree-v0", "sum_to_three"),
    ("ThreeCushion-v0", "three_cushion:64"),
]


@pytest.mark.parametrize(("name", "policy"), LEARNED)
def test_a_learned_policy_is_one_of_the_same_task(name, policy):
    learned = frozen_tasks.learned(name)
    assert (learned and learned.policy) == policy
    assert learned is None or 0.1 < learned.success <= 1
