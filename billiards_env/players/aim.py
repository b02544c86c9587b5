"""Finds the velocity of the cue ball that reaches goals: `aim`.

The goals are data: `Pot`, `Leave`, `Touch`, `FirstTouch` and `Cushions`. A shot reaches several goals at once. In every
case the cue ball must stay on the table.

`aim` begins with many shots in one batch: pots and hits by geometry (`pots.finder`), and then random shots. From those
nearest to the goals it follows the Gauss-Newton method, with a line search. The residuals of a shot are the distance of
a ball from the place to leave it, and the margins (see `shot_derivatives.Margins`) by which it misses its other
goals.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from billiards_env.derivatives.shot_derivatives import (
    check_derivatives,
    margin_columns,
    margins_by_cue_ball,
    rest_by_cue_ball,
)
from billiards_env.engine.strikes import Strike, strike_with
from billiards_env.physics.state import CUE_BALL
from billiards_env.pots.finder import SPEED, TOLERANCE, find_pots
from billiards_env.scene import Scene, check_scene
from billiards_env.shots.result import ShotResult
from billiards_env.shots.simulation import BatchResult, simulate, simulate_batch
from billiards_env.shots.tables import Tables
from billiards_env.support.checks import Range, array_of, finite, flag, integer, one_of, real, shaped, short

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

SHOTS = 100_000
"""The largest number of random shots with which `aim` begins, if those by geometry do not reach the goals."""

_STARTS = 10  # shots that Newton's method begins with, in the first round; then a share of the random shots
_SHARE = 0.05
_ENOUGH = 4  # such shots, without the others
_STEPS = 8  # of Newton's method
_SHARES = np.array([1.0, 0.3])  # of a step that the line search tries
_GAIN = 0.8  # the largest distance after a step, over that before it
_CLEAR = 0.002  # m; the margin that a step aims at
_EXACT = 1e-10  # m; residual at which Newton's method ends
_LONGEST = 0.3  # largest step, over the speed
_LEAST_STEP = 1e-13  # the least one: rounding decides the outcome of a shot with larger derivatives
_LEAST_SPEED = 0.05  # of the random shots, over the largest speed
_RADIUS = Range(0.0, 1e4, "m")  # of a `Leave`
_ROUND, _GROWTH = 800, 2  # number of random shots in the first round, and its growth
_FAN, _FAN_SPEED = 240, 0.6  # shots in all directions, and their speed over the largest

# The shots near a pot: speeds as shares of the way from the least to the largest, turns as shares of the tolerance
_POTS = 6  # pots with the largest tolerance
_SPEEDS = np.linspace(0.0, 1.0, 14)
_TURNS = np.linspace(-0.9, 0.9, 7)


@dataclasses.dataclass(frozen=True, slots=True)
class Pot:
    """Pots a ball.

    Attributes:
        ball: The ball.
        pocket: The pocket; None for any.
    """

    ball: int
    pocket: int | None = None


@dataclasses.dataclass(frozen=True, slots=True)
class Bank(Pot):
    """Pots a ball off a cushion: the ball has at least one cushion contact. Those with jaws and tips count."""


@dataclasses.dataclass(frozen=True, slots=True)
class Leave:
    """Brings a ball to rest near a point.

    Attributes:
        position: x and y, m.
        radius: Largest distance from the point, m. The search stops after the first round with a shot within it. With a
            small radius, such as 1e-9, it continues until a shot is that exact.
        ball: The ball.
    """

    position: tuple[float, float]
    radius: float = 0.01
    ball: int = CUE_BALL


@dataclasses.dataclass(frozen=True, slots=True)
class Touch:
    """Touches a ball with the cue ball."""

    ball: int


@dataclasses.dataclass(frozen=True, slots=True)
class FirstTouch:
    """Touches a ball with the cue ball before all others."""

    ball: int


@dataclasses.dataclass(frozen=True, slots=True)
class Cushions:
    """Gives the cue ball cushion contacts.

    Attributes:
        least: Their least number.
        before: The ball that the cue ball touches after them; None if it does not have to touch one.
    """

    least: int
    before: int | None = None


Goal = Pot | Leave | Touch | FirstTouch | Cushions

GOALS = {
    "pot": Pot,
    "bank": Bank,
    "leave": lambda x, y, *radius: Leave((x, y), *radius),
    "touch": Touch,
    "first_touch": FirstTouch,
    "cushions": Cushions,
}
"""The goals by name."""


def goal_named(text: str) -> Goal:
    """Returns the goal of a text: its name and its numbers, such as "pot:1:3", "leave:0.5:-0.3" or "cushions:3:2"."""
    name, *values = text.split(":")
    one_of("goal", name, tuple(GOALS))
    try:
        return GOALS[name](*(int(value) if value.isdecimal() else float(value) for value in values))
    except (TypeError, ValueError):
        raise ValueError(f"goal = {text!r}: expected numbers, as in 'pot:1:3' or 'leave:0.5:-0.3'") from None


def carom_goals(balls: Sequence[int], cushions: int = 0) -> tuple[tuple[Goal, ...], ...]:
    """Returns the ways to touch all balls, the last one after a number of cushion contacts: the goals of each."""
    touches = tuple(Touch(ball) for ball in balls)
    return tuple((*touches, Cushions(cushions, before=last)) for last in balls) if cushions else (touches,)


class Aim(NamedTuple):
    """A shot at goals, and others.

    Attributes:
        solved: Whether the shot reaches the goals.
        velocity: (2,) of the cue ball, m/s.
        residual: Distance of the balls from the places to leave them, m; 0 without a `Leave`.
        shot: The recorded shot.
        alternatives: (k, 2) velocities of other shots that reach the goals, the best first.
        stroke: The argument of `simulate` for the shot: its velocity, or its `Strike` with `strike=True`.
    """

    solved: bool
    velocity: Floats
    residual: float
    shot: ShotResult
    alternatives: Floats
    stroke: Floats | Strike


class _Problem(NamedTuple):
    """What a shot has to do.

    Attributes:
        table: The table; k is 1.
        goals: The goals.
        strike: Whether a cue strikes the cue ball.
    """

    table: Tables
    goals: tuple[Goal, ...]
    strike: bool


class _Tried(NamedTuple):
    """m shots and how near they are to the goals.

    Attributes:
        velocities: (m, 2) m/s.
        missed: (m,) Number of goals that are not reached, without `Leave`; a potted cue ball counts.
        off: (m,) Distance from the places to leave balls, m.
        solved: (m,) bool.
    """

    velocities: Floats
    missed: NDArray[np.int64]
    off: Floats
    solved: Bools

    def best(self, count: int) -> _Tried:
        """Returns the shots that are nearest to the goals; those that miss fewer of them, if there are several."""
        order = np.lexsort((self.off, self.missed))[:count]
        fewest = order[self.missed[order] == self.missed[order[0]]]
        chosen = fewest if len(fewest) >= _ENOUGH else order
        return _Tried(self.velocities[chosen], self.missed[chosen], self.off[chosen], self.solved[chosen])


def aim(
    scene: Scene,
    positions: ArrayLike,
    goals: Goal | Sequence[Goal],
    *,
    max_speed: float = 4.0,
    in_play: ArrayLike | None = None,
    strike: bool = False,
    shots: int = SHOTS,
    seed: int = 0,
) -> Aim:
    """Returns a shot that reaches goals, or the one that comes nearest.

    Args:
        scene: Table, balls and physics.
        positions: (n, 2) centres of the balls, m; ball 0 is the cue ball.
        goals: A goal or several, of `Pot`, `Bank`, `Leave`, `Touch`, `FirstTouch` and `Cushions`.
        max_speed: Largest speed of the cue ball, m/s.
        in_play: (n,) bool; by default all balls are in play.
        strike: Whether each shot is a `Strike` at the centre of the cue ball, which drives balls that touch it. It
            needs the motion "sliding".
        shots: The largest number of random shots to begin with, if those by geometry do not reach the goals.
        seed: The seed of the random shots.

    Returns:
        The shot and others. Without a `Leave`, the first one has the largest margins of its pots and touches. With one,
        it is the most exact one.

    Raises:
        ValueError: If there is no goal, a ball of a goal is not in play, a pocket of a goal does not exist, an
            argument of `simulate` is invalid, or the shots of the scene have no derivatives.

    Example:
        >>> from billiards_env import Scene
        >>> from billiards_env.players.aim import Leave, Pot, aim
        >>> aimed = aim(Scene.named("pool"), [[-0.6, 0.0], [0.6, 0.3]], [Pot(1, 3), Leave((0.5, -0.3))])
        >>> aimed.solved, aimed.shot.potted.tolist(), aimed.residual < 1e-9
        (True, [False, True], True)
    """
    problem = _checked(scene, positions, goals, max_speed, in_play, flag("strike", strike))
    integer("shots", shots, Range(0, None))
    rng, rounds = np.random.default_rng(seed), []
    for velocities in _starts(problem, shots, rng):
        starts = _STARTS if not rounds else max(_STARTS, int(_SHARE * len(velocities)))
        rounds.append(_solve(problem, _try(problem, velocities).best(starts)))
        if rounds[-1].solved.any():
            break
    tried = _Tried(*(np.concatenate(arrays) for arrays in zip(*rounds, strict=True)))
    order = np.lexsort((-_room(problem, tried), np.maximum(tried.off, _EXACT), tried.missed, ~tried.solved))
    best, others = order[0], order[1:][tried.solved[order[1:]]]
    velocity = tried.velocities[best]
    (places,), (in_play,) = problem.table.positions, problem.table.in_play
    shot = simulate(scene, places, stroke := _stroke(problem, velocity), in_play=in_play, record=True)
    return Aim(bool(tried.solved[best]), velocity, float(tried.off[best]), shot, tried.velocities[others], stroke)


def _checked(
    scene: Scene,
    positions: ArrayLike,
    goals: Goal | Sequence[Goal],
    max_speed: float,
    in_play: ArrayLike | None,
    strike: bool,
) -> _Problem:
    check_scene(scene)
    check_derivatives(scene, "aim", "the player 'search'")
    n, checked = scene.n_balls, tuple(goals) if isinstance(goals, Sequence) else (goals,)
    if not checked or not all(isinstance(goal, Goal) for goal in checked):
        raise ValueError(f"goals = {short(goals)}: expected goals such as Pot(1)")
    in_play = np.ones(n, bool) if in_play is None else array_of("in_play", in_play)
    if in_play.shape != (n,) or in_play.dtype != bool or not in_play[CUE_BALL]:
        raise ValueError(f"in_play = {short(in_play)}: expected ({n},) bool, with the cue ball in play")
    for goal in checked:
        name = type(goal).__name__
        least, field = 0 if isinstance(goal, Leave) else 1, "before" if isinstance(goal, Cushions) else "ball"
        ball = getattr(goal, field)
        if (ball is not None or field == "ball") and not in_play[integer(f"{name}.{field}", ball, Range(least, n - 1))]:
            raise ValueError(f"{name}.{field} = {ball}: expected a ball in play")
        if isinstance(goal, Cushions):
            integer("Cushions.least", goal.least, Range(0, None))
        if isinstance(goal, Pot) and goal.pocket is not None:
            integer("Pot.pocket", goal.pocket, Range(0, len(scene.table.pockets) - 1))
        if isinstance(goal, Leave):
            finite("Leave.position", goal.position, (2,))
            real("Leave.radius", goal.radius, _RADIUS)
    fastest = real("max_speed", max_speed, "max_speed")
    objects = in_play & (np.arange(n) != CUE_BALL)
    places = shaped("positions", positions, (n, 2))
    return _Problem(Tables(scene, places[None], in_play[None], objects[None], fastest), checked, strike)


def _stroke(problem: _Problem, velocities: Floats) -> Floats | Strike:
    """Returns how the cue ball begins shots with velocities (..., 2), as an argument of `simulate`."""
    return strike_with(velocities) if problem.strike else velocities


def _run(problem: _Problem, velocities: Floats, record: bool = False) -> BatchResult:
    table, strokes = problem.table, _stroke(problem, velocities)
    places = np.broadcast_to(table.positions, (len(velocities), *table.positions.shape[1:]))
    return simulate_batch(table.scene, places, strokes, in_play=table.in_play[0], record=record, threads=1)


def _starts(problem: _Problem, shots: int, rng: np.random.Generator) -> Iterator[Floats]:
    """Yields velocities (k, 2) of shots to begin with: pots or hits by geometry, and then more and more random ones.

    Three of four random shots have a heading near one that touches the ball of the first `Pot` or touch.
    """
    pots = [_pots(problem, goal) for goal in problem.goals if isinstance(goal, Pot)]
    hits = [_hits(problem, goal.ball) for goal in problem.goals if isinstance(goal, FirstTouch | Touch)]
    known = np.concatenate((*(pots or hits), np.empty((0, 2))))
    if len(known) or shots == 0:
        yield known if len(known) else np.zeros((1, 2))
    if shots == 0:
        return
    headings = np.linspace(-np.pi, np.pi, _FAN, endpoint=False)
    fan = _run(problem, _FAN_SPEED * problem.table.max_speed * np.column_stack((np.cos(headings), np.sin(headings))))
    balls = [goal.ball for goal in problem.goals if isinstance(goal, Pot | FirstTouch | Touch)]
    if balls and (fan.cushions_before_hit[:, balls[0]] >= 0).any():
        headings = headings[fan.cushions_before_hit[:, balls[0]] >= 0]
    count = _ROUND
    while shots > 0:
        count = min(count, shots)
        near = rng.choice(headings, count) + rng.normal(0.0, 2.0 * np.pi / _FAN, count)
        angles = np.where(rng.uniform(size=count) < 0.75, near, rng.uniform(-np.pi, np.pi, count))
        speeds = problem.table.max_speed * rng.uniform(_LEAST_SPEED, 1.0, count)
        yield speeds[:, None] * np.column_stack((np.cos(angles), np.sin(angles)))
        shots, count = shots - count, _GROWTH * count


def _pots(problem: _Problem, goal: Pot) -> Floats:
    """Returns velocities (k, 2) near the pots of a goal, at many speeds and with small turns."""
    legal = np.arange(problem.table.scene.n_balls) == goal.ball
    pots = find_pots(problem.table._replace(legal=legal[None]), banks=True, direct=not isinstance(goal, Bank))
    chosen = np.flatnonzero((goal.pocket is None) | (pots.pocket[0, : pots.count[0]] == goal.pocket))[:_POTS]
    velocities = []
    for shots, tolerance in zip(pots.shots[0, chosen], pots.rows[0, chosen, TOLERANCE], strict=True):
        known = shots[shots[:, SPEED] > 0]
        speeds = np.interp(_SPEEDS, (0.0, 1.0), (known[0, SPEED], known[-1, SPEED]))
        directions = np.arctan2(known[:, 1], known[:, 0])
        headings = np.interp(speeds, known[:, SPEED], np.unwrap(directions))
        angles = headings[:, None] + tolerance * _TURNS
        velocities.append((speeds[:, None, None] * np.stack((np.cos(angles), np.sin(angles)), axis=-1)).reshape(-1, 2))
    return np.concatenate((*velocities, np.empty((0, 2))))


def _hits(problem: _Problem, ball: int) -> Floats:
    """Returns velocities (k, 2) of straight hits of a ball, at many speeds and with all cuts."""
    (places,), radius = problem.table.positions, problem.table.scene.balls.radius
    to = places[ball] - places[CUE_BALL]
    widest = np.arcsin(min(1.0, (radius[CUE_BALL] + radius[ball]) / np.hypot(*to)))
    angles = np.arctan2(to[1], to[0]) + 0.98 * widest * np.linspace(-1.0, 1.0, 41)[:, None]
    speeds = problem.table.max_speed * np.linspace(_LEAST_SPEED, 1.0, 12)
    return np.stack((speeds * np.cos(angles), speeds * np.sin(angles)), axis=-1).reshape(-1, 2)


def _met(problem: _Problem, batch: BatchResult) -> Bools:
    """Returns whether shots reach the goals, (m, g); a `Leave` is always met."""
    met = np.ones((len(batch), len(problem.goals)), bool)
    pockets = problem.table.scene.table.pocket_places
    for g, goal in enumerate(problem.goals):
        if isinstance(goal, Pot):
            met[:, g] = batch.potted[:, goal.ball]
            if goal.pocket is not None:  # a potted ball is at the centre of its pocket
                met[:, g] &= (batch.positions[:, goal.ball] == pockets[goal.pocket]).all(axis=1)
            if isinstance(goal, Bank):
                met[:, g] &= batch.cushions[:, goal.ball] > 0
        elif isinstance(goal, Touch):
            met[:, g] = batch.cushions_before_hit[:, goal.ball] >= 0
        elif isinstance(goal, FirstTouch):
            met[:, g] = batch.first_hit == goal.ball
        elif isinstance(goal, Cushions):
            counts = batch.cushions[:, CUE_BALL]
            met[:, g] = (counts if goal.before is None else batch.cushions_before_hit[:, goal.before]) >= goal.least
    return met


def _leaves(problem: _Problem) -> list[Leave]:
    return [goal for goal in problem.goals if isinstance(goal, Leave)]


def _try(problem: _Problem, velocities: Floats) -> _Tried:
    """Simulates shots."""
    batch = _run(problem, velocities)
    missed = (~_met(problem, batch)).sum(axis=1) + batch.potted[:, CUE_BALL]
    square, solved = np.zeros(len(batch)), missed == 0
    for leave in _leaves(problem):
        distance = np.hypot(*(batch.positions[:, leave.ball] - leave.position).T)
        square += distance**2
        solved &= (distance <= leave.radius) & ~batch.potted[:, leave.ball]
    return _Tried(velocities, missed, np.sqrt(square), solved)


def _solve(problem: _Problem, tried: _Tried) -> _Tried:
    """Returns the shots after Newton's method. It ends if a shot reaches the goals exactly."""
    active = np.ones(len(tried.missed), bool)
    for _ in range(_STEPS):
        active &= (tried.missed > 0) | (tried.off > _EXACT)
        if (not active.all() and ((tried.missed == 0) & (tried.off <= _EXACT)).any()) or not active.any():
            break
        which = np.flatnonzero(active)
        velocities, missed = tried.velocities[which], tried.missed[which]
        steps = np.zeros_like(velocities)
        for rows, derive in ((missed == 0, _leave_rows), (missed > 0, _margin_rows)):
            if rows.any():
                steps[rows] = _steps(*derive(problem, _run(problem, velocities[rows], record=True)))
        speeds = np.hypot(*velocities.T)
        steps = _shorten(steps, _LONGEST * speeds)
        moved = (velocities[:, None] + _SHARES[:, None] * steps[:, None]).reshape(-1, 2)
        after = _try(problem, _shorten(moved, problem.table.max_speed))
        ranks = np.where(after.missed == 0, after.off, 1e6 * after.missed).reshape(len(which), -1)
        best = ranks.argmin(axis=1)
        best += len(_SHARES) * np.arange(len(which))
        improves = (missed > 0) | ((after.missed[best] == 0) & (after.off[best] < _GAIN * tried.off[which]))
        improves &= np.hypot(*steps.T) > _LEAST_STEP * speeds
        active[which[~improves]] = False
        for array, new in zip(tried, after, strict=True):
            array[which[improves]] = new[best[improves]]
    return tried


