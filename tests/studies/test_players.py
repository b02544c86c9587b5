"""Measurements of the players without training."""

import json

import gymnasium as gym
import pytest

from agents.ppo import evaluation_seeds
from billiards_env.players.strategies import STRATEGIES, find_strategy
from studies import players
from studies.players import main, measure


def test_success_rates():
    arguments = ({}, (0.0, 0.0))
    rates = {n: measure(n, *arguments, 150, 1)["success_rate"] for n in ("random", "geometric", "search:300")}
    assert rates["random"] < 0.05
    assert rates["geometric"] > 0.85
    assert rates["search:300"] > 0.97
    noisy = measure("geometric", {}, (0.125, 0.075), 150, 1)["success_rate"]
    assert noisy < rates["geometric"] - 0.1
    assert measure("geometric", {"n_object_balls": 3, "max_shots": 5}, (0.0, 0.0), 40, 1)["success_rate"] > 0.75
    assert measure("search:300", {"scene": "carom", "task": "carom"}, (0.0, 0.0), 40, 1)["success_rate"] > 0.5


def test_the_table_is_printed_and_written(tmp_path, capsys, monkeypatch):
    output = tmp_path / "players.json"
    arguments = ["--episodes", "20", "--output", str(output)]
    main([*arguments, "--env", '{"n_object_balls": 2}', "--noise", "0.1", "0.05", "--players", "geometric", "search:5"])
    printed = capsys.readouterr().out
    written = json.loads(output.read_text())
    assert [r["player"] for r in written["results"]] == ["geometric", "search:5"]
    for r in written["results"]:
        assert r["env"] == {"n_object_balls": 2}
        assert r["noise"] == [0.1, 0.05]
        assert r["episodes"] == 20
        low, high = r["confidence_interval_95"]
        assert f"{low:.1%} - {high:.1%} |" in printed
        assert f"own, {r['player']}: {r['success_rate']:.1%}\n" in printed
    cases = {name: ({}, (std, 0.0), ("random",)) for name, std in (("first", 0.0), ("last", 1.0))}
    monkeypatch.setattr(players, "CASES", cases)
    main(arguments)
    assert [r["case"] for r in json.loads(output.read_text())["results"]] == ["first", "last"]


@pytest.mark.parametrize(
    "options", [["--env", "{}"], ["--noise", "0", "0"], ["--players", "random"], ["--seed", "1"], ["--episodes", "3"]]
)
def test_only_the_usual_run_writes_the_results_of_the_project(options, tmp_path, monkeypatch, capsys):
    cases = {"only": ({}, (0.0, 0.0), ("random",))}
    monkeypatch.setattr(players, "CASES", cases)
    monkeypatch.setattr(players, "STRATEGIES", ("random",))
    monkeypatch.setattr(players, "OUTPUT", tmp_path / "players.json")
    monkeypatch.setattr(players, "evaluation_seeds", lambda seed, episodes: evaluation_seeds(seed, 3))
    main(options)
    assert capsys.readouterr().out.endswith("not written, because there is no --output\n")
    assert not list(tmp_path.iterdir())
    main([])
    assert [path.name for path in tmp_path.iterdir()] == ["players.json"]


def test_bad_arguments_are_refused_with_a_message(tmp_path):
    for arguments, message in (
        (["--players", "nobody"], "player = 'nobody'"),
        (["--env", "{"], r"env = '{': expected JSON, such as '{\"n_object_balls\": 3}' \(Expecting property name"),
        (["--env", "3"], "env = 3: expected a mapping"),
        (["--env", '{"scen": 1}'], r"key of env = 'scen': .*did you mean 'scene'"),
        (["--env", "{}", "--noise", "-1", "0"], "angle_std = -1.0"),
        (["--episodes", "0"], "episodes = 0: expected a whole number >= 1"),
        (["--seed", "-1"], "seed = -1: expected a whole number >= 0"),
    ):
        with pytest.raises(SystemExit, match=message):
            main([*arguments, "--output", str(tmp_path / "never.json")])
    assert not list(tmp_path.iterdir())


def test_every_case_is_possible():
    for env, noise, names in players.CASES.values():
        gym.make("Billiards-v0", **env).reset(seed=0)
        assert all(find_strategy(name, noise) for name in names)
    assert {name.partition(":")[0] for *_, names in players.CASES.values() for name in names} == set(STRATEGIES)
