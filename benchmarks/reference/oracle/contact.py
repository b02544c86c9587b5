"""The next times at which balls, cushions and pockets touch and approach.

Every gap is a polynomial in the time since a base time, up to a positive factor. For two balls, or a ball and a pocket,
it is the squared distance less the squared reach (degree 4), as for the arc of a cushion; for a straight cushion it is
the distance (degree 2). A ball in the air touches the nose of a cushion, a line (degree 4) or a circle (degree 8). The
gap is positive if the bodies are apart. The functions that form it accept floats and mpf numbers.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import TypeAlias

import mpmath

from benchmarks.reference.oracle.laws import Segment, Vector, World, norm
from benchmarks.reference.oracle.outline import Arc, Line, dot, minus, normal_at
from benchmarks.reference.oracle.roots import Real, first_entry, first_possible_entry
from billiards_env.scene import CONTACT_GAP

Contact: TypeAlias = "tuple[Real, bool] | None"
"""The time of a contact, and whether it is a resting contact."""

MARGIN = 1e-10
"""The margin of floats, as a share of the squared extent of the motion: 100,000 times their error."""


def pair_gap(offset: Sequence[Real], velocity: Sequence[Real], acceleration: Sequence[Real], reach: Real) -> list[Real]:
    """Returns |offset + velocity t + acceleration t^2 / 2|^2 - reach^2 as a polynomial in t."""
    r, v, a = offset, velocity, acceleration
    return [dot(r, r) - reach * reach, 2 * dot(r, v), dot(v, v) + dot(r, a), dot(v, a), dot(a, a) / 4]


def wall_gap(wall: Line | Arc, radius: Real, position: Vector, velocity: Vector, acceleration: Vector) -> list[Real]:
    """Returns the gap between a ball and the straight line or the circle of a cushion as a polynomial in t."""
    if isinstance(wall, Arc):
        return pair_gap(minus(position, wall.center), velocity, acceleration, radius + wall.radius)
    n = wall.normal
    return [-dot(n, minus(position, wall.middle)) - radius, -dot(n, velocity), -dot(n, acceleration) / 2]


def nose_gap(world: World, ball: int, wall: Line | Arc, position: Vector, velocity: Vector) -> list[Real]:
    """Returns the gap between a ball in the air and the nose of a cushion as a polynomial in t.

    It is the squared distance of the centre from the nose less the squared radius. For a circle with the radius q and a
    centre at the distance d from its axis, (d - q)^2 + z^2 - R^2 = s - 2 q d is multiplied by s + 2 q d, which is
    positive where the ball first touches the nose.
    """
    inset, height = world.nose(ball)
    rise = [position[2] - height, velocity[2], -world.g / 2]
    above = _plus(_times(rise, rise), [-(world.radius[ball] ** 2)])
    across = wall_gap(wall, inset, position[:2], velocity[:2], (mpmath.mpf(0),) * 2)[:3]
    if isinstance(wall, Line):
        return _plus(_times(across, across), above)
    nose = wall.radius + inset
    square = _plus(across, [nose**2])  # of the distance from the axis
    half = _plus(_plus(square, [nose**2]), above)
    return _plus(_times(half, half), [-4 * nose**2 * c for c in square])


def nose_normal(world: World, ball: int, wall: Line | Arc, position: Vector) -> Vector:
    """Returns the unit normal, (3,), from the centre of a ball in the air to the nose that it touches."""
    near = foot(world, ball, wall, position)
    points = nose_ends(world, ball, wall)
    if wall.holds(position, world.tiny) and world.pocket_at(near) is None:
        points.append((*near, world.nose(ball)[1]))
    way = min((minus(point, position) for point in points), key=norm)
    return tuple(x / norm(way) for x in way)


def _plus(p: Sequence[Real], q: Sequence[Real]) -> list[Real]:
    return [a + b for a, b in itertools.zip_longest(p, q, fillvalue=mpmath.mpf(0))]


def _times(p: Sequence[Real], q: Sequence[Real]) -> list[Real]:
    product = [mpmath.mpf(0)] * (len(p) + len(q) - 1)
    for (i, a), (j, b) in itertools.product(enumerate(p), enumerate(q)):
        product[i + j] += a * b
    return product


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
    offset, velocity = world.offset(ball, other, a.position_at(base), b.position_at(base)), minus(*velocities[::-1])
    acceleration, reach = minus(b.acceleration, a.acceleration), world.reach(ball, other)
    speed = sum(map(norm, velocities))
    noise = a.noise + b.noise + world.tiny * speed
    push = norm(a.acceleration) + norm(b.acceleration)
    push_noise = world.tiny * push
    rounding = _circle_rounding(reach, speed, noise, push, push_noise)
    return next_contact(pair_gap(offset, velocity, acceleration, reach), rounding, 2 * reach * CONTACT_GAP, high)


def wall_contact(world: World, ball: int, a: Segment, number: int, base: Real, high: Real) -> Contact:
    """Returns `next_contact` of a ball and a cushion. A ball in the air meets the nose, which ends at pockets."""
    wall, radius, flies = world.walls[number], world.radius[ball], a.phase == "airborne"
    velocity, push = a.velocity_at(base), norm(a.acceleration)
    speed = norm(velocity)
    noise, push_noise = a.noise + world.tiny * speed, world.tiny * push
    rounding, touch = (0, noise, push_noise), mpmath.mpf(CONTACT_GAP)
    if flies:
        scale = 2 * radius
        if isinstance(wall, Arc):
            scale *= 4 * (wall.radius + world.nose(ball)[0]) * norm(minus(a.position_at(base), wall.center))
        rounding, touch = (0, scale * noise, *(0,) * 7), scale * touch
    elif isinstance(wall, Arc):
        reach = radius + wall.radius
        rounding = _circle_rounding(reach, speed, noise, push, push_noise)
        touch = 2 * reach * touch
    after = mpmath.mpf(0)

    def holds(place: Vector) -> bool:
        if flies:
            near = foot(world, ball, wall, place)
            room = (most - world.nose(ball)[0] + world.tiny for most in world.extent)
            behind = dot(normal_at(wall, place), minus(near, place)) < -world.tiny
            if behind or world.pocket_at(near) is not None or any(abs(c) > x for c, x in zip(near, room, strict=True)):
                return False
        return wall.holds(place, world.tiny)

    while True:
        position, velocity = a.position_at(base + after), a.velocity_at(base + after)
        if flies:
            gap = nose_gap(world, ball, wall, position, velocity)
        else:
            gap = wall_gap(wall, radius, position, velocity, a.acceleration)
        if after:
            gap[0] = mpmath.mpf(0)
        if not after and abs(gap[0]) <= touch and holds(position):
            contact = next_contact(gap, rounding, touch, high)
        else:  # the ball may be behind a line, or inside a circle, that the cushion is only a part of
            time = first_entry(gap, high - after)
            contact = None if time is None else (after + time, False)
        if contact is None or holds(a.position_at(base + contact[0])):
            break
        after = contact[0]  # the path enters the circle beyond the arc, or where there is no nose
        if isinstance(wall, Line) and not flies:
            return None
    if not flies:
        return contact
    ends = (
        next_contact(pair_gap(minus(position, end), velocity, a.acceleration, radius), rounding, touch, high)
        for position, velocity in [(a.position_at(base), a.velocity_at(base))]
        for end in nose_ends(world, ball, wall)
    )
    return min((c for c in (contact, *ends) if c is not None), default=None)


def pocket_below(world: World, ball: int, place: Vector) -> int | None:
    """Returns the pocket that catches a ball that lands at a place: in its circle, or in its mouth beyond a cushion."""
    pocket = world.pocket_at(place)
    for wall in world.walls:
        if pocket is None and wall.holds(place, world.tiny):
            near = foot(world, ball, wall, place)
            beyond = dot(normal_at(wall, place), minus(near, place)) + world.nose(ball)[0]
            pocket = world.pocket_at(near) if beyond < world.radius[ball] - CONTACT_GAP else None
    return pocket


def foot(world: World, ball: int, wall: Line | Arc, position: Vector) -> Vector:
    """Returns the point of the line or the circle of a nose, (2,), that is nearest to a position."""
    n, inset = normal_at(wall, position), world.nose(ball)[0]
    if isinstance(wall, Arc):
        return tuple(c - (wall.radius + inset) * x for c, x in zip(wall.center, n, strict=True))
    across = dot(n, minus(wall.middle, position)) - inset
    return tuple(x + across * y for x, y in zip(position, n, strict=False))


def nose_ends(world: World, ball: int, wall: Line | Arc) -> list[Vector]:
    """Returns the points, (3,), at which the nose of a cushion meets the circles of the pockets."""
    (inset, height), ends = world.nose(ball), []
    for x, y, radius in world.pockets:
        if isinstance(wall, Arc):  # two circles: the middle of their common chord, and its direction
            way = minus((x, y), wall.center)
            share = (1 + ((wall.radius + inset) ** 2 - radius**2) / dot(way, way)) / 2
            near = tuple(c + share * d for c, d in zip(wall.center, way, strict=True))
            along = (-way[1] / norm(way), way[0] / norm(way))
        else:
            near, along = foot(world, ball, wall, (x, y)), wall.tangent
        square = radius**2 - norm(minus(near, (x, y))) ** 2
        for sign in (-1, 1) if square > 0 else ():
            end = tuple(c + sign * mpmath.sqrt(square) * t for c, t in zip(near, along, strict=True))
            if wall.holds(end, world.tiny) and all(abs(c) <= most for c, most in zip(end, world.extent, strict=True)):
                ends.append((*end, height))
    return ends


def pocket_contact(world: World, ball: int, a: Segment, pocket: int, base: Real, high: Real) -> Contact:
    """Returns `next_contact` of the centre of a ball and the circle of a pocket."""
    x, y, radius = world.pockets[pocket]
    px, py = a.position_at(base)[:2]
    velocity = a.velocity_at(base)
    rounding = (0, 2 * radius * (a.noise + world.tiny * norm(velocity)), 0, 0, 0)
    gap = pair_gap((px - x, py - y), velocity[:2], a.acceleration[:2], radius)
    contact = next_contact(gap, rounding, mpmath.mpf(0), high)
    return None if contact is None else (contact[0], False)


def edge_contact(world: World, ball: int, a: Segment, number: int, base: Real, high: Real) -> Contact:
    """Returns when a ball in the air is driven off the table.

    It passes over the nose of a cushion outside the pockets, or over the rim of a pocket beyond the noses. `number` is
    the cushion, or the number of cushions plus the pocket.
    """
    position, velocity, still = a.position_at(base)[:2], a.velocity_at(base)[:2], (mpmath.mpf(0),) * 2
    pocket = number - len(world.walls)
    if pocket < 0:
        gap = wall_gap(world.walls[number], world.nose(ball)[0], position, velocity, still)
    else:
        x, y, radius = world.pockets[pocket]
        gap = [-c for c in pair_gap(minus(position, (x, y)), velocity, still, radius)]
    time = first_entry(gap, high)
    if time is None:
        return None
    place = a.position_at(base + time)
    if pocket < 0:
        leaves = world.walls[number].holds(place, world.tiny) and world.pocket_at(place) is None
    else:
        leaves = not world.is_between_noses(ball, place)
    return (time, False) if leaves else None


class FloatMotion:
    """The motion of the centre of a ball in a segment after a base time, in floats."""

    __slots__ = ("acceleration", "position", "velocity")

    def __init__(self, a: Segment, base: Real, radius: float) -> None:
        t = float(base - a.start)
        r, v, self.acceleration = (tuple(map(float, x)) for x in (a.position, a.velocity, a.acceleration))
        r = (*r[:2], *(z + radius for z in r[2:]))
        self.position = tuple(x + t * (y + t * z / 2) for x, y, z in zip(r, v, self.acceleration, strict=True))
        self.velocity = tuple(y + t * z for y, z in zip(v, self.acceleration, strict=True))

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
    offset = minus(b.position, a.position)
    velocity = tuple(v * high for v in minus(b.velocity, a.velocity))
    acceleration = tuple(x * high * high for x in minus(b.acceleration, a.acceleration))
    gap = pair_gap(offset, velocity, acceleration, reach)
    extent = a.extent(high) + b.extent(high) + reach
    return _bound(gap, MARGIN * extent * extent + 3 * reach * CONTACT_GAP, high)


def possible_wall_contact(a: FloatMotion, wall: Line | Arc, radius: float, high: float) -> float | None:
    """Returns a lower bound for the time of `wall_contact`, in the same way; the cushion is given in floats."""
    velocity = tuple(v * high for v in a.velocity[:2])
    acceleration = tuple(b * high * high for b in a.acceleration[:2])
    gap = wall_gap(wall, radius, a.position, velocity, acceleration)
    if isinstance(wall, Arc):
        extent, reach = a.extent(high) + sum(map(abs, wall.center)) + wall.radius, radius + wall.radius
        return _bound(gap, MARGIN * extent * extent + 3 * reach * CONTACT_GAP, high)
    margin = MARGIN * (a.extent(high) + sum(map(abs, wall.middle)) + radius) + 2 * CONTACT_GAP
    feet = [dot(wall.tangent, minus(a.position, wall.middle))]  # Bernstein coefficients of the place along the cushion
    feet.append(feet[0] + dot(wall.tangent, velocity) / 2)
    feet.append(2 * feet[1] - feet[0] + dot(wall.tangent, acceleration) / 2)
    most = wall.half + radius + margin  # with the ends of noses, which a ball may touch from beyond
    if min(feet) > most or max(feet) < -most:
        return None
    return _bound([*gap, 0.0, 0.0], margin, high)


def possible_pocket_contact(a: FloatMotion, pocket: Vector, high: float) -> float | None:
    """Returns a lower bound for the time of `pocket_contact`, in the same way; the pocket is given in floats."""
    x, y, radius = pocket
    velocity = tuple(v * high for v in a.velocity[:2])
    acceleration = tuple(b * high * high for b in a.acceleration[:2])
    gap = pair_gap(minus(a.position, (x, y)), velocity, acceleration, radius)
    extent = a.extent(high) + abs(x) + abs(y) + radius
    return _bound(gap, MARGIN * extent * extent, high)
