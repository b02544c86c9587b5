"""Frames of a shot, drawn to scale with pygame, without a window.

Round shapes are drawn several times larger and then reduced, which smooths their edges. The table is drawn once. A ball
is painted again only if it has moved or turned. Rings and shadows are drawn at several fractions of a pixel, so that
they move smoothly. The paths are drawn on a copy of the table, frame by frame.
"""

from __future__ import annotations

import copy
import functools
import math
import os
import re
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from billiards_env.support.checks import integer, missing

os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
try:
    import pygame
except ModuleNotFoundError as error:
    raise missing("pygame", "render") from error

from billiards_env.drawing.materials import paint_table
from billiards_env.drawing.orientation import VISIBLE
from billiards_env.drawing.recording import Floats, Recording, check_pair, frame_times
from billiards_env.drawing.spheres import Painter, ring, shadow
from billiards_env.drawing.style import (
    ARROW,
    ARROW_START,
    CHALK,
    INK,
    LIFT,
    LIGHT,
    PAPER,
    POTTED,
    RAIL,
    SPREAD,
    looks,
    rail_width,
    tray,
)
from billiards_env.drawing.text import text_image, write
from billiards_env.scene import Scene

Frame = NDArray[np.uint8]
Surface = pygame.Surface

TABLE_ZOOM, PATH_ZOOM = 3, 4
"""Enlargement of the parts before they are reduced."""

UPRIGHT = (1.0, 0.0, 0.0, 0.0)
"""The orientation of a ball that shows its number."""

SUBPIXELS = 4
"""Number of fractions of a pixel along x and along y at which a stamp is drawn."""

PATH_STEPS = 4
"""Number of points of a path in a step, in addition to the corners."""

RESULT_SHOWN = 1.0
"""s. The text on the right is shown for this time at the end of a shot, when balls are slow."""


