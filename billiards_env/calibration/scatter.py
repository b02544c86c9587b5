"""An estimate of the scatter of cushions from fitted shots.

Each contact with a cushion has five small unknown changes, see `physics.scatter`. The errors of the rows are linear in
these changes and in the start of the shot. The changes have Student's distribution, so a contact that does not fit at
all has little weight. Expectation and maximisation find the standard deviations with the largest likelihood (Lange,
Little and Taylor 1989).

In real shots the changes also contain errors of the laws, so the estimate is an upper limit. In simulated shots, which
have no such errors, the estimate is up to a quarter too small.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from billiards_env.calibration.preparation import CAUCHY, INSTANT, PreparedTrack
from billiards_env.calibration.starts import linearised, simulated
from billiards_env.calibration.tracks import Floats, Ints
from billiards_env.scene import Scene
from billiards_env.shots.noise import SCATTER
from billiards_env.shots.result import ShotResult
from billiards_env.shots.simulation import simulate_batch

FEWEST = 30
"""The least number of contacts for an estimate."""

_PARTS = np.array([0, 1, 2, 2, 2])  # of the five changes, in the order of `SCATTER`
_SMALL, _SOON = 1e-4, 1e-4  # a relative change, and its time after the contact, s
_STEPS, _BEGIN, _QUANTILE = 100, 0.03, 1.96
_FREEDOM = 4.0  # of Student's distribution
_MOST = 10.0  # m, the limit of a derivative of a place; a larger one may come from other contacts


class Scattered(NamedTuple):
    """The scatter of the cushions.

    Attributes:
        values: The standard deviations, as the argument `scatter` of `simulate`.
        intervals: Their 95% intervals.
        contacts: The number of contacts.
    """

    values: dict[str, float]
    intervals: dict[str, tuple[float, float]]
    contacts: int


def estimate(scene: Scene, shots: Sequence[PreparedTrack], noise: float) -> Scattered | None:
    """Returns the scatter of the cushions in fitted shots, or None with fewer than `FEWEST` contacts.

    Args:
        scene: The scene with the fitted constants.
        shots: The shots with their starts; the rows that are used.
        noise: Standard deviation of a coordinate of a row without any scatter, m. It should include the errors of the
            laws between two contacts, which many rows share: 3 mm on a real table.
    """
    both = [_normal(scene, shot, noise) for shot in shots if shot.used.any()]
    contacts = sum(len(slope) // len(_PARTS) for _, slope in both)
    if contacts < FEWEST:
        return None
    deviations, scores = np.full(len(SCATTER), _BEGIN), np.empty(0)
    for _ in range(_STEPS):
        scores = np.array([_score(matrix, slope, deviations) for matrix, slope in both])
        deviations = deviations * np.sqrt(1.0 + scores.sum(axis=0) / (contacts * np.bincount(_PARTS)))
    width = _QUANTILE * np.sqrt(np.diag(np.linalg.inv(scores.T @ scores)))
    ends = zip((deviations * np.exp(-width)).tolist(), (deviations * np.exp(width)).tolist(), strict=True)
    values = dict(zip(SCATTER, deviations.tolist(), strict=True))
    return Scattered(values, dict(zip(SCATTER, ends, strict=True)), contacts)


def _score(matrix: Floats, slope: Floats, deviations: Floats) -> Floats:
    """Returns the derivatives (3,) of the log-likelihood of a shot with respect to the logarithms of the deviations."""
    part = np.tile(_PARTS, len(slope) // len(_PARTS))
    scale = deviations[part]
    covariance = np.linalg.inv(scale[:, None] * matrix * scale + np.eye(len(slope)))
    squares = np.square(covariance @ (scale * slope)) + np.diag(covariance)  # of the changes, expected
    weights = (_FREEDOM + len(_PARTS)) / (_FREEDOM + squares.reshape(-1, len(_PARTS)).sum(axis=1))
    scores: Any = np.bincount(part, np.repeat(weights, len(_PARTS)) * squares - 1.0, minlength=len(deviations))
    return scores


def _normal(scene: Scene, shot: PreparedTrack, noise: float) -> tuple[Floats, Floats]:
    """Returns the normal equations of the changes at the c contacts of a shot, without what its start explains.

    Returns:
        (5 c, 5 c) and (5 c,), for errors of the rows over their standard deviation.
    """
    values, jacobian = linearised(scene, shot.starts, shot._replace(scale=noise))
    values, jacobian, rows = values[0], jacobian[0], 2 * np.count_nonzero(shot.used)
    values[rows:], jacobian[rows:] = CAUCHY * values[rows:], CAUCHY * jacobian[rows:]
    result = simulated(scene, shot)
    events: Any = result.events
    times, balls = shot.time[shot.used] - shot.starts[0, INSTANT], shot.track.balls[shot.used]
    changes = np.zeros((len(values), 0))
    for event in events[events["kind"] == "cushion"]:
        ball, begin = int(event["ball"]), float(event["time"]) + _SOON
        if (balls[times > begin] == ball).any():
            rates = _rates(scene, result, ball, begin, times, balls).reshape(rows, -1) / noise
            changes = np.column_stack((changes, np.pad(rates, [(0, len(values) - rows), (0, 0)])))
    free = jacobian[:, np.isnan(shot.known)]
    changes -= free @ np.linalg.lstsq(free, changes, rcond=1e-10)[0]
    return changes.T @ changes, changes.T @ values


def _rates(scene: Scene, shot: ShotResult, ball: int, begin: float, times: Floats, balls: Ints) -> Floats:
    """Returns the derivatives (r, 2, 5) of places of balls (r,) at times (r,) with respect to changes of a motion.

    The changes are the relative ones of `physics.scatter`, at the time `begin`, just after a contact.
    """
    assert shot.trajectory is not None
    positions, (velocities, spins) = shot.at(begin), shot.motion_at(begin)
    steps, clearance = 1e-6 * np.eye(2), scene.table.clearance
    normal = clearance(positions[ball] + steps) - clearance(positions[ball] - steps)
    normal /= np.hypot(*normal)
    axes, speed = np.array([normal, (-normal[1], normal[0])]), np.hypot(*velocities[ball])
    units = np.zeros((len(_PARTS), 5))  # of the velocity and the spin of the ball
    units[:2, :2], units[2:4, 2:4], units[4, 4] = axes, axes, 1.0
    units *= np.array([velocities[ball] @ normal, speed, *[speed / scene.balls.radius[ball]] * 3])[:, None]
    motions = np.repeat(np.concatenate((velocities, spins), axis=1)[None], 2 * len(_PARTS), axis=0)
    motions[:, ball] += _SMALL * np.concatenate((units, -units))
    since = np.maximum(times - begin, 0.0)
    others = simulate_batch(
        *(scene, np.repeat(positions[None], len(motions), axis=0), motions[..., :2]),
        spins=motions[..., 2:] if scene.physics.motion == "sliding" else None,
        in_play=shot.trajectory.potted_at > begin,
        max_time=float(since.max()),
        record=True,
        threads=1,
    )
    places = np.array([other.at(since)[np.arange(len(since)), balls] for other in others])
    rates = (places[: len(_PARTS)] - places[len(_PARTS) :]) / (2.0 * _SMALL)
    return np.clip(np.moveaxis(rates, 0, -1), -_MOST, _MOST)
