"""PIC, predicted instant of collision: from event to event, each at the instant it happens.

What happens next to each ball alone (phase change, cushion, pocket) and to each pair is predicted once and stays true
until one of the balls concerned is touched by an event, see `engine.queue`. The loop takes the earliest prediction,
brings only the balls it concerns to that instant, changes their motion and predicts anew for them. At one instant
pockets come first, then impacts between balls, all of them as one problem, then cushions, then phase changes.
"""

from __future__ import annotations

import math

import numpy as np

from billiards_env.engine.contact_rule import collide, empty_memory, forget, hit_cushion
from billiards_env.engine.log import (
    AT_EVENT_LIMIT,
    AT_MAX_TIME,
    AT_REST,
    BALL_BALL,
    BALL_CUSHION,
    BALL_POCKET,
    CUSHIONS,
    CUSHIONS_BEFORE_HIT,
    ENDED,
    FIRST_HIT,
    INTERRUPTED,
    LOOK_AFTER,
    N_CONTACT_RULE,
    N_EVENTS,
    Log,
    SceneArrays,
    Shots,
    clear_log,
    load,
    log_event,
    log_segment,
    store,
)
from billiards_env.engine.queue import (
    PAIR_RANK,
    earliest,
    note,
    predict_ball,
    predict_pairs,
    rank_of,
    side_by_side,
)
from billiards_env.physics.clusters import empty_contacts, empty_scratch
from billiards_env.physics.interrupt import end_call, interrupted
from billiards_env.physics.jit import allocating, entry_point, inlined, kernel, merged
from billiards_env.physics.motion import capture, end_phase, move, norm, place, start
from billiards_env.physics.state import (
    CONTACT_GAP,
    POTTED,
    REST,
    T0,
    T0_LO,
    VX,
    VY,
    WIDTH,
    since,
)

SOON = 1e-6  # s; pairs predicted to meet within it of an impact are looked at for being part of it


@inlined
def join(i, j, due, due_lo, hi, lo, state, phase, radius, params, count, contacts):
    """Makes balls i < j contact number `count` of (hi, lo) if they meet or touch and approach then. Returns whether.

    They are predicted to meet at (due, due_lo); balls that take part are brought to that instant.
    """
    ti = since(hi, lo, state[i, T0], state[i, T0_LO])
    tj = since(hi, lo, state[j, T0], state[j, T0_LO])
    xi, yi, vxi, vyi = place(state, phase, i, ti)
    xj, yj, vxj, vyj = place(state, phase, j, tj)
    dx, dy = xj - xi, yj - yi
    distance = norm(dx, dy)
    ex, ey = dx / distance, dy / distance
    speed = -(ex * (vxj - vxi) + ey * (vyj - vyi))
    if due == hi and due_lo == lo:
        speed = max(speed, 0.0)
    elif distance - (radius[i] + radius[j]) > CONTACT_GAP or speed <= 0.0:
        return False
    move(state, phase, i, hi, lo, params)
    move(state, phase, j, hi, lo, params)
    contacts.first[count], contacts.second[count] = i, j
    contacts.nx[count], contacts.ny[count], contacts.closing[count] = ex, ey, speed
    return True


@inlined
def gather(hi, lo, state, phase, radius, params, queue, contacts):
    """Pairs whose impact is due at (hi, lo), or that touch and approach then. Returns their number."""
    pair, pair_lo, near, _, _, _ = queue
    count = 0
    n = len(phase)
    for i in range(n):
        if near[i, 0] - hi > SOON:
            continue
        for j in range(i + 1, n):
            if pair[i, j] - hi > SOON:
                continue
            if join(i, j, pair[i, j], pair_lo[i, j], hi, lo, state, phase, radius, params, count, contacts):
                count += 1
    return count


@merged
def impacts(
    count, hi, lo, state, phase, params, inv_mass, contacts, scratch, memory, hits, counts, events, used, changed
):
    """Resolves and logs the first `count` contacts, at (hi, lo). Returns how many balls it puts into `changed`."""
    acts = counts[N_CONTACT_RULE]
    collide(count, hi, contacts, state, params, inv_mass, scratch, memory, counts)
    for c in range(count):
        i, j = contacts.first[c], contacts.second[c]
        if i == 0:
            if counts[FIRST_HIT] < 0:
                counts[FIRST_HIT] = j
            if hits[j, CUSHIONS_BEFORE_HIT] < 0:
                hits[j, CUSHIONS_BEFORE_HIT] = hits[0, CUSHIONS]
        log_event(events, used, hi, lo, BALL_BALL, i, j, state, contacts.closing[c], counts[N_CONTACT_RULE] > acts)
        changed[2 * c], changed[2 * c + 1] = i, j
    counts[N_EVENTS] += count
    return 2 * count


@merged
def alone(i, kind, other, hi, lo, state, phase, params, radius, pockets, memory, hits, counts, events, used):
    """Carries out and logs what happens to ball i alone at (hi, lo), see `queue.predict_ball`."""
    acts = counts[N_CONTACT_RULE]
    speed = 0.0
    if kind == BALL_POCKET:
        move(state, phase, i, hi, lo, params)
        speed = norm(state[i, VX], state[i, VY])
        capture(state, phase, i, pockets[other, 0], pockets[other, 1])
    elif kind == BALL_CUSHION:
        move(state, phase, i, hi, lo, params)
        speed = hit_cushion(i, other, hi, state, params, radius, memory, counts)
        hits[i, CUSHIONS] += 1
    else:
        end_phase(state, phase, i, hi, lo, params)
    counts[N_EVENTS] += 1
    log_event(events, used, hi, lo, kind, i, other, state, speed, counts[N_CONTACT_RULE] > acts)


