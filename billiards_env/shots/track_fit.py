"""The fit of shots to tracks: the starts of many shots at once, each by itself, and numbers that all shots share.

The start of a shot is a row of 2 n + 5 numbers: x and y of each ball, the cue ball's velocity and its spin. `settle`
fits the starts with constant numbers. `Projection` is the problem of the shared numbers alone: its residuals are those
after the starts are fitted, and its Jacobian includes how the starts follow the numbers (variable projection, Golub and
Pereyra 1973, with the approximation of Kaufman 1975).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_env.engine.log import SEGMENT_BALL, SEGMENT_PHASE, SEGMENT_ROW
from billiards_env.engine.trajectory import Trajectory
from billiards_env.scene import Scene
from billiards_env.shots.gradients import Record, start_jacobians
from billiards_env.shots.simulation import BatchResult, simulate_batch
from billiards_env.shots.tracks import Track

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

# The loss of a squared residual in units of the noise, and its derivative, as in scipy.optimize.least_squares.
LOSSES: Mapping[str, tuple[Callable[[Floats], Floats], Callable[[Floats], Floats]]] = {
    "linear": (lambda z: z, np.ones_like),
    "soft_l1": (lambda z: 2.0 * (np.sqrt(1.0 + z) - 1.0), lambda z: 1.0 / np.sqrt(1.0 + z)),
    "cauchy": (np.log1p, lambda z: 1.0 / (1.0 + z)),
}

MOST_SPEED = 20.0
"""m/s, of each component of the cue ball's velocity. The hardest breaks reach 16."""

MOST_SPIN = 1.5
"""Largest component of the cue ball's spin over the largest spin of a level strike, see `spin_of_cue`. More than 1,
because an elevated cue gives more, and because the ball may slow down before the first row."""

_FEW = 12  # rows
_STEPS = 30  # most steps of `settle`
_CONVERGED, _EXACT = 1e-9, 1e-14  # relative and absolute change of the loss
CLEAR = 9.0
"""The difference of two losses, over the variance of a residual, that noise does not explain: three standard deviations
squared."""
_RANK = 1e-12  # smallest eigenvalue of the scaled normal equations of a start that counts


class Rows(NamedTuple):
    """The rows of m tracks, in arrays with room for r rows each.

    Attributes:
        ball: (m, r) int, the ball; 0 without a row.
        frame: (m, r) int, the index of the time.
        positions: (m, r, 2) m.
        seen: (m, r) bool, whether there is a row.
        used: (m, r) bool, whether the row is fitted.
        times: (m, q) s since the first row, ascending; the last is repeated.
        in_play: (m, n) bool, whether the ball has rows.
        known: (m, 2 n + 5), the numbers of the starts that are not fitted; NaN for the others.
    """

    ball: NDArray[np.int64]
    frame: NDArray[np.int64]
    positions: Floats
    seen: Bools
    used: Bools
    times: Floats
    in_play: Bools
    known: Floats

    @property
    def time(self) -> Floats:
        """(m, r) s, the times of the rows."""
        return np.take_along_axis(self.times, self.frame, axis=1)

    def of(self, shots: NDArray[np.intp]) -> Rows:
        """Returns the rows of some shots."""
        return Rows._make(array[shots] for array in self)

    def until(self, time: float) -> Rows:
        """Returns the rows up to a time, s, or the first few rows of each shot."""
        late = self.time > np.maximum(time, self.time[:, min(_FEW, self.time.shape[1]) - 1])[:, None]
        seen = self.seen & ~late
        r = int(seen.sum(axis=1).max())
        frames = int(self.frame[:, :r].max()) + 1
        return Rows(
            self.ball[:, :r],
            np.minimum(self.frame[:, :r], frames - 1),
            self.positions[:, :r],
            seen[:, :r],
            (self.used & ~late)[:, :r],
            self.times[:, :frames],
            self.in_play,
            self.known,
        )


def rows_of(tracks: Sequence[Track], n: int) -> Rows:
    """Returns the rows of tracks of a scene with n balls; all are used."""
    frames = [np.unique(track.times, return_inverse=True) for track in tracks]
    m, r, q = len(tracks), max(len(t.times) for t in tracks), max(len(times) for times, _ in frames)
    rows = Rows(
        np.zeros((m, r), np.int64),
        np.zeros((m, r), np.int64),
        np.zeros((m, r, 2)),
        np.zeros((m, r), np.bool_),
        np.zeros((m, r), np.bool_),
        np.zeros((m, q)),
        np.zeros((m, n), np.bool_),
        np.full((m, 2 * n + 5), np.nan),
    )
    for k, (track, (times, frame)) in enumerate(zip(tracks, frames, strict=True)):
        count = len(track.times)
        rows.ball[k, :count], rows.frame[k, :count], rows.positions[k, :count] = track.balls, frame, track.positions
        rows.seen[k, :count] = rows.used[k, :count] = True
        rows.times[k] = times[-1] - times[0]
        rows.times[k, : len(times)] = times - times[0]
        rows.in_play[k, track.balls] = True
    return rows


