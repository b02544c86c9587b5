"""The empty table as an image: wood, cloth and shadows on the shapes of `style.draw_table`."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pygame
from numpy.typing import NDArray

from billiards_env.drawing.style import (
    CLOTH,
    CUSHION,
    CUSHION_EDGE,
    MARKING,
    MOUTH,
    POCKET,
    POCKET_RIM,
    RAIL,
    RAIL_EDGE,
    draw_table,
    rail_width,
)
from billiards_env.table import Table

Images = NDArray[np.float32]

ZOOM = 3
"""Enlargement of the shapes before they are reduced."""

GRAIN, WEAVE, GLOW, NOSE, SHADE = 0.16, 0.03, 0.02, 0.7, 0.42
"""Relative brightness: the amplitudes of the grain of the wood, of the threads of the cloth, of the lamp above its
middle and of the noses of the cushions, and the darkness of the shadow next to the cushions."""

# The materials of the shapes, as the channels of a colour: cloth, wood, and pockets.
_MATERIALS = {
    CLOTH: (255, 0, 0),
    MARKING: (255, 0, 0),
    RAIL: (0, 255, 0),
    RAIL_EDGE: (0, 255, 0),
    POCKET: (0, 0, 255),
    POCKET_RIM: (0, 0, 160),
    MOUTH: (160, 0, 95),
    CUSHION: (0, 0, 0),
    CUSHION_EDGE: (0, 0, 0),
}


def paint_table(
    table: Table,
    size: tuple[int, int],
    pixels_of: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    paper: str,
) -> pygame.Surface:
    """Returns an image of a table.

    Args:
        table: The table.
        size: Width and height of the image, pixels.
        pixels_of: A function from points (m, 2), m, to pixels (m, 2).
        paper: The colour around the table.
    """
    flat, parts = (pygame.Surface((ZOOM * size[0], ZOOM * size[1]), 0, 32) for _ in range(2))
    flat.fill(paper)
    for corners, colour in draw_table(table):
        points = (ZOOM * pixels_of(corners)).tolist()
        pygame.draw.polygon(flat, colour, points)
        pygame.draw.polygon(parts, _MATERIALS.get(colour, (0, 255, 0)), points)
    image, shares = _reduced(flat), _reduced(parts) / 255
    cloth, wood, pockets = np.moveaxis(shares, -1, 0)

    (left, bottom), (right, top) = pixels_of(np.array([[-0.5, -0.5], [0.5, 0.5]]) * [table.length, table.width])
    rail = rail_width(table) * (right - left) / table.length
    x, y = np.arange(size[0], dtype=np.float32)[:, None] + 0.5, np.arange(size[1], dtype=np.float32)[None, :] + 0.5
    rng = np.random.default_rng(1)
    across = np.maximum(left - x, x - right), np.maximum(top - y, y - bottom)
    depth = np.maximum(*across) / rail  # 0 at the cushions, 1 at the outer edge of the rail

    upright = across[0] > across[1]
    grain = np.where(upright, _streaks(rng, size[1], size[0]).T, _streaks(rng, size[0], size[1]))
    bevel = 0.16 * np.exp(-(((depth - 0.72) / 0.16) ** 2)) - 0.25 * np.clip((depth - 0.85) / 0.15, 0.0, 1.0)
    # The lamp is at the upper left: the rails on the far side reflect more.
    side = np.where(upright, np.where(x < left, 0.03, -0.05), np.where(y < top, 0.06, -0.03))
    image *= (1.0 + wood * (GRAIN * grain + bevel + side))[..., None]

    middle, half = ((left + right) / 2, (top + bottom) / 2), ((right - left) / 2, (bottom - top) / 2)
    far = ((x - middle[0]) / half[0]) ** 2 + ((y - middle[1]) / half[1]) ** 2
    light = 1.0 + GLOW * (0.6 - np.minimum(far, 2.0)) + WEAVE * (2.0 * rng.random(size, np.float32) - 1.0)
    scale = (right - left) / table.length
    rubber = np.where(depth < 1.0, 1.0 - cloth - wood - pockets, 0.0)
    image *= (1.0 + rubber * (NOSE * _blurred(cloth, 0.006 * scale) - 0.1))[..., None]
    wall = _shifted(_blurred(1.0 - cloth - 0.6 * pockets, 0.008 * scale), 0.006 * scale)
    image *= (1.0 + cloth * (light * (1.0 - SHADE * np.clip(wall, 0.0, 1.0)) - 1.0))[..., None]
    hole = _blurred(pockets, 0.012 * scale)
    image *= (1.0 - 0.4 * (cloth * np.clip(2.0 * hole - 0.1, 0.0, 1.0)))[..., None]
    image += (pockets * 26.0 * np.clip(1.0 - _blurred(pockets, 0.01 * scale) - 0.1, 0.0, 1.0))[..., None]
    surface = pygame.Surface(size, 0, 32)
    pygame.surfarray.blit_array(surface, np.clip(image + 0.5, 0.0, 255.0).astype(np.uint8))
    return surface


def _reduced(surface: pygame.Surface) -> Images:
    """Returns the mean colours of squares of `ZOOM` pixels, (width, height, 3) from 0 to 255."""
    large = pygame.surfarray.array3d(surface)
    parts = [large[i::ZOOM, j::ZOOM].astype(np.float32) for i in range(ZOOM) for j in range(ZOOM)]
    return np.add.reduce(parts, dtype=np.float32) / np.float32(ZOOM**2)


def _streaks(rng: np.random.Generator, length: int, lines: int) -> Images:
    """Returns wood grain along the first axis, (length, lines) of a size of about 1."""
    total: Images = np.zeros((length, lines), np.float32)
    for knots, share in ((3, 0.55), (14, 0.35), (60, 0.2)):
        fine = rng.standard_normal((knots + 2, lines), np.float32)
        if share > 0.3:  # broad bands and narrow lines
            fine = _blurred(fine, 1.0 if share < 0.5 else 2.2, axes=(1,)) * (2.0 if share < 0.5 else 3.0)
        at = np.linspace(0.0, knots, length, dtype=np.float32)
        low = at.astype(int)
        part = (at - low)[:, None]
        total += share * ((1.0 - part) * fine[low] + part * fine[low + 1])
    return np.clip(total, -2.0, 2.0).astype(np.float32)


def _blurred(image: Images, sigma: float, axes: tuple[int, ...] = (0, 1)) -> Images:
    """Returns an image after three box filters, which are almost a Gaussian filter of `sigma` pixels."""
    reach = max(1, round(sigma * 2.0**0.5 - 0.5)) if sigma > 0.5 else 0
    for axis in axes if reach else ():
        for _ in range(3):
            padded = np.concatenate(
                [np.take(image, [0] * (reach + 1), axis), image, np.take(image, [-1] * reach, axis)], axis
            )
            total = np.cumsum(padded, axis, dtype=np.float64)
            n = image.shape[axis]
            high, low = (np.take(total, range(k, k + n), axis) for k in (2 * reach + 1, 0))
            image = ((high - low) / (2 * reach + 1)).astype(np.float32)
    return image


def _shifted(image: Images, pixels: float) -> Images:
    """Returns an image that is shifted to the right and down."""
    k = round(pixels)
    return np.pad(image, ((k, 0), (k, 0)), mode="edge")[: image.shape[0], : image.shape[1]]
