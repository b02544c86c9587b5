"""PIT, periodic interference test: time advances by a step dt, and overlaps are resolved after each step.

The balls move by the law of motion of `engine.pic`, in closed form, and each change of phase is at its exact time. The
only difference is when contacts are detected. The engine tests for them at each multiple of dt, in this order: it
captures balls whose centre is inside a pocket; it resolves the impacts of all pairs that overlap and do not separate,
as one problem; and it reflects balls that are beyond a cushion and do not come back. A ball that is beyond two
cushions is reflected at both together. A ball that has stopped beyond a cushion is moved back to it, and a pocket
captures it if it is then inside the pocket. The engine computes impulses by the impact laws, for the positions at the
multiple of dt. It misses a contact that begins and ends within a step.

The test follows Warkari and Jamsandekar, "Evaluation of Collision Handling Techniques in 2D collisions".
`engine.overlaps` has the ways in which the overlaps are "fixed".
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from billiards_env.engine.contact_rule import push_aside
from billiards_env.engine.log import (
    BALL_BALL,
    BALL_CUSHION,
    BALL_POCKET,
    clear_log,
    log_segment,
    phase_end,
    phase_ended,
)
from billiards_env.engine.overlaps import (
    Bounce,
    fix_after,
    fix_after_cushion,
    fix_at_cushion,
    fix_at_rest,
    fix_before,
    fix_in_corner,
)
from billiards_env.engine.pit_flight import end_flight, find_height, hit_noses, land_pressed, overlap_in_space
from billiards_env.engine.runner import INTERRUPTED, LOOK_AFTER, for_all_shots
from billiards_env.engine.shots import AT_EVENT_LIMIT, AT_MAX_TIME, AT_STEP_LIMIT, count_hit, end_at, pot, record_event
from billiards_env.jit import allocating, entry_point, inlined, kernel
from billiards_env.jit.interrupt import end_call, interrupted
from billiards_env.physics.ball_ball import exchange, restitution_at
from billiards_env.physics.ball_cushion import reflect, reflect_both
from billiards_env.physics.clusters.impulses import Contacts, Scratch, empty_contacts, empty_scratch, set_normal
from billiards_env.physics.elementary import norm
from billiards_env.physics.geometry.contact import contact_distance
from billiards_env.physics.geometry.pockets import pocket_at
from billiards_env.physics.geometry.walls import TURNS, overlap_time
from billiards_env.physics.laws.cloth import phase_of
from billiards_env.physics.motion import Path, advance, begin_phase, end_phase, motion_after
from billiards_env.physics.scatter import scatter_key, scatter_limit, scatter_motion
from billiards_env.physics.state import (
    IDEAL,
    LASTS,
    POTTED,
    ROLLING,
    VX,
    VY,
    State,
    Time,
    X,
    Y,
    ball_of,
    before,
    empty_state,
    is_airborne,
    later,
    moves,
    own_time,
    scene_of,
    since,
)

MAX_STEPS = 100_000_000
"""Number of timesteps after which the engine ends a shot with the status "step_limit": seconds with two balls."""

_LOOK_AFTER = 10_000_000  # pairs of balls tested between two calls of `interrupted`: about ten milliseconds
_PAIRS_PER_EVENT = 500  # pairs that are tested in the time of one event of `engine.pic`


class PitWorkspace(NamedTuple):
    """The arrays in which shots of n balls are run, one after the other.

    Attributes:
        state: The `State` of the balls.
        contacts: The `Contacts` of one step.
        scratch: The `Scratch` arrays for their resolution.
        here: (n, 4 or, with flight, 6) float64, position and velocity at the end of the step, in the columns X, Y, VX
            and VY, then UP and UP_SPEED.
        back: (n,) float64, time by which a fix moves a ball back along its path, s.
        phase_end_hi: (n,) float64, time at which a ball's phase ends, s; infinite if it does not.
        phase_end_lo: (n,) float64, its second part.
        moving: (n,) int64, the numbers of the balls that move in the step.
        moved: (n,) bool, whether a ball moves in the step.
        changed: (n,) bool, whether the motion of a ball has changed in the step.
    """

    state: State
    contacts: Contacts
    scratch: Scratch
    here: Any
    back: Any
    phase_end_hi: Any
    phase_end_lo: Any
    moving: Any
    moved: Any
    changed: Any


@allocating
def make_workspace(scene):
    """Returns the `PitWorkspace` for the balls of a scene."""
    n = len(scene.radius)
    most = max(1, n * (n - 1) // 2)
    return PitWorkspace(
        state=empty_state(n, scene.flight),
        contacts=empty_contacts(most, scene.flight),
        scratch=empty_scratch(n, most, scene.laws.friction, scene.flight),
        here=np.empty((n, 4 if scene.flight is None else 6)),
        back=np.empty(n),
        phase_end_hi=np.empty(n),
        phase_end_lo=np.empty(n),
        moving=np.empty(n, np.int64),
        moved=np.empty(n, np.bool_),
        changed=np.empty(n, np.bool_),
    )


@kernel
def _predict_phase_end(i, work):  # out: work
    """Computes the time at which ball i's phase ends."""
    time = Time(math.inf, 0.0)
    phase = work.state.phase[i]
    if phase != POTTED and not is_airborne(work.state.flight, phase) and work.state.rows[i, LASTS] < math.inf:
        time = later(own_time(work.state, i), work.state.rows[i, LASTS])
    work.phase_end_hi[i], work.phase_end_lo[i] = time.hi, time.lo


