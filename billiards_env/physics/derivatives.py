"""How a small change of the balls passes through a flight or an event.

A lane is a row of numbers: one direction of change of one or two balls, and of the constants of the scene. Each
function `*_lane` below changes a lane in place. `physics.tangent` makes the derivatives of the laws from their
sources. The change of the time of an event, which is an implicit function, is written here by hand.

The state of a ball in a lane is a `BallState` at a fixed time. An event changes it by the saltation matrix (Aizerman
and Gantmakher 1958; Leine and Nijmeijer 2004, section 7.5): the change is propagated to the time of the changed event,
through the derivative of the jump there, and back to the fixed time.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from billiards_env.jit import entry_point, inlined, kernel
from billiards_env.physics.cushion import CUSHIONS, LAWS, bounce, by_law, impact
from billiards_env.physics.elementary import norm
from billiards_env.physics.geometry.walls import NX, NY, TIP_RADIUS, TIP_X, TIP_Y
from billiards_env.physics.laws.balls import distance_of, meet, push_ball
from billiards_env.physics.laws.cloth import SLIP_RATE, drive, fly, slip_of, spin_of
from billiards_env.physics.laws.cushion import CushionMotion
from billiards_env.physics.rules import SMOOTH
from billiards_env.physics.state import (
    BALL_NUMBERS,
    CLOTH_NUMBERS,
    IDEAL,
    LAW_NUMBERS,
    POCKET_X,
    POCKET_Y,
    POTTED,
    REST,
    ROLLING,
    SLIDING,
    SLIDING_AND_ROLLING,
    SPINNING,
    BallState,
    law_changes,
)
from billiards_env.physics.strike import (
    ELEVATION,
    HEADING,
    SIDE,
    SPEED,
    TOP,
    CueNumbers,
    impulse_gain,
    speed_gain,
    squirt,
    strike_by,
    struck,
)
from billiards_env.physics.tangent import rule, tangent_of

# Columns of a lane: the state of the first ball, and that of the second.
DX, DY, DVX, DVY, DUX, DUY, DWZ = range(7)
BALL_WIDTH = 7
D_RADIUS = 14  # of both balls
D_INV_MASS = 16
D_NUMBERS = 18  # `LAW_NUMBERS`
END_NUMBERS = D_NUMBERS + len(LAW_NUMBERS)
D_TIME, D_PLACE_X, D_PLACE_Y, LANE_WIDTH = range(END_NUMBERS, END_NUMBERS + 4)  # results: time, s, and place, m

FLIGHT_NUMBERS = (D_NUMBERS, D_NUMBERS + len(CLOTH_NUMBERS))
"""The columns of the numbers of a flight: the first and one past the last."""
PAIR_NUMBERS = (FLIGHT_NUMBERS[1], FLIGHT_NUMBERS[1] + len(BALL_NUMBERS))
"""The same for an impact of two balls."""
CUSHION_NUMBERS = (PAIR_NUMBERS[1], END_NUMBERS)
"""The same for a cushion."""

_d_law = by_law(*(tangent_of(law, constant=("rebound", "solution")) for law in LAWS))


@rule(impact, constant=("laws",))
@inlined
def d_impact(laws, arguments, d_arguments):
    """Returns the result of `cushion.impact` and its change."""
    d_before, d_radius, _, d_numbers, _ = d_arguments
    return _d_law(laws, arguments + (d_before, d_radius, d_numbers))  # noqa: RUF005  (numba has no stars here)


tangent_of(push_ball, constant=("motion",))
_d_drive, _d_fly = tangent_of(drive, constant=("phase",)), tangent_of(fly, constant=("phase", "t"))
_d_slip_of, _d_spin_of = tangent_of(slip_of), tangent_of(spin_of)
d_distance_of = tangent_of(distance_of, constant=("are_spheres",))
_d_meet = tangent_of(meet, constant=("ball_friction", "are_spheres"))
_d_bounce = tangent_of(bounce, constant=("cushion", "solution"))


@inlined
def _no_solution(before, radius, numbers):
    return 0.0


@inlined
def _always_smooth(before, radius, numbers):
    return True


_SOLUTIONS = {cushion.law: cushion.solution or _no_solution for cushion in CUSHIONS.values()}
_solution = by_law(*(_SOLUTIONS[law] for law in LAWS))
_is_smooth = by_law(*(SMOOTH.get(law, _always_smooth) for law in LAWS))


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
    return law_changes(lane[D_NUMBERS:END_NUMBERS])


class Flight(NamedTuple):
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
def flight_lane(lane, at, flight):  # out: lane
    """Changes the state at column `at` of a lane by a `Flight`."""
    ball, phase, dt, numbers = flight
    put_ball(lane, at, _d_fly(ball, phase, dt, numbers, ball_at(lane, at), _changes(lane))[1])


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
def start_lane(lane, ball, phase, radius, numbers):  # out: lane
    """Replaces the horizontal spin of the first ball of a lane by its slip, and settles it.

    Args:
        lane: The lane, with the spins along x and y in the columns of the slip.
        ball: The ball's `BallState`.
        phase: Its phase.
        radius: m.
        numbers: The `LawNumbers`.
    """
    change = ball_at(lane, 0)
    lane[DUX] = lane[DUY] = 0.0
    if numbers.motion == SLIDING_AND_ROLLING:
        wx, wy = spin_of(ball.vx, ball.vy, ball.ux, ball.uy, radius)
        at, d_at = (ball.vx, ball.vy, wx, wy), (change.vx, change.vy, change.ux, change.uy)
        lane[DUX], lane[DUY] = _d_slip_of(*at, radius, *d_at, lane[D_RADIUS])[1]
    settle_lane(lane, 0, phase, numbers)


@inlined
def end_lane(lane, ball, radius, numbers):  # out: lane
    """Replaces the slip of the first ball of a lane, in a `BallState`, by its horizontal spin; see `start_lane`."""
    change = ball_at(lane, 0)
    lane[DUX] = lane[DUY] = 0.0
    if numbers.motion == SLIDING_AND_ROLLING:
        at, d_at = (ball.vx, ball.vy, ball.ux, ball.uy), (change.vx, change.vy, change.ux, change.uy)
        lane[DUX], lane[DUY] = _d_spin_of(*at, radius, *d_at, lane[D_RADIUS])[1]


@inlined
def _note(lane, dt, change):  # out: lane
    """Stores the results of an event: the change of its time and of the place of its ball then."""
    lane[D_TIME], lane[D_PLACE_X], lane[D_PLACE_Y] = dt, change.x, change.y


@inlined
def phase_end_lane(lane, flight, before, after):  # out: lane
    """Changes a lane by a `Flight` and the event at the end of its phase.

    Args:
        lane: The lane.
        flight: The `Flight`.
        before: The time derivative of the state before the event.
        after: The same after it.
    """
    ball, phase, _, numbers = flight
    dt = _d_drive(ball, phase, numbers, ball_at(lane, 0), _changes(lane))[1][2]
    flight_lane(lane, 0, flight)
    change = _shifted(ball_at(lane, 0), before, dt)
    _note(lane, dt, change)
    put_ball(lane, 0, _shifted(change, after, -dt))


@inlined
def pocket_lane(lane, ball, pocket):  # out: lane
    """Changes a lane by a pocket. The ball ends at the pocket's centre, wherever it enters."""
    dx, dy = ball.x - pocket[POCKET_X], ball.y - pocket[POCKET_Y]
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
    if outline is None:
        sign = 1.0 if wall % 2 else -1.0
        return Wall(sign, 0.0, 0.0) if wall < 2 else Wall(0.0, sign, 0.0)
    return _outline_wall(x, y, wall, radius, outline)


