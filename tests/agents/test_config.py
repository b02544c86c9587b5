from pathlib import Path

import pytest

from agents.config import PPO, Config, load

CONFIGS = sorted(Path(__file__).parents[2].glob("configs/ppo/*.yaml"))


def test_fields_left_out_take_their_defaults():
    config = Config.from_dict({"timesteps": 1000, "ppo": {"gamma": 1}})
    assert config.ppo == PPO(gamma=1.0)
    assert type(config.ppo.gamma) is float
    assert config.policy.hidden == (64, 64)


def test_arguments_of_the_environment_left_out_are_filled_in():
    config = Config.from_dict({"timesteps": 1, "env": {"max_speed": 3.0}})
    assert config.env["max_speed"] == 3.0
    assert config.env["scene"] == "pool"
    assert "render_mode" not in config.env


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({"timestep": 1}, r"key of the configuration = 'timestep'.*did you mean 'timesteps'"),
        (
            {"timesteps": 1, "ppo": {"leraning_rate": 1.0}},
            r"key of ppo = 'leraning_rate'.*did you mean 'learning_rate'",
        ),
        ({"timesteps": 1, "policy": {"hiden": [8]}}, r"key of policy = 'hiden'.*did you mean 'hidden'"),
        ({"timesteps": 1, "env": {"max_shot": 2}}, r"key of env = 'max_shot'.*did you mean 'max_shots'"),
        ({"timesteps": 1, "env": {"render_mode": "human"}}, "key of env = 'render_mode'"),
        ({"seed": 1}, "timesteps is missing"),
        ({"timesteps": 0}, r"timesteps = 0: expected a number >= 1"),
        ({"timesteps": 1, "seed": -1}, r"seed = -1: expected a number >= 0"),
        ({"timesteps": 1, "ppo": {"batch_size": 1000}}, r"ppo.batch_size = 1000: expected a divisor of"),
        ({"timesteps": 1, "ppo": {"batch_size": 1}}, r"ppo.batch_size = 1: expected a number >= 2"),
        ({"timesteps": 1, "ppo": {"learning_rate": 0}}, r"ppo.learning_rate = 0.0: expected a number > 0"),
        ({"timesteps": 1, "ppo": {"learning_rate": float("nan")}}, "ppo.learning_rate = nan: expected a finite number"),
        ({"timesteps": 1, "ppo": {"gamma": 1.5}}, r"ppo.gamma = 1.5: expected a number from 0 to 1"),
        ({"timesteps": 1, "ppo": {"ent_coef": -1.0}}, r"ppo.ent_coef = -1.0: expected a number >= 0"),
        ({"timesteps": 1, "policy": {"activation": "thanh"}}, r"policy.activation = 'thanh'.*did you mean 'tanh'"),
        ({"timesteps": 1, "policy": {"hidden": [8, 0]}}, r"policy.hidden\[1\] = 0: expected a number >= 1"),
    ],
)
def test_unknown_keys_and_impossible_values_are_refused_by_name(data, message):
    with pytest.raises(ValueError, match=message):
        Config.from_dict(data)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (None, "the configuration = None: expected a mapping"),
        ({"timesteps": "many"}, "timesteps = 'many': expected a whole number, not str"),
        ({"timesteps": 1.0}, "timesteps = 1.0: expected a whole number, not float"),
        ({"timesteps": True}, "timesteps = True: expected a whole number, not bool"),
        ({"timesteps": 1, "ppo": {"gamma": "1e-3"}}, "ppo.gamma = '1e-3': expected a number, not str .*write 1.0e-3"),
        ({"timesteps": 1, "ppo": {"gamma": True}}, "ppo.gamma = True: expected a number, not bool"),
        ({"timesteps": 1, "ppo": {"gamma": None}}, "ppo.gamma = None: expected a number, not NoneType"),
        ({"timesteps": 1, "ppo": [1]}, r"ppo = \[1\]: expected a mapping"),
        ({"timesteps": 1, "env": ["pool"]}, r"env = \['pool'\]: expected a mapping, not list"),
        ({"timesteps": 1, "policy": {"hidden": 64}}, "policy.hidden = 64: expected a list, not int"),
        ({"timesteps": 1, "policy": {"hidden": [64, "x"]}}, r"policy.hidden\[1\] = 'x': expected a whole number"),
        ({"timesteps": 1, "policy": {"activation": 1}}, "policy.activation = 1: expected text, not int"),
    ],
)
def test_values_of_the_wrong_type_are_refused_by_name(data, message):
    with pytest.raises(TypeError, match=message):
        Config.from_dict(data)


def test_yaml_is_read_back_as_it_was_written(tmp_path):
    config = Config.from_dict(
        {
            "timesteps": 1000,
            "seed": 3,
            "env": {"n_object_balls": 2},
            "policy": {"hidden": [32, 16], "activation": "relu"},
            "ppo": {"final_learning_rate": 1e-5, "n_steps": 8},
        }
    )
    path = tmp_path / "config.yaml"
    path.write_text(config.to_yaml())
    assert load(path) == config


def test_a_file_that_is_no_yaml_is_refused(tmp_path):
    path = tmp_path / "config.yaml"
    path.write_text("ppo: [1")
    with pytest.raises(ValueError, match="is not valid YAML"):
        load(path)


def test_yaml_that_would_run_code_is_refused(tmp_path):
    path = tmp_path / "config.yaml"
    path.write_text("timesteps: !!python/object/apply:os.getcwd []")
    with pytest.raises(ValueError, match="could not determine a constructor"):
        load(path)


@pytest.mark.parametrize("path", CONFIGS, ids=lambda path: path.stem)
def test_the_configurations_that_come_along_are_valid(path):
    load(path)
