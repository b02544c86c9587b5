"""Corrects errors of tracks without a scene: rows clipped at the border of a picture, and lost frames.

Many programs compute the time of a row from the number of its frame. If frames were lost before they were counted, all
balls move too far in one step, and all later times are too early.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from billiards_env.calibration.tracks import Track

_CLIPPED = 8, 2.0  # places at an extreme coordinate, and their number over that at the next one
_EXACT = 1e-7  # the noise of exact tracks, in the unit of the coordinates
_APART = 1e-6  # s, the least step between two frames
_SIDE = 5  # rows of a ball before and after a step
_WINDOW, _MOST = 30.0, 5.0  # frames: the longest time of these rows, and the most lost frames; a step is not longer
_CLEAR = 8.0  # the least move of the later rows, over its standard deviation
_STEADY = 0.5  # the largest relative change of velocity in a window; most contacts change it more
_WHOLE = 0.25  # frames, the largest distance of a lost time from a whole number of frames
_NEAR = 3.0  # frames; losses of several tracks that are closer in time are the same
_COMMON = 0.5  # the share of the tracks that show a loss, above which it belongs to all of them


class Lost(NamedTuple):
    """Lost frames.

    Attributes:
        time: s, as in the track. The times of later rows are too early.
        duration: s, by how much.
    """

    time: float
    duration: float


def clean(tracks: Sequence[Track]) -> tuple[list[Track], list[str]]:
    """Returns tracks without clipped rows and with corrected times, and a sentence about each kind of correction.

    Args:
        tracks: The tracks in any unit of length, with their rows in the order of time.
    """
    kept, clipped = drop_clipped(tracks)
    lost = lost_frames(kept, noise_of(kept))
    sentences = [f"{clipped} rows at the border of the picture are left out"] if clipped else []
    times = [one.time for each in lost for one in each]
    if times:
        sentences.append(
            f"frames were lost in {sum(map(bool, lost))} of {len(lost)} shots, {len(times)} times in all, between "
            f"{min(times):.2f} and {max(times):.2f} s: the later times are corrected"
        )
    corrected = []
    for track, each in zip(kept, lost, strict=True):
        late = sum(np.where(track.times > one.time, one.duration, 0.0) for one in each)
        corrected.append(track._replace(times=track.times + late))
    return corrected, sentences


def drop_clipped(tracks: Sequence[Track]) -> tuple[list[Track], int]:
    """Returns tracks without rows clipped at the border of a picture, and the number of clipped rows."""
    places = np.concatenate([track.positions for track in tracks])
    clipped = np.zeros(len(places), np.bool_)
    different = np.unique(places, axis=0)  # a ball at rest counts once
    for values, once in zip((*places.T, *-places.T), (*different.T, *-different.T), strict=True):
        extremes, counts = np.unique(once, return_counts=True)
        if len(extremes) > 1 and counts[-1] >= max(_CLIPPED[0], _CLIPPED[1] * counts[-2]):
            clipped |= values == extremes[-1]
    parts = np.split(~clipped, np.cumsum([len(track.times) for track in tracks])[:-1])
    return [track.rows(kept) for track, kept in zip(tracks, parts, strict=True)], int(clipped.sum())


def noise_of(tracks: Sequence[Track]) -> float:
    """Returns the standard deviation of a coordinate, in its unit, from third differences of rows at equal steps.

    It comes from their median, and is at least `_EXACT`.
    """
    differences = [np.zeros(0)]
    for t, p in (path for track in tracks for path in track.paths().values() if len(path[0]) > 3):
        steps = np.lib.stride_tricks.sliding_window_view(np.diff(t), 3)
        even = np.ptp(steps, axis=1) < 0.1 * steps.mean(axis=1)
        differences.append(np.abs(np.diff(p, 3, axis=0)[even]).ravel())
    sizes = np.concatenate(differences)
    sizes = sizes[sizes > 0.0]
    return max(_EXACT, float(np.median(sizes)) / 0.6745 / np.sqrt(20.0)) if sizes.size > 20 else _EXACT


def lost_frames(tracks: Sequence[Track], noise: float) -> list[list[Lost]]:
    """Returns the lost frames of each track.

    A loss is visible only while a ball moves freely. If most tracks that have rows before and after it show the same
    loss, it belongs to the clock of the file, and these tracks all have it.

    Args:
        tracks: The tracks, in any unit of length.
        noise: Standard deviation of a coordinate, in the unit of the tracks.
    """
    steps = np.concatenate([np.diff(np.unique(track.times)) for track in tracks])
    steps = steps[steps > _APART]
    if not steps.size:
        return [[] for _ in tracks]
    frame = float(np.median(steps))
    lost = [_visible_losses(track, frame, noise) for track in tracks]
    for one in sorted(one for each in lost for one in each):
        same = [[other for other in each if _is_same(one, other, frame)] for each in lost]
        spanning = [bool(track.times.min() < one.time < track.times.max()) for track in tracks]
        if sum(map(bool, same)) > _COMMON * sum(spanning):
            common = one._replace(time=float(np.median([other.time for each in same for other in each])))
            for k in np.flatnonzero(spanning):
                if not same[k]:
                    lost[k].append(common)
    return lost


def _is_same(one: Lost, other: Lost, frame: float) -> bool:
    return abs(one.time - other.time) <= _NEAR * frame and abs(one.duration - other.duration) < 0.5 * frame


def _visible_losses(track: Track, frame: float, noise: float) -> list[Lost]:
    """Returns the lost frames that the rows of a track show.

    In free motion the path of a ball is nearly quadratic in time, and lost frames move the later rows along it. Each
    coordinate of ten rows is fitted with four parameters: a quadratic and a step, which is the move. All balls that
    move freely must show the loss.
    """
    candidates: list[tuple[float, float, float, int]] = []
    against: list[tuple[float, float, int]] = []
    for ball, (t, p) in track.paths().items():
        if len(t) < 2 * _SIDE:
            continue
        times, places = (np.lib.stride_tricks.sliding_window_view(array, 2 * _SIDE, axis=0) for array in (t, p))
        step = times[:, _SIDE] - times[:, _SIDE - 1]
        close = (np.ptp(times, axis=1) < _WINDOW * frame) & (step < (_MOST + 0.5) * frame)
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
        error = spread * np.sqrt(np.square(inverse[:, 3]).sum(axis=1))
        frames = along / speed / frame
        count = np.round(frames)
        whole = (np.abs(frames - count) < _WHOLE) & (count > 0.0) & (count <= _MOST)
        steady = np.hypot(*acceleration.T) * np.ptp(times, axis=1) < _STEADY * speed
        for k in np.flatnonzero(steady & whole & (along > _CLEAR * error)):
            middle = float(times[k, _SIDE - 1 : _SIDE + 1].mean())
            candidates.append((-float(along[k] / error[k]), middle, frame * float(count[k]), ball))
        none = steady & (_CLEAR * error < 0.5 * frame * speed) & (frames < 0.5)
        against += [(first, last, ball) for first, last in times[none, _SIDE - 1 : _SIDE + 1].tolist()]
    lost: list[Lost] = []
    for _, time, duration, ball in sorted(candidates):  # the clearest first
        denied = any(first <= time <= last and other != ball for first, last, other in against)
        if not denied and all(abs(time - one.time) > 2.0 * _SIDE * frame for one in lost):
            lost.append(Lost(time, duration))
    return lost
