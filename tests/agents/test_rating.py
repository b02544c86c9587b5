"""The training of ratings."""

import shutil

import pytest
import torch

from agents.config import Config
from agents.evaluate import evaluate
from agents.ppo import load_policy, make_ppo_policy
from agents.train import learning_curve, open_run, train
from billiards_env.sb3.rated import RatedPolicy
from tests.helpers.training import trained_run

SETTINGS = {
    "timesteps": 4096,
    "n_envs": 512,
    "seed": 3,
    "checkpoint_every": 2048,
    "evaluation_episodes": 50,
    "env": {"task": "place", "scratch_penalty": 0.0},
    "policy": {"head": "rated_hits", "components": 6, "speeds": [0.1, 0.6], "hidden": [16], "activation": "relu"},
    "rating": {"drawn": 4, "kept": 2, "batch_size": 256},
}


def weights(folder):
    return torch.load(folder / "policy.pt", weights_only=True)


@pytest.fixture(scope="module")
def rated(tmp_path_factory):
    """Returns the folder of a finished run. Tests must not change it."""
    return trained_run(Config.from_dict(SETTINGS), tmp_path_factory.mktemp("runs") / "rated")


def test_a_run_has_a_policy_a_learning_curve_and_an_evaluation(rated, tmp_path):
    assert [point.steps for point in learning_curve(rated)] == [0, 2048, 4096]
    config, policy = load_policy(rated)
    assert isinstance(policy, RatedPolicy)
    assert config == Config.from_dict(SETTINGS)
    shutil.copytree(rated, tmp_path / "run")
    found = evaluate(tmp_path / "run")
    assert found["policy"]["success_rate"] == learning_curve(rated)[-1].success


def test_a_resumed_run_ends_with_the_weights_of_an_uninterrupted_one(rated, tmp_path):
    config = Config.from_dict(SETTINGS)
    shutil.copytree(rated, tmp_path / "run")
    for name in ("policy.pt", "model.zip"):
        (tmp_path / "run" / name).unlink()
    open_run(config, tmp_path / "run")
    train(config, tmp_path / "run")
    assert [point.steps for point in learning_curve(tmp_path / "run")] == [0, 2048, 4096]
    expected, found = weights(rated), weights(tmp_path / "run")
    assert all(torch.equal(found[name], value) for name, value in expected.items())


def test_a_run_starts_with_the_weights_of_another_one(rated, tmp_path):
    config = Config.from_dict({**SETTINGS, "timesteps": 0, "start_from": str(rated)})
    found = weights(trained_run(config, tmp_path / "run"))
    assert all(torch.equal(found[name], value) for name, value in weights(rated).items())


def test_training_raises_the_chance_of_success(tmp_path):
    longer = {**SETTINGS, "timesteps": 49_152, "checkpoint_every": 49_152, "evaluation_episodes": 500}
    curve = learning_curve(trained_run(Config.from_dict(longer), tmp_path / "run"))
    assert curve[-1].success > curve[0].success + 0.1


def test_pots_with_execution_noise(tmp_path):
    policy = {**SETTINGS["policy"], "head": "rated_pots"}
    config = Config.from_dict({**SETTINGS, "timesteps": 512, "env": {}, "noise": {}, "policy": policy})
    assert learning_curve(trained_run(config, tmp_path / "run"))[-1].steps == 512


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"rating": {"kept": 3}}, "rating.kept = 3"),
        ({"rating": {"kept": 8, "drawn": 4}}, "rating.kept = 8: expected at most rating.drawn = 4"),
        ({"rating": {"kept": 6, "drawn": 6}}, "rating.kept = 6: expected a divisor of n_envs = 512"),
        ({"env": {"max_shots": 2}}, "policy.head = 'rated_hits' with max_shots = 2: expected 1"),
    ],
)
def test_impossible_settings_are_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        Config.from_dict({**SETTINGS, **changes})


def test_ppo_does_not_train_ratings():
    with pytest.raises(ValueError, match="expected a head that PPO trains"):
        make_ppo_policy(Config.from_dict(SETTINGS))
