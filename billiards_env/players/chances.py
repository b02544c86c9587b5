"""The probability of a pot under execution noise, to first order: one simulation of a shot instead of many samples.

After the last contact of the object ball, its state changes in proportion to the errors of the stroke, to first order.
From there its path without other balls decides whether it drops. To first order, the cue ball drops if the margin of a
pocket (see `shots.gradients.Margins`) becomes positive. The result is the probability of the errors for which the
object ball drops and the cue ball does not.
"""

from __future__ import annotations

from statistics import NormalDist

import numpy as np
from numpy.typing import ArrayLike, NDArray

from billiards_env.engine import scene_fields
from billiards_env.engine.log import BALL, BALL_BALL, KIND, OTHER, SEGMENT_BALL, SEGMENT_ROW, TIME
from billiards_env.jit import allocating_entry_point
from billiards_env.physics.state import CUE_BALL, T0, UX, UY, VX, VY, WZ, SceneArrays, X, Y, empty_state
from billiards_env.players.paths import follow
from billiards_env.scene import Scene
from billiards_env.shots.gradients import Record, margin_columns, margins_by_errors, states_by_errors
from billiards_env.shots.simulation import simulate_batch

Floats = NDArray[np.float64]

_DIRECTIONS, _SPEEDS = 96, 5  # errors of the direction, equally probable, and of the speed
_CUSHIONS = 4  # the object ball drops before it has met this number of cushions, or not at all
_AFTER = 1e-9  # s after a contact, when the change of the state includes that of the contact


def pot_chances(
    scene: Scene,
    positions: ArrayLike,
    velocities: ArrayLike,
    ball: int,
    noise: tuple[float, float],
    spins: ArrayLike | None = None,
) -> Floats:
    """Returns the probability (m,) that shots with errors pot a ball and not the cue ball, to first order.

    Args:
        scene: The scene, with pockets.
        positions: (m, n, 2) m.
        velocities: (m, 2) of the cue ball, m/s.
        ball: The ball to pot.
        noise: Standard deviations of the direction, degrees, and of the speed, m/s. The spin turns with the direction
            and changes in proportion to the speed.
        spins: (m, 3) rad/s; None for zero.

    Returns:
        The probabilities; 0 for a shot in which nothing touches the ball.

    Example:
        >>> scene = Scene.named("pool", 1)
        >>> pot_chances(scene, [[[0.6, 0.1], [1.07, 0.435]]], [[1.5, 1.035]], 1, (0.125, 0.075)).round(2).tolist()
        [1.0]
    """
    batch = simulate_batch(scene, positions, velocities, spins=spins, record=True, threads=1)
    record, scale = batch._record("jacobian"), np.array((np.radians(noise[0]), noise[1]))
    speeds, weights = np.polynomial.hermite_e.hermegauss(_SPEEDS)
    directions = [NormalDist().inv_cdf((k + 0.5) / _DIRECTIONS) for k in range(_DIRECTIONS)]
    errors = scale * np.stack(np.meshgrid(directions, speeds, indexing="ij"), axis=-1).reshape(-1, 2)

    times, begins = _last_contacts(record, ball)
    radius = scene.balls.radius[ball]
    changes = states_by_errors(record, np.minimum(times + _AFTER, record.time))[:, :, ball, :7]
    changes[..., 4:6] = changes[..., 2:4] + radius * changes[..., [5, 4]] * (-1.0, 1.0)  # of the slip
    starts = begins[:, None] + np.einsum("mkc,ek->mec", changes, errors)
    drops = np.zeros(starts.shape[:2], bool)
    known = ~np.isnan(times)
    drops[known] = _drops(scene_fields(scene), ball, starts[known])

    columns = margin_columns(scene)
    wanted = np.zeros((scene.n_balls, columns["cushion_margins"].stop), bool)
    wanted[CUE_BALL, columns["pocket_margins"]] = True
    margins, slopes = margins_by_errors(record, wanted)
    margins, slopes = margins[:, CUE_BALL, columns["pocket_margins"]], slopes[..., CUE_BALL, columns["pocket_margins"]]
    # A path that passes the far rim of the pocket does not enter it.
    width = 2.0 * np.array([pocket.radius for pocket in scene.table.pockets])
    depths = np.where(np.isfinite(margins), margins, -np.inf)[:, None] + np.einsum("mkp,ek->mep", slopes, errors)
    scratches = ((depths > 0.0) & (depths < width)).any(axis=-1)
    return ((drops & ~scratches).reshape(-1, _DIRECTIONS, _SPEEDS).mean(axis=1) * weights).sum(axis=1) / weights.sum()


def _last_contacts(record: Record, ball: int) -> tuple[Floats, Floats]:
    """Returns when a ball last touched another one (m,), NaN for never, and its state after it (m, 7).

    The state is position, velocity, slip and vertical spin.
    """
    times, states = np.full(len(record.time), np.nan), np.zeros((len(record.time), 7))
    for part in record.parts:
        (first, first_piece), (end, end_piece) = part.bounds[[0, -1]]
        events, pieces = part.events[first:end], part.segments[first_piece:end_piece]
        shots, owners = (np.arange(part.begin, part.end).repeat(counts) for counts in np.diff(part.bounds, axis=0).T)
        contacts = (events[:, KIND] == BALL_BALL) & ((events[:, BALL] == ball) | (events[:, OTHER] == ball))
        times[shots[contacts]] = events[contacts, TIME]  # of several contacts the last one remains
        after = (pieces[:, SEGMENT_BALL] == ball) & (pieces[:, SEGMENT_ROW + T0] == times[owners])
        columns = [SEGMENT_ROW + column for column in (X, Y, VX, VY, UX, UY, WZ)]
        states[owners[after]] = pieces[after][:, columns]
    return times, states


@allocating_entry_point
def _drops(scene, ball, starts):
    """Returns whether a ball with the states (m, e, 7) drops, (m, e)."""
    scene = SceneArrays(scene[0][0], *scene[1:])
    state, gaps = empty_state(len(scene.radius)), np.empty(_CUSHIONS)
    found = np.zeros(starts.shape[:2], np.bool_)
    for k in range(starts.shape[0]):
        for e in range(starts.shape[1]):
            row = state.rows[ball]
            row[:] = 0.0
            start = starts[k, e]
            row[X], row[Y], row[VX], row[VY] = start[0], start[1], start[2], start[3]
            row[UX], row[UY], row[WZ] = start[4], start[5], start[6]
            follow(scene, state, ball, gaps)
            found[k, e] = gaps.min() < 0.0
    return found
