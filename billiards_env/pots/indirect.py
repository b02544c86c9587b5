"""Finds indirect pots by geometry: combinations, caroms and kicks.

* Combination: the cue ball hits a legal ball, which hits a second ball into a pocket.
* Carom: the cue ball glances off a legal ball and then hits a second ball into a pocket, or a legal ball glances off a
  second ball into a pocket.
* Kick: the cue ball meets one cushion, and then a legal ball, with or without a pot.

The first aim ignores friction: a ball that glances off another one follows the tangent at their contact, and a cushion
reflects like a mirror. A few Newton steps on the margin of the shot (`shot_derivatives.Margins`) correct the
direction for each speed.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_env.derivatives.shot_derivatives import check_derivatives, margin_columns, margins_by_cue_ball
from billiards_env.engine.strikes import strike_with
from billiards_env.pots.budget import Budget
from billiards_env.pots.finder import DX, DY, SHOT_WIDTH, SPEED, SPEEDS
from billiards_env.shots.simulation import simulate_batch
from billiards_env.shots.tables import Tables

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

MOST = 12
"""The largest number of ways."""

TIME = 0.4
"""The share of the time of a budget after which no more ways are corrected."""

_UNLIMITED = Budget()
_CUE_SPEEDS = np.array([1.8, 3.2, 5.0])  # m/s
_THICK = 0.25  # least cosine of the angle between the direction of a ball and the line of centres at its hit
_GRAZE = 0.1  # the same where a ball glances off another one
_CHECKED = 60  # ways whose paths are compared with the other balls
_STEPS = 3  # of Newton's method
_LONGEST = 0.1  # rad; its longest step
_WIDER = 2.0  # largest tolerance after the correction over that before


class Ways(NamedTuple):
    """k indirect pots, and kicks without a pot.

    Attributes:
        target: (k, 2) the ball to pot and the pocket, -1 for a kick without a pot.
        shots: (k, s, SHOT_WIDTH) as in `Pots.shots`; only the direction and the speed are given.
        tolerance: (k,) rad: the largest error of the direction that still reaches the target, to first order.
    """

    target: Ints
    shots: Floats
    tolerance: Floats


class _Chains(NamedTuple):
    """k ways before the correction.

    Attributes:
        target: (k, 2) the ball to pot and the pocket, -1 for a kick without a pot.
        legal: (k,) the ball that the cue ball touches first.
        ends: (k, 3, 2, 2) m: the beginnings and ends of three straight paths; equal where a path is not used.
        spare: (k, 3, 2) two balls that each path may touch.
        aim: (k, 2) m: the point at which the cue ball is aimed.
        tolerance: (k,) rad: the largest error of the direction that still reaches the target, to first order.
    """

    target: Ints
    legal: Ints
    ends: Floats
    spare: Ints
    aim: Floats
    tolerance: Floats


def find_indirect(tables: Tables, targets: Ints, most: int = MOST, budget: Budget = _UNLIMITED) -> Ways:
    """Returns the ways with the largest tolerance.

    Args:
        tables: One table with pockets and with the cue ball in its place. The shots use the engine "pic".
        targets: The balls that may be potted.
        most: The largest number of ways, at most `MOST`.
        budget: Corrections end when a share `TIME` of its time is used.

    Raises:
        ValueError: If the shots of the scene have no derivatives.
    """
    check_derivatives(tables.scene, "find_indirect", "find_pots")
    scene, (positions,) = tables.scene, tables.positions
    balls = np.flatnonzero(tables.in_play[0])
    balls, legal = balls[balls != tables.cue], np.flatnonzero(tables.targets[0])
    widths = [pocket.half_width for pocket in scene.table.pockets]
    pockets = np.column_stack((scene.table.pocket_places, widths))  # (p, 3): the places and half the widths
    reach = 2.0 * max(scene.balls.radius)
    room = np.array([scene.table.length, scene.table.width]) / 2.0 - reach / 2.0
    cue, others = positions[tables.cue], np.intersect1d(balls, targets)
    over_balls = _over_balls(cue, positions, legal, others, pockets, reach)
    kicks = _kicks(cue, positions, legal, others, pockets, reach, room)
    chains = _best(_joined([over_balls, kicks]), _CHECKED)
    far = _gaps(chains, positions[balls], balls) > reach
    within = (np.abs(chains.ends.reshape(-1, 6, 2)[:, :5]) <= room + 1e-6).all(axis=(1, 2))
    return _corrected(tables, _best(_select(chains, far & within), min(most, MOST)), budget)


def _best(chains: _Chains, most: int) -> _Chains:
    order = np.argsort(-chains.tolerance, kind="stable")[:most]
    order = order[chains.tolerance[order] > 0.0]
    return _select(chains, order)


def _select(chains: _Chains, which: Any) -> _Chains:
    arrays: Any = (array[which] for array in chains)
    return _Chains(*arrays)


def _joined(parts: list[_Chains]) -> _Chains:
    arrays: Any = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    return _Chains(*arrays)


def _unit(vectors: Floats) -> tuple[Floats, Floats]:
    """Returns the lengths and the directions of vectors (..., 2)."""
    lengths = np.maximum(np.hypot(vectors[..., 0], vectors[..., 1]), 1e-9)
    return lengths, vectors / lengths[..., None]


def _over_balls(cue: Floats, positions: Floats, legal: Ints, others: Ints, pockets: Floats, reach: float) -> _Chains:
    """Returns the combinations and the caroms."""
    a, b, p, side = (
        array.ravel() for array in np.meshgrid(legal, others, np.arange(len(pockets)), (0, -1, 1), indexing="ij")
    )
    a, b, p, side = (array[a != b] for array in (a, b, p, side))
    first, second, goal = positions[a], positions[b], pockets[p, :2]
    parts = []

    # The second ball is potted: by the first ball (side 0), or by the cue ball that glances off the first one.
    run, line = _unit(goal - second)
    ghost = second - reach * line
    glance = side != 0
    at, graze = _tangent(ghost, first, reach, side)
    approach, way = _unit(ghost - np.where(glance[:, None], at, first))
    aim = np.where(glance[:, None], at, first - reach * way)
    far, begin = _unit(aim - cue)
    cut, cut_first = (way * line).sum(axis=1), (begin * _unit(first - aim)[1]).sum(axis=1)
    ok = (cut > _THICK) & (cut_first > _THICK) & (~glance | (graze & ((begin * way).sum(axis=1) > _GRAZE)))
    tolerance = pockets[p, 2] / run * np.minimum(reach * cut / approach, 1.0) * reach * cut_first / far
    ends = _paths(cue, aim, np.where(glance[:, None], aim, first), ghost, second, goal)
    spare = np.stack((np.stack((a, a), -1), np.stack((a, b), -1), np.stack((a, b), -1)), axis=1)
    parts.append(_Chains(np.stack((b, p), -1), a, ends, spare, aim, np.where(ok, tolerance, 0.0)))

    # The first ball is potted off the second one.
    at, graze = _tangent(goal, second, reach, side)
    approach, way = _unit(at - first)
    run, line = _unit(goal - at)
    aim = first - reach * way
    far, begin = _unit(aim - cue)
    cut, cut_first = (way * _unit(second - at)[1]).sum(axis=1), (begin * way).sum(axis=1)
    ok = glance & graze & (cut > _GRAZE) & (cut_first > _THICK) & ((way * line).sum(axis=1) > _GRAZE)
    tolerance = pockets[p, 2] / run * np.minimum(reach * cut / approach, 1.0) * reach * cut_first / far
    ok &= np.isin(a, others)
    ends = _paths(cue, aim, first, at, at, goal)
    parts.append(_Chains(np.stack((a, p), -1), a, ends, spare, aim, np.where(ok, tolerance, 0.0)))
    return _joined(parts)


def _kicks(
    cue: Floats, positions: Floats, legal: Ints, others: Ints, pockets: Floats, reach: float, room: Floats
) -> _Chains:
    """Returns the kicks."""
    a, p, wall = (array.ravel() for array in np.meshgrid(legal, np.arange(-1, len(pockets)), range(4), indexing="ij"))
    ball, goal, potted = positions[a], pockets[p, :2], p >= 0
    run, line = _unit(goal - ball)
    aim = np.where(potted[:, None], ball - reach * line, ball)
    axis, limit = wall // 2, np.where(wall % 2 == 1, 1.0, -1.0) * room[wall // 2]
    rows = np.arange(len(a))
    image = aim.copy()
    image[rows, axis] = 2.0 * limit - image[rows, axis]
    far, begin = _unit(image - cue)
    share = (limit - cue[axis]) / np.where(begin[rows, axis] == 0.0, 1e-9, far * begin[rows, axis])
    bounce = cue + share[:, None] * (image - cue)
    way = begin.copy()
    way[rows, axis] *= -1.0
    cut = (way * line).sum(axis=1)
    tolerance = np.where(potted, pockets[p, 2] / run * reach * cut, 0.5 * reach) / far
    ok = (share > 0.0) & (share < 1.0) & (~potted | ((cut > _THICK) & np.isin(a, others)))
    near_pocket = np.hypot(*(bounce[:, None] - pockets[:, :2]).transpose(2, 0, 1)) < 1.2 * pockets[:, 2]
    ok &= ~near_pocket.any(axis=1)
    ends = _paths(cue, bounce, bounce, aim, ball, np.where(potted[:, None], goal, ball))
    target = np.where(potted[:, None], np.stack((a, p), -1), -1)
    spare = np.broadcast_to(a[:, None, None], (len(a), 3, 2))
    spare = np.where(np.arange(3)[:, None] == 0, -1, spare)
    return _Chains(target, a, ends, spare, image, np.where(ok, tolerance, 0.0))


def _tangent(points: Floats, centres: Floats, reach: float, side: Ints) -> tuple[Floats, NDArray[np.bool_]]:
    """Returns where the tangents (k, 2) from points touch circles, on one side, and whether there is a tangent."""
    far, to = _unit(points - centres)
    cosine = np.minimum(reach / far, 1.0)
    sine = side * np.sqrt(1.0 - cosine**2)
    turned = np.stack((cosine * to[:, 0] - sine * to[:, 1], sine * to[:, 0] + cosine * to[:, 1]), axis=-1)
    return centres + reach * turned, far > reach


def _paths(*points: Floats) -> Floats:
    """Returns the ends (k, 3, 2, 2) of three paths from their six ends, (k, 2) or (2,)."""
    return np.stack(np.broadcast_arrays(*points), axis=1).reshape(-1, 3, 2, 2)


def _gaps(chains: _Chains, balls: Floats, numbers: Ints) -> Floats:
    """Returns the least distance (k,) of the paths from the centres of the balls that they may not touch, m."""
    begin, along = chains.ends[:, :, 0], chains.ends[:, :, 1] - chains.ends[:, :, 0]
    to = balls - begin[:, :, None]
    square = np.maximum((along**2).sum(axis=-1), 1e-12)[..., None]
    share = np.clip((to * along[:, :, None]).sum(axis=-1) / square, 0.0, 1.0)
    gaps = np.hypot(*np.moveaxis(to - share[..., None] * along[:, :, None], -1, 0))
    spare = (numbers == chains.spare[..., None]).any(axis=-2)
    return np.where(spare, np.inf, gaps).min(axis=(1, 2), initial=np.inf)


def _corrected(tables: Tables, chains: _Chains, budget: Budget) -> Ways:
    """Returns the ways after Newton's method; those without success at any speed are left out."""
    scene, (positions,), k, cue = tables.scene, tables.positions, len(chains.target), tables.cue
    n, speeds = len(positions), np.minimum(_CUE_SPEEDS, tables.max_speed)
    shots = np.zeros((k, len(SPEEDS), SHOT_WIDTH))
    if k == 0:
        return Ways(chains.target, shots, chains.tolerance)
    to = chains.aim - positions[cue]
    angles = np.arctan2(to[:, 1], to[:, 0])[:, None].repeat(len(speeds), axis=1).ravel()
    speed, chain = np.tile(speeds, k), np.arange(k).repeat(len(speeds))
    ball, pocket = chains.target[chain].T
    potted = ball >= 0
    row, column = np.where(potted, ball, cue), np.where(potted, n + pocket, chains.legal[chain])
    widths = np.array([pocket.half_width for pocket in scene.table.pockets])
    deepest = np.where(potted, widths[pocket], 2.0 * scene.balls.radius[0])
    selected = np.zeros((n, margin_columns(scene)["cushion_margins"].stop), bool)
    selected[row, column] = True
    best, kept, slopes = np.full(len(chain), -np.inf), angles.copy(), np.ones(len(chain))
    for piece in budget.pieces(len(chain), TIME):
        rows = np.arange(piece.stop - piece.start)
        for _ in range(_STEPS):
            velocities = speed[piece, None] * np.column_stack((np.cos(angles[piece]), np.sin(angles[piece])))
            places = np.broadcast_to(positions, (len(rows), n, 2))
            strokes = strike_with(velocities) if scene.physics.motion == "sliding" else velocities
            batch = simulate_batch(scene, places, strokes, in_play=tables.in_play[0], record=True, threads=1)
            margins, by = margins_by_cue_ball(batch, selected)
            margin, by = margins[rows, row[piece], column[piece]], by[rows, :, row[piece], column[piece]]
            slope = -velocities[:, 1] * by[:, 0] + velocities[:, 0] * by[:, 1]
            better = margin > best[piece]
            for array, new in ((best, margin), (kept, angles[piece]), (slopes, slope)):
                array[piece] = np.where(better, new, array[piece])
            moves = np.isfinite(margin) & (np.abs(slope) > 1e-6)
            step = np.where(moves, (deepest[piece] - margin) / np.where(moves, slope, 1.0), 0.0)
            angles[piece] = kept[piece] + np.where(better, np.clip(step, -_LONGEST, _LONGEST), 0.0)
    works = (best > 0.0).reshape(k, -1)
    shots[:, : len(speeds), DX], shots[:, : len(speeds), DY] = (f(kept).reshape(k, -1) for f in (np.cos, np.sin))
    shots[:, : len(speeds), SPEED] = np.where(works, speeds, 0.0)
    tolerance = np.where(works, (deepest / np.maximum(np.abs(slopes), 1e-6)).reshape(k, -1), 0.0).max(axis=1)
    tolerance = np.minimum(tolerance, _WIDER * chains.tolerance)
    useful = works.any(axis=1)
    return Ways(chains.target[useful], shots[useful], tolerance[useful])
