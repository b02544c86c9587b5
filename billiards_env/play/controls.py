"""The controls under the table: the face of the cue ball, the elevation of the cue, the speed and the button to shoot.

They are plain rectangles in pixels from the upper left corner of the frame, without pygame.
"""

from __future__ import annotations

import math
from typing import NamedTuple

Pixel = tuple[float, float]

STEEPEST = 90.0
"""degrees. The elevation of the cue at the end of its scale."""

LEAST_HEIGHT, MOST_HEIGHT = 36, 220
"""Pixels. Limits of the height of the row of controls."""


class Box(NamedTuple):
    """A rectangle: its left and upper edge, its width and its height, pixels."""

    x: float
    y: float
    width: float
    height: float

    def holds(self, pixel: Pixel) -> bool:
        """Returns whether a pixel is in the rectangle."""
        return 0 <= pixel[0] - self.x <= self.width and 0 <= pixel[1] - self.y <= self.height

    def share(self, pixel: Pixel) -> tuple[float, float]:
        """Returns how far a pixel is from the left to the right and from the lower to the upper edge, each 0 to 1."""
        across, up = (pixel[0] - self.x) / self.width, 1 - (pixel[1] - self.y) / self.height
        return min(max(across, 0.0), 1.0), min(max(up, 0.0), 1.0)


class Controls(NamedTuple):
    """The places of the controls.

    Attributes:
        ball: The square around the face of the cue ball.
        elevation: The vertical scale of the elevation.
        speed: The horizontal scale of the speed.
        shoot: The button.
    """

    ball: Box
    elevation: Box
    speed: Box
    shoot: Box

    def at(self, pixel: Pixel) -> str | None:
        """Returns the name of the control at a pixel, or None."""
        return next((name for name, box in self._asdict().items() if box.holds(pixel)), None)

    def tip(self, pixel: Pixel) -> tuple[float, float]:
        """Returns the offset of the cue's tip at a pixel of the cue ball's face, to the left and up, in ball radii."""
        half = self.ball.width / 2
        return (self.ball.x + half - pixel[0]) / half, (self.ball.y + half - pixel[1]) / half


def height_of(size: tuple[int, int]) -> int:
    """Returns the height of the row of controls in a frame of `size`, pixels."""
    return round(min(max(min(size[0] / 10, size[1] / 5), LEAST_HEIGHT), MOST_HEIGHT))


def place_controls(left: float, top: float, width: float, height: float) -> Controls:
    """Returns the places of the controls in a row, pixels."""
    gap, inner = 0.1 * height, 0.8 * height
    x, y = left + gap, top + gap
    scale = max(0.16 * height, 8.0)
    button = min(1.6 * height, 0.22 * width)
    begin = x + inner + 5.5 * scale
    end = left + width - gap - button
    return Controls(
        Box(x, y, inner, inner),
        Box(x + inner + 1.6 * scale, y, scale, inner),
        Box(begin, y + 0.5 * inner, max(end - begin - 2 * gap, 1.0), 0.26 * inner),
        Box(end, y + 0.16 * inner, button, 0.68 * inner),
    )


def on_face(side: float, top: float, largest: float) -> tuple[float, float]:
    """Returns the offset of the cue's tip, limited to a length of `largest` ball radii."""
    far = math.hypot(side, top)
    return (side, top) if far <= largest else (side * largest / far, top * largest / far)
