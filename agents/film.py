"""Films of a trained policy, and its shots in a window."""

from __future__ import annotations

import contextlib
import sys
import time
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from agents.ppo import load_policy, make_env
from billiards_env.evaluation import evaluation_seeds
from billiards_env.files import check_path

EPISODES = 5
"""The number of episodes of a film."""

PAUSE = 0.7
"""s. The balls stay at rest for this time after an episode."""


def film(run_dir: Path, path: Path | None, episodes: int = EPISODES, seed: int | None = None) -> list[dict[str, Any]]:
    """Films the policy of a run, without exploration, on layouts that do not occur in training.

    Args:
        run_dir: The folder of a finished run.
        path: The film, an MP4 file; None to play in a window, in real time.
        episodes: The number of episodes.
        seed: The seed of the layouts; None for the seed of the configuration.

    Returns:
        The last `info` of each episode.

    Raises:
        FileNotFoundError: If `run_dir` holds no finished run, or the folder of the film does not exist.
        ImportError: If the extra `render` is not installed.
        OSError: If there is no display for the window.
        ValueError: If `path` does not end in ".mp4".
    """
    target = None if path is None else check_path(path, ".mp4")
    config, policy = load_policy(run_dir)
    env = make_env(config, "human" if target is None else "rgb_array_list")
    infos, write = [], None
    with contextlib.ExitStack() as stack:
        stack.callback(env.close)
        for number in evaluation_seeds(config.seed if seed is None else seed, episodes).tolist():
            observation, info = env.reset(seed=number)
            over = False
            while True:
                if target is None:
                    _check_display()
                else:
                    frames, fps = cast("list[NDArray[np.uint8]]", env.render()), env.metadata["render_fps"]
                    if write is None:
                        from billiards_env.drawing.film import mp4_writer

                        write = stack.enter_context(mp4_writer(target, (frames[0].shape[1], frames[0].shape[0]), fps))
                    for frame in frames + frames[-1:] * round(over * PAUSE * fps):
                        write(frame)
                if over:
                    break
                observation, _, over, _, info = env.step(policy.predict(observation, deterministic=True)[0])
            infos.append(info)
            if target is None:
                time.sleep(PAUSE)
    return infos


def _check_display() -> None:
    display = sys.modules["pygame"].display
    if display.get_init() and display.get_driver() == "offscreen":  # SDL's choice without a display
        raise OSError("display = 'offscreen': expected one that shows a window; a film needs no display")
