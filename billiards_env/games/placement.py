"""Placement of balls during a game: spotted balls and the cue ball in hand.

A placed ball keeps a gap of at least `MARGIN` to other balls, cushions and pockets. The computation uses only `+ - * /`
and `sqrt` of doubles, so a point has the same bits on every machine.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

from numpy.typing import NDArray

from billiards_env.layouts import MARGIN
from billiards_env.scene import Scene

Point = tuple[float, float]
Circle = tuple[float, float, float]

_SLACK = 1e-9
"""m. Tolerance for points on the boundary of the free area; rounding errors are far smaller."""


def obstacles(scene: Scene, positions: NDArray[Any], ball: int, others: Iterable[int]) -> list[Circle]:
    """Returns the circles that the centre of a ball must not enter.

    Args:
        scene: The scene.
        positions: (n, 2) m.
        ball: The ball to be placed.
        others: The other balls on the table.

    Returns:
        One circle (x, y, radius), m, for each other ball and each pocket.
    """
    radius = scene.balls.radius
    circles = [(*positions[i].tolist(), radius[i] + radius[ball] + MARGIN) for i in sorted(others)]
    return circles + [(p.x, p.y, p.radius + MARGIN) for p in scene.table.pockets]


def placement_area(scene: Scene, ball: int, behind: bool = False) -> tuple[float, float, float, float]:
    """Returns the rectangle in which the centre of a ball may be placed.

    Args:
        scene: The scene.
        ball: The ball.
        behind: Whether the ball must be behind the head string.

    Returns:
        The smallest x, largest x, smallest y and largest y, m.
    """
    x = scene.table.length / 2 - scene.balls.radius[ball] - MARGIN
    y = scene.table.width / 2 - scene.balls.radius[ball] - MARGIN
    return -x, scene.table.head_x if behind else x, -y, y


def _is_free(point: Point, circles: list[Circle]) -> bool:
    for x, y, radius in circles:
        dx, dy, clear = point[0] - x, point[1] - y, radius - _SLACK
        if dx * dx + dy * dy < clear * clear:
            return False
    return True


def _line_intersections(centre: float, radius: float, offset: float) -> list[float]:
    """Returns the coordinates, along the line, of a circle's intersections with a line at distance `offset`."""
    square = radius * radius - offset * offset
    if square < 0.0:
        return []
    half = math.sqrt(square)
    return [centre - half, centre + half]


def _circle_intersections(first: Circle, second: Circle) -> list[Point]:
    (x, y, r), (x2, y2, r2) = first, second
    dx, dy = x2 - x, y2 - y
    square = dx * dx + dy * dy
    if square == 0.0:
        return []
    along = (square + r * r - r2 * r2) / (2.0 * square)
    across = r * r / square - along * along
    if across < 0.0:
        return []
    side = math.sqrt(across)
    return [(x + along * dx - s * dy, y + along * dy + s * dx) for s in (side, -side)]


def nearest_free_point(point: Point, area: tuple[float, float, float, float], circles: list[Circle]) -> Point:
    """Returns the point nearest to `point` that is inside a rectangle and outside all circles.

    If `point`, clipped to the rectangle, is free, it is the result. Otherwise the nearest free point lies on a circle:
    on the ray from its centre through the clipped point, or at an intersection with another circle or with the
    rectangle. Of several nearest points the first in this order is returned; circles are taken in the given order.

    Args:
        point: x and y, m.
        area: Smallest x, largest x, smallest y and largest y, m.
        circles: x, y and radius of each circle, m.

    Returns:
        The nearest free point, m.

    Raises:
        ValueError: If no point is free.

    Example:
        >>> nearest_free_point((0.1, 0.0), (-1.0, 1.0, -1.0, 1.0), [(0.0, 0.0, 0.5)])
        (0.5, 0.0)
    """
    x_low, x_high, y_low, y_high = area
    x, y = min(max(point[0], x_low), x_high), min(max(point[1], y_low), y_high)
    if _is_free((x, y), circles):
        return x, y
    candidates: list[Point] = []
    for cx, cy, radius in circles:
        dx, dy = x - cx, y - cy
        distance = math.sqrt(dx * dx + dy * dy)
        ex, ey = (dx / distance, dy / distance) if distance > 0.0 else (1.0, 0.0)
        candidates.append((cx + radius * ex, cy + radius * ey))
    for i, circle in enumerate(circles):
        cx, cy, radius = circle
        for other in circles[i + 1 :]:
            candidates += _circle_intersections(circle, other)
        for edge in (x_low, x_high):
            candidates += [(edge, v) for v in _line_intersections(cy, radius, edge - cx)]
        for edge in (y_low, y_high):
            candidates += [(u, edge) for u in _line_intersections(cx, radius, edge - cy)]
    candidates += [(u, v) for u in (x_low, x_high) for v in (y_low, y_high)]
    free = [p for p in candidates if x_low <= p[0] <= x_high and y_low <= p[1] <= y_high and _is_free(p, circles)]
    if not free:
        raise ValueError(
            f"no room for a ball in x {x_low} to {x_high} m, y {y_low} to {y_high} m: expected a free point"
        )
    return min(free, key=lambda p: (p[0] - x) * (p[0] - x) + (p[1] - y) * (p[1] - y))


def spotted_point(scene: Scene, positions: NDArray[Any], on_table: Iterable[int], ball: int) -> Point:
    """Returns the point at which a potted ball is spotted (WPA 1.4).

    The ball is placed on the long string (the table's long axis), behind the foot spot and as close to it as possible.
    If there is no room behind the foot spot, it is placed in front of it. If the whole long string is blocked, it is
    placed at the free point nearest to the foot spot. It keeps a gap of `MARGIN` to all other balls; WPA requires a gap
    only to the cue ball.

    Args:
        scene: The scene.
        positions: (n, 2) m.
        on_table: The balls on the table.
        ball: The ball to be spotted.

    Returns:
        x and y, m.

    Raises:
        ValueError: If there is no room on the table.
    """
    circles = obstacles(scene, positions, ball, on_table)
    area = placement_area(scene, ball)
    foot = min(scene.table.foot_x, area[1])
    edges = [x for cx, cy, radius in circles for x in _line_intersections(cx, radius, cy)]
    behind = sorted(x for x in (foot, *edges) if foot <= x <= area[1])
    in_front = sorted((x for x in edges if area[0] <= x < foot), reverse=True)
    for x in (*behind, *in_front):
        if _is_free((x, 0.0), circles):
            return x, 0.0
    return nearest_free_point((foot, 0.0), area, circles)


def cue_ball_point(
    scene: Scene, positions: NDArray[Any], others: Iterable[int], cue: int, point: Point, behind: bool
) -> Point:
    """Returns the point at which a cue ball in hand is placed: the free point nearest to the requested one.

    Args:
        scene: The scene.
        positions: (n, 2) m.
        others: The other balls on the table.
        cue: The cue ball.
        point: The requested x and y, m.
        behind: Whether the cue ball must be behind the head string.

    Returns:
        x and y, m; see `nearest_free_point`.

    Raises:
        ValueError: If there is no room.
    """
    return nearest_free_point(point, placement_area(scene, cue, behind), obstacles(scene, positions, cue, others))