class Canvas:
    """Draws one scene.

    Attributes:
        scene: The scene.
        size: (width, height) of a frame, pixels, both even.
        scale: Pixels per metre.
        looks: The look of each ball.
    """

    def __init__(
        self, scene: Scene, width: int = 800, paper: str = PAPER, ink: str = INK, palette: str = "colour_blind"
    ) -> None:
        """Prepares the drawing of a scene in frames of `width` pixels, with the colours around and of the balls."""
        width = integer("width", width, "frame_width")
        self.scene, self._paper, self._ink = scene, paper, ink
        width = width // 2 * 2
        self._margin = width // 80
        self._bar = width // 24
        rail = rail_width(scene.table)
        length, breadth = scene.table.length + 2 * rail, scene.table.width + 2 * rail
        available = width - 2 * self._margin
        self.scale = min(available / length, available / breadth)
        height = math.ceil(breadth * self.scale) + self._margin + self._bar
        self.size = (width, height + height % 2)
        self._half = self.scale * np.array(scene.half_extents)  # of the cloth
        self._middle = (width / 2, self._margin + breadth * self.scale / 2)
        self.looks = looks(scene, palette)
        self._tray = tray(scene.n_balls, width, self._bar)
        self._tray_painter = Painter(self.looks, np.full(scene.n_balls, self._tray.radius))
        self._reset()

    def _reset(self) -> None:
        """Discards the images of the balls, which depend on the scale."""
        self._painter = Painter(self.looks, self.scale * np.array(self.scene.balls.radius))

    def enlarged(self, size: tuple[int, int], zoom: float, point: ArrayLike) -> Canvas:
        """Returns a canvas of `size` pixels with a point of the table, m, in its middle, `zoom` times as large."""
        part = copy.copy(self)
        part.__dict__.pop("table", None)
        part.size, part.scale = size, zoom * self.scale
        x, y = (part.scale * np.asarray(point)).tolist()
        part._middle = size[0] / 2 - x, size[1] / 2 + y
        part._reset()
        return part

    def pixels_of(self, points: ArrayLike) -> Floats:
        """Converts points (..., 2), m, to (..., 2) pixels from the upper left corner of a frame."""
        array = np.asarray(points, dtype=np.float64)
        return np.stack(
            (self._middle[0] + self.scale * array[..., 0], self._middle[1] - self.scale * array[..., 1]), -1
        )

    def point_of(self, pixel: tuple[int, int]) -> tuple[float, float]:
        """Converts a pixel of a frame to a point, m."""
        return (pixel[0] - self._middle[0]) / self.scale, (self._middle[1] - pixel[1]) / self.scale

    def film(
        self,
        recording: Recording,
        fps: float,
        left: str = "",
        right: str = "",
        compare: Recording | None = None,
        only_last: bool = False,
        circles: Sequence[tuple[float, float, float]] = (),
    ) -> Iterator[Surface]:
        """Draws a shot in motion, a frame for each of `frame_times`.

        Args:
            recording: The shot.
            fps: Frames per second.
            left: The text under the table on the left, before the time.
            right: The text under the table on the right, shown in the last second.
            compare: Another run of the same shot, drawn as rings.
            only_last: Whether to yield only the last frame, which is the same as in the whole film.
            circles: Circles to mark on the cloth: x, y and radius, m.

        Yields:
            The frame, valid until the next one is drawn.

        Raises:
            ValueError: If `compare` has other balls or another table.
        """
        if compare is not None:
            check_pair(recording, compare)
        duration = max(shot.time for shot in (recording, compare) if shot is not None)
        shown = Motion(self, recording, compare, 1.0 / fps)
        for x, y, radius in circles:
            self.draw_path(shown.base, self.pixels_of(circle((x, y), radius)), CHALK)
        frame = self.table.copy()
        for t in [duration] if only_last else frame_times(duration, fps).tolist():
            shown.draw(frame, t)
            line = f"{left}   {t:.2f} s" if duration > 0 else left
            self.draw_bar(frame, line, right if t >= duration - RESULT_SHOWN else "", shown.potted(t))
            yield frame

    @functools.cached_property
    def table(self) -> Surface:
        """A frame of the empty table, to be copied."""
        return paint_table(self.scene.table, self.size, self.pixels_of, self._paper)

    def draw_balls(
        self,
        surface: Surface,
        balls: Sequence[int],
        centres: Sequence[Floats],
        faces: Floats | None = None,
        heights: Floats | None = None,
    ) -> None:
        """Draws some balls with their shadows, each at its centre (2,), pixels.

        `faces` are (n, 4) orientations of all balls of the scene, see `orientation`; None for upright balls. `heights`
        are the heights (n,) of all balls above the cloth, m; None for balls on the cloth. Higher balls are drawn last.
        """
        up = np.zeros(self.scene.n_balls) if heights is None else heights
        for ball, centre in zip(balls, centres, strict=True):
            radius, away = self.scene.balls.radius[ball], np.array([-LIGHT[0], LIGHT[1]]) / LIGHT[2]
            picture = functools.partial(shadow, self.scale * radius, wide=1.0 + SPREAD * float(up[ball]) / radius)
            _stamp(surface, centre + self.scale * up[ball] * away, picture)
        turned = np.tile(UPRIGHT, (self.scene.n_balls, 1)) if faces is None else faces
        order = np.argsort(up[list(balls)], kind="stable")
        above, places = np.array(balls, np.intp)[order], np.reshape(centres, (-1, 2))[order]
        self._painter.draw(surface, above.tolist(), places, turned[above], 1.0 + LIFT * up[above])

    def draw_ring(self, surface: Surface, ball: int, centre: Floats, height: float = 0.0) -> None:
        """Draws a ball of another run at a height, m, as a ring around a centre (2,), pixels."""
        colour, radius = self.looks[ball].path, self.scale * self.scene.balls.radius[ball] * (1.0 + LIFT * height)
        _stamp(surface, centre, functools.partial(ring, radius, colour))

    def draw_path(self, surface: Surface, points: Floats, colour: str) -> None:
        """Draws a line with round ends through points (m, 2), pixels."""
        if not np.ptp(points, axis=0).any():
            return
        half = max(1.6, self.size[0] / 420) / 2
        ways = np.diff(points, axis=0)
        lengths = np.hypot(*ways.T)[:, None]
        across = half * np.column_stack((-ways[:, 1], ways[:, 0])) / np.where(lengths > 0, lengths, np.inf)
        sides = points[:-1] + across, points[1:] + across, points[1:] - across, points[:-1] - across
        draw_shapes(surface, [(corners, colour) for corners in np.stack(sides, 1)], 255, points, half)

    def draw_arrow(self, surface: Surface, ball: int, position: Floats, velocity: Floats) -> None:
        """Draws the velocity (2,), m/s, of a ball at `position` (2,), m, as an arrow from its edge."""
        speed = float(np.hypot(*velocity))
        if speed == 0:
            return
        along = velocity / speed * (1, -1)
        across = np.array([-along[1], along[0]])
        radius = self.scale * self.scene.balls.radius[ball]
        start = self.pixels_of(position) + ARROW_START * radius * along
        length = max(self.scale * ARROW * speed, 0.8 * radius)
        room = self._half - np.sign(along) * (start - self._middle)
        for k in np.flatnonzero(along):  # the tip ends at the cushion, or on the rail if the ball is next to it
            length = min(length, max(room[k] / abs(along[k]), 2.5 * radius))
        head, half = min(0.9 * radius, length), 0.16 * radius
        tip, neck = start + length * along, start + (length - head) * along
        shape = [start + half * across, neck + half * across, neck + 0.45 * radius * across, tip]
        shape += [neck - 0.45 * radius * across, neck - half * across, start - half * across]
        draw_shapes(surface, [(np.array(shape), CHALK)], 210)

    def draw_bar(
        self, surface: Surface, left: str, right: str, potted: Sequence[int] | NDArray[np.intp], label: str = POTTED
    ) -> None:
        """Draws the bar under the table: two texts, and the potted balls with a label, if the table has pockets.

        A text that is too long for its place beside the tray becomes smaller.
        """
        edge, size, y = 2 * self._margin, round(0.6 * self._bar), self.size[1] - self._bar / 2
        begin = end = self.size[0] * 2 // 3
        if self.scene.table.pockets:
            tray = self.draw_tray(surface, potted)
            begin, end = tray.left, tray.right
            if label:
                begin = write(surface, label, size, self._ink, midright=(begin - self._tray.radius, y)).left
        write(surface, right, size, self._ink, self.size[0] - end - 2 * edge, midright=(self.size[0] - edge, y))
        parts = re.findall(r"\d|\D+", left)  # the images of single digits are kept, and the time changes quickly
        wide = sum(text_image(part, size, self._ink).get_width() for part in parts)
        size = max(1, min(size, size * (begin - 2 * edge) // max(wide, 1)))
        for part in parts:
            edge += write(surface, part, size, self._ink, midleft=(edge, y)).width

    def draw_tray(self, surface: Surface, potted: Sequence[int] | NDArray[np.intp]) -> pygame.Rect:
        """Draws the potted balls in their groove and returns the place of the groove."""
        middle, y = self.size[0] / 2, self.size[1] - self._bar / 2
        groove = surface.blit(self._groove, np.round((middle, y) - np.array(self._groove.get_size()) / 2).tolist())
        places = np.array([(middle + x, y) for x in self._tray.x[: len(potted)]]).reshape(-1, 2)
        self._tray_painter.draw(surface, list(potted), places, np.tile(UPRIGHT, (len(potted), 1)), np.ones(len(potted)))
        return groove

    @functools.cached_property
    def _groove(self) -> Surface:
        size = np.round([2 * self._tray.half, 2.7 * self._tray.radius]).astype(int)
        large = Surface((TABLE_ZOOM * size).tolist(), 0, 32)
        large.fill(self._paper)
        pygame.draw.rect(large, RAIL, large.get_rect(), border_radius=large.get_height() // 2)
        return pygame.transform.smoothscale(large, size.tolist())


class Motion:
    """Draws a shot in motion, and another run of it as rings, at times that increase.

    Attributes:
        base: The table with the initial velocity of the cue ball, the paths up to now, and what the caller adds.
    """

    def __init__(
        self, canvas: Canvas, recording: Recording, compare: Recording | None, step: float, faces: Floats | None = None
    ) -> None:
        """Prepares the drawing. Paths grow in pieces of `step` seconds.

        The paths of the rings, and the paths in the air, leave out every second piece.
        `faces` are the orientations of the balls at the start, see `Canvas.draw_balls`.
        """
        self.base = canvas.table.copy()
        self._canvas, self._recording, self._step, self._steps = canvas, recording, step, 0
        self._turning = recording.turning(faces, VISIBLE)
        # Each run with the times and points of the paths of its moving balls. The rings are drawn first.
        self._runs: list[tuple[Recording, dict[int, tuple[Floats, Floats]]]] = []
        for run in (recording,) if compare is None else (compare, recording):
            moving = [ball for ball in range(canvas.scene.n_balls) if run.moves(ball)]
            self._runs.append((run, {ball: self._points(run, ball) for ball in moving}))
        for ball in self._runs[-1][1]:
            start = circle(recording.path(ball, [0.0])[0], canvas.scene.balls.radius[ball])
            draw_shapes(self.base, [(canvas.pixels_of(start), canvas.looks[ball].path)], 90)
        if recording.gone[recording.cue] > 0:
            paths, cue = recording.trajectory, recording.cue
            canvas.draw_arrow(self.base, cue, paths.position[cue], paths.velocity[cue])

    @property
    def least_time(self) -> float:
        """The least time that can be drawn, s."""
        return self._steps * self._step

    def potted(self, time: float) -> NDArray[np.intp]:
        """Returns the balls that are potted at a time, s."""
        return self._recording.potted(time)

    def draw(self, frame: Surface, time: float) -> None:
        """Draws the table with the paths and the balls at a time, s."""
        canvas = self._canvas
        while self.least_time + self._step <= time:
            self._draw_paths(self.base, self.least_time + self._step)
            self._steps += 1
        frame.blit(self.base, (0, 0))
        self._draw_paths(frame, time)
        for run, _ in self._runs:
            places = canvas.pixels_of(run.trajectory.at(min(time, run.time)))
            shown = np.flatnonzero(run.gone > time).tolist()
            heights = np.zeros(canvas.scene.n_balls)
            if canvas.scene.physics.flight:
                heights[shown] = [run.heights(ball, [min(time, run.time)])[0] for ball in shown]
            if run is self._recording:
                canvas.draw_balls(frame, shown, [places[ball] for ball in shown], self._turning.at(time), heights)
            else:
                for ball in shown:
                    canvas.draw_ring(frame, ball, places[ball], float(heights[ball]))

    def _points(self, run: Recording, ball: int) -> tuple[Floats, Floats]:
        """Returns the times (m,), s, and the points (m, 2), pixels, of a ball's path up to its end."""
        step = self._step / PATH_STEPS
        times, points = run.track(ball, np.arange(math.ceil(run.time / step)) * step)
        return times, self._canvas.pixels_of(points)

    def _draw_paths(self, surface: Surface, end: float) -> None:
        """Draws the paths from the start of the present step to a later time, s."""
        for run, paths in self._runs:
            for ball, (times, points) in paths.items():
                if self._steps % 2 == 1 and (run is not self._recording or run.flies(ball, [self.least_time])[0]):
                    continue
                first, last = np.searchsorted(times, (self.least_time - 1e-12, end + 1e-12)).tolist()
                line = points[first:last]
                if len(line) and times[last - 1] < end - 1e-12 and last < len(times):
                    line = np.vstack((line, self._canvas.pixels_of(run.path(ball, [end]))))
                if len(line) > 1:
                    self._canvas.draw_path(surface, line, self._canvas.looks[ball].path)


def _stamp(surface: Surface, centre: Floats, picture: Callable[[float, float], Surface]) -> None:
    """Draws a picture around a centre (2,), pixels. It is made for some fractions of a pixel along x and along y."""
    pixel = np.floor(centre)
    fractions = (np.floor((centre - pixel) * SUBPIXELS) + 0.5) / SUBPIXELS
    image = picture(*fractions.tolist())
    surface.blit(image, (pixel - image.get_width() // 2).astype(int).tolist())


def draw_shapes(
    surface: Surface, shapes: Sequence[tuple[Floats, str]], alpha: int = 255, dots: Any = (), half: float = 1.0
) -> None:
    """Draws polygons, and dots with the colour of the first one, with smooth edges.

    Args:
        surface: The surface.
        shapes: The corners of each polygon, (m, 2) pixels, and its colour.
        alpha: The opacity, up to 255.
        dots: The centre of each dot, (2,) pixels.
        half: The radius of the dots, pixels.
    """
    points, colour = np.vstack([*(corners for corners, _ in shapes), *np.reshape(dots, (-1, 1, 2))]), shapes[0][1]
    low, high = np.floor(points.min(0) - half).astype(int), np.ceil(points.max(0) + half).astype(int)
    area = pygame.Rect(*low.tolist(), *(high - low).tolist()).clip(surface.get_rect())
    large = Surface((PATH_ZOOM * area.width, PATH_ZOOM * area.height), pygame.SRCALPHA, 32)
    large.fill((*pygame.Color(colour)[:3], 0))
    for corners, fill in shapes:
        pygame.draw.polygon(large, fill, (PATH_ZOOM * (corners - area.topleft)).tolist())
    for centre in dots:
        pygame.draw.circle(large, colour, PATH_ZOOM * (centre - area.topleft), PATH_ZOOM * half)
    small = pygame.transform.smoothscale(large, area.size)
    small.set_alpha(alpha)
    surface.blit(small, area)


def circle(centre: ArrayLike, radius: float, first: float = 0.0, last: float = math.tau) -> Floats:
    """Returns points (97, 2) of a circle, m, from one angle to another, radians."""
    angles = np.linspace(first, last, 97)
    return np.asarray(centre, dtype=np.float64) + radius * np.column_stack((np.cos(angles), np.sin(angles)))


def pixels(surface: Surface) -> Frame:
    """Returns a copy of a frame as an array (height, width, 3) uint8, RGB."""
    width, height = surface.get_size()
    return np.frombuffer(bytearray(pygame.image.tobytes(surface, "RGB")), np.uint8).reshape(height, width, 3)
