"""Colours and geometry of all pictures.

`draw_table` describes a table as coloured polygons and `tray` places the potted balls. The plot, the frames and the
page draw these descriptions.

The palette "colour_blind" has the ball colours of Okabe and Ito (2008), which colour-blind readers can
distinguish, in the order of pool balls. The seventh is wine from Tol (2021) and the eighth is black. Those of the
palette "realistic" are near the colours of real balls. Balls 9 to 15 are striped, and each object ball of pool has its
number, so no information depends on colour alone. Paths have lighter colours, which are visible on the cloth. The faces
of the balls have marks that turn with the balls; `LIGHT` to `SHINE` shade them.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_env.scene import Scene
from billiards_env.scene.outline import TOUCH, Circle, cushion_lines, pieces, polygon
from billiards_env.scene.table import Pocket, Table
from billiards_env.support.checks import one_of

CLOTH, MOUTH, CUSHION, CUSHION_EDGE = "#1c6049", "#114031", "#2f8163", "#123d2f"
RAIL, RAIL_EDGE, POCKET_RIM, POCKET = "#5a3a22", "#3b2413", "#28180d", "#0c0c0c"
MARKING = "#84b8a2"
PAPER, INK, CHALK, GREY = "#ffffff", "#1a1a1a", "#ffffff", "#6b6b6b"

TEXT = "#808080"
"""The colour of text and lines outside the table: a grey with the same contrast to white and to a dark page."""

ARROW, ARROW_START = 0.09, 1.4
"""Length of an arrow over the speed, s; distance of its start from the ball's centre over the radius."""

STRIPE, DISC, DOT, SPOT = 0.56, 0.5, 0.2, 0.12
"""Marks on the face of a ball of radius 1: half the width of the band, and the radii of the white disc of the number,
of the dots of a cue ball and of the white spots of a snooker ball."""

DOTS = tuple(
    (s * math.cos(angle) * math.sqrt(2 / 3), s * math.sin(angle) * math.sqrt(2 / 3), s * math.sqrt(1 / 3))
    for angle in (math.pi / 2, 7 * math.pi / 6, 11 * math.pi / 6)
    for s in (1, -1)
)
"""Directions of the dots: the axes of a cube that stands on a corner."""

LIGHT, AMBIENT, DIFFUSE, DARKEST = (-0.37, 0.45, 0.81), 0.34, 0.9, 0.25
"""The direction to the light, and the brightness ambient + diffuse cos(angle to the light), from `DARKEST` to 1."""

SHINE, SHINE_POWER, SHINE_LIGHT = (-0.4, 0.45, 0.8), 90, 0.8
"""The normal of the reflection of the lamp, the power of the cosine of the angle to it, and its largest brightness."""

SHADOW, SHADOW_REACH, SHADOW_DARK = (0.22, -0.28), (0.7, 1.3), 0.5
"""The shadow of a ball of radius 1: its centre, the radii at which it begins and ends to fade, and its opacity."""

LIFT, SPREAD = 1.5, 0.15
"""A ball of radius R at the height z, m, is drawn 1 + LIFT z times as large; LIFT is in 1/m. Its shadow moves away from
the light and becomes 1 + SPREAD z / R times as wide, and fainter."""

POTTED = "potted"
"""The label of the tray."""

# The fill of each colour of a ball and the colour of its path: for colour-blind readers, and near those of real balls.
_COLOURS = {
    "yellow": ("#f0e442", "#f0e442", "#f6c714", "#f6c714"),
    "blue": ("#0072b2", "#6cbcf0", "#1d4fb4", "#7fb2f5"),
    "vermilion": ("#d55e00", "#ff8f4d", "#c0281c", "#ff8a80"),
    "purple": ("#cc79a7", "#eba6cb", "#5b2a91", "#c3a1e8"),
    "orange": ("#e69f00", "#e69f00", "#ee7623", "#ff9d5c"),
    "green": ("#009e73", "#4fd6ac", "#0b6b3a", "#5fdca0"),
    "wine": ("#882255", "#c9a0dc", "#7c1d2b", "#dd95a2"),
    "black": ("#1c1c1c", "#b8bfbc"),
    "brown": ("#7a4a1e", "#d9a066"),
    "pink": ("#eba6cb", "#eba6cb"),
    "red": ("#c0281c", "#ff8a80"),
    "grey": (GREY, GREY),
}
PALETTES = {
    "colour_blind": {name: colours[:2] for name, colours in _COLOURS.items()},
    "realistic": {name: colours[-2:] for name, colours in _COLOURS.items()},
}
"""The colours of the balls, by palette and by name."""

