"""Maps of strikes: the pocket of a ball for each pair of values of two parameters."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from billiards_env.checks import Range, numbers, one_of, short, whole
from billiards_env.scene import Scene, check_positions, check_scene
from billiards_env.shots.simulation import simulate_batch
from billiards_env.shots.strikes import strike

if TYPE_CHECKING:
    from billiards_env.drawing.plot import Axes

Floats = NDArray[np.float64]

PARAMETERS = {"speed": 2.0, "heading": 0.0, "side": 0.0, "top": 0.0, "elevation": 0.0}
"""The parameters of `strike`, with the values of those that are not given."""


class StrikeMap(NamedTuple):
    """The outcomes of a grid of strikes.

    Attributes:
        scene: The scene.
        names: The names of the two parameters.
        values: Their values: (a,) and (b,).
        pocket: (b, a) int, the pocket of the ball; -1 if it was not potted, -2 if the cue ball was also potted, -3 if
            the tip slipped.
    """

    scene: Scene
    names: tuple[str, str]
    values: tuple[Floats, Floats]
    pocket: NDArray[np.int64]

    @property
    def success(self) -> NDArray[np.bool_]:
        """(b, a) Whether the ball was potted, the cue ball was not, and the tip did not slip."""
        return self.pocket >= 0

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draws the map with matplotlib (extra `plot`), a colour for each pocket.

        Args:
            ax: Axes to draw on; None for a new figure.

        Returns:
            The axes.

        Raises:
            ModuleNotFoundError: If matplotlib is not installed.
        """
        from billiards_env.drawing.plot import draw_map

        return draw_map(self.names, self.values, self.pocket, ax)


def strike_map(
    scene: Scene,
    positions: ArrayLike,
    grid: Mapping[str, ArrayLike],
    *,
    ball: int = 1,
    in_play: ArrayLike | None = None,
    threads: int | None = None,
    **strikes: float,
) -> StrikeMap:
    """Plays a strike for each pair of values of two parameters.

    Args:
        scene: Table, balls and physics; the table must have pockets.
        positions: (n, 2) centres of the balls, m; ball 0 is the cue ball.
        grid: Two parameters of `strike` with their values, such as {"side": ..., "top": ...}. The first one is the
            horizontal axis of the plot.
        ball: The object ball to pot.
        in_play: (n,) bool; by default all balls are in play.
        threads: As in `simulate_batch`.
        strikes: The other parameters of `strike`; by default a level cue at the centre of the ball at 2 m/s.

    Returns:
        The map. Offsets outside the ball count as slips of the tip.

    Raises:
        ValueError: As in `strike` and `simulate_batch`, or if `grid` does not have two parameters, a parameter is
            unknown or given twice, or `ball` is not an object ball.

    Example:
        >>> scene = Scene.named("pool")
        >>> grid = {"heading": np.linspace(0.2, 0.3, 41), "speed": [1.0, 2.0]}
        >>> chances = strike_map(scene, [[0.0, 0.0], [0.9, 0.23]], grid)
        >>> chances.pocket.shape, bool(chances.success.any())
        ((2, 41), True)
    """
    check_scene(scene)
    if not scene.table.pockets:
        raise ValueError("scene: expected a table with pockets")
    if not isinstance(grid, Mapping) or len(grid) != 2:
        raise ValueError(f"grid = {short(grid)}: expected the values of two parameters of a strike")
    for name in (*grid, *strikes):
        one_of("parameter of a strike", name, tuple(PARAMETERS))
    if both := [name for name in grid if name in strikes]:
        raise ValueError(f"{both[0]} = {short(strikes[both[0]])}: expected only one of the value and the grid")
    whole("ball", ball, Range(1, scene.n_balls - 1, "object balls"))
    (first, second), values = grid, [numbers(f"grid[{name!r}]", given) for name, given in grid.items()]
    for name, array in zip(grid, values, strict=True):
        if array.ndim != 1 or len(array) == 0:
            raise ValueError(f"grid[{name!r}] has shape {array.shape}: expected a row of numbers")
    place = check_positions(scene, positions, in_play=None if in_play is None else np.asarray(in_play, np.bool_))
    across, up = (array.ravel() for array in np.meshgrid(*values))
    parameters = PARAMETERS | strikes | {first: across, second: up}
    far = np.broadcast_to(np.hypot(parameters["side"], parameters["top"]), across.shape)
    held = far <= 1.0
    made = strike(scene, **{n: np.broadcast_to(v, across.shape)[held] for n, v in parameters.items()})
    batch = simulate_batch(
        scene, np.broadcast_to(place, (held.sum(), *place.shape)), made, in_play=in_play, threads=threads
    )
    pockets = np.array([(pocket.x, pocket.y) for pocket in scene.table.pockets])
    ends = batch.positions[:, ball]
    nearest = ((ends[:, None] - pockets) ** 2).sum(-1).argmin(1)
    found = np.full(across.shape, -3)
    found[held] = np.select([made.miscue, ~batch.potted[:, ball], batch.potted[:, 0]], [-3, -1, -2], nearest)
    return StrikeMap(scene, (first, second), (values[0], values[1]), found.reshape(len(values[1]), len(values[0])))
