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
    ("changes", "ppo", "message"),
    [
        ({"runners": 3}, {}, "runners = 3: expected a divisor of n_envs = 64"),
        ({"learners": 3}, {}, "learners = 3: expected a divisor of ppo.batch_size = 64"),
        ({}, {"target_kl": 0.1}, "ppo.target_kl = 0.1: expected None"),
    ],
)
def test_recipes_that_do_not_fit_the_settings_are_refused(changes, ppo, message):
    with pytest.raises(ValueError, match=message):
        Settings(recipe="pot.yaml", **changes).check(Config.from_dict({"timesteps": 1, "ppo": ppo}))