_POOL = ("yellow", "blue", "vermilion", "purple", "orange", "green", "wine", "black")
_SNOOKER = ("yellow", "green", "brown", "blue", "pink", "black")
_DARK = ("blue", "wine", "black", "brown", "red", "grey")

KINDS = {
    "ball_ball": "hits ball",
    "cushion": "hits a cushion",
    "pocket": "is potted",
    "sliding_rolling": "begins to roll",
    "rolling_rest": "stops",
    "spinning_rest": "stops spinning",
    "rolling_slower": "rolls more slowly",
    "landing": "lands",
    "off_table": "is driven off the table",
}
"""The text of each event kind, after the name of the ball."""


def cushion_names(table: Table) -> list[str]:
    """Returns the name of each cushion, by its number in the events of a shot."""
    half_x, half_y = table.length / 2, table.width / 2
    sides = {(0, -half_x): "left", (0, half_x): "right", (1, -half_y): "lower", (1, half_y): "upper"}
    if not table.outline:
        return [f"the {name} cushion" for name in sides.values()]
    lines, tips = pieces(table.outline)
    names = []
    for line in lines:
        ends = line[:2], line[2:]
        side = [name for (axis, place), name in sides.items() if all(abs(end[axis] - place) <= TOUCH for end in ends)]
        x, y = (line.x0 + line.x1) / 2, (line.y0 + line.y1) / 2
        if ends[0] != ends[1]:
            jaw = abs(x) > half_x or abs(y) > half_y
            names.append(f"the {side[0]} cushion" if side else "a facing" if jaw else "a cushion")
    return names + ["a tip"] * len(tips)


class Look(NamedTuple):
    """The appearance of a ball.

    Attributes:
        fill: Colour of the ball.
        ink: Colour of its number.
        path: Colour of its path, visible on the cloth.
        striped: Whether only a band has the colour.
        number: What is written on the ball: its number, or the name of the colour of a ball with dots if no other
            ball has it; empty for the cue ball.
        dots: Colour of the dots on its face; empty for a face with the number.
        dot: Radius of the dots over the radius of the ball.
    """

    fill: str
    ink: str
    path: str
    striped: bool
    number: str
    dots: str = ""
    dot: float = 0.0


def colour_names(scene: Scene) -> tuple[str, ...]:
    """Returns the name of the colour of each ball, see `Balls.colours`."""
    n = scene.n_balls - 1
    names = {
        "snooker": ("red",) * (n - 6) + _SNOOKER[-n:],
        "uk": ("red",) * 7 + ("black",) + ("yellow",) * n,
        "pool": ("red", "yellow") if _is_carom(scene) else _POOL * n,
    }
    return ("white", *names[scene.balls.colours][:n])


def _is_carom(scene: Scene) -> bool:
    return scene.balls.colours == "pool" and not scene.table.pockets and scene.n_balls <= 3


def looks(scene: Scene, palette: str = "colour_blind") -> tuple[Look, ...]:
    """Returns the look of each ball in one of `PALETTES`; fixed balls are grey."""
    one_of("palette", palette, tuple(PALETTES))
    colours, carom = scene.balls.colours, _is_carom(scene)
    dot_red, *_ = _COLOURS["red"]
    balls = [Look(CHALK, INK, "#d2dbd6", False, "", dot_red, DOT)]
    names = colour_names(scene)
    for i, name in enumerate(names[1:], start=1):
        name = "grey" if math.isinf(scene.balls.mass[i]) else name
        fill, path = PALETTES[palette][name]
        striped = name != "grey" and colours == "pool" and not carom and i % 16 > 8
        plain = colours == "snooker" or (colours == "uk" and name != "black")
        dots = ("", 0.0)
        if carom or plain:
            dots = (dot_red if carom else INK) if name == "yellow" else CHALK, DOT if carom else SPOT
        text = str(i) if not dots[0] else name if names.count(name) == 1 else ""
        balls.append(Look(fill, CHALK if name in _DARK else INK, path, striped, text, *dots))
    return tuple(balls)


class Shape(NamedTuple):
    """A filled polygon of the drawn table: (m, 2) corners, m, and the colour."""

    corners: NDArray[np.float64]
    colour: str


