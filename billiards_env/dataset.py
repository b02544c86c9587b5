"""Datasets of episodes in the format of Minari: `billiards dataset Pot1-v0 geometric 1000` (extra `data`).

`minari.load_dataset` loads a dataset, and its `recover_environment` makes the frozen task in which it was played.
"""

from __future__ import annotations

import importlib.util
import re
import warnings
from typing import Any

import gymnasium as gym
import numpy as np

from billiards_env.checks import Range, integer, missing, one_of, short
from billiards_env.evaluation import steps
from billiards_env.frozen import FROZEN, NAMESPACE
from billiards_env.players.named import find_player

_ID = r"(\w[\w-]+/)*\w[\w-]*-v(0|[1-9][0-9]*)"  # no dots, which could leave the folder of Minari
_COLUMNS = ("action", "reward", "terminated", "truncated")  # of `evaluation.Step`, for `EpisodeBuffer`


def write(
    task: str,
    player: str,
    episodes: int,
    *,
    seed: int = 0,
    dataset_id: str | None = None,
) -> Any:
    """Plays episodes of a frozen task and writes them as a dataset into the folder of Minari.

    The observations and actions (float32) are those of the player. The noise of a task is not in the action.

    Args:
        task: The name of a frozen task, such as "Pot1-v0".
        player: See `players.named`.
        episodes: The number of episodes.
        seed: The seed of the player and of the first episode; the next ones have the next seeds. No evaluation uses
            seeds below 2**31.
        dataset_id: The id of the dataset, letters, digits, "-" and "_" with a version at the end, such as
            "mine/clear-v0"; None for one such as "billiards/pot1/geometric-v0".

    Returns:
        The `minari.MinariDataset`.

    Raises:
        ModuleNotFoundError: If Minari is not installed.
        TypeError: If the player is not a function of an observation.
        ValueError: If a name or a number is wrong, or if there is a dataset with this id.
    """
    one_of("task", task, tuple(FROZEN))
    integer("episodes", episodes, Range(1, None))
    integer("seed", seed, Range(0, 2**31 - episodes))
    if dataset_id is None:
        words = re.sub(r"\W+", "-", player.lower()).strip("-")
        dataset_id = f"billiards/{task.lower().rpartition('-')[0]}/{words}-v0"
    if not re.fullmatch(_ID, dataset_id):
        raise ValueError(f"dataset_id = {short(dataset_id)}: expected words and a version, such as 'mine/clear-v0'")
    if importlib.util.find_spec("minari") is None:
        raise ModuleNotFoundError(missing("minari", "data"))
    minari = importlib.import_module("minari")
    storage = importlib.import_module("minari.storage.datasets_root_dir")
    if storage.get_dataset_path(dataset_id).exists():
        raise ValueError(f"dataset_id = {dataset_id!r}: expected a new one; `minari delete {dataset_id}` deletes it")
    env = gym.make(NAMESPACE + task)
    act = find_player(player, env, FROZEN[task].execution_noise, seed)
    buffers = []
    for k in range(episodes):
        played = list(steps(env, lambda observation: np.asarray(act(observation), np.float32), seed + k))
        observations = [played[0].observation, *(step.following for step in played)]
        columns = ([getattr(step, name) for step in played] for name in _COLUMNS)
        buffers.append(minari.data_collector.EpisodeBuffer(k, seed + k, None, observations, *columns, {}))
    about = {"algorithm_name": player, "description": FROZEN[task].summary}
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "`.*` is set to None", UserWarning)  # author and link are not known
        dataset = minari.create_dataset_from_buffers(dataset_id, buffers, env, **about)
    env.close()
    return dataset
