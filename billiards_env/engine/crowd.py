"""PIC for many balls: what `engine.pic` gives, bit for bit, at a cost per event that hardly grows with their number.

Two things in `pic.run` grow with the number of balls: the search for the earliest prediction, and predicting a ball's
meeting with all the others. Here a heap of balls has the earliest on top, and a grid of cells, each at least a ball
wide, leaves only the balls of neighbouring cells to be met; a ball that enters another cell meets those of three more
(Rapaport 1980, The event scheduling problem in molecular dynamic simulation). Each ball remembers the earliest of its
meetings. Should its partner be diverted meanwhile, that is a lower bound of the next one; it is found out and replaced
when it comes to the top.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from billiards_env.engine.contact_rule import empty_memory, forget
from billiards_env.engine.log import (
    AT_EVENT_LIMIT,
    AT_REST,
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
    log_segment,
    store,
)
from billiards_env.engine.pic import SOON, alone, impacts, join, wind_up
from billiards_env.engine.queue import predict_ball, solve_pair
from billiards_env.physics.clusters import empty_contacts, empty_scratch
from billiards_env.physics.contact import line_time
from billiards_env.physics.interrupt import end_call, interrupted
from billiards_env.physics.jit import allocating, entry_point, kernel
from billiards_env.physics.motion import move, place, start
from billiards_env.physics.state import (
    AX,
    AY,
    HALF_LENGTH,
    HALF_WIDTH,
    LASTS,
    POTTED,
    ROLLING,
    T0,
    T0_LO,
    WIDTH,
    X,
    Y,
    since,
)

_MARGIN = 1.0 + 1e-6  # of a cell over a ball's width: no rounding puts balls that touch two cells apart

# The order of events at one instant.
_CROSSING, _POCKET, _PAIR, _CUSHION, _CHANGE = -1.0, 0.0, 1.0, 2.0, 3.0


class Queue(NamedTuple):
    """What is predicted of n balls, and where they are to be found.

    Attributes:
        own: (n, 2) float64, the time (hi, lo) of a ball's next event by itself, and
        own_kind: (n, 2) int64, what that is, see `pic.predict_ball`.
        crossing: (n,) float64, when it leaves its cell, s, and
        way: (n,) int64, which way: 0 to 3 for -x, +x, -y, +y.
        meeting: (n, 2) float64, the time (hi, lo) of its earliest meeting with another ball, and
        partner: (n, 2) int64, that ball and its version then.
        version: (n,) int64, how often its motion has changed.
        key: (n, 3) float64, the earliest of all that: hi, lo and rank.
        heap: (n,) int64, the balls in the order of a binary heap by their keys.
        slot: (n,) int64, a ball's place in it.
        cell: (n, 2) int64, column and row of a ball's cell.
        head: (columns, rows) int64, the first ball in a cell, or -1.
        links: (n, 2) int64, the next and the last ball in the cell, or -1.
    """

    own: Any
    own_kind: Any
    crossing: Any
    way: Any
    meeting: Any
    partner: Any
    version: Any
    key: Any
    heap: Any
    slot: Any
    cell: Any
    head: Any
    links: Any


@kernel
def before(a, b, key):
    """Whether ball a's next event comes before ball b's."""
    for c in range(3):
        if key[a, c] != key[b, c]:
            return key[a, c] < key[b, c]
    return a < b


@kernel
def file(i, q):
    """Files ball i in the heap under the earliest of its events (Williams 1964)."""
    hi, lo = q.own[i, 0], q.own[i, 1]
    kind = q.own_kind[i, 0]
    rank = _POCKET if kind == BALL_POCKET else (_CUSHION if kind == BALL_CUSHION else _CHANGE)
    m, m_lo = q.meeting[i, 0], q.meeting[i, 1]
    if m < hi or (m == hi and (m_lo < lo or (m_lo == lo and rank > _PAIR))):
        hi, lo, rank = m, m_lo, _PAIR
    if q.crossing[i] < hi:
        hi, lo, rank = q.crossing[i], 0.0, _CROSSING
    q.key[i, 0], q.key[i, 1], q.key[i, 2] = hi, lo, rank
    heap, slot = q.heap, q.slot
    k, n = slot[i], len(heap)
    while k > 0 and before(i, heap[(k - 1) // 2], q.key):
        heap[k] = heap[(k - 1) // 2]
        slot[heap[k]] = k
        k = (k - 1) // 2
    while 2 * k + 1 < n:
        c = 2 * k + 1
        if c + 1 < n and before(heap[c + 1], heap[c], q.key):
            c += 1
        if not before(heap[c], i, q.key):
            break
        heap[k] = heap[c]
        slot[heap[k]] = k
        k = c
    heap[k], slot[i] = i, k


@kernel
def enter(i, q):
    """Puts ball i first into the list of its cell."""
    c, r = q.cell[i, 0], q.cell[i, 1]
    after = q.head[c, r]
    q.links[i, 0], q.links[i, 1] = after, -1
    if after >= 0:
        q.links[after, 1] = i
    q.head[c, r] = i


@kernel
def leave(i, q):
    """Takes ball i out of the list of its cell."""
    after, prior = q.links[i, 0], q.links[i, 1]
    if prior >= 0:
        q.links[prior, 0] = after
    else:
        q.head[q.cell[i, 0], q.cell[i, 1]] = after
    if after >= 0:
        q.links[after, 1] = prior


@allocating
def grid(params, radius):
    """Columns and rows of the grid: about as many cells as balls, each at least a ball wide."""
    length, width = 2.0 * params[HALF_LENGTH], 2.0 * params[HALF_WIDTH]
    least = max(2.0 * radius.max() * _MARGIN, math.sqrt(length * width / len(radius)))
    return max(1, int(length / least)), max(1, int(width / least))


@kernel
def clear(state, params, q):
    """Empties the queue and puts the balls in their cells."""
    columns, rows = q.head.shape
    q.head[:] = -1
    q.key[:] = math.inf
    q.meeting[:] = math.inf
    q.partner[:] = -1
    q.version[:] = 0
    for i in range(len(q.heap)):
        q.heap[i] = q.slot[i] = i
        c = int((0.5 * state[i, X] / params[HALF_LENGTH] + 0.5) * columns)
        r = int((0.5 * state[i, Y] / params[HALF_WIDTH] + 0.5) * rows)
        q.cell[i, 0], q.cell[i, 1] = min(max(c, 0), columns - 1), min(max(r, 0), rows - 1)
        enter(i, q)


@kernel
def predict_crossing(i, hi, lo, state, phase, params, q):
    """When ball i next leaves its cell after (hi, lo), and which way; the cells at the border have no end there."""
    q.crossing[i], q.way[i] = math.inf, -1
    if phase[i] < ROLLING or phase[i] == POTTED:
        return
    columns, rows = q.head.shape
    s = state[i]
    t0 = since(hi, lo, s[T0], s[T0_LO])
    x, y, vx, vy = place(state, phase, i, t0)
    first = s[LASTS] - t0
    for k in range(4):
        sign = 1.0 if k % 2 else -1.0
        edge = q.cell[i, k // 2] + k % 2
        if edge == 0 or edge == (columns if k < 2 else rows):
            continue
        if k < 2:
            line = (2.0 * edge / columns - 1.0) * params[HALF_LENGTH]
            t = line_time(sign * (line - x), sign * vx, sign * s[AX], first)
        else:
            line = (2.0 * edge / rows - 1.0) * params[HALF_WIDTH]
            t = line_time(sign * (line - y), sign * vy, sign * s[AY], first)
        if t < first:
            first, q.way[i] = t, k
    if q.way[i] >= 0:
        q.crossing[i] = hi + first


@kernel
def pair_of(i, j, state, phase, radius, limit, q):
    """When balls i and j next meet: (hi, lo)."""
    if phase[i] == POTTED or phase[j] == POTTED or max(phase[i], phase[j]) < ROLLING:
        return math.inf, 0.0
    hi, lo = state[i, T0], state[i, T0_LO]
    if state[j, T0] > hi or (state[j, T0] == hi and state[j, T0_LO] > lo):
        hi, lo = state[j, T0], state[j, T0_LO]
    return solve_pair(min(i, j), max(i, j), hi, lo, state, phase, radius, q.own, q.own_kind, limit)


@kernel
def meet(i, first_column, last_column, first_row, last_row, state, phase, radius, limit, q):
    """Predicts the meetings of ball i with the balls in these cells, and notes each for whom it is the earliest."""
    columns, rows = q.head.shape
    for c in range(max(0, first_column), min(columns, last_column + 1)):
        for r in range(max(0, first_row), min(rows, last_row + 1)):
            j = q.head[c, r]
            while j >= 0:
                if j != i:
                    hi, lo = pair_of(i, j, state, phase, radius, limit, q)
                    for a, b in ((i, j), (j, i)):
                        if hi < q.meeting[a, 0] or (hi == q.meeting[a, 0] and lo < q.meeting[a, 1]):
                            q.meeting[a, 0], q.meeting[a, 1] = hi, lo
                            q.partner[a, 0], q.partner[a, 1] = b, q.version[b]
                            if a == j:
                                file(j, q)
                j = q.links[j, 0]


@kernel
def meet_neighbours(i, state, phase, radius, limit, q):
    """Predicts all meetings of ball i anew and files it."""
    q.meeting[i, 0] = math.inf
    c, r = q.cell[i, 0], q.cell[i, 1]
    meet(i, c - 1, c + 1, r - 1, r + 1, state, phase, radius, limit, q)
    file(i, q)


@kernel
def cross(i, state, phase, params, radius, limit, q):
    """Takes ball i into the next cell."""
    leave(i, q)
    way = q.way[i]
    side, step = way // 2, 2 * (way % 2) - 1
    q.cell[i, side] += step
    enter(i, q)
    predict_crossing(i, q.key[i, 0], 0.0, state, phase, params, q)
    c, r = q.cell[i, 0], q.cell[i, 1]
    if side == 0:
        meet(i, c + step, c + step, r - 1, r + 1, state, phase, radius, limit, q)
    else:
        meet(i, c - 1, c + 1, r + step, r + step, state, phase, radius, limit, q)
    file(i, q)


@kernel
def soon(hi, q, found):
    """The balls with an event until SOON after hi, in order, in `found` (n,). Returns their number."""
    n, count, k = len(found), 1, 0
    found[0] = 0  # places in the heap at first: what is due lies at its top
    while k < count:
        for child in (2 * found[k] + 1, 2 * found[k] + 2):
            if child < n and q.key[q.heap[child], 0] - hi <= SOON:
                found[count] = child
                count += 1
        k += 1
    for k in range(count):
        ball, at = q.heap[found[k]], k
        while at > 0 and found[at - 1] > ball:  # insertion: few are ever due at one instant
            found[at] = found[at - 1]
            at -= 1
        found[at] = ball
    return count


@kernel
def gather(hi, lo, state, phase, params, radius, limit, q, found, contacts):
    """What `pic.gather` does: the pairs whose impact is due at (hi, lo), or that touch and approach then."""
    first, second = contacts.first, contacts.second
    due, due_lo = contacts.nx, contacts.ny  # scratch until the normals are known
    count = 0
    for k in range(soon(hi, q, found)):
        i = found[k]
        begin = count
        for c in range(max(0, q.cell[i, 0] - 1), min(q.head.shape[0], q.cell[i, 0] + 2)):
            for r in range(max(0, q.cell[i, 1] - 1), min(q.head.shape[1], q.cell[i, 1] + 2)):
                j = q.head[c, r]
                while j >= 0:
                    if j > i and count < len(first):
                        t, t_lo = pair_of(i, j, state, phase, radius, limit, q)
                        if t - hi <= SOON:
                            at = count
                            while at > begin and second[at - 1] > j:
                                second[at], due[at], due_lo[at] = second[at - 1], due[at - 1], due_lo[at - 1]
                                at -= 1
                            first[count] = i
                            second[at], due[at], due_lo[at] = j, t, t_lo
                            count += 1
                    j = q.links[j, 0]
    left = 0
    for c in range(count):
        if join(first[c], second[c], due[c], due_lo[c], hi, lo, state, phase, radius, params, left, contacts):
            left += 1
    return left


@kernel
def run(state, phase, space, scene, limit, max_events, hits, counts, log):
    """Runs one shot; arguments and result as `pic.run`, but for the `workspace`."""
    n = len(phase)
    params, radius, inv_mass, pockets = scene
    events, segments, used = log
    q, found, contacts, scratch, memory, changed = space
    hits[:, CUSHIONS], hits[:, CUSHIONS_BEFORE_HIT] = 0, -1
    counts[N_EVENTS], counts[ENDED], counts[FIRST_HIT], counts[N_CONTACT_RULE] = 0, AT_REST, -1, 0
    clear_log(events, used)
    forget(memory)
    clear(state, params, q)
    hi = lo = 0.0
    changes = n
    for i in range(n):
        changed[i] = i
    work, in_a_cell = 0, 1 + n // q.head.size  # balls
    while True:
        for k in range(changes):
            i = changed[k]
            start(state, phase, i, params)
            log_segment(segments, used, state, phase, i)
            q.version[i] += 1
            predict_ball(i, state, phase, params, radius, pockets, q.own, q.own_kind)
            predict_crossing(i, hi, lo, state, phase, params, q)
        for k in range(changes):
            meet_neighbours(changed[k], state, phase, radius, limit, q)
            work += in_a_cell
            if work > LOOK_AFTER:
                if interrupted():
                    return INTERRUPTED
                work = 0
        while True:
            a = q.heap[0]
            next_hi, rank = q.key[a, 0], q.key[a, 2]
            if next_hi > limit or next_hi == math.inf:
                break
            if rank == _CROSSING:
                cross(a, state, phase, params, radius, limit, q)
            elif rank == _PAIR and q.partner[a, 1] != q.version[q.partner[a, 0]]:
                meet_neighbours(a, state, phase, radius, limit, q)
            else:
                break
        if next_hi > limit or next_hi == math.inf:
            break
        if counts[N_EVENTS] >= max_events:
            counts[ENDED] = AT_EVENT_LIMIT
            for i in range(n):
                move(state, phase, i, hi, lo, params)
            return hi
        hi, lo = next_hi, q.key[a, 1]
        if rank == _PAIR:
            count = gather(hi, lo, state, phase, params, radius, limit, q, found, contacts)
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
            for k in range(soon(hi, q, found)):
                i = found[k]
                if q.key[i, 0] == hi and q.key[i, 1] == lo and q.key[i, 2] == rank:
                    kind, other = q.own_kind[i, 0], q.own_kind[i, 1]
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
def workspace(scene):
    """The arrays that a shot is run with, see `run`."""
    n = len(scene.radius)
    most = 6 * n  # contacts at one instant: circles that touch are a planar graph, of less than 3 n edges
    columns, rows = grid(scene.params, scene.radius)
    q = Queue(
        np.empty((n, 2)),
        np.empty((n, 2), np.int64),
        np.empty(n),
        np.empty(n, np.int64),
        np.empty((n, 2)),
        np.empty((n, 2), np.int64),
        np.empty(n, np.int64),
        np.empty((n, 3)),
        np.empty(n, np.int64),
        np.empty(n, np.int64),
        np.empty((n, 2), np.int64),
        np.empty((columns, rows), np.int64),
        np.empty((n, 2), np.int64),
    )
    return (
        q,
        np.empty(n, np.int64),
        empty_contacts(most),
        empty_scratch(n, most),
        empty_memory(n),
        np.empty(2 * most + n, np.int64),
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
    """Runs shots `begin` to `end` of a batch, in place; see `pic.run_shots`, which takes the same arguments."""
    arrays, n = SceneArrays(*scene), len(scene[1])
    state, phase, space = np.empty((n, WIDTH)), np.empty(n, np.int8), workspace(arrays)
    end_call(run_all(begin, end, state, phase, space, arrays, limit, max_events, Shots(*shots), Log(*log)))
