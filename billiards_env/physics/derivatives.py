"""The derivatives of the laws: how a small change of the balls passes through a flight or an event.

A lane is a row of numbers: one direction of change of one or two balls, and of the constants of the scene. Each
function `*_lane` below is the derivative of a law. It is a linear map that changes a lane in place. Its coefficients
belong to the motion without the change; they are computed once for an event and used for all lanes.

The state of a ball in a lane is (x, y, vx, vy, ux, uy, wz) at a fixed time. An event changes it by the saltation matrix
(Aizerman and Gantmakher 1958; Leine and Nijmeijer 2004, section 7.5): the change is propagated to the time of the
changed event, through the derivative of the jump there, and back to the fixed time.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from billiards_env.jit import inlined, kernel
from billiards_env.physics.cushion_derivatives import CushionChange, cushion_lane
from billiards_env.physics.elementary import exponential
from billiards_env.physics.lanes import (
    BALL_WIDTH,
    D_E_BALL,
    D_INV_MASS,
    D_MU_DROP,
    D_MU_LIMIT,
    D_MU_RATE,
    D_PLACE_X,
    D_PLACE_Y,
    D_RADIUS,
    D_ROLL,
    D_SLIDE,
    D_SPIN_DECAY,
    D_TIME,
    DUX,
    DUY,
    DVX,
    DVY,
    DWZ,
    DX,
    DY,
)
from billiards_env.physics.motion import SLIP_RATE, norm
from billiards_env.physics.state import (
    AX,
    AY,
    FREE,
    IDEAL,
    LASTS,
    POCKET_X,
    POCKET_Y,
    POTTED,
    REST,
    ROLLING,
    SLIDING,
    SLIDING_AND_ROLLING,
    SPINNING,
    UX,
    UY,
    VX,
    VY,
    WZ,
    X,
    Y,
)
from billiards_env.physics.walls import NX, NY, TIP_RADIUS, TIP_X, TIP_Y


class Flight(NamedTuple):
    """The motion of a ball on a piece of its path, until a time.

    Attributes:
        phase: The phase, FREE for every ball of ideal motion.
        dt: Duration, s.
        ex: Unit vector along x of the slip of a sliding ball or of the velocity of a rolling one, at the start.
        ey: The same along y.
        turn: Share of this slip or velocity that friction has not left over at the end.
        spin: Sign of the spin about the vertical axis.
        spins: Whether this spin lasts until the end.
    """

    phase: Any
    dt: Any
    ex: Any
    ey: Any
    turn: Any
    spin: Any
    spins: Any


@inlined
def flight_of(row, phase, dt, numbers):
    """Returns the `Flight` of a ball with a row of `State.rows` for `dt` seconds."""
    ex, ey, turn = 0.0, 0.0, 0.0
    if phase == SLIDING:
        ex, ey, turn = -row[AX] / numbers.slide, -row[AY] / numbers.slide, dt / (SLIP_RATE * row[LASTS])
    elif phase == ROLLING:
        ex, ey, turn = -row[AX] / numbers.roll, -row[AY] / numbers.roll, dt / row[LASTS]
    if numbers.motion == IDEAL and phase != POTTED:
        phase = FREE
    lost = numbers.spin_decay * dt
    spins = phase == SPINNING or lost == 0.0 or abs(row[WZ]) > lost
    return Flight(phase, dt, ex, ey, turn, math.copysign(1.0, row[WZ]) if row[WZ] != 0.0 else 0.0, spins)


@inlined
def fly(row, flight, numbers, state):
    """Writes the state (7,) after a `Flight` that starts with a row of `State.rows`."""
    phase, dt = flight.phase, flight.dt
    state[DX], state[DY], state[DVX], state[DVY] = row[X], row[Y], row[VX], row[VY]
    state[DUX], state[DUY], state[DWZ] = row[UX], row[UY], row[WZ]
    if ROLLING <= phase < POTTED:
        state[DX] += dt * (row[VX] + 0.5 * dt * row[AX])
        state[DY] += dt * (row[VY] + 0.5 * dt * row[AY])
        state[DVX] += dt * row[AX]
        state[DVY] += dt * row[AY]
    if phase == SLIDING:
        state[DUX] += SLIP_RATE * dt * row[AX]
        state[DUY] += SLIP_RATE * dt * row[AY]
    state[DWZ] = flight.spin * max(0.0, abs(row[WZ]) - numbers.spin_decay * dt)


@inlined
def flight_lane(lane, at, flight):
    """Changes the state at column `at` of a lane by a `Flight`."""
    dt, ex, ey = flight.dt, flight.ex, flight.ey
    bx, by = 0.0, 0.0  # change of the acceleration, times dt
    if flight.phase == SLIDING:
        ux, uy = lane[at + DUX], lane[at + DUY]
        along, more = flight.turn * (ex * ux + ey * uy), dt * lane[D_SLIDE]
        bx, by = (along - more) * ex - flight.turn * ux, (along - more) * ey - flight.turn * uy
        lane[at + DUX] = ux + SLIP_RATE * bx
        lane[at + DUY] = uy + SLIP_RATE * by
    elif flight.phase == ROLLING:
        vx, vy = lane[at + DVX], lane[at + DVY]
        along, more = flight.turn * (ex * vx + ey * vy), dt * lane[D_ROLL]
        bx, by = (along - more) * ex - flight.turn * vx, (along - more) * ey - flight.turn * vy
    lane[at + DX] += dt * (lane[at + DVX] + 0.5 * bx)
    lane[at + DY] += dt * (lane[at + DVY] + 0.5 * by)
    lane[at + DVX] += bx
    lane[at + DVY] += by
    lane[at + DWZ] = lane[at + DWZ] - flight.spin * dt * lane[D_SPIN_DECAY] if flight.spins else 0.0


class Rates(NamedTuple):
    """The time derivative of a state.

    Attributes:
        vx: Of the position along x, m/s.
        vy: The same along y.
        ax: Of the velocity along x, m/s^2.
        ay: The same along y.
        bx: Of the slip along x, m/s^2.
        by: The same along y.
        spin: Of the spin about the vertical axis, rad/s^2.
    """

    vx: Any
    vy: Any
    ax: Any
    ay: Any
    bx: Any
    by: Any
    spin: Any


@inlined
def rates_on(row, phase, state, numbers):
    """Returns the `Rates` of a state (7,) on a piece of a path, with its row of `State.rows` and its phase."""
    ax, ay = row[AX], row[AY]
    turns = SLIP_RATE if phase == SLIDING else 0.0
    spin = -math.copysign(numbers.spin_decay, state[DWZ]) if state[DWZ] != 0.0 else 0.0
    return Rates(state[DVX], state[DVY], ax, ay, turns * ax, turns * ay, spin)


@kernel
def rates_of(state, numbers):
    """Returns the `Rates` of a state (7,) from the law of motion."""
    vx, vy = state[DVX], state[DVY]
    ax, ay, bx, by = 0.0, 0.0, 0.0, 0.0
    v, u = norm(vx, vy), norm(state[DUX], state[DUY])
    if numbers.motion == SLIDING_AND_ROLLING and u > 0.0:
        ax, ay = -numbers.slide * (state[DUX] / u), -numbers.slide * (state[DUY] / u)
        bx, by = SLIP_RATE * ax, SLIP_RATE * ay
    elif numbers.motion != IDEAL and v > 0.0:
        ax, ay = -numbers.roll * (vx / v), -numbers.roll * (vy / v)
    spin = -math.copysign(numbers.spin_decay, state[DWZ]) if state[DWZ] != 0.0 else 0.0
    return Rates(vx, vy, ax, ay, bx, by, spin)


@inlined
def _shift(lane, at, rates, dt):
    """Changes the time of the state at column `at` of a lane by a small time."""
    lane[at + DX] += rates.vx * dt
    lane[at + DY] += rates.vy * dt
    lane[at + DVX] += rates.ax * dt
    lane[at + DVY] += rates.ay * dt
    lane[at + DUX] += rates.bx * dt
    lane[at + DUY] += rates.by * dt
    lane[at + DWZ] += rates.spin * dt


@inlined
def settle_lane(lane, at, phase, numbers):
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
        lane[at + DVX] -= lane[at + DUX] / SLIP_RATE
        lane[at + DVY] -= lane[at + DUY] / SLIP_RATE
    if phase <= SPINNING:
        lane[at + DVX] = lane[at + DVY] = 0.0
    if phase <= ROLLING:
        lane[at + DUX] = lane[at + DUY] = 0.0
    if phase == REST:
        lane[at + DWZ] = 0.0


@inlined
def start_lane(lane, row, phase, radius, numbers):
    """Replaces the horizontal spin of the first ball of a lane by its slip, and settles it.

    Args:
        lane: The lane, with the spins along x and y in the columns of the slip.
        row: The ball's row of `State.rows`.
        phase: Its phase.
        radius: m.
        numbers: The `Numbers`.
    """
    wx, wy = lane[DUX], lane[DUY]
    lane[DUX] = lane[DUY] = 0.0
    if numbers.motion == SLIDING_AND_ROLLING:  # u = v + R (-wy, wx)
        lane[DUX] = lane[DVX] - radius * wy + (row[UX] - row[VX]) / radius * lane[D_RADIUS]
        lane[DUY] = lane[DVY] + radius * wx + (row[UY] - row[VY]) / radius * lane[D_RADIUS]
    settle_lane(lane, 0, phase, numbers)


@inlined
def end_lane(lane, state, radius, numbers):
    """Replaces the slip of the first ball of a lane by its horizontal spin; see `start_lane`."""
    x, y = lane[DUX] - lane[DVX], lane[DUY] - lane[DVY]
    lane[DUX] = lane[DUY] = 0.0
    if numbers.motion == SLIDING_AND_ROLLING:
        lane[DUX] = (y - (state[DUY] - state[DVY]) / radius * lane[D_RADIUS]) / radius
        lane[DUY] = -(x - (state[DUX] - state[DVX]) / radius * lane[D_RADIUS]) / radius


@inlined
def slide_end_lane(lane, flight, after, numbers):
    """Changes a lane by the event of a ball that stops sliding, in the state `after` with the `Rates` after."""
    dt = (flight.ex * lane[DUX] + flight.ey * lane[DUY]) / (SLIP_RATE * numbers.slide)
    ax, ay = -numbers.slide * flight.ex, -numbers.slide * flight.ey
    _end_phase(lane, dt, Rates(after.vx, after.vy, ax, ay, SLIP_RATE * ax, SLIP_RATE * ay, after.spin))
    lane[DUX] = lane[DUY] = 0.0
    _shift(lane, 0, after, -dt)


@inlined
def roll_end_lane(lane, flight, after, numbers):
    """Like `slide_end_lane`, for a ball that stops rolling."""
    dt = (flight.ex * lane[DVX] + flight.ey * lane[DVY]) / numbers.roll
    _end_phase(lane, dt, after)
    _shift(lane, 0, after, -dt)


@inlined
def spin_end_lane(lane, flight, numbers):
    """Like `slide_end_lane`, for a ball that stops spinning; the ball is at rest afterwards."""
    lane[D_TIME] = flight.spin * lane[DWZ] / numbers.spin_decay
    lane[D_PLACE_X], lane[D_PLACE_Y] = lane[DX], lane[DY]


@inlined
def _end_phase(lane, dt, rates):
    """Shifts a lane to the time of an event and stores the results of the event."""
    _shift(lane, 0, rates, dt)
    lane[D_TIME], lane[D_PLACE_X], lane[D_PLACE_Y] = dt, lane[DX], lane[DY]


@inlined
def pocket_lane(lane, state, pocket):
    """Changes a lane by a pocket. The ball ends at the pocket's centre, wherever it enters."""
    dx, dy = state[DX] - pocket[POCKET_X], state[DY] - pocket[POCKET_Y]
    speed = dx * state[DVX] + dy * state[DVY]
    lane[D_TIME] = -(dx * lane[DX] + dy * lane[DY]) / speed if speed != 0.0 else 0.0
    lane[D_PLACE_X] = lane[D_PLACE_Y] = 0.0


