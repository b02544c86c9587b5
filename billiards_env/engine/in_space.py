"""Balls that fly: the kernels that differ from `on_cloth`. `space.Space` describes them.

A ball flies if it is above the cloth or has a vertical velocity, see `physics.laws.flight`. It meets the slate, the
noses of the cushions (`physics.geometry.noses`), pockets and other balls.

**Balls of different size.** The height of a ball on the cloth is 0, whatever its radius. So the centres of two balls on
the cloth differ in height by the difference of their radii, and the normal is inclined. The impact lifts the larger
ball. It presses the smaller ball into the slate, so this ball lands at the same instant.

**Bodies that carry a ball.** Gravity presses a ball above the cloth against the ball or the nose below it. There the
contact-time rule of `contact_rule` acts with A = g |n_z| and tau = sqrt(2 h / g), where n is the normal and h is
`Numbers.least_hop`, unless A tau is smaller than with friction. So the ball slips down the body below it in hops lower
than h, which last a few milliseconds with the default numbers. An impulse along a vertical normal would leave a ball on
top of another one. So if the normal of a weak impact is nearer to the vertical than `LEAN`, and the bodies hardly move
past each other, the rule pushes them aside (see `push_aside`). The impulse itself acts along the true normal, so the
bodies separate along the normal with which the next impact is predicted. At the end of a sequence of impacts, a ball in
the air does not come to rest, because gravity moves it on. The impact is plastic instead.
"""

from __future__ import annotations

import math

from billiards_env.engine import on_cloth
from billiards_env.engine.contact_rule import Limits
from billiards_env.engine.log import BALL_CUSHION, BALL_POCKET, LANDING, OFF_TABLE
from billiards_env.engine.pic_events import record_single
from billiards_env.engine.shots import HEIGHT, RISING, drive_off, pot
from billiards_env.jit import inlined, kernel
from billiards_env.physics import ball_ball
from billiards_env.physics.ball_ball import change_velocity
from billiards_env.physics.clusters.friction import Frame
from billiards_env.physics.clusters.impulses import separation_speed
from billiards_env.physics.elementary import norm
from billiards_env.physics.geometry.contact import IMPULSE_ROUNDING, sphere_time
from billiards_env.physics.geometry.noses import (
    edge_time,
    falls_back,
    is_beyond_noses,
    nose_normal,
    nose_time,
    noses_of,
    pocket_below,
)
from billiards_env.physics.geometry.pockets import pocket_exit, pockets_near
from billiards_env.physics.laws.balls import Pair, friction_impulse, push_ball, rub
from billiards_env.physics.laws.cushion import cushion_restitution
from billiards_env.physics.laws.flight import bounce_in_air, bounce_on_slate, height_after, time_of_fall
from billiards_env.physics.motion import motion_after, path_of, place_after
from billiards_env.physics.state import (
    AIRBORNE,
    AX,
    AY,
    LASTS,
    T0,
    T0_LO,
    VX,
    VY,
    VZ,
    X,
    Y,
    Z,
    ball_of,
    own_time,
    set_motion,
    since,
)

UPWARDS = 2
"""The index of the vertical component of a vector."""

LEAN = 1e-3
"""The rule pushes a ball aside if the horizontal part of the unit normal is smaller than this. The speed of the push is
this share of `Limits.speed`. A ball thus leaves the top of another one in less than 1 s."""


@inlined
def axes():
    """Implements `Space.axes`."""
    return 3


@inlined
def load(k, i, shots, row):  # out: row
    """Implements `Space.load`."""
    on_cloth.load(k, i, shots, row)
    row[Z], row[VZ] = shots.heights[k, i, HEIGHT], shots.heights[k, i, RISING]


@inlined
def store(k, i, row, shots):  # out: shots
    """Implements `Space.store`."""
    on_cloth.store(k, i, row, shots)
    shots.heights[k, i, HEIGHT], shots.heights[k, i, RISING] = row[Z], row[VZ]


@inlined
def begin_phase(state, i, numbers):  # out: state
    """Implements `Space.begin_phase`."""
    on_cloth.begin_phase(state, i, numbers)
    s = state.rows[i]
    if s[Z] > 0.0 or s[VZ] != 0.0:
        state.phase[i] = AIRBORNE
        s[AX], s[AY], s[LASTS] = 0.0, 0.0, time_of_fall(s[Z], s[VZ], numbers.g)


