"""The input of shots: its arrays and its validation. `billiards_env.support.checks` has the ranges of the numbers."""

from __future__ import annotations

import contextlib
import dataclasses
import math
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from billiards_env.engine.cell_grid import cell_of, empty_cells
from billiards_env.engine.compile import (
    MANY_BALLS,
    Engine,
    cached_by_scene,
    check_varied_name,
    scene_fields,
    scene_kernels,
)
from billiards_env.engine.runner import INTERRUPTED
from billiards_env.engine.shots import Shots, start_fields
from billiards_env.engine.threads import parallel_for
from billiards_env.jit import Typed, allocating, entry_point, inlined
from billiards_env.jit.interrupt import end_call, interrupted
from billiards_env.physics.geometry.noses import is_free
from billiards_env.physics.geometry.pockets import pocket_at
from billiards_env.physics.scatter import Scatter
from billiards_env.physics.state import CUE_BALL, SPIN_X, SPIN_Y, SPIN_Z, X, Y, scene_of
from billiards_env.scene import CONTACT_GAP, Scene, check_positions, check_ranges
from billiards_env.support.checks import (
    MAX_SPEED,
    MAX_SPIN,
    RANGES,
    Range,
    array_of,
    numbers,
    range_text,
    real,
    shaped,
    short,
)

Floats = NDArray[np.float64]

_CLOSE = 1.0 + 1e-12  # relative; closer to a limit the slow check decides, because it rounds differently
_LOOK_AFTER = 10_000_000  # pairs of balls between two calls of `interrupted`: about ten milliseconds

DOUBTFUL, VALID = 0, 1  # results of the fast check, beside INTERRUPTED


class ShotInput(NamedTuple):
    """The start of one shot or, with a leading axis, of many: the fields of `Starts`, and a limit.

    Attributes:
        positions: (n, 2) float64, m.
        velocities: (n, 2) float64, m/s.
        spins: (n, 3) float64, rad/s.
        in_play: (n,) bool.
        cue: The cue ball, which the cue strikes.
        heights: (n, 2) float64, see `Shots`; None without flight.
        limit: Time at which a shot ends, s; infinite for no limit.
        scatter: The scatter of the cushions, or None.
    """

    positions: Floats
    velocities: Floats
    spins: Floats
    in_play: NDArray[np.bool_]
    cue: int | NDArray[np.int64] = CUE_BALL
    heights: Floats | None = None
    limit: float = math.inf
    scatter: Scatter | None = None

    def in_space(self) -> tuple[Floats, Floats]:
        """Returns the positions and the velocities, (..., n, 3) with flight and (..., n, 2) without."""
        if self.heights is None:
            return self.positions, self.velocities
        z, vz = self.heights[..., :1], self.heights[..., 1:]
        return np.concatenate((self.positions, z), axis=-1), np.concatenate((self.velocities, vz), axis=-1)

    def as_batch(self) -> tuple[Any, ...]:
        """Returns the start of one shot as the fields of `Starts` of a batch, which share the memory of its arrays."""
        return tuple(None if part is None else np.asarray(part)[None] for part in start_fields(self))


@inlined
def _is_valid_alone(i, place, velocity, spin, in_play, scene):
    """Returns whether the numbers of ball i are within their ranges and, in play, its place is valid.

    Its place (x, y) is valid inside the cushions and outside the pockets. A ball of infinite mass has to rest.
    """
    x, y, radius, box = place[X], place[Y], scene.radius[i], scene.outline.box
    vx, vy = velocity[X], velocity[Y]
    wx, wy, wz = spin[SPIN_X], spin[SPIN_Y], spin[SPIN_Z]
    fastest, most = max(abs(vx), abs(vy)), max(max(abs(wx), abs(wy)), abs(wz))
    if scene.inv_mass[i] == 0.0 and max(fastest, most) > 0.0:
        return False
    # If any of the numbers is NaN, the sum is NaN, and all comparisons are false
    total = vx + vy + wx + wy + wz
    if not (fastest <= MAX_SPEED and most <= MAX_SPIN and total == total and abs(x) + abs(y) < math.inf):
        return False
    if not in_play:
        return True
    if abs(x) > box[X] - radius or abs(y) > box[Y] - radius:
        return False
    return pocket_at(scene.pockets, x, y, _CLOSE) < 0


@inlined
def _overlap(i, j, places, scene):
    """Returns whether balls i and j at `places`, (n, 2), may overlap."""
    dx, dy = places[i, X] - places[j, X], places[i, Y] - places[j, Y]
    reach = scene.space.contact_distance(i, j, scene) - CONTACT_GAP
    return dx * dx + dy * dy < _CLOSE * (reach * reach)