@merged
def wind_up(hi, state, phase, params, limit, counts):
    """Brings all balls to the shot's end, when nothing more happens before `limit`. Returns its time, s."""
    if limit < math.inf:
        for i in range(len(phase)):
            if phase[i] != POTTED and phase[i] != REST:
                counts[ENDED] = AT_MAX_TIME
                move(state, phase, i, limit, 0.0, params)
    return limit if counts[ENDED] == AT_MAX_TIME else hi


@merged
def run(state, phase, space, scene, limit, max_events, hits, counts, log):
    """Runs one shot to rest, to the time `limit` or to `max_events` events.

    Args:
        state: (n, WIDTH) float64 at time 0, see `physics.state`; at the shot's end on return.
        phase: (n,) int8; POTTED balls are out of play.
        space: A `workspace`, new or left by another shot.
        scene: A `SceneArrays`.
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
    own, own_kind, queue, contacts, scratch, memory, changed, touched = space
    hits[:, CUSHIONS], hits[:, CUSHIONS_BEFORE_HIT] = 0, -1
    counts[N_EVENTS], counts[ENDED], counts[FIRST_HIT], counts[N_CONTACT_RULE] = 0, AT_REST, -1, 0
    clear_log(events, used)
    forget(memory)
    hi = lo = 0.0
    changes = n
    for i in range(n):
        changed[i] = i
    pause = min(max_events, LOOK_AFTER)
    while True:
        for k in range(changes):
            i = changed[k]
            start(state, phase, i, params)
            log_segment(segments, used, state, phase, i)
            predict_ball(i, state, phase, params, radius, pockets, own, own_kind)
            note(i, state, radius, own, queue)
            touched[i] = True
        for k in range(changes):
            predict_pairs(changed[k], hi, lo, state, phase, radius, own, own_kind, limit, queue, touched)
        for k in range(changes):
            touched[changed[k]] = False
        next_hi, next_lo, rank, first, last = earliest(n, own, own_kind, queue)
        if next_hi > limit or next_hi == math.inf:
            break
        if counts[N_EVENTS] >= pause:
            if counts[N_EVENTS] >= max_events:
                counts[ENDED] = AT_EVENT_LIMIT
                for i in range(n):
                    move(state, phase, i, hi, lo, params)
                return hi
            if interrupted():
                return INTERRUPTED
            pause = min(max_events, counts[N_EVENTS] + LOOK_AFTER)
        hi, lo = next_hi, next_lo
        if rank == PAIR_RANK:
            count = gather(hi, lo, state, phase, radius, params, queue, contacts)
            changes = impacts(
                count,
                hi,
                lo,
                state,
                phase,
                params,
                inv_mass,
                contacts,
                scratch,
                memory,
                hits,
                counts,
                events,
                used,
                changed,
            )
        else:
            changes = 0
            for i in range(first, last + 1):  # all of one kind, so that their order does not matter
                if own[i, 0] == hi and own[i, 1] == lo and rank_of(own_kind[i, 0]) == rank:
                    kind, other = own_kind[i, 0], own_kind[i, 1]
                    alone(
                        i,
                        kind,
                        other,
                        hi,
                        lo,
                        state,
                        phase,
                        params,
                        radius,
                        pockets,
                        memory,
                        hits,
                        counts,
                        events,
                        used,
                    )
                    changed[changes] = i
                    changes += 1
    return wind_up(hi, state, phase, params, limit, counts)


@allocating
def workspace(n):
    """The arrays that a shot of n balls is run with, see `run`."""
    most = max(1, n * (n - 1) // 2)  # contacts at one instant
    own, own_kind = np.empty((n, 2)), np.empty((n, 2), np.int64)
    queue = (
        np.full((n, n), math.inf),
        np.zeros((n, n)),
        np.empty((n, 2)),
        np.empty(n, np.int64),
        *side_by_side(n),
    )
    return (
        own,
        own_kind,
        queue,
        empty_contacts(most),
        empty_scratch(n, most),
        empty_memory(n),
        np.empty(2 * most + n, np.int64),
        np.zeros(n, np.bool_),
    )


@kernel
def run_all(begin, end, state, phase, space, scene, limit, max_events, shots, log):
    """`run_shots` with its working arrays; where none are made, none are counted.

    Returns whether it was interrupted.
    """
    events = 0
    for k in range(begin, end):
        load(shots, k, scene, state, phase)
        time = run(state, phase, space, scene, limit, max_events, shots.hits[k], shots.counts[k], log)
        if time == INTERRUPTED:
            return True
        shots.times[k] = time
        store(shots, k, scene, state, phase)
        events += len(phase) + shots.counts[k, N_EVENTS]
        if events > LOOK_AFTER:
            if interrupted():
                return True
            events = 0
    return False


@entry_point
def run_shots(begin, end, scene, limit, max_events, shots, log):
    """Runs shots `begin` to `end` of a batch, in place; one that is interrupted stays as it was.

    Args:
        begin: First shot.
        end: One past the last.
        scene: A `SceneArrays` as a plain tuple, as are the others: numba takes those in half the time.
        limit: s; may be infinite unless motion is ideal.
        max_events: A shot is given up after so many.
        shots: The `Shots`.
        log: A `Log`, of the last shot.
    """
    arrays, n = SceneArrays(*scene), len(scene[1])
    state, phase, space = np.empty((n, WIDTH)), np.empty(n, np.int8), workspace(n)
    end_call(run_all(begin, end, state, phase, space, arrays, limit, max_events, Shots(*shots), Log(*log)))
