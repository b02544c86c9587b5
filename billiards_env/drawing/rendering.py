"""Rendering of the shots of an environment, in the render modes of Gymnasium.

With a render mode a step records the shots that are drawn while it simulates them. A shot is drawn when a frame is
needed, and pygame is imported with the first frame.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import gymnasium as gym
import numpy as np
from gymnasium.core import RenderFrame
from gymnasium.error import DependencyNotInstalled
from numpy.typing import NDArray

from billiards_env.drawing.recording import Floats, recording_of
from billiards_env.engine import ShotInput
from billiards_env.envs.actions import cue_strike
from billiards_env.envs.arguments import Model
from billiards_env.envs.billiards import FPS
from billiards_env.envs.episodes import Episodes
from billiards_env.games.game_state import FOULS
from billiards_env.scene import Scene
from billiards_env.shots.result import ShotResult
from billiards_env.shots.simulation import run_shot

if TYPE_CHECKING:
    from billiards_env.drawing.canvas import Canvas, Surface
    from billiards_env.drawing.window import Window

WIDTH = 800
"""Pixels. Width of a frame."""

Circles = Sequence[tuple[float, float, float]]
Image = NDArray[np.uint8]


class DrawnShot(NamedTuple):
    """A shot to draw, or the balls at rest if it lasts 0 s.

    Attributes:
        shot: The shot, recorded.
        left: Text on the left, visible during the whole shot.
        right: Text on the right, visible at the end of the shot.
        circles: Circles on the cloth: x, y and radius, m.
    """

    shot: ShotResult
    left: str
    right: str = ""
    circles: Circles = ()


def drawn_layout(episodes: Episodes, k: int) -> DrawnShot:
    """Returns the balls and goals of episode k for drawing."""
    model, state = episodes.model, episodes.state
    n = len(state.positions[k])
    heights = np.zeros((n, 2)) if model.scene.physics.flight else None
    still = np.zeros((n, 2)), np.zeros((n, 3))
    start = ShotInput(state.positions[k], *still, state.in_play[k], heights=heights, limit=0.0)
    shot = run_shot(model.scene, start, record=True)
    return DrawnShot(shot, model.task, circles=_goal_circles(model, state.goals[k]))


def drawn_shot(episodes: Episodes, k: int, reward: float, goals: Floats) -> DrawnShot:
    """Returns the last shot of episode k for drawing. `goals` are those of the shot: a new episode may have begun."""
    shot, model, state = episodes.state.recorded[k], episodes.model, episodes.state
    number = model.max_shots - state.shots_left[k]
    speed = math.hypot(*cue_strike(state.actions[k], model.scene, model.max_speed).velocity[:2])
    if state.turns is not None:
        left = f"{model.task}   player {state.turns.player[k]}   shot {number} of {model.max_shots}"
        return DrawnShot(shot, left, _result_text(episodes, k))
    left = f"{model.task}   shot {number} of {model.max_shots}   {speed:.2f} m/s"
    return DrawnShot(shot, left, f"reward {reward:g}   score {state.score[k]}", _goal_circles(model, goals))


def _result_text(episodes: Episodes, k: int) -> str:
    """Returns the text at the end of a shot in game k of several players: the foul, the scores, and who wins or plays.

    A player of eight ball has a group of balls.
    """
    turns, setup = episodes.state.turns, episodes.model.setup
    assert turns is not None
    assert setup is not None
    parts = [FOULS[turns.foul[k]].replace("_", " ")] if turns.foul[k] else []
    if setup.target is not None:
        parts.append(" : ".join(map(str, turns.scores[k].tolist())))
    if episodes.state.over[k]:
        parts.append("nobody wins" if turns.winner[k] < 0 else f"player {turns.winner[k]} wins")
    else:
        player, games = int(turns.next_player[k]), episodes.state.game
        solids = int(games["solids"][k]) if "solids" in (games.dtype.names or ()) else -1
        groups = ("solids", "stripes") if setup.scene.balls.colours == "pool" else ("reds", "yellows")
        group = "" if solids < 0 else f" ({groups[solids != player]})"
        parts.append(f"next: player {player}{group}")
    return "   ".join(parts)


def _goal_circles(model: Model, goals: Floats) -> Circles:
    """Returns the circles in which the cue ball has to come to rest, for (g, 2) goals."""
    return [(x, y, model.goal_radius) for x, y in goals.tolist()]


class Renderer:
    """Draws the shots of one environment, or of several environments.

    Args:
        scene: The scene of the environments.
        render_mode: One of `RENDER_MODES`.
        count: Number of environments.

    Attributes:
        render_mode: One of `RENDER_MODES`.
        n_shown: Number of environments that are drawn: one in a window, otherwise all.
    """

    def __init__(self, scene: Scene, render_mode: str, count: int = 1) -> None:
        self.render_mode = render_mode
        self.n_shown = 1 if render_mode == "human" else count
        self._scene = scene
        self._steps: list[Sequence[DrawnShot]] = []
        self._canvas: Canvas | None = None
        self._window: Window | None = None

    def __getstate__(self) -> dict[str, Any]:
        """Returns the attributes without pygame's objects, which a copy makes again when it draws."""
        return {**vars(self), "_canvas": None, "_window": None}

    def begin(self, episodes: Episodes) -> None:
        """Discards all steps and adds the balls at the start of episodes."""
        self._steps = []
        self._add(lambda k: drawn_layout(episodes, k))

    def step(self, episodes: Episodes, rewards: Floats, goals: Floats, begun: Sequence[bool]) -> None:
        """Adds the last step. In the mode "human" the window shows it immediately.

        Keys change the pace. The close button, Q and Escape close the window. Later steps then run without a window.
        Without a display the frames are drawn off screen, with a warning.

        Args:
            episodes: The episodes.
            rewards: (m,) the rewards of the shots.
            goals: (m, g, 2) the goals of the shots, m.
            begun: (m,) the episodes that began in this step, without a shot.
        """
        self._add(lambda k: drawn_layout(episodes, k) if begun[k] else drawn_shot(episodes, k, rewards[k], goals[k]))

    def _add(self, drawn: Callable[[int], DrawnShot]) -> None:
        shots = [drawn(k) for k in range(self.n_shown)]
        if self.render_mode != "rgb_array_list":
            self._steps = []
        self._steps.append(shots)
        if self.render_mode == "human":
            self._show(shots[0])

    def _show(self, shot: DrawnShot) -> None:
        """Shows a shot in the window, unless the user has closed it."""
        if self._window is not None and not self._window.open:
            return
        (film,) = self._films((shot,))
        if self._window is None:
            from billiards_env.drawing.window import Window

            assert self._canvas is not None
            self._window = Window(self._canvas.size, "Billiards", visible=False)
        self._window.play(film, FPS)
        if not self._window.open:
            gym.logger.warn("The window was closed: the environment continues without it.")

    def render(self) -> tuple[RenderFrame | list[RenderFrame] | None, ...] | None:
        """Returns the result of `Env.render` in the render mode for each environment.

        Returns:
            "rgb_array": the last frame of the last step of each environment, (height, width, 3) uint8; None before the
            first `begin`. "rgb_array_list": all frames of each environment since the last call or the last `begin`.
            "human": None; the window shows each shot during `step`.

        Raises:
            DependencyNotInstalled: If pygame is not installed.
        """
        if self.render_mode == "human":
            return None
        last = self.render_mode == "rgb_array"
        frames: list[list[RenderFrame]] = [[] for _ in range(self.n_shown)]
        for shots in self._steps:
            films = self._films(shots, only_last=last)
            from billiards_env.drawing.canvas import pixels

            for drawn, film in zip(frames, films, strict=True):
                drawn += (pixels(frame) for frame in film)
        if last:
            return tuple(drawn[-1] if drawn else None for drawn in frames)
        self._steps = []
        return tuple(frames)

    def close(self) -> None:
        """Closes the window if there is one."""
        if self._window is not None:
            self._window.close()
            self._window = None

    def _films(self, shots: Sequence[DrawnShot], only_last: bool = False) -> list[Iterator[Surface]]:
        """Returns the frames of a step, one iterator for each environment."""
        try:
            from billiards_env.drawing.canvas import Canvas
        except ModuleNotFoundError as error:
            raise DependencyNotInstalled(f"render_mode = {self.render_mode!r}: {error}") from error
        if self._canvas is None:
            self._canvas = Canvas(self._scene, WIDTH)
        return [
            self._canvas.film(recording_of(shot), FPS, left, right, only_last=only_last, circles=circles)
            for shot, left, right, circles in shots
        ]


