"""Balls as shaded spheres whose marks turn with them, drawn with pygame.

The face of a ball is a map of its surface: an equal-area projection of each half. For each pixel of a ball the painter
turns the normal into the ball's own frame, looks up the colour and multiplies it by the light. Balls are painted twice
as large and then reduced, which smooths their edges and marks.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence

import numpy as np
import pygame
from numpy.typing import ArrayLike, NDArray

from billiards_env.drawing import style
from billiards_env.drawing.orientation import Floats, matrices

ZOOM, RING_ZOOM = 2, 8
"""Enlargement of a ball and of a ring before they are reduced."""


class Painter:
    """Paints balls of given looks and radii."""

    def __init__(self, looks: Sequence[style.Look], radius: ArrayLike) -> None:
        """Prepares the faces of balls; the radii are in pixels."""
        self._radius = np.array(radius, np.float32)
        self._side = 2 * int(np.ceil(self._radius.max() + 1))
        self._texels = int(np.clip(4 * self._radius.max(), 24, 512))
        kinds = {look: k for k, look in enumerate(dict.fromkeys(look._replace(path="") for look in looks))}
        self._kind = np.array([kinds[look._replace(path="")] for look in looks])
        maps = np.stack([face(look, self._texels) for look in kinds]).astype(np.float32)
        self._maps = [np.ascontiguousarray(maps[..., c].ravel()) for c in range(3)]
        self._painted: dict[int, tuple[bytes, pygame.Surface]] = {}

    def draw(
        self, surface: pygame.Surface, balls: Sequence[int], centres: Floats, faces: Floats, zooms: Floats
    ) -> None:
        """Draws balls at their centres (m, 2), pixels, with the orientations `faces` (m, 4), `zooms` times as large.

        A ball is painted again only if it has moved by a part of a pixel or has turned, or its size has changed.
        """
        corners = np.floor(centres)
        keys = np.column_stack((centres - corners, faces, zooms))
        stale = [k for k, ball in enumerate(balls) if self._painted.get(ball, (b"",))[0] != keys[k].tobytes()]
        if stale:
            images = self.paint(np.array(balls)[stale], keys[stale, :2], keys[stale, 2:6], keys[stale, 6])
            for k, image in zip(stale, images, strict=True):
                self._painted[balls[k]] = keys[k].tobytes(), image
        for ball, corner in zip(balls, corners.astype(int), strict=True):
            image = self._painted[ball][1]
            surface.blit(image, (corner - image.get_width() // 2).tolist())

    def paint(
        self, balls: NDArray[np.intp], fractions: Floats, faces: Floats, zooms: ArrayLike = 1.0
    ) -> list[pygame.Surface]:
        """Returns an image of each of m balls with the orientations `faces` (m, 4), `zooms` times as large.

        `fractions` (m, 2) are pixels from the middle of an image to the centre of its ball, to the right and down.
        """
        m, largest = len(balls), float(np.max(zooms))
        r = self._radius[balls] * np.asarray(zooms, np.float32)
        side = self._side + 2 * math.ceil((largest - 1.0) * self._side / 2)
        pixels = (np.arange(ZOOM * side, dtype=np.float32) + 0.5) / ZOOM - side / 2
        offset = fractions.astype(np.float32)
        x = (pixels - offset[:, :1]) / r[:, None]
        y = -(pixels - offset[:, 1:]) / r[:, None]
        x, y = np.broadcast_arrays(x[:, None, :], y[:, :, None])
        square = x * x + y * y
        far = np.sqrt(square)
        edge = np.clip((1.0 - far) * (ZOOM * r[:, None, None]) + 0.5, 0.0, 1.0)
        inside = np.minimum(1.0, 0.999 / np.maximum(far, 1e-6))  # pixels outside have the colour of the edge
        x, y = x * inside, y * inside
        z = np.sqrt(np.maximum(1.0 - square, 0.002))
        normal = np.stack((x, y, z), 1).reshape(m, 3, -1)
        own = matrices(faces).astype(np.float32).transpose(0, 2, 1) @ normal
        texels = self._texels
        scale = (0.5 * texels - 0.51) / np.sqrt(1.0 + np.abs(own[:, 2]))
        column = (own[:, 0] * scale + 0.5 * texels).astype(np.int32)
        row = (0.5 * texels - own[:, 1] * scale).astype(np.int32)
        half = 2 * self._kind[balls].astype(np.int32)[:, None] + (own[:, 2] < 0.0)
        index = (half * texels + row) * texels + column
        light, shine = (np.einsum("i,mip->mp", np.array(v, np.float32), normal) for v in (style.LIGHT, style.SHINE))
        light = np.clip(style.AMBIENT + style.DIFFUSE * light, style.DARKEST, 1.0)
        shine = 255 * style.SHINE_LIGHT * np.maximum(shine, 0.0) ** style.SHINE_POWER
        image = np.empty((m * ZOOM * side, ZOOM * side, 4), np.uint8)
        flat = image.reshape(m, -1, 4)
        for c, colours in enumerate(self._maps):
            flat[..., c] = np.minimum(colours[index] * light + shine, 255.0)
        flat[..., 3] = (255 * edge).reshape(m, -1)
        large = pygame.image.frombuffer(image.data, (ZOOM * side, m * ZOOM * side), "RGBA")
        strip = pygame.transform.smoothscale(large, (side, m * side))
        return [strip.subsurface((0, k * side, side, side)) for k in range(m)]


def face(look: style.Look, texels: int) -> Floats:
    """Returns the map of a ball's surface, (2, texels, texels, 3) RGB from 0 to 255: the upper and the lower half."""
    places = (np.arange(texels) + 0.5) / texels * 2.0 - 1.0
    u, v = np.meshgrid(places, -places)
    square = np.minimum(u * u + v * v, 1.0)
    stretch = np.sqrt(2.0 - square)
    x, y, z = u * stretch, v * stretch, 1.0 - square
    fill, chalk = np.array(pygame.Color(look.fill))[:3], np.array(pygame.Color(style.CHALK))[:3]
    halves = np.empty((2, texels, texels, 3))
    for half, sign in zip(halves, (1.0, -1.0), strict=True):

        def mix(share: Floats, colour: NDArray[np.int_], out: Floats = half) -> None:
            share = np.clip(share * texels / 2.8 + 0.5, 0.0, 1.0)[..., None]
            out += share * (colour - out)

        half[:] = chalk if look.striped else fill
        if look.striped:
            mix(style.STRIPE - abs(y), fill)
        if not look.dots:
            mix(style.DISC - np.hypot(x, y), chalk)
            ink = _number(look.number, sign * x, y, texels)[..., None]
            half += ink * (np.array(pygame.Color(style.INK))[:3] - half)
        else:
            for dot in style.DOTS:
                cosine = np.clip(dot[0] * x + dot[1] * y + sign * dot[2] * z, -1.0, 1.0)
                mix(look.dot - np.arccos(cosine), np.array(pygame.Color(look.dots))[:3])
    return halves


