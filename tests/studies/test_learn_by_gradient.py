"""The network that learns by learn_by_gradient."""

from __future__ import annotations

import json

import gymnasium as gym
import numpy as np
import pytest
import torch

from billiards_env.envs import BilliardsVectorEnv
from billiards_env.evaluation import evaluation_seeds, find_player, play
from billiards_env.scene import Scene
from studies import learn_by_gradient


@pytest.fixture(autouse=True)
def small(monkeypatch):
    monkeypatch.setattr(learn_by_gradient, "BATCH", 32)
    monkeypatch.setattr(learn_by_gradient, "RUNS", {64: (20,)})
    monkeypatch.setattr(learn_by_gradient, "EPISODES", 8)


def test_a_mirrored_layout_has_mirrored_actions():
    torch.manual_seed(0)
    network = learn_by_gradient.Network(Scene.named("pool"))
    seen = torch.tensor([[0.1, -0.3, 0.4, 0.2]])
    places: list[list[float]] = network.signs.tolist()
    for x, y in ((1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)):
        signs = torch.tensor([x, y])
        for pocket, place in enumerate(places):
            other = places.index([place[0] * x, place[1] * y])
            action, chance = network(seen, torch.tensor([pocket]))
            mirrored, same = network(seen * signs.repeat(2), torch.tensor([other]))
            torch.testing.assert_close(mirrored, action * signs)
            torch.testing.assert_close(same, chance)


def test_a_step_along_the_gradient_of_the_loss_brings_a_shot_nearer():
    torch.manual_seed(1)
    envs = BilliardsVectorEnv(learn_by_gradient.BATCH)
    envs.reset(seed=0)
    network = learn_by_gradient.Network(envs.single_env.scene)
    played = learn_by_gradient.play(network, envs)
    before = (network.radius[played.pockets] - played.margins).abs()
    optimiser = torch.optim.SGD(network.parameters(), lr=3e-4)
    learn_by_gradient.loss_of(network, played).backward()
    optimiser.step()
    speeds = torch.tensor(learn_by_gradient.SPEEDS)[played.speeds, None]
    change = speeds * network(played.observations, played.pockets)[0] - played.actions
    after = (network.radius[played.pockets] - played.margins - (played.slopes * change).sum(-1)).abs()
    assert 0 < change.norm(dim=-1).max() < learn_by_gradient.NEAR
    assert after.mean() < before.mean()


def test_a_pot_with_a_scratch_lowers_the_chance_of_its_speed():
    torch.manual_seed(0)
    envs = BilliardsVectorEnv(2)
    envs.reset(seed=0)
    network = learn_by_gradient.Network(envs.single_env.scene)
    played = learn_by_gradient.play(network, envs)
    played = played._replace(margins=torch.tensor([0.01, 0.01]), scratches=torch.tensor([False, True]))
    before = network(played.observations, played.pockets)[1].detach()
    learn_by_gradient.loss_of(network, played).backward()
    torch.optim.SGD(network.chances.parameters(), lr=0.1).step()
    change = network(played.observations, played.pockets)[1] - before
    clean, scratched = change[torch.arange(2), played.speeds].tolist()
    assert clean > scratched


def test_a_short_training_learns():
    assert learn_by_gradient.train(1, 6400, 300)[0] > 0.05  # a random shot pots the ball once in a hundred times


def test_the_command_writes_what_has_no_results(tmp_path, capsys):
    path, policy = tmp_path / "learn_by_gradient.json", tmp_path / "gradient.npz"
    arguments = ["--output", str(path), "--policy", str(policy)]
    learn_by_gradient.main(arguments)
    weights = policy.read_bytes()
    found = json.loads(path.read_text())
    assert 0.0 <= found["results"]["64"]["20"] <= 1.0
    found["results"]["64"]["20"] = 0.75
    path.write_text(json.dumps(found))
    learn_by_gradient.main(arguments)
    assert "75.0%" in capsys.readouterr().out
    policy.unlink()
    learn_by_gradient.main(arguments)
    assert policy.read_bytes() == weights
    assert "75.0%" not in capsys.readouterr().out


def test_the_policy_in_the_repository_pots_balls():
    env = gym.make("Billiards/Pot1-v0")
    played = play(env, find_player("studies.learn_by_gradient:act", env), evaluation_seeds(3, 100).tolist())
    assert played["success_rate"] > 0.8


def test_a_file_of_weights_runs_no_code(tmp_path):
    np.savez(tmp_path / "bad.npz", signs=np.array([print], object))
    with pytest.raises(ValueError, match="allow_pickle=False"):
        learn_by_gradient.load(tmp_path / "bad.npz")
