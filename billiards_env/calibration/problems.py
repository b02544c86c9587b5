"""What does not fit in tracks: rows far from the model, exchanged balls, contacts of only one of track and model."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from billiards_env.calibration.shot import INSTANT, Shot
from billiards_env.calibration.starts import simulated
from billiards_env.calibration.tracks import Floats
from billiards_env.scene import Scene

KINDS = ("outliers", "swapped balls", "missed contact", "extra contact", "other path")
"""Rows far from the path; two balls with exchanged names; from a time on the track leaves the path of the model,
because only the model has a contact ("missed contact"), only the track ("extra contact"), or for another reason."""

CONTACTS = {"ball_ball": "ball {}", "cushion": "a cushion", "pocket": "a pocket"}

_BEFORE, _AFTER = 0.3, 0.05  # s, where the contact is looked for, around the first row far from the path
_CORNER = 4  # rows before and after a corner of a track
_CLEAR = 4.0  # the change of a velocity that is a corner, over its standard deviation


class Problem(NamedTuple):
    """Rows of a track that are reported, and not fitted.

    Attributes:
        shot: Name of the shot.
        kind: One of `KINDS`.
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


def find_problems(scene: Scene, shot: Shot) -> list[Problem]:
    """Returns the problems of a fitted shot."""
    name, times, found = shot.track.name, shot.track.times, []
    leave, last = shot.begin + shot.leaves[0], float(times.max())
    early = shot.far & (times < leave)
    for ball in np.unique(shot.track.balls[early]).tolist():
        at = times[early & (shot.track.balls == ball)].tolist()
        when = f"{at[0]:.3f} s" if len(at) == 1 else f"{at[0]:.3f} to {at[-1]:.3f} s"
        text = f"{len(at)} row{'s' if len(at) > 1 else ''} of ball {ball} far from its path, {when}"
        found.append(Problem(name, "outliers", ball, at[0], at[-1], text))
    if np.isfinite(leave):
        ball = shot.leaves[1]
        kind, why = _contact(scene, shot, ball, leave)
        text = f"the track of ball {ball} leaves the model at {leave:.3f} s{why}"
        found.append(Problem(name, kind, ball, leave, last, text))
    i, j, begin, end = shot.exchanged
    if np.isfinite(begin):
        until = f"to {end:.3f} s" if np.isfinite(end) else "on"
        text = f"from {begin:.3f} s {until} balls {i} and {j} are exchanged"
        found.append(Problem(name, "swapped balls", i, begin, min(end, last), text))
    return found


def _contact(scene: Scene, shot: Shot, ball: int, leave: float) -> tuple[str, str]:
    """Returns the kind of problem of a track that leaves the model, and a text with the contact and its time."""
    events: Any = simulated(scene, shot).events
    kinds, times = events["kind"], events["time"] + shot.begin + shot.starts[0, INSTANT]
    partner = np.where(events["ball"] == ball, events["other"], events["ball"])
    mine = (events["ball"] == ball) | ((kinds == "ball_ball") & (events["other"] == ball))
    near = np.isin(kinds, list(CONTACTS)) & (leave - _BEFORE <= times) & (times <= leave + _AFTER)
    some, corner = np.flatnonzero(mine & near), _corner(scene, *shot.track.paths()[ball], leave)
    if not some.size:
        if corner is None:
            return "other path", ""
        return "extra contact", f": only the track has a contact at {corner:.3f} s"
    k = min(some, key=lambda event: abs(times[event] - (leave if corner is None else corner)))
    kind, what = ("missed contact", "only the model has") if corner is None else ("other path", "after")
    return kind, f": {what} a contact with {CONTACTS[str(kinds[k])].format(partner[k])} at {times[k]:.3f} s"


def _corner(scene: Scene, times: Floats, places: Floats, leave: float) -> float | None:
    """Returns the time of the sharpest corner of a path near a time, s, or None.

    A velocity that changes by the friction of the cloth makes no corner.
    """
    best, found, slows = _CLEAR, None, scene.physics.mu_slide * scene.physics.g
    for row in range(_CORNER, len(times) - _CORNER + 1):
        if leave - _BEFORE <= times[row] <= leave + _AFTER:
            sides = slice(row - _CORNER, row), slice(row, row + _CORNER)
            one, two = (np.polyfit(times[side], places[side], 1, cov=True) for side in sides)
            usual = slows * float(times[sides[1]].mean() - times[sides[0]].mean())
            spread = max(float((one[1] + two[1])[0, 0].sum()), 1e-18)
            change = (float(np.hypot(*(two[0] - one[0])[0])) - usual) / np.sqrt(spread)
            if change > best:
                best, found = change, float(times[row])
    return found