@inlined
def _is_apart(i, places, in_play, scene, cells):  # out: cells
    """Returns whether ball i overlaps none of the balls before it, and puts it in its cell."""
    if cells is None:
        for j in range(i):
            if in_play[j] and _overlap(i, j, places, scene):
                return False
    else:
        head, after = cells
        columns, rows = head.shape
        column, row = cell_of(places[i, X], places[i, Y], scene.numbers, head)
        for c in range(max(0, column - 1), min(columns, column + 2)):
            for r in range(max(0, row - 1), min(rows, row + 2)):
                j = head[c, r]
                while j >= 0:
                    if _overlap(i, j, places, scene):
                        return False
                    j = after[j]
        after[i], head[column, row] = head[column, row], i
    return True


@inlined
def _test(begin, end, scene, starts, cells):  # out: cells
    """Returns VALID if all shots from `begin` to `end - 1` may start, INTERRUPTED after Ctrl-C, and otherwise DOUBTFUL.

    `cells` is a result of `empty_cells`, or None.
    """
    positions, velocities, spins, in_play, _, _ = starts
    n = len(scene.radius)
    pairs = 0
    for k in range(begin, end):
        pairs += n * ((n if cells is None else 9) + 8)
        if pairs > _LOOK_AFTER:
            if interrupted():
                return INTERRUPTED
            pairs = 0
        if cells is not None:
            cells[0][:] = -1
        for i in range(n):
            if not _is_valid_alone(i, positions[k, i], velocities[k, i], spins[k, i], in_play[k, i], scene):
                return DOUBTFUL
            if in_play[k, i] and not _is_apart(i, positions[k], in_play[k], scene, cells):
                return DOUBTFUL
    return VALID


@allocating
def _test_many(begin, end, scene, starts):
    """Returns the result of `_test`. It is faster for many balls: it compares only balls in neighbouring cells."""
    return _test(begin, end, scene, starts, empty_cells(scene))


@entry_point
def is_valid_fast(kernels, begin, end, scene, starts):
    """Returns whether the shots `begin` to `end` - 1 are valid input for `simulate`.

    False may also mean that valid input is too close to a limit. Then `check_positions` decides.

    Args:
        kernels: The `SceneKernels`.
        begin: First shot.
        end: One past the last.
        scene: The other `SceneArrays`, as a tuple.
        starts: The `Starts`, as a tuple.

    Returns:
        True if all numbers are within their ranges, balls of infinite mass rest, and balls in play lie inside the
        cushions, outside the pockets and apart from each other.
    """
    found = _test(begin, end, scene_of(kernels, scene, 0), starts, None)
    end_call(found == INTERRUPTED)
    return found == VALID


@entry_point
def is_valid_fast_of_many(kernels, begin, end, scene, starts):
    """Returns the result of `is_valid_fast`. It is faster for many balls."""
    found = _test_many(begin, end, scene_of(kernels, scene, 0), starts)
    end_call(found == INTERRUPTED)
    return found == VALID


def check_shot(
    scene: Scene,
    positions: ArrayLike,
    velocities: ArrayLike,
    spins: ArrayLike | None,
    in_play: ArrayLike | None,
    max_time: float | None,
    into: Shots | None = None,
    threads: int | None = 1,
) -> ShotInput:
    """Returns the checked input of a shot, or of a batch of shots.

    Args:
        scene: The scene.
        positions: As in `simulate` or `simulate_batch`.
        velocities: (m, n, 2) m/s, or (m, 2) for the cue balls alone; (n, 2) or (2,) for one shot.
        spins: (m, n, 3) rad/s, or (m, 3) for the cue balls alone; (n, 3) or (3,) for one shot.
        in_play: (m, n) or (n,) bool; balls that are not in play are ignored and count as potted.
        max_time: Time at which a shot ends, s; None for the limit of the scene.
        into: The `Shots` to write a batch to; None for new arrays.
        threads: Number of threads that check a batch; None for the number of `set_num_threads`.

    Raises:
        ValueError: As in `simulate`; the message names the shot of a batch.
    """
    places, above, rising = numbers("positions", positions), None, None
    if scene.physics.flight:
        places, above = _split(places)
        velocities, rising = _split(numbers("velocities", velocities))
    shape = places.shape[:-1]
    if places.ndim not in (2, 3) or places.shape[-2:] != (scene.n_balls, 2):
        check_positions(scene, places)  # raises
    limit = scene.physics.max_time if max_time is None else real("max_time", max_time, "limit")
    if into is None:
        balls = np.empty((*shape, 2)), np.empty((*shape, 2)), np.empty((*shape, 3)), np.empty(shape, np.bool_)
        heights = np.empty((*shape, 2)) if scene.physics.flight else None
        start: tuple[Any, ...] = (*balls, np.zeros(shape[:-1], np.int64), heights)  # ball 0 is the cue ball
    else:
        start = start_fields(into)
    shot = ShotInput(*start, limit=math.inf if limit is None else float(limit))
    shot.positions[...] = places
    _fill_in_play(shot.in_play, in_play)
    if spins is not None and scene.physics.motion != "sliding":
        raise ValueError(
            f"spins = {short(spins)} with physics.motion = {scene.physics.motion!r}: expected None or motion 'sliding'"
        )
    _fill(shot.velocities, "velocities", velocities)
    if spins is None:
        shot.spins[...] = 0.0
    else:
        _fill(shot.spins, "spins", spins)
    checked = shot
    if shot.heights is not None:
        checked = shot._replace(in_play=_fill_heights(scene, shot, shot.heights, above, rising))
    if not _is_valid_fast(scene, checked, threads):
        check_positions(scene, shot.positions, in_play=checked.in_play)
        _check_motion(scene, "velocities", shot.velocities, RANGES["speed"])
        _check_motion(scene, "spins", shot.spins, RANGES["spin"])
    return shot


