"""Minari records the episodes and the infos of an environment."""

import runpy
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

pytestmark = [pytest.mark.tools, pytest.mark.filterwarnings("ignore")]


def test_a_dataset_with_infos(monkeypatch, tmp_path):
    import minari  # pyright: ignore[reportMissingImports]

    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    collector = minari.DataCollector(gym.make("billiards_env:Billiards-v0", max_shots=3), record_infos=True)
    collector.action_space.seed(0)
    played = []
    for seed in range(4):
        infos, over = [collector.reset(seed=seed)[1]], False
        while not over:
            _, _, over, _, info = collector.step(collector.action_space.sample())
            infos.append(info)
        played.append(infos)
    collector.create_dataset("billiards/infos-v0")
    loaded = minari.load_dataset("billiards/infos-v0")
    for episode, infos in zip(loaded.iterate_episodes(), played, strict=True):
        assert episode.infos.keys() == infos[0].keys()
        for key, values in episode.infos.items():
            assert np.array_equal(values, [info[key] for info in infos])


def test_a_dataset_has_the_episodes_of_a_player_and_makes_their_environment(monkeypatch, tmp_path):
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    program = Path(__file__).parents[2] / "examples" / "dataset_cloning.py"
    loaded = runpy.run_path(str(program))["record"]("Clear5-v0", "random", 3, "mine/clear-v0")
    env = loaded.recover_environment()
    assert env.spec.id == "Billiards/Clear5-v0"
    for k, episode in enumerate(loaded.iterate_episodes()):
        seen, ended = [env.reset(seed=k)[0]], [False]
        for action, gained in zip(episode.actions, episode.rewards, strict=True):
            following, reward, *ended, _ = env.step(action)
            seen.append(following)
            assert reward == gained
        assert np.array_equal(seen, episode.observations)
        assert any(ended)
    assert loaded.total_episodes == 3
