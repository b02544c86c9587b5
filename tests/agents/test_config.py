import dataclasses
import inspect
from pathlib import Path
from typing import Any

import pytest
import torch
import yaml
from stable_baselines3.common.policies import ActorCriticPolicy

from agents.config import Config, Hyperparameters, Noise, Policy, changed, load
from agents.ppo import make_env, make_model, make_policy, make_vec_env
from billiards_env.envs import wrappers
from billiards_env.envs.tasks import TASKS
from billiards_env.sb3.aim_policy import AimPolicy

FOLDER = Path(__file__).parents[2] / "configs"
CONFIGS = sorted(FOLDER.glob("ppo/*.yaml"))


def test_missing_settings_and_arguments_have_their_defaults():
    config = Config.from_dict({"timesteps": 1000, "env": {"max_speed": 3.0}, "ppo": {"gamma": 1}})
    assert config.ppo == Hyperparameters(gamma=1.0)
    assert type(config.ppo.gamma) is float
    assert (config.env["max_speed"], config.env["scene"]) == (3.0, "pool")
    assert "render_mode" not in config.env
    # The default policy is that of Stable-Baselines3.
    assert config.policy == Policy(head="gaussian", arguments={}, hidden=(64, 64), activation="tanh")


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (None, "the configuration = None: expected a dictionary"),
        ({"seed": 1}, "timesteps is missing"),
        ({"timestep": 1}, "key = 'timestep': expected one of .*did you mean 'timesteps'"),
        ({"timesteps": 1, "ppo": {"leraning_rate": 1.0}}, "ppo: key = 'leraning_rate'.*did you mean 'learning_rate'"),
        ({"timesteps": 1, "env": {"max_shot": 2}}, "key of env = 'max_shot'.*did you mean 'max_shots'"),
        ({"timesteps": 1, "env": {"render_mode": "human"}}, "key of env = 'render_mode'"),
        ({"timesteps": -1}, "timesteps = -1: expected a number >= 0"),
        ({"timesteps": "many"}, "timesteps = 'many': expected a valid integer"),
        ({"timesteps": 1.5}, "timesteps = 1.5: expected a valid integer"),
        ({"timesteps": True}, "timesteps = True: expected a number, not true or false"),
        ({"timesteps": 1, "seed": 2**32}, "seed = 4294967296: expected a number < 4294967296"),
        ({"timesteps": 1, "n_envs": 0}, "n_envs = 0: expected a number >= "),
        ({"timesteps": 1, "env": ["pool"]}, r"env = \['pool'\]: expected a valid dictionary"),
        ({"timesteps": 1, "start_from": 3}, "start_from = 3: expected a valid string"),
        ({"timesteps": 1, "noise": {"speed_std": -0.1}}, "noise.speed_std = -0.1: expected a number >= "),
        ({"timesteps": 1, "noise": {"angle_std": 361}}, "noise.angle_std = 361: expected a number <="),
        ({"timesteps": 1, "ppo": {"target_kl": float("nan")}}, "ppo.target_kl = nan: expected a finite number"),
        ({"timesteps": 1, "ppo": {"batch_size": 1000}}, "ppo.batch_size = 1000: expected a divisor of"),
        ({"timesteps": 1, "ppo": {"gamma": 1.5}}, "ppo.gamma = 1.5: expected a number <= 1"),
        ({"timesteps": "a", "ppo": {"gamma": 2}}, r"ppo.gamma = 2: .*\ntimesteps = 'a': .*$"),
        ({"timesteps": 1, "ppo": {"gamma": "1/0"}}, "ppo.gamma = '1/0': expected a valid number"),
        ({"timesteps": 1, "policy": {"activation": "thanh"}}, "policy.activation = 'thanh': expected 'tanh', 'relu'"),
        ({"timesteps": 1, "policy": {"head": "pots"}}, "policy.head = 'pots': expected 'aim' or 'gaussian'"),
        ({"timesteps": 1, "policy": {"hidden": [8, 0]}}, r"policy.hidden\[1\] = 0: expected a number >= "),
    ],
)
def test_unknown_keys_and_impossible_values_are_refused(data, message):
    with pytest.raises(ValueError, match=f"^{message}"):
        Config.from_dict(data)


def test_changed_settings_are_checked():
    config = Config(timesteps=1000)
    assert changed(config, {"ppo.batch_size": "1.28e2", "n_envs": 8}).ppo.batch_size == 128
    with pytest.raises(ValueError, match=r"setting = 'pqo.gamma': expected a path"):
        changed(config, {"pqo.gamma": 1})
    with pytest.raises(ValueError, match="ppo: key = 'gama'"):
        changed(config, {"ppo.gama": 1})


