"""The fit of the start of a shot with fixed constants of the physics, from many guesses at once."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from billiards_env.calibration.contacts import CUSHION, POCKET, Contact
from billiards_env.calibration.preparation import CAUCHY, INSTANT, PLACES, SPIN, VELOCITY, PreparedTrack
from billiards_env.calibration.tracks import Bools, Floats, Ints
from billiards_env.derivatives.shot_derivatives import start_jacobians
from billiards_env.engine.trajectory import Trajectory
from billiards_env.scene import Scene
from billiards_env.shots.result import ShotResult
from billiards_env.shots.simulation import BatchResult, simulate_batch

MOST_SPEED = 20.0
"""m/s, of each component of the cue ball's velocity. The hardest breaks reach 16."""

MOST_SPIN = 1.5
"""Largest component of the cue ball's spin over the largest spin of a level strike, 2.5 * miscue offset * v / R for an
offset in ball radii (a sphere has the moment of inertia 2/5 m R^2). More than 1, because an elevated cue gives more,
and because the ball may slow down before the first row."""

SIDES = (-0.7, -0.35, 0.02, 0.35, 0.7)
"""The side spins of the guesses, over the largest of a level strike. At 0 the derivative by the side spin is 0."""

ROLLS = (1.2, 0.7, 0.2, -0.6)
"""The spins of the guesses about a horizontal axis, over that of a ball that rolls."""

SPINS = (0.1, 0.7, 0.7)
"""Standard deviations of the prior of the spin, over v / R, for three axes: along the path (massé), across it and
vertical. The mean of the second is half the spin of a rolling ball. The last two are wide, because players choose these
spins."""

_STEPS = 30  # most steps of `settle`
_HALVES = (20, 4), (8, 8), (3, 10), (1, 10)  # starts that a search keeps, and the steps before that
_RANDOM = (6, 3), (1, 8)  # the same for random starts
_EACH, _GAIN = 16, 1.0  # random starts of each kind, near the best spins and any; a round with less gain is the last
_TURN, _FASTER, _NEAR = 0.012, 0.02, 0.3  # most change of direction, rad, and of speed; spread of spins over `SPINS`
_CONVERGED, _EXACT = 1e-6, 1e-14  # relative and absolute change of the loss


class Normal(NamedTuple):
    """The loss of g starts of a shot, and its quadratic approximation (Gauss and Newton).

    Attributes:
        loss: (g,), Cauchy's loss log(1 + r^2) of the used rows, and the squares of the prior.
        slope: (g, width + s), half of its derivative by the start and by s shared constants.
        matrix: (g, width + s, width + s), half of the second.
    """

    loss: Floats
    slope: Floats
    matrix: Floats


def simulate_starts(scene: Scene, starts: Floats, shot: PreparedTrack) -> BatchResult:
    """Simulates a shot from starts (g, width) until its last row that is used."""
    places = starts[:, PLACES].reshape(len(starts), -1, 2)
    velocities, spins = np.zeros_like(places), np.zeros((*places.shape[:2], 3))
    velocities[:, shot.cue_ball], spins[:, shot.cue_ball] = starts[:, VELOCITY], starts[:, SPIN]
    end = max(1e-3, float(shot.time.max(initial=0.0, where=shot.used)))
    # A call takes a millisecond, too little for threads.
    return simulate_batch(
        *(scene, places, velocities),
        spins=spins if scene.physics.motion == "sliding" else None,
        in_play=shot.in_play,
        max_time=end,
        record=True,
        threads=1,
    )


def simulated(scene: Scene, shot: PreparedTrack) -> ShotResult:
    """Returns a shot from its start, recorded to its last row."""
    return simulate_starts(scene, shot.starts, shot._replace(used=np.ones_like(shot.used)))[0]


def model_contacts(scene: Scene, shot: PreparedTrack, ball: int) -> Iterator[Contact]:
    """Yields the contacts of a ball in the model until the last row, in the order of time."""
    events: Any = simulated(scene, shot).events
    for event in events[np.isin(events["kind"], ("ball_ball", "cushion", "pocket"))]:
        kind, bodies = event["kind"], [int(event["ball"]), int(event["other"])]
        if ball in (bodies if kind == "ball_ball" else bodies[:1]):
            body = sum(bodies) - ball
            other = {"cushion": CUSHION, "pocket": POCKET}.get(kind, body)
            time = float(event["time"] + shot.begin + shot.starts[0, INSTANT])
            yield Contact(time, ball, other, np.array([event["x"], event["y"]]), float(event["speed"]), body)


