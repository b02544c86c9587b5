"""The events of PIC: impacts of balls at one instant, and events of a ball alone."""

from __future__ import annotations

import math

from billiards_env.engine.contact_rule import CushionContact, collide, hit_corner, hit_cushion, hit_nose
from billiards_env.engine.log import BALL_BALL, BALL_CUSHION, BALL_POCKET, LANDING, OFF_TABLE, log_event, phase_ended
from billiards_env.engine.shots import count_hit, drive_off, pot
from billiards_env.jit import inlined, kernel
from billiards_env.physics.clusters.impulses import set_normal
from billiards_env.physics.elementary import norm
from billiards_env.physics.geometry.contact import contact_distance
from billiards_env.physics.motion import advance, end_phase, height_of, motion_after
from billiards_env.physics.scatter import scatter_key, scatter_limit, scatter_motion
from billiards_env.physics.state import AIRBORNE, LASTS, VX, VY, VZ, X, Y, is_airborne, own_time, same, since
from billiards_env.scene import CONTACT_GAP


@inlined
def _approach(flight, i, j, now, state, numbers):
    """Returns the distance of balls i and j at a `Time`, m, the unit normal from i to j and the speed of approach, m/s.

    `flight` is `SceneArrays.flight`.
    """
    t_i, t_j = since(now, own_time(state, i)), since(now, own_time(state, j))
    xi, yi, vxi, vyi = motion_after(state, i, t_i)
    xj, yj, vxj, vyj = motion_after(state, j, t_j)
    dx, dy = xj - xi, yj - yi
    if flight is None:
        distance = norm(dx, dy)
        nx, ny = dx / distance, dy / distance
        return distance, (nx, ny, 0.0), -(nx * (vxj - vxi) + ny * (vyj - vyi))
    zi, vzi = height_of(flight, state, i, t_i, numbers)
    zj, vzj = height_of(flight, state, j, t_j, numbers)
    distance = math.sqrt(dx * dx + dy * dy + (zj - zi) * (zj - zi))
    nx, ny, nz = dx / distance, dy / distance, (zj - zi) / distance
    return distance, (nx, ny, nz), -(nx * (vxj - vxi) + ny * (vyj - vyi) + nz * (vzj - vzi))


@inlined
def add_contact(i, j, meeting, now, state, scene, contacts, count):  # out: state, contacts
    """Adds balls i < j to the contacts and advances them, if they meet at a `Time` or touch and approach then.

    The contacts stay in the order of their balls.

    Args:
        i: A ball.
        j: The other ball.
        meeting: The predicted time of their meeting.
        now: The time.
        state: The `State`.
        scene: The `SceneArrays`.
        contacts: The `Contacts`.
        count: Number of contacts found so far.

    Returns:
        Whether the balls were added.
    """
    distance, n, closing = _approach(state.flight, i, j, now, state, scene.numbers)
    if same(meeting, now):
        closing = max(closing, 0.0)
    elif distance - contact_distance(scene.spheres, scene.radius, i, j) > CONTACT_GAP or closing <= 0.0:
        return False
    advance(state, i, now, scene.numbers)
    advance(state, j, now, scene.numbers)
    first, second = contacts.first, contacts.second
    k = count
    while k > 0 and (first[k - 1] > i or (first[k - 1] == i and second[k - 1] > j)):
        first[k], second[k], contacts.closing[k] = first[k - 1], second[k - 1], contacts.closing[k - 1]
        set_normal(contacts, k, contacts.normal[k - 1])
        k -= 1
    first[k], second[k], contacts.closing[k] = i, j, closing
    set_normal(contacts, k, n)
    return True