def run(scene: Scene, starts: Floats, rows: Rows) -> BatchResult:
    """Simulates shots from their starts (m, 2 n + 5)."""
    m, n = rows.in_play.shape
    places, velocities, spins = (
        starts[:, : 2 * n].reshape(m, n, 2),
        starts[:, 2 * n : 2 * n + 2],
        starts[:, 2 * n + 2 :],
    )
    return simulate_batch(
        scene,
        places,
        velocities,
        spins=spins if scene.physics.motion == "sliding" else None,
        in_play=rows.in_play,
        max_time=float(rows.times.max()),
        record=True,
        threads=1,  # a call takes a millisecond
    )


def modelled(record: Record, rows: Rows) -> Floats:
    """Returns the places of the balls of the rows in simulated shots, (m, r, 2) m."""
    n, places = record.scene.n_balls, np.empty(rows.positions.shape)
    times = np.minimum(rows.time, record.time[:, None])
    span = 2.0 * times.max() + 1.0
    keys = (np.arange(len(times))[:, None] * n + rows.ball) * span + times
    for part in record.parts:
        pieces = part.segments[part.bounds[0, 1] : part.bounds[-1, 1]]
        shot = np.repeat(np.arange(part.begin, part.end), np.diff(part.bounds[:, 1]))
        ball = pieces[:, SEGMENT_BALL].astype(np.intp)
        order = np.argsort(shot * n + ball, kind="stable")  # those of a ball stay in the order of time
        paths = Trajectory(ball, pieces[:, SEGMENT_PHASE].astype(np.intp), pieces[:, SEGMENT_ROW:])
        begins = ((shot * n + ball) * span + paths.start)[order]
        shots = slice(part.begin, part.end)
        last = order[np.searchsorted(begins, keys[shots].ravel(), side="right") - 1]
        places[shots] = paths.at_pieces(last, times[shots].ravel()).reshape(places[shots].shape)
    return places


class Residuals(NamedTuple):
    """The residuals of m shots and their derivatives; zero for rows that are not used.

    Attributes:
        values: (m, 2 r) m.
        jacobian: (m, 2 r, 2 n + 5 + s) by the start and by the shared numbers.
    """

    values: Floats
    jacobian: Floats

    def loss(self, loss: str, noise: float) -> Floats:
        """Returns the loss of each shot, (m,)."""
        return LOSSES[loss][0](np.square(self.values / noise)).sum(axis=1)

    def weighted(self, loss: str, noise: float) -> Floats:
        """Returns the Jacobian times the weights of the loss, (m, 2 r, 2 n + 5 + s)."""
        return LOSSES[loss][1](np.square(self.values / noise))[..., None] * self.jacobian


def residuals(scene: Scene, starts: Floats, rows: Rows, names: Sequence[str]) -> Residuals:
    """Returns the residuals of shots from their starts, with the derivatives by numbers of `Physics` by name."""
    record = run(scene, starts, rows)._record("residuals")
    m, r = rows.used.shape
    off = (modelled(record, rows) - rows.positions) * rows.used[..., None]
    rates = start_jacobians(record, np.minimum(rows.times, record.time[:, None]), names, 1)
    rates = rates[np.arange(m)[:, None], rows.frame, :, rows.ball] * rows.used[..., None, None]  # (m, r, lanes, 2)
    rates[:, :, : rows.known.shape[1]] *= np.isnan(rows.known)[:, None, :, None]
    return Residuals(off.reshape(m, 2 * r), np.moveaxis(rates, 2, 3).reshape(m, 2 * r, -1))


def spin_of_cue(scene: Scene, starts: Floats) -> Floats:
    """Returns the largest spins, (..., 1) rad/s, that a level cue gives the cue balls of starts (..., 2 n + 5).

    An impulse at the miscue offset gives a sphere (moment of inertia 2/5 m R^2) the spin 2.5 offset speed / R^2.
    """
    return 2.5 * scene.cue.miscue_offset * np.hypot(starts[..., -5:-4], starts[..., -4:-3]) / scene.balls.radius[0]