def draw_table(table: Table) -> list[Shape]:
    """Returns the polygons of a table in the order in which they are drawn.

    A pocket is a dark hole in the rail. The circle of the physics, which captures the balls, is drawn to scale: as the
    edge of the hole between the jaws of an outline, or as the mouth of the pocket, dark cloth between the cushions, on
    a plain rectangle.
    """
    rail = rail_width(table)
    holes = [_hole(table, pocket) for pocket in table.pockets]
    shapes = [_box(table, rail, RAIL_EDGE, 0.6 * rail), _box(table, 0.93 * rail, RAIL, 0.54 * rail)]
    shapes += _draw_outline(table, holes) if table.outline else _draw_rectangle(table, holes)
    if table.head_string is not None:
        shapes += _draw_markings(table)
    elif table.is_rectangular:
        shapes += _draw_diamonds(table, holes)
    return shapes


def _draw_rectangle(table: Table, holes: list[Circle]) -> list[Shape]:
    """Returns the cloth, the cushions and the pockets of a table without an outline."""
    unit = _unit(table)
    margins = (0.031, CUSHION_EDGE), (0.028, CUSHION), (0.0, CUSHION_EDGE), (-0.003, CLOTH)
    shapes = [_box(table, margin * unit, colour) for margin, colour in margins]
    for pocket, (x, y, radius) in zip(table.pockets, holes, strict=True):
        outwards = math.atan2(y - pocket.y, x - pocket.x)
        inner = pocket.rim(outwards + math.pi / 2, math.pi)
        outer = _arc(x, y, radius, outwards - math.pi / 2, math.pi)
        shapes.append(Shape(_arc(x, y, 1.16 * radius), POCKET_RIM))
        shapes.append(Shape(np.vstack((inner, outer)), MOUTH))
    return shapes + [Shape(_arc(*hole), POCKET) for hole in holes]


def _draw_outline(table: Table, holes: list[Circle]) -> list[Shape]:
    """Returns the cloth, the cushions and the pockets of a table with an outline."""
    unit, cushions, cloth = _unit(table), cushion_lines(table.outline), polygon(table.outline)
    behind = [_line_behind(table, pocket) for pocket in table.pockets]
    hidden = {tuple(line.ravel()) for line in behind if line is not None}
    begins = np.cumsum([0, *(len(run) - 1 for run in cushions)]).tolist()
    shapes = []
    for depth, colour in ((0.031, CUSHION_EDGE), (0.028, CUSHION), (0.003, CUSHION_EDGE)):
        outer = _inset(cloth, depth * unit)
        for k, run in zip(begins, cushions, strict=False):
            if len(run) == 2 and tuple(run.ravel()) not in hidden:
                ends = [k, (k + 1) % len(cloth)]
                shapes.append(Shape(np.vstack((cloth[ends], outer[ends[::-1]])), colour))
    shapes += [Shape(_arc(x, y, 1.16 * radius), POCKET_RIM) for x, y, radius in holes]
    shapes += [Shape(_arc(*hole), POCKET) for hole in holes]
    shapes.append(Shape(cloth, CLOTH))
    for pocket, line in zip(table.pockets, behind, strict=True):
        shapes.append(Shape(_fall(table, pocket, line), POCKET))
    for run in cushions:
        if len(run) > 2:
            shapes += [Shape(run, CUSHION_EDGE), Shape(_inset(run, 0.003 * unit), CUSHION)]
    return shapes


def _line_behind(table: Table, pocket: Pocket) -> NDArray[np.float64] | None:
    """Returns the ends (2, 2) of the line of an outline behind a pocket, m; None if there is none."""
    for run in cushion_lines(table.outline):
        if len(run) == 2 and pocket.contains(run.mean(0)):
            return run
    return None


def _fall(table: Table, pocket: Pocket, line: NDArray[np.float64] | None) -> NDArray[np.float64]:
    """Returns the hole of a pocket between its jaws: the circle of the physics up to the line behind the pocket.

    Two points beyond this line avoid a seam between this polygon and the hole in the rail.
    """
    if line is None:
        return pocket.rim()
    way = line[1] - line[0]
    circle = pocket.rim(math.atan2(way[0], -way[1]) - math.pi, points=240)
    beyond = line.mean(0) + np.outer((-0.4, 0.4), way) + 0.2 * np.array([way[1], -way[0]])
    return np.vstack((line[0], beyond, line[1], circle[table.clearance(circle) > 0.0]))


def _inset(points: NDArray[np.float64], distance: float) -> NDArray[np.float64]:
    """Returns a clockwise polygon (m, 2) with its sides moved inwards; the sides of other polygons move outwards."""
    ways = np.roll(points, -1, axis=0) - points
    after = np.column_stack((ways[:, 1], -ways[:, 0])) / np.hypot(*ways.T)[:, None]
    before = np.roll(after, 1, axis=0)
    return points + distance * (before + after) / (1.0 + (before * after).sum(1))[:, None]


