"""How a small change of the balls passes through a stretch or an event.

A lane is a row of numbers: one direction of change of one or two balls, and of the constants of the scene. Each
function `*_lane` below changes a lane in place. `derivatives.tangent` makes the derivatives of the laws from their
sources. The change of the time of an event, which is an implicit function, is written here by hand.

The state of a ball in a lane is a `BallState` at a fixed time. An event changes it by the saltation matrix (Aizerman
and Gantmakher 1958; Leine and Nijmeijer 2004, section 7.5): the change is propagated to the time of the changed event,
through the derivative of the jump there, and back to the fixed time.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Collection
from typing import Any, NamedTuple

from billiards_env.derivatives.rules import SMOOTH
from billiards_env.derivatives.state_laws import bounce, coast_from, law_changes, meet, slip_of, spin_of
from billiards_env.derivatives.tangent import as_kernel, tangent_of
from billiards_env.jit import entry_point, inlined
from billiards_env.physics.geometry.pockets import outwards_at
from billiards_env.physics.geometry.walls import centres_at
from billiards_env.physics.laws.balls import distance_of
from billiards_env.physics.laws.cloth import SLIP_RATE, drive, spin_after
from billiards_env.physics.laws.cushion import CushionMotion, restitution_is_smooth
from billiards_env.physics.laws.tables import CUSHIONS
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
    SceneKernels,
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

_d_spin_after = tangent_of(spin_after, constant=("t", "numbers"))


@inlined
def _no_solution(before, radius, numbers):
    return 0.0


@inlined
def _always_smooth(before, radius, numbers):
    return True


_SOLUTIONS = {cushion.law: cushion.solution or _no_solution for cushion in CUSHIONS.values()}


class TangentLaws(NamedTuple):
    """`Laws`, and what the derivatives need of them.

    A tangent of a kernel that calls `laws.friction` calls `laws.d_friction`.

    Attributes:
        restitution: `Laws.restitution`.
        friction: `Laws.friction`.
        cushion: `Laws.cushion`.
        d_restitution: The tangent of each.
        d_friction: None for balls without friction.
        d_cushion: That of the law with a known solution.
        solution: `Cushion.solution`, or a kernel that returns 0.
        is_smooth: Kernel of (before, radius, numbers): whether an impact on a cushion has a derivative.
    """

    restitution: Any
    friction: Any
    cushion: Any
    d_restitution: Any
    d_friction: Any
    d_cushion: Any
    solution: Any
    is_smooth: Any


class Tangents(NamedTuple):
    """The tangents of the laws that a lane passes, as kernels. They have the arguments of `tangent_of`.

    Attributes:
        drive: The tangent of `cloth.drive`.
        coast: The tangent of `state_laws.coast_from`.
        slip_of: The tangent of `state_laws.slip_of`.
        spin_of: The tangent of `state_laws.spin_of`.
        distance_of: The tangent of `balls.distance_of`.
        meet: The tangent of `state_laws.meet`.
        bounce: The tangent of `state_laws.bounce`.
    """

    drive: Any
    coast: Any
    slip_of: Any
    spin_of: Any
    distance_of: Any
    meet: Any
    bounce: Any


class LaneKernels(NamedTuple):
    """The kernels of a derivative.

    Attributes:
        scene: The `SceneKernels`, with `TangentLaws`.
        tangents: The `Tangents`.
    """

    scene: SceneKernels
    tangents: Tangents


def _tangent(function: Callable[..., Any], constant: Collection[str], constants: Collection[str], vary: bool) -> Any:
    """Returns the tangent of a law as a kernel that is an argument.

    `constants` names the last arguments of the law. If they do not vary, the tangent ignores their changes.
    """
    if vary:
        return as_kernel(tangent_of(function, constant=constant))
    states, kept = tangent_of(function, constant=(*constant, *constants)), -len(constants)
    return inlined(lambda *arguments: states(*arguments[:kept]))


@functools.cache
def lane_kernels(kernels: SceneKernels, constants: bool) -> LaneKernels:
    """Returns the kernels of the derivative of the shots of a scene.

    Args:
        kernels: Those of the scene.
        constants: Whether radii, masses and numbers change, or only the states of balls. The tangents of the states
            alone have fewer operations.
    """
    laws, numbers = kernels.laws, () if constants else ("numbers",)
    of_cushion = ("rebound", "solution") if constants else ("radius", "rebound", "numbers", "solution")
    with_tangents = TangentLaws(
        *laws,
        d_restitution=as_kernel(tangent_of(laws.restitution, constant=numbers)),
        d_friction=None if laws.friction is None else as_kernel(tangent_of(laws.friction, constant=numbers)),
        d_cushion=as_kernel(tangent_of(laws.cushion, constant=of_cushion)),
        solution=_SOLUTIONS[laws.cushion],
        is_smooth=SMOOTH.get(laws.cushion, _always_smooth),
    )
    tangents = Tangents(
        drive=_tangent(drive, ("phase",), ("numbers",), constants),
        coast=_tangent(coast_from, ("phase", "t"), ("numbers",), constants),
        slip_of=_tangent(slip_of, (), ("radius",), constants),
        spin_of=_tangent(spin_of, (), ("radius",), constants),
        distance_of=_tangent(distance_of, ("are_spheres",), ("radius_i", "radius_j"), constants),
        meet=_tangent(meet, ("laws", "are_spheres"), ("bodies", "numbers"), constants),
        bounce=_tangent(bounce, ("laws", "solution"), ("radius", "numbers"), constants),
    )
    return LaneKernels(kernels._replace(laws=with_tangents), tangents)


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
def distance_change(lane, are_spheres, radii, tangents):
    """Returns the change of the distance of the centres of both balls of a lane when they touch, m."""
    return tangents.distance_of(are_spheres, radii[0], radii[1], lane[D_RADIUS], lane[D_RADIUS + 1])[1]


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
def stretch_lane(lane, at, stretch, tangents):  # out: lane
    """Changes the state at column `at` of a lane by a `Stretch`."""
    ball, phase, dt, numbers = stretch
    put_ball(lane, at, tangents.coast(ball, phase, dt, numbers, ball_at(lane, at), _changes(lane))[1])


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
def start_lane(lane, ball, phase, radius, numbers, tangents):  # out: lane
    """Replaces the horizontal spin of the first ball of a lane by its slip, and settles it.

    Args:
        lane: The lane, with the spins along x and y in the columns of the slip.
        ball: The ball's `BallState`.
        phase: Its phase.
        radius: m.
        numbers: The `LawNumbers`.
        tangents: The `Tangents`.
    """
    change = ball_at(lane, 0)
    lane[DUX] = lane[DUY] = 0.0
    if numbers.motion == SLIDING_AND_ROLLING:
        wx, wy = spin_of(ball.vx, ball.vy, ball.ux, ball.uy, radius)
        at = (ball.vx, ball.vy, wx, wy, radius, change.vx, change.vy, change.ux, change.uy, lane[D_RADIUS])
        lane[DUX], lane[DUY] = tangents.slip_of(*at)[1]
    settle_lane(lane, 0, phase, numbers)


@inlined
def end_lane(lane, ball, radius, numbers, tangents):  # out: lane
    """Replaces the slip of the first ball of a lane, in a `BallState`, by its horizontal spin; see `start_lane`."""
    change = ball_at(lane, 0)
    lane[DUX] = lane[DUY] = 0.0
    if numbers.motion == SLIDING_AND_ROLLING:
        at = (ball.vx, ball.vy, ball.ux, ball.uy, radius, change.vx, change.vy, change.ux, change.uy, lane[D_RADIUS])
        lane[DUX], lane[DUY] = tangents.spin_of(*at)[1]


@inlined
def _note(lane, dt, change):  # out: lane
    """Stores the results of an event: the change of its time and of the place of its ball then."""
    lane[D_TIME], lane[D_PLACE_X], lane[D_PLACE_Y] = dt, change.x, change.y


@inlined
def phase_end_lane(lane, stretch, before, after, tangents):  # out: lane
    """Changes a lane by a `Stretch` and the event at the end of its phase.

    Args:
        lane: The lane.
        stretch: The `Stretch`.
        before: The time derivative of the state before the event.
        after: The same after it.
        tangents: The `Tangents`.
    """
    ball, phase, _, numbers = stretch
    dt = tangents.drive(ball, phase, numbers, ball_at(lane, 0), _changes(lane))[1][2]
    stretch_lane(lane, 0, stretch, tangents)
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
def wall_at(x, y, wall, radius, scene):
    """Returns the `Wall` with a number where a ball at (x, y) touches it."""
    nx, ny = scene.walls.normal(x, y, wall, scene)
    return Wall(nx, ny, 1.0 / centres_at(wall, radius, scene.outline)[2])


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
    return restitution_is_smooth(motion.vn, numbers) and scene.laws.is_smooth(motion, radius, numbers)


@inlined
def cushion_solution(ball, wall, radius, scene):
    """Returns the solution of the equation of the cushions' law, see `cushion_han2005.han2005`."""
    return scene.laws.solution(_motion_at(ball, wall, radius), radius, scene.numbers)


