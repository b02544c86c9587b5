"""The frame of tracks: from the coordinates of a file to metres from the centre of the table."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_env.calibration.contacts import CUSHION, Contact, find_contacts
from billiards_env.calibration.rows import Floats
from billiards_env.calibration.tracks import Track, with_rest
from billiards_env.scene import Scene

_LEAST = 5  # rebounds at a cushion
_NEAR = 1.5e-3  # m, the error of a place of a rebound
_ROUNDS = 4


class Frame(NamedTuple):
    """The frame of a file: place = turn(scale * (coordinates - offset)).

    Attributes:
        offset: The coordinates of the centre of the table.
        scale: Metres in a unit of x and of y; negative for an axis in the other direction.
        angle: rad, the counterclockwise rotation of the file relative to the table.
    """

    offset: tuple[float, float] = (0.0, 0.0)
    scale: tuple[float, float] = (1.0, 1.0)
    angle: float = 0.0

    def apply(self, track: Track) -> Track:
        """Returns a track in metres from the centre of the table."""
        x, y = ((track.positions - self.offset) * self.scale).T
        cos, sin = np.cos(self.angle), np.sin(self.angle)
        return track._replace(positions=np.column_stack((cos * x + sin * y, cos * y - sin * x)))


class Lines(NamedTuple):
    """The lines that the centres of balls reach at the cushions, from rebounds.

    Attributes:
        at: (4,) m, abs(x) or abs(y) at a speed of 0: +x, -x, +y, -y. NaN with few rebounds.
        error: (4,) m, their standard deviations.
        counts: (4,) int, the rebounds.
        turn: rad, by which the lines are turned.
        give: s, how far a cushion gives way for each m/s of normal speed.
        speed: m/s, the median normal speed.
    """

    at: Floats
    error: Floats
    counts: NDArray[np.intp]
    turn: float
    give: float
    speed: float


def reach_of(scene: Scene) -> Floats:
    """Returns abs(x) and abs(y) of the centres of balls at the cushions, (2,) m."""
    return np.array([scene.table.length, scene.table.width]) / 2.0 - np.median(scene.balls.radius)


def find_lines(contacts: Sequence[Contact]) -> Lines:
    """Returns the `Lines` of rebounds: one least-squares fit with Cauchy weights for all four cushions."""
    some = [one for one in contacts if one.other == CUSHION]
    side = np.array([2 * one.axis + (one.place[one.axis] < 0.0) for one in some], np.intp)
    place = np.array([one.place for one in some]).reshape(-1, 2)
    sign, axis = 1.0 - 2.0 * (side % 2), side // 2
    at = place[np.arange(len(some)), axis]
    along = place[np.arange(len(some)), 1 - axis]
    speed = np.array([one.speed for one in some])
    counts = np.bincount(side, minlength=4)
    # Turned by a small angle, x = at - angle y at the ends of the table and y = at + angle x at its sides.
    design = np.column_stack((np.eye(4)[side], np.where(axis == 0, -along, along) * sign, speed))
    weight, found = np.ones(len(some)), np.zeros(6)
    for _ in range(20):
        found = np.linalg.lstsq(design * weight[:, None], sign * at * weight, rcond=None)[0]
        weight = 1.0 / np.sqrt(1.0 + np.square((design @ found - sign * at) / _NEAR))
    few = counts < _LEAST
    return Lines(
        np.where(few, np.nan, found[:4]),
        np.where(few, np.inf, _NEAR / np.sqrt(np.maximum(counts, 1))),
        counts,
        float(found[4]),
        float(found[5]),
        float(np.median(speed)) if some else 0.0,
    )


def fit_frame(scene: Scene, tracks: Sequence[Track]) -> tuple[Frame, float]:
    """Fits the frame of a file in any unit, with any origin.

    The first guess of the frame comes from the extreme rows. The rebounds then give the lines that the centres of balls
    reach at a speed of 0. A contact takes some milliseconds, so a cushion yields to a fast ball.

    Returns:
        The frame, and how far the cushions give way at the median normal speed, m.

    Raises:
        ValueError: If there are fewer than five rebounds at a cushion.
    """
    rows, reach = np.concatenate([track.positions for track in tracks]), reach_of(scene)
    least, most = np.percentile(rows, (0.1, 99.9), axis=0)
    offset, scale, angle = (least + most) / 2.0, 2.0 * reach / np.maximum(most - least, 1e-12), 0.0
    give = 0.0
    for _ in range(_ROUNDS):
        frame = Frame(tuple(offset.tolist()), tuple(scale.tolist()), angle)
        lines = find_lines([one for track in tracks for one in find_contacts(scene, with_rest(frame.apply(track))[0])])
        if np.isnan(lines.at).any():
            counts = ", ".join(f"{n} at {name}" for n, name in zip(lines.counts, ("+x", "-x", "+y", "-y"), strict=True))
            raise ValueError(
                f"frame = 'fit': rebounds: {counts}: expected {_LEAST} or more at each cushion, or a Frame"
            )
        plus, minus = lines.at[::2], -lines.at[1::2]
        offset = offset + (plus + minus) / 2.0 / scale
        scale = scale * 2.0 * reach / (plus - minus)
        angle, give = angle + lines.turn, lines.give * lines.speed
    return Frame(tuple(offset.tolist()), tuple(scale.tolist()), angle), give
