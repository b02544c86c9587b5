"""The motion of a ball on the cloth between two events.

In every phase the position is quadratic in time, r(t) = r0 + v0 t + a t^2 / 2:

* sliding: the point that touches the cloth moves at u = v + R z x omega. Friction a = -mu_s g u/|u| keeps its
  direction, and du/dt = 7/2 a, so the phase lasts 2 |u| / (7 mu_s g) (Marlow 1995, The Physics of Pocket Billiards).
* rolling: u = 0 and a = -mu_r g v/|v|, so the phase lasts |v| / (mu_r g). The resistance may grow with the speed,
  mu_r(v) = mu_roll + mu_roll_speed |v|. Then the deceleration is constant between two neighbours in `ROLL_SPEEDS` and
  has its value at the middle speed, and a phase ends at each of `ROLL_SPEEDS`. Up to 4.5 m/s the error of the
  deceleration is at most mu_roll_speed g `ROLL_STEP` / 2. Above 4 m/s the deceleration is constant.
* free: a = 0, and the phase has no end.
* spinning and at rest: v = 0.

The spin about the vertical axis decays linearly to zero in every phase, independently of the rest.
"""

from __future__ import annotations

import math

from billiards_env.jit import inlined, kernel
from billiards_env.physics.elementary import norm
from billiards_env.physics.state import (
    FREE,
    IDEAL,
    REST,
    ROLLING,
    ROLLING_ONLY,
    SLIDING,
    SLIDING_AND_ROLLING,
    SPINNING,
)

SLIP_RATE = 3.5
"""While a ball slides, its slip changes at this multiple of its acceleration."""

ROLL_STEP = 0.5
"""m/s."""
ROLL_SPEEDS = tuple(ROLL_STEP * k for k in range(1, 9))
"""The speeds, m/s, at which the rolling resistance changes if it depends on the speed."""

NEAR = 1e-9
"""The relative error of a speed at the end of a phase is smaller."""
_SAME = 1.0 + 1e-12  # more than the rounding of a speed at the beginning of a phase


@inlined
def roll_of(speed, numbers):
    """Returns the deceleration of a ball that rolls, m/s^2, and the speed at which this deceleration ends, m/s."""
    if numbers.roll_gain < 0.0:
        return numbers.roll, 0.0
    least = 0.0
    for step in ROLL_SPEEDS:
        if speed > step * _SAME:
            least = step
    return numbers.roll + numbers.roll_gain * (least + 0.5 * ROLL_STEP), least


@inlined
def roll_speed_near(speed, margin, numbers):
    """Returns the one of `ROLL_SPEEDS` that is within a margin of a speed, m/s; 0 if there is none."""
    if numbers.roll_gain >= 0.0:
        for step in ROLL_SPEEDS:
            if abs(speed - step) <= margin:
                return step
    return 0.0


@inlined
def phase_of(ball, numbers):
    """Returns the phase that a `BallState` begins."""
    moves = ball.vx != 0.0 or ball.vy != 0.0
    if numbers.motion == IDEAL:
        return FREE if moves else REST
    if numbers.motion == SLIDING_AND_ROLLING and (ball.ux != 0.0 or ball.uy != 0.0):
        return SLIDING
    if moves:
        return ROLLING
    return SPINNING if ball.wz != 0.0 else REST


@inlined
def drive(ball, phase, numbers):
    """Returns the acceleration (ax, ay), m/s^2, and the duration, s, of a phase that begins with a `BallState`."""
    if phase == SLIDING:
        u = norm(ball.ux, ball.uy)
        return -numbers.slide * (ball.ux / u), -numbers.slide * (ball.uy / u), u / (SLIP_RATE * numbers.slide)
    if phase == ROLLING:
        v = norm(ball.vx, ball.vy)
        roll, least = roll_of(v, numbers)
        return -roll * (ball.vx / v), -roll * (ball.vy / v), (v - least) / roll
    if phase == SPINNING:
        return 0.0, 0.0, abs(ball.wz) / numbers.spin_decay
    return 0.0, 0.0, math.inf