def check_varied(scene: Scene, physics: Any, engine: Engine, m: int) -> dict[str, Floats]:
    """Checks and returns the values that differ from shot to shot, (m,) each, see `Varied`.

    Args:
        scene: The scene.
        physics: The argument `physics` of `simulate_batch`.
        engine: The engine.
        m: The number of shots.

    Raises:
        ValueError: As `Physics` and `Engine` do. The message names the shot.
        TypeError: If `physics` is neither a mapping nor None.
    """
    if physics is None:
        return {}
    if not isinstance(physics, Mapping):
        raise TypeError(f"physics = {short(physics)}: expected a mapping from names of numbers of Physics to arrays")
    arrays: dict[str, Floats] = {}
    for name, values in physics.items():
        check_varied_name("physics", name, engine)
        arrays[name] = shaped(f"physics[{name!r}]", values, (m,))
    numbers = {name: array for name, array in arrays.items() if name != "dt"}
    try:
        check_ranges(scene.physics, {name: (array.min(), array.max()) for name, array in numbers.items() if m})
    except ValueError:  # the extremes may be those of different shots
        for k, row in enumerate(zip(*numbers.values(), strict=True)):
            with _of_shot(k):
                dataclasses.replace(scene.physics, **dict(zip(numbers, row, strict=True)))
    timesteps = arrays.get("dt", np.empty(0))
    for k in {np.argmin(timesteps).item(), np.argmax(timesteps).item()} if len(timesteps) else ():
        with _of_shot(k):
            dataclasses.replace(engine, dt=timesteps[k].item())
    return arrays


@contextlib.contextmanager
def _of_shot(k: int) -> Iterator[None]:
    """Adds the number of the shot to the message of a ValueError."""
    try:
        yield
    except ValueError as error:
        raise ValueError(f"shot {k}: {error}") from None


def _fill_in_play(array: NDArray[np.bool_], values: ArrayLike | None) -> None:
    """Fills an array with given values, or with True."""
    in_play, shape = array_of("in_play", True if values is None else values), array.shape
    if in_play.dtype != np.bool_:
        raise ValueError(f"in_play = {short(values)}: expected True or False for each ball")
    if values is not None and in_play.shape not in (shape, shape[-1:]):
        raise ValueError(f"in_play has shape {in_play.shape}: expected {shape[-1:]}, one value per ball")
    array[...] = in_play


def _fill(array: Floats, name: str, values: ArrayLike) -> None:
    """Fills an array with the values of all balls, or of the cue ball and zeros. Checks only their shape."""
    source, full = numbers(name, values), array.shape
    cue_ball_alone = (*full[:-2], full[-1])
    if source.shape == full:
        array[...] = source
    elif source.shape == cue_ball_alone:
        array[..., 0, :] = source
        array[..., 1:, :] = 0.0
    else:
        raise ValueError(
            f"{name} has shape {source.shape}: expected {full} for all balls or {cue_ball_alone} for the cue ball"
        )


def _split(array: Floats) -> tuple[Floats, Floats | None]:
    """Returns vectors (..., 2) and the third components (..., 1) of vectors (..., 3), or None."""
    if array.ndim and array.shape[-1] == 3:
        return array[..., :2], array[..., 2:]
    return array, None


