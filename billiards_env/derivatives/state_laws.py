"""The laws of a shot as functions of the states of balls, for the derivatives.

The engines change rows of a `State` in place. Here the same laws take a `BallState` and return a new one: the motion in
a phase, the impact of two balls, and the impact on a cushion. `LawNumbers` are the numbers that the laws read.
"""

from __future__ import annotations

from collections import namedtuple
from typing import Any

from billiards_env.jit import inlined
from billiards_env.physics.ball_ball import push_apart
from billiards_env.physics.ball_cushion import hit_by
from billiards_env.physics.elementary import norm
from billiards_env.physics.laws.balls import Pair, normal_impulse, tilt_between
from billiards_env.physics.laws.cloth import SLIP_RATE, drive, spin_after
from billiards_env.physics.state import LAW_NUMBERS, SLIDING, SLIDING_AND_ROLLING, SPINNING, BallState

LawNumbers: Any = namedtuple("LawNumbers", (*LAW_NUMBERS, "motion", "cushion_rubs"))
"""The fields of `Numbers` that the laws read. A change of them has the same type."""


@inlined
def law_numbers_of(numbers):
    """Returns the `LawNumbers` of `Numbers` or of their record."""
    return LawNumbers(
        slide=numbers.slide,
        roll=numbers.roll,
        roll_gain=numbers.roll_gain,
        spin_decay=numbers.spin_decay,
        mu_limit=numbers.mu_limit,
        mu_drop=numbers.mu_drop,
        mu_rate=numbers.mu_rate,
        e_ball=numbers.e_ball,
        mu_cloth=numbers.mu_cloth,
        cushion_height=numbers.cushion_height,
        e_cushion=numbers.e_cushion,
        mu_cushion=numbers.mu_cushion,
        cushion_frequency_ratio=numbers.cushion_frequency_ratio,
        e_cushion_loss=numbers.e_cushion_loss,
        e_cushion_onset=numbers.e_cushion_onset,
        e_cushion_floor=numbers.e_cushion_floor,
        e_cushion_topspin=numbers.e_cushion_topspin,
        e_cushion_tangent=numbers.e_cushion_tangent,
        e_cushion_slip=numbers.e_cushion_slip,
        motion=numbers.motion,
        cushion_rubs=numbers.cushion_rubs,
    )


@inlined
def law_changes(d):
    """Returns the change of `LawNumbers` from an array with the changes of `LAW_NUMBERS`."""
    cloth, balls = (d[0], d[1], d[2], d[3]), (d[4], d[5], d[6], d[7])
    cushion = d[8], d[9], d[10], d[11], d[12], d[13], d[14], d[15], d[16], d[17], d[18]
    return LawNumbers(*cloth, *balls, *cushion, 0.0, 0.0)


@inlined
def coast(ball, acceleration, phase, t, numbers):
    """Returns the `BallState` after t seconds in a phase with an acceleration (x, y), m/s^2."""
    ax, ay = acceleration
    turns = SLIP_RATE if phase == SLIDING else 0.0
    if phase == SPINNING:  # valid until the phase ends, up to rounding
        wz = ball.wz - (numbers.spin_decay if ball.wz >= 0.0 else -numbers.spin_decay) * t
    else:
        wz = spin_after(ball.wz, t, numbers)
    return BallState(
        x=ball.x + t * (ball.vx + 0.5 * t * ax),
        y=ball.y + t * (ball.vy + 0.5 * t * ay),
        vx=ball.vx + t * ax,
        vy=ball.vy + t * ay,
        ux=ball.ux + turns * t * ax,
        uy=ball.uy + turns * t * ay,
        wz=wz,
    )


@inlined
def coast_from(ball, phase, t, numbers):
    """Returns the `BallState` after t seconds in a phase that begins with the state `ball`."""
    ax, ay, _ = drive(ball, phase, numbers)
    return coast(ball, (ax, ay), phase, t, numbers)


@inlined
def slip_of(vx, vy, wx, wy, radius):
    """Returns the slip u = v + R z x omega of a ball, m/s."""
    return vx - radius * wy, vy + radius * wx


@inlined
def spin_of(vx, vy, ux, uy, radius):
    """Returns the horizontal spin (wx, wy) of a ball with a slip, rad/s; see `slip_of`."""
    return (uy - vy) / radius, (vx - ux) / radius


@inlined
def meet(laws, are_spheres, a, b, bodies, numbers):
    """Returns the states of two balls after their impact.

    Args:
        laws: `SceneArrays.laws`.
        are_spheres: Whether the balls are spheres.
        a: The `BallState` of the first ball.
        b: The `BallState` of the second ball.
        bodies: The radii and the inverse masses of both, (m, m, 1/kg, 1/kg).
        numbers: The `Numbers`.
    """
    radius_i, radius_j, inv_mass_i, inv_mass_j = bodies
    dx, dy = b.x - a.x, b.y - a.y
    distance = norm(dx, dy)
    nx, ny = dx / distance, dy / distance
    closing = -(nx * (b.vx - a.vx) + ny * (b.vy - a.vy))
    p = normal_impulse(closing, inv_mass_i, inv_mass_j, laws.restitution(numbers, closing))
    pair = Pair(nx, ny, radius_i, radius_j, inv_mass_i, inv_mass_j)
    return push_apart(laws, tilt_between(are_spheres, radius_i, radius_j), a, b, pair, p, numbers)


@inlined
def bounce(ball, n, radius, laws, numbers, solution):
    """Returns the `BallState` after an impact on a cushion. The arguments are as in `hit_by`."""
    share = max(n[0] * ball.vx + n[1] * ball.vy, 0.0)
    motion = (ball.vx, ball.vy, ball.ux, ball.uy, radius * ball.wz)
    (vx, vy, ux, uy, rwz), _ = hit_by(motion, n, share, 0.0, radius, laws, numbers, solution)
    if numbers.motion == SLIDING_AND_ROLLING:
        return BallState(x=ball.x, y=ball.y, vx=vx, vy=vy, ux=ux, uy=uy, wz=rwz / radius)
    return BallState(x=ball.x, y=ball.y, vx=vx, vy=vy, ux=ball.ux, uy=ball.uy, wz=ball.wz)
