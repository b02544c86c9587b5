"""Draws a model with pygame; opens no window and handles no events."""

from __future__ import annotations

import itertools
import math
import operator
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from billiards_env.drawing.canvas import PATH_ZOOM, RESULT_SHOWN, Canvas, Motion, Surface, pygame
from billiards_env.drawing.recording import Floats
from billiards_env.drawing.style import CHALK
from billiards_env.drawing.text import text_image
from billiards_env.games.game_state import BEHIND, is_in, members, on_table
from billiards_env.play import controls, labels
from billiards_env.play.model import NO_SHOT, WindowModel
from billiards_env.play.pages import KEYS, rules_page
from billiards_env.play.panel import INK, LEVEL, PAPER, SOFT, Panel
from billiards_env.scene import Scene
from billiards_env.shots.result import ShotResult

FPS = 60

STEP = 1 / 60
"""s. Paths grow in pieces of this time, also in slow motion."""

INSET, INSET_REACH = 0.44, 3.5
"""Side of the square with the enlarged ball over the width of the table; half of it in ball radii."""

LEAST_STRIP, MOST_STRIP = 20, 64
"""Pixels. Limits of the height of the line with the keys."""

CUE_LENGTH, CUE_GAP = 1.45, 0.012
"""m, and m per m/s: the length of the cue, and how far it is drawn back over the speed of the shot."""

CUE_PARTS = (
    (0.0, 0.008, "#3b6ea5"),
    (0.008, 0.025, "#f2efe6"),
    (0.025, 0.60, "#d8ac6a"),
    (0.60, 0.615, "#e9e4d4"),
    (0.615, 1.0, "#4a2417"),
)
"""The tip, the ferrule, the shaft, a ring and the butt of the cue: begin and end over its length, and colour."""