@inlined
def _begin_phases(scene, work, log):  # out: work, log
    """Begins the next phase of the balls that have changed, and lists the balls that move. Returns their number."""
    state, here = work.state, work.here
    count = 0
    for i in range(len(work.moved)):
        if work.changed[i]:
            begin_phase(state, i, scene.numbers)
            log_segment(log, state, i)
            work.changed[i] = False
            _predict_phase_end(i, work)
        work.moved[i] = moves(state, i)
        if work.moved[i]:
            work.moving[count] = i
            count += 1
        else:
            here[i, X], here[i, Y], here[i, VX], here[i, VY] = state.rows[i, X], state.rows[i, Y], 0.0, 0.0
            find_height(scene.flight, i, 0.0, scene.numbers, work)
    return count


@kernel
def _next_phase_end(work):
    """Returns the earliest time at which a phase ends, s."""
    end = math.inf
    for i in range(len(work.phase_end_hi)):
        end = min(end, work.phase_end_hi[i])
    return end


@kernel
def _end_next_phase(k, scene, work, shots, log):  # out: work, shots, log
    """Ends the phase that ends first, and begins the next one of that ball."""
    state, phase = work.state, work.state.phase
    first = 0
    for i in range(1, len(phase)):
        if before(
            Time(work.phase_end_hi[i], work.phase_end_lo[i]), Time(work.phase_end_hi[first], work.phase_end_lo[first])
        ):
            first = i
    kind = phase_end(phase[first])
    time = Time(work.phase_end_hi[first], work.phase_end_lo[first])
    end_phase(state, first, time, scene.numbers)
    kind = phase_ended(kind, state.rows[first])
    begin_phase(state, first, scene.numbers)
    record_event((kind, first, -1, 0.0), time, k, state, shots, log)
    log_segment(log, state, first)
    _predict_phase_end(first, work)


