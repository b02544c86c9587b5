"""Prepares tracks for the fit: what moves or rests, where contacts are, when the strike is, and a first guess."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from billiards_env.calibration.contacts import Contact, find_contacts, find_exchange
from billiards_env.calibration.tracks import Bools, Floats, Track, first_balls, with_rest
from billiards_env.scene import Scene

PLACES, VELOCITY, SPIN, INSTANT = slice(None, -6), slice(-6, -4), slice(-4, -1), -1
"""Where the numbers of a start are in an array (..., 2 n + 6): x and y of each ball, m; the cue ball's velocity, m/s,
and its spin, rad/s; and the instant of the strike, s after `PreparedTrack.begin`."""

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

Spans = dict[int, tuple[int, int]]  # the moving rows of each ball, see `_moving_span`


class PreparedTrack(NamedTuple):
    """A track that is ready for the fit, and its fit.

    Attributes:
        track: The track in the order of time, with rows of balls at rest.
        added: (r,) bool, the rows that `with_rest` added.
        moving: (r,) bool, whether the ball has begun to move and has not come to rest.
        first: The balls that begin to move first, see `first_balls`.
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
    first: list[int]
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
    def cue_ball(self) -> int:
        """The ball that is struck."""
        return self.first[0]

    @property
    def time(self) -> Floats:
        """(r,) s, the times of the rows after `begin`."""
        return self.track.times - self.begin

    @property
    def cue_contacts(self) -> list[Contact]:
        """The contacts of the cue ball."""
        return [contact for contact in self.contacts if contact.ball == self.cue_ball]

    def end(self, contact: int) -> float:
        """Returns the end of the rows to fit before a contact of the cue ball, s after `begin`; inf for all rows."""
        times = [cue_contact.time for cue_contact in self.cue_contacts[contact - 1 : contact]]
        return min(*times, self.exchanged[2], np.inf) - _BEFORE - self.begin

    def before(self, contact: int) -> Bools:
        """Returns the rows to fit before a contact of the cue ball, (r,) bool."""
        return self.time < self.end(contact)

    def until(self, contact: int) -> PreparedTrack:
        """Returns the track with the rows that are used before a contact of the cue ball."""
        return self._replace(used=self.used & self.before(contact))

    def wide(self, contact: int) -> PreparedTrack:
        """Returns the track with all rows before a contact of the cue ball."""
        return self._replace(used=self.before(contact))


def prepare(scene: Scene, track: Track, noise: float, known: Floats | None = None) -> PreparedTrack:
    """Returns a track that is ready for the fit.

    Args:
        scene: The scene.
        track: The track.
        noise: Standard deviation of a coordinate, m.
        known: (width,), the numbers of the start that are known; NaN for the others.

    Raises:
        ValueError: If the track has no cue ball, see `first_balls`.
    """
    filled, added = with_rest(track)
    exchanged = find_exchange(scene, track)
    first = first_balls(_without_exchange(filled, exchanged), noise)
    contacts = find_contacts(scene, filled.rows(filled.times < exchanged[2]), first[0])
    least = max(_MOVED, 4.0 * noise)
    spans = {ball: _moving_span(path, least) for ball, (_, path) in filled.paths().items()}
    rest = _places_of_rest(scene, filled, spans)
    starts, begin, gap = _guess_starts(filled, spans, rest, first[0], contacts, least)
    if gap == 0.0:
        rest[first[0]] = np.nan  # the cue ball has left it
    known = _known_numbers(scene, gap, known)
    prior, target = _prior(rest, max(_REST, noise))
    return PreparedTrack(
        track=filled,
        added=added,
        moving=_moving_rows(filled, spans) & ~added,
        first=first,
        contacts=contacts,
        begin=begin,
        gap=gap,
        exchanged=exchanged,
        in_play=np.isin(np.arange(scene.n_balls), track.balls),
        known=known,
        prior=prior,
        target=target,
        starts=np.where(np.isnan(known), starts, known),
        scale=max(SCALE, CAUCHY * noise),
        used=np.ones(len(added), np.bool_),
    )