@kernel
def _outline_wall(x, y, wall, radius, outline):
    """Implements `wall_at` for an outline."""
    lines, tips = outline.lines, outline.tips
    if wall < len(lines):
        return Wall(lines[wall, NX], lines[wall, NY], 0.0)
    tip = tips[wall - len(lines)]
    dx, dy = tip[TIP_X] - x, tip[TIP_Y] - y
    distance = norm(dx, dy)
    return Wall(dx / distance, dy / distance, 1.0 / (radius + tip[TIP_RADIUS]))


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
    return _is_smooth(scene.cushion, (_motion_at(ball, wall, radius), radius, scene.numbers))


@inlined
def cushion_solution(ball, wall, radius, scene):
    """Returns the solution of the equation of the cushions' law, see `cushion_han2005.han2005`."""
    return _solution(scene.cushion, (_motion_at(ball, wall, radius), radius, scene.numbers))


@inlined
def wall_lane(lane, wall, jump, cushion, numbers, solution):  # out: lane
    """Changes a lane by an impact on a cushion.

    Args:
        lane: The lane.
        wall: The `Wall`.
        jump: The `Jump`.
        cushion: `SceneArrays.cushion`.
        numbers: The `LawNumbers`.
        solution: The result of `cushion_solution`.
    """
    nx, ny, ball, d_radius = wall.nx, wall.ny, jump.ball, lane[D_RADIUS]
    speed = nx * ball.vx + ny * ball.vy
    dt = -(nx * lane[DX] + ny * lane[DY] + d_radius) * (1.0 / speed) if speed != 0.0 else 0.0
    change = _shifted(ball_at(lane, 0), jump.before, dt)
    _note(lane, dt, change)
    turn = -wall.curvature * (nx * change.y - ny * change.x)  # at a tip the normal turns with the point of contact
    d_n = (-ny * turn, nx * turn)
    at, d_at = (ball, (nx, ny), jump.radius), (change, d_n, d_radius)
    change = _d_bounce(*at, cushion, numbers, solution, *d_at, _changes(lane))[1]
    put_ball(lane, 0, _shifted(change, jump.after, -dt))