@inlined
def _test_pockets_of(i, now, k, scene, work, shots, log):  # out: work, shots, log
    """Captures ball i if its centre, in `here`, is inside a pocket at a `Time`. Returns whether it is."""
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
def _test_pockets(now, count, k, scene, work, shots, log):  # out: work, shots, log
    """Computes the motion of the `count` moving balls at a `Time` in `here`, and captures the balls in pockets.

    Balls in the air land, hit a nose that they have passed, are potted, or are driven off the table. Returns whether
    any of this happens.
    """
    here, has_capture = work.here, False
    for m in range(count):
        i = work.moving[m]
        t = since(now, own_time(work.state, i))
        here[i, X], here[i, Y], here[i, VX], here[i, VY] = motion_after(work.state, i, t)
        find_height(scene.flight, i, t, scene.numbers, work)
        if is_airborne(scene.flight, work.state.phase[i]):
            has_capture = end_flight(scene.flight, i, now, k, scene, work, shots, log) or has_capture
        else:
            has_capture = _test_pockets_of(i, now, k, scene, work, shots, log) or has_capture
    return has_capture


@inlined
def _overlap(flight, i, j, here, scene):
    """Returns the unit normal from ball i to ball j and the speed of approach, m/s; negative without an impact."""
    none, reach = (0.0, 0.0, 0.0), contact_distance(scene.spheres, scene.radius, i, j)
    dx, dy = here[j, X] - here[i, X], here[j, Y] - here[i, Y]
    if dx * dx + dy * dy >= reach * reach:
        return none, -1.0
    if flight is None:
        return _overlap_on_cloth(i, j, dx, dy, here)
    return overlap_in_space(i, j, reach, here)


@inlined
def _overlap_on_cloth(i, j, dx, dy, here):
    """Implements `_overlap` for balls that overlap on the cloth; (dx, dy) is the way from ball i to ball j, m."""
    wx, wy, distance = here[j, VX] - here[i, VX], here[j, VY] - here[i, VY], norm(dx, dy)
    if distance == 0.0:
        dx, dy, distance = -wx, -wy, norm(wx, wy)
        if distance == 0.0:
            return (0.0, 0.0, 0.0), -1.0
    nx, ny = dx / distance, dy / distance
    return (nx, ny, 0.0), -(nx * wx + ny * wy)


@kernel
def _find_overlaps(count, scene, work):  # out: work
    """Finds the pairs that overlap and do not separate, with at least one of the `count` moving balls.

    Returns their number. If two balls have the same centre, their relative velocity replaces the line of centres.
    """
    here, phase, contacts = work.here, work.state.phase, work.contacts
    n_overlaps = 0
    for m in range(count):
        i = work.moving[m]
        if phase[i] == POTTED:
            continue
        for j in range(len(phase)):
            if j == i or (j < i and work.moved[j]) or phase[j] == POTTED:
                continue
            n, closing = _overlap(scene.flight, i, j, here, scene)
            if closing < 0.0:
                continue
            contacts.first[n_overlaps], contacts.second[n_overlaps], contacts.closing[n_overlaps] = i, j, closing
            set_normal(contacts, n_overlaps, n)
            n_overlaps += 1
    return n_overlaps


@inlined
def _resolve_overlaps(count, now, k, scene, work, shots, log):  # out: work, shots, log
    """Resolves and records the impacts of `count` overlapping pairs at a `Time`."""
    state, contacts, here, fix = work.state, work.contacts, work.here, scene.numbers.fix
    for c in range(count):
        for i in (contacts.first[c], contacts.second[c]):
            advance(state, i, now, scene.numbers)
            work.changed[i] = True
    count = fix_before(fix, count, scene, work)
    if count > 0:
        exchange(restitution_at(count, contacts, scene), count, contacts, state, scene, work.scratch)
        push_aside(scene.flight, count, contacts, state, scene)
    if fix_after(fix, count, scene, work):
        shots.time[k] = now.hi  # the balls may be at rest already
    for c in range(count):
        i, j = min(contacts.first[c], contacts.second[c]), max(contacts.first[c], contacts.second[c])
        for b in (i, j):
            here[b, VX], here[b, VY] = state.rows[b, VX], state.rows[b, VY]
        if contacts.closing[c] == 0.0:  # they overlap without an impact
            continue
        count_hit(k, i, j, now, shots)
        record_event((BALL_BALL, i, j, contacts.closing[c]), now, k, state, shots, log)
    for c in range(count):
        for i in (contacts.first[c], contacts.second[c]):
            land_pressed(scene.flight, i, now, k, scene, work, shots, log)


