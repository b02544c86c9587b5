"""Draws a model with pygame; opens no window and handles no events."""

from __future__ import annotations

import itertools
import math
import operator
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from billiards_env.drawing.canvas import RESULT_SHOWN, Canvas, Motion, Surface, circle, draw_shapes, pygame
from billiards_env.drawing.recording import Floats, recording_of
from billiards_env.drawing.style import CHALK
from billiards_env.drawing.text import text_image, write
from billiards_env.games.game_state import BEHIND, is_in, members, on_table
from billiards_env.play import labels
from billiards_env.play.model import WindowModel
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

LEAST_ROW, MOST_ROW = 36, 220
"""Pixels. Limits of the height of the row of controls."""

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
        panel: The controls.
        size: (width, height) of a frame, pixels.
    """

    def __init__(self, scene: Scene, width: int, palette: str = "realistic") -> None:
        """Prepares the drawing of a scene in frames of `width` pixels that have the height of their content.

        `palette` is one of `style.PALETTES`, the colours of the balls.
        """
        self._palette, width = palette, width // 2 * 2
        height = Canvas(scene, width).size[1] + _strip(width)
        self.resize(scene, (width, height + _row((width, height + width // 10))))

    def resize(self, scene: Scene, size: tuple[int, int]) -> None:
        """Prepares the drawing in frames of `size` (width, height), pixels, with the largest table that fits."""
        self.size, self._strip, row = size, _strip(min(size[0], 3 * size[1] // 2)), _row(size)
        height, width = size[1] - self._strip - row, max(160, size[0])
        while (canvas := Canvas(scene, width, PAPER, INK, self._palette)).size[1] > height and width > 160:
            width = max(160, min(width - 2, width * height // canvas.size[1]))
        self.canvas, side = canvas, canvas.size[0] // 80
        corner = (size[0] - canvas.size[0]) // 2, max(0, height - canvas.size[1]) // 2
        self._place = pygame.Rect(corner, canvas.size)
        controls = pygame.Rect(corner[0] + side, self._place.bottom, canvas.size[0] - 2 * side, row)
        self.panel = Panel(controls, scene.cue.miscue_offset)
        self._frame, self._table = Surface(size, 0, 32), Surface(canvas.size, 0, 32)
        self._shots: tuple[ShotResult, ShotResult | None] | None = None
        self._enlarged: dict[tuple[float, ...], Canvas] = {}
        self._inset: tuple[pygame.Rect, Canvas] | None = None

    def pixels_of(self, point: ArrayLike) -> Floats:
        """Returns the pixels (2,) of a point (2,), m, from the upper left corner of a frame."""
        return self.canvas.pixels_of(point) + self._place.topleft

    def point_of(self, pixel: tuple[int, int]) -> tuple[float, float]:
        """Returns the point, m, of a pixel of a frame, including the enlarged part."""
        enlarged = self._inset is not None and self._inset[0].collidepoint(pixel)
        place, canvas = self._inset if self._inset and enlarged else (self._place, self.canvas)
        return canvas.point_of((pixel[0] - place.x, pixel[1] - place.y))

    def draw(self, model: WindowModel, message: str = "", page: Sequence[Sequence[str]] = ()) -> Surface:
        """Returns the frame of a model, valid until the next call.

        A `message` replaces the hint on the keys. A `page` covers the table; each of its rows has two texts.
        """
        self._frame.fill(PAPER)
        self._inset = None
        if model.phase in ("rolling", "replaying"):
            self._draw_shot(model)
        else:
            self._draw_turn(model, self.canvas, self._table)
            self._draw_considered(model)
            if model.aimed is not None:
                self._draw_cue(model)
                self._inset = self._draw_inset(model) if model.zoom and model.aimed.ball >= 0 else None
            potted = np.flatnonzero(~is_in(on_table(model.game.state), len(model.game.positions))).tolist()
            self.canvas.draw_bar(self._table, labels.status(model), labels.result(model), potted, label="")
        self._frame.blit(self._table, self._place)
        if model.page != "unsaved":
            self.panel.draw(self._frame, model)
        text, colour = message or labels.key_hint(model), INK if message else SOFT
        left = self._place.x + self._place.width // 40, self.size[1] - round(0.58 * self._strip)
        write(self._frame, text, round(0.66 * self._strip), colour, self._place.width * 38 // 40, midleft=left)
        if page:
            self._draw_rows(page)
        elif model.phase == "over":
            self._draw_end(model)
        return self._frame

    def _draw_turn(self, model: WindowModel, canvas: Canvas, frame: Surface) -> None:
        """Draws the balls at rest on the frame of a canvas, with the aim if a person has the turn."""
        frame.blit(canvas.table, (0, 0))
        game, cue, aimed, table = model.game, model.cue, model.aimed, model.setup.scene.table
        radius, lines = model.setup.scene.balls.radius, []
        if model.phase == "placing" and game.state.in_hand == BEHIND:
            line = circle((table.head_x, 0.0), table.d_radius, math.pi / 2, 3 * math.pi / 2)
            ends = np.array([[table.head_x, -table.width / 2], [table.head_x, table.width / 2]])
            lines.append((np.vstack((line, line[:1])) if table.d_radius else ends, CHALK))
        if aimed is not None:
            lines.append((aimed.path, canvas.looks[cue].path))
            _draw_line(canvas, frame, aimed.cue, canvas.looks[cue].path, dashed=True)
            if aimed.ball >= 0:
                lines.append((aimed.struck, canvas.looks[aimed.ball].path))
                lines.append((circle(aimed.path[-1], radius[cue]), canvas.looks[cue].path))
            if model.call.ball >= 0:
                lines.append((circle(game.positions[model.call.ball], 1.5 * radius[model.call.ball]), LEVEL))
            if model.call.pocket >= 0:
                *centre, reach = table.pockets[model.call.pocket].circle
                lines.append((circle(centre, reach), LEVEL))
        for line, colour in lines:
            _draw_line(canvas, frame, line, colour)
        shown = {ball: game.positions[ball] for ball in members(game.state.object_balls)}
        if not game.state.in_hand or model.aim.place is not None:
            shown[cue] = np.array(model.cue_position)
        canvas.draw_balls(frame, list(shown), [canvas.pixels_of(place) for place in shown.values()], model.faces)
        if aimed is not None and canvas is self.canvas:
            canvas.draw_arrow(frame, cue, np.array(model.cue_position), model.aim.speed * model.aim.along)

    def _draw_considered(self, model: WindowModel) -> None:
        """Draws the shots that a program considers, and their values in places that do not overlap."""
        width, height = self.canvas.size
        room, size, taken = (
            pygame.Rect(0, 0, width, height).inflate(-width // 16, -width // 8),
            max(10, width // 48),
            [],
        )
        for _, preview in model.considered:
            _draw_line(self.canvas, self._table, preview.path, self.canvas.looks[model.cue].path, dashed=True)
            if preview.ball >= 0:
                _draw_line(self.canvas, self._table, preview.struck, self.canvas.looks[preview.ball].path, dashed=True)
        for plan, preview in model.considered:
            end = preview.path[-1] if preview.ball < 0 else preview.struck[-1]
            text = text_image(labels.value(plan), size, INK)
            place = text.get_rect(center=self.canvas.pixels_of(end).round().astype(int).tolist()).clamp(room)
            while place.collidelist(taken) >= 0:
                place.move_ip(0, -size)
            taken.append(place.inflate(size // 2, size // 4))
            pygame.draw.rect(self._table, PAPER, taken[-1], border_radius=size // 4)
            self._table.blit(text, place)

    def _draw_inset(self, model: WindowModel) -> tuple[pygame.Rect, Canvas]:
        """Draws the ball that the aimed shot touches first enlarged, in the corner that is farthest from the shot."""
        assert model.preview is not None
        table, ball = model.setup.scene.table, model.game.positions[model.preview.ball]
        side, point = round(INSET * self.canvas.scale * table.width), tuple(ball.tolist())
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
        return rect.move(self._place.topleft), self._enlarged[point]

    def _draw_cue(self, model: WindowModel) -> None:
        """Draws the cue behind the cue ball, drawn back over the speed; a raised cue is shorter."""
        radius, along = model.setup.scene.balls.radius[model.cue], model.aim.along
        across = np.array([-along[1], along[0]])
        tip = np.array(model.cue_position) + model.aim.tip[0] * radius * across
        tip = tip - (radius * 1.15 + CUE_GAP * model.aim.speed) * along
        length, parts = max(CUE_LENGTH * math.cos(math.radians(model.aim.elevation)), 0.12), []
        for begin, end, colour in CUE_PARTS:
            shares = np.array([begin, end])
            places, half = tip - np.outer(length * shares, along), (0.0065 + 0.0085 * shares)[:, None] * across
            parts.append((self.canvas.pixels_of(np.vstack((places + half, (places - half)[::-1]))), colour))
        width, height = self.canvas.size
        draw_shapes(self._table.subsurface((0, 0, width, height - width // 24)), parts)

    def _draw_shot(self, model: WindowModel) -> None:
        """Draws the shown shots at the model's clock."""
        time = model.clock
        same = self._shots is not None and all(map(operator.is_, self._shots, model.shown_shots))
        if not same or time < self._motion.least_time:
            self._start_paths(model)
        self._motion.draw(self._table, time)
        result = labels.result(model) if time >= model.duration - RESULT_SHOWN else ""
        status = f"{labels.status(model)}   {time:.2f} s"
        self.canvas.draw_bar(self._table, status, result, self._motion.potted(time), label="")

    def _start_paths(self, model: WindowModel) -> None:
        """Draws the table at the start of the shown shots."""
        self._shots = shot, ghost = model.shown_shots
        recording, rings = recording_of(shot), None if ghost is None else recording_of(ghost)
        self._motion = Motion(self.canvas, recording, rings, STEP, model.first_faces)

    def _draw_rows(self, rows: Sequence[Sequence[str]]) -> None:
        """Draws rows of two texts on a page that covers the table."""
        page = self._frame.subsurface(self._place.clip(self._frame.get_rect()))
        page.fill(PAPER)
        width, height = page.get_size()
        row = min(height // (len(rows) + 1), width // 24)
        top, size = (height - row * len(rows) + row) // 2, round(0.72 * row)
        longest = max(text_image(effect, size, SOFT).get_width() for _, effect in rows)
        size = round(size * min(1.0, 0.71 * width / longest))  # one size for all rows
        for y, (key, effect) in zip(range(top, top + row * len(rows), row), rows, strict=True):
            write(page, key, size, INK, round((0.2 if effect else 0.92) * width), midleft=(0.05 * width, y))
            write(page, effect, size, SOFT, round(0.71 * width), midleft=(0.26 * width, y))

    def _draw_end(self, model: WindowModel) -> None:
        """Draws the result of a game over the table."""
        width, height = round(0.56 * self._place.width), round(0.4 * self._place.height)
        board = Surface((width, height), pygame.SRCALPHA, 32)
        pygame.draw.rect(board, (*pygame.Color(PAPER)[:3], 245), board.get_rect(), border_radius=height // 12)
        rows = (labels.status(model), 0.26, INK), (labels.score_text(model), 0.17, LEVEL), (labels.END, 0.1, SOFT)
        for (text, size, colour), share in zip(rows, (0.28, 0.56, 0.8), strict=True):
            write(board, text, round(size * height), colour, round(0.92 * width), center=(width // 2, share * height))
        self._frame.blit(board, board.get_rect(center=self.pixels_of((0.0, 0.0)).round().astype(int).tolist()))


def _draw_line(canvas: Canvas, frame: Surface, points: Floats, colour: str, dashed: bool = False) -> None:
    """Draws a line through points (m, 2), m, in short pieces, which need only small surfaces."""
    line = canvas.pixels_of(points)
    if len(line) < 2:
        return
    along = np.append(0.0, np.cumsum(np.hypot(*np.diff(line, axis=0).T)))
    count = 2 * math.ceil(along[-1] / 24) + 1 if dashed else math.ceil(along[-1] / 50) + 1
    stops = np.linspace(0.0, along[-1], count + 1)
    for ends in list(itertools.pairwise(stops))[:: 1 + dashed]:
        at = np.union1d(ends, along[(along > ends[0]) & (along < ends[1])])
        piece = np.column_stack([np.interp(at, along, line[:, c]) for c in (0, 1)])
        if (piece.max(0) >= 0).all() and (piece.min(0) <= frame.get_size()).all():
            canvas.draw_path(frame, piece, colour)


def _strip(width: int) -> int:
    """Returns the height of the line with the keys, pixels."""
    return min(max(width // 36, LEAST_STRIP), MOST_STRIP)


def _row(size: tuple[int, int]) -> int:
    """Returns the height of the row of controls in a frame of `size`, pixels."""
    return round(min(max(min(size[0] / 10, size[1] / 5), LEAST_ROW), MOST_ROW))
