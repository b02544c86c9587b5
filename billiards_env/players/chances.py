"""The probability of a pot under execution noise, to first order: one simulation of a shot instead of many samples.

To first order, an error of the stroke shifts the state of a ball just after its last contact with another ball in
proportion to the error. From the shifted state, its path without other balls decides whether it drops. The result is
the probability that the object ball drops and the cue ball does not.
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
from billiards_env.shots.gradients import Record, states_by_errors
from billiards_env.shots.simulation import simulate_batch

Floats = NDArray[np.float64]

_DIRECTIONS, _SPEEDS = 48, 5  # numbers of errors of the direction, equally probable, and of the speed
_CUSHIONS = 8  # a path ends at this number of cushions
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
        The probabilities; 0 for a shot in which no other ball touches it.

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

    potted, touched = _drops(record, ball, errors)
    scratches, _ = _drops(record, CUE_BALL, errors)
    good = (potted & ~scratches & touched[:, None]).reshape(-1, _DIRECTIONS, _SPEEDS)
    return (good.mean(axis=1) * weights).sum(axis=1) / weights.sum()


def _drops(record: Record, ball: int, errors: Floats) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Returns whether a ball drops (m, e), for errors (e, 2), and whether another ball touches it (m,)."""
    times, begins = _last_contacts(record, ball)
    touched, radius = ~np.isnan(times), record.scene.balls.radius[ball]
    changes = states_by_errors(record, np.minimum(times + _AFTER, record.time))[:, :, ball, :7]
    changes[..., 4:6] = changes[..., 2:4] + radius * changes[..., [5, 4]] * (-1.0, 1.0)  # of the slip
    starts = begins[:, None] + np.einsum("mkc,ek->mec", changes, errors)
    drops = np.zeros(starts.shape[:2], bool)
    drops[touched] = _follow_all(scene_fields(record.scene), ball, starts[touched])
    return drops, touched


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
def _follow_all(scene, ball, starts):
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
