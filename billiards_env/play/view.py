"""Draws a model with pygame; opens no window and handles no events."""

from __future__ import annotations

import itertools
import math
import operator
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from billiards_env.drawing.canvas import GHOST, PATH_STEPS, RING, Canvas, Surface, pygame
from billiards_env.drawing.orientation import VISIBLE, turning
from billiards_env.drawing.recording import Floats, Recording
from billiards_env.drawing.style import CHALK
from billiards_env.drawing.text import text_image
from billiards_env.play import controls, labels
from billiards_env.play.controls import STEEPEST, Box, Controls
from billiards_env.play.model import Model
from billiards_env.scene import Scene
from billiards_env.shot import ShotResult

FPS = 60

STEP = 1 / 60
"""s. Paths grow in pieces of this time, also in slow motion. Every second piece of a ghost's path is left out."""

RESULT_SHOWN = 1.0
"""s. The result of a shot is shown for this time at its end."""

PAPER, INK, SOFT = "#14181a", "#eceae2", "#9aa3a0"
"""Colours of the window around the table, of its texts and of the hints."""

PANEL, GROOVE, LEVEL, BUTTON = "#1e2427", "#0c0f10", "#d9a441", "#2f8163"
"""Colours of the controls: a panel, an empty scale, a filled scale, and the button."""

LEAST_STRIP, MOST_STRIP = 20, 36
"""Pixels. Limits of the height of the line with the keys."""

ZOOM = 3
"""Enlargement of the controls before they are reduced."""

CUE_LENGTH, CUE_GAP = 1.45, 0.012
"""m, and m per m/s: the length of the cue, and how far it is drawn back over the speed of the shot."""


