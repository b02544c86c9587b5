"""The next times at which balls, cushions and pockets touch and approach.

Every gap is a polynomial in the time since a base time, up to a positive factor. For two balls, or a ball and a pocket,
it is the squared distance less the squared reach (degree 4), as for the arc of a cushion; for a straight cushion it is
the distance (degree 2). It is positive if the bodies are apart. The functions that form it accept floats and mpf
numbers.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import mpmath

from benchmarks.reference.oracle.laws import Segment, Vector, World, norm
from benchmarks.reference.oracle.outline import Arc, Line, dot, minus
from benchmarks.reference.oracle.roots import Real, first_entry, first_possible_entry
from billiards_env.scene import CONTACT_GAP

Contact: TypeAlias = "tuple[Real, bool] | None"
"""The time of a contact, and whether it is a resting contact."""

MARGIN = 1e-10
"""The margin of floats, as a share of the squared extent of the motion: 100,000 times their error."""


def pair_gap(offset: Sequence[Real], velocity: Sequence[Real], acceleration: Sequence[Real], reach: Real) -> list[Real]:
    """Returns |offset + velocity t + acceleration t^2 / 2|^2 - reach^2 as a polynomial in t."""
    (x, y), (vx, vy), (ax, ay) = offset, velocity, acceleration
    return [
        x * x + y * y - reach * reach,
        2 * (x * vx + y * vy),
        vx * vx + vy * vy + x * ax + y * ay,
        vx * ax + vy * ay,
        (ax * ax + ay * ay) / 4,
    ]


def wall_gap(wall: Line | Arc, radius: Real, position: Vector, velocity: Vector, acceleration: Vector) -> list[Real]:
    """Returns the gap between a ball and the straight line or the circle of a cushion as a polynomial in t."""
    if isinstance(wall, Arc):
        return pair_gap(minus(position, wall.center), velocity, acceleration, radius + wall.radius)
    n = wall.normal
    return [-dot(n, minus(position, wall.middle)) - radius, -dot(n, velocity), -dot(n, acceleration) / 2]


def next_contact(gap: Sequence[Real], rounding: Sequence[Real], touch: Real, high: Real) -> Contact:
    """Returns the next time at which two surfaces touch and approach.

    If the gap is at most `touch`, the surfaces are in contact, and the sign of the first derivative that does not
    vanish decides. If they approach, the contact is now. If they separate, the root at 0 is divided out of a gap of
    zero.

    Args:
        gap: The coefficients of the gap.
        rounding: The size below which each coefficient counts as zero.
        touch: The largest constant coefficient that is a contact.
        high: The end of the interval [0, high].

    Returns:
        The time, and whether it is a resting contact, in which surfaces press against each other without normal
        velocity. None if there is no contact.
    """
    gap = list(gap)
    if gap[0] <= touch:
        # An overlap counts as a gap of zero; placed balls may overlap by their rounding.
        gap[0] = max(gap[0], mpmath.mpf(0))
        order = 1
        while order < len(gap) and abs(gap[order]) <= rounding[order]:
            gap[order] = mpmath.mpf(0)
            order += 1
        if order == len(gap):
            return None
        if gap[order] < 0:
            return mpmath.mpf(0), order > 1
        if gap[0] == 0:
            gap = gap[order:]
    time = first_entry(gap, high)
    return None if time is None else (time, False)


def _circle_rounding(reach: Real, speed: Real, noise: Real, push: Real, push_noise: Real) -> Vector:
    """Returns the rounding of the coefficients of `pair_gap`, of the velocity and of the acceleration."""
    linear, quadratic = 2 * reach * noise, 2 * speed * noise + reach * push_noise
    return mpmath.mpf(0), linear, quadratic, speed * push_noise + push * noise, push * push_noise


def pair_contact(world: World, ball: int, a: Segment, other: int, b: Segment, base: Real, high: Real) -> Contact:
    """Returns `next_contact` of two balls in [base, base + high]; times are relative to `base`."""
    velocities = a.velocity_at(base), b.velocity_at(base)
    offset, velocity = minus(b.position_at(base), a.position_at(base)), minus(*velocities[::-1])
    acceleration, reach = minus(b.acceleration, a.acceleration), world.reach(ball, other)
    speed = sum(map(norm, velocities))
    noise = a.noise + b.noise + world.tiny * speed
    push = norm(a.acceleration) + norm(b.acceleration)
    push_noise = world.tiny * push
    rounding = _circle_rounding(reach, speed, noise, push, push_noise)
    return next_contact(pair_gap(offset, velocity, acceleration, reach), rounding, 2 * reach * CONTACT_GAP, high)


def wall_contact(world: World, ball: int, a: Segment, number: int, base: Real, high: Real) -> Contact:
    """Returns `next_contact` of a ball and a cushion."""
    wall, radius = world.walls[number], world.radius[ball]
    velocity, push = a.velocity_at(base), norm(a.acceleration)
    speed = norm(velocity)
    noise, push_noise = a.noise + world.tiny * speed, world.tiny * push
    rounding, touch = (0, noise, push_noise), mpmath.mpf(CONTACT_GAP)
    if isinstance(wall, Arc):
        reach = radius + wall.radius
        rounding = _circle_rounding(reach, speed, noise, push, push_noise)
        touch = 2 * reach * touch
    after = mpmath.mpf(0)
    while True:
        gap = wall_gap(wall, radius, a.position_at(base + after), a.velocity_at(base + after), a.acceleration)
        if after:
            gap[0] = mpmath.mpf(0)
        if not after and abs(gap[0]) <= touch and wall.holds(a.position_at(base), world.tiny):
            contact = next_contact(gap, rounding, touch, high)
        else:  # the ball may be behind a line, or inside a circle, that the cushion is only a part of
            time = first_entry(gap, high - after)
            contact = None if time is None else (after + time, False)
        if contact is None or wall.holds(a.position_at(base + contact[0]), world.tiny):
            return contact
        after = contact[0]  # the path enters the circle beyond the arc
        if isinstance(wall, Line):
            return None


def pocket_contact(world: World, ball: int, a: Segment, pocket: int, base: Real, high: Real) -> Contact:
    """Returns `next_contact` of the centre of a ball and the circle of a pocket."""
    x, y, radius = world.pockets[pocket]
    px, py = a.position_at(base)
    velocity = a.velocity_at(base)
    rounding = (0, 2 * radius * (a.noise + world.tiny * norm(velocity)), 0, 0, 0)
    gap = pair_gap((px - x, py - y), velocity, a.acceleration, radius)
    contact = next_contact(gap, rounding, mpmath.mpf(0), high)
    return None if contact is None else (contact[0], False)


class FloatMotion:
    """The motion of a segment after a base time, in floats."""

    __slots__ = ("acceleration", "position", "velocity")

    def __init__(self, a: Segment, base: Real) -> None:
        t = float(base - a.start)
        vx, vy = float(a.velocity[0]), float(a.velocity[1])
        ax, ay = float(a.acceleration[0]), float(a.acceleration[1])
        self.position = (float(a.position[0]) + t * (vx + t * ax / 2), float(a.position[1]) + t * (vy + t * ay / 2))
        self.velocity = (vx + t * ax, vy + t * ay)
        self.acceleration = (ax, ay)

    def extent(self, high: float) -> float:
        """Returns an upper bound for the coordinates within `high` seconds, m."""
        return sum(map(abs, self.position)) + high * (
            sum(map(abs, self.velocity)) + high * sum(map(abs, self.acceleration))
        )


def _bound(gap: Sequence[float], margin: float, high: float) -> float | None:
    """Returns a lower bound for the time of an entry, s, from a gap as a polynomial in the share of `high` seconds."""
    entry = first_possible_entry(gap, margin)
    return None if entry is None else entry * high


def possible_pair_contact(a: FloatMotion, b: FloatMotion, reach: float, high: float) -> float | None:
    """Returns a lower bound for the time of `pair_contact`, in floats; None if there can be no contact."""
    (x, y), (vx, vy), (ax, ay) = (
        minus(q, p) for p, q in ((a.position, b.position), (a.velocity, b.velocity), (a.acceleration, b.acceleration))
    )
    gap = pair_gap((x, y), (vx * high, vy * high), (ax * high * high, ay * high * high), reach)
    extent = a.extent(high) + b.extent(high) + reach
    return _bound(gap, MARGIN * extent * extent + 3 * reach * CONTACT_GAP, high)


def possible_wall_contact(a: FloatMotion, wall: Line | Arc, radius: float, high: float) -> float | None:
    """Returns a lower bound for the time of `wall_contact`, in the same way; the cushion is given in floats."""
    velocity = tuple(v * high for v in a.velocity)
    acceleration = tuple(b * high * high for b in a.acceleration)
    gap = wall_gap(wall, radius, a.position, velocity, acceleration)
    if isinstance(wall, Arc):
        extent, reach = a.extent(high) + sum(map(abs, wall.center)) + wall.radius, radius + wall.radius
        return _bound(gap, MARGIN * extent * extent + 3 * reach * CONTACT_GAP, high)
    margin = MARGIN * (a.extent(high) + sum(map(abs, wall.middle)) + radius) + 2 * CONTACT_GAP
    feet = [dot(wall.tangent, minus(a.position, wall.middle))]  # Bernstein coefficients of the place along the cushion
    feet.append(feet[0] + dot(wall.tangent, velocity) / 2)
    feet.append(2 * feet[1] - feet[0] + dot(wall.tangent, acceleration) / 2)
    if min(feet) > wall.half + margin or max(feet) < -wall.half - margin:
        return None
    return _bound([*gap, 0.0, 0.0], margin, high)


def possible_pocket_contact(a: FloatMotion, pocket: Vector, high: float) -> float | None:
    """Returns a lower bound for the time of `pocket_contact`, in the same way; the pocket is given in floats."""
    x, y, radius = pocket
    velocity, acceleration = tuple(v * high for v in a.velocity), tuple(b * high * high for b in a.acceleration)
    gap = pair_gap(minus(a.position, (x, y)), velocity, acceleration, radius)
    extent = a.extent(high) + abs(x) + abs(y) + radius
    return _bound(gap, MARGIN * extent * extent, high)