@inlined
def wall_lane(lane, wall, jump, laws, numbers, solution, tangents):  # out: lane
    """Changes a lane by an impact on a cushion.

    Args:
        lane: The lane.
        wall: The `Wall`.
        jump: The `Jump`.
        laws: The `TangentLaws`.
        numbers: The `LawNumbers`.
        solution: The result of `cushion_solution`.
        tangents: The `Tangents`.
    """
    nx, ny, ball, d_radius = wall.nx, wall.ny, jump.ball, lane[D_RADIUS]
    speed = nx * ball.vx + ny * ball.vy
    dt = -(nx * lane[DX] + ny * lane[DY] + d_radius) * (1.0 / speed) if speed != 0.0 else 0.0
    change = _shifted(ball_at(lane, 0), jump.before, dt)
    _note(lane, dt, change)
    turn = -wall.curvature * (nx * change.y - ny * change.x)  # at a tip the normal turns with the point of contact
    d_n = (-ny * turn, nx * turn)
    at = (ball, (nx, ny), jump.radius, laws, numbers, solution, change, d_n, d_radius, _changes(lane))
    change = tangents.bounce(*at)[1]
    put_ball(lane, 0, _shifted(change, jump.after, -dt))


@inlined
def pair_lane(lane, one, two, are_spheres, laws, numbers, tangents):  # out: lane
    """Changes a lane by the impact of its two balls.

    Args:
        lane: The lane.
        one: The `Jump` of the first ball.
        two: That of the second.
        are_spheres: Whether the balls are spheres.
        laws: The `TangentLaws`.
        numbers: The `LawNumbers`.
        tangents: The `Tangents`.
    """
    a, b, d_a, d_b = one.ball, two.ball, ball_at(lane, 0), ball_at(lane, BALL_WIDTH)
    bodies = (one.radius, two.radius, one.inv_mass, two.inv_mass)
    d_bodies = (lane[D_RADIUS], lane[D_RADIUS + 1], lane[D_INV_MASS], lane[D_INV_MASS + 1])
    dx, dy = b.x - a.x, b.y - a.y
    closing = dx * (b.vx - a.vx) + dy * (b.vy - a.vy)
    late = distance_change(lane, are_spheres, bodies, tangents) * math.sqrt(dx * dx + dy * dy)
    late -= dx * (d_b.x - d_a.x) + dy * (d_b.y - d_a.y)
    dt = late * (1.0 / closing) if closing != 0.0 else 0.0
    d_a, d_b = _shifted(d_a, one.before, dt), _shifted(d_b, two.before, dt)
    _note(lane, dt, d_a)
    at = (laws, are_spheres, a, b, bodies, numbers, d_a, d_b, d_bodies, _changes(lane))
    d_a, d_b = tangents.meet(*at)[1]
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
