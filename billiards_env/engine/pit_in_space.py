"""The steps of PIT for balls that fly: the kernels that differ from `pit_on_cloth`. `space.Space` describes them.

Between two timesteps, the path of a ball in the air is that of the exact engine, and `in_space.end_in_air` finds the
end of the flight. A ball that has reached the slate lands at the timestep, at its horizontal position at that time,
with the vertical speed at which it reached the slate. If a ball has passed over a nose, PIT computes its height at the
nose: a ball that clears the nose is driven off the table. A lower ball is put back at the nose, with any fix, and is
reflected. A ball that overlaps a nose at a timestep and approaches it is reflected by `in_space.resolve_in_air`. The
fix "push_apart" first moves it away from the nose horizontally until they touch.
"""

from __future__ import annotations

import math

from billiards_env.engine import pit_on_cloth
from billiards_env.engine.in_space import (
    UPWARDS,
    advance,
    begin_phase,
    end_in_air,
    height_of,
    land,
    resolve_in_air,
    speed_of_fall,
)
from billiards_env.engine.log import BALL_CUSHION, BALL_POCKET, LANDING, OFF_TABLE
from billiards_env.engine.shots import record_event
from billiards_env.jit import inlined, kernel
from billiards_env.physics.elementary import norm
from billiards_env.physics.geometry.noses import is_free, nose_normal, noses_of, pocket_below, way_to_nose
from billiards_env.physics.geometry.pockets import pocket_at
from billiards_env.physics.laws.flight import height_after
from billiards_env.physics.motion import path_of, place_after
from billiards_env.physics.state import AIRBORNE, LASTS, VX, VY, VZ, X, Y, Z, own_time, since

UP, UP_SPEED = 4, 5
"""Columns of `pit.PitWorkspace.here`: the height, m, and the vertical velocity, m/s."""

_INSIDE = 1e-9
"""The least horizontal distance between a nose and a ball that touches it, over the radius."""


@inlined
def follow(i, t, numbers, work):  # out: work
    """Implements `Space.follow`."""
    pit_on_cloth.follow(i, t, numbers, work)
    work.here[i, UP], work.here[i, UP_SPEED] = height_of(work.state, i, t, numbers)


@kernel
def predict_phase_end(i, work):  # out: work
    """Implements `Space.predict_phase_end`: a flight ends at a timestep."""
    pit_on_cloth.predict_phase_end(i, work)
    if work.state.phase[i] == AIRBORNE:
        work.phase_end_hi[i] = math.inf


@inlined
def depth(i, j, here, scene):
    """Implements `Space.depth`. For balls on the cloth, its horizontal component is the overlap along the cloth."""
    dx, dy, dz = _way(i, j, here, scene)
    level = norm(dx, dy)
    if here[i, UP] == 0.0 and here[j, UP] == 0.0 and level > 0.0:
        return (scene.space.contact_distance(i, j, scene) - level) * (norm(level, dz) / level)
    return scene.radius[i] + scene.radius[j] - norm(level, dz)


@inlined
def _way(i, j, here, scene):
    """Returns the vector from the centre of ball i to that of ball j, m."""
    rise = (here[j, UP] - here[i, UP]) + (scene.radius[j] - scene.radius[i])
    return here[j, X] - here[i, X], here[j, Y] - here[i, Y], rise


@inlined
def shift(i, way, work):  # out: work
    """Implements `Space.shift`. No ball moves below its height on the cloth, and a ball on the cloth stays on it.

    So a part of the overlap can remain, if a ball on the cloth is above the centre of a smaller one in the air.
    """
    pit_on_cloth.shift(i, way, work)
    if work.here[i, UP] > 0.0:
        work.here[i, UP] = work.state.rows[i, Z] = max(work.here[i, UP] + way[UPWARDS], 0.0)


@inlined
def overlap(i, j, here, scene):
    """Implements `Space.overlap`."""
    dx, dy, dz = _way(i, j, here, scene)
    w = here[j, VX] - here[i, VX], here[j, VY] - here[i, VY], here[j, UP_SPEED] - here[i, UP_SPEED]
    apart = math.sqrt(dx * dx + dy * dy + dz * dz)
    if apart >= scene.radius[i] + scene.radius[j]:
        return (0.0, 0.0, 0.0), -1.0
    n = (dx / apart, dy / apart, dz / apart) if apart > 0.0 else (0.0, 0.0, 1.0)
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
    """Returns the event that ends the flight of ball i within t seconds after its own time.

    Returns:
        The time, s after the ball's own, the kind of event, -1 for none, and the pocket or the cushion.
    """
    row, (end, kind, other) = work.state.rows[i], end_in_air(i, work.state, scene)
    if end > t:
        return end, -1, -1
    if end == row[LASTS]:
        x, y = work.here[i, X], work.here[i, Y]
        if is_free(i, (x, y, 0.0), scene):
            other = pocket_below(x, y, scene.radius[i], scene)
        else:
            other = pocket_at(scene.pockets, x, y, 1.0)
        return end, (LANDING if other < 0 else BALL_POCKET), other
    if kind == OFF_TABLE and other >= 0:
        z, _ = height_after(row[Z], row[VZ], end, scene.numbers.g)
        if z - noses_of(i, scene).height < scene.radius[i]:
            return end, BALL_CUSHION, other
    return end, kind, (other if kind == BALL_POCKET else -1)


