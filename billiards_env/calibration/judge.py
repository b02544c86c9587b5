"""How well a scene with constant numbers explains and predicts tracks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from billiards_env.calibration.contacts import CUSHION
from billiards_env.calibration.prepare import Shot, with_spin_prior
from billiards_env.calibration.rows import Floats, Layout, Rows
from billiards_env.calibration.starts import errors as errors_of
from billiards_env.calibration.starts import run, search
from billiards_env.scene import Scene

CONTACTS = (1, 2, 3, 4)
AHEAD = (0.5, 1.0, 2.0)
"""s, how far the cue ball is predicted from a start that is fitted until its third contact."""

SCALE = 0.003
"""m, the error above which the loss of a coordinate grows slowly (Cauchy)."""

_BEFORE = 1e-6  # s, a row at a contact is after it
_GAP = 0.1  # s, the longest gap of a track within which the cue ball's place is interpolated
_ONE = 0.05  # s, two contacts with one body within this time are one


def together(parts: Sequence[Judged]) -> Judged:
    """Returns the errors of shots that were judged in parts."""
    return Judged(
        {k: [row for part in parts for row in part.errors[k]] for k in CONTACTS},
        {ahead: np.concatenate([part.predicted[ahead] for part in parts]) for ahead in AHEAD},
        np.concatenate([part.sequence for part in parts]),
        np.concatenate([part.counted for part in parts]),
    )


class Judged(NamedTuple):
    """Errors of m shots. The errors of rows are those of moving balls before a contact of the cue ball.

    Attributes:
        errors: For each of `CONTACTS`, the distances of the rows from the paths, m, of each shot.
        predicted: For each of `AHEAD`, the errors of the cue ball, m, of the shots with rows then.
        sequence: (m,) bool, whether the cue ball has the contacts of the track until its third cushion.
        counted: (m,) bool, whether the track has three cushions.
    """

    errors: dict[int, list[Floats]]
    predicted: dict[float, Floats]
    sequence: Any
    counted: Any

    def within(self, contact: int, distance: float) -> float:
        """Returns the share of the rows until a contact that are nearer than a distance, m."""
        rows = np.concatenate(self.errors[contact])
        return float((rows < distance).mean()) if rows.size else float("nan")

    def median(self, contact: int) -> float:
        """Returns the median error of the rows until a contact, m."""
        rows = np.concatenate(self.errors[contact])
        return float(np.median(rows)) if rows.size else float("nan")

    def to_dict(self) -> dict[str, float | None]:
        """Returns the figures as plain data for JSON, None for a figure without rows."""
        return {name: None if np.isnan(value) else value for name, value in self.figures().items()}

    def figures(self) -> dict[str, float]:
        """Returns the figures by name: shares, and errors in mm."""
        found = {"rows_5mm_contact2": self.within(2, 0.005)}
        found |= {f"rows_{round(1e3 * d)}mm_contact3": self.within(3, d) for d in (0.005, 0.01)}
        found |= {f"median_mm_contact{k}": 1e3 * self.median(k) for k in (3, 4)}
        found |= {
            f"predicted_mm_{ahead:g}s": 1e3 * float(np.median(errors)) if len(errors) else float("nan")
            for ahead, errors in self.predicted.items()
        }
        counted = int(self.counted.sum())
        return found | {"sequence": float(self.sequence[self.counted].mean()) if counted else float("nan")}


def ends_at(shots: Sequence[Shot], contact: int) -> Floats:
    """Returns the times of a contact of the cue ball, (m,) s after the beginning; the end of the shot without it."""
    found = []
    for shot in shots:
        times = [one.time for one in shot.cue_contacts()]
        end = times[contact - 1] - _BEFORE if len(times) >= contact else np.inf
        found.append(min(end, shot.end - _BEFORE) - shot.begin)
    return np.array(found)


def judge(scene: Scene, shots: Sequence[Shot], rows: Rows) -> Judged:
    """Fits the starts of shots until each contact with constant numbers, and returns the errors."""
    rows = rows._replace(scale=np.full_like(rows.scale, SCALE), used=rows.seen)
    starts, errors, predicted = None, {}, {}
    for contact in CONTACTS:
        part = rows.until(ends_at(shots, contact))
        starts = best_starts(scene, part, starts)
        off = off_of(scene, starts, part)
        errors[contact] = [row[some] for row, some in zip(off, part.judged & part.seen, strict=True)]
        if contact == 3:
            predicted = {ahead: _predict(scene, starts, rows, ends_at(shots, 3) + ahead) for ahead in AHEAD}
    cushions = [[k for k, one in enumerate(shot.cue_contacts(), 1) if one.other == CUSHION] for shot in shots]
    counted = np.array([len(some) >= 3 for some in cushions])
    ends = np.array(
        [_after(shot, some[2]) if len(some) >= 3 else np.inf for shot, some in zip(shots, cushions, strict=True)]
    )
    part = rows.until(ends)
    assert starts is not None
    starts = best_starts(scene, part, starts)
    batch, same = run(scene, starts, part, 0.5), []
    for k, (shot, some) in enumerate(zip(shots, cushions, strict=True)):
        seen = [one.other for one in shot.cue_contacts()[: some[2]]] if len(some) >= 3 else []
        same.append(_sequence(batch[k].events)[: len(seen)] == seen)
    return Judged(errors, predicted, np.array(same), counted)


def _after(shot: Shot, contact: int) -> float:
    """Returns a time after a contact of the cue ball, s: 0.1 s later, or just before an earlier next contact."""
    times = [one.time - shot.begin for one in shot.cue_contacts()]
    return min(times[contact - 1] + 0.1, times[contact] - _BEFORE if len(times) > contact else np.inf)


def best_starts(scene: Scene, rows: Rows, starts: Floats | None = None) -> Floats:
    """Returns the starts that fit best; the search begins from other starts or from guesses."""
    if starts is None:
        return search(scene, rows)
    return search(scene, with_spin_prior(scene, starts, rows), starts)


def off_of(scene: Scene, starts: Floats, rows: Rows) -> Floats:
    """Returns the distances of rows from the paths, (m, r) m; 0 for missing rows."""
    off = errors_of(scene, starts, rows)
    return np.hypot(off[..., 0], off[..., 1])


def _predict(scene: Scene, starts: Floats, rows: Rows, times: Floats) -> Floats:
    """Returns the errors of the cue ball at times (m,) s, of the shots that have rows then."""
    batch, at, found = run(scene, starts, rows), Layout(scene.n_balls), []
    for k, time in enumerate(times.tolist()):
        mine = rows.seen[k] & (rows.ball[k] == 0)
        t = rows.time[k, mine]
        after = int(np.searchsorted(t, time))
        if not np.isfinite(time) or not 0 < after < len(t) or t[after] - t[after - 1] > _GAP:
            continue
        place = [np.interp(time, t, rows.places[k, mine, axis]) for axis in (0, 1)]
        found.append(float(np.hypot(*(batch[k].at(max(0.0, time - starts[k, at.instant]))[0] - place))))
    return np.array(found)


def _sequence(events: Any) -> list[int]:
    """Returns the partners of the cue ball in the contacts of a shot, `CUSHION` for a cushion."""
    found: list[tuple[float, int, int]] = []
    for event in events[np.isin(events["kind"], ("ball_ball", "cushion"))]:
        if event["kind"] == "cushion" and event["ball"] == 0:
            one = float(event["time"]), CUSHION, int(event["other"])
        elif event["kind"] == "ball_ball" and 0 in (event["ball"], event["other"]):
            one = float(event["time"]), int(max(event["ball"], event["other"])), -1
        else:
            continue
        if not any(one[0] - other[0] < _ONE and one[1:] == other[1:] for other in found):
            found.append(one)
    return [one[1] for one in found]