@inlined
def height_of(state, i, t, numbers):
    """Returns the height, m, and the vertical velocity, m/s, of ball i, t seconds after its own time."""
    if state.phase[i] != AIRBORNE:
        return 0.0, 0.0
    return height_after(state.rows[i, Z], state.rows[i, VZ], t, numbers.g)


@inlined
def advance(state, i, time, numbers):  # out: state
    """Implements `Space.advance`."""
    if state.phase[i] == AIRBORNE:
        _fly(state, i, time, numbers)
    else:
        on_cloth.advance(state, i, time, numbers)


@inlined
def _fly(state, i, time, numbers):  # out: state
    """Advances ball i, which is in the air, to a `Time`. Its spin does not change."""
    s, t = state.rows[i], since(time, own_time(state, i))
    if t > 0.0:
        s[X], s[Y], s[VX], s[VY] = motion_after(state, i, t)
        s[Z], s[VZ] = height_after(s[Z], s[VZ], t, numbers.g)
        s[LASTS] -= t
    s[T0], s[T0_LO] = time.hi, time.lo


@inlined
def land(state, i, numbers):  # out: state
    """Changes the motion of ball i by its impact on the slate."""
    s = state.rows[i]
    ball, s[VZ] = bounce_on_slate(ball_of(s), min(s[VZ], 0.0), numbers)
    s[Z] = 0.0
    set_motion(s, ball)


@inlined
def event_alone(i, state, scene):
    """Implements `Space.event_alone`."""
    if state.phase[i] == AIRBORNE:
        return _event_in_air(i, state, scene)
    return on_cloth.event_alone(i, state, scene)


@inlined
def end_in_air(i, state, scene):
    """Returns how the flight of ball i ends if the ball hits nothing in the air.

    A ball is potted if it lands in a pocket, or in the mouth of one, farther out than a ball on the cloth can be. If
    its centre passes over the line of the noses inside a pocket, and leaves the pocket lower than 2/5 of a radius above
    its height on the cloth, the ball hits the back of the pocket and is potted (the rule of the simulator pooltool).
    Every other ball whose centre passes over a nose is driven off the table.

    Returns:
        The time, s after the ball's own, the kind of event, and the pocket, or the cushion whose nose the centre passes
        over, or -1.
    """
    path, end, radius, noses = path_of(state, i), state.rows[i, LASTS], scene.radius[i], noses_of(i, scene)
    (last, other), kind = edge_time(path, end, noses), OFF_TABLE
    if last >= end:
        last, other = end, pocket_below(*place_after(path, end), radius, scene)
        kind = LANDING if other < 0 else BALL_POCKET
    first_pocket, last_pocket = pockets_near(path, last, scene.pockets)
    for k in range(first_pocket, last_pocket + 1):
        t = pocket_exit(path, scene.pockets[k])
        if t < last and is_beyond_noses(*place_after(path, t), noses, scene):
            last, kind, other = t, OFF_TABLE, -1
            if falls_back(height_of(state, i, t, scene.numbers)[0], radius):
                kind, other = BALL_POCKET, k
    return last, kind, other


@kernel
def _event_in_air(i, state, scene):
    """Returns the next event of ball i alone, which is in the air; the result is that of `end_in_air`."""
    last, kind, other = end_in_air(i, state, scene)
    if kind == OFF_TABLE:
        other = -1
    path, rise = path_of(state, i), (state.rows[i, Z], state.rows[i, VZ])
    noise = IMPULSE_ROUNDING * norm(norm(path.vx, path.vy), rise[1])
    t, wall = nose_time(path, rise, scene.radius[i], last, noise, noses_of(i, scene), scene.numbers.g)
    if t <= last:
        last, kind, other = t, BALL_CUSHION, wall
    return last, kind, other


@inlined
def speed_of_fall(i, state, numbers):
    """Returns the vertical speed at which ball i, which is in the air, lands, m/s."""
    return state.rows[i, LASTS] * numbers.g - state.rows[i, VZ]


@inlined
def resolve_in_air(event, k, scene, state, shots):  # out: state, shots
    """Resolves what happens to a ball in the air, except a landing.

    Args:
        event: The kind, the ball, and the cushion, the pocket or -1.
        k: The shot.
        scene: The `SceneArrays`.
        state: The `State`.
        shots: The `Shots`.

    Returns:
        The speed of approach, m/s, and the number of acts of the contact-time rule.
    """
    kind, i, other = event
    if kind == BALL_CUSHION:
        shots.cushions[k, i] += 1
        return _hit_nose(i, other, state, scene)
    speed = norm(state.rows[i, VX], state.rows[i, VY])
    if kind == BALL_POCKET:
        pot(k, i, other, state, scene, shots)
    else:
        drive_off(k, i, state, scene, shots)
    return speed, 0


