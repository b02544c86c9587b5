"""A picture of the table between two shots, drawn with pygame."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.error import DependencyNotInstalled
from numpy.typing import NDArray

from billiards_env.scene import Scene

try:
    import pygame
except ImportError as error:
    raise DependencyNotInstalled("pygame is not installed, run `pip install 'billiards-env[render]'`") from error

WIDTH = 800
"""Width of a frame, pixels."""

_EDGE, _LINE = 40, 30  # pixels: the frame around the cloth, the line of text below it
_WOOD, _CLOTH, _HOLE, _INK = (70, 45, 25), (30, 105, 85), (15, 15, 15), (240, 240, 240)
# Okabe and Ito's colours, which the colour-blind can tell apart; black for the eight, numbers tell the rest.
_BALLS = ((240, 228, 66), (0, 114, 178), (213, 94, 0), (204, 121, 167), (230, 159, 0), (0, 158, 115), (86, 180, 233))


def frame(scene: Scene, positions: NDArray[np.float64], lying: Sequence[int], caption: str) -> NDArray[np.uint8]:
    """Draws the table from above, to scale.

    Args:
        scene: The scene.
        positions: (n, 2) m.
        lying: The balls to draw.
        caption: A line of text below the table.

    Returns:
        (height, WIDTH, 3) uint8.
    """
    table = scene.table
    scale = (WIDTH - 2 * _EDGE) / table.length
    height = round(table.width * scale) + 2 * _EDGE
    surface = pygame.Surface((WIDTH, height + _LINE))

    def place(x: float, y: float) -> tuple[int, int]:
        return round(WIDTH / 2 + x * scale), round(height / 2 - y * scale)

    surface.fill(_HOLE)
    pygame.draw.rect(surface, _WOOD, (0, 0, WIDTH, height))
    left, top = place(-table.length / 2, table.width / 2)
    pygame.draw.rect(surface, _CLOTH, (left, top, round(table.length * scale), round(table.width * scale)))
    for pocket in table.pockets:
        pygame.draw.circle(surface, _HOLE, place(pocket.x, pocket.y), pocket.radius * scale)
    pygame.font.init()
    for ball in lying:
        at, radius = place(*positions[ball].tolist()), max(2.0, scene.balls.radius[ball] * scale)
        colour = _INK if ball == 0 else _HOLE if ball == 8 else _BALLS[(ball - 1) % 8]
        pygame.draw.circle(surface, _INK if ball > 8 else colour, at, radius)
        if ball > 8:  # a stripe
            pygame.draw.circle(surface, colour, at, 0.75 * radius)
        if ball > 0:
            text = pygame.font.Font(None, max(8, round(1.4 * radius))).render(
                str(ball), True, _INK if ball == 8 else _HOLE
            )
            surface.blit(text, text.get_rect(center=at))
    surface.blit(pygame.font.Font(None, 24).render(caption, True, _INK), (8, height + 7))
    return np.ascontiguousarray(pygame.surfarray.array3d(surface).transpose(1, 0, 2))


def show(window: Any, picture: NDArray[np.uint8], fps: int) -> Any:
    """Shows a picture in a window.

    Args:
        window: What the last call gave back, None for a new window.
        picture: (height, width, 3) uint8.
        fps: The most pictures a second; the call waits accordingly.

    Returns:
        The window, for the next call and for `close`.
    """
    if window is None:
        pygame.display.init()
        pygame.display.set_caption("Billiards")
        window = pygame.display.set_mode(picture.shape[1::-1]), pygame.time.Clock()
    screen, clock = window
    pygame.surfarray.blit_array(screen, picture.transpose(1, 0, 2))
    pygame.event.pump()
    pygame.display.flip()
    clock.tick(fps)
    return window


def close(window: Any) -> None:
    """Closes the window."""
    pygame.display.quit()
