"""The outline of a table: a closed line of straight cushions and rounded tips.

An outline is a sequence of corners, counter-clockwise, so that the table lies on the left of each cushion. A corner at
which the outline turns right points into the table. Such a corner may be rounded by an arc, the tip of a jaw.
"""

from __future__ import annotations

import dataclasses
import functools
import itertools
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from billiards_env.support.checks import real, short

Floats = NDArray[np.float64]
Point = tuple[float, float]
Circle = tuple[float, float, float]

TOUCH = 1e-9
"""m. Two pieces of an outline touch if their distance is at most this. Rounding errors are far smaller."""

_REVERSAL = 1e-6  # rad; the two cushions of a sharper corner would overlap
_ARC_STEP = math.radians(3)  # between two points of a polygon


@dataclasses.dataclass(frozen=True, slots=True)
class Corner:
    """A corner of an outline.

    Attributes:
        x: Position along the table's length, m.
        y: Position along the table's width, m.
        radius: Radius of the arc that rounds a corner which points into the table, m; 0 for a sharp corner.
    """

    x: float
    y: float
    radius: float = 0.0

    def __post_init__(self) -> None:
        for name, within in (("x", "coordinate"), ("y", "coordinate"), ("radius", "tip_radius")):
            object.__setattr__(self, name, real(f"corner.{name}", getattr(self, name), within))


class Line(NamedTuple):
    """A straight cushion from (x0, y0) to (x1, y1), m. The table lies on its left."""

    x0: float
    y0: float
    x1: float
    y1: float


class Tip(NamedTuple):
    """An arc about (x, y) from (x0, y0) to (x1, y1), m. A sharp corner has an arc of radius 0."""

    x: float
    y: float
    radius: float
    x0: float
    y0: float
    x1: float
    y1: float


def pieces(corners: Sequence[Corner]) -> tuple[list[Line], list[Tip]]:
    """Returns the straight cushions of an outline and its tips.

    Cushion k leads from corner k to corner k + 1. An arc of radius r begins and ends at the distance r tan(turn / 2)
    from its corner. The pieces of a mirrored outline are mirrored bit for bit.

    Raises:
        ValueError: If two neighbouring corners are equal, a rounded corner does not point into the table, or the arcs
            at the ends of a cushion overlap.
    """
    n = len(corners)
    directions = []
    for k, corner in enumerate(corners):
        after = corners[(k + 1) % n]
        dx, dy = after.x - corner.x, after.y - corner.y
        length = math.sqrt(dx * dx + dy * dy)
        if length == 0.0:
            raise ValueError(f"table.outline[{(k + 1) % n}] = {after}: expected a corner apart from the one before it")
        directions.append((dx / length, dy / length, length))
    tips, cut = [], []
    for k, corner in enumerate(corners):
        (ax, ay, _), (bx, by, _) = directions[k - 1], directions[k]
        turn = ax * by - ay * bx  # the sine of the turn to the left
        cosine = ax * bx + ay * by
        if cosine < 0.0 and abs(turn) < _REVERSAL:
            raise ValueError(f"table.outline[{k}] = {corner}: expected a corner at which the outline does not reverse")
        if turn >= 0.0:
            if corner.radius > 0.0:
                raise ValueError(
                    f"table.outline[{k}] = {corner}: expected radius 0, only a corner that points into the table "
                    "can be rounded (the corners of an outline are counter-clockwise)"
                )
            cut.append(0.0)
            continue
        tangent = corner.radius * (-turn / (1.0 + cosine))
        cut.append(tangent)
        tips.append(
            Tip(
                # The mean of the centres computed from both cushions, so that a mirrored outline has mirrored bits
                corner.x + 0.5 * (tangent * (bx - ax) + corner.radius * (ay + by)),
                corner.y + 0.5 * (tangent * (by - ay) - corner.radius * (ax + bx)),
                corner.radius,
                corner.x - tangent * ax,
                corner.y - tangent * ay,
                corner.x + tangent * bx,
                corner.y + tangent * by,
            )
        )
    lines = []
    for k, (corner, (dx, dy, length)) in enumerate(zip(corners, directions, strict=True)):
        after = corners[(k + 1) % n]
        before, behind = cut[k], cut[(k + 1) % n]
        if before + behind > length:
            raise ValueError(
                f"table.outline[{k}] = {corner}: expected smaller radii, the arcs at the ends of the cushion "
                "to the next corner overlap"
            )
        lines.append(Line(corner.x + before * dx, corner.y + before * dy, after.x - behind * dx, after.y - behind * dy))
    return lines, tips


