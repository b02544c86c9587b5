"""The frame of tracks: from the coordinates of a file to metres from the centre of the table."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from billiards_env.calibration.cleaning import noise_of
from billiards_env.calibration.contacts import CUSHION, Contact, find_contacts
from billiards_env.calibration.preparation import PreparedTrack
from billiards_env.calibration.tracks import Floats, Ints, Track, first_balls, with_rest
from billiards_env.scene import SCENES, Scene

_LEAST = 5  # rebounds at a cushion
_NEAR = 1.5e-3  # m, the error of a place of a rebound
_ROUNDS = 4
_BEYOND, _SHORT = 0.01, 0.006  # m, a row beyond the cushions, and a line of rebounds before or behind them
_FASTEST = 20.0  # m/s
_ROLL = 0.1  # the least of mu_roll over its start, for the longest way of a ball
_CUSHIONS = ("+x", "-x", "+y", "-y")


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


def reach_of(scene: Scene) -> Floats:
    """Returns abs(x) and abs(y) of the centres of balls at the cushions, (2,) m."""
    return np.array([scene.table.length, scene.table.width]) / 2.0 - np.median(scene.balls.radius)


def find_lines(contacts: Sequence[Contact]) -> tuple[Floats, Ints, float, float]:
    """Returns the lines that the centres of balls reach at the cushions.

    One least-squares fit with Cauchy weights finds them from the rebounds at all four cushions.

    Returns:
        The lines (4,) m: abs(x) or abs(y) at a speed of 0, at each of `_CUSHIONS`, NaN with few rebounds. Then the
        rebounds (4,) at each, the angle by which the lines are turned, rad, and how far a cushion gives way for each
        m/s of normal speed, s.
    """
    rebounds = [contact for contact in contacts if contact.other == CUSHION]
    axis = np.array([rebound.body // 2 for rebound in rebounds], np.intp)
    places = np.array([rebound.place for rebound in rebounds]).reshape(-1, 2)
    at, along = np.where(axis[:, None] == 1, places[:, ::-1], places).T
    side, sign = 2 * axis + (at < 0.0), np.sign(at)
    # Turned by a small angle, x = at - angle y at the ends of the table and y = at + angle x at its sides.
    turns, speeds = (2 * axis - 1) * along * sign, [rebound.speed for rebound in rebounds]
    design = np.column_stack((np.eye(4)[side], turns, speeds))
    weight, line = np.ones(len(rebounds)), np.zeros(6)
    for _ in range(20):
        line = np.linalg.lstsq(design * weight[:, None], sign * at * weight, rcond=None)[0]
        weight = 1.0 / np.sqrt(1.0 + np.square((design @ line - sign * at) / _NEAR))
    counts = np.bincount(side, minlength=4)
    return np.where(counts < _LEAST, np.nan, line[:4]), counts, float(line[4]), float(line[5])


def fit_frame(scene: Scene, tracks: Sequence[Track], contacts: int) -> tuple[Frame, float]:
    """Fits the frame of a file in any unit, with any origin.

    The first guess of the frame comes from the extreme rows. The rebounds then give the lines that the centres of balls
    reach at a speed of 0. A contact takes some milliseconds, so a cushion yields to a fast ball.

    Args:
        scene: The scene.
        tracks: The tracks.
        contacts: The contact of the cue ball until which rows are fitted.

    Returns:
        The frame, and how far the cushions give way at the mean normal speed of the rebounds until that contact, m.

    Raises:
        ValueError: If there are fewer than five rebounds at a cushion.
    """
    rows = np.concatenate([track.positions for track in tracks])
    reach, give = reach_of(scene), 0.0
    least, most = np.percentile(rows, (0.1, 99.9), axis=0)
    offset, scale = (least + most) / 2.0, 2.0 * reach / np.maximum(most - least, 1e-12)
    angle = 0.0
    frame = Frame(tuple(offset.tolist()), tuple(scale.tolist()), angle)
    for _ in range(_ROUNDS):
        framed = [frame.apply(track) for track in tracks]
        filled, noise = [with_rest(track)[0] for track in framed], noise_of(framed)
        cue_balls = [first_balls(track, noise)[0] for track in filled]
        shots = [find_contacts(scene, track, ball) for track, ball in zip(filled, cue_balls, strict=True)]
        lines, counts, turn, give_by_speed = find_lines([contact for shot in shots for contact in shot])
        if np.isnan(lines).any():
            text = ", ".join(f"{n} at {name}" for n, name in zip(counts, _CUSHIONS, strict=True))
            raise ValueError(f"frame = 'fit': rebounds: {text}: expected {_LEAST} or more at each cushion, or a Frame")
        plus, minus = lines[::2], -lines[1::2]
        offset = offset + (plus + minus) / 2.0 / scale
        scale = scale * 2.0 * reach / (plus - minus)
        angle = angle + turn
        frame = Frame(tuple(offset.tolist()), tuple(scale.tolist()), angle)
        speeds = []
        for shot, ball in zip(shots, cue_balls, strict=True):
            times = [contact.time for contact in shot if contact.ball == ball]
            end = min(times[contacts - 1 : contacts], default=np.inf)
            speeds += [contact.speed for contact in shot if contact.other == CUSHION and contact.time < end]
        give = give_by_speed * float(np.mean(speeds)) if speeds else 0.0
    return frame, give


def check_frame(scene: Scene, shots: Sequence[PreparedTrack], noise: float) -> None:
    """Checks that the tracks of shots lie on the table, in metres and seconds.

    Raises:
        ValueError: If rows lie beyond the cushions, balls turn before or behind them, or a ball moves faster or rolls
            farther than is possible.
    """
    reach, rolls = reach_of(scene), _ROLL * scene.physics.mu_roll * scene.physics.g
    most = np.array(scene.half_extents) if scene.table.outline else reach  # the jaws of pockets are beyond the cushions
    paths = [(shot.track.name, *path) for shot in shots for path in shot.track.paths().items()]
    for name, ball, (t, p) in paths:
        where = f"shot {name}, ball {ball}:"
        beyond = (np.abs(p) - most).max(axis=1)
        count = np.count_nonzero(beyond > _BEYOND + 4.0 * noise)
        if count > 2:
            raise ValueError(
                f"{where} {count} rows up to {beyond.max():.2g} m beyond the cushion: {_expected(scene, shots, most)}"
            )
        if len(t) < 4:
            continue
        steps, way = np.hypot(*np.diff(p, axis=0).T), float(np.hypot(*(p[-1] - p[0])))
        speeds = steps / np.maximum(np.diff(t), 1e-9)
        usual, fast = np.median([*speeds[steps > 4.0 * noise + 1e-3]] or [0.0]), float(np.sort(speeds)[-3])
        if usual > _FASTEST:
            raise ValueError(f"{where} {usual:.3g} m/s: expected at most {_FASTEST:g}, and times in seconds")
        if way > 0.1 and fast * fast < 2.0 * rolls * way:
            why = "expected a way that a ball can roll, and times in seconds, not frame numbers"
            raise ValueError(f"{where} {way:.2g} m at {fast:.2g} m/s or less: {why}")
    lines, counts, _, _ = find_lines([contact for shot in shots for contact in shot.contacts])
    error = _SHORT + 4.0 * _NEAR / np.sqrt(np.maximum(counts, 1)) + noise
    for name, off, largest in zip(_CUSHIONS, lines - np.repeat(reach, 2), error, strict=True):
        if abs(off) > largest:
            where = f"{abs(off):.3f} m {'short of' if off < 0.0 else 'beyond'} the cushion at {name}"
            raise ValueError(f"balls turn {where}: {_expected(scene, shots, most)}")


def _expected(scene: Scene, shots: Sequence[PreparedTrack], most: Floats) -> str:
    """Returns the end of a message: what a scene expects of tracks, and a question if they fit with exchanged axes.

    `most` are the largest abs(x) and abs(y) on the table, (2,) m.
    """
    places, limit = np.abs(np.concatenate([shot.track.positions for shot in shots])), most + _BEYOND
    plain, exchanged = ((order <= limit).all(axis=1).mean() for order in (places, places[:, ::-1]))
    table, named = scene.table, ((name, Scene.named(name)) for name in SCENES)
    name = next((f" of {name}" for name, one in named if (one.table, one.physics) == (table, scene.physics)), "")
    along = "x along its length" + " (are x and y exchanged?)" * bool(exchanged > max(plain, 0.99))
    size = f"{table.length:.4g} x {table.width:.4g} m"
    return f"expected metres from the centre of the table{name}, {size}, with {along}, or frame='fit'"
