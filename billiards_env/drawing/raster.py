"""Small images of many tables for learning, drawn by compiled code without a graphics library.

An image shows the table with its rails from above, stretched to the size of the image. Row 0 is the side of the largest
y. The empty table is drawn once. A ball covers the share of a pixel that its ellipse covers, which is exact along x and
a mean of `LINES` lines along y, so a ball that moves by a fraction of a pixel changes the image.
"""

from __future__ import annotations

import functools
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from billiards_env.drawing.style import MARKING, RAIL_EDGE, draw_table, looks, rail_width
from billiards_env.envs.observations import Feature, Source
from billiards_env.jit import entry_point
from billiards_env.physics.state import X, Y
from billiards_env.scene import Scene
from billiards_env.scene.table import Table

Bytes = NDArray[np.uint8]

LINES = 4
"""Number of lines in a row of pixels."""

CLASSES = ("the cue ball", "the balls to play", "the other balls", "the goal")
"""The planes of `class_colours`, in order. The last one needs a goal."""


def rgb(colour: str) -> tuple[int, ...]:
    """Returns the red, green and blue of a colour such as "#1c6049"."""
    return tuple(bytes.fromhex(colour[1:]))


def half_sides(table: Table) -> tuple[float, float]:
    """Returns half the length and half the width of what an image shows, m."""
    rail = rail_width(table)
    return table.length / 2 + rail, table.width / 2 + rail


def ball_colours(scene: Scene) -> Bytes:
    """Returns the colours (n + 1, 2, 3) of the balls and of the goal, the same for both kinds."""
    return np.array([[rgb(colour)] * 2 for colour in (*(look.fill for look in looks(scene)), MARKING)], np.uint8)


def class_colours(targets: NDArray[np.bool_], goals: int) -> Bytes:
    """Returns the values (n + 1, 2, c) of balls and of the goal in planes: 255 in that of their class, see `CLASSES`.

    Args:
        targets: (n,) bool, the balls that count in the task. They are to play if their kind is True.
        goals: The number of goals, 0 or 1. Without one there is no plane for it.
    """
    planes = 255 * np.eye(3 + goals, dtype=np.uint8)
    balls = [(planes[2], planes[1 if target else 2]) for target in targets[1:]]
    return np.array([(planes[0], planes[0]), *balls, (planes[-1], planes[-1])])


@functools.lru_cache(maxsize=16)
def empty_table(table: Table, height: int, width: int) -> Bytes:
    """Returns the image (height, width, 3) of a table without balls, with `LINES` by `LINES` points in a pixel."""
    half_x, half_y = half_sides(table)
    xs = half_x * (2 * (np.arange(width * LINES) + 0.5) / (width * LINES) - 1)
    ys = half_y * (1 - 2 * (np.arange(height * LINES) + 0.5) / (height * LINES))
    image = np.tile(np.array(rgb(RAIL_EDGE), np.float32), (len(ys), len(xs), 1))
    for corners, colour in draw_table(table):
        starts, ends = corners, np.roll(corners, -1, axis=0)
        for row, y in enumerate(ys):
            crossed = (starts[:, Y] > y) != (ends[:, Y] > y)
            (x0, y0), (x1, y1) = starts[crossed].T, ends[crossed].T
            edges = np.sort(x0 + (y - y0) * (x1 - x0) / (y1 - y0))
            image[row, np.searchsorted(edges, xs) % 2 == 1] = rgb(colour)
    image = image.reshape(height, LINES, width, LINES, 3).mean((1, 3))
    return np.rint(image).astype(np.uint8)


@entry_point
def paint_discs(begin, end, images, half_sides, discs):  # out: images
    """Paints discs on the images `begin` to `end` - 1.

    Args:
        begin: First image.
        end: Last image plus 1.
        images: (m, height, width, c) uint8, which change.
        half_sides: As from the function of this name.
        discs: The radii (d,), m; the centres (m, d, 2), m; which discs are shown, (m, d) bool; which of its two colours
            each disc has, (m, d) bool; and these colours, (d, 2, c) uint8.
    """
    radii, centres, shown, kinds, colours = discs
    height, width = images.shape[1], images.shape[2]
    scale_x, scale_y = 0.5 * width / half_sides[X], 0.5 * height / half_sides[Y]  # pixels per metre
    for k in range(begin, end):
        for i in range(centres.shape[1]):
            if not shown[k, i]:
                continue
            colour = colours[i, 1 if kinds[k, i] else 0]
            x, y = (half_sides[X] + centres[k, i, X]) * scale_x, (half_sides[Y] - centres[k, i, Y]) * scale_y
            a, b = radii[i] * scale_x, radii[i] * scale_y
            for row in range(max(math.floor(y - b), 0), min(math.ceil(y + b), height)):
                for column in range(max(math.floor(x - a), 0), min(math.ceil(x + a), width)):
                    share = 0.0
                    for line in range(LINES):
                        t = (row + (line + 0.5) / LINES - y) / b
                        half = a * math.sqrt(max(1.0 - t * t, 0.0))
                        share += max(min(column + 1.0, x + half) - max(float(column), x - half), 0.0) / LINES
                    for c in range(images.shape[3]):
                        below = float(images[k, row, column, c])
                        images[k, row, column, c] = int(below + share * (float(colour[c]) - below) + 0.5)


def write_image(begin, end, images, background, layers):
    """Writes images (m, height, width, c): the background, and layers of discs, each a kernel and its arguments."""
    images[begin:end] = background
    for paint, arguments in layers:
        paint(begin, end, images, *arguments)


def read_image(source: Source, height: int, width: int, planes: bool) -> tuple[Any, ...]:
    """Returns the background and the layers of images in colours or in planes."""
    scene, arrays, numbers = source.scene, source.arrays, source.numbers
    goals, half = arrays.goals.shape[1], half_sides(scene.table)
    colours = class_colours(numbers.targets, goals) if planes else ball_colours(scene)
    empty = np.zeros((height, width, colours.shape[2]), np.uint8)
    background = empty if planes else empty_table(scene.table, height, width)
    kinds = arrays.legal_balls if arrays.legal_balls.size else arrays.in_play  # all balls that are shown are in play
    always = np.ones((len(arrays.over), goals), np.bool_)
    goal = np.full(goals, numbers.goal_radius), arrays.goals, always, always, colours[-1:]
    balls = np.array(scene.balls.radius), arrays.positions, arrays.in_play, kinds, colours
    return background, [(paint_discs, (half, discs)) for discs in (goal, balls)]


PIXELS = Feature(
    'an image (red, green, blue) of the table, its balls and the goal: `("pixels", height, width)`',
    ("height", "width", 3),
    0.0,
    write_image,
    functools.partial(read_image, planes=False),
    is_image=True,
)
PLANES = Feature(
    "images of the cue ball, of the object balls to play, of the other ones and, in a task with a goal, of the "
    'goal: `("planes", height, width)`',
    ("height", "width", "planes"),
    0.0,
    write_image,
    functools.partial(read_image, planes=True),
    is_image=True,
)