@inlined
def spin_after(wz, t, numbers):
    """Returns the spin about the vertical axis after t seconds, rad/s."""
    left = abs(wz) - numbers.spin_decay * t
    if left >= 0.0:
        return left if wz >= 0.0 else 0.0 - left
    return 0.0


def largest_friction(motion: int, slide: float, roll: float) -> float:
    """Returns the largest acceleration of a ball by friction, m/s^2; the arguments are fields of `Numbers`."""
    return {IDEAL: 0.0, SLIDING_AND_ROLLING: slide}.get(motion, roll)


@inlined
def _sliding(slide, slip_ratio):
    """Returns the deceleration of a ball that slides, m/s^2, and the share of its speed with which it begins to roll.

    A ball that spins faster than it rolls (slip_ratio < 0) gains speed.
    """
    return math.copysign(slide, slip_ratio), 1.0 - slip_ratio * (1.0 / SLIP_RATE)


@kernel
def launch(numbers, distance, speed, slip_ratio):
    """Returns the initial speed of a ball whose speed is `speed` after `distance`, m/s.

    Args:
        numbers: The `Numbers`.
        distance: m.
        speed: m/s.
        slip_ratio: Initial slip of the ball divided by its initial speed, < 7/2. It is 1 without spin, 0 if the ball
            rolls, and negative if it spins faster than it rolls. Motions other than sliding ignore it.

    A rolling ball has the deceleration for `speed` on its whole way.
    """
    roll, _ = roll_of(speed, numbers)
    if numbers.motion == IDEAL:
        return speed
    if numbers.motion == ROLLING_ONLY:
        return math.sqrt(speed * speed + 2.0 * roll * distance)
    # The ball slides over (1 - share^2) v^2 / (2 slide), and then rolls.
    slide, share = _sliding(numbers.slide, slip_ratio)
    square = speed * speed + 2.0 * slide * distance
    if square > 0.0 and math.copysign(1.0, slip_ratio) * (speed * speed - share * share * square) >= 0.0:
        return math.sqrt(square)
    return math.sqrt((speed * speed + 2.0 * roll * distance) / (share * share + (1.0 - share * share) * roll / slide))


@kernel
def arrival(numbers, distance, speed, slip_ratio):
    """Returns the speed and the slip of a ball after `distance`, m/s.

    The ball starts at `speed`, m/s. For the rest see `launch`.
    """
    roll, _ = roll_of(speed, numbers)
    if numbers.motion == IDEAL:
        return speed, 0.0
    if numbers.motion == ROLLING_ONLY:
        return math.sqrt(max(speed * speed - 2.0 * roll * distance, 0.0)), 0.0
    slide, share = _sliding(numbers.slide, slip_ratio)
    square, rolling = speed * speed - 2.0 * slide * distance, (share * speed) * (share * speed)
    if math.copysign(1.0, slip_ratio) * (square - rolling) > 0.0:
        left = math.sqrt(square)
        return left, slip_ratio * speed - SLIP_RATE * (speed - left)
    rolled = distance - (speed * speed - rolling) / (2.0 * slide)
    return math.sqrt(max(rolling - 2.0 * roll * rolled, 0.0)), 0.0


@kernel
def travel_time(numbers, distance, speed, slip_ratio):
    """Returns the time in which a ball that starts at `speed` covers `distance`, s. For the arguments see `launch`.

    The ball must not come to rest before.
    """
    left, slip = arrival(numbers, distance, speed, slip_ratio)
    roll, _ = roll_of(speed, numbers)
    if numbers.motion == IDEAL:
        return distance / speed
    if numbers.motion == ROLLING_ONLY:
        return (speed - left) / roll
    slide, share = _sliding(numbers.slide, slip_ratio)
    if slip != 0.0:
        return (speed - left) / slide
    return (speed - share * speed) / slide + (share * speed - left) / roll
