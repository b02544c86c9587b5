"""The fit of the starts of many shots at once, each by itself, with constant numbers of the physics."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from billiards_env.calibration.rows import Bools, Floats, Layout, Rows
from billiards_env.engine.log import SEGMENT_BALL, SEGMENT_PHASE, SEGMENT_ROW
from billiards_env.engine.trajectory import Trajectory
from billiards_env.scene import Scene
from billiards_env.shots.gradients import Record, start_jacobians
from billiards_env.shots.simulation import BatchResult, simulate_batch

CAUCHY = 2.385
"""The scale of the loss over the standard deviation of a residual: 95% efficient for Gaussian noise (Holland and Welsch
1977)."""

MOST_SPEED = 20.0
"""m/s, of each component of the cue ball's velocity. The hardest breaks reach 16."""

MOST_SPIN = 1.5
"""Largest component of the cue ball's spin over the largest spin of a level strike, see `spin_of_cue`. More than 1,
because an elevated cue gives more, and because the ball may slow down before the first row."""

SIDES = (-0.8, -0.56, -0.28, 0.28, 0.56, 0.8)
"""The side spins of the guesses, over the largest of a level strike. At 0 the derivative by the side spin is 0."""

ROLLS = (1.0, 0.0, -1.0)
"""The spins of the guesses about a horizontal axis, over that of a ball that rolls."""

_WINDOWS = (5, 16)  # rows of the cue ball from which its first velocity is guessed
_STEPS = 30  # most steps of `settle`
_HALVES = (6, 3), (2, 4), (1, 6)  # the starts that a search keeps of each shot, after some steps each
_CONVERGED, _EXACT = 1e-6, 1e-14  # relative and absolute change of the loss


class Residuals(NamedTuple):
    """The residuals of m shots over their scales, and their derivatives.

    The residuals of unused rows are zero. The last p residuals belong to the prior; their loss is quadratic. The others
    have Cauchy's loss, log(1 + r^2).

    Attributes:
        values: (m, 2 r + p).
        jacobian: (m, 2 r + p, width + s) by the start and by s shared numbers.
        robust: 2 r.
    """

    values: Floats
    jacobian: Floats
    robust: int

    @property
    def loss(self) -> Floats:
        """(m,), the loss of each shot."""
        square = np.square(self.values)
        return np.log1p(square[:, : self.robust]).sum(axis=1) + square[:, self.robust :].sum(axis=1)

    @property
    def weighted(self) -> Floats:
        """(m, 2 r + p, width + s), the Jacobian times the weights of the loss."""
        weight = np.ones_like(self.values)
        weight[:, : self.robust] = 1.0 / (1.0 + np.square(self.values[:, : self.robust]))
        return weight[..., None] * self.jacobian


def run(scene: Scene, starts: Floats, rows: Rows, more: float = 0.0) -> BatchResult:
    """Simulates shots from their starts (m, width) until their last rows, and `more` seconds."""
    (m, n), at = rows.in_play.shape, Layout(rows.in_play.shape[1])
    return simulate_batch(
        scene,
        starts[:, at.places].reshape(m, n, 2),
        starts[:, at.velocity],
        spins=starts[:, at.spin] if scene.physics.motion == "sliding" else None,
        in_play=rows.in_play,
        max_time=float(rows.times.max()) + more,
        record=True,
        threads=1,  # a call takes a millisecond
    )


def modelled(record: Record, rows: Rows, times: Floats) -> tuple[Floats, Floats]:
    """Returns the places and velocities of the balls of the rows at times (m, r) of simulated shots, (m, r, 2) each."""
    n, found = record.scene.n_balls, np.empty((2, *rows.places.shape))
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
        at = times[shots].ravel()
        velocity = paths.velocity[last] + (at - paths.start[last])[:, None] * paths.acceleration[last]
        stopped = at > paths.start[last] + paths.duration[last]
        found[0, shots] = paths.at_pieces(last, at).reshape(found[0, shots].shape)
        found[1, shots] = np.where(stopped[:, None], 0.0, velocity).reshape(found[1, shots].shape)
    return found[0], found[1]


def errors(scene: Scene, starts: Floats, rows: Rows) -> Floats:
    """Returns the places of the model less those of the rows, (m, r, 2) m; those of missing rows are 0."""
    record = run(scene, starts, rows)._record("errors")
    return (modelled(record, rows, _clock(record, starts, rows, rows.time))[0] - rows.places) * rows.seen[..., None]


def _clock(record: Record, starts: Floats, rows: Rows, times: Floats) -> Floats:
    """Returns the times (m, q) of the simulated shots, which begin at the strike."""
    instant = starts[:, Layout(rows.in_play.shape[1]).instant, None]
    return np.clip(times - instant, 0.0, record.time[:, None])