class Jump(NamedTuple):
    """A ball in an impact.

    Attributes:
        before: (7,) its state before the impact.
        after: (7,) its state after it.
        before_rates: The `Rates` before.
        after_rates: The `Rates` after.
        radius: m.
        inv_mass: 1/kg.
    """

    before: Any
    after: Any
    before_rates: Any
    after_rates: Any
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
def wall_at(state, wall, radius, outline):
    """Returns the `Wall` with a number at the position of a state."""
    if outline is None:
        sign = 1.0 if wall % 2 else -1.0
        return Wall(sign, 0.0, 0.0) if wall < 2 else Wall(0.0, sign, 0.0)
    return _outline_wall(state, wall, radius, outline)


@kernel
def _outline_wall(state, wall, radius, outline):
    """Implements `wall_at` for an outline."""
    lines, tips = outline.lines, outline.tips
    if wall < len(lines):
        return Wall(lines[wall, NX], lines[wall, NY], 0.0)
    tip = tips[wall - len(lines)]
    dx, dy = tip[TIP_X] - state[DX], tip[TIP_Y] - state[DY]
    distance = norm(dx, dy)
    return Wall(dx / distance, dy / distance, 1.0 / (radius + tip[TIP_RADIUS]))


@inlined
def wall_lane(lane, wall, jump, law, table, scene):
    """Changes a lane by an impact on a cushion.

    Args:
        lane: The lane.
        wall: The `Wall`.
        jump: The `Jump`.
        law: The coefficients of `cushion_derivatives.cushion_law`.
        table: Its table.
        scene: The `SceneArrays`.
    """
    nx, ny, state, after = wall.nx, wall.ny, jump.before, jump.after
    speed = nx * state[DVX] + ny * state[DVY]
    more = lane[D_RADIUS]
    dt = -(nx * lane[DX] + ny * lane[DY] + more) / speed if speed != 0.0 else 0.0
    _end_phase(lane, dt, jump.before_rates)
    turn = -wall.curvature * (nx * lane[DY] - ny * lane[DX])  # at a tip the normal turns with the point of contact
    vt, un, ut = nx * state[DVY] - ny * state[DVX], nx * state[DUX] + ny * state[DUY], nx * state[DUY] - ny * state[DUX]
    change = CushionChange(
        nx * lane[DVX] + ny * lane[DVY] + vt * turn,
        nx * lane[DVY] - ny * lane[DVX] - speed * turn,
        nx * lane[DUX] + ny * lane[DUY] + ut * turn,
        nx * lane[DUY] - ny * lane[DUX] - un * turn,
        jump.radius * lane[DWZ] + state[DWZ] * more,
        more,
        lane,
    )
    dvn, dvt, dun, dut, drwz = cushion_lane(change, law, table, scene)
    dvn -= (nx * after[DVY] - ny * after[DVX]) * turn
    dvt += (nx * after[DVX] + ny * after[DVY]) * turn
    lane[DVX], lane[DVY] = nx * dvn - ny * dvt, ny * dvn + nx * dvt
    if scene.numbers.motion == SLIDING_AND_ROLLING:
        dun -= (nx * after[DUY] - ny * after[DUX]) * turn
        dut += (nx * after[DUX] + ny * after[DUY]) * turn
        lane[DUX], lane[DUY] = nx * dun - ny * dut, ny * dun + nx * dut
        lane[DWZ] = (drwz - after[DWZ] * more) / jump.radius
    _shift(lane, 0, jump.after_rates, -dt)