class View:
    """Draws the models of one scene.

    Attributes:
        canvas: The canvas of the table, in the middle of the frame.
        controls: The places of the controls.
        size: (width, height) of a frame, pixels.
    """

    def __init__(self, scene: Scene, width: int) -> None:
        """Prepares the drawing of a scene in frames of `width` pixels that have the height of their content."""
        height = Canvas(scene, width).size[1] + _strip(width)
        width = width // 2 * 2
        self.resize(scene, (width, height + controls.height_of((width, height + width // 10))))

    def resize(self, scene: Scene, size: tuple[int, int]) -> None:
        """Prepares the drawing in frames of `size` (width, height), pixels, with the largest table that fits."""
        self.size, self._strip, self._row = size, _strip(size[0]), controls.height_of(size)
        height, width = size[1] - self._strip - self._row, max(160, size[0])
        while (canvas := Canvas(scene, width, PAPER, INK)).size[1] > height and width > 160:
            width = max(160, min(width - 2, width * height // canvas.size[1]))
        self.canvas = canvas
        self._corner = (size[0] - canvas.size[0]) // 2, max(0, height - canvas.size[1]) // 2
        side = canvas.size[0] // 80
        self.controls = controls.place(
            self._corner[0] + side, self._corner[1] + canvas.size[1], canvas.size[0] - 2 * side, self._row
        )
        self._frame, self._table = Surface(size, 0, 32), Surface(canvas.size, 0, 32)
        self._shots: tuple[ShotResult, ShotResult | None] | None = None

    def pixels_of(self, point: ArrayLike) -> Floats:
        """Returns the pixels (2,) of a point (2,), m, from the upper left corner of a frame."""
        return self.canvas.pixels_of(point) + self._corner

    def point_of(self, pixel: tuple[int, int]) -> tuple[float, float]:
        """Returns the point, m, of a pixel of a frame."""
        return self.canvas.point_of((pixel[0] - self._corner[0], pixel[1] - self._corner[1]))

    def draw(self, model: Model, message: str = "", question: Sequence[tuple[str, str]] = ()) -> Surface:
        """Draws a model.

        Args:
            model: The model.
            message: A line that replaces the hint on the keys.
            question: Rows of two texts that cover the table; empty for none.

        Returns:
            The frame, valid until the next call.
        """
        self._frame.fill(PAPER)
        self._draw_shot(model) if model.phase in ("rolling", "replaying") else self._draw_turn(model)
        self._frame.blit(self._table, self._corner)
        self._draw_controls(model)
        x, y = self._corner[0] + self.canvas.size[0] // 40, self.size[1] - self._strip
        text, colour = message or ("" if question else labels.key_hint(model)), INK if message else SOFT
        line = text_image(text, round(0.66 * self._strip), colour, self.canvas.size[0] * 38 // 40)
        self._frame.blit(line, (x, y + (self._strip - line.get_height()) // 3))
        rows = question or (labels.KEYS if model.help else ())
        if rows:
            self._draw_rows(rows)
        elif model.phase == "over":
            self._draw_end(model)
        return self._frame

    def _draw_turn(self, model: Model) -> None:
        """Draws the balls at rest, with the aim if a person has the turn."""
        canvas, frame = self.canvas, self._table
        frame.blit(canvas.table, (0, 0))
        game, cue, preview = model.game, model.cue, model.preview
        if model.phase == "placing" and game.state.in_hand == "behind":
            x, y = model.setup.scene.table.head_x, model.setup.scene.table.width / 2
            self._draw_line(frame, np.array([[x, -y], [x, y]]), CHALK)
        if preview is not None:
            self._draw_line(frame, preview.path, canvas.looks[cue].path)
            self._draw_line(frame, preview.cue, canvas.looks[cue].path, dashed=True)
            if preview.ball >= 0:
                self._draw_line(frame, preview.struck, canvas.looks[preview.ball].path)
        shown = {ball: game.positions[ball] for ball in sorted(game.state.on_table - {cue})}
        if cue in game.state.on_table and not (game.state.in_hand != "no" and model.place is None):
            shown[cue] = np.array(model.cue_position)
        canvas.draw_balls(frame, list(shown), [canvas.pixels_of(place) for place in shown.values()], model.faces)
        if preview is not None:
            if preview.ball >= 0:
                canvas.stamp(frame, cue, canvas.pixels_of(preview.path[-1]), RING)
            aim = model.speed * np.array([math.cos(model.angle), math.sin(model.angle)])
            canvas.draw_arrow(frame, cue, np.array(model.cue_position), aim)
            self._draw_cue(model)
        potted = sorted(set(range(len(game.positions))) - game.state.on_table)
        canvas.draw_bar(frame, labels.status(model), labels.result(model), potted)

    def _draw_cue(self, model: Model) -> None:
        """Draws the cue behind the cue ball, drawn back over the speed; a raised cue is shorter."""
        canvas, radius = self.canvas, model.setup.scene.balls.radius[model.cue]
        along = np.array([math.cos(model.angle), math.sin(model.angle)])
        across, flat = np.array([-along[1], along[0]]), math.cos(math.radians(model.elevation))
        tip = np.array(model.cue_position) - model.tip[0] * radius * across
        tip = tip - (radius * 1.15 + CUE_GAP * model.speed) * along
        length = max(CUE_LENGTH * flat, 0.12)

        def quad(begin: float, end: float, colour: str, shift: float = 0.0) -> None:
            shares, places = np.array([begin, end]), tip - np.outer([begin * length, end * length], along)
            half = (0.0065 + 0.0085 * shares)[:, None] * across
            corners = np.vstack((places + half, (places - half)[::-1])) + shift * np.array([0.4, -0.5]) * radius
            points = canvas.pixels_of(corners).tolist()
            pygame.draw.polygon(self._table, colour, points)
            pygame.draw.aalines(self._table, colour, True, points)

        for begin, end, colour in (
            (0.0, 0.008, "#3b6ea5"),
            (0.008, 0.025, "#f2efe6"),
            (0.025, 0.60, "#d8ac6a"),
            (0.60, 0.615, "#e9e4d4"),
            (0.615, 1.0, "#4a2417"),
        ):
            quad(begin, end, colour)

    def _draw_line(self, frame: Surface, points: Floats, colour: str, dashed: bool = False) -> None:
        """Draws a line through points (m, 2), m, in short pieces, which need only small surfaces."""
        line = self.canvas.pixels_of(points)
        if len(line) < 2:
            return
        along = np.append(0.0, np.cumsum(np.hypot(*np.diff(line, axis=0).T)))
        count = 2 * math.ceil(along[-1] / 24) + 1
        for k, ends in enumerate(itertools.pairwise(np.linspace(0.0, along[-1], count + 1))):
            if not (dashed and k % 2):
                at = np.union1d(ends, along[(along > ends[0]) & (along < ends[1])])
                piece = np.column_stack([np.interp(at, along, line[:, c]) for c in (0, 1)])
                self.canvas.draw_path(frame, piece, colour)

    def _draw_shot(self, model: Model) -> None:
        """Draws the shown shots at the model's clock."""
        canvas, frame, time = self.canvas, self._table, model.clock
        same = self._shots is not None and all(map(operator.is_, self._shots, model.shown_shots))
        if not same or time < self._steps * STEP:
            self._start_paths(model)
        while (self._steps + 1) * STEP <= time:
            self._draw_paths(self._paths, self._steps, (self._steps + 1) * STEP)
            self._steps += 1
        frame.blit(self._paths, (0, 0))
        self._draw_paths(frame, self._steps, time)
        for shot, _, ring in self._balls:
            places = canvas.pixels_of(shot.trajectory.at(min(time, shot.time)))
            shown = np.flatnonzero(shot.gone > time).tolist()
            if ring:
                for ball in shown:
                    canvas.stamp(frame, ball, places[ball], RING)
            else:
                canvas.draw_balls(frame, shown, [places[ball] for ball in shown], self._turning.at(time))
        result = labels.result(model) if time >= model.duration - RESULT_SHOWN else ""
        potted = np.flatnonzero(self._balls[-1][0].gone <= time)
        canvas.draw_bar(frame, f"{labels.status(model)}   {time:.2f} s", result, potted)

    def _start_paths(self, model: Model) -> None:
        """Draws the table at the start of the shown shots."""
        canvas = self.canvas
        self._shots, self._steps, self._paths = model.shown_shots, 0, canvas.table.copy()
        shot, ghost = model.shown_shots
        # Each shot with its moving balls, and whether it is drawn as rings; the ghost is drawn first.
        self._balls: list[tuple[Recording, list[int], bool]] = []
        for shown, ring in ((ghost, True), (shot, False)):
            if shown is not None:
                recording = shown.recording()
                moving = [ball for ball in range(len(recording.gone)) if recording.moves(ball)]
                self._balls.append((recording, moving, ring))
        recording, moving, _ = self._balls[-1]
        self._turning = turning(recording, model.first_faces, VISIBLE)
        for ball in moving:
            canvas.stamp(self._paths, ball, canvas.pixels_of(recording.path(ball, [0.0])[0]), GHOST)
        cue = model.games[-2].state.cue_balls[0]
        velocity = np.array(model.strokes[-1].velocity)
        canvas.draw_arrow(self._paths, cue, recording.path(cue, [0.0])[0], velocity)

    def _draw_paths(self, surface: Surface, step: int, end: float) -> None:
        """Draws the paths of the shown shots from the start of a step to a later time, s."""
        start = step * STEP
        for shot, moving, ring in self._balls:
            if ring and step % 2 == 0:
                continue
            for ball in moving:
                corners = shot.corners(ball)
                times = np.union1d(np.linspace(start, end, PATH_STEPS), corners[(corners > start) & (corners < end)])
                times = times[(times <= shot.time) & (times < shot.gone[ball])]
                if len(times):
                    points = self.canvas.pixels_of(shot.path(ball, times))
                    self.canvas.draw_path(surface, points, self.canvas.looks[ball].path)

    def _draw_rows(self, rows: Sequence[tuple[str, str]]) -> None:
        """Draws rows of two texts on a page that covers the table."""
        page = self._frame.subsurface(pygame.Rect(self._corner, self.canvas.size).clip(self._frame.get_rect()))
        page.fill(PAPER)
        width, height = page.get_size()
        row = min(height // (len(rows) + 1), width // 24)
        top = (height - row * len(rows)) // 2
        for k, (key, effect) in enumerate(rows):
            for text, x, end, colour in ((key, 0.08, 0.36, INK), (effect, 0.38, 0.98, SOFT)):
                end = end if effect else 0.98
                image = text_image(text, round(0.72 * row), colour, round((end - x) * width))
                page.blit(image, (round(x * width), top + k * row + (row - image.get_height()) // 2))

    def _draw_end(self, model: Model) -> None:
        """Draws the result of a game over the table."""
        width, height = self.canvas.size
        board = Surface((round(0.56 * width), round(0.4 * height)), pygame.SRCALPHA, 32)
        pygame.draw.rect(board, (*pygame.Color(PAPER)[:3], 225), board.get_rect(), border_radius=height // 30)
        rows = ((labels.status(model), 0.26, INK), (labels.score(model), 0.17, LEVEL), (labels.END, 0.1, SOFT))
        for (text, size, colour), share in zip(rows, (0.28, 0.56, 0.8), strict=True):
            image = text_image(text, round(size * board.get_height()), colour, round(0.92 * board.get_width()))
            board.blit(image, image.get_rect(center=(board.get_width() // 2, round(share * board.get_height()))))
        middle = self._corner[0] + width // 2, self._corner[1] + round(self.canvas.pixels_of((0.0, 0.0))[1])
        self._frame.blit(board, board.get_rect(center=middle))

    def _draw_controls(self, model: Model) -> None:
        """Draws the row of controls; those that cannot be used are faint."""
        places, corner = self.controls, (self._corner[0], self._corner[1] + self.canvas.size[1])
        size = self.canvas.size[0], self._row
        large = Surface((ZOOM * size[0], ZOOM * size[1]), 0, 32)
        large.fill(PAPER)

        def zoomed(box: Box) -> pygame.Rect:
            return pygame.Rect([round(ZOOM * (v - o)) for v, o in zip(box, (*corner, 0, 0), strict=True)])

        def knob(x: float, y: float, radius: float) -> None:
            pygame.draw.circle(large, GROOVE, (x, y), 1.15 * radius)
            pygame.draw.circle(large, INK, (x, y), radius)

        ball, limit = zoomed(places.ball), model.setup.scene.cue.miscue_offset
        radius = ball.width / 2
        _draw_face(large, ball.center, radius, limit)
        tip = ball.centerx + model.tip[0] * radius, ball.centery - model.tip[1] * radius
        pygame.draw.circle(large, "#274f7d", tip, 0.19 * radius)
        pygame.draw.circle(large, "#5a92cc", tip, 0.15 * radius)

        scale = zoomed(places.elevation)
        pygame.draw.rect(large, GROOVE, scale, border_radius=scale.width // 2)
        filled = scale.height * model.elevation / STEEPEST
        bar = pygame.Rect(scale.x, round(scale.bottom - filled), scale.width, round(filled))
        pygame.draw.rect(large, LEVEL, bar, border_radius=scale.width // 2)
        knob(scale.centerx, min(max(scale.bottom - filled, scale.y), scale.bottom), 0.62 * scale.width)

        scale, share = zoomed(places.speed), model.speed / model.max_speed
        pygame.draw.rect(large, GROOVE, scale, border_radius=scale.height // 2)
        for k in range(round(share * scale.width)):  # from green to red
            part = k / scale.width
            colour = pygame.Color(LEVEL).lerp("#c8452f", part) if part > 0.4 else pygame.Color(BUTTON).lerp(LEVEL, part / 0.4)
            inset = scale.height / 2 - math.sqrt(max(0.0, min(k, scale.height / 2) * (scale.height - min(k, scale.height / 2))))
            pygame.draw.line(large, colour, (scale.x + k, scale.y + inset), (scale.x + k, scale.bottom - 1 - inset))
        knob(scale.x + share * scale.width, scale.centery, 0.62 * scale.height)
        button = zoomed(places.shoot)
        pygame.draw.rect(large, BUTTON if model.phase in labels.BUTTONS else PANEL, button, border_radius=button.height // 5)
        row = pygame.transform.smoothscale(large, size)
        if model.phase != "aiming":
            veil = Surface(size, pygame.SRCALPHA, 32)
            veil.fill((*pygame.Color(PAPER)[:3], 150))
            shown = places.shoot
            veil.fill((0, 0, 0, 0), pygame.Rect(round(shown.x - corner[0]), 0, round(shown.width) + 2, size[1]))
            row.blit(veil, (0, 0))
        self._frame.blit(row, corner)
        small = max(9, round(0.17 * self._row))

        def write(text: str, x: float, y: float, colour: str, height: int, room: float) -> None:
            image = text_image(text, height, colour, max(1, round(room)))
            self._frame.blit(image, image.get_rect(center=(round(x), round(y))))

        box, level = places.speed, places.elevation
        write(f"{model.elevation:.0f}\u00b0", level.x + 2.6 * level.width, level.y + 0.8 * level.height, INK, small, 60)
        write("cue", level.x + 2.6 * level.width, level.y + 0.2 * level.height, SOFT, small, 60)
        write(labels.aim(model), box.x + box.width / 2, box.y - 0.17 * self._row, SOFT, small, box.width)
        box = places.shoot
        middle = box.x + box.width / 2, box.y + box.height / 2
        write(labels.BUTTONS.get(model.phase, ""), *middle, INK, round(0.3 * self._row), 0.86 * box.width)


def _draw_face(surface: Surface, centre: tuple[int, int], radius: float, limit: float) -> None:
    """Draws the cue ball from behind, with a ring at the offset at which the cue slips."""
    steps = 24
    for k in range(steps):
        light = 255 - 60 * (1 - k / steps) ** 2
        shift = 0.25 * radius * k / steps
        colour = (light, light, round(0.97 * light))
        pygame.draw.circle(surface, colour, (centre[0] - shift, centre[1] - shift), radius * (1 - k / steps))
    pygame.draw.circle(surface, "#c9b9b0", centre, limit * radius + 1, max(1, round(0.03 * radius)))
    for x, y in ((1, 0), (0, 1)):
        ends = [(centre[0] + s * 0.9 * radius * x, centre[1] + s * 0.9 * radius * y) for s in (-1, 1)]
        pygame.draw.line(surface, "#d8d2cc", *ends, max(1, round(0.02 * radius)))


def _strip(width: int) -> int:
    """Returns the height of the line with the keys, pixels."""
    return min(max(width // 28, LEAST_STRIP), MOST_STRIP)
