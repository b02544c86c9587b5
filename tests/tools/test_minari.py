"""Minari records the infos of an environment."""

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
