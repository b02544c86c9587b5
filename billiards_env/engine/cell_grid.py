"""The event queue for many balls: a heap of balls, and a grid of cells that limits the number of predicted pairs.

Two costs of `engine.all_pairs` grow with the number of balls: finding the earliest prediction, and the
predictions of a ball's meetings with all others. Here the ball with the earliest event is at the top of a heap. Cells
are at least as wide as a ball, so a ball meets only balls in its own and the neighbouring cells. When it enters another
cell, its meetings with the balls of three more cells are predicted (Rapaport 1980, The event scheduling problem in
molecular dynamic simulation). Each ball stores only its earliest meeting. If an event changes the motion of the other
ball, the stored time is a lower bound of the ball's next meeting. It is replaced when it reaches the top of the heap.

`most_contacts`, `clear`, `predict`, `earliest`, `due` and `gather` have the arguments and results of those in
`engine.all_pairs`.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from billiards_env.engine import all_pairs
from billiards_env.engine.pic_events import add_contact
from billiards_env.engine.predictions import (
    CROSSING_RANK,
    PAIR_RANK,
    NextEvent,
    Singles,
    empty_singles,
    predict_pair,
    predict_single,
    rank_of,
    single_time,
)
from billiards_env.engine.runner import LOOK_AFTER
from billiards_env.jit import allocating, inlined, kernel
from billiards_env.jit.interrupt import interrupted
from billiards_env.physics.geometry.contact import line_time
from billiards_env.physics.motion import motion_after
from billiards_env.physics.state import AX, AY, LASTS, Time, X, Y, before, moves, own_time, same, since

SOON, empty_scratch = all_pairs.SOON, all_pairs.empty_scratch

_MARGIN = 1.0 + 1e-6  # least width of a cell in diameters: despite rounding, balls that touch are in neighbouring cells


class Queue(NamedTuple):
    """The predictions for n balls, and their cells.

    Attributes:
        singles: The `Singles`.
        crossing: (n,) float64, time at which a ball leaves its cell, s.
        direction: (n,) int64, direction in which it leaves, 0 to 3 for -x, +x, -y, +y, or -1.
        meeting_hi: (n,) float64, time of a ball's earliest meeting with another ball, s.
        meeting_lo: (n,) float64, its second part.
        partner: (n,) int64, the other ball.
        partner_version: (n,) int64, the other ball's version at the prediction.
        version: (n,) int64, number of changes of a ball's motion.
        hi: (n,) float64, time of the earliest of the ball's crossing, meeting and single-ball event, s.
        lo: (n,) float64, its second part.
        rank: (n,) int64, rank of that event.
        heap: (n,) int64, the balls in the order of a binary heap.
        slot: (n,) int64, position of a ball in the heap.
        column: (n,) int64, column of a ball's cell.
        row: (n,) int64, row of a ball's cell.
        head: (columns, rows) int64, first ball in a cell, or -1.
        next: (n,) int64, next ball in the cell, or -1.
        previous: (n,) int64, previous ball in the cell, or -1.
        soon: (n,) int64, scratch of `due` and `gather`.
        pair_hi: (most,) float64, scratch of `gather`: times of the meetings of pairs, s.
        pair_lo: (most,) float64, their second parts.
    """

    singles: Singles
    crossing: Any
    direction: Any
    meeting_hi: Any
    meeting_lo: Any
    partner: Any
    partner_version: Any
    version: Any
    hi: Any
    lo: Any
    rank: Any
    heap: Any
    slot: Any
    column: Any
    row: Any
    head: Any
    next: Any
    previous: Any
    soon: Any
    pair_hi: Any
    pair_lo: Any


@allocating
def _ints(n):
    return np.empty(n, np.int64)


@allocating
def most_contacts(scene):
    """Returns the largest number of contacts at one instant.

    The contacts of circles form a planar graph, which has fewer than 3 n edges. In space, a ball touches at most 12
    others of its size, so there are at most 6 n contacts. The rest is room for pairs that `gather` drops.
    """
    return 6 * (scene.space.axes() - 1) * len(scene.radius)


@allocating
def empty_cells(scene):
    """Returns `Queue.head` and `Queue.next` for the balls of a scene, with about as many cells as balls."""
    n = len(scene.radius)
    length, width = 2.0 * scene.numbers.half_length, 2.0 * scene.numbers.half_width
    least = max(2.0 * scene.radius.max() * _MARGIN, math.sqrt(length * width / n))
    columns, rows = max(1, int(length / least)), max(1, int(width / least))
    return np.empty((columns, rows), np.int64), _ints(n)


@inlined
def cell_of(x, y, numbers, head):
    """Returns the column and the row of the cell of a point, or of the cell nearest to a point outside of the table."""
    columns, rows = head.shape
    c, r = int((0.5 * x / numbers.half_length + 0.5) * columns), int((0.5 * y / numbers.half_width + 0.5) * rows)
    return min(max(c, 0), columns - 1), min(max(r, 0), rows - 1)


@allocating
def empty_queue(scene):
    """Returns the `Queue` for the balls of a scene."""
    n, (head, after) = len(scene.radius), empty_cells(scene)
    return Queue(
        singles=empty_singles(n),
        crossing=np.empty(n),
        direction=_ints(n),
        meeting_hi=np.empty(n),
        meeting_lo=np.empty(n),
        partner=_ints(n),
        partner_version=_ints(n),
        version=_ints(n),
        hi=np.empty(n),
        lo=np.empty(n),
        rank=_ints(n),
        heap=_ints(n),
        slot=_ints(n),
        column=_ints(n),
        row=_ints(n),
        head=head,
        next=after,
        previous=_ints(n),
        soon=_ints(n),
        pair_hi=np.empty(most_contacts(scene)),
        pair_lo=np.empty(most_contacts(scene)),
    )


@kernel
def _is_before(a, b, queue):
    """Returns whether ball a's next event comes before ball b's."""
    if queue.hi[a] != queue.hi[b]:
        return queue.hi[a] < queue.hi[b]
    if queue.lo[a] != queue.lo[b]:
        return queue.lo[a] < queue.lo[b]
    if queue.rank[a] != queue.rank[b]:
        return queue.rank[a] < queue.rank[b]
    return a < b


@kernel
def _schedule(i, queue):  # out: queue
    """Puts ball i at its place in the heap by the earliest of its events (Williams 1964)."""
    time, rank = single_time(queue.singles, i), rank_of(queue.singles.kind[i])
    meeting = Time(queue.meeting_hi[i], queue.meeting_lo[i])
    if before(meeting, time) or (same(meeting, time) and rank > PAIR_RANK):
        time, rank = meeting, PAIR_RANK
    if queue.crossing[i] < time.hi:
        time, rank = Time(queue.crossing[i], 0.0), CROSSING_RANK
    queue.hi[i], queue.lo[i], queue.rank[i] = time.hi, time.lo, rank
    heap, slot = queue.heap, queue.slot
    k, n = slot[i], len(heap)
    while k > 0 and _is_before(i, heap[(k - 1) // 2], queue):
        heap[k] = heap[(k - 1) // 2]
        slot[heap[k]] = k
        k = (k - 1) // 2
    while 2 * k + 1 < n:
        c = 2 * k + 1
        if c + 1 < n and _is_before(heap[c + 1], heap[c], queue):
            c += 1
        if not _is_before(heap[c], i, queue):
            break
        heap[k] = heap[c]
        slot[heap[k]] = k
        k = c
    heap[k], slot[i] = i, k


@kernel
def _enter(i, queue):  # out: queue
    """Puts ball i at the head of the list of its cell."""
    c, r = queue.column[i], queue.row[i]
    after = queue.head[c, r]
    queue.next[i], queue.previous[i] = after, -1
    if after >= 0:
        queue.previous[after] = i
    queue.head[c, r] = i


@kernel
def _leave(i, queue):  # out: queue
    """Takes ball i out of the list of its cell."""
    after, prior = queue.next[i], queue.previous[i]
    if prior >= 0:
        queue.next[prior] = after
    else:
        queue.head[queue.column[i], queue.row[i]] = after
    if after >= 0:
        queue.previous[after] = prior


@kernel
def clear(state, scene, queue):  # out: queue
    """Empties the queue and puts the balls in their cells."""
    queue.head[:] = -1
    queue.hi[:] = queue.lo[:] = math.inf
    queue.rank[:] = 0
    queue.meeting_hi[:] = queue.meeting_lo[:] = math.inf
    queue.partner[:] = queue.partner_version[:] = -1
    queue.version[:] = 0
    for i in range(len(queue.heap)):
        queue.heap[i] = queue.slot[i] = i
        queue.column[i], queue.row[i] = cell_of(state.rows[i, X], state.rows[i, Y], scene.numbers, queue.head)
        _enter(i, queue)


@kernel
def _predict_crossing(i, now, state, scene, queue):  # out: queue
    """Predicts when ball i leaves its cell after a `Time`. A cell at the border of the grid has no outer edge."""
    queue.crossing[i], queue.direction[i] = math.inf, -1
    if not moves(state, i):
        return
    s, t0 = state.rows[i], since(now, own_time(state, i))
    x, y, vx, vy = motion_after(state, i, t0)
    columns, rows = queue.head.shape
    along_x = queue.column[i], columns, scene.numbers.half_length, x, vx, s[AX]
    along_y = queue.row[i], rows, scene.numbers.half_width, y, vy, s[AY]
    first = s[LASTS] - t0
    for k in range(4):
        cell, count, half, place, velocity, acceleration = along_x if k < 2 else along_y
        edge, sign = cell + k % 2, (1.0 if k % 2 else -1.0)
        if edge == 0 or edge == count:
            continue
        line = (2.0 * edge / count - 1.0) * half
        t = line_time(sign * (line - place), sign * velocity, sign * acceleration, first)
        if t < first:
            first, queue.direction[i] = t, k
    if queue.direction[i] >= 0:
        queue.crossing[i] = now.hi + first


@kernel
def _predict_in_cell(i, c, r, state, scene, queue):  # out: queue
    """Predicts the meetings of ball i with the balls in a cell. Stores a meeting for a ball if it is its earliest."""
    j = queue.head[c, r]
    while j >= 0:
        if j != i:
            time = predict_pair(i, j, state, scene, queue.singles)
            for a, b in ((i, j), (j, i)):
                if before(time, Time(queue.meeting_hi[a], queue.meeting_lo[a])):
                    queue.meeting_hi[a], queue.meeting_lo[a] = time.hi, time.lo
                    queue.partner[a], queue.partner_version[a] = b, queue.version[b]
                    if a == j:
                        _schedule(j, queue)
        j = queue.next[j]


@kernel
def _predict_in_cells(i, first, last, state, scene, queue):  # out: queue
    """Predicts the meetings of ball i with the balls in a block of cells, from the column and row `first` to `last`."""
    columns, rows = queue.head.shape
    for c in range(max(0, first[0]), min(columns, last[0] + 1)):
        for r in range(max(0, first[1]), min(rows, last[1] + 1)):
            _predict_in_cell(i, c, r, state, scene, queue)


@kernel
def _predict_neighbours(i, state, scene, queue):  # out: queue
    """Predicts the meetings of ball i with the balls in its own and the neighbouring cells."""
    queue.meeting_hi[i] = math.inf
    c, r = queue.column[i], queue.row[i]
    _predict_in_cells(i, (c - 1, r - 1), (c + 1, r + 1), state, scene, queue)
    _schedule(i, queue)


@kernel
def _cross(i, state, scene, queue):  # out: queue
    """Moves ball i to the next cell, and predicts its meetings in the cells that have become neighbours."""
    _leave(i, queue)
    step, along_x = 2 * (queue.direction[i] % 2) - 1, queue.direction[i] < 2
    queue.column[i] += step if along_x else 0
    queue.row[i] += 0 if along_x else step
    _enter(i, queue)
    _predict_crossing(i, Time(queue.hi[i], 0.0), state, scene, queue)
    c, r = queue.column[i], queue.row[i]
    if along_x:
        _predict_in_cells(i, (c + step, r - 1), (c + step, r + 1), state, scene, queue)
    else:
        _predict_in_cells(i, (c - 1, r + step), (c + 1, r + step), state, scene, queue)
    _schedule(i, queue)


@kernel
def predict(changed, count, now, state, scene, queue):  # out: queue
    """Predicts the next events of the first `count` balls of `changed`, whose own time is `now`.

    Returns:
        The amount of work, in the unit of `runner.LOOK_AFTER`; negative if it was interrupted.
    """
    for c in range(count):
        i = changed[c]
        queue.version[i] += 1
        predict_single(i, state, scene, queue.singles)
        _predict_crossing(i, now, state, scene, queue)
    balls_per_cell = 1 + len(queue.heap) // queue.head.size
    pending = 0
    for c in range(count):
        _predict_neighbours(changed[c], state, scene, queue)
        pending += balls_per_cell
        if pending > LOOK_AFTER:
            if interrupted():
                return -1
            pending = 0
    return pending


@kernel
def earliest(state, scene, queue, limit):  # out: queue
    """Returns the next `NextEvent`. Moves balls to their next cells and replaces invalid meetings on the way to it."""
    while True:
        i = queue.heap[0]
        if queue.hi[i] > limit or queue.hi[i] == math.inf:
            break
        if queue.rank[i] == CROSSING_RANK:
            _cross(i, state, scene, queue)
        elif queue.rank[i] == PAIR_RANK and queue.partner_version[i] != queue.version[queue.partner[i]]:
            _predict_neighbours(i, state, scene, queue)
        else:
            break
    return NextEvent(Time(queue.hi[i], queue.lo[i]), queue.rank[i], i, i)


@kernel
def _find_soon(hi, queue, soon):  # out: soon
    """Lists in `soon`, in order, the balls with an event at most SOON after a time hi. Returns their number."""
    n, count, k = len(queue.heap), 1, 0
    soon[0] = 0  # first positions in the heap, which has the earliest event at its top, then balls
    while k < count:
        for child in (2 * soon[k] + 1, 2 * soon[k] + 2):
            if child < n and queue.hi[queue.heap[child]] - hi <= SOON:
                soon[count] = child
                count += 1
        k += 1
    for k in range(count):
        ball, at = queue.heap[soon[k]], k
        while at > 0 and soon[at - 1] > ball:  # insertion sort: the number is small
            soon[at] = soon[at - 1]
            at -= 1
        soon[at] = ball
    return count


@inlined
def due(event, queue, balls):  # out: queue, balls
    """Lists in `balls`, in order, the balls with a single-ball event of the time and rank of `event`.

    Returns their number.
    """
    count = 0
    for k in range(_find_soon(event.time.hi, queue, queue.soon)):
        i = queue.soon[k]
        if same(Time(queue.hi[i], queue.lo[i]), event.time) and queue.rank[i] == event.rank:
            balls[count] = i
            count += 1
    return count


@kernel
def gather(now, state, scene, queue, contacts):  # out: state, queue, contacts
    """Finds the contacts at a `Time` (pairs that meet, or that touch and approach) and advances their balls to it.

    Returns their number.
    """
    first, second, soon = contacts.first, contacts.second, queue.soon
    pair_hi, pair_lo = queue.pair_hi, queue.pair_lo
    columns, rows = queue.head.shape
    count = 0
    for k in range(_find_soon(now.hi, queue, soon)):
        i = soon[k]
        for c in range(max(0, queue.column[i] - 1), min(columns, queue.column[i] + 2)):
            for r in range(max(0, queue.row[i] - 1), min(rows, queue.row[i] + 2)):
                j = queue.head[c, r]
                while j >= 0:
                    if j > i and count < len(first):
                        time = predict_pair(i, j, state, scene, queue.singles)
                        if time.hi - now.hi <= SOON:
                            first[count], second[count], pair_hi[count], pair_lo[count] = i, j, time.hi, time.lo
                            count += 1
                    j = queue.next[j]
    left = 0
    for c in range(count):
        if add_contact(first[c], second[c], Time(pair_hi[c], pair_lo[c]), now, state, scene, contacts, left):
            left += 1
    return left
