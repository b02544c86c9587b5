"""Films of a trained policy, and its shots in a window."""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, cast

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from agents.ppo import load_policy, make_env
from billiards_env.evaluation import evaluation_seeds
from billiards_env.files import check_path

EPISODES = 5
"""The number of episodes of a film."""

PAUSE = 0.7
"""s. The balls stay at rest for this time after an episode."""

Frame = NDArray[np.uint8]


def film(run_dir: Path, path: Path, episodes: int = EPISODES, seed: int | None = None) -> list[dict[str, Any]]:
    """Writes a film of the policy of a run, without exploration, on layouts that do not occur in training.

    Args:
        run_dir: The folder of a finished run.
        path: The film, an MP4 file.
        episodes: The number of episodes.
        seed: The seed of the layouts; None for that of the configuration.

    Returns:
        The last `info` of each episode.

    Raises:
        FileNotFoundError: If `run_dir` holds no finished run, or the folder of the film does not exist.
        ImportError: If the extra `render` is not installed.
        ValueError: If `path` does not end in ".mp4".
    """
    target, infos = check_path(path, ".mp4"), []
    write: Callable[[Frame], None] | None = None
    with contextlib.ExitStack() as stack:
        for env, over, info in _play(run_dir, "rgb_array_list", episodes, seed):
            frames, fps = cast("list[Frame]", env.render()), env.metadata["render_fps"]
            if write is None:
                from billiards_env.drawing.film import mp4_writer

                write = stack.enter_context(mp4_writer(target, (frames[0].shape[1], frames[0].shape[0]), fps))
            for frame in frames:
                write(frame)
            if over:
                infos.append(info)
                for _ in range(round(PAUSE * fps)):
                    write(frames[-1])
    return infos


def show(run_dir: Path, episodes: int = EPISODES, seed: int | None = None) -> list[dict[str, Any]]:
    """Plays the episodes of `film` in a window, in real time.

    The arguments and the result are those of `film`.

    Raises:
        FileNotFoundError: If the folder holds no finished run.
        ImportError: If the extra `render` is not installed.
        OSError: If there is no display.
    """
    infos = []
    for _, over, info in _play(run_dir, "human", episodes, seed):
        display = sys.modules["pygame"].display
        if display.get_init() and display.get_driver() == "offscreen":  # SDL's choice without a display
            raise OSError("display = 'offscreen': expected one that shows a window; a film needs no display")
        if over:
            infos.append(info)
            time.sleep(PAUSE)
    return infos


def _play(
    run_dir: Path, render_mode: str, episodes: int, seed: int | None
) -> Iterator[tuple[gym.Env[Any, Any], bool, dict[str, Any]]]:
    """Yields the environment, whether the episode is over, and the info, after each reset and each shot."""
    config, policy = load_policy(run_dir)
    env = make_env(config, render_mode)
    try:
        for number in evaluation_seeds(config.seed if seed is None else seed, episodes).tolist():
            observation, info = env.reset(seed=number)
            over = False
            yield env, over, info
            while not over:
                action, _ = policy.predict(observation, deterministic=True)
                observation, _, over, _, info = env.step(action)
                yield env, over, info
    finally:
        env.close()