class RecordVideo(gym.wrappers.RecordVideo):
    """`gymnasium.wrappers.RecordVideo` for environments with many frames per step.

    Gymnasium's wrapper records one frame per step, which is the end of a shot. This wrapper records all frames of a
    step, so the video shows the balls in motion. The environment must have the render mode "rgb_array_list".
    The arguments and the names of the files are as in Gymnasium's wrapper. Frames are written to the file
    immediately, so the length of a video is not limited by memory.

    Raises:
        ValueError: If the render mode is not "rgb_array_list".

    Example:
        ```python
        from billiards_env.envs import RecordVideo

        env = gym.make("Billiards-v0", render_mode="rgb_array_list")
        env = RecordVideo(env, "videos", episode_trigger=lambda episode: True)
        ```
    """

    def __init__(self, env: gym.Env[Any, Any], *args: Any, **kwargs: Any) -> None:
        if env.render_mode != "rgb_array_list":
            raise ValueError(
                f"render_mode = {env.render_mode!r}: expected 'rgb_array_list', which returns all frames of a shot"
            )
        super().__init__(env, *args, **kwargs)
        self._file = contextlib.ExitStack()
        self._write: Callable[..., None] | None = None

    def _capture_frame(self) -> None:
        from billiards_env.drawing.film import film_writer

        self.render_history = list(cast("list[Image]", self.env.render()))  # returned by the next call of `render`
        if self._write is None:
            path = Path(self.video_folder, f"{self._video_name}.mp4")
            self._write = self._file.enter_context(film_writer(path, self.frames_per_sec))
        for frame in self.render_history:
            self._write(frame)
            self.recorded_frames.append("")  # Gymnasium compares the length of this list with `video_length`

    def stop_recording(self) -> None:
        """Completes the video file."""
        self.recorded_frames = []
        self.recording = False
        self._write = None
        self._file.close()
