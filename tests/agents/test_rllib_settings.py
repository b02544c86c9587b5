"""The settings of trainings with RLlib."""

from pathlib import Path

import pytest
import yaml

from agents.config import Config, read
from agents.rllib.settings import Settings, load_recipe

CONFIGS = Path(__file__).resolve().parents[2] / "configs" / "rllib"


def test_the_settings_of_the_repository_fit_their_recipe():
    path = CONFIGS / "pot.yaml"
    settings = read(Settings, path)
    recipe = load_recipe(settings, path)
    settings.check(recipe)
    assert recipe.to_dict() == yaml.safe_load(yaml.safe_dump(recipe.to_dict()))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"runners": 3}, "runners = 3: expected a divisor of n_envs = 64"),
        ({"learners": 3}, "learners = 3: expected a divisor of ppo.batch_size = 64"),
    ],
)
def test_processes_share_environments_and_minibatches_equally(changes, message):
    with pytest.raises(ValueError, match=message):
        Settings(recipe="pot.yaml", **changes).check(Config(timesteps=1))


def test_a_limit_of_the_divergence_is_refused():
    config = Config.from_dict({"timesteps": 1, "ppo": {"target_kl": 0.1}})
    with pytest.raises(ValueError, match=r"ppo.target_kl = 0.1: expected None"):
        Settings(recipe="pot.yaml").check(config)