@inlined
def _overlap_of(i, wall, scene, work):
    """Returns how long ago ball i, which overlaps a cushion or touches it, first touched it, s."""
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
def _hit_cushions(i, wall, key, scene, work):  # out: work
    """Reflects ball i at a cushion if it is beyond it and does not come back, and at another that it then touches.

    `key` is the `scatter_key` of the impact.

    Returns:
        (wall, other, speed, other_speed): the cushions that act, -1 for none, and the speeds of approach, m/s. The
        first speed is 0 if the ball was only moved back, and -1 if nothing happened.
    """
    state, here, numbers, radius = work.state, work.here, scene.numbers, scene.radius[i]
    beyond, nx, ny = scene.walls.overlap(here[i, X], here[i, Y], radius, wall, scene)
    speed = nx * here[i, VX] + ny * here[i, VY]
    if beyond <= 0.0 or speed < 0.0:
        return wall, -1, -1.0, 0.0
    if speed > 0.0:
        wall = _first_overlap(i, wall, scene, work)
        beyond, nx, ny = scene.walls.overlap(here[i, X], here[i, Y], radius, wall, scene)
        speed = nx * here[i, VX] + ny * here[i, VY]
    nx, ny, speed = fix_at_cushion(numbers.fix, i, wall, beyond, Bounce(nx, ny, speed), scene, work)
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
            fix_in_corner(numbers.fix, i, other, (nx, ny), (mx, my), scene, work)
            reflect_both(state, i, (nx, ny), (mx, my), (0.0, 0.0), scene)
        here[i, VX], here[i, VY] = state.rows[i, VX], state.rows[i, VY]
    fix_after_cushion(numbers.fix, i, scene, work)
    return wall, other, speed, other_speed


@inlined
def _test_cushions(now, k, scene, work, shots, log):  # out: work, shots, log
    """Reflects the balls that are beyond a cushion at a `Time`. Returns whether there are balls beyond a cushion."""
    state, numbers, box, has_rebound = work.state, scene.numbers, scene.outline.box, False
    for i in range(len(work.moved)):
        if not (work.moved[i] or work.changed[i]) or state.phase[i] == POTTED:
            continue
        radius = scene.radius[i]
        if is_airborne(scene.flight, state.phase[i]):
            has_rebound = hit_noses(scene.flight, i, now, k, scene, work, shots, log) or has_rebound
            continue
        if abs(work.here[i, X]) <= box[X] - radius and abs(work.here[i, Y]) <= box[Y] - radius:
            continue
        for turn in range(TURNS):
            x, y, vx, vy = work.here[i, X], work.here[i, Y], work.here[i, VX], work.here[i, VY]
            wall = scene.walls.next_overlap(x, y, vx, vy, radius, turn, scene)
            if wall < 0:
                continue
            advance(state, i, now, numbers)
            key = scatter_key(scene.scatter, k, i, shots.cushions[k, i])
            wall, other, speed, other_speed = _hit_cushions(i, wall, key, scene, work)
            work.changed[i] = has_rebound = True
            if speed >= 0.0:
                shots.time[k] = now.hi
            for hit, at_speed in ((wall, speed), (other, other_speed)):
                if hit >= 0 and at_speed > 0.0:
                    shots.cushions[k, i] += 1
                    record_event((BALL_CUSHION, i, hit, at_speed), now, k, state, shots, log)
        if phase_of(ball_of(state.rows[i]), numbers) < ROLLING:  # it has stopped, so this is its last test
            if fix_at_rest(numbers.fix, i, scene, work):
                advance(state, i, now, numbers)
                work.changed[i] = has_rebound = True
                shots.time[k] = now.hi
            if work.changed[i]:
                _test_pockets_of(i, now, k, scene, work, shots, log)
    return has_rebound


