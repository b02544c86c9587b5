"""The stages of a fit: rows until the first contact of the cue ball, until the second, and so on.

A file holds the finished stages.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from billiards_env.calibration.fit import Fit, covariance, fit_shared, values_of, with_physics
from billiards_env.calibration.shot import Shot
from billiards_env.calibration.starts import errors, search
from billiards_env.calibration.tracks import Bools
from billiards_env.shots import records
from billiards_env.support.checks import Range, finite, integer
from billiards_env.support.files import refusing, write_json

StatePath = str | os.PathLike[str] | None
Progress = Callable[[str], None] | None

ENOUGH = 0.5
"""The least share of the rows until the second contact that are near their paths."""

_ROUNDS = 2  # searches in each stage, each followed by a fit of the constants
_FAR = 8.0  # the least error of a far row over the scale of the loss, or over the typical error if this is larger
_RUN, _OF = 3, 4  # a track has left its path where 3 of 4 consecutive rows of a ball are far from it
_MOST_STATE = 64 * 2**20  # bytes


def fit_stage(fit: Fit, contact: int) -> Fit:
    """Fits the starts to the rows until a contact of the cue ball; from the second contact on, the constants too."""
    for _ in range(1 if contact == 1 else _ROUNDS):
        fit = fit._replace(shots=[search(fit.scene, shot.wide(contact)) for shot in fit.shots])
        if contact > 1:
            fit, _ = fit_shared(fit, contact)
    return fit


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


def leaves_at(shot: Shot, far: Bools) -> tuple[float, int]:
    """Returns the time at which a track first leaves its path, s, and the ball; inf and -1 if none does.

    There, at least `_RUN` of `_OF` consecutive rows of a ball are far.
    """
    leaves = [(np.inf, -1)]
    for ball in np.unique(shot.track.balls[far]):
        rows = np.flatnonzero(shot.track.balls == ball)
        ahead = np.convolve(far[rows], np.ones(_OF))[_OF - 1 :]
        leaves += [(float(time), int(ball)) for time in shot.time[rows[far[rows] & (ahead >= _RUN)]][:1]]
    return min(leaves)


def read_state(path: StatePath, settings: Any) -> dict[str, Any]:
    """Returns the content of a state file: the key of the settings, and finished stages by the number of shots.

    Raises:
        ValueError: If the file has other settings.
    """
    key, what = hashlib.sha256(json.dumps(settings).encode()).hexdigest(), "the state of a calibration"
    if path is None or not Path(path).exists():
        return {"key": key}
    saved = records.read_data(path, what, _MOST_STATE)
    if saved.get("key") != key:
        raise ValueError(f"state = {str(path)!r}: expected the state of the same tracks, scene, constants and options")
    return saved


def _resumed(fit: Fit, contacts: int, starts: Any, stages: Any) -> Fit:
    """Returns a fit after finished stages, the content of a state file."""
    integer("number of stages", len(stages), Range(1, contacts - 1))
    for stage in stages:
        finite("stage", [stage[name] for name in fit.names], (len(fit.names), 2))
    scene = with_physics(fit.scene, **{name: stages[-1][name][0] for name in fit.names})
    rows = finite("starts", starts, (len(fit.shots), fit.shots[0].starts.shape[1]))
    shots = [shot._replace(starts=row[None]) for shot, row in zip(fit.shots, rows, strict=True)]
    return fit._replace(scene=scene, shots=shots, stages=tuple(stages))


def fit_stages(fit: Fit, contacts: int, saved: dict[str, Any], path: StatePath, progress: Progress) -> Fit:
    """Fits the rows until the first contact of the cue ball, then until the second, and so on.

    It resumes from `saved`, adds each finished stage to it, and writes it to a file. It ends with the second contact if
    `Fit.share` is less than `ENOUGH`.
    """
    finished = saved.get(str(len(fit.shots)))
    if finished is None:
        fit = fit_stage(fit, 1)
    else:
        with refusing(path or "", "finished stages of a calibration"):
            fit = _resumed(fit, contacts, **finished)
    for contact in range(len(fit.stages) + 2, contacts + 1):
        fit = fit_stage(fit, contact)
        values, variances = values_of(fit.scene, fit.names), np.diag(covariance(fit, contact)).tolist()
        stage = dict(zip(fit.names, zip(values.values(), variances, strict=True), strict=True))
        near = np.concatenate([shot.used[shot.moving & shot.before(contact)] for shot in near_rows(fit, contact).shots])
        share = float(near.mean()) if near.size else 0.0
        fit = fit._replace(stages=(*fit.stages, stage), share=share if contact == 2 else fit.share)
        if path is not None and fit.share >= ENOUGH:
            starts = [shot.starts[0].tolist() for shot in fit.shots]
            saved[str(len(starts))] = {"starts": starts, "stages": fit.stages}
            write_json(Path(path), saved)
        if progress is not None:
            text = ", ".join(f"{name} {value:.5g}" for name, value in values.items())
            progress(f"until contact {contact}: {share:.1%} of the rows, {text}")
        if fit.share < ENOUGH:
            break
    return fit