@inlined
def resolve_single(i, now, k, scene, work, shots, log):  # out: work, shots, log
    """Implements `Space.resolve_single`."""
    state, singles = work.state, work.queue.singles
    if state.phase[i] != AIRBORNE:
        return on_cloth.resolve_single(i, now, k, scene, work, shots, log)
    kind, other = singles.kind[i], singles.other[i]
    speed, acts = speed_of_fall(i, state, scene.numbers), 0
    _fly(state, i, now, scene.numbers)
    if kind == LANDING:
        land(state, i, scene.numbers)
    else:
        speed, acts = resolve_in_air((kind, i, other), k, scene, state, shots)
    record_single((kind, i, other, speed), acts, now, k, state, shots, log)
    return 1


@inlined
def meeting_time(i, j, now, path, end, noise, state, scene):
    """Implements `Space.meeting_time`."""
    (z, v, a), speeds = _rise_between(i, j, now, state, scene.numbers)
    if (z, v, a) == (0.0, 0.0, 0.0):
        return on_cloth.meeting_time(i, j, now, path, end, noise, state, scene)
    rise, reach = (z + (scene.radius[j] - scene.radius[i]), v, a), scene.radius[i] + scene.radius[j]
    return sphere_time(path, rise, reach, end, noise + IMPULSE_ROUNDING * speeds)


@inlined
def _rise_between(i, j, now, state, numbers):
    """Returns how ball j rises relative to ball i from a `Time` on.

    Returns:
        The difference z + v t + a t^2 / 2 of their heights above the cloth as (z, v, a), and the sum of the vertical
        speeds, m/s.
    """
    zi, vzi = height_of(state, i, since(now, own_time(state, i)), numbers)
    zj, vzj = height_of(state, j, since(now, own_time(state, j)), numbers)
    falls_i = numbers.g if state.phase[i] == AIRBORNE else 0.0
    falls_j = numbers.g if state.phase[j] == AIRBORNE else 0.0
    return (zj - zi, vzj - vzi, falls_i - falls_j), abs(vzi) + abs(vzj)


@inlined
def approach(i, j, now, state, scene):
    """Implements `Space.approach`."""
    t_i, t_j = since(now, own_time(state, i)), since(now, own_time(state, j))
    xi, yi, vxi, vyi = motion_after(state, i, t_i)
    xj, yj, vxj, vyj = motion_after(state, j, t_j)
    zi, vzi = height_of(state, i, t_i, scene.numbers)
    zj, vzj = height_of(state, j, t_j, scene.numbers)
    dx, dy, dz = xj - xi, yj - yi, (zj - zi) + (scene.radius[j] - scene.radius[i])
    distance = math.sqrt(dx * dx + dy * dy + dz * dz)
    nx, ny, nz = dx / distance, dy / distance, dz / distance
    gap = distance - (scene.radius[i] + scene.radius[j])
    return gap, (nx, ny, nz), -(nx * (vxj - vxi) + ny * (vyj - vyi) + nz * (vzj - vzi))


@inlined
def frozen_normal(k, i, j, scene, starts):
    """Implements `Space.frozen_normal`."""
    if starts.heights[k, i, HEIGHT] > 0.0 or starts.heights[k, j, HEIGHT] > 0.0:
        return 0.0, 0.0
    return on_cloth.frozen_normal(k, i, j, scene, starts)


@inlined
def frame(c, contacts, scene):
    """Implements `Space.frame`."""
    nx, ny, sine = contacts.normal[c, X], contacts.normal[c, Y], contacts.normal[c, UPWARDS]
    cosine = norm(nx, ny)
    if cosine == 0.0:  # one ball is above the other: any direction
        return Frame(1.0, 0.0, (cosine, sine))
    return Frame(nx / cosine, ny / cosine, (cosine, sine))


@inlined
def slip(c, p, contacts, state, scene):
    """Implements `Space.slip`."""
    across, up, _ = on_cloth.slip(c, p, contacts, state, scene)
    _, _, (cosine, _) = frame(c, contacts, scene)
    return across, up + cosine * (state.rows[contacts.first[c], VZ] - state.rows[contacts.second[c], VZ]), p