class Impact(NamedTuple):
    """An impact of two balls: the contact before it, and the impulses.

    h is the horizontal unit vector from the first to the second ball, and t = z x h.

    Attributes:
        hx: h along x.
        hy: h along y.
        distance: Of the centres, m.
        reach_i: Derivative of this distance at contact with respect to the first radius.
        reach_j: The same for the second.
        wn: Relative velocity along h, m/s; negative.
        wt: Relative velocity along t, m/s.
        turn: Sum of the radii times the spins about the vertical axis, m/s.
        roll_n: Sum of the slips less the velocities along h, m/s.
        roll_t: The same along t.
        cosine: Of the inclination of the normal.
        sine: Of the inclination.
        tilts: Whether the radii change the inclination.
        total: Sum of the radii, m.
        e: Restitution.
        inverse: Sum of the inverse masses, 1/kg.
        p: Impulse along h, kg m/s.
        across: Slip across after the normal impulse, m/s.
        up: The same up.
        speed: Size of this slip.
        slides: Whether friction does not stop this slip.
        mu: Coefficient of friction.
        fading: The part of it that falls with the speed, over `Numbers.mu_drop`.
        mu_slope: Its derivative with respect to the speed, s/m.
        ratio: The impulse of friction over the slip, kg.
        drop: `Numbers.mu_drop`.
    """

    hx: Any
    hy: Any
    distance: Any
    reach_i: Any
    reach_j: Any
    wn: Any
    wt: Any
    turn: Any
    roll_n: Any
    roll_t: Any
    cosine: Any
    sine: Any
    tilts: Any
    total: Any
    e: Any
    inverse: Any
    p: Any
    across: Any
    up: Any
    speed: Any
    slides: Any
    mu: Any
    fading: Any
    mu_slope: Any
    ratio: Any
    drop: Any