@functools.lru_cache(maxsize=256)
def check_outline(corners: tuple[Corner, ...]) -> None:
    """Raises a ValueError unless the pieces of an outline enclose the table once, counter-clockwise."""
    if len(corners) < 3:
        raise ValueError(f"table.outline has {len(corners)} corners: expected at least 3, or none for a rectangle")
    for corner in corners:
        if not isinstance(corner, Corner):
            raise TypeError(f"table.outline holds {short(corner)}: expected Corner objects")
    area = sum(a.x * b.y - b.x * a.y for a, b in itertools.pairwise((*corners, corners[0])))
    if area <= 0.0:
        raise ValueError(
            f"table.outline has the area {area / 2:g} m^2: expected counter-clockwise corners, so that the table lies "
            "on the left of each cushion"
        )
    path = _path(corners)
    for i, (k, piece) in enumerate(path):
        for j in range(i + 2, len(path) - (i == 0)):
            if _meet(piece, path[j][1]):
                raise ValueError(
                    f"table.outline[{k}] and table.outline[{path[j][0]}]: expected cushions that do not meet, except "
                    "neighbours at their corner"
                )
            for (corner, tip), (other, near) in ((path[i], path[j]), (path[j], path[i])):
                # The engines treat a tip as a full circle.
                if isinstance(tip, Tip) and _distance(near, tip.x, tip.y) < tip.radius - TOUCH:
                    raise ValueError(
                        f"table.outline[{corner}] = {corners[corner]}: expected a smaller radius, the circle of the "
                        f"tip reaches the cushion of table.outline[{other}]"
                    )


def clearance(corners: Sequence[Corner], points: ArrayLike) -> Floats:
    """Returns the distances (...) of points (..., 2) from an outline, m; negative outside the table.

    A ball fits at a point if the distance there is at least its radius.
    """
    lines, tips = pieces(corners)
    x, y = np.moveaxis(np.clip(points, -1e9, 1e9), -1, 0)  # far outside, where squares do not overflow yet
    nearest = np.full(x.shape, np.inf)
    inside, cap = np.zeros(x.shape, np.bool_), np.zeros(x.shape, np.bool_)

    def crosses(x0: float, y0: float, x1: float, y1: float) -> NDArray[np.bool_]:
        """Returns whether the ray from each point in the direction +x crosses a line."""
        if y0 == y1:
            return np.zeros(x.shape, np.bool_)
        return ((y0 > y) != (y1 > y)) & (x < x0 + (x1 - x0) * ((y - y0) / (y1 - y0)))

    for line in lines:
        dx, dy = line.x1 - line.x0, line.y1 - line.y0
        square = dx * dx + dy * dy
        share = np.clip(((x - line.x0) * dx + (y - line.y0) * dy) / square, 0.0, 1.0) if square > 0.0 else 0.0
        nearest = np.minimum(nearest, np.hypot(x - (line.x0 + share * dx), y - (line.y0 + share * dy)))
        inside ^= crosses(*line)
    for tip in tips:
        inside ^= crosses(tip.x0, tip.y0, tip.x1, tip.y1)
        if tip.radius == 0.0:
            continue
        distance = np.hypot(x - tip.x, y - tip.y)
        nearest = np.where(_within(tip, x, y), np.minimum(nearest, abs(distance - tip.radius)), nearest)
        chord_x, chord_y = tip.x1 - tip.x0, tip.y1 - tip.y0
        cap |= (distance < tip.radius) & (chord_x * (y - tip.y0) - chord_y * (x - tip.x0) > 0.0)
    # The area between an arc and its chord belongs to the cushion.
    return np.where(inside & ~cap, nearest, -nearest)


