"""The steps of PIT for balls on the cloth. `space.Space` describes the kernels."""

from __future__ import annotations

import math

from billiards_env.engine.log import BALL_BALL, BALL_CUSHION, BALL_POCKET
from billiards_env.engine.measures import AFTER_IMPACT, BEFORE_IMPACT
from billiards_env.engine.overlaps import Bounce, place
from billiards_env.engine.shots import count_hit, pot, record_event
from billiards_env.jit import inlined, kernel
from billiards_env.physics.ball_ball import restitution_at
from billiards_env.physics.ball_cushion import reflect, reflect_both
from billiards_env.physics.elementary import norm
from billiards_env.physics.geometry.pockets import pocket_at
from billiards_env.physics.geometry.walls import TURNS, overlap_time
from billiards_env.physics.laws.cloth import phase_of
from billiards_env.physics.motion import Path, advance, motion_after
from billiards_env.physics.scatter import scatter_key, scatter_limit, scatter_motion
from billiards_env.physics.state import LASTS, POTTED, ROLLING, VX, VY, Time, X, Y, ball_of, later, own_time


@inlined
def follow(i, t, numbers, work):  # out: work
    """Implements `Space.follow`."""
    here = work.here
    here[i, X], here[i, Y], here[i, VX], here[i, VY] = motion_after(work.state, i, t)


@kernel
def predict_phase_end(i, work):  # out: work
    """Implements `Space.predict_phase_end`."""
    time = Time(math.inf, 0.0)
    if work.state.phase[i] != POTTED and work.state.rows[i, LASTS] < math.inf:
        time = later(own_time(work.state, i), work.state.rows[i, LASTS])
    work.phase_end_hi[i], work.phase_end_lo[i] = time.hi, time.lo


@inlined
def test_pockets(i, now, k, fix, scene, work, shots, log):  # out: work, shots, log
    """Implements `Space.test_pockets`: captures ball i if its centre, in `here`, is inside a pocket at a `Time`."""
    here = work.here
    pocket = pocket_at(scene.pockets, here[i, X], here[i, Y], 1.0)
    if pocket < 0:
        return False
    advance(work.state, i, now, scene.numbers)
    pot(k, i, pocket, work.state, scene, shots)
    record_event((BALL_POCKET, i, pocket, norm(here[i, VX], here[i, VY])), now, k, work.state, shots, log)
    work.changed[i] = True
    return True


@inlined
def depth(i, j, here, scene):
    """Implements `Space.depth`."""
    return scene.space.contact_distance(i, j, scene) - norm(here[j, X] - here[i, X], here[j, Y] - here[i, Y])


@inlined
def shift(i, way, work):  # out: work
    """Implements `Space.shift`."""
    place(i, work.here[i, X] + way[X], work.here[i, Y] + way[Y], work)


@inlined
def overlap(i, j, here, scene):
    """Implements `Space.overlap`. For equal centres, the relative velocity replaces the line of centres."""
    reach = scene.space.contact_distance(i, j, scene)
    dx, dy = here[j, X] - here[i, X], here[j, Y] - here[i, Y]
    if dx * dx + dy * dy >= reach * reach:
        return (0.0, 0.0), -1.0
    wx, wy, apart = here[j, VX] - here[i, VX], here[j, VY] - here[i, VY], norm(dx, dy)
    if apart == 0.0:
        dx, dy, apart = -wx, -wy, norm(wx, wy)
        if apart == 0.0:
            return (0.0, 0.0), -1.0
    nx, ny = dx / apart, dy / apart
    return (nx, ny), -(nx * wx + ny * wy)


@inlined
def _pair(contacts, c):
    """Returns the balls of contact c, in order."""
    return min(contacts.first[c], contacts.second[c]), max(contacts.first[c], contacts.second[c])


@inlined
def resolve_overlaps(count, now, k, fix, scene, work, shots, log):  # out: work, shots, log
    """Implements `Space.resolve_overlaps`."""
    state, contacts, here = work.state, work.contacts, work.here
    for c in range(count):
        for i in (contacts.first[c], contacts.second[c]):
            scene.space.advance(state, i, now, scene.numbers)
            work.changed[i] = True
    count = fix.before(count, scene, work)
    for c in range(count):
        if contacts.closing[c] > 0.0:
            work.record(BEFORE_IMPACT, *_pair(contacts, c), k, scene, state, shots)
    if count > 0:
        scene.space.exchange(restitution_at(count, contacts, scene), count, contacts, state, scene, work.scratch)
    for c in range(count):
        if contacts.closing[c] > 0.0:  # otherwise they overlap without an impact
            i, j = _pair(contacts, c)
            work.record(AFTER_IMPACT, i, j, k, scene, state, shots)
            count_hit(k, i, j, now, shots)
    if fix.after(count, scene, work):
        shots.time[k] = now.hi  # the balls may be at rest already
    for c in range(count):
        i, j = _pair(contacts, c)
        for b in (i, j):
            here[b, VX], here[b, VY] = state.rows[b, VX], state.rows[b, VY]
        if contacts.closing[c] > 0.0:
            record_event((BALL_BALL, i, j, contacts.closing[c]), now, k, state, shots, log)
    return count


