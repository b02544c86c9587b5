"""Balls that stay on the cloth: disks and spheres of one size. `space.Space` describes the kernels."""

from __future__ import annotations

import math

from billiards_env.engine.contact_rule import (
    CushionContact,
    Limits,
    halt,
    hit_corner,
    hit_cushion,
    resolve_jam,
)
from billiards_env.engine.log import BALL_CUSHION, BALL_POCKET, log_event, phase_end, phase_ended
from billiards_env.engine.pic_events import record_single
from billiards_env.engine.shots import pot
from billiards_env.jit import inlined, kernel
from billiards_env.physics import ball_ball, motion
from billiards_env.physics.clusters.friction import Frame
from billiards_env.physics.elementary import norm
from billiards_env.physics.geometry.contact import circle_time
from billiards_env.physics.geometry.pockets import path_to, pockets_near
from billiards_env.physics.laws.balls import Pair, along_normal, contact_slip
from billiards_env.physics.motion import motion_after, path_of
from billiards_env.physics.scatter import scatter_key, scatter_limit, scatter_motion
from billiards_env.physics.state import AX, AY, LASTS, ROLLING, VX, VY, X, Y, ball_of, own_time, since
from billiards_env.scene import CONTACT_GAP

begin_phase, advance, exchange = motion.begin_phase, motion.advance, ball_ball.exchange


@inlined
def axes():
    """Implements `Space.axes`."""
    return 2


@inlined
def load(k, i, shots, row):  # out: row
    """Implements `Space.load`."""
    row[VX], row[VY] = shots.velocities[k, i, X], shots.velocities[k, i, Y]


@inlined
def store(k, i, row, shots):  # out: shots
    """Implements `Space.store`."""
    shots.velocities[k, i, X], shots.velocities[k, i, Y] = row[VX], row[VY]


@inlined
def event_alone(i, state, scene):
    """Implements `Space.event_alone`: a cushion, a pocket or the end of the phase."""
    phase, end = state.phase[i], state.rows[i, LASTS]
    kind, other = phase_end(phase), -1
    if phase >= ROLLING:
        path = path_of(state, i)
        t, wall = scene.walls.time(path, scene.radius[i], end, scene)
        if t < math.inf:
            end, kind, other = t, BALL_CUSHION, wall
        first, last = pockets_near(path, end, scene.pockets)
        for k in range(first, last + 1):
            from_pocket, reach = path_to(path, scene.pockets[k])
            t = circle_time(from_pocket, reach, end, 0.0)
            if t < end or (t == end and kind != BALL_POCKET and t < math.inf):
                end, kind, other = t, BALL_POCKET, k
    return end, kind, other


@inlined
def _contact_with(i, wall, state, scene):
    """Returns the `CushionContact` of ball i."""
    nx, ny = scene.walls.normal(state.rows[i, X], state.rows[i, Y], wall, scene)
    return CushionContact(i, wall, nx, ny, nx * state.rows[i, VX] + ny * state.rows[i, VY])


@kernel
def _resolve_corner(i, walls, now, k, scene, work, shots, log):  # out: work, shots, log
    """Resolves and records the impact of ball i on two cushions."""
    one, two = _contact_with(i, walls[0], work.state, scene), _contact_with(i, walls[1], work.state, scene)
    acts = hit_corner(one, two, now.hi, work.state, scene, work.memory)
    shots.cushions[k, i] += 2
    shots.n_contact_rule[k] += 2 * acts
    shots.n_events[k] += 2
    for contact in (one, two):
        log_event(log, now, BALL_CUSHION, i, contact.wall, work.state, contact.speed, acts > 0)


@inlined
def _resolve_cushion(i, wall, now, k, scene, work, shots):  # out: work, shots
    """Resolves the impact of ball i on a cushion. Returns the speed of approach, m/s, and the acts of the rule."""
    state, contact = work.state, _contact_with(i, wall, work.state, scene)
    limit = scatter_limit(scene.scatter, i, state, scene)
    acts = hit_cushion(contact, now.hi, state, scene, work.memory)
    if acts == 0 and contact.speed > scene.numbers.weak_speed:
        key = scatter_key(scene.scatter, k, i, shots.cushions[k, i])
        scatter_motion(scene.scatter, key, i, (contact.nx, contact.ny), limit, state, scene)
    shots.cushions[k, i] += 1
    return contact.speed, acts