def _fill_heights(
    scene: Scene, shot: ShotInput, heights: Floats, above: Floats | None, rising: Floats | None
) -> NDArray[np.bool_]:
    """Fills the heights of a shot or a batch, and checks those of balls in the air.

    Returns:
        (n,) or (m, n) bool: the balls in play on the cloth.
    """
    heights[...] = 0.0
    given = ("positions", above, Range(0.0, 1e4, "m")), ("velocities", rising, RANGES["speed"])
    for column, (name, values, within) in enumerate(given):
        if values is None:
            continue
        _fill(heights[..., column : column + 1], name, values)
        filled = heights[..., column]
        assert within.most is not None
        bad = np.argwhere(~((filled >= within.least) & (filled <= within.most)))
        if len(bad):
            at = tuple(bad[0])
            raise ValueError(f"{_entry(name, *at, 2)} = {short(filled[at])}: expected {range_text('a number', within)}")
    flies = shot.in_play & (heights[..., 0] > 0.0)
    if flies.any():
        _check_in_air(scene, shot, heights[..., 0], flies)
    return shot.in_play & ~flies


def _check_in_air(scene: Scene, shot: ShotInput, z: Floats, flies: NDArray[np.bool_]) -> None:
    """Raises a ValueError if a ball in the air is not above the table or overlaps another ball."""
    n, radius = scene.n_balls, np.array(scene.balls.radius)
    places = np.concatenate((shot.positions, z[..., None]), axis=-1).reshape(-1, n, 3)
    in_play, flying = shot.in_play.reshape(-1, n), flies.reshape(-1, n)
    if not _are_free(scene_kernels(scene), scene_fields(scene), places, flying):
        raise ValueError(
            f"positions = {short(shot.positions.tolist())}: expected balls in the air between the noses of the cushions"
        )
    reach, centres = np.add.outer(radius, radius) - CONTACT_GAP, places + np.outer(radius, [0.0, 0.0, 1.0])
    for k in np.flatnonzero(flying.any(axis=1)).tolist():
        apart = np.linalg.norm(centres[k, :, None] - centres[k], axis=-1)
        meets = (apart < reach) & flying[k][:, None] & in_play[k] & ~np.eye(n, dtype=bool)
        if meets.any():
            i, j = np.argwhere(meets)[0].tolist()
            gap, least = short(apart[i, j]), short(reach[i, j])
            raise ValueError(f"positions: balls {i} and {j} are {gap} m apart: expected at least {least} m")


@entry_point
def _are_free(kernels, scene, places, flying):
    """Returns whether balls at `places`, (m, n, 3) m, are between the noses or over a pocket, and overlap no nose.

    `flying`, (m, n) bool, marks the balls to test.
    """
    arrays, free = scene_of(kernels, scene, 0), True
    for k in range(len(places)):
        for i in range(places.shape[1]):
            free = free and (not flying[k, i] or is_free(i, places[k, i], arrays))
    return free


@cached_by_scene
def _fast_check(scene: Scene) -> Typed:
    """Returns `is_valid_fast`, or `is_valid_fast_of_many`, without its argument `kernels`."""
    return Typed(is_valid_fast_of_many if scene.n_balls >= MANY_BALLS else is_valid_fast, scene_kernels(scene))


def _is_valid_fast(scene: Scene, shot: ShotInput, threads: int | None) -> bool:
    """Calls `is_valid_fast` for one shot or, on several threads, for many."""
    is_valid, arrays = _fast_check(scene), scene_fields(scene)
    starts = shot.as_batch() if shot.in_play.ndim == 1 else start_fields(shot)
    doubtful: list[int] = []

    def work(begin: int, end: int) -> None:
        if not is_valid.call(begin, end, arrays, starts):
            doubtful.append(begin)

    parallel_for(work, len(starts[0]), threads)
    return not doubtful


def _check_motion(scene: Scene, name: str, array: Floats, within: Range) -> None:
    """Raises a ValueError if a velocity or spin is out of range, or if a ball of infinite mass moves."""
    most = within.most
    bad = np.argwhere(~(np.abs(array) <= most).all(axis=-1))
    if len(bad):
        at = tuple(bad[0])
        raise ValueError(f"{_entry(name, *at)} = {array[at].tolist()}: expected {range_text('numbers', within)}")
    bad = np.argwhere(np.isinf(scene.balls.mass) & array.any(axis=-1))
    if len(bad):
        at = tuple(bad[0])
        raise ValueError(
            f"{_entry(name, *at)} = {short(array[at].tolist())}: expected zero, the ball has an infinite mass"
        )


def _entry(name: str, *at: Any) -> str:
    """Returns the name of an entry of an argument, such as "velocities[3][0]" of ball 0 in shot 3 of a batch."""
    return name + "".join(f"[{k}]" for k in at)
