"""The times at which a ball touches a ball, a cushion or a pocket.

The next contact is the next time at which the two bodies touch *and approach*. If they touch now, the polynomial has a
root at t = 0, which is divided out. Times are measured from now. A time is infinite if there is no contact until the
end of the interval.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from billiards_env.jit import inlined, kernel
from billiards_env.physics.elementary import norm
from billiards_env.physics.geometry.roots import first_descent

MARGIN = 1e-6
"""Relative margin of the tests that exclude bodies which a path does not reach."""

TINY = 1e-290
"""Squares below it lose digits."""

# If the rounding that a plastic impact leaves counted as an approach, the impact would repeat without end.
IMPULSE_ROUNDING = 2.0**-48
"""Relative rounding of a velocity after several impulses. A plastic impact leaves a normal velocity of about this size,
of either sign."""


@inlined
def distance_to_segment(ax, ay, bx, by, x, y):
    """Returns the distance of the point (x, y) from the segment from (ax, ay) to (bx, by), m."""
    sx, sy, to_x, to_y = bx - ax, by - ay, x - ax, y - ay
    along = min(max((to_x * sx + to_y * sy) / max(sx * sx + sy * sy, 1e-300), 0.0), 1.0)
    return norm(to_x - along * sx, to_y - along * sy)


@kernel
def circle_time(path, reach, end, noise):
    """Returns the time at which the distance of two centres next falls to `reach`.

    The relative position is d + w t + b t^2 / 2, so the squared distance minus reach^2 is a quartic in t.

    Args:
        path: The `Path` of one centre relative to the other.
        reach: Distance of the centres at contact, m.
        end: End of the interval, s; finite unless b is zero.
        noise: Rounding of the relative velocity, m/s. Bodies that touch and approach no faster do not count as
            approaching.

    Returns:
        The time of the next contact, s, or infinity.
    """
    dx, dy, wx, wy, bx, by = path
    distance = norm(dx, dy)
    c0 = (distance - reach) * (distance + reach)
    dw = dx * wx + dy * wy
    if c0 <= 0.0 and abs(dw) <= noise * distance:
        dw = 0.0
    ww = wx * wx + wy * wy
    if bx == 0.0 and by == 0.0:
        # Straight lines: the impact parameter |d x w| / |w| gives the discriminant without loss of digits far away.
        if dw >= 0.0:
            return math.inf
        if c0 <= 0.0:
            return 0.0
        side = abs(dx * wy - dy * wx)
        push = reach * math.sqrt(ww)
        if side >= push:
            return math.inf
        t = c0 / (math.sqrt((push - side) * (push + side)) - dw)
        return t if t <= end else math.inf
    c2 = ww + (dx * bx + dy * by)
    c3 = wx * bx + wy * by
    t = _contact_root(c0, 2.0 * dw, c2, c3, 0.25 * (bx * bx + by * by), end, ww)
    if 0.0 < t < math.inf:
        # The constant term of the quartic has the rounding error of d^2. One Newton step on the gap removes it. If the
        # bodies hardly approach, there is no step, because it would divide the rounding of the gap by almost zero.
        px = dx + t * (wx + 0.5 * t * bx)
        py = dy + t * (wy + 0.5 * t * by)
        ux, uy = wx + t * bx, wy + t * by
        distance = norm(px, py)
        closing = (px * ux + py * uy) / distance
        if closing < -1e-6 * (abs(ux) + abs(uy)):
            t = max(0.0, t - (distance - reach) / closing)
    return t


@inlined
def _contact_root(c0, c1, c2, c3, c4, end, ww):
    """Returns the time at which two bodies next touch, s, if their squared distance beyond contact is a quartic.

    `ww` is the square of the relative speed.
    """
    if c0 > 0.0:
        return first_descent(c0, c1, c2, c3, c4, end)
    if c1 < 0.0:
        return 0.0
    if c1 > 0.0:
        return first_descent(c1, c2, c3, c4, 0.0, end)
    if c2 < 0.0:
        return 0.0
    if c2 > 0.0:
        return first_descent(c2, c3, c4, 0.0, 0.0, end)
    return 0.0 if c3 < 0.0 and ww > 0.0 else math.inf  # ww may have underflowed


@kernel
def sphere_time(path, rise, reach, end, noise):
    """Returns the time at which the distance of two centres in space next falls to `reach`, s, or infinity.

    `rise` is the relative height z + v t + a t^2 / 2 as (z, v, a), and `end` is finite. The other arguments are those
    of `circle_time`.
    """
    (dx, dy, wx, wy, bx, by), (dz, wz, bz) = path, rise
    distance = math.sqrt(dx * dx + dy * dy + dz * dz)
    c0 = (distance - reach) * (distance + reach)
    dw = dx * wx + dy * wy + dz * wz
    if c0 <= 0.0 and abs(dw) <= noise * distance:
        dw = 0.0
    ww = wx * wx + wy * wy + wz * wz
    c2 = ww + (dx * bx + dy * by + dz * bz)
    c3 = wx * bx + wy * by + wz * bz
    t = _contact_root(c0, 2.0 * dw, c2, c3, 0.25 * (bx * bx + by * by + bz * bz), end, ww)
    if 0.0 < t < math.inf:  # one Newton step, as in `circle_time`
        px, py, pz = dx + t * (wx + 0.5 * t * bx), dy + t * (wy + 0.5 * t * by), dz + t * (wz + 0.5 * t * bz)
        ux, uy, uz = wx + t * bx, wy + t * by, wz + t * bz
        distance = math.sqrt(px * px + py * py + pz * pz)
        closing = (px * ux + py * uy + pz * uz) / distance
        if closing < -1e-6 * (abs(ux) + abs(uy) + abs(uz)):
            t = max(0.0, t - (distance - reach) / closing)
    return t


@kernel
def line_time(gap, v, a, end):
    """Returns the time at which a coordinate with the velocity v + a t next reaches a line at distance `gap`.

    Args:
        gap: Distance to the line, m; <= 0 at the line or beyond it.
        v: Velocity towards it, m/s.
        a: Acceleration towards it, m/s^2.
        end: End of the interval, s.

    Returns:
        The next time at which it is at the line and moves or accelerates across it, s, or infinity.
    """
    if v <= 0.0 and a <= 0.0:
        return math.inf
    if gap > 0.0:
        disc = v * v + 2.0 * a * gap
        if disc < 0.0:
            return math.inf
        root = math.sqrt(disc)
        t = 2.0 * gap / (v + root) if v > 0.0 else (root - v) / a
    elif v >= 0.0:
        t = 0.0
    else:
        t = -2.0 * v / a
    return t if t <= end else math.inf


class Sweep(NamedTuple):
    """Bounds on a path until a time, for `misses_circle`.

    Attributes:
        bend: Distance of the path's end from its tangent, times the speed, m^2/s.
        speed_squared: Square of the speed, raised by a margin, m^2/s^2.
        most_dx: Largest change of x along the path, m.
        most_dy: Largest change of y along the path, m.
    """

    bend: Any
    speed_squared: Any
    most_dx: Any
    most_dy: Any


@inlined
def sweep(path, end):
    """Returns the `Sweep` of a `Path` until `end`, s."""
    _, _, vx, vy, ax, ay = path
    return Sweep(
        0.5 * end * end * abs(vx * ay - vy * ax),
        (1.0 + MARGIN) * (vx * vx + vy * vy),
        end * (abs(vx) + 0.5 * end * abs(ax)),
        end * (abs(vy) + 0.5 * end * abs(ay)),
    )


@inlined
def misses_circle(path, swept, reach):
    """Returns whether a path does not reach a circle. False does not mean that the path reaches it.

    It has no branches, because they are hard to predict.

    Args:
        path: The `Path` relative to the centre of the circle.
        swept: The path's `Sweep`.
        reach: Radius of the circle, m.
    """
    side = abs(path.x * path.vy - path.y * path.vx) - swept.bend
    passes = (side > 0.0) & (side * side > reach * reach * swept.speed_squared + TINY)
    wide = (1.0 + MARGIN) * reach
    return passes | (abs(path.x) > wide + swept.most_dx) | (abs(path.y) > wide + swept.most_dy)