@inlined
def push(contacts, p, state, scene):  # out: state
    """Implements `Space.push`. No table takes up the vertical part of the impulse."""
    i, j, (nx, ny, (cosine, sine)) = contacts.first[0], contacts.second[0], frame(0, contacts, scene)
    mi, mj, motion = scene.inv_mass[i], scene.inv_mass[j], scene.numbers.motion
    pair = Pair(nx, ny, scene.radius[i], scene.radius[j], mi, mj)
    a, b, up = _rub(scene.laws.friction, (cosine, sine), pair, p, contacts, state, scene)
    along, up = cosine * p, cosine * up - sine * p
    state.rows[i, VZ] += mi * up
    state.rows[j, VZ] -= mj * up
    set_motion(state.rows[i], push_ball(a, -along * mi * nx, -along * mi * ny, motion))
    set_motion(state.rows[j], push_ball(b, along * mj * nx, along * mj * ny, motion))


@inlined
def _rub(friction, tilt, pair, p, contacts, state, scene):
    """Returns the states of the balls of the first contact after friction, and the upward impulse on the first ball."""
    a, b = ball_of(state.rows[contacts.first[0]]), ball_of(state.rows[contacts.second[0]])
    if friction is None:
        return a, b, 0.0
    across, up, _ = slip(0, p, contacts, state, scene)
    speed = norm(across, up)
    stop = 1.0 / (3.5 * (pair.inv_mass_i + pair.inv_mass_j))
    impulse = friction_impulse(across, up, speed, friction(scene.numbers, speed) * p, stop)
    return rub(a, 1.0, impulse, tilt, pair), rub(b, -1.0, impulse, tilt, pair), impulse[1]


@inlined
def exchange(e, count, contacts, state, scene, scratch):  # out: contacts, state, scratch
    """Implements `Space.exchange`."""
    acts = ball_ball.exchange(e, count, contacts, state, scene, scratch)
    return acts + _push_aside(count, contacts, state, scene)


@inlined
def limits(c, contacts, state, numbers):
    """Implements `Space.limits`. If both balls are on the cloth, gravity does not press them together."""
    return limits_at(contacts.normal[c, UPWARDS] if _flies(c, contacts, state) else 0.0, numbers)


@inlined
def _flies(c, contacts, state):
    """Returns whether a ball of contact c is in the air."""
    return state.phase[contacts.first[c]] == AIRBORNE or state.phase[contacts.second[c]] == AIRBORNE


@inlined
def limits_at(nz, numbers):
    """Returns the `Limits` at a contact; nz is the vertical part of its unit normal."""
    tau = math.sqrt(2.0 * numbers.least_hop / numbers.g)
    speed = abs(nz) * numbers.g * tau
    if speed > numbers.weak_speed:
        return Limits(speed, tau)
    return Limits(numbers.weak_speed, numbers.tau)


@inlined
def _push_at(n, wx, wy, speed):
    """Returns the relative speed at which the rule pushes two bodies aside after a weak impact, m/s; 0 if it does not.

    Args:
        n: The unit normal.
        wx: Horizontal velocity of one body relative to the other along x, m/s.
        wy: The same along y.
        speed: `Limits.speed`.
    """
    push = LEAN * speed
    return push if norm(n[X], n[Y]) < LEAN and norm(wx, wy) < push else 0.0


@inlined
def _ahead(n, place):
    """Returns the horizontal unit vector along the unit normal n from a ball at `place`, (x, y).

    If n is exactly vertical, the upper body moves towards the middle of the table, or along x if it is at the middle.
    """
    x, y, side = n[X], n[Y], math.copysign(1.0, n[UPWARDS])
    if x == 0.0 and y == 0.0:
        x, y = -side * place[X], -side * place[Y]
    if x == 0.0 and y == 0.0:
        x = side
    return x / norm(x, y), y / norm(x, y)


