"""When a ball meets a ball, a cushion or a pocket.

All times count from now; infinity means not before the end of the interval asked for. The rule throughout is that the
next contact is the next time at which the two are touching *and approaching*: at a distance of zero the known root at
t = 0 is divided out of the polynomial instead of being stepped over.
"""

from __future__ import annotations

import math

from billiards_env.physics.jit import kernel
from billiards_env.physics.motion import norm
from billiards_env.physics.roots import first_descent


@kernel
def circle_time(dx, dy, wx, wy, bx, by, reach, end, noise):
    """When two centres come within `reach` of each other.

    With the relative position d + w t + b t^2 / 2, the squared distance less reach^2 is a quartic.

    Args:
        dx: Relative position, m.
        dy: See dx.
        wx: Relative velocity, m/s.
        wy: See wx.
        bx: Relative acceleration, m/s^2.
        by: See bx.
        reach: Distance of the centres at contact, m.
        end: Interval looked at, s; finite.
        noise: Rounding of the relative velocity, m/s; what touches and moves no faster than that does not approach.

    Returns:
        The time of the next contact, s, or infinity.
    """
    distance = norm(dx, dy)
    c0 = (distance - reach) * (distance + reach)
    dw = dx * wx + dy * wy
    if c0 <= 0.0 and abs(dw) <= noise * distance:
        dw = 0.0
    ww = wx * wx + wy * wy
    if bx == 0.0 and by == 0.0:
        # Straight lines: the discriminant from the impact parameter |d x w| / |w|, which loses no digits far away.
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
    c1 = 2.0 * dw
    c2 = ww + (dx * bx + dy * by)
    c3 = wx * bx + wy * by
    c4 = 0.25 * (bx * bx + by * by)
    if c0 > 0.0:
        t = first_descent(c0, c1, c2, c3, c4, end)
    elif c1 < 0.0:
        return 0.0
    elif c1 > 0.0:
        t = first_descent(c1, c2, c3, c4, 0.0, end)
    elif c2 < 0.0:
        return 0.0
    elif c2 > 0.0:
        t = first_descent(c2, c3, c4, 0.0, 0.0, end)
    else:
        return 0.0 if c3 < 0.0 and ww > 0.0 else math.inf  # ww may have underflowed
    if t < math.inf:
        # The quartic's constant term carries the rounding of d^2; one Newton step on the gap itself takes it out. Where
        # the two hardly close in, the step would be the gap's own rounding divided by next to nothing: none is taken.
        px = dx + t * (wx + 0.5 * t * bx)
        py = dy + t * (wy + 0.5 * t * by)
        ux, uy = wx + t * bx, wy + t * by
        distance = norm(px, py)
        closing = (px * ux + py * uy) / distance
        if closing < -1e-6 * (abs(ux) + abs(uy)):
            t = max(0.0, t - (distance - reach) / closing)
    return t


@kernel
def line_time(gap, v, a, end):
    """When a coordinate moving at v + a t has covered `gap`.

    Args:
        gap: Distance to the line, m.
        v: Velocity towards it, m/s.
        a: Acceleration towards it, m/s^2.
        end: Interval looked at, s.

    Returns:
        The time at which it next touches the line and moves, or is pressed, beyond it, s, or infinity.
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
