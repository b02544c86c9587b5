"""Placement of balls during a game: spotted balls, racks and the cue ball in hand.

A placed ball keeps a gap of at least `MARGIN` to other balls, cushions and pockets, or of `SPOT_GAP` on the spots of
snooker. A spotted ball of pool may touch object balls. The computation uses only `+ - * /` and `sqrt` of doubles, so a
point has the same bits on every machine.

`scene` is the scene, and `positions` are those of all its balls, (n, 2) m. A function that finds no room on the table
raises a ValueError.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Container, Iterable
from typing import Any

from numpy.typing import NDArray

from billiards_env.games.state import BEHIND, NOT_IN_HAND, members
from billiards_env.scene import CONTACT_GAP, Scene, layouts
from billiards_env.scene.layouts import MARGIN
from billiards_env.scene.outline import Circle, Point, circle_intersections

SPOT_GAP = 1e-5
"""m. Smallest gap between a colour on a spot of snooker and other balls, which it must not touch."""

_SLACK = CONTACT_GAP / 2
"""m. Tolerance for points on the boundary of the free area; rounding errors are far smaller."""


def obstacles(
    scene: Scene,
    positions: NDArray[Any],
    ball: int,
    others: Iterable[int],
    gap: float = MARGIN,
    touchable: Container[int] = (),
) -> list[Circle]:
    """Returns the circles (x, y, radius), m, that the centre of a ball must not enter.

    There is one for each of the `others` on the table and for each pocket. `gap` is the smallest gap, m; there is none
    to balls that are `touchable`.
    """
    radius, touching = scene.balls.radius, scene.balls.contact_distances(ball).tolist()
    reach = [touching[i] if i in touchable else radius[i] + radius[ball] + gap for i in range(scene.n_balls)]
    circles = [(*positions[i].tolist(), reach[i]) for i in sorted(others)]
    return circles + [(p.x, p.y, p.radius + gap) for p in scene.table.pockets]


def placement_area(scene: Scene, ball: int, behind: bool = False) -> tuple[float, float, float, float]:
    """Returns the rectangle in which the centre of a ball may be placed: the limits of x and those of y, m.

    With `behind` the ball must be behind the head string. On a table with a D this is the rectangle around the D.
    """
    x = scene.table.length / 2 - scene.balls.radius[ball] - MARGIN
    y = scene.table.width / 2 - scene.balls.radius[ball] - MARGIN
    head, d = scene.table.head_x, scene.table.d_radius
    if behind and d:
        return head - d, head, -d, d
    return -x, head if behind else x, -y, y


def is_free(point: Point, circles: list[Circle]) -> bool:
    """Returns whether a point is outside all circles."""
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


def nearest_free_point(
    point: Point, area: tuple[float, float, float, float], circles: list[Circle], within: Circle | None = None
) -> Point:
    """Returns the point nearest to `point` that is inside a rectangle and outside all circles.

    If `point`, clipped to the rectangle, is free, it is the result. Otherwise the nearest free point lies on a circle:
    on the ray from its centre through the clipped point, or at an intersection with another circle or with the
    rectangle. Of several nearest points the first in this order is returned; circles are taken in the given order.

    Args:
        point: x and y, m.
        area: Smallest x, largest x, smallest y and largest y, m.
        circles: x, y and radius of each circle, m.
        within: A circle that the point must not leave, with its centre on the right edge of the area: the D of
            snooker.

    Returns:
        The nearest free point, m.

    Raises:
        ValueError: If no point is free.

    Example:
        >>> nearest_free_point((0.1, 0.0), (-1.0, 1.0, -1.0, 1.0), [(0.0, 0.0, 0.5)])
        (0.5, 0.0)
    """
    x_low, x_high, y_low, y_high = area
    x, y = _clipped((min(max(point[0], x_low), x_high), min(max(point[1], y_low), y_high)), within)
    if is_free((x, y), circles):
        return x, y
    candidates: list[Point] = []
    for cx, cy, radius in circles:
        dx, dy = x - cx, y - cy
        distance = math.sqrt(dx * dx + dy * dy)
        ex, ey = (dx / distance, dy / distance) if distance > 0.0 else (1.0, 0.0)
        candidates.append((cx + radius * ex, cy + radius * ey))
    for i, circle in enumerate(circles):
        cx, cy, radius = circle
        for other in circles[i + 1 :] + ([within] if within else []):
            candidates += circle_intersections(circle, other)
        for edge in (x_low, x_high):
            candidates += [(edge, v) for v in _line_intersections(cy, radius, edge - cx)]
        for edge in (y_low, y_high):
            candidates += [(u, edge) for u in _line_intersections(cx, radius, edge - cy)]
    candidates += [(u, v) for u in (x_low, x_high) for v in (y_low, y_high)]
    inside = [p for p in candidates if x_low <= p[0] <= x_high and y_low <= p[1] <= y_high and _contains(within, p)]
    free = [p for p in inside if is_free(p, circles)]
    if not free:
        raise ValueError(
            f"no room for a ball in x {x_low} to {x_high} m, y {y_low} to {y_high} m: expected a free point"
        )
    return min(free, key=lambda p: (p[0] - x) * (p[0] - x) + (p[1] - y) * (p[1] - y))


def _clipped(point: Point, within: Circle | None) -> Point:
    """Returns the point of a disc that is nearest to `point`; None is the whole plane."""
    if within is None or _contains(within, point):
        return point
    x, y, radius = within
    dx, dy = point[0] - x, point[1] - y
    distance = math.sqrt(dx * dx + dy * dy)
    return x + radius * dx / distance, y + radius * dy / distance


def _contains(circle: Circle | None, point: Point) -> bool:
    if circle is None:
        return True
    dx, dy, reach = point[0] - circle[0], point[1] - circle[1], circle[2] + _SLACK
    return dx * dx + dy * dy <= reach * reach


def spotted_point(scene: Scene, positions: NDArray[Any], on_table: Collection[int], ball: int, cue: int) -> Point:
    """Returns the point at which a potted ball is spotted (WPA 1.4).

    The ball is placed on the long string (the table's long axis), behind the foot spot and as close to it as possible.
    If there is no room behind the foot spot, it is placed in front of it. If the whole long string is blocked, it is
    placed at the free point nearest to the foot spot. It touches an object ball that is in the way, and keeps a gap of
    `MARGIN` to the cue ball `cue`. `on_table` are the balls on the table.
    """
    circles = obstacles(scene, positions, ball, on_table, touchable=set(on_table) - {cue})
    return _beyond(scene, ball, (scene.table.foot_x, 0.0), circles)


def _beyond(scene: Scene, ball: int, spot: Point, circles: list[Circle]) -> Point:
    """Returns the free point nearest to a spot on its line along the table: beyond it, or else in front of it.

    If the whole line is blocked, it is the free point nearest to the spot.
    """
    area = placement_area(scene, ball)
    foot, y = min(spot[0], area[1]), spot[1]
    edges = [x for cx, cy, radius in circles for x in _line_intersections(cx, radius, cy - y)]
    behind = sorted(x for x in (foot, *edges) if foot <= x <= area[1])
    in_front = sorted((x for x in edges if area[0] <= x < foot), reverse=True)
    for x in (*behind, *in_front):
        if is_free((x, y), circles):
            return x, y
    return nearest_free_point((foot, y), area, circles)


def spot_at_foot(
    scene: Scene, positions: NDArray[Any], on_table: Iterable[int], balls: Iterable[int], cue: int
) -> None:
    """Spots balls of pool one after the other, see `spotted_point`. Changes `positions`; other balls are `on_table`."""
    others = set(on_table)
    for ball in balls:
        positions[ball] = spotted_point(scene, positions, others, ball, cue)
        others.add(ball)


def spot_colours(scene: Scene, positions: NDArray[Any], on_table: Iterable[int], balls: Iterable[int]) -> None:
    """Spots colours of snooker (WPBSA, section 3, rule 7). Changes `positions`.

    Each colour is placed on its spot. If that is occupied, it is placed on the highest free spot, the colour of the
    highest value first. If all spots are occupied, it is placed as near to its spot as possible on the line from there
    to the top cushion, or, without room there, below the spot. The other balls are `on_table`.
    """
    spots = [(x, y) for x, y in layouts.layout_plan("snooker", scene).spots.tolist()]
    others, waiting = set(on_table), []
    for ball in sorted(balls, reverse=True):
        if is_free(spots[ball], obstacles(scene, positions, ball, others, SPOT_GAP)):
            positions[ball] = spots[ball]
            others.add(ball)
        else:
            waiting.append(ball)
    for ball in waiting:
        circles = obstacles(scene, positions, ball, others, SPOT_GAP)
        free = (spot for spot in spots[:-7:-1] if is_free(spot, circles))
        positions[ball] = next(free, None) or _beyond(scene, ball, spots[ball], circles)
        others.add(ball)


def rack_again(scene: Scene, positions: NDArray[Any], on_table: Iterable[int], cue: int) -> int:
    """Racks the object balls of straight pool again (WPA 4.4, 4.8). Changes `positions`; returns `RulesState.in_hand`.

    The potted balls are placed in a tight rack, in the order of their numbers. The apex is left out if one object ball
    is on the table. A ball is in the rack if it overlaps one of the places of the rack. If the last ball is in the
    rack, it is placed on the head spot, or on the centre spot if the cue ball blocks the head spot. If the cue ball is
    in the rack, it is in hand behind the head string; with the last ball there it is placed on the head spot, or on the
    centre spot if the last ball blocks the head spot. If both are in the rack, the last ball is placed at the apex.
    """
    places = layouts.layout_plan("tight_rack", scene).spots[1:]
    radius = scene.balls.radius
    head, centre = (scene.table.head_x, 0.0), (0.0, 0.0)

    def overlaps(ball: int, points: Iterable[Any]) -> bool:
        return any(math.dist(positions[ball], point) < 2 * radius[ball] for point in points)

    last = [ball for ball in on_table if ball != cue]
    cue_in_rack = overlaps(cue, places)
    in_hand = BEHIND if cue_in_rack else NOT_IN_HAND
    if not last or (cue_in_rack and overlaps(last[0], places)):
        last = []
    elif overlaps(last[0], places):
        positions[last[0]] = centre if overlaps(cue, [head]) else head
    elif cue_in_rack and overlaps(last[0], [head]):
        positions[cue], in_hand = centre, NOT_IN_HAND
    elif cue_in_rack and positions[last[0], 0] < scene.table.head_x:
        positions[cue], in_hand = head, NOT_IN_HAND
    rest = [ball for ball in range(scene.n_balls) if ball != cue and ball not in last]
    positions[rest] = places[len(last) :]
    return in_hand


def cue_ball_area(scene: Scene, state: Any) -> tuple[float, float, float, float]:
    """Returns the rectangle in which the centre of a cue ball in hand may be placed, see `placement_area`."""
    return placement_area(scene, int(state.cue_balls[0]), state.in_hand == BEHIND)


def cue_ball_point(scene: Scene, positions: NDArray[Any], state: Any, point: Point) -> Point:
    """Returns the free point nearest to a requested one, m, at which a cue ball in hand is placed."""
    table = scene.table
    d = (table.head_x, 0.0, table.d_radius) if state.in_hand == BEHIND and table.d_radius else None
    circles = obstacles(scene, positions, int(state.cue_balls[0]), members(state.object_balls))
    return nearest_free_point(point, cue_ball_area(scene, state), circles, d)