class View:
    """Draws the models of one scene.

    Attributes:
        canvas: The canvas of the table, in the middle of the frame.
        controls: The places of the controls.
        size: (width, height) of a frame, pixels.
    """

    def __init__(self, scene: Scene, width: int, palette: str = "realistic") -> None:
        """Prepares the drawing of a scene in frames of `width` pixels that have the height of their content.

        `palette` is one of `style.PALETTES`, the colours of the balls.
        """
        self._palette = palette
        height = Canvas(scene, width).size[1] + _strip(width)
        width = width // 2 * 2
        self.resize(scene, (width, height + controls.height_of((width, height + width // 10))))

    def resize(self, scene: Scene, size: tuple[int, int]) -> None:
        """Prepares the drawing in frames of `size` (width, height), pixels, with the largest table that fits."""
        self.size, self._strip, rows = size, _strip(min(size[0], 3 * size[1] // 2)), controls.height_of(size)
        height, width = size[1] - self._strip - rows, max(160, size[0])
        while (canvas := Canvas(scene, width, PAPER, INK, self._palette)).size[1] > height and width > 160:
            width = max(160, min(width - 2, width * height // canvas.size[1]))
        self.canvas = canvas
        self._corner = (size[0] - canvas.size[0]) // 2, max(0, height - canvas.size[1]) // 2
        side = canvas.size[0] // 80
        row = self._corner[0] + side, self._corner[1] + canvas.size[1], canvas.size[0] - 2 * side, rows
        self.controls = controls.place_controls(*row)
        self._panel = Panel(self.controls, row)
        self._frame, self._table = Surface(size, 0, 32), Surface(canvas.size, 0, 32)
        self._shots: tuple[ShotResult, ShotResult | None] | None = None
        self._enlarged: dict[tuple[float, float], Canvas] = {}
        self._inset: tuple[pygame.Rect, Canvas] | None = None

    def pixels_of(self, point: ArrayLike) -> Floats:
        """Returns the pixels (2,) of a point (2,), m, from the upper left corner of a frame."""
        return self.canvas.pixels_of(point) + self._corner

    def point_of(self, pixel: tuple[int, int]) -> tuple[float, float]:
        """Returns the point, m, of a pixel of a frame, including the enlarged part."""
        if self._inset is not None and self._inset[0].collidepoint(pixel):
            return self._inset[1].point_of((pixel[0] - self._inset[0].x, pixel[1] - self._inset[0].y))
        return self.canvas.point_of((pixel[0] - self._corner[0], pixel[1] - self._corner[1]))

    def draw(self, model: WindowModel, message: str = "", question: Sequence[tuple[str, str]] = ()) -> Surface:
        """Returns the frame of a model, valid until the next call.

        A `message` replaces the hint on the keys. A `question` covers the table; each of its rows has two texts.
        """
        self._frame.fill(PAPER)
        self._inset = None
        if model.phase in ("rolling", "replaying"):
            self._draw_shot(model)
        else:
            self._draw_turn(model, self.canvas, self._table)
            if model.preview is not None and model.aim.call.kind not in NO_SHOT:
                self._draw_cue(model)
                self._inset = self._draw_inset(model) if model.zoom and model.preview.ball >= 0 else None
            potted = np.flatnonzero(~is_in(on_table(model.game.state), len(model.game.positions))).tolist()
            self._draw_bar(labels.status(model), labels.result(model), potted)
        self._frame.blit(self._table, self._corner)
        if not question:
            self._panel.draw(self._frame, model)
        x, y = self._corner[0] + self.canvas.size[0] // 40, self.size[1] - self._strip
        text, colour = message or ("" if question else labels.key_hint(model)), INK if message else SOFT
        line = text_image(text, round(0.66 * self._strip), colour, self.canvas.size[0] * 38 // 40)
        self._frame.blit(line, (x, y + (self._strip - line.get_height()) // 3))
        pages = {"keys": KEYS, "rules": rules_page(model.setup, model.choices)}
        rows = question or pages.get(model.page, ())
        if rows:
            self._draw_rows(rows)
        elif model.phase == "over":
            self._draw_end(model)
        return self._frame

    def _draw_turn(self, model: WindowModel, canvas: Canvas, frame: Surface) -> None:
        """Draws the balls at rest on the frame of a canvas, with the aim if a person has the turn."""
        frame.blit(canvas.table, (0, 0))
        game, cue, preview, table = model.game, model.cue, model.preview, model.setup.scene.table
        radius = model.setup.scene.balls.radius
        if model.aim.call.kind in NO_SHOT:
            preview = None
        if model.phase == "placing" and game.state.in_hand == BEHIND:
            x, y = table.head_x, table.width / 2
            line = np.array([[x, -y], [x, y]])
            if table.d_radius:
                line = _circle((x, 0.0), table.d_radius)[16:49]
                line = np.vstack((line, line[:1]))
            _draw_line(canvas, frame, line, CHALK)
        if preview is not None:
            _draw_line(canvas, frame, preview.path, canvas.looks[cue].path)
            _draw_line(canvas, frame, preview.cue, canvas.looks[cue].path, dashed=True)
            if preview.ball >= 0:
                _draw_line(canvas, frame, preview.struck, canvas.looks[preview.ball].path)
                _draw_line(canvas, frame, _circle(preview.path[-1], radius[cue]), canvas.looks[cue].path)
            ball, pocket, _ = model.call
            if ball >= 0:
                _draw_line(canvas, frame, _circle(game.positions[ball], 1.5 * radius[ball]), LEVEL)
            if pocket >= 0:
                hole = table.pockets[pocket]
                _draw_line(canvas, frame, _circle((hole.x, hole.y), hole.radius), LEVEL)
        shown = {ball: game.positions[ball] for ball in members(game.state.object_balls)}
        if not game.state.in_hand or model.aim.place is not None:
            shown[cue] = np.array(model.cue_position)
        canvas.draw_balls(frame, list(shown), [canvas.pixels_of(place) for place in shown.values()], model.faces)
        if preview is not None and canvas is self.canvas:
            aim = model.aim.speed * np.array([math.cos(model.aim.angle), math.sin(model.aim.angle)])
            canvas.draw_arrow(frame, cue, np.array(model.cue_position), aim)

    def _draw_inset(self, model: WindowModel) -> tuple[pygame.Rect, Canvas]:
        """Draws the ball that the aimed shot touches first enlarged, in the corner that is farthest from the shot."""
        assert model.preview is not None
        table, ball = model.setup.scene.table, model.game.positions[model.preview.ball]
        point = tuple(ball.tolist())
        side = round(INSET * self.canvas.scale * table.width)
        if point not in self._enlarged:
            reach = INSET_REACH * model.setup.scene.balls.radius[model.preview.ball] * self.canvas.scale
            self._enlarged = {point: self.canvas.enlarged((side, side), side / 2 / reach, point)}
        half = np.array([table.length, table.width]) / 2 - side / self.canvas.scale / 2
        corners = half * [[-1, -1], [-1, 1], [1, -1], [1, 1]]
        away = np.min([np.hypot(*(corners - one).T) for one in (ball, model.cue_position)], axis=0)
        rect = pygame.Rect(0, 0, side, side)
        rect.center = tuple(np.round(self.canvas.pixels_of(corners[away.argmax()])).astype(int).tolist())
        self._draw_turn(model, self._enlarged[point], self._table.subsurface(rect))
        pygame.draw.rect(self._table, INK, rect, max(2, side // 120))
        return rect.move(self._corner), self._enlarged[point]

    def _draw_bar(self, left: str, right: str, potted: Sequence[int] | NDArray[np.intp]) -> None:
        """Draws the bar under the table; a text that is too long for its place beside the tray becomes smaller."""
        canvas, frame, width = self.canvas, self._table, self.canvas.size[0]
        bar, edge, tray = width // 24, width // 40, pygame.Rect(width * 2 // 3, 0, 0, 0)
        if canvas.scene.table.pockets:
            tray = canvas.draw_tray(frame, width / 2, potted)
        for text, room, at_end in ((left, tray.left - 2 * edge, False), (right, width - 2 * edge - tray.right, True)):
            image = text_image(text, round(0.55 * bar), INK, room)
            x = width - edge - image.get_width() if at_end else edge
            frame.blit(image, (x, canvas.size[1] - (bar + image.get_height()) // 2))

    def _draw_cue(self, model: WindowModel) -> None:
        """Draws the cue behind the cue ball, drawn back over the speed; a raised cue is shorter."""
        canvas, radius = self.canvas, model.setup.scene.balls.radius[model.cue]
        along = np.array([math.cos(model.aim.angle), math.sin(model.aim.angle)])
        across, flat = np.array([-along[1], along[0]]), math.cos(math.radians(model.aim.elevation))
        tip = np.array(model.cue_position) + model.aim.tip[0] * radius * across
        tip = tip - (radius * 1.15 + CUE_GAP * model.aim.speed) * along
        length = max(CUE_LENGTH * flat, 0.12)

        parts = []
        for begin, end, colour in CUE_PARTS:
            shares = np.array([begin, end])
            places, half = tip - np.outer(length * shares, along), (0.0065 + 0.0085 * shares)[:, None] * across
            parts.append((canvas.pixels_of(np.vstack((places + half, (places - half)[::-1]))), colour))
        points = np.vstack([corners for corners, _ in parts])
        corner = np.maximum(np.floor(points.min(0)) - 1, 0)
        side = np.minimum(np.ceil(points.max(0)) + 2, (canvas.size[0], canvas.size[1] - canvas.size[0] // 24)) - corner
        if (side <= 0).any():
            return
        large = Surface((PATH_ZOOM * side).tolist(), pygame.SRCALPHA, 32)
        large.fill((*pygame.Color(CUE_PARTS[2][2])[:3], 0))
        for corners, colour in parts:
            pygame.draw.polygon(large, colour, (PATH_ZOOM * (corners - corner)).tolist())
        self._table.blit(pygame.transform.smoothscale(large, side.tolist()), corner.tolist())

    def _draw_shot(self, model: WindowModel) -> None:
        """Draws the shown shots at the model's clock."""
        time = model.clock
        same = self._shots is not None and all(map(operator.is_, self._shots, model.shown_shots))
        if not same or time < self._motion.least_time:
            self._start_paths(model)
        self._motion.draw(self._table, time)
        result = labels.result(model) if time >= model.duration - RESULT_SHOWN else ""
        self._draw_bar(f"{labels.status(model)}   {time:.2f} s", result, self._motion.potted(time))

    def _start_paths(self, model: WindowModel) -> None:
        """Draws the table at the start of the shown shots."""
        self._shots = shot, ghost = model.shown_shots
        recording, rings = shot.recording(), None if ghost is None else ghost.recording()
        self._motion = Motion(self.canvas, recording, rings, STEP, model.first_faces)
        cue = int(model.games[-2].state.cue_balls[0])
        velocity = np.array(model.strokes[-1].velocity)
        self.canvas.draw_arrow(self._motion.base, cue, recording.path(cue, [0.0])[0], velocity)

    def _draw_rows(self, rows: Sequence[tuple[str, str]]) -> None:
        """Draws rows of two texts on a page that covers the table."""
        page = self._frame.subsurface(pygame.Rect(self._corner, self.canvas.size).clip(self._frame.get_rect()))
        page.fill(PAPER)
        width, height = page.get_size()
        row = min(height // (len(rows) + 1), width // 24)
        top, size = (height - row * len(rows)) // 2, round(0.72 * row)
        longest = max(text_image(effect, size, SOFT).get_width() for _, effect in rows)
        size = round(size * min(1.0, 0.71 * width / longest))  # one size for all rows
        for k, (key, effect) in enumerate(rows):
            for text, x, end, colour in ((key, 0.05, 0.25 if effect else 0.97, INK), (effect, 0.26, 0.97, SOFT)):
                image = text_image(text, size, colour, round((end - x) * width))
                page.blit(image, (round(x * width), top + k * row + (row - image.get_height()) // 2))

    def _draw_end(self, model: WindowModel) -> None:
        """Draws the result of a game over the table."""
        width, height = self.canvas.size
        board = Surface((round(0.56 * width), round(0.4 * height)), pygame.SRCALPHA, 32)
        pygame.draw.rect(board, (*pygame.Color(PAPER)[:3], 245), board.get_rect(), border_radius=height // 30)
        rows = ((labels.status(model), 0.26, INK), (labels.score_text(model), 0.17, LEVEL), (labels.END, 0.1, SOFT))
        for (text, size, colour), share in zip(rows, (0.28, 0.56, 0.8), strict=True):
            image = text_image(text, round(size * board.get_height()), colour, round(0.92 * board.get_width()))
            board.blit(image, image.get_rect(center=(board.get_width() // 2, round(share * board.get_height()))))
        middle = self._corner[0] + width // 2, self._corner[1] + round(self.canvas.pixels_of((0.0, 0.0))[1])
        self._frame.blit(board, board.get_rect(center=middle))


def _circle(centre: ArrayLike, radius: float) -> Floats:
    """Returns points (65, 2) of a circle, m."""
    angles = np.linspace(0.0, math.tau, 65)
    return np.asarray(centre, dtype=np.float64) + radius * np.column_stack((np.cos(angles), np.sin(angles)))


def _draw_line(canvas: Canvas, frame: Surface, points: Floats, colour: str, dashed: bool = False) -> None:
    """Draws a line through points (m, 2), m, in short pieces, which need only small surfaces."""
    line = canvas.pixels_of(points)
    if len(line) < 2:
        return
    along = np.append(0.0, np.cumsum(np.hypot(*np.diff(line, axis=0).T)))
    count = 2 * math.ceil(along[-1] / 24) + 1 if dashed else math.ceil(along[-1] / 50) + 1
    for k, ends in enumerate(itertools.pairwise(np.linspace(0.0, along[-1], count + 1))):
        if not (dashed and k % 2):
            at = np.union1d(ends, along[(along > ends[0]) & (along < ends[1])])
            piece = np.column_stack([np.interp(at, along, line[:, c]) for c in (0, 1)])
            if (piece.max(0) >= 0).all() and (piece.min(0) <= frame.get_size()).all():
                canvas.draw_path(frame, piece, colour)


def _strip(width: int) -> int:
    """Returns the height of the line with the keys, pixels."""
    return min(max(width // 36, LEAST_STRIP), MOST_STRIP)
