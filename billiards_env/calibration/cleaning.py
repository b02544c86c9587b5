"""Errors of tracks that are found without a scene: rows clipped at the border of a picture, and lost frames.

Many programs compute the time of a row from the number of its frame. If frames were lost before they were counted, all
balls move too far in one step, and all later times are too early.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from billiards_env.calibration.tracks import Track

_CLIPPED = 8, 2.0  # rows at an extreme coordinate, and their number over that at the next one
_EXACT = 1e-7  # m, the noise of exact tracks
_SIDE = 5  # rows of a ball before and after a step
_LONG, _STEP = 30.0, 5.0  # frames, the longest time of these rows, of the step, and of a loss
_CLEAR = 8.0  # the least move of the later rows, over its standard deviation
_STEADY = 0.5  # the largest change of a velocity in these rows, over the velocity; a contact changes it more
_WHOLE = 0.25  # frames, the largest distance of a loss from a whole number of them
_NEAR = 3.0  # frames, the distance of two losses in different tracks that may be the same
_MOST = 0.5  # the share of the tracks with the same loss, above which all tracks have it


class Gap(NamedTuple):
    """Lost frames.

    Attributes:
        time: s, as in the track. The times of later rows are too early.
        length: s, by how much.
    """

    time: float
    length: float


def clean(tracks: Sequence[Track]) -> tuple[list[Track], list[str]]:
    """Returns tracks without clipped rows and with the times of lost frames, and a sentence about each correction.

    Args:
        tracks: The tracks in any unit of length, with their rows in the order of time.
    """
    kept, clipped = drop_clipped(tracks)
    gaps = lost_frames(kept, noise_of(kept))
    said = [f"{clipped} rows at the border of the picture are left out"] if clipped else []
    times = [gap.time for each in gaps for gap in each]
    if times:
        said.append(
            f"{len(times)} losses of frames in {sum(map(bool, gaps))} of {len(gaps)} shots, at {min(times):.2f} to "
            f"{max(times):.2f} s: later times are corrected"
        )
    return [corrected(track, each) for track, each in zip(kept, gaps, strict=True)], said


def drop_clipped(tracks: Sequence[Track]) -> tuple[list[Track], int]:
    """Returns tracks without rows clipped at the border of a picture, and the number of clipped rows."""
    places = np.concatenate([track.positions for track in tracks])
    clipped = np.zeros(len(places), np.bool_)
    for values in (*places.T, *-places.T):
        extremes, counts = np.unique(values, return_counts=True)
        if len(extremes) > 1 and counts[-1] >= max(_CLIPPED[0], _CLIPPED[1] * counts[-2]):
            clipped |= values == extremes[-1]
    parts = np.split(~clipped, np.cumsum([len(track.times) for track in tracks])[:-1])
    return [track.rows(kept) for track, kept in zip(tracks, parts, strict=True)], int(clipped.sum())


def noise_of(tracks: Sequence[Track]) -> float:
    """Returns the standard deviation of a coordinate, m, from third differences of rows at equal steps (median).

    It is at least `_EXACT`.
    """
    differences = [np.zeros(0)]
    for t, p in (path for track in tracks for path in track.paths().values() if len(path[0]) > 3):
        steps = np.lib.stride_tricks.sliding_window_view(np.diff(t), 3)
        even = np.ptp(steps, axis=1) < 0.1 * steps.mean(axis=1)
        differences.append(np.abs(np.diff(p, 3, axis=0)[even]).ravel())
    sizes = np.concatenate(differences)
    sizes = sizes[sizes > 0.0]
    return max(_EXACT, float(np.median(sizes)) / 0.6745 / np.sqrt(20.0)) if sizes.size > 20 else _EXACT


def lost_frames(tracks: Sequence[Track], noise: float) -> list[list[Gap]]:
    """Returns the lost frames of each track.

    A loss is visible only while a ball moves freely. If most tracks show one at the same time, it belongs to the clock
    of the file, and all tracks have it.

    Args:
        tracks: The tracks, in any unit of length.
        noise: Standard deviation of a coordinate, in the unit of the tracks.
    """
    steps = np.concatenate([np.diff(np.unique(track.times)) for track in tracks])
    if not steps.size:
        return [[] for _ in tracks]
    frame = float(np.median(steps))
    gaps = [_visible_gaps(track, frame, noise) for track in tracks]
    every = sorted(gap for each in gaps for gap in each)
    breaks = np.flatnonzero(np.diff([gap.time for gap in every]) > _NEAR * frame) + 1
    for group in np.split(np.array(every), breaks) if every else ():
        common = Gap(*np.median(group, axis=0).tolist())
        if len(group) > _MOST * sum(float(track.times.max()) > common.time for track in tracks):
            for each in gaps:
                if all(abs(gap.time - common.time) > _NEAR * frame for gap in each):
                    each.append(common)
    return gaps


def _visible_gaps(track: Track, frame: float, noise: float) -> list[Gap]:
    """Returns the lost frames that the rows of a track show.

    In free motion the path of a ball is nearly quadratic in time. Lost frames move the later rows along it. A fit of
    ten rows has this move as its fourth parameter, for each coordinate.
    """
    clear = []
    for t, p in track.paths().values():
        if len(t) < 2 * _SIDE:
            continue
        times, places = (np.lib.stride_tricks.sliding_window_view(array, 2 * _SIDE, axis=0) for array in (t, p))
        step = times[:, _SIDE] - times[:, _SIDE - 1]
        close = (np.ptp(times, axis=1) < _LONG * frame) & (step < (_STEP + 0.5) * frame)
        times, places = times[close], np.swapaxes(places[close], 1, 2)
        since = times - times[:, _SIDE, None]
        later = np.broadcast_to(np.arange(2 * _SIDE) >= _SIDE, since.shape)
        design = np.stack((np.ones_like(since), since, since**2, later), axis=2)
        inverse = np.linalg.pinv(design)
        fitted = inverse @ places  # (windows, 4, 2)
        spread = np.maximum(noise, np.sqrt(np.square(design @ fitted - places).sum(axis=(1, 2)) / (4 * _SIDE - 8)))
        velocity, acceleration, move = fitted[:, 1], 2.0 * fitted[:, 2], fitted[:, 3]
        speed = np.maximum(np.hypot(*velocity.T), 1e-300)
        along = (move * velocity).sum(axis=1) / speed
        certainty = along / (spread * np.sqrt(np.square(inverse[:, 3]).sum(axis=1)))
        frames = along / speed / frame
        count = np.round(frames)
        whole = (np.abs(frames - count) < _WHOLE) & (count > 0.0) & (count <= _STEP)
        steady = np.hypot(*acceleration.T) * np.ptp(times, axis=1) < _STEADY * speed
        for k in np.flatnonzero(steady & whole & (certainty > _CLEAR)):
            clear.append((-certainty[k], float(times[k, _SIDE - 1 : _SIDE + 1].mean()), frame * float(count[k])))
    gaps: list[Gap] = []
    for _, time, length in sorted(clear):  # the clearest first
        if all(abs(time - gap.time) > 2.0 * _SIDE * frame for gap in gaps):
            gaps.append(Gap(time, length))
    return gaps


def corrected(track: Track, gaps: Sequence[Gap]) -> Track:
    """Returns a track with the times that it has with its lost frames."""
    lost = sum((np.where(track.times > gap.time, gap.length, 0.0) for gap in gaps), np.zeros(len(track.times)))
    return track._replace(times=track.times + lost)
