"""PIT, periodic interference test: time advances by a step dt, and what overlaps after it is dealt with.

The balls move by the very law of motion of `engine.pic`, in closed form and with every change of phase at its own
instant; the only difference is when contacts are noticed. At each multiple of dt, in this order, balls whose centre is
inside a pocket are captured, pairs that overlap and do not part collide, all of them as one problem, and balls beyond
a cushion that do not come back bounce; each with the impulses of `physics.impulse`, at the places where the balls are
found. What a step passes over is lost: that is the method (see the README's "What a timestep does").

The overlap that is found late is "fixed" in one of three ways, as the paper leaves open which:

* push_apart (the default): balls are moved apart along their line of centres until they touch, the lighter one
  further, and a ball beyond a cushion is put against it; after the impulse, which takes the line of centres as found.
* move_back: balls go back along their paths, for a step at most, to where they touched, before the impulse, which then
  has the right line of centres; they start again from there, late by the time they went back.
* none: positions stay as they are found.
"""

from __future__ import annotations

import math

import numpy as np

from billiards_env.engine.log import (
    AT_EVENT_LIMIT,
    AT_MAX_TIME,
    AT_REST,
    AT_STEP_LIMIT,
    BALL_BALL,
    BALL_CUSHION,
    BALL_POCKET,
    CUSHIONS,
    CUSHIONS_BEFORE_HIT,
    ENDED,
    FIRST_HIT,
    INTERRUPTED,
    N_CONTACT_RULE,
    N_EVENTS,
    ROLLING_REST,
    SLIDING_ROLLING,
    SPINNING_REST,
    Log,
    SceneArrays,
    Shots,
    clear_log,
    load,
    log_event,
    log_segment,
    store,
)
from billiards_env.physics.ball_ball import exchange
from billiards_env.physics.clusters import empty_contacts, empty_scratch, sum_impulses
from billiards_env.physics.cushion import reflect
from billiards_env.physics.interrupt import end_call, interrupted
from billiards_env.physics.jit import allocating, entry_point, kernel
from billiards_env.physics.motion import capture, finish, move, norm, place, start
from billiards_env.physics.state import (
    CONTACT_GAP,
    DT,
    FIX,
    HALF_LENGTH,
    HALF_WIDTH,
    IDEAL,
    LASTS,
    MOTION,
    MOVE_BACK,
    POTTED,
    PUSH_APART,
    REST,
    ROLLING,
    SLIDING,
    T0,
    T0_LO,
    VX,
    VY,
    WIDTH,
    X,
    Y,
    later,
    since,
)

MAX_STEPS = 100_000_000
"""The engine gives up a shot, with status "step_limit", after this number of timesteps: seconds with two balls."""

_LOOK_AFTER = 10_000_000  # units of a step's work, which grows with the pairs of balls: some ten milliseconds


@kernel
def predict_change(i, state, phase, change):
    """When ball i's phase ends by itself: change[i] = (hi, lo)."""
    change[i, 0], change[i, 1] = math.inf, 0.0
    if phase[i] != POTTED and state[i, LASTS] < math.inf:
        change[i, 0], change[i, 1] = later(state[i, T0], state[i, T0_LO], state[i, LASTS])


@kernel
def find_overlaps(moves, moving, moved, here, phase, radius, first, second, nx, ny, closing):
    """Pairs that overlap and do not part, at least one of them a ball that moved in this step. Returns their number.

    Two balls at the very same place take the direction in which they came for their line of centres.
    """
    count = 0
    for k in range(moves):
        i = moving[k]
        if phase[i] == POTTED:
            continue
        for j in range(len(phase)):
            if j == i or (j < i and moved[j]) or phase[j] == POTTED:
                continue
            dx, dy = here[j, 0] - here[i, 0], here[j, 1] - here[i, 1]
            reach = radius[i] + radius[j]
            if dx * dx + dy * dy >= reach * reach:
                continue
            wx, wy = here[j, 2] - here[i, 2], here[j, 3] - here[i, 3]
            distance = norm(dx, dy)
            if distance == 0.0:
                dx, dy, distance = -wx, -wy, norm(wx, wy)
                if distance == 0.0:
                    continue
            ex, ey = dx / distance, dy / distance
            speed = -(ex * wx + ey * wy)
            if speed < 0.0:
                continue
            first[count], second[count] = i, j
            nx[count], ny[count], closing[count] = ex, ey, speed
            count += 1
    return count


