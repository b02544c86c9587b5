"""The outline of a table: a closed line of straight cushions and rounded tips.

An outline is a sequence of corners, counter-clockwise, so that the table lies on the left of each cushion. A corner at
which the outline turns right points into the table. Such a corner may be rounded by an arc, the tip of a jaw.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import NamedTuple

from billiards_env.checks import real


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