def _motion(batch: BatchResult, balls: Ints, times: Floats) -> tuple[Floats, Floats]:
    """Returns the places and the velocities of balls (r,) at times (g, r) of g simulated shots, (g, r, 2) each."""
    shots = np.arange(len(times))
    assert batch.log is not None
    paths, pieces = Trajectory.of(batch.log.segments), np.diff(batch.log.bounds[:, 1])  # of each shot
    # The keys sort the pieces by shot, ball and time. The last piece that begins at or before a time contains it.
    span = float(batch.time.max()) + 1.0
    owner = np.repeat(shots, pieces) * batch.scene.n_balls + paths.ball
    order = np.argsort(owner, kind="stable")  # those of a ball stay in the order of time
    begins = (owner * span + paths.start)[order]
    sought = (shots[:, None] * batch.scene.n_balls + balls) * span + times
    piece = order[np.searchsorted(begins, sought.ravel(), side="right") - 1]
    motion = paths.at_pieces(piece, times.ravel()), paths.velocities_on(piece, times.ravel())
    places, velocities = (part.reshape(*times.shape, 2) for part in motion)
    return places, velocities


def errors(scene: Scene, shot: PreparedTrack) -> Floats:
    """Returns the places of the model less those of all rows, (r, 2) m."""
    places = simulated(scene, shot).at(np.maximum(shot.time - shot.starts[0, INSTANT], 0.0))
    return places[np.arange(len(places)), shot.track.balls] - shot.track.positions


def linearised(scene: Scene, starts: Floats, shot: PreparedTrack, names: Sequence[str] = ()) -> tuple[Floats, Floats]:
    """Returns the errors of starts (g, width), and their derivatives by the starts and by constants of `Physics`.

    Returns:
        (g, q) the errors of the q / 2 used rows over the scale, and of the prior over `CAUCHY`; (g, q, width + s).
    """
    batch = simulate_starts(scene, starts, shot)
    width = starts.shape[1]
    balls, positions = shot.track.balls[shot.used], shot.track.positions[shot.used]
    times, frame = np.unique(np.append(0.0, shot.time[shot.used]), return_inverse=True)
    frame = frame[1:]  # of each row
    since = times - starts[:, INSTANT, None]  # (g, times), s after the strike, where the simulated shots begin
    clock = np.clip(since, 0.0, batch.time[:, None])
    places, velocities = _motion(batch, balls, clock[:, frame])
    by_prior = starts @ shot.prior.T - shot.target
    values = np.concatenate((_by_number(places - positions) / shot.scale, by_prior / CAUCHY), axis=1)

    rates = start_jacobians(batch, clock, shot.cue_ball, names, 1)[np.arange(len(starts))[:, None], frame, :, balls]
    by_start, by_constant = np.split(np.moveaxis(rates, 2, 3), [width - 1], axis=3)  # (g, r, 2, ...)
    by_instant = np.where(since[:, frame, None] > 0.0, -velocities, 0.0)
    of_rows = _by_number(np.concatenate((by_start, by_instant[..., None], by_constant), axis=3)) / shot.scale
    of_prior = np.append(shot.prior, np.zeros((len(shot.prior), len(names))), axis=1) / CAUCHY
    jacobian = np.concatenate((of_rows, np.broadcast_to(of_prior, (len(starts), *of_prior.shape))), axis=1)
    jacobian[..., :width] *= np.isnan(shot.known)
    return values, jacobian


def _by_number(rows: Floats) -> Floats:
    """Returns numbers of x and y of rows (g, r, 2, ...) as (g, 2 r, ...)."""
    return rows.reshape(len(rows), -1, *rows.shape[3:])


def evaluate(scene: Scene, starts: Floats, shot: PreparedTrack, names: Sequence[str] = ()) -> Normal:
    """Returns the `Normal` of starts (g, width), with the derivatives by constants of `Physics` by name."""
    values, jacobian = linearised(scene, starts, shot, names)
    square = np.square(values)
    robust = np.arange(values.shape[1]) < 2 * np.count_nonzero(shot.used)
    pulled = np.swapaxes(np.where(robust, 1.0 / (1.0 + square), 1.0)[..., None] * jacobian, 1, 2)
    loss = np.where(robust, np.log1p(square), square).sum(axis=1)
    return Normal(loss, (pulled @ values[..., None])[..., 0], pulled @ jacobian)


