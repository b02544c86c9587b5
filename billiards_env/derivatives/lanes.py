"""How a small change of the balls passes through a stretch or an event.

A lane is a row of numbers: one direction of change of one or two balls, and of the constants of the scene. Each
function `*_lane` below changes a lane in place. `derivatives.tangent` makes the derivatives of the laws from their
sources. The change of the time of an event, which is an implicit function, is written here by hand.

The state of a ball in a lane is a `BallState` at a fixed time. An event changes it by the saltation matrix (Aizerman
and Gantmakher 1958; Leine and Nijmeijer 2004, section 7.5): the change is propagated to the time of the changed event,
through the derivative of the jump there, and back to the fixed time.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from typing import Any, NamedTuple

from billiards_env.derivatives.rules import SMOOTH
from billiards_env.derivatives.tangent import rule, tangent_of
from billiards_env.jit import entry_point, inlined
from billiards_env.physics.ball_ball import impulse_of, meet
from billiards_env.physics.ball_cushion import bounce, impact
from billiards_env.physics.geometry.pockets import outwards_at
from billiards_env.physics.geometry.walls import curvature_at, normal_at
from billiards_env.physics.laws.balls import distance_of, normal_impulse
from billiards_env.physics.laws.cloth import SLIP_RATE, coast_from, drive, slip_of, spin_after, spin_of
from billiards_env.physics.laws.cushion import CushionMotion, restitution_is_smooth
from billiards_env.physics.laws.tables import CUSHION_LAWS, CUSHIONS, FRICTIONS, RESTITUTIONS, by_law, friction_of
from billiards_env.physics.state import (
    BALL_NUMBERS,
    CLOTH_NUMBERS,
    IDEAL,
    LAW_NUMBERS,
    POTTED,
    REST,
    ROLLING,
    SLIDING,
    SLIDING_AND_ROLLING,
    SPINNING,
    BallState,
    law_changes,
)
from billiards_env.physics.strike import ELEVATION, HEADING, SIDE, SPEED, TOP, CueNumbers, strike_by

# Columns of a lane: the state of the first ball, and that of the second.
DX, DY, DVX, DVY, DUX, DUY, DWZ = range(7)
BALL_WIDTH = 7
D_TIME, D_PLACE_X, D_PLACE_Y = 14, 15, 16  # results: time, s, and place, m
D_RADIUS = 17  # of both balls
D_INV_MASS = 19
D_NUMBERS = 21  # `LAW_NUMBERS`
LANE_WIDTH = D_NUMBERS + len(LAW_NUMBERS)

STRETCH_NUMBERS = (D_NUMBERS, D_NUMBERS + len(CLOTH_NUMBERS))
"""The columns of the numbers of a stretch: the first and one past the last."""
PAIR_NUMBERS = (STRETCH_NUMBERS[1], STRETCH_NUMBERS[1] + len(BALL_NUMBERS))
"""The same for an impact of two balls."""
CUSHION_NUMBERS = (PAIR_NUMBERS[1], LANE_WIDTH)
"""The same for a cushion."""

ONLY_STATES, ALSO_CONSTANTS = ((None, True),), ((True, None),)
"""The argument `changing` of the kernels below: whether radii, masses and numbers change, or only the states of balls.

