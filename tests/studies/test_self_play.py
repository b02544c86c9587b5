"""The player that learns by self-play, and its matches."""

import json

import yaml

from agents import config as settings
from studies import self_play

ROW = {
    "timesteps": 500,
    "checkpoint_every": 500,
    "evaluation_episodes": 2,
    "env": {
        "task": "eight_ball",
        "n_players": 2,
        "scene": "real_pool",
        "can_place": False,
        "observe": ["positions", "legal_balls", "in_hand"],
    },
    "noise": {"angle_std": 1.0},
    "learner": "likelihood",
    "policy": {"arguments": {"hidden": 8, "points": 2}},
    "likelihood": {"layouts": 8, "hits": 4, "own": 4, "samples": 4},
}


def test_the_command_trains_publishes_and_plays(tmp_path, monkeypatch, capsys):
    for module in (settings, self_play):
        monkeypatch.setattr(module, "LEARNING", tmp_path / "learning.yaml")
    monkeypatch.setattr(self_play, "MATCHES", {"alone": ("", "geometric"), "of 2": (":2", "geometric")})
    (tmp_path / "learning.yaml").write_text(
        yaml.safe_dump({"seeds": [3], "defaults": {"env": {}}, "rows": {"eight_ball": ROW}})
    )
    path = tmp_path / "self_play.json"
    call = ["--output", str(path), "--games", "2"]
    self_play.main(call)
    content = json.loads(path.read_text())
    assert {name: sum(result) for name, result in content["matches"].items()} == {"alone": 2, "of 2": 2}
    assert content["curve"][-1][0] >= 500
    assert (tmp_path / "policies" / "eight_ball" / "policy.pt").exists()
    assert self_play.blocks(content)["table"] in capsys.readouterr().out
    saved = tmp_path / "runs" / "eight_ball" / "of 2 2.json"  # an interrupted match continues from this file
    games = json.loads(saved.read_text())
    (pair,) = games["results"]
    assert games["results"][pair] == content["matches"]["of 2"]
    saved.write_text(json.dumps({**games, "results": {pair: [0, 1, 1]}}))
    content["matches"]["alone"] = [0, 2, 0]
    del content["matches"]["of 2"]
    path.write_text(json.dumps(content))
    self_play.main(call)  # what has results is not measured again
    again = json.loads(path.read_text())
    assert again["matches"]["alone"] == [0, 2, 0]
    assert again == {**content, "matches": {**again["matches"]}}
    assert again["matches"]["of 2"] == [0, 1, 1]
