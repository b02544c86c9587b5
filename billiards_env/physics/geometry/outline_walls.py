"""The cushions of an outline: straight cushions and tips, the arcs at their ends. See `walls.Walls`.

Their order is that of `billiards_env.scene.outline.pieces`. An arc and the cushions at its ends have common tangents.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from billiards_env.jit import inlined, kernel
from billiards_env.physics.elementary import norm
from billiards_env.physics.geometry.contact import (
    IMPULSE_ROUNDING,
    MARGIN,
    circle_time,
    line_time,
    misses_circle,
    sweep,
)
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
    RAIL_FROM,
    RAIL_LINE,
    RAIL_SIDE,
    RAIL_TO,
    TIP_RADIUS,
    TIP_X,
    TIP_Y,
    TX,
    TY,
    Outline,
    Walls,
    exit_time,
    faces,
    tip_circle,
)
from billiards_env.physics.motion import path_of, place_after
from billiards_env.physics.state import X, Y
from billiards_env.scene import CONTACT_GAP
from billiards_env.scene.outline import Corner, Line, Tip, pieces


def outline_arrays(
    corners: Sequence[Corner], half_length: float, half_width: float, places: Sequence[Sequence[float]] = ()
) -> Outline:
    """Returns the arrays of an outline.

    Args:
        corners: The corners of the outline.
        half_length: Half the length of the table, m. If a cushion reaches into the table's rectangle, the box is empty.
        half_width: m.
        places: (p, 2) the places of the pockets, m.
    """
    lines, tips = pieces(corners)
    rows = []
    for (x0, y0, x1, y1), corner, after in zip(lines, corners, (*corners[1:], corners[0]), strict=True):
        dx, dy = after.x - corner.x, after.y - corner.y
        length = math.sqrt(dx * dx + dy * dy)
        tx, ty = dx / length, dy / length
        half = 0.5 * math.sqrt((x1 - x0) * (x1 - x0) + (y1 - y0) * (y1 - y0))
        rows.append((0.5 * (x0 + x1), 0.5 * (y0 + y1), tx, ty, ty, -tx, half if half > 0.5 * JOINT else -1.0))
    before = {line[2:]: row for line, row in zip(lines, rows, strict=True)}
    behind = {line[:2]: row for line, row in zip(lines, rows, strict=True)}
    arcs = [(*tip[:3], *before[tip[3:5]][TX : TY + 1], *behind[tip[5:]][TX : TY + 1]) for tip in tips]
    box = (half_length, half_width)
    if any(_reaches_into(line, *box) for line in lines) or any(_tip_reaches_into(tip, *box) for tip in tips):
        box = (0.0, 0.0)
    rails = []
    for k, line in enumerate(lines):
        for side in range(4):
            axis = side // 2
            place = box[axis] if side % 2 else -box[axis]
            if line[axis] == line[2 + axis] == place:
                along = sorted((line[1 - axis], line[3 - axis]))
                rails.append((side, *along, k))
    return Outline(
        np.array(rows),
        np.array(arcs).reshape(-1, 7),
        np.array(box),
        np.array(rails).reshape(-1, 4),
        np.array([_mouth(tips, x, y) for x, y in places], np.int64).reshape(-1, 2),
        np.array(lines).reshape(-1, 2),
    )


def _mouth(tips: list[Tip], x: float, y: float) -> tuple[int, int]:
    """Returns the tips that are nearest to a pocket's centre on the right and on the left; -1 for none."""
    nearest, distance = [-1, -1], [math.inf, math.inf]
    for k, tip in enumerate(tips):
        dx, dy = tip.x - x, tip.y - y
        left = int(x * dy - y * dx > 0.0)
        if math.hypot(dx, dy) < distance[left]:
            nearest[left], distance[left] = k, math.hypot(dx, dy)
    return nearest[0], nearest[1]


def _reaches_into(line: Line, half_length: float, half_width: float) -> bool:
    """Returns whether a straight cushion has points inside a rectangle (Liang and Barsky 1984)."""
    begin, end = 0.0, 1.0
    for start, stop, half in ((line.x0, line.x1, half_length), (line.y0, line.y1, half_width)):
        way = stop - start
        if way == 0.0:
            if abs(start) >= half:
                return False
            continue
        near, far = sorted(((-half - start) / way, (half - start) / way))
        begin, end = max(begin, near), min(end, far)
    return begin < end


def _tip_reaches_into(tip: Tip, half_length: float, half_width: float) -> bool:
    """Returns whether the circle of a tip has points inside a rectangle, apart from the rounding of its centre."""
    dx, dy = max(0.0, abs(tip.x) - half_length), max(0.0, abs(tip.y) - half_width)
    return math.hypot(dx, dy) < tip.radius - 0.1 * CONTACT_GAP