def allowed(scene: Scene, starts: Floats, in_play: Bools, known: Floats | None = None) -> tuple[Floats, Bools]:
    """Moves balls that overlap apart and balls that reach into a cushion out of it, and limits the speeds and spins.

    Args:
        scene: The scene.
        starts: (m, 2 n + 5).
        in_play: (m, n) bool.
        known: (m, 2 n + 5), the spins that are not limited; NaN for the others.

    Returns:
        The starts (m, 2 n + 5), and whether they are allowed (m,).
    """
    m, n = in_play.shape
    radius = np.array(scene.balls.radius)
    reach = np.array([scene.balls.contact_distances(i) for i in range(n)])
    moved = starts.copy()
    moved[:, 2 * n : 2 * n + 2] = np.clip(moved[:, 2 * n : 2 * n + 2], -MOST_SPEED, MOST_SPEED)
    most, spins = MOST_SPIN * spin_of_cue(scene, moved), moved[:, -3:]  # a view
    free = True if known is None else np.isnan(known[:, -3:])
    np.clip(spins, -most, most, out=spins, where=free)
    places = moved[:, : 2 * n].reshape(m, n, 2)  # a view
    both = np.triu(in_play[:, :, None] & in_play[:, None, :], 1)
    bad = np.zeros(m, np.bool_)
    for _ in range(20):
        apart = places[:, :, None] - places[:, None, :]
        overlap = both & (np.hypot(apart[..., 0], apart[..., 1]) < reach)
        close = in_play & (scene.table.clearance(places) < radius)
        bad = overlap.any(axis=(1, 2)) | close.any(axis=1)
        if not bad.any():
            break
        for k, i, j in np.argwhere(overlap):
            line = places[k, i] - places[k, j]
            distance = float(np.hypot(*line))
            push = 0.5 * (reach[i, j] - distance + 1e-9) * (line / distance if distance > 0.0 else np.array([1.0, 0.0]))
            places[k, i] += push
            places[k, j] -= push
        for k, i in np.argwhere(close):
            centre, step = places[k, i].copy(), 1e-7 * np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
            right, left, up, down = scene.table.clearance(centre + step)
            inwards = np.array([right - left, up - down]) / 2e-7
            places[k, i] += inwards * (radius[i] - scene.table.clearance(centre) + 1e-9)
    for pocket in scene.table.pockets:
        inside = np.hypot(places[..., 0] - pocket.x, places[..., 1] - pocket.y) < pocket.radius
        bad |= (inside & in_play).any(axis=1)
    return moved, ~bad


def settle(
    scene: Scene, starts: Floats, rows: Rows, loss: str, noise: float, most: int = _STEPS
) -> tuple[Floats, Floats]:
    """Fits the starts of shots, each by itself, with constant numbers (Levenberg 1944, Marquardt 1963).

    Args:
        scene: The scene.
        starts: (m, 2 n + 5), allowed.
        rows: The rows.
        loss: A key of `LOSSES`.
        noise: The residual at which the loss begins to be less than the square, m.
        most: Largest number of steps.

    Returns:
        The starts, and the loss of each shot (m,).
    """
    starts = starts.copy()
    now = residuals(scene, starts, rows, ())
    values, jacobian = now
    begin = 1e-4 if loss == "cauchy" else 1e-9  # guesses are far from their end
    cost, damping, active = now.loss(loss, noise), np.full(len(starts), begin), np.ones(len(starts), np.bool_)
    for _ in range(most):
        running = np.flatnonzero(active)
        if not running.size:
            break
        here = Residuals(values[running], jacobian[running])
        pulled = np.swapaxes(here.weighted(loss, noise), 1, 2)
        normal, slope = pulled @ here.jacobian, (pulled @ here.values[..., None])[..., 0]
        size = _scale(normal)
        normal /= size[:, :, None] * size[:, None, :]
        normal += damping[running, None, None] * np.eye(size.shape[1])
        step = np.linalg.solve(normal, (slope / size)[..., None])[..., 0] / size
        ends = (step * slope).sum(axis=1) <= _CONVERGED * cost[running] + _EXACT  # the gain that the step promises
        tried, fine = allowed(scene, starts[running] - step, rows.in_play[running], rows.known[running])
        tried[~fine] = starts[running][~fine]
        then = residuals(scene, tried, rows.of(running), ())
        costs = then.loss(loss, noise)
        better = costs < cost[running]
        gain = cost[running] - costs
        taken = running[better]
        starts[taken], values[taken], jacobian[taken] = tried[better], then.values[better], then.jacobian[better]
        cost[taken] = costs[better]
        damping[running] = np.where(better, np.maximum(damping[running] / 10.0, 1e-9), damping[running] * 10.0)
        done = ends | np.where(better, gain <= _CONVERGED * cost[running], damping[running] > 1e4)
        active[running[done]] = False
    return starts, cost