def allowed(scene: Scene, starts: Floats, shot: PreparedTrack) -> tuple[Floats, Bools]:
    """Moves balls that overlap apart and balls that reach into a cushion out of it, and limits the other numbers.

    Returns:
        The starts (g, width), and whether they are allowed (g,).
    """
    radius = np.array(scene.balls.radius)
    index = np.arange(scene.n_balls)
    reach = scene.balls.contact_distances(index[:, None], index)
    moved = starts.copy()
    moved[:, VELOCITY] = velocity = np.clip(moved[:, VELOCITY], -MOST_SPEED, MOST_SPEED)
    moved[:, INSTANT] = np.clip(moved[:, INSTANT], 0.0, shot.gap)
    largest = 2.5 * scene.cue.miscue_offset * np.hypot(*velocity.T) / radius[shot.cue_ball]  # of a level strike
    most = MOST_SPIN * largest[:, None]
    spins, places = moved[:, SPIN], moved[:, PLACES].reshape(len(moved), -1, 2)  # views
    np.clip(spins, -most, most, out=spins, where=np.isnan(shot.known[SPIN]))
    pairs = shot.in_play[:, None] & shot.in_play & (index[:, None] != index)
    order = np.sign(index[:, None] - index)  # for balls at one place
    steps = 1e-7 * np.eye(2)[:, None]
    invalid = np.zeros(len(moved), np.bool_)
    for _ in range(20):
        line = places[:, :, None] - places[:, None]
        line[..., 0] += 1e-9 * order * (line == 0.0).all(axis=-1)
        distance = np.maximum(np.hypot(*np.moveaxis(line, -1, 0)), 1e-9)
        close = shot.in_play & (scene.table.clearance(places) < radius)
        overlap = pairs & (distance < reach)
        invalid = overlap.any(axis=(1, 2)) | close.any(axis=1)
        if not invalid.any():
            break
        push = np.where(overlap, 0.5 * (reach + 1e-9) / distance - 0.5, 0.0)
        places += (push[..., None] * line).sum(axis=2)
        ball, at = np.nonzero(close)[1], places[close]
        inwards = (scene.table.clearance(at + steps) - scene.table.clearance(at - steps)).T / 2e-7
        places[close] += inwards * (radius[ball] - scene.table.clearance(at) + 1e-9)[:, None]
    for pocket in scene.table.pockets:
        invalid |= ((pocket.distance(places) < 0.0) & shot.in_play).any(axis=1)
    return moved, ~invalid


def damped(matrix: Floats, slope: Floats, damping: Floats | float) -> Floats:
    """Returns the steps (..., d) of damped normal equations (..., d, d) (Levenberg 1944, Marquardt 1963)."""
    # After an elimination of the starts, rounding can make an entry slightly negative.
    size = np.sqrt(np.maximum(np.diagonal(matrix, axis1=-2, axis2=-1), 0.0))
    size = np.where(size > 0.0, size, 1.0)
    ridge = np.asarray(damping)[..., None, None] * np.eye(size.shape[-1])
    scaled = matrix / (size[..., None] * size[..., None, :]) + ridge
    return np.linalg.solve(scaled, (slope / size)[..., None])[..., 0] / size


def settle(
    scene: Scene, starts: Floats, shot: PreparedTrack, names: Sequence[str] = (), most: int = _STEPS
) -> tuple[Floats, Normal]:
    """Fits starts of a shot with fixed constants.

    Args:
        scene: The scene.
        starts: (g, width), allowed.
        shot: The shot.
        names: Numbers of `Physics` for the `Normal`.
        most: Largest number of steps.

    Returns:
        The starts, and the `Normal` at them.
    """
    current, width = evaluate(scene, starts, shot, names), starts.shape[1]
    damping = np.full(len(starts), 1e-3)
    for _ in range(most):
        slope = current.slope[:, :width]
        step = damped(current.matrix[:, :width, :width], slope, damping)
        tried, valid = allowed(scene, starts - step, shot)
        tried = np.where(valid[:, None], tried, starts)
        proposed = evaluate(scene, tried, shot, names)
        better = proposed.loss < current.loss
        starts = np.where(better, tried.T, starts.T).T
        current = Normal(*(np.where(better, new.T, old.T).T for old, new in zip(current, proposed, strict=True)))
        damping = np.where(better, np.maximum(damping / 10.0, 1e-9), damping * 10.0)
        promised = (step * slope).sum(axis=1)  # the gain of the loss
        if np.all((promised <= _CONVERGED * current.loss + _EXACT) | (damping > 1e4)):
            break
    return starts, current


def _axes(scene: Scene, shot: PreparedTrack, velocities: Floats) -> Floats:
    """Returns the spins v / R about the axes of `SPINS`, (..., 3, 3), one in each row, at velocities (..., 2)."""
    x, y = np.moveaxis(velocities, -1, 0)
    zero, speed = np.zeros_like(x), np.maximum(np.hypot(x, y), 1e-6)
    axes = np.array([[x, y, zero], [-y, x, zero], [zero, zero, speed]]) / scene.balls.radius[shot.cue_ball]
    return np.moveaxis(axes, (0, 1), (-2, -1))


