"""Starting positions, drawn from a scene and a random generator.

Each layout is a function `(scene, rng) -> (n, 2) float64 positions in m` that `check_positions` accepts, or it raises a
`ValueError` if the scene's balls do not suit it. Like the spots of a real table, the head of the table is its -x end,
where the cue ball starts; the foot is its +x end.

What a layout asks for is worked out once for a scene, as a `Plan`; one kernel draws any plan, for one table or for
many. It draws numbers from [0, 1) and uses `+ - * /` on single doubles only, none of which a compiler may round in
another way on another machine, so the same seed gives the same layout bit for bit.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_env import streams
from billiards_env.checks import choose
from billiards_env.physics.interrupt import end_call, interrupted
from billiards_env.physics.jit import entry_point, kernel
from billiards_env.scene import Scene, check_positions

Floats = NDArray[np.float64]

MARGIN = 1e-3
"""m. Randomly placed balls keep at least this clear of each other, of the cushions and of the pockets."""

RACK_GAP = (1e-4, 5e-4)
"""m. Smallest and largest gap between neighbours in a loose rack."""

_TRIES = 10_000
_LOOK_AFTER = 5000  # balls: a millisecond, or more where there is little room

# World Rules of Carom Billiard (UMB 1989), art. 13: the two starting spots lie 18.25 cm either side of the head spot
# on a table 1.42 m wide; on other tables they scale with the width.
_STARTING_SPOT = 0.1825 / 1.42

LAYOUTS = ("random", "rack", "tight_rack", "carom_opening", "line", "snookered")


def random(scene: Scene, rng: np.random.Generator) -> Floats:
    """Balls scattered over the whole table.

    One ball after the other, the largest first, is placed uniformly over the room that is left (random sequential
    addition, Widom 1966), `MARGIN` clear of balls, cushions and pockets.

    Args:
        scene: The scene.
        rng: Where the draws come from.

    Returns:
        (n, 2) positions, m.

    Raises:
        ValueError: If a ball finds no room in 10,000 tries.

    Example:
        >>> random(Scene.named("pool"), np.random.default_rng(0)).shape
        (2, 2)
    """
    return draw("random", scene, rng)


def rack(scene: Scene, rng: np.random.Generator) -> Floats:
    """Cue ball anywhere behind the head string, object balls racked loosely at the foot spot.

    The rack is a triangle filled row by row from the foot spot, or a diamond for 9 object balls. As no rack is perfect,
    each ball is displaced at random so that the gaps between neighbours lie within `RACK_GAP` and none touch.

    Args:
        scene: The scene. Balls of several sizes are spaced for the largest object ball.
        rng: Where the draws come from.

    Returns:
        (n, 2) positions, m.

    Raises:
        ValueError: If the rack does not fit on the table or the cue ball behind the head string.
    """
    return draw("rack", scene, rng)


def tight_rack(scene: Scene, rng: np.random.Generator) -> Floats:
    """Cue ball anywhere behind the head string, object balls frozen together at the foot spot.

    As `rack`, but neighbours touch: their gap is 0 to the rounding of the coordinates.

    Args:
        scene: The scene; its object balls are of one size.
        rng: Where the draws come from.

    Returns:
        (n, 2) positions, m.

    Raises:
        ValueError: If the object balls differ in radius, the rack does not fit on the table or the cue ball does not
            fit behind the head string.
    """
    return draw("tight_rack", scene, rng)


def carom_opening(scene: Scene, rng: np.random.Generator) -> Floats:
    """The opening position of carom billiards (UMB 1989, art. 23), the same each time.

    The cue ball is on the right starting spot, ball 1 (the red one) on the foot spot and ball 2, if there is one (the
    opponent's), on the head spot.

    Args:
        scene: A scene with one or two object balls.
        rng: Not used.

    Returns:
        (n, 2) positions, m.

    Raises:
        ValueError: If there are more object balls, or none, or the balls overlap on a table so small.
    """
    return draw("carom_opening", scene, rng)


def line(scene: Scene, rng: np.random.Generator) -> Floats:
    """Cue ball and object ball on the table's long axis, at a quarter and three quarters of it, the same each time.

    Args:
        scene: A scene with one object ball.
        rng: Not used.

    Returns:
        (2, 2) positions, m.

    Raises:
        ValueError: If there is not exactly one object ball, or the balls overlap on a table so small.

    Example:
        >>> line(Scene.named("pool"), np.random.default_rng(0)).tolist()
        [[-0.635, 0.0], [0.635, 0.0]]
    """
    return draw("line", scene, rng)


def snookered(scene: Scene, rng: np.random.Generator) -> Floats:
    """Cue ball and ball 1 anywhere, as in `random`, ball 2 midway between them; drawn anew until ball 2 has room.

    Ball 2 hides ball 1 wholly: a straight path of the cue ball that passes the centre of ball 1 at a distance b passes
    that of ball 2, half as far away, at b / 2; one that would touch ball 1, b <= r0 + r1, has b / 2 < r0 + r2 as
    r1 <= r2, so it meets ball 2, and does so first.

    Args:
        scene: A scene with two object balls, the second at least as large as the first.
        rng: Where the draws come from.

    Returns:
        (3, 2) positions, m.

    Raises:
        ValueError: If there are not exactly two object balls, ball 2 is too small to hide ball 1, or a ball finds no
            room in 10,000 tries.

    Example:
        >>> cue, target, blocker = snookered(Scene.named("blocked_pool"), np.random.default_rng(0))
        >>> bool((blocker == (cue + target) / 2).all())
        True
    """
    return draw("snookered", scene, rng)


def draw(name: str, scene: Scene, rng: np.random.Generator) -> Floats:
    """Draws the layout called `name`.

    Args:
        name: One of `LAYOUTS`.
        scene: The scene.
        rng: Where the draws come from.

    Returns:
        (n, 2) positions, m.

    Raises:
        ValueError: If the name is unknown or the scene's balls do not suit the layout.

    Example:
        >>> draw("tight_rack", Scene.named("pool", 15), np.random.default_rng(0))[1].tolist()
        [0.635, 0.0]
    """
    return draw_one(plan(name, scene), rng)


class Plan(NamedTuple):
    """What a layout asks for on a scene: balls at their spots first, then balls drawn one after the other.

    Attributes:
        name: The layout's name.
        spots: (n, 2) float64, m: where the balls that have a spot lie, before they are displaced.
        displacement: m; a ball that has a spot is displaced by up to so much along x and along y.
        order: (n,) int64: the balls that have a spot, then those that are drawn, in this order.
        n_spots: How many have a spot.
        midway: Whether the last ball of the order lies midway between the other two, which have no spots.
        room: (n, 3) float64, m: a drawn ball's least x, largest x and largest abs(y).
        radius: (n,) float64, m.
        pockets: (k, 3) float64: x, y, radius, m.
    """

    name: str
    spots: Floats
    displacement: float
    order: NDArray[np.int64]
    n_spots: int
    midway: bool
    room: Floats
    radius: Floats
    pockets: Floats


@functools.lru_cache(maxsize=256)
def plan(name: str, scene: Scene) -> Plan:
    """The plan of the layout called `name`.

    Args:
        name: One of `LAYOUTS`.
        scene: The scene.

    Returns:
        The plan; its arrays are not to be written to.

    Raises:
        ValueError: If the name is unknown or the scene's balls do not suit the layout.
    """
    choose("layout", name, LAYOUTS)
    n = scene.n_balls
    if name == "random":
        largest_first = sorted(range(n), key=lambda i: -scene.balls.radius[i])
        return _plan(name, scene, np.zeros((n, 2)), 0.0, largest_first, 0, scene.table.length / 2)
    if name in ("rack", "tight_rack"):
        return _rack_plan(name, scene)
    if name == "snookered":
        return _snookered_plan(name, scene)
    _expect_object_balls(scene, name, 1, 1 if name == "line" else 2)
    spot = scene.table.length / 4
    if name == "line":
        places = [(-spot, 0.0), (spot, 0.0)]
    else:
        places = [(-spot, -_STARTING_SPOT * scene.table.width), (spot, 0.0), (-spot, 0.0)][:n]
    return _plan(name, scene, np.array(places), 0.0, range(n), n, 0.0)


def draw_one(plan: Plan, rng: np.random.Generator) -> Floats:
    """Draws a layout from its plan.

    Args:
        plan: The plan.
        rng: Where the draws come from.

    Returns:
        (n, 2) positions, m.

    Raises:
        ValueError: If a ball finds no room.
    """
    positions = np.empty_like(plan.spots)
    if plan.n_spots == len(positions) and plan.displacement == 0.0:  # nothing to draw
        positions[...] = plan.spots
        return positions
    stream = streams.read(rng)
    draw_tables(plan, 0, 1, _ONE, stream[None], positions[None])
    streams.write(rng, stream)
    return positions


def draw_tables(
    plan: Plan, begin: int, end: int, wanted: NDArray[np.bool_], rows: NDArray[np.uint64], positions: Floats
) -> None:
    """Draws a layout for each wanted one of the tables `begin` to `end`, each from its own stream.

    Args:
        plan: The plan.
        begin: First table.
        end: One past the last.
        wanted: (m,) the tables to draw for; the others are left alone.
        rows: (m, 4) their streams, which move on.
        positions: (m, n, 2) float64 out, m.

    Raises:
        ValueError: If a ball finds no room.
    """
    failed = lay_out(begin, end, wanted, rows, *plan[1:], positions)
    if failed >= 0:
        raise _no_room(plan.name, failed, plan.radius[failed])


_ONE = np.ones(1, np.bool_)


@kernel
def is_clear(i, x, y, placed, order, radius, pockets, positions):
    """Whether ball i at (x, y) is clear of the pockets and of the first `placed` balls of `order`."""
    for k in range(placed):
        j = order[k]
        dx, dy, reach = x - positions[j, 0], y - positions[j, 1], radius[j] + radius[i] + MARGIN
        if dx * dx + dy * dy < reach * reach:
            return False
    for k in range(len(pockets)):
        dx, dy, reach = x - pockets[k, 0], y - pockets[k, 1], pockets[k, 2] + MARGIN
        if dx * dx + dy * dy < reach * reach:
            return False
    return True


@kernel
def place(i, placed, stream, order, room, radius, pockets, positions):
    """Draws a place for ball i, clear of the pockets and of the first `placed` balls of `order`; whether it found one.

    One after the other, each uniform over the room left, is random sequential addition (Widom 1966).
    """
    x_low, x_high, y_high = room[i, 0], room[i, 1], room[i, 2]
    for _ in range(_TRIES):
        x = x_low + (x_high - x_low) * streams.next_double(stream)
        y = y_high * (2 * streams.next_double(stream) - 1)
        if is_clear(i, x, y, placed, order, radius, pockets, positions):
            positions[i, 0], positions[i, 1] = x, y
            return True
    return False


@kernel
def place_midway(stream, order, room, radius, pockets, positions):
    """Draws places for the first two balls of `order` until the third has room midway; a ball without room, or -1."""
    a, b, i = order[0], order[1], order[2]
    for _ in range(_TRIES):
        for k in range(2):
            if not place(order[k], k, stream, order, room, radius, pockets, positions):
                return order[k]
        x, y = 0.5 * (positions[a, 0] + positions[b, 0]), 0.5 * (positions[a, 1] + positions[b, 1])
        fits = room[i, 0] <= x <= room[i, 1] and abs(y) <= room[i, 2]
        if fits and is_clear(i, x, y, 2, order, radius, pockets, positions):
            positions[i, 0], positions[i, 1] = x, y
            return -1
    return i


@entry_point
def lay_out(begin, end, wanted, rows, spots, displacement, order, n_spots, midway, room, radius, pockets, positions):
    """The loop of `draw_tables`; its arguments are those of a `Plan`. Returns a ball that found no room, else -1."""
    balls = 0
    for table in range(begin, end):
        if not wanted[table]:
            continue
        balls += len(order)
        if balls > _LOOK_AFTER:
            end_call(interrupted())
            balls = 0
        stream, places = rows[table], positions[table]
        if midway:
            failed = place_midway(stream, order, room, radius, pockets, places)
            if failed >= 0:
                return failed
            continue
        for k in range(n_spots):
            i = order[k]
            places[i, 0], places[i, 1] = spots[i, 0], spots[i, 1]
            if displacement > 0.0:
                places[i, 0] += (2 * streams.next_double(stream) - 1) * displacement
                places[i, 1] += (2 * streams.next_double(stream) - 1) * displacement
        for k in range(n_spots, len(order)):
            if not place(order[k], k, stream, order, room, radius, pockets, places):
                return order[k]
    return -1


def _plan(
    name: str,
    scene: Scene,
    spots: Floats,
    displacement: float,
    order: Iterable[int],
    n_spots: int,
    x_most: float,
    midway: bool = False,
) -> Plan:
    """The plan with the room of the scene; drawn balls stay at x <= `x_most`. Refuses what cannot be drawn."""
    order = np.array(order, np.int64)
    radius = np.array(scene.balls.radius)
    x_room, y_room = (side / 2 - radius - MARGIN for side in (scene.table.length, scene.table.width))
    room = np.column_stack((-x_room, np.minimum(x_room, x_most), y_room))
    for i in order[n_spots:].tolist():
        if room[i, 1] < room[i, 0] or room[i, 2] < 0:
            raise _no_room(name, i, float(radius[i]))
    pockets = np.array([(p.x, p.y, p.radius) for p in scene.table.pockets]).reshape(-1, 3)
    _check_spots(name, scene, spots, displacement, order[:n_spots])
    return Plan(name, spots, displacement, order, n_spots, midway, room, radius, pockets)


def _check_spots(name: str, scene: Scene, spots: Floats, displacement: float, which: NDArray[np.int64]) -> None:
    """Refuses spots that a ball cannot lie at, wherever in its square it is displaced to."""
    in_play = np.zeros(scene.n_balls, np.bool_)
    in_play[which] = True
    corners = [(x, y) for x in (-displacement, displacement) for y in (-displacement, displacement)]
    for corner in corners if displacement else [(0.0, 0.0)]:
        check_positions(scene, spots + corner, f"layout {name!r}", in_play)


def _rack_plan(name: str, scene: Scene) -> Plan:
    """Object balls in a rack at the foot spot, the cue ball drawn behind the head string."""
    radius = scene.balls.radius
    count = scene.n_balls - 1
    if name == "rack":
        low, high = RACK_GAP
        gap = (low + high) / 2
        # A displacement of at most s along x and y is one of sqrt(2) s; two balls come closer by twice that at most.
        displacement = (high - low) / 2 / (2 * math.sqrt(2))
    else:
        gap = displacement = 0.0
        radii = sorted(set(radius[1:]))
        if len(radii) > 1:
            raise ValueError(f"layout = 'tight_rack' with object balls of radii {radii} m: expected one radius")
    rows = (1, 2, 3, 2, 1) if count == 9 else range(1, count + 1)
    # Where each ball lies, in units of the distance between neighbours: (rows from the apex, places from the axis).
    lattice = [(k, j - (places - 1) / 2) for k, places in enumerate(rows) for j in range(places)][:count]
    pitch = 2 * max(radius[1:], default=0.0) + gap
    foot = scene.table.length / 4
    spots = np.zeros((scene.n_balls, 2))
    for i, (row, place) in enumerate(lattice, start=1):
        spots[i] = foot + pitch * (math.sqrt(3) / 2) * row, pitch * place
    return _plan(name, scene, spots, displacement, [*range(1, scene.n_balls), 0], count, -foot)


def _snookered_plan(name: str, scene: Scene) -> Plan:
    """Cue ball and ball 1 drawn, the larger first, and ball 2 midway between them."""
    _expect_object_balls(scene, name, 2, 2)
    radius = scene.balls.radius
    if radius[1] > radius[2]:
        raise ValueError(
            f"layout = {name!r} with balls 1 and 2 of radii {radius[1]} and {radius[2]} m: expected ball 2, "
            "which hides ball 1, to be at least as large"
        )
    order = (0, 1, 2) if radius[0] >= radius[1] else (1, 0, 2)
    return _plan(name, scene, np.zeros((3, 2)), 0.0, order, 0, scene.table.length / 2, midway=True)


def _expect_object_balls(scene: Scene, layout: str, low: int, high: int) -> None:
    if not low <= scene.n_balls - 1 <= high:
        wanted = str(low) if low == high else f"{low} to {high}"
        raise ValueError(f"layout = {layout!r} with {scene.n_balls - 1} object balls: expected {wanted}")


def _no_room(layout: str, ball: int, radius: float) -> ValueError:
    return ValueError(
        f"layout = {layout!r}: found no room for ball {ball} (radius {radius} m) in {_TRIES} tries: "
        "expected fewer or smaller balls, or a larger table"
    )
