"""The settings of trainings with RLlib and of sweeps."""

import re
from pathlib import Path

import pytest
import yaml

from agents.config import Config, changed, read, validate
from agents.rllib.settings import Settings, Sweep, load_recipe

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


def test_the_sweep_of_the_repository_changes_settings_of_its_recipe():
    path = CONFIGS / "sweep.yaml"
    sweep = read(Sweep, path)
    recipe = load_recipe(sweep, path)
    for key, values in {**sweep.ranges, **sweep.choices}.items():
        for value in values:
            assert changed(recipe, {key: value}) is not recipe


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"trials": 0}, "trials = 0: expected a number >= 1"),
        ({"ranges": {"ppo.gamma": [0.9]}}, "ranges.ppo.gamma[1] is missing"),
        ({"ranges": {"ppo.gamma": [0.9, 0.1]}}, "ranges.ppo.gamma = [0.9, 0.1]: expected two increasing numbers"),
        ({"choices": {"n_envs": 8}}, "choices.n_envs = 8: expected a valid list"),
        (
            {"ranges": {"n_envs": [1, 2]}, "choices": {"n_envs": [8]}},
            "choices.n_envs = [8]: expected a setting without a range",
        ),
        ({}, "ranges = {}: expected at least one range or one list of choices"),
    ],
)
def test_impossible_sweeps_are_refused(changes, message):
    with pytest.raises(ValueError, match=f"^{re.escape(message)}"):
        validate(Sweep, {"recipe": "pot.yaml", "trials": 1, "first_stop": 1, **changes})


def test_equal_seeds_draw_equal_trials():
    ranges, choices = {"ppo.learning_rate": ["1e-4", 1e-2]}, {"ppo.batch_size": [64, 128]}
    given = {"recipe": "a", "trials": 50, "first_stop": 1, "ranges": ranges, "choices": choices}
    sweeps = [validate(Sweep, {**given, "seed": seed}) for seed in (0, 0, 1)]
    first, again, other = (sweep.draw() for sweep in sweeps)
    assert first == again != other
    assert {trial["ppo.batch_size"] for trial in first} == {64, 128}
    rates = [trial["ppo.learning_rate"] for trial in first]
    assert 1e-4 < min(rates) < 1e-3 < max(rates) < 1e-2
    assert len([rate for rate in rates if rate < 1e-3]) == pytest.approx(25, abs=12)