def _number(text: str, x: Floats, y: Floats, texels: int) -> Floats:
    """Returns the opacity of a number at points of the unit disc."""
    pygame.font.init()
    size = 4 * texels
    large = pygame.font.Font(None, size).render(text, True, "white")
    box = large.get_bounding_rect()
    width = 2 * style.DISC * (0.52 if len(text) == 1 else 0.78)
    height = min(2 * style.DISC * 0.68, width * box.height / box.width)
    width = height * box.width / box.height
    small = max(1, round(width * texels / 2.0)), max(1, round(height * texels / 2.0))
    alpha = pygame.surfarray.array_alpha(pygame.transform.smoothscale(large.subsurface(box), small)).T / 255.0
    column = np.floor((x / width + 0.5) * small[0]).astype(int)
    row = np.floor((0.5 - y / height) * small[1]).astype(int)
    inside = (column >= 0) & (column < small[0]) & (row >= 0) & (row < small[1])
    return np.where(inside, alpha[np.clip(row, 0, small[1] - 1), np.clip(column, 0, small[0] - 1)], 0.0)


@functools.lru_cache(maxsize=2048)
def ring(radius: float, colour: str, dx: float, dy: float) -> pygame.Surface:
    """Returns a ring whose centre is (dx, dy) pixels from the middle of the image; radius in pixels."""
    side, z = 2 * math.ceil(radius + 2), RING_ZOOM
    # The transparent background has the colour of the ring, because the reduction mixes them.
    large = pygame.Surface((z * side, z * side), pygame.SRCALPHA, 32)
    large.fill((*pygame.Color(colour)[:3], 0))
    centre = z * (side / 2 + dx), z * (side / 2 + dy)
    pygame.draw.circle(large, colour, centre, z * radius, round(max(1.6 * z, 0.16 * z * radius)))
    return pygame.transform.smoothscale(large, (side, side))


@functools.lru_cache(maxsize=2048)
def shadow(radius: float, dx: float, dy: float, wide: float = 1.0) -> pygame.Surface:
    """Returns the shadow of a ball whose centre is (dx, dy) pixels from the middle of the image; radius in pixels.

    The shadow is `wide` times as wide as that of a ball on the cloth, and fainter.
    """
    side = 2 * int(np.ceil((0.4 + 1.3 * wide) * radius + 1))
    pixels = np.arange(side) + 0.5 - side / 2
    far = np.hypot((pixels[:, None] - dx) / radius - style.SHADOW[0], (pixels[None, :] - dy) / radius + style.SHADOW[1])
    far /= wide
    share = np.clip((style.SHADOW_REACH[1] - far) / (style.SHADOW_REACH[1] - style.SHADOW_REACH[0]), 0.0, 1.0)
    image = pygame.Surface((side, side), pygame.SRCALPHA, 32)
    dark = style.SHADOW_DARK / (wide * wide)
    pygame.surfarray.pixels_alpha(image)[:] = 255 * dark * share * share * (3.0 - 2.0 * share)
    return image