@inlined
def resolve_impacts(count, now, k, scene, work, shots, log):  # out: work, shots, log
    """Resolves and records the impacts of the first `count` contacts, and lists their balls in `work.changed`.

    Args:
        count: Number of contacts, > 0.
        now: The `Time`; the balls are advanced to it already.
        k: The shot.
        scene: The `SceneArrays`.
        work: The `pic.PicWorkspace`.
        shots: The `Shots`.
        log: The `Log`.

    Returns:
        The number of balls listed. A ball may occur more than once.
    """
    contacts, changed = work.contacts, work.changed
    acts = collide(count, now.hi, contacts, work.state, scene, work.scratch, work.memory)
    for c in range(count):
        i, j = contacts.first[c], contacts.second[c]
        count_hit(k, i, j, now, shots)
        log_event(log, now, BALL_BALL, i, j, work.state, contacts.closing[c], acts > 0)
        changed[2 * c], changed[2 * c + 1] = i, j
    shots.n_contact_rule[k] += acts
    shots.n_events[k] += count
    return 2 * count


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
def speed_of_fall(flight, i, state, numbers):
    """Returns the vertical speed at which ball i lands at the end of its phase, m/s; 0 if it is on the cloth."""
    if flight is None or state.phase[i] != AIRBORNE:
        return 0.0
    return state.rows[i, LASTS] * numbers.g - state.rows[i, VZ]


@inlined
def resolve_in_air(flight, i, kind, other, k, scene, state, shots):  # out: state, shots
    """Resolves the impact of ball i, which is in the air, on a nose, or drives it off the table.

    Returns:
        The speed of approach, m/s, and the number of acts of the contact-time rule.
    """
    if flight is None:
        return 0.0, 0
    if kind == OFF_TABLE:
        speed = norm(state.rows[i, VX], state.rows[i, VY])
        drive_off(k, i, state, scene, shots)
        return speed, 0
    shots.cushions[k, i] += 1
    return hit_nose(i, other, state, scene)


@inlined
def resolve_singles(count, now, k, scene, work, shots, log):  # out: work, shots, log
    """Resolves and records the next single-ball event of each of the first `count` balls of `work.due`.

    Args:
        count: Number of balls.
        now: The `Time` of these events.
        k: The shot.
        scene: The `SceneArrays`.
        work: The `pic.PicWorkspace`.
        shots: The `Shots`.
        log: The `Log`.

    Returns:
        The number of balls listed in `work.changed`, once for each event.
    """
    state, singles, changed, n_changed = work.state, work.queue.singles, work.changed, 0
    for c in range(count):
        i = work.due[c]
        kind, other = singles.kind[i], singles.other[i]
        speed, acts = 0.0, 0
        changed[n_changed] = i
        n_changed += 1
        if kind == BALL_POCKET:
            advance(state, i, now, scene.numbers)
            speed = norm(state.rows[i, VX], state.rows[i, VY])
            pot(k, i, other, state, scene, shots)
        elif is_airborne(scene.flight, state.phase[i]) and kind != LANDING:
            advance(state, i, now, scene.numbers)
            speed, acts = resolve_in_air(scene.flight, i, kind, other, k, scene, state, shots)
        elif kind == BALL_CUSHION:
            advance(state, i, now, scene.numbers)
            walls = scene.walls.met(state, i, other, scene)
            if walls[1] >= 0:
                _resolve_corner(i, walls, now, k, scene, work, shots, log)
                changed[n_changed] = i
                n_changed += 1
                continue
            other = walls[0]
            contact = _contact_with(i, other, state, scene)
            speed = contact.speed
            limit = scatter_limit(scene.scatter, i, state, scene)
            acts = hit_cushion(contact, now.hi, state, scene, work.memory)
            if acts == 0 and speed > scene.numbers.weak_speed:
                key = scatter_key(scene.scatter, k, i, shots.cushions[k, i])
                scatter_motion(scene.scatter, key, i, (contact.nx, contact.ny), limit, state, scene)
            shots.cushions[k, i] += 1
        else:
            speed = speed_of_fall(scene.flight, i, state, scene.numbers)
            end_phase(state, i, now, scene.numbers)
            kind = phase_ended(kind, state.rows[i])
        shots.n_contact_rule[k] += acts
        shots.n_events[k] += 1
        log_event(log, now, kind, i, other, state, speed, acts > 0)
    return n_changed
