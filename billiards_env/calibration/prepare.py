"""Prepares tracks for the fit: what is clipped, moves or rests, where contacts are, and whether the frame is right."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

import numpy as np

from billiards_env.calibration.contacts import Contact, find_contacts, find_exchange
from billiards_env.calibration.frame import find_lines, reach_of
from billiards_env.calibration.rows import Bools, Floats, Layout, Prior, Rows
from billiards_env.calibration.tracks import Track, with_rest
from billiards_env.scene import Scene

_CLIPPED = 8, 2.0  # rows at an extreme coordinate, and their number over that at the next one
_BEYOND, _SHORT = 0.01, 0.006  # m, a row beyond the cushions, and a line of rebounds before or behind them
_FASTEST = 20.0  # m/s
_ROLL = 0.1  # the least of mu_roll over its start, for the longest way of a ball
_MOVED = 0.004  # m, from a place of rest
_REST = 1e-3  # m, the error of a place of rest
_SPINS = (0.1, 0.7, 0.7)
"""The standard deviations of the spin about the path (massé), across it about that of half a rolling ball, and about
the vertical, over v / R: wide for the last two, which players choose."""


class Shot(NamedTuple):
    """A track that is ready for the fit.

    Attributes:
        track: The track, with rows of balls at rest.
        added: (k,) bool, the rows that `with_rest` added.
        moving: (k,) bool, whether the ball has begun to move and has not come to rest.
        contacts: The contacts that were found.
        begin: s, the last time at which the cue ball rested, or its first row.
        gap: s, the strike is at most this much later; 0 if the cue ball moves at the first row.
        end: s, the time from which on rows are not fitted; inf for none.
        exchanged: The result of `find_exchange`.
    """

    track: Track
    added: Bools
    moving: Bools
    contacts: list[Contact]
    begin: float
    gap: float
    end: float
    exchanged: tuple[int, int, float, float] | None

    def cue_contacts(self) -> list[Contact]:
        """Returns the contacts of the cue ball."""
        return [one for one in self.contacts if one.ball == 0]


def drop_clipped(tracks: Sequence[Track]) -> tuple[list[Track], int]:
    """Returns tracks without rows at the border of a picture, many at one extreme coordinate, and their number."""
    places = np.concatenate([track.positions for track in tracks])
    clipped = [np.zeros(len(track.times), np.bool_) for track in tracks]
    for axis in (0, 1):
        for sign in (1.0, -1.0):
            values, counts = np.unique(sign * places[:, axis], return_counts=True)
            if len(values) > 1 and counts[-1] >= max(_CLIPPED[0], _CLIPPED[1] * counts[-2]):
                for track, bad in zip(tracks, clipped, strict=True):
                    bad |= sign * track.positions[:, axis] == values[-1]
    kept = [track.rows(~bad) for track, bad in zip(tracks, clipped, strict=True)]
    return kept, int(sum(bad.sum() for bad in clipped))


def noise_of(tracks: Sequence[Track]) -> float:
    """Returns the standard deviation of a coordinate, m, from third differences of rows at equal steps (median)."""
    found = []
    for track in tracks:
        for ball in np.unique(track.balls):
            t, p = (array[track.balls == ball] for array in (track.times, track.positions))
            if len(t) < 4:
                continue
            steps = np.lib.stride_tricks.sliding_window_view(np.diff(t), 3)
            even = np.ptp(steps, axis=1) < 0.1 * steps.mean(axis=1)
            found.append(np.abs(np.diff(p, 3, axis=0)[even]).ravel())
    sizes = np.concatenate(found) if found else np.zeros(0)
    sizes = sizes[sizes > 0.0]
    return float(np.median(sizes)) / 0.6745 / np.sqrt(20.0) if sizes.size > 20 else 0.0


def prepare(scene: Scene, track: Track, noise: float) -> Shot:
    """Returns a track that is ready for the fit."""
    whole, added = with_rest(track)
    moving = np.zeros(len(whole.times), np.bool_)
    least = max(_MOVED, 4.0 * noise)
    for ball in np.unique(whole.balls):
        mine = np.flatnonzero(whole.balls == ball)
        path = whole.positions[mine]
        begun, ends = (np.hypot(*(path - path[k]).T) > least for k in (0, -1))
        if begun.any():
            moving[mine[begun.argmax() : len(mine) - int(ends[::-1].argmax()) + 1]] = True
    moving &= ~added
    cue = np.flatnonzero(whole.balls == 0)
    t, p = whole.times[cue], whole.positions[cue]
    rests = int(moving[cue].argmax()) - 1 if moving[cue].any() else 0
    begin, gap = float(t[0]), 0.0
    if rests >= 0 and len(t) > rests + 3:
        some = slice(rests + 1, rests + 5)
        line = np.polyfit(t[some] - t[rests], p[some], 1)
        ahead, speed = p[rests] - line[1], float(np.hypot(*line[0]))
        late = float(ahead @ line[0]) / max(speed * speed, 1e-12)  # s, the path passes the place of rest
        if rests > 0 or (late > 0.05 * (t[1] - t[0]) and late * speed > least and speed > 0.0):
            begin, gap = float(t[rests]), float(t[rests + 1] - t[rests])
    if gap > 0.0:
        moving[cue[: rests + 1]] = False
    exchanged = find_exchange(scene, track)
    end = np.inf if exchanged is None else exchanged[2]
    contacts = find_contacts(scene, whole.rows(whole.times < end))
    return Shot(whole, added, moving, contacts, begin, gap, end, exchanged)


def _padded(arrays: Sequence[np.ndarray], mode: Literal["constant", "edge"] = "constant") -> Any:
    """Returns arrays of different lengths as one, with zeros or their last entries at the end."""
    most = max(map(len, arrays))
    return np.array([np.pad(a, [(0, most - len(a)), *[(0, 0)] * (a.ndim - 1)], mode) for a in arrays])


def rows_of(scene: Scene, shots: Sequence[Shot], noise: float) -> Rows:
    """Returns the rows of shots; all are used, with the scale of the noise."""
    n, m = scene.n_balls, len(shots)
    at, tracks = Layout(n), [shot.track for shot in shots]
    frames = [np.unique(track.times, return_inverse=True) for track in tracks]
    seen = _padded([np.ones(len(track.times), np.bool_) for track in tracks])
    rows = Rows(
        ball=_padded([track.balls for track in tracks]),
        frame=_padded([frame for _, frame in frames]),
        places=_padded([track.positions for track in tracks]),
        seen=seen,
        judged=_padded([shot.moving for shot in shots]),
        used=seen.copy(),
        scale=np.full(seen.shape, noise),
        after=np.zeros(seen.shape, np.int64),
        times=_padded([times - shot.begin for (times, _), shot in zip(frames, shots, strict=True)], "edge"),
        in_play=np.array([np.isin(np.arange(n), track.balls) for track in tracks]),
        latest=np.array([shot.gap for shot in shots]),
        known=np.full((m, at.width), np.nan),
        prior=Prior(np.zeros((m, 2 * n + 3, at.width)), np.zeros((m, 2 * n + 3))),
    )
    rows.known[:, at.instant] = np.where(rows.latest > 0.0, np.nan, 0.0)
    if scene.physics.motion != "sliding":
        rows.known[:, at.spin] = 0.0
    for k, shot in enumerate(shots):
        rows.after[k] = np.searchsorted([one.time - shot.begin for one in shot.cue_contacts()], rows.time[k])
        for ball in np.unique(shot.track.balls):
            mine = shot.track.balls == ball
            path = shot.track.positions[mine]
            if ball > 0 or shot.gap > 0.0:
                rests = ~(np.hypot(*(path - path[0]).T) > max(_MOVED, 4.0 * noise))
                rests &= np.cumprod(rests).astype(np.bool_)
                for axis, place in enumerate(np.median(path[rests], axis=0)):
                    rows.prior.matrix[k, 2 * ball + axis, 2 * ball + axis] = 1.0 / max(_REST, noise)
                    rows.prior.target[k, 2 * ball + axis] = place / max(_REST, noise)
    return rows


def with_spin_prior(scene: Scene, starts: Floats, rows: Rows) -> Rows:
    """Returns rows with the prior of the spins for the velocities of starts (m, width)."""
    at, matrix, target = Layout(scene.n_balls), rows.prior.matrix.copy(), rows.prior.target.copy()
    velocity = starts[:, at.velocity]
    speed = np.maximum(np.hypot(*velocity.T), 1e-6)
    along, x, y = velocity / speed[:, None], at.spin.start, at.spin.start + 1
    about, across, side = (speed / scene.balls.radius[0] * part for part in _SPINS)
    last = 2 * scene.n_balls
    matrix[:, last, x], matrix[:, last, y] = along[:, 0] / about, along[:, 1] / about
    matrix[:, last + 1, x], matrix[:, last + 1, y] = -along[:, 1] / across, along[:, 0] / across
    matrix[:, last + 2, at.side] = 1.0 / side
    target[:, last + 1] = 0.5 / _SPINS[1]
    return rows._replace(prior=Prior(matrix, target))


def check_against_table(scene: Scene, tracks: Sequence[Track], contacts: Sequence[Contact], noise: float) -> None:
    """Checks that tracks lie on the table, in metres and seconds.

    Raises:
        ValueError: If rows lie beyond the cushions, balls turn before or behind them, or a ball moves faster or rolls
            farther than is possible.
    """
    reach, rolls = reach_of(scene), _ROLL * scene.physics.mu_roll * scene.physics.g
    most = np.array(scene.half_extents) if scene.table.outline else reach  # the jaws of pockets are beyond the cushions
    for track in tracks:
        for ball in np.unique(track.balls):
            mine = track.balls == ball
            t, p = track.times[mine], track.positions[mine]
            over = (np.abs(p) - most).max(axis=1)
            bad = over > _BEYOND + 4.0 * noise
            if bad.sum() > 2:
                raise ValueError(
                    f"shot {track.name}, ball {ball}: {bad.sum()} rows up to {over.max():.2g} m beyond the cushion: "
                    f"{_guess_frame(reach, tracks)}"
                )
            if len(t) < 4:
                continue
            steps, waits = np.hypot(*np.diff(p, axis=0).T), np.diff(t)
            speeds = steps / np.maximum(waits, 1e-9)
            usual = float(np.median(speeds[steps > 4.0 * noise + 1e-3])) if (steps > 4.0 * noise + 1e-3).any() else 0.0
            if usual > _FASTEST:
                raise ValueError(
                    f"shot {track.name}, ball {ball}: {usual:.3g} m/s: expected at most {_FASTEST:g}; are the times in "
                    "seconds?"
                )
            fast, way = float(np.sort(speeds)[-3]), float(np.hypot(*(p[-1] - p[0])))
            if way > 0.1 and fast * fast < 2.0 * rolls * way:
                raise ValueError(
                    f"shot {track.name}, ball {ball}: {way:.2g} m at {fast:.2g} m/s or less: a ball does not roll that "
                    "far; are the times in seconds (not the numbers of frames)?"
                )
    lines = find_lines(contacts)
    for name, at, error, expected in zip(
        ("+x", "-x", "+y", "-y"), lines.at, lines.error, reach[[0, 0, 1, 1]], strict=True
    ):
        if abs(at - expected) > _SHORT + 4.0 * error + noise:
            where = f"{abs(at - expected):.3f} m {'before' if at < expected else 'behind'} the cushion at {name}"
            raise ValueError(f"balls turn {where}: expected metres from the centre of the table, or frame='fit'")


def _guess_frame(reach: Floats, tracks: Sequence[Track]) -> str:
    """Returns a question about the frame of tracks that do not lie on the table."""
    places = np.concatenate([track.positions for track in tracks])
    least, most = np.percentile(places, (1.0, 99.0), axis=0)
    if np.abs(places).max() > 20.0 * reach.max():
        return "are the coordinates pixels or millimetres?"
    if (least > -_BEYOND).all() and (most < 2.0 * reach + 0.1).all():
        return "is the origin a corner of the table, not its centre?"
    if (np.maximum(most, -least) < reach[::-1] + 0.05).all():
        return "are x and y exchanged?"
    return "is the file in metres of the playing surface?"