@inlined
def time(path, radius, end, scene):
    """Implements `Walls.time`.

    A ball in the outline's box touches no cushion before it leaves the box. If it leaves it at a rail, it touches the
    rail.
    """
    outline = scene.outline
    room_x, room_y = outline.box[X] - radius, outline.box[Y] - radius
    leaves, side = exit_time(path, room_x, room_y, end)
    if abs(path.x) <= room_x + CONTACT_GAP and abs(path.y) <= room_y + CONTACT_GAP:
        if leaves == math.inf:
            return math.inf, -1
        x, y = place_after(path, leaves)
        along = y if side < 2 else x
        rails = outline.rails
        for k in range(len(rails)):
            if rails[k, RAIL_SIDE] == side and rails[k, RAIL_FROM] < along < rails[k, RAIL_TO]:
                number = int(rails[k, RAIL_LINE])
                t = _segment_time(path, radius, end, outline.lines[number])
                # The two times differ by the rounding of the gap. If the ball accelerates from rest into the rail, this
                # is large enough for another cushion to come first.
                if t <= (1.0 + MARGIN) * leaves:
                    return t, number
    return any_wall_time(path, radius, end, outline)


@kernel
def any_wall_time(path, radius, end, outline):
    """Returns the time of the next contact with an outline, s, and a cushion of it, by a test of all cushions."""
    first, number = math.inf, -1
    lines, tips = outline.lines, outline.tips
    for k in range(len(lines)):
        t = _segment_time(path, radius, end, lines[k])
        if t < first:
            first, number, end = t, k, t
    swept, noise = sweep(path, end), IMPULSE_ROUNDING * norm(path.vx, path.vy)
    for k in range(len(tips)):
        from_tip, reach = tip_circle(path, tips[k], radius)
        if misses_circle(from_tip, swept, reach):
            continue
        t = circle_time(from_tip, reach, end, noise)
        if t >= first:
            continue
        x, y = place_after(path, t)
        if faces(tips[k], x, y):
            first, number = t, len(lines) + k
    return first, number


@inlined
def _segment_time(path, radius, end, line):
    """Returns the time at which a ball next touches a straight cushion, s, or infinity."""
    x, y, vx, vy, ax, ay = path
    v, a = line[NX] * vx + line[NY] * vy, line[NX] * ax + line[NY] * ay
    if v <= 0.0 and a <= 0.0:
        return math.inf
    dx, dy = x - line[LINE_X], y - line[LINE_Y]
    gap = -(line[NX] * dx + line[NY] * dy) - radius
    if gap > (1.0 + MARGIN) * end * (max(v, 0.0) + 0.5 * end * max(a, 0.0)) and gap > 0.0:
        return math.inf
    if gap <= CONTACT_GAP:  # the rounding of a motion along the cushion is no approach
        v = 0.0 if abs(v) <= IMPULSE_ROUNDING * norm(vx, vy) else v
        a = 0.0 if abs(a) <= IMPULSE_ROUNDING * norm(ax, ay) else a
    foot = line[TX] * dx + line[TY] * dy
    if gap > 0.0 or (gap > -radius and abs(foot) <= line[HALF_LINE] + JOINT):
        t = line_time(gap, v, a, end)
    else:  # beyond the straight continuation of the cushion: the ball comes back across it first
        disc = v * v + 2.0 * a * gap
        t = (math.sqrt(disc) - v) / a if v < 0.0 and a > 0.0 and disc > 0.0 else math.inf
        t = t if t <= end else math.inf
    if t < math.inf:
        along, bend = line[TX] * vx + line[TY] * vy, line[TX] * ax + line[TY] * ay
        if abs(foot + t * (along + 0.5 * t * bend)) > line[HALF_LINE] + JOINT:
            return math.inf
    return t


@inlined
def normal(x, y, wall, scene):
    """Implements `Walls.normal`."""
    return piece_normal(x, y, wall, scene.outline)


@kernel
def piece_normal(x, y, wall, outline):
    """Returns the unit normal of a piece of an outline at a ball at (x, y), m, which points into the cushion."""
    lines, tips = outline.lines, outline.tips
    if wall < len(lines):
        return lines[wall, NX], lines[wall, NY]
    tip = tips[wall - len(lines)]
    dx, dy = tip[TIP_X] - x, tip[TIP_Y] - y
    if dx == 0.0 and dy == 0.0:  # at the centre of the arc: its middle decides
        dx, dy = tip[BEGIN_TY] + tip[END_TY], -(tip[BEGIN_TX] + tip[END_TX])
    distance = norm(dx, dy)
    return dx / distance, dy / distance


