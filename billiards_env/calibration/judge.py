"""Measures how well a scene with fixed constants explains and predicts tracks, and finds the rows that do not fit.

Problems are rows far from the model, exchanged balls, and tracks that leave the model.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from billiards_env.calibration.contacts import CUSHION, distinct
from billiards_env.calibration.preparation import PreparedTrack
from billiards_env.calibration.starts import errors, model_contacts, search
from billiards_env.calibration.tracks import Bools, Floats
from billiards_env.scene import Scene

CONTACTS = (1, 2, 3, 4)
AHEAD = (0.5, 1.0, 2.0)
"""s, how far the cue ball is predicted from a start that is fitted until its third contact."""

_GAP = 0.1  # s, the longest gap of a track within which the cue ball's place is interpolated
_LATER = 0.1  # s, the rows after the third cushion that are fitted
_AFTER = 0.05  # s, the latest contact of the model after the first row far from the path


class Problem(NamedTuple):
    """Rows of a track that are reported.

    Attributes:
        shot: Name of the shot.
        kind: "outliers" for rows far from the path, "swapped balls" for two balls with exchanged names, or "other path"
            if the track leaves the path of the model from a time on.
        ball: The ball.
        begin: Time of the first row, s, as in the track.
        end: Time of the last row, s.
        text: A sentence.
    """

    shot: str
    kind: str
    ball: int
    begin: float
    end: float
    text: str


class Judged(NamedTuple):
    """Errors of m shots. The errors of rows are those of moving balls before a contact of the cue ball.

    Attributes:
        errors: For each of `CONTACTS`, the distances of the rows from the paths, m, (k,).
        predicted: For each of `AHEAD`, the errors of the cue ball, m, of the shots with rows then.
        sequence: (k,) bool, whether the cue ball has the contacts of the track until its third cushion, of the shots
            with three cushions.
        shots: The number m of shots.
    """

    errors: dict[int, Floats]
    predicted: dict[float, Floats]
    sequence: Bools
    shots: int

    def within(self, contact: int, distance: float) -> float:
        """Returns the share of the rows until a contact that are nearer than a distance, m."""
        return _of(np.mean, self.errors[contact] < distance)

    def median(self, contact: int) -> float:
        """Returns the median error of the rows until a contact, m."""
        return _of(np.median, self.errors[contact])

    def to_dict(self) -> dict[str, float | None]:
        """Returns the figures as plain data for JSON: shares, and errors in mm; None for a figure without rows."""
        figures = {
            "rows_5mm_contact2": self.within(2, 0.005),
            "rows_5mm_contact3": self.within(3, 0.005),
            "rows_10mm_contact3": self.within(3, 0.01),
            "median_mm_contact3": 1e3 * self.median(3),
            "median_mm_contact4": 1e3 * self.median(4),
            **{f"predicted_mm_{ahead:g}s": 1e3 * _of(np.median, off) for ahead, off in self.predicted.items()},
            "sequence": _of(np.mean, self.sequence),
        }
        return {name: None if np.isnan(figure) else figure for name, figure in figures.items()}


def together(parts: Sequence[Judged]) -> Judged:
    """Returns the errors of shots that were judged in parts."""
    return Judged(
        {k: np.concatenate([part.errors[k] for part in parts]) for k in CONTACTS},
        {ahead: np.concatenate([part.predicted[ahead] for part in parts]) for ahead in AHEAD},
        np.concatenate([part.sequence for part in parts]),
        sum(part.shots for part in parts),
    )


def judge(scene: Scene, shots: Sequence[PreparedTrack]) -> Judged:
    """Fits the starts of shots until each contact with fixed constants, and returns the errors."""
    return together([_judge_shot(scene, shot) for shot in shots])


def _judge_shot(scene: Scene, shot: PreparedTrack) -> Judged:
    distances = {}
    predicted = {}
    same = np.zeros(0, np.bool_)
    for contact in CONTACTS:
        shot = search(scene, shot.wide(contact))
        off, cue = errors(scene, shot), shot.track.balls == shot.cue_ball
        distances[contact] = np.hypot(*off[shot.used & shot.moving].T)
        if contact == 3:
            t, (x, y) = shot.time[cue], off[cue].T
            for ahead in AHEAD:
                time = shot.end(3) + ahead
                after = int(np.searchsorted(t, time))
                near = 0 < after < len(t) and t[after] - t[after - 1] <= _GAP
                predicted[ahead] = np.hypot([np.interp(time, t, x)], [np.interp(time, t, y)])[: int(near)]
    contacts = shot.cue_contacts
    cushions = [k for k, contact in enumerate(contacts, 1) if contact.other == CUSHION]
    if len(cushions) >= 3:
        last = cushions[2]
        end = min(contacts[last - 1].time - shot.begin + _LATER, shot.end(last + 1))
        shot = search(scene, shot._replace(used=shot.time < end))
        in_model = distinct(model_contacts(scene, shot, shot.cue_ball))
        same = np.array([[hit.other for hit in in_model[:last]] == [hit.other for hit in contacts[:last]]])
    return Judged(distances, predicted, same, 1)


def _of(statistic: Callable[[Any], Any], values: Floats | Bools) -> float:
    return float(statistic(values)) if values.size else np.nan


def find_problems(scene: Scene, shot: PreparedTrack) -> Iterator[Problem]:
    """Yields the problems of a fitted shot."""
    name, times = shot.track.name, shot.track.times
    leave, last = shot.begin + shot.leaves[0], float(times.max())
    outliers = shot.track.rows(~shot.used & (shot.time < shot.leaves[0]))
    for ball, (at, _) in outliers.paths().items():
        when = f"{at[0]:.3f} s" if len(at) == 1 else f"{at[0]:.3f} to {at[-1]:.3f} s"
        text = f"{len(at)} row{'s' if len(at) > 1 else ''} of ball {ball} far from its path, {when}"
        yield Problem(name, "outliers", ball, float(at[0]), float(at[-1]), text)
    if np.isfinite(leave):
        ball = shot.leaves[1]
        hits = [hit for hit in model_contacts(scene, shot, ball) if hit.time <= leave + _AFTER]
        near = f", the last contact of the model is at {hits[-1].time:.3f} s" if hits else ""
        yield Problem(name, "other path", ball, leave, last, f"ball {ball} leaves the model at {leave:.3f} s{near}")
    i, j, begin, end = shot.exchanged
    if np.isfinite(begin):
        until = f"to {end:.3f} s" if np.isfinite(end) else "on"
        text = f"from {begin:.3f} s {until} balls {i} and {j} are exchanged"
        yield Problem(name, "swapped balls", i, begin, min(end, last), text)