@inlined
def _end_phases(until, next_end, max_events, k, scene, work, shots, log):  # out: work, shots, log
    """Ends the phases until a time, s, the first of which ends at `next_end`; at most `max_events` events happen.

    Returns:
        The time at which the next phase ends, s, and whether any has ended.
    """
    has_ended = False
    while next_end <= until and next_end < math.inf and shots.n_events[k] < max_events:
        _end_next_phase(k, scene, work, shots, log)
        next_end, has_ended = _next_phase_end(work), True
    return next_end, has_ended


@inlined
def _is_in_motion(next_end, count, scene):
    """Returns whether a ball moves or turns. In ideal motion and in the air a phase of the `count` balls has no end."""
    return next_end < math.inf or (count > 0 and (scene.flight is not None or scene.numbers.motion == IDEAL))


@inlined
def _test(now, count, k, scene, work, shots, log):  # out: work, shots, log
    """Moves the `count` moving balls to a `Time` and tests for contacts. Returns whether any motion changes."""
    has_capture = _test_pockets(now, count, k, scene, work, shots, log)
    overlaps = _find_overlaps(count, scene, work)
    if overlaps > 0:
        _resolve_overlaps(overlaps, now, k, scene, work, shots, log)
    has_rebound = _test_cushions(now, k, scene, work, shots, log)
    return has_capture or overlaps > 0 or has_rebound


@inlined
def run(k, scene, work, limit, max_events, shots, log):  # out: work, shots, log
    """Runs shot k to rest, to the time `limit` (s), to `max_events` events or to MAX_STEPS timesteps.

    Returns:
        The amount of work, in the unit of `runner.LOOK_AFTER`, or INTERRUPTED.
    """
    state, n, dt = work.state, len(scene.radius), scene.numbers.dt
    work.changed[:] = True
    clear_log(log)
    shots.time[k] = 0.0
    steps_between_looks = _LOOK_AFTER // (n * n + 8) + 1
    pause = min(limit, dt * steps_between_looks)
    step, count, next_end, changed, pending = 0, 0, math.inf, True, 0
    while True:
        if changed:
            count = _begin_phases(scene, work, log)
            next_end = _next_phase_end(work)
            pending += n * scene.numbers.cushion_work
            if pending > LOOK_AFTER:
                pause, pending = 0.0, 0  # looks in this step
        step += 1
        now = Time(step * dt, 0.0)
        until = min(now.hi, limit) if count > 0 else limit
        next_end, changed = _end_phases(until, next_end, max_events, k, scene, work, shots, log)
        if shots.n_events[k] >= max_events and _is_in_motion(next_end, count, scene):
            end_at(Time(shots.time[k], 0.0), k, state, scene, shots, AT_EVENT_LIMIT)
            break
        if count == 0 or now.hi > limit:
            if limit < math.inf:
                end_at(Time(limit, 0.0), k, state, scene, shots, AT_MAX_TIME)
            break
        if step > MAX_STEPS and now.hi > pause:
            end_at(now, k, state, scene, shots, AT_STEP_LIMIT)
            break
        if now.hi > pause:
            if interrupted():
                return INTERRUPTED
            pause = min(limit, dt * min(MAX_STEPS, step + steps_between_looks))
        changed = _test(now, count, k, scene, work, shots, log) or changed
    return step * (n * n + 8) // _PAIRS_PER_EVENT + pending


_run_all = for_all_shots(run)


@allocating
def _run_shots(kernels, begin, end, scene, limit, max_events, shots, log):  # out: shots, log
    """Runs shots, see `run_shots`. Returns whether it was interrupted."""
    work = make_workspace(scene_of(kernels, scene, 0))
    return _run_all(range(begin, end), kernels, scene, work, limit, max_events, shots, log)


@entry_point
def run_shots(kernels, begin, end, scene, limit, max_events, shots, log):  # out: shots, log
    """Runs shots of a batch in place, as `engine.pic.run_shots` does and with the same arguments."""
    end_call(_run_shots(kernels, begin, end, scene, limit, max_events, shots, log))