def _without_exchange(track: Track, exchanged: tuple[int, int, float, float]) -> Track:
    """Returns a track in which the exchange of the names of two balls is undone."""
    one, two, begin, end = exchanged
    rows = (track.times >= begin) & (track.times <= end) & np.isin(track.balls, (one, two))
    return track._replace(balls=np.where(rows, one + two - track.balls, track.balls))


def _moving_span(path: Floats, least: float) -> tuple[int, int]:
    """Returns the first row (r, 2) that is farther than `least` from the first one, and the end of the moving rows.

    The ball is at rest from the end on. Both are r if the ball does not move.
    """
    away, to_come = (np.hypot(*(path - path[k]).T) > least for k in (0, -1))
    if not away.any():
        return len(path), len(path)
    return int(away.argmax()), len(path) - int(to_come[::-1].argmax()) + 1


def _moving_rows(track: Track, spans: Spans) -> Bools:
    """Returns whether the ball of each row moves, (r,) bool."""
    moving = np.zeros(len(track.balls), np.bool_)
    for ball, span in spans.items():
        moving[np.flatnonzero(track.balls == ball)[slice(*span)]] = True
    return moving


def _places_of_rest(scene: Scene, track: Track, spans: Spans) -> Floats:
    """Returns the places of the balls before they move, (n, 2) m; NaN for a ball without rows."""
    rest = np.full((scene.n_balls, 2), np.nan)
    for ball, (_, path) in track.paths().items():
        rest[ball] = np.median(path[: spans[ball][0]], axis=0)
    return rest


def _guess_starts(
    track: Track, spans: Spans, rest: Floats, cue_ball: int, contacts: list[Contact], least: float
) -> tuple[Floats, float, float]:
    """Guesses the start of a shot from lines through the first rows of the cue ball between its rest and a contact.

    Args:
        track: The track.
        spans: The moving rows of each ball.
        rest: (n, 2) m, the places of rest.
        cue_ball: The cue ball.
        contacts: The contacts.
        least: m, a ball is at rest within this distance.

    Returns:
        A start for each of `_WINDOWS`, `PreparedTrack.begin` and `PreparedTrack.gap`.
    """
    (t, p), last, n = track.paths()[cue_ball], spans[cue_ball][0] - 1, len(rest)
    hit = min((contact.time for contact in contacts if contact.ball == cue_ball), default=np.inf)
    begin, gap = float(t[0]), 0.0
    starts = np.zeros((len(_WINDOWS), 2 * n + 6))
    places = starts[:, PLACES].reshape(-1, n, 2)  # a view
    places[:] = np.nan_to_num(rest)
    for start, place, (first, count) in zip(starts, places[:, cue_ball], _WINDOWS, strict=True):
        rows = slice(last + first, max(last + first + 2, min(last + first + count, int(np.searchsorted(t, hit)))))
        if len(t[rows]) > 1:
            start[VELOCITY], place[:] = np.polyfit(t[rows] - t[last], p[rows], 1)
            speed = max(float(np.hypot(*start[VELOCITY])), 1e-6)
            start[INSTANT] = (rest[cue_ball] - place) @ start[VELOCITY] / speed**2  # the path passes the place of rest
            if last > 0 or (start[INSTANT] > 0.05 * (t[1] - t[0]) and start[INSTANT] * speed > least):
                begin, gap = float(t[last]), float(t[last + 1] - t[last])
    if gap > 0.0:
        places[:, cue_ball] = rest[cue_ball]
    return starts, begin, gap


def _known_numbers(scene: Scene, gap: float, known: Floats | None) -> Floats:
    """Returns the numbers of the start that are not fitted, (width,); NaN for the others."""
    numbers = np.full(2 * scene.n_balls + 6, np.nan) if known is None else known.copy()
    if gap == 0.0:
        numbers[INSTANT] = 0.0
    if scene.physics.motion != "sliding":
        numbers[SPIN] = 0.0
    return numbers


def _prior(rest: Floats, error: float) -> tuple[Floats, Floats]:
    """Returns `prior` and `target` of places of rest (n, 2), NaN for none, with an error, m."""
    weight = ~np.isnan(rest.ravel()) / error
    prior = np.zeros((rest.size + 3, rest.size + 6))
    prior[:-3, PLACES] = np.diag(weight)
    return prior, np.append(weight * np.nan_to_num(rest).ravel(), np.zeros(3))