def minima(scene: Scene, starts: Floats, rows: Rows, loss: str, noise: float) -> tuple[Floats, Floats]:
    """Fits the starts of shots as `settle` does, also from other side spins of the cue ball.

    The loss has several minima over the side spin: the ball may slip or stick at each of its contacts.

    Returns:
        The starts (m, q, 2 n + 5), the first from the given ones, and their losses (m, q).
    """
    m = len(starts)
    free = np.isnan(rows.known[:, -1]) & (scene.physics.motion == "sliding")
    tried = np.repeat(starts[:, None], 1 + len(_SIDES), axis=1)
    tried[free, 1:, -1] = np.array(_SIDES) * spin_of_cue(scene, starts[free])
    shot = np.repeat(np.arange(m), tried.shape[1])
    ends, losses = settle(scene, tried.reshape(len(shot), -1), rows.of(shot), loss, noise)
    return ends.reshape(tried.shape), losses.reshape(m, -1)


def settle_sides(scene: Scene, starts: Floats, rows: Rows, loss: str, noise: float) -> Floats:
    """Returns the best of the `minima` of each shot; of two that fit as well, that with the more plausible spin."""
    ends, losses = minima(scene, starts, rows, loss, noise)
    best = (losses + spread(rows, losses.min(axis=1))[:, None] * spin_surprise(scene, ends)).argmin(axis=1)
    return ends[np.arange(len(ends)), best]


def spread(rows: Rows, losses: Floats) -> Floats:
    """Returns the variance of a residual of each shot from its loss (m,), in the unit of the loss."""
    return losses / np.maximum(2 * rows.used.sum(axis=1) - rows.known.shape[1], 1)


def spin_surprise(scene: Scene, starts: Floats) -> Floats:
    """Returns the squares (...) of the spins of starts (..., 2 n + 5) over half of that of a level strike, at most."""
    return np.square(2.0 * starts[..., -3:] / np.maximum(spin_of_cue(scene, starts), 1e-9)).sum(axis=-1)


def other_minima(scene: Scene, starts: Floats, rows: Rows, noise: float) -> list[tuple[float, int, Floats]]:
    """Returns the best other minimum of each shot that has one, the best first.

    On the way to another minimum the loss rises by more than noise does. Starts that differ by a side spin without an
    effect are not other minima.

    Returns:
        Tuples of the additional loss over the variance of a residual, the shot, and the start.
    """
    ends, losses = minima(scene, starts, rows, "linear", noise)
    m, q = losses.shape
    shot = np.repeat(np.arange(m), q)
    flat = ends.reshape(m * q, -1)
    between, fine = allowed(
        scene, 0.5 * (flat + np.repeat(ends[:, 0], q, axis=0)), rows.in_play[shot], rows.known[shot]
    )
    halfway = residuals(scene, np.where(fine[:, None], between, flat), rows.of(shot), ())
    variance = np.maximum(spread(rows, losses.min(axis=1)), _EXACT)[:, None]
    rise = (halfway.loss("linear", noise).reshape(m, q) - np.maximum(losses, losses[:, :1])) / variance
    more = np.where(rise > CLEAR, (losses - losses[:, :1]) / variance, np.inf)
    best = more.argmin(axis=1)
    return sorted((float(more[k, j]), k, ends[k, j]) for k, j in enumerate(best.tolist()) if np.isfinite(more[k, j]))


def _scale(normal: Floats) -> Floats:
    """Returns the norms of the columns for normal equations (m, d, d); 1 for a column of zeros."""
    size = np.sqrt(np.diagonal(normal, axis1=1, axis2=2))
    return np.where(size > 0.0, size, 1.0)


def with_numbers(scene: Scene, names: Sequence[str], values: Floats) -> Scene:
    """Returns a scene with other numbers of its physics."""
    changes = dict(zip(names, values.tolist(), strict=True))
    return dataclasses.replace(scene, physics=dataclasses.replace(scene.physics, **changes))