def _shorten(vectors: Floats, longest: Floats | float) -> Floats:
    """Returns vectors (m, 2) that are not longer than `longest`."""
    return vectors * np.minimum(1.0, longest / np.maximum(np.hypot(*vectors.T), 1e-300))[:, None]


def _steps(rows: Floats, residuals: Floats) -> Floats:
    """Returns the Gauss-Newton steps (m, 2) for residuals (m, r) and their derivatives (m, r, 2)."""
    normal = np.einsum("mri,mrj->mij", rows, rows)
    normal += (1e-14 * np.trace(normal, axis1=1, axis2=2) + 1e-30)[:, None, None] * np.eye(2)
    return -np.linalg.solve(normal, np.einsum("mri,mr->mi", rows, residuals)[..., None])[..., 0]


def _leave_rows(problem: _Problem, batch: BatchResult) -> tuple[Floats, Floats]:
    """Returns the derivatives (m, r, 2) and the residuals (m, r) of the places of the balls at rest."""
    by = rest_by_cue_ball(batch)
    balls = [leave.ball for leave in _leaves(problem)]
    residuals = batch.positions[:, balls] - [leave.position for leave in _leaves(problem)]
    return np.moveaxis(by[:, :, balls], 1, 3).reshape(len(batch), -1, 2), residuals.reshape(len(batch), -1)