def evaluate(scene: Scene, starts: Floats, rows: Rows, names: Sequence[str] = ()) -> Residuals:
    """Returns the residuals of shots from their starts, with the derivatives by numbers of `Physics` by name."""
    record = run(scene, starts, rows)._record("evaluate")
    (m, r), at = rows.used.shape, Layout(rows.in_play.shape[1])
    places, velocities = modelled(record, rows, _clock(record, starts, rows, rows.time))
    weight = (rows.used / rows.scale)[..., None]
    rates = start_jacobians(record, _clock(record, starts, rows, rows.times), names, 1)
    rates = np.moveaxis(rates[np.arange(m)[:, None], rows.frame, :, rows.ball], 2, 3)  # (m, r, 2, lanes)
    runs = (rows.time > starts[:, at.instant, None])[..., None]
    by_instant = np.where(runs, -velocities, 0.0)[..., None]
    rates = np.concatenate((rates[..., : at.instant], by_instant, rates[..., at.instant :]), axis=3)
    rates[..., : at.width] *= np.isnan(rows.known)[:, None, None, :]
    off, rates = (places - rows.places) * weight, rates * weight[..., None]
    prior = (np.einsum("mpd,md->mp", rows.prior.matrix, starts) - rows.prior.target) / CAUCHY
    by_prior = rows.prior.matrix * np.isnan(rows.known)[:, None] / CAUCHY
    by_prior = np.concatenate((by_prior, np.zeros((*prior.shape, len(names)))), axis=2)
    values = np.concatenate((off.reshape(m, 2 * r), prior), axis=1)
    return Residuals(values, np.concatenate((rates.reshape(m, 2 * r, -1), by_prior), axis=1), 2 * r)


def spin_of_cue(scene: Scene, speed: Floats) -> Floats:
    """Returns the largest spins, rad/s, that a level cue gives a cue ball of some speeds, m/s.

    An impulse at the miscue offset gives a sphere (moment of inertia 2/5 m R^2) the spin 2.5 offset speed / R^2.
    """
    return 2.5 * scene.cue.miscue_offset * speed / scene.balls.radius[0]


def allowed(scene: Scene, starts: Floats, rows: Rows) -> tuple[Floats, Bools]:
    """Moves balls that overlap apart and balls that reach into a cushion out of it, and limits the other numbers.

    Returns:
        The starts (m, width), and whether they are allowed (m,).
    """
    (m, n), at = rows.in_play.shape, Layout(rows.in_play.shape[1])
    radius = np.array(scene.balls.radius)
    reach = np.array([scene.balls.contact_distances(i) for i in range(n)])
    moved = starts.copy()
    moved[:, at.velocity] = np.clip(moved[:, at.velocity], -MOST_SPEED, MOST_SPEED)
    moved[:, at.instant] = np.clip(moved[:, at.instant], 0.0, rows.latest)
    most = MOST_SPIN * spin_of_cue(scene, np.hypot(*moved[:, at.velocity].T))[:, None]
    spins = moved[:, at.spin]  # a view
    np.clip(spins, -most, most, out=spins, where=np.isnan(rows.known[:, at.spin]))
    places = moved[:, at.places].reshape(m, n, 2)  # a view
    both = np.triu(rows.in_play[:, :, None] & rows.in_play[:, None, :], 1)
    bad = np.zeros(m, np.bool_)
    for _ in range(20):
        apart = places[:, :, None] - places[:, None, :]
        overlap = both & (np.hypot(apart[..., 0], apart[..., 1]) < reach)
        close = rows.in_play & (scene.table.clearance(places) < radius)
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
        bad |= (inside & rows.in_play).any(axis=1)
    return moved, ~bad


def column_sizes(normal: Floats) -> Floats:
    """Returns the norms of the columns for normal equations (..., d, d); 1 for a column of zeros."""
    # After an elimination of the starts, rounding can make an entry slightly negative.
    size = np.sqrt(np.maximum(np.diagonal(normal, axis1=-2, axis2=-1), 0.0))
    return np.where(size > 0.0, size, 1.0)


def settle(scene: Scene, starts: Floats, rows: Rows, most: int = _STEPS) -> tuple[Floats, Floats]:
    """Fits the starts of shots, each by itself, with constant numbers (Levenberg 1944, Marquardt 1963).

    Args:
        scene: The scene.
        starts: (m, width), allowed.
        rows: The rows.
        most: Largest number of steps.

    Returns:
        The starts, and the loss of each shot (m,).
    """
    starts, cost = starts.copy(), np.zeros(len(starts))
    for some, part in rows.groups():
        starts[some], cost[some] = _settle(scene, starts[some], part, most)
    return starts, cost