@inlined
def _overlap_of(i, wall, scene, work):
    """Returns the time since ball i, which overlaps or touches a cushion, first touched it, s."""
    here, radius = work.here, scene.radius[i]
    beyond, nx, ny = scene.walls.overlap(here[i, X], here[i, Y], radius, wall, scene)
    path = Path(here[i, X], here[i, Y], here[i, VX], here[i, VY], 0.0, 0.0)
    return overlap_time(path, radius, wall, beyond, nx * path.vx + ny * path.vy, scene.outline)


@inlined
def _first_overlap(i, wall, scene, work):
    """Returns the cushion that ball i touched first, of those that act on it. `wall` is one of these."""
    one, two = scene.walls.met(work.state, i, wall, scene)
    if two >= 0 and _overlap_of(i, two, scene, work) > _overlap_of(i, one, scene, work):
        return two
    return one


@kernel
def _hit_cushion(i, wall, key, fix, scene, work):  # out: work
    """Reflects ball i at a cushion that it overlaps and does not leave, and at another one that it then touches.

    `key` is the `scatter_key` of the impact.

    Returns:
        (wall, other, speed, other_speed): the cushions that act, -1 for none, and the speeds of approach, m/s. The
        first speed is 0 if the ball was only moved back, and -1 if nothing happened.
    """
    state, here, radius = work.state, work.here, scene.radius[i]
    beyond, nx, ny = scene.walls.overlap(here[i, X], here[i, Y], radius, wall, scene)
    speed = nx * here[i, VX] + ny * here[i, VY]
    if beyond <= 0.0 or speed < 0.0:
        return wall, -1, -1.0, 0.0
    if speed > 0.0:
        wall = _first_overlap(i, wall, scene, work)
        beyond, nx, ny = scene.walls.overlap(here[i, X], here[i, Y], radius, wall, scene)
        speed = nx * here[i, VX] + ny * here[i, VY]
    nx, ny, speed = fix.at_cushion(i, wall, beyond, Bounce(nx, ny, speed), scene, work)
    other, other_speed = -1, 0.0
    if speed > 0.0:
        one, two = scene.walls.met(state, i, wall, scene)
        other = two if one == wall else one
        if two < 0:
            limit = scatter_limit(scene.scatter, i, state, scene)
            reflect(state, i, nx, ny, 0.0, scene)
            scatter_motion(scene.scatter, key, i, (nx, ny), limit, state, scene)
        else:
            mx, my = scene.walls.normal(state.rows[i, X], state.rows[i, Y], other, scene)
            other_speed = mx * here[i, VX] + my * here[i, VY]
            fix.in_corner(i, other, (nx, ny), (mx, my), scene, work)
            reflect_both(state, i, (nx, ny), (mx, my), (0.0, 0.0), scene)
        here[i, VX], here[i, VY] = state.rows[i, VX], state.rows[i, VY]
    fix.after_cushion(i, scene, work)
    return wall, other, speed, other_speed


@inlined
def hit_cushions(i, now, k, fix, scene, work, shots, log):  # out: work, shots, log
    """Implements `Space.hit_cushions`: reflects ball i, or moves it back if it has stopped."""
    state, here, box, radius, has_rebound = work.state, work.here, scene.outline.box, scene.radius[i], False
    if abs(here[i, X]) <= box[X] - radius and abs(here[i, Y]) <= box[Y] - radius:
        return False
    for turn in range(TURNS):
        x, y, vx, vy = here[i, X], here[i, Y], here[i, VX], here[i, VY]
        wall = scene.walls.next_overlap(x, y, vx, vy, radius, turn, scene)
        if wall < 0:
            continue
        advance(state, i, now, scene.numbers)
        key = scatter_key(scene.scatter, k, i, shots.cushions[k, i])
        wall, other, speed, other_speed = _hit_cushion(i, wall, key, fix, scene, work)
        work.changed[i] = has_rebound = True
        if speed >= 0.0:
            shots.time[k] = now.hi
        for hit, at_speed in ((wall, speed), (other, other_speed)):
            if hit >= 0 and at_speed > 0.0:
                shots.cushions[k, i] += 1
                record_event((BALL_CUSHION, i, hit, at_speed), now, k, state, shots, log)
    if phase_of(ball_of(state.rows[i]), scene.numbers) < ROLLING:  # it has stopped, so this is its last test
        if fix.at_rest(i, scene, work):
            advance(state, i, now, scene.numbers)
            work.changed[i] = has_rebound = True
            shots.time[k] = now.hi
        if work.changed[i]:
            test_pockets(i, now, k, fix, scene, work, shots, log)
    return has_rebound