def test_a_configuration_survives_yaml(tmp_path):
    config = Config.from_dict(
        {
            "timesteps": 1000,
            "seed": 3,
            "env": {"n_object_balls": 2},
            "noise": {"angle_std": 1},
            "start_from": "runs/other",
            "policy": {
                "head": "aim",
                "arguments": {"std_aim": [0.02, 0.001]},
                "hidden": [32, 16],
                "activation": "relu",
            },
            "ppo": {"final_learning_rate": 1e-5, "n_steps": 8},
        }
    )
    path = tmp_path / "config.yaml"
    path.write_text(config.to_yaml())
    assert load(path) == config
    assert config.noise == Noise(angle_std=1.0)
    assert (config.start_from, config.policy.head, config.policy.hidden) == ("runs/other", "aim", (32, 16))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"ppo: [1", ", line 1: expected valid YAML"),
        (b"\xff\xfe\x00", ": expected valid YAML"),
        (b"timesteps: !!python/object/apply:os.getcwd []", "could not determine a constructor"),  # runs no code
        (b"", ": expected settings, the file is empty"),
    ],
)
def test_a_file_without_settings_is_refused(tmp_path, content, message):
    path = tmp_path / "config.yaml"
    path.write_bytes(content)
    with pytest.raises(ValueError, match=rf"config = '.*config.yaml'.*{message}"):
        load(path)


def test_a_file_that_cannot_be_read_is_refused(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"config = '.*none.yaml': expected a YAML file \(No such file"):
        load(tmp_path / "none.yaml")
    with pytest.raises(IsADirectoryError, match=r"config = '.*': expected a YAML file \(Is a directory"):
        load(tmp_path)


def test_numbers_that_yaml_reads_as_text_are_numbers(tmp_path):
    path = tmp_path / "config.yaml"
    path.write_text(
        "timesteps: 1e6\nn_envs: 1.6e1\nenv: {mode: pit, dt: 1/60, max_speed: 4e0}\nppo: {learning_rate: 1e-3}\n"
    )
    config = load(path)
    assert (config.timesteps, config.n_envs, config.ppo.learning_rate) == (1_000_000, 16, 1e-3)
    assert type(config.timesteps) is int
    assert (config.env["dt"], config.env["max_speed"]) == (1 / 60, 4.0)
    assert Config.from_dict(yaml.safe_load(config.to_yaml())) == config


@pytest.mark.parametrize("path", CONFIGS, ids=lambda path: path.stem)
def test_the_configurations_of_the_project_fit_their_environments(path):
    config = load(path)
    env, envs, policy = make_env(config), make_vec_env(config), make_policy(config)
    assert env.observation_space == envs.observation_space == policy.observation_space
    assert env.action_space == envs.action_space == policy.action_space
    envs.close()


@pytest.mark.parametrize("name", ["pot", "pot_mlp", "pot_three_balls"])
def test_a_configuration_with_each_head_trains(name):
    config = load(FOLDER / "ppo" / f"{name}.yaml")
    short = dataclasses.replace(config, n_envs=8, ppo=dataclasses.replace(config.ppo, n_steps=4, batch_size=16))
    envs = make_vec_env(short)
    model = make_model(short, envs)
    before = [weights.clone() for weights in model.policy.parameters()]
    model.learn(32)
    assert any(not torch.equal(old, new) for old, new in zip(before, model.policy.parameters(), strict=True))
    envs.close()


def test_every_task_but_the_run_outs_has_a_configuration():
    assert {load(path).env["task"] for path in CONFIGS} == {name for name, task in TASKS.items() if not task.opening}


def test_the_noise_has_the_defaults_of_its_wrapper():
    bound = inspect.signature(wrappers.ExecutionNoise).bind(None)
    bound.apply_defaults()
    assert dataclasses.asdict(Noise()).items() <= bound.arguments.items()


def test_a_configuration_makes_the_policy_that_aims():
    settings = {"timesteps": 1, "env": {"n_object_balls": 2}, "policy": {"head": "aim", "arguments": {"points": 3}}}
    policy: Any = make_policy(Config.from_dict(settings))
    assert isinstance(policy, AimPolicy)
    assert policy.net.first_points.shape == (2, 3)
    settings["policy"]["arguments"] = {"point": 3}
    with pytest.raises(ValueError, match=r"policy.arguments = 'point': expected one of .* \(did you mean 'points'"):
        make_policy(Config.from_dict(settings))


def test_a_configuration_makes_the_usual_policy():
    settings = {"hidden": [8, 9], "activation": "relu"}
    policy = make_policy(Config.from_dict({"timesteps": 1, "policy": settings}))
    assert type(policy) is ActorCriticPolicy
    assert {type(layer).__name__ for layer in policy.modules()} >= {"ReLU", "Linear"}
    assert {8, 9} <= {len(weights) for name, weights in policy.named_parameters() if name.endswith("bias")}


@pytest.mark.parametrize(("last", "rates"), [(None, [4e-3] * 4), (1e-3, [4e-3, 2.5e-3, 1e-3, 1e-3])])
def test_the_learning_rate_falls_linearly_to_its_last_value(last, rates):
    config = Config.from_dict(
        {"timesteps": 1, "n_envs": 64, "ppo": {"n_steps": 2, "learning_rate": 4e-3, "final_learning_rate": last}}
    )
    model = make_model(config, make_vec_env(config))
    # An update of more steps than were left ends with less than none of them.
    assert [model.lr_schedule(remaining) for remaining in (1.0, 0.5, 0.0, -1.0)] == pytest.approx(rates)
