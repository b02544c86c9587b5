"""Where balls may be put: a potted ball that is spotted, a cue ball in hand.

Placed balls keep `MARGIN` clear of other balls, cushions and pockets. Only `+ - * /` and `sqrt` of doubles, so a place
is the same bit for bit on every machine.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

from numpy.typing import NDArray

from billiards_env.layouts import MARGIN
from billiards_env.scene import Scene

Point = tuple[float, float]

_SLACK = 1e-9
"""m. A place computed to lie on the edge of what is free may miss it by rounding, which is far less."""


def obstacles(
    scene: Scene, positions: NDArray[Any], ball: int, others: Iterable[int]
) -> list[tuple[float, float, float]]:
    """The circles (x, y, radius), m, that the centre of `ball` has to keep out of.

    Args:
        scene: The scene.
        positions: (n, 2) m.
        ball: The ball to be placed.
        others: The balls on the table.

    Returns:
        One circle a ball and a pocket.
    """
    radius = scene.balls.radius
    circles = [(*positions[i].tolist(), radius[i] + radius[ball] + MARGIN) for i in sorted(others)]
    return circles + [(p.x, p.y, p.radius + MARGIN) for p in scene.table.pockets]


def room(scene: Scene, ball: int, behind: bool = False) -> tuple[float, float, float, float]:
    """The rectangle in which the centre of `ball` may be placed.

    Args:
        scene: The scene.
        ball: The ball.
        behind: Whether it has to be behind the head string, which is at a quarter of the table's length.

    Returns:
        Its smallest and largest x, then y, m.
    """
    x = scene.table.length / 2 - scene.balls.radius[ball] - MARGIN
    y = scene.table.width / 2 - scene.balls.radius[ball] - MARGIN
    return -x, -scene.table.length / 4 if behind else x, -y, y


def _is_free(place: Point, circles: list[tuple[float, float, float]]) -> bool:
    for x, y, reach in circles:
        dx, dy, clear = place[0] - x, place[1] - y, reach - _SLACK
        if dx * dx + dy * dy < clear * clear:
            return False
    return True


def _where_circle_meets_line(centre: float, reach: float, offset: float) -> list[float]:
    """Where a circle meets a line parallel to an axis, along that axis; `offset` is the line's distance."""
    square = reach * reach - offset * offset
    if square < 0.0:
        return []
    half = math.sqrt(square)
    return [centre - half, centre + half]


def _where_circles_meet(first: tuple[float, float, float], second: tuple[float, float, float]) -> list[Point]:
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


def nearest_place(
    wish: Point, area: tuple[float, float, float, float], circles: list[tuple[float, float, float]]
) -> Point:
    """The place nearest to `wish` inside a rectangle and outside all circles.

    It is the wish itself, moved into the rectangle, if that is free. Otherwise the nearest free place lies on the edge
    of a circle: straight out from its centre, or where it meets another circle or the rectangle. Of places equally near
    the first in that order is taken, circles being in the order in which they are given.

    Args:
        wish: x and y, m.
        area: Smallest and largest x, then y, m.
        circles: x, y and radius each, m.

    Returns:
        The place, m.

    Raises:
        ValueError: If there is no room at all.

    Example:
        >>> nearest_place((0.1, 0.0), (-1.0, 1.0, -1.0, 1.0), [(0.0, 0.0, 0.5)])
        (0.5, 0.0)
    """
    x_low, x_high, y_low, y_high = area
    x, y = min(max(wish[0], x_low), x_high), min(max(wish[1], y_low), y_high)
    if _is_free((x, y), circles):
        return x, y
    places: list[Point] = []
    for cx, cy, reach in circles:
        dx, dy = x - cx, y - cy
        distance = math.sqrt(dx * dx + dy * dy)
        ex, ey = (dx / distance, dy / distance) if distance > 0.0 else (1.0, 0.0)
        places.append((cx + reach * ex, cy + reach * ey))
    for i, circle in enumerate(circles):
        cx, cy, reach = circle
        for other in circles[i + 1 :]:
            places += _where_circles_meet(circle, other)
        for edge in (x_low, x_high):
            places += [(edge, v) for v in _where_circle_meets_line(cy, reach, edge - cx)]
        for edge in (y_low, y_high):
            places += [(u, edge) for u in _where_circle_meets_line(cx, reach, edge - cy)]
    places += [(u, v) for u in (x_low, x_high) for v in (y_low, y_high)]
    inside = [p for p in places if x_low <= p[0] <= x_high and y_low <= p[1] <= y_high and _is_free(p, circles)]
    if not inside:
        raise ValueError(
            f"no room for a ball in x {x_low} to {x_high} m, y {y_low} to {y_high} m: expected a free place"
        )
    return min(inside, key=lambda p: (p[0] - x) * (p[0] - x) + (p[1] - y) * (p[1] - y))


def spot_place(scene: Scene, positions: NDArray[Any], on_table: Iterable[int], ball: int) -> Point:
    """Where a potted ball comes back (WPA 1.4).

    On the long string, the table's axis, as close as possible to the foot spot: behind it, towards the foot cushion, or
    in front of it where there is no room. It keeps `MARGIN` clear of other balls, which WPA asks for the cue ball only.
    Where the whole long string is blocked, it is put as close to the foot spot as can be.

    Args:
        scene: The scene.
        positions: (n, 2) m.
        on_table: The balls on the table.
        ball: The ball to be spotted.

    Returns:
        Its place, m.

    Raises:
        ValueError: If there is no room on the table.
    """
    circles = obstacles(scene, positions, ball, on_table)
    area = room(scene, ball)
    foot = min(scene.table.length / 4, area[1])
    blocked = [x for cx, cy, reach in circles for x in _where_circle_meets_line(cx, reach, cy)]
    behind = sorted(x for x in (foot, *blocked) if foot <= x <= area[1])
    before = sorted((x for x in blocked if area[0] <= x < foot), reverse=True)
    for x in (*behind, *before):
        if _is_free((x, 0.0), circles):
            return x, 0.0
    return nearest_place((foot, 0.0), area, circles)


def cue_place(
    scene: Scene, positions: NDArray[Any], others: Iterable[int], cue: int, wish: Point, behind: bool
) -> Point:
    """Where a cue ball in hand is put: at the wished place, or at the nearest one that is free.

    Args:
        scene: The scene.
        positions: (n, 2) m.
        others: The other balls on the table.
        cue: The cue ball.
        wish: x and y, m.
        behind: Whether it has to be behind the head string.

    Returns:
        Its place, m; see `nearest_place`.

    Raises:
        ValueError: If there is no room.
    """
    return nearest_place(wish, room(scene, cue, behind), obstacles(scene, positions, cue, others))
