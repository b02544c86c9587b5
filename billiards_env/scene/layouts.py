"""Layouts: starting positions of the balls, drawn for a scene with a random generator.

`draw(name, scene, rng)` returns (n, 2) float64 positions in m that `check_positions` accepts. It raises a `ValueError`
if the layout does not suit the scene's balls. The head of the table is its -x end, where the cue ball starts; the foot
is its +x end. The foot spot lies at a quarter of the table's length from the centre. `Table.head_x` is the x of the
head string, which is called baulk line in snooker. All balls lie inside the rectangle of the table's length and width.

"random"
    Balls anywhere on the table. They are placed one after the other, the largest first, uniformly in the free area
    (random sequential addition, Widom 1966), at least `PLACING_GAP` from other balls, cushions and pockets.
"rack"
    Cue ball anywhere behind the head string, object balls in a loose rack at the foot spot. The rack is a triangle that
    is filled row by row from the foot spot, or a diamond for 9 object balls. Each ball is displaced at random so that
    the gaps between neighbours lie within `RACK_GAP`. Balls of several sizes are spaced for the largest object ball.
"tight_rack"
    As "rack", but neighbours touch: their gap is 0 up to the rounding of the coordinates. The object balls must have
    one radius.
"nine_ball"
    As "rack" with 9 object balls: the 1 at the foot spot, the 9 in the middle and the others in a random order (WPA
    2016, rule 2.2).
"nine_ball_2025"
    As "nine_ball", with the 9 on the foot spot (WPA 2025, rule 5.2).
"ten_ball"
    As "rack" with 10 object balls: the 1 at the foot spot, the 10 in the middle of the row of three and the others in a
    random order (WPA 2016, rule 9.2).
"eight_ball"
    As "rack" with 15 object balls: the 8 in the middle of the third row, a ball of each group (1 to 7 and 9 to 15) at
    the rear corners, and the others in a random order (WPA 2016, rule 3.2).
"carom_opening"
    The fixed opening position of carom billiards (UMB 1989, art. 23), for one or two object balls: the cue ball on the
    right starting spot, ball 1 (the red ball) on the foot spot, ball 2 (the opponent's cue ball) on the head spot.
"snooker"
    The start of a frame of snooker: the last six object balls (yellow, green, brown, blue, pink, black) on their spots
    (WPBSA, Official Rules of Snooker, section 3), the others (15 red balls) in a tight rack behind the pink ball, and
    the cue ball anywhere in the D.
"line"
    Cue ball and object ball on the long axis of the table, at a quarter and at three quarters of its length.
"snookered"
    Cue ball and ball 1 anywhere, as in "random", and ball 2 midway between them; all are drawn again until ball 2 fits.
    Ball 2 must be at least as large as ball 1, so it hides ball 1 completely: a straight path that passes the centre of
    ball 1 at a distance b passes the centre of ball 2, half as far away, at b / 2. On a path that meets ball 1,
    b <= r0 + r1, so b / 2 < r0 + r2, and the cue ball meets ball 2 first.

`layout_plan` computes once what a layout needs on a scene. One kernel draws the positions from a plan, for one table
or for many. The kernel draws numbers from [0, 1) and uses only `+ - * /` on doubles, whose rounding IEEE 754 defines.
The same seed therefore gives the same layout bit for bit.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from types import FunctionType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_env.jit import Typed, entry_point, inlined, kernel, streams
from billiards_env.jit.interrupt import end_call, interrupted
from billiards_env.scene import Scene, check_positions, check_scene
from billiards_env.scene.outline import pieces
from billiards_env.support.checks import (
    Range,
    add_entry,
    check_call,
    finite,
    integer,
    key_of,
    one_of,
    real,
    result_of,
    shaped,
    short,
    short_name,
)

Floats = NDArray[np.float64]

PLACING_GAP = 1e-3
"""m. Smallest gap between a randomly placed ball and other balls, cushions and pockets."""

RACK_GAP = (1e-4, 5e-4)
"""m. Smallest and largest gap between neighbours in a loose rack."""

_TRIES = 10_000
_BALLS_PER_CHECK = 5000  # an interrupt is checked after this number of balls: a millisecond, or more on a full table

# World Rules of Carom Billiard (UMB 1989), art. 13: the two starting spots lie 18.25 cm either side of the head spot
# on a table 1.42 m wide; on other tables they scale with the width.
_STARTING_SPOT = 0.1825 / 1.42

# WPBSA: the black ball lies 324 mm from the cushion of a table 3569 mm long; on other tables this scales. The red balls
# are as close to the pink ball as possible without touching it.
_BLACK_SPOT, _PINK_GAP = 0.324 / 3.569, 5e-4


class Rack(NamedTuple):
    """The order of the balls in the rack of a game.

    Attributes:
        balls: The ball at each place, row by row from the foot spot, before the balls that are not fixed change places
            at random.
        fixed: The balls that keep their places.
        corners: For the left and the right rear corner: the ball of `balls` there, and the group from which the ball of
            the corner is drawn. The corners change sides with probability 1/2.
        foot_ball: The ball on the foot spot; 0 for the first of `balls`.
    """

    balls: tuple[int, ...]
    fixed: tuple[int, ...]
    corners: tuple[tuple[int, range], ...] = ()
    foot_ball: int = 0


RACKS = {
    "nine_ball": Rack((1, 2, 3, 4, 9, 6, 7, 8, 5), fixed=(1, 9)),
    "nine_ball_2025": Rack((1, 2, 3, 4, 9, 6, 7, 8, 5), fixed=(1, 9), foot_ball=9),
    "ten_ball": Rack((1, 2, 3, 4, 10, 6, 7, 8, 9, 5), fixed=(1, 10)),
    "eight_ball": Rack(
        (11, 2, 3, 4, 8, 6, 7, 5, 9, 10, 1, 12, 13, 14, 15), fixed=(8,), corners=((1, range(1, 8)), (15, range(9, 16)))
    ),
}
"""The games with rules for the order of the balls in a rack. Each is also the name of a layout.

