"""The stages of a fit: rows until the first contact of the cue ball, until the second, and so on."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from billiards_env.calibration.fit import Fit, covariance, fit_shared, values_of
from billiards_env.calibration.preparation import PreparedTrack
from billiards_env.calibration.starts import errors, search
from billiards_env.calibration.tracks import Bools

ENOUGH = 0.5
"""The least share of the rows until the second contact that are near their paths."""

_ROUNDS = 2  # searches in each stage, each followed by a fit of the constants
_FAR = 8.0  # the least error of a far row over the scale of the loss, or over the typical error if this is larger
_RUN, _OF = 3, 4  # a track has left its path where 3 of 4 consecutive rows of a ball are far from it


def near_rows(fit: Fit, contact: int) -> Fit:
    """Returns a fit whose shots use only the rows near their paths, from the errors of the rows until a contact."""
    pairs = [(shot, np.hypot(*errors(fit.scene, shot).T)) for shot in fit.shots]
    typical = np.median(np.concatenate([[0.0], *(off[shot.until(contact).used & shot.moving] for shot, off in pairs)]))
    shots = []
    for shot, off in pairs:
        far = shot.before(contact) & (off > _FAR * max(shot.scale, typical))
        leaves = leaves_at(shot, far)
        shots.append(shot._replace(used=~far & (shot.time < leaves[0]), leaves=leaves))
    return fit._replace(shots=shots)


def leaves_at(shot: PreparedTrack, far: Bools) -> tuple[float, int]:
    """Returns the time at which a track first leaves its path, s, and the ball; inf and -1 if none does.

    There, at least `_RUN` of `_OF` consecutive rows of a ball are far.
    """
    leaves = [(np.inf, -1)]
    for ball in np.unique(shot.track.balls[far]):
        rows = np.flatnonzero(shot.track.balls == ball)
        ahead = np.convolve(far[rows], np.ones(_OF))[_OF - 1 :]
        leaves += [(float(time), int(ball)) for time in shot.time[rows[far[rows] & (ahead >= _RUN)]][:1]]
    return min(leaves)


def fit_stages(fit: Fit, contacts: int, progress: Callable[[str], object]) -> Fit:
    """Fits the rows until the first contact of the cue ball, then until the second, and so on.

    The first stage fits only the starts, the others also the constants. The fit ends with the second contact if
    `Fit.share` is less than `ENOUGH`.
    """
    fit = fit._replace(shots=[search(fit.scene, shot.wide(1)) for shot in fit.shots])
    for contact in range(2, contacts + 1):
        for _ in range(_ROUNDS):
            fit = fit._replace(shots=[search(fit.scene, shot.wide(contact)) for shot in fit.shots])
            fit, _ = fit_shared(fit, contact)
        values, variances = values_of(fit.scene, fit.names), np.diag(covariance(fit, contact)).tolist()
        stage = dict(zip(fit.names, zip(values.values(), variances, strict=True), strict=True))
        near = np.concatenate([shot.used[shot.moving & shot.before(contact)] for shot in near_rows(fit, contact).shots])
        share = float(near.mean()) if near.size else 0.0
        fit = fit._replace(stages=(*fit.stages, stage), share=share if contact == 2 else fit.share)
        text = ", ".join(f"{name} {value:.5g}" for name, value in values.items())
        progress(f"until contact {contact}: {share:.1%} of the rows, {text}")
        if fit.share < ENOUGH:
            break
    return fit