@kernel
def go_back(count, dt, state, radius, here, back, first, second, nx, ny, closing):
    """Takes the balls of `count` contacts back along their paths to where they touched.

    A ball in several contacts goes back to the first of them; the others may have vanished then.

    Returns:
        The number of contacts that are left.
    """
    for c in range(count):
        back[first[c]] = back[second[c]] = 0.0
    for c in range(count):
        i, j = first[c], second[c]
        dx, dy = here[j, 0] - here[i, 0], here[j, 1] - here[i, 1]
        wx, wy = here[j, 2] - here[i, 2], here[j, 3] - here[i, 3]
        reach = radius[i] + radius[j]
        ww, dw = wx * wx + wy * wy, dx * wx + dy * wy
        if ww > 0.0:  # |d - w t| = reach
            t = (dw + math.sqrt(max(0.0, dw * dw + ww * (reach * reach - (dx * dx + dy * dy))))) / ww
            t = min(t, dt)
            back[i], back[j] = max(back[i], t), max(back[j], t)
    for c in range(count):
        for k in (first[c], second[c]):
            here[k, 0] -= back[k] * here[k, 2]
            here[k, 1] -= back[k] * here[k, 3]
            state[k, X], state[k, Y] = here[k, 0], here[k, 1]
            back[k] = 0.0
    left = 0
    for c in range(count):
        i, j = first[c], second[c]
        dx, dy = here[j, 0] - here[i, 0], here[j, 1] - here[i, 1]
        distance = norm(dx, dy)
        if distance > radius[i] + radius[j] + CONTACT_GAP:
            continue
        ex, ey = (dx / distance, dy / distance) if distance > 0.0 else (nx[c], ny[c])
        speed = -(ex * (here[j, 2] - here[i, 2]) + ey * (here[j, 3] - here[i, 3]))
        if speed >= 0.0:
            first[left], second[left], nx[left], ny[left], closing[left] = i, j, ex, ey, speed
            left += 1
    return left


@kernel
def push_apart(count, contacts, state, radius, inv_mass, here, scratch):
    """Moves the balls of `count` contacts apart along their lines of centres until each pair touches."""
    first, second, shift, done = contacts.first, contacts.second, scratch.dv, scratch.done
    overlap, scale = scratch.descent[0], scratch.descent[1]
    for c in range(count):
        i, j = first[c], second[c]
        distance = norm(here[j, 0] - here[i, 0], here[j, 1] - here[i, 1])
        overlap[c], scale[c] = radius[i] + radius[j] - distance, 1.0 / (inv_mass[i] + inv_mass[j])
    sum_impulses(count, contacts, overlap, scale, inv_mass, shift, done)
    for c in range(count):
        for k in (first[c], second[c]):
            if done[k]:
                here[k, 0] += shift[k, 0]
                here[k, 1] += shift[k, 1]
                state[k, X], state[k, Y] = here[k, 0], here[k, 1]
                done[k] = False


@kernel
def meet_cushion(i, side, dt, fix, state, radius, params, here):
    """Bounces ball i off cushion `side` if it is beyond it and does not come back.

    Returns:
        Its speed of approach, m/s, 0 if it was only put back, or -1 if nothing happened.
    """
    x = 0 if side < 2 else 1  # the column of the normal coordinate, in `here` and in `state`
    sign = 1.0 if side % 2 else -1.0
    room = params[HALF_LENGTH if side < 2 else HALF_WIDTH] - radius[i]
    beyond, speed = sign * here[i, x] - room, sign * here[i, x + 2]
    if beyond <= 0.0 or speed < 0.0 or (speed == 0.0 and fix != PUSH_APART):
        return -1.0
    if fix == PUSH_APART:
        here[i, x] = sign * room
    elif fix == MOVE_BACK:
        t = min(beyond / speed, dt)
        here[i, 0] -= t * here[i, 2]
        here[i, 1] -= t * here[i, 3]
    state[i, X], state[i, Y] = here[i, 0], here[i, 1]
    if speed > 0.0:
        reflect(state, i, side, 0.0, radius, params)
        here[i, 2], here[i, 3] = state[i, VX], state[i, VY]
    return speed


