"""The study of english."""

import json

import pytest
import yaml

from agents.config import load
from agents.train import open_run, train
from benchmarks import machine
from studies import english
from studies.english import (
    CONFIGS,
    FIRST,
    OUTPUT,
    PLAYERS,
    RECIPES,
    STRIKE,
    VELOCITY,
    blocks,
    configs,
    find_result,
    main,
)


def test_the_policies_of_a_seed_have_the_same_steps_and_start_from_the_first(tmp_path):
    for name in RECIPES:
        runs = configs(name, 11, tmp_path)
        assert runs[FIRST].start_from is None
        assert {run.seed for run in runs.values()} == {11}
        assert {run.timesteps for run in runs.values()} == {load(CONFIGS / f"{name}.yaml").timesteps}
        assert runs[VELOCITY].start_from == runs[STRIKE].start_from == str(tmp_path / FIRST)
        assert [run.env["action"] for run in runs.values()] == ["velocity", "velocity", "strike"]


def test_the_tables_show_the_gain_by_strikes_and_the_effect_of_the_timestep():
    players = {
        action: {player: {"success_rate": rate, "mean_score": 2.5} for player in PLAYERS}
        for action, rate in ((VELOCITY, 0.5), (STRIKE, 0.7))
    }
    recipe = {
        "start": {VELOCITY: [0.2, 0.2], STRIKE: [0.35, 0.35]},
        "exact": {FIRST: [0.2, 0.2], VELOCITY: [0.3, 0.3], STRIKE: [0.4, 0.4]},
        "stepped": {VELOCITY: [0.25, 0.25], STRIKE: [0.1, 0.1]},
        "players": players,
    }
    made = blocks({"machine": machine(), "recipes": {"position": recipe}})
    assert "| position | search:200          |" in made["results"]
    assert "50.0% |" in made["results"]
    start = next(line for line in made["results"].splitlines() if "at the start" in line)
    assert start.split("|")[3].strip() == "20.0% (20.0 to 20.0)"
    assert start.split("|")[4].strip() == "35.0% (35.0 to 35.0)"
    gain = made["gain"].splitlines()[-1]
    assert [cell.strip() for cell in gain.strip("|").split("|")] == [
        "position",
        "10.0 points (10.0 to 10.0)",
        "-5.0 points (-5.0 to -5.0)",
        "-30.0 points (-30.0 to -30.0)",
    ]


@pytest.fixture
def command(tiny, tmp_path, monkeypatch):
    """Returns a function that runs the command on a tiny recipe, in `tmp_path`, and the list of the trained runs."""
    env = {"scene": "real_pool", "task": "position", "n_object_balls": 1}
    policy = {"head": "pots", "components": 2, "hidden": [8]}
    (tmp_path / "position.yaml").write_text(yaml.safe_dump(tiny(timesteps=128, env=env, policy=policy)))
    trained = []

    def train_here(asked, jobs):
        for folder, config in asked.items():
            open_run(config, folder)
            train(config, folder)
            trained.append(folder.name)

    settings = {"CONFIGS": tmp_path, "RECIPES": ("position",), "SEEDS": (3, 4), "EPISODES": 2, "train_all": train_here}
    for name, value in settings.items():
        monkeypatch.setattr(english, name, value)
    return lambda: main(["--runs", str(tmp_path / "runs"), "--output", str(tmp_path / "english.json")]), trained


def test_a_study_with_results_is_not_trained_again(command, tmp_path, capsys):
    run, trained = command
    run()
    assert trained == [FIRST, FIRST, VELOCITY, STRIKE, VELOCITY, STRIKE]
    printed, written = capsys.readouterr().out, (tmp_path / "english.json").read_text()
    found = json.loads(written)
    tables = "\n\n".join(blocks(found).values())
    assert tables in printed
    assert [len(found["recipes"]["position"]["exact"][name]) for name in (FIRST, VELOCITY, STRIKE)] == [2, 2, 2]
    run()
    assert len(trained) == 6
    assert capsys.readouterr().out.startswith(tables)
    assert (tmp_path / "english.json").read_text() == written


def test_results_of_other_seeds_or_recipes_are_not_used(tmp_path, monkeypatch):
    path = tmp_path / "english.json"
    assert find_result(path) is None
    found = json.loads(OUTPUT.read_text())
    found["recipes"]["clear"]["config"]["timesteps"] += 1024
    path.write_text(json.dumps(found))
    assert find_result(path) is None
    monkeypatch.setattr(english, "SEEDS", (1, 2))
    assert find_result(OUTPUT) is None


def test_the_committed_results_are_those_of_the_recipes(monkeypatch, capsys):
    monkeypatch.setattr(english, "measure", None)
    before = OUTPUT.read_bytes()
    main([])
    assert blocks(json.loads(before))["results"] in capsys.readouterr().out
    assert OUTPUT.read_bytes() == before