@inlined
def met(state, i, wall, scene):
    """Implements `Walls.met`."""
    outline, radius = scene.outline, scene.radius[i]
    past_x = abs(state.rows[i, X]) - (outline.box[X] - radius)
    past_y = abs(state.rows[i, Y]) - (outline.box[Y] - radius)
    if min(past_x, past_y) < -CONTACT_GAP and max(past_x, past_y) <= CONTACT_GAP:  # at one side of the box
        return wall, -1
    return _met_anywhere(path_of(state, i), wall, radius, outline)


@kernel
def _met_anywhere(path, wall, radius, outline):
    """Implements `met` for a ball at any place."""
    x, y, vx, vy, ax, ay = path
    if not _touches_another(x, y, wall, radius, outline):
        return wall, -1
    one, two = _walls_around(path, vx, vy, wall, radius, outline)
    if one < 0:
        one, two = _walls_around(path, ax, ay, wall, radius, outline)
    if two < 0:
        return (wall if one < 0 else one), -1
    (nx, ny), (mx, my) = piece_normal(x, y, one, outline), piece_normal(x, y, two, outline)
    if (abs(nx), nx * vx + ny * vy, two) > (abs(mx), mx * vx + my * vy, one):
        return one, two
    return two, one


@inlined
def _walls_around(path, dx, dy, wall, radius, outline):
    """Returns the cushions with the normals on both sides of the direction (dx, dy), or one and -1, or -1 and -1.

    The ball must touch them and not leave them. `wall` counts as one that it touches.
    """
    x, y, vx, vy, _, _ = path
    mx, my = piece_normal(x, y, wall, outline)
    still, noise = IMPULSE_ROUNDING * norm(vx, vy), IMPULSE_ROUNDING * norm(dx, dy)
    left, right, left_ahead, right_ahead = -1, -1, noise, noise
    for k in range(len(outline.lines) + len(outline.tips)):
        if k != wall and not _touches(x, y, k, radius, outline):
            continue
        nx, ny = piece_normal(x, y, k, outline)
        if k != wall and radius * norm(nx - mx, ny - my) <= JOINT:  # the ends of two pieces touch it at one point
            continue
        ahead, side = nx * dx + ny * dy, dx * ny - dy * nx
        if ahead <= noise or nx * vx + ny * vy < -still:
            continue
        if abs(side) <= noise:
            return k, -1
        if side > 0.0 and ahead > left_ahead:
            left, left_ahead = k, ahead
        elif side < 0.0 and ahead > right_ahead:
            right, right_ahead = k, ahead
    return (left, right) if left >= 0 else (right, -1)


@inlined
def _touches(x, y, wall, radius, outline):
    """Returns whether a ball at (x, y), m, is nearer to a piece of an outline than `CONTACT_GAP`."""
    if wall < len(outline.lines):
        line = outline.lines[wall]
        dx, dy = x - line[LINE_X], y - line[LINE_Y]
        gap = -(line[NX] * dx + line[NY] * dy) - radius
        return gap <= CONTACT_GAP and gap > -radius and abs(line[TX] * dx + line[TY] * dy) <= line[HALF_LINE] + JOINT
    tip = outline.tips[wall - len(outline.lines)]
    dx, dy, reach = tip[TIP_X] - x, tip[TIP_Y] - y, tip[TIP_RADIUS] + radius + CONTACT_GAP
    return dx * dx + dy * dy <= reach * reach and faces(tip, x, y)


@inlined
def _touches_another(x, y, wall, radius, outline):
    """Returns whether a ball that touches `wall` touches another piece of an outline."""
    touches = False
    for k in range(len(outline.lines) + len(outline.tips)):
        touches = touches or (k != wall and _touches(x, y, k, radius, outline))
    return touches


@inlined
def overlap(x, y, radius, wall, scene):
    """Implements `Walls.overlap`.

    A ball overlaps a cushion if its centre is nearer than its radius to the cushion, or outside the outline. If it is
    outside, it overlaps the nearest cushion only, at whatever depth.
    """
    return _piece_overlap(x, y, radius, wall, _distance_outside(x, y, scene.outline), scene.outline)


@inlined
def next_overlap(x, y, vx, vy, radius, turn, scene):
    """Implements `Walls.next_overlap`: each of three calls returns the next cushion that the ball does not leave."""
    return _next_piece(x, y, vx, vy, radius, scene.outline) if turn < 3 else -1


@kernel
def _next_piece(x, y, vx, vy, radius, outline):
    """Returns the next piece of an outline that a ball overlaps and does not leave, or -1.

    Of several cushions the one whose normal is nearest to the x axis comes first, then the deepest overlap.
    """
    outside = _distance_outside(x, y, outline)
    first, widest, deepest = -1, -1.0, 0.0
    for wall in range(len(outline.lines) + len(outline.tips)):
        beyond, nx, ny = _piece_overlap(x, y, radius, wall, outside, outline)
        if beyond <= 0.0 or nx * vx + ny * vy < 0.0:
            continue
        if abs(nx) > widest or (abs(nx) == widest and beyond > deepest):
            first, widest, deepest = wall, abs(nx), beyond
    return first