@allocating
def workspace(n):
    """The arrays that a shot of n balls is run with."""
    most = max(1, n * (n - 1) // 2)
    contacts, scratch = empty_contacts(most), empty_scratch(n, most)
    here, back = np.empty((n, 4)), np.empty(n)  # x, y, vx, vy at this test; how long a ball goes back, s
    change = np.empty((n, 2))  # when each ball's phase ends by itself, (hi, lo)
    moving = np.empty(n, np.int64)  # the balls that are under way when the step begins
    return contacts, scratch, here, back, change, moving, np.empty(n, np.bool_), np.empty(n, np.bool_)


@kernel
def run(state, phase, space, scene, limit, max_events, hits, counts, log):
    """Runs one shot to rest, to the time `limit` or to `max_events` events.

    Args:
        state: (n, WIDTH) float64 at time 0, see `physics.state`; at the shot's end on return.
        phase: (n,) int8; POTTED balls are out of play.
        space: A `workspace`, new or left by another shot.
        scene: A `SceneArrays`; of its params, DT is the step, s, and FIX what is done about overlaps.
        limit: s; may be infinite unless motion is ideal.
        max_events: The shot is given up after so many.
        hits: (n, 2) int32 out, see `engine.log`.
        counts: (N_COUNTS,) int64 out, see `engine.log`.
        log: A `Log`.

    Returns:
        The time at which the shot ended, s, or INTERRUPTED.
    """
    n = len(phase)
    params, radius, inv_mass, pockets = scene
    events, segments, used = log
    dt, fix = params[DT], params[FIX]
    contacts, scratch, here, back, change, moving, moved, changed = space
    first, second, nx, ny, closing, _ = contacts
    moves = 0
    changed[:] = True
    hits[:, CUSHIONS], hits[:, CUSHIONS_BEFORE_HIT] = 0, -1
    counts[N_EVENTS], counts[ENDED], counts[FIRST_HIT], counts[N_CONTACT_RULE] = 0, AT_REST, -1, 0
    clear_log(events, used)
    end, step, next_change = 0.0, 0, math.inf
    between_looks = _LOOK_AFTER // (n * n + 8) + 1
    pause = min(limit, dt * between_looks)
    any_changed = True
    while True:
        if any_changed:
            moves, next_change = 0, math.inf
            for i in range(n):
                if changed[i]:
                    start(state, phase, i, params)
                    log_segment(segments, used, state, phase, i)
                    changed[i] = False
                    predict_change(i, state, phase, change)
                next_change = min(next_change, change[i, 0])
                moved[i] = phase[i] >= ROLLING and phase[i] != POTTED
                if moved[i]:
                    moving[moves] = i
                    moves += 1
                else:
                    here[i, 0], here[i, 1], here[i, 2], here[i, 3] = state[i, X], state[i, Y], 0.0, 0.0
            any_changed = False
        step += 1
        now = step * dt
        until = min(now, limit) if moves > 0 else limit
        while next_change <= until and next_change < math.inf and counts[N_EVENTS] < max_events:
            a = 0
            for i in range(1, n):
                if change[i, 0] < change[a, 0] or (change[i, 0] == change[a, 0] and change[i, 1] < change[a, 1]):
                    a = i
            kind = SLIDING_ROLLING if phase[a] == SLIDING else (ROLLING_REST if phase[a] == ROLLING else SPINNING_REST)
            end, lo = change[a, 0], change[a, 1]
            finish(state, phase, a, end, lo, params)
            counts[N_EVENTS] += 1
            log_event(events, used, end, lo, kind, a, -1, state, 0.0, False)
            log_segment(segments, used, state, phase, a)
            predict_change(a, state, phase, change)
            next_change = change[0, 0]
            for i in range(1, n):
                next_change = min(next_change, change[i, 0])
            any_changed = True
        # What is under way has a next change, but for free balls, which have none.
        under_way = next_change < math.inf or (moves > 0 and params[MOTION] == IDEAL)
        if counts[N_EVENTS] >= max_events and under_way:
            counts[ENDED] = AT_EVENT_LIMIT
            for i in range(n):
                move(state, phase, i, end, 0.0, params)
            break
        if moves == 0 or now > pause:
            if moves == 0 or now > limit:
                if limit < math.inf:
                    for i in range(n):
                        if phase[i] != REST and phase[i] != POTTED:
                            counts[ENDED] = AT_MAX_TIME
                            move(state, phase, i, limit, 0.0, params)
                            end = limit
                break
            if step > MAX_STEPS:
                counts[ENDED], end = AT_STEP_LIMIT, now
                for i in range(n):
                    move(state, phase, i, now, 0.0, params)
                break
            if interrupted():
                return INTERRUPTED
            pause = min(limit, dt * min(MAX_STEPS, step + between_looks))

        for k in range(moves):
            i = moving[k]
            t = since(now, 0.0, state[i, T0], state[i, T0_LO])
            here[i, 0], here[i, 1], here[i, 2], here[i, 3] = place(state, phase, i, t)
            for q in range(len(pockets)):
                dx, dy = here[i, 0] - pockets[q, 0], here[i, 1] - pockets[q, 1]
                if dx * dx + dy * dy < pockets[q, 2] * pockets[q, 2]:
                    move(state, phase, i, now, 0.0, params)
                    capture(state, phase, i, pockets[q, 0], pockets[q, 1])
                    counts[N_EVENTS] += 1
                    log_event(events, used, now, 0.0, BALL_POCKET, i, q, state, norm(here[i, 2], here[i, 3]), False)
                    changed[i] = any_changed = True
                    end = now
                    break

        count = find_overlaps(moves, moving, moved, here, phase, radius, first, second, nx, ny, closing)
        if count > 0:
            any_changed = True
            for c in range(count):
                for k in (first[c], second[c]):
                    move(state, phase, k, now, 0.0, params)
                    changed[k] = True
            if fix == MOVE_BACK:
                count = go_back(count, dt, state, radius, here, back, first, second, nx, ny, closing)
            exchange(count, contacts, state, params, inv_mass, scratch)
            if fix == PUSH_APART:
                push_apart(count, contacts, state, radius, inv_mass, here, scratch)
            for c in range(count):
                i, j = min(first[c], second[c]), max(first[c], second[c])
                for k in (i, j):
                    here[k, 2], here[k, 3] = state[k, VX], state[k, VY]
                if closing[c] == 0.0:  # they only lay in each other
                    continue
                if i == 0:
                    if counts[FIRST_HIT] < 0:
                        counts[FIRST_HIT] = j
                    if hits[j, CUSHIONS_BEFORE_HIT] < 0:
                        hits[j, CUSHIONS_BEFORE_HIT] = hits[0, CUSHIONS]
                counts[N_EVENTS] += 1
                log_event(events, used, now, 0.0, BALL_BALL, i, j, state, closing[c], False)
                end = now

        for i in range(n):
            if not (moved[i] or changed[i]) or phase[i] == POTTED:
                continue
            for side in range(4):
                room = params[HALF_LENGTH if side < 2 else HALF_WIDTH] - radius[i]
                if abs(here[i, 0 if side < 2 else 1]) <= room:
                    continue
                move(state, phase, i, now, 0.0, params)
                speed = meet_cushion(i, side, dt, fix, state, radius, params, here)
                changed[i] = any_changed = True
                if speed > 0.0:
                    hits[i, CUSHIONS] += 1
                    counts[N_EVENTS] += 1
                    log_event(events, used, now, 0.0, BALL_CUSHION, i, side, state, speed, False)
                    end = now
    return end


@kernel
def run_all(begin, end, state, phase, space, scene, limit, max_events, shots, log):
    """`run_shots` with its working arrays; where none are made, none are counted.

    Returns whether it was interrupted.
    """
    steps, between_looks = 0.0, _LOOK_AFTER // (len(phase) * len(phase) + 8)
    for k in range(begin, end):
        load(shots, k, scene, state, phase)
        time = run(state, phase, space, scene, limit, max_events, shots.hits[k], shots.counts[k], log)
        if time == INTERRUPTED:
            return True
        shots.times[k] = time
        store(shots, k, scene, state, phase)
        steps += 1.0 + time / scene.params[DT]
        if steps > between_looks:
            if interrupted():
                return True
            steps = 0.0
    return False


@entry_point
def run_shots(begin, end, scene, limit, max_events, shots, log):
    """Runs shots `begin` to `end` of a batch, in place; see `engine.pic.run_shots`, which takes the same arguments."""
    arrays, n = SceneArrays(*scene), len(scene[1])
    state, phase, space = np.empty((n, WIDTH)), np.empty(n, np.int8), workspace(n)
    end_call(run_all(begin, end, state, phase, space, arrays, limit, max_events, Shots(*shots), Log(*log)))