@functools.lru_cache(maxsize=256)
def extents(corners: tuple[Corner, ...], pockets: tuple[Circle, ...], radius: float) -> Point | None:
    """Returns the largest abs(x) and abs(y), m, at which a ball fits, or None if it does not fit anywhere.

    Args:
        corners: The corners of the outline.
        pockets: x, y and radius of each circle that the ball's centre must not enter, m.
        radius: The ball's radius, m.
    """
    # The extreme places of the ball are at intersections of the curves that bound its centre.
    lines, tips = pieces(corners)
    curves: list[Line | Circle] = []
    for line in lines:
        length = math.hypot(line.x1 - line.x0, line.y1 - line.y0)
        if length > 0.0:
            nx, ny = radius * (line.y0 - line.y1) / length, radius * (line.x1 - line.x0) / length
            curves.append(Line(line.x0 + nx, line.y0 + ny, line.x1 + nx, line.y1 + ny))
    curves += [(tip.x, tip.y, tip.radius + radius) for tip in tips]
    curves += pockets
    crossings = [point for a, b in itertools.combinations(curves, 2) for point in _intersections(a, b)]
    places = np.array(crossings).reshape(-1, 2)
    free = clearance(corners, places) >= radius - TOUCH
    for px, py, pocket in pockets:
        free &= np.hypot(places[:, 0] - px, places[:, 1] - py) >= pocket - TOUCH
    if not free.any():
        return None
    x, y = np.abs(places[free]).max(0).tolist()
    return x, y


def enters(corners: Sequence[Corner], half_x: float, half_y: float) -> bool:
    """Returns whether a cushion reaches into the rectangle abs(x) < `half_x`, abs(y) < `half_y` (m)."""
    points = polygon(corners)
    inner = np.array([half_x, half_y]) - TOUCH
    start, way = points, np.roll(points, -1, axis=0) - points
    with np.errstate(divide="ignore", invalid="ignore"):
        # The shares of each edge at which it enters and leaves the two strips
        low, high = (-inner - start) / way, (inner - start) / way
    low, high = np.minimum(low, high), np.maximum(low, high)
    fixed = way == 0.0
    low[fixed], high[fixed] = np.where(abs(start) < inner, -np.inf, np.inf)[fixed], np.inf
    return bool((np.maximum(low.max(1), 0.0) < np.minimum(high.min(1), 1.0)).any())


def polygon(corners: Sequence[Corner]) -> Floats:
    """Returns the points (m, 2) of an outline, m, counter-clockwise; an arc has a point every three degrees."""
    return np.vstack([run[:-1] for run in cushion_lines(corners)])


def cushion_lines(corners: Sequence[Corner]) -> list[Floats]:
    """Returns the cushions between the corners that point out of the table, each as points (m, 2) of a line, m.

    A cushion of a pool table is one run: a facing, a tip, a rail, a tip and a facing. The line behind a pocket is also
    a run.
    """
    path = _path(corners)
    into_table = {(tip.x1, tip.y1) for tip in pieces(corners)[1]}
    begins = [i for i, (_, piece) in enumerate(path) if isinstance(piece, Line) and piece[:2] not in into_table]
    polylines = []
    for begin, end in zip(begins, [*begins[1:], begins[0] + len(path)], strict=True):
        run = [path[i % len(path)][1] for i in range(begin, end)]
        points = [point for piece in run for point in _points(piece)]
        polylines.append(np.array([*points, (run[-1].x1, run[-1].y1)]))
    return polylines


def _path(corners: Sequence[Corner]) -> list[tuple[int, Line | Tip]]:
    """Returns the pieces that have a length, in their order along the outline, each with the index of its corner."""
    lines, tips = pieces(corners)
    before = {(tip.x1, tip.y1): tip for tip in tips if tip.radius > 0.0}
    path: list[tuple[int, Line | Tip]] = []
    for k, line in enumerate(lines):
        if line[:2] in before:
            path.append((k, before[line[:2]]))
        if math.hypot(line.x1 - line.x0, line.y1 - line.y0) > TOUCH:
            path.append((k, line))
    return path