@kernel
def impact_of(a, b, i, j, is_sphere, scene):
    """Returns the `Impact` of balls i and j with the states a and b, (7,) each.

    `is_sphere` is whether centres of different height are possible.
    """
    numbers, ri, rj = scene.numbers, scene.radius[i], scene.radius[j]
    dx, dy = b[DX] - a[DX], b[DY] - a[DY]
    distance = norm(dx, dy)
    hx, hy = dx / distance, dy / distance
    wx, wy = b[DVX] - a[DVX], b[DVY] - a[DVY]
    wn, wt = hx * wx + hy * wy, hx * wy - hy * wx
    turn = ri * a[DWZ] + rj * b[DWZ]
    rx, ry = (a[DUX] - a[DVX]) + (b[DUX] - b[DVX]), (a[DUY] - a[DVY]) + (b[DUY] - b[DVY])
    roll_n, roll_t = hx * rx + hy * ry, hx * ry - hy * rx
    total, cosine, sine, reach_i, reach_j = ri + rj, 1.0, 0.0, 1.0, 1.0
    if is_sphere:
        cosine, sine = 2.0 * math.sqrt(ri * rj) / total, (rj - ri) / total
        reach_i, reach_j = math.sqrt(rj / ri), math.sqrt(ri / rj)
    inverse = scene.inv_mass[i] + scene.inv_mass[j]
    e = numbers.e_ball
    p = -(1.0 + e) * wn / inverse
    across, up = -wt + (cosine * turn - sine * roll_t), roll_n - sine * e * wn
    speed = norm(across, up)
    fading = exponential(-numbers.mu_rate * speed)
    mu = numbers.mu_limit + numbers.mu_drop * fading
    stop, limit = 1.0 / (3.5 * inverse), mu * p / cosine
    slides = limit < stop * speed or limit == 0.0
    return Impact(
        hx,
        hy,
        distance,
        reach_i,
        reach_j,
        wn,
        wt,
        turn,
        roll_n,
        roll_t,
        cosine,
        sine,
        is_sphere,
        total,
        e,
        inverse,
        p,
        across,
        up,
        speed,
        slides,
        mu,
        fading,
        -numbers.mu_rate * numbers.mu_drop * fading,
        (limit / speed if limit > 0.0 else 0.0) if slides else stop,
        numbers.mu_drop,
    )


