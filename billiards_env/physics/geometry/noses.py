"""The noses of the cushions, which balls in the air meet: lines and arcs at one height.

A nose is R - R cos(theta) nearer to the table than the line of its cushion, with the angle theta of `cushion.Nose`. So
a ball on the cloth that touches the cushion touches the nose too. Balls of different size have different noses. The
nose of a tip of radius r is an arc of radius q = r + R - R cos(theta). There is no nose in the circle of a pocket: a
nose ends where it meets this circle, and a ball may touch the end. A ball touches noses only from the side of the
table.

The centre of a ball at a straight nose is on a cylinder, at an end on a sphere: the time is a root of a quartic. At a
tip it is on a torus. With the horizontal distance d of the centre from the axis of the tip and its height z above the
nose, the square of the distance from the nose is

    s(t) = max(d - q, 0)^2 + z^2.

The path is straight, so d is a convex function of t, and so is the first term. The second derivative of z^2 is at least
-2 g z, so s'' >= -2 g Z, where Z >= 0 is the greatest height from now on. So after any time t, s is never below the
parabola that has the value and the slope of s at t and the second derivative -2 g Z. Each step goes to the time at
which this parabola falls to R^2, so it passes no contact. Near a contact the steps become those of Newton's method. The
search ends where the ball touches the nose, up to rounding, and approaches it. So it finds no contact where there is
none, with one exception: a ball that passes within 1e-15 m counts as one that touches.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from billiards_env.jit import inlined, kernel
from billiards_env.physics.elementary import norm
from billiards_env.physics.geometry.contact import circle_time, line_time, misses_circle, sphere_time, sweep
from billiards_env.physics.geometry.pockets import distance_from, pocket_at
from billiards_env.physics.geometry.walls import (
    BEGIN_TX,
    BEGIN_TY,
    END_TX,
    END_TY,
    HALF_LINE,
    JOINT,
    LINE_X,
    LINE_Y,
    NX,
    NY,
    TIP_RADIUS,
    TIP_X,
    TIP_Y,
    TX,
    TY,
    Outline,
    faces,
    is_beside,
    tip_circle,
)
from billiards_env.physics.motion import Path, place_after, relative_to
from billiards_env.physics.state import X, Y, Z
from billiards_env.scene import CONTACT_GAP
from billiards_env.scene.outline import circle_intersections

WALL = 7
"""The column of `Noses.lines` and `Noses.tips` with the number of the cushion, after the columns of `Outline`."""
END_WALL = 2
"""The same of `Noses.ends`."""

_TOUCH = 1e-15
"""m. A gap of this size is rounding."""


class Noses(NamedTuple):
    """The noses of a table for balls of one radius.

    Attributes:
        lines: (k, 8) float64, the straight noses, with the columns of `Outline.lines`.
        tips: (m, 8) float64, the noses of the tips, with the columns of `Outline.tips`.
        ends: (p, 3) float64, x, y (m) and the number of the cushion of each end at a pocket.
        inset: Distance of a nose from the line of its cushion, m.
        height: Height of the noses above the centre of a ball on the cloth, m.
    """

    lines: Any
    tips: Any
    ends: Any
    inset: float
    height: float


class NosesOfBalls(NamedTuple):
    """The `Noses` of n balls, one ball after the other.

    Attributes:
        lines, tips, ends: The arrays of these names in `Noses`, joined.
        bounds: (n + 1, 3) int64, the first row of each ball in each array, then the lengths of the arrays.
        inset: (n,) float64.
        height: (n,) float64.
    """

    lines: Any
    tips: Any
    ends: Any
    bounds: Any
    inset: Any
    height: Any


@inlined
def noses_of(i, scene):
    """Returns the `Noses` for ball i."""
    lines, tips, ends, bounds, inset, height = scene.noses
    a, b = bounds[i], bounds[i + 1]
    return Noses(lines[a[0] : b[0]], tips[a[1] : b[1]], ends[a[2] : b[2]], inset[i], height[i])


def nose_arrays(
    outline: Outline, radii: Sequence[float], numbers: Any, pockets: Sequence[Sequence[float]]
) -> NosesOfBalls:
    """Returns the `NosesOfBalls`.

    Args:
        outline: The `Outline`.
        radii: The radii of the balls, (n,) m.
        numbers: The `Numbers`.
        pockets: (p, 3) x, y and radius of the circles of the pockets, m.
    """
    by_radius = {radius: _noses(outline, radius, numbers, pockets) for radius in set(radii)}
    each = [by_radius[radius] for radius in radii]
    counts = [(0, 0, 0), *((len(noses.lines), len(noses.tips), len(noses.ends)) for noses in each)]
    return NosesOfBalls(
        lines=np.concatenate([noses.lines for noses in each]),
        tips=np.concatenate([noses.tips for noses in each]),
        ends=np.concatenate([noses.ends for noses in each]),
        bounds=np.cumsum(counts, axis=0),
        inset=np.array([noses.inset for noses in each]),
        height=np.array([noses.height for noses in each]),
    )


def _noses(outline: Outline, radius: float, numbers: Any, pockets: Sequence[Sequence[float]]) -> Noses:
    """Returns the `Noses` for a radius, m. The other arguments are as in `nose_arrays`."""
    sin = numbers.cushion_height / radius - 1.0
    inset = radius * (1.0 - math.sqrt(1.0 - sin * sin))
    lines, tips = outline.lines.tolist(), outline.tips.tolist()
    for line in lines:
        if line[HALF_LINE] == math.inf:  # a side of a rectangle, whose noses end where they meet
            line[HALF_LINE] = outline.box[X if line[TX] else Y] - inset
    cut = [_line_noses(row, inset, pockets) for row in lines] + [_tip_noses(row, inset, pockets) for row in tips]
    parts = [(*part, wall) for wall, (nose, _) in enumerate(cut) for part in nose]
    ends = [(*end, wall) for wall, (_, points) in enumerate(cut) for end in points]
    rows, n_lines = np.array(parts, float).reshape(-1, 8), sum(part[WALL] < len(lines) for part in parts)
    return Noses(rows[:n_lines], rows[n_lines:], np.array(ends, float).reshape(-1, 3), inset, radius * sin)


def _is_outside(pockets, x, y):
    """Returns whether a point is outside all pockets."""
    return all(math.hypot(x - px, y - py) >= reach for px, py, reach in pockets)


def _line_noses(row, inset, pockets):
    """Returns the parts of the nose of a straight cushion outside the pockets, and their ends (x, y) at pockets.

    `row` is a row of `Outline.lines`, and so are the parts.
    """
    line_x, line_y, *tangent_and_normal, half = row
    tx, ty, nx, ny = tangent_and_normal
    x, y = line_x - inset * nx, line_y - inset * ny
    marks = [-half, half]
    for px, py, reach in pockets:
        away, along = nx * (px - x) + ny * (py - y), tx * (px - x) + ty * (py - y)
        if abs(away) < reach:
            chord = math.sqrt(reach * reach - away * away)
            marks += [mark for mark in (along - chord, along + chord) if abs(mark) < half]
    parts, ends = [], []
    for a, b in itertools.pairwise(sorted(marks)):
        middle = 0.5 * (a + b)
        place = (x + middle * tx, y + middle * ty)
        if a < b and _is_outside(pockets, *place):
            parts.append((*place, *tangent_and_normal, 0.5 * (b - a)))
            ends += [(x + mark * tx, y + mark * ty) for mark in (a, b) if abs(mark) != half]
    return parts, ends


def _tip_noses(row, inset, pockets):
    """Returns the parts of the nose of a tip outside the pockets, and their ends (x, y) at pockets.

    `row` is a row of `Outline.tips`, and so are the parts.
    """
    x, y, small, begin_tx, begin_ty, end_tx, end_ty = row
    radius, first, last = small + inset, (-begin_ty, begin_tx), (-end_ty, end_tx)  # directions from the centre
    marks = []
    for pocket in pockets:
        for px, py in circle_intersections((x, y, radius), pocket):
            ux, uy = (px - x) / radius, (py - y) / radius
            if ux * begin_tx + uy * begin_ty > 0.0 > ux * end_tx + uy * end_ty:
                marks.append((-(ux * first[0] + uy * first[1]), ux, uy))
    parts, ends = [], []
    for a, b in itertools.pairwise([first, *(mark[1:] for mark in sorted(marks)), last]):
        share = radius / math.hypot(a[0] + b[0], a[1] + b[1])
        if _is_outside(pockets, x + share * (a[0] + b[0]), y + share * (a[1] + b[1])):
            parts.append((x, y, radius, a[1], -a[0], b[1], -b[0]))
            ends += [(x + radius * u[0], y + radius * u[1]) for u in (a, b) if u not in (first, last)]
    return parts, ends


@inlined
def _clip(begin, end, place, speed):
    """Returns the part of the interval [begin, end] in which place + speed t >= 0; it is empty if begin > end."""
    if speed > 0.0:
        begin = max(begin, -place / speed)
    elif speed < 0.0:
        end = min(end, -place / speed)
    elif place < 0.0:
        begin = math.inf
    return begin, end


@inlined
def _line_gap(line, x, y):
    """Returns the horizontal distance of a point from a straight nose, m; negative beyond it."""
    return -(line[NX] * (x - line[LINE_X]) + line[NY] * (y - line[LINE_Y]))


@inlined
def _line_time(path, rise, radius, end, noise, line, g):
    """Returns the time at which a ball in the air next touches a straight nose; `line` is a row of `Noses.lines`."""
    gap, speed = _line_gap(line, path.x, path.y), line[NX] * path.vx + line[NY] * path.vy
    if min(gap, gap - speed * end) > radius:
        return math.inf
    along = line[TX] * (path.x - line[LINE_X]) + line[TY] * (path.y - line[LINE_Y])
    slide, half = line[TX] * path.vx + line[TY] * path.vy, line[HALF_LINE] + JOINT
    begin, last = _clip(0.0, end, half + along, slide)
    begin, last = _clip(begin, last, half - along, -slide)
    begin, last = _clip(begin, last, gap + CONTACT_GAP, -speed)
    if begin > last:
        return math.inf
    (z, vz), away = rise, gap - speed * begin
    across = Path(away, z + begin * (vz - 0.5 * begin * g), -speed, vz - begin * g, 0.0, -g)
    if begin > 0.0 and norm(across.x, across.y) <= radius:  # the ball has touched what is next to this nose
        return math.inf
    return begin + circle_time(across, radius, last - begin, noise)


@inlined
def _tip_time(path, rise, radius, end, noise, tip, g):
    """Returns the time at which a ball in the air next touches the nose of a tip; see the top of this file.

    `path` is relative to the centre of the tip, and `tip` is a row of `Noses.tips`.
    """
    (x, y, vx, vy, _, _), (begin_tx, begin_ty) = path, (tip[BEGIN_TX], tip[BEGIN_TY])
    end_tx, end_ty = -tip[END_TX], -tip[END_TY]
    begin, last = _clip(0.0, end, x * begin_tx + y * begin_ty + JOINT, vx * begin_tx + vy * begin_ty)
    begin, last = _clip(begin, last, x * end_tx + y * end_ty + JOINT, vx * end_tx + vy * end_ty)
    t = begin
    while t <= last:
        (x, y), z, vz = place_after(path, t), rise[0] + t * (rise[1] - 0.5 * t * g), rise[1] - t * g
        d = norm(x, y)
        away = max(d - tip[TIP_RADIUS], 0.0)
        distance = norm(away, z)
        outwards = (x * vx + y * vy) / d if away > 0.0 else 0.0
        gap, slope = distance - radius, 2.0 * (away * outwards + z * vz)
        if gap <= 0.0 and t == begin > 0.0:  # the ball has touched what is next to this nose
            return math.inf
        square = max(gap, _TOUCH) * (distance + radius)
        fall = max(z + (vz * vz / (2.0 * g) if vz > 0.0 else 0.0), 0.0) * g  # g Z
        root = math.sqrt(slope * slope + 4.0 * square * fall)
        if slope >= 0.0 and fall == 0.0:
            return math.inf
        step = 2.0 * square / (root - slope) if slope < 0.0 else (root + slope) / (2.0 * fall)
        approaches = slope < -2.0 * noise * distance
        if approaches and (gap <= _TOUCH or t + step == t):
            return t
        t += step
    return math.inf


@kernel
def nose_time(path, rise, radius, end, noise, noses, g):
    """Returns the time at which a ball in the air next touches a nose, s, and the number of the cushion.

    Args:
        path: The straight `Path` of the ball.
        rise: Its height above the cloth, m, and its vertical velocity, m/s.
        radius: m.
        end: End of the interval, s.
        noise: See `circle_time`.
        noses: The `Noses`.
        g: m/s^2.

    Returns:
        (time, number); the time is infinite if the ball touches no nose until `end`.
    """
    first, wall, rise, swept = math.inf, -1, (rise[0] - noses.height, rise[1]), sweep(path, end)
    for line in noses.lines:
        t = _line_time(path, rise, radius, end, noise, line, g)
        if t < first:
            first, wall, end = t, int(line[WALL]), t
    for tip in noses.tips:
        from_tip, q = tip_circle(path, tip, 0.0)
        if not misses_circle(from_tip, swept, q + radius):
            t = _tip_time(from_tip, rise, radius, end, noise, tip, g)
            if t < first:
                first, wall, end = t, int(tip[WALL]), t
    for point in noses.ends:
        from_end = relative_to(path, point[X], point[Y])
        if not misses_circle(from_end, swept, radius):
            t = sphere_time(from_end, (rise[0], rise[1], -g), radius, end, noise)
            if t < first:
                first, wall, end = t, int(point[END_WALL]), t
    return first, wall


@inlined
def edge_time(path, end, noses):
    """Returns the time at which the centre of a ball in the air next passes over a nose, s, and the cushion.

    The time is infinite if it passes over none until `end`, s.
    """
    first, wall = math.inf, -1
    for line in noses.lines:
        gap = _line_gap(line, path.x, path.y)
        t = line_time(gap, line[NX] * path.vx + line[NY] * path.vy, 0.0, end) if gap >= -CONTACT_GAP else math.inf
        if t < first and is_beside(line, *place_after(path, t)):
            first, wall = t, int(line[WALL])
    for tip in noses.tips:
        from_tip, q = tip_circle(path, tip, 0.0)
        t = circle_time(from_tip, q, end, 0.0)
        if t < first and faces(tip, *place_after(path, t)):
            first, wall = t, int(tip[WALL])
    return first, wall


@inlined
def is_beyond_noses(x, y, noses, scene):
    """Returns whether a point is farther out than the lines of the noses, which continue across the pockets."""
    return scene.walls.deepest_overlap(x, y, noses.inset, scene) >= 0


@inlined
def falls_back(z, radius):
    """Returns whether a pocket catches a ball that leaves its circle beyond the noses, at a height of its centre, m.

    The largest height is 7/5 of a radius above the slate, as in pooltool.
    """
    return z < 0.4 * radius


@inlined
def pocket_below(x, y, radius, scene):
    """Returns the pocket that catches a ball which lands at a point, or -1.

    A ball that overlaps a cushion has come down in the mouth of a pocket, where there is no nose.
    """
    pocket, box = pocket_at(scene.pockets, x, y, 1.0), scene.outline.box
    if pocket >= 0 or (abs(x) <= box[X] - radius and abs(y) <= box[Y] - radius):
        return pocket
    if scene.walls.deepest_overlap(x, y, radius, scene) < 0:
        return -1
    nearest = math.inf
    for k in range(len(scene.pockets)):
        distance = distance_from(scene.pockets[k], x, y)
        if distance < nearest:
            pocket, nearest = k, distance
    return pocket


@inlined
def way_to_nose(x, y, wall, noses):
    """Returns the vector (x, y) from a point to the nearest point of the nose of a cushion, m; any cushion if -1."""
    nearest, way_x, way_y = math.inf, math.inf, math.inf
    for line in noses.lines:
        gap = _line_gap(line, x, y)
        if (wall < 0 or line[WALL] == wall) and is_beside(line, x, y) and gap * gap < nearest:
            nearest, way_x, way_y = gap * gap, line[NX] * gap, line[NY] * gap
    for tip in noses.tips:
        if (wall < 0 or tip[WALL] == wall) and faces(tip, x, y):
            dx, dy = tip[TIP_X] - x, tip[TIP_Y] - y
            share = 1.0 - tip[TIP_RADIUS] / norm(dx, dy)
            dx, dy = share * dx, share * dy
            if dx * dx + dy * dy < nearest:
                nearest, way_x, way_y = dx * dx + dy * dy, dx, dy
    for point in noses.ends:
        dx, dy = point[X] - x, point[Y] - y
        if (wall < 0 or point[END_WALL] == wall) and dx * dx + dy * dy < nearest:
            nearest, way_x, way_y = dx * dx + dy * dy, dx, dy
    return way_x, way_y


@inlined
def nose_normal(row, wall, noses):
    """Returns the unit normal (x, y, z) from the centre of a ball to the nose of a cushion that it touches."""
    dx, dy = way_to_nose(row[X], row[Y], wall, noses)
    below = row[Z] - noses.height
    distance = math.sqrt(dx * dx + dy * dy + below * below)
    return dx / distance, dy / distance, -below / distance


@inlined
def is_free(i, place, scene):
    """Returns whether ball i at (x, y, z) is between the noses or over a pocket, and overlaps no nose."""
    x, y, z, noses = place[X], place[Y], place[2], noses_of(i, scene)
    if is_beyond_noses(x, y, noses, scene) and pocket_at(scene.pockets, x, y, 1.0) < 0:
        return False
    dx, dy = way_to_nose(x, y, -1, noses)
    below = z - noses.height
    return math.sqrt(dx * dx + dy * dy + below * below) >= scene.radius[i] - CONTACT_GAP