@inlined
def _push_aside(count, contacts, state, scene):  # out: contacts, state
    """Pushes aside balls that meet in a weak impact and are almost exactly above one another.

    With PIT, the limit of a weak impact is higher by the speed that a ball gains in a fall of two timesteps. The
    function is called after the impulses of the impacts, and sets `Contacts.rebound` to zero. The result does not
    depend on the order of the contacts, because each ball has at most one such contact above it, and one below.

    Args:
        count: Number of contacts.
        contacts: The `Contacts`.
        state: The `State`.
        scene: The `SceneArrays`.

    Returns:
        The number of contacts at which it acts.
    """
    acts, numbers, rebound = 0, scene.numbers, contacts.rebound
    for c in range(count):
        n, speed = contacts.normal[c], limits(c, contacts, state, numbers).speed
        a, b = state.rows[contacts.first[c]], state.rows[contacts.second[c]]
        rebound[c] = 0.0
        if contacts.closing[c] <= speed + 2.0 * numbers.g * numbers.dt:
            rebound[c] = _push_at(n, b[VX] - a[VX], b[VY] - a[VY], speed)
            acts += rebound[c] > 0.0
    for upper in (False, True):
        for c in range(count):
            i, j, n = contacts.first[c], contacts.second[c], contacts.normal[c]
            if rebound[c] > 0.0:
                x, y = _ahead(n, state.rows[i])
                ball, push = (i, -rebound[c]) if upper == (n[UPWARDS] < 0.0) else (j, rebound[c])
                push *= scene.inv_mass[ball] / (scene.inv_mass[i] + scene.inv_mass[j])
                change_velocity(state, ball, push * x, push * y, numbers)
    rebound[:count] = 0.0
    return acts


@inlined
def _hit_nose(i, wall, state, scene):  # out: state
    """Changes the motion of ball i, which is in the air, by its impact on the nose of a cushion.

    After a weak impact the ball leaves the nose at A tau / 2 or faster. So there is no infinite sequence of bounces.

    Returns:
        The speed of approach, m/s, and the number of acts of the rule.
    """
    row, numbers, radius = state.rows[i], scene.numbers, scene.radius[i]
    n = nose_normal(row, wall, noses_of(i, scene))
    weak, speed = limits_at(n[2], numbers).speed, max(n[0] * row[VX] + n[1] * row[VY] + n[2] * row[VZ], 0.0)
    after, rebound = cushion_restitution(speed, numbers) * speed, 0.5 * weak
    if speed > weak or after >= rebound:
        bounce_in_air(row, n, speed + after, numbers.mu_cushion, radius)
        return speed, 0
    bounce_in_air(row, n, speed + rebound, numbers.mu_cushion, radius)
    push, (x, y) = _push_at(n, row[VX], row[VY], weak), _ahead(n, (row[X], row[Y]))
    change_velocity(state, i, -push * x, -push * y, numbers)
    return speed, 1


@inlined
def pressing(c, contacts, state, scene):
    """Implements `Space.pressing`. The speed of approach of a weak impact is rounded only once."""
    i, j, closing = contacts.first[c], contacts.second[c], contacts.closing[c]
    if closing <= limits(c, contacts, state, scene.numbers).speed:
        closing = max(-separation_speed(contacts, c, state)[0], 0.0)
    a, b, (nx, ny, nz) = state.rows[i], state.rows[j], _normal(c, contacts)
    wx, wy, wz = b[VX] - a[VX], b[VY] - a[VY], b[VZ] - a[VZ]
    along = nx * wx + ny * wy + nz * wz
    around = max(wx * wx + wy * wy + wz * wz - along * along, 0.0)
    falls = (state.phase[i] == AIRBORNE) * scene.numbers.g - (state.phase[j] == AIRBORNE) * scene.numbers.g
    towards = -(nx * (b[AX] - a[AX]) + ny * (b[AY] - a[AY]) + nz * falls)
    return closing, towards - around / (scene.radius[i] + scene.radius[j])


@inlined
def _normal(c, contacts):
    """Returns the normal of contact c."""
    return contacts.normal[c, X], contacts.normal[c, Y], contacts.normal[c, UPWARDS]


@inlined
def stop(over, count, contacts, state, scene, memory):  # out: state
    """Implements `Space.stop`. A ball in the air does not come to rest. Only contacts with a horizontal normal jam."""
    over = over and not _is_in_air(count, contacts, state)
    if over or contacts.normal[0, UPWARDS] == 0.0:
        return on_cloth.stop(over, count, contacts, state, scene, memory)
    return False


@inlined
def _is_in_air(count, contacts, state):
    """Returns whether a ball of the first `count` contacts is in the air."""
    found = False
    for c in range(count):
        found = found or _flies(c, contacts, state)
    return found