class Projection:
    """The residuals of all shots as a function of the shared numbers alone; the starts are fitted for each value.

    Attributes:
        starts: (m, 2 n + 5), the starts at the last numbers of `jacobian`.
        freedom: Number of numbers of the starts that the rows determine.
    """

    def __init__(self, scene: Scene, names: Sequence[str], starts: Floats, rows: Rows, loss: str, noise: float) -> None:
        self.starts, self.freedom = starts, 0
        self._scene, self._names, self._rows, self._loss, self._noise = scene, names, rows, loss, noise
        self._at: Floats | None = None  # the numbers of `starts`
        self._follow = np.zeros((*starts.shape, len(names)))  # the derivative of `starts`
        self._latest: tuple[Floats, Floats] = np.full(len(names), np.nan), starts

    def residuals(self, numbers: Floats) -> Floats:
        """Returns the residuals (2 m r,), m; a metre each for numbers that `Physics` does not allow together."""
        try:
            return self._fitted(numbers).values.ravel()
        except ValueError:
            return np.ones(2 * self._rows.used.size)

    def jacobian(self, numbers: Floats) -> Floats:
        """Returns the derivative (2 m r, s) of the residuals, and keeps the starts."""
        fitted = self._fitted(numbers)
        self.starts, self._at = self._latest[1], numbers.copy()
        d = self.starts.shape[1]
        by_start, by_numbers = fitted.jacobian[..., :d], fitted.jacobian[..., d:]
        pulled = np.swapaxes(fitted.weighted(self._loss, self._noise)[..., :d], 1, 2)
        normal = pulled @ by_start
        size = _scale(normal)
        values, vectors = np.linalg.eigh(normal / (size[:, :, None] * size[:, None, :]))
        inverse = np.where(values > _RANK, 1.0 / np.maximum(values, _RANK), 0.0)
        self.freedom = int((values > _RANK).sum())
        right = (pulled @ by_numbers) / size[..., None]
        self._follow = -(vectors * inverse[:, None, :]) @ (np.swapaxes(vectors, 1, 2) @ right) / size[..., None]
        return (by_numbers + by_start @ self._follow).reshape(-1, len(self._names))

    def _fitted(self, numbers: Floats) -> Residuals:
        scene = with_numbers(self._scene, self._names, numbers)  # may raise
        if not np.array_equal(numbers, self._latest[0]):
            starts = self.starts
            if self._at is not None:
                moved, fine = allowed(
                    scene, starts + self._follow @ (numbers - self._at), self._rows.in_play, self._rows.known
                )
                starts = np.where(fine[:, None], moved, starts)
            starts, _ = settle(scene, starts, self._rows, self._loss, self._noise)
            self._latest = numbers.copy(), starts
        return residuals(scene, self._latest[1], self._rows, self._names)


_WINDOWS = (4, 6, 10, 16)  # rows of the cue ball from which its first velocity is guessed
_ROLLS = (1.0, 0.0, -1.0)  # its spin over that of a ball that rolls
_SIDES = (-0.56, -0.28, 0.0, 0.28, 0.56)  # its side spin over the largest of a level strike
_SHORT, _GROWTH = 0.1, 1.6  # s, the first duration of the rows that are fitted, and its growth
FAR = 5.0  # the residual of a row that hardly counts for a guess, over the noise
_LEFT, _MOST_LOSS = 6.0, 5.0  # rows far from their paths after which a shot has left its track, and their loss
_BEST = 4  # guesses of a shot that are kept
_FEW_STEPS = 10  # most steps of a guess


def first_guesses(scene: Scene, rows: Rows, noise: float) -> Floats:
    """Returns guesses of the starts of shots from their first rows, (m, windows, rolls, 2 n + 5)."""
    m, n = rows.in_play.shape
    guesses = np.zeros((m, len(_WINDOWS), len(_ROLLS), 2 * n + 5))
    rolls = np.array(_ROLLS)[:, None] * (scene.physics.motion == "sliding")
    for k in range(m):
        starts = guesses[k]
        for i in np.flatnonzero(rows.in_play[k]):
            mine = np.flatnonzero(rows.seen[k] & (rows.ball[k] == i))
            times, positions = rows.time[k, mine], rows.positions[k, mine]
            if i > 0:
                moves = np.hypot(*(positions - np.median(positions[:3], axis=0)).T) > FAR * noise
                until = max(1, int(moves.argmax())) if moves.any() else len(mine)
                starts[..., 2 * i : 2 * i + 2] = np.median(positions[:until], axis=0)
                continue
            for start, window in zip(starts, _WINDOWS, strict=True):
                if len(mine) < _WINDOWS[0]:  # the velocity is known
                    start[:, :2] = positions[0]
                    continue
                coefficients = np.polyfit(times[:window], positions[:window], 1 if window < 10 else 2)
                velocity = coefficients[-2]
                start[:, :2], start[:, 2 * n : 2 * n + 2] = coefficients[-1], velocity
                start[:, 2 * n + 2 : 2 * n + 4] = rolls * (-velocity[1], velocity[0]) / scene.balls.radius[0]
    return guesses


