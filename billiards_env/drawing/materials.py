"""The empty table as an image: wood, cloth and shadows on the shapes of `style.draw_table`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pygame
from numpy.typing import NDArray

from billiards_env.drawing import style
from billiards_env.scene.table import Table

Images = NDArray[np.floating[Any]]

ZOOM = 3
"""Enlargement of the shapes before they are reduced."""

GRAIN, WEAVE, GLOW, NOSE, SHADE = 0.16, 0.03, 0.02, 0.7, 0.42
"""Relative brightness: the amplitudes of the grain of the wood, of the threads of the cloth, of the lamp above its
middle and of the noses of the cushions, and the darkness of the shadow next to the cushions."""

# The materials of the shapes, as the channels of a colour: cloth, wood, and pockets.
_MATERIALS = {
    style.CLOTH: (255, 0, 0),
    style.MARKING: (255, 0, 0),
    style.RAIL: (0, 255, 0),
    style.RAIL_EDGE: (0, 255, 0),
    style.POCKET: (0, 0, 255),
    style.POCKET_RIM: (0, 0, 160),
    style.MOUTH: (160, 0, 95),
    style.CUSHION: (0, 0, 0),
    style.CUSHION_EDGE: (0, 0, 0),
}
_AROUND = (0, 255, 255)


def paint_table(
    table: Table, size: tuple[int, int], pixels_of: Callable[[NDArray[np.float64]], NDArray[np.float64]], paper: str
) -> pygame.Surface:
    """Returns an image of a table on paper of a colour; `pixels_of` converts points (m, 2), m, to pixels (m, 2)."""
    flat, parts = (pygame.Surface((ZOOM * size[0], ZOOM * size[1]), 0, 32) for _ in range(2))
    flat.fill(paper)
    parts.fill(_AROUND)
    for corners, colour in style.draw_table(table):
        points = (ZOOM * pixels_of(corners)).tolist()
        pygame.draw.polygon(flat, colour, points)
        pygame.draw.polygon(parts, _MATERIALS.get(colour, (0, 255, 0)), points)
    flat, parts = (pygame.transform.smoothscale(one, size) for one in (flat, parts))
    cloth, wood, pockets = np.moveaxis(_shares(parts), -1, 0)

    half = np.array([table.length, table.width]) / 2
    (left, bottom), (right, top) = pixels_of(np.array([-half, half])).tolist()
    scale = (right - left) / table.length
    x, y = np.arange(size[0], dtype=np.float32)[:, None] + 0.5, np.arange(size[1], dtype=np.float32)[None, :] + 0.5
    rng = np.random.default_rng(1)
    across = np.maximum(left - x, x - right), np.maximum(top - y, y - bottom)
    depth = np.maximum(*across) / (style.rail_width(table) * scale)  # 0 at the cushions, 1 at the edge of the rail

    upright = across[0] > across[1]
    grain = np.where(upright, _streaks(rng, size[1], size[0]).T, _streaks(rng, size[0], size[1]))
    bevel = 0.16 * np.exp(-(((depth - 0.72) / 0.16) ** 2)) - 0.25 * np.clip((depth - 0.85) / 0.15, 0.0, 1.0)
    # The lamp is at the upper left: the rails on the far side reflect more.
    side = np.where(upright, np.where(x < left, 0.03, -0.05), np.where(y < top, 0.06, -0.03))
    light = 1.0 + wood * (GRAIN * grain + bevel + side)

    soft = np.moveaxis(_blurred(parts, 0.022 * scale), -1, 0)
    rubber = np.maximum(1.0 - cloth - wood - pockets, 0.0)
    light += rubber * (NOSE * soft[0] - 0.1)
    far = (x - (left + right) / 2) ** 2 / (right - left) ** 2 + (y - (top + bottom) / 2) ** 2 / (bottom - top) ** 2
    felt = 1.0 + GLOW * (0.6 - np.minimum(4.0 * far, 2.0)) + WEAVE * (2.0 * rng.random(size, np.float32) - 1.0)
    wall = np.clip(1.0 - _shifted(soft[0] + 0.6 * soft[2], 0.006 * scale), 0.0, 1.0)
    hole = np.clip(2.0 * soft[2] - 0.1, 0.0, 1.0)
    light += cloth * (felt * (1.0 - SHADE * wall) * (1.0 - 0.4 * hole) - 1.0)
    image = pygame.surfarray.array3d(flat) * light[..., None]
    image += (pockets * 26.0 * np.clip(0.9 - soft[2], 0.0, 1.0))[..., None]
    image[(wood > 0.5) & (pockets > 0.5)] = tuple(pygame.Color(paper))[:3]
    surface = pygame.Surface(size, 0, 32)
    pygame.surfarray.blit_array(surface, np.clip(image + 0.5, 0.0, 255.0).astype(np.uint8))
    return surface


def _shares(parts: pygame.Surface) -> Images:
    """Returns the colours of a surface, (width, height, 3) from 0 to 1."""
    return pygame.surfarray.array3d(parts).astype(np.float32) / np.float32(255)


def _blurred(parts: pygame.Surface, pixels: float) -> Images:
    """Returns the colours of a surface, blurred over a number of pixels, (width, height, 3) from 0 to 1."""
    size = parts.get_size()
    small = [max(2, round(side / max(1.0, pixels / 2))) for side in size]
    return _shares(pygame.transform.smoothscale(pygame.transform.smoothscale(parts, small), size))


def _streaks(rng: np.random.Generator, length: int, lines: int) -> Images:
    """Returns wood grain along the first axis, (length, lines) of a size of about 1."""
    total: Images = np.zeros((length, lines), np.float32)
    for knots, share, wide in ((3, 0.55, 9), (14, 0.35, 3), (60, 0.2, 1)):  # broad bands and narrow lines
        fine = rng.standard_normal((knots + 2, lines + wide - 1), np.float32)
        fine = np.add.reduce([fine[:, k : lines + k] for k in range(wide)]) / wide**0.5
        at = np.linspace(0.0, knots, length, dtype=np.float32)
        low = at.astype(int)
        part = (at - low)[:, None]
        total += share * ((1.0 - part) * fine[low] + part * fine[low + 1])
    return np.clip(total, -2.0, 2.0).astype(np.float32)


def _shifted(image: Images, pixels: float) -> Images:
    """Returns an image that is shifted to the right and down."""
    k = round(pixels)
    return np.pad(image, ((k, 0), (k, 0)), mode="edge")[: image.shape[0], : image.shape[1]]
