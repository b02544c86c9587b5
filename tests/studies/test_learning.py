"""The trainings of the published results."""

import contextlib
import json
import shutil

import gymnasium as gym
import pytest
import yaml

from agents import config as settings
from agents.ppo import deterministic
from billiards_env.bench.evaluation import evaluation_seeds, play_episodes, play_together
from billiards_env.bench.frozen import FROZEN, NAMESPACE
from billiards_env.players.env_player import acting
from billiards_env.players.named import find_player
from billiards_env.sb3 import load_policy
from billiards_env.sb3.weights import is_slim, read_weights
from studies import budgets, learning, read_results
from studies.cards import cards
from studies.learning import blocks, main
from tests.helpers.processes import InThisProcess

ROWS = {
    "seeds": [3, 4],
    "defaults": {"checkpoint_every": 128, "evaluation_episodes": 20, "env": {"scratch_penalty": 0.0}, "n_envs": 64},
    "rows": {
        "pot": {"task": "Pot1-v0", "timesteps": 128, "policy": {"arguments": {"hidden": 8}}, "ppo": {"batch_size": 64}},
        "pot_mlp": {
            "task": "Pot1-v0",
            "timesteps": 128,
            "policy": {"head": "gaussian", "hidden": [8]},
            "ppo": {"n_steps": 2},
            "plays": ["Pot1-v0", "Pot1Noise-v0"],
        },
    },
}


def test_the_published_policies_are_slim_and_have_a_card():
    files = list((learning.OUTPUT.parent / "policies").rglob("policy.pt"))
    assert {path.with_name("README.md") for path in files} == set(cards())
    assert all(is_slim(read_weights(path)) for path in files)
    assert sum(path.stat().st_size for path in files) < 9e6


@pytest.mark.slow
@pytest.mark.parametrize(("row", "task"), [pair[:2] for pair in learning.policies(read_results(learning.OUTPUT))])
def test_the_published_policies_succeed_as_often_as_before_rounding(row, task):
    """On the first of the layouts that the policy played before, up to four standard errors."""
    published = learning.runs(read_results(learning.OUTPUT)[row])[0]["tasks"][task]["success_rate"]
    policy = load_policy(learning.OUTPUT.parent / "policies" / row, FROZEN[task].arguments)[1]
    envs = gym.make_vec(NAMESPACE + task, num_envs=2000, autoreset_mode="SameStep")
    played = play_together(envs, deterministic(policy), evaluation_seeds(10, 2000).tolist())
    assert abs(played["success_rate"] - published) < 4 * (published * (1 - published) / 2000) ** 0.5 + 1e-9


@pytest.fixture
def command(tmp_path, monkeypatch):
    """A function that runs the command with tiny rows, in this process."""
    monkeypatch.setattr(settings, "LEARNING", tmp_path / "learning.yaml")
    monkeypatch.setattr(learning, "LEARNING", tmp_path / "learning.yaml")
    monkeypatch.setattr(learning, "EPISODES", 50)
    monkeypatch.setattr(learning, "LAYOUTS", 30)
    monkeypatch.setattr(learning, "executor", lambda *_: contextlib.nullcontext(InThisProcess()))

    def run(rows=ROWS):
        (tmp_path / "learning.yaml").write_text(yaml.safe_dump(rows))
        main(["--output", str(tmp_path / "learning.json"), "--images", str(tmp_path)])
        return json.loads((tmp_path / "learning.json").read_text())

    return run