For each value numba compiles only the tangents that it needs, see `by_law`. Those of the states alone have fewer
operations.
"""


def _tangent(function: Callable[..., Any], constant: Collection[str], constants: Collection[str]) -> Callable[..., Any]:
    """Returns the tangent of a law as a kernel of `changing` and a tuple with the arguments of the tangent.

    `constants` names the last arguments of the law. With `ONLY_STATES` their changes are left out.
    """
    states, kept = tangent_of(function, constant=(*constant, *constants)), -len(constants)
    return by_law(tangent_of(function, constant=constant), inlined(lambda *arguments: states(*arguments[:kept])))


_OTHERS = ("radius", "rebound", "numbers", "solution")
_d_law = by_law(*(tangent_of(law, constant=("rebound", "solution")) for law in CUSHION_LAWS))
_d_law_of_states = by_law(*(tangent_of(law, constant=_OTHERS) for law in CUSHION_LAWS))


@rule(impact, constant=("laws",))
@inlined
def d_impact(laws, before, others, d_before, d_others):
    """Returns the result of `ball_cushion.impact` and its change."""
    d_radius, _, d_numbers, _ = d_others
    return _d_law(laws, (before,) + others + (d_before, d_radius, d_numbers))  # noqa: RUF005  (numba has no stars here)


@rule(impact, constant=("laws", "others"))
@inlined
def _d_impact_of_states(laws, before, others, d_before):
    return _d_law_of_states(laws, (before,) + others + (d_before,))  # noqa: RUF005


def _impulse_by(restitution: Callable[..., Any]) -> Callable[..., Any]:
    """Returns `ball_ball.impulse_of` with a restitution, as the source of its tangent."""

    def impulse(closing, inv_mass_i, inv_mass_j, numbers):
        return normal_impulse(closing, inv_mass_i, inv_mass_j, restitution(numbers, closing))

    return inlined(impulse)


def _rule_by_law(function: Callable[..., Any], kernels: Collection[Any], law: str, constant: Collection[str]) -> None:
    """Makes the tangents of kernels, one for each law, that of a function of the argument `law` and their arguments."""

    def call(tangent: Any) -> Any:
        return inlined(lambda choice, *arguments: tangent(choice, arguments))

    for kept in ((), constant):
        tangents = (tangent_of(kernel, constant=kept) for kernel in kernels)
        rule(function, constant=(law, *kept))(call(by_law(*tangents)))


_IMPULSES = tuple(map(_impulse_by, RESTITUTIONS))
_rule_by_law(impulse_of, _IMPULSES, "ball_restitution", ("inv_mass_i", "inv_mass_j", "numbers"))
_rule_by_law(friction_of, FRICTIONS, "law", ("numbers",))

_d_drive = _tangent(drive, ("phase",), ("numbers",))
_d_coast = _tangent(coast_from, ("phase", "t"), ("numbers",))
_d_spin_after = tangent_of(spin_after, constant=("t", "numbers"))
_d_slip_of, _d_spin_of = _tangent(slip_of, (), ("radius",)), _tangent(spin_of, (), ("radius",))
_d_distance_of = _tangent(distance_of, ("are_spheres",), ("radius_i", "radius_j"))
_d_meet = _tangent(meet, ("ball_restitution", "ball_friction", "are_spheres"), ("bodies", "numbers"))
_d_bounce = _tangent(bounce, ("cushion", "solution"), ("radius", "numbers"))


@inlined
def _no_solution(before, radius, numbers):
    return 0.0


@inlined
def _always_smooth(before, radius, numbers):
    return True


_SOLUTIONS = {cushion.law: cushion.solution or _no_solution for cushion in CUSHIONS.values()}
_solution = by_law(*(_SOLUTIONS[law] for law in CUSHION_LAWS))
_is_smooth = by_law(*(SMOOTH.get(law, _always_smooth) for law in CUSHION_LAWS))


@inlined
def ball_at(values, at):
    """Returns the `BallState` that begins at column `at` of a row of numbers."""
    return BallState(
        x=values[at + DX],
        y=values[at + DY],
        vx=values[at + DVX],
        vy=values[at + DVY],
        ux=values[at + DUX],
        uy=values[at + DUY],
        wz=values[at + DWZ],
    )


@inlined
def put_ball(values, at, ball):  # out: values
    """Writes a `BallState` to a row of numbers; see `ball_at`."""
    values[at + DX], values[at + DY], values[at + DVX], values[at + DVY] = ball.x, ball.y, ball.vx, ball.vy
    values[at + DUX], values[at + DUY], values[at + DWZ] = ball.ux, ball.uy, ball.wz


@inlined
def _changes(lane):
    """Returns the change of the `LawNumbers` of a lane."""
    return law_changes(lane[D_NUMBERS:LANE_WIDTH])


@inlined
def distance_change(lane, are_spheres, radii, changing):
    """Returns the change of the distance of the centres of both balls of a lane when they touch, m."""
    return _d_distance_of(changing, (are_spheres, radii[0], radii[1], lane[D_RADIUS], lane[D_RADIUS + 1]))[1]


class Stretch(NamedTuple):
    """The motion of a ball on a piece of its path, until a time.

    Attributes:
        ball: The `BallState` at the start.
        phase: The phase.
        dt: Duration, s.
        numbers: The `LawNumbers`.
    """

    ball: Any
    phase: Any
    dt: Any
    numbers: Any


@inlined
def stretch_lane(lane, at, stretch, changing):  # out: lane
    """Changes the state at column `at` of a lane by a `Stretch`."""
    ball, phase, dt, numbers = stretch
    put_ball(lane, at, _d_coast(changing, (ball, phase, dt, numbers, ball_at(lane, at), _changes(lane)))[1])


@inlined
def spin_factor(stretch):
    """Returns the derivative of the spin about the vertical axis after a `Stretch` with respect to that before."""
    return _d_spin_after(stretch.ball.wz, stretch.dt, stretch.numbers, 1.0)[1]


@inlined
def rates_of(ball, phase, acceleration, numbers):
    """Returns the time derivative of a `BallState` in a phase with an acceleration (x, y), m/s^2."""
    turns, (ax, ay) = SLIP_RATE if phase == SLIDING else 0.0, acceleration
    spin = -math.copysign(numbers.spin_decay, ball.wz) if ball.wz != 0.0 else 0.0
    return BallState(x=ball.vx, y=ball.vy, vx=ax, vy=ay, ux=turns * ax, uy=turns * ay, wz=spin)


@inlined
def _shifted(change, rates, dt):
    """Returns the change of a `BallState` at a time that is a small time dt later."""
    return BallState(
        x=change.x + rates.x * dt,
        y=change.y + rates.y * dt,
        vx=change.vx + rates.vx * dt,
        vy=change.vy + rates.vy * dt,
        ux=change.ux + rates.ux * dt,
        uy=change.uy + rates.uy * dt,
        wz=change.wz + rates.wz * dt,
    )


@inlined
def settle_lane(lane, at, phase, numbers):  # out: lane
    """Sets the parts of a state to zero that a phase does not have.

    Friction ends a small velocity, slip or spin at once; it leaves no displacement of first order. A small slip of a
    rolling ball takes 2/7 of it from the velocity.
    """
    if phase == POTTED:
        for c in range(BALL_WIDTH):
            lane[at + c] = 0.0
    if numbers.motion == IDEAL:
        return
    if phase == ROLLING:
        lane[at + DVX] -= lane[at + DUX] * (1.0 / SLIP_RATE)
        lane[at + DVY] -= lane[at + DUY] * (1.0 / SLIP_RATE)
    if phase <= SPINNING:
        lane[at + DVX] = lane[at + DVY] = 0.0
    if phase <= ROLLING:
        lane[at + DUX] = lane[at + DUY] = 0.0
    if phase == REST:
        lane[at + DWZ] = 0.0


@inlined
def start_lane(lane, ball, phase, radius, numbers, changing):  # out: lane
    """Replaces the horizontal spin of the first ball of a lane by its slip, and settles it.

    Args:
        lane: The lane, with the spins along x and y in the columns of the slip.
        ball: The ball's `BallState`.
        phase: Its phase.
        radius: m.
        numbers: The `LawNumbers`.
        changing: What changes.
    """
    change = ball_at(lane, 0)
    lane[DUX] = lane[DUY] = 0.0
    if numbers.motion == SLIDING_AND_ROLLING:
        wx, wy = spin_of(ball.vx, ball.vy, ball.ux, ball.uy, radius)
        at = (ball.vx, ball.vy, wx, wy, radius, change.vx, change.vy, change.ux, change.uy, lane[D_RADIUS])
        lane[DUX], lane[DUY] = _d_slip_of(changing, at)[1]
    settle_lane(lane, 0, phase, numbers)


@inlined
def end_lane(lane, ball, radius, numbers, changing):  # out: lane
    """Replaces the slip of the first ball of a lane, in a `BallState`, by its horizontal spin; see `start_lane`."""
    change = ball_at(lane, 0)
    lane[DUX] = lane[DUY] = 0.0
    if numbers.motion == SLIDING_AND_ROLLING:
        at = (ball.vx, ball.vy, ball.ux, ball.uy, radius, change.vx, change.vy, change.ux, change.uy, lane[D_RADIUS])
        lane[DUX], lane[DUY] = _d_spin_of(changing, at)[1]


@inlined
def _note(lane, dt, change):  # out: lane
    """Stores the results of an event: the change of its time and of the place of its ball then."""
    lane[D_TIME], lane[D_PLACE_X], lane[D_PLACE_Y] = dt, change.x, change.y


@inlined
def phase_end_lane(lane, stretch, before, after, changing):  # out: lane
    """Changes a lane by a `Stretch` and the event at the end of its phase.

    Args:
        lane: The lane.
        stretch: The `Stretch`.
        before: The time derivative of the state before the event.
        after: The same after it.
        changing: What changes.
    """
    ball, phase, _, numbers = stretch
    dt = _d_drive(changing, (ball, phase, numbers, ball_at(lane, 0), _changes(lane)))[1][2]
    stretch_lane(lane, 0, stretch, changing)
    change = _shifted(ball_at(lane, 0), before, dt)
    _note(lane, dt, change)
    put_ball(lane, 0, _shifted(change, after, -dt))


@inlined
def pocket_lane(lane, ball, pocket):  # out: lane
    """Changes a lane by a pocket. The ball ends at the pocket's centre, wherever it enters."""
    dx, dy = outwards_at(pocket, ball.x, ball.y)
    speed = dx * ball.vx + dy * ball.vy
    lane[D_TIME] = -(dx * lane[DX] + dy * lane[DY]) / speed if speed != 0.0 else 0.0
    lane[D_PLACE_X] = lane[D_PLACE_Y] = 0.0