def _selected_margins(problem: _Problem) -> Bools:
    """Returns the margins (n, q) that the goals need, see `margins_by_cue_ball`."""
    scene = problem.table.scene
    n, pockets = scene.n_balls, len(scene.table.pockets)
    selected = np.zeros((n, margin_columns(scene)["cushion_margins"].stop), bool)
    for goal in problem.goals:
        if isinstance(goal, Pot):
            selected[goal.ball, n : n + pockets] = True if goal.pocket is None else np.arange(pockets) == goal.pocket
        elif isinstance(goal, Touch | FirstTouch):
            selected[CUE_BALL, 1:n] = True
    return selected


def _margins(problem: _Problem, batch: BatchResult) -> tuple[Floats, Floats]:
    """Returns the margins (m, g) of the pots and touches of shots and their derivatives (m, g, 2).

    A shot that first touches another ball has the margin by which it must miss this ball.
    """
    shots, n = np.arange(len(batch)), problem.table.scene.n_balls
    values, slopes = margins_by_cue_ball(batch, _selected_margins(problem))
    margins, by = np.full((len(batch), len(problem.goals)), np.inf), np.zeros((len(batch), len(problem.goals), 2))
    for g, goal in enumerate(problem.goals):
        if not isinstance(goal, Pot | Touch | FirstTouch):
            continue
        ball, body, sign = CUE_BALL, np.full(len(batch), goal.ball), np.ones(len(batch))
        if isinstance(goal, Pot):
            ball, body = (
                goal.ball,
                n + values[:, goal.ball, n : n + len(problem.table.scene.table.pockets)].argmax(axis=1),
            )
        elif isinstance(goal, FirstTouch):
            wrong = (batch.first_hit > 0) & (batch.first_hit != goal.ball)
            body, sign = np.where(wrong, batch.first_hit, body), np.where(wrong, -1.0, 1.0)
        margins[:, g] = sign * values[shots, ball, body]
        by[:, g] = sign[:, None] * slopes[shots, :, ball, body]
    return margins, by


def _margin_rows(problem: _Problem, batch: BatchResult) -> tuple[Floats, Floats]:
    """Returns the derivatives and the residuals of the margins of missed pots and touches."""
    margins, by = _margins(problem, batch)
    missed = (margins < _CLEAR) & np.isfinite(margins)
    return np.where(missed[..., None], by, 0.0), np.where(missed, margins - _CLEAR, 0.0)


def _room(problem: _Problem, tried: _Tried) -> Floats:
    """Returns the least margin of the pots and touches of shots that reach the goals, if no `Leave` decides."""
    room, solved = np.zeros(len(tried.missed)), np.flatnonzero(tried.solved)
    if _leaves(problem) or not len(solved):
        return room
    margins, _ = _margins(problem, _run(problem, tried.velocities[solved], record=True))
    room[solved] = margins.min(axis=1)
    return room
