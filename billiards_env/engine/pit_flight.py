"""What PIT does to balls in the air: at each timestep it finds how their flights end.

The path of a ball between two timesteps is that of the exact engine, and `predictions.end_in_air` finds how it ends. A
ball that has reached the slate lands at its place at the timestep, with the vertical speed at which it reached the
slate. If a ball has passed over a nose, its height there decides: a ball that clears the nose is driven off the table,
and a lower one is put back at the nose, with any fix, and is reflected. A ball that overlaps a nose at a timestep and
approaches it is reflected by `contact_rule.hit_nose`. The fix "push_apart" first moves it away from the nose
horizontally until they touch.
"""

from __future__ import annotations

import math

from billiards_env.engine.log import BALL_CUSHION, BALL_POCKET, LANDING, OFF_TABLE
from billiards_env.engine.overlaps import KEEPS_PLACES, UP, UP_SPEED, fix_at_rest
from billiards_env.engine.pic_events import resolve_in_air, speed_of_fall
from billiards_env.engine.predictions import end_in_air
from billiards_env.engine.shots import pot, record_event
from billiards_env.jit import inlined, kernel
from billiards_env.physics.elementary import norm
from billiards_env.physics.geometry.noses import is_free, nose_normal, pocket_below, way_to_nose
from billiards_env.physics.geometry.pockets import pocket_at
from billiards_env.physics.laws.flight import height_after
from billiards_env.physics.motion import advance, begin_phase, height_of, land, path_of, place_after
from billiards_env.physics.state import AIRBORNE, LASTS, VX, VY, VZ, X, Y, Z, own_time, since

_INSIDE = 1e-9
"""A ball that touches a nose is at least this far from it horizontally, over the radius."""


@inlined
def find_height(flight, i, t, numbers, work):  # out: work
    """Sets the height and the vertical velocity of ball i in `here`, t seconds after its own time."""
    if flight is None:
        return
    work.here[i, UP], work.here[i, UP_SPEED] = height_of(flight, work.state, i, t, numbers)


@inlined
def overlap_in_space(i, j, reach, here):
    """Returns the unit normal from ball i to ball j and the speed of approach, m/s; -1 if they do not overlap."""
    dx, dy, dz = here[j, X] - here[i, X], here[j, Y] - here[i, Y], here[j, UP] - here[i, UP]
    w = here[j, VX] - here[i, VX], here[j, VY] - here[i, VY], here[j, UP_SPEED] - here[i, UP_SPEED]
    distance = math.sqrt(dx * dx + dy * dy + dz * dz)
    if distance >= reach:
        return (0.0, 0.0, 0.0), -1.0
    n = (dx / distance, dy / distance, dz / distance) if distance > 0.0 else (0.0, 0.0, 1.0)
    return n, -(n[0] * w[0] + n[1] * w[1] + n[2] * w[2])


@inlined
def _follow(i, work):  # out: work
    """Copies the motion of ball i from its row to `here`, and marks it as changed."""
    here, row = work.here, work.state.rows[i]
    here[i, X], here[i, Y], here[i, VX], here[i, VY] = row[X], row[Y], row[VX], row[VY]
    here[i, UP], here[i, UP_SPEED] = row[Z], row[VZ]
    work.changed[i] = True


@inlined
def _end_of_flight(i, t, scene, work):
    """Returns what ends the flight of ball i until t seconds after its own time.

    Returns:
        The time, s after the ball's own, the kind of event, -1 for none, and the pocket or the cushion.
    """
    row, (end, kind, other) = work.state.rows[i], end_in_air(i, work.state, scene)
    if end > t:
        return end, -1, -1
    if end == row[LASTS]:
        x, y = work.here[i, X], work.here[i, Y]
        if is_free((x, y, 0.0), scene.radius[i], scene):
            other = pocket_below(x, y, scene.radius[i], scene)
        else:
            other = pocket_at(scene.pockets, x, y, 1.0)
        return end, (LANDING if other < 0 else BALL_POCKET), other
    if kind == OFF_TABLE and other >= 0:
        z, _ = height_after(row[Z], row[VZ], end, scene.numbers.g)
        if z - scene.flight.height < scene.radius[i]:
            return end, BALL_CUSHION, other
    return end, kind, (other if kind == BALL_POCKET else -1)


