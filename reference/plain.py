"""The engine without any of its savings, for tests to compare it with: every prediction solved at once, all scanned.

The laws (motion, contact times, impulses, the contact-time rule) are the engine's own kernels; what is written again
here is only in what order they are asked what happens next.
"""

from __future__ import annotations

import math

import numpy as np

from billiards_env.engine.contact_rule import NOISE, collide, empty_memory, forget, hit_cushion
from billiards_env.engine.log import (
    BALL_BALL,
    BALL_CUSHION,
    BALL_POCKET,
    ROLLING_REST,
    SLIDING_ROLLING,
    SPINNING_REST,
    log_event,
    log_segment,
)
from billiards_env.engine.shots import AT_EVENT_LIMIT, AT_MAX_TIME, AT_REST, Shots, load, store
from billiards_env.physics.clusters import empty_contacts, empty_scratch
from billiards_env.physics.contact import circle_time, line_time
from billiards_env.physics.jit import allocating, entry_point, kernel
from billiards_env.physics.motion import capture, finish, move, norm, place, start
from billiards_env.physics.state import (
    AX,
    AY,
    CONTACT_GAP,
    HALF_LENGTH,
    HALF_WIDTH,
    LASTS,
    POTTED,
    REST,
    ROLLING,
    SLIDING,
    T0,
    T0_LO,
    VX,
    VY,
    WIDTH,
    SceneArrays,
    X,
    Y,
    later,
    since,
)

_SOON = 1e-6  # s; as in the engine


@kernel
def predict_ball(i, state, phase, params, radius, pockets, own, own_kind):
    """The next event of ball i alone, counted from its own time: own[i] = (hi, lo), own_kind[i] = (kind, other)."""
    own[i, 0], own[i, 1] = math.inf, 0.0
    p = phase[i]
    if p in (REST, POTTED):
        return
    s = state[i]
    end = s[LASTS]
    kind, other = SPINNING_REST, -1
    if p == SLIDING:
        kind = SLIDING_ROLLING
    elif p == ROLLING:
        kind = ROLLING_REST
    if p >= ROLLING:
        room_x, room_y = params[HALF_LENGTH] - radius[i], params[HALF_WIDTH] - radius[i]
        for k in range(4):
            sign = 1.0 if k % 2 else -1.0
            if k < 2:
                t = line_time(room_x - sign * s[X], sign * s[VX], sign * s[AX], end)
            else:
                t = line_time(room_y - sign * s[Y], sign * s[VY], sign * s[AY], end)
            if t < end or (t == end and kind != BALL_CUSHION and t < math.inf):
                end, kind, other = t, BALL_CUSHION, k
        for k in range(len(pockets)):
            dx, dy = pockets[k, 0] - s[X], pockets[k, 1] - s[Y]
            t = circle_time(dx, dy, -s[VX], -s[VY], -s[AX], -s[AY], pockets[k, 2], end, 0.0)
            if t < end or (t == end and kind != BALL_POCKET and t < math.inf):
                end, kind, other = t, BALL_POCKET, k
    if end < math.inf:
        own[i, 0], own[i, 1] = later(s[T0], s[T0_LO], end)
        own_kind[i, 0], own_kind[i, 1] = kind, other


@kernel
def predict_pair(i, j, hi, lo, state, phase, radius, own, own_kind, limit, pair, pair_lo):
    """When balls i < j next meet, looking from the time (hi, lo): pair[i, j], pair_lo[i, j]."""
    pair[i, j] = math.inf
    if (phase[i] < ROLLING or phase[i] == POTTED) and (phase[j] < ROLLING or phase[j] == POTTED):
        return
    if phase[i] == POTTED or phase[j] == POTTED:
        return
    # Whatever ends either ball's motion has the pair predicted anew; a change of phase that is due now does so at once.
    for k in (i, j):
        if own[k, 0] <= hi and own_kind[k, 0] in (SLIDING_ROLLING, ROLLING_REST):
            return
    end = min(min(own[i, 0], own[j, 0]), limit) - hi
    ti = since(hi, lo, state[i, T0], state[i, T0_LO])
    tj = since(hi, lo, state[j, T0], state[j, T0_LO])
    xi, yi, vxi, vyi = place(state, phase, i, ti)
    xj, yj, vxj, vyj = place(state, phase, j, tj)
    t = circle_time(
        xj - xi,
        yj - yi,
        vxj - vxi,
        vyj - vyi,
        state[j, AX] - state[i, AX],
        state[j, AY] - state[i, AY],
        radius[i] + radius[j],
        end,
        NOISE * (norm(vxi, vyi) + norm(vxj, vyj)),
    )
    if t < math.inf:
        pair[i, j], pair_lo[i, j] = later(hi, lo, t)


