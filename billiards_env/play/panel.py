"""Draws the row of controls with pygame."""

from __future__ import annotations

import functools
import math

import pygame

from billiards_env.drawing.text import text_image
from billiards_env.play import labels
from billiards_env.play.controls import STEEPEST, Box, Controls
from billiards_env.play.model import WindowModel

PAPER, INK, SOFT = "#14181a", "#eceae2", "#9aa3a0"
"""Colours of the window around the table, of its texts and of the hints."""

GROOVE, LEVEL, BUTTON, FAST = "#0a0c0d", "#d9a441", "#2f8163", "#c8452f"
"""Colours of the controls: an empty scale, a filled scale, the button and the start of the speeds, and their end."""

ZOOM = 3
"""Enlargement of the controls before they are reduced."""


class Panel:
    """Draws the controls at their places."""

    def __init__(self, controls: Controls, row: tuple[float, float, float, float]) -> None:
        """Prepares the drawing in a row: its left and upper edge, its width and its height, pixels."""
        self._places, self._row = controls, Box(*row)
        self._size = round(self._row.width), round(self._row.height)
        self._key: object = None
        self._image = pygame.Surface(self._size)

    def draw(self, frame: pygame.Surface, model: WindowModel) -> None:
        """Draws the controls for a model; controls that have no effect are faint."""
        key = model.phase, model.aim, model.kinds, model.max_speed
        if key != self._key:
            self._key, self._image = key, self._paint(model)
        frame.blit(self._image, (round(self._row.x), round(self._row.y)))

    def _paint(self, model: WindowModel) -> pygame.Surface:
        places, row = self._places, self._row
        large = pygame.Surface((ZOOM * self._size[0], ZOOM * self._size[1]), pygame.SRCALPHA, 32)
        large.fill((*pygame.Color(PAPER)[:3], 0))
        ball, elevation, speed, button = (self._zoomed(box) for box in places)
        radius = ball.width / 2
        large.blit(_face(round(radius), model.setup.scene.cue.miscue_offset), ball)
        (side, top), height = model.aim.tip, model.aim.elevation
        tip = ball.centerx - side * radius, ball.centery - top * radius
        pygame.draw.circle(large, "#274f7d", tip, 0.19 * radius)
        pygame.draw.circle(large, "#5a92cc", tip, 0.15 * radius)

        pygame.draw.rect(large, GROOVE, elevation, border_radius=elevation.width // 2)
        filled = elevation.height * height / STEEPEST
        bar = pygame.Rect(elevation.x, round(elevation.bottom - filled), elevation.width, round(filled))
        pygame.draw.rect(large, LEVEL, bar, border_radius=elevation.width // 2)
        _draw_knob(large, elevation.centerx, elevation.bottom - filled, 0.62 * elevation.width)

        pygame.draw.rect(large, GROOVE, speed, border_radius=speed.height // 2)
        filled = speed.width * model.aim.speed / model.max_speed
        large.blit(_speeds(speed.size), speed, (0, 0, round(filled), speed.height))
        _draw_knob(large, speed.x + filled, speed.centery, 0.62 * speed.height)

        if model.phase in labels.BUTTONS:
            pygame.draw.rect(large, BUTTON, button, border_radius=button.height // 5)
        image = pygame.Surface(self._size, 0, 32)
        image.fill(PAPER)
        image.blit(pygame.transform.smoothscale(large, self._size), (0, 0))
        if model.phase != "aiming":
            veil = pygame.Surface((round(places.shoot.x - row.x), self._size[1]))
            veil.fill(PAPER)
            veil.set_alpha(150)
            image.blit(veil, (0, 0))

        def write(text: str, x: float, y: float, colour: str, height: float, room: float) -> None:
            drawn = text_image(text, max(9, round(height * row.height)), colour, max(1, round(room)))
            image.blit(drawn, drawn.get_rect(center=(round(x - row.x), round(y - row.y))))

        box, x = places.elevation, places.elevation.x + 2.7 * places.elevation.width
        write("cue", x, box.y + 0.2 * box.height, SOFT, 0.17, 3 * box.width)
        write(f"{height:.0f}\u00b0", x, box.y + 0.8 * box.height, INK, 0.17, 3 * box.width)
        box = places.speed
        write(labels.aim_text(model), box.x + box.width / 2, box.y - 0.19 * row.height, SOFT, 0.17, box.width)
        box = places.shoot
        middle = box.x + box.width / 2, box.y + box.height / 2
        write(labels.button(model), *middle, INK, 0.3, 0.86 * box.width)
        write(labels.choice(model), middle[0], row.y + 0.9 * row.height, LEVEL, 0.2, box.width)
        return image

    def _zoomed(self, box: Box) -> pygame.Rect:
        x, y = box.x - self._row.x, box.y - self._row.y
        return pygame.Rect([round(ZOOM * value) for value in (x, y, box.width, box.height)])


def _draw_knob(surface: pygame.Surface, x: float, y: float, radius: float) -> None:
    pygame.draw.circle(surface, PAPER, (x, y), 1.2 * radius)
    pygame.draw.circle(surface, INK, (x, y), radius)


@functools.lru_cache(maxsize=4)
def _speeds(size: tuple[int, int]) -> pygame.Surface:
    """Returns the filled scale of the speeds, from green to red, with round ends."""
    image = pygame.Surface(size, pygame.SRCALPHA, 32)
    pygame.draw.rect(image, "white", image.get_rect(), border_radius=size[1] // 2)
    colours = pygame.Surface(size, pygame.SRCALPHA, 32)
    for x in range(size[0]):
        share = x / size[0]
        slow, fast, part = (BUTTON, LEVEL, share / 0.4) if share < 0.4 else (LEVEL, FAST, (share - 0.4) / 0.6)
        pygame.draw.line(colours, pygame.Color(slow).lerp(fast, part), (x, 0), (x, size[1]))
    image.blit(colours, (0, 0), special_flags=pygame.BLEND_RGBA_MULT)
    return image


@functools.lru_cache(maxsize=4)
def _face(radius: int, limit: float) -> pygame.Surface:
    """Returns the cue ball as seen along the cue, with a ring at the offset at which the cue slips."""
    image = pygame.Surface((2 * radius, 2 * radius), pygame.SRCALPHA, 32)
    steps = 48
    for k in range(steps):
        share = 1 - k / steps
        light = round(252 - 75 * share**3)
        away = 0.3 * radius * (1 - share)
        pygame.draw.circle(image, (light, light, light - 6), (radius - away, radius - away), radius * share)
    for turn in (0.0, math.pi / 2):
        way = 0.92 * radius * math.cos(turn), 0.92 * radius * math.sin(turn)
        begin, end = ((radius + s * way[0], radius + s * way[1]) for s in (-1, 1))
        pygame.draw.line(image, "#cfc9c0", begin, end, max(1, radius // 50))
    pygame.draw.circle(image, "#c0392b", (radius, radius), limit * radius, max(1, radius // 35))
    return image
