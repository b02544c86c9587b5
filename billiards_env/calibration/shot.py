"""Shots for the fit: what moves or rests in a track, where contacts are, when the strike is, and a first guess."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from billiards_env.calibration.contacts import Contact, find_contacts, find_exchange
from billiards_env.calibration.tracks import Bools, Floats, Track, with_rest
from billiards_env.scene import Scene

PLACES, VELOCITY, SPIN, INSTANT = slice(None, -6), slice(-6, -4), slice(-4, -1), -1
"""Where the numbers of a start are in an array (..., 2 n + 6): x and y of each ball, m; the cue ball's velocity, m/s,
and its spin, rad/s; and the instant of the strike, s after `Shot.begin`."""

CAUCHY = 2.385
"""The scale of the loss over the standard deviation of a residual: 95% efficient for Gaussian noise (Holland and Welsch
1977)."""

SCALE = 0.003
"""m, the least error of a coordinate above which the loss grows slowly: about the errors of the laws after two contacts
of the cue ball on a real table."""

_BEFORE = 1e-6  # s, a row at a contact is after it
_MOVED = 0.004  # m, from a place of rest
_REST = 2e-3  # m, the error of a place of rest; cameras distort by about as much
# The rows of the cue ball for two guesses of its velocity: the first one after its rest, and their number.
_WINDOWS = (1, 8), (0, 2)


class Shot(NamedTuple):
    """A track that is ready for the fit, and its fit.

    Attributes:
        track: The track in the order of time, with rows of balls at rest.
        added: (r,) bool, the rows that `with_rest` added.
        moving: (r,) bool, whether the ball has begun to move and has not come to rest.
        contacts: The contacts that were found without a model.
        begin: s, the last time at which the cue ball rested, or its first row.
        gap: s, the strike is at most this much later; 0 if the cue ball moves at the first row.
        exchanged: The result of `find_exchange`; later rows are not fitted.
        in_play: (n,) bool, whether the ball has rows.
        known: (width,), the numbers of the start that are not fitted; NaN for the others.
        prior: (p, width). What is known of the start besides rows: `prior` @ start has the mean `target`, and a
            standard deviation of 1. The last three are for the spin; they are 0 before the first fit.
        target: (p,).
        starts: (g, width), guesses of the start, or one start after a fit.
        scale: m, the error of a coordinate above which the loss grows slowly (Cauchy).
        used: (r,) bool, whether the row is fitted; false for a row that is far from its path.
        leaves: s after `begin`, from which on a ball leaves its path, or inf, and the ball.
    """

    track: Track
    added: Bools
    moving: Bools
    contacts: list[Contact]
    begin: float
    gap: float
    exchanged: tuple[int, int, float, float]
    in_play: Bools
    known: Floats
    prior: Floats
    target: Floats
    starts: Floats
    scale: float
    used: Bools
    leaves: tuple[float, int] = (np.inf, -1)

    @property
    def time(self) -> Floats:
        """(r,) s, the times of the rows after `begin`."""
        return self.track.times - self.begin

    @property
    def cue_contacts(self) -> list[Contact]:
        """The contacts of the cue ball."""
        return [contact for contact in self.contacts if contact.ball == 0]

    def end(self, contact: int) -> float:
        """Returns the end of the rows to fit before a contact of the cue ball, s after `begin`; inf for all rows."""
        times = [cue_contact.time for cue_contact in self.cue_contacts[contact - 1 : contact]]
        return min(*times, self.exchanged[2], np.inf) - _BEFORE - self.begin

    def before(self, contact: int) -> Bools:
        """Returns the rows to fit before a contact of the cue ball, (r,) bool."""
        return self.time < self.end(contact)

    def until(self, contact: int) -> Shot:
        """Returns the shot with the rows that are used before a contact of the cue ball."""
        return self._replace(used=self.used & self.before(contact))

    def wide(self, contact: int) -> Shot:
        """Returns the shot with all rows before a contact of the cue ball."""
        return self._replace(used=self.before(contact))


def prepare(scene: Scene, track: Track, noise: float, known: Floats | None = None) -> Shot:
    """Returns a track that is ready for the fit.

    Args:
        scene: The scene.
        track: The track.
        noise: Standard deviation of a coordinate, m.
        known: (width,), the numbers of the start that are known; NaN for the others.
    """
    filled, added = with_rest(track)
    n, paths = scene.n_balls, filled.paths()
    exchanged = find_exchange(scene, track)
    least = max(_MOVED, 4.0 * noise)
    contacts = find_contacts(scene, filled.rows(filled.times < exchanged[2]))
    moving = np.zeros(len(added), np.bool_)
    rest = np.full((n, 2), np.nan)
    rests = {}
    for ball, (_, path) in paths.items():
        away, ends = (np.hypot(*(path - path[k]).T) > least for k in (0, -1))
        rests[ball] = int(away.argmax()) if away.any() else len(path)
        rest[ball] = np.median(path[: rests[ball]], axis=0)
        moving[np.flatnonzero(filled.balls == ball)[rests[ball] : len(path) - int(ends[::-1].argmax()) + 1]] = True

    (t, p), last = paths[0], rests[0] - 1
    begin, gap = float(t[0]), 0.0
    hit = min((one.time for one in contacts if one.ball == 0), default=np.inf)
    starts = np.zeros((len(_WINDOWS), 2 * n + 6))
    places = starts[:, PLACES].reshape(-1, n, 2)  # a view
    places[:] = np.nan_to_num(rest)
    for start, place, (first, count) in zip(starts, places[:, 0], _WINDOWS, strict=True):
        rows = slice(last + first, max(last + first + 2, min(last + first + count, int(np.searchsorted(t, hit)))))
        if len(t[rows]) > 1:
            start[VELOCITY], place[:] = np.polyfit(t[rows] - t[last], p[rows], 1)
            speed = max(float(np.hypot(*start[VELOCITY])), 1e-6)
            start[INSTANT] = (rest[0] - place) @ start[VELOCITY] / speed**2  # the path passes the place of rest
            if last > 0 or (start[INSTANT] > 0.05 * (t[1] - t[0]) and start[INSTANT] * speed > least):
                begin, gap = float(t[last]), float(t[last + 1] - t[last])
    known = np.full(2 * n + 6, np.nan) if known is None else known.copy()
    if gap > 0.0:
        places[:, 0] = rest[0]
    else:
        known[INSTANT], rest[0] = 0.0, np.nan
    if scene.physics.motion != "sliding":
        known[SPIN] = 0.0
    weight = ~np.isnan(rest.ravel()) / max(_REST, noise)
    prior = np.zeros((2 * n + 3, 2 * n + 6))
    prior[:-3, PLACES] = np.diag(weight)
    return Shot(
        track=filled,
        added=added,
        moving=moving & ~added,
        contacts=contacts,
        begin=begin,
        gap=gap,
        exchanged=exchanged,
        in_play=np.isin(np.arange(n), track.balls),
        known=known,
        prior=prior,
        target=np.append(weight * np.nan_to_num(rest).ravel(), np.zeros(3)),
        starts=np.where(np.isnan(known), starts, known),
        scale=max(SCALE, CAUCHY * noise),
        used=np.ones(len(added), np.bool_),
    )
