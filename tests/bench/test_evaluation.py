"""Measurements of the players without training."""

import gymnasium as gym
import numpy as np
import pytest

from billiards_env.__main__ import main
from billiards_env.bench.evaluation import measure
from billiards_env.players.env_player import acting
from billiards_env.players.named import find_player


def test_success_rates():
    arguments = ({}, (0.0, 0.0))
    rates = {n: measure(n, *arguments, 150, 1)["success_rate"] for n in ("random", "geometric", "search:300")}
    assert rates["random"] < 0.05
    assert rates["geometric"] > 0.85
    assert rates["search:300"] > 0.97
    noisy = measure("geometric", {}, (0.125, 0.075), 150, 1)["success_rate"]
    assert measure("geometric", {"noise": {"angle_std": 20.0}}, (0.0, 0.0), 40, 1)["success_rate"] < 0.3
    assert noisy < rates["geometric"] - 0.1
    assert measure("geometric", {"n_object_balls": 3, "max_shots": 5}, (0.0, 0.0), 40, 1)["success_rate"] > 0.75
    assert measure("search:300", {"task": "carom", "layout": "random"}, (0.0, 0.0), 40, 1)["success_rate"] > 0.5


def test_the_planner_plays_pots_and_run_outs():
    noise = (0.125, 0.075)
    pots = {name: measure(name, {}, noise, 60, 1)["success_rate"] for name in ("planner:1000", "geometric")}
    assert pots["planner:1000"] > pots["geometric"] + 0.05
    arguments = {"scene": "real_pool", "max_shots": 4, "action": "strike", "max_speed": 8.0}
    for task, balls in (("nine_ball", 9), ("eight_ball", 15)):
        layout = {"task": task, "n_object_balls": balls, "layout": "random"}
        assert measure("planner:600", arguments | layout, noise, 4, 1)["mean_score"] >= 1.0
    with pytest.raises(ValueError, match="task of the player 'planner' = 'place'"):
        measure("planner", {"task": "place"}, noise, 1, 1)


@pytest.fixture
def mine(tmp_path, monkeypatch):
    """A module with players."""
    (tmp_path / "my_players.py").write_text(
        "def full_hit(argument):\n"
        "    def act(seen):\n        return (seen[2:4] - seen[:2]) * [0.5, 0.25]\n"
        "    return lambda situation, rng: situation.stroke(act(situation.observation))\n"
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))


def test_a_function_of_the_user_plays(mine):
    env = gym.make("Billiards-v0")
    env.reset(seed=0)
    act = acting(find_player("my_players:full_hit", env), env)
    assert act(np.array([0.0, 0.0, 0.5, 0.5])).tolist() == [0.25, 0.125]
    measured = measure("my_players:full_hit", {"task": "carom", "max_shots": 3}, (0.0, 0.0), 20, 0)
    assert measured["mean_shots"] >= 1
    assert measured["episodes"] == 20


def test_the_command_measures_players_on_the_same_layouts(mine, capsys):
    main(["evaluate", "my_players:full_hit", "--beside", "random", "my_players:full_hit", "--episodes", "30"])
    head, *rows = capsys.readouterr().out.splitlines()
    assert head.split()[:3] == ["player", "layouts", "success"]
    assert [row.split()[0] for row in rows] == ["my_players:full_hit", "random"]


def test_a_trained_policy_plays():
    pytest.importorskip("stable_baselines3")
    measured = measure("policy:studies/results/policies/pot", {}, (0.0, 0.0), 100, 0)
    assert measured["success_rate"] > 0.8
