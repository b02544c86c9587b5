"""The fit of the start of a shot with fixed constants of the physics, from many guesses at once."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from billiards_env.calibration.contacts import CUSHION, POCKET, Contact
from billiards_env.calibration.shot import CAUCHY, INSTANT, PLACES, SPIN, VELOCITY, Shot
from billiards_env.calibration.tracks import Bools, Floats, Ints
from billiards_env.derivatives.shot_derivatives import Record, start_jacobians
from billiards_env.engine.trajectory import Trajectory
from billiards_env.scene import Scene
from billiards_env.shots.result import ShotResult
from billiards_env.shots.simulation import BatchResult, simulate_batch

MOST_SPEED = 20.0
"""m/s, of each component of the cue ball's velocity. The hardest breaks reach 16."""

MOST_SPIN = 1.5
"""Largest component of the cue ball's spin over the largest spin of a level strike, see `spin_of_cue`. More than 1,
because an elevated cue gives more, and because the ball may slow down before the first row."""

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


def run(scene: Scene, starts: Floats, shot: Shot) -> BatchResult:
    """Simulates a shot from starts (g, width) until its last row that is used."""
    places, velocities = starts[:, PLACES].reshape(len(starts), -1, 2), starts[:, VELOCITY]
    spins = starts[:, SPIN] if scene.physics.motion == "sliding" else None
    end = max(1e-3, float(shot.time.max(initial=0.0, where=shot.used)))
    # A call takes a millisecond, too little for threads.
    return simulate_batch(
        scene, places, velocities, spins=spins, in_play=shot.in_play, max_time=end, record=True, threads=1
    )


def simulated(scene: Scene, shot: Shot) -> ShotResult:
    """Returns a shot from its start, recorded to its last row."""
    return run(scene, shot.starts, shot._replace(used=np.ones_like(shot.used)))[0]


def model_contacts(scene: Scene, shot: Shot, ball: int) -> Iterator[Contact]:
    """Yields the contacts of a ball in the model until the last row, in the order of time."""
    events: Any = simulated(scene, shot).events
    for event in events[np.isin(events["kind"], ("ball_ball", "cushion", "pocket"))]:
        kind, bodies = event["kind"], [int(event["ball"]), int(event["other"])]
        if ball in (bodies if kind == "ball_ball" else bodies[:1]):
            body = sum(bodies) - ball
            other = {"cushion": CUSHION, "pocket": POCKET}.get(kind, body)
            time = float(event["time"] + shot.begin + shot.starts[0, INSTANT])
            yield Contact(time, ball, other, np.array([event["x"], event["y"]]), float(event["speed"]), body)


def _motion(record: Record, balls: Ints, times: Floats) -> tuple[Floats, Floats]:
    """Returns the places and the velocities of balls (r,) at times (g, r) of g simulated shots, (g, r, 2) each."""
    n, span = record.scene.n_balls, float(record.time.max()) + 1.0
    paths = Trajectory.of(np.concatenate([p.segments[p.bounds[0, 1] : p.bounds[-1, 1]] for p in record.parts]))
    counts = np.concatenate([np.diff(part.bounds[:, 1]) for part in record.parts])
    owner = np.repeat(np.arange(len(times)), counts) * n + paths.ball
    order = np.argsort(owner, kind="stable")  # those of a ball stay in the order of time
    keys = (np.arange(len(times))[:, None] * n + balls) * span + times
    last = order[np.searchsorted((owner * span + paths.start)[order], keys.ravel(), side="right") - 1]
    places, velocities = paths.at_pieces(last, times.ravel()), paths.velocities_on(last, times.ravel())
    return places.reshape(*times.shape, 2), velocities.reshape(*times.shape, 2)


def errors(scene: Scene, shot: Shot) -> Floats:
    """Returns the places of the model less those of all rows, (r, 2) m."""
    places = simulated(scene, shot).at(np.maximum(shot.time - shot.starts[0, INSTANT], 0.0))
    return places[np.arange(len(places)), shot.track.balls] - shot.track.positions


def linearised(scene: Scene, starts: Floats, shot: Shot, names: Sequence[str] = ()) -> tuple[Floats, Floats]:
    """Returns the errors of starts (g, width), and their derivatives by the starts and by constants of `Physics`.

    Returns:
        (g, q) the errors of the q / 2 used rows over their scales, and of the prior over `CAUCHY`; (g, q, width + s).
    """
    record = run(scene, starts, shot)._record("evaluate")
    rows = np.flatnonzero(shot.used)
    ball = shot.track.balls[rows]
    times, frame = np.unique(np.append(0.0, shot.time[rows]), return_inverse=True)
    frame = frame[1:]
    g = len(starts)
    # The simulated shots begin at the strike.
    clock = np.clip(times - starts[:, INSTANT, None], 0.0, record.time[:, None])
    places, velocities = _motion(record, ball, clock[:, frame])
    rates = start_jacobians(record, clock, names, 1)[np.arange(g)[:, None], frame, :, ball]  # (g, r, lanes, 2)
    by_instant = np.where((shot.time[rows] > starts[:, INSTANT, None])[..., None], -velocities, 0.0)
    rates = np.insert(rates, starts.shape[1] - 1, by_instant, axis=2)
    off = ((places - shot.track.positions[rows]) / shot.scale[rows, None]).reshape(g, -1)
    rates = np.moveaxis(rates / shot.scale[rows, None, None], 2, 3).reshape(*off.shape, rates.shape[2])
    prior = np.pad(shot.prior, [(0, 0), (0, len(names))]) / CAUCHY
    values = np.concatenate((off, (starts @ shot.prior.T - shot.target) / CAUCHY), axis=1)
    jacobian = np.concatenate((rates, np.broadcast_to(prior, (g, *prior.shape))), axis=1)
    jacobian[..., : starts.shape[1]] *= np.isnan(shot.known)
    return values, jacobian


