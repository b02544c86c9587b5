"""The comparison of policies that were trained with and without noise."""

import json
from typing import Any

import numpy as np
import pytest

from studies import choices
from studies.choices import blocks, main, measure


def test_both_policies_play_the_same_layouts():
    found = measure(choices.POLICIES, 300, 1)
    assert found["layouts"] == 300
    for policy in found["policies"].values():
        assert policy["success"] > policy["success_with_noise"] > 0.5
        assert 0 < policy["speed"] <= 4.0
        assert policy["tolerance"] > 0
    assert found["policies"]["pot_noise"]["banks"] > found["policies"]["pot"]["banks"]
    assert 0 < found["another_pot"]["share"] < 1
    low, high = found["easier"]["interval"]
    assert low <= found["easier"]["share"] <= high
    made = blocks(found)
    assert "| without noise |" in made["table"]
    assert f"On {found['another_pot']['share']:.0%} (" in made["summary"]


def test_the_nearest_pot_of_a_shot_along_a_pot_is_this_pot():
    rng = np.random.default_rng(0)
    game: Any = choices.make_vector(choices.load_policy(choices.POLICIES / "pot")[0], 50).unwrapped
    game.reset(seed=0)
    env = game.single_env
    found = choices.pots.find_pots(env.scene, env.targets, game.positions, game.potted, env.max_speed, banks=True)
    chosen = rng.integers(0, np.maximum(found.count, 1))
    rows = np.arange(50)
    shots = found.shots[rows, chosen, 0]
    played = shots[:, choices.pots.SPEED] > 0
    velocities = np.where(played[:, None], shots[:, :2], (1.0, 0.0))
    _, which = choices._nearest_pots(game, velocities)
    same = np.isclose(found.shots[rows, which, 0, :2], shots[:, :2]).all(axis=1)
    assert same[played].all()
    assert played.sum() > 30


def test_the_result_is_written_and_printed(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(choices, "LAYOUTS", 50)
    main(["--output", str(tmp_path / "choices.json")])
    written = json.loads((tmp_path / "choices.json").read_text())
    assert blocks(written)["table"] in capsys.readouterr().out


def test_a_missing_policy_is_named(tmp_path):
    with pytest.raises(SystemExit, match=r"error: run_dir = .*pot.*expected the folder of a finished run"):
        main(["--policies", str(tmp_path), "--output", str(tmp_path / "choices.json")])
    assert not list(tmp_path.iterdir())
