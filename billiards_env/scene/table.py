"""Tables: the cushions, the pockets and the markings.

All quantities are in SI units. The origin is the table's centre, x runs along the table's length and y along its width.
The head of the table is its -x end.

The default table is a rectangle. `Table.named` returns a table with the cushions of a real one. The sources:

==============  ====================  ================================================================================
table           field                 source
==============  ====================  ================================================================================
default         length, width         2.54 x 1.27 m: WPA equipment specifications (2001), 9-foot table, 100 x 50 in
                cushion_height        WPA: the nose of the cushion at 63.5% of the ball's diameter (2.25 in)
six_pockets     radius                half the WPA mouths of 4 9/16 in (corners; 4.5 to 4.625) and 5 1/16 in (sides; 5
                                      to 5.125)
"pool_9ft"      length, width, mouth  as above
and             angle                 WPA: cut angles of 142 and 104 degrees between nose line and facing, which is 7
"pool_8ft"                            degrees from the diagonal in a corner and 14 from the perpendicular at a side
                pocket radius, depth  hole of 62 mm; WPA shelves of 1 to 2.25 in (corners: 1.625) and 0 to 0.375 in
                                      (sides: 0.16)
                cushion_depth         2 in; BCA: 1 7/8 to 2 in
                tip_radius            as "pool_7ft"; the WPA does not specify it
                8-foot length, width  2.3368 x 1.1684 m: WPA, 92 x 46 in
"pool_7ft"      all                   pooltool 0.6.0, its table "7-foot Showood"
"snooker_12ft"  length, width         3.569 x 1.778 m: WPBSA, Official Rules of Snooker
                cushion_height        70% of the ball's diameter (52.5 mm): Mathavan, Jackson and Parkin (2010)
                head_string, D        WPBSA: baulk line 737 mm from the cushion, D of radius 292 mm
                all others            pooltool, its snooker table (2026)
"uk_7ft"        length, width         1.8288 x 0.9144 m: BAPTO, a "7 x 4 ft" table, 6 x 3 ft between the noses
                cushion_height        63.5% of the ball's diameter (2 in), as on pool tables
                mouth                 BAPTO: 1.6 times the ball's diameter (2 in)
                head_string           WEPF: baulk line at a fifth of the length
                all others            the jaws of "snooker_12ft", scaled with the diameter of the ball
"carom_10ft"    all                   2.84 x 1.42 m, cushions 37 mm high: UMB World Rules of Carom Billiard (2019),
                                      art. 11
==============  ====================  ================================================================================
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from billiards_env.scene.outline import TOUCH, Corner, check_outline, clearance, enters
from billiards_env.support.checks import check_fields, fields_of, finite, numbers, one_of, real, sequence, short

INCH = 0.0254  # m, exactly
POOL_LENGTH, POOL_WIDTH, POOL_RADIUS = 100 * INCH, 50 * INCH, 2.25 * INCH / 2
_POOL_CUSHION = 0.635 * 2 * POOL_RADIUS
_CORNER_MOUTH, _SIDE_MOUTH = 4.5625 * INCH, 5.0625 * INCH


@dataclasses.dataclass(frozen=True, slots=True)
class Pocket:
    """A circle that captures every ball whose centre enters it.

    Its shape is in this class, in `physics.geometry.pockets`, in `physics.geometry.noses` (for flights), in `pots.rims`
    (for the search for pots) and in the 50-digit reference. Other code reads `circle`, and `x` and `y` as the place at
    which a captured ball stays.

    Attributes:
        x: Centre along the table's length, m.
        y: Centre along the table's width, m.
        radius: Radius, m.
    """

    x: float
    y: float
    radius: float

    def __post_init__(self) -> None:
        check_fields(self, "pocket", x="coordinate", y="coordinate", radius="length")

    @property
    def circle(self) -> tuple[float, float, float]:
        """X, y and the radius of a circle that contains it, m."""
        return self.x, self.y, self.radius

    @property
    def half_width(self) -> float:
        """Half the width of its mouth, m; a captured ball is at most this far inside."""
        return self.radius

    @property
    def shape(self) -> str:
        """Its shape and its place in words."""
        return f"a circle of radius {self.radius} m about ({self.x}, {self.y})"

    def contains(self, points: ArrayLike, by: float = 0.0) -> NDArray[np.bool_]:
        """Returns whether points (..., 2) are inside its rim, farther from it than `by`, m.

        Raises a ValueError for points of another shape or with numbers that are not finite.
        """
        places = _places(points)
        finite("points", places, places.shape)
        return np.hypot(places[..., 0] - self.x, places[..., 1] - self.y) < self.radius - real("by", by)

    def distance(self, points: ArrayLike) -> NDArray[np.float64]:
        """Returns the distances (...) of points (..., 2) from its rim, m; negative inside."""
        places = _places(points)
        return np.hypot(places[..., 0] - self.x, places[..., 1] - self.y) - self.radius

    def rim(self, start: float = 0.0, angle: float = 2 * math.pi, points: int = 40) -> NDArray[np.float64]:
        """Returns points (points, 2) of its rim from the direction `start` over `angle`, in radians, m."""
        angles = start + angle * (np.arange(points) + 0.5) / points
        return np.column_stack((self.x + self.radius * np.cos(angles), self.y + self.radius * np.sin(angles)))


def _places(points: ArrayLike) -> NDArray[np.float64]:
    """Returns points as an array (..., 2). Raises a ValueError for other values."""
    places = numbers("points", points)
    if places.shape[-1:] != (2,):
        raise ValueError(f"points has shape {places.shape}: expected (..., 2)")
    return places


def six_pockets(length: float = POOL_LENGTH, width: float = POOL_WIDTH) -> tuple[Pocket, ...]:
    """Returns four corner and two side pockets, centred on the cushion lines of a table of `length` x `width` (m)."""
    x, y = length / 2, width / 2
    corners = [Pocket(sx * x, sy * y, _CORNER_MOUTH / 2) for sx in (-1, 1) for sy in (-1, 1)]
    sides = [Pocket(0.0, sy * y, _SIDE_MOUTH / 2) for sy in (-1, 1)]
    return (*corners, *sides)


@dataclasses.dataclass(frozen=True, slots=True)
class Table:
    """A table: a closed outline of cushions, with or without pockets.

    Without an outline the cushions are the rectangle of `length` and `width`. With one, this rectangle is the playing
    surface: the outline has corners on all four lines x = +-length / 2 and y = +-width / 2, and the jaws of the pockets
    lie outside it. Spots, racks and random positions are inside the rectangle.

    Attributes:
        length: Length of the playing surface, from nose to nose of the cushions (along x), m.
        width: Width of the playing surface (along y), m.
        cushion_height: Height of the cushions' noses above the cloth, m; "restitution" cushions do not use it.
        pockets: The pockets, for example `six_pockets()`; empty by default.
        outline: The corners of the cushions, counter-clockwise, see `scene.outline`; empty for the rectangle.
        head_string: x of the head string (baulk line), m; None for -length / 4.
        d_radius: Radius of the D behind the head string, m; 0 for a table without a D.
    """

    length: float = POOL_LENGTH
    width: float = POOL_WIDTH
    cushion_height: float = _POOL_CUSHION
    pockets: tuple[Pocket, ...] = ()
    outline: tuple[Corner, ...] = ()
    head_string: float | None = None
    d_radius: float = 0.0

    def __post_init__(self) -> None:
        check_fields(self, "table", length="length", width="length", cushion_height="cushion_height")
        for name, kind in (("pockets", Pocket), ("outline", Corner)):
            values = getattr(self, name)
            if not isinstance(values, tuple):
                raise TypeError(f"table.{name} = {short(values)}: expected a tuple of {kind.__name__} objects")
            for k, value in enumerate(values):
                if not isinstance(value, kind):
                    raise TypeError(f"table.{name}[{k}] = {short(value)}: expected a {kind.__name__}")
        if self.outline:
            self._check_outline()
        for k, p in enumerate(self.pockets):
            x, y, radius = p.circle
            if self.outline:
                reaches = self.clearance((x, y)) > -radius
            else:
                reaches = abs(x) <= self.length / 2 + radius and abs(y) <= self.width / 2 + radius
            if not reaches:
                raise ValueError(
                    f"table.pockets[{k}] = {p}: expected a circle that reaches the table "
                    f"({self.length:g} x {self.width:g} m, centred on the origin); pool_table makes pockets for a size"
                )
        self._check_markings()

    def _check_outline(self) -> None:
        check_outline(self.outline)
        for side, axis in (("length", "x"), ("width", "y")):
            half = getattr(self, side) / 2
            values = [getattr(corner, axis) for corner in self.outline]
            if not all(any(abs(value - line) <= TOUCH for value in values) for line in (-half, half)):
                raise ValueError(
                    f"table.{side} = {getattr(self, side)}: expected corners of the outline at {axis} = {-half} and "
                    f"{half}, on both sides of the playing surface (the corners reach from {min(values)} to "
                    f"{max(values)})"
                )

    def _check_markings(self) -> None:
        half = self.length / 2
        if self.head_string is not None:
            object.__setattr__(self, "head_string", real("table.head_string", self.head_string))
            if not abs(self.head_x) < half:
                raise ValueError(
                    f"table.head_string = {self.head_string}: expected a number between {-half} and {half}"
                )
        object.__setattr__(self, "d_radius", real("table.d_radius", self.d_radius))
        most = min(half + self.head_x, self.width / 2)
        if not 0.0 <= self.d_radius < most:
            raise ValueError(
                f"table.d_radius = {self.d_radius}: expected 0 or a number below {short(most)}, inside the cushions"
            )

    def clearance(self, points: ArrayLike) -> NDArray[np.float64]:
        """Returns the distances (...) of points (..., 2) from the nearest cushion, m; negative outside the table.

        Outside a rectangle it is minus the distance from the farthest of the four lines on which the cushions lie.
        """
        places = _places(points)
        if self.outline:
            return clearance(self.outline, places)
        return (np.array([self.length / 2, self.width / 2]) - np.abs(places)).min(axis=-1)

    @property
    def pocket_rows(self) -> NDArray[np.float64]:
        """(p, 3) the numbers of the pockets that compiled functions read, see `physics.geometry.pockets`."""
        return np.array([dataclasses.astuple(pocket) for pocket in self.pockets], float).reshape(-1, 3)

    @property
    def pocket_places(self) -> NDArray[np.float64]:
        """(p, 2) the places of the pockets, at which potted balls stay, m."""
        return np.array([(pocket.x, pocket.y) for pocket in self.pockets], float).reshape(-1, 2)

    @property
    def head_x(self) -> float:
        """X of the head string (baulk line), m. The cue ball starts behind it."""
        return -self.length / 4 if self.head_string is None else self.head_string

    @property
    def foot_x(self) -> float:
        """X of the foot spot, m, where racks begin."""
        return self.length / 4

    @property
    def is_rectangular(self) -> bool:
        """Whether no cushion reaches into the rectangle of `length` and `width`."""
        return not (self.outline and enters(self.outline, self.length / 2, self.width / 2))

    @classmethod
    def named(cls, name: str) -> Table:
        """Returns the table of a given name.

        Args:
            name: "pool_7ft", "pool_8ft", "pool_9ft", "snooker_12ft", "uk_7ft" or "carom_10ft".

        Raises:
            ValueError: If the name is unknown.

        Example:
            >>> table = Table.named("pool_9ft")
            >>> table.length, len(table.pockets), len(table.outline)
            (2.54, 6, 24)
        """
        one_of("table", name, TABLES)
        return _NAMED[name]()

    @classmethod
    def from_dict(cls, data: Mapping[str, Any], name: str = "table") -> Table:
        """Builds a table from plain data, as read from YAML or JSON.

        Args:
            data: A mapping with the fields of `Table` as keys. `pockets` and `outline` are lists of mappings with the
                fields of `Pocket` and `Corner`. All fields are optional.
            name: Name used in error messages.

        Raises:
            ValueError: If a key is unknown or missing, or the data is not a table.
            TypeError: If a value has the wrong type.

        Example:
            >>> corners = [{"x": -1, "y": -0.5}, {"x": 1, "y": -0.5}, {"x": 0, "y": 0.5}]
            >>> len(Table.from_dict({"length": 2, "width": 1, "outline": corners}).outline)
            3
        """
        fields = fields_of(Table, name, data)
        for key, kind in (("pockets", Pocket), ("outline", Corner)):
            if key in fields:
                values = sequence(f"{name}.{key}", fields[key])
                fields[key] = tuple(kind(**fields_of(kind, f"{name}.{key}[{k}]", v)) for k, v in enumerate(values))
        return cls(**fields)


class Jaws(NamedTuple):
    """The jaws of a pocket and its hole. The facings are the cushions at its sides, the tips their rounded ends.

    Attributes:
        mouth: Distance between the corners of the jaws before they are rounded, m.
        angle: Angle by which the facings narrow the pocket, degrees, measured from the diagonal in a corner and from
            the perpendicular at a side.
        tip_radius: Radius of the tips, m.
        radius: Radius of the hole, m.
        depth: Distance of the hole's centre from the corner or the side of the playing surface, m.
    """

    mouth: float
    angle: float
    tip_radius: float
    radius: float
    depth: float


def pool_table(
    length: float,
    width: float,
    cushion_height: float,
    cushion_depth: float,
    corner: Jaws,
    side: Jaws,
    head_string: float | None = None,
    d_radius: float = 0.0,
) -> Table:
    """Returns a table with six pockets and their jaws.

    The construction follows pooltool 0.6.0 (objects/table/layout.py), but each facing is tangent to its tip. A line
    behind each pocket closes the outline. No ball reaches this line, because its centre enters the hole first.

    Args:
        length: Length of the playing surface, from nose to nose of the cushions (along x), m.
        width: Width of the playing surface (along y), m.
        cushion_height: Height of the cushions' noses above the cloth, m; "restitution" cushions do not use it.
        cushion_depth: Depth of the facings behind the noses, m.
        corner: The jaws of the corner pockets.
        side: The jaws of the side pockets.
        head_string: x of the head string (baulk line), m; None for -length / 4.
        d_radius: Radius of the D behind the head string, m; 0 for a table without a D.

    Raises:
        ValueError: If the jaws do not fit together or a number is outside its range.
    """
    x, y = length / 2, width / 2
    reach = corner.mouth * math.cos(math.pi / 4)  # from the corner of the playing surface to the tips
    angle = math.radians(side.angle)
    # Large tips at the sides need deeper facings, here with a straight end of 1 mm.
    depth = max(cushion_depth, side.tip_radius * math.tan(math.pi / 4 - angle / 2) * math.cos(angle) + 1e-3)
    narrow, back = depth * math.tan(math.radians(45 + corner.angle)), side.mouth / 2 - depth * math.tan(angle)
    quarter = [  # the outline in the quadrant x > 0, y > 0
        (x, y - reach, corner.tip_radius),
        (x + depth, y - reach + narrow, 0.0),
        (x - reach + narrow, y + depth, 0.0),
        (x - reach, y, corner.tip_radius),
        (side.mouth / 2, y, side.tip_radius),
        (back, y + depth, 0.0),
    ]
    half = quarter + [(-cx, cy, radius) for cx, cy, radius in reversed(quarter)]
    outline = half + [(-cx, -cy, radius) for cx, cy, radius in half]
    away = corner.depth / math.sqrt(2)
    corners = [Pocket(sx * (x + away), sy * (y + away), corner.radius) for sx in (-1, 1) for sy in (-1, 1)]
    sides = [Pocket(0.0, sy * (y + side.depth), side.radius) for sy in (-1, 1)]
    return Table(
        length,
        width,
        cushion_height,
        (*corners, *sides),
        tuple(Corner(*values) for values in outline),
        head_string,
        d_radius,
    )


_SHOWOOD_TIPS = 0.02095, 0.00795  # m, the radii of the tips of "pool_7ft", at the corners and at the sides
_UK_BALL, _SNOOKER_BALL = 0.0508, 0.0525  # m, diameters


def _wpa(length: float, width: float) -> Table:
    corner_tip, side_tip = _SHOWOOD_TIPS
    hole, corner_shelf, side_shelf = 0.062, 1.625 * INCH, 0.16 * INCH
    return pool_table(
        length,
        width,
        _POOL_CUSHION,
        2 * INCH,
        Jaws(_CORNER_MOUTH, 142 - 135, corner_tip, hole, corner_shelf + hole - _CORNER_MOUTH / 2),
        Jaws(_SIDE_MOUTH, 104 - 90, side_tip, hole, side_shelf + hole),
    )


def _pool_7ft() -> Table:
    corner_tip, side_tip = _SHOWOOD_TIPS
    corner = Jaws(0.118, 5.3, corner_tip, 0.062, 0.0417)
    # pooltool's numbers are 0.137 and 7.14 degrees, but its facings are not tangent to the tips. These have the same
    # tips, and the facings agree to 1e-8 m.
    side = Jaws(0.13698431538587222, 7.076486391233761, side_tip, 0.0645, 0.0685)
    return pool_table(1.9812, 0.9906, 0.036576, 0.0508, corner, side)


_SNOOKER_JAWS = Jaws(0.08014, 0.0, 0.0889, 0.0889, 0.06735), Jaws(0.08457, 0.0, 0.0669, 0.05319, 0.05159)
_SNOOKER_DEPTH = 0.04763  # m, of the cushions of "snooker_12ft"


def _snooker_12ft() -> Table:
    length = 3.569
    return pool_table(length, 1.778, 0.7 * _SNOOKER_BALL, _SNOOKER_DEPTH, *_SNOOKER_JAWS, 0.737 - length / 2, 0.292)


def _uk_7ft() -> Table:
    length, scale = 1.8288, _UK_BALL / _SNOOKER_BALL
    corner, side = (
        Jaws(1.6 * _UK_BALL, 0.0, scale * jaws.tip_radius, scale * jaws.radius, scale * jaws.depth)
        for jaws in _SNOOKER_JAWS
    )
    return pool_table(length, 0.9144, 0.635 * _UK_BALL, scale * _SNOOKER_DEPTH, corner, side, length / 5 - length / 2)


_NAMED: dict[str, Callable[[], Table]] = {
    "pool_7ft": _pool_7ft,
    "pool_8ft": lambda: _wpa(92 * INCH, 46 * INCH),
    "pool_9ft": lambda: _wpa(POOL_LENGTH, POOL_WIDTH),
    "snooker_12ft": _snooker_12ft,
    "uk_7ft": _uk_7ft,
    "carom_10ft": lambda: Table(2.84, 1.42, 0.037),
}
TABLES = tuple(_NAMED)
