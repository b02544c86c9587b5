"""The distance of balls from an outline, computed without the functions of the engine."""

from __future__ import annotations

import math

from billiards_env.jit import kernel
from billiards_env.physics.state import X, Y
from billiards_env.physics.walls import BEGIN_TX, BEGIN_TY, END_TX, END_TY, TIP_RADIUS, TIP_X, TIP_Y


@kernel
def beyond_outline(x, y, radius, outline):
    """Returns the distance by which a ball at (x, y) overlaps the nearest cushion, m; negative if it overlaps none."""
    ends, inside, nearest = outline.ends, False, math.inf
    x0, y0 = ends[-1, X], ends[-1, Y]
    for k in range(len(ends)):
        x1, y1 = ends[k, X], ends[k, Y]
        if (y0 > y) != (y1 > y) and x < x0 + (x1 - x0) * ((y - y0) / (y1 - y0)):
            inside = not inside
        dx, dy = x1 - x0, y1 - y0
        square = dx * dx + dy * dy
        if k % 2 == 1 and square > 0.0:  # a straight cushion, not the chord of an arc
            share = min(max(((x - x0) * dx + (y - y0) * dy) / square, 0.0), 1.0)
            px, py = x - (x0 + share * dx), y - (y0 + share * dy)
            nearest = min(nearest, math.sqrt(px * px + py * py))
        x0, y0 = x1, y1
    for k in range(len(outline.tips)):
        tip = outline.tips[k]
        dx, dy = x - tip[TIP_X], y - tip[TIP_Y]
        if dx * tip[BEGIN_TX] + dy * tip[BEGIN_TY] >= 0.0 and dx * tip[END_TX] + dy * tip[END_TY] <= 0.0:
            distance = math.sqrt(dx * dx + dy * dy) - tip[TIP_RADIUS]
            nearest = min(nearest, abs(distance))
            inside = inside and distance >= 0.0  # the table does not reach into the circle of a tip
    return radius - nearest if inside else radius + nearest