@kernel
def predict(i, hi, lo, state, phase, params, radius, pockets, limit, own, own_kind, pair, pair_lo):
    """Predicts anew for ball i, whose own time is (hi, lo), with every other ball."""
    predict_ball(i, state, phase, params, radius, pockets, own, own_kind)
    for j in range(len(phase)):
        if j < i:
            predict_pair(j, i, hi, lo, state, phase, radius, own, own_kind, limit, pair, pair_lo)
        elif j > i:
            predict_pair(i, j, hi, lo, state, phase, radius, own, own_kind, limit, pair, pair_lo)


@kernel
def gather(hi, lo, state, phase, params, radius, pair, pair_lo, contacts):
    """Pairs whose impact is due at (hi, lo), or that touch and approach then. Returns their number.

    Balls that take part are brought to that instant.
    """
    count = 0
    n = len(phase)
    for i in range(n):
        for j in range(i + 1, n):
            if pair[i, j] - hi > _SOON:
                continue
            due = pair[i, j] == hi and pair_lo[i, j] == lo
            ti = since(hi, lo, state[i, T0], state[i, T0_LO])
            tj = since(hi, lo, state[j, T0], state[j, T0_LO])
            xi, yi, vxi, vyi = place(state, phase, i, ti)
            xj, yj, vxj, vyj = place(state, phase, j, tj)
            dx, dy = xj - xi, yj - yi
            distance = norm(dx, dy)
            ex, ey = dx / distance, dy / distance
            speed = -(ex * (vxj - vxi) + ey * (vyj - vyi))
            if due:
                speed = max(speed, 0.0)
            elif distance - (radius[i] + radius[j]) > CONTACT_GAP or speed <= 0.0:
                continue
            move(state, phase, i, hi, lo, params)
            move(state, phase, j, hi, lo, params)
            contacts.first[count], contacts.second[count] = i, j
            contacts.nx[count], contacts.ny[count], contacts.closing[count] = ex, ey, speed
            count += 1
    return count