@kernel
def _distance_outside(x, y, outline):
    """Returns the distance of a point outside the outline from it, m; 0 for a point inside the polygon `ends`.

    The area between an arc and its chord belongs to the polygon, but `_piece_overlap` does not need its distance.
    """
    ends, inside = outline.ends, False
    x0, y0 = ends[-1, X], ends[-1, Y]
    for k in range(len(ends)):
        x1, y1 = ends[k, X], ends[k, Y]
        if (y0 > y) != (y1 > y) and x < x0 + (x1 - x0) * ((y - y0) / (y1 - y0)):
            inside = not inside
        x0, y0 = x1, y1
    if inside:
        return 0.0
    nearest = math.inf
    for line in outline.lines:
        if line[HALF_LINE] > 0.0:
            nearest = min(nearest, _line_distance(x, y, line))
    for tip in outline.tips:
        if faces(tip, x, y):
            nearest = min(nearest, abs(norm(x - tip[TIP_X], y - tip[TIP_Y]) - tip[TIP_RADIUS]))
    return nearest


@inlined
def _line_distance(x, y, line):
    """Returns the distance of a point from a straight cushion with its ends, m."""
    dx, dy = x - line[LINE_X], y - line[LINE_Y]
    past = max(0.0, abs(line[TX] * dx + line[TY] * dy) - line[HALF_LINE])
    return norm(past, line[NX] * dx + line[NY] * dy)


@kernel
def _piece_overlap(x, y, radius, wall, outside, outline):
    """Returns how far a ball, whose centre is `outside` (m) beyond the outline, overlaps a piece, m, and the normal."""
    lines, tips = outline.lines, outline.tips
    nx, ny = piece_normal(x, y, wall, outline)
    if wall < len(lines):
        line = lines[wall]
        dx, dy = x - line[LINE_X], y - line[LINE_Y]
        beyond = nx * dx + ny * dy
        if outside > 0.0:
            hits = line[HALF_LINE] > 0.0 and beyond > 0.0 and _line_distance(x, y, line) <= outside + CONTACT_GAP
        else:
            hits = -radius < beyond <= 0.0 and abs(line[TX] * dx + line[TY] * dy) <= line[HALF_LINE]
        return (beyond + radius if hits else 0.0), nx, ny
    tip = tips[wall - len(lines)]
    distance = norm(tip[TIP_X] - x, tip[TIP_Y] - y)
    hits = faces(tip, x, y) and (outside == 0.0 or abs(distance - tip[TIP_RADIUS]) <= outside + CONTACT_GAP)
    return (tip[TIP_RADIUS] + radius - distance if hits else 0.0), nx, ny


@inlined
def deepest_overlap(x, y, radius, scene):
    """Implements `Walls.deepest_overlap`."""
    return _deepest_piece(x, y, radius, scene.outline)


@kernel
def _deepest_piece(x, y, radius, outline):
    """Implements `deepest_overlap`.

    If the centre is within `CONTACT_GAP` of an outline, rounding decides on which side it is, so both sides count.
    """
    deepest, cushion, outside = CONTACT_GAP, -1, _distance_outside(x, y, outline)
    for wall in range(len(outline.lines) + len(outline.tips)):
        for side in (outside if outside > CONTACT_GAP else 0.0, max(outside, CONTACT_GAP)):
            beyond, _, _ = _piece_overlap(x, y, radius, wall, side, outline)
            if beyond > deepest:
                deepest, cushion = beyond, wall
    return cushion


@inlined
def back_to(x, y, radius, wall, scene):
    """Implements `Walls.back_to`."""
    return _back_to_piece(x, y, radius, wall, scene.outline)


@kernel
def _back_to_piece(x, y, radius, wall, outline):
    """Returns the position at which a ball that overlaps a piece, at (x, y), touches its nearest point."""
    lines, tips = outline.lines, outline.tips
    nx, ny = piece_normal(x, y, wall, outline)
    if wall < len(lines):
        line = lines[wall]
        foot = line[TX] * (x - line[LINE_X]) + line[TY] * (y - line[LINE_Y])
        foot = max(-line[HALF_LINE], min(foot, line[HALF_LINE]))
        return line[LINE_X] + foot * line[TX] - radius * nx, line[LINE_Y] + foot * line[TY] - radius * ny
    tip = tips[wall - len(lines)]
    reach = tip[TIP_RADIUS] + radius
    return tip[TIP_X] - reach * nx, tip[TIP_Y] - reach * ny


OUTLINE = Walls(time, normal, met, overlap, next_overlap, deepest_overlap, back_to)