def evaluate(scene: Scene, starts: Floats, shot: Shot, names: Sequence[str] = ()) -> Normal:
    """Returns the `Normal` of starts (g, width), with the derivatives by constants of `Physics` by name."""
    values, jacobian = linearised(scene, starts, shot, names)
    square = np.square(values)
    robust = np.arange(values.shape[1]) < 2 * np.count_nonzero(shot.used)
    pulled = np.swapaxes(np.where(robust, 1.0 / (1.0 + square), 1.0)[..., None] * jacobian, 1, 2)
    loss = np.where(robust, np.log1p(square), square).sum(axis=1)
    return Normal(loss, (pulled @ values[..., None])[..., 0], pulled @ jacobian)


def spin_of_cue(scene: Scene, speed: Floats) -> Floats:
    """Returns the largest spins, rad/s, that a level cue gives a cue ball of some speeds, m/s.

    An impulse at the miscue offset, in ball radii, gives a sphere (moment of inertia 2/5 m R^2) the spin
    2.5 * offset * speed / R.
    """
    return 2.5 * scene.cue.miscue_offset * speed / scene.balls.radius[0]


def allowed(scene: Scene, starts: Floats, shot: Shot) -> tuple[Floats, Bools]:
    """Moves balls that overlap apart and balls that reach into a cushion out of it, and limits the other numbers.

    Returns:
        The starts (g, width), and whether they are allowed (g,).
    """
    radius = np.array(scene.balls.radius)
    index = np.arange(scene.n_balls)
    reach = scene.balls.contact_distances(index[:, None], index)
    moved = starts.copy()
    moved[:, VELOCITY] = np.clip(moved[:, VELOCITY], -MOST_SPEED, MOST_SPEED)
    moved[:, INSTANT] = np.clip(moved[:, INSTANT], 0.0, shot.gap)
    most = MOST_SPIN * spin_of_cue(scene, np.hypot(*moved[:, VELOCITY].T))[:, None]
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
        invalid |= (pocket.contains(places) & shot.in_play).any(axis=1)
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
    scene: Scene, starts: Floats, shot: Shot, names: Sequence[str] = (), most: int = _STEPS
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


def _with_spin_prior(scene: Scene, shot: Shot) -> Shot:
    """Returns a shot with a prior of the spin for the velocity of its start."""
    x, y = shot.starts[0, VELOCITY]
    speed = max(float(np.hypot(x, y)), 1e-6)
    prior, target = shot.prior.copy(), shot.target.copy()
    turn = np.array([[x, y, 0.0], [-y, x, 0.0], [0.0, 0.0, speed]]) / np.array([SPINS]).T
    prior[-3:, SPIN], target[-2] = turn * scene.balls.radius[0] / speed**2, 0.5 / SPINS[1]
    return shot._replace(prior=prior, target=target)


def _guesses(scene: Scene, shot: Shot) -> Floats:
    """Returns the starts (g, width) of a shot, and their copies with other spins if balls can spin."""
    starts = shot.starts
    if scene.physics.motion != "sliding":
        return starts
    spins = [(side, roll) for side in SIDES for roll in ROLLS]
    side, roll = np.tile(spins, (len(starts), 1)).T
    others = np.repeat(starts, len(spins), axis=0)
    x, y = others[:, VELOCITY].T
    radius, most = scene.balls.radius[0], spin_of_cue(scene, np.hypot(x, y))
    others[:, SPIN] = np.column_stack((-roll * y / radius, roll * x / radius, side * most))
    return np.concatenate((starts, others))


def search(scene: Scene, shot: Shot) -> Shot:
    """Returns a shot with its best start, fitted from its starts and from copies with other spins.

    The loss has several minima over the spin: the ball may slip or stick at each of its contacts. Every few steps only
    the best fits continue: 20, then 8, 3 and 1 (successive halving).

    Raises:
        ValueError: If balls overlap or lie outside of the table.
    """
    if len(shot.starts) == 1:  # the result of a fit
        shot = _with_spin_prior(scene, shot)
    tried, valid = allowed(scene, np.where(np.isnan(shot.known), _guesses(scene, shot), shot.known), shot)
    if not valid.any():
        raise ValueError(f"shot {shot.track.name} begins with balls that overlap or lie outside of the table")
    tried = tried[valid]
    for keep, steps in _HALVES:
        tried, current = settle(scene, tried, shot, (), steps)
        tried = tried[np.argsort(current.loss, kind="stable")[:keep]]
    return shot._replace(starts=settle(scene, tried, shot)[0])