@inlined
def end_flight(flight, i, now, k, scene, work, shots, log):  # out: work, shots, log
    """Resolves and records what has ended the flight of ball i by a `Time`. Returns whether something has.

    The position of the ball is that in `here`.
    """
    if flight is None:
        return False
    state, row, t = work.state, work.state.rows[i], since(now, own_time(work.state, i))
    end, kind, other = _end_of_flight(i, t, scene, work)
    if kind < 0:
        return False
    fall, over = speed_of_fall(flight, i, state, scene.numbers), place_after(path_of(state, i), end)
    advance(state, i, now, scene.numbers)
    if kind == LANDING:
        row[VZ] = -fall
        _land(i, now, k, scene, work, shots, log)
        return True
    if kind == BALL_CUSHION:
        reach = scene.flight.inset + _reach(row, scene.radius[i], scene.flight)
        row[X], row[Y] = scene.walls.back_to(*over, reach, other, scene)
    _resolve(i, (kind, other), now, k, scene, work, shots, log)
    return True


@inlined
def _land(i, now, k, scene, work, shots, log):  # out: work, shots, log
    """Changes the motion of ball i by the slate, which it touches, and records this."""
    row = work.state.rows[i]
    speed = -row[VZ]
    land(scene.flight, i, work.state, scene.numbers)
    begin_phase(work.state, i, scene.numbers)
    _follow(i, work)
    fix_at_rest(scene.numbers.fix, i, scene, work)
    record_event((LANDING, i, -1, speed), now, k, work.state, shots, log)


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
def _reach(row, radius, noses):
    """Returns the horizontal distance between a nose and a ball that touches it, at the height of the ball, m."""
    below = row[Z] - noses.height
    return max(math.sqrt(max(radius * radius - below * below, 0.0)), _INSIDE * radius)


@kernel
def _resolve(i, event, now, k, scene, work, shots, log):  # out: work, shots, log
    """Resolves and records an event of ball i, which is in the air.

    `event` is its kind, and the cushion, the pocket or -1.
    """
    state, (kind, other) = work.state, event
    if kind == BALL_POCKET:
        speed = norm(state.rows[i, VX], state.rows[i, VY])
        pot(k, i, other, state, scene, shots)
    else:
        speed, _ = resolve_in_air(scene.flight, i, kind, other, k, scene, state, shots)
    record_event((kind, i, other, speed), now, k, state, shots, log)
    _follow(i, work)


@inlined
def hit_noses(flight, i, now, k, scene, work, shots, log):  # out: work, shots, log
    """Reflects ball i, which is in the air, at the noses that it overlaps and approaches. Returns whether it does."""
    if flight is None:
        return False
    state, row, radius, has_hit = work.state, work.state.rows[i], scene.radius[i], False
    box, reach = scene.outline.box, radius + flight.inset
    if abs(work.here[i, X]) <= box[X] - reach and abs(work.here[i, Y]) <= box[Y] - reach:
        return False
    advance(state, i, now, scene.numbers)
    for wall in range(len(scene.outline.lines) + len(scene.outline.tips)):
        dx, dy = way_to_nose(row[X], row[Y], wall, flight)
        touch = _reach(row, radius, flight)
        if not norm(dx, dy) < touch:
            continue
        nx, ny, nz = nose_normal(row, wall, flight)
        if nx * row[VX] + ny * row[VY] + nz * row[VZ] <= 0.0:
            continue
        if scene.numbers.fix != KEEPS_PLACES and (dx != 0.0 or dy != 0.0):
            share = 1.0 - touch / norm(dx, dy)
            row[X], row[Y] = row[X] + share * dx, row[Y] + share * dy
        _resolve(i, (BALL_CUSHION, wall), now, k, scene, work, shots, log)
        has_hit = True
    return has_hit