def _points(piece: Line | Tip) -> list[Point]:
    """Returns points of a piece without its end."""
    points = [(piece.x0, piece.y0)]
    if isinstance(piece, Tip):
        start = math.atan2(piece.y0 - piece.y, piece.x0 - piece.x)
        turn = (start - math.atan2(piece.y1 - piece.y, piece.x1 - piece.x)) % math.tau  # clockwise
        steps = max(2, math.ceil(turn / _ARC_STEP))
        for angle in (start - turn * k / steps for k in range(1, steps)):
            points.append((piece.x + piece.radius * math.cos(angle), piece.y + piece.radius * math.sin(angle)))
    return points


def _within(tip: Tip, x: Floats, y: Floats) -> NDArray[np.bool_]:
    """Returns whether the rays from the centre of a tip to some points cross its arc."""
    sx, sy, ex, ey = tip.x0 - tip.x, tip.y0 - tip.y, tip.x1 - tip.x, tip.y1 - tip.y
    px, py = x - tip.x, y - tip.y
    return (sx * py - sy * px <= 0.0) & (px * ey - py * ex <= 0.0)


def circle_intersections(a: Circle, b: Circle) -> tuple[Point, Point]:
    """Returns the two points at which two circles (x, y, radius) meet; NaN if they do not, or have the same centre."""
    (ax, ay, ar), (bx, by, br) = a, b
    dx, dy = bx - ax, by - ay
    square, along, side = dx * dx + dy * dy, math.nan, math.nan
    if square > 0.0:
        along = (square + ar * ar - br * br) / (2.0 * square)
        across = ar * ar / square - along * along
        side = math.sqrt(across) if across >= 0.0 else math.nan
    x, y = ax + along * dx, ay + along * dy
    return (x - side * dy, y + side * dx), (x + side * dy, y - side * dx)


def _intersections(a: Line | Circle, b: Line | Circle) -> list[Point]:
    """Returns the points at which two curves meet; a line has no ends here. Parallel lines do not meet."""
    if not isinstance(a, Line):
        if isinstance(b, Line):
            return _intersections(b, a)
        return [point for point in circle_intersections(a, b) if math.isfinite(point[0])]
    dx, dy = a.x1 - a.x0, a.y1 - a.y0
    length = math.hypot(dx, dy)
    dx, dy = dx / length, dy / length
    if isinstance(b, Line):
        ex, ey = b.x1 - b.x0, b.y1 - b.y0
        sine = dx * ey - dy * ex
        if abs(sine) <= _REVERSAL * math.hypot(ex, ey):
            return []
        t = ((b.x0 - a.x0) * ey - (b.y0 - a.y0) * ex) / sine
        return [(a.x0 + t * dx, a.y0 + t * dy)]
    x, y, radius = b
    t, offset = (x - a.x0) * dx + (y - a.y0) * dy, (x - a.x0) * dy - (y - a.y0) * dx
    if abs(offset) > radius:
        return []
    half = math.sqrt(radius * radius - offset * offset)
    return [(a.x0 + s * dx, a.y0 + s * dy) for s in (t - half, t + half)]


def _distance(piece: Line | Tip, x: float, y: float) -> float:
    """Returns the distance of a point from a piece, m."""
    if isinstance(piece, Tip):
        if _within(piece, np.array(x), np.array(y)):
            return abs(math.hypot(x - piece.x, y - piece.y) - piece.radius)
        return min(math.hypot(x - piece.x0, y - piece.y0), math.hypot(x - piece.x1, y - piece.y1))
    dx, dy = piece.x1 - piece.x0, piece.y1 - piece.y0
    share = min(max(((x - piece.x0) * dx + (y - piece.y0) * dy) / (dx * dx + dy * dy), 0.0), 1.0)
    return math.hypot(x - (piece.x0 + share * dx), y - (piece.y0 + share * dy))


def _meet(a: Line | Tip, b: Line | Tip) -> bool:
    """Returns whether two pieces have a point in common."""
    points = [(piece.x0, piece.y0) for piece in (a, b)] + [(piece.x1, piece.y1) for piece in (a, b)]
    curves = [piece if isinstance(piece, Line) else (piece.x, piece.y, piece.radius) for piece in (a, b)]
    points += _intersections(curves[0], curves[1])
    return any(_distance(a, *point) <= TOUCH and _distance(b, *point) <= TOUCH for point in points)