def _draw_diamonds(table: Table, holes: list[Circle]) -> list[Shape]:
    """Returns the diamonds on the rail that do not overlap a hole."""
    away, size = _depth(table) + 0.6 * (rail_width(table) - _depth(table)), 0.008 * _unit(table)
    x, y = table.length / 2, table.width / 2
    places = [(k * x / 4, s * (y + away)) for k in range(-3, 4) for s in (-1, 1)]
    places += [(s * (x + away), k * y / 2) for k in (-1, 0, 1) for s in (-1, 1)]
    diamond = size * np.array([[-1, 0], [0, 1], [1, 0], [0, -1]])
    return [
        Shape(np.array(place) + diamond, CHALK)
        for place in places
        if all(math.dist(place, hole[:2]) > 1.5 * hole[2] for hole in holes)
    ]


def _draw_markings(table: Table) -> list[Shape]:
    """Returns the baulk line and the D."""
    x, y, half = table.head_x, table.width / 2, 0.002 * _unit(table)
    shapes = [Shape(np.array([[x - half, -y], [x + half, -y], [x + half, y], [x - half, y]]), MARKING)]
    if table.d_radius:
        outer, inner = (_arc(x, 0.0, table.d_radius + s * half, math.pi / 2, math.pi, 120) for s in (1, -1))
        shapes.append(Shape(np.vstack((outer, inner[::-1])), MARKING))
    return shapes


def _depth(table: Table) -> float:
    """Returns the depth of the jaws behind the playing surface, m; 0 for a plain rectangle."""
    reach = [max(abs(c.x) - table.length / 2, abs(c.y) - table.width / 2) for c in table.outline]
    return max(reach, default=0.0)


def rail_width(table: Table) -> float:
    """Returns the width of the drawn rail, m, which contains all pockets."""
    half = table.length / 2, table.width / 2
    holes = [_hole(table, pocket) for pocket in table.pockets]
    reach = [abs(c) + 1.25 * radius - h for *centre, radius in holes for c, h in zip(centre, half, strict=True)]
    return max(0.08 * _unit(table), _depth(table) + 0.06 * _unit(table), *reach)


class Tray(NamedTuple):
    """The groove of the potted balls, with its label on the left, in the unit of the arguments of `tray`.

    Attributes:
        radius: Radius of the balls.
        half: Half the length of the groove.
        x: (n,) places of the balls from the centre of the groove, in the order in which they are filled.
    """

    radius: float
    half: float
    x: list[float]


def tray(n: int, width: float, height: float) -> Tray:
    """Returns the tray of n balls in the middle of a strip of `width` x `height` under the table."""
    radius = min(0.3 * height, 0.125 * width / n)
    return Tray(radius, (1.2 * n + 0.3) * radius, [2.4 * radius * (k - (n - 1) / 2) for k in range(n)])


def tray_height(table: Table) -> float:
    """Returns the height of the strip of the tray under a table in a plot and in a page, m; 0 without pockets."""
    return 0.09 * _unit(table) if table.pockets else 0.0


def _unit(table: Table) -> float:
    """Returns the width of a table of the same area that is twice as long as wide, m."""
    return math.sqrt(table.length * table.width / 2)


def _hole(table: Table, pocket: Pocket) -> tuple[float, float, float]:
    """Returns the centre and the radius of the hole of a pocket, which lies further outside than the pocket."""
    if table.outline:
        line = _line_behind(table, pocket)
        if line is None:
            return pocket.circle
        x, y = line.mean(0).tolist()
        return x, y, 0.53 * math.hypot(*(line[1] - line[0]))
    x, y, r = pocket.circle
    shift = [
        math.copysign(0.45 * min(max(abs(c) + r - side / 2, 0.0), r), c)
        for c, side in ((x, table.length), (y, table.width))
    ]
    return x + shift[0], y + shift[1], r - 0.36 * math.hypot(*shift)


def _arc(
    x: float, y: float, radius: float, start: float = 0.0, angle: float = 2 * math.pi, points: int = 40
) -> NDArray[np.float64]:
    angles = start + angle * (np.arange(points) + 0.5) / points
    return np.column_stack((x + radius * np.cos(angles), y + radius * np.sin(angles)))


def _box(table: Table, margin: float, colour: str, corner: float = 0.0) -> Shape:
    """Returns a rectangle at a distance from the cushions, with round corners."""
    circle = _arc(0.0, 0.0, 1.0)
    half = np.array([table.length, table.width]) / 2 + margin - corner
    return Shape(corner * circle + half * np.sign(circle), colour)
