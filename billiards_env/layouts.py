"""Starting positions, drawn from a scene and a random generator.

Each layout is a function `(scene, rng) -> (n, 2) float64 positions in m` that `check_positions` accepts, or it raises a
`ValueError` if the scene's balls do not suit it. Like the spots of a real table, the head of the table is its -x end,
where the cue ball starts; the foot is its +x end.

Draws use `Generator.random` and `+ - * /` and `sqrt` on single doubles only, none of which a compiler may round in
another way on another machine, so the same seed gives the same layout bit for bit.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable

import numpy as np
from numpy.typing import NDArray

from billiards_env.scene import Scene, check_positions, choose

MARGIN = 1e-3
"""m. Randomly placed balls keep at least this clear of each other, of the cushions and of the pockets."""

RACK_GAP = (1e-4, 5e-4)
"""m. Smallest and largest gap between neighbours in a loose rack."""

_TRIES = 10_000

# World Rules of Carom Billiard (UMB 1989), art. 13: the two starting spots lie 18.25 cm either side of the head spot
# on a table 1.42 m wide; on other tables they scale with the width.
_STARTING_SPOT = 0.1825 / 1.42


def random(scene: Scene, rng: np.random.Generator) -> NDArray[np.float64]:
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
    radius = scene.balls.radius
    positions = np.empty((scene.n_balls, 2))
    placed: list[int] = []
    for i in sorted(range(scene.n_balls), key=lambda i: -radius[i]):
        x_high = scene.table.length / 2 - radius[i] - MARGIN
        positions[i] = _draw_place(
            scene, rng, i, x_high, [(*positions[j].tolist(), radius[j]) for j in placed], "random"
        )
        placed.append(i)
    return positions


def rack(scene: Scene, rng: np.random.Generator) -> NDArray[np.float64]:
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
    low, high = RACK_GAP
    # A displacement of at most s along x and y is one of sqrt(2) s; two balls come closer by twice that at most.
    side = (high - low) / 2 / (2 * math.sqrt(2))
    offsets = (2 * rng.random((scene.n_balls - 1, 2)) - 1) * side
    return _racked(scene, rng, (low + high) / 2, offsets, "rack")


def tight_rack(scene: Scene, rng: np.random.Generator) -> NDArray[np.float64]:
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
    radii = sorted(set(scene.balls.radius[1:]))
    if len(radii) > 1:
        raise ValueError(f"layout = 'tight_rack' with object balls of radii {radii} m: expected one radius")
    return _racked(scene, rng, 0.0, np.zeros((scene.n_balls - 1, 2)), "tight_rack")


def carom_opening(scene: Scene, rng: np.random.Generator) -> NDArray[np.float64]:
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
    _expect_object_balls(scene, "carom_opening", 1, 2)
    spot = scene.table.length / 4
    places = [(-spot, -_STARTING_SPOT * scene.table.width), (spot, 0.0), (-spot, 0.0)]
    return check_positions(scene, places[: scene.n_balls], "layout 'carom_opening'")


def line(scene: Scene, rng: np.random.Generator) -> NDArray[np.float64]:
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
    _expect_object_balls(scene, "line", 1, 1)
    spot = scene.table.length / 4
    return check_positions(scene, [(-spot, 0.0), (spot, 0.0)], "layout 'line'")


_NAMED: dict[str, Callable[[Scene, np.random.Generator], NDArray[np.float64]]] = {
    "random": random,
    "rack": rack,
    "tight_rack": tight_rack,
    "carom_opening": carom_opening,
    "line": line,
}
LAYOUTS = tuple(_NAMED)


def draw(name: str, scene: Scene, rng: np.random.Generator) -> NDArray[np.float64]:
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
    choose("layout", name, LAYOUTS)
    return _NAMED[name](scene, rng)


def _expect_object_balls(scene: Scene, layout: str, low: int, high: int) -> None:
    if not low <= scene.n_balls - 1 <= high:
        wanted = str(low) if low == high else f"{low} to {high}"
        raise ValueError(f"layout = {layout!r} with {scene.n_balls - 1} object balls: expected {wanted}")


def _draw_place(
    scene: Scene,
    rng: np.random.Generator,
    ball: int,
    x_high: float,
    others: Iterable[tuple[float, float, float]],
    layout: str,
) -> tuple[float, float]:
    """A uniformly drawn place for `ball` with x <= `x_high`, clear of all the `others` (x, y, radius)."""
    radius = scene.balls.radius[ball]
    x_low = -(scene.table.length / 2 - radius - MARGIN)
    y_high = scene.table.width / 2 - radius - MARGIN
    taken = [(x, y, (r + radius + MARGIN) ** 2) for x, y, r in others]
    taken += [(p.x, p.y, (p.radius + MARGIN) ** 2) for p in scene.table.pockets]
    if x_high >= x_low and y_high >= 0:
        for _ in range(_TRIES):
            x = x_low + (x_high - x_low) * rng.random()
            y = y_high * (2 * rng.random() - 1)
            for other_x, other_y, clear in taken:
                if (x - other_x) * (x - other_x) + (y - other_y) * (y - other_y) < clear:
                    break
            else:
                return x, y
    raise ValueError(
        f"layout = {layout!r}: found no room for ball {ball} (radius {radius} m) in {_TRIES} tries: "
        "expected fewer or smaller balls, or a larger table"
    )


def _racked(
    scene: Scene, rng: np.random.Generator, gap: float, offsets: NDArray[np.float64], layout: str
) -> NDArray[np.float64]:
    """Object balls `gap` apart in a rack, moved by `offsets` (n - 1, 2), and the cue ball behind the head string."""
    count = scene.n_balls - 1
    rows = (1, 2, 3, 2, 1) if count == 9 else range(1, count + 1)
    # Where each ball lies, in units of the distance between neighbours: (rows from the apex, places from the axis).
    lattice = [(k, j - (places - 1) / 2) for k, places in enumerate(rows) for j in range(places)][:count]
    radius = scene.balls.radius
    pitch = 2 * max(radius[1:], default=0.0) + gap
    foot = scene.table.length / 4
    positions = np.empty((scene.n_balls, 2))
    for i, (row, place) in enumerate(lattice, start=1):
        positions[i] = foot + pitch * (math.sqrt(3) / 2) * row, pitch * place
    positions[1:] += offsets
    others = [(*positions[j].tolist(), radius[j]) for j in range(1, scene.n_balls)]
    positions[0] = _draw_place(scene, rng, 0, -foot, others, layout)
    return check_positions(scene, positions, f"layout {layout!r}")