class Jump(NamedTuple):
    """A ball in an impact.

    Attributes:
        ball: Its `BallState` before the impact.
        before: The time derivative of its state before.
        after: The same after.
        radius: m.
        inv_mass: 1/kg.
    """

    ball: Any
    before: Any
    after: Any
    radius: Any
    inv_mass: Any


class Wall(NamedTuple):
    """A cushion at the place where a ball touches it.

    Attributes:
        nx: Unit normal into the cushion along x.
        ny: The same along y.
        curvature: Curvature of the line of the touching centres, 1/m; 0 for a straight cushion.
    """

    nx: Any
    ny: Any
    curvature: Any


@inlined
def wall_at(x, y, wall, radius, outline):
    """Returns the `Wall` with a number where a ball at (x, y) touches it."""
    nx, ny = normal_at(x, y, wall, outline)
    return Wall(nx, ny, curvature_at(wall, radius, outline))


@inlined
def _motion_at(ball, wall, radius):
    """Returns the `CushionMotion` of a `BallState` at a `Wall`."""
    nx, ny = wall.nx, wall.ny
    return CushionMotion(
        max(nx * ball.vx + ny * ball.vy, 0.0),
        nx * ball.vy - ny * ball.vx,
        nx * ball.ux + ny * ball.uy,
        nx * ball.uy - ny * ball.ux,
        radius * ball.wz,
    )