def test_the_command_trains_what_has_no_results(command, tmp_path, capsys):
    content = command()
    printed = capsys.readouterr().out
    assert all(text in printed for text in blocks(content).values())
    assert [list(row["runs"]) for row in content.values()] == [["3", "4"]] * 2
    run = content["pot_mlp"]["runs"]["4"]
    assert [point[0] for point in run["curve"]] == [0, 128]
    env = gym.make("Billiards/Pot1-v0")
    player = find_player(f"policy:{tmp_path / 'runs' / 'pot_mlp' / 'seed4'}", env)
    assert play_episodes(env, acting(player, env), evaluation_seeds(4, 50).tolist()) == run["tasks"]["Pot1-v0"]
    assert run["tasks"]["Pot1Noise-v0"]["episodes"] == 50
    proposals = content["pot"]["proposals"]
    assert list(proposals) == ["Pot1-v0", "Pot1Noise-v0"]
    assert all(list(counts) == ["1", "16", "64"] for counts in proposals.values())
    assert proposals["Pot1-v0"]["64"]["success"] > proposals["Pot1-v0"]["1"]["success"]
    assert [one["simulated"] for one in proposals["Pot1Noise-v0"].values()] == [0, 16 + 256, 64 + 256]
    assert (tmp_path / "learning.png").exists()
    assert (tmp_path / "policies" / "pot" / "policy.pt").exists()

    path = tmp_path / "learning.json"
    content["pot"]["runs"]["3"]["tasks"]["Pot1-v0"]["success_rate"] = 0.75
    del content["pot_mlp"]["runs"]["3"]
    path.write_text(json.dumps(content))
    again = command()
    assert again["pot"]["runs"]["3"]["tasks"]["Pot1-v0"]["success_rate"] == 0.75
    assert again["pot_mlp"]["runs"].keys() == {"3", "4"}
    more = {**ROWS["rows"]["pot"], "plays": ["Pot1-v0", "Pot1Noise-v0"]}
    again = command({**ROWS, "rows": {**ROWS["rows"], "pot": more}})
    assert all(run["tasks"].keys() == {"Pot1-v0", "Pot1Noise-v0"} for run in again["pot"]["runs"].values())
    changed = {**ROWS, "rows": {**ROWS["rows"], "pot": {**ROWS["rows"]["pot"], "timesteps": 64}}}
    with pytest.raises(SystemExit, match="expected a run of the same settings, but timesteps is 128, not 64"):
        command(changed)


def test_budgets_train_rows_with_other_numbers_of_shots(command, tmp_path, monkeypatch, capsys):
    published = command()["pot"]
    monkeypatch.setattr(learning, "OUTPUT", tmp_path / "learning.json")
    monkeypatch.setattr(budgets, "LEARNING", tmp_path / "learning.yaml")
    monkeypatch.setattr(budgets, "FACTORS", {"pot": (0.5, 2)})
    monkeypatch.setattr(budgets, "executor", lambda *_: contextlib.nullcontext(InThisProcess()))
    path = tmp_path / "budgets.json"
    for _ in range(2):  # the second time nothing is trained
        budgets.main(["--output", str(path), "--images", str(tmp_path)])
        content = json.loads(path.read_text())
        shots, results = zip(*budgets.points(content)["pot"], strict=True)
        assert shots == (64, 128, 256)
        assert results[1]["alone"] == published["runs"]["3"]["tasks"]["Pot1-v0"]["success_rate"]
        assert results[1]["of_many"] == published["proposals"]["Pot1-v0"]["16"]["success"]
        assert all(0 <= one["alone"] <= 1 and one["seconds"] > 0 for one in results)
        assert budgets.blocks(content)["table"] in capsys.readouterr().out
        assert (tmp_path / "budgets.png").exists()
        shutil.rmtree(tmp_path / "runs" / "budgets", ignore_errors=True)
    assert not (tmp_path / "runs" / "budgets").exists()


def test_open_tasks_come_first_and_the_best_player_is_named():
    cells = [
        [cell.strip() for cell in row.strip("| ").split(" | ")]
        for row in blocks(read_results(learning.OUTPUT))["solved"].splitlines()[2:]
    ]
    states = [state for _, state, *_ in cells]
    assert states == sorted(states)
    for _, _, best, of_many, alone, random in cells:
        for highest, *others in zip(*(cell.split(" / ") for cell in (best, of_many, alone, random)), strict=True):
            rate, name = highest.strip("`)").split("% (`")
            assert float(rate) >= max(float(other.strip("%")) for other in others)
            assert (float(rate) == float(others[0].strip("%"))) >= (name == "AimPolicy:64")
    threshold = FROZEN["PlaceNoise-v0"].threshold
    assert [learning._is_solved("PlaceNoise-v0", threshold + change) for change in (-0.01, 0.01)] == [False, True]
    assert learning._is_solved("Pot3-v0", 0.0)  # by the planner