class Push(NamedTuple):
    """The impulses of an impact on the first ball, or their change.

    Attributes:
        fn: Force impulse along h, kg m/s.
        ft: The same along t.
        gn: Impulse that changes the slip of both balls without their velocity, along h.
        gt: The same along t.
        spin: Impulse that turns both balls about the vertical axis.
    """

    fn: Any
    ft: Any
    gn: Any
    gt: Any
    spin: Any


@inlined
def push_of(ball_friction, impact):
    """Returns the `Push` of an `Impact`; `ball_friction` is `SceneArrays.ball_friction`."""
    if ball_friction is None:
        return Push(-impact.p, 0.0, 0.0, 0.0, 0.0)
    across, up = -impact.ratio * impact.across, -impact.ratio * impact.up
    return Push(-impact.p - impact.sine * up, across, up, -impact.sine * across, impact.cosine * across)


class PairChange(NamedTuple):
    """A change of what an `Impact` depends on, in the order of its attributes; `lane` has the numbers of the scene."""

    wn: Any
    wt: Any
    turn: Any
    roll_n: Any
    roll_t: Any
    radius_i: Any
    radius_j: Any
    inverse: Any
    lane: Any


@inlined
def _push_change(ball_friction, impact, change):
    """Returns the change of the `Push` of an `Impact` for a `PairChange`."""
    e, wn, inverse = impact.e, impact.wn, impact.inverse
    d_p = -(change.lane[D_E_BALL] * wn + (1.0 + e) * change.wn) / inverse - impact.p * change.inverse / inverse
    if ball_friction is None:
        return Push(-d_p, 0.0, 0.0, 0.0, 0.0)
    cosine, sine = impact.cosine, impact.sine
    d_cosine, d_sine = 0.0, 0.0
    if impact.tilts:
        both = change.radius_i + change.radius_j
        d_sine = (change.radius_j - change.radius_i - sine * both) / impact.total
        d_cosine = -sine / cosine * d_sine
    d_across = (
        -change.wt + (d_cosine * impact.turn + cosine * change.turn) - (d_sine * impact.roll_t + sine * change.roll_t)
    )
    d_up = change.roll_n - d_sine * e * wn - sine * (change.lane[D_E_BALL] * wn + e * change.wn)
    ratio = impact.ratio
    push_across, push_up = -ratio * impact.across, -ratio * impact.up
    if impact.slides:
        x, y = (impact.across / impact.speed, impact.up / impact.speed) if impact.speed > 0.0 else (0.0, 0.0)
        d_speed = x * d_across + y * d_up
        d_mu = impact.mu_slope * d_speed + change.lane[D_MU_LIMIT]
        d_mu += impact.fading * (change.lane[D_MU_DROP] - impact.drop * impact.speed * change.lane[D_MU_RATE])
        d_limit = (d_mu * impact.p + impact.mu * d_p - impact.mu * impact.p * d_cosine / cosine) / cosine
        more = d_limit - ratio * d_speed
        d_push_across, d_push_up = -x * more - ratio * d_across, -y * more - ratio * d_up
    else:
        more = ratio * change.inverse / inverse
        d_push_across, d_push_up = more * impact.across - ratio * d_across, more * impact.up - ratio * d_up
    return Push(
        -d_p - d_sine * push_up - sine * d_push_up,
        d_push_across,
        d_push_up,
        -d_sine * push_across - sine * d_push_across,
        d_cosine * push_across + cosine * d_push_across,
    )


