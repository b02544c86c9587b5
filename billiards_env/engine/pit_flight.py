"""What PIT does to balls in the air: at each timestep it finds landings, noses, pockets and balls off the table.

A ball that has reached the slate within the step lands at its place at the timestep, with the vertical speed at which
it reached the slate. If the centre of a ball has passed over the line of a nose, its height at this line determines
whether it has hit the nose or leaves the table. If the line is in a pocket there, the ball is potted or leaves the
table when it lands or leaves the pocket, by its height at that timestep. The way back to the line is straight. A ball
that overlaps a nose and approaches it is reflected by `contact_rule.hit_nose`. The fix "push_apart" first moves it back
along the normal of the cushion until it touches the nose. A ball that has passed the nose is moved back with any fix.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from billiards_env.engine.contact_rule import hit_nose, leaning, limits_in_space
from billiards_env.engine.log import BALL_CUSHION, BALL_POCKET, LANDING, OFF_TABLE, log_event
from billiards_env.engine.overlaps import KEEPS_PLACES, UP, UP_SPEED, fix_at_rest
from billiards_env.engine.shots import drive_off, pot
from billiards_env.jit import inlined, kernel
from billiards_env.physics.elementary import norm
from billiards_env.physics.geometry.noses import falls_back, nose_normal, pocket_below
from billiards_env.physics.geometry.pockets import pocket_at
from billiards_env.physics.laws.flight import height_after
from billiards_env.physics.motion import advance, begin_phase, height_of, land
from billiards_env.physics.state import AIRBORNE, LASTS, VX, VY, VZ, X, Y, Z, own_time, since

_INSIDE = 1e-9
"""A ball that has passed a nose is moved back to at least this distance from its line, over the radius."""


@inlined
def find_height(flight, i, t, numbers, work):  # out: work
    """Sets the height and the vertical velocity of ball i in `here`, t seconds after its own time."""
    if flight is None:
        return
    work.here[i, UP], work.here[i, UP_SPEED] = height_of(flight, work.state, i, t, numbers)


@inlined
def overlap_in_space(i, j, reach, here, scene):
    """Returns the unit normal from ball i to ball j and the speed of approach, m/s; -1 if they do not overlap.

    At a weak impact the normal is tilted as in the contact-time rule. Here the limit of a weak impact is higher than
    in the rule by the speed that a ball gains if it falls for two steps.
    """
    dx, dy, dz = here[j, X] - here[i, X], here[j, Y] - here[i, Y], here[j, UP] - here[i, UP]
    w = here[j, VX] - here[i, VX], here[j, VY] - here[i, VY], here[j, UP_SPEED] - here[i, UP_SPEED]
    distance = math.sqrt(dx * dx + dy * dy + dz * dz)
    if distance >= reach:
        return (0.0, 0.0, 0.0), -1.0
    n = (dx / distance, dy / distance, dz / distance) if distance > 0.0 else (0.0, 0.0, 1.0)
    closing, numbers = _closing(n, w), scene.numbers
    if 0.0 <= closing <= limits_in_space(n[2], numbers).speed + 2.0 * numbers.g * numbers.dt:
        n = leaning(n, (here[i, X], here[i, Y]))
        closing = max(_closing(n, w), 0.0)
    return n, closing


@inlined
def _closing(n, w):
    return -(n[0] * w[0] + n[1] * w[1] + n[2] * w[2])


@inlined
def _follow(i, work):  # out: work
    """Copies the motion of ball i from its row to `here`, and marks it as changed."""
    here, row = work.here, work.state.rows[i]
    here[i, X], here[i, Y], here[i, VX], here[i, VY] = row[X], row[Y], row[VX], row[VY]
    here[i, UP], here[i, UP_SPEED] = row[Z], row[VZ]
    work.changed[i] = True


class Crossing(NamedTuple):
    """Where the centre of a ball has passed over the line of a nose.

    Attributes:
        wall: The cushion; -1 if it has not.
        late: The time since then, s.
        x: Position along x, m.
        y: The same along y.
    """

    wall: Any
    late: Any
    x: Any
    y: Any


@inlined
def _room_between_noses(scene):
    """Returns half the length and half the width between the noses, m."""
    inset = scene.flight.inset
    return scene.numbers.half_length - inset, scene.numbers.half_width - inset


@inlined
def _crossing(i, scene, work):
    """Returns the `Crossing` of ball i."""
    x, y, vx, vy = work.here[i, X], work.here[i, Y], work.here[i, VX], work.here[i, VY]
    room_x, room_y = _room_between_noses(scene)
    wall, late = -1, 0.0
    if abs(x) >= room_x and x * vx > 0.0:
        wall, late = (1 if x > 0.0 else 0), (abs(x) - room_x) / abs(vx)
    if abs(y) >= room_y and y * vy > 0.0 and (abs(y) - room_y) / abs(vy) >= late:
        wall, late = (3 if y > 0.0 else 2), (abs(y) - room_y) / abs(vy)
    return Crossing(wall, late, x - late * vx, y - late * vy)


@inlined
def _end_of_flight(i, t, scene, work):
    """Returns what ends the flight of ball i, t seconds after its own time.

    Returns:
        The kind of event, -1 for none, and the pocket or the cushion.
    """
    row, x, y, radius = work.state.rows[i], work.here[i, X], work.here[i, Y], scene.radius[i]
    lands, crossing = t >= row[LASTS], _crossing(i, scene, work)
    if crossing.wall < 0:
        if not lands:
            return -1, -1
        pocket = pocket_below(x, y, radius, scene)
        return (LANDING, -1) if pocket < 0 else (BALL_POCKET, pocket)
    pocket = pocket_at(scene.pockets, crossing.x, crossing.y, 1.0)
    if pocket < 0:
        z, _ = height_after(row[Z], row[VZ], t - crossing.late, scene.numbers.g)
        above = z - scene.flight.height >= radius
        return (OFF_TABLE, -1) if above else (BALL_CUSHION, crossing.wall)
    if not lands and pocket_at(scene.pockets, x, y, 1.0) == pocket:
        return -1, -1
    return (BALL_POCKET, pocket) if falls_back(work.here[i, UP], radius) else (OFF_TABLE, -1)


@inlined
def end_flight(flight, i, now, k, scene, work, shots, log):  # out: work, shots, log
    """Resolves and records what has ended the flight of ball i by a `Time`. Returns whether something has.

    The position of the ball is that in `here`.
    """
    if flight is None:
        return False
    state, row, t = work.state, work.state.rows[i], since(now, own_time(work.state, i))
    kind, other = _end_of_flight(i, t, scene, work)
    if kind < 0:
        return False
    fall = row[LASTS] * scene.numbers.g - row[VZ]
    advance(state, i, now, scene.numbers)
    if kind == LANDING:
        row[VZ] = -fall
        _land(i, now, k, scene, work, shots, log)
        return True
    if kind == BALL_CUSHION:
        _move_back(i, other, scene, work)
        _hit_nose(i, other, now, k, scene, work, shots, log)
        return True
    speed = norm(row[VX], row[VY])
    if kind == BALL_POCKET:
        pot(k, i, other, state, scene, shots)
    else:
        drive_off(k, i, state, scene, shots)
    _record(kind, i, other, speed, now, k, (state, shots), log)
    _follow(i, work)
    return True


@inlined
def _record(kind, i, other, speed, now, k, records, log):  # out: records, log
    """Records an event of ball i; `records` are the `State` and the `Shots`."""
    state, shots = records
    shots.n_events[k] += 1
    shots.time[k] = now.hi
    log_event(log, now, kind, i, other, state, speed, False)


@inlined
def _land(i, now, k, scene, work, shots, log):  # out: work, shots, log
    """Changes the motion of ball i by the slate, which it touches, and records this."""
    row = work.state.rows[i]
    speed = -row[VZ]
    land(scene.flight, i, work.state, scene.numbers)
    begin_phase(work.state, i, scene.numbers)
    _follow(i, work)
    fix_at_rest(scene.numbers.fix, i, scene, work)
    _record(LANDING, i, -1, speed, now, k, (work.state, shots), log)


@inlined
def land_pressed(flight, i, now, k, scene, work, shots, log):  # out: work, shots, log
    """Lets ball i land if an impact with another ball at this `Time` presses it into the slate."""
    if flight is None:
        return
    row = work.state.rows[i]
    if row[Z] == 0.0 and row[VZ] < 0.0:
        work.state.phase[i] = AIRBORNE
        _land(i, now, k, scene, work, shots, log)


@inlined
def _move_back(i, wall, scene, work):  # out: work
    """Moves ball i along the normal of a cushion until it touches its nose, and between the other noses."""
    row, radius = work.state.rows[i], scene.radius[i]
    below = row[Z] - scene.flight.height
    touch = max(math.sqrt(max(radius * radius - below * below, 0.0)), _INSIDE * radius)
    room_x, room_y = _room_between_noses(scene)
    room_x, room_y = (room_x - touch, room_y) if wall < 2 else (room_x, room_y - touch)
    row[X], row[Y] = min(max(row[X], -room_x), room_x), min(max(row[Y], -room_y), room_y)


@kernel
def _hit_nose(i, wall, now, k, scene, work, shots, log):  # out: work, shots, log
    """Reflects ball i at the nose of a cushion and records this."""
    speed, _ = hit_nose(scene.flight, i, wall, work.state, scene)
    _follow(i, work)
    shots.cushions[k, i] += 1
    _record(BALL_CUSHION, i, wall, speed, now, k, (work.state, shots), log)


@inlined
def hit_noses(flight, i, now, k, scene, work, shots, log):  # out: work, shots, log
    """Reflects ball i, which is in the air, at the noses that it overlaps and approaches. Returns whether it does."""
    if flight is None:
        return False
    state, row, radius, has_hit = work.state, work.state.rows[i], scene.radius[i], False
    room_x, room_y = _room_between_noses(scene)
    for wall in range(4):
        sign = 1.0 if wall % 2 else -1.0
        gap = room_x - sign * work.here[i, X] if wall < 2 else room_y - sign * work.here[i, Y]
        if not 0.0 < gap < radius:
            continue
        advance(state, i, now, scene.numbers)
        nx, ny, nz = nose_normal(row, wall, flight)
        distance = gap / (sign * (nx if wall < 2 else ny))
        if not (distance < radius and nx * row[VX] + ny * row[VY] + nz * row[VZ] > 0.0):  # nan without a nose
            continue
        if scene.numbers.fix != KEEPS_PLACES and (ny if wall < 2 else nx) == 0.0:
            _move_back(i, wall, scene, work)
        _hit_nose(i, wall, now, k, scene, work, shots, log)
        has_hit = True
    return has_hit
