"""The measurement of the speed of training; no time is asserted."""

import json

import pytest

from agents.config import load
from studies import training_speed


def test_results_are_written_and_printed(tmp_path, monkeypatch, capsys):
    config = training_speed.training_config(64, 2, 2)
    measured = training_speed.measure(1, config, 2)
    assert measured["adapter"]["median"] > 0
    assert 0 < measured["training"]["environment_share"]["median"] < 1
    monkeypatch.setattr(training_speed, "measure", lambda repeats, config: measured)
    training_speed.main(["--repeats", "1", "--output", str(tmp_path / "speed.json")])
    assert json.loads((tmp_path / "speed.json").read_text()) == measured
    monkeypatch.setattr(training_speed, "OUTPUT", tmp_path / "usual.json")
    training_speed.main(["--repeats", "1"])
    assert not (tmp_path / "usual.json").exists()
    training_speed.main([])
    assert json.loads((tmp_path / "usual.json").read_text()) == measured
    share = measured["training"]["environment_share"]["median"]
    assert f"the environments take {share:.1%} of that time" in capsys.readouterr().out


def test_the_configuration_is_that_of_the_recipe_with_large_batches():
    config, recipe = training_speed.training_config(1024, 16, 3), load(training_speed.RECIPE)
    assert (config.n_envs, config.ppo.batch_size, config.timesteps) == (1024, 4096, 3 * 16 * 1024)
    assert (config.env, config.policy, config.ppo.n_epochs) == (recipe.env, recipe.policy, recipe.ppo.n_epochs)


def test_counts_below_one_are_refused(capsys):
    with pytest.raises(SystemExit):
        training_speed.main(["--repeats", "0"])
    assert "--repeats = 0: expected a whole number >= 1" in capsys.readouterr().err