def _with_spins(scene: Scene, shot: PreparedTrack, starts: Floats, spins: Floats) -> Floats:
    """Returns copies of starts (g, width) with other spins (g, 3), over v / R for the axes of `SPINS`."""
    starts = starts.copy()
    starts[:, SPIN] = (spins[:, None] @ _axes(scene, shot, starts[:, VELOCITY]))[:, 0]
    return starts


def _guesses(scene: Scene, shot: PreparedTrack) -> Floats:
    """Returns the starts (g, width) of a shot, and their copies with other spins."""
    starts, most = shot.starts, 2.5 * scene.cue.miscue_offset
    spins = [(0.0, roll, side * most) for side in SIDES for roll in ROLLS]
    others = _with_spins(scene, shot, np.repeat(starts, len(spins), axis=0), np.tile(spins, (len(starts), 1)))
    return np.concatenate((starts, others))


def _random(scene: Scene, shot: PreparedTrack, start: Floats, rng: np.random.Generator) -> Floats:
    """Returns random starts (2 * _EACH, width) with directions and speeds near those of a start (1, width).

    The first half has spins near those of the start, the second half spins of the prior.
    """
    others, velocity = np.repeat(start, 2 * _EACH, axis=0), start[:, VELOCITY]
    turn, faster = rng.uniform(-1.0, 1.0, (2, len(others), 1))
    others[:, VELOCITY] += _FASTER * faster * velocity + _TURN * turn * (velocity[:, ::-1] * (-1.0, 1.0))
    axes, spins = _axes(scene, shot, velocity[0]), SPINS * rng.standard_normal((2, _EACH, 3))
    spins[0] = axes @ start[0, SPIN] / axes[2, 2] ** 2 + _NEAR * spins[0]
    spins[1, :, 1] += 0.5
    return _with_spins(scene, shot, others, spins.reshape(-1, 3))


def _best(scene: Scene, starts: Floats, shot: PreparedTrack, halves: Sequence[tuple[int, int]]) -> tuple[Floats, float]:
    """Returns the start (1, width) of a shot whose fit is best, fitted, and its loss.

    Every few steps only the best fits continue (successive halving).

    Args:
        scene: The scene.
        starts: (g, width), the starts of the fits.
        shot: The shot.
        halves: The number of fits that continue, and the steps before that, several times.

    Raises:
        ValueError: If balls overlap or lie outside of the table in all starts.
    """
    tried, valid = allowed(scene, np.where(np.isnan(shot.known), starts, shot.known), shot)
    if not valid.any():
        raise ValueError(f"shot {shot.track.name} begins with balls that overlap or lie outside of the table")
    tried = tried[valid]
    for keep, steps in halves:
        tried, current = settle(scene, tried, shot, (), steps)
        mirrored = tried[:, SPIN][:, 2] * tried[:, VELOCITY].prod(
            axis=1
        )  # the same for mirrored starts of a mirrored track
        tried = tried[np.lexsort((mirrored, current.loss))[:keep]]
    start, current = settle(scene, tried, shot)
    return start, float(current.loss[0])


def search(scene: Scene, shot: PreparedTrack) -> PreparedTrack:
    """Returns a shot with its best start.

    The loss has several minima: over the spin, because the ball may slip or stick at each of its contacts, and over the
    direction and the speed, because contacts appear and disappear. The search fits the starts of the shot and copies of
    them with other spins. It then fits random starts around the best one, until `2 * _EACH` of them lower the loss by
    less than `_GAIN`. They have a fixed seed.

    Raises:
        ValueError: If balls overlap or lie outside of the table.
    """
    if len(shot.starts) == 1:  # the result of a fit, whose velocity gives the prior of the spin
        axes, prior, target = _axes(scene, shot, shot.starts[0, VELOCITY]), shot.prior.copy(), shot.target.copy()
        prior[-3:, SPIN], target[-2] = axes / axes[2, 2] ** 2 / np.array([SPINS]).T, 0.5 / SPINS[1]
        shot = shot._replace(prior=prior, target=target)
    start, loss = _best(scene, _guesses(scene, shot), shot, _HALVES)
    rng, gain = np.random.default_rng(0), np.inf
    while gain >= _GAIN:
        other, other_loss = _best(scene, _random(scene, shot, start, rng), shot, _RANDOM)
        gain = loss - other_loss
        start, loss = (other, other_loss) if gain > 0.0 else (start, loss)
    return shot._replace(starts=start)