@inlined
def cushion_is_smooth(ball, wall, radius, scene):
    """Returns whether the impact of a `BallState` on a `Wall` has a derivative."""
    motion, numbers = _motion_at(ball, wall, radius), scene.numbers
    return restitution_is_smooth(motion.vn, numbers) and _is_smooth(scene.cushion, (motion, radius, numbers))


@inlined
def cushion_solution(ball, wall, radius, scene):
    """Returns the solution of the equation of the cushions' law, see `cushion_han2005.han2005`."""
    return _solution(scene.cushion, (_motion_at(ball, wall, radius), radius, scene.numbers))


@inlined
def wall_lane(lane, wall, jump, cushion, numbers, solution, changing):  # out: lane
    """Changes a lane by an impact on a cushion.

    Args:
        lane: The lane.
        wall: The `Wall`.
        jump: The `Jump`.
        cushion: `SceneArrays.cushion`.
        numbers: The `LawNumbers`.
        solution: The result of `cushion_solution`.
        changing: What changes.
    """
    nx, ny, ball, d_radius = wall.nx, wall.ny, jump.ball, lane[D_RADIUS]
    speed = nx * ball.vx + ny * ball.vy
    dt = -(nx * lane[DX] + ny * lane[DY] + d_radius) * (1.0 / speed) if speed != 0.0 else 0.0
    change = _shifted(ball_at(lane, 0), jump.before, dt)
    _note(lane, dt, change)
    turn = -wall.curvature * (nx * change.y - ny * change.x)  # at a tip the normal turns with the point of contact
    d_n = (-ny * turn, nx * turn)
    at = (ball, (nx, ny), jump.radius, cushion, numbers, solution, change, d_n, d_radius, _changes(lane))
    change = _d_bounce(changing, at)[1]
    put_ball(lane, 0, _shifted(change, jump.after, -dt))


