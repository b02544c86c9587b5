"""Placement of balls during a game: spotted balls, racks and the cue ball in hand.

A placed ball keeps a gap of at least `PLACING_GAP` to other balls, cushions and pockets, or of `SPOT_GAP` on the spots
of snooker. A spotted ball of pool may touch object balls. The computation uses only `+ - * /` and `sqrt` of doubles, so
IEEE 754 defines the bits of a point.

The kernels read `table`, a `PlacementNumbers`, and change `positions`, those of all balls of one game, (n, 2) m. Sets
of balls are bit masks. A kernel that finds no room on the table returns a flag, and the functions that Python calls
then raise the ValueError `no_room`.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_env.engine.compile import cached_by_scene
from billiards_env.games.game_state import BEHIND, BREAK_AGAIN, HAND_BACK, NOT_IN_HAND, RERACK, STALEMATE
from billiards_env.jit import entry_point, inlined, kernel
from billiards_env.physics.geometry.pockets import bounding_circle
from billiards_env.physics.state import X, Y
from billiards_env.scene import CONTACT_GAP, Scene, layouts, outline
from billiards_env.scene.layouts import PLACING_GAP
from billiards_env.scene.outline import Point

SPOT_GAP = 1e-5
"""m. Smallest gap between a colour on a spot of snooker and other balls, which it must not touch."""

circle_intersections = inlined(outline.circle_intersections)

STALEMATE_TURNS = 6
"""The number of turns of each player without progress after which a stalemate may be called, see `offer_new_rack`."""

SLACK = CONTACT_GAP / 2
"""m. Tolerance for points on the boundary of the free area; rounding errors are far smaller."""


class PlacementNumbers(NamedTuple):
    """The table and the n balls of a game.

    Attributes:
        radius: (n,) float64, m.
        touching: (n, n) float64, m: the distances of the centres of balls that touch.
        pockets: (k, 3) float64: x, y, radius, m.
        half_length: Half the length of the table, m.
        half_width: m.
        head_x: x of the head string, m.
        foot_x: x of the foot spot, m.
        d_radius: Radius of the D, m; 0 for a table without a D.
        spots: (n, 2) float64, m: the spots of the balls in a layout, the rack of straight pool or the spots of snooker;
            (0, 2) without a layout.
    """

    radius: Any
    touching: Any
    pockets: Any
    half_length: float
    half_width: float
    head_x: float
    foot_x: float
    d_radius: float
    spots: Any


@cached_by_scene
def placement_numbers(scene: Scene, layout: tuple[str, ...]) -> tuple[Any, ...]:
    """Returns the `PlacementNumbers` of a scene as the argument `table` of an entry point.

    `layout` has the name of a layout and the game of `layouts.layout_plan`, if the rules use spots; else it is empty.
    It is a plain tuple, which numba unpacks faster than a NamedTuple. The same arguments return the same tuple.

    Raises:
        ValueError: If the layout does not suit the scene's balls.
    """
    table, balls = scene.table, np.arange(scene.n_balls)
    numbers = PlacementNumbers(
        radius=np.array(scene.balls.radius),
        touching=scene.balls.contact_distances(balls[:, None]),
        pockets=table.pocket_rows,
        half_length=table.length / 2,
        half_width=table.width / 2,
        head_x=table.head_x,
        foot_x=table.foot_x,
        d_radius=table.d_radius,
        spots=np.array(layouts.layout_plan(layout[0], scene, *layout[1:]).spots) if layout else np.empty((0, 2)),
    )
    return tuple(numbers)


class Area(NamedTuple):
    """The rectangle in which the centre of a ball may be placed, m.

    Attributes:
        x_low: Smallest x.
        x_high: Largest x.
        y_low: Smallest y.
        y_high: Largest y.
        d_radius: Radius of a circle around (x_high, 0) that the centre must not leave, the D; infinite without a D.
    """

    x_low: float
    x_high: float
    y_low: float
    y_high: float
    d_radius: float


class Obstacles(NamedTuple):
    """The circles that the centre of a ball must not enter: one around each of the other balls and one in each pocket.

    Attributes:
        table: The `PlacementNumbers`.
        positions: (n, 2) m.
        ball: The ball.
        others: The other balls on the table.
        touchable: The balls that the ball may touch.
        gap: The smallest gap to pockets and to the other balls, m.
    """

    table: Any
    positions: Any
    ball: int
    others: int
    touchable: int
    gap: float


class Nearest(NamedTuple):
    """The nearest free point of those tried so far: x and y, m, and the square of its distance, infinite for none."""

    x: float
    y: float
    square: float


@inlined
def area_of(table, ball, behind):
    """Returns the `Area` in which a ball may be placed on the table or, if `behind`, behind the head string.

    Behind the head string of a table with a D it is the D.
    """
    x = table.half_length - table.radius[ball] - PLACING_GAP
    y = table.half_width - table.radius[ball] - PLACING_GAP
    head, d = table.head_x, table.d_radius
    if behind and d > 0.0:
        return Area(head - d, head, -d, d, d)
    return Area(-x, head if behind else x, -y, y, math.inf)


@inlined
def cue_ball_area_of(table, state):
    """Returns the `Area` in which a cue ball in hand may be placed; `state` is a row of `Game.state_type`."""
    return area_of(table, state.cue_balls[0], state.in_hand == BEHIND)


@inlined
def contains(area, x, y):
    """Returns whether a point is in an area."""
    dx, reach = x - area.x_high, area.d_radius + SLACK
    in_d = dx * dx + y * y <= reach * reach
    return area.x_low <= x <= area.x_high and area.y_low <= y <= area.y_high and in_d


@inlined
def clipped(area, x, y):
    """Returns the point of an area nearest to a point, first in the rectangle and then in the D."""
    x, y = min(max(x, area.x_low), area.x_high), min(max(y, area.y_low), area.y_high)
    if contains(area, x, y):
        return x, y
    centre_x, centre_y = area.x_high, 0.0
    dx, dy = x - centre_x, y - centre_y
    distance = math.sqrt(dx * dx + dy * dy)
    return centre_x + area.d_radius * dx / distance, centre_y + area.d_radius * dy / distance


@inlined
def circles(obstacles):
    """Returns the range of the numbers of circles: the balls in order, then the pockets."""
    return range(len(obstacles.table.radius) + len(obstacles.table.pockets))


@inlined
def is_present(obstacles, k):
    """Returns whether there is a circle k: the ball k is on the table, or it is a pocket."""
    return k >= len(obstacles.table.radius) or obstacles.others >> k & 1 == 1


@inlined
def circle_of(obstacles, k):
    """Returns x, y and the radius of circle k, m."""
    table, n = obstacles.table, len(obstacles.table.radius)
    if k >= n:
        x, y, radius = bounding_circle(table.pockets[k - n])
        return x, y, radius + obstacles.gap
    reach = table.radius[k] + table.radius[obstacles.ball] + obstacles.gap
    if obstacles.touchable >> k & 1:
        reach = table.touching[obstacles.ball, k]
    return obstacles.positions[k, X], obstacles.positions[k, Y], reach


@kernel
def avoids(obstacles, x, y):
    """Returns whether a point is outside all circles."""
    for k in circles(obstacles):
        if is_present(obstacles, k):
            cx, cy, radius = circle_of(obstacles, k)
            dx, dy, clear = x - cx, y - cy, radius - SLACK
            if dx * dx + dy * dy < clear * clear:
                return False
    return True


@inlined
def line_intersections(centre, radius, offset):
    """Returns the coordinates, along a line at a distance `offset`, of its two intersections with a circle.

    They are NaN if the line and the circle do not meet. No area contains a point with a NaN.
    """
    half = math.sqrt(radius * radius - offset * offset)
    return centre - half, centre + half


@kernel
def nearer(nearest, x, y, goal, area, obstacles):
    """Returns a point as the `Nearest`, if it is in the area, free, and nearer to the goal, else the former one."""
    dx, dy = x - goal[0], y - goal[1]
    square = dx * dx + dy * dy
    if contains(area, x, y) and square < nearest.square and avoids(obstacles, x, y):
        return Nearest(x, y, square)
    return nearest


@kernel
def nearest_free_point(x, y, area, obstacles):
    """Returns the point nearest to (x, y) that is in an area and outside all circles, and whether there is one.

    If (x, y), clipped to the area, is free, it is the result. Otherwise the nearest free point lies on a circle: on the
    ray from its centre through the clipped point, or at an intersection with another circle, with the D or with the
    rectangle. Of several nearest points the first in this order is returned.
    """
    x, y = clipped(area, x, y)
    if avoids(obstacles, x, y):
        return x, y, True
    goal, nearest = (x, y), Nearest(x, y, math.inf)
    for i in circles(obstacles):
        if is_present(obstacles, i):
            cx, cy, radius = circle_of(obstacles, i)
            dx, dy = x - cx, y - cy
            distance = math.sqrt(dx * dx + dy * dy)
            ex, ey = 1.0, 0.0
            if distance > 0.0:
                ex, ey = dx / distance, dy / distance
            nearest = nearer(nearest, cx + radius * ex, cy + radius * ey, goal, area, obstacles)
    for i in circles(obstacles):
        if not is_present(obstacles, i):
            continue
        cx, cy, radius = circle_of(obstacles, i)
        for j in range(i + 1, len(circles(obstacles)) + 1):
            other = area.x_high, 0.0, area.d_radius  # the D is the last circle
            if j < len(circles(obstacles)):
                if not is_present(obstacles, j):
                    continue
                other = circle_of(obstacles, j)
            for u, v in circle_intersections((cx, cy, radius), other):
                nearest = nearer(nearest, u, v, goal, area, obstacles)
        for u in (area.x_low, area.x_high):
            for v in line_intersections(cy, radius, u - cx):
                nearest = nearer(nearest, u, v, goal, area, obstacles)
        for v in (area.y_low, area.y_high):
            for u in line_intersections(cx, radius, v - cy):
                nearest = nearer(nearest, u, v, goal, area, obstacles)
    for u in (area.x_low, area.x_high):
        for v in (area.y_low, area.y_high):
            nearest = nearer(nearest, u, v, goal, area, obstacles)
    return nearest.x, nearest.y, nearest.square < math.inf


@inlined
def place_cue_ball(table, positions, state, x, y):  # out: positions
    """Places the cue ball in hand at the free point nearest to (x, y), m, and returns whether there is one."""
    cue = state.cue_balls[0]
    obstacles = Obstacles(table, positions, cue, state.object_balls, 0, PLACING_GAP)
    x, y, found = nearest_free_point(x, y, cue_ball_area_of(table, state), obstacles)
    if found:
        positions[cue, X], positions[cue, Y] = x, y
    return found


@kernel
def spot_on_line(spot_x, y, obstacles):
    """Returns the free point nearest to a spot on its line along the table, and whether there is one.

    It is the spot or lies beyond it, or else in front of it. If the whole line is blocked, it is the free point nearest
    to the spot.
    """
    area = area_of(obstacles.table, obstacles.ball, False)
    foot = min(spot_x, area.x_high)
    if avoids(obstacles, foot, y):
        return foot, y, True
    beyond, in_front = math.inf, -math.inf
    for k in circles(obstacles):
        if is_present(obstacles, k):
            cx, cy, radius = circle_of(obstacles, k)
            for x in line_intersections(cx, radius, cy - y):
                if foot <= x <= area.x_high and x < beyond and avoids(obstacles, x, y):
                    beyond = x
                elif area.x_low <= x < foot and x > in_front and avoids(obstacles, x, y):
                    in_front = x
    if beyond < math.inf:
        return beyond, y, True
    if in_front > -math.inf:
        return in_front, y, True
    return nearest_free_point(foot, y, area, obstacles)


@inlined
def spot_at_foot(table, positions, balls, others, cue):  # out: positions
    """Spots balls of pool one after the other (WPA 1.4); returns a ball for which there is no room, or -1.

    A ball is placed on the long string (the table's long axis), behind the foot spot and as close to it as possible. If
    there is no room behind the foot spot, it is placed in front of it. If the whole long string is blocked, it is
    placed at the free point nearest to the foot spot. It touches an object ball that is in the way, and keeps a gap of
    `PLACING_GAP` to the cue ball `cue`. `others` are the balls on the table.
    """
    for ball in range(len(table.radius)):
        if balls >> ball & 1:
            obstacles = Obstacles(table, positions, ball, others, others & ~(1 << cue), PLACING_GAP)
            x, y, found = spot_on_line(table.foot_x, 0.0, obstacles)
            if not found:
                return ball
            positions[ball, X], positions[ball, Y] = x, y
            others |= 1 << ball
    return -1


@inlined
def spot_colours(table, positions, balls, others, cue):  # out: positions
    """Spots colours of snooker (WPBSA, section 3, rule 7); arguments and result are as in `spot_at_foot`.

    Each colour is placed on its spot. If that is occupied, it is placed on the highest free spot, the colour of the
    highest value first. If all spots are occupied, it is placed as near to its spot as possible on the line from there
    to the top cushion, or, without room there, below the spot.
    """
    n = len(table.radius)
    for ball in range(n - 1, 0, -1):
        if balls >> ball & 1 and is_spot_free(table, positions, ball, others, ball):
            positions[ball, X], positions[ball, Y] = table.spots[ball, X], table.spots[ball, Y]
            balls, others = balls & ~(1 << ball), others | 1 << ball
    for ball in range(n - 1, 0, -1):
        if balls >> ball & 1 == 0:
            continue
        spot = n - 1
        while spot >= n - 6 and not is_spot_free(table, positions, ball, others, spot):
            spot -= 1
        x, y, found = table.spots[spot, X], table.spots[spot, Y], spot >= n - 6
        if not found:
            obstacles = Obstacles(table, positions, ball, others, 0, SPOT_GAP)
            x, y, found = spot_on_line(table.spots[ball, X], table.spots[ball, Y], obstacles)
        if not found:
            return ball
        positions[ball, X], positions[ball, Y] = x, y
        others |= 1 << ball
    return -1


@inlined
def is_spot_free(table, positions, ball, others, spot):
    """Returns whether a colour can lie on the spot of a colour."""
    return avoids(Obstacles(table, positions, ball, others, 0, SPOT_GAP), table.spots[spot, X], table.spots[spot, Y])


@inlined
def touching_balls(table, positions, state):
    """Returns the object balls that touch the cue ball, as a set. A cue ball in hand touches none."""
    touching, cue = 0, state.cue_balls[0]
    for ball in range(len(table.radius)):
        if state.object_balls >> ball & 1 and state.in_hand == NOT_IN_HAND:
            dx, dy = positions[ball, X] - positions[cue, X], positions[ball, Y] - positions[cue, Y]
            if math.sqrt(dx * dx + dy * dy) - table.touching[cue, ball] <= CONTACT_GAP:
                touching |= 1 << ball
    return touching


@inlined
def rack_again(table, positions, others, cue):  # out: positions
    """Racks the object balls of straight pool again (WPA 4.4, 4.8); returns `RulesState.in_hand`.

    `others` are the object balls on the table, at most one. The potted balls are placed in a tight rack, in the order
    of their numbers. The apex is left out if one object ball is on the table. A ball is in the rack if it overlaps one
    of the places of the rack. If the last ball is in the rack, it is placed on the head spot, or on the centre spot if
    the cue ball blocks the head spot. If the cue ball is in the rack, it is in hand behind the head string; with the
    last ball there it is placed on the head spot, or on the centre spot if the last ball blocks the head spot. If both
    are in the rack, the last ball is placed at the apex.
    """
    last, head = -1, table.head_x
    for ball in range(len(table.radius)):
        if others >> ball & 1:
            last = ball
    cue_in_rack, last_in_rack = is_in_rack(table, positions, cue), last >= 0 and is_in_rack(table, positions, last)
    in_hand = BEHIND if cue_in_rack else NOT_IN_HAND
    if cue_in_rack and last_in_rack:
        last = -1
    elif last_in_rack:
        positions[last, X], positions[last, Y] = 0.0 if overlaps(table, positions, cue, head, 0.0) else head, 0.0
    elif cue_in_rack and last >= 0:
        blocked = overlaps(table, positions, last, head, 0.0)
        if blocked or positions[last, X] < head:
            positions[cue, X], positions[cue, Y], in_hand = 0.0 if blocked else head, 0.0, NOT_IN_HAND
    place = 1 if last < 0 else 2
    for ball in range(len(table.radius)):
        if ball != cue and ball != last:
            positions[ball, X], positions[ball, Y] = table.spots[place, X], table.spots[place, Y]
            place += 1
    return in_hand


@inlined
def rack_and_break(table, positions, state, kind):  # out: positions, state
    """Racks all object balls for an opening break, as `Game.without_shot`; not after "hand_back". The scores stay."""
    if kind != HAND_BACK:
        rack_again(table, positions, 0, state.cue_balls[0])
        state.object_balls, state.idle = state.balls, 0
        state.break_shot, state.in_hand = True, BEHIND


@inlined
def offer_new_rack(table, positions, state):  # out: state
    """Gives the choice "stalemate" after some shots without progress, as `Game.look`.

    In the rules the referee decides when there is no progress (WPA 1.12, WPBSA 3.16). Here each player first has three
    turns without a pot, a point or a foul, and then the three more turns that the rules give. On a table without room
    for a rack, no choice of a new rack is offered.
    """
    if len(table.spots) == 0:
        state.choices &= ~(1 << RERACK | 1 << BREAK_AGAIN)
    elif state.idle >= STALEMATE_TURNS * state.n_players:
        state.choices |= 1 << STALEMATE


@inlined
def overlaps(table, positions, ball, x, y):
    """Returns whether a ball would overlap a ball of its size at (x, y)."""
    dx, dy, reach = positions[ball, X] - x, positions[ball, Y] - y, 2.0 * table.radius[ball]
    return dx * dx + dy * dy < reach * reach


@inlined
def is_in_rack(table, positions, ball):
    """Returns whether a ball overlaps one of the places of the rack."""
    for place in range(1, len(table.spots)):
        if overlaps(table, positions, ball, table.spots[place, X], table.spots[place, Y]):
            return True
    return False


@entry_point
def limits(table, ball, behind):
    """Returns the rectangle of an `Area` as a tuple."""
    area = area_of(PlacementNumbers(*table), ball, behind)
    return area.x_low, area.x_high, area.y_low, area.y_high


@entry_point
def place_cue_balls(table, positions, states, points):
    """Places the cue ball of one game after another at the points (m, 2); returns a game without room for it, or -1."""
    for k in range(len(points)):
        if not place_cue_ball(PlacementNumbers(*table), positions[k], states[k], points[k, X], points[k, Y]):
            return k
    return -1


def placement_area(scene: Scene, ball: int, behind: bool) -> tuple[float, float, float, float]:
    """Returns the rectangle in which the centre of a ball may be placed: the limits of x and those of y, m.

    With `behind` the ball must be behind the head string. On a table with a D this is the rectangle around the D.
    """
    return limits(placement_numbers(scene, ()), ball, behind)


def cue_ball_area(scene: Scene, state: Any) -> tuple[float, float, float, float]:
    """Returns the rectangle in which the centre of a cue ball in hand may be placed, see `placement_area`."""
    return placement_area(scene, int(state.cue_balls[0]), bool(state.in_hand == BEHIND))


def cue_ball_point(scene: Scene, positions: NDArray[Any], state: Any, point: Point) -> Point:
    """Returns the free point nearest to a requested one, m, at which a cue ball in hand is placed.

    Raises:
        ValueError: If no point is free.
    """
    placed, states = np.array(positions, float)[None], np.array([state])
    if place_cue_balls(placement_numbers(scene, ()), placed, states, np.array([point], float)) >= 0:
        raise no_room(cue_ball_area(scene, state))
    x, y = placed[0, state.cue_balls[0]].tolist()
    return x, y


def no_room(area: tuple[float, float, float, float]) -> ValueError:
    """Returns the error of an area without room for a ball."""
    x_low, x_high, y_low, y_high = area
    return ValueError(f"no room for a ball in x {x_low} to {x_high} m, y {y_low} to {y_high} m: expected a free point")