@allocating
def run(state, phase, scene, limit, max_events, hits, counts, log):
    """Runs one shot to rest, to the time `limit` or to `max_events` events.

    Args:
        state: (n, WIDTH) float64 at time 0, see `physics.state`; at the shot's end on return.
        phase: (n,) int8; POTTED balls are out of play.
        scene: A `SceneArrays`.
        limit: s; may be infinite unless motion is ideal.
        max_events: The shot is given up after so many.
        hits: (n, 2) int32 out, see `engine.log`.
        counts: (N_COUNTS,) int64 out, see `engine.log`.
        log: A `Log`.

    Returns:
        The time at which the shot ended, s.
    """
    n = len(phase)
    params, radius, inv_mass, pockets = scene
    events, segments, used = log
    own, own_kind = np.empty((n, 2)), np.empty((n, 2), np.int64)
    pair, pair_lo = np.full((n, n), math.inf), np.zeros((n, n))
    most = max(1, n * (n - 1) // 2)
    contacts, scratch, memory = empty_contacts(most), empty_scratch(n, most), empty_memory(n)
    first, second, closing = contacts.first, contacts.second, contacts.closing
    forget(memory)

    hits[:, CUSHIONS], hits[:, CUSHIONS_BEFORE_HIT] = 0, -1
    counts[N_EVENTS], counts[ENDED], counts[FIRST_HIT], counts[N_CONTACT_RULE] = 0, AT_REST, -1, 0
    used[0] = used[1] = 0
    for i in range(n):
        start(state, phase, i, params)
        log_segment(segments, used, state, phase, i)
        predict_ball(i, state, phase, params, radius, pockets, own, own_kind)
    for i in range(n):
        for j in range(i + 1, n):
            predict_pair(i, j, 0.0, 0.0, state, phase, radius, own, own_kind, limit, pair, pair_lo)

    hi = lo = 0.0
    while True:
        next_hi, next_lo, b = math.inf, 0.0, -1
        for i in range(n):
            for j in range(i + 1, n):
                if pair[i, j] < next_hi or (pair[i, j] == next_hi and pair_lo[i, j] < next_lo):
                    next_hi, next_lo, b = pair[i, j], pair_lo[i, j], j
        rank = 1  # of kinds at one instant: pocket 0, ball-ball 1, cushion 2, phase change 3
        for i in range(n):
            t, t_lo = own[i, 0], own[i, 1]
            if t > next_hi or t == math.inf:
                continue
            r = 0 if own_kind[i, 0] == BALL_POCKET else (2 if own_kind[i, 0] == BALL_CUSHION else 3)
            if t < next_hi or t_lo < next_lo or (t_lo == next_lo and r < rank):
                next_hi, next_lo, b, rank = t, t_lo, -1, r
        if next_hi > limit:
            if limit < math.inf:
                for i in range(n):
                    if phase[i] != POTTED and phase[i] != REST:
                        counts[ENDED] = AT_MAX_TIME
                        move(state, phase, i, limit, 0.0, params)
                if counts[ENDED] == AT_MAX_TIME:
                    hi = limit
            break
        if next_hi == math.inf:
            break
        if counts[N_EVENTS] >= max_events:
            counts[ENDED] = AT_EVENT_LIMIT
            for i in range(n):
                move(state, phase, i, hi, lo, params)
            break
        hi, lo = next_hi, next_lo
        acts = counts[N_CONTACT_RULE]
        if b >= 0:
            count = gather(hi, lo, state, phase, params, radius, pair, pair_lo, contacts)
            collide(count, hi, contacts, state, params, inv_mass, scratch, memory, counts)
            for c in range(count):
                i, j = first[c], second[c]
                if i == 0:
                    if counts[FIRST_HIT] < 0:
                        counts[FIRST_HIT] = j
                    if hits[j, CUSHIONS_BEFORE_HIT] < 0:
                        hits[j, CUSHIONS_BEFORE_HIT] = hits[0, CUSHIONS]
                start(state, phase, i, params)
                start(state, phase, j, params)
                log_event(events, used, hi, lo, BALL_BALL, i, j, state, closing[c], counts[N_CONTACT_RULE] > acts)
                log_segment(segments, used, state, phase, i)
                log_segment(segments, used, state, phase, j)
                predict_ball(i, state, phase, params, radius, pockets, own, own_kind)
                predict_ball(j, state, phase, params, radius, pockets, own, own_kind)
            counts[N_EVENTS] += count
            for c in range(count):
                predict(first[c], hi, lo, state, phase, params, radius, pockets, limit, own, own_kind, pair, pair_lo)
                predict(second[c], hi, lo, state, phase, params, radius, pockets, limit, own, own_kind, pair, pair_lo)
            continue
        due = np.zeros(n, np.bool_)
        for i in range(n):
            r = 0 if own_kind[i, 0] == BALL_POCKET else (2 if own_kind[i, 0] == BALL_CUSHION else 3)
            due[i] = own[i, 0] == hi and own[i, 1] == lo and r == rank
        for i in range(n):
            if not due[i]:
                continue
            kind, other = own_kind[i, 0], own_kind[i, 1]
            acts = counts[N_CONTACT_RULE]
            speed = 0.0
            if kind == BALL_POCKET:
                move(state, phase, i, hi, lo, params)
                speed = norm(state[i, VX], state[i, VY])
                capture(state, phase, i, pockets[other, 0], pockets[other, 1])
            elif kind == BALL_CUSHION:
                move(state, phase, i, hi, lo, params)
                speed = hit_cushion(i, other, hi, state, params, radius, memory, counts)
                start(state, phase, i, params)
                hits[i, CUSHIONS] += 1
            else:
                finish(state, phase, i, hi, lo, params)
            counts[N_EVENTS] += 1
            log_event(events, used, hi, lo, kind, i, other, state, speed, counts[N_CONTACT_RULE] > acts)
            log_segment(segments, used, state, phase, i)
        for i in range(n):
            if due[i]:
                predict_ball(i, state, phase, params, radius, pockets, own, own_kind)
        for i in range(n):
            if due[i]:
                predict(i, hi, lo, state, phase, params, radius, pockets, limit, own, own_kind, pair, pair_lo)
    return hi


@entry_point
def run_shots(begin, end, scene, limit, max_events, shots, log):
    """Runs shots `begin` to `end` of a batch, in place; see `pic.run_shots`, which takes the same arguments."""
    arrays, balls = SceneArrays(*scene), Shots(*shots)
    state, phase = np.empty((len(arrays.radius), WIDTH)), np.empty(len(arrays.radius), np.int8)
    for k in range(begin, end):
        load(balls, k, arrays, state, phase)
        balls.times[k] = run(state, phase, arrays, limit, max_events, balls.hits[k], balls.counts[k], log)
        store(balls, k, arrays, state, phase)
