"""What does not fit in tracks: rows far from the model, exchanged balls, contacts of only one of track and model."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from billiards_env.calibration.contacts import CUSHION, POCKET
from billiards_env.calibration.shot import Shot
from billiards_env.calibration.starts import model_contacts
from billiards_env.calibration.tracks import Floats
from billiards_env.scene import Scene

KINDS = ("outliers", "swapped balls", "missed contact", "extra contact", "other path")
"""Rows far from the path; two balls with exchanged names; from a time on the track leaves the path of the model,
because only the model has a contact ("missed contact"), only the track ("extra contact"), or for another reason."""

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


def find_problems(scene: Scene, shot: Shot) -> Iterator[Problem]:
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
        kind, why = _contact(scene, shot, ball, leave)
        yield Problem(name, kind, ball, leave, last, f"the track of ball {ball} leaves the model at {leave:.3f} s{why}")
    i, j, begin, end = shot.exchanged
    if np.isfinite(begin):
        until = f"to {end:.3f} s" if np.isfinite(end) else "on"
        text = f"from {begin:.3f} s {until} balls {i} and {j} are exchanged"
        yield Problem(name, "swapped balls", i, begin, min(end, last), text)


def _contact(scene: Scene, shot: Shot, ball: int, leave: float) -> tuple[str, str]:
    """Returns the kind of problem of a track that leaves the model, and a text with the contact and its time."""
    contacts = [
        contact for contact in model_contacts(scene, shot, ball) if leave - _BEFORE <= contact.time <= leave + _AFTER
    ]
    corner = _corner(scene, *shot.track.paths()[ball], leave)
    if not contacts:
        if corner is None:
            return "other path", ""
        return "extra contact", f": only the track has a contact at {corner:.3f} s"
    nearest = min(contacts, key=lambda contact: abs(contact.time - (leave if corner is None else corner)))
    other = {CUSHION: "a cushion", POCKET: "a pocket"}.get(nearest.other, f"ball {nearest.other}")
    kind, what = ("missed contact", "only the model has") if corner is None else ("other path", "after")
    return kind, f": {what} a contact with {other} at {nearest.time:.3f} s"


def _corner(scene: Scene, times: Floats, places: Floats, leave: float) -> float | None:
    """Returns the time of the sharpest corner of a path near a time, s, or None.

    A velocity that changes by the friction of the cloth makes no corner.
    """
    sharpest, corner, slows = _CLEAR, None, scene.physics.mu_slide * scene.physics.g
    for row in range(_CORNER, len(times) - _CORNER + 1):
        if leave - _BEFORE <= times[row] <= leave + _AFTER:
            sides = slice(row - _CORNER, row), slice(row, row + _CORNER)
            (before, error), (after, other_error) = (np.polyfit(times[k], places[k], 1, cov=True) for k in sides)
            usual = slows * float(times[sides[1]].mean() - times[sides[0]].mean())
            spread = max(float((error + other_error)[0, 0].sum()), 1e-18)
            change = (float(np.hypot(*(after - before)[0])) - usual) / np.sqrt(spread)
            if change > sharpest:
                sharpest, corner = change, float(times[row])
    return corner
