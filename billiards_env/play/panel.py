"""The row of controls under the table: the cue ball's face, the elevation of the cue, the speed and the button."""

from __future__ import annotations

import numpy as np
import pygame

from billiards_env.drawing.text import write
from billiards_env.play import labels
from billiards_env.play.model import STEEPEST, WindowModel

PAPER, INK, SOFT = "#14181a", "#eceae2", "#9aa3a0"
"""Colours of the window around the table, of its texts and of the hints."""

GROOVE, LEVEL, BUTTON, FAST = "#0a0c0d", "#d9a441", "#2f8163", "#c8452f"
"""Colours of the controls: an empty scale, a filled scale, the button and a slow shot, and a fast shot."""

ZOOM = 3
"""Enlargement of the controls before they are reduced."""


def place_controls(row: pygame.Rect) -> dict[str, pygame.Rect]:
    """Returns the places of the controls in a row, pixels: "ball", "elevation", "speed" and "shoot", the button."""
    gap, inner, scale = 0.1 * row.height, 0.8 * row.height, max(0.16 * row.height, 8.0)
    x, y, button = row.x + gap, row.y + gap, min(1.6 * row.height, 0.22 * row.width)
    begin, end = x + inner + 5.5 * scale, row.right - gap - button
    places = {
        "ball": (x, y, inner, inner),
        "elevation": (x + inner + 1.6 * scale, y, scale, inner),
        "speed": (begin, y + 0.5 * inner, max(end - begin - 2 * gap, 1.0), 0.26 * inner),
        "shoot": (end, y + 0.16 * inner, button, 0.68 * inner),
    }
    return {name: pygame.Rect(*map(round, place)) for name, place in places.items()}


class Panel:
    """The controls of a frame.

    Attributes:
        places: The rectangle of each control, pixels, from `place_controls`.
    """

    def __init__(self, row: pygame.Rect, miscue_offset: float) -> None:
        """Prepares the drawing in a row of the frame. The cue slips at an offset of `miscue_offset` ball radii."""
        self.places, self._row = place_controls(row), row
        moved = {name: box.move(-row.x, -row.y) for name, box in self.places.items()}
        self._large = {name: pygame.Rect([ZOOM * side for side in box]) for name, box in moved.items()}
        self._face = _face(self._large["ball"].width // 2, miscue_offset)
        self._painted: tuple[object, pygame.Surface] = None, pygame.Surface(row.size)

    def at(self, pixel: tuple[int, int]) -> str | None:
        """Returns the name of the control at a pixel, or None."""
        return next((name for name, box in self.places.items() if box.inflate(2, 2).collidepoint(pixel)), None)

    def share(self, name: str, pixel: tuple[int, int]) -> tuple[float, float]:
        """Returns how far a pixel is from the left to the right and from the lower to the upper edge of a control."""
        box = self.places[name]
        return (pixel[0] - box.x) / box.width, 1 - (pixel[1] - box.y) / box.height

    def draw(self, frame: pygame.Surface, model: WindowModel) -> None:
        """Draws the controls for a model; controls that have no effect are faint."""
        key = model.phase, model.aim, model.kinds, model.max_speed
        if key != self._painted[0]:
            self._painted = key, self._paint(model)
        frame.blit(self._painted[1], self._row)

    def _paint(self, model: WindowModel) -> pygame.Surface:
        large = pygame.Surface((ZOOM * self._row.width, ZOOM * self._row.height), pygame.SRCALPHA, 32)
        large.fill((*pygame.Color(PAPER)[:3], 0))  # `smoothscale` darkens what is not transparent
        ball, elevation, speed, button = self._large.values()
        large.blit(self._face, ball)
        middle = ball.center - ball.width / 2 * pygame.Vector2(model.aim.tip)
        for colour, share in (("#274f7d", 0.19), ("#5a92cc", 0.15)):
            pygame.draw.circle(large, colour, middle, share * ball.width / 2)
        _draw_scale(large, elevation, model.aim.elevation / STEEPEST, LEVEL)
        fast = min(model.aim.speed / model.max_speed, 1.0)  # noise may make a stroke faster
        colour = pygame.Color(BUTTON).lerp(LEVEL, min(fast / 0.4, 1.0)).lerp(FAST, max((fast - 0.4) / 0.6, 0.0))
        _draw_scale(large, speed, fast, colour)
        if model.phase in labels.BUTTONS:
            pygame.draw.rect(large, BUTTON, button, border_radius=button.height // 5)
        if model.phase != "aiming":
            large.fill((255, 255, 255, 105), (0, 0, button.x, large.get_height()), pygame.BLEND_RGBA_MULT)
        height, x, width = large.get_height(), elevation.x + 2.7 * elevation.width, 3 * elevation.width
        texts = (
            ("cue", (x, elevation.y + 0.2 * elevation.height), SOFT, 0.17, width),
            (f"{model.aim.elevation:.0f}°", (x, elevation.y + 0.8 * elevation.height), INK, 0.17, width),
            (labels.aim_text(model), (speed.centerx, speed.y - 0.19 * height), SOFT, 0.17, speed.width),
            (labels.button(model), button.center, INK, 0.3, 0.86 * button.width),
            (labels.choice(model), (button.centerx, 0.9 * height), LEVEL, 0.2, button.width),
        )
        for text, place, ink, share, room in texts:
            write(large, text, round(max(9 * ZOOM, share * height)), ink, round(room), center=place)
        image = pygame.Surface(self._row.size)
        image.fill(PAPER)
        image.blit(pygame.transform.smoothscale(large, self._row.size), (0, 0))
        return image


def _draw_scale(surface: pygame.Surface, box: pygame.Rect, share: float, colour: pygame.Color | str) -> None:
    """Draws a scale that is filled up to a share of its longer side, from the left or from below, with a knob."""
    upright, radius = box.height > box.width, min(box.size) / 2
    filled = round(share * max(box.size))
    part = (box.x, box.bottom - filled, box.width, filled) if upright else (box.x, box.y, filled, box.height)
    for area, fill in ((box, GROOVE), (part, colour)):
        pygame.draw.rect(surface, fill, area, border_radius=round(radius))
    end = (box.centerx, box.bottom - filled) if upright else (box.x + filled, box.centery)
    for fill, width in ((PAPER, 1.49), (INK, 1.24)):
        pygame.draw.circle(surface, fill, end, width * radius)


def _face(radius: int, limit: float) -> pygame.Surface:
    """Returns the cue ball as seen along the cue, with a ring at the offset at which the cue slips."""
    image = pygame.Surface((2 * radius, 2 * radius), pygame.SRCALPHA, 32)
    for share in np.linspace(1.0, 0.0, 48, endpoint=False).tolist():
        light, middle = round(252 - 75 * share**3), radius - 0.3 * radius * (1 - share)
        pygame.draw.circle(image, (light, light, light - 6), (middle, middle), radius * share)
    ends = 0.08 * radius, 1.92 * radius
    for begin, end in (((ends[0], radius), (ends[1], radius)), ((radius, ends[0]), (radius, ends[1]))):
        pygame.draw.line(image, "#cfc9c0", begin, end, max(1, radius // 50))
    pygame.draw.circle(image, "#c0392b", (radius, radius), limit * radius, max(1, radius // 35))
    return image
