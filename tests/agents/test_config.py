import dataclasses
import inspect
from typing import Any

import pytest
from stable_baselines3.common.policies import ActorCriticPolicy

from agents.config import Config, load, rows
from agents.ppo import make_env, make_policy, make_ppo, make_vec_env
from billiards_env.bench.frozen import FROZEN
from billiards_env.players.levels import LEVELS
from billiards_env.sb3 import PPO_SETTINGS, AimPolicy
from billiards_env.shots.noise import EXECUTION_NOISE


@pytest.mark.parametrize("name", rows())
def test_each_row_is_a_policy_for_its_task_and_a_frozen_task(name):
    row, config = rows()[name], load(name, seed=3)
    assert (config.seed, config.task) == (3, row.get("task"))
    assert type(make_policy(config)) is (ActorCriticPolicy if config.policy["head"] == "gaussian" else AimPolicy)
    if config.task is None:  # a game
        assert (row["plays"], config.env["n_players"]) == ([], 2)
        assert (config.noise["angle_std"], config.noise["speed_std"]) == LEVELS["club"].noise
        return
    assert set(row["plays"]) <= FROZEN.keys()
    assert config.noise == (EXECUTION_NOISE if FROZEN[row["task"]].noise else None)
    assert config.env["task"] in (FROZEN[row["task"]].arguments["task"], row["env"].get("task"))


def test_the_arguments_of_ppo_are_the_settings_and_change_during_training():
    config = Config(timesteps=1000, n_envs=4, settings={"learning_rate": ["1e-3", 1e-5], "batch_size": 2})
    model = make_ppo(config, make_vec_env(config))
    assert (model.batch_size, model.n_epochs, model.gamma) == (2, PPO_SETTINGS["n_epochs"], 1.0)
    assert [model.lr_schedule(remaining) for remaining in (1.0, 0.5, -0.1)] == pytest.approx([1e-3, 5.05e-4, 1e-5])


def test_a_configuration_survives_yaml_with_all_values(tmp_path):
    changes = {"noise": {"angle_std": 1}, "start_from": "runs/other", "policy": {"arguments": {"points": 4}}}
    env = {"mode": "pit", "dt": "1/60", "randomize": {"dt": ["1/240", "1e-1"]}}
    config = Config.from_dict({"timesteps": "1e3", "env": env, **changes})
    assert (config.timesteps, config.env["dt"], config.env["scene"]) == (1000, 1 / 60, "pool")
    assert config.env["randomize"] == {"dt": [1 / 240, 0.1]}
    assert "render_mode" not in config.env
    path = tmp_path / "config.yaml"
    path.write_text(config.to_yaml())
    assert load(path) == config
    assert {field.name for field in dataclasses.fields(Config)} == set(inspect.signature(Config).parameters)


WRONG = [
    (None, "the settings = None: expected a mapping"),
    ({"seed": 1}, "the settings.timesteps is missing"),
    ({"timestep": 1}, "key of the settings = 'timestep': expected one of .*did you mean 'timesteps'"),
    ({"timesteps": 1.5}, "timesteps = 1.5: expected a whole number"),
    ({"timesteps": 1, "seed": -1}, "seed = -1: expected a whole number"),
    ({"timesteps": 1, "task": "Pot-v0"}, "task = 'Pot-v0': expected one of .*did you mean"),
    ({"timesteps": 1, "env": {"max_shot": 2}}, "key of env = 'max_shot'.*did you mean 'max_shots'"),
    (
        {"timesteps": 1, "env": {"task": "nine_ball", "n_players": 2}},
        "env.n_players = 2: expected 1; .*'likelihood'",
    ),
    ({"timesteps": 1, "env": {"max_speed": -1.0}}, "max_speed = -1.0: expected a number from"),
    ({"timesteps": 1, "noise": {"angle": 1}}, "key of noise = 'angle'"),
    ({"timesteps": 1, "noise": {"speed_std": -0.1}}, "speed_std = -0.1: expected a number from"),
    ({"timesteps": 1, "policy": "aim"}, "policy = 'aim': expected a mapping"),
    ({"timesteps": 1, "policy": {"haed": "aim"}}, r"key of policy \(aim\) = 'haed': expected one of .*'head'"),
    ({"timesteps": 1, "policy": {"hidden": [8]}}, r"key of policy \(aim\) = 'hidden'"),
    ({"timesteps": 1, "ppo": {"n_steps": "abc"}}, "ppo.n_steps = 'abc': expected a whole number"),
    ({"timesteps": 1, "ppo": {"gamma": 2.0}}, "ppo.gamma = 2.0: expected a number from 0"),
    ({"timesteps": 1, "ppo": {"learning_rate": -1}}, "ppo.learning_rate = -1"),
    ({"timesteps": 1, "ppo": {"target_kl": "abc"}}, "ppo.target_kl = 'abc': expected a number"),
    ({"timesteps": 1, "ppo": {"normalize_advantage": 2}}, "ppo.normalize_advantage = 2: expected"),
    ({"timesteps": 1, "n_envs": 4, "ppo": {"batch_size": 3}}, "ppo.batch_size = 3: expected a divisor of .* = 4"),
    ({"timesteps": 1, "ppo": {"leraning_rate": 1.0}}, "key of ppo = 'leraning_rate'.*did you mean 'learning_rate'"),
    ({"timesteps": 1, "policy": {"head": "pots"}}, "policy.head = 'pots': expected one of 'aim', 'gaussian'"),
    ({"timesteps": 1, "learner": "likelihood", "likelihood": {"passes": 0}}, "likelihood.passes = 0: expected a whole"),
    ({"timesteps": 1, "policy": {"arguments": {"aims": 1}}}, "policy.arguments = 'aims': expected one of"),
]


@pytest.mark.parametrize(("data", "message"), WRONG)
def test_unknown_keys_and_impossible_values_are_refused(data, message):
    with pytest.raises((TypeError, ValueError), match=f"^{message}"):
        make_policy(Config.from_dict(data))


WRONG_FILES = [
    (b"ppo: [1", "expected a file of settings"),
    (b"\xff\xfe\x00", "expected a file of settings"),
    (b"timesteps: !!python/object/apply:os.getcwd []", "could not determine a constructor"),  # runs no code
    (b"", "expected settings, the file has none"),
]


@pytest.mark.parametrize(("content", "message"), WRONG_FILES)
def test_a_file_without_settings_is_refused(tmp_path, content, message):
    path = tmp_path / "config.yaml"
    with pytest.raises(FileNotFoundError, match=r"config.yaml': expected a file of settings, but it does not exist"):
        load(path)
    path.write_bytes(content)
    with pytest.raises(ValueError, match=f"(path|config) = '.*config.yaml': .*{message}"):
        load(path)
    with pytest.raises(ValueError, match=r"config = 'pots': expected one of 'pot', .*did you mean 'pot'"):
        load("pots")


def test_the_noise_is_that_of_the_configuration():
    noise = {"angle_std": 1.0, "offset_std": 0.002}
    spec: Any = make_env(Config(timesteps=0, noise=noise)).spec
    assert spec.kwargs["noise"] == EXECUTION_NOISE | noise
    assert Config(timesteps=0, task="Pot1Noise-v0").noise == EXECUTION_NOISE
    assert Config(timesteps=0, task="Pot1Noise-v0", noise=None).noise is None