def _settle(scene: Scene, starts: Floats, rows: Rows, most: int) -> tuple[Floats, Floats]:
    """Returns the result of `settle` for a group of shots."""
    values, jacobian, robust = evaluate(scene, starts, rows)
    cost, damping = Residuals(values, jacobian, robust).loss, np.full(len(starts), 1e-3)
    active = np.ones(len(starts), np.bool_)
    for _ in range(most):
        running = np.flatnonzero(active)
        if not running.size:
            break
        here, some = Residuals(values[running], jacobian[running], robust), rows.of(running)
        pulled = np.swapaxes(here.weighted, 1, 2)
        normal, slope = pulled @ here.jacobian, (pulled @ here.values[..., None])[..., 0]
        size = column_sizes(normal)
        normal /= size[:, :, None] * size[:, None, :]
        normal += damping[running, None, None] * np.eye(size.shape[1])
        step = np.linalg.solve(normal, (slope / size)[..., None])[..., 0] / size
        ends = (step * slope).sum(axis=1) <= _CONVERGED * cost[running] + _EXACT  # the gain that the step promises
        tried, fine = allowed(scene, starts[running] - step, some)
        tried[~fine] = starts[running][~fine]
        then = evaluate(scene, tried, some)
        better = then.loss < cost[running]
        gain, taken = cost[running] - then.loss, running[better]
        starts[taken], values[taken], jacobian[taken] = tried[better], then.values[better], then.jacobian[better]
        cost[taken] = then.loss[better]
        damping[running] = np.where(better, np.maximum(damping[running] / 10.0, 1e-9), damping[running] * 10.0)
        done = ends | np.where(better, gain <= _CONVERGED * cost[running], damping[running] > 1e4)
        active[running[done]] = False
    return starts, cost


def guesses(scene: Scene, rows: Rows) -> Floats:
    """Returns guesses of the starts from the rows before the first contact, (m, windows * rolls, width)."""
    m, at = len(rows.in_play), Layout(rows.in_play.shape[1])
    found = np.zeros((m, len(_WINDOWS), at.width))
    for k in range(m):
        for i in np.flatnonzero(rows.in_play[k]):
            mine = np.flatnonzero(rows.seen[k] & (rows.ball[k] == i))[:3]
            found[k, ..., 2 * i : 2 * i + 2] = np.median(rows.places[k, mine], axis=0)
        moves = rows.seen[k] & (rows.ball[k] == 0) & (rows.time[k] >= rows.latest[k])
        free = np.flatnonzero(moves & (rows.after[k] == 0))
        mine = free if len(free) > 1 else np.flatnonzero(moves)[:2]
        if len(mine) < 2:  # the velocity is known
            continue
        for start, window in zip(found[k], _WINDOWS, strict=True):
            times, places = rows.time[k, mine[:window]], rows.places[k, mine[:window]]
            line = np.polyfit(times, places, 2 if len(times) > 9 else 1)
            velocity, begin = line[-2], line[-1]
            if rows.latest[k] > 0.0:
                begin = found[k, 0, :2].copy()
                square = max(float(velocity @ velocity), 1e-9)
                start[..., at.instant] = times[0] - (places[0] - begin) @ velocity / square
            start[..., :2], start[..., at.velocity] = begin, velocity
    rolls = _other_spins(scene, found)[len(SIDES) :]
    return np.concatenate(rolls or [found], axis=1)


def _other_spins(scene: Scene, starts: Floats) -> list[Floats]:
    """Returns starts (..., width) with other side spins, and with other spins about a horizontal axis."""
    if scene.physics.motion != "sliding":
        return []
    at = Layout(scene.n_balls)
    velocity = starts[..., at.velocity]
    most = spin_of_cue(scene, np.hypot(velocity[..., 0], velocity[..., 1]))
    found = [starts.copy() for _ in (*SIDES, *ROLLS)]
    for side, one in zip(SIDES, found, strict=False):
        one[..., at.side] = side * most
    for roll, one in zip(ROLLS, found[len(SIDES) :], strict=True):
        one[..., at.spin.start : at.side] = roll * velocity[..., ::-1] * (-1.0, 1.0) / scene.balls.radius[0]
    return found


def search(scene: Scene, rows: Rows, starts: Floats | None = None) -> Floats:
    """Returns the best starts of shots (m, width): fits from guesses, or from given starts and other spins of these.

    The loss has several minima over the spin: the ball may slip or stick at each of its contacts. The worse half of the
    fits ends after a few steps (successive halving).

    Raises:
        ValueError: If balls overlap or lie outside of the table in all guesses of a shot.
    """
    tried = guesses(scene, rows) if starts is None else np.stack([starts, *_other_spins(scene, starts)], axis=1)
    m, g, width = tried.shape
    tried, shot = np.where(np.isnan(rows.known[:, None]), tried, rows.known[:, None]), np.repeat(np.arange(m), g)
    flat, fine = allowed(scene, tried.reshape(-1, width), rows.of(shot))
    tried, fine = flat.reshape(tried.shape), fine.reshape(m, g)
    if not fine.any(axis=1).all():
        lost = int(np.argmin(fine.any(axis=1)))
        raise ValueError(f"shot {lost} begins with balls that overlap or lie outside of the table")
    tried = np.where(fine[..., None], tried, tried[np.arange(m), fine.argmax(axis=1)][:, None])
    for keep, steps in _HALVES:
        shot = np.repeat(np.arange(m), tried.shape[1])
        ends, loss = settle(scene, tried.reshape(-1, width), rows.of(shot), steps)
        best = np.argsort(loss.reshape(m, -1), axis=1, kind="stable")[:, :keep]
        tried = np.take_along_axis(ends.reshape(m, -1, width), best[..., None], axis=1)
    return settle(scene, tried[:, 0], rows)[0]
