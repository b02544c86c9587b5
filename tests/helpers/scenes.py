"""Scenes for the tests of `billiards_env.scene`."""

import dataclasses
import math

from billiards_env.scene import Balls, Physics, Pocket, Scene, Table
from billiards_env.scene.outline import Corner

R = 0.03125
SCENE = Scene(Balls((R, R), (1.0, 1.0)), Table(2.0, 1.0, 0.03, (Pocket(1.0, 0.5, 0.1),)), Physics(max_time=1.0))
CLEAR = [[-0.5, 0.0], [0.5, 0.0]]
SQUARE = ((-1.0, -0.5), (1.0, -0.5), (1.0, 0.5), (-1.0, 0.5))
HEXAGON = ((-1.0, 0.0), (-0.5, -0.75), (0.5, -0.75), (1.0, 0.0), (0.5, 0.75), (-0.5, 0.75))


def outline(points, **radii):
    """Returns corners at (x, y); `radii` are the radii of some, such as `r3=0.1` for corner 3."""
    return tuple(Corner(x, y, radii.get(f"r{k}", 0.0)) for k, (x, y) in enumerate(points))


def custom(points, length=2.0, width=1.0, **radii):
    return Table(length, width, outline=outline(points, **radii))


def ideal(balls):
    """Returns the "ideal" scene with other balls."""
    return dataclasses.replace(Scene.named("ideal"), balls=balls)


LARGE_AND_SMALL = ideal(Balls(radius=(0.02, 0.01, 0.2, 0.05), mass=(0.2, 0.1, math.inf, 0.3)))


def three_balls(cue, target, blocker):
    """Returns the "blocked_pool" scene with the given radii, m."""
    scene = Scene.named("blocked_pool")
    return dataclasses.replace(scene, balls=Balls((cue, target, blocker), scene.balls.mass))
