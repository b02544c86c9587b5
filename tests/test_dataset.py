"""Datasets of Minari. Errors in the arguments do not need Minari."""

import importlib

import gymnasium as gym
import numpy as np
import pytest

from billiards_env import dataset
from billiards_env.__main__ import main


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("Pot1", "random", 1), "task = 'Pot1': expected one of"),
        (("Pot1-v0", "random", 0), "episodes = 0: expected"),
        (("Pot1-v0", "random", 2, -1), "seed = -1: expected"),
        (("Pot1-v0", "random", 2, 2**31 - 1), "seed = 2147483647: expected"),
    ],
)
def test_wrong_arguments_are_rejected(arguments, message):
    with pytest.raises(ValueError, match=message):
        dataset.write(*arguments[:3], seed=arguments[3] if len(arguments) > 3 else 0)


WRONG_IDS = ["mydata", "../../x-v0", "a/../x-v0", "/x/y-v0", "x/y-v0", "mine//x-v0", "x-v01", "x-v", "-v0"]


@pytest.mark.parametrize("wrong", ["", "x y-v0", "x-v0\n", *WRONG_IDS])
def test_a_wrong_id_is_refused_before_an_episode(wrong, monkeypatch):
    monkeypatch.setattr(dataset, "find_player", None)
    with pytest.raises(ValueError, match=r"dataset_id = .*: expected words and a version, such as 'mine/clear-v0'"):
        dataset.write("Pot1-v0", "random", 1, dataset_id=wrong)


@pytest.mark.tools
def test_the_ids_are_valid_in_minari_and_a_broken_folder_does_no_harm(monkeypatch, tmp_path):
    parse = importlib.import_module("minari.dataset.minari_dataset").parse_dataset_id
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    (tmp_path / "mydata" / "data").mkdir(parents=True)
    for name in ("clear-v0", "mine/x-v10", "my-own/a_b/C-v2"):
        assert parse(name)
        assert dataset.write("Pot1-v0", "random", 1, dataset_id=name).spec.dataset_id == name
        with pytest.raises(ValueError, match="expected a new one"):
            dataset.write("Pot1-v0", "random", 1, dataset_id=name)
    monkeypatch.chdir(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["clear-v0", "mine", "my-own", "mydata"]


def test_without_minari_the_extra_is_named(monkeypatch):
    monkeypatch.setattr(dataset.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(ModuleNotFoundError, match="data"):
        dataset.write("Pot1-v0", "random", 1)


@pytest.mark.tools
def test_a_dataset_has_the_episodes_and_makes_their_environment(monkeypatch, tmp_path, capsys):
    minari = importlib.import_module("minari")
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    main(["dataset", "Clear5-v0", "random", "3", "--seed", "7", "--id", "mine/clear-v0"])
    assert capsys.readouterr().out.startswith("mine/clear-v0: 3 episodes, ")
    with pytest.raises(SystemExit, match="dataset_id = 'mine/clear-v0': expected a new one"):
        main(["dataset", "Clear5-v0", "random", "3", "--id", "mine/clear-v0"])
    loaded = minari.load_dataset("mine/clear-v0")
    env = loaded.recover_environment()
    assert env.spec is not None
    assert env.spec.id == "Billiards/Clear5-v0"
    for k, episode in enumerate(loaded.iterate_episodes()):
        replayed = gym.make(env.spec.id)
        seen, ended = replayed.reset(seed=7 + k)[0], [False]
        for t, action in enumerate(episode.actions):
            assert np.array_equal(seen, episode.observations[t])
            seen, reward, *ended, _ = replayed.step(action)
            assert reward == episode.rewards[t]
            assert ended == [episode.terminations[t], episode.truncations[t]]
        assert np.array_equal(seen, episode.observations[-1])
        assert any(ended)