@inlined
def resolve_single(i, now, k, scene, work, shots, log):  # out: work, shots, log
    """Implements `Space.resolve_single`."""
    state, singles = work.state, work.queue.singles
    kind, other = singles.kind[i], singles.other[i]
    speed, acts = 0.0, 0
    if kind == BALL_POCKET:
        advance(state, i, now, scene.numbers)
        speed = norm(state.rows[i, VX], state.rows[i, VY])
        pot(k, i, other, state, scene, shots)
    elif kind == BALL_CUSHION:
        advance(state, i, now, scene.numbers)
        walls = scene.walls.met(state, i, other, scene)
        if walls[1] >= 0:
            _resolve_corner(i, walls, now, k, scene, work, shots, log)
            return 2
        other = walls[0]
        speed, acts = _resolve_cushion(i, other, now, k, scene, work, shots)
    else:
        motion.end_phase(state, i, now, scene.numbers)
        kind = phase_ended(kind, state.rows[i])
    record_single((kind, i, other, speed), acts, now, k, state, shots, log)
    return 1


@inlined
def contact_distance(i, j, scene):
    """Implements `Space.contact_distance`."""
    return scene.radius[i] + scene.radius[j]


@inlined
def meeting_time(i, j, now, path, end, noise, state, scene):
    """Implements `Space.meeting_time`."""
    return circle_time(path, scene.space.contact_distance(i, j, scene), end, noise)


@inlined
def approach(i, j, now, state, scene):
    """Implements `Space.approach`."""
    xi, yi, vxi, vyi = motion_after(state, i, since(now, own_time(state, i)))
    xj, yj, vxj, vyj = motion_after(state, j, since(now, own_time(state, j)))
    dx, dy = xj - xi, yj - yi
    apart = norm(dx, dy)
    nx, ny = dx / apart, dy / apart
    gap = apart - scene.space.contact_distance(i, j, scene)
    return gap, (nx, ny), -(nx * (vxj - vxi) + ny * (vyj - vyi))


@inlined
def frozen_normal(k, i, j, scene, starts):
    """Implements `Space.frozen_normal`."""
    if not (starts.in_play[k, i] and starts.in_play[k, j]):
        return 0.0, 0.0
    dx = starts.positions[k, j, X] - starts.positions[k, i, X]
    dy = starts.positions[k, j, Y] - starts.positions[k, i, Y]
    apart = norm(dx, dy)
    if apart - scene.space.contact_distance(i, j, scene) > CONTACT_GAP:
        return 0.0, 0.0
    return dx / apart, dy / apart


@inlined
def tilt(i, j, scene):
    """Implements `Space.tilt`."""
    return None


@inlined
def frame(c, contacts, scene):
    """Implements `Space.frame`."""
    inclination = scene.space.tilt(contacts.first[c], contacts.second[c], scene)
    return Frame(contacts.normal[c, X], contacts.normal[c, Y], inclination)


@inlined
def slip(c, p, contacts, state, scene):
    """Implements `Space.slip`; p is the horizontal part of the impulse."""
    i, j, (nx, ny, inclination) = contacts.first[c], contacts.second[c], scene.space.frame(c, contacts, scene)
    pair = Pair(nx, ny, scene.radius[i], scene.radius[j], scene.inv_mass[i], scene.inv_mass[j])
    across, up = contact_slip(inclination, ball_of(state.rows[i]), ball_of(state.rows[j]), pair)
    return across, up, along_normal(inclination, p)


@inlined
def push(contacts, p, state, scene):  # out: state
    """Implements `Space.push`; p is the horizontal part of the impulse."""
    n = contacts.normal[0, X], contacts.normal[0, Y]
    ball_ball.push_pair(contacts.first[0], contacts.second[0], n, p, state, scene)


@inlined
def limits(c, contacts, state, numbers):
    """Implements `Space.limits`."""
    return Limits(numbers.weak_speed, numbers.tau)


@inlined
def pressing(c, contacts, state, scene):
    """Implements `Space.pressing`."""
    a, b = state.rows[contacts.first[c]], state.rows[contacts.second[c]]
    nx, ny = contacts.normal[c, X], contacts.normal[c, Y]
    around = ny * (b[VX] - a[VX]) - nx * (b[VY] - a[VY])
    apart = norm(b[X] - a[X], b[Y] - a[Y])
    return contacts.closing[c], -(nx * (b[AX] - a[AX]) + ny * (b[AY] - a[AY])) - around * around / apart


@inlined
def stop(over, count, contacts, state, scene, memory):  # out: state
    """Implements `Space.stop`."""
    if over:
        for c in range(count):
            halt(state, contacts.first[c])
            halt(state, contacts.second[c])
        return True
    return count == 1 and resolve_jam(contacts, state, scene, memory)