In nine ball the rules of 2025 rack the 9 on the foot spot (WPA 2025 5.2), and those of 2016 the 1 (WPA 2.2).
"""


def draw(name: str, scene: Scene, rng: np.random.Generator, game: str = "") -> Floats:
    """Draws a layout.

    Args:
        name: One of `LAYOUTS`.
        scene: The scene.
        rng: The generator to draw from.
        game: The layouts "rack" and "tight_rack" have the order of this game if it is one of `RACKS`.

    Returns:
        (n, 2) positions, m.

    Raises:
        ValueError: If the name is unknown, the layout does not suit the scene's balls, or a ball finds no free position
            in 10,000 tries.

    Example:
        >>> draw("tight_rack", Scene.named("pool", 15), np.random.default_rng(0))[1].tolist()
        [0.635, 0.0]
        >>> cue, target, blocker = draw("snookered", Scene.named("blocked_pool"), np.random.default_rng(0))
        >>> bool((blocker == (cue + target) / 2).all())
        True
    """
    return draw_one(layout_plan(name, scene, game), rng)


class LayoutPlan(NamedTuple):
    """The data that a layout needs on a scene: some balls lie at spots, the others are drawn one after the other.

    Attributes:
        layout: Index in `LAYOUTS`.
        spots: (n, 2) float64, m: the spots of the balls that have one, before the displacement.
        displacement: m; the largest displacement of these balls along x and along y.
        order: (n,) int64: the balls that have a spot, then the others in the order in which they are drawn.
        n_spots: Number of balls that have a spot.
        limits: (n, 3) float64, m: smallest x, largest x and largest abs(y) of a drawn ball.
        radius: (n,) float64, m.
        pockets: (k, 3) float64: x, y, radius, m.
        edges: (e, 7) float64, m: the cushions, if one reaches into the rectangle of the table. A row has the ends of a
            straight cushion or of the chord of a tip, and x, y and the radius of a circle: the tip's, or its first end.
        d: x of the centre and radius of the D in which balls are drawn, m; infinite without a D.
        midway: Whether the last ball of the order lies midway between the other two, which have no spots.
        shuffled: The balls of a rack that change places at random, as a bit mask: bit i is ball i.
        corners: (c, 3) int64: for each rear corner of a rack, the ball there, and the first ball and the size of the
            group to draw from, see `Rack`.
    """

    layout: int
    spots: Floats
    displacement: float
    order: NDArray[np.int64]
    n_spots: int
    limits: Floats
    radius: Floats
    pockets: Floats
    edges: Floats
    d: tuple[float, float]
    midway: bool = False
    shuffled: int = 0
    corners: NDArray[np.int64] = np.empty((0, 3), np.int64)


def layout_plan(name: str, scene: Scene, game: str = "") -> LayoutPlan:
    """Returns the plan of a layout.

    Args:
        name: One of `LAYOUTS`.
        scene: The scene.
        game: The layouts "rack" and "tight_rack" have the order of this game if it is one of `RACKS`.

    Returns:
        The plan. Its arrays are shared and must not be changed.

    Raises:
        ValueError: If the name is unknown or the layout does not suit the scene's balls.
    """
    key = key_of("layout", name, LAYOUTS)
    check_scene(scene)
    rack = RACKS.get(short_name(game)) if key in ("rack", "tight_rack") else None
    return _cached_plan(key, scene, LAYOUTS[key], rack)


@functools.lru_cache(maxsize=256)
def _cached_plan(name: str, scene: Scene, make: PlanMaker, rack: Rack | None) -> LayoutPlan:
    plan = (
        result_of(f"layout {name!r}", LayoutPlan, make, name, scene) if rack is None else rack_plan(name, scene, rack)
    )
    _check_plan(f"layout {name!r}", scene, plan)
    return plan


def _check_plan(what: str, scene: Scene, plan: LayoutPlan) -> None:
    """Raises unless a plan, which may be of another package, suits a scene: the kernels check no index."""
    n = scene.n_balls
    sizes = {
        "spots": (n, 2),
        "order": (n,),
        "limits": (n, 3),
        "radius": (n,),
        "corners": (*np.shape(plan.corners)[:1], 3),
    }
    for name, shape in sizes.items():
        array, kind = getattr(plan, name), np.dtype(np.int64 if name in ("order", "corners") else np.float64)
        finite(f"{name} of {what}", array, shape)
        if not isinstance(array, np.ndarray) or array.dtype != kind:
            raise TypeError(f"{name} of {what} = {short(array)}: expected an array of {kind}")
    groups = plan.corners[:, 1:].sum(axis=1)
    for name, value, right in (
        ("order", plan.order, sorted(plan.order) == list(range(n))),
        ("corners", plan.corners, (plan.corners >= 0).all() and (plan.corners[:, 0] < n).all() and (groups <= n).all()),
        ("midway", plan.midway, n == 3 or not plan.midway),
    ):
        if not right:
            raise ValueError(f"{name} of {what} = {short(value)}: expected the balls of a scene with {n} balls")
    integer(f"n_spots of {what}", plan.n_spots, Range(0, n))
    integer(f"shuffled of {what}", plan.shuffled, Range(0, 2**n - 1))
    real(f"displacement of {what}", plan.displacement, Range(0.0, math.inf, "m"))


def _random_plan(name: str, scene: Scene) -> LayoutPlan:
    """Returns the plan of "random": all balls are drawn, the largest first."""
    largest_first = sorted(range(scene.n_balls), key=lambda i: -scene.balls.radius[i])
    return make_plan(name, scene, largest_first, np.zeros((scene.n_balls, 2)))


def _line_plan(name: str, scene: Scene) -> LayoutPlan:
    """Returns the plan of "line"."""
    expect_object_balls(scene, name, 1, 1)
    foot = scene.table.foot_x
    return make_plan(name, scene, (), np.array([(-foot, 0.0), (foot, 0.0)]))


def _carom_plan(name: str, scene: Scene) -> LayoutPlan:
    """Returns the plan of "carom_opening"."""
    expect_object_balls(scene, name, 1, 2)
    foot = scene.table.foot_x
    spots = [(-foot, -_STARTING_SPOT * scene.table.width), (foot, 0.0), (-foot, 0.0)]
    return make_plan(name, scene, (), np.array(spots[: scene.n_balls]))


def draw_one(plan: LayoutPlan, rng: np.random.Generator) -> Floats:
    """Draws a layout from its plan.

    Args:
        plan: The plan.
        rng: The generator to draw from.

    Returns:
        (n, 2) positions, m.

    Raises:
        ValueError: If a ball finds no free position.
    """
    positions = np.empty_like(plan.spots)
    if plan.n_spots == len(positions) and plan.displacement == 0.0:  # nothing to draw
        positions[...] = plan.spots
        return positions
    stream = streams.read(rng)
    _check_filled(plan, fill_tables(tuple(plan), 0, 1, _ONE, stream[None], positions[None]))
    streams.write(rng, stream)
    return positions


class Drawer:
    """Draws a layout for many tables.

    Args:
        plan: The plan.
    """

    def __init__(self, plan: LayoutPlan) -> None:
        self._plan, self._numbers, self._fill = plan, tuple(plan), Typed(fill_tables)

    def draw(
        self, begin: int, end: int, mask: NDArray[np.bool_], table_streams: NDArray[np.uint64], positions: Floats
    ) -> None:
        """Draws positions for the tables `begin` to `end` that are in the mask, each from its own stream.

        Args:
            begin: First table.
            end: One past the last table.
            mask: (m,) bool, the tables to draw for; the others do not change.
            table_streams: (m, 4), one stream per table, changed in place.
            positions: (m, n, 2) float64, m, changed in place.

        Raises:
            ValueError: If a ball finds no free position.
        """
        _check_filled(self._plan, self._fill.call(self._numbers, begin, end, mask, table_streams, positions))


def _check_filled(plan: LayoutPlan, failed: int) -> None:
    if failed >= 0:
        raise _no_room(list(LAYOUTS)[plan.layout], failed, plan.radius[failed])


_ONE = np.ones(1, np.bool_)


@kernel
def is_inside(edges, x, y, reach):
    """Returns whether a point is inside an outline and at least `reach` from it."""
    inside = False
    for k in range(len(edges)):
        dx, dy, least = x - edges[k, 4], y - edges[k, 5], edges[k, 6] + reach
        if dx * dx + dy * dy < least * least:
            return False
        x0, y0 = edges[k, 0], edges[k, 1]
        dx, dy = edges[k, 2] - x0, edges[k, 3] - y0
        square = dx * dx + dy * dy
        share = min(max(((x - x0) * dx + (y - y0) * dy) / square, 0.0), 1.0) if square > 0.0 else 0.0
        ox, oy = x - x0 - share * dx, y - y0 - share * dy
        if ox * ox + oy * oy < reach * reach:
            return False
        if (y0 > y) != (edges[k, 3] > y) and x < x0 + dx * ((y - y0) / dy):  # the ray towards +x crosses the edge
            inside = not inside
    return inside


@inlined
def is_clear(plan, i, x, y, placed, positions):
    """Returns whether ball i at (x, y) is clear of the cushions, the pockets and the first `placed` balls of the order.

    The limits of the plan keep it clear of cushions that are not among its edges.
    """
    if len(plan.edges) > 0 and not is_inside(plan.edges, x, y, plan.radius[i] + PLACING_GAP):
        return False
    for k in range(placed):
        j = plan.order[k]
        dx, dy, reach = x - positions[j, 0], y - positions[j, 1], plan.radius[j] + plan.radius[i] + PLACING_GAP
        if dx * dx + dy * dy < reach * reach:
            return False
    for k in range(len(plan.pockets)):
        dx, dy, reach = x - plan.pockets[k, 0], y - plan.pockets[k, 1], plan.pockets[k, 2] + PLACING_GAP
        if dx * dx + dy * dy < reach * reach:
            return False
    return True


@inlined
def place_ball(plan, i, placed, stream, positions):
    """Draws a position of ball i clear of pockets and of the first `placed` balls; returns whether it found one."""
    x_low, x_high, y_high = plan.limits[i, 0], plan.limits[i, 1], plan.limits[i, 2]
    for _ in range(_TRIES):
        x = x_low + (x_high - x_low) * streams.next_double(stream)
        y = y_high * (2 * streams.next_double(stream) - 1)
        d_x, d_radius = plan.d
        if (x - d_x) * (x - d_x) + y * y > d_radius * d_radius:
            continue
        if is_clear(plan, i, x, y, placed, positions):
            positions[i, 0], positions[i, 1] = x, y
            return True
    return False


@kernel
def draw_midway(plan, stream, positions):
    """Draws the first two balls of the order until the third fits midway; returns -1, or a ball that does not fit."""
    order, limits = plan.order, plan.limits
    a, b, i = order[0], order[1], order[2]
    for _ in range(_TRIES):
        for k in range(2):
            if not place_ball(plan, order[k], k, stream, positions):
                return order[k]
        x, y = 0.5 * (positions[a, 0] + positions[b, 0]), 0.5 * (positions[a, 1] + positions[b, 1])
        fits = limits[i, 0] <= x <= limits[i, 1] and abs(y) <= limits[i, 2]
        if fits and is_clear(plan, i, x, y, 2, positions):
            positions[i, 0], positions[i, 1] = x, y
            return -1
    return i


@entry_point
def fill_tables(plan, begin, end, mask, table_streams, positions):
    """Runs the loop of `Drawer.draw`; returns -1, or a ball that found no free position."""
    plan = LayoutPlan(*plan)
    order, spots, displacement = plan.order, plan.spots, plan.displacement
    balls = 0
    for table in range(begin, end):
        if not mask[table]:
            continue
        balls += len(order)
        if balls > _BALLS_PER_CHECK:
            end_call(interrupted())
            balls = 0
        stream, drawn = table_streams[table], positions[table]
        if plan.midway:
            failed = draw_midway(plan, stream, drawn)
            if failed >= 0:
                return failed
            continue
        for k in range(plan.n_spots):
            i = order[k]
            drawn[i, 0], drawn[i, 1] = spots[i, 0], spots[i, 1]
            if displacement > 0.0:
                drawn[i, 0] += (2 * streams.next_double(stream) - 1) * displacement
                drawn[i, 1] += (2 * streams.next_double(stream) - 1) * displacement
        if plan.shuffled != 0:
            shuffle_rack(plan, stream, drawn)
        for k in range(plan.n_spots, len(order)):
            if not place_ball(plan, order[k], k, stream, drawn):
                return order[k]
    return -1


@kernel
def swap(a, b, positions):
    """Exchanges the positions of two balls."""
    x, y = positions[a, 0], positions[a, 1]
    positions[a, 0], positions[a, 1] = positions[b, 0], positions[b, 1]
    positions[b, 0], positions[b, 1] = x, y


@kernel
def shuffle_rack(plan, stream, positions):
    """Draws the balls at the rear corners of a rack, and permutes the other shuffled balls."""
    balls, corners = plan.shuffled, plan.corners
    if len(corners) == 2 and streams.next_double(stream) < 0.5:
        swap(corners[0, 0], corners[1, 0], positions)
    for k in range(len(corners)):
        chosen = corners[k, 1] + int(corners[k, 2] * streams.next_double(stream))
        swap(corners[k, 0], chosen, positions)
        balls &= ~(1 << chosen)
    shuffle(balls, stream, positions)


@kernel
def shuffle(balls, stream, positions):
    """Permutes the positions of a set of balls, a bit mask, uniformly (Fisher, Yates 1938)."""
    left = 0
    for i in range(len(positions)):
        left += balls >> i & 1
    for i in range(len(positions)):
        if balls >> i & 1 == 0:
            continue
        steps, j = int(streams.next_double(stream) * left), i
        while steps > 0:
            j += 1
            steps -= balls >> j & 1
        swap(i, j, positions)
        left -= 1


def make_plan(
    name: str,
    scene: Scene,
    drawn: Sequence[int],
    spots: Floats,
    displacement: float = 0.0,
    x_most: float = math.inf,
    d_radius: float = math.inf,
) -> LayoutPlan:
    """Returns a plan that draws the balls `drawn`, in this order; the other balls lie at their `spots`.

    The drawn balls stay at x <= `x_most`. If `d_radius` is finite, they also stay in the D of this radius.

    Raises:
        ValueError: If the balls cannot fit.
    """
    what = f"layout {name!r}"
    one_of("layout", name, tuple(LAYOUTS))
    spots = shaped(f"spots of {what}", spots, (scene.n_balls, 2))
    for ball in drawn:
        integer(f"drawn of {what}", ball, Range(0, scene.n_balls - 1))
    x_most = real(f"x_most of {what}", x_most, Range(-math.inf, math.inf, "m"))
    d_radius = real(f"d_radius of {what}", d_radius, Range(0.0, math.inf, "m"))
    displacement = real(f"displacement of {what}", displacement, Range(0.0, math.inf, "m"))
    placed = [i for i in range(scene.n_balls) if i not in drawn]
    order, n_spots = np.array([*placed, *drawn], np.int64), len(placed)
    radius = np.array(scene.balls.radius)
    x_limit, y_limit = (side / 2 - radius - PLACING_GAP for side in (scene.table.length, scene.table.width))
    x_least = x_most - d_radius if d_radius < math.inf else -math.inf  # inf - inf is not a number
    limits = np.column_stack(
        (np.maximum(-x_limit, x_least), np.minimum(x_limit, x_most), np.minimum(y_limit, d_radius))
    )
    for i in order[n_spots:].tolist():
        if limits[i, 1] < limits[i, 0] or limits[i, 2] < 0:
            raise _no_room(name, i, float(radius[i]))
    pockets = np.array([pocket.circle for pocket in scene.table.pockets]).reshape(-1, 3)
    _check_spots(name, scene, spots, displacement, order[:n_spots])
    lines, tips = ([], []) if scene.table.is_rectangular else pieces(scene.table.outline)
    edges = [(*line, *line[:2], 0.0) for line in lines] + [(*tip[3:], *tip[:3]) for tip in tips]
    layout = list(LAYOUTS).index(name)
    rows, d = np.array(edges).reshape(-1, 7), (x_most if d_radius < math.inf else 0.0, d_radius)
    return LayoutPlan(layout, spots, displacement, order, n_spots, limits, radius, pockets, rows, d)


def _check_spots(name: str, scene: Scene, spots: Floats, displacement: float, balls: NDArray[np.int64]) -> None:
    """Raises if a ball cannot lie at its spot with any displacement."""
    in_play = np.zeros(scene.n_balls, np.bool_)
    in_play[balls] = True
    corners = [(x, y) for x in (-displacement, displacement) for y in (-displacement, displacement)]
    for corner in corners if displacement else [(0.0, 0.0)]:
        check_positions(scene, spots + corner, f"layout {name!r}", in_play)


def rack_plan(name: str, scene: Scene, rack: Rack | None = None) -> LayoutPlan:
    """Returns the plan of a rack: object balls at the foot spot, the cue ball drawn behind the head string."""
    radius = scene.balls.radius
    rack = rack or Rack(tuple(range(1, scene.n_balls)), tuple(range(1, scene.n_balls)))
    expect_object_balls(scene, name, len(rack.balls), len(rack.balls))
    if name != "tight_rack":
        low, high = RACK_GAP
        gap = (low + high) / 2
        # A displacement by s along x and along y has the length sqrt(2) s. Two balls come closer by at most twice that.
        displacement = (high - low) / 2 / (2 * math.sqrt(2))
    else:
        gap = displacement = 0.0
        radii = sorted(set(radius[1:]))
        if len(radii) > 1:
            raise ValueError(f"layout = 'tight_rack' with object balls of radii {radii} m: expected one radius")
    spots = np.zeros((scene.n_balls, 2))
    spots[list(rack.balls)] = _rack(len(rack.balls), scene.table.foot_x, 2 * max(radius[1:], default=0.0) + gap)
    if rack.foot_ball:
        spots[1:, 0] -= spots[rack.foot_ball, 0] - scene.table.foot_x
    corners = np.array([(ball, group[0], len(group)) for ball, group in rack.corners], np.int64).reshape(-1, 3)
    shuffled = sum(1 << ball for ball in set(rack.balls) - set(rack.fixed))
    plan = make_plan(name, scene, (0,), spots, displacement, scene.table.head_x)
    return plan._replace(shuffled=shuffled, corners=corners)


def _rack(count: int, foot: float, pitch: float) -> Floats:
    """Returns the places (count, 2) of the balls of a rack, m, with the first ball at x = `foot`."""
    rows = (1, 2, 3, 2, 1) if count == 9 else range(1, count + 1)
    # Position of each ball in units of the distance between neighbours: (rows from the apex, offset from the axis).
    lattice = [(k, j - (size - 1) / 2) for k, size in enumerate(rows) for j in range(size)][:count]
    places = [(foot + pitch * (math.sqrt(3) / 2) * row, pitch * offset) for row, offset in lattice]
    return np.array(places).reshape(-1, 2)


def _snooker_plan(name: str, scene: Scene) -> LayoutPlan:
    """Returns the plan of "snooker": object balls on their spots, the cue ball drawn in the D."""
    expect_object_balls(scene, name, 6, 21)
    table, radius = scene.table, scene.balls.radius[1:]
    if not table.d_radius:
        raise ValueError(
            f"layout = {name!r} with table.d_radius = 0: expected a table with a D, such as 'snooker_12ft'"
        )
    if len(set(radius)) > 1:
        raise ValueError(f"layout = {name!r} with object balls of radii {sorted(set(radius))} m: expected one radius")
    pitch, reds = 2 * radius[0], scene.n_balls - 7
    spots = np.zeros((scene.n_balls, 2))
    spots[1 : 1 + reds] = _rack(reds, table.foot_x + pitch + _PINK_GAP, pitch)
    black = table.length / 2 - _BLACK_SPOT * table.length
    across = ((table.head_x, -table.d_radius), (table.head_x, table.d_radius), (table.head_x, 0.0))
    spots[1 + reds :] = (*across, (0.0, 0.0), (table.foot_x, 0.0), (black, 0.0))
    return make_plan(name, scene, (0,), spots, x_most=table.head_x, d_radius=table.d_radius)


def _snookered_plan(name: str, scene: Scene) -> LayoutPlan:
    """Returns the plan of "snookered": cue ball and ball 1 are drawn, the larger first, with ball 2 midway."""
    expect_object_balls(scene, name, 2, 2)
    radius = scene.balls.radius
    if radius[1] > radius[2]:
        raise ValueError(
            f"layout = {name!r} with balls 1 and 2 of radii {radius[1]} and {radius[2]} m: expected ball 2, "
            "which hides ball 1, to be at least as large"
        )
    order = (0, 1, 2) if radius[0] >= radius[1] else (1, 0, 2)
    return make_plan(name, scene, order, np.zeros((3, 2)))._replace(midway=True)


def expect_object_balls(scene: Scene, layout: str, low: int, high: int) -> None:
    """Raises a ValueError unless a scene has from `low` to `high` object balls."""
    if not low <= scene.n_balls - 1 <= high:
        allowed = str(low) if low == high else f"{low} to {high}"
        balls = f"{scene.n_balls - 1} object ball{'s' * (scene.n_balls != 2)}"
        raise ValueError(f"layout = {layout!r} with {balls}: expected {allowed}")


def _no_room(layout: str, ball: int, radius: float) -> ValueError:
    return ValueError(
        f"layout = {layout!r}: found no room for ball {ball} (radius {radius} m) in {_TRIES} tries: "
        "expected fewer or smaller balls, or a larger table"
    )


PlanMaker = Callable[[str, Scene], LayoutPlan]
"""A function that returns the plan of a layout from its name and the scene."""

LAYOUTS: dict[str, PlanMaker] = {
    "random": _random_plan,
    "rack": rack_plan,
    "tight_rack": rack_plan,
    **{name: functools.partial(rack_plan, rack=rack) for name, rack in RACKS.items()},
    "carom_opening": _carom_plan,
    "line": _line_plan,
    "snookered": _snookered_plan,
    "snooker": _snooker_plan,
}
"""The layouts by name."""


def register_layout(name: str, make: PlanMaker) -> None:
    """Adds a layout of another package to `LAYOUTS`.

    Args:
        name: The name.
        make: The function `(name, scene)` that returns its `LayoutPlan`, for example with `make_plan` or `rack_plan`;
            not a `functools.partial`.

    Raises:
        TypeError, ValueError: See `checks.add_entry`.
    """
    if isinstance(make, FunctionType):
        check_call(f"layout {name!r} = {short(make)}", make, 2)
    add_entry("layout", name, make, LAYOUTS, FunctionType)
