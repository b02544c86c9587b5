"""PIC, predicted instant of collision: the event-driven engine.

The engine goes from event to event, each at its exact time. It predicts the next event of each ball alone (cushion,
pocket, end of a phase) and the next meeting of each pair. A prediction is valid until an event changes the motion of
one of its balls. The engine takes the earliest prediction, advances only the balls that it concerns, changes their
motion, and predicts their next events. At one instant it resolves pockets first, then all impacts between balls as one
problem, then cushions, then the ends of phases.

A queue stores the predictions: `engine.one_pair` for at most two balls, `engine.all_pairs` for few, `engine.cell_grid`
for many. All lead to the same bits. Two balls have only one impact with each other at an instant, so their engine is
compiled without the code for several impacts.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from billiards_env.engine import all_pairs, cell_grid, one_pair
from billiards_env.engine.contact_rule import Memory, empty_memory, reset_memory
from billiards_env.engine.log import clear_log, log_segment
from billiards_env.engine.measures import BEGIN_PHASE, record_nothing
from billiards_env.engine.pic_events import resolve_impacts, resolve_singles
from billiards_env.engine.predictions import PAIR_RANK, QueueKernels, queue_of
from billiards_env.engine.runner import INTERRUPTED, LOOK_AFTER, for_all_shots
from billiards_env.engine.shots import AT_EVENT_LIMIT, AT_MAX_TIME, end_at
from billiards_env.jit import allocating, entry_point, inlined
from billiards_env.jit.interrupt import end_call, interrupted
from billiards_env.physics.clusters.impulses import Contacts, Scratch, empty_contacts
from billiards_env.physics.state import SceneKernels, State, Time, empty_state, scene_of

CLUSTER_WORK = 100
"""Largest amount of work for each two of the impacts at one instant, in the unit of `LOOK_AFTER`."""


class PicKernels(NamedTuple):
    """The kernels of the event loop.

    Attributes:
        scene: The `SceneKernels`.
        queue: The `QueueKernels`: `ONE_PAIR` for at most two balls, `ALL_PAIRS` or, faster for many, `CELL_GRID`.
        record: The kernel that records the measures, see `engine.measures`.
    """

    scene: SceneKernels
    queue: QueueKernels
    record: Any = record_nothing


ONE_PAIR, ALL_PAIRS, CELL_GRID = queue_of(one_pair), queue_of(all_pairs), queue_of(cell_grid)


class PicWorkspace(NamedTuple):
    """The arrays in which shots are run, one after the other.

    Attributes:
        state: The `State` of the balls.
        kernels: The `QueueKernels`.
        record: `PicKernels.record`.
        queue: The arrays of the queue of predictions.
        contacts: The `Contacts` at one instant.
        scratch: The `Scratch` of their resolution; None for at most two balls.
        memory: The `Memory` of the contact-time rule.
        due: (n,) int64, balls with an event alone at this instant.
        changed: (2 most + 2 n,) int64, balls whose motion the last event has changed, once for each impact.
    """

    state: State
    kernels: QueueKernels
    record: Any
    queue: Any
    contacts: Contacts
    scratch: Scratch | None
    memory: Memory
    due: Any
    changed: Any


@allocating
def make_workspace(scene, kernels, record):
    """Returns the `PicWorkspace` for the balls of a scene, a queue and measures."""
    n, most = len(scene.radius), kernels.most_contacts(scene)
    return PicWorkspace(
        state=empty_state(n, scene.space.axes()),
        kernels=kernels,
        record=record,
        queue=kernels.empty_queue(scene),
        contacts=empty_contacts(most, scene.space.axes()),
        scratch=kernels.empty_scratch(scene, most),
        memory=empty_memory(n),
        due=np.empty(n, np.int64),
        changed=np.empty(2 * (most + n), np.int64),
    )


@inlined
def begin_shot(state, memory, changed, log):  # out: memory, changed, log
    """Resets the log and the memory, and lists all balls in `changed`. Returns their number."""
    clear_log(log)
    reset_memory(memory)
    for i in range(len(state.phase)):
        changed[i] = i
    return len(state.phase)


@inlined
def begin_phases(count, k, scene, work, shots, log):  # out: work, shots, log
    """Begins and records the next phase of the first `count` balls of `work.changed`."""
    for c in range(count):
        i = work.changed[c]
        scene.space.begin_phase(work.state, i, scene.numbers)
        work.record(BEGIN_PHASE, i, -1, k, scene, work.state, shots)
        log_segment(log, work.state, i)


@inlined
def resolve(event, k, scene, work, shots, log):  # out: work, shots, log
    """Advances the balls of a `NextEvent` to its time, changes their motion, and records what happens.

    Returns:
        The number of balls listed in `work.changed`, and the amount of work, in the unit of `LOOK_AFTER`.
    """
    queue, now = work.kernels, event.time
    if event.rank == PAIR_RANK:
        count = queue.gather(now, work.state, scene, work.queue, work.contacts)  # advances the balls
        return resolve_impacts(count, now, k, scene, work, shots, log), CLUSTER_WORK * count * (count - 1)
    count = queue.due(event, work.queue, work.due)
    changed = resolve_singles(count, now, k, scene, work, shots, log)  # advances the balls
    return changed, scene.numbers.cushion_work * changed


@inlined
def run(k, kernels, scene, work, limit, max_events, shots, log):  # out: work, shots, log
    """Runs shot k to rest, to the time `limit` (s) or to `max_events` events.

    Returns:
        The amount of work, in the unit of `LOOK_AFTER`, or INTERRUPTED.
    """
    state, queue, changed, now = work.state, work.kernels, work.changed, Time(0.0, 0.0)
    n_changed = begin_shot(state, work.memory, changed, log)
    queue.clear(state, scene, work.queue)
    total = pending = 0
    while True:
        begin_phases(n_changed, k, scene, work, shots, log)
        spent = queue.predict(changed, n_changed, now, state, scene, work.queue)
        event = queue.earliest(state, scene, work.queue, limit)
        if event.time.hi > limit or event.time.hi == math.inf:
            break
        if shots.n_events[k] >= max_events:
            shots.time[k] = now.hi
            end_at(now, k, state, scene, shots, AT_EVENT_LIMIT)
            return total + pending
        pending += spent
        if pending > LOOK_AFTER or spent < 0:
            if spent < 0 or interrupted():
                return INTERRUPTED
            total, pending = total + pending, 0
        now = event.time
        n_changed, spent = resolve(event, k, scene, work, shots, log)
        pending += spent
    shots.time[k] = now.hi
    if limit < math.inf:
        end_at(Time(limit, 0.0), k, state, scene, shots, AT_MAX_TIME)
    return total + pending


_run_all = for_all_shots(run)


@allocating
def _run_shots(kernels, begin, end, scene, limit, max_events, shots, log):  # out: shots, log
    """Runs shots, see `run_shots`. Returns whether it was interrupted."""
    work = make_workspace(scene_of(kernels.scene, scene, 0), kernels.queue, kernels.record)
    return _run_all(range(begin, end), kernels, scene, work, limit, max_events, shots, log)


@entry_point
def run_shots(kernels, begin, end, scene, limit, max_events, shots, log):  # out: shots, log
    """Runs shots `begin` to `end` - 1 of a batch in place. An interrupted shot keeps its start.

    Args:
        kernels: The `PicKernels`. With more than two balls, the queue `ONE_PAIR` would write outside the arrays.
        begin: First shot.
        end: One past the last.
        scene: The other `SceneArrays`, as a plain tuple, like `shots` and `log`: numba unpacks it in half the time.
        limit: Time at which a shot ends, s; finite if the motion is ideal.
        max_events: Number of events after which a shot ends.
        shots: The `Shots`.
        log: The `Log`; it holds the last shot.
    """
    end_call(_run_shots(kernels, begin, end, scene, limit, max_events, shots, log))
