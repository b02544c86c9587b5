"""What an environment shows of its shots, by the conventions of Gymnasium's render modes.

A step only notes how its shot began. A shot that is to be seen is run again, recorded, which gives the same bits, and
drawn then; so a render mode that nobody looks at costs next to nothing, and pygame is imported with the first frame.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import gymnasium as gym
import numpy as np
from gymnasium.core import RenderFrame
from gymnasium.error import DependencyNotInstalled
from numpy.typing import NDArray

from billiards_env.engine import ShotInput
from billiards_env.scene import Scene
from billiards_env.simulation import run_shot

if TYPE_CHECKING:
    from billiards_env.drawing.canvas import Canvas, Surface
    from billiards_env.drawing.window import Window

RENDER_MODES = ("human", "rgb_array", "rgb_array_list")
FPS = 30
WIDTH, WIDTH_OF_MANY = 800, 560
"""Pixels a table, if there is one and if there are several."""

Image = NDArray[np.uint8]


class DrawnShot(NamedTuple):
    """A shot, or with a limit of 0 s a layout, to be drawn with a line of text on either side.

    Attributes:
        given: What it is run from; it is not written to.
        left: A line of text shown throughout.
        right: A line shown towards the shot's end.
        circles: What is marked on the cloth: x, y and radius, m.
    """

    shot: ShotInput
    left: str
    right: str = ""
    circles: Sequence[tuple[float, float, float]] = ()


def balls_at_rest(
    positions: NDArray[np.float64],
    left: str,
    in_play: NDArray[np.bool_] | None = None,
    circles: Sequence[tuple[float, float, float]] = (),
) -> DrawnShot:
    """How the balls lie before a shot.

    Args:
        positions: (n, 2) m; copied.
        left: A line of text.
        in_play: (n,) bool; None for all balls.
        circles: As in `DrawnShot`.

    Returns:
        What `Renderer` takes.
    """
    n = len(positions)
    playing = np.ones(n, np.bool_) if in_play is None else in_play.copy()
    return DrawnShot(
        ShotInput(positions.copy(), np.zeros((n, 2)), np.zeros((n, 3)), playing, 0.0), left, circles=circles
    )


class Renderer:
    """Draws the shots of an environment, or of several side by side.

    Attributes:
        render_mode: One of `RENDER_MODES`.
    """

    def __init__(
        self, scene: Scene, render_mode: str, mode: str = "pic", dt: float | None = None, fix: str | None = None
    ) -> None:
        """Takes the scene and how its shots are run; imports and draws nothing yet."""
        self.render_mode = render_mode
        self._scene = scene
        self._engine = (mode, dt, fix)
        self._steps: list[Sequence[DrawnShot]] = []
        self._canvas: Canvas | None = None
        self._window: Window | None = None

    def begin(self, tables: Sequence[DrawnShot]) -> None:
        """Shows how episodes begin, one a table; what was shown before is forgotten."""
        self._steps = []
        self.step(tables)

    def step(self, tables: Sequence[DrawnShot]) -> None:
        """Shows the shots of one step, one a table."""
        if self.render_mode != "rgb_array_list":
            self._steps = []
        self._steps.append(tables)
        if self.render_mode == "human":
            for frame in self._film(tables):
                if self._window is None:
                    from billiards_env.drawing.window import Window

                    self._window = Window(frame.get_size(), "Billiards")
                self._window.show(frame, FPS)

    def render(self) -> RenderFrame | list[RenderFrame] | None:
        """What `Env.render` returns in the render mode.

        Returns:
            "rgb_array": the last frame of the last step, (height, width, 3) uint8. "rgb_array_list": all frames since
            the last call or `begin`. "human": None; the window shows a shot while it is played.

        Raises:
            DependencyNotInstalled: If pygame is not installed.
        """
        if self.render_mode == "human":
            return None
        last = self.render_mode == "rgb_array"
        frames: list[RenderFrame] = []
        for tables in self._steps:
            for frame in self._film(tables, only_last=last):
                from billiards_env.drawing.canvas import pixels

                frames.append(pixels(frame))
        if last:
            return frames[-1] if frames else None
        self._steps = []
        return frames

    def close(self) -> None:
        """Closes the window, if there is one."""
        if self._window is not None:
            self._window.close()
            self._window = None

    def _film(self, tables: Sequence[DrawnShot], only_last: bool = False) -> Iterator[Surface]:
        try:
            from billiards_env.drawing.canvas import Canvas, side_by_side
        except ModuleNotFoundError as error:
            raise DependencyNotInstalled(
                f"render_mode = {self.render_mode!r}: pygame is not installed: `pip install 'billiards-env[render]'`"
            ) from error
        if self._canvas is None:
            self._canvas = Canvas(self._scene, WIDTH if len(tables) == 1 else WIDTH_OF_MANY)
        films = []
        for shot, left, right, circles in tables:
            recording = run_shot(self._scene, shot, *self._engine, record=True).recording()
            films.append(self._canvas.film(recording, FPS, left, right, only_last=only_last, circles=circles))
        return films[0] if len(films) == 1 else side_by_side(films)


class RecordVideo(gym.wrappers.RecordVideo):
    """`gymnasium.wrappers.RecordVideo` for steps that give many frames.

    Gymnasium's own keeps one frame a step, the last, which is a shot's end. This one keeps all frames that a step
    gives, so the film shows the shots in motion, and it writes them as they come, so a long film needs no more memory
    than a short one. Arguments and files are the same. It takes an environment whose `render_mode` is "rgb_array_list".

    Example:
        ```python
        env = gym.make("Billiards-v0", render_mode="rgb_array_list")
        env = RecordVideo(env, "videos", episode_trigger=lambda episode: True)
        ```
    """

    def __init__(self, env: gym.Env[Any, Any], *args: Any, **kwargs: Any) -> None:
        """Takes the arguments of `gymnasium.wrappers.RecordVideo`."""
        if env.render_mode != "rgb_array_list":
            raise ValueError(
                f"render_mode = {env.render_mode!r}: expected 'rgb_array_list', which gives all frames of a shot"
            )
        super().__init__(env, *args, **kwargs)
        self._file = contextlib.ExitStack()
        self._write: Callable[[Image], None] | None = None

    def _capture_frame(self) -> None:
        from billiards_env.drawing.film import mp4_writer

        frames = cast("list[Image]", self.env.render())
        self.render_history = list(frames)  # what `render` gives next, if anybody asks for it
        for frame in frames:
            if self._write is None:
                path = Path(self.video_folder, f"{self._video_name}.mp4")
                size = (frame.shape[1], frame.shape[0])
                self._write = self._file.enter_context(mp4_writer(path, size, self.frames_per_sec))
            self._write(frame)
            self.recorded_frames.append("")  # of which the wrapper compares the number with `video_length`

    def stop_recording(self) -> None:
        """Finishes the film and puts it in its place."""
        self.recorded_frames = []
        self.recording = False
        self._write = None
        self._file.close()