@inlined
def apply_push(state, sign, push, impact, inverse, radius, numbers):
    """Changes the state (7,) of a ball by a `Push`; `sign` is 1.0 for the first ball and -1.0 for the second."""
    hx, hy = impact.hx, impact.hy
    fx, fy = sign * (hx * push.fn - hy * push.ft), sign * (hy * push.fn + hx * push.ft)
    state[DVX] += inverse * fx
    state[DVY] += inverse * fy
    if numbers.motion == SLIDING_AND_ROLLING:
        state[DUX] += inverse * (fx + 2.5 * (hx * push.gn - hy * push.gt))
        state[DUY] += inverse * (fy + 2.5 * (hy * push.gn + hx * push.gt))
        state[DWZ] += 2.5 * inverse * push.spin / radius


@inlined
def pair_lane(lane, impact, push, one, two, scene):
    """Changes a lane by the impact of its two balls.

    Args:
        lane: The lane.
        impact: The `Impact`.
        push: Its `Push`.
        one: The `Jump` of the first ball.
        two: That of the second.
        scene: The `SceneArrays`.
    """
    hx, hy, second = impact.hx, impact.hy, BALL_WIDTH
    more_i, more_j = lane[D_RADIUS], lane[D_RADIUS + 1]
    light_i, light_j = lane[D_INV_MASS], lane[D_INV_MASS + 1]
    apart = hx * (lane[second + DX] - lane[DX]) + hy * (lane[second + DY] - lane[DY])
    late = impact.reach_i * more_i + impact.reach_j * more_j - apart
    dt = late / impact.wn if impact.wn != 0.0 else 0.0
    _end_phase(lane, dt, one.before_rates)
    _shift(lane, second, two.before_rates, dt)
    dx, dy = lane[second + DX] - lane[DX], lane[second + DY] - lane[DY]
    turn = (hx * dy - hy * dx) / impact.distance  # of h and t
    wx, wy = lane[second + DVX] - lane[DVX], lane[second + DVY] - lane[DVY]
    rx = lane[DUX] - lane[DVX] + lane[second + DUX] - lane[second + DVX]
    ry = lane[DUY] - lane[DVY] + lane[second + DUY] - lane[second + DVY]
    ri, rj = one.radius, two.radius
    change = PairChange(
        hx * wx + hy * wy + impact.wt * turn,
        hx * wy - hy * wx - impact.wn * turn,
        ri * lane[DWZ] + rj * lane[second + DWZ] + one.before[DWZ] * more_i + two.before[DWZ] * more_j,
        hx * rx + hy * ry + impact.roll_t * turn,
        hx * ry - hy * rx - impact.roll_n * turn,
        more_i,
        more_j,
        light_i + light_j,
        lane,
    )
    d_push = _push_change(scene.ball_friction, impact, change)
    turned = Push(
        d_push.fn - push.ft * turn,
        d_push.ft + push.fn * turn,
        d_push.gn - push.gt * turn,
        d_push.gt + push.gn * turn,
        d_push.spin,
    )
    first, last = lane[:second], lane[second:]
    mi, mj, numbers = one.inv_mass, two.inv_mass, scene.numbers
    apply_push(first, 1.0, turned, impact, mi, ri, numbers)
    apply_push(last, -1.0, turned, impact, mj, rj, numbers)
    apply_push(first, 1.0, push, impact, light_i, ri, numbers)
    apply_push(last, -1.0, push, impact, light_j, rj, numbers)
    if numbers.motion == SLIDING_AND_ROLLING:
        first[DWZ] -= 2.5 * mi * push.spin / (ri * ri) * more_i
        last[DWZ] -= 2.5 * mj * push.spin / (rj * rj) * more_j
    _shift(lane, 0, one.after_rates, -dt)
    _shift(lane, second, two.after_rates, -dt)