def prefix_loss(scene: Scene, starts: Floats, rows: Rows, noise: float) -> Floats:
    """Returns a loss of shots (m,) in which the rows after the first few far from their paths count the same.

    A start that explains the first rows is better than one that explains as many later ones.
    """
    off = (modelled(run(scene, starts, rows)._record("prefix_loss"), rows) - rows.positions) * rows.used[..., None]
    size = np.square(off / (FAR * noise)).sum(axis=2)
    before = np.exp(-np.cumsum(size * size / (1.0 + size * size), axis=1) / _LEFT)
    return (before * np.log1p(size) + (1.0 - before) * rows.used * _MOST_LOSS).sum(axis=1)


def guess(scene: Scene, rows: Rows, noise: float, besides: Floats | None = None) -> Floats:
    """Returns starts of shots (m, 2 n + 5) that come close to their rows.

    The best of some guesses and of given starts `besides` (m, 2 n + 5) are fitted to the first rows, then to twice as
    long a time, and so on. The spin hardly matters at first, so several are tried each time.

    Raises:
        ValueError: If balls overlap or lie outside of the table in all guesses of a shot.
    """
    groups, m = list(np.moveaxis(first_guesses(scene, rows, noise), 2, 0)), len(rows.seen)
    duration = float(rows.times.max())
    until = min(_SHORT, duration)
    while True:
        if besides is not None:
            groups.append(besides[:, None])
        part = rows.until(until)
        tried = np.concatenate(groups, axis=1)
        tried = np.where(np.isnan(rows.known[:, None]), tried, rows.known[:, None])
        shot = np.repeat(np.arange(m), tried.shape[1])
        starts, fine = allowed(scene, tried.reshape(len(shot), -1), rows.in_play[shot], rows.known[shot])
        if not fine.reshape(m, -1).any(axis=1).all():
            lost = int(np.argmin(fine.reshape(m, -1).any(axis=1)))
            raise ValueError(f"shot {lost} begins with balls that overlap or lie outside of the table")
        loss = np.full(len(shot), np.inf)
        many = part.of(shot[fine])
        loss[fine] = prefix_loss(scene, starts[fine], many, noise)
        starts, loss = starts.reshape(tried.shape), loss.reshape(m, -1)
        ends = np.cumsum([group.shape[1] for group in groups])
        best = [
            end - len(g[0]) + loss[:, end - len(g[0]) : end].argmin(axis=1) for end, g in zip(ends, groups, strict=True)
        ]
        best = np.where(
            np.isfinite(np.take_along_axis(loss, np.stack(best, 1), 1)), np.stack(best, 1), loss.argmin(1)[:, None]
        )
        shot = np.repeat(np.arange(m), best.shape[1])
        starts, _ = settle(scene, starts[shot, best.ravel()], part.of(shot), "cauchy", FAR * noise, _FEW_STEPS)
        loss = prefix_loss(scene, starts, part.of(shot), noise)
        order = np.argsort(loss.reshape(m, -1), axis=1, kind="stable")[:, :_BEST]
        starts = np.take_along_axis(starts.reshape(m, best.shape[1], -1), order[..., None], axis=1)
        if until == duration:
            return starts[:, 0]
        until = min(_GROWTH * until, duration)
        groups = [starts, *_with_other_spins(scene, starts)]


def _with_other_spins(scene: Scene, starts: Floats) -> list[Floats]:
    """Returns starts (m, k, 2 n + 5) with other side spins, and with other spins about a horizontal axis."""
    found, n, radius = [], scene.n_balls, scene.balls.radius[0]
    if scene.physics.motion == "sliding":
        velocity = starts[..., 2 * n : 2 * n + 2]
        for side in _SIDES:
            found.append(starts.copy())
            found[-1][..., -1:] = side * spin_of_cue(scene, starts)
        for roll in _ROLLS:
            found.append(starts.copy())
            found[-1][..., -3:-1] = roll * velocity[..., ::-1] * (-1.0, 1.0) / radius
    return found