@inlined
def pair_lane(lane, one, two, are_spheres, ball_friction, numbers):  # out: lane
    """Changes a lane by the impact of its two balls.

    Args:
        lane: The lane.
        one: The `Jump` of the first ball.
        two: That of the second.
        are_spheres: Whether the balls are spheres.
        ball_friction: `SceneArrays.ball_friction`.
        numbers: The `LawNumbers`.
    """
    a, b, d_a, d_b = one.ball, two.ball, ball_at(lane, 0), ball_at(lane, BALL_WIDTH)
    bodies = (one.radius, two.radius, one.inv_mass, two.inv_mass)
    d_bodies = (lane[D_RADIUS], lane[D_RADIUS + 1], lane[D_INV_MASS], lane[D_INV_MASS + 1])
    dx, dy = b.x - a.x, b.y - a.y
    closing = dx * (b.vx - a.vx) + dy * (b.vy - a.vy)
    late = d_distance_of(are_spheres, *bodies[:2], *d_bodies[:2])[1] * math.sqrt(dx * dx + dy * dy)
    late -= dx * (d_b.x - d_a.x) + dy * (d_b.y - d_a.y)
    dt = late * (1.0 / closing) if closing != 0.0 else 0.0
    d_a, d_b = _shifted(d_a, one.before, dt), _shifted(d_b, two.before, dt)
    _note(lane, dt, d_a)
    d_a, d_b = _d_meet(ball_friction, are_spheres, a, b, bodies, numbers, d_a, d_b, d_bodies, _changes(lane))[1]
    put_ball(lane, 0, _shifted(d_a, one.after, -dt))
    put_ball(lane, BALL_WIDTH, _shifted(d_b, two.after, -dt))


for _kernel in (impulse_gain, speed_gain, squirt, struck):
    tangent_of(_kernel, constant=("cue",))
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
            (vx, vy, wx, wy, wz, _), (d_vx, d_vy, d_wx, d_wy, d_wz, _) = _d_strike_by(cue, *at, *unit)
            states[k, 0], states[k, 1], states[k, 2], states[k, 3], states[k, 4] = vx, vy, wx, wy, wz
            jacobians[k, 0, j], jacobians[k, 1, j] = d_vx, d_vy
            jacobians[k, 2, j], jacobians[k, 3, j], jacobians[k, 4, j] = d_wx, d_wy, d_wz
