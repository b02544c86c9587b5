"""The cushions of a table in mpmath arithmetic, as numbered by the engine.

A rectangle has the cushions 0 to 3: -x, +x, -y, +y. An outline has a straight cushion from each corner to the next and
then the arcs of the corners that point into the table.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import mpmath

from benchmarks.reference.oracle.roots import Real
from billiards_env.scene.table import Table

Vector = tuple[Real, ...]


@dataclasses.dataclass(frozen=True)
class Line:
    """A straight cushion.

    Attributes:
        middle: (2,) m.
        tangent, normal: (2,) unit vectors; the normal points into the cushion.
        half: Half the length, m; infinite for the side of a rectangle.
    """

    middle: Vector
    tangent: Vector
    normal: Vector
    half: Real

    def holds(self, position: Vector, slack: Real) -> bool:
        """Returns whether the point nearest to a position lies between the ends of the cushion."""
        return abs(dot(self.tangent, minus(position, self.middle))) <= self.half + slack


@dataclasses.dataclass(frozen=True)
class Arc:
    """The arc of a corner.

    Attributes:
        center: (2,) m.
        radius: m.
        before, after: (2,) the unit tangents at the beginning and at the end.
    """

    center: Vector
    radius: Real
    before: Vector
    after: Vector

    def holds(self, position: Vector, slack: Real) -> bool:
        """Returns whether the ray from the centre to a position crosses the arc."""
        d = minus(position, self.center)
        return dot(d, self.before) >= -slack and dot(d, self.after) <= slack


def dot(a: Sequence[Real], b: Sequence[Real]) -> Real:
    """Returns the scalar product. If only one vector has three components, it is that of the horizontal parts."""
    return sum(x * y for x, y in zip(a, b, strict=False))


def minus(a: Vector, b: Vector) -> Vector:
    """Returns the difference. If only one vector has three components, it is that of the horizontal parts."""
    return tuple(x - y for x, y in zip(a, b, strict=False))


def walls_of(table: Table) -> tuple[Line | Arc, ...]:
    """Returns the cushions of a table in the working precision of the caller."""
    if table.outline:
        return _pieces([((mpmath.mpf(c.x), mpmath.mpf(c.y)), mpmath.mpf(c.radius)) for c in table.outline])
    x, y = mpmath.mpf(table.length) / 2, mpmath.mpf(table.width) / 2
    zero, one = mpmath.mpf(0), mpmath.mpf(1)
    sides = ((-x, zero), (-one, zero)), ((x, zero), (one, zero)), ((zero, -y), (zero, -one)), ((zero, y), (zero, one))
    return tuple(Line(middle, (-n[1], n[0]), n, mpmath.inf) for middle, n in sides)


def _pieces(corners: Sequence[tuple[Vector, Real]]) -> tuple[Line | Arc, ...]:
    n = len(corners)
    ways = [minus(corners[(k + 1) % n][0], corners[k][0]) for k in range(n)]
    lengths = [mpmath.sqrt(dot(way, way)) for way in ways]
    tangents = [(way[0] / length, way[1] / length) for way, length in zip(ways, lengths, strict=True)]
    cut, arcs = [], []
    for k, (place, radius) in enumerate(corners):
        a, b = tangents[k - 1], tangents[k]
        sine = a[0] * b[1] - a[1] * b[0]
        if sine >= 0:
            cut.append(mpmath.mpf(0))
            continue
        tangent = -radius * sine / (1 + dot(a, b))  # r tan(turn / 2)
        cut.append(tangent)
        start = (place[0] - tangent * a[0], place[1] - tangent * a[1])
        arcs.append(Arc((start[0] + radius * a[1], start[1] - radius * a[0]), radius, a, b))
    lines = []
    for k, ((place, _), t) in enumerate(zip(corners, tangents, strict=True)):
        half = (lengths[k] - cut[k] - cut[(k + 1) % n]) / 2
        along = cut[k] + half
        lines.append(Line((place[0] + along * t[0], place[1] + along * t[1]), t, (t[1], -t[0]), half))
    return (*lines, *arcs)


def in_floats(wall: Line | Arc) -> Line | Arc:
    """Returns a cushion with floats instead of mpf numbers."""
    values: list[Any] = [getattr(wall, field.name) for field in dataclasses.fields(wall)]
    floats: list[Any] = [tuple(map(float, v)) if isinstance(v, tuple) else float(v) for v in values]
    return type(wall)(*floats)


def normal_at(wall: Line | Arc, position: Vector) -> Vector:
    """Returns the unit normal into a cushion at a ball."""
    if isinstance(wall, Line):
        return wall.normal
    d = minus(wall.center, position)
    distance = mpmath.sqrt(dot(d, d))
    return (d[0] / distance, d[1] / distance)