@inlined
def pair_lane(lane, one, two, are_spheres, laws, numbers, changing):  # out: lane
    """Changes a lane by the impact of its two balls.

    Args:
        lane: The lane.
        one: The `Jump` of the first ball.
        two: That of the second.
        are_spheres: Whether the balls are spheres.
        laws: `SceneArrays.ball_restitution` and `SceneArrays.ball_friction`.
        numbers: The `LawNumbers`.
        changing: What changes.
    """
    a, b, d_a, d_b = one.ball, two.ball, ball_at(lane, 0), ball_at(lane, BALL_WIDTH)
    bodies = (one.radius, two.radius, one.inv_mass, two.inv_mass)
    d_bodies = (lane[D_RADIUS], lane[D_RADIUS + 1], lane[D_INV_MASS], lane[D_INV_MASS + 1])
    dx, dy = b.x - a.x, b.y - a.y
    closing = dx * (b.vx - a.vx) + dy * (b.vy - a.vy)
    late = distance_change(lane, are_spheres, bodies, changing) * math.sqrt(dx * dx + dy * dy)
    late -= dx * (d_b.x - d_a.x) + dy * (d_b.y - d_a.y)
    dt = late * (1.0 / closing) if closing != 0.0 else 0.0
    d_a, d_b = _shifted(d_a, one.before, dt), _shifted(d_b, two.before, dt)
    _note(lane, dt, d_a)
    restitution, friction = laws
    at = (restitution, friction, are_spheres, a, b, bodies, numbers, d_a, d_b, d_bodies, _changes(lane))
    d_a, d_b = _d_meet(changing, at)[1]
    put_ball(lane, 0, _shifted(d_a, one.after, -dt))
    put_ball(lane, BALL_WIDTH, _shifted(d_b, two.after, -dt))


_d_strike_by = tangent_of(strike_by, constant=("cue",))


@entry_point
def strike_jacobians(cue, parameters, jacobians, states):  # out: jacobians, states
    """Computes the derivatives of many strikes by their parameters.

    Args:
        cue: `CueNumbers`, as a plain tuple.
        parameters: (m, 5) float64, see `strike.many_strikes`.
        jacobians: (m, 5, 5) float64 out: of component i of (vx, vy, wx, wy, wz) by parameter j.
        states: (m, 5) float64 out: (vx, vy, wx, wy, wz), m/s and rad/s.
    """
    cue = CueNumbers(*cue)
    for k in range(len(parameters)):
        p = parameters[k]
        at = (p[SPEED], p[HEADING], p[SIDE], p[TOP], p[ELEVATION])
        for j in range(5):
            unit = (
                1.0 if j == SPEED else 0.0,
                1.0 if j == HEADING else 0.0,
                1.0 if j == SIDE else 0.0,
                1.0 if j == TOP else 0.0,
                1.0 if j == ELEVATION else 0.0,
            )
            after, change = _d_strike_by(cue, *at, *unit)
            for c in range(5):
                states[k, c], jacobians[k, c, j] = after[:5][c], change[:5][c]
