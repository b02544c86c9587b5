"""Measurements of the players without training."""

import json

import pytest

from billiards_env.players.strategies import STRATEGIES
from studies import players
from studies.players import main, measure, row


def test_success_rates():
    arguments = ({}, (0.0, 0.0))
    rates = {n: measure(n, *arguments, 150, 1)["success_rate"] for n in ("random", "geometric", "search:300")}
    assert rates["random"] < 0.05
    assert rates["geometric"] > 0.85
    assert rates["search:300"] > 0.97
    noisy = measure("geometric", {}, (0.125, 0.075), 150, 1)["success_rate"]
    assert noisy < rates["geometric"] - 0.1
    assert measure("geometric", {"n_object_balls": 3, "max_shots": 5}, (0.0, 0.0), 40, 1)["success_rate"] > 0.75
    assert measure("search:300", {"task": "carom", "layout": "random"}, (0.0, 0.0), 40, 1)["success_rate"] > 0.5


def test_the_table_is_printed_and_written(tmp_path, capsys):
    output = tmp_path / "players.json"
    settings = ["--env", '{"n_object_balls": 2}', "--noise", "0.1", "0.05", "--seed", "3"]
    main(["--episodes", "20", *settings, "--players", "geometric", "search:5", "--output", str(output)])
    printed = capsys.readouterr().out
    written = json.loads(output.read_text())
    assert (written["env"], written["noise"], written["seed"]) == ({"n_object_balls": 2}, [0.1, 0.05], 3)
    assert list(written["results"]) == ["geometric", "search:5"]
    for name, result in written["results"].items():
        assert result["episodes"] == 20
        assert all(cell in printed for cell in row(name, result))
        again = measure(name, {"n_object_balls": 2}, (0.1, 0.05), 20, 3)
        assert {**again, "ms_per_decision": 0} == {**result, "ms_per_decision": 0}


def test_all_players_play_the_usual_game_and_nothing_is_written(tmp_path, monkeypatch, capsys):
    played = []

    def spy(name, env, noise, episodes, seed):
        played.append((name, env, noise, episodes, seed))
        return measure(name, env, noise, 2, seed)

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(players, "measure", spy)
    monkeypatch.setattr(players, "write_json", None)
    main([])
    assert played == [(name, {}, (0.0, 0.0), 1000, 0) for name in STRATEGIES]
    printed = capsys.readouterr().out
    assert all(f"| {name} " in printed for name in STRATEGIES)
    assert not list(tmp_path.iterdir())


def test_bad_arguments_are_refused_with_a_message(tmp_path):
    for arguments, message in (
        (["--players", "nobody"], "player = 'nobody'"),
        (["--env", "{"], r"env = '{': expected JSON, such as '{\"n_object_balls\": 3}' \(Expecting property name"),
        (["--env", "3"], "env = 3: expected a valid dictionary"),
        (["--env", '{"scen": 1}'], r"key of env = 'scen': .*did you mean 'scene'"),
        (["--env", "{}", "--noise", "-1", "0"], "angle_std = -1.0"),
        (["--episodes", "0"], "episodes = 0: expected a whole number >= 1"),
        (["--seed", "-1"], "seed = -1: expected a whole number >= 0"),
    ):
        with pytest.raises(SystemExit, match=message):
            main([*arguments, "--output", str(tmp_path / "never.json")])
    assert not list(tmp_path.iterdir())
