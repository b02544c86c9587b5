"""Text as an image.

A font aligns its letters with whole pixels, which makes the spaces between small letters uneven. The text is therefore
drawn larger and then reduced.
"""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import pygame

TEXT_ZOOM = 4
"""Enlargement of a text before it is reduced."""


@functools.lru_cache(maxsize=64)
def text_image(text: str, size: int, colour: str, width: int | None = None) -> pygame.Surface:
    """Returns a text as an image with a transparent background, not to be modified.

    Args:
        text: The text, one line.
        size: Height of the font, pixels.
        colour: Colour of the letters.
        width: Largest width of the image, pixels; a longer text becomes smaller. None for no limit.
    """
    pygame.font.init()  # another user of pygame may have closed its fonts
    large = pygame.font.Font(None, TEXT_ZOOM * size).render(text or " ", True, colour)
    zoom = max(TEXT_ZOOM, large.get_width() / width if width else 0)
    reduced = max(1, int(large.get_width() / zoom)), max(1, round(large.get_height() / zoom))
    return pygame.transform.smoothscale(large, reduced)


def write(
    surface: pygame.Surface, text: str, size: int, colour: str, width: int | None = None, **place: Any
) -> pygame.Rect:
    """Draws a text, see `text_image`, and returns its place, such as center=(x, y), an attribute of `pygame.Rect`."""
    image = text_image(text, size, colour, width)
    return surface.blit(
        image, image.get_rect(**{key: np.round(value).astype(int).tolist() for key, value in place.items()})
    )
