"""The policy that is distilled from a search."""

from __future__ import annotations

import json

import gymnasium as gym
import numpy as np
import pytest

pytest.importorskip("torch")

from billiards_env.evaluation import evaluation_seeds, find_player, play
from studies import distil

ENV = "Billiards/NineBall-v0"


def after_break(seed):
    """Returns the observation after a break that keeps the turn."""
    env = gym.make(ENV)
    for k in range(100):
        observation, _ = env.reset(seed=seed + k)
        chosen = distil.action({"break": np.array([0.0, 8.0], np.float32)}, observation)
        observation, _, over, _, _ = env.step(chosen)
        if not over:
            return observation
    raise AssertionError


def test_the_features_of_a_mirrored_table_are_the_same():
    positions, potted = distil.positions_of(after_break(0))
    velocities, features = distil.candidates(positions, potted)
    for signs in ([-1.0, 1.0], [1.0, -1.0]):
        mirrored, same = distil.candidates(positions * signs, potted)
        order, other = (np.lexsort((v * s).round(6).T) for v, s in ((velocities, [1.0, 1.0]), (mirrored, signs)))
        np.testing.assert_allclose((mirrored * signs)[other], velocities[order], atol=1e-9)
        np.testing.assert_allclose(same[other], features[order], atol=1e-5)


def test_a_value_is_low_for_a_foul_and_one_for_the_last_pot():
    balls = np.array([[0.6, 0.1], *[[0.0, 2.0]] * 8, [1.07, 0.435]])  # the nine ball hangs in a pocket
    potted = np.arange(10) % 9 > 0
    velocities, _ = distil.candidates(balls, potted)
    values = distil.values_of(balls, potted, np.vstack((velocities, [[-1.0, 0.0]])))
    assert values[:-1].max() == 1.0
    assert values[-1] < 0.5


def test_the_command_trains_and_the_policy_plays(tmp_path, monkeypatch, capsys):
    for name, value in {"RACKS": 60, "BREAKS": 10, "EPISODES": 6, "EPOCHS": 2}.items():
        monkeypatch.setattr(distil, name, value)
    output, policy = tmp_path / "distil.json", tmp_path / "distilled.npz"
    distil.main(["--output", str(output), "--policy", str(policy)])
    found = json.loads(output.read_text())
    assert len(found["rounds"]) == 2
    assert found["rounds"][0]["candidates"] < found["rounds"][1]["candidates"]
    assert distil.blocks(found)["table"] in capsys.readouterr().out
    assert distil.evaluate(distil.load_weights(policy), 3)["ms_per_decision"] < 50


def test_the_policy_in_the_repository_runs_racks_out():
    assert distil.POLICY.stat().st_size < 2e6
    env = gym.make(ENV)
    played = play(env, find_player("studies.distil:act", env), evaluation_seeds(9, 200).tolist())
    assert played["success_rate"] > 0.08


def test_a_file_of_weights_runs_no_code(tmp_path):
    np.savez(tmp_path / "bad.npz", w0=np.array([print], object))
    with pytest.raises(ValueError, match="allow_pickle=False"):
        distil.load_weights(tmp_path / "bad.npz")