@inlined
def test_pockets(i, now, k, fix, scene, work, shots, log):  # out: work, shots, log
    """Implements `Space.test_pockets`: resolves and records the event that has ended the flight of a ball."""
    if work.state.phase[i] != AIRBORNE:
        return pit_on_cloth.test_pockets(i, now, k, fix, scene, work, shots, log)
    state, row, t = work.state, work.state.rows[i], since(now, own_time(work.state, i))
    end, kind, other = _end_of_flight(i, t, scene, work)
    if kind < 0:
        return False
    fall, over = speed_of_fall(i, state, scene.numbers), place_after(path_of(state, i), end)
    advance(state, i, now, scene.numbers)
    if kind == LANDING:
        row[VZ] = -fall
        _land(i, now, k, fix, scene, work, shots, log)
        return True
    if kind == BALL_CUSHION:
        noses = noses_of(i, scene)
        reach = noses.inset + _reach(row, scene.radius[i], noses)
        row[X], row[Y] = scene.walls.back_to(*over, reach, other, scene)
    _resolve((kind, i, other), now, k, scene, work, shots, log)
    return True


@inlined
def _land(i, now, k, fix, scene, work, shots, log):  # out: work, shots, log
    """Resolves and records the landing of ball i, which touches the slate."""
    row = work.state.rows[i]
    speed = -row[VZ]
    land(work.state, i, scene.numbers)
    begin_phase(work.state, i, scene.numbers)
    _follow(i, work)
    fix.at_rest(i, scene, work)
    record_event((LANDING, i, -1, speed), now, k, work.state, shots, log)


@inlined
def resolve_overlaps(count, now, k, fix, scene, work, shots, log):  # out: work, shots, log
    """Implements `Space.resolve_overlaps`."""
    count = pit_on_cloth.resolve_overlaps(count, now, k, fix, scene, work, shots, log)
    for c in range(count):
        for i in (work.contacts.first[c], work.contacts.second[c]):
            _land_pressed(i, now, k, fix, scene, work, shots, log)
    return count


@inlined
def _land_pressed(i, now, k, fix, scene, work, shots, log):  # out: work, shots, log
    """Lets ball i land if an impact with another ball at this `Time` presses it into the slate."""
    row = work.state.rows[i]
    if row[Z] == 0.0 and row[VZ] < 0.0:
        work.state.phase[i] = AIRBORNE
        _land(i, now, k, fix, scene, work, shots, log)


@inlined
def _reach(row, radius, noses):
    """Returns the horizontal distance between a nose and a ball that touches it, at the height of the ball, m."""
    below = row[Z] - noses.height
    return max(math.sqrt(max(radius * radius - below * below, 0.0)), _INSIDE * radius)


@kernel
def _resolve(event, now, k, scene, work, shots, log):  # out: work, shots, log
    """Resolves and records an event of a ball in the air, see `resolve_in_air`."""
    kind, i, other = event
    speed, _ = resolve_in_air(event, k, scene, work.state, shots)
    record_event((kind, i, other, speed), now, k, work.state, shots, log)
    _follow(i, work)


@inlined
def hit_cushions(i, now, k, fix, scene, work, shots, log):  # out: work, shots, log
    """Implements `Space.hit_cushions`: reflects a ball in the air at the noses that it overlaps and approaches."""
    state, row, radius, has_hit = work.state, work.state.rows[i], scene.radius[i], False
    if state.phase[i] != AIRBORNE:
        return pit_on_cloth.hit_cushions(i, now, k, fix, scene, work, shots, log)
    noses, box = noses_of(i, scene), scene.outline.box
    reach = radius + noses.inset
    if abs(work.here[i, X]) <= box[X] - reach and abs(work.here[i, Y]) <= box[Y] - reach:
        return False
    advance(state, i, now, scene.numbers)
    for wall in range(len(scene.outline.lines) + len(scene.outline.tips)):
        dx, dy = way_to_nose(row[X], row[Y], wall, noses)
        touch = _reach(row, radius, noses)
        if not norm(dx, dy) < touch:
            continue
        nx, ny, nz = nose_normal(row, wall, noses)
        if nx * row[VX] + ny * row[VY] + nz * row[VZ] <= 0.0:
            continue
        fix.at_nose(row, dx, dy, touch)
        _resolve((BALL_CUSHION, i, wall), now, k, scene, work, shots, log)
        has_hit = True
    return has_hit
