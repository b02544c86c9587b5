"""The measurement of the speed of training; no time is asserted."""

import dataclasses
import json

import pytest

from agents.config import load
from studies import training_speed

PARTS = ("environment", "search", "update")


def small(config):
    """Returns the configuration with two updates of few steps."""
    settings = dataclasses.replace(config.ppo, n_steps=2, batch_size=64)
    return dataclasses.replace(config, n_envs=64, timesteps=256, ppo=settings)


def test_results_are_written_and_printed(tmp_path, monkeypatch, capsys):
    config = small(training_speed.training_config(2))
    measured = training_speed.measure(1, config, 2)
    assert measured["n_envs"] == 64
    assert measured["adapter"]["median"] > 0
    assert measured["decision"]["median"] > 0
    shares = [measured["training"][part]["median"] for part in PARTS]
    assert all(0 < share < 1 for share in shares)
    assert sum(shares) < 1
    monkeypatch.setattr(training_speed, "measure", lambda repeats, config: measured)
    training_speed.main(["--repeats", "1", "--output", str(tmp_path / "speed.json")])
    assert json.loads((tmp_path / "speed.json").read_text()) == measured
    monkeypatch.setattr(training_speed, "OUTPUT", tmp_path / "usual.json")
    training_speed.main(["--repeats", "1"])
    assert not (tmp_path / "usual.json").exists()
    training_speed.main([])
    assert json.loads((tmp_path / "usual.json").read_text()) == measured
    printed = capsys.readouterr().out
    texts = (f"the environments take {shares[0]:.0%}", f"pots {shares[1]:.0%}", f"the updates {shares[2]:.0%}")
    assert all(text in printed for text in texts)
    assert f"takes {measured['decision']['median']:.1f} us in a batch" in printed
    assert f"and the rest {1 - sum(shares):.0%}." in printed


def test_the_parts_of_the_training_are_timed_separately(monkeypatch):
    clock = iter(range(10**6))
    monkeypatch.setattr(training_speed, "perf_counter", lambda: next(clock))  # each reading is one second later
    found = training_speed.train(small(training_speed.training_config(2)))
    # A part whose calls do not contain other parts takes a second for each call, and the whole two for each call.
    calls = {"environment": 4, "update": 2}
    whole = 256 / found["steps_per_second"]
    for part, count in calls.items():
        assert found[part] * whole == pytest.approx(count)
    # The pots of each observation, and those after the last step of each rollout, are searched once.
    assert 4 <= found["search"] * whole <= 8
    assert whole == 2 * sum(found[part] * whole for part in PARTS) + 1


def test_the_configuration_is_that_of_the_recipe():
    config, recipe = training_speed.training_config(3), load(training_speed.RECIPE)
    assert config.timesteps == 3 * recipe.n_envs * recipe.ppo.n_steps
    assert dataclasses.replace(config, timesteps=recipe.timesteps) == recipe


def test_counts_below_one_are_refused(capsys):
    with pytest.raises(SystemExit):
        training_speed.main(["--repeats", "0"])
    assert "--repeats = 0: expected a whole number >= 1" in capsys.readouterr().err
